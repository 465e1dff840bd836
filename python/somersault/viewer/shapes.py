"""Solids to draw bodies with, in the axes of the body, lengths in metres.

A round solid is a skin over rings, ellipses across an axis z: rows (z, x, y, a, b) of height, centre and
half widths. Two equal rows one after the other make an edge.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from somersault.errors import InputError

__all__ = ["Box", "Capsule", "Cylinder", "Ellipsoid", "Loft", "Mesh", "Shape", "Sphere"]

Array = NDArray[np.float64]

#: Rings of half a sphere.
_RINGS = 9
#: That a page can number.
_VERTICES = 65_536


def numbers(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Finite numbers of a shape, in which None allows any length."""
    try:
        found = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"`{name}` must be real numbers, found {value!r}") from None
    allowed = found.ndim == len(shape) and all(
        n is None or n == m for n, m in zip(shape, found.shape, strict=True)
    )
    if not allowed:
        wanted = ", ".join("n" if n is None else str(n) for n in shape) + "," * (len(shape) == 1)
        raise InputError(f"`{name}` must be of shape ({wanted}), found {found.shape}")
    if not np.isfinite(found).all():
        raise InputError(f"`{name}` must be finite, found {found[~np.isfinite(found)][0]}")
    return found


def positive(name: str, value: ArrayLike, shape: tuple[int, ...] = ()) -> Array:
    """Finite numbers above zero."""
    found = numbers(name, value, shape)
    if not (found > 0.0).all():
        raise InputError(f"`{name}` must be positive, found {found.min():g}")
    return found


def turn(name: str, value: Rotation | ArrayLike | None) -> Rotation:
    """A rotation, from a quaternion (x, y, z, w) as well."""
    if value is None or isinstance(value, Rotation):
        return value or Rotation.identity()
    quaternion = numbers(name, value, (4,))
    if not quaternion.any():
        raise InputError(f"`{name}` must be a rotation, found a quaternion of zeros")
    return Rotation.from_quat(quaternion)


def rgb(name: str, value: str) -> tuple[float, float, float]:
    """Red, green and blue from 0 to 1, of a color `#rrggbb`."""
    if not (isinstance(value, str) and re.fullmatch(r"#[0-9a-fA-F]{6}", value)):
        raise InputError(f"`{name}` must be a color like '#cc6677', found {value!r}")
    red, green, blue = (int(value[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def _brief(value: ArrayLike) -> str:
    """A number, or numbers in brackets, in so many letters that four of them fit into a line."""
    shown = np.asarray(value, dtype=np.float64)
    text = f"{shown:.6g}" if shown.ndim == 0 else " ".join(str(shown.round(6).tolist()).split())
    return text if len(text) <= 45 else f"array of shape {shown.shape}"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Shape(ABC):
    """A solid, in a color `#rrggbb`; that of the motion unless given. Checkers show how it spins."""

    color: str | None = None
    checkered: bool = False

    def __post_init__(self) -> None:
        if self.color is not None:
            rgb("color", self.color)

    def __repr__(self) -> str:
        given = {field.name: getattr(self, field.name) for field in fields(self) if field.kw_only is False}
        sizes = ", ".join(f"{name}={_brief(value)}" for name, value in given.items() if value is not None)
        return f"{type(self).__name__}({sizes})"

    @property
    @abstractmethod
    def position(self) -> Array:
        """Where the solid's own axes are, in the body."""

    @property
    @abstractmethod
    def rotation(self) -> Rotation:
        """From the solid's own axes to the body's."""

    @property
    @abstractmethod
    def points(self) -> Array:
        """Points of the skin in the axes of the body, enough to say how far it reaches."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RoundShape(Shape):
    """A solid whose skin is drawn over rings."""

    @property
    @abstractmethod
    def rings(self) -> Array:
        """The skin in the solid's own axes: rows (z, x, y, a, b)."""

    @property
    def points(self) -> Array:
        z, x, y, a, b = self.rings.T[:, :, None]
        angle = np.arange(8) * (np.pi / 4)
        skin = np.stack([x + a * np.cos(angle), y + b * np.sin(angle), z + 0.0 * angle], axis=-1)
        return np.asarray(self.rotation.apply(skin.reshape(-1, 3))) + self.position


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class _Placed(Shape):
    """A solid about a center, with axes that may be turned."""

    center: ArrayLike = (0.0, 0.0, 0.0)
    orientation: Rotation | ArrayLike | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        numbers("center", self.center, (3,))
        turn("orientation", self.orientation)

    @property
    def position(self) -> Array:
        return np.asarray(self.center, dtype=np.float64)

    @property
    def rotation(self) -> Rotation:
        return turn("orientation", self.orientation)


@dataclass(frozen=True, eq=False, repr=False)
class Ellipsoid(_Placed, RoundShape):
    """An ellipsoid of three radii.

    Examples
    --------
    >>> from somersault import viewer
    >>> viewer.Ellipsoid((0.1, 0.2, 0.3)).points.max(axis=0).round(6)
    array([0.1, 0.2, 0.3])
    """

    radii: ArrayLike

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("radii", self.radii, (3,))

    @property
    def rings(self) -> Array:
        a, b, c = np.asarray(self.radii, dtype=np.float64)
        angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * _RINGS - 1)
        none = np.zeros_like(angle)
        across = np.abs(np.cos(angle))
        return np.column_stack([c * np.sin(angle), none, none, a * across, b * across])


@dataclass(frozen=True, eq=False, repr=False)
class Sphere(_Placed, RoundShape):
    """A ball.

    Examples
    --------
    >>> import somersault
    >>> from somersault import viewer
    >>> ball = viewer.Sphere(0.1, color="#cc6677", checkered=True)
    >>> body = somersault.RigidBody.sphere(1.0, 0.1)
    >>> q = [[0, 0, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0, 1]]
    >>> viewer.Scene("A rolling ball").add(body, [0.0, 1.0], q, shapes=ball)
    <Scene: 'A rolling ball', motions: 1, fixed shapes: 0>
    """

    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("radius", self.radius)

    @property
    def rings(self) -> Array:
        return Ellipsoid((self.radius,) * 3).rings


@dataclass(frozen=True, eq=False, repr=False)
class Box(_Placed):
    """A cuboid of three lengths.

    Examples
    --------
    >>> from somersault import viewer
    >>> viewer.Box((0.2, 0.4, 0.6), center=(0.0, 0.0, 0.3)).points.max(axis=0).round(6)
    array([0.1, 0.2, 0.6])
    """

    lengths: ArrayLike

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("lengths", self.lengths, (3,))

    @property
    def points(self) -> Array:
        signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        corners = signs * np.asarray(self.lengths, dtype=np.float64)
        return np.asarray(self.rotation.apply(corners)) + self.position


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(_Placed):
    """A skin of triangles: the numbers of their vertices, counter-clockwise as seen from outside.

    Examples
    --------
    >>> from somersault import viewer
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> viewer.Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).points.shape
    (4, 3)
    """

    vertices: ArrayLike
    triangles: ArrayLike

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(numbers("vertices", self.vertices, (None, 3)))
        corners = numbers("triangles", self.triangles, (None, 3))
        whole = len(corners) > 0 and bool((corners == np.floor(corners)).all())
        if not whole or not 0 <= corners.min() <= corners.max() < n:
            raise InputError(f"`triangles` must be rows of three numbers of the {n} vertices, from 0")
        if n > _VERTICES:
            raise InputError(f"`vertices` must be at most {_VERTICES}, found {n}")

    @property
    def points(self) -> Array:
        return np.asarray(self.rotation.apply(np.asarray(self.vertices, dtype=np.float64))) + self.position


@dataclass(frozen=True, eq=False, repr=False)
class _Rod(RoundShape):
    """A round solid between two points; its radius goes from one to the other."""

    start: ArrayLike
    end: ArrayLike
    radius: float
    end_radius: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.linalg.norm(numbers("end", self.end, (3,)) - numbers("start", self.start, (3,))) > 0.0:
            raise InputError("`start` and `end` must be apart, found the same point")
        for name, radius in (("radius", self.radius), ("end_radius", self.end_radius)):
            if radius is not None and not numbers(name, radius, ()) >= 0.0:
                raise InputError(f"`{name}` must not be negative, found {radius:g}")

    @property
    def position(self) -> Array:
        return np.asarray(self.start, dtype=np.float64)

    @property
    def length(self) -> float:
        """From end to end of the axis."""
        return float(np.linalg.norm(np.asarray(self.end, dtype=np.float64) - self.position))

    @property
    def radii(self) -> tuple[float, float]:
        """At the start and at the end."""
        return self.radius, self.radius if self.end_radius is None else self.end_radius

    @property
    def rotation(self) -> Rotation:
        axis = (np.asarray(self.end, dtype=np.float64) - self.position) / self.length
        cross = np.cross((0.0, 0.0, 1.0), axis)
        sine, cosine = float(np.linalg.norm(cross)), float(axis[2])
        across = cross / sine if sine > 0.0 else np.array([1.0, 0.0, 0.0])
        return Rotation.from_rotvec(np.arctan2(sine, cosine) * across)


@dataclass(frozen=True, eq=False, repr=False)
class Capsule(_Rod):
    """The hull of two balls; tapered where `end_radius` is another than `radius`.

    Examples
    --------
    >>> from somersault import viewer
    >>> thigh = viewer.Capsule((0.0, 0.0, 0.0), (0.0, 0.0, -0.4), 0.08, end_radius=0.05)
    >>> thigh.length, thigh.radii
    (0.4, (0.08, 0.05))
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(self.radii[1] - self.radii[0]) >= self.length:
            raise InputError("`radius` and `end_radius` must differ by less than the length of the capsule")

    @property
    def rings(self) -> Array:
        (first, last), length = self.radii, self.length
        # The skin leaves each ball where it is tangent to both.
        leave = np.arcsin((first - last) / length)
        low = np.linspace(-np.pi / 2, leave, _RINGS)
        high = np.linspace(leave, np.pi / 2, _RINGS)
        z = np.concatenate([first * np.sin(low), length + last * np.sin(high)])
        across = np.abs(np.concatenate([first * np.cos(low), last * np.cos(high)]))
        return np.column_stack([z, 0 * z, 0 * z, across, across])


@dataclass(frozen=True, eq=False, repr=False)
class Cylinder(_Rod):
    """A cylinder; a cone or part of one where `end_radius` is another than `radius`.

    Examples
    --------
    >>> from somersault import viewer
    >>> rod = viewer.Cylinder((0.0, 0.0, 0.0), (0.3, 0.0, 0.4), 0.02)
    >>> rod.length, rod.radii
    (0.5, (0.02, 0.02))
    """

    @property
    def rings(self) -> Array:
        (first, last), length = self.radii, self.length
        z = np.array([0.0, 0.0, 0.0, length, length, length])
        across = np.array([0.0, first, first, last, last, 0.0])
        return np.column_stack([z, 0 * z, 0 * z, across, across])


@dataclass(frozen=True, eq=False, repr=False)
class Loft(_Placed, RoundShape):
    """A smooth skin over rings (z, x, y, a, b), z rising, closed at both ends.

    Examples
    --------
    >>> from somersault import viewer
    >>> vase = viewer.Loft([(0.0, 0, 0, 0.1, 0.1), (0.2, 0, 0, 0.2, 0.2), (0.4, 0, 0, 0.1, 0.1)])
    >>> vase.points.max(axis=0).round(3)
    array([0.2, 0.2, 0.4])
    """

    stations: ArrayLike

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = numbers("stations", self.stations, (None, 5))
        if len(rows) < 2 or not (np.diff(rows[:, 0]) > 0.0).all():
            raise InputError("`stations` must be two rows or more with z rising from one to the next")
        if not (rows[:, 3:] >= 0.0).all():
            raise InputError(f"`stations` must have half widths of at least 0, found {rows[:, 3:].min():g}")

    @property
    def rings(self) -> Array:
        rows = np.asarray(self.stations, dtype=np.float64)
        fine = np.linspace(0, len(rows) - 1, 4 * (len(rows) - 1) + 1)
        # Monotone between rings, so that no bulge appears that nobody requested.
        skin = np.asarray(PchipInterpolator(np.arange(len(rows)), rows)(fine), dtype=np.float64)
        ends = skin[[0, -1]] * [1.0, 1.0, 1.0, 0.0, 0.0]
        return np.vstack([ends[:1], skin, ends[1:]])
