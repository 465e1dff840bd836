"""A chain of two links that bounces on compliant ground for half a second, to 1e-3, 1e-6 and 1e-9.

Both links hang on one hinge, which is free in a vertical plane; the hinge and both tips touch the ground,
without friction. Contenders but MuJoCo and Drake integrate the same law, k = 2·10⁴ N/m and c = 8 N s/m that
push and never pull. The contacts of those two are of their own kind: each is measured against its own
answer with the finest step or tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import mujoco
import numpy as np
import pinocchio
from compiled import Array
from drake_trees import Ground, PlanarLink, planar
from drake_trees import Scene as DrakeScene
from measure import Contender, geometric, race
from numba import njit
from scipy.integrate import solve_ivp

from somersault import contact, multibody

DURATION, GRAVITY = 0.5, 9.81
STIFFNESS, DAMPING = 2e4, 8.0
MASSES, LENGTHS, CENTERS, MOMENTS = (1.2, 0.8), (0.5, 0.4), (0.22, 0.17), (0.03, 0.012)
#: x, z of the hinge, the angles of the links from the vertical, and their rates.
START = np.array([0.0, 0.45, 1.1, -0.7, 0.3, 0.0, 0.5, -1.0])
TARGETS = (1e-3, 1e-6, 1e-9)
FINEST = 256_000
"""Steps of MuJoCo's own answer."""
DISSIPATION = 0.1
"""Of Drake's contact, s/m."""
MOST_EVENTS = 100
"""Events of a run that is not lost: coarse tolerances find one event for ever."""

# ------------------------------------------------------------------------------------------- equations


@njit
def gaps(y: Array) -> tuple[Array, Array]:
    """Heights of the hinge and of both tips, and their rates."""
    heights, rates = np.full(3, y[1]), np.full(3, y[5])
    for i in range(2):
        heights[i + 1] -= LENGTHS[i] * np.cos(y[2 + i])
        rates[i + 1] += LENGTHS[i] * np.sin(y[2 + i]) * y[6 + i]
    return heights, rates


@njit
def slope(t: float, y: Array, held: Array) -> Array:
    """The derivative of the state with the contacts frozen that are held."""
    heights, rates = gaps(y)
    force = np.where(held, -STIFFNESS * heights - DAMPING * rates, 0.0)
    mass, push = np.zeros((4, 4)), np.zeros(4)
    for i in range(2):
        m, c, s, o = MASSES[i], CENTERS[i], np.sin(y[2 + i]), np.cos(y[2 + i])
        spin = y[6 + i] ** 2
        mass[0, 0] += m
        mass[1, 1] += m
        mass[0, 2 + i] = mass[2 + i, 0] = m * c * o
        mass[1, 2 + i] = mass[2 + i, 1] = m * c * s
        mass[2 + i, 2 + i] = MOMENTS[i] + m * c * c
        push[0] += m * c * s * spin
        push[1] -= m * c * o * spin + m * GRAVITY
        push[2 + i] = force[i + 1] * LENGTHS[i] * s - m * GRAVITY * c * s
    push[1] += force.sum()
    return np.concatenate((y[4:], np.linalg.solve(mass, push)))


def _guard(y: Array, i: int) -> float:
    """Negative where contact i pushes."""
    heights, rates = gaps(y)
    return float(heights[i] + DAMPING / STIFFNESS * max(rates[i], 0.0))


def _located(rates: Callable[[float, Array, Array], Array], tolerance: float, start: Array) -> Array:
    """SciPy's DOP853, stopped at each event and started again."""
    t, y = 0.0, start
    held = np.array([_guard(start, i) < 0 for i in range(3)])
    for _ in range(MOST_EVENTS):
        events = [lambda t, y, held, i=i: _guard(y, i) for i in range(3)]
        for i, event in enumerate(events):
            event.terminal, event.direction = True, 1 if held[i] else -1  # type: ignore[attr-defined]
        found = solve_ivp(
            rates, (t, DURATION), y, method="DOP853", events=events, args=(held,),
            rtol=max(tolerance, 2.3e-14), atol=tolerance,
        )  # fmt: skip
        t, y, held = found.t[-1], found.y[:, -1], held.copy()
        if t == DURATION:
            return np.asarray(y)
        for i in range(3):
            held[i] ^= len(found.t_events[i]) > 0
    return np.full(len(start), np.nan)


def _scipy(tolerance: float) -> Array:
    return _located(slope, tolerance, START)


# ------------------------------------------------------------------------------------------- Pinocchio


class _Pinocchio:
    """The same tree in Pinocchio, whose forward dynamics takes the forces on its links."""

    def __init__(self) -> None:
        self.model = pinocchio.Model()
        self.model.gravity.linear = np.array([0.0, -GRAVITY, 0.0])
        parent = 0
        for i, joint in enumerate((pinocchio.JointModelPlanar(), pinocchio.JointModelRZ())):
            parent = self.model.addJoint(parent, joint, pinocchio.SE3.Identity(), f"link {i}")
            center, moment = np.array([0.0, -CENTERS[i], 0.0]), np.eye(3) * MOMENTS[i]
            inertia = pinocchio.Inertia(MASSES[i], center, moment)
            self.model.appendBodyToJoint(parent, inertia, pinocchio.SE3.Identity())
        self.data = self.model.createData()
        self.points = [
            (1, np.zeros(3)),
            (1, np.array([0.0, -LENGTHS[0], 0.0])),
            (2, np.array([0.0, -LENGTHS[1], 0.0])),
        ]

    def rates(self, t: float, y: Array, held: Array) -> Array:
        """As `slope`, of the same state."""
        (x, z, a, b), (vx, vz, wa, wb) = y[:4], y[4:]
        s, c = np.sin(a), np.cos(a)
        q = np.array([x, z, c, s, b - a])
        v = np.array([c * vx + s * vz, -s * vx + c * vz, wa, wb - wa])
        heights, sinking = gaps(y)
        forces = [pinocchio.Force.Zero() for _ in range(3)]
        for k, (joint, point) in enumerate(self.points):
            if held[k]:
                angle = y[1 + joint]
                push = -STIFFNESS * heights[k] - DAMPING * sinking[k]
                force = push * np.array([np.sin(angle), np.cos(angle), 0.0])
                forces[joint] += pinocchio.Force(force, np.cross(point, force))
        of_body = pinocchio.aba(self.model, self.data, q, v, np.zeros(4), forces)
        # from the axes of the first body
        ax, az = of_body[0] - wa * v[1], of_body[1] + wa * v[0]
        return np.array([*y[4:], c * ax - s * az, s * ax + c * az, of_body[2], of_body[2] + of_body[3]])


@cache
def _made() -> _Pinocchio:
    return _Pinocchio()


def _pinocchio(tolerance: float) -> Array:
    return _located(_made().rates, tolerance, START)


# -------------------------------------------------------------------------------------------- MuJoCo


@cache
def _mujoco_model(integrator: str, steps: int) -> mujoco.MjModel:
    law = f'condim="1" solref="{-STIFFNESS} {-DAMPING}" solimp="0.9999 0.9999 0.001"'

    def link(i: int) -> str:
        ball = f'<geom type="sphere" size="1e-6" pos="0 0 {-LENGTHS[i]}" mass="0" {law}/>'
        around = " ".join([str(MOMENTS[i])] * 3)
        return f'<inertial pos="0 0 {-CENTERS[i]}" mass="{MASSES[i]}" diaginertia="{around}"/>{ball}'

    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{DURATION / steps!r}" integrator="{integrator}" gravity="0 0 {-GRAVITY}"
                  iterations="100" tolerance="1e-14"/>
          <default><geom contype="1" conaffinity="2"/></default>
          <worldbody>
            <geom type="plane" size="9 9 1" contype="2" conaffinity="1" {law}/>
            <body>
              <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
              <joint type="hinge" axis="0 -1 0"/>
              <geom type="sphere" size="1e-6" mass="0" {law}/>
              {link(0)}
              <body><joint type="hinge" axis="0 -1 0"/>{link(1)}</body>
            </body>
          </worldbody>
        </mujoco>
        """)


def _mujoco_end(integrator: str, steps: int) -> Array:
    model = _mujoco_model(integrator, steps)
    data = mujoco.MjData(model)
    (x, z, a, b), (vx, vz, wa, wb) = START[:4], START[4:]
    data.qpos[:], data.qvel[:] = (x, z, a, b - a), (vx, vz, wa, wb - wa)
    mujoco.mj_step(model, data, nstep=steps)
    q, v = data.qpos, data.qvel
    return np.array([q[0], q[1], q[2], q[2] + q[3], v[0], v[1], v[2], v[2] + v[3]])


@cache
def _mujoco_answer() -> Array:
    return _mujoco_end("RK4", FINEST)


def _mujoco(integrator: str, steps: float) -> Array:
    """The end, moved by what its own answer differs from that of the law."""
    return _mujoco_end(integrator, round(steps)) - _mujoco_answer() + _reference()


# --------------------------------------------------------------------------------------------- Drake


@cache
def _drake_scene(step: float) -> DrakeScene:
    links = [PlanarLink(MASSES[i], MOMENTS[i], CENTERS[i], 0.0) for i in range(2)]
    points = [(0, 0.0), (0, LENGTHS[0]), (1, LENGTHS[1])]
    (x, z, a, b), (vx, vz, wa, wb) = START[:4], START[4:]
    start = np.array([x, z, a, b - a, vx, vz, wa, wb - wa])
    return planar(links, points, Ground(STIFFNESS, DISSIPATION, 0.0), (), start, DURATION, step)


def _drake_end(integrator: str, setting: float) -> Array:
    """In equal steps for SAP, else at an accuracy."""
    if integrator == "sap":
        end = _drake_scene(DURATION / round(setting)).end()
    else:
        end = _drake_scene(0.0).end(integrator, setting)
    x, z, a, b, vx, vz, wa, wb = end
    return np.array([x, z, a, a + b, vx, vz, wa, wa + wb])


@cache
def _drake_answer() -> Array:
    return _drake_end("runge_kutta3", 1e-13)


def _drake(integrator: str, setting: float) -> Array:
    """The end, moved by what its own answer differs from that of the law."""
    return _drake_end(integrator, setting) - _drake_answer() + _reference()


# ------------------------------------------------------------------------------------------ this library


@cache
def _chain() -> tuple[multibody.Model, list[contact.LinkContact], Array, Array]:
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    first, second = (
        {"mass": MASSES[i], "center": (0.0, -CENTERS[i], 0.0), "inertia": [MOMENTS[i]] * 3} for i in range(2)
    )
    model = multibody.Model(
        [
            multibody.Link("first", "planar", orientation=upright, **first),
            multibody.Link("second", "revolute", parent="first", axis=(0, 0, 1), **second),
        ]
    )
    law, floor = contact.CompliantLaw(STIFFNESS, DAMPING), contact.HalfSpace()
    touches = [
        contact.LinkContact(name, link, contact.Contact((0.0, -length, 0.0), floor, law))
        for name, link, length in (
            ("hinge", "first", 0.0),
            ("a", "first", LENGTHS[0]),
            ("b", "second", LENGTHS[1]),
        )
    ]
    (x, z, a, b), (vx, vz, wa, wb) = START[:4], START[4:]
    s, c = np.sin(a), np.cos(a)
    return (
        model,
        touches,
        np.array([x, z, a, b - a]),
        np.array([c * vx + s * vz, -s * vx + c * vz, wa, wb - wa]),
    )


def _ours(method: str, tolerance: float) -> Array:
    model, touches, q, v = _chain()
    found = multibody.integrate_tree(
        model, q, v, (0.0, DURATION), method=method, rtol=tolerance, atol=tolerance, contacts=touches,
        every=1_000_000, keep_events=False,
    )  # fmt: skip
    q, v = found.q[-1], found.v[-1]
    s, c = np.sin(q[2]), np.cos(q[2])
    return np.array(
        [q[0], q[1], q[2], q[2] + q[3], c * v[0] - s * v[1], s * v[0] + c * v[1], v[2], v[2] + v[3]]
    )


@cache
def _reference() -> Array:
    """By the equations above, which share nothing with this library, at the least tolerance."""
    return _located(slope, 1e-15, START)


def contenders() -> list[Contender]:
    """Everyone who can get there."""
    tolerances = geometric(1e-2, 1e-14, 4)
    return [
        *(
            Contender(f"somersault {method}", "tolerance", tolerances, partial(_ours, method))
            for method in ("rkmk8", "rkmk5")
        ),
        Contender("SciPy DOP853, events, equations by numba", "tolerance", geometric(1e-2, 1e-13, 2), _scipy),
        Contender("SciPy DOP853, events, Pinocchio", "tolerance", geometric(1e-2, 1e-13, 2), _pinocchio),
        *(
            Contender(
                f"MuJoCo {integrator}", "steps", geometric(500, 32_000, 2), partial(_mujoco, integrator)
            )
            for integrator in ("Euler", "RK4", "implicitfast")
        ),
        *(
            Contender(f"Drake {name}", "accuracy", geometric(1e-2, last, 1), partial(_drake, integrator))
            for integrator, name, last in (("runge_kutta3", "RK3", 1e-12), ("cenic", "CENIC", 1e-9))
        ),
        Contender("Drake SAP", "steps", geometric(500, 32_000, 2), partial(_drake, "sap")),
    ]


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Time to each target, and how close those come that do not reach it."""
    reference = _reference()

    def error(found: Any) -> float:
        return float(np.abs(found - reference).max())

    all_rows: list[dict[str, object]] = []
    parts = [
        f"## A chain that bounces for {DURATION:g} s\n\n"
        "Two links, three points of contact; largest error of places, angles and rates at the end, SI units. "
        "Each at the coarsest setting from which on it meets the target, against SciPy's DOP853 with events "
        "at 1e-15; processor time, called from Python. MuJoCo and Drake have contacts of their own kind and "
        f"are measured against their own answers, with {FINEST} steps of RK4, and by RK3 at 1e-13. "
        "Drake's RK3 and CENIC adapt their steps, SAP is its discrete contact."
    ]
    for target, rows, text in race(contenders(), error, TARGETS, repetitions, "error"):
        all_rows += [{"target": target, **row} for row in rows]
        parts.append(f"To {target:g}:\n\n{text}")
    return all_rows, "\n\n".join(parts)
