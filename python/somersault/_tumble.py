"""The inertia of a free body, up to a factor, from the attitudes of its tumble."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault._somersault.exact import FreeBody
from somersault._somersault.integrators import RigidBody, State
from somersault.errors import InputError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

__all__ = ["InertiaEstimate", "estimate_inertia"]

Array = NDArray[np.float64]
Status: TypeAlias = Literal["identified", "symmetric", "steady", "weak", "undersampled", "misfit"]

#: Unknowns: five of the inertia, three of the orientation and three of the angular velocity.
_UNKNOWNS = 11
#: The least number of attitudes, and the number up to which local rates are fitted.
_LEAST, _LOCAL = 6, 200
#: The turn between two attitudes beyond which the way round is doubtful, rad.
_FAR = 2.0
#: Half widths of the windows, in attitudes, by whose local rates fits begin, and the turn that a window may
#: reach, rad.
_WINDOWS, _REACH = (2, 4, 8, 16, 32), 2.0
#: The turn of the first horizon of a fit, rad, and the factor by which horizons grow.
_FIRST, _GROWTH = 3.0, 1.8
#: Starts of the inertia by chance, after those by local rates; once a fit leaves noise alone, starts so
#: far from it in search of another inertia that fits as well.
_CHANCES, _RIVALS, _NEAR = 6, 3, 0.2
#: Standard deviations from which another inertia is another one.
_APART = 6.0
#: Level of the tests of what is not observable and of what does not fit.
_SURE = 1e-3
_MISFIT = 1e-6
#: Noise below this is that of rounding, rad.
_ROUNDING = 1e-9
#: Half width of the interval of a ratio beyond which it says little.
_WIDE = 0.25
#: Bound of the logarithms of second moments, beyond which bodies are rods and plates to rounding, and what
#: ties them to zero, in standard deviations of an attitude: those of rods and plates would grow without end.
_ELONGATED, _PRIOR = 12.0, 0.3
#: Step of derivatives, relative to the size of the unknown.
_STEP = 1e-7


@dataclass(frozen=True, eq=False)
class InertiaEstimate:
    """What `estimate_inertia` found. What the record does not determine is NaN, and `reason` names it.

    Attributes
    ----------
    status : {'identified', 'symmetric', 'steady', 'weak', 'undersampled', 'misfit'}
        Whether inertia and axes are determined; two moments are equal within their errors, so that the
        principal axes in their plane are any; the body turns steadily about one axis, which says nothing of
        its moments; an interval is so wide that it says little; the attitudes are too far apart; or the
        record is not that of a free rigid body with independent noise.
    reason : str
        The same in a sentence.
    ratios : ndarray, shape (3,)
        Principal moments of inertia, ascending, as fractions of the greatest.
    ratio_intervals : ndarray, shape (3, 2)
        Their intervals of confidence.
    axes : ndarray, shape (3, 3)
        Principal axes in the body frame, unit vectors as columns, right-handed.
    axis_errors : ndarray, shape (3,)
        Standard deviations of the rotation of the axes about each of them, rad; infinite where it is any.
    inertia : ndarray, shape (3, 3)
        The tensor in the body frame, as a fraction of its greatest principal moment.
    angular_velocity : ndarray, shape (3,)
        At the first time, body frame, rad/s.
    angular_velocity_errors : ndarray, shape (3,)
        Their standard deviations, rad/s.
    momentum_direction : ndarray, shape (3,)
        Unit vector along the angular momentum, world frame.
    momentum_error : float
        Standard deviation of its angle in each of the two directions across it, rad, the greater one.
    noise : float
        Standard deviation of an attitude about each axis, estimated from the residuals, rad.
    residuals : ndarray, shape (n, 3)
        Rotation vectors from the fitted attitudes to those given, body frame, rad.
    level : float
        Level of the intervals.
    motion : FreeBody or None
        The fitted motion, of a body whose greatest moment is 1 kg m²; None if the fit failed.
    """

    status: Status
    reason: str
    ratios: Array
    ratio_intervals: Array
    axes: Array = field(repr=False)
    axis_errors: Array = field(repr=False)
    inertia: Array = field(repr=False)
    angular_velocity: Array = field(repr=False)
    angular_velocity_errors: Array = field(repr=False)
    momentum_direction: Array = field(repr=False)
    momentum_error: float = field(repr=False)
    noise: float
    residuals: Array = field(repr=False)
    level: float = field(repr=False)
    motion: FreeBody | None = field(repr=False)

    @property
    def success(self) -> bool:
        """Whether the moments are determined up to a factor: ``'identified'`` or ``'symmetric'``."""
        return self.status in ("identified", "symmetric")

    def __repr__(self) -> str:
        shown = ", ".join(f"{ratio:.6g}" for ratio in self.ratios)
        return f"<InertiaEstimate: {self.status}, moments as {shown}>"


def estimate_inertia(
    t: ArrayLike, orientation: Rotation | ArrayLike, *, noise: float | None = None, level: float = 0.95
) -> InertiaEstimate:
    """The moments of inertia of a free rigid body up to a factor, its axes and its momentum, from attitudes.

    Without torque R I ω is constant. That equation, linear in I, gives a start; then the exact motion
    (`exact.FreeBody`) is fitted to the attitudes themselves by least squares, min Σ |log(R(t_k)ᵀ R_k)|²/σ²,
    over horizons that grow from the middle of the record. The inertia is found up to a factor, five numbers,
    as are three of the orientation and three of the angular velocity; their covariance is (JᵀJ)⁻¹σ², J the
    derivative of the residuals.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times, increasing, s; n is at least 6. They may be irregular and have gaps.
    orientation : Rotation or array_like, shape (n, 4) or (n, 3, 3)
        Rotations from the body frame to the world frame: `Rotation`s, quaternions (x, y, z, w) or matrices.
        Between most of them the body turns by less than 2 rad.
    noise : float, optional
        Standard deviation of an attitude about each axis, rad, independent and normal. Where it is given,
        residuals that it does not explain are a misfit; it is estimated from them unless given.
    level : float, optional
        Level of the intervals, between 0 and 1.

    Returns
    -------
    InertiaEstimate
        Its `status` says what is determined. What is not is NaN.

    Raises
    ------
    InputError
        If an argument is not allowed.

    Notes
    -----
    Near the separatrix the angular velocity stays in a plane of the body, |d|² = b² + k² for its part d in
    sech and its part b in tanh, and bodies with other moments have the same attitudes: other inertias are
    looked for around the one found, and one that fits as well is reported. A body that turns steadily about a
    principal axis says nothing of its moments (a test of likelihood against steady rotation at the level 10⁻³
    decides), and a symmetric one nothing of the axes in its plane of symmetry. Residuals whose neighbours are
    correlated are a misfit: another torque, another minimum, world and body exchanged, or noise that was
    filtered. Intervals are those of the linearised problem; where `noise` is not given, by Student's
    distribution. The cost is some hundred evaluations of the exact motion for each of up to eleven starts:
    0.1 s to 2 s for 200 attitudes.

    Sources: L. D. Landau and E. M. Lifshitz, Mechanics, §37; G. A. F. Seber and C. J. Wild, Nonlinear
    Regression, Wiley 1989, §5.

    Examples
    --------
    >>> import numpy as np
    >>> import somersault
    >>> from somersault import exact, motion
    >>> from scipy.spatial.transform import Rotation
    >>> body = somersault.RigidBody(1.0, (1.0, 2.0, 2.5))
    >>> tumble = exact.FreeBody(body, somersault.State(angular_velocity=(0.3, 1.0, 0.4)))
    >>> t = np.linspace(0.0, 20.0, 200)
    >>> shaken = Rotation.from_rotvec(np.random.default_rng(1).normal(0.0, 0.01, (200, 3)))
    >>> found = motion.estimate_inertia(t, tumble(t).orientation * shaken)
    >>> found.status, found.ratios.round(2), bool(abs(found.noise - 0.01) < 1e-3)
    ('identified', array([0.4, 0.8, 1. ]), True)

    A body that turns about a principal axis:

    >>> spin = exact.FreeBody(body, somersault.State(angular_velocity=(0.0, 0.0, 1.0)))
    >>> motion.estimate_inertia(t, spin(t).orientation * shaken).status
    'steady'
    """
    times, seen = _record(t, orientation)
    if noise is not None and not (isinstance(noise, int | float) and 0.0 < noise < math.inf):
        raise InputError(f"`noise` must be positive and finite, found {noise!r:.60}")
    if not (isinstance(level, int | float) and 0.0 < level < 1.0):
        raise InputError(f"`level` must be between 0 and 1, found {level!r:.60}")
    turns = (seen[:-1].inv() * seen[1:]).magnitude()
    if np.median(turns) > _FAR:
        why = (
            f"the body turns by {np.median(turns):.2g} rad between attitudes, more than {_FAR:g}: the way"
            " round is doubtful"
        )
        return _nothing("undersampled", why, level)
    problem = _Problem(times, seen)
    fits = _fitted(problem, turns, noise)
    if not fits:
        return _nothing("misfit", "no motion of a free body is near the attitudes", level)
    return _judged(problem, fits, noise, level)


def _record(t: ArrayLike, orientation: Rotation | ArrayLike) -> tuple[Array, Rotation]:
    """Times and rotations, checked."""
    from scipy.spatial.transform import Rotation

    try:
        times = np.array(t, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"`t` must be numbers of shape (n,), found {t!r:.60}") from None
    if times.ndim != 1 or len(times) < _LEAST:
        raise InputError(f"`t` must have shape (n,) with n at least {_LEAST}, found shape {times.shape}")
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise InputError("`t` must be finite and increasing")
    expected = f"{len(times)} Rotations, quaternions (x, y, z, w) or matrices"
    if isinstance(orientation, Rotation):
        found = orientation
        shape: tuple[int, ...] = np.shape(found.as_quat())
        if shape != (len(times), 4):
            raise InputError(f"`orientation` must be {expected}, found quaternions of shape {shape}")
        return times, found
    try:
        numbers = np.array(orientation, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"`orientation` must be {expected}, found a {type(orientation).__name__}") from None
    if numbers.shape not in ((len(times), 4), (len(times), 3, 3)):
        raise InputError(f"`orientation` must be {expected}, found shape {numbers.shape}")
    if not np.isfinite(numbers).all():
        raise InputError("`orientation` must be finite, found NaN or infinity")
    if numbers.ndim == 2:
        lengths = np.linalg.norm(numbers, axis=1)
        if lengths.min() < 1e-6:
            raise InputError(
                f"`orientation` must have quaternions of length 1, found one of {lengths.min():.3g}"
            )
        return times, Rotation.from_quat(numbers)
    off = np.abs(np.einsum("nij,nkj->nik", numbers, numbers) - np.eye(3)).max()
    if off > 1e-3 or np.linalg.det(numbers).min() < 0.0:
        raise InputError(
            f"`orientation` must have rotation matrices, orthogonal, right-handed, found one off by {off:.3g}"
        )
    return times, Rotation.from_matrix(numbers)


class _Problem:
    """The motion of a free body as a function of eleven unknowns, and how far it is from the attitudes.

    The inertia is tr(S) − S with S = exp M, the second moments of mass, and M symmetric without trace: five
    numbers, any of which is a body. The orientation is R₀ exp(δ) and the angular velocity that in the body,
    both at the reference time.
    """

    def __init__(self, times: Array, seen: Rotation) -> None:
        self.seen = seen
        self.middle = len(times) // 2
        self.origin = float(times[0])
        self.times = times - times[self.middle]

    def state(self, x: Array, base: Rotation) -> tuple[RigidBody, State]:
        """Body and state at the reference time."""
        from scipy.spatial.transform import Rotation

        return RigidBody(1.0, _inertia_of(x[:5])), State(
            orientation=base * Rotation.from_rotvec(x[5:8]), angular_velocity_body=x[8:]
        )

    def residuals(self, x: Array, base: Rotation, part: slice) -> Array:
        """log(R(t)ᵀ R) of the attitudes of a part, one after the other."""
        fitted = FreeBody(*self.state(x, base))(self.times[part]).orientation
        found: Array = (fitted.inv() * self.seen[part]).as_rotvec().ravel()
        return found

    def jacobian(self, x: Array, base: Rotation, part: slice) -> Array:
        return _differences(lambda y: self.residuals(y, base, part), x)


def _inertia_of(m: Array) -> Array:
    """The inertia of five numbers, with the trace 2."""
    a, b, c, d, e = np.clip(m, -_ELONGATED, _ELONGATED)
    values, axes = np.linalg.eigh(np.array([[a, c, d], [c, b, e], [d, e, -a - b]]))
    second = np.exp(values - values[2])
    found: Array = np.eye(3) - (axes * (second / second.sum())) @ axes.T
    return 0.5 * (found + found.T)


def _numbers_of(second: Array) -> Array:
    """The five numbers of second moments of mass, a positive definite tensor."""
    values, axes = np.linalg.eigh(second)
    log = axes @ np.diag(np.log(values)) @ axes.T
    log -= np.trace(log) / 3 * np.eye(3)
    return np.array([log[0, 0], log[1, 1], log[0, 1], log[0, 2], log[1, 2]])


def _differences(function: Callable[[Array], Array], x: Array) -> Array:
    """The derivative of a function by central differences."""
    columns = []
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = _STEP * max(1.0, abs(x[k]))
        columns.append((function(x + step) - function(x - step)) / (2 * step[k]))
    return np.stack(columns, axis=-1)


# ------------------------------------------------------------------------------------------------- fits


@dataclass(frozen=True)
class _Fit:
    x: Array
    base: Rotation
    residuals: Array

    @property
    def square(self) -> float:
        return float(self.residuals @ self.residuals)


def _rates(problem: _Problem, width: int) -> tuple[Array, Array, float]:
    """Attitudes by number, angular velocities in the body, and the noise, by local cubics through windows."""
    n = len(problem.times)
    centres = np.unique(np.linspace(0, n - 1, min(n, _LOCAL)).round().astype(int))
    found, rates, square, free = [], [], 0.0, 0
    for k in centres:
        around = np.arange(max(0, k - width), min(n, k + width + 1))
        vectors = (problem.seen[int(k)].inv() * problem.seen[around]).as_rotvec()
        near = np.linalg.norm(vectors, axis=1) < _REACH
        around, vectors = around[near], vectors[near]
        if len(around) < 5:
            continue
        s = problem.times[around] - problem.times[k]
        powers = (s / np.abs(s).max())[:, None] ** np.arange(4)
        terms, *_ = np.linalg.lstsq(powers, vectors, rcond=None)
        found.append(k)
        rates.append(terms[1] / np.abs(s).max())
        if len(around) > 4:
            square += float(((vectors - powers @ terms) ** 2).sum())
            free += 3 * (len(around) - 4)
    noise = math.sqrt(square / free) if free else math.nan
    return np.array(found, dtype=int), np.array(rates).reshape(-1, 3), noise


def _linear_inertia(problem: _Problem, numbers: Array, rates: Array) -> Array | None:
    """Second moments from R I ω = L and ω·I ω = 2T, homogeneous in I, L and T."""
    if len(numbers) < 4:
        return None
    size = float(np.sqrt(np.mean(np.sum(rates**2, axis=1))))
    if not size > 0.0:
        return None
    p, q, r = (rates / size).T
    zero = np.zeros_like(p)
    # I ω by the six numbers xx, yy, zz, xy, xz, yz
    in_body = np.stack(
        [
            np.stack([p, zero, zero, q, r, zero], axis=-1),
            np.stack([zero, q, zero, p, zero, r], axis=-1),
            np.stack([zero, zero, r, zero, p, q], axis=-1),
        ],
        axis=1,
    )
    turns = problem.seen[numbers].as_matrix()
    in_world = turns @ in_body
    momentum = np.concatenate(
        [in_world, np.tile(-np.eye(3), (len(p), 1, 1)), np.zeros((len(p), 3, 1))], axis=2
    ).reshape(-1, 10)
    energy = np.stack([p * p, q * q, r * r, 2 * p * q, 2 * p * r, 2 * q * r], axis=-1)
    energy = np.concatenate([energy, np.zeros((len(p), 3)), -np.ones((len(p), 1))], axis=1)
    *_, v = np.linalg.svd(np.concatenate([momentum, energy]), full_matrices=False)
    a, b, c, d, e, f = v[-1, :6]
    tensor = np.array([[a, d, e], [d, b, f], [e, f, c]])
    trace = float(np.trace(tensor))
    if abs(trace) < 1e-9:
        return None
    values, axes = np.linalg.eigh(0.5 * np.eye(3) - tensor / trace)
    values = np.maximum(values, 0.02)
    found: Array = axes @ np.diag(values / values.sum()) @ axes.T
    return found


def _fitted(problem: _Problem, turns: Array, noise: float | None) -> list[_Fit]:
    """Fits from several starts, the best first; few more once one leaves noise alone."""
    starts: list[tuple[Array, Array]] = []
    rough, spin = math.nan, None
    for width in _WINDOWS:
        numbers, rates, local = _rates(problem, width)
        if not len(numbers):
            continue
        if spin is None:
            rough = local
        spin = rates[np.argmin(np.abs(numbers - problem.middle))]
        second = _linear_inertia(problem, numbers, rates)
        if second is not None:
            starts.append((_numbers_of(second), spin))
        if width >= len(problem.times):
            break
    if spin is None:
        step = problem.times[problem.middle + 1] - problem.times[problem.middle]
        turn = problem.seen[problem.middle].inv() * problem.seen[problem.middle + 1]
        spin = turn.as_rotvec() / step
    sigma = noise or (rough if rough > _ROUNDING else _ROUNDING)
    chance = np.random.default_rng(0)
    starts.append((np.zeros(5), spin))
    starts += [(chance.normal(0.0, 0.6, 5), spin) for _ in range(_CHANCES)]
    fits: list[_Fit] = []
    for m, rate in starts:
        found = _grown(problem, np.concatenate([m, np.zeros(3), rate]), turns, sigma)
        if found is not None:
            fits.append(found)
            if not _misfits(found, noise):
                # where several inertias fit, a start elsewhere ends elsewhere
                near = (
                    np.concatenate([found.x[:5] + _NEAR * chance.normal(size=5), np.zeros(3), found.x[8:]])
                    for _ in range(_RIVALS)
                )
                fits += filter(None, (_grown(problem, start, turns, sigma) for start in near))
                break
    return sorted(fits, key=lambda fit: fit.square)


def _grown(problem: _Problem, x: Array, turns: Array, sigma: float) -> _Fit | None:
    """A fit over horizons that grow from the middle; the inertia is tied to its start until the last."""
    from scipy.spatial.transform import Rotation

    n, base = len(problem.times), problem.seen[problem.middle]
    start = x[:5].copy()
    turned = np.concatenate([[0.0], np.cumsum(turns)])
    turned = np.abs(turned - turned[problem.middle])
    reach = _FIRST
    while True:
        within = np.flatnonzero(turned <= reach)
        part = slice(int(within[0]), int(within[-1]) + 1)
        if part.stop - part.start >= min(n, _LEAST):
            whole = part == slice(0, n)
            ties, centre = (_PRIOR * sigma, np.zeros(5)) if whole else (sigma, start)

            last = _descended(problem, x, base, part, ties, centre, whole)
            if last is None:
                return None
            x = last
            # keep the rotation vector small, where it is a chart
            base, x = base * Rotation.from_rotvec(x[5:8]), np.concatenate([x[:5], np.zeros(3), x[8:]])
            if whole:
                fit = _Fit(x, base, problem.residuals(x, base, part))
                size = math.sqrt(fit.square / len(fit.residuals))
                if size > 0.5 * sigma or size < _ROUNDING:
                    return fit
                # ties are those of the noise that there is; once more with less
                sigma = max(0.5 * size, 0.1 * _ROUNDING)
                continue
        reach *= _GROWTH


def _descended(
    problem: _Problem, x: Array, base: Rotation, part: slice, ties: float, centre: Array, precise: bool
) -> Array | None:
    """The least squares of a part of the record, with the inertia tied to one."""
    from scipy.optimize import least_squares

    try:
        found = least_squares(
            lambda y: np.concatenate([problem.residuals(y, base, part), ties * (y[:5] - centre)]),
            x,
            lambda y: np.concatenate([problem.jacobian(y, base, part), ties * np.eye(5, _UNKNOWNS)]),
            x_scale="jac",
            ftol=1e-12 if precise else 1e-6,
            xtol=1e-12 if precise else 1e-6,
            gtol=None,
            max_nfev=50 if precise else 12,
        )
    except (ValueError, np.linalg.LinAlgError):
        # no such body, or numbers that are not finite
        return None
    end: Array = found.x
    return end


def _misfits(fit: _Fit, noise: float | None) -> str:
    """Why residuals are not independent noise, or nothing."""
    from scipy import stats

    size = math.sqrt(fit.square / len(fit.residuals))
    if size < _ROUNDING:
        return ""
    rows = fit.residuals.reshape(-1, 3)
    free = max(1, rows.size - _UNKNOWNS)
    if noise is not None and fit.square / noise**2 > stats.chi2.isf(_MISFIT, free):
        return f"residuals of {math.sqrt(fit.square / free):.2g} rad are not noise of {noise:g} rad"
    correlation = float(np.sum(rows[1:] * rows[:-1]) / fit.square)
    if correlation > stats.norm.isf(_MISFIT) / math.sqrt(rows.size - 3):
        return f"neighbouring residuals are correlated by {correlation:.2f}: they are not independent noise"
    if size > 0.5:
        return f"residuals of {size:.2g} rad are as large as if the attitudes were any"
    return ""


# ------------------------------------------------------------------------------------------------ verdicts


def _nothing(status: Status, reason: str, level: float) -> InertiaEstimate:
    none = np.full(3, math.nan)
    return InertiaEstimate(
        status, reason, none, np.full((3, 2), math.nan), np.full((3, 3), math.nan), none, np.full((3, 3),
        math.nan), none, none, none, math.nan, math.nan, np.full((0, 3), math.nan), level, None,
    )  # fmt: skip


def _judged(problem: _Problem, fits: list[_Fit], noise: float | None, level: float) -> InertiaEstimate:
    """What the best of the fits determines, and how well."""
    from scipy import stats

    fit = fits[0]
    whole = slice(0, len(problem.times))
    first = problem.times[0]
    free = max(1, len(fit.residuals) - _UNKNOWNS)
    estimated = math.sqrt(fit.square / free)
    residuals = fit.residuals.reshape(-1, 3)
    misfit = _misfits(fit, noise)
    if misfit:
        found = _nothing(
            "misfit", f"{misfit}: the body is not free or not rigid, or another motion fits", level
        )
        return replace(found, noise=estimated, residuals=residuals)
    sigma = noise if noise is not None else max(estimated, 1e-16)
    ties = _PRIOR * sigma * np.eye(5, _UNKNOWNS)
    jacobian = np.concatenate([problem.jacobian(fit.x, fit.base, whole), ties])
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    inverse = np.linalg.pinv(jacobian / scale, rcond=1e-14) / scale[:, None]
    covariance = sigma**2 * inverse @ inverse.T
    quantile = float(
        stats.norm.ppf(0.5 + level / 2) if noise is not None else stats.t.ppf(0.5 + level / 2, free)
    )

    def errors(function: Callable[[Array], Array]) -> Array:
        slopes = _differences(function, fit.x)
        variances = np.einsum("ij,jk,ik->i", slopes, covariance, slopes)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)), dtype=float)

    def at_start(x: Array) -> State:
        found: State = FreeBody(*problem.state(x, fit.base))(first)
        return found

    def momentum(x: Array) -> Array:
        at = at_start(x)
        return _unit(at.orientation.apply(_inertia_of(x[:5]) @ at.angular_velocity_body))

    start = at_start(fit.x)
    common: dict[str, Any] = {
        "angular_velocity": np.array(start.angular_velocity_body),
        "angular_velocity_errors": errors(lambda x: np.array(at_start(x).angular_velocity_body)),
        "momentum_direction": momentum(fit.x),
        "momentum_error": float(errors(momentum).max()),
        "noise": estimated,
        "residuals": residuals,
    }
    steady = _steady(problem, fit, sigma)
    excess = steady["square"] - fit.square
    if noise is not None:
        turns_steadily = excess / noise**2 < stats.chi2.isf(_SURE, 5)
    else:
        turns_steadily = excess / 5 < max(fit.square / free, _ROUNDING**2) * stats.f.isf(_SURE, 5, free)
    if turns_steadily:
        why = (
            "the body turns steadily about one axis, within the noise: that is a principal axis, and the"
            " moments may be any"
        )
        del steady["square"]
        return replace(_nothing("steady", why, level), **{**common, **steady})
    tensor = _inertia_of(fit.x[:5])
    moments, axes = np.linalg.eigh(tensor)
    tensor, moments = tensor / moments[2], moments / moments[2]
    axes[:, 2] *= np.sign(np.linalg.det(axes))

    slopes = _differences(lambda x: _in_axes(x, axes), fit.x)
    within = slopes @ covariance @ slopes.T
    half = quantile * np.sqrt(np.maximum(np.diag(within)[:3], 0.0))
    # of two moments that are equal, half the difference and the product of inertia are both zero
    equal = []
    axis_errors = np.zeros(3)
    for k, (i, j) in enumerate(((1, 2), (0, 2), (0, 1))):
        gap = moments[j] - moments[i]
        pair = np.zeros((2, 6))
        pair[0, [i, j]], pair[1, 3 + k] = (-0.5, 0.5), 1.0
        spread = pair @ within @ pair.T
        apart = gap / 2 * np.linalg.pinv(spread)[0, 0] * gap / 2 if spread.any() else math.inf
        if apart < stats.chi2.isf(_SURE, 2):
            equal.append((i, j))
            axis_errors[k] = math.inf
        else:
            axis_errors[k] = math.sqrt(max(within[3 + k, 3 + k], 0.0)) / gap
    intervals = np.stack([moments - half, moments + half], axis=-1)
    intervals[2] = 1.0
    determined: dict[str, Any] = {
        "ratios": moments,
        "ratio_intervals": np.clip(intervals, 0.0, 1.0),
        "axes": axes,
        "axis_errors": axis_errors,
        "inertia": tensor,
        "motion": FreeBody(RigidBody(1.0, tensor), start, problem.origin),
    }
    rival = _rival(fits, axes, within, max(sigma, _ROUNDING))
    if rival is not None:
        ends = np.stack([intervals, np.stack([rival, rival], axis=-1)])
        determined["ratio_intervals"] = np.clip(
            np.stack([ends[..., 0].min(axis=0), ends[..., 1].max(axis=0)], axis=-1), 0.0, 1.0
        )
        why = (
            f"moments as {rival[0]:.3g}, {rival[1]:.3g}, 1 fit as well: so it is near the separatrix, where"
            " the angular velocity stays in a plane of the body and tells one number of the inertia"
        )
        return replace(_nothing("weak", why, level), **common, **determined)
    names = ("least", "middle", "greatest")
    if half[:2].max() > _WIDE or len(equal) > 1:
        wide = float(half[:2].max())
        why = (
            f"the ratios of the moments are known to ±{wide:.2g} only: the body hardly wobbles, is near the"
            " separatrix, or the record is short"
        )
        return replace(_nothing("weak", why, level), **common, **determined)
    if equal:
        (i, j) = equal[0]
        third = 3 - i - j

        def of_pair(x: Array) -> Array:
            """The third moment as a fraction of the mean of the two, which is not drawn apart by noise."""
            own = _in_axes(x, axes)
            return np.array([2 * own[third] / (own[i] + own[j])])

        ratio, off = float(of_pair(fit.x)[0]), quantile * float(errors(of_pair)[0])
        low, high = ratio - off, ratio + off
        if third == 2:
            ratio, low, high = 1 / ratio, 1 / high, 1 / low
        known = np.ones((3, 3))
        known[[i, j] if third == 2 else [third]] = ratio, low, high
        determined["ratios"], determined["ratio_intervals"] = known[:, 0], known[:, 1:]
        determined["axes"] = np.where(np.arange(3) == third, axes, math.nan)
        why = (
            f"the {names[i]} and the {names[j]} moment are equal within their errors: the principal axes"
            " across the third one may be any"
        )
        return replace(_nothing("symmetric", why, level), **common, **determined)
    return replace(_nothing("identified", "moments and axes are determined", level), **common, **determined)


def _in_axes(x: Array, axes: Array) -> Array:
    """Moments 11, 22, 33 and products 23, 13, 12 of inertia about axes, as fractions of the third moment."""
    turned = axes.T @ _inertia_of(x[:5]) @ axes
    found: Array = turned[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]] / turned[2, 2]
    return found


def _rival(fits: list[_Fit], axes: Array, within: Array, sigma: float) -> Array | None:
    """The ratios of the moments of another inertia that is as likely as the best."""
    from scipy import stats

    allowed = _APART * np.sqrt(np.maximum(np.diag(within), 0.0)) + 1e-6
    for other in fits[1:]:
        as_likely = other.square - fits[0].square < sigma**2 * stats.chi2.isf(_SURE, 5)
        if as_likely and (np.abs(_in_axes(other.x, axes) - _in_axes(fits[0].x, axes)) > allowed).any():
            moments = np.linalg.eigvalsh(_inertia_of(other.x[:5]))
            return np.asarray(moments / moments[2], dtype=float)
    return None


def _unit(vector: Array) -> Array:
    found: Array = vector / max(float(np.linalg.norm(vector)), 1e-300)
    return found


def _steady(problem: _Problem, fit: _Fit, sigma: float) -> dict[str, Any]:
    """The rotation of constant angular velocity that is nearest to the attitudes."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    times = problem.times[:, None]

    def residuals(x: Array) -> Array:
        turned = fit.base * Rotation.from_rotvec(x[:3]) * Rotation.from_rotvec(times * x[3:])
        found: Array = (turned.inv() * problem.seen).as_rotvec().ravel()
        return found

    start = np.concatenate([np.zeros(3), fit.x[8:]])
    found = least_squares(residuals, start, lambda x: _differences(residuals, x), x_scale="jac", max_nfev=50)
    covariance = sigma**2 * np.linalg.pinv(found.jac.T @ found.jac)

    def direction(x: Array) -> Array:
        return _unit((fit.base * Rotation.from_rotvec(x[:3])).apply(x[3:]))

    slopes = _differences(direction, found.x)
    return {
        "square": 2 * found.cost,
        "angular_velocity": found.x[3:],
        "angular_velocity_errors": np.sqrt(np.diag(covariance)[3:]),
        "momentum_direction": direction(found.x),
        "momentum_error": float(np.sqrt(np.diag(slopes @ covariance @ slopes.T).max())),
    }
