"""Control problems of trees with ball, planar and free joints."""

import functools
import pickle
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from somersault import multibody, ocp, plotting, viewer
from somersault.errors import InputError

mpl.use("Agg")

#: Bilimoria and Wie, J. Guid. Control Dyn. 16 (1993), 446; digits by `tests/derivations/optimal_control.py`.
FASTEST = 3.24308327745233
TORQUES = ("u_hub_0", "u_hub_1", "u_hub_2")


def ball(inertia: ArrayLike = (1, 1, 1)) -> multibody.Model:
    hub = multibody.Link("hub", "spherical", mass=1, inertia=np.diag(inertia))
    return multibody.Model([hub], gravity=(0, 0, 0))


def half_turn(last: ArrayLike = (0, 0, 1, 0)) -> ocp.ControlProblem:
    return ocp.ControlProblem(
        ball(),
        initial=[0, 0, 0, 1, 0, 0, 0],
        final=[*np.asarray(last), 0, 0, 0],
        duration=(1, 6),
        bounds={name: (-1, 1) for name in TORQUES},
        end_cost=lambda x, t: t,
    )


def moved(found: ocp.CollocationResult) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Configurations and velocities of a tree."""
    assert found.q is not None and found.v is not None
    return found.q, found.v


def tilted() -> dict[str, ArrayLike]:
    """A turn about z that tilts to both sides."""
    s = np.linspace(0, 1, 9)
    sine = [0.5 * np.sin(2 * np.pi * s), 0.5 * np.sin(np.pi * s), 1.6 * np.sin(np.pi * s)]
    return {"t": 3.3 * s, **{f"v_hub_{k}": row for k, row in enumerate(sine)}}


@functools.cache
def satellite() -> tuple[ocp.ControlProblem, ocp.CollocationResult]:
    """A hub with four hinges, turned by 10° by what the hinges do."""
    places = {"right": [0.3, 0, 0], "front": [0, 0.3, 0], "left": [-0.3, 0, 0], "back": [0, -0.3, 0]}
    axes = [[0, 1, 0], [0, 0, 1], [0, 0, 1], [1, 0, 0]]
    arms = [
        multibody.Link(
            name,
            "revolute",
            parent="hub",
            axis=axis,
            origin=place,
            mass=1,
            center=np.multiply(place, 0.8),
            inertia=0.02 * np.eye(3),
        )
        for (name, place), axis in zip(places.items(), axes, strict=True)
    ]
    hub = multibody.Link("hub", "free", mass=4, inertia=np.diag([0.3, 0.35, 0.4]))
    model = multibody.Model([hub, *arms], gravity=(0, 0, 0))
    axis, half = np.array([1, 2, 3]) / np.sqrt(14), np.deg2rad(5)
    entries = ("q_hub_x", "q_hub_y", "q_hub_z", "q_hub_w")
    turned = dict(zip(entries, [*np.sin(half) * axis, np.cos(half)], strict=True))
    problem = ocp.ControlProblem(
        model,
        actuated=list(places),
        initial=[*model.neutral(), *np.zeros(10)],
        final={**turned, **{f"{kind}_{name}": 0 for kind in "qv" for name in places}},
        duration=2,
        running_cost=lambda x, u: 0.5 * u @ u,
    )
    return problem, problem.solve(tol=1e-5, n_intervals=10)


def test_the_fastest_half_turn_is_that_of_bilimoria_and_wie() -> None:
    found = half_turn().solve(tilted(), tol=1e-5)
    assert found.success and abs(found.cost - FASTEST) < 1e-6
    exact = half_turn().polish(found)
    assert exact.verdict == "strict_minimum" and exact.residual < 1e-10, exact.message
    assert abs(exact.cost - FASTEST) < 1e-13 and len(exact.arcs) == 6


def test_the_fastest_half_turn_is_found_from_a_straight_line_which_leads_to_a_saddle() -> None:
    found = half_turn().solve(method="indirect")
    assert found.verdict == "strict_minimum" and abs(found.cost - FASTEST) < 1e-12, found.message
    saddle = found.found.meshes[0]
    assert saddle["is_start"] and abs(saddle["cost"] - 2 * np.sqrt(np.pi)) < 1e-3
    assert "saddle of cost 3.54" in found.found.message


def test_a_hub_with_an_arm_is_polished() -> None:
    hub = multibody.Link("hub", "spherical", mass=2, inertia=np.diag([1.0, 2.0, 2.5]))
    arm = multibody.Link(
        "arm", "revolute", parent="hub", axis=(0, 1, 0), origin=(0.3, 0, 0), mass=0.5, center=(0.2, 0, 0),
        inertia=np.diag([0, 0.01, 0.01]),
    )  # fmt: skip
    problem = ocp.ControlProblem(
        multibody.Model([hub, arm], gravity=(0, 0, 0)), initial=[0, 0, 0, 1, 0, 0, 0, 0, 0],
        final=[0.5, 0.5, 0.5, 0.5, 0.3, 0, 0, 0, 0], running_cost=lambda x, u: 0.5 * u @ u,
    )  # fmt: skip
    found = problem.solve(tol=1e-8)
    exact = problem.polish(found)
    assert exact.verdict == "strict_minimum" and exact.residual < 1e-10, exact.message
    assert exact.cost == pytest.approx(found.cost, rel=1e-8)


@pytest.mark.study
def test_a_satellite_with_hinges_is_polished() -> None:
    problem, turned = satellite()
    exact = problem.polish(turned)
    # its momentum is not controlled: variations do not reach all states, and conjugate points have no meaning
    assert exact.verdict == "first_order" and exact.residual < 1e-10, exact.message
    assert exact.cost == pytest.approx(problem.solve(turned, tol=1e-9).cost, rel=1e-8)
    # nothing acts on it from outside: its angular momentum stays
    model = problem.model
    assert model is not None
    states = exact.state(np.linspace(0, 1, 5) * exact.horizon[1])
    n = model.n_positions
    momenta = np.array([model.centroidal_momentum(x[:n], x[n:]) for x in states])
    assert np.abs(momenta - momenta[0]).max() < 1e-9


def test_a_turn_is_solved_from_nothing_by_the_indirect_method() -> None:
    problem = ocp.ControlProblem(
        ball(), initial=[0, 0, 0, 1, 0, 0, 0], final=[0, 0, np.sqrt(0.5), np.sqrt(0.5), 0, 0, 0],
        running_cost=lambda x, u: 0.5 * u @ u,
    )  # fmt: skip
    exact = problem.solve(method="indirect")
    assert exact.verdict == "strict_minimum" and exact.cost == pytest.approx(1.5 * np.pi**2, rel=1e-12)


def test_both_signs_and_all_times_give_the_same_cost() -> None:
    last = np.array([1, -2, 2, 4]) / 5

    def turn(last: ArrayLike, start: float = 0) -> float:
        problem = ocp.ControlProblem(
            ball((1, 2, 3)),
            initial=[0, 0, 0, 1, 0, 0, 0],
            final=[*np.asarray(last), 0, 0, 0],
            start_time=start,
            running_cost=lambda x, u: 0.5 * u @ u,
        )
        return problem.solve().cost

    assert turn(last) == turn(-last)
    assert abs(turn(last) - turn(last, 1e4)) < 1e-9
    problem, turned = satellite()
    entries = ("q_hub_x", "q_hub_y", "q_hub_z", "q_hub_w")
    last = moved(turned)[0][-1, 3:7]
    other = problem.replace(final=dict(zip(entries, -last, strict=True)))
    assert abs(other.solve(tol=1e-5, n_intervals=10).cost - turned.cost) < 1e-7


def test_a_guess_says_which_way_round() -> None:
    """Three quarters of a turn about z in place of one."""
    quarter = [0, 0, np.sqrt(0.5), np.sqrt(0.5), 0, 0, 0]
    problem = ocp.ControlProblem(
        ball(), initial=[0, 0, 0, 1, 0, 0, 0], final=quarter, running_cost=lambda x, u: 0.5 * u @ u
    )
    half = np.linspace(0, -0.75 * np.pi, 9)
    long = problem.solve({"q_hub_z": np.sin(half), "q_hub_w": np.cos(half)})
    costs = [6 * (np.pi / 2) ** 2, 6 * (1.5 * np.pi) ** 2]
    assert [problem.solve().cost, long.cost] == pytest.approx(costs, rel=1e-6)
    searched = problem.search(16, tol=1e-4)
    assert [each.cost for each in searched.minima[:2]] == pytest.approx(costs, rel=1e-4)


def test_a_satellite_turns_by_its_own_motion_with_zero_momentum() -> None:
    problem, found = satellite()
    assert found.success and found.confirmed, found.message
    assert found.verification.momentum_drift < 1e-5 and found.terminal_error < 1e-6
    q, v = moved(found)
    assert np.abs(q[-1, :3]).max() < 1e-6, "the centre of mass stays"
    assert np.abs(v[-1]).max() < 1e-6
    assert q.shape[1] == 11 and v.shape[1] == 10
    assert problem.state_names[:7] == [f"q_hub_{name}" for name in ("px", "py", "pz", "x", "y", "z", "w")]
    assert problem.state_names[11:17] == [f"v_hub_{k}" for k in range(6)]
    assert np.linalg.norm(q[:, 3:7], axis=1) == pytest.approx(1, abs=1e-14)
    assert np.linalg.norm(found.state(np.linspace(0, 2, 50))[:, 3:7], axis=1) == pytest.approx(1, abs=1e-14)
    plotting.tree_motion(found)
    plotting.control_history(found)
    viewer.Scene().add(found)
    again = pickle.loads(pickle.dumps(found))
    assert (again.q == q).all() and (again.joint_costates == found.joint_costates).all()
    repeated = problem.solve(found, tol=1e-5)
    assert repeated.meshes[0]["nit"] <= 1
    assert abs(repeated.cost - found.cost) < 1e-9


def test_costates_are_derivatives_of_the_cost_in_body_axes() -> None:
    axis, half = np.array([1, 2, 3]) / np.sqrt(14), 0.6
    problem = ocp.ControlProblem(
        ball((1, 2, 3)),
        initial=[0, 0, 0, 1, 0, 0, 0],
        final=[*np.sin(half) * axis, np.cos(half), 0, 0, 0],
        running_cost=lambda x, u: 0.5 * u @ u,
    )
    found = problem.solve()
    joint_costates = found.joint_costates
    assert joint_costates is not None
    h = 1e-4
    for k in range(3):
        ends = []
        for side in (h, -h):
            turned = np.array([0, 0, 0, 1.0])
            turned[k] = np.sin(side / 2)
            turned[3] = np.cos(side / 2)
            ends.append(problem.replace(initial=[*turned, 0, 0, 0]).solve(found).cost)
        assert joint_costates[0, k] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5)
    along = np.abs((found.costates[:, :4] * moved(found)[0]).sum(axis=1))
    assert along.max() < 1e-4 * np.abs(found.costates).max()
    by = problem.sensitivity(found)
    assert by.cost[:3] == pytest.approx(2 * joint_costates[0], rel=1e-5)
    assert abs(by.cost[3]) < 1e-6, "the norm counts nowhere"


def test_costs_and_integrals_see_unit_quaternions_and_planar_joints_work() -> None:
    """Half of a revolution, with the norm as an integral; a body on a plane that is pushed and turned."""
    problem = ocp.ControlProblem(
        ball(),
        initial=[0, 0, 0, 1, 0, 0, 0],
        final=[0, 0, 1, 0, 0, 0, 0],
        running_cost=lambda x, u: 0.5 * u @ u,
        integrals=[(lambda x: x.q_hub_x**2 + x.q_hub_y**2 + x.q_hub_z**2 + x.q_hub_w**2, None, None)],
        path=[(lambda x: x.q_hub_w, -0.5, None)],
    )
    found = problem.solve()
    assert found.success and found.x[-1, 7] == pytest.approx(1, abs=1e-12)
    assert found.cost == pytest.approx(6 * np.pi**2, rel=1e-6)
    hub = multibody.Link("hub", "planar", mass=1, inertia=np.eye(3))
    pushed = ocp.ControlProblem(
        multibody.Model([hub], gravity=(0, 0, 0)),
        initial=np.zeros(6).tolist(),
        final=[1, 2, 1, 0, 0, 0],
        running_cost=lambda x, u: 0.5 * u @ u,
    )
    assert pushed.state_names[:3] == ["q_hub_px", "q_hub_py", "q_hub_angle"]
    pushed_there = pushed.solve()
    assert pushed_there.cost == pytest.approx(6 * (1 + 4 + 1), rel=1e-6)
    # positions of a planar joint are numbers, so that it has arcs
    exact = pushed.polish(pushed_there)
    assert exact.success and exact.cost == pytest.approx(36, rel=1e-9), exact.message


def test_an_orientation_continues_from_phase_to_phase() -> None:
    def leg(initial: Sequence[float] | None, final: Sequence[float | None]) -> ocp.ControlProblem:
        return ocp.ControlProblem(ball(), initial=initial, final=final, running_cost=lambda x, u: 0.5 * u @ u)

    quarter = [0, 0, -np.sqrt(0.5), -np.sqrt(0.5), None, None, None]
    there, on = leg([0, 0, 0, 1, 0, 0, 0], quarter), leg(None, [0, 0, 1, 0, 0, 0, 0])
    found = ocp.MultiphaseProblem([there, on]).solve()
    begun = on.replace(initial=[0, 0, np.sqrt(0.5), np.sqrt(0.5), None, None, None])
    assert ocp.MultiphaseProblem([there, begun]).solve().cost == pytest.approx(found.cost, rel=1e-6)
    assert found.success and found.cost == pytest.approx(0.75 * np.pi**2, rel=1e-6)


def test_what_is_wrong_is_said() -> None:
    with pytest.raises(
        InputError, match=r"`final` must have a quaternion of norm 1, to a thousandth, at entry 0 \(q_hub_x\)"
    ):
        half_turn((0, 0, 0.9, 0))
