"""What the tests share."""

import hypothesis
import numpy as np
import pytest

import somersault

hypothesis.settings.register_profile("somersault", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("somersault")


@pytest.fixture
def body() -> somersault.RigidBody:
    """A body with three different moments that are not along its axes."""
    turn = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])
    return somersault.RigidBody(2.0, turn @ np.diag([0.5, 0.9, 1.2]) @ turn.T)


@pytest.fixture
def state() -> somersault.State:
    """A state in which nothing is zero."""
    return somersault.State(
        position=(0.3, -0.2, 0.5),
        orientation=(0.1, -0.3, 0.5, 0.8),
        velocity=(0.4, 0.1, -0.7),
        angular_velocity=(1.1, -0.6, 0.9),
    )
