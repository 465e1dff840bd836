"""The command ``somersault``, also ``python -m somersault``.

Exit codes: 0, done; 1, the computation did not succeed, and the result so far was written; 2, the command
line or an input file is wrong, and the message says where; 3, something that is not installed is needed; 130,
interrupted.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
from collections.abc import Sequence

import somersault

__all__ = ["main"]

_EXIT = """exit codes:
  0    done
  1    the computation did not succeed; the result so far was written
  2    the command line or an input file is wrong; the message says where
  3    something that is not installed is needed; the message says what
  130  interrupted"""


#: Of the table of methods as JSON.
_COLUMNS = (
    *("name", "title", "citation", "orders", "rate_orders", "dense_order", "evaluations", "history"),
    *("scope", "variables", "adaptive", "angle_limit"),
)


def _methods(arguments: argparse.Namespace) -> int:
    table = somersault.methods()
    if arguments.json:
        print(json.dumps([{name: getattr(info, name) for name in _COLUMNS} for info in table], indent=2))
    else:
        print(table)
    return 0


def _schema(arguments: argparse.Namespace) -> int:
    from somersault.cli.documents import schema

    print(json.dumps(schema(arguments.name), indent=2, ensure_ascii=False))
    return 0


def _parser() -> argparse.ArgumentParser:
    from somersault.cli import analyse, bench, dive, exam, motion, score, view

    parser = argparse.ArgumentParser(
        prog="somersault",
        description=(somersault.__doc__ or "").partition("\n")[0],
        epilog=_EXIT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"somersault {somersault.__version__}")
    commands = parser.add_subparsers(title="commands", required=True)

    methods = commands.add_parser(
        "methods",
        help="print the table of methods",
        description="Prints the table of methods: orders, evaluations in a step, what each conserves.",
    )
    methods.add_argument("--json", action="store_true", help="print JSON")
    methods.set_defaults(command=_methods)

    motion.add(commands)
    dive.add(commands)
    score.add(commands)
    analyse.add(commands)
    view.add(commands)
    bench.add(commands)
    exam.add(commands)

    schemas = commands.add_parser(
        "schema",
        help="print the JSON schema of an input",
        description="Prints the JSON schema of an input, for editors and validators.",
    )
    names = ("integrate", "dive", "score", "diver")
    schemas.add_argument("name", choices=names, help="input of this command, or diver of `analyse`")
    schemas.set_defaults(command=_schema)

    for name in ("integrate", "dive", "score", "bench"):
        commands.choices[name].add_argument(
            "--progress",
            action=argparse.BooleanOptionalAction,
            default=sys.stderr.isatty() and importlib.util.find_spec("tqdm") is not None,
            help="show a bar (needs tqdm; by default on a terminal)",
        )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command that the arguments name, and returns its exit code."""
    from somersault.cli.tables import Missing

    chosen = _parser().parse_args(arguments)
    try:
        status: int = chosen.command(chosen)
    except KeyboardInterrupt:
        print("somersault: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # Whoever read the output has read enough; what is left in the buffer must not be written at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Missing, ModuleNotFoundError) as fault:
        print(f"somersault: {fault}", file=sys.stderr)
        return 3
    except somersault.InputError as fault:
        print(f"somersault: {fault}", file=sys.stderr)
        return 2
    except (somersault.SomersaultError, OSError) as fault:
        print(f"somersault: {fault}", file=sys.stderr)
        return 1
    return status
