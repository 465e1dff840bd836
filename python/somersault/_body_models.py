"""Motions of the body model SMPL and its relatives, as the collection AMASS has them."""

from __future__ import annotations

import io
import math
import tokenize
import zipfile
import zlib
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import ArrayLike, NDArray

from somersault._somersault.motion import Skeleton, SkeletonJoint, SkeletonRecording
from somersault.errors import InputError, ReadError

Array = NDArray[np.float64]

#: The joints of the body that SMPL, SMPL+H and SMPL-X have in common, with the number of the parent.
_JOINTS = (
    ("pelvis", None),
    ("left_hip", 0),
    ("right_hip", 0),
    ("spine1", 0),
    ("left_knee", 1),
    ("right_knee", 2),
    ("spine2", 3),
    ("left_ankle", 4),
    ("right_ankle", 5),
    ("spine3", 6),
    ("left_foot", 7),
    ("right_foot", 8),
    ("neck", 9),
    ("left_collar", 9),
    ("right_collar", 9),
    ("head", 12),
    ("left_shoulder", 13),
    ("right_shoulder", 14),
    ("left_elbow", 16),
    ("right_elbow", 17),
    ("left_wrist", 18),
    ("right_wrist", 19),
)
_RATES = ("mocap_framerate", "mocap_frame_rate")


def read_amass(source: str | PathLike[str], body: ArrayLike | str | PathLike[str]) -> SkeletonRecording:
    """Reads a motion of AMASS: a file ``.npz`` with ``poses``, ``trans`` and the rate.

    The file has rotations and no lengths: joints are where the body at rest has them, which the model says,
    SMPL, SMPL+H or SMPL-X. It has its own licence, so the user must obtain it. The 22 joints that
    these models have in common are read; hands, jaw and eyes are left out.

    Rotation k turns joint k against its parent, R = exp(poses[3 k : 3 k + 3]); the pelvis is at J₀ + trans.
    AMASS has z up.

    Parameters
    ----------
    source : path
    body : array_like, shape (n, 3) with n at least 22, or path
        Joints of the body at rest, m, in the order of the model; or a file ``.npz`` with ``J``, or with
        ``J_regressor`` and ``v_template`` as the model has them.

    Returns
    -------
    SkeletonRecording

    Raises
    ------
    ReadError
        If a file is not such a file, or lacks an array; the message names it.
    InputError
        If the joints are not finite numbers of that shape.
    OSError
        If a file cannot be opened.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from somersault import motion
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "stand.npz"
    >>> np.savez(path, poses=np.zeros((2, 156)), trans=np.full((2, 3), 0.9), mocap_framerate=120.0)
    >>> rest = np.random.default_rng(0).normal(size=(22, 3))
    >>> motion.read_amass(path, rest)
    <SkeletonRecording: 22 joints, 2 frames, 0.008 s>
    """
    rest = _rest(body)
    path = Path(source)
    with _opened(path) as file:
        names = _names(file)
        rate = next((_array(path, file, name, ()) for name in _RATES if name in names), None)
        if rate is None:
            found = ", ".join(names) or "no array"
            raise ReadError(f"{path}: `mocap_framerate` or `mocap_frame_rate` is needed, found {found}")
        if not (np.isfinite(rate) and rate > 0.0):
            raise ReadError(f"{path}: the rate must be positive and finite, found {rate}")
        trans = _array(path, file, "trans", (None, 3))
        if "poses" in names:
            poses = _array(path, file, "poses", (len(trans), None))
        else:
            parts = [_array(path, file, name, (len(trans), None)) for name in ("root_orient", "pose_body")]
            poses = np.hstack(parts)
    n = len(_JOINTS)
    if len(trans) == 0:
        raise ReadError(f"{path}: at least one frame is needed, found none")
    if poses.shape[1] < 3 * n:
        raise ReadError(f"{path}: `poses` must have at least {3 * n} numbers a frame, found {poses.shape[1]}")
    turns = poses[:, : 3 * n].reshape(-1, 3)
    for name, values in (("poses", turns), ("trans", trans)):
        if not np.isfinite(values).all():
            raise ReadError(f"{path}: `{name}` must be finite")
    # Imported where it is used, since the package is imported with little beyond NumPy.
    from scipy.spatial.transform import Rotation

    rotations = Rotation.from_rotvec(turns).as_quat().reshape(len(trans), n, 4)
    joints = [
        SkeletonJoint(name, parent, rest[k] - (0.0 if parent is None else rest[parent]), moves=parent is None)
        for k, (name, parent) in enumerate(_JOINTS)
    ]
    places = (rest[0] + trans)[:, None, :]
    return SkeletonRecording(Skeleton(joints), np.arange(len(trans)) / float(rate), rotations, places)


def _rest(body: ArrayLike | str | PathLike[str]) -> Array:
    """The joints at rest."""
    n = len(_JOINTS)
    found: Any = body
    if isinstance(body, str | PathLike):
        path = Path(body)
        with _opened(path) as file:
            if "J" in _names(file):
                found = _array(path, file, "J", (None, 3))
            else:
                regressor = _array(path, file, "J_regressor", (None, None))
                found = regressor @ _array(path, file, "v_template", (regressor.shape[1], 3))
    try:
        rest = np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"`body` must be numbers of shape (n, 3) or a path, found {body!r}") from None
    if rest.ndim != 2 or rest.shape[1] != 3 or len(rest) < n or not np.isfinite(rest).all():
        needed = f"finite numbers of shape (n, 3), n at least {n}"
        raise InputError(f"`body` must be {needed}, found shape {rest.shape}")
    return rest


#: What NumPy and the archive raise where a file is not what it should be.
_FAULTS = (
    ValueError,
    TypeError,
    EOFError,
    KeyError,
    # a way to compress or to encrypt that the archive's reader does not know
    NotImplementedError,
    RuntimeError,
    SyntaxError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def _opened(path: Path) -> zipfile.ZipFile:
    """The archive of arrays; no array is read yet."""
    content = path.read_bytes()
    try:
        return zipfile.ZipFile(io.BytesIO(content))
    except _FAULTS as fault:
        raise ReadError(f"{path}: a file .npz of NumPy is needed: {fault}") from fault


def _names(file: zipfile.ZipFile) -> list[str]:
    return sorted(name.removesuffix(".npy") for name in file.namelist())


def _array(path: Path, file: zipfile.ZipFile, name: str, shape: tuple[int | None, ...]) -> Array:
    """An array of a file, with this shape if one is given."""
    names = _names(file)
    if name not in names:
        raise ReadError(f"{path}: `{name}` is needed, found {', '.join(names) or 'no array'}")
    try:
        content = file.read(f"{name}.npy")
        declared, size = _declared(content)
        if size != len(content):
            raise ReadError(f"{path}: `{name}` declares {size} bytes, found {len(content)}")
        values = np.asarray(np.load(io.BytesIO(content), allow_pickle=False), dtype=np.float64)
    except ReadError:
        raise
    except _FAULTS as fault:
        raise ReadError(f"{path}: `{name}` must be numbers: {fault}") from fault
    fits = len(declared) == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, declared, strict=True)
    )
    if not fits:
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise ReadError(f"{path}: `{name}` must have the shape ({wanted}), found {declared}")
    return values


def _declared(content: bytes) -> tuple[tuple[int, ...], int]:
    """The shape of an array of NumPy by its head, and the bytes that such a file has."""
    head = io.BytesIO(content)
    version = npy.read_magic(head)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, kind = read(head)
    return shape, head.tell() + math.prod(shape) * kind.itemsize
