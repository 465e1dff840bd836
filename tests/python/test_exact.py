"""The exact motion of a free body, from Python."""

import pickle

import numpy as np
import pytest

import somersault
from somersault import RigidBody, State
from somersault.exact import FreeBody


def test_integrations_converge_to_the_exact_motion(body: RigidBody, state: State) -> None:
    motion = somersault.integrate(body, state, (1.0, 4.0), dt=1e-3, method="rkmk_b")
    exact = FreeBody(body, state, t0=1.0)(motion.t)
    assert isinstance(exact, somersault.Trajectory)
    angle = (exact.orientation.inv() * motion.orientation).magnitude()
    assert angle.max() < 1e-11
    np.testing.assert_allclose(motion.position, exact.position, atol=1e-12)
    np.testing.assert_allclose(motion.angular_velocity, exact.angular_velocity, atol=1e-11)


def test_a_number_gives_a_state_and_an_array_a_trajectory(body: RigidBody, state: State) -> None:
    motion = FreeBody(body, state)
    assert isinstance(motion(1), State)
    assert motion([0.5, 1.0])[1] == motion(1.0)
    np.testing.assert_allclose(motion(0.0).quaternion, state.quaternion, atol=1e-15)
    assert pickle.loads(pickle.dumps(motion))(3.0) == motion(3.0)


def test_times_must_be_finite(body: RigidBody, state: State) -> None:
    with pytest.raises(somersault.errors.InputError, match="not finite"):
        FreeBody(body, state)([0.0, np.nan])
    with pytest.raises(somersault.InputError, match="`t0` must be finite"):
        FreeBody(body, state, np.inf)
    with pytest.raises(somersault.InputError, match="`t` must be a real number or numbers of shape"):
        FreeBody(body, state)(np.zeros((2, 2)))
