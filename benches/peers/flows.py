"""Lyapunov exponents of Lorenz' attractor, and a field of exponents of the double gyre.

The contenders are what one would write: SciPy's DOP853 on state and frame with a QR factorisation each
half second, and loops of numba with RK4 in fixed steps. The field by numba is that of most tools: four
neighbours of each point, and a difference.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from measure import interleaved, table
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from somersault import ftla

Array = NDArray[np.float64]

DURATION = 200.0
TOLERANCE = 1e-8
PERIOD = 0.5
"""Between two QR factorisations, s."""
STEPS = (0.01, 0.002)
"""The usual one, and that at which the sum of the exponents is as accurate."""
GRID = (200, 100)
ADVECTED = 15.0
FIELD_STEP = 0.05


@njit
def _lorenz(y: Array, out: Array) -> None:
    """State and frame by rows."""
    out[0] = 10.0 * (y[1] - y[0])
    out[1] = y[0] * (28.0 - y[2]) - y[1]
    out[2] = y[0] * y[1] - 8.0 / 3.0 * y[2]
    for k in range(3):
        a, b, c = y[3 + k], y[6 + k], y[9 + k]
        out[3 + k] = 10.0 * (b - a)
        out[6 + k] = (28.0 - y[2]) * a - b - y[0] * c
        out[9 + k] = y[1] * a + y[0] * b - 8.0 / 3.0 * c


@njit
def _numba_spectrum(start: Array, duration: float, step: float) -> Array:
    y, k1, k2, k3, k4 = np.zeros(12), np.zeros(12), np.zeros(12), np.zeros(12), np.zeros(12)
    y[:3] = start
    for i in range(3):
        y[3 + 4 * i] = 1.0
    logs = np.zeros(3)
    per = round(PERIOD / step)
    for _ in range(round(duration / PERIOD)):
        for _ in range(per):
            _lorenz(y, k1)
            _lorenz(y + 0.5 * step * k1, k2)
            _lorenz(y + 0.5 * step * k2, k3)
            _lorenz(y + step * k3, k4)
            y += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        q, r = np.linalg.qr(y[3:].copy().reshape(3, 3))
        y[3:] = q.ravel()
        for i in range(3):
            logs[i] += np.log(abs(r[i, i]))
    return logs / duration


def _scipy_spectrum(start: Array) -> Array:
    def slope(_: float, y: Array) -> Array:
        out = np.empty(12)
        _lorenz(y, out)
        return out

    y, logs = np.concatenate([start, np.eye(3).ravel()]), np.zeros(3)
    for _ in range(round(DURATION / PERIOD)):
        y = solve_ivp(slope, (0.0, PERIOD), y, method="DOP853", rtol=TOLERANCE, atol=1e-10).y[:, -1]
        q, r = np.linalg.qr(y[3:].reshape(3, 3))
        y[3:] = q.ravel()
        logs += np.log(np.abs(np.diag(r)))
    return logs / DURATION


@njit
def _gyre(x: float, y: float, t: float) -> tuple[float, float]:
    a = 0.25 * np.sin(0.2 * np.pi * t)
    f, slope = a * x * x + (1.0 - 2.0 * a) * x, 2.0 * a * x + 1.0 - 2.0 * a
    u = -0.1 * np.pi * np.sin(np.pi * f) * np.cos(np.pi * y)
    return u, 0.1 * np.pi * np.cos(np.pi * f) * np.sin(np.pi * y) * slope


@njit
def _advected(x: float, y: float, step: float) -> tuple[float, float]:
    t = 0.0
    for _ in range(round(ADVECTED / step)):
        a, b = _gyre(x, y, t)
        c, d = _gyre(x + 0.5 * step * a, y + 0.5 * step * b, t + 0.5 * step)
        e, f = _gyre(x + 0.5 * step * c, y + 0.5 * step * d, t + 0.5 * step)
        g, h = _gyre(x + step * e, y + step * f, t + step)
        x += step / 6.0 * (a + 2.0 * c + 2.0 * e + g)
        y += step / 6.0 * (b + 2.0 * d + 2.0 * f + h)
        t += step
    return x, y


@njit
def _numba_field(points: Array, step: float, beside: float) -> Array:
    found = np.empty(len(points))
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        right, left = _advected(x + beside, y, step), _advected(x - beside, y, step)
        above, below = _advected(x, y + beside, step), _advected(x, y - beside, step)
        a, b = (right[0] - left[0]) / (2 * beside), (above[0] - below[0]) / (2 * beside)
        c, d = (right[1] - left[1]) / (2 * beside), (above[1] - below[1]) / (2 * beside)
        half, rest = 0.5 * (a * a + b * b + c * c + d * d), a * d - b * c
        found[k] = 0.5 * np.log(half + np.sqrt(max(half * half - rest * rest, 0.0))) / ADVECTED
    return found


def _traced_gyre(x: Any, t: Any) -> Any:
    a = 0.25 * np.sin(0.2 * np.pi * t)
    f, slope = a * x.x**2 + (1 - 2 * a) * x.x, 2 * a * x.x + 1 - 2 * a
    u = -0.1 * np.pi * np.sin(np.pi * f) * np.cos(np.pi * x.y)
    return u, 0.1 * np.pi * np.cos(np.pi * f) * np.sin(np.pi * x.y) * slope


def _spectra(repetitions: int) -> tuple[list[dict[str, object]], str]:
    system = ftla.vector_field(
        lambda x: (10.0 * (x.y - x.x), x.x * (28.0 - x.z) - x.y, x.x * x.y - 8 / 3 * x.z), ("x", "y", "z")
    )
    flow, start = ftla.VariationalFlow(system, rtol=TOLERANCE, atol=1e-10), np.array([1.0, 1.0, 20.0])
    runs = {
        "somersault": lambda: ftla.lyapunov_spectrum(flow, start, DURATION, transient=0.0).exponents,
        "numba, RK4, steps of 0.01 s": lambda: _numba_spectrum(start, DURATION, STEPS[0]),
        "numba, RK4, steps of 0.002 s": lambda: _numba_spectrum(start, DURATION, STEPS[1]),
        "SciPy, DOP853": lambda: _scipy_spectrum(start),
    }
    seconds = interleaved(runs, max(3, repetitions // 5))
    rows: list[dict[str, object]] = [
        {
            "what": "Lorenz, 200 s",
            "contender": name,
            "seconds": seconds[name],
            "ratio": seconds[name] / seconds["somersault"],
            "defect of the sum": float(abs(run().sum() + 41 / 3)),
        }
        for name, run in runs.items()
    ]
    text = table(
        ("Lorenz' exponents over 200 s", "time", "ratio", "sum off by"),
        [
            (
                f"{row['contender']}",
                f"{row['seconds']:.4f} s",
                f"{row['ratio']:.2f}",
                f"{row['defect of the sum']:.0e}",
            )
            for row in rows
        ],
    )
    return rows, text


def _fields(repetitions: int) -> tuple[list[dict[str, object]], str]:
    system = ftla.vector_field(_traced_gyre, ("x", "y"))
    # inside of the boundary, on which the neighbours would leave
    x, y = np.linspace(0.005, 1.995, GRID[0]), np.linspace(0.005, 0.995, GRID[1])
    points = np.stack(np.meshgrid(x, y), axis=-1)
    rows_of = np.ascontiguousarray(points.reshape(-1, 2))
    exact = ftla.ftle_field(ftla.VariationalFlow(system, rtol=1e-12), points, ADVECTED).exponents.ravel()
    flow = ftla.VariationalFlow(system, rtol=1e-5, atol=1e-7)
    runs = {
        "somersault, variational": lambda: ftla.ftle_field(flow, points, ADVECTED).exponents.ravel(),
        "numba, RK4, four neighbours": lambda: _numba_field(rows_of, FIELD_STEP, 1e-4),
    }
    seconds = interleaved(runs, max(3, repetitions // 5))
    rows: list[dict[str, object]] = [
        {
            "what": "double gyre, 200 × 100 points",
            "contender": name,
            "seconds": seconds[name],
            "ratio": seconds[name] / seconds["somersault, variational"],
            "points a second": GRID[0] * GRID[1] / seconds[name],
            "median error": float(np.median(abs(run() - exact))),
        }
        for name, run in runs.items()
    ]
    text = table(
        ("double gyre, 200 × 100 points", "processor time", "ratio", "points a second", "median error, 1/s"),
        [
            (
                f"{row['contender']}",
                f"{row['seconds']:.3f} s",
                f"{row['ratio']:.2f}",
                f"{row['points a second']:.0f}",
                f"{row['median error']:.0e}",
            )
            for row in rows
        ],
    )
    return rows, text


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Both."""
    parts = [_spectra(repetitions), _fields(repetitions)]
    rows = [row for part in parts for row in part[0]]
    return rows, "\n\n".join(["## Flows", *(part[1] for part in parts)])


if __name__ == "__main__":
    print(compare(15)[1])
