"""Flows, spectra, subspaces and placement from Python, against closed forms and against SciPy."""

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from somersault import errors, ftla, multibody

#: Start of the motion of thesis 8.4.
START = np.array(
    [-np.pi / 2, 0.05, 0.0, 0.0, -0.20342284657942628, -0.013000184725439342, -1.3301476310359088,
     -0.12234910357574813]
)  # fmt: skip

#: crates/somersault-ftla/tests/reference/exponents.py, 60 digits: positive exponents at the start.
EXPONENTS = {
    2.0: [0.394746429866988, 0.520276312392858, 4.14612466842201, 4.4682202552221],
    5.0: [0.293676890574938, 0.428228058800708, 2.71509930623798, 3.27130256991292],
}

RATES = np.array([[-1.0, -1.0], [-1.0, 1.0]])


@pytest.fixture(scope="module")
def arm() -> ftla.VariationalFlow:
    return ftla.VariationalFlow(ftla.arm(), rtol=1e-12)


def test_the_field_of_the_arm_is_the_gradient_of_its_hamiltonian() -> None:
    system = ftla.arm(masses=(0.7, 0.4), lengths=(1.5, 0.6), damping=(0.1, 0.05), weights=(2.0, 0.3))
    rng = np.random.default_rng(3)
    points = rng.normal(size=(5, 8))
    step = 1e-6 * np.eye(8)
    for p, h, jacobian in zip(points, system.field(points), system.jacobian(points), strict=True):
        gradient = (system.hamiltonian(p + step) - system.hamiltonian(p - step)) / 2e-6
        np.testing.assert_allclose(h, np.concatenate([gradient[4:], -gradient[:4]]), rtol=1e-6, atol=1e-6)
        differences = (system.field(p + step) - system.field(p - step)).T / 2e-6
        np.testing.assert_allclose(jacobian, differences, rtol=1e-5, atol=1e-5 * np.abs(jacobian).max())


def test_the_arm_is_the_tree_of_the_arm() -> None:
    arm, tree = ftla.arm(weights=(1.0, 0.5)), ftla.tree(multibody.two_link_arm(), [1.0, 0.5])
    rng = np.random.default_rng(4)
    p = rng.normal(size=(4, 8))
    np.testing.assert_allclose(tree.field(p), arm.field(p), rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(tree.jacobian(p), arm.jacobian(p), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(tree.control(p), arm.control(p), rtol=1e-11)
    np.testing.assert_allclose(tree.hamiltonian(p), arm.hamiltonian(p), rtol=1e-10)
    np.testing.assert_allclose(tree.running_cost(p), arm.running_cost(p), rtol=1e-10)


def test_torques_stay_within_their_limits() -> None:
    limited, free = ftla.arm(torque_limits=(0.1, 0.02)), ftla.arm()
    assert (np.abs(limited.control(START)) <= (0.1, 0.02)).all()
    np.testing.assert_allclose(
        limited.control(START), np.clip(free.control(START), (-0.1, -0.02), (0.1, 0.02))
    )


def test_joints_of_a_tree_may_be_limited_or_passive() -> None:
    arm = multibody.two_link_arm()
    limited = ftla.tree(arm, [1.0, 0.5], torque_limits=(0.1, 0.02))
    np.testing.assert_allclose(
        limited.field(START), ftla.arm(torque_limits=(0.1, 0.02)).field(START), atol=1e-11
    )
    passive = ftla.tree(arm, passive=[1])
    assert passive.control(START)[1] == 0.0 != passive.control(START)[0]
    assert "passive=[1]" in repr(passive)


def test_one_point_has_the_shapes_of_one() -> None:
    system = ftla.arm()
    assert system.dimension == 8 and system.n_controls == 2
    assert system.field(START).shape == (8,) and system.jacobian(START).shape == (8, 8)
    assert isinstance(system.hamiltonian(START), float) and system.control(START).shape == (2,)
    many = np.tile(START, (3, 1))
    assert system.jacobian(many).shape == (3, 8, 8) and system.running_cost(many).shape == (3,)
    assert "masses=[0.5, 0.5]" in repr(system)


def test_the_transition_matrix_of_a_linear_system_is_its_exponential() -> None:
    flow = ftla.VariationalFlow(ftla.linear_regulator())
    for duration in (3.0, -3.0):
        found = flow.transition([1.0, 0.4], duration)
        expected = expm(duration * RATES)
        np.testing.assert_allclose(found.matrix, expected, rtol=1e-10)
        np.testing.assert_allclose(found.end, expected @ [1.0, 0.4], rtol=1e-10)
        assert found.duration == duration and found.symplecticity_defect < 1e-12


def test_the_flow_of_the_arm_is_that_of_scipy(arm: ftla.VariationalFlow) -> None:
    def rate(t: float, y: np.ndarray) -> np.ndarray:
        p, phi = y[:8], y[8:].reshape(8, 8)
        return np.concatenate([arm.system.field(p), (arm.system.jacobian(p) @ phi).ravel()])

    reference = solve_ivp(
        rate, (0.0, 1.0), np.concatenate([START, np.eye(8).ravel()]), method="DOP853", rtol=1e-11, atol=1e-12
    ).y[:, -1]
    found = arm.transition(START, 1.0)
    np.testing.assert_allclose(found.end, reference[:8], atol=1e-8)
    np.testing.assert_allclose(found.matrix.ravel(), reference[8:], atol=1e-6 * np.abs(reference[8:]).max())


def test_forward_and_backward_are_inverse(arm: ftla.VariationalFlow) -> None:
    there = arm.transition(START, 1.0)
    back = arm.transition(there.end, -1.0)
    np.testing.assert_allclose(back.end, START, atol=1e-9)
    np.testing.assert_allclose(back.matrix @ there.matrix, np.eye(8), atol=1e-6)


def test_many_points_are_as_each_alone(arm: ftla.VariationalFlow) -> None:
    points = START + 1e-4 * np.random.default_rng(5).normal(size=(6, 8))
    ends, matrices = arm.transitions(points, 1.5)
    for p, end, matrix in zip(points, ends, matrices, strict=True):
        alone = arm.transition(p, 1.5)
        np.testing.assert_array_equal(alone.end, end)
        np.testing.assert_array_equal(alone.matrix, matrix)
    np.testing.assert_array_equal(arm.state(points[0], [0.5, -0.5]).shape, (2, 8))


def test_the_cost_is_the_integral_of_the_running_cost() -> None:
    # λ = (√2 − 1) x: x = e^(−√2 t), cost ½ x₀ λ₀ (1 − e^(−2√2 t))
    flow = ftla.VariationalFlow(ftla.linear_regulator())
    root = np.sqrt(2.0)
    _, cost = flow.cost([1.0, root - 1.0], 1.0)
    assert cost == pytest.approx(0.5 * (root - 1.0) * (1.0 - np.exp(-2.0 * root)), rel=1e-11)


def test_factors_multiply_to_the_matrix(arm: ftla.VariationalFlow) -> None:
    chain = arm.chain(START, [1.0, 2.0])
    product = np.eye(8)
    for link in (chain[k] for k in range(len(chain))):
        product = link.matrix @ product
    whole = arm.transition(START, 2.0)
    np.testing.assert_allclose(product, whole.matrix, rtol=1e-6, atol=1e-8 * np.abs(whole.matrix).max())
    assert chain.marks[-1] == len(chain) and list(chain.times) == [1.0, 2.0] and chain.n_evaluations > 0
    np.testing.assert_array_equal(chain[-1].end, chain[len(chain) - 1].end)
    assert chain.spectrum(0).time == pytest.approx(1.0) and chain.spectrum().time == pytest.approx(2.0)
    with pytest.raises(errors.InputError, match="`mark` must be from -2 to 1, found 2"):
        chain.spectrum(2)


def test_all_exponents_of_the_arm_are_those_of_extended_precision(arm: ftla.VariationalFlow) -> None:
    for spectrum in arm.spectra(START, list(EXPONENTS)):
        positive = np.array(EXPONENTS[spectrum.time])
        expected = np.concatenate([-positive[::-1], positive])
        np.testing.assert_allclose(spectrum.exponents, expected, atol=1e-8)
        assert spectrum.pairing_defect < 1e-8
        np.testing.assert_allclose(spectrum.vectors.T @ spectrum.vectors, np.eye(8), atol=1e-12)
        np.testing.assert_array_equal(spectrum.rates, spectrum.exponents)


def test_backward_exponents_descend(arm: ftla.VariationalFlow) -> None:
    spectrum = arm.spectrum(arm.state(START, 2.0), 1.0, "backward")
    assert spectrum.direction == "backward" and (np.diff(spectrum.exponents) <= 0.0).all()
    np.testing.assert_array_equal(spectrum.rates, -spectrum.exponents)


def test_the_arm_is_partially_hyper_sensitive_in_words_and_numbers(arm: ftla.VariationalFlow) -> None:
    spectra = arm.spectra(START, np.arange(0.5, 5.1, 0.5))
    diagnosis = ftla.diagnose(spectra, 10.0)
    assert diagnosis.dims == (2, 4, 2)
    assert diagnosis.is_hyper_sensitive and diagnosis.is_partially_hyper_sensitive
    assert str(diagnosis).startswith("partially hyper-sensitive: 2 stable, 4 centre and 2 unstable")
    assert min(diagnosis.gaps) > 2.0 and diagnosis.time_constants > 7.0
    assert min(diagnosis.fast_rates) > diagnosis.center_rate and diagnosis.horizon == 10.0
    assert diagnosis.window[0] <= diagnosis.time <= diagnosis.window[1]
    schedule = diagnosis.schedule()
    assert 0.2 < schedule[0] < 0.3 and 3.0 < schedule[-1] < 4.0


def linear(rates: np.ndarray) -> ftla.VariationalFlow:
    return ftla.VariationalFlow(ftla.System(lambda p: rates @ p, lambda p: rates, len(rates)))


def test_growth_like_a_power_of_time_is_not_hyper_sensitive() -> None:
    # x'' = u with least energy: T³/6, 1.7e5 at a hundred seconds
    rates = np.zeros((4, 4))
    rates[0, 1], rates[1, 3], rates[3, 2] = 1.0, -1.0, -1.0
    for factor in (1e-6, 1.0, 1e6):
        scale = np.array([1.0, 1.0, factor, factor])
        spectra = linear(scale[:, None] * rates / scale).spectra(np.zeros(4), np.arange(5.0, 101.0, 5.0))
        for horizon, verdict in ((100.0, "insensitive"), (350.0, "undetermined")):
            diagnosis = ftla.diagnose(spectra, horizon)
            assert diagnosis.verdict == verdict and not diagnosis.is_hyper_sensitive, str(diagnosis)
            assert diagnosis.dims == (0, 4, 0)


def test_what_is_no_control_problem_is_not_called_one() -> None:
    # Lorenz' equations, beside a decay
    def field(p: np.ndarray) -> np.ndarray:
        x, y, z, w = p
        return np.array([10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z, -w])

    def jacobian(p: np.ndarray) -> np.ndarray:
        x, y, z, _ = p
        rates = np.array([[-10.0, 10.0, 0.0], [28.0 - z, -1.0, -x], [y, x, -8.0 / 3.0]])
        return np.block([[rates, np.zeros((3, 1))], [np.zeros((1, 3)), -np.ones((1, 1))]])

    flow = ftla.VariationalFlow(ftla.System(field, jacobian, 4), rtol=1e-8)
    diagnosis = ftla.diagnose(flow.spectra([1.0, 1.0, 20.0, 1.0], [1.0, 2.0, 3.0, 4.0]), 40.0)
    assert diagnosis.verdict == "not_hamiltonian" and not diagnosis.is_hyper_sensitive
    assert str(diagnosis).startswith("not an optimal control problem")


def test_averaging_times_that_do_not_tell_are_said_not_to() -> None:
    spectra = ftla.VariationalFlow(ftla.linear_regulator()).spectra([1.0, 0.4], [2.0, 4.0])
    diagnosis = ftla.diagnose(spectra, 40.0)
    assert diagnosis.verdict == "undetermined" and "factor of four" in str(diagnosis)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_a_diagnosis_does_not_depend_on_the_unit_of_cost(arm: ftla.VariationalFlow, factor: float) -> None:
    times = np.arange(0.5, 5.1, 0.5)
    plain = ftla.diagnose(arm.spectra(START, times), 10.0)
    scaled = ftla.VariationalFlow(ftla.arm(weights=(factor, 0.5 * factor)), rtol=1e-12)
    start = START * np.repeat([1.0, factor], 4)
    found = ftla.diagnose(scaled.spectra(start, times), 10.0)
    assert (found.verdict, found.dims) == (plain.verdict, plain.dims) == ("partial", (2, 4, 2))
    np.testing.assert_allclose(found.balanced_rates, plain.balanced_rates, rtol=1e-2)


def test_costates_one_and_three_are_the_ones_to_hold(arm: ftla.VariationalFlow) -> None:
    slow = ftla.slow_subspace(arm.spectrum(START, 3.5), (2, 4, 2))
    ranked = ftla.rank_held_costates(slow)
    assert len(ranked) == 6 and ranked[0][0] == [0, 2]
    assert [value for _, value in ranked] == sorted((value for _, value in ranked), reverse=True)


def test_the_splitting_of_a_saddle_is_its_eigenvectors() -> None:
    flow = ftla.VariationalFlow(ftla.linear_regulator())
    p = [0.0, 0.0]
    splitting = ftla.Splitting(flow.spectrum(p, 12.0), flow.spectrum(p, 12.0, "backward"), (1, 0, 1))
    root = np.sqrt(2.0)
    assert splitting.stable.angle_to([1.0, root - 1.0]) < 1e-10
    assert splitting.unstable.angle_to([1.0, -root - 1.0]) < 1e-10
    assert splitting.center.dim == 0 and splitting.dims == (1, 0, 1)
    assert splitting.center_stable.angles(splitting.stable)[0] < 1e-10
    np.testing.assert_allclose(splitting.stable.angles(splitting.center_unstable), [np.pi / 2], atol=1e-9)


def test_subspaces_know_complements_intersections_and_angles() -> None:
    e = np.eye(4)
    plane = ftla.Subspace([e[0], e[1], e[0] + e[1]])
    other = ftla.Subspace([e[1], e[2]])
    assert plane.dim == 2 and plane.basis.shape == (2, 4)
    assert plane.complement().angle_to(e[3]) == 0.0
    line = plane.intersection(other)
    assert line.dim == 1 and line.angle_to(e[1]) < 1e-15
    np.testing.assert_allclose(plane.angles(other), [0.0, np.pi / 2], atol=1e-15)
    assert plane.angle_to([1.0, 0.0, 1e-9, 0.0]) == pytest.approx(1e-9, rel=1e-12)


@pytest.mark.parametrize("method", ["newton", "fixed_point"])
def test_the_cubic_regulator_is_placed_on_its_manifolds(method: Any) -> None:
    flow = ftla.VariationalFlow(ftla.cubic_regulator())
    placement = ftla.Placement(
        (1, 0, 1), [], np.arange(0.5, 9.1, 0.5), method=method, tol=1e-10, max_iterations=60
    )
    for direction, exact in (("forward", np.sqrt(2.0) - 1.0), ("backward", -np.sqrt(2.0) - 1.0)):
        placed = placement.place(flow, [1.0, exact + 0.2], direction)  # type: ignore[arg-type]
        assert placed.status == "placed" and placed.success and placed.angle <= 1e-10
        assert placed.p[0] == 1.0 and placed.p[1] == pytest.approx(exact, abs=1e-7)
        assert placed.time == 9.0 and placed.spectrum is not None
        assert placed.n_iterations > 0 and placed.n_flow_evaluations > placed.n_iterations


def test_the_arm_is_placed_with_the_schedule_of_its_spectrum(arm: ftla.VariationalFlow) -> None:
    diagnosis = ftla.diagnose(arm.spectra(START, np.arange(0.5, 5.1, 0.5)), 10.0)
    placement = ftla.Placement(diagnosis, [0, 2])
    off = np.add(START, (0.0, 0.0, 0.0, 0.0, 0.0, 0.05, 0.0, -0.05))
    placed = placement.place(arm, off)
    assert placed.success and placed.time == placement.times[-1]
    np.testing.assert_array_equal(placed.p[[0, 1, 2, 3, 4, 6]], off[[0, 1, 2, 3, 4, 6]])
    np.testing.assert_allclose(placed.p, START, atol=1e-6)


@pytest.mark.parametrize("held", list(itertools.combinations(range(4), 2)))
def test_any_two_costates_may_be_held(arm: ftla.VariationalFlow, held: tuple[int, int]) -> None:
    free = [i for i in range(4) if i not in held]
    off = START.copy()
    off[[4 + i for i in free]] += (0.01, -0.01)
    placed = ftla.Placement((2, 4, 2), held, np.arange(0.25, 3.6, 0.25)).place(arm, off)
    assert placed.success and placed.angle <= 1e-8 and placed.time == 3.5
    kept = [0, 1, 2, 3, *(4 + i for i in held)]
    np.testing.assert_array_equal(placed.p[kept], off[kept])
    # as near as the choice's singular value in `rank_held_costates` allows
    np.testing.assert_allclose(placed.p, START, atol=1e-6 if held == (0, 2) else 1e-4)


def test_placements_that_fail_say_why(arm: ftla.VariationalFlow) -> None:
    loose = ftla.VariationalFlow(arm.system, rtol=1e-10, max_steps=2000)
    far = np.add(START, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 30.0))
    placed = ftla.Placement((2, 4, 2), [0, 2], [6.0]).place(loose, far)
    assert not placed.success and placed.status != "placed" and placed.message
    assert placed.p[4] == far[4]
    few = ftla.Placement((2, 4, 2), [0, 2], [2.0], method="fixed_point", max_iterations=1)
    assert few.place(arm, START).status == "max_iterations"


def _sliders(count: int) -> multibody.Model:
    links = [
        multibody.Link(f"b{i}", "prismatic", parent=f"b{i - 1}" if i else None, axis=(1, 0, 0), mass=1.0)
        for i in range(count)
    ]
    return multibody.Model(links)


@pytest.mark.parametrize(
    ("named", "make"),
    [
        ("masses", lambda: ftla.arm(masses=(0.0, 1.0))),
        ("damping", lambda: ftla.arm(damping=(-1.0, 0.0))),
        ("weights", lambda: ftla.arm(weights=(1.0, np.nan))),
        ("torque_limits", lambda: ftla.arm(torque_limits=(0.0, 1.0))),
        ("weights", lambda: ftla.tree(multibody.two_link_arm(), [1.0, 2.0, 3.0])),
        ("weights", lambda: ftla.tree(multibody.two_link_arm(), -1.0)),
        ("torque_limits", lambda: ftla.tree(multibody.two_link_arm(), torque_limits=0.0)),
        ("passive", lambda: ftla.tree(multibody.two_link_arm(), passive=[2])),
        ("model", lambda: ftla.tree(_sliders(65))),
        ("rtol", lambda: ftla.VariationalFlow(ftla.arm(), rtol=0.0)),
        ("atol", lambda: ftla.VariationalFlow(ftla.arm(), atol=np.nan)),
        ("max_steps", lambda: ftla.VariationalFlow(ftla.arm(), max_steps=0)),
        ("`p`", lambda: ftla.arm().field(np.zeros(7))),
        ("`p`", lambda: ftla.arm().field(np.full(8, np.nan))),
        ("`p`", lambda: ftla.VariationalFlow(ftla.arm()).state(np.zeros((2, 8)), 1.0)),
        ("duration", lambda: ftla.VariationalFlow(ftla.arm()).transition(START, np.inf)),
        ("times", lambda: ftla.VariationalFlow(ftla.arm()).spectra(START, [2.0, 1.0])),
        ("times", lambda: ftla.VariationalFlow(ftla.arm()).spectra(START, [])),
        ("times", lambda: ftla.VariationalFlow(ftla.arm()).spectrum(START, -1.0)),
        ("direction", lambda: ftla.VariationalFlow(ftla.arm()).spectrum(START, 1.0, "up")),  # type: ignore[arg-type]
        ("growth", lambda: ftla.VariationalFlow(ftla.arm()).chain(START, [1.0], growth=1.0)),
        ("spectra", lambda: ftla.diagnose([], 1.0)),
        ("horizon", lambda: ftla.diagnose([], -1.0)),
        ("add up to 4", lambda: ftla.Placement((2, 2, 4), [0], [1.0]).place(
            ftla.VariationalFlow(ftla.arm()), START)),
        ("add up to 8", lambda: ftla.Placement((1, 0, 1), [], [1.0]).place(
            ftla.VariationalFlow(ftla.arm()), START)),
        ("dims", lambda: ftla.Placement((2, 4, 3), [0, 2], [1.0])),
        ("held", lambda: ftla.Placement((2, 4, 2), [0, 4], [1.0])),
        ("held", lambda: ftla.Placement((2, 4, 2), [0], [1.0])),
        ("times", lambda: ftla.Placement((2, 4, 2), [0, 2], [2.0, 1.0])),
        ("times", lambda: ftla.Placement((2, 4, 2), [0, 2])),
        ("method", lambda: ftla.Placement((2, 4, 2), [0, 2], [1.0], method="x")),  # type: ignore[arg-type]
        ("tol", lambda: ftla.Placement((2, 4, 2), [0, 2], [1.0], tol=0.0)),
        ("vectors", lambda: ftla.Subspace([1.0, 2.0])),
        ("dimension", lambda: ftla.Subspace(np.zeros((1, 257)))),
        ("other", lambda: ftla.Subspace(np.eye(4)).angles(ftla.Subspace(np.eye(2)))),
        ("`v`", lambda: ftla.Subspace(np.eye(4)).angle_to([1.0])),
    ],
)  # fmt: skip
def test_bad_arguments_are_named(named: str, make: Any) -> None:
    with pytest.raises(errors.InputError, match=named) as caught:
        make()
    assert isinstance(caught.value, ValueError)


def test_what_is_no_system_is_a_type_error() -> None:
    with pytest.raises(TypeError, match="System"):
        ftla.VariationalFlow("arm")  # type: ignore[arg-type]


def test_spectra_of_the_wrong_direction_are_refused() -> None:
    flow = ftla.VariationalFlow(ftla.linear_regulator())
    forward = flow.spectrum([1.0, 0.4], 1.0)
    with pytest.raises(errors.InputError, match="backward"):
        ftla.Splitting(forward, forward, (1, 0, 1))
    with pytest.raises(errors.InputError, match="add up to 2"):
        ftla.slow_subspace(forward, (1, 1, 1))


def test_a_motion_that_runs_off_tells_where() -> None:
    # on the unstable side of the cubic regulator x blows up in finite time backward
    flow = ftla.VariationalFlow(ftla.cubic_regulator())
    with pytest.raises(errors.IntegrationError, match="t = ") as caught:
        flow.state([3.0, 40.0], -5.0)
    assert caught.value.t is not None and -5.0 < caught.value.t < 0.0
    assert caught.value.state is not None and caught.value.state.shape == (2,)
    with pytest.raises(errors.IntegrationError, match="row 1"):
        flow.transitions([[0.0, 0.0], [3.0, 40.0]], -5.0)
    short = ftla.VariationalFlow(ftla.cubic_regulator(), max_steps=3)
    with pytest.raises(errors.IntegrationError, match="steps reach only"):
        short.state([1.0, 0.4], 10.0)
