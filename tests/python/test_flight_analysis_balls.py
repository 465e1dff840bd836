"""From a recording of a diver with spread legs to advice: joints are balls, which hinges cannot follow."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from dive_faults import DURATION, FAULTS, OPENED_IN, OPENS, smooth

from somersault import motion, multibody
from somersault.errors import InputError

DIVER = multibody.diver_ball_jointed(mass=62.0, height=1.66)
MODEL = DIVER.model
MARKERS = motion.MarkerSet.on_diver(DIVER, "plug_in_gait")
HINGED = motion.MarkerSet.on_diver(multibody.diver_spatial(mass=62.0, height=1.66), "plug_in_gait")


def spread(posture: str, looser: float = 0.0) -> Any:
    """A posture with thighs apart and turned outwards, and hips, of a tuck also knees, less closed."""
    q = np.array(DIVER.configuration(posture))
    v = np.zeros(MODEL.n_velocities)
    names = DIVER.dof_names
    for side, sign in (("right", -1.0), ("left", 1.0)):
        v[names.index(f"{side}_thigh_y")] = looser
        v[names.index(f"{side}_thigh_x")] = sign * np.radians(15.0)
        v[names.index(f"{side}_thigh_z")] = sign * np.radians(10.0)
    q = np.array(MODEL.displace(q, v))
    if posture == "F":
        for side in ("right", "left"):
            q[MODEL.positions_of(f"{side}_shank")] -= looser
    return q


def flown(closed: Any, opens: float, spin: float) -> multibody.TreeSolution:
    """Folded between 0.1 and 0.4 s, and opened: joints turn about axes that stay in their bodies."""
    start = np.array(DIVER.configuration("A"))
    start[:3] = 0.0, 0.0, 3.0
    closed = np.concatenate([start[:7], closed[7:]])
    to = np.asarray(MODEL.difference(start, closed))

    def shape(t: float) -> tuple[Any, Any]:
        (a, rise), (b, fall) = smooth((t - 0.1) / 0.3), smooth((t - opens) / OPENED_IN)
        w, rate = a * (1 - b), rise / 0.3 * (1 - b) - a * fall / OPENED_IN
        return np.asarray(MODEL.displace(start, w * to))[7:], rate * to[6:]

    v = np.zeros(MODEL.n_velocities)
    v[:3], v[4] = (1.0, 0.0, 4.8), spin
    return multibody.fly(MODEL, start, v, shape, (0.0, DURATION), dt=0.02)


def line_angle(run: multibody.TreeSolution) -> float:
    """Of the line from the ankles to the wrists, forwards, whole turns counted, rad."""
    centres = motion.place_markers(motion.MarkerSet.joint_centres(MODEL), run.t, run.q)

    def angle(segment: Any) -> Any:
        return np.unwrap(np.arctan2(segment[:, 0], segment[:, 2]))

    def middle(name: str) -> Any:
        return centres.track(f"right_{name}") + centres.track(f"left_{name}")

    trunk = angle(centres.track("head") - centres.track("pelvis"))
    own = angle(middle("hand") - middle("foot"))[-1]
    return float(trunk[-1] + (own - trunk[-1] + np.pi) % (2 * np.pi) - np.pi)


@cache
def spin(posture: str, half_somersaults: int) -> float:
    """The angular velocity at take-off with which the dive is vertical without a fault."""
    # both sides move alike, so that the rotation is linear in the momentum
    slow, fast = (line_angle(flown(spread(posture), OPENS, rate)) for rate in (4.0, 8.0))
    return 4.0 + 4.0 * (np.pi * half_somersaults - slow) / (fast - slow)


@cache
def dive(posture: str, half_somersaults: int, fault: str) -> Any:
    """The recording of a dive with a fault, what was flown, and how far beyond the vertical it enters."""
    closed, opens, rate = spread(posture), OPENS, spin(posture, half_somersaults)
    size = FAULTS[fault][0]
    if fault == "opened early":
        opens -= size
    elif fault == "opened late":
        opens += size
    elif fault == "loose":
        closed = spread(posture, np.radians(size))
    elif fault == "too little momentum":
        rate *= 1 - size
    run = flown(closed, opens, rate)
    seen = motion.place_markers(MARKERS, run.t[::2], run.q[::2])
    points = seen.points + np.random.default_rng(3).normal(0.0, 0.01, seen.points.shape)
    recording = motion.MarkerRecording(seen.names, seen.times, points)
    return recording, (closed, opens, rate), line_angle(run) - np.pi * half_somersaults


@cache
def flight(fault: str) -> motion.ReconstructedFlight:
    return motion.reconstruct_flight(MARKERS, dive("H", 3, fault)[0], interval=(0.0, DURATION))


@pytest.mark.parametrize(("posture", "half_somersaults", "fault"), [
    ("H", 3, "opened early"), ("H", 3, "opened late"), ("F", 3, "loose"), ("F", 5, "too little momentum"),
])  # fmt: skip
def test_the_first_advice_names_the_fault(posture: str, half_somersaults: int, fault: str) -> None:
    recording, _, true = dive(posture, half_somersaults, fault)
    found = motion.analyse(
        recording, MARKERS, half_somersaults=half_somersaults, optimum=False, interval=(0.0, DURATION)
    )
    assert found.success and found.advice is not None, found.message
    advice = found.advice
    lower, upper = advice.entry_angle_interval
    assert abs(true - advice.entry_angle) < 1.5 * (upper - lower)
    first = advice.advice[0]
    assert first.correction == FAULTS[fault][1], str(advice)
    low, high = first.amount_interval
    assert 0.0 < low < first.amount < high
    if posture == "H":
        assert found.report.number == "103B"


@pytest.mark.parametrize(
    "change", [{"opening": 0.03}, {"opening": -0.03}, {"momentum": 0.05}, {"posture": 0.1}]
)
def test_what_ifs_are_what_the_diver_would_have_flown(change: dict[str, float]) -> None:
    """The dive that made the recording, flown with the change, turns as much further as the what-if says."""
    found = motion.what_if(flight("opened late"), **change)
    _, (closed, opens, rate), _ = dive("H", 3, "opened late")
    if "posture" in change:
        closed = spread("H", -change["posture"])
    again = flown(closed, opens + change.get("opening", 0.0), rate * (1 + change.get("momentum", 0.0)))
    more = line_angle(again) - line_angle(flown(spread("H"), opens, rate))
    # the phase that the reconstruction has is not that of the true joints to the frame
    assert abs(found.entry_angle_change - more) < 0.12 * abs(more), (found.entry_angle_change, more)
    assert abs(found.linear_entry_angle_change - found.entry_angle_change) < 0.15 * abs(more)


def test_a_posture_closes_hips_about_the_axes_that_close_them() -> None:
    known = flight("opened late")
    least = {}
    for posture in (0.0, 0.1):
        found = motion.what_if(known, posture=posture)
        angles = DIVER.angles(found.q)
        least[posture] = max(np.degrees(np.mean([angles["right_hip"], angles["left_hip"]], axis=0)))
    assert abs(least[0.1] - least[0.0] - np.degrees(0.1)) < 0.5


def test_single_balls_turn_about_axes_of_their_bodies() -> None:
    known = flight("opened late")
    one = motion.what_if(known, posture=0.2, joints={"right_upper_arm_y": 1.0})
    before, after = (motion.what_if(known).q, one.q)
    place, dofs = MODEL.positions_of("right_upper_arm"), MODEL.velocities_of("right_upper_arm")
    moved = np.array([MODEL.difference(a, b)[dofs] for a, b in zip(before, after, strict=True)])
    assert abs(moved[:, 1].max() - 0.2) < 1e-9 and np.abs(moved[:, [0, 2]]).max() < 1e-9
    others = [k for k in range(7, MODEL.n_positions) if k not in range(*place.indices(MODEL.n_positions))]
    assert np.abs(before[:, others] - after[:, others]).max() < 1e-12
    with pytest.raises(InputError, match="_x, _y or _z, found 'right_upper_arm'"):
        motion.what_if(known, posture=0.2, joints={"right_upper_arm": 1.0})


def test_curves_and_the_optimum_have_the_angles_of_balls() -> None:
    recording, _, _ = dive("H", 3, "opened late")
    found = motion.analyse(recording, MARKERS, half_somersaults=3, interval=(0.0, DURATION))
    assert found.optimum is not None and found.optimum.success, found.optimum_message
    assert set(found.differences) == {"trunk", "hip", "knee", "elbow"}
    # the diver folds later than the optimum, which needs no time for it
    assert 0.2 < np.abs(found.differences["hip"]).max() < 2.0
    assert "Flexion of the hip" in found.html()


def test_hinges_cannot_follow_spread_legs() -> None:
    """The same recording with hinges is farther from the body."""
    recording, _, _ = dive("H", 3, "opened late")
    hinged = motion.reconstruct_flight(HINGED, recording, interval=(0.0, DURATION))
    rms = [float(np.sqrt(np.nanmean(np.square(of.residuals)))) for of in (hinged, flight("opened late"))]
    assert rms[0] > 1.5 * rms[1], rms
