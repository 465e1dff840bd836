"""A thorax that moves against the abdomen: dives in which the trunk rounds, by markers of Plug-in Gait."""

import pickle
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dive_faults import DURATION, OPENED_IN, OPENS, smooth

from somersault import motion, multibody, viewer
from somersault.cli import main
from somersault.errors import InputError
from somersault.viewer import figures

RIGID = multibody.diver_ball_jointed(mass=62.0, height=1.66)
DIVER = multibody.diver_ball_jointed(mass=62.0, height=1.66, thorax=True)
MODEL = DIVER.model
MARKERS = motion.MarkerSet.on_diver(DIVER, "plug_in_gait")


def rounded(lean: float, twist: float = 0.0) -> Any:
    """A pike in which the trunk bends by 25° at the breastbone, leans there and back at the waist."""
    v, names = np.zeros(MODEL.n_velocities), DIVER.dof_names
    for name, degrees in (
        ("abdomen_bend", 25.0),
        ("abdomen_lean", lean),
        ("pelvis_x", -lean),
        ("pelvis_z", twist),
    ):
        v[names.index(name)] = np.radians(degrees)
    for side, sign in (("right", -1.0), ("left", 1.0)):
        v[names.index(f"{side}_thigh_x")] = sign * np.radians(12.0)
        v[names.index(f"{side}_thigh_y")] = np.radians(25.0)
    return np.array(MODEL.displace(DIVER.configuration("H"), v))


@cache
def flown(lean: float, twist: float = 0.0, spin: float = 3.1) -> multibody.TreeSolution:
    """A dive that folds to that pike and opens, with an angular velocity at take-off, rad/s."""
    start = np.array(DIVER.configuration("A"))
    start[2] = 3.0
    to = np.asarray(MODEL.difference(start, np.concatenate([start[:7], rounded(lean, twist)[7:]])))

    def shape(t: float) -> tuple[Any, Any]:
        (a, rise), (b, fall) = smooth((t - 0.1) / 0.3), smooth((t - OPENS) / OPENED_IN)
        w, rate = a * (1 - b), rise / 0.3 * (1 - b) - a * fall / OPENED_IN
        return np.asarray(MODEL.displace(start, w * to))[7:], rate * to[6:]

    v = np.zeros(MODEL.n_velocities)
    v[:5] = 1.0, 0.0, 4.8, 0.0, spin
    return multibody.fly(MODEL, start, v, shape, (0.0, DURATION), dt=0.02)


def recorded(
    run: multibody.TreeSolution, noise: float, seed: int = 7, every: int = 1
) -> motion.MarkerRecording:
    placed = motion.place_markers(MARKERS, run.t[::every], run.q[::every])
    points = placed.points + np.random.default_rng(seed).normal(0.0, noise, placed.points.shape)
    return motion.MarkerRecording(placed.names, placed.times, points)


def momentum_off(run: multibody.TreeSolution, found: motion.ReconstructedFlight) -> Any:
    """Errors of the components of the angular momentum over their deviations."""
    true = np.asarray(MODEL.centroidal_momentum(run.q[0], run.v[0]))[3:]
    return np.abs(found.angular_momentum - true) / found.angular_momentum_deviation


def test_a_trunk_that_rounds_is_reconstructed_and_a_rigid_one_is_a_misfit() -> None:
    run = flown(6.0)
    recording = recorded(run, 0.01, every=2)
    found = motion.reconstruct_flight(MARKERS, recording, interval=(0.0, DURATION))
    assert found.success, found.message
    assert momentum_off(run, found).max() < 3.0
    angles, known = DIVER.angles(found.q), DIVER.angles(run.q[::2])
    for name in ("abdomen_bend", "abdomen_lean", "pelvis_bend", "pelvis_twist"):
        assert np.sqrt(np.mean((angles[name] - known[name]) ** 2)) < np.radians(4.0), name
    rigid = motion.reconstruct_flight(
        motion.MarkerSet.on_diver(RIGID, "plug_in_gait"), recording, interval=(0.0, DURATION)
    )
    assert rigid.status == "misfit" and not rigid.success
    # a what-if, of which both joints of the trunk are a part
    more = motion.what_if(found, opening=0.02)
    assert np.isfinite(more.entry_angle_change) and more.entry_angle_change > 0.0


@pytest.mark.study
def test_trunks_that_round_are_reconstructed_as_often_as_documented() -> None:
    """24 dives at 10 mm; the same with a rigid torso are refused. Some three minutes."""
    rigid = motion.MarkerSet.on_diver(RIGID, "plug_in_gait")
    off, refused = [], []
    for seed in range(24):
        rng = np.random.default_rng(seed)
        run = flown(rng.uniform(-12.0, 12.0), rng.uniform(-12.0, 12.0), rng.uniform(3.0, 7.0))
        recording = recorded(run, 0.01, seed)
        found = motion.reconstruct_flight(MARKERS, recording, interval=(0.0, DURATION))
        assert found.success, (seed, found.message)
        off.append(momentum_off(run, found))
        again = motion.reconstruct_flight(rigid, recording, interval=(0.0, DURATION))
        refused.append(again.status == "misfit")
    covered = np.mean(np.array(off) < 1.96)
    print(f"within intervals: {covered:.3f}; rigid refused: {np.mean(refused):.3f}")
    assert 0.88 < covered < 0.99 and all(refused)


def test_frames_are_fitted_to_the_noise_of_the_markers() -> None:
    recording = recorded(flown(6.0), 0.003)
    fits = [
        motion.MarkerFit(motion.MarkerSet.on_diver(diver, "plug_in_gait"), scale=1.0).fit(recording)
        for diver in (DIVER, RIGID)
    ]
    # in three directions, less what the joints take
    assert fits[0].rms < 0.003 * np.sqrt(3.0) and fits[1].rms > 2.0 * fits[0].rms


def test_its_size_is_found() -> None:
    person = DIVER.scaled({"abdomen": 1.06, "torso": (1.0, 1.04, 0.96), "thigh": 1.05})
    t = np.linspace(0.0, 2.0, 41)
    swing = 0.35 * np.sin(np.outer(t, np.random.default_rng(4).uniform(2.0, 5.0, MODEL.n_velocities)))
    swing[:, :6] = 0.0
    q = np.array([MODEL.displace(DIVER.configuration("B"), v) for v in swing])
    for link in MODEL.links:
        if link.limits is not None:
            q[:, MODEL.positions_of(link.name)] = np.clip(q[:, MODEL.positions_of(link.name)], *link.limits)
    placed = motion.place_markers(motion.MarkerSet.on_diver(person, "plug_in_gait"), t, q)
    points = placed.points + np.random.default_rng(6).normal(0.0, 0.004, placed.points.shape)
    found = motion.scale_model(MARKERS, motion.MarkerRecording(placed.names, t, points))
    assert found.success, found.message
    for name, size in (("abdomen", 1.06), ("torso", 0.96), ("torso width", 1.04), ("thigh", 1.05)):
        assert abs(found.scales[name] - size) < 3.0 * found.scale_deviations[name], name
    again = DIVER.scaled(found.body_scales)
    assert np.allclose(again.segment_scales["abdomen"], found.body_scales["abdomen"])


def test_it_is_the_same_diver_where_it_is_straight() -> None:
    assert repr(DIVER) == "<Diver: ball-jointed with a thorax, 62 kg, 1.66 m>"
    again = pickle.loads(pickle.dumps(DIVER))
    assert repr(again) == repr(DIVER) and again.dof_names == DIVER.dof_names
    assert MODEL.n_velocities == 36 == len(DIVER.dof_names)
    assert "abdomen" not in RIGID.segment_scales and "abdomen" in DIVER.segment_scales
    with pytest.raises(InputError, match=r"`scales` must name segments, torso, .*hand, found 'abdomen'"):
        RIGID.scaled({"abdomen": 1.1})
    for posture in DIVER.postures:
        places = []
        for diver in (DIVER, RIGID):
            centres = motion.MarkerSet.joint_centres(diver.model)
            placed = motion.place_markers(centres, [0.0], [diver.configuration(posture)])
            places.append(dict(zip(placed.names, placed.points[0], strict=True)))
        assert all(np.allclose(places[0][name], place, atol=1e-12) for name, place in places[1].items())


def test_it_is_drawn_in_two_parts_that_make_the_torso() -> None:
    shapes = viewer.figure(DIVER.model)
    assert set(shapes) == {*viewer.figure(RIGID.model), "abdomen"}
    thorax, abdomen, torso = (np.array(rows) for rows in (figures._THORAX, figures._ABDOMEN, figures._TORSO))
    abdomen[:, 0] += figures._BREASTBONE
    for z in np.linspace(0.0, 0.38, 39):
        widest = [
            max(np.interp(z, rows[:, 0], rows[:, k], left=0.0, right=0.0) for rows in (thorax, abdomen))
            for k in (3, 4)
        ]
        whole = [np.interp(z, torso[:, 0], torso[:, k]) for k in (3, 4)]
        assert np.allclose(widest, whole, atol=0.003), z


def test_the_command_line_takes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, diver, page = tmp_path / "dive.trc", tmp_path / "me.toml", tmp_path / "dive.html"
    motion.write_trc(file, recorded(flown(0.0), 0.01, every=2))
    document = (
        'model = "ball_jointed"\nthorax = true\nmass = 62.0\nheight = 1.66\nprotocol = "plug_in_gait"\n'
    )
    diver.write_text(f"{document}half_somersaults = 3\n[flight]\ninterval = [0.0, {DURATION}]\n")
    assert main(["analyse", str(file), "--diver", str(diver), "--out", str(page)]) == 0
    assert "103B" in capsys.readouterr().out and page.exists()
    diver.write_text(document.replace("ball_jointed", "spatial"))
    assert main(["analyse", str(file), "--diver", str(diver)]) == 2
    assert "me.toml:2: thorax: `thorax` is of the model `ball_jointed` only" in capsys.readouterr().err
