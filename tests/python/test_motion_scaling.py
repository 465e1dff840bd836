"""Models scaled to persons, from Python."""

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from somersault import motion, multibody, ocp, plotting

DIVER = multibody.diver_planar()
MARKERS = motion.MarkerSet.on_diver(DIVER, "halpe_26")
TIMES = np.linspace(0.0, 1.2, 61)
#: Sizes of a person over those of the diver.
PERSON = {"thigh": 1.06, "shank": 0.95, "torso": 0.97, "forearm": 1.08}


@cache
def seen(shift: float = 0.0) -> motion.MarkerRecording:
    """The person folds and opens, seen with noise of 4 mm; a marker at the nose is higher up by `shift`."""
    person = DIVER.scaled(PERSON)
    markers = motion.MarkerSet.on_diver(person, "halpe_26").moved({"nose": (0.0, shift, 0.0)})
    straight, pike = DIVER.configuration("A"), DIVER.configuration("H")
    waves = 0.3 * (1.0 - np.cos(np.outer(TIMES, np.linspace(4.0, 9.0, DIVER.model.n_positions))))
    q = straight + np.sin(2.5 * TIMES[:, None]) ** 2 * 0.8 * (pike - straight) + waves
    limits = [link.limits or (0.0, 0.0) for link in DIVER.model.links[1:]]
    q[:, 3:] = np.clip(q[:, 3:], *np.transpose(limits))
    placed = motion.place_markers(markers, TIMES, q)
    points = placed.points + np.random.default_rng(3).normal(0.0, 0.004, placed.points.shape)
    return motion.MarkerRecording(placed.names, TIMES, points)


@cache
def scaled(shift: float = 0.0) -> motion.ScaledModel:
    return motion.scale_model(MARKERS, seen(shift))


def test_the_person_is_found() -> None:
    found = scaled()
    assert found.success and found.status == "converged" and len(found) == 50, found.message
    for name, size in PERSON.items():
        assert abs(found.scales[name] - size) < 4 * found.scale_deviations[name] < 0.12, name
    assert abs(found.noise - 0.004) < 0.0005 and found.repeats < 1.5
    assert found.rms < 0.6 * found.rms_before
    lengths = {link.name: np.linalg.norm(link.origin) for link in found.model.links}
    usual = {link.name: np.linalg.norm(link.origin) for link in DIVER.model.links}
    assert abs(lengths["shank"] / usual["shank"] - found.scales["thigh"]) < 1e-9
    assert found.model.mass == DIVER.model.mass
    assert set(found.offsets) == set(found.offset_deviations) == set(found.marker_rms) == set(MARKERS.names)
    # a model of this size, with these markers, is used like any other
    fit = motion.MarkerFit(found.markers, scale=1.0).fit(seen())
    usual_fit = motion.MarkerFit(MARKERS, common_scale=True).fit(seen())
    assert fit.rms < usual_fit.rms


def test_a_marker_elsewhere_is_found() -> None:
    before, after = (scaled(shift).offsets["nose"][1] for shift in (0.0, 0.03))
    assert abs(after - before - 0.03) < 0.01
    assert scaled(0.03).offset_deviations["nose"][1] < 0.01
    far = scaled(0.3)
    assert far.status == "misfit" and "marker `nose` is seen" in far.message and far.contradictions


def test_a_diver_of_these_proportions_is_made() -> None:
    found = scaled()
    diver = DIVER.scaled(found.body_scales)
    for link, other in zip(diver.model.links, found.model.links, strict=True):
        assert np.allclose(link.origin, other.origin) and np.allclose(link.inertia, other.inertia)
    again = pickle.loads(pickle.dumps(diver))
    assert again.segment_scales == diver.segment_scales and diver.segment_scales["thigh"][0] > 1.0
    # twice as large, and back
    half = diver.scaled({"thigh": 2.0}).scaled({"thigh": 0.5})
    assert np.allclose(half.segment_scales["thigh"], diver.segment_scales["thigh"])
    wide = multibody.diver_spatial().scaled({"right_thigh": (1.0, 1.2, 1.1), "left_thigh": (1.0, 1.2, 1.1)})
    assert wide.segment_scales["thigh"] == (1.0, 1.2, 1.1)


def test_a_diver_with_balls_follows_legs_that_spread() -> None:
    diver = multibody.diver_ball_jointed(mass=60.0)
    markers = motion.MarkerSet.on_diver(diver, "plug_in_gait")
    t = np.linspace(0.0, 1.0, 41)
    q = np.tile(diver.configuration("B"), (len(t), 1))
    for side, sign in (("right", -1), ("left", 1)):
        turn = Rotation.from_rotvec(np.outer(0.5 * np.sin(3 * t) ** 2, (sign, 0.3, 0.0)))
        q[:, diver.model.positions_of(f"{side}_thigh")] = turn.as_quat()
    placed = motion.place_markers(markers, t, q)
    noise = np.random.default_rng(5).normal(0.0, 0.003, placed.points.shape)
    seen = motion.MarkerRecording(placed.names, t, placed.points + noise)
    found = motion.scale_model(markers, seen)
    assert found.success and found.rms < 0.006, found.message
    off = [abs(found.scales[name] - 1.0) / found.scale_deviations[name] for name in found.scales]
    assert max(off) < 3.0
    fit = motion.MarkerFit(found.markers, scale=1.0).fit(seen)
    abduction = diver.angles(fit.q)["left_hip_abduction"]
    assert np.abs(abduction - diver.angles(q)["left_hip_abduction"]).max() < 0.15
    again = pickle.loads(pickle.dumps(diver))
    assert repr(again) == repr(diver) == "<Diver: ball-jointed, 60 kg, 1.7 m>"
    assert again.dof_names == diver.dof_names and len(diver.dof_names) == diver.model.n_velocities
    with pytest.raises(ValueError, match=r"`diver` must have hinges, .* found ball joints"):
        ocp.dive_107b(diver=diver)
    wide = diver.scaled({"pelvis": (1.0, 1.1, 1.0)})
    assert repr(wide) == repr(diver) and wide.segment_scales["pelvis"] == (1.0, 1.1, 1.0)


def test_groups_are_given() -> None:
    found = motion.scale_model(MARKERS, seen(), groups={"legs": ["thigh", "shank"], "tall": {"torso": "y"}})
    assert set(found.scales) == {"legs", "tall"}
    sizes = found.body_scales
    assert np.allclose(sizes["thigh"], sizes["shank"]) and np.allclose(sizes["forearm"], found.size)
    assert np.allclose(sizes["torso"], (found.size, found.scales["tall"], found.size))


def test_pictures_and_pickles() -> None:
    found = scaled()
    again = pickle.loads(pickle.dumps(found))
    assert repr(again) == repr(found) and again.message == found.message
    for name in ("q", "times"):
        assert np.array_equal(getattr(again, name), getattr(found, name))
    for name in ("offsets", "offset_deviations", "body_scales"):
        pairs = zip(getattr(again, name).values(), getattr(found, name).values(), strict=True)
        assert all(np.array_equal(one, other) for one, other in pairs)
    assert again.scales == found.scales and again.scale_deviations == found.scale_deviations
    plotting.tree_motion(found)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"size_deviation": 0.0}, "`size_deviation` must be positive and at most 0.3, found 0"),
        ({"group_deviation": 1.0}, "`group_deviation` must be positive and at most 0.3, found 1"),
        ({"offset_deviation": -0.01}, "`offset_deviation` must be 0, or from 1e-6 to 1 m, found -0.01"),
        ({"noise": 0.0}, "`noise` must be positive and finite, found 0"),
        ({"threshold": 0.1}, "`threshold` must be from 1 to 1000, found 0.1"),
        ({"max_frames": 0}, "`max_frames` must be"),
        ({"max_iterations": -1}, "`max_iterations` must be"),
        ({"groups": {"a": "tail"}}, r"groups\['a'\].*tail"),
        ({"groups": {"a": 3}}, r"`groups\['a'\]` must be a body, bodies, or a dict"),
        ({"groups": {"a": {"torso": "w"}}}, "must be some of 'xyz', found 'w'"),
        ({"groups": {"a": []}}, "group `a` must have at least one body"),
        (
            {"groups": {"a": "torso", "b": {"torso": "x"}}},
            "the x axis of `torso` is in the groups `a` and `b`",
        ),
        ({"groups": {1: "torso"}}, "`groups` must have names that are str, found an int"),
    ],
)
def test_what_is_not_allowed_is_said_by_name(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        motion.scale_model(MARKERS, seen(), **arguments)


@pytest.mark.parametrize(
    ("scales", "message"),
    [
        ({"tail": 1.0}, "`scales` must name segments, torso, pelvis, .* found 'tail'"),
        ({"thigh": 0.0}, "`scales` must be from 0.01 to 100, found 0"),
        ({"thigh": (1.0, 2.0)}, r"`scales\['thigh'\]` must"),
        ({1: 1.0}, "`scales` must have names that are str, found an int"),
        ({"right_hand": 1.0, "left_hand": 1.1}, "`scales` must be alike on both sides"),
    ],
)
def test_sizes_of_divers_are_checked(scales: dict[Any, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        multibody.diver_spatial().scaled(scales)


def test_so_are_those_of_models() -> None:
    arm = multibody.two_link_arm()
    with pytest.raises(ValueError, match="lowre"):
        arm.scaled({"lowre": 1.1})
    with pytest.raises(ValueError, match=r"`scales` must be from 0\.01 to 100, found 1000"):
        arm.scaled({"lower": 1000.0})
