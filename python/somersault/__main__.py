"""Command line: ``python -m somersault``."""

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

import somersault


def print_methods(_: argparse.Namespace) -> int:
    """Print the table of methods."""
    print(somersault.methods())
    return 0


def run_tour(arguments: argparse.Namespace) -> int:
    """Run the tour and print where its report is."""
    # Imported here: it needs matplotlib, which the rest of the command line does without.
    tour = importlib.import_module("somersault.tour")
    report: Path = tour.run(arguments.out)
    print(f"report: {report.resolve()}")
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the arguments name."""
    parser = argparse.ArgumentParser(prog="somersault", description=somersault.__doc__.splitlines()[0])
    parser.add_argument("--version", action="version", version=f"somersault {somersault.__version__}")
    commands = parser.add_subparsers(title="commands", required=True)

    methods = commands.add_parser("methods", help="print the table of methods")
    methods.set_defaults(command=print_methods)

    tour = commands.add_parser("tour", help="run the guided tour and write its report")
    tour.add_argument("--out", type=Path, default=Path("out/tour"), help="folder of the report (%(default)s)")
    tour.set_defaults(command=run_tour)

    chosen = parser.parse_args(arguments)
    status: int = chosen.command(chosen)
    return status


if __name__ == "__main__":
    sys.exit(main())
