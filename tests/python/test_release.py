"""What is published: metadata agree, packages have their files, workflows run what is there."""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import address
import licences
import pytest
import version

ROOT = Path(__file__).parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
CRATES = sorted(
    path.parent
    for path in (ROOT / "crates").glob("*/Cargo.toml")
    if "publish = false" not in path.read_text("utf-8")
)
NAMES = [path.name for path in CRATES]


def read(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


def sources() -> list[Path]:
    """The files of the repository that a person writes."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    try:
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (FileNotFoundError, subprocess.CalledProcessError):
        pytest.skip("this is no clone of the repository")
    return [ROOT / name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]


def field(crate: Path, name: str) -> str:
    found = re.search(rf"^{name} = (.*)$", (crate / "Cargo.toml").read_text("utf-8"), re.MULTILINE)
    assert found, f"{crate.name} has no {name}"
    return found[1]


#: What crates share is a link in each of them.
linked = pytest.mark.skipif(sys.platform == "win32", reason="links may be text there")


@linked
@pytest.mark.parametrize("crate", CRATES, ids=NAMES)
def test_every_crate_has_its_licences_and_a_readme_that_is_its_documentation(crate: Path) -> None:
    for name in ("LICENSE-MIT", "LICENSE-APACHE"):
        assert (crate / name).read_text("utf-8") == read(name)
    readme = (crate / "README.md").read_text("utf-8")
    assert readme.startswith(f"# {crate.name}\n") and "```rust\n" in readme
    library = (crate / "src" / "lib.rs").read_text("utf-8")
    assert library.startswith('#![doc = include_str!("../README.md")]\n')
    assert len(re.findall(r"!?\[[^]]*\]\((?!https://)", readme)) == 0, (
        "a link that leads nowhere on crates.io"
    )


@pytest.mark.parametrize("crate", CRATES, ids=NAMES)
def test_every_crate_says_what_registries_show(crate: Path) -> None:
    words, shelves = (re.findall(r'"([^"]+)"', field(crate, name)) for name in ("keywords", "categories"))
    # what crates.io takes
    assert len(words) == 5 and all(re.fullmatch(r"[A-Za-z0-9][\w+-]{0,19}", word) for word in words)
    assert shelves and set(shelves) <= {"mathematics", "science", "science::robotics", "simulation"}
    assert field(crate, "documentation") == f'"https://docs.rs/{crate.name}"'
    assert field(crate, "readme") == '"README.md"'
    assert len(field(crate, "description")) > 40
    for name in ("version", "license", "repository", "homepage", "authors", r"rust-version"):
        assert field(crate, rf"{name}\.workspace") == "true"


@linked
@pytest.mark.parametrize("crate", CRATES, ids=NAMES)
def test_docs_rs_draws_the_formulas_of_every_crate(crate: Path) -> None:
    text = (crate / "Cargo.toml").read_text("utf-8")
    assert "[package.metadata.docs.rs]\nall-features = true\n" in text
    has = any("```math" in path.read_text("utf-8") for path in (crate / "src").rglob("*.rs"))
    assert has == ('rustdoc-args = ["--html-in-header", "katex.html"]' in text)
    assert has == (crate / "katex.html").is_file()
    if has:
        assert (crate / "katex.html").read_text("utf-8") == read("docs/katex.html")


def test_the_formulas_of_the_crates_become_mathml_in_the_book() -> None:
    pytest.importorskip("latex2mathml", reason="the extra `docs` is not installed")
    formulas = importlib.import_module("formulas")
    count = 0
    for path in (ROOT / "crates").rglob("src/**/*.rs"):
        for block in re.findall(r"//! ```math\n((?://!.*\n)+?)//! ```", path.read_text("utf-8")):
            latex = (
                re.sub(r"^//! ?", "", block, flags=re.MULTILINE).replace("&", "&amp;").replace("<", "&lt;")
            )
            page = f'<div><pre class="language-math"><code>{latex}</code></pre></div>'
            drawn = formulas.with_mathml(page)
            assert drawn.startswith("<div><math") and "\\" not in drawn, path
            count += 1
    assert count >= 9
    for latex, unknown in ((r"\begin{aligned} a &= b \end{aligned}", "&"), (r"\arg x", r"\\arg")):
        with pytest.raises(ValueError, match=f"^{unknown} is not drawn, in "):
            formulas.mathml(latex, "block")


@pytest.mark.parametrize("crate", CRATES, ids=NAMES)
def test_packages_hold_licences_readme_and_header(crate: Path) -> None:
    command = ["cargo", "package", "--list", "--allow-dirty", "--locked", "--package", crate.name]
    try:
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except FileNotFoundError:
        pytest.skip("cargo is not installed")
    held = set(listed.stdout.split())
    header = {"katex.html"} if (crate / "katex.html").is_file() else set()
    assert {"LICENSE-MIT", "LICENSE-APACHE", "README.md", "Cargo.toml", "src/lib.rs"} | header <= held
    # the tree of a repository is no part of a crate
    assert not [name for name in held if name.startswith((".", "target"))] or held & {".cargo_vcs_info.json"}


def test_the_address_stands_in_the_listed_places_and_is_one() -> None:
    now = address.Address.now()
    assert address.Address.of("https://github.com/a/b") == ("https://github.com/a/b", "https://a.github.io/b")
    with pytest.raises(ValueError, match="found 'here'"):
        address.Address.of("here")
    holders = set()
    for path in sources():
        if path.suffix in {".png", ".webp", ".c3d", ".cbor"} or path.is_symlink():
            continue
        name = path.relative_to(ROOT).as_posix()
        held = now.held_by(path.read_text("utf-8", errors="ignore"))
        assert set(held) <= set(now), f"{name}: {held}"
        if held:
            holders.add(name)
    assert holders == set(address.PLACES)


def test_a_new_address_goes_everywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for place in address.PLACES:
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text(read(place), "utf-8")
    old, new = address.Address.now(), address.Address.of("https://gitlab.com/new/house")
    monkeypatch.setattr(address, "ROOT", tmp_path)
    assert address.move(old, new) == list(address.PLACES)
    assert address.Address.now() == new
    for place in address.PLACES:
        text = (tmp_path / place).read_text("utf-8")
        assert old.repository not in text and old.book not in text, place


def test_versions_agree_and_a_release_is_prepared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = version.now()
    others = version.others()
    assert len(others) > 20 and set(others.values()) == {now}
    newest, _ = version.entry()
    for name in ("Cargo.toml", "Cargo.lock", "CITATION.cff", "CHANGELOG.md"):
        (tmp_path / name).write_text(read(name), "utf-8")

    def update(*_: object, **__: object) -> None:
        # stands for what cargo does to the lock file
        text = version._LOCKED.sub(
            rf'name = "\1"\nversion = "{newest}"', (tmp_path / "Cargo.lock").read_text()
        )
        (tmp_path / "Cargo.lock").write_text(text)

    monkeypatch.setattr(version, "ROOT", tmp_path)
    monkeypatch.setattr(version.subprocess, "run", update)
    with pytest.raises(ValueError, match=r"major\.minor\.patch"):
        version.write("two", "2027-01-01")
    with pytest.raises(ValueError, match="the newest entry"):
        version.write("9.9.9", "2027-01-01")
    version.write(newest, "2027-01-01")
    assert set(version.others().values()) == {version.now()} == {newest}
    assert version.entry() == (newest, "2027-01-01")
    assert f"version: {newest}\ndate-released: 2027-01-01\n" in (tmp_path / "CITATION.cff").read_text()
    # an address is all that is missing, or nothing
    assert [said for said in version.faults(f"v{newest}") if "address" not in said] == []
    assert any("the tag is v0" in said for said in version.faults("v0"))


def test_what_is_not_ready_is_not_released() -> None:
    command = [sys.executable, str(ROOT / "release" / "version.py"), "--check", "v0.0.0"]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.returncode == 1 and "the tag is v0.0.0" in checked.stderr


def test_the_metadata_of_cargo_python_and_the_citation_agree() -> None:
    cargo, project, cited = read("Cargo.toml"), read("pyproject.toml"), read("CITATION.cff")
    authors = re.findall(r'^authors = \["(.*)"\]$', cargo, re.MULTILINE)
    assert re.findall(r'^authors = \[\{ name = "(.*)" \}\]$', project, re.MULTILINE) == authors
    assert re.findall(r'^authors:\n  - name: "(.*)"$', cited, re.MULTILINE) == authors
    (licence,) = re.findall(r'^license = "(.*)"$', cargo, re.MULTILINE)
    assert f'license = "{licence}"' in project
    assert re.findall(r"^  - (MIT|Apache-2.0)$", cited, re.MULTILINE) == licence.split(" OR ")
    described = field(ROOT / "crates" / "somersault", "description")
    assert f"description = {described}" in project


def test_the_text_for_pypi_stands_alone() -> None:
    assert 'readme = "python/README.md"' in read("pyproject.toml")
    text = read("python/README.md")
    assert re.findall(r"\]\((?!https://)", text) == [], "a link that leads nowhere on PyPI"
    assert "![" not in text and "<img" not in text


def test_the_licences_of_what_is_linked_are_those_of_the_lock_file() -> None:
    held = read("LICENSE-THIRD-PARTY")
    assert len(held) < 1_000_000
    assert "LICENSE-THIRD-PARTY" in read("pyproject.toml")
    try:
        expected = licences.file()
    except FileNotFoundError:
        pytest.skip("cargo is not installed")
    assert held == expected, "run `make licences`"


def commands(text: str) -> list[str]:
    """The lines that a workflow runs."""
    found = re.findall(r"^ +(?:- )?run: (?!\|)(.+)$", text, re.MULTILINE)
    for indent, block in re.findall(r"^( +)(?:- )?run: \|\n((?:\1 .*\n|\n)+)", text, re.MULTILINE):
        found.extend(line.strip() for line in block.splitlines() if indent)
    return found


def test_workflows_run_what_is_there() -> None:
    makefile = read("Makefile")
    count = 0
    for path in WORKFLOWS:
        text = path.read_text("utf-8")
        for line in commands(text):
            for target in re.findall(r"\bmake ([\w-]+)", line):
                assert f"\n{target}:" in makefile, (path.name, target)
                count += 1
            for name in re.findall(r"\b((?:tests|release|docs)/[\w/]+\.py)", line):
                assert (ROOT / name).is_file(), (path.name, name)
                count += 1
        for name in re.findall(r"uses: \./(\S+)", text):
            assert (ROOT / name).is_file(), (path.name, name)
    assert count >= 10


@pytest.mark.parametrize(
    ("schema", "pattern"),
    [
        ("vendor.github-workflows", ".github/workflows/*.yml"),
        ("vendor.github-issue-forms", ".github/ISSUE_TEMPLATE/*_*.yml"),
        ("vendor.github-issue-config", ".github/ISSUE_TEMPLATE/config.yml"),
        ("vendor.dependabot", ".github/dependabot.yml"),
    ],
)
def test_workflows_and_forms_are_what_their_reader_takes(schema: str, pattern: str) -> None:
    pytest.importorskip("check_jsonschema", reason="check-jsonschema is not installed")
    files = [str(path) for path in ROOT.glob(pattern)]
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, *files]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert files and checked.returncode == 0, checked.stdout


def test_workflows_pin_their_actions_and_take_no_right_by_default() -> None:
    assert {path.name for path in WORKFLOWS} == {"checks.yml", "publish.yml", "wheels.yml"}
    for path in WORKFLOWS:
        text = path.read_text("utf-8")
        assert "\npermissions:\n  contents: read\n" in text
        for action in re.findall(r"uses: (?!\./)(.+)$", text, re.MULTILINE):
            assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40} # v[\d.]+", action), (path.name, action)
        # who may publish is decided there, not by a secret
        assert "secrets." not in text
        assert ("id-token: write" in text) == (path.name == "publish.yml")


def test_workflows_check_the_oldest_rust_and_python_that_are_promised() -> None:
    (rust,) = re.findall(r'^rust-version = "(.*)"$', read("Cargo.toml"), re.MULTILINE)
    (python,) = re.findall(r'^requires-python = ">=(.*)"$', read("pyproject.toml"), re.MULTILINE)
    checks = read(".github/workflows/checks.yml")
    assert f"cargo +{rust} check" in checks and f"rustup toolchain install {rust} " in checks
    assert f'python: "{python}"' in checks
    assert f'abi3-py{python.replace(".", "")}"' in read("Cargo.toml")
    assert f"Minimum supported Rust version: {rust}." in read("CHANGELOG.md")


def test_figures_of_the_paper_are_recorded() -> None:
    text = read("paper/paper.md").partition("\n---\n")[2]
    assert 1000 <= len(text.split()) <= 1750
    cited = set(re.findall(r"@([a-z]+\d*)\b", text))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", read("paper/paper.bib"), re.MULTILINE))
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        assert (ROOT / "paper" / picture).is_file()
    recorded = read("docs/performance.md") + read("README.md")
    for figure, unit in re.findall(r"(\d+(?:\.\d+)?) (ms|rad)\b", text):
        assert f"{figure} {unit}" in recorded or figure in recorded, figure


def test_no_file_is_too_large() -> None:
    assert [path for path in sources() if os.path.getsize(path) > 1_000_000] == []
