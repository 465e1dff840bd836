"""Thesis 6.1: stability of the translation."""

from __future__ import annotations

from somersault import plotting
from tour import comparison
from tour.measurements import Measurements
from tour.page import Page, number, words

TITLE = "Stability of the translation"


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    areas = comparison.stability_areas(measurements)
    compared = [entry for pair in areas.values() for entry in pair]
    agreeing = sum(entry.agrees for entry in compared)
    page.lead(
        f"Table 6.1 of the thesis: {agreeing} of {len(compared)} printed areas reproduce to the last digit."
    )
    page.text(
        "The test equation is ÿ = 2λ<sub>R</sub> ẏ − (λ<sub>R</sub>² + λ<sub>I</sub>²) y, thesis (6.1), with"
        " the roots λ<sub>R</sub> ± iλ<sub>I</sub>. A method is stable where every solution of its recurrence"
        " with Δt = 1 stays bounded. The library finds the recurrence by running the method itself, not"
        " from a formula written beside it, and measures the area of the whole region, both half planes."
        " Divided by the square of the evaluations of a step it is the <em>corrected</em> area: the region"
        " in units of one evaluation.",
    )
    page.section("Table 6.1")
    page.table(
        (
            words("method"),
            "area, printed",
            "area, computed",
            "corrected, printed",
            "corrected, computed",
            "stable on the real axis to",
            "on the imaginary axis to",
        ),
        [
            [
                words(plotting.abbreviation(name)),
                number(area.printed),
                area.cell(),
                number(corrected.printed),
                corrected.cell(),
                number(-measurements.regions[name].real_limit),
                number(measurements.regions[name].imaginary_limit),
            ]
            for name, (area, corrected) in areas.items()
        ],
        "Printed: thesis Table 6.1. Green agrees to the last digit printed. The velocity of Störmer–Verlet "
        "(algorithm 7) adds a root z = 1, which neither the table nor the library counts as unstable.",
    )
    page.section("Figure 6.1")
    ax = plotting.stability_regions(measurements.regions)
    named = {name: measurements.regions[name] for name in areas}
    largest = max(named, key=lambda name: named[name].area)
    corrected = max(named, key=lambda name: named[name].corrected)
    imaginary = [
        plotting.abbreviation(name) for name, region in named.items() if region.imaginary_limit > 0.01
    ]
    page.figure(
        "stability-regions",
        ax,
        "Boundaries of the stability regions, with their areas. Of the methods of Table 6.1"
        f" {plotting.abbreviation(largest)} has the largest region, and per evaluation"
        f" {plotting.abbreviation(corrected)}; stable on a stretch of the imaginary axis, and so fit for"
        f" springs without damping: {', '.join(imaginary)}. The thesis says the same of all three.",
        "Closed curves around the stable values of lambda, the largest that of classic Runge-Kutta of"
        " order 4",
    )
