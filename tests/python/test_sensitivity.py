"""Derivatives through contacts: closed forms, differences of located runs, what has no derivative."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from somersault import State, contact, errors, integrate
from somersault.contact import CompliantLaw, Scene, Sensitivities

G = 9.81


def differentiate(scene: Scene, end: float, **options: Any) -> Sensitivities:
    given = {"forces": scene.forces, "contacts": scene.contacts, "dt": 1e-4, "method": "rkmk8"} | options
    return contact.differentiate(scene.body, scene.state, (0.0, end), **given)


def reached(scene: Scene, state: State, end: float) -> State:
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
    assert found.event_times[2, 0] == pytest.approx(1 / np.sqrt(2 * G * height), rel=1e-10)
    assert found.event_times[12, 0] == pytest.approx(0.0, abs=1e-12)
    assert found.event_times[13, 0] == pytest.approx(-np.sqrt(2 * height / G) / (2 * G), rel=1e-10)


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


def test_what_has_no_derivative_is_refused_by_name() -> None:
    top = contact.spinning_top()
    with pytest.raises(errors.SensitivityInputError, match="friction of contact 0"):
        differentiate(top, 0.01, parameters=[("friction", 0)])
    with pytest.raises(errors.SensitivityInputError, match="found contact 3"):
        differentiate(top, 0.01, parameters=[("stiffness", 3)])
    with pytest.raises(errors.SensitivityInputError, match="world variables"):
        differentiate(top, 0.01, method="rkmk_b")
    with pytest.raises(errors.InputError, match="`parameters` must hold"):
        differentiate(top, 0.01, parameters=["length"])
    with pytest.raises(errors.InputError, match="`parameters` must be a sequence"):
        differentiate(top, 0.01, parameters=4)
