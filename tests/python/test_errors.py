"""Bad input gives an exception that names the argument, what was found and what is allowed."""

from collections.abc import Callable

import numpy as np
import pytest

import somersault
from somersault import RigidBody, State, errors, forces, integrate, multibody

BODY = RigidBody.box(1.0, (0.2, 0.4, 0.6))
START = State(angular_velocity=(1.0, 2.0, 3.0))


def run(**arguments: object) -> object:
    """An integration that succeeds but for what the arguments change."""
    given = {"body": BODY, "state": START, "interval": (0.0, 1.0), "dt": 0.01} | arguments
    return integrate(**given)  # type: ignore[arg-type]


def raises(error: type[Exception], part: str, call: Callable[[], object]) -> None:
    with pytest.raises(error) as caught:
        call()
    assert part in str(caught.value)
    assert type(caught.value) is error


@pytest.mark.parametrize("part", ["position", "velocity", "angular_velocity", "angular_velocity_body"])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        ((1.0, 2.0), "must be real numbers of shape (3,), found shape (2,)"),
        (np.zeros((1, 3)), "must be real numbers of shape (3,), found shape (1, 3)"),
        (1.0, "must be real numbers of shape (3,), found shape ()"),
        ("abc", "must be real numbers of shape (3,), found a str of dtype"),
        ([1j, 0, 0], "must be real numbers of shape (3,), found a list of dtype complex128"),
        ([[1], [2, 3]], "must be real numbers of shape (3,), found a list that is no array"),
        ((np.nan, 0.0, 0.0), "must be finite, found NaN"),
        ((0.0, -np.inf, 0.0), "must be finite, found -inf"),
    ],
)
def test_vectors_of_a_state(part: str, value: object, message: str) -> None:
    raises(errors.InputError, f"`{part}` {message}", lambda: State(**{part: value}))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ((0.0, 0.0, 0.0), "found shape (3,)"),
        (np.zeros((2, 4)), "found shape (2, 4)"),
        ((0.0, 0.0, 0.0, 0.0), "must not be the quaternion zero"),
        ((0.0, 0.0, np.nan, 1.0), "must be finite, found NaN"),
        (np.diag([1.0, 1.0, -1.0]), "must be a rotation matrix"),
        (2.0 * np.eye(3), "must be a rotation matrix"),
    ],
)
def test_orientations(value: object, message: str) -> None:
    raises(errors.InputError, message, lambda: State(orientation=value))  # type: ignore[arg-type]


def test_two_angular_velocities() -> None:
    both = {"angular_velocity": (1, 0, 0), "angular_velocity_body": (1, 0, 0)}
    raises(errors.InputError, "only one of `angular_velocity`", lambda: State(**both))  # type: ignore[arg-type]


@pytest.mark.parametrize("mass", [0.0, -1.0, np.nan, np.inf])
def test_masses(mass: float) -> None:
    raises(errors.InputError, "`mass` must be positive and finite", lambda: RigidBody(mass, (1, 1, 1)))


def test_inertias() -> None:
    raises(errors.InputError, "triangle inequality", lambda: RigidBody(1.0, (1.0, 1.0, 3.0)))
    raises(errors.InputError, "must all be positive", lambda: RigidBody(1.0, (1.0, 1.0, 0.0)))
    skew = [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    raises(errors.InputError, "must be symmetric", lambda: RigidBody(1.0, skew))
    raises(errors.InputError, "shape (3,) or (3, 3), found shape (2,)", lambda: RigidBody(1.0, (1, 1)))
    raises(errors.InputError, "`radius` must be positive", lambda: RigidBody.sphere(1.0, -1.0))


@pytest.mark.parametrize("dt", [0.0, -0.1, np.nan, np.inf])
def test_steps(dt: float) -> None:
    raises(errors.InputError, "`dt` must be positive and finite", lambda: run(dt=dt))


@pytest.mark.parametrize("interval", [(1.0, 1.0), (0.0, np.inf), (np.nan, 1.0)])
def test_intervals(interval: tuple[float, float]) -> None:
    message = "`interval` must lead from one finite time to another"
    raises(errors.InputError, message, lambda: run(interval=interval))


@pytest.mark.parametrize("interval", [(), (1.0,), (0.0, 1.0, 2.0), None, 5, "ab", (0.0, "x"), [[0.0, 1.0]]])
def test_intervals_that_are_none_name_the_argument(interval: object) -> None:
    model = somersault.multibody.two_link_arm()
    at_rest = ([0.0, 0.0], [0.0, 0.0])
    for call in (
        lambda: run(interval=interval),
        lambda: somersault.multibody.integrate_tree(model, *at_rest, interval, dt=0.1),  # type: ignore[arg-type]
        lambda: somersault.multibody.fly(model, *at_rest, lambda t: ([], []), interval, dt=0.1),  # type: ignore[arg-type]
        lambda: somersault.batch.integrate_batch(BODY, [START], interval, 0.1),  # type: ignore[arg-type]
        lambda: somersault.contact.differentiate(BODY, START, interval, dt=0.1, contacts=[]),  # type: ignore[arg-type]
    ):
        raises(errors.InputError, "`interval` must be real numbers of shape (2,), found", call)


def test_a_step_too_small_for_its_interval() -> None:
    raises(errors.InputError, "is too small for the interval", lambda: run(dt=1e-300))


def test_an_unknown_method_lists_the_known_ones() -> None:
    with pytest.raises(errors.InputError) as caught:
        run(method="rk5")
    for name in somersault.methods().names:
        assert name in str(caught.value)
    with pytest.raises(KeyError, match="no method is named"):
        somersault.methods()["rk5"]
    for name, meant in (("rkmkk", "rkmk"), ("dmv2z", "dmv2"), ("hune", "heun")):
        raises(errors.InputError, f"; did you mean `{meant}`?", lambda n=name: run(method=n))  # type: ignore[misc]
        with pytest.raises(KeyError, match="did you mean"):
            somersault.methods()[name]
    raises(errors.InputError, "`method` must be a name or a row", lambda: run(method=4))


def test_methods_without_torque() -> None:
    torque = forces.Torque((0.0, 0.0, 1.0))
    for method in somersault.methods():
        if method.scope == "torque-free":
            raises(errors.InputError, "accepts no torque", lambda m=method: run(method=m, forces=torque))  # type: ignore[misc]
            run(method=method, forces=forces.Gravity())


def test_methods_for_forces_with_series() -> None:
    series = [method for method in somersault.methods() if method.scope == "forces with series"]
    assert [method.name for method in series] == ["taylor16"]
    without = (
        lambda t, state: ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        forces.traced(lambda t, state: ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
        [forces.Gravity(), forces.ReactionWheels([(0.0, 0.0, 1.0)], 0.0, 1.0)],
    )
    for acting in without:
        message = "method `taylor16` needs forces whose Taylor series are known: uniform gravity"
        raises(errors.InputError, message, lambda f=acting: run(method="taylor16", forces=f))  # type: ignore[misc]


def test_methods_without_an_error_estimate_need_a_step() -> None:
    raises(errors.InputError, "method `ab2` has no error estimate", lambda: run(method="ab2", dt=None))


def test_choices_name_what_is_allowed() -> None:
    raises(errors.InputError, "`start_up` must be 'one_step' or 'ladder'", lambda: run(start_up="x"))
    raises(errors.InputError, "`on_interrupt` must be 'raise' or 'return'", lambda: run(on_interrupt="x"))
    raises(errors.InputError, "`frame` must be", lambda: forces.Torque((0, 0, 1), frame="x"))  # type: ignore[arg-type]
    for every in (0, -3):
        raises(errors.InputError, "`every` must be a positive", lambda n=every: run(every=n))  # type: ignore[misc]
    raises(errors.InputError, "`observer` must be a callable", lambda: run(observer=3))
    raises(errors.InputError, "`rtol` is for adaptive steps", lambda: run(rtol=1e-6))
    raises(
        errors.InputError, "`interaction` acts between several", lambda: run(interaction=forces.Gravitation())
    )


def test_bodies_and_states_must_match() -> None:
    raises(errors.InputError, "`body` must be a RigidBody", lambda: run(body=3))
    raises(errors.InputError, "found the class Gravity", lambda: run(forces=forces.Gravity))
    raises(errors.InputError, "found a tuple of length 3", lambda: run(forces=lambda *_: (0.0, 0.0, 1.0)))
    tree = multibody.two_link_arm()
    raises(errors.InputError, "integrated by `multibody.integrate_tree`", lambda: run(body=tree))
    raises(errors.InputError, "did you mean `rk4`?", lambda: run(method="RK4"))
    raises(errors.InputError, "`body` must hold at least one", lambda: run(body=[], state=[]))
    raises(errors.InputError, "`state` must be a State, found a list", lambda: run(state=[START]))
    raises(errors.InputError, "must be a sequence of 2 states", lambda: run(body=[BODY, BODY], state=[START]))
    three = [forces.Gravity()] * 3
    raises(
        errors.InputError,
        "`forces` must have one entry for each of the 2 bodies, found 3",
        lambda: run(body=[BODY, BODY], state=[START, START], forces=three),
    )


def test_forces_that_are_none() -> None:
    raises(errors.InputError, "`forces` must hold force models or callables", lambda: run(forces=3))
    raises(
        errors.InputError,
        "`forces` must hold force models or callables",
        lambda: run(forces=[forces.Gravity]),
    )


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (3.0, "must return a pair (force, torque), each of shape (3,), found a float"),
        ((1.0, 2.0, 3.0), "must return a pair"),
        (
            ((1.0, 2.0), (0.0, 0.0, 0.0)),
            "(t, state)[0]` must be real numbers of shape (3,), found shape (2,)",
        ),
        (((0.0, 0.0, 0.0), None), "(t, state)[1]` must be real numbers of shape (3,)"),
        (
            ((0.0, np.nan, 0.0), (0.0, 0.0, 0.0)),
            "returned a force or torque that is NaN or infinite at t = 0",
        ),
    ],
)
def test_what_a_callable_returns(returned: object, message: str) -> None:
    raises(errors.InputError, message, lambda: run(forces=lambda t, state: returned))


class Trouble(Exception):
    """What a callable raises."""


@pytest.mark.parametrize(
    "method", [m.name for m in somersault.methods() if m.scope in ("any system", "rigid bodies")]
)
def test_what_a_force_raises_comes_out(method: str) -> None:
    def force(t: float, state: State) -> tuple[tuple[float, ...], tuple[float, ...]]:
        if t > 0.5:
            raise Trouble(t)
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)

    with pytest.raises(Trouble) as caught:
        run(forces=force, method=method, dense_output=True)
    t = caught.value.args[0]
    assert 0.5 < t < 0.53 and caught.value.__notes__ == [
        f"raised by the force {force.__qualname__} at t = {t}"
    ]


def test_what_an_observer_raises_comes_out() -> None:
    def observer(t: float, state: State) -> None:
        raise Trouble(t)

    with pytest.raises(Trouble) as caught:
        run(observer=observer)
    assert caught.value.__notes__ == [f"raised by the observer {observer.__qualname__} at t = 0.01"]


def test_what_an_interaction_raises_comes_out() -> None:
    def interaction(t: float, states: list[State]) -> None:
        raise Trouble("between")

    two = {"body": [BODY, BODY], "state": [START, START]}
    with pytest.raises(Trouble, match="between") as caught:
        run(**two, interaction=interaction)
    assert caught.value.__notes__ == [f"raised by the interaction {interaction.__qualname__} at t = 0"]
    message = "must return a pair (force, torque), each of shape (2, 3)"
    raises(errors.InputError, message, lambda: run(**two, interaction=lambda t, states: None))


def test_a_state_that_stops_being_finite_ends_the_run() -> None:
    wild = State(velocity=(1e200, 0.0, 0.0))
    drag = forces.Drag(quadratic=1e200)
    raises(errors.IntegrationError, "the state stopped being finite", lambda: run(state=wild, forces=drag))


def test_every_exception_has_the_common_base_and_bad_input_is_a_value_error() -> None:
    for error in (getattr(errors, name) for name in errors.__all__):
        if issubclass(error, Warning):
            continue
        assert issubclass(error, errors.SomersaultError)
        assert issubclass(error, ValueError) == issubclass(error, errors.InputError)
