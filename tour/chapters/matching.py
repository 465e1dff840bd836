"""Chapter 10: ends placed on the slow manifolds, matched in the middle, and polished."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from somersault import errors, ftla, ocp, plotting
from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, power, words
from tour.slow_manifolds import NAMES, collocated, flow, solved

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "From slow manifolds to an extremal"

_BLUE, _GREEN, _RED = "#2166ac", "#1b7837", "#b2182b"
#: Round values of the costates at both ends, where the searches begin.
_GUESS: dict[str, Any] = {"initial_costate": (-0.2, 0.0, -1.3, -0.1), "final_costate": (-0.2, 0.0, 1.3, 0.1)}
_CORRECTIONS = (2.0, 4.0, 6.0, 8.0)
#: How far states may be from the optimum while a motion follows it, rad and rad/s.
_FOLLOWED = 0.2


def _placement(last: float, tol: float = 1e-8) -> ftla.Placement:
    return ftla.Placement(thesis.ARM_DIMS, [0, 2], np.arange(0.25, last + 0.1, 0.25), tol=tol)


def _matching(guess: dict[str, Any]) -> ftla.Matching:
    """The thesis' match, its ends placed with averaging times up to 3 s."""
    return ftla.Matching(
        ftla.VariationalFlow(ftla.arm(), rtol=1e-8, atol=1e-10, max_steps=2000),
        thesis.ARM_INITIAL,
        thesis.ARM_FINAL,
        thesis.ARM_HORIZON,
        _placement(3.0, 1e-6),
        corrections=_CORRECTIONS,
        **guess,
    )


@cache
def _grid(short: bool) -> ftla.MatchingResult:
    """From round values; from the match rounded to three digits where there is little time."""
    if not short:
        return _matching(_GUESS).grid_search([[0.02, 0.1], [0.02, 0.1]])
    initial, final = np.round(_least_squares().ends[:, 4:], 3)
    guess = {"initial_costate": initial, "final_costate": final}
    return _matching(guess).grid_search([[0.002, 0.01], [0.002, 0.01]])


@cache
def _least_squares() -> ftla.MatchingResult:
    return _matching(_GUESS).least_squares([0])


def _followed_from(p: Array, sign: float) -> tuple[Array, Array]:
    """The motion from one end to the middle, as far as it can be integrated."""
    t = np.linspace(0.0, 5.0, 201)
    points = np.full((len(t), 8), np.nan)
    points[0] = p
    for k in range(1, len(t)):
        try:
            points[k] = flow().state(points[k - 1], sign * (t[k] - t[k - 1]))
        except (errors.IntegrationError, errors.EvaluationError):
            break
    return (t, points) if sign > 0 else (10.0 - t[::-1], points[::-1])


def _both_ends(start: Array, end: Array) -> tuple[Array, Array]:
    (t, first), (u, last) = _followed_from(start, 1.0), _followed_from(end, -1.0)
    return np.concatenate([t, u]), np.concatenate([first, last])


@dataclass(frozen=True)
class _Followed:
    """How long motions with an error at the start follow the optimum, s."""

    size: float
    without_placement: float
    with_placement: float
    left: float


def _time_followed(p: Array) -> float:
    t, points = _followed_from(p, 1.0)
    away = np.abs(points[:, :4] - solved().extremal(t)[:, :4]).max(axis=1)
    left = np.flatnonzero(~(away <= _FOLLOWED))
    return float(t[left[0]]) if len(left) > 0 else float(t[-1])


def _by_error() -> list[_Followed]:
    """How long motions follow the optimum whose costates λ₂ and λ₄ are off by so much, placed and not."""
    found, start = [], solved().extremal.nodes[0]
    for size in np.geomspace(1e-8, 1e-2, 7):
        off = np.add(start, size * np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0]))
        placed = _placement(3.5).place(flow(), off)
        left = float(np.abs(placed.p - start).max())
        found.append(_Followed(float(size), _time_followed(off), _time_followed(placed.p), left))
    return found


def _followed_figure(found: list[_Followed]) -> Axes:
    import matplotlib.pyplot as plt

    ax = plt.figure(figsize=(6.4, 3.4), layout="constrained").add_subplot()
    sizes = [each.size for each in found]
    ax.semilogx(sizes, [each.without_placement for each in found], "o-", color=_RED, lw=1.6, label="as it is")
    ax.semilogx(sizes, [each.with_placement for each in found], "s-", color=_GREEN, lw=1.6, label="placed")
    ax.set(xlabel="error of λ₂ and λ₄ at the start", ylabel="time followed, s", ylim=(0.0, None))
    ax.grid(color="0.92")
    plotting.label_ends(ax)
    return ax


def _errors(grid: ftla.MatchingResult) -> Axes:
    """Figure 10.4: distances from the collocation solution, and of that from the polished one."""
    import matplotlib.pyplot as plt

    t = np.linspace(0.0, 10.0, 401)
    reference = np.hstack([collocated().state(t), collocated().costate(t)])
    polished = solved().extremal(t)
    curves: dict[str, tuple[Array, Array, dict[str, Any]]] = {
        "matched −\ncollocated": (
            grid.nodes(t) - reference,
            reference,
            {"color": _GREEN, "lw": 3.0, "alpha": 0.5},
        ),
        "matched −\npolished": (grid.nodes(t) - polished, polished, {"color": _BLUE, "lw": 1.2}),
        "collocated −\npolished": (reference - polished, polished, {"color": _RED, "lw": 1.2}),
    }
    figure = plt.figure(figsize=(6.4, 5.4), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    for name, (difference, to, look) in curves.items():
        size = np.linalg.norm(difference, axis=1)
        axes[0].semilogy(t, size, label=name, **look)
        axes[1].semilogy(t, size / np.linalg.norm(to, axis=1), label=name, **look)
    for ax, label in zip(axes, ("difference ‖Δp‖", "relative, ‖Δp‖ / ‖p‖"), strict=True):
        ax.set_ylabel(label)
        ax.grid(color="0.92")
        ax.margins(x=0)
        plotting.label_ends(ax)
    axes[1].set_xlabel("time, s")
    drawn: Axes = axes[0]
    return drawn


def _largest(difference: Array) -> float:
    return float(np.linalg.norm(difference, axis=1).max())


def _table_rows(grid: ftla.MatchingResult) -> list[list[str | Cell]]:
    """Table 10.1, printed and here."""
    rows: list[list[str | Cell]] = []
    forward, backward = grid.meeting
    middle = solved().extremal(5.0)
    printed = zip(NAMES, thesis.ARM_MIDDLE, thesis.ARM_MIDDLE_BACKWARD, strict=True)
    for i, (name, plus, minus) in enumerate(printed):
        values = (plus, minus, forward[i], backward[i], middle[i])
        rows.append(
            [
                words(name),
                *(f"{value:.6f}".replace("-", "−") for value in values[:2]),
                error_size(abs(plus - minus)),
                *(f"{value:.6f}".replace("-", "−") for value in values[2:4]),
                error_size(abs(forward[i] - backward[i])),
                f"{middle[i]:.6f}".replace("-", "−"),
            ]
        )
    norm = float(np.linalg.norm(np.subtract(thesis.ARM_MIDDLE, thesis.ARM_MIDDLE_BACKWARD)))
    rows.append([words("norm"), "", "", error_size(norm), "", "", error_size(grid.mismatch), ""])
    return rows


def _counts(name: str, found: ftla.MatchingResult, iterations: int) -> list[str | Cell]:
    return [
        words(name), words(found.status), error_size(found.mismatch), f"{found.n_rounds}",
        f"{found.n_branches}", f"{found.n_flow_evaluations:,}", f"{iterations}",
    ]  # fmt: skip


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    grid, squares = _grid(measurements.setting.repeats == 1), _least_squares()
    extremal = solved().extremal
    times = extremal.times
    polished = {
        name: ftla.shoot(ftla.arm(), thesis.ARM_INITIAL, thesis.ARM_FINAL, times, found.nodes(times))
        for name, found in (("grid search", grid), ("least squares", squares))
    }
    gap = max(float(np.abs(each.nodes - extremal.nodes).max()) for each in polished.values())
    low, high = polished["least squares"].hamiltonian_range()
    page.lead(
        f"From round values of two costates at each end the grid search comes to a mismatch of"
        f" {error_size(grid.mismatch)} in {grid.n_flow_evaluations:,} flow evaluations, least squares to"
        f" {error_size(squares.mismatch)} in {squares.n_flow_evaluations:,}. Both polish to one"
        f" motion, the same to {error_size(gap)}, with a"
        f" residual of {error_size(polished['least squares'].residual)} and its Hamiltonian constant to"
        f" {error_size(high - low)}."
    )
    page.text(
        "Of eight numbers at each end four are given, the states. Two costates follow from the condition"
        " that the field has no part along the fast directions; λ₁ and λ₃ are left, and are searched for."
    )
    _placing(page)
    page.section("Matching")
    page.code(
        "placement = ftla.Placement((2, 4, 2), [0, 2], np.arange(0.25, 3.1, 0.25), tol=1e-6)\n"
        "matching = ftla.Matching(flow, initial, final, 10.0, placement, corrections=[2, 4, 6, 8],\n"
        "                         initial_costate=[-0.2, 0, -1.3, -0.1], final_costate=[-0.2, 0,"
        " 1.3, 0.1])\n"
        "matched = matching.least_squares([0])  # λ₁ is conserved; or .grid_search(spacing)\n"
        "found = ftla.shoot(arm, initial, final, times, matched.nodes(times))\n"
    )
    page.table(
        (words("at t = 5 s"), "printed, p⁺", "p⁻", "mismatch", "here, p⁺", "p⁻", "mismatch", "polished"),
        _table_rows(grid),
        "Table 10.1 beside the grid search from round values. The thesis' text gives"
        f" {error_size(thesis.ARM_MISMATCH)} for the norm, which is not that of its columns. The"
        " floor of the"
        " method is the error of the finite averaging time, 3 s here.",
    )
    page.table(
        (words("search"), words("status"), "mismatch", "rounds", "ends placed and followed",
         "flow evaluations", "Newton steps to polish"),
        [_counts(name, found, polished[name].n_iterations)
         for name, found in (("grid search", grid), ("least squares", squares))],
        "A flow evaluation is a spectrum over the averaging time, or a segment followed.",
    )  # fmt: skip
    t = np.linspace(0.0, 10.0, 401)
    reference = np.hstack([collocated().state(t), collocated().costate(t)])
    page.figure(
        "arm-matched",
        plotting.compare_motions(
            {"collocation": (t, reference), "grid search": (t, grid.nodes(t))},
            NAMES,
            {
                "collocation": {"color": _BLUE, "lw": 3.2, "alpha": 0.5},
                "grid search": {"color": _GREEN, "lw": 1.2},
            },
        ),
        "Figure 10.3: the collocation solution, in the place of that of GPOPS, and the matched"
        " motion on top.",
        "Eight panels in each of which two curves coincide",
    )
    distance = _largest(grid.nodes(t) - reference)
    exact = _largest(reference - extremal(t))
    page.figure(
        "arm-errors",
        _errors(grid),
        "Figure 10.4, absolute and relative. Polished, the matched motion is a reference to rounding, and"
        " tells which of the two was off.",
        "Curves of distances over ten seconds on logarithmic axes",
    )
    page.text(
        f"The matched motion is never further than {error_size(distance)} from the collocation"
        " solution; the"
        f" thesis finds 0.03. Against the polished motion the collocation solution is off by"
        f" {error_size(exact)} at most, so that what the thesis saw was the match."
    )


def _placing(page: Page) -> None:
    """Figure 10.2, and how it depends on the error at the start."""
    page.section("Placing")
    extremal = solved().extremal
    coarse = ocp.arm_motion(np.pi, tol=1e-3)
    ends = [np.concatenate([coarse.state(t), coarse.costate(t)]) for t in (0.0, 10.0)]
    ends[0][:4], ends[1][:4] = thesis.ARM_INITIAL, thesis.ARM_FINAL
    off = max(float(np.abs(p - extremal(t)).max()) for p, t in zip(ends, (0.0, 10.0), strict=True))
    directions: list[Any] = ["forward", "backward"]
    placed = [_placement(3.5).place(flow(), p, way) for p, way in zip(ends, directions, strict=True)]
    t = np.linspace(0.0, 10.0, 401)
    page.figure(
        "arm-placed",
        plotting.compare_motions(
            {
                "optimum": (t, extremal(t)),
                "no placement": _both_ends(*ends),
                "placed": _both_ends(*(each.p for each in placed)),
            },
            NAMES,
            {
                "optimum": {"color": _BLUE, "lw": 3.2, "alpha": 0.5},
                "no placement": {"color": _RED, "lw": 1.3},
                "placed": {"color": _GREEN, "lw": 1.3},
            },
        ),
        "Figure 10.2: the ends of a collocation solution, its mesh refined to 10⁻³ as that of the thesis,"
        f" integrated to the middle from both sides: as they are, costates {error_size(off)} off,"
        " and placed with"
        " averaging times up to 3.5 s.",
        "Eight panels; red curves leave the blue ones early, green ones late or not at all",
    )
    followed = _by_error()
    page.figure(
        "arm-followed",
        _followed_figure(followed),
        f"How long a motion stays within {_FOLLOWED} of the optimum in every state, by the error"
        " of its two costates"
        " at the start. As it is, each digit buys as long as the fast rate allows; placed, the time hardly"
        " depends on the error but on the averaging time: a start that is closer still is best left alone.",
        "Two curves over the size of the error: one falls, the other is level",
    )
    page.items(
        f"Costates {power(each.size)} off: followed for {each.without_placement:.1f} s as they are, for"
        f" {each.with_placement:.1f} s placed, which leaves {error_size(each.left)} of the error."
        for each in followed[::2]
    )
