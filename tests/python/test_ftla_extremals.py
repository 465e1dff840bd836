"""Matching, shooting and continuation from Python: the arm of the thesis, and regulators in closed form."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from somersault import errors, ftla, multibody

INITIAL, FINAL = [-np.pi / 2, 0.05, 0.0, 0.0], [np.pi / 2, 0.05, 0.0, 0.0]

#: Thesis Table 10.1, column p⁺ at 5 s, its mismatch being 6e-4.
MIDDLE = [-0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651]

ROOT = np.sqrt(2.0)


@pytest.fixture(scope="module")
def found() -> ftla.ContinuationResult:
    return ftla.solve_arm(INITIAL, FINAL, 10.0, fold=np.pi)


@pytest.fixture(scope="module")
def matching() -> ftla.Matching:
    flow = ftla.VariationalFlow(ftla.arm(), rtol=1e-8, atol=1e-10, max_steps=2000)
    placement = ftla.Placement((2, 4, 2), [0, 2], np.arange(0.25, 3.1, 0.25), tol=1e-6)
    return ftla.Matching(
        flow,
        INITIAL,
        FINAL,
        10.0,
        placement,
        initial_costate=[-0.2, 0.0, -1.3, -0.1],
        final_costate=[-0.2, 0.0, 1.3, 0.1],
        corrections=[2.0, 4.0, 6.0, 8.0],
    )


def test_the_thesis_motion_comes_from_its_ends_and_fold_alone(found: ftla.ContinuationResult) -> None:
    extremal = found.extremal
    assert found.success and found.s == 1.0 and extremal.status == "converged"
    assert extremal.residual <= 1e-10 and found.n_iterations > 2 and found.n_evaluations > 1000
    low, high = extremal.hamiltonian_range()
    assert high - low < 1e-10
    # crates/somersault-ftla/tests/ftla/extremals.rs
    assert extremal.cost() == pytest.approx(0.321777232, abs=2e-9)
    np.testing.assert_allclose(extremal(5.0), MIDDLE, atol=6e-4)
    np.testing.assert_allclose(extremal.nodes[[0, -1], :4], [INITIAL, FINAL], atol=1e-14)


def test_an_independent_integrator_confirms_the_segments(found: ftla.ContinuationResult) -> None:
    extremal = found.extremal
    system = extremal.system
    for k in range(len(extremal.times) - 1):
        end = solve_ivp(
            lambda t, p: system.field(p),
            extremal.times[k : k + 2],
            extremal.nodes[k],
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
        ).y[:, -1]
        np.testing.assert_allclose(end, extremal.nodes[k + 1], atol=1e-9)


def test_an_extremal_is_had_at_any_time(found: ftla.ContinuationResult) -> None:
    extremal = found.extremal
    t = np.linspace(0.0, 10.0, 21)
    p, u = extremal(t), extremal.control(t)
    assert p.shape == (21, 8) and u.shape == (21, 2) and extremal(0.0).shape == (8,)
    np.testing.assert_allclose(u, extremal.system.control(p), atol=1e-12)
    np.testing.assert_allclose(np.ptp(extremal.system.hamiltonian(p)), 0.0, atol=1e-9)
    np.testing.assert_allclose(extremal(extremal.times), extremal.nodes, atol=1e-11)
    # λ₁ is conserved, θ₁ being cyclic
    np.testing.assert_allclose(p[:, 4], p[0, 4], atol=1e-11)


def test_exponents_along_the_nodes_keep_all_their_digits(found: ftla.ContinuationResult) -> None:
    spectrum = found.extremal.chain.spectrum()
    # crates/somersault-ftla/tests/reference/exponents.py, over ten seconds, for nodes that differ by 1e-9
    positive = np.array([0.170930667245478, 0.366193707870553, 2.44973248446746, 2.6598381683833])
    np.testing.assert_allclose(spectrum.exponents, np.concatenate([-positive[::-1], positive]), atol=1e-7)
    assert spectrum.time == pytest.approx(10.0) and spectrum.pairing_defect < 1e-10


def test_the_thesis_motion_is_not_the_cheapest() -> None:
    ranked = ftla.arm_extremals(INITIAL, FINAL, 10.0, folds=[-np.pi], turns=(0, -1))
    # the other way round costs more, the same arm reached with θ₂ less by a turn costs less
    assert [(each.fold, each.turns) for each in ranked] == [(-np.pi, -1), (-np.pi, 0)]
    assert ranked[0].cost < 0.321777232 < ranked[1].cost
    assert ranked[0].cost == pytest.approx(ranked[0].extremal.cost(), rel=1e-12)


def test_placed_motions_follow_the_optimum_for_longer(found: ftla.ContinuationResult) -> None:
    placement = ftla.Placement((2, 4, 2), [0, 2], np.arange(0.25, 3.6, 0.25))
    flow = ftla.VariationalFlow(ftla.arm(), rtol=1e-10, max_steps=2000)
    error = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0]
    followed = placement.following(flow, found.extremal, error, [1e-4, 1e-6], 0.2)
    assert [each.size for each in followed] == [1e-4, 1e-6]
    assert all(each.status == "placed" and each.left < 1e-5 for each in followed)
    assert all(each.with_placement > each.without_placement + 1.0 for each in followed)
    assert followed[1].without_placement > followed[0].without_placement
    with pytest.raises(errors.InputError, match="bound"):
        placement.following(flow, found.extremal, error, [1e-4], 0.0)
    with pytest.raises(errors.InputError, match="dimension 2"):
        placement.following(
            ftla.VariationalFlow(ftla.cubic_regulator()), found.extremal, [0.0, 1.0], [1e-4], 0.1
        )


def test_a_least_squares_match_polishes_to_rounding(
    matching: ftla.Matching, found: ftla.ContinuationResult
) -> None:
    matched = matching.least_squares([0])
    assert matched.status == "matched" and matched.success and matched.mismatch < 2e-3
    assert matched.ends.shape == (2, 8) and matched.meeting.shape == (2, 8)
    assert matched.ends[0, 4] == matched.ends[1, 4]
    assert matched.mismatch == pytest.approx(np.linalg.norm(np.subtract(*matched.meeting)), rel=1e-12)
    assert matched.n_rounds > 0 and matched.n_branches > 2 and matched.n_flow_evaluations > matched.n_branches
    times = found.extremal.times
    polished = ftla.shoot(ftla.arm(), INITIAL, FINAL, times, matched.nodes(times))
    assert polished.success and polished.n_iterations < 8
    np.testing.assert_allclose(polished.nodes, found.extremal.nodes, atol=1e-8)


def test_a_grid_search_counts_its_rounds(matching: ftla.Matching) -> None:
    matched = matching.grid_search([[0.02, 0.1], [0.02, 0.1]], max_rounds=1)
    assert matched.status == "max_rounds" and not matched.success
    assert matched.n_rounds == 1 and matched.n_branches == 18 and np.isfinite(matched.mismatch)
    assert "max_rounds" in repr(matched)


@pytest.mark.parametrize(
    ("ends", "horizon"), [((1.0, 1.5), 10.0), ((1.5, 1.0), 10.0), ((1.0, 1.5), 40.0), ((1.5, 1.0), 1e4)]
)
def test_regulators_are_their_closed_forms(ends: tuple[float, float], horizon: float) -> None:
    a, b = ends
    fractions = ftla.graded_times(horizon, 0.2, 12.0) / horizon
    fractions[-1] = 1.0
    stages = [([0.0], [0.0]), ([a], [b])]

    def solved(system: ftla.System) -> list[float]:
        found = ftla.continue_through(system, stages, horizon, fractions)
        assert found.success
        return [found.extremal.cost(), *found.extremal.nodes[[0, -1], 1]]

    # x = (a sinh r(T − t) + b sinh rt)/sinh rT, λ = −x − dx/dt, J = ½(x₀λ₀ − x_fλ_f)
    coth = 1.0 / np.tanh(ROOT * horizon)
    csch = 2.0 * np.exp(-ROOT * horizon) / (1.0 - np.exp(-2.0 * ROOT * horizon))
    costates = [-a + ROOT * (a * coth - b * csch), -b - ROOT * (b * coth - a * csch)]
    expected = [0.5 * (a * costates[0] - b * costates[1]), *costates]
    np.testing.assert_allclose(solved(ftla.linear_regulator()), expected, atol=1e-10)
    if horizon >= 40.0:
        # on the manifolds of the equilibrium, λ = −x³ ± x √(1 + x⁴)
        def value(x: float) -> float:
            return 0.25 * (x**2 * np.sqrt(1.0 + x**4) + np.arcsinh(x**2))

        costates = [-(a**3) + a * np.sqrt(1.0 + a**4), -(b**3) - b * np.sqrt(1.0 + b**4)]
        expected = [value(a) - a**4 / 4 + value(b) + b**4 / 4, *costates]
        np.testing.assert_allclose(solved(ftla.cubic_regulator()), expected, atol=1e-10)


@pytest.mark.parametrize("horizon", [10.0, 40.0, 1e4])
@pytest.mark.parametrize(("a", "b"), [(1.0, 1.5), (1.5, 1.0)])
def test_regulators_start_cold_from_their_ends(a: float, b: float, horizon: float) -> None:
    found = ftla.cold_start(ftla.linear_regulator(), [a], [b], horizon)
    coth, decay = 1.0 / np.tanh(ROOT * horizon), np.exp(-ROOT * horizon)
    csch = 2.0 * decay / (1.0 - decay**2)
    costates = [-a + ROOT * (a * coth - b * csch), -b - ROOT * (b * coth - a * csch)]
    assert found.success
    np.testing.assert_allclose(found.extremal.nodes[[0, -1], 1], costates, atol=1e-10)
    assert found.extremal.cost() == pytest.approx(0.5 * (a * costates[0] - b * costates[1]), abs=1e-10)
    found = ftla.cold_start(ftla.cubic_regulator(), [a], [b], horizon)
    assert found.success
    # docs/theory/lyapunov.md on long horizons; at ten that from a rest, which tests in Rust hold against a
    # quadrature
    value = [0.25 * (x**2 * np.sqrt(1.0 + x**4) + np.arcsinh(x**2)) for x in (a, b)]
    cost = value[0] - a**4 / 4 + value[1] + b**4 / 4
    costates = [-(a**3) + a * np.sqrt(1.0 + a**4), -(b**3) - b * np.sqrt(1.0 + b**4)]
    if horizon < 40.0:
        fractions = ftla.graded_times(1.0, 0.02, 0.2)
        stages = [([0.0], [0.0]), ([a], [b])]
        rested = ftla.continue_through(ftla.cubic_regulator(), stages, horizon, fractions).extremal
        cost, costates = rested.cost(), rested.nodes[[0, -1], 1].tolist()
    np.testing.assert_allclose(found.extremal.nodes[[0, -1], 1], costates, atol=1e-10)
    assert found.extremal.cost() == pytest.approx(cost, abs=1e-10)


def pendulum(n: int) -> multibody.Model:
    """Rods of a metre in a row, hanging from a hinge."""
    rods = [
        multibody.Link(
            f"rod {i}", "revolute", parent=f"rod {i - 1}" if i else None, axis=(0.0, 1.0, 0.0), mass=1.0,
            center=(0.0, 0.0, -0.5), inertia=(1 / 12, 1 / 12, 1e-3), origin=(0.0, 0.0, -1.0 if i else 0.0),
            damping=0.1,
        )
        for i in range(n)
    ]  # fmt: skip
    return multibody.Model(rods)


CART = multibody.cart_pendulum()


@pytest.mark.parametrize(
    ("system", "initial", "final", "horizon"),
    [
        # sideways at both ends, which takes torque: there is no rest to begin with
        pytest.param(ftla.tree(pendulum(1)), [0.5, 0.0], [1.5, 0.0], 4.0, id="pendulum held up"),
        pytest.param(
            ftla.tree(pendulum(3)), [0.0] * 6, [0.5, 0.2, -0.3, 0.0, 0.0, 0.0], 1.0, id="three links"
        ),
        pytest.param(ftla.tree(CART), [0.0] * 4, [1.0, np.pi, 0.0, 0.0], 3.0, id="cart and pole driven"),
        pytest.param(ftla.tree(CART, passive=[1]), [0.0] * 4, [1.0, 0.0, 0.0, 0.0], 3.0, id="pole passive"),
        # the angle counts from the upright
        pytest.param(ftla.tree(CART, passive=[1]), [0.0] * 4, [0.0, np.pi, 0.0, 0.0], 2.0, id="swing-down"),
        pytest.param(ftla.tree(CART, passive=[1]), [0.0, np.pi, 0.0, 0.0], [0.0] * 4, 2.0, id="swing-up"),
    ],
)
def test_trees_start_cold_from_their_ends(
    system: ftla.System, initial: list[float], final: list[float], horizon: float
) -> None:
    found = ftla.cold_start(system, initial, final, horizon)
    extremal = found.extremal
    assert found.success and extremal.residual < 1e-10
    n = len(initial)
    np.testing.assert_allclose(extremal.nodes[[0, -1], :n], [initial, final], atol=1e-12)
    low, high = extremal.hamiltonian_range()
    assert high - low < 1e-8 * (1.0 + abs(high))
    if "passive=[1]" in repr(system):
        assert (extremal.control(extremal.times)[:, 1] == 0.0).all()
    # segments by an integrator that is not ours
    for k in range(0, len(extremal.times) - 1, 7):
        end = solve_ivp(
            lambda t, p: system.field(p),
            extremal.times[k : k + 2],
            extremal.nodes[k],
            method="DOP853",
            rtol=1e-11,
        ).y[:, -1]
        np.testing.assert_allclose(end, extremal.nodes[k + 1], rtol=1e-7, atol=1e-7 * np.abs(end).max())


def test_a_limited_joint_of_a_tree_gets_no_more_than_its_limit() -> None:
    t = np.linspace(0.0, 3.0, 301)
    ends = ([0.0] * 4, [1.0, 0.0, 0.0, 0.0], 3.0)
    assert CART.potential_energy([0.0, 0.0]) > CART.potential_energy([0.0, np.pi])
    driven = ftla.cold_start(ftla.tree(CART), *ends).extremal
    limit = 0.8 * np.abs(driven.control(t)[:, 0]).max()
    limited = ftla.cold_start(ftla.tree(CART, torque_limits=[limit, np.inf]), *ends)
    assert limited.success and limited.extremal.cost() > driven.cost()
    assert np.abs(limited.extremal.control(t)[:, 0]).max() == limit


def test_a_body_on_a_ball_joint_is_turned_at_least_effort() -> None:
    # free of gravity and equal about all axes it turns about one, x = a (3s² − 2s³), u = I ẍ
    body = multibody.Link("ball", "spherical", mass=1.0, center=(0.0, 0.0, 0.0), inertia=(0.4, 0.4, 0.4))
    system = ftla.tree(multibody.Model([body], gravity=(0.0, 0.0, 0.0)))
    turn = np.array([0.3, -0.8, 0.5])
    found = ftla.cold_start(system, [0.0] * 6, [*turn, 0.0, 0.0, 0.0], 2.0)
    assert found.success and found.extremal.cost() == pytest.approx(
        6.0 * 0.16 * (turn @ turn) / 8.0, rel=1e-9
    )
    np.testing.assert_allclose(found.extremal(1.0)[:3], turn / 2, atol=1e-9)


def regulator(quartic: float, bounds: Any = None) -> ftla.System:
    """dx/dt = −x³ + u with cost ½(x² + u²) + c u⁴/4."""
    return ftla.state_costate(
        lambda x, u: -(x**3) + u,
        lambda x, u: float(0.5 * (x @ x + u @ u) + 0.25 * quartic * (u**4).sum()),
        1,
        1,
        jacobian=lambda x, u: [[-3.0 * x[0] ** 2, 1.0]],
        gradient=lambda x, u: [x[0], u[0] + quartic * u[0] ** 3],
        hessian=lambda x, u, costate: np.diag(
            [1.0 - 6.0 * x[0] * costate[0], 1.0 + 3.0 * quartic * u[0] ** 2]
        ),
        control_bounds=bounds,
    )


def test_a_problem_of_ones_own_is_the_compiled_one() -> None:
    own, compiled = regulator(0.0), ftla.cubic_regulator()
    p = np.array([[1.0, 0.4], [-0.3, 0.9]])
    for name in ("field", "jacobian", "hamiltonian", "control", "running_cost"):
        np.testing.assert_allclose(getattr(own, name)(p), getattr(compiled, name)(p), rtol=1e-14, atol=1e-15)
    assert own.n_controls == 1 and own.dimension == 2


def test_a_convex_cost_of_ones_own_is_minimised() -> None:
    system = regulator(2.0)
    u = system.control([0.5, -1.2])
    assert u + 2.0 * u**3 == pytest.approx(1.2, abs=1e-13)
    p, step = np.array([0.5, -1.2]), 1e-5
    slope = [
        (system.hamiltonian(p + step * e) - system.hamiltonian(p - step * e)) / (2.0 * step)
        for e in np.eye(2)
    ]
    np.testing.assert_allclose(system.field(p), [slope[1], -slope[0]], atol=1e-9)


def test_bounds_of_ones_own_are_met_and_located() -> None:
    system = regulator(0.0, [[-0.5], [2.0]])
    np.testing.assert_array_equal(system.control([[1.0, 0.9], [1.0, 0.2]]), [[-0.5], [-0.2]])
    flow = ftla.VariationalFlow(system, rtol=1e-9, atol=1e-11)
    ((t, sides),) = flow.switches([0.3, 0.55], 0.5)
    assert sides == ["free"] and 0.0 < t < 0.5
    # u* = −λ reaches the bound
    assert flow.state([0.3, 0.55], t)[1] == pytest.approx(0.5, abs=1e-9)


def test_callables_of_a_problem_are_named_in_errors() -> None:
    def broken(x: Any, u: Any) -> Any:
        raise RuntimeError("out of order")

    good: dict[str, Any] = {
        "dynamics": lambda x, u: -x + u, "running_cost": lambda x, u: float(0.5 * (x @ x + u @ u)),
        "n_states": 1, "n_controls": 1, "jacobian": lambda x, u: [[-1.0, 1.0]],
        "gradient": lambda x, u: [x[0], u[0]],
        "hessian": lambda x, u, costate: np.eye(2),
    }  # fmt: skip
    for name in ("dynamics", "running_cost", "jacobian", "gradient"):
        with pytest.raises(errors.EvaluationError, match=f"`{name}` raised"):
            ftla.state_costate(**(good | {name: broken})).jacobian([1.0, 0.4])
        with pytest.raises(errors.EvaluationError, match=f"`{name}` returned NaN"):
            nowhere = {"dynamics": [np.nan], "running_cost": np.nan}.get(name, np.full(2, np.nan))
            shaped = [nowhere] if name == "jacobian" else nowhere
            ftla.state_costate(**(good | {name: lambda x, u, shaped=shaped: shaped})).jacobian([1.0, 0.4])
    with pytest.raises(errors.EvaluationError, match="control Hessian"):
        ftla.state_costate(**(good | {"hessian": lambda x, u, costate: np.diag([1.0, 0.0])})).field(
            [1.0, 0.4]
        )
    with pytest.raises(errors.InputError, match="hessian"):
        ftla.state_costate(**(good | {"hessian": lambda x, u, costate: np.eye(3)})).field([1.0, 0.4])
    with pytest.raises(errors.InputError, match=r"`hessian.*must be symmetric, found 2 and 0"):
        uneven = good | {"hessian": lambda x, u, costate: np.array([[1.0, 2.0], [0.0, 1.0]])}
        ftla.state_costate(**uneven).field([1.0, 0.4])
    for bounds in ([[1.0], [1.0]], [[np.nan], [1.0]], [1.0, 2.0]):
        with pytest.raises(errors.InputError, match="control_bounds"):
            ftla.state_costate(**good, control_bounds=bounds)


def test_a_free_end_has_a_costate_of_zero() -> None:
    times = ftla.graded_times(3.0, 0.2, 1.0)
    found = ftla.shoot(ftla.linear_regulator(), [1.0], [None], times, np.zeros((len(times), 2)))
    # the Riccati solution at the start
    assert found.success and found.nodes[0, 1] == pytest.approx(
        1.0 / (ROOT / np.tanh(3.0 * ROOT) + 1.0), abs=1e-11
    )
    assert abs(found.nodes[-1, 1]) < 1e-11


def test_a_family_is_followed_in_its_horizon(found: ftla.ContinuationResult) -> None:
    arm = ftla.arm()

    def family(s: float) -> Any:
        return arm, INITIAL, FINAL, 10.0 + 2.0 * s

    longer = ftla.follow(family, found.extremal)
    assert longer.success and longer.extremal.times[-1] == pytest.approx(12.0)
    assert longer.extremal.cost() < found.extremal.cost()


def test_a_start_in_motion_is_solved_by_continuation(found: ftla.ContinuationResult) -> None:
    moving = ftla.solve_arm([-np.pi / 2, 0.05, 0.1, 0.0], FINAL, 10.0)
    assert moving.success and moving.n_steps > 2
    np.testing.assert_allclose(moving.extremal.nodes[0, :4], [-np.pi / 2, 0.05, 0.1, 0.0], atol=1e-14)


def test_torque_limits_are_reached_by_continuation(found: ftla.ContinuationResult) -> None:
    peak = np.abs(found.extremal.control(np.linspace(0.0, 10.0, 2001))).max(axis=0)

    def family(s: float) -> Any:
        return ftla.arm(torque_limits=tuple(peak * (1.0 - 0.2 * s))), INITIAL, FINAL, 10.0

    limited = ftla.follow(family, found.extremal)
    reached = np.abs(limited.extremal.control(np.linspace(0.0, 10.0, 2001))).max(axis=0)
    assert limited.success
    np.testing.assert_allclose(reached / peak, 0.8, rtol=1e-9)
    assert 1e-4 < limited.extremal.cost() - found.extremal.cost() < 0.05
    # from nothing it is the same motion, and its saturations are located
    direct = ftla.solve_arm(INITIAL, FINAL, 10.0, system=limited.extremal.system)
    assert direct.success
    assert direct.extremal.cost() == pytest.approx(limited.extremal.cost(), abs=1e-9)
    flow = ftla.VariationalFlow(limited.extremal.system)
    switches = flow.switches(limited.extremal.nodes[0], 2.5)
    assert switches and all(len(sides) == 2 for _, sides in switches)
    for t, sides in switches:
        u = flow.system.control(flow.state(limited.extremal.nodes[0], [t - 1e-6, t + 1e-6]))
        before, after = np.isclose(np.abs(u), 0.8 * peak, rtol=0.0, atol=1e-10)
        assert (before != after).sum() == 1
        np.testing.assert_array_equal(after, [side != "free" for side in sides])


def test_what_does_not_converge_has_a_status_and_its_last_nodes() -> None:
    times = ftla.graded_times(10.0, 0.1, 0.4)
    found = ftla.shoot(ftla.arm(), INITIAL, FINAL, times, np.zeros((len(times), 8)), max_iterations=2)
    assert found.status in ("max_iterations", "stalled") and not found.success and found.message
    assert found.residual > 1e-3 and found.nodes.shape == (len(times), 8)
    folded = [[state[0], np.pi, 0.0, 0.0] for state in (INITIAL, FINAL)]
    stages = [([0.0, np.pi, 0.0, 0.0],) * 2, folded, (INITIAL, FINAL)]
    far = ftla.continue_through(
        ftla.arm(), stages, 10.0, ftla.graded_times(1.0, 0.01, 0.04), first_step=1.0, min_step=0.9
    )
    assert not far.success and far.s < 1.0 and far.n_rejected > 0 and "stopped early" in repr(far)
    assert far.status == "broke_off" and far.stage.startswith("to stage ") and far.stage in far.message
    assert np.isfinite(far.extremal.nodes).all()


@pytest.mark.parametrize("factor", [1e-6, 35.0, 1e6])
def test_weights_do_not_change_how_the_arm_is_solved(factor: float, found: ftla.ContinuationResult) -> None:
    scaled = ftla.solve_arm(INITIAL, FINAL, 10.0, system=ftla.arm(weights=(factor, 0.5 * factor)))
    assert scaled.status == "arrived" and scaled.stage == found.stage
    assert scaled.extremal.residual <= 1e-11 and scaled.extremal.cost() == pytest.approx(
        factor * found.extremal.cost(), rel=1e-8
    )
    np.testing.assert_allclose(scaled.extremal.nodes[0, 4:], factor * found.extremal.nodes[0, 4:], rtol=1e-7)


def test_a_floor_of_rounding_is_a_status(found: ftla.ContinuationResult) -> None:
    extremal = found.extremal
    tight = ftla.shoot(extremal.system, INITIAL, FINAL, extremal.times, extremal.nodes, tol=1e-15)
    assert tight.status == "floor" and not tight.success and "rounding" in tight.message
    assert tight.residual < 1e-11 and tight.residual <= 8.0 * tight.floor


def test_every_search_ends_at_its_limits_with_its_best(
    matching: ftla.Matching, found: ftla.ContinuationResult
) -> None:
    extremal = found.extremal
    arm, rest = ftla.arm(), [0.0, np.pi, 0.0, 0.0]
    stages = [(rest, rest), (INITIAL, FINAL)]
    fractions = ftla.graded_times(1.0, 0.01, 0.04)
    searches: list[Any] = [
        lambda **limit: ftla.solve_arm(INITIAL, FINAL, 10.0, **limit),
        lambda **limit: ftla.cold_start(arm, INITIAL, FINAL, 10.0, **limit),
        lambda **limit: ftla.continue_through(arm, stages, 10.0, fractions, **limit),
        lambda **limit: ftla.follow(lambda s: (arm, INITIAL, FINAL, 10.0 + 9.0 * s), extremal, **limit),
    ]
    limits: list[dict[str, Any]] = [{"max_time": 1e-3}, {"max_evaluations": 1000}]
    for limit in limits:
        for search in searches:
            ended = search(**limit)
            assert ended.status == "limit_reached" and not ended.success, ended.message
            assert "limit" in ended.message and ended.stage in ended.message
            assert np.isfinite(ended.extremal.nodes).all()
        guess = np.zeros((len(extremal.times), 8))
        shot = ftla.shoot(arm, INITIAL, FINAL, extremal.times, guess, **limit)
        assert shot.status == "limit_reached" and "limit" in shot.message
        assert matching.least_squares([0], **limit).status == "limit_reached"
        spacing = [[0.02, 0.1], [0.02, 0.1]]
        assert matching.grid_search(spacing, **limit).status == "limit_reached"
    placement = ftla.Placement((2, 4, 2), [0, 2], np.arange(0.25, 3.6, 0.25))
    off = extremal.nodes[0] + [0.0, 0.0, 0.0, 0.0, 0.0, 0.05, 0.0, -0.05]
    placed = placement.place(ftla.VariationalFlow(arm), off, max_evaluations=2000)
    assert placed.status == "limit_reached" and "limit" in placed.message


def test_arm_extremals_are_each_one_motion_and_those_not_found_are_told() -> None:
    # two seeds of one motion; the fold is that of the motion
    twice = ftla.arm_extremals(INITIAL, FINAL, 10.0, folds=[np.pi, 3.0], turns=[0])
    assert [(each.fold, each.turns, each.success) for each in twice] == [(np.pi, 0, True)]
    both = ftla.arm_extremals(INITIAL, FINAL, 10.0, folds=[np.pi], turns=[0, 1], max_evaluations=30_000)
    assert len(both) == 2
    for each in both:
        assert each.success or (each.status == "limit_reached" and np.isnan(each.cost) and each.message)
    assert not both[-1].success


def test_searches_without_a_start_say_so() -> None:
    flow = ftla.VariationalFlow(ftla.arm(), rtol=1e-8, atol=1e-10, max_steps=60)
    placement = ftla.Placement((2, 4, 2), [0, 2], [1.0, 3.0], tol=1e-6)
    far = ftla.Matching(
        flow, INITIAL, FINAL, 10.0, placement,
        initial_costate=[-90.0, 0.0, 70.0, 50.0], final_costate=[-0.2, 0.0, 1.3, 0.1],
    )  # fmt: skip
    matched = far.least_squares()
    assert matched.status == "no_start" and matched.n_branches == 2 and np.isnan(matched.meeting).all()


@pytest.mark.parametrize(
    ("named", "call"),
    [
        ("initial_state", lambda m: ftla.shoot(ftla.arm(), [0.0], FINAL, [0.0, 1.0], np.zeros((2, 8)))),
        (
            "final_state",
            lambda m: ftla.shoot(ftla.arm(), INITIAL, [np.nan] * 4, [0.0, 1.0], np.zeros((2, 8))),
        ),
        ("nodes", lambda m: ftla.shoot(ftla.arm(), INITIAL, FINAL, [0.0, 1.0], np.zeros((3, 8)))),
        ("nodes", lambda m: ftla.shoot(ftla.arm(), INITIAL, FINAL, [0.0, 1.0], np.zeros((2, 6)))),
        ("times", lambda m: ftla.shoot(ftla.arm(), INITIAL, FINAL, [0.0, 0.0], np.zeros((2, 8)))),
        ("`tol`", lambda m: ftla.shoot(ftla.arm(), INITIAL, FINAL, [0.0, 1.0], np.zeros((2, 8)), tol=-1.0)),
        ("rtol", lambda m: ftla.shoot(ftla.arm(), INITIAL, FINAL, [0.0, 1.0], np.zeros((2, 8)), rtol=0.0)),
        ("horizon", lambda m: ftla.graded_times(0.0, 1.0, 1.0)),
        ("longest", lambda m: ftla.graded_times(1.0, 1.0, np.nan)),
        ("fractions", lambda m: ftla.continue_through(ftla.arm(), [], 1.0, [0.0, 0.5])),
        ("stages", lambda m: ftla.continue_through(ftla.arm(), [], 1.0, [0.0, 1.0])),
        ("first_step", lambda m: ftla.continue_through(ftla.arm(), [], 1.0, [0.0, 1.0], first_step=0.0)),
        ("initial_state", lambda m: ftla.solve_arm([0.0], FINAL, 10.0)),
        ("horizon", lambda m: ftla.solve_arm(INITIAL, FINAL, -1.0)),
        ("fold", lambda m: ftla.solve_arm(INITIAL, FINAL, 10.0, fold=np.inf)),
        ("arm", lambda m: ftla.solve_arm(INITIAL, FINAL, 10.0, system=ftla.cubic_regulator())),
        ("spacing", lambda m: m.grid_search([0.1, 0.1])),
        ("spacing", lambda m: m.grid_search([[0.1, 0.1], [0.1, -0.1]])),
        ("conserved", lambda m: m.least_squares([1])),
        ("tol", lambda m: m.least_squares(tol=np.nan)),
    ],
)
def test_bad_arguments_are_named(matching: ftla.Matching, named: str, call: Any) -> None:
    with pytest.raises(errors.InputError, match=named):
        call(matching)


@pytest.mark.parametrize(
    ("named", "changes"),
    [
        ("initial_state", {"initial_state": [0.0]}),
        ("final_state", {"final_state": [np.nan] * 4}),
        ("horizon", {"horizon": 0.0}),
        ("match_time", {"match_time": 11.0}),
        ("corrections", {"corrections": [4.0, 2.0]}),
        ("initial_costate", {"initial_costate": [0.0] * 3}),
    ],
)
def test_a_match_that_does_not_fit_is_refused(named: str, changes: dict[str, Any]) -> None:
    given: dict[str, Any] = {
        "initial_state": INITIAL, "final_state": FINAL, "horizon": 10.0,
        "initial_costate": [0.0] * 4, "final_costate": [0.0] * 4,
    }  # fmt: skip
    flow = ftla.VariationalFlow(ftla.arm())
    placement = ftla.Placement((2, 4, 2), [0, 2], [1.0])
    with pytest.raises(errors.InputError, match=named):
        ftla.Matching(flow, placement=placement, **(given | changes))
