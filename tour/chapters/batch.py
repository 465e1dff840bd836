"""Many bodies at once."""

from __future__ import annotations

import os
import time

import numpy as np

import somersault
from tour.measurements import Measurements
from tour.page import Page, error_size, words

TITLE = "Many bodies at once"

STEPS = 100
DT = 0.01


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    count = measurements.setting.bodies
    random = np.random.default_rng(7)
    bodies = [somersault.RigidBody.box(1.0, sides) for sides in random.uniform(0.1, 1.0, (count, 3))]
    states = [somersault.State(angular_velocity=omega) for omega in random.normal(0.0, 3.0, (count, 3))]
    interval = (0.0, STEPS * DT)

    samples = []
    for _ in range(3):
        began = time.perf_counter()
        ends = somersault.batch.integrate_batch(bodies, states, interval, DT)
        samples.append(time.perf_counter() - began)
    batch = min(samples)

    alone = min(count, 1000)
    began = time.perf_counter()
    singles = [
        somersault.integrate(body, state, interval, dt=DT, method="rkmk_b", every=STEPS)
        for body, state in zip(bodies[:alone], states[:alone], strict=True)
    ]
    single = (time.perf_counter() - began) / alone
    distance = max(
        float(np.max(np.abs(run.quaternion[-1] - ends.quaternion[-1, i]))) for i, run in enumerate(singles)
    )

    page.lead(
        f"{count:,} bodies by {STEPS} steps in {batch * 1e3:.1f} ms, {count * STEPS / batch / 1e6:.0f}"
        f" million steps a second: {single * count / batch:.0f} times the rate of one call for each."
    )
    page.text(
        "<code>somersault.batch</code> integrates free bodies, each with its own inertia and state, by"
        " Runge–Kutta–Munthe-Kaas of order 4 in the body frame, sixty-four to a tile that shares vector"
        " instructions, the tiles shared among the cores. The result is the same to the last bit whatever the"
        " processor and the number of cores.",
    )
    page.table(
        (words(""), "ms", "million steps a second"),
        [
            [words("batch"), f"{batch * 1e3:.1f}", f"{count * STEPS / batch / 1e6:.1f}"],
            [
                words("one call for each body"),
                f"{single * count * 1e3:.1f}",
                f"{STEPS / single / 1e6:.1f}",
            ],
        ],
        f"{count:,} random boxes, {STEPS} steps of {DT} s, {os.cpu_count()} cores, from Python objects to"
        f" arrays; one call for each is timed on {alone:,} of them. The quaternions at the end differ by"
        f" {error_size(distance)} at most.",
    )
