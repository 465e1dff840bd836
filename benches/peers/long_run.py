"""Case 2 of thesis 7.2.1 over 10 s to 1e-9 rad, free and under a torque.

Each package is at the coarsest setting that gets there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import compiled
import heyoka
import numpy as np
from measure import coarsest, geometric, interleaved, table
from motions import CASE_2, Array, orientation_error, reference, taylor_system
from ours import body_of, start_of, states_of
from scipy.integrate import solve_ivp

import somersault

TARGET = 1e-9
TOLERANCES = geometric(1e-4, 1e-15, 4)
STEPS = geometric(125, 128_000, 16)
BODY, START = body_of(CASE_2), start_of(CASE_2)
TORQUE = (0.01, 0.2, -0.1)
"""In body axes, N m, of the race under a torque."""
PUSH = somersault.forces.Torque(TORQUE, "body")


@dataclass(frozen=True, eq=False)
class Contender:
    """A way to get there.

    `run` takes a setting, which is a tolerance or a number of steps; `end` reads the end state.
    """

    name: str
    setting: str
    settings: list[float]
    run: Callable[[float], Any]
    end: Callable[[Any], Array] = np.asarray


def _fixed(
    method: str, steps: float, forces: somersault.forces.ForceModel | None = None
) -> somersault.Solution:
    count = round(steps)
    return somersault.integrate(
        BODY,
        START,
        (0.0, CASE_2.duration),
        dt=CASE_2.duration / count,
        method=method,
        forces=forces,
        every=count,
    )


def _adaptive(
    method: str, tolerance: float, forces: somersault.forces.ForceModel | None = None
) -> somersault.Solution:
    return somersault.integrate(
        BODY,
        START,
        (0.0, CASE_2.duration),
        method=method,
        forces=forces,
        rtol=tolerance,
        atol=tolerance,
        every=10**9,
    )


def _last_state(solution: somersault.Solution) -> Array:
    return states_of(solution)[-1]


def _exact(_: float) -> somersault.State:
    state: somersault.State = somersault.exact.FreeBody(BODY, START)(CASE_2.duration)
    return state


def _exact_state(state: somersault.State) -> Array:
    return np.concatenate([np.roll(state.quaternion, 1), state.angular_velocity_body])


def _scipy(tolerance: float) -> Array:
    i, j, k = CASE_2.moments

    def slope(_: float, state: Array) -> list[float]:
        w, x, y, z, a, b, c = state.tolist()
        return [
            -0.5 * (x * a + y * b + z * c),
            0.5 * (w * a + y * c - z * b),
            0.5 * (w * b + z * a - x * c),
            0.5 * (w * c + x * b - y * a),
            (j - k) / i * b * c,
            (k - i) / j * c * a,
            (i - j) / k * a * b,
        ]

    solution = solve_ivp(
        slope,
        (0.0, CASE_2.duration),
        CASE_2.start,
        method="DOP853",
        rtol=max(tolerance, 100 * np.finfo(float).eps),
        atol=tolerance,
    )
    return solution.y[:, -1]


@cache
def _taylor_integrator(tolerance: float, pushed: bool) -> Any:
    system = taylor_system(CASE_2.moments, np.array(TORQUE) if pushed else None)
    return heyoka.taylor_adaptive(system, CASE_2.start, tol=tolerance)


def _heyoka(tolerance: float, pushed: bool = False) -> Array:
    integrator = _taylor_integrator(tolerance, pushed)
    integrator.time = 0.0
    integrator.state[:] = CASE_2.start
    integrator.propagate_until(CASE_2.duration)
    return integrator.state.copy()


def contenders() -> list[Contender]:
    """The methods of the table of order 4 and above, and the peers."""
    ours = []
    for info in somersault.methods():
        if info.orders["rotation"] < 4:
            continue
        if info.adaptive:
            run = partial(_adaptive, info.name)
            ours.append(Contender(f"somersault {info.name}", "tolerance", TOLERANCES, run, _last_state))
        run = partial(_fixed, info.name)
        ours.append(Contender(f"somersault {info.name}, fixed", "steps", STEPS, run, _last_state))
    return [
        *ours,
        Contender("somersault exact.FreeBody", "closed form", [1.0] * 3, _exact, _exact_state),
        Contender("heyoka", "tolerance", TOLERANCES, _heyoka),
        Contender(
            "numba DOP853, quaternions",
            "tolerance",
            TOLERANCES,
            partial(compiled.dop853, CASE_2.moments, CASE_2.start, CASE_2.duration),
        ),
        Contender(
            "numba RK4, quaternions",
            "steps",
            STEPS,
            lambda steps: compiled.rk4(
                CASE_2.moments, CASE_2.start, CASE_2.duration / round(steps), round(steps)
            ),
        ),
        Contender("SciPy DOP853, quaternions", "tolerance", TOLERANCES, _scipy),
    ]


def pushed_contenders() -> list[Contender]:
    """The methods of the table of order 4 and above that take torques, with adapted steps, and heyoka."""
    ours = [
        Contender(
            f"somersault {info.name}",
            "tolerance",
            TOLERANCES,
            partial(_adaptive, info.name, forces=PUSH),
            _last_state,
        )
        for info in somersault.methods()
        if info.adaptive and (info.orders["rotation_with_torque"] or 0) >= 4
    ]
    return [*ours, Contender("heyoka", "tolerance", TOLERANCES, partial(_heyoka, pushed=True))]


def _setting(contender: Contender, setting: float) -> str:
    match contender.setting:
        case "steps":
            return f"{round(setting)} steps"
        case "tolerance":
            return f"tolerance {setting:.1e}"
        case other:
            return other


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Microseconds for the whole run at the setting tuned for the target, without compilation."""
    free, of_free = _race("Case 2 of thesis 7.2.1", contenders(), reference(CASE_2), repetitions)
    title = f"Case 2 under a torque of {TORQUE} N m in body axes"
    pushed, of_pushed = _race(title, pushed_contenders(), reference(CASE_2, TORQUE), repetitions)
    return [*free, *({**row, "torque": TORQUE} for row in pushed)], f"{of_free}\n\n{of_pushed}"


def _race(
    title: str, contenders: list[Contender], exact: Array, repetitions: int
) -> tuple[list[dict[str, object]], str]:
    """The rows and the text of one motion."""

    def error(contender: Contender, setting: float) -> float:
        try:
            return orientation_error(contender.end(contender.run(setting)), exact)
        except somersault.errors.IntegrationError:
            return np.inf

    tuned = {}
    missed = []
    for contender in contenders:
        found = coarsest(contender.settings, partial(error, contender), TARGET)
        if found is None:
            missed.append(contender.name)
        else:
            tuned[contender] = found
    runs = {c.name: partial(c.run, setting) for c, (setting, _) in tuned.items()}
    times = interleaved(runs, repetitions)
    rows: list[dict[str, object]] = [
        {
            "name": c.name,
            c.setting: setting,
            "microseconds": times[c.name] * 1e6,
            "time_against_heyoka": times[c.name] / times["heyoka"],
            "orientation_error": achieved,
        }
        for c, (setting, achieved) in sorted(tuned.items(), key=lambda item: times[item[0].name])
    ]
    lines = table(
        ["", "setting", "µs", "time / heyoka", "achieved, rad"],
        [
            [
                c.name,
                _setting(c, setting),
                f"{times[c.name] * 1e6:.1f}",
                f"{times[c.name] / times['heyoka']:.2f}",
                f"{achieved:.1e}",
            ]
            for c, (setting, achieved) in sorted(tuned.items(), key=lambda item: times[item[0].name])
        ],
    )
    text = (
        f"## {title}, 10 s to 1e-9 rad\n\nEach at its coarsest setting from which on three"
        f" errors in a row meet the target; compilation is not counted.\n\n{lines}"
    )
    if missed:
        text += f"\n\nNot reached within {STEPS[-1]:.0f} steps or at any tolerance: {', '.join(missed)}."
    return rows, text
