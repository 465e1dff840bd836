"""Side by side with the packages one would otherwise use: `make bench-peers`.

Writes a table to standard output, and `peers.json` and `peers.md` to the folder asked for.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import arm
import batch
import box
import components
import contact
import control
import expressions
import flows
import ftla
import legs
import long_run
import multibody
import programs
import swing_up
import tree_contact
from measure import machine

COMPARISONS = (
    box,
    long_run,
    contact,
    tree_contact,
    legs,
    batch,
    multibody,
    expressions,
    arm,
    programs,
    control,
    ftla,
    flows,
    swing_up,
    components,
)


def main() -> None:
    parser = argparse.ArgumentParser(prog="benches/peers", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/bench"), help="folder to write to")
    parser.add_argument("--repetitions", type=int, default=15, help="samples of each timing")
    arguments = parser.parse_args()

    about = machine()
    parts = ["# Peers, side by side", "\n".join(f"- {key}: {value}" for key, value in about.items())]
    print("\n\n".join(parts))
    results: dict[str, object] = {"machine": about, "repetitions": arguments.repetitions}
    for comparison in COMPARISONS:
        rows, text = comparison.compare(arguments.repetitions)
        results[comparison.__name__] = rows
        parts.append(text)
        print(f"\n{text}", flush=True)

    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "peers.json").write_text(json.dumps(results, indent=1) + "\n")
    (arguments.out / "peers.md").write_text("\n\n".join(parts) + "\n")
    print(f"\nwritten to {arguments.out / 'peers.json'} and {arguments.out / 'peers.md'}")


if __name__ == "__main__":
    main()
