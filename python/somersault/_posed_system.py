"""The state-costate system of a problem that `ocp` poses."""

from __future__ import annotations

from somersault._control_problem import ControlProblem
from somersault._somersault.ftla import System
from somersault.errors import InputError

__all__ = ["system_of"]


def system_of(problem: ControlProblem) -> System:
    """The state-costate system of an `ocp.ControlProblem`, p = (x, λ), with all derivatives exact.

    Minimise ∫ ℓ(x, u) dt subject to dx/dt = f(x, u): with K = λᵀf + ℓ the extremals obey dx/dt = f and
    dλ/dt = -∂K/∂x at the control that minimises K within its bounds. f, ℓ and the derivatives of K are
    evaluated from the graphs of the problem, without the interpreter; the control is found by a projected
    Newton's method, and where it reaches or leaves a bound is located.

    Parameters
    ----------
    problem : ControlProblem
        Of traced functions or of a tree, which do not depend on time, with λᵀf + ℓ strictly convex in u, and
        controls that may have bounds. Its parameters are given. Bounds of states, path and end constraints,
        end costs and quaternions have no place in such a system.

    Returns
    -------
    System
        For all of this module. `cold_start` takes ends and duration from the problem.

    Raises
    ------
    InputError
        If `problem` is not such a problem; the message says in what.
    EvaluationError
        By whatever calls it, where no control minimises K, as where K is affine in u.

    Examples
    --------
    >>> from somersault import ftla, ocp
    >>> problem = ocp.ControlProblem(
    ...     lambda x, u: -(x.x**3) + u.u, states=("x",), controls=("u",),
    ...     running_cost=lambda x, u: 0.5 * (x.x**2 + u.u**2),
    ...     initial={"x": 1.0}, final={"x": 1.5}, duration=40.0)
    >>> found = ftla.cold_start(ftla.system_of(problem))
    >>> found.success, round(found.extremal.cost(), 9)
    (True, 3.362056905)
    """
    if not isinstance(problem, ControlProblem):
        raise InputError(f"`problem` must be a ControlProblem, found {type(problem).__name__}")
    description = f"extremals of {problem!r}"
    return System._of_problem(problem._posed, description, (system_of, (problem,)))
