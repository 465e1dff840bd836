"""The method table, from Python."""

import pickle

import pytest

import somersault
from somersault.integrators import method, methods


def test_the_table_is_found_by_index_and_by_name() -> None:
    table = methods()
    assert len(table) == len(table.names) == len(list(table)) == len(set(table.names))
    for i, row in enumerate(table):
        assert table[i] == table[row.name] == table[i - len(table)] == method(row.name)
        assert row.name in table and row in table
        assert str(row) == row.name
        assert pickle.loads(pickle.dumps(row)) == row
        assert row.keeps and row.not_for
        assert row.title and row.citation and row.evaluations >= 1 and row.history >= 0
        assert set(row.orders) == {
            "translation",
            "translation_with_velocity",
            "rotation",
            "rotation_with_torque",
        }
        assert (row.orders["rotation_with_torque"] is None) == (row.scope == "torque-free")
        assert row.adaptive == (row.embedded_order is not None)
    assert "rk5" not in table and 3 not in table
    with pytest.raises(IndexError, match="methods, found index"):
        table[len(table)]


def test_the_methods_of_the_thesis_come_first() -> None:
    thesis = [
        "euler",
        "sie",
        "sv",
        "mp",
        "heun",
        "rk4",
        "ab2",
        "siabm2",
        "aso",
        "dmv2",
        "ab4",
        "siabm4",
        "rkmk",
    ]
    assert methods().names[: len(thesis)] == thesis


def test_rows_can_be_given_as_methods() -> None:
    body, start = somersault.RigidBody.sphere(1.0, 1.0), somersault.State()
    for row in methods():
        assert somersault.integrate(body, start, (0.0, 1.0), dt=0.5, method=row).status == 0


def test_the_table_prints_one_line_a_method() -> None:
    lines = repr(methods()).splitlines()
    assert [line.split()[0] for line in lines[1:]] == methods().names
    assert len(lines) == 1 + len(methods())
