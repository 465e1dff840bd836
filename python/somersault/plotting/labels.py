"""Labels of lines, written at their ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["label_ends"]

#: Height of a line of text, in sizes of its type.
_LINE = 1.25


def label_ends(ax: Axes) -> None:
    """Writes the labels of lines at their right ends in their colours, where a legend would be read twice.

    Labels that would overlap move apart. Lines without a label of their own have none.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes whose lines are drawn.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from somersault import plotting
    >>> ax = plt.figure(layout="constrained").add_subplot()
    >>> _ = ax.plot([0, 1], [0, 2], label="fast"), ax.plot([0, 1], [0, 1], label="slow")
    >>> plotting.label_ends(ax)
    >>> [text.get_text() for text in ax.texts]
    ['slow', 'fast']
    """
    # Limits that follow from the lines are known once they have been requested.
    ax.get_ylim()
    to_fraction = ax.transScale + ax.transLimits
    ends = []
    for line in ax.get_lines():
        label, points = str(line.get_label()), np.asarray(line.get_xydata(), dtype=float)
        points = points[np.isfinite(points).all(axis=1)]
        if not label.startswith("_") and len(points) > 0:
            ends.append((float(to_fraction.transform(points[-1])[1]), label, line.get_color()))
    if not ends:
        return
    ends.sort(key=lambda end: end[0])
    text = ax.xaxis.label.get_fontproperties().get_size_in_points()
    figure = ax.get_figure(root=True)
    assert figure is not None
    panel = 72.0 * figure.get_figheight() * ax.get_position().height
    heights = np.array([_LINE * text * (1 + label.count("\n")) / panel for _, label, _ in ends])
    apart = 0.5 * (heights[1:] + heights[:-1])
    places = np.clip([place for place, _, _ in ends], 0.0, 1.0)
    for k, gap in enumerate(apart):
        places[k + 1] = max(places[k + 1], places[k] + gap)
    places[-1] = min(places[-1], max(1.0, float(np.sum(apart))))
    for k in range(len(apart) - 1, -1, -1):
        places[k] = min(places[k], places[k + 1] - apart[k])
    for place, (_, label, colour) in zip(places, ends, strict=True):
        ax.text(1.015, place, label, color=colour, va="center", transform=ax.transAxes)
