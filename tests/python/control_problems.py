"""Problems of optimal control whose least cost is known, posed as a user poses them."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from somersault import ocp

INF = np.inf


class Known(NamedTuple):
    """A problem, its least cost, and where that number is from."""

    pose: Callable[[], ocp.ControlProblem]
    cost: float
    source: str


def _block(**options: Any) -> ocp.ControlProblem:
    """ẍ = u from rest to rest over one metre."""
    return ocp.ControlProblem(
        lambda x, u: [x.v, u.force],
        states=("x", "v"),
        controls=("force",),
        initial={"x": 0, "v": 0},
        final={"x": 1, "v": 0},
        **options,
    )


def _ceiling(height: float) -> ocp.ControlProblem:
    """Bryson and Denham: least effort below a ceiling."""
    return ocp.ControlProblem(
        lambda x, u: [x.v, u.force],
        states=("x", "v"),
        controls=("force",),
        initial={"x": 0, "v": 1},
        final={"x": 0, "v": -1},
        bounds={"x": (None, height)},
        running_cost=lambda x, u: 0.5 * u.force**2,
    )


def _brachistochrone(gravity: float, final: dict[str, float], **options: Any) -> ocp.ControlProblem:
    return ocp.ControlProblem(
        lambda x, u: [x.v * np.cos(u.angle), x.v * np.sin(u.angle), gravity * np.sin(u.angle)],
        states=("across", "down", "v"),
        controls=("angle",),
        initial={"across": 0, "down": 0, "v": 0},
        final=final,
        duration=(0.05, 20),
        end_cost=lambda x, t: t,
        **options,
    )


def _cart_pole(x: Any, u: Any) -> list[Any]:
    """Kelly 2017, equations 6.1 and 6.2: 1 kg, 0.3 kg at 0.5 m."""
    m1, m2, length, g = 1.0, 0.3, 0.5, 9.81
    sin, cos = np.sin(x.angle), np.cos(x.angle)
    below = m1 + m2 * sin**2
    swing = length * m2 * sin * x.spin**2
    return [
        x.v,
        x.spin,
        (swing + u.force + m2 * g * cos * sin) / below,
        -(swing * cos + u.force * cos + (m1 + m2) * g * sin) / (length * below),
    ]


KNOWN: dict[str, Known] = {
    "minimum time": Known(
        lambda: _block(bounds={"force": (-1, 1)}, duration=(0.1, 20), end_cost=lambda x, t: t),
        2.0,
        "closed form",
    ),
    "minimum effort": Known(lambda: _block(running_cost=lambda x, u: 0.5 * u.force**2), 6.0, "closed form"),
    "minimum fuel": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [x.v, u.right - u.left],
            states=("x", "v"),
            controls=("right", "left"),
            initial={"x": 0, "v": 0},
            final={"x": 1, "v": 0},
            duration=3.0,
            bounds={"right": (0, 1), "left": (0, 1)},
            running_cost=lambda x, u: u.right + u.left,
        ),
        3 - 5**0.5,
        "closed form",
    ),
    "oscillator in minimum time": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [x.v, u.force - x.x],
            states=("x", "v"),
            controls=("force",),
            initial={"x": 5, "v": 0},
            final={"x": 0, "v": 0},
            duration=(0.5, 20),
            bounds={"force": (-1, 1)},
            end_cost=lambda x, t: t,
        ),
        7.93741172058510809,
        "closed form: arcs of circles about ±1",
    ),
    "Bryson and Denham, high": Known(lambda: _ceiling(0.3), 2.0, "closed form"),
    "Bryson and Denham, touched": Known(lambda: _ceiling(0.2), 2 + 6 * 0.2**2, "closed form"),
    "Bryson and Denham, low": Known(lambda: _ceiling(1 / 9), 4.0, "closed form"),
    "brachistochrone": Known(
        lambda: _brachistochrone(9.81, {"across": 10, "down": 5}), 1.80129548301372, "closed form: a cycloid"
    ),
    "brachistochrone over a slope": Known(
        lambda: _brachistochrone(1.0, {"across": 1}, path=[(lambda x: x.down - x.across / 2, None, 0.1)]),
        1.83400322284719,
        "multiple shooting of three arcs",
    ),
    "singular arc": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [u.u],
            states=("x",),
            controls=("u",),
            initial={"x": 1},
            final={"x": 0.5},
            duration=2.0,
            bounds={"u": (-1, 1)},
            running_cost=lambda x: x.x**2,
        ),
        0.375,
        "closed form",
    ),
    "van der Pol": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [x.v, -x.x + x.v * (1 - x.x**2) + u.u],
            states=("x", "v"),
            controls=("u",),
            initial={"x": 1, "v": 0},
            duration=5.0,
            bounds={"v": (-0.4, None)},
            running_cost=lambda x, u: 0.5 * (x.x**2 + x.v**2 + u.u**2),
        ),
        1.47685067119252,
        "multiple shooting of three arcs",
    ),
    "pendulum in minimum time": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [x.spin, -9.81 / 0.5 * np.sin(x.angle) + u.torque / 0.5**2],
            states=("angle", "spin"),
            controls=("torque",),
            initial={"angle": 0, "spin": 0},
            final={"angle": np.pi, "spin": 0},
            duration=(0.5, 5),
            bounds={"torque": (-2, 2)},
            end_cost=lambda x, t: t,
        ),
        2.19680925047200,
        "multiple shooting of four arcs",
    ),
    "Kelly's cart-pole": Known(
        lambda: ocp.ControlProblem(
            _cart_pole,
            states=("x", "angle", "v", "spin"),
            controls=("force",),
            initial=[0, 0, 0, 0],
            final=[1, np.pi, 0, 0],
            duration=2.0,
            bounds={"x": (-2, 2), "force": (-20, 20)},
            running_cost=lambda x, u: u.force**2,
        ),
        58.807667458167,
        "multiple shooting",
    ),
    "hyper-sensitive": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [u.u - x.x**3],
            states=("x",),
            controls=("u",),
            initial={"x": 1},
            final={"x": 1.5},
            duration=40.0,
            running_cost=lambda x, u: 0.5 * (x.x**2 + u.u**2),
        ),
        3.36205690494300,
        "two integrals",
    ),
    "orbit transfer": Known(
        lambda: ocp.ControlProblem(
            lambda x, u, t: [
                x.vr,
                x.vt**2 / x.r - 1 / x.r**2 + 0.1405 / (1 - 0.0749 * t) * np.sin(u.angle),
                -x.vr * x.vt / x.r + 0.1405 / (1 - 0.0749 * t) * np.cos(u.angle),
            ],
            states=("r", "vr", "vt"),
            controls=("angle",),
            initial={"r": 1, "vr": 0, "vt": 1},
            final={"vr": 0},
            duration=3.32,
            ends=[(lambda x0, xf: xf.vt - xf.r**-0.5, 0, 0)],
            end_cost=lambda x: -x.r,
        ),
        -1.52527770064858,
        "multiple shooting",
    ),
}
