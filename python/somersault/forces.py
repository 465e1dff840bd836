"""Forces and torques on rigid bodies.

`somersault.integrate` takes these models, callables ``f(t, state) -> (force, torque)``, and lists of
both, which add up. Forces in N and torques about the centre of mass in N m, world frame.
"""

from somersault._somersault.forces import (
    AerodynamicDrag,
    CentralGravity,
    ControlMomentGyros,
    Drag,
    Force,
    ForceModel,
    Gravitation,
    Gravity,
    GravityGradient,
    MagneticDipole,
    Orbit,
    Plate,
    ReactionWheels,
    ScheduledTorque,
    SolarPressure,
    Spring,
    Torque,
    TracedForce,
)
from somersault._traced_force import traced

__all__ = [
    "AerodynamicDrag",
    "CentralGravity",
    "ControlMomentGyros",
    "Drag",
    "Force",
    "ForceModel",
    "Gravitation",
    "Gravity",
    "GravityGradient",
    "MagneticDipole",
    "Orbit",
    "Plate",
    "ReactionWheels",
    "ScheduledTorque",
    "SolarPressure",
    "Spring",
    "Torque",
    "TracedForce",
    "traced",
]
