"""Programs of 20 000 variables beside CasADi with IPOPT: a bar in torsion, a pendulum that is driven upright.

By itself: `python benches/peers/programs.py`, with the extra `bench` installed.
"""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from somersault import nlp

#: Nodes of the bar along a side, and its load.
SIDE, LOAD = 141, 5.0
#: Intervals of the pendulum, its time and its strongest torque.
INTERVALS, TIME, TORQUE = 6666, 8.0, 0.6


def _limits() -> np.ndarray:
    """How much of the bar is plastic: the distance to the edge."""
    edge = np.minimum(np.arange(SIDE) + 1, SIDE - np.arange(SIDE)) / (SIDE + 1)
    return np.minimum(edge[:, None], edge[None, :]).ravel()


def torsion() -> nlp.MinimizeResult:
    line = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(SIDE, SIDE))
    unit = sparse.eye_array(SIDE)
    stencil = (sparse.kron(line, unit) + sparse.kron(unit, line)).tocsc()
    force = LOAD / (SIDE + 1) ** 2
    return nlp.minimize(
        lambda x: float(x @ (0.5 * (stencil @ x) - force)),
        np.zeros(SIDE * SIDE),
        jac=lambda x: stencil @ x - force,
        hess=lambda x: stencil,
        bounds=SimpleNamespace(lb=-_limits(), ub=_limits()),
    )


def torsion_by_ipopt() -> dict[str, Any]:
    x = ca.SX.sym("x", SIDE * SIDE)
    z = ca.SX.zeros(SIDE + 2, SIDE + 2)
    z[1:-1, 1:-1] = ca.reshape(x, SIDE, SIDE)
    slopes = ca.sumsqr(z[1:, :] - z[:-1, :]) + ca.sumsqr(z[:, 1:] - z[:, :-1])
    cost = 0.5 * slopes - LOAD / (SIDE + 1) ** 2 * ca.sum1(x)
    return _ipopt({"x": x, "f": cost}, x0=0.0, lbx=-_limits(), ubx=_limits())


def pendulum() -> nlp.MinimizeResult:
    """θ″ = −sin θ + u by the trapezoidal rule, from hanging to upright, least ½ ∫ u².

    Variables are θ, ω and u in turn.
    """
    n, h = INTERVALS + 1, TIME / INTERVALS
    angle, rate, torque = (np.arange(n) * 3 + k for k in range(3))
    weight = np.full(n, h)
    weight[[0, -1]] = 0.5 * h
    k = np.arange(INTERVALS)
    ones = np.ones(INTERVALS)
    rows = np.concatenate([k, k, k, k, *[INTERVALS + k] * 6])
    ends = [angle[1:], angle[:-1], rate[1:], rate[:-1], rate[1:], rate[:-1]]
    columns = np.concatenate([*ends, angle[1:], angle[:-1], torque[1:], torque[:-1]])
    fixed = np.concatenate([ones, -ones, -0.5 * h * ones, -0.5 * h * ones, ones, -ones])

    def defects(x: np.ndarray) -> np.ndarray:
        force = x[torque] - np.sin(x[angle])
        turned = x[angle[1:]] - x[angle[:-1]] - 0.5 * h * (x[rate[1:]] + x[rate[:-1]])
        return np.concatenate([turned, x[rate[1:]] - x[rate[:-1]] - 0.5 * h * (force[1:] + force[:-1])])

    def jacobian(x: np.ndarray) -> Any:
        bend = 0.5 * h * np.cos(x[angle])
        values = np.concatenate([fixed, bend[1:], bend[:-1], -0.5 * h * ones, -0.5 * h * ones])
        return sparse.csc_array((values, (rows, columns)), shape=(2 * INTERVALS, 3 * n))

    def hessian(x: np.ndarray, y: np.ndarray) -> Any:
        pull = np.zeros(n)
        pull[1:] += y[INTERVALS:]
        pull[:-1] += y[INTERVALS:]
        diagonal = -0.5 * h * np.sin(x[angle]) * pull
        return sparse.csc_array((diagonal, (angle, angle)), shape=(3 * n, 3 * n))

    squares = sparse.csc_array((weight, (torque, torque)), shape=(3 * n, 3 * n))

    def slope(x: np.ndarray) -> np.ndarray:
        return np.asarray(squares @ x)

    lower, upper, start = _pendulum_bounds()
    return nlp.minimize(
        lambda x: float(0.5 * weight @ x[torque] ** 2),
        start,
        jac=slope,
        hess=lambda x: squares,
        bounds=SimpleNamespace(lb=lower, ub=upper),
        constraints=SimpleNamespace(fun=defects, jac=jacobian, hess=hessian, lb=0.0, ub=0.0, name="defects"),
    )


def _pendulum_bounds() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n = INTERVALS + 1
    lower, upper = np.full((n, 3), -np.inf), np.full((n, 3), np.inf)
    lower[:, 2], upper[:, 2] = -TORQUE, TORQUE
    lower[0, :2] = upper[0, :2] = 0.0
    lower[-1, :2] = upper[-1, :2] = np.pi, 0.0
    start = np.zeros((n, 3))
    start[:, 0] = np.linspace(0.0, np.pi, n)
    return lower.ravel(), upper.ravel(), start.ravel()


def pendulum_by_ipopt() -> dict[str, Any]:
    n, h = INTERVALS + 1, TIME / INTERVALS
    x = ca.MX.sym("x", 3, n)
    force = x[2, :] - ca.sin(x[0, :])
    turned = x[0, 1:] - x[0, :-1] - 0.5 * h * (x[1, 1:] + x[1, :-1])
    driven = x[1, 1:] - x[1, :-1] - 0.5 * h * (force[1:] + force[:-1])
    weight = np.full((1, n), h)
    weight[0, [0, -1]] = 0.5 * h
    cost = 0.5 * ca.sum2(ca.DM(weight) * x[2, :] ** 2)
    lower, upper, start = _pendulum_bounds()
    program = {"x": ca.vec(x), "f": cost, "g": ca.vertcat(turned.T, driven.T)}
    return _ipopt(program, x0=start, lbx=lower, ubx=upper, lbg=0.0, ubg=0.0)


def _ipopt(program: dict[str, Any], **arguments: Any) -> dict[str, Any]:
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
    solver = ca.nlpsol("solver", "ipopt", program, options)
    began = time.process_time()
    found = solver(**arguments)
    solve = time.process_time() - began
    stats = solver.stats()
    return {
        "status": stats["return_status"],
        "nit": stats["iter_count"],
        "fun": float(found["f"]),
        "solve": solve,
    }


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Processor time, the least of some runs."""
    rows: list[dict[str, object]] = []
    lines = [
        "## Programs of 20 000 variables",
        "Exact second derivatives on both sides; ours in NumPy and SciPy, CasADi's from its graphs. "
        "Processor time in seconds, the least of three runs; IPOPT's own without and with the set-up of the "
        "graphs.",
        "",
        "| program | somersault | steps | IPOPT | with set-up | steps | costs |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, ours, peer in (
        ("bar in torsion, 19 881 bounds", torsion, torsion_by_ipopt),
        ("pendulum, 13 332 equations", pendulum, pendulum_by_ipopt),
    ):
        own, whole, solve = [], [], []
        for _ in range(min(repetitions, 3)):
            began = time.process_time()
            found = ours()
            own.append(time.process_time() - began)
            began = time.process_time()
            other = peer()
            whole.append(time.process_time() - began)
            solve.append(other["solve"])
        if not found.success or other["status"] != "Solve_Succeeded":
            raise RuntimeError(f"{name}: {found!r}, {other}")
        row = {
            "name": name,
            "seconds": min(own),
            "steps": found.nit,
            "ipopt": min(solve),
            "ipopt_with_setup": min(whole),
            "ipopt_steps": other["nit"],
            "costs": (found.fun, other["fun"]),
        }
        rows.append(row)
        lines.append(
            f"| {name} | {min(own):.2f} | {found.nit} | {min(solve):.2f} | {min(whole):.2f} "
            f"| {other['nit']} | {found.fun:.9g}, {other['fun']:.9g} |"
        )
    return rows, "\n".join(lines)


if __name__ == "__main__":
    print(compare(3)[1])
