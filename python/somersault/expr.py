"""Functions of NumPy, traced: exact derivatives of any order, evaluated without the interpreter.

An ordinary Python function is called once with symbols in place of numbers, and what it does to them is
recorded. The record is differentiated exactly and evaluated in Rust, at one point or at many.

>>> import numpy as np
>>> from somersault import expr
>>> def pendulum(x, u):
...     return x.rate, u - 9.81 * np.sin(x.angle)
>>> f = expr.Function(pendulum, x=("angle", "rate"), u=())
>>> f([0.0, 2.0], 1.0)
array([2., 1.])
>>> f.derivative("x")([0.0, 2.0], 1.0)
array([[ 0.  ,  1.  ],
       [-9.81,  0.  ]])
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from somersault._somersault.expr import CompiledFunction, ExpressionGraph
from somersault._symbols import (
    Symbol,
    SymbolArray,
    expression,
    named,
    objects,
    raised,
    recording,
    stacked,
    wrapped,
)
from somersault.errors import InputError, SomersaultError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Function"]

#: The most numbers of all inputs or of the output of a function.
_MOST_NUMBERS = 1 << 22


class Function:
    """A function of named arrays of numbers, with its derivatives.

    Parameters
    ----------
    f : callable
        An ordinary function, which is called once, with a symbol or an array of symbols for each input by its
        name. It may use NumPy, call other functions and have loops, but no branches on values: `np.where`
        stands for those. It returns a number, an array, or a tuple of numbers or of arrays of one shape.
    **inputs : int, tuple of int, or tuple of str
        The shape of each input, in the order of the calls: a length, lengths, ``()`` for a single number, or
        names for the entries of a vector, which are then attributes of it.

    Raises
    ------
    TraceError
        If `f` does something that symbols cannot take part in, or raises, which is then the cause. The
        message has the line of `f`.
    InputError
        If an input has no shape, or `f` does not take it.

    Notes
    -----
    Inputs of a call may have axes in front, which are the points of a batch, and are broadcast against one
    another. Batches are evaluated eight points at a time, long ones on all cores, while other Python threads
    run; Ctrl-C ends them. Sines, cosines, exponentials and logarithms of a batch may differ from those of a
    single point in the last bit, all else is the same.

    Derivatives are those of the formulas as they are written. At kinks they are one of both sides: that of
    `np.abs` is 0 at 0, that of `np.maximum` the one of its first argument where both are equal. Branches of
    `np.where` that are not taken have no part in them.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import expr
    >>> f = expr.Function(lambda x, m: m * x @ x / 2, x=3, m=())
    >>> f
    <Function: x (3,), m () → (), 9 instructions>
    >>> f([1.0, 2.0, 3.0], 2.0)
    14.0
    >>> f(np.ones((5, 3)), np.arange(5.0))
    array([0. , 1.5, 3. , 4.5, 6. ])
    """

    def __init__(self, f: Callable[..., Any], /, **inputs: int | Sequence[int] | Sequence[str]) -> None:
        graph, blocks, numbers, shapes, shape = _recorded(f, inputs)
        self._set(CompiledFunction(graph, blocks, numbers), shapes, shape)

    def _set(
        self, compiled: CompiledFunction, shapes: Mapping[str, tuple[int, ...]], shape: tuple[int, ...]
    ) -> None:
        self._compiled = compiled
        self._shapes = dict(shapes)
        self._shape = shape

    @property
    def inputs(self) -> dict[str, tuple[int, ...]]:
        """The shape of each input."""
        return dict(self._shapes)

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the output."""
        return self._shape

    def __repr__(self) -> str:
        inputs = ", ".join(f"{name} {shape}" for name, shape in self._shapes.items())
        return f"<Function: {inputs} → {self._shape}, {self._compiled.n_instructions} instructions>"

    def __call__(self, *arguments: ArrayLike, **named_arguments: ArrayLike) -> Any:
        """The value: an array of the output's shape behind the axes of the batch, or symbols of symbols."""
        given = self._bound(arguments, named_arguments)
        symbol = _first_symbol(given.values())
        if symbol is not None:
            return self._inserted(symbol.graph, given)
        values = _evaluated(self._compiled.values, self._packed(given))
        found = values.reshape((*values.shape[:-1], *self._shape))
        return float(found) if found.ndim == 0 else found

    def jacobian(self, *arguments: ArrayLike, sparse: bool = False, **named_arguments: ArrayLike) -> Any:
        """The Jacobian matrix of the output by all inputs.

        Parameters
        ----------
        *arguments, **named_arguments : array_like
            The inputs, as in a call.
        sparse : bool
            Whether to return the entries of `jacobian_pattern` alone.

        Returns
        -------
        ndarray, shape (..., outputs, numbers of all inputs) or (..., entries)

        Examples
        --------
        >>> from somersault import expr
        >>> f = expr.Function(lambda x, u: (x[1], u - x[0]), x=2, u=())
        >>> f.jacobian([0.0, 0.0], 0.0)
        array([[ 0.,  1.,  0.],
               [-1.,  0.,  1.]])
        >>> f.jacobian([0.0, 0.0], 0.0, sparse=True)
        array([-1.,  1.,  1.])
        """
        given = self._packed(self._bound(arguments, named_arguments))
        values = _evaluated(self._compiled.jacobian, given)
        if sparse:
            return values
        rows, columns = _places(self._compiled.jacobian_pattern())
        n_rows, n_columns = math.prod(self._shape), self._n_inputs()
        _check_room("the Jacobian matrices", (*values.shape[:-1], n_rows, n_columns))
        dense = np.zeros((*values.shape[:-1], n_rows, n_columns))
        dense[..., rows, columns] = values
        return dense

    def jacobian_pattern(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Where the Jacobian matrix may be other than zero, in compressed columns.

        Returns
        -------
        indptr : ndarray of int
            Where the columns start among the entries, and the end.
        indices : ndarray of int
            The row of each entry.

        Examples
        --------
        >>> from scipy.sparse import csc_array
        >>> from somersault import expr
        >>> f = expr.Function(lambda x: x**2, x=3)
        >>> indptr, indices = f.jacobian_pattern()
        >>> csc_array((f.jacobian([1.0, 2.0, 3.0], sparse=True), indices, indptr), shape=(3, 3)).toarray()
        array([[2., 0., 0.],
               [0., 4., 0.],
               [0., 0., 6.]])
        """
        return self._compiled.jacobian_pattern()

    def hessian(
        self,
        multipliers: ArrayLike,
        *arguments: ArrayLike,
        sparse: bool = False,
        **named_arguments: ArrayLike,
    ) -> Any:
        """The Hessian matrix, by all inputs, of the output's entries times `multipliers`, summed.

        Parameters
        ----------
        multipliers : array_like, shape of the output
            What the entries of the output are multiplied by.
        *arguments, **named_arguments : array_like
            The inputs, as in a call.
        sparse : bool
            Whether to return the entries of `hessian_pattern`, of the lower triangle, alone.

        Returns
        -------
        ndarray, shape (..., numbers of all inputs, numbers of all inputs) or (..., entries)

        Examples
        --------
        >>> from somersault import expr
        >>> f = expr.Function(lambda x: (x[0] ** 2, x[0] * x[1]), x=2)
        >>> f.hessian([1.0, 10.0], [0.0, 0.0])
        array([[ 2., 10.],
               [10.,  0.]])
        """
        given = self._bound(arguments, named_arguments)
        given[""] = multipliers
        packed = self._packed(given, {**self._shapes, "": self._shape})
        values = _evaluated(self._compiled.hessian, packed)
        if sparse:
            return values
        rows, columns = _places(self._compiled.hessian_pattern())
        n = self._n_inputs()
        _check_room("the Hessian matrices", (*values.shape[:-1], n, n))
        dense = np.zeros((*values.shape[:-1], n, n))
        dense[..., rows, columns] = values
        dense[..., columns, rows] = values
        return dense

    def hessian_pattern(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Where the lower triangle of the Hessian matrix may be other than zero, in compressed columns.

        Returns
        -------
        indptr : ndarray of int
            Where the columns start among the entries, and the end.
        indices : ndarray of int
            The row of each entry.

        Examples
        --------
        >>> from somersault import expr
        >>> expr.Function(lambda x: x[0] * x[1], x=3).hessian_pattern()
        (array([0, 1, 1, 1]), array([1]))
        """
        return self._compiled.hessian_pattern()

    def derivative(self, by: str) -> Function:
        """The derivative by an input, a function of the same inputs.

        Parameters
        ----------
        by : str
            The name of the input.

        Returns
        -------
        Function
            Its output has the axes of this one's, then those of the input.

        Examples
        --------
        >>> from somersault import expr
        >>> cube = expr.Function(lambda x: x**3, x=())
        >>> second = cube.derivative("x").derivative("x")
        >>> second(2.0), expr.Function(lambda x: second(x) - 6 * x, x=())(5.0)
        (12.0, 0.0)
        """
        derivative = Function.__new__(Function)
        if by not in self._shapes:
            raise InputError(f"`by` must be one of {', '.join(self._shapes)}, found {by!r}")
        derivative._set(self._compiled.derivative(by), self._shapes, (*self._shape, *self._shapes[by]))
        return derivative

    def _n_inputs(self) -> int:
        return sum(map(math.prod, self._shapes.values()))

    def _bound(self, arguments: Sequence[Any], named_arguments: Mapping[str, Any]) -> dict[str, Any]:
        names = list(self._shapes)
        if len(arguments) == len(names) and not named_arguments:
            return dict(zip(names, arguments, strict=True))
        given = dict(zip(names, arguments, strict=False))
        unknown = [name for name in named_arguments if name not in self._shapes]
        twice = [name for name in named_arguments if name in given]
        given.update(named_arguments)
        missing = [name for name in names if name not in given]
        problem = ""
        if len(arguments) > len(names):
            problem = f"{len(arguments)} values"
        elif unknown or twice:
            problem = f"`{unknown[0]}`" if unknown else f"two of `{twice[0]}`"
        elif missing:
            problem = f"no `{missing[0]}`"
        if problem:
            raise InputError(f"the inputs are {', '.join(names) or 'none'}, found {problem}")
        return {name: given[name] for name in names}

    def _packed(self, given: Mapping[str, Any], shapes: Mapping[str, tuple[int, ...]] | None = None) -> Any:
        """The numbers of all inputs, one point or several."""
        shapes = shapes or self._shapes
        arrays, fronts = [], []
        for name, value in given.items():
            shape, array = shapes[name], _numbers(name or "multipliers", value)
            front = array.shape[: array.ndim - len(shape)]
            if array.ndim < len(shape) or array.shape[array.ndim - len(shape) :] != shape:
                expected = f"(..., {str(shape)[1:-1].rstrip(',')})" if shape else "(...)"
                raise InputError(f"`{name or 'multipliers'}` must have shape {expected}, found {array.shape}")
            arrays.append(array.reshape((*front, math.prod(shape))))
            fronts.append(front)
        if not any(fronts):
            return np.concatenate([array.reshape(-1) for array in arrays]) if arrays else np.zeros(0)
        try:
            front = np.broadcast_shapes(*fronts)
        except ValueError:
            found = ", ".join(map(str, fronts))
            raise InputError(f"axes of a batch must broadcast against each other, found {found}") from None
        size = sum(array.shape[-1] for array in arrays)
        _check_room("the numbers of the batch", (*front, size))
        packed = np.empty((*front, size))
        end = 0
        for array in arrays:
            start, end = end, end + array.shape[-1]
            packed[..., start:end] = array
        return packed

    def _inserted(self, graph: ExpressionGraph, given: Mapping[str, Any]) -> Any:
        numbers: list[int] = []
        for name, value in given.items():
            array = objects(value)
            if array.shape != self._shapes[name]:
                raise InputError(f"`{name}` must have shape {self._shapes[name]}, found {array.shape}")
            numbers += [expression(graph, entry) for entry in array.reshape(-1)]
        outputs = self._compiled.insert_into(graph, numbers)
        found = np.empty(len(outputs), dtype=object)
        found[:] = [Symbol(graph, number) for number in outputs]
        return wrapped(found.reshape(self._shape))


def _recorded(
    f: Callable[..., Any], inputs: Mapping[str, Any], calls: list[Any] | None = None
) -> tuple[
    ExpressionGraph, list[tuple[str, list[int]]], list[int], dict[str, tuple[int, ...]], tuple[int, ...]
]:
    """What a function does to symbols: graph, blocks of inputs, expressions of the outputs, shapes of both.

    Calls of functions that are not traced are added to `calls`, with inputs that stand for what they return.
    """
    if not callable(f):
        raise InputError(f"`f` must be a function, found {type(f).__name__}")
    shapes = {name: _shape(name, given) for name, given in inputs.items()}
    names = {name: _names(name, given) for name, given in inputs.items()}
    if sum(map(math.prod, shapes.values())) > _MOST_NUMBERS:
        raise InputError(f"the inputs must have at most {_MOST_NUMBERS} numbers together")
    graph = ExpressionGraph()
    symbols = {}
    for name, shape in shapes.items():
        array = np.empty(math.prod(shape), dtype=object)
        array[:] = [Symbol(graph, graph.input()) for _ in array]
        symbols[name] = wrapped(array.reshape(shape))
        if names[name]:
            symbols[name] = named(symbols[name], names[name])
    _check_signature(f, symbols)
    try:
        with recording(graph, calls):
            returned = f(**symbols)
    except SomersaultError:
        raise
    except Exception as error:
        raise raised(error) from error
    found = stacked(returned)
    if found.size > _MOST_NUMBERS:
        raise InputError(f"`f` must return at most {_MOST_NUMBERS} numbers, found {found.size}")
    numbers = [expression(graph, value) for value in found.reshape(-1)]
    return graph, [(name, list(shape)) for name, shape in shapes.items()], numbers, shapes, found.shape


def _places(pattern: tuple[NDArray[np.int64], NDArray[np.int64]]) -> tuple[Any, Any]:
    """Rows and columns of the entries of a pattern."""
    starts, rows = pattern
    return rows, np.repeat(np.arange(len(starts) - 1), np.diff(starts))


def _shape(name: str, given: Any) -> tuple[int, ...]:
    if isinstance(given, bool | str | bytes) or not isinstance(given, int | np.integer | Sequence):
        raise InputError(f"`{name}` must be a length, a shape or names, found {given!r}")
    if isinstance(given, int | np.integer):
        given = (given,)
    if given and all(isinstance(entry, str) for entry in given):
        return (len(given),)
    if not all(isinstance(entry, int | np.integer) and entry >= 0 for entry in given):
        raise InputError(f"`{name}` must be a length, a shape or names, found {given!r}")
    return tuple(map(int, given))


def _names(name: str, given: Any) -> tuple[str, ...]:
    if not isinstance(given, Sequence) or not given or not isinstance(given[0], str):
        return ()
    names = tuple(given)
    for entry in names:
        if not entry.isidentifier() or names.count(entry) > 1:
            raise InputError(f"the names of `{name}` must be different identifiers, found {entry!r}")
        if hasattr(SymbolArray, entry):
            raise InputError(f"no entry of `{name}` can be called {entry!r}, which is an attribute of arrays")
    return names


def _check_signature(f: Callable[..., Any], symbols: Mapping[str, Any]) -> None:
    try:
        signature = inspect.signature(f)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(**symbols)
    except TypeError as error:
        raise InputError(
            f"`f` takes {signature}, the inputs are {', '.join(symbols) or 'none'}: {error}"
        ) from None


def _first_symbol(values: Any) -> Symbol | None:
    for value in values:
        if isinstance(value, Symbol):
            return value
        if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
            found = _first_symbol(value if not isinstance(value, np.ndarray) else value.reshape(-1))
            if found is not None:
                return found
    return None


def _numbers(name: str, value: Any) -> NDArray[np.float64]:
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise InputError(
            f"`{name}` must be real numbers, found {type(value).__name__} of dtype {array.dtype}"
        )
    return array.astype(np.float64, copy=False)


def _check_room(what: str, shape: tuple[int, ...]) -> None:
    """Refuses arrays that NumPy cannot have."""
    if math.prod(shape) > 1 << 40:
        raise InputError(f"{what} would have the shape {shape}, which is more than memory holds")


def _evaluated(evaluate: Callable[[Any], NDArray[np.float64]], packed: NDArray[np.float64]) -> Any:
    """Results behind the axes of the batch."""
    rows = packed if packed.ndim == 1 else packed.reshape((-1, packed.shape[-1]))
    values = evaluate(rows)
    return values.reshape((*packed.shape[:-1], values.shape[-1]))
