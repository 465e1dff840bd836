"""What of a motion the viewer draws: poses at times, the centre of mass, momentum, rate and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from somersault._somersault.integrators import RigidBody, Trajectory
from somersault._somersault.multibody import Model, TreeSolution
from somersault.errors import InputError
from somersault.viewer.shapes import numbers

__all__ = ["Moving", "Touch", "Track", "touch", "track"]

Array = NDArray[np.float64]
Moving: TypeAlias = Model | RigidBody | Trajectory | TreeSolution

#: Samples are made or left out to be about this far apart, s, and not farther than this turn, rad.
_INTERVAL, _TURN = 1 / 60, 0.3
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
    """A point of a body, and the forces on it at times of its own."""

    body: int
    point: Array
    t: Array
    forces: Array


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


def track(moving: Moving, t: ArrayLike | None, q: ArrayLike | None, v: ArrayLike | None) -> Track:
    """The motion as it is drawn. See `Scene.add`."""
    if isinstance(moving, Trajectory | TreeSolution):
        if t is not None or q is not None or v is not None:
            raise InputError("`t`, `q` and `v` must not be given beside a solution, which has them")
        return _of_trajectory(moving) if isinstance(moving, Trajectory) else _of_solution(moving)
    if not isinstance(moving, Model | RigidBody):
        raise InputError(
            "`moving` must be a Model, a RigidBody, or a solution or trajectory of these, found a"
            f" {type(moving).__name__}"
        )
    if t is None or q is None:
        raise InputError("`t` and `q` must be given beside a Model or a RigidBody")
    moments = times(t)
    if isinstance(moving, RigidBody):
        return _of_body(moving, moments, q, v)
    position = rows("q", q, len(moments), moving.n_positions)
    velocity = None if v is None else rows("v", v, len(moments), moving.n_velocities)
    return _of_tree(moving, moments, position, velocity)


def touch(moving: Moving, t: ArrayLike | None, body: int, point: Array, forces: ArrayLike) -> Touch:
    """A contact with those of its samples that are enough. See `Scene.add`."""
    # `track` has found these to be times.
    moments = np.asarray(moving.t if isinstance(moving, Trajectory | TreeSolution) else t, dtype=np.float64)
    found = rows("contacts", forces, len(moments), 3)
    # Contacts may be shorter than the steps between poses: what begins, ends or jumps is kept on both sides.
    begun = np.diff(found.any(axis=1))
    change = np.linalg.norm(np.diff(found, axis=0), axis=1)
    share = _CHANGE * np.linalg.norm(found, axis=1).max() or 1.0
    stepped = begun | (np.diff(np.floor(np.cumsum(change) / share), prepend=0.0) > 0.0)
    kept = np.flatnonzero(np.append(stepped, True) | np.append(True, stepped))
    if len(kept) > _LIMIT:
        raise InputError(
            f"`contacts` change too often for a page, which would need {len(kept)} samples of a force and has"
            f" at most {_LIMIT}; add a part of the motion"
        )
    return Touch(body, point, moments[kept], found[kept])


def _of_solution(solution: TreeSolution) -> Track:
    t = times(solution.t)
    if solution.sol is None:
        return _of_tree(solution.model, t, solution.q, solution.v)
    n = int(np.clip((t[-1] - t[0]) / _INTERVAL, len(t), _LARGEST)) + 1
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
    pieces = np.maximum(np.ceil(np.diff(t) / _INTERVAL), np.ceil(turned / _TURN))
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
    interval = max((t[-1] - t[0]) / _LARGEST, min(_INTERVAL, (t[-1] - t[0]) / 200))
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


def _of_trajectory(trajectory: Trajectory) -> Track:
    t = times(trajectory.t)
    sol = getattr(trajectory, "sol", None)
    seen: Any = trajectory
    if sol is not None and len(t) > 1:
        n = int(np.clip((t[-1] - t[0]) / _INTERVAL, 10 * len(t), _LARGEST)) + 1
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
