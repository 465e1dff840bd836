"""Public names: the list of them is up to date, and each has one meaning."""

import difflib
from collections import defaultdict

import public_names

#: Names that stand for more than one thing, with a reason. The list may only become shorter.
DOUBLES = {
    "Cylinder": "to be renamed: a surface that bodies touch, and a shape that the viewer draws",
    "Scene": "to be renamed: a body with its contacts, and a page of the viewer",
    "Sphere": "to be renamed: a surface that bodies touch, and a shape that the viewer draws",
    "integrate": "to be renamed: bodies, batches of bodies, and trees",
}


def test_the_list_of_public_names_is_up_to_date() -> None:
    listed, found = public_names.LIST.read_text(encoding="utf-8").split(), public_names.names()
    changes = [line for line in difflib.ndiff(listed, found) if line[0] in "+-"]
    assert not changes, "\n".join(["`make public-names` writes the list anew, with", *changes])


def test_a_public_name_has_one_meaning() -> None:
    meanings: dict[str, dict[int, str]] = defaultdict(dict)
    for path, thing in public_names.things().items():
        meanings[path.rpartition(".")[2]].setdefault(id(thing), path)
    found = {name: list(paths.values()) for name, paths in meanings.items() if len(paths) > 1}
    new = {name: paths for name, paths in found.items() if name not in DOUBLES}
    assert not new, f"a name stands for different things: {new}"
    gone = sorted(DOUBLES.keys() - found)
    assert not gone, f"have one meaning by now, and must leave `DOUBLES`: {gone}"
