"""Extremals of the two-link arm from its boundary states and the way it folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault._somersault import (
    Continued,
    Extremal,
    System,
    arm,
    continue_through,
    graded_times,
    travel_arm,
)
from somersault.errors import FtlaInputError

__all__ = ["ArmExtremal", "arm_extremals", "solve_arm"]

#: Longest horizon, s: beyond it are millions of nodes.
_LONGEST = 1e4


@dataclass(frozen=True)
class ArmExtremal:
    """One of several extremals of the arm."""

    #: θ₂ of the folded arm, rad.
    fold: float
    #: Whole turns added to the last θ₂.
    turns: int
    #: ½ ∫ γ₁u₁² + γ₂u₂² dt.
    cost: float
    extremal: Extremal

    def __reduce__(self) -> tuple[type[ArmExtremal], tuple[float, int, float, Extremal]]:
        return ArmExtremal, (self.fold, self.turns, self.cost, self.extremal)


def solve_arm(
    initial_state: ArrayLike,
    final_state: ArrayLike,
    horizon: float,
    *,
    fold: float = np.pi,
    system: System | None = None,
    **options: Any,
) -> Continued:
    """An extremal of the two-link arm from nothing but its end states and the way it folds.

    Between two rests from a spline of least effort, whose torques tell the costates; otherwise by
    continuation from a rest with the second link folded, through a travel of the folded arm, to the unfolded
    ends. Multiple shooting polishes.

    Parameters
    ----------
    initial_state, final_state : array_like, shape (4,)
        (θ₁, θ₂, dθ₁/dt, dθ₂/dt).
    horizon : float
        s.
    fold : float, optional
        θ₂ of the folded arm, rad: π, or −π for the other way round.
    system : System, optional
        As `arm` makes it; that of the thesis unless given.
    options
        ``tol``, ``max_iterations``, ``rtol`` and ``atol`` as those of `shoot`.

    Returns
    -------
    Continued
    """
    initial, final = _numbers("initial_state", initial_state, 4), _numbers("final_state", final_state, 4)
    horizon, fold = float(_numbers("horizon", horizon)), float(_numbers("fold", fold))
    _expect_options("solve_arm", options)
    if not 0.0 < horizon <= _LONGEST:
        raise FtlaInputError(f"`horizon` must be positive and at most {_LONGEST:g} s, found {horizon}")
    system = arm() if system is None else system
    if isinstance(system, System) and system.dimension != 8:
        raise FtlaInputError(f"`system` must be an arm, as `ftla.arm` makes it, found {system!r}")
    if not (initial[2:].any() or final[2:].any()):
        return travel_arm(system, initial[:2].tolist(), final[:2].tolist(), horizon, fold, **options)
    middle = 0.5 * (initial[0] + final[0])
    rest = np.array([middle, fold, 0.0, 0.0])
    travel = [np.array([state[0], fold, 0.0, 0.0]) for state in (initial, final)]
    stages = [(rest, rest), (travel[0], travel[1]), (initial, final)]
    # segments from a tenth to four tenths of a second
    fractions = graded_times(1.0, min(0.1 / horizon, 0.05), min(0.4 / horizon, 0.2))
    return continue_through(system, stages, horizon, fractions, **options)


def arm_extremals(
    initial_state: ArrayLike,
    final_state: ArrayLike,
    horizon: float,
    *,
    folds: Sequence[float] = (np.pi, -np.pi),
    turns: Sequence[int] = (-1, 0, 1),
    system: System | None = None,
    **options: Any,
) -> list[ArmExtremal]:
    """Extremals of the two-link arm for several folds and whole turns of the second link, the cheapest first.

    Parameters
    ----------
    initial_state, final_state : array_like, shape (4,)
    horizon : float
        s.
    folds : sequence of float, optional
        θ₂ of the folded arm, rad.
    turns : sequence of int, optional
        Whole turns added to the last θ₂: the same final posture.
    system : System, optional
    options
        As those of `solve_arm`.

    Returns
    -------
    list of ArmExtremal
        Those that were found; a fold and a number of turns that lead nowhere are left out.
    """
    final = _numbers("final_state", final_state, 4)
    ways = _numbers("folds", folds, None)
    whole = _numbers("turns", turns, None)
    _expect_options("arm_extremals", options)
    if (whole != np.round(whole)).any():
        raise FtlaInputError(f"`turns` must be whole numbers, found {turns!r}")
    found = []
    for fold in ways:
        for turn in whole:
            last = final + np.array([0.0, 2.0 * np.pi * turn, 0.0, 0.0])
            continued = solve_arm(initial_state, last, horizon, fold=float(fold), system=system, **options)
            if continued.success:
                extremal = continued.extremal
                found.append(ArmExtremal(float(fold), int(turn), extremal.cost(), extremal))
    return sorted(found, key=lambda each: each.cost)


def _expect_options(function: str, options: dict[str, Any]) -> None:
    """Options are those of `shoot`, and are told of under the name of what was called."""
    for name in options:
        if name not in ("tol", "max_iterations", "rtol", "atol"):
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}")


def _numbers(name: str, value: Any, *shape: int | None) -> NDArray[np.float64]:
    """Finite numbers, of a length unless that is None."""
    what = "a finite number" if not shape else f"{shape[0] or 'a sequence of'} finite numbers"
    try:
        numbers = np.asarray(value)
    except ValueError:
        numbers = np.asarray(None)
    fits = numbers.ndim == len(shape) and shape in ((), (None,), numbers.shape)
    if numbers.dtype.kind not in "fiu" or not fits or not np.isfinite(numbers).all() or numbers.size == 0:
        raise FtlaInputError(f"`{name}` must be {what}, found {value!r}")
    return numbers.astype(float)
