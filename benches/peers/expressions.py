"""Traced functions: values, Jacobian and Hessian of equations of motion, beside CasADi's graph and its C.

Both evaluate the same thousand points on one core without the interpreter, CasADi by a mapped function. The
example `evaluation` of somersault-expr has the same equations in Rust. Nanoseconds per point, the least of
several runs.
"""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from measure import program, table

POINTS = 1000


def _goddard(x: Any, u: Any) -> list[Any]:
    r, v, m = x[0], x[1], x[2]
    drag = 310.0 * v * v * ca.exp(-500.0 * (r - 1.0))
    return [v, (3.5 * u[0] - drag) / m - 1.0 / (r * r), -7.0 * u[0]]


def _cart_pendulum(x: Any, u: Any) -> list[Any]:
    s, c = ca.sin(x[1]), ca.cos(x[1])
    total = 1.0 + 0.3 * (1.0 - c * c)
    a = (u[0] + 0.3 * s * (0.5 * x[3] * x[3] + 9.81 * c)) / total
    b = -(u[0] * c + 0.15 * x[3] * x[3] * s * c + 1.3 * 9.81 * s) / (0.5 * total)
    return [x[2], x[3], a, b]


def _spacecraft(x: Any, u: Any) -> list[Any]:
    q, w, inertia = [x[k] for k in range(4)], [x[4 + k] for k in range(3)], (1.0, 2.0, 2.5)
    return [
        -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]),
        0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
        0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]),
        0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]),
        (u[0] + (inertia[1] - inertia[2]) * w[1] * w[2]) / inertia[0],
        (u[1] + (inertia[2] - inertia[0]) * w[2] * w[0]) / inertia[1],
        (u[2] + (inertia[0] - inertia[1]) * w[0] * w[1]) / inertia[2],
    ]


def _chain(x: Any, u: Any) -> list[Any]:
    n = 5
    q, w = [x[k] for k in range(n)], [x[n + k] for k in range(n)]
    rows = []
    for i in range(n):
        row = [(n - max(i, j)) * ca.cos(q[i] - q[j]) if i != j else ca.SX(n - i) for j in range(n)]
        right = u[i] - (n - i) * 9.81 * ca.sin(q[i]) - (u[i + 1] if i + 1 < n else 0.0)
        for j in range(n):
            if i != j:
                right = right - (n - max(i, j)) * ca.sin(q[i] - q[j]) * (w[j] * w[j])
        rows.append([*row, right])
    for k in range(n):
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            for j in range(k + 1, n + 1):
                rows[i][j] = rows[i][j] - factor * rows[k][j]
    found: list[Any] = [None] * n
    for k in reversed(range(n)):
        right = rows[k][n]
        for j in range(k + 1, n):
            right = right - rows[k][j] * found[j]
        found[k] = right / rows[k][k]
    return w + found


EQUATIONS = {
    "Goddard": (_goddard, 3, 1),
    "cart-pendulum": (_cart_pendulum, 4, 1),
    "spacecraft": (_spacecraft, 7, 3),
    "chain of five": (_chain, 10, 5),
}


def _functions() -> dict[str, Any]:
    """Values, entries of the Jacobian and of the Hessian's lower triangle."""
    found = {}
    for name, (equations, states, controls) in EQUATIONS.items():
        x, u = ca.SX.sym("x", states), ca.SX.sym("u", controls)
        f, z = ca.vertcat(*equations(x, u)), ca.vertcat(x, u)
        multipliers = ca.SX.sym("l", f.shape[0])
        hessian = ca.tril(ca.hessian(ca.dot(multipliers, f), z)[0])
        found[f"{name}, values"] = ca.Function("values", [z], [f])
        found[f"{name}, Jacobian"] = ca.Function("jacobian", [z], [ca.jacobian(f, z)])
        found[f"{name}, Hessian"] = ca.Function("hessian", [ca.vertcat(z, multipliers)], [hessian])
    return found


def _compiled(function: Any) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        function.generate("expressions.c")
        source = Path("expressions.c").replace(Path(folder) / "expressions.c")
        library = Path(folder) / "expressions.so"
        subprocess.run(["cc", "-O3", "-fPIC", "-shared", source, "-o", library, "-lm"], check=True)
        return ca.external(function.name(), str(library))


def _nanoseconds(function: Any, repetitions: int) -> float:
    """Per point, of all points in a call without copies."""
    buffer, call = function.map(POINTS).buffer()
    size = function.nnz_in(0)
    points = 1.0 + 0.1 * np.sin(np.arange(POINTS * size, dtype=float))
    values = np.zeros(POINTS * function.nnz_out(0))
    buffer.set_arg(0, memoryview(points))
    buffer.set_res(0, memoryview(values))
    call()
    least = math.inf
    for _ in range(repetitions):
        count, began = 0, time.perf_counter()
        while time.perf_counter() - began < 0.02:
            call()
            count += 1
        least = min(least, (time.perf_counter() - began) / (count * POINTS))
    return least * 1e9


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Each function in all four ways."""
    built = program("somersault-expr", "evaluation")
    ours = subprocess.run([str(built)], check=True, capture_output=True, text=True).stdout
    rows: list[dict[str, Any]] = [json.loads(line) for line in ours.splitlines()]
    functions = _functions()
    for row in rows:
        function = functions[row["name"]]
        row["graph"] = _nanoseconds(function, repetitions)
        row["c"] = _nanoseconds(_compiled(function), repetitions)
        row["one_against_graph"] = row["one"] / row["graph"]
        row["eight_against_graph"] = row["eight"] / row["graph"]
        row["eight_against_c"] = row["eight"] / row["c"]
    lines = [
        [
            row["name"],
            *(f"{row[key]:.0f}" for key in ("one", "eight", "graph", "c")),
            *(f"{row[key]:.2f}" for key in ("one_against_graph", "eight_against_graph", "eight_against_c")),
        ]
        for row in rows
    ]
    header = ["ns per point", "one at a time", "eight", "CasADi's graph", "its C, -O3"]
    return rows, "## Traced functions beside CasADi\n\n" + table(
        [*header, "one / graph", "eight / graph", "eight / C"], lines
    )
