"""Batches of bodies, from Python."""

import numpy as np
import pytest

import somersault
from somersault import RigidBody, State, batch


def test_a_batch_is_its_bodies_one_by_one(body: RigidBody) -> None:
    rng = np.random.default_rng(20261121)
    bodies = [body, *(RigidBody.box(1.0, rng.uniform(0.5, 1.0, 3)) for _ in range(129))]
    states = [
        State(rng.normal(size=3), rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)) for _ in bodies
    ]
    steps = rng.choice([0.01, 0.02, 0.03], len(bodies))
    gravity = (0.0, 0.0, -9.81)
    motion = batch.integrate_batch(bodies, states, (0.0, 1.0), steps, gravity=gravity)
    assert motion.position.shape == (2, len(bodies), 3)
    assert motion[0] == states
    for i, (b, x) in enumerate(zip(bodies, states, strict=True)):
        alone = somersault.integrate(
            b, x, (0.0, 1.0), dt=steps[i], method="rkmk_b", forces=somersault.forces.Gravity(gravity)
        )
        np.testing.assert_allclose(motion.position[-1, i], alone.position[-1], atol=1e-12)
        np.testing.assert_allclose(motion.quaternion[-1, i], alone.quaternion[-1], atol=1e-12)
        np.testing.assert_allclose(motion.angular_velocity[-1, i], alone.angular_velocity[-1], atol=1e-12)


def test_one_body_stands_for_all(body: RigidBody, state: State) -> None:
    motion = batch.integrate_batch(body, [state] * 3, (0.0, 1.0), 0.01)
    np.testing.assert_array_equal(motion.quaternion[-1, 0], motion.quaternion[-1, 2])


def test_bad_input(body: RigidBody, state: State) -> None:
    with pytest.raises(somersault.errors.InputError, match="`states` must have one entry for each of 2"):
        batch.integrate_batch([body, body], [state], (0.0, 1.0), 0.01)
    with pytest.raises(
        somersault.InputError, match="`states` must be a sequence of State, found an int in it"
    ):
        batch.integrate_batch(body, [3], (0.0, 1.0), 0.01)  # type: ignore[list-item]
    with pytest.raises(somersault.InputError, match=r"`dt` must be a real number or numbers of shape \(2,\)"):
        batch.integrate_batch(body, [state, state], (0.0, 1.0), [0.1, 0.1, 0.1])
    with pytest.raises(somersault.errors.InputError, match="`dt` must be positive"):
        batch.integrate_batch(body, [state], (0.0, 1.0), -0.1)
    wild = State(angular_velocity=(1e200, 1e200, 1e200))
    with pytest.raises(somersault.errors.IntegrationError, match="the state of body 1 stopped being finite"):
        batch.integrate_batch(body, [state, wild], (0.0, 1.0), 0.01)
