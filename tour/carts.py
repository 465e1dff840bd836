"""Carts with rods on them: their pictures, and a cart with two rods that is swung up."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import somersault
from somersault import multibody, ocp
from tour.page import Cell, Page, error_size, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

#: Masses, kg, and lengths, m, of both rods; the cart has 1 kg.
_RODS = {"lower": (0.4, 0.5), "upper": (0.3, 0.6)}
_DURATIONS = (1.6, 2.0)
_TOLERANCE = 1e-5


def frames(t: Array, points: Array, columns: int = 6) -> Axes:
    """Carts and rods at equal distances in time; `points` has shape (n, n_rods + 1, 2), carts first."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import FancyBboxPatch

    figure = plt.figure(figsize=(11.0, 4.6), layout="constrained")
    axes = figure.subplots(2, columns, sharex=True, sharey=True)
    shown = np.linspace(0, len(t) - 1, 2 * columns).round().astype(int)
    (left, low), (right, high) = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    for ax, k in zip(axes.flat, shown, strict=True):
        ax.axhline(0.0, color="0.75", lw=3.0, zorder=0)
        ax.plot(*points[: k + 1, -1].T, color="#0072B2", lw=1.0, alpha=0.45)
        r = points[k, 0, 0]
        cart = FancyBboxPatch(
            (r - 0.2, -0.1), 0.4, 0.2, boxstyle="round,pad=0.02", fc="#6b7280", ec="0.2", lw=0.8, zorder=2
        )
        ax.add_patch(cart)
        ax.plot(*points[k].T, color="0.2", lw=3.0, solid_capstyle="round", zorder=3)
        ax.plot(*points[k, 1:].T, "o", ms=11, color="#D55E00", mec="0.2", mew=0.8, zorder=4)
        ax.set_title(f"{t[k]:.2f} s", fontsize=11)
        ax.set_aspect("equal")
        ax.set(xlim=(left - 0.3, right + 0.3), ylim=(low - 0.25, high + 0.25), yticks=[-1, 0, 1])
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
    for ax in axes[-1]:
        ax.set_xlabel("x, m")
    for ax in axes[:, 0]:
        ax.set_ylabel("z, m")
    drawn: Axes = axes[0, 0]
    return drawn


def double_pendulum() -> somersault.Model:
    """A cart with two thin rods; angles from the upright, the second from the first."""
    links = [multibody.Link("cart", "prismatic", axis=(1, 0, 0), mass=1.0)]
    parent, origin = "cart", 0.0
    for name, (mass, length) in _RODS.items():
        across = mass * length**2 / 12
        links.append(
            multibody.Link(
                name,
                "revolute",
                parent=parent,
                axis=(0, 1, 0),
                origin=(0, 0, origin),
                mass=mass,
                center=(0, 0, length / 2),
                inertia=np.diag([across, across, 0.0]),
            )
        )
        parent, origin = name, length
    return somersault.Model(links)


def _points(x: Array) -> Array:
    """Cart and ends of the rods."""
    points = [np.column_stack([x[:, 0], np.zeros(len(x))])]
    angles = np.cumsum(x[:, 1:3], axis=1).T
    for angle, (_, length) in zip(angles, _RODS.values(), strict=True):
        points.append(points[-1] + length * np.column_stack([np.sin(angle), np.cos(angle)]))
    return np.stack(points, axis=1)


def write_double_pendulum(page: Page) -> None:
    """The section about the double pendulum."""
    model = double_pendulum()
    rows: list[list[str | Cell]] = []
    for duration in _DURATIONS:
        began = time.perf_counter()
        problem = ocp.ControlProblem(
            model,
            actuated=["cart"],
            initial=[0.0, np.pi, 0.0, 0.0, 0.0, 0.0],
            final=[0.0] * 6,
            duration=duration,
            running_cost=lambda x, u: 0.5 * u.u_cart**2,
        )
        found = problem.solve(tol=_TOLERANCE)
        rows.append(
            [
                words(f"{duration} s"),
                Cell(f"{found.cost:.2f}", agrees=found.success),
                f"{found.verified_cost:.2f}",
                f"{np.abs(found.u).max():.0f} N",
                str(sum(mesh["nit"] for mesh in found.meshes)),
                str(found.meshes[-1]["n_points"]),
                error_size(found.max_defect),
                error_size(found.terminal_error),
                f"{time.perf_counter() - began:.1f} s",
            ]
        )
    page.section("A double pendulum on a cart")
    page.text(
        "The same with two rods, 0.5 and 0.6 m long, of 0.4 and 0.3 kg, on a cart of 1 kg: hanging at rest,"
        " then both upright at rest where they began, with least ½ ∫ F² dt and no weights at all. Direct"
        " collocation starts from a straight line between the two, without force.",
    )
    page.table(
        (
            words("duration"), "cost", "its cost, accurately", "largest force", "steps", "collocation points",
            "largest defect", "from start to end", "time",
        ),
        rows,
        f"The double pendulum swung up by collocation to a tolerance of {_TOLERANCE:g}. Defects are those"
        " of each interval, re-integrated from its start. Integrated in one piece the error at the end is"
        " larger: nothing holds two rods upright.",
    )  # fmt: skip
    t = np.linspace(0.0, _DURATIONS[-1], 121)
    page.figure(
        "double-pendulum-frames",
        frames(t, _points(found.state(t))),
        f"The double pendulum in {_DURATIONS[-1]} s. The line is the path of the upper rod's end.",
        "Twelve frames of a cart on a rail with two rods, from hanging to upright",
    )
