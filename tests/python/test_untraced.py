"""Functions that cannot be traced, in control problems: tables, branches, derivatives that are wrong."""

import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, RegularGridInterpolator

from somersault import multibody, ocp
from somersault.errors import EvaluationError, InputError, TraceError

#: ½ ∫ u² for a metre in a second.
EFFORT = 6.0


def branching(x: Any, u: Any) -> list[Any]:
    """A block whose drag has a branch; it is never backwards here."""
    if x.v < -1e3:
        return [x.v, 0.0]
    return [x.v, u.force]


def block(dynamics: Any, **options: Any) -> ocp.ControlProblem:
    """A block from rest to rest over a metre in a second."""
    given = {"running_cost": lambda x, u: 0.5 * u.force**2, **options}
    return ocp.ControlProblem(
        dynamics, ("x", "v"), ("force",), initial=[0, 0], final=[1, 0], duration=1, **given
    )


def descent(wrapped: Callable[[Callable[..., Any]], Any]) -> ocp.ControlProblem:
    """The brachistochrone."""

    def rates(x: Any, u: Any) -> list[Any]:
        return [x.v * np.cos(u.angle), x.v * np.sin(u.angle), 9.81 * np.sin(u.angle)]

    return ocp.ControlProblem(
        wrapped(rates),
        states=("across", "down", "v"),
        controls=("angle",),
        initial=[0, 0, 0],
        final=[10, 5, None],
        duration=(0.05, 20),
        end_cost=lambda x, t: t,
    )


def descent_by(x: Any, u: Any) -> Any:
    """The Jacobian of the brachistochrone's rates, by x and u."""
    s, c = np.sin(u.angle), np.cos(u.angle)
    return [[0, 0, c, -x.v * s], [0, 0, s, x.v * c], [0, 0, 0, 9.81 * c]]


class TestSolutions:
    """With and without derivatives, the costs are those of traced functions."""

    def test_a_function_with_a_branch_is_solved(self) -> None:
        with pytest.raises(TraceError, match="ExternalFunction"):
            block(branching)
        found = block(ocp.ExternalFunction(branching)).solve()
        assert found.success and found.confirmed, found.message
        assert found.cost == pytest.approx(EFFORT, rel=1e-9)
        # λ_v = −u = 12 t − 6
        assert np.abs(found.costates[:, 1] - (12 * found.t - 6)).max() < 1e-6
        assert "Some derivatives are differences" in found.message

    @pytest.mark.parametrize("jacobian", [None, descent_by])
    def test_the_brachistochrone_has_the_cost_of_the_cycloid(self, jacobian: Any) -> None:
        problem = descent(lambda rates: ocp.ExternalFunction(rates, jacobian=jacobian))
        found = problem.solve()
        assert found.success, found.message
        assert found.cost == pytest.approx(1.80129548301372, abs=1e-8)

    def test_many_points_at_once_are_the_same(self) -> None:
        calls = [0, 0]

        def counted(number: int) -> Callable[..., Any]:
            def rates(x: Any, u: Any) -> list[Any]:
                calls[number] += 1
                return [x.v * np.cos(u.angle), x.v * np.sin(u.angle), 9.81 * np.sin(u.angle)]

            return rates

        one = descent(lambda _: ocp.ExternalFunction(counted(0))).solve(tol=1e-4)
        many = descent(lambda _: ocp.ExternalFunction(counted(1), vectorized=True)).solve(tol=1e-4)
        assert many.cost == pytest.approx(one.cost, rel=1e-12) and calls[1] < 0.2 * calls[0]

    def test_every_function_of_a_problem_may_be_one(self) -> None:
        external = ocp.ExternalFunction
        problem = block(
            external(branching),
            running_cost=external(lambda x, u: 0.5 * u.force**2 if True else 0.0),
            end_cost=external(lambda x: float(x.x)),
            path=[(external(lambda x: max(float(x.v), 0.0)), None, 1.4)],
            ends=[(external(lambda first, last: [last.x - first.x, last.v], 2), [1, 0], [1, 0])],
            integrals=[(external(lambda x: x.v), 0.9, 1.1)],
        )
        traced = block(lambda x, u: [x.v, u.force], end_cost=lambda x: x.x, path=[(lambda x: x.v, None, 1.4)])
        found, expected = problem.solve(tol=1e-4), traced.solve(tol=1e-4)
        assert found.success, found.message
        assert found.cost == pytest.approx(expected.cost, rel=1e-4)

    def test_a_table_within_a_traced_function_takes_differences_by_its_own_argument(self) -> None:
        place = np.linspace(-1, 11, 49)
        height = CubicSpline(place, 0.2 * np.exp(-((place - 5) ** 2) / 8))
        seen = set()

        def slope(s: Any) -> Any:
            seen.add(np.shape(s))
            return height(s, 1)

        def problem(slope: Any) -> ocp.ControlProblem:
            return ocp.ControlProblem(
                lambda x, u: [x.v, u.force - 9.81 * slope(x.s)],
                states=("s", "v"),
                controls=("force",),
                initial=[0, 0],
                final=[10, 0],
                duration=10,
                running_cost=lambda x, u: 0.5 * u.force**2,
            )

        by_values = problem(ocp.ExternalFunction(slope, vectorized=True)).solve()
        exact = problem(
            ocp.ExternalFunction(
                height.derivative(), jacobian=height.derivative(2), hessian=lambda w, s: w * height(s, 3)
            )
        ).solve()
        assert by_values.success and exact.success, (by_values.message, exact.message)
        assert by_values.cost == pytest.approx(exact.cost, rel=1e-9)
        assert "differences" in by_values.message and "differences" not in exact.message
        assert {len(shape) for shape in seen} == {1}

    def test_calls_of_what_calls_return_are_differentiated_by_the_chain_rule(self) -> None:
        square = ocp.ExternalFunction(lambda a: float(a) ** 2, name="square")
        product = ocp.ExternalFunction(lambda pair, b: [pair[0] * b, pair[1] + b], 2, name="product")
        chained = block(lambda x, u: [x.v, product(np.stack([square(u.force), x.v]), 1.0 / u.force)[0]])
        found = chained.solve({"force": 1.0}, tol=1e-4, max_meshes=1, max_iterations=3)
        assert np.isfinite(found.cost)
        exact = block(
            lambda x, u: [x.v + square(x.v) * 0, product(np.stack([u.force, square(x.x)]), 1.0)[0]]
        ).solve()
        assert exact.success and exact.cost == pytest.approx(EFFORT, rel=1e-7), exact.message

    def test_a_table_of_two_arguments_gives_an_array(self) -> None:
        grid = np.linspace(-3, 3, 13)
        table = RegularGridInterpolator((grid, grid), np.add.outer(grid, 2 * grid), method="linear")
        drag = ocp.ExternalFunction(lambda x: table(x)[0], name="drag")
        problem = block(lambda x, u: [x.v, u.force + 0.0 * drag(np.stack([x.x, x.v]))])
        found = problem.solve()
        assert found.success and found.cost == pytest.approx(EFFORT, rel=1e-6), found.message

    def test_values_of_a_known_error_are_solved_to_what_that_allows(self) -> None:
        noise = np.random.default_rng(1)

        def rates(x: Any, u: Any) -> Any:
            return np.array([x.v, u.force]) * (1 + 1e-9 * noise.uniform(-1, 1, 2))

        problem = block(ocp.ExternalFunction(rates, relative_error=1e-9))
        with pytest.raises(InputError, match="`tol` must be at least the relative error of the functions"):
            problem.solve(tol=1e-10)
        found = problem.solve(tol=1e-4)
        assert found.success and found.cost == pytest.approx(EFFORT, rel=1e-4), found.message

    def test_a_tree_takes_terms_that_are_not_traced(self) -> None:
        def pose(cost: Any) -> ocp.ControlProblem:
            return ocp.ControlProblem(
                multibody.cart_pendulum(),
                actuated=["cart"],
                initial=[0] * 4,
                final=[1, 0, 0, 0],
                duration=2,
                running_cost=cost,
                integrals=[(ocp.ExternalFunction(lambda x: x[0]), None, 10)],
            )

        traced = pose(lambda x, u: 0.5 * u.u_cart**2).solve()
        found = pose(ocp.ExternalFunction(lambda x, u: 0.5 * u.u_cart**2)).solve()
        assert found.success and found.cost == pytest.approx(traced.cost, rel=1e-8)


class TestWrongDerivatives:
    """They are found before the solve, and named."""

    def test_output_and_argument_are_named(self) -> None:
        def jacobian(x: Any, u: Any) -> Any:
            right = descent_by(x, u)
            right[1][3] *= 1.01
            return right

        problem = descent(lambda rates: ocp.ExternalFunction(rates, jacobian=jacobian))
        with pytest.raises(InputError) as raised:
            problem.solve()
        message = str(raised.value)
        assert "the jacobian of `rates` must be its derivative" in message
        assert "∂(rate of down)/∂(angle)" in message and "differences give" in message

    def test_a_wrong_hessian_is_named(self) -> None:
        cost = ocp.ExternalFunction(
            lambda x, u: 0.5 * u.force**2,
            jacobian=lambda x, u: [0, 0, u.force],
            hessian=lambda w, x, u: w * np.diag([0, 0, 2.0]),
            name="effort",
        )
        problem = block(lambda x, u: [x.v, u.force], running_cost=cost)
        with pytest.raises(
            InputError, match=r"hessian of `effort`.*∂\(force\)∂\(force\).* is 2, and diff.* give 1 "
        ):
            problem.solve()

    def test_a_wrong_table_within_a_traced_function_is_named(self) -> None:
        drag = ocp.ExternalFunction(lambda v: 0.1 * v**2, jacobian=lambda v: 0.1 * v, name="drag")
        problem = block(lambda x, u: [x.v, u.force - drag(x.v)])
        for solve in (problem.solve, lambda: problem.search(2), lambda: ocp.solve_batch([problem])):
            try:
                failures = cast("Any", solve()).failures
            except InputError as error:
                failures = [(0, str(error))]
            assert "the jacobian of `drag`" in failures[0][1] and "∂(drag)/∂(v)" in failures[0][1]

    def test_kinks_and_right_derivatives_are_not(self) -> None:
        drag = ocp.ExternalFunction(lambda v: abs(v), jacobian=lambda v: np.sign(v))
        found = block(lambda x, u: [x.v, u.force - 0.1 * drag(x.v)]).solve(tol=1e-4)
        assert found.success, found.message


def lifted(factor: float) -> ocp.MotionProblem:
    """A cart that lifts its pendulum; the derivative of how far it gets is multiplied."""

    def gap(node: Any) -> list[float]:
        return [node.position[1] - (np.pi - 0.3)]

    term = ocp.function(gap, 1, gradient=lambda node: {"position": [[0.0, factor]]})
    conditions: Any = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
    return ocp.MotionProblem(
        multibody.cart_pendulum(),
        [0.0, np.pi],
        [0.0, 0.0],
        [ocp.Phase(ocp.SplineMotion(1, 10, conditions), 1.0, 50)],
        active=["cart"],
        costs=[ocp.Cost(ocp.entries("torque", [0])), ocp.Cost(term, 1e4, at="finish")],
    )


def test_a_wrong_gradient_of_a_term_is_named_where_a_solve_does_not_converge() -> None:
    right = lifted(1.0)
    start = np.full(right.n_variables, 0.1)
    assert right.solve(start).success
    for factor in (-1.0, 0.2):
        problem = lifted(factor)
        reports = [problem.solve(start), problem.search(2, z=start, reach=0.2).best]
        for report in reports:
            assert not report.success and "A likely reason: the gradient of `" in report.message
            assert f"gap` must be its derivative: ∂(row 0)/∂(position[1]) is {factor:g}," in report.message
            assert "and differences give 1 at t = 1" in report.message
            assert pickle.loads(pickle.dumps(report)).message == report.message


def test_minimize_names_wrong_derivatives_whatever_ends_it() -> None:
    from somersault import nlp

    found = nlp.minimize(
        lambda x: (x[0] - 1) ** 2 + (x[1] - 2) ** 4,
        [5.0, 5.0],
        jac=lambda x: np.array([2 * (x[0] - 1), 4.2 * (x[1] - 2) ** 3]),
        options={"maxiter": 2},
    )
    assert found.status == "iteration_limit" and "the derivative of fun has" in found.message


class TestFailures:
    """Exceptions and what is not a number."""

    def test_an_exception_comes_out_as_it_was_raised_with_what_was_found(self) -> None:
        class Broken(Exception):
            pass

        calls = 0

        def rates(x: Any, u: Any) -> list[Any]:
            nonlocal calls
            calls += 1
            if calls > 700:
                raise Broken("no more")
            return [x.v * np.cos(u.angle), x.v * np.sin(u.angle), 9.81 * np.sin(u.angle)]

        problem = descent(lambda _: ocp.ExternalFunction(rates))
        with pytest.raises(Broken, match="no more") as raised:
            problem.solve()
        solution = cast("Any", raised.value).solution
        assert isinstance(solution, ocp.CollocationResult) and solution.status == "failed"
        assert np.isfinite(solution.x).all() and np.isfinite(solution.u).all()
        if sys.version_info >= (3, 11):
            assert "in the ExternalFunction rates at" in raised.value.__notes__[0]
        calls = 0
        with pytest.raises(Broken) as raised:
            problem.search(2)
        assert isinstance(cast("Any", raised.value).solution, ocp.SearchResult)

    def test_an_exception_at_the_first_call_has_the_guess(self) -> None:
        def rates(x: Any, u: Any) -> list[Any]:
            raise KeyError("x")

        with pytest.raises(KeyError) as raised:
            block(ocp.ExternalFunction(rates)).solve()
        assert cast("Any", raised.value).solution.x[-1, 0] == 1.0

    def test_what_is_not_a_number_is_a_step_rejected(self) -> None:
        def rates(x: Any, u: Any) -> list[Any]:
            return [x.v, u.force if abs(u.force) < 50 else np.nan]

        found = block(ocp.ExternalFunction(rates)).solve({"force": 40.0})
        assert found.success and found.cost == pytest.approx(EFFORT, rel=1e-8)

    def test_a_start_without_a_value_names_the_function(self) -> None:
        hill = ocp.ExternalFunction(lambda s: np.nan, name="hill")
        with pytest.raises(EvaluationError, match="`hill`, which is not traced, has no finite value"):
            ocp.ControlProblem(lambda x, u: [u.u + hill(x.s)], ("s",), ("u",), final=[1]).solve()

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            (lambda x, u: [x.v], r"`f` must have shape \(2,\), found \(1,\)"),
            (lambda x, u: "no", "`f` must be real numbers, found str"),
        ],
    )
    def test_what_it_returns_is_checked(self, given: Any, message: str) -> None:
        with pytest.raises(InputError, match=message):
            block(ocp.ExternalFunction(given)).solve()

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"f": 3}, "`f` must be a function, found int"),
            ({"shape": -1}, "`shape` must be of positive lengths"),
            ({"shape": 1_000_000}, "`shape` must be of at most 10000 numbers"),
            ({"shape": "x"}, "`shape` must be a length"),
            ({"jacobian": 1}, "`jacobian` must be a function, found int"),
            ({"hessian": abs}, "`jacobian` must be given where `hessian` is"),
            ({"relative_error": 0.5}, "`relative_error` must be from"),
            ({"relative_error": "x"}, "`relative_error` must be a number"),
        ],
    )
    def test_arguments_are_checked(self, arguments: dict[str, Any], message: str) -> None:
        with pytest.raises(InputError, match=message):
            ocp.ExternalFunction(**{"f": abs, **arguments})

    def test_other_traced_functions_refuse_it(self) -> None:
        from somersault import expr

        external = ocp.ExternalFunction(abs)
        assert external(-2.0) == 2.0
        with pytest.raises(
            TraceError, match=r"ExternalFunction, which functions of an ocp\.ControlProblem call"
        ):
            expr.Function(lambda x: external(x), x=())


def rates_of_block(x: Any, u: Any) -> list[Any]:
    """Picklable."""
    return [x.v, u.force]


def effort_of_block(x: Any, u: Any) -> Any:
    """Picklable."""
    return 0.5 * u.force**2


class TestOtherCalls:
    """All that takes a problem works, or refuses by name."""

    problem = block(ocp.ExternalFunction(rates_of_block, name="engine"), running_cost=effort_of_block)

    def test_polish_says_why_not(self) -> None:
        found = self.problem.solve()
        with pytest.raises(
            InputError, match="must be traced for `polish`, found the ExternalFunction `engine`"
        ):
            self.problem.polish(found)

    def test_sensitivity_and_predict(self) -> None:
        found = self.problem.solve()
        by = self.problem.sensitivity(found)
        slopes = dict(zip(by.names, by.cost.tolist(), strict=True))
        assert slopes["duration"] == pytest.approx(-18.0, rel=1e-5)
        predicted = by.predict({"duration": 0.01})
        longer = self.problem.replace(duration=1.01).solve(found)
        assert np.abs(predicted["x"] - longer.x).max() < 1e-3

    def test_search_batch_and_phases(self) -> None:
        searched = self.problem.search(2)
        assert searched.success and searched.best.cost == pytest.approx(EFFORT, rel=1e-8)
        both = ocp.solve_batch([self.problem, self.problem.replace(duration=2)])
        assert [each.cost for each in both if each] == pytest.approx([EFFORT, EFFORT / 8], rel=1e-8)
        back = ocp.ControlProblem(
            rates_of_block, ("x", "v"), ("force",), final=[0, 0], running_cost=effort_of_block
        )
        assert ocp.MultiphaseProblem([self.problem, back]).solve().success

    def test_pickles(self) -> None:
        again = pickle.loads(pickle.dumps(self.problem))
        found = again.solve()
        assert found.cost == pytest.approx(EFFORT, rel=1e-8)
        assert pickle.loads(pickle.dumps(found)).message == found.message


SLOW = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)
import time
from somersault import ocp
def rates(x, u):
    time.sleep({sleep})
    return [x.v, u.force]
problem = ocp.ControlProblem(
    ocp.ExternalFunction(rates), ("x", "v"), ("force",), initial=[0, 0], final=[1, 0], duration=(1, 5),
    running_cost=lambda x, u: u.force**2, end_cost=lambda x, t: t)
print("ready", flush=True)
try:
    found = problem.{call}
    print("returned", time.monotonic(), getattr(found, "status", ""), sep="|")
except KeyboardInterrupt as error:
    print("raised", time.monotonic(), hasattr(error, "solution"), sep="|")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
@pytest.mark.parametrize("call", ["solve()", "search(2)", "solve(on_interrupt='return')"])
def test_ctrl_c_ends_a_slow_function_within_half_a_second(call: str) -> None:
    import signal

    script = SLOW.format(sleep=0.01, call=call)
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    with process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        fields = process.communicate(timeout=60)[0].strip().split("|")
    assert float(fields[1]) - sent < 0.5
    assert fields[0] == ("returned" if "return" in call else "raised")
    assert fields[2] == ("interrupted" if "return" in call else "True")
