"""A scene: motions and what stands around them, as one page of HTML."""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault._somersault.integrators import Solution
from somersault._somersault.motion import MarkerRecording
from somersault._somersault.multibody import Model, Robot, TreeSolution
from somersault.errors import InputError
from somersault.viewer.actors import (
    COLORS,
    Actor,
    Shapes,
    View,
    body_index,
    default_shapes,
    named_shapes,
    shape_data,
)
from somersault.viewer.contacts import (
    contacts_of,
    ground_of,
    surface_shape,
    surfaces_of_tree,
    touches_of,
    touches_of_tree,
)
from somersault.viewer.figures import is_cart_pendulum, rail, robot_figure
from somersault.viewer.results import Subject, resolve
from somersault.viewer.shapes import Box, Shape, numbers, positive, rgb
from somersault.viewer.tracks import Touch, times, touch, track

__all__ = ["Scene", "animate"]

Array = NDArray[np.float64]
Arrow: TypeAlias = Literal["angular_momentum", "angular_velocity", "contact_force"]
Contact: TypeAlias = tuple[str, ArrayLike, ArrayLike]
Trail: TypeAlias = str | tuple[str, ArrayLike]

_VIEWS = ("corner", "side", "front", "top")
_SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
_ARROWS = {"angular_momentum": "momentum", "angular_velocity": "rate", "contact_force": "force"}
_SCRIPTS = ("linear", "meshes", "motion", "shaders", "stage", "camera", "player")
_CENTER = "center_of_mass"
_SURFACE = "#c3c7ce"


def _choice(argument: str, value: object, allowed: Sequence[object]) -> None:
    if value not in allowed:
        raise InputError(f"`{argument}` must be one of {', '.join(map(repr, allowed))}, found {value!r}")


def _trail(trail: Trail, names: tuple[str, ...]) -> tuple[int | None, Array]:
    """The body, None for the centre of mass, and the point in its axes."""
    if trail == _CENTER:
        return None, np.zeros(3)
    if isinstance(trail, str):
        return body_index("trails", trail, names), np.zeros(3)
    if not (isinstance(trail, tuple) and len(trail) == 2):
        raise InputError(f"`trails` must be names, or names and points, found {trail!r}")
    return body_index("trails", trail[0], names), numbers("trails", trail[1], (3,))


def _touch(contact: Contact, subject: Subject, names: tuple[str, ...]) -> Touch:
    if not (isinstance(contact, tuple) and len(contact) == 3):
        raise InputError(f"`contacts` must be names, points and forces, found {reprlib.repr(contact)}")
    name, point, forces = contact
    source = subject.source
    t = source.times if isinstance(source, MarkerRecording) else getattr(source, "t", subject.t)
    return touch(body_index("contacts", name, names), numbers("contacts", point, (3,)), times(t), forces)


class Scene:
    """Motions, and what stands around them.

    Methods return the scene, so that calls can be chained. In a notebook a scene shows itself.

    Parameters
    ----------
    title : str
        Of the page.

    Examples
    --------
    >>> from somersault import multibody, viewer
    >>> pendulum = multibody.cart_pendulum()
    >>> motion = multibody.integrate_tree(pendulum, (0.0, 0.1), (0.0, 0.0), (0.0, 2.0), dt=0.01)
    >>> scene = viewer.Scene("Falling over").add(motion, label="no force").camera("side")
    >>> len(scene.html()) < 100_000
    True
    """

    def __init__(self, title: str = "Motion") -> None:
        self.title = title
        self._actors: list[Actor] = []
        self._fixed: list[tuple[Shape, str]] = []
        self._ground: float | None = None
        self._water: float | None = None
        self._captions: list[tuple[float, str]] = []
        self._view: View | None = None
        self._follow: bool | None = None
        self._zoom = 1.0
        self._speed = 1.0
        self._arrows: tuple[Arrow, ...] = ()
        self._normal = False

    def __repr__(self) -> str:
        counts = f"motions: {len(self._actors)}, fixed shapes: {len(self._fixed)}"
        return f"<Scene: {reprlib.repr(self.title)}, {counts}>"

    def add(
        self,
        moving: Any,
        t: ArrayLike | None = None,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        *,
        shapes: Shapes | None = None,
        color: str | None = None,
        label: str = "",
        panel: int = 0,
        trails: Sequence[Trail] | None = None,
        contacts: Sequence[Contact] | None = None,
    ) -> Scene:
        """Adds a motion.

        Parameters
        ----------
        moving : object
            What moves: a Model, a Robot or a RigidBody with `t` and `q`, a FreeBody or a Gyrostat with
            `t`, or a result alone, which has both: a Solution, Trajectory or TreeSolution; a DiveSolution
            or LiteralDive; the Report or the Motion of a problem, or the best of a search; what
            collocation or a search for an extremal of a tree returns; a recording of markers or of a
            skeleton; a MotionFit, a ScaledModel or a SmoothedMotion; a ReconstructedFlight, a WhatIf or a
            FlightAnalysis; a SyntheticDive. A Solution brings its surfaces too, and so does the TreeSolution
            of a tree in contact.
        t : array_like, shape (n,)
            Times, s, rising. Those of several motions are on one clock.
        q : array_like, shape (n, n_positions), or (n, 7) for a rigid body
            Configurations; for a body its position and quaternion (x, y, z, w). Between samples joints move
            at constant rates and bodies turn the shortest way, so a turn from one sample to the next must
            be less than half of one.
        v : array_like, shape (n, n_velocities), or (n, 6) for a rigid body
            Velocities, for the arrows of angular momentum about the centre of mass and of angular velocity
            (for a tree that of its momentum, joints locked); none are drawn without. For a body linear
            and angular velocity in world axes.
        shapes : Shape, or sequence of these, or mapping of str to these
            Looks of the body, or of bodies by their names: `body` for one, `body_0`, `body_1` and so on for
            several, and those of the model for trees. Unless given people for divers, for a Robot the boxes
            and round solids of its file, for bodies with contacts the hull of the points, balls and rims that
            touch, and else the solid ellipsoids of the same inertia.
        color : str
            `#rrggbb` of shapes without one of their own, of the swimsuit for divers.
        label : str
            Name shown.
        panel : int
            Motions with the same number are drawn together, those with others side by side.
        trails : sequence of str or (str, array_like)
            Points that leave a trail: `"center_of_mass"`, the name of a body for its origin, or a name
            and a point in the axes of that body. The centre of mass unless given; of markers none.
        contacts : sequence of (str, array_like, array_like)
            Points that touch: the name of a body, a point in the axes of that body, and the forces on it at
            the times of the motion, of shape (n, 3), N, in world axes, linear between them. While its force
            is not zero a point is marked, and the arrow of the force starts there; both are seen through
            bodies and ground. Those of a Solution unless given, with the normal force of each, and those of a
            TreeSolution with the force of each.

        Raises
        ------
        InputError
            Lengths do not match, a number is not finite, times do not rise, or a name is unknown.
        TypeError
            Nothing moves in what is given; the message says what to add in its place.

        Examples
        --------
        Two motions side by side:

        >>> from somersault import multibody, viewer
        >>> cart = multibody.cart_pendulum()
        >>> scene = viewer.Scene("Two starts")
        >>> for panel, angle in enumerate((0.1, 1.0)):
        ...     motion = multibody.integrate_tree(cart, (0.0, angle), (0.0, 0.0), (0.0, 1.0), dt=0.02)
        ...     _ = scene.add(motion, label=f"{angle} rad", panel=panel)
        >>> scene.interval
        (0.0, 1.0)
        """
        subject = resolve(moving, t, q, v)
        found = track(subject)
        touching = contacts_of(moving)
        standing: list[Shape] = []
        looks: Mapping[str, Sequence[Shape]]
        if shapes is not None:
            looks = named_shapes(shapes, found.names)
        elif isinstance(moving, Robot):
            looks, standing = robot_figure(moving)
        else:
            looks = default_shapes(subject.source, found, touching)
        if not isinstance(panel, int) or not 0 <= panel <= len({actor.panel for actor in self._actors}):
            raise InputError(f"`panel` must be that of another motion or the next one, found {panel!r}")
        paint = COLORS[len(self._actors) % len(COLORS)] if color is None else color
        rgb("color", paint)
        if trails is None:
            trails = () if isinstance(subject.source, MarkerRecording) else (_CENTER,)
        points = [_trail(trail, found.names) for trail in trails]
        if contacts is not None:
            touches = [_touch(contact, subject, found.names) for contact in contacts]
        elif isinstance(moving, TreeSolution):
            touches = touches_of_tree(moving)
        else:
            touches = touches_of(moving) if isinstance(moving, Solution) else []
            self._normal |= bool(touches)
        actor = Actor(found, looks, paint, label, panel, points, touches)
        self._actors.append(actor)
        self._fixed += [(shape, _SURFACE) for shape in standing]
        on_surfaces = [contact for of_body in touching for contact in of_body]
        self._surround([*on_surfaces, *surfaces_of_tree(moving)], actor)
        model = subject.source.model if isinstance(subject.source, TreeSolution) else subject.source
        if isinstance(model, Model) and shapes is None and is_cart_pendulum(model):
            way = found.poses[:, 0, 0]
            self._fixed += [(shape, "#9aa3af") for shape in rail(model, way.min(), way.max())]
        return self

    def _surround(self, contacts: Sequence[Any], actor: Actor) -> None:
        """Adds what an actor touches, each surface once."""
        level = ground_of(contacts)
        if self._ground is None:
            self._ground = level
        surfaces = {repr(contact.surface): contact.surface for contact in contacts}
        shapes = (surface_shape(surface, *actor.region) for surface in surfaces.values())
        self._fixed += [(shape, _SURFACE) for shape in shapes if shape is not None]

    def ground(self, height: float = 0.0) -> Scene:
        """Adds level ground.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("A lawn").ground(0.0)
        <Scene: 'A lawn', motions: 0, fixed shapes: 0>
        """
        self._ground = float(numbers("height", height, ()))
        return self

    def water(self, height: float = 0.0) -> Scene:
        """Adds a level surface of water, through which one sees.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("A pool").water(0.0)
        <Scene: 'A pool', motions: 0, fixed shapes: 0>
        """
        self._water = float(numbers("height", height, ()))
        return self

    def fixed(self, shape: Shape, color: str = "#a9b0bb") -> Scene:
        """Adds a solid that stays where it is, in world axes.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("A post").fixed(viewer.Cylinder((1, 0, 0), (1, 0, 2), 0.05), "#8a7b66")
        <Scene: 'A post', motions: 0, fixed shapes: 1>
        """
        if not isinstance(shape, Shape):
            raise InputError(f"`shape` must be a shape, found a {type(shape).__name__}")
        rgb("color", color)
        self._fixed.append((shape, color))
        return self

    def box(self, center: ArrayLike, lengths: ArrayLike, color: str = "#a9b0bb") -> Scene:
        """Adds a cuboid with its edges along the axes of the world.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("A step").box(center=(0.5, 0.0, 0.1), lengths=(1.0, 1.0, 0.2))
        <Scene: 'A step', motions: 0, fixed shapes: 1>
        """
        return self.fixed(Box(lengths, center=center), color)

    def platform(
        self, height: float = 10.0, *, edge: float = 0.0, length: float = 6.0, width: float = 3.0
    ) -> Scene:
        """Adds a diving platform: a slab whose top is at a height, and whose front edge is at x = `edge`.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("The platform of 3 m").platform(3.0, edge=-0.2).water()
        <Scene: 'The platform of 3 m', motions: 0, fixed shapes: 1>
        """
        positive("length", length)
        positive("width", width)
        x, z = (float(numbers(name, value, ())) for name, value in (("edge", edge), ("height", height)))
        return self.box((x - length / 2, 0.0, z - 0.1), (length, width, 0.2), "#c3c7ce")

    def caption(self, t: float, text: str) -> Scene:
        """Shows a text from a time on, and marks the time on the slider.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("A dive").caption(0.0, "take-off").caption(0.9, "opens")
        <Scene: 'A dive', motions: 0, fixed shapes: 0>
        """
        self._captions.append((float(numbers("t", t, ())), text))
        return self

    def camera(self, view: View | None = None, *, follow: bool | None = None, zoom: float = 1.0) -> Scene:
        """Sets the view that the page begins with.

        Parameters
        ----------
        view : {"corner", "side", "front", "top"}
            From the side x is to the right and z up, from the front x points to the eye, from the top x is to
            the right and y up. From the corner unless all moves in the plane of one of these.
        follow : bool
            Whether the camera goes with the centre of mass; where that moves far unless given.
        zoom : float
            How much larger all is than where the whole motion is just in sight.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("A dive").camera("side", follow=True)
        <Scene: 'A dive', motions: 0, fixed shapes: 0>
        """
        positive("zoom", zoom)
        _choice("view", view, (*_VIEWS, None))
        self._view, self._follow, self._zoom = view, follow, float(zoom)
        return self

    def play(self, speed: float = 1.0, *, arrows: Sequence[Arrow] = ()) -> Scene:
        """Sets the speed that the page begins with, 1 for that of the motion, and the arrows it shows.

        Examples
        --------
        >>> from somersault import viewer
        >>> viewer.Scene("A dive").play(0.25)
        <Scene: 'A dive', motions: 0, fixed shapes: 0>
        """
        _choice("speed", speed, _SPEEDS)
        for arrow in arrows:
            _choice("arrows", arrow, tuple(_ARROWS))
        self._speed, self._arrows = speed, tuple(arrows)
        return self

    @property
    def interval(self) -> tuple[float, float]:
        """From the first to the last time of all motions, s."""
        if not self._actors:
            raise InputError("the scene must have a motion; `add` one")
        ends = [(actor.track.t[0], actor.track.t[-1]) for actor in self._actors]
        return float(min(start for start, _ in ends)), float(max(end for _, end in ends))

    def _data(self) -> dict[str, Any]:
        start, end = self.interval
        radius = max(actor.radius for actor in self._actors)
        # Lines on the ground, at 1, 2 or 5 times a power of ten.
        power = 10.0 ** np.floor(np.log10(radius / 2))
        spacing = power * max(n for n in (1, 2, 5) if n * power <= radius / 2)
        follow = self._follow
        if follow is None:
            span = max(float(np.ptp(actor.track.center, axis=0).max()) for actor in self._actors)
            follow = span > 2.5 * radius
        low, high = zip(*(actor.region for actor in self._actors), strict=True)
        return {
            "start": start,
            "end": end - start,
            "digits": int(np.clip(3 - np.floor(np.log10((end - start) or 1.0)), 2, 6)),
            "radius": radius,
            "spacing": float(spacing),
            "speed": self._speed,
            "arrows": [_ARROWS[arrow] for arrow in self._arrows],
            "force": "normal force" if self._normal else "contact force",
            "region": [np.min(low, axis=0).tolist(), np.max(high, axis=0).tolist()],
            "camera": {
                "view": self._view or self._actors[0].view,
                "follow": bool(follow),
                "zoom": self._zoom,
            },
            "ground": self._ground,
            "water": self._water,
            "fixed": [shape_data(shape, color) for shape, color in self._fixed],
            "captions": [[t - start, text] for t, text in sorted(self._captions)],
            "panels": sorted({actor.panel for actor in self._actors}),
            "motions": [actor.data(start) for actor in self._actors],
        }

    def html(self) -> str:
        """The page: it loads nothing, and needs no server.

        Examples
        --------
        >>> from somersault import multibody, viewer
        >>> cart = multibody.cart_pendulum()
        >>> motion = multibody.integrate_tree(cart, (0.0, 0.1), (0.0, 0.0), (0.0, 1.0), dt=0.1)
        >>> page = viewer.Scene("Falling over").add(motion).html()
        >>> page[:15], "http" in page
        ('<!doctype html>', False)
        """
        page = files(__package__) / "page"

        def read(name: str) -> str:
            return (page / name).read_text(encoding="utf-8")

        speeds = "".join(f'<option value="{speed:g}">{speed:g}×</option>' for speed in _SPEEDS)
        data = json.dumps(self._data(), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
        parts = {
            "title": escape(self.title),
            "style": read("viewer.css"),
            "speeds": speeds,
            "scene": data,
            "script": "\n".join(read(f"{name}.js") for name in _SCRIPTS),
        }
        return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], read("viewer.html"))

    def write(self, path: str | PathLike[str]) -> Path:
        """Writes the page to a file and returns its path; films are written by `export`.

        Raises
        ------
        InputError
            The path does not end in .html or .htm.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> from somersault import multibody, viewer
        >>> cart = multibody.cart_pendulum()
        >>> motion = multibody.integrate_tree(cart, (0.0, 0.1), (0.0, 0.0), (0.0, 1.0), dt=0.1)
        >>> folder = pathlib.Path(tempfile.mkdtemp())
        >>> viewer.Scene("Falling over").add(motion).write(folder / "pole.html").name
        'pole.html'
        """
        target = Path(path)
        if target.suffix.lower() not in (".html", ".htm"):
            raise InputError(f"`path` must end in .html, found '{target.name}'; `export` writes films")
        target.write_text(self.html(), encoding="utf-8")
        return target

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self.html())}" title="{escape(self.title)}" allow="fullscreen"'
            ' style="width:100%;height:480px;border:1px solid #d9dde5"></iframe>'
        )

    def export(
        self,
        path: str | PathLike[str],
        *,
        size: tuple[int, int] = (640, 480),
        frame_rate: float = 25.0,
        speed: float | None = None,
    ) -> Path:
        """Writes a film: a GIF or an MP4, after the ending of the path.

        Pictures are drawn by Chromium or Chrome without a window, which must be installed; Pillow makes
        the GIF, and FFmpeg, installed or from the package `imageio-ffmpeg`, the MP4. Texts are not part
        of the pictures.

        Parameters
        ----------
        path : path
            File to write, `*.gif` or `*.mp4`.
        size : tuple of int
            Width and height, pixels.
        frame_rate : float
            Pictures a second; those of a GIF are a whole number of hundredths of a second apart.
        speed : float
            1 for that of the motion; that of `play` unless given.

        Raises
        ------
        ExportError
            Browser, Pillow or FFmpeg are missing or failed.
        InputError
            The ending, the size or a rate is not allowed.
        """
        from somersault.viewer.film import export

        return export(self, Path(path), size, frame_rate, self._speed if speed is None else speed)


def animate(
    moving: Any,
    t: ArrayLike | None = None,
    q: ArrayLike | None = None,
    path: str | PathLike[str] = "motion.html",
    **options: Any,
) -> Path:
    """Writes a page that plays one motion; `options` are those of `Scene.add`.

    A result that holds its motion needs no `t` and `q`: ``animate(result, path="dive.html")``.

    >>> import tempfile
    >>> from pathlib import Path
    >>> from somersault import multibody, viewer
    >>> diver = multibody.diver_spatial()
    >>> postures = [diver.configuration("A"), diver.configuration("F")]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     page = viewer.animate(diver.model, (0.0, 0.5), postures, Path(folder) / "tuck.html")
    ...     page.stat().st_size < 200_000
    True
    """
    target = Path(path)
    return Scene(options.get("label") or target.stem).add(moving, t, q, **options).write(target)
