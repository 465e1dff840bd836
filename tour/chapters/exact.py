"""The exact motion, and the twist of a body about its middle axis."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

import somersault
from somersault import plotting
from somersault.exact import FreeBody
from somersault.plotting.palette import AXES
from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLE = "The flip of a free body, exactly"


def _twisting_box() -> tuple[somersault.RigidBody, somersault.State]:
    sides, angular_velocity = thesis.CASES[2]
    volume = float(np.prod(sides))
    return (
        somersault.RigidBody.box(1.0, np.array(sides) / volume ** (1 / 3)),
        somersault.State(angular_velocity=angular_velocity),
    )


def _spin(motion: somersault.Trajectory) -> Axes:
    """The angular velocity as the body sees it, and the angular momentum in the world."""
    import matplotlib.pyplot as plt

    axes = plt.figure(figsize=(6.4, 5.0), layout="constrained").subplots(2, 1, sharex=True)
    spins = ("about x,\nthe short axis", "about y,\nthe middle axis", "about z,\nthe long axis")
    for k, (name, colour) in enumerate(zip(spins, AXES, strict=True)):
        axes[0].plot(motion.t, motion.angular_velocity_body[:, k], color=colour, label=name)
        axes[1].plot(motion.t, motion.angular_momentum[:, k], color=colour, label=f"along {'xyz'[k]}")
    axes[0].set_ylabel("spin in the body, rad/s")
    axes[1].set_ylabel("angular momentum\nin the world, kg m²/s")
    axes[1].set_xlabel("time, s")
    for ax in axes:
        ax.grid(color="0.92")
        ax.margins(x=0)
        plotting.label_ends(ax)
    drawn: Axes = axes[0]
    return drawn


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
    page.figure(
        "twist",
        _spin(motion),
        "Case 2 for 30 s: a box of 1:2:5 turning about its middle axis, with 10⁻⁴ of that about its long"
        " axis. As the body sees it, the spin about its middle axis changes sign repeatedly; in the world the"
        " angular momentum stays as it is."
        f" The thesis integrates the first 10 s: two flips, {10 / (2 * gap):.3f} of a full period.",
        "Two panels over time; the body's spin about y switches between plus and minus six",
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
