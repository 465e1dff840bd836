"""Follows every link within a folder of pages: `python docs/check_links.py out/book`.

Links to other sites are counted, not followed: what is built here must not depend on a network.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if value is None:
                continue
            if name in ("href", "src"):
                self.links.append(value)
            elif name == "id" or (name == "name" and tag == "a"):
                self.anchors.add(value)


def broken(folder: Path, without: tuple[str, ...] = ()) -> tuple[list[str], int]:
    """Links that lead nowhere, and how many were followed; folders in `without` are not built yet."""
    folder = folder.resolve()
    pages: dict[Path, _Page] = {}

    def page(path: Path) -> _Page:
        if path not in pages:
            pages[path] = _Page(path)
        return pages[path]

    faults, count = [], 0
    for path in sorted(folder.rglob("*.html")):
        relative = path.relative_to(folder)
        # Pages of rustdoc are its own concern, and 404.html is for wherever it is shown.
        if relative.parts[0] == "rust" or relative.name == "404.html":
            continue
        for link in page(path).links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            inside = target.relative_to(folder) if target.is_relative_to(folder) else None
            if inside is not None and inside.parts and inside.parts[0] in without:
                continue
            count += 1
            if target.is_dir():
                target /= "index.html"
            if inside is None or not target.is_file():
                faults.append(f"{relative}: {link}")
            elif (
                parts.fragment
                and target.suffix == ".html"
                and unquote(parts.fragment) not in page(target).anchors
            ):
                faults.append(f"{relative}: {link} (no such anchor)")
    return faults, count


if __name__ == "__main__":
    found, followed = broken(Path(sys.argv[1]))
    print("\n".join(found) or f"{followed} links lead somewhere")
    sys.exit(bool(found))
