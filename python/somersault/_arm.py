"""The arm of thesis 8.4 by direct collocation."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from somersault._control_arguments import _values
from somersault._control_problem import ControlProblem
from somersault._somersault.multibody import two_link_arm
from somersault._somersault.ocp import CollocationResult
from somersault.errors import InputError

__all__ = ["arm_motion", "arm_problem"]

_START = (-np.pi / 2, 0.05, 0.0, 0.0)
_FINISH = (np.pi / 2, 0.05, 0.0, 0.0)


def arm_problem(
    initial: Sequence[Any] = _START,
    final: Sequence[Any] = _FINISH,
    duration: float | tuple[float, float] = 10.0,
    *,
    control_weights: ArrayLike = (1.0, 0.5),
    masses: tuple[float, float] = (0.5, 0.5),
    lengths: tuple[float, float] = (2.0, 0.5),
    damping: tuple[float, float] = (0.2, 0.0),
) -> ControlProblem:
    """The two-link arm from one posture to another with minimum effort ½ ∫ γ₁ u₁² + γ₂ u₂² dt.

    Without arguments it is the motion of thesis 8.4: ten seconds from one stretched posture to the
    opposite one.

    Parameters
    ----------
    initial, final : sequence, length 4
        (θ₁, θ₂, θ̇₁, θ̇₂), each a number, a pair of bounds, or None where it is free.
    duration : float or tuple of float
        s; a pair makes it a variable.
    control_weights : array_like, shape (2,)
        γ.
    masses, lengths, damping : tuple of float
        Of the links and their joints, kg, m, N m s.

    Returns
    -------
    ControlProblem

    Examples
    --------
    >>> from somersault import ocp
    >>> found = ocp.arm_problem((0, 0, 0, 0), (0.5, 0, 0, 0), 2.0).solve()
    >>> found.status, found.confirmed
    ('converged', True)
    """
    weights = _values("control_weights", control_weights)
    if weights.shape != (2,) or not (weights >= 0.0).all() or not np.isfinite(weights).all():
        raise InputError(
            f"`control_weights` must be two numbers that are not negative, found {control_weights!r}"
        )
    return ControlProblem(
        two_link_arm(masses, lengths, damping),
        initial=initial,
        final=final,
        duration=duration,
        running_cost=functools.partial(_effort, tuple(weights.tolist())),
    )


def _effort(weights: tuple[float, float], x: Any, u: Any) -> Any:
    return 0.5 * (weights[0] * u[0] ** 2 + weights[1] * u[1] ** 2)


def arm_motion(fold: float | None = None, turn: float = 0.0, **options: Any) -> CollocationResult:
    """The motion of thesis 8.4, or one of its other extremals.

    Parameters
    ----------
    fold : float, optional
        θ₂ along the middle of the guess, rad: ``numpy.pi`` as in the thesis, ``-numpy.pi`` for the other
        way round. A straight line from start to end unless given.
    turn : float, optional
        Added to the last θ₂, rad: ``-2 * numpy.pi`` ends in the same posture at less cost.
    options
        As those of `ControlProblem.solve`; the first mesh has 40 intervals of 4 points unless given.

    Returns
    -------
    CollocationResult

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ocp
    >>> found = ocp.arm_motion(np.pi, tol=1e-5)
    >>> found.status, bool(found.hamiltonian_spread < 1e-2)
    ('converged', True)
    """
    final = (_FINISH[0], _FINISH[1] + turn, 0.0, 0.0)
    options = {"n_intervals": 40, "n_points": 4, **options}
    problem = arm_problem(_START, final)
    guess: dict[str, ArrayLike] | None = None
    if fold is not None:
        folded = [(angle, fold, np.pi / 10, 0.0) for angle in (-0.4 * np.pi, 0.4 * np.pi)]
        guess = {"t": [0.0, 1.0, 9.0, 10.0], "x": [_START, *folded, final]}
    found: CollocationResult = problem.solve(guess, **options)
    return found
