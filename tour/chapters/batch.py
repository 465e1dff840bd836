"""Many bodies at once."""

from __future__ import annotations

import os
import time

import numpy as np
from numpy.typing import ArrayLike

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

    forced = _under_a_force(bodies, states, interval)
    rollouts, rate_of_copies, apart = _rollouts(count)

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
    page.text(
        "Bodies under forces share vector instructions too. A force written in Python would keep the"
        " cores waiting for the interpreter: <code>forces.traced</code> calls it once and evaluates what it"
        " did, for eight bodies at a time on each core. Copies of a tree share vector instructions, under"
        " torques that are held for a step (<code>multibody.rollout</code>).",
    )
    rows = [(words(name), f"{rate:,.0f}", error_size(distance)) for name, rate, distance in forced]
    page.table(
        (words(""), "steps a second", "difference"),
        [
            *rows,
            (
                words(f"{rollouts:,} cart-pendulums in a rollout"),
                f"{rate_of_copies:,.0f}",
                error_size(apart),
            ),
        ],
        "A damped spring at a corner of the same boxes; a wind and a drag on them, traced and called, the"
        " latter on a thousandth of them. Differences are those from one alone at the end, of quaternions and"
        " of the pendulums' positions.",
    )


def _wind(t: float, state: somersault.State) -> tuple[ArrayLike, ArrayLike]:
    """A gusty wind, and a drag that slows the rotation."""
    gust = np.array([1.0 + 0.3 * np.sin(5.0 * t), 0.0, 0.0])
    return 0.2 * (gust - state.velocity), -0.01 * state.angular_velocity


def _under_a_force(
    bodies: list[somersault.RigidBody], states: list[somersault.State], interval: tuple[float, float]
) -> list[tuple[str, float, float]]:
    """Name, steps a second, and the difference from a body alone, of batches under a force."""
    found = []
    few = max(1, len(bodies) // 1000)
    spring = somersault.forces.Spring(3.0, attachment=(0.1, 0.1, 0.1), rest_length=0.5, damping=0.2)
    for name, force, n in (
        ("forced, built-in", spring, len(bodies)),
        ("forced, traced", somersault.forces.traced(_wind), len(bodies)),
        ("forced, called in Python", _wind, few),
    ):
        began = time.perf_counter()
        ends = somersault.batch.integrate_batch(bodies[:n], states[:n], interval, DT, forces=force)
        rate = n * STEPS / (time.perf_counter() - began)
        alone = somersault.integrate(bodies[0], states[0], interval, dt=DT, method="rkmk_b", forces=force)
        found.append((name, rate, float(np.max(np.abs(alone.quaternion[-1] - ends.quaternion[-1, 0])))))
    return found


def _rollouts(count: int) -> tuple[int, float, float]:
    """Copies, steps a second, and the difference from one alone, of rollouts of the cart-pendulum."""
    pole = somersault.multibody.cart_pendulum()
    copies = max(1, count // 10)
    force = np.zeros((copies, STEPS, 2))
    force[:, :, 0] = np.random.default_rng(8).normal(0.0, 5.0, (copies, 1))
    start = ([0.0, 0.1], [0.0, 0.0])
    began = time.perf_counter()
    _, q, _ = somersault.multibody.rollout(pole, *start, (0.0, STEPS * DT), DT, torque=force)
    rate = copies * STEPS / (time.perf_counter() - began)
    alone = somersault.multibody.integrate_tree(
        pole, *start, (0.0, STEPS * DT), dt=DT, method="rkmk", torque=force[0, 0]
    )
    return copies, rate, float(np.max(np.abs(alone.q[-1] - q[0, -1])))
