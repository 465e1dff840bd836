"""Writes the recordings in `tests/python/motions` with libraries that know nothing of somersault.

    pip install ezc3d==1.7.2 bvhio==1.5.4
    python tests/python/write_motion_files.py

`ezc3d.c3d` and `ezc3d.json`: three markers, the second missing in frame 2, as ezc3d writes them and as it
reads them back. `channels.c3d` and `channels.json`: two channels of three samples a frame, two events and a
force plate, likewise.
`bvhio.bvh` and `bvhio.json`: four joints, as bvhio writes them, and where its own kinematics
has the joints; bvhio computes in single precision.
"""

import json
from pathlib import Path

import bvhio
import ezc3d
import numpy as np

FOLDER = Path(__file__).parent / "motions"


def c3d() -> None:
    written = ezc3d.c3d()
    points = 1e3 * np.sin(np.arange(3 * 3 * 6)).reshape(3, 3, 6)
    points[:, 1, 2] = np.nan
    written["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    written["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    written["parameters"]["POINT"]["LABELS"]["value"] = ["RASI", "knee left", "toe"]
    written["data"]["points"] = np.concatenate([points, np.ones((1, 3, 6))])
    # without this ezc3d writes NaN as if it were a place
    written["data"]["meta_points"]["residuals"] = np.where(np.isnan(points[:1]), -1.0, 0.5)
    written.write(str(FOLDER / "ezc3d.c3d"))
    read = ezc3d.c3d(str(FOLDER / "ezc3d.c3d"))["data"]["points"][:3]
    frames = np.where(np.isnan(read), None, read.astype(object)).transpose(2, 1, 0).tolist()
    (FOLDER / "ezc3d.json").write_text(json.dumps(frames), encoding="utf-8")


def channels() -> None:
    written = ezc3d.c3d()
    parameters = written["parameters"]
    parameters["POINT"]["RATE"]["value"] = [100.0]
    parameters["POINT"]["UNITS"]["value"] = ["mm"]
    parameters["POINT"]["LABELS"]["value"] = ["toe"]
    written["data"]["points"] = np.ones((4, 1, 4))
    parameters["ANALOG"]["RATE"]["value"] = [300.0]
    parameters["ANALOG"]["LABELS"]["value"] = ["Force.Fz1", "EMG"]
    parameters["ANALOG"]["UNITS"]["value"] = ["N", "V"]
    written["data"]["analogs"] = 1e2 * np.sin(np.arange(2 * 12)).reshape(1, 2, 12)
    corners = np.array([[0, 0, 0], [500, 0, 0], [500, 400, 0], [0, 400, 0]], float)
    written.add_parameter("FORCE_PLATFORM", "USED", [1])
    written.add_parameter("FORCE_PLATFORM", "TYPE", [2])
    written.add_parameter("FORCE_PLATFORM", "ZERO", [1, 0])
    written.add_parameter("FORCE_PLATFORM", "CORNERS", corners.T.reshape(3, 4, 1))
    written.add_parameter("FORCE_PLATFORM", "ORIGIN", np.array([[0.5], [-1.5], [-40.0]]))
    written.add_parameter("FORCE_PLATFORM", "CHANNEL", np.array([[1.0], [2.0]]))
    written.add_event(time=[0, 0.02], context="Right", label="Foot Off")
    written.add_event(time=[0, 0.01], context="Left", label="Foot Strike")
    written.write(str(FOLDER / "channels.c3d"))
    read = ezc3d.c3d(str(FOLDER / "channels.c3d"))
    events, group = read["parameters"]["EVENT"], read["parameters"]["FORCE_PLATFORM"]
    found = {
        "names": read["parameters"]["ANALOG"]["LABELS"]["value"],
        "units": read["parameters"]["ANALOG"]["UNITS"]["value"],
        "values": read["data"]["analogs"][0].T.tolist(),
        "events": [
            [float(minutes * 60 + seconds), label, context]
            for (minutes, seconds), label, context in zip(
                np.asarray(events["TIMES"]["value"]).T,
                events["LABELS"]["value"],
                events["CONTEXTS"]["value"],
                strict=True,
            )
        ],
        "corners": np.asarray(group["CORNERS"]["value"])[:, :, 0].T.tolist(),
        "origin": np.asarray(group["ORIGIN"]["value"])[:, 0].tolist(),
    }
    (FOLDER / "channels.json").write_text(json.dumps(found), encoding="utf-8")


def bvh() -> None:
    rotations = ["Zrotation", "Xrotation", "Yrotation"]
    places = ["Xposition", "Yposition", "Zposition"]
    root = bvhio.BvhJoint("hips")
    chain = [root]
    for name, offset in (("spine", (0, 20.25, 1)), ("arm", (-12.5, 30, 0)), ("hand", (-55.125, 0, 2))):
        joint = bvhio.BvhJoint(name, offset=offset)
        chain[-1].Children.append(joint)
        chain.append(joint)
    for k, joint in enumerate(chain):
        joint.Channels = places + rotations if k == 0 else rotations
        joint.EndSite = joint.Offset * 0.25
        for i in range(5):
            angle = 0.3 * np.sin(np.arange(3) + 1.7 * k + 0.9 * i)
            place = joint.Offset + (10.0 * np.cos(np.arange(3) + i) if k == 0 else 0.0)
            joint.Keyframes.append(bvhio.Pose(place, bvhio.Euler.toQuatFrom(tuple(angle), order="ZXY")))
    path = FOLDER / "bvhio.bvh"
    bvhio.writeBvh(str(path), bvhio.BvhContainer(root, 5, 0.0125), percision=9)
    hierarchy = bvhio.readAsHierarchy(str(path))
    frames = []
    for i in range(5):
        hierarchy.loadPose(i)
        frames.append({joint.Name: list(joint.PositionWorld) for joint, _, _ in hierarchy.layout()})
    (FOLDER / "bvhio.json").write_text(json.dumps(frames), encoding="utf-8")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    c3d()
    channels()
    bvh()
