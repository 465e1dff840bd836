"""The spinning top of thesis 7.3.2 over 1 s to 1e-9 rad of the direction of its axis.

Every contender integrates the same equations: a body with a tip on a frictionless spring and damper that
push and never pull. The state is that of `motions`, with the height of the centre of mass and its rate in
front; horizontally nothing happens.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import heyoka
import mujoco
import numpy as np
from compiled import Array
from measure import Contender, geometric, program, race
from numba import njit
from scipy.integrate import solve_ivp

TARGET = 1e-9
DURATION = 1.0
MASS, GRAVITY, LENGTH = 0.2, 9.81, 0.05
ACROSS, ABOUT = 0.817e-4, 1.6e-4
FREQUENCY = 100 * np.pi
STIFFNESS, DAMPING = MASS * FREQUENCY**2, 2 * MASS * FREQUENCY * 0.1
HALF_LEAN = -np.arctan(0.25) / 2
START = np.array([0.05, 0.0, np.cos(HALF_LEAN), np.sin(HALF_LEAN), 0.0, 0.0, 0.0, 0.0, 32 * np.pi])
RUNS = 200
"""Runs of this library's program in one call, so that starting it does not count."""


def axis_of(state: Any) -> Array:
    """The third axis of the body from a state in which the quaternion comes third."""
    w, x, y, z = (float(q) for q in state[2:6])
    axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z])
    return axis / np.linalg.norm(axis)


def angle(a: Array, b: Array) -> float:
    """The angle between two directions, rad."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


# ------------------------------------------------------------------------------------------- equations


def gap_of(y: Any) -> tuple[Any, Any]:
    """Height of the tip over the ground and its rate."""
    w, x, p, z = y[2], y[3], y[4], y[5]
    # The arm of the tip is −l times the axis, whose rate is ω × axis.
    lean = w * w - x * x - p * p + z * z
    fall = 2 * (x * z - w * p) * y[7] - 2 * (p * z + w * x) * y[6]
    return y[0] - LENGTH * lean, y[1] - LENGTH * fall


def force_of(gap: Any, rate: Any) -> Any:
    """The force frozen in contact."""
    return -STIFFNESS * gap - DAMPING * rate


def slope_of(y: Any, force: Any) -> tuple[Any, ...]:
    """The derivative of the state under a vertical force at the tip."""
    w, x, p, z, a, b, c = y[2], y[3], y[4], y[5], y[6], y[7], y[8]
    # The vertical in the body frame, and the torque of the force on the arm −l along the third axis.
    up_x, up_y = 2 * (x * z - w * p), 2 * (p * z + w * x)
    return (
        y[1],
        force / MASS - GRAVITY,
        -0.5 * (x * a + p * b + z * c),
        0.5 * (w * a + p * c - z * b),
        0.5 * (w * b + z * a - x * c),
        0.5 * (w * c + x * b - p * a),
        ((ACROSS - ABOUT) * b * c + LENGTH * up_y * force) / ACROSS,
        ((ABOUT - ACROSS) * c * a - LENGTH * up_x * force) / ACROSS,
        0.0 * a,
    )


_compiled_gap = njit(inline="always")(gap_of)
_compiled_slope = njit(inline="always")(slope_of)


@njit(inline="always")
def _switched(y: Any) -> tuple[float, ...]:
    gap, rate = _compiled_gap(y)
    force = -STIFFNESS * gap - DAMPING * rate
    return _compiled_slope(y, force if gap < 0 and force > 0 else 0.0)


@njit(inline="always")
def _moved(y: Any, h: float, k: Any) -> tuple[float, ...]:
    return (
        y[0] + h * k[0],
        y[1] + h * k[1],
        y[2] + h * k[2],
        y[3] + h * k[3],
        y[4] + h * k[4],
        y[5] + h * k[5],
        y[6] + h * k[6],
        y[7] + h * k[7],
        y[8] + h * k[8],
    )


@njit
def _compiled_rk4(start: Array, steps: int) -> Array:
    h = DURATION / steps
    y = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], start[7], start[8])
    for _ in range(steps):
        k1 = _switched(y)
        y2 = _moved(y, 0.5 * h, k1)
        k2 = _switched(y2)
        y3 = _moved(y, 0.5 * h, k2)
        k3 = _switched(y3)
        y4 = _moved(y, h, k3)
        k4 = _switched(y4)
        y = _moved(_moved(_moved(_moved(y, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4)
    return np.array(y)


# ------------------------------------------------------------------------------------------ contenders


def _ours(program: Path, method: str, stepping: str, setting: float) -> Array:
    size = DURATION / round(setting) if stepping == "fixed" else setting
    command = [str(program), method, stepping, repr(size), str(RUNS)]
    line = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return np.array([float(x) for x in line.split()])


def _numba(steps: float) -> Array:
    return axis_of(_compiled_rk4(START, round(steps)))


def _scipy(tolerance: float) -> Array:
    def slope(_: float, y: Array, held: bool) -> tuple[float, ...]:
        return slope_of(y, force_of(*gap_of(y)) if held else 0.0)

    def touch(_: float, y: Array, __: bool) -> float:
        return float(gap_of(y)[0])

    def release(_: float, y: Array, __: bool) -> float:
        return -float(force_of(*gap_of(y)))

    for event, direction in ((touch, -1), (release, 1)):
        event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
    t, y, held = 0.0, START, False
    while t < DURATION:
        solution = solve_ivp(
            slope,
            (t, DURATION),
            y,
            method="DOP853",
            events=release if held else touch,
            args=(held,),
            rtol=max(tolerance, 2.3e-14),
            atol=tolerance,
        )
        t, y, held = solution.t[-1], solution.y[:, -1], not held
    return axis_of(y)


class _Heyoka:
    """Taylor integrators of flight and contact, each with a terminal event, made once per tolerance."""

    def __init__(self, tolerance: float, wide: bool = False) -> None:
        number = np.longdouble if wide else float
        names = ("height", "climb", "w", "x", "p", "z", "a", "b", "c")
        y = heyoka.make_vars(*names)
        gap, rate = gap_of(y)
        force = force_of(gap, rate)
        self.number = number
        self.modes = [
            heyoka.taylor_adaptive(
                list(zip(y, slope_of(y, push), strict=True)),
                START.astype(number),
                tol=number(tolerance),
                t_events=[heyoka.t_event(function, direction=direction, fp_type=number)],
                fp_type=number,
            )
            for push, function, direction in (
                (heyoka.expression(0.0), gap, heyoka.event_direction.negative),
                (force, -force, heyoka.event_direction.positive),
            )
        ]

    def __call__(self) -> Array:
        t, y, held = self.number(0), START.astype(self.number), False
        while True:
            integrator = self.modes[held]
            integrator.time = t
            integrator.state[:] = y
            integrator.reset_cooldowns()
            outcome = integrator.propagate_until(self.number(DURATION))[0]
            t, y = integrator.time, np.array(integrator.state)
            if outcome == heyoka.taylor_outcome.time_limit:
                return axis_of(y)
            held = not held


@cache
def _heyoka_at(tolerance: float) -> _Heyoka:
    return _Heyoka(tolerance)


def _heyoka(tolerance: float) -> Array:
    return _heyoka_at(tolerance)()


@cache
def _reference() -> Array:
    """By Taylor series in 80-bit arithmetic with events to their last digit."""
    return _Heyoka(1e-18, wide=True)()


def _mujoco(integrator: str) -> Callable[[float], Array]:
    """The same model in MuJoCo: a tip of no size on a plane, `solref` negative for stiffness and damping."""

    @cache
    def model(steps: int) -> mujoco.MjModel:
        law = f'condim="1" solref="{-STIFFNESS} {-DAMPING}" solimp="0.9999 0.9999 0.001"'
        return mujoco.MjModel.from_xml_string(f"""
            <mujoco>
              <option timestep="{DURATION / steps!r}" integrator="{integrator}" gravity="0 0 {-GRAVITY}"
                      iterations="100" tolerance="1e-14"/>
              <worldbody>
                <geom type="plane" size="1 1 1" {law}/>
                <body pos="0 0 0.05" quat="{" ".join(str(float(q)) for q in START[2:6])}">
                  <freejoint/>
                  <inertial pos="0 0 0" mass="{MASS}" diaginertia="{ACROSS} {ACROSS} {ABOUT}"/>
                  <geom type="sphere" size="1e-6" pos="0 0 {-LENGTH}" mass="0" {law}/>
                </body>
              </worldbody>
            </mujoco>
            """)

    def run(steps: float) -> Array:
        made = model(round(steps))
        data = mujoco.MjData(made)
        data.qvel[5] = START[8]
        mujoco.mj_step(made, data, nstep=round(steps))
        return axis_of(np.concatenate([[0.0, 0.0], data.qpos[3:]]))

    return run


def contenders() -> list[Contender]:
    """Everyone who can get there."""
    built = program("somersault-contact", "spinning_top")
    steps, tolerances = geometric(250, 64_000, 12), geometric(1e-6, 1e-14, 4)
    ours = [
        Contender(
            f"somersault {method}, {stepping}",
            "steps" if stepping == "fixed" else "tolerance",
            steps if stepping == "fixed" else tolerances,
            partial(_ours, built, method, stepping),
            RUNS,
        )
        for method, stepping in (
            ("taylor16", "adaptive"),
            ("rkmk8_b", "adaptive"),
            ("rkmk5_b", "adaptive"),
            ("rkmk8_b", "fixed"),
            ("rkmk5_b", "fixed"),
            ("rkmk_b", "fixed"),
            ("cf4_b", "fixed"),
        )
    ]
    return [
        *ours,
        Contender("heyoka, events", "tolerance", tolerances, _heyoka),
        Contender("SciPy DOP853, events", "tolerance", geometric(1e-8, 1e-14, 2), _scipy),
        Contender("numba RK4, no events", "steps", geometric(1e5, 1e7, 2), _numba),
        *(
            Contender(f"MuJoCo {integrator}", "steps", geometric(1e3, 2e4, 2), _mujoco(integrator))
            for integrator in ("Euler", "RK4", "implicitfast")
        ),
    ]


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Time to the target, and how close those come that do not reach it."""
    reference = _reference()
    [(_, rows, text)] = race(
        contenders(), lambda found: angle(found, reference), [TARGET], repetitions, "error, rad"
    )
    head = (
        f"## Spinning top of thesis 7.3.2, {DURATION:g} s to {TARGET:g} rad of the axis\n\n"
        "Seven switches of the contact force. Each at the coarsest setting from which on it meets the "
        "target, against an 80-bit Taylor series with events; processor time. Those without events "
        "stay far from it; the spring of MuJoCo's contact is of its own kind.\n\n"
    )
    return rows, head + text
