"""Files of models, solutions and whatever is made of them.

A file holds any tree of numbers, strings, arrays, lists, tuples, dictionaries and objects of somersault that
can be pickled. It is a zip archive of one JSON document and the arrays, so that ``numpy.load`` opens it
without somersault too; unlike a pickle it runs no code when it is read.

>>> import pathlib, tempfile
>>> import somersault
>>> path = pathlib.Path(tempfile.mkdtemp()) / "pendulum.som"
>>> somersault.save(path, {"model": somersault.multibody.cart_pendulum(), "start": (0.0, 3.1)})
>>> somersault.load(path)["start"]
(0.0, 3.1)
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import shutil
import threading
import zipfile
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from somersault import _somersault
from somersault.errors import InputError, ReadError, WriteError

__all__ = ["FORMAT_VERSION", "decode", "encode", "load", "save", "write_bytes"]

#: Version of the format; files of later ones are refused.
FORMAT_VERSION = 1

_HEADER = "header.json"
#: A fixed time, so that equal contents are equal files.
_WRITTEN = (1980, 1, 1, 0, 0, 0)
#: What the modules of the extension list; a name has one meaning in all of them.
_EXTENSION: dict[str, Any] = {
    name: getattr(module, name)
    for module in vars(_somersault).values()
    if isinstance(module, ModuleType)
    for name in module.__all__
}


def save(path: str | PathLike[str], thing: Any) -> None:
    """Writes a file that `load` reads; a file that is there is replaced once the new one is whole.

    A link keeps leading to its file, which is replaced.

    Parameters
    ----------
    path : path-like
        Of the file.
    thing : object
        A model, a solution, a problem, a body, a law, or numbers, strings, arrays, lists, tuples and
        dictionaries of them. The dense output of a solution is not written and is None when it comes back:
        save the `Trajectory` that it gives at the times needed. Callables are not written.

    Raises
    ------
    somersault.errors.WriteError
        If a part of it cannot be written, the message says which; or if `path` is one of a directory or a
        device.
    somersault.InputError
        If `path` is no path.
    OSError
        If the system does not let the file be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> import somersault
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "run.som"
    >>> somersault.save(path, {"body": somersault.RigidBody.sphere(1.0, 0.1), "t": np.arange(3.0)})
    >>> path.exists()
    True
    """
    place = _path(path)
    arrays: list[NDArray[Any]] = []

    def keep(array: NDArray[Any]) -> int:
        arrays.append(array)
        return len(arrays) - 1

    header = {
        "format": "somersault",
        "format_version": FORMAT_VERSION,
        "version": _somersault.__version__,
        "content": encode(thing, keep),
    }
    members = {_HEADER: json.dumps(header, allow_nan=False).encode()}
    for i, array in enumerate(arrays):
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, array, allow_pickle=False)
        members[f"{i}.npy"] = buffer.getvalue()
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        for name, content in members.items():
            file.writestr(zipfile.ZipInfo(name, _WRITTEN), content)
    write_bytes(place, archive.getvalue())


def load(path: str | PathLike[str]) -> Any:
    """Reads a file that `save` has written.

    Parameters
    ----------
    path : path-like
        Of the file.

    Returns
    -------
    object
        What was saved.

    Raises
    ------
    somersault.errors.ReadError
        If the file is not one that `save` has written, is corrupt or was written by a later version.
    somersault.InputError
        If `path` is no path.
    OSError
        If the system does not let the file be read, such as FileNotFoundError.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import somersault
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "run.som"
    >>> somersault.save(path, {"body": somersault.RigidBody.sphere(5.0, 0.5), "start": (0.0, 3.1)})
    >>> somersault.load(path)
    {'body': RigidBody(mass=5.0, inertia=[0.5, 0.5, 0.5]), 'start': (0.0, 3.1)}
    """
    place = _path(path)
    content = place.read_bytes()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            header = json.loads(_member(file, _HEADER))
            _check(header)
            return decode(header["content"], lambda member: _array(_member(file, f"{member}.npy")))
    except ReadError as fault:
        raise ReadError(f"{place}: {fault}") from None
    except Exception as fault:
        # Whatever reading raises on bytes that `save` has not written, deep nesting and lack of memory
        # among it.
        reason = str(fault) or type(fault).__name__
        raise ReadError(f"{place} is not a somersault file, or is corrupt: {reason}") from fault


def _path(path: object) -> Path:
    if not isinstance(path, str | PathLike):
        raise InputError(f"`path` must be a path, found {path!r:.80}")
    return Path(path)


def _member(file: zipfile.ZipFile, name: str) -> bytes:
    """A member of the archive, which is no larger than the file since `save` does not compress."""
    if file.getinfo(name).compress_type != zipfile.ZIP_STORED:
        raise ReadError(f"{name} is compressed, which somersault files are not")
    return file.read(name)


def _array(content: bytes) -> NDArray[Any]:
    """An array whose bytes are as many as its shape says."""
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    for more in reversed(range(100)):
        stream = io.BytesIO(content)
        reader = readers[np.lib.format.read_magic(stream)]
        try:
            shape, by_columns, dtype = reader(stream)
            break
        except SystemError:
            # Threads that parse at once disturb one another in Python 3.11 (its issue 106905).
            if not more:
                raise
    data = stream.read()
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(data):
        raise ReadError(f"an array of shape {shape} and type {dtype} has {len(data)} bytes")
    if not data:
        return np.empty(shape, dtype)
    return np.frombuffer(data, dtype).reshape(shape, order="F" if by_columns else "C").copy()


def _check(header: Any) -> None:
    if not isinstance(header, dict) or header.get("format") != "somersault":
        raise ReadError("the header is not one of somersault")
    version = header.get("format_version")
    if not isinstance(version, int) or not 1 <= version <= FORMAT_VERSION:
        raise ReadError(
            f"written in format {version} by somersault {header.get('version')}; this version reads formats"
            f" up to {FORMAT_VERSION}"
        )


def write_bytes(path: Path, content: bytes) -> None:
    """Writes a file that is there whole or not at all, in the place of a link the file that it leads to.

    Raises
    ------
    somersault.errors.WriteError
        If what is there is no file: a directory or a device.
    TypeError
        If the content is no bytes.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from somersault import storage
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "notes.txt"
    >>> storage.write_bytes(path, b"a whole file or none")
    >>> path.read_text()
    'a whole file or none'
    """
    if not isinstance(content, bytes):
        raise TypeError(f"`content` must be bytes, found {type(content).__name__}")
    # what would be replaced is the link
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        raise WriteError(f"{path} is not a file that can be replaced")
    whole = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        whole.write_bytes(content)
        with contextlib.suppress(FileNotFoundError):
            shutil.copymode(path, whole)
        whole.replace(path)
    except BaseException as fault:
        whole.unlink(missing_ok=True)
        if isinstance(fault, OSError):
            fault.filename = str(path)  # the caller does not know the file that would have replaced it
        raise


def encode(thing: Any, array: Callable[[NDArray[Any]], Any], where: str = "the value") -> Any:
    """What stands for a thing in JSON; `array` returns what stands for an array.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import storage
    >>> arrays = []
    >>> def keep(array):
    ...     arrays.append(array)
    ...     return len(arrays) - 1
    >>> storage.encode({"start": (0.0, float("inf")), "t": np.arange(3.0)}, keep)
    {'start': {'$tuple': [0.0, {'$float': 'inf'}]}, 't': {'$array': 0}}
    """
    if thing is None or isinstance(thing, (bool, str)):
        return thing
    if isinstance(thing, np.generic):
        return encode(thing.item(), array, where)
    if isinstance(thing, int):
        return int(thing)
    if isinstance(thing, float):
        return float(thing) if math.isfinite(thing) else {"$float": repr(float(thing))}
    if isinstance(thing, np.ndarray):
        if thing.dtype.kind not in "biufcU":
            raise WriteError(
                f"{where} is an array of {thing.dtype}; those of numbers and strings can be written"
            )
        return {"$array": array(thing)}
    if type(thing) is tuple:
        return {"$tuple": [encode(item, array, f"{where}[{i}]") for i, item in enumerate(thing)]}
    if isinstance(thing, list):
        return [encode(item, array, f"{where}[{i}]") for i, item in enumerate(thing)]
    if isinstance(thing, dict):
        return _encode_dictionary(thing, array, where)
    return _encode_object(thing, array, where)


def _encode_dictionary(thing: dict[Any, Any], array: Callable[[NDArray[Any]], Any], where: str) -> Any:
    if all(isinstance(key, str) and not key.startswith("$") for key in thing):
        return {key: encode(value, array, f"{where}[{key!r}]") for key, value in thing.items()}
    return {
        "$items": [
            [encode(key, array, f"a key of {where}"), encode(value, array, f"{where}[{key!r}]")]
            for key, value in thing.items()
        ]
    }


def _encode_object(thing: Any, array: Callable[[NDArray[Any]], Any], where: str) -> Any:
    from scipy.spatial.transform import Rotation

    if isinstance(thing, Rotation):
        return {"$rotation": encode(thing.as_quat(), array, where)}
    kind = type(thing)
    try:
        maker, arguments = thing.__reduce__()[:2]
        name = _name(maker)
    except (TypeError, ValueError, AttributeError) as fault:
        # What forbids its pickling says why.
        reason = f": {fault}" if isinstance(fault, TypeError) else ""
        raise WriteError(
            f"{where} is a {kind.__module__}.{kind.__qualname__}, which cannot be written{reason}"
        ) from None
    return {
        "$object": name,
        "arguments": [encode(item, array, f"{where}: argument {i}") for i, item in enumerate(arguments)],
    }


def _name(maker: Any) -> str:
    """The name under which the extension has what makes an object."""
    owner = getattr(maker, "__self__", None)
    name = f"{owner.__name__}.{maker.__name__}" if isinstance(owner, type) else str(maker.__name__)
    if _maker(name) != maker:
        raise ValueError(name)
    return name


def _maker(name: str) -> Any:
    """What makes objects of a name: only types and tables of the extension, and the one class of
    results that is written in Python, is ever called."""
    if name in ("method", "methods"):
        return _EXTENSION[name]
    if name == "ArmExtremal":
        from somersault.ftla import ArmExtremal

        return ArmExtremal
    kind, _, restore = name.partition(".")
    found = _EXTENSION.get(kind)
    if not isinstance(found, type) or restore not in ("", "_restore"):
        raise ValueError(name)
    return getattr(found, restore) if restore else found


def decode(tree: Any, array: Callable[[Any], NDArray[Any]]) -> Any:
    """The thing that a tree stands for; `array` returns the array that was asked to be held.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import storage
    >>> storage.decode({"start": {"$tuple": [0.0, 3.1]}, "t": {"$array": 0}}, lambda i: np.arange(3.0))
    {'start': (0.0, 3.1), 't': array([0., 1., 2.])}
    """
    if isinstance(tree, list):
        return [decode(item, array) for item in tree]
    if not isinstance(tree, dict):
        return tree
    kind = next((key for key in tree if key.startswith("$")), None)
    content: Any = tree[kind] if kind else None
    match kind:
        case None:
            return {key: decode(value, array) for key, value in tree.items()}
        case "$float":
            return float(content)
        case "$array":
            return array(content)
        case "$tuple":
            return tuple(decode(item, array) for item in content)
        case "$items":
            return {decode(key, array): decode(value, array) for key, value in content}
        case "$rotation":
            from scipy.spatial.transform import Rotation

            return Rotation.from_quat(decode(content, array))
        case "$object":
            return _make(content, [decode(item, array) for item in tree["arguments"]])
        case _:
            raise ReadError(f"what is {kind} is not known to this version")


def _make(name: str, arguments: list[Any]) -> Any:
    try:
        maker = _maker(name)
    except ValueError:
        raise ReadError(f"objects of the kind {name!r} are not known to this version") from None
    try:
        return maker(*arguments)
    except InputError as fault:
        raise ReadError(f"the {name.partition('.')[0]} in it is not allowed: {fault}") from fault
