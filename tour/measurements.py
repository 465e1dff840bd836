"""What the chapters measure, each thing once and when it is first requested."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import somersault
from somersault import contact, forces, ocp, studies
from tour import thesis
from tour.runs import Runs
from tour.top import Top, distance, orders

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """How much to compute."""

    #: Bodies along each side of the grid of inertias of thesis 6.2.
    inertias: int
    #: The same for methods of which the thesis prints nothing.
    other_inertias: int
    #: The smallest step in the studies of accuracy, as a power of ten.
    finest: float
    #: Repetitions of short runs, of which the shortest time counts.
    repeats: int
    #: Bodies in a batch.
    bodies: int
    #: Steps of the long run.
    long_steps: int
    #: Of so many frames of a dive one is fitted to markers.
    thinned: int
    #: Flights that are recorded where no recordings are given.
    flights: int


#: Step of the reference motion of the spinning top, s.
TOP_STEP = 2.5e-5

FULL = Setting(
    inertias=100,
    other_inertias=50,
    finest=-5.0,
    repeats=5,
    bodies=10_000,
    long_steps=1_000_000,
    thinned=1,
    flights=4,
)
#: For tests: the same pages in less time.
REDUCED = Setting(
    inertias=100,
    other_inertias=20,
    finest=-3.0,
    repeats=1,
    bodies=500,
    long_steps=2_000,
    thinned=4,
    flights=2,
)


@dataclass(frozen=True)
class LongRun:
    """Largest relative errors of energy and angular momentum in the first and in the last tenth of a run."""

    energy_early: float
    energy_late: float
    momentum_early: float
    momentum_late: float
    nanoseconds: float

    @property
    def drifts(self) -> bool:
        """Whether an error has more than trebled from the first tenth to the last, and is not rounding."""
        pairs = ((self.energy_early, self.energy_late), (self.momentum_early, self.momentum_late))
        return any(late > max(3 * early, 1e-12) for early, late in pairs)


@dataclass(frozen=True)
class Observed:
    """Orders measured, as `MethodInfo.orders` names them; None where there is no slope to be had."""

    translation: float | None
    translation_with_velocity: float | None
    rotation: float | None
    rotation_with_torque: float | None


class Measurements:
    """All that is measured, in one setting."""

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.methods: tuple[somersault.MethodInfo, ...] = tuple(somersault.methods())
        self.names: tuple[str, ...] = tuple(info.name for info in self.methods)

    @cached_property
    def regions(self) -> dict[str, studies.StabilityRegion]:
        """Stability regions of the methods that move a body by a formula of its own for the translation."""
        return {name: studies.stability_region(name) for name in (*thesis.STABILITY_AREAS, "ab4", "siabm4")}

    @cached_property
    def energy(self) -> dict[str, studies.EnergyStudy]:
        """Energy ratios over the grid of inertias, of every method."""
        printed = studies.prisms(self.setting.inertias)
        others = studies.prisms(self.setting.other_inertias)
        return {
            name: studies.energy(name, printed if name in thesis.METHODS else others) for name in self.names
        }

    @cached_property
    def observed(self) -> dict[str, Observed]:
        """Orders of every method on four problems."""
        on_position = studies.Problem.spring_pendulum()
        on_velocity = studies.Problem.damped_spring_pendulum()
        free = studies.Problem.asymmetric_body()
        torqued = self._torqued_problem
        translation_steps = 0.25 * 0.5 ** (np.arange(16) / 2)
        rotation_steps = 0.24 * 0.5 ** (np.arange(14) / 2)

        def orders(name: str, takes_torque: bool) -> Observed:
            def order(problem: studies.Problem, steps: NDArray[np.floating], of: str) -> float | None:
                found: float | None = studies.convergence(problem, name, steps).orders[of]
                return found

            return Observed(
                translation=order(on_position, translation_steps, "position"),
                translation_with_velocity=order(on_velocity, translation_steps, "position"),
                rotation=order(free, rotation_steps, "orientation"),
                rotation_with_torque=(
                    order(torqued, rotation_steps, "orientation") if takes_torque else None
                ),
            )

        return {info.name: orders(info.name, info.scope != "torque-free") for info in self.methods}

    @cached_property
    def accuracy(self) -> dict[int, dict[str, Runs]]:
        """Runs on the cases of thesis 7.2.1: every method on cases 1 and 2, those of the thesis on case 3.

        The thesis' methods go a decade further, for its figures.
        """
        finest = self.setting.finest
        return {
            case: {
                name: self._runs(
                    studies.Problem.case(case), name, -1.0, finest if name in thesis.METHODS else finest + 1
                )
                for name in (self.names if case < 3 else thesis.METHODS)
            }
            for case in thesis.CASES
        }

    @cached_property
    def forced(self) -> dict[str, Runs]:
        """Runs of every method that takes a torque, on a box that swings from a spring."""
        return {
            info.name: self._runs(self._forced_problem, info.name, -2.0, max(self.setting.finest, -4.0))
            for info in self.methods
            if info.scope != "torque-free"
        }

    @cached_property
    def adapted(self) -> dict[str, Runs]:
        """Runs on case 2 with adapted steps, for tolerances from 1e-3 to 1e-13."""
        tolerances = 10.0 ** np.arange(-3, -14, -1)
        return {
            info.name: Runs.of(
                studies.work_precision(
                    studies.Problem.case(2), info.name, tolerances=tolerances, repeats=self.setting.repeats
                )
            )
            for info in self.methods
            if info.embedded_order is not None
        }

    @cached_property
    def forced_adapted(self) -> dict[str, Runs]:
        """Runs of the hanging box with adapted steps."""
        tolerances = 10.0 ** np.arange(-3, -13, -1)
        return {
            info.name: Runs.of(
                studies.work_precision(
                    self._forced_problem, info.name, tolerances=tolerances, repeats=self.setting.repeats
                )
            )
            for info in self.methods
            if info.embedded_order is not None
        }

    def _runs(self, problem: studies.Problem, name: str, coarsest: float, finest: float) -> Runs:
        """With steps three to a decade; short runs are repeated, since their times scatter more."""
        steps = 10 ** np.arange(coarsest, finest - 0.01, -1 / 3)
        short = steps > problem.t_end / 3e4
        parts = [(steps[short], self.setting.repeats), (steps[~short], 1)]
        return Runs.of(
            *(
                studies.work_precision(problem, name, dt, repeats=repeats)
                for dt, repeats in parts
                if len(dt) > 0
            )
        )

    @cached_property
    def _forced_problem(self) -> studies.Problem:
        """A box of 1 kg hung by a corner from a spring with a damper, in gravity and drag, for 2 s."""
        sides = np.array([0.2, 0.4, 0.6])
        body = somersault.RigidBody.box(1.0, sides)
        start = somersault.State(
            position=(0.3, 0.1, -0.8), velocity=(0.5, 1.0, 0.0), angular_velocity=(1.0, 2.0, 3.0)
        )
        acting = [
            forces.Gravity(),
            forces.Spring(40.0, (0.0, 0.0, 0.0), sides / 2, damping=0.3, rest_length=0.5),
            forces.Drag(angular=0.002),
        ]
        # Of order 8: halving the step moves this end by rounding only.
        end = somersault.integrate(
            body, start, (0.0, 2.0), dt=5e-4, method="rkmk8", forces=acting, every=1_000_000
        )[-1]
        return studies.Problem(body, start, 2.0, forces=acting, reference=end)

    @cached_property
    def _torqued_problem(self) -> studies.Problem:
        """The asymmetric body under a torque that turns with it and a drag of rotation, for 3 s."""
        free = studies.Problem.asymmetric_body()
        acting = [forces.Torque((0.4, -0.3, 0.5), frame="body"), forces.Drag(angular=0.2)]
        end = somersault.integrate(
            free.body, free.state, (0.0, 3.0), dt=0.01, method="rkmk8", forces=acting, every=1_000_000
        )[-1]
        return studies.Problem(free.body, free.state, 3.0, forces=acting, reference=end)

    @cached_property
    def long_runs(self) -> dict[str, LongRun]:
        """A box that tumbles freely, 0.05 s a step; methods whose numbers overflow are left out."""
        body, start = self.box
        dt, steps = 0.05, self.setting.long_steps
        found = {}
        for name in self.names:
            began = time.perf_counter()
            try:
                run = somersault.integrate(
                    body, start, (0.0, dt * steps), dt=dt, method=name, every=max(1, steps // 2000)
                )
            except somersault.errors.IntegrationError:
                continue
            seconds = time.perf_counter() - began
            energy = np.abs(run.kinetic_energy / run.kinetic_energy[0] - 1)
            momentum = run.angular_momentum
            drift = np.linalg.norm(momentum - momentum[0], axis=1) / np.linalg.norm(momentum[0])
            tenth = max(2, len(energy) // 10)
            found[name] = LongRun(
                float(np.max(energy[:tenth])),
                float(np.max(energy[-tenth:])),
                float(np.max(drift[:tenth])),
                float(np.max(drift[-tenth:])),
                seconds / steps * 1e9,
            )
        return found

    @cached_property
    def box(self) -> tuple[somersault.RigidBody, somersault.State]:
        """The tumbling box: 0.2 × 0.4 × 0.6 m, 1 kg, ω₀ = (1, 2, 3) rad/s."""
        return (
            somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6)),
            somersault.State(angular_velocity=(1.0, 2.0, 3.0)),
        )

    @cached_property
    def pike(self) -> tuple[ocp.DiveSolution, float]:
        """The planar dive, and the seconds it took to find."""
        return _timed(ocp.dive_107b())

    @cached_property
    def twisting(self) -> tuple[ocp.DiveSolution, float]:
        """The spatial dive, and the seconds it took to find."""
        return _timed(ocp.dive_5174d())

    @cached_property
    def top_motion(self) -> somersault.Solution:
        """A second of the top, as accurate as it gets: at every step, and at all times between."""
        top = self.top
        return somersault.integrate(
            top.body,
            top.state,
            (0.0, 1.0),
            dt=TOP_STEP,
            method="rkmk8",
            forces=top.forces,
            contacts=top.contacts,
            dense_output=True,
            every=4,
        )

    @cached_property
    def top(self) -> contact.ContactSystem:
        """The spinning top."""
        return contact.spinning_top()

    @cached_property
    def top_references(self) -> dict[float, tuple[somersault.State, dict[str, float]]]:
        """The state of the top at two times, and how far it moves if steps are twice as long."""
        found = {}
        for end in (0.1, 1.0):
            fine, coarse = (Top(end).run("rkmk8", dt, True)[-1] for dt in (TOP_STEP, 2 * TOP_STEP))
            found[end] = fine, distance(fine, coarse)
        return found

    @cached_property
    def top_shift(self) -> float:
        """How far the events of the top move if steps are twice as long."""
        coarse = Top(1.0).run("rkmk8", 2 * TOP_STEP, True).events
        fine = self.top_motion.events
        return max(abs(a.t - b.t) for a, b in zip(fine, coarse, strict=True))

    @cached_property
    def top_steps(self) -> Array:
        """Steps of the runs of the top, from 1e-2 s down, three to a decade."""
        return 10.0 ** np.arange(-2.0, self.setting.finest - 0.01, -1 / 3)

    @cached_property
    def top_runs(self) -> dict[bool, dict[str, Runs]]:
        """Runs of the thesis' methods over a second, with and without events located."""
        top, (reference, _) = Top(1.0), self.top_references[1.0]
        return {
            located: {
                name: top.runs(name, self.top_steps, located, reference, self.setting.repeats)
                for name in thesis.METHODS
                if name in self.stated_with_torque
            }
            for located in (False, True)
        }

    @cached_property
    def stated_with_torque(self) -> dict[str, int]:
        """The order that each method for forces of any kind states for those that depend on velocities."""
        return {
            info.name: min(
                info.orders["translation_with_velocity"] or 0, info.orders["rotation_with_torque"] or 0
            )
            for info in self.methods
            if info.scope in ("any system", "rigid bodies")
        }

    @cached_property
    def top_scattered_steps(self) -> Array:
        """Steps for runs without location, whose errors depend on where the steps fall."""
        return np.geomspace(1e-3, 3e-5, 60)

    @cached_property
    def top_orders(self) -> dict[bool, dict[str, dict[str, float | None]]]:
        """Orders of the top after 0.1 s, with and without events located."""
        top, (reference, shift) = Top(0.1), self.top_references[0.1]
        # Twenty times what the reference itself may be off by.
        floors = {name: max(20 * value, 1e-12) for name, value in shift.items()}
        halved = 4e-3 * 0.5 ** (np.arange(15) / 2)
        found: dict[bool, dict[str, dict[str, float | None]]] = {}
        for located, steps, points in ((False, self.top_scattered_steps, None), (True, halved, 6)):
            found[located] = {
                name: orders(steps, top.runs(name, steps, located, reference, 1), floors, points)
                for name in self.stated_with_torque
            }
        return found

    @cached_property
    def top_thesis_reference(self) -> dict[str, float] | None:
        """How far the reference run of the thesis is off after 1 s; None where there is no time for it."""
        if self.setting.finest > -5:
            return None
        return distance(Top(1.0).run("rkmk", 1e-6, False)[-1], self.top_references[1.0][0])


def _timed(dive: ocp.Dive) -> tuple[ocp.DiveSolution, float]:
    began = time.perf_counter()
    found = dive.solve()
    return found, time.perf_counter() - began
