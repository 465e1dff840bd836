"""Bad arguments are refused by name; what was found can be pickled and saved; Ctrl-C ends the work."""

import io
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import errors, motion, multibody

BAD: list[Any] = [np.nan, np.inf, -1, 0, -(10**30), "a", None, [], np.zeros((2, 3, 4, 5)), {}]

DIVER = multibody.diver_planar()
MARKERS = motion.MarkerSet.joint_centres(DIVER.model)
TIMES = np.linspace(0.0, 1.0, 12)
Q = np.linspace(DIVER.configuration("A"), DIVER.configuration("H"), 12)
FOLDING = Q[:1] + np.sin(np.pi * TIMES[:, None]) ** 2 * (Q[-1:] - Q[:1])
FOLDING[:, 2] = -5.0 * TIMES
SEEN = motion.place_markers(MARKERS, TIMES, Q)
FITTER = motion.MarkerFit(MARKERS, max_iterations=30)
FIT = FITTER.fit(SEEN)
RNG = np.random.default_rng(1)
SAMPLES = RNG.normal(size=(9, 4))
PCA = motion.Pca(SAMPLES, 2)
PATH = np.zeros((12, 3))


def _performances(n: int) -> list[motion.Performance]:
    return [motion.Performance(TIMES, list("abcd"), RNG.normal(size=(12, 4)), PATH) for _ in range(n)]


MOTIONS, SCORES = _performances(9), 5.0 + RNG.normal(size=9)
OPTIONS = motion.ScoringOptions(max_components=2, n_frames=8, n_eigenweights=2)
VALIDATION = motion.validate(MOTIONS, SCORES, OPTIONS, n_resamples=5)
NO_FAULTS = motion.DiveFaults(0.0, 1.0, 0.5, 0.0, 5.0)
SKELETON = motion.Skeleton([motion.SkeletonJoint("hips", moves=True)])
ROTATIONS = np.tile([0.0, 0.0, 0.0, 1.0], (12, 1, 1))
FLIGHT = motion.SyntheticFlight(DIVER.model, TIMES, FOLDING)
DIVES = motion.SyntheticSet(FLIGHT, MARKERS, n_dives=2)
JUDGE = motion.SyntheticJudge(NO_FAULTS, asymmetry=3.0, noise=0.5, half_points=True)
GROUPS = motion.GroupComparison({"b": [FIT, FIT], "a": [FIT]}, "marker_error", n_frames=7)

BVH = """HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Xrotation End Site { OFFSET 0 1 0 } }
MOTION Frames: 1 Frame Time: 1
30"""

#: Each callable with arguments that are allowed.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Band": (motion.Band, {"series": SAMPLES}),
    "DiveFaults.of": (motion.DiveFaults.of, {"model": DIVER.model, "times": TIMES, "q": Q}),
    "GroupComparison": (
        motion.GroupComparison,
        {"groups": {"a": [FIT]}, "panel": "scale", "n_frames": 5, "weight": 0},
    ),
    "MarkerFit": (
        motion.MarkerFit,
        {
            "markers": MARKERS,
            "scale": (0.5, 2.0),
            "common_scale": False,
            "loss": "huber",
            "threshold": 0.1,
            "starts": [Q[0, 3:]],
            "max_iterations": 9,
            "step_tol": 1e-9,
            "noise": 0.01,
        },
    ),
    "MarkerFit.fit": (FITTER.fit, {"recording": SEEN}),
    "MarkerRecording": (
        motion.MarkerRecording,
        {"names": SEEN.names, "times": TIMES, "points": SEEN.points, "present": SEEN.present},
    ),
    "ChannelRecording": (
        motion.ChannelRecording,
        {"names": ["a"], "times": TIMES, "values": TIMES[:, None], "units": ["m"]},
    ),
    "KeypointRecording": (
        motion.KeypointRecording,
        {"names": ["a"], "times": TIMES, "points": PATH[:, None], "weights": np.ones((12, 1))},
    ),
    "KeypointRecording.markers": (
        motion.KeypointRecording(["a"], TIMES, PATH[:, None], np.ones((12, 1))).markers,
        {"scale": 0.01, "up": "-y", "forward": "x", "threshold": 0.1},
    ),
    "MarkerRecording.fill_gaps": (SEEN.fill_gaps, {"longest": 0.1}),
    "MarkerRecording.resample": (SEEN.resample, {"n_frames": 5}),
    "MarkerSet": (
        motion.MarkerSet,
        {"model": DIVER.model, "markers": {"a": ("foot", (0, 0, 0))}, "weights": {"a": 1.0}},
    ),
    "MotionFit.covariance": (FIT.covariance, {"frame": 0}),
    "Pca": (motion.Pca, {"samples": SAMPLES, "n_components": 2}),
    "Pca.reconstruct": (PCA.reconstruct, {"scores": PCA.scores(SAMPLES)}),
    "Pca.scores": (PCA.scores, {"samples": SAMPLES}),
    "Performance": (
        motion.Performance,
        {"times": TIMES, "names": [str(k) for k in range(Q.shape[1])], "postures": Q, "path": PATH},
    ),
    "Performance.from_markers": (motion.Performance.from_markers, {"recording": SEEN}),
    "ScoringModel": (
        motion.ScoringModel,
        {"motions": MOTIONS, "scores": SCORES, "options": OPTIONS, "groups": list("abcabcabc")},
    ),
    "ScoringOptions": (
        motion.ScoringOptions,
        {
            "n_frames": 9,
            "n_eigenweights": 2,
            "path": True,
            "method": "pls",
            "n_components": 2,
            "max_components": 2,
            "penalty": None,
            "scale": (0, 100),
        },
    ),
    "Skeleton.model": (SKELETON.model, {"mass": 70.0}),
    "SkeletonJoint": (motion.SkeletonJoint, {"name": "a", "parent": 0, "offset": (0, 0, 1)}),
    "SkeletonRecording": (
        motion.SkeletonRecording,
        {"skeleton": SKELETON, "times": TIMES, "rotations": ROTATIONS, "places": PATH[:, None]},
    ),
    "Perturbation": (
        motion.Perturbation,
        {
            "exit_delay": 0.1,
            "looseness": 0.1,
            "over_rotation": 0.1,
            "wobble": 0.1,
            "wobble_frequency": 5.0,
            "wobble_phase": 0.5,
            "asymmetry": 0.1,
            "duration": 0.1,
        },
    ),
    "SyntheticFlight": (motion.SyntheticFlight, {"model": DIVER.model, "times": TIMES, "q": FOLDING}),
    "SyntheticJudge": (motion.SyntheticJudge, {"reference": NO_FAULTS, "hip_opening": 1.0, "noise": 0.1}),
    "SyntheticSet": (
        motion.SyntheticSet,
        {"flight": FLIGHT, "markers": MARKERS, "n_dives": 1, "seed": 1, "marker_noise": 0.0},
    ),
    "common_eigenpostures": (motion.common_eigenpostures, {"motions": [SAMPLES], "n_eigenpostures": 2}),
    "eigenpostures_per_motion": (
        motion.eigenpostures_per_motion,
        {"motions": [SAMPLES], "n_eigenpostures": 2},
    ),
    "low_pass": (motion.low_pass, {"recording": SEEN, "cutoff": 3.0, "order": 4}),
    "normalize_frames": (motion.normalize_frames, {"times": TIMES, "values": TIMES, "n_frames": 5}),
    "pearson": (motion.pearson, {"x": SCORES, "y": SCORES}),
    "place_markers": (motion.place_markers, {"markers": MARKERS, "times": TIMES, "q": Q, "scale": 1.0}),
    "read_bvh": (
        lambda **more: motion.read_bvh(io.StringIO(BVH), **more),
        {"unit": "m", "up": "y", "forward": "z"},
    ),
    "read_file": (
        lambda **more: motion.read_file(io.StringIO(BVH), **more),
        {
            "format": "bvh",
            "strict": True,
            "unit": "m",
            "up": "y",
            "forward": "z",
            "nan_is_gap": True,
            "rate": 10.0,
            "person": 0,
            "diver": DIVER,
        },
    ),
    "spearman": (motion.spearman, {"x": SCORES, "y": SCORES}),
    "somersaults": (motion.somersaults, {"model": DIVER.model, "q": Q}),
    "validate": (
        motion.validate,
        {
            "motions": MOTIONS,
            "scores": SCORES,
            "options": OPTIONS,
            "n_resamples": 2,
            "level": 0.9,
            "seed": 1,
            "features": {"a": SCORES},
        },
    ),
}


def _shown(error: Exception) -> str:
    """What a traceback ends with: the message and its notes."""
    return "\n".join([str(error), *getattr(error, "__notes__", [])])


@pytest.mark.parametrize("name", CALLS)
def test_bad_arguments_are_refused_by_name(name: str) -> None:
    function, allowed = CALLS[name]
    for argument in allowed:
        for bad in BAD:
            try:
                function(**{**allowed, argument: bad})
            except (ValueError, TypeError) as error:
                # of two that do not suit each other either may be named
                named = [argument, *(f"`{other}`" for other in allowed)]
                assert any(name in _shown(error) for name in named), f"{argument}={bad!r}: {error!r}"


@pytest.mark.parametrize(
    "reader",
    [
        "read_bvh",
        "read_c3d",
        "read_c3d_channels",
        "read_csv",
        "read_joint_motion",
        "read_awards",
        "read_mot",
        "read_pose",
        "read_trc",
    ],
)
def test_what_is_no_file_is_refused_by_name(reader: str) -> None:
    more = {"unit": "m"} if reader == "read_bvh" else {}
    for bad in [np.nan, -1, 0, None, [], {}]:
        with pytest.raises((ValueError, TypeError), match="source"):
            getattr(motion, reader)(bad, **more)
    with pytest.raises(FileNotFoundError):
        getattr(motion, reader)("no such file", **more)


#: Each that writes or reads a folder, with arguments that are allowed beside the path.
FILES: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "read_judged": (
        motion.read_judged,
        {"unit": "m", "up": "z", "forward": "x", "nan_is_gap": True, "longest_gap": 0.1, "diver": DIVER},
    ),
    **{
        name: (getattr(motion, name), {"recording": SEEN, "unit": "m", "up": "z", "forward": "x"})
        for name in ("write_c3d", "write_csv", "write_trc")
    },
    "write_bvh": (
        motion.write_bvh,
        {
            "recording": motion.SkeletonRecording(SKELETON, TIMES, ROTATIONS, PATH[:, None]),
            "unit": "m",
            "up": "z",
            "forward": "x",
        },
    ),
    "write_joint_motion": (
        motion.write_joint_motion,
        {
            "recording": motion.read_joint_motion(
                io.StringIO('{"Loop": "none", "Frames": [[' + ", ".join(["1"] * 44) + "]]}")
            )
        },
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_bad_arguments_of_files_are_refused_by_name(name: str, tmp_path: Path) -> None:
    function, allowed = FILES[name]
    path = tmp_path / "file"
    if name == "read_judged":
        motion.write_csv(tmp_path / "a.csv", SEEN)
        path.write_text("motion,score\na.csv,7.5\n")
    function(path, **allowed)
    for argument in allowed:
        for bad in BAD:
            if argument == "diver" and bad is None:
                continue
            try:
                function(path, **{**allowed, argument: bad})
            except (ValueError, TypeError) as error:
                assert argument in _shown(error), f"{argument}={bad!r}: {error!r}"
            else:
                # all that these have in common is that a number may be 0
                assert (argument, bad) == ("longest_gap", 0), f"{argument}={bad!r} is allowed"
    for bad in [np.nan, -1, 0, None, [], {}]:
        with pytest.raises((ValueError, TypeError), match="path"):
            function(bad, **allowed)


def test_counts_are_refused_by_name() -> None:
    for n in (-1, 10**30):
        with pytest.raises(ValueError, match="`n_components` must be between 0 and"):
            motion.Pca(SAMPLES, n)
        with pytest.raises(ValueError, match="`n_frames` must be"):
            SEEN.resample(n_frames=n)
    with pytest.raises(ValueError, match="`seed` must be between 0 and"):
        motion.validate(MOTIONS, SCORES, OPTIONS, seed=-1)
    with pytest.raises(ValueError, match="`scale` must be a number or two bounds, found a str"):
        motion.MarkerFit(MARKERS, scale="a")  # type: ignore[arg-type]


def test_filters_and_sizes_that_are_none_are_refused() -> None:
    same = motion.low_pass(SEEN, 3.0, order=np.int64(4))
    np.testing.assert_array_equal(same.points, motion.low_pass(SEEN, 3.0).points)
    for order in (1000, 3, 0, 4.0, True):
        with pytest.raises(ValueError, match="`order` must be an even number between 2 and 20"):
            motion.low_pass(SEEN, 3.0, order=order)  # type: ignore[arg-type]
    for cutoff in (1e-9, 0.0, np.nan, 1e3):
        with pytest.raises(ValueError, match="`cutoff` must be between"):
            motion.low_pass(SEEN, cutoff)
    for scale in (-1.0, 0.0, np.nan, np.ones(5), np.ones((12, 1)), "a"):
        with pytest.raises(ValueError, match="`scale` must be"):
            motion.place_markers(MARKERS, TIMES, Q, scale=scale)  # type: ignore[arg-type]


KEPT: dict[str, tuple[Any, list[str]]] = {
    "MarkerSet": (MARKERS, ["names", "bodies", "points", "weights"]),
    "MotionFit": (
        FIT,
        [
            "times",
            "scale",
            "q",
            "residuals",
            "cost",
            "iterations",
            "status",
            "unknowns",
            "unknown_status",
            "success",
            "rms",
        ],
    ),
    "Pca": (PCA, ["mean", "components", "explained_variance", "total_variance", "n_samples"]),
    "Performance": (
        MOTIONS[0].labelled_synthetic(),
        ["duration", "n_features", "names", "kind", "synthetic"],
    ),
    "Performance of markers": (motion.Performance.from_markers(SEEN), ["duration", "names", "kind"]),
    "Score": (
        motion.ScoringModel(MOTIONS, SCORES, OPTIONS).score(MOTIONS[0]),
        ["value", "distance", "inside"],
    ),
    "ScoringOptions": (
        OPTIONS,
        [
            "n_frames",
            "n_eigenweights",
            "path",
            "method",
            "n_components",
            "max_components",
            "penalty",
            "scale",
        ],
    ),
    "ScoringOptions of ridge": (motion.ScoringOptions(method="ridge", penalty=0.1), ["method", "penalty"]),
    "ScoringModel of ridge": (
        motion.ScoringModel(MOTIONS, SCORES, motion.ScoringOptions(method="ridge", n_frames=8)),
        ["method", "n_components", "penalty", "coefficients"],
    ),
    "Validation": (
        VALIDATION,
        ["predictions", "distances", "n_components", "penalties", "rms_error", "r_squared", "synthetic"],
    ),
    "AwardTable": (
        motion.read_awards(io.StringIO("diver,dd,awards,points,no\nAnn,2,7 8 7,44,1\n,3,7 7 6.5,,2\n")),
        [
            "awards",
            "counts",
            "difficulty",
            "points",
            "stated",
            "scores",
            "athletes",
            "dives",
            "lines",
            "repairs",
        ],
    ),
    "Correlation": (VALIDATION.pearson, ["value", "interval", "p_value"]),
    "Baseline": (VALIDATION.baselines[1], ["name", "predictions", "rms_error"]),
    "Band": (motion.Band(SAMPLES), ["mean", "deviation"]),
    "DiveFaults": (NO_FAULTS, ["entry_angle", "hip_opening", "exit_fraction", "asymmetry", "roughness"]),
    "Perturbation": (
        motion.Perturbation(wobble=0.1, duration=0.2),
        ["wobble", "duration", "wobble_frequency"],
    ),
    "SyntheticDive": (DIVES.dives[0], ["times", "q", "angular_momentum"]),
    "SyntheticFlight": (FLIGHT, []),
    "SyntheticJudge": (JUDGE, ["deductions", "noise", "half_points"]),
    "SyntheticSet": (DIVES, ["intended", "scores"]),
    "JudgedSet": (DIVES.judged_set(), ["files", "scores", "synthetic"]),
    "GroupComparison": (GROUPS, ["names", "panel"]),
}


@pytest.mark.parametrize("name", KEPT)
def test_what_was_found_can_be_pickled_and_saved(name: str, tmp_path: Path) -> None:
    kept, attributes = KEPT[name]
    somersault.save(tmp_path / "kept.som", kept)
    for found in (pickle.loads(pickle.dumps(kept)), somersault.load(tmp_path / "kept.som")):
        assert repr(found) == repr(kept)
        for attribute in attributes:
            np.testing.assert_array_equal(getattr(found, attribute), getattr(kept, attribute))


def test_pickled_fits_and_motions_do_as_before() -> None:
    fitter = pickle.loads(pickle.dumps(motion.MarkerFit(MARKERS, scale=1.0, loss="cauchy", threshold=0.1)))
    np.testing.assert_array_equal(
        fitter.fit(SEEN).q, motion.MarkerFit(MARKERS, scale=1.0, loss="cauchy", threshold=0.1).fit(SEEN).q
    )
    again = pickle.loads(pickle.dumps(FIT))
    np.testing.assert_array_equal(again.covariance(3), FIT.covariance(3))
    model = motion.ScoringModel(MOTIONS, SCORES, OPTIONS)
    assert model.score(pickle.loads(pickle.dumps(MOTIONS[0]))) == model.score(MOTIONS[0])


def test_pickled_sets_and_groups_have_all_that_they_had(tmp_path: Path) -> None:
    def again(kept: Any) -> Any:
        somersault.save(tmp_path / "kept.som", kept)
        return somersault.load(tmp_path / "kept.som")

    groups, flight, judge, dives = again(GROUPS), again(FLIGHT), again(JUDGE), again(DIVES)
    for name in GROUPS.names:
        np.testing.assert_array_equal(groups.series(name), GROUPS.series(name))
    perturbation = motion.Perturbation(looseness=0.1)
    np.testing.assert_array_equal(flight.perturb(perturbation).q, FLIGHT.perturb(perturbation).q)
    faults = motion.DiveFaults(0.1, 1.2, 0.6, 0.1, 6.0)
    assert judge.intended(faults) == JUDGE.intended(faults)
    assert repr(judge.reference) == repr(NO_FAULTS) and repr(dives.faults) == repr(DIVES.faults)
    assert repr(dives.judge) == repr(DIVES.judge)
    np.testing.assert_array_equal(dives.dives[1].q, DIVES.dives[1].q)
    np.testing.assert_array_equal(dives.markers[1].points, DIVES.markers[1].points)
    # a judged set as its files have it
    (tmp_path / "list").mkdir()
    for k, recording in enumerate(DIVES.markers):
        motion.write_csv(tmp_path / "list" / f"{k}.csv", recording)
    listed = (
        "motion,score,synthetic,height,age,athlete\n0.csv,7.5,true,1.5,20,Ann\n1.csv,6.0,false,1.4,21,Bea\n"
    )
    (tmp_path / "list" / "list.csv").write_text(listed)
    judged = motion.read_judged(tmp_path / "list" / "list.csv")
    found = again(judged)
    assert (
        (found.files, found.synthetic)
        == (judged.files, judged.synthetic)
        == (("0.csv", "1.csv"), [True, False])
    )
    assert found.athletes == judged.athletes == ("Ann", "Bea") and DIVES.judged_set().athletes is None
    assert list(found.features) == list(judged.features) == ["height", "age"]
    np.testing.assert_array_equal(found.features["age"], [20.0, 21.0])
    np.testing.assert_array_equal(found.recordings[1].points, judged.recordings[1].points)
    assert [p.synthetic for p in found.performances()] == [True, False]


@pytest.mark.parametrize(
    ("kind", "position"),
    [("JudgedSet", k) for k in (1, 2, 3, 5)] + [("SyntheticSet", k) for k in (3, 4, 5, 6)],
)
def test_parts_of_pickled_sets_that_do_not_fit_are_refused(kind: str, position: int) -> None:
    restore, arguments = KEPT[kind][0].__reduce__()
    short = list(arguments)
    short[position] = short[position][:1]
    with pytest.raises(errors.InputError, match=r"entries, found 1|of shape"):
        restore(*short)


SCRIPT = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in background shells
import os, time, numpy as np
from somersault import motion
rng = np.random.default_rng(1)
times = np.linspace(0.0, 1.0, 20)
def one(): return motion.Performance(times, list("abcd"), rng.normal(size=(20, 4)), np.zeros((20, 3)))
motions = [one() for _ in range(40)]
print("ready", flush=True)
try:
    motion.validate(motions, rng.uniform(4.0, 8.0, 40), n_resamples=1_000_000)
except KeyboardInterrupt:
    # the work has ended too: hardly any processor time passes
    time.sleep(0.5)
    before = time.process_time()
    time.sleep(0.5)
    print(time.process_time() - before)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
def test_an_interrupt_ends_the_work() -> None:
    with subprocess.Popen([sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=60)[0]
    assert float(output) < 0.1


WRITING = """
import pathlib, signal, tempfile, time, numpy as np
from somersault import motion
points = np.random.default_rng(1).normal(size=(10_000, 50, 3))
seen = motion.MarkerRecording([f"m{k}" for k in range(50)], np.arange(10_000) / 100.0, points)
path = pathlib.Path(tempfile.mkdtemp()) / "long.csv"
begun = time.perf_counter()
motion.write_csv(path, seen)
whole = time.perf_counter() - begun
path.unlink()
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 0.1 * whole)
begun = time.perf_counter()
try:
    motion.write_csv(path, seen)
except KeyboardInterrupt:
    print((time.perf_counter() - begun) / whole, path.exists())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there are no timers of signals there")
def test_an_interrupt_ends_a_long_write() -> None:
    run = subprocess.run([sys.executable, "-c", WRITING], check=True, capture_output=True, text=True)
    share, exists = run.stdout.split()
    assert float(share) < 0.4 and exists == "False"
