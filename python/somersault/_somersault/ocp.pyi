from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeAlias, TypedDict, final

from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from typing_extensions import Unpack, disjoint_base

from somersault._somersault import _Active, _Floats, _NumberOrRange
from somersault._somersault.multibody import Diver, Model

__all__ = [
    "CartPendulumProblem",
    "CollocationOutcome",
    "CollocationResult",
    "Constraint",
    "Cost",
    "Dive",
    "DiveSolution",
    "DiveVerification",
    "EigenpostureBase",
    "LiteralDive",
    "Motion",
    "MotionProblem",
    "MultiphaseResult",
    "Phase",
    "PolishResult",
    "Report",
    "SearchResult",
    "SolutionSensitivity",
    "SplineMotion",
    "SwingUpVerification",
    "Term",
    "TracedPhase",
    "TracedProblem",
    "Verification",
    "axis_direction",
    "body_orientation",
    "displacement",
    "dive_107b",
    "dive_5174d",
    "entries",
    "function",
    "momentum",
    "point_position",
]

_Entry: TypeAlias = float | tuple[float, float] | None
_End: TypeAlias = Literal["start", "finish"]
_Part: TypeAlias = Literal[
    "time", "velocity", "acceleration", "torque", "channel", "channel_rate", "channel_second_rate"
]
_At: TypeAlias = Literal["path", "start", "finish", "node"]
_Solver: TypeAlias = Literal["sqp", "sqp_filter", "sqp_bfgs", "lbfgs", "gradient_descent"]
_SolveStatus: TypeAlias = Literal[
    "converged",
    "stalled",
    "iteration_limit",
    "time_limit",
    "infeasible",
    "unbounded",
    "undefined",
    "stopped",
    "interrupted",
    "failed",
]
_Template: TypeAlias = Sequence[tuple[float, str | int]]
_OnIteration: TypeAlias = Callable[[int, _Floats, float, float], object]

class _DiveOptions(TypedDict, total=False):
    first: str | int
    last: str | int
    channels: Literal["weights", "joints"]
    windows: Sequence[tuple[float, float]]
    square_out: float
    n_par: int
    somersaults: float
    twists: float
    lean: _NumberOrRange
    entry_lean: float
    duration: _NumberOrRange
    momentum: _NumberOrRange
    platform: float
    entry_distance: float
    momentum_penalty: float
    rate_penalty: float
    acceleration_penalty: float
    clearance: float | None
    clearance_times: int
    n_steps: int
    n_pieces: int
    template: _Template

class _DiveChanges(_DiveOptions, total=False):
    diver: Diver
    postures: Sequence[str | ArrayLike]

@final
class EigenpostureBase:
    def __new__(cls, postures: ArrayLike) -> EigenpostureBase: ...
    @property
    def n_joints(self) -> int: ...
    @property
    def n_weights(self) -> int: ...
    def positions(self, weights: ArrayLike) -> _Floats: ...
    def project(self, positions: ArrayLike) -> tuple[_Floats, float]: ...

@final
class SplineMotion:
    def __new__(
        cls,
        base: EigenpostureBase | int,
        n_coefficients: int,
        conditions: Sequence[tuple[_End, int, float]] | None = None,
        *,
        degree: int = 5,
    ) -> SplineMotion: ...
    @property
    def n_parameters(self) -> int: ...
    @property
    def n_channels(self) -> int: ...
    def coefficients(self, parameters: ArrayLike) -> _Floats: ...
    def __call__(self, parameters: ArrayLike, fraction: ArrayLike, derivative: int = 0) -> _Floats: ...
    def fit(self, fraction: ArrayLike, samples: ArrayLike) -> _Floats: ...

@final
class Phase:
    def __new__(
        cls, motion: SplineMotion, duration: _NumberOrRange, n_steps: int, *, n_segments: int = 1
    ) -> Phase: ...

@final
class Cost:
    def __new__(
        cls,
        term: Term,
        weights: ArrayLike | None = None,
        target: ArrayLike | None = None,
        *,
        at: _At = "path",
        node: int | None = None,
        linear: bool = False,
        phase: int | None = None,
    ) -> Cost: ...

@final
class Constraint:
    def __new__(
        cls,
        term: Term,
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        at: _At | Literal["integral"] = "path",
        node: int | None = None,
        phase: int | None = None,
    ) -> Constraint: ...

@final
class Term: ...

@final
class MotionProblem:
    def __new__(
        cls,
        model: Model,
        q: ArrayLike,
        v: ArrayLike,
        phases: Sequence[Phase],
        *,
        active: _Active,
        drive: Literal["motion", "torque"] = "motion",
        scheme: Literal["rk4", "euler"] = "rk4",
        costs: Sequence[Cost] = ...,
        constraints: Sequence[Constraint] = ...,
        free_positions: Sequence[bool] | None = None,
        free_velocities: Sequence[bool] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        exact_hessian: bool = False,
    ) -> MotionProblem: ...
    @property
    def n_variables(self) -> int: ...
    @property
    def constraint_names(self) -> list[str]: ...
    @property
    def parts(self) -> dict[str, Any]: ...
    def cost(self, z: ArrayLike) -> float: ...
    def gradient(self, z: ArrayLike) -> _Floats: ...
    def constraints(self, z: ArrayLike) -> _Floats: ...
    def jacobian(self, z: ArrayLike) -> _Floats: ...
    def solve(
        self,
        z: ArrayLike | Report,
        *,
        solver: _Solver = "sqp",
        tol: float | None = None,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        callback: _OnIteration | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> Report: ...
    def search(
        self,
        n_starts: int = 16,
        *,
        z: ArrayLike | None = None,
        starts: Sequence[ArrayLike] | _Floats | None = None,
        seed: int = 0,
        reach: ArrayLike | None = None,
        distance_tol: float = 1e-4,
        solver: _Solver = "sqp",
        tol: float | None = None,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> SearchResult: ...
    def verify(self, z: ArrayLike) -> Verification: ...
    def motion(self, z: ArrayLike) -> Motion: ...

@final
class Motion:
    @property
    def model(self) -> Model: ...
    @property
    def t(self) -> _Floats: ...
    @property
    def q(self) -> _Floats: ...
    @property
    def v(self) -> _Floats: ...
    @property
    def a(self) -> _Floats: ...
    @property
    def torque(self) -> _Floats: ...
    @property
    def channels(self) -> _Floats: ...
    @property
    def channel_rates(self) -> _Floats: ...
    @property
    def channel_second_rates(self) -> _Floats: ...
    def __len__(self) -> int: ...

@final
class Report:
    @property
    def status(self) -> _SolveStatus: ...
    @property
    def message(self) -> str: ...
    @property
    def success(self) -> bool: ...
    @property
    def verification(self) -> Verification | DiveVerification | None: ...
    @property
    def confirmed(self) -> bool | None: ...
    @property
    def motion(self) -> Motion | None: ...
    @property
    def z(self) -> _Floats: ...
    @property
    def cost(self) -> float: ...
    @property
    def constraint_multipliers(self) -> _Floats: ...
    @property
    def bound_multipliers(self) -> _Floats: ...
    @property
    def stationarity(self) -> float: ...
    @property
    def feasibility(self) -> float: ...
    @property
    def complementarity(self) -> float: ...
    @property
    def nit(self) -> int: ...
    @property
    def nfev(self) -> int: ...
    @property
    def njev(self) -> int: ...

@final
class Dive:
    def __new__(
        cls, diver: Diver, postures: Sequence[str | ArrayLike], **options: Unpack[_DiveOptions]
    ) -> Dive: ...
    def replace(self, **changes: Unpack[_DiveChanges]) -> Dive: ...
    def mirrored(self) -> Dive: ...
    @property
    def diver(self) -> Diver: ...
    @property
    def postures(self) -> tuple[str, ...]: ...
    @property
    def template(self) -> list[tuple[float, str]] | None: ...
    @property
    def options(self) -> dict[str, Any]: ...
    @property
    def n_variables(self) -> int: ...
    def start(self, template: _Template | None = None) -> _Floats: ...
    def solve(
        self,
        z: ArrayLike | DiveSolution | None = None,
        *,
        soft_weights: Sequence[float] | None = None,
        tol: float | None = None,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        callback: _OnIteration | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> DiveSolution: ...
    def search(
        self,
        n_starts: int = 16,
        *,
        seed: int = 1,
        soft_weights: Sequence[float] | None = None,
        tol: float | None = None,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> list[DiveSolution]: ...

@final
class DiveSolution:
    @property
    def dive(self) -> Dive: ...
    @property
    def report(self) -> Report: ...
    @property
    def status(self) -> _SolveStatus | Literal["false_convergence"]: ...
    @property
    def message(self) -> str: ...
    @property
    def success(self) -> bool: ...
    @property
    def confirmed(self) -> bool: ...
    @property
    def verification(self) -> DiveVerification: ...
    @property
    def z(self) -> _Floats: ...
    @property
    def momentum(self) -> float: ...
    @property
    def duration(self) -> float: ...
    @property
    def lean(self) -> float: ...
    @property
    def t(self) -> _Floats: ...
    @property
    def q(self) -> _Floats: ...
    @property
    def v(self) -> _Floats: ...
    @property
    def a(self) -> _Floats: ...
    @property
    def torques(self) -> _Floats: ...
    @property
    def peak_torques(self) -> dict[str, tuple[float, float]]: ...
    @property
    def channels(self) -> _Floats: ...
    @property
    def channel_rates(self) -> _Floats: ...
    @property
    def somersaults(self) -> _Floats: ...
    @property
    def twists(self) -> _Floats: ...
    @property
    def tilt(self) -> _Floats: ...
    @property
    def somersault_rate(self) -> _Floats: ...
    @property
    def tilt_rate(self) -> _Floats: ...
    @property
    def twist_rate(self) -> _Floats: ...
    @property
    def angular_momentum(self) -> _Floats: ...
    @property
    def entry_angle(self) -> float: ...
    @property
    def phases(self) -> list[tuple[str, float, float]]: ...
    def verify(self) -> DiveVerification: ...
    def literal(
        self,
        n_steps: int = 200,
        *,
        optimise: bool = False,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> LiteralDive: ...
    def literal_momentum(self, n_steps: int = 200) -> _Floats: ...
    def __len__(self) -> int: ...

@final
class DiveVerification:
    @property
    def confirmed(self) -> bool: ...
    @property
    def allowed(self) -> float: ...
    @property
    def message(self) -> str: ...
    @property
    def defects(self) -> _Floats: ...
    @property
    def somersaults(self) -> float: ...
    @property
    def twists(self) -> float: ...
    @property
    def tilt(self) -> float: ...
    @property
    def entry_angle(self) -> float: ...
    @property
    def entry_defect(self) -> float: ...
    @property
    def defect(self) -> float: ...
    @property
    def momentum_drift(self) -> float: ...
    @property
    def full_dynamics_defect(self) -> float: ...
    @property
    def least_channel(self) -> float: ...
    @property
    def greatest_sum(self) -> float: ...
    @property
    def least_distance(self) -> float | None: ...
    @property
    def nearest_limbs(self) -> tuple[str, str] | None: ...
    @property
    def nearest_time(self) -> float | None: ...
    @property
    def peak_torques(self) -> dict[str, tuple[float, float]]: ...
    @property
    def take_off(self) -> _Floats: ...
    @property
    def take_off_velocity(self) -> _Floats: ...

@final
class LiteralDive:
    @property
    def model(self) -> Model: ...
    @property
    def t(self) -> _Floats: ...
    @property
    def q(self) -> _Floats: ...
    @property
    def v(self) -> _Floats: ...
    @property
    def angular_momentum(self) -> _Floats: ...
    @property
    def somersaults(self) -> _Floats: ...
    @property
    def momentum_change(self) -> float: ...
    @property
    def report(self) -> Report | None: ...
    def __len__(self) -> int: ...

@final
class CartPendulumProblem:
    def __new__(
        cls,
        start: ArrayLike | None = None,
        target: ArrayLike | None = None,
        *,
        duration: float = 2.0,
        n_steps: int = 200,
        n_par: int = 7,
        scheme: Literal["euler", "rk4"] = "euler",
        terminal_weights: ArrayLike | None = None,
        force_weight: float = 1.0,
        running_weights: ArrayLike | None = None,
        cart_mass: float = 2.0,
        mass: float = 1.0,
        length: float = 1.0,
        gravity: float = 9.81,
    ) -> CartPendulumProblem: ...
    @classmethod
    def case(cls, name: Literal["A", "B", "C", "D", "E", "F", "G"]) -> CartPendulumProblem: ...
    @property
    def n_variables(self) -> int: ...
    @property
    def model(self) -> Model: ...
    def cost(self, z: ArrayLike) -> float: ...
    def gradient(self, z: ArrayLike) -> _Floats: ...
    def hessian(self, z: ArrayLike) -> _Floats: ...
    def solve(
        self,
        z: ArrayLike | Report | None = None,
        *,
        solver: Literal["sqp", "sqp_filter", "sqp_bfgs", "lbfgs", "gradient_descent"] = "sqp",
        tol: float | None = None,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        callback: Callable[[int, _Floats, float, float], object] | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> Report: ...
    def search(
        self,
        n_starts: int = 32,
        *,
        starts: Sequence[ArrayLike] | _Floats | None = None,
        seed: int = 0,
        reach: float = 1.0,
        distance_tol: float = 1e-4,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> SearchResult: ...
    def carry_over(self, other: CartPendulumProblem, z: ArrayLike) -> _Floats: ...
    def motion(self, z: ArrayLike) -> Motion: ...
    def verify(self, z: ArrayLike) -> SwingUpVerification: ...

@final
class SearchResult:
    @property
    def status(self) -> Literal["converged", "no_minimum", "interrupted", "time_limit"]: ...
    @property
    def success(self) -> bool: ...
    @property
    def minima(self) -> list[Any]: ...
    @property
    def unfinished(self) -> list[Any]: ...
    @property
    def best(self) -> Any: ...
    @property
    def starts(self) -> list[list[int]]: ...
    @property
    def failures(self) -> list[tuple[int, str]]: ...

@disjoint_base
class Verification:
    @property
    def confirmed(self) -> bool: ...
    @property
    def allowed(self) -> float: ...
    @property
    def message(self) -> str: ...
    @property
    def defects(self) -> _Floats: ...
    @property
    def max_defect(self) -> float: ...
    @property
    def terminal_error(self) -> float: ...
    @property
    def momentum_drift(self) -> float: ...
    def sentence(self, allowed: float = 1e-4) -> str: ...

@final
class SwingUpVerification(Verification):
    @property
    def cost(self) -> float: ...
    @property
    def cost_error(self) -> float: ...

@disjoint_base
class CollocationOutcome:
    @property
    def status(self) -> str: ...
    @property
    def message(self) -> str: ...
    @property
    def success(self) -> bool: ...
    @property
    def confirmed(self) -> bool: ...
    @property
    def verification(self) -> Verification: ...
    @property
    def cost(self) -> float: ...
    @property
    def verified_cost(self) -> float: ...
    @property
    def max_defect(self) -> float: ...
    @property
    def violation(self) -> float: ...
    @property
    def cost_error(self) -> float: ...
    @property
    def report(self) -> Report: ...

@final
class CollocationResult(CollocationOutcome):
    @property
    def model(self) -> Model | None: ...
    @property
    def state_names(self) -> list[str]: ...
    @property
    def control_names(self) -> list[str]: ...
    @property
    def parameter_names(self) -> list[str]: ...
    @property
    def parameters(self) -> _Floats: ...
    @property
    def t(self) -> _Floats: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def q(self) -> _Floats | None: ...
    @property
    def v(self) -> _Floats | None: ...
    @property
    def u(self) -> _Floats: ...
    @property
    def costates(self) -> _Floats: ...
    @property
    def joint_costates(self) -> _Floats | None: ...
    @property
    def hamiltonian(self) -> _Floats: ...
    @property
    def hamiltonian_spread(self) -> float: ...
    def state(self, t: ArrayLike) -> _Floats: ...
    def control(self, t: ArrayLike) -> _Floats: ...
    def costate(self, t: ArrayLike) -> _Floats: ...
    @property
    def defects(self) -> _Floats: ...
    @property
    def terminal_error(self) -> float: ...
    @property
    def meshes(self) -> list[dict[str, Any]]: ...

@final
class TracedPhase:
    def __new__(
        cls,
        functions: list[Any],
        tree: tuple[Model, list[int]] | None,
        names: list[list[str]],
        bounds: list[list[tuple[float, float]]],
        scales: tuple[list[float], list[float]] | None,
        horizon: list[tuple[float, float]],
    ) -> TracedPhase: ...
    @staticmethod
    def of_tree(
        model: Model, actuated: _Active | None
    ) -> tuple[list[int], list[str], list[str], list[int]]: ...

@final
class TracedProblem:
    def __new__(
        cls,
        phases: list[TracedPhase],
        horizons: list[list[tuple[float, float]]],
        links: list[tuple[int, int, str, int, int, tuple[float, float]]] | None,
    ) -> TracedProblem: ...
    def solve(
        self,
        start: CollocationOutcome | list[Any],
        tol: float,
        n_intervals: int | None,
        n_points: int | None,
        max_meshes: int,
        max_iterations: int | None,
        max_evaluations: int | None,
        max_time: float | None,
        callback: Callable[[int, _Floats, float, float], object] | None,
        on_interrupt: Literal["raise", "return"],
        method: Literal["auto", "shooting", "collocation", "indirect"] = "auto",
    ) -> CollocationOutcome | PolishResult: ...
    def search(
        self,
        n_starts: int,
        seed: int,
        tol: float,
        n_intervals: int | None,
        n_points: int | None,
        max_meshes: int,
        max_iterations: int | None,
        max_evaluations: int | None,
        max_time: float | None,
        on_interrupt: Literal["raise", "return"],
        method: Literal["auto", "shooting", "collocation", "indirect"],
    ) -> SearchResult: ...
    @staticmethod
    def solve_all(
        problems: list[TracedProblem],
        starts: list[Any],
        tol: float,
        n_intervals: int | None,
        n_points: int | None,
        max_meshes: int,
        max_iterations: int | None,
        max_evaluations: int | None,
        max_time: float | None,
        on_interrupt: Literal["raise", "return"],
        method: Literal["auto", "shooting", "collocation", "indirect"],
    ) -> list[CollocationOutcome | PolishResult | None]: ...
    def sensitivity(self, solution: CollocationResult) -> SolutionSensitivity: ...
    def polish(
        self, found: CollocationResult, max_evaluations: int | None, max_time: float | None
    ) -> PolishResult: ...

@final
class PolishResult:
    @property
    def verdict(
        self,
    ) -> Literal["strict_minimum", "first_order", "conjugate_point", "not_minimum", "refused"]: ...
    @property
    def success(self) -> bool: ...
    @property
    def message(self) -> str: ...
    @property
    def cost(self) -> float: ...
    @property
    def residual(self) -> float: ...
    @property
    def nit(self) -> int: ...
    @property
    def conjugate_time(self) -> float | None: ...
    @property
    def junctions(self) -> _Floats: ...
    @property
    def arcs(self) -> list[dict[str, Any]]: ...
    @property
    def horizon(self) -> tuple[float, float]: ...
    @property
    def parameters(self) -> _Floats: ...
    @property
    def found(self) -> CollocationResult: ...
    @property
    def state_names(self) -> list[str]: ...
    @property
    def control_names(self) -> list[str]: ...
    def state(self, t: ArrayLike) -> _Floats: ...
    def control(self, t: ArrayLike) -> _Floats: ...
    def costate(self, t: ArrayLike) -> _Floats: ...
    def switching(self, t: ArrayLike) -> _Floats: ...
    def hamiltonian(self, t: ArrayLike) -> _Floats: ...

@final
class SolutionSensitivity:
    @property
    def names(self) -> list[str]: ...
    @property
    def n_weakly_active(self) -> int: ...
    @property
    def cost(self) -> _Floats: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def u(self) -> _Floats: ...
    @property
    def costates(self) -> _Floats: ...
    @property
    def parameters(self) -> _Floats: ...
    @property
    def horizon(self) -> _Floats: ...
    def predict(self, changes: dict[str, float]) -> dict[str, Any]: ...

@final
class MultiphaseResult(CollocationOutcome):
    @property
    def phases(self) -> list[CollocationResult]: ...
    def __len__(self) -> int: ...

def function(
    # The node has the parts of a motion at one time as attributes.
    f: Callable[[Any], ArrayLike],
    n_rows: int = 1,
    *,
    gradient: Callable[[Any], dict[str, ArrayLike]] | None = None,
    reads: Sequence[_Part | Literal["position"]] | None = None,
) -> Term: ...
def dive_107b(**changes: Unpack[_DiveChanges]) -> Dive: ...
def dive_5174d(**changes: Unpack[_DiveChanges]) -> Dive: ...

# `make public-names` writes what follows, from the documentation of the extension.

def axis_direction(body: str, axis: ArrayLike) -> Term: ...
def body_orientation(body: str, target: Rotation | ArrayLike) -> Term: ...
def displacement(reference: ArrayLike, dofs: Sequence[int] | None = None) -> Term: ...
def entries(
    part: Literal[
        "time", "velocity", "acceleration", "torque", "channel", "channel_rate", "channel_second_rate"
    ],
    indices: Sequence[int] | None = None,
) -> Term: ...
def momentum(part: Literal["angular", "linear", "center_of_mass"]) -> Term: ...
def point_position(body: str, point: ArrayLike | None = None) -> Term: ...
