"""Direct collocation from Python, on problems with closed-form optima and on the arm of thesis 8.4."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg

import somersault
from somersault import errors, multibody, ocp

START = [-np.pi / 2, 0.05, 0.0, 0.0]


def block(mass: float = 1.0) -> somersault.Model:
    """A block that slides along x."""
    link = multibody.Link("block", joint="prismatic", axis=(1.0, 0.0, 0.0), mass=mass)
    return somersault.Model([link], gravity=(0.0, 0.0, 0.0))


def effort(x: Any, u: Any) -> Any:
    return 0.5 * u.u_block**2


def moved(
    initial: Any = (0, 0), final: Any = (1, 0), duration: Any = 1.0, **options: Any
) -> ocp.ControlProblem:
    """A block of 1 kg from one place to another with the least effort."""
    given = {"running_cost": effort, **options}
    return ocp.ControlProblem(block(), initial=initial, final=final, duration=duration, **given)


def test_the_double_integrator_is_its_closed_form() -> None:
    # x = 3 t² − 2 t³, u = 6 − 12 t, cost 6; costates (−12, −6 + 12 t); H = −18
    found = moved().solve()
    t = np.linspace(0.0, 1.0, 21)
    assert found.success and found.cost == pytest.approx(6.0, abs=1e-9)
    assert found.verified_cost == pytest.approx(6.0, abs=1e-9)
    np.testing.assert_allclose(
        found.state(t), np.column_stack([3 * t**2 - 2 * t**3, 6 * t - 6 * t**2]), atol=1e-8
    )
    assert found.q is not None and found.v is not None
    np.testing.assert_array_equal(np.column_stack([found.q, found.v]), found.x)
    np.testing.assert_allclose(found.control(t)[:, 0], 6 - 12 * t, atol=1e-6)
    np.testing.assert_allclose(found.costate(t), np.column_stack([-12 + 0 * t, -6 + 12 * t]), atol=1e-6)
    np.testing.assert_allclose(found.hamiltonian, -18.0, atol=1e-6)
    assert found.hamiltonian_spread < 1e-6


def test_the_linear_quadratic_regulator_is_the_riccati_equation() -> None:
    mass, weights, effort, final, duration = 1.7, np.array([2.0, 0.5]), 0.3, np.array([4.0, 1.0]), 2.0
    found = ocp.ControlProblem(
        block(mass),
        initial=[1.0, -0.5],
        duration=duration,
        running_cost=lambda x, u: 0.5 * (effort * u[0] ** 2 + weights @ x**2),
        end_cost=lambda x: 0.5 * final @ x**2,
    ).solve(tol=1e-8)
    # λ = S x, with S from the matrix exponential of the Hamiltonian system
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / mass]])
    system = np.block([[a, -b @ b.T / effort], [-np.diag(weights), -a.T]])
    back = scipy.linalg.expm(-duration * system) @ np.vstack([np.eye(2), np.diag(final)])
    riccati = back[2:] @ np.linalg.inv(back[:2])
    start = np.array([1.0, -0.5])
    assert found.success
    assert found.cost == pytest.approx(0.5 * start @ riccati @ start, rel=1e-8)
    np.testing.assert_allclose(found.costates[0], riccati @ start, rtol=1e-6)


def test_the_fastest_way_under_a_bound_takes_two_roots_of_the_way() -> None:
    # bang–bang: t_f = 2 √(s/u) for |u| ≤ 1
    fastest = moved(duration=(0.5, 5.0), running_cost=lambda x: 1.0, bounds={"u_block": (-1, 1)})
    found = fastest.solve(n_intervals=20, max_meshes=12, tol=1e-4)
    assert found.cost == pytest.approx(2.0, abs=1e-3)
    assert found.t[-1] == pytest.approx(2.0, abs=1e-3)
    assert found.u.min() >= -1.0 - 1e-6 and found.u.max() <= 1.0 + 1e-6


@pytest.mark.parametrize(
    ("ceiling", "cost"), [(0.2, 2 + 6 * (1 - 4 * 0.2) ** 2), (1 / 9, 4.0), (0.02, 4 / (9 * 0.02))]
)
def test_success_below_a_ceiling_is_right_in_its_cost(ceiling: float, cost: float) -> None:
    # Bryson and Denham's problem (Bryson & Ho 1975, section 3.11)
    problem = moved([0, 1], [0, -1], bounds={"q_block": (None, ceiling)})
    found = problem.solve(n_intervals=7, n_points=3)
    assert found.success and found.cost == pytest.approx(cost, rel=1e-5)
    assert found.cost_error <= 1e-6 and found.violation <= 2e-6
    # what a coarse mesh does not reach is said
    coarse = problem.solve(n_intervals=7, n_points=3, max_meshes=1)
    assert coarse.status == "mesh_limit" and "estimated error of the cost" in coarse.message
    assert abs(coarse.cost - cost) <= coarse.cost_error * coarse.cost
    assert set(coarse.meshes[0]) >= {"error", "cost_error", "costate_error", "hamiltonian_error", "violation"}


def test_a_time_without_an_upper_bound_needs_a_cost() -> None:
    endless = moved(duration=(0.5, np.inf)).solve()
    assert not endless.success and endless.status == "no_minimum"
    assert "bound the duration" in endless.message
    assert pickle.loads(pickle.dumps(endless)).status == "no_minimum"
    timed = moved(duration=(0.5, np.inf), end_cost=lambda x, t: t).solve()
    assert timed.success and timed.t[-1] == pytest.approx(18**0.25, abs=1e-6)


def test_ends_may_be_bounded_and_states_too() -> None:
    bounds = {"q_block": (-10, None), "v_block": (-10, 0.55)}
    found = moved(final=[(0.5, 2.0), None], bounds=bounds).solve(tol=1e-4)
    assert found.x[-1, 0] == pytest.approx(0.5, abs=1e-5)
    assert found.x[:, 1].max() <= 0.55 + 1e-6


#: Table 10.1 of the thesis, column p⁺ at 5 s; its two columns differ by up to 5.6e-4.
TABLE_10_1 = [-0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651]


@pytest.mark.parametrize("fold", [None, np.pi])
def test_the_arm_moves_as_in_the_thesis(fold: float | None) -> None:
    found = ocp.arm_motion(fold, tol=1e-7)
    assert found.status == "converged" and "confirmed" in found.message
    np.testing.assert_allclose([*found.state(5.0), *found.costate(5.0)], TABLE_10_1, atol=1e-4)
    assert found.max_defect < 1e-7
    assert found.verified_cost == pytest.approx(found.cost, abs=1e-7)
    # θ₁ is cyclic
    assert np.ptp(found.costates[:, 0]) < 1e-6


def test_the_spread_of_the_hamiltonian_shrinks_with_the_tolerance() -> None:
    spreads = [ocp.arm_motion(tol=tol).hamiltonian_spread for tol in (1e-4, 1e-6, 1e-8)]
    assert spreads[1] < 0.3 * spreads[0] and spreads[2] < 0.3 * spreads[1]


def test_the_same_posture_with_a_turn_less_costs_less() -> None:
    thesis, turned = ocp.arm_motion(np.pi), ocp.arm_motion(-np.pi, -2 * np.pi)
    assert turned.success and turned.verified_cost < thesis.verified_cost - 5e-3


def test_success_on_a_coarse_mesh_is_named_false_convergence() -> None:
    found = ocp.arm_motion(np.pi, n_intervals=10, max_meshes=1)
    assert found.report.success and not found.success
    assert found.status == "false_convergence" and "false convergence" in found.message
    assert found.max_defect > 1e-2


def test_a_result_starts_another_search() -> None:
    problem = ocp.arm_problem()
    first = problem.solve(tol=1e-5)
    second = problem.solve(first, tol=1e-6)
    assert second.success and second.cost == pytest.approx(first.cost, abs=1e-3)
    assert len(first.meshes) >= 1 and first.meshes[-1]["status"] == "converged"
    assert first.x.shape == (len(first.t), 4) and first.u.shape == (len(first.t) - 1, 2)


def test_states_alone_are_a_guess() -> None:
    found = moved().solve({"x": [[0.0, 0.0], [0.5, 1.5], [1.0, 0.0]]})
    assert found.cost == pytest.approx(6.0, abs=1e-9)


def test_what_is_exceeded_between_the_points_is_said() -> None:
    held = moved(bounds={"v_block": (None, 1.2)})
    coarse = held.solve(n_intervals=3, n_points=3, max_meshes=1)
    assert 1e-3 < coarse.violation < 0.3
    for message in (coarse.message, coarse.verification.message):
        assert "exceeds its bounds by up to" in message and "v_block at 0." in message
    free = moved().solve()
    assert free.violation == 0.0 and "exceeds" not in free.message


def test_entries_are_named_and_a_single_phase_is_not() -> None:
    with pytest.raises(errors.InputError) as caught:
        moved(bounds={"q_block": (None, 0.5)})
    assert str(caught.value) == (
        "`final`, entry 0 (q_block), must be within the bounds of the state, [-inf, 0.5], found 1"
    )
    with pytest.raises(errors.InputError, match=r"`initial\[1\]` must be finite, found nan") as caught:
        moved([0.0, np.nan])
    assert "phase" not in str(caught.value)


def test_bodies_with_names_that_are_none_of_variables_are_named_all_the_same() -> None:
    links = [
        multibody.Link("left thigh", "revolute", axis=(0, 0, 1), mass=1.0),
        multibody.Link("left-thigh", "revolute", axis=(0, 0, 1), mass=1.0, parent="left thigh"),
    ]
    tree = somersault.Model(links, gravity=(0, 0, 0))
    posed = ocp.ControlProblem(tree, initial=[0] * 4)
    assert posed.state_names == ["q_0", "q_1", "v_0", "v_1"] and posed.control_names == ["u_0", "u_1"]
    one = ocp.ControlProblem(somersault.Model(links[:1], gravity=(0, 0, 0)), initial=[0, 0])
    assert one.state_names == ["q_left_thigh", "v_left_thigh"] and one.control_names == ["u_left_thigh"]
    given = ocp.ControlProblem(tree, ("a", "b", "c", "d"), 2, initial={"a": 0})
    assert given.state_names == ["a", "b", "c", "d"] and given.control_names == ["u0", "u1"]


def test_integrals_and_parameters_stand_beside_a_tree() -> None:
    # least ½ ∫ u² over a distance p that is chosen, with a reward of p, and ∫ x dt held:
    # x = p (3 t² − 2 t³), ∫ x = p/2
    free = moved(
        final={"v_block": 0},
        parameters=("distance",),
        ends=[(lambda x_0, x_f, t_0, t_f, p: x_f.q_block - p.distance, 0, 0)],
        end_cost=lambda x, t, p: -12 * p.distance,
    )
    found = free.solve()
    # 6 p² − 12 p is least at 1
    assert found.success and found.parameters[0] == pytest.approx(1.0, abs=1e-7)
    held = moved(final={"v_block": 0}, integrals=[(lambda x: x.q_block, 0.5, 0.5)], actuated=[True])
    spent = held.solve()
    # from rest to rest with ∫ x = ½, x(1) free: u = a + b t + c t² with the multiplier of the integral
    t = np.linspace(0.0, 1.0, 2001)
    rows = np.array([[1, 1 / 2, 1 / 3], [1 / 6, 1 / 24, 1 / 60]])
    gram = np.array([[1 / (i + j + 1) for j in range(3)] for i in range(3)])
    kkt = np.block([[gram, rows.T], [rows, np.zeros((2, 2))]])
    a = np.linalg.solve(kkt, [0, 0, 0, 0, 0.5])[:3]
    assert spent.success and spent.cost == pytest.approx(0.5 * a @ gram @ a, rel=1e-8)
    np.testing.assert_allclose(spent.control(t[1:-1])[:, 0], np.polyval(a[::-1], t[1:-1]), atol=1e-5)
    assert spent.x.shape[1] == 3 and spent.x[-1, 2] == pytest.approx(0.5, abs=1e-9)
    assert spent.q is not None and spent.q.shape[1] == 1 and spent.verification.confirmed
    assert pickle.loads(pickle.dumps(spent)).cost == spent.cost


def test_a_path_that_excludes_an_end_is_refused() -> None:
    with pytest.raises(errors.InputError, match="`path`, value 0, must be possible at `final`"):
        moved(path=[(lambda x: x.q_block, None, 0.5)])


def two_phases(
    end: list[Any], start: list[Any], durations: tuple[Any, Any], links: Any = None, **options: Any
) -> ocp.MultiphaseProblem:
    """From rest to rest over a metre, in two phases."""
    first = moved(final=end, duration=durations[0], **options)
    second = moved(start, duration=durations[1], **options)
    return ocp.MultiphaseProblem([first, second], links)


def least_effort(d: float, h: float, v: tuple[float, float]) -> float:
    """Least ½ ∫ u² dt over d in h seconds, from one speed to another: u is a straight line."""
    a, b = v
    return (6 * d**2 - 6 * d * h * (a + b) + 2 * h**2 * (a**2 + a * b + b**2)) / h**3


def test_a_waypoint_is_passed_as_in_closed_form() -> None:
    # The derivative of both efforts by the speed at the waypoint vanishes at 3/(4 h), wherever that is.
    found = two_phases([0.3, None], [None, None], (0.5, 0.5)).solve()
    effort = least_effort(0.3, 0.5, (0.0, 1.5)) + least_effort(0.7, 0.5, (1.5, 0.0))
    assert found.success and found.confirmed and found.verification.confirmed
    assert found.cost == pytest.approx(effort, abs=1e-8) == pytest.approx(9.84)
    assert found.verified_cost == pytest.approx(effort, abs=1e-8)
    first, second = found.phases
    assert all(isinstance(part, ocp.CollocationOutcome) for part in (found, first))
    np.testing.assert_allclose(first.x[-1], [0.3, 1.5], atol=1e-8)
    np.testing.assert_allclose(second.x[0], [0.3, 1.5], atol=1e-8)
    assert (first.t[0], first.t[-1], second.t[0], second.t[-1]) == (0.0, 0.5, 0.5, 1.0)
    assert first.cost == pytest.approx(least_effort(0.3, 0.5, (0.0, 1.5)), abs=1e-8)
    # the costate of the speed goes on, that of the place jumps
    assert first.costates[-1, 1] == pytest.approx(second.costates[0, 1], abs=1e-6)
    assert abs(first.costates[-1, 0] - second.costates[0, 0]) > 1.0


def test_a_state_jumps_by_what_its_link_says() -> None:
    kicked = two_phases([0.5, None], [None, None], (0.5, 0.5), [{"v_block": 1}]).solve()
    before, after = kicked.phases[0].x[-1, 1], kicked.phases[1].x[0, 1]
    # least of 4 h² (a² + b²)/2 − 6 d h (a + b) with b = a + 1 is where a + b = 3 d/h
    assert (before, after) == (pytest.approx(1.0, abs=1e-7), pytest.approx(2.0, abs=1e-7))
    effort = least_effort(0.5, 0.5, (0.0, 1.0)) + least_effort(0.5, 0.5, (2.0, 0.0))
    assert kicked.success and kicked.cost == pytest.approx(effort, abs=1e-8)
    # free to jump, each phase chooses its own speed, 3 d/(2 h)
    loose = two_phases([0.3, None], [0.3, None], (0.5, 0.5), [{"v_block": None}]).solve()
    assert loose.phases[0].x[-1, 1] == pytest.approx(0.9, abs=1e-7)
    assert loose.phases[1].x[0, 1] == pytest.approx(2.1, abs=1e-7)


def test_free_durations_of_phases_follow_each_other() -> None:
    # ½ ∫ u² + ∫ c over d from rest to rest takes 6 d²/T³ + c T: least at T⁴ = 18 d²/c
    def timed(x: Any, u: Any) -> Any:
        return effort(x, u) + 18.0

    problem = two_phases([0.5, 0.0], [None, None], ((0.1, 5.0), (0.1, 5.0)), running_cost=timed)
    found = problem.solve()
    best = 0.5**0.5
    assert found.success and "phases, converged" in repr(found) and len(found) == 2
    for phase, start in zip(found.phases, (0.0, best), strict=True):
        assert phase.t[0] == pytest.approx(start, abs=1e-6)
        assert phase.t[-1] == pytest.approx(start + best, abs=1e-6)
    again = problem.solve(found)
    assert again.cost == pytest.approx(found.cost, rel=1e-8)
    assert problem.solve([{"x": phase.x, "t": phase.t - 3.0} for phase in found.phases]).success
    assert problem.solve(found.phases).success


def test_phases_that_do_not_fit_are_refused() -> None:
    with pytest.raises(errors.InputError, match=r"`links\[0\]` .* q_block is 0.3 .* 0.4 "):
        two_phases([0.3, None], [0.4, None], (0.5, 0.5))


def test_a_duration_with_bounds_after_a_fixed_one_ends_at_its_bound() -> None:
    found = two_phases([0.3, None], [None, None], (0.5, (0.4, 0.6))).solve()
    # Both efforts are quadratic in the speed at the waypoint.
    first, second, both = (
        least_effort(0.3, 0.5, (0.0, v)) + least_effort(0.7, 0.6, (v, 0.0)) for v in (-1.0, 1.0, 0.0)
    )
    slope, curvature = (second - first) / 2, first + second - 2 * both
    assert found.success and found.phases[1].t[-1] == pytest.approx(1.1, abs=1e-12)
    assert found.cost == pytest.approx(both - slope**2 / (2 * curvature), abs=1e-8)


def test_problems_and_results_of_phases_are_saved(tmp_path: Path) -> None:
    problem = two_phases([0.3, None], [None, None], (0.5, 0.5), [{"v_block": (0, 0.1)}])
    found = problem.solve()
    assert found.success
    somersault.save(tmp_path / "phases.som", found)
    back = somersault.load(tmp_path / "phases.som")
    assert repr(back) == repr(found)
    assert back.cost == found.cost and back.verified_cost == found.verified_cost
    for phase, other in zip(back.phases, found.phases, strict=True):
        np.testing.assert_array_equal(phase.x, other.x)
        assert phase.meshes[-1]["n_points"] == other.meshes[-1]["n_points"]
    assert pickle.loads(pickle.dumps(problem)).solve().cost == pytest.approx(found.cost, rel=1e-12)


def test_a_callback_ends_a_search_with_the_best_iterate() -> None:
    found = ocp.arm_problem().solve(callback=lambda k, z, cost, residual: k == 3)
    assert found.status == "stopped" and not found.success
    assert np.isfinite(found.x).all()


def test_what_a_callback_raises_comes_out_with_the_result() -> None:
    def callback(*_: object) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough") as caught:
        ocp.arm_problem().solve(callback=callback)
    assert caught.value.solution.status == "stopped"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"initial": [0.0]}, "initial"),
        ({"initial": [np.nan, 0.0]}, "initial"),
        ({"final": [(2.0, 1.0), 0.0]}, "final"),
        ({"duration": -1.0}, "`duration`"),
        ({"duration": (2.0, 1.0)}, "`duration`"),
        ({"bounds": {"u_block": (1.0, 0.0)}}, "bounds"),
        ({"bounds": {"q_block": (0.5, None)}}, "`initial`"),
        ({"actuated": ["nobody"]}, "nobody"),
        ({"states": ("x",)}, "`states` must have 2 names for the tree, found 1"),
        ({"controls": 2}, "`controls` must have 1 names for the tree, found 2"),
    ],
)
def test_bad_problems_are_named(arguments: dict[str, Any], named: str) -> None:
    with pytest.raises(errors.InputError, match=named) as caught:
        moved(**arguments)
    assert isinstance(caught.value, ValueError)


def test_bad_arguments_of_a_search_are_named() -> None:
    problem = moved()
    calls: list[tuple[str, Any]] = [
        ("`tol`", lambda: problem.solve(tol=0.0)),
        ("`n_intervals`", lambda: problem.solve(n_intervals=0)),
        ("max_meshes", lambda: problem.solve(max_meshes=0)),
        ("max_time", lambda: problem.solve(max_time=-1.0)),
        ("guess", lambda: problem.solve({"x": [[0.0, 0.0, 0.0]]})),
        ("guess", lambda: problem.solve({"x": [[0.0, np.nan], [1.0, 0.0]]})),
        ("guess", lambda: problem.solve({"t": [0.0, 0.0], "x": [[0.0, 0.0], [1.0, 0.0]]})),
        ("guess", lambda: problem.solve({"u": [[0.0, 1.0]]})),
        ("t", lambda: problem.solve().state(np.nan)),
    ]
    for named, call in calls:
        with pytest.raises(ValueError, match=named):
            call()
