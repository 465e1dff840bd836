"""Rigid bodies and states: what goes in comes out."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import somersault
from somersault import RigidBody, State

finite = st.floats(-1e6, 1e6)
vectors = st.tuples(finite, finite, finite)
quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 1e-3)


def test_moments_and_tensor_make_the_same_body() -> None:
    assert RigidBody(2.0, (1.0, 2.0, 2.5)) == RigidBody(2.0, np.diag([1.0, 2.0, 2.5]))


def test_the_tensor_is_rebuilt_from_its_principal_axes(body: RigidBody) -> None:
    axes = body.principal_axes.as_matrix()
    np.testing.assert_allclose(axes @ np.diag(body.principal_moments) @ axes.T, body.inertia, atol=1e-15)
    np.testing.assert_allclose(np.linalg.eigvalsh(body.inertia), np.sort(body.principal_moments), rtol=1e-14)


@pytest.mark.parametrize(
    ("body", "moments"),
    [
        (RigidBody.box(12.0, (1, 2, 3)), (13, 10, 5)),
        (RigidBody.sphere(5.0, 2.0), (8, 8, 8)),
        (RigidBody.ellipsoid(5.0, (1, 2, 3)), (13, 10, 5)),
        (RigidBody.cylinder(12.0, 1.0, 3.0), (12, 12, 6)),
        (RigidBody.shell(3.0, 2.0), (8, 8, 8)),
        (RigidBody.capsule(3.0, 2.0, 1e-12), (4.8, 4.8, 4.8)),
    ],
)
def test_shapes_have_their_textbook_moments(body: RigidBody, moments: tuple[float, ...]) -> None:
    np.testing.assert_allclose(body.principal_moments, moments, rtol=1e-10)
    np.testing.assert_array_equal(body.principal_axes.as_quat(), (0, 0, 0, 1))


@given(vectors, quaternions, vectors, vectors)
def test_a_state_gives_back_what_it_was_made_from(
    position: tuple[float, ...],
    quaternion: tuple[float, ...],
    velocity: tuple[float, ...],
    angular_velocity: tuple[float, ...],
) -> None:
    state = State(position, quaternion, velocity, angular_velocity)
    np.testing.assert_array_equal(state.position, position)
    np.testing.assert_array_equal(state.velocity, velocity)
    np.testing.assert_array_equal(state.angular_velocity, angular_velocity)
    np.testing.assert_allclose(state.quaternion, quaternion / np.linalg.norm(quaternion), atol=1e-15)
    in_body = state.orientation.inv().apply(angular_velocity)
    size = max(1.0, float(np.linalg.norm(angular_velocity)))
    np.testing.assert_allclose(state.angular_velocity_body, in_body, atol=1e-14 * size)


@given(quaternions)
def test_orientations_are_the_same_in_every_form(quaternion: tuple[float, ...]) -> None:
    rotation = Rotation.from_quat(quaternion)
    for form in (rotation, rotation.as_quat(), rotation.as_matrix(), list(quaternion)):
        found = State(orientation=form).orientation
        assert (found.inv() * rotation).magnitude() < 1e-14


def test_angular_velocity_can_be_given_in_the_body(state: State) -> None:
    same = State(
        state.position,
        state.orientation,
        state.velocity,
        angular_velocity_body=state.angular_velocity_body,
    )
    np.testing.assert_allclose(same.angular_velocity, state.angular_velocity, rtol=1e-15, atol=1e-15)


def test_arguments_left_out_are_zero() -> None:
    state = State()
    for vector in (state.position, state.velocity, state.angular_velocity):
        np.testing.assert_array_equal(vector, np.zeros(3))
    np.testing.assert_array_equal(state.quaternion, (0, 0, 0, 1))


@pytest.mark.parametrize("dtype", ["int32", "float32", "uint8"])
def test_arrays_of_any_real_type_and_layout_are_taken(dtype: str) -> None:
    numbers = np.arange(12).astype(dtype)
    np.testing.assert_array_equal(State(position=numbers[::4]).position, (0, 4, 8))
    assert RigidBody(1.0, np.asfortranarray(np.eye(3, dtype=dtype))) == RigidBody(1.0, (1, 1, 1))


def test_pickles_are_the_same_to_the_bit(body: RigidBody, state: State) -> None:
    for thing in (body, state, somersault.methods()["rkmk"]):
        assert pickle.loads(pickle.dumps(thing)) == thing


def test_representations_say_how_to_make_the_thing(body: RigidBody, state: State) -> None:
    assert eval(repr(body), {"RigidBody": RigidBody}) == body
    assert eval(repr(state), {"State": State}) == state
