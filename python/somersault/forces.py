"""Forces and torques on rigid bodies.

`somersault.integrate` takes these models, callables ``f(t, state) -> (force, torque)``, and lists of
both, which add up. Forces in N and torques about the centre of mass in N m, world frame.
"""

from somersault._somersault.forces import Drag, Force, ForceModel, Gravitation, Gravity, Spring, Torque

__all__ = ["Drag", "Force", "ForceModel", "Gravitation", "Gravity", "Spring", "Torque"]
