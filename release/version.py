"""The version: `python release/version.py 0.2.0` writes it and the date of its release.

`--check v0.2.0` says what keeps a tag from being released: another version in one of the files, an entry of
the changelog without a date, or an address of the repository that is nobody's.
"""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
import sys
from pathlib import Path

from address import Address

ROOT = Path(__file__).parents[1]

_NUMBER = re.compile(r"\d+\.\d+\.\d+(?:-[0-9A-Za-z.]+)?")
_HOME = re.compile(r'^version = "(.*)"$', re.MULTILINE)
_NEEDED = re.compile(r'^(somersault[\w-]*) = \{ path = .*?version = "([^"]*)"', re.MULTILINE)
_LOCKED = re.compile(r'^name = "(somersault[\w-]*)"\nversion = "(.*)"$', re.MULTILINE)
_CITED = re.compile(r"^version: (.*)$", re.MULTILINE)
_CITED_DATE = re.compile(r"^date-released: .*\n", re.MULTILINE)
_ENTRY = re.compile(r"^## (\S+) - (\S+)$", re.MULTILINE)


def _read(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


def now() -> str:
    """The version of `Cargo.toml`, its home."""
    return _HOME.findall(_read("Cargo.toml"))[0]


def others() -> dict[str, str]:
    """The versions that stand elsewhere."""
    return {
        **{f"Cargo.toml, {name}": version for name, version in _NEEDED.findall(_read("Cargo.toml"))},
        **{f"Cargo.lock, {name}": version for name, version in _LOCKED.findall(_read("Cargo.lock"))},
        "CITATION.cff": _CITED.findall(_read("CITATION.cff"))[0],
    }


def entry() -> tuple[str, str]:
    """The version and the date of the newest entry of the changelog; the date may be `unreleased`."""
    version, date = _ENTRY.findall(_read("CHANGELOG.md"))[0]
    return version, date


def write(version: str, date: str) -> None:
    """Writes a version into all files that name it, and the date of its release."""
    if not _NUMBER.fullmatch(version):
        raise ValueError(f"a version is major.minor.patch, found {version!r}")
    if entry()[0] != version:
        raise ValueError(f"the newest entry of the changelog is {entry()[0]}, not {version}")
    cargo = _HOME.sub(f'version = "{version}"', _read("Cargo.toml"))
    cargo = _NEEDED.sub(lambda found: found[0].replace(f'"{found[2]}"', f'"{version}"'), cargo)
    cited = _CITED.sub(
        f"version: {version}\ndate-released: {date}", _CITED_DATE.sub("", _read("CITATION.cff"))
    )
    changes = _ENTRY.sub(f"## {version} - {date}", _read("CHANGELOG.md"), count=1)
    for name, text in (("Cargo.toml", cargo), ("CITATION.cff", cited), ("CHANGELOG.md", changes)):
        (ROOT / name).write_text(text, "utf-8")
    # of the lock file only our own versions change
    subprocess.run(["cargo", "update", "--workspace", "--offline", "--quiet"], cwd=ROOT, check=True)


def faults(tag: str) -> list[str]:
    """What keeps a tag from being released."""
    version = now()
    found = [f"{place}: {other}, not {version}" for place, other in others().items() if other != version]
    if tag != f"v{version}":
        found.append(f"the tag is {tag}, the version {version}")
    if (newest := entry())[0] != version or newest[1] == "unreleased":
        found.append(f"the changelog begins with {' - '.join(newest)}, not with {version} and a date")
    if (address := Address.now()).is_nobodys:
        found.append(f"the repository has no address yet, found {address.repository}: release/address.py")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Writes the version, or checks a tag.")
    parser.add_argument("version", nargs="?", help="major.minor.patch")
    parser.add_argument("--date", default=datetime.date.today().isoformat(), help="of the release")
    parser.add_argument("--check", metavar="TAG", help="say what keeps this tag from being released")
    given = parser.parse_args()
    if (given.version is None) == (given.check is None):
        parser.error("give a version to write or a tag to check")
    if given.check:
        sys.exit("\n".join(faults(given.check)) or None)
    try:
        write(given.version, given.date)
    except ValueError as fault:
        parser.error(str(fault))
