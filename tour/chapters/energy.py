"""Thesis 6.2: stability of the rotation."""

from __future__ import annotations

from itertools import chain

from somersault import plotting
from tour import comparison, thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, number, words

TITLE = "Stability of the rotation"


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    studies = measurements.energy
    rows = comparison.energy_ratios(measurements)
    cells = list(chain.from_iterable((*largest, *smallest) for largest, smallest in rows.values()))
    agreeing = sum(cell.agrees for cell in cells)
    side = measurements.setting.inertias
    page.lead(
        f"Table 6.2 of the thesis: {agreeing} of {len(cells)} printed entries reproduce; those that do not"
        " are marked and explained."
    )
    page.text(
        f"{side * side:,} prisms of 1 × l<sub>y</sub> × l<sub>z</sub>, with l<sub>y</sub> and l<sub>z</sub>"
        f" from {1 / side:g} to 1, spin freely from ω₀ = (1, 1, 1)/√3 rad/s, in steps as large as 1 s. The"
        " exact motion keeps its energy; the table shows the largest and the smallest of T<sub>n</sub>/T₀"
        " over all prisms after n steps. World-frame angular velocity, as in the thesis' appendix E;"
        " multistep methods start by their own family with as many steps as there are.",
    )
    page.section("Table 6.2")
    page.table(
        (words("method"), words(""), *(f"n = {n}" for n in thesis.ENERGY_STEPS)),
        chain.from_iterable(
            (
                [words(plotting.abbreviation(name)), words("largest"), *(c.cell() for c in largest)],
                [words(""), words("smallest"), *(c.cell() for c in smallest)],
            )
            for name, (largest, smallest) in rows.items()
        ),
        "Computed, in green where it is the number printed in thesis Table 6.2, which is otherwise"
        " given in brackets. <em>Inf</em> is beyond the largest double, 1.8×10³⁰⁸.",
    )
    differing = list(dict.fromkeys(cell.method for cell in cells if not cell.agrees))
    if differing:
        page.text("Where the two differ:")
        page.items(
            f"<b>{plotting.abbreviation(name)}</b> "
            f"({_places([c for c in cells if c.method == name and not c.agrees])}): "
            + comparison.REASONS.get(name, "no reason is known.")
            for name in differing
        )
    page.figure(
        "energy-ratios",
        plotting.energy_ratios({name: studies[name] for name in thesis.METHODS}),
        "The same as bars from the smallest to the largest ratio, for growing numbers of steps; arrows point"
        " to what lies beyond. ASO, which the table leaves out, is shown too.",
        "Bars of energy ratios by method, most of them leaving the figure after ten steps",
    )
    page.section("Table 6.3")
    page.table(
        (words("method"), words("printed"), words("computed")),
        [
            [
                words(plotting.abbreviation(name)),
                words(verdict),
                Cell(studies[name].behaviour, agrees=studies[name].behaviour == verdict, is_text=True),
            ]
            for name, verdict in thesis.BEHAVIOUR.items()
        ],
        "The thesis gives no rule for its verdicts. The rule here: unconditionally stable where no prism ever"
        " gains energy; conditionally where some gain, and after the last step some have lost more than 5 %;"
        " unconditionally unstable otherwise. The midpoint method does gain energy, in the thesis' own table"
        " too (1.06 after 100 steps, and growing); the row of Störmer–Verlet does not reproduce.",
    )
    _bound(page, measurements)


def _places(cells: list[comparison.Comparison]) -> str:
    """The entries of a method, short."""
    sides = dict.fromkeys(cell.side for cell in cells)
    return "; ".join(
        f"{side} after {', '.join(str(cell.steps) for cell in cells if cell.side == side)}" for side in sides
    )


def _bound(page: Page, measurements: Measurements) -> None:
    """Thesis 6.2.1: methods that conserve the angular momentum, and the bound (6.4)."""
    page.section("Angular momentum, and the bound (6.4)")
    page.text(
        "A method that conserves the angular momentum cannot let the energy above ‖L‖²/(2 I<sub>min</sub>),"
        " thesis (6.4), with the smallest principal moment. That bounds the motion at any step; it does not"
        " make it right. The damped semi-implicit Euler method <code>sieg</code>, which takes the gyroscopic"
        " term implicitly as physics engines do, loses energy instead.",
    )
    keeping = [info.name for info in measurements.methods if info.variables == "momentum"]
    shown = ["sie", "sieg", "sv", "aso", *keeping]
    page.table(
        (
            words("method"),
            "largest T/T₀, n = 10",
            "n = 100",
            "smallest T/T₀, n = 100",
            "largest T in units of (6.4)",
            words("verdict"),
        ),
        [
            [
                words(plotting.abbreviation(name)),
                number(float(study.max[thesis.ENERGY_STEPS.index(10)])),
                number(float(study.max[-1])),
                number(float(study.min[-1])),
                Cell(number(study.fraction_of_bound, 3), agrees=study.fraction_of_bound <= 1 + 1e-9),
                words(study.behaviour),
            ]
            for name, study in ((name, measurements.energy[name]) for name in shown)
        ],
        "Green: within the bound in every step of every prism. A multistep method is checked against the"
        " momentum that its start-up leaves. <code>sie</code> serves for comparison.",
    )
