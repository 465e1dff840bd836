"""What the chapters on part III share: the arm's extremals, each solved once."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from somersault import ftla, ocp
from tour import thesis

Array = NDArray[np.float64]

#: Names of the entries of p.
NAMES = ("θ₁", "θ₂", "θ̇₁", "θ̇₂", "λ₁", "λ₂", "λ₃", "λ₄")


@dataclass(frozen=True)
class Solved:
    """An extremal, with the seconds it took from nothing."""

    found: ftla.ContinuationResult
    seconds: float

    @property
    def extremal(self) -> ftla.Extremal:
        """The motion."""
        return self.found.extremal


@cache
def solved(fold: float = np.pi, turns: int = 0) -> Solved:
    """An extremal of the thesis' problem from its end states and a fold."""
    final = np.add(thesis.ARM_FINAL, (0.0, 2 * np.pi * turns, 0.0, 0.0))
    began = time.perf_counter()
    found = ftla.solve_arm(thesis.ARM_INITIAL, final, thesis.ARM_HORIZON, fold=fold)
    return Solved(found, time.perf_counter() - began)


@cache
def collocated() -> ocp.CollocationResult:
    """The thesis' motion by collocation, in the place of GPOPS."""
    return ocp.arm_motion(np.pi, tol=1e-7)


@cache
def flow() -> ftla.VariationalFlow:
    """The arm, tightly."""
    return ftla.VariationalFlow(ftla.arm())


def tip(q: Array) -> tuple[Array, Array]:
    """Where elbow and tip of the arm are, each of shape (m, 2)."""
    first, both = q[:, 0], q[:, 0] + q[:, 1]
    elbow = 2.0 * np.column_stack([np.cos(first), np.sin(first)])
    return elbow, elbow + 0.5 * np.column_stack([np.cos(both), np.sin(both)])
