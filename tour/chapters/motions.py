"""Chapter 4.2 of the thesis: recorded motions, read, fitted by a model and described."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from somersault import errors, motion, multibody, ocp, viewer
from tour.measurements import Measurements, Setting
from tour.page import Cell, Page, error_size, number, words

Array = NDArray[np.float64]

TITLE = "Markers of known motions, fitted"

_NOISE, _MISSING = 0.01, 0.2


def markers_on(model: multibody.Model) -> motion.MarkerSet:
    """Markers at the joint of each body that has a mass, beyond its centre and beside it."""
    places: dict[str, tuple[str | int, Any]] = {}
    for link in model.links:
        if link.mass > 0.0:
            places[link.name] = (link.name, np.zeros(3))
            places[f"{link.name}, end"] = (link.name, 2.0 * link.center + [0.05, 0.0, 0.0])
            places[f"{link.name}, side"] = (link.name, np.add(link.center, (0.0, 0.06, 0.04)))
    return motion.MarkerSet(model, places)


def postures(diver: multibody.Diver) -> list[Array]:
    """Joints of the diver's postures, to begin a fit with."""
    root = diver.model.positions_of(0).stop
    return [np.asarray(diver.configuration(letter))[root:] for letter in diver.postures]


def blurred(recording: motion.MarkerRecording) -> motion.MarkerRecording:
    """The recording with noise, and with markers missing."""
    rng = np.random.default_rng(4)
    points = recording.points + rng.normal(0.0, _NOISE, recording.points.shape)
    present = rng.random(recording.present.shape) >= _MISSING
    return motion.MarkerRecording(recording.names, recording.times, points, present)


_CSV = "time,hip_x,hip_y,hip_z\n0.00,0,0,0.9\n0.01,0,0,inf\n"
_TRC = (
    "PathFileType\t4\t(X/Y/Z)\tjump.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n100\t9\t1\tmm\n"
    "Frame#\tTime\thip\t\t\n\t\tX1\tY1\tZ1\n1\t0.00\t0\t900\t0\n"
)
_BVH = (
    "HIERARCHY\nROOT hips\n{\n  OFFSET 0 0 0\n  CHANNELS 3 Zrotation Xrotation Wrotation\n}\n"
    "MOTION\nFrames: 1\nFrame Time: 0.01\n0 0 0\n"
)


def _said(read: Callable[[], object]) -> str:
    try:
        read()
    except errors.ReadError as error:
        return str(error)
    return "nothing"


def _reading(page: Page) -> None:
    page.section("Reading")
    page.code(
        "from somersault import motion\n\n"
        'gait = motion.read_c3d("gait.c3d")                # markers, with gaps\n'
        'jump = motion.read_file("jump.trc")               # the format by what the file has\n'
        "jump.repairs                                      # what was repaired, and where\n"
        'walk = motion.read_bvh("walk.bvh", unit="cm")     # a skeleton, and how it turned\n'
        "gait = motion.low_pass(gait.fill_gaps(0.1), 6.0)  # gaps of up to 0.1 s, then 6 Hz without lag\n"
        "gait.resample(n_frames=60).points                 # (60, n_markers, 3), m, z up\n"
    )
    page.text(
        "Whatever a file has, a recording is in m and s, with x forward, y left and z up. What the format"
        " does not say, as the unit of length in BVH, the caller must. Empty cells and NaN are gaps. What"
        " programs are known to write wrongly is repaired, listed in the recording's repairs, and warned"
        " of; with strict=True it is refused, as are files that cannot be repaired, with the line or the"
        " byte:"
    )
    page.table(
        (words("file"), words("what the error says")),
        [
            [words(what), words(_said(read))]
            for what, read in (
                ("CSV with an infinite number", lambda: motion.read_csv(io.StringIO(_CSV))),
                (
                    "TRC of one frame that declares nine, read with strict=True",
                    lambda: motion.read_trc(io.StringIO(_TRC), strict=True),
                ),
                ("BVH with a channel W", lambda: motion.read_bvh(io.StringIO(_BVH), unit="m")),
                ("C3D that ends after 100 bytes", lambda: motion.read_c3d(io.BytesIO(bytes(100)))),
            )
        ],
    )


def _fitted(
    diver: multibody.Diver, t: Array, q: Array, repeats: int
) -> tuple[motion.MotionFit, motion.MotionFit, float, motion.MarkerSet]:
    """Fits to clean and to blurred markers, and the seconds that the second one took."""
    markers = markers_on(diver.model)
    seen, starts = motion.place_markers(markers, t, q), postures(diver)
    clean = motion.MarkerFit(markers, starts=starts).fit(seen)
    noisy, fit = blurred(seen), motion.MarkerFit(markers, starts=starts, scale=1.0, noise=_NOISE)
    seconds = []
    for _ in range(repeats):
        began = time.perf_counter()
        found = fit.fit(noisy)
        seconds.append(time.perf_counter() - began)
    return clean, found, min(seconds), markers


def _turned_off(fit: motion.MotionFit, q: Array) -> Array:
    """Angles between the bodies as fitted and as they are, rad: a row for each frame."""
    bodies = [i for i, link in enumerate(fit.model.links) if link.mass > 0.0]
    found, true = (np.asarray(fit.model.poses(of))[:, bodies, :3, :3].reshape(-1, 3, 3) for of in (fit.q, q))
    angles = (Rotation.from_matrix(found).inv() * Rotation.from_matrix(true)).magnitude()
    return np.asarray(angles).reshape(len(fit), -1)


def _scaled(fit: motion.MotionFit, q: Array) -> Array:
    """Errors of the joints over the deviations that the covariance predicts; NaN where it predicts none."""
    model = fit.model
    joints = [
        model.velocities_of(link.name).start
        for link in model.links[1:]
        if link.joint == "revolute" and not any(part in link.name for part in ("shoulder", "upper_arm"))
    ]
    off = np.asarray(model.difference(q, fit.q))[:, joints]
    found = [fit.covariance(i) for i in range(len(fit))]
    deviation = np.array(
        [np.full(len(joints), np.nan) if c is None else np.sqrt(np.diag(c)[1:][joints]) for c in found]
    )
    # zero at a bound, infinite without a marker
    is_known = (deviation > 0.0) & np.isfinite(deviation)
    return np.asarray(off / np.where(is_known, deviation, np.nan))


def _known(page: Page, dives: dict[str, ocp.DiveSolution], setting: Setting) -> motion.MotionFit:
    page.section("Fitting what is known")
    rows: list[list[str | Cell]] = []
    last: motion.MotionFit | None = None
    for name, dive in dives.items():
        diver = dive.dive.diver
        t, q = dive.t[:: setting.thinned], dive.q[:: setting.thinned]
        clean, noisy, seconds, markers = _fitted(diver, t, q, setting.repeats)
        scaled = _scaled(noisy, q)
        rows.append(
            [
                words(name),
                f"{len(t)} × {len(markers)}",
                error_size(float(_turned_off(clean, q).max())),
                number(float(np.degrees(np.median(_turned_off(noisy, q))))),
                number(float(np.nanmean(scaled))),
                number(float(np.sqrt(np.nanmean(scaled**2)))),
                number(1e3 * noisy.rms, 1),
                number(1e3 * seconds, 1),
            ]
        )
        last = noisy
    page.table(
        (
            words("dive"),
            "frames × markers",
            "largest error without noise, rad",
            "median error with noise, °",
            "mean of error / predicted",
            "rms of error / predicted",
            "residual, mm",
            "time, ms",
        ),
        rows,
        f"The dives of the chapter before, seen by markers. Errors are angles of bodies. With noise:"
        f" {1e3 * _NOISE:g} mm in each coordinate and {100 * _MISSING:g} % of the markers missing, at the"
        " known scale 1."
        " Predicted are the deviations that the linearised covariance of each frame gives for the joints; 0"
        " and 1 are"
        " what an unbiased fit has. Left out are angles at their bounds, bodies whose markers are missing,"
        " and the"
        " shoulders, whose three angles are not determined where two of their axes coincide. The time is the"
        " shortest"
        " of three, measured here, from Python.",
    )
    page.text(
        "In each frame scale, place, orientation and joint angles are sought that bring the markers of the"
        " model"
        " nearest to those seen, within the limits of the joints; a frame starts where the one before ended,"
        " the first from the best of the diver's postures: distances of markers have more than one minimum."
        " Every eighth frame is restarted, and leads those beside it where it ends lower."
        " With a base of eigenpostures the weights are sought instead, w ≥ 0 and Σw ≤ 1 (4.2)."
    )
    page.code(
        "from somersault import motion, multibody\n\n"
        "model = multibody.diver_spatial().model\n"
        'markers = motion.MarkerSet(model, {"LKNE": ("left_shank", (0, 0.05, 0)), ...})\n'
        'fit = motion.MarkerFit(markers, common_scale=True, loss="huber", threshold=0.02).fit(recording)\n'
        "fit.q, fit.scale, fit.residuals, fit.marker_rms, fit.covariance(0)\n"
    )
    assert last is not None
    return last


def frame(page: Page, scene: viewer.Scene, name: str, caption: str) -> None:
    scene.write(page.folder / f"{name}.html")
    page.add(
        f'<iframe src="{name}.html" title="{scene.title}" loading="lazy" '
        'style="width:100%;height:34em;border:1px solid #ddd"></iframe>'
        f'<p class="caption">{caption} Drag to turn; <a href="{name}.html">on a page of its own</a>.</p>'
    )


def _fit_scene(page: Page, dive: ocp.DiveSolution, fit: motion.MotionFit) -> None:
    scene = viewer.Scene("5174D, from noisy markers")
    scene.add(dive.dive.diver.model, dive.t, dive.q, label="the dive")
    scene.add(fit, label="fitted to markers", panel=1)
    scene.water(0.0).platform(dive.dive.options["platform"]).camera("corner").play(0.5)
    frame(
        page,
        scene,
        "fit",
        f"5174D at half speed, as it is and as fitted frame by frame to markers with {1e3 * _NOISE:g} mm of"
        f" noise, {100 * _MISSING:g} % of them missing: each frame is fitted by itself and takes only its"
        " start from others.",
    )


def _components(page: Page, twisting: ocp.DiveSolution) -> None:
    page.section("Eigenpostures of motions")
    joints = np.asarray(twisting.q)[:, 7:]
    pca = motion.Pca(joints)
    fraction = np.cumsum(pca.explained_variance_ratio)
    n = 7
    page.table(
        (words("components"), *map(str, range(1, n + 1))),
        [[words("fraction of the variance, %"), *(number(100.0 * s, 6) for s in fraction[:n])]],
        f"The {joints.shape[1]} joint angles of 5174D are combinations of five weights. Principal components"
        f" do not use that, and find {np.searchsorted(fraction, 1.0 - 1e-12) + 1} directions with more than"
        " 10⁻¹² of the variance between them.",
    )
    halves = [joints[: len(joints) // 2], joints[len(joints) // 2 :]]
    common = motion.common_eigenpostures(halves, 2)
    alone = motion.eigenpostures_per_motion(halves, 2)
    page.table(
        (words("cosine between first and second half"), "first", "second"),
        [
            [
                words("components of each by itself (thesis 4.1.1)"),
                *(number(float(a @ b)) for a, b in zip(*(p.components for p in alone), strict=True)),
            ],
            [words("on one basis for both"), *(number(float(c @ c)) for c in common.components)],
        ],
        "The thesis takes a PCA of each dive. Bases of single motions have directions, signs and an order of"
        " their"
        " own, here those of the two halves of one dive: weights in them cannot be compared. So there is one"
        " basis for all motions here, and the other way under a name of its own.",
    )


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    (pike, _), (twisting, _) = measurements.pike, measurements.twisting
    page.lead(
        "Markers and skeletons from BVH, C3D, TRC, CSV and JSON, every error with its line or byte; a diver"
        " is fitted to them frame by frame, and known motions are found again within the error that the fit"
        " itself predicts."
    )
    _reading(page)
    fit = _known(page, {"107B, planar": pike, "5174D, spatial": twisting}, measurements.setting)
    _fit_scene(page, twisting, fit)
    _components(page, twisting)
