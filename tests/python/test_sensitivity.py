"""Derivatives through contacts: closed forms, differences of located runs, what has no derivative."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import somersault
from somersault import State, contact, errors, forces, integrate
from somersault.contact import CompliantLaw, ContactSystem, Sensitivities

G = 9.81


def differentiate(scene: ContactSystem, end: float, **options: Any) -> Sensitivities:
    given = {"forces": scene.forces, "contacts": scene.contacts, "dt": 1e-4, "method": "rkmk8"} | options
    return contact.differentiate(scene.body, scene.state, (0.0, end), **given)


def reached(scene: ContactSystem, state: State, end: float) -> State:
    run = integrate(
        scene.body, state, (0.0, end), dt=1e-4, method="rkmk8", forces=scene.forces, contacts=scene.contacts
    )
    return run[-1]


def test_a_ball_dropped_from_higher_touches_down_later_by_the_closed_form() -> None:
    height = 0.4
    ball = contact.bouncing_ball(0.7, 0.1, CompliantLaw(3e3, 4.0), height)
    found = differentiate(ball, 0.4, parameters=["mass", ("acceleration", (0.0, 0.0, -1.0))])
    assert found.events[0].kind == "touch_down"
    # t = √(2h/g): dt/dh = 1/√(2gh) and dt/dg = −t/(2g); the mass does not matter before.
    assert found.event_times[0, 2] == pytest.approx(1 / np.sqrt(2 * G * height), rel=1e-10)
    assert found.event_times[0, 12] == pytest.approx(0.0, abs=1e-12)
    assert found.event_times[0, 13] == pytest.approx(-np.sqrt(2 * height / G) / (2 * G), rel=1e-10)


def test_columns_of_the_top_are_differences_of_its_located_runs() -> None:
    top, end, step = contact.spinning_top(), 0.05, 1e-6
    found = differentiate(top, end)
    assert found.by_state.shape == (12, 12) and found.by_parameters.shape == (12, 0)
    start = top.state
    for column in (2, 3, 8, 9):
        ends = []
        for sign in (1.0, -1.0):
            parts = np.zeros(12)
            parts[column] = sign * step
            moved = State(
                start.position + parts[:3],
                Rotation.from_rotvec(parts[3:6]) * start.orientation,
                start.velocity + parts[6:9],
                start.angular_velocity + parts[9:],
            )
            ends.append(reached(top, moved, end))
        turned = (ends[0].orientation * ends[1].orientation.inv()).as_rotvec()
        difference = np.concatenate(
            [
                ends[0].position - ends[1].position,
                turned,
                ends[0].velocity - ends[1].velocity,
                ends[0].angular_velocity - ends[1].angular_velocity,
            ]
        ) / (2 * step)
        size = np.abs(found.by_state[:, column]).max()
        np.testing.assert_allclose(found.by_state[:, column], difference, atol=2e-5 * size, rtol=0)


def test_adapted_steps_and_methods_in_body_variables_give_the_same_derivatives() -> None:
    top, end = contact.spinning_top(), 0.05
    fixed = differentiate(top, end, parameters=["mass"])
    assert fixed.event_times.shape == (len(fixed.events), 13)
    # Errors of derivatives are not weighed: the largest step bounds them.
    adapted = {"dt": None, "rtol": 1e-10, "atol": 1e-12, "max_step": 1e-3, "method": None}
    for options in ({"method": "rkmk8_b"}, adapted):
        found = differentiate(top, end, parameters=["mass"], **options)
        for name in ("by_state", "by_parameters", "event_times"):
            one, other = getattr(found, name), getattr(fixed, name)
            np.testing.assert_allclose(one, other, atol=1e-7 * np.abs(other).max())


@pytest.mark.parametrize(("height", "side"), [(-1e-12, "touch"), (0.0, ""), (1e-12, "miss")])
def test_a_graze_and_a_near_miss_have_one_sided_derivatives_only(height: float, side: str) -> None:
    # Pushed up at 2 m/s² from a fall, the body turns at the ground, or just above it.
    body = somersault.RigidBody.box(1.0, (0.1, 0.1, 0.1))
    start = State((0, 0, 0.25 + height), velocity=(0, 0, -1.0))
    touching = contact.Contact((0, 0, 0), contact.HalfSpace(), CompliantLaw(50.0, 0.5))
    up = forces.Gravity((0, 0, 2.0))
    with pytest.raises(errors.SensitivityError, match=f"one-sided, of motions that {side}") as caught:
        contact.differentiate(body, start, (0.0, 1.0), dt=1e-2, contacts=touching, forces=up)
    assert caught.value.solution.by_state.shape == (12, 12)


def test_the_derivative_through_stick_and_slip_is_the_difference_of_runs() -> None:
    friction = contact.CoulombFriction(0.4, 2e3, 20.0)
    law = CompliantLaw(5e4, 300.0)
    ends = []
    for speed in (1.0 - 1e-5, 1.0, 1.0 + 1e-5):
        block = contact.sliding_block(1.5, (0.2, 0.2, 0.1), law, friction, speed, 0.1)
        found = differentiate(block, 0.6)
        ends.append(found.state.position[0])
        if speed == 1.0:
            slope = found.by_state[0, 6]
            assert [event.kind for event in found.events] == ["stick"]
    assert slope == pytest.approx((ends[2] - ends[0]) / 2e-5, rel=1e-7)


def test_what_has_no_derivative_is_refused_by_name() -> None:
    top = contact.spinning_top()
    with pytest.raises(errors.InputError, match="friction of contact 0"):
        differentiate(top, 0.01, parameters=[("friction.coefficient", 0)])
    with pytest.raises(errors.InputError, match="found contact 3"):
        differentiate(top, 0.01, parameters=[("law.stiffness", 3)])
    with pytest.raises(errors.InputError, match="of the CompliantLaw of contact 0"):
        differentiate(top, 0.01, parameters=[("law.hardness", 0)])
    with pytest.raises(errors.InputError, match="of the world or of the body"):
        differentiate(top, 0.01, method="rkmk_l")
    with pytest.raises(errors.InputError, match="`parameters` must hold"):
        differentiate(top, 0.01, parameters=["length"])
    with pytest.raises(errors.InputError, match="`parameters` must be a sequence"):
        differentiate(top, 0.01, parameters=4)


def test_the_derivative_by_the_inertia_counts_forces_that_depend_on_it() -> None:
    # A torque in proportion to the inertia turns a body alike whatever its inertia is.
    start = State((0.0, 0.0, 1.0), (0.1, 0.2, 0.3, 0.9), angular_velocity=(0.1, 0.3, -0.2))
    orbit = forces.Orbit(6.778e6)
    tide = forces.traced(lambda t, x, body: (np.trace(body.inertia) * x.position, np.zeros(3)))
    away = contact.Contact((0, 0, 0), contact.HalfSpace((0, 0, -100.0)), CompliantLaw(50.0, 0.5))

    def run(scale: float, parameters: list[str] | None = None) -> contact.Sensitivities:
        body = somersault.RigidBody(1.0, np.diag([0.1, 0.2, 0.25]) * scale)
        acting = [forces.GravityGradient(orbit), tide]
        return contact.differentiate(
            body, start, (0.0, 1.0), dt=0.1, contacts=away, forces=acting, parameters=parameters
        )

    h = 1e-4
    more, less, found = run(1 + h), run(1 - h), run(1.0, ["inertia_scale"]).by_parameters[:, 0]
    slope = (more.state.position - less.state.position) / (2 * h)
    np.testing.assert_allclose(found[:3], slope, atol=1e-8)
    assert np.abs(slope).max() > 0.1
    # neither the rates nor the orientation depend on it
    np.testing.assert_allclose(more.state.angular_velocity, less.state.angular_velocity, atol=1e-13)
    np.testing.assert_allclose(found[[3, 4, 5, 9, 10, 11]], 0.0, atol=1e-9)
