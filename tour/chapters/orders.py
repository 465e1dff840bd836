"""Thesis 7.1 and 7.2: orders of accuracy."""

from __future__ import annotations

from dataclasses import asdict

from somersault import plotting
from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, words

TITLE = "Orders of accuracy"


def _slope(observed: float | None, stated: int | None) -> Cell:
    if observed is None:
        return Cell("–")
    return Cell(f"{observed:.2f}", agrees=None if stated is None else abs(observed - stated) < 0.35)


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    observed = measurements.observed
    slopes = [
        (slope, order)
        for info in measurements.methods
        for kind, slope in asdict(observed[info.name]).items()
        if (order := info.orders[kind]) is not None
    ]
    found = [(slope, order) for slope, order in slopes if slope is not None]
    agreeing = sum(abs(slope - order) < 0.35 for slope, order in found)
    page.lead(
        f"{agreeing} of {len(found)} observed slopes are within 0.35 of the order that the method table"
        " states. Classic Runge–Kutta and the four-step methods, of order 4 on ℝ³, fall to order 2 on SO(3)."
    )
    page.text(
        "Each method runs a problem with a known end with steps that halve, and the slope of log error over"
        " log step is fitted above the level of rounding. The problems: a mass on a nonlinear spring, r̈ ="
        " f(r); the same with damping and drag, r̈ = f(r, ṙ); a free asymmetric body; and the same body"
        " under a torque that turns with it and a drag of its rotation.",
    )
    page.section("Tables 7.1 and 7.2")

    def row(name: str) -> list[str | Cell]:
        entry = observed[name]
        translation, rotation = thesis.TRANSLATION_ORDERS.get(name), thesis.ROTATION_ORDERS.get(name)
        return [
            words(plotting.abbreviation(name)),
            str(translation or "–"),
            _slope(entry.translation, translation),
            _slope(entry.translation_with_velocity, None),
            str(rotation or "–"),
            _slope(entry.rotation, rotation),
            _slope(entry.rotation_with_torque, None),
        ]

    page.table(
        (
            words("method"),
            "translation, printed",
            "r̈ = f(r)",
            "r̈ = f(r, ṙ)",
            "rotation, printed",
            "free body",
            "under torque",
        ),
        [row(name) for name in thesis.METHODS],
        "Printed: thesis tables 7.1 and 7.2. Green: the slope observed is within 0.35 of the printed order."
        " The thesis notes that Störmer–Verlet's order 2 needs forces that do not depend on the velocity."
        " Discrete Moser–Veselov accepts no torque.",
    )
    page.section("Every method")

    def stated_row(name: str) -> list[str | Cell]:
        entry, stated = observed[name], orders[name]
        return [
            words(plotting.abbreviation(name)),
            *(_slope(slope, stated[kind]) for kind, slope in asdict(entry).items()),
        ]

    orders = {info.name: info.orders for info in measurements.methods}
    page.table(
        (words("method"), "r̈ = f(r)", "r̈ = f(r, ṙ)", "free body", "under torque"),
        [stated_row(info.name) for info in measurements.methods],
        "Slopes observed; green within 0.35 of the order in the method table. A dash where the method accepts"
        " no torque, or where its error is but rounding: a splitting is exact on a free body.",
    )
    rotation = {name: entry.rotation for name, entry in observed.items() if entry.rotation is not None}
    page.figure(
        "orders-rotation",
        plotting.observed_orders(rotation, {name: orders[name]["rotation"] or 0 for name in rotation}),
        "Orders of the orientation of a free body: bars are the orders stated, dots those observed.",
        "Dots of observed orders on the bars of stated orders, from one to ten",
    )
