"""What stands for an object at the prompt: it says what the object is, in a line, and computes nothing."""

import inspect
import io
import re
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import public_names
import pytest

import somersault
from somersault import (
    contact,
    exam,
    forces,
    ftla,
    integrators,
    motion,
    multibody,
    nlp,
    ocp,
    studies,
    sweep,
    viewer,
)

#: Letters that a line may have.
LONGEST = 200
#: Seconds, of which a text takes microseconds and any calculation more.
LONGEST_TIME = 5e-3
#: Bases whose objects are always of a class below them.
BASES = {"CollocationOutcome", "ForceModel", "Shape", "Surface"}

LAW = contact.CompliantLaw(1e4 / 3.0, 20.0 / 3.0)
PLANE = contact.HalfSpace((0.1, 0.2, -0.3), (0.3, -0.1, 0.9))
ORBIT = somersault.forces.Orbit(2e7 / 3, 0.1, 0.2, 1 / 7, 0.4, 0.5)
BODY = somersault.RigidBody(2.0 / 3.0, (0.5 / 3.0, 0.9 / 3.0, 1.0 / 3.0))
STATE = somersault.State((0.3, -0.2, 0.5), (0.1, -0.3, 0.5, 0.8), (0.4, 0.1, -0.7), (1.1, -0.6, 0.9))
DIVER = multibody.diver_planar()
ARM = multibody.two_link_arm()
LINEAR = ftla.linear_regulator()
FLOW = ftla.VariationalFlow(LINEAR)
TIMES = np.linspace(0.0, 1.0, 20)


def repaired() -> motion.Repair:
    text = io.StringIO("squat\nnColumns=2\ninDegrees=yes\nendheader\ntime\tknee_angle_r\n0\t0\n")
    return motion.read_mot(text).repairs[0]


@cache
def run() -> somersault.Solution:
    return somersault.integrate(
        BODY, STATE, (0.0, 0.1), dt=0.01, dense_output=True, forces=forces.Gravity(), contacts=touch()
    )


@cache
def still(t: float) -> tuple[tuple[float, ...], ...]:
    return ((0.0, 0.0, 0.0),) * 3


def touch() -> contact.Contact:
    return contact.Contact(
        (1 / 3, 2 / 3, -1 / 3), PLANE, LAW, friction=contact.CoulombFriction(0.3, 1e4, 2.0)
    )


@cache
def bounce() -> somersault.Solution:
    ball = contact.bouncing_ball(1.0, 0.1, contact.CompliantLaw(1e4, 10.0), 0.1)
    return somersault.integrate(
        ball.body, ball.state, (0.0, 0.2), dt=0.01, forces=ball.forces, contacts=ball.contacts
    )


@cache
def examined() -> exam.ExamReport:
    return exam.audit(exam.engine("somersault"), "rotation", gradients=False, name="n" * 300)


@cache
def swing() -> multibody.TreeSolution:
    return multibody.integrate_tree(ARM, [0.1, 0.2], [1.0, 0.0], (0.0, 0.1), dt=0.01, dense_output=True)


def slope_of_a_hop() -> contact.TreeSensitivities:
    leg = contact.hopping_leg()
    return contact.differentiate_tree(leg.model, leg.q, leg.v, (0.0, 0.01), dt=1e-3, contacts=leg.contacts)


def gradient_of_a_hop() -> contact.TreeGradient:
    leg = contact.hopping_leg()
    start = (leg.model, leg.q, leg.v, (0.0, 0.01))
    return contact.gradient_tree(*start, lambda q, v: (q[1] / 3, None, None), dt=1e-3, contacts=leg.contacts)


@cache
def hop() -> multibody.TreeSolution:
    leg = contact.hopping_leg()
    start = (leg.model, leg.q, leg.v, (0.0, 0.05))
    return multibody.integrate_tree(*start, torque=leg.torque, contacts=leg.contacts)


@cache
def robot() -> multibody.Robot:
    return multibody.Robot.from_urdf(
        """<robot name="door"><link name="leaf"><inertial><mass value="20"/>
        <inertia ixx="6" ixy="0" ixz="0" iyy="7" iyz="0" izz="1"/></inertial>
        <visual><geometry><box size="1 2 0.1"/></geometry></visual></link></robot>"""
    )


@cache
def problem() -> ocp.MotionProblem:
    ends = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
    phase = ocp.Phase(ocp.SplineMotion(1, 8, ends), (0.5, 1.5), 20)
    effort = ocp.Cost(ocp.entries("torque", [0]))
    away = ocp.Constraint(ocp.displacement([0.0, np.pi - 0.3], [1]), 0.0, 0.0, at="finish")
    return ocp.MotionProblem(
        multibody.cart_pendulum(),
        [0.0, np.pi],
        [0.0, 0.0],
        [phase],
        active=["cart"],
        costs=[effort],
        constraints=[away],
    )


@cache
def block() -> ocp.ControlProblem:
    link = multibody.Link("block", "prismatic", axis=(1, 0, 0), mass=1.0)
    model = multibody.Model([link], gravity=(0, 0, 0))
    return ocp.ControlProblem(model, initial=[0, 0], final=[1, 0], running_cost=lambda x, u: 0.5 * u[0] ** 2)


def thrown() -> ocp.ControlProblem:
    effort = {"initial": [0, 0], "final": [1, 0], "running_cost": lambda x, u: 0.5 * u.force**2}
    return ocp.ControlProblem(lambda x, u: [x.v, u.force], ("x", "v"), ("force",), **effort)


@cache
def moved() -> ocp.CollocationResult:
    return block().solve(tol=1e-3, n_intervals=4)


@cache
def dive() -> ocp.DiveSolution:
    return ocp.dive_107b(n_steps=30).solve()


@cache
def extremal() -> ftla.Extremal:
    return ftla.shoot(LINEAR, [1.0], [1.0], np.linspace(0.0, 3.0, 7), np.zeros((7, 2)))


@cache
def placement() -> ftla.Placement:
    return ftla.Placement((1, 0, 1), [], [1.0, 2.0, 4.0])


@cache
def matching() -> ftla.Matching:
    return ftla.Matching(
        FLOW, [1.0], [1.0], 10.0, placement(), initial_costate=[0.4], final_costate=[-2.4],
        corrections=np.linspace(0.1, 4.9, 90),
    )  # fmt: skip


@cache
def flight() -> motion.SyntheticFlight:
    fold = np.sin(np.pi * TIMES)[:, None] ** 2
    q = (1 - fold) * DIVER.configuration("A") + fold * DIVER.configuration("H")
    q[:, 2] = 4.0 * TIMES
    return motion.SyntheticFlight(DIVER.model, TIMES, q)


@cache
def dives() -> motion.SyntheticSet:
    return motion.SyntheticSet(flight(), motion.MarkerSet.joint_centres(DIVER.model), n_dives=5, seed=1)


def awards() -> motion.AwardTable:
    return motion.read_awards(io.StringIO("dd,awards\n2,7 8 7\n3,7 7 7 7 7\n"))


@cache
def scorer() -> motion.ScoringModel:
    options = motion.ScoringOptions(n_frames=10, n_eigenweights=1, n_components=1)
    return motion.ScoringModel(dives().performances(), dives().scores, options)


@cache
def validation() -> motion.Validation:
    options = motion.ScoringOptions(n_frames=10, n_eigenweights=1, n_components=1)
    return motion.validate(dives().performances(), dives().scores, options, n_resamples=5)


@cache
def fit() -> motion.MotionFit:
    markers = motion.MarkerSet(ARM, {"elbow": ("lower", (0, 0, 0)), "hand": ("lower", (0.5, 0, 0))})
    return motion.MarkerFit(markers).fit(motion.place_markers(markers, [0.0, 0.1], [[0.1, 0.2], [0.2, 0.4]]))


@cache
def reconstructed() -> motion.ReconstructedFlight:
    t = np.linspace(0.0, 0.4, 21)
    straight = multibody.diver_planar().configuration("A")
    q = np.tile(straight, (21, 1))
    q[:, :2] = np.stack([t, 3.0 + 4.0 * t - 4.905 * t**2], axis=1)
    markers = motion.MarkerSet.joint_centres(multibody.diver_planar().model)
    return motion.reconstruct_flight(markers, motion.place_markers(markers, t, q), noise=0.01, scale=1.0)


@cache
def smoothed() -> motion.SmoothedMotion:
    t = np.linspace(0.0, 0.4, 21)
    q = np.tile(multibody.diver_planar().configuration("A"), (21, 1))
    markers = motion.MarkerSet.joint_centres(multibody.diver_planar().model)
    return motion.smooth_motion(markers, motion.place_markers(markers, t, q), noise=0.01, scale=1.0)


@cache
def scaled() -> motion.ScaledModel:
    q = np.tile(multibody.diver_planar().configuration("A"), (3, 1))
    markers = motion.MarkerSet.joint_centres(multibody.diver_planar().model)
    return motion.scale_model(markers, motion.place_markers(markers, [0.0, 0.1, 0.2], q), noise=0.01)


@cache
def tumbled() -> motion.InertiaEstimate:
    body = somersault.RigidBody(1.0, (1.0, 2.0, 2.5))
    tumble = somersault.exact.FreeBody(body, somersault.State(angular_velocity=(0.3, 1.0, 0.4)))
    t = np.linspace(0.0, 10.0, 40)
    return motion.estimate_inertia(t, tumble(t).orientation)


def analysed() -> motion.FlightAnalysis:
    found = reconstructed()
    seen = motion.place_markers(found.markers, found.times, found.q)
    return motion.analyse(seen, found.markers, noise=0.01, scale=1.0, optimum=False)


@cache
def unvertical() -> motion.FlightAdvice:
    """Advice on a straight half somersault that is short."""
    diver = multibody.diver_planar()
    straight = diver.configuration("A")
    v = np.zeros(12)
    v[:3] = 1.0, 4.0, -2.6
    run = multibody.fly(diver.model, straight, v, lambda t: (straight[3:], v[3:]), (0.0, 1.0), dt=0.02)
    markers = motion.MarkerSet.joint_centres(diver.model)
    seen = motion.place_markers(markers, run.t, run.q)
    points = seen.points + np.random.default_rng(1).normal(0.0, 0.005, seen.points.shape)
    noisy = motion.MarkerRecording(seen.names, seen.times, points)
    flight = motion.reconstruct_flight(markers, noisy, scale=1.0, interval=(0.0, 1.0))
    return motion.advise_flight(flight, half_somersaults=1)


def skeleton() -> motion.Skeleton:
    return motion.Skeleton(
        [motion.SkeletonJoint("hip", moves=True), motion.SkeletonJoint("knee", 0, (0, 0, -1))]
    )


def walk() -> motion.SkeletonRecording:
    still = np.tile([0.0, 0.0, 0.0, 1.0], (20, 2, 1))
    return motion.SkeletonRecording(skeleton(), TIMES, still, np.zeros((20, 1, 3)))


def ways() -> Callable[[], Any]:
    return lambda: None


def invert(x: float) -> float:
    return 1.0 / x


#: How an object of each public class is made.
MADE: dict[str, Callable[[], Any]] = {
    # bodies and their motions
    "ChannelRecording": lambda: motion.ChannelRecording(["hip"], TIMES, np.zeros((20, 1))),
    "Repair": repaired,
    "RigidBody": lambda: BODY,
    "Function": lambda: somersault.expr.Function(lambda x, u: x * u, x=(7, 3), u=()),
    "State": lambda: STATE,
    "Solution": run,
    "Trajectory": lambda: run().sol(TIMES * 0.1),
    "DenseOutput": lambda: run().sol,
    "MethodInfo": lambda: integrators.method("rkmk8_b"),
    "MethodTable": integrators.methods,
    "FreeBody": lambda: somersault.exact.FreeBody(BODY, STATE),
    "Gyrostat": lambda: somersault.exact.Gyrostat(BODY, (1 / 3, 0.2, 1 / 7), STATE),
    "Stepper": lambda: somersault.Stepper(BODY, STATE, 0.0, 1.0),
    "Orbit": lambda: ORBIT,
    "GravityGradient": lambda: forces.GravityGradient(ORBIT),
    "MagneticDipole": lambda: forces.MagneticDipole((1 / 3, 0.2, 1 / 7), (0.0, 0.0, 7.8e15), ORBIT),
    "Plate": lambda: forces.Plate(1 / 3, (1 / 3, 0.2, 1 / 7), (0.1, 0.2, 0.3), 1 / 3, 1 / 7),
    "AerodynamicDrag": lambda: forces.AerodynamicDrag(ORBIT, [forces.Plate(1.0, (0, 0, 1))] * 20, 1e-12 / 3),
    "SolarPressure": lambda: forces.SolarPressure((1 / 3, 0.2, 1 / 7), [forces.Plate(1.0, (0, 0, 1))] * 20),
    "ReactionWheels": lambda: forces.ReactionWheels(np.eye(3), 0.0, 1 / 3),
    "ControlMomentGyros": lambda: forces.ControlMomentGyros([(0, 0, 1)], [(1, 0, 0)], 1 / 3),
    "Drag": lambda: forces.Drag(1 / 3, 2 / 3, 1 / 7),
    "Force": lambda: forces.Force((1 / 3, 2 / 3, 1 / 7), (0.1, 0.2, 0.3)),
    "Gravitation": forces.Gravitation,
    "Gravity": forces.Gravity,
    "Spring": lambda: forces.Spring(
        1 / 3, (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), damping=1 / 7, rest_length=2 / 3
    ),
    "CentralGravity": lambda: forces.CentralGravity(1 / 3, (1 / 7, 0.0, 2 / 3)),
    "ScheduledTorque": lambda: forces.ScheduledTorque(np.arange(50) / 7, np.ones((50, 3)) / 3),
    "Torque": lambda: forces.Torque((1 / 3, 2 / 3, 1 / 7), frame="body"),
    "TracedForce": lambda: forces.traced(lambda t, state: (-t * state.position, state.velocity)),
    # contact
    "CompliantLaw": lambda: LAW,
    "HuntCrossley": lambda: contact.HuntCrossley(1e6 / 3, 0.1),
    "CoulombFriction": lambda: contact.CoulombFriction(1 / 3, 1e4 / 3, 2 / 3, 0.5),
    "RegularisedFriction": lambda: contact.RegularisedFriction(1 / 3, 0.01),
    "Resistance": lambda: contact.Resistance(1e-3, 2e-3, 0.1),
    "Contact": touch,
    "SpherePair": lambda: contact.SpherePair((0, 1), (1 / 3, 2 / 3), LAW),
    "ContactSystem": contact.spinning_top,
    "HalfSpace": lambda: PLANE,
    "SphericalSurface": lambda: contact.SphericalSurface((0.1, 0.2, 0.3), 2 / 3, solid="outside"),
    "CylindricalSurface": lambda: contact.CylindricalSurface((0.1, 0.2, 0.3), (0.0, 0.6, 0.8), 2 / 3),
    "SurfaceFunction": lambda: contact.SurfaceFunction(ways, lipschitz=2.0),
    "Event": lambda: bounce().events[0],
    "LinkContact": lambda: contact.LinkContact("f" * 90, "shank", touch()),
    "LinkEvent": lambda: hop().events[0],
    "LinkPair": lambda: contact.LinkPair("p" * 90, ("a", "b"), (1 / 3, 2 / 3), LAW),
    "Platform": lambda: contact.Platform("p" * 90, still),
    "TreeOnPlatforms": lambda: contact.TreeOnPlatforms(
        multibody.cart_pendulum(), [contact.Platform("p" * 90, still)]
    ),
    "TreeContactSystem": contact.hopping_leg,
    "TreeContacts": lambda: contact.TreeContacts(contact.hopping_leg().model, contact.hopping_leg().contacts),
    "Sensitivities": lambda: contact.differentiate(BODY, STATE, (0.0, 0.01), dt=1e-3, contacts=[touch()]),
    "TreeGradient": gradient_of_a_hop,
    "TreeSensitivities": slope_of_a_hop,
    # trees
    "Diver": lambda: DIVER,
    "Geometry": lambda: robot().geometry[0],
    "Link": lambda: multibody.Link("l" * 90, "revolute", parent="p" * 90, axis=(0.1, 0.2, 0.3), mass=1 / 3),
    "Model": lambda: multibody.Model([multibody.Link("root " * 90, "free", mass=1.0, inertia=(1, 1, 1))]),
    "Robot": robot,
    "TorqueProfile": lambda: multibody.TorqueProfile([0.0, 1 / 3], [[1 / 3, 2 / 3], [0.1, 0.2]]),
    "TreeDenseOutput": lambda: swing().sol,
    "TreeSolution": swing,
    # studies
    "Convergence": lambda: studies.convergence(studies.Problem.case(1), "heun", [0.1, 0.05]),
    "EnergyStudy": lambda: studies.energy("rkmk", studies.prisms(2), steps=[1, 2]),
    "Problem": studies.Problem.spring_pendulum,
    "StabilityRegion": lambda: studies.stability_region("heun"),
    "WorkPrecision": lambda: studies.work_precision(studies.Problem.case(1), "heun", [0.1], repeats=1),
    # optimal motions
    "CartPendulumProblem": ocp.CartPendulumProblem,
    "CollocationResult": moved,
    "ExternalFunction": lambda: ocp.ExternalFunction(np.interp, 3, jacobian=np.interp),
    "ControlProblem": lambda: ocp.ControlProblem(lambda x, u: u, states=1, controls=1, final=[1]),
    "Constraint": lambda: ocp.Constraint(
        ocp.entries("torque"), [-1 / 3] * 90, [1 / 3] * 90, at="node", node=3
    ),
    "Cost": lambda: ocp.Cost(ocp.entries("torque", [0]), at="finish", phase=0),
    "Dive": lambda: ocp.dive_5174d(twists=-2),
    "DiveSolution": dive,
    "DiveVerification": lambda: dive().verification,
    "MinimizeResult": lambda: nlp.minimize(lambda x: (x[0] - 1 / 3) ** 2, [0.0]),
    "EigenpostureBase": lambda: ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0]]),
    "LiteralDive": lambda: dive().literal(20),
    "Motion": lambda: ocp.CartPendulumProblem().motion(np.zeros(5)),
    "MotionProblem": problem,
    "MultiphaseProblem": lambda: ocp.MultiphaseProblem([block()]),
    "MultiphaseResult": lambda: ocp.MultiphaseProblem([block()]).solve(tol=1e-3, n_intervals=4),
    "Phase": lambda: ocp.Phase(ocp.SplineMotion(1, 8), (0.5, 1.5), 20, n_segments=2),
    "Report": lambda: moved().report,
    "SearchResult": lambda: ocp.CartPendulumProblem().search(1),
    "PolishResult": lambda: thrown().polish(thrown().solve(tol=1e-3, n_intervals=4)),
    "SolutionSensitivity": lambda: block().sensitivity(block().solve(tol=1e-3, n_intervals=4)),
    "SplineMotion": lambda: ocp.SplineMotion(2, 8),
    "SwingUpVerification": lambda: ocp.CartPendulumProblem().verify(np.zeros(5)),
    "Term": lambda: ocp.function(ways),
    "Verification": lambda: moved().verification,
    # hyper-sensitive problems
    "ArmExtremal": lambda: ftla.ArmExtremal(np.pi, 1, 2 / 3, extremal()),
    "Chain": lambda: FLOW.chain([1.0, 0.4], [1.0, 2.0]),
    "ContinuationResult": lambda: ftla.cold_start(LINEAR, [1.0], [1.0], 3.0),
    "Diagnosis": lambda: ftla.diagnose(FLOW.spectra([1.0, 0.4], [1.0, 2.0, 4.0]), 40.0),
    "ExponentConvergence": lambda: ftla.exponent_convergence(
        FLOW.spectra([1.0, 0.4], np.linspace(0.1, 2, 30))
    ),
    "Extremal": extremal,
    "FtleField": lambda: ftla.ftle_field(FLOW, np.zeros((2, 3, 2)), 1.0),
    "Following": lambda: placement().following(FLOW, extremal(), [1.0, 0.0], [1e-3], 0.1)[0],
    "LyapunovSpectrum": lambda: ftla.lyapunov_spectrum(FLOW, [0.0, 0.0], 10.0),
    "Matching": matching,
    "MatchingResult": lambda: matching().least_squares(max_rounds=1),
    "Placement": placement,
    "PlacementResult": lambda: placement().place(FLOW, [1.0, 0.4]),
    "Ridge": lambda: ftla.Ridge(np.ones((3, 2)) / 3, np.ones(3) / 3, np.ones(3) / 3),
    "Spectrum": lambda: ftla.VariationalFlow(ftla.arm()).spectrum(np.full(8, 0.1), 1.0),
    "Splitting": lambda: ftla.Splitting(
        FLOW.spectrum([1.0, 0.4], 2.0), FLOW.spectrum([1.0, 0.4], 2.0, "backward"), (1, 0, 1)
    ),
    "Subspace": lambda: ftla.Subspace([[1.0, 0.0, 0.0]]),
    "System": lambda: ftla.tree(DIVER.model, np.full(12, 1 / 3), torque_limits=np.full(12, 2 / 3)),
    "Transition": lambda: FLOW.transition([1.0, 0.4], 1.0),
    "VariationalFlow": lambda: FLOW,
    # recorded motions
    "AwardTable": awards,
    "Band": lambda: motion.Band(np.eye(3)),
    "Baseline": lambda: validation().baselines[0],
    "Correlation": lambda: validation().pearson,
    "DiveFaults": lambda: motion.DiveFaults(1 / 3, 2 / 3, 1 / 7, 0.1, 23 / 3),
    "FlightPhase": lambda: motion.find_flight(4.0 * TIMES - 4.905 * TIMES**2, times=TIMES),
    "Advice": lambda: unvertical().advice[0],
    "FlightAdvice": lambda: unvertical(),
    "FlightAnalysis": analysed,
    "InertiaEstimate": tumbled,
    "WhatIf": lambda: motion.what_if(reconstructed(), momentum=0.1),
    "FlightReport": lambda: motion.identify_flight(reconstructed()),
    "GroupComparison": lambda: motion.GroupComparison({f"group {i}": [fit()] for i in range(90)}, "scale"),
    "JudgedSet": lambda: dives().judged_set(),
    "MarkerFit": lambda: motion.MarkerFit(motion.MarkerSet.joint_centres(ARM)),
    "KeypointRecording": lambda: motion.KeypointRecording(
        ["hip"], TIMES, np.zeros((20, 1, 2)), np.ones((20, 1))
    ),
    "MarkerRecording": lambda: motion.MarkerRecording(["hip"], TIMES, np.zeros((20, 1, 3))),
    "MarkerSet": lambda: motion.MarkerSet.joint_centres(ARM),
    "MotionFit": fit,
    "ReconstructedFlight": reconstructed,
    "ScaledModel": scaled,
    "SmoothedMotion": smoothed,
    "Pca": lambda: motion.Pca(np.eye(3)),
    "Performance": lambda: dives().performances()[0],
    "Perturbation": lambda: motion.Perturbation(exit_delay=1 / 300, looseness=1 / 7, wobble=1 / 3),
    "Projection": lambda: motion.project(ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0]]), [[0.5, 1.0]]),
    "Score": lambda: scorer().score(dives().performances()[0]),
    "ScoringModel": scorer,
    "ScoringOptions": motion.ScoringOptions,
    "Skeleton": skeleton,
    "SkeletonJoint": lambda: motion.SkeletonJoint("knee " * 90, 0, (0.0, 0.0, -0.4)),
    "SkeletonRecording": walk,
    "SyntheticDive": lambda: flight().perturb(motion.Perturbation()),
    "SyntheticFlight": flight,
    "SyntheticJudge": lambda: motion.SyntheticJudge(motion.DiveFaults(0.1, 0.1, 0.1, 0.1, 0.1)),
    "SyntheticSet": dives,
    "Validation": validation,
    # the exam of engines
    "ExamReport": examined,
    "ExamScene": lambda: exam.scene("sleeping_top").varied(1 / 3),
    "SceneContact": lambda: exam.scene("hard_bounce").contacts[0],
    "SceneHinge": lambda: exam.scene("double_pendulum").hinges[0],
    "SceneGuard": lambda: exam.scene("dry_oscillator").modes["left again"].guards[0],
    "SceneMode": lambda: exam.scene("dry_oscillator").modes["left again"],
    "SceneResult": lambda: examined()["rod"],
    # sweeps and pages
    "Failure": lambda: sweep.Failure("ValueError", "a message\nof many lines " * 90),
    "Sweep": lambda: sweep.run(invert, sweep.grid(x=[0.0, 1.0, 2.0]), version="1"),
    "Box": lambda: viewer.Box((0.1, 0.2, 0.3)),
    "Capsule": lambda: viewer.Capsule((0, 0, 0), (0, 0, 1 / 3), 0.1, 0.2),
    "Cylinder": lambda: viewer.Cylinder((0, 0, 0), (0, 0, 1 / 3), 0.1),
    "Mesh": lambda: viewer.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 1 / 3]], [[0, 1, 2]]),
    "Ellipsoid": lambda: viewer.Ellipsoid((1 / 3, 2 / 3, 1 / 7)),
    "Loft": lambda: viewer.Loft([(z, 0.0, 0.0, 0.1, 0.1) for z in range(90)]),
    "Scene": lambda: viewer.Scene("a long title " * 90),
    "Sphere": lambda: viewer.Sphere(0.1),
}


def classes() -> set[str]:
    """The public classes but exceptions, whose text is their message."""
    kinds = (thing for thing in public_names.things().values() if inspect.isclass(thing))
    return {kind.__name__ for kind in kinds if not issubclass(kind, BaseException)}


def test_each_public_class_has_an_entry() -> None:
    assert set(MADE) | BASES == classes() and not set(MADE) & BASES


@pytest.mark.parametrize("name", MADE)
def test_a_line_says_what_it_is(name: str) -> None:
    thing = MADE[name]()
    assert type(thing).__name__ == name
    taken, texts = [], set()
    for _ in range(3):
        began = time.perf_counter()
        texts.add(repr(thing))
        taken.append(time.perf_counter() - began)
    (text,) = texts
    # either a call of the class, or the class with what matters in angle brackets
    assert re.fullmatch(rf"{name}\(.*\)|<{name}\b.*[^ ]>", text), text
    assert len(text) <= LONGEST and " at 0x" not in text.replace("function ways at 0x", ""), (len(text), text)
    assert min(taken) < LONGEST_TIME, f"{min(taken):.1e} s: it computes something"


def test_a_result_is_printed_without_its_verification() -> None:
    solution, report = dive().dive.solve(dive().z), problem().solve(np.zeros(problem().n_variables))
    for result in (solution, solution.report, report):
        assert "not re-integrated yet" in repr(result)
    assert solution.confirmed and report.confirmed is not None
    for result in (solution, solution.report, report):
        assert "confirmed" in repr(result).lower() and "not re-integrated yet" not in repr(result)
