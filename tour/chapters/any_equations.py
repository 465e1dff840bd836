"""Optimal control of any equations: solved by collocation, polished to rounding, certified."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from somersault import ocp, plotting
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, words

TITLE = "Optimal control of any equations"


@dataclass(frozen=True)
class Solved:
    """A problem with the cost that is published for it, and what was found."""

    name: str
    published: float
    found: ocp.CollocationResult
    exact: ocp.PolishResult

    @property
    def agrees(self) -> bool:
        """Whether the polished cost is the published one to the digits of that."""
        return abs(self.exact.cost - self.published) < 1e-11 * max(1.0, abs(self.published))


def _brachistochrone() -> ocp.ControlProblem:
    return ocp.ControlProblem(
        lambda x, u: [x.v * np.cos(u.angle), x.v * np.sin(u.angle), 9.81 * np.sin(u.angle)],
        states=("across", "down", "v"),
        controls=("angle",),
        initial={"across": 0, "down": 0, "v": 0},
        final={"across": 10, "down": 5},
        duration=(0.05, 20),
        end_cost=lambda x, t: t,
    )


def _goddard(fastest: float | None) -> ocp.ControlProblem:
    return ocp.ControlProblem(
        lambda x, u: [
            x.v,
            (3.5 * u.thrust - 310 * x.v**2 * np.exp(-500 * (x.r - 1))) / x.m - 1 / x.r**2,
            -7 * u.thrust,
        ],
        states=("r", "v", "m"),
        controls=("thrust",),
        initial=[1, 0, 1],
        final={"m": 0.6},
        duration=(0.05, 1),
        bounds={"thrust": (0, 1), "v": (None, fastest)},
        end_cost=lambda x: -x.r,
    )


def _pendulum() -> ocp.ControlProblem:
    return ocp.ControlProblem(
        lambda x, u: [x.spin, -9.81 / 0.5 * np.sin(x.angle) + u.torque / 0.5**2],
        states=("angle", "spin"),
        controls=("torque",),
        initial={"angle": 0, "spin": 0},
        final={"angle": np.pi, "spin": 0},
        duration=(0.5, 5),
        bounds={"torque": (-2, 2)},
        end_cost=lambda x, t: t,
    )


@cache
def solved() -> dict[str, Solved]:
    """The problems, from straight lines; costs are those of tests/python/control_problems.py."""
    posed = {
        "brachistochrone": ("brachistochrone", 1.80129548301372, _brachistochrone()),
        "goddard": ("Goddard's rocket", -1.01283691831748, _goddard(None)),
        "goddard-bound": ("Goddard's rocket, v ≤ 0.1", -1.01257632465693, _goddard(0.1)),
        "pendulum": ("pendulum in minimum time", 2.19680925047200, _pendulum()),
    }
    everything = {}
    for slug, (name, published, problem) in posed.items():
        found = problem.solve()
        everything[slug] = Solved(name, published, found, problem.polish(found))
    return everything


def _arcs(exact: ocp.PolishResult) -> str:
    """What each arc is."""

    def kind(arc: dict[str, object]) -> str:
        if arc["bound"] is not None:
            return f"{arc['bound']} at its bound"
        kinds = arc["controls"]
        assert isinstance(kinds, dict)
        return ", ".join(kinds.values())

    return " → ".join(kind(arc) for arc in exact.arcs)


def _row(each: Solved) -> list[str | Cell]:
    exact = each.exact
    return [
        words(each.name),
        f"{each.published:.14f}",
        f"{each.found.cost:.9f}",
        Cell(f"{exact.cost:.14f}", each.agrees),
        error_size(exact.residual),
        words(_arcs(exact)),
        words(exact.verdict.replace("_", " ")),
    ]


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    everything = solved()
    agreeing = sum(each.agrees for each in everything.values())
    page.lead(
        f"{agreeing} of {len(everything)} problems of the literature come out to the last digits that are"
        " known of their costs, from straight lines: collocation finds a motion, its costates show the arcs,"
        " shooting makes them exact, and a certificate says what the result is."
    )
    page.text(
        "A problem is posed in functions of NumPy, which are traced once and differentiated exactly. This is"
        " Goddard's rocket, which is to rise as high as it can:"
    )
    page.code(
        "rocket = ocp.ControlProblem(\n"
        "    lambda x, u: [\n"
        "        x.v,\n"
        "        (3.5 * u.thrust - 310 * x.v**2 * np.exp(-500 * (x.r - 1))) / x.m - 1 / x.r**2,\n"
        "        -7 * u.thrust,\n"
        "    ],\n"
        '    states=("r", "v", "m"), controls=("thrust",), initial=[1, 0, 1], final={"m": 0.6},\n'
        '    duration=(0.05, 1), bounds={"thrust": (0, 1)}, end_cost=lambda x: -x.r,\n'
        ")\n"
        "exact = rocket.polish(rocket.solve())\n"
        "plotting.control_history(exact)\n"
    )
    page.table(
        [
            words("problem"),
            "cost known",
            "by collocation",
            "polished",
            "residual",
            words("arcs"),
            words("verdict"),
        ],
        [_row(each) for each in everything.values()],
        "Costs known are those of a cycloid, and of arcs of known kinds whose durations were solved for with"
        " SciPy. <em>First order</em>: the conditions of first order hold, and no test of second order is"
        " known for arcs of this kind.",
    )
    page.section("The brachistochrone")
    page.figure(
        "any-brachistochrone",
        plotting.control_history(everything["brachistochrone"].exact)[0],
        "Ten metres across and five down in the shortest time. One arc: the angle is free everywhere, and its"
        " switching function ∂H/∂u is zero.",
        "States, angle, costates and switching function of the brachistochrone",
    )
    first = everything["goddard"].exact
    page.section("A singular arc")
    page.figure(
        "any-goddard",
        plotting.control_history(first)[0],
        "Full thrust, then a singular arc on which the switching function stays zero and the thrust follows"
        f" from its second derivative, from t = {first.junctions[0]:.6f} on, and none from"
        f" {first.junctions[1]:.6f} on.",
        "States, thrust, costates and switching function of Goddard's rocket with arcs shaded",
    )
    bound = everything["goddard-bound"].exact
    page.section("A bound of the state")
    page.figure(
        "any-goddard-bound",
        plotting.control_history(bound)[0],
        "No faster than 0.1: the thrust that holds the speed there is another arc, at whose start a costate"
        " jumps. It costs"
        f" {bound.cost - first.cost:.2e} of the height.",
        "The same with a bound of the speed: four arcs, one of them at the bound",
    )
    page.section("Bang–bang")
    page.figure(
        "any-pendulum",
        plotting.control_history(everything["pendulum"].exact)[0],
        "A pendulum that needs 4.9 N m to be held up swings upright with 2 N m, in four arcs. The conditions"
        " of Osmolovskii and Maurer in the switching times make it a strict minimum.",
        "Angle, torque, costates and switching function of the pendulum: three switches",
    )
