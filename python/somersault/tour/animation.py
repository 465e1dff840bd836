"""An animation of a spinning top: one page that loads nothing and needs no server."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import numpy as np

import somersault
from somersault import contact

PAGE = files(__package__).joinpath("animation.html").read_text(encoding="utf-8")

#: A picture for each millisecond of a second: the disk turns by 6° from one to the next.
FRAMES = 1001


def write(path: Path, scene: contact.Scene, motion: somersault.Solution, disk: tuple[float, float]) -> None:
    """Writes the page.

    Parameters
    ----------
    path : Path
        File to write.
    scene : Scene
        The top, with one contact on its axis.
    motion : Solution
        Its motion with events and dense output.
    disk : tuple of float
        Radius and thickness of the disk, m.
    """
    assert motion.sol is not None
    t = np.linspace(motion.sol.t_min, motion.sol.t_max, FRAMES)
    seen = motion.sol(t)
    placed = np.concatenate([seen.position, seen.quaternion], axis=1)
    data = {
        "dt": float(t[1] - t[0]),
        "frames": [[round(float(x), 5) for x in frame] for frame in placed],
        "radius": disk[0],
        "thickness": disk[1],
        "tip": -float(scene.contacts[0].point[2]),
        # Touch-down and release take turns.
        "contacts": [round(event.t, 6) for event in motion.events],
    }
    path.write_text(PAGE.replace("/*MOTION*/null", json.dumps(data)), encoding="utf-8")
