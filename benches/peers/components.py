"""Principal components of 16 × 100,000 numbers, against the singular values of NumPy's LAPACK.

Both take the same matrix in the same process, in turns, with as many threads each: pools of threads are
sized when a process begins, so that every number of threads has a process of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from typing import Any

import numpy as np
from measure import interleaved, table

from somersault import motion

SHAPE = (16, 100_000)
POOLS = (
    "RAYON_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def measure(repetitions: int) -> dict[str, Any]:
    """Seconds on the wall clock of each, and the largest difference between what they find."""
    samples = np.random.default_rng(16).normal(size=SHAPE)
    n = SHAPE[0] - 1

    def numpy() -> Any:
        return np.linalg.svd(samples - samples.mean(axis=0), full_matrices=False)

    times = interleaved(
        {"somersault.motion.Pca": lambda: motion.Pca(samples, n), "numpy.linalg.svd": numpy},
        repetitions,
        time.perf_counter,
    )
    found, (_, singular, components) = motion.Pca(samples, n), numpy()
    signs = np.sign(np.sum(found.components * components[:n], axis=1))[:, None]
    apart = float(np.abs(found.components - signs * components[:n]).max())
    variance = singular[:n] ** 2 / n
    return {
        "seconds": times,
        "components_apart": apart,
        "variance_apart": float(np.abs(found.explained_variance / variance - 1).max()),
    }


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """With one thread and with one for each core."""
    rows: list[dict[str, object]] = []
    for threads in sorted({1, os.cpu_count() or 1}):
        pools = dict.fromkeys(POOLS, str(threads))
        run = subprocess.run(
            [sys.executable, __file__, str(repetitions)],
            env={**os.environ, **pools},
            check=True,
            capture_output=True,
            text=True,
        )
        found = json.loads(run.stdout)
        seconds = found["seconds"]
        rows += [
            {
                "name": name,
                "threads": threads,
                "milliseconds": seconds[name] * 1e3,
                "time_against_numpy": seconds[name] / seconds["numpy.linalg.svd"],
                "components_apart": found["components_apart"],
                "variance_apart": found["variance_apart"],
            }
            for name in seconds
        ]
    lines = [
        [
            str(row["name"]),
            str(row["threads"]),
            f"{row['milliseconds']:.3g}",
            f"{row['time_against_numpy']:.3g}",
            f"{row['components_apart']:.1e}",
        ]
        for row in rows
    ]
    header = ["", "threads", "ms", "time / NumPy", "components apart"]
    return rows, f"## Principal components of {SHAPE[0]} × {SHAPE[1]}\n\n" + table(header, lines)


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]))))
