from collections.abc import Sequence

from numpy.typing import ArrayLike

from somersault._somersault.integrators import RigidBody, State, Trajectory

__all__ = [
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
