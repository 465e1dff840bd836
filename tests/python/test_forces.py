"""Force models give the wrenches of their formulas."""

import numpy as np
import pytest

from somersault import RigidBody, State, forces


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
