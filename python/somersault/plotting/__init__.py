"""Figures of motions and studies, with matplotlib (`pip install somersault[plot]`).

Each function draws into the axes given, or into new ones, and returns them, so that a figure can be
composed and finished as any other of matplotlib's. A method looks the same in every figure: its colour,
marker and line follow from its place in the method table. The colours are Paul Tol's *muted* scheme,
which stays distinct for colour-blind readers; markers and dashes tell methods apart without colour.
"""

from importlib.util import find_spec

if find_spec("matplotlib") is None:
    raise ImportError("somersault.plotting needs matplotlib: pip install 'somersault[plot]'")

from somersault.plotting.bodies import body_motion, gaps, polhode, tree_configuration, tree_motion
from somersault.plotting.labels import label_ends
from somersault.plotting.lyapunov import (
    compare_motions,
    exponent_history,
    exponent_map,
    exponents,
    projections,
    subspace_angles,
)
from somersault.plotting.methods import (
    abbreviation,
    energy_ratios,
    observed_orders,
    stability_regions,
    style,
    work_precision_diagram,
)
from somersault.plotting.optimal_control import control_history
from somersault.plotting.recordings import channels, motion_groups

__all__ = [
    "abbreviation",
    "body_motion",
    "channels",
    "compare_motions",
    "control_history",
    "energy_ratios",
    "exponent_history",
    "exponent_map",
    "exponents",
    "gaps",
    "label_ends",
    "motion_groups",
    "observed_orders",
    "polhode",
    "projections",
    "stability_regions",
    "style",
    "subspace_angles",
    "tree_configuration",
    "tree_motion",
    "work_precision_diagram",
]
