"""An exam of engines: motions whose end is known, and what an engine makes of them.

`scenes` are 32 motions with their equations, their answers in sixteen digits and the derivatives of these:
bodies that turn freely or under torque, tops, bounces, friction, rolling. `audit` runs an engine, which is a
function or one that `engine` makes, through them over a ladder of steps, and says of each how far the end is
from the answer, of which order the error is, what is not conserved, and why.

>>> from somersault import exam
>>> report = exam.audit(exam.engine("somersault:rkmk"), ["pendulum"])
>>> report["pendulum"].status, round(report["pendulum"].orders["SO3"])
('agrees', 4)
"""

from somersault.exam.adapters import engine, engines
from somersault.exam.catalogue import (
    ExamScene,
    SceneContact,
    SceneGuard,
    SceneHinge,
    SceneMode,
    scene,
    scenes,
)
from somersault.exam.report import ExamReport, SceneResult, audit

__all__ = [
    "ExamReport",
    "ExamScene",
    "SceneContact",
    "SceneGuard",
    "SceneHinge",
    "SceneMode",
    "SceneResult",
    "audit",
    "engine",
    "engines",
    "scene",
    "scenes",
]
