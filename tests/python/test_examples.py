"""Examples: whatever a user calls directly has one, and all of them hold."""

import doctest
import importlib
import inspect
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import public_names
import pytest
from matplotlib import pyplot as plt

#: Made by what a user calls, and shown in its example: nobody calls these classes.
RESULTS = (
    "ArmExtremal",
    "ExamReport",
    "ExamScene",
    "ExponentConvergence",
    "Failure",
    "FlightAnalysis",
    "FtleField",
    "LyapunovSpectrum",
    "MinimizeResult",
    "Ridge",
    "SceneContact",
    "SceneGuard",
    "SceneHinge",
    "SceneMode",
    "SceneResult",
    "Sweep",
    "TracedForce",
)
#: The program, whose examples are the commands on the pages of the book; `test_book` runs them.
PROGRAMS = ("somersault.cli.main",)
#: What is drawn by a browser, which may not be installed; `test_viewer_browser` does it.
BY_A_BROWSER = ("Scene.export",)


def called() -> Iterator[tuple[str, Any]]:
    """The functions, classes with a constructor and methods that are public, each once."""
    seen = set()
    for path, thing in public_names.things().items():
        if inspect.ismodule(thing) or id(thing) in seen or path in PROGRAMS:
            continue
        seen.add(id(thing))
        if not inspect.isclass(thing):
            if callable(thing):
                yield path, thing
        elif not issubclass(thing, BaseException):
            if _is_constructed(thing):
                yield path, thing
            yield from _methods(path, thing)


def _is_constructed(kind: type) -> bool:
    """Whether users construct objects; a class of the extension without a constructor has no signature."""
    by_python = "__init__" in vars(kind) and not inspect.isabstract(kind)
    by_extension = kind.__new__ is not object.__new__ and kind.__text_signature__ is not None
    return (by_python or by_extension) and kind.__name__ not in RESULTS


def _methods(path: str, kind: type) -> Iterator[tuple[str, Any]]:
    """The methods that a class adds to those of its base."""
    for name, member in vars(kind).items():
        is_method = callable(member) or isinstance(member, classmethod | staticmethod)
        if is_method and not name.startswith("_") and f"{kind.__name__}.{name}" not in BY_A_BROWSER:
            yield f"{path}.{name}", getattr(kind, name)


def documented() -> Iterator[tuple[str, str]]:
    """The modules, and everything public in them with its members, that have examples."""
    for path, thing in public_names.things().items():
        own = vars(thing).items() if inspect.isclass(thing) else ()
        members = [(f"{path}.{name}", member) for name, member in own if not name.startswith("_")]
        for name, each in [(path, thing), *members]:
            text = inspect.getdoc(each) or ""
            if ">>>" in text and not isinstance(each, str | int | float):
                yield name, text


def test_whatever_is_called_has_an_example() -> None:
    found = list(called())
    without = [path for path, thing in found if ">>>" not in (inspect.getdoc(thing) or "")]
    assert len(found) > 300
    assert not without, f"{len(without)} of {len(found)} have no example: {', '.join(without)}"


def test_what_is_exempt_is_there() -> None:
    things = public_names.things()
    names = {path.rpartition(".")[2] for path in things}
    assert set(RESULTS) <= names and set(PROGRAMS) <= set(things)
    assert hasattr(importlib.import_module("somersault.viewer").Scene, BY_A_BROWSER[0].partition(".")[2])


EXAMPLES = dict(documented())


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_hold(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mpl.use("Agg")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    example = doctest.DocTestParser().get_doctest(EXAMPLES[name], {"__name__": "example"}, name, None, 0)
    try:
        assert doctest.DocTestRunner().run(example).failed == 0
    finally:
        plt.close("all")
