"""Which method when: what the measurements say, for the index."""

from __future__ import annotations

from collections.abc import Mapping

from tour.chapters.accuracy import milliseconds
from tour.measurements import Measurements
from tour.page import Page, power, words
from tour.runs import Runs

TARGETS = (1e-2, 1e-5, 1e-8)


def _adapted(runs: Mapping[str, Runs]) -> dict[str, Runs]:
    return {f"{name} adapted": run for name, run in runs.items()}


def _quickest(runs: Mapping[str, Runs], target: float) -> str:
    """The quickest method and its time, with those that are within a tenth of it."""
    times = {name: run.seconds_to(target) for name, run in runs.items()}
    best = min(times.values())
    if best == float("inf"):
        return "none"
    near = sorted((name for name in times if times[name] <= 1.1 * best), key=lambda name: times[name])
    return f"{', '.join(near)} ({milliseconds(best)} ms)"


def summary(page: Page, measurements: Measurements) -> None:
    """The table of choices."""
    infos = measurements.methods
    general = [info.name for info in infos if info.scope != "torque-free"]
    rod, box = measurements.accuracy[1], measurements.accuracy[2]
    twisting = {**box, **_adapted(measurements.adapted)}
    hanging = {**measurements.forced, **_adapted(measurements.forced_adapted)}
    rows = [
        ("a free body", rod),
        ("a free body that twists", twisting),
        ("a free body, by a method that also accepts torques", {name: rod[name] for name in general}),
        ("a body under torque and damping", hanging),
    ]
    page.section("Which method when")
    page.table(
        (words("the motion"), *(words(f"to {power(target)} rad") for target in TARGETS)),
        [[words(title), *(words(_quickest(runs, target)) for target in TARGETS)] for title, runs in rows],
        "The quickest to an orientation error at the end, and what comes within a tenth of its time: cases 1"
        " and 2 of the thesis (10 s) and the hanging box (2 s), with fixed steps three to a decade or adapted"
        " to tolerances one to a decade. From the"
        ' measurements of <a href="accuracy.html">accuracy</a> and <a href="beyond.html">beyond the'
        " thesis</a>.",
    )
    steady = [
        name
        for name, run in sorted(measurements.long_runs.items(), key=lambda item: item[1].energy_late)
        if run.energy_late < 1e-9 and run.momentum_late < 1e-9
    ]
    stable = [
        name for name, study in measurements.energy.items() if study.behaviour == "unconditionally stable"
    ]
    page.items(
        (
            (
                f"Over {measurements.setting.long_steps:,} steps energy and angular momentum stay within 10⁻⁹"
                f" with {', '.join(steady) or 'none'}."
            ),
            (
                "In steps as large as 1 s at 1 rad/s the energy of a free body never grows with"
                f' {", ".join(stable)} (<a href="energy.html">stability of the rotation</a>); that does not'
                " make such steps accurate."
            ),
        )
    )
