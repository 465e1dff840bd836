"""What one writes by hand: quaternions and Euler's equations, compiled by numba."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.integrate import DOP853

Array = NDArray[np.float64]


@njit(inline="always")
def _slope(y: tuple[float, ...], m: tuple[float, ...]) -> tuple[float, ...]:
    w, x, p, z, a, b, c = y
    return (
        -0.5 * (x * a + p * b + z * c),
        0.5 * (w * a + p * c - z * b),
        0.5 * (w * b + z * a - x * c),
        0.5 * (w * c + x * b - p * a),
        m[0] * b * c,
        m[1] * c * a,
        m[2] * a * b,
    )


@njit(inline="always")
def _moved(y: tuple[float, ...], h: float, k: tuple[float, ...]) -> tuple[float, ...]:
    return (
        y[0] + h * k[0],
        y[1] + h * k[1],
        y[2] + h * k[2],
        y[3] + h * k[3],
        y[4] + h * k[4],
        y[5] + h * k[5],
        y[6] + h * k[6],
    )


@njit(inline="always")
def _rk4_step(y: tuple[float, ...], h: float, m: tuple[float, ...]) -> tuple[float, ...]:
    k1 = _slope(y, m)
    k2 = _slope(_moved(y, 0.5 * h, k1), m)
    k3 = _slope(_moved(y, 0.5 * h, k2), m)
    k4 = _slope(_moved(y, h, k3), m)
    y = _moved(_moved(_moved(_moved(y, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4)
    w, x, p, z, a, b, c = y
    s = 1.0 / np.sqrt(w * w + x * x + p * p + z * z)
    return (w * s, x * s, p * s, z * s, a, b, c)


@njit(inline="always")
def _ratios(moments: Array) -> tuple[float, float, float]:
    i, j, k = moments[0], moments[1], moments[2]
    return ((j - k) / i, (k - i) / j, (i - j) / k)


@njit(inline="always")
def _unpacked(y: Array) -> tuple[float, ...]:
    return (y[0], y[1], y[2], y[3], y[4], y[5], y[6])


@njit
def rk4(moments: Array, start: Array, h: float, steps: int) -> Array:
    """Classic Runge-Kutta on the quaternion, normalised after each step; the state at the end."""
    m = _ratios(moments)
    y = _unpacked(start)
    for _ in range(steps):
        y = _rk4_step(y, h, m)
    return np.array(y)


@njit(parallel=True, fastmath=True)
def rk4_batch(moments: Array, states: Array, h: float, steps: int) -> Array:
    """As `rk4` for many bodies, one a column; parallel over tiles, whose columns share instructions."""
    width = 64
    count = states.shape[1]
    ends = np.empty_like(states)
    for tile in prange((count + width - 1) // width):
        low = tile * width
        high = min(low + width, count)
        y = states[:, low:high].copy()
        m = np.empty((3, high - low))
        for n in range(high - low):
            m[0, n], m[1, n], m[2, n] = _ratios(moments[:, low + n])
        for _ in range(steps):
            for n in range(high - low):
                y[0, n], y[1, n], y[2, n], y[3, n], y[4, n], y[5, n], y[6, n] = _rk4_step(
                    (y[0, n], y[1, n], y[2, n], y[3, n], y[4, n], y[5, n], y[6, n]),
                    h,
                    (m[0, n], m[1, n], m[2, n]),
                )
        ends[:, low:high] = y
    return ends


def _dop853_source() -> str:
    """Dormand and Prince's 8(5,3) pair for seven unknowns, its sums written out without their zeros."""

    def weighed(weights: Array, component: int) -> str:
        terms = [f"{float(a)!r} * k{j}[{component}]" for j, a in enumerate(weights) if a != 0]
        return " + ".join(terms)

    def vector(weights: Array, form: str) -> str:
        return "(" + ", ".join(form.format(i=i, sum=weighed(weights, i)) for i in range(7)) + ")"

    lines = ["def stages(y, k0, h, m):"]
    for stage in range(1, DOP853.n_stages):
        point = vector(DOP853.A[stage, :stage], "y[{i}] + h * ({sum})")
        lines.append(f"    k{stage} = slope({point}, m)")
    lines += [
        f"    after = {vector(DOP853.B, 'y[{i}] + h * ({sum})')}",
        f"    k{DOP853.n_stages} = slope(after, m)",
        f"    fifth = {vector(DOP853.E5, '{sum}')}",
        f"    third = {vector(DOP853.E3, '{sum}')}",
        f"    return after, k{DOP853.n_stages}, fifth, third",
    ]
    return "\n".join(lines)


def _compile_stages() -> Any:
    scope: dict[str, Any] = {"slope": _slope}
    exec(_dop853_source(), scope)
    return njit(scope["stages"])


_stages = _compile_stages()


@njit
def dop853(moments: Array, start: Array, duration: float, tolerance: float) -> Array:
    """Adaptive DOP853 on the quaternion, with the step control of SciPy; the state at the end.

    `tolerance` is both the relative and the absolute one.
    """
    m = _ratios(moments)
    y = _unpacked(start)
    k = _slope(y, m)
    t = 0.0
    h = 0.1 * tolerance**0.125
    rejected = False
    while t < duration:
        h = min(h, duration - t)
        after, k_after, fifth, third = _stages(y, k, h, m)
        fifth_sum = 0.0
        third_sum = 0.0
        for i in range(7):
            scale = tolerance * (1.0 + max(abs(y[i]), abs(after[i])))
            fifth_sum += (fifth[i] / scale) ** 2
            third_sum += (third[i] / scale) ** 2
        error = 0.0
        if fifth_sum > 0.0:
            error = h * fifth_sum / np.sqrt(7 * (fifth_sum + 0.01 * third_sum))
        if error < 1.0:
            t += h
            y = after
            k = k_after
            growth = 10.0 if error == 0.0 else min(10.0, 0.9 * error**-0.125)
            h *= min(1.0, growth) if rejected else growth
            rejected = False
        else:
            h *= max(0.2, 0.9 * error**-0.125)
            rejected = True
    return np.array(y)
