"""The scenes of the exam: bodies, what acts on them, and where they end.

All equations are written in plain arithmetic, so that the same functions take floats, arrays, symbols of
other packages and numbers of many digits. The ends are in `answers.json`; `tests/python/exam_answers.py`
computes them from these equations by Taylor series of 38 digits.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from somersault._somersault.integrators import RigidBody, State
from somersault.errors import InputError

__all__ = ["ExamScene", "SceneContact", "SceneGuard", "SceneHinge", "SceneMode", "scene", "scenes"]

Array = NDArray[np.float64]
#: A sequence of numbers of any kind: floats, symbols, or series of many digits.
Numbers: TypeAlias = Any
#: Of each body, the force in world axes and the torque about the reference point in body axes.
Wrenches: TypeAlias = list[tuple[Numbers, Numbers]]

#: Numbers of the state of one body: position, quaternion (x, y, z, w), velocity, angular velocity in the
#: body.
SIZE = 13
GRAVITY = 9.81


@dataclass(frozen=True)
class SceneContact:
    """Where a body of a scene touches something, and by which law.

    The law is ``'spring'`` (a spring and a damper that push and never pull, with `stiffness` in N/m and
    `damping` in N s/m), ``'hunt_crossley'`` (F = k x (1 + d x′) where it pushes, with the penetration x and
    d = `damping` in s/m) or ``'rigid'`` (no penetration, `restitution` at impacts). Friction is Coulomb's, or
    viscous where `viscosity` is not zero: −`viscosity` times the velocity of the point that touches.

    Attributes
    ----------
    body : int
        Number of the body.
    radius : float
        Radius of the ball that touches, m; 0 for a point.
    surface : {'floor', 'ceiling', 'sphere', 'body'}
        The half-space below or above the height `place`, a fixed sphere of radius `place` about the origin,
        or the ball of the same radius that is the body number `place`.
    place : float
        As `surface` says.
    law : {'spring', 'hunt_crossley', 'rigid'}
        The law.
    stiffness, damping, restitution, friction, viscosity : float
        Its constants; `viscosity` in N s/m.
    point : tuple of float
        The point, or the centre of the ball, in body axes from the centre of mass, m.
    """

    body: int
    radius: float
    surface: str
    place: float
    law: str
    stiffness: float = math.inf
    damping: float = 0.0
    restitution: float = 0.0
    friction: float = 0.0
    viscosity: float = 0.0
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SceneHinge:
    """What a body of a scene turns about: an axis of another body, or of the world.

    Attributes
    ----------
    body : int
        Number of the body.
    parent : int or None
        Number of the body that has the axis; None for the world.
    place : tuple of float
        The hinge, in axes of the parent from its centre of mass, or in the world, m.
    arm : tuple of float
        From the hinge to the centre of mass, in body axes, m.
    axis : tuple of float
        Unit vector along the axis, the same in the axes of both.
    """

    body: int
    parent: int | None
    place: tuple[float, float, float]
    arm: tuple[float, float, float]
    axis: tuple[float, float, float]


@dataclass(frozen=True)
class SceneGuard:
    """When a mode of a scene ends.

    Attributes
    ----------
    event : str
        What happens.
    value : callable
        ``value(t, y)`` falls through zero where the mode ends; y has 13 numbers for each body.
    next : str
        The mode that begins.
    reset : callable or None
        ``reset(y)`` has the state after it, where an impact changes velocities.
    """

    event: str
    value: Callable[[Any, Numbers], Any]
    next: str
    reset: Callable[[Numbers], list[Any]] | None = None

    def __repr__(self) -> str:
        return f"<SceneGuard {self.event}, then {self.next}>"


@dataclass(frozen=True)
class SceneMode:
    """The equations of a scene between two events.

    Attributes
    ----------
    name : str
        Its name.
    wrench : callable
        ``wrench(t, y)`` has for each body the force in world axes and the torque in body axes.
    guards : tuple of SceneGuard
        What ends it.
    """

    name: str
    wrench: Callable[[Any, Numbers], Wrenches]
    guards: tuple[SceneGuard, ...] = ()

    def __repr__(self) -> str:
        until = ", ".join(guard.event for guard in self.guards)
        return f"<SceneMode {self.name}{', until ' + until if until else ''}>"


@dataclass(frozen=True, eq=False)
class ExamScene:
    """A motion whose end is known: what an engine is asked, and the answer.

    A state is an array of shape (bodies, 13): position (m), quaternion (x, y, z, w) from the body to the
    world, velocity (m/s), and angular velocity in body axes (rad/s). The position is that of the centre of
    mass; where a body has a fixed point (`pivot`) it is that of the fixed point, and the inertia is about it.

    Attributes
    ----------
    name, title, asks, equations : str
        The name, what it is, what it asks of an engine, and its equations.
    group : {'rotation', 'contact'}
        Whether a body turns freely or under torque, or touches something.
    bodies : tuple of RigidBody
        Masses (kg) and inertias (kg m²).
    y0 : ndarray, shape (bodies, 13)
        The state at the start.
    duration, default_step : float
        How long it takes, and the step at which an engine is asked first, s.
    gravity : tuple of float
        Acceleration, m/s².
    torque : tuple of float
        Constant torque in body axes, N m.
    rotors : tuple of float
        Angular momentum of rotors relative to the body, constant in body axes, N m s.
    pivot : tuple of float or None
        From the fixed point to the centre of mass, in body axes, m.
    spring : float
        Stiffness of a spring along x to the origin, N/m.
    contacts : tuple of SceneContact
        What touches.
    hinges : tuple of SceneHinge
        What the bodies turn about.
    by_modes_only : bool
        Whether what acts is stated by `modes` alone, as where a ladder slides along two walls.
    modes : Mapping of str to SceneMode
        The equations between events, as functions; `first` is where it begins.
    parameter : str
        What the gradient is by.
    direction : ndarray, shape (bodies, 12)
        The derivative of the start by the parameter: position, rotation vector in the body, velocity, angular
        velocity in the body.
    invariants : Mapping of str to callable
        What is conserved, each a function of a state.
    variation : float
        A change of the parameter that is small for this scene.
    varied_by : float
        By how much the parameter was changed; 0 where there is an answer.
    source : str
        Where the answer comes from.

    Examples
    --------
    >>> from somersault import exam
    >>> fall = exam.scene("hard_bounce")
    >>> fall.answer.shape, len(fall.events)
    ((1, 13), 3)
    """

    name: str
    title: str
    group: str
    asks: str
    equations: str
    source: str
    bodies: tuple[RigidBody, ...]
    y0: Array
    duration: float
    default_step: float
    modes: Mapping[str, SceneMode]
    first: str
    parameter: str
    direction: Array
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    torque: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pivot: tuple[float, float, float] | None = None
    spring: float = 0.0
    contacts: tuple[SceneContact, ...] = ()
    hinges: tuple[SceneHinge, ...] = ()
    by_modes_only: bool = False
    invariants: Mapping[str, Callable[[Array], Array]] = field(default_factory=dict)
    variation: float = 1e-6
    varied_by: float = 0.0

    def __post_init__(self) -> None:
        for name in ("modes", "invariants"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __repr__(self) -> str:
        varied = f", {self.parameter} varied by {self.varied_by:.3g}" if self.varied_by else ""
        return f"<ExamScene {self.name}: {self.title}, {self.duration:g} s{varied}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.name, self.varied_by)

    @property
    def start(self) -> tuple[State, ...]:
        """The state of each body at the start."""
        return tuple(State(y[:3], y[3:7], y[7:10], angular_velocity_body=y[10:]) for y in np.asarray(self.y0))

    @property
    def answer(self) -> Array:
        """The state at the end, shape (bodies, 13)."""
        return _frozen(np.array(self._held["end"], dtype=float))

    @property
    def events(self) -> tuple[float, ...]:
        """The times of its events, s."""
        return tuple(float(t) for t in self._held["events"])

    @property
    def gradient(self) -> Array:
        """The derivative of the end by the parameter, shape (bodies, 12), in the order of `direction`."""
        return _frozen(np.array(self._held["gradient"], dtype=float))

    @property
    def condition(self) -> float:
        """How much an error along `direction` grows until the end: the ratio of the lengths of both."""
        return float(np.linalg.norm(self.gradient) / np.linalg.norm(self.direction))

    @property
    def spaces(self) -> tuple[str, ...]:
        """On which spaces something moves: ``'R3'`` if a body does, ``'SO3'`` if one turns."""
        parts = {"R3": slice(0, 3), "SO3": slice(3, 7)}
        return tuple(
            space
            for space, part in parts.items()
            if not np.array_equal(self.answer[:, part], self.y0[:, part])
        )

    @property
    def _held(self) -> dict[str, Any]:
        if self.varied_by:
            raise InputError(
                f"the scene `{self.name}` is varied by {self.varied_by:g}, and has no answer held"
            )
        found: dict[str, Any] = _answers()[self.name]
        return found

    def rate(self, mode: str, t: Any, y: Numbers) -> list[Any]:
        """The derivative of the state in a mode, as a list of 13 numbers for each body.

        It takes numbers of any kind, floats, arrays and symbols of other packages.

        Parameters
        ----------
        mode : str
            A mode of `modes`.
        t : number
            Time, s.
        y : sequence of numbers
            The state, 13 numbers for each body one after the other.

        Raises
        ------
        InputError
            If there is no such mode, or the state has another length.

        Examples
        --------
        >>> from somersault import exam
        >>> rod = exam.scene("rod")
        >>> [round(float(x), 12) for x in rod.rate("free", 0.0, rod.y0.ravel())[10:]]
        [9.9, -19.8, 0.0]
        """
        if not isinstance(mode, str) or mode not in self.modes:
            raise InputError(f"`mode` must be one of {', '.join(self.modes)}, found {mode!r}")
        if not hasattr(y, "__len__") or len(y) != self.y0.size:
            found = f"{len(y)} of them" if hasattr(y, "__len__") else f"a {type(y).__name__}"
            raise InputError(f"`y` must have {self.y0.size} numbers, found {found}")
        slopes: list[Any] = []
        for k, (force, torque) in enumerate(self.modes[mode].wrench(t, y)):
            slopes += _slope(self.bodies[k], y[SIZE * k : SIZE * (k + 1)], force, torque)
        return slopes

    def varied(self, by: float) -> ExamScene:
        """The scene with its parameter changed by this much; it has no answer of its own.

        Parameters
        ----------
        by : float
            Change of the parameter, in its unit.

        Raises
        ------
        InputError
            If it is not a finite number.

        Examples
        --------
        >>> from somersault import exam
        >>> float(exam.scene("graze").varied(0.5).y0[0, 9] - exam.scene("graze").y0[0, 9])
        0.5
        """
        if not isinstance(by, int | float) or not math.isfinite(by):
            raise InputError(f"`by` must be a finite number, found {by!r:.60}")
        y = np.array(self.y0)
        for k, d in enumerate(self.direction):
            y[k, :3] += by * d[:3]
            y[k, 3:7] = _turned(y[k, 3:7], by * d[3:6])
            y[k, 7:] += by * d[6:]
        return replace(self, y0=_frozen(y), varied_by=self.varied_by + by)


def _restored(name: str, varied_by: float) -> ExamScene:
    return scene(name).varied(varied_by) if varied_by else scene(name)


def _frozen(values: Array) -> Array:
    values.setflags(write=False)
    return values


def _turned(q: Array, angle: Array) -> Array:
    """The orientation, turned by a rotation vector in the body."""
    size = float(np.linalg.norm(angle))
    x, y, z = (0.5 if size == 0.0 else math.sin(size / 2) / size) * angle
    w, (a, b, c, d) = math.cos(size / 2), q
    product = [
        d * x + a * w + b * z - c * y,
        d * y + b * w + c * x - a * z,
        d * z + c * w + a * y - b * x,
        d * w - a * x - b * y - c * z,
    ]
    return np.array(product)


def _slope(body: RigidBody, y: Numbers, force: Numbers, torque: Numbers) -> list[Any]:
    a, b, c, d = y[3:7]
    p, q, r = y[10:13]
    i, j, k = (float(body.inertia[n, n]) for n in range(3))
    return [
        *y[7:10],
        0.5 * (d * p + b * r - c * q),
        0.5 * (d * q + c * p - a * r),
        0.5 * (d * r + a * q - b * p),
        -0.5 * (a * p + b * q + c * r),
        *(component / body.mass for component in force),
        ((j - k) * q * r + torque[0]) / i,
        ((k - i) * r * p + torque[1]) / j,
        ((i - j) * p * q + torque[2]) / k,
    ]


@cache
def _answers() -> dict[str, Any]:
    text = files("somersault.exam").joinpath("answers.json").read_text("utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def scene(name: str) -> ExamScene:
    """The scene of this name.

    Parameters
    ----------
    name : str
        A name that `scenes` lists.

    Raises
    ------
    InputError
        If there is none.

    Examples
    --------
    >>> from somersault import exam
    >>> exam.scene("pendulum")
    <ExamScene pendulum: a pendulum released at 3 rad, 3 s>
    """
    found = _table()
    if not isinstance(name, str) or name not in found:
        raise InputError(f"`name` must be one of {', '.join(found)}; found {name!r}")
    return found[name]


def scenes(group: str | None = None) -> tuple[ExamScene, ...]:
    """All scenes, or those of a group.

    Parameters
    ----------
    group : {'rotation', 'contact'}, optional
        The group.

    Raises
    ------
    InputError
        If there is no such group.

    Examples
    --------
    >>> from somersault import exam
    >>> [scene.name for scene in exam.scenes("rotation")][:3]
    ['middle_axis', 'rod', 'plate']
    """
    if group not in (None, "rotation", "contact"):
        raise InputError(f"`group` must be 'rotation' or 'contact', found {group!r}")
    return tuple(each for each in _table().values() if group in (None, each.group))


@cache
def _table() -> Mapping[str, ExamScene]:
    every = (*_rotations(), *_contacts())
    return MappingProxyType({each.name: each for each in every})


# ------------------------------------------------------------------------------------------------ parts


def _state(
    position: Sequence[float] = (0.0, 0.0, 0.0),
    quaternion: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    spin: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[float]:
    return [*position, *quaternion, *velocity, *spin]


def _along(number: int, bodies: int = 1) -> Array:
    """The direction of one number of the first body."""
    found = np.zeros((bodies, 12))
    found[0, number] = 1.0
    return _frozen(found)


def _up(y: Numbers) -> tuple[Any, Any, Any]:
    """The vertical in body axes."""
    a, b, c, d = y[3:7]
    return 2 * (a * c - d * b), 2 * (b * c + d * a), d * d - a * a - b * b + c * c


def _to_world(y: Numbers, vector: Numbers) -> list[Any]:
    """A vector of the body in world axes, in plain arithmetic; the quaternion has length 1."""
    return _rotated(y[3:6], y[6], vector)


def _to_body(y: Numbers, vector: Numbers) -> list[Any]:
    """A vector of the world in body axes, in plain arithmetic."""
    return _rotated([-1.0 * x for x in y[3:6]], y[6], vector)


def _rotated(v: Numbers, w: Any, vector: Numbers) -> list[Any]:
    once = _cross(v, vector)
    return [x + 2 * (w * a + b) for x, a, b in zip(vector, once, _cross(v, once), strict=True)]


def _cross(a: Numbers, b: Numbers) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _constant(force: Numbers = (0.0, 0.0, 0.0), torque: Numbers = (0.0, 0.0, 0.0)) -> Any:
    return lambda t, y: [(force, torque)]


def _carrying(rotors: Sequence[float]) -> Callable[[Any, Numbers], Wrenches]:
    """The torque of rotors with this angular momentum, h × ω."""
    return lambda t, y: [((0.0, 0.0, 0.0), _cross(rotors, y[10:13]))]


def _turning_energy(moments: Sequence[float], y: Array) -> Array:
    return np.asarray(0.5 * np.sum(np.asarray(moments) * y[..., 10:13] ** 2))


def _world(y: Array, vector: Array) -> Array:
    """A vector of the body in world axes, as an array."""
    return np.array(_to_world(y, vector))


def _free_invariants(
    moments: Sequence[float], rotors: Sequence[float]
) -> dict[str, Callable[[Array], Array]]:
    return {
        "energy": lambda y: _turning_energy(moments, y),
        "angular momentum": lambda y: _world(y[0], np.asarray(moments) * y[0, 10:] + np.asarray(rotors)),
    }


def _mechanical_energy(mass: float, gravity: Sequence[float]) -> Callable[[Array], Array]:
    def energy(y: Array) -> Array:
        found: Array = 0.5 * mass * np.sum(y[:, 7:10] ** 2) - mass * np.sum(y[:, :3] @ np.asarray(gravity))
        return found

    return energy


# -------------------------------------------------------------------------------------------- rotations

_EULER = "I ω′ = (I ω) × ω{},  q′ = ½ q ω  (all in body axes)"


def _turning(
    name: str,
    title: str,
    asks: str,
    source: str,
    moments: tuple[float, float, float],
    spin: tuple[float, float, float],
    duration: float,
    step: float,
    *,
    torque: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotors: tuple[float, float, float] = (0.0, 0.0, 0.0),
    parameter: str = "angular velocity about the first axis, rad/s",
    direction: int = 9,
) -> ExamScene:
    free = not any(torque)
    return ExamScene(
        name,
        title,
        "rotation",
        asks,
        _EULER.format(" + h × ω" if any(rotors) else "" if free else " + M"),
        source,
        (RigidBody(1.0, moments),),
        _frozen(np.array([_state(spin=spin)])),
        duration,
        step,
        {"free": SceneMode("free", _carrying(rotors) if any(rotors) else _constant(torque=torque))},
        "free",
        parameter,
        _along(direction),
        torque=torque,
        rotors=rotors,
        invariants=_free_invariants(moments, rotors) if free else {},
    )


def _heavy(
    name: str,
    title: str,
    asks: str,
    source: str,
    moments: tuple[float, float, float],
    mass: float,
    pivot: tuple[float, float, float],
    gravity: float,
    tilt: float,
    spin: tuple[float, float, float],
    duration: float,
    step: float,
    *,
    parameter: str = "tilt about the first axis, rad",
    direction: int = 3,
    more: Mapping[str, Callable[[Array], Array]] | None = None,
) -> ExamScene:
    """A body with a fixed point under its weight; it begins turned by `tilt` about its first axis."""

    def wrench(t: Any, y: Numbers) -> Wrenches:
        weight = [-(mass * gravity) * component for component in _up(y)]
        return [((0.0, 0.0, 0.0), _cross(pivot, weight))]

    def energy(y: Array) -> Array:
        height = float(np.dot(pivot, np.array(_up(y[0]))))
        return _turning_energy(moments, y) + mass * gravity * height

    def vertical(y: Array) -> Array:
        return np.asarray(_world(y[0], np.asarray(moments) * y[0, 10:])[2])

    q = (math.sin(tilt / 2), 0.0, 0.0, math.cos(tilt / 2))
    return ExamScene(
        name,
        title,
        "rotation",
        asks,
        _EULER.format(" + m g u × c") + ",  u the vertical and c the centre of mass",
        source,
        (RigidBody(mass, moments),),
        _frozen(np.array([_state(quaternion=q, spin=spin)])),
        duration,
        step,
        {"heavy": SceneMode("heavy", wrench)},
        "heavy",
        parameter,
        _along(direction),
        gravity=(0.0, 0.0, -gravity),
        pivot=pivot,
        invariants={"energy": energy, "vertical angular momentum": vertical, **(more or {})},
    )


def _axial(moments: Sequence[float]) -> dict[str, Callable[[Array], Array]]:
    return {"axial angular momentum": lambda y: moments[2] * y[0, 12]}


def _kovalevskaya_constant(y: Array) -> Array:
    """|(ω₁ + i ω₂)² + (m g ℓ/I₃) (u₁ + i u₂)|² with m g ℓ/I₃ = ½ as the scene has it, and ω as it turns."""
    p, q = y[0, 10:12]
    u = _up(y[0])
    found: Array = np.asarray(abs((p + 1j * q) ** 2 - 0.5 * (u[0] + 1j * u[1])) ** 2)
    return found


def _rotations() -> list[ExamScene]:
    top = ((0.02, 0.02, 0.01), 0.5, (0.0, 0.0, 0.1), GRAVITY)
    # The rate that keeps the tilt: I₁ cos θ Ω² − I₃ ω₃ Ω + m g ℓ = 0 with cos θ = 0.8, Ω = 2 rad/s.
    steady = (0.02 * 0.8 * 4.0 + 0.5 * GRAVITY * 0.1) / (0.01 * 2.0)
    return [
        _turning(
            "middle_axis",
            "a free box that turns about its middle axis",
            "the flip of an unstable rotation, and energy and angular momentum while it flips",
            "Jacobi's elliptic functions and a quadrature for the angle about the angular momentum",
            (0.052, 0.04, 0.02),
            (0.01, 5.0, 0.01),
            4.0,
            0.02,
        ),
        _turning(
            "rod",
            "a free slender rod that spins about its length",
            "a fast axis beside two slow ones",
            "a rotation about the angular momentum and one about the axis, at constant rates",
            (0.1, 0.1, 0.001),
            (2.0, 1.0, 10.0),
            3.0,
            0.02,
        ),
        _turning(
            "plate",
            "a free round plate that wobbles",
            "a precession twice as fast as the spin",
            "a rotation about the angular momentum and one about the axis, at constant rates",
            (0.01, 0.01, 0.02),
            (0.5, 0.0, 6.0),
            3.0,
            0.02,
        ),
        _turning(
            "separatrix",
            "a free body between libration and rotation",
            "a motion that ends in an unstable rotation and never reaches it",
            "ω = (a sech kt, b tanh kt, c sech kt); the angle about the angular momentum is |L| t/I₂",
            (1.0, 2.0, 2.25),
            (0.75, 0.0, 1.0),
            8.0,
            0.05,
        ),
        _turning(
            "gyrostat",
            "a free body with a rotor",
            "a torque that depends on the angular velocity and does no work",
            "elliptic functions of a pendulum in libration, and a quadrature for the angle about L",
            (1.0, 2.0, 2.5),
            (0.3, 0.8, -0.4),
            8.0,
            0.05,
            rotors=(0.5, -0.4, 1.0),
        ),
        _turning(
            "ball_torque",
            "a ball under a torque that turns with it",
            "a torque that follows the body",
            "Weber's equation for the quaternion: confluent hypergeometric functions ₁F₁",
            (0.4, 0.4, 0.4),
            (1.5, 0.0, 0.5),
            5.0,
            0.05,
            torque=(0.0, 0.0, 0.3),
        ),
        _turning(
            "axial_torque",
            "a symmetric body spun up about its axis",
            "a torque beside gyroscopic terms",
            "transverse rates turn by a quadratic phase; Weber's equation for the quaternion, ₁F₁",
            (1.0, 1.0, 0.5),
            (1.0, 0.0, 1.0),
            5.0,
            0.05,
            torque=(0.0, 0.0, 0.4),
        ),
        _turning(
            "skew_torque",
            "a symmetric body under a torque askew to its axis",
            "a torque that drives all three rates",
            "Fresnel's integrals for the rates; a linear equation for the quaternion",
            (1.0, 1.0, 0.5),
            (1.0, 0.0, 1.0),
            5.0,
            0.05,
            torque=(0.3, -0.2, 0.4),
        ),
        _heavy(
            "lagrange_top",
            "Lagrange's top, released without precession",
            "fast spin, slow precession and nutation together",
            "the cosine of the tilt is an elliptic function, sn²",
            *top,
            0.6,
            (0.0, 0.0, 40.0),
            1.5,
            0.005,
            more=_axial(top[0]),
        ),
        _heavy(
            "steady_top",
            "a top in steady precession",
            "a constant tilt",
            "precession and spin at constant rates, with I₁ cos θ Ω² − I₃ ω₃ Ω + m g ℓ = 0",
            *top,
            math.acos(0.8),
            (0.0, 2.0 * 0.6, steady),
            2.0,
            0.005,
            more=_axial(top[0]),
        ),
        _heavy(
            "sleeping_top",
            "a sleeping top, upright above its threshold",
            "gyroscopic stability, at 1.3 times the spin 2 √(I₁ m g ℓ)/I₃ below which it falls",
            "a rotation about the vertical; its linearisation for the derivative",
            *top,
            0.0,
            (0.0, 0.0, 1.3 * 2 * math.sqrt(0.02 * 0.5 * GRAVITY * 0.1) / 0.01),
            1.0,
            0.002,
            more=_axial(top[0]),
        ),
        _heavy(
            "kovalevskaya",
            "Kovalevskaya's top",
            "a motion that is integrable and not periodic",
            "Taylor series; Kovalevskaya's constant, energy and vertical angular momentum",
            (2.0, 2.0, 1.0),
            1.0,
            (0.5, 0.0, 0.0),
            1.0,
            0.7,
            (0.3, 0.8, 0.5),
            10.0,
            0.05,
            more={"Kovalevskaya's constant": _kovalevskaya_constant},
        ),
        _heavy(
            "pendulum",
            "a pendulum released at 3 rad",
            "a motion near the unstable equilibrium, and its derivative",
            "sin(θ/2) = k cd(ω₀ t, k) with k = sin 1.5",
            (0.3, 0.3, 0.05),
            1.0,
            (0.0, 0.0, -0.5),
            GRAVITY,
            3.0,
            (0.0, 0.0, 0.0),
            3.0,
            0.01,
            parameter="angle at the start, rad",
        ),
        _double_pendulum(),
    ]


def _about_first(y: Numbers) -> tuple[Any, Any]:
    """Sine and cosine of the angle by which a body is turned about its first axis."""
    return 2 * y[3] * y[6], y[6] * y[6] - y[3] * y[3]


def _double_pendulum() -> ExamScene:
    (m, n), (long, half, short) = (2.0, 1.0), (1.0, 0.5, 0.4)
    moments = (m * long**2 / 12, n * short**2 / 3)
    angles = (2.0, -1.0)

    def turning(y: Numbers) -> list[Any]:
        """Sines, cosines and rates of both angles, and their accelerations."""
        (s, c), (p, d) = _about_first(y[:SIZE]), _about_first(y[SIZE:])
        v, w = y[10], y[SIZE + 10]
        across, along = s * d - c * p, c * d + s * p
        mass = (moments[0] + m * half**2 + n * long**2, n * long * short * along, moments[1] + n * short**2)
        pull = (
            -(n * long * short) * (across * w * w) - (m * half + n * long) * GRAVITY * s,
            n * long * short * (across * v * v) - n * short * GRAVITY * p,
        )
        whole = mass[0] * mass[2] - mass[1] * mass[1]
        first = (mass[2] * pull[0] - mass[1] * pull[1]) / whole
        second = (mass[0] * pull[1] - mass[1] * pull[0]) / whole
        return [s, c, v, first, p, d, w, second]

    def wrench(t: Any, y: Numbers) -> Wrenches:
        s, c, v, first, p, d, w, second = turning(y)
        end = (first * c - v * v * s, first * s + v * v * c)
        more = (second * d - w * w * p, second * p + w * w * d)
        return [
            ((0.0, m * half * end[0], m * half * end[1]), (moments[0] * first, 0.0, 0.0)),
            (
                (0.0, n * (long * end[0] + short * more[0]), n * (long * end[1] + short * more[1])),
                (moments[1] * second, 0.0, 0.0),
            ),
        ]

    def energy(y: Array) -> Array:
        found: Array = np.asarray(
            0.5 * (m * np.sum(y[0, 7:10] ** 2) + n * np.sum(y[1, 7:10] ** 2))
            + 0.5 * (moments[0] * y[0, 10] ** 2 + moments[1] * y[1, 10] ** 2)
            + GRAVITY * (m * y[0, 2] + n * y[1, 2])
        )
        return found

    (s, p), (c, d) = map(math.sin, angles), map(math.cos, angles)
    turned = [(math.sin(angle / 2), 0.0, 0.0, math.cos(angle / 2)) for angle in angles]
    direction = np.zeros((2, 12))
    direction[0, [1, 2, 3]] = half * c, half * s, 1.0
    direction[1, [1, 2]] = long * c, long * s
    return ExamScene(
        "double_pendulum",
        "a double pendulum of two rods",
        "rotation",
        "two bodies in a chain, a chaotic motion and its derivative",
        "Lagrange's equations of both angles from the vertical",
        "Taylor series; Hamilton's equations by another integrator, and energy",
        (RigidBody(m, (moments[0], moments[0], 1e-3)), RigidBody(n, (moments[1], moments[1], 1e-3))),
        _frozen(
            np.array(
                [
                    _state((0.0, half * s, -half * c), turned[0]),
                    _state((0.0, long * s + short * p, -long * c - short * d), turned[1]),
                ]
            )
        ),
        2.0,
        0.01,
        {"swing": SceneMode("swing", wrench)},
        "swing",
        "angle of the first rod at the start, rad",
        _frozen(direction),
        gravity=(0.0, 0.0, -GRAVITY),
        hinges=(
            SceneHinge(0, None, (0.0, 0.0, 0.0), (0.0, 0.0, -half), (1.0, 0.0, 0.0)),
            SceneHinge(1, 0, (0.0, 0.0, -half), (0.0, 0.0, -short), (1.0, 0.0, 0.0)),
        ),
        invariants={"energy": energy},
    )


# --------------------------------------------------------------------------------------------- contacts


def _contact(
    name: str,
    title: str,
    asks: str,
    equations: str,
    source: str,
    bodies: tuple[RigidBody, ...],
    y0: list[list[float]],
    duration: float,
    step: float,
    modes: Sequence[SceneMode],
    parameter: str,
    direction: Array,
    **more: Any,
) -> ExamScene:
    table = {mode.name: mode for mode in modes}
    return ExamScene(
        name, title, "contact", asks, equations, source, bodies, _frozen(np.array(y0)), duration, step,
        table, modes[0].name, parameter, direction, **more,
    )  # fmt: skip


def _point(mass: float) -> tuple[RigidBody, ...]:
    return (RigidBody.sphere(mass, 0.1),)


def _compliant_bounce() -> ExamScene:
    k, c, down = 1e3, 10.0, (0.0, 0.0, -GRAVITY)

    def push(t: Any, y: Numbers) -> Any:
        return -(k * y[2]) - c * y[9]

    modes = [
        SceneMode("flight", _constant(down), (SceneGuard("touch-down", lambda t, y: y[2], "contact"),)),
        SceneMode(
            "contact",
            lambda t, y: [((0.0, 0.0, push(t, y) - GRAVITY), (0.0, 0.0, 0.0))],
            (SceneGuard("release", push, "flight"),),
        ),
    ]
    return _contact(
        "spring_bounce",
        "a body that bounces on a spring and a damper",
        "touch-downs and releases of a compliant contact",
        "m z″ = −m g + F,  F = −k z − c z′ where z < 0 and F > 0, else 0",
        "parabolas and damped oscillations, joined at the roots of z and F",
        _point(1.0), [_state((0.0, 0.0, 0.5))], 1.2, 0.01, modes,
        "height at the start, m", _along(2), gravity=down,
        contacts=(SceneContact(0, 0.0, "floor", 0.0, "spring", k, c),),
    )  # fmt: skip


def _hunt_crossley() -> ExamScene:
    k, d = 2e3, 0.3

    def push(y: Numbers) -> Any:
        return -(k * y[2]) * (1.0 - d * y[9])

    modes = [
        SceneMode("before", _constant(), (SceneGuard("touch-down", lambda t, y: y[2], "contact"),)),
        SceneMode(
            "contact",
            lambda t, y: [((0.0, 0.0, push(y)), (0.0, 0.0, 0.0))],
            (SceneGuard("release", lambda t, y: -y[2], "after"),),
        ),
        SceneMode("after", _constant()),
    ]
    return _contact(
        "hunt_crossley",
        "a body that hits a spring with Hunt and Crossley's dissipation",
        "an impact without weight; the force is zero at both of its ends, and the smoother law is easier",
        "m z″ = F,  F = −k z (1 − d z′) where z < 0 and F > 0, else 0",
        "(ln(1 + d w) − d w)/d² + k z²/(2 m) is constant in contact with w = −z′; a quadrature for the time",
        _point(1.0), [_state((0.0, 0.0, 0.5), velocity=(0.0, 0.0, -2.0))], 0.6, 0.01, modes,
        "velocity at the start, m/s", _along(8),
        contacts=(SceneContact(0, 0.0, "floor", 0.0, "hunt_crossley", k, d),),
    )  # fmt: skip


def _hard_bounce() -> ExamScene:
    e, down = 0.8, (0.0, 0.0, -GRAVITY)

    def reset(y: Numbers) -> list[Any]:
        return [*y[:9], -e * y[9], *y[10:]]

    flight = SceneMode("flight", _constant(down), (SceneGuard("impact", lambda t, y: y[2], "flight", reset),))
    return _contact(
        "hard_bounce",
        "a body that bounces with restitution 0.8",
        "impacts at the right times, and the derivative through them; at rest after √(2h/g) (1 + e)/(1 − e)",
        "m z″ = −m g;  z′ becomes −e z′ where z falls through 0",
        "a geometric series of flights",
        _point(1.0), [_state((0.0, 0.0, 1.0))], 2.0, 0.01, [flight],
        "height at the start, m", _along(2), gravity=down,
        contacts=(SceneContact(0, 0.0, "floor", 0.0, "rigid", restitution=e),),
    )  # fmt: skip


def _zeno_rest() -> ExamScene:
    e, mu, height, down = 0.5, 0.15, 1.0, (0.0, 0.0, -GRAVITY)
    slowest = 1e-6
    # the impact after which it would leave more slowly than that
    last = math.ceil(math.log(math.sqrt(2 * GRAVITY * height) / slowest) / math.log(1 / e))

    def reset(left: float) -> Callable[[Numbers], list[Any]]:
        def after(y: Numbers) -> list[Any]:
            return [*y[:7], y[7] + mu * (1.0 + left) * y[9], y[8], -left * y[9], *y[10:]]

        return after

    def flight(k: int) -> SceneMode:
        ends = k == last
        guard = SceneGuard(
            "impact",
            lambda t, y: y[2],
            "rest" if ends else f"flight {k + 1}",
            reset(0.0 if ends else e),
        )
        return SceneMode(f"flight {k}", _constant(down), (guard,))

    rest = SceneMode("rest", _constant((-mu * GRAVITY, 0.0, 0.0)))
    return _contact(
        "zeno_rest",
        "a body that slides while its bounces die out",
        f"{last} impacts that accumulate at √(2h/g) (1 + e)/(1 − e), and the rest after them",
        "m r″ = −m g e₃;  z′ becomes −e z′ where z falls through 0, or 0 where it would be below 10⁻⁶ m/s,"
        " and x′ falls by μ times the change of z′;  x″ = −μ g at rest",
        "x = v₀ t − μ (g t²/2 − h): the floor gives back the impulse of the weight, whatever the bounces",
        _point(1.0), [_state((0.0, 0.0, height), velocity=(4.0, 0.0, 0.0))], 2.0, 0.01,
        [*(flight(k) for k in range(1, last + 1)), rest],
        "height at the start, m", _along(2), gravity=down,
        contacts=(SceneContact(0, 0.0, "floor", 0.0, "rigid", restitution=e, friction=mu),),
    )  # fmt: skip


def _graze() -> ExamScene:
    k, height, depth, down = 1e4, 1.0, 1e-8, (0.0, 0.0, -GRAVITY)

    def energy(y: Array) -> Array:
        stored: Array = 0.5 * k * np.maximum(y[0, 2] - height, 0.0) ** 2
        return _mechanical_energy(1.0, down)(y) + stored

    modes = [
        SceneMode("flight", _constant(down), (SceneGuard("touch", lambda t, y: height - y[2], "contact"),)),
        SceneMode(
            "contact",
            lambda t, y: [((0.0, 0.0, -GRAVITY - k * (y[2] - height)), (0.0, 0.0, 0.0))],
            (SceneGuard("release", lambda t, y: y[2] - height, "flight"),),
        ),
    ]
    return _contact(
        "graze",
        "a body thrown up that grazes a spring by 10⁻⁸ m",
        "a contact of 90 µs that hardly changes the height, and changes its derivative by 0.18",
        "m z″ = −m g − k (z − 1) where z > 1, else −m g",
        "parabolas and a sine",
        _point(1.0), [_state(velocity=(0.0, 0.0, math.sqrt(2 * GRAVITY * (height + depth))))], 0.9, 0.01,
        modes, "velocity at the start, m/s", _along(8), gravity=down,
        contacts=(SceneContact(0, 0.0, "ceiling", height, "spring", k, 0.0),),
        invariants={"energy": energy}, variation=2e-9,
    )  # fmt: skip


def _on_slope(slope: float) -> tuple[float, float, float]:
    """The weight of 1 kg on a slope, in axes along it and normal to it."""
    return GRAVITY * math.sin(slope), 0.0, -GRAVITY * math.cos(slope)


def _halted(y: Numbers) -> list[Any]:
    """The state with no velocity along x."""
    return [*y[:7], 0.0, *y[8:]]


def _incline(
    name: str, title: str, asks: str, mu: float, slope: float, speed: float, duration: float
) -> ExamScene:
    along, _, normal = weight = _on_slope(slope)
    slips = _constant((along + mu * normal, 0.0, 0.0))
    stops = along + mu * normal < 0.0
    modes = [SceneMode("slip", slips)]
    if stops:
        stop = SceneGuard("stop", lambda t, y: y[7], "rest", _halted)
        modes = [SceneMode("slip", slips, (stop,)), SceneMode("rest", _constant())]
    return _contact(
        name, title, asks,
        "m x″ = m g sin α − μ m g cos α while x′ > 0; at rest where tan α < μ",
        "a parabola" + (", then rest" if stops else ""),
        _point(1.0), [_state(velocity=(speed, 0.0, 0.0))], duration, 0.01, modes,
        "velocity at the start, m/s", _along(6), gravity=weight,
        contacts=(SceneContact(0, 0.0, "floor", 0.0, "rigid", friction=mu),),
    )  # fmt: skip


def _slide_to_roll() -> ExamScene:
    mu, radius, mass = 0.2, 0.1, 1.0
    ball = RigidBody.sphere(mass, radius)
    drag = mu * mass * GRAVITY

    def slip(t: Any, y: Numbers) -> Any:
        return y[7] - radius * y[11]

    modes = [
        SceneMode(
            "slide",
            _constant((-drag, 0.0, 0.0), (0.0, radius * drag, 0.0)),
            (SceneGuard("roll", slip, "roll"),),
        ),
        SceneMode("roll", _constant()),
    ]
    return _contact(
        "slide_to_roll",
        "a ball that slides, then rolls",
        "the end of sliding: v = 5/7 v₀ at t = 2 v₀/(7 μ g)",
        "m x″ = −μ m g, I ω′ = r μ m g while x′ > r ω; then both are constant",
        "a parabola, then a line",
        (ball,), [_state((0.0, 0.0, radius), velocity=(2.0, 0.0, 0.0))], 0.5, 0.01, modes,
        "velocity at the start, m/s", _along(6), gravity=(0.0, 0.0, -GRAVITY),
        contacts=(SceneContact(0, radius, "floor", 0.0, "rigid", friction=mu),),
    )  # fmt: skip


def _rolling_incline() -> ExamScene:
    radius, weight = 0.1, _on_slope(0.3)
    ball = RigidBody.sphere(1.0, radius)
    drag = 2.0 / 7.0 * weight[0]
    mode = SceneMode("roll", _constant((weight[0] - drag, 0.0, 0.0), (0.0, radius * drag, 0.0)))
    direction = np.zeros((1, 12))
    direction[0, 6], direction[0, 10] = 1.0, 1.0 / radius
    return _contact(
        "rolling_incline",
        "a ball that rolls down a slope",
        "rolling without slipping: μ exceeds 2/7 tan α",
        "m x″ = m g sin α − F, I ω′ = r F, x′ = r ω",
        "a parabola with 5/7 of g sin α",
        (ball,), [_state((0.0, 0.0, radius))], 1.0, 0.01, [mode],
        "velocity at the start, m/s, rolling", _frozen(direction), gravity=weight,
        contacts=(SceneContact(0, radius, "floor", 0.0, "rigid", friction=0.4),),
    )  # fmt: skip


def _spin_impact() -> ExamScene:
    radius, mass, e = 0.1, 1.0, 0.7
    ball = RigidBody.sphere(mass, radius)
    moment = float(ball.inertia[1, 1])
    down = (0.0, 0.0, -GRAVITY)

    def reset(y: Numbers) -> list[Any]:
        impulse = -(2.0 / 7.0) * mass * (y[7] - radius * y[11])
        after = list(y)
        after[7], after[9] = y[7] + impulse / mass, -e * y[9]
        after[11] = y[11] - radius * impulse / moment
        return after

    modes = [
        SceneMode(
            "fall", _constant(down), (SceneGuard("impact", lambda t, y: y[2] - radius, "rise", reset),)
        ),
        SceneMode("rise", _constant(down)),
    ]
    start = _state((0.0, 0.0, 0.6), velocity=(1.0, 0.0, 0.0), spin=(0.0, -5.0, 0.0))
    return _contact(
        "spin_impact",
        "a ball with backspin that hits a rough floor",
        "an oblique impact that ends in rolling: impulse −2/7 m (x′ − r ω), below μ times the normal one",
        "m r″ = −m g e₃;  at the impact z′ becomes −e z′ and x′ = r ω",
        "parabolas",
        (ball,), [start], 0.7, 0.01, modes,
        "spin at the start, rad/s", _along(10), gravity=down,
        contacts=(SceneContact(0, radius, "floor", 0.0, "rigid", restitution=e, friction=0.5),),
    )  # fmt: skip


def _leaving_sphere() -> ExamScene:
    radius, tilt, mass, down = 1.0, 0.2, 1.0, (0.0, 0.0, -GRAVITY)

    def normal(t: Any, y: Numbers) -> Any:
        return mass * (GRAVITY * y[2] - y[7] * y[7] - y[9] * y[9]) / radius

    modes = [
        SceneMode(
            "slide",
            lambda t, y: [
                (
                    (normal(t, y) * y[0] / radius, 0.0, normal(t, y) * y[2] / radius - mass * GRAVITY),
                    (0.0, 0.0, 0.0),
                )
            ],
            (SceneGuard("leave", normal, "flight"),),
        ),
        SceneMode("flight", _constant(down)),
    ]
    direction = np.zeros((1, 12))
    direction[0, 0], direction[0, 2] = math.cos(tilt), -math.sin(tilt)
    return _contact(
        "leaving_sphere",
        "a body that slides off a smooth sphere",
        "the end of a contact by its force: it leaves where cos θ = ⅔ cos θ₀",
        "m r″ = −m g e₃ + N n,  N = m (g cos θ − v²/R) until it is 0",
        "an elliptic integral for the time, then a parabola",
        _point(mass), [_state((math.sin(tilt), 0.0, math.cos(tilt)))], 1.0, 0.01, modes,
        "angle at the start, rad", _frozen(direction), gravity=down,
        contacts=(SceneContact(0, 0.0, "sphere", radius, "rigid"),),
        invariants={"energy": _mechanical_energy(mass, down)},
    )  # fmt: skip


def _ladder() -> ExamScene:
    half, mass, tilt = 1.0, 1.0, 0.4
    moment, down = mass * half * half / 3.0, (0.0, 0.0, -GRAVITY)
    body = RigidBody(mass, (moment, moment, 0.01))

    def parts(y: Numbers) -> tuple[Any, Any, Any]:
        """Sine and cosine of the angle from the wall, by which the body turns back about y, and its rate."""
        return -2 * y[4] * y[6], y[6] * y[6] - y[4] * y[4], -y[11]

    def leaning(y: Numbers) -> tuple[Any, Any, Any]:
        sine, cosine, rate = parts(y)
        turn = 0.75 * GRAVITY / half * sine
        wall = mass * half * (cosine * turn - sine * rate * rate)
        floor = mass * (GRAVITY - half * (sine * turn + cosine * rate * rate))
        return turn, wall, floor

    def on_both(t: Any, y: Numbers) -> Wrenches:
        turn, wall, floor = leaning(y)
        return [((wall, 0.0, floor - mass * GRAVITY), (0.0, -moment * turn, 0.0))]

    def on_floor(t: Any, y: Numbers) -> Wrenches:
        sine, cosine, rate = parts(y)
        floor = (
            moment
            * mass
            * (GRAVITY - half * cosine * rate * rate)
            / (moment + mass * half * half * sine * sine)
        )
        return [((0.0, 0.0, floor - mass * GRAVITY), (0.0, -(half * sine * floor), 0.0))]

    def energy(y: Array) -> Array:
        return _mechanical_energy(mass, down)(y) + _turning_energy((moment, moment, 0.01), y)

    modes = [
        SceneMode("wall", on_both, (SceneGuard("leave", lambda t, y: leaning(y)[1], "floor"),)),
        SceneMode("floor", on_floor),
    ]
    direction = np.zeros((1, 12))
    direction[0, [0, 2, 4]] = half * math.cos(tilt), -half * math.sin(tilt), -1.0
    return _contact(
        "ladder",
        "a smooth ladder that slides down a wall and leaves it",
        "one of two constraints that ends: cos θ = ⅔ cos θ₀",
        "(I + m h²) θ″ = m g h sin θ at the wall, then"
        " (I + m h² sin²θ) θ″ = m h sin θ (g − h cos θ θ′²)",
        "an elliptic integral for the time at the wall; energy after it",
        (body,),
        [_state((half * math.sin(tilt), 0.0, half * math.cos(tilt)),
                (0.0, -math.sin(tilt / 2), 0.0, math.cos(tilt / 2)))],
        0.65, 0.01, modes,
        "angle at the start, rad", _frozen(direction), gravity=down, by_modes_only=True,
        invariants={"energy": energy},
    )  # fmt: skip


def _tipping_block() -> ExamScene:
    half, tall, slope, mu = 0.1, 0.25, math.atan(0.5), 0.9
    mass, weight = 1.0, _on_slope(slope)
    arm = half * half + tall * tall
    moments = (
        mass * (half**2 + tall**2) / 3, mass * (half**2 + tall**2) / 3, mass * 2 * half**2 / 3,
    )  # fmt: skip

    def wrench(t: Any, y: Numbers) -> Wrenches:
        """The lower edge stands still: the block turns about it as a pendulum."""
        sine, cosine, rate = 2 * y[4] * y[6], y[6] * y[6] - y[4] * y[4], y[11]
        x, z = tall * sine - half * cosine, tall * cosine + half * sine
        turn = (z * weight[0] - x * weight[2]) * (mass / (moments[1] + mass * arm))
        force = (mass * (turn * z - rate * rate * x), 0.0, -mass * (turn * x + rate * rate * z))
        return [(force, (0.0, moments[1] * turn, 0.0))]

    def energy(y: Array) -> Array:
        return _mechanical_energy(mass, weight)(y) + _turning_energy(moments, y)

    direction = np.zeros((1, 12))
    direction[0, [0, 2, 4]] = tall, half, 1.0
    corners = [(x, y, -tall) for x in (-half, half) for y in (-half, half)]
    return _contact(
        "tipping_block",
        "a block on a slope that tips and does not slide",
        "tipping where tan α exceeds the breadth by the height, b/h = 0.4, and not sliding below μ = 0.9",
        "(I + m r²) θ″ = m g r sin θ with θ from the vertical to the centre of mass, about the lower edge",
        "an elliptic integral for the time; force of the edge within the cone of friction",
        (RigidBody(mass, moments),), [_state((-half, 0.0, tall))], 0.4, 0.01,
        [SceneMode("tip", wrench)],
        "angle at the start, rad", _frozen(direction), gravity=weight,
        contacts=tuple(
            SceneContact(0, 0.0, "floor", 0.0, "rigid", friction=mu, point=corner) for corner in corners
        ),
        invariants={"energy": energy},
    )  # fmt: skip


def _tippe_top() -> ExamScene:
    radius, off, mass, viscosity, down = 0.05, 0.015, 0.1, 3.0, (0.0, 0.0, -GRAVITY)
    across, along = 1e-4, 0.95e-4
    tilt, spin = 0.3, 100.0

    def wrench(t: Any, y: Numbers) -> Wrenches:
        """The centre of the ball stays at its height: m z″ = N − m g with z = r − off cos θ."""
        u, w = _up(y), y[10:13]
        arm = (-radius * u[0], -radius * u[1], off - radius * u[2])
        slips = [a + b for a, b in zip(_to_body(y, y[7:10]), _cross(w, arm), strict=True)]
        drag = [-viscosity * slip for slip in slips]
        drives = _cross(arm, drag)
        about = [
            (across - along) * (w[1] * w[2]) + drives[0],
            (along - across) * (w[2] * w[0]) + drives[1],
            drives[2],
        ]
        falls = _cross(u, w)
        # −z″/off but for the part of the force of the floor in ω′
        known = (u[0] * about[1] - u[1] * about[0]) / across + falls[0] * w[1] - falls[1] * w[0]
        lean = u[0] * u[0] + u[1] * u[1]
        push = mass * (GRAVITY - off * known) / (1.0 + mass * off * off / across * lean)
        torque = (drives[0] - off * push * u[1], drives[1] + off * push * u[0], drives[2])
        x, y_, z = _to_world(y, drag)
        return [((x, y_, z + push - mass * GRAVITY), torque)]

    def jellett(y: Array) -> Array:
        u = np.array(_up(y[0]))
        arm = np.array([0.0, 0.0, off]) - radius * u
        return np.asarray(-np.dot(np.array([across, across, along]) * y[0, 10:], arm))

    q = (math.sin(tilt / 2), 0.0, 0.0, math.cos(tilt / 2))
    start = _state((0.0, 0.0, radius - off * math.cos(tilt)), q, spin=(0.0, 0.0, spin))
    return _contact(
        "tippe_top",
        "a tippe top that turns over",
        "a ball that slips and turns, lifts its centre of mass and keeps Jellett's integral",
        "I ω′ = (I ω) × ω + c × F,  m (v′ + g e₃) = F = N u − k (v + ω × c),  with c to the lowest point"
        " and N such that the ball stays on the floor",
        "Taylor series; multipliers in world axes by another integrator, and Jellett's integral −L·c",
        (RigidBody(mass, (across, across, along)),), [start], 0.4, 0.002,
        [SceneMode("slip", wrench)],
        "spin at the start, rad/s", _along(11), gravity=down,
        contacts=(
            SceneContact(
                0, radius, "floor", 0.0, "rigid", friction=math.inf, viscosity=viscosity,
                point=(0.0, 0.0, off),
            ),
        ),
        invariants={"Jellett's integral": jellett}, variation=1e-4,
    )  # fmt: skip


def _dry_oscillator() -> ExamScene:
    k, mu, mass = 20.0, 0.1, 1.0
    drag = mu * mass * GRAVITY

    def moving(sign: float) -> Any:
        return lambda t, y: [((-(k * y[0]) - sign * drag, 0.0, 0.0), (0.0, 0.0, 0.0))]

    modes = [
        SceneMode("left", moving(-1.0), (SceneGuard("turn", lambda t, y: -y[7], "right", _halted),)),
        SceneMode("right", moving(1.0), (SceneGuard("turn", lambda t, y: y[7], "left again", _halted),)),
        SceneMode("left again", moving(-1.0), (SceneGuard("stop", lambda t, y: -y[7], "rest", _halted),)),
        SceneMode("rest", _constant()),
    ]
    return _contact(
        "dry_oscillator",
        "a mass on a spring with dry friction",
        "turning points, and the stop within the band |k x| ≤ μ m g",
        "m x″ = −k x − μ m g sign x′; at rest where x′ = 0 and |k x| ≤ μ m g",
        "half cosines about ±μ m g/k, three of them",
        _point(mass), [_state((0.28, 0.0, 0.0))], 2.5, 0.01, modes,
        "displacement at the start, m", _along(0), gravity=(0.0, 0.0, -GRAVITY), spring=k,
        contacts=(SceneContact(0, 0.0, "floor", 0.0, "rigid", friction=mu),),
    )  # fmt: skip


def _two_balls() -> ExamScene:
    radius, mass = 0.1, 1.0
    ball = RigidBody.sphere(mass, radius)
    gap = 0.32

    def reset(y: Numbers) -> list[Any]:
        after = list(y)
        after[7], after[SIZE + 7] = y[SIZE + 7], y[7]
        return after

    still: Any = lambda t, y: [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))] * 2  # noqa: E731
    modes = [
        SceneMode(
            "before",
            still,
            (SceneGuard("impact", lambda t, y: y[SIZE] - y[0] - 2 * radius, "after", reset),),
        ),
        SceneMode("after", still),
    ]
    return _contact(
        "two_balls",
        "a ball that hits an equal one, elastically",
        "the exchange of velocities; the start of the first ball moves the end of the second",
        "m x″ = 0;  the velocities are exchanged where the balls touch",
        "lines",
        (ball, ball),
        [_state(velocity=(1.0, 0.0, 0.0)), _state((gap + 2 * radius, 0.0, 0.0))],
        1.0, 0.01, modes,
        "position of the first ball, m", _along(0, 2),
        contacts=(SceneContact(0, radius, "body", 1, "rigid", restitution=1.0),),
        invariants={
            "energy": _mechanical_energy(mass, (0.0, 0.0, 0.0)),
            "momentum": lambda y: mass * y[:, 7:10].sum(axis=0),
        },
    )  # fmt: skip


def _cradle() -> ExamScene:
    radius, mass, gap = 0.1, 1.0, 0.1
    ball = RigidBody.sphere(mass, radius)

    def exchange(i: int, j: int) -> Callable[[Numbers], list[Any]]:
        def reset(y: Numbers) -> list[Any]:
            after = list(y)
            after[SIZE * i + 7], after[SIZE * j + 7] = y[SIZE * j + 7], y[SIZE * i + 7]
            return after

        return reset

    def gap_of(i: int, j: int) -> Callable[[Any, Numbers], Any]:
        return lambda t, y: y[SIZE * j] - y[SIZE * i] - 2 * radius

    still: Any = lambda t, y: [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))] * 3  # noqa: E731
    modes = [
        SceneMode("first", still, (SceneGuard("impact", gap_of(0, 1), "second", exchange(0, 1)),)),
        SceneMode("second", still, (SceneGuard("impact", gap_of(1, 2), "after", exchange(1, 2)),)),
        SceneMode("after", still),
    ]
    places = [0.0, 2 * radius + gap, 4 * radius + 2 * gap]
    return _contact(
        "cradle",
        "a ball that hits the first of two equal ones in a row",
        "two impacts, one after the other: the last ball alone leaves",
        "m x″ = 0;  the velocities are exchanged where two balls touch",
        "lines",
        (ball, ball, ball),
        [_state((x, 0.0, 0.0), velocity=(float(x == 0.0), 0.0, 0.0)) for x in places],
        0.5, 0.01, modes,
        "position of the first ball, m", _along(0, 3),
        contacts=tuple(SceneContact(k, radius, "body", k + 1, "rigid", restitution=1.0) for k in (0, 1)),
        invariants={
            "energy": _mechanical_energy(mass, (0.0, 0.0, 0.0)),
            "momentum": lambda y: mass * y[:, 7:10].sum(axis=0),
        },
    )  # fmt: skip


def _rolling_disk() -> ExamScene:
    radius, mass, tilt, turn = 0.5, 1.0, 1.2, 1.5
    across, along = mass * radius**2 / 4, mass * radius**2 / 2
    down = (0.0, 0.0, -GRAVITY)
    # Steady: (I₃ + m r²) ω₃ Ω sin β = I₁ Ω² sin β cos β − m g r cos β, with β from the vertical to the axis.
    spin = (across * turn * math.cos(tilt) - mass * GRAVITY * radius / (turn * math.tan(tilt))) / (
        along + mass * radius**2
    )
    q = (math.sin(tilt / 2), 0.0, 0.0, math.cos(tilt / 2))
    omega = (0.0, turn * math.sin(tilt), spin)

    def wrench(t: Any, y: Numbers) -> Wrenches:
        """The force that lets the lowest point of the rim stand still: m (a + g u), in body axes."""
        u, w = _up(y), y[10:13]
        size = (u[0] * u[0] + u[1] * u[1]) ** 0.5
        p = (u[0] / size, u[1] / size, 0.0)
        side = (-1.0 * p[1], p[0], 0.0)
        arm = (-radius * p[0], -radius * p[1], 0.0)
        falls = _cross(u, w)
        grows = p[0] * falls[0] + p[1] * falls[1]
        arm_rate = [-radius * (falls[k] - p[k] * grows) / size for k in (0, 1)] + [0.0]
        swing = _cross(w, arm)
        moves = [a + b for a, b in zip(arm_rate, swing, strict=True)]
        # the acceleration of the centre but for the part of ω′
        known = [-1.0 * x + GRAVITY * z for x, z in zip(_cross(w, moves), u, strict=True)]
        gyro = _cross([across * w[0], across * w[1], along * w[2]], w)
        total = [a + mass * b for a, b in zip(gyro, _cross(arm, known), strict=True)]
        rolls = mass * radius**2
        about_p = (total[0] * p[0] + total[1] * p[1]) / across
        about_side = (total[0] * side[0] + total[1] * side[1]) / (across + rolls)
        rate = [about_p * p[k] + about_side * side[k] for k in (0, 1)] + [total[2] / (along + rolls)]
        force = [mass * (b - a) for a, b in zip(_cross(rate, arm), known, strict=True)]
        world = _to_world(y, force)
        return [((world[0], world[1], world[2] - mass * GRAVITY), _cross(arm, force))]

    def energy(y: Array) -> Array:
        return _mechanical_energy(mass, down)(y) + _turning_energy((across, across, along), y)

    start = _state((0.0, 0.0, radius * math.sin(tilt)), q, spin=omega)
    # the lowest point stands still
    up = _up(start)
    arm = np.array([-radius * up[0], -radius * up[1], 0.0]) / math.hypot(up[0], up[1])
    start[7:10] = _world(np.array(start), -np.cross(omega, arm)).tolist()
    direction = np.zeros((1, 12))
    direction[0, 11] = 1.0
    direction[0, 6:9] = _world(np.array(start), -np.cross((0.0, 0.0, 1.0), arm))
    return _contact(
        "rolling_disk",
        "a disk that rolls in a circle",
        "rolling without slipping in three dimensions, at a constant tilt",
        "I ω′ = (I ω) × ω + c × F,  m (v′ + g e₃) = F,  v = c × ω with c from the centre to the lowest point",
        "a turn about the vertical and one about the axis, at constant rates",
        (RigidBody(mass, (across, across, along)),),
        [start], 2.0, 0.01, [SceneMode("roll", wrench)],
        "angular velocity about the axis, rad/s, rolling", _frozen(direction),
        gravity=down, by_modes_only=True, invariants={"energy": energy},
    )  # fmt: skip


def _contacts() -> list[ExamScene]:
    return [
        _compliant_bounce(),
        _hunt_crossley(),
        _hard_bounce(),
        _zeno_rest(),
        _graze(),
        _incline(
            "incline_slip",
            "a block that slips down a slope",
            "sliding friction at its bound: tan α exceeds μ",
            0.3, 0.5, 0.5, 1.0,
        ),
        _incline(
            "incline_stop",
            "a block that slides on a slope, stops and stays",
            "the stop, and rest on a slope below the angle of friction",
            0.5, 0.2, 1.0, 1.0,
        ),
        _slide_to_roll(),
        _rolling_incline(),
        _spin_impact(),
        _leaving_sphere(),
        _ladder(),
        _tipping_block(),
        _dry_oscillator(),
        _two_balls(),
        _cradle(),
        _rolling_disk(),
        _tippe_top(),
    ]  # fmt: skip
