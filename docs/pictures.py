"""Makes the pictures of the README and the book: `make pictures`. The dives need Chromium or Chrome."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from PIL import Image

import somersault
from somersault import contact, ocp, studies, viewer
from somersault.viewer.film import pictures

FOLDER = Path(__file__).parent / "images"
_SIZE = (6.0, 3.6)


def _axes(title: str) -> Axes:
    ax = plt.figure(figsize=_SIZE, layout="constrained").add_subplot()
    ax.set_title(title, fontsize=11)
    ax.grid(alpha=0.3)
    return ax


def _save(name: str) -> None:
    plt.savefig(FOLDER / name, dpi=110)
    plt.close()


def integrate() -> None:
    """Error against work on case 2 of the thesis."""
    ax = _axes("Ten seconds of a box that flips: error against work")
    problem = studies.Problem.case(2)
    for name, style in (
        ("sie", "C7:"),
        ("rk4", "C7--"),
        ("rkmk", "C0.-"),
        ("dmv2s", "C2.-"),
        ("rkmk8_b", "C3.-"),
        ("pmv10", "C4.-"),
    ):
        runs = studies.work_precision(problem, name, 10.0 ** np.arange(-1.0, -4.1, -1 / 3), repeats=1)
        # Methods for free bodies need no evaluation; a step is then as good a measure.
        ax.loglog(np.maximum(runs.evaluations, runs.steps), runs.errors["orientation"], style, label=name)
    ax.set_xlabel("evaluations, or steps of methods without")
    ax.set_ylabel("orientation error, rad")
    ax.legend(fontsize=8)
    _save("integrate.png")


def touch() -> None:
    """Orders through the contact of the spinning top."""
    ax = _axes("A top that touches the ground: error against step")
    top = contact.spinning_top()

    def end(dt: float, method: str, locate: bool = True) -> np.ndarray:
        run = somersault.integrate(
            top.body,
            top.state,
            (0.0, 0.1),
            dt=dt,
            method=method,
            locate=locate,
            forces=top.forces,
            contacts=top.contacts,
        )
        return run.position[-1]

    reference = end(1.25e-5, "rkmk8")
    steps = 2e-3 * 0.5 ** (np.arange(13) / 2)
    for i, method in enumerate(("rkmk", "rkmk5", "rkmk8")):
        for locate in (True, False):
            errors = [np.linalg.norm(end(dt, method, locate) - reference) for dt in steps]
            label = f"{method}, {'located' if locate else 'not located'}"
            ax.loglog(steps, errors, f"C{i}{'.-' if locate else ':'}", label=label)
    ax.set_xlabel("step, s")
    ax.set_ylabel("position error, m")
    ax.set_ylim(1e-17, 1.0)
    ax.legend(fontsize=8, ncols=3, loc="upper center")
    _save("contact.png")


def optimise() -> None:
    """Two extremals of the arm."""
    figure = plt.figure(figsize=_SIZE, layout="constrained")
    figure.suptitle("An arm turned over with least effort: two extremals", fontsize=11)
    motions = (
        (ocp.arm_motion(np.pi), "the thesis'"),
        (ocp.arm_motion(-np.pi, turn=-2 * np.pi), "a cheaper one"),
    )
    for k, (found, name) in enumerate(motions):
        ax = figure.add_subplot(1, 2, k + 1)
        for t in np.linspace(0.0, 10.0, 41):
            first, second = found.state(t)[:2]
            elbow = 2.0 * np.array([np.cos(first), np.sin(first)])
            hand = elbow + 0.5 * np.array([np.cos(first + second), np.sin(first + second)])
            ax.plot(*np.array([[0, 0], elbow, hand]).T, "-", color=plt.cm.viridis(t / 10), lw=1.2, alpha=0.8)
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.set_title(f"{name}: cost {found.cost:.4f}", fontsize=9)
    _save("optimise.png")


def _strip(name: str, dive: ocp.DiveSolution, shares: tuple[float, ...]) -> None:
    """Six moments of a dive, side by side."""
    scene = viewer.Scene(name).add(dive.dive.diver.model, dive.t, dive.q, trails=())
    scene.camera("side", follow=True)
    times = [share * dive.duration for share in shares]
    frames = [Image.open(io.BytesIO(png)).convert("RGB") for png in pictures(scene, times, (180, 270))]
    strip = Image.new("RGB", (180 * len(frames), 270), "white")
    for i, frame in enumerate(frames):
        strip.paste(frame, (180 * i, 0))
    strip.quantize(128).save(FOLDER / name, optimize=True)


def dive() -> None:
    """107B."""
    _strip("dive.png", ocp.dive_107b().solve(), (0.03, 0.16, 0.24, 0.36, 0.83, 0.98))


def trees() -> None:
    """5174D."""
    _strip("trees.png", ocp.dive_5174d().solve(), (0.03, 0.18, 0.3, 0.45, 0.75, 0.98))


ALL: dict[str, Callable[[], None]] = {
    "integrate": integrate,
    "contact": touch,
    "optimise": optimise,
    "dive": dive,
    "trees": trees,
}

if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for chosen in sys.argv[1:] or ALL:
        ALL[chosen]()
