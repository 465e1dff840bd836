"""Motions with their looks, in the form in which the page has them."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from somersault._somersault.contact import Contact
from somersault._somersault.integrators import Trajectory
from somersault._somersault.motion import MarkerRecording
from somersault._somersault.multibody import Model, TreeSolution
from somersault.errors import InputError
from somersault.viewer.contacts import balls_of, body_shapes
from somersault.viewer.figures import equivalent_ellipsoid, figure
from somersault.viewer.results import Source
from somersault.viewer.shapes import Box, Ellipsoid, Mesh, RoundShape, Shape, Sphere, rgb
from somersault.viewer.tracks import Touch, Track

__all__ = ["Actor", "Shapes", "View", "body_index", "default_shapes", "named_shapes", "shape_data"]

Array = NDArray[np.float64]
View: TypeAlias = Literal["corner", "side", "front", "top"]
Shapes: TypeAlias = Shape | Sequence[Shape] | Mapping[str, Shape | Sequence[Shape]]

#: Radius of a marker, in distances of the farthest one from the middle.
_MARKER = 0.02
#: Paul Tol's *bright* colours, distinct for the colour-blind.
COLORS = ("#4477aa", "#cc3311", "#228833", "#aa3377", "#ccbb44", "#66ccee")


@dataclass(frozen=True)
class Actor:
    """A motion with its looks."""

    track: Track
    shapes: Mapping[str, Sequence[Shape]]
    color: str
    label: str
    panel: int
    trails: Sequence[tuple[int | None, Array]]
    touches: Sequence[Touch]

    @cached_property
    def _skin(self) -> tuple[Array, NDArray[np.intp]]:
        """Points of all shapes in the world at some of the times, and which these are."""
        at = np.unique(np.linspace(0, len(self.track.t) - 1, 120).astype(np.intp))
        found = []
        for i, name in enumerate(self.track.names):
            if name not in self.shapes:
                continue
            points = np.concatenate([shape.points for shape in self.shapes[name]])
            poses = self.track.poses[at, i]
            turns = Rotation.from_quat(poses[:, 3:]).as_matrix()
            found.append(points @ turns.transpose(0, 2, 1) + poses[:, None, :3])
        return np.concatenate(found, axis=1), at

    @property
    def radius(self) -> float:
        """Of the ball about the centre of mass that holds all shapes."""
        points, at = self._skin
        return float(np.nanmax(np.linalg.norm(points - self.track.center[at, None], axis=-1)))

    @property
    def region(self) -> tuple[Array, Array]:
        """The corners of the box that holds all shapes at all times."""
        points = self._skin[0].reshape(-1, 3)
        return np.nanmin(points, axis=0), np.nanmax(points, axis=0)

    @property
    def view(self) -> View:
        """From the side or from the top for what moves in such a plane."""
        places = np.concatenate([self.track.poses[:, :, :3].reshape(-1, 3), self.track.center])
        spans = np.nanmax(places, axis=0) - np.nanmin(places, axis=0)
        flat = spans < 1e-9 * self.radius
        planes: dict[tuple[bool, ...], View] = {
            (False, True, False): "side",
            (False, False, True): "top",
        }
        return planes.get(tuple(flat.tolist()), "corner")

    def data(self, start: float) -> dict[str, Any]:
        """What the page needs of the motion, times from `start` on."""
        moving = self.track
        drawn = [i for i, name in enumerate(moving.names) if name in self.shapes]
        # Trails and contacts may belong to bodies without a shape.
        others = {body for body, _ in self.trails if body is not None} | {at.body for at in self.touches}
        drawn += sorted(others - set(drawn))
        data: dict[str, Any] = {
            "label": self.label,
            "colour": np.round(rgb("color", self.color), 3).tolist(),
            "panel": self.panel,
            "bodies": len(drawn),
            "times": packed(moving.t - start),
            "poses": packed(moving.poses[:, drawn]),
            "center": packed(moving.center),
            "shapes": [
                {"body": k, **shape_data(shape, self.color)}
                for k, i in enumerate(drawn)
                for shape in self.shapes.get(moving.names[i], ())
            ],
            "trails": [
                {
                    "body": None if body is None else drawn.index(body),
                    "point": point.tolist(),
                    "colour": np.round(rgb("color", COLORS[(4 + k) % 6] if k else self.color), 3).tolist(),
                }
                for k, (body, point) in enumerate(self.trails)
            ],
        }
        for name in ("momentum", "rate"):
            values: Array | None = getattr(moving, name)
            if values is not None:
                data[name] = packed(values)
        if self.touches:
            data["force"] = [
                {
                    "body": drawn.index(at.body),
                    "point": at.point.tolist(),
                    "times": packed(at.t - start),
                    "forces": packed(at.forces),
                    **({} if at.offsets is None else {"offsets": packed(at.offsets)}),
                }
                for at in self.touches
            ]
        return data


def packed(values: ArrayLike) -> str:
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def shape_data(shape: Shape, color: str) -> dict[str, Any]:
    """What the page needs of a shape."""
    form: dict[str, Any]
    match shape:
        case RoundShape():
            form = {"rings": packed(shape.rings)}
        case Box():
            form = {"lengths": np.asarray(shape.lengths, dtype=np.float64).tolist()}
        case Mesh():
            form = {"vertices": packed(shape.vertices), "triangles": packed(shape.triangles)}
        case _:
            raise InputError(f"a shape must be a box, a mesh or a round solid, found {type(shape).__name__}")
    return {
        **form,
        "position": np.round(shape.position, 7).tolist(),
        "quaternion": np.round(shape.rotation.as_quat(), 8).tolist(),
        "colour": np.round(rgb("color", shape.color or color), 3).tolist(),
        "checkered": int(shape.checkered),
    }


def default_shapes(
    source: Source, track: Track, contacts: Sequence[Sequence[Contact]]
) -> Mapping[str, Sequence[Shape]]:
    """The shapes of a motion that came without, by the contacts of each body where it has any."""
    match source:
        case TreeSolution():
            return figure(source.model)
        case Model():
            return figure(source)
        case MarkerRecording():
            # Markers of some size about the middle of those that are seen.
            away = np.linalg.norm(track.poses[..., :3] - track.center[:, None], axis=-1)
            radius = _MARKER * float(np.nanmax(away)) or 0.01
            return {name: [Sphere(radius)] for name in track.names}
    owner = source.body if isinstance(source, Trajectory) else source
    found: dict[str, list[Shape]] = {}
    for k, body in enumerate(owner if isinstance(owner, list) else [owner]):
        radii, turn = equivalent_ellipsoid(body.mass, body.inertia)
        solid = Ellipsoid(np.maximum(radii, 0.02 * radii.max()), orientation=turn, checkered=True)
        found[track.names[k]] = body_shapes(solid, contacts[k] if contacts else (), balls_of(source, k))
    return found


def named_shapes(shapes: Shapes, names: tuple[str, ...]) -> dict[str, list[Shape]]:
    """The shapes given, by body."""
    if not isinstance(shapes, Mapping):
        if len(names) != 1:
            raise InputError("`shapes` must be a mapping from the names of bodies where there are several")
        shapes = {names[0]: shapes}
    found = {}
    for name, value in shapes.items():
        body_index("shapes", name, names)
        several = [value] if isinstance(value, Shape) else list(value)
        for shape in several:
            if not isinstance(shape, Shape):
                raise InputError(f"`shapes` must be shapes, found a {type(shape).__name__} for '{name}'")
        if several:
            found[name] = several
    if not found:
        raise InputError("`shapes` must have a shape for a body at least, found none")
    return found


def body_index(argument: str, name: object, names: tuple[str, ...]) -> int:
    if name not in names:
        raise InputError(f"`{argument}` names no body '{name}'; there are {', '.join(names)}")
    return names.index(str(name))
