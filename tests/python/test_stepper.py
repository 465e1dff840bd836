"""Integrations that are made step by step."""

import os
import pickle
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import RigidBody, State, Stepper, contact, forces

#: x = cos t.
BALL, SPRING = RigidBody.sphere(1.0, 0.1), forces.Spring(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
AT_ONE = State(position=(1.0, 0.0, 0.0))


def event(function: Callable[[float, State], float], **attributes: Any) -> Callable[[float, State], float]:
    """The function with attributes."""
    for name, value in attributes.items():
        setattr(function, name, value)
    return function


def at_x(t: float, state: State) -> float:
    """Zero where x is."""
    return float(state.position[0])


def run(stepper: Stepper) -> Stepper:
    """The stepper at its end."""
    while stepper.status == "running":
        stepper.step()
    return stepper


def assert_same(stepper: Stepper, whole: somersault.Solution) -> None:
    """What happened is that of a run, to the last bit."""
    assert (stepper.t, stepper.state) == (whole.t[-1], whole[-1])
    assert (stepper.n_steps, stepper.n_rejected, stepper.nfev) == (
        whole.n_steps,
        whole.n_rejected,
        whole.nfev,
    )
    assert (stepper.t_events is None) == (whole.t_events is None)
    for ours, theirs in zip(stepper.t_events or (), whole.t_events or (), strict=True):
        assert ours.tolist() == theirs.tolist()
    for ours, theirs in zip(stepper.y_events or (), whole.y_events or (), strict=True):
        assert list(ours) == list(theirs)
    assert (stepper.certified, stepper.unproved) == (whole.certified, whole.unproved)
    assert stepper.n_events == whole.n_events
    for ours, theirs in zip(stepper.events, whole.events, strict=True):
        assert (ours.t, ours.contact, ours.kind) == (theirs.t, theirs.contact, theirs.kind)
        assert (ours.impulse, ours.state) == (theirs.impulse, theirs.state)


@pytest.mark.parametrize(
    "how", [{"dt": 0.07}, {"rtol": 1e-9}, {"dt": 0.05, "method": "ab4"}, {"method": "radau5", "rtol": 1e-6}]
)
@pytest.mark.parametrize("end", [1.0, -1.0])
@pytest.mark.parametrize("acting", [None, [forces.Gravity(), forces.Torque((0.1, 0.0, 0.3))]])
def test_the_steps_are_those_of_integrate(
    body: RigidBody, state: State, how: dict[str, object], end: float, acting: object
) -> None:
    whole = somersault.integrate(body, state, (0.0, end), forces=acting, dense_output=True, **how)
    stepper = Stepper(body, state, 0.0, end, forces=acting, **how)
    assert (stepper.status, stepper.t_old, stepper.step_size) == ("running", None, None)
    for before, t, after in zip(whole.t, whole.t[1:], list(whole)[1:], strict=False):
        stepper.step()
        assert (stepper.t, stepper.t_old, stepper.state) == (t, before, after)
        assert stepper.step_size == abs(t - before)
        middle = 0.5 * (t + before)
        assert stepper.dense_output()(middle) == whole.sol(middle)
    assert (stepper.status, stepper.n_steps) == ("finished", whole.n_steps)
    assert stepper.message == f"reached `t_bound` = {end:g}" and stepper.t_events is None
    plain = somersault.integrate(body, state, (0.0, end), forces=acting, **how)
    again = run(Stepper(body, state, 0.0, end, forces=acting, **how))
    assert_same(again, plain)
    with pytest.raises(somersault.InputError, match="has reached `t_bound`"):
        stepper.step()


def test_several_bodies_and_what_acts_between_them() -> None:
    star = RigidBody.sphere(1.0, 0.01)
    states = [State((x, 0, 0), velocity=(0, x / 2**0.5, 0)) for x in (0.5, -0.5)]
    pull = forces.Gravitation(0.25)
    whole = somersault.integrate([star, star], states, (0.0, 1.0), dt=0.1, interaction=pull)
    stepper = Stepper([star, star], states, 0.0, 1.0, dt=0.1, interaction=pull)
    while stepper.status == "running":
        stepper.step()
    assert stepper.state == whole[-1]


def test_state_and_forces_change_on_the_way(body: RigidBody, state: State) -> None:
    push = forces.Force((0.0, 2.0, 0.0))
    stepper = Stepper(body, state, 0.0, 2.0, dt=0.25, method="rkmk8")
    for _ in range(4):
        stepper.step()
    stepper.set_forces(push)
    assert stepper.t_old is None
    with pytest.raises(somersault.InputError, match="no step since"):
        stepper.dense_output()
    stepper.step()
    np.testing.assert_allclose(stepper.state.velocity, state.velocity + 0.25 * np.array([0, 1, 0]))
    stepper.set_state(state)
    stepper.set_forces(None)
    while stepper.status == "running":
        stepper.step()
    assert stepper.t == 2.0
    free = somersault.integrate(body, state, (1.25, 2.0), dt=0.25, method="rkmk8")
    assert stepper.state == free[-1]


def test_a_callable_is_called_and_what_it_raises_comes_out(body: RigidBody, state: State) -> None:
    seen = []

    def fails(t: float, now: State) -> tuple[tuple[float, ...], tuple[float, ...]]:
        seen.append(t)
        if t > 0.4:
            raise KeyError("broken")
        return (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)

    stepper = Stepper(body, state, 0.0, 1.0, dt=0.25, forces=fails)
    stepper.step()
    reached = stepper.state
    with pytest.raises(KeyError, match="broken"):
        stepper.step()
    assert (stepper.status, stepper.t, stepper.state) == ("failed", 0.25, reached)
    with pytest.raises(somersault.InputError, match="a step of this stepper failed"):
        stepper.step()
    stepper.set_forces(None)
    stepper.step()
    assert stepper.status == "running" and seen


def test_a_step_that_fails_is_an_integration_error(body: RigidBody) -> None:
    fast = State(angular_velocity=(30.0, 20.0, 10.0))
    stepper = Stepper(body, fast, 0.0, 10.0, dt=5.0, method="dmv2")
    with pytest.raises(somersault.errors.IntegrationError):
        stepper.step()
    assert stepper.status == "failed" and stepper.state == fast


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on this system")
def test_a_forked_child_is_told_that_its_stepper_has_no_thread(body: RigidBody, state: State) -> None:
    stepper = Stepper(body, state, 0.0, 1.0, dt=0.1)
    stepper.step()
    child = os.fork()
    if child == 0:
        try:
            stepper.step()
        except somersault.InputError as error:
            os._exit(7 if "after a fork" in str(error) else 1)
        os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    stepper.step()


def test_arguments_are_checked_and_pickles_refused(body: RigidBody, state: State) -> None:
    with pytest.raises(somersault.InputError, match="`t_bound` must be a finite time other than `t0`"):
        Stepper(body, state, 1.0, 1.0)
    with pytest.raises(somersault.InputError, match="no method is named"):
        Stepper(body, state, 0.0, 1.0, method="rk5")
    with pytest.raises(somersault.InputError, match="has no error estimate"):
        Stepper(body, state, 0.0, 1.0, method="ab4")
    with pytest.raises(somersault.InputError, match="`forces` must hold force models or callables"):
        Stepper(body, state, 0.0, 1.0, forces=3.0)
    with pytest.raises(somersault.InputError, match="`interaction` acts between several bodies"):
        Stepper(body, state, 0.0, 1.0, interaction=forces.Gravitation())
    stepper = Stepper(body, state, 0.0, 1.0, dt=0.1)
    with pytest.raises(somersault.InputError, match="`state` must be a State"):
        stepper.set_state(3.0)
    with pytest.raises(somersault.InputError, match="`forces` must hold"):
        stepper.set_forces(3.0)
    with pytest.raises(TypeError, match="cannot be copied or pickled"):
        pickle.dumps(stepper)
    stepper.step()
    assert stepper.t == 0.1


@pytest.mark.parametrize(
    "how", [{"dt": 0.3}, {"rtol": 1e-10}, {"dt": 0.1, "method": "ab4"}, {"method": "split4", "rtol": 1e-6}]
)
@pytest.mark.parametrize("interval", [(0.0, 9.0), (9.0, 0.0)])
@pytest.mark.parametrize("acting", [SPRING, None])
def test_events_are_those_of_integrate_to_the_last_bit(
    how: dict[str, Any], interval: tuple[float, float], acting: object
) -> None:
    functions = [
        at_x,
        event(lambda t, s: at_x(t, s) - 0.1, direction=-1, lipschitz=1.5),
        event(lambda t, s: s.velocity[0], direction=1),
        event(lambda t, s: t - 4.0, lipschitz=1.0),
        event(lambda t, s: at_x(t, s) + 0.2, terminal=3),
    ]
    speed = -0.3 if interval[0] == 0.0 else 0.3
    start = AT_ONE if acting else State((1.0, 0.0, 0.0), velocity=(speed, 0.0, 0.0))
    given = {"forces": acting, "events": functions, **how}
    whole = somersault.integrate(BALL, start, interval, **given)
    stepper = run(Stepper(BALL, start, *interval, **given))
    assert sum(map(len, whole.t_events or ())) >= 3
    assert_same(stepper, whole)
    assert whole.certified == (False, True, False, True, False)
    assert stepper.status == "finished" and (stepper.message == whole.message or whole.status == 0)
    middle = 0.5 * (stepper.t + float(stepper.t_old or 0.0))
    assert abs(at_x(middle, stepper.dense_output()(middle)) - at_x(0.0, stepper.state)) < 0.5
    if whole.status == 1:
        with pytest.raises(somersault.InputError, match="the stepper has ended by an event of `events"):
            stepper.step()


@pytest.mark.parametrize(
    ("function", "interval", "expected"),
    [
        (lambda t, s: (t - 0.6) ** 2 - 1e-4, (0.0, 1.0), [0.59, 0.61]),  # two in a step
        (lambda t, s: t * (t - 0.6), (0.0, 1.0), [0.6]),  # one at t0, which is none
        (lambda t, s: (t - 0.6) ** 2, (0.0, 1.0), []),  # a touch
        (lambda t, s: t - 0.5, (0.0, 1.0), [0.5]),  # at the end of a step
        (lambda t, s: t - 1.0, (0.0, 1.0), [1.0]),  # at the end of the last
        (event(lambda t, s: at_x(t, s), terminal=True), (3.0, 0.0), [np.pi / 2]),  # terminal, backwards
        (event(lambda t, s: t - 2.0, terminal=True, direction=-1), (3.0, 0.0), [2.0]),
        (event(lambda t, s: t - 2.0, terminal=True, direction=1), (3.0, 0.0), [2.0][:0]),
    ],
)
def test_events_of_scipys_tests(function: Any, interval: tuple[float, float], expected: list[float]) -> None:
    start = State((np.cos(interval[0]), 0.0, 0.0), velocity=(-np.sin(interval[0]), 0.0, 0.0))
    given: dict[str, Any] = {"forces": SPRING, "events": function, "dt": 0.25, "method": "rkmk8"}
    stepper = run(Stepper(BALL, start, *interval, **given))
    assert stepper.t_events is not None
    np.testing.assert_allclose(stepper.t_events[0], expected, atol=1e-8)
    assert_same(stepper, somersault.integrate(BALL, start, interval, **given))
    if getattr(function, "terminal", False) and expected:
        assert stepper.t == stepper.t_events[0][-1] and "`events[0]`" in stepper.message


def test_contacts_are_those_of_integrate_to_the_last_bit() -> None:
    top = contact.spinning_top()
    given: dict[str, Any] = {"forces": top.forces, "contacts": top.contacts, "events": lambda t, s: t - 0.02}
    for how in ({"dt": 1e-4}, {"rtol": 1e-7}):
        whole = somersault.integrate(top.body, top.state, (0.0, 0.05), **given, **how)
        stepper = run(Stepper(top.body, top.state, 0.0, 0.05, **given, **how))
        assert len(whole.events) >= 2 and whole.stretches is not None
        assert_same(stepper, whole)
        np.testing.assert_array_equal(stepper.stretches, whole.stretches[-1])
    few = run(Stepper(top.body, top.state, 0.0, 0.05, dt=1e-4, keep_events=False, **given))
    assert few.events == () and few.n_events >= 2
    # several bodies, of which two meet each other, and an event that ends the run within a step
    balls, law = [RigidBody.sphere(1.0, 0.1)] * 2, contact.CompliantLaw(1e4, 10.0)
    pair = contact.SpherePair((0, 1), (0.1, 0.1), law)
    states = [State((0.0, 0.0, 0.0), velocity=(1.0, 0.0, 0.0)), State((0.5, 0.0, 0.0))]
    meets = event(lambda t, both: both[1].position[0] - 0.55, terminal=True)
    given = {"pairs": [pair], "events": meets, "dt": 0.01}
    whole = somersault.integrate(balls, states, (0.0, 1.0), **given)
    stepper = run(Stepper(balls, states, 0.0, 1.0, **given))
    assert [what.kind for what in whole.events] == ["touch_down", "release"]
    assert_same(stepper, whole)
    assert stepper.message == whole.message


def test_a_block_keeps_its_stretches_where_forces_change() -> None:
    friction = contact.CoulombFriction(0.6, 1e5, 300.0)
    law = contact.CompliantLaw(1e5, 300.0)
    feet = [
        contact.Contact((x, y, -0.1), contact.HalfSpace(), law, friction=friction)
        for x in (-0.2, 0.2)
        for y in (-0.2, 0.2)
    ]
    block = RigidBody.box(1.0, (0.4, 0.4, 0.2))
    start = State((0.0, 0.0, 0.1 - 9.81 / 4e5))
    weight, push = forces.Gravity(), forces.Force((2.0, 0.0, 0.0))
    given: dict[str, Any] = {"contacts": feet, "dt": 1e-3, "method": "rkmk"}
    stepper = Stepper(block, start, 0.0, 0.2, forces=[weight, push], **given)
    while stepper.t < 0.1:
        stepper.step()
    held = stepper.stretches
    assert held.shape == (4, 3) and abs(held).max() > 1e-6
    stepper.set_forces([weight])
    run(stepper)
    first = somersault.integrate(block, start, (0.0, 0.1), forces=[weight, push], **given)
    assert first.stretches is not None
    then = somersault.integrate(
        block, first[-1], (0.1, 0.2), forces=[weight], stretches=first.stretches[-1], **given
    )
    assert then.stretches is not None
    assert stepper.state == then[-1]
    np.testing.assert_array_equal(stepper.stretches, then.stretches[-1])
    assert stepper.nfev == first.nfev + then.nfev
    stepper = Stepper(block, start, 0.0, 0.2, forces=weight, stretches="loaded", **given)
    stepper.step()
    stepper.set_state(start, stretches=np.zeros((4, 3)))
    stepper.step()
    with pytest.raises(somersault.InputError, match="`stretches` must be real numbers of shape"):
        stepper.set_state(start, stretches=[0.0])
    assert stepper.status == "running"


def test_after_a_terminal_event_forces_change_and_the_integration_continues() -> None:
    # A spring that is let go as soon as it has its natural length.
    released = event(lambda t, s: at_x(t, s), terminal=1, direction=-1)
    second = event(lambda t, s: s.velocity[0] + 2.0)
    stepper = Stepper(
        BALL, AT_ONE, 0.0, 4.0, forces=SPRING, events=[released, second], rtol=1e-11, atol=1e-12
    )
    run(stepper)
    assert stepper.t == pytest.approx(np.pi / 2, abs=1e-9)
    before = stepper.nfev
    stepper.set_forces(forces.Force((-1.0, 0.0, 0.0)))
    assert (stepper.status, stepper.t_old) == ("running", None)
    run(stepper)
    # v = −1 − (t − π/2) is −2 a second later
    assert (stepper.t, stepper.status) == (4.0, "finished") and stepper.nfev > before
    assert stepper.t_events is not None
    np.testing.assert_allclose(np.concatenate(stepper.t_events), [np.pi / 2, np.pi / 2 + 1], atol=1e-9)
    # counts continue: the event after the terminal one is terminal too
    stepper = Stepper(BALL, AT_ONE, 0.0, 9.0, forces=SPRING, events=released, dt=0.1, method="rkmk8")
    run(stepper)
    stepper.set_state(stepper.state)
    run(stepper)
    assert stepper.t == pytest.approx(5 * np.pi / 2, abs=1e-6)


def test_a_step_that_ends_at_a_zero_has_one_event_where_forces_change_there() -> None:
    stepper = Stepper(BALL, AT_ONE, 0.0, 1.0, events=lambda t, s: t - 0.5, dt=0.25)
    stepper.step()
    stepper.step()
    assert stepper.t_events is not None and stepper.t_events[0].tolist() == [0.5]
    stepper.set_forces(SPRING)
    run(stepper)
    assert stepper.t_events is not None and stepper.t_events[0].tolist() == [0.5]


def test_what_an_event_raises_comes_out_and_a_bound_that_does_not_hold_is_named() -> None:
    def fails(t: float, state: State) -> float:
        if t > 0.3:
            raise ZeroDivisionError("on purpose")
        return 1.0

    stepper = Stepper(BALL, AT_ONE, 0.0, 1.0, dt=0.25, events=fails)
    stepper.step()
    with pytest.raises(ZeroDivisionError, match="on purpose"):
        stepper.step()
    assert (stepper.status, stepper.t) == ("failed", 0.25)
    assert stepper.message == "a step failed after t = 0.25: ZeroDivisionError: on purpose"
    fast = event(lambda t, s: 3.0 * t - 1.0, lipschitz=2.0)
    stepper = Stepper(BALL, AT_ONE, 0.0, 1.0, dt=0.25, events=fast)
    with pytest.raises(somersault.InputError, match=r"`lipschitz` = 2 of `events\[0\]` .* is too small"):
        stepper.step()


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="signals are not sent to threads")
def test_ctrl_c_stops_a_step_within_half_a_second() -> None:
    def slow(t: float, state: State) -> float:
        time.sleep(0.02)
        return t - 20.0

    stepper = Stepper(BALL, AT_ONE, 0.0, 1e3, dt=100.0, events=event(slow, lipschitz=30.0))
    began = []

    def interrupt() -> None:
        began.append(time.perf_counter())
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    timer = threading.Timer(0.1, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        stepper.step()
    assert time.perf_counter() - began[0] < 0.5
    assert (stepper.status, stepper.t, stepper.state) == ("failed", 0.0, AT_ONE)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are not listed")
def test_a_stepper_that_is_dropped_leaves_no_thread() -> None:
    def alive() -> int:
        names = [path / "comm" for path in Path("/proc/self/task").iterdir()]
        return sum(name.read_text() == "somersault\n" for name in names if name.exists())

    def settled(count: int) -> bool:
        until = time.perf_counter() + 5.0
        while alive() != count and time.perf_counter() < until:
            time.sleep(0.005)
        return alive() == count

    for _ in range(100):
        before = alive()  # without those of other tests that are about to end
        time.sleep(0.02)
        if alive() == before:
            break
    steppers = [
        Stepper(BALL, AT_ONE, 0.0, 1.0, dt=0.1, events=at_x, forces=force) for force in (None, SPRING)
    ]
    steppers[0].step()
    assert settled(before + 2)
    steppers[0].set_forces(SPRING)
    assert settled(before + 2)
    steppers.clear()
    assert settled(before)
