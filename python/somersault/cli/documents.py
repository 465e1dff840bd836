"""Inputs of the command line: TOML or JSON, checked against a schema, with errors that name the line."""

from __future__ import annotations

import contextlib
import difflib
import json
import math
import re
import sys
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

from somersault.cli import kinds, positions
from somersault.errors import InputError

__all__ = ["Document", "DocumentError", "read", "schema"]


class DocumentError(InputError):
    """A document is not what a command takes: the message begins with its name and the line."""


class Document:
    """The values of a document, and where they stand."""

    def __init__(self, path: Path, values: dict[str, Any], lines: dict[positions.Path, int]) -> None:
        self.path = path
        self.values = values
        self._lines = lines

    def fault(self, where: positions.Path, message: str) -> DocumentError:
        """An error at a value, or at what holds it where the value itself is missing."""
        known = next(where[:n] for n in range(len(where), -1, -1) if where[:n] in self._lines)
        place = ".".join(str(key) for key in where)
        return DocumentError(f"{self.path}:{self._lines[known]}: {place}{': ' if place else ''}{message}")

    @contextlib.contextmanager
    def at(self, *where: str | int) -> Iterator[None]:
        """What is refused inside is refused at these values; those that are not there are passed over."""
        try:
            yield
        except DocumentError:
            raise
        except (InputError, OSError) as fault:
            present = where if where in self._lines else where[:-1]
            raise self.fault(self.named(present, str(fault)), str(fault)) from fault

    def named(self, where: positions.Path, message: str) -> positions.Path:
        """The value of a table that a message of the library names first, or else the table."""
        table: Any = self.values
        for key in where:
            table = table[key]
        if isinstance(table, dict):
            for word in re.findall(r"\w+", message):
                if word in table:
                    return (*where, word)
        return where


def schema(name: str) -> dict[str, Any]:
    """The JSON schema of the inputs of a command."""
    text = files("somersault.cli").joinpath("schemas", f"{name}.schema.json").read_text("utf-8")
    found: dict[str, Any] = json.loads(text)
    if name == "integrate":
        found["$defs"] |= kinds.definitions()
    return found


def read(path: Path, name: str) -> Document:
    """Reads a document, JSON if its name ends so and TOML otherwise, and checks it against a schema."""
    toml = path.suffix.lower() != ".json"
    try:
        # Some editors begin a file with a mark of the byte order.
        text = path.read_text("utf-8-sig")
    except OSError as fault:
        raise DocumentError(f"{path}: {fault.strerror}") from None
    except UnicodeDecodeError as fault:
        raise DocumentError(f"{path}: is not text in UTF-8: {fault}") from None
    try:
        values = _parse_toml(text, path) if toml else _parse_json(text, path)
        document = Document(path, values, positions.lines(text.replace("\r\n", "\n"), toml))
    except RecursionError:
        raise DocumentError(f"{path}: is nested too deeply") from None
    except positions.Repeated as twice:
        raise DocumentError(f"{path}:{twice.line}: `{twice.path[-1]}` occurs twice in one table") from None
    _check_numbers(document, values, (), infinite=toml)
    _check(document, schema(name))
    return document


def _parse_toml(text: str, path: Path) -> Any:
    # Another module of the same interface stands in for the standard one before Python 3.11.
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        found = re.fullmatch(r"(?s)(.*) \(at line (\d+), column (\d+)\)", str(fault))
        line, message = (found[2], found[1]) if found else (text.count("\n") + 1, str(fault))
        raise DocumentError(f"{path}:{line}: {message[0].lower()}{message[1:]}") from None
    except ValueError:
        raise _too_long(text, path) from None


def _parse_json(text: str, path: Path) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as fault:
        raise DocumentError(f"{path}:{fault.lineno}: {fault.msg[0].lower()}{fault.msg[1:]}") from None
    except ValueError:
        raise _too_long(text, path) from None


def _too_long(text: str, path: Path) -> DocumentError:
    """Python reads whole numbers of some thousand digits, and says nothing about the place of longer ones."""
    digits = max(re.finditer(r"[\d_]+", text), key=lambda match: len(match[0]))
    line = text.count("\n", 0, digits.start()) + 1
    return DocumentError(f"{path}:{line}: a number of {len(digits[0])} digits is too long")


def _check_numbers(document: Document, value: Any, where: positions.Path, infinite: bool) -> None:
    """Refuses NaN, whole numbers beyond 64 bits and, in JSON, which has no word for it, infinity."""
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            _check_numbers(document, inner, (*where, key), infinite)
    elif isinstance(value, float) and (math.isnan(value) or (math.isinf(value) and not infinite)):
        raise document.fault(where, f"must be a number, found {value}")
    elif isinstance(value, int) and abs(value) >= 2**63:
        raise document.fault(
            where, f"must be a number below 2^63, found one of {len(str(abs(value)))} digits"
        )


def _check(document: Document, against: dict[str, Any]) -> None:
    """Refuses a document that the schema does: unknown names first, then in the order of the keys."""
    from jsonschema import Draft202012Validator

    faults = list(Draft202012Validator(against).iter_errors(document.values))
    for fault in sorted(faults, key=lambda fault: fault.validator != "additionalProperties"):
        raise document.fault(_where(fault), _words(fault))


def _where(error: Any) -> positions.Path:
    place = tuple(error.absolute_path)
    if error.validator == "additionalProperties":
        return (*place, _unknown(error)[0])
    return place


def _unknown(error: Any) -> list[str]:
    allowed = error.schema.get("properties", {})
    return [key for key in error.instance if key not in allowed]


def _words(error: Any) -> str:
    """What is wrong, what was found and what is allowed."""
    match error.validator:
        case "additionalProperties":
            names = sorted(error.schema["properties"])
            meant = _meant(_unknown(error)[0], names)
            return f"is not known here; allowed are {', '.join(names)}{meant}"
        case "enum":
            values = [str(value) for value in error.validator_value]
            meant = _meant(str(error.instance), values)
            return f"must be one of {', '.join(values)}, found {error.instance!r:.60}{meant}"
        case "type":
            return f"must be {_kind(error.validator_value)}, found {error.instance!r:.60}"
        case "minItems" | "maxItems":
            bounds = [error.schema.get(bound) for bound in ("minItems", "maxItems")]
            if bounds[0] == bounds[1]:
                allowed = f"have {bounds[0]}"
            else:
                allowed = (
                    f"have at {'least' if error.validator == 'minItems' else 'most'} {error.validator_value}"
                )
            return f"must {allowed} entries, found {len(error.instance)}"
        case "oneOf" | "anyOf" if all("required" in option for option in error.validator_value):
            names = [" and ".join(option["required"]) for option in error.validator_value]
            keys = [key for option in error.validator_value for key in option["required"]]
            found = [key for key in keys if key in error.instance]
            one = "exactly one" if error.validator == "oneOf" else "one"
            return f"needs {one} of {', '.join(names)}; found {', '.join(found) or 'none'}"
        case "oneOf" | "anyOf":
            kinds = [option.get("description", "something else") for option in error.validator_value]
            return f"must be {' or '.join(kinds)}, found {error.instance!r:.60}"
        case _:
            return str(error.message)


def _meant(found: str, allowed: list[str]) -> str:
    """The end of a message about a name that is unknown: the known one that was perhaps meant."""
    closest = difflib.get_close_matches(found, allowed, 1)
    return f"; did you mean {closest[0]}?" if closest else ""


def _kind(names: str | list[str]) -> str:
    words = {"object": "a table", "array": "a list", "number": "a number", "string": "text"}
    words |= {"integer": "a whole number", "boolean": "true or false"}
    return " or ".join(words.get(name, name) for name in ([names] if isinstance(names, str) else names))
