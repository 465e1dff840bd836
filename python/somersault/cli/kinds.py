"""What documents name and the extension has tables of: laws of contact and named models."""

from __future__ import annotations

import inspect
from typing import Any

from somersault._somersault.contact import _FRICTION_LAWS as FRICTION_LAWS
from somersault._somersault.contact import _NORMAL_LAWS as NORMAL_LAWS
from somersault._somersault.multibody import _NAMED_MODELS as NAMED_MODELS

__all__ = ["DEFAULT_LAW", "FRICTION_LAWS", "NAMED_MODELS", "NORMAL_LAWS", "definitions"]

DEFAULT_LAW = "compliant"


def definitions() -> dict[str, Any]:
    """The definitions of a schema that follow from the tables."""
    return {
        "law": _schema(NORMAL_LAWS, DEFAULT_LAW),
        "friction": _schema(FRICTION_LAWS),
        "named_model": {"enum": list(NAMED_MODELS)},
    }


def _schema(classes: dict[str, Any], default: str | None = None) -> dict[str, Any]:
    """Objects with the constants of one of these classes, all of them numbers, and its kind."""
    constants = {kind: inspect.signature(made).parameters for kind, made in classes.items()}
    names = list(dict.fromkeys(name for taken in constants.values() for name in taken))
    return {
        "type": "object",
        "required": [] if default else ["kind"],
        "additionalProperties": False,
        "properties": {"kind": {"enum": list(classes)}, **{name: {"type": "number"} for name in names}},
        "allOf": [
            {
                "if": {
                    "required": [] if kind == default else ["kind"],
                    "properties": {"kind": {"const": kind}},
                },
                "then": {
                    "description": (inspect.getdoc(classes[kind]) or "").partition("\n")[0],
                    "required": [name for name, one in taken.items() if one.default is one.empty],
                    "properties": {name: False for name in names if name not in taken},
                },
            }
            for kind, taken in constants.items()
        ],
    }
