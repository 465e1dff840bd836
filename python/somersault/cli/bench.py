"""`somersault bench`: time to an accuracy on this machine, by method."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import somersault
from somersault import studies
from somersault.cli import tables

_STEPS = 10.0 ** np.arange(-1.0, -4.01, -1 / 3)


def bench(arguments: argparse.Namespace) -> int:
    """Times each method at several steps, and writes error and time of each run."""
    if arguments.out:
        tables.check(arguments.out)
    table = somersault.methods()
    names = [somersault.integrators.method(name).name for name in arguments.methods] or table.names
    problem = studies.Problem.case(arguments.case)
    rows: list[tuple[str, float, float, int, float]] = []
    for name in _shown(names, arguments.progress):
        runs = studies.work_precision(problem, name, _STEPS, repeats=arguments.repeats)
        errors = runs.errors["orientation"]
        rows += zip([name] * len(runs), _STEPS, errors, runs.evaluations, runs.seconds, strict=True)
    heads = ("method", "dt", "error", "evaluations", "seconds")
    columns = {head: np.array(column) for head, column in zip(heads, zip(*rows, strict=True), strict=True)}
    if arguments.out:
        tables.write(columns, arguments.out)
    _print(names, columns, arguments.target)
    return 0


def _repeats(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, found {text!r}") from None
    if not 1 <= number <= 1000:
        raise argparse.ArgumentTypeError(f"must be between 1 and 1000, found {number}")
    return number


def _target(text: str) -> float:
    try:
        error = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, found {text!r}") from None
    if not 0.0 < error < np.inf:
        raise argparse.ArgumentTypeError(f"must be positive and finite, found {error:g}")
    return error


def _shown(names: list[str], progress: bool) -> Iterable[str]:
    if not progress:
        return names
    from tqdm import tqdm

    shown: Iterable[str] = tqdm(names, unit="method")
    return shown


def _print(names: list[str], columns: dict[str, Any], targets: list[float]) -> None:
    """The least time in which each method gets below each target, quickest for the last one first."""
    times = {}
    for name in names:
        own = columns["method"] == name
        errors, seconds = columns["error"][own], columns["seconds"][own]
        times[name] = [min(seconds[errors <= target], default=np.inf) for target in targets]
    print("method    " + "".join(f"{f'to {target:g} rad':>16}" for target in targets))
    for name, row in sorted(times.items(), key=lambda item: item[1][::-1]):
        print(f"{name:<10}" + "".join(f"{f'{1e3 * t:.3f} ms' if t < np.inf else '-':>16}" for t in row))
    sys.stdout.flush()


def add(commands: Any) -> None:
    """Adds the command to the parser."""
    parser = commands.add_parser(
        "bench",
        help="time the methods on this machine",
        description="Times each method on ten seconds of a tumbling body (thesis 7.2.1), in steps from 0.1 s"
        " to 0.1 ms, and prints the least time to each accuracy.",
    )
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="names of methods (default: all)")
    parser.add_argument(
        "--case", type=int, choices=(1, 2, 3), default=2, help="case of the thesis (default: %(default)s)"
    )
    parser.add_argument(
        "--target", type=_target, nargs="+", default=[1e-2, 1e-5, 1e-8], help="errors of the orientation, rad"
    )
    parser.add_argument(
        "--repeats",
        type=_repeats,
        default=3,
        help="repetitions, of which the fastest counts (default: %(default)s)",
    )
    parser.add_argument("--out", type=Path, help="write all runs here, .parquet, .csv or .json")
    parser.set_defaults(command=bench)
