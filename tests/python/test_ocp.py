"""Splines, eigenpostures, terms, motion problems and their solution."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline

from somersault import errors, multibody, ocp

Array = NDArray[np.float64]

AT_REST = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]


def conditions() -> list[tuple[str, int, float]]:
    return list(AT_REST)


def problem(costs: list[ocp.Cost] | None = None, **options: object) -> ocp.MotionProblem:
    """The cart swings the hanging pendulum by 0.3 rad."""
    motion = ocp.SplineMotion(1, 10, AT_REST)  # type: ignore[arg-type]
    wanted = [
        ocp.Cost(ocp.entries("torque", [0])),
        ocp.Cost(ocp.displacement([0.0, np.pi - 0.3], [1]), 1e4, at="finish"),
    ]
    return ocp.MotionProblem(
        multibody.cart_pendulum(),
        [0.0, np.pi],
        [0.0, 0.0],
        [ocp.Phase(motion, 1.0, 40)],
        active=["cart"],
        costs=wanted if costs is None else costs,
        **options,  # type: ignore[arg-type]
    )


def differences(f: Callable[[Array], ArrayLike], z: Array, h: float = 1e-5) -> Array:
    """Central differences, a column for each number in z."""
    steps = h * np.eye(len(z))
    columns = [(np.asarray(f(z + step)) - np.asarray(f(z - step))) / (2.0 * h) for step in steps]
    return np.stack(columns, axis=-1)


class TestSplineMotion:
    """Uniform B-splines with conditions at their ends."""

    @pytest.mark.parametrize("degree", [2, 3, 5])
    @pytest.mark.parametrize("derivative", [0, 1, 2])
    def test_is_the_spline_of_scipy(self, degree: int, derivative: int) -> None:
        n = degree + 4
        motion = ocp.SplineMotion(2, n, degree=degree)
        p = np.random.default_rng(3).normal(size=motion.n_parameters)
        c = motion.coefficients(p)
        knots = np.arange(-degree, n + 1) / (n - degree)
        fraction = np.linspace(0.0, 0.999, 23)
        for row, channel in zip(c, motion(p, fraction, derivative).T, strict=True):
            expected = (
                BSpline(knots, row, degree).derivative(derivative)(fraction)
                if derivative
                else BSpline(knots, row, degree)(fraction)
            )
            np.testing.assert_allclose(channel, expected, atol=1e-11 * 10.0**derivative)

    def test_conditions_hold_for_all_parameters(self) -> None:
        motion = ocp.SplineMotion(1, 10, [("start", 0, -1.0), ("start", 1, 0.5), ("finish", 2, 2.0)])
        assert motion.n_parameters == 7
        p = np.random.default_rng(4).normal(size=7)
        assert motion(p, 0.0) == pytest.approx([-1.0], abs=1e-13)
        assert motion(p, 0.0, 1) == pytest.approx([0.5], abs=1e-12)
        assert motion(p, 1.0, 2) == pytest.approx([2.0], abs=1e-11)

    def test_a_fit_gives_back_what_was_sampled(self) -> None:
        motion = ocp.SplineMotion(2, 9, conditions())  # type: ignore[arg-type]
        p = np.random.default_rng(5).normal(size=motion.n_parameters)
        fraction = np.linspace(0.0, 1.0, 40)
        np.testing.assert_allclose(motion.fit(fraction, motion(p, fraction)), p, atol=1e-9)

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ((1, 5), "coefficients"),
            ((0, 10), "`base`"),
            ((1, 10, [("middle", 0, 0.0)]), "'start' or 'finish'"),
            ((1, 10, [("start", 0, np.nan)]), "finite"),
            ((1, 10, [("start", 0, 0.0), ("start", 0, 1.0)]), "condition"),
        ],
    )
    def test_refuses(self, arguments: tuple[object, ...], message: str) -> None:
        with pytest.raises(errors.InputError, match=message):
            ocp.SplineMotion(*arguments)  # type: ignore[arg-type]

    def test_wrong_shapes_name_the_argument(self) -> None:
        motion = ocp.SplineMotion(1, 10)
        with pytest.raises(ValueError, match="`parameters`"):
            motion(np.zeros(9), 0.5)
        with pytest.raises(ValueError, match="`samples`"):
            motion.fit(np.linspace(0.0, 1.0, 20), np.zeros((19, 1)))


class TestEigenpostureBase:
    """Postures, and the directions between them."""

    POSTURES = np.array([[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [0.1, 1.2, 2.3]])

    def test_unit_weights_are_the_postures(self) -> None:
        base = ocp.EigenpostureBase(self.POSTURES)
        assert (base.n_joints, base.n_weights) == (3, 2)
        for weights, posture in zip(([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]), self.POSTURES, strict=True):
            np.testing.assert_allclose(base.positions(weights), posture, atol=1e-15)

    def test_projection_is_least_squares(self) -> None:
        base = ocp.EigenpostureBase(self.POSTURES)
        q = np.array([0.7, -0.2, 1.9])
        directions = (self.POSTURES[1:] - self.POSTURES[0]).T
        expected, (squares,), *_ = np.linalg.lstsq(directions, q - self.POSTURES[0], rcond=None)
        weights, distance = base.project(q)
        np.testing.assert_allclose(weights, expected, atol=1e-14)
        assert distance == pytest.approx(np.sqrt(squares))

    def test_postures_of_the_diver_span_what_they_are_many_of(self) -> None:
        diver = multibody.diver_spatial()
        base = ocp.EigenpostureBase([diver.configuration(p)[7:] for p in "CADEIH"])
        assert (base.n_joints, base.n_weights) == (21, 5)

    @pytest.mark.parametrize(
        "postures",
        [
            [[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]],
            [[0.0, 0.0], [0.0, 0.0]],
            [[0.0, np.nan], [1.0, 2.0]],
            [[0.0, 0.0], [1.0, 2.0, 3.0]],
            [],
        ],
        ids=["dependent", "twice", "nan", "ragged", "none"],
    )
    def test_refuses(self, postures: list[list[float]]) -> None:
        with pytest.raises(errors.InputError):
            ocp.EigenpostureBase(postures)


class TestTerms:
    """What costs and constraints are made of, the library's and those of Python."""

    Z = np.linspace(-0.1, 0.2, 6)

    def test_a_function_is_the_term_it_computes(self) -> None:
        own = problem([ocp.Cost(ocp.function(lambda node: node.torque[0], reads=["torque"]))])
        built_in = problem([ocp.Cost(ocp.entries("torque", [0]))])
        assert own.cost(self.Z) == pytest.approx(built_in.cost(self.Z), rel=1e-14)
        np.testing.assert_allclose(own.gradient(self.Z), built_in.gradient(self.Z), rtol=1e-6, atol=1e-9)

    def test_a_gradient_of_python_is_used(self) -> None:
        calls = []

        def rows(node: SimpleNamespace) -> Array:
            return np.array([node.position[1] ** 2, node.position[0] * node.velocity[1]])

        def gradient(node: SimpleNamespace) -> dict[str, ArrayLike]:
            calls.append(node.time)
            return {
                "position": [[0.0, 2.0 * node.position[1]], [node.velocity[1], 0.0]],
                "velocity": [[0.0, 0.0], [0.0, node.position[0]]],
            }

        given = problem([ocp.Cost(ocp.function(rows, 2, gradient=gradient), [1.0, 3.0])])
        found = given.gradient(self.Z)
        assert len(calls) > 0
        by_differences = problem([ocp.Cost(ocp.function(rows, 2), [1.0, 3.0])])
        np.testing.assert_allclose(by_differences.gradient(self.Z), found, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(differences(given.cost, self.Z), found, rtol=1e-6, atol=1e-8)

    def test_what_a_function_raises_comes_back(self) -> None:
        def fails(node: SimpleNamespace) -> float:
            raise ZeroDivisionError("mine")

        broken = problem([ocp.Cost(ocp.function(fails))])
        with pytest.raises(ZeroDivisionError, match="mine"):
            broken.cost(self.Z)
        with pytest.raises(ZeroDivisionError, match="mine"):
            broken.solve(self.Z)

    def test_nan_of_a_function_ends_in_an_error_or_a_status(self) -> None:
        broken = problem([ocp.Cost(ocp.function(lambda node: np.nan))])
        with pytest.raises(errors.EvaluationError):
            broken.cost(self.Z)
        try:
            report = broken.solve(self.Z)
        except errors.EvaluationError:
            return
        assert report.status == "undefined"

    def test_wrong_rows_and_gradients_are_named(self) -> None:
        with pytest.raises(ValueError, match=r"f\(node\)"):
            problem([ocp.Cost(ocp.function(lambda node: [1.0, 2.0], 3))]).cost(self.Z)
        broken = ocp.function(lambda node: 1.0, gradient=lambda node: {"colour": [[1.0]]})
        with pytest.raises(ValueError, match="colour"):
            problem([ocp.Cost(broken)]).gradient(self.Z)

    def test_points_axes_and_momentum_are_those_of_the_model(self) -> None:
        model = multibody.cart_pendulum()
        terms = {
            "point": (ocp.point_position("pendulum", (0.0, 0.0, 1.0)), 3),
            "axis": (ocp.axis_direction("pendulum", (0.0, 0.0, 1.0)), 3),
            "center": (ocp.momentum("center_of_mass"), 3),
            "linear": (ocp.momentum("linear"), 3),
        }
        for name, (term, n) in terms.items():
            bounded = problem(constraints=[ocp.Constraint(term, -np.inf, np.inf, at="finish")])
            q, v = bounded.motion(self.Z).q[-1], bounded.motion(self.Z).v[-1]
            pose = model.poses(q)[1]
            expected = {
                "point": pose[:3, 2] + pose[:3, 3],
                "axis": pose[:3, 2],
                "center": model.center_of_mass(q),
                "linear": (model.centroidal_matrix(q) @ v)[:3],
            }[name]
            found = bounded.constraints(self.Z)
            assert found.shape == (n,)
            np.testing.assert_allclose(found, expected, atol=1e-12, err_msg=name)

    @pytest.mark.parametrize(
        "make",
        [
            lambda: ocp.entries("colour"),  # type: ignore[arg-type]
            lambda: ocp.momentum("colour"),  # type: ignore[arg-type]
            lambda: ocp.function(lambda node: 1.0, reads=["colour"]),  # type: ignore[list-item]
            lambda: ocp.axis_direction("cart", (0.0, np.nan, 1.0)),
            lambda: ocp.Cost(ocp.entries("time"), at="somewhere"),  # type: ignore[arg-type]
            lambda: ocp.Cost(ocp.entries("time"), at="node"),
            lambda: ocp.Cost(ocp.entries("time"), target=1.0, linear=True),
        ],
    )
    def test_refuses(self, make: Callable[[], object]) -> None:
        with pytest.raises(ValueError, match="`"):
            make()


class TestMotionProblem:
    """A whole problem: derivatives, solution, and what interrupts it."""

    def test_gradient_and_jacobian_are_differences(self) -> None:
        constrained = problem(
            constraints=[
                ocp.Constraint(ocp.displacement([0.0, 0.0]), -5.0, 5.0, at="node", node=20),
                ocp.Constraint(ocp.entries("velocity"), 0.0, 0.0, at="finish"),
            ]
        )
        z = np.random.default_rng(6).normal(scale=0.2, size=constrained.n_variables)
        np.testing.assert_allclose(
            constrained.gradient(z), differences(constrained.cost, z), rtol=1e-6, atol=1e-4
        )
        np.testing.assert_allclose(
            constrained.jacobian(z), differences(constrained.constraints, z), rtol=1e-6, atol=1e-7
        )
        assert len(constrained.constraint_names) == 4

    @pytest.mark.parametrize("solver", ["sqp", "sqp_filter", "sqp_bfgs", "lbfgs"])
    def test_solves(self, solver: str) -> None:
        posed = problem()
        report = posed.solve(np.full(posed.n_variables, 0.1), solver=solver, tol=1e-6)  # type: ignore[arg-type]
        assert report.success, report
        assert np.abs(posed.gradient(report.z)).max() < 1e-3
        motion = posed.motion(report.z)
        assert motion.q[-1, 1] == pytest.approx(np.pi - 0.3, abs=0.01)
        assert motion.q.shape == (41, 2) and motion.channels.shape == (41, 1) and len(motion) == 41

    def test_solvers_agree(self) -> None:
        posed = problem()
        start = np.full(posed.n_variables, 0.1)
        costs = [posed.solve(start, solver=name).cost for name in ("sqp", "sqp_bfgs")]
        assert costs[0] == pytest.approx(costs[1], rel=1e-6)

    def test_an_exact_hessian_leads_to_the_same_minimum(self) -> None:
        costs = [
            posed.solve(np.zeros(posed.n_variables), solver="sqp_filter").cost
            for posed in (problem(), problem(exact_hessian=True))
        ]
        assert costs[1] == pytest.approx(costs[0], rel=1e-8)

    def test_a_free_horizon_has_no_exact_hessian(self) -> None:
        motion = ocp.SplineMotion(1, 10, AT_REST)  # type: ignore[arg-type]
        with pytest.raises(errors.InputError, match="no second derivatives"):
            ocp.MotionProblem(
                multibody.cart_pendulum(),
                [0.0, np.pi],
                [0.0, 0.0],
                [ocp.Phase(motion, (0.5, 1.5), 40)],
                active=["cart"],
                exact_hessian=True,
            )

    def test_constraints_hold(self) -> None:
        hard = problem(
            [ocp.Cost(ocp.entries("torque", [0]))],
            constraints=[ocp.Constraint(ocp.displacement([0.0, np.pi - 0.3], [1]), 0.0, 0.0, at="finish")],
        )
        report = hard.solve(np.full(hard.n_variables, 0.1))
        assert report.success, report
        assert hard.motion(report.z).q[-1, 1] == pytest.approx(np.pi - 0.3, abs=1e-7)
        assert report.feasibility < 1e-7 and report.stationarity < 1e-7

    def test_a_warm_start_takes_fewer_steps(self) -> None:
        posed = problem()
        cold = posed.solve(np.full(posed.n_variables, 0.1))
        warm = posed.solve(cold)
        assert warm.nit < cold.nit
        assert warm.cost == pytest.approx(cold.cost, rel=1e-9)

    def test_a_callback_sees_each_step_and_stops(self) -> None:
        posed = problem()
        seen = []

        def callback(iteration: int, z: Array, cost: float, residual: float) -> bool:
            seen.append((iteration, cost))
            assert z.shape == (posed.n_variables,) and residual >= 0.0
            return iteration == 2

        report = posed.solve(np.full(posed.n_variables, 0.1), callback=callback)
        assert report.status == "stopped" and not report.success
        assert [iteration for iteration, _ in seen] == [0, 1, 2]
        assert report.cost == pytest.approx(min(cost for _, cost in seen))

    def test_a_callback_cannot_evaluate_the_problem_that_calls_it(self) -> None:
        posed = problem()
        start = np.full(posed.n_variables, 0.1)
        with pytest.raises(errors.InputError, match="callback"):
            posed.solve(start, callback=lambda iteration, z, cost, residual: posed.cost(z) < 0.0)
        # and is free again afterwards
        assert np.isfinite(posed.cost(start))

    def test_an_error_in_a_callback_keeps_the_report(self) -> None:
        def callback(*_: object) -> bool:
            raise KeyError("mine")

        posed = problem()
        with pytest.raises(KeyError, match="mine") as caught:
            posed.solve(np.full(posed.n_variables, 0.1), callback=callback)
        assert caught.value.solution.z.shape == (posed.n_variables,)  # type: ignore[attr-defined]

    def test_limits_end_in_a_status(self) -> None:
        posed = problem()
        start = np.full(posed.n_variables, 0.1)
        assert posed.solve(start, max_iterations=1).status == "iteration_limit"
        assert posed.solve(start, solver="sqp_bfgs", max_time=1e-6).status == "time_limit"

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"lower": 1.0, "upper": -1.0}, "`lower` and `upper` has bounds 1 to -1"),
            ({"drive": "wind"}, "drive"),
            ({"scheme": "magic"}, "scheme"),
            ({"lower": [0.0, 0.0]}, "lower"),
            ({"constraints": [ocp.Constraint(ocp.point_position("wing"), 0.0, 1.0)]}, "wing"),
            ({"constraints": [ocp.Constraint(ocp.entries("velocity", [7]), 0.0, 1.0)]}, "7"),
        ],
    )
    def test_refuses(self, options: dict[str, object], message: str) -> None:
        with pytest.raises(ValueError, match=message) as caught:
            problem(**options)  # type: ignore[arg-type]
        assert isinstance(caught.value, errors.InputError)

    def test_refuses_bad_numbers(self) -> None:
        with pytest.raises(errors.InputError, match="`lower` of a constraint must be numbers or infinite"):
            ocp.Constraint(ocp.entries("velocity"), np.nan, -1.0)
        posed = problem()
        with pytest.raises(errors.InputError, match="`z`"):
            posed.cost(np.full(posed.n_variables, np.nan))
        with pytest.raises(errors.InputError, match="`z`"):
            posed.solve(np.zeros(3))
        with pytest.raises(errors.InputError, match="solver"):
            posed.solve(np.zeros(posed.n_variables), solver="oracle")  # type: ignore[arg-type]
        with pytest.raises(errors.InputError, match="max_time"):
            posed.solve(np.zeros(posed.n_variables), max_time=-1.0)


@pytest.mark.skipif(sys.platform == "win32", reason="there are no timers there")
def test_a_verification_is_interrupted_and_the_report_stays() -> None:
    posed = ocp.MotionProblem(
        multibody.cart_pendulum(),
        [0.0, np.pi],
        [0.0, 0.0],
        [ocp.Phase(ocp.SplineMotion(1, 30), 6.0, 20_000)],
        active=["cart"],
        costs=[ocp.Cost(ocp.entries("torque", [0]))],
    )
    report = posed.solve(np.full(posed.n_variables, 0.1), max_iterations=0)
    before = signal.signal(signal.SIGALRM, lambda *_: signal.default_int_handler(signal.SIGINT, None))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        began = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            print(report.message)
        interrupted = time.monotonic() - began
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    began = time.monotonic()
    # what was solved is there, and the next look at it integrates to the end
    assert np.isfinite(report.cost) and report.confirmed
    assert interrupted < 0.1 + 0.5 * (time.monotonic() - began)


SCRIPT = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in background shells
import time
import numpy as np
from somersault import multibody, ocp
motion = ocp.SplineMotion(1, 30)
posed = ocp.MotionProblem(
    multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [ocp.Phase(motion, 6.0, 20_000)], active=["cart"],
    costs=[ocp.Cost(ocp.entries("torque", [0])),
           ocp.Cost(ocp.displacement([0.0, 0.0], [1]), 1e4, at="finish")])
print("ready", flush=True)
try:
    report = posed.solve(
        np.zeros(30) + 0.1, solver="gradient_descent", tol=1e-15, max_iterations=10**9, on_interrupt={on!r})
    print("returned", time.monotonic(), report.status, np.isfinite(report.cost), sep="|")
except KeyboardInterrupt as error:
    print("raised", time.monotonic(), error.solution.status, np.isfinite(error.solution.cost), sep="|")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
@pytest.mark.parametrize(("on", "ending"), [("return", "returned"), ("raise", "raised")])
def test_ctrl_c_gives_the_best_iterate(on: str, ending: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT.format(on=on)], stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        fields = process.communicate(timeout=60)[0].strip().split("|")
    assert fields[0] == ending
    assert float(fields[1]) - sent < 2.0
    assert fields[2:] == ["interrupted", "True"]
