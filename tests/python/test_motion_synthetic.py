"""SYNTHETIC dives from end to end, judged sets, and recordings written and read again."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import somersault
from somersault import errors, motion, multibody, ocp

Array = NDArray[np.float64]

#: 5174D, as the search has found it.
DIVE = Path(__file__).parents[2] / "python" / "notebooks" / "dive_5174d.som"


@pytest.fixture(scope="module")
def dive() -> ocp.DiveSolution:
    return ocp.dive_107b().solve()


@pytest.fixture(scope="module")
def flight(dive: ocp.DiveSolution) -> motion.SyntheticFlight:
    return motion.SyntheticFlight(dive.dive.diver.model, dive.t, dive.q)


@pytest.fixture(scope="module")
def markers(dive: ocp.DiveSolution) -> motion.MarkerSet:
    return motion.MarkerSet.joint_centres(dive.dive.diver.model)


@pytest.fixture(scope="module")
def made(flight: motion.SyntheticFlight, markers: motion.MarkerSet) -> motion.SyntheticSet:
    return motion.SyntheticSet(flight, markers, n_dives=24, seed=1)


def about(q: Array, axis: Array) -> float:
    """How far the root turns about an axis, rad: the parts of its steps along it, added up."""
    rotations = Rotation.from_quat(q[:, 3:7])
    return float(np.sum((rotations[1:] * rotations[:-1].inv()).as_rotvec() @ axis))


@pytest.mark.parametrize(
    "change",
    [
        {"wobble": 0.1},
        {"wobble": 0.1, "wobble_phase": 2.1},
        {"wobble": 0.1, "wobble_phase": 4.2},
        {"wobble": 0.2, "wobble_phase": 2.1},
        {"asymmetry": -0.3},
        {"asymmetry": 0.3},
        {"over_rotation": 0.8},
        {"over_rotation": -10.0},
        {"over_rotation": 20.0},
    ],
)
def test_a_twisting_dive_is_perturbed_where_its_rotation_is_not_monotonic_in_the_momentum(
    change: dict[str, float],
) -> None:
    found = somersault.load(DIVE)
    flight = motion.SyntheticFlight(multibody.diver_spatial().model, found.t[::14], found.q[::14])
    plain, changed = (flight.perturb(motion.Perturbation(**some)) for some in ({}, change))
    axis = plain.angular_momentum / np.linalg.norm(plain.angular_momentum)
    assert np.linalg.norm(np.cross(axis, changed.angular_momentum)) < 1e-12 * np.linalg.norm(
        changed.angular_momentum
    )
    turns = [about(np.asarray(one.q), axis) for one in (plain, changed)]
    assert turns[1] - turns[0] == pytest.approx(change.get("over_rotation", 0.0), abs=1e-8)


class TestSyntheticDives:
    def test_an_unperturbed_flight_is_flown_again(
        self, dive: ocp.DiveSolution, flight: motion.SyntheticFlight
    ) -> None:
        again = flight.perturb(motion.Perturbation())
        np.testing.assert_allclose(again.times, dive.t, atol=1e-12)
        assert np.abs(np.asarray(again.q) - dive.q).max() < 2e-3
        assert again.angular_momentum[1] == pytest.approx(dive.momentum, rel=1e-3)

    def test_faults_are_those_put_in(self, flight: motion.SyntheticFlight) -> None:
        plain = flight.faults
        late, loose = (
            motion.DiveFaults.of(flight.model, made.times, made.q)
            for made in (
                flight.perturb(motion.Perturbation(exit_delay=0.06)),
                flight.perturb(motion.Perturbation(looseness=0.12)),
            )
        )
        assert late.exit_fraction - plain.exit_fraction == pytest.approx(0.06 / 1.7, abs=0.01)
        assert late.hip_opening == pytest.approx(plain.hip_opening, abs=0.02)
        assert loose.hip_opening > plain.hip_opening + 0.1 and plain.asymmetry == 0.0

    def test_scores_are_those_of_the_stated_judge(self, made: motion.SyntheticSet) -> None:
        judge = made.judge
        for faults, intended in zip(made.faults, made.intended, strict=True):
            lost = sum(
                points * max(0.0, getattr(faults, name) - getattr(judge.reference, name))
                for name, points in judge.deductions.items()
            )
            assert intended == pytest.approx(np.clip(10.0 - lost, 0.0, 10.0), abs=1e-12)
            assert judge.intended(faults) == intended
        off = made.scores - made.intended
        # the noise of 24 dives, of deviation 0.25; five deviations of both
        assert abs(off.mean()) < 5 * 0.25 / np.sqrt(24) and 0.05 < off.std() < 0.45

    def test_everything_says_synthetic(self, made: motion.SyntheticSet, tmp_path: Path) -> None:
        performances = made.performances()
        assert all(p.synthetic for p in performances)
        model = motion.ScoringModel(performances, made.scores)
        assert model.synthetic and "SYNTHETIC" in repr(model) and "SYNTHETIC" in repr(made)
        model.save(tmp_path / "model.json")
        assert motion.ScoringModel.load(tmp_path / "model.json").synthetic
        assert "SYNTHETIC" in repr(made.judged_set()) and "SYNTHETIC" in repr(performances[0])
        real = motion.Performance([0.0, 1.0], list("abc"), np.zeros((2, 3)), np.zeros((2, 3)))
        assert not real.synthetic and real.labelled_synthetic().synthetic

    def test_faults_and_perturbations_that_are_no_numbers_are_refused_by_name(self) -> None:
        names = ("entry_angle", "hip_opening", "exit_fraction", "asymmetry", "roughness")
        for name in names:
            for bad in (np.nan, np.inf):
                with pytest.raises(errors.InputError, match=f"`{name}` must be finite"):
                    motion.DiveFaults(**(dict.fromkeys(names, 0.1) | {name: bad}))
        for name in (
            "exit_delay",
            "looseness",
            "over_rotation",
            "wobble",
            "wobble_frequency",
            "wobble_phase",
        ):
            with pytest.raises(errors.InputError, match=f"`{name}` must be"):
                motion.Perturbation(**{name: np.nan})

    def test_the_judge_is_found_within_his_noise(self, made: motion.SyntheticSet) -> None:
        found = motion.validate(made.performances(), made.scores, n_resamples=200)
        assert found.synthetic
        assert found.rms_error < 2.0 * made.judge.noise
        assert found.pearson.interval[0] > 0.5 and found.spearman.interval[0] > 0.4
        assert found.pearson.p_value < 0.01 and found.spearman.p_value < 0.01
        mean = found.baselines[0]
        assert mean.name == "mean" and found.rms_error < 0.6 * mean.rms_error

    def test_nothing_is_found_in_shuffled_scores(self, made: motion.SyntheticSet) -> None:
        scores = np.random.default_rng(2).permutation(made.scores)
        found = motion.validate(made.performances(), scores, n_resamples=200)
        assert found.pearson.interval[0] <= 0.0 <= found.pearson.interval[1]
        assert found.spearman.interval[0] <= 0.0 <= found.spearman.interval[1]
        assert found.pearson.p_value > 0.05

    def test_the_same_seed_makes_the_same_set(
        self, flight: motion.SyntheticFlight, markers: motion.MarkerSet, made: motion.SyntheticSet
    ) -> None:
        again = motion.SyntheticSet(flight, markers, n_dives=24, seed=1)
        np.testing.assert_array_equal(again.scores, made.scores)
        np.testing.assert_array_equal(again.markers[3].points, made.markers[3].points)
        other = motion.SyntheticSet(flight, markers, n_dives=2, seed=2)
        assert len(other) == 2 and other.scores[0] != made.scores[0]

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"n_dives": 0}, "`n_dives` must have at least 1"),
            ({"marker_noise": -1.0}, "`marker_noise` must be finite and not negative"),
            ({"greatest": motion.Perturbation(exit_delay=9.0)}, "`exit_delay` must lie between"),
        ],
    )
    def test_sets_that_cannot_be_made_are_refused(
        self,
        flight: motion.SyntheticFlight,
        markers: motion.MarkerSet,
        options: dict[str, Any],
        message: str,
    ) -> None:
        with pytest.raises(errors.InputError, match=message):
            motion.SyntheticSet(flight, markers, **options)

    def test_flights_that_are_none_are_refused(self) -> None:
        model = multibody.diver_planar().model
        with pytest.raises(errors.InputError, match="`times` must have at least 5"):
            motion.SyntheticFlight(model, [0.0, 1.0], np.zeros((2, 12)))
        with pytest.raises(errors.InputError, match="`q` must have 12 columns"):
            motion.SyntheticFlight(model, np.arange(6.0), np.zeros((6, 11)))
        with pytest.raises(errors.InputError, match="no fold"):
            motion.SyntheticFlight(model, np.arange(6.0), np.zeros((6, 12)))
        with pytest.raises(errors.InputError, match="`noise` must be finite and not negative"):
            motion.SyntheticJudge(motion.DiveFaults(0, 0, 0, 0, 0), noise=-1.0)


class TestJudgedSets:
    def test_saved_and_read_again(self, made: motion.SyntheticSet, tmp_path: Path) -> None:
        made.judged_set().save(tmp_path)
        assert "SYNTHETIC" in (tmp_path / "judged.csv").read_text().splitlines()[0]
        found = motion.read_judged(tmp_path / "judged.csv")
        np.testing.assert_array_equal(found.scores, made.scores)
        assert found.synthetic == [True] * 24 and len(found) == 24 and found.features == {}
        for recording, same in zip(found.recordings, made.markers, strict=True):
            np.testing.assert_array_equal(recording.points, same.points)
        assert found.files[0].startswith("SYNTHETIC") and found.performances()[0].synthetic

    def test_lists_that_are_none_say_where(self, tmp_path: Path) -> None:
        (tmp_path / "a.csv").write_text("time,hip_x,hip_y,hip_z\n0,0,0,0\n1,0,0,1\n")
        (tmp_path / "b.csv").write_text("time,toe_x,toe_y,toe_z\n0,0,0,0\n1,0,0,1\n")
        path = tmp_path / "judged.csv"
        for text, line, message in (
            ("motion,score\na.csv,nan\n", 2, "a score must be finite"),
            ("motion\na.csv\n", 1, "columns with motion and score"),
            ("motion,score\n../a.csv,1\n", 2, "a file below the folder"),
            ("motion,score\na.csv,1\nb.csv,2\n", 3, "line 3 of the list: .*nothing is named `hip`"),
            ("motion,score\na.csv,1\nabsent.csv,2\n", 3, "line 3 of the list: .*cannot be read"),
            ("motion,score\na.mov,1\n", 2, "cannot be read"),
        ):
            path.write_text(text)
            with pytest.raises(errors.ReadError, match=message) as caught:
                motion.read_judged(path)
            assert caught.value.line == line
        with pytest.raises(OSError, match="cannot be read"):
            motion.read_judged(tmp_path / "absent" / "judged.csv")
        path.write_text("motion,score,height\na.csv,7.5,1.2\n")
        assert motion.read_judged(path).features["height"].tolist() == [1.2]


class TestWriters:
    @staticmethod
    def markers() -> motion.MarkerRecording:
        rng = np.random.default_rng(5)
        present = rng.random((6, 3)) > 0.2
        points = rng.normal(size=(6, 3, 3))
        return motion.MarkerRecording(["hip", "left knee", "toe"], np.arange(6) / 128.0, points, present)

    @staticmethod
    def skeleton() -> motion.SkeletonRecording:
        joints = [
            motion.SkeletonJoint("hips", moves=True),
            motion.SkeletonJoint("knee", 0, (0.0, 0.125, -0.5)),
            motion.SkeletonJoint("knee_end", 1, (0.0, 0.0, -0.5), turns=False),
        ]
        rotations = Rotation.random(10, rng=np.random.default_rng(3)).as_quat().reshape(5, 2, 4)
        places = np.random.default_rng(4).normal(size=(5, 1, 3))
        return motion.SkeletonRecording(motion.Skeleton(joints), np.arange(5) / 64.0, rotations, places)

    @pytest.mark.parametrize(
        ("write", "read", "exact"),
        [
            (motion.write_csv, motion.read_csv, True),
            (motion.write_trc, motion.read_trc, False),
            (motion.write_c3d, motion.read_c3d, False),
        ],
    )
    def test_markers_come_back(self, write: Any, read: Any, exact: bool, tmp_path: Path) -> None:
        recording = self.markers()
        write(tmp_path / "markers.x", recording)
        found = read(str(tmp_path / "markers.x"))
        assert found.names == recording.names
        np.testing.assert_array_equal(found.present, recording.present)
        np.testing.assert_array_equal(found.times, recording.times)
        if exact:
            np.testing.assert_array_equal(found.points, recording.points)
        else:  # a rounding by the unit, and single precision in C3D
            np.testing.assert_allclose(found.points, recording.points, rtol=1.2e-7)

    def test_skeletons_come_back(self, tmp_path: Path) -> None:
        recording = self.skeleton()
        motion.write_bvh(tmp_path / "a.bvh", recording, unit="cm")
        found = motion.read_bvh(tmp_path / "a.bvh", unit="cm")
        assert found.skeleton.names == recording.skeleton.names
        np.testing.assert_allclose(found.places, recording.places, atol=1e-15)
        apart = Rotation.from_quat(found.rotations.reshape(-1, 4)).inv() * Rotation.from_quat(
            recording.rotations.reshape(-1, 4)
        )
        assert apart.magnitude().max() < 1e-14

    def test_what_a_format_cannot_hold_is_refused(self, tmp_path: Path) -> None:
        comma = motion.MarkerRecording(["a,b"], [0.0], np.zeros((1, 1, 3)))
        with pytest.raises(errors.WriteError, match="`a,b` cannot be a name"):
            motion.write_csv(tmp_path / "a.csv", comma)
        uneven = motion.MarkerRecording(["a"], [0.0, 1.0, 3.0], np.zeros((3, 1, 3)))
        with pytest.raises(errors.WriteError, match="frames must be at equal times, but frame"):
            motion.write_c3d(tmp_path / "a.c3d", uneven)
        with pytest.raises(errors.WriteError, match="joint 0 of this format is `root`, found `hips`"):
            motion.write_joint_motion(tmp_path / "a.json", self.skeleton())
        with pytest.raises(FileNotFoundError):
            motion.write_csv(tmp_path / "absent" / "a.csv", self.markers())
