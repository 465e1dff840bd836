from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias, final

from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from typing_extensions import disjoint_base

from somersault._somersault import _Floats
from somersault._somersault.forces import Gravity, _AnyForce
from somersault._somersault.integrators import RigidBody, State, _AnyMethod
from somersault._somersault.multibody import Model, Robot, TorqueProfile

__all__ = [
    "CompliantLaw",
    "Contact",
    "ContactSystem",
    "CoulombFriction",
    "CylindricalSurface",
    "Event",
    "HalfSpace",
    "HuntCrossley",
    "LinkContact",
    "LinkEvent",
    "LinkPair",
    "Platform",
    "RegularisedFriction",
    "Resistance",
    "Sensitivities",
    "SpherePair",
    "SphericalSurface",
    "Surface",
    "SurfaceFunction",
    "TreeContactSystem",
    "TreeContacts",
    "TreeGradient",
    "TreeOnPlatforms",
    "TreeSensitivities",
    "bouncing_ball",
    "damping_ratio",
    "differentiate",
    "differentiate_tree",
    "falling_box",
    "gradient_tree",
    "hopping_leg",
    "link_contacts",
    "planar_biped",
    "quadruped",
    "ragdoll",
    "restitution",
    "rolling_disk",
    "shape_contacts",
    "sliding_block",
    "spinning_top",
    "springboard",
    "tippe_top",
]

_Surface: TypeAlias = Surface | Callable[[_Floats], tuple[float, ArrayLike]]
_Parameter: TypeAlias = (
    Literal["mass", "inertia_scale"] | tuple[str, int] | tuple[Literal["acceleration"], ArrayLike]
)
_TreeParameter: TypeAlias = (
    tuple[str, int | str] | tuple[str, str, ArrayLike] | tuple[Literal["torque"], int, TorqueProfile]
)
_EventKind: TypeAlias = Literal["touch_down", "release", "re_engagement", "stick", "slip", "other"]

@disjoint_base
class Surface:
    def signed_distance(self, point: ArrayLike) -> tuple[float, _Floats]: ...

@final
class HalfSpace(Surface):
    def __new__(cls, point: ArrayLike | None = None, normal: ArrayLike | None = None) -> HalfSpace: ...
    @property
    def point(self) -> _Floats: ...
    @property
    def normal(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class SphericalSurface(Surface):
    def __new__(
        cls, center: ArrayLike, radius: float, solid: Literal["inside", "outside"] = "inside"
    ) -> SphericalSurface: ...
    @property
    def center(self) -> _Floats: ...
    @property
    def radius(self) -> float: ...
    @property
    def solid(self) -> Literal["inside", "outside"]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class CylindricalSurface(Surface):
    def __new__(
        cls,
        center: ArrayLike,
        axis: ArrayLike,
        radius: float,
        solid: Literal["inside", "outside"] = "inside",
    ) -> CylindricalSurface: ...
    @property
    def center(self) -> _Floats: ...
    @property
    def axis(self) -> _Floats: ...
    @property
    def radius(self) -> float: ...
    @property
    def solid(self) -> Literal["inside", "outside"]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class SurfaceFunction:
    def __new__(
        cls,
        function: Callable[[_Floats], tuple[float, ArrayLike]],
        *,
        lipschitz: float = 1.0,
        concavity: float = ...,
    ) -> SurfaceFunction: ...
    @property
    def function(self) -> Callable[[_Floats], tuple[float, ArrayLike]]: ...
    @property
    def lipschitz(self) -> float: ...
    @property
    def concavity(self) -> float: ...
    def __call__(self, point: _Floats) -> tuple[float, ArrayLike]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Resistance:
    def __new__(cls, rolling: float, spinning: float, speed: float) -> Resistance: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Contact:
    def __new__(
        cls,
        point: ArrayLike,
        surface: _Surface,
        law: _NormalLaw,
        *,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> Contact: ...
    @staticmethod
    def ball(
        center: ArrayLike,
        radius: float,
        surface: _Surface,
        law: _NormalLaw,
        *,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> Contact: ...
    @staticmethod
    def rim(
        center: ArrayLike,
        axis: ArrayLike,
        radius: float,
        plane: HalfSpace,
        law: _NormalLaw,
        *,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> Contact: ...
    @staticmethod
    def capsule(
        ends: ArrayLike,
        radius: float,
        surface: SphericalSurface | CylindricalSurface,
        law: _NormalLaw,
        *,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> Contact: ...
    @staticmethod
    def box(
        size: ArrayLike,
        surface: SphericalSurface,
        law: _NormalLaw,
        *,
        center: ArrayLike | None = None,
        orientation: Rotation | ArrayLike | None = None,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> Contact: ...
    @property
    def point(self) -> _Floats: ...
    @property
    def surface(self) -> _Surface: ...
    @property
    def law(self) -> _NormalLaw: ...
    @property
    def friction(self) -> _FrictionLaw | None: ...
    @property
    def resistance(self) -> Resistance | None: ...
    @property
    def radius(self) -> float | None: ...
    @property
    def axis(self) -> _Floats | None: ...
    @property
    def ends(self) -> _Floats | None: ...
    @property
    def size(self) -> _Floats | None: ...
    @property
    def orientation(self) -> _Floats | None: ...
    def gap(self, state: State) -> tuple[float, float]: ...
    def touch(self, state: State) -> tuple[_Floats, _Floats]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class SpherePair:
    def __new__(
        cls,
        bodies: tuple[int, int] | Sequence[int],
        radii: tuple[float, float] | Sequence[float],
        law: _NormalLaw,
        *,
        centers: Sequence[ArrayLike] | None = None,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> SpherePair: ...
    @property
    def bodies(self) -> tuple[int, int]: ...
    @property
    def radii(self) -> tuple[float, float]: ...
    @property
    def centers(self) -> tuple[_Floats, _Floats]: ...
    @property
    def law(self) -> _NormalLaw: ...
    @property
    def friction(self) -> _FrictionLaw | None: ...
    @property
    def resistance(self) -> Resistance | None: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class LinkContact:
    def __new__(cls, name: str, link: str, contact: Contact, on: str | None = None) -> LinkContact: ...
    @property
    def name(self) -> str: ...
    @property
    def link(self) -> str: ...
    @property
    def contact(self) -> Contact: ...
    @property
    def on(self) -> str | None: ...
    @property
    def surface(self) -> _Surface: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class LinkPair:
    def __new__(
        cls,
        name: str,
        links: tuple[str, str] | Sequence[str],
        radii: tuple[float, float] | Sequence[float],
        law: _NormalLaw,
        *,
        centers: Sequence[ArrayLike] | None = None,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> LinkPair: ...
    @staticmethod
    def of_shapes(
        name: str,
        links: tuple[str, str] | Sequence[str],
        shapes: Sequence[tuple[Literal["sphere", "capsule", "box"], ArrayLike]],
        law: _NormalLaw,
        *,
        positions: Sequence[ArrayLike] | None = None,
        orientations: Sequence[Rotation | ArrayLike] | None = None,
        friction: _FrictionLaw | None = None,
        resistance: Resistance | None = None,
    ) -> LinkPair: ...
    @property
    def name(self) -> str: ...
    @property
    def links(self) -> tuple[str, str]: ...
    @property
    def radii(self) -> tuple[float, float]: ...
    @property
    def centers(self) -> tuple[_Floats, _Floats]: ...
    @property
    def law(self) -> _NormalLaw: ...
    @property
    def friction(self) -> _FrictionLaw | None: ...
    @property
    def resistance(self) -> Resistance | None: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class LinkEvent:
    def __new__(
        cls,
        t: float,
        kind: str,
        contact: str,
        link: str,
        impulse: float,
        q: ArrayLike,
        v: ArrayLike,
        point: ArrayLike,
        force: ArrayLike,
        sliding: ArrayLike,
    ) -> LinkEvent: ...
    @property
    def t(self) -> float: ...
    @property
    def kind(self) -> _EventKind: ...
    @property
    def contact(self) -> str: ...
    @property
    def link(self) -> str: ...
    @property
    def impulse(self) -> float: ...
    @property
    def q(self) -> _Floats: ...
    @property
    def v(self) -> _Floats: ...
    @property
    def point(self) -> _Floats: ...
    @property
    def force(self) -> _Floats: ...
    @property
    def sliding(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class TreeContacts:
    def __new__(
        cls, model: Model, contacts: LinkContact | LinkPair | Sequence[LinkContact | LinkPair]
    ) -> TreeContacts: ...
    @property
    def model(self) -> Model: ...
    @property
    def contacts(self) -> list[LinkContact | LinkPair]: ...
    @property
    def names(self) -> list[str]: ...
    def forces(
        self, q: ArrayLike, v: ArrayLike, stretches: Literal["loaded"] | ArrayLike | None = None
    ) -> _Floats: ...
    def points(self, q: ArrayLike) -> _Floats: ...
    def gaps(self, q: ArrayLike, v: ArrayLike) -> tuple[_Floats, _Floats]: ...
    def jacobian(self, q: ArrayLike, contact: str) -> _Floats: ...
    def stiffest_rate(
        self, q: ArrayLike, v: ArrayLike, stretches: Literal["loaded"] | ArrayLike | None = None
    ) -> float: ...
    def energies(
        self, q: ArrayLike, v: ArrayLike, stretches: Literal["loaded"] | ArrayLike | None = None
    ) -> tuple[float, float, float]: ...
    def momentum_balance(
        self, q: ArrayLike, v: ArrayLike, stretches: Literal["loaded"] | ArrayLike | None = None
    ) -> tuple[_Floats, _Floats]: ...
    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        stretches: Literal["loaded"] | ArrayLike | None = None,
        measured: ArrayLike | None = None,
    ) -> _Floats: ...
    def equilibrium(
        self,
        q: ArrayLike,
        torque: ArrayLike | Callable[[float, _Floats, _Floats], ArrayLike] | None = None,
    ) -> tuple[_Floats, _Floats, bool]: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def shape_contacts(
    link: str,
    shape: Literal["box", "capsule", "cylinder", "sphere"],
    size: ArrayLike,
    surface: _Surface,
    law: _NormalLaw,
    *,
    friction: _FrictionLaw | None = None,
    resistance: Resistance | None = None,
    position: ArrayLike | None = None,
    orientation: Rotation | ArrayLike | None = None,
    name: str | None = None,
    on: str | None = None,
) -> list[LinkContact]: ...
def link_contacts(
    robot: Robot,
    surface: _Surface,
    law: _NormalLaw,
    *,
    friction: _FrictionLaw | None = None,
    resistance: Resistance | None = None,
    links: Sequence[str] | None = None,
    meshes: str | PathLike[str] | None = None,
    on: str | None = None,
) -> tuple[list[LinkContact], list[str]]: ...

@final
class Platform:
    def __new__(
        cls,
        name: str,
        motion: Callable[[float], Sequence[Any]],
        interval: tuple[float, float] | Sequence[float] | None = None,
    ) -> Platform: ...
    @property
    def name(self) -> str: ...
    @property
    def motion(self) -> Callable[[float], Sequence[Any]]: ...
    @property
    def interval(self) -> tuple[float, float]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class TreeOnPlatforms:
    def __new__(cls, model: Model, platforms: Sequence[Platform]) -> TreeOnPlatforms: ...
    @property
    def tree(self) -> Model: ...
    @property
    def platforms(self) -> list[Platform]: ...
    @property
    def model(self) -> Model: ...
    @property
    def active(self) -> list[bool]: ...
    def start(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> tuple[_Floats, _Floats]: ...
    def acceleration(self, t: float, q: ArrayLike | None = None, v: ArrayLike | None = None) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class TreeContactSystem:
    @property
    def model(self) -> Model: ...
    @property
    def contacts(self) -> list[LinkContact]: ...
    @property
    def q(self) -> _Floats: ...
    @property
    def v(self) -> _Floats: ...
    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Event:
    def __new__(
        cls, t: float, contact: int, kind: str, impulse: float, state: State | Sequence[State]
    ) -> Event: ...
    @property
    def t(self) -> float: ...
    @property
    def contact(self) -> int: ...
    @property
    def kind(self) -> _EventKind: ...
    @property
    def impulse(self) -> float: ...
    # A list of states for several bodies.
    @property
    def state(self) -> Any: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Sensitivities:
    @property
    def t(self) -> float: ...
    @property
    def state(self) -> State: ...
    @property
    def events(self) -> list[Event]: ...
    @property
    def by_state(self) -> _Floats: ...
    @property
    def by_parameters(self) -> _Floats: ...
    @property
    def event_times(self) -> _Floats: ...
    @property
    def stretches(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class ContactSystem:
    @property
    def body(self) -> RigidBody: ...
    @property
    def state(self) -> State: ...
    @property
    def forces(self) -> Gravity: ...
    @property
    def contacts(self) -> list[Contact]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def differentiate(
    body: RigidBody,
    state: State,
    interval: tuple[float, float] | Sequence[float],
    *,
    dt: float | None = None,
    contacts: Contact | Sequence[Contact],
    method: _AnyMethod | None = None,
    forces: _AnyForce | Sequence[_AnyForce] | None = None,
    parameters: Sequence[_Parameter] | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
    stretches: Literal["loaded"] | ArrayLike | None = None,
    grazing: float = 1.5e-8,
    max_event_rate: float = 1e9,
) -> Sensitivities: ...

@final
class TreeSensitivities:
    @property
    def t(self) -> float: ...
    @property
    def q(self) -> _Floats: ...
    @property
    def v(self) -> _Floats: ...
    @property
    def events(self) -> list[LinkEvent]: ...
    @property
    def by_state(self) -> _Floats: ...
    @property
    def by_parameters(self) -> _Floats: ...
    @property
    def event_times(self) -> _Floats: ...
    @property
    def stretches(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def differentiate_tree(
    model: Model,
    q: ArrayLike,
    v: ArrayLike,
    interval: tuple[float, float] | Sequence[float],
    *,
    dt: float | None = None,
    contacts: LinkContact | LinkPair | Sequence[LinkContact | LinkPair],
    method: _AnyMethod | None = None,
    torque: ArrayLike | TorqueProfile | Callable[[float, _Floats, _Floats], ArrayLike] | None = None,
    active: Sequence[str] | ArrayLike | None = None,
    acceleration: ArrayLike | Callable[[float, _Floats, _Floats], ArrayLike] | None = None,
    parameters: Sequence[_TreeParameter] | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
    stretches: Literal["loaded"] | ArrayLike | None = None,
    grazing: float = 1.5e-8,
    max_event_rate: float = 1e9,
) -> TreeSensitivities: ...

@final
class TreeGradient:
    @property
    def t(self) -> float: ...
    @property
    def q(self) -> _Floats: ...
    @property
    def v(self) -> _Floats: ...
    @property
    def events(self) -> list[LinkEvent]: ...
    @property
    def cost(self) -> float: ...
    @property
    def by_state(self) -> _Floats: ...
    @property
    def by_parameters(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def gradient_tree(
    model: Model,
    q: ArrayLike,
    v: ArrayLike,
    interval: tuple[float, float] | Sequence[float],
    cost: Callable[[_Floats, _Floats], tuple[float, ArrayLike | None, ArrayLike | None]] | None = None,
    *,
    dt: float | None = None,
    contacts: LinkContact | LinkPair | Sequence[LinkContact | LinkPair],
    running: Callable[[float, _Floats, _Floats], tuple[float, ArrayLike | None, ArrayLike | None]]
    | None = None,
    event_cost: Callable[[_Floats], tuple[float, ArrayLike | None]] | None = None,
    method: _AnyMethod | None = None,
    torque: ArrayLike | TorqueProfile | Callable[[float, _Floats, _Floats], ArrayLike] | None = None,
    active: Sequence[str] | ArrayLike | None = None,
    acceleration: ArrayLike | Callable[[float, _Floats, _Floats], ArrayLike] | None = None,
    parameters: Sequence[_TreeParameter] | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
    stretches: Literal["loaded"] | ArrayLike | None = None,
    grazing: float = 1.5e-8,
    max_event_rate: float = 1e9,
) -> TreeGradient: ...
def bouncing_ball(
    mass: float, radius: float, law: CompliantLaw, height: float, velocity: float = 0.0
) -> ContactSystem: ...
def spinning_top() -> ContactSystem: ...
def falling_box(
    mass: float,
    lengths: ArrayLike,
    law: _NormalLaw,
    height: float,
    heading: float = 0.0,
    *,
    friction: _FrictionLaw | None = None,
) -> ContactSystem: ...
def sliding_block(
    mass: float,
    lengths: ArrayLike,
    law: CompliantLaw,
    friction: CoulombFriction,
    velocity: float,
    slope: float = 0.0,
) -> ContactSystem: ...
def rolling_disk(
    mass: float, radius: float, law: CompliantLaw, friction: CoulombFriction, tilt: float, turning: float
) -> ContactSystem: ...
def tippe_top(
    mass: float,
    radius: float,
    eccentricity: float,
    moments: tuple[float, float],
    law: _NormalLaw,
    tilt: float,
    spin: float,
    sag: float = 0.0,
    *,
    friction: _FrictionLaw | None = None,
) -> ContactSystem: ...
def restitution(damping_ratio: float) -> float: ...
def damping_ratio(restitution: float) -> float: ...

# `make public-names` writes what follows, from the documentation of the extension.

_FrictionLaw: TypeAlias = CoulombFriction | RegularisedFriction
_FRICTION_LAWS: dict[str, type[_FrictionLaw]]

_NormalLaw: TypeAlias = CompliantLaw | HuntCrossley
_NORMAL_LAWS: dict[str, type[_NormalLaw]]

@final
class CompliantLaw:
    def __new__(cls, stiffness: float, damping: float = 0.0) -> CompliantLaw: ...
    @property
    def damping(self) -> float: ...
    def energy(self, gap: float) -> float: ...
    def force(self, gap: float, rate: float) -> float: ...
    @staticmethod
    def from_frequency(mass: float, frequency: float, damping_ratio: float) -> CompliantLaw: ...
    @staticmethod
    def from_restitution(effective_mass: float, stiffness: float, restitution: float) -> CompliantLaw: ...
    def restitution(self, effective_mass: float) -> float: ...
    @property
    def stiffness(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class CoulombFriction:
    def __new__(
        cls, coefficient: float, stiffness: float, damping: float, static_coefficient: float | None = None
    ) -> CoulombFriction: ...
    @property
    def coefficient(self) -> float: ...
    @property
    def damping(self) -> float: ...
    @property
    def static_coefficient(self) -> float: ...
    @property
    def stiffness(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class HuntCrossley:
    def __new__(cls, stiffness: float, damping: float = 0.0) -> HuntCrossley: ...
    @property
    def damping(self) -> float: ...
    def energy(self, gap: float) -> float: ...
    def force(self, gap: float, rate: float) -> float: ...
    @staticmethod
    def from_materials(
        young_moduli: Sequence[float],
        poisson_ratios: Sequence[float],
        effective_radius: float,
        damping: float = 0.0,
    ) -> HuntCrossley: ...
    @staticmethod
    def from_restitution(stiffness: float, restitution: float, speed: float) -> HuntCrossley: ...
    def restitution(self, speed: float) -> float: ...
    @property
    def stiffness(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class RegularisedFriction:
    def __new__(cls, coefficient: float, speed: float) -> RegularisedFriction: ...
    @property
    def coefficient(self) -> float: ...
    @property
    def speed(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def hopping_leg() -> TreeContactSystem: ...
def planar_biped() -> TreeContactSystem: ...
def quadruped() -> TreeContactSystem: ...
def ragdoll() -> TreeContactSystem: ...
def springboard() -> TreeContactSystem: ...
