"""Runs of one method, their errors and times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from somersault import studies

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Runs:
    """Runs of one method over the same interval with different steps."""

    seconds: Array
    errors: dict[str, Array]

    @classmethod
    def of(cls, *parts: studies.WorkPrecision) -> Runs:
        """The runs of several studies, one after the other."""
        return cls(
            np.concatenate([part.seconds for part in parts]),
            {name: np.concatenate([part.errors[name] for part in parts]) for name in parts[0].errors},
        )

    def seconds_to(self, orientation_error: float) -> float:
        """Computation time of the quickest run that is at least so accurate; infinite if there is none."""
        accurate = self.errors["orientation"] <= orientation_error
        return float(np.min(self.seconds[accurate], initial=np.inf))
