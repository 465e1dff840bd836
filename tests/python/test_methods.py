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
        assert row.conserves and row.limitations
        assert row.title and row.citation and row.evaluations >= 1 and row.history >= 0
        assert (
            set(row.orders)
            == set(row.rate_orders)
            == {
                "translation",
                "translation_with_velocity",
                "translation_with_orientation",
                "rotation",
                "rotation_with_torque",
            }
        )
        assert row.dense_order >= 3 and (row.angle_limit is None or row.angle_limit > 0.0)
        assert (row.orders["rotation_with_torque"] is None) == (row.scope == "torque-free")
        assert row.adaptive == (row.embedded_order is not None or row.history == 0)
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
    lines = str(methods()).splitlines()
    assert [line.split()[0] for line in lines[1:]] == methods().names
    assert len(lines) == 1 + len(methods())


def test_the_table_says_for_what_its_orders_hold() -> None:
    table = methods()
    for name in ("rk4", "ab4", "siabm4", "rk4_l", "ab4_l"):
        orders = table[name].orders
        assert (orders["translation"], orders["translation_with_orientation"]) == (4, 2)
    assert table["sv"].orders["translation"] == 2 and table["sv"].rate_orders["translation"] == 1
    for name in ("pmv6", "pmv8", "pmv10", "split4"):
        assert table[name].dense_order == 4
    assert (table["rkmk5"].dense_order, table["rkmk8_b"].dense_order) == (5, 8)
    line = next(line for line in str(table).splitlines() if line.startswith("sv "))
    assert "2 (1); 1" in line


def test_the_table_says_which_methods_take_stiff_systems() -> None:
    assert [row.name for row in methods() if row.l_stable] == ["radau5"]


def test_a_step_beyond_the_limit_names_the_angle_allowed() -> None:
    # Of a ball, whose step every method can solve.
    body, start = somersault.RigidBody.sphere(1.0, 1.0), somersault.State(angular_velocity=(1.0, 2.0, 3.0))
    for row in methods():
        if row.angle_limit is not None:
            with pytest.raises(
                somersault.errors.IntegrationError, match=f"more than the {row.angle_limit:.3f} rad a step"
            ):
                somersault.integrate(body, start, (0.0, 10.0), dt=1.0, method=row)


def test_imid_comes_to_rest() -> None:
    spring = somersault.forces.Spring(
        anchor=(0.0, 0.0, 2.0), attachment=(0.0, 0.0, 0.0), stiffness=40.0, damping=6.0, rest_length=0.8
    )
    body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
    start = somersault.State(position=(0.0, 0.0, 1.0))
    solution = somersault.integrate(
        body, start, (0.0, 60.0), dt=0.02, method="imid", forces=[somersault.forces.Gravity(), spring]
    )
    assert solution.position[-1, 2] == pytest.approx(2.0 - 0.8 - 9.81 / 40.0, abs=1e-13)
