"""Optimal control problems of several phases."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from somersault._control_arguments import _by_name, _Guess, _Range
from somersault._control_problem import ControlProblem
from somersault._somersault import ocp as _extension
from somersault._somersault.ocp import MultiphaseResult, SearchResult
from somersault.errors import InputError

__all__ = ["MultiphaseProblem"]

#: What states jump by, or that nothing does.
_Link: TypeAlias = "Mapping[str, _Range] | Literal['continuous']"


class MultiphaseProblem:
    """An optimal control problem of several phases, one after the other in time.

    The cost is the sum of those of the phases. The first phase begins at its `start_time`, each other one
    where the one before it ends, and lasts as long as its `duration` says. States that two neighbours both
    have, by their names, continue from one to the other, or jump by what `links` says: lower ≤ x(start of
    the later phase) − x(end of the earlier one) ≤ upper. A parameter that several phases have is the same in
    all of them.

    Parameters
    ----------
    phases : sequence of ControlProblem
        Each with its own equations, states, controls, bounds, costs and ends.
    links : sequence of dict, length n_phases − 1, optional
        For each pair of neighbours what states jump by: by name a number, a pair of bounds, or None where it
        may be anything. States that are not named continue; ``'continuous'`` is an empty one.

    Raises
    ------
    somersault.errors.InputError
        If there is no phase, or a link contradicts the ends that it joins.

    Examples
    --------
    From rest to rest over one metre in one second, and 0.3 m from the start after half of it: ½ ∫ u² dt =
    9.84.

    >>> from somersault import ocp
    >>> def block(initial, final):
    ...     return ocp.ControlProblem(
    ...         lambda x, u: [x.v, u.force], ("x", "v"), ("force",), initial=initial, final=final,
    ...         duration=0.5, running_cost=lambda x, u: 0.5 * u.force**2)
    >>> phases = [block({"x": 0, "v": 0}, {"x": 0.3}), block(None, {"x": 1, "v": 0})]
    >>> found = ocp.MultiphaseProblem(phases).solve()
    >>> found.status, round(found.cost, 6), [round(float(phase.x[-1, 0]), 6) for phase in found.phases]
    ('converged', 9.84, [0.3, 1.0])
    """

    def __init__(self, phases: Sequence[ControlProblem], links: Sequence[_Link] | None = None) -> None:
        self._phases = _phases(phases)
        pairs = list(zip(self._phases[:-1], self._phases[1:], strict=True))
        if links is not None and (isinstance(links, str) or not isinstance(links, Iterable)):
            raise InputError(f"`links` must be one for each pair of neighbours, found {links!r}")
        self._links = [{}] * len(pairs) if links is None else list(links)
        if len(self._links) != len(pairs):
            raise InputError(
                f"`links` must have one entry for each of {len(pairs)} pairs of neighbours, found"
                f" {len(self._links)}"
            )
        linked = _shared(self._phases)
        for k, (pair, jumps) in enumerate(zip(pairs, self._links, strict=True)):
            linked += _linked(k, *pair, jumps)
        horizons, last = [], (self._phases[0]._start,) * 2
        for k, phase in enumerate(self._phases):
            horizons.append(phase._horizon(*last))
            # After a fixed start the bounds of the end are those of the duration, and rows would repeat them.
            if last[0] < last[1]:
                linked.append((k, k, "duration", 0, 0, phase._duration))
            last = horizons[-1][1]
        self._posed = _extension.TracedProblem([phase._phase for phase in self._phases], horizons, linked)

    @property
    def phases(self) -> list[ControlProblem]:
        """list of ControlProblem: The phases."""
        return list(self._phases)

    def solve(
        self,
        guess: MultiphaseResult | Sequence[_Guess] | None = None,
        *,
        method: Literal["auto", "collocation"] = "auto",
        tol: float = 1e-6,
        n_intervals: int | None = None,
        n_points: int | None = None,
        max_meshes: int = 20,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        callback: Callable[[int, NDArray[np.float64], float, float], object] | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> MultiphaseResult:
        """Solves by collocation, refines the meshes to the tolerance, and integrates what was found again.

        Parameters
        ----------
        guess : MultiphaseResult or sequence, optional
            An earlier result; or for each phase what `ControlProblem.solve` takes, of which only differences
            of times count.
        method : {'auto', 'collocation'}, optional
            Both are collocation; splines and arcs are of one phase.
        tol, n_intervals, n_points, max_meshes, max_iterations, max_evaluations, max_time, callback,
            on_interrupt
            As of `ControlProblem.solve`; intervals and points are those of each phase.

        Returns
        -------
        MultiphaseResult
            With the best motion found, whatever the status.

        Raises
        ------
        somersault.errors.InputError
            If the method is one of one phase.

        Examples
        --------
        A block of 1 kg, a metre there and back in two seconds:

        >>> from somersault import multibody, ocp
        >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
        >>> model = multibody.Model([block], gravity=(0, 0, 0))
        >>> effort = dict(duration=1, running_cost=lambda x, u: 0.5 * u.u_block**2)
        >>> away = ocp.ControlProblem(model, initial=[0, 0], final=[1, None], **effort)
        >>> back = ocp.ControlProblem(model, final=[0, 0], **effort)
        >>> found = ocp.MultiphaseProblem([away, back]).solve()
        >>> found.status, round(found.cost, 4)
        ('converged', 12.0)
        """
        found = self._posed.solve(
            self._starts(guess),
            tol,
            n_intervals,
            n_points,
            max_meshes,
            max_iterations,
            max_evaluations,
            max_time,
            callback,
            on_interrupt,
            method,
        )
        return cast("MultiphaseResult", found)

    def search(
        self,
        n_starts: int = 16,
        *,
        method: Literal["auto", "collocation"] = "auto",
        seed: int = 1,
        tol: float = 1e-6,
        n_intervals: int | None = None,
        n_points: int | None = None,
        max_meshes: int = 20,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> SearchResult:
        """Solves from many starts in parallel, as `ControlProblem.search` does.

        Parameters
        ----------
        method : {'auto', 'collocation'}, optional
            As of `solve`.
        n_starts, seed, tol, n_intervals, n_points, max_meshes, max_iterations, max_evaluations, max_time,
            on_interrupt
            As of `ControlProblem.search`; intervals and points are those of each phase.

        Returns
        -------
        SearchResult
            Its `minima` are those of `MultiphaseResult`.

        Examples
        --------
        >>> from somersault import ocp
        >>> leg = dict(states=("x", "v"), controls=("f",), duration=1, running_cost=lambda x, u: 0.5 * u.f**2)
        >>> away = ocp.ControlProblem(lambda x, u: [x.v, u.f], initial=[0, 0], final={"x": 1}, **leg)
        >>> back = ocp.ControlProblem(lambda x, u: [x.v, u.f], final=[0, 0], **leg)
        >>> found = ocp.MultiphaseProblem([away, back]).search(4)
        >>> found.starts, round(found.best.cost, 4)
        ([[0, 1, 2, 3]], 12.0)
        """
        return self._posed.search(
            n_starts,
            seed,
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

    def _starts(self, guess: MultiphaseResult | Sequence[_Guess] | None) -> Any:
        """A guess for each phase; those by names are moved to where the one before ends."""
        if guess is None:
            return []
        if isinstance(guess, MultiphaseResult) and len(guess.phases) == len(self._phases):
            return guess
        if isinstance(guess, MultiphaseResult):
            given: list[Any] = list(guess.phases)
        elif isinstance(guess, str | Mapping) or not isinstance(guess, Iterable):
            raise InputError(
                f"`guess` must be one for each phase or an earlier result, found {type(guess).__name__}"
            )
        else:
            given = list(guess)
        if len(given) != len(self._phases):
            raise InputError(
                f"`guess` must have one for each of {len(self._phases)} phases, found {len(given)}"
            )
        starts: list[Any] = []
        began = self._phases[0]._start
        for k, (phase, each) in enumerate(zip(self._phases, given, strict=True)):
            rows = phase._start_of(f"guess[{k}]", each)
            if isinstance(rows, tuple):
                times = [began + t - rows[0][0] for t in rows[0]]
                rows, began = (times, *rows[1:]), times[-1]
            else:
                began = float(rows.t[-1])
            starts.append(rows)
        return starts

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._phases, self._links)

    def __repr__(self) -> str:
        return f"<MultiphaseProblem: {len(self._phases)} phases>"


def _phases(phases: Sequence[ControlProblem]) -> list[ControlProblem]:
    if isinstance(phases, str) or not isinstance(phases, Iterable):
        raise InputError(f"`phases` must be a sequence of ControlProblem, found {type(phases).__name__}")
    found = list(phases)
    if not found:
        raise InputError("`phases` must have at least one phase, found none")
    for k, phase in enumerate(found):
        if not isinstance(phase, ControlProblem):
            raise TypeError(f"`phases[{k}]` must be a ControlProblem, found {type(phase).__name__}")
        if k and phase._start != 0.0:
            raise InputError(
                f"`phases[{k}]` must begin where phase {k - 1} ends, found a `start_time` of {phase._start}"
            )
    return found


def _linked(
    k: int, left: ControlProblem, right: ControlProblem, jumps: _Link
) -> list[tuple[int, int, str, int, int, tuple[float, float]]]:
    """What holds between a phase and the next one."""
    shared = [name for name in left.state_names if name in right.state_names]
    argument = f"links[{k}]"
    if isinstance(jumps, str):
        if jumps != "continuous":
            raise InputError(f"`{argument}` must be 'continuous' or jumps by name, found {jumps!r}")
        jumps = {}
    given = _by_name(argument, shared, jumps)
    linked = [(k, k + 1, "time", 0, 0, (0.0, 0.0))]
    for name in shared:
        jump = given.get(name, (0.0, 0.0))
        i, j = left.state_names.index(name), right.state_names.index(name)
        end, start = left._final[i], right._initial[j]
        # both signs of a quaternion are the same orientation
        is_quaternion = any(0 <= i - first < 4 for first in left._quaternions)
        if not is_quaternion and (start[0] - end[1] > jump[1] or start[1] - end[0] < jump[0]):
            raise InputError(
                f"`phases` must end and begin as `{argument}` says: {name} is {_shown(end)} at the end of"
                f" phase {k}, {_shown(start)} at the start of phase {k + 1}, and may jump by {_shown(jump)}"
            )
        if jump != (-math.inf, math.inf):
            linked.append((k, k + 1, "state", i, j, jump))
    return linked


def _shared(phases: list[ControlProblem]) -> list[tuple[int, int, str, int, int, tuple[float, float]]]:
    """Parameters that are the same in the last phase before that has them."""
    linked = []
    last: dict[str, tuple[int, int]] = {}
    for k, phase in enumerate(phases):
        for j, name in enumerate(phase.parameter_names):
            if name in last:
                linked.append((last[name][0], k, "parameter", last[name][1], j, (0.0, 0.0)))
            last[name] = (k, j)
    return linked


def _shown(pair: tuple[float, float]) -> str:
    return f"{pair[0]:g}" if pair[0] == pair[1] else f"[{pair[0]:g}, {pair[1]:g}]"
