"""Finite-time Lyapunov analysis of flows and of hyper-sensitive optimal control.

A `vector_field` in ordinary NumPy is followed by a `VariationalFlow` as any other system: `lyapunov_spectrum`
has exponents over long times, `ftle_field` those of many initial points with the ridges between them, and
`exponent_convergence` says whether finite-time exponents have settled.

The necessary conditions of an optimal control problem are a boundary value problem in states and costates,
p = (x, λ). Where it has rates that are fast against the horizon, shooting fails; the same rates split the
tangent space, and an optimum starts near the centre-stable manifold and ends near the centre-unstable one.

In the order of work: a `System` poses; a `VariationalFlow` integrates it with its transition matrix and gives
a `Spectrum` of exponents and vectors; `diagnose` says whether the problem is hyper-sensitive, `Splitting`
holds the subspaces; a `Placement` puts points on the slow manifolds, a `Matching` joins two ends, and `shoot`
polishes to rounding. `system_of` takes an `ocp.ControlProblem`, and `cold_start` then starts from its
collocation solution; for other systems it starts from boundary states alone, as `continue_through` does.
`follow` changes a parameter; for the arm, `solve_arm` needs the fold only and `arm_extremals` ranks several.

>>> import numpy as np
>>> from somersault import ftla
>>> found = ftla.solve_arm([-np.pi / 2, 0.05, 0.0, 0.0], [np.pi / 2, 0.05, 0.0, 0.0], 10.0, fold=np.pi)
>>> found.success, round(found.extremal.cost(), 9)
(True, 0.321777232)
>>> flow = ftla.VariationalFlow(found.extremal.system)
>>> spectra = flow.spectra(found.extremal(5.0), np.arange(0.5, 5.1, 0.5))
>>> ftla.diagnose(spectra, 10.0).dims
(2, 4, 2)
"""

from somersault._arm_extremals import ArmExtremal, arm_extremals, solve_arm
from somersault._flows import (
    ExponentConvergence,
    FtleField,
    LyapunovSpectrum,
    Ridge,
    exponent_convergence,
    ftle_field,
    lyapunov_spectrum,
    vector_field,
)
from somersault._posed_system import system_of
from somersault._somersault.ftla import (
    Chain,
    ContinuationResult,
    Diagnosis,
    Extremal,
    Following,
    Matching,
    MatchingResult,
    Placement,
    PlacementResult,
    Spectrum,
    Splitting,
    Subspace,
    System,
    Transition,
    VariationalFlow,
    arm,
    cold_start,
    continue_through,
    cubic_regulator,
    diagnose,
    follow,
    graded_times,
    linear_regulator,
    rank_held_costates,
    shoot,
    slow_subspace,
    state_costate,
    tree,
)

__all__ = [
    "ArmExtremal",
    "Chain",
    "ContinuationResult",
    "Diagnosis",
    "ExponentConvergence",
    "Extremal",
    "Following",
    "FtleField",
    "LyapunovSpectrum",
    "Matching",
    "MatchingResult",
    "Placement",
    "PlacementResult",
    "Ridge",
    "Spectrum",
    "Splitting",
    "Subspace",
    "System",
    "Transition",
    "VariationalFlow",
    "arm",
    "arm_extremals",
    "cold_start",
    "continue_through",
    "cubic_regulator",
    "diagnose",
    "exponent_convergence",
    "follow",
    "ftle_field",
    "graded_times",
    "linear_regulator",
    "lyapunov_spectrum",
    "rank_held_costates",
    "shoot",
    "slow_subspace",
    "solve_arm",
    "state_costate",
    "system_of",
    "tree",
    "vector_field",
]
