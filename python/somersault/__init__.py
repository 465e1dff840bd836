"""Simulate and optimise the motion of rigid and articulated bodies.

>>> import somersault
>>> body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
>>> start = somersault.State(angular_velocity=(0.0, 8.0, 0.1))
>>> motion = somersault.integrate(body, start, (0.0, 1.0), dt=0.01)
>>> motion.status
0

Units are SI and angles radians. Everything is in the world frame but for names that end in
``_body``. Quaternions are in SciPy's order (x, y, z, w) and lead from the body frame to the world.
"""

from typing import TYPE_CHECKING

from somersault import (
    batch,
    contact,
    errors,
    exact,
    expr,
    forces,
    ftla,
    integrators,
    motion,
    multibody,
    nlp,
    ocp,
    studies,
    sweep,
)
from somersault._somersault import __version__ as __version__
from somersault._somersault.integrators import (
    DenseOutput,
    MethodInfo,
    MethodTable,
    RigidBody,
    Solution,
    State,
    Stepper,
    Trajectory,
    integrate,
    methods,
)
from somersault._somersault.multibody import Model
from somersault.errors import InputError, SomersaultError
from somersault.storage import load, save

if TYPE_CHECKING:
    from somersault import exam as exam
    from somersault import plotting as plotting
    from somersault import viewer as viewer
else:
    import importlib

    #: Imported when they are first used: SciPy's rotations and matplotlib take longer than all the rest, and
    #: most programs examine no engine.
    _LATE = ("exam", "plotting", "viewer")

    def __getattr__(name):
        if name in _LATE:
            return importlib.import_module(f"somersault.{name}")
        raise AttributeError(f"module 'somersault' has no attribute {name!r}")

    def __dir__():
        return sorted({*globals(), *_LATE})


# Without `plotting`: a star takes all that is listed, and matplotlib may not be installed.
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
    "Stepper",
    "Trajectory",
    "batch",
    "contact",
    "errors",
    "exact",
    "exam",
    "expr",
    "forces",
    "ftla",
    "integrate",
    "integrators",
    "load",
    "methods",
    "motion",
    "multibody",
    "nlp",
    "ocp",
    "save",
    "studies",
    "sweep",
    "viewer",
]
