"""The lines on which the values of a TOML or JSON document stand.

The parsers of both formats forget where they read a value. This walk over a document that they have accepted
finds it again: it knows strings, brackets and separators, and nothing else of the formats.
"""

from __future__ import annotations

import json
import re

Path = tuple["str | int", ...]

_TOKEN = re.compile(
    r"""(?P<space>[ \t\r]+|\#[^\n]*)
    |(?P<newline>\n)
    |(?P<string>\"{3}(?:\\.|[^\\])*?\"{3,5}|'{3}.*?'{3,5}|"(?:\\.|[^"\\])*"|'[^'\n]*')
    |(?P<sign>[\[\]{},=:.])
    |(?P<bare>[^\s\[\]{},=:."'\#]+)""",
    re.VERBOSE | re.DOTALL,
)


class Repeated(Exception):
    """A name that occurs twice in one table, which the parser of JSON lets pass: where, and on which line."""

    def __init__(self, path: Path, line: int) -> None:
        super().__init__(path, line)
        self.path = path
        self.line = line


def lines(text: str, toml: bool) -> dict[Path, int]:
    """The line of each value, counted from 1, by the keys and indices that lead to it."""
    walk = _Walk(text)
    if toml:
        walk.statements()
    else:
        walk.value(())
    return walk.found


class _Walk:
    def __init__(self, text: str) -> None:
        self.found: dict[Path, int] = {(): 1}
        self.tokens = []
        line = 1
        for match in _TOKEN.finditer(text):
            if match.lastgroup != "space":
                self.tokens.append((match.lastgroup, match.group(), line))
            line += match.group().count("\n")
        self.at = 0

    def peek(self) -> str:
        return self.tokens[self.at][1] if self.at < len(self.tokens) else ""

    def take(self) -> tuple[str | None, str, int]:
        self.at += 1
        return self.tokens[self.at - 1]

    def skip_lines(self) -> None:
        while self.peek() == "\n":
            self.at += 1

    def keys(self) -> list[str]:
        """A key, dotted or not."""
        found = []
        while True:
            kind, token, _ = self.take()
            found.append(_unquoted(token) if kind == "string" else token)
            if self.peek() != ".":
                return found
            self.at += 1

    def put(self, path: Path, line: int) -> None:
        for n in range(1, len(path) + 1):
            self.found.setdefault(path[:n], line)

    def statements(self) -> None:
        """A TOML document: headers of tables, and keys with values."""
        table: Path = ()
        counts: dict[Path, int] = {}
        while True:
            self.skip_lines()
            if self.at == len(self.tokens):
                return
            line = self.tokens[self.at][2]
            if self.peek() != "[":
                path = (*table, *self.keys())
                self.put(path, line)
                self.at += 1
                self.value(path)
                continue
            many = self.tokens[self.at + 1][1] == "["
            self.at += 2 if many else 1
            table = ()
            keys = self.keys()
            for i, key in enumerate(keys):
                table = (*table, key)
                if many and i == len(keys) - 1:
                    counts[table] = counts.get(table, 0) + 1
                if table in counts:
                    table = (*table, counts[table] - 1)
            self.at += 2 if many else 1
            self.put(table, line)

    def value(self, path: Path) -> None:
        """A value of either format, of which brackets have values inside."""
        self.skip_lines()
        opening = self.peek()
        if opening not in ("[", "{"):
            # Dates and floats are several tokens.
            while self.at < len(self.tokens) and self.peek() not in ("\n", ",", "]", "}"):
                self.at += 1
            return
        self.at += 1
        index = 0
        while True:
            self.skip_lines()
            if self.peek() in ("]", "}"):
                self.at += 1
                return
            line = self.tokens[self.at][2]
            if opening == "[":
                inner: Path = (*path, index)
            else:
                inner = (*path, *self.keys())
                self.skip_lines()
                self.at += 1
                if inner in self.found:
                    raise Repeated(inner, line)
            self.put(inner, line)
            self.value(inner)
            index += 1
            self.skip_lines()
            if self.peek() == ",":
                self.at += 1


def _unquoted(token: str) -> str:
    if token.startswith("'"):
        return token.strip("'")
    # The escapes of TOML are those of JSON, but for \U.
    return str(json.loads(re.sub(r"\\U(\w{8})", lambda code: chr(int(code[1], 16)), token)))
