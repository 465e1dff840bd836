"""Symbols that stand for numbers while a function is traced, and what NumPy does with them.

A `Symbol` is an expression of a graph, a `SymbolArray` an array of them. Both take part in NumPy's protocols
for ufuncs and functions. Arrays that `np.array` makes of symbols are ordinary ones of objects, whose elements
NumPy calls by the names of its functions.
"""

from __future__ import annotations

import contextlib
import functools
import linecache
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from types import FrameType
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from somersault._somersault.expr import ExpressionGraph
from somersault.errors import InputError, TraceError

#: Modules whose lines are not those of the user's function.
_OURS = (
    "somersault._symbols",
    "somersault._external",
    "somersault._traced_force",
    "somersault.expr",
    "numpy",
)


def _is_of_user(frame: FrameType) -> bool:
    name = str(frame.f_globals.get("__name__", ""))
    return not any(name == module or name.startswith(f"{module}.") for module in _OURS)


def _place(frame: FrameType, line: int) -> str:
    """A line in words."""
    path = frame.f_code.co_filename
    text = linecache.getline(path, line, frame.f_globals).strip()
    return f"{path}, line {line}" + (f", `{text}`" if text else "")


def _trace_error(place: str, reason: str) -> TraceError:
    error = TraceError(f"{place}: {reason}")
    error.place, error.reason = place, reason
    return error


def refusal(reason: str) -> TraceError:
    """What is raised where a function cannot be traced, with the line of it."""
    frame = sys._getframe(1)
    while frame.f_back is not None and not _is_of_user(frame):
        frame = frame.f_back
    return _trace_error(_place(frame, frame.f_lineno), reason)


def raised(error: Exception) -> TraceError:
    """What a function raised while it was traced, with the line of it."""
    step, place = error.__traceback__, ""
    while step is not None:
        if _is_of_user(step.tb_frame):
            place = _place(step.tb_frame, step.tb_lineno)
        step = step.tb_next
    return _trace_error(place or "`f`", f"{type(error).__name__}: {error}")


#: Calls of functions that are not traced, of the graphs that take them while they are recorded.
_CALLS: dict[int, list[Any]] = {}


@contextlib.contextmanager
def recording(graph: ExpressionGraph, calls: list[Any] | None) -> Iterator[None]:
    """While a function is traced; its calls of functions that are not traced are added to the list."""
    if calls is not None:
        _CALLS[id(graph)] = calls
    try:
        yield
    finally:
        _CALLS.pop(id(graph), None)


def calls_of(graph: ExpressionGraph) -> list[Any] | None:
    """The calls recorded with a graph, if it takes any."""
    return _CALLS.get(id(graph))


_NO_VALUE = (
    "a symbol has no value while a function is traced; use np.sin and the like in place of those of math, "
    "and np.array([...]) or np.stack([...]) in place of assigning to elements of an array of numbers"
)
_NO_TRUTH = (
    "a symbol is neither true nor false while a function is traced; write np.where(condition, a, b) in place "
    "of a branch, np.maximum, np.minimum or np.clip in place of max, min and sorting, and np.stack([...]) in "
    "place of np.array([...]) where symbols in it are compared"
)


class Symbol(NDArrayOperatorsMixin):
    """An expression of the inputs of a function that is being traced."""

    __slots__ = ("graph", "number")

    def __init__(self, graph: ExpressionGraph, number: int) -> None:
        self.graph = graph
        self.number = number

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _ufunc(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        return _function(function, arguments, options)

    def __bool__(self) -> bool:
        raise refusal(_NO_TRUTH)

    def __float__(self) -> float:
        raise refusal(_NO_VALUE)

    __int__ = __complex__ = __index__ = __float__

    def __round__(self, digits: int | None = None) -> Any:
        raise refusal("rounding has no derivative; np.floor and np.ceil are traced")

    def __hash__(self) -> int:
        return hash((id(self.graph), self.number))

    def __repr__(self) -> str:
        value = self.graph.value(self.number)
        return f"<Symbol {self.number}>" if value is None else f"<Symbol {value}>"

    @property
    def shape(self) -> tuple[int, ...]:
        """That of a single number."""
        return ()

    @property
    def real(self) -> Symbol:
        """The symbol, which is real."""
        return self

    ndim = 0
    size = 1

    def item(self) -> Symbol:
        """The symbol."""
        return self

    def copy(self) -> Symbol:
        """The symbol."""
        return self


class SymbolArray(np.ndarray):
    """An array of symbols and numbers, whose columns or entries may have names."""

    _names: tuple[str, ...] | None = None

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _ufunc(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        return _function(function, arguments, options)

    def __getattr__(self, name: str) -> Any:
        if self._names and name in self._names:
            return self[self._names.index(name)]
        known = f"; its names are {', '.join(self._names)}" if self._names else ""
        raise AttributeError(f"an array of symbols has no attribute {name!r}{known}")

    def __bool__(self) -> bool:
        if self.size == 1:
            return bool(self.reshape(-1)[0])
        raise refusal(_NO_TRUTH)

    def __getitem__(self, key: Any) -> Any:
        _check_index(key)
        return super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        _check_index(key)
        super().__setitem__(key, value)

    def astype(self, dtype: Any, *_: Any, **__: Any) -> Any:
        """The array itself for dtypes that hold numbers as they are."""
        if np.dtype(dtype) in (np.dtype(float), np.dtype(object)):
            return self
        raise refusal(f"symbols are float64 and cannot become {np.dtype(dtype)}")


def _check_index(key: Any) -> None:
    """Refuses symbols as indices, conditions among them."""
    for part in key if isinstance(key, tuple) else (key,):
        if isinstance(part, Symbol) or (isinstance(part, np.ndarray) and part.dtype == object):
            raise refusal(
                "symbols cannot be indices; write np.where(condition, a, b) to choose by a condition"
            )


def named(array: SymbolArray, names: tuple[str, ...]) -> SymbolArray:
    """The array with names for its entries."""
    array._names = names
    return array


def expression(graph: ExpressionGraph, value: Any) -> int:
    """The number in the graph of a symbol or of a number."""
    if isinstance(value, Symbol):
        if value.graph is not graph:
            raise refusal("symbols of two traced functions meet; pass what is needed as an input")
        return value.number
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return expression(graph, value[()])
    try:
        return graph.constant(float(value))
    except (TypeError, ValueError) as error:
        raise refusal(f"an entry must be a real number, found {type(value).__name__}") from error


def wrapped(array: Any) -> Any:
    """An array of objects as one of symbols, and an entry of its own as it is."""
    if isinstance(array, np.ndarray) and array.dtype == object:
        return array[()] if array.ndim == 0 else array.view(SymbolArray)
    return array


def objects(value: Any) -> np.ndarray[Any, Any]:
    """Symbols and numbers as an ordinary array of objects."""
    return np.asarray(value, dtype=object).view(np.ndarray)


def _graph_of(values: Iterable[Any]) -> ExpressionGraph | None:
    return next((value.graph for value in values if isinstance(value, Symbol)), None)


# What each ufunc is: operations of the graph, whose names are NumPy's, and formulas of them.
_DIRECT = frozenset(ExpressionGraph.OPERATIONS) - {"where"}
_RENAMED = {
    "fabs": "absolute",
    "true_divide": "divide",
    "float_power": "power",
    "bitwise_and": "logical_and",
    "bitwise_or": "logical_or",
    "invert": "logical_not",
    "bitwise_invert": "logical_not",
}
_FORMULAS: dict[str, Callable[..., Any]] = {
    "positive": lambda x: x,
    "conjugate": lambda x: x,
    "square": lambda x: x * x,
    "reciprocal": lambda x: 1.0 / x,
    "exp2": lambda x: np.exp(math.log(2.0) * x),
    "log2": lambda x: np.log(x) / math.log(2.0),
    "log10": lambda x: np.log(x) / math.log(10.0),
    "radians": lambda x: (math.pi / 180.0) * x,
    "deg2rad": lambda x: (math.pi / 180.0) * x,
    "degrees": lambda x: (180.0 / math.pi) * x,
    "rad2deg": lambda x: (180.0 / math.pi) * x,
    "greater": lambda x, y: np.less(y, x),
    "greater_equal": lambda x, y: np.less_equal(y, x),
    "floor_divide": lambda x, y: np.floor(x / y),
    "remainder": lambda x, y: x - y * np.floor(x / y),
    "clip": lambda x, low, high: np.minimum(np.maximum(x, low), high),
    "trunc": lambda x: np.where(x < 0, np.ceil(x), np.floor(x)),
    "heaviside": lambda x, at_zero: np.where(x < 0, 0.0, np.where(x > 0, 1.0, at_zero)),
    "logaddexp": lambda x, y: np.maximum(x, y) + np.log1p(np.exp(-np.abs(x - y))),
    "logical_xor": lambda x, y: np.not_equal(np.logical_not(x), np.logical_not(y)),
    "isnan": lambda x: np.not_equal(x, x),
}


def _scalar(ufunc: np.ufunc, values: Sequence[Any]) -> Any:
    """The ufunc of symbols and numbers."""
    graph = _graph_of(values)
    if graph is None:
        return ufunc(*values)
    name = _RENAMED.get(ufunc.__name__, ufunc.__name__)
    if name in _FORMULAS:
        return _FORMULAS[name](*values)
    if all(set(types) <= set("O->") for types in ufunc.types):
        # a function of Python's, as np.vectorize makes them
        return ufunc(*(objects(value) for value in values))
    if name not in _DIRECT:
        raise refusal(f"np.{ufunc.__name__} cannot be traced: it has no derivative here")
    return Symbol(graph, graph.apply(name, [expression(graph, value) for value in values]))


def _elementwise(ufunc: np.ufunc, inputs: Sequence[Any]) -> Any:
    if not any(isinstance(value, np.ndarray | list | tuple) for value in inputs):
        return _scalar(ufunc, inputs)
    arrays = np.broadcast_arrays(*(objects(value) for value in inputs))
    found = np.empty(arrays[0].shape, dtype=object)
    for index in np.ndindex(found.shape):
        found[index] = _scalar(ufunc, [array[index] for array in arrays])
    return wrapped(found)


def _into(out: tuple[Any, ...], found: Any) -> Any:
    if len(out) != 1 or not isinstance(out[0], np.ndarray) or out[0].dtype != object:
        raise refusal("an array of numbers cannot hold symbols; write a = a + b in place of a += b")
    out[0][...] = found
    return out[0]


def _ufunc(ufunc: np.ufunc, method: str, inputs: Sequence[Any], options: dict[str, Any]) -> Any:
    """What NumPy calls for a ufunc that has symbols among its arguments."""
    out = options.pop("out", None)
    if options.get("where", True) is not True:
        raise refusal(f"np.{ufunc.__name__} cannot be traced with the argument `where`; use np.where")
    if ufunc is np.matmul or ufunc.__name__ in ("vecdot", "matvec", "vecmat"):
        found = wrapped(np.asarray(ufunc(*(objects(value) for value in inputs))))
    elif method == "__call__":
        found = _elementwise(ufunc, inputs)
    elif method == "reduce":
        found = _reduced(ufunc, inputs[0], options)
    elif method == "accumulate":
        found = _accumulated(ufunc, inputs[0], options.get("axis", 0))
    elif method == "outer":
        first, second = (objects(value) for value in inputs)
        found = _elementwise(ufunc, [first.reshape(first.shape + (1,) * second.ndim), second])
    else:
        raise refusal(f"np.{ufunc.__name__}.{method} cannot be traced")
    return found if out is None else _into(out, found)


def _reduced(ufunc: np.ufunc, given: Any, options: dict[str, Any]) -> Any:
    array = objects(given)
    axis = options.get("axis", 0)
    every = tuple(range(array.ndim))
    try:
        axes = every if axis is None else tuple(every[k] for k in np.atleast_1d(axis))
    except IndexError:
        raise refusal(f"an array of shape {array.shape} has no axis {axis}") from None
    kept = tuple(k for k in every if k not in axes)
    shape = tuple(array.shape[k] for k in kept)
    length = math.prod(array.shape[k] for k in axes)
    columns = np.transpose(array, (*axes, *kept)).reshape((length, *shape))
    parts = list(columns)
    if (start := options.get("initial")) not in (None, np._NoValue):
        parts.insert(0, np.full(shape, start, dtype=object))
    if not parts:
        if ufunc.identity is None:
            raise refusal(f"np.{ufunc.__name__}.reduce has no value for an array without entries")
        parts = [np.full(shape, ufunc.identity, dtype=object)]
    combine = functools.partial(_pair, ufunc)
    found = wrapped(np.asarray(functools.reduce(combine, parts), dtype=object))
    if options.get("keepdims"):
        whole = tuple(1 if k in axes else n for k, n in enumerate(array.shape))
        return wrapped(objects(found).reshape(whole))
    return found


def _pair(ufunc: np.ufunc, first: Any, second: Any) -> Any:
    return _elementwise(ufunc, [first, second])


def _accumulated(ufunc: np.ufunc, given: Any, axis: int) -> Any:
    parts = list(np.moveaxis(objects(given), axis, 0))
    for k in range(1, len(parts)):
        parts[k] = objects(_elementwise(ufunc, [parts[k - 1], parts[k]]))
    return wrapped(np.moveaxis(np.array(parts, dtype=object), 0, axis)) if parts else wrapped(objects(given))


def _where(condition: Any, *branches: Any) -> Any:
    if len(branches) != 2:
        raise refusal("np.where needs the values of both branches: np.where(condition, a, b)")
    arrays = np.broadcast_arrays(objects(condition), *(objects(branch) for branch in branches))
    found = np.empty(arrays[0].shape, dtype=object)
    for index in np.ndindex(found.shape):
        test, *values = (array[index] for array in arrays)
        if isinstance(test, Symbol):
            numbers = [expression(test.graph, value) for value in (test, *values)]
            found[index] = Symbol(test.graph, test.graph.apply("where", numbers))
        else:
            found[index] = values[0] if test else values[1]
    return wrapped(found)


def _select(conditions: Sequence[Any], choices: Sequence[Any], default: Any = 0) -> Any:
    found = default
    for condition, choice in zip(reversed(conditions), reversed(choices), strict=True):
        found = _where(condition, choice, found)
    return found


def _determinant(a: Any) -> Any:
    """Along the first row."""
    matrix = objects(a)
    n = len(matrix)
    if matrix.shape != (n, n) or n > 4:
        raise refusal(f"np.linalg.det of symbols has matrices to 4 × 4, found shape {matrix.shape}")
    if n == 0:
        return 1.0
    minors = (_determinant(np.delete(matrix[1:], k, axis=1)) for k in range(n))
    return sum((-1) ** k * matrix[0, k] * minor for k, minor in enumerate(minors))


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    array = wrapped(objects(x))
    flat = array.reshape(-1) if axis is None else array
    if ord not in (None, 2, "fro") and isinstance(axis, tuple) and len(axis) > 1:
        raise refusal("np.linalg.norm of symbols is that of vectors, or the Frobenius norm of matrices")
    if axis is None:
        if keepdims or (ord not in (None, 2, "fro") and array.ndim != 1) or (ord == 2 and array.ndim != 1):
            raise refusal("np.linalg.norm of symbols is that of vectors, or the Frobenius norm of matrices")
        axis = 0
    if ord in (None, 2, "fro"):
        return np.sqrt(np.sum(flat * flat, axis=axis, keepdims=keepdims))
    if ord == 1:
        return np.sum(np.abs(flat), axis=axis, keepdims=keepdims)
    if ord in (np.inf, float("inf")):
        return np.max(np.abs(flat), axis=axis, keepdims=keepdims)
    raise refusal(f"np.linalg.norm of symbols has the orders 1, 2 and inf, found {ord!r}")


def _clip(x: Any, a_min: Any = None, a_max: Any = None, **options: Any) -> Any:
    low, high = options.get("min", a_min), options.get("max", a_max)
    found = x if low is None else np.maximum(x, low)
    return found if high is None else np.minimum(found, high)


def _solve(a: Any, b: Any) -> Any:
    """The solution by Gram and Schmidt's orthogonal factorisation (modified), which needs no pivots."""
    columns, right = [wrapped(column) for column in objects(a).T], wrapped(objects(b))
    n = len(columns)
    if objects(a).shape != (n, n) or len(right) != n:
        raise refusal(f"np.linalg.solve needs a square matrix and as many rows, found {objects(a).shape}")
    factors: dict[tuple[int, int], Any] = {}
    for k in range(n):
        factors[k, k] = np.sqrt(np.sum(columns[k] * columns[k]))
        columns[k] = columns[k] / factors[k, k]
        for j in range(k + 1, n):
            factors[k, j] = np.sum(columns[k] * columns[j])
            columns[j] = columns[j] - factors[k, j] * columns[k]
    found: list[Any] = [column @ right for column in columns]
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            found[k] = found[k] - factors[k, j] * found[j]
        found[k] = found[k] / factors[k, k]
    return np.stack(found)


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _where,
    np.select: _select,
    np.linalg.norm: _norm,
    np.linalg.det: _determinant,
    np.linalg.solve: _solve,
    np.linalg.inv: lambda a: _solve(a, np.eye(len(a))),
    np.clip: _clip,
    np.real: lambda x: x,
    np.copy: lambda x, *_, **__: wrapped(objects(x).copy()),
    np.shape: lambda x: objects(x).shape,
    np.ndim: lambda x: objects(x).ndim,
    np.size: lambda x, axis=None: objects(x).size if axis is None else objects(x).shape[axis],
}


def _as_array(value: Any) -> Any:
    """Symbols in arguments as arrays, which NumPy's own code takes."""
    if isinstance(value, Symbol):
        return objects(value).view(SymbolArray)
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return type(value)(map(_as_array, value))
    return value


def _function(function: Any, arguments: Sequence[Any], options: dict[str, Any]) -> Any:
    """What NumPy calls for a function that has symbols among its arguments."""
    if function in _FUNCTIONS:
        return _FUNCTIONS[function](*arguments, **options)
    name = f"{getattr(function, '__module__', 'np').replace('numpy', 'np', 1)}.{function.__name__}"
    try:
        own = tuple(_as_array(argument) for argument in arguments)
        inner = {key: _as_array(option) for key, option in options.items()}
        token = objects(0.0).view(SymbolArray)
        found = np.ndarray.__array_function__(token, function, (SymbolArray,), own, inner)
    except TraceError as error:
        known = name in error.reason
        raise error if known else refusal(f"{name} cannot be traced: {error.reason}") from None
    # whatever its code for arrays of numbers raises when it meets symbols
    except (TypeError, ValueError, AttributeError, NotImplementedError) as error:
        raise refusal(f"{name} cannot be traced: {error}") from error
    if isinstance(found, list | tuple):
        return type(found)(map(wrapped, found)) if not hasattr(found, "_fields") else found
    return wrapped(found)


def _method(name: str) -> Callable[..., Any]:
    ufunc = getattr(np, name)

    def call(self: Symbol, *others: Any) -> Any:
        return _elementwise(ufunc, [self, *others])

    return call


# What NumPy calls of the elements of an ordinary array of objects.
for _name in sorted(_DIRECT | set(_FORMULAS) - {"clip"}):
    setattr(Symbol, _name, _method(_name))


def stacked(value: Any) -> np.ndarray[Any, Any]:
    """What a function returned, as an array of objects."""
    if isinstance(value, dict | set | str | bytes) or value is None:
        raise InputError(f"`f` must return numbers or arrays of them, found {type(value).__name__}")
    try:
        return objects(value)
    except ValueError as error:
        raise InputError(f"`f` must return numbers, an array or a tuple of equal shapes: {error}") from error
