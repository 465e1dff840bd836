"""The chapters of the tour, in their order."""

from __future__ import annotations

from importlib import import_module
from typing import Protocol, cast

from tour.chapters.choice import summary
from tour.measurements import Measurements
from tour.page import Page

__all__ = ["ORDER", "Chapter", "load", "summary"]

#: Names of the modules, which are the names of the pages too.
ORDER = (
    "methods",
    "stability",
    "energy",
    "orders",
    "accuracy",
    "exact",
    "box",
    "batch",
    "beyond",
    "contact",
    "divers",
    "eigenpostures",
    "dives",
    "motions",
    "recordings",
    "scores",
    "swing_up",
    "arm",
    "timescales",
    "matching",
    "extremals",
    "deviations",
)


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
