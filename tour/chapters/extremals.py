"""Beyond chapter 10: extremals to rounding from their boundary states, several of them, and harder ones."""

from __future__ import annotations

import textwrap
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from somersault import ftla, plotting
from tour import regulators, thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, words
from tour.slow_manifolds import Solved, collocated, solved, tip

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "Extremals to rounding"

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
#: Folds of the second link, and whole turns at its end.
_WAYS = {
    "as in the thesis": (np.pi, 0),
    "folded the other way": (-np.pi, 0),
    "the other way, θ₂ a turn less at the end": (-np.pi, -1),
    "as in the thesis, θ₂ a turn more at the end": (np.pi, 1),
}


def _reintegrated(extremal: ftla.Extremal) -> float:
    """The largest defect of a segment according to SciPy."""
    field, largest = extremal.system.field, 0.0
    for k in range(len(extremal.times) - 1):
        end = solve_ivp(
            lambda t, p: field(p),
            (extremal.times[k], extremal.times[k + 1]),
            extremal.nodes[k],
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        ).y[:, -1]
        largest = max(largest, float(np.abs(end - extremal.nodes[k + 1]).max()))
    return largest


_HEADER = (
    words("extremal"), words("status"), "cost", "residual", "spread of H", "Newton steps", "s",
)  # fmt: skip


def _row(name: str, each: Solved) -> list[str | Cell]:
    extremal = each.extremal
    low, high = extremal.hamiltonian_range()
    return [
        words(name),
        words(extremal.status.replace("_", " ")),
        f"{extremal.cost():.9f}",
        error_size(extremal.residual),
        error_size(high - low),
        f"{each.found.n_iterations}",
        f"{each.seconds:.2f}",
    ]


def _turned(travel: float, horizon: float) -> Solved:
    """The arm through a longer way."""
    began = time.perf_counter()
    initial, final = ((side * 0.5 * travel, 0.05, 0.0, 0.0) for side in (-1.0, 1.0))
    found = ftla.solve_arm(initial, final, horizon, fold=np.pi)
    return Solved(found, time.perf_counter() - began)


def _limited(extremal: ftla.Extremal) -> tuple[Solved, Array]:
    """The thesis' motion with torques limited to four fifths of their peaks."""
    began = time.perf_counter()
    peak = np.abs(extremal.control(np.linspace(0.0, 10.0, 1001))).max(axis=0)

    def family(s: float) -> Any:
        limits = tuple(peak * (1.0 - 0.2 * s))
        return ftla.arm(torque_limits=limits), thesis.ARM_INITIAL, thesis.ARM_FINAL, thesis.ARM_HORIZON

    return Solved(ftla.follow(family, extremal), time.perf_counter() - began), 0.8 * peak


def _torques(free: ftla.Extremal, limited: ftla.Extremal, limits: Array) -> Axes:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(6.4, 4.6), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    t = np.linspace(0.0, 10.0, 1001)
    for i, ax in enumerate(axes):
        ax.plot(t, free.control(t)[:, i], color="0.6", lw=1.2, label="without\nlimits")
        ax.plot(t, limited.control(t)[:, i], color=_COLOURS[i], lw=1.8, label="within\nlimits")
        for sign in (-1.0, 1.0):
            ax.axhline(sign * limits[i], color="0.3", lw=0.8, ls=(0, (4, 3)))
        ax.set_ylabel(f"torque u{'₁₂'[i]}, N m")
        ax.grid(color="0.92")
        ax.margins(x=0)
        plotting.label_ends(ax)
    axes[-1].set_xlabel("time, s")
    drawn: Axes = axes[0]
    return drawn


def _paths(found: dict[str, Solved]) -> Axes:
    """The path of the tip."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.subplots(1, len(found), sharex=True, sharey=True)
    for ax, (name, each), colour in zip(axes, found.items(), _COLOURS, strict=True):
        elbow, end = tip(each.extremal(np.linspace(0.0, 10.0, 301)))
        ax.plot(*elbow.T, color="0.8", lw=1.0)
        ax.plot(*end.T, color=colour, lw=1.6)
        for k in (0, 30, 60, 150, 240, 270, 300):
            ax.plot(*np.transpose([[0.0, 0.0], elbow[k], end[k]]), color="0.45", lw=0.8)
        ax.set_title(
            "\n".join(textwrap.fill(part, 18) for part in name.replace(", ", ",|").split("|")), fontsize=11
        )
        ax.set_aspect("equal")
        ax.axis("off")
    drawn: Axes = axes[0]
    return drawn


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    found = {name: solved(*way) for name, way in _WAYS.items()}
    motion = found["as in the thesis"]
    extremal, coarse = motion.extremal, collocated()
    ranked = sorted(found, key=lambda name: found[name].extremal.cost())
    defect = _reintegrated(extremal)
    page.lead(
        "The thesis' motion is found from its end states and its fold alone, in"
        f" {motion.seconds:.2f} s, to a"
        f" residual of {error_size(extremal.residual)}; it costs {extremal.cost():.9f} and is number"
        f" {ranked.index('as in the thesis') + 1} of {len(ranked)} extremals by cost. The cheapest,"
        f" “{ranked[0]}”, costs {found[ranked[0]].extremal.cost():.9f}."
    )
    page.text(
        "The start is a spline that folds the second link and unfolds it at the end, taken down to"
        " minimum effort"
        " by least squares. Its torques tell the costates, and so the nodes of segments of at most 0.4 s."
        " Newton's method on all nodes at once, with the transition matrices of the segments, takes them to"
        " rounding."
    )
    page.code(
        "found = ftla.solve_arm(initial, final, 10.0, fold=np.pi)\n"
        "found.success, found.extremal.residual, found.extremal.cost()\n"
        "ftla.arm_extremals(initial, final, 10.0)  # both folds, turns of the last θ₂: the cheapest first\n"
    )
    page.section("Which extremal it is")
    page.table(
        _HEADER,
        [_row(name, found[name]) for name in ranked],
        "Extremals of the thesis' problem, the cheapest first. Seconds are those of everything,"
        " from the end"
        " states on; timings vary from machine to machine.",
    )
    page.figure(
        "extremals-paths",
        _paths({name: found[name] for name in ranked}),
        "The paths of the tip, in colour, and of the elbow, in grey; the cheapest on the left.",
        "Four arms that turn by half a circle",
    )
    page.text(
        f"SciPy's DOP853 integrates every segment again and ends within {error_size(defect)} of the"
        " next node."
        f" The collocation solution, itself refined to 10⁻⁷, costs {coarse.verified_cost:.9f}:"
        f" {error_size(abs(coarse.verified_cost - extremal.cost()))} from the polished motion."
    )
    page.section("Harder problems")
    limited, limits = _limited(extremal)
    page.table(
        _HEADER,
        [
            _row("a turn of 2π in 20 s", _turned(2 * np.pi, 20.0)),
            _row("a turn of 4π in 40 s", _turned(4 * np.pi, 40.0)),
            _row("torques within 80 % of their peaks", limited),
        ],
        "The first two from their end states, the last by continuation in the limits.",
    )
    page.figure(
        "extremals-limited",
        _torques(extremal, limited.extremal, limits),
        "Torques with and without limits, which are dashed: a torque stays at its limit where it would exceed"
        " it, and is larger in between.",
        "Two torques over ten seconds; the limited ones are flat where the others peak",
    )
    page.section("Scalar problems")
    page.table(
        (words("x"), "horizon, s", "ẋ = −x + u", "off by", "ẋ = −x³ + u", "off by"),
        regulators.rows(),
        "Costs of ½ ∫ x² + u² dt. The linear problem beside its closed form at any horizon; the"
        " cubic one beside"
        " the closed form of the manifolds of its equilibrium, and for ten seconds beside a"
        " quadrature on the"
        " conserved Hamiltonian.",
    )
