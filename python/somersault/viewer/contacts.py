"""Contacts of a motion: where and how hard they touch, what they touch; what the body looks like."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from somersault._somersault.contact import (
    Contact,
    ContactSystem,
    CylindricalSurface,
    HalfSpace,
    LinkContact,
    SphericalSurface,
    Surface,
    SurfaceFunction,
)
from somersault._somersault.integrators import RigidBody, Solution
from somersault._somersault.multibody import TreeSolution
from somersault.viewer.results import Source
from somersault.viewer.shapes import Box, Cylinder, Ellipsoid, Mesh, Shape, Sphere
from somersault.viewer.tracks import Touch, touch

__all__ = [
    "balls_of",
    "body_shapes",
    "contacts_of",
    "ground_of",
    "surface_shape",
    "surfaces_of_tree",
    "touches_of",
    "touches_of_tree",
]

Array = NDArray[np.float64]
#: An end of a contact: a body and a point of it, the sign of the force on it, and whether it touches at
#: another point than this.
_End: TypeAlias = tuple[int, Array, float, bool]
Distance: TypeAlias = Callable[[Array], tuple[float, Any]]

#: Along each side of a surface that is drawn as a net, and steps down to it.
_LINES, _STEPS = 41, 80
#: The normal of a plane is upright within this.
_LEVEL = 1e-9


def contacts_of(moving: Any) -> list[list[Contact]]:
    """The contacts of each body of a result, where it has any."""
    if isinstance(moving, ContactSystem):
        return [moving.contacts]
    if not isinstance(moving, Solution) or not moving.contacts:
        return []
    if isinstance(moving.body, RigidBody):
        return [list(moving.contacts)]  # type: ignore[arg-type]
    return [list(of_body) for of_body in moving.contacts]  # type: ignore[arg-type]


def touches_of(solution: Solution) -> list[Touch]:
    """Forces of all contacts of a solution on its bodies, at its times."""
    given = contacts_of(solution)
    held = [
        [(body, np.asarray(contact.point), 1.0, _is_extended(contact))]
        for body, contacts in enumerate(given)
        for contact in contacts
    ]
    for pair in solution.pairs or ():
        ends = zip(pair.bodies, pair.centers, (1.0, -1.0), strict=True)
        held.append([(body, np.asarray(center), sign, True) for body, center, sign in ends])
    several = (len(solution.t), -1)
    origins = np.reshape(solution.position, (*several, 3))
    turns = Rotation.from_quat(np.reshape(solution.quaternion, (-1, 4))).as_matrix().reshape(*several, 3, 3)
    return _touches(solution, held, origins, turns)


def surfaces_of_tree(moving: Any) -> list[LinkContact]:
    """The contacts of a tree with surfaces that stand in the world, where it has any."""
    if not isinstance(moving, TreeSolution):
        return []
    contacts = [contact for contact in moving.contacts if isinstance(contact, LinkContact)]
    return [contact for contact in contacts if contact.on is None]


def touches_of_tree(solution: TreeSolution) -> list[Touch]:
    """Forces of all contacts of a tree on its links, at its times."""
    model = solution.model
    held = []
    for contact in solution.contacts:
        if isinstance(contact, LinkContact):
            extended = _is_extended(contact.contact)
            held.append([(model.body(contact.link), np.asarray(contact.contact.point), 1.0, extended)])
        else:
            ends = zip(contact.links, contact.centers, (1.0, -1.0), strict=True)
            held.append([(model.body(link), np.asarray(center), sign, True) for link, center, sign in ends])
    poses = np.asarray(model.poses(solution.q))
    return _touches(solution, held, poses[..., :3, 3], poses[..., :3, :3])


def _touches(
    solution: Solution | TreeSolution, held: Sequence[Sequence[_End]], origins: Array, turns: Array
) -> list[Touch]:
    """Forces on each end of every contact, where it moves so."""
    forces, points = solution.contact_forces, solution.contact_points
    if forces is None or points is None:
        return []
    t = np.asarray(solution.t)
    found = []
    for k, ends in enumerate(held):
        for body, point, sign, extended in ends:
            away = points[:, k] - origins[:, body] - turns[:, body] @ point if extended else None
            found.append(touch(body, point, t, sign * forces[:, k], away))
    return found


def _is_extended(contact: Contact) -> bool:
    """Whether it touches at another point than its own."""
    return contact.radius is not None or contact.size is not None


def _distance(surface: Surface | Distance) -> Distance:
    return surface.signed_distance if isinstance(surface, Surface) else surface


def ground_of(contacts: Sequence[Contact]) -> float | None:
    """The height of the highest level ground among what is touched."""
    heights = (_height(contact.surface) for contact in contacts)
    return max((height for height in heights if height is not None), default=None)


def _height(surface: object) -> float | None:
    """Of level ground."""
    if isinstance(surface, HalfSpace) and surface.normal[2] > 1.0 - _LEVEL:
        return float(surface.point[2])
    return None


def surface_shape(surface: Surface | Distance, low: Array, high: Array) -> Shape | None:
    """What a surface looks like about a motion between two corners; level ground is no shape, but ground."""
    if _height(surface) is not None:
        return None
    span = float(np.linalg.norm(high - low)) or 1.0
    middle = 0.5 * (low + high)
    match surface:
        case HalfSpace():
            thick = 0.02 * span
            turn = Rotation.align_vectors([surface.normal], [(0.0, 0.0, 1.0)])[0]
            foot = middle - surface.signed_distance(middle)[0] * surface.normal
            return Box(
                (2 * span, 2 * span, thick), center=foot - 0.5 * thick * surface.normal, orientation=turn
            )
        case SphericalSurface() if surface.solid == "inside":
            return Sphere(surface.radius, center=surface.center)
        case CylindricalSurface() if surface.solid == "inside":
            axis = surface.axis / np.linalg.norm(surface.axis)
            foot = surface.center + ((middle - surface.center) @ axis) * axis
            return Cylinder(foot - span * axis, foot + span * axis, surface.radius)
        case _:
            return _net(surface, low - 0.5 * span, high + 0.5 * span)


def _net(surface: Surface | Distance, low: Array, high: Array) -> Mesh | None:
    """The surface as one looks down on it, found by steps no longer than the distance from it."""
    distance = _distance(surface)
    slope = surface.lipschitz if isinstance(surface, SurfaceFunction) else 1.0
    axes = [np.linspace(low[k], high[k], _LINES) for k in (0, 1)]
    heights = np.full((_LINES, _LINES), np.nan)
    close = 1e-3 * (high[2] - low[2])
    for i, x in enumerate(axes[0]):
        for j, y in enumerate(axes[1]):
            point = np.array([x, y, high[2]])
            for _ in range(_STEPS):
                gap = float(distance(point)[0])
                if gap <= close or point[2] < low[2]:
                    break
                point[2] -= gap / slope
            if abs(gap) <= close:
                heights[i, j] = point[2]
    corners = np.stack([*np.meshgrid(*axes, indexing="ij"), heights], axis=-1).reshape(-1, 3)
    first = np.arange(_LINES * _LINES).reshape(_LINES, _LINES)
    a, b, c, d = first[:-1, :-1], first[1:, :-1], first[1:, 1:], first[:-1, 1:]
    triangles = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    triangles = triangles[np.isfinite(corners[triangles]).all(axis=(1, 2))]
    if len(triangles) == 0:
        return None
    used, triangles = np.unique(triangles, return_inverse=True)
    return Mesh(corners[used], triangles.reshape(-1, 3))


def balls_of(source: Source, body: int) -> list[Sphere]:
    """The spheres of a body by which it touches other bodies."""
    if not isinstance(source, Solution):
        return []
    return [
        Sphere(radius, center=center, checkered=True)
        for pair in source.pairs or ()
        for owner, center, radius in zip(pair.bodies, pair.centers, pair.radii, strict=True)
        if owner == body
    ]


def body_shapes(body: Ellipsoid, contacts: Sequence[Contact], balls: Sequence[Sphere]) -> list[Shape]:
    """A body by what of it touches: balls, rims, and the hull of its points; else its ellipsoid with tips."""
    found: list[Shape] = []
    points = []
    for contact in contacts:
        if contact.radius is None:
            points.append(contact.point)
        elif contact.axis is None:
            found.append(Sphere(contact.radius, center=contact.point, checkered=True))
        else:
            half = 0.05 * contact.radius * contact.axis / np.linalg.norm(contact.axis)
            ends = contact.point - half, contact.point + half
            found.append(Cylinder(*ends, contact.radius, checkered=True))
    drawn = {(shape.radius, *shape.position) for shape in found if isinstance(shape, Sphere)}
    found += [ball for ball in balls if (ball.radius, *ball.position) not in drawn]
    if not points:
        return found or [body]
    hull = _hull(np.array(points))
    if hull is not None:
        return [*found, hull]
    size = 0.1 * float(np.max(body.radii))
    tips = [Cylinder(point, (0.0, 0.0, 0.0), 0.0, size) for point in points if np.linalg.norm(point) > 0.0]
    return [*found, body, *tips]


def _hull(points: Array) -> Mesh | None:
    """The solid between points, where they hold one."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    corners = points[hull.simplices]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ni,ni->n", across, hull.equations[:, :3]) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    # Corners of its own for each face, so that edges are seen.
    return Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), checkered=True)
