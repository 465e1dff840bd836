"""The files of each crate import one another without circles."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

CRATES = Path(__file__).parents[2] / "crates"

# strings, characters and comments; a lifetime has no second quote
TEXT = re.compile(
    r"""r(?P<hashes>\#*)".*?"(?P=hashes) | "(?:\\.|[^"\\])*" | '(?:\\'|\\[^']+|[^'\\])'
    | //[^\n]* | /\*.*?\*/""",
    re.DOTALL | re.VERBOSE,
)

Module = tuple[str, ...]


def code(text: str) -> str:
    """Rust without comments, without what is in quotes, and without what is compiled for tests only."""
    text = TEXT.sub(" ", text)
    while found := re.search(r"#\[cfg\(test\)\]", text):
        text = text[: found.start()] + text[end_of_item(text, found.end()) :]
    return text


def end_of_item(text: str, start: int) -> int:
    """Where the item that begins at `start` ends: with a semicolon, or with its block."""
    depth = 0
    for at, letter in enumerate(text[start:], start):
        depth += (letter in "{([") - (letter in "})]")
        if depth == 0 and letter in ";}":
            return at + 1
    return len(text)


def leaves(tree: str) -> Iterator[tuple[list[str], str]]:
    """The paths that the tree of a `use` stands for, each with the name that it gives."""
    head, brace, rest = tree.partition("{")
    if not brace:
        path, _, alias = tree.partition(" as ")
        parts = re.findall(r"[\w*]+", path)
        if parts[-1] == "self":
            parts.pop()
        yield parts, alias.strip() or parts[-1]
        return
    depth, begin = 0, 0
    inside = rest[: rest.rindex("}")] + ","
    for at, letter in enumerate(inside):
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            if branch := inside[begin:at].strip():
                yield from leaves(head + branch)
            begin = at + 1


class Crate:
    """The modules of a crate that have files, and what each imports or mentions by its path."""

    def __init__(self, source: Path) -> None:
        self.names: dict[Module, dict[str, list[str]]] = {}
        self.paths: dict[Module, list[list[str]]] = {}
        for path in source.rglob("*.rs"):
            *folder, name = path.relative_to(source).with_suffix("").parts
            module = (*folder,) if name in ("lib", "mod") else (*folder, name)
            text = code(path.read_text(encoding="utf-8"))
            imports = [leaf for tree in re.findall(r"\buse\s+([^;]+);", text) for leaf in leaves(tree)]
            mentioned = re.findall(r"(?<![\w:])\w+(?:::\w+)+", re.sub(r"\buse\s+[^;]+;", " ", text))
            self.names[module] = {name: parts for parts, name in imports}
            self.paths[module] = [parts for parts, _ in imports] + [path.split("::") for path in mentioned]

    def home(self, module: Module, parts: list[str], depth: int = 0) -> Module | None:
        """The module that defines what a path in `module` means, behind re-exports; None if outside."""
        first, *rest = parts
        names = self.names[module]
        if first in ("crate", "self", "super"):
            place = {"crate": (), "self": module, "super": module[:-1]}[first]
        elif (*module, first) in self.names:
            place = (*module, first)
        elif first in names and names[first] != parts and depth < 9:
            return self.home(module, names[first] + rest, depth + 1)
        else:
            return None
        for i, name in enumerate(rest):
            if name == "super":
                place = place[:-1]
            elif (*place, name) in self.names:
                place = (*place, name)
            elif name in self.names[place] and depth < 9:
                return self.home(place, self.names[place][name] + rest[i + 1 :], depth + 1) or place
            else:
                break
        return place

    def imports(self) -> dict[Module, set[Module]]:
        """What each module imports. One above another in its folder gathers it: left out."""
        found: dict[Module, set[Module]] = {}
        for module, paths in self.paths.items():
            homes = {self.home(module, parts) for parts in paths} - {None}
            found[module] = {
                home for home in homes if home[: len(module)] != module and module[: len(home)] != home
            }
        return found


def circles(imports: dict[Module, set[Module]]) -> list[list[str]]:
    """The sets of modules that import one another, directly or by way of others."""
    reached = {module: set(others) for module, others in imports.items()}
    for between in reached:
        for module, others in reached.items():
            if between in others:
                reached[module] = others | reached[between]
    groups = {
        frozenset(other for other in others if module in reached[other])
        for module, others in reached.items()
        if module in others
    }
    return sorted(sorted("::".join(module) for module in group) for group in groups)


@pytest.mark.parametrize("crate", sorted(path.name for path in CRATES.iterdir() if (path / "src").is_dir()))
def test_files_import_one_another_without_circles(crate):
    assert circles(Crate(CRATES / crate / "src").imports()) == []


def test_circles_are_found_behind_facades_and_only_in_code(tmp_path):
    files = {
        "lib.rs": "mod a; mod b; mod c; pub mod d; pub use a::A; pub use d::{inner::{self, D as E}, *};",
        "a.rs": "use crate::B as Other; pub struct A<'a>(&'a char); const Q: char = '\"'; use super::c::C;",
        "b.rs": "// use crate::A;\n#[cfg(test)]\nmod tests { use crate::A; }\n#[cfg(test)]\nuse crate::A;",
        "c.rs": 'const S: &str = r#"use crate::"A";"#; /* use crate::A; */ fn f() { crate::E::new(); }',
        "d/mod.rs": "pub mod inner; use inner::D;",
        "d/inner.rs": "pub struct D; impl D { pub fn new() { super::super::A; } }",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    crate = Crate(tmp_path)
    assert crate.imports()[("b",)] == set()
    assert circles(crate.imports()) == [["a", "c", "d::inner"]]
    (tmp_path / "c.rs").write_text("", encoding="utf-8")
    assert circles(Crate(tmp_path).imports()) == []
