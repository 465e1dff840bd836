"""The motions that are compared, their reference solutions and the measures of error.

A state is a vector of seven: the quaternion (w, x, y, z) that takes the body frame to the world, and the
angular velocity in the body frame, rad/s. The body frame is that of the principal axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import heyoka
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """A free body: mass in kg, sides of the box in m, angular velocity in rad/s, duration in s."""

    title: str
    mass: float
    sides: tuple[float, float, float]
    angular_velocity: tuple[float, float, float]
    duration: float

    @property
    def moments(self) -> Array:
        """Principal moments of inertia, kg m²."""
        x, y, z = self.sides
        return self.mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])

    @property
    def start(self) -> Array:
        """The state at t = 0, the body frame in that of the world."""
        return np.array([1.0, 0.0, 0.0, 0.0, *self.angular_velocity])


TUMBLING_BOX = Motion(
    title="Tumbling box",
    mass=1.0,
    sides=(0.2, 0.4, 0.6),
    angular_velocity=(1.0, 2.0, 3.0),
    duration=5.0,
)

CASE_2 = Motion(
    title="Case 2 of thesis 7.2.1",
    mass=1.0,
    sides=(10 ** (-1 / 3), 2 * 10 ** (-1 / 3), 5 * 10 ** (-1 / 3)),
    angular_velocity=(0.0, 2 * np.pi, 2e-4 * np.pi),
    duration=10.0,
)


def taylor_system(
    moments: Array, torque: Array | None = None
) -> list[tuple[heyoka.expression, heyoka.expression]]:
    """Euler's equations and the kinematics of the quaternion as heyoka has them; a torque is in body axes."""
    w, x, y, z, a, b, c = heyoka.make_vars("w", "x", "y", "z", "a", "b", "c")
    i, j, k = moments
    push = (0.0, 0.0, 0.0) if torque is None else torque / moments
    return [
        (w, -0.5 * (x * a + y * b + z * c)),
        (x, 0.5 * (w * a + y * c - z * b)),
        (y, 0.5 * (w * b + z * a - x * c)),
        (z, 0.5 * (w * c + x * b - y * a)),
        (a, (j - k) / i * b * c + push[0]),
        (b, (k - i) / j * c * a + push[1]),
        (c, (i - j) / k * a * b + push[2]),
    ]


@cache
def reference(motion: Motion, torque: tuple[float, float, float] | None = None) -> Array:
    """The state at the end, by a Taylor series in 80-bit arithmetic to its last digit.

    No library that is compared takes part in it in double precision, so that none is judged by itself.
    """
    wide = np.longdouble
    integrator = heyoka.taylor_adaptive(
        taylor_system(motion.moments.astype(wide), None if torque is None else np.array(torque, dtype=wide)),
        motion.start.astype(wide),
        fp_type=wide,
    )
    integrator.propagate_until(wide(motion.duration))
    return np.array(integrator.state, dtype=float)


def orientation_error(found: Array, exact: Array) -> float:
    """The angle between two orientations, rad."""
    w, v = found[0], found[1:4]
    w_exact, v_exact = exact[0], exact[1:4]
    scalar = w * w_exact + v @ v_exact
    vector = w_exact * v - w * v_exact - np.cross(v_exact, v)
    return float(2 * np.arctan2(np.linalg.norm(vector), abs(scalar)))


def kinetic_energy(moments: Array, omega_body: Array) -> Array:
    """½ ωᵀIω of each row, J."""
    return 0.5 * (omega_body**2) @ moments


def angular_momentum(moments: Array, states: Array) -> Array:
    """R I ω of each row, in the world frame, kg m²/s."""
    w, v = states[:, :1], states[:, 1:4]
    in_body = moments * states[:, 4:]
    norm = np.sum(states[:, :4] ** 2, axis=1, keepdims=True)
    return in_body + 2 / norm * (w * np.cross(v, in_body) + np.cross(v, np.cross(v, in_body)))


@dataclass(frozen=True)
class Errors:
    """What a run got wrong; energy and momentum relative, the largest over all steps."""

    energy: float
    momentum: float
    orientation: float

    @classmethod
    def of(cls, motion: Motion, states: Array) -> Errors:
        """From the states after each step, the start first."""
        energy = kinetic_energy(motion.moments, states[:, 4:])
        momentum = angular_momentum(motion.moments, states)
        return cls(
            energy=float(np.max(np.abs(energy / energy[0] - 1))),
            momentum=float(
                np.max(np.linalg.norm(momentum - momentum[0], axis=1)) / np.linalg.norm(momentum[0])
            ),
            orientation=orientation_error(states[-1], reference(motion)),
        )
