"""A tree of Pinocchio's on a plane, with this library's law of contact, by SciPy's DOP853.

The plane goes through the origin. Each ball pushes with N = -k gap - c rate while that is positive, and its
friction is a spring and a damper in series with a slider: with the stretch s and the sliding velocity u,

    p = kt s + ct u,  T = -p,  s' = u                          stick, |p| <= mu N
    T = -mu N p/|p|,  s' = (mu N p/|p| - kt s)/ct              slip

DOP853 stops where a contact begins, ends, sticks or slips, by a root of its dense output, and starts again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio
from compiled import Array
from scipy.integrate import DOP853
from scipy.optimize import brentq

OPEN, STICK, SLIP = range(3)
MOST_EVENTS = 1000
"""Events of a run that is not lost."""
TOGETHER = 1e-13
"""Roots that are no farther apart, s, are one event: legs of a symmetric animal touch at once."""


class Law(NamedTuple):
    """Stiffness and damping of the normal force, coefficient, stiffness and damping of friction, SI units."""

    stiffness: float
    damping: float
    coefficient: float
    tangential_stiffness: float
    tangential_damping: float


class Ball(NamedTuple):
    """A ball on a joint: its centre in the axes of the joint, m, and its radius, m."""

    joint: int
    centre: Array
    radius: float


class Touch(NamedTuple):
    """A contact in a state: the lever arm from the origin of its joint in world axes, gap and velocity."""

    number: int
    arm: Array
    gap: float
    rate: float
    sliding: Array


@dataclass(frozen=True, eq=False)
class Tree:
    """A tree, its balls, their law and the torques of its joints; `rate_of` gives q' by q and v."""

    model: pinocchio.Model
    balls: list[Ball]
    law: Law
    normal: Array
    torque: Callable[[float, Array, Array], Array]
    rate_of: Callable[[Array, Array], Array]

    def run(self, q: Array, v: Array, duration: float, tolerance: float) -> tuple[Array, Array]:
        """q and v at the end; NaN of a run that is lost."""
        y = np.concatenate([q, v, np.zeros(3 * len(self.balls))])
        data = self.model.createData()
        mode, t = [OPEN] * len(self.balls), 0.0
        cuts = len(q), len(q) + len(v)
        for _ in range(MOST_EVENTS):
            if not np.isfinite(y).all():
                break
            solver = DOP853(
                lambda t, y: self._slope(data, mode, t, y), t, y, duration,
                rtol=max(tolerance, 2.3e-14), atol=tolerance,
            )  # fmt: skip
            crossed: list[tuple[float, int]] = []
            while solver.status == "running" and not crossed:
                solver.step()
                if solver.status == "failed":
                    return np.full(len(q), np.nan), np.full(len(v), np.nan)
                crossed = self._crossed(data, mode, solver)
            if not crossed:
                q, v, _ = np.split(solver.y, cuts)
                return q, v
            t = min(root for root, _ in crossed)
            y = solver.dense_output()(t)
            self._switch(data, mode, [guard for root, guard in crossed if root <= t + TOGETHER], y)
        return np.full(len(q), np.nan), np.full(len(v), np.nan)

    def _touches(self, data: pinocchio.Data, mode: list[int] | None, y: Array) -> Iterator[Touch]:
        """Of the contacts that are closed in a mode, or of all."""
        nq, nv = self.model.nq, self.model.nv
        pinocchio.forwardKinematics(self.model, data, y[:nq], y[nq : nq + nv])
        for i, (joint, centre, radius) in enumerate(self.balls):
            if mode is not None and mode[i] == OPEN:
                continue
            pose, motion = data.oMi[joint], data.v[joint]
            arm = pose.rotation @ centre - radius * self.normal
            velocity = pose.rotation @ motion.linear + np.cross(pose.rotation @ motion.angular, arm)
            rate = self.normal @ velocity
            gap = self.normal @ (pose.translation + arm)
            yield Touch(i, arm, gap, rate, velocity - rate * self.normal)

    def _stretch(self, y: Array, i: int) -> Array:
        start = self.model.nq + self.model.nv + 3 * i
        return y[start : start + 3]

    def _hold(self, touch: Touch, y: Array) -> tuple[float, Array]:
        """The normal force, and the force that friction would need to hold."""
        law = self.law
        push = -law.stiffness * touch.gap - law.damping * touch.rate
        stretch = self._stretch(y, touch.number)
        return push, law.tangential_stiffness * stretch + law.tangential_damping * touch.sliding

    def _slope(self, data: pinocchio.Data, mode: list[int], t: float, y: Array) -> Array:
        model, law = self.model, self.law
        q, v = y[: model.nq], y[model.nq : model.nq + model.nv]
        forces = [pinocchio.Force.Zero() for _ in range(model.njoints)]
        stretching = np.zeros((len(self.balls), 3))
        for touch in self._touches(data, mode, y):
            i = touch.number
            push, hold = self._hold(touch, y)
            if mode[i] == STICK:
                stretching[i] = touch.sliding
            else:
                hold *= law.coefficient * push / np.linalg.norm(hold)
                stretching[i] = (
                    hold - law.tangential_stiffness * self._stretch(y, i)
                ) / law.tangential_damping
            joint = self.balls[i].joint
            back = data.oMi[joint].rotation.T
            force = push * self.normal - hold
            forces[joint] += pinocchio.Force(back @ force, back @ np.cross(touch.arm, force))
        acceleration = pinocchio.aba(model, data, q, v, self.torque(t, q, v), forces)
        return np.concatenate([self.rate_of(q, v), acceleration, stretching.ravel()])

    def _margins(self, data: pinocchio.Data, mode: list[int], y: Array) -> Array:
        """Positive inside the mode: of each contact, then of its friction."""
        law, out = self.law, np.ones((2, len(self.balls)))
        for touch in self._touches(data, None, y):
            i = touch.number
            guard = touch.gap + law.damping / law.stiffness * max(touch.rate, 0.0)
            out[0, i] = guard if mode[i] == OPEN else -guard
            if mode[i] != OPEN and law.coefficient > 0.0:
                push, hold = self._hold(touch, y)
                slack = law.coefficient * push - np.linalg.norm(hold)
                out[1, i] = slack if mode[i] == STICK else -slack
        return out.ravel()

    def _crossed(self, data: pinocchio.Data, mode: list[int], solver: DOP853) -> list[tuple[float, int]]:
        """The guards that changed sign in the last step, and when."""
        outside = np.flatnonzero(self._margins(data, mode, solver.y) < 0.0)
        if not len(outside):
            return []
        inside, found = solver.dense_output(), []
        times = np.linspace(solver.t_old, solver.t, 9)
        seen = np.array([self._margins(data, mode, inside(t)) for t in times])
        for guard in outside:
            # A guard that has just been crossed starts at zero, of either sign to rounding.
            within = np.flatnonzero(seen[:, guard] > 0.0)
            if not len(within):
                found.append((solver.t_old, int(guard)))
                continue

            def margin(t: float, guard: int = guard) -> float:
                return float(self._margins(data, mode, inside(t))[guard])

            found.append((brentq(margin, times[within[-1]], solver.t, xtol=1e-15, rtol=1e-15), int(guard)))
        return found

    def _switch(self, data: pinocchio.Data, mode: list[int], guards: list[int], y: Array) -> None:
        n = len(self.balls)
        touches = list(self._touches(data, None, y))
        for guard in guards:
            i = guard % n
            if guard >= n:
                mode[i] = SLIP if mode[i] == STICK else STICK
                continue
            self._stretch(y, i)[:] = 0.0
            push, hold = self._hold(touches[i], y)
            if mode[i] != OPEN:
                mode[i] = OPEN
            else:
                holds = self.law.coefficient * max(push, 0.0) >= np.linalg.norm(hold)
                mode[i] = STICK if holds or self.law.coefficient == 0.0 else SLIP
