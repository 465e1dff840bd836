"""Optimal motions: splines, eigenpostures, shooting and solvers.

A `MotionProblem` is a tree whose driven joints follow splines and whose passive ones follow the equations of
motion. Costs and constraints are made of terms: `entries` of the motion, `displacement` from a configuration,
`momentum`, `point_position`, `axis_direction`, `body_orientation`, and any user-defined `function`. A `Dive`
is a problem of its own kind; `dive_107b` and `dive_5174d` are those of the thesis.

`success` says that a program is solved, `confirmed` that an accurate integration agrees with its motion;
each result has what that found as `verification`. Results and problems are written by `somersault.save`.

A `ControlProblem` is any problem of optimal control: dynamics, costs and constraints are functions of NumPy,
or dynamics are those of a tree. Direct collocation solves it, with costates, on meshes refined to a
tolerance; a `MultiphaseProblem` is several of them, linked. An
`ExternalFunction` takes part though it cannot be traced. `CartPendulumProblem` and `arm_problem` are the two
examples of the thesis.

>>> import numpy as np
>>> from somersault import multibody, ocp
>>> conditions = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
>>> cart = ocp.SplineMotion(1, 10, conditions)
>>> problem = ocp.MotionProblem(
...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [ocp.Phase(cart, 1.0, 50)], active=["cart"],
...     costs=[ocp.Cost(ocp.entries("torque", [0])),
...            ocp.Cost(ocp.displacement([0.0, np.pi - 0.3], [1]), 1e4, at="finish")])
>>> report = problem.solve(np.zeros(problem.n_variables) + 0.1)
>>> report.status
'converged'
>>> float(problem.motion(report.z).q[-1, 1]).__round__(2)
2.85
"""

from somersault._arm import arm_motion, arm_problem
from somersault._batch import solve_batch
from somersault._control_problem import ControlProblem
from somersault._external import ExternalFunction
from somersault._multiphase_problem import MultiphaseProblem
from somersault._somersault import ocp as _extension
from somersault._somersault.ocp import *  # noqa: F403

__all__ = [
    "ControlProblem",
    "ExternalFunction",
    "MultiphaseProblem",
    "arm_motion",
    "arm_problem",
    "solve_batch",
]
__all__ += [name for name in _extension.__all__ if not name.startswith("Traced")]
