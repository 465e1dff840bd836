"""What is printed beside what is computed: whether the two agree, and why not where the reason is known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, number


@dataclass(frozen=True)
class Comparison:
    """A printed number and the one computed for it."""

    method: str
    side: str
    printed: float
    computed: float
    steps: int | None = None

    @property
    def place(self) -> str:
        """Where it stands in its table."""
        return self.side if self.steps is None else f"{self.side} after {self.steps} steps"

    @property
    def agrees(self) -> bool:
        """Whether the computed one is the printed one to its last digit.

        Two decimals are printed, of numbers from 1000 on after the first digit. Those are taken as equal
        within a whole unit of the last digit and not half a one: they are rounding errors amplified.
        """
        if math.isinf(self.printed) or math.isinf(self.computed):
            return self.printed == self.computed
        large = self.printed >= 1e3
        within = 0.01 * 10.0 ** math.floor(math.log10(self.printed)) if large else 0.005
        return abs(self.computed - self.printed) <= within * (1 + 1e-9)

    def cell(self) -> Cell:
        """The computed number, with the printed one where they differ."""
        if self.agrees:
            return Cell(number(self.computed), agrees=True)
        return Cell(f"{number(self.computed)} (printed {number(self.printed)})", agrees=False)


#: Why cells of Table 6.2 differ, by method.
REASONS = {
    "sv": (
        "The printed row does not follow from the thesis' algorithm 7, nor from any variant of it that was "
        "tried; the difference is in the source, and the row counts as not reproduced."
    ),
    "rkmk": (
        "The printed 1.00 for the largest ratio after one step contradicts the method: some of the bodies of"
        " the grid gain more in their first step, whatever the rounding."
    ),
    "ab4": (
        "After ten steps of an unstable method the largest energy is that of numbers which have amplified "
        "their rounding error; only its order of magnitude means anything."
    ),
}


def stability_areas(measurements: Measurements) -> dict[str, tuple[Comparison, Comparison]]:
    """Table 6.1: area and corrected area."""
    return {
        name: (
            Comparison(name, "area", area, measurements.regions[name].area),
            Comparison(name, "corrected", corrected, measurements.regions[name].corrected),
        )
        for name, (area, corrected) in thesis.STABILITY_AREAS.items()
    }


def energy_ratios(measurements: Measurements) -> dict[str, tuple[list[Comparison], list[Comparison]]]:
    """Table 6.2: the largest and the smallest ratios."""

    def row(name: str, side: str, printed: tuple[float, ...]) -> list[Comparison]:
        computed = getattr(measurements.energy[name], side)
        return [
            Comparison(name, "largest" if side == "max" else "smallest", p, float(c), n)
            for n, p, c in zip(thesis.ENERGY_STEPS, printed, computed, strict=True)
        ]

    return {
        name: (row(name, "max", largest), row(name, "min", smallest))
        for name, (largest, smallest) in thesis.ENERGY_RATIOS.items()
    }


def differences(measurements: Measurements) -> Iterator[Comparison]:
    """Every entry of tables 6.1 and 6.2 that does not agree."""
    for pair in stability_areas(measurements).values():
        yield from (c for c in pair if not c.agrees)
    for largest, smallest in energy_ratios(measurements).values():
        yield from (c for c in (*largest, *smallest) if not c.agrees)
