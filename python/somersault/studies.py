"""Studies of stability and accuracy, for the methods of the table.

Stability regions of the translation, rotational energy of free bodies at large steps, observed orders,
and errors against work.
"""

from somersault._somersault import (
    Convergence,
    EnergyStudy,
    Problem,
    StabilityRegion,
    WorkPrecision,
    convergence,
    prisms,
    spectral_radii,
    stability_region,
)
from somersault._somersault import energy_study as energy
from somersault._somersault import work_precision_study as work_precision

__all__ = [
    "Convergence",
    "EnergyStudy",
    "Problem",
    "StabilityRegion",
    "WorkPrecision",
    "convergence",
    "energy",
    "prisms",
    "spectral_radii",
    "stability_region",
    "work_precision",
]
