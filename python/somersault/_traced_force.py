"""Forces of Python, traced: recorded once, then evaluated without the interpreter."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from somersault._somersault.expr import CompiledFunction
from somersault._somersault.forces import TracedForce
from somersault._symbols import refusal
from somersault.errors import InputError
from somersault.expr import _recorded

__all__ = ["traced"]

#: Shapes of what a force depends on, in the order of the numbers of a `TracedForce`.
_INPUTS = {
    "t": (),
    "position": (3,),
    "matrix": (3, 3),
    "quaternion": (4,),
    "velocity": (3,),
    "angular_velocity": (3,),
    "mass": (),
    "inertia": (3, 3),
}


class _Orientation:
    """A rotation of symbols, with what a `scipy.spatial.transform.Rotation` does that can be traced."""

    def __init__(self, matrix: Any, quaternion: Any) -> None:
        self._matrix, self._quaternion = matrix, quaternion

    def apply(self, vectors: Any, inverse: bool = False) -> Any:
        return vectors @ (self._matrix if inverse else self._matrix.T)

    def inv(self) -> _Orientation:
        return _Orientation(self._matrix.T, self._quaternion * np.array([-1.0, -1.0, -1.0, 1.0]))

    def as_matrix(self) -> Any:
        return np.copy(self._matrix)

    def as_quat(self) -> Any:
        return np.copy(self._quaternion)

    def __getattr__(self, name: str) -> Any:
        raise refusal(
            f"`orientation.{name}` of a state cannot be traced; `apply`, `inv`, `as_matrix` and `as_quat` can"
        )


class _Copies:
    """Arrays of symbols as attributes: a copy each time, which the function may change."""

    def __init__(self, **arrays: Any) -> None:
        self._arrays = arrays

    def __getattr__(self, name: str) -> Any:
        if name not in self._arrays:
            raise AttributeError(f"{type(self).__name__.strip('_')} has no {name} that can be traced")
        return np.copy(self._arrays[name])


class _State(_Copies):
    """A `State` of symbols."""

    def __init__(self, orientation: _Orientation, **arrays: Any) -> None:
        rate = orientation.apply(arrays["angular_velocity"], inverse=True)
        super().__init__(**arrays, quaternion=orientation.as_quat(), angular_velocity_body=rate)
        self.orientation = orientation


class _Body(_Copies):
    """A `RigidBody` of symbols."""


def traced(f: Callable[..., tuple[Any, Any]]) -> TracedForce:
    """A force model from a function of Python, which is called once.

    The function is called with symbols, and what it does to them is recorded, as `expr.Function` does. The
    model is evaluated without the interpreter, in batches on all cores, and its derivatives by the state and
    the mass, which `contact.differentiate` takes, are exact.

    Parameters
    ----------
    f : callable
        ``f(t, state)`` or ``f(t, state, body)``, which returns force, N, and torque about the centre
        of mass, N m, world frame, each of shape (3,), as a callable that `integrate` takes does. It may use
        NumPy, with `np.where` in the place of branches. Of ``state.orientation`` it may use `apply`, `inv`,
        `as_matrix` and `as_quat`; of ``body`` the `mass` and the `inertia`. A third argument with a default
        is the body only where its name is that.

    Returns
    -------
    TracedForce
        The model, for any body.

    Raises
    ------
    TraceError
        If the function does something that symbols cannot take part in; the message has its line.
    InputError
        If it takes other arguments or returns something else.

    Examples
    --------
    The attraction of a centre, on bodies of any mass, and a torque that is switched off after two seconds:

    >>> import numpy as np
    >>> import somersault
    >>> def pull(t, state, body):
    ...     r = state.position
    ...     torque = np.where(t < 2.0, 0.1, 0.0) * np.array([0.0, 0.0, 1.0])
    ...     return -body.mass * r / np.linalg.norm(r) ** 3, torque
    >>> force = somersault.forces.traced(pull)
    >>> body = somersault.RigidBody(2.0, (0.1, 0.2, 0.2))
    >>> start = somersault.State(position=(1.0, 0.0, 0.0), velocity=(0.0, 1.0, 0.0))
    >>> motion = somersault.integrate(body, start, (0.0, 2 * np.pi), forces=force)
    >>> bool(np.abs(motion.position[-1] - start.position).max() < 1e-6)
    True
    """
    takes_body = _takes_body(f)

    def numbers(
        t: Any,
        position: Any,
        matrix: Any,
        quaternion: Any,
        velocity: Any,
        angular_velocity: Any,
        mass: Any,
        inertia: Any,
    ) -> Any:
        orientation = _Orientation(matrix, quaternion)
        state = _State(orientation, position=position, velocity=velocity, angular_velocity=angular_velocity)
        returned = f(t, state, _Body(mass=mass, inertia=inertia)) if takes_body else f(t, state)
        return np.concatenate(_pair(returned))

    graph, blocks, outputs, _, _ = _recorded(numbers, _INPUTS)
    return TracedForce(CompiledFunction(graph, blocks, outputs))


def _takes_body(f: Any) -> bool:
    """Whether a function takes a body: where its third argument must be given, or is called so."""
    if not callable(f):
        raise InputError(f"`f` must be a function, found {type(f).__name__}")
    try:
        signature = inspect.signature(f)
    except (TypeError, ValueError):
        return False

    def takes(count: int) -> bool:
        try:
            signature.bind(*range(count))
        except TypeError:
            return False
        return True

    named = list(signature.parameters)[2:3] == ["body"]
    if takes(3) and (named or not takes(2)):
        return True
    if takes(2):
        return False
    raise InputError(f"`f` must take (t, state) or (t, state, body), found {signature}")


def _pair(returned: Any) -> list[Any]:
    """Force and torque, as arrays of objects."""
    expected = "`f` must return a pair (force, torque), each of shape (3,)"
    if not isinstance(returned, tuple | list | np.ndarray) or len(returned) != 2:
        raise InputError(f"{expected}, found {type(returned).__name__}")
    vectors = [np.asarray(part, dtype=object) for part in returned]
    for vector in vectors:
        if vector.shape != (3,):
            raise InputError(f"{expected}, found shape {vector.shape}")
    return vectors
