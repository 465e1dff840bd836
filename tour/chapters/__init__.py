"""The chapters of the tour, in their parts and their order."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Protocol, cast

from tour.chapters.choice import summary
from tour.measurements import Measurements
from tour.page import Page

__all__ = ["ALONE", "MEASURED", "ORDER", "PARTS", "PICTURED", "Chapter", "Part", "load", "summary"]


@dataclass(frozen=True)
class Part:
    """Chapters that belong together, and what they tell."""

    title: str
    story: str
    slugs: tuple[str, ...]


#: Names of the modules, which are the names of the pages too.
PARTS = (
    Part(
        "A body that flips",
        "A free body that spins about its middle axis turns over, repeatedly. The motion is known in"
        " closed form, so every method can be measured against it: the one that most physics engines use is"
        " wrong after seconds, others are right to the last digits.",
        ("exact", "box", "accuracy", "beyond", "batch"),
    ),
    Part(
        "A body in orbit",
        "A satellite is turned by a wheel inside it, held by a rotor, and pulled upright by the Earth. Where"
        " nothing outside acts, the total angular momentum is constant to rounding.",
        ("satellite",),
    ),
    Part(
        "A body that touches",
        "A spinning top meets the ground many times a second. Where a step straddles a touch-down, every"
        " method is of order 1; where the touch-down is located, each keeps its order. So it is for trees of"
        " bodies: a leg hops.",
        ("contact", "trees_in_contact"),
    ),
    Part(
        "Bodies with joints",
        "A diver in the air has no ground to push against, and still can start a twist: only the angular"
        " momentum is fixed, not the orientation. Postures are combined to dives, and dives are optimised.",
        ("divers", "eigenpostures", "dives"),
    ),
    Part(
        "Motions of people",
        "The same diver is fitted to markers. What the markers do not determine is reported, and a scoring"
        " model is measured by its predictions of motions that it has not seen.",
        ("motions", "recordings", "scores"),
    ),
    Part(
        "Optimal motion",
        "Any equations, from a straight line to a certified extremal. A pendulum is swung up, and an arm"
        " travels with minimum effort: by shooting, by collocation, and, where errors grow too fast for"
        " both, from the slow manifolds of its extremals. The same analysis serves attractors and currents.",
        ("any_equations", "swing_up", "arm", "timescales", "matching", "extremals", "flows"),
    ),
    Part(
        "The thesis' tables",
        "Stability and order of every method as the thesis tabulates them, recomputed, and what does not"
        " reproduce.",
        ("methods", "stability", "energy", "orders", "deviations"),
    ),
)

ORDER = tuple(slug for part in PARTS for slug in part.slugs)

#: Chapters that show what all processors do together, and are written while nothing else runs.
ALONE = ("batch",)

#: Chapters that share measurements with each other and with the index.
MEASURED = tuple(slug for part in (PARTS[0], PARTS[-1]) for slug in part.slugs if slug not in ALONE)

#: Figures that stand at the top of the index, by their chapters.
PICTURED = {
    "exact": "polhode",
    "contact": "top-rendered",
    "dives": "dive-frames",
    "divers": "diver-planar",
    "swing_up": "swing-up-frames",
    "extremals": "extremals-paths",
}


class Chapter(Protocol):
    """What a module of a chapter has."""

    TITLE: str

    @staticmethod
    def write(page: Page, measurements: Measurements) -> None:
        """Writes the page."""
        ...


def load(slug: str) -> Chapter:
    """The chapter of that name."""
    return cast(Chapter, import_module(f"{__name__}.{slug}"))
