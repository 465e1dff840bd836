"""Thesis 7.3: accuracy of rigid body motions with contacts, figures 7.3 to 7.5."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from somersault import plotting, viewer
from tour import thesis
from tour.measurements import TOP_STEP, Measurements
from tour.page import Cell, Page, error_size, power, words
from tour.top import QUANTITIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLE = "Contact: a spinning top"

_TITLES = {
    "position": "position",
    "orientation": "orientation",
    "velocity": "velocity",
    "angular_velocity": "angular velocity",
}


def _order(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}".replace("-", "−")


def _section(measurements: Measurements) -> Axes:
    """Thesis Figure 7.3: the top cut along its axis, to scale."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import Polygon

    top = measurements.top
    radius, thickness = thesis.TOP_DISK
    length = -top.contacts[0].point[2]
    height = top.state.position[2]
    axis = top.state.orientation.as_matrix()[1:, 2]
    across = np.array([axis[1], -axis[0]])
    centre = np.array([0.0, height])
    ax: Any = plt.figure(figsize=(5.4, 4.2), layout="constrained").add_subplot()

    def polygon(points: list[tuple[float, float]], colour: str) -> None:
        corners = [1e3 * (centre + a * across + b * axis) for a, b in points]
        ax.add_patch(Polygon(corners, fc=colour, ec="0.2", lw=1.0))

    ax.axhspan(-12, 0, color="0.85", zorder=0)
    ax.axhline(0.0, color="0.3", lw=1.2)
    half = thickness / 2
    polygon([(0.0, -length), (0.004, -half), (-0.004, -half)], "0.7")
    polygon([(-0.003, half), (0.003, half), (0.003, 0.03), (-0.003, 0.03)], "0.7")
    polygon([(-radius, -half), (radius, -half), (radius, half), (-radius, half)], "#88CCEE")
    for direction, label in ((axis, "$z_B$"), (across, "$y_B$")):
        end = 1e3 * (centre + 0.055 * direction)
        ax.annotate("", end, 1e3 * centre, arrowprops={"arrowstyle": "->", "color": "#CC6677"})
        ax.text(*(end + 3), label, color="#CC6677")
    for direction, label in ((np.array([0.0, 1.0]), "$z$"), (np.array([1.0, 0.0]), "$y$")):
        ax.annotate("", 35 * direction + [-75, 0], (-75, 0), arrowprops={"arrowstyle": "->", "color": "0.2"})
        ax.text(*(38 * direction + [-75, 2]), label)
    ax.plot(*(1e3 * centre), "o", color="0.1", ms=4)
    tip = 1e3 * (centre - length * axis)
    ax.annotate(
        f"tip, {tip[1]:.1f} mm\nabove the ground",
        tip,
        (tip[0] + 14, 6),
        arrowprops={"arrowstyle": "-", "color": "0.5"},
    )
    ax.set_aspect("equal")
    ax.set(xlim=(-85, 75), ylim=(-12, 115), xlabel="y, mm", ylabel="z, mm")
    drawn: Axes = ax
    return drawn


def _scene(measurements: Measurements) -> viewer.Scene:
    """The top as it moves, with the path of its tip, and whether it touches the ground."""
    top, motion = measurements.top, measurements.top_motion
    radius, thickness = thesis.TOP_DISK
    tip, half = top.contacts[0].point, thickness / 2
    shapes = (
        viewer.Cylinder((0.0, 0.0, -half), (0.0, 0.0, half), radius, color="#44aa99", checkered=True),
        viewer.Cylinder(tip, (0.0, 0.0, -half), 0.0, 0.004, color="#777777"),
        viewer.Cylinder((0.0, 0.0, half), (0.0, 0.0, 0.03), 0.003, color="#777777"),
    )
    scene = viewer.Scene("The spinning top").ground().play(0.05)
    scene.add(motion, shapes=shapes, color="#cc6677", trails=(("body", tip),)).caption(0.0, "in the air")
    for event in motion.events:
        scene.caption(event.t, "in the air" if event.kind == "release" else "in contact")
    return scene


def _rendered(measurements: Measurements) -> Axes:
    """Thesis Figure 7.4: the top at a few times, and the paths of its centre and its tip."""
    import matplotlib.pyplot as plt
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    motion, top = measurements.top_motion, measurements.top
    radius, _ = thesis.TOP_DISK
    tip = top.contacts[0].point
    scene: Any = plt.figure(figsize=(6.4, 5.2), layout="constrained").add_subplot(projection="3d")
    below = 1e3 * (motion.position + motion.orientation.apply(tip))
    scene.plot(*below.T, color="#CC6677", lw=1.2)
    scene.plot(*(1e3 * motion.position.T), color="#332288", lw=1.2)
    angle = np.linspace(0.0, 2 * np.pi, 49)
    rim = radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    for fraction, alpha in ((0.0, 0.35), (0.5, 0.35), (1.0, 0.9)):
        at = round(fraction * (len(motion) - 1))
        turn, place = motion.orientation[at], motion.position[at]
        scene.add_collection3d(
            Poly3DCollection([1e3 * (turn.apply(rim) + place)], fc="#88CCEE", ec="0.2", lw=0.6, alpha=alpha)
        )
        axle = 1e3 * (turn.apply(np.array([tip, [0.0, 0.0, 0.03]])) + place)
        scene.plot(*axle.T, color="0.3", lw=1.8, alpha=alpha)
    scene.set(xlim=(-50, 50), ylim=(-50, 50), zlim=(0, 100))
    scene.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm")
    scene.view_init(elev=22, azim=-50)
    axes: Axes = scene
    return axes


def _figure_7_5(page: Page, measurements: Measurements) -> None:
    """Errors after 1 s against computation time, as the thesis has them and with events located."""
    import matplotlib.pyplot as plt

    for located in (False, True):
        how = "located" if located else "as the thesis runs them"
        axes = plt.figure(figsize=(10.5, 8.0), layout="constrained").subplots(2, 2, sharex=True)
        for ax, quantity in zip(axes.flat, QUANTITIES, strict=True):
            plotting.work_precision_diagram(measurements.top_runs[located], quantity, ax=ax)
            ax.get_legend().remove()
        figure = axes[0, 0].figure
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
        page.figure(
            f"top-{'located' if located else 'thesis'}",
            axes[0, 0],
            (
                f"Figure 7.5, {how}: errors after 1 s against computation time, for steps from 10⁻² s to"
                f" {power(10**measurements.setting.finest)} s. "
                + (
                    "Steps end where a contact begins or ends."
                    if located
                    else "The contact force switches within steps."
                )
            ),
            f"Four panels of errors against computation time, contacts {how}",
        )


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    orders = measurements.top_orders
    thesis_names = [name for name in thesis.METHODS if name in orders[True]]
    unlocated = [orders[False][name]["angular_velocity"] for name in orders[False]]
    usual = float(np.median([order for order in unlocated if order is not None]))
    rkmk = orders[True]["rkmk"]["angular_velocity"]
    best = orders[True]["rkmk8"]["angular_velocity"]
    page.lead(
        "When steps straddle the beginning and the end of contacts, methods fall to first order: the median"
        f" of all is {usual:.1f}. With steps that end where the contact switches <code>rkmk</code> keeps"
        f" {_order(rkmk)} and <code>rkmk8</code> {_order(best)}, as the thesis conjectures in 7.4."
    )
    top, law = measurements.top, measurements.top.contacts[0].law
    page.section("The spinning top")
    page.text(
        f"The example of thesis 7.3.2: a disk of {top.body.mass:g} kg that spins on a tip, started at"
        f" {np.linalg.norm(top.state.angular_velocity) / (2 * np.pi):.0f} turns a second, on ground that"
        f" pushes like a spring and damper of k = {law.stiffness:,.1f} N/m and c = {law.damping:.3f} N s/m"
        " and never pulls. There is no friction. Gravity, which the thesis does not state, is 9.81 m/s²."
    )
    page.figure(
        "top-section",
        _section(measurements),
        "Figure 7.3: the top cut along its axis at the start, to scale.",
        "A disk on a leaning axle whose lower end is just above the ground",
    )
    _scene(measurements).write(page.folder / "top.html")
    page.figure(
        "top-rendered",
        _rendered(measurements),
        "Figure 7.4: the top at the start, after half a second and after one, with the paths of its tip"
        " (red) and of its centre (blue). Without friction the centre stays above one point.",
        "A leaning disk at three times with a circle of loops below",
    )
    page.add(
        '<iframe src="top.html" title="Animation of the spinning top" loading="lazy" '
        'style="width:100%;height:28em;border:1px solid #ddd"></iframe>'
        '<p class="caption">The same motion, slowed down; <a href="top.html">on a page of its own</a>.</p>'
    )
    _switches(page, measurements)
    page.section("Errors and computation time")
    _figure_7_5(page, measurements)
    _survivors(page, measurements, thesis_names)
    page.section("Orders")
    _orders(page, measurements)


def _switches(page: Page, measurements: Measurements) -> None:
    motion = measurements.top_motion
    events, count = motion.events, motion.n_events
    page.section("When it touches")
    names = {"touch_down": "touch-down", "release": "release", "re_engagement": "re-engagement"}
    shown = events[:12]
    rows: list[list[str | Cell]] = [
        [
            words(names[event.kind]),
            f"{event.t:.12f}",
            "–" if event.impulse == 0 else f"{event.impulse:.6f}",
            f"{event.state.velocity[2]:.6f}".replace("-", "−"),
        ]
        for event in shown
    ]
    page.table(
        (words("event"), "t, s", "impulse, N s", "vertical velocity, m/s"),
        rows,
        f"The first {len(shown)} of the {count} switches in 1 s, by <code>rkmk8</code> with a step of"
        f" {1e6 * TOP_STEP:g} µs; with twice the step their times move by at most"
        f" {error_size(measurements.top_shift)} s.",
    )
    axes = plotting.gaps(measurements.top_motion, measurements.top.contacts)
    page.figure(
        "top-gap",
        axes[0],
        "Height of the tip and force of the ground. The top bounces, less and less, until the tip stays.",
        "Two panels over time: the gap with marks at its crossings, and the force in pulses",
    )
    if measurements.top_thesis_reference is not None:
        page.text(
            "The thesis takes its reference from RKMK with steps of 10⁻⁶ s across the switches. Against a run"
            " with events located that reference is off by "
            + ", ".join(
                f"{error_size(value)} {unit} in {_TITLES[quantity]}"
                for (quantity, value), unit in zip(
                    measurements.top_thesis_reference.items(), ("m", "rad", "m/s", "rad/s"), strict=True
                )
            )
            + "."
        )


def _survivors(page: Page, measurements: Measurements, names: list[str]) -> None:
    """The largest step with which each of the thesis' methods gets through."""
    rows: list[list[str | Cell]] = []
    for name in names:
        row: list[str | Cell] = [words(plotting.abbreviation(name))]
        for located in (False, True):
            runs = measurements.top_runs[located][name]
            accurate = runs.errors["orientation"] < 0.1
            # All steps from there down get through as well.
            held = np.flatnonzero(~accurate)
            first = 0 if len(held) == 0 else int(held[-1]) + 1
            steps = measurements.top_steps
            row.append(f"{1e3 * steps[first]:.2g}" if first < len(steps) else "–")
        rows.append(row)
    page.table(
        (words("method"), "as the thesis, ms", "located, ms"),
        rows,
        "The largest step from which on the orientation after 1 s is right to 0.1 rad.",
    )


def _orders(page: Page, measurements: Measurements) -> None:
    """The table of orders, both ways, for every method that takes a torque."""
    rows: list[list[str | Cell]] = []
    for info in measurements.methods:
        if info.name not in measurements.top_orders[True]:
            continue
        row: list[str | Cell] = [
            words(info.name),
            f"{info.orders['translation_with_velocity']}, {info.orders['rotation_with_torque']}",
        ]
        for located in (False, True):
            row += [_order(measurements.top_orders[located][info.name][quantity]) for quantity in QUANTITIES]
        rows.append(row)
    quantities = ("r", "R", "v", "ω")
    page.table(
        (
            words("method"),
            "stated",
            *(f"{symbol}, not located" for symbol in quantities),
            *(f"{symbol}, located" for symbol in quantities),
        ),
        rows,
        "Orders observed after 0.1 s, of position, orientation, velocity and angular velocity. Without"
        f" location the error of a single run depends on where its steps fall: a line through"
        f" {len(measurements.top_scattered_steps)} step sizes. With location the slope above the floor of"
        " rounding. Stated: the lesser for velocity-dependent forces and torques, translation and rotation;"
        " a dash where nothing is left to measure.",
    )
    lost = [
        name
        for name, found in measurements.top_orders[True].items()
        if (order := found["angular_velocity"]) is not None
        and order < measurements.stated_with_torque[name] - 0.4
    ]
    if lost:
        page.text(
            "More than 0.4 below the order stated, with events located, in angular velocity:"
            f" {', '.join(sorted(lost))}. Slopes are taken between the coarsest step that follows the"
            " contact and the floor of rounding."
        )
