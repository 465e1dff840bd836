"""`somersault exam`: engines run through motions whose end is known."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from somersault.cli import tables


def exam(arguments: argparse.Namespace) -> int:
    """Examines each engine, prints a table of each, and writes the page."""
    from somersault import exam as examined
    from somersault.exam import page

    tables.check_page(arguments.out)
    if arguments.list:
        for scene in examined.scenes():
            print(f"{scene.name:<16}{scene.title}: {scene.asks}")
        return 0
    engines = [examined.engine(name) for name in arguments.engine or ["somersault"]]
    reports = []
    for engine in engines:
        reports.append(
            examined.audit(engine, arguments.scene or None, gradients=arguments.gradients, tol=arguments.tol)
        )
        if not arguments.json:
            versions = ", ".join(f"{name} {version}" for name, version in reports[-1].versions.items())
            print(f"## {reports[-1].engine}\n\n{versions}\n\n{reports[-1].table()}\n", flush=True)
    if arguments.json:
        print(json.dumps([report.to_dict() for report in reports], indent=2, ensure_ascii=False))
    if arguments.out:
        arguments.out.write_text(page.of([report.to_dict() for report in reports]), encoding="utf-8")
        print(f"{len(reports)} reports -> {arguments.out}", file=sys.stderr)
    return 0


def _tolerance(text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, found {text!r}") from None
    if not 0.0 < found < float("inf"):
        raise argparse.ArgumentTypeError(f"must be positive and finite, found {found:g}")
    return found


def add(commands: Any) -> None:
    """Adds the command to the parser."""
    parser = commands.add_parser(
        "exam",
        help="examine engines by motions whose end is known",
        description="Runs engines through motions whose end is known, and prints how far each is from it,"
        " of which order its error is, and why.",
    )
    parser.add_argument(
        "--engine",
        action="append",
        metavar="NAME",
        help="somersault, scipy, heyoka, mujoco, pinocchio or drake, with a method after a colon, as in"
        " mujoco:RK4; may be given several times (default: somersault)",
    )
    parser.add_argument(
        "--scene", action="append", metavar="NAME", help="scene; may be given several times (default: all)"
    )
    parser.add_argument("--list", action="store_true", help="list the scenes, and run nothing")
    parser.add_argument(
        "--tol", type=_tolerance, default=1e-6, help="error up to which an end agrees (default: %(default)s)"
    )
    parser.add_argument(
        "--gradients",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="compare derivatives as well (default: yes)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON in place of tables")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write a page here, .html")
    parser.set_defaults(command=exam)
