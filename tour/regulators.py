"""The scalar hyper-sensitive problems, beside their closed forms and a quadrature."""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from somersault import ftla
from tour.page import Cell, error_size

_ROOT = np.sqrt(2.0)


def _cost(system: ftla.System, a: float, b: float, horizon: float) -> float:
    fractions = ftla.graded_times(horizon, 0.2, 12.0) / horizon
    fractions[-1] = 1.0
    return ftla.continue_through(system, [([0.0], [0.0]), ([a], [b])], horizon, fractions).extremal.cost()


def linear(a: float, b: float, horizon: float) -> float:
    """Cost of dx/dt = −x + u from a to b: x = (a sinh r(T − t) + b sinh rt)/sinh rT, r = √2."""
    coth = 1.0 / np.tanh(_ROOT * horizon)
    csch = 2.0 * np.exp(-_ROOT * horizon) / (1.0 - np.exp(-2.0 * _ROOT * horizon))
    first, last = _ROOT * (a * coth - b * csch) - a, _ROOT * (b * coth - a * csch) + b
    return float(0.5 * (a * first + b * last))


def cubic_by_manifolds(a: float, b: float) -> float:
    """Cost of dx/dt = −x³ + u from a to rest and from rest to b, λ = −x³ ± x √(1 + x⁴) on the way."""
    part = sum(0.25 * (x**2 * np.sqrt(1.0 + x**4) + np.arcsinh(x**2)) for x in (a, b))
    return float(part + 0.25 * (b**4 - a**4))


def cubic_by_quadrature(a: float, b: float, horizon: float) -> float:
    """The same over a finite horizon, by the conserved Hamiltonian.

    With y = x² and m its least value 2H = m + m³ and (dx/dt)² = (y − m)(1 + y² + ym + m²); y = m cosh² v
    makes it smooth: dt = dv/√(1 + y² + ym + m²).
    """

    def rate(m: float, v: float) -> float:
        y = m * np.cosh(v) ** 2
        return float(np.sqrt(1.0 + y * y + y * m + m * m))

    def last(m: float, x: float) -> float:
        return float(np.arccosh(x / np.sqrt(m)))

    def duration(log_m: float) -> float:
        m = float(np.exp(log_m))
        ways = (quad(lambda v: 1.0 / rate(m, v), 0.0, last(m, x), epsabs=1e-13, limit=200)[0] for x in (a, b))
        return float(sum(ways)) - horizon

    m = float(np.exp(brentq(duration, np.log(1e-12), np.log(0.999), xtol=1e-14)))

    def part(x: float, sign: float) -> float:
        def integrand(v: float) -> float:
            place = np.sqrt(m) * np.cosh(v)
            costate = -(place**3) + sign * np.sqrt(m) * np.sinh(v) * rate(m, v)
            return float(0.5 * (place**2 + costate**2) / rate(m, v))

        return float(quad(integrand, 0.0, last(m, x), epsabs=1e-13, limit=200)[0])

    return part(a, 1.0) + part(b, -1.0)


def rows() -> list[list[str | Cell]]:
    """Costs of both problems at three horizons, and how far they are from what is exact."""
    found: list[list[str | Cell]] = []
    for horizon in (10.0, 40.0, 1e4):
        for a, b in ((1.0, 1.5), (1.5, 1.0)):
            one, three = (
                _cost(system, a, b, horizon) for system in (ftla.linear_regulator(), ftla.cubic_regulator())
            )
            exact = cubic_by_quadrature(a, b, horizon) if horizon < 40.0 else cubic_by_manifolds(a, b)
            found.append(
                [
                    f"{a} → {b}",
                    f"{horizon:.0f}",
                    f"{one:.12f}",
                    error_size(abs(one - linear(a, b, horizon))),
                    f"{three:.12f}",
                    error_size(abs(three - exact)),
                ]
            )
    return found
