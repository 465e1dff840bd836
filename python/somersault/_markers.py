"""Markers of a model in given motions, and recordings filtered."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault._somersault.motion import MarkerRecording, MarkerSet
from somersault.errors import InputError

Array = NDArray[np.float64]

#: By how much the distances of frames may differ for a filter, relative.
_UNIFORM = 1e-6
#: The lowest cutoff, as a fraction of the rate of frames: below, the poles of the sections are 1 to rounding.
_LEAST = 1e-5
#: Orders beyond it are no filters of movements.
_MOST_ORDER = 20


def place_markers(
    markers: MarkerSet, times: ArrayLike, q: ArrayLike, *, scale: ArrayLike = 1.0
) -> MarkerRecording:
    """Where the markers of a model are in a motion: a recording without noise and gaps.

    x = r + s d(q), with the place r of the root, which is not scaled, as `MarkerFit` has it.

    Parameters
    ----------
    markers : MarkerSet
        The markers, and their model.
    times : array_like, shape (n,)
        Times, s, rising.
    q : array_like, shape (n, n_positions)
        Configurations of the model.
    scale : float or array_like, shape (n,), optional
        Size over that of the model.

    Returns
    -------
    MarkerRecording

    Raises
    ------
    InputError
        If `scale` is not positive, or has another shape than the frames.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import motion, multibody
    >>> arm = multibody.two_link_arm(lengths=(1.0, 0.5))
    >>> markers = motion.MarkerSet(arm, {"hand": ("lower", (0.5, 0, 0))})
    >>> motion.place_markers(markers, [0.0, 0.1], [[0.0, 0.0], [np.pi / 2, 0.0]]).track("hand").round(6)
    array([[1.5, 0. , 0. ],
           [0. , 1.5, 0. ]])
    """
    if not isinstance(markers, MarkerSet):
        raise TypeError(f"`markers` must be a MarkerSet, found {type(markers).__name__}")
    model = markers.model
    size = _sizes(scale)
    try:
        rows = np.atleast_2d(np.asarray(q, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(f"`q` must be real numbers of shape (n, n_positions), found {q!r}") from None
    poses = np.asarray(model.poses(rows))
    if np.shape(times) != (len(poses),):
        raise InputError(f"`times` must be of shape ({len(poses)},), found shape {np.shape(times)}")
    bodies = poses[:, [model.body(name) for name in markers.bodies]]
    root = poses[:, :1, :3, 3]
    away = np.einsum("nkij,kj->nki", bodies[..., :3, :3], markers.points) + bodies[..., :3, 3] - root
    if size.shape not in ((), (len(poses),)):
        raise InputError(f"`scale` must be a number or of shape ({len(poses)},), found shape {size.shape}")
    size = np.broadcast_to(size, (len(poses),))
    return MarkerRecording(list(markers.names), times, root + size[:, None, None] * away)


def _sizes(scale: ArrayLike) -> Array:
    """Finite positive numbers."""
    try:
        size = np.asarray(scale, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"`scale` must be a number or numbers, found {scale!r}") from None
    if not (np.isfinite(size).all() and (size > 0.0).all()):
        raise InputError(f"`scale` must be finite and positive, found {scale!r}")
    return size


def low_pass(recording: MarkerRecording, cutoff: float, *, order: int = 4) -> MarkerRecording:
    """A recording without what is faster than a frequency: a Butterworth filter, forwards and backwards.

    The two passes leave no lag. Half of the order is taken in each, and each pass begins to cut higher, by
    (√2 − 1)^(−1/order), so that both together have 1/√2 of the amplitude at `cutoff`. Every unbroken stretch
    of a marker is filtered by itself; gaps stay. By SciPy's `butter` and `sosfiltfilt`.

    Parameters
    ----------
    recording : MarkerRecording
        With frames at equal distances in time; `resample` makes them so.
    cutoff : float
        Hz, between 10⁻⁵ and half of the rate of frames.
    order : int, optional
        Of both passes together, even, at most 20.

    Returns
    -------
    MarkerRecording

    Raises
    ------
    InputError
        If frames are not at equal distances, or `cutoff` or `order` are not allowed.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import motion
    >>> t = np.arange(200) / 100.0
    >>> slow, fast = np.sin(2 * np.pi * t), 0.1 * np.sin(2 * np.pi * 30.0 * t)
    >>> points = np.column_stack([slow + fast, 0.0 * t, 0.0 * t])[:, None]
    >>> smooth = motion.low_pass(motion.MarkerRecording(["hip"], t, points), 10.0).points[:, 0, 0]
    >>> bool(abs(smooth - slow)[20:-20].max() < 0.01)
    True
    """
    # the largest part of the time that importing the package would take
    from scipy import signal

    if not isinstance(recording, MarkerRecording):
        raise TypeError(f"`recording` must be a MarkerRecording, found {type(recording).__name__}")
    times = np.asarray(recording.times)
    steps = np.diff(times)
    if len(steps) == 0 or np.ptp(steps) > _UNIFORM * steps.mean():
        raise InputError("`recording` must have frames at equal distances in time; `resample` it before")
    rate = 1.0 / float(steps.mean())
    least, most = _LEAST * rate, 0.5 * rate
    if isinstance(cutoff, bool) or not isinstance(cutoff, Real) or not least <= cutoff < most:
        raise InputError(
            f"`cutoff` must be between {least:g} and {most:g} Hz, half of the rate of frames, "
            f"found {cutoff!r}"
        )
    if (
        isinstance(order, bool)
        or not isinstance(order, Integral)
        or order % 2
        or not 2 <= order <= _MOST_ORDER
    ):
        raise InputError(f"`order` must be an even number between 2 and {_MOST_ORDER}, found {order!r}")
    cutoff, order = float(cutoff), int(order)
    # where one pass has its own 1/√2, with the frequencies of the bilinear transform
    warped = np.tan(np.pi * cutoff / rate) / (np.sqrt(2.0) - 1.0) ** (1.0 / order)
    sections = signal.butter(order // 2, 2.0 * np.arctan(warped) / np.pi, output="sos")
    points, present = np.array(recording.points), np.asarray(recording.present)
    for k in range(recording.n_markers):
        for stretch in _stretches(present[:, k]):
            room = min(3 * (2 * len(sections) + 1), stretch.stop - stretch.start - 1)
            points[stretch, k] = signal.sosfiltfilt(sections, points[stretch, k], axis=0, padlen=room)
    return MarkerRecording(list(recording.names), times, points, present)


def _stretches(present: NDArray[np.bool_]) -> list[slice]:
    """Where a marker is there without a break."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], present, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
