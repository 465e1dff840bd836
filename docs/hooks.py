"""What the book is made with beside its pages: formulas, tables of the methods, exit codes and schemas.

Formulas become MathML while the book is built (`formulas.py`).
"""

from __future__ import annotations

import json
import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
from formulas import mathml

import somersault
from somersault import studies
from somersault.cli.documents import schema

_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
# What the template of the reference puts before a description, where there is none.
_DASH = re.compile(r'\s*–\s*(?=<div class="doc-md-description">\s*</div>)')
_INSERT = re.compile(r"^<!-- insert: ([\w. ]+) -->$", re.MULTILINE)


def on_page_content(html: str, **_: Any) -> str:
    """Turns formulas into MathML, and takes out dashes that introduce nothing."""

    def formula(match: re.Match[str]) -> str:
        return mathml(match[3], "block" if match[2] == "[" else "inline")

    return _DASH.sub("\n", _FORMULA.sub(formula, html))


def on_post_page(output: str, **_: Any) -> str:
    """Leaves the link to the repository, and takes out that a script asks its host for figures."""
    return output.replace('data-md-component="source"', "")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Puts in what is computed: a line `<!-- insert: name -->` of its own."""
    return _INSERT.sub(lambda match: _inserts(match[1]), markdown)


def _inserts(what: str) -> str:
    if what == "methods":
        return _methods()
    if what == "guarantees":
        return _guarantees()
    if what.endswith(".md"):
        return _page(what)
    if what == "which method when":
        return _section("README.md", "Which method when")
    if what == "evaluations":
        return _evaluations()
    if what == "control problems":
        return _control_problems()
    if what.startswith("schema "):
        return (
            f"```json\n{json.dumps(schema(what.removeprefix('schema ')), indent=2, ensure_ascii=False)}\n```"
        )
    raise ValueError(f"nothing is called {what!r}")


def _page(name: str) -> str:
    """A page from the root of the repository, without its title, and with links as seen from here."""
    text = (Path(__file__).parents[1] / name).read_text("utf-8")
    return text.partition("\n")[2].replace("](docs/", "](")


def _section(name: str, title: str) -> str:
    """The table of a section of a page of the repository."""
    text = (Path(__file__).parents[1] / name).read_text("utf-8")
    section = text.partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    return "\n".join(line for line in section.splitlines() if line.startswith("|"))


_GENERAL = ("translation_with_velocity", "translation_with_orientation")


def _order(info: somersault.MethodInfo, benign: str, *general: str) -> str:
    """An order, in brackets that of the general case; after a semicolon those of the rates, where others."""

    def of(orders: dict[str, int | None]) -> str:
        first, others = orders[benign], [orders[name] for name in general]
        second = None if None in others else min(order for order in others if order is not None)
        return str(first) if first == second else f"{first} ({second if second is not None else 'none'})"

    configuration, rate = of(info.orders), of(info.rate_orders)
    return configuration if configuration == rate else f"{configuration}; {rate}"


def _steps(info: somersault.MethodInfo) -> str:
    """How the steps of a method are chosen."""
    adapted = "adapted" if info.embedded_order is not None else "doubled"
    return f"fixed or {adapted}" if info.adaptive else "fixed"


def _methods() -> str:
    """The table of methods."""
    lines = [
        "| Method | | Order on ℝ³ | on SO(3) | Dense | Evaluations | Previous steps | Steps | Accepts |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for info in somersault.methods():
        translation = _order(info, "translation", *_GENERAL)
        rotation = _order(info, "rotation", "rotation_with_torque")
        steps = _steps(info)
        solves = " and iterations" if info.implicit else ""
        lines.append(
            f"| `{info.name}` | {info.title} | {translation} | {rotation} | {info.dense_order}"
            f" | {info.evaluations}{solves} | {info.history} | {steps} | {info.scope} |"
        )
    return "\n".join(lines)


def _guarantees() -> str:
    """What methods conserve, and their limitations; those of which the same is true share a row."""
    groups: dict[tuple[str, str], list[str]] = {}
    for info in somersault.methods():
        groups.setdefault((info.conserves, info.limitations), []).append(f"`{info.name}`")
    rows = [f"| {', '.join(names)} | {' | '.join(said)} |" for said, names in groups.items()]
    return "\n".join(["| Methods | Conserved | Limitations |", "|---|---|---|", *rows])


def _evaluations() -> str:
    """The fewest evaluations with which methods come below an error, on case 2 of the thesis."""
    targets = (1e-2, 1e-4, 1e-6, 1e-8)
    steps = 10.0 ** np.arange(-1.0, -4.01, -1 / 3)
    problem = studies.Problem.case(2)
    rows = []
    for name in ("sie", "heun", "rk4", "ab4", "rkmk", "rkmk_b", "cf4_b", "rkmk5_b", "rkmk8_b"):
        runs = studies.work_precision(problem, name, steps, repeats=1)
        enough = [runs.evaluations[runs.errors["orientation"] < target] for target in targets]
        cells = " | ".join(f"{min(counts):,}" if len(counts) else "–" for counts in enough)
        rows.append(f"| `{name}` | {cells} |")
    head = "| Method | 10⁻² rad | 10⁻⁴ rad | 10⁻⁶ rad | 10⁻⁸ rad |\n|---|--:|--:|--:|--:|"
    return "\n".join([head, *rows])


_SIGNS = {"lower": "−", "upper": "+", "interior": "i", "singular": "s"}


def _control_problems() -> str:
    """The problem set of the tests, solved, polished and certified, but for what takes long."""
    path = Path(__file__).parents[1] / "tests" / "python" / "control_problems.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    problems = module_from_spec(spec)
    spec.loader.exec_module(problems)
    rows = []
    for name, known in problems.KNOWN.items():
        start = "" if known.guess is None else "; from a guess"
        cells = [name, known.equations + start, f"{known.cost:.12g}", known.source]
        if known.is_long:
            rows.append(cells + ["`make studies`"] + [""] * 5)
            continue
        problem, found = known.solve()
        exact = problem.polish(found)
        # starts of minimum effort among them
        cells += [
            _size(found.cost - known.cost),
            f"{len(found.meshes)}, {sum(m['nit'] for m in found.meshes)}",
        ]
        if exact.success:
            cells += [_size(exact.cost - known.cost), _size(exact.residual), " ".join(map(_arc, exact.arcs))]
        else:
            cells += ["", "", ""]
        rows.append([*cells, f"`{exact.verdict}`"])
    head = ["Problem", "Equations and cost", "Cost", "Source", "Error of `solve`", "Meshes, steps"]
    head += ["Error of `polish`", "Residual", "Arcs", "Verdict"]
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _arc(arc: dict[str, Any]) -> str:
    """Signs of its controls, and a star where the state is at its bound."""
    return "".join(_SIGNS[kind] for kind in arc["controls"].values()) + "*" * (arc["bound"] is not None)


def _size(value: float) -> str:
    """The magnitude of an error."""
    return "0" if value == 0.0 else f"{abs(value):.0e}".replace("e-0", "e-")
