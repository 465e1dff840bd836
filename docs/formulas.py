"""Formulas as MathML: in the book, and in built pages of crates by `python docs/formulas.py out/book/rust`.

Browsers draw MathML themselves, so that pages load no script for it and work offline. On docs.rs, which runs
rustdoc only, `docs/katex.html` draws the same blocks of crates, those marked `math`.
"""

from __future__ import annotations

import re
import sys
from html import unescape
from pathlib import Path

from latex2mathml.converter import convert

#: What the converter does not know, and hands on as it is.
_UNKNOWN = re.compile(r"<m[a-z]+[^>]*>(&(?!#)|\\[a-zA-Z]+)")
#: A bar in a row is not taken for a fence but for an operator, which has space about it.
_BAR = re.compile(r"<mo((?: [^>]*)?>&#x0007C;</mo>)")
#: A function before what it is of, from which a thin space divides it.
_FUNCTION = re.compile(r"<mi>(sin|cos|tan|cot|arccos|ln|log)</mi>(?=<m(?:i|n|frac|row|sub|sup|subsup)\b)")
_BLOCK = re.compile(r'<pre class="language-math"><code>(.*?)</code></pre>', re.DOTALL)


def mathml(latex: str, display: str) -> str:
    """A formula, as it stands in a page of HTML; `display` is ``block`` or ``inline``."""
    drawn = str(convert(unescape(latex).strip(), display=display))
    if unknown := _UNKNOWN.search(drawn):
        raise ValueError(f"{unknown[1]} is not drawn, in {latex.strip()!r}")
    drawn = _BAR.sub(r'<mo lspace="0" rspace="0"\1', drawn)
    drawn = _FUNCTION.sub(r'<mo lspace="0.17em" rspace="0.17em">\1</mo>', drawn)
    # Where there is no font for mathematics, dots above letters would fall onto them.
    return drawn.replace("<mo>&#x002D9;</mo>", "<mo>.</mo>").replace("<mo>&#x000A8;</mo>", "<mo>..</mo>")


def with_mathml(page: str) -> str:
    """A page of rustdoc with MathML for its formulas."""
    return _BLOCK.sub(lambda match: mathml(match[1], "block"), page)


if __name__ == "__main__":
    for path in Path(sys.argv[1]).rglob("*.html"):
        text = path.read_text("utf-8")
        if (found := with_mathml(text)) != text:
            path.write_text(found, "utf-8")
