"""The identity of a sweep: whatever its function reaches, a record of something else is never taken for its
own."""

import functools
import importlib
import json
import multiprocessing
import os
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import sweep
from somersault.errors import InputError

#: A study in a file: what follows `CHANGED` is what a test changes.
STUDY = """
import dataclasses
import enum
import functools
import somersault
import study_helpers
from study_helpers import IMPORTED, imported

FACTOR = 2.0
TABLE = {"a": [1.0, 2.0]}

class Kind(enum.Enum):
    ONE = 1.0

@dataclasses.dataclass
class Options:
    scale: float = 1.5

class Machine:
    rate = 3.0
    def __init__(self, gain):
        self.gain = gain
    def step(self, x):
        return self.gain * self.inner(x) * self.rate
    def inner(self, x):
        return x + 1.0
    def __call__(self, x):
        return self.step(x)

def helper(x):
    return deeper(x) + 1.0

def deeper(x):
    return 2.0 * x

def enclosing(factor):
    def inner(x):
        return factor * x
    return inner

def closure():
    return enclosing(2.0)

def method():
    return Machine(2.0).step

def instance():
    return Machine(2.0)

def of_global(x):
    return FACTOR * x

def of_table(x):
    return TABLE["a"][1] * x

def of_default(x, factor=2.0):
    return factor * x

def of_keyword_default(x, *, factor=2.0):
    return factor * x

def of_helper(x):
    return helper(x)

def of_module(x):
    return study_helpers.CONSTANT * study_helpers.function(x)

def of_imported(x):
    return IMPORTED * imported(x)

def of_late_import(x):
    from study_helpers import CONSTANT
    return CONSTANT * x

def of_lambda(x):
    return (lambda y: y * 2.0)(x)

def of_enum(x):
    return Kind.ONE.value * x

def of_dataclass(x):
    return Options().scale * x

@functools.lru_cache
def cached(x):
    return 2.0 * x

def of_cached(x):
    return cached(x)

def decorated_by(function):
    @functools.wraps(function)
    def outer(x):
        return function(x) + 0.5
    return outer

@decorated_by
def decorated(x):
    return 2.0 * x

def partial():
    return functools.partial(of_keyword_default, factor=3.0)

BODY = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
def of_body(x):
    return BODY.mass * x
"""
HELPERS = """
CONSTANT = 2.0
IMPORTED = 3.0
SECOND = 1.0
def function(x):
    return x + SECOND
def imported(x):
    return x - SECOND
"""

#: What reaches what: the function, whether it is made by a call, and the text of which file is changed to
#: what.
CHANGES = {
    "closure": ("closure", True, "study", "enclosing(2.0)", "enclosing(2.5)"),
    "`self`": ("method", True, "study", "return Machine(2.0).step", "return Machine(2.5).step"),
    "attribute of a class": ("method", True, "study", "rate = 3.0", "rate = 3.5"),
    "another method": ("method", True, "study", "return x + 1.0", "return x + 1.5"),
    "callable object": ("instance", True, "study", "return Machine(2.0)\n", "return Machine(2.5)\n"),
    "global": ("of_global", False, "study", "FACTOR = 2.0", "FACTOR = 2.5"),
    "inside of a global": ("of_table", False, "study", "[1.0, 2.0]", "[1.0, 2.5]"),
    "default": ("of_default", False, "study", "(x, factor=2.0)", "(x, factor=2.5)"),
    "keyword default": ("of_keyword_default", False, "study", "*, factor=2.0", "*, factor=2.5"),
    "helper": ("of_helper", False, "study", "deeper(x) + 1.0", "deeper(x) + 1.5"),
    "helper of a helper": (
        "of_helper",
        False,
        "study",
        "return 2.0 * x\n\ndef enclosing",
        "return 2.5 * x\n\ndef enclosing",
    ),
    "constant of a module": ("of_module", False, "study_helpers", "CONSTANT = 2.0", "CONSTANT = 2.5"),
    "function of a module": ("of_module", False, "study_helpers", "x + SECOND", "x + 2 * SECOND"),
    "what that reaches": ("of_module", False, "study_helpers", "SECOND = 1.0", "SECOND = 1.5"),
    "imported constant": ("of_imported", False, "study_helpers", "IMPORTED = 3.0", "IMPORTED = 3.5"),
    "imported function": ("of_imported", False, "study_helpers", "x - SECOND", "x - 2 * SECOND"),
    "import in the call": ("of_late_import", False, "study_helpers", "CONSTANT = 2.0", "CONSTANT = 2.5"),
    "code": ("of_global", False, "study", "return FACTOR * x", "return FACTOR + x"),
    "function inside": ("of_lambda", False, "study", "y * 2.0", "y * 2.5"),
    "enumeration": ("of_enum", False, "study", "ONE = 1.0", "ONE = 1.5"),
    "dataclass": ("of_dataclass", False, "study", "scale: float = 1.5", "scale: float = 2.5"),
    "cached function": (
        "of_cached",
        False,
        "study",
        "def cached(x):\n    return 2.0",
        "def cached(x):\n    return 2.5",
    ),
    "decorator": ("decorated", False, "study", "function(x) + 0.5", "function(x) + 0.6"),
    "decorated": (
        "decorated",
        False,
        "study",
        "def decorated(x):\n    return 2.0",
        "def decorated(x):\n    return 2.5",
    ),
    "partial": ("partial", True, "study", "factor=3.0", "factor=3.5"),
    "under a partial": (
        "partial",
        True,
        "study",
        "return factor * x\n\ndef of_helper",
        "return factor + x\n\ndef of_helper",
    ),
    "body": ("of_body", False, "study", "box(1.0", "box(1.5"),
}


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., ModuleType]]:
    """Imports the study anew, with a change in one of its files."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    names = ("study", "study_helpers")

    def load(changed: str = "", old: str = "", new: str = "") -> ModuleType:
        for name, text in zip(names, (STUDY, HELPERS), strict=True):
            if name == changed:
                assert text.count(old) >= 1
                text = text.replace(old, new)
            (tmp_path / f"{name}.py").write_text(text)
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("study")

    yield load
    for name in names:
        sys.modules.pop(name, None)


@pytest.mark.parametrize("what", CHANGES)
def test_what_the_function_reaches_is_its_identity(
    tmp_path: Path, study: Callable[..., ModuleType], what: str
) -> None:
    name, is_made, file, old, new = CHANGES[what]

    def function(module: ModuleType) -> Callable[..., Any]:
        found = getattr(module, name)
        return found() if is_made else found  # type: ignore[no-any-return]

    points = sweep.grid(x=[1.0, 2.0])
    whole = sweep.run(function(study()), points, directory=tmp_path / "records")
    # the same study, imported again, goes on where it was
    assert sweep.run(function(study()), points, directory=tmp_path / "records") == whole
    changed = function(study(file, old, new))
    assert sweep.run(changed, points) != whole
    with pytest.raises(InputError, match="records of another sweep: function is"):
        sweep.run(changed, points, directory=tmp_path / "records")


def test_the_pattern_of_the_readme_does_not_return_what_another_body_did(tmp_path: Path) -> None:
    def study(lengths: tuple[float, float, float]) -> Callable[..., Any]:
        body = somersault.RigidBody.box(1.0, lengths)
        return lambda spin: (
            somersault.exact.FreeBody(body, somersault.State(angular_velocity=(0, spin, 0.1)))(9.0).quaternion
        )

    points = sweep.grid(spin=[2.0])
    one = sweep.run(study((0.2, 0.4, 0.6)), points, directory=tmp_path / "a")
    assert sweep.run(study((0.2, 0.4, 0.6)), points, directory=tmp_path / "a") == one
    with pytest.raises(InputError, match="function is"):
        sweep.run(study((0.2, 0.4, 0.5)), points, directory=tmp_path / "a")


def enclosing(value: Any) -> Callable[..., Any]:
    return lambda x: value


def iterator() -> Iterator[int]:
    yield 1


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (enclosing(threading.Lock()), "`value` that .* encloses is a _thread.lock"),
        (enclosing([1, {"a": iterator()}]), r"`value` that .* encloses\[1\]\['a'\] is a builtins.generator"),
        (lambda x: eval("x"), "calls `eval`"),
        (lambda x: os.environ["X"], "reads the environment by `environ`"),
        (functools.partial(enclosing, threading.Event()), "is a _thread.lock"),
    ],
    ids=["lock", "generator", "eval", "environment", "partial"],
)
def test_what_cannot_be_represented_asks_for_a_version(
    tmp_path: Path, function: Callable[..., Any], message: str
) -> None:
    with pytest.raises(InputError, match=f"{message}.*: give `version`"):
        sweep.run(function, [{"x": 1}], directory=tmp_path / "a")
    assert not (tmp_path / "a").exists()
    if not isinstance(function, functools.partial):
        assert len(sweep.run(function, [], directory=tmp_path / "a", version="1")) == 0


def test_a_version_stands_for_the_function_but_not_for_bound_arguments(tmp_path: Path) -> None:
    def scaled(x: float, factor: float) -> float:
        return factor * x

    points = sweep.grid(x=[1.0])
    arguments: dict[str, Any] = {"directory": tmp_path / "a", "version": "1"}
    sweep.run(functools.partial(scaled, factor=2.0), points, **arguments)
    with pytest.raises(InputError, match="bound_sha256"):
        sweep.run(functools.partial(scaled, factor=3.0), points, **arguments)


def test_the_identity_is_that_of_every_process(tmp_path: Path) -> None:
    """Sets and dictionaries have another order where hashes of text have another seed."""
    program = textwrap.dedent("""
        import sys
        from somersault import sweep
        NAMES = {"rkmk", "dmv2", "euler", "heun"}
        def is_known(x):
            return x in NAMES and x not in {"a", "b", "c"}
        sweep.run(is_known, sweep.grid(x=["rkmk", "ab4"]), directory=sys.argv[1])
    """)
    (tmp_path / "program.py").write_text(program)
    import os
    import subprocess

    for seed in ("1", "2", "3"):
        command = [sys.executable, str(tmp_path / "program.py"), str(tmp_path / "a")]
        subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": seed})


def double(x: float) -> float:
    return 2.0 * x


def test_a_record_with_another_number_is_computed_again(tmp_path: Path) -> None:
    points = sweep.grid(x=[1.0, 2.0])
    found = sweep.run(double, points, directory=tmp_path / "a")
    for path in (tmp_path / "a").glob("records/*/*.json"):
        record = json.loads(path.read_bytes())
        record["value"] = 7.0
        path.write_text(json.dumps(record))
    assert sweep.read(tmp_path / "a").missing == [0, 1]
    assert sweep.run(double, points, directory=tmp_path / "a") == found


def test_sweeps_with_arrays_and_nan_can_be_compared() -> None:
    def values(x: float, last: float = np.nan) -> dict[str, Any]:
        motion = somersault.exact.FreeBody(
            somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6)), somersault.State(velocity=(x, 0.0, 0.0))
        )
        return {
            "array": np.array([x, last]),
            "number": last,
            "motion": motion([0.0, 1.0]),
            "pair": (x, [last]),
        }

    points = [{"x": 1.0, "y": np.nan} for _ in range(2)]
    one, again = (sweep.run(lambda x, y: values(x), points) for _ in range(2))
    assert one == again
    assert one != sweep.run(lambda x, y: values(x, 0.0), points)
    assert one != sweep.run(lambda x, y: values(2.0), points)
    assert one != sweep.run(lambda x, y: np.zeros(2), points)
    assert sweep.run(lambda: np.zeros(2), [{}]) != sweep.run(lambda: np.zeros(3), [{}])
    assert one != 3


def _run_here(directory: str, results: Any) -> None:
    found = sweep.run(double, sweep.grid(x=[1.0, 2.0, 3.0]), directory=directory)
    results.put(found.values)


@pytest.mark.skipif(sys.platform == "win32", reason="processes are only spawned there")
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("start_method", ["fork", "spawn", "forkserver"])
def test_records_of_this_process_are_those_of_its_children(tmp_path: Path, start_method: str) -> None:
    here = sweep.run(double, sweep.grid(x=[1.0, 2.0, 3.0]), directory=tmp_path / "a")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.json")}
    context: Any = multiprocessing.get_context(start_method)
    results = context.Queue()
    for directory in ("a", "b"):
        child = context.Process(target=_run_here, args=(str(tmp_path / directory), results))
        child.start()
        assert results.get(timeout=60) == here.values
        child.join(timeout=60)
        assert child.exitcode == 0
    for path, content in before.items():
        assert path.read_bytes() == content
        other = tmp_path / "b" / path.relative_to(tmp_path / "a")
        assert other.read_bytes() == content
