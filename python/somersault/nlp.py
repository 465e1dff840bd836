"""Nonlinear programs: `minimize`, in SciPy's habits.

A cost is minimised within bounds and constraints, by an interior-point method (``'ipm'``), by sequential
quadratic programming (``'sqp'``) or, within bounds alone, by L-BFGS (``'lbfgs'``). Constraints are those of
SciPy, dictionaries or objects, dense or sparse; SciPy itself is not needed. A success says that the
conditions of Karush, Kuhn and Tucker hold, computed again from the functions and multipliers that the result
has.

>>> import numpy as np
>>> from somersault import nlp
>>> found = nlp.minimize(
...     lambda x: -x[0] - x[1], [1.0, 0.0], constraints={"type": "ineq", "fun": lambda x: 1 - x @ x}
... )
>>> found.success, np.round(found.x, 6).tolist()
(True, [0.707107, 0.707107])
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault._arguments import _real_numbers
from somersault._somersault.nlp import solve_program
from somersault.errors import EvaluationError, InputError

__all__ = ["MinimizeResult", "minimize"]

#: The step of central differences, relative to the variable.
_STEP = np.finfo(float).eps ** (1 / 3)
#: Relative error of a derivative that differences cannot have.
_WRONG = 1e-4
#: Options of `minimize`, and the arguments of the solver that they are.
_OPTIONS = {
    "maxiter": "max_iterations",
    "maxfev": "max_evaluations",
    "max_time": "max_time",
    "check_derivatives": None,
}
_MESSAGES = {
    "converged": "Converged: all residuals are within their tolerances.",
    "stalled": "No step makes further progress; see the residuals.",
    "iteration_limit": "The limit of iterations was reached.",
    "evaluation_limit": "The limit of evaluations was reached.",
    "time_limit": "The limit of time was reached.",
    "infeasible": "Locally infeasible: no small step reduces the violation of the constraints.",
    "unbounded": "The cost is unbounded below.",
    "stopped": "Stopped by the callback.",
}

#: How a solve ends for which wrong derivatives may be the reason.
_SUSPECT = ("stalled", "iteration_limit", "infeasible", "unbounded")

_Vector = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class MinimizeResult:
    """What `minimize` found: always the best iterate, and what is known of it."""

    #: The best iterate.
    x: _Vector
    #: The cost there.
    fun: float
    #: Whether all residuals are within their tolerances.
    success: bool
    #: ``'converged'``, ``'stalled'``, ``'iteration_limit'``, ``'evaluation_limit'``, ``'time_limit'``,
    #: ``'infeasible'``, ``'unbounded'`` or ``'stopped'``.
    status: str
    #: The status in a sentence, and derivatives that are wrong, if any.
    message: str
    #: Steps.
    nit: int
    #: Calls of the cost, those of differences included.
    nfev: int
    #: Evaluations of first derivatives.
    njev: int
    #: Evaluations of second derivatives.
    nhev: int
    #: Multipliers by the name of a constraint, positive at upper bounds and negative at lower ones; those
    #: of the bounds of x are under ``'bounds'``.
    multipliers: dict[str, _Vector]
    #: Largest violation of a bound or constraint.
    constraint_violation: float
    #: Residuals of the gradient of the Lagrangian, of bounds and constraints, and of multipliers times
    #: distances, scaled as the tolerance is.
    residuals: dict[str, float]
    _start: tuple[_Vector, _Vector] = field(repr=False, compare=False)

    def __repr__(self) -> str:
        worst = max(self.residuals.values())
        return (
            f"<MinimizeResult: {self.status}, fun {self.fun:.8g}, {self.x.size} variables, "
            f"{self.nit} iterations, KKT residual {worst:.1e}>"
        )


def minimize(
    fun: Callable[..., Any],
    x0: ArrayLike | MinimizeResult,
    args: tuple[Any, ...] = (),
    method: str = "ipm",
    *,
    jac: Callable[..., Any] | bool | None = None,
    hess: Callable[..., Any] | None = None,
    bounds: Any = None,
    constraints: Any = (),
    tol: float | None = None,
    callback: Callable[[_Vector], Any] | None = None,
    options: Mapping[str, Any] | None = None,
) -> MinimizeResult:
    """Minimises a function within bounds and constraints, as `scipy.optimize.minimize` does.

    Derivatives that are not given are central differences, grouped by the sparsity of constraints that
    state it. Second derivatives are used where the cost and all constraints but linear ones have them; else
    there is a quasi-Newton approximation, dense, for some hundred variables. A function may bring its own
    derivatives as attributes `jac` and `hess`.

    What the functions raise comes out, with the best iterate until then as attribute `solution`. Values
    that are not finite are stepped back from; at the start they are an `EvaluationError`.

    Args:
        fun: The cost, ``fun(x, *args)``.
        x0: Where to begin; a result begins again where it ended, with its multipliers.
        args: More arguments of `fun`, `jac` and `hess`.
        method: ``'ipm'``: interior point, for many bounds or variables. ``'sqp'``: sequential quadratic
            programming, for warm starts and costly functions. ``'lbfgs'``: bounds only.
        jac: The gradient, ``jac(x, *args)``; True where `fun` gives cost and gradient.
        hess: The Hessian, ``hess(x, *args)``, dense or sparse.
        bounds: Pairs of lower and upper bounds, None where there is none, or an object with `lb` and `ub`.
        constraints: One or several: dictionaries with ``type`` (``'eq'`` or ``'ineq'``), ``fun`` and
            perhaps ``jac``, ``args`` and ``name``; objects with `fun`, `lb`, `ub`, `jac`, `hess` and
            `finite_diff_jac_sparsity`; objects with `A`, `lb` and `ub`.
        tol: Tolerance of all residuals, 10⁻⁸ unless given.
        callback: Called as ``callback(x)`` after each step; ends the solve where it returns True or raises
            StopIteration.
        options: ``maxiter``, ``maxfev``, ``max_time`` in seconds, and ``check_derivatives``: True compares
            the derivatives that are given with differences at the start, and names the entries that
            disagree in an `InputError`. A solve that does not converge looks in any case, and its message
            names them.

    >>> import numpy as np
    >>> from somersault import nlp
    >>> def rosen(x): return 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2
    >>> found = nlp.minimize(rosen, [-1.2, 1.0], bounds=[(None, 0.5), (None, None)])
    >>> found.status, np.round(found.x, 6).tolist()
    ('converged', [0.5, 0.25])
    >>> float(round(found.multipliers["bounds"][0], 4))
    1.0
    """
    if not callable(fun):
        raise InputError(f"`fun` must be callable, found {fun!r}")
    if tol is not None and not 0 < (size := _real_number("tol", tol)) < np.inf:
        raise InputError(f"`tol` must be positive and finite, found {size}")
    start, multipliers = _start(x0)
    if options is not None and not isinstance(options, Mapping):
        raise InputError(f"`options` must be values by name, found {options!r}")
    given = dict(options or {})
    for name in given:
        if name not in _OPTIONS:
            raise InputError(f"`options` may have {', '.join(map(repr, _OPTIONS))}, found {name!r}")
    program = _Program(fun, args, jac, hess, bounds, constraints, start)
    if given.pop("check_derivatives", False) and (wrong := program.wrong_derivatives(program.first)):
        raise InputError("derivatives disagree with differences: " + "; ".join(wrong))
    if method == "lbfgs" and program.rows:
        raise InputError("`method` 'lbfgs' takes no constraints but bounds; 'ipm' and 'sqp' do")
    warm = multipliers if multipliers is not None and multipliers[0].size == program.n_rows else None
    rows, held = warm or (np.empty(0), np.empty(0))
    limits = {_OPTIONS[name]: value for name, value in given.items() if value is not None}
    try:
        found = solve_program(
            method,
            (program.first, rows, held),
            (program.lower, program.upper),
            program.row_bounds,
            program.jacobian_pattern,
            program.hessian_pattern,
            (program.evaluate, program.differentiate, program.hessian if program.is_curved else None),
            tol=tol,
            callback=None if callback is None else _stopping(callback),
            **cast("Any", limits),
        )
    except BaseException as error:
        partial = getattr(error, "solution", None)
        if isinstance(partial, tuple):
            error.solution = program.result(partial)  # type: ignore[attr-defined]
        raise
    if found[0] == "undefined":
        raise EvaluationError("the cost, the constraints or their derivatives have no finite value at `x0`")
    return program.result(found)


def _start(x0: ArrayLike | MinimizeResult) -> tuple[_Vector, tuple[_Vector, _Vector] | None]:
    if isinstance(x0, MinimizeResult):
        return x0.x.copy(), x0._start
    x = np.atleast_1d(_real_numbers("x0", x0))
    if x.ndim != 1 or not np.isfinite(x).all():
        found = f"shape {x.shape}" if x.ndim != 1 else f"{x[~np.isfinite(x)][0]}"
        raise InputError(f"`x0` must be a vector of finite numbers, found {found}")
    return x, None


def _stopping(callback: Callable[[_Vector], Any]) -> Callable[..., bool]:
    def watch(iteration: int, x: _Vector, cost: float, residual: float) -> bool:
        if iteration == 0:
            return False
        try:
            return bool(callback(x))
        except StopIteration:
            return True

    return watch


def _bounds(bounds: Any, n: int) -> tuple[_Vector, _Vector]:
    """Lower and upper bounds of x, infinite where there are none."""
    if bounds is None:
        return np.full(n, -np.inf), np.full(n, np.inf)
    if hasattr(bounds, "lb"):
        return _limit("bounds.lb", bounds.lb, n), _limit("bounds.ub", bounds.ub, n)
    try:
        pairs = [(low, high) for low, high in bounds]
    except (TypeError, ValueError):
        raise InputError(f"`bounds` must be pairs of numbers or None, found {bounds!r}") from None
    if len(pairs) != n:
        raise InputError(f"`bounds` must have {n} pairs, found {len(pairs)}")
    lower = [_bound(f"bounds[{k}]", low, -np.inf) for k, (low, _) in enumerate(pairs)]
    upper = [_bound(f"bounds[{k}]", high, np.inf) for k, (_, high) in enumerate(pairs)]
    return np.array(lower), np.array(upper)


def _bound(argument: str, given: Any, missing: float) -> float:
    """A bound as a number; `missing` where it is None."""
    return missing if given is None else _real_number(argument, given)


def _real_number(argument: str, given: Any) -> float:
    number = _real_numbers(argument, given)
    if number.size != 1:
        raise InputError(f"`{argument}` must be a real number, found shape {number.shape}")
    return float(number.item())


def _limit(argument: str, given: Any, n: int) -> _Vector:
    """One bound for each of so many numbers, from as many or from one for all."""
    limit = _real_numbers(argument, given)
    if limit.shape not in ((), (1,), (n,)):
        raise InputError(f"`{argument}` must be a number or {n} of them, found shape {limit.shape}")
    return np.broadcast_to(limit, n)


def _entries(matrix: Any, shape: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.intp], _Vector]:
    """Rows, columns and values of a matrix: all of a dense one, those stored of a sparse one."""
    if hasattr(matrix, "tocoo"):
        sparse = matrix.tocsc()
        sparse.sum_duplicates()
        coordinates = sparse.tocoo()
        rows, columns = np.asarray(coordinates.row, np.intp), np.asarray(coordinates.col, np.intp)
        values, found = np.asarray(coordinates.data, float), tuple(matrix.shape)
    else:
        dense = np.asarray(matrix, dtype=float)
        dense = dense.reshape(shape) if dense.size == shape[0] * shape[1] else dense
        found = dense.shape
        columns, rows = np.divmod(np.arange(dense.size), shape[0] or 1)
        values = dense.T.ravel()
    if found != shape:
        raise InputError(f"a derivative must have the shape {shape}, found {found}")
    return rows, columns, values


class _Pattern:
    """Where a matrix may be other than zero, by compressed columns."""

    def __init__(self, shape: tuple[int, int], rows: NDArray[np.intp], columns: NDArray[np.intp]):
        self.shape = shape
        keys = np.unique(columns.astype(np.int64) * max(shape[0], 1) + rows)
        self.keys = keys
        self.rows = keys % max(shape[0], 1)
        self.starts = np.searchsorted(keys // max(shape[0], 1), np.arange(shape[1] + 1))
        # the places of what a function gave last, which it gives again as a rule
        self.last: dict[str, tuple[NDArray[np.int64], NDArray[np.intp]]] = {}

    @property
    def columns(self) -> NDArray[np.int64]:
        return cast("NDArray[np.int64]", self.keys // max(self.shape[0], 1))

    @property
    def parts(self) -> tuple[list[int], list[int]]:
        return self.starts.tolist(), self.rows.tolist()

    def places(self, rows: NDArray[np.intp], columns: NDArray[np.intp], name: str) -> NDArray[np.intp]:
        """Where the values of entries are."""
        keys = columns.astype(np.int64) * max(self.shape[0], 1) + rows
        if name in self.last and np.array_equal(keys, self.last[name][0]):
            return self.last[name][1]
        places = np.searchsorted(self.keys, keys)
        inside = places < self.keys.size
        missing = ~inside
        missing[inside] = self.keys[places[inside]] != keys[inside]
        if missing.any():
            k = int(np.argmax(missing))
            entry = f"[{int(rows[k])}, {int(columns[k])}]"
            raise InputError(
                f"{name} has an entry {entry} that it did not have at `x0`: store it there, as zero"
            )
        self.last[name] = keys, places
        return places


def _groups(pattern: _Pattern) -> list[NDArray[np.intp]]:
    """Columns that no row has two of: one pair of evaluations differentiates by all (Curtis, Powell & Reid
    1974)."""
    taken: list[set[int]] = []
    groups: list[list[int]] = []
    for j in range(pattern.shape[1]):
        rows = set(pattern.rows[pattern.starts[j] : pattern.starts[j + 1]].tolist())
        for have, group in zip(taken, groups, strict=True):
            if not have & rows:
                have |= rows
                group.append(j)
                break
        else:
            taken.append(rows)
            groups.append([j])
    return [np.array(group) for group in groups]


class _Function:
    """A function of x with as many values as it has rows, and its derivatives, given or by differences."""

    def __init__(
        self,
        name: str,
        fun: Callable[[_Vector], Any],
        jac: Any,
        hess: Any,
        sparsity: Any,
        first: _Vector,
        limits: tuple[_Vector, _Vector],
    ):
        self.name, self.fun, self.limits, self.calls = name, fun, limits, 0
        self.jac = jac if callable(jac) else None
        self.hess = hess if callable(hess) else None
        self.size = self.value(first).size
        shape = self.size, first.size
        if sparsity is not None:
            rows, columns, _ = _entries(sparsity, shape)
        elif self.jac is not None:
            rows, columns, _ = _entries(self.jac(first.copy()), shape)
        else:
            rows, columns, _ = _entries(np.zeros(shape), shape)
        self.pattern = _Pattern(shape, rows, columns)
        self.groups = _groups(self.pattern) if self.jac is None else []

    def value(self, x: _Vector) -> _Vector:
        self.calls += 1
        return np.atleast_1d(np.asarray(self.fun(x.copy()), dtype=float)).ravel()

    def derivative(self, x: _Vector) -> _Vector:
        """The values of the Jacobian, in the order of the pattern."""
        if self.jac is None:
            return self.differences(x, self.groups)
        rows, columns, values = _entries(self.jac(x.copy()), self.pattern.shape)
        out = np.zeros(self.pattern.keys.size)
        out[self.pattern.places(rows, columns, f"the Jacobian of {self.name}")] = values
        return out

    def differences(self, x: _Vector, groups: Iterable[NDArray[np.intp]]) -> _Vector:
        """Differences of second order, central or to one side where a bound is near."""
        lower, upper = self.limits
        out = np.zeros(self.pattern.keys.size)
        here: _Vector | None = None
        for group in groups:
            step = np.zeros(x.size)
            size = _STEP * np.maximum(1.0, np.abs(x[group]))
            room = np.minimum(upper[group] - x[group], x[group] - lower[group])
            if (room >= size).all():
                step[group] = size
                change = self.value(x + step) - self.value(x - step)
            else:
                here = self.value(x) if here is None else here
                forward = upper[group] - x[group] >= x[group] - lower[group]
                reach = np.where(forward, upper[group] - x[group], x[group] - lower[group])
                step[group] = np.where(forward, 1.0, -1.0) * np.minimum(size, 0.5 * reach)
                change = 4 * self.value(x + step) - 3 * here - self.value(x + 2 * step)
            for j in group[step[group] != 0]:
                span = slice(self.pattern.starts[j], self.pattern.starts[j + 1])
                out[span] = change[self.pattern.rows[span]] / (2 * step[j])
        return out

    def wrong_entries(self, x: _Vector) -> list[str]:
        """Entries of the given Jacobian that differences contradict."""
        if self.jac is None:
            return []
        given = self.derivative(x)
        rows, columns, _ = _entries(np.zeros(self.pattern.shape), self.pattern.shape)
        dense = _Pattern(self.pattern.shape, rows, columns)
        whole = np.zeros(dense.keys.size)
        whole[np.searchsorted(dense.keys, self.pattern.keys)] = given
        kept, self.pattern = self.pattern, dense
        try:
            seen = self.differences(x, [np.array([j]) for j in range(x.size)])
        finally:
            self.pattern = kept
        scale = np.maximum(np.maximum(np.abs(whole), np.abs(seen)), 1.0)
        wrong = np.flatnonzero(~(np.abs(whole - seen) <= _WRONG * scale))
        places = zip(dense.rows[wrong], dense.columns[wrong], strict=True)
        entries = [f"[{j}]" if self.name == "fun" else f"[{i}, {j}]" for i, j in places]
        return [
            f"the derivative of {self.name} has {whole[k]:.6g} at {entry} and differences {seen[k]:.6g}"
            for k, entry in zip(wrong[:10], entries, strict=False)
        ]


class _Program:
    """A cost, bounds and constraints as the solvers take them."""

    def __init__(
        self,
        fun: Callable[..., Any],
        args: tuple[Any, ...],
        jac: Any,
        hess: Any,
        bounds: Any,
        constraints: Any,
        start: _Vector,
    ):
        n = start.size
        self.lower, self.upper = _bounds(bounds, n)
        self.first = np.clip(start, self.lower, self.upper)
        limits = self.lower, self.upper
        # derivatives that a function brings itself, as one that was traced does
        jac = getattr(fun, "jac", None) if jac is None else jac
        hess = getattr(fun, "hess", None) if hess is None else hess
        pair: dict[bytes, Any] = {}

        def cost(x: _Vector) -> Any:
            if jac is not True:
                return fun(x, *args)
            pair.clear()
            value, pair[x.tobytes()] = fun(x, *args)
            return value

        def slope(x: _Vector) -> Any:
            if jac is not True:
                return jac(x, *args)
            if x.tobytes() not in pair:
                cost(x)
            return pair[x.tobytes()]

        own = (lambda x: hess(x, *args)) if callable(hess) else None
        has_slope = jac is True or callable(jac)
        self.cost = _Function("fun", cost, slope if has_slope else None, own, None, self.first, limits)
        if self.cost.size != 1:
            raise InputError(f"`fun` must give a number, found {self.cost.size}")
        self.rows: list[_Function] = []
        lows, highs = [np.empty(0)], [np.empty(0)]
        for k, constraint in enumerate(_listed(constraints)):
            place = f"constraint[{k}]"
            function, low, high = _constraint(constraint, place, self.first, limits)
            if function.name in self.names or function.name == "bounds":
                raise InputError(f"`constraints` has the name {function.name!r} twice")
            self.rows.append(function)
            lows.append(_limit(f"{place}.lb", low, function.size))
            highs.append(_limit(f"{place}.ub", high, function.size))
        self.row_bounds = np.concatenate(lows), np.concatenate(highs)
        self.n_rows = self.row_bounds[0].size
        self.offsets = np.cumsum([0, *(function.size for function in self.rows)])
        self._join_jacobians(n)
        self.is_curved = self.cost.hess is not None and all(f.hess is not None for f in self.rows)
        self._join_hessians(n)

    @property
    def names(self) -> list[str]:
        return [function.name for function in self.rows]

    def _join_jacobians(self, n: int) -> None:
        parts = list(zip(self.rows, self.offsets, strict=False))
        rows = [np.empty(0, np.intp), *(f.pattern.rows + offset for f, offset in parts)]
        columns = [np.empty(0, np.intp), *(f.pattern.columns for f, _ in parts)]
        joined = _Pattern((self.n_rows, n), np.concatenate(rows), np.concatenate(columns))
        self.jacobian_pattern = joined.parts
        self.jacobian_at = [
            joined.places(f.pattern.rows + offset, f.pattern.columns, "the Jacobian") for f, offset in parts
        ]
        self.n_entries = joined.keys.size

    def _join_hessians(self, n: int) -> None:
        self.hessian_parts: _Pattern = _Pattern((n, n), np.empty(0, np.intp), np.empty(0, np.intp))
        if self.is_curved:
            found = [self._upper(self.cost.hess, self.first)[:2]]
            found += [self._upper(f.hess, self.first, np.ones(f.size))[:2] for f in self.rows]
            rows, columns = (np.concatenate(part) for part in zip(*found, strict=True))
            self.hessian_parts = _Pattern((n, n), rows, columns)
        self.hessian_pattern = self.hessian_parts.parts

    def _upper(
        self, hess: Any, x: _Vector, *weights: _Vector
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], _Vector]:
        rows, columns, values = _entries(hess(x.copy(), *weights), (x.size, x.size))
        upper = rows <= columns
        return rows[upper], columns[upper], values[upper]

    def evaluate(self, x: _Vector) -> tuple[float, _Vector]:
        values = [function.value(x) for function in self.rows]
        return float(self.cost.value(x)[0]), np.concatenate([np.empty(0), *values])

    def differentiate(self, x: _Vector) -> tuple[_Vector, _Vector]:
        gradient, jacobian = np.zeros(x.size), np.zeros(self.n_entries)
        gradient[self.cost.pattern.columns] = self.cost.derivative(x)
        for function, places in zip(self.rows, self.jacobian_at, strict=True):
            jacobian[places] = function.derivative(x)
        return gradient, jacobian

    def hessian(self, x: _Vector, cost_factor: float, multipliers: _Vector) -> _Vector:
        out = np.zeros(self.hessian_parts.keys.size)
        rows, columns, values = self._upper(self.cost.hess, x)
        out[self.hessian_parts.places(rows, columns, "the Hessian of fun")] += cost_factor * values
        for function, offset in zip(self.rows, self.offsets, strict=False):
            rows, columns, values = self._upper(
                function.hess, x, multipliers[offset : offset + function.size]
            )
            out[self.hessian_parts.places(rows, columns, f"the Hessian of {function.name}")] += values
        return out

    def wrong_derivatives(self, x: _Vector) -> list[str]:
        return [entry for function in (self.cost, *self.rows) for entry in function.wrong_entries(x)]

    def result(self, found: Any) -> MinimizeResult:
        status, z, rows, held, fun, residuals, nit, counts = found
        x, y, y_x = (np.asarray(values) for values in (z, rows, held))
        message = _MESSAGES.get(status, status)
        if status in _SUSPECT and (wrong := self.wrong_derivatives(x)):
            message += " Derivatives disagree with differences: " + "; ".join(wrong) + "."
        _, njev, nhev = counts
        nfev = self.cost.calls
        multipliers = {"bounds": y_x}
        for function, offset in zip(self.rows, self.offsets, strict=False):
            multipliers[function.name] = y[offset : offset + function.size]
        return MinimizeResult(
            x=x,
            fun=fun,
            success=status == "converged",
            status=status,
            message=message,
            nit=nit,
            nfev=nfev,
            njev=njev,
            nhev=nhev,
            multipliers=multipliers,
            constraint_violation=self._violation(x),
            residuals=dict(zip(("stationarity", "feasibility", "complementarity"), residuals, strict=True)),
            _start=(y, y_x),
        )

    def _violation(self, x: _Vector) -> float:
        """The largest violation, of the functions as they are."""
        try:
            values = np.concatenate([x, *(function.value(x) for function in self.rows)])
        except Exception:  # what a function raised is on its way already
            return float("nan")
        lower = np.concatenate([self.lower, self.row_bounds[0]])
        upper = np.concatenate([self.upper, self.row_bounds[1]])
        return float(np.max(np.maximum(lower - values, values - upper), initial=0.0))


def _listed(constraints: Any) -> Sequence[Any]:
    if isinstance(constraints, Mapping) or hasattr(constraints, "lb"):
        return [constraints]
    if isinstance(constraints, str) or not isinstance(constraints, Iterable):
        raise InputError(f"`constraints` must be one or several constraints, found {constraints!r}")
    return list(constraints)


def _constraint(
    constraint: Any, name: str, first: _Vector, limits: tuple[_Vector, _Vector]
) -> tuple[_Function, Any, Any]:
    """A constraint of SciPy's kinds, by what it has."""
    if isinstance(constraint, Mapping):
        kind, fun = constraint.get("type"), cast("Any", constraint.get("fun"))
        if kind not in ("eq", "ineq") or not callable(fun):
            raise InputError(
                f"{name} must have a `type` 'eq' or 'ineq' and a callable `fun`, found {constraint!r}"
            )
        args = constraint.get("args", ())
        jac: Any = constraint.get("jac", getattr(fun, "jac", None))
        hess: Any = constraint.get("hess", getattr(fun, "hess", None))
        function = _Function(
            constraint.get("name", name),
            lambda x: fun(x, *args),
            (lambda x: jac(x, *args)) if callable(jac) else None,
            (lambda x, v: hess(x, v, *args)) if callable(hess) else None,
            None,
            first,
            limits,
        )
        return function, 0.0, 0.0 if kind == "eq" else np.inf
    named = getattr(constraint, "name", name)
    if hasattr(constraint, "A"):
        is_sparse = hasattr(constraint.A, "tocsc")
        matrix = constraint.A if is_sparse else np.atleast_2d(_real_numbers(f"{name}.A", constraint.A))
        n = first.size
        zero = _Zero(n)
        function = _Function(named, lambda x: matrix @ x, lambda x: matrix, zero, None, first, limits)
        return function, constraint.lb, constraint.ub
    fun = getattr(constraint, "fun", None)
    if not callable(fun) or not hasattr(constraint, "lb"):
        raise InputError(
            f"{name} must be a dictionary, or have `fun` or `A`, `lb` and `ub`; found {constraint!r}"
        )
    jac, hess = getattr(constraint, "jac", None), getattr(constraint, "hess", None)
    jac = jac if callable(jac) else getattr(fun, "jac", None)
    hess = hess if callable(hess) else getattr(fun, "hess", None)
    sparsity = getattr(constraint, "finite_diff_jac_sparsity", None)
    function = _Function(named, fun, jac, hess, sparsity, first, limits)
    return function, constraint.lb, constraint.ub


class _Zero:
    """The Hessian of linear constraints: a sparse matrix without entries."""

    def __init__(self, n: int):
        self.shape = n, n
        self.row = self.col = np.empty(0, np.intp)
        self.data = np.empty(0)

    def __call__(self, x: _Vector, v: _Vector) -> _Zero:
        return self

    def tocsc(self) -> _Zero:
        return self

    def tocoo(self) -> _Zero:
        return self

    def sum_duplicates(self) -> None:
        pass
