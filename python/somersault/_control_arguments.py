"""Arguments of optimal control problems: names, bounds, functions that are traced."""

from __future__ import annotations

import inspect
import keyword
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault import expr
from somersault._arguments import _real_numbers
from somersault._external import ExternalFunction
from somersault._somersault.expr import CompiledFunction
from somersault._somersault.ocp import CollocationResult
from somersault.errors import InputError, TraceError

#: A number, bounds, or None for what is free.
_Range: TypeAlias = "float | tuple[float | None, float | None] | None"
#: A function with its lower and upper bounds.
_Constraint: TypeAlias = "tuple[Callable[..., Any], Any, Any]"
_Floats: TypeAlias = NDArray[np.float64]
_Guess: TypeAlias = "CollocationResult | Mapping[str, ArrayLike]"
#: What states are at an end.
_Entries: TypeAlias = "Mapping[str, _Range] | Sequence[_Range] | None"

_FREE = (-math.inf, math.inf)


class _Names:
    """Names of states, controls and parameters, and what is traced with them."""

    def __init__(
        self,
        states: Sequence[str] | int | None,
        controls: Sequence[str] | int | None,
        parameters: Sequence[str] | int,
    ) -> None:
        self.states = _names("states", states, "x")
        self.controls = _names("controls", () if controls is None else controls, "u")
        self.parameters = _names("parameters", parameters, "p")
        if not self.states:
            raise InputError("`states` must have at least one name, found none")
        all_names = [*self.states, *self.controls, *self.parameters]
        for name in all_names:
            if all_names.count(name) > 1 or name == "t":
                raise InputError(
                    "`states`, `controls` and `parameters` must have names of their own, none of them 't',"
                    f" found {name!r}{'' if name == 't' else ' twice'}"
                )

    def ranges(
        self,
        argument: str,
        entries: Mapping[str, _Range] | None,
        known: list[list[tuple[float, float]]] | None = None,
    ) -> list[list[tuple[float, float]]]:
        """Bounds of states, controls and parameters by name; others are free, or as known."""
        parts = [self.states, self.controls, self.parameters]
        found = _by_name(argument, [name for part in parts for name in part], entries)
        known = known or [[_FREE] * len(part) for part in parts]
        return [
            [found.get(name, pair) for name, pair in zip(part, pairs, strict=True)]
            for part, pairs in zip(parts, known, strict=True)
        ]

    def states_of(
        self, argument: str, entries: _Entries, known: list[tuple[float, float]] | None = None
    ) -> list[tuple[float, float]]:
        """What each state may be at an end; those that are not named are free, or as known."""
        if entries is None or isinstance(entries, Mapping):
            found = _by_name(argument, self.states, entries)
            known = known or [_FREE] * len(self.states)
            return [found.get(name, pair) for name, pair in zip(self.states, known, strict=True)]
        if isinstance(entries, str) or not isinstance(entries, Iterable):
            raise InputError(
                f"`{argument}` must be values by name or in order, found {_article(type(entries).__name__)}"
            )
        listed = list(entries)
        if len(listed) != len(self.states):
            raise InputError(f"`{argument}` must have {len(self.states)} entries, found {len(listed)}")
        return [_range(f"{argument}[{k}]", entry) for k, entry in enumerate(listed)]

    def scales(
        self, scales: Mapping[str, float] | None, n_integrals: int
    ) -> tuple[list[float], list[float]] | None:
        """Sizes of states, integrals and controls."""
        if scales is None:
            return None
        parts = [*self.states, *self.controls]
        if not isinstance(scales, Mapping):
            raise InputError(f"`scales` must be sizes by name, found {_article(type(scales).__name__)}")
        for name, value in scales.items():
            if name not in parts:
                raise InputError(f"`scales` must have names among {', '.join(parts)}, found {name!r}")
            _positive(f"scales[{name!r}]", (_number(f"scales[{name!r}]", value),) * 2)
        missing = [name for name in parts if name not in scales]
        if missing:
            raise InputError(f"`scales` must have a size of {', '.join(missing)}")
        states = [float(scales[name]) for name in self.states]
        return [*states, *[1.0] * n_integrals], [float(scales[name]) for name in self.controls]

    def functions(
        self,
        dynamics: Callable[..., Any] | None,
        costs: tuple[Callable[..., Any] | None, Callable[..., Any] | None],
        path: list[_Constrained],
        ends: list[_Constrained],
        integrals: list[_Constrained],
    ) -> list[Any]:
        """f with the integrands; L with path constraints; Φ with end constraints.

        Inputs are in the order of collocation. A tree has its own f.
        """
        rates = None if dynamics is None else _called("dynamics", dynamics, _ALONG)
        running, final = (
            _called("running_cost", costs[0], _ALONG),
            _called("end_cost", costs[1], ("x", "t", "p")),
        )

        def moving(x: Any, z: Any, u: Any, p: Any, t: Any) -> list[Any]:
            found = [] if rates is None else _flat("dynamics", rates(x, u, t, p))
            if rates is not None and len(found) != len(self.states):
                raise InputError(f"`dynamics` must give {len(self.states)} rates, found {len(found)}")
            return [*found, *(value for each in integrals for value in each.values(x, u, t, p))]

        def along(x: Any, z: Any, u: Any, p: Any, t: Any) -> list[Any]:
            return [
                _one("running_cost", running(x, u, t, p)),
                *(v for each in path for v in each.values(x, u, t, p)),
            ]

        def at_ends(x: Any, z: Any, last: Any, z_last: Any, p: Any, start: Any, end: Any) -> list[Any]:
            cost = _one("end_cost", final(last, end, p))
            return [cost, *(value for each in ends for value in each.values(x, last, start, end, p))]

        if isinstance(dynamics, ExternalFunction):
            rates = _called("dynamics", dynamics._with_shape((len(self.states),)), _ALONG)
        n = len(integrals)
        # an empty tuple is a single number, and no names are a length of zero
        x, u, p = (tuple(part) or 0 for part in (self.states, self.controls, self.parameters))
        at_time: dict[str, Any] = {"x": x, "z": n, "u": u, "p": p, "t": ()}
        both: dict[str, Any] = {"x": x, "z": n, "last": x, "z_last": n, "p": p, "start": (), "end": ()}
        own = {"x": self.states, "u": self.controls, "p": self.parameters, "t": ["t"]}
        of_first, of_last = ([f"{end} {name}" for name in self.states] for end in ("initial", "final"))
        ends_of = {"x": of_first, "last": of_last, "p": self.parameters, "start": ["t_0"], "end": ["t_f"]}
        of_rates = [] if rates is None else [f"rate of {name}" for name in self.states]
        return [
            _trace(moving, at_time, own, lambda: [*of_rates, *(each.name for each in integrals)]),
            _trace(along, at_time, own, lambda: ["running_cost", *_value_names(path)]),
            _trace(at_ends, both, ends_of, lambda: ["end_cost", *_value_names(ends)]),
        ]


#: What functions of a time take.
_ALONG = ("x", "u", "t", "p")


class _Constrained:
    """A function with bounds, whose number of values is known once it was traced."""

    def __init__(self, argument: str, number: int, entry: Any) -> None:
        self.name = f"{argument}[{number}]"
        if not isinstance(entry, tuple | list) or len(entry) != 3:
            raise InputError(
                f"`{self.name}` must be (function, lower, upper), found {_article(type(entry).__name__)}"
            )
        function, self.lower, self.upper = entry
        self.is_integral = argument == "integrals"
        names = ("x_0", "x_f", "t_0", "t_f", "p") if argument == "ends" else _ALONG
        self.call = _called(self.name, function, names)
        self.n_values = 0

    def values(self, *arguments: Any) -> list[Any]:
        """What it gives, one after the other."""
        found = self.call(*arguments)
        values = [_one(self.name, found)] if self.is_integral else _flat(self.name, found)
        self.n_values = len(values)
        return values

    def pairs(self) -> list[tuple[float, float]]:
        """Bounds of each value."""
        lower, upper = (
            self._side(*each) for each in (("lower", self.lower, -math.inf), ("upper", self.upper, math.inf))
        )
        for low, high in zip(lower, upper, strict=True):
            if low > high:
                raise InputError(f"`{self.name}` must have bounds that do not cross, found ({low}, {high})")
        return list(zip(lower, upper, strict=True))

    def _side(self, side: str, limit: Any, default: float) -> list[float]:
        limits = _values(f"{self.name}, {side}", default if limit is None else limit)
        if limits.ndim and len(limits) != self.n_values:
            raise InputError(f"`{self.name}` must have {self.n_values} {side} bounds, found {len(limits)}")
        return [float(limit) for limit in np.broadcast_to(limits, self.n_values)]


def _trace(
    function: Callable[..., Any],
    blocks: Mapping[str, Any],
    inputs: Mapping[str, Sequence[str]],
    outputs: Callable[[], Sequence[str]],
) -> tuple[Any, list[Any]]:
    """The traced function and its calls of functions that are not; names are for messages."""
    calls: list[Any] = []
    try:
        graph, own, numbers, shapes, _ = expr._recorded(function, blocks, calls)
    except TraceError as error:
        error.args = (f"{error}; a function that cannot be traced may be given as an ocp.ExternalFunction",)
        raise
    if not calls:
        return CompiledFunction(graph, own, numbers), []
    # inputs of a graph are numbered first
    names: dict[int, str] = {}
    first = 0
    for block, shape in shapes.items():
        names |= dict(zip(range(first, first + math.prod(shape)), inputs.get(block, ()), strict=False))
        first += math.prod(shape)
    all_blocks = [*own, ("returned", [sum(len(call.returned) for call in calls)])]
    values = dict(zip(numbers, outputs(), strict=True))
    return (
        CompiledFunction(graph, all_blocks, numbers),
        [call.compiled(graph, all_blocks, names, values) for call in calls],
    )


def _value_names(constraints: Iterable[_Constrained]) -> list[str]:
    """Names of the values of constraints."""
    return [
        each.name if each.n_values == 1 else f"{each.name}, value {k}"
        for each in constraints
        for k in range(each.n_values)
    ]


def _called(argument: str, function: Any, names: Sequence[str]) -> Callable[..., Any]:
    """The function with as many arguments as it takes; without a function there is nothing, 0."""
    if function is None:
        return lambda *_: 0.0
    if not callable(function):
        raise InputError(
            f"`{argument}` must be a function of ({', '.join(names)}), found"
            f" {_article(type(function).__name__)}"
        )
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    try:
        parameters = list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):
        return cast("Callable[..., Any]", function)
    if any(each.kind is inspect.Parameter.VAR_POSITIONAL for each in parameters):
        return cast("Callable[..., Any]", function)
    positional = [each for each in parameters if each.kind in kinds]
    required = sum(each.default is inspect.Parameter.empty for each in positional)
    # a default of another name is the user's own, as in `lambda x, u, k=k: ...`
    n = required
    while n < min(len(positional), len(names)) and positional[n].name == names[n]:
        n += 1
    if required > len(names):
        raise InputError(
            f"`{argument}` must take ({', '.join(names)}) or fewer of them, found {required} arguments"
        )
    return lambda *arguments: function(*arguments[:n])


def _as_many(argument: str, given: Sequence[str] | int | None, own: list[str]) -> Sequence[str]:
    """Names that replace those of a tree."""
    if given is None:
        return own
    found = _names(argument, given, {"states": "x", "controls": "u"}[argument])
    if len(found) != len(own):
        raise InputError(f"`{argument}` must have {len(own)} names for the tree, found {len(found)}")
    return found


def _flat(argument: str, found: Any) -> list[Any]:
    """Values one after the other."""
    if found is None:
        raise InputError(f"`{argument}` must return its values, found None")
    values = list(np.ravel(np.asarray(found, dtype=object)))
    for value in values:
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"`{argument}` must return finite values, found {value}")
    return values


def _one(argument: str, found: Any) -> Any:
    values = _flat(argument, found)
    if len(values) != 1:
        raise InputError(f"`{argument}` must return one value, found {len(values)}")
    return values[0]


def _names(argument: str, given: Sequence[str] | int | None, prefix: str) -> list[str]:
    if isinstance(given, int) and not isinstance(given, bool):
        if not 0 <= given <= _MOST_NAMES:
            raise InputError(f"`{argument}` must be names or a number up to {_MOST_NAMES}, found {given}")
        return [f"{prefix}{k}" for k in range(given)]
    if isinstance(given, str) or not isinstance(given, Iterable):
        what = "a sequence of names or a number"
        raise InputError(f"`{argument}` must be {what} where `dynamics` is a function, found {given!r}")
    names = list(given)
    for name in names:
        if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
            raise InputError(f"`{argument}` must be names as those of variables, found {name!r}")
    return names


#: States of the largest problem, far beyond what a mesh has room for.
_MOST_NAMES = 10_000


def _entries(argument: str, given: Any) -> list[Any]:
    if isinstance(given, str | Mapping) or not isinstance(given, Iterable):
        raise InputError(
            f"`{argument}` must be a sequence of (function, lower, upper), found"
            f" {_article(type(given).__name__)}"
        )
    entries = list(given)
    # one constraint without its brackets is a frequent slip
    return (
        [tuple(entries)]
        if len(entries) == 3 and callable(entries[0]) and not callable(entries[1])
        else entries
    )


def _by_name(argument: str, names: list[str], entries: Any) -> dict[str, tuple[float, float]]:
    if entries is None:
        return {}
    if not isinstance(entries, Mapping):
        raise InputError(f"`{argument}` must be values by name, found {_article(type(entries).__name__)}")
    for name in entries:
        if name not in names:
            raise InputError(f"`{argument}` must have names among {', '.join(names)}, found {name!r}")
    return {name: _range(f"{argument}[{name!r}]", entry) for name, entry in entries.items()}


def _number(argument: str, given: Any) -> float:
    values = _values(argument, given)
    if values.ndim:
        raise InputError(f"`{argument}` must be a number, found {given!r}")
    if not math.isfinite(float(values)):
        raise InputError(f"`{argument}` must be finite, found {float(values)}")
    return float(values)


def _range(argument: str, given: Any) -> tuple[float, float]:
    """Bounds: None is free, a number is both."""
    if given is None:
        return _FREE
    if isinstance(given, tuple | list) and len(given) == 2:
        low, high = (
            default if each is None else float(_values(argument, each))
            for each, default in zip(given, _FREE, strict=True)
        )
        if not low <= high:
            raise InputError(
                f"`{argument}` must have bounds that do not cross and are no NaN, found ({low}, {high})"
            )
        return low, high
    number = _number(argument, given)
    return number, number


def _positive(argument: str, pair: tuple[float, float]) -> tuple[float, float]:
    # a NaN is not above
    if not (pair[1] > 0.0 and math.inf > pair[0] >= 0.0):
        raise InputError(
            f"`{argument}` must be positive, or a pair of such numbers in their order, found {pair}"
        )
    return pair


def _values(argument: str, given: Any) -> _Floats:
    values = _real_numbers(argument, given)
    if values.ndim > 1:
        raise InputError(f"`{argument}` must be a number or a list of numbers, found shape {values.shape}")
    return values


def _line(
    first: tuple[float, float], last: tuple[float, float], bound: tuple[float, float], at: _Floats
) -> _Floats:
    """From the middle of what is allowed at the start to that at the end; a free end is the other one."""
    first, last = ((max(end[0], bound[0]), min(end[1], bound[1])) for end in (first, last))
    ends = [last if end == _FREE else end for end in (first,)] + [first if last == _FREE else last]
    middle = [
        0.5 * (low + high) if math.isfinite(low + high) else float(np.clip(0.0, low, high))
        for low, high in ends
    ]
    return middle[0] + (middle[1] - middle[0]) * at


def _article(name: str) -> str:
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"
