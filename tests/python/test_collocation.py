"""Direct collocation from Python, on problems with closed-form optima and on the arm of thesis 8.4."""

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


def test_the_double_integrator_is_its_closed_form() -> None:
    # x = 3 t² − 2 t³, u = 6 − 12 t, cost 6; costates (−12, −6 + 12 t); H = −18
    found = ocp.CollocationProblem(block(), [0.0, 0.0], [1.0, 0.0], 1.0).solve()
    t = np.linspace(0.0, 1.0, 21)
    assert found.success and found.cost == pytest.approx(6.0, abs=1e-9)
    assert found.verified_cost == pytest.approx(6.0, abs=1e-9)
    np.testing.assert_allclose(
        found.state(t), np.column_stack([3 * t**2 - 2 * t**3, 6 * t - 6 * t**2]), atol=1e-8
    )
    np.testing.assert_allclose(found.control(t)[:, 0], 6 - 12 * t, atol=1e-6)
    np.testing.assert_allclose(found.costate(t), np.column_stack([-12 + 0 * t, -6 + 12 * t]), atol=1e-6)
    np.testing.assert_allclose(found.hamiltonian, -18.0, atol=1e-6)
    assert found.hamiltonian_spread < 1e-6


def test_the_linear_quadratic_regulator_is_the_riccati_equation() -> None:
    mass, weights, effort, final, duration = 1.7, np.array([2.0, 0.5]), 0.3, np.array([4.0, 1.0]), 2.0
    found = ocp.CollocationProblem(
        block(mass),
        [1.0, -0.5],
        [None, None],
        duration,
        control_weights=effort,
        state_weights=weights,
        final_weights=final,
    ).solve()
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
    found = ocp.CollocationProblem(
        block(),
        [0.0, 0.0],
        [1.0, 0.0],
        (0.5, 5.0),
        control_weights=0.0,
        time_weight=1.0,
        control_lower=-1.0,
        control_upper=1.0,
    ).solve(n_intervals=20, max_meshes=12, tol=1e-4)
    assert found.cost == pytest.approx(2.0, abs=1e-3)
    assert found.t[-1] == pytest.approx(2.0, abs=1e-3)
    assert found.u.min() >= -1.0 - 1e-6 and found.u.max() <= 1.0 + 1e-6


def test_ends_may_be_bounded_and_states_too() -> None:
    found = ocp.CollocationProblem(
        block(), [0.0, 0.0], [(0.5, 2.0), None], 1.0, state_upper=(np.inf, 0.55), state_lower=-10.0
    ).solve(tol=1e-4)
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
    problem = ocp.CollocationProblem(block(), [0.0, 0.0], [1.0, 0.0], 1.0)
    found = problem.solve([[0.0, 0.0], [0.5, 1.5], [1.0, 0.0]])
    assert found.cost == pytest.approx(6.0, abs=1e-9)


def test_a_callback_ends_a_search_with_the_best_iterate() -> None:
    found = ocp.arm_problem().solve(callback=lambda k, z, cost, residual: k == 3)
    assert found.status == "stopped" and not found.success
    assert np.isfinite(found.x).all()


def test_what_a_callback_raises_comes_out_with_the_result() -> None:
    def callback(*_: object) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough") as caught:
        ocp.arm_problem().solve(callback=callback)
    assert caught.value.result.status == "stopped"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"initial_state": [0.0]}, "initial_state"),
        ({"initial_state": [np.nan, 0.0]}, "initial_state"),
        ({"final_state": [(2.0, 1.0), 0.0]}, "final_state"),
        ({"duration": -1.0}, "`duration`"),
        ({"duration": (2.0, 1.0)}, "`duration`"),
        ({"control_weights": -1.0}, "control_weights"),
        ({"control_weights": (1.0, 2.0)}, "control_weights"),
        ({"state_weights": np.nan}, "state_weights"),
        ({"target": np.inf}, "target"),
        ({"time_weight": np.nan}, "time_weight"),
        ({"control_lower": 1.0, "control_upper": 0.0}, "`control_lower` and `control_upper`"),
        ({"state_lower": 0.5}, "initial_state"),
        ({"actuated": ["nobody"]}, "nobody"),
    ],
)
def test_bad_problems_are_named(arguments: dict[str, Any], named: str) -> None:
    given: dict[str, Any] = {
        "model": block(),
        "initial_state": [0.0, 0.0],
        "final_state": [1.0, 0.0],
        "duration": 1.0,
    }
    with pytest.raises(errors.InputError, match=named) as caught:
        ocp.CollocationProblem(**(given | arguments))
    assert isinstance(caught.value, ValueError)


def test_bad_arguments_of_a_search_are_named() -> None:
    problem = ocp.CollocationProblem(block(), [0.0, 0.0], [1.0, 0.0], 1.0)
    calls: list[tuple[str, Any]] = [
        ("`tol`", lambda: problem.solve(tol=0.0)),
        ("`n_intervals`", lambda: problem.solve(n_intervals=0)),
        ("max_meshes", lambda: problem.solve(max_meshes=0)),
        ("max_time", lambda: problem.solve(max_time=-1.0)),
        ("guess", lambda: problem.solve([[0.0, 0.0, 0.0]])),
        ("guess", lambda: problem.solve([[0.0, np.nan], [1.0, 0.0]])),
        ("guess", lambda: problem.solve(([0.0, 0.0], [[0.0, 0.0], [1.0, 0.0]], None))),
        ("guess", lambda: problem.solve(([0.0, 1.0], [[0.0, 0.0], [1.0, 0.0]], [[0.0]]))),
        ("t", lambda: problem.solve().state(np.nan)),
    ]
    for named, call in calls:
        with pytest.raises(ValueError, match=named):
            call()


def test_a_tree_that_rotates_freely_is_refused() -> None:
    diver = multibody.diver_spatial()
    n = 2 * diver.model.n_velocities
    with pytest.raises(errors.OcpInputError, match="single coordinate"):
        ocp.CollocationProblem(diver.model, [0.0] * n, [0.0] * n, 1.0)
