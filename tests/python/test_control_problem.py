"""Optimal control problems posed by functions of NumPy."""

import functools
import inspect
import itertools
import pickle
from typing import Any, cast

import numpy as np
import pytest
import scipy.integrate
from control_problems import KNOWN

import somersault
from somersault import multibody, ocp

#: The set, those that take long in `make studies` only.
ALL = [pytest.param(name, marks=[pytest.mark.study] * known.is_long) for name, known in KNOWN.items()]
#: Those with one minimum and a start from a straight line on any mesh.
PLAIN = [name for name, known in KNOWN.items() if known.is_only and not known.options]


@functools.cache
def solved(name: str) -> tuple[ocp.ControlProblem, ocp.CollocationResult]:
    return KNOWN[name].solve()


@pytest.mark.parametrize("name", ALL)
def test_known_costs_are_met_from_a_straight_line_or_the_stated_guess(name: str) -> None:
    known = KNOWN[name]
    _, found = solved(name)
    assert found.success and found.confirmed, found.message
    tol = known.options.get("tol", 1e-6)
    assert found.cost == pytest.approx(known.cost, rel=tol, abs=tol)
    assert found.verified_cost == pytest.approx(found.cost, rel=10 * tol, abs=10 * tol)


@pytest.mark.study
@pytest.mark.parametrize("name", PLAIN)
def test_no_mesh_and_tolerance_lead_to_a_false_success(name: str) -> None:
    known = KNOWN[name]
    problem = known.pose()
    solved = 0
    for tol in (1e-4, 1e-6, 1e-8):
        for n_intervals, n_points in ((10, 4), (20, 3), (33, 4)):
            found = problem.solve(tol=tol, n_intervals=n_intervals, n_points=n_points, max_time=10.0)
            if found.success:
                assert found.cost == pytest.approx(known.cost, rel=10 * tol, abs=10 * tol)
                solved += 1
    assert solved >= 6


def swung_up(torque: float, duration: tuple[float, float]) -> ocp.ControlProblem:
    """A pendulum of 1 kg and 0.5 m from hanging to upright in least time."""
    return ocp.ControlProblem(
        lambda x, u: [x.spin, 4 * u.torque - 9.81 / 0.5 * np.sin(x.angle)],
        states=("angle", "spin"),
        controls=("torque",),
        initial=[0, 0],
        final=[np.pi, 0],
        duration=duration,
        bounds={"torque": (-torque, torque)},
        running_cost=lambda x: 1.0,
    )


def test_weak_torques_swing_a_pendulum_up_in_least_time() -> None:
    # by SciPy: SLSQP over six, five and four switching times, with DOP853 between them
    for torque, least in ((0.8, 4.93948918), (1.0, 4.03093880), (1.2, 3.34649006)):
        found = swung_up(torque, (0.2, 20)).solve()
        assert found.success and found.cost == pytest.approx(least, rel=1e-6)


def test_a_free_time_that_no_motion_is_found_for_starts_from_least_effort() -> None:
    def rates(x: Any, u: Any) -> list[Any]:
        c, s = np.cos(x.angle), np.sin(x.angle)
        pull, mass = u.force + 0.15 * s * x.spin**2, 1 + 0.3 * s * s
        return [
            x.speed,
            x.spin,
            (pull + 0.3 * 9.81 * c * s) / mass,
            -(c * pull + 1.3 * 9.81 * s) / (0.5 * mass),
        ]

    # Kelly's cart-pole in least time by 10 N
    swung = ocp.ControlProblem(
        rates,
        ("place", "angle", "speed", "spin"),
        ("force",),
        initial=[0, 0, 0, 0],
        final=[0, np.pi, 0, 0],
        duration=(0.2, 6),
        bounds={"force": (-10, 10)},
        running_cost=lambda x: 1.0,
    )
    found = swung.solve()
    starts = [mesh["is_start"] for mesh in found.meshes]
    assert found.success and not starts[0] and any(starts) and not starts[-1]


def test_angles_that_newton_winds_up_are_unwound() -> None:
    # without bounds each point has whole turns of its own at first
    found = KNOWN["brachistochrone"].pose().solve()
    angle = found.u[:, 0]
    assert np.all(np.diff(angle) < 0) and angle[0] == pytest.approx(np.pi / 2) and angle[-1] > -0.2


def test_a_tree_and_its_equations_are_one_problem() -> None:
    # the angle of the tree counts towards −x, here towards x
    tree = multibody.cart_pendulum(1.0, 0.3, 0.5)
    of_tree = ocp.ControlProblem(
        tree,
        actuated=["cart"],
        initial=[0, -np.pi, 0, 0],
        final=[1, 0, 0, 0],
        duration=2.0,
        bounds={"u_cart": (-20, 20)},
        running_cost=lambda x, u: u.u_cart**2,
    ).solve(tol=1e-8)

    def rates(x: Any, u: Any) -> list[Any]:
        m1, m2, length, g = 1.0, 0.3, 0.5, 9.81
        sin, cos = np.sin(x.angle), np.cos(x.angle)
        a = (u.force + m2 * length * sin * x.spin**2 - m2 * g * sin * cos) / (m1 + m2 * sin**2)
        return [x.v, x.spin, a, (g * sin - a * cos) / length]

    posed = ocp.ControlProblem(
        rates,
        states=("x", "angle", "v", "spin"),
        controls=("force",),
        initial=[0, np.pi, 0, 0],
        final=[1, 0, 0, 0],
        duration=2.0,
        bounds={"force": (-20, 20)},
        running_cost=lambda x, u: u.force**2,
    )
    traced = posed.solve(tol=1e-8)
    assert of_tree.success and traced.success
    assert traced.cost == pytest.approx(of_tree.cost, rel=1e-9)


def test_the_time_may_begin_anywhere() -> None:
    def pose(start: float) -> ocp.ControlProblem:
        return ocp.ControlProblem(
            lambda x, u: [x.v, u.force - x.x],
            states=("x", "v"),
            controls=("force",),
            initial={"x": 5, "v": 0},
            final={"x": 0, "v": 0},
            duration=6.5,
            start_time=start,
            running_cost=lambda x, u: u.force**2,
        )

    now, later = pose(0.0).solve(), pose(1e4).solve()
    assert [mesh["nit"] for mesh in now.meshes] == [mesh["nit"] for mesh in later.meshes]
    assert later.t[0] == 1e4 and later.cost == pytest.approx(now.cost, rel=1e-10)
    assert later.x == pytest.approx(now.x, abs=1e-9)


def test_parameters_integrals_ends_and_paths_are_part_of_it() -> None:
    # a body thrown at a speed and an angle of its own, as far as an integral of its height allows
    problem = ocp.ControlProblem(
        lambda x, u, t, p: [p.vx, p.vy - 9.81 * t],
        states=("x", "y"),
        parameters=("vx", "vy"),
        initial={"x": 0, "y": 0},
        duration=(0.1, 5),
        bounds={"vx": (0, 30), "vy": (0, 30)},
        ends=[(lambda x_0, x_f: x_f.y - x_0.y, 0, 0), (lambda x_0, x_f, t_0, t_f, p: p @ p, None, 100)],
        integrals=[(lambda x: x.y, None, 2.0)],
        path=[(lambda x: [x.x, x.y], [-1, -1], 100)],
        end_cost=lambda x: -x.x,
    )
    found = problem.solve()
    assert found.success, found.message
    vx, vy = found.parameters
    flight = 2 * vy / 9.81
    assert vx**2 + vy**2 == pytest.approx(100, rel=1e-7)
    assert found.t[-1] == pytest.approx(flight, rel=1e-6)
    # ∫ y dt of a parabola is vy T²/2 − g T³/6, which is the bound
    assert vy * flight**2 / 2 - 9.81 * flight**3 / 6 == pytest.approx(2.0, rel=1e-6)
    assert -found.cost == pytest.approx(vx * flight, rel=1e-7)
    assert found.state_names == ["x", "y", "integral 0"] and found.parameter_names == ["vx", "vy"]
    assert found.x[-1, 2] == pytest.approx(2.0, rel=1e-7)
    again = pickle.loads(pickle.dumps(found))
    assert again.parameters == pytest.approx(found.parameters) and again.state_names == found.state_names
    assert again.model is None


def _rates(x: Any, u: Any) -> list[Any]:
    return [x.v, u.force]


def _effort(x: Any, u: Any) -> Any:
    return 0.5 * u.force**2


BLOCK = functools.partial(
    ocp.ControlProblem,
    _rates,
    states=("x", "v"),
    controls=("force",),
    initial={"x": 0, "v": 0},
    final=[1, 0],
    running_cost=_effort,
)


def test_a_problem_of_module_functions_is_pickled() -> None:
    problem = pickle.loads(pickle.dumps(BLOCK()))
    assert problem.solve().cost == pytest.approx(6)
    assert (problem.state_names, problem.control_names, problem.parameter_names) == (
        ["x", "v"],
        ["force"],
        [],
    )
    assert repr(problem) == "<ControlProblem: states x, v; controls force>"


@pytest.mark.parametrize(
    "guess",
    [
        {},
        {"x": 0.5},
        {"x": [0, 0.2, 1], "force": [6, 0, -6]},
        {"t": [0, 0.25, 1], "x": [0, 0.2, 1], "v": 1.0},
    ],
)
def test_guesses_are_values_by_name(guess: dict[str, Any]) -> None:
    assert BLOCK().solve(guess).cost == pytest.approx(6)


def test_a_result_is_a_guess() -> None:
    problem = BLOCK()
    first = problem.solve()
    again = problem.solve(first)
    assert again.cost == pytest.approx(6) and again.report.nit <= first.report.nit


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "an unknown name": (
        {"bounds": {"speed": (0, 1)}},
        "`bounds` must have names among x, v, force, found 'speed'",
    ),
    "crossing bounds": ({"bounds": {"v": (1, 0)}}, "`bounds['v']` must have bounds that do not cross"),
    "a start without a number": (
        {"initial": {"x": "left"}},
        "`initial['x']` must be real numbers, found 'left'",
    ),
    "too few at the end": ({"final": [1]}, "`final` must have 2 entries, found 1"),
    "no duration": ({"duration": 0.0}, "`duration` must be positive"),
    "too few rates": ({"dynamics": lambda x, u: [x.v]}, "`dynamics` must give 2 rates, found 1"),
    "no rates": ({"dynamics": lambda x, u: None}, "`dynamics` must return its values, found None"),
    "no function": ({"dynamics": 3}, "`dynamics` must be a function of (x, u, t, p), found an int"),
    "too many arguments": (
        {"running_cost": lambda x, u, t, p, q: 0},
        "`running_cost` must take (x, u, t, p) or fewer of them, found 5 arguments",
    ),
    "two costs": ({"end_cost": lambda x: [x.x, x.v]}, "`end_cost` must return one value, found 2"),
    "a path without bounds": ({"path": [lambda x: x.x]}, "`path[0]` must be (function, lower, upper)"),
    "bounds of another length": (
        {"path": [(lambda x: x.x, [0, 1], None)]},
        "`path[0]` must have 1 lower bounds, found 2",
    ),
    "two integrals in one": (
        {"integrals": [(lambda x: x, 0, 1)]},
        "`integrals[0]` must return one value, found 2",
    ),
    "a name twice": ({"controls": ("x",)}, "found 'x' twice"),
    "the name of time": ({"controls": ("t",)}, "found 't'"),
    "a name with a space": ({"controls": ("my force",)}, "`controls` must be names as those of variables"),
    "scales of some": ({"scales": {"x": 1.0}}, "`scales` must have a size of v, force"),
    "a state that is not there": ({"dynamics": lambda x, u: [x.speed, u.force]}, "'speed'"),
    "a branch": ({"dynamics": lambda x, u: [x.v, u.force if x.x > 0 else 0.0]}, "np.where"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused_by_name(case: str) -> None:
    change, message = REFUSED[case]
    options = {**BLOCK.keywords, "dynamics": _rates, **change}
    with pytest.raises((somersault.errors.InputError, AttributeError)) as caught:
        ocp.ControlProblem(options.pop("dynamics"), **options)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("guess", "message"),
    [
        ({"speed": 1.0}, "`guess` must have names among t, x, v, force, found 'speed'"),
        ({"x": [0, 1], "v": [0, 1, 2]}, "`guess` must have as many values of each, found [2, 3]"),
        ({"x": [0.5]}, "`guess` must have at least 2 values of each, found 1"),
        ({"x": [[0, 1, 2]]}, "`guess['x']` must have shape (n, 2), found (1, 3)"),
        ({"u": []}, "`guess['u']` must have shape (n, 1), found (0,)"),
        ({"v": [[0], [1, 2]]}, "`guess['v']` must be real numbers, found [[0], [1, 2]]"),
        ({"v": [[0, 1]]}, "`guess['v']` must be a number or a list of numbers, found shape (1, 2)"),
        ([0, 1], "`guess` must be values by name or an earlier result, found a list"),
    ],
)
def test_guesses_that_do_not_fit_are_refused(guess: Any, message: str) -> None:
    with pytest.raises(somersault.errors.InputError) as caught:
        BLOCK().solve(guess)
    assert message in str(caught.value)


def massive(mass: float, initial: Any = (0, 0), duration: float = 1.0, **options: Any) -> ocp.ControlProblem:
    """A mass that is moved over a metre from rest to rest with minimum effort, 6 m² (1 − x₀)²/T³."""
    return ocp.ControlProblem(
        lambda x, u, t, p: [x.v, u.force / p.mass],
        states=("x", "v"),
        controls=("force",),
        parameters=("mass",),
        initial=initial,
        final=[1, 0],
        duration=duration,
        bounds={"mass": (mass, mass)},
        running_cost=lambda x, u: 0.5 * u.force**2,
        **options,
    )


def test_sensitivities_of_a_moved_mass_are_its_closed_form() -> None:
    problem = massive(2.0)
    found = problem.solve()
    by = problem.sensitivity(found)
    slopes = dict(zip(by.names, by.cost, strict=True))
    exact = {"initial.x": -48, "initial.v": -24, "final.x": 48, "final.v": -24}
    exact |= {"start_time": 0, "duration": -72, "mass": 24}
    assert set(slopes) == set(exact) and by.n_weakly_active == 0
    for name, value in exact.items():
        assert slopes[name] == pytest.approx(value, abs=1e-6), name
    # x = 3 s² − 2 s³ whatever the mass and the duration, u = m (6 − 12 s)/T²
    k = {name: i for i, name in enumerate(by.names)}
    s = found.t
    np.testing.assert_allclose(by.x[:, 0, k["mass"]], 0.0, atol=1e-7)
    np.testing.assert_allclose(by.x[:, 0, k["initial.x"]], 1 - 3 * s**2 + 2 * s**3, atol=1e-7)
    np.testing.assert_allclose(by.u[:, 0, k["mass"]], 6 - 12 * s[:-1], atol=1e-6)
    np.testing.assert_allclose(by.u[:, 0, k["duration"]], -4 * (6 - 12 * s[:-1]), atol=1e-6)
    np.testing.assert_allclose(by.costates[:, 0, k["mass"]], -48.0, atol=1e-5)
    assert by.horizon[:, k["duration"]].tolist() == [0, 1] and by.horizon[:, k["start_time"]].tolist() == [
        1,
        1,
    ]
    assert by.parameters[0, k["mass"]] == 1.0
    again = pickle.loads(pickle.dumps(by))
    assert again.names == by.names and np.array_equal(again.x, by.x) and repr(again) == repr(by)


def test_predictions_are_motions_to_first_order() -> None:
    problem = massive(2.0)
    found = problem.solve()
    by = problem.sensitivity(found)
    errors = []
    for change in (0.02, 0.01):
        moved = problem.replace(
            initial={"x": change}, duration=1 + change, bounds={"mass": (2 - change, 2 - change)}
        )
        there = moved.solve(found)
        guess = by.predict({"initial.x": change, "duration": change, "mass": -change})
        assert there.success and guess["t"][-1] == pytest.approx(1 + change) and guess["mass"] == 2 - change
        errors.append(np.abs(guess["u"][:-1] - there.u).max())
        from_there = moved.solve(guess)
        assert from_there.success and from_there.cost == pytest.approx(there.cost, rel=1e-9)
    assert errors[1] < 0.3 * errors[0] < 0.1
    with pytest.raises(somersault.errors.InputError, match=r"`changes` must have names among .*, found 'm'"):
        by.predict({"m": 1.0})
    with pytest.raises(somersault.errors.InputError, match="duration above zero"):
        by.predict({"duration": -2.0})


def test_what_has_no_derivative_says_so() -> None:
    problem = massive(2.0)
    found = problem.solve()
    with pytest.raises(somersault.errors.InputError, match="no solution of the program"):
        massive(3.0, initial=(0.5, 0)).sensitivity(found)
    # every control is at a bound, but for the switch
    fast = ocp.ControlProblem(
        lambda x, u: [x.v, u.force],
        ("x", "v"),
        ("force",),
        initial=[0, 0],
        final=[1, 0],
        duration=(0.1, 10),
        bounds={"force": (-1, 1)},
        end_cost=lambda x, t: t,
    )
    with pytest.raises(somersault.errors.SensitivityError, match="no isolated minimum"):
        fast.sensitivity(fast.solve())
    with pytest.raises(TypeError, match="`found` must be a CollocationResult, found an int"):
        problem.sensitivity(cast("Any", 3))


def test_other_numbers_with_the_same_functions_are_the_problem_posed_again() -> None:
    problem = massive(2.0)
    for moved, posed in [
        (problem.replace(initial={"x": 0.5}), massive(2.0, initial=(0.5, 0))),
        (problem.replace(initial=[0.5, 0.1], duration=2), massive(2.0, initial=(0.5, 0.1), duration=2)),
        (problem.replace(bounds={"mass": 3}), massive(3.0)),
        (problem.replace(start_time=5.0), massive(2.0, start_time=5.0)),
    ]:
        np.testing.assert_array_equal(moved.solve().x, posed.solve().x)
    assert problem.solve().cost == pytest.approx(24.0)
    with pytest.raises(somersault.errors.InputError, match="`initial` must have names among x, v, found 'y'"):
        problem.replace(initial={"y": 1})
    with pytest.raises(somersault.errors.InputError, match="`duration` must be positive"):
        problem.replace(duration=-1.0)


def test_a_control_loop_takes_fewer_steps_than_cold_solves() -> None:
    cart = ocp.ControlProblem(
        multibody.cart_pendulum(),
        actuated=["cart"],
        initial=[0, 0, 0, 0],
        final=[0, np.pi, 0, 0],
        duration=2,
        running_cost=lambda x, u: 0.5 * u.u_cart**2,
    )
    found, warm, cold = cart.solve(), 0, 0
    for k in range(1, 6):
        moved = cart.replace(initial=[0.01 * k, 0, 0, 0])
        found = moved.solve(found)
        fresh = moved.solve()
        assert found.success and fresh.success and found.cost == pytest.approx(fresh.cost, rel=1e-7)
        warm += sum(mesh["nit"] for mesh in found.meshes)
        cold += sum(mesh["nit"] for mesh in fresh.meshes)
    assert 2 * warm < cold
    # sizes of a mesh begin a new one
    assert (
        found.meshes[0]["n_points"] != 60 and moved.solve(found, n_intervals=20).meshes[0]["n_points"] == 60
    )


def around(height: float) -> ocp.ControlProblem:
    """From (−2, 0) to (2, 0) in a second around a disk of radius 1 with its middle at (0, height)."""
    return ocp.ControlProblem(
        lambda x, u: [u.right, u.up],
        states=("x", "y"),
        controls=("right", "up"),
        initial=[-2, 0],
        final=[2, 0],
        path=[(lambda x: x.x**2 + (x.y - height) ** 2, 1, None)],
        running_cost=lambda x, u: u.right**2 + u.up**2,
    )


def test_a_search_finds_both_ways_around_a_disk() -> None:
    # two tangents and an arc, below and above; the cost is the square of the length
    d = np.hypot(2, 0.1)
    lengths = [
        2 * np.sqrt(d**2 - 1) + np.pi + side * 2 * np.arctan(0.05) - 2 * np.arccos(1 / d) for side in (-1, 1)
    ]
    found = around(0.1).search(12, tol=1e-5)
    assert found.status == "converged" and found.success and len(found.minima) == 2
    for minimum, length in zip(found.minima, lengths, strict=True):
        assert minimum.success and minimum.cost == pytest.approx(length**2, rel=1e-5)
    assert found.best.cost == found.minima[0].cost
    assert sorted(n for starts in found.starts for n in starts) + [n for n, _ in found.failures] == list(
        range(12)
    )
    # the same for the same seed, from pickles and on one thread
    again = around(0.1).search(12, tol=1e-5)
    assert again.starts == found.starts
    stored = pickle.loads(pickle.dumps(found))
    assert stored.starts == found.starts and np.array_equal(stored.best.x, found.best.x)


@pytest.mark.study
def test_a_search_finds_the_cheapest_swing_of_the_acrobot() -> None:
    # the cheaper of two minima that thirteen starts of CasADi with IPOPT lead to; the other costs 37.368176
    problem = KNOWN["acrobot"].pose()
    found = problem.search(12, tol=1e-4)
    exact = problem.polish(found.best)
    assert exact.verdict == "strict_minimum" and exact.cost == pytest.approx(KNOWN["acrobot"].cost, rel=1e-9)


def test_starts_that_lead_nowhere_are_listed_with_the_reason() -> None:
    impossible = BLOCK(bounds={"force": (-1, 1)}, duration=0.5).search(3)
    assert impossible.status == "no_minimum" and not impossible.success and impossible.minima == []
    assert [n for n, _ in impossible.failures] == [0, 1, 2]
    assert all("infeasible" in reason for _, reason in impossible.failures)
    assert impossible.best.status == "infeasible"
    late = around(0.1).search(200, max_time=1e-3)
    assert late.status == "time_limit" and len(late.failures) > 100
    with pytest.raises(somersault.errors.InputError, match="`n_starts` must be at most 10000, found 20000"):
        BLOCK().search(20_000)


def test_a_batch_is_its_problems_one_by_one() -> None:
    problems = [BLOCK(duration=1 + 0.1 * k) for k in range(20)]
    found = ocp.solve_batch(problems)
    for problem, each in zip(problems, found, strict=True):
        assert each is not None and each.success
        np.testing.assert_array_equal(each.x, problem.solve().x)
    # from earlier results, with values by name, and from nothing
    start: list[Any] = [found[0], {"x": [0, 1]}, None]
    again = ocp.solve_batch(problems[:3], start)
    assert [each.cost for each in again if each] == pytest.approx([each.cost for each in found[:3] if each])
    assert ocp.solve_batch([]) == []
    assert None in ocp.solve_batch(problems, max_time=1e-9)
    with pytest.raises(somersault.errors.InputError, match=r"`guesses` must have 20 entries, found 3"):
        ocp.solve_batch(problems, start)
    with pytest.raises(TypeError, match=r"`problems\[1\]` must be a ControlProblem, found int"):
        ocp.solve_batch([problems[0], cast("Any", 3)])
    with pytest.raises(somersault.errors.InputError, match=r"`guesses\[0\]` must have names among"):
        ocp.solve_batch(problems[:1], [{"speed": 1.0}])


class Entries(np.ndarray[Any, np.dtype[np.float64]]):
    """Numbers by the names of a problem."""

    names: list[str]

    @classmethod
    def of(cls, values: Any, names: list[str]) -> "Entries":
        entries = np.asarray(values, dtype=float).view(cls)
        entries.names = names
        return entries

    def __getattr__(self, name: str) -> Any:
        if name == "names" or name not in self.names:
            raise AttributeError(name)
        return float(self[self.names.index(name)])


def worst_miss(problem: ocp.ControlProblem, exact: ocp.PolishResult) -> float:
    """How far SciPy, with the polished controls, leaves the polished states, and these the ends."""
    posed = problem.__reduce__()[0].keywords
    rates, states = posed["dynamics"], problem.state_names
    n_arguments = len(inspect.signature(rates).parameters)
    worst = 0.0
    for name, t in (("initial", exact.horizon[0]), ("final", exact.horizon[1])):
        given = posed[name] if posed[name] is not None else {}
        given = given if isinstance(given, dict) else dict(zip(states, given, strict=True))
        x = dict(zip(states, exact.state(t), strict=True))
        worst = max([worst, *(abs(x[k] - value) for k, value in given.items() if value is not None)])
    for arc in exact.arcs:
        start, end = arc["start"], arc["end"]
        nodes = np.linspace(start, end, 1 + max(4, round(60 * (end - start) / np.ptp(exact.horizon))))
        # the control of this arc at its very end
        last = end - 1e-13 * (end - start)
        for t0, t1 in itertools.pairwise(nodes):

            def slope(t: float, x: Any, last: float = last) -> Any:
                u = Entries.of(exact.control(min(t, last)), problem.control_names)
                return rates(*(Entries.of(x, states), u, t)[:n_arguments])

            x = scipy.integrate.solve_ivp(
                slope, (t0, t1), exact.state(t0), method="DOP853", rtol=1e-11, atol=1e-12
            ).y[:, -1]
            there = exact.state(min(t1, last))
            worst = max(worst, float((np.abs(x - there) / (1 + np.abs(there))).max()))
    return worst


@pytest.mark.parametrize("name", ALL)
def test_arcs_are_found_polished_and_certified(name: str) -> None:
    known = KNOWN[name]
    problem, found = solved(name)
    exact = problem.polish(found)
    if not known.is_polished:
        assert exact.verdict == "refused" and exact.cost == found.cost == pytest.approx(known.cost, rel=1e-9)
        return
    assert exact.success and exact.residual < 1e-10, exact.message
    assert exact.cost == pytest.approx(known.cost, rel=1e-9, abs=1e-9)
    assert worst_miss(problem, exact) < 1e-8


@pytest.mark.study
@pytest.mark.parametrize("name", PLAIN)
def test_arcs_are_found_on_meshes_of_20_to_160_intervals(name: str) -> None:
    known = KNOWN[name]
    problem = known.pose()
    for n_intervals in (20, 40, 80, 160):
        exact = problem.polish(problem.solve(n_intervals=n_intervals, max_meshes=1, max_time=10.0))
        if exact.success:
            assert exact.residual < 1e-10
            assert exact.cost == pytest.approx(known.cost, rel=1e-9, abs=1e-9)
        else:
            # coarse meshes may have no start
            assert n_intervals < 80 and exact.verdict == "refused" and exact.message


def test_defaults_of_a_function_are_its_own() -> None:
    for gain in (1.0, 2.0):
        moved = BLOCK(running_cost=lambda x, u, gain=gain: 0.5 * gain * u.force**2).solve()
        assert moved.cost == pytest.approx(6.0 * gain)
    timed = BLOCK(running_cost=lambda x, u, t=0.0, p=None: 0.5 * u.force**2 + t).solve()
    assert timed.cost == pytest.approx(6.5)


def repelled(duration: float) -> ocp.ControlProblem:
    """ẋ = u, ½ ∫ u² − x²: past π no extremal is a minimum."""
    return ocp.ControlProblem(
        lambda x, u: [u.u],
        states=("x",),
        controls=("u",),
        initial=[1],
        final=[0.5],
        duration=duration,
        running_cost=lambda x, u: 0.5 * (u.u**2 - x.x**2),
    )


def test_extremals_that_are_no_minima_and_motions_that_chatter_are_refused_with_the_reason() -> None:
    short = repelled(3.0)
    assert short.polish(short.solve()).verdict == "strict_minimum"
    # Fuller's problem: infinitely many switches before the end
    fuller = ocp.ControlProblem(
        lambda x, u: [x.v, u.u],
        ("x", "v"),
        ("u",),
        initial=[1, 0],
        final=[0, 0],
        duration=5,
        bounds={"u": (-1, 1)},
        running_cost=lambda x: x.x**2,
    )
    # of a free duration there is an extremal of few switches, whose switching function is zero at its end
    brief = fuller.replace(duration=(1, 6))
    guess = {"t": [0, 1, 2], "x": [1, 0.5, 0], "v": [0, -1, 0], "u": [-1, 0, 1]}
    edge = brief.polish(brief.solve(guess, tol=1e-3, max_meshes=3))
    assert edge.verdict == "first_order" and "switching function" in edge.message and edge.cost > 0.76401974
    chattering = fuller.polish(fuller.solve(tol=1e-3, max_meshes=3))
    assert chattering.verdict == "refused" and not chattering.success and "refused" in chattering.message
    np.testing.assert_array_equal(chattering.state(0.3), chattering.found.state(0.3))
    assert chattering.cost == chattering.found.cost
    if not chattering.arcs:
        with pytest.raises(somersault.errors.EvaluationError, match="no extremal was found"):
            chattering.switching(0.3)


def test_what_cannot_be_polished_says_why() -> None:
    problem = massive(2.0)
    found = problem.solve()
    with pytest.raises(TypeError, match="`found` must be a CollocationResult, found an int"):
        problem.polish(cast("Any", 3))
    with pytest.raises(somersault.errors.InputError, match="`max_time` must be a positive number"):
        problem.polish(found, max_time=0.0)
    late = problem.polish(found, max_time=1e-9)
    assert late.verdict == "refused" and late.message == "refused: the limit of time was reached"
    with pytest.raises(TypeError, match=r"a PolishResult holds functions .* polish again"):
        pickle.dumps(problem.polish(found))
    searched = problem.search(1, method="indirect")
    with pytest.raises(TypeError, match=r"a SearchResult of method='indirect' .* polish again"):
        pickle.dumps(searched)
    kept = pickle.loads(pickle.dumps(searched.best.found))
    assert problem.polish(kept).verdict == searched.best.verdict
    with pytest.raises(somersault.errors.InputError):
        BLOCK().polish(found)


def regulators(seeds: range) -> tuple[int, int]:
    """Random convex regulators with a bounded control: those certified, and arcs at bounds among them."""
    certified = at_bounds = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        a, b = rng.normal(size=(2, 2)), rng.normal(size=2)
        root = rng.normal(size=(2, 2))
        weights, price, start = root @ root.T, float(rng.uniform(0.05, 0.5)), 2.0 * rng.normal(size=2)
        problem = ocp.ControlProblem(
            lambda x, u, a=a, b=b: a @ x + b * u[0],
            states=("x", "y"),
            controls=("u",),
            initial=start,
            duration=2,
            bounds={"u": (-1, 1)},
            running_cost=lambda x, u, q=weights, r=price: 0.5 * (x @ q @ x + r * u[0] ** 2),
        )
        exact = problem.polish(problem.solve())
        if not exact.success:
            assert exact.verdict == "refused" and exact.message
            continue

        # the minimum condition as a law, integrated from the costates that were found: the problem is
        # convex, so that an extremal is the minimum, and costates that vanish at the end make it one
        def rates(_: float, z: Any, a: Any = a, b: Any = b, q: Any = weights, r: float = price) -> Any:
            u = np.clip(-(b @ z[2:4]) / r, -1, 1)
            x, costate = z[:2], z[2:4]
            return [*(a @ x + b * u), *(-q @ x - a.T @ costate), 0.5 * (x @ q @ x + r * u**2)]

        z = [*start, *exact.costate(0.0), 0.0]
        arrival = scipy.integrate.solve_ivp(
            rates, (0, 2), z, method="DOP853", rtol=1e-12, atol=1e-12, max_step=0.02
        ).y[:, -1]
        size = np.abs(exact.costate(np.linspace(0, 2, 9))).max()
        assert np.abs(arrival[2:4]).max() < 1e-6 * size, seed
        assert exact.cost == pytest.approx(arrival[4], rel=1e-8), seed
        certified += 1
        at_bounds += sum(arc["controls"]["u"] != "interior" for arc in exact.arcs)
    return certified, at_bounds


def test_random_regulators_with_bounds_are_minima_by_the_minimum_condition() -> None:
    certified, at_bounds = regulators(range(10))
    assert certified >= 9 and at_bounds >= 5


@pytest.mark.study
def test_fifty_random_regulators_with_bounds_are_minima_by_the_minimum_condition() -> None:
    certified, at_bounds = regulators(range(50))
    assert certified >= 45 and at_bounds >= 25


def steps(problem: ocp.ControlProblem) -> tuple[ocp.CollocationResult, list[Any]]:
    """The result, and the iterates that led to it."""
    found: list[Any] = []
    return problem.solve(callback=lambda _, z, *__: found.append(z.copy())), found


@pytest.mark.parametrize(
    "name", ["minimum fuel", "Bryson and Denham, low", "singular arc", "van der Pol", "Kelly's cart-pole"]
)
def test_a_start_at_ten_thousand_seconds_changes_no_digit_of_the_iterates(name: str) -> None:
    problem = KNOWN[name].pose()
    (here, ours), (later, theirs) = steps(problem), steps(problem.replace(start_time=1e4))
    assert here.success and later.success and len(ours) == len(theirs)
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(here.x, later.x)
    np.testing.assert_allclose(later.t - 1e4, here.t, atol=4e-12)


def test_a_free_duration_far_from_zero_keeps_its_digits() -> None:
    swung = swung_up(2.0, (0.5, 5))
    (here, ours), (later, theirs) = steps(swung), steps(swung.replace(start_time=1e4))
    assert len(ours) == len(theirs)
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(one, other)
    assert later.cost == here.cost
