"""Outputs of the command line: columns of equal length as Parquet, CSV or JSON."""

from __future__ import annotations

import csv
import json
import math
import os
import sys
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from somersault.errors import InputError

__all__ = ["FORMATS", "Columns", "Missing", "check", "check_distinct", "check_page", "curves", "write"]

Columns = Mapping[str, NDArray[Any]]

FORMATS = ("parquet", "csv", "json")


class Missing(Exception):
    """Something that is not installed is needed: the message says what, and how to install it."""


def curves(**named: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Columns of curves: those of several components are numbered, or named where there are names."""
    names = {
        "position": ("x", "y", "z"),
        "velocity": ("vx", "vy", "vz"),
        "quaternion": ("qx", "qy", "qz", "qw"),
        "angular_velocity": ("wx", "wy", "wz"),
    }
    columns = {}
    for name, values in named.items():
        if values.ndim == 1:
            columns[name] = values
            continue
        parts = names.get(name) or [f"{name}{i}" for i in range(values.shape[1])]
        columns |= dict(zip(parts, values.T, strict=True))
    return columns


def check_distinct(document: Path, **outputs: Path | None) -> None:
    """Refuses outputs, by their options, of which one would take the place of another or of the input."""
    found = {Path(os.path.realpath(document)): "the input"}
    for option, path in outputs.items():
        if path is None:
            continue
        place = Path(os.path.realpath(path))
        if place.exists() and not place.is_file():
            # what comes after the other on a device or a pipe does not take its place
            continue
        if place in found:
            raise InputError(f"--{option} and {found[place]} are one file: {path}")
        found[place] = f"--{option}"


def check(path: Path | None, kind: str | None = None) -> None:
    """Refuses, before the work, what `write` would refuse after it, and makes the folder of the file."""
    if _format(path, kind) == "parquet":
        _parquet()
    if path is not None:
        _make_folder(path)


def check_page(path: Path | None) -> None:
    """Refuses the path of a page before the work, and makes its folder."""
    if path is None:
        return
    _make_folder(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path}: the name of a page must end in .html")


def _make_folder(path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"{path}: the folder {path.parent} cannot be made: {fault.strerror}") from fault


def _format(path: Path | None, kind: str | None) -> str:
    kind = kind or (path.suffix.lower().lstrip(".") if path else "csv")
    if kind not in FORMATS:
        raise InputError(f"{path}: the name must end in .{', .'.join(FORMATS)}, or --format must be given")
    return kind


def _parquet() -> Any:
    try:
        import pyarrow.parquet
    except ModuleNotFoundError as fault:
        raise Missing("Parquet needs pyarrow: pip install 'somersault[parquet]'") from fault
    return pyarrow


def write(columns: Columns, path: Path | None, kind: str | None = None) -> None:
    """Writes columns to a file, in the format of its name, or to the standard output as CSV.

    JSON is an object of lists. CSV has one line of names; an empty cell or a null is a value there is not.
    """
    kind = _format(path, kind)
    if kind == "parquet":
        _write_parquet(columns, path)
        return
    with path.open("w", encoding="utf-8", newline="") if path else nullcontext(sys.stdout) as file:
        (_write_csv if kind == "csv" else _write_json)(columns, file)


def _write_parquet(columns: Columns, path: Path | None) -> None:
    pyarrow = _parquet()
    table = pyarrow.table({name: pyarrow.array(list(values)) for name, values in columns.items()})
    pyarrow.parquet.write_table(table, path or sys.stdout.buffer)


def _plain(value: Any) -> Any:
    """Of the types that both formats know. `repr` of a float reads back as the same float."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write_csv(columns: Columns, file: IO[str]) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_plain(cell) for cell in row] for row in zip(*columns.values(), strict=True))


def _write_json(columns: Columns, file: IO[str]) -> None:
    json.dump({name: [_plain(cell) for cell in values] for name, values in columns.items()}, file)
    file.write("\n")
