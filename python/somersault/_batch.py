"""Many optimal control problems at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Literal, cast, overload

from somersault._control_arguments import _Guess
from somersault._control_problem import ControlProblem
from somersault._somersault.ocp import CollocationResult, PolishResult, TracedProblem
from somersault.errors import InputError

__all__ = ["solve_batch"]


@overload
def solve_batch(
    problems: Sequence[ControlProblem],
    guesses: Sequence[_Guess | None] | None = None,
    *,
    method: Literal["auto", "shooting", "collocation"] = "auto",
    tol: float = 1e-6,
    n_intervals: int | None = None,
    n_points: int | None = None,
    max_meshes: int = 20,
    max_iterations: int | None = None,
    max_evaluations: int | None = None,
    max_time: float | None = None,
    on_interrupt: Literal["raise", "return"] = "raise",
) -> list[CollocationResult | None]: ...
@overload
def solve_batch(
    problems: Sequence[ControlProblem],
    guesses: Sequence[_Guess | None] | None = None,
    *,
    method: Literal["indirect"],
    tol: float = 1e-6,
    n_intervals: int | None = None,
    n_points: int | None = None,
    max_meshes: int = 20,
    max_iterations: int | None = None,
    max_evaluations: int | None = None,
    max_time: float | None = None,
    on_interrupt: Literal["raise", "return"] = "raise",
) -> list[PolishResult | None]: ...
def solve_batch(
    problems: Sequence[ControlProblem],
    guesses: Sequence[_Guess | None] | None = None,
    *,
    method: Literal["auto", "shooting", "collocation", "indirect"] = "auto",
    tol: float = 1e-6,
    n_intervals: int | None = None,
    n_points: int | None = None,
    max_meshes: int = 20,
    max_iterations: int | None = None,
    max_evaluations: int | None = None,
    max_time: float | None = None,
    on_interrupt: Literal["raise", "return"] = "raise",
) -> list[CollocationResult | None] | list[PolishResult | None]:
    """Solves many problems in parallel.

    Parameters
    ----------
    problems : sequence of ControlProblem
        `ControlProblem.replace` makes like ones without tracing.
    guesses : sequence, optional
        What `ControlProblem.solve` takes as a guess, or None, for each problem.
    method : {'auto', 'shooting', 'collocation', 'indirect'}, optional
        As of `ControlProblem.solve`, of all.
    max_time : float, optional
        s, of all.
    tol, n_intervals, n_points, max_meshes, max_iterations, max_evaluations, on_interrupt
        As of `ControlProblem.solve`.

    Returns
    -------
    list of CollocationResult or of PolishResult
        In the order of the problems; None where one had not begun when the time was over. Those of
        ``'indirect'`` are a PolishResult.

    Raises
    ------
    somersault.errors.InputError
        If the method does not take one of the problems.

    Examples
    --------
    The effort that it takes to move a metre in one, two and four seconds, 6/T³:

    >>> from somersault import ocp
    >>> problem = ocp.ControlProblem(
    ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 0], final=[1, 0],
    ...     running_cost=lambda x, u: 0.5 * u.force**2)
    >>> found = ocp.solve_batch([problem.replace(duration=duration) for duration in (1, 2, 4)])
    >>> [round(each.cost, 5) for each in found]
    [6.0, 0.75, 0.09375]
    >>> [each.verdict for each in ocp.solve_batch([problem] * 2, method="indirect")]
    ['strict_minimum', 'strict_minimum']
    """
    posed = _listed("problems", problems)
    for k, problem in enumerate(posed):
        if not isinstance(problem, ControlProblem):
            raise TypeError(f"`problems[{k}]` must be a ControlProblem, found {type(problem).__name__}")
    given = [None] * len(posed) if guesses is None else _listed("guesses", guesses)
    if len(given) != len(posed):
        raise InputError(f"`guesses` must have {len(posed)} entries, found {len(given)}")
    starts = [
        problem._origin(f"guesses[{k}]", guess)
        for k, (problem, guess) in enumerate(zip(posed, given, strict=True))
    ]
    found = TracedProblem.solve_all(
        [problem._posed for problem in posed],
        starts,
        tol,
        n_intervals,
        n_points,
        max_meshes,
        max_iterations,
        max_evaluations,
        max_time,
        on_interrupt,
        method,
    )
    return cast("list[CollocationResult | None] | list[PolishResult | None]", found)


def _listed(argument: str, given: Any) -> list[Any]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InputError(f"`{argument}` must be a sequence, found {type(given).__name__}")
    return list(given)
