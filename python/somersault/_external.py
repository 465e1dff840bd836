"""Functions that cannot be traced, called by functions that are."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from somersault._somersault.expr import CompiledFunction
from somersault._symbols import Symbol, SymbolArray, calls_of, expression, objects, refusal, wrapped
from somersault.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ExternalFunction"]

#: Numbers of the output of a function, at most.
_MOST_NUMBERS = 10_000
_ROUNDING = float(np.finfo(float).eps)


class ExternalFunction:
    """A function that cannot be traced: a table, compiled code, branches on values, in a `ControlProblem`.

    It stands for `dynamics` or another function of the problem, or is called in one that is traced, as
    ``drag(x.h, x.v)``: then differences are taken by its own arguments alone. In the solver it is called with
    numbers, and holds the interpreter only while it is.

    Parameters
    ----------
    f : callable
        ``f(*arguments)``, which gives a number or an array. Arguments are numbers and arrays; entries of x, u
        and p are attributes by their names.
    shape : int or tuple of int, optional
        Of what `f` gives: a single number unless it is given, and of `dynamics` one for each state.
    jacobian : callable, optional
        ``jacobian(*arguments)``: the derivatives of the output's entries, one to a row, by the numbers of all
        arguments in their order. Without it differences of values are taken.
    hessian : callable, optional
        ``hessian(multipliers, *arguments)``: the Hessian matrix, by the same numbers, of the output's entries
        times `multipliers`, summed, as of `expr.Function`. Without it differences of `jacobian` are taken.
    vectorized : bool, optional
        Whether the callables take many points at once, on a last axis that arguments and outputs have.
    relative_error : float, optional
        Of the values, if they are less accurate than rounding, as those of a simulation: steps of differences
        are its cube root, and derivatives about its power ⅔ off.
    name : str, optional
        For messages; that of `f` unless it is given.

    Raises
    ------
    somersault.errors.InputError
        If an argument is not one of these.

    Notes
    -----
    `jacobian` and `hessian` are compared with differences before each solve, at the guess and at random
    points near it; an entry that is wrong is an `InputError` that names it. What the callables raise comes
    out of the solve as it was raised, with the best iterate as the attribute ``solution``. Where a value is
    not finite, a step is rejected. `polish` takes no problem with such a function.

    Examples
    --------
    A car is driven over a hill of which there is a table, from rest to rest with minimum effort:

    >>> import numpy as np
    >>> from scipy.interpolate import CubicSpline
    >>> from somersault import ocp
    >>> place = np.linspace(-1, 11, 25)
    >>> height = CubicSpline(place, 0.2 * np.exp(-((place - 5) ** 2) / 8))
    >>> slope = ocp.ExternalFunction(height.derivative(), jacobian=height.derivative(2), vectorized=True)
    >>> problem = ocp.ControlProblem(
    ...     lambda x, u: [x.v, u.force - 9.81 * slope(x.s)], states=("s", "v"), controls=("force",),
    ...     initial=[0, 0], final=[10, 0], duration=10, running_cost=lambda x, u: u.force**2 / 2)
    >>> found = problem.solve(tol=1e-4)
    >>> found.success, round(found.cost, 3)
    (True, 1.757)
    """

    def __init__(
        self,
        f: Callable[..., Any],
        shape: int | Sequence[int] | None = None,
        *,
        jacobian: Callable[..., Any] | None = None,
        hessian: Callable[..., Any] | None = None,
        vectorized: bool = False,
        relative_error: float | None = None,
        name: str | None = None,
    ) -> None:
        for argument, given in (("f", f), ("jacobian", jacobian), ("hessian", hessian)):
            if not callable(given) and (argument == "f" or given is not None):
                raise InputError(f"`{argument}` must be a function, found {type(given).__name__}")
        if hessian is not None and jacobian is None:
            raise InputError("`jacobian` must be given where `hessian` is")
        if isinstance(f, ExternalFunction):
            raise InputError("`f` must be a function of its own, found an ExternalFunction")
        self._f, self._jacobian, self._hessian = f, jacobian, hessian
        self._shape = None if shape is None else _shape(shape)
        self._vectorized = bool(vectorized)
        self._error = _ROUNDING if relative_error is None else _error(relative_error)
        self._name = _name(f) if name is None else str(name)

    @property
    def name(self) -> str:
        """str: What messages call it."""
        return self._name

    @property
    def shape(self) -> tuple[int, ...]:
        """tuple of int: Shape of what it gives."""
        return self._shape or ()

    @property
    def __signature__(self) -> inspect.Signature:
        """What `f` takes."""
        return inspect.signature(self._f)

    def __call__(self, *arguments: Any) -> Any:
        """The value at numbers; of symbols, what a traced function continues with."""
        arrays = [objects(argument) for argument in arguments]
        symbols = [entry for array in arrays for entry in array.reshape(-1) if isinstance(entry, Symbol)]
        if symbols:
            return self._recorded(symbols[0], arguments, arrays)
        call = Call(self, [np.shape(argument) for argument in arguments], [None] * len(arguments), [], [])
        point = np.concatenate([np.zeros(0), *(np.ravel(np.asarray(each, float)) for each in arguments)])
        found = call.values(point[np.newaxis]).reshape(self.shape)
        return float(found) if found.ndim == 0 else found

    def _with_shape(self, shape: tuple[int, ...]) -> ExternalFunction:
        """The same, where no shape was given."""
        if self._shape is not None:
            return self
        other = ExternalFunction.__new__(ExternalFunction)
        other.__dict__.update(self.__dict__, _shape=shape)
        return other

    def _recorded(self, symbol: Symbol, arguments: Sequence[Any], arrays: Sequence[Any]) -> Any:
        graph = symbol.graph
        calls = calls_of(graph)
        if calls is None:
            raise refusal(
                f"{self._name} is an ExternalFunction, which functions of an ocp.ControlProblem call"
            )
        given = [expression(graph, entry) for array in arrays for entry in array.reshape(-1)]
        returned = [graph.input() for _ in range(math.prod(self.shape))]
        names = [argument._names if isinstance(argument, SymbolArray) else None for argument in arguments]
        calls.append(Call(self, [array.shape for array in arrays], names, given, returned))
        found = np.empty(len(returned), dtype=object)
        found[:] = [Symbol(graph, number) for number in returned]
        return wrapped(found.reshape(self.shape))

    def __repr__(self) -> str:
        given = [name for name in ("jacobian", "hessian") if getattr(self, f"_{name}") is not None]
        derivatives = f"with {' and '.join(given)}" if given else "by differences"
        return f"<ExternalFunction: {self._name}, shape {self.shape}, {derivatives}>"


class _Named(np.ndarray):
    """Numbers that are attributes by their names."""

    _names: tuple[str, ...] | None = None

    def __getattr__(self, name: str) -> Any:
        if self._names and name in self._names:
            return self[self._names.index(name)]
        known = f"; its names are {', '.join(self._names)}" if self._names else ""
        raise AttributeError(f"the array has no attribute {name!r}{known}")


class Call:
    """A call in a traced function: shapes and names of arguments, numbers of these and of its values."""

    def __init__(
        self,
        function: ExternalFunction,
        shapes: Sequence[tuple[int, ...]],
        names: Sequence[tuple[str, ...] | None],
        given: list[int],
        returned: list[int],
    ) -> None:
        self.function, self.shapes, self.names = function, list(shapes), list(names)
        self.given, self.returned = given, returned
        self.n = sum(map(math.prod, self.shapes))

    def compiled(
        self,
        graph: Any,
        blocks: Sequence[tuple[str, list[int]]],
        inputs: Mapping[int, str],
        outputs: Mapping[int, str],
    ) -> tuple[Any, ...]:
        """As the library takes it; inputs and outputs of the traced function have names."""
        function = self.function
        own = [
            f"{function.name}[{k}]" if function.shape else function.name for k in range(len(self.returned))
        ]
        names = [outputs.get(number, name) for number, name in zip(self.returned, own, strict=True)]
        arguments = [
            inputs.get(number, name) for number, name in zip(self.given, self._argument_names(), strict=True)
        ]
        callables = (
            self.values,
            None if function._jacobian is None else self.jacobians,
            None if function._hessian is None else self.hessian,
        )
        traced = CompiledFunction(graph, list(blocks), self.given)
        return traced, function.name, (names, arguments), callables, function._error

    def values(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at points one below the other."""
        return self._at(self.function._f, "", points, self.function.shape)

    def jacobians(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Jacobian matrices at points one below the other."""
        shape = (*self.function.shape, self.n)
        return self._at(self.function._jacobian, "the Jacobian of ", points, shape)

    def hessian(self, point: NDArray[np.float64], multipliers: NDArray[np.float64]) -> NDArray[np.float64]:
        """The Hessian matrix at one point, weighed by multipliers."""
        weights = multipliers[0].reshape(self.function.shape)
        given = self.function._hessian

        def weighed(*arguments: Any) -> Any:
            assert given is not None
            return given(weights[..., np.newaxis] if self.function._vectorized else weights, *arguments)

        return self._at(weighed, "the Hessian of ", point, (self.n, self.n))

    def _at(
        self, call: Any, what: str, points: NDArray[np.float64], shape: tuple[int, ...]
    ) -> NDArray[np.float64]:
        """What a callable gives at points, one after the other."""
        if self.function._vectorized:
            found = self._array(what, self._called(call, points.T, None), (*shape, len(points)))
            return np.ascontiguousarray(np.moveaxis(found, -1, 0)).reshape(-1)
        rows = [self._array(what, self._called(call, point, point), shape).reshape(-1) for point in points]
        return np.concatenate(rows) if rows else np.zeros(0)

    def _called(self, call: Any, numbers: NDArray[np.float64], point: NDArray[np.float64] | None) -> Any:
        try:
            return call(*self._arguments(numbers))
        except Exception as error:
            if hasattr(error, "add_note"):
                where = "" if point is None else f" at {', '.join(f'{x:.6g}' for x in point)}"
                error.add_note(f"in the ExternalFunction {self.function.name}{where}")
            raise

    def _arguments(self, numbers: NDArray[np.float64]) -> list[Any]:
        """Numbers as the arguments that they are of, with the axis of points where there is one."""
        arguments: list[Any] = []
        end = 0
        for shape, names in zip(self.shapes, self.names, strict=True):
            start, end = end, end + math.prod(shape)
            array = numbers[start:end].reshape((*shape, *numbers.shape[1:]))
            if names:
                entries = array.view(_Named)
                entries._names = names
                arguments.append(entries)
            else:
                arguments.append(float(array) if array.ndim == 0 else array)
        return arguments

    def _array(self, what: str, found: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """What was found as numbers of a shape; axes of length one may be left out."""
        name = f"{what}{self.function.name}"
        try:
            if isinstance(found, list | tuple) and self.function._vectorized:
                found = _stacked(found)
            array = np.asarray(found.toarray() if hasattr(found, "toarray") else found, dtype=float)
        except (TypeError, ValueError) as error:
            raise InputError(f"`{name}` must be real numbers, found {type(found).__name__}") from error
        if array.shape != shape and [k for k in array.shape if k != 1] != [k for k in shape if k != 1]:
            raise InputError(f"`{name}` must have shape {shape}, found {array.shape}")
        return array.reshape(shape)

    def _argument_names(self) -> list[str]:
        try:
            of_f = [*inspect.signature(self.function._f).parameters]
        except (TypeError, ValueError):
            of_f = []
        found = []
        for k, (shape, names) in enumerate(zip(self.shapes, self.names, strict=True)):
            own = of_f[k] if k < len(of_f) else f"argument {k}"
            found += list(
                names or ([own] if shape == () else [f"{own}[{i}]" for i in range(math.prod(shape))])
            )
        return found


def _stacked(found: Any) -> NDArray[np.float64]:
    """Entries as rows, numbers among them for all points."""
    if not isinstance(found, list | tuple):
        return np.asarray(found, dtype=float)
    return np.stack(np.broadcast_arrays(*map(_stacked, found)))


def _shape(given: Any) -> tuple[int, ...]:
    lengths = (given,) if isinstance(given, int | np.integer) else given
    is_shape = isinstance(lengths, Sequence) and not isinstance(lengths, str | bytes)
    if isinstance(given, bool) or not is_shape:
        raise InputError(f"`shape` must be a length or lengths, found {given!r}")
    if not all(isinstance(n, int | np.integer) and not isinstance(n, bool) and n >= 1 for n in lengths):
        raise InputError(f"`shape` must be of positive lengths, found {given!r}")
    if math.prod(lengths) > _MOST_NUMBERS:
        raise InputError(f"`shape` must be of at most {_MOST_NUMBERS} numbers, found {given!r}")
    return tuple(int(n) for n in lengths)


def _error(given: Any) -> float:
    try:
        error = float(given)
    except (TypeError, ValueError):
        raise InputError(f"`relative_error` must be a number, found {type(given).__name__}") from None
    if not _ROUNDING <= error <= 0.01:
        raise InputError(
            f"`relative_error` must be from {_ROUNDING:.2g}, which is rounding, to 0.01, found {given}"
        )
    return error


def _name(f: Any) -> str:
    name = getattr(f, "__name__", None) or type(f).__name__
    return "f" if name == "<lambda>" else str(name)
