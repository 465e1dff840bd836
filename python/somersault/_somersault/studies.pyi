from collections.abc import Sequence
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault._somersault import _Floats
from somersault._somersault.forces import ForceModel
from somersault._somersault.integrators import RigidBody, State, _AnyMethod

__all__ = [
    "Convergence",
    "EnergyStudy",
    "Problem",
    "StabilityRegion",
    "WorkPrecision",
    "convergence",
    "energy",
    "prisms",
    "spectral_radii",
    "stability_region",
    "work_precision",
]

@final
class StabilityRegion:
    @property
    def area(self) -> float: ...
    @property
    def corrected(self) -> float: ...
    @property
    def imaginary_limit(self) -> float: ...
    @property
    def real_limit(self) -> float: ...
    @property
    def boundary(self) -> _Floats: ...
    @property
    def failed(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class EnergyStudy:
    @property
    def steps(self) -> NDArray[np.uint64]: ...
    @property
    def max(self) -> _Floats: ...
    @property
    def min(self) -> _Floats: ...
    @property
    def gained(self) -> NDArray[np.uint64]: ...
    @property
    def lost(self) -> NDArray[np.uint64]: ...
    @property
    def fraction_of_bound(self) -> float: ...
    @property
    def largest_rise(self) -> float: ...
    @property
    def failed(self) -> int: ...
    @property
    def behaviour(
        self,
    ) -> Literal["unconditionally stable", "conditionally stable", "unconditionally unstable"]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Problem:
    def __new__(
        cls,
        body: RigidBody,
        state: State,
        t_end: float,
        *,
        reference: State | None = None,
        forces: ForceModel | Sequence[ForceModel] | None = None,
    ) -> Problem: ...
    @classmethod
    def case(cls, number: int) -> Problem: ...
    @classmethod
    def asymmetric_body(cls) -> Problem: ...
    @classmethod
    def spring_pendulum(cls) -> Problem: ...
    @classmethod
    def damped_spring_pendulum(cls) -> Problem: ...
    @property
    def body(self) -> RigidBody: ...
    @property
    def state(self) -> State: ...
    @property
    def reference(self) -> State: ...
    @property
    def t_end(self) -> float: ...
    @property
    def forces(self) -> list[ForceModel]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Convergence:
    @property
    def dt(self) -> _Floats: ...
    @property
    def errors(self) -> dict[str, _Floats]: ...
    @property
    def orders(self) -> dict[str, float | None]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class WorkPrecision:
    @property
    def errors(self) -> dict[str, _Floats]: ...
    @property
    def evaluations(self) -> NDArray[np.uint64]: ...
    @property
    def steps(self) -> NDArray[np.uint64]: ...
    @property
    def rejected(self) -> NDArray[np.uint64]: ...
    @property
    def seconds(self) -> _Floats: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def prisms(n: int) -> list[RigidBody]: ...
def stability_region(
    method: _AnyMethod, *, start_up: Literal["one_step", "ladder"] = "one_step"
) -> StabilityRegion: ...
def spectral_radii(
    method: _AnyMethod,
    re: ArrayLike,
    im: ArrayLike,
    *,
    start_up: Literal["one_step", "ladder"] = "one_step",
) -> _Floats: ...
def energy(
    method: _AnyMethod,
    bodies: Sequence[RigidBody] | None = None,
    *,
    angular_velocity: ArrayLike | None = None,
    dt: float = 1.0,
    steps: Sequence[int] = ...,
    start_up: Literal["one_step", "ladder"] = "ladder",
) -> EnergyStudy: ...
def convergence(
    problem: Problem,
    method: _AnyMethod,
    dts: ArrayLike,
    *,
    start_up: Literal["one_step", "ladder"] = "one_step",
) -> Convergence: ...
def work_precision(
    problem: Problem,
    method: _AnyMethod,
    dts: ArrayLike | None = None,
    *,
    tolerances: ArrayLike | None = None,
    repeats: int = 3,
    start_up: Literal["one_step", "ladder"] = "one_step",
) -> WorkPrecision: ...
