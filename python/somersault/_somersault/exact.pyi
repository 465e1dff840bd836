from typing import Any, final

from numpy.typing import ArrayLike

from somersault._somersault.integrators import RigidBody, State

__all__ = [
    "FreeBody",
]

@final
class FreeBody:
    def __new__(cls, body: RigidBody, state: State, t0: float = 0.0) -> FreeBody: ...
    @property
    def body(self) -> RigidBody: ...
    # A state or a trajectory, after the shape of t.
    def __call__(self, t: ArrayLike, /) -> Any: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
