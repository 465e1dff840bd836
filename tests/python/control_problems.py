"""Problems of optimal control whose least cost is known, posed as a user poses them."""

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from somersault import multibody, ocp

INF = np.inf


class Known(NamedTuple):
    """A problem, its least cost, and where that number is from."""

    pose: Callable[[], ocp.ControlProblem]
    cost: float
    source: str
    #: What it is, in a line.
    equations: str
    #: Where the search starts, if not from a straight line.
    guess: dict[str, Any] | None = None
    #: Other arguments of `solve`.
    options: Mapping[str, Any] = MappingProxyType({})
    #: Whether it takes more than a second or two.
    is_long: bool = False
    #: Whether arcs are found and certified.
    is_polished: bool = True
    #: Whether every start that leads to a minimum leads to this one.
    is_only: bool = True

    def solve(self) -> tuple[ocp.ControlProblem, ocp.CollocationResult]:
        """The problem, and what is found of it."""
        problem = self.pose()
        return problem, problem.solve(self.guess, **self.options)


def rods(n: int, length: float = 1.0, gravity: float = 9.81) -> multibody.Model:
    """A chain of rods of 1 kg that hangs."""
    links = [
        multibody.Link(
            f"rod{k}",
            "revolute",
            parent=f"rod{k - 1}" if k else None,
            axis=(0, 0, 1),
            origin=(0, -length, 0) if k else (0, 0, 0),
            mass=1.0,
            center=(0, -0.5 * length, 0),
            inertia=np.diag([1, 0, 1]) * length**2 / 12,
        )
        for k in range(n)
    ]
    return multibody.Model(links, gravity=(0, -gravity, 0))


def chain(n: int, gravity: float) -> ocp.ControlProblem:
    """Rods of half a metre, each hinge to be turned by half a radian in a second."""
    return ocp.ControlProblem(
        rods(n, 0.5, gravity),
        initial=[0] * 2 * n,
        final=[0.5] * n + [0] * n,
        running_cost=lambda x, u: 0.5 * u @ u,
    )


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


def _swing_up(duration: float) -> ocp.ControlProblem:
    """Kelly's cart and pole, without bounds."""
    return ocp.ControlProblem(
        _cart_pole,
        states=("x", "angle", "v", "spin"),
        controls=("force",),
        initial=[0, 0, 0, 0],
        final=[1, np.pi, 0, 0],
        duration=duration,
        running_cost=lambda x, u: 0.5 * u.force**2,
    )


def _rods(x: Any, torques: Any) -> list[Any]:
    """A chain of rods of 1 kg and 1 m; angles are from hanging down, torques those of its joints."""
    n = len(x) // 2
    angles, spins = x[:n], x[n:]
    i, j = np.indices((n, n))
    inertia = np.where(i == j, 1 / 3, 0.5) + n - 1 - np.maximum(i, j)
    apart = angles[:, None] - angles[None, :]
    weight = 9.81 * (n - 0.5 - np.arange(n)) * np.sin(angles)
    push = torques - np.append(torques[1:], 0.0)
    rates = np.linalg.solve(inertia * np.cos(apart), push - weight - (inertia * np.sin(apart)) @ spins**2)
    return [*spins, *rates]


def _upright(n: int, duration: float) -> ocp.ControlProblem:
    """From hanging to upright with minimum effort, a torque at each joint."""
    return ocp.ControlProblem(
        lambda x, u: _rods(x, u[:]),
        states=2 * n,
        controls=n,
        initial=np.zeros(2 * n),
        final=np.repeat([np.pi, 0], n),
        duration=duration,
        running_cost=lambda x, u: 0.5 * (u @ u),
    )


def _goddard(fastest: float | None = None) -> ocp.ControlProblem:
    """A rocket that rises as high as it can; units of Earth's radius and gravity."""
    return ocp.ControlProblem(
        lambda x, u: [
            x.v,
            (3.5 * u.thrust - 310 * x.v**2 * np.exp(-500 * (x.r - 1))) / x.m - 1 / x.r**2,
            -7 * u.thrust,
        ],
        states=("r", "v", "m"),
        controls=("thrust",),
        initial=[1, 0, 1],
        final={"m": 0.6},
        duration=(0.05, 1),
        bounds={"thrust": (0, 1), "v": (None, fastest)},
        end_cost=lambda x: -x.r,
    )


def _reorientation() -> ocp.ControlProblem:
    """Bilimoria and Wie 1993: half a turn about z, each torque within its bounds, J = 1."""
    return ocp.ControlProblem(
        lambda x, u: [
            -0.5 * (x.x * x.wx + x.y * x.wy + x.z * x.wz),
            0.5 * (x.w * x.wx + x.y * x.wz - x.z * x.wy),
            0.5 * (x.w * x.wy + x.z * x.wx - x.x * x.wz),
            0.5 * (x.w * x.wz + x.x * x.wy - x.y * x.wx),
            *u,
        ],
        states=("w", "x", "y", "z", "wx", "wy", "wz"),
        controls=("ux", "uy", "uz"),
        initial=[1, 0, 0, 0, 0, 0, 0],
        final=[0, 0, 0, None, 0, 0, 0],
        duration=(0.5, 10),
        bounds={name: (-1, 1) for name in ("ux", "uy", "uz")},
        end_cost=lambda x, t: t,
    )


def _dubins(x: float, y: float, heading: float) -> ocp.ControlProblem:
    """Unit speed, turns of radius 1 and more."""
    return ocp.ControlProblem(
        lambda x, u: [np.cos(x.heading), np.sin(x.heading), u.turn],
        states=("x", "y", "heading"),
        controls=("turn",),
        initial=[0, 0, 0],
        final=[x, y, heading],
        duration=(0.5, 20),
        bounds={"turn": (-1, 1)},
        end_cost=lambda x, t: t,
    )


def _cubic(duration: float) -> ocp.ControlProblem:
    return ocp.ControlProblem(
        lambda x, u: [u.u - x.x**3],
        states=("x",),
        controls=("u",),
        initial={"x": 1},
        final={"x": 1.5},
        duration=duration,
        running_cost=lambda x, u: 0.5 * (x.x**2 + u.u**2),
    )


def _acrobot() -> ocp.ControlProblem:
    """Two rods from hanging to upright, driven between them alone."""
    return ocp.ControlProblem(
        lambda x, u: _rods(x, np.array([0.0, u.elbow])),
        states=("upper", "lower", "upper_spin", "lower_spin"),
        controls=("elbow",),
        initial=[0, 0, 0, 0],
        final=[np.pi, np.pi, 0, 0],
        duration=3,
        running_cost=lambda x, u: 0.5 * u.elbow**2,
    )


#: Costs by tests/derivations/optimal_control.py; of several minima the one that the stated start leads to.
_SHOOTING = "shooting by DOP853"
#: Half a turn about z with a tilt that begins as Bilimoria and Wie's does, and the signs of its torques.
_TILTED = {
    "t": [0.0, 0.8, 1.7, 2.5, 3.4],
    "w": np.cos([0.0, 0.3, 0.9, 1.3, 0.5 * np.pi]),
    "x": [0.0, 0.15, 0.0, -0.15, 0.0],
    "y": [0.0, 0.15, 0.0, -0.15, 0.0],
    "z": np.sin([0.0, 0.3, 0.9, 1.3, 0.5 * np.pi]),
    "ux": [1, -1, -1, -1, 1],
    "uy": [0.5, 1, -1, 1, -0.5],
    "uz": [1, 1, 0.1, -1, -1],
}

#: Two swings, then up: the cheapest motion that `search` finds, every half second to a digit.
_SWUNG = {
    "upper": [0.0, 0.4, -0.5, -0.5, 2.0, 2.8, 3.1],
    "lower": [0.0, -1.4, 2.6, 6.5, 5.0, 4.0, 3.1],
    "upper_spin": [0.0, -0.4, 3.6, 4.0, 3.0, 0.9, 0.0],
    "lower_spin": [0.0, -0.2, 15.4, -2.4, -0.3, -2.1, 0.0],
}

KNOWN: dict[str, Known] = {
    "minimum time": Known(
        lambda: _block(bounds={"force": (-1, 1)}, duration=(0.1, 20), end_cost=lambda x, t: t),
        2.0,
        "closed form",
        "ẍ = u, |u| ≤ 1; 0 → 1, rest to rest; T",
    ),
    "minimum effort": Known(
        lambda: _block(running_cost=lambda x, u: 0.5 * u.force**2),
        6.0,
        "closed form",
        "ẍ = u; 0 → 1, rest to rest; ½∫u²",
    ),
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
        "ẍ = u₁ − u₂, 0 ≤ u ≤ 1; 0 → 1 in 3 s, rest to rest; ∫u₁ + u₂",
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
        "ẍ = u − x, |u| ≤ 1; (5, 0) → 0; T",
    ),
    "Bryson and Denham, high": Known(
        lambda: _ceiling(0.3), 2.0, "closed form", "ẍ = u, x ≤ 0.3; (0, 1) → (0, −1) in 1 s; ½∫u²"
    ),
    "Bryson and Denham, touched": Known(
        lambda: _ceiling(0.2), 2 + 6 * 0.2**2, "closed form", "the same with x ≤ 0.2"
    ),
    "Bryson and Denham, low": Known(lambda: _ceiling(1 / 9), 4.0, "closed form", "the same with x ≤ 1/9"),
    "brachistochrone": Known(
        lambda: _brachistochrone(9.81, {"across": 10, "down": 5}),
        1.80129548301372,
        "closed form: a cycloid",
        "ẋ = v cos θ, ẏ = v sin θ, v̇ = g sin θ; 0 → (10, 5); T",
    ),
    "brachistochrone over a slope": Known(
        lambda: _brachistochrone(1.0, {"across": 1}, path=[(lambda x: x.down - x.across / 2, None, 0.1)]),
        1.83400322284719,
        "multiple shooting of three arcs",
        "the same with g = 1, y ≤ x/2 + 0.1; 0 → x = 1; T",
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
        "ẋ = u, |u| ≤ 1; 1 → ½ in 2 s; ∫x²",
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
        "ẍ = −x + ẋ(1 − x²) + u, ẋ ≥ −0.4; from (1, 0) in 5 s; ½∫x² + ẋ² + u²",
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
        "θ̈ = −(g/ℓ) sin θ + u/ℓ², ℓ = ½, |u| ≤ 2; 0 → π, rest to rest; T",
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
        "cart of 1 kg, pole of 0.3 kg at ½ m, |u| ≤ 20; 0 → (1, π) in 2 s, rest to rest; ∫u²",
    ),
    "hyper-sensitive": Known(
        lambda: _cubic(40.0), 3.36205690494300, "two integrals", "ẋ = −x³ + u; 1 → 1.5 in 40 s; ½∫x² + u²"
    ),
    "hyper-sensitive, long": Known(
        lambda: _cubic(1e4),
        3.36205690494300,
        "two integrals",
        "the same in 10⁴ s",
        options={"tol": 1e-9},
        is_polished=False,
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
        "Bryson and Ho: thrust 0.1405/(1 − 0.0749 t); circle to circle in 3.32; greatest r",
    ),
    "turnpike": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [u.u - x.x],
            states=("x",),
            controls=("u",),
            initial=[0],
            final=[3],
            duration=30,
            running_cost=lambda x, u: 0.5 * ((x.x - 2) ** 2 + u.u**2),
        ),
        38.0355339059327,
        "closed form",
        "ẋ = −x + u; 0 → 3 in 30 s; ½∫(x − 2)² + u²",
    ),
    "harvest": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [x.stock * (1 - x.stock) - u.catch * x.stock],
            states=("stock",),
            controls=("catch",),
            initial=[0.2],
            duration=10,
            bounds={"catch": (0, 1)},
            running_cost=lambda x, u: -u.catch * x.stock,
        ),
        -2.34657359027997,
        "closed form",
        "ẋ = x(1 − x) − u x, 0 ≤ u ≤ 1; from 0.2 in 10 s; most ∫u x",
    ),
    "Goddard": Known(
        _goddard,
        -1.01283691831750,
        "arcs by DOP853",
        "ṙ = v, v̇ = (3.5 u − D)/m − 1/r², ṁ = −7u, 0 ≤ u ≤ 1; greatest r",
    ),
    "Goddard below a speed": Known(
        lambda: _goddard(0.1), -1.01257632465693, "arcs by DOP853", "the same with v ≤ 0.1"
    ),
    "reorientation": Known(
        _reorientation,
        3.24308327745233,
        "arcs by DOP853",
        "quaternion, ω̇ = u, |uᵢ| ≤ 1; half a turn about z, rest to rest; T",
        guess=_TILTED,
        options={"tol": 1e-5, "n_intervals": 30},
    ),
    "Dubins, LSL": Known(
        lambda: _dubins(4, 4, np.pi / 2),
        5.81343701391418,
        "closed form",
        "ẋ = cos θ, ẏ = sin θ, θ̇ = u, |u| ≤ 1; 0 → (4, 4, π/2); T",
    ),
    "Dubins, RSL": Known(
        lambda: _dubins(4, -1, np.pi / 3), 4.55849671753095, "closed form", "the same, 0 → (4, −1, π/3)"
    ),
    "Dubins, RLR": Known(
        lambda: _dubins(0.5, 0.5, np.pi), 6.66041807953039, "closed form", "the same, 0 → (½, ½, π)"
    ),
    "around a disk": Known(
        lambda: ocp.ControlProblem(
            lambda x, u: [u.right, u.up],
            states=("x", "y"),
            controls=("right", "up"),
            initial=[-2, 0],
            final=[2, 0],
            path=[(lambda x: x.x**2 + (x.y - 0.1) ** 2, 1, None)],
            running_cost=lambda x, u: u.right**2 + u.up**2,
        ),
        19.4985009745497,
        "closed form",
        "ẋ = u, |x − (0, 0.1)| ≥ 1; (−2, 0) → (2, 0) in 1 s; ∫|u|²",
    ),
    **{
        f"cart-pendulum in {duration:g} s": Known(
            functools.partial(_swing_up, duration),
            cost,
            _SHOOTING,
            f"the cart-pole without bounds in {duration:g} s; ½∫u²",
            is_only=False,
        )
        for duration, cost in ((1.5, 39.8314230096928), (3, 21.7578528432690), (4, 20.5610217676980))
    },
    **{
        f"double pendulum in {duration} s": Known(
            functools.partial(_upright, 2, duration),
            cost,
            _SHOOTING,
            f"rods of 1 kg and 1 m, a torque at each joint; 0 → (π, π) in {duration} s, rest to rest; ½∫|u|²",
            options=options,
            is_long=bool(options),
            is_only=False,
        )
        for duration, cost, options in (
            (2, 29.4465826522771, {}),
            (3, 18.7162091540930, {}),
            (5, 4.83772225064880, {"n_intervals": 80}),
        )
    },
    **{
        f"triple pendulum in {duration} s": Known(
            functools.partial(_upright, 3, duration),
            cost,
            _SHOOTING,
            f"three rods; 0 → (π, π, π) in {duration} s, rest to rest; ½∫|u|²",
            options=options,
            is_long=True,
            is_only=False,
        )
        for duration, cost, options in (
            (2, 122.507316386, {}),
            (3, 32.9065689588030, {"n_points": 4}),
            (5, 11.1076467991410, {}),
        )
    },
    "acrobot": Known(
        _acrobot,
        27.0475473773570,
        _SHOOTING,
        "two rods, a torque between them; 0 → (π, π) in 3 s, rest to rest; ½∫u²",
        guess=_SWUNG,
        is_only=False,
    ),
}
