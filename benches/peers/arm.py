"""The two-link arm of thesis 8.4: ten seconds, least effort, to 1e-6 of the cost, set-up included.

Every contender solves the same problem by collocation at Radau points, from the same guesses: folded, and
straight from start to end; CasADi in two ways to write it. The reference comes from the boundary value
problem of states and costates (thesis 8.3), which no contender solves.
"""

from __future__ import annotations

import subprocess
import time
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np
from measure import Contender, program, race
from scipy.integrate import solve_bvp

TARGET = 1e-6
GAMMA = (1.0, 0.5)
DEGREE = 4
RUNS = 5
"""Runs of this library's program in one call, so that starting it does not count."""


@dataclass(frozen=True)
class Case:
    """An arm that travels from rest to rest; by default that of the thesis, guessed to be folded."""

    masses: tuple[float, float] = (0.5, 0.5)
    lengths: tuple[float, float] = (2.0, 0.5)
    damping: tuple[float, float] = (0.2, 0.0)
    travel: float = np.pi
    duration: float = 10.0
    fold: float | None = np.pi
    """θ₂ on the way; none for a straight line from start to end."""

    def end(self, side: float) -> Any:
        """The state at the start (−1) or at the end (1)."""
        return np.array([side * self.travel / 2, 0.05, 0.0, 0.0])


THESIS = Case()
GUESSES = {"folded": THESIS, "straight": replace(THESIS, fold=None)}


# ------------------------------------------------------------------------------------------- equations


def rates(x: Any, u: Any, case: Case = THESIS) -> Any:
    """ẋ of (8.8), with M₁₂ corrected."""
    (m1, m2), (l1, l2), (c1, c2) = case.masses, case.lengths, case.damping
    i1, i2 = m1 * l1**2 / 12, m2 * l2**2 / 12
    cosine, sine = ca.cos(x[1]), ca.sin(x[1])
    m11 = m1 * l1**2 / 4 + m2 * (l1**2 + l1 * l2 * cosine + l2**2 / 4) + i1 + i2
    m12 = m2 * (l2**2 / 4 + l1 * l2 * cosine / 2) + i2
    m22 = m2 * l2**2 / 4 + i2
    swing = l1 * l2 * m2 * sine / 2
    b1 = u[0] + swing * x[3] * (2 * x[2] + x[3]) - c1 * x[2]
    b2 = u[1] - swing * x[2] ** 2 - c2 * x[3]
    determinant = m11 * m22 - m12**2
    return ca.vertcat(x[2], x[3], (m22 * b1 - m12 * b2) / determinant, (m11 * b2 - m12 * b1) / determinant)


def running_cost(u: Any) -> Any:
    """The integrand of (8.7)."""
    return (GAMMA[0] * u[0] ** 2 + GAMMA[1] * u[1] ** 2) / 2


def guess(t: Any, case: Case = THESIS) -> Any:
    """Folded from a tenth to nine tenths of the time, or a straight line: states in rows."""
    if case.fold is None:
        return case.end(-1)[:, None] + (case.end(1) - case.end(-1))[:, None] * t / case.duration
    knots = [0.0, 0.1 * case.duration, 0.9 * case.duration, case.duration]
    turn, rate = case.travel / 2, case.travel / case.duration
    columns = [
        [-turn, -0.8 * turn, 0.8 * turn, turn],
        [0.05, case.fold, case.fold, 0.05],
        [0.0, rate, rate, 0.0],
        [0.0] * 4,
    ]
    return np.array([np.interp(t, knots, column) for column in columns])


# ------------------------------------------------------------------------------------------ contenders


def _ours(guess: str, tolerance: float) -> float:
    command = [str(program("somersault-ocp", "arm_collocation")), repr(tolerance), str(RUNS), guess]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


@dataclass(frozen=True)
class Optimum:
    """What IPOPT finds, and the time of the solve alone."""

    cost: float
    states: Any
    costates: Any
    seconds: float


def transcribed(scalars: bool, intervals: int, case: Case = THESIS, tolerance: float = 1e-8) -> Optimum:
    """By IPOPT, from the case's guess; a cost of NaN where it reports no success."""
    n, h = intervals, case.duration / intervals
    points = ca.collocation_points(DEGREE, "radau")
    by, _, weights = ca.collocation_coeff(points)
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    equations = ca.Function("f", [x, u], [rates(x, u, case), running_cost(u)])

    starts = ca.MX.sym("s", 4, n + 1)
    inner = ca.MX.sym("x", 4, n * DEGREE)
    controls = ca.MX.sym("u", 2, n * DEGREE)
    slopes, costs = equations.map(n * DEGREE)(inner, controls)
    defects, joints, cost = [], [], 0
    for k in range(n):
        here = slice(k * DEGREE, (k + 1) * DEGREE)
        states = ca.horzcat(starts[:, k], inner[:, here])
        defects.append(ca.vec(states @ by - h * slopes[:, here]))
        joints.append(starts[:, k + 1] - inner[:, (k + 1) * DEGREE - 1])
        cost += h * ca.mtimes(costs[:, here], weights)
    variables = ca.vertcat(ca.vec(starts), ca.vec(inner), ca.vec(controls))
    program = {"x": variables, "f": cost, "g": ca.vertcat(*defects, *joints)}
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "expand": scalars}
    options["ipopt.tol"] = tolerance
    solver = ca.nlpsol("arm", "ipopt", program, options)

    bounds = np.arange(n + 1) * h
    times = (bounds[:-1, None] + h * np.array(points)).ravel()
    first = np.concatenate(
        [guess(bounds, case).T.ravel(), guess(times, case).T.ravel(), np.zeros(2 * n * DEGREE)]
    )
    lower, upper = np.full(first.size, -np.inf), np.full(first.size, np.inf)
    for at, value in ((0, case.end(-1)), (4 * n, case.end(1))):
        lower[at : at + 4] = upper[at : at + 4] = value
    began = time.process_time()
    found = solver(x0=first, lbx=lower, ubx=upper, lbg=0, ubg=0)
    seconds = time.process_time() - began
    if not solver.stats()["success"]:
        return Optimum(np.nan, None, None, seconds)
    states = np.array(found["x"]).ravel()[: 4 * (n + 1)].reshape(n + 1, 4).T
    costates = -np.array(found["lam_g"]).ravel()[-4 * n :].reshape(n, 4).T
    return Optimum(float(found["f"]), states, np.hstack([costates[:, :1], costates]), seconds)


def _casadi(guess: str, scalars: bool, intervals: float) -> float:
    return transcribed(scalars, round(intervals), GUESSES[guess]).cost


@cache
def _reference() -> float:
    """By the boundary value problem (8.5), (8.6), (8.10), the cost a ninth equation, from a fine solution."""
    x, costate, u = ca.SX.sym("x", 4), ca.SX.sym("l", 4), ca.SX.sym("u", 2)
    p = ca.vertcat(x, costate)
    hamiltonian = running_cost(u) + ca.dot(costate, rates(x, u))
    best = -ca.mtimes(ca.jacobian(rates(x, u), u).T, costate) / ca.DM(GAMMA)
    slope = ca.substitute(ca.vertcat(rates(x, u), -ca.gradient(hamiltonian, x), running_cost(u)), u, best)
    field = ca.Function("h", [p], [slope])

    def slopes(_: Any, p: Any) -> Any:
        return np.array(field(p[:8]))

    def ends(first: Any, last: Any) -> Any:
        return np.concatenate([first[:4] - THESIS.end(-1), last[:4] - THESIS.end(1), first[8:]])

    fine = transcribed(True, 200)
    times = np.linspace(0, THESIS.duration, 201)
    begin = np.vstack([fine.states, fine.costates, np.linspace(0, fine.cost, 201)])
    solution = solve_bvp(slopes, ends, times, begin, tol=1e-9, max_nodes=100_000)
    if not solution.success:
        raise RuntimeError(solution.message)
    return float(solution.y[8, -1])


def contenders(guess: str) -> list[Contender]:
    """Everyone who can get there."""
    intervals = [20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 70.0, 80.0, 100.0]
    tolerances = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7]
    return [
        Contender("somersault, hp mesh", "tolerance", tolerances, partial(_ours, guess), RUNS),
        Contender("CasADi + IPOPT, scalar graphs", "intervals", intervals, partial(_casadi, guess, True)),
        Contender("CasADi + IPOPT, mapped function", "intervals", intervals, partial(_casadi, guess, False)),
    ]


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Time to the target, set-up included."""
    reference = _reference()

    def error(cost: float) -> float:
        relative = abs(cost / reference - 1)
        return relative if np.isfinite(relative) else np.inf

    rows: list[dict[str, object]] = []
    text = (
        f"## The two-link arm of thesis 8.4, {THESIS.duration:g} s to {TARGET:g} of the cost\n\n"
        "Set-up included, each at the coarsest setting from which on it meets the target; the cost of the "
        f"boundary value problem is {reference:.9f}. Processor time. CasADi: Radau points, degree {DEGREE}, "
        "equal intervals."
    )
    for guess, case in GUESSES.items():
        [(_, found, lines)] = race(
            contenders(guess), error, [TARGET], repetitions, "relative error of the cost"
        )
        rows += [{**row, "guess": guess} for row in found]
        alone = min(transcribed(True, 60, case).seconds for _ in range(3))
        text += (
            f"\n\nFrom a {guess} guess (of CasADi's time IPOPT itself takes {alone * 1e3:.3g} ms with 60 "
            f"intervals and scalar graphs):\n\n{lines}"
        )
    return rows, text
