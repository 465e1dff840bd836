"""Chapter 2 of the thesis: many joints moved by few weights, and weights that are splines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from somersault import errors, multibody, ocp, plotting
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, number, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "Eigenpostures and splines"

_MODES = 5
_SPLINES = 10
_BLUE, _RED, _GREEN = "#4477aa", "#cc6677", "#228833"


def _string(page: Page) -> None:
    """Figure 2.1: a string and its modes."""
    x = np.linspace(0.0, 1.0, 401)
    modes = np.array([np.sin(k * np.pi * x) for k in range(1, _MODES + 1)])
    plucked = np.minimum(x / 0.3, (1.0 - x) / 0.7)
    base = ocp.EigenpostureBase(np.vstack((np.zeros_like(x), modes)))
    weights, rest = base.project(plucked)
    figure = plt.figure(figsize=(6.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    for weight, mode in zip(weights, modes, strict=True):
        ax.plot(x, weight * mode, color=_BLUE, lw=1.1, label="modes" if weight is weights[0] else None)
    ax.plot(x, plucked, color="0.7", lw=1.2, ls="--", label="plucked string")
    ax.plot(x, base.positions(weights), color="black", lw=2.0, label="sum of the modes")
    ax.lines[0].set_label("its five modes")
    ax.set(xlabel="along the string", ylabel="displacement", xlim=(0.0, 1.0), ylim=(-0.3, 1.5))
    ax.legend(frameon=False)
    page.figure(
        "string",
        ax,
        "As Figure 2.1: the shape of a string (black) is a sum of five of its modes (blue). Here the"
        " string is"
        " plucked at 0.3 of its length (dashed), and the weights are those that come nearest to it.",
        "Five sines of falling size, and their sum, near a triangle",
    )
    exact = [2.0 * np.sin(0.3 * k * np.pi) / (0.3 * 0.7 * (k * np.pi) ** 2) for k in range(1, _MODES + 1)]
    page.table(
        ("mode", *map(str, range(1, _MODES + 1))),
        [
            [words("weight by projection"), *(number(w, 5) for w in weights)],
            [words("Fourier coefficient"), *(number(w, 5) for w in exact)],
        ],
        "<code>EigenpostureBase.project</code> at 401 points, beside the closed form 2 sin(0.3 kπ)/(0.21"
        " k²π²)."
        f" The root mean square of what five modes leave is {rest / np.sqrt(len(x)):.4f}.",
    )


def _splines(page: Page) -> None:
    """The quintic basis, and what conditions at the ends leave of it."""
    motion = ocp.SplineMotion(1, _SPLINES)
    fraction = np.linspace(0.0, 1.0, 501)
    basis = np.array([motion(unit, fraction)[:, 0] for unit in np.eye(_SPLINES)])
    figure = plt.figure(figsize=(6.4, 3.2), layout="constrained")
    ax = figure.add_subplot()
    for k, row in enumerate(basis):
        ax.plot(fraction, row, color=plt.get_cmap("viridis")(k / _SPLINES), lw=1.4)
    ax.plot(fraction, basis.sum(axis=0), color="black", lw=1.6)
    ax.annotate("their sum", (0.86, 1.0), (0.86, 0.90), ha="center", va="top")
    ax.set(xlabel="fraction of the duration", ylabel="basis function", xlim=(0.0, 1.0), ylim=(0.0, 1.06))
    page.figure(
        "splines",
        ax,
        f"The uniform B-splines of degree 5 with {_SPLINES} coefficients. At each time six of them are not"
        " zero;"
        " none is negative, and they add up to one.",
        "Ten bells side by side, cut off at both ends, and a level line at one",
    )
    page.text(
        f"The sum differs from one by at most {error_size(float(np.abs(basis.sum(axis=0) - 1.0).max()))}."
        " So a"
        " spline stays between the least and the greatest of its coefficients: bounds on a weight at all"
        " times"
        " are bounds on a few numbers, and where weights of several postures must add up to at most one,"
        " that is"
        " a bound on sums of coefficients. Conditions at the ends are linear equations; they are solved"
        " once, and"
        " what remains free are the parameters of the motion."
    )
    ends = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
    held = ocp.SplineMotion(1, _SPLINES, ends)  # type: ignore[arg-type]
    p = np.random.default_rng(1).uniform(0.0, 1.0, held.n_parameters)
    ax = plt.figure(figsize=(6.4, 3.0), layout="constrained").add_subplot()
    ax.plot(fraction, held(p, fraction)[:, 0], color="black", lw=1.8, label="weight")
    ax.plot(fraction, held(p, fraction, 1)[:, 0] / 5.0, color=_RED, lw=1.2, label="its rate / 5")
    ax.axhline(0.0, color="0.8", lw=0.8)
    ax.set(xlabel="fraction of the duration", xlim=(0.0, 1.0))
    plotting.label_ends(ax)
    at_ends = np.abs([held(p, s, r)[0] for s in (0.0, 1.0) for r in (0, 1)]).max()
    page.figure(
        "spline-ends",
        ax,
        f"A weight that begins and ends at zero and at rest, for random values of its {held.n_parameters}"
        f" parameters. Of {_SPLINES} coefficients four are eliminated; weight and rate at the ends are"
        " zero to"
        f" {error_size(float(at_ends))}.",
        "A curve that leaves zero smoothly and comes back to it, and its rate",
    )


def _blend(diver: multibody.Diver, pairs: tuple[tuple[str, str], ...], weights: Array) -> Axes:
    """Rows of figures from a posture to another."""
    figure = plt.figure(figsize=(1.6 * len(weights), 2.5 * len(pairs)), layout="constrained")
    axes = figure.subplots(len(pairs), len(weights), sharex=True, sharey=True, squeeze=False)
    for row, (first, second) in zip(axes, pairs, strict=True):
        before, after = (diver.configuration(posture) for posture in (first, second))
        base = ocp.EigenpostureBase([before[3:], after[3:]])
        for ax, weight in zip(row, weights, strict=True):
            plotting.tree_configuration(
                diver.model, np.concatenate((before[:3], base.positions([weight]))), ax=ax
            )
            ax.set(xlabel="", ylabel="", xticks=[], yticks=[])
            for side in ax.spines.values():
                side.set_visible(False)
            ax.set_title(f"{first} to {second}: w = {weight:g}", fontsize=11)
    drawn: Axes = axes[0, 0]
    return drawn


def _postures(page: Page) -> None:
    """Bases of the postures A to I."""
    diver = multibody.diver_spatial()
    joints = {letter: diver.configuration(letter)[7:] for letter in diver.postures}
    try:
        ocp.EigenpostureBase([joints[letter] for letter in "ABCDEFGH"])
        said = ""
    except errors.InputError as error:
        said = str(error)
    independent = "ACDEFGH"
    base = ocp.EigenpostureBase([joints[letter] for letter in independent])
    page.text(
        f"A spatial diver has {base.n_joints} joints. With φ₀ for A and a weight for each other posture"
        " (2.11),"
        f" {base.n_weights} weights move all of them. A base is checked for its rank. The postures A to H"
        " together"
        " are refused:"
    )
    page.code(said)
    page.text(
        "for B is no new direction: from A both arms go down, which is what D and E do with one arm each."
        " Without B"
        " the base stands, and projection tells how the other two postures look to it."
    )
    rows: list[list[str | Cell]] = []
    for letter in "BI":
        weights, rest = base.project(joints[letter])
        rows.append(
            [words(letter), *(number(round(w, 10) + 0.0) for w in weights), f"{np.degrees(rest):.1f}"]
        )
    page.table(
        (words("posture"), *(f"w of {letter}" for letter in independent[1:]), "rest, °"),
        rows,
        "The nearest weights in the base of A, C, D, E, F, G and H, and the norm of what remains of the joint"
        " angles. B is D and E together: their weights add up to two, outside of what a motion may have where"
        " weights add up to at most one. I, wrapped for a twist, is no combination of the others.",
    )
    page.figure(
        "blends",
        _blend(multibody.diver_planar(), (("A", "H"), ("A", "F")), np.linspace(0.0, 1.0, 6)),
        "One weight from layout to closed pike, and from layout to tuck: joints move in proportion.",
        "Two rows of six figures that fold from upright to a pike and to a tuck",
    )


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    page.lead(
        "A diver's 9 or 21 joints move in a few patterns. With a weight for each posture and splines for the"
        " weights, the planar dive of the next chapter is a matter of"
        f" {ocp.dive_107b().n_variables} numbers; the thesis counts 1806 without them, and 16 with them."
    )
    page.section("Modes of a string")
    _string(page)
    page.section("Weights over time")
    _splines(page)
    page.section("Postures of a diver")
    _postures(page)
    page.code(
        "from somersault import multibody, ocp\n\n"
        "diver = multibody.diver_planar()\n"
        'base = ocp.EigenpostureBase([diver.configuration(p)[3:] for p in "AH"])\n'
        'motion = ocp.SplineMotion(base, 10, [("start", 0, 0.0), ("start", 1, 0.0)])\n'
        "motion(parameters, fraction=0.5)   # the weight half-way\n"
    )
