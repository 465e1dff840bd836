"""Bad values of every argument of somersault.ocp: errors that name what was typed."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import errors, multibody, ocp

NAN, INF = float("nan"), float("inf")
#: Beyond 64 bits, within them, and within a double.
HUGE = (10**30, -(10**30), 2**62)

# What is bad whatever an argument means, by what it takes.
COUNT = [-1, 0, "a", None, [], 1.5, *HUGE]
INDEX = [-1, "a", [], 1.5, *HUGE]
LIMIT = [-1, "a", [], -(10**30)]
POSITIVE = [NAN, INF, -1.0, 0.0, "a", None, []]
NOT_NEGATIVE = [NAN, INF, -1.0, "a", None, []]
FINITE = [NAN, INF, "a", None, []]
RANGE = [NAN, (NAN, 1.0), (2.0, 1.0), "a", None, [], (1.0,), (1.0, 2.0, 3.0)]
DURATION = [*RANGE, -1.0, 0.0, -INF, (-1.0, 1.0), (0.0, 1.0)]
NAME = ["a", 3, None, []]
VECTOR = ["a", None, [], [NAN] * 2, [INF] * 2, [0.0] * 50, np.zeros((2, 2, 2)), [None, 1.0]]
CALLABLE = [3, "a", []]
SEED = [-1, "a", None, [], 1.5, 10**30 * -1]
TOLERANCE = [NAN, INF, -1.0, 0.0, "a", []]
SOLVE = {
    "tol": TOLERANCE,
    "max_iterations": LIMIT,
    "max_time": [NAN, INF, -1.0, 0.0, "a", []],
    "on_interrupt": NAME,
}

AT_REST: list[Any] = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]


def block() -> somersault.Model:
    link = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
    return somersault.Model([link], gravity=(0, 0, 0))


def call(make: Callable[..., Any], **good: Any) -> Callable[[str, Any], Any]:
    """Calls with all arguments good but one."""
    return lambda name, value: make(**{**good, name: value})


def cases() -> Iterator[tuple[str, Callable[[str, Any], Any], dict[str, list[Any]]]]:
    """What is called, how, and the bad values of its arguments."""
    base = ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0]])
    spline = ocp.SplineMotion(1, 10, AT_REST)
    phase = ocp.Phase(spline, 1.0, 20)
    term = ocp.entries("torque", [0])
    model = multibody.cart_pendulum()
    posed: dict[str, Any] = {
        "model": model,
        "q": [0.0, np.pi],
        "v": [0.0, 0.0],
        "phases": [phase],
        "active": ["cart"],
    }
    problem = ocp.MotionProblem(**posed, costs=[ocp.Cost(term)])
    z = np.full(problem.n_variables, 0.1)
    yield "EigenpostureBase", call(ocp.EigenpostureBase), {"postures": VECTOR}
    yield "positions", call(base.positions), {"weights": VECTOR}
    yield "project", call(base.project), {"positions": VECTOR}
    yield (
        "SplineMotion",
        call(ocp.SplineMotion, base=1, n_coefficients=10),
        {
            "base": COUNT,
            "n_coefficients": COUNT,
            "conditions": [
                "a",
                3,
                [1],
                [("a", 0, 0.0)],
                [("start", -1, 0.0)],
                [("start", 10**30, 0.0)],
                [("start", 0, NAN)],
            ],
            "degree": [-1, "a", None, [], *HUGE],
        },
    )
    yield "coefficients", call(spline.coefficients), {"parameters": VECTOR}
    yield (
        "SplineMotion()",
        call(spline, parameters=np.zeros(spline.n_parameters), fraction=0.5),
        {
            "parameters": VECTOR,
            "fraction": [NAN, "a", None, [[0.5]]],
            "derivative": ["a", None, -1, -(10**30)],
        },
    )
    yield (
        "fit",
        call(spline.fit, fraction=np.linspace(0, 1, 9), samples=np.zeros((9, 1))),
        {"fraction": VECTOR, "samples": VECTOR},
    )
    yield (
        "Phase",
        call(ocp.Phase, motion=spline, duration=1.0, n_steps=10),
        {"motion": [3, "a", None], "duration": DURATION, "n_steps": COUNT, "n_segments": [*COUNT, 11]},
    )
    yield (
        "entries",
        call(ocp.entries, part="torque"),
        {"part": NAME, "indices": ["a", 3, [], [-1], ["a"], [-(10**30)]]},
    )
    yield (
        "displacement",
        call(ocp.displacement, reference=[0.0, 0.0]),
        {"reference": ["a", None, [NAN], [[0.0]]], "dofs": ["a", 3, [], [-1], ["a"]]},
    )
    yield "momentum", call(ocp.momentum), {"part": NAME}
    yield (
        "point_position",
        call(ocp.point_position, body="cart"),
        {"body": [3, None, []], "point": VECTOR[:1] + VECTOR[2:]},
    )
    yield (
        "axis_direction",
        call(ocp.axis_direction, body="cart", axis=[0, 0, 1]),
        {"body": [3, None], "axis": [*VECTOR, [0, 0, 0]]},
    )
    yield (
        "body_orientation",
        call(ocp.body_orientation, body="cart", target=[0, 0, 0, 1]),
        {"body": [3, None], "target": [*VECTOR, [0, 0, 0, 0]]},
    )
    yield (
        "function",
        call(ocp.function, f=lambda node: 0.0),
        {"f": [*CALLABLE, None], "n_rows": COUNT, "gradient": CALLABLE, "reads": ["a", 3, [], ["a"]]},
    )

    def with_cost(name: str, value: Any) -> Any:
        return ocp.MotionProblem(**posed, costs=[ocp.Cost(**{"term": term, name: value})])

    place = {"at": NAME, "phase": [-1, "a", [], 5, *HUGE]}
    yield (
        "Cost",
        with_cost,
        {
            "term": [3, None],
            "weights": [NAN, INF, -1.0, "a", [], [1.0, 2.0]],
            "target": [NAN, INF, "a", []],
            **place,
        },
    )
    yield "Cost at a node", call(ocp.Cost, term=term, at="node"), {"node": [-1, None, "a", -(10**30)]}
    yield (
        "a node beyond the motion",
        lambda name, value: ocp.MotionProblem(**posed, costs=[ocp.Cost(term, at="node", node=value)]),
        {"node": [21, 10**30]},
    )
    yield (
        "entries of a motion",
        lambda name, value: ocp.MotionProblem(**posed, costs=[ocp.Cost(ocp.entries("torque", value))]),
        {"indices": [[2], [10**30]]},
    )

    def constrained(name: str, value: Any) -> Any:
        good = {"term": term, "lower": -1.0, "upper": 1.0, name: value}
        return ocp.MotionProblem(**posed, constraints=[ocp.Constraint(**good)])

    yield (
        "Constraint alone",
        call(ocp.Constraint, term=term, lower=0.0, upper=0.0),
        {"lower": [1.0, [0.0, 1.0], "a", None, [[0.0]]], "upper": [-1.0, [0.0, -1.0], "a", None, [[0.0]]]},
    )
    yield "fixed variables", call(ocp.MotionProblem, **posed, upper=0.0), {"lower": [0.0]}
    bound = [NAN, "a", None, [], [0.0, 0.0]]
    yield (
        "Constraint",
        constrained,
        {"term": [3, None], "lower": [*bound, INF, 2.0], "upper": [*bound, -INF, -2.0], **place},
    )
    yield (
        "MotionProblem",
        call(ocp.MotionProblem, **posed),
        {
            "model": [3, None],
            "q": VECTOR,
            "v": VECTOR,
            "phases": [[], "a", 3, None, [3]],
            "active": [["nobody"], "a", 3, None, [True]],
            "drive": NAME,
            "scheme": NAME,
            "costs": ["a", 3, [3]],
            "constraints": ["a", 3, [3]],
            "free_positions": ["a", 3, [True]],
            "free_velocities": ["a", 3, [True]],
            "lower": [NAN, INF, "a", [], [0.0]],
            "upper": [NAN, -INF, "a", [], [0.0]],
        },
    )
    for method in (
        problem.cost,
        problem.gradient,
        problem.constraints,
        problem.jacobian,
        problem.motion,
        problem.verify,
    ):
        yield method.__name__, call(method), {"z": VECTOR}
    solving = {**SOLVE, "solver": NAME}
    yield "MotionProblem.solve", call(problem.solve, z=z), {"z": VECTOR, "callback": CALLABLE, **solving}
    yield (
        "MotionProblem.search",
        call(problem.search, n_starts=2),
        {
            "n_starts": COUNT,
            "z": VECTOR[:1] + VECTOR[2:],
            "starts": ["a", 3, [], [[0.0]], [[NAN] * len(z)]],
            "seed": SEED,
            "reach": [NAN, INF, -1.0, "a", [], [1.0]],
            "distance_tol": [*TOLERANCE, None],
            **solving,
        },
    )

    cart = ocp.CartPendulumProblem()
    states = ["a", [], [0.0], [NAN] * 4, [INF] * 4, [None] * 4]
    four = [NAN, INF, -1.0, "a", [], [1.0, 2.0]]
    yield (
        "CartPendulumProblem",
        call(ocp.CartPendulumProblem),
        {
            "start": states,
            "target": states,
            "duration": POSITIVE,
            "n_steps": COUNT,
            "n_par": [*COUNT, 5],
            "scheme": NAME,
            "terminal_weights": four,
            "force_weight": NOT_NEGATIVE,
            "running_weights": four,
            "cart_mass": NOT_NEGATIVE,
            "mass": POSITIVE,
            "length": POSITIVE,
            "gravity": FINITE,
        },
    )
    yield "case", call(ocp.CartPendulumProblem.case), {"name": NAME}
    for method in (cart.cost, cart.gradient, cart.hessian, cart.motion, cart.verify):
        yield method.__name__, call(method), {"z": VECTOR}
    yield "carry_over", call(cart.carry_over, other=cart, z=[0.0] * 5), {"other": [3, None], "z": VECTOR}
    yield (
        "CartPendulumProblem.solve",
        call(cart.solve),
        {"z": VECTOR[:1] + VECTOR[2:], "callback": CALLABLE, **solving},
    )
    yield (
        "CartPendulumProblem.search",
        call(cart.search, n_starts=2),
        {
            "n_starts": COUNT,
            "starts": ["a", 3, [], [[0.0]], [[NAN] * 5]],
            "seed": SEED,
            "reach": POSITIVE,
            "distance_tol": [*TOLERANCE, None],
            "on_interrupt": NAME,
        },
    )

    dive = ocp.dive_107b(n_steps=20)
    solution = dive.solve(max_iterations=1)
    template = ["a", 3, [3], [("A",)], [(0.0, "X"), (1.0, "H")], [(0.0, -1), (1.0, 1)]]
    yield (
        "Dive",
        call(dive.replace),
        {
            "diver": [3, None],
            "postures": ["", 3, None, [3], [[NAN] * 9, [0.1] * 9], [[0.0]]],
            "first": ["X", -1, 7, None, 1.5, 10**30],
            "last": ["X", -1, 7, None, 1.5, 10**30],
            "channels": NAME,
            "windows": ["a", 3, [3, "a"], [(0.5, 0.2)], [(0.5, 0.5)], [(0.5, 0.51)], [(NAN, 1.0)]],
            "square_out": [*POSITIVE, 1.5],
            "n_par": [*COUNT, 5],
            "somersaults": [*FINITE, -3.5],
            "twists": FINITE,
            "lean": [*RANGE, 10.0],
            "entry_lean": [*FINITE, 90.0],
            "duration": [*DURATION, INF],
            "momentum": [*RANGE, INF, 0.0, (-500.0, 0.0)],
            "platform": NOT_NEGATIVE,
            "entry_distance": FINITE,
            "momentum_penalty": NOT_NEGATIVE,
            "rate_penalty": NOT_NEGATIVE,
            "acceleration_penalty": NOT_NEGATIVE,
            "clearance": ["a", []],
            "clearance_times": COUNT,
            "n_steps": COUNT,
            "n_pieces": COUNT,
            "template": template,
        },
    )
    ordered = [[], [(0.0, "A")], [(NAN, "A"), (1.0, "H")], [(0.5, "A"), (1.0, "H")]]
    yield "Dive.start", call(dive.start), {"template": [*template, *ordered]}
    staged = {"soft_weights": ["a", 3, [NAN], [-1.0], [0.0], ["a"]], **SOLVE}
    yield "Dive.solve", call(dive.solve), {"z": VECTOR[:1] + VECTOR[2:], "callback": CALLABLE, **staged}
    yield "Dive.search", call(dive.search, n_starts=1), {"n_starts": COUNT, "seed": SEED, **staged}
    yield "literal", call(solution.literal), {"n_steps": COUNT, "on_interrupt": NAME}
    yield "literal_momentum", call(solution.literal_momentum), {"n_steps": COUNT}
    yield "sentence", call(problem.verify(z).sentence), {"allowed": [NAN, INF, -1.0, 0.0, "a", None]}

    ends = ["a", 3, [], [0.0], ["a", 0.0], [NAN, 0.0], [(2.0, 1.0), 0.0]]
    straight = {
        "dynamics": block(),
        "initial": [0, 0],
        "final": [1, 0],
        "duration": 1.0,
        "running_cost": lambda x, u: 0.5 * u[0] ** 2,
    }
    moved = ocp.ControlProblem(**straight)
    function = [3, "a", [], lambda: NAN, lambda x, u, t, p, q: 0.0, lambda x: [x, x]]
    constraints = ["a", 3, [3], [(3, 0, 0)], [(lambda x: x, "a", 0)], [(lambda x: x[0], 1, 0)]]
    names = [3.0, "a", ["a", "a"], [3], ["a b"], -1, 10**9]
    yield (
        "ControlProblem",
        call(ocp.ControlProblem, **straight),
        {
            "dynamics": [3, None],
            "states": [*names, 1],
            "controls": [*names, 0],
            "parameters": names,
            "initial": [*ends, {"a": 0}, {"q_block": "a"}],
            "final": [*ends, {"a": 0}, {"q_block": "a"}],
            "duration": [each for each in DURATION if each != (0.0, 1.0)],
            "start_time": FINITE,
            "actuated": [["nobody"], 3],
            "running_cost": function,
            "end_cost": function,
            "path": [*constraints, [(lambda x: x[0], None, 0.5)]],
            "ends": constraints,
            "integrals": [*constraints, [(lambda x: x, 0, 0)]],
            "bounds": ["a", 3, {"a": 0}, {"q_block": "a"}, {"q_block": (2.0, 1.0)}, {"q_block": NAN}],
            "scales": ["a", 3, {"a": 1}, {"q_block": 1.0}, {"q_block": 0.0, "v_block": 1, "u_block": 1}],
        },
    )
    found = moved.solve()
    pair = {"x": [[0.0, 0.0], [1.0, 0.0]]}
    guess: list[Any] = [
        "a",
        3,
        [],
        {"a": 0.0},
        {"x": [[0.0, 0.0]]},
        {"x": [[NAN, 0.0], [1.0, 0.0]]},
        {"x": [[0.0], [1.0]]},
        {"t": [0.0, NAN], **pair},
        {"t": [1.0, 0.0], **pair},
        {"q_block": [0.0, 1.0], "v_block": [0.0, 1.0, 2.0]},
    ]
    yield (
        "ControlProblem.solve",
        call(moved.solve),
        {
            "guess": guess,
            "n_intervals": [n for n in COUNT if n is not None],
            "n_points": [*(n for n in COUNT if n is not None), 501],
            "max_meshes": COUNT,
            "callback": CALLABLE,
            **SOLVE,
        },
    )
    back = ocp.ControlProblem(**{**straight, "initial": [1, 0], "final": [0, 0]})
    linked = ocp.MultiphaseProblem([moved, back])
    yield (
        "MultiphaseProblem",
        call(ocp.MultiphaseProblem, phases=linked.phases),
        {
            "phases": [
                [],
                3,
                None,
                [3],
                [moved, moved],
                [moved, ocp.ControlProblem(**straight, start_time=1.0)],
            ],
            "links": [
                "a",
                3,
                [],
                ["a"],
                [3],
                [[0.0]],
                [{"a": 0.0}],
                [{"q_block": NAN}],
                [{"q_block": (1.0, 0.0)}],
                [{"q_block": 0.5}],
            ],
        },
    )
    two = linked.solve(n_intervals=2)
    yield (
        "MultiphaseProblem.solve",
        call(linked.solve),
        {
            "guess": [*guess, [pair], [pair, "a"], [pair, {"x": [[0.0, 0.0]]}], [pair, pair, pair], found],
            "n_intervals": [n for n in COUNT if n is not None],
            "n_points": [*(n for n in COUNT if n is not None), 501],
            "max_meshes": COUNT,
            "callback": CALLABLE,
            **SOLVE,
        },
    )
    assert two.success
    for method in (found.state, found.control, found.costate):
        yield method.__name__, call(method), {"t": [NAN, INF, "a", None, [[0.0]]]}
    yield (
        "arm_problem",
        call(ocp.arm_problem),
        {
            "duration": [each for each in DURATION if each != (0.0, 1.0)],
            "initial": ends,
            "control_weights": [NAN, INF, -1.0, "a", [], [1.0] * 7],
        },
    )


ALL = list(cases())


@pytest.mark.parametrize(("call", "bad"), [case[1:] for case in ALL], ids=[case[0] for case in ALL])
def test_bad_values_are_refused_by_the_name_of_their_argument(
    call: Callable[[str, Any], Any], bad: dict[str, list[Any]]
) -> None:
    faults = []
    for name, values in bad.items():
        for value in values:
            try:
                found = call(name, value)
            except (ValueError, TypeError) as error:
                # a wrong type is named in a note, which stands below the message
                said = "\n".join([str(error), *getattr(error, "__notes__", [])])
                if name not in said:
                    faults.append(f"{name}={value!r}: {type(error).__name__}: {said}")
            except BaseException as error:  # a panic is no Exception
                faults.append(f"{name}={value!r}: {type(error).__name__}: {error}")
            else:
                faults.append(f"{name}={value!r}: {found!r}")
    assert not faults, "\n".join(faults)


def test_problems_with_nothing_to_vary_are_refused() -> None:
    # four conditions leave no coefficient of a cubic free
    cubic = ocp.SplineMotion(1, 4, AT_REST, degree=3)

    def posed(duration: Any, **options: Any) -> ocp.MotionProblem:
        phases = [ocp.Phase(cubic, duration, 20)]
        model = multibody.cart_pendulum()
        return ocp.MotionProblem(model, [0.0, np.pi], [0.0, 0.0], phases, active=["cart"], **options)

    with pytest.raises(errors.InputError, match=r"nothing to vary: .*`q` and `v`.*`phases`"):
        posed(1.0)
    assert posed((0.5, 1.0)).n_variables == 1
    assert posed(1.0, free_velocities=[False, True]).n_variables == 1
    with pytest.raises(errors.InputError, match="`lower` and `upper` must leave something to vary"):
        posed((0.5, 1.0), lower=0.7, upper=0.7)
    ends: dict[str, Any] = {"initial": [0, 0], "final": [0, 0]}
    still: dict[str, Any] = {"q_block": 0.0, "v_block": 0.0}
    assert ocp.ControlProblem(block(), **ends, bounds={**still, "u_block": (None, 0.0)}).solve().success
    with pytest.raises(errors.InputError, match="`bounds` or the horizon must leave something free"):
        ocp.ControlProblem(block(), **ends, bounds={**still, "u_block": 0.0})


@pytest.mark.parametrize("value", [np.nan, [np.nan, 0.0], [0.0, np.nan]])
def test_nan_in_costs_and_constraints_is_refused_by_name(value: Any) -> None:
    term = ocp.entries("torque", [0, 1])
    for name, call in (
        ("weights", lambda: ocp.Cost(term, value)),
        ("target", lambda: ocp.Cost(term, [1.0, 1.0], value)),
        ("lower", lambda: ocp.Constraint(term, value, [1.0, 1.0])),
        ("upper", lambda: ocp.Constraint(term, [-1.0, -1.0], value)),
    ):
        with pytest.raises(errors.InputError, match=f"`{name}` .*found NaN"):
            call()
    with pytest.raises(errors.InputError, match="`target` must be finite, found inf"):
        ocp.Cost(term, None, np.inf)
    # a bound that is not there
    ocp.Constraint(term, -np.inf, [np.inf, 1.0])
