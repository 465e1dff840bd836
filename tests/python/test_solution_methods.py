"""The three methods for one problem, and what each states about its accuracy."""

import pickle

import numpy as np
import pytest

from somersault import multibody, ocp
from somersault.errors import InputError

#: From one stretched posture of the arm to the opposite one, thesis 8.4.
ENDS = {"initial": [-np.pi / 2, 0.05, 0, 0], "final": [np.pi / 2, 0.05, 0, 0], "duration": 2.0}


def chain(n: int, gravity: float) -> ocp.ControlProblem:
    """Links of 1 kg and 0.5 m that hang, each hinge to be turned by half a radian in a second."""
    links = [
        multibody.Link(
            f"link{k}",
            "revolute",
            parent=f"link{k - 1}" if k else None,
            axis=(0, 0, 1),
            origin=(0, -0.5, 0) if k else (0, 0, 0),
            mass=1.0,
            center=(0, -0.25, 0),
            inertia=np.diag([1, 0, 1]) * 0.5**2 / 12,
        )
        for k in range(n)
    ]
    return ocp.ControlProblem(
        multibody.Model(links, gravity=(0, -gravity, 0)),
        initial=[0] * 2 * n,
        final=[0.5] * n + [0] * n,
        running_cost=lambda x, u: 0.5 * u @ u,
    )


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


def arm_function() -> ocp.ControlProblem:
    """The arm of the thesis with its equations written out (8.2)."""
    (m1, m2), (l1, l2), c1 = (0.5, 0.5), (2.0, 0.5), 0.2

    def rates(x, u):  # type: ignore[no-untyped-def]
        q2, v1, v2 = x[1], x[2], x[3]
        inertias = m1 * l1**2 / 12, m2 * l2**2 / 12
        a = m1 * l1**2 / 4 + m2 * (l1**2 + l1 * l2 * np.cos(q2) + l2**2 / 4) + sum(inertias)
        b = m2 * (l2**2 / 4 + 0.5 * l1 * l2 * np.cos(q2)) + inertias[1]
        c = m2 * l2**2 / 4 + inertias[1]
        bias = 0.5 * l1 * l2 * m2 * np.sin(q2)
        f1 = u[0] + bias * v2 * (2 * v1 + v2) - c1 * v1
        f2 = u[1] - bias * v1**2
        det = a * c - b * b
        return [v1, v2, (c * f1 - b * f2) / det, (a * f2 - b * f1) / det]

    return ocp.ControlProblem(rates, states=4, controls=2, running_cost=effort, **ENDS)  # type: ignore[arg-type]


def effort(x, u):  # type: ignore[no-untyped-def]
    return 0.5 * (u[0] ** 2 + 0.5 * u[1] ** 2)


def test_the_arm_of_the_thesis_is_solved_in_three_ways_that_agree() -> None:
    posed = arm_function()
    splines = posed.solve(method="shooting", tol=1e-2)
    collocation = posed.solve(method="collocation")
    exact = posed.solve(method="indirect")
    assert splines.success and collocation.success and exact.success, (splines.message, exact.message)
    assert exact.residual < 1e-10
    assert collocation.cost == pytest.approx(exact.cost, rel=1e-6)
    assert splines.cost == pytest.approx(exact.cost, rel=1e-4) and splines.cost_error < 1e-2
    times = np.linspace(0, 2, 9)
    np.testing.assert_allclose(collocation.state(times), exact.state(times), atol=1e-4)
    np.testing.assert_allclose(splines.state(times), exact.state(times), atol=5e-2)
    # the tree is the same problem, by splines of its joints
    tree = ocp.ControlProblem(multibody.two_link_arm(), running_cost=effort, **ENDS)  # type: ignore[arg-type]
    joints = tree.solve(method="shooting", tol=1e-5)
    assert joints.success and joints.cost == pytest.approx(exact.cost, rel=1e-5), joints.message
    assert tree.solve().cost == pytest.approx(exact.cost, rel=1e-6)


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
    with pytest.raises(InputError, match="must be a function for `method='indirect'`, found a Model"):
        chain(1, 0.0).solve(method="indirect")
    endless = ocp.ControlProblem(
        lambda x, u: [u[0]], 1, 1, initial=[0], final=[1], duration=(0.1, np.inf), end_cost=lambda x, t: t
    )
    with pytest.raises(InputError, match="durations from above zero to a finite number"):
        endless.solve(method="shooting")
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
