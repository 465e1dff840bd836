"""Public names: the list of them is up to date, and each has one meaning."""

import difflib
from collections import defaultdict

import public_names


def test_the_list_of_public_names_is_up_to_date() -> None:
    listed, found = public_names.LIST.read_text(encoding="utf-8").split(), public_names.names()
    changes = [line for line in difflib.ndiff(listed, found) if line[0] in "+-"]
    assert not changes, "\n".join(["`make public-names` writes the list anew, with", *changes])


def test_a_public_name_has_one_meaning() -> None:
    meanings: dict[str, dict[int, str]] = defaultdict(dict)
    for path, thing in public_names.things().items():
        meanings[path.rpartition(".")[2]].setdefault(id(thing), path)
    found = {name: list(paths.values()) for name, paths in meanings.items() if len(paths) > 1}
    assert not found, f"a name stands for different things: {found}"
