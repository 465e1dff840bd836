"""Recorded motions: recordings, files of all formats, filters, and files that are none."""

import io
import json
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from somersault import errors, motion, multibody

FILES = Path(__file__).parent / "motions"
Array = NDArray[np.float64]

#: From z up in Y-up files with z forward to x forward and z up.
Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def gapped() -> motion.MarkerRecording:
    t = np.linspace(0.0, 1.1, 12)
    points = np.stack([np.stack([t, 1 - t**2, t**3], axis=1), np.stack([-t, t, 0 * t], axis=1)], axis=1)
    present = np.ones((12, 2), dtype=bool)
    present[[3, 4], 0] = False
    present[:2, 1] = False
    points[~present] = np.nan
    return motion.MarkerRecording(["hip", "knee"], t, points, present)


strict_trc = partial(motion.read_trc, strict=True)
strict_csv = partial(motion.read_csv, strict=True)


class TestMarkers:
    def test_gaps_are_explicit(self) -> None:
        recording = gapped()
        assert recording.names == ("hip", "knee") and len(recording) == recording.n_frames == 12
        assert recording.n_markers == 2 and recording.n_missing == 4
        assert recording.duration == pytest.approx(1.1)
        assert recording.points.shape == (12, 2, 3) and recording.present.dtype == bool
        np.testing.assert_array_equal(np.isnan(recording.points).all(axis=2), ~recording.present)
        assert np.isnan(recording.track("hip")[3]).all() and "4 positions missing" in repr(recording)
        with pytest.raises(errors.InputError, match="`points` must be finite, but is not in frame 0"):
            motion.MarkerRecording(recording.names, recording.times, recording.points)

    def test_pickled_recordings_come_back(self) -> None:
        recording = gapped()
        found = pickle.loads(pickle.dumps(recording))
        np.testing.assert_array_equal(found.points, recording.points)
        np.testing.assert_array_equal(found.times, recording.times)
        assert found.names == recording.names

    def test_weights_go_with_their_points(self) -> None:
        given = gapped()
        assert given.weights is None
        weights = np.linspace(0.1, 1.0, 24).reshape(12, 2)
        weights[3, 0] = np.nan  # of a marker that is missing there
        recording = motion.MarkerRecording(given.names, given.times, given.points, given.present, weights)
        again = pickle.loads(pickle.dumps(recording))
        for found, expected in (
            (again, weights),
            (recording.select(["knee", "hip"]), weights[:, ::-1]),
            (recording.resample(recording.times), weights),
        ):
            there = found.present
            np.testing.assert_array_equal(found.weights[there], expected[there])
        # of the frames beside a point the lesser weight
        assert recording.fill_gaps(0.35).weights[3, 0] == weights[2, 0]
        middle = recording.resample([0.65])
        assert middle.weights is not None and middle.weights[0, 1] == weights[6, 1]
        seen = motion.KeypointRecording(["a", "b"], [0.0], [[[1, 2], [3, 4]]], [[0.4, 0.8]])
        np.testing.assert_array_equal(seen.markers(scale=1.0).weights, [[0.5, 1.0]])
        for wrong in (0.0, 1.5, -1.0, np.inf):
            weights[5, 1] = wrong
            with pytest.raises(errors.InputError, match=r"`weights` must be above 0 and at most 1, found"):
                motion.MarkerRecording(given.names, given.times, given.points, given.present, weights)
        with pytest.raises(errors.InputError, match="`weights` must be real numbers of shape"):
            motion.MarkerRecording(given.names, given.times, given.points, given.present, weights[1:])

    def test_filled_gaps_are_scipys_cubic_spline(self) -> None:
        recording = gapped()
        filled = recording.fill_gaps(0.35)
        there = recording.present[:, 0]
        spline = CubicSpline(recording.times[there], recording.track("hip")[there])
        np.testing.assert_allclose(filled.track("hip"), spline(recording.times), atol=1e-14)
        assert filled.n_missing == 2  # before the first frame nothing is known
        assert recording.fill_gaps(0.25).n_missing == 4

    def test_resampled_motions_are_scipys_cubic_spline(self) -> None:
        recording = gapped().select(["knee"]).resample(gapped().times[2:])
        found = recording.resample(n_frames=31)
        spline = CubicSpline(recording.times, recording.track("knee"))
        np.testing.assert_allclose(found.track("knee"), spline(found.times), atol=1e-14)
        assert found.times[-1] == recording.times[-1]
        with pytest.raises(errors.InputError, match="not between"):
            recording.resample([0.0, 1.2])
        with pytest.raises(errors.InputError, match="`times` or `n_frames`"):
            recording.resample()
        with pytest.raises(errors.InputError, match="`n_frames` must be between 0 and 1000000"):
            recording.resample(n_frames=2**62)

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"times": [0.0, 0.0]}, "`times` must grow, but frame 1"),
            ({"times": [0.0, np.nan]}, "`times` must be finite, but is not in frame 1"),
            ({"times": [0.0]}, r"`points` must be real numbers of shape \(1, 2, 3\)"),
            ({"names": ["a", "a"]}, "`a` occurs twice"),
            ({"names": []}, r"at least one of `names`"),
            ({"points": np.full((2, 2, 3), np.inf)}, "`points` must be finite"),
            ({"points": "no"}, "`points` must be real numbers"),
            ({"present": [[1, 0], [1, 1]]}, "`present` must be truth values"),
            ({"present": [[True, False]]}, r"`present` must be .* found shape \(1, 2\)"),
        ],
    )
    def test_what_is_no_recording_is_refused(self, change: dict[str, Any], message: str) -> None:
        arguments: dict[str, Any] = {"names": ["a", "b"], "times": [0.0, 0.1], "points": np.zeros((2, 2, 3))}
        with pytest.raises(errors.InputError, match=message):
            motion.MarkerRecording(**(arguments | change))

    def test_unknown_names_are_refused(self) -> None:
        with pytest.raises(errors.InputError, match="nothing is named `toe`"):
            gapped().track("toe")
        with pytest.raises(errors.InputError, match="nothing is named `toe`"):
            gapped().select(["toe"])


class TestLowPass:
    @staticmethod
    def wave(frequency: float, n: int = 2000) -> motion.MarkerRecording:
        t = np.arange(n) / 200.0
        points = np.zeros((n, 1, 3))
        points[:, 0, 0] = np.sin(2 * np.pi * frequency * t)
        return motion.MarkerRecording(["a"], t, points)

    @pytest.mark.parametrize("order", [2, 4, 8])
    def test_the_cutoff_has_one_over_root_two_of_the_amplitude_and_no_lag(self, order: int) -> None:
        wave = self.wave(6.0)
        found = motion.low_pass(wave, 6.0, order=order)
        middle = slice(600, 1400)
        np.testing.assert_allclose(
            found.track("a")[middle, 0], wave.track("a")[middle, 0] / np.sqrt(2.0), atol=2e-4
        )

    def test_the_amplitude_is_butterworths(self) -> None:
        # of the bilinear transform, with the frequencies that it bends
        for frequency in (2.0, 10.0, 20.0):
            bent, cut = (np.tan(np.pi * f / 200.0) for f in (frequency, 6.0))
            expected = 1.0 / (1.0 + (np.sqrt(2.0) - 1.0) * (bent / cut) ** 4)
            found = motion.low_pass(self.wave(frequency), 6.0).track("a")[600:1400, 0]
            assert np.sqrt(2.0 * np.mean(found**2)) == pytest.approx(expected, rel=2e-3), frequency

    def test_gaps_stay_and_stretches_are_filtered_alone(self) -> None:
        wave = self.wave(3.0, 400)
        present = np.ones((400, 1), dtype=bool)
        present[100:103] = present[104] = present[390:] = False
        recording = motion.MarkerRecording(["a"], wave.times, wave.points, present)
        found = motion.low_pass(recording, 20.0)
        np.testing.assert_array_equal(found.present, present)
        alone = motion.MarkerRecording(["a"], wave.times[:100], wave.points[:100])
        np.testing.assert_array_equal(found.points[:100], motion.low_pass(alone, 20.0).points)

    def test_what_cannot_be_filtered_is_refused(self) -> None:
        uneven = motion.MarkerRecording(["a"], [0.0, 0.1, 0.3], np.zeros((3, 1, 3)))
        with pytest.raises(errors.InputError, match="equal distances"):
            motion.low_pass(uneven, 1.0)
        for cutoff in (0.0, 100.0, np.nan):
            with pytest.raises(errors.InputError, match=r"`cutoff` must be between 0\.002 and 100 Hz"):
                motion.low_pass(self.wave(1.0, 50), cutoff)
        for order in (3, 0, 2.0):
            with pytest.raises(errors.InputError, match="`order`"):
                motion.low_pass(self.wave(1.0, 50), 6.0, order=order)  # type: ignore[arg-type]


class TestSkeletons:
    @staticmethod
    def recording() -> motion.SkeletonRecording:
        joints = [
            motion.SkeletonJoint("hips", moves=True),
            motion.SkeletonJoint("knee", 0, (0.0, 0.1, -0.4)),
            motion.SkeletonJoint("toes", 1, (0.1, 0.0, -0.4), turns=False),
        ]
        t = np.linspace(0.0, 1.0, 6)
        turns = Rotation.from_euler("ZYX", np.stack([t, 0.5 * t, -(t**2)], axis=1))
        rotations = np.stack([turns.as_quat(), (turns * turns).as_quat()], axis=1)
        places = np.stack([t, t**2, 1 + 0 * t], axis=1)[:, None]
        return motion.SkeletonRecording(motion.Skeleton(joints), t, rotations, places)

    def test_joint_centres_follow_from_rotations(self) -> None:
        recording = self.recording()
        skeleton = recording.skeleton
        assert skeleton.names == ("hips", "knee", "toes") and skeleton.turning == ("hips", "knee")
        assert skeleton.moving == ("hips",) and [j.parent for j in skeleton.joints] == [None, 0, 1]
        centres = recording.joint_centres()
        hips, knee = (Rotation.from_quat(recording.rotations[:, k]) for k in range(2))
        at = recording.places[:, 0]
        expected = at + hips.apply([0.0, 0.1, -0.4])
        np.testing.assert_allclose(centres.track("knee"), expected, atol=1e-15)
        expected = expected + (hips * knee).apply([0.1, 0.0, -0.4])
        np.testing.assert_allclose(centres.track("toes"), expected, atol=1e-15)

    def test_the_model_has_its_bodies_at_the_joints(self) -> None:
        recording = self.recording()
        model = recording.skeleton.model(60.0)
        assert model.mass == pytest.approx(60.0)
        poses = model.poses(recording.configurations)
        np.testing.assert_allclose(poses[:, :, :3, 3], recording.joint_centres().points, atol=1e-14)

    def test_pickled_and_resampled(self) -> None:
        recording = self.recording()
        found = pickle.loads(pickle.dumps(recording))
        np.testing.assert_array_equal(found.configurations, recording.configurations)
        again = recording.resample(recording.times)
        np.testing.assert_allclose(again.configurations, recording.configurations, atol=1e-15)
        assert len(recording.resample(n_frames=11)) == 11

    def test_what_is_no_tree_is_refused(self) -> None:
        with pytest.raises(errors.InputError, match="joint 1 must have a parent"):
            motion.Skeleton([motion.SkeletonJoint("a"), motion.SkeletonJoint("b")])
        with pytest.raises(errors.InputError, match="`mass`"):
            self.recording().skeleton.model(0.0)
        with pytest.raises(errors.InputError, match=r"`rotations` must be .* \(1, 2, 4\)"):
            motion.SkeletonRecording(self.recording().skeleton, [0.0], np.zeros((1, 1, 4)), [[[0, 0, 0]]])


class TestFilesOfOthers:
    """Written by ezc3d and bvhio (`write_motion_files.py`), read to the last digit."""

    def test_c3d_of_ezc3d(self) -> None:
        recording = motion.read_c3d(FILES / "ezc3d.c3d")
        assert recording.names == ("RASI", "knee left", "toe")
        expected = np.array(json.loads((FILES / "ezc3d.json").read_text()), dtype=float)
        np.testing.assert_array_equal(recording.points, expected / 1e3)
        assert np.isnan(expected[2, 1]).all() and recording.n_missing == 1
        np.testing.assert_array_equal(recording.times, np.arange(6) / 120.0)

    def test_a_c3d_that_contradicts_itself_is_read_by_its_length_with_a_warning(self, tmp_path: Path) -> None:
        whole = motion.read_c3d(FILES / "ezc3d.c3d")
        content = bytearray((FILES / "ezc3d.c3d").read_bytes())
        content[2] += 1  # points, in the header
        (tmp_path / "other.c3d").write_bytes(content)
        with pytest.warns(
            errors.ReadWarning, match="points: the header declares 4, the parameters 3; 3 is used"
        ):
            found = motion.read_c3d(tmp_path / "other.c3d")
        np.testing.assert_array_equal(found.points, whole.points)

    @pytest.mark.parametrize("first", [0.0, 1.5, 0.1234, -2.0])
    def test_c3d_keeps_the_time_of_its_first_frame(self, first: float, tmp_path: Path) -> None:
        times = first + np.arange(4) / 64.0
        recording = motion.MarkerRecording(["a"], times, np.zeros((4, 1, 3)))
        motion.write_c3d(tmp_path / "a.c3d", recording)
        found = motion.read_c3d(tmp_path / "a.c3d").times
        assert found[0] == first
        np.testing.assert_allclose(found, times, rtol=0.0, atol=1e-15)

    def test_bvh_of_bvhio(self) -> None:
        recording = motion.read_bvh(FILES / "bvhio.bvh", unit="m")
        text = (FILES / "bvhio.bvh").read_text()
        rows = text.splitlines()[-5:]
        numbers = np.array([[float(x) for x in row.split()] for row in rows])
        np.testing.assert_array_equal(recording.places[:, 0], numbers[:, :3] @ Y_UP.T)
        offsets = np.array([joint.offset for joint in recording.skeleton.joints])
        assert offsets.tolist() == [
            [0, 0, 0],
            [1, 0, 20.25],
            [0, -12.5, 30],
            [2, -55.125, 0],
            [0.5, -13.78125, 0],
        ]
        # channels are Z, X, Y about turned axes, which are y, x and z of SciPy in capitals
        for k in range(4):
            turn = Rotation.from_euler("ZXY", numbers[:, 3 + 3 * k : 6 + 3 * k], degrees=True)
            expected = Rotation.from_matrix(Y_UP @ turn.as_matrix() @ Y_UP.T)
            apart = (Rotation.from_quat(recording.rotations[:, k]).inv() * expected).magnitude()
            assert apart.max() < 1e-15
        np.testing.assert_allclose(recording.times, 0.0125 * np.arange(5), rtol=1e-15)

    def test_the_joints_are_where_bvhio_has_them(self) -> None:
        centres = motion.read_bvh(FILES / "bvhio.bvh", unit="m").joint_centres()
        for i, frame in enumerate(json.loads((FILES / "bvhio.json").read_text())):
            for name, place in frame.items():
                # lengths of 100 in single precision, a rounding of 1e-5, through products of four rotations
                np.testing.assert_allclose(centres.track(name)[i], Y_UP @ place, atol=1e-4)


TRC = (
    "PathFileType\t4\t(X/Y/Z)\tjump.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t2\t2\tmm\t100\t1\t2\n"
    "Frame#\tTime\thip\t\t\tknee\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    "1\t0.00\t10.5\t900\t3\t1\t2\t3\n"
    "2\t0.01\t10.6\t901\t3\t\t\t\n"
)
BVH = (
    "HIERARCHY\nROOT hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
    "End Site\n{\nOFFSET 0 -10 0\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.01\n0 0 0\n90 0 0\n"
)
CSV = "time,hip_x,hip_y,hip_z\n0.0,1,2,3\n0.1,,,\n"


class TestReaders:
    def test_trc(self, tmp_path: Path) -> None:
        (tmp_path / "jump.trc").write_text(TRC, encoding="utf-8")
        recording = motion.read_trc(tmp_path / "jump.trc")
        np.testing.assert_array_equal(recording.points[0], [[0.0105, -0.003, 0.9], [0.001, -0.003, 0.002]])
        assert recording.present.tolist() == [[True, True], [True, False]]
        level = motion.read_trc(io.BytesIO(TRC.encode()), up="z", forward="-x")
        np.testing.assert_array_equal(level.track("hip")[0], [-0.0105, -0.9, 0.003])

    def test_csv(self) -> None:
        recording = motion.read_csv(io.StringIO(CSV), unit="cm")
        np.testing.assert_array_equal(recording.track("hip")[0], [0.01, 0.02, 0.03])
        nan = io.StringIO(CSV.replace(",,,", ",NaN,NaN,NaN"))
        assert motion.read_csv(nan, nan_is_gap=True).n_missing == 1

    def test_bvh(self) -> None:
        recording = motion.read_bvh(io.StringIO(BVH), unit="cm")
        assert recording.skeleton.names == ("hips", "hips_end")
        # 90° about the file's z, which points forward: down becomes left
        ends = recording.joint_centres().track("hips_end")
        np.testing.assert_allclose(ends, [[0.0, 0.0, -0.1], [0.0, 0.1, 0.0]], atol=1e-16)

    def test_joint_motion(self) -> None:
        numbers = [0.1, 0.0, 0.9, 0.0] + [1.0, 0.0, 0.0, 0.0] * 4
        numbers += [0.5, *([1.0, 0.0, 0.0, 0.0] * 2), 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
        numbers += [1.0, 0.0, 0.0, 0.0] * 2 + [0.0]
        text = json.dumps({"Loop": "none", "Frames": [numbers, numbers]})
        diver = multibody.diver_spatial(height=1.6)
        recording = motion.read_joint_motion(io.StringIO(text), diver)
        assert len(recording) == 2 and recording.times.tolist() == [0.0, 0.1]
        taller = motion.read_joint_motion(io.StringIO(text))
        shank = [
            float(
                np.linalg.norm(
                    r.joint_centres().track("left_ankle") - r.joint_centres().track("left_knee"), axis=1
                )[0]
            )
            for r in (recording, taller)
        ]
        assert shank[0] / shank[1] == pytest.approx(1.6 / 1.7, rel=1e-12)

    def test_a_file_is_read_as_what_it_is(self, tmp_path: Path) -> None:
        for name, text, expected in [
            ("a.csv", CSV, motion.read_csv(io.StringIO(CSV))),
            ("a.TRC", TRC, motion.read_trc(io.StringIO(TRC))),
        ]:
            (tmp_path / name).write_text(text)
            found = motion.read_file(tmp_path / name)
            assert isinstance(found, motion.MarkerRecording) and found.names == expected.names
            np.testing.assert_array_equal(found.points, expected.points)
        skeleton = motion.read_file(FILES / "bvhio.bvh", unit="m")
        assert isinstance(skeleton, motion.SkeletonRecording)
        expected = motion.read_bvh(FILES / "bvhio.bvh", unit="m").joint_centres()
        np.testing.assert_array_equal(skeleton.joint_centres().points, expected.points)
        assert len(motion.read_file(io.StringIO(BVH), format="bvh", unit="cm")) == 2

    def test_each_file_of_a_folder_is_one_frame(self, tmp_path: Path) -> None:
        for k in (0, 1, 3):
            points = [{"part": name, "x": k, "y": 1, "confidence": 0.5} for name in ("nose", "neck")]
            (tmp_path / f"f_{k}.json").write_text(json.dumps({"image_name": f"{k}.jpg", "keypoints": points}))
        seen = motion.read_file(tmp_path, rate=10.0)
        assert isinstance(seen, motion.KeypointRecording) and list(seen.names) == ["nose", "neck"]
        assert seen.points[:, 0, 0].tolist() == [0.0, 1.0, 3.0]
        np.testing.assert_allclose(seen.times, [0.0, 0.1, 0.3], rtol=1e-15)
        (tmp_path / "settings.json").write_text('{"a": 1}')
        with pytest.raises(errors.ReadError, match=r"in `settings\.json`"):
            motion.read_file(tmp_path, rate=10.0)

    def test_what_a_file_leaves_open_must_be_given(self) -> None:
        for source, more, message in [
            (FILES / "bvhio.bvh", {}, "`unit` must be given, since BVH has none"),
            (FILES / "bvhio.bvh", {"unit": "m", "up": "z"}, "`up` and `forward` must be perpendicular"),
            (io.StringIO(BVH), {}, "`unit` must be given"),
        ]:
            with pytest.raises((ValueError, TypeError), match=message):
                motion.read_file(source, **more)  # type: ignore[arg-type]

    @pytest.mark.parametrize(
        ("reader", "text", "line", "message"),
        [
            (
                strict_trc,
                TRC.replace("\t2\t2\tmm", "\t3\t2\tmm"),
                3,
                "3 frames are declared, found 2",
            ),
            (strict_trc, TRC.replace("mm", "furlong"), 3, "found `furlong`, allowed is m, dm"),
            (strict_trc, TRC.replace("10.6", "1e999"), 8, "a coordinate must be finite"),
            (strict_trc, TRC[:40], None, "the file ends where there must be"),
            (strict_csv, CSV.replace("2,3", "two,3"), 2, "found `two`, allowed is a coordinate"),
            (strict_csv, CSV.replace(",,,", ",nan,0,0"), 3, "a coordinate must be finite, found `nan`"),
            (strict_csv, CSV[: CSV.index("\n") + 1], 1, "no frames"),
            (strict_csv, CSV.replace("0.1,", "0.0,"), None, "`times` must grow, but frame 1"),
            (motion.read_joint_motion, '{"Frames": [[1, 2]]}', 1, "invalid length 2"),
            (motion.read_joint_motion, '{"Frames": []}', 1, "no frames"),
        ],
    )
    def test_files_that_are_none_say_where(
        self, reader: Callable[[io.StringIO], object], text: str, line: int | None, message: str
    ) -> None:
        with pytest.raises(errors.ReadError, match=message) as caught:
            reader(io.StringIO(text))
        if line is not None:
            assert caught.value.line == line and f"line {line}: " in str(caught.value)
        assert caught.value.byte is None

    @pytest.mark.parametrize(
        ("text", "line", "message"),
        [
            (BVH.replace("Frames: 2", "Frames: 9"), 12, "9 frames are declared, found 2"),
            (BVH.replace("Zrotation", "Wrotation"), 5, "found `Wrotation`"),
            (BVH.replace("90 0 0\n", "90 NaN 0\n"), 15, "must be finite, found `NaN`"),
            (BVH.replace("Frames: 2", "Frames: 0"), 12, "no frames"),
        ],
    )
    def test_bvh_that_is_none_says_where(self, text: str, line: int, message: str) -> None:
        with pytest.raises(errors.ReadError, match=message) as caught:
            motion.read_bvh(io.StringIO(text), unit="cm", strict=True)
        assert caught.value.line == line

    def test_every_truncation_of_a_c3d_says_where(self, tmp_path: Path) -> None:
        whole = (FILES / "ezc3d.c3d").read_bytes()
        path = tmp_path / "cut.c3d"
        for n in (0, 1, 100, 511, 600, 1024, 1600):
            path.write_bytes(whole[:n])
            with pytest.raises(errors.ReadError, match=r"cut\.c3d: byte \d+: ") as caught:
                motion.read_c3d(path, strict=True)
            assert caught.value.byte is not None and caught.value.line is None

    def test_bytes_that_are_no_text_say_where(self) -> None:
        with pytest.raises(errors.ReadError, match="byte 4: not UTF-8") as caught:
            motion.read_csv(io.BytesIO(b"time\xff\xfe"), strict=True)
        assert caught.value.byte == 4

    def test_paths_that_cannot_be_opened(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError, match="absent"):
            motion.read_csv(tmp_path / "absent.csv")
        with pytest.raises(TypeError):
            motion.read_csv(7)  # type: ignore[arg-type]

    def test_units_and_axes_have_names(self) -> None:
        for options, message in (
            ({"unit": "furlong"}, "`unit` must be one of m, dm"),
            ({"up": "w"}, "`up` must be 'x', 'y' or 'z'"),
            ({"up": "x", "forward": "-x"}, "`up` and `forward` must be perpendicular"),
        ):
            with pytest.raises(errors.InputError, match=message):
                motion.read_csv(io.StringIO(CSV), **options)  # type: ignore[arg-type]


INTERRUPTED = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in background shells
import time
import numpy as np
from somersault import motion
rng = np.random.default_rng(1)
t = np.linspace(0.0, 1.0, 60)
names = [str(k) for k in range(30)]
def one(): return motion.Performance(t, names, rng.normal(size=(60, 30)), rng.normal(size=(60, 3)))
motions = [one() for _ in range(12)]
print("ready", flush=True)
try:
    motion.validate(motions, rng.uniform(4.0, 8.0, 12), n_resamples=1_000_000)
except KeyboardInterrupt:
    print(time.monotonic(), flush=True)
import os; os._exit(0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
def test_ctrl_c_ends_a_long_validation() -> None:
    process = subprocess.Popen([sys.executable, "-c", INTERRUPTED], stdout=subprocess.PIPE, text=True)
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=60)[0]
    assert float(output) - sent < 1.0
