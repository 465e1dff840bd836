"""Timing, tuning and the machine."""

from __future__ import annotations

import math
import os
import platform
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import somersault

PACKAGES = ("numpy", "scipy", "numba", "heyoka", "mujoco", "pin", "drake", "casadi")


@dataclass(frozen=True, eq=False)
class Contender:
    """A way to get there: `run` takes a setting, say a tolerance, and returns what is judged."""

    name: str
    setting: str
    settings: Sequence[float]
    run: Callable[[float], Any]
    runs: int = 1
    """How often a call does it."""


@cache
def program(crate: str, example: str) -> Path:
    """An example of this library, built where the workspace builds."""
    root = Path(__file__).resolve().parents[2]
    build = ["cargo", "build", "--release", "-p", crate, "--example", example]
    subprocess.run(build, cwd=root, check=True, capture_output=True)
    return root / "target/release/examples" / example


def clock() -> float:
    """Processor time of this process and of those it has run."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def machine() -> dict[str, str]:
    """Processor, cores, system and the versions of what is compared."""
    processor = platform.processor() or platform.machine()
    cpu_info = Path("/proc/cpuinfo")
    if cpu_info.exists():
        names = [line for line in cpu_info.read_text().splitlines() if line.startswith("model name")]
        processor = names[0].split(":", 1)[1].strip() if names else processor
    return {
        "processor": processor,
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "python": sys.version.split()[0],
        "somersault": somersault.__version__,
        **{name: version(name) for name in PACKAGES},
    }


def interleaved(
    runs: Mapping[str, Callable[[], object]],
    repetitions: int,
    clock: Callable[[], float] = time.process_time,
    pause: float = 0.0,
) -> dict[str, float]:
    """The median seconds of each run, taken in turns so that a busy machine troubles all alike.

    The clock is that of the processor, since on a busy machine the wall clock also counts the turns of
    others, and more of them for a longer run; runs on several cores need `time.perf_counter`. A run shorter
    than a millisecond is repeated within a sample. During a `pause` in seconds before each sample the threads
    of the run before, which still look for work, go to sleep.
    """

    def seconds(run: Callable[[], object], count: int) -> float:
        start = clock()
        for _ in range(count):
            run()
        return (clock() - start) / count

    counts = {}
    for name, run in runs.items():
        run()
        counts[name] = max(1, round(1e-3 / max(seconds(run, 1), 1e-7)))
    samples: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repetitions):
        for name, run in runs.items():
            time.sleep(pause)
            samples[name].append(seconds(run, counts[name]))
    return {name: statistics.median(values) for name, values in samples.items()}


def geometric(first: float, last: float, per_decade: int) -> list[float]:
    """From first to about last in even ratios."""
    decades = math.log10(last / first)
    count = round(abs(decades) * per_decade)
    return [first * 10 ** (decades * i / count) for i in range(count + 1)]


def coarsest(
    settings: Iterable[float], error: Callable[[float], float], target: float, in_a_row: int = 3
) -> tuple[float, float] | None:
    """The first setting, coarse to fine, from which on `in_a_row` errors meet the target, and its error.

    A single run that meets it by luck does not count.
    """
    met: list[tuple[float, float]] = []
    for setting in settings:
        found = error(setting)
        if found <= target:
            met.append((setting, found))
            if len(met) == in_a_row:
                return met[0]
        else:
            met.clear()
    return None


def race(
    contenders: Iterable[Contender],
    error: Callable[[Any], float],
    targets: Iterable[float],
    repetitions: int,
    measured: str,
) -> list[tuple[float, list[dict[str, object]], str]]:
    """For each target, each at the coarsest setting from which on two errors in a row meet it, or its finest.

    The target, rows with processor times, and those as a table against the best of this library; `measured`
    names the errors. A contender runs once at a setting for the errors, whatever the number of targets; one
    that misses the target has the time of that run.
    """
    runs_for_error = [_RunsForError(contender, error) for contender in contenders]
    return [(target, *_race_to(target, runs_for_error, repetitions, measured)) for target in targets]


class _RunsForError:
    """The errors of a contender by setting, each found once, and the seconds that the runs took."""

    def __init__(self, contender: Contender, error: Callable[[Any], float]) -> None:
        self.contender = contender
        self._error = error
        self._errors: dict[float, float] = {}
        self._seconds: dict[float, float] = {}

    def error(self, setting: float) -> float:
        if setting not in self._errors:
            start = clock()
            found = self.contender.run(setting)
            self._seconds[setting] = clock() - start
            self._errors[setting] = self._error(found)
        return self._errors[setting]

    def seconds(self, setting: float) -> float:
        self.error(setting)
        return self._seconds[setting]


def _race_to(
    target: float, runs_for_error: Iterable[_RunsForError], repetitions: int, measured: str
) -> tuple[list[dict[str, object]], str]:
    rows: list[dict[str, Any]] = []
    runs: dict[str, Callable[[], object]] = {}
    seconds: dict[str, float] = {}
    counts: dict[str, int] = {}
    for once in runs_for_error:
        contender = once.contender
        last = contender.settings[-1]
        found = coarsest(contender.settings, once.error, target, in_a_row=2)
        setting, reached = found or (last, once.error(last))
        name = contender.name if found else f"{contender.name}: not reached"
        rows.append({"name": name, "setting": contender.setting, "value": setting, "error": reached})
        counts[name] = contender.runs
        if found:
            runs[name] = partial(contender.run, setting)
        else:
            seconds[name] = once.seconds(setting)
    seconds |= interleaved(runs, repetitions, clock)
    best = min(seconds[name] / counts[name] for name in runs if name.startswith("somersault"))
    for row in rows:
        row["seconds"] = seconds[row["name"]] / counts[row["name"]]
        row["time_against_best"] = row["seconds"] / best
    lines = [
        [
            row["name"],
            f"{row['value']:.3g} {row['setting']}",
            f"{row['error']:.1e}",
            f"{row['seconds'] * 1e3:.3g}",
            f"{row['time_against_best']:.3g}",
        ]
        for row in rows
    ]
    return rows, table(["", "setting", measured, "ms", "time / best"], lines)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [list(header), ["---"] + ["---:"] * (len(header) - 1), *map(list, rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
