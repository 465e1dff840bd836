"""Events of functions, states at given times and runs backwards are those of SciPy."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import somersault
from somersault import RigidBody, State, contact, forces, integrate, multibody
from somersault.contact import CompliantLaw, Contact, HalfSpace, bouncing_ball
from somersault.errors import InputError

Array = NDArray[np.float64]
#: Of time, position, rotation matrix, velocity and angular velocity.
Wrench = Callable[[float, Array, Array, Array, Array], tuple[Array, Array]]
Value = Callable[[float, Array, Array, Array, Array], float]
ZERO, UP = np.zeros(3), np.array([0.0, 0.0, 1.0])
BOX, TOP = RigidBody.box(1.0, (0.2, 0.4, 0.6)), RigidBody(1.0, np.diag([0.5, 0.5, 0.2]))
GROUND = Contact(ZERO, HalfSpace(ZERO, UP), CompliantLaw(1e4))
BALL, FALL = RigidBody.sphere(1.0, 0.1), forces.Gravity()
#: Events of a harmonic oscillator: x = cos t.
SPRING, AT_ONE = forces.Spring(1.0, ZERO, ZERO), State(position=(1.0, 0.0, 0.0))
TIGHT: dict[str, Any] = {"rtol": 1e-13, "atol": 1e-13}


def event(function: Callable[..., float], **attributes: Any) -> Callable[..., float]:
    """The function with attributes."""
    for name, value in attributes.items():
        setattr(function, name, value)
    return function


def at_x(t: float, state: State) -> float:
    """Zero where x is."""
    return float(state.position[0])


# ------------------------------------------------------------------------------------------ against SciPy


def heavy_top(t: float, x: Array, r: Array, v: Array, w: Array) -> tuple[Array, Array]:
    """Weight at 0.3 m above the tip, about which the moments are."""
    return ZERO, np.cross(r @ (0.3 * UP), -9.81 * UP)


def gravity_gradient(t: float, x: Array, r: Array, v: Array, w: Array) -> tuple[Array, Array]:
    """3n² e × I e on a circular orbit."""
    e = np.array([np.cos(1.3 * t), np.sin(1.3 * t), 0.0])
    return ZERO, 3.0 * 1.3**2 * np.cross(e, r @ BOX.inertia @ r.T @ e)


def spring(t: float, x: Array, r: Array, v: Array, w: Array) -> tuple[Array, Array]:
    """A spring of length 0.7 m at a corner."""
    arm = r @ np.array([0.1, 0.2, 0.3])
    span = x + arm - np.array([0.2, 0.1, 1.5])
    force = -9.0 * (1.0 - 0.7 / np.linalg.norm(span)) * span
    return force, np.cross(arm, force)


PROBLEMS: dict[str, tuple[RigidBody, State, Wrench, Value]] = {
    "free body": (
        BOX,
        State(angular_velocity=(0.05, 6.0, 0.1)),
        lambda t, x, r, v, w: (ZERO, ZERO),
        lambda t, x, r, v, w: r[1, 0] - 0.1,
    ),
    "heavy top": (
        TOP,
        State(orientation=Rotation.from_rotvec([0.4, 0.0, 0.0]), angular_velocity_body=(0.1, 0.2, 20.0)),
        heavy_top,
        lambda t, x, r, v, w: r[0, 0],
    ),
    "pendulum": (
        BOX,
        State(orientation=Rotation.from_rotvec([2.5, 0.0, 0.0])),
        lambda t, x, r, v, w: (ZERO, np.array([-0.4 * r[2, 1], 0.0, 0.0])),
        lambda t, x, r, v, w: r[2, 1],
    ),
    "gravity gradient": (
        BOX,
        State(angular_velocity=(0.3, -0.2, 1.1)),
        gravity_gradient,
        lambda t, x, r, v, w: r[0, 0],
    ),
    "damped": (
        BOX,
        State(angular_velocity=(3.0, 5.0, 0.4)),
        lambda t, x, r, v, w: (-0.3 * v, -0.02 * w),
        lambda t, x, r, v, w: w[1] - 2.0,
    ),
    "thrown with drag": (
        BALL,
        State(velocity=(2.0, 1.0, 9.0), angular_velocity=(0.0, 9.0, 1.0)),
        lambda t, x, r, v, w: (-9.81 * UP - 0.05 * np.linalg.norm(v) * v + 0.02 * np.cross(w, v), -1e-3 * w),
        lambda t, x, r, v, w: v[2],
    ),
    "spring": (BOX, State(velocity=(0.5, 0.0, 0.0)), spring, lambda t, x, r, v, w: x[2] - 0.4),
    "thruster": (
        BOX,
        State(angular_velocity=(0.1, 0.2, 2.0)),
        lambda t, x, r, v, w: (r @ (2.0 * UP), r @ np.array([0.02, 0.0, 0.05])),
        lambda t, x, r, v, w: x[2] - 1.0,
    ),
    "driven": (
        BOX,
        State(angular_velocity=(0.0, 1.0, 0.0)),
        lambda t, x, r, v, w: (np.sin(3.0 * t) * UP, 0.2 * np.array([np.cos(5.0 * t), 0.0, np.sin(2.0 * t)])),
        lambda t, x, r, v, w: w[2] - 0.5 * np.sin(4.0 * t),
    ),
    "magnet": (
        BOX,
        State(angular_velocity=(0.2, 0.3, 0.4)),
        lambda t, x, r, v, w: (ZERO, np.cross(r @ np.array([0.3, 0.1, 0.0]), UP)),
        lambda t, x, r, v, w: r[2, 0],
    ),
}


def of_state(function: Callable[..., Any]) -> Callable[[float, State], Any]:
    """The same of a state."""
    return lambda t, s: function(t, s.position, s.orientation.as_matrix(), s.velocity, s.angular_velocity)


def by_scipy(
    body: RigidBody, state: State, interval: tuple[float, float], wrench: Wrench, value: Value
) -> tuple[Array, Array]:
    """The end and the times of events by DOP853 on quaternions."""

    def parts(y: Array) -> tuple[Array, Array, Array, Array]:
        return y[:3], Rotation.from_quat(y[3:7]).as_matrix(), y[7:10], y[10:]

    def slope(t: float, y: Array) -> Array:
        (x, r, v, w), q = parts(y), y[3:7]
        force, torque = wrench(t, x, r, v, w)
        inertia = r @ body.inertia @ r.T
        turn = 0.5 * np.append(q[3] * w + np.cross(w, q[:3]), -w @ q[:3])
        return np.concatenate(
            [v, turn, force / body.mass, np.linalg.solve(inertia, torque - np.cross(w, inertia @ w))]
        )

    start = np.concatenate([state.position, state.quaternion, state.velocity, state.angular_velocity])
    found = solve_ivp(
        slope,
        interval,
        start,
        method="DOP853",
        events=lambda t, y: value(t, *parts(y)),
        max_step=0.05,
        **TIGHT,
    )
    assert found.success
    return np.asarray(found.y[:, -1]), np.asarray(found.t_events[0])


@pytest.mark.parametrize("name", PROBLEMS)
def test_ends_and_events_are_those_of_scipy(name: str) -> None:
    body, start, wrench, value = PROBLEMS[name]
    end, times = by_scipy(body, start, (0.0, 2.0), wrench, value)
    options: dict[str, Any] = {"forces": of_state(wrench), "events": of_state(value), **TIGHT}
    motion = integrate(body, start, (0.0, 2.0), **options)
    assert motion.t_events is not None and motion.y_events is not None
    # what is zero at the start is an event of SciPy's there, and none here
    times = times[times > 0.0]
    assert len(times) > 0
    np.testing.assert_allclose(motion.t_events[0], times, rtol=0.0, atol=1e-9)
    turn = motion.orientation[-1].inv() * Rotation.from_quat(end[3:7])
    assert turn.magnitude() < 1e-9
    last = np.concatenate([motion.position[-1], motion.velocity[-1], motion.angular_velocity[-1]])
    np.testing.assert_allclose(last, np.concatenate([end[:3], end[7:]]), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(
        [of_state(value)(t, s) for t, s in zip(*both(motion), strict=True)], 0.0, atol=1e-9
    )
    # And back: the same events in the opposite order.
    back = integrate(body, motion[-1], (2.0, 0.0), **options)
    assert back.t_events is not None and back.t[-1] == 0.0 and (np.diff(back.t) < 0.0).all()
    inner = back.t_events[0][back.t_events[0] > 1e-6]
    np.testing.assert_allclose(inner[::-1], times, rtol=0.0, atol=2e-9)
    assert (back.orientation[-1].inv() * start.orientation).magnitude() < 1e-9
    np.testing.assert_allclose(back.angular_velocity[-1], start.angular_velocity, rtol=0.0, atol=1e-8)


def both(motion: somersault.Solution) -> tuple[Array, somersault.Trajectory]:
    """Times and states of the first function's events."""
    assert motion.t_events is not None and motion.y_events is not None
    return motion.t_events[0], motion.y_events[0]


# ------------------------------------------------------------------------------------------ SciPy's cases


@pytest.mark.parametrize("steps", [{"dt": 0.3, "method": "rkmk8"}, TIGHT], ids=["fixed", "adapted"])
def test_terminal_and_direction_are_those_of_scipy(steps: dict[str, Any]) -> None:
    def run(*events: Callable[..., float]) -> somersault.Solution:
        return integrate(BALL, AT_ONE, (0.0, 20.0), forces=SPRING, events=events, **steps)

    zeros = np.pi * (np.arange(6) + 0.5)
    motion = run(
        at_x, event(lambda t, s: at_x(t, s), direction=1), event(lambda t, s: at_x(t, s), direction=-1)
    )
    assert motion.status == 0 and motion.t_events is not None
    for found, expected in zip(motion.t_events, (zeros, zeros[1::2], zeros[::2]), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6)
    assert motion.t[-1] == 20.0
    free = integrate(BALL, AT_ONE, (0.0, 20.0), forces=SPRING, **steps)
    assert free[-1] == motion[-1] and len(free) == len(motion)
    for terminal, direction, last in [(True, 0, 0), (1, 1, 1), (3, 0, 2), (2, -1, 2), (np.True_, 0, 0)]:
        motion = run(
            lambda t, s: t - 4.0, event(lambda t, s: at_x(t, s), terminal=terminal, direction=direction)
        )
        assert motion.status == 1 and motion.success and "events[1]" in motion.message
        assert motion.t[-1] == pytest.approx(zeros[last], abs=1e-6)
        assert motion.t_events is not None and motion.y_events is not None
        assert motion.t_events[1][-1] == motion.t[-1] and motion.y_events[1][-1] == motion[-1]
        assert len(motion.t_events[0]) == (zeros[last] > 4.0)
    for terminal in (False, 0, None, 99):
        assert run(event(lambda t, s: at_x(t, s), terminal=terminal)).status == 0


def test_one_event_for_a_zero_at_the_end_of_a_step_and_none_at_the_start() -> None:
    def run(function: Callable[..., float]) -> list[float]:
        return list(both(integrate(BALL, AT_ONE, (0.0, 1.0), dt=0.25, events=function))[0])

    assert run(lambda t, s: t - 0.5) == [0.5]
    assert run(lambda t, s: t) == run(lambda t, s: -t * t) == run(lambda t, s: 0.0) == []
    assert run(lambda t, s: t * (t - 0.6)) == pytest.approx([0.6], abs=1e-15)
    assert run(lambda t, s: (t - 0.6) ** 2) == run(lambda t, s: (t - 0.5) ** 2) == []
    assert run(lambda t, s: (t - 0.6) ** 2 - 1e-10) == pytest.approx([0.6 - 1e-5, 0.6 + 1e-5], abs=1e-10)


def test_a_terminal_event_backwards_counts_its_direction_along_the_run() -> None:
    # As in SciPy: back from 10 the next fall of cos t along the run is at 1.5 π.
    falls = event(lambda t, s: at_x(t, s), terminal=True, direction=-1)
    end = State(position=(np.cos(10.0), 0.0, 0.0), velocity=(-np.sin(10.0), 0.0, 0.0))
    motion = integrate(
        BALL,
        end,
        (10.0, 0.0),
        forces=SPRING,
        events=falls,
        t_eval=[10.0, 9.5, 5.0, 4.0],
        dense_output=True,
        **TIGHT,
    )
    assert motion.status == 1 and both(motion)[0] == pytest.approx([1.5 * np.pi], abs=1e-9)
    assert motion.t.tolist() == [10.0, 9.5, 5.0]
    np.testing.assert_allclose(motion.position[:, 0], np.cos(motion.t), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(motion.velocity[:, 0], -np.sin(motion.t), rtol=0.0, atol=1e-9)
    assert motion.sol is not None and (motion.sol.t_min, motion.sol.t_max) == (motion.t_events[0][-1], 10.0)
    assert motion.sol(7.0).position[0] == pytest.approx(np.cos(7.0), abs=1e-9)
    with pytest.raises(InputError, match="`t` must be within the times integrated"):
        motion.sol(4.0)


def test_several_bodies_trees_and_contacts_have_events() -> None:
    pair = [State(), State(position=(1.0, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0))]
    meets = event(
        lambda t, states: float(states[1].position[0] - states[0].position[0]) - 0.25, terminal=True
    )
    motion = integrate([BALL, BALL], pair, (0.0, 2.0), dt=0.1, events=meets)
    assert motion.t[-1] == pytest.approx(0.75, abs=1e-14) and motion.y_events is not None
    assert motion.y_events[0].position.shape == (1, 2, 3)

    arm = multibody.two_link_arm()
    down = event(lambda t, q, v: float(q[0] - 0.2), terminal=2)
    tree = multibody.integrate_tree(
        arm,
        [0.0, 0.3],
        [1.0, 0.0],
        (0.0, 20.0),
        torque=lambda t, q, v: -q,
        events=down,
        t_eval=[0.1, 19.0],
        **TIGHT,
    )
    assert tree.status == 1 and tree.t.tolist() == [0.1] and tree.q.shape == (1, 2)
    assert tree.t_events is not None and tree.q_events is not None and tree.v_events is not None
    assert len(tree.t_events[0]) == 2 and tree.q_events[0][:, 0] == pytest.approx([0.2, 0.2], abs=1e-12)
    assert tree.v_events[0][0, 0] > 0.0 > tree.v_events[0][1, 0]
    again = pickle.loads(pickle.dumps(tree))
    assert (again.q_events[0] == tree.q_events[0]).all() and again.t_events[0][0] == tree.t_events[0][0]

    # A ball on stiff ground without damping is highest again as long after its bounce as it fell before.
    ball = bouncing_ball(1.0, 0.1, CompliantLaw(1e4), height=0.2)
    high = event(lambda t, s: float(s.velocity[2]), direction=-1, terminal=True)
    bounce: dict[str, Any] = {"forces": ball.forces, "contacts": ball.contacts, "events": high}
    for steps in ({"dt": 2e-3, "method": "rkmk8"}, TIGHT):
        motion = integrate(ball.body, ball.state, (0.0, 2.0), **steps, **bounce)
        assert [e.kind for e in motion.events] == ["touch_down", "release"]
        contact = motion.events[1].t - motion.events[0].t
        assert motion.t[-1] == pytest.approx(2.0 * motion.events[0].t + contact, abs=1e-9)
        assert motion.position[-1] == pytest.approx(ball.state.position, abs=1e-9)


def test_every_method_runs_backwards(body: RigidBody, state: State) -> None:
    spring = forces.Spring(20.0, (0.2, 0.1, 2.0), (0.3, -0.2, 0.4))
    for method in somersault.methods():
        acting = [FALL] if method.scope == "torque-free" else [FALL, spring]
        orders = (*method.orders.values(), *method.rate_orders.values())
        order = min(order for order in orders if order is not None)
        there = integrate(body, state, (0.0, 0.5), method="rkmk8_b", forces=acting, **TIGHT)
        errors = []
        for steps in (50, 100):
            back = integrate(body, there[-1], (0.5, 0.0), dt=0.5 / steps, method=method, forces=acting)[-1]
            of_velocity = np.linalg.norm(back.velocity - state.velocity)
            errors.append(of_velocity + np.linalg.norm(back.angular_velocity - state.angular_velocity))
        assert errors[1] < 1e-9 or np.log2(errors[0] / errors[1]) > order - 0.4, (method, errors)


def test_a_tree_is_followed_back_in_time() -> None:
    # a damper drives it backwards, so that errors grow
    arm = multibody.two_link_arm(damping=(0.03, 0.02))

    def push(t: float, q: Any, v: Any) -> Any:
        return np.array([np.sin(3.0 * t), -0.5 * v[0]])

    def crosses(t: float, q: Any, v: Any) -> float:
        return float(q[1] - 0.2)

    there = multibody.integrate_tree(
        arm, [0.0, 0.3], [1.0, 0.0], (0.0, 2.0), torque=push, events=crosses, dense_output=True, **TIGHT
    )
    for method, tolerance, allowed in (("rkmk8", 1e-12, 1e-8), ("rkmk5", 1e-10, 1e-6)):
        back = multibody.integrate_tree(
            arm,
            there.q[-1],
            there.v[-1],
            (2.0, 0.0),
            method=method,
            torque=push,
            events=crosses,
            t_eval=[2.0, 1.3, 0.4, 0.0],
            dense_output=True,
            rtol=tolerance,
            atol=tolerance,
        )
        assert back.success and back.t.tolist() == [2.0, 1.3, 0.4, 0.0]
        for q, v, t in zip(back.q, back.v, back.t, strict=True):
            then = there.sol(t)
            np.testing.assert_allclose(q, then[0], atol=allowed)
            np.testing.assert_allclose(v, then[1], atol=allowed)
        assert back.t_events[0] == pytest.approx(there.t_events[0][::-1], abs=allowed) and len(
            back.t_events[0]
        )
        assert (back.sol.t_min, back.sol.t_max) == (0.0, 2.0)
    held = {"active": ["lower"], "acceleration": lambda t, q, v: np.array([0.0, np.cos(t) - v[1]])}
    there = multibody.integrate_tree(arm, [0.0, 0.3], [1.0, 0.0], (0.0, 1.0), **held, **TIGHT)
    back = multibody.integrate_tree(arm, there.q[-1], there.v[-1], (1.0, 0.0), **held, **TIGHT)
    np.testing.assert_allclose([*back.q[-1], *back.v[-1]], [0.0, 0.3, 1.0, 0.0], atol=1e-8)
    page = somersault.viewer.Scene().add(back).html()
    assert len(page) > 1000


def test_contacts_and_knots_of_trees_run_forwards_only() -> None:
    leg = contact.hopping_leg()
    with pytest.raises(InputError, match="`interval` must run forward where there are contacts"):
        multibody.integrate_tree(leg.model, leg.q, leg.v, (0.1, 0.0), contacts=leg.contacts)
    push = multibody.TorqueProfile([0.0, 0.1], np.zeros((2, 2)))
    with pytest.raises(
        InputError, match="`torque` must be numbers or a callable where `interval` runs backwards"
    ):
        multibody.integrate_tree(multibody.cart_pendulum(), [0, 0], [0, 0], (0.1, 0.0), torque=push)


# ------------------------------------------------------------------------------------------ certified events


@pytest.mark.parametrize("steps", [{"dt": 0.5, "method": "rkmk8"}, {"dt": 0.5, "method": "ab4"}, TIGHT])
def test_with_a_lipschitz_constant_no_event_is_missed(steps: dict[str, Any]) -> None:
    # x = cos t passes 0.3 within 1e-7, for 1e-6 of a step
    def near(t: float, state: State) -> float:
        return abs(at_x(t, state) - 0.3) - 2.5e-7

    given: dict[str, Any] = {"forces": SPRING, **steps}
    motion = integrate(BALL, AT_ONE, (0.0, 2.0), events=near, **given)
    assert motion.t_events is not None and len(motion.t_events[0]) == 0 and motion.certified == (False,)
    given["events"] = [at_x, event(lambda t, s: near(t, s), lipschitz=1.01)]
    motion = integrate(BALL, AT_ONE, (0.0, 2.0), **given)
    assert motion.t_events is not None and [len(found) for found in motion.t_events] == [1, 2]
    assert abs(motion.t_events[1] - np.arccos(0.3)).max() < 1e-2
    assert np.diff(motion.t_events[1])[0] == pytest.approx(5e-7 / np.sqrt(0.91), rel=2e-3)
    assert (motion.certified, motion.unproved) == ((False, True), (None, None))
    back = integrate(BALL, motion[-1], (2.0, 0.0), **given)
    assert back.t_events is not None and len(back.t_events[1]) == 2 and back.certified == (False, True)


def test_what_is_not_proved_is_not_certified() -> None:
    touch = event(lambda t, s: (t - 0.55) ** 2, lipschitz=2.0)
    crosses = event(lambda t, s: t - 0.57, lipschitz=1.0)
    motion = integrate(BALL, AT_ONE, (0.0, 1.0), dt=0.5, events=[touch, crosses])
    assert motion.certified == (False, True) and motion.unproved == ((0.5, 1.0), None)
    assert motion.t_events is not None and [len(found) for found in motion.t_events] == [0, 1]
    again = pickle.loads(pickle.dumps(motion))
    assert (again.certified, again.unproved) == (motion.certified, motion.unproved)
    assert integrate(BALL, AT_ONE, (0.0, 1.0), dt=0.5).certified is None
    arm = multibody.two_link_arm()
    there = multibody.integrate_tree(
        arm, [0.0, 0.3], [1.0, 0.0], (0.0, 1.0), dt=0.5, events=event(lambda t, q, v: t - 0.7, lipschitz=1.0)
    )
    assert there.certified == (True,) and there.unproved == (None,) and len(there.t_events[0]) == 1
    again = pickle.loads(pickle.dumps(there))
    assert again.certified == (True,) and again.t_events[0] == there.t_events[0]


# ------------------------------------------------------------------------------------------ given times


def test_states_at_given_times_are_those_of_the_motion() -> None:
    start = State(angular_velocity=(0.1, 3.0, 0.2))
    times = np.linspace(0.0, 3.0, 17)
    exact = somersault.exact.FreeBody(BOX, start)(times)
    for method in ("rkmk8_b", "pmv8", "rkmk5"):
        motion = integrate(BOX, start, (0.0, 3.0), dt=0.04, method=method, t_eval=times, dense_output=True)
        assert (motion.t == times).all() and motion.n_steps == 75
        assert (motion.orientation.inv() * exact.orientation).magnitude().max() < 1e-6
        assert motion.sol is not None and motion.sol(0.5).quaternion.shape == (4,)
    late = integrate(BOX, start, (0.0, 3.0), dt=0.1, t_eval=[2.5], dense_output=True)
    assert (
        late.t.tolist() == [2.5] and late.sol is not None and (late.sol.t_min, late.sol.t_max) == (0.0, 3.0)
    )
    with_contact = integrate(
        BALL,
        State(position=(0.0, 0.0, 0.2)),
        (0.0, 0.5),
        dt=0.01,
        forces=FALL,
        t_eval=[0.1, 0.3],
        contacts=GROUND,
    )
    assert with_contact.gaps is not None and with_contact.gaps.shape == (2, 1)
    ends = integrate(
        BALL, AT_ONE, (0.0, 1.0), dt=0.1, t_eval=[0.9], events=event(lambda t, s: t - 0.5, terminal=True)
    )
    assert len(ends) == 0 and ends.status == 1 and repr(ends) and len(pickle.loads(pickle.dumps(ends))) == 0


# ------------------------------------------------------------------------------------------ what is refused


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"t_eval": []}, "`t_eval` must have at least 1 entries"),
        ({"t_eval": [0.0, 2.0]}, "`t_eval` must be within `interval`, found 2"),
        ({"t_eval": [0.5, 0.5]}, "`t_eval` must be times that follow each other in the direction of the run"),
        ({"t_eval": [np.nan]}, "`t_eval` must be finite"),
        ({"t_eval": [[0.1]]}, "`t_eval` must be a real number or numbers of shape"),
        ({"t_eval": [0.5], "every": 2}, "give one of them"),
        ({"interval": (1.0, 1.0)}, "must lead from one finite time to another"),
        ({"interval": (1.0, 0.0), "contacts": GROUND}, "must run forward"),
        ({"interval": (1.0, 0.0), "dt": -0.1}, "`dt` must be positive"),
        ({"events": 3.0}, "`events` must be a callable"),
        ({"events": [at_x, "x"]}, "`events` must be a callable"),
        ({"events": event(lambda t, s: 1.0, terminal=-1)}, "`terminal` of the event function"),
        ({"events": event(lambda t, s: 1.0, terminal=1.5)}, "`terminal` of the event function"),
        ({"events": event(lambda t, s: 1.0, direction="up")}, "`direction` of the event function"),
        ({"events": event(lambda t, s: 1.0, direction=np.nan)}, "`direction` of the event function"),
        ({"events": event(lambda t, s: 1.0, lipschitz=-1.0)}, "event function .* not negative, found -1.0"),
        ({"events": event(lambda t, s: 1.0, lipschitz=np.inf)}, "`lipschitz` of the event function"),
        ({"events": event(lambda t, s: 1.0, lipschitz=True)}, "`lipschitz` of the event function"),
        ({"events": event(lambda t, s: 1.0, lipschitz="1")}, "`lipschitz` of the event function"),
        ({"events": [at_x, event(lambda t, s: 3 * t - 1, lipschitz=2.9)]}, r"= 2.9 of `events\[1\]`"),
        ({"events": lambda t, s: "one"}, r"must return a real number, found .* at t = 0"),
        ({"events": [at_x, lambda t, s: np.nan if t > 0.45 else 1.0]}, r"`events\[1\]` .* NaN at t = 0.5"),
    ],
)  # fmt: skip
def test_what_is_not_allowed_is_named(options: dict[str, Any], message: str) -> None:
    arguments = {"interval": (0.0, 1.0), "dt": 0.1, **options}
    with pytest.raises(InputError, match=message):
        integrate(BALL, AT_ONE, arguments.pop("interval"), **arguments)


def test_what_an_event_raises_comes_out_with_the_solution_so_far() -> None:
    def fails(t: float, state: State) -> float:
        if t > 0.55:
            raise ZeroDivisionError("on purpose")
        return t - 0.2

    with pytest.raises(ZeroDivisionError, match="on purpose") as raised:
        integrate(BALL, AT_ONE, (0.0, 1.0), dt=0.1, events=fails)
    solution = raised.value.solution  # type: ignore[attr-defined]
    assert solution.status == -2 and solution.t[-1] == pytest.approx(0.5)
    assert solution.t_events[0] == pytest.approx([0.2])
    (note,) = raised.value.__notes__
    who, t = note.split(" at t = ")
    assert who == f"raised by `events[0]` ({fails.__qualname__})" and float(t) > 0.55


def test_solutions_with_events_are_pickled_and_drawn() -> None:
    motion = integrate(BALL, AT_ONE, (0.0, 5.0), dt=0.1, forces=SPRING, events=[at_x, lambda t, s: 1.0])
    again = pickle.loads(pickle.dumps(motion))
    assert (again.t_events[0] == both(motion)[0]).all() and len(again.t_events[1]) == 0
    assert again.y_events[0][1] == both(motion)[1][1] and len(again.y_events[1]) == 0
    assert integrate(BALL, AT_ONE, (0.0, 1.0), dt=0.1).t_events is None
    page = somersault.viewer.Scene("ball").add(motion, shapes=somersault.viewer.Sphere(0.1)).html()
    assert "ball" in page
    back = integrate(BALL, motion[-1], (5.0, 0.0), dt=0.1, forces=SPRING, dense_output=True)
    drawn = [
        somersault.viewer.Scene().add(shown).html() for shown in (back, pickle.loads(pickle.dumps(back)))
    ]
    assert all(len(page) > 1000 for page in drawn)
