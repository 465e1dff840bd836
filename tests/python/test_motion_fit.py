"""Models fitted to markers: what is known is found again; what cannot be fitted is refused."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from somersault import errors, motion, multibody, ocp

Array = NDArray[np.float64]

PLANAR, SPATIAL = multibody.diver_planar(), multibody.diver_spatial()


def three_on_each(model: multibody.Model) -> motion.MarkerSet:
    """A marker at the joint, one beyond the centre and one beside it, on each body that has a mass."""
    markers: dict[str, tuple[str | int, Any]] = {}
    for link in model.links:
        if link.mass > 0.0:
            markers[link.name] = (link.name, np.zeros(3))
            markers[f"{link.name} end"] = (link.name, 2.0 * link.center + [0.05, 0.0, 0.0])
            markers[f"{link.name} side"] = (link.name, np.add(link.center, (0.0, 0.06, 0.04)))
    return motion.MarkerSet(model, markers)


def tumble(diver: multibody.Diver, n: int = 40) -> tuple[Array, Array]:
    """A motion inside the limits of the joints: from B towards F and on, turning."""
    model, t = diver.model, np.linspace(0.0, 1.0, n)
    root = model.n_positions - len(diver.configuration("A")[model.positions_of(0)])
    first, last = diver.configuration("B"), diver.configuration("F")
    share = (0.25 + 0.5 * t)[:, None]
    q = first + share * (last - first)
    v = np.zeros(model.n_velocities)
    v[: model.n_velocities - root] = 0.3
    q = np.array([model.displace(row, s * v) for row, s in zip(q, 4.0 * t, strict=True)])
    return t, q


def blurred(
    recording: motion.MarkerRecording, noise: float, missing: float = 0.0, seed: int = 1
) -> motion.MarkerRecording:
    rng = np.random.default_rng(seed)
    points = recording.points + rng.normal(0.0, noise, recording.points.shape)
    return motion.MarkerRecording(
        recording.names, recording.times, points, rng.random(recording.present.shape) >= missing
    )


@pytest.mark.parametrize("diver", [PLANAR, SPATIAL], ids=["planar", "spatial"])
class TestKnownMotions:
    def test_are_found_again_to_1e_6_without_noise(self, diver: multibody.Diver) -> None:
        markers = three_on_each(diver.model)
        t, q = tumble(diver)
        fit = motion.MarkerFit(markers).fit(motion.place_markers(markers, t, q, scale=1.1))
        assert fit.success and set(fit.status) == {"converged"}
        assert np.abs(diver.model.difference(fit.q, q)).max() < 1e-6
        np.testing.assert_allclose(fit.scale, 1.1, atol=1e-8)
        assert fit.rms < 1e-8 and fit.residuals.shape == (len(t), len(markers))

    def test_are_found_within_the_error_predicted_with_noise(self, diver: multibody.Diver) -> None:
        markers = three_on_each(diver.model)
        t, q = tumble(diver)
        seen = blurred(motion.place_markers(markers, t, q), 0.01, missing=0.2)
        assert seen.n_missing > 0.15 * seen.present.size
        fit = motion.MarkerFit(markers, scale=1.0, noise=0.01).fit(seen)
        assert fit.converged
        off = diver.model.difference(q, fit.q)
        scores = []
        for i in range(len(t)):
            covariance = fit.covariance(i)
            assert covariance is not None
            variances = np.diag(covariance)
            for variance, status in zip(variances, fit.unknown_status[i], strict=True):
                assert np.isinf(variance) == (status == "undetermined")
            if np.isinf(variances).any():
                continue  # a body without its markers is not determined
            assert covariance.shape == (1 + off.shape[1],) * 2
            assert np.abs(covariance - covariance.T).max() < 1e-15
            deviation = np.sqrt(np.diag(covariance)[1:])
            # an unknown that no bound is near
            free = deviation > 0.0
            scores.append(np.where(free, off[i] / np.where(free, deviation, 1.0), np.nan))
        z = np.array(scores)[:, np.isfinite(scores).all(axis=0)]
        assert len(z) >= 0.8 * len(t) and z.shape[1] >= 0.6 * off.shape[1]
        # linearised; bounds cut a little
        assert np.abs(z.mean(axis=0)).max() < 4.0 / np.sqrt(len(z))
        assert np.sqrt((z**2).mean()) == pytest.approx(1.0, abs=0.1)


class TestFits:
    def test_eigenweights_stay_within_their_bounds(self) -> None:
        diver, t = PLANAR, np.linspace(0.0, 1.0, 21)
        base = ocp.EigenpostureBase([diver.configuration(p)[3:] for p in "AHF"])
        weights = np.stack([np.sin(np.pi * t) ** 2, 0.5 * np.cos(np.pi * t) ** 2], axis=1)
        q = np.zeros((21, 12))
        q[:, 2] = -2.0 * t
        q[:, 3:] = [base.positions(w) for w in weights]
        markers = motion.MarkerSet.joint_centres(diver.model)
        fit = motion.MarkerFit(markers, base=base).fit(motion.place_markers(markers, t, q, scale=0.9))
        np.testing.assert_allclose(fit.weights, weights, atol=1e-6)
        np.testing.assert_allclose(fit.q, q, atol=1e-6)
        q[:, 3:] = diver.configuration("G")[3:]
        outside = motion.MarkerFit(markers, base=base).fit(motion.place_markers(markers, t, q))
        assert outside.weights.min() >= 0.0 and outside.weights.sum(axis=1).max() <= 1.0 + 1e-12
        assert outside.rms > 0.01

    def test_a_common_scale_is_one_for_all_frames(self) -> None:
        markers = three_on_each(PLANAR.model)
        t, q = tumble(PLANAR, 15)
        seen = blurred(motion.place_markers(markers, t, q, scale=1.2), 0.005)
        each = motion.MarkerFit(markers).fit(seen)
        common = motion.MarkerFit(markers, common_scale=True).fit(seen)
        assert np.ptp(each.scale) > 1e-3 and np.ptp(common.scale) == 0.0 and common.success
        assert common.scale[0] == pytest.approx(1.2, abs=5e-3)
        assert each.cost.sum() < common.cost.sum()

    def test_robust_losses_forget_outliers(self) -> None:
        markers = three_on_each(PLANAR.model)
        t, q = tumble(PLANAR, 15)
        seen = motion.place_markers(markers, t, q)
        points = seen.points
        points[4:8, 3] += [0.0, 0.5, 0.5]
        off = motion.MarkerRecording(seen.names, t, points)
        errors_of = {
            loss: np.abs(motion.MarkerFit(markers, scale=1.0, **options).fit(off).q - q).max()
            for loss, options in (
                ("squares", {}),
                ("huber", {"loss": "huber", "threshold": 0.01}),
                ("cauchy", {"loss": "cauchy", "threshold": 0.01}),
            )
        }
        assert errors_of["cauchy"] < 1e-3 < errors_of["huber"] < 0.2 * errors_of["squares"]

    def test_residuals_are_the_distances_of_markers(self) -> None:
        markers = three_on_each(PLANAR.model)
        t, q = tumble(PLANAR, 5)
        seen = blurred(motion.place_markers(markers, t, q), 0.02, missing=0.3)
        fit = motion.MarkerFit(markers, max_iterations=3).fit(seen)
        again = motion.place_markers(markers, t, fit.q, scale=fit.scale)
        distances = np.linalg.norm(again.points - seen.points, axis=2)
        np.testing.assert_allclose(fit.residuals, distances, atol=1e-12)
        assert fit.rms == pytest.approx(np.sqrt(np.nanmean(distances**2)))
        by_marker = np.sqrt(np.nanmean(distances**2, axis=0))
        np.testing.assert_allclose([fit.marker_rms[name] for name in markers.names], by_marker)
        np.testing.assert_allclose(fit.frame_rms, np.sqrt(np.nanmean(distances**2, axis=1)))
        assert max(fit.iterations) <= 3 and "rms" in repr(fit) and len(fit) == 5

    def test_perfect_fits_converge_where_markers_do_not_determine_all_joints(self) -> None:
        markers = motion.MarkerSet.joint_centres(PLANAR.model)
        q = np.linspace(PLANAR.configuration("A"), PLANAR.configuration("H"), 12)
        whole = motion.place_markers(markers, np.linspace(0.0, 1.0, 12), q)
        for seed in range(3):
            fit = motion.MarkerFit(markers).fit(blurred(whole, 0.0, missing=0.2, seed=seed))
            assert fit.converged and fit.rms < 1e-9, (seed, fit.status, fit.rms)

    def test_weights_draw_the_model_to_a_marker(self) -> None:
        model = PLANAR.model
        places: dict[str, tuple[str | int, Any]] = {
            "hip": ("torso", (0, 0, 0)),
            "head": (model.names[-1], (0, 0, 0)),
        }
        t, q = np.array([0.0]), np.array([PLANAR.configuration("B")])
        points = motion.place_markers(motion.MarkerSet(model, places), t, q).points * 1.1
        seen = motion.MarkerRecording(list(places), t, points)
        options: dict[str, Any] = {"scale": 1.0, "starts": [q[0, 3:]], "max_iterations": 300}
        near = [
            motion.MarkerFit(motion.MarkerSet(model, places, {"head": weight}), **options)
            .fit(seen)
            .marker_rms
            for weight in (1.0, 100.0)
        ]
        assert near[1]["head"] <= near[0]["head"] + 1e-9

    def test_frames_without_markers_say_so(self) -> None:
        markers = three_on_each(PLANAR.model)
        t, q = tumble(PLANAR, 4)
        seen = motion.place_markers(markers, t, q)
        present = seen.present.copy()
        present[2] = False
        fit = motion.MarkerFit(markers).fit(motion.MarkerRecording(seen.names, t, seen.points, present))
        assert fit.status[2] == "no_markers" and fit.converged and not fit.success
        assert fit.message.startswith("1 of 4 frames: no markers; not determined by the markers: scale,")
        assert set(fit.unknown_status[2]) == {"undetermined"}
        assert np.isnan(fit.frame_rms[2]) and fit.covariance(2) is None
        np.testing.assert_array_equal(fit.q[2], fit.q[1])
        nothing = motion.MarkerRecording(seen.names, t, seen.points, np.zeros_like(present))
        found = motion.MarkerFit(markers).fit(nothing)
        assert not found.success and not found.converged

    def test_an_unseen_hand_and_a_mirrored_axis_are_told_apart(self) -> None:
        markers = three_on_each(PLANAR.model)
        t, q = tumble(PLANAR, 4)
        seen = motion.place_markers(markers, t, q)
        names = [name for name in seen.names if not name.startswith("hand")]
        fit = motion.MarkerFit(markers, scale=1.0, noise=0.001).fit(seen.select(names))
        assert fit.converged and not fit.success and fit.status == ["converged"] * 4
        assert fit.message == "not determined by the markers: hand"
        assert motion.MarkerFit(markers).fit(seen).message == "converged, and every unknown is determined"
        assert fit.unknowns[:4] == ("scale", "torso 0", "torso 1", "torso 2")
        for i, statuses in enumerate(fit.unknown_status):
            found = dict(zip(fit.unknowns, statuses, strict=True))
            assert (found.pop("scale"), found.pop("hand")) == ("given", "undetermined")
            assert set(found.values()) <= {"determined", "at_limit"}
            variances = np.diag(fit.covariance(i))
            assert [np.isinf(v) for v in variances] == [name == "hand" for name in fit.unknowns]
        mirrored = motion.MarkerRecording(seen.names, t, seen.points * [-1.0, 1.0, 1.0])
        fit = motion.MarkerFit(markers, scale=1.0).fit(mirrored)
        assert fit.status == ["mirrored"] * 4 and not fit.success and "no success" in repr(fit)


def test_markers_are_placed_about_the_root_at_a_scale() -> None:
    markers = three_on_each(SPATIAL.model)
    _, q = tumble(SPATIAL, 4)
    once, twice = (motion.place_markers(markers, np.arange(4.0), q, scale=s).points for s in (1.0, 2.0))
    root = np.asarray(SPATIAL.model.poses(q))[:, :1, :3, 3]
    np.testing.assert_allclose(twice - root, 2.0 * (once - root), atol=1e-14)
    single = motion.place_markers(markers, [0.0], q[1]).points[0]
    np.testing.assert_array_equal(single, once[1])
    with pytest.raises(errors.InputError, match="`q`"):
        motion.place_markers(markers, [0.0], q[:1, :-1])


class TestRefused:
    def test_markers(self) -> None:
        model = PLANAR.model
        with pytest.raises(errors.InputError, match="at least one marker"):
            motion.MarkerSet(model, {})
        with pytest.raises(errors.InputError, match=r"`markers\['a'\]`: .*tail"):
            motion.MarkerSet(model, {"a": ("tail", (0, 0, 0))})
        with pytest.raises(errors.InputError, match=r"markers\['a'\]"):
            motion.MarkerSet(model, {"a": (0, (0, np.nan, 0))})
        with pytest.raises(errors.InputError, match=r"`weights\['b'\]` must be positive"):
            motion.MarkerSet(model, {"a": (0, (0, 0, 0)), "b": (0, (0, 0, 0))}, {"b": -1.0})
        with pytest.raises(errors.InputError, match="names no marker 'b'"):
            motion.MarkerSet(model, {"a": (0, (0, 0, 0))}, {"b": 1.0})

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"scale": 0.0}, "bounds of the scale"),
            ({"scale": (2.0, 1.0)}, "bounds of the scale"),
            ({"scale": 1.0, "common_scale": True}, "`common_scale` needs bounds"),
            ({"loss": "huber"}, "needs a `threshold`"),
            ({"loss": "huber", "threshold": -1.0}, "`threshold` must be positive"),
            ({"threshold": 0.1}, "`threshold` is for"),
            ({"loss": "median"}, "`loss` must be"),
            ({"starts": [[0.0]]}, "`starts` must have 9 entries, found 1"),
            ({"step_tol": 0.0}, "`step_tol` must be positive"),
            ({"scale": (0.5, 1e200)}, "`scale` must be within ±1e100, found 1e200"),
            ({"starts": [[1e200] * 9]}, "`starts` must be within ±1e100, found 1e200"),
            ({"loss": "cauchy", "threshold": 1e200}, "`threshold` must be within ±1e100, found 1e200"),
            ({"noise": 1e200}, "`noise` must be within ±1e100, found 1e200"),
            ({"noise": np.nan}, "`noise` must be positive"),
            ({"base": ocp.EigenpostureBase([[0.0, 0.0], [1.0, 0.0]])}, "must have 9 entries, found 2"),
        ],
    )
    def test_options(self, options: dict[str, Any], message: str) -> None:
        with pytest.raises(errors.InputError, match=message):
            motion.MarkerFit(motion.MarkerSet.joint_centres(PLANAR.model), **options)

    def test_numbers_whose_squares_overflow(self) -> None:
        markers = motion.MarkerSet.joint_centres(PLANAR.model)
        seen = motion.place_markers(markers, [0.0], [PLANAR.configuration("A")])
        for far in (1e150, -1e200):
            points = seen.points
            points[0, 3, 1] = far
            with pytest.raises(
                errors.InputError, match=f"`recording` must be within ±1e100, found {far:.0e}"
            ):
                motion.MarkerFit(markers).fit(motion.MarkerRecording(seen.names, seen.times, points))
        for place, weight, name in (((0.0, 1e200, 0.0), 1.0, "markers"), ((0.0, 0.0, 0.0), 1e200, "weights")):
            message = rf"`{name}\['a'\]` must be within ±1e100, found 1e200"
            with pytest.raises(errors.InputError, match=message):
                motion.MarkerSet(PLANAR.model, {"a": (0, place)}, {"a": weight})

    def test_recordings_of_something_else(self) -> None:
        fit = motion.MarkerFit(motion.MarkerSet.joint_centres(PLANAR.model))
        other = motion.MarkerRecording(["nose"], [0.0], np.zeros((1, 1, 3)))
        with pytest.raises(errors.InputError, match=r"none of the markers .*; it has nose"):
            fit.fit(other)
        done = fit.fit(motion.place_markers(fit.markers, [0.0], [PLANAR.configuration("A")]))
        with pytest.raises(errors.InputError, match="`frame` must be between 0 and 0, found"):
            done.covariance(1)
