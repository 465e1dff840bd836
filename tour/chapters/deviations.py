"""Where the thesis was read in one way of several, or is not reproduced."""

from __future__ import annotations

from somersault import plotting
from tour import comparison
from tour.measurements import Measurements
from tour.page import Page, number, words

TITLE = "Deviations from the thesis"

_READINGS = (
    ("4.1", "a PCA of each dive", "one basis for all dives; the other under a name of its own"),
    ("Figure 4.1 (d)", "scaling factor", "rotation, in turns"),
    ("(5.12)", "f(t, y)", "f(t, y, ẏ), as in (5.10)"),
    ("(5.14)", "exponent ω_n", "ω̄_n of (5.16)"),
    ("(5.18)", "R₊ = Ω R", "R₊ = R Ωᵀ, with R from body to world"),
    ("(5.21)", "d₁ + d₂ = I₁₁, …", "d₁ + d₂ = I₃₃, d₂ + d₃ = I₁₁, d₁ + d₃ = I₂₂"),
    ("Table 6.1", "area", "of both half planes; corrected = area / evaluations²"),
    ("(6.2)", "inertia", "it is the inverse inertia of the prism"),
    ("Table 6.2", "start-up not given", "by the same family with as many steps as there are"),
    ("(6.4)", "I_B33", "the smallest principal moment"),
    ("Table 6.3", "midpoint unconditionally stable", "its energy grows, in the thesis' Table 6.2 too"),
    ("(7.3), (7.5), (7.7)", "rounded moments", "from the edges, to full precision"),
    ("Figure 7.1", "points missing", "none: angles are taken by arctangents"),
    ("Figure 7.2", "caption: orientation", "angular velocity"),
    ("Table A.1", "number of parameters p", "free ones, after r(0) and ṙ(0) are imposed: n_par = p + 2"),
    ("8.4", "one optimal motion", "that which folds to θ₂ > 0; there are others, and a cheaper one"),
    ("7.3", "all methods of order 1 with contact", "so they are, unless the events are located"),
)


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    found = list(comparison.differences(measurements))
    page.lead(
        f"{len(_READINGS)} places where these pages read the thesis otherwise than it is printed, and"
        f" {len(found)} printed numbers of tables 6.1 and 6.2 that do not come out."
    )
    page.section("Readings that matter here")
    page.table(
        (words("where"), words("as printed"), words("here")),
        [[words(entry) for entry in reading] for reading in _READINGS],
        "The whole list, with the test that shows each, is in <code>DEVIATIONS.md</code> of the source.",
    )
    page.section("Numbers that do not come out")
    page.table(
        (words("method"), words("entry"), "printed", "computed"),
        [
            [
                words(plotting.abbreviation(entry.method)),
                words(entry.place),
                number(entry.printed),
                number(entry.computed),
            ]
            for entry in found
        ],
        "The reasons, where known, are with the tables.",
    )
