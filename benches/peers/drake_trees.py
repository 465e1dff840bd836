"""Trees on the ground in Drake: planar chains, and the quadruped of its file.

Drake's contact of points is of its own kind: N = k x (1 + d x') with the dissipation d, and a friction that
grows with the sliding velocity up to a stiction tolerance. With a step of zero its integrators control
their error; else it solves a problem of contact in each of equal steps.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from compiled import Array
from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, SceneGraphConfig, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PlanarJoint,
    RevoluteJoint,
    RevoluteSpring,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, ConstantVectorSource, Sine

# It says of every half-space that deformable bodies do not touch it.
logging.getLogger("drake").setLevel(logging.ERROR)


class PlanarLink(NamedTuple):
    """Mass, moment, centre of mass and place on the one before of a link along (sin a, -cos a)."""

    mass: float
    moment: float
    center: float
    hangs_at: float


class Ground(NamedTuple):
    """Stiffness, dissipation and friction of contacts, SI units."""

    stiffness: float
    dissipation: float
    friction: float


@dataclass(frozen=True, eq=False)
class Scene:
    """A plant that is built for a step, where it starts, and for how long it moves."""

    diagram: Diagram
    plant: MultibodyPlant
    start: Array
    duration: float

    def end(self, integrator: str | None = None, accuracy: float = 0.0) -> Array:
        """Positions and velocities at the end, by an integrator with error control or in equal steps."""
        simulator = Simulator(self.diagram)
        context = self.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        self.plant.SetPositionsAndVelocities(context, self.start)
        if integrator is not None:
            ResetIntegratorFromFlags(simulator, integrator, 0.01)
            stepper = simulator.get_mutable_integrator()
            stepper.set_fixed_step_mode(False)
            stepper.set_target_accuracy(accuracy)
            stepper.set_requested_minimum_step_size(1e-12)
        simulator.Initialize()
        simulator.AdvanceTo(self.duration)
        return np.array(self.plant.GetPositionsAndVelocities(context))


def _ground(plant: MultibodyPlant, ground: Ground) -> ProximityProperties:
    """Adds the plane z = 0; returns the properties of what touches it. Both springs act in series."""
    friction = CoulombFriction(ground.friction, ground.friction)
    properties = ProximityProperties()
    AddContactMaterial(ground.dissipation, 2.0 * ground.stiffness, friction, properties)
    plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "ground", properties)
    return properties


def planar(
    links: Sequence[PlanarLink],
    points: Sequence[tuple[int, float]],
    ground: Ground,
    torques: Sequence[tuple[float, float, float, float]],
    start: Array,
    duration: float,
    step: float,
) -> Scene:
    """A chain with points on links, by their distance, and torques (mean, amplitude, rate, phase)."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, step)
    properties = _ground(plant, ground)
    upright = RigidTransform(RotationMatrix([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))
    frame, placed, bodies = plant.world_frame(), upright, []
    for i, (mass, moment, center, hangs_at) in enumerate(links):
        about = UnitInertia(*[moment / mass] * 3)
        inertia = SpatialInertia(mass, [0.0, 0.0, 0.0], about).Shift([0.0, center, 0.0])
        body = plant.AddRigidBody(f"link {i}", inertia)
        if i > 0:
            frame, placed = bodies[-1].body_frame(), RigidTransform([0.0, -hangs_at, 0.0])
        on = plant.AddFrame(FixedOffsetFrame(f"hinge {i}", frame, placed))
        if i == 0:
            plant.AddJoint(PlanarJoint("root", on, body.body_frame(), [0.0, 0.0, 0.0]))
        else:
            hinge = plant.AddJoint(RevoluteJoint(f"joint {i}", on, body.body_frame(), [0.0, 0.0, 1.0]))
            if torques:
                plant.AddJointActuator(f"motor {i}", hinge)
        bodies.append(body)
    for k, (link, distance) in enumerate(points):
        place = RigidTransform([0.0, -distance, 0.0])
        plant.RegisterCollisionGeometry(bodies[link], place, Sphere(1e-6), f"point {k}", properties)
    plant.Finalize()
    if torques:
        _drive(builder, plant, torques)
    return Scene(builder.Build(), plant, start, duration)


def _drive(
    builder: DiagramBuilder, plant: MultibodyPlant, torques: Sequence[tuple[float, float, float, float]]
) -> None:
    """Torques mean + amplitude sin(rate t + phase) of the motors."""
    means, amplitudes, rates, phases = (list(of) for of in zip(*torques, strict=True))
    mean = builder.AddSystem(ConstantVectorSource(means))
    wave = builder.AddSystem(Sine(amplitudes, rates, phases, True))
    total = builder.AddSystem(Adder(2, len(torques)))
    builder.Connect(mean.get_output_port(), total.get_input_port(0))
    builder.Connect(wave.get_output_port(0), total.get_input_port(1))
    builder.Connect(total.get_output_port(), plant.get_actuation_input_port())


def of_urdf(
    text: str,
    root: str,
    ground: Ground,
    holds: Sequence[tuple[str, float, float]],
    height: float,
    duration: float,
    step: float,
) -> Scene:
    """The tree of a URDF file, level at a height, with springs (joint, stiffness, angle) that hold it."""
    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, step)
    config = SceneGraphConfig()
    config.default_proximity_properties.point_stiffness = 2.0 * ground.stiffness
    config.default_proximity_properties.hunt_crossley_dissipation = ground.dissipation
    config.default_proximity_properties.static_friction = ground.friction
    config.default_proximity_properties.dynamic_friction = ground.friction
    scene.set_config(config)
    _ground(plant, ground)
    Parser(plant).AddModelsFromString(text, "urdf")
    for joint, stiffness, angle in holds:
        plant.AddForceElement(RevoluteSpring(plant.GetJointByName(joint), angle, stiffness))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetFreeBodyPose(context, plant.GetBodyByName(root), RigidTransform([0.0, 0.0, height]))
    for joint, _, angle in holds:
        plant.GetJointByName(joint).set_angle(context, angle)
    return Scene(builder.Build(), plant, plant.GetPositionsAndVelocities(context), duration)
