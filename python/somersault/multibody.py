"""Articulated bodies: trees and their dynamics, at one configuration or at many.

M(q) a + h(q, v) = τ + Σ Jᵀ f, with the mass matrix M, the bias h, joint forces τ and external wrenches f.
A `Model` is made of `Link` objects, or read from URDF or MJCF; `cart_pendulum` and the like make those with a
name. `integrate_tree` moves a tree, `rollout` many copies of it, and `fly` one in the air whose joints move
as prescribed.

>>> import numpy as np
>>> from somersault import multibody
>>> arm = multibody.two_link_arm()
>>> q, v, torque = np.zeros((100, 2)), np.zeros(2), np.linspace((0, 0), (1, 0), 100)
>>> arm.forward_dynamics(q, v, torque).shape
(100, 2)
"""

from somersault._somersault import multibody as _extension
from somersault._somersault.multibody import *  # noqa: F403

__all__ = _extension.__all__
