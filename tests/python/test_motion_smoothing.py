"""Smooth motions behind recordings, from Python."""

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest

from somersault import motion, multibody, plotting

DIVER = multibody.diver_planar()
MARKERS = motion.MarkerSet.joint_centres(DIVER.model)
OPEN, PIKE = DIVER.configuration("A"), DIVER.configuration("H")
TIMES = np.linspace(0.0, 1.2, 61)


def bent(t: Any) -> Any:
    """A diver on the ground who bends and stands up again."""
    fold = np.sin(2.5 * t)[..., None] ** 2
    return OPEN + fold * 0.9 * (PIKE - OPEN)


@cache
def seen(seed: int = 4) -> motion.MarkerRecording:
    """Its joint centres with noise of 10 mm, of which one is missing now and then."""
    centres = motion.place_markers(MARKERS, TIMES, bent(TIMES))
    rng = np.random.default_rng(seed)
    points = centres.points + rng.normal(0.0, 0.01, centres.points.shape)
    return motion.MarkerRecording(centres.names, centres.times, points, rng.random(points.shape[:2]) > 0.05)


@cache
def smoothed(seed: int = 4) -> motion.SmoothedMotion:
    return motion.smooth_motion(MARKERS, seen(seed))


def test_intervals_hold_the_truth() -> None:
    """Those of 95 % do in 95 % (q), 97 % (v) and 99 % (a) of the cases in twelve draws."""
    h = 1e-5
    v = (bent(TIMES + h) - bent(TIMES - h)) / (2 * h)
    a = (bent(TIMES + h) - 2 * bent(TIMES) + bent(TIMES - h)) / h**2
    hinges = np.isfinite(smoothed().q_deviations[0])
    hinges[:3] = False
    assert hinges.sum() == 6
    for name, exact in (("q", bent(TIMES)), ("v", v), ("a", a)):
        within = []
        for seed in range(4):
            found = smoothed(seed)
            deviations = getattr(found, f"{name}_deviations")[:, hinges]
            off = np.abs(getattr(found, name) - exact)[:, hinges] / deviations
            assert found.success and (off < 5.0).all(), name
            within.append(np.mean(off < 1.96))
        assert np.mean(within) > 0.88, (name, within)


def test_the_motion_is_that_which_was_seen() -> None:
    found = smoothed()
    assert found.success and found.status == "converged" and len(found) == len(TIMES)
    assert found.unseen == ("toes", "head", "hand") and "no marker sees toes, head, hand" in found.message
    assert np.allclose(found.times, TIMES) and abs(found.noise[0] - 0.01) < 0.002
    assert abs(found.scale - 1.0) < 4 * found.scale_deviation
    hinges = np.isfinite(found.q_deviations[0])
    hinges[:3] = False
    usual = motion.MarkerFit(MARKERS, scale=1.0).fit(seen())
    error, of_fits = (np.sqrt(np.mean((q - bent(TIMES))[:, hinges] ** 2)) for q in (found.q, usual.q))
    assert 2 * error < of_fits
    lower, upper = found.chi_squared_range
    assert found.chi_squared is not None and lower < found.chi_squared < upper
    assert found.worst is not None and found.worst < found.worst_limit
    assert found.disturbance < found.disturbance_limit and found.n_outliers == 0
    assert found.residuals.shape == (61, len(MARKERS.names)) and set(found.marker_rms) == set(MARKERS.names)


def test_inverse_dynamics_takes_what_is_found() -> None:
    """Joint torques of the smoothed motion are those of the true one, within a tenth of their size."""
    found, i = smoothed(), 30
    h = 1e-4
    at = TIMES[i : i + 1]
    v = (bent(at + h) - bent(at - h))[0] / (2 * h)
    a = (bent(at + h) - 2 * bent(at) + bent(at - h))[0] / h**2
    exact = DIVER.model.inverse_dynamics(bent(at)[0], v, a)
    estimate = DIVER.model.inverse_dynamics(found.q[i], found.v[i], found.a[i])
    assert np.abs(estimate - exact)[3:5].max() < 0.1 * np.abs(exact).max()


def test_a_blow_is_no_success() -> None:
    """A body that falls at 3 m/s and stops within a frame."""
    q = np.tile(OPEN, (61, 1))
    q[:, 1] = 2.0 - 3.0 * np.minimum(TIMES, 0.6)
    centres = motion.place_markers(MARKERS, TIMES, q)
    points = centres.points + np.random.default_rng(2).normal(0.0, 0.005, centres.points.shape)
    found = motion.smooth_motion(MARKERS, motion.MarkerRecording(centres.names, TIMES, points))
    assert not found.success and found.status == "misfit"
    assert abs(found.disturbance_time - 0.6) < 0.05 and "velocities jump" in found.message


def test_pictures_and_pickles() -> None:
    found = smoothed()
    again = pickle.loads(pickle.dumps(found))
    assert repr(again) == repr(found) and again.message == found.message
    for name in ("q", "v", "a", "q_deviations", "v_deviations", "a_deviations", "residuals"):
        assert np.array_equal(getattr(again, name), getattr(found, name), equal_nan=True)
    plotting.tree_motion(found)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scale": -1.0}, "`scale` must be from 0.01 to 100, found -1"),
        ({"scale": "1"}, "`scale` must be a number, or a mean and a standard deviation, found a str"),
        ({"noise": (0.01, 2.0, 0.1)}, "`correlated fraction of the noise` must be from 0 to 1, found 2"),
        ({"threshold": 0.1}, "`threshold` must be from 1 to 1000, found 0.1"),
        ({"freedom": 0.0}, "`freedom` must be from 1 to 1000, found 0"),
        ({"max_iterations": 0}, "`max_iterations` must be"),
    ],
)
def test_what_is_not_allowed_is_said_by_name(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        motion.smooth_motion(MARKERS, seen(), **arguments)


def test_too_few_and_too_many_frames_are_refused() -> None:
    few = motion.MarkerRecording(seen().names, TIMES[:9], np.zeros((9, len(seen().names), 3)))
    with pytest.raises(ValueError, match="a motion needs at least 10 frames that have markers, found 9"):
        motion.smooth_motion(MARKERS, few)
    many = motion.MarkerRecording(
        seen().names, 0.01 * np.arange(60_000), np.zeros((60_000, len(seen().names), 3))
    )
    with pytest.raises(ValueError, match="found 60000: smooth it in parts"):
        motion.smooth_motion(MARKERS, many)
