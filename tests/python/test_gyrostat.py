"""The exact motion of a gyrostat against Taylor series of more than 30 digits, see gyrostat_reference.py."""

import pickle
from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import pytest
from gyrostat_reference import COUNTS, cases, motion

import somersault
from somersault import RigidBody, State
from somersault.exact import FreeBody, Gyrostat


def end(moments: Sequence[float], rotors: Sequence[float], velocity: Sequence[float], t: float) -> np.ndarray:
    """Quaternion and angular velocity, relative to the largest of the start, in principal axes."""
    state = Gyrostat(RigidBody(1.0, moments), rotors, State(angular_velocity=velocity))(t)
    size = max(np.linalg.norm(velocity), np.linalg.norm(state.angular_velocity))
    return np.concatenate([2.0 * state.quaternion, state.angular_velocity_body / size])


def off(
    found: np.ndarray, velocity: Sequence[float], quaternion: Sequence[float], omega: Sequence[float]
) -> float:
    """The distance of an end from that of the series."""
    w, *vector = quaternion
    size = max(np.linalg.norm(velocity), np.linalg.norm(omega))
    expected = np.concatenate([2.0 * np.array([*vector, w]), np.array(omega) / size])
    expected[:4] *= np.sign(expected[:4] @ found[:4])
    return float(np.linalg.norm(found - expected))


def condition(
    moments: Sequence[float], rotors: Sequence[float], velocity: Sequence[float], t: float
) -> float:
    """By how much relative changes of the data change the end, at most, and 1 at least."""
    data = np.concatenate([moments, rotors, velocity])
    here, most, step = end(moments, rotors, velocity, t), 1.0, 1e-7
    for k in np.flatnonzero(data):
        moved = data.copy()
        moved[k] *= 1.0 + step
        there = end(moved[:3], moved[3:6], moved[6:], t)
        there[:4] *= np.sign(there[:4] @ here[:4])
        most = max(most, np.linalg.norm(there - here) / step)
    return most


def within_the_bound(counts: dict[str, int]) -> int:
    """Motions, each within 1e-13 of what it is sensitive to; prints the largest of each class."""
    worst: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for name, moments, rotors, velocity, t, quaternion, omega in cases(counts):
        found = end(moments, rotors, velocity, t)
        error = off(found, velocity, quaternion, omega)
        sensitivity = condition(moments, rotors, velocity, t)
        assert error <= 1e-13 * sensitivity, (name, moments, rotors, velocity, t, error, sensitivity)
        worst[name].append((error / sensitivity, error, sensitivity))
    for name, rows in worst.items():
        share, error, sensitivity = np.max(rows, axis=0)
        print(f"{name}: error {error:.1e}, {share:.1e} of the condition, which is {sensitivity:.1e} at most")
    return sum(map(len, worst.values()))


def test_motions_of_each_class_are_within_1e_13_of_their_condition() -> None:
    assert within_the_bound({name: max(1, count // 60) for name, count in COUNTS.items()}) >= len(COUNTS)


@pytest.mark.study
def test_a_thousand_motions_within_1e_13_of_their_condition() -> None:
    assert within_the_bound(COUNTS) >= 1000


def test_without_rotors_it_is_the_free_body(body: RigidBody, state: State) -> None:
    free = FreeBody(body, state)
    assert Gyrostat(body, (0.0, 0.0, 0.0), state)(7.0) == free(7.0)
    for size in (1e-300, 1e-18, 1e-16):
        weak = Gyrostat(body, np.array([0.6, -0.8, 0.2]) * size, state)(7.0)
        np.testing.assert_allclose(weak.quaternion, free(7.0).quaternion, atol=1e-14)
        np.testing.assert_allclose(weak.angular_velocity, free(7.0).angular_velocity, atol=1e-14)


def test_momentum_and_energy_are_constant_for_a_million_seconds(body: RigidBody, state: State) -> None:
    rotors = np.array([0.3, -1.1, 0.7])
    gyrostat = Gyrostat(body, rotors, state, t0=2.0)
    np.testing.assert_allclose(gyrostat(2.0).quaternion, state.quaternion, atol=1e-14)
    flight = gyrostat(np.linspace(2.0, 1e6, 200))
    total = flight.angular_momentum + flight.orientation.apply(rotors)
    np.testing.assert_allclose(total, np.tile(gyrostat.angular_momentum, (200, 1)), atol=1e-13)
    np.testing.assert_allclose(flight.kinetic_energy, flight.kinetic_energy[0], rtol=1e-13)
    np.testing.assert_allclose(flight.position, state.position + np.outer(flight.t - 2.0, state.velocity))


def test_integrations_converge_to_it(body: RigidBody, state: State) -> None:
    rotors = np.array([0.3, -1.1, 0.7])

    def torque(t: float, now: State) -> tuple[tuple[float, ...], np.ndarray]:
        return (0.0, 0.0, 0.0), np.cross(now.orientation.apply(rotors), now.angular_velocity)

    motion = somersault.integrate(body, state, (0.0, 3.0), dt=0.01, method="rkmk8_b", forces=torque, every=50)
    exact = Gyrostat(body, rotors, state)(motion.t)
    assert (exact.orientation.inv() * motion.orientation).magnitude().max() < 1e-12


def test_near_a_separatrix_it_is_right_or_refuses() -> None:
    # h along the middle axis and a rotation about it, which is unstable, but for `aside`
    moments, rotors = (1.0, 2.0, 2.5), (0.0, 0.1, 0.0)
    refused = 0
    for aside in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
        velocity = (aside, 0.3, 0.5 * aside)
        try:
            found = end(moments, rotors, velocity, 20.0)
        except somersault.InputError as error:
            assert "separatrix" in str(error)
            refused += 1
            continue
        error = off(found, velocity, *motion(moments, rotors, velocity, 20.0))
        assert error < 1e-9, (aside, error)
    assert refused < 3


@pytest.mark.parametrize("size", [1e-59, 1e-30, 1e30, 1e59])
def test_the_motion_is_the_same_in_all_units_of_time(body: RigidBody, size: float) -> None:
    rotors, velocity = np.array([0.3, -1.1, 0.7]), np.array([0.4, 0.9, -0.2])
    one = Gyrostat(body, rotors, State(angular_velocity=velocity))(3.0)
    other = Gyrostat(body, rotors * size, State(angular_velocity=velocity * size))(3.0 / size)
    np.testing.assert_allclose(other.quaternion, one.quaternion, atol=1e-13)
    np.testing.assert_allclose(other.angular_velocity / size, one.angular_velocity, atol=1e-13)


def test_arguments_are_checked_and_pickles_are_equal(body: RigidBody, state: State) -> None:
    with pytest.raises(somersault.InputError, match="`rotors` must be"):
        Gyrostat(body, (0.0, np.nan, 0.0), state)
    with pytest.raises(somersault.InputError, match=r"`rotors` must be real numbers of shape \(3,\), found"):
        Gyrostat(body, (0.0, 1.0), state)
    with pytest.raises(somersault.InputError, match="`t0` must be finite"):
        Gyrostat(body, (0.0, 1.0, 0.0), state, np.inf)
    for size in (1e61, 1e200, 1e308):
        with pytest.raises(somersault.InputError, match="angular momentum from 1e-60 to 1e60"):
            Gyrostat(body, (size, size, 0.0), state)
    gyrostat = Gyrostat(body, (0.0, 1.0, 0.0), state, 0.5)
    with pytest.raises(somersault.InputError, match="not finite"):
        gyrostat([0.0, np.nan])
    assert pickle.loads(pickle.dumps(gyrostat))(3.0) == gyrostat(3.0)
    assert 0.0 < gyrostat.residual < 1e-12
    steady = Gyrostat(body, body.principal_axes.apply((0.0, 1.0, 0.0)), State())
    assert steady.residual == 0.0 and steady(5.0).orientation.magnitude() < 1e-15
