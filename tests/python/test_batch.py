"""Batches of bodies, from Python."""

import numpy as np
import pytest

import somersault
from somersault import RigidBody, State, batch, forces


def test_a_batch_is_its_bodies_one_by_one(body: RigidBody) -> None:
    rng = np.random.default_rng(20261121)
    bodies = [body, *(RigidBody.box(1.0, rng.uniform(0.5, 1.0, 3)) for _ in range(129))]
    states = [
        State(rng.normal(size=3), rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)) for _ in bodies
    ]
    steps = rng.choice([0.01, 0.02, 0.03], len(bodies))
    gravity = (0.0, 0.0, -9.81)
    motion = batch.integrate_batch(bodies, states, (0.0, 1.0), steps, gravity=gravity)
    assert motion.position.shape == (2, len(bodies), 3)
    assert motion[0] == states
    for i, (b, x) in enumerate(zip(bodies, states, strict=True)):
        alone = somersault.integrate(
            b, x, (0.0, 1.0), dt=steps[i], method="rkmk_b", forces=somersault.forces.Gravity(gravity)
        )
        np.testing.assert_allclose(motion.position[-1, i], alone.position[-1], atol=1e-12)
        np.testing.assert_allclose(motion.quaternion[-1, i], alone.quaternion[-1], atol=1e-12)
        np.testing.assert_allclose(motion.angular_velocity[-1, i], alone.angular_velocity[-1], atol=1e-12)


def test_one_body_stands_for_all(body: RigidBody, state: State) -> None:
    motion = batch.integrate_batch(body, [state] * 3, (0.0, 1.0), 0.01)
    np.testing.assert_array_equal(motion.quaternion[-1, 0], motion.quaternion[-1, 2])


def test_arrays_move_as_objects_do() -> None:
    rng = np.random.default_rng(20261126)
    n = 130
    sides, mass = rng.uniform(0.5, 1.0, (n, 3)), rng.uniform(1.0, 2.0, n)
    bodies = [RigidBody.box(m, lengths) for m, lengths in zip(mass, sides, strict=True)]
    states = [
        State(rng.normal(size=3), rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)) for _ in bodies
    ]
    steps, gravity = rng.choice([0.01, 0.03], n), (0.0, 0.0, -9.81)
    motion = batch.integrate_batch(bodies, states, (0.0, 1.0), steps, gravity=gravity)
    moments = np.array([b.principal_moments for b in bodies])
    arrays = batch.integrate_arrays(
        moments,
        motion.quaternion[0],
        motion.angular_velocity[0],
        (0.0, 1.0),
        steps,
        mass=mass,
        position=motion.position[0],
        velocity=motion.velocity[0],
        gravity=gravity,
    )
    for name in ("t", "position", "quaternion", "velocity", "angular_velocity", "kinetic_energy"):
        np.testing.assert_array_equal(getattr(arrays, name), getattr(motion, name))


def test_arrays_are_recorded_at_given_times() -> None:
    moments, upright = [[1.0, 2.0, 2.5], [2.0, 2.5, 3.0]], [[0.0, 0.0, 0.0, 1.0]] * 2
    spin, times = [[0.1, 3.0, 0.2], [1.0, 2.0, -1.0]], [0.0, 0.35, 0.5, 1.2]
    motion = batch.integrate_arrays(moments, upright, spin, (0.0, 2.0), 0.01, t_eval=times)
    assert motion.t.tolist() == times and motion.quaternion.shape == (4, 2, 4)
    for i in range(2):
        body, start = RigidBody(1.0, moments[i]), State(angular_velocity=spin[i])
        exact = somersault.exact.FreeBody(body, start)(times).quaternion
        # The method is of order 4: the chord of quaternions is half of the angle; measured are 2e-10 rad.
        apart = 1.0 - np.abs(np.sum(exact * motion.quaternion[:, i], axis=1))
        assert np.all(np.sqrt(2.0 * np.maximum(apart, 0.0)) < 1e-7)
    # An interval backwards in time is refused, as by `integrate_batch`.
    with pytest.raises(somersault.InputError, match="interval"):
        batch.integrate_arrays(moments, upright, spin, (1.0, 0.0), 0.01)


def test_bad_arrays() -> None:
    moments, upright, spin = np.ones((2, 3)), np.tile([0, 0, 0, 1.0], (2, 1)), np.ones((2, 3))

    def run(*arrays: object, **options: object) -> object:
        given = [moments, upright, spin]
        given[: len(arrays)] = arrays  # type: ignore[assignment]
        return batch.integrate_arrays(*given, (0.0, 1.0), 0.1, **options)  # type: ignore[arg-type]

    for arrays, options, message in (
        (
            [3.0],
            {},
            r"`moments` must be real numbers of shape \(bodies, 3\) of at least one body, found a float",
        ),
        ([np.ones((2, 4))], {}, r"`moments` must be real numbers of shape \(2, 3\), found shape \(2, 4\)"),
        ([[[1.0, 1.0, 1.0], [1.0, 1.0, 3.0]]], {}, "body 1: "),
        ([moments, upright[:1]], {}, r"`quaternion` must be real numbers of shape \(2, 4\)"),
        ([moments, 0 * upright], {}, "`quaternion` must not be the quaternion zero"),
        ([], {"mass": [1.0, -1.0]}, "body 1: "),
        ([], {"velocity": np.ones(3)}, r"`velocity` must be real numbers of shape \(2, 3\)"),
        ([], {"t_eval": [0.5, 0.2]}, "`t_eval` must be times that follow each other"),
        ([], {"t_eval": [1.5]}, "`t_eval` must be within `interval`"),
        ([moments, upright, np.full((2, 3), np.nan)], {}, "`angular_velocity` must be finite, found NaN"),
    ):
        with pytest.raises(somersault.InputError, match=message):
            run(*arrays, **options)


def test_bad_input(body: RigidBody, state: State) -> None:
    with pytest.raises(somersault.errors.InputError, match="`states` must have one entry for each of 2"):
        batch.integrate_batch([body, body], [state], (0.0, 1.0), 0.01)
    with pytest.raises(
        somersault.InputError, match="`states` must be a sequence of State, found an int in it"
    ):
        batch.integrate_batch(body, [3], (0.0, 1.0), 0.01)  # type: ignore[list-item]
    with pytest.raises(somersault.InputError, match=r"`dt` must be a real number or numbers of shape \(2,\)"):
        batch.integrate_batch(body, [state, state], (0.0, 1.0), [0.1, 0.1, 0.1])
    with pytest.raises(somersault.errors.InputError, match="`dt` must be positive"):
        batch.integrate_batch(body, [state], (0.0, 1.0), -0.1)
    wild = State(angular_velocity=(1e200, 1e200, 1e200))
    with pytest.raises(somersault.errors.IntegrationError, match="the state of body 1 stopped being finite"):
        batch.integrate_batch(body, [state, wild], (0.0, 1.0), 0.01)


def wind(t: float, state: State) -> tuple[object, object]:
    return 0.3 * (np.array([np.sin(t), 2.0, 0.0]) - state.velocity), -0.05 * state.angular_velocity


@pytest.mark.parametrize(
    "steps", [{"dt": 0.02}, {"dt": [0.01, 0.02, 0.03], "method": "rkmk8_b"}, {"rtol": 1e-9}]
)
def test_a_batch_under_forces_is_its_bodies_one_by_one(steps: dict[str, object]) -> None:
    rng = np.random.default_rng(20261127)
    bodies = [RigidBody.box(m, rng.uniform(0.5, 1.0, 3)) for m in (1.0, 2.0, 3.0)]
    states = [
        State(rng.normal(size=3), rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)) for _ in bodies
    ]
    spring, torque = forces.Spring(3.0, attachment=(0.1, 0.2, 0.3)), forces.Torque((0.1, 0.0, 0.2), "body")
    models, times = [[spring, torque], None, forces.traced(wind)], [0.1, 0.56, 1.0]
    motion = batch.integrate_batch(
        bodies, states, (0.0, 1.0), forces=models, t_eval=times, gravity=(0, 0, -9.81), **steps
    )  # type: ignore[call-overload]
    for i, (b, x, model) in enumerate(zip(bodies, states, models, strict=True)):
        alone = dict(steps)
        alone.setdefault("method", "rkmk_b" if "dt" in alone else "rkmk8_b")
        if isinstance(alone.get("dt"), list):
            alone["dt"] = alone["dt"][i]  # type: ignore[index]
        acting = [*(model if isinstance(model, list) else [model] if model else []), forces.Gravity()]
        one = somersault.integrate(b, x, (0.0, 1.0), forces=acting, t_eval=times, **alone)  # type: ignore[arg-type]
        assert one.t.tolist() == times
        # several at a time the bodies have other rounding
        is_in_lanes = "method" not in steps
        same = np.testing.assert_allclose if is_in_lanes else np.testing.assert_array_equal
        close = {"rtol": 0.0, "atol": 1e-12 if "dt" in steps else 1e-7} if is_in_lanes else {}
        same(motion.position[:, i], one.position, **close)
        sign = np.sign(np.sum(motion.quaternion[:, i] * one.quaternion, axis=1, keepdims=True))
        same(sign * motion.quaternion[:, i], one.quaternion, **close)
        same(motion.angular_velocity[:, i], one.angular_velocity, **close)


@pytest.mark.parametrize("steps", [{"dt": 0.01}, {"rtol": 1e-10, "atol": 1e-10}])
def test_a_body_moves_the_same_in_any_company(steps: dict[str, float]) -> None:
    body, start = RigidBody.box(1.0, (0.2, 0.4, 0.6)), State(velocity=(1, 0, 0), angular_velocity=(3, 1, 2))
    every: list[object] = [
        None,
        [forces.Gravity(), forces.Drag(0.1, 0.2, 0.01)],
        forces.Spring(3.0, attachment=(0.1, 0.2, 0.3), rest_length=0.5, damping=0.2),
        forces.CentralGravity(2.0, (3.0, 0.0, 0.0)),
        [forces.Force((1, 0, 0), (0, 0.1, 0)), forces.Torque((0.1, 0, 0))],
        forces.Torque((0, 0.1, 0), "body"),
        forces.MagneticDipole((0.1, 0, 0), (0, 0.2, 0.1)),
        forces.traced(wind),
        [forces.ScheduledTorque([0.0, 0.4, 2.0], [(0, 0, 0), (0.3, 0, 0.1), (0, 0, 0)]), forces.Gravity()],
        forces.GravityGradient(forces.Orbit(1.5, 0.2, gravitational_parameter=1.0)),
        wind,
    ]

    def moved(models: list[object]) -> somersault.Trajectory:
        return batch.integrate_batch(
            body, [start] * len(models), (0.0, 1.0), forces=models, t_eval=[0.3, 1.0], **steps
        )  # type: ignore[call-overload]

    together = moved(every)
    for i, model in enumerate(every):
        alone = moved([model])
        np.testing.assert_array_equal(together.position[:, [i]], alone.position)
        np.testing.assert_array_equal(together.quaternion[:, [i]], alone.quaternion)
        exact = somersault.integrate(body, start, (0.0, 1.0), forces=model, rtol=1e-12, atol=1e-12)  # type: ignore[arg-type]
        np.testing.assert_allclose(together.position[-1, i], exact.position[-1], rtol=0, atol=1e-7)
        assert abs(together.quaternion[-1, i] @ exact.quaternion[-1]) > 1 - 1e-13
    # a failure has the number that its body has among all
    with pytest.raises(somersault.errors.IntegrationError, match="body 2"):
        moved([None, forces.Gravity(), forces.CentralGravity(1.0, start.position)])


def test_one_model_acts_on_all_bodies_of_arrays() -> None:
    rng, n = np.random.default_rng(4), 70
    moments, spin = np.array([0.4, 0.5, 0.6]) * rng.uniform(1, 2, (n, 1)), rng.normal(size=(n, 3))
    upright, mass = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)), rng.uniform(1.0, 2.0, n)
    model, options = forces.traced(wind), {"mass": mass, "velocity": spin[::-1]}
    traced = batch.integrate_arrays(moments, upright, spin, (0.0, 1.0), 0.02, forces=model, **options)  # type: ignore[arg-type]
    called = batch.integrate_arrays(moments, upright, spin, (0.0, 1.0), 0.02, forces=wind, **options)  # type: ignore[arg-type]
    np.testing.assert_allclose(traced.quaternion, called.quaternion, atol=1e-13)
    np.testing.assert_allclose(traced.velocity, called.velocity, atol=1e-13)
    # free bodies by another method, which takes no torque, and by adapted steps
    exact = [
        somersault.exact.FreeBody(RigidBody(1.0, m), State(angular_velocity=w))(1.0).quaternion
        for m, w in zip(moments, spin, strict=True)
    ]
    for free in ({"dt": 0.01, "method": "pmv10"}, {"rtol": 1e-11, "atol": 1e-11}):
        motion = batch.integrate_arrays(moments, upright, spin, (0.0, 1.0), **free)  # type: ignore[arg-type]
        assert np.all(np.abs(np.sum(exact * motion.quaternion[-1], axis=1)) > 1 - 1e-12)


def test_a_step_that_is_wrong_is_found_where_no_step_is_made(body: RigidBody, state: State) -> None:
    with pytest.raises(somersault.InputError, match="`dt` must be positive and finite, found -1"):
        batch.integrate_batch([body] * 2, [state] * 2, (0.0, 1.0), [0.1, -1.0], t_eval=[0.0])


def test_bad_forces_of_a_batch(body: RigidBody, state: State) -> None:
    def run(**options: object) -> object:
        return batch.integrate_batch([body] * 3, [state] * 3, (0.0, 1.0), **options)  # type: ignore[arg-type]

    def refuses(t: float, state: State) -> tuple[object, object]:
        raise ZeroDivisionError("no such force")

    torque = forces.Torque((0.1, 0.0, 0.0))
    for options, error, message in (
        ({"dt": 0.1, "rtol": 1e-6}, somersault.InputError, "`rtol` is for adaptive steps"),
        (
            {"dt": 0.1, "forces": [torque]},
            somersault.InputError,
            "`forces` must have one entry for each of 3",
        ),
        ({"dt": 0.1, "forces": 3}, somersault.InputError, "`forces` must hold force models or callables"),
        (
            {"dt": 0.1, "method": "pmv10", "forces": [None, torque, None]},
            somersault.InputError,
            "body 1: .*torque",
        ),
        ({"dt": 0.1, "method": "rkmk9"}, somersault.InputError, "rkmk9.*did you mean"),
        ({"method": "ab4"}, somersault.InputError, "give it a fixed step `dt`"),
        ({"dt": 0.1, "forces": refuses}, ZeroDivisionError, "no such force"),
        ({"max_steps": 2, "max_step": 1e-3}, somersault.errors.IntegrationError, "body 0: "),
    ):
        with pytest.raises(error, match=message):
            run(**options)
