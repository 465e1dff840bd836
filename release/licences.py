"""Licences of the crates that the extension links: `python release/licences.py` writes `LICENSE-THIRD-PARTY`.

The wheel has machine code of these crates in it, and their licences ask that the texts go along. The crates
are those of `cargo tree` for any platform, with the features that the extension has, without what only builds
and tests need, macros among them; names, expressions and folders come from `cargo metadata`, texts from the
files of each crate. A text that several crates have stands once.
"""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "LICENSE-THIRD-PARTY"

_TEXTS = re.compile(r"(licen[sc]e|copying|copyright|notice|unlicense)", re.IGNORECASE)
_RULE = "=" * 100

_HEAD = """\
Licences of third-party software in somersault

The extension module of the Python package is compiled with the crates below, some of them on some platforms
only. Each has its version, its licence as an SPDX expression, and the numbers of the texts in its package;
the texts follow. Where an expression has a choice (OR), any of the licences named may be chosen. The standard
library of Rust is linked as well: MIT or Apache-2.0, The Rust Project Developers, https://www.rust-lang.org.
"""


def _cargo(*arguments: str) -> str:
    return subprocess.run(["cargo", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def linked() -> list[tuple[str, str]]:
    """Names and versions of the crates that the extension links, ours left out."""
    tree = _cargo(
        *(
            "tree",
            "--locked",
            "--package",
            "somersault-py",
            "--edges",
            "normal,no-proc-macro",
            "--target",
            "all",
        ),
        *("--prefix", "none", "--format", "{p}"),
    )
    found = set()
    for line in tree.splitlines():
        name, version, *path = line.removesuffix(" (*)").split()
        if not path:
            found.add((name, version.removeprefix("v")))
    return sorted(found)


def texts(package: dict[str, Any]) -> list[str]:
    """The licence texts in a package, those of parts that it has from others included."""
    folder = Path(package["manifest_path"]).parent
    files = {path for path in folder.iterdir() if path.is_file() and _TEXTS.match(path.name)}
    if package["license_file"]:
        files.add(folder / package["license_file"])
    read = [path.read_text("utf-8", errors="replace") for path in sorted(files)]
    return ["\n".join(line.rstrip() for line in text.strip().splitlines()) for text in read if text.strip()]


def standard(package: dict[str, Any]) -> str:
    """The licence of a package that has no text of it, in its standard form."""
    if "MIT" not in package["license"]:
        raise ValueError(f"{package['name']} has no licence text; find one for {package['license']}")
    authors = ", ".join(author.partition(" <")[0] for author in package["authors"])
    _, permission, rest = (ROOT / "LICENSE-MIT").read_text("utf-8").partition("Permission is hereby")
    whose = authors or f"the authors of {package['name']}, {package['repository']}"
    return f"MIT License\n\nCopyright (c) {whose}\n\n{permission}{rest.rstrip()}"


def file() -> str:
    """What `LICENSE-THIRD-PARTY` holds."""
    found = json.loads(_cargo("metadata", "--locked", "--format-version=1"))["packages"]
    packages = {(package["name"], package["version"]): package for package in found}
    numbers: dict[str, int] = {}
    rows = []
    for name, version in linked():
        package = packages[name, version]
        own = texts(package)
        has = [str(numbers.setdefault(text, len(numbers) + 1)) for text in own or [standard(package)]]
        form = "" if own else ", the standard form: its package has none"
        rows.append(f"{name} {version}: {package['license'] or 'see text'}; text {', '.join(has)}{form}")
    blocks = (f"{_RULE}\nText {number}\n{_RULE}\n\n{text}\n" for text, number in numbers.items())
    return "\n".join([_HEAD, *rows, "", *blocks])


if __name__ == "__main__":
    TARGET.write_text(file(), "utf-8")
