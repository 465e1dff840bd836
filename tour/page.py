"""Pages of the tour: text, tables and figures in a folder that needs nothing from outside it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLE = files(__package__).joinpath("page.css").read_text(encoding="utf-8")

#: Size of the letters of figures, points.
LETTERS = 12.0
#: Height of letters below which a telephone does not make a figure smaller, in pixels of the page.
_LEGIBLE = 9.5
#: Pixels of the page for an inch of a figure where there is room.
_INCH = 105
#: Letters from which a cell of a table keeps a width in which they can be read.
_LONG = 32


@dataclass(frozen=True)
class Cell:
    """An entry of a table. `agrees` colours it: True as printed, False not, None says nothing."""

    text: str
    agrees: bool | None = None
    is_text: bool = False


def words(text: str) -> Cell:
    """An entry to be set flush left."""
    return Cell(text, is_text=True)


def number(value: float, digits: int = 2) -> str:
    """A number for a table: plain where short, else with a power of ten."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "Inf" if value > 0 else "−Inf"
    if abs(value) < 1e3:
        return f"{value:.{digits}f}".replace("-", "−")
    mantissa, exponent = f"{value:.{digits}e}".split("e")
    return f"{mantissa}×10{_superscript(int(exponent))}".replace("-", "−")


def error_size(value: float) -> str:
    """An error or another size of which only the magnitude matters."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}×10{_superscript(int(exponent))}"


def power(value: float) -> str:
    """A power of ten as one."""
    return f"10{_superscript(round(math.log10(value)))}"


def _superscript(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


@dataclass
class Page:
    """A chapter in the making: pieces of HTML, and figures written to the folder as they come."""

    slug: str
    title: str
    folder: Path
    finding: str = ""
    figures: list[Path] = field(default_factory=list)
    _pieces: list[str] = field(default_factory=list)

    def lead(self, text: str) -> None:
        """What the chapter found, in a sentence or two; the index shows it too."""
        self.finding = text
        self._pieces.append(f'<p class="lead">{text}</p>')

    def section(self, title: str) -> None:
        """A heading."""
        self._pieces.append(f"<h2>{escape(title)}</h2>")

    def text(self, *paragraphs: str) -> None:
        """Paragraphs of HTML."""
        self._pieces.extend(f"<p>{paragraph}</p>" for paragraph in paragraphs)

    def items(self, entries: Iterable[str]) -> None:
        """A list of entries of HTML."""
        self._pieces.append("<ul>" + "".join(f"<li>{entry}</li>" for entry in entries) + "</ul>")

    def code(self, source: str) -> None:
        """A piece of a program."""
        self._pieces.append(f"<pre><code>{escape(source)}</code></pre>")

    def table(
        self, header: Sequence[str | Cell], rows: Iterable[Sequence[str | Cell]], caption: str = ""
    ) -> None:
        """A table; the caption is HTML.

        Raises
        ------
        ValueError
            A row has more or fewer entries than the header.
        """

        def entry(tag: str, value: str | Cell) -> str:
            cell = value if isinstance(value, Cell) else Cell(value)
            classes = ["text"] * cell.is_text + ["long"] * (len(cell.text) > _LONG)
            if cell.agrees is not None:
                classes.append("same" if cell.agrees else "off")
            attribute = f' class="{" ".join(classes)}"' if classes else ""
            return f"<{tag}{attribute}>{escape(cell.text)}</{tag}>"

        head = "".join(entry("th", value) for value in header)
        entries = [[entry("td", value) for value in row] for row in rows]
        for index, row in enumerate(entries):
            if len(row) != len(header):
                raise ValueError(f"row {index} has {len(row)} entries, the header {len(header)}")
        body = "".join("<tr>" + "".join(row) + "</tr>\n" for row in entries)
        self._pieces.append(
            "<div"
            f' class="scroll"><table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table></div>'
        )
        if caption:
            self._pieces.append(f'<p class="caption">{caption}</p>')

    def figure(self, name: str, ax: Axes, caption: str, description: str) -> None:
        """The figure of these axes, saved as PNG.

        The caption is HTML, the description is for those who cannot see the figure.
        """
        import matplotlib.pyplot as plt

        figure = cast("Figure", ax.figure)
        path = self.folder / "figures" / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        # Figures are laid out once, by their own layout, which `bbox_inches="tight"` would do again.
        figure.savefig(path, dpi=144)
        plt.close(figure)
        self.figures.append(path)
        width = figure.get_figwidth()
        least, most = round(72.0 * width * _LEGIBLE / LETTERS), round(_INCH * width)
        self._pieces.append(
            f'<figure><img src="figures/{path.name}" alt="{escape(description)}" loading="lazy"'
            f' style="--least: {least}px; --most: {most}px">'
            f"<figcaption>{caption}</figcaption></figure>"
        )

    def gallery(self, figures: Iterable[tuple[Page, str]]) -> None:
        """Figures of other pages by their names, as links to these pages."""
        self.add(
            '<div class="gallery">'
            + "".join(
                f'<figure><a href="{page.slug}.html"><img src="figures/{name}.png"'
                f' alt="{escape(page.title)}"></a><figcaption>{escape(page.title)}</figcaption></figure>'
                for page, name in figures
            )
            + "</div>"
        )

    def html(self, navigation: str, footer: str) -> str:
        """The whole page."""
        body = "\n".join(self._pieces)
        return (
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{escape(self.title)} – somersault</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
            f"<nav>{navigation}</nav>\n<main>\n<h1>{escape(self.title)}</h1>\n{body}\n</main>\n"
            f"<footer>{footer}</footer>\n</body>\n</html>\n"
        )

    def add(self, html: str) -> None:
        """A piece of HTML as it is."""
        self._pieces.append(html)
