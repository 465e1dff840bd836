"""The three methods for one problem, and what each states about its accuracy."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from control_problems import KNOWN, chain, rods

from somersault import ftla, multibody, ocp
from somersault.errors import InputError

#: A problem, and where its search starts.
Posed = tuple[ocp.ControlProblem, dict[str, Any] | None]


def satellite() -> ocp.ControlProblem:
    """A free hub with two hinged links on each side, which turns itself by one radian from rest to rest."""

    def rod(name: str, parent: str | None, place: float, length: float, mass: float) -> multibody.Link:
        return multibody.Link(
            name,
            "revolute",
            parent=parent,
            axis=(0, 0, 1),
            origin=(place, 0, 0),
            mass=mass,
            center=(0.5 * length if parent else 0, 0, 0),
            inertia=np.diag([0, 1, 1]) * mass * length**2 / 12,
        )

    links = [
        rod("hub", None, 0, 1.0, 4.0),
        rod("right", "hub", 0.5, 0.4, 1.0),
        rod("right_end", "right", 0.4, 0.4, 1.0),
        rod("left", "hub", -0.5, -0.4, 1.0),
        rod("left_end", "left", -0.4, -0.4, 1.0),
    ]
    return ocp.ControlProblem(
        multibody.Model(links, gravity=(0, 0, 0)),
        actuated=[link.name for link in links[1:]],
        initial=[0] * 10,
        final=[1] + [0] * 9,
        duration=5,
        running_cost=lambda x, u: 0.5 * u @ u,
    )


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_four_driven_hinges_start_from_splines_and_are_solved(gravity: float) -> None:
    found = chain(4, gravity).solve()
    assert found.success and found.confirmed and found.terminal_error < 1e-4, found.message
    assert found.verified_cost == pytest.approx(found.cost, rel=1e-6)
    assert "4 driven joints" in found.message and found.meshes[0]["is_start"]
    # each spline contains those before it, and the motion of collocation is better than all
    starts = [mesh["cost"] for mesh in found.meshes if mesh["is_start"]]
    assert len(starts) > 1 and found.cost < starts[-1] < starts[0]
    again = pickle.loads(pickle.dumps(found))
    assert again.message == found.message


def test_a_free_satellite_turns_itself_by_its_hinges() -> None:
    found = satellite().solve()
    assert found.success and found.confirmed and found.terminal_error < 1e-4, found.message
    assert found.x[-1, 0] == pytest.approx(1.0, abs=1e-9) and "splines" in found.message
    # nothing acts on it from outside: its angular momentum stays zero
    model, n = found.model, 5
    assert model is not None
    momenta = [model.centroidal_momentum(q, v) for q, v in zip(found.x[:, :n], found.x[:, n:], strict=True)]
    assert np.abs(momenta).max() < 1e-5


def test_the_arm_of_the_thesis_is_posed_once_and_solved_in_three_ways_that_agree() -> None:
    posed = ocp.arm_problem(duration=2.0)
    splines = posed.solve(method="shooting", tol=1e-5)
    collocation = posed.solve(method="collocation")
    exact = posed.solve(method="indirect")
    assert splines.success and collocation.success and exact.success, (splines.message, exact.message)
    assert exact.verdict == "strict_minimum" and exact.residual < 1e-10
    assert collocation.cost == pytest.approx(exact.cost, rel=1e-6)
    assert splines.cost == pytest.approx(exact.cost, rel=1e-5) and splines.cost_error < 1e-5
    times = np.linspace(0, 2, 9)
    np.testing.assert_allclose(collocation.state(times), exact.state(times), atol=1e-4)
    np.testing.assert_allclose(splines.state(times), exact.state(times), atol=1e-2)


def test_the_extremal_of_the_thesis_is_that_of_its_equations_in_closed_form() -> None:
    # `ftla.arm` has the equations of motion written out, and shoots by itself
    known = ftla.solve_arm([-np.pi / 2, 0.05, 0, 0], [np.pi / 2, 0.05, 0, 0], 10.0, fold=np.pi)
    exact = ocp.arm_problem().polish(ocp.arm_motion(np.pi, tol=1e-5))
    assert known.success and exact.verdict == "strict_minimum" and exact.residual < 1e-10
    assert exact.cost == pytest.approx(known.extremal.cost(), rel=1e-9)
    for t in (2.0, 5.0, 8.0):
        np.testing.assert_allclose([*exact.state(t), *exact.costate(t)], known.extremal(t), atol=1e-8)


def cart_pole() -> multibody.Model:
    """Kelly 2017: a cart of 1 kg, and 0.3 kg on a massless pole of 0.5 m."""
    links = [
        multibody.Link("cart", "prismatic", axis=(1, 0, 0), mass=1.0),
        multibody.Link("pole", "revolute", parent="cart", axis=(0, 0, 1), mass=0.3, center=(0, -0.5, 0)),
    ]
    return multibody.Model(links, gravity=(0, -9.81, 0))


def swing_up() -> Posed:
    return ocp.ControlProblem(
        cart_pole(),
        actuated=["cart"],
        initial=[0, 0, 0, 0],
        final=[1, np.pi, 0, 0],
        duration=2.0,
        bounds={"q_cart": (-2, 2), "u_cart": (-20, 20)},
        running_cost=lambda x, u: u.u_cart**2,
    ), None


def upright(duration: float, **options: Any) -> ocp.ControlProblem:
    return ocp.ControlProblem(
        rods(2),
        initial=[0, 0, 0, 0],
        final=[np.pi, 0, 0, 0],
        duration=duration,
        running_cost=lambda x, u: 0.5 * u @ u,
        **options,
    )


def double_pendulum() -> Posed:
    return upright(2.0), None


def acrobot() -> Posed:
    # angles of the known problem are from the vertical
    known = {name: np.array(values) for name, values in (KNOWN["acrobot"].guess or {}).items()}
    guess = {
        "q_rod0": known["upper"],
        "q_rod1": known["lower"] - known["upper"],
        "v_rod0": known["upper_spin"],
        "v_rod1": known["lower_spin"] - known["upper_spin"],
    }
    return upright(3.0, actuated=["rod1"]), guess


@pytest.mark.parametrize(
    ("name", "posed"),
    [("Kelly's cart-pole", swing_up), ("double pendulum in 2 s", double_pendulum), ("acrobot", acrobot)],
)
def test_trees_have_the_extremals_of_their_equations_written_out(
    name: str, posed: Callable[[], Posed]
) -> None:
    problem, guess = posed()
    exact = problem.polish(problem.solve(guess))
    assert exact.success and exact.verdict == "strict_minimum", exact.message
    assert exact.residual < 1e-10 and exact.cost == pytest.approx(KNOWN[name].cost, rel=1e-9)


def test_splines_keep_bounds_and_say_that_they_have_no_costates() -> None:
    free = ocp.ControlProblem(
        lambda x, u: [x.v, u.force],
        states=("x", "v"),
        controls=("force",),
        initial=[0, 1],
        final=[0, -1],
        bounds={"x": (None, 0.2)},
        running_cost=lambda x, u: 0.5 * u.force**2,
    )
    found = free.solve(method="shooting", tol=1e-3)
    # Bryson and Denham with a touch: 2 + 6 (1 − 4 ℓ)²
    assert found.cost == pytest.approx(2.24, rel=2e-3) and found.x[:, 0].max() < 0.2 + 1e-3
    assert np.isnan(found.costates).all() and "no costates" in found.message
    assert free.polish(found).verdict == "refused"
    again = free.solve(found)
    assert again.success and again.cost == pytest.approx(2.24, rel=1e-6)


def test_free_durations_and_parameters_are_variables_of_splines() -> None:
    moved = ocp.ControlProblem(
        lambda x, u, t, p: [u.u - p.drift],
        states=("x",),
        controls=("u",),
        parameters=("drift",),
        initial=[0],
        final=[1],
        duration=(0.5, 5),
        bounds={"drift": (-1, 1)},
        running_cost=lambda x, u, t, p: 0.5 * u.u**2 + 0.5 + 0.5 * p.drift**2,
    )
    # u = 1/T + p at least; the optimum is that of collocation
    splines, collocation = (moved.solve(method=way, tol=1e-5) for way in ("shooting", "collocation"))
    assert splines.success and collocation.success, splines.message
    assert splines.cost == pytest.approx(collocation.cost, rel=1e-5)
    assert splines.parameters[0] == pytest.approx(collocation.parameters[0], abs=1e-3)


def test_what_a_way_cannot_take_is_named() -> None:
    with pytest.raises(InputError, match="`method` must be 'auto', 'shooting'"):
        chain(1, 0.0).solve(method="splines")  # type: ignore[call-overload]
    several = ocp.MultiphaseProblem([chain(1, 0.0)])
    with pytest.raises(
        InputError, match="'auto' or 'collocation' for a problem of several phases, found 'sh"
    ):
        several.solve(method="shooting")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="for a problem of several phases, found 'indirect'"):
        several.search(2, method="indirect")  # type: ignore[arg-type]
    assert several.solve(method="collocation").success
    drag = ocp.ExternalFunction(lambda v: v**2, name="drag")
    dragged = ocp.ControlProblem(rods(1), initial=[0, 0], running_cost=lambda x, u: u[0] ** 2 + drag(x[1]))
    with pytest.raises(InputError, match="must be traced for `polish`, found the ExternalFunction `drag`"):
        dragged.polish(dragged.solve(tol=1e-3))
    endless = ocp.ControlProblem(
        lambda x, u: [u[0]], 1, 1, initial=[0], final=[1], duration=(0.1, np.inf), end_cost=lambda x, t: t
    )
    with pytest.raises(InputError, match="durations from above zero to a finite number"):
        endless.solve(method="shooting")
    with pytest.raises(InputError, match="durations from above zero to a finite number"):
        endless.search(2, method="shooting")
    with pytest.raises(InputError, match=r"`problems\[1\]`.*durations from above zero to a finite number"):
        ocp.solve_batch([chain(1, 0.0), endless], method="shooting")
    with pytest.raises(InputError, match=r"`problems\[0\]`.*found the ExternalFunction `drag`"):
        ocp.solve_batch([dragged], method="indirect")
    with pytest.raises(InputError, match="problems with controls, found none"):
        ocp.ControlProblem(lambda x: [-x[0]], 1, 0, initial=[1], duration=(1, 2)).solve(method="shooting")


@pytest.mark.parametrize("method", ["auto", "shooting"])
def test_budgets_end_splines_too(method: str) -> None:
    found = chain(3, 0.0).solve(method=method, max_evaluations=4)  # type: ignore[call-overload]
    assert found.status == "evaluation_limit" and np.isfinite(found.x).all()
    stopped = chain(3, 0.0).solve(method=method, callback=lambda *_: True)  # type: ignore[call-overload]
    assert stopped.status == "stopped" and not stopped.success
    late = chain(3, 0.0).solve(method=method, max_time=1e-9)  # type: ignore[call-overload]
    assert late.status == "time_limit"


def test_searches_and_batches_take_each_method() -> None:
    problem = ocp.ControlProblem(
        lambda x, u: [x.w, u.torque - 0.5 * np.sin(x.q)], states=("q", "w"), controls=("torque",),
        initial=[0, 0], final=[1, 0], duration=2, running_cost=lambda x, u: 0.5 * u.torque**2,
    )  # fmt: skip
    found = {way: problem.search(2, method=way, tol=1e-4) for way in ("shooting", "collocation", "indirect")}
    for way, each in found.items():
        assert each.status == "converged" and each.best.success, (way, each.failures)
        assert each.best.cost == pytest.approx(found["indirect"].best.cost, rel=1e-3)
    assert found["indirect"].best.verdict == "strict_minimum" and found["indirect"].best.residual < 1e-10
    # one by one and together the same
    both = [problem, problem.replace(duration=3)]
    for splines, alone in zip(ocp.solve_batch(both, method="shooting", tol=1e-4), both, strict=True):
        assert splines is not None and splines.cost == alone.solve(method="shooting", tol=1e-4).cost
    for exact, alone in zip(ocp.solve_batch(both, method="indirect"), both, strict=True):
        assert exact is not None and exact.verdict == "strict_minimum"
        assert exact.cost == alone.solve(method="indirect").cost


def test_arcs_that_no_solution_has_are_sought_in_one_of_collocation() -> None:
    def pushed(**options: Any) -> ocp.ControlProblem:
        return ocp.ControlProblem(
            lambda x, u: [x.v, u.force], ("x", "v"), ("force",), initial=[0, 0], final=[1, 0],
            running_cost=lambda x, u: 0.5 * u.force**2, **options,
        )  # fmt: skip

    # a path constraint that names a control, and a singular arc of order 2 whose ends chatter
    mixed = pushed(path=[(lambda x, u: u.force + x.x, None, 5.5)])
    found = mixed.solve(method="indirect")
    assert found.verdict == "refused" and "names a control" in found.message
    alone = mixed.solve()
    assert found.found.success and found.found.cost == alone.cost
    assert len(found.found.meshes) == len(alone.meshes)
    fuller = ocp.ControlProblem(
        lambda x, u: [x.v, u.force], ("x", "v"), ("force",), initial=[1, 0], final=[0, 0], duration=5,
        bounds={"force": (-1, 1)}, running_cost=lambda x: 0.5 * x.x**2,
    )  # fmt: skip
    found = fuller.solve(method="indirect")
    assert found.verdict == "refused" and "order 2 or more" in found.message
    assert len(found.found.meshes) == len(fuller.solve(tol=1e-4).meshes)
