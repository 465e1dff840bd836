"""Figures of the studies of methods: stability, energy, orders, accuracy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

import somersault
from somersault.plotting.given import given_axes
from somersault.plotting.palette import MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "abbreviation",
    "energy_ratios",
    "observed_orders",
    "stability_regions",
    "style",
    "work_precision_diagram",
]

Array = NDArray[Any]

_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "*", "h", "d")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))


def abbreviation(name: str) -> str:
    """The name of a method as in the legends of the thesis (Table 7.3): ``AB4``, ``Euler``, ``RKMK_L``.

    Examples
    --------
    >>> from somersault import plotting
    >>> plotting.abbreviation("rkmk_l")
    'RKMK_L'
    """
    stem, _, variables = name.partition("_")
    stem = stem.capitalize() if stem in ("euler", "heun") else stem.upper()
    return f"{stem}_{variables.upper()}" if variables else stem


def style(name: str) -> dict[str, Any]:
    """Colour, marker, line and label of a method, as keyword arguments of `Axes.plot`.

    Examples
    --------
    >>> from somersault import plotting
    >>> plotting.style("rkmk")["label"]
    'RKMK'
    """
    index = somersault.methods().names.index(name)
    return {
        "color": MUTED[index % len(MUTED)],
        "marker": _MARKERS[index % len(_MARKERS)],
        "linestyle": _DASHES[index // len(MUTED) % len(_DASHES)],
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

    Examples
    --------
    >>> from somersault import plotting, studies
    >>> ax = plotting.stability_regions({name: studies.stability_region(name) for name in ("heun", "rk4")})
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['Heun  (5.87)', 'RK4  (12.70)']
    """
    ax = given_axes(ax, (7.0, 6.2), "compressed")
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
    ax.set_xlabel(r"growth in a step, $\lambda_R\,\Delta t$")
    ax.set_ylabel(r"oscillation in a step, $\lambda_I\,\Delta t$, rad")
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

    Examples
    --------
    >>> from somersault import plotting, studies
    >>> found = {name: studies.energy(name, studies.prisms(3), steps=[1, 10]) for name in ("rkmk", "dmv2s")}
    >>> ax = plotting.energy_ratios(found)
    >>> [tick.get_text() for tick in ax.get_xticklabels()]
    ['RKMK', 'DMV2S']
    """
    ax = given_axes(ax, (9.0, 4.6))
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

    Examples
    --------
    >>> from somersault import plotting
    >>> ax = plotting.observed_orders({"heun": 1.98, "rkmk": 4.01}, {"heun": 2, "rkmk": 4})
    >>> [tick.get_text() for tick in ax.get_xticklabels()]
    ['Heun', 'RKMK']
    """
    names = list(observed)
    width = max(6.0, 0.27 * len(names))
    ax = given_axes(ax, (width, 3.6))
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
        color=MUTED[0],
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


def work_precision_diagram(
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

    Examples
    --------
    >>> from somersault import plotting, studies
    >>> problem = studies.Problem.case(1)
    >>> methods, dts = ("heun", "rkmk"), [0.2, 0.1]
    >>> runs = {name: studies.work_precision(problem, name, dts, repeats=1) for name in methods}
    >>> ax = plotting.work_precision_diagram(runs, against="evaluations")
    >>> ax.get_xscale(), len(ax.lines)
    ('log', 2)
    """
    ax = given_axes(ax, (9.0, 5.4))
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
    arrow = {"arrowstyle": "-|>", "color": "0.35"}
    ax.annotate(
        "better", (0.01, 0.015), (0.04, 0.07), xycoords="axes fraction", color="0.35", arrowprops=arrow
    )
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, ncols=1 if len(runs) <= 22 else 2)
    return ax
