"""Writes the tour: `python -m tour`, from the root of the repository."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

import tour


def main(arguments: Sequence[str] | None = None) -> None:
    """Writes the tour where the arguments say, and prints which page to open."""
    parser = argparse.ArgumentParser(prog="python -m tour", description=__doc__)
    parser.add_argument(
        "--out", type=Path, default=Path("out/tour"), help="folder of the report (%(default)s)"
    )
    written = tour.run(parser.parse_args(arguments).out, processes=min(2, os.cpu_count() or 1))
    print(f"report: {written.resolve()}")


if __name__ == "__main__":
    main()
