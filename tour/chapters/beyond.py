"""Methods that the thesis does not have, and motions that it does not integrate."""

from __future__ import annotations

from somersault import plotting
from tour import thesis
from tour.chapters.accuracy import milliseconds
from tour.measurements import Measurements
from tour.page import Page, error_size, power, words

TITLE = "Later methods, and forces"


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    names = [info.name for info in measurements.methods if (info.orders["rotation"] or 0) >= 4]
    runs = measurements.accuracy[2]
    best = min(names, key=lambda name: runs[name].seconds_to(1e-8))
    ratio = runs["rkmk"].seconds_to(1e-8) / runs[best].seconds_to(1e-8)
    page.lead(
        f"To 10⁻⁸ rad in case 2 the quickest is {best}, {ratio:.0f} times as fast as the thesis' best method."
        if ratio < float("inf")
        else (
            f"To 10⁻⁸ rad in case 2 the quickest is {best}; the thesis' best method is not accurate enough in"
            " any of the runs."
        )
    )
    page.section("High orders on a free body")
    page.figure(
        "high-orders",
        plotting.work_precision_diagram({name: runs[name] for name in names}),
        "Case 2 again, with all methods of order 4 and above. RKMK is the thesis' best; preprocessed "
        "Moser–Veselov methods (PMV) cost the same at any order, since what raises it is prepared once for "
        "each motion. They are for bodies without torque.",
        "Orientation error against computation time; the preprocessed methods fall steepest",
    )
    page.section("Adapted steps")
    fixed = {name: runs[name] for name in (best, "rkmk_b")}
    page.figure(
        "adapted",
        plotting.work_precision_diagram({**measurements.adapted, **fixed}),
        "Case 2 with steps adapted to tolerances from 10⁻³ to 10⁻¹³, beside fixed steps of"
        f" {plotting.abbreviation(best)} and RKMK_B.",
        "Orientation error against computation time of the embedded pairs",
    )
    page.section("Under torque")
    forced = measurements.forced
    orders = {info.name: info.orders["rotation_with_torque"] or 0 for info in measurements.methods}
    shown = [name for name in forced if name in thesis.METHODS or orders[name] >= 3]
    page.text(
        "A box of 1 kg hangs by a corner from a damped spring, in gravity and a light drag, for 2 s. The"
        " spring turns the box, and the forces depend on the velocity: the general case, where some methods"
        " lose an order and those for free bodies do not apply."
    )
    page.figure(
        "forced",
        plotting.work_precision_diagram({name: forced[name] for name in measurements.names if name in shown}),
        "Orientation error of the hanging box against computation time, with fixed steps: the thesis'"
        " methods, and all of order 3 and above under torque.",
        "Orientation error against computation time, methods in bundles by their order",
    )
    targets = (1e-3, 1e-6, 1e-9)
    hung = {**forced, **{f"{name}, adapted": run for name, run in measurements.forced_adapted.items()}}
    quickest = sorted(hung, key=lambda name: hung[name].seconds_to(1e-6))[:10]
    page.table(
        (words("method"), *(f"{power(target)} rad" for target in targets)),
        [
            [words(name), *(milliseconds(hung[name].seconds_to(target)) for target in targets)]
            for name in quickest
        ],
        "Milliseconds to an orientation error of the hanging box, the ten quickest to 10⁻⁶ rad; fixed steps"
        " unless adapted.",
    )
    _long(page, measurements)


def _long(page: Page, measurements: Measurements) -> None:
    runs = measurements.long_runs
    lost = [plotting.abbreviation(name) for name in measurements.names if name not in runs]
    steps = measurements.setting.long_steps
    page.section("A long run")
    page.text(
        f"The tumbling box for {steps:,} steps of 0.05 s. A method without drift has the same error in the"
        " last tenth as in the first."
    )
    page.table(
        (
            words("method"),
            "energy, first tenth",
            "last tenth",
            "angular momentum, first tenth",
            "last tenth",
            "ns per step",
            words(""),
        ),
        [
            [
                words(name),
                error_size(run.energy_early),
                error_size(run.energy_late),
                error_size(run.momentum_early),
                error_size(run.momentum_late),
                f"{run.nanoseconds:.0f}",
                words("drifts" if run.drifts else "bounded"),
            ]
            for name, run in sorted(runs.items(), key=lambda item: item[1].energy_late)
        ],
        "Largest relative errors; bounded where neither is more than three times what it was in the first"
        " tenth, rounding (10⁻¹²) aside." + (f" Numbers overflowed with {', '.join(lost)}." if lost else ""),
    )
