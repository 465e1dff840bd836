"""Chapter 3 of the thesis: the planar and the spatial dive, found and re-integrated."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from somersault import ocp, plotting, viewer
from tour.chapters.divers import POSTURES
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, number, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "Two dives, optimised"

_COLOURS = {
    "A": "#4477aa",
    "C": "#66ccee",
    "D": "#228833",
    "E": "#ccbb44",
    "H": "#cc6677",
    "I": "#aa3377",
}
_TURN = 2.0 * np.pi


def _frames(dive: ocp.DiveSolution, count: int, view: str, n_rows: int, spacing: float = 1.5) -> Axes:
    """Equally spaced frames, side by side, each about its centre of mass."""
    model = dive.dive.diver.model
    up = 1 if model.n_positions == 12 else 2
    shown = np.linspace(0, len(dive) - 1, count).round().astype(int)
    columns = -(-count // n_rows)
    figure = plt.figure(figsize=(1.05 * columns, 2.1 * n_rows), layout="constrained")
    axes = figure.subplots(n_rows, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for k, node in enumerate(shown):
        ax, q = axes[k // columns], dive.q[node].copy()
        center = model.center_of_mass(q)
        offset = spacing * (k % columns)
        # the frames of the front view go along y
        if view == "xz":
            q[0] += offset - center[0]
        else:
            q[1] += offset - center[1]
        q[up] -= center[2]
        plotting.tree_configuration(model, q, view, ax=ax, colour="#ddcc77")
        ax.text(offset, -1.35, f"{dive.t[node]:.2f} s", ha="center", va="top", fontsize=13)
    for ax in axes:
        ax.set(xlim=(-0.6 * spacing, spacing * (columns - 0.4)), ylim=(-1.55, 1.25), xlabel="", ylabel="")
        ax.set_aspect("equal")
        ax.axis("off")
    first: Axes = axes[0]
    return first


def _weights(dive: ocp.DiveSolution, ax: Axes) -> Axes:
    """The weights over time."""
    t = np.linspace(0.0, dive.duration, 600)
    weights = CubicHermiteSpline(dive.t, dive.channels, dive.channel_rates)(t)
    for name, weight in zip(dive.dive.postures[1:], weights.T, strict=True):
        ax.plot(t, weight, color=_COLOURS[name], lw=1.8)
        # The first of the peaks, of which some are as high as others.
        high = weight > 0.9 * weight.max()
        first = int(high.argmax())
        top = first + int(np.argmax(np.where(np.logical_and.accumulate(high[first:]), weight[first:], 0.0)))
        ax.annotate(
            name,
            (t[top], weight[top]),
            (0.0, 3.0),
            textcoords="offset points",
            color=_COLOURS[name],
            ha="center",
        )
    ax.set(xlabel="time, s", ylabel="weight", xlim=(0.0, dive.duration), ylim=(-0.04, 1.16))
    ax.axhline(0.0, color="0.85", lw=0.8, zorder=0)
    ax.axhline(1.0, color="0.85", lw=0.8, zorder=0)
    return ax


def _projections(dive: ocp.DiveSolution) -> tuple[Array, Array]:
    """Angular velocity along the world's lateral axis, and along the body's long axis."""
    z_y = -np.sin(dive.tilt)
    return dive.somersault_rate + z_y * dive.twist_rate, dive.twist_rate + z_y * dive.somersault_rate


def _integral(rate: Array, t: Array) -> float:
    return float(np.trapezoid(rate, t)) / _TURN


def _rates(dive: ocp.DiveSolution) -> Axes:
    """Figure 3.4 in numbers: rates of the angles, and projections of the angular velocity."""
    lateral, long = _projections(dive)
    figure = plt.figure(figsize=(6.4, 4.6), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    for ax, rate, projection, name, colour in (
        (top, dive.somersault_rate, lateral, "somersault", "#228833"),
        (bottom, dive.twist_rate, long, "twist", "#4477aa"),
    ):
        ax.plot(dive.t, rate / _TURN, color=colour, lw=1.9, label=f"rate of\nthe {name}")
        ax.plot(dive.t, projection / _TURN, color=colour, lw=1.2, ls="--", label="projection of\nω (dashed)")
        ax.axhline(0.0, color="0.85", lw=0.8, zorder=0)
        ax.set_ylabel("turns per second")
        plotting.label_ends(ax)
    bottom.set(xlabel="time, s", xlim=(0.0, dive.duration))
    drawn: Axes = top
    return drawn


def _turns(dive: ocp.DiveSolution) -> Axes:
    """Somersaults, twists and tilt over weights."""
    figure = plt.figure(figsize=(6.4, 5.4), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.plot(dive.t, dive.somersaults, color="#228833", lw=1.9, label="somersaults")
    top.plot(dive.t, dive.twists, color="#4477aa", lw=1.9, label="twists")
    top.plot(dive.t, dive.tilt / _TURN, color="#cc6677", lw=1.2, label="tilt")
    top.set_ylabel("turns")
    plotting.label_ends(top)
    _weights(dive, bottom)
    drawn: Axes = top
    return drawn


def _scene(dive: ocp.DiveSolution, title: str) -> viewer.Scene:
    scene = viewer.Scene(title)
    for name, start, _ in dive.phases:
        scene.caption(start, f"mostly {name}: {POSTURES[name]}")
    scene.add(dive)
    return scene.water(0.0).platform(dive.dive.options["platform"]).camera("corner").play(0.5)


def _shown(page: Page, scene: viewer.Scene, name: str, caption: str) -> None:
    scene.write(page.folder / f"{name}.html")
    page.add(
        f'<iframe src="{name}.html" title="{scene.title}" loading="lazy" '
        'style="width:100%;height:34em;border:1px solid #ddd"></iframe>'
        f'<p class="caption">{caption} Drag to turn, scroll or pinch to come closer; <a href="{name}.html">on'
        " a page of its own</a>.</p>"
    )


def _table(page: Page, dive: ocp.DiveSolution, seconds: float) -> None:
    """What was found, beside what integrations of another kind make of it."""
    verified, report, options = dive.verify(), dive.report, dive.dive.options
    spread = np.abs(dive.angular_momentum - [0.0, dive.momentum, 0.0]).max() / dive.momentum
    rows: list[list[str | Cell]] = [
        [words("status"), words(f"{dive.status} in {report.nit} steps of the last stage, {seconds:.2f} s")],
        [words("unknowns"), str(dive.dive.n_variables)],
        [
            words("residuals: stationarity, feasibility, complementarity"),
            " · ".join(map(error_size, (report.stationarity, report.feasibility, report.complementarity))),
        ],
        [words("angular momentum, kg m²/s"), number(dive.momentum, 3)],
        [words("its change from node to node, relative"), error_size(float(spread))],
        [
            words("its change in the full dynamics, tolerance 10⁻¹⁴, relative"),
            error_size(verified.momentum_drift),
        ],
        [
            words("somersaults, found and re-integrated"),
            f"{dive.somersaults[-1]:.6f} · {verified.somersaults:.6f}",
        ],
        [words("twists, found and re-integrated"), f"{dive.twists[-1]:.6f} · {verified.twists:.6f}"],
        [
            words("entry off the vertical, found and re-integrated, °"),
            " · ".join(
                error_size(float(np.degrees(angle))) for angle in (dive.entry_angle, verified.entry_angle)
            ),
        ],
        [words("largest defect of the orientation, rad"), error_size(verified.defect)],
        [
            words("reduced flight against full dynamics, largest angle, rad"),
            error_size(verified.full_dynamics_defect),
        ],
        [
            words("least weight, greatest sum less one"),
            " · ".join((_signed(verified.least_channel), _signed(verified.greatest_sum - 1.0))),
        ],
    ]
    if verified.least_distance is not None and verified.nearest_limbs is not None:
        limbs = " and ".join(name.replace("_", " ") for name in verified.nearest_limbs)
        rows.append(
            [words(f"minimum distance of limbs, mm ({limbs})"), number(1e3 * verified.least_distance, 1)]
        )
    x, _, z = verified.take_off_velocity
    rows.append([words("velocity at take-off, ahead and up, m/s"), f"{x:.2f} · {z:.2f}"])
    page.table(
        (words("quantity"), "value"),
        rows,
        f"Lean at take-off {np.degrees(dive.lean):.0f}°, platform {options['platform']:g} m, entry"
        f" {options['entry_distance']:g} m ahead after {dive.duration:g} s; cost ½ (L/L₀)² +"
        f" ½·{options['rate_penalty']:g} ∫ ẇ² dt with L₀ = m h²/(1 s).",
    )


def _signed(value: float) -> str:
    """A small number with its sign."""
    return ("−" if value < 0.0 else "") + error_size(abs(value))


def _phases(dive: ocp.DiveSolution) -> str:
    return ", ".join(f"{name} {start:.2f}–{end:.2f} s" for name, start, end in dive.phases)


def _throw(dive: ocp.DiveSolution) -> str:
    """When the twists begin and end."""
    tilted = int(np.argmax(np.abs(dive.tilt) > np.radians(1.0)))
    whole = int(np.argmax(np.abs(dive.twists - dive.twists[-1]) < 1e-3))
    return (
        f"The tilt passes 1° after {dive.somersaults[tilted]:.2f} somersaults, {dive.t[tilted]:.2f} s, and"
        f" the twists are whole at {dive.t[whole]:.2f} s."
    )


def _pike(page: Page, dive: ocp.DiveSolution, seconds: float) -> None:
    page.section("107B: forward three and a half somersaults, pike")
    page.text(
        "One weight moves the nine joints of the planar diver from layout (A) to closed pike (H) and back."
        " Flight"
        " is reduced by its momentum, which the thesis' explicit Euler steps do not keep: what is"
        " integrated is one"
        " angle, and momentum is constant to rounding. The search finds weight and momentum together."
    )
    page.code("from somersault import ocp\n\ndive = ocp.dive_107b().solve()\n")
    _table(page, dive, seconds)
    _shown(page, _scene(dive, "107B"), "dive", "107B at half speed.")
    page.figure(
        "dive-frames",
        _frames(dive, 14, "xz", 2),
        "As Figure 3.2: equally spaced frames, left to right, top to bottom, each about its centre of mass"
        " (cross).",
        "A diver leans forward, folds, turns over three and a half times and opens to enter hands first",
    )
    exit_ = dive.phases[-1][1]
    ax = _weights(dive, plt.figure(figsize=(6.4, 2.8), layout="constrained").add_subplot())
    ax.axvline(exit_, color="0.6", lw=0.9, ls=":")
    page.figure(
        "dive-weight",
        ax,
        "As Figure 3.3: the weight of the pike over time. The diver is more in the pike than in layout until"
        f" {exit_:.2f} s of {dive.duration:g} s: a late exit, as 4.2.1 describes.",
        "A weight that rises from zero to one, stays there, and falls to zero before the end",
    )


def _others(page: Page, dive: ocp.DiveSolution, seconds: float) -> None:
    """The same dive by other joint motions, in other times, and as the thesis steps it."""
    course = dive.dive.template or []
    found = [("A and H", dive, seconds)]
    for name, other in (
        ("A and H, the thesis' 16 parameters", dive.dive.replace(n_par=19)),
        ("A, H and G", dive.dive.replace(postures="AHG", template=course)),
        ("a spline for each of nine joints", dive.dive.replace(channels="joints")),
        ("A and H in 2 s", dive.dive.replace(duration=2.0)),
    ):
        began = time.perf_counter()
        solution = other.solve()
        found.append((name, solution, time.perf_counter() - began))
    rows: list[list[str | Cell]] = [
        [
            words(name),
            str(solution.dive.n_variables),
            number(solution.momentum, 2),
            "0",
            number(float(np.degrees(solution.verify().entry_angle)), 3),
            number(solution.report.cost, 5),
            f"{1e3 * passed:.0f}",
            words(solution.status),
        ]
        for name, solution, passed in found
    ]
    rolled = dive.literal()
    began = time.perf_counter()
    solved = dive.literal(optimise=True)
    passed = time.perf_counter() - began
    for name, literal, milliseconds in (
        ("A and H, rolled out by explicit Euler, N = 200", rolled, ""),
        ("A and H, solved under explicit Euler, N = 200", solved, f"{1e3 * passed:.0f}"),
    ):
        # the rotation of the torso between the postures of both ends is that of the accurate dive
        turned = (literal.somersaults[-1] - dive.somersaults[-1]) * 360.0
        report = literal.report
        rows.append(
            [
                words(name),
                str(dive.dive.n_variables),
                number(float(literal.angular_momentum[0]), 2),
                f"{100.0 * literal.momentum_change:+.1f} %, at most"
                f" {100.0 * (literal.angular_momentum.max() / literal.angular_momentum[0] - 1.0):+.1f} %",
                number(abs(float(turned)), 3),
                words("") if report is None else number(report.cost, 5),
                milliseconds,
                words("") if report is None else words(report.status),
            ]
        )
    page.table(
        (
            words("joint motion"),
            "unknowns",
            "momentum at take-off, kg m²/s",
            "its change in the air",
            "entry off the vertical, °",
            "cost",
            "ms",
            words("status"),
        ),
        rows,
        "Ten coefficients less four that the ends fix, and the momentum, are seven unknowns; with nineteen"
        " coefficients they are sixteen, as the thesis has them."
        " A third posture changes little, as 3.1 says. Joints of their own save momentum, at many times the"
        " work; for"
        " them the penalty counts rates over the distance from A to H. Explicit Euler (2.8) on the full"
        " dynamics, as the thesis has it, does not conserve the momentum: it rises while the diver folds and"
        " falls when he opens, so that the same weight turns too far, and what is optimal there exploits"
        " its steps.",
    )


def _torques(page: Page, dive: ocp.DiveSolution) -> None:
    """The largest joint forces."""
    peaks = sorted(dive.peak_torques.items(), key=lambda item: -abs(item[1][0]))[:8]
    page.table(
        (words("joint of"), "largest torque, N m", "at, s"),
        [
            [words(name.replace("_", " ")), number(torque, 0), number(time, 2)]
            for name, (torque, time) in peaks
        ],
        "What the joints must give, by hybrid dynamics along the motion: the cost asks for smooth weights,"
        " not for torques that a diver has.",
    )


def _twisting(page: Page, dive: ocp.DiveSolution, seconds: float) -> None:
    page.section("5174D: forward three and a half somersaults with two twists")
    page.text(
        "Postures C, A, D, E and I of the thesis, and H for the somersaults after the twists. The search"
        " begins with"
        " a template of phases: somersault with the arms sideways, throw, twists with the arms overhead,"
        " square-out, pike, entry, which is the order of a competition dive. The postures of throw and twists"
        " may have weights from 0.22 of the flight on; from 0 on, the dive of least momentum throws at once."
        f" In the dive found these weigh most: {_phases(dive)}."
        f" {_throw(dive)}"
    )
    if not dive.report.success:
        page.text(
            f"The dive meets what is asked of it to {error_size(dive.report.feasibility)}, but its cost is"
            " not yet a local minimum: the search"
            f" ended with status {dive.status} and a stationarity of {error_size(dive.report.stationarity)}."
        )
    page.code("dive = ocp.dive_5174d().solve()\ndives = ocp.dive_5174d().search(16)  # from 16 starts\n")
    _table(page, dive, seconds)
    _torques(page, dive)
    _shown(page, _scene(dive, "5174D"), "twist", "5174D at half speed.")
    page.figure(
        "twist-frames",
        _frames(dive, 20, "xz", 2, 1.9),
        "As Figure 3.5: equally spaced frames from the side, left to right, top to bottom, each about its"
        " centre of"
        " mass (cross).",
        "Twenty frames: the diver somersaults with the arms sideways, drops an arm, twists with the arms"
        " overhead, opens, folds and enters hands first",
    )
    page.figure(
        "twist-front",
        _frames(dive, 20, "yz", 2, 1.9),
        "The same from the front, where the tilt out of the plane of the somersault is seen: it makes the"
        " twist.",
        "The same twenty frames seen along the direction of flight",
    )
    page.figure(
        "twist-turns",
        _turns(dive),
        "Somersaults, twists and tilt, and the weights that make them: the twists begin when one arm drops"
        " (E) and end when it rises again; A has both arms overhead, H is the pike.",
        "Somersaults rise throughout, twists between throw and square-out alone; below, five weights",
    )
    page.figure(
        "twist-rates",
        _rates(dive),
        "What Figure 3.4 draws: the angular velocity in somersault and twist. Full lines are rates of the"
        " angles of"
        " R<sub>y</sub>(ψ) R<sub>x</sub>(τ) R<sub>z</sub>(φ), dashed ones the projections on the lateral"
        " axis of the"
        " world and the long axis of the body, which the thesis integrates.",
        "Two panels of rates; full and dashed lines differ while the diver is tilted",
    )
    lateral, long = _projections(dive)
    page.table(
        (words("turns to the entry"), "somersaults", "twists"),
        [
            [words("by the angles"), number(dive.somersaults[-1], 4), number(dive.twists[-1], 4)],
            [
                words("integrals of the rates of the angles, from upright"),
                number(dive.somersaults[0] + _integral(dive.somersault_rate, dive.t), 4),
                number(dive.twists[0] + _integral(dive.twist_rate, dive.t), 4),
            ],
            [
                words("integrals of the projections (thesis 3.2)"),
                number(dive.somersaults[0] + _integral(lateral, dive.t), 4),
                number(dive.twists[0] + _integral(long, dive.t), 4),
            ],
        ],
        "The projections miscount as soon as the body is tilted.",
    )


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    (pike, pike_seconds), (twisting, twisting_seconds) = measurements.pike, measurements.twisting
    page.lead(
        f"Three and a half somersaults in pike take {pike.momentum:.1f} kg m²/s of angular momentum; with two"
        f" twists {twisting.momentum:.1f} kg m²/s, {twisting.momentum / pike.momentum:.2f} times as much, in"
        f" {twisting.duration:g} s instead of {pike.duration:g} s. The"
        f" planar dive is found in {1e3 * pike_seconds:.0f} ms and the spatial one in"
        f" {twisting_seconds:.1f} s."
        f" Re-integrated, they enter the water {np.degrees(pike.verify().entry_angle):.2g}° and"
        f" {np.degrees(twisting.verify().entry_angle):.2g}° off the vertical."
    )
    _pike(page, pike, pike_seconds)
    _others(page, pike, pike_seconds)
    _torques(page, pike)
    _twisting(page, twisting, twisting_seconds)
