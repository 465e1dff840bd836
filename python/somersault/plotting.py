"""Figures of trajectories and studies, with matplotlib (`pip install somersault[plot]`).

Each function draws into the axes given, or into new ones, and returns them, so that a figure can be
composed and finished as any other of matplotlib's. A method looks the same in every figure: its colour,
marker and line follow from its place in the method table. The colours are Paul Tol's *muted* scheme,
which stays distinct for colour-blind readers; markers and dashes tell methods apart without colour.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

import somersault

try:
    import matplotlib.pyplot as plt
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Ellipse
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
except ImportError as _error:
    raise ImportError("somersault.plotting needs matplotlib: pip install 'somersault[plot]'") from _error

from somersault._ftla_figures import compare_motions, exponents, projections, subspace_angles
from somersault._motion_plots import motion_groups

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[Any]

__all__ = [
    "abbreviation",
    "compare_motions",
    "energy_ratios",
    "exponents",
    "gaps",
    "motion",
    "motion_groups",
    "observed_orders",
    "polhode",
    "projections",
    "stability_regions",
    "style",
    "subspace_angles",
    "tree",
    "work_precision",
]

_COLOURS = (
    "#332288",
    "#CC6677",
    "#117733",
    "#88CCEE",
    "#882255",
    "#DDCC77",
    "#44AA99",
    "#AA4499",
    "#999933",
    "#555555",
)
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "*", "h", "d")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))
_AXIS_COLOURS = ("#CC6677", "#117733", "#332288")


def abbreviation(name: str) -> str:
    """The name of a method as in the legends of the thesis (Table 7.3): ``AB4``, ``Euler``, ``RKMK_L``."""
    stem, _, variables = name.partition("_")
    stem = stem.capitalize() if stem in ("euler", "heun") else stem.upper()
    return f"{stem}_{variables.upper()}" if variables else stem


def style(name: str) -> dict[str, Any]:
    """Colour, marker, line and label of a method, as keyword arguments of `Axes.plot`."""
    index = somersault.methods().names.index(name)
    return {
        "color": _COLOURS[index % len(_COLOURS)],
        "marker": _MARKERS[index % len(_MARKERS)],
        "linestyle": _DASHES[index // len(_COLOURS) % len(_DASHES)],
        "label": abbreviation(name),
    }


def stability_regions(regions: Mapping[str, Any], ax: Axes | None = None) -> Axes:
    """Stability regions of the translation, as thesis Figure 6.1.

    Parameters
    ----------
    regions : mapping of str to StabilityRegion
        Regions by method, as `somersault.studies.stability_region` makes them.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes
        Methods that have the same region share a curve.
    """
    ax = ax or plt.figure(figsize=(7.0, 6.2), layout="constrained").add_subplot()
    handles = []
    for names, region in _same_regions(regions):
        look = style(names[0])
        upper = _polylines(np.asarray(region.boundary))
        lines = [line * [1.0, side] for line in upper for side in (1.0, -1.0)]
        ax.add_collection(
            LineCollection(lines, colors=look["color"], linestyles=look["linestyle"], linewidths=1.8)
        )
        label = f"{', '.join(map(abbreviation, names))}  ({region.area:.2f})"
        handles.append(Line2D([], [], color=look["color"], linestyle=look["linestyle"], lw=1.8, label=label))
    ax.autoscale_view()
    ax.axhline(0.0, color="0.8", linewidth=0.8, zorder=0)
    ax.axvline(0.0, color="0.8", linewidth=0.8, zorder=0)
    ax.set_aspect("equal")
    ax.set_xlabel(r"$\lambda_R\,\Delta t$")
    ax.set_ylabel(r"$\lambda_I\,\Delta t$")
    ax.legend(
        handles=handles, title="method (area)", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False
    )
    return ax


def _polylines(segments: Array) -> list[Array]:
    """Segments of two points each, joined where their ends meet."""
    meeting: dict[tuple[float, ...], list[int]] = {}
    ends = [[tuple(point) for point in segment.round(9)] for segment in segments]
    for index, pair in enumerate(ends):
        for end in pair:
            meeting.setdefault(end, []).append(index)
    left = set(range(len(segments)))

    def follow(end: tuple[float, ...]) -> list[tuple[float, ...]]:
        path = []
        while following := [index for index in meeting[end] if index in left]:
            left.remove(following[0])
            a, b = ends[following[0]]
            end = b if a == end else a
            path.append(end)
        return path

    lines = []
    while left:
        first, second = ends[left.pop()]
        lines.append(np.array([*reversed(follow(first)), first, second, *follow(second)]))
    return lines


def _same_regions(regions: Mapping[str, Any]) -> list[tuple[list[str], Any]]:
    """Methods whose regions are one, by area and ends, together with that region."""
    groups: list[tuple[list[str], Any]] = []
    for name, region in regions.items():
        measures = (region.area, region.real_limit, region.imaginary_limit)
        for names, first in groups:
            if np.allclose(
                measures, (first.area, first.real_limit, first.imaginary_limit), rtol=1e-3, atol=1e-3
            ):
                names.append(name)
                break
        else:
            groups.append(([name], region))
    return groups


def energy_ratios(
    studies: Mapping[str, Any], ax: Axes | None = None, limits: tuple[float, float] = (1e-3, 1e4)
) -> Axes:
    """Largest and smallest ratio of rotational energy over many bodies, as thesis Table 6.2.

    Each method is a band from the smallest to the largest T_n/T_0, one bar for each number of steps.

    Parameters
    ----------
    studies : mapping of str to EnergyStudy
        Studies by method, as `somersault.studies.energy` makes them, with the same numbers of steps.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.
    limits : (float, float)
        What is shown; ratios beyond are drawn as arrows.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = ax or plt.figure(figsize=(9.0, 4.6), layout="constrained").add_subplot()
    low, high = limits
    steps: Sequence[int] = next(iter(studies.values())).steps if studies else []
    shades = plt.get_cmap("viridis")(np.linspace(0.0, 0.92, len(steps)))
    for column, study in enumerate(studies.values()):
        places = column + np.linspace(-0.36, 0.36, len(steps))
        smallest, largest = np.asarray(study.min), np.asarray(study.max)
        for x, bottom, top, shade in zip(places, smallest, largest, shades, strict=True):
            ax.plot([x, x], np.clip([bottom, top], low, high), color=shade, lw=3.4, solid_capstyle="butt")
            if top > high:
                ax.plot(x, high, marker="^", color=shade, ms=5, clip_on=False)
            if bottom < low:
                ax.plot(x, low, marker="v", color=shade, ms=5, clip_on=False)
    ax.set_yscale("log")
    ax.set_ylim(low, high)
    ax.axhline(1.0, color="0.4", linewidth=0.8, zorder=0)
    ax.set_xticks(range(len(studies)), [abbreviation(name) for name in studies], rotation=40, ha="right")
    ax.set_xlim(-0.6, len(studies) - 0.4)
    ax.set_ylabel("rotational energy $T_n/T_0$,\nsmallest to largest")
    handles = [
        Line2D([], [], color=shade, lw=4, label=f"{n}") for n, shade in zip(steps, shades, strict=True)
    ]
    ax.legend(handles=handles, title="steps $n$", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return ax


def observed_orders(
    observed: Mapping[str, float], stated: Mapping[str, int] | None = None, ax: Axes | None = None
) -> Axes:
    """Orders measured against orders stated.

    Parameters
    ----------
    observed : mapping of str to float
        Slopes of the error over the step, by method.
    stated : mapping of str to int, optional
        Orders to compare with.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes
    """
    names = list(observed)
    width = max(6.0, 0.27 * len(names))
    ax = ax or plt.figure(figsize=(width, 3.6), layout="constrained").add_subplot()
    if stated is not None:
        ax.plot(
            range(len(names)),
            [stated[name] for name in names],
            linestyle="none",
            marker="_",
            ms=15,
            mew=2,
            color="0.65",
            label="stated",
        )
    ax.plot(
        range(len(names)),
        list(observed.values()),
        linestyle="none",
        marker="o",
        ms=5,
        color=_COLOURS[0],
        label="observed",
    )
    ax.set_xticks(range(len(names)), [abbreviation(name) for name in names], rotation=50, ha="right")
    ax.set_xlim(-0.6, len(names) - 0.4)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_ylim(bottom=0)
    ax.grid(axis="y", color="0.9")
    ax.set_ylabel("order")
    ax.legend(frameon=False, loc="upper left")
    return ax


_ERROR_LABELS = {
    "position": "position error, m",
    "velocity": "velocity error, m/s",
    "orientation": "orientation error, rad",
    "angular_velocity": "angular velocity error, rad/s",
}


def work_precision(
    runs: Mapping[str, Any], error: str = "orientation", against: str = "seconds", ax: Axes | None = None
) -> Axes:
    """Error at the end against computation time, as thesis Figures 7.1 and 7.2.

    Parameters
    ----------
    runs : mapping of str to WorkPrecision
        Results by method, as `somersault.studies.work_precision` makes them.
    error : {"position", "orientation", "velocity", "angular_velocity"}
        Which error to draw.
    against : {"seconds", "evaluations", "steps"}
        What to draw it against.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = ax or plt.figure(figsize=(9.0, 5.4), layout="constrained").add_subplot()
    for name, run in runs.items():
        values = np.asarray(run.errors[error])
        drawn = np.isfinite(values) & (values > 0)
        ax.plot(
            np.asarray(getattr(run, against))[drawn],
            values[drawn],
            **style(name),
            markersize=4.5,
            linewidth=1.3,
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(numticks=20))
        axis.set_minor_formatter(NullFormatter())
    ax.grid(color="0.92")
    ax.set_axisbelow(True)
    ax.set_xlabel({"seconds": "computation time, s", "evaluations": "evaluations", "steps": "steps"}[against])
    ax.set_ylabel(_ERROR_LABELS[error])
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, ncols=1 if len(runs) <= 22 else 2)
    return ax


def motion(trajectory: somersault.Trajectory, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
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
    """
    if axes is None:
        axes = plt.figure(figsize=(9.0, 7.6), layout="constrained").subplots(4, 1, sharex=True)
    place, turn, conserved, drift = axes
    t = trajectory.t
    for i, colour in enumerate(_AXIS_COLOURS):
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
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return axes


def gaps(motion: somersault.Trajectory, contacts: Any, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Gaps and forces of contacts of one body over time, and the events of the motion.

    Parameters
    ----------
    motion : Trajectory or Solution
        Of one body.
    contacts : Contact or sequence of Contact
        Its contacts.
    axes : sequence of two matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    sequence of two matplotlib.axes.Axes
    """
    if axes is None:
        axes = plt.figure(figsize=(9.0, 5.2), layout="constrained").subplots(2, 1, sharex=True)
    contacts = [contacts] if isinstance(contacts, somersault.contact.Contact) else list(contacts)
    events = motion.events if isinstance(motion, somersault.Solution) else ()
    for i, contact in enumerate(contacts):
        colour = _COLOURS[i % len(_COLOURS)]
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


def tree(
    model: somersault.Model, q: Any, view: str = "xz", ax: Axes | None = None, colour: str = _COLOURS[3]
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
    """
    ax = ax or plt.figure(figsize=(4.0, 6.0), layout="constrained").add_subplot()
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
    ax.plot(*(page @ model.center_of_mass(q)), "P", color=_COLOURS[1], ms=7, mec="white")
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
    """
    if isinstance(trajectories, somersault.Trajectory):
        trajectories = [trajectories]
    sphere: Any = ax or plt.figure(figsize=(5.2, 4.6), layout="constrained").add_subplot(projection="3d")
    for i, trajectory in enumerate(trajectories):
        momentum = trajectory.orientation.inv().apply(trajectory.angular_momentum)
        m = momentum / np.linalg.norm(momentum, axis=1, keepdims=True)
        front = _facing(sphere, m)
        colour = _COLOURS[1] if i == 0 else "0.55"
        width = 2.2 if i == 0 else 0.9
        sphere.plot(*np.where(front[:, None], m, np.nan).T, color=colour, lw=width)
        sphere.plot(*np.where(front[:, None], np.nan, m).T, color=colour, lw=width, alpha=0.25)
    for i, colour in enumerate(_AXIS_COLOURS):
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
