"""Exceptions of somersault: one class for each reaction that a caller may have.

All derive from `SomersaultError`. Those for which the input was at fault also derive from
`InputError`, and so from `ValueError`. A message names the argument, what was found and what is
allowed. An exception that stops `somersault.integrate` has what was recorded up to there in its attribute
`solution`; this holds for what a callable raises as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from somersault._somersault.integrators import Solution

__all__ = [
    "ChatteringError",
    "DynamicsError",
    "EvaluationError",
    "ExportError",
    "InputError",
    "IntegrationError",
    "ReadError",
    "ReadWarning",
    "SensitivityError",
    "SomersaultError",
    "SweepError",
    "TraceError",
    "WriteError",
]


class SomersaultError(Exception):
    """Base of all exceptions of somersault."""


class InputError(SomersaultError, ValueError):
    """An argument has a shape, type or value that is not allowed, or contradicts another one."""


class ReadError(InputError):
    """A file or document is not what it should be.

    The message says where, what was found and what is allowed.
    """

    #: Line of a text file, from 1.
    line: int | None = None
    #: Byte of a binary file, from 0.
    byte: int | None = None


class WriteError(InputError):
    """Something cannot be written in this format; the message says which part."""


class IntegrationError(SomersaultError):
    """A motion could not be followed to its end.

    The state stopped being finite, a tolerance cannot be met, the equation of an implicit step was not
    solved, a body turns further in a step than the method allows, or there were too many steps.
    """

    #: What was recorded up to there, where a run of `somersault.integrate` had begun.
    solution: Solution | None = None
    #: Time since the start of a motion of `somersault.ftla`, s, and its last state.
    t: float | None = None
    state: NDArray[np.float64] | None = None


class ChatteringError(IntegrationError):
    """Events in contacts follow each other faster than allowed."""


class SensitivityError(SomersaultError):
    """The motion has no derivative.

    It grazes a surface, the rate of a nearest point jumps under friction, or it is no isolated optimum.
    """


class DynamicsError(SomersaultError):
    """The dynamics of a tree have no solution: some motion of a joint moves no mass."""


class EvaluationError(SomersaultError):
    """A function or a result has no value.

    A number on the way to it is not finite, a decomposition did not converge, or a callable raised, which is
    then the cause.
    """

    #: Time since the start of a motion of `somersault.ftla`, s, and its last state, where the field has none.
    t: float | None = None
    state: NDArray[np.float64] | None = None


class ExportError(SomersaultError):
    """A film cannot be made here: the message names what is missing, or what went wrong."""


class SweepError(SomersaultError):
    """A sweep could not continue: its directory is in use, or its cluster went away."""


class TraceError(InputError):
    """A function cannot be traced: it does something that symbols cannot take part in, or raises.

    The message has the line of it, and what to write instead.
    """

    #: The file, the number of the line and its text.
    place: str = ""
    #: What the line does, and what to write instead.
    reason: str = ""


class ReadWarning(UserWarning):
    """A file is not quite of its format and was read: the message has where, and what was done."""
