"""The guided tour: what the library computes, checked against what the thesis prints.

It is a program of the repository, run by `make tour`, and not part of the package. `run` writes a folder of
pages that need nothing from outside it. Each chapter is a module of `tour.chapters` with a `TITLE` and a
function `write(page, measurements)`; the index shows them in the parts of `chapters.PARTS`.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from html import escape
from multiprocessing import get_context
from pathlib import Path

import matplotlib as mpl

import somersault
from tour import chapters, thesis
from tour.measurements import FULL, REDUCED, Measurements, Setting
from tour.page import LETTERS, Page

__all__ = ["FULL", "REDUCED", "Measurements", "Setting", "run"]

PURPOSE = """
What somersault computes, with pictures and numbers, beside what the thesis <a href="{url}">{citation}</a>
prints. Every number and figure here was computed by the library when these pages were made, but for what is
marked as printed in the thesis.
"""


def run(
    out: Path | str, measurements: Measurements | None = None, progress: bool = True, processes: int = 1
) -> Path:
    """Writes the tour.

    Parameters
    ----------
    out : path
        Folder to write to; it is made where it is missing.
    measurements : Measurements, optional
        What to show; all of it in the full setting unless given.
    progress : bool
        Whether to show how far it has come.
    processes : int
        From two on, a second process writes the chapters that share no measurements with the index.

    Returns
    -------
    Path
        The page to open.
    """
    started = time.monotonic()
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    measurements = measurements or Measurements(FULL)
    if processes == 1:
        pages = _written(chapters.ORDER, folder, measurements, progress)
    else:
        taken = (*chapters.ALONE, *chapters.MEASURED)
        rest = tuple(slug for slug in chapters.ORDER if slug not in taken)
        pages = _written(chapters.ALONE, folder, measurements, progress)
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as second:
            others = second.submit(_written, rest, folder, measurements, progress, bar=1)
            pages += _written(chapters.MEASURED, folder, measurements, progress)
            pages += others.result()
        pages.sort(key=lambda page: chapters.ORDER.index(page.slug))
    index = _index(folder, pages, measurements)
    footer = escape(
        f"somersault {somersault.__version__} · {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()} · {time.strftime('%Y-%m-%d')} · "
        f"computed in {time.monotonic() - started:.0f} s"
    )
    for page in [index, *pages]:
        (folder / f"{page.slug}.html").write_text(
            page.html(_navigation(page, pages), footer), encoding="utf-8"
        )
    return folder / "index.html"


def _written(
    slugs: Sequence[str], folder: Path, measurements: Measurements, progress: bool, bar: int = 0
) -> list[Page]:
    """The pages of these chapters; `bar` counts the bars above the one that shows how far it has come."""
    pages = []
    with mpl.rc_context({"font.size": LETTERS, "axes.titlesize": LETTERS}):
        for slug in _shown(slugs, progress, bar):
            chapter = chapters.load(slug)
            page = Page(slug, chapter.TITLE, folder)
            chapter.write(page, measurements)
            pages.append(page)
    return pages


def _shown(slugs: Sequence[str], progress: bool, position: int) -> Iterator[str]:
    """The slugs, with a bar if tqdm is there and a line for each if not."""
    if not progress:
        yield from slugs
        return
    try:
        from tqdm import tqdm
    except ImportError:
        for slug in slugs:
            print(f"tour: {slug}", flush=True)
            yield slug
    else:
        with tqdm(slugs, desc="tour", unit="chapter", position=position) as bar:
            for slug in bar:
                bar.set_postfix_str(slug)
                yield slug


def _navigation(current: Page, pages: Sequence[Page]) -> str:
    """Overview, the chapters before and after, and all of them folded away."""

    def link(page: Page, text: str) -> str:
        here = " aria-current=page" if page is current else ""
        return f'<a href="{page.slug}.html"{here}>{escape(text)}</a> '

    at = next((i for i, page in enumerate(pages) if page is current), None)
    before = [] if at is None else pages[max(0, at - 1) : at]
    after = pages[:1] if at is None else pages[at + 1 : at + 2]
    chosen = "" if at is not None else " aria-current=page"
    return (
        f'<a href="index.html"{chosen}>Overview</a> '
        + "".join(link(page, f"← {page.title}") for page in before)
        + "".join(link(page, f"{page.title} →") for page in after)
        + "<details><summary>All chapters</summary>"
        + "".join(link(page, page.title) for page in pages)
        + "</details>"
    )


def _index(folder: Path, pages: list[Page], measurements: Measurements) -> Page:
    index = Page("index", "A tour: rigid bodies, contact, divers, optimal motion", folder)
    index.lead(PURPOSE.format(url=thesis.URL, citation=escape(thesis.CITATION)))
    made = {page.slug: page for page in pages}
    index.gallery((made[slug], figure) for slug, figure in chapters.PICTURED.items() if slug in made)
    for part in chapters.PARTS:
        shown = [made[slug] for slug in part.slugs if slug in made]
        if shown:
            index.section(part.title)
            index.text(part.story)
            entries = (
                f'<dt><a href="{page.slug}.html">{escape(page.title)}</a></dt><dd>{page.finding}</dd>'
                for page in shown
            )
            index.add(f"<dl>{''.join(entries)}</dl>")
    chapters.summary(index, measurements)
    return index
