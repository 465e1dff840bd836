"""Makes the pictures of the README and the book: `make pictures`. The dives need Chromium or Chrome.

Pages show them 560 pixels wide and telephones 360: letters must be large, lines are labelled at their ends.
"""

from __future__ import annotations

import importlib
import io
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from PIL import Image, ImageDraw, ImageFont

import somersault
from somersault import contact, exact, ocp, plotting, studies, viewer
from somersault.plotting.palette import MUTED
from somersault.viewer.film import pictures

FOLDER = Path(__file__).parent / "images"
#: Of a figure, inches and pixels per inch: twice as many as a page shows.
_SIZE, _DOTS = (5.6, 3.6), 200
#: The film: its length in seconds, pictures a second, and how many of them lead from its end to its start.
_FILM_SECONDS, _FILM_RATE, _FADED = 10, 12, 6
_GREY = "#777777"

plt.rcParams.update(
    {
        "font.size": 13,
        "axes.titlesize": 14,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.alpha": 0.3,
        "lines.linewidth": 2.2,
    }
)


def _axes(title: str) -> Axes:
    ax = plt.figure(figsize=_SIZE, layout="constrained").add_subplot()
    ax.set_title(title, loc="left", x=-0.14)
    return ax


def _label(
    ax: Axes, at: tuple[float, float], text: str, color: str, shift: tuple[float, float] = (6, 0)
) -> None:
    """A text beside a point, from which it is shifted by points of type."""
    ax.annotate(text, at, shift, textcoords="offset points", color=color, va="center", annotation_clip=False)


def _better(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """An arrow to where results are better, in fractions of the axes."""
    arrow = {"arrowstyle": "-|>", "color": "k", "lw": 1.5, "mutation_scale": 18}
    ax.annotate(
        "better",
        end,
        start,
        xycoords="axes fraction",
        textcoords="axes fraction",
        arrowprops=arrow,
        ha="center",
    )


def _save(name: str) -> None:
    drawn = io.BytesIO()
    plt.savefig(drawn, dpi=_DOTS)
    plt.close()
    _reduce(Image.open(drawn).convert("RGB"), name)


def _reduce(image: Image.Image, name: str, colors: int = 64) -> None:
    image.quantize(colors, dither=Image.Dither.NONE).save(FOLDER / name, optimize=True)


def integrate() -> None:
    """Error against work on case 2 of the thesis."""
    ax = _axes("A box that flips, after 10 s: error against work")
    problem = studies.Problem.case(2)
    for name, text, color, shift in (
        ("sie", "semi-implicit Euler", _GREY, (6, 0)),
        ("rk4", "Runge-Kutta, order 4", MUTED[1], (6, -7)),
        ("dmv2s", "variational, order 2", MUTED[2], (6, 8)),
        ("rkmk", "Lie group, order 4", MUTED[0], (6, 3)),
        ("rkmk8_b", "Lie group, order 8", MUTED[7], (6, -3)),
        ("pmv10", "variational, order 10", MUTED[6], (6, 0)),
    ):
        runs = studies.work_precision(problem, name, 10.0 ** np.arange(-1.0, -4.1, -1 / 3), repeats=1)
        # Methods for free bodies evaluate no equations; their steps are counted.
        work, errors = np.maximum(runs.evaluations, runs.steps), runs.errors["orientation"]
        shown = (work < 1e5) & np.isfinite(errors)
        ax.loglog(work[shown], errors[shown], color=color)
        _label(ax, (work[shown][-1], errors[shown][-1]), text, color, shift)
    ax.set_xlim(80, 1e5)
    ax.set_xlabel("evaluations of the equations (variational: steps)")
    ax.set_ylabel("error of the orientation (rad)")
    _better(ax, (0.3, 0.53), (0.2, 0.38))
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
    for method, order, color, shift in (
        ("rkmk", 4, MUTED[0], 4),
        ("rkmk5", 5, MUTED[2], -9),
        ("rkmk8", 8, MUTED[7], 0),
    ):
        for locate in (True, False):
            errors = np.array([np.linalg.norm(end(dt, method, locate) - reference) for dt in steps])
            ax.loglog(steps, errors, color=color if locate else _GREY, lw=2.2 if locate else 1.2)
            if locate:
                _label(ax, (steps[0], errors[0]), f"located: order {order}", color, (6, shift))
    _label(ax, (steps[0], 4e-5), "not located: order 1", _GREY, (6, 4))
    ax.set(xlim=(2.5e-5, 2.2e-3), ylim=(1e-17, 1e-3))
    ax.set_xlabel("step of the integration (s)")
    ax.set_ylabel("error of the position (m)")
    _better(ax, (0.6, 0.34), (0.6, 0.14))
    _save("contact.png")


def optimise() -> None:
    """Two extremals of the arm."""
    figure = plt.figure(figsize=_SIZE, layout="constrained")
    figure.suptitle("An arm folds, turns and unfolds with minimum effort", fontsize=14)
    motions = (
        (ocp.arm_motion(np.pi), "to the right first:\ncost"),
        (ocp.arm_motion(-np.pi, turn=-2 * np.pi), "to the left first:\nless cost,"),
    )
    for k, ((found, name), color) in enumerate(zip(motions, (MUTED[1], MUTED[0]), strict=True)):
        ax = figure.add_subplot(1, 2, k + 1)
        first, second = np.array([found.state(t)[:2] for t in np.linspace(0.0, 10.0, 201)]).T
        elbow = 2.0 * np.array([np.cos(first), np.sin(first)])
        hand = elbow + 0.5 * np.array([np.cos(first + second), np.sin(first + second)])
        for at in range(0, 201, 20):
            ax.plot(*np.transpose([(0.0, 0.0), elbow[:, at], hand[:, at]]), color="#bbbbbb", lw=1.6)
        ax.plot(*hand, color=color, lw=2.6)
        ax.plot(0.0, 0.0, "ko", ms=7)
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.set(xlim=(-1.1, 2.6), ylim=(-3.0, 3.0))
        ax.set_title(f"{name} {found.cost:.4f}", fontsize=13, color=color)
        _label(ax, (0.0, -2.75), "start", "k", (10, 0))
        _label(ax, (0.0, 2.75), "after 10 s", "k", (10, 0))
        _label(ax, (1.3, -2.0), "path of\nthe hand", color)
    _save("optimise.png")


def _frames(scene: viewer.Scene, times: Sequence[float], size: tuple[int, int]) -> list[Image.Image]:
    return [Image.open(io.BytesIO(png)).convert("RGB") for png in pictures(scene, list(times), size)]


def _write(pen: ImageDraw.ImageDraw, center: tuple[float, float], text: str, size: float) -> None:
    pen.multiline_text(
        center, text, "black", ImageFont.load_default(size), anchor="mm", align="center", spacing=0.2 * size
    )


def _strip(name: str, dive: ocp.DiveSolution, fractions: tuple[float, ...]) -> None:
    """Six moments of a dive, three in a row."""
    side, below, columns = 372, 104, 3
    scene = viewer.Scene(name).add(dive, trails=()).camera("side", follow=True, zoom=1.05)
    strip = Image.new("RGB", (side * columns, (side + below) * (len(fractions) // columns)), "white")
    pen = ImageDraw.Draw(strip)
    frames = _frames(scene, [fraction * dive.duration for fraction in fractions], (side, side))
    for i, (fraction, frame) in enumerate(zip(fractions, frames, strict=True)):
        x, y = side * (i % columns), (side + below) * (i // columns)
        strip.paste(frame, (x, y))
        at = int(fraction * (len(dive.t) - 1))
        turned = [f"{dive.somersaults[at]:.1f} somersaults"]
        if np.ptp(dive.twists) > 0.01:
            turned.append(f"{abs(dive.twists[at]):.1f} twists")
        else:
            turned.insert(0, f"after {dive.t[at]:.1f} s")
        _write(pen, (x + side / 2, y + side + below / 2), "\n".join(turned), 36)
    _reduce(strip, name, 128)


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
    found = motion.validate(performances, scores)
    ax = _axes("Scores from motion alone (synthetic motions)")
    ax.plot(scores, found.predictions, "o", color=MUTED[0], ms=6)
    ends = np.array([min(scores), max(scores)])
    ax.plot(ends, ends, color=_GREY, lw=1.5)
    _label(ax, (ends[1], ends[1]), "as the judge", _GREY, (-100, 4))
    _label(ax, (ends[0], ends[1]), f"off by {found.rms_error:.2f} points (rms)", MUTED[0], (0, -4))
    ax.set_xlabel("score of the judge")
    ax.set_ylabel("score of the model\nthat has not seen it")
    _save("recorded.png")


def lyapunov() -> None:
    """Finite-time exponents of the thesis' arm along its optimal motion."""
    ftla: Any = importlib.import_module("somersault.ftla")
    flow = ftla.VariationalFlow(ftla.arm())
    # In the middle of the optimal motion (Table 10.1), where the field is slow.
    middle = (-0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651)
    times = np.linspace(0.1, 5.0, 50)
    exponents = np.array([found.exponents for found in flow.spectra(middle, times)])
    ax = _axes("Optimal control of an arm: fast and slow directions")
    for k, row in enumerate(exponents.T):
        ax.plot(times, row, color=MUTED[1] if abs(exponents[-1, k]) > 2.0 else MUTED[0])
    for height, text, color in (
        (3.0, "two grow fast", MUTED[1]),
        (0.0, "four are slow", MUTED[0]),
        (-3.0, "two decay fast", MUTED[1]),
    ):
        _label(ax, (times[-1], height), text, color)
    ax.set(xlim=(0, 7.4), ylim=(-12, 12), xticks=range(6))
    ax.set_xlabel("averaging time (s)", loc="left")
    ax.set_ylabel("growth rate of\na perturbation (1/s)")
    _save("lyapunov.png")


def _dive_scene() -> tuple[viewer.Scene, float]:
    """5174D, and its duration."""
    dive = ocp.dive_5174d().solve()
    scene = viewer.Scene("Dive").add(dive, trails=()).water().platform(dive.dive.options["platform"])
    return scene.camera("side", follow=True, zoom=1.1), dive.duration


def _flip_scene() -> tuple[viewer.Scene, float]:
    """A T of two bars that turns about its middle axis: it flips over and back, the Dzhanibekov effect."""
    body = somersault.RigidBody(0.1, (3.45e-5, 4.02e-5, 7.05e-5))
    # So slow that the eye follows it from picture to picture.
    start = somersault.State(angular_velocity=(0.0, 5.0, 0.02))
    t = np.linspace(0.0, _FILM_SECONDS, 1200)
    turned = exact.FreeBody(body, start)(t)
    bars = [
        viewer.Box(lengths, center=place, color=color)
        for lengths, place, color in (
            ((0.09, 0.012, 0.016), (0.0, -0.0136, 0.0), "#cc6677"),
            ((0.018, 0.05, 0.016), (0.0, 0.0164, 0.0), "#332288"),
        )
    ]
    return viewer.Scene("Flip").add(turned, shapes=bars, trails=()).camera("corner", zoom=1.1), _FILM_SECONDS


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
    scene = viewer.Scene("Top").add(motion, shapes=shapes, trails=(("body", tip),))
    return scene.camera("corner", zoom=1.05), end


def film() -> None:
    """Ten seconds of a dive, a flip and a top, and a still of them."""
    side, below, columns, labels = 256, 66, [], []
    for label, made in (
        ("an optimal dive", _dive_scene),
        ("the Dzhanibekov flip", _flip_scene),
        ("a top on the ground", _top_scene),
    ):
        scene, duration = made()
        slower = round(_FILM_SECONDS / duration)
        labels.append(f"{label}\n{f'{slower} times slower' if slower > 1 else 'in real time'}")
        columns.append(_frames(scene, np.linspace(0.0, duration, _FILM_SECONDS * _FILM_RATE), (side, side)))
    frames = []
    for row in zip(*columns, strict=True):
        frame = Image.new("RGB", (side * len(row), side + below), "white")
        pen = ImageDraw.Draw(frame)
        for i, (picture, label) in enumerate(zip(row, labels, strict=True)):
            frame.paste(picture, (side * i, 0))
            _write(pen, (side * (i + 0.5), side + below / 2), label, 24)
        frames.append(frame)
    # The film runs in a loop: its end fades into its start.
    for i, frame in enumerate(frames[-_FADED:]):
        frames[i - _FADED] = Image.blend(frame, frames[0], (i + 1) / (_FADED + 1))
    _reduce(frames[len(frames) // 3], "film.png", 128)
    frames[0].save(
        FOLDER / "film.webp",
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 / _FILM_RATE),
        loop=0,
        quality=40,
        method=6,
    )


def goddard() -> None:
    """The rocket of the guide, with its arcs."""
    rocket = ocp.ControlProblem(
        lambda x, u: [
            x.v,
            (3.5 * u.thrust - 310 * x.v**2 * np.exp(-500 * (x.r - 1))) / x.m - 1 / x.r**2,
            -7 * u.thrust,
        ],
        states=("r", "v", "m"),
        controls=("thrust",),
        initial=[1, 0, 1],
        final={"m": 0.6},
        duration=(0.05, 1),
        bounds={"thrust": (0, 1)},
        end_cost=lambda x: -x.r,
    )
    with plt.rc_context({"font.size": 11}):
        axes = plt.figure(figsize=(7.2, 7.2), layout="constrained").subplots(4, 1, sharex=True)
        plotting.control_history(rocket.polish(rocket.solve()), axes)
    _save("goddard.png")


ALL: dict[str, Callable[[], None]] = {
    "film": film,
    "integrate": integrate,
    "contact": touch,
    "optimise": optimise,
    "goddard": goddard,
    "dive": dive,
    "trees": trees,
    "recorded": recorded,
    "lyapunov": lyapunov,
}

if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for chosen in sys.argv[1:] or ALL:
        ALL[chosen]()
