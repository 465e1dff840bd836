"""Scores: synthetic motions, whose judge is known, and SYNTHETIC dives from end to end."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from somersault import errors, motion

Array = NDArray[np.float64]

JOINTS = [f"joint {k}" for k in range(12)]
#: What performances were made of, those of `TestModels` first.
MADE: list[tuple[Array, Array, Array]] = []


def performances(n: int, seed: int = 1) -> tuple[list[motion.Performance], Array]:
    """Motions that differ in one bump of their postures, by an amount, and in noise."""
    rng = np.random.default_rng(seed)
    amounts = rng.uniform(0.0, 1.0, n)
    pattern = rng.normal(size=(2, 12))
    made = []
    for amount in amounts:
        t = np.linspace(0.0, rng.uniform(1.4, 1.6), 50)
        share = (t / t[-1])[:, None]
        bump = np.exp(-(((share - 0.6) / 0.1) ** 2))
        postures = np.sin(np.pi * share) * pattern[0] + amount * bump * pattern[1]
        postures = postures + rng.normal(0.0, 0.01, postures.shape)
        path = np.hstack([share, 0 * share, 10.0 - 10.0 * share**2])
        made.append(motion.Performance(t, JOINTS, postures, path))
        MADE.append((t, postures, path))
    return made, amounts


class TestModels:
    motions, amounts = performances(16)
    scores = 8.0 - 3.0 * amounts

    def test_a_linear_judge_is_learnt(self) -> None:
        model = motion.ScoringModel(self.motions[:12], self.scores[:12])
        found = [model.score(m).value for m in self.motions[12:]]
        np.testing.assert_allclose(found, self.scores[12:], atol=0.15)
        assert model.eigenpostures.n_components == 4
        assert model.eigenmotions.n_components == len(model.coefficients) <= 5
        assert model.intercept == pytest.approx(self.scores[:12].mean())

    def test_the_score_is_that_of_the_formula(self) -> None:
        options = motion.ScoringOptions(n_frames=20, n_eigenweights=2, path=False, n_components=1)
        model = motion.ScoringModel(self.motions, self.scores, options)
        t = np.linspace(0.0, 1.5, 20)
        postures = np.random.default_rng(4).normal(size=(20, 12))
        weights = model.eigenpostures.scores(postures)
        vector = weights.T.reshape(1, -1)
        expected = model.intercept + float(model.eigenmotions.scores(vector)[0] @ model.coefficients)
        found = model.score(motion.Performance(t, JOINTS, postures, np.zeros((20, 3)))).value
        assert found == pytest.approx(expected, abs=1e-10)

    def test_saved_models_come_back_to_the_bit(self, tmp_path: Path) -> None:
        model = motion.ScoringModel(self.motions, self.scores)
        model.save(tmp_path / "model.json")
        expected = [model.score(m) for m in self.motions]
        for same in (
            motion.ScoringModel.load(str(tmp_path / "model.json")),
            pickle.loads(pickle.dumps(model)),
        ):
            assert [same.score(m) for m in self.motions] == expected

    def test_files_that_are_no_models_are_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "model.json"
        motion.ScoringModel(self.motions, self.scores).save(path)
        stored = json.loads(path.read_text(encoding="utf-8"))
        for change, message in (
            ({"version": 99}, "found `somersault scoring model` of version 99"),
            ({"format": "else"}, "found `else`"),
            ({"coefficients": [1.0] * 99}, "`coefficients`"),
            ({"intercept": "x"}, r"line \d+: not a scoring model"),
        ):
            path.write_text(json.dumps({**stored, **change}), encoding="utf-8")
            with pytest.raises(errors.ReadError, match=message):
                motion.ScoringModel.load(path)
        path.write_bytes(b"\xff\xfe{")
        with pytest.raises(errors.ReadError, match="line 1"):
            motion.ScoringModel.load(path)
        with pytest.raises(FileNotFoundError):
            motion.ScoringModel.load(tmp_path / "absent.json")

    def test_options_are_those_of_the_thesis_unless_given(self) -> None:
        options = motion.ScoringOptions()
        assert (options.n_frames, options.n_eigenweights, options.path, options.duration) == (
            60,
            4,
            True,
            False,
        )
        assert options.n_components is None and options.max_components == 5
        assert repr(motion.ScoringOptions(n_components=2)).count("n_components=2") == 1

    @pytest.mark.parametrize(
        ("n", "scores", "options", "message"),
        [
            (5, np.arange(5.0), {}, "`motions` must have at least 7 entries, found 5"),
            (12, np.arange(11.0), {}, "`scores` must have 12 entries, found 11"),
            (12, [np.nan] * 12, {}, "`scores` must be finite"),
            (12, [7.6] * 11 + [76.0], {}, "within the scale 0 to 10, found 76 of motion 11"),
            (12, np.arange(12.0), {"scale": (1.0, 0.0)}, "`scale` must be two finite numbers that grow"),
            (12, np.arange(12.0) / 2, {"n_components": 0}, "`n_components` must be at least 1"),
            (12, np.arange(12.0) / 2, {"n_eigenweights": 13}, "`n_eigenweights` must be at most 12"),
            (12, np.arange(12.0), {"n_frames": 0}, "`n_frames`"),
            (12, np.arange(12.0), {"n_frames": 2**62}, "`n_frames` must be between 0 and 1000000"),
            (0, [], {}, "`motions`"),
        ],
    )
    def test_what_cannot_be_learnt_is_refused(
        self, n: int, scores: Any, options: dict[str, Any], message: str
    ) -> None:
        with pytest.raises(errors.InputError, match=message):
            motion.ScoringModel(self.motions[:n], scores, motion.ScoringOptions(**options))

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"times": [0.0]}, "`times` must have at least 2"),
            ({"times": [0.0, 0.0, 1.0]}, "`times`"),
            ({"postures": np.zeros((2, 4))}, "`rows of postures` must have 3 entries, found 2"),
            ({"path": np.zeros((3, 2))}, "`columns of path` must have 3 entries, found 2"),
            ({"postures": np.full((3, 4), np.nan)}, "must be finite"),
            ({"names": list("abc")}, "`names` must have 4 entries, found 3"),
            ({"names": list("abca")}, "`a` occurs twice"),
        ],
    )
    def test_what_is_no_performance_is_refused(self, change: dict[str, Any], message: str) -> None:
        arguments: dict[str, Any] = {
            "times": [0.0, 0.1, 0.2],
            "names": list("abcd"),
            "postures": np.zeros((3, 4)),
            "path": np.zeros((3, 3)),
        }
        with pytest.raises(errors.InputError, match=message):
            motion.Performance(**(arguments | change))

    def test_motions_of_other_names_or_kinds_have_no_score(self) -> None:
        model = motion.ScoringModel(self.motions, self.scores)
        assert (model.names, model.kind, model.scale) == (tuple(JOINTS), "coordinates", (0.0, 10.0))
        np.testing.assert_array_equal(model.scores, self.scores)
        other = motion.Performance([0.0, 1.0], JOINTS[:5], np.zeros((2, 5)), np.zeros((2, 3)))
        with pytest.raises(errors.InputError, match=r"must have joint 5, .*; it has joint 0"):
            model.score(other)
        markers = motion.MarkerRecording(JOINTS, [0.0, 1.0], np.zeros((2, 12, 3)))
        with pytest.raises(errors.InputError, match="must be coordinates, found markers"):
            model.score(motion.Performance.from_markers(markers))

    def test_permuted_columns_and_turned_paths_score_the_same_and_degrees_are_outside(self) -> None:
        model = motion.ScoringModel(self.motions[:12], self.scores[:12])
        rng = np.random.default_rng(7)
        for k in range(12, 16):
            score = model.score(self.motions[k])
            assert repr(score).startswith("<Score: ") and pickle.loads(pickle.dumps(score)) == score
            times, postures, path = MADE[k]
            order = rng.permutation(12)
            turned = path @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
            names = [JOINTS[i] for i in order]
            same = model.score(motion.Performance(times, names, postures[:, order], turned))
            assert (same.value, same.distance) == pytest.approx((score.value, score.distance), abs=1e-9)
            degrees = model.score(motion.Performance(times, JOINTS, np.degrees(postures), path))
            assert not degrees.inside and degrees.distance > 10.0 and "OUTSIDE" in repr(degrees)

    def test_markers_with_gaps_are_no_performance(self) -> None:
        points = np.zeros((3, 2, 3))
        recording = motion.MarkerRecording(["a", "b"], [0.0, 0.1, 0.2], points)
        assert motion.Performance.from_markers(recording).n_features == 6
        gap = motion.MarkerRecording(["a", "b"], [0.0, 0.1, 0.2], points, np.eye(3, 2) < 1)
        with pytest.raises(
            errors.InputError, match="`recording` must have no gaps, but `a` is missing in frame 0"
        ):
            motion.Performance.from_markers(gap)


class TestValidation:
    motions, amounts = performances(16)
    scores = 8.0 - 3.0 * amounts

    def test_predictions_leave_one_out(self) -> None:
        found = motion.validate(self.motions, self.scores, n_resamples=500)
        for i in (0, 7, 15):
            rest = [m for k, m in enumerate(self.motions) if k != i]
            model = motion.ScoringModel(rest, np.delete(self.scores, i))
            assert found.predictions[i] == pytest.approx(model.score(self.motions[i]).value, abs=1e-9)
            assert found.n_components[i] == len(model.coefficients)
        assert found.rms_error == pytest.approx(np.sqrt(np.mean((found.predictions - self.scores) ** 2)))

    def test_a_judge_is_found_and_beats_the_baselines(self) -> None:
        found = motion.validate(self.motions, self.scores, n_resamples=2000, features={"bump": -self.amounts})
        assert found.rms_error < 0.2
        assert found.pearson.interval[0] > 0.9 and found.spearman.interval[0] > 0.7
        by_name = {baseline.name: baseline for baseline in found.baselines}
        assert set(by_name) == {"mean", "duration", "bump"}
        others = (self.scores.sum() - self.scores) / 15
        np.testing.assert_allclose(by_name["mean"].predictions, others, rtol=1e-14)
        assert by_name["bump"].rms_error < 1e-12 < found.rms_error < 0.3 * by_name["mean"].rms_error
        assert "16 motions" in repr(found) and "in [" in repr(found.pearson)

    def test_groups_and_methods_leave_out_athletes(self) -> None:
        athletes = [f"athlete {k % 5}" for k in range(16)]
        for method, own in (("pls", "n_components"), ("ridge", "penalties")):
            options = motion.ScoringOptions(method=method)  # type: ignore[arg-type]
            found = motion.validate(self.motions, self.scores, options, groups=athletes, n_resamples=20)
            others = [k for k in range(16) if k % 5 != 3]
            model = motion.ScoringModel([self.motions[k] for k in others], self.scores[others], options)
            assert found.predictions[3] == pytest.approx(model.score(self.motions[3]).value, abs=1e-9)
            assert (model.method, len(model.coefficients)) == (method, len(others) - 1)
            assert getattr(found, own)[3] == (model.penalty if method == "ridge" else model.n_components)
            assert len(found.n_components) + len(found.penalties) == 16
            mean = found.baselines[0]
            assert mean.predictions[3] == pytest.approx(self.scores[others].mean(), abs=1e-12)
            left = np.sum((found.predictions - self.scores) ** 2)
            left /= np.sum((mean.predictions - self.scores) ** 2)
            assert found.r_squared == pytest.approx(1.0 - left, abs=1e-12)
        by_number = motion.validate(
            self.motions, self.scores, options, groups=[k % 5 for k in range(16)], n_resamples=20
        )
        np.testing.assert_array_equal(by_number.predictions, found.predictions)
        assert by_number.pearson.interval == found.pearson.interval

    @pytest.mark.parametrize(
        ("groups", "message"),
        [
            (["a"] * 8 + ["b"] * 8, "`groups` must be labels of at least 3 groups, found 2"),
            ([0, 1, 2], "`groups` must have 16 entries, found 3"),
            ([1.5] * 16, "`groups` must be labels that are str or int, found a float"),
            ([0] * 14 + [1, 2], "`groups` must leave at least 7 motions .* found 2 without that of motion 0"),
        ],
    )
    def test_groups_that_cannot_be_left_out_are_refused(self, groups: Any, message: str) -> None:
        with pytest.raises(errors.InputError, match=message):
            motion.validate(self.motions, self.scores, groups=groups)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"method": "lasso"}, "`method` must be 'pcr', 'pls' or 'ridge', found 'lasso'"),
            ({"method": "ridge", "n_components": 2}, "`n_components` must not be given for the method ridge"),
            ({"penalty": 0.1}, "`penalty` must not be given for the method pcr, which has `n_components`"),
            ({"method": "ridge", "penalty": 0.0}, "`penalty` must be positive and finite, found 0"),
        ],
    )
    def test_what_is_not_of_the_method_is_refused(self, options: dict[str, Any], message: str) -> None:
        with pytest.raises(errors.InputError, match=message):
            motion.ScoringOptions(**options)

    def test_intervals_follow_the_seed_and_the_level(self) -> None:
        first, again, other, wide = (
            motion.validate(self.motions, self.scores, n_resamples=300, **options).pearson.interval  # type: ignore[arg-type]
            for options in ({}, {}, {"seed": 5}, {"level": 0.999})
        )
        assert first == again != other
        assert wide[0] < first[0] <= first[1] <= wide[1]

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"level": 1.0}, "level"),
            ({"level": np.nan}, "level"),
            ({"n_resamples": 0}, "`n_resamples` must be at least 2"),
            ({"n_resamples": 1}, "`n_resamples` must be at least 2"),
            ({"features": {"mean": [1.0] * 16}}, "`features` must have names .* named `mean`"),
            ({"features": {"duration": [1.0] * 16}}, "`features` must have names .* named `duration`"),
            ({"features": {"a": [1e300] * 16}}, "`features` must be within ±1e100, found 1e300"),
            ({"n_resamples": 2**62}, "`n_resamples` must be between 0 and"),
            ({"features": {"a": [1.0]}}, "`features` must have 16 entries, found 1"),
            ({"features": {"a": [np.inf] * 16}}, "`features` must be finite"),
        ],
    )
    def test_what_cannot_be_validated_is_refused(self, options: dict[str, Any], message: str) -> None:
        with pytest.raises(errors.InputError, match=message):
            motion.validate(self.motions, self.scores, **options)

    def test_numbers_whose_squares_overflow_are_refused(self) -> None:
        message = "`scores` must be within ±1e100, found 1e300"
        for learn in (motion.validate, motion.ScoringModel):
            with pytest.raises(errors.InputError, match=message):
                learn(self.motions, 1e300 * np.ones(16))
        for name in ("postures", "path"):
            numbers: dict[str, Any] = {"postures": np.ones((2, 3)), "path": np.ones((2, 3))}
            numbers[name][1, 2] = -1e200
            with pytest.raises(errors.InputError, match=rf"`{name}` must .* found -1e200 in row 1"):
                motion.Performance([0.0, 1.0], list("abc"), **numbers)
        far = motion.MarkerRecording(["a"], [0.0, 1.0], np.full((2, 1, 3), 1e200))
        with pytest.raises(errors.InputError, match="`recording` must be within ±1e100, found 1e200"):
            motion.Performance.from_markers(far)

    def test_scores_that_do_not_vary_are_refused(self) -> None:
        with pytest.raises(errors.InputError, match="does not vary"):
            motion.validate(self.motions, np.full(16, 7.0))


class TestAwards:
    TABLE = (
        "diver,dive,DD,J1,J2,J3,J4,J5,points,pool\n"
        "Ann,107B,3.1,7.5,8,7.5,7,8,71.3,1\n"
        "Bea,105C,2,7,7,7,7,7,41,1\n"
    )

    def test_a_table_is_read_with_what_contradicts_it(self, tmp_path: Path) -> None:
        path = tmp_path / "final.csv"
        path.write_text(self.TABLE)
        with pytest.warns(errors.ReadWarning, match="line 3: points that are stated are not those"):
            table = motion.read_awards(path)
        np.testing.assert_allclose(table.points, [71.3, 42.0], rtol=1e-14)
        np.testing.assert_allclose(table.scores, [23.0 / 3.0, 7.0], rtol=1e-14)
        np.testing.assert_array_equal(table.stated, [71.3, 41.0])
        assert (table.athletes, table.dives, table.lines) == (("Ann", "Bea"), ("107B", "105C"), [2, 3])
        for awards, counts, difficulty, points in zip(
            table.awards, table.counts, table.difficulty, table.points, strict=True
        ):
            assert motion.panel_score(awards, difficulty) == (points, counts)
        assert [repair.is_decision for repair in table.repairs] == [True, False]
        assert len(table) == 2 and "2 dives, 5 judges" in repr(table)

    def test_what_is_no_table_says_where(self, tmp_path: Path) -> None:
        path = tmp_path / "final.csv"
        for text, strict, line, message in (
            (self.TABLE, True, 3, "42.00 points by the awards"),
            (self.TABLE.replace("7.5,8,7.5", "7.5,8,7.4"), False, 2, "half points from 0 to 10"),
            (self.TABLE.replace("DD", "name"), False, 1, "each column once"),
            (self.TABLE.replace("DD", "hard"), False, 1, "a column `difficulty`"),
        ):
            path.write_text(text)
            with pytest.raises(errors.ReadError, match=message) as caught:
                motion.read_awards(path, strict=strict)
            assert caught.value.line == line


def test_correlations_are_scipys() -> None:
    rng = np.random.default_rng(6)
    x = rng.integers(0, 8, 40).astype(float)
    y = x + rng.normal(0.0, 3.0, 40).round()
    assert motion.pearson(x, y) == pytest.approx(stats.pearsonr(x, y).statistic, abs=1e-14)
    assert motion.spearman(x, y) == pytest.approx(stats.spearmanr(x, y).statistic, abs=1e-14)
    with pytest.raises(errors.InputError, match="`y` does not vary"):
        motion.spearman(x, np.ones(40))
    with pytest.raises(errors.InputError, match=r"`y` must be real numbers of shape \(40,\)"):
        motion.pearson(x, y[1:])
