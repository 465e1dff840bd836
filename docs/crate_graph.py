"""Draws the crates of the workspace and what they depend on: `python docs/crate_graph.py`."""

from __future__ import annotations

import json
import subprocess
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "docs" / "images" / "crates.svg"
_WIDTH, _HEIGHT, _ACROSS, _DOWN = 176, 34, 200, 84


def dependencies() -> dict[str, set[str]]:
    """The crates under `crates/`, each with those it depends on, without those that only tests need."""
    command = ["cargo", "metadata", "--no-deps", "--format-version=1", "--offline"]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    packages = {
        package["name"]: package
        for package in json.loads(found.stdout)["packages"]
        if Path(package["manifest_path"]).is_relative_to(ROOT / "crates")
    }
    return {
        name: {item["name"] for item in package["dependencies"] if item["kind"] is None} & packages.keys()
        for name, package in packages.items()
    }


def _reduced(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """Without arrows that a longer way implies."""
    below: dict[str, set[str]] = {}

    def all_below(name: str) -> set[str]:
        if name not in below:
            below[name] = graph[name].union(*(all_below(other) for other in graph[name]))
        return below[name]

    return {
        name: {
            other for other in others if not any(other in all_below(between) for between in others - {other})
        }
        for name, others in graph.items()
    }


def _rows(graph: dict[str, set[str]]) -> list[list[str]]:
    """The crates that the Python package consists of, each one row below the lowest that depends on it."""
    depth = {"somersault-py": 0}
    for _ in graph:
        for name in list(depth):
            for other in graph[name]:
                depth[other] = max(depth.get(other, 0), depth[name] + 1)
    rows = []
    for row in range(max(depth.values()) + 1):
        # Whoever has the longest arrows stands outermost, so that they pass by what is between.
        found: list[str] = []
        names = [name for name in sorted(depth) if depth[name] == row]
        for i, name in enumerate(
            sorted(names, key=lambda n: max((depth[m] - depth[n] for m in graph[n]), default=0))
        ):
            found.insert(len(found) if i % 2 == 0 else 0, name)
        rows.append(found)
    return rows


def svg() -> str:
    """The picture: dependents above what they depend on."""
    graph = _reduced(dependencies())
    rows = _rows(graph)
    width = max(len(row) for row in rows) * _ACROSS
    height = len(rows) * _DOWN
    place = {
        name: (width / 2 + (i - (len(row) - 1) / 2) * _ACROSS, _DOWN / 2 + depth * _DOWN)
        for depth, row in enumerate(rows)
        for i, name in enumerate(row)
    }
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}"'
        f' height="{height}" font-family="system-ui, sans-serif" font-size="13">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8"'
        ' orient="auto"><path d="M0 0 8 4 0 8z" fill="#7a8699"/></marker></defs>',
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
    ]
    for name in sorted(place):
        for other in sorted(graph[name]):
            (x0, y0), (x1, y1) = place[name], place[other]
            y0, y1 = y0 + _HEIGHT / 2, y1 - _HEIGHT / 2
            turn, bend = y1 - (_DOWN - _HEIGHT), (_DOWN - _HEIGHT) / 2
            curve = f"{x0:g} {turn + bend:g} {x1:g} {y1 - bend:g} {x1:g} {y1:g}"
            lines.append(
                f'<path d="M{x0:g} {y0:g}V{turn:g}C{curve}" fill="none"'
                ' stroke="#7a8699" marker-end="url(#tip)"/>'
            )
    for name, (x, y) in sorted(place.items()):
        lines.append(
            f'<rect x="{x - _WIDTH / 2:g}" y="{y - _HEIGHT / 2:g}" width="{_WIDTH}" height="{_HEIGHT}" rx="6"'
            ' fill="#eef1f8" stroke="#3f51b5"/>'
            f'<text x="{x:g}" y="{y + 4.5:g}" text-anchor="middle">{escape(name)}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    TARGET.parent.mkdir(exist_ok=True)
    TARGET.write_text(svg(), "utf-8")
    print(TARGET)
