"""Gradients of trees by the adjoint, what they are by, and joint forces at knots of time."""

import pickle
import signal
import threading
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from somersault import contact, errors, multibody

Array = NDArray[np.float64]
LEG = contact.hopping_leg()
TIMES = np.array([0.0, 0.03, 0.07, 0.1, 0.15])
KNEE = multibody.TorqueProfile(TIMES, [LEG.torque(t, LEG.q, LEG.v) for t in TIMES])
BY: list[Any] = [
    ("law.stiffness", 0),
    ("friction.coefficient", "foot"),
    ("torque", 3),
    ("torque", 4, KNEE),
    ("mass", "thigh"),
    ("center", "shank", (0.2, 0.0, -1.0)),
    ("inertia", "body", np.eye(3)),
    ("origin", "shank", (0.0, 0.0, -1.0)),
]
RUN: dict[str, Any] = {"dt": 1e-3, "method": "rkmk8", "contacts": LEG.contacts, "torque": KNEE}
START = (LEG.model, LEG.q, LEG.v, (0.0, 0.16))


def test_gradients_are_what_the_columns_make() -> None:
    columns = contact.differentiate_tree(*START, parameters=BY, **RUN)
    random = np.random.default_rng(3)
    by_q, by_v, by_t = random.normal(size=5), random.normal(size=5), random.normal(size=len(columns.events))

    def cost(q: Array, v: Array) -> tuple[float, Array, Array]:
        np.testing.assert_array_equal(q, columns.q)
        return float(by_v @ v), by_q, by_v

    def of_times(t: Array) -> tuple[float, Array]:
        return float(by_t @ t), by_t

    found = contact.gradient_tree(*START, cost, event_cost=of_times, parameters=BY, **RUN)
    assert [event.kind for event in found.events] == [event.kind for event in columns.events]
    assert found.cost == pytest.approx(by_v @ columns.v + by_t @ [event.t for event in columns.events])
    weights = np.concatenate([by_q, by_v])
    whole = weights @ np.hstack([columns.by_state, columns.by_parameters]) + by_t @ columns.event_times
    assert found.by_parameters.shape == (7 + len(TIMES),)
    assert found.by_state == pytest.approx(whole[:10], rel=1e-10)
    assert found.by_parameters == pytest.approx(whole[10:], rel=1e-10)
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.by_parameters, found.by_parameters)
    assert repr(again) == repr(found)


def test_a_running_cost_gathers_what_it_integrates() -> None:
    knee = np.eye(5)[4]
    gathered = contact.gradient_tree(*START, running=lambda t, q, v: (v[4], None, knee), parameters=BY, **RUN)
    at_end = contact.gradient_tree(*START, lambda q, v: (q[4] - LEG.q[4], knee, None), parameters=BY, **RUN)
    assert gathered.cost == pytest.approx(at_end.cost, abs=1e-12)
    assert gathered.by_parameters == pytest.approx(at_end.by_parameters, rel=1e-8)
    assert gathered.by_state[4] == pytest.approx(at_end.by_state[4] - 1.0, rel=1e-8)


def test_gradients_of_driven_joints_and_of_knots_are_differences_of_runs() -> None:
    driven: dict[str, Any] = {
        "active": ["thigh"],
        "acceleration": lambda t, q, v: 50.0 * np.cos(20.0 * t) - 200.0 * q,
    }

    def height(values: Array, mass: float = 0.0) -> float:
        links = [link if link.name != "shank" else heavier(link, mass) for link in LEG.model.links]
        motion = multibody.integrate_tree(
            multibody.Model(links, gravity=LEG.model.gravity),
            *START[1:],
            **(RUN | {"torque": multibody.TorqueProfile(TIMES, values, "hold")}),
            **driven,
        )
        return float(motion.q[-1, 1])

    def heavier(link: multibody.Link, by: float) -> multibody.Link:
        return multibody.Link(
            link.name,
            link.joint,
            parent=link.parent,
            axis=link.axis,
            mass=link.mass + by,
            center=link.center,
            inertia=link.inertia,
            origin=link.origin,
            orientation=link.orientation,
        )

    held = multibody.TorqueProfile(TIMES, KNEE.values, "hold")
    by: list[Any] = [("torque", 4, held), ("mass", "shank")]
    run = RUN | {"torque": held} | driven

    def cost(q: Array, v: Array) -> tuple[float, Array, None]:
        # a planar joint moves along the axes of its body
        return q[1], np.array([np.sin(q[2]), np.cos(q[2]), 0.0, 0.0, 0.0]), None

    found = contact.gradient_tree(*START, cost, parameters=by, **run)
    step = np.zeros_like(KNEE.values)
    step[3, 4] = 1e-3
    difference = (height(KNEE.values + step) - height(KNEE.values - step)) / 2e-3
    assert found.by_parameters[3] == pytest.approx(difference, rel=1e-5)
    difference = (height(KNEE.values, 1e-5) - height(KNEE.values, -1e-5)) / 2e-5
    assert found.by_parameters[-1] == pytest.approx(difference, rel=1e-5)


def test_profiles_are_values() -> None:
    held = multibody.TorqueProfile([0.0, 1.0], [[1.0, 2.0], [3.0, 5.0]], between="hold")
    again = pickle.loads(pickle.dumps(held))
    assert repr(again) == repr(held) and again.between == "hold"
    np.testing.assert_array_equal(again.values, [[1.0, 2.0], [3.0, 5.0]])
    np.testing.assert_array_equal(held([-1.0, 0.5, 1.0, 2.0]), [[1, 2], [1, 2], [3, 5], [3, 5]])
    line = multibody.TorqueProfile([0.0, 1.0], [[1.0, 2.0], [3.0, 5.0]])
    np.testing.assert_allclose(line(0.25), [1.5, 2.75])
    for wrong, message in (
        (([0.0, 0.0], [[1.0], [2.0]]), "`times` must be increasing"),
        (([0.0, 1.0], [[1.0], [np.nan]]), "`values` must be finite"),
        (([0.0, 1.0], [1.0, 2.0]), "`values` must be real numbers of shape"),
        (([0.0, 1.0], [[1.0]]), "`values` must have 2 entries, found 1"),
        (([], np.zeros((0, 2))), "`times` must have at least 1"),
        (([0.0, 1.0], [[1.0], [2.0]], "spline"), "`between` must be 'line' or 'hold', found 'spline'"),
    ):
        with pytest.raises(errors.InputError, match=message):
            multibody.TorqueProfile(*wrong)
    with pytest.raises(
        errors.InputError, match="`torque` must have 5 joint forces, found a TorqueProfile of 2"
    ):
        multibody.integrate_tree(LEG.model, LEG.q, LEG.v, (0.0, 0.1), dt=0.01, torque=line)


def test_what_has_no_gradient_says_so() -> None:
    def flat(q: Array, v: Array) -> tuple[float, None, None]:
        return 0.0, None, None

    def gradient(cost: Any = flat, **options: Any) -> contact.TreeGradient:
        return contact.gradient_tree(*START, cost, **(RUN | options))

    for options, message in (
        ({"cost": None}, "one of `cost`, `running` and `event_cost` must be given"),
        ({"cost": 1.0}, r"`cost` must be a callable f\(q, v\)"),
        ({"running": 2}, r"`running` must be a callable f\(t, q, v\)"),
        ({"method": "ab4"}, "takes an explicit Runge-Kutta method, found `ab4`"),
        ({"parameters": [("mass", 1)]}, "`parameters` must hold"),
        ({"parameters": [("mass", "foot")]}, "no body is named `foot`"),
        ({"parameters": [("law.stiffness", "toe")]}, "must name one of the contacts foot, found 'toe'"),
        ({"parameters": [("origin", "shank", (0, 0, np.inf))]}, "`parameters` must be finite"),
        (
            {"parameters": [("inertia", "shank", [[0, 1, 0], [0, 0, 0], [0, 0, 0]])]},
            "`inertia` must be symmetric",
        ),
        ({"parameters": [("torque", 5, KNEE)]}, "a degree of freedom below 5, found the force of 5"),
        ({"acceleration": np.zeros(5)}, "`acceleration` is that of `active` degrees of freedom"),
        ({"active": ["thigh"], "acceleration": KNEE}, "`acceleration` must be numbers or a callable"),
        ({"cost": lambda q, v: 1.0}, "must be a tuple of a number and 2 derivatives, found a float"),
        ({"cost": lambda q, v: (1j, None, None)}, "must begin with a real number, found a complex"),
        ({"cost": lambda q, v: (1.0, np.zeros(4), None)}, r"must be real numbers of shape \(5,\)"),
        ({"cost": lambda q, v: (np.nan, None, None)}, "must be finite"),
        ({"event_cost": lambda t: (0.0, [1.0])}, r"must be real numbers of shape"),
    ):
        with pytest.raises(errors.InputError, match=message):
            gradient(**options)

    def broken(t: float, q: Array, v: Array) -> tuple[float, None, None]:
        raise ZeroDivisionError("broken")

    with pytest.raises(ZeroDivisionError, match="broken") as raised:
        gradient(running=broken)
    assert np.isnan(raised.value.solution.cost)  # type: ignore[attr-defined]
    # A ball that is thrown just up to a lid has one-sided derivatives.
    slider = multibody.Model([multibody.Link("ball", "prismatic", axis=(0, 0, 1), mass=1.0)])
    lid = contact.HalfSpace((0, 0, 1), (0, 0, -1))
    touch = contact.Contact((0, 0, 0), lid, contact.CompliantLaw(1e4, 5.0))
    speed = np.sqrt(2.0 * 9.81 * (0.5 + 1e-9))
    with pytest.raises(errors.SensitivityError, match="is grazed") as grazed:
        contact.gradient_tree(
            slider,
            [0.5],
            [speed],
            (0.0, 0.4),
            lambda q, v: (q[0], [1.0], None),
            dt=1e-3,
            contacts=contact.LinkContact("lid", "ball", touch),
        )
    assert np.isfinite(grazed.value.solution.by_state).all()  # type: ignore[attr-defined]


def test_a_gradient_can_be_interrupted() -> None:
    timer = threading.Timer(0.3, signal.raise_signal, (signal.SIGINT,))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        contact.gradient_tree(
            *START[:3],
            (0.0, 0.16),
            lambda q, v: (0.0, None, None),
            running=lambda t, q, v: (0.0, None, None),
            **(RUN | {"dt": 2e-6}),
        )
    timer.join()


def test_a_mass_on_a_table_that_moves_is_differentiated_through_its_bounces() -> None:
    up = np.array([0.0, 0.0, 5e-3])

    def shaken(t: float) -> tuple[Array, Array, Array]:
        return up * np.sin(40 * t), 40 * up * np.cos(40 * t), -1600 * up * np.sin(40 * t)

    mass = multibody.Model([multibody.Link("mass", "prismatic", axis=(0, 0, 1), mass=2.0)])
    scene = contact.TreeOnPlatforms(mass, [contact.Platform("table", shaken)])
    driven: dict[str, Any] = {"active": scene.active, "acceleration": scene.acceleration}
    steps: dict[str, Any] = {"dt": 1e-3, "method": "rkmk8"}

    def touching(stiffness: float) -> contact.LinkContact:
        law = contact.CompliantLaw(stiffness, 20.0)
        return contact.LinkContact(
            "foot", "mass", contact.Contact((0, 0, 0), contact.HalfSpace(), law), on="table"
        )

    def end(height: float, stiffness: float) -> float:
        q, v = scene.start([height], [0.0])
        run = multibody.integrate_tree(
            scene.model, q, v, (0.0, 0.3), contacts=touching(stiffness), **driven, **steps
        )
        assert run.n_events > 2
        return float(run.q[-1, 0])

    q, v = scene.start([0.02], [0.0])
    found = contact.differentiate_tree(
        scene.model,
        q,
        v,
        (0.0, 0.3),
        contacts=touching(2e4),
        parameters=[("law.stiffness", "foot")],
        **driven,
        **steps,
    )
    by_height = (end(0.02 + 1e-6, 2e4) - end(0.02 - 1e-6, 2e4)) / 2e-6
    by_stiffness = (end(0.02, 2e4 + 1.0) - end(0.02, 2e4 - 1.0)) / 2.0
    assert found.by_state[0, 0] == pytest.approx(by_height, rel=1e-5)
    assert found.by_parameters[0, 0] == pytest.approx(by_stiffness, rel=1e-5)
