"""A sample of calls with wrong arguments; `make mutate` makes 30,000, of the pages of the book too."""

import os
import sys
from pathlib import Path

import mutated_calls
import pytest


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> list[mutated_calls.Start]:
    """The calls of the examples of docstrings."""
    before = Path.cwd()
    os.chdir(tmp_path_factory.mktemp("mutated"))
    try:
        Path("out").mkdir()
        Path("docs").symlink_to(mutated_calls.ROOT / "docs")
        return mutated_calls.starts(mutated_calls.SLOWEST, pages=False)
    finally:
        os.chdir(before)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="children are forked and limited")
@pytest.mark.filterwarnings("ignore")
def test_everything_public_has_a_call_to_mutate(found: list[mutated_calls.Start]) -> None:
    assert mutated_calls.uncovered(found) == []


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="children are forked and limited")
@pytest.mark.filterwarnings("ignore")
def test_wrong_arguments_return_or_raise_what_is_documented(
    found: list[mutated_calls.Start], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = mutated_calls.run(range(1000), found)
    bad = {
        word: [(mutated_calls.described(number, found), more) for number, more in numbers]
        for word, numbers in words.items()
        if word not in ("returned", "refused", "late")
    }
    assert not bad
    assert len(words["refused"]) > 300 and len(words["returned"]) > 100
