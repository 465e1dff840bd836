# ruff: noqa: E501 -- one call in a line
"""Whatever is passed to somersault.ftla: an error names the argument, and nothing panics or overflows."""

import inspect
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import errors, ftla, multibody, ocp

FLOW = ftla.VariationalFlow(ftla.linear_regulator(), rtol=1e-9)
SPECTRA = FLOW.spectra([1.0, 0.4], [1.0, 2.0, 4.0])
BACKWARD = FLOW.spectrum([1.0, 0.4], 4.0, "backward")
PLACEMENT = ftla.Placement((1, 0, 1), [], [1.0, 4.0])
TIMES = np.linspace(0.0, 4.0, 9)
EXTREMAL = ftla.shoot(FLOW.system, [1.0], [1.5], TIMES, np.zeros((9, 2)))
MATCHING = ftla.Matching(
    FLOW, [1.0], [1.5], 8.0, PLACEMENT, initial_costate=[0.4], final_costate=[-3.0]
)  # fmt: skip
PLANE = ftla.Subspace([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
STATE = [0.0, 3.0, 0.0, 0.0]


def free(p: Any) -> Any:
    return np.array([[-1.0, -1.0], [-1.0, 1.0]]) @ p


def rates(p: Any) -> Any:
    return np.array([[-1.0, -1.0], [-1.0, 1.0]])


#: A call that works, by the names of its arguments.
CALLS: list[tuple[Callable[..., Any], dict[str, Any]]] = [
    (ftla.arm, {"masses": (0.5, 0.5), "lengths": (2.0, 0.5), "damping": (0.2, 0.0), "weights": (1.0, 0.5), "torque_limits": (1.0, 1.0)}),
    (ftla.tree, {"model": multibody.two_link_arm(), "weights": 1.0, "torque_limits": 3.0, "passive": [0]}),
    (ftla.state_costate, {"dynamics": lambda x, u: u, "running_cost": lambda x, u: 0.0, "n_states": 2, "n_controls": 2, "jacobian": rates, "gradient": rates, "hessian": rates, "control_bounds": [[-1.0, -1.0], [1.0, 1.0]]}),
    (ftla.System, {"field": free, "jacobian": rates, "dimension": 2, "n_controls": 1}),
    (ftla.VariationalFlow, {"system": FLOW.system, "rtol": 1e-9, "atol": 1e-12, "max_steps": 1000, "start": 0.0}),
    (FLOW.system.field, {"p": [1.0, 0.4], "t": 0.0}),
    (FLOW.system.jacobian, {"p": [1.0, 0.4], "t": 0.0}),
    (FLOW.system.hamiltonian, {"p": [1.0, 0.4]}),
    (FLOW.system.control, {"p": [1.0, 0.4]}),
    (FLOW.system.running_cost, {"p": [1.0, 0.4]}),
    (FLOW.state, {"p": [1.0, 0.4], "duration": 0.5}),
    (FLOW.cost, {"p": [1.0, 0.4], "duration": 0.5}),
    (FLOW.transition, {"p": [1.0, 0.4], "duration": 0.5}),
    (FLOW.transitions, {"points": [[1.0, 0.4]], "duration": 0.5}),
    (FLOW.switches, {"p": [1.0, 0.4], "duration": 0.5}),
    (FLOW.chain, {"p": [1.0, 0.4], "times": [1.0, 2.0], "growth": 10.0}),
    (FLOW.spectra, {"p": [1.0, 0.4], "times": [1.0, 2.0], "direction": "forward"}),
    (FLOW.spectrum, {"p": [1.0, 0.4], "time": 1.0, "direction": "backward"}),
    (ftla.diagnose, {"spectra": SPECTRA, "horizon": 40.0}),
    (ftla.vector_field, {"dynamics": lambda x: -x, "states": ("x",), "parameters": {"a": 1.0}}),
    (ftla.system_of, {"problem": ocp.ControlProblem(lambda x, u: u, 1, 1, running_cost=lambda x, u: u @ u)}),
    (ftla.lyapunov_spectrum, {"flow": FLOW, "p": [0.0, 0.0], "duration": 2.0, "transient": 0.1, "samples": 40, "tolerance": 0.1, "max_time": 1.0, "max_evaluations": 1000}),
    (ftla.ftle_field, {"flow": FLOW, "points": [[0.0, 0.0]], "duration": 2.0, "domain": [(-1.0, 1.0), None], "max_time": 1.0, "max_evaluations": 1000}),
    (ftla.ftle_field(FLOW, np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), axis=-1), 1.0).ridges, {"smoothing": 1.0, "min_height": 0.0, "min_curvature": 0.0, "min_length": 1.0}),
    (ftla.exponent_convergence, {"spectra": SPECTRA, "tolerance": 0.1}),
    (ftla.Subspace, {"vectors": [[1.0, 0.0]]}),
    (PLANE.angle_to, {"v": [1.0, 0.0, 1.0, 0.0]}),
    (PLANE.angles, {"other": PLANE}),
    (PLANE.intersection, {"other": PLANE}),
    (ftla.Splitting, {"forward": SPECTRA[2], "backward": BACKWARD, "dims": (1, 0, 1)}),
    (ftla.slow_subspace, {"spectrum": SPECTRA[2], "dims": (1, 0, 1)}),
    (ftla.rank_held_costates, {"slow": PLANE}),
    (ftla.Placement, {"dims": (1, 0, 1), "held": [], "times": [1.0], "method": "newton", "tol": 1e-8, "max_iterations": 5}),
    (PLACEMENT.place, {"flow": FLOW, "p": [1.0, 0.4], "direction": "forward", "max_time": 9.0, "max_evaluations": 10**7}),
    (PLACEMENT.following, {"flow": FLOW, "optimum": EXTREMAL, "error": [0.0, 1.0], "sizes": [1e-3], "bound": 0.1}),
    (ftla.Matching, {"flow": FLOW, "initial_state": [1.0], "final_state": [1.5], "horizon": 8.0, "placement": PLACEMENT, "initial_costate": [0.4], "final_costate": [-3.0], "match_time": 4.0, "corrections": [2.0]}),
    (MATCHING.least_squares, {"conserved": [], "tol": 1e-2, "max_rounds": 2, "max_time": 9.0, "max_evaluations": 10**7}),
    (MATCHING.grid_search, {"spacing": np.zeros((2, 0)), "tol": 1e-2, "finest": 1e-3, "max_rounds": 2}),
    (ftla.graded_times, {"horizon": 4.0, "shortest": 0.1, "longest": 1.0}),
    (ftla.shoot, {"system": FLOW.system, "initial_state": [1.0], "final_state": [1.5], "times": TIMES, "nodes": np.zeros((9, 2)), "tol": 1e-9, "max_iterations": 9, "rtol": 1e-10, "atol": 1e-12, "max_time": 9.0, "max_evaluations": 10**7}),
    (ftla.continue_through, {"system": FLOW.system, "stages": [([0.0], [0.0]), ([1.0], [1.5])], "horizon": 4.0, "fractions": TIMES / 4.0, "tol": 1e-9, "max_iterations": 9, "rtol": 1e-10, "atol": 1e-12, "first_step": 0.5, "min_step": 0.1}),
    (ftla.cold_start, {"system": FLOW.system, "initial_state": [1.0], "final_state": [1.5], "horizon": 4.0, "max_time": 9.0, "max_evaluations": 10**7, "tol": 1e-9, "max_iterations": 9, "rtol": 1e-10, "atol": 1e-12, "first_step": 0.5, "min_step": 0.1}),
    (ftla.follow, {"family": lambda s: (FLOW.system, [1.0], [1.5], 4.0), "start": EXTREMAL, "tol": 1e-9, "max_iterations": 9, "rtol": 1e-10, "atol": 1e-12, "first_step": 0.5, "min_step": 0.1}),
    (EXTREMAL, {"t": 1.0}),
    (EXTREMAL.control, {"t": 1.0}),
    (ftla.solve_arm, {"initial_state": STATE, "final_state": STATE, "horizon": 1.0, "fold": 3.0, "system": ftla.arm(), "max_iterations": 0}),
    (ftla.arm_extremals, {"initial_state": STATE, "final_state": STATE, "horizon": 1.0, "folds": [3.0], "turns": [0], "system": ftla.arm(), "max_iterations": 0}),
]  # fmt: skip

NONSENSE = [
    np.nan, np.inf, -1, 0, "a", None, [], [np.nan], [np.inf] * 2, [-1, -1, -1], np.zeros((3, 5)), 1j, ["a", None],
]  # fmt: skip


def test_no_public_callable_is_left_out() -> None:
    here = {call for call, _ in CALLS}
    public = {name for name in ftla.__all__ if callable(getattr(ftla, name))}
    # results, which nobody makes, and what takes no argument
    made = {
        "ArmExtremal", "Chain", "ContinuationResult", "Diagnosis", "ExponentConvergence", "Extremal", "Following", "FtleField", "LyapunovSpectrum",
        "MatchingResult", "PlacementResult", "Ridge", "Spectrum", "Transition", "cubic_regulator", "linear_regulator",
    }  # fmt: skip
    assert {name for name in public - made if getattr(ftla, name) not in here} == set()


@pytest.mark.parametrize(
    ("call", "arguments"), CALLS, ids=[getattr(call, "__name__", "Extremal") for call, _ in CALLS]
)
def test_nonsense_is_a_value_or_type_error_that_names_it(
    call: Callable[..., Any], arguments: dict[str, Any]
) -> None:
    call(**arguments)
    for name in arguments:
        for value in NONSENSE:
            try:
                call(**(arguments | {name: value}))
            except (ValueError, TypeError) as error:
                # of a wrong type it is told in a note
                told = [str(error), *getattr(error, "__notes__", [])]
                assert any(name in text for text in told), f"{name}={value!r}: {told}"
            except (errors.IntegrationError, errors.EvaluationError):
                # no absolute tolerance, at a guess that is zero
                assert name == "atol"


@pytest.mark.parametrize(
    ("named", "call"),
    [
        ("max_iterations", lambda: ftla.shoot(FLOW.system, [1.0], [1.5], TIMES, np.zeros((9, 2)), max_iterations=-1)),
        ("`tol`", lambda: ftla.shoot(FLOW.system, [1.0], [1.5], TIMES, np.zeros((9, 2)), tol=1e-16)),
        ("`tol`", lambda: ftla.solve_arm(STATE, STATE, 1.0, tol=1e-16)),
        ("`tol`", lambda: ocp.arm_motion(np.pi, tol=1e-16)),
        ("max_time", lambda: ftla.cold_start(FLOW.system, [1.0], [1.5], 4.0, max_time=-1.0)),
        ("max_rounds", lambda: MATCHING.least_squares(max_rounds=0)),
        ("max_rounds", lambda: MATCHING.grid_search(np.zeros((2, 0)), max_rounds=0)),
        ("max_steps", lambda: ftla.VariationalFlow(FLOW.system, max_steps=2**70)),
        ("held", lambda: ftla.Placement((2, 4, 2), [-1, 0], [1.0])),
        ("dims", lambda: ftla.Placement(None, [], [1.0])),  # type: ignore[arg-type]
        ("passive", lambda: ftla.tree(multibody.two_link_arm(), passive=[2])),
        ("passive", lambda: ftla.tree(multibody.two_link_arm(), passive=[0, 0])),
        ("passive", lambda: ftla.tree(multibody.two_link_arm(), passive=[0, 1])),
        ("masses", lambda: ftla.arm(masses=(1.0, 2.0, 3.0))),
        ("stages", lambda: ftla.continue_through(FLOW.system, [([0.0, 1.0], [0.0]), ([1.0], [1.5])], 4.0, TIMES / 4.0)),
        ("stages", lambda: ftla.continue_through(FLOW.system, [([0.0], [np.nan]), ([1.0], [1.5])], 4.0, TIMES / 4.0)),
        # no rest: the state costs, and the two ends differ
        ("begin with a rest", lambda: ftla.continue_through(FLOW.system, [([1.0], [1.0]), ([1.0], [1.5])], 4.0, TIMES / 4.0)),
        ("begin with a rest", lambda: ftla.continue_through(FLOW.system, [([0.0], [1.0]), ([1.0], [1.5])], 4.0, TIMES / 4.0)),
        ("`horizon`", lambda: ftla.solve_arm(STATE, STATE, 1e9)),
        ("`horizon`", lambda: ftla.arm_extremals(STATE, STATE, 5e-324)),
        ("`horizon`", lambda: ftla.graded_times(5e-324, 1.0, 1.0)),
        ("times", lambda: ftla.shoot(FLOW.system, [1.0], [1.5], [0.0, np.inf], np.zeros((2, 2)))),
        ("spectra", lambda: ftla.diagnose(SPECTRA[::-1], 40.0)),
        ("spectra", lambda: ftla.diagnose([SPECTRA[0], BACKWARD], 40.0)),
        ("`family`", lambda: ftla.follow(lambda s: (ftla.arm(), STATE, STATE, 4.0), EXTREMAL)),
        ("`family`", lambda: ftla.follow(lambda s: (FLOW.system, [1.0], [1.5], -1.0), EXTREMAL)),
        ("turns", lambda: ftla.arm_extremals(STATE, STATE, 1.0, turns=[0.5])),  # type: ignore[list-item]
    ],
)  # fmt: skip
def test_errors_name_what_was_typed(named: str, call: Callable[[], Any]) -> None:
    with pytest.raises(ValueError, match=named):
        call()


@pytest.mark.parametrize(
    ("named", "call"),
    [
        (r"solve_arm\(\) .* 'tolerance'", lambda: ftla.solve_arm(STATE, STATE, 1.0, tolerance=1e-9)),
        (r"solve_arm\(\) .* 'first_step'", lambda: ftla.solve_arm([0.0, 3.0, 0.1, 0.0], STATE, 1.0, first_step=0.5)),
        (r"arm_extremals\(\) .* 'fold'", lambda: ftla.arm_extremals(STATE, STATE, 1.0, fold=3.0)),
        (r"cold_start\(\) .* 'toll'", lambda: ftla.cold_start(FLOW.system, [1.0], [1.5], 4.0, toll=1e-9)),  # type: ignore[call-arg]
        (r"state_costate\(\) .* 'bounds'", lambda: ftla.state_costate(drift, effort, 1, 1, jacobian=slopes, gradient=efforts, hessian=ones, bounds=1)),  # type: ignore[call-arg]
    ],
)  # fmt: skip
def test_misspelt_names_are_type_errors_of_what_was_called(named: str, call: Callable[[], Any]) -> None:
    with pytest.raises(TypeError, match=named):
        call()


@pytest.mark.parametrize("rate", [0.0, 0.1])
def test_what_is_no_arm_is_told_from_rest_and_in_motion(rate: float) -> None:
    with pytest.raises(errors.InputError, match="`system` must be an arm"):
        ftla.solve_arm([0.0, 3.0, rate, 0.0], STATE, 1.0, system=FLOW.system)


def test_systems_that_fail_within_a_cold_start_say_how() -> None:
    def zero(p: Any) -> Any:
        raise ZeroDivisionError("out of order")

    for field, jacobian, kind, told in (
        (zero, rates, errors.EvaluationError, "`field` raised"),
        (free, zero, errors.EvaluationError, "`jacobian` raised"),
        (lambda p: np.full(2, np.nan), rates, errors.EvaluationError, "`field` is not finite"),
        (free, lambda p: np.full((2, 2), np.nan), errors.EvaluationError, "`jacobian` is not finite"),
        (lambda p: np.zeros(3), rates, errors.InputError, r"`field\(p\)` .* found shape \(3,\)"),
        (free, lambda p: np.eye(3), errors.InputError, r"`jacobian\(p\)` .* found shape \(3, 3\)"),
    ):
        with pytest.raises(kind, match=told):
            ftla.cold_start(ftla.System(field, jacobian, 2), [1.0], [1.5], 4.0)
    # no control moves the state: a status, and the last nodes
    still = ftla.System(lambda p: 0.0 * p, lambda p: np.zeros((2, 2)), 2)
    found = ftla.cold_start(still, [1.0], [2.0], 4.0, min_step=0.05)
    assert not found.success and found.extremal.status != "converged"
    assert np.isfinite(found.extremal.nodes).all()


def test_a_singular_control_hessian_is_told_wherever_it_is_met() -> None:
    system = ftla.state_costate(
        drift, effort, 1, 1, jacobian=slopes, gradient=efforts,
        hessian=lambda x, u, costate: np.diag([1.0, 0.0]),
    )  # fmt: skip
    flow, p = ftla.VariationalFlow(system), [1.0, 0.4]
    for call in (
        lambda: system.field(p), lambda: system.jacobian(p), lambda: system.control(p), lambda: system.hamiltonian(p),
        lambda: flow.transition(p, 1.0), lambda: flow.spectrum(p, 1.0), lambda: flow.cost(p, 1.0),
        lambda: ftla.shoot(system, [1.0], [1.5], TIMES, np.zeros((9, 2))),
        lambda: ftla.cold_start(system, [1.0], [1.5], 4.0),
    ):  # fmt: skip
        with pytest.raises(errors.EvaluationError, match="the control Hessian must be positive definite"):
            call()
    placed = PLACEMENT.place(flow, p)
    assert placed.status == "flow" and "control Hessian" in placed.message
    np.testing.assert_array_equal(placed.p, p)


def test_states_out_of_reach_of_the_averaging_window_have_a_status_and_the_last_point() -> None:
    flow = ftla.VariationalFlow(ftla.arm(), rtol=1e-8, atol=1e-10, max_steps=300)
    far = [-1.57, 0.05, 50.0, 80.0, -0.2, 0.0, -1.3, 30.0]
    placed = ftla.Placement((2, 4, 2), [0, 2], [6.0]).place(flow, far)
    assert placed.status == "flow" and "averaging time" in placed.message
    held = [0, 1, 2, 3, 4, 6]
    np.testing.assert_array_equal(placed.p[held], np.array(far)[held])


def test_a_jacobian_without_a_value_is_told_from_a_field_without_one() -> None:
    flow = ftla.VariationalFlow(ftla.System(free, lambda p: np.full((2, 2), np.nan), 2))
    assert np.isfinite(flow.state([1.0, 0.4], 1.0)).all()
    with pytest.raises(errors.EvaluationError, match="Jacobian is not finite"):
        flow.transition([1.0, 0.4], 1.0)
    with pytest.raises(errors.EvaluationError, match="`jacobian` is not finite"):
        flow.system.jacobian([1.0, 0.4])
    nowhere = ftla.VariationalFlow(ftla.System(lambda p: np.full(2, np.nan), rates, 2))
    with pytest.raises(errors.EvaluationError, match="the field is not finite"):
        nowhere.transition([1.0, 0.4], 1.0)


def test_a_control_without_a_value_is_an_error() -> None:
    system = ftla.System(free, rates, 2, control=lambda p: [np.nan])
    found = ftla.shoot(system, [1.0], [1.5], TIMES, np.zeros((9, 2)))
    for call in (lambda: system.control([1.0, 0.4]), lambda: found.control([0.0, 1.0])):
        with pytest.raises(errors.EvaluationError, match="`control` returned NaN"):
            call()


def test_subspaces_of_tiny_and_huge_vectors_are_those_of_their_directions() -> None:
    for size in (1e-300, 1e-200, 1e200, 1e300):
        line = ftla.Subspace([[size, size, 0.0, 0.0]])
        assert line.dim == 1
        np.testing.assert_allclose(line.basis, [[np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]], rtol=1e-15)
        assert line.angle_to([size, 0.0, 0.0, 0.0]) == pytest.approx(np.pi / 4, rel=1e-15)


def test_small_rates_are_printed() -> None:
    slow = ftla.System(lambda p: np.array([-1e-6, 1e-6]) * p, lambda p: np.diag([-1e-6, 1e-6]), 2)
    spectra = ftla.VariationalFlow(slow).spectra([1.0, 1.0], [1e6, 2e6, 4e6])
    assert "1.000e-6" in repr(spectra[0])
    assert "1.000e-6" in str(ftla.diagnose(spectra, 1e8))


def test_an_extremal_on_the_way_is_no_success() -> None:
    # no horizon as short as that: the continuation stops early
    system = ftla.cubic_regulator()
    stages = [([0.0], [0.0]), ([1.0], [1.0]), ([2.0], [40.0])]
    found = ftla.continue_through(system, stages, 40.0, [0.0, 0.5, 1.0], min_step=0.5, first_step=1.0)
    assert not found.success and not found.extremal.success and found.s < 1.0
    assert found.extremal.status == "on_the_way" and "stopped early" in found.extremal.message


def test_limits_out_of_reach_hand_back_the_arm_that_was_reached() -> None:
    goal = ftla.arm(torque_limits=(0.02, 0.02))
    found = ftla.solve_arm([-np.pi / 2, 0.05, 0.0, 0.0], [np.pi / 2, 0.05, 0.0, 0.0], 10.0, system=goal)
    extremal = found.extremal
    assert not found.success and not extremal.success and 0.0 < found.s < 1.0
    largest = np.abs(extremal.control(np.linspace(0.0, 10.0, 501))).max(axis=0)
    assert (largest > 0.02).all() and "torque_limits" in repr(extremal.system)
    # the segments are those of the arm that is named
    np.testing.assert_allclose(extremal(extremal.times), extremal.nodes, atol=1e-3)


def _same(a: Any, b: Any) -> None:
    """Every public property of both is the same to the bit."""
    assert type(a) is type(b) and repr(a) == repr(b)
    for name, _ in inspect.getmembers(type(a), inspect.isgetsetdescriptor):
        one, other = getattr(a, name), getattr(b, name)
        if type(one).__module__ == "somersault.ftla":
            _same(one, other)
        else:
            np.testing.assert_equal(one, other)


ROUND_TRIPS = {
    "arm": lambda: ftla.arm(torque_limits=(1.0, np.inf)),
    "cubic": ftla.cubic_regulator,
    "tree": lambda: ftla.tree(multibody.two_link_arm(), [1.0, 2.0], passive=[1]),
    "flow": lambda: FLOW,
    "transition": lambda: FLOW.transition([1.0, 0.4], 1.0),
    "chain": lambda: FLOW.chain([1.0, 0.4], [4.0, 8.0]),
    "spectrum": lambda: BACKWARD,
    "diagnosis": lambda: ftla.diagnose(SPECTRA, 40.0),
    "subspace": lambda: PLANE,
    "splitting": lambda: ftla.Splitting(SPECTRA[2], BACKWARD, (1, 0, 1)),
    "placement": lambda: PLACEMENT,
    "placed": lambda: PLACEMENT.place(FLOW, [1.0, 0.4]),
    "following": lambda: PLACEMENT.following(FLOW, EXTREMAL, [0.0, 1.0], [1e-3], 0.1)[0],
    "matching": lambda: MATCHING,
    "matched": lambda: MATCHING.least_squares(),
    "extremal": lambda: EXTREMAL,
    "continued": lambda: ftla.cold_start(ftla.cubic_regulator(), [1.0], [1.5], 10.0),
}


@pytest.mark.parametrize("name", ROUND_TRIPS)
def test_results_come_back_from_files_and_pickles(name: str, tmp_path: Path) -> None:
    thing = ROUND_TRIPS[name]()
    _same(thing, pickle.loads(pickle.dumps(thing)))
    somersault.save(tmp_path / "thing.som", thing)
    _same(thing, somersault.load(tmp_path / "thing.som"))


def test_ranked_extremals_come_back_from_files_and_pickles(tmp_path: Path) -> None:
    (ranked,) = ftla.arm_extremals(STATE, [0.1, 3.0, 0.0, 0.0], 2.0, folds=[3.0], turns=[0])
    assert ranked.success and ranked.fold == np.pi
    somersault.save(tmp_path / "ranked.som", [ranked])
    for other in (pickle.loads(pickle.dumps(ranked)), *somersault.load(tmp_path / "ranked.som")):
        assert (other.fold, other.turns, other.cost) == (ranked.fold, ranked.turns, ranked.cost)
        _same(other.extremal, ranked.extremal)


def drift(x: Any, u: Any) -> Any:
    return -x + u


def effort(x: Any, u: Any) -> float:
    return float(0.5 * (x @ x + u @ u))


def slopes(x: Any, u: Any) -> Any:
    return [[-1.0, 1.0]]


def efforts(x: Any, u: Any) -> Any:
    return [x[0], u[0]]


def ones(x: Any, u: Any, costate: Any) -> Any:
    return np.eye(2)


def test_problems_of_ones_own_come_back_from_pickles_and_are_refused_by_files(tmp_path: Path) -> None:
    own = ftla.state_costate(
        drift, effort, 1, 1, jacobian=slopes, gradient=efforts, hessian=ones, control_bounds=[[-0.5], [2.0]]
    )
    back = pickle.loads(pickle.dumps(own))
    assert repr(back) == repr(own)
    p = [[1.0, 0.4], [0.3, 0.9]]
    for name in ("field", "jacobian", "hamiltonian", "control", "running_cost"):
        np.testing.assert_array_equal(getattr(back, name)(p), getattr(own, name)(p))
    found = ftla.shoot(own, [1.0], [1.2], [0.0, 0.5, 1.0], np.zeros((3, 2)), rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(found)).nodes, found.nodes)
    for thing in (own, found):
        with pytest.raises(errors.WriteError, match="cannot be written"):
            somersault.save(tmp_path / "own.som", thing)


def test_what_comes_back_goes_on_working(tmp_path: Path) -> None:
    somersault.save(tmp_path / "match.som", MATCHING.least_squares())
    matched = somersault.load(tmp_path / "match.som")
    t = np.linspace(0.0, 8.0, 9)
    np.testing.assert_array_equal(matched.nodes(t), MATCHING.least_squares().nodes(t))
    extremal = pickle.loads(pickle.dumps(EXTREMAL))
    np.testing.assert_array_equal(extremal([0.3, 2.7]), EXTREMAL([0.3, 2.7]))
    assert extremal.cost() == EXTREMAL.cost()
    own = pickle.loads(pickle.dumps(ftla.System(free, rates, 2)))
    np.testing.assert_array_equal(own.field([1.0, 0.4]), free(np.array([1.0, 0.4])))
    with pytest.raises(errors.WriteError):
        somersault.save(tmp_path / "own.som", own)
