"""Calls of everything public with arguments that are wrong.

The examples of the docstrings, the README and the book are run, and every call of somersault in them is a
start: one or two of its arguments are replaced by what they must not be, or may be, such as NaN, other
types and shapes, huge counts and callables that fail. A call may return or raise what is documented, and
nothing else: no abort, no panic, no other exception, and after a signal it ends within half a second.

    python tests/python/mutated_calls.py --calls 30000    # all of it, in child processes: `make mutate`
    python tests/python/mutated_calls.py --only 1234      # one call again, by its number
"""

from __future__ import annotations

import argparse
import ast
import collections
import contextlib
import doctest
import faulthandler
import functools
import importlib
import inspect
import io
import multiprocessing
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
MODULES = (
    *(
        "",
        ".batch",
        ".contact",
        ".exact",
        ".exam",
        ".expr",
        ".forces",
        ".ftla",
        ".integrators",
        ".motion",
        ".multibody",
        ".ocp",
    ),
    # not those of `plotting`: what matplotlib raises is its own
    *(".storage", ".studies", ".sweep", ".viewer"),
)
#: That on sweeps begins a cluster.
PAGES = ("README.md", "docs/start.md", "docs/guides/[!s]*.md", "docs/guides/satellite.md", "docs/theory/*.md")

#: Seconds after which a call gets a signal, and within which it must then end.
PATIENCE = 5.0
PROMPT = 0.5
#: Bytes that a call may take beyond what there is.
MEMORY = 3 << 30
#: Entries of an array of which a changed copy is made.
MOST_CHANGED = 10_000_000
#: Seconds that an example may take to be a start.
SLOWEST = 2.0
#: Starts of one function: more would be more of the same.
STARTS = 6


@dataclass(frozen=True)
class Start:
    """A call that is known to work."""

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    keywords: dict[str, Any]
    seconds: float


class _Recorded(ast.NodeTransformer):
    """Has every call `f(...)` go by way of `__recorded__(f, ...)`."""

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id in ("super", "locals", "globals"):
            return node
        return ast.copy_location(
            ast.Call(ast.Name("__recorded__", ast.Load()), [node.func, *node.args], node.keywords), node
        )


class Recorder:
    """Runs examples and keeps the calls of somersault in them."""

    def __init__(self) -> None:
        self.starts: dict[str, list[Start]] = collections.defaultdict(list)
        self.depth = 0

    def __call__(self, function: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
        name = name_of(function)
        if name is None:
            return function(*arguments, **keywords)
        began = time.monotonic()
        result = function(*arguments, **keywords)
        seconds = time.monotonic() - began
        known = self.starts[name]
        if len(known) < STARTS and not any(isinstance(one, Iterator) for one in arguments):
            known.append(Start(name, function, arguments, keywords, seconds))
        return result

    def run(self, source: str, names: dict[str, Any]) -> None:
        names["__recorded__"] = self
        for statement in ast.parse(source).body:
            tree = ast.Module([_Recorded().visit(statement)], [])
            with contextlib.suppress(Exception):
                exec(compile(ast.fix_missing_locations(tree), "example", "exec"), names)


def name_of(function: Any) -> str | None:
    """The name of something public of somersault."""
    if "<locals>" in getattr(function, "__qualname__", ""):
        return None  # a function that another one returned has no public name
    owner = getattr(function, "__self__", None)
    name = getattr(function, "__name__", "")
    if name.startswith("_") and name not in ("__getitem__", "__call__"):
        return None
    if owner is not None and not inspect.ismodule(owner):
        kind = owner if isinstance(owner, type) else type(owner)
        return f"{kind.__name__}.{name}" if kind.__module__.startswith("somersault") else None
    if str(getattr(function, "__module__", "")).startswith("somersault") or (
        inspect.ismodule(owner) and owner.__name__.startswith("somersault")
    ):
        return name
    if type(function).__module__.startswith("somersault"):
        return f"{type(function).__name__}.__call__"
    # a static method of the extension knows no more than its name
    qualified = str(getattr(function, "__qualname__", ""))
    kind = extension().get(qualified.partition(".")[0])
    return qualified if isinstance(kind, type) and getattr(kind, name, None) == function else None


@functools.cache
def extension() -> dict[str, Any]:
    """What the modules of the extension list."""
    found: dict[str, Any] = importlib.import_module("public_names").extension()
    return found


def examples(*, pages: bool) -> Iterator[tuple[str, str]]:
    """Names of things with examples, and their sources; those on pages of the book where they are wanted."""
    parser = doctest.DocTestParser()
    for name, thing in sorted(extension().items()):
        members = [thing, *(vars(thing).values() if isinstance(thing, type) else ())]
        text = [inspect.getdoc(one) or "" for one in members]
        yield name, "\n".join(one.source for part in text for one in parser.get_examples(part))
    for module in MODULES:
        loaded = importlib.import_module(f"somersault{module}")
        things = [loaded, *(getattr(loaded, name) for name in getattr(loaded, "__all__", ()))]
        members = [
            one
            for thing in things
            if not str(getattr(thing, "__module__", "")).startswith("somersault._somersault")
            for one in (thing, *(vars(thing).values() if isinstance(thing, type) else ()))
        ]
        text = [inspect.getdoc(one) or "" for one in members if callable(one) or inspect.ismodule(one)]
        yield (
            f"somersault{module}",
            "\n".join(one.source for part in text for one in parser.get_examples(part)),
        )
    for page in (page for pattern in PAGES if pages for page in sorted(ROOT.glob(pattern))):
        blocks = re.findall(r"^```(?: \{ \.)?python[^\n]*\n(.*?)^```$", page.read_text("utf-8"), re.M | re.S)
        yield (
            str(page.relative_to(ROOT)),
            "\n".join(
                "\n".join(one.source for one in parser.get_examples(block))
                if block.startswith(">>>")
                else block
                for block in blocks
            ),
        )
    yield "more", (Path(__file__).with_name("mutated_calls_more.py")).read_text("utf-8")


def starts(slowest: float, *, pages: bool = True) -> list[Start]:
    """Every call of the examples that takes no longer than given, in a fixed order."""
    recorder = Recorder()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        for _, source in examples(pages=pages):
            recorder.run(source, {"__name__": "example"})
    found = [start for name in sorted(recorder.starts) for start in recorder.starts[name]]
    return [start for start in found if start.seconds <= slowest]


def uncovered(found: list[Start]) -> list[str]:
    """Public callables without a start."""
    seen = {start.name for start in found}
    missing = []
    for name, thing in extension().items():
        if not isinstance(thing, type):
            if name not in seen and thing.__name__ not in seen:
                missing.append(name)
            continue
        if name not in seen and has_constructor(thing):
            missing.append(name)
        missing += [
            f"{name}.{member}"
            for member, value in vars(thing).items()
            if not member.startswith("_")
            and (callable(value) or isinstance(value, (classmethod, staticmethod)))
            and f"{name}.{member}" not in seen
            # an inherited method is its heir's
            and not any(f"{heir.__name__}.{member}" in seen for heir in thing.__subclasses__())
        ]
    return missing


def has_constructor(kind: type) -> bool:
    return getattr(kind, "__new__", None) is not object.__new__ and kind.__text_signature__ is not None


def _fails(*arguments: Any, **keywords: Any) -> Any:
    raise RuntimeError("a callable of the caller")


CALLABLES: list[Any] = [
    lambda *a, **k: float("nan"),
    lambda *a, **k: None,
    lambda *a, **k: "text",
    lambda *a, **k: np.full(3, np.nan),
    lambda *a, **k: np.zeros((2, 2, 2)),
    lambda *a, **k: [],
    lambda *a, **k: (np.zeros(3), np.array([np.inf, 0, 0])),
    lambda *a, **k: 1e308,
    lambda: 0.0,
    _fails,
    int,
]
NUMBERS: list[Any] = [
    *(float("nan"), float("inf"), -float("inf"), 0.0, -0.0, -1.0, 1e308, -1e308, 1e-308, 5e-324, 1e16, 0.5),
    *(0, 1, 2, -1, 3, 2**31, 2**53, 2**63 - 1, 2**63, 2**64, -(2**63), 10**9, 10**15, 10**30),
    *(
        True,
        None,
        "1",
        "",
        "nan",
        1j,
        [1.0],
        (),
        np.float32(0.1),
        np.int8(3),
        np.array(1.0),
        np.bool_(True),
        b"1",
    ),
]
TEXTS: list[Any] = [
    "",
    "x",
    "\0",
    "ü" * 40,
    " ",
    "nan",
    "../..",
    "rkmk",
    "A",
    None,
    3,
    0.5,
    b"x",
    [],
    ["x"],
    {},
    object(),
]
OTHERS: list[Any] = [
    None,
    0,
    -1,
    1.5,
    "",
    "x",
    (),
    [],
    {},
    object(),
    type,
    float("nan"),
    np.zeros(0),
    {"x": 1},
    b"",
]
ARRAYS: list[Any] = [
    *(
        np.zeros(0),
        np.zeros((0, 3)),
        np.zeros((3, 0)),
        np.zeros(()),
        np.zeros(3),
        np.zeros((3, 3)),
        np.eye(4),
    ),
    *(np.full(3, np.nan), np.full((2, 3), np.inf), np.zeros((2, 2, 2)), np.ones(100), np.ones((1, 1, 1, 1))),
    *(
        np.broadcast_to(0.5, (10**9,)),
        np.broadcast_to(0.5, (10**9, 3)),
        np.array(["a", "b"]),
        np.array([None]),
    ),
]


def mutated(value: Any, rng: random.Random, pool: list[Any], depth: int = 0) -> Any:
    """Something else in the place of a value."""
    if rng.random() < 0.06:
        return rng.choice(OTHERS)
    if rng.random() < 0.03:
        return rng.choice(pool)
    if isinstance(value, (bool, np.bool_)):
        return rng.choice([not value, 2, "yes", None, float("nan"), 1.0])
    if isinstance(value, (int, float, np.number)):
        with contextlib.suppress(OverflowError):
            return rng.choice(
                [*NUMBERS, -value, value * 2, value + 1, value / 2, float(value) * (1 + 1e-15), str(value)]
            )
        return rng.choice(NUMBERS)
    if isinstance(value, str):
        return rng.choice(
            [*TEXTS, value + "x", value[:-1], value.upper(), value[::-1], (value,), [value, value]]
        )
    if isinstance(value, np.ndarray):
        return _mutated_array(value, rng)
    if isinstance(value, (list, tuple)):
        return _mutated_sequence(value, rng, pool, depth)
    if isinstance(value, dict):
        changed = dict(value)
        if changed and rng.random() < 0.7:
            key = rng.choice(list(changed))
            changed[key] = mutated(changed[key], rng, pool, depth + 1)
        elif changed and rng.random() < 0.5:
            changed.pop(rng.choice(list(changed)))
        else:
            changed["unknown"] = 1
        return changed
    if callable(value) and not isinstance(value, type):
        return rng.choice([*CALLABLES, None, 3, "f"])
    return rng.choice([*OTHERS, *pool[:: max(1, len(pool) // 20)], type(value)])


def _mutated_array(value: np.ndarray, rng: random.Random) -> Any:
    kind = rng.randrange(12)
    # one of `ARRAYS` without memory of its own is changed no further
    if kind == 0 or value.size > MOST_CHANGED:
        return rng.choice(ARRAYS)
    if kind < 5 and value.size and value.dtype.kind in "fi":
        changed = value.astype(float)
        changed.flat[rng.randrange(value.size)] = rng.choice(
            [np.nan, np.inf, -1.0, 0.0, 1e308, 1e16, -1e-300]
        )
        return changed
    if value.ndim == 0:
        return rng.choice(ARRAYS)
    return [
        lambda: value[:-1],
        lambda: value[:1],
        lambda: np.concatenate([value, value]),
        lambda: value[None],
        lambda: value[..., None],
        lambda: value.ravel(),
        lambda: value.T,
        lambda: value.astype(object),
        lambda: value.astype(complex),
        lambda: value.astype("U8"),
        lambda: np.asfortranarray(value)[::-1],
        lambda: value.tolist(),
        lambda: np.zeros_like(value),
        lambda: -value if value.dtype.kind in "fi" else value,
        lambda: value[:0],
    ][rng.randrange(15)]()


def _mutated_sequence(value: Any, rng: random.Random, pool: list[Any], depth: int) -> Any:
    kind = rng.randrange(12)
    items = list(value)
    if kind < 7 and items and depth < 4:
        i = rng.randrange(len(items))
        items[i] = mutated(items[i], rng, pool, depth + 1)
    elif kind == 7:
        items = items[:-1]
    elif kind == 8:
        items = [*items, *items[-1:]]
    elif kind == 9:
        return rng.choice([(), [], None, 3.0, "ab", iter(items), {"a": items}, np.zeros(0)])
    elif kind == 10:
        return [items]
    else:
        items = items[::-1]
    if hasattr(value, "_fields"):
        return tuple(items)
    return type(value)(items) if type(value) in (list, tuple) else items


def mutation(number: int, found: list[Start]) -> tuple[Start, tuple[Any, ...], dict[str, Any]]:
    """The call of a number."""
    rng = random.Random(number)
    names = sorted({start.name for start in found})
    name = rng.choice(names)
    start = rng.choice([one for one in found if one.name == name])
    pool = [value for one in found[:: max(1, len(found) // 200)] for value in one.arguments]
    arguments, keywords = list(start.arguments), dict(start.keywords)
    for _ in range(rng.choice([1, 1, 1, 2])):
        places: list[Any] = [*range(len(arguments)), *keywords]
        what = rng.randrange(20)
        if what == 0 and arguments:
            arguments.pop()
        elif what == 1:
            arguments.append(rng.choice(OTHERS))
        elif what == 2:
            keywords["unknown_keyword"] = 1
        elif what < 7:
            known = [key for key in _parameters(start.function) if key not in keywords]
            if known:
                # an argument that the example leaves out
                keywords[rng.choice(known)] = rng.choice(
                    [*NUMBERS, *OTHERS, *TEXTS, *ARRAYS, *CALLABLES[:3], 4, 0.1]
                )
        elif places:
            place = rng.choice(places)
            if isinstance(place, int):
                arguments[place] = mutated(arguments[place], rng, pool)
            else:
                keywords[place] = mutated(keywords[place], rng, pool)
    return start, tuple(arguments), keywords


def _parameters(function: Callable[..., Any]) -> list[str]:
    try:
        found = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return []
    return [one.name for one in found if one.kind == one.KEYWORD_ONLY]


#: What a call may raise besides the exceptions of somersault, which are documented with it: wrong types
#: and values, and
#: files that the system refuses.
ALLOWED = (TypeError, ValueError, OSError)
#: What access by key or number raises, as everywhere in Python.
ACCESS = (KeyError, IndexError)


class Late(BaseException):
    """Raised by the signal after `PATIENCE`."""


def raised_by_a_callable(fault: BaseException) -> bool:
    """Whether a function of the example raised it, given in the place of another: it is the caller's."""
    frames = traceback.extract_tb(fault.__traceback__)
    return bool(frames) and frames[-1].filename == "example"


def outcome(number: int, found: list[Start]) -> tuple[str, str]:
    """What becomes of a call: a word, and more about it."""
    from somersault.errors import SomersaultError

    start, arguments, keywords = mutation(number, found)
    sent: list[float] = []

    def late(*_: Any) -> None:
        if not sent:
            sent.append(time.monotonic())
            raise Late

    signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    word, more = "returned", ""
    try:
        try:
            repr(start.function(*arguments, **keywords))
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    except Late:
        word = "late"
    except (SomersaultError, *ALLOWED):
        word = "refused"
    except ACCESS as fault:
        word = "refused" if start.name.endswith("__getitem__") else f"undocumented {type(fault).__name__}"
        more = str(fault)
    except RuntimeError as fault:
        own = str(fault) == "a callable of the caller"
        word = "refused" if own else f"undocumented {type(fault).__name__}"
        more = str(fault)
    except BaseException as fault:
        word = "refused" if raised_by_a_callable(fault) else f"undocumented {type(fault).__name__}"
        more = f"{fault} {traceback.format_exc()[-300:]}"
    if sent and (taken := time.monotonic() - sent[0]) > PROMPT:
        word, more = "not prompt", f"ended {taken:.1f} s after the signal"
    return word, more


def described(number: int, found: list[Start]) -> str:
    """A call in words."""
    start, arguments, keywords = mutation(number, found)
    with np.printoptions(threshold=5, edgeitems=2):
        parts = [*(_short(value) for value in arguments)]
        parts += [f"{key}={_short(value)}" for key, value in keywords.items()]
    return f"{start.name}({', '.join(parts)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"array{value.shape}:{value.dtype}"
    try:
        return f"{value!r:.100}"
    except Exception:
        return f"<{type(value).__name__}>"


def _calls(numbers: list[int], found: list[Start] | None, results: Any) -> None:
    """The life of a child; one that is not forked runs the examples itself."""
    if found is None:
        found = starts(SLOWEST)
    faulthandler.enable()
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    sys.stdout = sys.stderr = io.StringIO()
    for number in numbers:
        results.send((number, "begun", ""))
        results.send((number, *outcome(number, found)))
    results.close()


def run(
    calls: range, found: list[Start], start_method: str = "fork", batch: int = 200
) -> dict[str, list[tuple[int, str]]]:
    """Outcomes of the calls with these numbers, in children that an abort takes alone."""
    words: dict[str, list[tuple[int, str]]] = collections.defaultdict(list)
    todo = collections.deque(calls)
    context: Any = multiprocessing.get_context(start_method)
    while todo:
        numbers = [todo.popleft() for _ in range(min(batch, len(todo)))]
        receiver, sender = context.Pipe(duplex=False)
        child = context.Process(
            target=_calls, args=(numbers, found if start_method == "fork" else None, sender)
        )
        child.start()
        sender.close()
        current = numbers[0]
        left = set(numbers)
        with contextlib.suppress(EOFError):
            while left:
                if not receiver.poll(PATIENCE + 20.0):
                    words["hang"].append((current, "killed"))
                    left.discard(current)
                    child.kill()
                    break
                current, word, more = receiver.recv()
                if word != "begun":
                    words[word].append((current, more))
                    left.discard(current)
        child.join()
        if left and child.exitcode not in (0, -signal.SIGKILL):
            words["abort"].append((current, f"exit code {child.exitcode}"))
            left.discard(current)
        todo.extendleft(sorted(left, reverse=True))
    return words


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--calls", type=int, default=30_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", type=int)
    parser.add_argument("--start-method", choices=("fork", "spawn"), default="fork")
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    os.environ.setdefault("MPLBACKEND", "agg")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        os.makedirs("out", exist_ok=True)
        os.symlink(ROOT / "docs", "docs")
        began = time.monotonic()
        found = starts(SLOWEST)
        names = {start.name for start in found}
        print(f"{len(found)} starts of {len(names)} callables in {time.monotonic() - began:.0f} s")
        print("without a start:", ", ".join(uncovered(found)))
        if chosen.only is not None:
            print(described(chosen.only, found))
            start, arguments, keywords = mutation(chosen.only, found)
            print(start.function(*arguments, **keywords))
            return 0
        words = run(range(chosen.first, chosen.first + chosen.calls), found, chosen.start_method)
        bad = 0
        for word, numbers in sorted(words.items(), key=lambda item: -len(item[1])):
            print(f"{len(numbers):7d} {word}")
        lines = []
        for word in words:
            if word in ("returned", "refused", "late"):
                continue
            for number, more in words[word]:
                bad += 1
                lines.append(f"{word} | {number} | {described(number, found)} | {more}")
        print("\n".join(lines))
        if chosen.out:
            chosen.out.write_text("\n".join(lines) + "\n")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
