"""What trees look like: divers as people, cart and pendulum, and any other tree by its joints and inertia.

The diver's form is drawn by hand to the proportions of an adult athlete: rings across each segment between
the joints of the model, whose distances are those of de Leva (see `somersault.multibody.Diver`). Its girth
follows from mass: filled with the density of such a segment, between 1.03 (trunk) and 1.16 kg/l (hand;
W. T. Dempster, *Space requirements of the seated operator*, WADC 55-159, 1955, as tabled by D. A. Winter,
*Biomechanics and Motor Control of Human Movement*, 4th ed., 2009, Table 4.1), each segment has the mass it
has in the model to 15 %, counted between its joints. Head and toes are drawn by eye. Lengths go with the
height h of the diver, widths with √(m/h).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from somersault._somersault.multibody import Geometry, Link, Model, Robot
from somersault.viewer.shapes import Box, Capsule, Cylinder, Ellipsoid, Loft, Shape, Sphere

__all__ = ["equivalent_ellipsoid", "figure", "rail", "robot_figure"]

Array = NDArray[np.float64]
Shapes = dict[str, list[Shape]]

SKIN, EYES, STEEL, WHEELS = "#e3b18f", "#33302e", "#9aa3af", "#3c4450"

#: Diver of 65 kg and 1.70 m: height of the neck over the waist, m, and mass, kg, of the model's table.
_NECK, _MASS = 0.44682, 65.0
#: Height of the tip of its breastbone over the waist, m, where the abdomen has its origin.
_BREASTBONE = 0.210425

# Rings (z, x, y, a, b) in the axes of each segment, standing: x forward, y to the left, z up.
_TORSO = (
    (-0.048, 0.006, 0, 0.050, 0.090),
    (-0.030, 0.003, 0, 0.080, 0.118),
    (0.000, 0.000, 0, 0.097, 0.130),
    (0.080, 0.004, 0, 0.101, 0.137),
    (0.160, 0.010, 0, 0.112, 0.152),
    (0.240, 0.014, 0, 0.120, 0.167),
    (0.300, 0.010, 0, 0.115, 0.172),
    (0.345, 0.002, 0, 0.098, 0.168),
    (0.380, -0.004, 0, 0.078, 0.140),
    (0.405, -0.006, 0, 0.066, 0.092),
    (0.430, -0.006, 0, 0.060, 0.064),
    (0.450, -0.004, 0, 0.045, 0.045),
)
# The same in two parts, for a thorax that moves.
_THORAX = ((0.170, 0.010, 0, 0.096, 0.134), (0.190, 0.011, 0, 0.114, 0.156), *_TORSO[5:])
_ABDOMEN = (
    *((z - _BREASTBONE, *ring) for z, *ring in _TORSO[:5]),
    (-0.010, 0.011, 0, 0.113, 0.155),
    (0.020, 0.011, 0, 0.098, 0.138),
)
_PELVIS = (
    (-0.245, 0.000, 0, 0.045, 0.045),
    (-0.220, -0.008, 0, 0.082, 0.100),
    (-0.180, -0.014, 0, 0.108, 0.160),
    (-0.120, -0.014, 0, 0.115, 0.170),
    (-0.060, -0.004, 0, 0.105, 0.152),
    (0.000, 0.000, 0, 0.099, 0.133),
    (0.035, 0.000, 0, 0.096, 0.129),
)
_THIGH = (
    (-0.462, -0.004, 0, 0.024, 0.024),
    (-0.445, -0.002, 0, 0.048, 0.046),
    (-0.412, 0.002, 0, 0.058, 0.054),
    (-0.370, 0.003, 0, 0.061, 0.056),
    (-0.280, 0.006, 0, 0.073, 0.066),
    (-0.160, 0.004, 0, 0.088, 0.079),
    (-0.060, -0.004, 0, 0.094, 0.082),
    (0.010, -0.006, 0, 0.088, 0.080),
    (0.050, -0.004, 0, 0.060, 0.060),
)
_SHANK = (
    (-0.458, 0.000, 0, 0.017, 0.017),
    (-0.440, 0.000, 0, 0.028, 0.027),
    (-0.400, 0.000, 0, 0.030, 0.029),
    (-0.320, -0.004, 0, 0.037, 0.035),
    (-0.220, -0.012, 0, 0.050, 0.046),
    (-0.130, -0.016, 0, 0.057, 0.052),
    (-0.060, -0.008, 0, 0.052, 0.049),
    (0.000, 0.000, 0, 0.051, 0.048),
    (0.035, 0.002, 0, 0.039, 0.039),
)
_UPPER_ARM = (
    (-0.308, 0.000, 0, 0.014, 0.014),
    (-0.292, 0.000, 0, 0.030, 0.030),
    (-0.270, 0.000, 0, 0.035, 0.033),
    (-0.190, 0.003, 0, 0.040, 0.036),
    (-0.110, 0.004, 0, 0.046, 0.040),
    (-0.030, 0.000, 0, 0.053, 0.044),
    (0.020, -0.002, 0, 0.049, 0.042),
    (0.045, -0.004, 0, 0.035, 0.032),
    (0.058, -0.004, 0, 0.016, 0.016),
)
_FOREARM = (
    (-0.275, 0, 0, 0.014, 0.018),
    (-0.250, 0, 0, 0.021, 0.027),
    (-0.190, 0, 0, 0.028, 0.030),
    (-0.110, 0, 0, 0.039, 0.038),
    (-0.050, 0, 0, 0.044, 0.042),
    (0.000, 0, 0, 0.039, 0.038),
    (0.025, 0, 0, 0.028, 0.028),
)
_HAND = (
    (-0.190, 0.006, 0, 0.004, 0.010),
    (-0.182, 0.006, 0, 0.008, 0.022),
    (-0.150, 0.005, 0, 0.010, 0.033),
    (-0.090, 0.002, 0, 0.014, 0.043),
    (-0.050, 0.000, 0, 0.017, 0.040),
    (0.000, 0.000, 0, 0.021, 0.029),
    (0.020, 0.000, 0, 0.018, 0.022),
)
# Along the foot, from heel to ball and from ball to tip: (x, height, 0, half height, half width).
_FOOT = (
    (-0.068, -0.048, 0, 0.010, 0.012),
    (-0.058, -0.044, 0, 0.026, 0.026),
    (-0.030, -0.034, 0, 0.039, 0.033),
    (0.000, -0.030, 0, 0.043, 0.034),
    (0.040, -0.040, 0, 0.033, 0.036),
    (0.080, -0.051, 0, 0.022, 0.041),
    (0.123, -0.058, 0, 0.015, 0.045),
    (0.136, -0.060, 0, 0.009, 0.036),
)
_TOES = (
    (-0.014, 0.002, 0, 0.010, 0.038),
    (0.000, 0.002, 0, 0.015, 0.045),
    (0.030, 0.000, 0, 0.012, 0.042),
    (0.055, -0.002, 0, 0.009, 0.032),
    (0.068, -0.003, 0, 0.004, 0.014),
)
#: From the axes of the rings along the foot to those of the foot: z forward, x up.
_FORWARD = Rotation.from_matrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])

#: From the axes of the spatial diver's bodies to those of the planar diver's: x forward, y up.
_PLANAR = Rotation.from_euler("x", -90.0, degrees=True)

_HIPS, _SHOULDERS = 0.083, 0.166


class _Diver:
    """Shapes of a size, in the axes of the segments of a diver."""

    def __init__(self, model: Model) -> None:
        links = {link.name: link for link in model.links}
        self.planar = "thigh" in links
        self.trunk = {"torso": _THORAX, "abdomen": _ABDOMEN} if "abdomen" in links else {"torso": _TORSO}
        self.long = float(np.linalg.norm(links["head"].origin)) / _NECK
        self.wide = float(np.sqrt(model.mass / _MASS / self.long))

    def skin(self, rows: ArrayLike, color: str | None = SKIN, along: bool = False) -> Loft:
        sized = np.asarray(rows) * [self.long, self.wide, self.wide, self.wide, self.wide]
        return Loft(sized, orientation=_FORWARD if along else None, color=color)

    def ball(self, center: ArrayLike, radii: ArrayLike, color: str | None = SKIN) -> Ellipsoid:
        size = self.long
        return Ellipsoid(np.asarray(radii) * size, center=np.asarray(center) * size, color=color)

    def head(self) -> list[Shape]:
        size = self.long
        eyes = [self.ball((0.106, y, 0.140), (0.009, 0.012, 0.009), EYES) for y in (-0.032, 0.032)]
        ears = [self.ball((0.012, y, 0.128), (0.020, 0.011, 0.030)) for y in (-0.076, 0.076)]
        neck = Capsule(
            (-0.006 * size, 0.0, -0.045 * size),
            (0.010 * size, 0.0, 0.075 * size),
            0.057 * self.wide,
            0.053 * self.wide,
            color=SKIN,
        )
        return [
            neck,
            self.ball((0.020, 0.0, 0.135), (0.096, 0.076, 0.110)),
            self.ball((0.050, 0.0, 0.080), (0.056, 0.054, 0.056)),
            self.ball((0.117, 0.0, 0.112), (0.014, 0.012, 0.020)),
            self.ball((0.004, 0.0, 0.152), (0.097, 0.080, 0.102), None),
            *eyes,
            *ears,
        ]

    def thumb(self, side: float) -> Capsule:
        start = np.array([0.004, 0.026 * side, -0.030]) * self.long
        end = np.array([0.016, 0.056 * side, -0.088]) * self.long
        return Capsule(start, end, 0.014 * self.wide, 0.010 * self.wide, color=SKIN)

    def trunks(self, side: float) -> Loft:
        """The part of the swimsuit on a thigh."""
        rows = (
            (-0.100, 0.000, 0, 0.093, 0.0825),
            (-0.096, -0.001, 0, 0.0975, 0.086),
            (-0.060, -0.004, 0, 0.0985, 0.086),
            (0.010, -0.006, 0, 0.092, 0.084),
            (0.052, -0.004, 0, 0.062, 0.062),
        )
        return self.skin(rows, None)

    def limbs(self, side: float) -> Shapes:
        return {
            "thigh": [self.skin(_THIGH), self.trunks(side)],
            "shank": [self.skin(_SHANK)],
            "foot": [self.skin(_FOOT, along=True)],
            "toes": [self.skin(_TOES, along=True)],
            "upper_arm": [self.skin(_UPPER_ARM)],
            "forearm": [self.skin(_FOREARM)],
            "hand": [self.skin(_HAND), self.thumb(side)],
        }

    def shapes(self) -> Shapes:
        found: Shapes = {
            **{name: [self.skin(rows)] for name, rows in self.trunk.items()},
            "pelvis": [self.skin(_PELVIS, None)],
            "head": self.head(),
        }
        for name, side in (("right", -1.0), ("left", 1.0)):
            for part, shapes in self.limbs(side).items():
                if not self.planar:
                    found[f"{name}_{part}"] = shapes
                    continue
                lateral = _SHOULDERS if part in ("upper_arm", "forearm", "hand") else _HIPS
                aside = np.array([0.0, side * lateral * self.long, 0.0])
                found.setdefault(part, []).extend(
                    _moved(shape, Rotation.identity(), aside) for shape in shapes
                )
        if self.planar:
            found = {
                name: [_moved(shape, _PLANAR, np.zeros(3)) for shape in shapes]
                for name, shapes in found.items()
            }
        return found


def _moved(shape: Shape, rotation: Rotation, by: Array) -> Shape:
    """The shape turned about the origin, and then moved."""
    if isinstance(shape, Capsule):
        start, end = (rotation.apply(np.asarray(point)) + by for point in (shape.start, shape.end))
        return replace(shape, start=start, end=end)
    assert isinstance(shape, Ellipsoid | Loft)
    center = rotation.apply(shape.position) + by
    return replace(shape, center=center, orientation=rotation * shape.rotation)


def _is_diver(names: Sequence[str]) -> bool:
    planar = {"torso", "pelvis", "head", "thigh", "shank", "foot", "toes", "upper_arm", "forearm", "hand"}
    sides = {f"{side}_{part}" for side in ("right", "left") for part in planar - {"torso", "pelvis", "head"}}
    return planar <= set(names) or {"torso", "pelvis", "head"} | sides <= set(names)


def _cart_pendulum(model: Model) -> Shapes:
    cart, pendulum = model.links
    length = float(np.linalg.norm(pendulum.center)) or 1.0
    # A bob of 1 kg at 1 m is a ball of 80 mm; the radius goes with the cube root of the mass.
    bob = 0.08 * float(np.cbrt(pendulum.mass)) * length
    bob = float(np.clip(bob, 0.04 * length, 0.2 * length))
    long, high = 0.42 * length, 0.16 * length
    wheel = 0.05 * length
    wheels = [
        Cylinder(
            (x, side * 0.11 * length, -high / 2),
            (x, side * 0.14 * length, -high / 2),
            wheel,
            color=WHEELS,
        )
        for x in (-0.3 * long, 0.3 * long)
        for side in (-1.0, 1.0)
    ]
    hinge = Cylinder((0.0, -0.09 * length, 0.0), (0.0, 0.09 * length, 0.0), 0.03 * length, color=WHEELS)
    return {
        cart.name: [Box((long, 0.2 * length, high), center=(0.0, 0.0, -0.02 * length)), *wheels],
        pendulum.name: [
            Capsule((0.0, 0.0, 0.0), pendulum.center, 0.018 * length, color=STEEL),
            hinge,
            Sphere(bob, center=pendulum.center, color="#cc6677"),
        ],
    }


def rail(model: Model, low: float, high: float) -> list[Shape]:
    """What the cart of a cart-pendulum runs on, from `low` to `high`."""
    length = float(np.linalg.norm(model.links[1].center)) or 1.0
    top = -0.08 * length - 0.05 * length
    low, high = low - 0.5 * length, high + 0.5 * length
    size = (high - low, 0.30 * length, 0.03 * length)
    return [Box(size, center=((low + high) / 2, 0.0, top - 0.015 * length), color=STEEL)]


def is_cart_pendulum(model: Model) -> bool:
    """Whether the tree has the names and joints of `somersault.multibody.cart_pendulum`."""
    joints = [(link.name, link.joint) for link in model.links]
    return joints == [("cart", "prismatic"), ("pendulum", "revolute")]


def equivalent_ellipsoid(mass: float, inertia: ArrayLike) -> tuple[Array, Rotation]:
    """The radii and axes of the solid ellipsoid with this mass and inertia, kg and kg m².

    aᵢ² = 5 (Iⱼ + Iₖ − Iᵢ) / 2m along the principal axis i.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import viewer
    >>> radii, axes = viewer.equivalent_ellipsoid(5.0, np.diag([13.0, 10.0, 5.0]))
    >>> radii.round(6)
    array([3., 2., 1.])
    """
    moments, axes = np.linalg.eigh(np.asarray(inertia, dtype=np.float64))
    squares = 2.5 * (moments.sum() - 2.0 * moments) / mass
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return np.sqrt(np.maximum(squares, 0.0)), Rotation.from_matrix(axes)


def _tree(model: Model) -> Shapes:
    """Ellipsoids of inertia, and rods from joint to joint."""
    links = model.links
    spans = [float(np.linalg.norm(link.origin)) for link in links if link.parent is not None]
    spans += [2.0 * float(np.linalg.norm(link.center)) for link in links]
    inertial = {link.name: equivalent_ellipsoid(link.mass, link.inertia) for link in links if link.mass > 0.0}
    spans += [float(radii.max()) for radii, _ in inertial.values()]
    size = max(spans, default=0.0) or 1.0
    thick = 0.035 * size
    children: Mapping[str, list[Link]] = {
        link.name: [child for child in links if child.parent == link.name] for link in links
    }
    found: Shapes = {}
    for link in links:
        shapes: list[Shape] = []
        ends = [np.asarray(child.origin) for child in children[link.name]]
        if not ends and link.mass > 0.0:
            # The last body of a chain is taken to end as far beyond its centre as it begins before it.
            ends = [2.0 * np.asarray(link.center)]
        shapes += [Capsule((0.0, 0.0, 0.0), end, thick) for end in ends if np.linalg.norm(end) > 1e-6 * size]
        if link.mass > 0.0:
            radii, turn = inertial[link.name]
            if radii.min() > 0.05 * radii.max():
                shapes.append(Ellipsoid(radii, center=link.center, orientation=turn))
            elif not shapes or not radii.any():
                shapes.append(Sphere(2.0 * thick, center=link.center))
        if shapes:
            found[link.name] = shapes
    return found


def robot_figure(robot: Robot) -> tuple[Shapes, list[Shape]]:
    """The shapes that the file of a robot gives its bodies, and those that stand in the world.

    What is for the eye comes before what collides. Meshes are not opened: a body without other geometry is
    drawn as one of a tree.
    """
    found, standing = figure(robot.model), []
    solids = [part for part in robot.geometry if part.shape != "mesh"]
    for body, name in enumerate([*robot.model.names, None]):
        owner = None if name is None else body
        own = [part for part in solids if part.body == owner]
        seen = [part for part in own if part.purpose == "visual"] or own
        shapes = [_solid(part) for part in seen]
        if name is None:
            standing = shapes
        elif shapes:
            found[name] = shapes
    return found, standing


def _solid(part: Geometry) -> Shape:
    """Of a geometry that is no mesh."""
    center, turn = part.position, part.orientation
    match part.shape:
        case "box":
            return Box(part.size, center=center, orientation=turn)
        case "ellipsoid":
            return Ellipsoid(part.size, center=center, orientation=turn)
        case "sphere":
            return Sphere(part.size[0], center=center)
    radius, length = part.size
    half = turn.apply((0.0, 0.0, 0.5 * length))
    rod = Cylinder if part.shape == "cylinder" else Capsule
    return rod(center - half, center + half, radius)


def figure(model: Model) -> Shapes:
    """The shapes that a tree is drawn with unless others are given.

    Parameters
    ----------
    model : Model
        A diver, of the planar or the spatial kind; a cart with a pendulum; or any tree, whose bodies are then
        the solid ellipsoids with their mass and inertia, joined by rods.

    Returns
    -------
    dict of str to list of Shape
        For each body that is seen, in its axes.

    Examples
    --------
    >>> from somersault import multibody, viewer
    >>> sorted(viewer.figure(multibody.cart_pendulum()))
    ['cart', 'pendulum']
    """
    if not isinstance(model, Model):
        raise TypeError(f"`model` must be a Model, found {type(model).__name__}")
    if _is_diver(model.names):
        return _Diver(model).shapes()
    return _cart_pendulum(model) if is_cart_pendulum(model) else _tree(model)
