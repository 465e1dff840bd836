"""The address of the repository: `python release/address.py https://github.com/owner/name` writes a new one.

Its home is `repository` in `Cargo.toml`; the book stands at `homepage`. The files of `PLACES` hold both as
well, since what reads them takes no variables, and no other file does.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]

#: The owner before the project has one. Nothing is published from there.
NOBODY = "OWNER"

PLACES = (
    "Cargo.toml",
    "CITATION.cff",
    "README.md",
    "mkdocs.yml",
    "pyproject.toml",
    "python/README.md",
    *sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "crates").glob("*/README.md")),
)


class Address(NamedTuple):
    """Where the repository is, and where its book is."""

    repository: str
    book: str

    @classmethod
    def now(cls) -> Address:
        """That of `Cargo.toml`."""
        text = (ROOT / "Cargo.toml").read_text("utf-8")
        found = dict(re.findall(r'^(repository|homepage) = "(.*)"$', text, re.MULTILINE))
        return cls(found["repository"], found["homepage"])

    @classmethod
    def of(cls, repository: str) -> Address:
        """A repository with its book at the pages of its owner."""
        found = re.fullmatch(r"https://(github|gitlab)\.com/([\w.-]+)/([\w.-]+)", repository)
        if not found:
            expected = "https://github.com/owner/name, or the same at gitlab.com"
            raise ValueError(f"the address must be {expected}, found {repository!r}; others need --book")
        host, owner, name = found.groups()
        return cls(repository, f"https://{owner}.{host}.io/{name}")

    @property
    def is_nobodys(self) -> bool:
        """Whether the project has no address yet."""
        return NOBODY in self.repository.split("/")

    def held_by(self, text: str) -> list[str]:
        """What a text holds of it, and of other addresses that the project could have."""
        name = re.escape(self.repository.rpartition("/")[2])
        hosted = rf"https?://(?:(?:github|gitlab)\.com/[\w.-]+|[\w-]+\.(?:github|gitlab)\.io)/{name}\b"
        return re.findall("|".join((hosted, re.escape(self.repository), re.escape(self.book))), text)


def move(old: Address, new: Address) -> list[str]:
    """Writes the new address into all places that hold the old one, which it returns."""
    changed = []
    for place in PLACES:
        path = ROOT / place
        text = path.read_text("utf-8")
        found = text.replace(old.repository, new.repository).replace(old.book, new.book)
        if found != text:
            path.write_text(found, "utf-8")
            changed.append(place)
    return changed


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description="Writes the repository's address into all files that hold it."
    )
    parser.add_argument("repository", help="https://github.com/owner/name")
    parser.add_argument("--book", help="where the book is, if not at the pages of the owner")
    given = parser.parse_args()
    repository = given.repository.rstrip("/").removesuffix(".git")
    try:
        new = Address(repository, given.book.rstrip("/")) if given.book else Address.of(repository)
    except ValueError as fault:
        parser.error(str(fault))
    print("\n".join(move(Address.now(), new)))
