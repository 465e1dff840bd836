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


def _times(output: str, least: dict[str, float]) -> None:
    """Keeps the least time of each name."""
    for line in output.splitlines():
        name, time = line.split()
        least[name] = min(least.get(name, float("inf")), float(time))


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Microseconds per call; the two programs take turns."""
    import pinocchio

    program = _compiled()
    if program is None:
        return [], "## Dynamics of the diver\n\nNot run: no C++ compiler to call Pinocchio from.\n"
    ours: dict[str, float] = {}
    theirs: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        urdf, text = Path(folder) / "diver.urdf", Path(folder) / "diver.txt"
        urdf.write_text(_run([*EXAMPLE, "--", "urdf"]))
        model = pinocchio.buildModelFromUrdf(str(urdf), pinocchio.JointModelFreeFlyer())
        model.saveToText(str(text))
        for _ in range(repetitions):
            _times(_run(EXAMPLE), ours)
            _times(_run([str(program), str(text)]), theirs)
    rows: list[dict[str, object]] = [
        {"name": name, "somersault_us": ours[name], "pinocchio_us": theirs[name]} for name in ours
    ]
    head = (
        f"## Dynamics of the spatial diver: {model.nv} degrees of freedom, free root\n\n"
        "Least time of a call, Rust against C++ (Pinocchio as packaged, the faster of its two conventions); "
        "both without instructions beyond the baseline of the processor's family, but for `_many`: a state "
        "of 256, here in one call with the vector instructions of the processor, there in a loop.\n\n"
    )
    return rows, head + table(
        ["", "somersault, µs", f"Pinocchio {pinocchio.__version__}, µs", "times as fast"],
        [
            [name, f"{ours[name]:.2f}", f"{theirs[name]:.2f}", f"{theirs[name] / ours[name]:.2f}"]
            for name in ours
        ],
    )
