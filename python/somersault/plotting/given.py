"""The axes that a figure is drawn in: those given, or new ones."""

from __future__ import annotations

from typing import Literal

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

__all__ = ["given_axes"]


def given_axes(
    ax: Axes | None, size: tuple[float, float], layout: Literal["constrained", "compressed"] = "constrained"
) -> Axes:
    """The axes given, or those of a new figure of some size, inches."""
    if ax is None:
        return plt.figure(figsize=size, layout=layout).add_subplot()
    if not isinstance(ax, Axes):
        raise TypeError(f"`ax` must be Axes of matplotlib, found {type(ax).__name__}")
    return ax
