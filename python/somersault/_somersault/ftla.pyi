from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeAlias, final

from numpy.typing import ArrayLike

from somersault._somersault import _Floats
from somersault._somersault.expr import CompiledFunction
from somersault._somersault.multibody import Model
from somersault._somersault.ocp import TracedProblem

__all__ = [
    "Chain",
    "ContinuationResult",
    "Diagnosis",
    "Extremal",
    "Following",
    "Matching",
    "MatchingResult",
    "Placement",
    "PlacementResult",
    "Spectrum",
    "Splitting",
    "Subspace",
    "System",
    "Transition",
    "VariationalFlow",
    "arm",
    "cold_start",
    "continue_through",
    "cubic_regulator",
    "diagnose",
    "field_exponents",
    "follow",
    "graded_times",
    "grid_ridges",
    "grid_smoothed",
    "linear_regulator",
    "long_run",
    "rank_held_costates",
    "shoot",
    "slow_subspace",
    "spectra_convergence",
    "state_costate",
    "travel_arm",
    "tree",
]

_Direction: TypeAlias = Literal["forward", "backward"]
_Dims: TypeAlias = tuple[int, int, int]
_EndStates: TypeAlias = Sequence[float | None] | _Floats
_Pair: TypeAlias = tuple[float, float] | Sequence[float]
_PlacedStatus: TypeAlias = Literal[
    "placed", "stalled", "max_iterations", "singular_costates", "flow", "limit_reached"
]
_OfPoint: TypeAlias = Callable[[_Floats], ArrayLike]

@final
class System:
    def __new__(
        cls,
        field: _OfPoint,
        jacobian: _OfPoint,
        dimension: int,
        *,
        hamiltonian: Callable[[_Floats], float] | None = None,
        control: _OfPoint | None = None,
        running_cost: Callable[[_Floats], float] | None = None,
        n_controls: int = 1,
    ) -> System: ...
    @property
    def dimension(self) -> int: ...
    @property
    def n_controls(self) -> int: ...
    @property
    def model(self) -> Model | None: ...
    @staticmethod
    def _of_traced(
        function: CompiledFunction, description: str, origin: tuple[Callable[..., System], tuple[Any, ...]]
    ) -> System: ...
    @staticmethod
    def _of_problem(
        problem: TracedProblem, description: str, origin: tuple[Callable[..., System], tuple[Any, ...]]
    ) -> System: ...
    def field(self, p: ArrayLike, t: float = 0.0) -> _Floats: ...
    def jacobian(self, p: ArrayLike, t: float = 0.0) -> _Floats: ...
    def hamiltonian(self, p: ArrayLike) -> Any: ...
    def control(self, p: ArrayLike) -> _Floats: ...
    def running_cost(self, p: ArrayLike) -> Any: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Transition:
    @property
    def duration(self) -> float: ...
    @property
    def end(self) -> _Floats: ...
    @property
    def matrix(self) -> _Floats: ...
    @property
    def symplecticity_defect(self) -> float: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Chain:
    @property
    def times(self) -> _Floats: ...
    @property
    def marks(self) -> list[int]: ...
    @property
    def n_evaluations(self) -> int: ...
    def spectrum(self, mark: int = ...) -> Spectrum: ...
    def __len__(self) -> int: ...
    def __getitem__(self, number: int, /) -> Transition: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class VariationalFlow:
    def __new__(
        cls,
        system: System,
        *,
        rtol: float = 1e-12,
        atol: float = 1e-14,
        max_steps: int = 100_000,
        start: float = 0.0,
    ) -> VariationalFlow: ...
    @property
    def system(self) -> System: ...
    @property
    def start(self) -> float: ...
    def state(self, p: ArrayLike, duration: ArrayLike) -> _Floats: ...
    def cost(self, p: ArrayLike, duration: float) -> tuple[_Floats, float]: ...
    def transition(self, p: ArrayLike, duration: float) -> Transition: ...
    def transitions(self, points: ArrayLike, duration: float) -> tuple[_Floats, _Floats]: ...
    def switches(
        self, p: ArrayLike, duration: float
    ) -> list[tuple[float, list[Literal["lower", "free", "upper"]]]]: ...
    def chain(self, p: ArrayLike, times: ArrayLike, growth: float = 100.0) -> Chain: ...
    def spectra(
        self, p: ArrayLike, times: ArrayLike, direction: _Direction = "forward"
    ) -> list[Spectrum]: ...
    def spectrum(self, p: ArrayLike, time: float, direction: _Direction = "forward") -> Spectrum: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Spectrum:
    @property
    def direction(self) -> _Direction: ...
    @property
    def time(self) -> float: ...
    @property
    def exponents(self) -> _Floats: ...
    @property
    def vectors(self) -> _Floats: ...
    @property
    def balanced(self) -> _Floats: ...
    @property
    def rates(self) -> _Floats: ...
    @property
    def pairing_defect(self) -> float: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Diagnosis:
    @property
    def dims(self) -> _Dims: ...
    @property
    def verdict(
        self,
    ) -> Literal["complete", "partial", "insensitive", "undetermined", "not_hamiltonian"]: ...
    @property
    def is_hyper_sensitive(self) -> bool: ...
    @property
    def is_partially_hyper_sensitive(self) -> bool: ...
    @property
    def time(self) -> float: ...
    @property
    def fast_rates(self) -> tuple[float, float]: ...
    @property
    def balanced_rates(self) -> tuple[float, float]: ...
    @property
    def center_rate(self) -> float: ...
    @property
    def gaps(self) -> tuple[float, float]: ...
    @property
    def time_constants(self) -> float: ...
    @property
    def window(self) -> tuple[float, float]: ...
    @property
    def horizon(self) -> float: ...
    def schedule(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Subspace:
    def __new__(cls, vectors: ArrayLike) -> Subspace: ...
    @property
    def dim(self) -> int: ...
    @property
    def basis(self) -> _Floats: ...
    def complement(self) -> Subspace: ...
    def intersection(self, other: Subspace) -> Subspace: ...
    def angle_to(self, v: ArrayLike) -> float: ...
    def angles(self, other: Subspace) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Splitting:
    def __new__(cls, forward: Spectrum, backward: Spectrum, dims: _Dims) -> Splitting: ...
    @property
    def dims(self) -> _Dims: ...
    @property
    def stable(self) -> Subspace: ...
    @property
    def center_stable(self) -> Subspace: ...
    @property
    def center(self) -> Subspace: ...
    @property
    def center_unstable(self) -> Subspace: ...
    @property
    def unstable(self) -> Subspace: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Placement:
    def __new__(
        cls,
        dims: _Dims | Diagnosis,
        held: Sequence[int],
        times: ArrayLike | None = None,
        *,
        method: Literal["newton", "fixed_point"] = "newton",
        tol: float = 1e-8,
        max_iterations: int = 30,
    ) -> Placement: ...
    @property
    def dims(self) -> _Dims: ...
    @property
    def held(self) -> list[int]: ...
    @property
    def times(self) -> _Floats: ...
    @property
    def method(self) -> Literal["newton", "fixed_point"]: ...
    @property
    def tol(self) -> float: ...
    @property
    def max_iterations(self) -> int: ...
    def place(
        self,
        flow: VariationalFlow,
        p: ArrayLike,
        direction: _Direction = "forward",
        *,
        max_time: float | None = None,
        max_evaluations: int | None = None,
    ) -> PlacementResult: ...
    def following(
        self, flow: VariationalFlow, optimum: Extremal, error: ArrayLike, sizes: ArrayLike, bound: float
    ) -> list[Following]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Following:
    @property
    def size(self) -> float: ...
    @property
    def without_placement(self) -> float: ...
    @property
    def with_placement(self) -> float: ...
    @property
    def status(self) -> _PlacedStatus: ...
    @property
    def left(self) -> float: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class PlacementResult:
    @property
    def p(self) -> _Floats: ...
    @property
    def status(self) -> _PlacedStatus: ...
    @property
    def message(self) -> str: ...
    @property
    def success(self) -> bool: ...
    @property
    def angle(self) -> float: ...
    @property
    def time(self) -> float: ...
    @property
    def spectrum(self) -> Spectrum | None: ...
    @property
    def n_iterations(self) -> int: ...
    @property
    def n_flow_evaluations(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Matching:
    def __new__(
        cls,
        flow: VariationalFlow,
        initial_state: ArrayLike,
        final_state: ArrayLike,
        horizon: float,
        placement: Placement,
        *,
        initial_costate: ArrayLike,
        final_costate: ArrayLike,
        match_time: float | None = None,
        corrections: ArrayLike | None = None,
    ) -> Matching: ...
    def grid_search(
        self,
        spacing: ArrayLike,
        *,
        tol: float = 2e-3,
        finest: float = 1e-4,
        max_rounds: int = 100,
        max_time: float | None = None,
        max_evaluations: int | None = None,
    ) -> MatchingResult: ...
    def least_squares(
        self,
        conserved: Sequence[int] = ...,
        *,
        tol: float = 2e-3,
        max_rounds: int = 30,
        max_time: float | None = None,
        max_evaluations: int | None = None,
    ) -> MatchingResult: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class MatchingResult:
    @property
    def status(
        self,
    ) -> Literal["matched", "exhausted", "max_rounds", "limit_reached", "no_start"]: ...
    @property
    def success(self) -> bool: ...
    @property
    def ends(self) -> _Floats: ...
    @property
    def meeting(self) -> _Floats: ...
    @property
    def mismatch(self) -> float: ...
    @property
    def n_rounds(self) -> int: ...
    @property
    def n_branches(self) -> int: ...
    @property
    def n_flow_evaluations(self) -> int: ...
    def nodes(self, times: ArrayLike) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Extremal:
    @property
    def system(self) -> System: ...
    @property
    def status(
        self,
    ) -> Literal[
        "converged",
        "floor",
        "hamiltonian_drifts",
        "stalled",
        "max_iterations",
        "singular",
        "limit_reached",
        "on_the_way",
    ]: ...
    @property
    def message(self) -> str: ...
    @property
    def success(self) -> bool: ...
    @property
    def times(self) -> _Floats: ...
    @property
    def nodes(self) -> _Floats: ...
    @property
    def residual(self) -> float: ...
    @property
    def floor(self) -> float: ...
    @property
    def hamiltonian_drift(self) -> float | None: ...
    @property
    def n_iterations(self) -> int: ...
    @property
    def n_flow_evaluations(self) -> int: ...
    @property
    def n_evaluations(self) -> int: ...
    @property
    def chain(self) -> Chain: ...
    def __call__(self, t: ArrayLike) -> _Floats: ...
    def control(self, t: ArrayLike) -> _Floats: ...
    def cost(self) -> float: ...
    def hamiltonian_range(self) -> tuple[float, float]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class ContinuationResult:
    @property
    def extremal(self) -> Extremal: ...
    @property
    def success(self) -> bool: ...
    @property
    def status(self) -> Literal["arrived", "broke_off", "limit_reached"]: ...
    @property
    def stage(self) -> str: ...
    @property
    def message(self) -> str: ...
    @property
    def s(self) -> float: ...
    @property
    def n_steps(self) -> int: ...
    @property
    def n_rejected(self) -> int: ...
    @property
    def n_iterations(self) -> int: ...
    @property
    def n_evaluations(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def arm(
    *,
    masses: _Pair = ...,
    lengths: _Pair = ...,
    damping: _Pair = ...,
    weights: _Pair = ...,
    torque_limits: _Pair | None = None,
) -> System: ...
def linear_regulator() -> System: ...
def cubic_regulator() -> System: ...
def state_costate(
    dynamics: Callable[[_Floats, _Floats], ArrayLike],
    running_cost: Callable[[_Floats, _Floats], float],
    n_states: int,
    n_controls: int,
    *,
    jacobian: Callable[[_Floats, _Floats], ArrayLike],
    gradient: Callable[[_Floats, _Floats], ArrayLike],
    hessian: Callable[[_Floats, _Floats, _Floats], ArrayLike],
    control_bounds: ArrayLike | None = None,
) -> System: ...
def tree(
    model: Model,
    weights: ArrayLike | None = None,
    *,
    torque_limits: ArrayLike | None = None,
    passive: Sequence[int] = ...,
) -> System: ...
def diagnose(spectra: Sequence[Spectrum], horizon: float) -> Diagnosis: ...
def slow_subspace(spectrum: Spectrum, dims: _Dims) -> Subspace: ...
def rank_held_costates(slow: Subspace) -> list[tuple[list[int], float]]: ...
def graded_times(horizon: float, shortest: float, longest: float) -> _Floats: ...
def shoot(
    system: System,
    initial_state: _EndStates,
    final_state: _EndStates,
    times: ArrayLike,
    nodes: ArrayLike,
    *,
    tol: float = 1e-11,
    max_iterations: int = 100,
    rtol: float = 1e-13,
    atol: float = 1e-15,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> Extremal: ...
def cold_start(
    system: System,
    initial_state: ArrayLike | Sequence[float | None] | None = None,
    final_state: ArrayLike | Sequence[float | None] | None = None,
    horizon: float | None = None,
    *,
    tol: float = 1e-11,
    max_iterations: int = 100,
    rtol: float = 1e-13,
    atol: float = 1e-15,
    first_step: float = 0.1,
    min_step: float = 1e-4,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> ContinuationResult: ...
def continue_through(
    system: System,
    stages: Sequence[tuple[ArrayLike, ArrayLike]],
    horizon: float,
    fractions: ArrayLike,
    *,
    tol: float = 1e-11,
    max_iterations: int = 100,
    rtol: float = 1e-13,
    atol: float = 1e-15,
    first_step: float = 0.1,
    min_step: float = 1e-4,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> ContinuationResult: ...
def travel_arm(
    system: System,
    initial: _Pair,
    last: _Pair,
    horizon: float,
    fold: float,
    *,
    tol: float = 1e-11,
    max_iterations: int = 100,
    rtol: float = 1e-13,
    atol: float = 1e-15,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> ContinuationResult: ...
def long_run(
    flow: VariationalFlow,
    p: ArrayLike,
    duration: float,
    transient: float,
    samples: int,
    tolerance: float,
    *,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> dict[str, Any]: ...
def field_exponents(
    flow: VariationalFlow,
    points: ArrayLike,
    duration: float,
    domain: Sequence[tuple[float, float]] | None = None,
    *,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> dict[str, Any]: ...
def grid_smoothed(values: ArrayLike, smoothing: float) -> _Floats: ...
def grid_ridges(
    values: ArrayLike,
    origin: _Pair,
    spacing: _Pair,
    height: float,
    curvature: float,
    length: float,
) -> list[list[_Floats]]: ...
def spectra_convergence(spectra: Sequence[Spectrum], tolerance: float) -> dict[str, Any]: ...
def follow(
    family: Callable[[float], tuple[System, _EndStates, _EndStates, float]],
    start: Extremal,
    *,
    tol: float = 1e-11,
    max_iterations: int = 100,
    rtol: float = 1e-13,
    atol: float = 1e-15,
    first_step: float = 0.1,
    min_step: float = 1e-4,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> ContinuationResult: ...
