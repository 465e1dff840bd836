"""Chapters 8 and 9: the arm and its two timescales, exponents, and the subspaces that they split."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from somersault import ftla, multibody, plotting, viewer
from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, number, words
from tour.slow_manifolds import NAMES, flow, solved, tip

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "Two timescales"

_STABLE, _CENTER, _UNSTABLE = "#1b7837", "#2166ac", "#b2182b"
#: Horizons of Figure 8.7, s.
_HORIZONS = (8.0, 10.0, 12.0)
_AVERAGING = np.arange(0.25, 5.01, 0.25)


def _strategy() -> Axes:
    """Figure 8.1, drawn from a problem whose phase space is a plane."""
    import matplotlib.pyplot as plt

    system = ftla.cubic_regulator()
    fractions = ftla.graded_times(1.0, 0.02, 0.1)
    found = ftla.continue_through(system, [([0.0], [0.0]), ([1.0], [1.3])], 12.0, fractions).extremal
    # closer where the motion is fast
    near = 5.0 * np.linspace(0.0, 1.0, 120) ** 2
    motion = found(np.concatenate([near, 12.0 - near[::-1]]))
    ax = plt.figure(figsize=(6.4, 4.6), layout="constrained").add_subplot()
    x = np.linspace(-0.3, 1.5, 200)
    for sign, colour in ((1.0, _STABLE), (-1.0, _UNSTABLE)):
        ax.plot(x, -(x**3) + sign * x * np.sqrt(1 + x**4), color=colour, lw=1.0, ls=(0, (5, 2)))
    away = ftla.VariationalFlow(system).state([1.0, motion[0, 1] + 0.02], np.linspace(0.01, 4.2, 80))
    ax.plot(*away.T, color="0.55", lw=1.2)
    ax.plot(*motion.T, color=_CENTER, lw=2.4)
    ax.plot(*motion[0], "o", color=_STABLE, ms=8)
    ax.plot(*motion[-1], "o", color=_UNSTABLE, ms=8)
    ax.set(xlim=(-0.3, 1.5), ylim=(-5.5, 1.2), xlabel="state x", ylabel="costate λ")
    ax.grid(color="0.92")
    for place, name, colour, side in (
        ((1.48, 0.62), "stable manifold", _STABLE, "right"),
        ((1.28, -5.3), "unstable manifold", _UNSTABLE, "right"),
        ((-0.28, 0.75), "start 0.02 off the manifold", "0.4", "left"),
        ((0.48, -1.1), "optimum", _CENTER, "right"),
    ):
        ax.text(*place, name, color=colour, ha=side)
    return ax


def _drawing() -> Axes:
    """Figure 8.2: the arm from above with its angles."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import Arc

    ax = plt.figure(figsize=(6.4, 3.4), layout="constrained").add_subplot()
    q = np.array([[0.42, 0.75]])
    (elbow,), (end,) = tip(q)
    ax.plot([0.0, 2.4], [0.0, 0.0], color="0.7", lw=1.0, ls=(0, (4, 3)))
    ax.plot(*np.transpose([elbow, 1.3 * elbow]), color="0.7", lw=1.0, ls=(0, (4, 3)))
    ax.plot(
        *np.transpose([[0.0, 0.0], elbow, end]), color="#0072B2", lw=7, solid_capstyle="round", alpha=0.85
    )
    ax.plot(*np.transpose([[0.0, 0.0], elbow]), "o", color="white", mec="black", ms=9)
    first, second = np.rad2deg(q[0])
    ax.add_patch(Arc((0, 0), 1.3, 1.3, theta1=0, theta2=first))
    ax.add_patch(Arc(tuple(elbow), 0.62, 0.62, theta1=first, theta2=first + second))
    ax.annotate("θ₁", (0.74, 0.13), fontsize=13)
    ax.annotate("θ₂", np.add(elbow, (0.27, 0.27)), fontsize=13)
    ax.annotate("Q  u₁, c₁", (-0.12, -0.24), fontsize=11)
    ax.annotate("u₂, c₂", np.add(elbow, (-0.05, -0.26)), fontsize=11)
    ax.annotate("m₁, L₁", np.add(0.5 * elbow, (-0.3, 0.16)), fontsize=11)
    ax.annotate("m₂, L₂", np.add(end, (0.07, 0.0)), fontsize=11)
    ax.set(xlim=(-0.4, 2.9), ylim=(-0.4, 1.6))
    ax.set_aspect("equal")
    ax.axis("off")
    return ax


def _stages(extremal: ftla.Extremal) -> Axes:
    """Figure 8.3: the three stages, from above."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 4.4), layout="constrained")
    axes = figure.subplots(1, 3, sharex=True, sharey=True)
    parts = (
        ("1: the second link folds", 0.0, 2.0, _STABLE),
        ("2: the folded arm turns", 2.0, 8.0, _CENTER),
        ("3: it unfolds", 8.0, 10.0, _UNSTABLE),
    )
    for ax, (name, begin, end, colour) in zip(axes, parts, strict=True):
        elbow, ends = tip(extremal(np.linspace(begin, end, 9)))
        for k, (joint, last) in enumerate(zip(elbow, ends, strict=True)):
            shade: dict[str, Any] = {"alpha": 0.2 + 0.8 * k / (len(elbow) - 1), "solid_capstyle": "round"}
            ax.plot([0.0, joint[0]], [0.0, joint[1]], color="0.35", lw=2.0, **shade)
            ax.plot([joint[0], last[0]], [joint[1], last[1]], color=colour, lw=2.6, **shade)
        ax.set_title(name, fontsize=11)
        ax.set_aspect("equal")
        ax.set_xlabel("x, m")
    axes[0].set_ylabel("y, m")
    drawn: Axes = axes[0]
    return drawn


def _by_horizon(extremal: ftla.Extremal) -> list[tuple[Array, Array]]:
    """The optimum for several horizons, each followed from the one of ten seconds."""
    system, (initial, final) = extremal.system, (thesis.ARM_INITIAL, thesis.ARM_FINAL)
    found = []
    for horizon in _HORIZONS:

        def family(s: float, horizon: float = horizon) -> Any:
            return system, initial, final, thesis.ARM_HORIZON + s * (horizon - thesis.ARM_HORIZON)

        motion = extremal if horizon == thesis.ARM_HORIZON else ftla.follow(family, extremal).extremal
        t = np.linspace(0.0, horizon, 400)
        found.append((t, motion(t)))
    return found


def _panels(extremal: ftla.Extremal) -> tuple[Axes, dict[str, ftla.Diagnosis]]:
    """Figure 10.1, with what each panel says."""
    import matplotlib.pyplot as plt

    places: list[tuple[str, float, Any]] = [
        ("(a) forward at p(0)", 0.0, "forward"),
        ("(b) forward at p(5)", 5.0, "forward"),
        ("(c) backward at p(5)", 5.0, "backward"),
        ("(d) backward at p(10)", 10.0, "backward"),
    ]
    figure = plt.figure(figsize=(9.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    said = {}
    for ax, (name, t, direction) in zip(axes.ravel(), places, strict=True):
        spectra = flow().spectra(extremal(t), _AVERAGING, direction)
        said[name] = ftla.diagnose(spectra, thesis.ARM_HORIZON)
        plotting.exponents(spectra, said[name].dims, ax)
        ax.set_title(name, fontsize=11)
        ax.set_ylim(-10.0, 10.0)
        ax.label_outer()
    drawn: Axes = axes[0, 0]
    return drawn, said


def _scene(extremal: ftla.Extremal) -> viewer.Scene:
    """The arm in motion, its stages named by captions."""
    t = np.linspace(0.0, 10.0, 401)
    x = extremal(t)
    shapes = {
        "upper": viewer.Capsule((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), 0.06),
        "lower": viewer.Capsule((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), 0.045),
    }
    scene = viewer.Scene("The arm of thesis 8.4, polished")
    scene.add(
        multibody.two_link_arm(), t, x[:, :2], x[:, 2:4], shapes=shapes, trails=[("lower", (0.5, 0.0, 0.0))]
    )
    return scene.camera("top").play(1.0)


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    extremal = solved().extremal
    axes, said = _panels(extremal)
    start = next(iter(said.values()))
    page.lead(
        f"The arm is {start}. At all four points of Figure 10.1 the splitting is that of (10.1),"
        " with gaps above"
        f" {min(min(each.gaps) for each in said.values()):.1f} 1/s."
    )
    page.section("The strategy, and the arm")
    page.text(
        "A motion with fast rates in both directions cannot be integrated from either end: an error at the"
        " start grows along the unstable directions, one at the end along the stable ones, backward. But an"
        " optimum starts next to the centre-stable manifold and ends next to the centre-unstable one. So"
        " both ends are placed there, by their costates, and their motions are matched in the middle, where"
        " neither rate acts."
    )
    page.figure(
        "strategy",
        _strategy(),
        "Figure 8.1, not as a sketch but computed: ẋ = −x³ + u, whose phase space is a plane and whose"
        " manifolds are λ = −x³ ± x√(1 + x⁴). The optimum from x = 1 to 1.3 in twelve seconds hugs"
        " both; its"
        " slow part is the equilibrium.",
        "A plane with two curved manifolds, an optimum along both, and a motion that leaves",
    )
    page.figure("arm-drawing", _drawing(), "Figure 8.2: the arm, from above.", "Two links with two angles")
    page.figure(
        "arm-stages",
        _stages(extremal),
        "Figure 8.3: the stages of the motion, which is the optimum here and no sketch.",
        "Three strips of the arm: folding, turning, unfolding",
    )
    _scene(extremal).write(page.folder / "arm_stages.html")
    page.add(
        '<iframe src="arm_stages.html" title="The arm in motion" loading="lazy" '
        'style="width:100%;height:26em;border:1px solid #ddd"></iframe>'
        '<p class="caption">The motion of Figures 8.4 to 8.6, which are in the chapter on the arm;'
        ' <a href="arm_stages.html">on a page of its own</a>.</p>'
    )
    page.figure(
        "arm-projections",
        plotting.projections(_by_horizon(extremal), (1, 6, 7), (NAMES[1], NAMES[6], NAMES[7]), (2.0, 2.0)),
        f"Figure 8.7: optima for horizons of {', '.join(f'{h:.0f}' for h in _HORIZONS)} s in θ₂, λ₃ and λ₄,"
        " with their shadows. Green near the centre-stable manifold, blue on the centre, red near the"
        " centre-unstable one.",
        "Curves in space that come from one side, bend through the middle, and leave to another",
    )
    page.section("Exponents")
    page.code(
        "import numpy as np\nfrom somersault import ftla\n\n"
        "found = ftla.solve_arm([-np.pi / 2, 0.05, 0, 0], [np.pi / 2, 0.05, 0, 0], 10.0, fold=np.pi)\n"
        "flow = ftla.VariationalFlow(found.extremal.system)\n"
        "spectra = flow.spectra(found.extremal(0.0), np.arange(0.25, 5.01, 0.25))\n"
        "print(ftla.diagnose(spectra, 10.0))\n"
    )
    page.figure(
        "exponents",
        axes,
        "Figure 10.1: finite-time exponents over the averaging time, at three points of the"
        " motion. Stable in"
        " green, centre in blue, unstable in red; symmetric, since the flow is symplectic.",
        "Four panels with eight curves each: two far above zero, four near it, two far below",
    )
    rows: list[list[str | Cell]] = [
        [
            words(name),
            "/".join(map(str, each.dims)),
            number(each.gaps[0]),
            number(each.gaps[1]),
            number(each.center_rate),
            number(each.time_constants, 1),
            f"{each.window[0]:.2f} – {each.window[1]:.2f}",
        ]
        for name, each in said.items()
    ]
    page.table(
        (words("at"), "nˢ/nᶜ/nᵘ", "gap below, 1/s", "gap above, 1/s", "centre, 1/s", "time constants",
         "window of T, s"),
        rows,
        "The thesis reads gaps above 2 1/s for at least 3.5 s, seven time constants.",
    )  # fmt: skip
    along = extremal.chain.spectrum()
    page.text(
        "Over ten seconds along the motion the singular values of Φ span"
        f" {error_size(float(np.exp(10.0 * np.ptp(along.exponents))))}: no matrix of doubles holds"
        " them, and a"
        " plain singular value decomposition gets the small ones wrong from five seconds on. The product of"
        f" {len(extremal.chain)} factors keeps them: exponents"
        f" {', '.join(f'±{mu:.6f}' for mu in along.exponents[4:])} 1/s, in pairs to"
        f" {error_size(along.pairing_defect)}."
    )
    _subspaces(page, extremal)


def _subspaces(page: Page, extremal: ftla.Extremal) -> None:
    """What the splitting says along the motion, and of the costates to hold."""
    page.section("Subspaces")
    times = np.linspace(0.0, 10.0, 81)
    page.figure(
        "subspaces",
        plotting.subspace_angles(flow(), times, extremal(times), thesis.ARM_DIMS, 2.5),
        "Angles along the motion, from spectra over 2.5 s. The field lies in <i>E</i><sup>cs</sup>"
        " but at the end, in"
        " <i>E</i><sup>cu</sup> but at the start, and in both, the centre, between: conditions"
        " (9.10) and (9.11).",
        "Three curves of angles over ten seconds on a logarithmic axis",
    )
    ends: list[tuple[float, Any]] = [(0.0, "forward"), (10.0, "backward")]
    slow = [
        ftla.slow_subspace(flow().spectrum(extremal(t), 3.5, direction), thesis.ARM_DIMS)
        for t, direction in ends
    ]
    values = [dict((tuple(held), value) for held, value in ftla.rank_held_costates(each)) for each in slow]
    ranked = [held for held, _ in ftla.rank_held_costates(slow[0])]
    page.table(
        (words("costates held"), words("solved for"), "at the start", "at the end"),
        [
            [
                words(", ".join(NAMES[4 + i] for i in held)),
                words(", ".join(NAMES[4 + i] for i in range(4) if i not in held)),
                *(f"{value[tuple(held)]:.4f}" for value in values),
            ]
            for held in ranked
        ],
        "How well the costates solved for move the field along the fast directions: the smallest singular"
        " value of these directions' components along them. By (10.1) two of the four are held;"
        " the thesis holds λ₁"
        " and λ₃, and the subspaces say why.",
    )
