"""Files of recorded motions as programs write them: read by their content, with a list of repairs."""

from __future__ import annotations

import contextlib
import io
import json
import pickle
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from somersault import errors, motion
from somersault.cli import main

FILES = Path(__file__).parent / "motions"
#: As Pose2Sim writes it, with a number of frames that is not that of its rows and a marker that was not seen.
TRC = (
    "PathFileType\t4\t(X/Y/Z)\tstand.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t90\t2\tm\t100\t0\t90\nFrame#\tTime\tHead\t\t\tRBigToe\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
    "1\t0.00\t0\t1.7\t0\t0.1\t0.02\t0\n2\t0.01\t0\t1.7\t0\tnan\tnan\tnan\n"
)
#: As OpenSim's inverse kinematics writes it.
MOT = (
    "Coordinates\nversion=1\nnRows=3\nnColumns=3\ninDegrees=yes\n\nendheader\ntime\tknee_angle_r\tpelvis_ty\n"
    + "".join(f"{0.01 * i:.8f}\t{30.0 * i:.8f}\t{0.9 + 0.1 * i:.8f}\n" for i in range(3))
)


def pose(x: float) -> dict[str, Any]:
    """A frame of OpenPose: a person upright in a picture, of whom one point was not found."""
    flat = [[x, 100.0 + 20.0 * k, 0.9] for k in range(25)]
    flat[8] = [0.0, 0.0, 0.0]
    return {"version": 1.3, "people": [{"person_id": [-1], "pose_keypoints_2d": np.ravel(flat).tolist()}]}


def test_repairs_are_listed_and_warned_of() -> None:
    with pytest.warns(errors.ReadWarning) as said:
        stand = motion.read_file(io.StringIO(TRC))
    assert isinstance(stand, motion.MarkerRecording)
    assert stand.present.tolist() == [[True, True], [True, False]]
    nan, frames, axis = stand.repairs
    assert axis.is_decision and str(axis).startswith("byte 0: y is taken to be up, as is usual")
    assert (nan.line, nan.count, nan.is_decision, nan.byte) == (7, 1, False, None)
    assert (frames.line, frames.what) == (3, "90 frames are declared, 2 are there")
    assert sorted(str(warning.message) for warning in said) == sorted(map(str, (nan, frames)))
    assert pickle.loads(pickle.dumps(nan)) == nan
    # what is made of a recording has none
    assert stand.select(["Head"]).repairs == []
    for strict, more in ((True, {}), (True, {"nan_is_gap": True})):
        with pytest.raises(errors.ReadError) as raised:
            motion.read_trc(io.StringIO(TRC), strict=strict, **more)  # type: ignore[arg-type]
        assert raised.value.line == (3 if more else 7)
    whole = TRC.replace("\t90\t2", "\t2\t2")
    assert motion.read_trc(io.StringIO(whole), strict=True, nan_is_gap=True).repairs == []


def test_the_vertical_is_detected_and_said() -> None:
    lying = (
        TRC.replace("0\t1.7\t0\t", "0\t0\t1.7\t").replace("0.1\t0.02\t0", "0.1\t0\t0.02").replace("nan", "")
    )
    other = lying.replace("RBigToe", "LHead\t\t\tRBigToe\t\t\tLBigToe").replace(
        "\t0\t0\t1.7", 2 * "\t0\t0\t1.7"
    )
    other = other.replace("\t0.1\t0\t0.02", 2 * "\t0.1\t0\t0.02")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        detected, told = (motion.read_trc(io.StringIO(other), **more) for more in ({}, {"up": "y"}))  # type: ignore[arg-type]
    (said,) = [repair for repair in detected.repairs if repair.is_decision]
    assert "z is taken to be up" in said.what
    assert detected.track("Head")[0, 2] == 1.7 and told.track("Head")[0, 2] == 0.0


def test_a_mot_is_what_numpy_reads_with_its_angles_in_radians(tmp_path: Path) -> None:
    found = motion.read_mot(io.StringIO(MOT))
    expected = np.genfromtxt(io.StringIO(MOT), names=True, skip_header=7)
    np.testing.assert_array_equal(found.times, expected["time"])
    np.testing.assert_allclose(found.track("knee_angle_r"), np.radians(expected["knee_angle_r"]), rtol=1e-15)
    np.testing.assert_array_equal(found.track("pelvis_ty"), expected["pelvis_ty"])
    assert found.units == ("rad", "") and found.repairs[0].is_decision
    for in_degrees in (True, False):
        motion.write_mot(tmp_path / "walk.mot", found, in_degrees=in_degrees)
        again = motion.read_file(tmp_path / "walk.mot")
        assert isinstance(again, motion.ChannelRecording) and again.names == found.names
        np.testing.assert_allclose(again.values, found.values, rtol=1e-15)
    copy = pickle.loads(pickle.dumps(found))
    assert copy.units == found.units and copy.values.tolist() == found.values.tolist()


def test_tables_are_what_numpy_reads() -> None:
    table = "Time,Fx,Fy\n0,1.5,-9.81\n0.1,,2\n"
    found = motion.read_csv(io.StringIO(table))
    assert isinstance(found, motion.ChannelRecording)
    expected = np.genfromtxt(io.StringIO(table), delimiter=",", skip_header=1)
    np.testing.assert_array_equal(found.values, expected[:, 1:])
    semicolons = table.replace(",", ";").replace(".", ",")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        same = motion.read_file(io.BytesIO(semicolons.encode("utf-16")))
    assert isinstance(same, motion.ChannelRecording)
    assert [repair.line for repair in same.repairs] == [None, 2]
    np.testing.assert_array_equal(same.values, found.values)


def test_key_points_of_a_folder_are_followed_and_stand_upright(tmp_path: Path) -> None:
    frames = [pose(300.0 + 10.0 * k) for k in range(12)]
    for k, frame in enumerate(frames):
        (tmp_path / f"cam_{k}_keypoints.json").write_text(json.dumps(frame))
    seen = motion.read_file(tmp_path, rate=25.0)
    assert isinstance(seen, motion.KeypointRecording)
    assert (seen.n_dims, seen.n_keypoints, len(seen)) == (2, 25, 12)
    expected = np.array([frame["people"][0]["pose_keypoints_2d"] for frame in frames]).reshape(12, 25, 3)
    np.testing.assert_array_equal(seen.points, expected[..., :2])
    np.testing.assert_array_equal(seen.weights, expected[..., 2])
    np.testing.assert_allclose(seen.times, np.arange(12) / 25.0)
    markers = seen.markers(scale=0.004)
    assert not markers.present[:, 8].any() and markers.n_missing == 12
    assert markers.track("nose")[0, 2] > markers.track("left_heel")[0, 2]
    assert markers.track("nose")[-1, 0] - markers.track("nose")[0, 0] == pytest.approx(0.44)
    with pytest.raises(errors.InputError, match="`rate`, frames a second, must be given"):
        motion.read_file(tmp_path)
    with pytest.raises(errors.InputError, match="`person` must be below 1"):
        motion.read_pose(tmp_path, rate=25.0, person=1)
    for bad in ([1.0], [1.0, -1.0], 0.0, np.nan, "x"):
        with pytest.raises((ValueError, TypeError), match="scale"):
            seen.markers(scale=bad)


def test_channels_events_and_force_plates_of_a_c3d_are_those_of_ezc3d() -> None:
    golden = json.loads((FILES / "channels.json").read_text())
    found = motion.read_c3d_channels(FILES / "channels.c3d")
    assert found is not None
    assert (list(found.names), list(found.units)) == (golden["names"], golden["units"])
    np.testing.assert_allclose(found.values, golden["values"], rtol=1e-7)
    np.testing.assert_allclose(found.times, np.arange(12) / 300.0, atol=1e-9)
    events = motion.read_c3d_events(FILES / "channels.c3d")
    assert [[t, label, side] for t, label, side in events] == sorted(golden["events"])
    (plate,) = motion.read_c3d_force_plates(FILES / "channels.c3d")
    assert (plate["type"], plate["channels"], plate["calibration"]) == (2, [0, 1], [])
    assert [list(corner) for corner in plate["corners"]] == golden["corners"]
    assert list(plate["origin"]) == golden["origin"]
    # two plates are declared, with the corners of one
    content = (FILES / "channels.c3d").read_bytes()
    two = content.replace(
        b"\x04\x03USED\t\x00\x04\x00\x00\x00\x80?", b"\x04\x03USED\t\x00\x04\x00\x00\x00\x00@"
    )
    with pytest.raises(
        errors.ReadError, match=r"found `1 numbers`, allowed is 1 in .*TYPE for each of 2 plates"
    ):
        motion.read_c3d_force_plates(io.BytesIO(two))
    # a file of points alone
    assert motion.read_c3d_channels(FILES / "ezc3d.c3d") is None
    for reader in (motion.read_c3d_channels, motion.read_c3d_events, motion.read_c3d_force_plates):
        with pytest.raises(errors.ReadError):
            reader(io.BytesIO(b"\x02\x50"))  # type: ignore[operator]
        with pytest.raises(FileNotFoundError):
            reader("no such file")  # type: ignore[operator]


def test_a_glb_holds_what_was_recorded(tmp_path: Path) -> None:
    skeleton = motion.read_bvh(FILES / "bvhio.bvh", unit="m")
    markers = skeleton.joint_centres()
    for recording in (skeleton, markers):
        motion.write_glb(tmp_path / "a.glb", recording)
        content = (tmp_path / "a.glb").read_bytes()
        n = int.from_bytes(content[12:16], "little")
        document = json.loads(content[20 : 20 + n])
        names = {node.get("name") for node in document["nodes"]}
        assert set(markers.names) <= names and int.from_bytes(content[8:12], "little") == len(content)
    for bad in (None, [], motion.ChannelRecording(["a"], [0.0], [[1.0]])):
        with pytest.raises(TypeError, match="`recording` must be a SkeletonRecording or a MarkerRecording"):
            motion.write_glb(tmp_path / "a.glb", bad)  # type: ignore[arg-type]


def test_a_motion_of_amass_is_that_of_its_body(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    rest, poses = rng.normal(size=(24, 3)), rng.normal(size=(4, 156))
    trans, path = rng.normal(size=(4, 3)), tmp_path / "walk.npz"
    np.savez(path, poses=poses, trans=trans, mocap_framerate=120.0, betas=np.zeros(16), gender="neutral")
    found = motion.read_amass(path, rest)
    np.testing.assert_allclose(found.times, np.arange(4) / 120.0)
    # SMPL's own forward kinematics: 4 × 4 matrices, one after another (Loper et al., 2015, equation 3)
    centres = found.joint_centres()
    parents = [joint.parent for joint in found.skeleton.joints]
    for i in range(4):
        chain: list[np.ndarray] = []
        for k, parent in enumerate(parents):
            own = np.eye(4)
            own[:3, :3] = Rotation.from_rotvec(poses[i, 3 * k : 3 * k + 3]).as_matrix()
            own[:3, 3] = rest[k] if parent is None else rest[k] - rest[parent]
            chain.append(own if parent is None else chain[parent] @ own)
        expected = np.array([pose[:3, 3] for pose in chain]) + trans[i]
        np.testing.assert_allclose(centres.points[i], expected, atol=1e-12)
    # lengths of a file of the model, and a file of SMPL-X
    vertices, regressor = rng.normal(size=(30, 3)), rng.normal(size=(24, 30))
    np.savez(tmp_path / "model.npz", J_regressor=regressor, v_template=vertices)
    np.savez(
        tmp_path / "x.npz",
        root_orient=poses[:, :3],
        pose_body=poses[:, 3:66],
        trans=trans,
        mocap_frame_rate=60,
    )
    other = motion.read_amass(tmp_path / "x.npz", tmp_path / "model.npz")
    np.testing.assert_allclose(other.places[0, 0], (regressor @ vertices)[0] + trans[0])
    np.testing.assert_array_equal(other.rotations, found.rotations)


def test_what_is_no_motion_of_amass_is_refused(tmp_path: Path) -> None:
    rest = np.zeros((22, 3))
    whole: dict[str, Any] = {"poses": np.zeros((2, 66)), "trans": np.zeros((2, 3)), "mocap_framerate": 60.0}
    path = tmp_path / "a.npz"
    for change, message in (
        ({"poses": np.zeros((2, 60))}, "`poses` must have at least 66 numbers a frame, found 60"),
        ({"poses": np.full((2, 66), np.nan)}, "`poses` must be finite"),
        ({"trans": np.zeros((2, 2))}, r"`trans` must have the shape \(n, 3\), found \(2, 2\)"),
        ({"trans": np.zeros((0, 3)), "poses": np.zeros((0, 66))}, "at least one frame"),
        ({"mocap_framerate": 0.0}, "the rate must be positive"),
        ({"trans": np.array(["a", "b"])}, "`trans` must be numbers"),
    ):
        np.savez(path, **{**whole, **change})
        with pytest.raises(errors.ReadError, match=message):
            motion.read_amass(path, rest)
    np.savez(path, poses=whole["poses"], trans=whole["trans"])
    with pytest.raises(
        errors.ReadError, match="`mocap_framerate` or `mocap_frame_rate` is needed, found poses, trans"
    ):
        motion.read_amass(path, rest)
    np.savez(path, **whole)
    content = path.read_bytes()
    rng = np.random.default_rng(11)
    for _ in range(200):
        damaged = bytearray(content)
        for at in rng.integers(0, len(content), 3):
            damaged[at] = rng.integers(0, 256)
        path.write_bytes(damaged[: int(rng.integers(1, len(content) + 1))])
        with contextlib.suppress(errors.ReadError):
            motion.read_amass(path, rest)
    # what NumPy's own parser of heads stumbles on, in an archive that is whole
    for head in (
        b"(",
        b"{'descr': '<f8",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999999, 3), }",
    ):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(
                "mocap_framerate.npy", b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head
            )
        with pytest.raises(errors.ReadError, match="`mocap_framerate`"):
            motion.read_amass(path, rest)
    np.save(tmp_path / "a.npy", rest)
    with pytest.raises(errors.ReadError, match=r"a file \.npz of NumPy is needed"):
        motion.read_amass(tmp_path / "a.npy", rest)
    for bad in (np.zeros((20, 3)), np.zeros(22), "none.npz", [["a"] * 3] * 22, np.full((22, 3), np.nan)):
        with pytest.raises((ValueError, OSError), match=r"`body`|none"):
            motion.read_amass(path, bad)


def test_what_is_of_no_format_is_refused_with_what_was_found(tmp_path: Path) -> None:
    (tmp_path / "empty.trc").write_bytes(b"")
    with pytest.raises(errors.ReadError, match=r"empty\.trc` is empty"):
        motion.read_file(tmp_path / "empty.trc")
    with pytest.raises(errors.ReadError, match="`source` is empty"):
        motion.read_file(io.BytesIO(b""))
    with pytest.raises(
        errors.ReadError, match=r"is a folder without frames of key points, whose files end in \.json"
    ):
        motion.read_file(tmp_path)
    (tmp_path / "a.mov").write_bytes(b"moov")
    with pytest.raises(
        errors.InputError, match="begins with `moov` and has none of the known formats: C3D, TRC"
    ):
        motion.read_file(tmp_path / "a.mov")
    with pytest.raises(errors.InputError, match=r"`format` must be one of \.c3d, .* found 'mov'"):
        motion.read_file(tmp_path / "a.mov", format="mov")
    with pytest.raises(errors.InputError, match="has none of the known formats: C3D"):
        motion.read_file(io.BytesIO(b"\x00\x01"))


@pytest.mark.parametrize(
    ("name", "text", "more", "says"),
    [
        ("stand.trc", TRC, [], "90 frames are declared"),
        ("walk.mot", MOT, [], "converted from degrees"),
        ("seen.json", json.dumps([pose(300.0), pose(310.0)]), ["--rate", "25"], "KeypointRecording"),
        ("bvhio.bvh", (FILES / "bvhio.bvh").read_text(), ["--unit", "m"], "SkeletonRecording"),
    ],
)
def test_a_file_is_shown_by_the_command_line(
    name: str,
    text: str,
    more: list[str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(text)
    assert main(["view", name, *more]) == 0
    assert says in capsys.readouterr().err
    page = Path(name).with_suffix(".html").read_text("utf-8")
    assert "<html" in page and ("<svg" in page) == name.endswith(".mot")
    assert main(["view", "none.trc"]) == 2
    assert main(["view", "stand.trc" if name == "stand.trc" else name, *more, "--html", "a.gif"]) == 2


def test_a_strict_view_refuses_what_needs_a_repair(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("stand.trc").write_text(TRC)
    assert main(["view", "stand.trc", "--strict"]) in (1, 2)
    assert "line 7" in capsys.readouterr().err
