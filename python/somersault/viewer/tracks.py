"""What of a motion the viewer draws: poses at times, the centre of mass, momentum, rate and contacts.

A pose that is not known, of a marker that was not seen, is not a number and not drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from somersault._somersault.integrators import RigidBody, Trajectory
from somersault._somersault.motion import MarkerRecording
from somersault._somersault.multibody import Model, TreeSolution
from somersault.errors import InputError
from somersault.viewer.results import FINE, Subject
from somersault.viewer.shapes import numbers

__all__ = ["Touch", "Track", "touch", "track"]

Array = NDArray[np.float64]

#: Samples are not farther apart than this turn, rad.
_TURN = 0.3
#: Samples of a motion that turns little, at most, and of any.
_LARGEST, _LIMIT = 6000, 50_000
#: Samples of a force are left out where it changes by less than this fraction of the largest.
_CHANGE = 0.01


@dataclass(frozen=True)
class Track:
    """A motion at samples. Poses are position and quaternion (x, y, z, w)."""

    names: tuple[str, ...]
    t: Array
    poses: Array
    center: Array
    momentum: Array | None
    rate: Array | None


@dataclass(frozen=True)
class Touch:
    """A point of a body, and the forces on it at times of its own.

    What touches may be away from the point, as under the centre of a ball, by `offsets` in world axes.
    """

    body: int
    point: Array
    t: Array
    forces: Array
    offsets: Array | None = None


def times(t: ArrayLike) -> Array:
    """Times, finite and rising."""
    found = numbers("t", t, (None,))
    if len(found) == 0:
        raise InputError("`t` must have a time at least, found none")
    step = np.diff(found)
    if not (step > 0.0).all():
        k = int(np.argmin(step > 0.0))
        raise InputError(f"`t` must rise from one to the next, found {found[k]:g} and then {found[k + 1]:g}")
    return found


def rows(name: str, value: ArrayLike, n: int, width: int) -> Array:
    """A row of numbers for each time."""
    found = numbers(name, value, (None, width))
    if len(found) != n:
        raise InputError(f"`{name}` must have a row for each of the {n} times, found {len(found)}")
    return found


def track(subject: Subject) -> Track:
    """The motion as it is drawn. See `Scene.add`."""
    match subject.source:
        case Trajectory():
            return _of_trajectory(subject.source)
        case TreeSolution():
            return _of_solution(subject.source)
        case MarkerRecording():
            return _of_markers(subject.source)
    model, t, q, v = subject.source, times(subject.t), subject.q, subject.v
    if isinstance(model, RigidBody):
        return _of_body(model, t, q, v)
    position = rows("q", q, len(t), model.n_positions)
    velocity = None if v is None else rows("v", v, len(t), model.n_velocities)
    return _of_tree(model, t, position, velocity)


def touch(body: int, point: Array, t: Array, forces: ArrayLike, offsets: Array | None = None) -> Touch:
    """A contact with those of its samples that are enough. See `Scene.add`."""
    found = rows("contacts", forces, len(t), 3)
    # Contacts may be shorter than the steps between poses: what begins, ends or jumps is kept on both sides.
    stepped = np.diff(found.any(axis=1)) | _steps(found)
    if offsets is not None:
        stepped |= _steps(offsets)
    kept = np.flatnonzero(np.append(stepped, True) | np.append(True, stepped))
    if len(kept) > _LIMIT:
        raise InputError(
            f"`contacts` change too often for a page, which would need {len(kept)} samples of a force and has"
            f" at most {_LIMIT}; add a part of the motion"
        )
    return Touch(body, point, t[kept], found[kept], None if offsets is None else offsets[kept])


def _steps(vectors: Array) -> NDArray[np.bool_]:
    """Where they have changed by a fraction of the largest since it was last so."""
    change = np.linalg.norm(np.diff(vectors, axis=0), axis=1)
    share = _CHANGE * np.linalg.norm(vectors, axis=1).max() or 1.0
    stepped: NDArray[np.bool_] = np.diff(np.floor(np.cumsum(change) / share), prepend=0.0) > 0.0
    return stepped


def _of_solution(solution: TreeSolution) -> Track:
    # in the order of time, where it was found backwards
    order = slice(None, None, -1 if len(solution.t) > 1 and solution.t[-1] < solution.t[0] else 1)
    t = times(solution.t[order])
    if solution.sol is None:
        return _of_tree(solution.model, t, solution.q[order], solution.v[order])
    n = int(np.clip((t[-1] - t[0]) / FINE, len(t), _LARGEST)) + 1
    moments = np.linspace(solution.sol.t_min, solution.sol.t_max, n) if len(t) > 1 else t
    return _of_tree(solution.model, moments, *solution.sol(moments))


def _of_tree(model: Model, t: Array, q: Array, v: Array | None) -> Track:
    q = model.normalize(q)
    moments, center = t, np.asarray(model.center_of_mass(q))
    t, q, v = _refined(model, t, q, v)
    poses, drawn = _from_matrices(model.poses(q)), np.asarray(model.center_of_mass(q))
    if model.links[0].joint in ("free", "planar"):
        # Between samples the root goes about the centre of mass, and not the centre about the root.
        steady = np.column_stack([np.interp(t, moments, axis) for axis in center.T])
        poses[..., :3] += (steady - drawn)[:, None]
        drawn = steady
    kept = _thinned(t, poses)
    t, q, poses, drawn = t[kept], q[kept], poses[kept], drawn[kept]
    momentum = rate = None
    if v is not None:
        momentum = np.asarray(model.centroidal_momentum(q, v[kept]))[:, 3:]
        rate = _mean_rate(model, q, momentum)
    return Track(tuple(model.names), t, poses, drawn, momentum, rate)


def _refined(model: Model, t: Array, q: Array, v: Array | None) -> tuple[Array, Array, Array | None]:
    """With samples between those that are far apart, reached at constant rates of the joints."""
    if len(t) < 2:
        return t, q, v
    way = np.asarray(model.difference(q[:-1], q[1:]))
    turned = np.abs(way).max(axis=1, initial=0.0)
    pieces = np.maximum(np.ceil(np.diff(t) / FINE), np.ceil(turned / _TURN))
    room = max(1.0, _LARGEST / len(t))
    pieces = np.clip(pieces, 1, room).astype(np.intp)
    at = np.repeat(np.arange(len(pieces)), pieces)
    first = np.concatenate([[0], np.cumsum(pieces)[:-1]])
    s = (np.arange(len(at)) - first[at]) / pieces[at]
    between = np.asarray(model.displace(q[at], s[:, None] * way[at]))
    moments = np.append(t[at] + s * np.diff(t)[at], t[-1])
    rates = None if v is None else np.vstack([v[at] + s[:, None] * np.diff(v, axis=0)[at], v[-1:]])
    return moments, np.vstack([between, q[-1:]]), rates


def _from_matrices(poses: Any) -> Array:
    matrices = np.asarray(poses, dtype=np.float64)
    quaternions = Rotation.from_matrix(matrices[..., :3, :3].reshape(-1, 3, 3)).as_quat()
    return np.concatenate([matrices[..., :3, 3], quaternions.reshape(*matrices.shape[:2], 4)], axis=-1)


def _thinned(t: Array, poses: Array) -> NDArray[np.intp]:
    """Samples that are enough: dense ones are left out where little time passes and nothing turns much."""
    if len(t) < 3:
        return np.arange(len(t))
    quaternion = poses[..., 3:]
    cosine = np.abs(np.sum(quaternion[1:] * quaternion[:-1], axis=-1))
    turned = 2.0 * np.arccos(np.minimum(cosine, 1.0)).max(axis=1)
    interval = max((t[-1] - t[0]) / _LARGEST, min(FINE, (t[-1] - t[0]) / 200))
    measure = np.floor(np.concatenate([[0.0], np.cumsum(np.diff(t) / interval + turned / _TURN)]))
    if measure[-1] > _LIMIT:
        raise InputError(
            f"the motion turns too often for a page, which would need {measure[-1]:.0f} samples of it and"
            f" has at most {_LIMIT}; add a part of it"
        )
    kept = np.concatenate([[True], np.diff(measure) > 0.0])
    kept[-1] = True
    return np.flatnonzero(kept)


def _mean_rate(model: Model, q: Array, momentum: Array) -> Array:
    """The angular velocity with which the tree, its joints locked, would have its angular momentum."""
    matrices = np.asarray(model.poses(q))
    center = np.asarray(model.center_of_mass(q))
    total = np.zeros((len(q), 3, 3))
    for i, link in enumerate(model.links):
        turn = matrices[:, i, :3, :3]
        d = turn @ np.asarray(link.center) + matrices[:, i, :3, 3] - center
        square = np.einsum("ni,ni->n", d, d)[:, None, None] * np.eye(3)
        total += turn @ np.asarray(link.inertia) @ turn.transpose(0, 2, 1)
        total += link.mass * (square - d[:, :, None] * d[:, None, :])
    # Point masses on a line do not resist about it.
    rate: Array = np.einsum("nij,nj->ni", np.linalg.pinv(total, hermitian=True, rcond=1e-10), momentum)
    return rate


def _of_body(body: RigidBody, t: Array, q: ArrayLike, v: ArrayLike | None) -> Track:
    pose = rows("q", q, len(t), 7)
    if not np.linalg.norm(pose[:, 3:], axis=1).all():
        raise InputError("`q` must have quaternions in its columns 4 to 7, found one of zeros")
    turn = Rotation.from_quat(pose[:, 3:])
    poses = np.column_stack([pose[:, :3], turn.as_quat()])[:, None, :]
    momentum = rate = None
    kept = _thinned(t, poses)
    if v is not None:
        rate = rows("v", v, len(t), 6)[:, 3:]
        momentum = turn.apply(turn.apply(rate, inverse=True) @ np.asarray(body.inertia))[kept]
        rate = rate[kept]
    return Track(("body",), t[kept], poses[kept], pose[kept, :3], momentum, rate)


def _of_markers(recording: MarkerRecording) -> Track:
    t = times(recording.times)
    points = np.where(recording.present[..., None], recording.points, np.nan)
    turns = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*points.shape[:2], 4))
    seen = np.flatnonzero(recording.present.any(axis=1))
    if len(seen) == 0:
        raise InputError("`moving` must have a marker that is there at some time, found a recording without")
    middle = np.nanmean(points[seen], axis=1)
    center = np.column_stack([np.interp(t, t[seen], axis) for axis in middle.T])
    poses = np.concatenate([points, turns], axis=-1)
    return Track(tuple(recording.names), t, poses, center, None, None)


def _forwards(trajectory: Trajectory) -> Trajectory:
    """The same motion in the order of time, where it was found backwards."""
    if len(trajectory) < 2 or trajectory.t[0] < trajectory.t[-1]:
        return trajectory
    rows = (trajectory.position, trajectory.quaternion, trajectory.velocity, trajectory.angular_velocity)
    return Trajectory(trajectory.body, trajectory.t[::-1], *(row[::-1] for row in rows))


def _of_trajectory(trajectory: Trajectory) -> Track:
    sol = getattr(trajectory, "sol", None)
    seen: Any = _forwards(trajectory)
    t = times(seen.t)
    if sol is not None and len(t) > 1:
        n = int(np.clip((t[-1] - t[0]) / FINE, 10 * len(t), _LARGEST)) + 1
        t = np.linspace(sol.t_min, sol.t_max, n)
        seen = sol(t)
    shape = (len(t), -1, 3)
    position = np.asarray(seen.position).reshape(shape)
    poses = np.concatenate([position, np.asarray(seen.quaternion).reshape(len(t), -1, 4)], axis=-1)
    if not np.isfinite(poses).all():
        raise InputError("`moving` must be finite, found a trajectory that is not")
    bodies = trajectory.body if isinstance(trajectory.body, list) else [trajectory.body]
    mass = np.array([body.mass for body in bodies])
    center = np.einsum("k,nki->ni", mass / mass.sum(), position)
    spin = np.asarray(seen.angular_momentum).reshape(shape)
    velocity = np.asarray(seen.velocity).reshape(shape)
    momentum = (spin + np.cross(position - center[:, None], mass[:, None] * velocity)).sum(axis=1)
    rate = np.asarray(seen.angular_velocity).reshape(shape)
    names = ("body",) if len(bodies) == 1 else tuple(f"body_{k}" for k in range(len(bodies)))
    kept = _thinned(t, poses)
    # Several bodies have no angular velocity in common.
    common = rate[kept, 0] if len(bodies) == 1 else None
    return Track(names, t[kept], poses[kept], center[kept], momentum[kept], common)
