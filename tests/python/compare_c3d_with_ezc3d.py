"""Public C3D files against ezc3d (`pip install ezc3d==1.7.2`).

    python tests/python/compare_c3d_with_ezc3d.py FOLDER

The samples of c3d.org are in the repository BTKData of the Biomechanical ToolKit; none is kept here. Points
must be equal to single precision, in the unit of the file. Files that contradict themselves, and files that
one of the two does not read, are listed with the reason. Where the two differ, the one is right whose
frames, with the analog values that the header declares, end where the file does. Fails where that is not
this package.
"""

import struct
import sys
import warnings
from pathlib import Path

import ezc3d
import numpy as np

from somersault import errors, motion

UNITS = {"m": 1.0, "dm": 10.0, "cm": 100.0, "mm": 1000.0, "in": 1.0 / 0.0254, "ft": 1.0 / 0.3048}


def own(path):
    """Points in m, or why there are none, and what the file contradicts itself in."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            recording = motion.read_c3d(path, nan_is_gap=True)
        except errors.ReadError as fault:
            return None, str(fault).removeprefix(f"{path}: ")
    return recording, "; ".join(str(warning.message) for warning in said)


def others(path):
    try:
        read = ezc3d.c3d(str(path))
    except Exception as fault:  # whatever ezc3d raises
        return None, None, str(fault)
    points = np.moveaxis(read["data"]["points"][:3], (0, 1, 2), (2, 1, 0))
    units = read["parameters"]["POINT"].get("UNITS", {}).get("value") or ["mm"]
    return points, UNITS.get(units[0].strip().lower(), 1000.0), ""


def ends_with_its_frames(path, recording):
    """Whether the frames as read here end in the last block of the file."""
    content = path.read_bytes()
    order = ">" if content[(content[0] - 1) * 512 + 3] == 86 else "<"
    words = struct.unpack(f"{order}10H", content[:20])
    wide = 2 if motion_scale(content) > 0 else 4
    start = (words[8] - 1) * 512
    end = start + recording.n_frames * wide * (4 * recording.n_markers + words[2])
    return 0 <= len(content) - end < 512


def motion_scale(content):
    """The scale in the header of a file of an Intel processor."""
    return struct.unpack("<f", content[12:16])[0]


def compare(path):
    """A word, and what there is to say."""
    recording, said = own(path)
    points, unit, fault = others(path)
    if recording is None or points is None:
        same = recording is None and (points is None or points.size == 0)
        return (
            "neither reads it" if same else "one reads it",
            f"here: {said or 'read'}; ezc3d: {fault or points.shape}",
        )
    found = np.asarray(recording.points) * unit
    shapes = f"{found.shape[0]} × {found.shape[1]} here, {points.shape[0]} × {points.shape[1]} by ezc3d"
    differs = "explained by the length" if ends_with_its_frames(path, recording) else "DIFFERS"
    if found.shape != points.shape:
        return differs, f"{shapes}; {said}"
    there = np.isfinite(found).all(axis=2) & np.isfinite(points).all(axis=2)
    apart = np.abs(found - points)[there].max(initial=0.0)
    scale = np.abs(points[there]).max(initial=1.0)
    missing = int((np.isfinite(found).all(axis=2) != np.isfinite(points).all(axis=2)).sum())
    if apart <= 1e-6 * scale and missing == 0:
        return "equal", said
    detail = f"off by {apart:.3g} of {scale:.3g}, {missing} points missing in one of them; {said}"
    return differs, detail


def main(folder):
    counts = {}
    for path in sorted(p for p in Path(folder).rglob("*") if p.suffix.lower() == ".c3d"):
        word, detail = compare(path)
        counts[word] = counts.get(word, 0) + 1
        if word != "equal" or detail:
            print(f"{word}: {path.name}: {detail}")
    print(counts)
    return 1 if counts.get("DIFFERS") else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
