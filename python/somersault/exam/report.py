"""An engine is run through scenes, and what it returns compared with their answers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import somersault
from somersault._somersault.integrators import State
from somersault.errors import InputError
from somersault.exam import page
from somersault.exam.catalogue import SIZE, ExamScene, scene, scenes

__all__ = ["ExamReport", "SceneResult", "audit"]

Array = NDArray[np.float64]
#: A callable `engine(scene, dt)`, or an object with a method `run` of these arguments.
Engine: TypeAlias = Any

#: Where orders are observed, and what is compared, with its unit.
_OF_SPACE = {"R3": "position", "SO3": "orientation"}
QUANTITIES = {"position": "m", "orientation": "rad", "velocity": "m/s", "angular_velocity": "rad/s"}
#: Steps are the scene's own, divided by these; the last run of an engine with a law of its own by `_FINE`
#: more.
_DIVISORS, _FINE = (1, 2, 4, 8, 16), 8
#: Tolerances of an engine that has no steps.
_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
#: Errors below this much of the scene's condition are of rounding, and say nothing of the order.
_ROUNDING = 1e-12
#: Errors from which an order is read, and the part of a step by which an event that is not located is off.
_FITTED, _LATE = 3, 0.02
#: The largest error from which an order is read, and the relative error of a derivative that is right.
_COARSE, _GRADIENT = 0.3, 1e-3
#: Names of orders in words, and what is conserved as a vector, which may turn and not grow.
_SPACES = {"R3": "R³", "SO3": "SO(3)"}
_VECTORS = ("angular momentum", "momentum")
#: A relative change of what is conserved, per second, that is worth a word.
_DRIFT = 1e-6


@dataclass(frozen=True)
class SceneResult:
    """What an engine made of one scene.

    Attributes
    ----------
    scene : str
        Name of the scene.
    status : {'agrees', 'converges', 'differs', 'own law', 'not asked', 'failed'}
        Whether the end is within the tolerance of the answer, comes closer with the step, does neither, or is
        that of another law; whether the engine cannot state the scene; whether it raised or returned no
        state.
    verdict : str
        The reason, in a sentence.
    steps : tuple of float
        Steps, s, or tolerances where the engine has those.
    errors : Mapping of str to tuple of float
        For each step, the error of position (m), orientation (rad), velocity and angular velocity. They are
        measured from the answer, or, where the engine has a law of its own, from its own run at an eighth of
        the last step.
    orders : Mapping of str to float
        Observed order of the position (``'R3'``) and of the orientation (``'SO3'``), where there is one.
    distance : Mapping of str to float
        Distance from the answer at the last step.
    default : Mapping of str to float
        Distance from the answer at the engine's default step.
    drift : Mapping of str to float
        Change of what is conserved, as a fraction of it per second, at the first step.
    events : tuple of int or None
        How many events the engine reported, and how many there are; None if it reports none.
    event_error : float
        Largest error of their times, s; NaN unless all were reported.
    gradient_error : float
        Relative error of the derivative of the end by the scene's parameter; NaN where it was not measured,
        infinite where the engine gave numbers that are not finite.
    condition : float
        How much an error at the start grows.
    """

    scene: str
    status: str
    verdict: str
    steps: tuple[float, ...] = ()
    errors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    orders: Mapping[str, float] = field(default_factory=dict)
    distance: Mapping[str, float] = field(default_factory=dict)
    default: Mapping[str, float] = field(default_factory=dict)
    drift: Mapping[str, float] = field(default_factory=dict)
    events: tuple[int, int] | None = None
    event_error: float = math.nan
    gradient_error: float = math.nan
    condition: float = math.nan

    def __repr__(self) -> str:
        return f"<SceneResult {self.scene}: {self.status}, {_short(self.verdict, 120)}>"

    def to_dict(self) -> dict[str, Any]:
        """The result as dictionaries, lists, numbers and texts, for JSON; NaN and infinity are None.

        Examples
        --------
        >>> from somersault import exam
        >>> report = exam.audit(exam.engine("somersault:rkmk8"), ["two_balls"], steps=[0.01, 0.005])
        >>> report["two_balls"].to_dict()["status"]
        'own law'
        """
        found: dict[str, Any] = _plain(vars(self))
        return found


@dataclass(frozen=True)
class ExamReport:
    """What an engine made of the scenes it was given.

    Attributes
    ----------
    engine : str
        Its name.
    versions : Mapping of str to str
        Versions of this library and of what the engine is made of.
    results : tuple of SceneResult
        One for each scene, in the order in which they were given.
    """

    engine: str
    versions: Mapping[str, str]
    results: tuple[SceneResult, ...]

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{sum(result.status == status for result in self.results)} {status}"
            for status in dict.fromkeys(result.status for result in self.results)
        )
        return f"<ExamReport {_short(self.engine, 60)}: {counts or 'no scenes'}>"

    def __getitem__(self, name: str) -> SceneResult:
        for result in self.results:
            if result.scene == name:
                return result
        raise InputError(f"`name` must be one of the scenes of this report, found {name!r}")

    @property
    def success(self) -> bool:
        """Whether the engine can state a scene, and agrees with the answers of all that it can state."""
        asked = [result for result in self.results if result.status != "not asked"]
        return bool(asked) and all(result.status == "agrees" for result in asked)

    def table(self) -> str:
        """The results as a table in Markdown.

        Examples
        --------
        >>> from somersault import exam
        >>> report = exam.audit(exam.engine("somersault"), ["rod"])
        >>> print(report.table().splitlines()[0])
        | scene | status | R³, order | SO(3), order | m | rad | at the default | verdict |
        """
        lines = ["| scene | status | R³, order | SO(3), order | m | rad | at the default | verdict |"]
        lines.append("|---|---|---:|---:|---:|---:|---:|---|")
        for result in self.results:
            orders = (_number(result.orders.get(name), ".1f") for name in ("R3", "SO3"))
            spaces = scene(result.scene).spaces
            ends = (
                _number(result.distance.get(name) if space in spaces else None, ".1e")
                for space, name in _OF_SPACE.items()
            )
            default = _number(max(result.default.values(), default=None), ".1e")
            cells = (result.scene, result.status, *orders, *ends, default, result.verdict)
            lines.append(
                "| " + " | ".join(cell.replace("|", "/").replace("\n", " ") for cell in cells) + " |"
            )
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """The report as dictionaries, lists, numbers and texts, for JSON; NaN and infinity are None.

        Examples
        --------
        >>> from somersault import exam
        >>> report = exam.audit(exam.engine("somersault"), ["rod"])
        >>> sorted(report.to_dict())
        ['engine', 'results', 'versions']
        """
        return {
            "engine": self.engine,
            "versions": dict(self.versions),
            "results": [result.to_dict() for result in self.results],
        }

    def to_html(self, path: str | PathLike[str] | None = None) -> str:
        """A page with the results and a figure of error against step for each scene; it needs no network.

        Parameters
        ----------
        path : path, optional
            Where to write it as well; the name ends in .html.

        Returns
        -------
        str
            The page.

        Raises
        ------
        InputError
            If the name does not end in .html or .htm.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> from somersault import exam
        >>> report = exam.audit(exam.engine("somersault"), ["rod"])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     text = report.to_html(pathlib.Path(folder) / "exam.html")
        >>> text[:15], "http" in text
        ('<!doctype html>', False)
        """
        text = page.of([self.to_dict()])
        if path is not None:
            target = Path(path)
            if target.suffix.lower() not in (".html", ".htm"):
                raise InputError(f"`path` must end in .html or .htm, found {str(target)!r}")
            target.write_text(text, encoding="utf-8")
        return text


def audit(
    engine: Engine,
    scenes: Iterable[str | ExamScene] | str | None = None,
    steps: Sequence[float] | None = None,
    *,
    tol: float = 1e-6,
    gradients: bool = True,
    name: str | None = None,
) -> ExamReport:
    """Runs an engine through scenes and compares its ends with their answers.

    Parameters
    ----------
    engine : callable or object
        A function ``engine(scene, dt)``, or an object with a method ``run(scene, dt)``. It returns the state
        at the end, a `somersault.State` for each body or an array of shape (bodies, 13) as `ExamScene`
        describes it; or a pair of that and the times of the events it located. An object may have besides:
        ``can(scene)``, true or the reason why the scene cannot be stated; ``law(scene)``, the name of a law
        of its own by which it moves in place of the scene's, or None; ``default(scene)``, the step that it
        takes unless told otherwise; ``setting = 'tolerance'``, if it is run with tolerances in place of
        steps; ``gradient(scene, dt)``, the derivative of the end as in `ExamScene.gradient`, or None;
        ``name`` and ``versions``.
    scenes : sequence of str or ExamScene, or {'rotation', 'contact'}, optional
        Scenes, or those of a group; all unless given.
    steps : sequence of float, optional
        Steps, s, or tolerances, from coarse to fine; at least two. The scene's step and its 2nd, 4th, 8th and
        16th part unless given.
    tol : float, optional
        Error at the last step up to which an end agrees, m, rad, m/s and rad/s alike, times the scene's
        condition where that is above 1.
    gradients : bool, optional
        Whether to compare derivatives, by central differences at the last step where the engine has none.
    name : str, optional
        Name of the engine in the report; that of the object or function unless given.

    Returns
    -------
    ExamReport
        The results. What an engine raises is in the result of the scene, with status ``'failed'``.

    Raises
    ------
    InputError
        If there is no such scene, or a step or the tolerance is not positive.
    TypeError
        If the engine can neither be called nor run.

    Examples
    --------
    Explicit Euler steps, which lose sight of energy:

    >>> import numpy as np
    >>> from somersault import exam
    >>> def euler(scene, dt):
    ...     y, mode = scene.y0.ravel(), scene.first
    ...     for _ in range(round(scene.duration / dt)):
    ...         y = y + dt * np.array(scene.rate(mode, 0.0, y))
    ...     return y.reshape(scene.y0.shape)
    >>> report = exam.audit(euler, ["middle_axis"])
    >>> report["middle_axis"].status, round(report["middle_axis"].orders["SO3"])
    ('converges', 1)
    >>> report["middle_axis"].verdict.partition(" of itself")[0]
    'order 1 on SO(3); 1.8e-02 rad from the answer at the last step; energy grows by 0.026'
    """
    run = engine.run if hasattr(engine, "run") else engine
    if not callable(run):
        raise TypeError(f"`engine` must be callable or have a method `run`, found a {type(engine).__name__}")
    asked = _scenes(scenes)
    ladder = None if steps is None else _steps(steps)
    if not (isinstance(tol, int | float) and 0.0 < tol < math.inf):
        raise InputError(f"`tol` must be positive and finite, found {tol!r}")
    if not isinstance(name, str | None):
        raise InputError(f"`name` must be a text, found a {type(name).__name__}")
    label = name or getattr(engine, "name", None) or getattr(engine, "__name__", type(engine).__name__)
    versions = {"somersault": somersault.__version__, **dict(getattr(engine, "versions", {}))}
    results: list[SceneResult] = []
    try:
        for scene in asked:
            results.append(_examined(engine, run, scene, ladder, float(tol), gradients))
    except KeyboardInterrupt as stop:
        stop.solution = ExamReport(str(label), versions, tuple(results))  # type: ignore[attr-defined]
        raise
    return ExamReport(str(label), versions, tuple(results))


def _scenes(given: Iterable[str | ExamScene] | str | None) -> list[ExamScene]:
    if given is None:
        return list(scenes())
    if isinstance(given, str):
        if given in ("rotation", "contact"):
            return list(scenes(given))
        raise InputError(f"`scenes` must be 'rotation', 'contact' or a sequence of scenes, found {given!r}")
    try:
        listed = tuple(given)
    except TypeError:
        raise InputError(
            f"`scenes` must be names, scenes or the name of a group, found a {type(given).__name__}"
        ) from None
    known = {each.name: each for each in scenes()}
    found = []
    for each in listed:
        if not isinstance(each, ExamScene) and (not isinstance(each, str) or each not in known):
            raise InputError(f"`scenes` must be among {', '.join(known)}; found {each!r}")
        asked = known[each] if isinstance(each, str) else each
        if asked.varied_by:
            raise InputError(f"`scenes` must have answers, and {asked.name} is varied")
        found.append(asked)
    return found


def _steps(given: Sequence[float]) -> tuple[float, ...]:
    try:
        found = tuple(float(step) for step in given)
    except (TypeError, ValueError):
        raise InputError(f"`steps` must be numbers, found {given!r:.60}") from None
    if len(found) < 2 or not all(0.0 < step < math.inf for step in found):
        raise InputError(f"`steps` must be two or more positive numbers, found {list(found)!r:.80}")
    if any(after >= before for before, after in pairwise(found)):
        raise InputError(f"`steps` must decrease, found {list(found)!r:.80}")
    return found


class _Refused(Exception):
    """An engine returned something other than a state at the end of the scene."""


def _examined(
    engine: Engine,
    run: Callable[..., Any],
    scene: ExamScene,
    steps: tuple[float, ...] | None,
    tol: float,
    gradients: bool,
) -> SceneResult:
    try:
        can = engine.can(scene) if hasattr(engine, "can") else True
        if can is not True:
            return SceneResult(scene.name, "not asked", can if isinstance(can, str) else "cannot be stated")
        return _measured(engine, run, scene, steps, tol, gradients)
    except _Refused as fault:
        return SceneResult(scene.name, "failed", str(fault))
    except Exception as fault:
        return SceneResult(scene.name, "failed", f"it raised {type(fault).__name__}: {fault}")


def _measured(
    engine: Engine,
    run: Callable[..., Any],
    scene: ExamScene,
    steps: tuple[float, ...] | None,
    tol: float,
    gradients: bool,
) -> SceneResult:
    by_tolerance = getattr(engine, "setting", "step") == "tolerance"
    if steps is None:
        steps = _TOLERANCES if by_tolerance else tuple(scene.default_step / part for part in _DIVISORS)
    own = engine.law(scene) if hasattr(engine, "law") else None
    ends, events = [], None
    for step in steps:
        end, events = _ended(run(scene, step), scene)
        ends.append(end)
    finest = _ended(run(scene, steps[-1] / _FINE), scene)[0] if own else scene.answer
    errors = {name: tuple(_error(name, end, finest) for end in ends) for name in QUANTITIES}
    distance = {name: _error(name, ends[-1], scene.answer) for name in QUANTITIES}
    if hasattr(engine, "default"):
        end = _ended(run(scene, engine.default(scene)), scene)[0]
        default = {name: _error(name, end, scene.answer) for name in QUANTITIES}
    else:
        default = {name: _error(name, ends[0], scene.answer) for name in QUANTITIES}
    measured = steps[-2:] if gradients and not own else ()
    slopes, fault = [math.nan], ""
    try:
        slopes = [_gradient_error(engine, run, scene, step) for step in measured] or slopes
    except _Refused as refused:
        fault = f"without a derivative: {refused}"
    except Exception as raised:
        fault = f"without a derivative: it raised {type(raised).__name__}: {raised}"
    found = SceneResult(
        scene.name,
        "",
        "",
        steps,
        errors,
        {} if by_tolerance else _orders(steps, errors, scene),
        distance,
        default,
        _drift(scene, ends[0]),
        None if events is None else (len(events), len(scene.events)),
        _event_error(events, scene),
        slopes[-1],
        scene.condition,
    )
    judged = _judged(found, scene, own, tol, by_tolerance, slopes)
    return replace(judged, verdict=f"{judged.verdict}; {fault}") if fault else judged


def _ended(returned: Any, scene: ExamScene) -> tuple[Array, tuple[float, ...] | None]:
    """The state at the end and the times of events, of whatever an engine may return."""
    events = None
    if isinstance(returned, tuple) and len(returned) == 2 and not isinstance(returned[1], State):
        returned, times = returned
        events = None if times is None else tuple(float(t) for t in times)
        if events is not None and not all(map(math.isfinite, events)):
            raise _Refused("it returned times of events that are not finite")
    if isinstance(returned, State):
        returned = [returned]
    if isinstance(returned, Sequence) and returned and all(isinstance(each, State) for each in returned):
        returned = [[*s.position, *s.quaternion, *s.velocity, *s.angular_velocity_body] for s in returned]
    try:
        end = np.array(returned, dtype=float)
    except (TypeError, ValueError):
        raise _Refused(f"it returned a {type(returned).__name__}, which is no state") from None
    if end.size != scene.y0.size or end.shape not in (scene.y0.shape, (SIZE,)):
        raise _Refused(f"it returned an array of shape {end.shape}, and a state has {scene.y0.shape}")
    end = end.reshape(scene.y0.shape)
    if not np.all(np.isfinite(end)):
        raise _Refused("it returned a state that is not finite")
    lengths = np.linalg.norm(end[:, 3:7], axis=1)
    if np.any(lengths < 1e-6):
        raise _Refused("it returned a quaternion of length 0")
    end[:, 3:7] /= lengths[:, None]
    return end, events


def _error(name: str, end: Array, exact: Array) -> float:
    """The largest error of a quantity over the bodies."""
    if name == "orientation":
        return max(_angle(p, q) for p, q in zip(end[:, 3:7], exact[:, 3:7], strict=True))
    part = {"position": slice(0, 3), "velocity": slice(7, 10), "angular_velocity": slice(10, 13)}[name]
    return float(np.max(np.linalg.norm(end[:, part] - exact[:, part], axis=1)))


def _angle(p: Array, q: Array) -> float:
    """The angle between two orientations, by the difference of their quaternions, which keeps small ones."""
    half = min(float(np.linalg.norm(p - q)), float(np.linalg.norm(p + q))) / 2
    return 4 * math.asin(min(1.0, half))


def _orders(
    steps: Sequence[float], errors: Mapping[str, Sequence[float]], scene: ExamScene
) -> dict[str, float]:
    """Slopes of error against step, of the last errors that are neither coarse nor rounded."""
    floor = _ROUNDING * max(1.0, scene.condition)
    found = {}
    for space, name in _OF_SPACE.items():
        if errors[name][0] < 2 * errors[name][-1]:
            continue  # the error does not depend on the step
        fit = [(h, e) for h, e in zip(steps, errors[name], strict=True) if floor < e < _COARSE][-_FITTED:]
        if len(fit) > 1:
            h, e = np.log(np.transpose(fit))
            found[space] = float(np.polyfit(h, e, 1)[0])
    # an error that grows where the step falls has no order
    return {space: slope for space, slope in found.items() if slope > 0.0}


def _drift(scene: ExamScene, end: Array) -> dict[str, float]:
    """Relative changes of what is conserved, per second; growth is positive."""
    found = {}
    for name, function in scene.invariants.items():
        before, after = np.atleast_1d(function(scene.y0)), np.atleast_1d(function(end))
        scale = float(np.linalg.norm(before)) or 1.0
        change = float(np.linalg.norm(after - before))
        sign = -1.0 if np.linalg.norm(after) < np.linalg.norm(before) else 1.0
        found[name] = sign * change / scale / scene.duration
    return found


def _event_error(events: tuple[float, ...] | None, scene: ExamScene) -> float:
    if events is None or len(events) != len(scene.events):
        return math.nan
    return max((abs(t - exact) for t, exact in zip(events, scene.events, strict=True)), default=0.0)


def _gradient_error(engine: Engine, run: Callable[..., Any], scene: ExamScene, step: float) -> float:
    exact = scene.gradient
    given = engine.gradient(scene, step) if hasattr(engine, "gradient") else None
    if given is not None:
        found = np.array(given, dtype=float)
        if found.shape != exact.shape:
            raise _Refused(f"its gradient has shape {found.shape}, and that of the scene {exact.shape}")
    else:
        less, more = (
            _ended(run(scene.varied(by), step), scene)[0] for by in (-scene.variation, scene.variation)
        )
        found = np.array([_difference(a, b) for a, b in zip(less, more, strict=True)]) / (2 * scene.variation)
    if not np.all(np.isfinite(found)):
        return math.inf
    return float(np.linalg.norm(found - exact) / max(1.0, float(np.linalg.norm(exact))))


def _difference(less: Array, more: Array) -> Array:
    """Of two states of a body: position, rotation vector in the body, velocity, angular velocity."""
    p, q = less[3:7], more[3:7]
    q = q if p @ q >= 0 else -q
    turn = 2 * (p[3] * q[:3] - q[3] * p[:3] - np.cross(p[:3], q[:3]))
    return np.concatenate([more[:3] - less[:3], turn, more[7:] - less[7:]])


def _judged(
    found: SceneResult,
    scene: ExamScene,
    own: str | None,
    tol: float,
    by_tolerance: bool,
    slopes: Sequence[float],
) -> SceneResult:
    """The status and the reason, from what was measured."""
    allowed = tol * max(1.0, scene.condition)
    first, last = (max(errors[k] for errors in found.errors.values()) for k in (0, -1))
    missed = found.events is not None and found.events[0] != found.events[1]
    slope_wrong = math.isinf(slopes[-1]) or (slopes[-1] > _GRADIENT and slopes[-1] > 0.7 * slopes[0])
    # an engine may report the end of the step in which an event fell
    late = found.event_error > max(allowed, 0.0 if by_tolerance else found.steps[-1])
    reasons = [_of_order(found, scene, own, last <= allowed)]
    if own:
        status = "own law"
        reasons.append(
            f"{own}: within {last:.1e} of its own limit, which is {_measure(found.distance)} from the answer"
        )
    elif last <= allowed:
        status = "differs" if missed or late or slope_wrong else "agrees"
        reasons.append(f"within {last:.1e} of the answer")
    elif last < 0.7 * first and not missed:
        status = "converges"
        reasons.append(f"{_measure(found.distance)} from the answer at the last step")
    else:
        status = "differs"
        reasons.append(f"stays {_measure(found.distance)} from the answer")
    if not own:
        if missed and found.events is not None:
            reasons.append(f"{found.events[0]} of {found.events[1]} events were located")
        if found.event_error > allowed and status != "converges":
            reasons.append(f"an event is off by {found.event_error:.1e} s")
        if slope_wrong and (last <= allowed or missed):
            is_finite = math.isfinite(found.gradient_error)
            off = f"off by {found.gradient_error:.2g} of itself" if is_finite else "not finite"
            reasons.append(f"the derivative by the start is {off}")
        at = f"a tolerance of {found.steps[0]:g}" if by_tolerance else f"a step of {found.steps[0]:g} s"
        for what, drift in found.drift.items():
            if abs(drift) > _DRIFT:
                does = "changes" if what in _VECTORS else "grows" if drift > 0 else "falls"
                reasons.append(f"{what} {does} by {abs(drift):.2g} of itself per second at {at}")
    return replace(found, status=status, verdict="; ".join(filter(None, reasons)))


def _of_order(found: SceneResult, scene: ExamScene, own: str | None, agrees: bool) -> str:
    """The orders in words, and why they are low."""
    # where nothing moves on one of the two there is no order on it
    orders = {space: order for space, order in found.orders.items() if order > 0.5}
    if not orders:
        return ""
    words = " and ".join(f"{round(order)} on {_SPACES[space]}" for space, order in orders.items())
    # events that are located come closer by a power of the step, others by the step
    late = min(orders.values()) < 1.5 or found.event_error > _LATE * found.steps[-1]
    passed_by = scene.events and late and not own and not agrees
    return f"order {words}{': contact is not located' if passed_by else ''}"


def _measure(distance: Mapping[str, float]) -> str:
    """The first distance that matters, with its unit."""
    for name, unit in QUANTITIES.items():
        if distance[name] >= 0.1 * max(distance.values()):
            return f"{distance[name]:.1e} {unit}"
    return "0"


def _number(value: float | None, form: str) -> str:
    return "" if value is None or math.isnan(value) else format(value, form)


def _short(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
