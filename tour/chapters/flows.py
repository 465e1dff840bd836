"""Flows of other fields: an attractor, a double gyre with its ridges, and growth like a power of time."""

from __future__ import annotations

from typing import Any

import numpy as np

from somersault import ftla, plotting
from tour.measurements import Measurements
from tour.page import Page, number, words

TITLE = "Any flow"

#: Sprott, Chaos and Time-Series Analysis (2003).
_PUBLISHED = {"Lorenz": (0.9056, 0.0, -14.5723), "Rössler": (0.0714, 0.0, -5.3943)}


def _lorenz(x: Any) -> Any:
    return 10.0 * (x.y - x.x), x.x * (28.0 - x.z) - x.y, x.x * x.y - 8 / 3 * x.z


def _roessler(x: Any) -> Any:
    return -x.y - x.z, x.x + 0.2 * x.y, 0.2 + x.z * (x.x - 5.7)


def _gyre(x: Any, t: Any) -> Any:
    """Shadden, Lekien and Marsden, Physica D 212 (2005), with A = 0.1, ω = 2π/10, ε = 0.25."""
    a = 0.25 * np.sin(0.2 * np.pi * t)
    f, slope = a * x.x**2 + (1 - 2 * a) * x.x, 2 * a * x.x + 1 - 2 * a
    u = -0.1 * np.pi * np.sin(np.pi * f) * np.cos(np.pi * x.y)
    return u, 0.1 * np.pi * np.cos(np.pi * f) * np.sin(np.pi * x.y) * slope


def _flow(field: Any, states: tuple[str, ...]) -> ftla.VariationalFlow:
    return ftla.VariationalFlow(ftla.vector_field(field, states), rtol=1e-8)


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    duration = 10.0 * measurements.setting.bodies**0.5 * 5.0
    start = [1.0, 1.0, 1.0]
    found = {
        name: ftla.lyapunov_spectrum(_flow(field, ("x", "y", "z")), start, duration)
        for name, field in (("Lorenz", _lorenz), ("Rössler", _roessler))
    }
    shear = ftla.lyapunov_spectrum(_flow(lambda x: (x.y, 0.0), ("x", "y")), [0.0, 1.0], 500.0)
    page.lead(
        "The analysis of the arm serves any field, written in NumPy and traced. The exponents of"
        f" Lorenz' attractor are {', '.join(number(mu, 3) for mu in found['Lorenz'].exponents)} 1/s; the"
        f" stretch of a shear is like T<sup>{number(shear.powers[0], 2)}</sup> and is not called a rate."
    )
    page.section("Exponents over a long time")
    page.table(
        (words("field"), "exponents, 1/s", "errors, 1/s", "published", "Kaplan–Yorke", words("status")),
        [
            [
                words(name),
                ", ".join(number(mu, 4) for mu in each.exponents),
                ", ".join(number(error, 4) for error in each.errors),
                ", ".join(number(mu, 4) for mu in _PUBLISHED[name]),
                number(each.kaplan_yorke_dimension, 3),
                words(each.status.replace("_", " ")),
            ]
            for name, each in found.items()
        ],
        f"Over {duration:.0f} s, a tenth of which is left out. Published by Sprott (2003).",
    )
    page.figure(
        "flow-exponents",
        plotting.exponent_history(found["Rössler"]),
        "Exponents of Rössler's attractor over time, with bands of their estimated errors.",
        "Three curves that settle: one above zero, one at zero, one far below",
    )
    page.section("The ridges of a field")
    n = 10 if measurements.setting.repeats == 1 else 25
    x, y = np.meshgrid(np.linspace(0, 2, 8 * n + 1), np.linspace(0, 1, 4 * n + 1))
    field = ftla.ftle_field(
        _flow(_gyre, ("x", "y")), np.stack([x, y], axis=-1), 15.0, domain=[(0, 2), (0, 1)]
    )
    ridges = field.ridges(min_height=0.2, min_length=0.3)
    page.figure(
        "gyre",
        plotting.exponent_map(field, ridges),
        "Finite-time exponents of a double gyre over 15 s, from"
        f" {field.exponents.size} initial points, and the ridges that separate them.",
        "A grey map with bright curved bands, and red lines along them",
    )
    page.text(
        f"The longest ridge has a length of {number(ridges[0].length, 2)}. Motions on its two sides part;"
        " particles cross it only slowly."
    )
    page.section("Growth like a power of time")
    page.text(f"A shear, ẋ = y and ẏ = 0, over 500 s: {shear.message}.")
