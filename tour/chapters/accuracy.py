"""Thesis 7.2.1: accuracy of freely rotating bodies, figures 7.1 and 7.2."""

from __future__ import annotations

import math

from somersault import plotting
from tour import thesis
from tour.measurements import Measurements
from tour.page import Page, power, words

TITLE = "Accuracy and computation time"

TARGETS = (1e-2, 1e-4, 1e-6)

_BODIES = {
    1: "a rod of 1:1:5",
    2: "a box of 1:2:5 about its middle axis, which twists twice",
    3: "a plate of 5:5:1",
}


def milliseconds(seconds: float) -> str:
    """A computation time, or a dash where none was enough."""
    return f"{seconds * 1e3:.3g}" if seconds < math.inf else "–"


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    quickest = {
        case: min((runs[name].seconds_to(1e-6), name) for name in thesis.METHODS)[1]
        for case, runs in measurements.accuracy.items()
    }
    page.lead(
        "Of the thesis' methods the quickest to an orientation within 10⁻⁶ rad after 10 s: "
        + ", ".join(f"{plotting.abbreviation(name)} in case {case}" for case, name in quickest.items())
        + "."
    )
    finest = 10**measurements.setting.finest
    page.text(
        "Three boxes of 1 kg and 1 m³ rotate freely for 10 s: "
        + "; ".join(f"case {case}, {what}" for case, what in _BODIES.items())
        + f". Steps from 0.1 s down to {power(finest)} s, three in a decade. The error is against the exact"
        " solution, and angles are taken by arctangents, so that no points are missing as in the thesis'"
        " figures. The thesis goes to 10⁻⁶ s; the last decade would take ten times as long as all others"
        " and shows rounding only.",
    )
    for number, error, what in (
        (1, "orientation", "orientation"),
        (2, "angular_velocity", "angular velocity"),
    ):
        page.section(f"Figure 7.{number}: error of the {what}")
        for case, runs in measurements.accuracy.items():
            ax = plotting.work_precision_diagram({name: runs[name] for name in thesis.METHODS}, error)
            page.figure(
                f"{error.replace('_', '-')}-case-{case}",
                ax,
                f"Case {case}: {_BODIES[case]}. {_seen(measurements, case) if number == 1 else ''}",
                f"Error of the {what} against computation time for the thirteen methods, falling to the"
                " right",
            )
    page.text(
        "The caption of the thesis' Figure 7.2 says orientation; what it discusses, and what is drawn here,"
        " is the angular velocity. The thesis timed its own implementation on its own machine: the times"
        " differ, the order of the curves can be compared."
    )
    page.section("Time to an accuracy")
    header = [words("method")]
    header += [words(f"case {case}, {power(target)} rad") for case in thesis.CASES for target in TARGETS]
    page.table(
        header,
        [
            [
                words(plotting.abbreviation(name)),
                *(
                    milliseconds(runs[name].seconds_to(target))
                    for runs in measurements.accuracy.values()
                    for target in TARGETS
                ),
            ]
            for name in thesis.METHODS
        ],
        "Milliseconds for 10 s of motion by the quickest of the runs above that is at least so accurate; a"
        " dash where none is.",
    )


def _seen(measurements: Measurements, case: int) -> str:
    """What the thesis says of the case, and what the runs say."""
    runs = measurements.accuracy[case]
    if case == 2:
        said = ("rk4", "ab4", "siabm4", "dmv2")
        rest = ("sv", "mp", "heun", "ab2", "siabm2", "aso")
        target = 1e-3
        times = {name: runs[name].seconds_to(target) for name in (*said, *rest)}
        slowest, best = max(times[name] for name in said), min(times[name] for name in rest)
        agrees = "so it is here" if slowest < best else "here it is so only in part"
        order = sorted(times, key=lambda name: times[name])
        return (
            "The thesis: RK4, AB4, SIABM4 and DMV2 do exceptionally well among the methods of second order,"
            f" Euler particularly badly; {agrees}: to {power(target)} rad the quickest are, in turn,"
            f" {', '.join(plotting.abbreviation(name) for name in order[:4])}. The end is almost a full"
            " period, where errors cancel: do not read orders from this case."
        )
    first = min(runs[name].seconds_to(1e-2) for name in ("euler", "sie"))
    second = [runs[n].seconds_to(1e-2) for n in thesis.METHODS if thesis.ROTATION_ORDERS[n] == 2]
    fourth = runs["rkmk"].seconds_to(1e-6)
    second_fine = min(runs[n].seconds_to(1e-6) for n in thesis.METHODS if thesis.ROTATION_ORDERS[n] == 2)
    return (
        "The thesis: RKMK clearly before the methods of order 2, those before Euler and semi-implicit Euler."
        f" Here to 10⁻² rad the methods of order 2 take {milliseconds(min(second))} to"
        f" {milliseconds(max(second))} ms, and "
        + (
            f"the better of those of order 1 {milliseconds(first)} ms; "
            if first < math.inf
            else "those of order 1 do not get there; "
        )
        + f"to 10⁻⁶ rad RKMK takes {milliseconds(fourth)} ms and the best of order 2 "
        f"{milliseconds(second_fine)} ms."
    )
