"""Principal components, projections and groups of motions."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.decomposition import PCA

from somersault import errors, motion, multibody, ocp

Array = NDArray[np.float64]


@pytest.mark.parametrize("shape", [(60, 7), (16, 500), (9, 9), (30, 3000)])
def test_components_are_those_of_scikit_learn(shape: tuple[int, int]) -> None:
    # Singular values a fifth apart at least: components of equal ones are anybody's.
    rng, rank = np.random.default_rng(2), min(shape)
    left, right = (np.linalg.qr(rng.normal(size=(n, rank)))[0] for n in shape)
    samples = left * np.geomspace(30.0, 0.1, rank) @ right.T + 5.0
    pca, other = motion.Pca(samples, 5), PCA(5, svd_solver="full").fit(samples)
    np.testing.assert_allclose(pca.mean, other.mean_, atol=1e-13)
    signs = np.sign(np.sum(pca.components * other.components_, axis=1))
    np.testing.assert_allclose(pca.components, signs[:, None] * other.components_, rtol=0, atol=1e-10)
    np.testing.assert_allclose(pca.explained_variance, other.explained_variance_, rtol=1e-12)
    np.testing.assert_allclose(pca.explained_variance_ratio, other.explained_variance_ratio_, rtol=1e-12)
    np.testing.assert_allclose(pca.scores(samples), signs * other.transform(samples), rtol=0, atol=1e-10)
    largest = pca.components[np.arange(5), np.abs(pca.components).argmax(axis=1)]
    assert (largest > 0.0).all()
    total = samples.var(axis=0, ddof=1).sum()
    assert pca.total_variance == pytest.approx(total, rel=1e-12)
    assert (pca.n_components, pca.n_samples) == (5, shape[0]) and "5 components" in repr(pca)


def test_all_components_reconstruct_the_samples() -> None:
    samples = np.random.default_rng(3).normal(size=(12, 20))
    pca = motion.Pca(samples)
    assert pca.n_components == 11
    np.testing.assert_allclose(pca.reconstruct(pca.scores(samples)), samples, atol=1e-13)


def test_arrays_of_any_order_and_type_are_read() -> None:
    samples = np.arange(24).reshape(6, 4) ** 2
    expected = motion.Pca(samples.astype(float), 2).components
    for same in (samples, np.asfortranarray(samples), samples.tolist(), samples[::-1][::-1]):
        np.testing.assert_array_equal(motion.Pca(same, 2).components, expected)


def test_one_basis_makes_weights_comparable_and_bases_of_single_motions_do_not() -> None:
    t = np.linspace(0.0, 1.0, 30)
    direction = np.array([0.6, -0.8, 0.0])
    motions = [
        np.outer(k * t + 0.01 * np.sin(9 * t), direction) + 0.001 * np.outer(t**2, [0, 0, 1])
        for k in (1.0, -1.0)
    ]
    common = motion.common_eigenpostures(motions, 1)
    rising, falling = (common.scores(m)[:, 0] for m in motions)
    assert np.ptp(rising) > 0.9 and np.corrcoef(rising, falling)[0, 1] < -0.99
    alone = motion.eigenpostures_per_motion(motions, 1)
    assert len(alone) == 2 and all(pca.n_samples == 30 for pca in alone)
    np.testing.assert_allclose(common.mean, np.vstack(motions).mean(axis=0), atol=1e-15)


@pytest.mark.parametrize(
    ("samples", "n", "message"),
    [
        (np.zeros((1, 3)), 1, "`samples` must have at least 2 entries, found 1"),
        (np.zeros((0, 3)), 1, "`samples` must have at least 2 entries, found 0"),
        (np.eye(3), 3, "`n_components` must be between 1 and 2 for 3 samples of 3 numbers, found 3"),
        (np.eye(3), 0, "`n_components` must be between 1 and 2"),
        (np.full((3, 3), np.nan), 1, "`samples` must be finite, but is not in row 0"),
        (np.ones((4, 3)), 1, "do not differ"),
        (np.diag([1.0, 2.0, 1e160]), 1, "`samples` must be within ±1e100, found 1e160 in row 2"),
        (np.zeros(3), 1, r"`samples` must be real numbers of shape \(n, m\), found shape \(3,\)"),
        ("abc", 1, "`samples` must be real numbers"),
    ],
)
def test_samples_without_components_are_refused(samples: Any, n: int, message: str) -> None:
    with pytest.raises(errors.InputError, match=message):
        motion.Pca(samples, n)


def test_widths_must_fit() -> None:
    pca = motion.Pca(np.random.default_rng(0).normal(size=(5, 3)), 2)
    with pytest.raises(errors.InputError, match="`columns of samples` must have 3 entries, found 4"):
        pca.scores(np.zeros((2, 4)))
    with pytest.raises(errors.InputError, match="`columns of scores` must have 2 entries, found 3"):
        pca.reconstruct(np.zeros((2, 3)))
    with pytest.raises(errors.InputError, match="`columns of motions` must have 3 entries, found 2"):
        motion.common_eigenpostures([np.eye(3), np.eye(3)[:, :2]], 1)
    with pytest.raises(errors.InputError, match="`motions`"):
        motion.common_eigenpostures([], 1)
    with pytest.raises(errors.InputError, match=r"`motions\[1\]` must be real numbers of shape"):
        motion.common_eigenpostures([np.eye(3), np.zeros(3)], 1)


class TestProjection:
    base = ocp.EigenpostureBase([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])

    def test_free_weights_are_least_squares(self) -> None:
        postures = np.random.default_rng(1).normal(size=(10, 3))
        found = motion.project(self.base, postures, bounds="none")
        np.testing.assert_allclose(found.weights, postures[:, :2] / [1.0, 2.0], atol=1e-14)
        np.testing.assert_allclose(found.distances, np.abs(postures[:, 2]), atol=1e-14)

    def test_bounded_weights_are_the_nearest_of_the_simplex(self) -> None:
        found = motion.project(self.base, [[-1.0, 1.0, 0.0], [0.4, 0.4, 0.1], [2.0, 0.0, 0.0]])
        np.testing.assert_allclose(found.weights, [[0.0, 0.5], [0.4, 0.2], [1.0, 0.0]], atol=1e-12)
        np.testing.assert_allclose(found.distances, [1.0, 0.1, 1.0], atol=1e-12)

    def test_a_base_of_another_size_is_refused(self) -> None:
        with pytest.raises(errors.InputError, match="must have 3 entries, found 2"):
            motion.project(self.base, np.zeros((4, 2)))
        with pytest.raises(errors.InputError, match="`postures` must be finite, but is not in row 1"):
            motion.project(self.base, [[0, 0, 0], [0, np.inf, 0]])
        with pytest.raises(errors.InputError, match="`bounds` must be 'simplex' or 'none'"):
            motion.project(self.base, np.zeros((4, 3)), bounds="box")  # type: ignore[arg-type]


def fitted(exit_: float, turns: float, n: int = 25) -> motion.MotionFit:
    """A pike that opens at a fraction of the time, fitted by eigenweights."""
    diver = multibody.diver_planar()
    base = ocp.EigenpostureBase([diver.configuration(p)[3:] for p in "AH"])
    markers = motion.MarkerSet.joint_centres(diver.model)
    t = np.linspace(0.0, 1.5, n)
    weight = 0.9 / (1.0 + np.exp(20.0 * (t / 1.5 - exit_)))
    q = np.zeros((n, 12))
    q[:, 2] = -2.0 * np.pi * turns * t / 1.5
    q[:, 3:] = [base.positions([w]) for w in weight]
    seen = motion.place_markers(markers, t, q, scale=1.0 + 0.1 * exit_)
    return motion.MarkerFit(markers, base=base).fit(seen)


class TestGroups:
    best = (fitted(0.7, 3.5), fitted(0.8, 3.6), fitted(0.75, 3.4))
    worst = (fitted(0.5, 3.0), fitted(0.55, 3.1))

    def test_bands_are_means_and_deviations(self) -> None:
        for panel in ("eigenweight", "marker_error", "scale", "rotation"):
            groups = motion.GroupComparison({"best": self.best, "worst": self.worst}, panel, n_frames=30)  # type: ignore[arg-type]
            assert groups.names == ("best", "worst") and groups.panel == panel
            series = groups.series("best")
            assert series.shape == (3, 30)
            band = groups.bands()["best"]
            np.testing.assert_allclose(band.mean, series.mean(axis=0), atol=1e-14)
            np.testing.assert_allclose(band.deviation, series.std(axis=0, ddof=1), atol=1e-13)

    def test_the_series_are_those_of_the_motions(self) -> None:
        n = len(self.best[0])
        rotation = motion.GroupComparison({"best": self.best}, "rotation", n_frames=n).series("best")
        np.testing.assert_allclose(rotation[:, -1], [3.5, 3.6, 3.4], atol=1e-6)
        weights = motion.GroupComparison({"best": self.best}, "eigenweight", n_frames=n).series("best")
        np.testing.assert_allclose(weights[1], self.best[1].weights[:, 0], atol=1e-12)
        scale = motion.GroupComparison({"worst": self.worst}, "scale").series("worst")
        np.testing.assert_allclose(scale[1], 1.055, atol=1e-7)

    def test_somersaults_are_counted(self) -> None:
        q = self.best[0].q
        turns = motion.somersaults(multibody.diver_planar().model, q)
        assert turns is not None
        np.testing.assert_allclose(turns, -(q[:, 2] - q[0, 2]) / (2 * np.pi))
        spatial = multibody.diver_spatial()
        v = np.zeros(spatial.model.n_velocities)
        v[4] = 1.0
        somersault = np.array(
            [spatial.model.displace(spatial.configuration("A"), x * v) for x in np.linspace(0, 9, 20)]
        )
        turns = motion.somersaults(spatial.model, somersault)
        assert turns is not None and turns[-1] == pytest.approx(9 / (2 * np.pi), rel=1e-12)
        assert motion.somersaults(multibody.two_link_arm(), [[0.0, 0.0]]) is None
        still = multibody.Model([multibody.Link("post", "fixed")])
        assert motion.somersaults(still, np.zeros((2, 0))) is None
        with pytest.raises(errors.InputError, match="`model` must have joints that move"):
            motion.SyntheticFlight(still, np.arange(6.0), np.zeros((6, 0)))

    def test_what_cannot_be_compared_is_refused(self) -> None:
        with pytest.raises(errors.InputError, match="`groups` must have a fitted motion"):
            motion.GroupComparison({}, "scale")
        with pytest.raises(errors.InputError, match="`weights` must have at least 3 entries"):
            motion.GroupComparison({"a": self.best}, "eigenweight", weight=2)
        with pytest.raises(errors.InputError, match="`panel` must be"):
            motion.GroupComparison({"a": self.best}, "colour")  # type: ignore[arg-type]
        with pytest.raises(errors.InputError, match="one of the groups a, found 'b'"):
            motion.GroupComparison({"a": self.best}, "scale").series("b")
        with pytest.raises(errors.InputError, match="`n_frames`"):
            motion.GroupComparison({"a": self.best}, "scale", n_frames=0)
        with pytest.raises(errors.InputError, match="`series`"):
            motion.Band(np.zeros((0, 4)))
        markers = motion.MarkerSet.joint_centres(multibody.diver_spatial().model)
        q = [multibody.diver_spatial().configuration("A")]
        other = motion.MarkerFit(markers).fit(motion.place_markers(markers, [0.0], q))
        with pytest.raises(errors.InputError, match="one kind of model"):
            motion.GroupComparison({"a": [*self.best, other]}, "scale")
        with pytest.raises(errors.InputError, match="`q` must have 12 columns"):
            motion.somersaults(multibody.diver_planar().model, np.zeros((2, 5)))

    def test_motions_without_markers_have_nothing_to_compare(self) -> None:
        fit = self.best[0].fit
        names = fit.markers.names
        shape = (1, len(names))
        nothing = fit.fit(motion.MarkerRecording(names, [0.0], np.zeros((*shape, 3)), np.zeros(shape, bool)))
        message = r"`groups\['worst'\]\[1\]` must have markers, but has none in any frame"
        for panel in ("marker_error", "scale", "rotation"):
            with pytest.raises(errors.InputError, match=message):
                motion.GroupComparison({"best": self.best, "worst": [self.worst[0], nothing]}, panel)  # type: ignore[arg-type]

    def test_numbers_whose_squares_overflow_are_refused(self) -> None:
        with pytest.raises(errors.InputError, match="`series` must be within ±1e100, found 1e308 in row 1"):
            motion.Band([[1.0, 2.0], [1e308, 2.0]])
        with pytest.raises(errors.InputError, match="`values` must be within ±1e100, found 1e200 in row 0"):
            motion.normalize_frames([0.0, 1.0], [1e200, 0.0], 3)

    def test_figure_4_1_has_four_panels(self) -> None:
        mpl = pytest.importorskip("matplotlib")
        mpl.use("Agg")
        from somersault import plotting

        axes = plotting.motion_groups(
            {"best": self.best, "worst": self.worst}, {"generated": fitted(0.9, 3.2)}
        )
        assert [len(ax.lines) for ax in axes] == [3, 2, 2, 3]
        np.testing.assert_allclose(
            axes[1].lines[0].get_ydata(),
            1e3 * motion.GroupComparison({"best": self.best}, "marker_error").bands()["best"].mean,
        )
        import matplotlib.pyplot as plt

        plt.close("all")


def test_quantities_are_brought_to_a_number_of_frames() -> None:
    t = np.array([0.0, 0.1, 0.4, 1.0])
    found = motion.normalize_frames(t, t**3 - t, 11)
    np.testing.assert_allclose(found, np.linspace(0, 1, 11) ** 3 - np.linspace(0, 1, 11), atol=1e-14)
    with pytest.raises(errors.InputError, match="`values`"):
        motion.normalize_frames(t, [1.0], 3)
    with pytest.raises(errors.InputError, match="`n_frames`"):
        motion.normalize_frames(t, t, 0)
