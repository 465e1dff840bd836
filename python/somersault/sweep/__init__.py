"""Parameter sweeps: one function at many points, on threads or on a cluster; interrupted sweeps resume.

A point is a dictionary of arguments, and a sweep calls one function with each. `grid` makes points of all
combinations; any list of dictionaries will do. With a directory every point leaves a record there as soon as
it is done, and a sweep that was stopped or killed continues where it was. A point that fails is recorded and
does not stop the others.

>>> import somersault
>>> from somersault import sweep
>>> def drift(dt, method):
...     body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
...     start = somersault.State(angular_velocity=(1.0, 2.0, 3.0))
...     motion = somersault.integrate(body, start, (0.0, 10.0), dt=dt, method=method)
...     return {"drift": motion.kinetic_energy[-1] / motion.kinetic_energy[0] - 1}
>>> found = sweep.run(drift, sweep.grid(dt=[0.1, 0.05], method=["rkmk", "dmv2s"]))
>>> found.n_done, found.n_failed
(4, 0)
>>> found.table()["method"].tolist()
['rkmk', 'dmv2s', 'rkmk', 'dmv2s']
>>> bool(abs(found.table()["drift"][1]) < 1e-12)
True
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from somersault.errors import InputError, SweepError
from somersault.storage import decode, encode
from somersault.sweep.folder import Folder, held, hold, manifest_of, record_of

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["Failure", "Sweep", "grid", "read", "run"]

Point = Mapping[str, Any]

#: A task returns after this time with what it has done, so that little is lost when a run is killed.
_TASK_SECONDS = 0.5
_TASK_POINTS = 256

#: How often a cluster is looked at, and for how long it may have no workers, s.
_LOOK_SECONDS = 5.0
_ALONE_SECONDS = 60.0


def grid(**axes: Iterable[Any]) -> list[dict[str, Any]]:
    """Points for all combinations of values; the last name varies fastest.

    Parameters
    ----------
    **axes : iterable
        The values of each argument.

    Returns
    -------
    list of dict

    Raises
    ------
    somersault.errors.InputError
        If what an argument is given is not several values.

    Examples
    --------
    >>> from somersault import sweep
    >>> sweep.grid(dt=[0.1, 0.2], method=["rkmk"])
    [{'dt': 0.1, 'method': 'rkmk'}, {'dt': 0.2, 'method': 'rkmk'}]
    """
    for name, values in axes.items():
        # The letters of a text are not meant.
        if isinstance(values, str | bytes) or not isinstance(values, Iterable):
            raise InputError(f"`{name}` must be a list of values, found {values!r:.80}")
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


@dataclass(frozen=True)
class Failure:
    """The exception that a point ended with: the name of its type, and what it says."""

    type: str
    message: str

    def __repr__(self) -> str:
        return f"Failure({self.type!r}, {self.message!r:.150})"


@dataclass(frozen=True, eq=False)
class Sweep:
    """Points and their results, in the order of the points.

    Two are equal if all four attributes are: arrays entry by entry, and NaN with NaN.

    Attributes
    ----------
    points : list of dict
        The arguments.
    values : list
        What the function returned; None where it failed or has not been called.
    failures : dict of int to Failure
        By the index of the point.
    missing : list of int
        Points without a record: of a directory that was read before its sweep was done.
    """

    points: list[dict[str, Any]]
    values: list[Any]
    failures: dict[int, Failure]
    missing: list[int]

    def __repr__(self) -> str:
        counts = f"{self.n_done} done, {self.n_failed} failed, {len(self.missing)} missing"
        return f"<Sweep: {len(self)} points, {counts}>"

    def __len__(self) -> int:
        return len(self.points)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sweep):
            return NotImplemented
        return (
            _same(self.points, other.points)
            and _same(self.values, other.values)
            and (self.failures, self.missing) == (other.failures, other.missing)
        )

    @property
    def n_done(self) -> int:
        """Points with a value."""
        return len(self.points) - len(self.failures) - len(self.missing)

    @property
    def n_failed(self) -> int:
        """Points that ended with an exception."""
        return len(self.failures)

    def table(self) -> dict[str, NDArray[Any]]:
        """Columns by name: arguments, values, and ``error``, the message of a failure or an empty string.

        Values that are dictionaries have a column for each key, others the column ``value``. Where there is
        no value a column of numbers has NaN, and others None.

        Examples
        --------
        >>> from somersault import sweep
        >>> def inverse(x):
        ...     return {"y": 1.0 / x}
        >>> found = sweep.run(inverse, sweep.grid(x=[0.0, 2.0]), version="1")
        >>> for name, column in found.table().items():
        ...     print(name, column.tolist())
        x [0.0, 2.0]
        y [nan, 0.5]
        error ['float division by zero', '']
        """
        values = [
            value if isinstance(value, Mapping) else {} if value is None else {"value": value}
            for value in self.values
        ]
        errors = [self.failures[i].message if i in self.failures else "" for i in range(len(self))]
        columns = {**_columns(self.points), **_columns(values)}
        if len(columns) < len(_names(self.points)) + len(_names(values)):
            shared = sorted(set(_names(self.points)) & set(_names(values)))
            raise InputError(
                f"arguments and values share the names {shared}; read `points` and `values` instead"
            )
        return {**columns, "error": np.array(errors, dtype=object)}


def _same(one: Any, other: Any) -> bool:
    """Whether two things are equal, arrays as a whole and NaN with NaN."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray)) or one.dtype != other.dtype:
            return False
        return np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, float) and isinstance(other, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple) and type(one) is type(other):
        return len(one) == len(other) and all(map(_same, one, other))
    if type(one) is not type(other) or isinstance(one, bool | int | float | str | None):
        return bool(one == other)
    # objects are as equal as what files hold of them
    return bool(encode(one, hold) == encode(other, hold))


def _names(rows: Sequence[Point]) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row))


def _columns(rows: Sequence[Point]) -> dict[str, NDArray[Any]]:
    return {name: _column([row.get(name) for row in rows]) for name in _names(rows)}


def _column(cells: list[Any]) -> NDArray[Any]:
    whole = [cell for cell in cells if cell is not None]
    if all(isinstance(cell, (int, float)) and not isinstance(cell, bool) for cell in whole):
        if len(whole) == len(cells):
            return np.array(cells)
        return np.array([np.nan if cell is None else cell for cell in cells], dtype=float)
    column = np.empty(len(cells), dtype=object)
    column[:] = cells
    return column


def run(
    function: Callable[..., Any],
    points: Iterable[Point],
    *,
    directory: str | PathLike[str] | None = None,
    version: str | None = None,
    workers: int | None = None,
    client: Client | None = None,
    retry_failures: bool = False,
    progress: bool = False,
) -> Sweep:
    """Calls a function at each point, in parallel, and returns all values in the order of the points.

    Ctrl-C ends the run once the calls that are under way have returned; with a directory nothing that was
    done is lost, whatever ends the run.

    Parameters
    ----------
    function : callable
        Called with the items of a point as keyword arguments. Its value is anything `somersault.save` can
        write. The results are reproducible if it depends on its arguments only: random numbers come from a
        seed among them.
    points : iterable of dict
        Of the same kind as the values, with names for keys.
    directory : path-like, optional
        Where records are kept, one file of JSON for each point, and a manifest that says what they are of. If
        it has records of this sweep they are not computed again. Records of another sweep are an error.
    version : str, optional
        Stands for what the function does. By default that is everything its result can depend on besides
        its arguments, so that records are refused once any of it has changed: its code, defaults and
        closure, what a partial application holds, the object of a bound method, and the globals, modules
        and functions that it names, with what these reach in turn. Installed packages count by their
        versions, and so does Python. Where a part has no representation, such as an open file, a version
        must be given; change it when results change. The contents of files that the function opens are not
        seen.
    workers : int, optional
        Threads; by default one for each processor. Functions that spend their time in somersault run in
        parallel, since it releases the interpreter.
    client : distributed.Client, optional
        Of a Dask cluster, to compute there instead. Records are written where this function runs. Needs
        ``pip install somersault[dask]``.
    retry_failures : bool
        Whether points whose record is a failure are computed again.
    progress : bool
        Whether to show a bar, which needs tqdm.

    Returns
    -------
    Sweep

    Raises
    ------
    somersault.errors.InputError
        If a point is not a dictionary of what can be written, the directory belongs to another sweep, a
        `version` is needed, or an argument has another type.
    somersault.errors.SweepError
        If the directory is in use, or the cluster goes away.

    Examples
    --------
    >>> import tempfile
    >>> from somersault import sweep
    >>> def square(x):
    ...     return x * x
    >>> folder = tempfile.mkdtemp()
    >>> sweep.run(square, sweep.grid(x=[1.0, 2.0, 3.0]), directory=folder).values
    [1.0, 4.0, 9.0]
    >>> sweep.run(square, sweep.grid(x=[1.0, 2.0, 3.0]), directory=folder).n_done
    3
    """
    _check(function, points, directory, version, workers, client)
    bare = [_point(i, point) for i, point in enumerate(points)]
    if directory is None:
        records: dict[int, bytes] = {}
        _compute(function, bare, records, lambda i, record: None, workers, client, progress)
        return _collect(bare, records)
    folder = Folder(_path(directory))
    with folder.locked(manifest_of(function, version, bare)):
        records = {
            i: record
            for i, record in folder.records(bare)
            if not (retry_failures and b'"error"' in record and "error" in json.loads(record))
        }
        _compute(function, bare, records, folder.write, workers, client, progress)
    return _collect(bare, records)


def read(directory: str | PathLike[str]) -> Sweep:
    """Reads the records of a sweep, whether it is done or not.

    Parameters
    ----------
    directory : path-like
        That `run` was given.

    Returns
    -------
    Sweep
        Points that are not done yet are without arguments, in its `missing`.

    Raises
    ------
    somersault.errors.ReadError
        If the directory is not one of a sweep.

    Examples
    --------
    >>> import tempfile
    >>> from somersault import sweep
    >>> folder = tempfile.mkdtemp()
    >>> _ = sweep.run(lambda x: x * x, sweep.grid(x=[1.0, 2.0]), directory=folder, version="1")
    >>> sweep.read(folder).values
    [1.0, 4.0]
    """
    folder = Folder(_path(directory))
    n_points = folder.manifest()["n_points"]
    records = dict(folder.records([None] * n_points))
    points = [json.loads(records[i])["point"] if i in records else {} for i in range(n_points)]
    return _collect(points, records)


def _check(
    function: object, points: object, directory: object, version: object, workers: object, client: object
) -> None:
    """Refuses arguments of another type, which would fail in a thread or after a part of the work."""

    def must(be: str, name: str, found: object) -> InputError:
        return InputError(f"`{name}` must be {be}, found {found!r:.80}")

    if not callable(function):
        raise must("a function", "function", function)
    if isinstance(points, str | Mapping) or not isinstance(points, Iterable):
        raise must("a list of dictionaries", "points", points)
    if directory is not None:
        _path(directory)
    if version is not None and not isinstance(version, str):
        raise must("text", "version", version)
    whole = isinstance(workers, (int, np.integer)) and not isinstance(workers, bool)
    if workers is not None and not (whole and int(workers) >= 1):  # type: ignore[call-overload]
        raise must("a whole number of at least 1", "workers", workers)
    if client is not None and not hasattr(client, "get_executor"):
        raise must("a distributed.Client", "client", client)


def _path(directory: object) -> Path:
    if not isinstance(directory, str | PathLike):
        raise InputError(f"`directory` must be a path, found {directory!r:.80}")
    path = Path(directory)
    if path.exists() and not path.is_dir():
        raise InputError(f"`directory` must be a directory, found the file {path}")
    return path


def _point(index: int, point: Any) -> Any:
    """What stands for a point in a record."""
    if not isinstance(point, Mapping) or not all(isinstance(name, str) for name in point):
        raise InputError(f"point {index} must be a dictionary with names for keys, found {point!r:.80}")
    return encode(dict(point), hold, f"point {index}")


def _work(
    function: Callable[..., Any], items: list[tuple[int, Any]], stop: threading.Event | None
) -> list[bytes]:
    """The records of the first items, at least of one: as many as there is time for."""
    began = time.monotonic()
    records = []
    for index, point in items:
        try:
            value = function(**decode(point, held))
            outcome = {"value": encode(value, hold)}
        except Exception as fault:
            outcome = {"error": {"type": type(fault).__qualname__, "message": str(fault)}}
        records.append(record_of({"index": index, "point": point, **outcome}))
        if time.monotonic() - began > _TASK_SECONDS or (stop is not None and stop.is_set()):
            break
    return records


def _compute(
    function: Callable[..., Any],
    points: list[Any],
    records: dict[int, bytes],
    write: Callable[[int, bytes], None],
    workers: int | None,
    client: Client | None,
    progress: bool,
) -> None:
    """Adds the records that are missing."""
    todo = deque((i, point) for i, point in enumerate(points) if i not in records)
    n_workers = workers or os.cpu_count() or 1
    stop: threading.Event | None = None
    executor: Executor
    if client is None:
        stop = threading.Event()
        executor = ThreadPoolExecutor(n_workers, thread_name_prefix="somersault-sweep")
    else:
        # Not pure: a pure task of equal arguments would come from what the cluster remembers.
        # distributed annotates neither of the two
        cluster: Any = client
        executor = cluster.get_executor(pure=False)
        n_workers = max(1, sum(cluster.ncores().values()))
    size = min(_TASK_POINTS, max(1, len(todo) // (4 * n_workers)))
    # Points of tasks that ended with their process, and the one of them that runs with nothing beside it.
    suspects: deque[tuple[int, Any]] = deque()
    isolated: Future[list[bytes]] | None = None
    running: dict[Future[list[bytes]], list[tuple[int, Any]]] = {}

    def keep(index: int, record: bytes, bar: Any) -> None:
        write(index, record)
        records[index] = record
        if bar is not None:
            bar.update()

    def take(future: Future[list[bytes]], bar: Any) -> None:
        items = running.pop(future)
        try:
            finished = future.result()
        except CancelledError:
            raise SweepError("the cluster has gone away; run again to continue") from None
        except Exception as fault:
            # A call that takes its process with it is a failure of its point, once it is known which: the
            # process may have had other tasks.
            if type(fault).__name__ != "KilledWorker":
                raise
            if future is not isolated:
                suspects.extend(items)
            else:
                index, point = items[0]
                error = {"type": "KilledWorker", "message": "the process of the call was killed"}
                keep(index, record_of({"index": index, "point": point, "error": error}), bar)
            return
        for (index, _), record in zip(items, finished, strict=False):
            keep(index, record, bar)
        todo.extendleft(reversed(items[len(finished) :]))

    with _bar(progress, len(points), len(records)) as bar:
        try:
            while todo or suspects or running:
                while todo and len(running) < 2 * n_workers:
                    items = [todo.popleft() for _ in range(min(size, len(todo)))]
                    running[executor.submit(_work, function, items, stop)] = items
                if suspects and not running:
                    items = [suspects.popleft()]
                    isolated = executor.submit(_work, function, items, stop)
                    running[isolated] = items
                for future in _some_done(running, client):
                    take(future, bar)
        except KeyboardInterrupt:
            if stop is not None:
                stop.set()
                for future in running:
                    future.cancel()
                for future in wait(running).done:
                    if not future.cancelled():
                        take(future, bar)
            raise
        finally:
            for future in running:
                future.cancel()
            executor.shutdown(wait=client is None)


def _some_done(running: Iterable[Future[list[bytes]]], client: Client | None) -> set[Future[list[bytes]]]:
    """Waits for tasks, of which a cluster that has lost all its workers would end none."""
    if client is None:
        return wait(running, return_when=FIRST_COMPLETED).done
    cluster: Any = client
    alone_since: float | None = None
    while True:
        done = wait(running, timeout=_LOOK_SECONDS, return_when=FIRST_COMPLETED).done
        if done:
            return done
        if cluster.ncores():
            alone_since = None
        elif alone_since is None:
            alone_since = time.monotonic()
        elif time.monotonic() - alone_since > _ALONE_SECONDS:
            raise SweepError(
                f"the cluster has had no workers for {_ALONE_SECONDS:g} s; run again to continue"
            )


@contextlib.contextmanager
def _bar(wanted: bool, total: int, done: int) -> Iterator[Any]:
    if not wanted:
        yield None
        return
    from tqdm.auto import tqdm

    with tqdm(total=total, initial=done, unit="point") as bar:
        yield bar


def _collect(points: list[Any], records: Mapping[int, bytes]) -> Sweep:
    values: list[Any] = [None] * len(points)
    failures = {}
    missing = []
    for i in range(len(points)):
        if i not in records:
            missing.append(i)
            continue
        record = json.loads(records[i])
        if "error" in record:
            failures[i] = Failure(**record["error"])
        else:
            values[i] = decode(record["value"], held)
    return Sweep([decode(point, held) for point in points], values, failures, missing)
