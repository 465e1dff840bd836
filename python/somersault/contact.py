"""Compliant frictional contact: the integrator locates every touch-down and release, and keeps its order.

`somersault.integrate` takes `Contact` objects, and `SpherePair` objects between several bodies. A step is
cut where a contact begins or ends, and what happened is in the `events` of the solution. Links of a tree
touch in `multibody.integrate_tree`, which takes `LinkContact` and `LinkPair` objects.

>>> import somersault
>>> from somersault import contact
>>> law = contact.CompliantLaw.from_restitution(1.0, 1e4, 0.5)
>>> ball = contact.bouncing_ball(1.0, 0.1, law, height=1.0)
>>> motion = somersault.integrate(
...     ball.body, ball.state, (0.0, 0.6), dt=0.01, forces=ball.forces, contacts=ball.contacts
... )
>>> [event.kind for event in motion.events]
['touch_down', 'release']
"""

from somersault._somersault import contact as _extension
from somersault._somersault.contact import *  # noqa: F403

__all__ = _extension.__all__
