"""Optimal control problems in ordinary NumPy."""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, cast, overload

import numpy as np

from somersault._arguments import _real_numbers
from somersault._control_arguments import (
    _FREE,
    _article,
    _as_many,
    _Constrained,
    _Constraint,
    _Entries,
    _entries,
    _Floats,
    _Guess,
    _line,
    _Names,
    _number,
    _positive,
    _Range,
    _range,
    _values,
)
from somersault._somersault import ocp as _extension
from somersault._somersault.multibody import Model
from somersault._somersault.ocp import CollocationResult, PolishResult, SearchResult, SolutionSensitivity
from somersault.errors import InputError

__all__ = ["ControlProblem"]


class ControlProblem:
    """An optimal control problem, posed by ordinary functions of NumPy and trees of bodies.

    ::

        minimise   Φ(x(t_f), t_f, p) + ∫ L(x, u, t, p) dt
        subject to ẋ = f(x, u, t, p),  bounds of x, u, p, x(t_0), x(t_f), t_0 and t_f,
                   path constraints on (x, u, t, p), end constraints on (x(t_0), x(t_f), t_0, t_f, p), bounds
                   of integrals

    Each function is called once, with symbols: its expressions are differentiated exactly and evaluated
    without the interpreter. `x`, `u` and `p` are arrays whose entries also are attributes by their names; a
    function takes as many arguments as it needs, from the left; arguments of other names that have a default
    keep it.

    Parameters
    ----------
    dynamics : callable or Model
        ``f(x, u, t, p)``: the rate of each state. Or a tree: then x = (q, v) as the model has them, and u are
        forces of joints.
    states, controls, parameters : sequence of str, or int
        Names of the entries of x, u and p; a number names them ``x0``, ``x1`` and so on. A tree has names of
        its own unless they are given: ``q_`` and ``v_`` with the bodies that joints move for x, ``u_`` for u.
        Of joints with several entries, those of v and u have numbers, and those of q are ``px``, ``py``,
        ``pz``, then ``x``, ``y``, ``z``, ``w`` of a unit quaternion, or ``angle``.
    actuated : sequence of str or of bool, optional
        Bodies of the tree whose joints have a control, or degrees of freedom; all of them unless given.
    initial, final : dict or sequence, optional
        What states are at the start and at the end, by name or in their order: a number, a pair of bounds,
        or None where it is free. States that are not named are free. A quaternion q whose entries are all
        given means the orientation, as −q does; its norm must be one to a thousandth.
    duration : float or tuple of float, optional
        t_f − t_0 where `start_time` is a number, s. A pair makes it a variable between the two; the second
        may be infinite.
    start_time : float, optional
        t_0.
    bounds : dict, optional
        Pairs of bounds by name of a state, control or parameter, at all times. None is no bound.
    running_cost : callable, optional
        ``L(x, u, t, p)``.
    end_cost : callable, optional
        ``Φ(x, t, p)`` of the final state and time.
    path : sequence of tuple, optional
        ``(g, lower, upper)`` with ``g(x, u, t, p)``, one value or several: lower ≤ g ≤ upper at all times.
    ends : sequence of tuple, optional
        ``(b, lower, upper)`` with ``b(x_0, x_f, t_0, t_f, p)``.
    integrals : sequence of tuple, optional
        ``(h, lower, upper)`` with ``h(x, u, t, p)``, one value: lower ≤ ∫ h dt ≤ upper.
    scales : dict, optional
        Sizes of states and controls by name, by which the program is scaled. Without them, sizes are those
        of bounds and guess.

    Raises
    ------
    somersault.errors.InputError
        If names, bounds or what functions return do not fit.
    somersault.errors.TraceError
        If a function cannot be traced, with the line where that is.

    Notes
    -----
    A path constraint of states alone is not required at the very end, where nothing is collocated: one that
    excludes what is fixed there is refused.

    Examples
    --------
    The brachistochrone, the curve of fastest descent: down five metres and ten across.

    >>> import numpy as np
    >>> from somersault import ocp
    >>> problem = ocp.ControlProblem(
    ...     lambda x, u: [x.v * np.cos(u.angle), x.v * np.sin(u.angle), 9.81 * np.sin(u.angle)],
    ...     states=("across", "down", "v"), controls=("angle",),
    ...     initial={"across": 0, "down": 0, "v": 0}, final={"across": 10, "down": 5}, duration=(0.05, 20),
    ...     end_cost=lambda x, t: t)
    >>> found = problem.solve()
    >>> found.status, round(found.cost, 6)
    ('converged', 1.801295)

    A pendulum on a cart, from rest to rest over a metre in two seconds, with minimum effort:

    >>> from somersault import multibody
    >>> cart = ocp.ControlProblem(
    ...     multibody.cart_pendulum(), actuated=["cart"], initial=[0, 0, 0, 0], final=[1, 0, 0, 0],
    ...     duration=2, running_cost=lambda x, u: 0.5 * u.u_cart**2)
    >>> cart.solve().status, cart.state_names
    ('converged', ['q_cart', 'q_pendulum', 'v_cart', 'v_pendulum'])

    A rigid body on a ball joint, turned by 90° about z in a second with minimum effort, 6 (π/2)²:

    >>> hub = multibody.Link("hub", "spherical", mass=1, inertia=np.eye(3))
    >>> turn = ocp.ControlProblem(
    ...     multibody.Model([hub], gravity=(0, 0, 0)), initial=[0, 0, 0, 1, 0, 0, 0],
    ...     final=[0, 0, np.sqrt(0.5), np.sqrt(0.5), 0, 0, 0], running_cost=lambda x, u: 0.5 * u @ u)
    >>> found = turn.solve()
    >>> found.status, round(found.cost, 4), found.q[-1].round(4) + 0.0
    ('converged', 14.8044, array([0.    , 0.    , 0.7071, 0.7071]))
    """

    def __init__(
        self,
        dynamics: Callable[..., Any] | Model,
        states: Sequence[str] | int | None = None,
        controls: Sequence[str] | int | None = None,
        parameters: Sequence[str] | int = (),
        *,
        actuated: Sequence[str] | Sequence[bool] | None = None,
        initial: _Entries = None,
        final: _Entries = None,
        duration: float | tuple[float, float] = 1.0,
        start_time: float = 0.0,
        bounds: Mapping[str, _Range] | None = None,
        running_cost: Callable[..., Any] | None = None,
        end_cost: Callable[..., Any] | None = None,
        path: Sequence[_Constraint] = (),
        ends: Sequence[_Constraint] = (),
        integrals: Sequence[_Constraint] = (),
        scales: Mapping[str, float] | None = None,
    ) -> None:
        self._given = {name: value for name, value in locals().items() if name != "self"}
        tree = None
        self._quaternions: list[int] = []
        if isinstance(dynamics, Model):
            moved, of_x, of_u, self._quaternions = _extension.TracedPhase.of_tree(dynamics, actuated)
            tree = (dynamics, moved)
            states = _as_many("states", states, of_x)
            controls = _as_many("controls", controls, of_u)
        elif actuated is not None:
            raise InputError("`actuated` is of a tree, and `dynamics` is none")
        self._tree = tree
        names = _Names(states, controls, parameters)
        self._names = names
        at_path, at_ends, of_integrals = (
            [_Constrained(name, k, entry) for k, entry in enumerate(_entries(name, entries))]
            for name, entries in (("path", path), ("ends", ends), ("integrals", integrals))
        )
        self._duration = _positive("duration", _range("duration", duration))
        self._start = _number("start_time", start_time)
        self._ranges = names.ranges("bounds", bounds)
        self._initial = names.states_of("initial", initial)
        self._final = names.states_of("final", final)
        given = None if isinstance(dynamics, Model) else dynamics
        self._functions = names.functions(given, (running_cost, end_cost), at_path, at_ends, of_integrals)
        self._constraints = [
            [pair for each in entries for pair in each.pairs()]
            for entries in (at_path, at_ends, of_integrals)
        ]
        self._n_integrals = len(of_integrals)
        self._scales = names.scales(scales, len(of_integrals))
        self._pose()

    def _pose(self) -> None:
        """Hands the numbers on, with functions that were traced before."""
        names, n = self._names, self._n_integrals
        horizon = self._horizon(self._start, self._start)
        at_path, at_ends, of_integrals = self._constraints
        self._phase = _extension.TracedPhase(
            self._functions,
            self._tree,
            [[*names.states, *(f"integral {k}" for k in range(n))], names.controls, names.parameters],
            [
                [*self._ranges[0], *[_FREE] * n],
                self._ranges[1],
                self._ranges[2],
                [*self._initial, *[(0.0, 0.0)] * n],
                [*self._final, *of_integrals],
                at_path,
                at_ends,
            ],
            self._scales,
            horizon,
        )
        self._posed = _extension.TracedProblem([self._phase], [horizon], None)

    def replace(
        self,
        *,
        initial: _Entries = None,
        final: _Entries = None,
        duration: float | tuple[float, float] | None = None,
        start_time: float | None = None,
        bounds: Mapping[str, _Range] | None = None,
    ) -> ControlProblem:
        """The problem with other numbers and the same functions, which are not traced again.

        Parameters
        ----------
        initial, final : dict or sequence, optional
            Entries by name take the place of those of the problem; others stay.
        duration : float or tuple of float, optional
        start_time : float, optional
        bounds : dict, optional
            Bounds by name, as `initial`. A parameter is given where both are the same number.

        Returns
        -------
        ControlProblem

        Examples
        --------
        A control loop: solve, apply the control for a tenth of a second, measure, solve again from there.

        >>> from somersault import ocp
        >>> problem = ocp.ControlProblem(
        ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",),
        ...     initial=[1, 0], duration=2, bounds={"force": (-3, 3)},
        ...     running_cost=lambda x, u: 0.5 * (x.x**2 + x.v**2 + 0.1 * u.force**2))
        >>> found = problem.solve()
        >>> for _ in range(20):
        ...     measured = found.state(0.1)
        ...     found = problem.replace(initial=measured).solve(found)
        >>> found.success, round(float(measured[0]), 3)
        (True, 0.206)
        """
        other = copy.copy(self)
        names = self._names
        if initial is not None:
            other._initial = names.states_of("initial", initial, self._initial)
        if final is not None:
            other._final = names.states_of("final", final, self._final)
        if duration is not None:
            other._duration = _positive("duration", _range("duration", duration))
        if start_time is not None:
            other._start = _number("start_time", start_time)
        if bounds is not None:
            other._ranges = names.ranges("bounds", bounds, self._ranges)
        all_names = [*names.states, *names.controls, *names.parameters]
        ranges = [pair for part in other._ranges for pair in part]
        other._given = {
            **self._given,
            "initial": other._initial,
            "final": other._final,
            "duration": other._duration,
            "start_time": other._start,
            "bounds": dict(zip(all_names, ranges, strict=True)),
        }
        other._pose()
        return other

    @overload
    def solve(
        self,
        guess: _Guess | None = None,
        *,
        method: Literal["auto", "shooting", "collocation"] = "auto",
        tol: float = 1e-6,
        n_intervals: int | None = None,
        n_points: int | None = None,
        max_meshes: int = 20,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        callback: Callable[[int, _Floats, float, float], object] | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> CollocationResult: ...
    @overload
    def solve(
        self,
        guess: _Guess | None = None,
        *,
        method: Literal["indirect"],
        tol: float = 1e-6,
        n_intervals: int | None = None,
        n_points: int | None = None,
        max_meshes: int = 20,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        callback: Callable[[int, _Floats, float, float], object] | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> PolishResult: ...
    def solve(
        self,
        guess: _Guess | None = None,
        *,
        method: Literal["auto", "shooting", "collocation", "indirect"] = "auto",
        tol: float = 1e-6,
        n_intervals: int | None = None,
        n_points: int | None = None,
        max_meshes: int = 20,
        max_iterations: int | None = None,
        max_evaluations: int | None = None,
        max_time: float | None = None,
        callback: Callable[[int, _Floats, float, float], object] | None = None,
        on_interrupt: Literal["raise", "return"] = "raise",
    ) -> CollocationResult | PolishResult:
        """Solves, refines to the tolerance, and integrates what was found again.

        Collocation refines its mesh until estimated errors are below the tolerance. Where no motion is found
        from the guess, it starts again from one of minimum effort, on horizons of an eighth of the guess's
        and longer until there is one. Where no guess is given and the first program ends at a saddle, as
        one may that is as symmetric as its start, it continues along a direction in which the Lagrangian
        curves downwards. Where a tree has three driven joints or more, a duration that is given and no guess,
        it starts from splines of the joints. `message` says so.

        Parameters
        ----------
        method : {'auto', 'shooting', 'collocation', 'indirect'}, optional
            Splines of joints, or of controls where the dynamics are a function; collocation from the guess;
            multiple shooting of states and costates along the arcs of a coarse collocation solution, as
            `polish`; ``'auto'`` is collocation, from splines where these help.
        guess : CollocationResult or dict, optional
            An earlier result, from whose mesh and multipliers the search starts unless sizes of a mesh are
            given; or values by name of states, controls and parameters: a number that is
            constant, or values at the times ``"t"``, at equal distances unless these are given; tables
            ``"x"`` and ``"u"`` have a column for each state and control. What is not named is on a straight
            line between the ends, a quaternion on the shortest turn, controls at what is nearest to zero.
        tol : float, optional
            Relative error that each interval of the mesh may have.
        n_intervals, n_points : int, optional
            Intervals of the first mesh, and collocation points of each: 20 and 3 unless given.
        max_meshes : int, optional
        max_iterations : int, optional
            Of the solver, on each mesh.
        max_evaluations : int, optional
            Of cost and constraints, on all meshes together.
        max_time : float, optional
            s, of the whole solve. What is under way is finished first, such as a factorisation or the set-up
            of a quadratic program: that takes up to a second where a program has thousands of rows.
        callback : callable, optional
            ``callback(iteration, z, cost, residual)`` after each step of the solver; the search stops where
            it returns true.
        on_interrupt : {'raise', 'return'}, optional
            What Ctrl-C does: raise with the best iterate as the attribute ``solution``, or return it.

        Returns
        -------
        CollocationResult or PolishResult
            With the best motion found, whatever the status. Columns of `x` after those of the states are the
            integrals. The motion of splines has no costates: they are NaN. ``'indirect'`` returns a
            PolishResult.

        Raises
        ------
        somersault.errors.InputError
            If splines cannot take the problem, or ``'indirect'`` is given one with an `ExternalFunction`.

        Examples
        --------
        A rocket car of limited fuel: from rest to rest over one metre in three seconds, with the least
        thrust.

        >>> from somersault import ocp
        >>> problem = ocp.ControlProblem(
        ...     lambda x, u: [x.v, u.right - u.left], states=("x", "v"), controls=("right", "left"),
        ...     initial={"x": 0, "v": 0}, final={"x": 1, "v": 0}, duration=3,
        ...     bounds={"right": (0, 1), "left": (0, 1)}, running_cost=lambda x, u: u.right + u.left)
        >>> found = problem.solve(tol=1e-5)
        >>> found.status, round(found.cost, 4)  # 3 − √5
        ('converged', 0.7639)

        A linear–quadratic optimum by three methods, of cost (1 + e⁻²)/(1 − e⁻²)/2:

        >>> problem = ocp.ControlProblem(
        ...     lambda x, u: [u.u], states=("x",), controls=("u",), initial=[1], final=[0],
        ...     running_cost=lambda x, u: 0.5 * (x.x**2 + u.u**2))
        >>> methods = ("shooting", "collocation", "indirect")
        >>> [round(problem.solve(method=method).cost, 6) for method in methods]
        [0.656518, 0.656518, 0.656518]
        """
        found = self._posed.solve(
            self._origin("guess", guess),
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
        return cast("CollocationResult | PolishResult", found)

    def search(
        self,
        n_starts: int = 16,
        *,
        method: Literal["auto", "shooting", "collocation", "indirect"] = "auto",
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
        """Solves from many starts in parallel, merges solutions that are the same, and ranks them by cost.

        The first start is the straight line. From the others, states leave it by sines as far as bounds or
        their sizes allow, controls run between two random values, and free horizons are half to twice as
        long; half of all orientations go round the other way. Solutions are the same where states, parameters
        and horizons agree to three digits.

        Parameters
        ----------
        n_starts : int, optional
        method : {'auto', 'shooting', 'collocation', 'indirect'}, optional
            As of `solve`, from each start. A start is a guess, so that ``'auto'`` is collocation.
        seed : int, optional
            Of the random starts.
        max_time : float, optional
            s, of the whole search.
        tol, n_intervals, n_points, max_meshes, max_iterations, max_evaluations, on_interrupt
            As of `solve`.

        Returns
        -------
        SearchResult
            Its `minima` are results with the status ``'converged'``, or those of ``'indirect'`` that are
            certified; `unfinished` all others.

        Raises
        ------
        somersault.errors.InputError
            As of `solve`.

        Examples
        --------
        Two ways around a disk that is not quite in the middle, of lengths √19.4986 and √21.3033:

        >>> import numpy as np
        >>> from somersault import ocp
        >>> problem = ocp.ControlProblem(
        ...     lambda x, u: [u.right, u.up], states=("x", "y"), controls=("right", "up"),
        ...     initial=[-2, 0], final=[2, 0], duration=1, running_cost=lambda x, u: u.right**2 + u.up**2,
        ...     path=[(lambda x: x.x**2 + (x.y - 0.1)**2, 1, None)])
        >>> found = problem.search(8, tol=1e-4)
        >>> [(round(each.cost, 2), "below" if each.state(0.5)[1] < 0 else "above") for each in found.minima]
        [(19.5, 'below'), (21.3, 'above')]

        The swings of a pendulum that end upright, each exact to rounding and certified:

        >>> swing = ocp.ControlProblem(
        ...     lambda x, u: [x.w, u.torque - 9.81 * np.sin(x.q)], states=("q", "w"), controls=("torque",),
        ...     initial=[0, 0], final=[np.pi, 0], duration=2, running_cost=lambda x, u: 0.5 * u.torque**2)
        >>> found = swing.search(4, method="indirect")
        >>> found.best.verdict, found.best.residual < 1e-10
        ('strict_minimum', True)
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

    def polish(
        self, found: CollocationResult, *, max_evaluations: int | None = None, max_time: float | None = None
    ) -> PolishResult:
        """Finds the arcs of a solution, makes them exact, and certifies what it is.

        Where controls are at their bounds, between them or singular, and where states are at bounds, follows
        from the costates of the solution. Junctions become unknowns of their own, multiple shooting of states
        and costates solves for them to 10⁻¹⁰ and better, and a certificate tests the result: the Hamiltonian,
        the signs of multipliers and switching functions along each arc, the conditions of Legendre and
        Clebsch and of Kelley, and conditions of second order: conjugate points, or the switching times.

        Parameters
        ----------
        found : CollocationResult
            The result of this problem.
        max_evaluations : int, optional
            Of the equations of all arcs.
        max_time : float, optional
            s.

        Returns
        -------
        PolishResult
            Where no arcs are found its verdict is ``'refused'``, `message` says why, and its motion is that
            of `found`.

        Raises
        ------
        somersault.errors.InputError
            If `found` is of another problem, or something calls an `ExternalFunction`.

        Examples
        --------
        Bryson and Denham's problem, ½ ∫ u² from x = 0, v = 1 back in one second below x = 0.1, costs 4/0.9:

        >>> from somersault import ocp
        >>> problem = ocp.ControlProblem(
        ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 1],
        ...     final=[0, -1], bounds={"x": (None, 0.1)}, running_cost=lambda x, u: 0.5 * u.force**2)
        >>> exact = problem.polish(problem.solve(tol=1e-4))
        >>> exact.verdict, round(exact.cost, 9), exact.junctions.round(9)
        ('first_order', 4.444444444, array([0.3, 0.7]))
        >>> [arc["bound"] for arc in exact.arcs]
        [None, 'x', None]

        A tree is polished as it is posed:

        >>> arm = ocp.arm_problem((0, 0, 0, 0), (0.5, 0, 0, 0), 2.0)
        >>> exact = arm.polish(arm.solve(tol=1e-4))
        >>> exact.verdict, exact.residual < 1e-10
        ('strict_minimum', True)

        A rigid body turned by 90° with the effort 6 (π/2)². The costate of a quaternion q is orthogonal to
        it; ½ Im(q̄ λ) is the covector of rotations about body axes:

        >>> import numpy as np
        >>> from somersault import multibody
        >>> hub = multibody.Link("hub", "spherical", mass=1, inertia=np.eye(3))
        >>> turn = ocp.ControlProblem(
        ...     multibody.Model([hub], gravity=(0, 0, 0)), initial=[0, 0, 0, 1, 0, 0, 0],
        ...     final=[0, 0, np.sqrt(0.5), np.sqrt(0.5), 0, 0, 0], running_cost=lambda x, u: 0.5 * u @ u)
        >>> exact = turn.polish(turn.solve())
        >>> exact.verdict, round(exact.cost - 1.5 * np.pi**2, 9) + 0.0
        ('strict_minimum', 0.0)
        >>> bool(abs(exact.costate(0.3)[:4] @ exact.state(0.3)[:4]) < 1e-9)
        True
        """
        if not isinstance(found, CollocationResult):
            raise TypeError(f"`found` must be a CollocationResult, found {_article(type(found).__name__)}")
        return self._posed.polish(found, max_evaluations, max_time)

    def sensitivity(self, found: CollocationResult) -> SolutionSensitivity:
        """Derivatives of a solution with respect to what the problem gives.

        Ends of states that are a number, the start time, the duration, and parameters whose bounds are equal
        are given. The conditions of the optimum are differentiated (Fiacco 1983): one factorisation, and one
        solve for each of them.

        Parameters
        ----------
        found : CollocationResult
            The result of this problem, whose last program converged.

        Returns
        -------
        SolutionSensitivity

        Raises
        ------
        somersault.errors.InputError
            If `found` is no solution of the problem.
        somersault.errors.SensitivityError
            If it is no isolated minimum, or its constraints depend on each other.

        Examples
        --------
        A mass moved over a metre in a second, with minimum effort 6 m²: dJ/dm = 12 m, dJ/dT = −18 m².

        >>> from somersault import ocp
        >>> problem = ocp.ControlProblem(
        ...     lambda x, u, t, p: [x.v, u.force / p.mass], states=("x", "v"), controls=("force",),
        ...     parameters=("mass",), initial=[0, 0], final=[1, 0], bounds={"mass": (2, 2)},
        ...     running_cost=lambda x, u: 0.5 * u.force**2)
        >>> by = problem.sensitivity(problem.solve())
        >>> slopes = dict(zip(by.names, by.cost.round(4).tolist()))
        >>> slopes["mass"], slopes["duration"]
        (24.0, -72.0)
        """
        if not isinstance(found, CollocationResult):
            raise TypeError(f"`found` must be a CollocationResult, found {_article(type(found).__name__)}")
        return self._posed.sensitivity(found)

    @property
    def model(self) -> Model | None:
        """Model or None: The tree that moves, if the dynamics are those of one."""
        return self._tree[0] if self._tree else None

    @property
    def state_names(self) -> list[str]:
        """list of str: Names of the states."""
        return list(self._names.states)

    @property
    def control_names(self) -> list[str]:
        """list of str: Names of the controls."""
        return list(self._names.controls)

    @property
    def parameter_names(self) -> list[str]:
        """list of str: Names of the parameters."""
        return list(self._names.parameters)

    def _horizon(self, first: float, last: float) -> list[tuple[float, float]]:
        """When it begins and ends, where it begins at a time between two."""
        return [(first, last), (first + self._duration[0], last + self._duration[1])]

    def _origin(self, argument: str, guess: _Guess | None) -> Any:
        """Where a search starts: an earlier result, or rows, or neither."""
        if isinstance(guess, CollocationResult):
            return guess
        return [] if guess is None else [self._start_of(argument, guess)]

    def _start_of(self, argument: str, guess: _Guess) -> CollocationResult | tuple[Any, ...]:
        """Times, states, controls and parameters of a guess by names; an earlier result is one itself."""
        names = self._names
        if isinstance(guess, CollocationResult):
            return guess
        if not isinstance(guess, Mapping):
            found = _article(type(guess).__name__)
            raise InputError(f"`{argument}` must be values by name or an earlier result, found {found}")
        known = ["t", *names.states, *names.controls, *names.parameters]
        rows = {}
        for name, value in guess.items():
            of, columns = f"{argument}[{name!r}]", {"x": names.states, "u": names.controls}.get(name)
            values = _real_numbers(of, value)
            # a state may be called x, and then one dimension is its own values
            if columns is None or (values.ndim < 2 and name in known):
                rows[name] = _values(of, values)
            elif values.shape[1:] == (len(columns),):
                rows |= dict(zip(columns, values.T, strict=True))
            else:
                raise InputError(f"`{of}` must have shape (n, {len(columns)}), found {values.shape}")
        if unknown := [name for name in rows if name not in known]:
            raise InputError(f"`{argument}` must have names among {', '.join(known)}, found {unknown[0]!r}")
        lengths = {len(row) for name, row in rows.items() if row.ndim and name not in names.parameters}
        if len(lengths) > 1:
            raise InputError(f"`{argument}` must have as many values of each, found {sorted(lengths)}")
        count = lengths.pop() if lengths else 2
        if count < 2:
            raise InputError(f"`{argument}` must have at least 2 values of each, found {count}")
        low, high = self._duration
        end = self._start + (0.5 * (low + high) if math.isfinite(high) else max(low, 1.0))
        times = rows.get("t", np.linspace(self._start, end, count))
        if times.ndim != 1 or not (np.diff(times) > 0.0).all():
            raise InputError(f"`{argument}['t']` must be times that rise")
        fraction = (times - times[0]) / (times[-1] - times[0])
        ends = zip(self._initial, self._final, self._ranges[0], strict=True)
        lines = [_line(first, last, bound, fraction) for first, last, bound in ends]
        nearest = [[np.full(count, np.clip(0.0, *pair)) for pair in part] for part in self._ranges[1:]]
        states, controls = (
            np.column_stack(
                [np.broadcast_to(rows.get(name, line), count) for name, line in zip(part, own, strict=True)]
            )
            if part
            else np.zeros((count, 0))
            for part, own in ((names.states, lines), (names.controls, nearest[0]))
        )
        for first in self._quaternions:
            if not any(name in rows for name in names.states[first : first + 4]):
                # the shortest turn between the ends
                states[:, first : first + 4] = 0.0
        parameters = [
            float(rows.get(name, row[0])) for name, row in zip(names.parameters, nearest[1], strict=True)
        ]
        integrals = np.zeros((count, self._n_integrals))
        return times.tolist(), np.hstack([states, integrals]).tolist(), controls.tolist(), parameters

    def __reduce__(self) -> tuple[Any, ...]:
        return functools.partial(type(self), **self._given), ()

    def __repr__(self) -> str:
        names = self._names
        parts = (("states", names.states), ("controls", names.controls), ("parameters", names.parameters))
        listed = (f"{kind} {', '.join(part)}" for kind, part in parts if part)
        return f"<ControlProblem: {'; '.join(listed)}>"
