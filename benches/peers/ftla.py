"""Finite-time Lyapunov analysis of the two-link arm: transition matrices, cold start, and arms at random.

No package offers what is compared, so that the contenders are what one would write: numba's compiled DOP853
on state and transition matrix, and collocation by CasADi and IPOPT from a folded guess.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from arm import THESIS, Case, transcribed
from measure import clock, coarsest, geometric, interleaved, program, table
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import DOP853, solve_ivp

Array = NDArray[np.float64]

AVERAGING = 3.5
TOLERANCE = 1e-9
POINTS = 100
REPEATS = 50
"""Times that either goes over the cloud in one call: starting this library's program should not count."""
FIXED_STEPS = geometric(64, 2048, 32)
"""From which the fewest are chosen that are as accurate."""
COLD_RUNS = 20
INTERVALS = (60, 120)
"""Of the collocation: two meshes that must agree."""
SOLVED = 1e-8
CONFIRMED = 1e-5
"""Relative difference of the costs on both meshes at which a collocation solution counts."""


# ----------------------------------------------------------------------------------- transition matrices


@njit(fastmath=True, error_model="numpy")
def _linearize(p: Array, h: Array, d: Array, arm: Array) -> None:
    """Field and Jacobian of the state-costate system, thesis 8.3; `arm` is (a, b, d, c₁, c₂, γ₁, γ₂)."""
    sine, cosine = np.sin(p[1]) * arm[1], np.cos(p[1]) * arm[1]
    w1, w2 = p[2], p[3]
    m11, m12, m22 = arm[0] + 2.0 * cosine, arm[2] + cosine, arm[2]
    determinant = m11 * m22 - m12 * m12
    i11, i12, i22 = m22 / determinant, -m12 / determinant, m11 / determinant
    g1, g2 = 1.0 / arm[5], 1.0 / arm[6]
    u1, u2 = i11 * p[6] + i12 * p[7], i12 * p[6] + i22 * p[7]
    swing, square = w2 * (2.0 * w1 + w2), w1 * w1
    r1 = -u1 * g1 + sine * swing - arm[3] * w1
    r2 = -u2 * g2 - sine * square - arm[4] * w2
    a1, a2 = i11 * r1 + i12 * r2, i12 * r1 + i22 * r2
    t1, t2 = -sine * (2.0 * a1 + a2), -sine * a1
    e1, e2 = -swing * cosine, square * cosine
    k11, k12 = arm[3] - 2.0 * sine * w2, -2.0 * sine * (w1 + w2)
    k21, k22 = 2.0 * sine * w1, arm[4]
    h[0], h[1], h[2], h[3], h[4] = w1, w2, a1, a2, 0.0
    h[5] = u1 * (t1 + e1) + u2 * (t2 + e2)
    h[6] = k11 * u1 + k21 * u2 - p[4]
    h[7] = k12 * u1 + k22 * u2 - p[5]
    s1, s2 = -sine * (2.0 * u1 + u2), -sine * u1
    v1, v2 = -(i11 * s1 + i12 * s2), -(i12 * s1 + i22 * s2)
    q1, q2 = -g1 * v1 - e1 - t1, -g2 * v2 - e2 - t2
    b1, b2 = i11 * q1 + i12 * q2, i12 * q1 + i22 * q2
    d[:] = 0.0
    d[0, 2] = d[1, 3] = 1.0
    d[6, 4] = d[7, 5] = -1.0
    d[2, 1], d[3, 1], d[5, 6], d[5, 7] = b1, b2, -b1, -b2
    d[2, 2], d[2, 3] = -(i11 * k11 + i12 * k21), -(i11 * k12 + i12 * k22)
    d[3, 2], d[3, 3] = -(i12 * k11 + i22 * k21), -(i12 * k12 + i22 * k22)
    d[6, 6], d[6, 7], d[7, 6], d[7, 7] = -d[2, 2], -d[3, 2], -d[2, 3], -d[3, 3]
    d[2, 6] = -(i11 * g1 * i11 + i12 * g2 * i12)
    d[2, 7] = d[3, 6] = -(i11 * g1 * i12 + i12 * g2 * i22)
    d[3, 7] = -(i12 * g1 * i12 + i22 * g2 * i22)
    d[5, 1] = (
        v1 * (t1 + e1)
        + v2 * (t2 + e2)
        + u1 * (-cosine * (2.0 * a1 + a2) - sine * (2.0 * b1 + b2) + swing * sine)
        + u2 * (-cosine * a1 - sine * b1 - square * sine)
    )
    c11, c12, c21 = -2.0 * w2 * cosine, -2.0 * (w1 + w2) * cosine, 2.0 * w1 * cosine
    d[6, 1] = d[5, 2] = c11 * u1 + c21 * u2 + k11 * v1 + k21 * v2
    d[7, 1] = d[5, 3] = c12 * u1 + k12 * v1 + k22 * v2
    d[6, 2] = 2.0 * sine * u2
    d[6, 3] = d[7, 2] = d[7, 3] = -2.0 * sine * u1


@njit(fastmath=True, error_model="numpy")
def _slope(y: Array, out: Array, d: Array, arm: Array) -> None:
    """State and matrix by rows: y = (p, Φ₁₁, Φ₁₂, …)."""
    _linearize(y[:8], out[:8], d, arm)
    for i in range(8):
        row = out[8 + 8 * i : 16 + 8 * i]
        row[:] = 0.0
        for k in range(8):
            entry = d[i, k]
            if entry != 0.0:
                for j in range(8):
                    row[j] += entry * y[8 + 8 * k + j]


@njit(fastmath=True, error_model="numpy")
def _transition(
    point: Array,
    duration: float,
    tolerance: float,
    arm: Array,
    a: Array,
    b: Array,
    fifth_by: Array,
    third_by: Array,
) -> Array:
    """DOP853 with the step control of SciPy over all 72 numbers."""
    stages = len(b)
    y = np.zeros(72)
    y[:8] = point
    for i in range(8):
        y[8 + 9 * i] = 1.0
    k = np.zeros((stages + 1, 72))
    d = np.zeros((8, 8))
    after, fifth, third = np.zeros(72), np.zeros(72), np.zeros(72)
    _slope(y, k[0], d, arm)
    t, h, rejected = 0.0, 0.05, False
    while t < duration:
        h = min(h, duration - t)
        for s in range(1, stages):
            after[:] = 0.0
            for j in range(s):
                if a[s, j] != 0.0:
                    for i in range(72):
                        after[i] += a[s, j] * k[j, i]
            for i in range(72):
                after[i] = y[i] + h * after[i]
            _slope(after, k[s], d, arm)
        after[:] = 0.0
        for j in range(stages):
            if b[j] != 0.0:
                for i in range(72):
                    after[i] += b[j] * k[j, i]
        for i in range(72):
            after[i] = y[i] + h * after[i]
        _slope(after, k[stages], d, arm)
        fifth[:] = 0.0
        third[:] = 0.0
        for j in range(stages + 1):
            for i in range(72):
                fifth[i] += fifth_by[j] * k[j, i]
                third[i] += third_by[j] * k[j, i]
        fifth_sum = third_sum = 0.0
        for i in range(72):
            scale = tolerance * (1.0 + max(abs(y[i]), abs(after[i])))
            fifth_sum += (fifth[i] / scale) ** 2
            third_sum += (third[i] / scale) ** 2
        error = h * fifth_sum / np.sqrt(72 * (fifth_sum + 0.01 * third_sum)) if fifth_sum > 0.0 else 0.0
        if error < 1.0:
            t += h
            y[:] = after
            k[0] = k[stages]
            growth = 10.0 if error == 0.0 else min(10.0, 0.9 * error**-0.125)
            h *= min(1.0, growth) if rejected else growth
            rejected = False
        else:
            h *= max(0.2, 0.9 * error**-0.125)
            rejected = True
    return y


@njit(fastmath=True, error_model="numpy")
def _transition_fixed(point: Array, duration: float, steps: int, arm: Array, a: Array, b: Array) -> Array:
    """As many equal steps of DOP853, without an estimate of the error."""
    stages = len(b)
    y = np.zeros(72)
    y[:8] = point
    for i in range(8):
        y[8 + 9 * i] = 1.0
    k = np.zeros((stages, 72))
    d = np.zeros((8, 8))
    stage = np.zeros(72)
    h = duration / steps
    for _ in range(steps):
        _slope(y, k[0], d, arm)
        for s in range(1, stages):
            stage[:] = y
            for j in range(s):
                if a[s, j] != 0.0:
                    by = h * a[s, j]
                    for i in range(72):
                        stage[i] += by * k[j, i]
            _slope(stage, k[s], d, arm)
        for j in range(stages):
            if b[j] != 0.0:
                by = h * b[j]
                for i in range(72):
                    y[i] += by * k[j, i]
    return y


def _arm(case: Case = THESIS) -> Array:
    (m1, m2), (l1, l2) = case.masses, case.lengths
    small = m2 * l2**2 / 3
    return np.array([(m1 / 3 + m2) * l1**2 + small, m2 * l1 * l2 / 2, small, *case.damping, 1.0, 0.5])


def _transitions(points: Array, tolerance: float, repeats: int = 1) -> Array:
    stages, arm = DOP853.n_stages, _arm()
    rest = (arm, np.ascontiguousarray(DOP853.A[:stages, :stages]), DOP853.B, DOP853.E5, DOP853.E3)
    for _ in range(repeats):
        found = [_transition(point, AVERAGING, tolerance, *rest) for point in points]
    return np.array([y[8:].reshape(8, 8) for y in found])


def _transitions_fixed(points: Array, steps: float, repeats: int = 1) -> Array:
    stages = DOP853.n_stages
    rest = (_arm(), np.ascontiguousarray(DOP853.A[:stages, :stages]), DOP853.B)
    for _ in range(repeats):
        found = [_transition_fixed(point, AVERAGING, round(steps), *rest) for point in points]
    return np.array([y[8:].reshape(8, 8) for y in found])


def _worst_column(found: Array, exact: Array) -> float:
    """The largest error of a column relative to its length."""
    return float(np.max(np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)))


def _clouds(repetitions: int) -> tuple[list[dict[str, object]], str]:
    command = [str(program("somersault-ftla", "arm")), "cloud", str(POINTS), str(REPEATS)]
    printed = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    points = np.array(printed["points"])
    ours = np.array(printed["matrices"]).reshape(-1, 8, 8).transpose(0, 2, 1)
    exact = _transitions(points, 1e-13)
    error = _worst_column(ours, exact)
    finer = [TOLERANCE * 10 ** (-k / 4) for k in range(13)]
    alike = next((t for t in finer if _worst_column(_transitions(points, t), exact) <= error), finer[-1])
    errors = {"somersault": error}
    runs: dict[str, Callable[[], object]] = {
        "somersault": lambda: subprocess.run(command, check=True, capture_output=True)
    }
    for name, tolerance in (("numba", TOLERANCE), (f"numba at {alike:.1e}, as accurate", alike)):
        errors[name] = _worst_column(_transitions(points, tolerance), exact)
        runs[name] = partial(_transitions, points, tolerance, REPEATS)
    tuned = coarsest(FIXED_STEPS, lambda n: _worst_column(_transitions_fixed(points, n), exact), error)
    if tuned is not None:
        steps, reached = tuned
        name = f"numba, {round(steps)} fixed steps, as accurate"
        errors[name], runs[name] = reached, partial(_transitions_fixed, points, steps, REPEATS)
    times = interleaved(runs, repetitions, clock)
    rates = {name: POINTS * REPEATS / seconds for name, seconds in times.items()}
    rows: list[dict[str, object]] = [
        {"name": f"transition matrices, {name}", "points_per_second": rates[name], "error": errors[name]}
        for name in rates
    ]
    text = table(
        ["", "points / s", "somersault is faster by", "largest error of a column"],
        [
            [name, f"{rate:.4g}", f"{rates['somersault'] / rate:.3g}", f"{errors[name]:.1e}"]
            for name, rate in rates.items()
        ],
    )
    head = (
        f"### Transition matrices over {AVERAGING} s, tolerance {TOLERANCE:g}\n\n"
        f"{POINTS} points within 1e-4 of the optimal p(0), one core, processor time, printing included; "
        "errors against DOP853 at 1e-13.\n\n"
    )
    return rows, head + text


# --------------------------------------------------------------------------------------------- cold start


def _cold(repetitions: int) -> tuple[list[dict[str, object]], str]:
    command = [str(program("somersault-ftla", "arm")), "cold", str(COLD_RUNS)]
    alone: list[float] = []

    def ipopt() -> None:
        alone.append(transcribed(True, INTERVALS[0]).seconds)

    times = interleaved(
        {"ours": lambda: subprocess.run(command, check=True, capture_output=True), "ipopt": ipopt},
        max(2, repetitions // 3),
        clock,
    )
    ours, solve = times["ours"] / COLD_RUNS, float(np.median(alone))
    found = {
        "cold start, somersault to 1e-10": ours,
        "cold start, IPOPT to 1e-6, the solve alone": solve,
        "cold start, IPOPT to 1e-6, with set-up": times["ipopt"],
    }
    rows: list[dict[str, object]] = [{"name": name, "seconds": seconds} for name, seconds in found.items()]
    text = table(
        ["", "ms", "time / best"],
        [[name, f"{1e3 * seconds:.3g}", f"{seconds / ours:.3g}"] for name, seconds in found.items()],
    )
    head = (
        "### Cold start of the thesis' arm\n\nFrom boundary states and fold to every defect below 1e-10, "
        f"beside collocation with {INTERVALS[0]} intervals from a folded guess. Processor time of all cores."
        "\n\n"
    )
    return rows, head + text


# ------------------------------------------------------------------------------------------ arms at random


def _case(problem: dict[str, Any]) -> Case:
    masses, lengths, damping = (tuple(problem[key]) for key in ("masses", "lengths", "damping"))
    return Case(masses, lengths, damping, problem["travel"], problem["horizon"], problem["fold"])


def _defect(problem: dict[str, Any]) -> float:
    """Of nodes of this library, by SciPy between them, with the boundary states."""
    case, nodes = _case(problem), np.array(problem["nodes"])
    arm, d, h = _arm(case), np.zeros((8, 8)), np.zeros(8)

    def field(_: float, p: Array) -> Array:
        _linearize(p, h, d, arm)
        return h.copy()

    defect = max(np.abs(nodes[0, :4] - case.end(-1)).max(), np.abs(nodes[-1, :4] - case.end(1)).max())
    for (begin, end), p, then in zip(
        zip(problem["times"][:-1], problem["times"][1:], strict=True), nodes[:-1], nodes[1:], strict=True
    ):
        last = solve_ivp(field, (begin, end), p, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        defect = max(defect, np.abs(last - then).max())
    return float(defect)


def _collocated(problem: dict[str, Any]) -> tuple[bool, bool, float, float]:
    """Whether IPOPT reports success, whether another mesh agrees with the cost, that cost, and the time."""
    began = time.process_time()
    costs = [transcribed(True, n, _case(problem)).cost for n in INTERVALS]
    agrees = abs(costs[1] - costs[0]) <= CONFIRMED * abs(costs[1])
    return not np.isnan(costs[1]), bool(agrees), costs[1], time.process_time() - began


def _random(count: int) -> tuple[list[dict[str, object]], str]:
    command = [str(program("somersault-ftla", "random_arms")), str(count)]
    before = clock()
    problems = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    ours = clock() - before
    claimed = [problem for problem in problems if problem["claimed"]]
    solved = [problem for problem in claimed if _defect(problem) <= SOLVED]
    theirs = [_collocated(problem) for problem in problems]
    success, agreed = sum(row[0] for row in theirs), sum(row[1] for row in theirs)
    seconds = sum(row[3] for row in theirs)
    cheaper = sum(
        row[1] and problem["claimed"] and problem["cost"] <= row[2] * (1 + CONFIRMED)
        for row, problem in zip(theirs, problems, strict=True)
    )
    rows: list[dict[str, object]] = [
        {
            "name": "arms at random, somersault",
            "solved": len(solved),
            "claimed": len(claimed),
            "seconds": ours,
        },
        {"name": "arms at random, IPOPT", "solved": agreed, "claimed": success, "seconds": seconds},
    ]
    text = table(
        ["", "solved", "claimed", "s"],
        [
            ["somersault", f"{len(solved)} of {count}", f"{len(claimed)}", f"{ours:.3g}"],
            ["CasADi + IPOPT", f"{agreed} of {count}", f"{success}", f"{seconds:.3g}"],
        ],
    )
    head = (
        "### Two-link arms at random\n\nMasses, lengths and friction within ±50 % of Table 8.1, travel π/2 "
        "to 2π, horizon 6 to 20 s, both folds. Solved: for this library every defect below "
        f"{SOLVED:g} by SciPy's DOP853 between nodes; for collocation a cost that {INTERVALS[0]} and "
        f"{INTERVALS[1]} intervals agree on to {CONFIRMED:g}. Of those that IPOPT solves, this library's "
        f"extremal costs no more in {cheaper}. "
        "Processor time.\n\n"
    )
    return rows, head + text


def compare(repetitions: int, count: int = 50) -> tuple[list[dict[str, object]], str]:
    """All three."""
    parts = [_clouds(repetitions), _cold(repetitions), _random(count)]
    rows = [row for part in parts for row in part[0]]
    return rows, "\n\n".join(
        ["## Finite-time Lyapunov analysis of the two-link arm", *(part[1] for part in parts)]
    )
