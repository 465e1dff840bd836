"""Everything that the result of a function can depend on, as a digest.

The code of a function is only a part of that. Its result also depends on defaults, on what a closure or a
partial application holds, on the object of a bound method, on the globals and modules that its code names,
and so on for each function that is reached this way. `digest` walks all of it. Code of installed packages
is represented by their versions. What cannot be represented is refused, so that nothing is ignored
silently.
"""

from __future__ import annotations

import builtins
import dis
import functools
import hashlib
import importlib
import importlib.metadata
import importlib.util
import re
import sys
import sysconfig
import types
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from somersault.errors import InputError

__all__ = ["digest"]


def _folders(*names: str) -> tuple[str, ...]:
    return tuple({str(Path(sysconfig.get_path(name)).resolve()) for name in names})


#: Where the standard library and installed packages are.
_STANDARD = _folders("stdlib", "platstdlib")
_INSTALLED = _folders("purelib", "platlib")

#: Members of classes that do nothing.
_OF_CLASSES = frozenset(
    {
        "__dict__",
        "__weakref__",
        "__doc__",
        "__module__",
        "__firstlineno__",
        "__static_attributes__",
        "__match_args__",
    }
)

#: The flag of classes that are written in Python.
_HEAP_TYPE = 1 << 9

#: What runs code that does not stand in the function, and what reads an attribute that its code does not
#: name.
_UNSEEN = frozenset({"eval", "exec", "globals", "__import__", "import_module"})
#: What reads variables of the environment, which are not the function's.
_ENVIRONMENT = frozenset({"environ", "environb", "getenv", "getenvb"})
_ANY_ATTRIBUTE = frozenset({"getattr", "vars", "__dict__", "attrgetter"})


def digest(function: Any) -> str:
    """The hash of all that a function, or a value, reaches.

    Raises
    ------
    somersault.errors.InputError
        If it reaches something that has no representation, such as an open file, a lock or code that is
        only known when
        it runs.
    """
    walk = _Walk()
    walk.reach(function, getattr(function, "__qualname__", type(function).__qualname__))
    return walk.hash.hexdigest()


class _Walk:
    """Writes what it meets into a hash. Functions, classes and modules that were met before are numbers,
    so that recursion ends."""

    def __init__(self) -> None:
        self.hash = hashlib.sha256()
        self.met: dict[int, int] = {}
        #: Modules, and which of their names were looked at.
        self.looked: set[tuple[int, frozenset[str]]] = set()
        #: Keeps what was met alive, since a number of a dead object may be that of another.
        self.alive: list[Any] = []

    def write(self, *parts: Any) -> None:
        # lengths keep the parts of neighbours apart
        for part in parts:
            text = repr(part).encode("utf-8", "surrogatepass")
            self.hash.update(b"%d:" % len(text) + text)

    def is_new(self, thing: Any) -> bool:
        """Whether it is met for the first time; otherwise its number is written."""
        if id(thing) in self.met:
            self.write("met", self.met[id(thing)])
            return False
        self.met[id(thing)] = len(self.met)
        self.alive.append(thing)
        return True

    def reach(self, thing: Any, where: str) -> None:
        match thing:
            case functools.partial():
                self.write("partial")
                self.reach(thing.func, where)
                self.reach(list(thing.args), f"the arguments of {where}")
                self.reach(dict(thing.keywords), f"the arguments of {where}")
            case types.MethodType():
                self.write("method")
                self.reach(thing.__func__, where)
                self.reach(thing.__self__, f"`self` of {where}")
            case types.FunctionType():
                self.function(thing, where)
            case types.ModuleType():
                self.module(thing)
            case type():
                self.kind(thing, where)
            case (
                types.BuiltinFunctionType()
                | types.MethodDescriptorType()
                | types.WrapperDescriptorType()
                | types.MethodWrapperType()
                | types.ClassMethodDescriptorType()
            ):
                self.builtin(thing, where)
            case np.ufunc():
                self.write("ufunc", thing.__name__, np.__version__)
            case property():
                for part in (thing.fget, thing.fset):
                    self.reach(part, where)
            case staticmethod() | classmethod():
                self.write(type(thing).__name__)
                self.reach(thing.__func__, where)
            case types.CodeType():
                self.code(thing, where)
            case _:
                self.value(thing, where)

    def function(self, function: types.FunctionType, where: str) -> None:
        wrapped = getattr(function, "__wrapped__", None)
        if package := _package(function.__module__, function.__code__.co_filename):
            self.write("installed", package, function.__module__, function.__qualname__)
            return
        if not self.is_new(function):
            return
        self.write("function", function.__qualname__)
        if unseen := sorted(_UNSEEN & set(_names(function.__code__))):
            raise self.refused(where, f"calls `{unseen[0]}`, so that what it runs is not known before")
        if read := sorted(_ENVIRONMENT & set(_names(function.__code__))):
            raise self.refused(where, f"reads the environment by `{read[0]}`")
        self.code(function.__code__, where)
        self.reach(function.__defaults__, f"a default of {where}")
        self.reach(function.__kwdefaults__, f"a default of {where}")
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            try:
                value = cell.cell_contents
            except ValueError:
                self.write("empty", name)
                continue
            self.write("closure", name)
            self.reach(value, f"`{name}` that {where} encloses")
        names = set(_names(function.__code__))
        for name, value in _globals(function):
            self.write("global", name)
            self.named(value, names, f"the global `{name}` of {where}")
        for name in _imports(function):
            self.write("import", name)
            self.imported(name, function, where)
        for name, value in sorted(vars(function).items()):
            if value is not wrapped:
                self.write("attribute", name)
                self.reach(value, f"the attribute `{name}` of {where}")
        if wrapped is not None:
            self.reach(wrapped, where)

    def code(self, code: types.CodeType, where: str) -> None:
        """What is executed, without the lines and the file it stands on."""
        self.write(
            "code",
            code.co_code,
            code.co_names,
            code.co_varnames,
            code.co_freevars,
            code.co_cellvars,
            code.co_argcount,
            code.co_posonlyargcount,
            code.co_kwonlyargcount,
            code.co_flags,
            getattr(code, "co_exceptiontable", b""),
            sys.version_info[:2],
        )
        for constant in code.co_consts:
            if isinstance(constant, frozenset):
                # in an order of its own in each process
                self.write("frozenset", sorted(map(repr, constant)))
            else:
                self.reach(constant, f"a constant of {where}")

    def kind(self, kind: type, where: str) -> None:
        """A class: of the user by its members and bases, of others by the version of their package."""
        if package := _package(kind.__module__, _file_of(kind.__module__)):
            self.write("installed", package, kind.__module__, kind.__qualname__)
            return
        if not self.is_new(kind):
            return
        self.write("class", kind.__qualname__)
        for base in kind.__bases__:
            self.reach(base, f"a base of {where}")
        for name, value in sorted(vars(kind).items()):
            if name in _OF_CLASSES or name.startswith(("_abc_", "__annotat", "__dataclass_")):
                continue
            if isinstance(value, types.MemberDescriptorType | types.GetSetDescriptorType):
                self.write("slot", name)
                continue
            self.write("member", name)
            self.reach(value, f"`{name}` of {where}")

    def module(self, module: types.ModuleType) -> None:
        """An installed module by the version of its package, one of the user's by all that is in it."""
        if package := _package(module.__name__, getattr(module, "__file__", None)):
            self.write("installed", package, module.__name__)
        elif self.is_new(module):
            self.write("module", module.__name__)
            for name, value in sorted(vars(module).items()):
                if not (name.startswith("__") and name.endswith("__")):
                    self.write("of module", name)
                    self.reach(value, f"`{name}` of the module `{module.__name__}`")

    def named(self, value: Any, names: set[str], where: str) -> None:
        """A value; of a module of the user's only what the code names, where it names all that it uses."""
        if (
            not isinstance(value, types.ModuleType)
            or names & _ANY_ATTRIBUTE
            or _package(value.__name__, getattr(value, "__file__", None))
        ):
            self.reach(value, where)
            return
        self.write("module", value.__name__)
        looked = id(value), frozenset(names)
        if looked in self.looked:
            return
        self.looked.add(looked)
        for used in sorted(names & set(vars(value))):
            self.write("of module", used)
            self.named(vars(value)[used], names, f"`{used}` of the module `{value.__name__}`")

    def imported(self, name: str, function: types.FunctionType, where: str) -> None:
        """What is imported when the function is called."""
        try:
            module = importlib.import_module(name)
        except ImportError:
            self.write("absent")
            return
        self.named(module, set(_names(function.__code__)), where)
        top = sys.modules[name.partition(".")[0]]
        if top is not module:
            self.named(top, set(_names(function.__code__)), where)

    def builtin(self, thing: Any, where: str) -> None:
        """A function that is compiled."""
        owner = getattr(thing, "__self__", None)
        kind = owner if isinstance(owner, type) else type(owner)
        home = getattr(thing, "__module__", None) or getattr(thing, "__objclass__", kind).__module__
        package = _package(home, _file_of(home))
        if package is None:
            raise self.refused(where, f"is compiled, in the module `{home}`")
        self.write("builtin", package, home, thing.__qualname__)
        if owner is not None and not isinstance(owner, types.ModuleType):
            self.reach(owner, f"`self` of {where}")

    def refused(self, where: str, reason: str) -> InputError:
        return InputError(f"{where} {reason}: give `version` to say what records are of")

    def value(self, thing: Any, where: str) -> None:
        """Anything that is no code."""
        if thing is None or thing is ... or isinstance(thing, bool | str | bytes | int | float | complex):
            self.write(type(thing).__name__, _exactly(thing))
        elif isinstance(thing, Enum):
            self.reach(type(thing), where)
            self.write("member", thing.name)
        elif isinstance(thing, list | tuple):
            self.write(type(thing).__name__, len(thing))
            for i, item in enumerate(thing):
                self.reach(item, f"{where}[{i}]")
        elif isinstance(thing, set | frozenset):
            digests = sorted(self.apart(item, where) for item in thing)
            self.write(type(thing).__name__, digests)
        elif isinstance(thing, Mapping) and type(thing).__module__ in ("builtins", "types", "collections"):
            # the order of a dictionary may matter to whom it is given
            self.write(type(thing).__name__, len(thing))
            for key, item in thing.items():
                self.reach(key, f"a key of {where}")
                self.reach(item, f"{where}[{key!r:.40}]")
        elif isinstance(thing, np.random.Generator):
            self.write("generator")
            self.reach(thing.bit_generator.state, where)
        elif isinstance(thing, np.dtype):
            self.write("dtype", thing.str, thing.descr)
        elif isinstance(thing, re.Pattern):
            self.write("pattern", thing.pattern, thing.flags)
        elif isinstance(thing, Path):
            self.write("path", str(thing))
        elif isinstance(thing, slice | range):
            self.write(repr(thing))
        elif type(thing) is np.ndarray and thing.dtype.kind != "O":
            self.write("array", thing.dtype.str, thing.dtype.descr, thing.shape)
            self.hash.update(np.ascontiguousarray(thing).tobytes())
        elif hasattr(thing, "__wrapped__"):
            # as functools.lru_cache makes them
            self.write("wrapper", type(thing).__qualname__)
            self.reach(thing.__wrapped__, where)
        else:
            self.object(thing, where)

    def object(self, thing: Any, where: str) -> None:
        """An object: one of an installed class by what its pickle is made of, one of the user's by class
        and attributes."""
        if not self.is_new(thing):
            return
        kind = type(thing)
        self.write("object")
        self.reach(kind, where)
        if _package(kind.__module__, _file_of(kind.__module__)):
            self.pickled(thing, where)
            return
        slots = [name for base in kind.__mro__ for name in _slots(base)]
        held = {name: getattr(thing, name) for name in slots if hasattr(thing, name)}
        for name, item in sorted((held | dict(getattr(thing, "__dict__", {}))).items()):
            self.write("holds", name)
            self.reach(item, f"`{name}` of {where}")
        for base in kind.__mro__:
            if base in (list, tuple, dict, set, frozenset, int, float, complex, str, bytes):
                self.reach(base(thing), where)
            elif base is not object and not base.__flags__ & _HEAP_TYPE:
                self.pickled(thing, where)

    def pickled(self, thing: Any, where: str) -> None:
        """What an object is made of where it is pickled."""
        try:
            parts = thing.__reduce_ex__(4)
        except Exception as fault:
            kind = type(thing)
            raise self.refused(
                where, f"is a {kind.__module__}.{kind.__qualname__}, which has no representation ({fault})"
            ) from None
        if isinstance(parts, str):
            self.write("named", parts)
            return
        maker, arguments, *state = parts
        self.write("made by", getattr(maker, "__qualname__", repr(type(maker))))
        self.reach(arguments, where)
        for part in state[:1]:
            self.reach(part, where)
        for part in state[1:3]:
            self.reach(None if part is None else list(part), where)

    def apart(self, thing: Any, where: str) -> str:
        """The hash of something by itself."""
        walk = _Walk()
        walk.reach(thing, where)
        return walk.hash.hexdigest()


def _exactly(thing: Any) -> Any:
    return (
        thing.hex()
        if isinstance(thing, float)
        else (thing.real.hex(), thing.imag.hex())
        if isinstance(thing, complex)
        else thing
    )


def _nested(code: types.CodeType) -> Iterator[types.CodeType]:
    """A code and those of the functions in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _nested(constant)


def _names(code: types.CodeType) -> list[str]:
    """The names of globals and attributes that a code uses."""
    return [name for inner in _nested(code) for name in inner.co_names]


def _imports(function: types.FunctionType) -> list[str]:
    """The modules that a function imports when it is called, by their full names."""
    found = set()
    for code in _nested(function.__code__):
        steps = list(dis.get_instructions(code))
        for i, step in enumerate(steps):
            if step.opname == "IMPORT_NAME":
                # its level and the names wanted of it are the two constants before
                level, name = steps[i - 2].argval, str(step.argval)
                package = str(function.__globals__.get("__package__") or "")
                found.add(importlib.util.resolve_name("." * level + name, package) if level else name)
    return sorted(found)


def _globals(function: types.FunctionType) -> Iterator[tuple[str, Any]]:
    """The globals that a function names."""
    names = {
        str(step.argval)
        for inner in _nested(function.__code__)
        for step in dis.get_instructions(inner)
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS")
    }
    for name in sorted(names):
        if name in function.__globals__:
            yield name, function.__globals__[name]
        elif not hasattr(builtins, name):
            yield name, "absent"


def _slots(kind: type) -> list[str]:
    slots = vars(kind).get("__slots__", ())
    return [
        name
        for name in ([slots] if isinstance(slots, str) else slots)
        if name not in ("__dict__", "__weakref__")
    ]


def _file_of(module: str | None) -> str | None:
    return getattr(sys.modules.get(module or ""), "__file__", None)


def _package(module: str | None, file: str | None) -> str | None:
    """Name and version of the installed package that a module belongs to, or None for the user's own."""
    top = (module or "").partition(".")[0]
    if top == "somersault":
        # the manifest has its version
        return "somersault"
    place = "" if file is None or file.startswith("<") else str(Path(file).resolve())
    if place.startswith(_INSTALLED):
        return f"{top} {_version(top)}"
    # a module of the user's may have the name of a standard one
    if top in sys.stdlib_module_names and (not place or place.startswith(_STANDARD)):
        return f"python {sys.version_info.major}.{sys.version_info.minor}"
    return None


@functools.cache
def _version(top: str) -> str:
    loaded = getattr(sys.modules.get(top), "__version__", None)
    if isinstance(loaded, str):
        return loaded
    for distribution in importlib.metadata.packages_distributions().get(top, ()):
        return importlib.metadata.version(distribution)
    return "?"
