"""Random optimal control problems: what is claimed of a solution holds by an independent integration."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.integrate

from somersault import multibody, ocp

Rates = Callable[[Any, Any, float], list[Any]]


def regulator(rng: np.random.Generator) -> tuple[ocp.ControlProblem, Rates]:
    """A linear plant of three states and two bounded controls, quadratic costs."""
    a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    price = rng.uniform(0.05, 0.5)

    def rates(x: Any, u: Any, t: float = 0.0) -> list[Any]:
        return list(a @ x + b @ u)

    problem = ocp.ControlProblem(
        rates,
        3,
        2,
        initial=rng.normal(size=3),
        duration=float(rng.uniform(1, 3)),
        bounds={"u0": (-1, 1), "u1": (-1, 1)},
        running_cost=lambda x, u: x @ x + price * u @ u,
        end_cost=lambda x: x @ x,
    )
    return problem, rates


def pendulum(rng: np.random.Generator) -> tuple[ocp.ControlProblem, Rates]:
    """A pendulum with friction that is swung to an angle, with minimum effort."""
    pull, friction = rng.uniform(2, 12), rng.uniform(0, 0.5)

    def rates(x: Any, u: Any, t: float = 0.0) -> list[Any]:
        return [x[1], u[0] - pull * np.sin(x[0]) - friction * x[1]]

    problem = ocp.ControlProblem(
        rates,
        2,
        1,
        initial=[0, 0],
        final=[rng.uniform(1, np.pi), 0],
        duration=float(rng.uniform(1, 3)),
        running_cost=lambda x, u: u[0] ** 2,
    )
    return problem, rates


def sprint(rng: np.random.Generator) -> tuple[ocp.ControlProblem, Rates]:
    """A mass with quadratic drag, over a distance in the shortest time."""
    drag = rng.uniform(0, 0.3)

    def rates(x: Any, u: Any, t: float = 0.0) -> list[Any]:
        return [x[1], u[0] - drag * x[1] * np.abs(x[1])]

    problem = ocp.ControlProblem(
        rates,
        2,
        1,
        initial=[0, 0],
        final=[rng.uniform(0.5, 5), 0],
        duration=(0.1, 30),
        bounds={"u0": (-rng.uniform(0.5, 2), rng.uniform(0.5, 2))},
        running_cost=lambda x: 1.0,
    )
    return problem, rates


def detour(rng: np.random.Generator) -> tuple[ocp.ControlProblem, Rates]:
    """A boat in a current that changes with time, around an island."""
    current, period = rng.uniform(-0.5, 0.5), rng.uniform(2, 6)

    def rates(x: Any, u: Any, t: Any = 0.0) -> list[Any]:
        return [u[0] + current * np.sin(2 * np.pi * t / period), u[1]]

    island = rng.uniform(-0.3, 0.3)
    problem = ocp.ControlProblem(
        rates,
        2,
        2,
        initial=[-2, 0],
        final=[2, 0],
        duration=float(rng.uniform(2, 4)),
        start_time=float(rng.uniform(0, 5)),
        path=[(lambda x: x[0] ** 2 + (x[1] - island) ** 2, rng.uniform(0.3, 0.8), None)],
        running_cost=lambda x, u: u @ u,
    )
    return problem, rates


def arm(rng: np.random.Generator) -> tuple[ocp.ControlProblem, Rates]:
    """Two links without gravity, rest to rest, written out (Murray, Li & Sastry 1994, example 4.3)."""
    m, n, length = rng.uniform(0.5, 2), rng.uniform(0.5, 2), rng.uniform(0.5, 1.5)
    alpha, beta, delta = (m / 4 + n) * length**2 + 0.1, 0.5 * n * length, 0.25 * n + 0.1

    def rates(x: Any, u: Any, t: float = 0.0) -> list[Any]:
        c, s = np.cos(x[1]), np.sin(x[1])
        m11, m12, m22 = alpha + delta + 2 * beta * c, delta + beta * c, delta
        f1 = u[0] + beta * s * x[3] * (2 * x[2] + x[3])
        f2 = u[1] - beta * s * x[2] ** 2
        below = m11 * m22 - m12 * m12
        return [x[2], x[3], (m22 * f1 - m12 * f2) / below, (m11 * f2 - m12 * f1) / below]

    problem = ocp.ControlProblem(
        rates,
        4,
        2,
        initial=[*rng.uniform(-1, 1, 2), 0, 0],
        final=[*rng.uniform(-1, 1, 2), 0, 0],
        duration=float(rng.uniform(0.5, 2)),
        running_cost=lambda x, u: u @ u,
    )
    return problem, rates


def tree(rng: np.random.Generator) -> tuple[ocp.ControlProblem, Rates]:
    """A tree of one to three hinges and sliders in space, with damping, of which one may be passive."""
    n = int(rng.integers(1, 4))
    links = [
        multibody.Link(
            f"link{k}",
            "prismatic" if rng.random() < 0.3 else "revolute",
            parent=f"link{rng.integers(k)}" if k else None,
            axis=rng.normal(size=3),
            origin=rng.uniform(-0.5, 0.5, 3),
            mass=rng.uniform(0.5, 2),
            center=rng.uniform(-0.3, 0.3, 3),
            inertia=np.diag(rng.uniform(0.1, 0.15, 3)),
            damping=rng.uniform(0, 0.5),
        )
        for k in range(n)
    ]
    model = multibody.Model(links, gravity=rng.uniform(-3, 3, 3))
    driven = np.ones(n, bool)
    driven[rng.integers(n)] = n == 1 or rng.random() < 0.5

    def rates(x: Any, u: Any, t: float = 0.0) -> list[Any]:
        torque = np.zeros(n)
        torque[driven] = u
        return [*x[n:], *model.forward_dynamics(x[:n], x[n:], torque)]

    final = [
        float(angle) if moved else None for angle, moved in zip(rng.uniform(-1, 1, n), driven, strict=True)
    ]
    problem = ocp.ControlProblem(
        model,
        actuated=driven.tolist(),
        initial=[0] * 2 * n,
        final=[*final, *(0 if moved else None for moved in driven)],
        duration=float(rng.uniform(0.5, 2)),
        running_cost=lambda x, u: u @ u,
    )
    return problem, rates


FAMILIES = {
    "regulator": regulator,
    "pendulum": pendulum,
    "sprint": sprint,
    "detour": detour,
    "arm": arm,
    "tree": tree,
}


def worst_defect(t: Any, x: Any, control: Callable[[float], Any], rates: Rates) -> float:
    """The largest error at a node, integrated from the node before it, relative to the sizes of states."""
    size = np.abs(x).max(axis=0) + 1.0
    worst = 0.0
    for k, (start, end) in enumerate(itertools.pairwise(t)):
        inside = end - 1e-12 * (end - start)
        arrived = scipy.integrate.solve_ivp(
            lambda t, x: rates(x, control(min(t, inside)), t),  # noqa: B023
            (start, end),
            x[k],
            method="DOP853",
            rtol=1e-10,
            atol=1e-12,
        ).y[:, -1]
        worst = max(worst, float((np.abs(arrived - x[k + 1]) / size).max()))
    return worst


def check(family: str, seeds: range) -> int:
    """How many are solved; claims are checked, and failures have a reason."""
    solved = 0
    for seed in seeds:
        problem, rates = FAMILIES[family](np.random.default_rng(seed))
        found = problem.solve()
        if not found.success:
            assert found.status in ("infeasible", "mesh_limit", "stalled", "iteration_limit"), found.status
            assert len(found.message) > 20
            continue
        solved += 1
        assert worst_defect(found.t, found.x, found.control, rates) < 3e-6, (family, seed)
        # ends and bounds, as they were posed
        again = problem.solve(found)
        assert again.success and again.cost == pytest.approx(found.cost, rel=1e-5), (family, seed)
    return solved


def check_polished(seeds: range) -> int:
    """How many trees are polished; claims are checked by the kernels, and refusals have a reason."""
    claimed = 0
    for seed in seeds:
        problem, rates = tree(np.random.default_rng(seed))
        found = problem.solve(tol=1e-4)
        exact = problem.polish(found)
        if not exact.success:
            assert len(exact.message) > 20, seed
            continue
        claimed += 1
        times = np.linspace(*exact.horizon, 4)
        assert exact.residual < 1e-10
        assert worst_defect(times, exact.state(times), exact.control, rates) < 1e-9, seed
        assert exact.cost == pytest.approx(found.cost, rel=1e-3), seed
        given = problem.__reduce__()[0].keywords["final"]
        ends = [abs(x - end) for x, end in zip(exact.state(times[-1]), given, strict=True) if end is not None]
        assert max(ends) < 1e-9, seed
    return claimed


def test_polished_motions_of_random_trees_are_motions() -> None:
    assert check_polished(range(1, 4)) == 3


@pytest.mark.study
def test_polished_motions_of_twenty_random_trees_are_motions() -> None:
    assert check_polished(range(20)) >= 18


@pytest.mark.parametrize("family", FAMILIES)
def test_claimed_solutions_of_random_problems_are_motions(family: str) -> None:
    assert check(family, range(2)) == 2


@pytest.mark.study
@pytest.mark.parametrize("family", FAMILIES)
def test_claimed_solutions_of_a_hundred_random_problems_are_motions(family: str) -> None:
    assert check(family, range(20)) >= 19
