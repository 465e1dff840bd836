"""Optimal control problems beside CasADi with IPOPT, from posing them to their answers.

The problem set of the tests, and nine hyper-sensitive problems. CasADi evaluates the same Python functions,
on a uniform mesh of intervals with three Radau points: of as many points as this library's last mesh, and of
so many intervals as it takes to come as near to the known cost as was requested. By itself:
`python benches/peers/control.py [name ...]`, with the extra `bench` installed.
"""

from __future__ import annotations

import inspect
import math
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from measure import table

from somersault import ocp

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "python"))
from control_problems import KNOWN

# the functions are those of NumPy
warnings.filterwarnings("ignore", message="\\ncasadi: a numpy function", category=FutureWarning)

DEGREE = 3
#: Whether IPOPT evaluates one graph of scalars; a mapped function is quicker on these.
SCALARS = False
#: Relative error of the cost at which a solution counts: the tolerance of `solve`.
TARGET = 1e-6
#: Intervals that are tried until the target is met.
INTERVALS = (10, 20, 40, 80, 160, 320)
#: Seconds of one solve of IPOPT.
LIMIT = 10.0
RUNS = 3
"""Of each, in turns; the least time counts."""


# ---------------------------------------------------------------------------------- hyper-sensitive problems


def _regulated(
    rates: Callable[..., Any],
    initial: list[float],
    final: list[float],
    duration: float,
    limit: float | None = None,
) -> ocp.ControlProblem:
    """From a state to another with ½ ∫ |x|² + |u|², in a time that is long beside those of the motion."""
    n_controls = {2: 1, 3: 2, 4: 1, 6: 3}[len(initial)]
    return ocp.ControlProblem(
        rates,
        len(initial),
        n_controls,
        initial=initial,
        final=final,
        duration=duration,
        bounds={} if limit is None else {f"u{k}": (-limit, limit) for k in range(n_controls)},
        running_cost=lambda x, u: (
            0.5 * (sum(x[k] ** 2 for k in range(len(initial))) + sum(u[k] ** 2 for k in range(n_controls)))
        ),
    )


def _spring(x: Any, u: Any) -> list[Any]:
    return [x[1], u[0] - x[0] - 0.1 * x[1]]


def _stiffening(x: Any, u: Any) -> list[Any]:
    return [x[1], u[0] - x[0] - x[0] ** 3]


def _two_masses(x: Any, u: Any) -> list[Any]:
    return [x[2], x[3], u[0] - x[0] - (x[0] - x[1]), x[0] - x[1]]


def _van_der_pol(x: Any, u: Any) -> list[Any]:
    return [x[1], u[0] - x[0] + x[1] * (1 - x[0] ** 2)]


def _spacecraft(x: Any, u: Any) -> list[Any]:
    """Modified Rodrigues parameters and spins, moments of inertia 1, 2 and 2.5."""
    s, w = [x[k] for k in range(3)], [x[3 + k] for k in range(3)]
    square = s[0] ** 2 + s[1] ** 2 + s[2] ** 2
    along = s[0] * w[0] + s[1] * w[1] + s[2] * w[2]
    cross = [s[1] * w[2] - s[2] * w[1], s[2] * w[0] - s[0] * w[2], s[0] * w[1] - s[1] * w[0]]
    turned = [0.25 * ((1 - square) * w[k] + 2 * cross[k] + 2 * along * s[k]) for k in range(3)]
    return [
        *turned,
        u[0] - 0.5 * w[1] * w[2],
        (u[1] + 1.5 * w[2] * w[0]) / 2,
        (u[2] - w[0] * w[1]) / 2.5,
    ]


def _orbit(x: Any, u: Any) -> list[Any]:
    """About a circular orbit of radius 1: height, radial speed, and tangential speed in excess."""
    r, v = 1 + x[0], 1 + x[2]
    return [x[1], v**2 / r - 1 / r**2 + u[0], -x[1] * v / r + u[1]]


HYPER_SENSITIVE: dict[str, Callable[[], ocp.ControlProblem]] = {
    "spring–mass": lambda: _regulated(_spring, [1, 0], [0.5, 0], 40),
    "stiffening spring": lambda: _regulated(_stiffening, [1, 0], [1.5, 0], 40),
    "two masses": lambda: _regulated(_two_masses, [1, 1, 0, 0], [0, 1, 0, 0], 60),
    "van der Pol, long": lambda: _regulated(_van_der_pol, [1, 0], [-1, 0], 40),
    "van der Pol, longer": lambda: _regulated(_van_der_pol, [1, 0], [-1, 0], 200),
    "spacecraft": lambda: _regulated(_spacecraft, [0.5, -0.3, 0.2, 0, 0, 0], [-0.2, 0.1, 0.4, 0, 0, 0], 60),
    "orbit": lambda: _regulated(_orbit, [0.2, 0, -0.1], [-0.1, 0, 0.05], 60),
    "spring–mass within limits": lambda: _regulated(_spring, [1, 0], [0.5, 0], 40, 0.3),
    "spacecraft within limits": lambda: _regulated(
        _spacecraft, [0.5, -0.3, 0.2, 0, 0, 0], [-0.2, 0.1, 0.4, 0, 0, 0], 60, 0.1
    ),
}


# ------------------------------------------------------------------------------------------ CasADi and IPOPT


class Entries:
    """Symbols by position and by name."""

    def __init__(self, symbols: Any, names: list[str]) -> None:
        self._symbols, self._names = symbols, names

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice):
            return np.array(ca.vertsplit(self._symbols))[key]
        return self._symbols[key]

    def __getattr__(self, name: str) -> Any:
        return self._symbols[self._names.index(name)]

    def __len__(self) -> int:
        return len(self._names)

    def __iter__(self) -> Any:
        return iter(ca.vertsplit(self._symbols))

    def __matmul__(self, other: Entries) -> Any:
        return ca.dot(self._symbols, other._symbols)


def _called(function: Callable[..., Any], *arguments: Any) -> Any:
    """With as many arguments as it takes."""
    found = function(*arguments[: len(inspect.signature(function).parameters)])
    return ca.vertcat(*found) if isinstance(found, list) else found


def _rods(x: Any, torques: list[Any]) -> Any:
    """The chain of rods of the problem set; CasADi's symbols do not go through `np.linalg`."""
    n = x.shape[0] // 2
    mass, force = ca.SX.zeros(n, n), ca.SX.zeros(n)
    for i in range(n):
        force[i] = torques[i] - (torques[i + 1] if i + 1 < n else 0) - 9.81 * (n - 0.5 - i) * ca.sin(x[i])
        for j in range(n):
            both = (1 / 3 if i == j else 0.5) + n - 1 - max(i, j)
            mass[i, j] = both * ca.cos(x[i] - x[j])
            force[i] -= both * ca.sin(x[i] - x[j]) * x[n + j] ** 2
    return ca.vertcat(x[n:], ca.solve(mass, force))


def _pairs(given: Any, names: list[str]) -> list[tuple[float, float]]:
    """Bounds by names or in their order."""
    if given is None:
        given = {}
    elif not isinstance(given, Mapping):
        given = dict(zip(names, given, strict=True))

    def pair(value: Any) -> tuple[float, float]:
        if value is None:
            return -math.inf, math.inf
        low, high = value if isinstance(value, tuple) else (value, value)
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    return [pair(given.get(name)) for name in names]


@dataclass
class Transcribed:
    """What IPOPT finds."""

    cost: float
    status: str
    steps: int


def transcribed(
    posed: Mapping[str, Any], names: tuple[list[str], list[str]], guess: Any, intervals: int
) -> Transcribed:
    """The same problem, from the same start, on a uniform mesh."""
    states, controls = names
    n, m, count = len(states), len(controls), intervals * DEGREE
    x, u, t = ca.SX.sym("x", n), ca.SX.sym("u", m), ca.SX.sym("t")
    dynamics = posed["dynamics"]
    at = Entries(x, states), Entries(u, controls), t
    if "_rods" in dynamics.__code__.co_names:
        rates = _rods(x, [0, u[0]] if m == 1 else list(ca.vertsplit(u)))
    else:
        rates = _called(dynamics, *at)
    running = 0 if posed["running_cost"] is None else _called(posed["running_cost"], *at)
    path = [(_called(g, *at), low, high) for g, low, high in posed["path"]]
    f = ca.Function("f", [x, u, t], [rates, running, ca.vertcat(*(g for g, *_ in path))])
    points = ca.collocation_points(DEGREE, "radau")
    by, _, weights = ca.collocation_coeff(points)
    X, U, T = ca.MX.sym("X", n, count + 1), ca.MX.sym("U", m, count), ca.MX.sym("T")
    times = ((np.arange(intervals)[:, None] + np.array(points)) / intervals).ravel()
    F, L, G = f.map(count)(X[:, 1:], U, T * ca.DM(times).T)
    h = T / intervals
    defects = [
        ca.vec(X[:, k * DEGREE : (k + 1) * DEGREE + 1] @ by - h * F[:, k * DEGREE : (k + 1) * DEGREE])
        for k in range(intervals)
    ]
    cost = (
        h * ca.sum2(L * ca.repmat(ca.DM(weights).T, 1, intervals)) if posed["running_cost"] is not None else 0
    )
    last = Entries(X[:, -1], states)
    if posed["end_cost"] is not None:
        cost += _called(posed["end_cost"], last, T)
    ends = [(_called(b, Entries(X[:, 0], states), last, 0.0, T), low, high) for b, low, high in posed["ends"]]
    rows = [ca.vertcat(*defects), ca.vec(G), *(b for b, *_ in ends)]
    held = [(-math.inf if low is None else low, math.inf if high is None else high) for _, low, high in path]
    lower = np.concatenate(
        [np.zeros(count * n), np.tile([low for low, _ in held], count), [low for _, low, _ in ends]]
    )
    upper = np.concatenate(
        [np.zeros(count * n), np.tile([high for _, high in held], count), [high for *_, high in ends]]
    )
    duration = posed["duration"] if isinstance(posed["duration"], tuple) else (posed["duration"],) * 2
    ranges = _pairs(posed["bounds"], states + controls)
    first, final = _pairs(posed["initial"], states), _pairs(posed["final"], states)
    bounds = np.array([ranges[:n]] * (count + 1), dtype=float)
    for k, given in ((0, first), (-1, final)):
        bounds[k, :, 0] = np.maximum(bounds[k, :, 0], [low for low, _ in given])
        bounds[k, :, 1] = np.minimum(bounds[k, :, 1], [high for _, high in given])
    limits = np.array([ranges[n:]] * count, dtype=float).reshape(-1, 2)
    low, high = (np.concatenate([bounds[:, :, k].ravel(), limits[:, k], [duration[k]]]) for k in (0, 1))
    start = _start(guess, states, controls, first, final, ranges, duration, np.append(0.0, times))
    program = {"x": ca.vertcat(ca.vec(X), ca.vec(U), T), "f": cost, "g": ca.vertcat(*rows)}
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "expand": SCALARS}
    options["ipopt.max_cpu_time"] = LIMIT
    solver = ca.nlpsol("solver", "ipopt", program, options)
    found = solver(x0=start, lbx=low, ubx=high, lbg=lower, ubg=upper)
    stats = solver.stats()
    return Transcribed(float(found["f"]), stats["return_status"], stats["iter_count"])


def _start(
    guess: Any,
    states: list[str],
    controls: list[str],
    first: list[tuple[float, float]],
    final: list[tuple[float, float]],
    ranges: list[tuple[float, float]],
    duration: tuple[float, float],
    fractions: np.ndarray,
) -> np.ndarray:
    """The guess, and a straight line between the ends for what it does not name."""
    guess = guess or {}
    count = max((len(row) for row in guess.values()), default=2)
    knots = np.asarray(guess.get("t", np.linspace(0.0, 1.0, count)), dtype=float)
    end = knots[-1] if "t" in guess else sum(duration) / 2
    columns = []
    for k, name in enumerate(states):
        ends = [next((v for v in pair if math.isfinite(v)), None) for pair in (first[k], final[k])]
        known = [v for v in ends if v is not None] or [0.0]
        line = [ends[0] if ends[0] is not None else known[0], ends[1] if ends[1] is not None else known[-1]]
        given = guess.get(name)
        columns.append(
            np.interp(fractions, [0.0, 1.0], np.clip(line, *ranges[k]))
            if given is None
            else np.interp(fractions, knots / knots[-1], given)
        )
    pushes = [
        np.interp(fractions[1:], knots / knots[-1], guess[name])
        if name in guess
        else np.full(len(fractions) - 1, np.clip(0.0, *ranges[len(states) + k]))
        for k, name in enumerate(controls)
    ]
    return np.concatenate([np.transpose(columns).ravel(), np.transpose(pushes).ravel(), [end]])


# ------------------------------------------------------------------------------------------------ comparison


@dataclass
class Case:
    """A problem, and where the searches start."""

    name: str
    pose: Callable[[], ocp.ControlProblem]
    cost: float
    guess: Any = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def error(self, cost: float) -> float:
        return abs(cost - self.cost) / max(1.0, abs(self.cost))

    def ours(self) -> ocp.CollocationResult:
        return self.pose().solve(self.guess, **self.options)

    def theirs(self, intervals: int) -> Transcribed:
        problem = self.pose()
        posed = problem.__reduce__()[0].keywords
        return transcribed(posed, (problem.state_names, problem.control_names), self.guess, intervals)


def cases() -> list[Case]:
    """The set, and the hyper-sensitive ones, whose costs are those to ten digits."""
    everything = [
        Case(name, known.pose, known.cost, known.guess, known.options)
        for name, known in KNOWN.items()
        if not known.is_long
    ]
    for name, pose in HYPER_SENSITIVE.items():
        accurate = pose().solve(tol=1e-10)
        if not accurate.success:
            raise RuntimeError(f"{name}: {accurate.message}")
        everything.append(Case(name, pose, accurate.cost))
    return everything


def _seconds(run: Callable[[], Any]) -> float:
    began = time.process_time()
    run()
    return time.process_time() - began


def measured(case: Case) -> dict[str, Any]:
    """One problem both ways."""
    found = case.ours()
    if not found.success:
        raise RuntimeError(f"{case.name}: {found.message}")
    target = max(TARGET, case.options.get("tol", TARGET))
    same = max(2, round(found.meshes[-1]["n_points"] / DEGREE))
    alike = case.theirs(same)
    enough = None
    for intervals in INTERVALS:
        tried = case.theirs(intervals)
        if tried.status == "Solve_Succeeded" and case.error(tried.cost) <= target:
            enough = intervals
            break
        if tried.status == "Maximum_CpuTime_Exceeded":
            break
    runs: dict[str, Callable[[], Any]] = {"ours": case.ours, "same": lambda: case.theirs(same)}
    if enough is not None:
        runs["enough"] = lambda: case.theirs(enough)
    least = dict.fromkeys(runs, math.inf)
    for _ in range(RUNS):
        for name, run in runs.items():
            least[name] = min(least[name], _seconds(run))
    return {
        "name": case.name,
        "error": case.error(found.cost),
        "points": found.meshes[-1]["n_points"],
        "seconds": least["ours"],
        "same_intervals": same,
        "same_error": case.error(alike.cost) if alike.status == "Solve_Succeeded" else math.nan,
        "same_status": alike.status,
        "same_seconds": least["same"],
        "enough_intervals": enough,
        "enough_seconds": least.get("enough"),
    }


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Processor times, the least of a few runs in turns."""
    rows: list[dict[str, Any]] = [measured(case) for case in cases()]
    return rows, text(rows)


def text(rows: list[dict[str, Any]]) -> str:
    lines = []
    for row in rows:
        enough = row["enough_intervals"]
        lines.append(
            [
                row["name"],
                f"{row['seconds'] * 1e3:.1f}",
                f"{row['error']:.0e}",
                f"{row['same_seconds'] * 1e3:.1f}",
                row["same_status"] if math.isnan(row["same_error"]) else f"{row['same_error']:.0e}",
                f"{row['same_seconds'] / row['seconds']:.2f}",
                "not reached" if enough is None else f"{enough}",
                "" if enough is None else f"{row['enough_seconds'] * 1e3:.1f}",
                "" if enough is None else f"{row['enough_seconds'] / row['seconds']:.2f}",
            ]
        )
    header = ["problem", "ours, ms", "error", "IPOPT, as many points, ms", "error or status", "IPOPT / ours"]
    header += ["intervals to the target", "ms", "IPOPT / ours"]
    return (
        "## Optimal control problems, from posing them to the answer\n\n"
        "Ours refines its mesh to 10⁻⁶ and integrates the motion again; CasADi's has three Radau points on"
        f" equal intervals, up to {INTERVALS[-1]}, until the cost is right to 10⁻⁶. Errors of the cost,"
        " relative to the larger of it and one. Processor time, the least of"
        f" {RUNS} runs in turns.\n\n" + table(header, lines)
    )


if __name__ == "__main__":
    chosen = sys.argv[1:]
    found = []
    for case in cases():
        if not chosen or any(name in case.name for name in chosen):
            found.append(measured(case))
            print({key: value for key, value in found[-1].items()}, flush=True)
    print(text(found))
