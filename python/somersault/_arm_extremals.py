"""Extremals of the two-link arm from its boundary states and the way it folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from somersault._somersault.ftla import (
    ContinuationResult,
    Extremal,
    System,
    arm,
    continue_through,
    graded_times,
    travel_arm,
)
from somersault.errors import InputError

__all__ = ["ArmExtremal", "arm_extremals", "solve_arm"]

#: Longest horizon, s: beyond it are millions of nodes.
_LONGEST = 1e4


#: Options of the searches for an extremal.
_OPTIONS = ("tol", "max_iterations", "rtol", "atol", "max_time", "max_evaluations")


@dataclass(frozen=True)
class ArmExtremal:
    """One of several extremals of the arm, or what a search for one came to."""

    #: θ₂ of the folded arm, rad: the multiple of π nearest to θ₂ half-way through the motion. Where there
    #: is none, the one that the search was for.
    fold: float
    #: Whole turns added to the last θ₂.
    turns: int
    #: ½ ∫ γ₁u₁² + γ₂u₂² dt; NaN where the search did not arrive.
    cost: float
    #: The motion; where the search did not arrive, its best iterate.
    extremal: Extremal
    #: As `ContinuationResult.status`: ``'arrived'``, ``'broke_off'`` or ``'limit_reached'``.
    status: str = "arrived"
    #: As `ContinuationResult.message`.
    message: str = ""

    @property
    def success(self) -> bool:
        """Whether it is an extremal."""
        return self.status == "arrived"

    def __repr__(self) -> str:
        way = f"fold {self.fold:.4f} rad, turns {self.turns}"
        return f"<ArmExtremal: {self.status}, {way}, cost {self.cost:.6g}>"

    def __reduce__(self) -> tuple[type[ArmExtremal], tuple[float, int, float, Extremal, str, str]]:
        return ArmExtremal, (self.fold, self.turns, self.cost, self.extremal, self.status, self.message)


def solve_arm(
    initial_state: ArrayLike,
    final_state: ArrayLike,
    horizon: float,
    *,
    fold: float = np.pi,
    system: System | None = None,
    **options: Any,
) -> ContinuationResult:
    """An extremal of the two-link arm from its end states and the way it folds.

    Between two rests from a spline of minimum effort, whose torques tell the costates; otherwise by
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
        ``tol``, ``max_iterations``, ``rtol``, ``atol``, ``max_time`` and ``max_evaluations`` as those of
        `shoot`.

    Returns
    -------
    ContinuationResult

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla
    >>> found = ftla.solve_arm([-0.5, 0.05, 0.0, 0.0], [0.5, 0.05, 0.0, 0.0], 4.0)
    >>> found.success, round(found.extremal(2.0)[1] / np.pi)
    (True, 1)
    """
    initial, final = _numbers("initial_state", initial_state, 4), _numbers("final_state", final_state, 4)
    horizon, fold = float(_numbers("horizon", horizon)), float(_numbers("fold", fold))
    _expect_options("solve_arm", options)
    if not 0.0 < horizon <= _LONGEST:
        raise InputError(f"`horizon` must be positive and at most {_LONGEST:g} s, found {horizon}")
    system = arm() if system is None else system
    if isinstance(system, System) and system.dimension != 8:
        raise InputError(f"`system` must be an arm, as `ftla.arm` makes it, found {system!r}")
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
        Each motion once, the cheapest first; then, with a status and a message, the folds and turns that
        led to none.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import ftla
    >>> found = ftla.arm_extremals(
    ...     [-0.5, 0.05, 0.0, 0.0], [0.5, 0.05, 0.0, 0.0], 4.0, folds=[np.pi, -np.pi], turns=[0])
    >>> [round(extremal.cost, 4) for extremal in found]
    [0.5062, 0.535]
    """
    final = _numbers("final_state", final_state, 4)
    ways = _numbers("folds", folds, None)
    whole = _numbers("turns", turns, None)
    _expect_options("arm_extremals", options)
    if (whole != np.round(whole)).any():
        raise InputError(f"`turns` must be whole numbers, found {turns!r}")
    found: list[ArmExtremal] = []
    failed: list[ArmExtremal] = []
    for fold in ways:
        for turn in whole:
            last = final + np.array([0.0, 2.0 * np.pi * turn, 0.0, 0.0])
            continued = solve_arm(initial_state, last, horizon, fold=float(fold), system=system, **options)
            how = (continued.status, continued.message)
            if not continued.success:
                failed.append(ArmExtremal(float(fold), int(turn), np.nan, continued.extremal, *how))
                continue
            motion = continued.extremal
            folded = np.pi * float(np.round(motion(0.5 * horizon)[1] / np.pi))
            each = ArmExtremal(folded, int(turn), motion.cost(), motion, *how)
            if not any(_same(each, other) for other in found):
                found.append(each)
    return sorted(found, key=lambda each: each.cost) + failed


def _same(one: ArmExtremal, other: ArmExtremal) -> bool:
    """Whether two extremals between the same ends are one motion: it follows from where it starts."""
    if one.turns != other.turns:
        return False
    p, q = one.extremal.nodes[0], other.extremal.nodes[0]
    # costates are in one unit, whatever it is; two motions that start within a millionth meet nowhere else
    return bool(np.abs(p - q)[4:].max() <= 1e-6 * max(np.abs(p[4:]).max(), np.abs(q[4:]).max()))


def _expect_options(function: str, options: dict[str, Any]) -> None:
    """Options are those of `shoot`, and are reported under the name of what was called."""
    for name in options:
        if name not in _OPTIONS:
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}")


def _numbers(name: str, value: Any, *shape: int | None) -> NDArray[np.float64]:
    """Finite numbers, of a given length where there is one."""
    what = "a finite number" if not shape else f"{shape[0] or 'a sequence of'} finite numbers"
    try:
        numbers = np.asarray(value)
    except ValueError:
        numbers = np.asarray(None)
    fits = numbers.ndim == len(shape) and shape in ((), (None,), numbers.shape)
    if numbers.dtype.kind not in "fiu" or not fits or not np.isfinite(numbers).all() or numbers.size == 0:
        raise InputError(f"`{name}` must be {what}, found {value!r}")
    return numbers.astype(float)
