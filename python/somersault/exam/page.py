"""The page of reports: tables, and a small figure of error against step for each scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from somersault.exam.catalogue import scene

__all__ = ["of"]

_WIDE, _HIGH, _EDGE = 150, 90, 8
#: Errors from here to 1 are drawn.
_LEAST = 1e-16
_COLOURS = {"position": "#3949ab", "orientation": "#c2410c"}
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; padding: 0 1rem; }
table { border-collapse: collapse; width: 100%; } th { text-align: left; }
td, th { border-bottom: 1px solid #8884; padding: .35rem .6rem; vertical-align: top; }
td.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
svg { background: #8881; } .s { white-space: nowrap; font-weight: 600; }
.agrees { color: #15803d; } .differs, .failed { color: #b91c1c; } .converges { color: #b45309; }
small { opacity: .75; } @media (prefers-color-scheme: dark) { body { background: #111; color: #ddd; } }
"""


def of(reports: Sequence[Mapping[str, Any]]) -> str:
    """A page of some reports, one after the other, each as its `to_dict` has it."""
    parts = []
    for report in reports:
        versions = ", ".join(f"{name} {version}" for name, version in report["versions"].items())
        head = "".join(
            f"<th>{title}</th>"
            for title in ("scene", "", "error by step", "order R³", "order SO(3)", "distance", "verdict")
        )
        rows = "".join(map(_row, report["results"]))
        parts.append(
            f"<h2>{escape(report['engine'])}</h2><p><small>{escape(versions)}</small></p>"
            f"<table><tr>{head}</tr>{rows}</table>"
        )
    legend = ", ".join(f'<span style="color:{colour}">{name}</span>' for name, colour in _COLOURS.items())
    about = (
        f"<p>Each figure has the error ({legend}) from 10<sup>−16</sup> to 1 against the step or tolerance,"
        " both on logarithmic scales. The distance from the answer is that at the last step.</p>"
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>An exam of engines</title>'
        f"<style>{_STYLE}</style><h1>An exam of engines</h1>{about}{''.join(parts)}</html>\n"
    )


def _row(result: Mapping[str, Any]) -> str:
    asked = scene(result["scene"])
    orders = (result["orders"].get(space) for space in ("R3", "SO3"))
    cells = "".join(f'<td class="n">{"" if order is None else f"{order:.1f}"}</td>' for order in orders)
    measures = {"R3": ("position", "m"), "SO3": ("orientation", "rad")}
    distance = "<br>".join(
        f"{result['distance'][name]:.1e} {unit}"
        for space, (name, unit) in measures.items()
        if result["distance"] and space in asked.spaces
    )
    state = escape(result["status"])
    return (
        f"<tr><td><b>{escape(asked.name)}</b><br><small>{escape(asked.title)}</small></td>"
        f'<td class="s {state.partition(" ")[0]}">{state}</td><td>{_figure(result)}</td>{cells}'
        f'<td class="n">{distance}</td><td>{escape(result["verdict"])}</td></tr>'
    )


def _figure(result: Mapping[str, Any]) -> str:
    """Error against step, both logarithmic, as inline SVG."""
    if not result["steps"]:
        return ""
    steps = [math.log10(step) for step in result["steps"]]
    low, high = min(steps), max(steps)

    def place(step: float, error: float) -> str:
        x = _EDGE + (step - low) / (high - low) * (_WIDE - 2 * _EDGE)
        fall = math.log10(min(max(error, _LEAST), 1.0)) / math.log10(_LEAST)
        return f"{x:.1f},{_EDGE + fall * (_HIGH - 2 * _EDGE):.1f}"

    lines = []
    for name, colour in _COLOURS.items():
        points = [place(step, error) for step, error in zip(steps, result["errors"][name], strict=True)]
        dots = "".join(
            f'<circle cx="{x}" cy="{y}" r="2" fill="{colour}"/>' for x, y in (p.split(",") for p in points)
        )
        lines.append(f'<polyline fill="none" stroke="{colour}" points="{" ".join(points)}"/>{dots}')
    label = f"error of {escape(result['scene'])} against step"
    return f'<svg role="img" aria-label="{label}" width="{_WIDE}" height="{_HIGH}">{"".join(lines)}</svg>'
