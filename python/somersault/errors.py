"""Exceptions of somersault.

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

    from somersault._somersault import Solution

__all__ = [
    "AnalysisError",
    "AnalysisInputError",
    "BatchError",
    "BatchInputError",
    "BodyError",
    "ChatteringError",
    "ContactError",
    "CountMismatchError",
    "DynamicsError",
    "DynamicsInputError",
    "ExportError",
    "FieldError",
    "FitError",
    "FlightError",
    "FlowError",
    "FreeBodyError",
    "FtlaError",
    "FtlaInputError",
    "InertiaError",
    "InputError",
    "IntegrateError",
    "IntegrateInputError",
    "ModelError",
    "OcpError",
    "OcpInputError",
    "PostureError",
    "ReadError",
    "ReadWarning",
    "RecordingError",
    "ScoringError",
    "SensitivityError",
    "SensitivityInputError",
    "SomersaultError",
    "StepError",
    "StorageError",
    "StudyError",
    "StudyInputError",
    "SurfaceError",
    "SweepError",
    "SweepInputError",
    "SyntheticError",
    "TorqueError",
    "UnknownMethodError",
    "UrdfError",
    "ViewerError",
    "WriteError",
]


class SomersaultError(Exception):
    """Base of all exceptions of somersault."""


class InputError(SomersaultError, ValueError):
    """An argument has a shape, type or value that is not allowed."""


class InertiaError(InputError):
    """A tensor or a shape is not the inertia of a rigid body."""


class BodyError(InputError):
    """A mass is not that of a rigid body."""


class CountMismatchError(InputError):
    """The numbers of bodies and of something that belongs to each differ."""


class UnknownMethodError(InputError):
    """No method has this name; the message lists those there are."""


class IntegrateError(SomersaultError):
    """An integration could not go on: the state stopped being finite, a tolerance cannot be met."""

    #: What was recorded up to there, where a run had begun.
    solution: Solution | None = None


class IntegrateInputError(IntegrateError, InputError):
    """An integration could not start: interval, step or tolerances are not allowed."""


class StepError(IntegrateError):
    """A step failed.

    The equation of an implicit step was not solved, or a body turns further in it than the method allows.
    """


class TorqueError(StepError, InputError):
    """The method takes no torque, and the forces given may exert one."""


class ChatteringError(IntegrateError):
    """Events in contacts follow each other faster than allowed."""


class SurfaceError(IntegrateError, InputError):
    """A surface cannot be touched: its distance or gradient is wrong, not finite or too steep."""


class ContactError(InputError):
    """A law, a surface or a contact cannot be made of these numbers."""


class SensitivityError(SomersaultError):
    """The motion has no derivative: it grazes a surface."""


class SensitivityInputError(SensitivityError, InputError):
    """A derivative that there is not: by friction where there is none, of a start on a surface."""


class BatchError(SomersaultError):
    """A body of a batch could not be integrated."""


class BatchInputError(BatchError, InputError):
    """The arguments of a batch do not fit together."""


class FreeBodyError(InputError):
    """A time at which the exact motion is asked for, or the state there, is not finite."""


class StudyError(SomersaultError):
    """A study could not be made of a method."""


class StudyInputError(StudyError, InputError):
    """The arguments of a study are not allowed."""


class ModelError(InputError):
    """A body cannot be part of a tree; the message names it."""


class DynamicsError(SomersaultError):
    """The dynamics of a tree have no solution: some motion of a joint moves no mass."""


class DynamicsInputError(DynamicsError, InputError):
    """A tree has no such body, or a quaternion is no rotation."""


class PostureError(InputError):
    """A diver has no such posture."""


class UrdfError(InputError):
    """A document is not a tree in URDF, or a tree cannot be written as one; the message names the element."""


class FlightError(InputError):
    """A tree cannot fly: its root is held or damped."""


class OcpError(SomersaultError):
    """A motion has no value: a number on the way to it is not finite."""


class OcpInputError(OcpError, InputError):
    """A motion problem or a solver is given what does not fit or is not allowed."""


class RecordingError(InputError):
    """Numbers are no recording, or what is asked of a recording cannot be done."""


class ReadError(InputError):
    """A file is not what it should be: the message says where, what was found and what is allowed."""

    #: Line of a text file, from 1.
    line: int | None = None
    #: Byte of a binary file, from 0.
    byte: int | None = None


class ReadWarning(UserWarning):
    """A file contradicts itself and was read: the message has what is declared and what was used."""


class WriteError(InputError):
    """A recording cannot be written in this format."""


class FitError(InputError):
    """A model cannot be fitted to these markers, or in this way."""


class AnalysisError(SomersaultError):
    """A decomposition into singular values did not converge."""


class AnalysisInputError(AnalysisError, InputError):
    """Motions cannot be analysed: too few, of different widths, or not finite."""


class ScoringError(InputError):
    """Motions cannot be scored: too few, not finite, or all the same."""


class FtlaError(SomersaultError):
    """An analysis of a hyper-sensitive problem could not be made."""


class FtlaInputError(FtlaError, InputError):
    """An analysis is given what does not fit or is not allowed."""


class FlowError(FtlaError):
    """A motion cannot be followed to its end: its steps become too small or too many."""

    #: Time since the start of the motion, s, and the last state, where it had begun.
    t: float | None = None
    state: NDArray[np.float64] | None = None


class FieldError(FlowError):
    """A field has no value: it is not finite, or a callable raised, which is then the cause."""


class SyntheticError(InputError):
    """No synthetic dive can be made in this way: the message says why."""


class ViewerError(InputError):
    """A shape cannot be made of these numbers, or a motion and a scene do not fit together."""


class ExportError(SomersaultError):
    """A film cannot be made here: the message names what is missing, or what went wrong."""


class StorageError(InputError):
    """A file is not one of somersault, is damaged or of a later version, or a thing cannot be written."""


class SweepError(SomersaultError):
    """A sweep could not go on: its directory is in use, or its cluster went away."""


class SweepInputError(SweepError, InputError):
    """The points of a sweep cannot be written, or its directory is of another one."""
