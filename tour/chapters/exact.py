"""The exact motion, and the twist of a body about its middle axis."""

from __future__ import annotations

import time

import numpy as np

import somersault
from somersault import plotting
from somersault.exact import FreeBody
from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, words

TITLE = "The flip of a free body, exactly"


def _twisting_box() -> tuple[somersault.RigidBody, somersault.State]:
    sides, angular_velocity = thesis.CASES[2]
    volume = float(np.prod(sides))
    return (
        somersault.RigidBody.box(1.0, np.array(sides) / volume ** (1 / 3)),
        somersault.State(angular_velocity=angular_velocity),
    )


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    body, start = _twisting_box()
    exact = FreeBody(body, start)
    t = np.linspace(0.0, 30.0, 3001)
    began = time.perf_counter()
    motion = exact(t)
    nanoseconds = (time.perf_counter() - began) / len(t) * 1e9
    spin = motion.angular_velocity_body[:, 1]
    flips = t[1:][np.diff(np.sign(spin)) != 0]
    gap = float(np.mean(np.diff(flips)))
    page.lead(
        f"A free body has a closed solution, {nanoseconds:.0f} ns for each time requested. It shows case 2"
        f" flipping over every {gap:.2f} s: the effect of Dzhanibekov, or of the tennis racket."
    )
    page.text(
        "The angular velocity of a free body is given by Jacobi's elliptic functions, its orientation by an"
        " elliptic integral of the third kind. <code>somersault.exact.FreeBody</code> computes both at any"
        " time, near the separatrix and for symmetric bodies too; it is the reference for every error on"
        " these pages."
    )
    page.code(
        "from somersault.exact import FreeBody\n\n"
        "motion = FreeBody(body, start)\n"
        "state = motion(1e6)                   # one time: a State\n"
        "path = motion(numpy.linspace(0, 30))  # many: a Trajectory\n"
    )
    page.section("The twist")
    axes = plotting.body_motion(motion)
    page.figure(
        "twist",
        axes[0],
        "Case 2 for 30 s: a box of 1:2:5 turning about its middle axis, with 10⁻⁴ of that about its long"
        " axis. The spin about y changes sign repeatedly, while energy and angular momentum stay as"
        f" they are. The thesis integrates the first 10 s: two flips, {10 / (2 * gap):.3f} of a full period.",
        "Four panels over time; the body's spin about y switches between plus and minus six",
    )
    page.section("Why: the polhode")
    paths = [motion]
    energy = float(motion.rotational_energy[0])
    momentum = float(np.linalg.norm(motion.angular_momentum[0]))
    for axis in (0, 2):
        for tilt in (0.15, 0.35, 0.55, 0.7):
            direction = np.zeros(3)
            direction[axis], direction[1] = np.cos(tilt), np.sin(tilt)
            for sign in (1.0, -1.0):
                omega = sign * momentum * direction / body.principal_moments
                paths.append(
                    FreeBody(body, somersault.State(angular_velocity=omega))(np.linspace(0.0, 12.0, 1201))
                )
    page.figure(
        "polhode",
        plotting.polhode(paths),
        f"The angular momentum as the body sees it, on its sphere of {momentum:.3g} kg m²/s. Each curve is"
        f" one energy; case 2, with {energy:.3g} J, is drawn bold. Around the axes of least (z) and greatest"
        " inertia (x) the curves close: rotation there is stable. Through the middle axis (y) runs the"
        " separatrix, and the motion that starts beside it is carried to the far side and back.",
        "A sphere with closed curves around two of its axes and a bold curve that crosses the third",
    )
    page.section("How it is known to be right")
    _agreement(page, measurements)


def _agreement(page: Page, measurements: Measurements) -> None:
    """Against methods that do not use elliptic functions."""
    body, start = measurements.box
    times = np.array([1.0, 10.0, 100.0])
    exact = FreeBody(body, start)(times)
    rows: list[list[str | Cell]] = []
    for name, dt in (("rkmk", 1e-3), ("rkmk_b", 1e-3), ("dmv2", 1e-4), ("pmv10", 0.02)):
        run = somersault.integrate(
            body, start, (0.0, times[-1]), dt=dt, method=name, every=round(float(times[0]) / dt)
        )
        at = np.searchsorted(run.t, times - 0.5 * dt)
        angles = (exact.orientation.inv() * run.orientation[at]).magnitude()
        rows.append([words(name), f"{dt:g}", *(error_size(float(angle)) for angle in angles)])
    page.table(
        (words("method"), "step, s", *(f"after {t:g} s, rad" for t in times)),
        rows,
        "The tumbling box (0.2 × 0.4 × 0.6 m, 1 kg, ω₀ = (1, 2, 3) rad/s): angle between the exact"
        " orientation and that of four methods, which do not use elliptic functions.",
    )
