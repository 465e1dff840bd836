"""Figures of solutions of optimal control problems."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from somersault.errors import InputError
from somersault.ocp import CollocationResult, PolishResult
from somersault.plotting.labels import label_ends
from somersault.plotting.palette import MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["control_history"]

#: Points of a curve on each arc, or on the whole.
_POINTS = 200
#: Largest switching functions that are rounding, beside costates.
_ROUNDING = 1e-9
#: Shades of arcs, by what is held on them.
_SHADES = {
    "at the upper bound": "0.93",
    "at the lower bound": "0.85",
    "a control at a bound": "0.90",
    "singular": "#f3e2c7",
    "state at its bound": "#dbe9f4",
}


def control_history(
    result: CollocationResult | PolishResult, axes: Sequence[Axes] | None = None
) -> Sequence[Axes]:
    """States, controls, costates and switching functions over time, with arcs shaded and junctions marked.

    Parameters
    ----------
    result : CollocationResult or PolishResult
        Of `ControlProblem.solve`, or of `ControlProblem.polish`, whose arcs are shaded where a control is at
        a bound or singular, or a state at its bound.
    axes : sequence of matplotlib.axes.Axes, optional
        Axes to draw into: three, or four for a result with arcs, which has switching functions too.

    Returns
    -------
    sequence of matplotlib.axes.Axes

    Examples
    --------
    >>> from somersault import ocp, plotting
    >>> problem = ocp.ControlProblem(
    ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 0],
    ...     final=[1, 0], duration=(0.1, 10), bounds={"force": (-1, 1)}, end_cost=lambda x, t: t)
    >>> axes = plotting.control_history(problem.polish(problem.solve(tol=1e-4)))
    >>> [ax.get_ylabel() for ax in axes]
    ['states', 'controls', 'costates', 'switching functions']
    """
    if not isinstance(result, CollocationResult | PolishResult):
        raise TypeError(
            f"`result` must be a CollocationResult or a PolishResult, found {type(result).__name__}"
        )
    arcs = result.arcs if isinstance(result, PolishResult) else []
    names = ["states", "controls", "costates"] + ["switching functions"] * bool(arcs)
    if axes is None:
        figure = plt.figure(figsize=(9.0, 2.1 * len(names)), layout="constrained")
        axes = figure.subplots(len(names), 1, sharex=True)
    if len(axes) != len(names):
        raise InputError(f"`axes` must be {len(names)} for this result, found {len(axes)}")
    curves = [result.state, result.control, result.costate]
    entries = [result.state_names, result.control_names, result.state_names]
    if arcs and isinstance(result, PolishResult):
        curves.append(result.switching)
        entries.append(result.control_names)
    if arcs:
        # nothing is drawn across a junction
        spans = [(arc["start"], arc["end"]) for arc in arcs]
    else:
        found = result.found if isinstance(result, PolishResult) else result
        spans = [(float(found.t[0]), float(found.t[-1]))]
    # within arcs, since a junction may be rounded to the one before or after it
    inside = np.linspace(1e-9, 1 - 1e-9, _POINTS)
    pieces = [start + (end - start) * inside for start, end in spans]
    for ax, name, curve, parts in zip(axes, names, curves, entries, strict=True):
        values = [curve(t) for t in pieces]
        gap = np.full((1, len(parts)), np.nan)
        t = np.concatenate([np.append(piece, piece[-1]) for piece in pieces])
        rows = np.concatenate([np.vstack([value, gap]) for value in values])
        for k, part in enumerate(parts):
            ax.plot(t[:-1], rows[:-1, k], color=MUTED[k % len(MUTED)], label=part)
        for arc in arcs:
            if shade := _shade(arc):
                ax.axvspan(arc["start"], arc["end"], color=_SHADES[shade], lw=0, zorder=0)
        for arc in arcs[1:]:
            ax.axvline(arc["start"], color="0.6", lw=0.8, ls=":", zorder=1)
        if name == "switching functions":
            ax.axhline(0.0, color="0.4", lw=0.8, zorder=1)
            # what is rounding beside the costates is drawn as zero
            costates = max(float(np.abs(result.costate(t)).max()) for t in pieces)
            if max(float(np.abs(value).max()) for value in values) < _ROUNDING * costates:
                ax.set_ylim(-costates, costates)
        ax.set_ylabel(name)
        ax.set_xlim(spans[0][0], spans[-1][1])
        label_ends(ax)
    shades = dict.fromkeys(shade for arc in arcs if (shade := _shade(arc)))
    if shades:
        patches = [Rectangle((0, 0), 1, 1, color=_SHADES[shade]) for shade in shades]
        axes[0].legend(
            patches, list(shades), loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False
        )
    axes[-1].set_xlabel("time, s")
    return axes


def _shade(arc: dict[str, object]) -> str | None:
    """What is held on an arc."""
    if arc["bound"] is not None:
        return "state at its bound"
    kinds = list(arc["controls"].values()) if isinstance(arc["controls"], dict) else []
    if "singular" in kinds:
        return "singular"
    if "lower" not in kinds and "upper" not in kinds:
        return None
    return f"at the {kinds[0]} bound" if len(kinds) == 1 else "a control at a bound"
