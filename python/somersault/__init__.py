"""Motion of rigid bodies: geometric integration on R^3 x SO(3) with evidence.

>>> import somersault
>>> body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
>>> start = somersault.State(angular_velocity=(0.0, 8.0, 0.1))
>>> motion = somersault.integrate(body, start, (0.0, 1.0), dt=0.01)
>>> motion.status
0

Units are SI and angles radians. Everything is in the world frame but for names that end in
``_body``. Quaternions are in SciPy's order (x, y, z, w) and lead from the body frame to the world.
"""

from somersault import (
    batch,
    contact,
    errors,
    exact,
    forces,
    ftla,
    integrators,
    motion,
    multibody,
    ocp,
    studies,
    sweep,
)
from somersault._somersault import (
    DenseOutput,
    MethodInfo,
    MethodTable,
    Model,
    RigidBody,
    Solution,
    State,
    Trajectory,
    integrate,
    methods,
)
from somersault._somersault import __version__ as __version__
from somersault.errors import InputError, SomersaultError
from somersault.storage import load, save

__all__ = [
    "DenseOutput",
    "InputError",
    "MethodInfo",
    "MethodTable",
    "Model",
    "RigidBody",
    "Solution",
    "SomersaultError",
    "State",
    "Trajectory",
    "batch",
    "contact",
    "errors",
    "exact",
    "forces",
    "ftla",
    "integrate",
    "integrators",
    "load",
    "methods",
    "motion",
    "multibody",
    "ocp",
    "save",
    "studies",
    "sweep",
]
