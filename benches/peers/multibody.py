"""The dynamics of the spatial diver and their partials: this library from Rust, Pinocchio from C++."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from measure import table

HERE = Path(__file__).parent
EXAMPLE = ["cargo", "run", "--release", "--quiet", "-p", "somersault-testkit", "--example", "time_diver"]
# The flags under which the packaged library was built.
FLAGS = [
    "-O3",
    "-DNDEBUG",
    "-w",
    "-std=c++17",
    "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
]
LIBRARIES = ["-lpinocchio_default", "-lboost_serialization"]


def _run(command: list[str]) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True, cwd=HERE.parents[1]).stdout


def _compiled() -> Path | None:
    """The timing program against Pinocchio, compiled once in some minutes; nothing without a C++ compiler."""
    import pinocchio

    source, program = HERE / "pinocchio.cpp", Path(sys.prefix) / "peers" / "pinocchio"
    compiler = shutil.which(os.environ.get("CXX", "g++"))
    if compiler is None:
        return None
    if not program.exists() or program.stat().st_mtime < source.stat().st_mtime:
        prefix = next(p for p in Path(pinocchio.__file__).parents if p.name == "cmeel.prefix")
        include, lib = prefix / "include", prefix / "lib"
        program.parent.mkdir(exist_ok=True)
        paths = [f"-I{include}", f"-I{include}/eigen3", f"-L{lib}", f"-Wl,-rpath,{lib}"]
        _run([compiler, *FLAGS, *paths, str(source), "-o", str(program), *LIBRARIES])
    return program


def _times(output: str) -> dict[str, float]:
    """The least time of each name."""
    least: dict[str, float] = {}
    for line in output.splitlines():
        name, time = line.split()
        least[name] = min(least.get(name, float("inf")), float(time))
    return least


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Microseconds per call; the two programs take turns."""
    import pinocchio

    program = _compiled()
    if program is None:
        return [], "## Dynamics of the diver\n\nNot run: no C++ compiler to call Pinocchio from.\n"
    ours: list[dict[str, float]] = []
    theirs: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        urdf, text = Path(folder) / "diver.urdf", Path(folder) / "diver.txt"
        urdf.write_text(_run([*EXAMPLE, "--", "urdf"]))
        model = pinocchio.buildModelFromUrdf(str(urdf), pinocchio.JointModelFreeFlyer())
        model.saveToText(str(text))
        for _ in range(repetitions):
            ours.append(_times(_run(EXAMPLE)))
            theirs.append(_times(_run([str(program), str(text)])))
    rows: list[dict[str, object]] = []
    lines = []
    for name in ours[0]:
        mine, other = [run[name] for run in ours], [run[name] for run in theirs]
        ratios = [x / y for x, y in zip(mine, other, strict=True)]
        ratio, spread = min(mine) / min(other), [min(ratios), max(ratios)]
        least = {"somersault_us": min(mine), "pinocchio_us": min(other)}
        rows.append({"name": name, **least, "ratio": ratio, "ratios_of_runs": ratios})
        in_brackets = f"{ratio:.2f} ({spread[0]:.2f} to {spread[1]:.2f})"
        lines.append([name, *(f"{time:.2f}" for time in least.values()), in_brackets])
    head = (
        f"## Dynamics of the spatial diver: {model.nv} degrees of freedom, free root\n\n"
        f"Least time of a call in {repetitions} runs, and in brackets the least and the greatest ratio in "
        "one of them; Rust against C++ (Pinocchio as packaged, the faster of its two conventions, called "
        "from a program compiled with -O3); both without instructions beyond the baseline of the "
        "processor's family, but for `_many`: a state of 256, here in one call with the vector instructions "
        "of the processor, there in a loop.\n\n"
    )
    header = ["", "somersault, µs", f"Pinocchio {pinocchio.__version__}, µs", "of Pinocchio's time"]
    return rows, head + table(header, lines)
