"""Integrations that are made step by step."""

import os
import pickle

import numpy as np
import pytest

import somersault
from somersault import RigidBody, State, Stepper, forces


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
        Stepper(body, state, 0.0, 1.0, method="rk4")
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
