"""The tumbling box, 500 steps of 0.01 s: every method of the table, MuJoCo's integrators, numba."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import compiled
import numpy as np
from measure import interleaved, table
from motions import TUMBLING_BOX, Array, Errors
from ours import body_of, start_of, states_of

import somersault
from tour import mujoco_scene

STEPS = 500
DT = TUMBLING_BOX.duration / STEPS
BODY, START = body_of(TUMBLING_BOX), start_of(TUMBLING_BOX)


def _ours(method: str, every: int) -> somersault.Solution:
    return somersault.integrate(
        BODY,
        START,
        (0.0, TUMBLING_BOX.duration),
        dt=DT,
        method=method,
        every=every,
    )


def _mujoco(scene: mujoco_scene.Scene) -> None:
    scene.reset()
    scene.advance(STEPS)


def _numba(steps: int) -> Array:
    return compiled.rk4(TUMBLING_BOX.moments, TUMBLING_BOX.start, DT, steps)


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Nanoseconds per step, as called from Python with only the end kept, and errors."""
    runs: dict[str, Callable[[], object]] = {}
    errors: dict[str, Errors] = {}
    for info in somersault.methods():
        name = f"somersault {info.name}"
        runs[name] = partial(_ours, info.name, STEPS)
        errors[name] = Errors.of(TUMBLING_BOX, states_of(_ours(info.name, 1)))
    for integrator in mujoco_scene.integrators():
        name = f"MuJoCo {integrator}"
        scene = mujoco_scene.Scene.free_body(
            integrator, TUMBLING_BOX.mass, TUMBLING_BOX.moments, TUMBLING_BOX.angular_velocity, DT
        )
        errors[name] = Errors.of(TUMBLING_BOX, scene.trajectory(STEPS))
        runs[name] = partial(_mujoco, scene)
    runs["numba RK4"] = partial(_numba, STEPS)
    errors["numba RK4"] = Errors.of(TUMBLING_BOX, np.array([_numba(n) for n in range(STEPS + 1)]))

    times = interleaved(runs, repetitions)
    euler = times["MuJoCo euler"]
    rows: list[dict[str, object]] = [
        {
            "name": name,
            "ns_per_step": times[name] / STEPS * 1e9,
            "time_against_mujoco_euler": times[name] / euler,
            "energy_error": errors[name].energy,
            "momentum_error": errors[name].momentum,
            "orientation_error": errors[name].orientation,
        }
        for name in runs
    ]
    text = table(
        ["", "ns/step", "time / MuJoCo Euler", "energy, rel.", "momentum, rel.", "orientation, rad"],
        [
            [
                name,
                f"{times[name] / STEPS * 1e9:.0f}",
                f"{times[name] / euler:.3f}",
                f"{errors[name].energy:.1e}",
                f"{errors[name].momentum:.1e}",
                f"{errors[name].orientation:.1e}",
            ]
            for name in runs
        ],
    )
    head = (
        "## Tumbling box: 0.2 × 0.4 × 0.6 m, 1 kg, ω₀ = (1, 2, 3) rad/s, 500 steps of 0.01 s\n\n"
        "Energy and momentum: the largest error over all steps; orientation: at the end, against an 80-bit "
        "Taylor series. MuJoCo's step does more than integrate one body; its time is for a free body with "
        "contacts and constraints switched off.\n\n"
    )
    return rows, head + text
