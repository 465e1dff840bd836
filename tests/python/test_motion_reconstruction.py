"""The flight behind a recording, from Python."""

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest

from somersault import Model, motion, multibody, plotting

DIVER = multibody.diver_planar()
MARKERS = motion.MarkerSet.joint_centres(DIVER.model)
OPEN, PIKE = DIVER.configuration("A"), DIVER.configuration("H")


@cache
def true() -> Any:
    """A pike in the air."""

    def fold(t: float) -> tuple[Any, Any]:
        return OPEN[3:] + np.sin(2 * t) ** 2 * (PIKE - OPEN)[3:], 2 * np.sin(4 * t) * (PIKE - OPEN)[3:]

    v = np.zeros(12)
    v[:3] = 1.0, 4.0, -4.0
    return multibody.fly(DIVER.model, OPEN, v, fold, (0.0, 0.8), dt=0.02)


@cache
def seen() -> motion.MarkerRecording:
    """Its joint centres with noise of 20 mm, of which one is missing now and then."""
    centres = motion.place_markers(MARKERS, true().t, true().q)
    rng = np.random.default_rng(4)
    points = centres.points + rng.normal(0.0, 0.02, centres.points.shape)
    return motion.MarkerRecording(centres.names, centres.times, points, rng.random(points.shape[:2]) > 0.05)


@cache
def flight() -> motion.ReconstructedFlight:
    return motion.reconstruct_flight(MARKERS, seen())


def test_the_flight_is_that_which_was_seen() -> None:
    found = flight()
    assert found.success and found.status == "converged" and len(found) == len(true().t)
    momentum = DIVER.model.centroidal_momentum(true().q[0], true().v[0])[3:]
    off = np.abs(found.angular_momentum - momentum)
    assert (off < 4 * found.angular_momentum_deviation + 1e-9).all()
    assert abs(found.scale - 1.0) < 4 * found.scale_deviation
    assert np.allclose(found.times, true().t)
    # somersaults of the plane are those of the angle, forwards positive
    turns = -(true().q[-1, 2] - true().q[0, 2]) / (2 * np.pi)
    assert abs(found.somersaults[-1] - turns) < 4 * found.somersaults_deviation < 0.2
    assert np.allclose(found.somersaults, motion.somersaults(DIVER.model, found.q), atol=1e-9)
    assert found.unseen == ("toes", "head", "hand") and "no marker sees toes, head, hand" in found.message
    lower, upper = found.chi_squared_range
    assert found.chi_squared is not None and lower < found.chi_squared < upper
    assert abs(found.noise[0] - 0.02) < 0.004 and found.full_dynamics_defect < 1e-3
    kinds = ["whole", "start", "end", "size", "air", "push", "places", "plane"]
    assert list(found.departures) == list(found.departure_limits) == kinds
    assert not any(found.departures[kind] > found.departure_limits[kind] for kind in kinds)
    assert np.isnan(found.departures["size"]) and not np.isnan(found.departures["plane"])


def test_the_laws_of_flight_hold_exactly() -> None:
    found = flight()
    t = found.times - found.times[0]
    fallen = found.center_of_mass[0] + t[:, None] * found.take_off_velocity
    fallen[:, 2] -= 0.5 * 9.81 * t**2
    assert np.abs(fallen - found.center_of_mass).max() < 1e-12
    momentum = DIVER.model.centroidal_momentum(found.q, found.v)[:, 4] * found.scale**2
    assert np.abs(momentum / found.angular_momentum[1] - 1.0).max() < 1e-10
    assert abs(found.height - found.take_off_velocity[2] ** 2 / (2 * 9.81)) < 1e-12
    axis = found.angular_momentum / np.linalg.norm(found.angular_momentum)
    assert np.allclose(np.einsum("i,kij,j->k", axis, found.inertia, axis), found.moment_of_inertia)


def test_arrays_have_the_shapes_that_are_documented() -> None:
    found, n = flight(), len(flight())
    shapes = {
        "q": (n, 12), "v": (n, 12), "deviations": (n, 10), "angular_velocity": (n, 3),
        "angular_velocity_deviation": (n, 3), "moment_of_inertia_deviation": (n,), "inertia": (n, 3, 3),
        "twists": (n,), "tilt": (n,), "inclination": (n,), "inclination_deviation": (n,),
        "covariance": (11, 11), "residuals": (n, 10),
    }  # fmt: skip
    for name, shape in shapes.items():
        assert np.shape(getattr(found, name)) == shape, name
    assert np.isnan(found.residuals).sum() == (~seen().present).sum()
    assert set(found.marker_rms) == set(MARKERS.names)


def test_pickles_and_pictures_take_it() -> None:
    found = flight()
    again = pickle.loads(pickle.dumps(found))
    for name in dir(found):
        value = getattr(found, name)
        if not name.startswith("_") and not callable(value) and name not in {"markers", "model", "phase"}:
            np.testing.assert_equal(getattr(again, name), value)
    assert repr(again) == repr(found) and repr(again.phase) == repr(found.phase)
    assert len(plotting.tree_motion(found, ["thigh"]).lines) == 1


def correlated(rng: np.random.Generator, like: Any, share: float, size: float) -> Any:
    """Noise of which a share is correlated over 0.15 s."""
    slow, kept = rng.normal(size=like.shape), np.exp(-0.02 / 0.15)
    for i in range(1, len(slow)):
        slow[i] = kept * slow[i - 1] + np.sqrt(1.0 - kept**2) * slow[i]
    return size * (np.sqrt(share) * slow + np.sqrt(1.0 - share) * rng.normal(size=like.shape))


def velocity_errors(seed: int, noise: float, share: float, **options: Any) -> tuple[float, float, float]:
    """Errors of the velocity at take-off, and of that of a parabola through the centres of mass; and of g."""
    rng = np.random.default_rng(seed)
    fall = 0.5 * 9.81 * np.square(true().t)

    placed = motion.place_markers(MARKERS, true().t, true().q)
    points = placed.points + correlated(rng, placed.points, share, noise)
    recording = motion.MarkerRecording(placed.names, placed.times, points)
    found = motion.reconstruct_flight(MARKERS, recording, scale=1.0, interval=(0.0, 0.8), **options)
    assert found.status in ("converged", "misfit"), found.message
    known = DIVER.model.centroidal_momentum(true().q[0], true().v[0])[:3] / DIVER.model.mass

    q = motion.MarkerFit(MARKERS, scale=1.0).fit(recording).q
    centres = np.array([DIVER.model.center_of_mass(frame) for frame in q])
    centres[:, 2] += fall
    line = np.polyfit(true().t, centres, 1)[0]
    off = (found.take_off_velocity - known, line - known)
    return float(np.linalg.norm(off[0])), float(np.linalg.norm(off[1])), found.gravity - 1.0


def test_the_velocity_at_take_off_is_as_good_as_that_of_a_parabola() -> None:
    ours, parabola, _ = np.transpose([velocity_errors(seed, 0.03, 0.7) for seed in range(8)])
    assert np.sqrt(np.mean(np.square(ours))) < 1.05 * np.sqrt(np.mean(np.square(parabola)))


@pytest.mark.study
@pytest.mark.parametrize(("noise", "share"), [(0.03, 0.0), (0.03, 0.7), (0.065, 0.7)])
def test_velocity_and_gravity_of_many_flights(noise: float, share: float) -> None:
    ours, parabola, _ = np.transpose([velocity_errors(seed, noise, share) for seed in range(40)])
    ratio = np.sqrt(np.mean(np.square(ours)) / np.mean(np.square(parabola)))
    *_, gravity = np.transpose([velocity_errors(seed, noise, share, seek_gravity=True) for seed in range(40)])
    print(
        f"velocity over that of a parabola {ratio:.3f}; g off by {100 * np.sqrt(np.mean(gravity**2)):.2f} %"
    )
    assert ratio < 1.05


def test_gravity_can_be_sought() -> None:
    found = motion.reconstruct_flight(MARKERS, seen(), seek_gravity=True, noise=0.02, scale=1.0)
    assert found.success and abs(found.gravity - 1.0) < 4 * found.gravity_deviation < 0.1
    assert found.scale_deviation == 0.0 and found.noise == (0.02, 0.0, 0.1)


def test_what_is_no_flight_is_not_called_a_success() -> None:
    # held still in the air
    times = true().t[: len(true().t) // 2]
    still = motion.place_markers(MARKERS, times, np.tile(OPEN, (len(times), 1)))
    points = still.points + np.random.default_rng(1).normal(0.0, 0.01, still.points.shape)
    found = motion.reconstruct_flight(MARKERS, motion.MarkerRecording(still.names, still.times, points))
    assert not found.success and found.status == "misfit" and "but must be" in found.message


def test_frames_before_take_off_are_found() -> None:
    # the feet still push: 20 m/s² in the first 0.06 s
    before = np.maximum(0.06 - seen().times, 0.0)
    points = seen().points.copy()
    points[..., 2] -= 10.0 * before[:, None] ** 2
    pushed = motion.MarkerRecording(seen().names, seen().times, points, seen().present)
    found = motion.reconstruct_flight(MARKERS, pushed, noise=0.02, scale=1.0)
    assert found.status == "misfit" and found.departures["start"] > found.departure_limits["start"]
    assert "at the start" in found.message and "its first frames are no flight" in found.message
    assert motion.reconstruct_flight(MARKERS, pushed, noise=0.02, scale=1.0, interval=(0.06, 0.8)).success


def test_markers_elsewhere_on_their_bodies_are_named_with_their_places() -> None:
    # a marker of the knee that is 60 mm down the shank
    def knee(y: float) -> Any:
        own = motion.MarkerSet(DIVER.model, {"shank": ("shank", (0.0, y, 0.0))})
        return motion.place_markers(own, true().t, true().q).points[:, 0]

    points = seen().points.copy()
    points[:, MARKERS.names.index("shank")] += knee(-0.06) - knee(0.0)
    wrong = motion.MarkerRecording(seen().names, seen().times, points, seen().present)
    found = motion.reconstruct_flight(MARKERS, wrong, scale=1.0, noise=0.02)
    assert found.status == "misfit" and found.departures["places"] > found.departure_limits["places"]
    assert "elsewhere on their bodies" in found.message
    assert set(found.marker_offsets) == set(found.marker_offset_deviations) == set(MARKERS.names)
    assert all(deviation.shape == (3,) for deviation in found.marker_offset_deviations.values())


def test_markers_are_moved_to_where_the_recording_shows_them() -> None:
    offset = np.array([0.0, -0.06, 0.0])
    true_markers = MARKERS.moved({"shank": offset})
    wrong = motion.place_markers(true_markers, true().t, true().q)
    points = wrong.points + np.random.default_rng(5).normal(0.0, 0.02, wrong.points.shape)
    recording = motion.MarkerRecording(wrong.names, wrong.times, points)
    found = motion.reconstruct_flight(MARKERS, recording, scale=1.0)
    assert not found.success and found.departures["places"] > found.departure_limits["places"]
    again = motion.reconstruct_flight(MARKERS.moved(found.marker_offsets), recording, scale=1.0)
    assert again.success
    with pytest.raises(ValueError, match="`offsets` names no marker `chin`"):
        MARKERS.moved({"chin": offset})


@pytest.mark.parametrize("facing", [1.0, -1.0])
def test_one_camera_sees_a_planar_flight_and_its_own_scale_by_gravity(facing: float) -> None:
    markers = motion.MarkerSet.on_diver(DIVER, "halpe_26")
    places = motion.place_markers(markers, true().t, true().q).points
    # 240 pixels a metre, y down, noise of 5 pixels, a few points not found
    rng = np.random.default_rng(6)
    pixels = np.stack([960 + 240 * facing * places[..., 0], 1700 - 240 * places[..., 2]], axis=2)
    pixels += rng.normal(0.0, 5.0, pixels.shape)
    camera = motion.KeypointRecording(
        list(markers.names), true().t, pixels, np.where(rng.random(places.shape[:2]) > 0.05, 0.9, 0.0)
    )
    assumed, forward = 0.005, "x" if facing > 0 else "-x"
    guess = motion.reconstruct_flight(
        markers, camera.markers(scale=assumed, forward=forward), seek_gravity=True, scale=(1.0, 0.3)
    )
    assert guess.success
    scale = assumed / guess.gravity
    assert scale == pytest.approx(1 / 240, rel=4 * guess.gravity_deviation / guess.gravity)
    assert scale == pytest.approx(1 / 240, rel=0.02)
    found = motion.reconstruct_flight(markers, camera.markers(scale=scale, forward=forward))
    assert found.success and np.isnan(found.departures["plane"])
    momentum = DIVER.model.centroidal_momentum(true().q[0], true().v[0])[4]
    assert momentum == pytest.approx(found.angular_momentum[1], rel=0.02)


@pytest.mark.parametrize(
    ("fault", "status"),
    [
        ("tilted", "misfit"),
        ("14°", "converged"),
        pytest.param("pans", "misfit", marks=pytest.mark.study),
        pytest.param("26°", "misfit", marks=pytest.mark.study),
    ],
)
def test_what_a_camera_that_does_not_look_at_the_plane_makes(fault: str, status: str) -> None:
    markers = motion.MarkerSet.on_diver(DIVER, "halpe_26")

    def fold(t: float) -> tuple[Any, Any]:
        return OPEN[3:] + np.sin(2 * t) ** 2 * (PIKE - OPEN)[3:], 2 * np.sin(4 * t) * (PIKE - OPEN)[3:]

    v = np.zeros(12)
    v[:3] = 1.0, 4.0, -4.0
    run = multibody.fly(DIVER.model, OPEN, v, fold, (0.0, 1.2), dt=0.02)
    points = motion.place_markers(markers, run.t, run.q).points
    x, z = points[..., 0], points[..., 2]
    if fault == "tilted":
        c, s = np.cos(np.radians(5.0)), np.sin(np.radians(5.0))
        x, z = c * x - s * z, s * x + c * z
    elif fault == "pans":
        x = x + 0.25 * np.sin(3 * run.t)[:, None]
    else:
        x = x * np.cos(np.radians(float(fault[:-1])))
    seen_points = np.stack([x, points[..., 1], z], axis=2)
    noise = np.random.default_rng(3).normal(0.0, 0.02, seen_points.shape) * (1.0, 0.0, 1.0)
    recording = motion.MarkerRecording(markers.names, run.t, seen_points + noise)
    found = motion.reconstruct_flight(markers, recording)
    assert found.status == status
    if found.success:
        momentum = DIVER.model.centroidal_momentum(run.q[0], run.v[0])[4]
        assert found.angular_momentum[1] == pytest.approx(0.97 * momentum, rel=0.01)


def test_a_planar_body_that_leaves_its_plane_is_refused_with_a_reason() -> None:
    # a tilt that grows to 17°
    points = seen().points.copy()
    centre = np.nanmean(points, axis=1, keepdims=True)
    tilt = 0.3 * np.sin(2.0 * seen().times)[:, None]
    points[..., 1] += tilt * (points - centre)[..., 2]
    tilted = motion.MarkerRecording(seen().names, seen().times, points, seen().present)
    found = motion.reconstruct_flight(MARKERS, tilted)
    assert found.status == "misfit" and found.departures["plane"] > found.departure_limits["plane"]
    report = motion.identify_flight(found, facing="water")
    assert "a body that moves in space is needed" in report.message
    assert report.status in {"not_reconstructed", "other_gravity"} and report.number is None


def test_exchanged_markers_are_put_right() -> None:
    a, b = (MARKERS.names.index(name) for name in ("shank", "hand"))
    points = seen().points.copy()
    points[12:20, [a, b]] = points[12:20, [b, a]]
    present = seen().present.copy()
    present[12:20, [a, b]] = present[12:20, [b, a]]
    wrong = motion.MarkerRecording(seen().names, seen().times, points, present)
    found = motion.reconstruct_flight(MARKERS, wrong)
    assert found.success and flight().exchanges == ()
    ((*names, start, end, n_frames),) = found.exchanges
    assert set(names) == {"shank", "hand"} and n_frames >= 6
    assert seen().times[12] <= start < end <= seen().times[19]
    assert "were exchanged" in found.message and "put right" in found.message


def test_a_wrong_size_is_found() -> None:
    found = motion.reconstruct_flight(MARKERS, seen(), scale=1.06)
    assert found.status == "misfit" and found.departures["size"] > found.departure_limits["size"]
    assert "larger or smaller than `scale`" in found.message


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"knot_spacing": 0.0}, "`knot_spacing` must be positive"),
        ({"scale": (1.0, 2.0)}, "`deviation of the scale` must be positive and at most"),
        ({"scale": "large"}, "`scale` must be a number, or a mean and a standard deviation"),
        ({"noise": -1.0}, "`size of the noise` must be between"),
        ({"noise": (0.1, 2.0, 0.1)}, "`correlated fraction of the noise` must be from 0 to 1"),
        ({"noise": [1]}, "`noise` must be a standard deviation"),
        ({"threshold": 0.0}, "`threshold` must be from 1 to 1000"),
        ({"interval": (1.0, 0.0)}, "`end of the interval` must be after its start"),
        ({"interval": (0.0, 0.1)}, "at least 10 frames that have markers, found 6"),
        ({"max_iterations": 0}, "`max_iterations` must be at least 1"),
        ({"knot_spacing": 1e-6}, "may have 3000 coefficients together"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        motion.reconstruct_flight(MARKERS, seen(), **arguments)


def test_models_that_cannot_fly_are_refused() -> None:
    arm = multibody.two_link_arm()
    centres = motion.MarkerSet.joint_centres(arm)
    with pytest.raises(ValueError, match="must have a free or a planar joint to fly"):
        motion.reconstruct_flight(centres, seen())
    weightless = motion.MarkerSet.joint_centres(Model(DIVER.model.links, gravity=(0, 0, 0)))
    with pytest.raises(ValueError, match="gravity is sought as a multiple"):
        motion.reconstruct_flight(weightless, seen(), seek_gravity=True)
