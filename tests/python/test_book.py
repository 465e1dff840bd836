"""The README, the book and the notebooks: everything in them runs, and every link leads somewhere."""

import doctest
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from html import unescape
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib as mpl
import pytest
from control_problems import KNOWN

import somersault
from somersault.cli import main
from somersault.viewer import film

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "python/README.md")),
    *sorted(DOCS.rglob("*.md")),
]
NOTEBOOKS = sorted((ROOT / "python" / "notebooks").glob("*.ipynb"))

_BLOCK = re.compile(r"^```(?: \{ \.)?(\w*)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def script(name: str) -> ModuleType:
    """A program of the folder `docs`."""
    spec = spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    found = module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def skip_without(code: str) -> None:
    for names in re.findall(r"^from somersault import ([\w, ]+)", code, re.MULTILINE):
        for module in {"ftla", "motion"} & set(names.split(", ")):
            pytest.importorskip(f"somersault.{module}")


def run_python(code: str, names: dict[str, Any]) -> None:
    skip_without(code)
    if code.startswith(">>>"):
        examples = doctest.DocTestParser().get_doctest(code, names, "page", None, 0)
        assert doctest.DocTestRunner().run(examples, clear_globs=False).failed == 0
        names.update(examples.globs)
    else:
        exec(compile(code, "page", "exec"), names)


def run_shell(code: str, names: dict[str, Any]) -> None:
    """Runs our own commands; of others it checks that what they name is there."""
    makefile = (ROOT / "Makefile").read_text("utf-8")
    project = (ROOT / "pyproject.toml").read_text("utf-8")
    for line in code.splitlines():
        command, *arguments = shlex.split(line, comments=True) or [""]
        if command == "somersault":
            assert main(arguments) == 0, line
        elif command == "make":
            assert all(f"\n{target}:" in makefile for target in arguments), line
        elif arguments in (["install", "somersault"], ["install", "."]):
            assert command == "pip"
        elif arguments[:1] == ["install"]:
            extras = re.fullmatch(r"somersault\[([\w,]+)\]", arguments[1])
            assert extras and all(f"\n{name} = [" in project for name in extras[1].split(",")), line
        else:
            assert line.startswith(("cargo add somersault", "python docs/")), line


def checked_elsewhere(code: str, names: dict[str, Any]) -> None:
    """Rust by `cargo test`, which reads these pages; inputs and outputs beside the command that uses them."""


RUN: dict[str, Callable[[str, dict[str, Any]], None]] = {
    "python": run_python,
    "sh": run_shell,
    "rust": checked_elsewhere,
    "toml": checked_elsewhere,
    "json": checked_elsewhere,
    "text": checked_elsewhere,
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_code_block_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mpl.use("Agg")
    # Examples are named from the root of the repository, and what is written goes elsewhere.
    (tmp_path / "docs").symlink_to(DOCS)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "page"}
    for language, options, code in _BLOCK.findall(page.read_text("utf-8")):
        assert language in RUN, f"a block of {language or 'nothing'}"
        if "notest" not in options:
            RUN[language](code, names)


def test_pages_with_rust_are_read_by_cargo_test() -> None:
    read = (ROOT / "tests" / "lib.rs").read_text("utf-8")
    for page in PAGES:
        if "```rust" in page.read_text("utf-8"):
            assert f'include_str!("../{page.relative_to(ROOT)}")' in read


#: Leaves no names and no figures of another notebook.
_FORGET = """
import matplotlib.pyplot as plt
plt.close("all")
%reset -f
"""


@pytest.fixture(scope="module")
def kernel() -> Iterator[tuple[Any, Any]]:
    """A kernel for all notebooks and its client: a start takes longer than most of them."""
    pytest.importorskip("nbclient", reason="nbclient is not installed (extra `notebooks`)")
    manager = pytest.importorskip("jupyter_client").KernelManager(kernel_name="python3")
    manager.start_kernel(env=os.environ | {"MPLBACKEND": "agg"}, cwd=NOTEBOOKS[0].parent)
    client = manager.client()
    client.start_channels()
    yield manager, client
    client.stop_channels()
    manager.shutdown_kernel(now=True)
    manager.cleanup_resources()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_without_names_from_before(path: Path, kernel: tuple[Any, Any]) -> None:
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed (extra `notebooks`)")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(path, as_version=4)
    skip_without("\n".join(cell.source for cell in notebook.cells))
    nbformat.validate(notebook)
    stored = _shown(notebook)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(_FORGET))
    runner = nbclient.NotebookClient(notebook, km=kernel[0], timeout=120)
    runner.kc = kernel[1]
    runner.execute()
    del notebook.cells[0]
    # digits and pixels differ from machine to machine; whether a cell shows something does not
    assert _shown(notebook) == stored, "`make notebooks` runs it again"


def _shown(notebook: Any) -> list[bool]:
    """Whether each cell prints or returns something; figures are not shown without a screen."""
    outputs = [cell.get("outputs", []) for cell in notebook.cells]
    return [any(output.output_type != "display_data" for output in each) for each in outputs]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_have_their_outputs_and_are_small(path: Path) -> None:
    assert path.stat().st_size < 1_000_000
    cells = json.loads(path.read_text("utf-8"))["cells"]
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    kinds = {output["output_type"] for output in outputs}
    assert outputs and kinds <= {"stream", "display_data", "execute_result"}
    assert not [output for output in outputs if output.get("name") == "stderr"]
    assert all(cell.get("execution_count") is None and cell["metadata"] == {} for cell in cells)


def test_there_are_notebooks_that_say_what_they_show() -> None:
    assert len(NOTEBOOKS) >= 9
    for path in NOTEBOOKS:
        first = json.loads(path.read_text("utf-8"))["cells"][0]
        assert first["cell_type"] == "markdown" and first["source"][0].startswith("# ")


@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The book, built without a warning."""
    pytest.importorskip("mkdocs", reason="mkdocs is not installed (extra `docs`)")
    folder = tmp_path_factory.mktemp("book")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return folder


def test_links_of_the_book_lead_somewhere(book: Path) -> None:
    # a relative folder, as `make docs` gives it
    folder = Path(os.path.relpath(book))
    faults, followed = script("check_links").broken(folder, without=("rust",))
    assert faults == [] and followed > 500
    pages = {path.relative_to(book): path.read_text("utf-8") for path in book.rglob("*.html")}
    assert not [name for name, text in pages.items() if 'class="arithmatex"' in text or "```" in text]
    assert not [
        name for name, text in pages.items() if re.search(r'<(script|link)[^>]*(src|href)="https?:', text)
    ]
    assert not [
        name
        for name, text in pages.items()
        if re.search(r'–\s*<div class="doc-md-description">\s*</div>', text)
    ]
    assert "ẋ = f(x, u, t, p)" in pages[Path("reference/ocp.html")]


def test_the_problem_set_is_in_the_book(book: Path) -> None:
    rows = re.findall(r"<tr>(.*?)</tr>", (book / "control_problems.html").read_text("utf-8"), re.DOTALL)[1:]
    cells = [[unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)] for row in rows]
    assert [row[0] for row in cells] == list(KNOWN)
    for row, known in zip(cells, KNOWN.values(), strict=True):
        assert len(row) == 10
        polished = row[-1] in ("<code>strict_minimum</code>", "<code>first_order</code>")
        assert polished == (known.is_polished and not known.is_long), row[0]


@pytest.mark.skipif(film.browser() is None, reason=f"no browser: none of {', '.join(film.BROWSERS)}")
@pytest.mark.parametrize("page", ["index.html", "guides/contact.html"])
def test_the_book_is_searched_from_the_disk(book: Path, page: str) -> None:
    """By a word in the address, which the theme takes as if it were typed."""
    address = f"{(book / page).as_uri()}?q=saltation"
    ran = film.headless(address, "--dump-dom", "--virtual-time-budget=20000")
    assert "CONSOLE" not in ran.stderr, ran.stderr
    assert re.search(r"\d matching documents", ran.stdout), ran.stdout[:2000]
    found = re.findall(r'<a href="([^"]*)" class="md-search-result__link"', ran.stdout)
    assert any("decisions/contact.html" in link for link in found), found


def test_the_tables_of_the_book_have_every_method_once() -> None:
    pytest.importorskip("latex2mathml", reason="the extra `docs` is not installed")
    hooks = script("hooks")
    for table in ("methods", "guarantees"):
        rows = [
            line.split(" | ")[0] for line in hooks.on_page_markdown(f"<!-- insert: {table} -->").splitlines()
        ]
        named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
        assert sorted(named) == sorted(somersault.methods().names), table


def table_of(title: str) -> list[list[str]]:
    """The cells of the table in a section of the README, without its head."""
    section = (ROOT / "README.md").read_text("utf-8").partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("|")]
    assert len(rows) > 2
    return rows[2:]


def test_the_table_of_choices_is_that_of_the_methods() -> None:
    """The table in the README, which the book takes, agrees with that of the program."""
    known = somersault.methods()
    for motion, take, because in table_of("Which method when"):
        names = re.findall(r"`([\w.]+)`", take)
        assert names, motion
        for name in names:
            if name not in known.names:
                assert hasattr(somersault, name.partition(".")[0]), name
                continue
            info = known[name]
            assert "adaptive" not in take or info.adaptive, name
            assert motion.startswith("a free body") or info.scope != "torque-free", name
            assert "energy and" not in because or info.conserves != "nothing exactly", name
    pytest.importorskip("latex2mathml", reason="the extra `docs` is not installed")
    table = script("hooks").on_page_markdown("<!-- insert: which method when -->")
    assert all(cell in table for row in table_of("Which method when") for cell in row)


def test_figures_beside_other_packages_are_those_of_the_page_on_performance() -> None:
    recorded = (DOCS / "performance.md").read_text("utf-8")
    for package, _, measured, _ in table_of("Compared with"):
        for figure in re.findall(r"[\d.]*·?10⁻[⁰-⁹¹²³]+|\d+(?:\.\d+)?", measured):
            assert figure in recorded or package == "Pinocchio", f"{package}: {figure}"


def test_commands_that_pages_name_are_there() -> None:
    """Programs, benchmarks, targets and subcommands, in code and in the text."""
    makefile = (ROOT / "Makefile").read_text("utf-8")
    benches = (ROOT / "benches" / "Cargo.toml").read_text("utf-8")
    tests = (ROOT / "tests" / "Cargo.toml").read_text("utf-8")
    count = 0
    for page in [*PAGES, *ROOT.glob("*.md"), ROOT / "paper" / "paper.md"]:
        text = page.read_text("utf-8")
        for crate, example in re.findall(r"-p ([\w-]+) --example (\w+)", text):
            assert (ROOT / "crates" / crate / "examples" / f"{example}.rs").is_file(), (page, example)
            count += 1
        for name in re.findall(r"cargo bench --bench (\w+)", text):
            assert f'name = "{name}"' in benches, (page, name)
            count += 1
        for name in re.findall(r"cargo test -p somersault-tests --test (\w+)", text):
            assert f'name = "{name}"' in tests, (page, name)
        for target in re.findall(r"`make ([\w-]+)`", text):
            assert f"\n{target}:" in makefile, (page, target)
            count += 1
        for path in re.findall(r"python (?!-)([\w/]+\.py)", text):
            assert (ROOT / path).is_file(), (page, path)
            count += 1
    assert count > 20


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<a href="b.html#there">1</a><a href="c.html">2</a><a href="https://x.y">3</a>'
    )
    (tmp_path / "b.html").write_text('<h1 id="here">b</h1><img src="../out.png">')
    faults, followed = script("check_links").broken(tmp_path)
    assert followed == 3
    assert faults == ["a.html: b.html#there (no such anchor)", "a.html: c.html", "b.html: ../out.png"]


def test_the_picture_of_the_crates_is_up_to_date() -> None:
    graph = script("crate_graph")
    try:
        drawn = graph.svg()
    except FileNotFoundError:
        pytest.skip("cargo is not installed")
    assert graph.TARGET.read_text("utf-8") == drawn, "run `python docs/crate_graph.py`"


def test_pictures_are_small() -> None:
    for path in (DOCS / "images").iterdir():
        allowed = 800_000 if path.suffix == ".webp" else 150_000  # films, and still pictures
        assert path.stat().st_size < allowed, path.name
