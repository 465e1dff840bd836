"""The public names of the crates, read from their sources.

`python tests/python/rust_names.py` rewrites `rust_names.txt`. Listed are items and re-exports in public
modules, and public functions of their types. What a macro makes is not seen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

LIST = Path(__file__).with_name("rust_names.txt")
CRATES = Path(__file__).parents[2] / "crates"
NOT_PUBLISHED = {"somersault-py", "somersault-testkit"}

_NOT_CODE = re.compile(
    r"""//[^\n]* | /\*.*?\*/ | b?r(?P<hashes>\#*)".*?"(?P=hashes)
    | b?"(?:\\.|[^"\\])*" | b?'(?:\\.[^']*|[^'\\])'""",
    re.VERBOSE | re.DOTALL,
)
_ITEM = re.compile(
    r"pub\s+(?:(?:const|async|unsafe)\s+)*(?P<kind>struct|enum|trait|fn|const|static|type|union)\s+(?P<name>\w+)"
)
_MODULE = re.compile(r"pub\s+mod\s+(?P<name>\w+)\s*$")
_USE = re.compile(r"pub\s+use\s+(?P<tree>[^;]+)$")
_IMPL = re.compile(r"impl\b\s*(?:<.*?>\s*)?(?P<type>(?:\w+::)*\w+)\s*(?:<.*>)?\s*(?:where\b.*)?$", re.DOTALL)


def crates() -> list[Path]:
    """The folders of the crates that are published."""
    return sorted(path for path in CRATES.iterdir() if path.is_dir() and path.name not in NOT_PUBLISHED)


def names() -> list[str]:
    """All public names, sorted."""
    return sorted({name for crate in crates() for name in _of_crate(crate)})


def items() -> dict[str, list[str]]:
    """Where the public types, traits, functions and constants are defined, by their last names."""
    found: dict[str, list[str]] = {}
    for crate in crates():
        for name in _of_crate(crate, with_uses=False, with_members=False):
            found.setdefault(name.rpartition("::")[2], []).append(name)
    return found


def _of_crate(folder: Path, *, with_uses: bool = True, with_members: bool = True) -> Iterator[str]:
    crate = folder.name.replace("-", "_")
    yield crate
    yield from _of_file(folder / "src" / "lib.rs", crate, with_uses, with_members)


def _of_file(file: Path, path: str, with_uses: bool, with_members: bool) -> Iterator[str]:
    below = file.parent if file.name in ("lib.rs", "mod.rs") else file.with_suffix("")
    for head, block in _statements(_NOT_CODE.sub(" ", file.read_text(encoding="utf-8"))):
        if module := _MODULE.search(head):
            name = f"{path}::{module['name']}"
            yield name
            if block is None:
                sources = below / f"{module['name']}.rs", below / module["name"] / "mod.rs"
                yield from _of_file(next(s for s in sources if s.exists()), name, with_uses, with_members)
        elif use := _USE.search(head + (block or "")):
            if with_uses:
                yield from (f"{path}::{name}" for name in _leaves(use["tree"]))
        elif item := _ITEM.search(head):
            yield f"{path}::{item['name']}"
        elif with_members and block is not None and " for " not in head and (of := _IMPL.search(head)):
            for inner, _ in _statements(block[1:-1]):
                if item := _ITEM.search(inner):
                    yield f"{path}::{of['type'].rpartition('::')[2]}::{item['name']}"


def _statements(code: str) -> Iterator[tuple[str, str | None]]:
    """What stands before each `;` or block at the outermost level, and the block."""
    start = depth = opened = 0
    for i, letter in enumerate(code):
        if letter == "{":
            if depth == 0:
                opened = i
            depth += 1
        elif letter == "}":
            depth -= 1
            is_use = re.search(r"\buse\b[^;]*$", code[start:opened])
            if depth == 0 and not is_use:
                yield code[start:opened].strip(), code[opened : i + 1]
                start = i + 1
        elif letter == ";" and depth == 0:
            yield code[start:i].strip(), None
            start = i + 1


def _leaves(tree: str) -> Iterator[str]:
    """The names that a tree of uses brings."""
    tree = tree.strip()
    if "{" not in tree:
        name = tree.split(" as ")[-1].strip().rpartition("::")[2]
        if name:
            yield name
        return
    inner = tree[tree.index("{") + 1 : tree.rindex("}")]
    depth = start = 0
    for i, letter in enumerate(inner + ","):
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            yield from _leaves(inner[start:i])
            start = i + 1


if __name__ == "__main__":
    LIST.write_text("\n".join(names()) + "\n", encoding="utf-8")
