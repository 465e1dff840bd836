"""Take-off and entry of records, from Python."""

import json
import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest

from somersault import motion, multibody

T = np.arange(0.0, 2.4, 0.01)


@cache
def heights(noise: float = 0.01) -> Any:
    """Rest, a push from 0.5 to 0.8 s, a flight of 1 s, water."""
    force = np.interp(T, [0.5, 0.55, 0.74, 0.8, 1.8, 1.9], [1.0, 2.7, 2.7, 0.0, 0.0, 4.0])
    speed = np.cumsum(9.81 * (force - 1.0)) * 0.01
    return np.cumsum(speed) * 0.01 + np.random.default_rng(1).normal(0.0, noise, len(T))


@cache
def flight() -> motion.FlightPhase:
    return motion.find_flight(heights(), times=T)


def test_a_flight_is_found_with_its_intervals() -> None:
    found = flight()
    assert found.success and found.status == "found" and found.doubts == ()
    for value, (lower, upper), truth in [
        (found.take_off, found.take_off_interval, 0.8),
        (found.entry, found.entry_interval, 1.8),
        (found.duration, found.duration_interval, 1.0),
    ]:
        assert abs(value - truth) < 0.03 and lower < truth < upper < lower + 0.25
    assert found.interval == (found.take_off, found.entry)
    assert found.gravity_interval[0] < 9.81 < found.gravity_interval[1]
    assert abs(found.noise[0] - 0.01) < 0.004 and "a flight from 0." in found.message


def test_frames_without_heights_and_records_without_ends_are_doubtful() -> None:
    inside = (T > 0.9) & (T < 1.7)
    found = motion.find_flight(heights()[inside], times=T[inside])
    assert found.status == "uncertain" and found.interval == (-np.inf, np.inf)
    assert found.doubts == ("the record may begin in flight", "the record may end in flight")
    gap = np.where(abs(T - 0.8) < 0.06, np.nan, heights())
    assert any("no heights are known" in doubt for doubt in motion.find_flight(gap, times=T).doubts)
    rest = motion.find_flight(heights()[:45], times=T[:45])
    assert rest.status == "not_found" and rest.interval is None and np.isnan(rest.take_off)


def test_a_wrong_rate_is_named() -> None:
    found = motion.find_flight(heights(), times=T / 1.2)
    assert found.status == "other_gravity" and not found.success
    assert abs(found.gravity / 9.81 - 1.44) < 0.04
    assert "the declared rate of the frames is 1." in found.message
    centimetres = motion.find_flight(100.0 * heights(), times=T)
    assert "lengths are in cm and were read as m" in centimetres.message


def test_markers_show_it_with_a_model_and_without() -> None:
    diver = multibody.diver_planar()
    markers = motion.MarkerSet.joint_centres(diver.model)
    q = np.tile(diver.configuration("A"), (len(T), 1))
    q[:, 1] = heights(noise=0.002)
    placed = motion.place_markers(markers, T, q)
    for found in (motion.find_flight(placed), motion.find_flight(placed, markers=markers)):
        assert found.success and abs(found.take_off - 0.8) < 0.03 and abs(found.entry - 1.8) < 0.03
    # the reconstruction takes the flight alone
    fitted = motion.reconstruct_flight(markers, placed, max_iterations=2)
    assert fitted.phase is not None and abs(fitted.phase.take_off - 0.8) < 0.03
    assert abs(fitted.times[0] - 0.8) < 0.04 and abs(fitted.times[-1] - 1.8) < 0.04
    assert motion.reconstruct_flight(markers, placed, max_iterations=2, interval=(0.9, 1.2)).phase is None


def test_pickles_and_dicts_hold_all_of_it() -> None:
    for found in (flight(), motion.find_flight(heights()[80:170], times=T[80:170])):
        again = pickle.loads(pickle.dumps(found))
        assert repr(again) == repr(found) and again.to_dict() == found.to_dict()
        assert again.interval == found.interval
        assert json.loads(json.dumps(found.to_dict()))["status"] == found.status


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"recording": heights(), "times": None}, "`times` must be given with heights"),
        ({"times": T[1:]}, "`recording` must be real numbers of shape"),
        ({"times": -T}, "`times` must grow"),
        ({"gravity": 0.0}, "`gravity` must be positive"),
        ({"recording": heights()[:9], "times": T[:9]}, "at least 10 frames that have heights, found 9"),
        ({"recording": np.zeros(30_000), "times": np.arange(30_000.0)}, "in at most 20000 frames"),
        ({"recording": np.full(len(T), np.inf)}, "`heights`"),
        ({"recording": "high"}, "`recording` must be"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        motion.find_flight(**{"recording": heights(), "times": T, **arguments})


def test_arguments_that_exclude_one_another_are_named() -> None:
    diver = multibody.diver_planar()
    markers = motion.MarkerSet.joint_centres(diver.model)
    placed = motion.place_markers(markers, T, np.tile(diver.configuration("A"), (len(T), 1)))
    with pytest.raises(ValueError, match="`times` are those of the recording"):
        motion.find_flight(placed, times=T)
    with pytest.raises(ValueError, match="`gravity` is that of the model"):
        motion.find_flight(placed, markers=markers, gravity=9.81)
    with pytest.raises(ValueError, match="`recording` must be a MarkerRecording"):
        motion.find_flight(heights(), markers=markers, times=T)
