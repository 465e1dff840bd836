"""`somersault analyse`: from recordings of dives to pages with advice."""

from __future__ import annotations

import argparse
import hashlib
import html
import json
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from somersault.cli import tables
from somersault.cli.documents import Document, read
from somersault.errors import InputError, ReadWarning, SomersaultError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from somersault import motion, multibody

_ENDINGS = (".trc", ".c3d", ".csv", ".tsv", ".bvh", ".json")
#: Columns of the table of a folder: of values that have intervals also half of these.
_COLUMNS = (
    "file",
    "status",
    "dive",
    "entry_angle",
    "entry_angle_half",
    "momentum",
    "first_advice",
    "amount",
    "reason",
)


def analyse(arguments: argparse.Namespace) -> int:
    """Analyses a file, or the files of a folder, and writes a page of each."""
    if not arguments.path.exists():
        raise InputError(f"{arguments.path}: there is no such file or folder")
    document = read(arguments.diver, "diver")
    work = _analyser(document)
    if arguments.path.is_dir():
        return _folder(arguments, work, _trial(document))
    page = arguments.out or Path(f"{arguments.path.stem}.html")
    tables.check_page(page)
    tables.check_distinct(arguments.path, out=page)
    found = work(arguments.path)
    found.write(page)
    print(found)
    print(f"{arguments.path} -> {page}", file=sys.stderr)
    if not found.success:
        print(f"somersault: {arguments.path}: {found.message}", file=sys.stderr)
    return 0 if found.success else 1


def _analyser(document: Document) -> Callable[[Path], motion.FlightAnalysis]:
    """What analyses a file, for the diver of a document."""
    from somersault import motion, multibody
    from somersault._analysis import markers_of

    values = document.values
    sizes = {name: values[name] for name in ("mass", "height", "thorax") if name in values}
    kind = values.get("model", "spatial")
    if "thorax" in sizes and kind != "ball_jointed":
        with document.at("thorax"):
            raise InputError("`thorax` is of the model `ball_jointed` only")
    with document.at():
        diver = getattr(multibody, f"diver_{kind}")(**sizes)
    with document.at("markers"):
        markers = _markers(diver, values)
    if (trial := _trial(document)) is not None:
        with document.at("trial"):
            markers = _scaled(markers, trial, values)
    options = dict(values.get("flight", {}))
    for name in ("interval", "scale", "noise"):
        if isinstance(options.get(name), list):
            options[name] = tuple(options[name])
    options |= values.get("reach", {})
    options |= {name: values[name] for name in ("facing", "half_somersaults") if name in values}

    def work(file: Path) -> motion.FlightAnalysis:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReadWarning)
            read_ = motion.read_file(file, **values.get("read", {}))
        for repair in read_.repairs:
            print(f"{file}: {repair}", file=sys.stderr)
        recording = markers_of(read_, str(file), values.get("keypoints"))
        return motion.analyse(recording, markers, name=file.stem, **options)

    return work


def _markers(diver: multibody.Diver, values: dict[str, Any]) -> motion.MarkerSet:
    """The markers of a document: of its protocol, and those that it names itself."""
    from somersault import motion

    places: dict[str, tuple[str | int, ArrayLike]] = {}
    if "protocol" in values:
        known = motion.MarkerSet.on_diver(diver, values["protocol"])
        places.update(zip(known.names, zip(known.bodies, known.points, strict=True), strict=True))
    for name, (body, point) in values.get("markers", {}).items():
        places[name] = (body, tuple(point))
    return motion.MarkerSet(diver.model, places) if places else motion.MarkerSet.joint_centres(diver.model)


def _trial(document: Document) -> Path | None:
    """The recording that shows how large the diver is, beside the document if its path is relative."""
    given = document.values.get("trial")
    return None if given is None else document.path.parent / given


def _scaled(markers: motion.MarkerSet, trial: Path, values: dict[str, Any]) -> motion.MarkerSet:
    """The markers on a diver of the size that a trial shows."""
    from somersault import motion
    from somersault._analysis import markers_of

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReadWarning)
        read_ = motion.read_file(trial, **values.get("read", {}))
    recording = markers_of(read_, str(trial), values.get("keypoints"))
    found = motion.scale_model(markers, recording, **values.get("scaling", {}))
    if not found.success:
        raise InputError(f"{trial}: {found.message}")
    sizes = ", ".join(
        f"{name} {size:.3f} ± {found.scale_deviations[name]:.3f}" for name, size in found.scales.items()
    )
    print(f"{trial}: {found.message}; sizes: {sizes}", file=sys.stderr)
    return found.markers


def _folder(
    arguments: argparse.Namespace, work: Callable[[Path], motion.FlightAnalysis], trial: Path | None
) -> int:
    """A page and a record for each file, a table of all; what is done already is not done again."""
    out = arguments.out or arguments.path / "analysis"
    if out.suffix:
        raise InputError(f"`--out` must be a folder for a folder of recordings, found {out}")
    found = (file for file in arguments.path.iterdir() if file.suffix.lower() in _ENDINGS)
    files = sorted(file for file in found if trial is None or not file.samefile(trial))
    if not files:
        raise InputError(f"{arguments.path}: there is no recording; endings are {', '.join(_ENDINGS)}")
    out.mkdir(parents=True, exist_ok=True)
    diver = arguments.diver.read_bytes() + (b"" if trial is None else trial.read_bytes())
    rows = []
    for file in files:
        key = hashlib.sha256(diver + b"\0" + file.read_bytes()).hexdigest()
        # two files may differ in their endings only
        record, page = out / f"{file.name}.json", out / f"{file.name}.html"
        known = _record(record, key) if page.exists() else None
        if known is None:
            row = _row(file, page, work)
            record.write_text(json.dumps({"key": key, "row": row}, indent=2) + "\n", "utf-8")
            print(f"{file} -> {page if page.exists() else row['reason']}", file=sys.stderr)
        else:
            row = known
            print(f"{file}: done before", file=sys.stderr)
        rows.append(row)
    columns = {name: np.array([row[name] for row in rows], dtype=object) for name in _COLUMNS}
    tables.write(columns, out / "table.csv")
    (out / "index.html").write_text(_index(rows, out), "utf-8")
    failed = [row for row in rows if row["status"] != "analysed"]
    for row in failed:
        print(f"somersault: {row['file']}: {row['reason']}", file=sys.stderr)
    return 1 if failed else 0


def _record(path: Path, key: str) -> dict[str, Any] | None:
    """The row of a file that was analysed before, as it is now and for the diver as it is now."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return None
    row = found.get("row") if isinstance(found, dict) and found.get("key") == key else None
    return row if isinstance(row, dict) and all(name in row for name in _COLUMNS) else None


def _row(file: Path, page: Path, work: Callable[[Path], motion.FlightAnalysis]) -> dict[str, Any]:
    row: dict[str, Any] = dict.fromkeys(_COLUMNS, "") | {"file": file.name}
    try:
        found = work(file)
    except (SomersaultError, OSError) as fault:
        # a page that an earlier file of this name left says nothing of this one
        page.unlink(missing_ok=True)
        return row | {"status": "failed", "reason": str(fault)}
    found.write(page)
    if not found.success:
        return row | {"status": "refused", "reason": found.message}
    report, advice = found.report, found.advice
    lower, upper = np.degrees(report.entry_angle_interval)
    row |= {
        "status": "analysed",
        "dive": report.number or "",
        "entry_angle": round(float(np.degrees(report.entry_angle)), 2),
        "entry_angle_half": round(float(0.5 * (upper - lower)), 2),
        "momentum": round(report.angular_momentum, 3),
        "reason": "" if advice is None else advice.message,
    }
    if advice is not None and advice.advice:
        first = advice.advice[0]
        row |= {"first_advice": first.correction, "amount": round(first.amount, 5)}
    return row


def _index(rows: list[dict[str, Any]], out: Path) -> str:
    head = "".join(f"<th>{name.replace('_', ' ')}</th>" for name in _COLUMNS)
    lines = []
    for row in rows:
        name = html.escape(row["file"])
        link = f'<a href="{name}.html">{name}</a>' if (out / f"{row['file']}.html").exists() else name
        cells = "".join(f"<td>{html.escape(str(row[column]))}</td>" for column in _COLUMNS[1:])
        lines.append(f"<tr><td>{link}</td>{cells}</tr>")
    style = (
        "body{font:15px/1.45 system-ui,sans-serif;margin:1rem}table{border-collapse:collapse}"
        "td,th{border-bottom:1px solid #8884;padding:.3rem .6rem;text-align:left}"
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Analysed flights</title><style>{style}</style><h1>Analysed flights</h1>"
        f'<div style="overflow-x:auto"><table><tr>{head}</tr>{"".join(lines)}</table></div></html>\n'
    )


def add(commands: Any) -> None:
    """Adds the command to the parser."""
    parser = commands.add_parser(
        "analyse",
        help="say what a recorded dive was, and what to do",
        description="Reconstructs the flight of a recording, says which dive it was, flies it again with"
        " changes, compares it with the optimum, and writes a page with advice. Of a folder every recording"
        " is analysed, with a table of all; what is done already is not done again. Ends with 1 where a"
        " flight is no success.",
    )
    parser.add_argument(
        "path", type=Path, help="analyse this file, of any format that `motion.read_file` reads, or folder"
    )
    parser.add_argument(
        "--diver",
        type=Path,
        required=True,
        metavar="FILE",
        help="read diver and markers from this input, TOML or JSON; see `somersault schema diver`",
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="write the page here (default: its name, here), or the pages of a folder into this one",
    )
    parser.set_defaults(command=analyse)
