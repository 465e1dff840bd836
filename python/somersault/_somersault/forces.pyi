from collections.abc import Callable
from typing import Any, Literal, TypeAlias, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from somersault._somersault import _Floats
from somersault._somersault.integrators import RigidBody, State

__all__ = [
    "Drag",
    "Force",
    "ForceModel",
    "Gravitation",
    "Gravity",
    "Spring",
    "Torque",
]

_Wrench: TypeAlias = tuple[ArrayLike, ArrayLike]
_AnyForce: TypeAlias = ForceModel | Callable[[float, State], _Wrench]

@disjoint_base
class ForceModel:
    def wrench(self, t: float, body: RigidBody, state: State) -> tuple[_Floats, _Floats]: ...

@final
class Gravity(ForceModel):
    def __new__(cls, acceleration: ArrayLike | None = None) -> Gravity: ...
    @property
    def acceleration(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Spring(ForceModel):
    def __new__(
        cls,
        stiffness: float,
        anchor: ArrayLike | None = None,
        attachment: ArrayLike | None = None,
        *,
        damping: float = 0.0,
        rest_length: float = 0.0,
    ) -> Spring: ...
    @property
    def stiffness(self) -> float: ...
    @property
    def anchor(self) -> _Floats: ...
    @property
    def attachment(self) -> _Floats: ...
    @property
    def damping(self) -> float: ...
    @property
    def rest_length(self) -> float: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Drag(ForceModel):
    def __new__(cls, linear: float = 0.0, quadratic: float = 0.0, angular: float = 0.0) -> Drag: ...
    @property
    def linear(self) -> float: ...
    @property
    def quadratic(self) -> float: ...
    @property
    def angular(self) -> float: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Torque(ForceModel):
    def __new__(cls, torque: ArrayLike, frame: Literal["world", "body"] = "world") -> Torque: ...
    @property
    def torque(self) -> _Floats: ...
    @property
    def frame(self) -> Literal["world", "body"]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Force(ForceModel):
    def __new__(cls, force: ArrayLike, point: ArrayLike | None = None) -> Force: ...
    @property
    def force(self) -> _Floats: ...
    @property
    def point(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Gravitation:
    def __new__(cls, constant: float = ...) -> Gravitation: ...
    @property
    def constant(self) -> float: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
