"""From a recording to advice: what a flight was, what would have been, and what to do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from somersault._somersault import multibody, ocp
from somersault._somersault.motion import (
    FlightAdvice,
    FlightReport,
    KeypointRecording,
    MarkerRecording,
    MarkerSet,
    ReconstructedFlight,
    WhatIf,
    advise_flight,
    identify_flight,
    read_file,
    reconstruct_flight,
    what_if,
)
from somersault.errors import InputError, SomersaultError

__all__ = ["FlightAnalysis", "analyse"]

Array = NDArray[np.float64]

#: Changes that every analysis flies: of opening (s), posture (rad), momentum (fraction) and height (m).
_CHANGES: tuple[dict[str, Any], ...] = (
    {"opening": 0.02},
    {"opening": -0.02},
    {"posture": np.radians(5.0)},
    {"momentum": 0.02},
    {"height": 0.1},
)
#: Joints that are compared with the optimum: bodies of the planar diver, and of the spatial ones, sides as
#: one. Their arms leave the plane.
_JOINTS = {
    "trunk": (("pelvis",),),
    "hip": (("thigh",), ("right_thigh", "left_thigh")),
    "knee": (("shank",), ("right_shank", "left_shank")),
    "shoulder": (("upper_arm",),),
    "elbow": (("forearm",), ("right_forearm", "left_forearm")),
}
#: Of the ball-jointed diver's angles those of the joints that are balls, sides as one.
_BALLS = {"hip": ("right_hip", "left_hip")}
#: Those that bend the trunk, together.
_TRUNK = ("abdomen_bend", "pelvis_bend")
#: Folded postures of the templates, by the position.
_POSTURES = {"pike": "H", "tuck": "F"}
#: Distance of the markers, root mean square, beyond which the model is not the body that was recorded, m.
_FAR = 0.08
#: Momentum beyond which a dive is no dive, kg m²/s.
_MOST = 500.0
#: Iterations of the search for the optimum, at most.
_ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class FlightAnalysis:
    """What `analyse` found. Angles are in rad; ``print`` shows degrees.

    Attributes
    ----------
    name : str
        Of the recording.
    recording : MarkerRecording
        As it was given.
    flight : ReconstructedFlight
        The flight behind it.
    report : FlightReport
        What it was.
    advice : FlightAdvice
        What to do about its entry; its `status` says why advice is given or withheld.
    what_ifs : tuple of WhatIf
        The flight with single changes; none where the flight is no success.
    optimum : DiveSolution or None
        The optimal dive of the same kind.
    optimum_message : str
        Describes the optimum; if `optimum` is None, gives the reason.
    differences : dict of str to ndarray
        For each joint the recorded angle less that of the optimum at the times of the flight, aligned at
        its first frame, rad.
    message : str
        Whether there is an analysis, or why not.
    success : bool
        Whether the reconstruction is a success, gravity that of the model, and the body that of the
        recording.
    """

    name: str
    recording: MarkerRecording
    flight: ReconstructedFlight
    report: FlightReport
    advice: FlightAdvice | None
    what_ifs: tuple[WhatIf, ...]
    optimum: ocp.DiveSolution | None
    optimum_message: str
    differences: Mapping[str, Array] = field(repr=False)
    message: str
    success: bool

    def to_dict(self) -> dict[str, Any]:
        """The results as a dict of numbers, texts and lists, for JSON and tables.

        Examples
        --------
        >>> from somersault import motion
        >>> def number(recording, markers):
        ...     return motion.analyse(recording, markers).to_dict()["report"]["number"]
        """
        best = self.optimum
        return {
            "name": self.name,
            "success": self.success,
            "message": self.message,
            "reconstruction": {
                "status": self.flight.status,
                "message": self.flight.message,
                "chi_squared": self.flight.chi_squared,
                "scale": self.flight.scale,
                "marker_rms": rms_of(self.flight),
                "unseen": list(self.flight.unseen),
            },
            "report": self.report.to_dict(),
            "advice": None if self.advice is None else self.advice.to_dict(),
            "what_ifs": [change.to_dict() for change in self.what_ifs],
            "optimum": None
            if best is None
            else {"momentum": best.momentum, "duration": best.duration, "success": best.success},
            "optimum_message": self.optimum_message,
            "differences": {name: float(np.abs(curve).max()) for name, curve in self.differences.items()},
        }

    def __repr__(self) -> str:
        dive = (self.report.number or self.report.status) if self.success else "not analysed"
        first = self.advice.advice[0].correction if self.advice and self.advice.advice else "no advice"
        return f"<FlightAnalysis: {self.name!r:.60}, {dive}, {first}>"

    def __str__(self) -> str:
        parts = [f"{self.name}: {self.message}", ""]
        if self.success:
            # numbers of a flight that is not the recorded one say nothing
            parts.append(str(self.report))
        if self.advice is not None:
            parts.append(str(self.advice))
        parts.append(self.optimum_message)
        return "\n".join(parts)

    def html(self) -> str:
        """A page with everything, which loads nothing.

        It has advice, the recording over the reconstruction, values and checks, changes, and the optimum.

        Examples
        --------
        >>> from somersault import motion
        >>> def page(recording, markers):
        ...     return motion.analyse(recording, markers).html()
        """
        from somersault._analysis_page import page

        return page(self)

    def write(self, path: str | PathLike[str]) -> Path:
        """Writes the page to a file and returns its path.

        Raises
        ------
        InputError
            The path does not end in .html or .htm.

        Examples
        --------
        >>> from somersault import motion
        >>> def report(recording, markers):
        ...     return motion.analyse(recording, markers).write("report.html")
        """
        target = Path(path)
        if target.suffix.lower() not in (".html", ".htm"):
            raise InputError(f"`path` must end in .html, found '{target.name}'")
        target.write_text(self.html(), encoding="utf-8")
        return target


def analyse(
    recording: MarkerRecording | str | PathLike[str],
    markers: MarkerSet,
    *,
    facing: Literal["water", "board"] | None = None,
    half_somersaults: int | None = None,
    line_up: float | None = None,
    momentum_reach: float | None = None,
    optimum: bool = True,
    name: str | None = None,
    **reconstruction: Any,
) -> FlightAnalysis:
    """From a recording to advice.

    Reconstructs the flight, says what it was, flies it again with changes, compares it with the optimal dive
    of the same kind, and says what to do for a vertical entry.

    The optimum is the dive that turns the same numbers of half somersaults and half twists, in the same time,
    from the same lean, to a vertical entry: of minimum effort with the angular momentum that was flown, or of
    least momentum where that is more. Its body is the diver of the same mass and lengths of segments, in the
    plane and in the same position without twists, and with twists in space and free: arms throw, twist
    overhead, square out. Straight dives and armstands have none, since templates of optimal dives are folded
    and begin upright, and where the search finds none, `optimum_message` says why.

    There is no advice, and no optimum, where the flight is no success, gravity in the recording is not that
    of the model, or the markers are more than 80 mm (root mean square) from the body.

    Parameters
    ----------
    recording : MarkerRecording or path
        Markers, or a file of any format that `read_file` reads, of which skeletons become their joint
        centres.
    markers : MarkerSet
        The markers, and the model they are on: `diver_spatial`, `diver_planar`, `diver_ball_jointed`, or one
        whose bodies have their names.
    facing : {"water", "board"}, optional
        As of `identify_flight`.
    half_somersaults : int, optional
        As of `advise_flight`.
    line_up, momentum_reach : float, optional
        As of `advise_flight`.
    optimum : bool
        Whether to look for the optimum: a second or less for a dive without twists, some seconds with them.
    name : str, optional
        Of the recording: that of the file unless given.
    **reconstruction
        Options of `reconstruct_flight`.

    Returns
    -------
    FlightAnalysis
        ``print`` shows it as text, `write` makes a page of it.

    Raises
    ------
    InputError
        If an argument is not allowed, or the recording has no markers of the model.
    ReadError
        If the file cannot be read.

    Examples
    --------
    >>> import numpy as np
    >>> from somersault import motion, multibody
    >>> diver = multibody.diver_planar()
    >>> straight, tuck = diver.configuration("A"), diver.configuration("F")
    >>> def fold(t):
    ...     w, rate = np.sin(np.pi * t / 1.2) ** 2, np.pi / 1.2 * np.sin(2 * np.pi * t / 1.2)
    ...     return straight[3:] + w * (tuck - straight)[3:], rate * (tuck - straight)[3:]
    >>> v = np.zeros(12)
    >>> v[:3] = 1.0, 5.0, -7.5
    >>> true = multibody.fly(diver.model, straight, v, fold, (0.0, 1.2), dt=0.02)
    >>> markers = motion.MarkerSet.joint_centres(diver.model)
    >>> seen = motion.place_markers(markers, true.t, true.q)
    >>> points = seen.points + np.random.default_rng(1).normal(0.0, 0.005, seen.points.shape)
    >>> recording = motion.MarkerRecording(seen.names, seen.times, points)
    >>> found = motion.analyse(recording, markers, optimum=False)
    >>> found.success, found.advice.advice[0].correction
    (True, 'more_momentum')
    """
    if not isinstance(markers, MarkerSet):
        raise InputError(f"`markers` must be a MarkerSet, found a {type(markers).__name__}")
    called = name
    if not isinstance(recording, MarkerRecording):
        if not isinstance(recording, str | PathLike):
            raise InputError(
                f"`recording` must be a MarkerRecording or a path, found a {type(recording).__name__}"
            )
        called = called or Path(recording).stem
        recording = markers_of(read_file(recording), str(recording))
    flight = reconstruct_flight(markers, recording, **reconstruction)
    report = identify_flight(flight, facing=facing)
    reason = _refused(flight, report)
    # this checks the arguments of advice also where the flight is refused
    advice: FlightAdvice | None = advise_flight(
        flight,
        half_somersaults=half_somersaults,
        facing=facing,
        line_up=line_up,
        momentum_reach=momentum_reach,
    )
    what_ifs: tuple[WhatIf, ...] = ()
    best, said, differences = None, "There is no optimum to compare with: the flight was not analysed.", {}
    if reason is None:
        what_ifs = tuple(_flown(flight))
        if optimum:
            best, said = _optimum(flight, report, half_somersaults or report.half_somersaults)
            said = said[:1].upper() + said[1:]
            differences = _differences(flight, best) if best is not None else {}
        else:
            said = "No optimum was looked for."
    elif advice is not None and advice.status in ("given", "vertical", "nothing_sure", "no_target"):
        advice = None
    return FlightAnalysis(
        name=called or "recording",
        recording=recording,
        flight=flight,
        report=report,
        advice=advice,
        what_ifs=what_ifs,
        optimum=best,
        optimum_message=said,
        differences=differences,
        message=report.message if reason is None else reason,
        success=reason is None,
    )


def markers_of(found: Any, name: str, keypoints: dict[str, Any] | None = None) -> MarkerRecording:
    """The markers of whatever a file has: of a skeleton its joint centres, of key points those at a scale."""
    if hasattr(found, "joint_centres"):
        found = found.joint_centres()
    if isinstance(found, KeypointRecording):
        if keypoints is None:
            raise InputError(
                f"{name}: key points have no unit: `recording.markers(scale=...)` makes markers of them, in"
                " the diver of `somersault analyse` the table `[keypoints]` with their `scale`"
            )
        found = found.markers(**keypoints)
    if not isinstance(found, MarkerRecording):
        raise InputError(f"{name}: a recording of markers or of a skeleton is needed, found {found!r}")
    return found


def rms_of(flight: ReconstructedFlight) -> float:
    """Root mean square of the distances of all markers, m."""
    return float(np.sqrt(np.nanmean(np.square(flight.residuals))))


def _refused(flight: ReconstructedFlight, report: FlightReport) -> str | None:
    """Why there is no analysis."""
    if report.status in ("other_gravity", "not_reconstructed"):
        return report.message if report.status == "other_gravity" else flight.message
    if not flight.success:
        return flight.message
    if (far := rms_of(flight)) > _FAR:
        return (
            f"the markers are {1e3 * far:.0f} mm from the body, root mean square: it moves as the"
            " model cannot, or markers"
            " are at other places"
        )
    return None


def _flown(flight: ReconstructedFlight) -> list[WhatIf]:
    """The flight with each of the changes that it takes."""
    found = []
    for change in _CHANGES:
        try:
            found.append(what_if(flight, **change))
        except InputError:
            # the flight is not folded, or not for long enough
            continue
    return found


def _optimum(
    flight: ReconstructedFlight, report: FlightReport, half_somersaults: int
) -> tuple[ocp.DiveSolution | None, str]:
    """The optimal dive of the same kind and what it is; or None and the reason."""
    if report.group == "armstand":
        return None, "there is no optimum to compare with: templates have no armstand dive."
    if half_somersaults == 0:
        return None, "there is no optimum to compare with: the flight has no somersault."
    sense = float(np.sign(half_somersaults))
    flown = float(np.linalg.norm(flight.angular_momentum))
    least, most = sorted((0.0, sense * _MOST))
    options: dict[str, Any] = {
        "somersaults": half_somersaults / 2,
        "duration": float(flight.times[-1] - flight.times[0]),
        "lean": float(flight.inclination[0]),
        "momentum": (least, most),
    }
    position = max(report.positions, key=lambda name: report.positions[name])
    posture = _POSTURES.get(position, "")
    if report.group != "twisting" and not posture:
        return None, f"there is no optimum to compare with: templates are folded, and the dive is {position}."
    try:
        if report.group == "twisting":
            diver = _of_same_size(flight, multibody.diver_spatial)
            posed = ocp.dive_5174d(diver=diver, twists=report.half_twists / 2, **options)
        else:
            diver = _of_same_size(flight, multibody.diver_planar)
            posed = ocp.dive_107b(diver=diver, postures=("A", posture), **options)
        lean = posed.solve(max_iterations=_ITERATIONS)
        if not lean.success:
            return None, f"there is no optimum to compare with: {lean.message}."
        needed = abs(lean.momentum)
        if flown < needed:
            return lean, (
                f"The optimum of least momentum takes {needed:.1f} kg m²/s in this time,"
                f" {100 * (needed / flown - 1):.0f} % more"
                f" than the {flown:.1f} that were flown."
            )
        same = posed.replace(momentum=sense * flown).solve(max_iterations=_ITERATIONS)
    except SomersaultError as fault:
        return None, f"there is no optimum to compare with: {fault}."
    if not same.success:
        return lean, f"The optimum of least momentum takes {needed:.1f} kg m²/s; {flown:.1f} were flown."
    return same, (
        f"The optimum has the {flown:.1f} kg m²/s that were flown and moves the joints least;"
        f" {needed:.1f} would be enough."
    )


#: Segments whose lengths the diver of an optimum takes over, with the bodies at whose joints they end.
_ENDS = {"thigh": "shank", "shank": "foot", "upper_arm": "forearm", "forearm": "hand", "torso": "head"}


def _of_same_size(flight: ReconstructedFlight, make: Callable[..., multibody.Diver]) -> multibody.Diver:
    """A diver of the same mass and lengths of segments."""

    def lengths(of: multibody.Model) -> dict[str, float]:
        ends = {link.name.removeprefix("right_"): link.origin for link in of.links}
        if "abdomen" in ends:
            # the trunk is as long as thorax and abdomen together
            ends["head"] = ends["head"] - ends["abdomen"] - ends["pelvis"]
        return {segment: float(np.linalg.norm(ends[end])) for segment, end in _ENDS.items()}

    model, reference = flight.model, make()
    usual = lengths(reference.model)
    sizes = {segment: length / usual[segment] for segment, length in lengths(model).items()}
    thigh = sizes["thigh"]
    diver = make(mass=model.mass, height=reference.height * flight.scale * thigh)
    other = {segment: size / thigh for segment, size in sizes.items() if abs(size / thigh - 1.0) > 1e-9}
    return diver.scaled(other) if other else diver


def joint_angles(model: multibody.Model, q: Array) -> dict[str, Array]:
    """Angles of the joints that are compared, sides as one, rad: of hinges, and of the ball-jointed diver."""
    names = set(model.names)
    balls = multibody.diver_ball_jointed(thorax="abdomen" in names)
    angles = balls.angles(q) if model.names == balls.model.names else {}
    found = {}
    if angles:
        found["trunk"] = np.sum([angles[name] for name in _TRUNK if name in angles], axis=0)
    for joint, sides in _JOINTS.items():
        bodies = next((bodies for bodies in sides if names.issuperset(bodies)), ())
        columns = [q[:, model.positions_of(body)] for body in bodies]
        if columns and all(column.shape[1] == 1 for column in columns):
            found[joint] = np.mean([column.ravel() for column in columns], axis=0)
        elif angles and joint in _BALLS:
            found[joint] = np.mean([angles[name] for name in _BALLS[joint]], axis=0)
    return found


def _differences(flight: ReconstructedFlight, best: ocp.DiveSolution) -> dict[str, Array]:
    """Recorded less optimal angles at the times of the flight."""
    times = flight.times - flight.times[0]
    optimal = joint_angles(best.dive.diver.model, np.asarray(best.q))
    recorded = joint_angles(flight.model, np.asarray(flight.q))
    return {
        joint: recorded[joint] - np.interp(times, best.t, curve)
        for joint, curve in optimal.items()
        if joint in recorded
    }
