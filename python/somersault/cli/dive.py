"""`somersault dive`: the dive that a document describes, optimised and verified."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from somersault import multibody, ocp
from somersault.cli import tables
from somersault.cli.documents import Document, read

_DIVES = {"107b": (ocp.dive_107b, multibody.diver_planar), "5174d": (ocp.dive_5174d, multibody.diver_spatial)}


def dive(arguments: argparse.Namespace) -> int:
    """Optimises, verifies by an independent integration, and writes the curves and a summary."""
    document = read(arguments.file, "dive")
    _check_outputs(arguments)
    posed = _posed(document)
    solving = dict(document.values.get("solve", {}))
    n_starts = solving.pop("n_starts", None)
    seed = solving.pop("seed", 1)
    with document.at("solve"):
        found = (
            posed.search(n_starts, seed=seed, on_interrupt="return", **solving)
            if n_starts
            else [_solve(posed, solving, arguments)]
        )
    if not found:
        print("somersault: no start led to a dive", file=sys.stderr)
        return 1
    best = found[0]
    if arguments.out:
        tables.write(_columns(best), arguments.out, arguments.format)
    if arguments.html:
        from somersault import viewer

        scene = viewer.Scene(f"Dive {document.values['dive'].upper()}")
        scene.add(best.dive.diver.model, best.t, best.q).water(0.0).write(arguments.html)
    print(json.dumps(_summary(best), indent=2))
    if not best.confirmed:
        print(f"somersault: {best.verification.message}", file=sys.stderr)
    return 0 if best.success else 1


def _check_outputs(arguments: argparse.Namespace) -> None:
    if arguments.out:
        tables.check(arguments.out, arguments.format)
    tables.check_page(arguments.html)
    tables.check_distinct(arguments.file, out=arguments.out, html=arguments.html)


def _posed(document: Document) -> ocp.Dive:
    make, diver = _DIVES[document.values["dive"]]
    options = dict(document.values.get("options", {}))
    for name in ("lean", "duration", "momentum"):
        if isinstance(options.get(name), list):
            options[name] = tuple(options[name])
    for name in ("windows", "template"):
        if name in options:
            options[name] = [tuple(item) for item in options[name]]
    if "diver" in document.values:
        with document.at("diver"):
            options["diver"] = diver(**document.values["diver"])
    with document.at("options"):
        return make(**options)


def _solve(posed: ocp.Dive, options: dict[str, Any], arguments: argparse.Namespace) -> ocp.DiveSolution:
    if not arguments.progress:
        return posed.solve(on_interrupt="return", **options)
    from tqdm import tqdm

    with tqdm(unit="iteration") as bar:

        def show(iteration: int, z: Any, cost: float, violation: float) -> None:
            bar.set_postfix(cost=f"{cost:.6g}", violation=f"{violation:.1e}", refresh=False)
            bar.update()

        return posed.solve(callback=show, on_interrupt="return", **options)


def _columns(found: ocp.DiveSolution) -> dict[str, Any]:
    return tables.curves(
        t=found.t,
        q=found.q,
        v=found.v,
        somersaults=found.somersaults,
        twists=found.twists,
        tilt=found.tilt,
        channel=found.channels,
    )


def _summary(found: ocp.DiveSolution) -> dict[str, Any]:
    judged = found.verification
    return {
        "status": found.status,
        "success": found.success,
        "solved": found.report.success,
        "confirmed": found.confirmed,
        "message": found.message,
        "cost": found.report.cost,
        "duration": found.duration,
        "momentum": found.momentum,
        "lean": found.lean,
        "somersaults": float(found.somersaults[-1]),
        "twists": float(found.twists[-1]),
        "verified": {
            "somersaults": judged.somersaults,
            "twists": judged.twists,
            "entry_angle": judged.entry_angle,
            "entry_defect": judged.entry_defect,
            "allowed": judged.allowed,
            "defect": judged.defect,
            "full_dynamics_defect": judged.full_dynamics_defect,
            "momentum_drift": judged.momentum_drift,
            "least_distance": judged.least_distance,
            "nearest_limbs": judged.nearest_limbs,
            "nearest_time": judged.nearest_time,
            "take_off_velocity": np.asarray(judged.take_off_velocity).tolist(),
        },
        "phases": [{"posture": posture, "from": start, "to": end} for posture, start, end in found.phases],
    }


def add(commands: Any) -> None:
    """Adds the command to the parser."""
    parser = commands.add_parser(
        "dive",
        help="optimise the dive that a file describes",
        description="Optimises the dive that a TOML or JSON file describes, and verifies it independently.",
    )
    parser.add_argument("file", type=Path, help="read this input, TOML or JSON; see `somersault schema dive`")
    parser.add_argument("--out", type=Path, help="write the curves here, .parquet, .csv or .json")
    parser.add_argument("--format", choices=tables.FORMATS, help="write the curves in this format")
    parser.add_argument("--html", type=Path, metavar="FILE", help="write a page that plays the dive")
    parser.set_defaults(command=dive)
