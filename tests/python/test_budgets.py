"""Every solve and search ends by its budget in a status with a reason and the best iterate."""

import time
from typing import Any

import numpy as np
import pytest
from control_problems import chain

from somersault import multibody, nlp, ocp

#: Budgets that are spent at once, and how that ends.
BUDGETS: dict[str, tuple[dict[str, Any], str]] = {
    "time": ({"max_time": 1e-3}, "time_limit"),
    "evaluations": ({"max_evaluations": 1}, "evaluation_limit"),
}
REASONS = {
    "time_limit": "the limit of time was reached",
    "evaluation_limit": "the limit of evaluations was reached",
}


def control_problem() -> ocp.ControlProblem:
    """Kelly's swing-up of a pole on a cart, which takes longer than a millisecond."""

    def rates(x: Any, u: Any) -> list[Any]:
        s, c = np.sin(x.q), np.cos(x.q)
        below = 1 + 0.3 * s**2
        push = 0.15 * s * x.w**2 + u.force
        return [x.v, x.w, (push + 0.3 * 9.81 * c * s) / below, -(push * c + 1.3 * 9.81 * s) / (0.5 * below)]

    return ocp.ControlProblem(
        rates,
        states=("d", "q", "v", "w"),
        controls=("force",),
        initial=[0, 0, 0, 0],
        final=[1, np.pi, 0, 0],
        duration=2,
        bounds={"d": (-2, 2), "force": (-20, 20)},
        running_cost=lambda x, u: u.force**2,
    )


def motion_problem() -> ocp.MotionProblem:
    """A cart that lifts its pendulum."""
    conditions: Any = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
    return ocp.MotionProblem(
        multibody.cart_pendulum(),
        [0.0, np.pi],
        [0.0, 0.0],
        [ocp.Phase(ocp.SplineMotion(1, 20, conditions), 1.0, 2000)],
        active=["cart"],
        costs=[
            ocp.Cost(ocp.entries("torque", [0])),
            ocp.Cost(ocp.displacement([0.0, np.pi - 1.0], [1]), 1e4, at="finish"),
        ],
    )


def phases() -> ocp.MultiphaseProblem:
    """The swing-up, and rest after it."""
    rest = ocp.ControlProblem(
        lambda x, u: [x.v, u.force], ("d", "v"), ("force",), running_cost=lambda x, u: u.force**2
    )
    return ocp.MultiphaseProblem([control_problem(), rest])


def expect_report(found: Any, status: str) -> None:
    """A report of a motion problem, or what has one."""
    assert found.status == status and not found.success
    assert REASONS[status] in found.message
    assert np.isfinite(found.z).all()


def expect_collocation(found: Any, status: str) -> None:
    """A result of collocation."""
    assert found.status == status and not found.success
    assert REASONS[status] in found.message
    for phase in getattr(found, "phases", [found]):
        assert np.isfinite(phase.x).all() and np.isfinite(phase.u).all()


@pytest.mark.parametrize("budget", BUDGETS)
class TestBudgets:
    """A millisecond, and one evaluation."""

    def test_control_problem(self, budget: str) -> None:
        options, status = BUDGETS[budget]
        expect_collocation(control_problem().solve(**options), status)
        expect_collocation(phases().solve(**options), status)

    @pytest.mark.parametrize("method", ["auto", "shooting", "collocation", "indirect"])
    def test_methods(self, budget: str, method: Any) -> None:
        options, status = BUDGETS[budget]
        found: Any = control_problem().solve(method=method, **options)
        if method == "indirect":
            assert found.verdict == "refused" and not found.success
            found = found.found
        expect_collocation(found, status)

    def test_searches_of_control_problems(self, budget: str) -> None:
        options, status = BUDGETS[budget]
        for problem in (control_problem(), phases()):
            found = problem.search(3, **options)
            assert found.status == ("time_limit" if budget == "time" else "no_minimum")
            assert len(found.failures) == 3
            assert all(REASONS[status] in why or why == "not begun" for _, why in found.failures)
            for each in found.unfinished:
                expect_collocation(each, status)

    def test_batches(self, budget: str) -> None:
        options, status = BUDGETS[budget]
        found = ocp.solve_batch([control_problem()] * 2, **options)
        assert budget == "time" or all(each is not None for each in found)
        for each in found:
            if each is not None:
                expect_collocation(each, status)

    @pytest.mark.parametrize("solver", ["sqp", "sqp_filter", "sqp_bfgs", "lbfgs", "gradient_descent"])
    def test_motion_problem(self, budget: str, solver: Any) -> None:
        options, status = BUDGETS[budget]
        problem = motion_problem()
        expect_report(problem.solve(np.full(problem.n_variables, 0.1), solver=solver, **options), status)

    def test_search_of_a_motion_problem(self, budget: str) -> None:
        options, status = BUDGETS[budget]
        found = motion_problem().search(3, reach=0.1, **options)
        assert found.status == ("time_limit" if budget == "time" else "no_minimum")
        for each in found.unfinished:
            expect_report(each, status)

    def test_cart_pendulum(self, budget: str) -> None:
        options, status = BUDGETS[budget]
        problem = ocp.CartPendulumProblem(n_steps=20_000)
        expect_report(problem.solve(**options), status)
        found = problem.search(3, **options)
        assert found.status == ("time_limit" if budget == "time" else "no_minimum")
        for each in found.unfinished:
            expect_report(each, status)

    def test_dive(self, budget: str) -> None:
        options, status = BUDGETS[budget]
        dive = ocp.dive_107b()
        found = dive.solve(**options)
        assert found.report.status == status and np.isfinite(found.z).all()
        for each in dive.search(2, **options):
            assert each.report.status == status and np.isfinite(each.z).all()

    @pytest.mark.parametrize("method", ["ipm", "sqp", "lbfgs"])
    def test_minimize(self, budget: str, method: str) -> None:
        name = {"max_time": "max_time", "max_evaluations": "maxfev"}
        given, status = BUDGETS[budget]
        options = {name[option]: value for option, value in given.items()}

        def fun(x: Any) -> float:
            return float(np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2))

        found = nlp.minimize(fun, np.full(30, -1.2), method=method, options=options)
        assert found.status == status and not found.success
        assert REASONS[status] in found.message.lower()
        assert np.isfinite(found.x).all()


@pytest.mark.parametrize(("options", "status"), [({"max_time": 1e-6}, "time_limit"), BUDGETS["evaluations"]])
def test_polish_ends_by_its_budget(options: dict[str, Any], status: str) -> None:
    problem = control_problem()
    found = problem.solve(tol=1e-4)
    polished = problem.polish(found, **options)
    assert polished.verdict == "refused" and REASONS[status] in polished.message
    assert np.isfinite(polished.state(1.0)).all()


def test_a_limit_of_evaluations_is_one_of_all_meshes() -> None:
    problem = control_problem()
    whole = problem.solve(tol=1e-4)
    assert whole.success
    for most in (3, 10, 20):
        found = problem.solve(tol=1e-4, max_evaluations=most)
        assert found.status == "evaluation_limit" and found.report.nfev <= most
        assert np.isfinite(found.x).all()


class TestMerit:
    """What did not converge is ranked by merit: a start is not best because it is feasible."""

    def test_starts_of_a_motion_problem(self) -> None:
        problem = motion_problem()
        found = problem.search(6, reach=1.0, max_iterations=1)
        costs = [each.cost for each in found.unfinished]
        assert costs == sorted(costs)

    def test_starts_of_a_control_problem(self) -> None:
        # the second start is feasible and expensive, and no step has left it
        problem = ocp.ControlProblem(
            lambda x, u: [u.v],
            ("x",),
            ("v",),
            bounds={"x": (0, 10), "v": (-100, 100)},
            initial=[(0, 10)],
            final=[(0, 10)],
            path=[(lambda x: x.x * (x.x - 2), 0, None)],
            running_cost=lambda x, u: x.x + 1e-3 * u.v**2,
        )
        found = problem.search(8, max_iterations=1, tol=1e-4)
        reports = [each.report for each in found.unfinished]
        violations = [report.feasibility for report in reports]
        weights = sorted(max(1.0, float(np.abs(report.constraint_multipliers).sum())) for report in reports)
        weight = weights[len(weights) // 2]
        merits = [
            report.cost + (weight * report.feasibility if report.feasibility > 1e-6 else 0.0)
            for report in reports
        ]
        assert len(reports) >= 4 and merits == sorted(merits) and violations != sorted(violations)


def seconds(run: Any) -> tuple[Any, float]:
    began = time.monotonic()
    return run(), time.monotonic() - began


#: What may pass after a limit of time, on a machine that other processes share.
SLACK = 1.0


class TestLimitsOfTimeThatEndLongWork:
    """A step of an integration or of a quadratic program is the longest that a limit waits for."""

    def test_polish_of_a_chain(self) -> None:
        # its equations take seconds
        problem = chain(4, 0.0)
        found = problem.solve(tol=1e-4)
        exact, took = seconds(lambda: problem.polish(found, max_time=0.2))
        assert exact.verdict == "refused" and took < 0.2 + SLACK
        assert "limit of time was reached" in exact.message

    @pytest.mark.parametrize("method", ["auto", "indirect"])
    def test_a_chain(self, method: Any) -> None:
        found, took = seconds(lambda: chain(10, 0.0).solve(method=method, max_time=0.7))
        assert not found.success and took < 0.7 + SLACK
        assert "limit of time was reached" in found.message

    def test_a_quadratic_program_of_splines(self) -> None:
        # rows that say the same leave a step to a quadratic program of thousands of rows
        problem = ocp.ControlProblem(
            lambda x, u: [x.v, u.force],
            states=("x", "v"),
            controls=("force",),
            initial=[0, 0],
            final=[1, 0],
            bounds={"force": (-5, 5)},
            path=[(lambda x, u: u.force, -5, 5), (lambda x, u: 2 * u.force, -10, 10)],
            running_cost=lambda x, u: 0.5 * u.force**2,
        )
        found, took = seconds(lambda: problem.solve(method="shooting", max_time=0.5))
        assert found.status in ("time_limit", "converged") and took < 0.5 + SLACK
        by_points = problem.solve(method="collocation")
        assert by_points.success and by_points.cost == pytest.approx(6.0450, rel=1e-4)
