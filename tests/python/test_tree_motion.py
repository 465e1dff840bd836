"""Motion of trees: closed forms, conservation, driven joints, bad input."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from somersault import Model, RigidBody, State, errors, exact, multibody
from somersault.multibody import Link, TreeSolution, integrate_tree

Array = NDArray[np.float64]
G = 9.81


def raises(error: type[Exception], part: str, call: Callable[[], object]) -> Exception:
    with pytest.raises(error) as caught:
        call()
    assert part in str(caught.value)
    assert type(caught.value) is error
    return caught.value


def by_dop853(model: Model, q: list[float], v: list[float], torque: Any, end: float) -> Array:
    """Positions and velocities of revolute and prismatic joints at the end, by an integrator not ours."""
    n = model.n_velocities

    def slope(t: float, y: Array) -> Array:
        a = model.forward_dynamics(y[:n], y[n:], torque(t, y[:n], y[n:]))
        return np.concatenate([y[n:], a])

    solved = solve_ivp(slope, (0, end), [*q, *v], method="DOP853", rtol=1e-13, atol=1e-13)
    return np.asarray(solved.y[:, -1])


def spring(t: float, q: Array, v: Array) -> tuple[float, float]:
    return -30.0 * q[0] + np.sin(3.0 * t), -0.1 * v[1]


def test_a_cart_on_a_spring_agrees_with_dop853() -> None:
    cart = multibody.cart_pendulum()
    expected = by_dop853(cart, [0.0, 0.1], [0.3, 0.0], spring, 2.0)

    def error(**options: Any) -> float:
        motion = integrate_tree(cart, [0.0, 0.1], [0.3, 0.0], (0.0, 2.0), torque=spring, **options)
        return float(np.abs(np.concatenate([motion.q[-1], motion.v[-1]]) - expected).max())

    coarse, fine = error(dt=0.01), error(dt=0.005)
    assert fine < 1e-7
    assert np.log2(coarse / fine) > 3.7
    assert error(rtol=1e-11, atol=1e-12) < 1e-9
    assert error(dt=0.01, method="rkmk8") < 1e-11


def test_a_free_body_turns_as_the_exact_one_does() -> None:
    box = RigidBody.box(1.0, (0.2, 0.4, 0.6))
    model = Model([Link("box", "free", body=box)])
    start = State((0, 0, 1), velocity=(1.0, 0, 2.0), angular_velocity=(1.0, 2.0, 3.0))
    q = [*start.position, *start.quaternion]
    # Joint velocities are in the axes of the body.
    v = [*start.velocity, *start.angular_velocity_body]
    motion = integrate_tree(model, q, v, (0.0, 2.0), dt=0.01, method="rkmk8")
    there = exact.FreeBody(box, start)(2.0)
    np.testing.assert_allclose(motion.q[-1][:3], there.position - [0, 0, G * 2.0], atol=1e-12)
    turned = State(orientation=motion.q[-1][3:]).orientation
    assert (turned.inv() * there.orientation).magnitude() < 1e-11
    np.testing.assert_allclose(motion.v[-1][3:], there.angular_velocity_body, atol=1e-11)


def test_a_diver_in_the_air_keeps_momentum_and_energy() -> None:
    diver = multibody.diver_planar()
    model, q = diver.model, diver.configuration("B")
    v = np.zeros(model.n_velocities)
    v[:3] = 0.5, 3.0, -4.0
    v[5:] = 0.3
    motion = integrate_tree(model, q, v, (0.0, 0.4), dt=1e-3, method="rkmk8")
    momentum = model.centroidal_momentum(motion.q, motion.v)
    np.testing.assert_allclose(momentum[:, 3:], momentum[:1, 3:].repeat(len(motion), 0), atol=1e-9)
    fall = momentum[0, 2] - G * model.mass * motion.t
    np.testing.assert_allclose(momentum[:, 2], fall, rtol=1e-10)
    energy = model.kinetic_energy(motion.q, motion.v) + model.potential_energy(motion.q)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)


def test_driven_joints_follow_and_the_rest_obeys() -> None:
    arm = multibody.two_link_arm()

    def swing(t: float, q: Array, v: Array) -> tuple[float, float]:
        return 99.0, -4.0 * np.sin(2.0 * t)  # the first is not read

    motion = integrate_tree(
        arm, [0.1, 0.2], [0.0, 2.0], (0.0, 1.0), dt=0.01, method="rkmk8", active=["lower"], acceleration=swing
    )
    np.testing.assert_allclose(motion.q[:, 1], 0.2 + np.sin(2.0 * motion.t), atol=1e-12)
    # The upper joint is free but for its damping: inverse dynamics of the whole motion says so.
    a, _ = arm.hybrid_dynamics(
        motion.q, motion.v, -4.0 * np.sin(2.0 * motion.t)[:, None] * [0, 1], [0, 0], ["lower"]
    )
    np.testing.assert_allclose(arm.inverse_dynamics(motion.q, motion.v, a)[:, 0], 0.0, atol=1e-12)
    rate = np.gradient(motion.v[:, 0], motion.t)
    np.testing.assert_allclose(rate[2:-2], a[2:-2, 0], atol=2e-3)
    flags = integrate_tree(
        arm,
        [0.1, 0.2],
        [0.0, 2.0],
        (0.0, 1.0),
        dt=0.01,
        method="rkmk8",
        active=[False, True],
        acceleration=swing,
    )
    np.testing.assert_array_equal(flags.q, motion.q)


def test_constant_forces_dense_output_and_records() -> None:
    slider = Model([Link("slider", "prismatic", axis=(1, 0, 0), mass=2.0)])
    motion = integrate_tree(
        slider, [1.0], [0.5], (0.0, 2.0), dt=0.1, torque=[4.0], dense_output=True, every=6
    )
    np.testing.assert_allclose(motion.t, [0.0, 0.6, 1.2, 1.8, 2.0])
    np.testing.assert_allclose(motion.q[:, 0], 1.0 + 0.5 * motion.t + motion.t**2, atol=1e-13)
    assert (motion.status, motion.success, motion.n_steps) == (0, True, 20)
    assert integrate_tree(slider, [1.0], [0.5], (0.0, 2.0), dt=0.1, torque=[4.0]).nfev == 80
    assert motion.sol is not None and motion.model == slider
    q, v = motion.sol(0.77)
    assert (q.shape, v.shape) == ((1,), (1,))
    assert q[0] == pytest.approx(1.0 + 0.5 * 0.77 + 0.77**2, abs=1e-13)
    q, v = motion.sol([0.1, 0.2])
    np.testing.assert_allclose(v[:, 0], [0.7, 0.9], atol=1e-13)
    raises(
        errors.InputError,
        "`t` must be within the times integrated, 0 to 2, found 2.1",
        lambda: motion.sol(2.1),
    )  # type: ignore[misc]
    again = pickle.loads(pickle.dumps(motion))
    assert isinstance(again, TreeSolution)
    np.testing.assert_array_equal(again.q, motion.q)
    assert (again.message, again.sol, len(again)) == (motion.message, None, 5)


def test_an_observer_sees_every_step_and_can_stop() -> None:
    seen = []

    def observer(t: float, q: Array, v: Array) -> bool:
        seen.append((t, q.shape, v.shape))
        return t > 0.25

    diver = multibody.diver_spatial()
    q, v = diver.configuration("A"), np.zeros(27)
    motion = integrate_tree(diver.model, q, v, (0.0, 1.0), dt=0.1, observer=observer)
    assert seen == [(pytest.approx(t), (28,), (27,)) for t in (0.1, 0.2, 0.3)]
    assert motion.status == 1


def test_what_fails_leaves_what_was_before() -> None:
    cart = multibody.cart_pendulum()

    def late(t: float, q: Array, v: Array) -> tuple[float, float]:
        if t > 0.5:
            raise LookupError("no force there")
        return 0.0, 0.0

    def run(torque: Any, **options: Any) -> Callable[[], object]:
        given = {"dt": 0.1, "torque": torque} | options
        return lambda: integrate_tree(cart, [0, 0.1], [0, 0], (0, 1), **given)

    caught = raises(LookupError, "no force there", run(late))
    assert len(caught.solution) == 6  # type: ignore[attr-defined]
    caught = raises(
        errors.InputError, "(t, q, v)` must be finite, found NaN", run(lambda t, q, v: (0, np.nan))
    )
    assert caught.solution.status == -2  # type: ignore[attr-defined]
    raises(errors.InputError, "(t, q, v)` must be real numbers of shape (2,)", run(lambda t, q, v: (0, 0, 0)))
    # The second joint moves no mass about its own axis.
    links = [
        Link("first", "prismatic", axis=(1, 0, 0), mass=1.0),
        Link("second", "revolute", parent="first", axis=(1, 0, 0), mass=1.0),
    ]
    singular = Model(links)
    raises(
        errors.DynamicsError,
        "singular, or not finite, at joint `second`",
        lambda: integrate_tree(singular, [0, 0], [0, 0], (0, 1), dt=0.1),
    )


def test_bad_arguments_are_refused() -> None:
    cart = multibody.cart_pendulum()

    def run(q: Any = (0, 0), v: Any = (0, 0), **options: Any) -> Callable[[], object]:
        given = {"dt": 0.1} | options
        return lambda: integrate_tree(cart, q, v, (0, 1), **given)

    raises(errors.InputError, "`q` must be real numbers of shape (2,), found shape (1,)", run(q=[0]))
    raises(errors.InputError, "`v` must be finite, found NaN", run(v=[0, np.nan]))
    raises(errors.InputError, "`torque` must be real numbers of shape (2,)", run(torque=[1]))
    raises(errors.InputError, "`acceleration` is that of `active`", run(acceleration=[1, 1]))
    raises(errors.InputError, "no body is named `lid`", run(active=["lid"]))
    raises(errors.InputError, "method `rkmk_b` is for rigid bodies only", run(method="rkmk_b"))
    raises(errors.InputError, "`ab4` has no error estimate", run(dt=None, method="ab4"))
    raises(errors.InputError, "`observer` must be a callable f(t, q, v)", run(observer=3))
    raises(errors.InputError, "`every` must be a positive number", run(every=0))


def throw(diver: multibody.Diver) -> tuple[Array, Array, Callable[[float], tuple[Array, Array, Array]]]:
    """A diver in layout who lowers one arm and raises the other, as position, velocity and acceleration."""
    q, root = diver.configuration("C"), 7
    start, end = q[root:], diver.configuration("E")[root:]

    def shape(t: float) -> tuple[Array, Array, Array]:
        w = np.pi / 0.5
        blend, rate = (1 - np.cos(w * t)) / 2, w * np.sin(w * t) / 2
        way = end - start
        return start + blend * way, rate * way, w**2 * np.cos(w * t) / 2 * way

    v = np.zeros(diver.model.n_velocities)
    v[:6] = 0.5, 0.0, 3.0, 0.1, -6.0, 0.2
    return q, v, shape


def test_flight_is_the_motion_of_driven_joints_with_momentum_as_it_was() -> None:
    diver = multibody.diver_spatial()
    model = diver.model
    q, v, shape = throw(diver)
    flown = multibody.fly(model, q, v, lambda t: shape(t)[:2], (0.0, 0.5), dt=0.01, method="rkmk8")
    driven = integrate_tree(
        model, q, v, (0.0, 0.5), dt=0.01, method="rkmk8",
        active=[name for name in model.names if name != "torso"],
        acceleration=lambda t, q, v: np.concatenate([np.zeros(6), shape(t)[2]]),
    )  # fmt: skip
    np.testing.assert_allclose(flown.q[-1], driven.q[-1], atol=1e-8)
    momentum = model.centroidal_momentum(flown.q, flown.v)
    size = np.linalg.norm(momentum[0, 3:])
    np.testing.assert_allclose(momentum[:, 3:] - momentum[0, 3:], 0.0, atol=1e-13 * size)
    centre = model.center_of_mass(flown.q)
    fall = momentum[0, :3] / model.mass * flown.t[:, None] - 0.5 * G * flown.t[:, None] ** 2 * [0, 0, 1]
    np.testing.assert_allclose(centre, centre[0] + fall, atol=1e-13)
    # The throw has tilted the diver, though nothing turned from outside about that axis.
    assert flown.nfev > 0 and flown.sol is None
    adapted = multibody.fly(model, q, v, lambda t: shape(t)[:2], (0.0, 0.5), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(adapted.q[-1], driven.q[-1], atol=1e-7)


def test_bad_flights_are_refused() -> None:
    diver = multibody.diver_spatial()
    q, v, shape = throw(diver)

    def fly(shape: Any, model: Model = diver.model, q: Any = q, v: Any = v) -> Callable[[], object]:
        return lambda: multibody.fly(model, q, v, shape, (0.0, 0.5), dt=0.01)

    raises(errors.InputError, "`shape` must be a callable f(t) -> (q, v), found an int", fly(3))
    raises(errors.InputError, "must return a pair (q, v) of shapes (21,) and (21,)", fly(lambda t: 1.0))
    raises(errors.InputError, "(t)[1]` must be finite, found NaN", fly(lambda t: (q[7:], np.nan * v[6:])))
    arm = multibody.two_link_arm()
    raises(
        errors.InputError,
        "the root `upper` must have a free or a planar joint",
        fly(lambda t: ([0], [0]), arm, [0, 0], [0, 0]),
    )

    def late(t: float) -> tuple[Array, Array]:
        if t > 0.25:
            raise LookupError("forgotten")
        return shape(t)[:2]

    caught = raises(LookupError, "forgotten", fly(late))
    kept = caught.solution  # type: ignore[attr-defined]
    assert kept.status == -2 and np.isfinite(kept.q).all() and 0.2 < kept.t[-1] <= 0.25


def test_rollouts_are_motions_of_copies_alone() -> None:
    pole, rng = multibody.cart_pendulum(), np.random.default_rng(20261127)
    q, v = rng.normal(size=(18, 2)), rng.normal(size=(18, 2))
    torque = rng.normal(0.0, 3.0, (18, 3, 2)) * [1.0, 0.0]
    t, positions, velocities = multibody.rollout(pole, q, v, (0.0, 0.29), 0.1, torque=torque)
    np.testing.assert_allclose(t, [0.0, 0.1, 0.2, 0.29], atol=1e-15)
    assert positions.shape == velocities.shape == (18, 4, 2)
    for k in (0, 15, 16, 17):
        x = (q[k], v[k])
        for step in range(3):
            interval = (t[step], t[step + 1])
            held = integrate_tree(
                pole, *x, interval, dt=interval[1] - interval[0], method="rkmk", torque=torque[k, step]
            )
            x = (held.q[-1], held.v[-1])
            np.testing.assert_allclose(positions[k, step + 1], x[0], atol=1e-13)
            np.testing.assert_allclose(velocities[k, step + 1], x[1], atol=1e-13)


def test_one_state_and_one_torque_stand_for_all_copies() -> None:
    arm = multibody.two_link_arm()
    n = arm.n_velocities
    q, v, torque = (
        np.full(n, 0.3),
        np.zeros(n),
        np.linspace(-1.0, 1.0, 20)[:, None, None] * np.ones((20, 1, n)),
    )
    t, positions, _ = multibody.rollout(arm, q, v, (0.0, 1.0), 0.01, torque=torque, every=100)
    assert t.tolist() == [0.0, 1.0]
    alone = [multibody.rollout(arm, q, v, (0.0, 1.0), 0.01, torque=one[0])[1][0, -1] for one in torque]
    np.testing.assert_array_equal(positions[:, -1], alone)
    assert multibody.rollout(arm, q, [v] * 3, (0.0, 1.0), 0.1)[1].shape == (3, 11, n)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"q": [0.0]}, errors.InputError, r"`q` must be real numbers of shape \(2,\) or \(n, 2\)"),
        ({"v": [np.nan, 0.0]}, errors.InputError, "`v` must be finite, found NaN"),
        ({"q": np.zeros((0, 2))}, errors.InputError, "`q` must be of at least one copy, found none"),
        (
            {"q": np.zeros((2, 2)), "torque": np.zeros((3, 50, 2))},
            errors.InputError,
            "`torque` must be of one copy or of the 2 of `q`, found 3",
        ),
        (
            {"torque": np.zeros((3, 49, 2))},
            errors.InputError,
            "`torque` must be of one step or of the 50 of `interval` and `dt`, found 49",
        ),
        ({"torque": spring}, errors.InputError, "found a function; `integrate_tree` takes functions"),
        ({"interval": (1.0, 0.0)}, errors.InputError, "`interval` must run forward"),
        ({"every": 0}, errors.InputError, "`every` must be a positive number of steps, found 0"),
        ({"dt": 1e-9}, errors.InputError, "the states of the copies .* GB of memory, more than there is"),
        ({"v": [[0.0, 0.0], [1e200, 1e200]]}, errors.DynamicsError, "copy 1: .* mass matrix"),
    ],
)
def test_rollouts_that_are_none(options: dict[str, Any], error: type[Exception], message: str) -> None:
    given = {"q": [0.0, 0.1], "v": [0.0, 0.0], "interval": (0.0, 0.5), "dt": 0.01, **options}
    if "dt" in options:
        given["q"] = np.zeros((1000, 2))
    with pytest.raises(error, match=message):
        multibody.rollout(multibody.cart_pendulum(), **given)
