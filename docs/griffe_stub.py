"""Reads the reference: types from the stubs of the extension, texts from the extension itself."""

import inspect
import re
from typing import Any

import griffe

from somersault import _somersault

# From a prompt to the next empty line.
_EXAMPLE = re.compile(r"^>>> .*?(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
# The star of x*, which Markdown takes for emphasis.
_STAR = re.compile(r"(?<=[A-Za-z])\*(?!\*)")

#: Options that are passed on as a whole are described by name.
_OPTIONS = griffe.NumpyOptions(warn_unknown_params=False, warn_missing_types=False)


class Texts(griffe.Extension):
    """What a stub has not."""

    def on_module(self, *, mod: griffe.Module, **_: Any) -> None:
        """Shows the examples of a module as code: its docstring has them in the text, without a section."""
        if mod.docstring is not None:
            mod.docstring.value = _EXAMPLE.sub(r"```pycon\n\g<0>\n```", mod.docstring.value)

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Gives an object of the extension its docstring."""
        prefix = "somersault._somersault."
        if not obj.path.startswith(prefix):
            return
        found: Any = _somersault
        for name in obj.path.removeprefix(prefix).split("."):
            found = getattr(found, name, None)
        text = inspect.getdoc(found) if found is not None else None
        if text and not obj.name.startswith("_"):
            text = _STAR.sub(r"\\*", text)
            obj.docstring = griffe.Docstring(text, parent=obj, parser="numpy", parser_options=_OPTIONS)

    def on_class(self, *, cls: griffe.Class, **_: Any) -> None:
        """Shows the arguments of `__new__` with the name of the class."""
        if "__new__" in cls.members and "__init__" not in cls.members:
            made = cls.members["__new__"]
            made.name = "__init__"
            cls.set_member("__init__", made)
            cls.del_member("__new__")
