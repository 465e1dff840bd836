"""The package: stub, documentation, command line."""

import doctest
import importlib
import inspect
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import public_names
import pytest
import stubs

import somersault
from somersault import _somersault

ROOT = Path(__file__).parents[2]


def documented() -> Iterator[tuple[str, Any]]:
    """Everything public in the extension, with its members."""
    for name, thing in sorted(public_names.extension().items()):
        yield name, thing
        if inspect.isclass(thing):
            for member, value in sorted(vars(thing).items()):
                if not member.startswith("_"):
                    yield f"{name}.{member}", value


def test_everything_is_documented() -> None:
    assert not [name for name, thing in documented() if not inspect.getdoc(thing)]


@pytest.mark.parametrize("name", public_names.modules())
def test_modules_are_documented_and_export_what_they_have(name: str) -> None:
    module = importlib.import_module(name)
    assert module.__doc__
    for exported in module.__all__:
        assert getattr(module, exported) is not None


def test_the_examples_of_the_readme_hold() -> None:
    found = doctest.testfile(str(ROOT / "README.md"), module_relative=False, encoding="utf-8")
    assert found.attempted > 0
    assert found.failed == 0


def test_the_modules_of_the_extension_are_imported_by_their_names() -> None:
    program = "\n".join(
        f"""
from somersault._somersault import {name} as attribute
import somersault._somersault.{name} as module
assert module is attribute
assert module.__name__ == "somersault._somersault.{name}"
assert all(getattr(module, listed).__module__.startswith("somersault") for listed in module.__all__)
"""
        for name in sorted({*_somersault.__all__} - {"__version__"})
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_stubs_are_up_to_date() -> None:
    for path, text in stubs.stubs().items():
        assert path.read_text(encoding="utf-8") == text, f"`make public-names` writes {path.name} anew"


def test_the_stubs_are_the_modules() -> None:
    checked = subprocess.run(
        [
            *(sys.executable, "-m", "mypy.stubtest"),
            *("--mypy-config-file", str(ROOT / "pyproject.toml"), "somersault._somersault"),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "somersault", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_command_line_prints_the_methods() -> None:
    shown = run("methods")
    assert shown.returncode == 0
    assert shown.stdout.strip() == str(somersault.methods())


def test_the_command_line_says_what_it_can_do() -> None:
    assert run("--version").stdout.strip() == f"somersault {somersault.__version__}"
    assert "{methods,integrate,dive,score,analyse,view,bench,exam,schema}" in run("--help").stdout
    assert run("somersault").returncode == 2


def test_plotting_and_the_viewer_are_attributes_imported_when_first_used() -> None:
    program = """
import sys, somersault
assert {"plotting", "viewer"} <= set(dir(somersault))
assert not {"matplotlib", "scipy.spatial"} & set(sys.modules)
somersault.viewer.Scene("A box")
assert "matplotlib" not in sys.modules
somersault.plotting.style("rk4")
try:
    somersault.plots
except AttributeError as error:
    assert "'plots'" in str(error)
else:
    raise AssertionError
"""
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_importing_it_takes_less_than_numpy() -> None:
    # a ratio, since machines differ
    program = """
from time import process_time
start = process_time()
import numpy
between = process_time()
import somersault
print((process_time() - between) / (between - start))
"""
    command = [sys.executable, "-c", program]
    ratios = [float(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(3)]
    assert min(ratios) < 0.8
