"""What a reconstructed flight was, from Python."""

import json
import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest

from somersault import motion, multibody

DIVER = multibody.diver_planar()
MARKERS = motion.MarkerSet.joint_centres(DIVER.model)
STRAIGHT, PIKE = DIVER.configuration("A"), DIVER.configuration("H")


@cache
def flight(spin: float = -7.5) -> motion.ReconstructedFlight:
    """Two and a half somersaults in a pike, markers with noise of 20 mm."""

    def fold(t: float) -> tuple[Any, Any]:
        w, rate = np.sin(np.pi * t / 1.2) ** 2, np.pi / 1.2 * np.sin(2 * np.pi * t / 1.2)
        return STRAIGHT[3:] + w * (PIKE - STRAIGHT)[3:], rate * (PIKE - STRAIGHT)[3:]

    v = np.zeros(12)
    v[:3] = 1.0, 5.0, spin
    true = multibody.fly(DIVER.model, STRAIGHT, v, fold, (0.0, 1.2), dt=0.02)
    seen = motion.place_markers(MARKERS, true.t, true.q)
    points = seen.points + np.random.default_rng(1).normal(0.0, 0.02, seen.points.shape)
    return motion.reconstruct_flight(MARKERS, motion.MarkerRecording(seen.names, seen.times, points))


@cache
def report() -> motion.FlightReport:
    return motion.identify_flight(flight(), facing="water")


def test_a_dive_is_identified() -> None:
    found = report()
    assert found.success and found.status == "identified" and found.number == "105B"
    assert found.group == "somersaults" and found.directions == {"forward": 1.0}
    assert found.positions["pike"] > 0.95 and found.half_somersaults == 5 and found.half_twists == 0
    assert next(iter(found.alternatives)) == "105B" and found.alternatives["105B"] > 0.9
    for name in (
        "somersaults", "height", "speed", "take_off_angle", "angular_momentum", "least_inertia",
        "greatest_inertia", "hip", "knee", "entry_angle", "gravity", "twists", "duration",
    ):  # fmt: skip
        lower, upper = getattr(found, f"{name}_interval")
        assert lower <= getattr(found, name) <= upper, name
    assert (
        abs(found.gravity - 9.81) < 0.2
        and abs(found.speed - np.hypot(*found.flight.take_off_velocity[::2])) < 1e-9
    )


def test_where_the_board_is_decides_the_group() -> None:
    assert motion.identify_flight(flight(), facing="board").number == "405B"
    # who travels forwards faces the water
    assert motion.identify_flight(flight()).number == "105B"


def test_the_page_is_one_that_a_coach_reads() -> None:
    page = str(report())
    assert page.startswith("Dive ") and "105B (" in page and "± " in page and "kg m²/s" in page
    assert repr(report()).startswith("<FlightReport: identified, 105B (")


def test_pickles_and_dicts_hold_all_of_it() -> None:
    again = pickle.loads(pickle.dumps(report()))
    assert again.to_dict() == report().to_dict() and str(again) == str(report()) and again.facing == "water"
    assert json.loads(json.dumps(report().to_dict()))["number"] == "105B"


def test_without_a_success_there_is_no_number() -> None:
    times = flight().times[: len(flight()) // 3]
    still = motion.place_markers(MARKERS, times, np.tile(STRAIGHT, (len(times), 1)))
    points = still.points + np.random.default_rng(1).normal(0.0, 0.01, still.points.shape)
    seen = motion.MarkerRecording(still.names, still.times, points)
    found = motion.identify_flight(motion.reconstruct_flight(MARKERS, seen, max_iterations=5))
    assert not found.success and found.number is None and found.alternatives == {}
    assert found.status in {"not_reconstructed", "other_gravity"} and str(found).startswith("No dive number")


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ValueError, match="`facing` must be 'water' or 'board', found 'sky'"):
        motion.identify_flight(flight(), facing="sky")  # type: ignore[arg-type]
