"""Systems of a user's own: what their callables give, raise or return, and Ctrl-C."""

import signal
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from somersault import errors, ftla

Array = NDArray[np.float64]

RATES = np.array([[-1.0, -1.0], [-1.0, 1.0]])


def field(p: Array) -> Array:
    """The cubic regulator."""
    x, costate = p
    return np.array([-(x**3) - costate, -x + 3.0 * x**2 * costate])


def jacobian(p: Array) -> Array:
    x, costate = p
    return np.array([[-3.0 * x**2, -1.0], [-1.0 + 6.0 * x * costate, 3.0 * x**2]])


def hamiltonian(p: Array) -> float:
    x, costate = p
    return float(0.5 * (x**2 - costate**2) - costate * x**3)


OWN = ftla.System(
    field,
    jacobian,
    2,
    hamiltonian=hamiltonian,
    control=lambda p: -p[1:],
    running_cost=lambda p: 0.5 * float(p @ p),
)


def test_callables_give_what_the_compiled_system_gives() -> None:
    compiled = ftla.cubic_regulator()
    p = np.array([[1.0, 0.4], [0.3, -0.2]])
    np.testing.assert_allclose(OWN.field(p), compiled.field(p), rtol=1e-15)
    np.testing.assert_allclose(OWN.jacobian(p), compiled.jacobian(p), rtol=1e-15)
    np.testing.assert_allclose(OWN.hamiltonian(p), compiled.hamiltonian(p), rtol=1e-14)
    np.testing.assert_array_equal(OWN.control(p), compiled.control(p))
    np.testing.assert_allclose(OWN.running_cost(p), compiled.running_cost(p), rtol=1e-15)
    own, theirs = ftla.VariationalFlow(OWN), ftla.VariationalFlow(compiled)
    np.testing.assert_allclose(
        own.transition(p[0], 2.0).matrix, theirs.transition(p[0], 2.0).matrix, rtol=1e-12
    )
    np.testing.assert_allclose(
        own.spectrum(p[0], 1.0).exponents, theirs.spectrum(p[0], 1.0).exponents, rtol=1e-11
    )


def test_a_problem_of_ones_own_is_solved_to_its_closed_form() -> None:
    fractions = ftla.graded_times(1.0, 0.02, 0.2)
    found = ftla.continue_through(OWN, [([0.0], [0.0]), ([1.0], [1.5])], 40.0, fractions)
    extremal = found.extremal
    a, b = 1.0, 1.5
    costates = [-(a**3) + a * np.sqrt(1.0 + a**4), -(b**3) - b * np.sqrt(1.0 + b**4)]
    assert found.success
    np.testing.assert_allclose(extremal.nodes[[0, -1], 1], costates, atol=1e-10)
    low, high = extremal.hamiltonian_range()
    assert high - low < 1e-10
    value = sum(0.25 * (x**2 * np.sqrt(1.0 + x**4) + np.arcsinh(x**2)) for x in (a, b))
    assert extremal.cost() == pytest.approx(value - a**4 / 4 + b**4 / 4, abs=1e-10)


class Broken(Exception):
    """Raised by a callable."""


def broken(p: Array) -> Array:
    raise Broken("out of order")


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("field", lambda: ftla.System(broken, jacobian, 2)),
        ("jacobian", lambda: ftla.System(field, broken, 2)),
    ],
)
def test_what_a_callable_raises_is_the_cause(name: str, make: Any) -> None:
    flow = ftla.VariationalFlow(make())
    placement = ftla.Placement((1, 0, 1), [], [1.0])
    calls = [
        lambda: flow.transition([1.0, 0.4], 1.0),
        lambda: flow.transitions(np.zeros((8, 2)), 1.0),
        lambda: flow.spectra([1.0, 0.4], [1.0, 2.0]),
        lambda: placement.place(flow, [1.0, 0.4]),
        lambda: ftla.shoot(flow.system, [1.0], [1.5], np.linspace(0.0, 4.0, 9), np.zeros((9, 2))),
        lambda: ftla.continue_through(flow.system, [([0.0], [0.0]), ([1.0], [1.5])], 4.0, [0.0, 0.5, 1.0]),
    ]
    for call in calls:
        with pytest.raises(errors.EvaluationError, match=f"`{name}` raised Broken: out of order") as caught:
            call()
        assert isinstance(caught.value.__cause__, Broken)


def test_optional_callables_may_raise_or_be_missing() -> None:
    system = ftla.System(field, jacobian, 2, hamiltonian=broken, control=broken, running_cost=broken)  # type: ignore[arg-type]
    for call in (system.hamiltonian, system.control, system.running_cost):
        with pytest.raises(errors.EvaluationError) as caught:
            call([1.0, 0.4])
        assert isinstance(caught.value.__cause__, Broken)
    bare = ftla.System(field, jacobian, 2)
    for name in ("hamiltonian", "control", "running_cost"):
        with pytest.raises(errors.InputError, match=f"without `{name}`"):
            getattr(bare, name)([1.0, 0.4])
    with pytest.raises(errors.InputError, match="without `running_cost`"):
        ftla.VariationalFlow(bare).cost([1.0, 0.4], 1.0)


def test_a_field_that_is_not_finite_is_named_with_its_place() -> None:
    def nan_below_a_half(p: Array) -> Array:
        return field(p) if p[0] > 0.5 else np.full(2, np.nan)

    flow = ftla.VariationalFlow(ftla.System(nan_below_a_half, jacobian, 2))
    with pytest.raises(errors.EvaluationError, match="not finite near t = ") as caught:
        flow.state([1.0, 0.4], 10.0)
    assert caught.value.t is not None and 0.0 < caught.value.t < 2.0
    assert caught.value.state is not None and caught.value.state[0] == pytest.approx(0.5, abs=1e-3)
    with pytest.raises(errors.EvaluationError):
        flow.system.field([0.0, 0.0])
    placed = ftla.Placement((1, 0, 1), [], [9.0]).place(flow, [1.0, 0.4])
    assert placed.status == "flow" and "not finite" in placed.message
    with pytest.raises(errors.EvaluationError, match="segment 0 of the guess"):
        ftla.shoot(flow.system, [0.0], [1.0], [0.0, 1.0], np.zeros((2, 2)))


def test_a_scalar_that_is_not_finite_is_named() -> None:
    system = ftla.System(field, jacobian, 2, hamiltonian=lambda p: np.nan)
    with pytest.raises(errors.EvaluationError, match="`hamiltonian` returned NaN"):
        system.hamiltonian([1.0, 0.4])


def pendulum(wrong: str = "", entry: int = 0, part: float = 0.0) -> ftla.System:
    """A driven pendulum; one entry of a derivative may be off by a part of itself."""

    def off(name: str, values: Any) -> Any:
        numbers = np.array(values, dtype=float)
        if name == wrong:
            numbers.flat[entry] *= 1.0 + part
            if name == "hessian":
                numbers = np.triu(numbers) + np.triu(numbers, 1).T
        return numbers

    return ftla.state_costate(
        lambda x, u: [x[1], u[0] - np.sin(x[0]) - 0.2 * x[1] * abs(x[1])],
        lambda x, u: float(0.5 * (x[0] ** 2 + 2.0 * u[0] ** 2) + x[1] ** 2),
        2,
        1,
        jacobian=lambda x, u: off("jacobian", [[0.0, 1.0, 0.0], [-np.cos(x[0]), -0.4 * abs(x[1]), 1.0]]),
        gradient=lambda x, u: off("gradient", [x[0], 2.0 * x[1], 2.0 * u[0]]),
        hessian=lambda x, u, costate: off(
            "hessian",
            np.diag([1.0 + costate[1] * np.sin(x[0]), 2.0 - 0.4 * costate[1] * np.sign(x[1]), 2.0]),
        ),
    )


def test_right_derivatives_are_accepted() -> None:
    assert ftla.cold_start(pendulum(), [1.0, 0.0], [0.2, 0.1], 2.0).success


WRONG = [("jacobian", (1, 3, 4, 5)), ("gradient", (0, 1, 2)), ("hessian", (0, 4, 8))]


@pytest.mark.parametrize(("name", "entry"), [(name, k) for name, entries in WRONG for k in entries])
def test_a_derivative_off_by_a_thousandth_is_refused(name: str, entry: int) -> None:
    rng = np.random.default_rng(entry)
    for part in (1e-3, *10.0 ** rng.uniform(-3.0, -1.0, 2) * rng.choice([-1.0, 1.0], 2)):
        # the gradient by a control of zero is right; the Hessian is what does not fit it
        told = r"`hessian\(" if (name, entry) == ("gradient", 2) else rf"`{name}\("
        with pytest.raises(errors.InputError, match=told + ".*must be the derivative of"):
            ftla.cold_start(pendulum(name, entry, part), [1.0, 0.0], [0.2, 0.1], 2.0)


@pytest.mark.parametrize("entry", range(4))
def test_a_jacobian_of_a_field_off_by_a_thousandth_is_refused(entry: int) -> None:
    def wrong(p: Array) -> Array:
        rates = jacobian(p)
        rates.flat[entry] *= 1.001
        return rates

    system = ftla.System(field, wrong, 2)
    # at zero two entries vanish, and are right
    for call in (
        lambda: ftla.VariationalFlow(system).transition([1.0, 0.4], 1.0),
        lambda: ftla.shoot(system, [1.0], [1.5], np.linspace(0.0, 4.0, 9), np.zeros((9, 2))),
    ):
        with pytest.raises(errors.InputError, match=r"`jacobian\(p\)` must be the derivative of `field`"):
            call()


def test_derivatives_are_checked_to_both_sides_of_a_kink() -> None:
    # |x| and its slope to the right, at the kink itself
    system = ftla.System(
        lambda p: np.array([p[1], abs(p[0])]),
        lambda p: np.array([[0.0, 1.0], [1.0 if p[0] >= 0.0 else -1.0, 0.0]]),
        2,
    )
    assert np.isfinite(ftla.VariationalFlow(system).transition([0.0, 0.0], 1.0).matrix).all()


def test_a_field_that_is_not_that_of_its_hamiltonian_is_no_success() -> None:
    own = ftla.System(field, jacobian, 2, hamiltonian=lambda p: 1.01 * hamiltonian(p) + 0.1 * p[0])
    fractions = ftla.graded_times(1.0, 0.02, 0.2)
    found = ftla.continue_through(own, [([0.0], [0.0]), ([1.0], [1.5])], 10.0, fractions)
    assert not found.success and "Hamiltonian is not constant" in found.message
    shot = ftla.shoot(own, [1.0], [1.5], 10.0 * fractions, np.zeros((len(fractions), 2)))
    assert shot.status == "hamiltonian_drifts" and not shot.success and shot.residual <= 1e-11
    assert shot.hamiltonian_drift is not None and shot.hamiltonian_drift > 1e-3


def exploding(p: Array) -> Array:
    """The cubic regulator up to x = 1.2, where arithmetic overflows."""
    import math

    return field(p) + 0.0 * math.exp(1e4 * max(p[0] - 1.2, 0.0))


@pytest.mark.parametrize("overflow", [True, False])
def test_trials_that_overflow_are_rejected_and_the_best_is_kept(overflow: bool) -> None:
    def nan(p: Array) -> Array:
        return field(p) if p[0] < 1.2 else np.full(2, np.nan)

    system = ftla.System(exploding if overflow else nan, jacobian, 2)
    fractions = ftla.graded_times(1.0, 0.02, 0.2)
    found = ftla.continue_through(system, [([0.0], [0.0]), ([0.5], [1.0]), ([0.75], [1.5])], 10.0, fractions)
    assert found.status == "broke_off" and found.stage == "to stage 3 of 3"
    assert found.extremal.status == "on_the_way" and found.extremal.nodes[-1, 0] == pytest.approx(
        1.2, abs=0.1
    )
    # at the first point it is the reason that is told
    with pytest.raises(errors.EvaluationError) as caught:
        ftla.VariationalFlow(system).state([1.5, 0.0], 1.0)
    if overflow:
        assert isinstance(caught.value.__cause__, OverflowError)


def test_a_problem_without_a_value_beyond_a_bound_is_followed_up_to_it() -> None:
    def cost(x: Array, u: Array) -> float:
        return float(0.5 * (x @ x + u @ u)) if x[0] < 1.2 else np.nan

    system = ftla.state_costate(
        lambda x, u: -x + u,
        cost,
        1,
        1,
        jacobian=lambda x, u: [[-1.0, 1.0]],
        gradient=lambda x, u: [x[0] if x[0] < 1.2 else np.nan, u[0]],
        hessian=lambda x, u, costate: np.eye(2),
    )
    fractions = ftla.graded_times(1.0, 0.02, 0.2)
    found = ftla.continue_through(system, [([0.0], [0.0]), ([0.5], [1.0]), ([0.75], [1.5])], 10.0, fractions)
    assert found.status == "broke_off" and 0.5 < found.s < 1.0
    with pytest.raises(errors.EvaluationError, match="`gradient` returned NaN"):
        system.field([1.5, 0.0])


@pytest.mark.parametrize(
    ("returned", "found"),
    [
        (np.zeros(3), r"`field\(p\)` .* \(2,\), found shape \(3,\)"),
        (np.zeros((1, 2)), "found shape"),
        (None, "NoneType"),
        ("zero", "str"),
        ([0.0, 1j], "complex"),
        (3.0, "found shape"),
    ],
)
def test_what_is_no_field_is_an_input_error(returned: Any, found: str) -> None:
    system = ftla.System(lambda p: returned, jacobian, 2)
    for call in (
        lambda: system.field([1.0, 0.4]),
        lambda: ftla.VariationalFlow(system).state([1.0, 0.4], 1.0),
    ):
        with pytest.raises(errors.InputError, match=found):
            call()


def test_what_is_no_jacobian_is_an_input_error() -> None:
    system = ftla.System(field, lambda p: np.eye(3), 2)
    with pytest.raises(errors.InputError, match=r"`jacobian\(p\)` .* \(2, 2\), found shape \(3, 3\)"):
        ftla.VariationalFlow(system).transition([1.0, 0.4], 1.0)


def test_systems_that_cannot_be_made_are_refused() -> None:
    with pytest.raises(errors.InputError, match="`field` must be a callable"):
        ftla.System(1.0, jacobian, 2)  # type: ignore[arg-type]
    with pytest.raises(errors.InputError, match="`control` must be a callable"):
        ftla.System(field, jacobian, 2, control=3)  # type: ignore[arg-type]
    for dimension in (0, 257, 10**9):
        with pytest.raises(errors.InputError, match=f"`dimension` must be from 1 to 256, found {dimension}"):
            ftla.System(field, jacobian, dimension)
    odd = ftla.System(lambda p: -p, lambda p: -np.eye(3), 3)
    with pytest.raises(errors.InputError, match="as many costates as states, found 3 numbers"):
        ftla.cold_start(odd, [1.0], [0.0], 1.0)


@pytest.mark.parametrize("dimension", [1, 3, 7])
def test_a_field_may_have_an_odd_dimension(dimension: int) -> None:
    rates = np.arange(1.0, dimension + 1.0)
    flow = ftla.VariationalFlow(ftla.System(lambda p: rates * p, lambda p: np.diag(rates), dimension))
    spectrum = flow.spectrum(np.zeros(dimension), 3.0)
    np.testing.assert_allclose(spectrum.exponents, rates, rtol=1e-9)
    assert flow.transition(np.ones(dimension), 0.5).matrix.shape == (dimension, dimension)


@pytest.mark.parametrize("n_states", [7, 16])
def test_a_problem_of_many_states_is_solved(n_states: int) -> None:
    # regulators side by side, each with a rate of its own
    a = np.linspace(0.5, 1.5, n_states)
    eye = np.eye(n_states)
    system = ftla.state_costate(
        lambda x, u: -a * x + u,
        lambda x, u: 0.5 * (x @ x + u @ u),
        n_states,
        n_states,
        jacobian=lambda x, u: np.hstack([-np.diag(a), eye]),
        gradient=lambda x, u: np.concatenate([x, u]),
        hessian=lambda x, u, costate: np.eye(2 * n_states),
    )
    assert system.dimension == 2 * n_states
    found = ftla.cold_start(system, np.ones(n_states), np.zeros(n_states), 12.0)
    assert found.success, found.message
    # the solution of the Riccati equation for an endless horizon
    np.testing.assert_allclose(found.extremal.nodes[0, n_states:], np.sqrt(1.0 + a * a) - a, rtol=1e-8)


@pytest.mark.parametrize("dimension", [2, 4, 6, 8, 10, 12, 14, 16, 20, 24, 32, 64])
def test_every_dimension_is_there(dimension: int) -> None:
    n = dimension // 2
    rates = np.kron(RATES, np.eye(n)) * np.tile(np.arange(1.0, n + 1.0), 2)[:, None]
    flow = ftla.VariationalFlow(ftla.System(lambda p: rates @ p, lambda p: rates, dimension))
    spectrum = flow.spectrum(np.zeros(dimension), 3.0)
    expected = np.sqrt(2.0) * np.arange(1.0, n + 1.0)
    np.testing.assert_allclose(spectrum.exponents, np.concatenate([-expected[::-1], expected]), rtol=1e-9)


def test_a_family_that_raises_or_gives_nonsense_is_an_error() -> None:
    system = ftla.linear_regulator()
    start = ftla.shoot(system, [1.0], [1.5], np.linspace(0.0, 4.0, 9), np.zeros((9, 2)))

    def raises(s: float) -> Any:
        if s > 0.0:
            raise Broken("out of order")
        return system, [1.0], [1.5], 4.0

    with pytest.raises(errors.EvaluationError, match="`family` raised") as caught:
        ftla.follow(raises, start)
    assert isinstance(caught.value.__cause__, Broken)
    with pytest.raises(errors.InputError, match="`family` must return"):
        ftla.follow(lambda s: (1.0, 2.0), start)  # type: ignore[arg-type, return-value]
    with pytest.raises(errors.InputError, match="dimension 2"):
        ftla.follow(lambda s: (ftla.arm(), [0.0] * 4, [0.0] * 4, 4.0), start)
    with pytest.raises(errors.InputError, match="horizon"):
        ftla.follow(lambda s: (system, [1.0], [1.5], -1.0), start)
    with pytest.raises(errors.InputError, match="initial_state"):
        ftla.follow(lambda s: (system, [1.0, 2.0], [1.5], 4.0), start)


SCRIPT = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in background shells
import time
import numpy as np
from somersault import ftla
def field(p):
    return np.array([p[1], -p[0]])
def jacobian(p):
    return np.array([[0.0, 1.0], [-1.0, 0.0]])
own = ftla.System(field, jacobian, 2)
points = np.zeros((200_000, 8)) + [-1.5, 0.05, 0.0, 0.0, -0.2, 0.0, -1.3, -0.1]
def wait(system):
    ftla.VariationalFlow(system, rtol=1e-13, max_steps=10**12).state([1.0, 0.0], 1e9)
def cloud():
    ftla.VariationalFlow(ftla.arm(), rtol=1e-13).transitions(points, 2.0)
def far():
    ftla.solve_arm([0.0, 0.05, 0.0, 0.0], [1.0, 0.05, 0.0, 0.0], 1e4)
def many():
    flow = ftla.VariationalFlow(ftla.arm())
    flow.spectra([0.0, 3.0, 0.4, 0.0, -0.2, 0.0, -0.2, 0.0], np.arange(1, 20_001) * 2e-4)
print("ready", flush=True)
try:
    {call}
    print("returned", time.monotonic(), sep="|")
except KeyboardInterrupt:
    print("raised", time.monotonic(), sep="|")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
@pytest.mark.parametrize("call", ["wait(own)", "cloud()", "far()", "many()"])
def test_an_interrupt_ends_a_run_within_a_second(call: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT.format(call=call)], stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        fields = process.communicate(timeout=60)[0].strip().split("|")
    assert fields[0] == "raised"
    assert float(fields[1]) - sent < 1.0


def test_other_threads_run_meanwhile() -> None:
    flow = ftla.VariationalFlow(ftla.arm(), rtol=1e-13)
    points = np.tile([-1.5, 0.05, 0.0, 0.0, -0.2, 0.0, -1.3, -0.1], (40, 1))
    worker = threading.Thread(target=flow.transitions, args=(points, 2.0))
    worker.start()
    turns = 0
    while worker.is_alive():
        turns += 1
        time.sleep(0.001)
    worker.join()
    # Held, the interpreter would have let this thread run once or twice.
    assert turns > 10
