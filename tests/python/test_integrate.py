"""Integrations agree with SciPy's DOP853 on quaternions, and their options do what they say."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import somersault
from somersault import RigidBody, State, forces, integrate

Array = NDArray[np.float64]
ANCHOR, ATTACHMENT = np.array([0.2, 0.1, 2.0]), np.array([0.3, -0.2, 0.4])
STIFFNESS, DAMPING, REST = 20.0, 0.5, 0.7
GRAVITY = np.array([0.0, 0.0, -9.81])
DRAG = 0.8


def spring_and_drag(x: Array, rotation: Rotation, v: Array, omega: Array, mass: float) -> tuple[Array, Array]:
    """Force and torque of the test problem, written out."""
    arm = rotation.apply(ATTACHMENT)
    span = x + arm - ANCHOR
    length = np.linalg.norm(span)
    along = span / length
    force = -(STIFFNESS * (length - REST) + DAMPING * along @ (v + np.cross(omega, arm))) * along
    return force + mass * GRAVITY - DRAG * v, np.cross(arm, force)


def gravity_only(x: Array, rotation: Rotation, v: Array, omega: Array, mass: float) -> tuple[Array, Array]:
    """Force and torque of the problem for methods that take no torque."""
    return mass * GRAVITY, np.zeros(3)


def reference(body: RigidBody, state: State, end: float, wrench: Callable[..., tuple[Array, Array]]) -> Array:
    """Position, quaternion, velocity and angular velocity by DOP853, none of which is ours."""
    inertia, mass = body.inertia, body.mass

    def slope(t: float, y: Array) -> Array:
        x, q, v, omega = y[:3], y[3:7], y[7:10], y[10:]
        rotation = Rotation.from_quat(q)
        force, torque = wrench(x, rotation, v, omega, mass)
        r = rotation.as_matrix()
        world = r @ inertia @ r.T
        alpha = np.linalg.solve(world, torque - np.cross(omega, world @ omega))
        # q' = (ω, 0) q / 2 with the vector part first.
        q_dot = 0.5 * np.append(q[3] * omega + np.cross(omega, q[:3]), -omega @ q[:3])
        return np.concatenate([v, q_dot, force / mass, alpha])

    start = np.concatenate([state.position, state.quaternion, state.velocity, state.angular_velocity])
    solved = solve_ivp(slope, (0.0, end), start, method="DOP853", rtol=1e-13, atol=1e-13)
    assert solved.success
    return np.asarray(solved.y[:, -1])


def distance(state: State, expected: Array) -> float:
    """The largest of the errors in position, angle, velocity and angular velocity."""
    angle = (state.orientation.inv() * Rotation.from_quat(expected[3:7])).magnitude()
    parts = [
        state.position - expected[:3],
        state.velocity - expected[7:10],
        state.angular_velocity - expected[10:],
    ]
    return max(float(angle), *(float(np.linalg.norm(part)) for part in parts))


SPRING = forces.Spring(STIFFNESS, ANCHOR, ATTACHMENT, damping=DAMPING, rest_length=REST)


@pytest.mark.parametrize("method", somersault.methods(), ids=str)
def test_every_method_converges_to_dop853(method: Any, body: RigidBody, state: State) -> None:
    if method.scope == "torque-free":
        acting: list[Any] = [forces.Gravity()]
        expected = reference(body, state, 1.0, gravity_only)
        order = min(method.orders["translation"], method.orders["rotation"])
    else:
        acting = [forces.Gravity(), SPRING, forces.Drag(DRAG)]
        expected = reference(body, state, 1.0, spring_and_drag)
        order = min(method.orders["translation_with_velocity"], method.orders["rotation_with_torque"])

    def error(steps: int) -> float:
        end = integrate(body, state, (0.0, 1.0), dt=1.0 / steps, method=method, forces=acting)[-1]
        return distance(end, expected)

    coarse, fine = error(200), error(400)
    assert fine < 2.0 * (1.0 / 20.0) ** order + 1e-10
    assert fine < 1e-10 or np.log2(coarse / fine) > order - 0.35


@pytest.mark.parametrize("method", [m for m in somersault.methods() if m.embedded_order], ids=str)
def test_adaptive_methods_meet_their_tolerances(method: Any, body: RigidBody, state: State) -> None:
    acting = [forces.Gravity(), SPRING, forces.Drag(DRAG)]
    expected = reference(body, state, 2.0, spring_and_drag)
    loose, tight = (
        integrate(body, state, (0.0, 2.0), method=method, forces=acting, rtol=tol, atol=tol)
        for tol in (1e-5, 1e-8)
    )
    assert distance(tight[-1], expected) < 1e-6
    assert distance(tight[-1], expected) < 0.1 * distance(loose[-1], expected)
    assert tight.n_steps > loose.n_steps
    assert tight.t[-1] == 2.0
    capped = integrate(body, state, (0.0, 2.0), method=method, forces=acting, max_step=0.05, first_step=1e-3)
    assert np.diff(capped.t).max() <= 0.0506
    assert np.diff(capped.t)[0] == pytest.approx(1e-3)
    with pytest.raises(somersault.errors.IntegrationError, match="`max_steps` = 3"):
        integrate(body, state, (0.0, 1e3), method=method, forces=acting, max_steps=3)


@pytest.mark.parametrize("method", [m for m in somersault.methods() if m.embedded_order is None], ids=str)
def test_steps_of_one_step_methods_are_doubled(method: Any, body: RigidBody, state: State) -> None:
    acting = None if method.scope == "torque-free" else [forces.Gravity(), SPRING]

    def run(tolerance: float) -> somersault.Solution:
        return integrate(
            body, state, (0.0, 0.5), method=method, forces=acting, rtol=tolerance, atol=tolerance
        )

    if method.history > 0:
        with pytest.raises(somersault.InputError, match=f"`{method}` has no error estimate and remembers"):
            run(1e-3)
        return
    order = min(order for orders in (method.orders, method.rate_orders) for order in orders.values() if order)
    end = integrate(body, state, (0.0, 0.5), forces=acting, rtol=1e-12, atol=1e-13)[-1]
    precise = np.concatenate([end.position, end.quaternion, end.velocity, end.angular_velocity])
    loose, tight = run(1e-3 if order < 4 else 1e-6), run(1e-4 if order < 4 else 1e-7)
    assert distance(tight[-1], precise) < max(0.5 * distance(loose[-1], precise), 1e-10)
    assert tight.n_steps >= loose.n_steps and tight.t[-1] == 0.5
    if acting is None:
        assert tight.nfev == 3 * method.evaluations * (tight.n_steps + tight.n_rejected)


def test_without_a_step_the_steps_are_adapted(body: RigidBody, state: State) -> None:
    motion = integrate(body, state, (0.0, 5.0))
    exact = somersault.exact.FreeBody(body, state)(5.0)
    assert (motion[-1].orientation.inv() * exact.orientation).magnitude() < 1e-7
    named = integrate(body, state, (0.0, 5.0), method="rkmk8_b", rtol=1e-8, atol=1e-10)
    assert named[-1] == motion[-1]


def test_a_callable_is_the_same_as_the_model_it_spells_out(body: RigidBody, state: State) -> None:
    def force(t: float, x: State) -> tuple[Array, Array]:
        return spring_and_drag(x.position, x.orientation, x.velocity, x.angular_velocity, body.mass)

    models = [forces.Gravity(), SPRING, forces.Drag(DRAG)]
    ours = integrate(body, state, (0.0, 0.2), dt=0.01, forces=models)
    callable_ = integrate(body, state, (0.0, 0.2), dt=0.01, forces=force)
    np.testing.assert_allclose(callable_.position, ours.position, atol=1e-13)
    np.testing.assert_allclose(callable_.quaternion, ours.quaternion, atol=1e-13)
    assert callable_.nfev == ours.nfev


def test_forces_of_a_list_add_up(body: RigidBody, state: State) -> None:
    one = integrate(body, state, (0.0, 1.0), dt=0.01, forces=forces.Force((0.0, 0.0, 3.0), (0.1, 0.0, 0.0)))
    half = forces.Force((0.0, 0.0, 1.5), (0.1, 0.0, 0.0))
    two = integrate(body, state, (0.0, 1.0), dt=0.01, forces=(half, half))
    np.testing.assert_array_equal(one.position, two.position)


def test_shapes_and_times(body: RigidBody, state: State) -> None:
    motion = integrate(body, state, (0.5, 2.0), dt=0.1)
    assert len(motion) == 16
    np.testing.assert_allclose(motion.t, np.linspace(0.5, 2.0, 16), rtol=1e-15)
    assert motion.t[-1] == 2.0
    for name in ("position", "velocity", "angular_velocity", "angular_velocity_body", "angular_momentum"):
        assert getattr(motion, name).shape == (16, 3)
    assert motion.quaternion.shape == (16, 4)
    assert motion.kinetic_energy.shape == motion.rotational_energy.shape == (16,)
    assert len(motion.orientation) == 16
    assert motion[0] == state
    assert motion[-1] == motion[15]
    assert [x.position[0] for x in motion] == list(motion.position[:, 0])
    with pytest.raises(IndexError, match="16 times"):
        motion[16]
    with pytest.raises(IndexError):
        motion[-17]


def test_derived_quantities(body: RigidBody, state: State) -> None:
    motion = integrate(body, state, (0.0, 1.0), dt=0.01)
    r = motion.orientation.as_matrix()
    momentum = np.einsum("tij,jk,tlk,tl->ti", r, body.inertia, r, motion.angular_velocity)
    np.testing.assert_allclose(motion.angular_momentum, momentum, atol=1e-14)
    rotational = 0.5 * np.einsum("ti,ti->t", motion.angular_velocity, momentum)
    np.testing.assert_allclose(motion.rotational_energy, rotational, rtol=1e-14)
    translational = 0.5 * body.mass * np.sum(motion.velocity**2, axis=1)
    np.testing.assert_allclose(motion.kinetic_energy, rotational + translational, rtol=1e-14)
    in_body = motion.orientation.inv().apply(motion.angular_velocity)
    np.testing.assert_allclose(motion.angular_velocity_body, in_body, atol=1e-14)


def test_every_records_less_and_always_the_end(body: RigidBody, state: State) -> None:
    all_steps = integrate(body, state, (0.0, 1.0), dt=0.01)
    some = integrate(body, state, (0.0, 1.0), dt=0.01, every=7)
    np.testing.assert_array_equal(some.t, np.append(all_steps.t[::7], 1.0))
    assert some[-1] == all_steps[-1]
    assert some.n_steps == all_steps.n_steps == 100


def test_nfev_is_a_count(body: RigidBody, state: State) -> None:
    calls = 0

    def force(t: float, x: State) -> tuple[tuple[float, ...], tuple[float, ...]]:
        nonlocal calls
        calls += 1
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.1)

    for method in ("euler", "ab4", "rkmk", "rkmk_b", "rkmk_l", "aso"):
        calls = 0
        for dense in (False, True):
            calls = 0
            motion = integrate(
                body, state, (0.0, 1.0), dt=0.05, method=method, forces=force, dense_output=dense
            )
            assert motion.nfev == calls > 0
    for method in ("rkmk", "rkmk_b", "rkmk_l"):
        assert integrate(body, state, (0.0, 1.0), dt=0.05, method=method).nfev == 80


def test_dense_output_is_of_fourth_order(body: RigidBody, state: State) -> None:
    times = np.linspace(0.0, 1.0, 57)

    def error(steps: int) -> float:
        motion = integrate(body, state, (0.0, 1.0), dt=1.0 / steps, forces=SPRING, dense_output=True)
        assert motion.sol is not None
        fine = integrate(body, state, (0.0, 1.0), dt=1.0 / (56 * 40), forces=SPRING, every=40)
        curve = motion.sol(times)
        assert isinstance(curve, somersault.Trajectory)
        np.testing.assert_array_equal(curve.t, times)
        angle = (curve.orientation.inv() * fine.orientation).magnitude()
        return max(np.abs(curve.position - fine.position).max(), angle.max())

    coarse, fine = error(20), error(40)
    assert fine < 1e-5
    assert np.log2(coarse / fine) > 3.6


def test_dense_output_meets_the_steps_and_keeps_its_limits(body: RigidBody, state: State) -> None:
    motion = integrate(body, state, (0.0, 1.0), dt=0.1, dense_output=True, every=100)
    exact = integrate(body, state, (0.0, 1.0), dt=0.1)
    curve = motion.sol
    assert curve is not None
    assert (curve.t_min, curve.t_max) == (0.0, 1.0)
    for i in (0, 3, 10):
        found = curve(float(exact.t[i]))
        np.testing.assert_allclose(found.position, exact[i].position, atol=1e-14)
        np.testing.assert_allclose(found.angular_velocity, exact[i].angular_velocity, atol=1e-14)
    for t in (-1e-9, 1.0 + 1e-9, np.nan):
        with pytest.raises(somersault.InputError, match="`t` must be within the times integrated, 0 to 1"):
            curve(t)
    assert exact.sol is None


def test_an_observer_sees_every_step_and_can_stop(body: RigidBody, state: State) -> None:
    seen: list[float] = []

    def observer(t: float, x: State) -> bool:
        assert isinstance(x, State)
        seen.append(t)
        return t > 0.45

    motion = integrate(body, state, (0.0, 1.0), dt=0.1, every=3, observer=observer)
    np.testing.assert_allclose(seen, [0.1, 0.2, 0.3, 0.4, 0.5])
    assert (motion.status, motion.success, motion.n_steps) == (1, True, 5)
    assert "stopped by the observer" in motion.message
    np.testing.assert_allclose(motion.t, [0.0, 0.3, 0.5])
    finished = integrate(body, state, (0.0, 1.0), dt=0.1, observer=lambda t, x: None)
    assert (finished.status, finished.message) == (0, "reached the end of the interval")


def test_the_ladder_is_another_start(body: RigidBody, state: State) -> None:
    ladder, one_step = (
        integrate(body, state, (0.0, 1.0), dt=0.1, method="ab4", start_up=start_up)
        for start_up in ("ladder", "one_step")
    )
    assert ladder[-1] != one_step[-1]
    same = [
        integrate(body, state, (0.0, 1.0), dt=0.1, method="rkmk", start_up=start_up)
        for start_up in ("ladder", "one_step")
    ]
    assert same[0][-1] == same[1][-1]


def test_several_bodies_that_do_not_interact_move_as_they_would_alone(body: RigidBody, state: State) -> None:
    other, start = RigidBody.box(1.0, (1, 2, 3)), State(angular_velocity=(3.0, 0.1, -0.2))
    both = integrate(
        [body, other], [state, start], (0.0, 1.0), dt=0.01, forces=[[SPRING, forces.Gravity()], None]
    )
    assert both.position.shape == (101, 2, 3)
    assert both.kinetic_energy.shape == (101, 2)
    alone = integrate(body, state, (0.0, 1.0), dt=0.01, forces=[SPRING, forces.Gravity()])
    free = integrate(other, start, (0.0, 1.0), dt=0.01)
    for i, motion in enumerate((alone, free)):
        np.testing.assert_array_equal(both.quaternion[:, i], motion.quaternion)
        np.testing.assert_array_equal(both.position[:, i], motion.position)
        np.testing.assert_array_equal(both.angular_momentum[:, i], motion.angular_momentum)
    assert both[-1] == [alone[-1], free[-1]]
    falling = integrate([body, other], [state, start], (0.0, 1.0), dt=0.1, forces=forces.Gravity())
    np.testing.assert_allclose(falling.velocity[-1, :, 2] - falling.velocity[0, :, 2], -9.81)


def test_gravitation_and_a_callable_interaction_agree() -> None:
    bodies = [RigidBody.sphere(m, 0.1) for m in (3.0, 1.0, 0.5)]
    starts = [
        State((0, 0, 0), velocity=(0, -0.2, 0)),
        State((2, 0, 0), velocity=(0, 1, 0)),
        State((0, 3, 0), velocity=(-1, 0, 0.1)),
    ]

    def attraction(t: float, states: list[State]) -> tuple[Array, Array]:
        total = np.zeros((3, 3))
        for i in range(3):
            for j in range(3):
                if i != j:
                    span = states[j].position - states[i].position
                    total[i] += bodies[i].mass * bodies[j].mass * span / np.linalg.norm(span) ** 3
        return total, np.zeros((3, 3))

    ours, theirs = (
        integrate(bodies, starts, (0.0, 2.0), dt=0.01, interaction=interaction, dense_output=True)
        for interaction in (forces.Gravitation(1.0), attraction)
    )
    np.testing.assert_allclose(theirs.position, ours.position, atol=1e-12)
    momentum = np.einsum("b,tbi->ti", [b.mass for b in bodies], ours.velocity)
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (201, 1)), atol=1e-14)
    assert ours.sol is not None
    assert [type(x) for x in ours.sol(0.005)] == [State] * 3
    assert ours.sol([0.1, 0.2]).position.shape == (2, 3, 3)


def test_progress_shows_the_time_reached(
    body: RigidBody, state: State, capfd: pytest.CaptureFixture[str]
) -> None:
    integrate(body, state, (0.0, 1.0), dt=0.01, progress=True)
    assert "t = 1 of 1 s" in capfd.readouterr().err


def test_solutions_survive_pickling(body: RigidBody, state: State) -> None:
    import pickle

    motion = integrate(body, state, (0.0, 1.0), dt=0.1, dense_output=True)
    several = integrate([body, body], [state, state], (0.0, 1.0), dt=0.1)
    for original in (motion, several):
        copy = pickle.loads(pickle.dumps(original))
        assert type(copy) is somersault.Solution
        for name in ("t", "position", "quaternion", "velocity", "angular_velocity", "rotational_energy"):
            np.testing.assert_array_equal(getattr(copy, name), getattr(original, name))
        for name in ("status", "message", "nfev", "n_steps", "n_rejected", "body"):
            assert getattr(copy, name) == getattr(original, name)
        assert copy.sol is None


def test_a_trajectory_can_be_made_from_arrays(body: RigidBody, state: State) -> None:
    motion = integrate(body, state, (0.0, 1.0), dt=0.1)
    parts = (motion.t, motion.position, motion.quaternion, motion.velocity, motion.angular_velocity)
    again = somersault.Trajectory(body, *parts)
    np.testing.assert_array_equal(again.angular_momentum, motion.angular_momentum)
    with pytest.raises(somersault.InputError, match=r"`quaternion` must be real numbers of shape \(11, 4\)"):
        somersault.Trajectory(body, motion.t, motion.position, motion.position, *parts[3:])


@pytest.mark.parametrize("found", [0, -1, -(2**70)])
@pytest.mark.parametrize("argument", ["max_steps", "every"])
def test_numbers_of_steps_are_refused_by_their_names(
    argument: str, found: int, body: RigidBody, state: State
) -> None:
    with pytest.raises(ValueError, match=f"`{argument}` must be a positive number of steps"):
        integrate(body, state, (0.0, 1.0), method="rkmk8_b", **{argument: found})  # type: ignore[arg-type]
