"""Public names of the crates: the list of them is up to date, and a type has a name of its own."""

import difflib

import rust_names


def test_the_list_of_public_names_is_up_to_date() -> None:
    listed, found = rust_names.LIST.read_text(encoding="utf-8").split(), rust_names.names()
    changes = [line for line in difflib.ndiff(listed, found) if line[0] in "+-"]
    assert not changes, "\n".join(["`make public-names` writes the list anew, with", *changes])


def test_no_two_public_types_have_one_name() -> None:
    types = {name: paths for name, paths in rust_names.items().items() if name[0].isupper()}
    found = {name: paths for name, paths in types.items() if len(paths) > 1 and not name.isupper()}
    assert not found, f"a name stands for different things: {found}"
