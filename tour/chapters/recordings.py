"""Chapter 4.2 of the thesis: recordings of people where a folder of them is given, else synthetic ones."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from somersault import errors, motion, multibody, ocp, plotting, viewer
from tour.chapters.divers import inertia
from tour.chapters.motions import frame, postures
from tour.measurements import Measurements
from tour.page import Cell, Page, number, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "A diver fitted to recordings"

#: Names the folder with the motions of DeepMimic.
VARIABLE = "SOMERSAULT_MOTIONS"

_RECORDED = ("backflip", "sideflip", "cartwheel", "roll", "jump", "spinkick", "walk", "run")
#: Of synthetic flights: how each differs from the dive that was optimised.
_FLOWN = {
    "over-rotated": motion.Perturbation(over_rotation=0.4),
    "one-sided": motion.Perturbation(asymmetry=0.15),
    "as optimised": motion.Perturbation(),
    "wobbling": motion.Perturbation(wobble=0.1),
}
_NOISE = 0.005
#: Noise of joint centres from video, m.
_VIDEO = 0.03
#: And of those that cameras track, m.
_BLUR = 0.01
#: Sizes of a person over those of the usual diver, along x forward, y outwards and z up.
_PERSON = {
    "torso": (0.96, 1.04, 0.96),
    "abdomen": (1.05, 1.05, 1.05),
    "pelvis": (1.0, 1.08, 1.0),
    "thigh": (1.07, 1.07, 1.07),
    "shank": (0.97, 0.97, 0.97),
    "forearm": (1.05, 1.05, 1.05),
}
_FRAMES = 60
_COLOURS = ("#4477aa", "#cc6677", "#228833", "#ccbb44", "#66ccee", "#aa3377")
_JOINTS = (("hip", "thigh"), ("knee", "shank"), ("ankle", "foot"), ("toes", "toes"))
_ARM = (("shoulder", "shoulder_flexion"), ("elbow", "forearm"), ("wrist", "hand"))


def markers_of_recordings(model: multibody.Model) -> motion.MarkerSet:
    """Where the joints of DeepMimic's figures are on the spatial diver."""
    places: dict[str, tuple[str | int, Any]] = {"chest": ("torso", (0, 0, 0)), "neck": ("head", (0, 0, 0))}
    for side in ("right", "left"):
        for joint, body in (*_JOINTS, *_ARM):
            places[f"{side}_{joint}"] = (f"{side}_{body}", (0, 0, 0))
    return motion.MarkerSet(model, places)


def files(folder: str) -> dict[str, Path]:
    """The recordings of a folder, by their names."""
    found = {name: Path(folder) / f"humanoid3d_{name}.txt" for name in _RECORDED}
    for path in found.values():
        if not path.is_file():
            raise errors.InputError(
                f"`{VARIABLE}` must name a folder with the motions of DeepMimic or be unset, but"
                f" {path.name} is not in {folder!r}"
            )
    return found


@dataclass(frozen=True)
class Recorded:
    """A motion as recorded: the markers, and the configurations of its own skeleton, root first."""

    markers: motion.MarkerRecording
    q: Array

    @property
    def times(self) -> Array:
        return np.asarray(self.markers.times)


def _flown(
    diver: multibody.Diver, markers: motion.MarkerSet, found: ocp.DiveSolution, count: int
) -> dict[str, Recorded]:
    """SYNTHETIC recordings: an optimised dive, perturbed and flown again, with noise on its markers."""
    flight = motion.SyntheticFlight(diver.model, found.t, found.q)
    rng = np.random.default_rng(11)
    made = {}
    for name, perturbation in islice(_FLOWN.items(), count):
        dive = flight.perturb(perturbation)
        frames = np.linspace(0, len(dive.times) - 1, _FRAMES).round().astype(int)
        times, q = np.linspace(0.0, dive.times[-1], _FRAMES), np.asarray(dive.q)[frames]
        placed = motion.place_markers(markers, times, q)
        points = placed.points + rng.normal(0.0, _NOISE, placed.points.shape)
        made[name] = Recorded(motion.MarkerRecording(placed.names, times, points), q)
    return made


def turned(q: Array) -> Array:
    """Turns about the axes of the body since the first frame: the steps' rotations, added up."""
    rotations = Rotation.from_quat(q[:, 3:7])
    steps = (rotations[:-1].inv() * rotations[1:]).as_rotvec()
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]) / (2.0 * np.pi)


def _turns(recordings: Mapping[str, Recorded], fits: Mapping[str, motion.MotionFit]) -> Axes:
    columns = min(4, len(recordings))
    rows = len(recordings) // columns
    axes = plt.figure(figsize=(9.0, 2.4 * rows), layout="constrained").subplots(
        rows, columns, sharey=True, squeeze=False
    )
    for ax, name in zip(axes.flat, recordings, strict=True):
        found = turned(recordings[name].q), turned(fits[name].q)
        for k, (axis, colour) in enumerate(zip(("forward", "left", "long axis"), _COLOURS, strict=False)):
            ax.plot(recordings[name].times, found[0][:, k], color=colour, lw=1.7, label=axis)
            ax.plot(fits[name].times, found[1][:, k], color=colour, lw=0.9, ls="--")
        ax.set_title(name, fontsize=11)
        ax.grid(color="0.92")
        ax.margins(x=0)
    for ax in axes[:, 0]:
        ax.set_ylabel("turns")
    for ax in axes[-1]:
        ax.set_xlabel("time, s")
    for ax in axes[:, -1]:
        plotting.label_ends(ax)
    drawn: Axes = axes[0, 0]
    return drawn


def _body_centred(fits: dict[str, motion.MotionFit]) -> Axes:
    """Height of the centre of mass, and inertia about the axes of the trunk."""
    axes = plt.figure(figsize=(9.0, 4.2), layout="constrained").subplots(
        2, len(fits), sharex="col", sharey="row"
    )
    for (top, bottom), (name, fit) in zip(axes.T, fits.items(), strict=True):
        q = np.asarray(fit.q)
        top.plot(fit.times, np.asarray(fit.model.center_of_mass(q))[:, 2], color="0.25", lw=1.6)
        trunk = Rotation.from_quat(q[:, 3:7]).as_matrix()
        tensors = np.array(
            [axis.T @ inertia(fit.model, row) @ axis for axis, row in zip(trunk, q, strict=True)]
        )
        for k, (axis, colour) in enumerate(zip(("forward", "left", "long axis"), _COLOURS, strict=False)):
            bottom.plot(fit.times, tensors[:, k, k], color=colour, lw=1.6, label=axis)
        top.set_title(name, fontsize=11)
        bottom.set_xlabel("time, s")
        for ax in (top, bottom):
            ax.grid(color="0.92")
            ax.margins(x=0)
    axes[0, 0].set_ylabel("height of the\ncentre of mass, m")
    axes[1, 0].set(ylabel="moment of\ninertia, kg m²", ylim=(0.0, None))
    plotting.label_ends(axes[1, -1])
    drawn: Axes = axes[0, 0]
    return drawn


def _posture_space(fits: dict[str, motion.MotionFit], diver: multibody.Diver, letters: str) -> Axes:
    base = ocp.EigenpostureBase([diver.configuration(letter)[7:] for letter in letters])
    axes = plt.figure(figsize=(9.0, 4.6), layout="constrained").subplots(
        2, len(fits), sharex="col", sharey="row"
    )
    for (top, bottom), (name, fit) in zip(axes.T, fits.items(), strict=True):
        found = motion.project(base, fit.q[:, 7:])
        for k, letter in enumerate(letters[1:]):
            top.plot(fit.times, found.weights[:, k], color=_COLOURS[k], lw=1.8, label=letter)
        bottom.plot(fit.times, np.degrees(found.distances), color="0.25", lw=1.4)
        top.set_title(name, fontsize=11)
        bottom.set_xlabel("time, s")
        for ax in (top, bottom):
            ax.grid(color="0.92")
            ax.margins(x=0)
    axes[0, 0].set(ylabel="weight", ylim=(-0.02, 1.02))
    axes[1, 0].set(ylabel="angle of the rest, °", ylim=(0.0, None))
    plotting.label_ends(axes[0, -1])
    drawn: Axes = axes[0, 0]
    return drawn


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    folder = os.environ.get(VARIABLE)
    if folder is None:
        _synthetic(page, measurements)
    else:
        _people(page, folder)


def _synthetic(page: Page, measurements: Measurements) -> None:
    found = measurements.twisting[0]
    diver = multibody.diver_spatial()
    markers = markers_of_recordings(diver.model)
    recordings = _flown(diver, markers, found, measurements.setting.flights)
    fits = _fits(diver, markers, recordings)
    off = {name: _angle(recordings[name].q, fit.q) for name, fit in fits.items()}
    page.lead(
        f"{len(recordings)} SYNTHETIC recordings of a twisting dive, fitted by the spatial diver to"
        f" {1e3 * min(fit.rms for fit in fits.values()):.1f} to"
        f" {1e3 * max(fit.rms for fit in fits.values()):.1f} mm; the trunk is found within"
        f" {np.degrees(max(off.values())):.1f}° in every frame."
    )
    page.text(
        "The optimised 5174D is perturbed and flown again with constant angular momentum; the joint centres"
        f" of {_FRAMES} frames get noise of {1e3 * _NOISE:g} mm. The fit starts from the markers alone, so"
        " that its result can be compared with the motion that made them. Where the environment variable"
        f" <code>{VARIABLE}</code> names a folder with the motions of DeepMimic"
        " (<code>humanoid3d_backflip.txt</code> and so on), this page shows recorded people in their place."
    )
    _table(page, recordings, fits)
    page.figure(
        "recorded-turns",
        _turns(recordings, fits),
        "Turns of the trunk about its own axes since take-off: of the synthetic motion, and dashed the fit.",
        "Panels with three curves each, on which dashed curves lie",
    )
    shown = {name: fits[name] for name in list(fits)[:2]}
    page.figure(
        "recorded-body",
        _body_centred(shown),
        "Height of the centre of mass, and moments of inertia about it along the axes of the trunk: the pike"
        " before the entry makes those about the forward and the left axis small, and the somersault fast.",
        "Two columns; the height rises and falls, the moments of inertia change with the posture",
    )
    scene = viewer.Scene("SYNTHETIC: a twisting dive").camera("corner").water(0.0).play(0.5)
    name = "over-rotated"
    scene.add(diver.model, recordings[name].times, recordings[name].q, label="synthetic motion")
    scene.add(fits[name], label="fitted diver", panel=1)
    frame(page, scene, "recorded", "The over-rotated flight, and the diver fitted to its markers.")
    _proportions(page)
    _ground(page)
    _flight(page)
    _advice(page)


def _pike() -> tuple[motion.MarkerSet, motion.MarkerRecording, multibody.TreeSolution]:
    """Joint centres of a planar diver who folds into a pike, with noise as video has it, and the truth."""
    diver = multibody.diver_planar()
    straight, pike = diver.configuration("A")[3:], diver.configuration("H")[3:]

    def fold(t: float) -> tuple[Array, Array]:
        return straight + np.sin(2 * t) ** 2 * (pike - straight), 2 * np.sin(4 * t) * (pike - straight)

    v = np.zeros(diver.model.n_velocities)
    v[:3] = 1.0, 4.0, -4.0
    true = multibody.fly(diver.model, diver.configuration("A"), v, fold, (0.0, 1.2), dt=0.02)
    markers = motion.MarkerSet.joint_centres(diver.model)
    placed = motion.place_markers(markers, true.t, true.q)
    noise = np.random.default_rng(2).normal(0.0, _VIDEO, placed.points.shape)
    return markers, motion.MarkerRecording(placed.names, true.t, placed.points + noise), true


def _momenta(flight: motion.ReconstructedFlight, usual: Array, true: float) -> Axes:
    """The angular momentum of each frame by differences, and by the laws of flight."""
    ax = plt.figure(figsize=(6.4, 3.4), layout="constrained").subplots()
    found, deviation = flight.angular_momentum[1], flight.angular_momentum_deviation[1]
    ax.plot(flight.times, usual, color=_COLOURS[1], lw=1.3, label="frame by frame")
    ax.axhline(true, color="0.25", lw=1.0, ls="--")
    ax.fill_between(
        flight.times, found - 2 * deviation, found + 2 * deviation, color=_COLOURS[0], alpha=0.25, lw=0
    )
    ax.plot(
        flight.times, np.full(len(flight.times), found), color=_COLOURS[0], lw=1.6, label="laws of flight"
    )
    ax.set(xlabel="time, s", ylabel="angular momentum, kg m²/s")
    ax.grid(color="0.92")
    ax.margins(x=0)
    plotting.label_ends(ax)
    return ax


def _flight(page: Page) -> None:
    """A flight reconstructed by its laws, beside fits of single frames."""
    markers, recording, true = _pike()
    flight = motion.reconstruct_flight(markers, recording)
    model = true.model
    filtered = motion.low_pass(recording, 6.0)
    frames = motion.MarkerFit(markers, scale=1.0).fit(filtered)
    rates = np.gradient(frames.q, frames.times, axis=0)
    usual = np.array([model.centroidal_momentum(q, v)[4] for q, v in zip(frames.q, rates, strict=True)])
    exact = np.asarray(model.centroidal_momentum(true.q[0], true.v[0]))
    page.section("A flight by its laws")
    page.text(
        "In the air the angular momentum is constant and the centre of mass falls along a parabola. Fits of"
        " single frames do not know that: their angular velocities are differences of noisy angles."
        " <code>motion.reconstruct_flight</code> fits one motion that obeys both to all frames, estimates"
        " the noise with its correlation, and gives standard deviations. Here a planar diver folds into a"
        f" pike, seen with noise of {1e3 * _VIDEO:g} mm on each joint centre."
    )
    page.code(
        "flight = motion.reconstruct_flight(markers, recording)\nflight.angular_momentum, flight.success"
    )
    page.figure(
        "flight-momentum",
        _momenta(flight, usual, float(exact[4])),
        "Angular momentum of a synthetic flight: frame by frame with a filter at 6 Hz and differences, and by"
        " the laws of flight with two standard deviations to each side. The dashed line is the truth.",
        "A line that waves by several units, and a narrow band on the dashed true value",
    )
    momentum, velocity = flight.angular_momentum, flight.take_off_velocity
    turned_by = motion.somersaults(model, true.q)
    assert turned_by is not None
    rows = (
        ("angular momentum, kg m²/s", momentum[1], flight.angular_momentum_deviation[1], exact[4]),
        (
            "velocity at take-off, upwards, m/s",
            velocity[2],
            flight.take_off_velocity_deviation[2],
            exact[2] / model.mass,
        ),
        (
            "somersaults",
            flight.somersaults[-1],
            flight.somersaults_deviation,
            turned_by[-1],
        ),
    )
    page.table(
        (words("quantity"), "found", "standard deviation", "truth"),
        [[words(name), *(number(float(x), 3) for x in values)] for name, *values in rows],
        f"The search says: {flight.message}. Noise found: {1e3 * flight.noise[0]:.1f} mm.",
    )


def _trial() -> tuple[motion.MarkerSet, motion.MarkerRecording]:
    """Markers on the usual diver, and a person of other proportions who moves all joints."""
    usual = multibody.diver_ball_jointed(thorax=True)
    person = usual.scaled(_PERSON)
    rng = np.random.default_rng(4)
    t = np.linspace(0.0, 2.0, 61)
    swing = 0.4 * np.sin(np.outer(t, rng.uniform(2.0, 5.0, usual.model.n_velocities)))
    swing[:, :6] = 0.0
    q = np.array([usual.model.displace(usual.configuration("B"), v) for v in swing])
    for link in usual.model.links:
        if link.limits is not None:
            place = usual.model.positions_of(link.name)
            q[:, place] = np.clip(q[:, place], *link.limits)
    placed = motion.place_markers(motion.MarkerSet.on_diver(person, "plug_in_gait"), t, q)
    points = placed.points + rng.normal(0.0, _NOISE, placed.points.shape)
    markers = motion.MarkerSet.on_diver(usual, "plug_in_gait")
    return markers, motion.MarkerRecording(placed.names, t, points)


def _sizes(found: motion.ScaledModel) -> Axes:
    """Sizes of segments with two deviations to each side, and the true ones."""
    ax = plt.figure(figsize=(6.4, 3.6), layout="constrained").subplots()
    names = list(found.scales)
    for k, name in enumerate(names):
        deviation = found.scale_deviations[name]
        ax.errorbar(found.scales[name], k, xerr=2 * deviation, color=_COLOURS[0], fmt="o", ms=4, lw=1.4)
        segment, _, width = name.partition(" ")
        true = _PERSON.get(segment, (1.0, 1.0, 1.0))
        ax.plot(true[1] if width else true[2], k, marker="|", ms=14, mew=1.6, color="0.25")
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.set(xlabel="size over that of the usual diver")
    ax.grid(color="0.92", axis="x")
    return ax


def _proportions(page: Page) -> None:
    """A model scaled to a person."""
    markers, trial = _trial()
    found = motion.scale_model(markers, trial)
    page.section("A body of the person's proportions")
    page.text(
        "A model has usual proportions, and people have others. <code>motion.scale_model</code> finds"
        " the sizes of segments and the places of markers on them, from a recording in which all joints"
        " move. The diver here has ball joints at waist, neck, hips and shoulders, so that its legs spread"
        " as those of people, and a trunk that bends between thorax and abdomen too; the person is"
        " SYNTHETIC, with markers of Plug-in Gait seen with noise of"
        f" {1e3 * _NOISE:g} mm."
    )
    page.code("body = motion.scale_model(markers, trial)\nbody.scales, body.offsets, body.markers")
    page.figure(
        "scaled-sizes",
        _sizes(found),
        "Sizes of the groups of segments that were found, with two standard deviations to each side. Upright"
        " strokes are the true sizes.",
        "Dots with horizontal bars beside upright strokes, which the bars reach",
    )
    fits = (
        motion.MarkerFit(markers, common_scale=True).fit(trial),
        motion.MarkerFit(found.markers, scale=1.0).fit(trial),
    )
    page.table(
        (words("model"), "root mean square of the residuals, mm"),
        [
            [words(name), number(1e3 * fit.rms, 1)]
            for name, fit in zip(("usual diver, of one size", "scaled diver"), fits, strict=True)
        ],
        f"The search says: {found.message}. Noise found: {1e3 * found.noise:.1f} mm.",
    )


def _bend() -> tuple[motion.MarkerSet, motion.MarkerRecording, Array]:
    """Joint centres of a planar diver who bends and stands up again, and the rates of the hips."""
    diver = multibody.diver_planar()
    straight, pike = diver.configuration("A"), diver.configuration("H")
    t = np.linspace(0.0, 1.2, 61)
    q = straight + np.sin(2.5 * t[:, None]) ** 2 * (pike - straight)
    markers = motion.MarkerSet.joint_centres(diver.model)
    placed = motion.place_markers(markers, t, q)
    points = placed.points + np.random.default_rng(2).normal(0.0, _BLUR, placed.points.shape)
    hip = diver.dof_names.index("hip")
    rates = 2.5 * np.sin(5.0 * t) * (pike - straight)[hip]
    return markers, motion.MarkerRecording(placed.names, t, points), rates


def _rates(found: motion.SmoothedMotion, usual: Array, true: Array, hip: int) -> Axes:
    """The rate of a hinge by differences, and of the smooth motion."""
    ax = plt.figure(figsize=(6.4, 3.4), layout="constrained").subplots()
    rate, deviation = found.v[:, hip], found.v_deviations[:, hip]
    ax.plot(found.times, usual, color=_COLOURS[1], lw=1.3, label="filter at 6 Hz")
    ax.plot(found.times, true, color="0.25", lw=1.0, ls="--")
    band = (rate - 2 * deviation, rate + 2 * deviation)
    ax.fill_between(found.times, *band, color=_COLOURS[0], alpha=0.25, lw=0)
    ax.plot(found.times, rate, color=_COLOURS[0], lw=1.6, label="smooth motion")
    ax.set(xlabel="time, s", ylabel="rate of the hips, rad/s")
    ax.grid(color="0.92")
    ax.margins(x=0)
    plotting.label_ends(ax)
    return ax


def _ground(page: Page) -> None:
    """A motion on the ground smoothed, beside fits of single frames behind a filter."""
    markers, recording, true = _bend()
    found = motion.smooth_motion(markers, recording)
    frames = motion.MarkerFit(markers, scale=1.0).fit(motion.low_pass(recording, 6.0))
    hip = multibody.diver_planar().dof_names.index("hip")
    usual = np.gradient(frames.q[:, hip], frames.times)
    page.section("A motion on the ground, smoothed")
    page.text(
        "On the ground nothing is known of a motion but that it is smooth. <code>motion.smooth_motion</code>"
        " fits one motion to all frames, with velocities and accelerations and their standard deviations;"
        " how rough each joint moves is estimated, and so is the noise. Here a planar diver bends and stands"
        f" up again, seen with noise of {1e3 * _BLUR:g} mm on each joint centre."
    )
    page.code("found = motion.smooth_motion(markers, recording)\nfound.v, found.v_deviations, found.success")
    page.figure(
        "smooth-rates",
        _rates(found, usual, true, hip),
        "Rate of the hips: of fits of single frames behind a filter at 6 Hz, by differences, and of the"
        " smooth motion with two standard deviations to each side. The dashed line is the truth.",
        "A wave that two lines follow, one of them with a narrow band",
    )
    errors = (float(np.sqrt(np.mean((rate - true) ** 2))) for rate in (usual, found.v[:, hip]))
    page.table(
        (words("rates of the hips"), "root mean square of the error, rad/s"),
        [
            [words(name), number(error, 2)]
            for name, error in zip(("filter at 6 Hz and differences", "smooth motion"), errors, strict=True)
        ],
        f"The search says: {found.message}. Noise found: {1e3 * found.noise[0]:.1f} mm.",
    )


def _late() -> tuple[motion.MarkerSet, motion.MarkerRecording]:
    """Markers of a diver with legs apart who holds the pike of one and a half somersaults for too long."""
    diver = multibody.diver_ball_jointed(mass=62.0, height=1.66)
    model, start = diver.model, diver.configuration("A")
    pike = np.r_[start[:7], diver.configuration("H")[7:]]
    apart = np.zeros(model.n_velocities)
    for side, sign in (("right", -1.0), ("left", 1.0)):
        apart[diver.dof_names.index(f"{side}_thigh_x")] = sign * np.radians(15.0)
    to_pike = model.difference(start, model.displace(pike, apart))
    start[2] = 3.0

    def smooth(x: float) -> tuple[float, float]:
        x = float(np.clip(x, 0.0, 1.0))
        return x**3 * (10 - 15 * x + 6 * x**2), 30 * (x * (1 - x)) ** 2

    def fold(t: float) -> tuple[Array, Array]:
        (bent, bends), (opened, opens) = smooth((t - 0.1) / 0.3), smooth((t - 1.05) / 0.25)
        rate = bends / 0.3 * (1 - opened) - bent * opens / 0.25
        return model.displace(start, bent * (1 - opened) * to_pike)[7:], rate * to_pike[6:]

    v = np.zeros(model.n_velocities)
    v[0], v[2], v[4] = 1.0, 4.8, 3.05
    true = multibody.fly(model, start, v, fold, (0.0, 1.4), dt=0.02)
    markers = motion.MarkerSet.on_diver(diver, "plug_in_gait")
    placed = motion.place_markers(markers, true.t, true.q)
    noise = np.random.default_rng(2).normal(0.0, 2 * _NOISE, placed.points.shape)
    return markers, motion.MarkerRecording(placed.names, true.t, placed.points + noise)


def _advice(page: Page) -> None:
    """What a recorded dive lacked, and what would have been."""
    markers, recording = _late()
    found = motion.analyse(recording, markers, facing="water", half_somersaults=3, interval=(0.0, 1.4))
    assert found.advice is not None
    first = found.advice.advice[0]
    page.section("Advice for a dive")
    page.text(
        "<code>somersault analyse dive.trc --diver me.toml --out page.html</code> reconstructs a flight,"
        " flies it again with changes, and ranks those that bring the entry to the vertical. This diver, with"
        " balls at hips, waist and shoulders and the legs apart, holds the pike of one and a half somersaults"
        " for too long."
        f" What is found: {found.advice.message}. Each amount has a 95 % interval, and advice whose interval"
        " spans zero is withheld."
    )
    page.items(piece.words for piece in found.advice.advice)
    page.code("found = motion.analyse(recording, markers, facing='water')\nfound.write('page.html')")
    better = motion.what_if(found.flight, opening=-first.amount)
    scene = viewer.Scene("As it was, and opened earlier").camera("side").play(0.5)
    scene.add(found.flight, label="as it was")
    scene.add(better, label=f"opened {1e3 * first.amount:.0f} ms earlier", panel=1)
    frame(
        page,
        scene,
        "advice",
        "The dive as it was reconstructed, and opened earlier: the body is vertical at the entry.",
    )


def _fits(
    diver: multibody.Diver, markers: motion.MarkerSet, recordings: Mapping[str, Recorded]
) -> dict[str, motion.MotionFit]:
    fit = motion.MarkerFit(markers, scale=1.0, starts=postures(diver))
    return {name: fit.fit(recorded.markers) for name, recorded in recordings.items()}


def _angle(true: Array, found: Array) -> float:
    """The greatest angle between two motions of a root, rad."""
    turns = Rotation.from_quat(true[:, 3:7]).inv() * Rotation.from_quat(found[:, 3:7])
    return float(turns.magnitude().max())


def _table(page: Page, recordings: Mapping[str, Recorded], fits: Mapping[str, motion.MotionFit]) -> None:
    """Frames, residuals and turns of each motion, and the residuals of its markers."""
    rows: list[list[str | Cell]] = []
    for name, found in fits.items():
        done = sum(status == "converged" for status in found.status)
        turns = turned(recordings[name].q)[-1]
        rows.append(
            [
                words(name),
                str(len(found)),
                number(float(np.ptp(recordings[name].times))),
                f"{done}",
                number(1e3 * found.rms, 0),
                *(number(round(float(x), 2) + 0.0) for x in turns),
            ]
        )
    page.table(
        (
            words("motion"),
            "frames",
            "duration, s",
            "converged",
            "residual, mm",
            "turns: forward axis",
            "left axis",
            "long axis",
        ),
        rows,
        "Turns are those of the recording's root about its own axes from the first to the last frame, its"
        " steps added up; about the axis to the left, forward somersaults count positive. Frames that have"
        " not converged are the best of 100 iterations.",
    )
    page.table(
        (words("residual by marker, mm"), *map(words, fits)),
        [
            [
                words(marker.replace("_", " ")),
                *(number(1e3 * found.marker_rms[marker], 0) for found in fits.values()),
            ]
            for marker in next(iter(fits.values())).fit.markers.names
        ],
        "Root mean square, over the frames of a motion, of the distance between each joint centre of the"
        " recording and that of the diver.",
    )


def _people(page: Page, folder: str) -> None:
    diver = multibody.diver_spatial()
    markers = markers_of_recordings(diver.model)
    skeletons = {name: motion.read_joint_motion(path, diver) for name, path in files(folder).items()}
    recordings = {
        name: Recorded(skeleton.joint_centres(), np.asarray(skeleton.configurations))
        for name, skeleton in skeletons.items()
    }
    fits = _fits(diver, markers, recordings)
    page.lead(
        "Eight motions of people, fitted by the spatial diver to"
        f" {1e3 * min(found.rms for found in fits.values()):.0f} to"
        f" {1e3 * max(found.rms for found in fits.values()):.0f} mm; backflip and sideflip in"
        " posture space."
    )
    page.text(
        "Motions of DeepMimic (X. B. Peng and others, ACM Trans. Graph. 37 (2018), 143), made from motion"
        " capture. They carry no lengths of segments: joint centres are by forward kinematics with the"
        " segment lengths of the diver of 1.70 m, and the scale is known to be 1. The diver is hinged: hips"
        " and knees bend in one plane, and the trunk is stiff where the figures have a chest. What it cannot"
        " do is the residual."
    )
    _table(page, recordings, fits)
    page.figure(
        "recorded-turns",
        _turns(recordings, fits),
        "Turns of the root about its own axes since the first frame: of the recording, and dashed the fitted"
        " trunk. The two differ where the stiff trunk and hinged hips compensate for what they cannot do.",
        "Eight panels; backflip and roll go a turn about the axis to the left, sideflip and cartwheel about"
        " the forward axis, the spin kick about the long axis",
    )
    flips = {name: fits[name] for name in ("backflip", "sideflip")}
    letters = "BAFGC"
    page.figure(
        "recorded-postures",
        _posture_space(flips, diver, letters),
        "Backflip and sideflip in posture space: weights of A (arms up), F (tuck), G (open pike)"
        " and C (arms"
        " sideways)"
        " over B (arms at the sides), w ≥ 0 and Σw ≤ 1, and the norm of what remains of the 21"
        " joint angles.",
        "Two columns of weights over time, with the rest below",
    )
    page.figure(
        "recorded-body",
        _body_centred(flips),
        "Height of the centre of mass, and moments of inertia about it along the axes of the"
        " trunk: a tuck makes"
        " those about the forward and the left axis small, and that about the long axis large.",
        "Two columns; the height rises and falls, the moments of inertia are least in the air",
    )
    pca = motion.common_eigenpostures([found.q[:, 7:] for found in flips.values()], 5)
    fraction = 100.0 * np.cumsum(pca.explained_variance_ratio)
    tuck = {
        name: motion.project(
            ocp.EigenpostureBase([diver.configuration(letter)[7:] for letter in letters]), found.q[:, 7:]
        ).weights[:, 1]
        for name, found in flips.items()
    }
    page.text(
        f"On one basis for both flips, {np.searchsorted(fraction, 90.0) + 1} eigenpostures hold 90 % of the"
        " variance of"
        f" their joint angles. The tuck weighs most, {tuck['backflip'].max():.2f}, at"
        f" {flips['backflip'].times[int(tuck['backflip'].argmax())]:.2f} s of the backflip, and"
        f" {tuck['sideflip'].max():.2f} at"
        f" {flips['sideflip'].times[int(tuck['sideflip'].argmax())]:.2f} s of"
        " the"
        " sideflip."
    )
    recording = skeletons["backflip"]
    scene = viewer.Scene("Backflip").ground(0.0).camera("corner").play(0.5)
    scene.add(recording, label="recording")
    scene.add(fits["backflip"], label="fitted diver", panel=1)
    frame(page, scene, "backflip", "The recorded backflip, and the diver fitted to its joints.")
