from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from somersault._somersault import (
    batch,
    contact,
    exact,
    expr,
    forces,
    ftla,
    integrators,
    motion,
    multibody,
    nlp,
    ocp,
    studies,
)

__all__ = [
    "__version__",
    "batch",
    "contact",
    "exact",
    "expr",
    "forces",
    "ftla",
    "integrators",
    "motion",
    "multibody",
    "nlp",
    "ocp",
    "studies",
]

__version__: str

_Floats: TypeAlias = NDArray[np.float64]
_Active: TypeAlias = Sequence[str] | Sequence[bool] | NDArray[np.bool_]
_NumberOrRange: TypeAlias = float | tuple[float, float]
