"""Figures of recorded motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

from somersault import motion
from somersault.plotting.given import given_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["channels", "motion_groups"]

_GROUPS = ("#228833", "#CC6677", "#DDCC77", "#882255")
_SINGLE = "#4477AA"
_LABELS = {
    "eigenweight": "eigenweight",
    "marker_error": "marker error, mm",
    "scale": "scaling factor",
    "rotation": "rotation, turns",
}


def channels(
    recording: motion.ChannelRecording, names: Sequence[str] | None = None, ax: Axes | None = None
) -> Axes:
    """Channels over time, each with its name at the side.

    Parameters
    ----------
    recording : ChannelRecording
        As `motion.read_mot` and others return it.
    names : sequence of str, optional
        Those that are drawn; all unless given.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> from somersault import motion, plotting
    >>> squat = motion.ChannelRecording(["knee", "hip"], [0.0, 0.1], [[0.0, 0.1], [0.5, 0.2]])
    >>> [line.get_label() for line in plotting.channels(squat, ["hip"]).lines]
    ['hip']
    """
    ax = given_axes(ax, (9.0, 5.4))
    for name in recording.names if names is None else names:
        ax.plot(recording.times, recording.track(name), lw=1.4, label=name)
    ax.set_xlabel("time, s")
    ax.grid(color="0.92")
    ax.margins(x=0)
    ax.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def motion_groups(
    groups: Mapping[str, Sequence[motion.MotionFit]],
    single: Mapping[str, motion.MotionFit] | None = None,
    axes: Sequence[Axes] | None = None,
    *,
    n_frames: int = 60,
    weight: int = 0,
) -> Sequence[Axes]:
    """Groups of fitted motions side by side, as thesis Figure 4.1.

    Thick lines are means, shaded is what lies within one standard deviation of them. The four panels are an
    eigenweight, the root mean square of the distances of markers, the scale, and the rotation.

    Parameters
    ----------
    groups : mapping of str to sequence of MotionFit
        Motions by the name of their group.
    single : mapping of str to MotionFit, optional
        Motions of their own, such as one that was generated: thin lines in the panels of
        eigenweight and rotation.
    axes : sequence of four matplotlib.axes.Axes, optional
        Axes to draw into.
    n_frames : int
        Frames that each motion is brought to.
    weight : int
        Number of the eigenweight, from 0.

    Returns
    -------
    sequence of four matplotlib.axes.Axes

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import motion, multibody, ocp, plotting
    >>> diver, t = multibody.diver_planar(), np.linspace(0.0, 1.0, 8)
    >>> straight, pike = diver.configuration("A"), diver.configuration("H")
    >>> markers = motion.MarkerSet.joint_centres(diver.model)
    >>> seen = motion.place_markers(markers, t, np.linspace(straight, pike, 8))
    >>> base = ocp.EigenpostureBase([straight[3:], pike[3:]])
    >>> fit = motion.MarkerFit(markers, base=base, scale=1.0).fit(seen)
    >>> axes = plotting.motion_groups({"all": [fit]}, n_frames=5)
    >>> [ax.get_ylabel() for ax in axes]
    ['eigenweight', 'marker error, mm', 'scaling factor', 'rotation, turns']
    """
    if axes is None:
        axes = list(plt.figure(figsize=(9.0, 6.4), layout="constrained").subplots(2, 2, sharex=True).flat)
    frames = np.arange(1, n_frames + 1)
    for letter, ax, panel in zip("abcd", axes, _LABELS, strict=True):
        unit = 1e3 if panel == "marker_error" else 1.0
        options: dict[str, Any] = {"n_frames": n_frames, "weight": weight}
        bands = motion.GroupComparison(dict(groups), panel, **options).bands()  # type: ignore[arg-type]
        for k, (name, band) in enumerate(bands.items()):
            colour = _GROUPS[k % len(_GROUPS)]
            mean, deviation = unit * band.mean, unit * band.deviation
            ax.fill_between(frames, mean - deviation, mean + deviation, color=colour, alpha=0.22, lw=0)
            ax.plot(frames, mean, color=colour, lw=2.2, label=f"{name} ({len(groups[name])})")
        for name, fit in (single or {}).items():
            if panel in ("eigenweight", "rotation"):
                drawn = motion.GroupComparison({name: [fit]}, panel, **options)  # type: ignore[arg-type]
                ax.plot(frames, drawn.series(name)[0], color=_SINGLE, lw=1.3, label=name)
        ax.set_title(f"({letter})", loc="left", fontsize=11)
        ax.set_ylabel(_LABELS[panel])
        ax.grid(color="0.92")
        ax.margins(x=0)
    for ax in axes[2:]:
        ax.set_xlabel("frame")
    axes[0].legend(frameon=False, fontsize=11)
    return axes
