"""Makes the pictures of the README and the book: `make pictures`. The dives need Chromium or Chrome."""

from __future__ import annotations

import importlib
import io
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from PIL import Image, ImageDraw, ImageFont

import somersault
from somersault import contact, exact, ocp, studies, viewer
from somersault.viewer.film import pictures

FOLDER = Path(__file__).parent / "images"
_SIZE = (6.0, 3.6)
_FILM_SECONDS, _FILM_RATE = 10, 12


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
    figure.suptitle("An arm turned over with minimum effort: two extremals", fontsize=11)
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


def _strip(name: str, dive: ocp.DiveSolution, fractions: tuple[float, ...]) -> None:
    """Six moments of a dive, side by side."""
    scene = viewer.Scene(name).add(dive.dive.diver.model, dive.t, dive.q, trails=())
    scene.camera("side", follow=True)
    times = [fraction * dive.duration for fraction in fractions]
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


def recorded() -> None:
    """Scores of synthetic motions by a model that has not seen them."""
    motion: Any = importlib.import_module("somersault.motion")
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 1.4, 60)
    performances, scores = [], []
    for _ in range(40):
        depth, delay = rng.uniform(-1, 1, 2)
        fold = np.exp(-(((t - 0.7 - 0.08 * delay) / 0.3) ** 2)) * (1.5 + 0.3 * depth)
        joints = np.stack([fold, 0.3 * fold + 0.2 * np.sin(4 * t), np.cos(3 * t), 0.4 * t**2], axis=1)
        joints += rng.uniform(-0.02, 0.02, joints.shape)
        path = np.stack([t, 0 * t, 3.0 - 4.9 * t**2], axis=1)
        performances.append(motion.Performance(t, ["hip", "shoulder", "knee", "neck"], joints, path))
        scores.append(7.0 + 0.8 * depth - 0.5 * delay + rng.uniform(-0.17, 0.17))
    worth = motion.validate(performances, scores)
    ax = _axes("Synthetic motions, each scored by a model that has not seen it")
    ax.plot(scores, worth.predictions, "C0o", label=f"left out: rms error {worth.rms_error:.2f}")
    for baseline in worth.baselines[:1]:
        ax.plot(scores, baseline.predictions, "C7x", label=f"{baseline.name}: {baseline.rms_error:.2f}")
    ax.axline((7.0, 7.0), slope=1.0, color="k", lw=0.8)
    ax.set_xlabel("judge")
    ax.set_ylabel("scored")
    ax.legend(fontsize=8)
    _save("recorded.png")


def lyapunov() -> None:
    """Finite-time exponents of the thesis' arm along its optimal motion."""
    ftla: Any = importlib.import_module("somersault.ftla")
    flow = ftla.VariationalFlow(ftla.arm())
    # In the middle of the optimal motion (Table 10.1), where the field is slow.
    middle = (-0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651)
    times = np.linspace(0.1, 5.0, 50)
    exponents = np.array([found.exponents for found in flow.spectra(middle, times)])
    ax = _axes("An arm's optimal control: eight rates, two time scales")
    for k, row in enumerate(exponents.T):
        ax.plot(times, row, "C3" if abs(exponents[-1, k]) > 2.0 else "C0")
    ax.set_ylim(-15, 15)
    ax.set_xlabel("averaging time, s")
    ax.set_ylabel("finite-time Lyapunov exponent, 1/s")
    _save("lyapunov.png")


def _dive_scene() -> tuple[viewer.Scene, float]:
    """5174D, and its duration."""
    dive = ocp.dive_5174d().solve()
    scene = (
        viewer.Scene("Dive").add(dive.dive.diver.model, dive.t, dive.q, trails=()).camera("side", follow=True)
    )
    return scene, dive.duration


def _flip_scene() -> tuple[viewer.Scene, float]:
    """A T of two bars that turns about its middle axis: it flips over and back, the Dzhanibekov effect."""
    body = somersault.RigidBody(0.1, (3.45e-5, 4.02e-5, 7.05e-5))
    start = somersault.State(angular_velocity=(0.0, 9.0, 0.02))
    t = np.linspace(0.0, _FILM_SECONDS, 1200)
    turned = exact.FreeBody(body, start)(t)
    bars = [
        viewer.Box(lengths, center=place, color=color)
        for lengths, place, color in (
            ((0.09, 0.012, 0.016), (0.0, -0.0136, 0.0), "#cc6677"),
            ((0.018, 0.05, 0.016), (0.0, 0.0164, 0.0), "#332288"),
        )
    ]
    return viewer.Scene("Flip").add(turned, shapes=bars, trails=()).camera("corner"), _FILM_SECONDS


def _top_scene() -> tuple[viewer.Scene, float]:
    """The thesis' top, which falls to the ground and leaves it."""
    top, end = contact.spinning_top(), 0.5
    motion = somersault.integrate(
        top.body,
        top.state,
        (0.0, end),
        dt=1e-4,
        method="rkmk5",
        forces=top.forces,
        contacts=top.contacts,
        every=5,
    )
    tip = top.contacts[0].point
    shapes = (
        viewer.Cylinder((0.0, 0.0, -0.005), (0.0, 0.0, 0.005), 0.03, color="#44aa99", checkered=True),
        viewer.Cylinder(tip, (0.0, 0.0, -0.005), 0.0, 0.004, color="#777777"),
        viewer.Cylinder((0.0, 0.0, 0.005), (0.0, 0.0, 0.03), 0.003, color="#777777"),
    )
    return viewer.Scene("Top").ground().add(motion, shapes=shapes, trails=(("body", tip),)), end


def film() -> None:
    """Ten seconds of a dive, a flip and a top, and a still of them."""
    size, columns, labels = (300, 300), [], []
    for label, made in (
        ("an optimal dive", _dive_scene),
        ("the Dzhanibekov effect", _flip_scene),
        ("a top that touches the ground", _top_scene),
    ):
        scene, duration = made()
        slower = round(_FILM_SECONDS / duration)
        labels.append(f"{label}, {slower} times slower" if slower > 1 else label)
        times = list(np.linspace(0.0, duration, _FILM_SECONDS * _FILM_RATE))
        columns.append([Image.open(io.BytesIO(png)).convert("RGB") for png in pictures(scene, times, size)])
    font = ImageFont.load_default(15)
    frames = []
    for row in zip(*columns, strict=True):
        frame = Image.new("RGB", (size[0] * len(row), size[1] + 26), "white")
        pen = ImageDraw.Draw(frame)
        for i, (picture, label) in enumerate(zip(row, labels, strict=True)):
            frame.paste(picture, (size[0] * i, 0))
            pen.text((size[0] * (i + 0.5), size[1] + 13), label, "black", font, anchor="mm")
        frames.append(frame)
    still = frames[len(frames) // 3]
    still.quantize(128).save(FOLDER / "film.png", optimize=True)
    frames[0].save(
        FOLDER / "film.webp",
        save_all=True,
        append_images=frames[1:],
        duration=1000 // _FILM_RATE,
        loop=0,
        quality=55,
        method=6,
    )


ALL: dict[str, Callable[[], None]] = {
    "film": film,
    "integrate": integrate,
    "contact": touch,
    "optimise": optimise,
    "dive": dive,
    "trees": trees,
    "recorded": recorded,
    "lyapunov": lyapunov,
}

if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for chosen in sys.argv[1:] or ALL:
        ALL[chosen]()
