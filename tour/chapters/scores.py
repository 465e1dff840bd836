"""Chapter 4.1 of the thesis: scores of dives, all of them SYNTHETIC, and Figure 4.1."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from somersault import motion, ocp, plotting
from tour.measurements import Measurements
from tour.page import Cell, Page, number, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TITLE = "Scores of dives"

_DIVES = 24
_LABEL = "<b>SYNTHETIC</b>"


def _interval(correlation: motion.Correlation) -> str:
    lower, upper = correlation.interval
    p_value = "p < 0.01" if correlation.p_value < 0.01 else f"p = {correlation.p_value:.2f}"
    return f"{number(correlation.value)} [{number(lower)}, {number(upper)}], {p_value}"


def _making(page: Page, made: motion.SyntheticSet) -> None:
    page.section("Synthetic dives and a synthetic judge")
    page.text(
        "The competition dives of the thesis are not public, and no other set of judged dives is. So that"
        " training"
        f" and scoring can be shown from end to end, this page makes one. {_LABEL}: {len(made)} dives, each"
        " the"
        " dive 107B of the chapter before with a late exit, a loose pike, over-rotation, a wobble and a"
        " longer or shorter flight, flown again with constant angular momentum; markers with 5 mm of noise;"
        " and a judge who is a formula. <b>No judge was asked.</b> What is learnt here says nothing about"
        " dives"
        " or judges; it says whether the method finds what is there to be found."
    )
    judge = made.judge
    faults = {name: np.array([getattr(f, name) for f in made.faults]) for name in judge.deductions}
    rows: list[list[str | Cell]] = []
    for name, points in judge.deductions.items():
        reference = float(getattr(judge.reference, name))
        lost = points * np.maximum(faults[name] - reference, 0.0)
        rows.append(
            [
                words(name.replace("_", " ")),
                number(reference, 3),
                f"{number(float(faults[name].min()), 3)} to {number(float(faults[name].max()), 3)}",
                number(points, 1),
                f"{number(float(lost.min()))} to {number(float(lost.max()))}",
            ]
        )
    page.table(
        (words("fault"), "of 107B", "of the dives", "points for a unit", "points lost"),
        rows,
        f"{_LABEL}: the judge gives 10 less p·max(0, fault − that of 107B) for each, and noise of"
        f" {judge.noise:g} points. Angles in rad; the exit is the fraction of the flight after which the hip"
        " stays more"
        " than half open; roughness the log dimensionless jerk of the hip. Scores are from"
        f" {made.scores.min():.2f} to {made.scores.max():.2f}, {made.scores.mean():.2f} on average.",
    )
    page.code(
        "from somersault import motion, ocp\n\n"
        "dive = ocp.dive_107b().solve()\n"
        "model = dive.dive.diver.model\n"
        "markers = motion.MarkerSet.joint_centres(model)\n"
        "flight = motion.SyntheticFlight(model, dive.t, dive.q)\n"
        f"made = motion.SyntheticSet(flight, markers, n_dives={_DIVES}, seed=1)\n"
        "made.performances(), made.scores\n"
    )


def _scatter(
    made: motion.SyntheticSet, found: motion.Validation, shuffled: motion.Validation, order: NDArray[np.intp]
) -> Axes:
    axes = plt.figure(figsize=(9.0, 4.2), layout="constrained").subplots(1, 2, sharex=True, sharey=True)
    scores = np.asarray(made.scores)
    for ax, validation, given, title in (
        (axes[0], found, scores, "scores as given"),
        (axes[1], shuffled, scores[order], "scores shuffled among the dives"),
    ):
        mean = next(baseline for baseline in validation.baselines if baseline.name == "mean")
        ax.axline((8.0, 8.0), slope=1.0, color="0.75", lw=1.0)
        ax.plot(given, mean.predictions, ".", color="0.6", ms=5, label="mean of the others")
        ax.plot(given, validation.predictions, "o", color="#4477aa", ms=5, label="prediction")
        ax.set(title=title, xlabel="SYNTHETIC score")
        ax.grid(color="0.92")
    axes[0].set_ylabel("prediction without the dive")
    axes[0].legend(frameon=False)
    drawn: Axes = axes[0]
    return drawn


def _validating(page: Page, made: motion.SyntheticSet) -> None:
    page.section("How accurate the scores are")
    dives, scores = made.performances(), np.asarray(made.scores)
    opening = [f.hip_opening for f in made.faults]
    began = time.perf_counter()
    found = motion.validate(dives, scores, features={"opening of the hip": opening})
    seconds = time.perf_counter() - began
    order = np.random.default_rng(2).permutation(len(scores))
    shuffled = motion.validate(dives, scores[order])
    page.text(
        "Every dive is scored by a model that has not seen it: eigenpostures, Eigendives, their number and"
        " the linear"
        " map are rebuilt from all others, with the settings of the thesis: 60 frames, four eigenweights,"
        " body"
        " path. Beside it are simple predictors, validated in the same way."
    )
    rows: list[list[str | Cell]] = [
        [
            words("the model of 4.1"),
            number(found.rms_error),
            _interval(found.pearson),
            _interval(found.spearman),
        ]
    ]
    for baseline in found.baselines:
        name = "mean of the others" if baseline.name == "mean" else f"straight line over the {baseline.name}"
        rows.append([words(name), number(baseline.rms_error), "–", "–"])
    rows.append(
        [
            words("the model, on shuffled scores"),
            number(shuffled.rms_error),
            _interval(shuffled.pearson),
            _interval(shuffled.spearman),
        ]
    )
    lower, upper = shuffled.pearson.interval
    contains = lower <= 0.0 <= upper
    page.table(
        (words("predictor"), "rms error, points", "Pearson", "Spearman"),
        rows,
        f"{_LABEL} scores, each predicted without its dive; correlations are of what a prediction"
        " differs by from the mean of the other scores, with intervals of 95 % over resamples of"
        " the dives and the"
        " fraction p of shuffled scores that are correlated at least as much. The judge's own noise is"
        f" {made.judge.noise:g} points: no model can do better. On shuffled scores"
        + (
            " the interval contains 0: nothing is found where there is nothing."
            if contains
            else " the interval does not contain 0, which happens to one set in twenty."
        )
        + f" The first validation took {seconds:.2f} s here.",
    )
    page.figure(
        "scores",
        _scatter(made, found, shuffled, order),
        f"{_LABEL} scores and what models say that have not seen the dive: as given (left), and shuffled"
        " (right).",
        "Left, points along the diagonal; right, a cloud around the mean",
    )


def _fits(dives: list[motion.MarkerRecording], fit: motion.MarkerFit) -> list[motion.MotionFit]:
    return [fit.fit(recording) for recording in dives]


def _figure(page: Page, made: motion.SyntheticSet, dive: ocp.DiveSolution, markers: motion.MarkerSet) -> None:
    page.section("Figure 4.1")
    diver = dive.dive.diver
    base = ocp.EigenpostureBase([diver.configuration(letter)[3:] for letter in "AH"])
    fit = motion.MarkerFit(markers, base=base)
    order = np.argsort(made.scores)
    recordings = made.markers
    groups = {
        "best": _fits([recordings[k] for k in order[-4:]], fit),
        "worst": _fits([recordings[k] for k in order[:3]], fit),
    }
    generated = fit.fit(motion.place_markers(markers, dive.t, dive.q))
    axes = plotting.motion_groups(groups, {"107B, generated": generated})
    scores = np.asarray(made.scores)[order]
    page.figure(
        "figure-4-1",
        axes[0],
        f"As Figure 4.1, of {_LABEL} dives: the four best ({scores[-4]:.1f} to {scores[-1]:.1f} points) and"
        " the three"
        f" worst ({scores[0]:.1f} to {scores[2]:.1f}), fitted frame by frame with the weight of the pike"
        " between"
        " 0 and 1 and a scale of its own in each frame; means, and one standard deviation about"
        " them. Blue is"
        " the"
        " dive as it was optimised. (d) is the rotation; the thesis' caption calls it a second scaling"
        " factor.",
        "Four panels with two bands each: eigenweight, marker error, scale and rotation over 60 frames",
    )
    fractions = {name: [_folded(found) for found in fits] for name, fits in groups.items()}
    late = {name: float(np.mean([_exit(found) for found in fits])) for name, fits in groups.items()}
    page.text(
        "In the middle third of the flight the weight of the pike is"
        f" {np.mean(fractions['best']):.3f} for the best dives, {np.mean(fractions['worst']):.3f} for"
        " the worst and"
        f" {_folded(generated):.3f} for 107B; it falls below one half at {100 * late['best']:.1f} %,"
        f" {100 * late['worst']:.1f} % and {100 * _exit(generated):.1f} % of the flight. Looseness"
        " and delay were put in,"
        " and can be read off markers with noise. Nothing was put in that would change marker"
        " errors or scales."
        " The thesis finds a higher weight of its generated dive too (4.2.1), among real dives."
    )


def _folded(fit: motion.MotionFit) -> float:
    """The mean weight in the middle third of the frames."""
    third = len(fit) // 3
    return float(np.asarray(fit.weights)[third : 2 * third, 0].mean())


def _exit(fit: motion.MotionFit) -> float:
    """The fraction of the time at which the weight falls below one half for good."""
    weight = np.asarray(fit.weights)[:, 0]
    last = int(np.flatnonzero(weight >= 0.5)[-1])
    t = np.asarray(fit.times)
    part = (weight[last] - 0.5) / (weight[last] - weight[last + 1]) if last + 1 < len(t) else 0.0
    at = t[last] + part * (t[min(last + 1, len(t) - 1)] - t[last])
    return float((at - t[0]) / (t[-1] - t[0]))


def _generated(
    page: Page, made: motion.SyntheticSet, dive: ocp.DiveSolution, markers: motion.MarkerSet
) -> None:
    page.section("The generated dive scored")
    model = motion.ScoringModel(made.performances(), made.scores)
    performance = motion.Performance.from_markers(motion.place_markers(markers, dive.t, dive.q))
    score = model.score(performance)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.json"
        model.save(path)
        again = motion.ScoringModel.load(path).score(performance)
    fraction = 100.0 * np.asarray(model.eigenmotions.explained_variance_ratio)
    page.text(
        f"Trained on all {len(made)} {_LABEL} dives, the model has {len(model.coefficients)}"
        " Eigendives, which"
        " hold"
        f" {', '.join(number(s, 1) for s in fraction)} % of the variance of the dives' vectors. It gives the"
        " dive 107B, which"
        f" it has not seen, {score.value:.2f} points, at a distance of {score.distance:.2f}"
        " (beyond 1 a dive is unlike the training motions); the judge's formula gives it"
        f" {made.judge.intended(made.judge.reference):.0f}, since its faults"
        " are within what the formula tolerates. The thesis' model, trained on sixteen real dives, gives its"
        " generated"
        f" dive 4.2: nothing here can tell why. Saved and loaded again, the model's score is"
        f" {'the same to the last bit' if again == score else 'another'}."
    )
    page.code('model = motion.ScoringModel(made.performances(), made.scores)\nmodel.save("model.json")\n')


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    dive, _ = measurements.pike
    markers = motion.MarkerSet.joint_centres(dive.dive.diver.model)
    flight = motion.SyntheticFlight(dive.dive.diver.model, dive.t, dive.q)
    made = motion.SyntheticSet(flight, markers, n_dives=_DIVES, seed=1)
    page.lead(
        f"The scoring of 4.1 from end to end, on {_LABEL} dives with a {_LABEL} judge, since no"
        " set of judged"
        " dives is"
        " public: predictions of dives that a model has not seen, with error bars and simple predictors"
        " beside"
        " them, and the four panels of Figure 4.1."
    )
    _making(page, made)
    _validating(page, made)
    _figure(page, made, dive, markers)
    _generated(page, made, dive, markers)
