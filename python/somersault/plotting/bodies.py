"""Figures of motions of bodies and trees."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, cast

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

import somersault
from somersault.errors import InputError
from somersault.plotting.given import given_axes
from somersault.plotting.labels import label_ends
from somersault.plotting.palette import AXES, MUTED
from somersault.viewer.results import resolve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["body_motion", "gaps", "polhode", "tree_configuration", "tree_motion"]

Array = NDArray[Any]


def body_motion(trajectory: somersault.Trajectory, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Position, body axes, angular velocity, energy and angular momentum of one body over time.

    Parameters
    ----------
    trajectory : Trajectory or Solution
        Of one body.
    axes : sequence of four matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    sequence of four matplotlib.axes.Axes

    Examples
    --------
    >>> import somersault
    >>> from somersault import plotting
    >>> body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
    >>> start = somersault.State(angular_velocity=(0.1, 8.0, 0.1))
    >>> axes = plotting.body_motion(somersault.integrate(body, start, (0.0, 1.0), dt=0.01))
    >>> axes[0].get_ylabel()
    'position, m'
    """
    if not isinstance(trajectory, somersault.Trajectory):
        raise InputError(
            "`trajectory` must be a Trajectory or Solution of one body, found a"
            f" {type(trajectory).__name__}; `tree_motion` draws trees"
        )
    if axes is None:
        axes = plt.figure(figsize=(9.0, 7.6), layout="constrained").subplots(4, 1, sharex=True)
    place, turn, conserved, drift = axes
    t = trajectory.t
    for i, colour in enumerate(AXES):
        place.plot(t, trajectory.position[:, i], color=colour, label="xyz"[i])
        turn.plot(t, trajectory.angular_velocity_body[:, i], color=colour, label=rf"$\omega_{'xyz'[i]}$")
        conserved.plot(t, trajectory.angular_momentum[:, i], color=colour, label=rf"$L_{'xyz'[i]}$")
    place.set_ylabel("position, m")
    turn.set_ylabel("angular velocity\nin the body, rad/s")
    conserved.set_ylabel("angular momentum\nin the world, kg m²/s")
    energy = np.asarray(trajectory.kinetic_energy)
    drift.plot(t, energy, color="0.2", label="$T$")
    drift.set_ylabel("kinetic energy, J")
    if np.ptp(energy) < 1e-6 * np.max(np.abs(energy)):
        drift.set_ylim(0.0, 1.3 * np.max(energy))
    drift.set_xlabel("time, s")
    for ax in axes:
        ax.grid(color="0.92")
        ax.margins(x=0)
        label_ends(ax)
    return axes


def gaps(
    motion: somersault.Trajectory, contacts: Any = None, axes: Sequence[Axes] | None = None
) -> Sequence[Axes]:
    """Gaps and forces of contacts of one body over time, and the events of the motion.

    Parameters
    ----------
    motion : Trajectory or Solution
        Of one body.
    contacts : Contact or sequence of Contact, optional
        Its contacts; those of the Solution unless given.
    axes : sequence of two matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    sequence of two matplotlib.axes.Axes

    Examples
    --------
    >>> import somersault
    >>> from somersault import contact, plotting
    >>> ball = contact.bouncing_ball(1.0, 0.1, contact.CompliantLaw.from_restitution(1.0, 1e4, 0.8), 0.2)
    >>> motion = somersault.integrate(
    ...     ball.body, ball.state, (0.0, 0.5), dt=0.005, forces=ball.forces, contacts=ball.contacts)
    >>> axes = plotting.gaps(motion)
    >>> axes[0].get_ylabel(), axes[1].get_ylabel()
    ('gap, mm', 'normal force, N')
    """
    if axes is None:
        axes = plt.figure(figsize=(9.0, 5.2), layout="constrained").subplots(2, 1, sharex=True)
    if contacts is None:
        contacts = motion.contacts if isinstance(motion, somersault.Solution) else None
    if contacts is None:
        raise InputError("`contacts` must be given, since the motion does not hold its contacts")
    contacts = [contacts] if isinstance(contacts, somersault.contact.Contact) else list(contacts)
    events = motion.events if isinstance(motion, somersault.Solution) else ()
    for i, contact in enumerate(contacts):
        colour = MUTED[i % len(MUTED)]
        seen = np.array([contact.gap(motion[n]) for n in range(len(motion))])
        axes[0].plot(motion.t, 1e3 * seen[:, 0], color=colour, lw=1.2, label=f"contact {i}")
        axes[1].plot(motion.t, [contact.law.force(*pair) for pair in seen], color=colour, lw=1.2)
        for kind, marker in (("touch_down", "v"), ("release", "^"), ("re_engagement", "D")):
            there = [event for event in events if event.contact == i and event.kind == kind]
            axes[0].plot(
                [event.t for event in there],
                [1e3 * contact.gap(event.state)[0] for event in there],
                marker,
                color=colour,
                ms=4,
                mfc="white",
                label=kind.replace("_", "-") if there and i == 0 else None,
            )
    axes[0].axhline(0.0, color="0.6", lw=0.8, zorder=0)
    axes[0].set_ylabel("gap, mm")
    axes[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    axes[1].set_ylabel("normal force, N")
    axes[1].set_xlabel("time, s")
    for ax in axes:
        ax.grid(color="0.92")
        ax.margins(x=0)
    return axes


def tree_motion(moving: Any, bodies: Sequence[str] | None = None, ax: Axes | None = None) -> Axes:
    """Angles and travels of the joints of a tree over time.

    Parameters
    ----------
    moving : object
        A result that holds the motion of a tree, as `Scene.add` of the viewer takes it: a TreeSolution, a
        MotionFit, a DiveSolution, the Motion of a problem, a CollocationResult and others.
    bodies : sequence of str, optional
        The bodies whose joints are drawn, which have one degree of freedom; all of these unless given.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If a body is not known or its joint has not one degree of freedom.
    TypeError
        If no tree moves in what is given.

    Examples
    --------
    >>> from somersault import multibody, plotting
    >>> arm = multibody.two_link_arm()
    >>> motion = multibody.integrate_tree(arm, [0.0, 0.3], [1.0, 0.0], (0.0, 2.0), dt=0.01)
    >>> ax = plotting.tree_motion(motion)
    >>> ax.get_ylabel(), [line.get_label() for line in ax.lines]
    ('angle, rad', ['upper', 'lower'])
    """
    subject = resolve(moving)
    motion: Any = subject
    model = subject.source
    if isinstance(model, somersault.multibody.TreeSolution):
        motion, model = model, model.model
    if not isinstance(model, somersault.Model):
        raise TypeError(f"`moving` must hold the motion of a tree, found a {type(moving).__name__}")
    units = {"revolute": "angle, rad", "prismatic": "travel, m"}
    joints = {link.name: link.joint for link in model.links if link.mimic is None and link.joint in units}
    shown = list(bodies or joints)
    for name in shown:
        if name not in joints:
            known = ", ".join(joints)
            raise InputError(f"`bodies` must be of those whose joint has one angle, {known}, found '{name}'")
    ax = given_axes(ax, (9.0, 4.5))
    q = np.asarray(motion.q)
    for i, name in enumerate(shown):
        line = ("-", "--", ":", "-.")[i // len(MUTED) % 4]
        values = q[:, model.positions_of(name)]
        ax.plot(motion.t, values, line, color=MUTED[i % len(MUTED)], label=name)
    ax.set_xlabel("time, s")
    ax.set_ylabel("; ".join(dict.fromkeys(units[joints[name]] for name in shown)))
    ax.grid(color="0.92")
    ax.margins(x=0)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return ax


def tree_configuration(
    model: somersault.Model, q: Any, view: str = "xz", ax: Axes | None = None, colour: str = MUTED[3]
) -> Axes:
    """A tree of bodies in a configuration, seen along an axis of the world.

    Each body is drawn as the solid ellipsoid that has its mass and inertia; dots are joints, the cross is
    the centre of mass.

    Parameters
    ----------
    model : Model
        The tree.
    q : array_like, shape (n_positions,)
        Its configuration.
    view : str, optional
        The two axes of the page, such as ``"xz"`` or ``"yz"``.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.
    colour : str, optional
        Colour of the bodies.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> from somersault import multibody, plotting
    >>> diver = multibody.diver_planar()
    >>> ax = plotting.tree_configuration(diver.model, diver.configuration("H"))
    >>> len(ax.patches) >= diver.model.n_bodies
    True
    """
    if not isinstance(model, somersault.Model):
        raise TypeError(f"`model` must be a Model, found {type(model).__name__}")
    if not isinstance(view, str) or len(view) != 2 or len(set(view) & set("xyz")) != 2:
        raise InputError(f"`view` must be two of the axes x, y and z, found {view!r}")
    ax = given_axes(ax, (4.0, 6.0))
    right, up = ("xyz".index(axis) for axis in view)
    page = np.eye(3)[[right, up]]
    towards = np.cross(*page)
    poses = model.poses(q)
    shapes = []
    for link, pose in zip(model.links, poses, strict=True):
        if link.mass == 0.0 or not link.inertia.any():
            continue
        moments, axes = np.linalg.eigh(link.inertia)
        # I = m (b² + c²)/5 and its permutations; rounding may leave a square below zero.
        squares = np.maximum(2.5 / link.mass * (moments.sum() - 2 * moments), 0.0)
        rotation = pose[:3, :3] @ axes
        shape = page @ (rotation * squares) @ rotation.T @ page.T
        centre = pose[:3, :3] @ link.center + pose[:3, 3]
        shapes.append((float(towards @ centre), page @ centre, shape))
    for _, centre, shape in sorted(shapes, key=lambda entry: entry[0]):
        squares, axes = np.linalg.eigh(shape)
        width, height = 2 * np.sqrt(np.maximum(squares, 0.0))
        angle = float(np.degrees(np.arctan2(axes[1, 0], axes[0, 0])))
        ax.add_patch(
            Ellipse(
                (centre[0], centre[1]), width, height, angle=angle, fc=colour, ec="0.25", lw=0.7, alpha=0.85
            )
        )
    ax.plot(*(page @ poses[:, :3, 3].T), "o", color="0.25", ms=2.2)
    ax.plot(*(page @ model.center_of_mass(q)), "P", color=MUTED[1], ms=7, mec="white")
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_xlabel(f"{view[0]}, m")
    ax.set_ylabel(f"{view[1]}, m")
    return ax


def polhode(
    trajectories: somersault.Trajectory | Iterable[somersault.Trajectory], ax: Axes | None = None
) -> Axes:
    """Paths of the angular momentum as the body sees it, on the unit sphere.

    A free body keeps to one curve, where the sphere of its momentum meets the ellipsoid of its energy.

    Parameters
    ----------
    trajectories : Trajectory or iterable of Trajectory
        Motions of one body each. The first is drawn bold.
    ax : mpl_toolkits.mplot3d.axes3d.Axes3D, optional
        Axes to draw into.

    Returns
    -------
    mpl_toolkits.mplot3d.axes3d.Axes3D

    Examples
    --------
    >>> import somersault
    >>> from somersault import plotting
    >>> body = somersault.RigidBody(1.0, (1.0, 2.0, 3.0))
    >>> starts = [somersault.State(angular_velocity=(x, 1.0, 0.0)) for x in (0.1, 0.5)]
    >>> ax = plotting.polhode(somersault.integrate(body, start, (0.0, 9.0), dt=0.1) for start in starts)
    >>> ax.name
    '3d'
    """
    if isinstance(trajectories, somersault.Trajectory):
        trajectories = [trajectories]
    sphere: Any = ax or plt.figure(figsize=(5.2, 4.6), layout="constrained").add_subplot(projection="3d")
    for i, trajectory in enumerate(trajectories):
        momentum = trajectory.orientation.inv().apply(trajectory.angular_momentum)
        m = momentum / np.linalg.norm(momentum, axis=1, keepdims=True)
        front = _facing(sphere, m)
        colour = MUTED[1] if i == 0 else "0.55"
        width = 2.2 if i == 0 else 0.9
        sphere.plot(*np.where(front[:, None], m, np.nan).T, color=colour, lw=width)
        sphere.plot(*np.where(front[:, None], np.nan, m).T, color=colour, lw=width, alpha=0.25)
    for i, colour in enumerate(AXES):
        end = np.zeros((2, 3))
        end[:, i] = 1.0, 1.35
        sphere.plot(*end.T, color=colour, lw=1.8)
        sphere.text(*(1.48 * np.eye(3)[i]), "xyz"[i], color=colour, ha="center", va="center")
    angle = np.linspace(0.0, 2 * np.pi, 121)
    right, up = _screen(sphere)
    outline = np.outer(np.cos(angle), right) + np.outer(np.sin(angle), up)
    sphere.plot(*outline.T, color="0.75", lw=0.8)
    sphere.set_box_aspect((1, 1, 1), zoom=1.3)
    sphere.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.2), zlim=(-1.2, 1.2))
    sphere.set_axis_off()
    return cast("Axes", sphere)


def _view(sphere: Any) -> Array:
    azimuth, elevation = np.radians([sphere.azim, sphere.elev])
    return np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )


def _screen(sphere: Any) -> tuple[Array, Array]:
    view = _view(sphere)
    right = np.cross([0.0, 0.0, 1.0], view)
    right /= np.linalg.norm(right)
    return right, np.cross(view, right)


def _facing(sphere: Any, m: Array) -> Array:
    return np.asarray(m @ _view(sphere) >= 0.0)
