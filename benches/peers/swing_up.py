"""The swing-up of thesis A.2: cost with gradient of case G, and the cases of Table A.1 solved.

CasADi evaluates its scalar graph of cost and gradient itself, or turns it into C, which the system's compiler
optimises. IPOPT solves the same program with exact Hessians, once in the parameters of the cart alone (single
shooting), once with the state of the pendulum at each step as variables (simultaneous). All start from cart
and pendulum on straight lines. Wall time of one run, the least of several. IPOPT's time is without its set-up
(graphs, derivatives, solver), which is listed beside it; this library's time includes its own.
"""

from __future__ import annotations

import math
import subprocess
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from measure import program, table

CASES = {"A": 5, "B": 10, "C": 15, "D": 20, "E": 30, "F": 40, "G": 50}
STEPS, DURATION = 200, 2.0
CART, MASS, GRAVITY, PENALTY = 2.0, 1.0, 9.81, 1e5
START = -1.0
SOLVED = (2, 3)
"""Coefficients that the conditions at the start determine."""


def _basis(n: int) -> Any:
    """(2.14) and two derivatives at all nodes: three matrices, nodes in rows."""
    rate = (n - 5) / DURATION
    weights = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0]
    s = 3.0 + rate * np.linspace(0.0, DURATION, STEPS + 1)[:, None] - np.arange(1, n + 1)[None, :]
    out = []
    for order in range(3):
        power = 5 - order
        terms = (w * np.maximum(s + 3 - k, 0.0) ** power for k, w in enumerate(weights))
        out.append(rate**order * sum(terms) / math.factorial(power))
    # beyond its support a spline is zero but for rounding
    return [np.where(np.abs(s) < 3, b, 0.0) for b in out]


@cache
def _motion(p: int) -> tuple[Any, Any, Any]:
    """r, ṙ and r̈ at all nodes as constants and matrices by parameters, and the straight line."""
    n = p + 2
    basis = _basis(n)
    conditions = np.array([basis[0][0], basis[1][0]])
    free = [k for k in range(n) if k not in SOLVED]
    inverse = np.linalg.inv(conditions[:, SOLVED])
    expansion, offset = np.zeros((n, p)), np.zeros(n)
    expansion[free, np.arange(p)] = 1.0
    expansion[list(SOLVED)] = -inverse @ conditions[:, free]
    offset[list(SOLVED)] = inverse @ np.array([START, 0.0])
    straight = (START - START * np.arange(n) / (n - 1))[free]
    return [b @ offset for b in basis], [ca.sparsify(ca.DM(b @ expansion), 1e-13) for b in basis], straight


def _cart(p: int, z: Any) -> list[Any]:
    offsets, matrices, _ = _motion(p)
    return [matrix @ z + offset for offset, matrix in zip(offsets, matrices, strict=True)]


def _force(angle: Any, rate: Any, push: Any) -> tuple[Any, Any]:
    """θ̈ and F."""
    acceleration = push * ca.cos(angle) + GRAVITY * ca.sin(angle)
    swing = acceleration * ca.cos(angle) - rate**2 * ca.sin(angle)
    return acceleration, (CART + MASS) * push - MASS * swing


def _single(p: int) -> dict[str, Any]:
    z, h = ca.SX.sym("z", p), DURATION / STEPS
    r, speed, push = _cart(p, z)
    angle, rate, cost = ca.SX(math.pi), ca.SX(0.0), ca.SX(0.0)
    for k in range(STEPS):
        acceleration, force = _force(angle, rate, push[k])
        cost += h * force**2 / 2
        angle, rate = angle + h * rate, rate + h * acceleration
    cost += PENALTY / 2 * (angle**2 + rate**2 + r[STEPS] ** 2 + speed[STEPS] ** 2)
    return {"x": z, "f": cost}


def _simultaneous(p: int) -> dict[str, Any]:
    z, h = ca.SX.sym("z", p), DURATION / STEPS
    angle, rate = ca.SX.sym("a", STEPS), ca.SX.sym("v", STEPS)
    r, speed, push = _cart(p, z)
    angles, rates = ca.vertcat(math.pi, angle), ca.vertcat(0.0, rate)
    acceleration, force = _force(angles[:-1], rates[:-1], push[:-1])
    gaps = [angles[1:] - angles[:-1] - h * rates[:-1], rates[1:] - rates[:-1] - h * acceleration]
    cost = h * ca.sumsqr(force) / 2
    cost += PENALTY / 2 * (angle[-1] ** 2 + rate[-1] ** 2 + r[STEPS] ** 2 + speed[STEPS] ** 2)
    return {"x": ca.vertcat(z, angle, rate), "f": cost, "g": ca.vertcat(*gaps)}


def _ipopt(
    posed: Callable[[int], dict[str, Any]], p: int, start: Any, repetitions: int
) -> tuple[float, float, float]:
    """Least seconds of a solve, seconds of set-up, and the cost; NaN where it fails."""
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.max_iter": 3000}
    began = time.perf_counter()
    program = posed(p)
    solver = ca.nlpsol("swing_up", "ipopt", program, options)
    set_up = time.perf_counter() - began
    bounds = {"lbg": 0, "ubg": 0} if "g" in program else {}
    least = math.inf
    for _ in range(repetitions):
        began = time.perf_counter()
        found = solver(x0=start, **bounds)
        least = min(least, time.perf_counter() - began)
    return least, set_up, float(found["f"]) if solver.stats()["success"] else math.nan


def _cost_and_gradient(p: int) -> Any:
    program = _single(p)
    gradient = ca.gradient(program["f"], program["x"])
    return ca.Function("swing_up", [program["x"]], [program["f"], gradient])


def _compiled(function: Any) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        function.generate("swing_up.c")
        source = Path("swing_up.c").replace(Path(folder) / "swing_up.c")
        library = Path(folder) / "swing_up.so"
        subprocess.run(["cc", "-O3", "-fPIC", "-shared", source, "-o", library, "-lm"], check=True)
        return ca.external("swing_up", str(library))


def _call(function: Any, start: Any) -> tuple[Any, Any]:
    """A call of cost and gradient without copies, and where the cost is."""
    buffer, call = function.buffer()
    cost, gradient = np.zeros(1), np.zeros(len(start))
    buffer.set_arg(0, memoryview(start))
    buffer.set_res(0, memoryview(cost))
    buffer.set_res(1, memoryview(gradient))
    # the buffer refers to these and does not own them
    return call, (cost, start, gradient, buffer, function)


def _seconds(call: Any, count: int) -> float:
    began = time.perf_counter()
    for _ in range(count):
        call()
    return (time.perf_counter() - began) / count


def _ours(built: Path, p: int, what: str, runs: int) -> tuple[float, float]:
    command = [str(built), str(p), what, str(runs)]
    cost, seconds = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    return float(seconds), float(cost)


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Cost and gradient of case G, then each case solved."""
    built = program("somersault-ocp", "swing_up")
    start, function = np.array(_motion(50)[2]), _cost_and_gradient(50)
    (compiled, held), (interpreted, _held) = (_call(f, start) for f in (_compiled(function), function))
    compiled()
    ours = generated = graph = math.inf
    for _ in range(repetitions):
        seconds, cost = _ours(built, 50, "evaluate", 5000)
        ours, generated = min(ours, seconds), min(generated, _seconds(compiled, 500))
        graph = min(graph, _seconds(interpreted, 100))
    if not math.isclose(cost, held[0][0], rel_tol=1e-9):
        raise RuntimeError(f"costs at the start differ: {cost} and {held[0][0]}")
    name = "cost and gradient, case G"
    rows: list[dict[str, object]] = [
        {"name": name, "seconds": ours, "casadi": generated, "graph": graph, "ratio": ours / generated}
    ]
    head = (
        "## The swing-up of thesis A.2, Table A.1\n\n"
        "Least wall time of one run; exact Hessians; from cart and pendulum on straight lines. Where minima"
        " differ, so do the costs in brackets.\n\n"
    ) + table(
        ["µs", "somersault", "CasADi, C at -O3", "CasADi, its graph", "ours / C", "ours / graph"],
        [
            [
                name,
                *(f"{t * 1e6:.3g}" for t in (ours, generated, graph)),
                f"{ours / generated:.2f}",
                f"{ours / graph:.3f}",
            ],
        ],
    )
    lines = []
    runs = max(3, repetitions // 3)
    for case, p in CASES.items():
        straight = _motion(p)[2]
        seconds, cost = _ours(built, p, "solve", 10 * runs)
        angles = math.pi * (1 - np.arange(1, STEPS + 1) / STEPS)
        states = np.concatenate([straight, angles, np.zeros(STEPS)])
        single = _ipopt(_single, p, straight, runs)
        simultaneous = _ipopt(_simultaneous, p, states, runs)
        reached = [solved for solved in (single, simultaneous) if not math.isnan(solved[2])]
        least = min((solve for solve, _, _ in reached), default=math.nan)
        with_set_up = min((solve + set_up for solve, set_up, _ in reached), default=math.nan)
        rows.append(
            {
                "name": f"case {case}, solved",
                "seconds": seconds,
                "single": single,
                "simultaneous": simultaneous,
                "cost": cost,
                "ratio": seconds / least,
                "ratio_with_set_up": seconds / with_set_up,
            }
        )
        lines.append(
            [
                f"case {case}",
                f"{seconds * 1e3:.3g} ({cost:.2f})",
                *(f"{t * 1e3:.3g} + {s * 1e3:.3g} ({c:.2f})" for t, s, c in (single, simultaneous)),
                f"{seconds / least:.4f}",
                f"{seconds / with_set_up:.4f}",
            ]
        )
    header = [
        "ms (+ set-up) (cost)", "somersault", "IPOPT, single", "IPOPT, simultaneous", "ours / best solve",
        "ours / best with set-up",
    ]  # fmt: skip
    return rows, head + "\n" + table(header, lines)
