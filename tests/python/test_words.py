"""The words of the documentation, of the code and of its messages: none of those to avoid is left."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TERMS = ROOT / "docs" / "terms.md"

_FENCE = re.compile(r"^( *)```.*?^\1```$", re.MULTILINE | re.DOTALL)
_NAME = re.compile(r"`[^`\n]*`")
_DOC = re.compile(r"(?:^[ \t]*//[/!].*\n)+", re.MULTILINE)
_MARK = re.compile(r"^[ \t]*//[/!] ?", re.MULTILINE)
_COMMENT = re.compile(r"^[ \t]*//.*$", re.MULTILINE)
_STRING = re.compile(r'"((?:[^"\\]|\\.)*)"', re.DOTALL)
_CONTINUED = re.compile(r"\\\n\s*")


def to_avoid() -> list[str]:
    """The left column of the table of words."""
    table = TERMS.read_text("utf-8").partition("## Words to avoid")[2]
    rows = [line.split("|") for line in table.splitlines() if line.startswith("| ")]
    return [row[1].strip() for row in rows[1:]]


def places(text: str, phrases: list[str]) -> list[tuple[int, str]]:
    """The phrases in a text, as whole words, in any case and however they are wrapped, with their lines."""
    folded = " ".join(text.lower().split())
    found = []
    for phrase in phrases:
        # the plain search first: a pattern takes a hundred times as long
        if phrase in folded:
            wrapped = r"\s+".join(map(re.escape, phrase.split()))
            for match in re.finditer(rf"(?<![\w-]){wrapped}(?![\w-])", text, re.IGNORECASE):
                found.append((text.count("\n", 0, match.start()), phrase))
    return found


def blanked(text: str, *patterns: re.Pattern[str]) -> str:
    """The text without what matches, its lines where they were."""
    for removed in patterns:
        text = removed.sub(lambda match: "`" + "\n" * match[0].count("\n"), text)
    return text


def of_markdown(path: Path) -> Iterator[tuple[int, str]]:
    text = path.read_text("utf-8")
    if path == TERMS:
        text = text.partition("## Words to avoid")[0]
    yield 1, blanked(text, _FENCE, _NAME)


def of_python(path: Path) -> Iterator[tuple[int, str]]:
    """Docstrings and all other strings; those of an f-string as one."""
    nodes = list(ast.walk(ast.parse(path.read_text("utf-8"))))
    pieces = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in nodes:
        if id(node) in pieces:
            continue
        if isinstance(node, ast.JoinedStr):
            parts = (part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
            yield node.lineno, "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, blanked(node.value, _NAME)


def of_rust(path: Path) -> Iterator[tuple[int, str]]:
    """Documentation comments and all strings."""
    source = path.read_text("utf-8")
    for found in _DOC.finditer(source):
        yield (
            source.count("\n", 0, found.start()) + 1,
            blanked(_MARK.sub("", found[0]), _FENCE, _NAME),
        )
    program = _COMMENT.sub("", source)
    for found in _STRING.finditer(program):
        yield program.count("\n", 0, found.start()) + 1, blanked(_CONTINUED.sub("", found[1]), _NAME)


def of_notebook(path: Path) -> Iterator[tuple[int, str]]:
    for number, cell in enumerate(json.loads(path.read_text("utf-8"))["cells"]):
        if cell["cell_type"] == "markdown":
            yield number + 1, blanked("".join(cell["source"]), _FENCE, _NAME)


def of_text(path: Path) -> Iterator[tuple[int, str]]:
    yield 1, path.read_text("utf-8")


READERS = (
    (of_markdown, ROOT, "*.md"),
    (of_markdown, ROOT / "docs", "**/*.md"),
    (of_markdown, ROOT / "crates", "*/README.md"),
    (of_markdown, ROOT / "python", "*.md"),
    (of_markdown, ROOT / "paper", "*.md"),
    (of_python, ROOT / "docs", "*.py"),
    (of_python, ROOT / "release", "*.py"),
    (of_python, ROOT / "python" / "somersault", "**/*.py"),
    (of_python, ROOT / "tour", "**/*.py"),
    (of_rust, ROOT / "crates", "**/*.rs"),
    (of_notebook, ROOT / "python" / "notebooks", "*.ipynb"),
    (of_text, ROOT / "python" / "somersault", "**/*.schema.json"),
    (of_text, ROOT / "docs" / "examples", "*"),
    (of_text, ROOT, "*.cff"),
    (of_text, ROOT, "pyproject.toml"),
    (of_text, ROOT / "crates", "*/Cargo.toml"),
)


@pytest.mark.parametrize(("reader", "folder", "files"), READERS, ids=[files for _, _, files in READERS])
def test_no_word_to_avoid_is_left(reader: object, folder: Path, files: str) -> None:
    assert callable(reader)
    phrases = to_avoid()
    paths = sorted(folder.glob(files))
    assert paths
    left = [
        f"{path.relative_to(ROOT)}:{line + below}: {phrase}"
        for path in paths
        for line, text in reader(path)
        for below, phrase in places(text, phrases)
    ]
    assert not left, "\n".join(left)


def test_words_are_found_where_readers_meet_them(tmp_path: Path) -> None:
    """In prose and messages, wrapped or not; not in names and code."""
    phrases = ["made up", "anew"]
    (tmp_path / "a.md").write_text("Scores are made\nup. `anew`\n\n```python\nanew = 1\n```\nAnew.\n")
    (tmp_path / "a.py").write_text('"""Made up."""\nanew = f"begun {1} anew"\n# anew\n')
    (tmp_path / "a.rs").write_text('/// Made\n/// up, not `anew`.\nlet anew = "is \\\n    anew"; // anew\n')
    for reader, name, count in ((of_markdown, "a.md", 2), (of_python, "a.py", 2), (of_rust, "a.rs", 2)):
        found = [place for _, text in reader(tmp_path / name) for place in places(text, phrases)]
        assert len(found) == count, name


def test_the_table_of_words_is_one() -> None:
    """Each phrase once, in lower case and in order."""
    phrases = to_avoid()
    assert len(phrases) > 50 and phrases == sorted({phrase.lower() for phrase in phrases})
