"""Extremals of problems that `ocp` poses, by collocation and multiple shooting."""

import pickle
import time
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from somersault import errors, ftla, multibody, ocp


def fall(x: Any, u: Any) -> Any:
    return -(x.x**3) + u.u


def effort(x: Any, u: Any) -> Any:
    return 0.5 * (x.x**2 + u.u**2)


def regulator(horizon: float = 40.0, **more: Any) -> ocp.ControlProblem:
    """The cubic regulator from 1 to 1.5."""
    given: dict[str, Any] = {"initial": [1.0], "final": [1.5], "running_cost": effort, "duration": horizon}
    return ocp.ControlProblem(fall, ("x",), ("u",), **(given | more))


def confirmed(found: ftla.ContinuationResult) -> None:
    """Every segment and both ends by SciPy, and the field by differences of its Hamiltonian."""
    extremal = found.extremal
    system, size = extremal.system, np.abs(extremal.nodes).max(axis=0) + 1e-3
    n = system.dimension // 2
    for k, p in enumerate(extremal.nodes[:-1]):
        span = extremal.times[k : k + 2]
        end = solve_ivp(lambda _, q: system.field(q), span, p, method="DOP853", rtol=1e-11, atol=1e-13)
        assert (np.abs(end.y[:, -1] - extremal.nodes[k + 1]) < 1e-8 * size).all()
    p, h = extremal(0.4 * extremal.times[-1]), 1e-5
    slope = [(system.hamiltonian(p + h * e) - system.hamiltonian(p - h * e)) / (2 * h) for e in np.eye(2 * n)]
    np.testing.assert_allclose(system.field(p), [*slope[n:], *(-x for x in slope[:n])], atol=1e-5, rtol=1e-5)


def test_the_system_of_a_problem_is_that_of_the_regulator() -> None:
    system, closed = ftla.system_of(regulator()), ftla.cubic_regulator()
    assert repr(system) == "<System: extremals of <ControlProblem: states x; controls u>>"
    p = np.random.default_rng(1).normal(size=(50, 2))
    np.testing.assert_allclose(system.field(p), closed.field(p), atol=1e-13)
    np.testing.assert_allclose(system.jacobian(p), closed.jacobian(p), atol=1e-13)
    np.testing.assert_allclose(system.hamiltonian(p), closed.hamiltonian(p), atol=1e-13)
    np.testing.assert_allclose(system.control(p), closed.control(p), atol=1e-15)
    again = pickle.loads(pickle.dumps(system))
    np.testing.assert_array_equal(again.field(p), system.field(p))


@pytest.mark.parametrize("horizon", [0.5, 40.0, 1000.0])
def test_a_problem_is_solved_between_its_own_ends(horizon: float) -> None:
    found = ftla.cold_start(ftla.system_of(regulator(horizon)))
    assert found.success and found.extremal.times[-1] == horizon
    if horizon >= 40.0:
        # crates/somersault-ftla/tests/ftla/posed.rs
        assert found.extremal.cost() == pytest.approx(3.36205690494300, abs=1e-10)
    confirmed(found)


def test_other_ends_take_the_place_of_those_of_the_problem() -> None:
    system = ftla.system_of(regulator())
    found = ftla.cold_start(system, [-1.0], [None], 30.0)
    root = np.sqrt(2.0)
    # to a free end, from a: ∫ −x³ + x √(x⁴ + 1) dx, by SymPy 1/8 (x² √(x⁴+1) + asinh x²)·2 − x⁴/4 at 1
    expected = -0.25 + 0.25 * (root + np.arcsinh(1.0))
    assert found.success and found.extremal.cost() == pytest.approx(expected, abs=1e-9)
    assert abs(found.extremal.nodes[-1, 1]) < 1e-12
    # one end of the problem, which leaves the other between bounds
    between = ftla.system_of(regulator(initial=[-1.0], final={"x": (1.0, 2.0)}, duration=30.0))
    assert ftla.cold_start(between, final_state=[None]).extremal.cost() == pytest.approx(expected, abs=1e-9)
    free = ftla.system_of(regulator(final=None, duration=30.0, initial=[-1.0]))
    assert ftla.cold_start(free).extremal.cost() == pytest.approx(expected, abs=1e-9)


def van_der_pol() -> ocp.ControlProblem:
    return ocp.ControlProblem(
        lambda x, u: (x.b, -x.a + x.b * (1 - x.a**2) + u.u), ("a", "b"), ("u",),
        initial=[1.0, 0.0], final=[-0.5, 0.2], duration=6.0, bounds={"u": (-0.4, 0.7)},
        running_cost=lambda x, u: 0.5 * (x.a**2 + x.b**2) + np.cosh(u.u) - 1.0,
    )  # fmt: skip


def swing() -> ocp.ControlProblem:
    return ocp.ControlProblem(
        multibody.cart_pendulum(), actuated=["cart"], initial=[0, 0, 0, 0], final=[1, np.pi, 0, 0],
        duration=2.0, running_cost=lambda x, u: u.u_cart**2,
    )  # fmt: skip


def orbit() -> ocp.ControlProblem:
    return ocp.ControlProblem(
        lambda x, u, t, p: (
            x.v, x.w**2 * x.r - p.mu / x.r**2 + u.radial, x.w, (u.along - 2 * x.v * x.w) / x.r
        ),
        ("r", "v", "angle", "w"), ("radial", "along"), ("mu",), bounds={"mu": (1.0, 1.0)},
        initial=[1, 0, 0, 1], final=[1.3, 0, 3.0, 1.3**-1.5], duration=4.0,
        running_cost=lambda x, u: 0.5 * u @ u,
    )  # fmt: skip


@pytest.mark.parametrize("posed", [van_der_pol, swing, orbit])
def test_extremals_cost_what_collocation_says(posed: Any) -> None:
    problem = posed()
    found = ftla.cold_start(ftla.system_of(problem))
    assert found.success
    solution = problem.solve(tol=1e-8)
    assert solution.status == "converged"
    assert found.extremal.cost() == pytest.approx(solution.cost, rel=1e-7)
    confirmed(found)


def test_random_problems_are_claimed_only_where_scipy_agrees() -> None:
    random = np.random.default_rng(7)
    claimed = 0
    for _ in range(20):
        a, b = random.normal(size=(3, 3)), random.normal(size=(3, 2))
        c, ends = random.normal(size=3), random.normal(size=(2, 3))
        limit = float(random.uniform(0.5, 5.0)) if random.random() < 0.5 else np.inf

        def dynamics(x: Any, u: Any, a: Any = a, b: Any = b, c: Any = c) -> Any:
            return a @ x + b @ u + c * np.sin(x)

        problem = ocp.ControlProblem(
            dynamics, 3, 2, initial=ends[0], final=ends[1], duration=float(random.uniform(0.5, 8.0)),
            running_cost=lambda x, u: 0.5 * (x @ x + u @ u) + 0.1 * u[0] ** 4,
            bounds={"u0": (-limit, limit)},
        )  # fmt: skip
        found = ftla.cold_start(ftla.system_of(problem), max_time=1.0)
        if found.success:
            claimed += 1
            np.testing.assert_allclose(found.extremal.nodes[[0, -1], :3], ends, atol=1e-9)
            confirmed(found)
    assert claimed >= 18


@pytest.mark.parametrize(
    ("reason", "given"),
    [
        ("`x` has bounds", {"bounds": {"x": (0.0, 2.0)}}),
        ("`path constraint 0` has bounds", {"path": [(lambda x, u: x.x + u.u, None, 9.0)]}),
        ("it has end constraints", {"ends": [(lambda x_0, x_f: x_f.x, None, 9.0)], "final": None}),
        ("it has an end cost", {"end_cost": lambda x: x.x**2, "final": None}),
        ("its running cost depends on time", {"running_cost": lambda x, u, t: u.u**2 * (1 + t)}),
    ],
)
def test_what_the_equations_of_extremals_do_not_have_is_refused(reason: str, given: dict[str, Any]) -> None:
    with pytest.raises(errors.InputError, match=reason):
        ftla.system_of(regulator(**given))


def test_what_is_refused_is_named() -> None:
    system = ftla.system_of(regulator())
    open_end = ftla.system_of(regulator(final={"x": (1.0, 2.0)}))
    free = ocp.ControlProblem(
        lambda x, u, t, p: p.k * x.x + u.u, ("x",), ("u",), ("k",), initial=[1.0], running_cost=effort
    )
    turn = ocp.ControlProblem(
        multibody.Model([multibody.Link("hub", "spherical", mass=1, inertia=np.eye(3))]),
        initial=[0, 0, 0, 1, 0, 0, 0], running_cost=lambda x, u: u @ u,
    )  # fmt: skip
    affine = ftla.system_of(regulator(running_cost=lambda x, u: x.x**2, bounds={"u": (-1.0, 1.0)}))
    wrong: Any = ["a"]
    calls: list[tuple[str, type[Exception], Any]] = [
        ("`problem` must be a ControlProblem, found int", errors.InputError, lambda: ftla.system_of(3)),  # type: ignore[arg-type]
        ("parameter 0 is not given", errors.InputError, lambda: ftla.system_of(free)),
        ("quaternions", errors.InputError, lambda: ftla.system_of(turn)),
        (
            "`x` of the final state is neither given nor free",
            errors.InputError,
            lambda: ftla.cold_start(open_end),
        ),
        (
            "`initial_state` must have 1 entries, found 2",
            errors.InputError,
            lambda: ftla.cold_start(system, [1.0, 2.0]),
        ),
        ("`final_state` must be finite", errors.InputError, lambda: ftla.cold_start(system, [1.0], [np.nan])),
        (
            "`final_state` must be numbers, or None where free",
            errors.InputError,
            lambda: ftla.cold_start(system, [1.0], wrong),
        ),
        ("`horizon`", errors.InputError, lambda: ftla.cold_start(system, horizon=0.0)),
        ("`initial_state` must be given", errors.InputError, lambda: ftla.cold_start(ftla.cubic_regulator())),
        (
            "the control Hessian must be positive definite",
            errors.EvaluationError,
            lambda: affine.control([1.0, 1.0]),
        ),
    ]
    for message, kind, call in calls:
        with pytest.raises(kind, match=message):
            call()


def test_limits_end_a_start_with_what_it_has() -> None:
    system = ftla.system_of(regulator(10_000.0))
    for limit in ({"max_time": 1e-3}, {"max_evaluations": 50}):
        found = ftla.cold_start(system, **limit)
        assert not found.success and found.status == "limit_reached"
        assert found.extremal.nodes.shape[1] == 2


def test_a_limit_of_time_ends_collocation_of_many_states_too() -> None:
    random = np.random.default_rng(0)
    a, b = random.normal(size=(40, 40)) / 3, random.normal(size=(40, 4))
    problem = ocp.ControlProblem(
        lambda x, u: a @ x + b @ u + np.sin(x[::-1]), 40, 4, initial=random.normal(size=40),
        final=random.normal(size=40), duration=20.0, running_cost=lambda x, u: 0.5 * (x @ x + u @ u),
    )  # fmt: skip
    system, began = ftla.system_of(problem), time.monotonic()
    found = ftla.cold_start(system, max_time=0.5)
    assert found.status == "limit_reached" and time.monotonic() - began < 2.0
