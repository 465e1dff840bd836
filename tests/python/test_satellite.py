"""Torques on satellites, wheels and gyros: their integrals, small motions, closed forms and bad input."""

import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

import somersault
from somersault import RigidBody, State, forces

ORBIT = forces.Orbit(2.0, gravitational_parameter=8.0)  # n = 1 rad/s


def adapted(body: RigidBody, state: State, end: float, acting: object) -> somersault.Solution:
    return somersault.integrate(
        body, state, (0.0, end), method="rkmk8_b", rtol=1e-12, atol=1e-13, forces=acting
    )


def test_jacobis_integral_is_constant_on_a_circle(body: RigidBody, state: State) -> None:
    flight = adapted(body, state, 10.0, forces.GravityGradient(ORBIT))
    outwards = flight.orientation.inv().apply(ORBIT.position(flight.t) / 2.0)
    pull = 1.5 * np.einsum("ni,ij,nj->n", outwards, body.inertia, outwards)
    integral = flight.rotational_energy + pull - ORBIT.mean_motion * flight.angular_momentum[:, 2]
    np.testing.assert_allclose(integral, integral[0], rtol=1e-10)
    assert np.ptp(flight.rotational_energy) > 0.01


def test_planar_libration_is_a_pendulum_in_twice_the_angle() -> None:
    moments, start = np.array([0.3, 0.7, 0.8]), 0.6
    body = RigidBody(1.0, moments)
    turned = State(orientation=Rotation.from_euler("z", start), angular_velocity=(0.0, 0.0, 1.0))
    flight = adapted(body, turned, 8.0, forces.GravityGradient(ORBIT))
    angle = flight.orientation.as_euler("zyx")[:, 0]
    angle = (angle - flight.t + np.pi) % (2 * np.pi) - np.pi
    # (2 angle)'' = -w^2 sin(2 angle), from rest: sin(angle) = sin(start) cd(w t)
    frequency = np.sqrt(3 * (moments[1] - moments[0]) / moments[2])
    sn, _, _, _ = ellipj(ellipk(np.sin(start) ** 2) + frequency * flight.t, np.sin(start) ** 2)
    np.testing.assert_allclose(np.sin(angle), np.sin(start) * sn, atol=1e-9)


def test_small_motions_have_the_frequencies_of_hughes() -> None:
    # axes of the orbit: x outwards (yaw), y ahead (roll), z normal (pitch), moments of a stable satellite
    yaw, roll, pitch = 0.5, 0.9, 1.0
    body, size = RigidBody(1.0, (yaw, roll, pitch)), 1e-5
    k1, k3 = (pitch - yaw) / roll, (pitch - roll) / yaw
    squares = np.roots([1.0, -(1 + 3 * k1 + k1 * k3), 4 * k1 * k3])
    frequencies = np.sqrt(squares.real)
    times = np.linspace(0.0, 40.0, 400)
    start = State(orientation=Rotation.from_rotvec([size, 0.7 * size, 0.0]), angular_velocity=(0.0, 0.0, 1.0))
    flight = somersault.integrate(
        body,
        start,
        (0.0, 40.0),
        rtol=1e-12,
        atol=1e-13,
        forces=forces.GravityGradient(ORBIT),
        t_eval=times,
    )
    frame = Rotation.from_rotvec(np.outer(times, (0, 0, 1)))
    angles = (frame.inv() * flight.orientation).as_rotvec()
    waves = np.column_stack([f(w * times) for w in frequencies for f in (np.cos, np.sin)])
    for column in (0, 1):
        rest = np.linalg.lstsq(waves, angles[:, column], rcond=None)[1]
        assert np.sqrt(rest[0] / 400) < 1e-4 * size


def test_energy_and_the_momentum_along_the_field_are_constant(body: RigidBody, state: State) -> None:
    field, moment = np.array([0.3, -0.1, 0.4]), np.array([0.5, 0.2, -1.0])
    flight = adapted(body, state, 5.0, forces.MagneticDipole(moment, field))
    energy = flight.rotational_energy - flight.orientation.apply(moment) @ field
    np.testing.assert_allclose(energy, energy[0], atol=1e-10)
    np.testing.assert_allclose(
        flight.angular_momentum @ field, flight.angular_momentum[0] @ field, atol=1e-11
    )
    assert np.ptp(flight.rotational_energy) > 0.01


def test_the_field_of_a_dipole_is_twice_as_strong_on_its_axis() -> None:
    polar = forces.Orbit(2.0, inclination=np.pi / 2, gravitational_parameter=8.0)
    magnet = forces.MagneticDipole((1.0, 0.0, 0.0), (0.0, 0.0, 4.0), polar)
    sphere = RigidBody.sphere(1.0, 1.0)
    for t, field in ((0.0, -0.5), (np.pi / 2, 1.0)):
        _, torque = magnet.wrench(t, sphere, State())
        np.testing.assert_allclose(torque, np.cross((1, 0, 0), (0, 0, field)), atol=1e-15)


def test_orbits_obey_keplers_laws() -> None:
    orbit = forces.Orbit(1.5, 0.6, 0.9, 2.0, -0.7, 0.3, 2.0)
    t = np.linspace(-5.0, 20.0, 60)
    r, v = orbit.position(t), orbit.velocity(t)
    distance = np.linalg.norm(r, axis=1)
    np.testing.assert_allclose(0.5 * (v**2).sum(1) - 2.0 / distance, -2.0 / 3.0, rtol=1e-12)
    momentum = np.cross(r, v)
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (60, 1)), atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(momentum[0]), np.sqrt(2.0 * 1.5 * (1 - 0.36)), rtol=1e-13)
    np.testing.assert_allclose(orbit.position(t + orbit.period), r, atol=1e-12)
    np.testing.assert_allclose(
        orbit.frame(1.0).apply((1, 0, 0)), orbit.position(1.0) / np.linalg.norm(orbit.position(1.0))
    )
    assert pickle.loads(pickle.dumps(orbit)) == orbit


def test_light_and_air_push_plates_that_face_them() -> None:
    body = RigidBody.sphere(1.0, 1.0)
    black, mirror, white = (
        forces.Plate(2.0, (1, 0, 0), (0, 0.5, 0), specular, diffuse)
        for specular, diffuse in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    for plate, factor in ((black, 1.0), (mirror, 2.0), (white, 5 / 3)):
        force, torque = forces.SolarPressure((3, 0, 0), plate, 1e-3).wrench(0.0, body, State())
        np.testing.assert_allclose(force, (-2e-3 * factor, 0, 0))
        np.testing.assert_allclose(torque, np.cross((0, 0.5, 0), force))
    away = forces.SolarPressure((-1, 0, 0), [black, mirror])
    assert not np.any(away.wrench(0.0, body, State()))
    # with the light at 60 degrees a mirror is pushed along its normal by 2 P A cos^2
    force, _ = forces.SolarPressure((1, np.sqrt(3), 0), mirror, 1e-3).wrench(0.0, body, State())
    np.testing.assert_allclose(force, (-1e-3, 0, 0), atol=1e-18)
    ahead = forces.Plate(2.0, (0, 1, 0), (0.3, 0, 0))
    force, torque = forces.AerodynamicDrag(ORBIT, ahead, 1e-3, 2.0).wrench(0.0, body, State())
    np.testing.assert_allclose(force, (0, -0.5e-3 * 2.0 * 2.0 * 4.0, 0), atol=1e-18)
    np.testing.assert_allclose(torque, np.cross((0.3, 0, 0), force))


def total(model: forces.ReactionWheels | forces.ControlMomentGyros, flight: somersault.Solution) -> NDArray:
    return flight.angular_momentum + flight.orientation.apply(model.momentum(flight.t))


def wheels(body: RigidBody) -> forces.ReactionWheels:
    axes = [(1, 1, 0), (0, 0, 2), (0.3, -1, 0.2)]
    torques = [[0.0, 0.1, 0.0], [0.2, -0.1, 0.3], [0.1, 0.0, -0.2]]
    inertias, momenta = [0.02, 0.03, 0.01], [0.5, -0.3, 0.2]
    return forces.ReactionWheels(axes, inertias, momenta, torques, [0.0, 2.0, 3.0], body=body)


def test_the_total_momentum_of_wheels_and_gyros_is_constant(body: RigidBody, state: State) -> None:
    gyros = forces.ControlMomentGyros(
        [(0, 0, 1), (1, 0, 0)], [(1, 0, 0), (0, 1, 1)], [0.5, 0.8], [0.1, 0.0], [0.3, -0.6], body=body
    )
    assert gyros.carrier == body
    for model in (wheels(body), gyros):
        assert model.carrier is not None
        flight = adapted(model.carrier, state, 5.0, model)
        whole = total(model, flight)
        np.testing.assert_allclose(whole, np.tile(whole[0], (len(flight), 1)), atol=1e-11)
        assert np.ptp(flight.angular_momentum, axis=0).min() > 0.01
        again = pickle.loads(pickle.dumps(model))
        assert again.carrier == model.carrier
        acts = [each.wrench(2.3, model.carrier, state) for each in (model, again)]
        for ours, theirs in zip(*acts, strict=True):
            np.testing.assert_array_equal(ours, theirs)


def steps_to_rounding(body: RigidBody, state: State, count: int, dt: float = 0.005) -> float:
    """The relative change of the total momentum by so many steps, with wheels that nothing drives."""
    model = forces.ReactionWheels(np.eye(3), [0.02, 0.03, 0.01], [0.5, -0.3, 0.2], body=body)
    flight = somersault.integrate(
        model.carrier,
        state,
        (0.0, count * dt),
        dt=dt,
        method="rkmk8_b",
        forces=model,
        every=count // 10,
    )
    whole = total(model, flight)
    return float(np.linalg.norm(whole - whole[0], axis=1).max() / np.linalg.norm(whole[0]))


def test_five_thousand_steps_keep_the_total_momentum_to_rounding(body: RigidBody, state: State) -> None:
    assert steps_to_rounding(body, state, 5000) < 1e-13


@pytest.mark.study
def test_a_million_steps_keep_the_total_momentum_to_rounding(body: RigidBody, state: State) -> None:
    # the same for steps of half the length and of twice the length: an error of the method would differ by 2⁸
    changes = [steps_to_rounding(body, state, 1_000_000, dt) for dt in (0.0025, 0.005, 0.01)]
    print("total momentum within", ", ".join(f"{change:.1e}" for change in changes))
    assert max(changes) < min(1e-11, 4 * min(changes))


def test_wheels_that_nothing_drives_are_the_exact_gyrostat(body: RigidBody, state: State) -> None:
    model = forces.ReactionWheels([(0, 1, 0)], [0.02], [1.1], body=body)
    carrier = model.carrier
    flight = adapted(carrier, state, 4.0, model)
    exact = somersault.exact.Gyrostat(carrier, (0.0, 1.1, 0.0), state)(flight.t)
    assert (exact.orientation.inv() * flight.orientation).magnitude().max() < 1e-10


def test_a_wheel_stopped_by_its_motor_turns_the_body_about_its_axis() -> None:
    # h from 1 to 0 at the torque -0.5: the carrier takes all of it, 1 / (0.4 - 0.05) rad/s
    satellite = RigidBody(12.0, (0.3, 0.25, 0.4))
    model = forces.ReactionWheels([(0, 0, 1)], 0.05, 1.0, [[-0.5], [-0.5]], [0.0, 2.0], body=satellite)
    flight = adapted(model.carrier, State(), 2.0, model)
    np.testing.assert_allclose(flight.angular_velocity[-1], (0, 0, 1 / 0.35), atol=1e-10)
    np.testing.assert_allclose(model.wheel_momenta([0.0, 1.0, 2.0])[:, 0], (1.0, 0.5, 0.0), atol=1e-15)
    speed = model.wheel_momenta(2.0)[0] / 0.05 - flight.angular_velocity_body[-1, 2]
    np.testing.assert_allclose(speed, -1 / 0.35)


def test_rotors_refuse_a_body_that_does_not_carry_them(body: RigidBody, state: State) -> None:
    gyros = forces.ControlMomentGyros([(0, 0, 1)], [(1, 0, 0)], 0.5, body=body)
    other = RigidBody(2.0, 2.0 * body.inertia)
    for model, wrong in ((wheels(body), body), (gyros, other)):
        assert model.carrier is not None and model.carrier != wrong
        calls: list[tuple[str, Any, Any]] = [
            ("forces", somersault.integrate, (wrong, state, (0.0, 1.0))),
            ("forces", somersault.integrate, ([wrong], [state], (0.0, 1.0))),
            ("forces", somersault.Stepper, (wrong, state, 0.0, 1.0)),
            ("forces", somersault.studies.Problem, (wrong, state, 1.0)),
            ("body", model.wrench, (0.0, wrong, state)),
        ]
        for argument, call, arguments in calls:
            options = {
                somersault.studies.Problem: {"reference": state, "forces": model},
                model.wrench: {},
            }.get(call, {"dt": 0.1, "forces": [model]})
            with pytest.raises(somersault.InputError) as caught:
                call(*arguments, **options)
            kind = type(model).__name__
            named = f"`{argument}` must act on the `carrier` of its {kind}, {model.carrier}, found {wrong}"
            assert str(caught.value) == named
        # the mass plays no part, and neither does rounding
        alike = RigidBody(7.0, model.carrier.inertia * (1.0 + 1e-12))
        somersault.integrate(alike, state, (0.0, 0.1), dt=0.1, forces=model)


def test_schedules_are_linear_between_their_times() -> None:
    model = forces.ReactionWheels([(1, 0, 0)], 0.0, 0.0, [[1.0], [3.0]], [1.0, 2.0])
    t = np.array([-1.0, 0.0, 1.0, 1.5, 2.0, 4.0])
    np.testing.assert_allclose(model.momentum(t)[:, 0], [-1.0, 0.0, 1.0, 1.75, 3.0, 9.0], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: forces.Orbit(1.0, 1.0), "`eccentricity` must be from 0 to below 1, found 1"),
        (lambda: forces.Orbit(-1.0), "`semi_major_axis` must be positive"),
        (lambda: ORBIT.position(np.nan), "`t` must be finite"),
        (lambda: forces.Plate(1.0, (0, 0, 0)), "`normal` must be positive"),
        (lambda: forces.Plate(1.0, (0, 0, 1), specular=0.7, diffuse=0.6), "`diffuse` must be at most 1 with"),
        (lambda: forces.AerodynamicDrag(ORBIT, [1.0], 1e-12), "`plates` must hold Plate"),
        (lambda: forces.AerodynamicDrag(ORBIT, [], -1.0), "`density` must be finite and not negative"),
        (lambda: forces.SolarPressure((0, 0, 0), []), "`sun` must be positive"),
        (lambda: forces.MagneticDipole((0, 0, np.inf), (0, 0, 1)), "`moment` must be finite"),
        (lambda: forces.ReactionWheels([(0, 0, 0)], 1.0), "`axes` must be positive"),
        (lambda: forces.ReactionWheels([(0, 0, 1)], -1.0), "`inertias` must be finite and not negative"),
        (lambda: forces.ReactionWheels([(0, 0, 1)], 1.0, [1.0, 2.0]), "`momenta` must be a real number or"),
        (lambda: forces.ReactionWheels([(0, 0, 1)], 1.0, times=[0.0]), "`times` are those of `torques`"),
        (
            lambda: forces.ReactionWheels([(0, 0, 1)], 1.0, torques=[[1], [1]], times=[0.0, 0.0]),
            "`times` must be increasing",
        ),
        (lambda: forces.ReactionWheels([(0, 0, 1)], 9.0, body=RigidBody.sphere(1.0, 1.0)), "`body`"),
        (
            lambda: forces.ReactionWheels([(0, 0, 1)], 0.1),
            "`body` must be given where `inertias` are not zero",
        ),
        (
            lambda: forces.ReactionWheels([(0, 0, 1)], 0.0, torques=[[1], [1]], times=[-1.5e308, 1.5e308]),
            "`torques` must be of a finite integral over `times`, found inf",
        ),
        (
            lambda: forces.ControlMomentGyros([(0, 0, 1)], [(0, 1, 1)], 1.0),
            "`spins` must be perpendicular to",
        ),
    ],
)
def test_what_is_not_allowed_is_said(make: object, message: str) -> None:
    with pytest.raises(somersault.InputError, match=message):
        make()  # type: ignore[operator]
