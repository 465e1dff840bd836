"""Studies of stability and accuracy, for the methods of the table.

Stability regions of the translation, rotational energy of free bodies at large steps, observed orders,
and errors against work.
"""

from somersault._somersault.studies import (
    Convergence,
    EnergyStudy,
    Problem,
    StabilityRegion,
    WorkPrecision,
    convergence,
    energy,
    prisms,
    spectral_radii,
    stability_region,
    work_precision,
)

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
