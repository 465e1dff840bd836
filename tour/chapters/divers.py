"""Divers: the postures they have, and what the body weighs and how it resists rotation in each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import somersault
from somersault import multibody, plotting, viewer
from tour.measurements import Measurements
from tour.page import Cell, Page, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "Divers and their postures"

#: The postures of thesis Figure 2.2, by their letters.
POSTURES = {
    "A": "layout, arms overhead",
    "B": "layout, arms at the sides",
    "C": "layout, arms sideways",
    "D": "right arm up, left down",
    "E": "left arm up, right down",
    "F": "tuck",
    "G": "open pike",
    "H": "closed pike",
    "I": "wrapped for a twist",
}


def inertia(model: somersault.Model, q: Array) -> Array:
    """The inertia tensor of the whole tree about its centre of mass, joints locked, world axes."""
    centre = model.center_of_mass(q)
    total = np.zeros((3, 3))
    for link, pose in zip(model.links, model.poses(q), strict=True):
        rotation = pose[:3, :3]
        d = rotation @ link.center + pose[:3, 3] - centre
        total += rotation @ link.inertia @ rotation.T + link.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return total


def _drawn(diver: multibody.Diver, views: tuple[str, ...]) -> Axes:
    """Every posture, seen along each of the views."""
    import matplotlib.pyplot as plt

    postures = diver.postures
    figure = plt.figure(figsize=(1.1 * len(postures), 1.6 * len(views)), layout="constrained")
    axes = figure.subplots(len(views), len(postures), sharex=True, sharey="row", squeeze=False)
    for row, view in zip(axes, views, strict=True):
        for ax, posture in zip(row, postures, strict=True):
            plotting.tree_configuration(diver.model, diver.configuration(posture), view, ax=ax)
            ax.set_axis_off()
    for ax, posture in zip(axes[0], postures, strict=True):
        ax.set_title(posture, fontsize=15)
    drawn: Axes = axes[0, 0]
    return drawn


def _scene(diver: multibody.Diver) -> viewer.Scene:
    """A second for each posture: half of it to get there, half to stay."""
    s = np.linspace(0.0, 1.0, 16)
    blend = (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None]
    scene = viewer.Scene("A diver in all postures")
    before = diver.configuration(diver.postures[0])
    q = []
    for k, posture in enumerate(diver.postures):
        after = diver.configuration(posture)
        q += [before + blend * (after - before), np.tile(after, (14, 1))]
        scene.caption(k, f"{posture}: {POSTURES[posture]}")
        before = after
    rows = np.concatenate(q)
    t = np.arange(len(rows)) * (len(diver.postures) / len(rows))
    return scene.add(diver.model, t, rows, trails=()).camera("corner")


def _table(page: Page, diver: multibody.Diver, caption: str) -> dict[str, Array]:
    rows: list[list[str | Cell]] = []
    found = {}
    for posture in diver.postures:
        q = diver.configuration(posture)
        tensor = inertia(diver.model, q)
        moments, axes = np.linalg.eigh(tensor)
        found[posture] = moments
        lean = np.degrees(np.arccos(min(1.0, abs(axes[2, 0]))))
        x, y, z = diver.model.center_of_mass(q)
        rows.append(
            [
                words(f"{posture}: {POSTURES[posture]}"),
                *(f"{round(1e3 * value, 1) + 0.0:.1f}".replace("-", "−") for value in (x, y, z)),
                *(f"{value:.3f}" for value in moments),
                f"{tensor[1, 1]:.3f}",
                f"{lean:.1f}",
            ]
        )
    page.table(
        (
            words("posture"),
            *(f"{axis}, mm" for axis in "xyz"),
            *(f"I{i}, kg m²" for i in "₁₂₃"),
            "about y, kg m²",
            "lean, °",
        ),
        rows,
        caption,
    )
    return found


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    planar, spatial = multibody.diver_planar(), multibody.diver_spatial()

    def somersault_inertia(posture: str) -> float:
        return float(inertia(spatial.model, spatial.configuration(posture))[1, 1])

    layout, pike, tuck = (somersault_inertia(posture) for posture in "AHF")
    page.lead(
        f"A diver of {spatial.model.mass:.0f} kg and {spatial.height:.2f} m has a moment of inertia of"
        f" {layout:.1f} kg m² about the axis of the somersault in layout, {pike:.1f} in a closed pike and"
        f" {tuck:.1f} in a tuck. With the same angular momentum that is {layout / pike:.1f} and"
        f" {layout / tuck:.1f} times as fast."
    )
    page.text(
        "Two divers, as in chapter 3 of the thesis: one in the plane with"
        f" {planar.model.n_velocities} degrees of freedom, whose limbs move in pairs (Table 3.1), and one in"
        f" space with {spatial.model.n_velocities} (Table 3.2). Their segments are those of de Leva (1996);"
        " they scale to any mass and height.",
        "Each segment is drawn as the ellipsoid that has its mass and inertia. Dots are joints, the cross is"
        " the centre of mass. The postures go by the letters of thesis Figure 2.2; their angles are"
        " definitions of this library.",
    )
    page.code(
        "from somersault import multibody\n\n"
        "diver = multibody.diver_spatial(mass=58.0, height=1.62)\n"
        'q = diver.configuration("F")\n'
        "diver.model.center_of_mass(q), diver.model.mass_matrix(q)\n"
    )
    page.section("In space")
    _scene(spatial).write(page.folder / "postures.html")
    page.add(
        '<iframe src="postures.html" title="A diver in all postures" loading="lazy" '
        'style="width:100%;height:30em;border:1px solid #ddd"></iframe>'
        '<p class="caption">From posture to posture, as <code>somersault.viewer</code> shows it: drag to'
        ' turn, scroll or pinch to come closer; <a href="postures.html">on a page of its own</a>.</p>'
    )
    page.figure(
        "diver-spatial",
        _drawn(spatial, ("xz", "yz")),
        "The spatial diver in all its postures, from the right and from the front of the figure"
        " (x forward, y to the left, z up).",
        "Nine figures made of ellipsoids in two rows, from the side and from the front",
    )
    _table(
        page,
        spatial,
        "Centre of mass from the joint between torso and pelvis; principal moments of inertia about the"
        " centre of mass with the joints locked; the moment about the axis of the somersault; and the angle"
        " between the axis of least inertia, about which the diver twists, and the axis of the torso.",
    )
    page.section("In the plane")
    page.figure(
        "diver-planar",
        _drawn(planar, ("xz",)),
        "The planar diver in all its postures. Arms and legs are pairs in one.",
        "Five figures made of ellipsoids, from the side",
    )
    _table(
        page,
        planar,
        "The same for the planar diver. In G its arms are forward, as they cannot be sideways.",
    )
    page.section("Segments")
    rows: list[list[str | Cell]] = []
    for diver in (planar, spatial):
        for link in diver.model.links:
            if link.mass > 0.0 and not link.name.startswith("left_"):
                kind = "planar" if diver is planar else "spatial"
                moments = np.diag(link.inertia)
                rows.append(
                    [
                        words(f"{kind}: {link.name.removeprefix('right_').replace('_', ' ')}"),
                        f"{link.mass:.3f}",
                        f"{1e3 * np.linalg.norm(link.center):.1f}",
                        *(f"{moment:.4f}" for moment in moments),
                    ]
                )
    page.table(
        (
            words("segment"),
            "mass, kg",
            "joint to centre, mm",
            *(f"I about {axis}, kg m²" for axis in "xyz"),
        ),
        rows,
        f"Masses add up to {planar.model.mass:.4f} and {spatial.model.mass:.4f} kg. Moments are about the"
        " centre of the segment along its own axes; those of the planar diver are of both limbs together,"
        " in axes of which z is across.",
    )
