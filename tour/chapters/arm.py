"""The arm of 8.4: states, costates, torques and Hamiltonian by collocation, and the other extremals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from somersault import multibody, ocp, plotting, viewer
from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, power, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "The two-link arm by collocation"

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_TOLERANCE = 1e-7
_STATES = ("θ₁", "θ₂", "θ̇₁", "θ̇₂")
_COSTATES = ("λ₁", "λ₂", "λ₃", "λ₄")


def extremals() -> dict[str, ocp.CollocationResult]:
    """Motions that satisfy the conditions of an optimum, by where the search began."""
    return {
        "straight line": ocp.arm_motion(tol=_TOLERANCE),
        "folded, as in the thesis": ocp.arm_motion(np.pi, tol=_TOLERANCE),
        "folded the other way": ocp.arm_motion(-np.pi, tol=_TOLERANCE),
        "the other way, θ₂ a turn less at the end": ocp.arm_motion(-np.pi, -2 * np.pi, tol=_TOLERANCE),
    }


def _panels(t: Array, rows: Sequence[tuple[Array, Sequence[str], str]]) -> Axes:
    """Curves over time, one panel for each group."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(6.4, 2.6 * len(rows) + 0.4), layout="constrained")
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (values, names, label) in zip(axes, rows, strict=True):
        for column, name, colour in zip(values.T, names, _COLOURS, strict=False):
            ax.plot(t, column, color=colour, label=name, lw=1.6)
        ax.set_ylabel(label)
        ax.grid(color="0.92")
        ax.margins(x=0)
        plotting.label_ends(ax)
    axes[-1].set_xlabel("time, s")
    drawn: Axes = axes[0]
    return drawn


def _hamiltonians(results: dict[float, ocp.CollocationResult]) -> Axes:
    """Hamiltonian over time for several tolerances."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(6.4, 5.0), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    finest = results[min(results)]
    level = float(np.median(finest.hamiltonian))
    for (tolerance, result), colour in zip(
        results.items(), (_COLOURS[2], "#c1121f", _COLOURS[0]), strict=True
    ):
        label = f"tolerance {power(tolerance)}"
        axes[0].plot(result.t[:-1], result.hamiltonian, color=colour, lw=1.2)
        away = np.maximum(np.abs(result.hamiltonian - level), 1e-13)
        axes[1].semilogy(result.t[:-1], away, color=colour, lw=1.0, label=label)
    axes[0].set_ylabel("Hamiltonian")
    axes[1].set_ylabel("distance from\nits median")
    axes[1].set_xlabel("time, s")
    for ax in axes:
        ax.grid(color="0.92")
        ax.margins(x=0)
        plotting.label_ends(ax)
    drawn: Axes = axes[0]
    return drawn


def _scene(shown: dict[str, ocp.CollocationResult]) -> viewer.Scene:
    """Motions side by side, from above."""
    arm = multibody.two_link_arm()
    bars = {
        "upper": viewer.Capsule((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), 0.06),
        "lower": viewer.Capsule((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), 0.045),
    }
    scene = viewer.Scene("The arm of thesis 8.4")
    t = np.linspace(0.0, 10.0, 401)
    for panel, (name, result) in enumerate(shown.items()):
        x = result.state(t)
        scene.add(
            arm,
            t,
            x[:, :2],
            x[:, 2:],
            shapes=bars,
            label=name,
            panel=panel,
            trails=[("lower", (0.5, 0.0, 0.0))],
        )
    return scene.camera("top").play(2.0)


def _row(name: str, result: ocp.CollocationResult) -> list[str | Cell]:
    return [
        words(name),
        words(result.status.replace("_", " ")),
        f"{result.cost:.6f}",
        f"{result.verified_cost:.6f}",
        error_size(result.max_defect),
        error_size(result.terminal_error),
        error_size(result.hamiltonian_spread),
        f"{len(result.meshes)}, {result.meshes[-1]['n_points']}",
        f"{sum(mesh['seconds'] for mesh in result.meshes):.2f}",
    ]


_HEADER = (
    words("start of the search"), words("status"), "cost", "cost, re-integrated", "largest defect",
    "error at the end", "spread of H", "meshes, points", "s",
)  # fmt: skip


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    found = extremals()
    folded = found["folded, as in the thesis"]
    turned = found["the other way, θ₂ a turn less at the end"]
    tolerances = {tol: ocp.arm_motion(np.pi, tol=tol) for tol in (1e-4, 1e-5, 1e-6)}
    coarse = ocp.arm_motion(np.pi, n_intervals=10, max_meshes=1)
    spreads = [result.hamiltonian_spread for result in tolerances.values()]
    page.lead(
        f"The motion of thesis 8.4 costs {folded.verified_cost:.5f}, and an integration between its nodes"
        f" agrees to {error_size(folded.max_defect)}. The spread of its Hamiltonian shrinks from"
        f" {error_size(spreads[0])} to {error_size(spreads[-1])} as the tolerance goes from 10⁻⁴ to 10⁻⁶. The"
        f" same final posture is reached with θ₂ a turn less for {turned.verified_cost:.5f}."
    )
    page.text(
        "An arm of two rods on a table turns by 180° in ten seconds with minimum effort"
        " ½ ∫ u₁² + ½ u₂² dt. The joint at the wall is damped, the elbow is not: the arm first folds its"
        " short second link, turns slowly, and unfolds it at the end. The library finds the motion in the"
        " place of GPOPS: collocation at Legendre–Gauss–Radau points, on meshes refined until each interval"
        " is as accurate as requested, with exact derivatives; the multipliers of its program are the"
        " costates.",
    )
    page.code(
        "import numpy as np\nfrom somersault import ocp\n\n"
        "found = ocp.arm_motion(np.pi, tol=1e-7)  # θ₂ = π along the middle of the guess\n"
        "found.status, found.cost, found.verified_cost, found.max_defect\n"
        "found.t, found.x, found.u, found.costates, found.hamiltonian\n"
    )
    t = np.linspace(0.0, 10.0, 1001)
    page.section("States, costates and torques")
    x, costates = folded.state(t), folded.costate(t)
    page.figure(
        "arm-states",
        _panels(
            t,
            [
                (x[:, :2], _STATES[:2], "angles, rad"),
                (x[:, 2:], _STATES[2:], "rates, rad/s"),
                (costates[:, :2], _COSTATES[:2], "costates of angles"),
                (costates[:, 2:], _COSTATES[2:], "costates of rates"),
            ],
        ),
        "Figure 8.4: states and costates. A fast stage that folds the arm, a slow one, a fast one that"
        " unfolds it. λ₁ is constant, as nothing depends on θ₁.",
        "Four panels of curves over ten seconds, steep at both ends and flat between",
    )
    page.figure(
        "arm-torques",
        _panels(t, [(folded.control(t), ("u₁", "u₂"), "torque, N m")]),
        "Figure 8.5: torques. That of the wall falls steadily and brakes in the second half; that of the"
        " elbow acts at both ends, where the second link folds and unfolds.",
        "Two curves over ten seconds",
    )
    rows: list[list[str | Cell]] = []
    middle = np.concatenate([folded.state(5.0), folded.costate(5.0)])
    for name, printed, value in zip((*_STATES, *_COSTATES), thesis.ARM_MIDDLE, middle, strict=True):
        rows.append([words(name), _signed(printed), _signed(value), error_size(abs(value - printed))])
    page.table(
        (words("at t = 5 s"), "printed, p⁺", "here", "difference"),
        rows,
        "Beside the matching point of Table 10.1, which the thesis reaches by another method; its own two"
        " columns differ by up to 5.6×10⁻⁴.",
    )
    page.section("The Hamiltonian")
    page.figure(
        "arm-hamiltonian",
        _hamiltonians(tolerances),
        "Figure 8.6: the Hamiltonian for three tolerances. It is constant along an optimum, and the tighter"
        " the tolerance the more it is so. Below its distance from the median of the tightest.",
        "Three curves over ten seconds, and their distances from a constant on a logarithmic axis",
    )
    page.table(
        _HEADER,
        [_row(f"tolerance {power(tolerance)}", result) for tolerance, result in tolerances.items()],
        "Defects: each interval of the mesh re-integrated from its first node, relative. The error at"
        " the end is that of one integration from start to end, which the system makes grow; it is no measure"
        " of the solution.",
    )
    page.section("Other extremals, and a false one")
    page.table(
        _HEADER,
        [*(_row(name, result) for name, result in found.items()), _row("ten intervals, not refined", coarse)],
        "The thesis shows one motion; there are several. Folded the other way the arm pays more; to end with"
        " θ₂ a turn less is the same posture and pays less than the thesis' motion.",
    )
    page.text(
        "The last row shows that success of a solver is not enough: its program ended as"
        f" “{coarse.report.status}” at a cost of {coarse.cost:.4f}, and the motion does not exist. The report"
        f" calls it “{coarse.message}”."
    )
    shown = {
        "as in the thesis": folded,
        "the other way": found["folded the other way"],
        "θ₂ a turn less": turned,
    }
    _scene(shown).write(page.folder / "arm_motion.html")
    page.add(
        '<iframe src="arm_motion.html" title="Three motions of the arm" loading="lazy" '
        'style="width:100%;height:26em;border:1px solid #ddd"></iframe>'
        '<p class="caption">Three extremals, seen from above, at twice the speed;'
        ' <a href="arm_motion.html">on a page of its own</a>.</p>'
    )


def _signed(value: float) -> str:
    return f"{value:.6f}".replace("-", "−")
