"""The public names of the package: `python tests/python/public_names.py` rewrites `public_names.txt`.

Public are the package, its modules without an underscore, what these list in `__all__`, and the members of
the classes among it that have no underscore. Modules further down, such as those of `somersault.viewer`, are
parts of the module above them.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from pathlib import Path
from typing import Any

import somersault
from somersault import _somersault

LIST = Path(__file__).with_name("public_names.txt")


def modules() -> list[str]:
    """The public modules."""
    found = (module.name for module in pkgutil.iter_modules(somersault.__path__))
    return ["somersault", *(f"somersault.{name}" for name in found if not name.startswith("_"))]


def extension() -> dict[str, Any]:
    """What the modules of the extension list, by its name there."""
    found = {}
    for name in _somersault.__all__:
        module = getattr(_somersault, name)
        if inspect.ismodule(module):
            found.update({listed: getattr(module, listed) for listed in module.__all__})
    return found


def things() -> dict[str, Any]:
    """The public modules, and what they list, by their whole names."""
    found = {}
    for name in modules():
        found[name] = module = importlib.import_module(name)
        found.update({f"{name}.{listed}": getattr(module, listed) for listed in module.__all__})
    return found


def names() -> list[str]:
    """All public names, sorted."""
    found = set()
    for name, thing in things().items():
        found.add(name)
        found.update(f"{name}.{member}" for member in _members(thing))
    return sorted(found)


def _members(thing: Any) -> set[str]:
    """Names of a class of the package, its own and those it has from other classes of the package."""
    if not inspect.isclass(thing):
        return set()
    own = (parent for parent in thing.__mro__ if parent.__module__.partition(".")[0] == "somersault")
    return {name for parent in own for name in vars(parent) if not name.startswith("_")}


if __name__ == "__main__":
    LIST.write_text("\n".join(names()) + "\n", encoding="utf-8")
