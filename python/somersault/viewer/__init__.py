"""A self-contained HTML viewer that works offline: motions of rigid bodies, trees and dives.

A `Scene` holds motions and what stands around them, and writes one file of HTML that loads nothing. It
plays them with a slider of time, a camera that turns by mouse or touch, trails, points that touch, and
arrows of contact forces, angular momentum and angular velocity; two motions can be put side by side.
`Scene.export` makes a GIF or an MP4.

>>> import numpy as np
>>> from somersault import multibody, viewer
>>> diver = multibody.diver_spatial()
>>> t = np.linspace(0.0, 1.4, 60)
>>> q = np.tile(diver.configuration("F"), (60, 1))
>>> q[:, 2] = 10.0 + 1.2 + 4.0 * t - 4.905 * t**2
>>> scene = viewer.Scene("A tuck").add(diver.model, t, q).water(0.0).platform(10.0)
>>> len(scene.html()) < 300_000
True

Results are added as they are: a solution brings its bodies and what they touch, a dive its diver, a recording
its markers or its skeleton.

>>> import somersault
>>> top = somersault.contact.spinning_top()
>>> run = somersault.integrate(
...     top.body, top.state, (0.0, 0.1), dt=1e-4, forces=top.forces, contacts=top.contacts
... )
>>> page = viewer.Scene("A top").add(run).html()
"""

from somersault.viewer.figures import equivalent_ellipsoid, figure
from somersault.viewer.scene import Scene, animate
from somersault.viewer.shapes import Box, Capsule, Cylinder, Ellipsoid, Loft, Mesh, Shape, Sphere

__all__ = [
    "Box",
    "Capsule",
    "Cylinder",
    "Ellipsoid",
    "Loft",
    "Mesh",
    "Scene",
    "Shape",
    "Sphere",
    "animate",
    "equivalent_ellipsoid",
    "figure",
]
