"""A tumbling box, as a physics engine moves it and as the library does."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import somersault
from somersault.exact import FreeBody
from tour import mujoco_scene
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, words

TITLE = "A tumbling box"

STEPS = 500
DT = 0.01


@dataclass(frozen=True)
class Row:
    """Cost and errors of one integrator; energy and momentum are relative, the largest over all steps."""

    name: str
    nanoseconds: float
    energy: float
    momentum: float
    orientation: float


def _row(
    name: str,
    path: somersault.Trajectory,
    exact: Rotation,
    run: Callable[[], object],
    repeats: int,
) -> Row:
    samples = []
    for _ in range(max(3, repeats)):
        began = time.perf_counter()
        run()
        samples.append(time.perf_counter() - began)
    momentum = path.angular_momentum
    return Row(
        name,
        min(samples) / STEPS * 1e9,
        float(np.max(np.abs(path.kinetic_energy / path.kinetic_energy[0] - 1))),
        float(np.max(np.linalg.norm(momentum - momentum[0], axis=1)) / np.linalg.norm(momentum[0])),
        float((exact.inv() * path.orientation[-1]).magnitude()),
    )


def _ours(measurements: Measurements, exact: Rotation) -> list[Row]:
    body, start = measurements.box
    rows = []
    for name in measurements.names:

        def run(every: int, name: str = name) -> somersault.Solution:
            return somersault.integrate(body, start, (0.0, STEPS * DT), dt=DT, method=name, every=every)

        rows.append(_row(name, run(1), exact, partial(run, STEPS), measurements.setting.repeats))
    return rows


def _trajectory(body: somersault.RigidBody, states: NDArray[np.float64]) -> somersault.Trajectory:
    """MuJoCo's states as a trajectory: it has quaternions (w, x, y, z) and rates in the body frame."""
    quaternion = np.roll(states[:, :4], -1, axis=1)
    nothing = np.zeros((len(states), 3))
    return somersault.Trajectory(
        body,
        DT * np.arange(len(states)),
        nothing,
        quaternion,
        nothing,
        Rotation.from_quat(quaternion).apply(states[:, 4:]),
    )


def _mujoco(measurements: Measurements, exact: Rotation) -> list[Row]:
    body, start = measurements.box
    rows = []
    for integrator in mujoco_scene.integrators():
        scene = mujoco_scene.Scene.free_body(
            integrator, body.mass, body.principal_moments, start.angular_velocity, DT
        )

        def run(scene: mujoco_scene.Scene = scene) -> None:
            scene.reset()
            scene.advance(STEPS)

        path = _trajectory(body, scene.trajectory(STEPS))
        rows.append(_row(f"MuJoCo {integrator}", path, exact, run, measurements.setting.repeats))
    return rows


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    body, start = measurements.box
    exact = FreeBody(body, start)(STEPS * DT).orientation
    ours = _ours(measurements, exact)
    theirs = _mujoco(measurements, exact) if mujoco_scene.available() else []
    best = min(ours, key=lambda row: row.orientation)
    euler = next(row for row in ours if row.name == "sie")
    lead = (
        "After 5 s in steps of 0.01 s semi-implicit Euler, which the thesis finds in most physics engines, is"
        f" off by {error_size(euler.orientation)} rad, and {best.name} by {error_size(best.orientation)} rad."
    )
    if theirs:
        close = min(theirs, key=lambda row: row.orientation)
        same = next(row for row in ours if row.name == "rkmk_b")
        lead += (
            f" The most accurate of MuJoCo's integrators, {close.name.split()[1]}, is off by"
            f" {error_size(close.orientation)} rad at {close.nanoseconds:,.0f} ns a step;"
            f" {same.name} by {error_size(same.orientation)} rad at {same.nanoseconds:,.0f} ns."
        )
    page.lead(lead)
    page.text(
        f"A box of 0.2 × 0.4 × 0.6 m and 1 kg, ω₀ = (1, 2, 3) rad/s, free of forces; {STEPS} steps of {DT} s."
        " Energy and angular momentum: the largest relative error over all steps. Orientation: at the end,"
        " against the exact motion. Time: for a step, called from Python with only the end kept.",
    )

    def lines(rows: list[Row]) -> list[list[str | Cell]]:
        return [
            [
                words(row.name),
                f"{row.nanoseconds:,.0f}",
                error_size(row.energy),
                error_size(row.momentum),
                error_size(row.orientation),
            ]
            for row in rows
        ]

    header = (words("integrator"), "ns per step", "energy", "angular momentum", "orientation, rad")
    page.table(header, lines([*theirs, *ours]))
    if theirs:
        page.text(
            f"MuJoCo {mujoco_scene.version()}, one free body without gravity, contacts and constraints. Its"
            " step does more than to integrate one body, so that the times say what a user pays, not how"
            " good its code is.",
        )
    else:
        page.text(
            "To have MuJoCo's integrators in this table, <code>pip install -r tour/requirements.txt</code>"
            " and make the tour again."
        )
