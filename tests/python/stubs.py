"""What stubs have that follows from the extension: `python tests/python/stubs.py` writes it anew.

A stub is written by hand down to the line `WRITTEN`. Below it stands what the module lists and the part above
does not define, with the types that its documentation says: a class or a function that is added to a table of
the extension needs no edit here. Private dictionaries of classes are written with a name for any one of them:
`_NormalLaw` for `_NORMAL_LAWS`. The names under `__all__` are those of the module. mypy.stubtest holds all of
it against the extension.
"""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from somersault import _somersault

FOLDER = Path(__file__).parents[2] / "python" / "somersault" / "_somersault"
WRITTEN = "# `make public-names` writes what follows, from the documentation of the extension."


def stubs() -> dict[Path, str]:
    """The text of each stub, by its path."""
    modules = {name: getattr(_somersault, name) for name in _somersault.__all__}
    paths = {FOLDER / f"{name}.pyi": thing for name, thing in modules.items() if inspect.ismodule(thing)}
    return {path: _stub(path, module) for path, module in paths.items()}


def _stub(path: Path, module: Any) -> str:
    by_hand, _, _ = path.read_text(encoding="utf-8").partition(WRITTEN)
    names = "".join(f'    "{name}",\n' for name in sorted(module.__all__))
    by_hand = re.sub(
        r"(?s)^__all__ = \[.*?\]$", f"__all__ = [\n{names}]", by_hand, count=1, flags=re.MULTILINE
    )
    nodes = ast.parse(by_hand).body
    defined = {node.name for node in nodes if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    defined |= {ast.unparse(node.target) for node in nodes if isinstance(node, ast.AnnAssign)}
    missing = [name for name in sorted(module.__all__) if name not in defined]
    tables = [name for name, thing in sorted(vars(module).items()) if _is_table(name, thing)]
    written = [_table(name, getattr(module, name)) for name in tables]
    written += [_definition(name, getattr(module, name)) for name in missing]
    if not written:
        return by_hand
    return _formatted(f"{by_hand.rstrip()}\n\n{WRITTEN}\n\n" + "\n".join(written))


def _formatted(text: str) -> str:
    command = [sys.executable, "-m", "ruff", "format", "--stdin-filename", str(FOLDER / "stub.pyi"), "-"]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


def _is_table(name: str, thing: Any) -> bool:
    return (
        name.startswith("_")
        and isinstance(thing, dict)
        and bool(thing)
        and all(map(inspect.isclass, thing.values()))
    )


def _table(name: str, classes: dict[str, type]) -> str:
    one = "_" + "".join(word.capitalize() for word in name.strip("_").removesuffix("S").split("_"))
    kinds = " | ".join(kind.__name__ for kind in classes.values())
    return f"{one}: TypeAlias = {kinds}\n{name}: dict[str, type[{one}]]\n"


def _definition(name: str, thing: Any) -> str:
    return _class(name, thing) if inspect.isclass(thing) else _function(name, thing)


def _class(name: str, thing: type) -> str:
    lines = [f"@final\nclass {name}:\n", _function("__new__", thing, "cls", default=name)]
    members = {key: value for key, value in vars(thing).items() if not key.startswith("_")}
    for key, member in sorted(members.items()):
        if inspect.isgetsetdescriptor(member):
            said, colon, _ = (inspect.getdoc(member) or "").partition(":")
            if not colon:
                raise ValueError(f"the documentation of {name}.{key} must begin with a type and a colon")
            lines.append(f"@property\ndef {key}(self) -> {_type(said, returned=True)}: ...\n")
        elif isinstance(member, staticmethod):
            lines.append("@staticmethod\n" + _function(key, getattr(thing, key), default=name))
        else:
            lines.append(_function(key, member, "self"))
    if "__eq__" in vars(thing):
        lines += [f"def {key}(self, other: object, /) -> bool: ...\n" for key in ("__eq__", "__ne__")]
    lines.append("def __reduce__(self) -> tuple[Any, ...]: ...\n")
    return lines[0] + "".join(re.sub("(?m)^", "    ", line.rstrip("\n")) + "\n" for line in lines[1:])


def _function(name: str, thing: Any, first: str = "", *, default: str = "None") -> str:
    """Its signature; it returns what the documentation says, or else the default."""
    parameters, returned = _documented(inspect.getdoc(thing) or "", f"`{name}`")
    arguments = [first] if first else []
    keyword_only = False
    for parameter in inspect.signature(thing).parameters.values():
        if parameter.name == "self":
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword_only:
            keyword_only = True
            arguments.append("*")
        if parameter.name not in parameters:
            raise ValueError(f"the documentation of `{name}` must say what `{parameter.name}` is")
        arguments.append(_argument(parameter, parameters[parameter.name]))
    return f"def {name}({', '.join(arguments)}) -> {returned or default}: ...\n"


def _argument(parameter: inspect.Parameter, said: str) -> str:
    kind, default = _type(said), parameter.default
    if default is parameter.empty:
        return f"{parameter.name}: {kind}"
    if default is None:
        return f"{parameter.name}: {kind} | None = None"
    shown = repr(default) if isinstance(default, bool | int | float | str) else "..."
    return f"{parameter.name}: {kind} = {shown}"


def _documented(text: str, where: str) -> tuple[dict[str, str], str]:
    """The types of the parameters and of what is returned, as numpydoc has them."""
    parameters: dict[str, str] = {}
    for line in _section(text, "Parameters"):
        names, colon, said = line.partition(" : ")
        if not colon:
            raise ValueError(f"the documentation of {where} must say the type of {names}")
        parameters |= {name.strip(): said for name in names.split(",")}
    returned = next(_section(text, "Returns"), None)
    return parameters, _type(returned, returned=True) if returned else ""


def _section(text: str, title: str) -> Iterator[str]:
    """The lines of a section that are not further in than its title."""
    _, found, rest = text.partition(f"{title}\n{'-' * len(title)}\n")
    for line in rest.partition("\n\n")[0].splitlines() if found else ():
        if not line.startswith(" "):
            yield line


def _type(said: str, *, returned: bool = False) -> str:
    """The type that a phrase of the documentation stands for."""
    said = re.sub(r",? *optional$", "", said).strip()
    if said.startswith("{"):
        values = ", ".join(repr(value) for value in ast.literal_eval(f"[{said[1:-1]}]"))
        return f"Literal[{values}]"
    said = re.sub(r", shape .*", "", said)
    if " or " in said:
        return " | ".join(_type(part, returned=returned) for part in said.split(" or "))
    if found := re.fullmatch(r"(sequence|tuple|list) of (\w+)", said):
        inner = _type(found[2], returned=returned)
        made = {"tuple": f"tuple[{inner}, ...]", "list": f"list[{inner}]"} if returned else {}
        return made.get(found[1], f"Sequence[{inner}]")
    if said == "ndarray":
        return "_Floats"
    if said == "array_like":
        return "ArrayLike"
    if not re.fullmatch(r"[A-Za-z]\w*", said):
        raise ValueError(f"no type is known for `{said}`")
    return said


if __name__ == "__main__":
    for path, text in stubs().items():
        path.write_text(text, encoding="utf-8")
