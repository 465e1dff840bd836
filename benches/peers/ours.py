"""The motions in the terms of somersault, and its solutions in theirs."""

from __future__ import annotations

import numpy as np
from motions import Array, Motion

import somersault


def body_of(motion: Motion) -> somersault.RigidBody:
    """The body of a motion."""
    return somersault.RigidBody.box(motion.mass, motion.sides)


def start_of(motion: Motion) -> somersault.State:
    """Its state at t = 0."""
    return somersault.State(angular_velocity=motion.angular_velocity)


def states_of(solution: somersault.Solution) -> Array:
    """Quaternion (w, x, y, z) and angular velocity in the body frame, a row for each time recorded."""
    in_body = solution.orientation.inv().apply(solution.angular_velocity)
    return np.column_stack([np.roll(solution.quaternion, 1, axis=1), in_body])
