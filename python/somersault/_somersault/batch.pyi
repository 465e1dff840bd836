from collections.abc import Sequence
from typing import TypeAlias

from numpy.typing import ArrayLike

from somersault._somersault.forces import _AnyForce
from somersault._somersault.integrators import RigidBody, State, Trajectory, _AnyMethod

__all__ = [
    "integrate_arrays",
    "integrate_batch",
]

_Forces: TypeAlias = _AnyForce | Sequence[_AnyForce | Sequence[_AnyForce] | None]

def integrate_arrays(
    moments: ArrayLike,
    quaternion: ArrayLike,
    angular_velocity: ArrayLike,
    interval: tuple[float, float] | Sequence[float],
    dt: ArrayLike | None = None,
    *,
    mass: ArrayLike | None = None,
    position: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    method: _AnyMethod | None = None,
    forces: _Forces | None = None,
    gravity: ArrayLike | None = None,
    t_eval: ArrayLike | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
) -> Trajectory: ...
def integrate_batch(
    bodies: RigidBody | Sequence[RigidBody],
    states: Sequence[State],
    interval: tuple[float, float] | Sequence[float],
    dt: ArrayLike | None = None,
    *,
    method: _AnyMethod | None = None,
    forces: _Forces | None = None,
    gravity: ArrayLike | None = None,
    t_eval: ArrayLike | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
) -> Trajectory: ...
