"""The answers of the exam: `python tests/python/exam_answers.py` rewrites those that the package holds.

The equations of a scene are recorded once with symbols, and their Taylor series evaluated in whole numbers
with a fixed point, in steps whose last term is below the rounding. Where a guard falls through zero a step
ends at the root of its series. Derivatives are central differences of two such runs, which agree to half of
the digits.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

from somersault import exam

TARGET = Path(exam.__file__).with_name("answers.json")
#: Of the answers held: bits after the point, terms of a series, and the change of a parameter for its
#: derivative.
BITS, TERMS, CHANGE = 130, 44, 62
_SAMPLES = 24


class Symbol:
    """A number of a record: what is done with it is noted."""

    def __init__(self, record: Record, place: int) -> None:
        self.record, self.place = record, place

    def _with(self, operation: str, *others: Any) -> Symbol:
        places = [self.record.place_of(other) for other in others]
        return self.record.add(operation, *places)

    def __add__(self, other: Any) -> Symbol:
        return self._with("add", self, other)

    def __sub__(self, other: Any) -> Symbol:
        return self._with("sub", self, other)

    def __rsub__(self, other: Any) -> Symbol:
        return self._with("sub", other, self)

    def __mul__(self, other: Any) -> Symbol:
        if isinstance(other, Symbol):
            return self._with("mul", self, other)
        return self.record.add("scale", self.place, Fraction(other))

    def __truediv__(self, other: Any) -> Symbol:
        if isinstance(other, Symbol):
            return self._with("div", self, other)
        return self.record.add("scale", self.place, 1 / Fraction(other))

    def __rtruediv__(self, other: Any) -> Symbol:
        return self._with("div", other, self)

    def __pow__(self, power: float) -> Symbol:
        assert power == 0.5
        return self._with("root", self)

    def __neg__(self) -> Symbol:
        return self.record.add("scale", self.place, Fraction(-1))

    __radd__, __rmul__ = __add__, __mul__


class Record:
    """The operations of a function of the state, in order."""

    def __init__(self, size: int, function: Any) -> None:
        self.operations: list[tuple[Any, ...]] = [("input", k) for k in range(size)]
        inputs = [Symbol(self, k) for k in range(size)]
        found = function(0.0, inputs)
        results = found if isinstance(found, list) else [found]
        self.results = [self.place_of(each) for each in results]

    def add(self, *operation: Any) -> Symbol:
        self.operations.append(operation)
        return Symbol(self, len(self.operations) - 1)

    def place_of(self, value: Any) -> int:
        return value.place if isinstance(value, Symbol) else self.add("constant", Fraction(value)).place


class Arithmetic:
    """Whole numbers with a fixed point."""

    def __init__(self, bits: int, terms: int) -> None:
        self.bits, self.terms, self.one = bits, terms, 1 << bits

    def fixed(self, value: Any) -> int:
        value = Fraction(value)
        return (value.numerator << self.bits) // value.denominator

    def number(self, value: int) -> Fraction:
        return Fraction(value, self.one)

    def series(self, record: Record, state: Sequence[int]) -> list[list[int]]:
        """The series of the state, of which the record has the slope."""
        values: list[list[int]] = [[] for _ in record.operations]
        series = [[x] for x in state]
        for n in range(self.terms):
            self._term(record, values, series, n)
            for k, place in enumerate(record.results):
                series[k].append(values[place][n] // (n + 1))
        return series

    def along(self, record: Record, series: list[list[int]]) -> list[int]:
        """The series of a function of the state."""
        values: list[list[int]] = [[] for _ in record.operations]
        for n in range(self.terms + 1):
            self._term(record, values, series, n)
        return values[record.results[0]]

    def _term(self, record: Record, values: list[list[int]], series: list[list[int]], n: int) -> None:
        bits = self.bits
        for out, (kind, *rest) in zip(values, record.operations, strict=True):
            if kind == "input":
                term = series[rest[0]][n]
            elif kind == "constant":
                term = self.fixed(rest[0]) if n == 0 else 0
            elif kind == "scale":
                term = values[rest[0]][n] * rest[1].numerator // rest[1].denominator
            elif kind == "root":
                a = values[rest[0]]
                if n == 0:
                    term = math.isqrt(a[0] << bits)
                else:
                    others = sum(out[i] * out[n - i] for i in range(1, n)) >> bits
                    term = ((a[n] - others) << bits) // (2 * out[0])
            else:
                a, b = values[rest[0]], values[rest[1]]
                if kind == "add":
                    term = a[n] + b[n]
                elif kind == "sub":
                    term = a[n] - b[n]
                elif kind == "mul":
                    term = sum(map(int.__mul__, a[: n + 1], b[n::-1])) >> bits
                else:
                    rest_of = sum(out[i] * b[n - i] for i in range(n)) >> bits
                    term = ((a[n] - rest_of) << bits) // b[0]
            out.append(term)

    def at(self, series: Sequence[int], x: int) -> int:
        """The value of a series at a time, by Horner's rule."""
        value = 0
        for term in reversed(series):
            value = (value * x >> self.bits) + term
        return value


def run(
    scene: exam.ExamScene, change: Fraction = Fraction(0), bits: int = BITS, terms: int = TERMS
) -> tuple[list[Fraction], list[Fraction]]:
    """The end of a scene and the times of its events, with its parameter changed a little."""
    a = Arithmetic(bits, terms)
    size = scene.y0.size
    state = [a.fixed(x) for x in _start(scene, change)]
    rates = {name: Record(size, lambda t, y, m=name: scene.rate(m, t, y)) for name in scene.modes}
    guards = {
        name: [Record(size, guard.value) for guard in mode.guards] for name, mode in scene.modes.items()
    }
    mode, t, end, times = scene.first, 0, a.fixed(scene.duration), []
    while t < end:
        series = a.series(rates[mode], state)
        h = min(end - t, step_within(a, series))
        roots = [
            (root, guard)
            for guard, record in zip(scene.modes[mode].guards, guards[mode], strict=True)
            if (root := _first_fall(a, a.along(record, series), h)) is not None
        ]
        guard = None
        if roots:
            h, guard = min(roots, key=lambda found: found[0])
        state = [a.at(each, h) for each in series]
        t += h
        if guard is not None:
            times.append(a.number(t))
            mode = guard.next
            if guard.reset is not None:
                state = [a.fixed(x) for x in guard.reset([Exact(a.number(x)) for x in state])]
    return [a.number(x) for x in state], times


class Exact(Fraction):
    """A fraction that takes floats as the fractions that they are."""

    def __add__(self, other: Any) -> Exact:
        return Exact(Fraction.__add__(self, Fraction(other)))

    def __sub__(self, other: Any) -> Exact:
        return Exact(Fraction.__sub__(self, Fraction(other)))

    def __mul__(self, other: Any) -> Exact:
        return Exact(Fraction.__mul__(self, Fraction(other)))

    def __rmul__(self, other: Any) -> Exact:
        return Exact(Fraction.__mul__(self, Fraction(other)))

    def __truediv__(self, other: Any) -> Exact:
        return Exact(Fraction.__truediv__(self, Fraction(other)))


def _start(scene: exam.ExamScene, change: Fraction) -> list[Fraction]:
    found: list[Fraction] = []
    for row, slope in zip(scene.y0.tolist(), scene.direction.tolist(), strict=True):
        y = [Fraction(x) for x in row]
        d = [change * Fraction(x) for x in slope]
        q, (x, y_, z) = y[3:7], d[3:6]
        turn = [
            q[3] * x + q[1] * z - q[2] * y_,
            q[3] * y_ + q[2] * x - q[0] * z,
            q[3] * z + q[0] * y_ - q[1] * x,
            -q[0] * x - q[1] * y_ - q[2] * z,
        ]
        found += [p + s for p, s in zip(y[:3], d[:3], strict=True)]
        found += [p + s / 2 for p, s in zip(q, turn, strict=True)]
        found += [p + s for p, s in zip(y[7:], d[6:], strict=True)]
    return found


def step_within(a: Arithmetic, series: list[list[int]]) -> int:
    """The step after which the last two terms are below the rounding."""
    least = math.inf
    for n in (a.terms - 1, a.terms):
        largest = max(abs(each[n]) for each in series)
        if largest:
            least = min(least, -math.log2(largest) / n)  # largest 2^(h n) = 1, in units of the last bit
    if math.isinf(least):
        return a.fixed(10**6)
    return a.fixed(Fraction(2.0**least))


def _first_fall(a: Arithmetic, series: list[int], h: int) -> int | None:
    """Where a series first falls through zero within a step, if it does."""
    tiny = a.one >> (a.bits * 3 // 4)
    polynomial = list(series)
    if abs(polynomial[0]) < tiny:
        # it begins at zero, which is divided out
        polynomial = polynomial[1:]
    slope = [n * c for n, c in enumerate(polynomial)][1:]
    points = sorted({h * k // _SAMPLES for k in range(_SAMPLES + 1)} | _minima(a, slope, h))
    values = [a.at(polynomial, x) for x in points]
    for k in range(1, len(points)):
        if values[k - 1] > 0 >= values[k]:
            low, high = points[k - 1], points[k]
            while high - low > 1:
                middle = (low + high) >> 1
                low, high = (middle, high) if a.at(polynomial, middle) > 0 else (low, middle)
            return high
    return None


def _minima(a: Arithmetic, slope: list[int], h: int) -> set[int]:
    """Where a series is least, by its slope: a surface that is grazed is touched between two samples."""
    points = [h * k // _SAMPLES for k in range(_SAMPLES + 1)]
    found = set()
    for low, high in pairwise(points):
        if a.at(slope, low) < 0 < a.at(slope, high):
            while high - low > a.one >> (a.bits // 2):
                middle = (low + high) >> 1
                low, high = (middle, high) if a.at(slope, middle) < 0 else (low, middle)
            found.add(high)
    return found


def gradient(
    scene: exam.ExamScene, bits: int = BITS, terms: int = TERMS, change: int = CHANGE
) -> list[list[Fraction]]:
    """The derivative of the end by the parameter: position, rotation vector in the body, velocities."""
    by = Fraction(1, 2**change)
    less, more = (run(scene, sign * by, bits, terms)[0] for sign in (-1, 1))
    rows = []
    for k in range(0, len(less), 13):
        d = [(x - y) / (2 * by) for x, y in zip(more[k : k + 13], less[k : k + 13], strict=True)]
        x, y, z, w = ((p + q) / 2 for p, q in zip(more[k + 3 : k + 7], less[k + 3 : k + 7], strict=True))
        e, f, g, s = d[3:7]
        turn = [
            2 * (w * e - s * x - y * g + z * f),
            2 * (w * f - s * y - z * e + x * g),
            2 * (w * g - s * z - x * f + y * e),
        ]
        rows.append([*d[:3], *turn, *d[7:]])
    return rows


def digits(value: Fraction) -> float:
    """The nearest double; what is smaller than the error of the series is zero."""
    return float(value) if abs(value) > Fraction(1, 2**64) else 0.0


def held(scene: exam.ExamScene) -> dict[str, Any]:
    """What the file holds of a scene."""
    end, events = run(scene)
    rows = [end[k : k + 13] for k in range(0, len(end), 13)]
    return {
        "end": [[digits(x) for x in row] for row in rows],
        "events": [digits(t) for t in events],
        "gradient": [[digits(x) for x in row] for row in gradient(scene)],
    }


if __name__ == "__main__":
    lines = [f"{json.dumps(scene.name)}: {json.dumps(held(scene))}" for scene in exam.scenes()]
    TARGET.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
