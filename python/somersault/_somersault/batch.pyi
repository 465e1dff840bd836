from collections.abc import Sequence

from numpy.typing import ArrayLike

from somersault._somersault.integrators import RigidBody, State, Trajectory

__all__ = [
    "integrate_arrays",
    "integrate_batch",
]

def integrate_batch(
    bodies: RigidBody | Sequence[RigidBody],
    states: Sequence[State],
    interval: tuple[float, float] | Sequence[float],
    dt: ArrayLike,
    *,
    gravity: ArrayLike | None = None,
) -> Trajectory: ...

# `make public-names` writes what follows, from the documentation of the extension.

def integrate_arrays(
    moments: ArrayLike,
    quaternion: ArrayLike,
    angular_velocity: ArrayLike,
    interval: Sequence[float],
    dt: float | ArrayLike,
    *,
    mass: float | ArrayLike | None = None,
    position: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    t_eval: ArrayLike | None = None,
) -> Trajectory: ...
