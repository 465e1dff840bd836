"""Flows of any vector field: Lyapunov spectra, fields of finite-time exponents with ridges, convergence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault import expr
from somersault._control_arguments import _article, _called, _flat, _names, _number
from somersault._somersault import ftla as _extension
from somersault._somersault.expr import CompiledFunction
from somersault._somersault.ftla import Spectrum, System, VariationalFlow
from somersault.errors import InputError

__all__ = [
    "ExponentConvergence",
    "FtleField",
    "LyapunovSpectrum",
    "Ridge",
    "exponent_convergence",
    "ftle_field",
    "lyapunov_spectrum",
    "vector_field",
]

_Floats: TypeAlias = NDArray[np.float64]
_Growth: TypeAlias = Literal["exponential", "power", "neutral", "unknown"]
_Result = TypeVar("_Result")

#: The most states of a field.
_MOST_STATES = 256


def vector_field(
    dynamics: Callable[..., Any],
    states: Sequence[str] | int,
    parameters: Mapping[str, float] | None = None,
) -> System:
    """A vector field dx/dt = f(x, t, p) in ordinary NumPy, which may depend on time.

    The function is called once, with symbols: field and Jacobian matrix are evaluated exactly and without the
    interpreter, as those of `expr.Function`.

    Parameters
    ----------
    dynamics : callable
        ``dynamics(x, t, p)``, or with fewer of these arguments from the first on: the rates of the states, in
        their order.
    states : sequence of str or int
        Names of the states, which are attributes of ``x``, or how many there are, up to 256.
    parameters : mapping of str to float, optional
        Values, which are attributes of ``p``.

    Returns
    -------
    System
        For a `VariationalFlow`, whose ``start`` is the time at the start of its runs. The searches for
        extremals take it where it does not depend on time.

    Raises
    ------
    TraceError
        If `dynamics` does something that symbols cannot take part in, or raises. Functions that cannot be
        traced make a `System` with a Jacobian of their own.

    Notes
    -----
    Where `np.where`, `np.sign` or `np.floor` make the field jump, its flow has no derivative that the
    variational equations see: exponents are those of the pieces between the jumps. Kinks do no harm.

    Examples
    --------
    >>> from somersault import ftla
    >>> lorenz = ftla.vector_field(
    ...     lambda x, t, p: (p.sigma * (x.y - x.x), x.x * (p.rho - x.z) - x.y, x.x * x.y - p.beta * x.z),
    ...     states=("x", "y", "z"), parameters={"sigma": 10.0, "rho": 28.0, "beta": 8 / 3})
    >>> lorenz
    <System: vector field of x, y, z>
    >>> (lorenz.jacobian([0.0, 0.0, 0.0]).round(3) + 0.0).tolist()
    [[-10.0, 10.0, 0.0], [28.0, -1.0, 0.0], [0.0, 0.0, -2.667]]
    """
    names = _names("states", states, "x")
    if not 1 <= len(names) <= _MOST_STATES:
        raise InputError(f"`states` must be from 1 to {_MOST_STATES}, found {len(names)}")
    if len(set(names)) < len(names):
        raise InputError(f"`states` must have names of their own, found {', '.join(names)}")
    values = _parameters(parameters)
    call = _called("dynamics", dynamics, ("x", "t", "p"))

    def rates(x: Any, t: Any) -> list[Any]:
        found = _flat("dynamics", call(x, t, values))
        if len(found) != len(names):
            raise InputError(f"`dynamics` must give {len(names)} rates, found {len(found)}")
        return found

    graph, blocks, numbers, _, _ = expr._recorded(rates, {"x": tuple(names), "t": ()})
    compiled = CompiledFunction(graph, blocks, numbers)
    again = (dynamics, tuple(names), None if parameters is None else dict(parameters))
    return System._of_traced(compiled, f"vector field of {', '.join(names)}", (vector_field, again))


def _parameters(parameters: Any) -> SimpleNamespace:
    """Values with names."""
    if parameters is None:
        return SimpleNamespace()
    if not isinstance(parameters, Mapping):
        found = _article(type(parameters).__name__)
        raise InputError(f"`parameters` must be values by name, found {found}")
    names = _names("parameters", list(parameters), "p")
    return SimpleNamespace(**{name: _number(f"parameters[{name!r}]", parameters[name]) for name in names})


@dataclass(frozen=True, eq=False, repr=False)
class LyapunovSpectrum:
    """Lyapunov exponents along a long motion, as `lyapunov_spectrum` finds them, in descending order."""

    #: The exponents over all of the motion but its transient, 1/s; NaN where there are none.
    exponents: _Floats
    #: Their estimated errors, 1/s: standard errors from sixteen parts of the last three quarters of the
    #: motion, and for what has not settled the distance from the limit as well.
    errors: _Floats
    #: How stretches grow: ``'exponential'``, like a ``'power'`` of time, ``'neutral'`` where neither, the
    #: exponent then being zero within its error, and ``'unknown'``.
    growth: tuple[_Growth, ...]
    #: m of the power Tᵐ that fits each stretch best.
    powers: _Floats
    #: Times since the start of the motion, s.
    times: _Floats
    #: The exponents up to these times, shape (m, dimension); NaN in the transient.
    history: _Floats
    #: The last state.
    state: _Floats
    #: Dimension of the attractor by the formula of Kaplan and Yorke.
    kaplan_yorke_dimension: float
    #: ``'converged'`` or ``'not_converged'`` where the motion reached its end; otherwise how it ended:
    #: ``'no_value'``, ``'step_underflow'``, ``'too_many_steps'``, ``'limit_reached'`` or ``'interrupted'``.
    status: str
    #: The reason in a sentence.
    message: str
    #: Evaluations of field and Jacobian.
    n_evaluations: int

    @property
    def success(self) -> bool:
        """Whether the exponents have converged."""
        return self.status == "converged"

    def __repr__(self) -> str:
        shown = ", ".join(f"{mu:.4g}" for mu in self.exponents[:4]) + ", …" * (len(self.exponents) > 4)
        return f"<LyapunovSpectrum: {self.status}, [{shown}] 1/s>"


def lyapunov_spectrum(
    flow: VariationalFlow,
    p: ArrayLike,
    duration: float,
    *,
    transient: float = 0.1,
    samples: int = 512,
    tolerance: float = 0.01,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> LyapunovSpectrum:
    """Lyapunov exponents along a long motion, with errors, and whether they have converged.

    A frame is carried along the motion and made orthonormal again where it has stretched a hundredfold
    (Benettin and others, 1980).

    Parameters
    ----------
    flow : VariationalFlow
        Its ``max_steps`` bounds the steps between two samples.
    p : array_like, shape (dimension,)
        Where the motion starts.
    duration : float
        s, transient included; negative backward in time, where the exponents are those of the reversed field.
    transient : float, optional
        The part of it that the exponents leave out, up to 0.9.
    samples : int, optional
        How many times are noted, evenly, from 32 on.
    tolerance : float, optional
        What errors may be relative to the largest rate, for the exponents to count as converged.
    max_time : float, optional
        s. A run that reaches it ends with the status ``'limit_reached'`` and what it has.
    max_evaluations : int, optional
        Of the field, likewise.

    Returns
    -------
    LyapunovSpectrum
        After Ctrl-C it is the attribute ``solution`` of the exception.

    Notes
    -----
    Exponents have converged where all of them grow by rates that have settled, or are zero within errors,
    and errors are below the tolerance. Growth like a power of time, as that of a shear, is distinguished
    from growth by a rate: its exponents fall like ln T/T indefinitely.

    Examples
    --------
    >>> from somersault import ftla
    >>> roessler = ftla.vector_field(lambda x: (-x.y - x.z, x.x + 0.2 * x.y, 0.2 + x.z * (x.x - 5.7)),
    ...                              states=("x", "y", "z"))
    >>> found = ftla.lyapunov_spectrum(ftla.VariationalFlow(roessler, rtol=1e-9), [1.0, 1.0, 1.0], 2000.0)
    >>> found.status, found.growth, (found.exponents.round(1) + 0.0).tolist()
    ('converged', ('exponential', 'neutral', 'exponential'), [0.1, 0.0, -5.4])
    """
    _expect_flow(flow)
    found = _extension.long_run(
        flow, p, duration, transient, samples, tolerance, max_time=max_time, max_evaluations=max_evaluations
    )
    raised = found.pop("raised")
    del found["rates"], found["rate_errors"]
    found["growth"] = tuple(found["growth"])
    return _delivered(LyapunovSpectrum(**found), raised)


@dataclass(frozen=True, eq=False, repr=False)
class Ridge:
    """A ridge of an `FtleField`, a polyline."""

    #: Its points, shape (m, 2): the two states that vary over the grid, in their order. The first is the last
    #: of a closed one.
    points: _Floats
    #: The exponents there, 1/s, smoothed as the field was.
    heights: _Floats
    #: How sharp it is: minus the smallest eigenvalue of the Hessian matrix of the field.
    curvatures: _Floats

    @property
    def length(self) -> float:
        """Its length, in units of the states."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def __repr__(self) -> str:
        return f"<Ridge: {len(self.points)} points>"


@dataclass(frozen=True, eq=False, repr=False)
class FtleField:
    """Finite-time Lyapunov exponents of many initial points, as `ftle_field` finds them."""

    #: The initial points, shape (..., dimension).
    points: _Floats
    #: Time that each is followed, s; negative backward.
    duration: float
    #: The largest exponent, shape (...), 1/s; NaN where the motion did not arrive.
    exponents: _Floats
    #: The unit vector that is stretched most, shape (..., dimension).
    directions: _Floats
    #: Where the motions arrived, shape (..., dimension).
    ends: _Floats
    #: How each motion ended, shape (...): ``'arrived'``, ``'left_domain'``, ``'no_value'``,
    #: ``'step_underflow'``, ``'too_many_steps'``, ``'limit_reached'`` or ``'interrupted'``.
    status: NDArray[np.str_]
    #: Evaluations of field and Jacobian.
    n_evaluations: int

    @property
    def success(self) -> bool:
        """Whether every motion arrived."""
        return bool((self.status == "arrived").all())

    def ridges(
        self,
        *,
        smoothing: float = 1.0,
        min_height: float | None = None,
        min_curvature: float = 0.0,
        min_length: float | None = None,
    ) -> list[Ridge]:
        """Ridges of the field on a grid: Lagrangian coherent structures.

        Those forward in time repel, those backward attract. A point is on a ridge where the gradient is
        orthogonal to the eigenvector of the smallest eigenvalue of the Hessian matrix, and that is negative.
        Points are found between the nodes, to the fourth order of the spacing where the grid resolves the
        ridge and nothing is smoothed.

        Parameters
        ----------
        smoothing : float, optional
            Standard deviation of the Gaussian that smooths the field first, in spacings. Ridges that are
            narrower than a few spacings come in pieces without it; those that are wide need none.
        min_height : float, optional
            Lowest exponent on a ridge, 1/s, of the smoothed field; what a fifth of it is above unless given.
        min_curvature : float, optional
            Least curvature.
        min_length : float, optional
            Least length; that of five cells unless given.

        Returns
        -------
        list of Ridge
            The longest first.

        Examples
        --------
        The stable manifold of a pendulum's upright rest, where its energy is that of the rest:

        >>> import numpy as np
        >>> from somersault import ftla
        >>> pendulum = ftla.vector_field(lambda x: (x.rate, -np.sin(x.angle)), states=("angle", "rate"))
        >>> angle, rate = np.meshgrid(np.linspace(-2, 2, 81), np.linspace(0.4, 2.6, 45))
        >>> flow = ftla.VariationalFlow(pendulum, rtol=1e-8)
        >>> ridge = ftla.ftle_field(flow, np.stack([angle, rate], axis=-1), 6.0).ridges()[0]
        >>> angle, rate = ridge.points.T
        >>> bool(np.median(abs(rate**2 / 2 - np.cos(angle) - 1)) < 0.01)
        True
        """
        columns, rows = self._axes()
        exponents = _extension.grid_smoothed(self.exponents, _number("smoothing", smoothing))
        if min_height is None:
            seen = exponents[np.isfinite(exponents)]
            min_height = float(np.quantile(seen, 0.8)) if seen.size else 0.0
        if min_length is None:
            min_length = 5.0 * math.hypot(columns[2], rows[2])
        limits = [
            _number(name, value)
            for name, value in (
                ("min_height", min_height),
                ("min_curvature", min_curvature),
                ("min_length", min_length),
            )
        ]
        found = _extension.grid_ridges(exponents, (columns[1], rows[1]), (columns[2], rows[2]), *limits)
        turned = slice(None, None, 1 if columns[0] < rows[0] else -1)
        return [Ridge(points[:, turned].copy(), *values) for points, *values in found]

    def _axes(self) -> tuple[tuple[int, float, float], tuple[int, float, float]]:
        """Of columns and rows of the grid: which state varies along them, its first value and its spacing."""
        wanted = (
            "`points` must be a grid of shape (rows, columns, dimension) over which two states vary evenly"
        )
        if self.points.ndim != 3 or min(self.points.shape[:2]) < 3:
            raise InputError(f"{wanted}, of 3 and more each, for ridges; found shape {self.points.shape}")
        varying = [k for k in range(self.points.shape[2]) if np.ptp(self.points[..., k]) > 0.0]
        found = {}
        for axis in (0, 1):
            for k in varying:
                values = np.moveaxis(self.points[..., k], axis, 0)
                line = values[:, 0]
                steps = np.diff(line)
                even = np.allclose(steps, steps.mean(), rtol=1e-6, atol=0.0)
                if even and steps.mean() > 0.0 and np.ptp(values, axis=1).max() <= 1e-9 * np.ptp(line):
                    found[axis] = (k, float(line[0]), float(steps.mean()))
        if len(varying) != 2 or len(found) != 2:
            raise InputError(f"{wanted} and upward, for ridges; found {len(varying)} states that vary")
        return found[1], found[0]

    def __repr__(self) -> str:
        shape = "×".join(map(str, self.exponents.shape)) or "one"
        return f"<FtleField: {shape} points over {self.duration:g} s>"


def ftle_field(
    flow: VariationalFlow,
    points: ArrayLike,
    duration: float,
    *,
    domain: Sequence[tuple[float, float] | None] | None = None,
    max_time: float | None = None,
    max_evaluations: int | None = None,
) -> FtleField:
    """The largest finite-time Lyapunov exponent of many initial points, from exact variational equations.

    On all cores; the values do not depend on their number.

    Parameters
    ----------
    flow : VariationalFlow
        Its ``start`` is the time at which motions start.
    points : array_like, shape (..., dimension)
        Initial points, such as ``np.stack(np.meshgrid(x, y), axis=-1)``.
    duration : float
        How long each is followed, s; negative backward in time.
    domain : sequence of (float, float) or None, optional
        A lower and an upper limit of each state; None leaves a state free. A motion ends where a step has led
        outside; what goes along the boundary is inside.
    max_time : float, optional
        s. Motions that are not at their ends then have the status ``'limit_reached'``.
    max_evaluations : int, optional
        Of the field by all motions together, likewise.

    Returns
    -------
    FtleField
        After Ctrl-C it is the attribute ``solution`` of the exception.

    Examples
    --------
    The double gyre of Shadden, Lekien and Marsden (2005):

    >>> import numpy as np
    >>> from somersault import ftla
    >>> def gyre(x, t):
    ...     a = 0.25 * np.sin(0.2 * np.pi * t)
    ...     f, slope = a * x.x**2 + (1 - 2 * a) * x.x, 2 * a * x.x + 1 - 2 * a
    ...     u = -0.1 * np.pi * np.sin(np.pi * f) * np.cos(np.pi * x.y)
    ...     return u, 0.1 * np.pi * np.cos(np.pi * f) * np.sin(np.pi * x.y) * slope
    >>> flow = ftla.VariationalFlow(ftla.vector_field(gyre, states=("x", "y")), rtol=1e-8)
    >>> points = np.stack(np.meshgrid(np.linspace(0, 2, 41), np.linspace(0, 1, 21)), axis=-1)
    >>> found = ftla.ftle_field(flow, points, 15.0, domain=[(0, 2), (0, 1)])
    >>> found.success, found.exponents.shape, round(float(found.exponents.max()), 1)
    (True, (21, 41), 1.1)
    """
    _expect_flow(flow)
    duration = _number("duration", duration)
    n = flow.system.dimension
    try:
        array = np.array(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"`points` must be real numbers of shape (..., {n})") from error
    except MemoryError as error:
        raise InputError("the numbers of `points` need more memory than there is") from error
    if array.ndim == 0 or array.shape[-1] != n:
        raise InputError(f"`points` must be real numbers of shape (..., {n}), found shape {array.shape}")
    shape = array.shape[:-1]
    found = _extension.field_exponents(
        flow,
        array.reshape(-1, n),
        duration,
        _domain(domain, n),
        max_time=max_time,
        max_evaluations=max_evaluations,
    )
    raised = found.pop("raised")
    result = FtleField(
        points=array,
        duration=duration,
        exponents=found["exponents"].reshape(shape),
        directions=found["directions"].reshape(array.shape),
        ends=found["ends"].reshape(array.shape),
        status=np.array(found["status"], dtype=np.str_).reshape(shape),
        n_evaluations=found["n_evaluations"],
    )
    return _delivered(result, raised)


def _domain(domain: Any, n: int) -> list[tuple[float, float]] | None:
    """Limits of all states."""
    if domain is None:
        return None
    if isinstance(domain, str | Mapping) or not isinstance(domain, Sequence | np.ndarray) or len(domain) != n:
        raise InputError(f"`domain` must be {n} pairs of limits, one for each state, found {domain!r}")
    pairs = []
    for k, pair in enumerate(domain):
        if pair is None:
            pairs.append((-math.inf, math.inf))
            continue
        try:
            low, high = (float(limit) for limit in pair)
        except (TypeError, ValueError) as error:
            raise InputError(f"`domain[{k}]` must be a pair of numbers or None, found {pair!r}") from error
        if not low < high:
            raise InputError(f"`domain[{k}]` must have a lower limit below the upper one, found {pair!r}")
        pairs.append((low, high))
    return pairs


@dataclass(frozen=True, eq=False, repr=False)
class ExponentConvergence:
    """Whether finite-time exponents and directions have converged, as `exponent_convergence` finds it."""

    #: Whether all exponents are known to the tolerance.
    success: bool
    #: The reason in a sentence.
    message: str
    #: How each stretch grows, as in `LyapunovSpectrum`, in the order of the exponents.
    growth: tuple[_Growth, ...]
    #: Mean growth rates over the last three quarters of the averaging time, 1/s.
    rates: _Floats
    #: Their estimated errors, 1/s.
    rate_errors: _Floats
    #: m of the power Tᵐ that fits each stretch best.
    powers: _Floats
    #: By how much the span of the first k vectors, k = 1 to dimension − 1, changes from half of the averaging
    #: time to its end, rad.
    subspace_changes: _Floats
    #: The rate at which that angle falls with the averaging time, 1/s; NaN where too few times show it.
    subspace_rates: _Floats
    #: The rate at which the exponents k and k + 1 separate, 1/s, which `subspace_rates` approach.
    gaps: _Floats
    #: How they separate, as `growth`.
    gap_growth: tuple[_Growth, ...]

    def __repr__(self) -> str:
        return f"<ExponentConvergence: {self.message}>"


def exponent_convergence(spectra: Sequence[Spectrum], *, tolerance: float = 0.01) -> ExponentConvergence:
    """Tests whether the finite-time exponents and directions at a point have converged in the averaging time.

    Growth by a rate is distinguished from growth like a power of time, whose exponents fall like ln T/T, and
    from what still changes. `diagnose` says what exponents mean for an optimal control problem.

    Parameters
    ----------
    spectra : sequence of Spectrum
        At one point, for ascending averaging times, of which sixteen and more are in the last three quarters
        of the longest.
    tolerance : float, optional
        What errors may be relative to the largest rate.

    Returns
    -------
    ExponentConvergence

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla
    >>> times = np.arange(0.5, 20.1, 0.5)
    >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    >>> ftla.exponent_convergence(flow.spectra([1.0, 0.4], times))
    <ExponentConvergence: the exponents have converged>
    >>> shear = ftla.VariationalFlow(ftla.vector_field(lambda x: (x.y, 0.0), states=("x", "y")))
    >>> found = ftla.exponent_convergence(shear.spectra([1.0, 0.4], 10 * times))
    >>> found.success, found.growth, found.powers.round(2).tolist()
    (False, ('power', 'power'), [-1.0, 1.0])
    """
    tolerance = _number("tolerance", tolerance)
    if tolerance <= 0.0:
        raise InputError(f"`tolerance` must be positive, found {tolerance}")
    found = _extension.spectra_convergence(spectra, tolerance)
    found["success"] = found.pop("converged")
    return ExponentConvergence(**{**found, **{name: tuple(found[name]) for name in ("growth", "gap_growth")}})


def _expect_flow(flow: Any) -> None:
    if not isinstance(flow, VariationalFlow):
        raise InputError(f"`flow` must be a VariationalFlow, found {_article(type(flow).__name__)}")


def _delivered(result: _Result, raised: BaseException | None) -> _Result:
    """The result, or what was raised with the result in its attribute `solution`."""
    if raised is None:
        return result
    raised.solution = result  # type: ignore[attr-defined]
    raise raised
