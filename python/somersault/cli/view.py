"""`somersault view`: a page of whatever a file of a recorded motion has."""

from __future__ import annotations

import argparse
import html
import importlib.util
import io
import sys
import warnings
import webbrowser
from pathlib import Path
from typing import Any

from somersault.cli import tables
from somersault.errors import InputError, ReadWarning

#: Options of reading, those of `motion.read_file`.
_READING = ("unit", "up", "forward", "rate", "person", "strict")


def view(arguments: argparse.Namespace) -> int:
    """Reads the file, says what was repaired in it, and writes the page."""
    from somersault import motion

    if not arguments.file.exists():
        raise InputError(f"{arguments.file}: there is no such file or folder")
    page = arguments.html or Path(f"{arguments.file.stem}.html")
    tables.check_page(page)
    tables.check_distinct(arguments.file, html=page)
    with warnings.catch_warnings():
        # repairs are printed below
        warnings.simplefilter("ignore", ReadWarning)
        found = motion.read_file(arguments.file, **{name: getattr(arguments, name) for name in _READING})
    for repair in found.repairs:
        print(f"{arguments.file}: {repair}", file=sys.stderr)
    page.write_text(_page(found, arguments.file.stem), encoding="utf-8")
    print(f"{found!r} -> {page}", file=sys.stderr)
    if arguments.open:
        webbrowser.open(page.resolve().as_uri())
    return 0


def _page(found: Any, title: str) -> str:
    from somersault import motion, viewer

    if not isinstance(found, motion.ChannelRecording):
        return viewer.Scene(title).add(found).html()
    if importlib.util.find_spec("matplotlib") is None:
        raise tables.Missing("a page of channels needs matplotlib: pip install 'somersault[plot]'")
    from somersault import plotting

    drawn = io.StringIO()
    figure: Any = plotting.channels(found).figure
    figure.savefig(drawn, format="svg")
    picture = drawn.getvalue()
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title>'
    return f'<!doctype html><html lang="en">{head}{picture[picture.index("<svg") :]}</html>\n'


def add(commands: Any) -> None:
    """Adds the command to the parser."""
    parser = commands.add_parser(
        "view",
        help="show a recorded motion of any format",
        description="Writes a page that plays the markers, skeleton or key points of a file, or shows the"
        " curves of its channels. What was repaired in the file is printed.",
    )
    parser.add_argument(
        "file",
        type=Path,
        help="read this file, of any format that `motion.read_file` reads, or folder of OpenPose",
    )
    parser.add_argument(
        "--html", type=Path, metavar="FILE", help="write the page here (default: its name, here)"
    )
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    parser.add_argument("--unit", help="unit of length, where the file has none: m, cm, mm, in, …")
    parser.add_argument("--up", help="axis that points up: x, y, z, or one with a sign, --up=-y")
    parser.add_argument("--forward", help="axis that points forward")
    parser.add_argument("--rate", type=float, help="frames a second, of key points or without times")
    parser.add_argument("--person", type=int, help="number of the person in frames of key points, from 0")
    parser.add_argument("--strict", action="store_true", help="refuse a file that needs a repair")
    parser.set_defaults(command=view)
