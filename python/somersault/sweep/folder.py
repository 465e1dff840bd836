"""The directory of a sweep: a manifest that says what its records are of, and a record for each point."""

from __future__ import annotations

import base64
import contextlib
import functools
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from somersault import _somersault
from somersault.errors import InputError, ReadError, SweepError
from somersault.storage import write_bytes
from somersault.sweep.identity import digest

__all__ = ["Folder", "held", "hold", "manifest_of", "record_of"]

#: Version of the records and the manifest.
FORMAT_VERSION = 2

#: Points of a sweep, at most: they are kept in memory.
MOST_POINTS = 10**8


def hold(array: NDArray[Any]) -> Any:
    data = np.ascontiguousarray(array)
    data = data.astype(data.dtype.newbyteorder("<"), copy=False)
    return [data.dtype.str, list(array.shape), base64.b64encode(data.tobytes()).decode()]


def held(parts: Any) -> NDArray[Any]:
    kind, shape, data = parts
    return np.frombuffer(base64.b64decode(data), dtype=np.dtype(kind)).reshape(shape).copy()


def to_json(tree: Any) -> bytes:
    return json.dumps(tree, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def record_of(tree: dict[str, Any]) -> bytes:
    """A record, with the hash of what is in it."""
    return to_json({**tree, "sha256": hashlib.sha256(to_json(tree)).hexdigest()})


def _is_whole(record: Any) -> bool:
    """Whether a record is as it was written."""
    if not isinstance(record, dict):
        return False
    tree = {key: value for key, value in record.items() if key != "sha256"}
    try:
        return hashlib.sha256(to_json(tree)).hexdigest() == record.get("sha256")
    except ValueError:
        # a number that JSON does not have
        return False


def manifest_of(function: Callable[..., Any], version: str | None, points: list[Any]) -> dict[str, Any]:
    """What the records of a directory are of."""
    digest = hashlib.sha256()
    for point in points:
        digest.update(to_json(point))
    return {
        "format": "somersault sweep",
        "format_version": FORMAT_VERSION,
        "somersault": _somersault.__version__,
        "function": _identity(function, version),
        "n_points": len(points),
        "points_sha256": digest.hexdigest(),
    }


def _identity(function: Any, version: str | None) -> dict[str, Any]:
    inner = function
    bound = []
    while isinstance(inner, functools.partial):
        bound += [list(inner.args), dict(inner.keywords)]
        inner = inner.func
    named = inner if hasattr(inner, "__qualname__") else type(inner)
    identity = {"name": named.__qualname__}
    if version is None:
        return {**identity, "reaches_sha256": digest(function)}
    if bound:
        identity["bound_sha256"] = digest(bound)
    return {**identity, "version": version}


class Folder:
    """The directory of a sweep."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def manifest(self) -> dict[str, Any]:
        try:
            found = json.loads((self.path / "manifest.json").read_bytes())
        except FileNotFoundError:
            raise ReadError(f"{self.path} has no manifest.json, so it is not of a sweep") from None
        except (ValueError, RecursionError) as fault:
            raise ReadError(f"{self.path / 'manifest.json'} is corrupt: {fault}") from None
        if not isinstance(found, dict) or found.get("format") != "somersault sweep":
            raise ReadError(f"{self.path / 'manifest.json'} is not of a sweep")
        if (version := found.get("format_version")) != FORMAT_VERSION:
            raise ReadError(
                f"{self.path} is written in format {version}; this version reads {FORMAT_VERSION}"
            )
        count = found.get("n_points")
        if not isinstance(count, int) or not 0 <= count <= MOST_POINTS:
            raise ReadError(f"{self.path / 'manifest.json'} is corrupt: `n_points` is no number of points")
        return found

    @contextlib.contextmanager
    def locked(self, manifest: dict[str, Any]) -> Iterator[None]:
        """Holds the directory, which is made or is found to be of the same sweep."""
        path = self.path / "manifest.json"
        if not path.exists():
            if self.path.exists() and any(self.path.iterdir()):
                raise InputError(f"{self.path} is neither empty nor of a sweep")
            self.path.mkdir(parents=True, exist_ok=True)
            write_bytes(path, json.dumps(manifest, indent=2).encode() + b"\n")
        found = self.manifest()
        for key in manifest:
            if found.get(key) != manifest[key]:
                raise InputError(
                    f"{self.path} has records of another sweep: {key} is {found.get(key)!r} there and"
                    f" {manifest[key]!r} here"
                )
        with path.open("rb") as file:
            _lock(file.fileno(), self.path)
            for left in self.path.glob("records/*/.*.tmp"):
                left.unlink()
            yield

    def _record(self, index: int) -> Path:
        # A thousand files to a folder, since file systems slow down or refuse beyond some ten thousand.
        return self.path / "records" / f"{index // 1000:03d}" / f"{index:06d}.json"

    def records(self, points: Sequence[Any]) -> Iterator[tuple[int, bytes]]:
        """The records there are; None for a point lets any pass. Damaged ones count as none."""
        for index, point in enumerate(points):
            try:
                content = self._record(index).read_bytes()
                record = json.loads(content)
            except (FileNotFoundError, ValueError, RecursionError):
                continue
            if _is_whole(record) and record["index"] == index and point in (None, record["point"]):
                yield index, content

    def write(self, index: int, content: bytes) -> None:
        path = self._record(index)
        try:
            write_bytes(path, content)
        except FileNotFoundError:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, content)


def _lock(file: int, path: Path) -> None:
    """Locks a file until it is closed, where the system can."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise SweepError(f"{path} is in use by another process") from None
