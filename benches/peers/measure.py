"""Timing, tuning and the machine."""

from __future__ import annotations

import math
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import somersault

PACKAGES = ("numpy", "scipy", "numba", "heyoka", "mujoco", "pin", "casadi")


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
) -> dict[str, float]:
    """The median seconds of each run, taken in turns so that a busy machine troubles all alike.

    The clock is that of the processor, since on a busy machine the wall clock also counts the turns of
    others, and more of them for a longer run; runs on several cores need `time.perf_counter`. A run shorter
    than a millisecond is repeated within a sample.
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


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [list(header), ["---"] + ["---:"] * (len(header) - 1), *map(list, rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
