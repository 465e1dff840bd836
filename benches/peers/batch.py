"""10,000 free bodies, 100 and 1000 steps of 0.01 s, arrays to arrays, against numba's RK4 in parallel."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import compiled
import numpy as np
from measure import interleaved, table
from motions import orientation_error

import somersault
from somersault import batch

BODIES = 10_000
STEPS = (100, 1000)
DT = 0.01
COMPARED = 500
#: Rounds for each repetition: runs of some milliseconds on all cores scatter by a half.
ROUNDS = 5


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Million steps a second, from arrays to arrays, and the error of some of the bodies."""
    random = np.random.default_rng(20)
    sides = random.uniform(0.1, 1.0, (BODIES, 3))
    omega = random.normal(0.0, 3.0, (BODIES, 3))
    bodies = [somersault.RigidBody.box(1.0, lengths) for lengths in sides]
    states = [somersault.State(angular_velocity=rates) for rates in omega]
    squares = sides**2
    moments = np.ascontiguousarray((squares.sum(axis=1, keepdims=True) - squares).T / 12)
    rows_of_moments, upright = np.ascontiguousarray(moments.T), np.tile([0.0, 0.0, 0.0, 1.0], (BODIES, 1))
    start = np.zeros((7, BODIES))
    start[0] = 1.0
    start[4:] = omega.T

    def moved(duration: float, count: int) -> Any:
        """Orientations at the end after so many steps, from arrays."""
        step = duration / count
        ends = batch.integrate_arrays(
            rows_of_moments, upright, omega, (0.0, duration), step, t_eval=[duration]
        )
        return ends.quaternion[0]

    rows: list[dict[str, object]] = []
    for steps in STEPS:
        duration = steps * DT
        exact = [
            np.roll(somersault.exact.FreeBody(body, state)(duration).quaternion, 1)
            for body, state in zip(bodies[:COMPARED], states[:COMPARED], strict=True)
        ]

        def error(found: Any, exact: list[Any] = exact) -> float:
            """The median of the errors of some of the bodies."""
            return float(np.median([orientation_error(f, e) for f, e in zip(found, exact, strict=False)]))

        numba_error = error(compiled.rk4_batch(moments, start, DT, steps)[:4].T)
        counts = range(steps // 2, steps + 1, steps // 20)
        fewest = next(
            (n for n in counts if error(np.roll(moved(duration, n), 1, axis=1)) <= numba_error), steps
        )
        runs: dict[str, Callable[[], Any]] = {
            "somersault, arrays": lambda t=duration, n=steps: moved(t, n),
            "somersault, arrays, to the same error": lambda t=duration, n=fewest: moved(t, n),
            "somersault, objects": lambda t=duration: batch.integrate_batch(bodies, states, (0.0, t), DT),
            "numba RK4, parallel": lambda n=steps: compiled.rk4_batch(moments, start, DT, n),
        }
        times = interleaved(runs, ROUNDS * repetitions, time.perf_counter, pause=0.05)
        ours = batch.integrate_batch(bodies, states, (0.0, duration), DT).quaternion[-1]
        ends = [
            np.roll(found, 1, axis=1) for found in (moved(duration, steps), moved(duration, fewest), ours)
        ]
        errors = [*map(error, ends), numba_error]
        rows += [
            {
                "name": name,
                "steps": count,
                "milliseconds": times[name] * 1e3,
                "million_steps_per_second": BODIES * count / times[name] / 1e6,
                "time_against_numba": times[name] / times["numba RK4, parallel"],
                "median_orientation_error": found,
            }
            for name, count, found in zip(runs, (steps, fewest, steps, steps), errors, strict=True)
        ]
    text = table(
        ["", "steps", "ms", "million steps/s", "time / numba", "orientation, rad (median)"],
        [
            [
                str(row["name"]),
                str(row["steps"]),
                f"{row['milliseconds']:.2f}",
                f"{row['million_steps_per_second']:.1f}",
                f"{row['time_against_numba']:.2f}",
                f"{row['median_orientation_error']:.1e}",
            ]
            for row in rows
        ],
    )
    head = (
        f"## Batch: {BODIES:,} random boxes, steps of {DT} s, all cores\n\nBoth of order 4, from arrays to"
        " arrays; somersault from Python objects, too, and with as few steps as lead to numba's error. Errors"
        f" are the median over {COMPARED} bodies against the exact solution.\n\n"
    )
    return rows, head + text
