"""Figures of finite-time Lyapunov analyses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from numpy.typing import ArrayLike, NDArray

from somersault import errors, ftla
from somersault.plotting.given import given_axes
from somersault.plotting.labels import label_ends

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "compare_motions",
    "exponent_history",
    "exponent_map",
    "exponents",
    "projections",
    "subspace_angles",
]

Array = NDArray[np.float64]

#: Colours of stable, centre and unstable, as in the thesis.
STABLE, CENTER, UNSTABLE = "#1b7837", "#2166ac", "#b2182b"

_STAGES = LinearSegmentedColormap.from_list("stages", [STABLE, CENTER, UNSTABLE])


def exponents(
    spectra: Sequence[ftla.Spectrum], dims: tuple[int, int, int] | None = None, ax: Axes | None = None
) -> Axes:
    """Exponents over the averaging time, as thesis Figure 10.1.

    Parameters
    ----------
    spectra : sequence of Spectrum
        At one point, for ascending averaging times.
    dims : tuple of int, optional
        (n^s, n^c, n^u), which choose the colours; all in one unless given.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> from somersault import ftla, plotting
    >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    >>> ax = plotting.exponents(flow.spectra([1.0, 0.4], [1.0, 2.0, 4.0]), dims=(1, 0, 1))
    >>> ax.get_xlabel()
    'averaging time, s'
    """
    ax = given_axes(ax, (5.0, 3.6))
    times = [spectrum.time for spectrum in spectra]
    rates = np.sort([spectrum.rates for spectrum in spectra], axis=1)
    stable, center, _ = dims or (0, rates.shape[1], 0)
    for i, curve in enumerate(rates.T):
        colour = STABLE if i < stable else CENTER if i < stable + center else UNSTABLE
        ax.plot(times, curve, color=colour, lw=1.5)
    ax.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    ax.set_xlabel("averaging time, s")
    ax.set_ylabel("growth rate μ, 1/s")
    ax.margins(x=0)
    return ax


def exponent_history(found: ftla.LyapunovSpectrum, ax: Axes | None = None) -> Axes:
    """Lyapunov exponents over the time of a long motion, with bands of their errors and values at its end.

    Parameters
    ----------
    found : LyapunovSpectrum
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla, plotting
    >>> flow = ftla.VariationalFlow(ftla.vector_field(lambda x: (x.b, -np.sin(x.a)), states=("a", "b")))
    >>> ax = plotting.exponent_history(ftla.lyapunov_spectrum(flow, [2.0, 0.0], 100.0))
    >>> len(ax.lines)
    3
    """
    if not isinstance(found, ftla.LyapunovSpectrum):
        raise TypeError(f"`found` must be a LyapunovSpectrum, found {type(found).__name__}")
    ax = given_axes(ax, (5.0, 3.6))
    ax.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    for curve, exponent, error in zip(found.history.T, found.exponents, found.errors, strict=True):
        sure = bool(abs(exponent) > error)
        colour = CENTER if not sure else UNSTABLE if exponent > 0 else STABLE
        ax.plot(found.times, curve, color=colour, lw=1.4, label=f"{exponent:.3f}".replace("-", "−"))
        if np.isfinite(error):
            ax.axhspan(exponent - error, exponent + error, color=colour, alpha=0.15, lw=0)
    ax.set_xlabel("time, s")
    ax.set_ylabel("Lyapunov exponents, 1/s")
    ax.margins(x=0)
    label_ends(ax)
    return ax


def exponent_map(
    field: ftla.FtleField,
    ridges: Sequence[ftla.Ridge] = (),
    names: tuple[str, str] = ("x", "y"),
    ax: Axes | None = None,
) -> Axes:
    """A field of finite-time exponents over a grid, with its ridges.

    Parameters
    ----------
    field : FtleField
        Over a grid of shape (rows, columns), whose columns are along the first of the states that vary.
    ridges : sequence of Ridge, optional
        As `FtleField.ridges` finds them.
    names : tuple of str, optional
        What to call the two states that vary.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla, plotting
    >>> flow = ftla.VariationalFlow(ftla.vector_field(lambda x: (x.b, -np.sin(x.a)), states=("a", "b")))
    >>> points = np.stack(np.meshgrid(np.linspace(-2, 2, 21), np.linspace(0, 2, 11)), axis=-1)
    >>> field = ftla.ftle_field(flow, points, 6.0)
    >>> ax = plotting.exponent_map(field, field.ridges(), names=("angle", "rate"))
    >>> ax.get_xlabel()
    'angle'
    """
    if not isinstance(field, ftla.FtleField):
        raise TypeError(f"`field` must be an FtleField, found {type(field).__name__}")
    if not all(isinstance(ridge, ftla.Ridge) for ridge in ridges):
        raise TypeError("`ridges` must be Ridges, as `FtleField.ridges` finds them")
    varying = [k for k in range(field.points.shape[-1]) if np.ptp(field.points[..., k]) > 0.0]
    if field.points.ndim != 3 or len(varying) != 2:
        raise errors.InputError(
            f"`field` must be over a grid of two states that vary, found points of shape {field.points.shape}"
        )
    if not isinstance(names, Sequence) or len(names) != 2:
        raise errors.InputError(f"`names` must be two names, found {names!r}")
    ax = given_axes(ax, (6.4, 3.6))
    x, y = (field.points[..., k] for k in varying)
    # the highest of all are those of walls and rests, beside which nothing would be seen
    seen = field.exponents[np.isfinite(field.exponents)]
    limits = np.quantile(seen, [0.02, 0.95]) if seen.size else (0.0, 1.0)
    shades: dict[str, Any] = {"cmap": "Greys", "vmin": limits[0], "vmax": limits[1]}
    colours = ax.pcolormesh(x, y, field.exponents, shading="nearest", rasterized=True, **shades)
    ax.figure.colorbar(colours, ax=ax, label="exponent, 1/s", extend="both")
    for ridge in ridges:
        ax.plot(*ridge.points.T, color=UNSTABLE if field.duration > 0 else CENTER, lw=1.4)
    ax.set_xlabel(names[0])
    ax.set_ylabel(names[1])
    return ax


def projections(
    motions: Sequence[tuple[ArrayLike, ArrayLike]],
    entries: tuple[int, int, int],
    names: tuple[str, str, str],
    transients: tuple[float, float],
    ax: Axes | None = None,
) -> Axes:
    """Motions in three of their states and costates, and their shadows on the planes, as thesis Figure 8.7.

    Parameters
    ----------
    motions : sequence of (t, p)
        Times, shape (m,), and points, shape (m, dimension).
    entries : tuple of int
        Which three entries of p.
    names : tuple of str
        What to call them.
    transients : tuple of float
        How long the first and the last stage take, s: green fades to blue over the first, blue to red over
        the last.
    ax : matplotlib.axes.Axes, optional
        Axes of three dimensions to draw into.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla, multibody, plotting
    >>> system = ftla.tree(multibody.two_link_arm())
    >>> times = np.linspace(0.0, 1.0, 20)
    >>> points = ftla.VariationalFlow(system).state([0.0, 0.5, 0.1, 0.0, 0.0, 0.1, 0.1, 0.0], times)
    >>> ax = plotting.projections([(times, points)], (0, 1, 2), ("θ₁", "θ₂", "rate of θ₁"), (0.2, 0.2))
    >>> ax.get_xlabel()
    'θ₁'
    """
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    drawn: Any = ax or plt.figure(figsize=(6.4, 5.4), layout="constrained").add_subplot(projection="3d")
    curves = [(np.asarray(t, dtype=float), np.asarray(p)[:, list(entries)]) for t, p in motions]
    low = np.min([curve.min(axis=0) for _, curve in curves], axis=0)
    high = np.max([curve.max(axis=0) for _, curve in curves], axis=0)
    margin = 0.08 * (high - low)
    walls = (low - margin, high + margin)
    for t, curve in curves:
        stage = 0.5 + 0.5 * (
            np.clip((t - t[-1] + transients[1]) / transients[1], 0.0, 1.0)
            - np.clip((t[0] + transients[0] - t) / transients[0], 0.0, 1.0)
        )
        for axis, wall in ((0, walls[0][0]), (1, walls[1][1]), (2, walls[0][2])):
            shadow = curve.copy()
            shadow[:, axis] = wall
            drawn.plot(*shadow.T, color="0.75", lw=0.8)
        segments = np.stack([curve[:-1], curve[1:]], axis=1)
        drawn.add_collection3d(
            Line3DCollection(segments, colors=_STAGES(0.5 * (stage[:-1] + stage[1:])), linewidths=1.8)
        )
    for index, letter in enumerate("xyz"):
        getattr(drawn, f"set_{letter}lim")(walls[0][index], walls[1][index])
        getattr(drawn, f"set_{letter}label")(names[index])
    found: Axes = drawn
    return found


def subspace_angles(
    flow: ftla.VariationalFlow,
    times: ArrayLike,
    points: ArrayLike,
    dims: tuple[int, int, int],
    averaging: float,
    ax: Axes | None = None,
) -> Axes:
    """Angles of the field with E^cs and E^cu, and of E^s with E^u, along a motion.

    Parameters
    ----------
    flow : VariationalFlow
    times : array_like, shape (m,)
        s.
    points : array_like, shape (m, dimension)
        States and costates at those times.
    dims : tuple of int
        (n^s, n^c, n^u).
    averaging : float
        Averaging time, s. Where less than that is left of the motion to one side, it is followed on beyond
        its end, and no angle is drawn where it cannot be.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla, plotting
    >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    >>> times = np.linspace(0.0, 2.0, 5)
    >>> ax = plotting.subspace_angles(flow, times, flow.state([1.0, 0.42], times), (1, 0, 1), averaging=2.0)
    >>> ax.get_xlabel()
    'time, s'
    """
    ax = given_axes(ax, (6.4, 3.6))
    times, points = np.asarray(times, dtype=float), np.asarray(points, dtype=float)
    found = np.full((len(times), 3), np.nan)
    for row, (p, h) in enumerate(zip(points, flow.system.field(points), strict=True)):
        forward = _spectrum(flow, p, averaging, "forward")
        backward = _spectrum(flow, p, averaging, "backward")
        if forward is not None:
            found[row, 0] = ftla.slow_subspace(forward, dims).angle_to(h)
        if backward is not None:
            found[row, 1] = ftla.slow_subspace(backward, dims).angle_to(h)
        if forward is not None and backward is not None:
            splitting = ftla.Splitting(forward, backward, dims)
            found[row, 2] = splitting.stable.angles(splitting.unstable)[0]
    labels = ("field and $E^{cs}$", "field and $E^{cu}$", "$E^s$ and $E^u$")
    for column, label, colour in zip(np.rad2deg(found).T, labels, (STABLE, UNSTABLE, "0.4"), strict=True):
        ax.semilogy(times, column, color=colour, label=label, lw=1.6)
    ax.set_xlabel("time, s")
    ax.set_ylabel("angle, °")
    ax.margins(x=0)
    ax.grid(color="0.92")
    label_ends(ax)
    return ax


def _spectrum(flow: ftla.VariationalFlow, p: Array, time: float, direction: Any) -> ftla.Spectrum | None:
    try:
        return flow.spectrum(p, time, direction)
    except (errors.IntegrationError, errors.EvaluationError):
        return None


def compare_motions(
    motions: Mapping[str, tuple[ArrayLike, ArrayLike]],
    names: Sequence[str],
    styles: Mapping[str, Mapping[str, Any]] | None = None,
) -> Axes:
    """Every state and costate of several motions over time, as thesis Figures 10.2 and 10.3.

    Parameters
    ----------
    motions : mapping of str to (t, p)
        Times, shape (m,), and points, shape (m, dimension); NaN where there are none.
    names : sequence of str
        Of the entries of p.
    styles : mapping of str to mapping, optional
        Keyword arguments of `Axes.plot` for a motion.

    Returns
    -------
    matplotlib.axes.Axes
        The first of them; each panel spans what the first motion does.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla, plotting
    >>> flow, times = ftla.VariationalFlow(ftla.cubic_regulator()), np.linspace(0.0, 2.0, 20)
    >>> motions = {str(costate): (times, flow.state([1.0, costate], times)) for costate in (0.41, 0.42)}
    >>> ax = plotting.compare_motions(motions, ["x", "λ"])
    >>> len(ax.lines)
    2
    """
    rows = (len(names) + 1) // 2
    figure = plt.figure(figsize=(9.0, 1.9 * rows + 0.5), layout="constrained")
    axes = figure.subplots(rows, 2, sharex=True, squeeze=False).T.ravel()
    first = np.asarray(next(iter(motions.values()))[1], dtype=float)
    for index, (name, ax) in enumerate(zip(names, axes, strict=False)):
        for label, (t, p) in motions.items():
            ax.plot(t, np.asarray(p)[:, index], label=label, **(styles or {}).get(label, {}))
        low, high = np.nanmin(first[:, index]), np.nanmax(first[:, index])
        margin = 0.25 * max(high - low, 1e-2 * max(abs(low), abs(high), 1e-9))
        ax.set_ylim(low - margin, high + margin)
        ax.set_ylabel(name)
        ax.grid(color="0.92")
        ax.margins(x=0)
    for ax in axes[rows - 1 :: rows]:
        ax.set_xlabel("time, s")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    drawn: Axes = axes[0]
    return drawn
