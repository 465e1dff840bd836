"""What each result of the library is to the viewer: what moves, and its configurations at times.

`MOTIONS` has what a result is drawn as, `INSTEAD` what to add in the place of one that holds no motion of its
own. A new result belongs in one of the two, which a test of all public classes asks for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from somersault._analysis import FlightAnalysis
from somersault._arm_extremals import ArmExtremal
from somersault._somersault import contact, exact, ftla, integrators, motion, multibody, ocp
from somersault._somersault.integrators import RigidBody, Trajectory
from somersault._somersault.motion import MarkerRecording
from somersault._somersault.multibody import Link, Model, Robot, TreeSolution
from somersault.errors import InputError
from somersault.viewer.shapes import numbers

__all__ = ["FINE", "INSTEAD", "MOTIONS", "Source", "Subject", "resolve", "spaced"]

Array = NDArray[np.float64]

#: What is drawn as it is; all other results become one of these.
Source: TypeAlias = Model | RigidBody | Trajectory | TreeSolution | MarkerRecording

#: Samples are made or left out to be about this far apart, s, and of curves are at most so many.
FINE, _LARGEST = 1 / 60, 6000
#: From the head to the feet of a person in a picture, m.
_TALL = 1.7


@dataclass(frozen=True)
class Subject:
    """What moves, with its configurations at times where it does not have them itself."""

    source: Any
    t: ArrayLike = ()
    q: ArrayLike = ()
    v: ArrayLike | None = None


def resolve(
    moving: Any, t: ArrayLike | None = None, q: ArrayLike | None = None, v: ArrayLike | None = None
) -> Subject:
    """What is drawn of anything that `Scene.add` takes."""
    if isinstance(moving, Model | RigidBody | Robot):
        if t is None or q is None:
            raise InputError("`t` and `q` must be given beside a Model, a Robot or a RigidBody")
        return Subject(moving.model if isinstance(moving, Robot) else moving, t, q, v)
    if isinstance(moving, exact.FreeBody | exact.Gyrostat):
        if t is None or q is not None or v is not None:
            name = type(moving).__name__
            raise InputError(f"`t` must be given beside a {name}, and `q` and `v` must not")
        return Subject(moving(numbers("t", t, (None,))))
    found = Subject(moving)
    while not isinstance(found.source, Source):
        kind = type(found.source)
        if kind in INSTEAD:
            raise TypeError(
                f"`moving` must hold a motion, and a {kind.__name__} does not: add {INSTEAD[kind]}"
            )
        if kind not in MOTIONS:
            raise TypeError(
                "`moving` must be a Model, a Robot, a RigidBody, a recording or a result that holds a motion,"
                f" found a {kind.__name__}"
            )
        found = MOTIONS[kind](found.source)
    if t is not None or q is not None or v is not None:
        path = "; a path is given by its name, `path=`" if isinstance(t, str | PathLike) else ""
        raise InputError(
            f"`t`, `q` and `v` must not be given beside a {type(moving).__name__}, which has them{path}"
        )
    return found


def spaced(start: float, end: float, least: int = 2) -> Array:
    """Times that are close enough to be joined."""
    return np.linspace(start, end, int(np.clip((end - start) / FINE, least - 1, _LARGEST)) + 1)


def _of_curve(curve: integrators.DenseOutput) -> Subject:
    return Subject(curve(spaced(curve.t_min, curve.t_max, 200)))


def _of_states(result: ocp.Motion | ocp.LiteralDive) -> Subject:
    return Subject(result.model, result.t, result.q, result.v)


def _of_report(report: ocp.Report) -> Subject:
    if report.motion is None:
        raise TypeError("`moving` must hold a motion, and this Report does not: add the result that it is of")
    return Subject(report.motion)


def _of_dive(dive: ocp.DiveSolution) -> Subject:
    return Subject(dive.dive.diver.model, dive.t, dive.q, dive.v)


def _of_collocation(*phases: ocp.CollocationResult) -> Subject:
    """One phase, or several of one tree: each begins with what the one before it ends with."""
    model = phases[0].model
    if model is None:
        raise TypeError(
            "`moving` must be of a tree, and the equations of this CollocationResult are not: draw its curves"
        )
    times, states = [], []
    for k, phase in enumerate(phases):
        t = np.unique(np.concatenate([phase.t, spaced(phase.t[0], phase.t[-1])]))[min(k, 1) :]
        times.append(t)
        states.append(np.asarray(phase.state(t)))
    # integrals may follow
    n, m = model.n_positions, model.n_velocities
    q, v, _ = np.split(np.concatenate(states), [n, n + m], axis=1)
    return Subject(model, np.concatenate(times), q, v)


def _of_phases(found: ocp.MultiphaseResult) -> Subject:
    phases = found.phases
    if any(phase.model != phases[0].model for phase in phases[1:]):
        raise TypeError(
            "`moving` must be of one tree, and the phases of this MultiphaseResult are of several: add one of"
            " its `phases`"
        )
    return _of_collocation(*phases)


def _of_extremal(found: ftla.Extremal) -> Subject:
    model = found.system.model
    if model is None:
        raise TypeError(
            "`moving` must be of a tree, and the system of this Extremal is not: make it by `ftla.arm` or"
            " `ftla.tree`"
        )
    t = np.unique(np.concatenate([found.times, spaced(found.times[0], found.times[-1])]))
    states = np.asarray(found(t))[:, : 2 * model.n_velocities]
    coordinates, v = np.split(states, 2, axis=1)
    return Subject(model, t, _configurations(model, coordinates), v)


def _configurations(model: Model, coordinates: Array) -> Array:
    """q of the coordinates that systems of trees have, in which rotations are vectors."""
    columns = []
    for link in model.links:
        own = coordinates[:, model.velocities_of(link.name)]
        if link.joint in ("spherical", "free"):
            turn = Rotation.from_rotvec(own[:, -3:]).as_quat()
            own = np.column_stack([own[:, :-3], turn])
        columns.append(own)
    return np.column_stack(columns)


def _of_system(system: contact.ContactSystem) -> Subject:
    """The state in which it starts."""
    start = system.state
    rows = (start.position, start.quaternion, start.velocity, start.angular_velocity)
    return Subject(Trajectory(system.body, [0.0], *([row] for row in rows)))


def _of_skeleton(recording: motion.SkeletonRecording) -> Subject:
    # A recording has no mass, and pictures do not show it.
    return Subject(recording.skeleton.model(1.0), recording.times, recording.configurations)


def _of_keypoints(recording: motion.KeypointRecording) -> Subject:
    """Upright, and as tall as a person, since pictures have no unit; points in space are in m."""
    if recording.n_dims == 3:
        return Subject(recording.markers(scale=1.0))
    seen = np.where(recording.weights > 0.0, recording.points[:, :, 1], np.nan)
    tall = [np.ptp(row[np.isfinite(row)]) for row in seen if np.isfinite(row).any()]
    size = float(np.median(tall)) if tall else 0.0
    return Subject(recording.markers(scale=_TALL / size if size > 0.0 else 1.0))


def _of_fit(fit: motion.MotionFit) -> Subject:
    q = np.asarray(fit.q)
    known = np.isfinite(q).all(axis=1)
    return _of_size(fit.model, float(np.mean(fit.scale[known])), fit.times[known], q[known])


def _of_size(model: Model, size: float, times: Any, q: Any) -> Subject:
    """The motion of a tree of another size, whose places are not scaled."""
    model = _resized(model, size)
    for link in model.links:
        if link.joint == "prismatic" and link.parent is not None:
            q = q.copy()
            q[:, model.positions_of(link.name)] *= size
    return Subject(model, times, q)


def _resized(model: Model, size: float) -> Model:
    """The tree with its lengths times a number."""
    if size == 1.0:
        return model
    links = [
        Link(
            link.name,
            link.joint,
            parent=link.parent,
            axis=link.axis,
            mass=link.mass,
            center=size * link.center,
            inertia=size**2 * link.inertia,
            origin=size * link.origin,
            orientation=link.orientation,
            mimic=link.mimic,
        )
        for link in model.links
    ]
    return Model(links, gravity=model.gravity)


MOTIONS: dict[type, Callable[[Any], Subject]] = {
    contact.ContactSystem: _of_system,
    integrators.DenseOutput: _of_curve,
    ftla.ContinuationResult: lambda found: Subject(found.extremal),
    ftla.Extremal: _of_extremal,
    ArmExtremal: lambda found: Subject(found.extremal),
    motion.KeypointRecording: _of_keypoints,
    motion.MotionFit: _of_fit,
    motion.ReconstructedFlight: lambda flight: _of_size(flight.model, flight.scale, flight.times, flight.q),
    motion.ScaledModel: lambda found: Subject(found.model, found.times, found.q),
    motion.SkeletonRecording: _of_skeleton,
    motion.SmoothedMotion: lambda found: _of_size(found.model, found.scale, found.times, found.q),
    motion.WhatIf: lambda found: _of_size(found.model, found.flight.scale, found.t, found.q),
    FlightAnalysis: lambda found: Subject(found.flight),
    motion.SyntheticDive: lambda dive: Subject(dive.model, dive.times, dive.q),
    ocp.CollocationResult: _of_collocation,
    ocp.DiveSolution: _of_dive,
    ocp.LiteralDive: _of_states,
    ocp.Motion: _of_states,
    ocp.MultiphaseResult: _of_phases,
    ocp.Report: _of_report,
    ocp.SearchResult: lambda found: Subject(found.best),
}

INSTEAD: dict[type, str] = {
    contact.Event: "the Solution that it is of",
    contact.TreeContactSystem: "its `model`, with `t` and `q`",
    contact.LinkEvent: "the TreeSolution that it is of",
    contact.TreeContacts: "the TreeSolution of its `model` that `multibody.integrate_tree` returns",
    contact.Sensitivities: "what `somersault.integrate` returns for the same arguments",
    contact.TreeGradient: "what `multibody.integrate_tree` returns for the same arguments",
    contact.TreeSensitivities: "what `multibody.integrate_tree` returns for the same arguments",
    ftla.MatchingResult: "the Extremal that `ftla.shoot` makes of its nodes",
    ftla.PlacementResult: "the Extremal that begins there",
    integrators.State: "a Trajectory of it and its body",
    list: "each of its entries",
    motion.ChannelRecording: "the Model whose coordinates it has, or draw `plotting.channels`",
    motion.JudgedSet: "one of its `recordings`",
    motion.MarkerFit: "the MotionFit that its `fit` returns",
    motion.Performance: "the recording that it is made from",
    motion.SyntheticFlight: "the SyntheticDive that its `perturb` returns",
    motion.SyntheticSet: "one of its `dives` or `markers`",
    multibody.Diver: "its `model`, with `t` and `q`",
    multibody.TreeDenseOutput: "the TreeSolution that it is of",
    ocp.CartPendulumProblem: "its `motion(z)`",
    ocp.CollocationOutcome: "a CollocationResult",
    ocp.Dive: "what its `solve` returns",
    ocp.DiveVerification: "the DiveSolution that it is of",
    ocp.MotionProblem: "its `motion(z)`",
    ocp.SwingUpVerification: "the Report that it is of",
    ocp.Verification: "the result that it is of",
}
