"""Turns blocks marked `math` in the pages of crates into MathML: `docs/rust_formulas.py out/book/rust`.

Browsers draw MathML themselves, so that the pages work offline. On docs.rs, which runs rustdoc only,
`docs/katex.html` draws the same blocks.
"""

from __future__ import annotations

import re
import sys
from html import unescape
from pathlib import Path

from latex2mathml.converter import convert

_BLOCK = re.compile(r'<pre class="language-math"><code>(.*?)</code></pre>', re.DOTALL)


def drawn(page: str) -> str:
    """The page with MathML for its formulas."""
    return _BLOCK.sub(lambda match: str(convert(unescape(match[1]).strip(), display="block")), page)


if __name__ == "__main__":
    for path in Path(sys.argv[1]).rglob("*.html"):
        text = path.read_text("utf-8")
        if (found := drawn(text)) != text:
            path.write_text(found, "utf-8")
