"""The spinning top of thesis 7.3.2: its runs with and without events located, and their errors."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

import somersault
from somersault import contact
from tour.runs import Runs

Array = NDArray[np.float64]

#: What errors are taken of.
QUANTITIES = ("position", "orientation", "velocity", "angular_velocity")


class Top:
    """The top from its start to some time."""

    def __init__(self, end: float) -> None:
        self.scene: contact.ContactSystem = contact.spinning_top()
        self.end = end

    def run(self, method: str, dt: float, located: bool, every: int = 10**9) -> somersault.Solution:
        """One run, of which only the end is kept unless more is requested."""
        scene = self.scene
        return somersault.integrate(
            scene.body,
            scene.state,
            (0.0, self.end),
            dt=dt,
            method=method,
            forces=scene.forces,
            contacts=scene.contacts,
            locate=located,
            max_substeps=None,
            every=every,
        )

    def runs(
        self, method: str, steps: Array, located: bool, reference: somersault.State, repeats: int
    ) -> Runs:
        """Runs with these steps; short ones are repeated, and the shortest time counts."""
        seconds, errors = np.full(len(steps), np.nan), np.full((len(QUANTITIES), len(steps)), np.nan)
        for i, dt in enumerate(steps):
            times = []
            for _ in range(repeats if self.end / dt < 3e4 else 1):
                began = time.perf_counter()
                try:
                    end = self.run(method, float(dt), located)[-1]
                except somersault.errors.IntegrationError:
                    break
                times.append(time.perf_counter() - began)
            else:
                seconds[i] = min(times)
                errors[:, i] = list(distance(end, reference).values())
        return Runs(seconds, dict(zip(QUANTITIES, errors, strict=True)))


def distance(state: somersault.State, reference: somersault.State) -> dict[str, float]:
    """The errors of a state."""
    return {
        "position": float(np.linalg.norm(state.position - reference.position)),
        "orientation": float((state.orientation.inv() * reference.orientation).magnitude()),
        "velocity": float(np.linalg.norm(state.velocity - reference.velocity)),
        "angular_velocity": float(np.linalg.norm(state.angular_velocity - reference.angular_velocity)),
    }


def order(steps: Array, errors: Array, floor: float, points: int | None = None) -> float | None:
    """The slope of log(error) over log(step), of the finest so many points above the floor.

    None where fewer than four are.
    """
    usable = np.flatnonzero(np.isfinite(errors) & (errors > floor))
    # Below the floor the error may rise again: what lies beyond the first such point does not count.
    sunk = np.flatnonzero(np.isfinite(errors) & (errors <= floor))
    if len(sunk) > 0:
        usable = usable[usable < sunk[0]]
    usable = usable[-points:] if points is not None else usable
    if len(usable) < 4:
        return None
    return float(np.polyfit(np.log(steps[usable]), np.log(errors[usable]), 1)[0])


def orders(
    steps: Array, runs: Runs, floors: Mapping[str, float], points: int | None
) -> dict[str, float | None]:
    """The order of each quantity."""
    return {name: order(steps, runs.errors[name], floors[name], points) for name in QUANTITIES}
