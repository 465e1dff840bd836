"""Force models give the wrenches of their formulas."""

import numpy as np
import numpy.typing as npt
import pytest

import somersault
from somersault import RigidBody, State, contact, forces


def check(model: forces.ForceModel, body: RigidBody, state: State, force: object, torque: object) -> None:
    found_force, found_torque = model.wrench(0.0, body, state)
    np.testing.assert_allclose(found_force, force, atol=1e-14)  # type: ignore[arg-type]
    np.testing.assert_allclose(found_torque, torque, atol=1e-14)  # type: ignore[arg-type]


def test_gravity(body: RigidBody, state: State) -> None:
    check(forces.Gravity(), body, state, (0, 0, -2 * 9.81), np.zeros(3))
    check(forces.Gravity((1, 2, 3)), body, state, (2, 4, 6), np.zeros(3))


def test_spring(body: RigidBody, state: State) -> None:
    check(forces.Spring(3.0), body, state, -3.0 * state.position, np.zeros(3))
    arm = state.orientation.apply((0.1, 0.2, 0.3))
    span = state.position + arm - (1, 1, 1)
    length = np.linalg.norm(span)
    speed = span @ (state.velocity + np.cross(state.angular_velocity, arm)) / length
    force = -(3.0 * (length - 0.5) + 0.7 * speed) * span / length
    spring = forces.Spring(3.0, (1, 1, 1), (0.1, 0.2, 0.3), damping=0.7, rest_length=0.5)
    check(spring, body, state, force, np.cross(arm, force))


def test_drag(body: RigidBody, state: State) -> None:
    v, w = state.velocity, state.angular_velocity
    drag = forces.Drag(linear=0.2, quadratic=0.3, angular=0.4)
    check(drag, body, state, -(0.2 + 0.3 * np.linalg.norm(v)) * v, -0.4 * w)


def test_torque(body: RigidBody, state: State) -> None:
    check(forces.Torque((1, 2, 3)), body, state, np.zeros(3), (1, 2, 3))
    turned = state.orientation.apply((1, 2, 3))
    check(forces.Torque((1, 2, 3), frame="body"), body, state, np.zeros(3), turned)


def test_central_gravity(body: RigidBody, state: State) -> None:
    way = state.position - (1, 2, 3)
    force = -5.0 * body.mass * way / np.linalg.norm(way) ** 3
    check(forces.CentralGravity(5.0, (1, 2, 3)), body, state, force, np.zeros(3))
    # Kepler's ellipse, of which Orbit has the closed form
    orbit = forces.Orbit(2.0, 0.3, 0.4, 0.5, 0.6, 0.7, gravitational_parameter=5.0)
    start = State(orbit.position(0.0), velocity=orbit.velocity(0.0))
    for method, off in (("taylor16", 1e-11), ("rkmk8", 1e-10)):
        motion = somersault.integrate(
            body, start, (0.0, 9.0), method=method, rtol=1e-13, atol=1e-13, forces=forces.CentralGravity(5.0)
        )
        np.testing.assert_allclose(motion.position[-1], orbit.position(9.0), atol=off)


def test_scheduled_torque(body: RigidBody, state: State) -> None:
    times, torques = [0.0, 1.0, 3.0], [(0, 0, 0), (1, 2, 3), (-1, 0, 1)]
    model = forces.ScheduledTorque(times, torques)
    for t in (-1.0, 0.0, 0.3, 1.0, 2.5, 3.0, 9.0):
        expected = [np.interp(t, times, column) for column in np.transpose(torques)]
        np.testing.assert_allclose(model.wrench(t, body, state)[1], expected, atol=1e-14)
        of_body = forces.ScheduledTorque(times, torques, frame="body").wrench(t, body, state)[1]
        np.testing.assert_allclose(of_body, state.orientation.apply(expected), atol=1e-14)
    for wrong, message in (
        (lambda: forces.ScheduledTorque([0.0, 0.0], [(0, 0, 0)] * 2), "`times` must be increasing"),
        (
            lambda: forces.ScheduledTorque([0.0], [(0, 0)]),
            r"`torques` must be real numbers of shape \(1, 3\)",
        ),
        (lambda: forces.ScheduledTorque([], np.zeros((0, 3))), "`times` must"),
        (lambda: forces.ScheduledTorque([0.0], [(0, 0, np.inf)]), "`torques` must be finite"),
        (lambda: forces.ScheduledTorque([0.0], [(0, 0, 1)], frame="x"), "`frame` must be 'world' or 'body'"),  # type: ignore[arg-type]
        (lambda: forces.CentralGravity(np.nan), "`gravitational_parameter` must be finite"),
    ):
        with pytest.raises(somersault.InputError, match=message):
            wrong()


@pytest.mark.parametrize(
    "model",
    [forces.CentralGravity(5.0, (1, 2, 3)), forces.ScheduledTorque([0.0, 1.0], np.eye(3)[:2], "body")],
)
def test_derivatives_under_the_models_are_differences(
    model: forces.ForceModel, body: RigidBody, state: State
) -> None:
    # on the other side of a floor that is not reached
    far = contact.Contact(
        (0, 0, 0), contact.HalfSpace((0, 0, -1e3), (0, 0, 1)), contact.CompliantLaw(1.0, 0.0)
    )

    def run(start: State) -> contact.Sensitivities:
        return contact.differentiate(
            body, start, (0.0, 1.0), dt=0.05, contacts=far, method="rkmk", forces=model
        )

    found = run(state)

    def end(step: float, column: int) -> npt.NDArray[np.float64]:
        position = state.position + step * np.eye(3)[column]
        moved = State(position, state.orientation, state.velocity, state.angular_velocity)
        after = run(moved).state
        return np.concatenate([after.position, after.velocity])

    for column in range(3):
        difference = (end(1e-5, column) - end(-1e-5, column)) / 2e-5
        exact = np.concatenate([found.by_state[:3, column], found.by_state[6:9, column]])
        np.testing.assert_allclose(exact, difference, atol=1e-8)


def test_force(body: RigidBody, state: State) -> None:
    check(forces.Force((1, 2, 3)), body, state, (1, 2, 3), np.zeros(3))
    arm = state.orientation.apply((0.5, 0, 0))
    check(forces.Force((1, 2, 3), (0.5, 0, 0)), body, state, (1, 2, 3), np.cross(arm, (1, 2, 3)))


def test_parameters_can_be_read_and_the_base_not_made() -> None:
    spring = forces.Spring(3.0, (1, 1, 1), (0.1, 0.2, 0.3), damping=0.7, rest_length=0.5)
    assert (spring.stiffness, spring.damping, spring.rest_length) == (3.0, 0.7, 0.5)
    np.testing.assert_array_equal(spring.attachment, (0.1, 0.2, 0.3))
    assert eval(repr(spring), {"Spring": forces.Spring}).damping == 0.7
    assert forces.Torque((1, 0, 0), "body").frame == "body"
    assert forces.Gravitation().constant == 6.6743e-11
    with pytest.raises(TypeError):
        forces.ForceModel()


def everything(t: float, state: State) -> tuple[object, object]:
    """A wrench of all that a state has."""
    lever = state.orientation.apply([0.1, -0.2, 0.3])
    against = state.orientation.apply(state.position, inverse=True)
    turned = state.orientation.inv().apply(state.velocity) + state.orientation.as_matrix() @ state.position
    force = np.sin(t) * state.position + np.linalg.norm(state.velocity) * state.velocity + lever
    torque = np.cross(lever, state.velocity) - 0.3 * state.angular_velocity + against * state.quaternion[3]
    turned = turned + state.orientation.inv().as_quat()[:3]
    return force + turned, torque + state.orientation.as_quat()[:3] + state.angular_velocity_body


def test_a_traced_force_is_its_function(body: RigidBody) -> None:
    model, rng = forces.traced(everything), np.random.default_rng(20261127)
    for t in rng.normal(size=20):
        state = State(rng.normal(size=3), rng.normal(size=4), rng.normal(size=3), rng.normal(size=3))
        for found, expected in zip(model.wrench(t, body, state), everything(t, state), strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)  # type: ignore[arg-type]


def test_a_traced_force_may_depend_on_the_body(body: RigidBody, state: State) -> None:
    model = forces.traced(
        lambda t, state, body: (body.mass * state.position, body.inertia @ state.angular_velocity)
    )
    check(model, body, state, body.mass * state.position, body.inertia @ state.angular_velocity)


def test_a_motion_under_a_traced_force_is_that_under_the_model(body: RigidBody, state: State) -> None:
    drag = forces.Drag(0.2, 0.3, 0.4)
    same = forces.traced(
        lambda t, x: (
            -(0.2 + 0.3 * np.linalg.norm(x.velocity)) * x.velocity,
            -0.4 * x.angular_velocity,
        )
    )
    ends = [
        somersault.integrate(body, state, (0.0, 1.0), dt=0.1, forces=force, method=method)
        for method in ("rkmk8_b", "radau5")
        for force in (drag, same)
    ]
    for one, other in (ends[:2], ends[2:]):
        np.testing.assert_allclose(one.quaternion[-1], other.quaternion[-1], atol=1e-13)
        np.testing.assert_allclose(one.position[-1], other.position[-1], atol=1e-13)


def test_derivatives_of_a_motion_under_a_traced_force_are_those_under_the_model() -> None:
    body = RigidBody.box(1.0, (0.2, 0.3, 0.4))
    touch = contact.Contact((0.0, 0.0, -0.1), contact.HalfSpace(), contact.CompliantLaw(1e4, 10.0))
    start = State((0.0, 0.0, 0.2), (0.1, 0.2, 0.3, 0.9), (0.3, 0.0, 0.0), (0.0, 1.0, 2.0))
    spring = forces.Spring(3.0, (1, 1, 1), (0.1, 0.2, 0.3), damping=0.7)

    def same(t: float, x: State) -> tuple[object, object]:
        arm = x.orientation.apply([0.1, 0.2, 0.3])
        span = x.position + arm - [1, 1, 1]
        along = span / np.linalg.norm(span)
        rate = along @ (x.velocity + np.cross(x.angular_velocity, arm))
        force = -3.0 * span - 0.7 * rate * along
        return force, np.cross(arm, force)

    found = [
        contact.differentiate(
            body, start, (0.0, 0.2), dt=1e-3, contacts=[touch], forces=[forces.Gravity(), force]
        )
        for force in (spring, forces.traced(same))
    ]
    assert found[0].events
    by_state = [each.by_state for each in found]
    assert np.abs(by_state[0] - by_state[1]).max() < 1e-11 * np.abs(by_state[0]).max()


def test_what_a_function_does_to_its_arrays_is_not_done_to_the_state(body: RigidBody, state: State) -> None:
    def force(t: float, x: State) -> tuple[object, object]:
        r, q, m = x.position, x.orientation.as_quat(), x.orientation.as_matrix()
        r -= np.array([1.0, 2.0, 3.0])
        q *= 2.0
        m[0] = 0.0
        return x.position, x.quaternion[:3] + x.orientation.apply(r)

    expected = state.quaternion[:3] + state.orientation.apply(state.position - [1.0, 2.0, 3.0])
    check(forces.traced(force), body, state, state.position, expected)


def test_only_an_argument_that_must_be_given_or_is_called_body_is_the_body(
    body: RigidBody, state: State
) -> None:
    def damped(t: float, x: State, damped: bool = False) -> tuple[object, object]:
        return (-x.velocity if damped else x.velocity), np.zeros(3)

    def heavy(t: float, x: State, body: object = None) -> tuple[object, object]:
        return [0, 0, -9.81 * body.mass], np.zeros(3)  # type: ignore[attr-defined]

    check(forces.traced(damped), body, state, state.velocity, np.zeros(3))
    check(
        forces.traced(lambda *a: (a[1].velocity, a[1].position)), body, state, state.velocity, state.position
    )
    check(forces.traced(heavy), body, state, (0, 0, -2 * 9.81), np.zeros(3))


@pytest.mark.parametrize(
    ("function", "error", "message"),
    [
        (3, somersault.InputError, "`f` must be a function, found int"),
        (lambda t: None, somersault.InputError, r"`f` must take \(t, state\) or \(t, state, body\), found"),
        (lambda t, x: x.position, somersault.InputError, "must return a pair .* of shape"),
        (lambda t, x: (x.position, 0.0), somersault.InputError, r"each of shape \(3,\), found shape \(\)"),
        (
            lambda t, x: (x.position if x.velocity[0] > 0 else -x.position, x.velocity),
            somersault.errors.TraceError,
            r"test_forces.py, line \d+.*np.where",
        ),
        (
            lambda t, x: (x.orientation.as_euler("xyz"), x.velocity),
            somersault.errors.TraceError,
            r"`orientation.as_euler` of a state cannot be traced",
        ),
        (
            lambda t, x, body: (x.position, body.principal_moments),
            somersault.errors.TraceError,
            "Body has no principal_moments that can be traced",
        ),
        (
            lambda t, x: (x.positions, x.velocity),
            somersault.errors.TraceError,
            "State has no positions that can be traced",
        ),
    ],
)
def test_functions_that_are_no_forces(function: object, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        forces.traced(function)  # type: ignore[arg-type]
