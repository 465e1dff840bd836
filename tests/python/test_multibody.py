"""Trees of bodies: closed forms, round trips, batches, bad input."""

import copy
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from somersault import Model, RigidBody, errors, multibody
from somersault.multibody import Link, Robot

Array = NDArray[np.float64]


def tree(seed: int = 1, bodies: int = 12) -> Model:
    """A random tree with joints of all kinds; the root floats."""
    random = np.random.default_rng(seed)
    kinds = ["fixed", "revolute", "prismatic", "spherical", "planar", "free"]
    links = []
    for i in range(bodies):
        joint: Any = "free" if i == 0 else kinds[i % 6]
        box = RigidBody.box(random.uniform(0.5, 2.0), random.uniform(0.1, 0.5, 3))
        links.append(
            Link(
                f"b{i}",
                joint,
                parent=f"b{random.integers(i)}" if i else None,
                axis=random.normal(size=3) if joint in ("revolute", "prismatic") else None,
                body=box,
                center=random.uniform(-0.2, 0.2, 3),
                origin=random.uniform(-0.5, 0.5, 3),
                orientation=Rotation.random(rng=random),
                damping=random.uniform(0.0, 0.1),
            )
        )
    return Model(links)


@pytest.fixture(scope="module")
def model() -> Model:
    return tree()


@pytest.fixture
def state(model: Model) -> tuple[Array, Array, Array]:
    """q, v and a third vector of that length."""
    random = np.random.default_rng(2)
    return model.random(random), *random.normal(size=(2, model.n_velocities))


def many(model: Model, n: int) -> tuple[Array, Array, Array]:
    random = np.random.default_rng(3)
    return np.array([model.random(random) for _ in range(n)]), *random.normal(size=(2, n, model.n_velocities))


def raises(error: type[Exception], part: str, call: Callable[[], object]) -> None:
    with pytest.raises(error) as caught:
        call()
    assert part in str(caught.value)
    assert type(caught.value) is error


def test_the_cart_pendulum_equals_the_equations_of_the_thesis() -> None:
    # Appendix A, corrected: (m_c + m) r'' − m ℓ θ'' cos θ + m ℓ θ'² sin θ = F,
    # m ℓ² θ'' − m ℓ r'' cos θ − m g ℓ sin θ = τ.
    cart, m, length, g = 1.3, 0.4, 0.7, 9.81
    pendulum = multibody.cart_pendulum(cart_mass=cart, mass=m, length=length, gravity=g)
    random = np.random.default_rng(4)
    for _ in range(20):
        q, v, a = random.normal(size=(3, 2))
        s, c = np.sin(q[1]), np.cos(q[1])
        expected = [
            (cart + m) * a[0] - m * length * a[1] * c + m * length * v[1] ** 2 * s,
            m * length**2 * a[1] - m * length * a[0] * c - m * g * length * s,
        ]
        np.testing.assert_allclose(pendulum.inverse_dynamics(q, v, a), expected, atol=1e-13)
        assert pendulum.kinetic_energy(q, v) == pytest.approx(
            0.5 * (cart + m) * v[0] ** 2 - m * length * c * v[0] * v[1] + 0.5 * m * length**2 * v[1] ** 2,
            abs=1e-13,
        )
        assert pendulum.potential_energy(q) == pytest.approx(m * g * length * c, abs=1e-13)


def test_the_two_link_arm_equals_the_equations_of_the_thesis() -> None:
    # Section 8.2 with M₁₂ corrected.
    m, (l1, l2), damping = (0.5, 0.7), (2.0, 0.5), (0.2, 0.1)
    arm = multibody.two_link_arm(masses=m, lengths=(l1, l2), damping=damping)
    i1, i2 = m[0] * l1**2 / 12, m[1] * l2**2 / 12
    random = np.random.default_rng(5)
    for _ in range(20):
        q, v = random.normal(size=(2, 2))
        c, s = np.cos(q[1]), np.sin(q[1])
        m12 = m[1] * (l2**2 / 4 + 0.5 * l1 * l2 * c) + i2
        m11 = m[0] * l1**2 / 4 + m[1] * (l1**2 + l1 * l2 * c + l2**2 / 4) + i1 + i2
        mass_matrix = [[m11, m12], [m12, m[1] * l2**2 / 4 + i2]]
        np.testing.assert_allclose(arm.mass_matrix(q), mass_matrix, atol=1e-13)
        bias = [
            -0.5 * l1 * l2 * m[1] * v[1] * (2 * v[0] + v[1]) * s + damping[0] * v[0],
            0.5 * l1 * l2 * m[1] * v[0] ** 2 * s + damping[1] * v[1],
        ]
        np.testing.assert_allclose(arm.bias(q, v), bias, atol=1e-13)


def test_a_single_free_body_obeys_newton_and_euler() -> None:
    box = RigidBody.box(2.0, (0.2, 0.4, 0.6))
    free = Model([Link("box", "free", body=box)], gravity=(0, 0, 0))
    v, a = np.array([0.3, -0.1, 0.2, 1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3, -1.0, 0.5, 0.7])
    omega, momentum = v[3:], box.inertia @ v[3:]
    torque = free.inverse_dynamics(free.random(0), v, a)
    np.testing.assert_allclose(torque[:3], 2.0 * (a[:3] + np.cross(omega, v[:3])), atol=1e-14)
    np.testing.assert_allclose(torque[3:], box.inertia @ a[3:] + np.cross(omega, momentum), atol=1e-14)


def test_the_algorithms_agree_with_each_other(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, a = state
    random = np.random.default_rng(6)
    wrenches = random.normal(size=(model.n_bodies, 6))
    mass_matrix, bias = model.mass_matrix(q), model.bias(q, v)
    np.testing.assert_array_equal(mass_matrix, mass_matrix.T)
    # Wrenches are in body axes, as are the Jacobians in the axes of the frame.
    outside = sum(model.jacobian(q, i, axes="frame").T @ wrenches[i] for i in range(model.n_bodies))
    torque = model.inverse_dynamics(q, v, a, wrenches)
    np.testing.assert_allclose(torque, mass_matrix @ a + bias - outside, atol=1e-11)
    np.testing.assert_allclose(model.forward_dynamics(q, v, torque, wrenches), a, atol=1e-10)
    np.testing.assert_allclose(bias, model.inverse_dynamics(q, v, np.zeros_like(v)), atol=1e-13)
    at_rest = model.inverse_dynamics(q, np.zeros_like(v), np.zeros_like(v))
    np.testing.assert_allclose(model.gravity_forces(q), at_rest, atol=1e-13)
    assert model.kinetic_energy(q, v) == pytest.approx(0.5 * v @ mass_matrix @ v, rel=1e-12)
    np.testing.assert_allclose(
        model.centroidal_momentum(q, v), model.centroidal_matrix(q) @ v, rtol=1e-13, atol=1e-13
    )


def test_hybrid_dynamics_solve_any_split(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, a = state
    torque = model.inverse_dynamics(q, v, a)
    flags = np.random.default_rng(7).random(model.n_velocities) < 0.5
    for active in (flags, flags.tolist(), ["b1", "b3"], []):
        if isinstance(active, list) and (not active or isinstance(active[0], str)):
            known = np.zeros(model.n_velocities, dtype=bool)
            for name in active:
                known[model.velocities_of(name)] = True
        else:
            known = flags
        found_a, found_torque = model.hybrid_dynamics(
            q, v, np.where(known, a, 99.0), np.where(known, 99.0, torque), active
        )
        np.testing.assert_allclose(found_a, a, atol=1e-10)
        np.testing.assert_allclose(found_torque, torque, atol=1e-10)
        np.testing.assert_array_equal(found_a[known], a[known])


def test_kinematics_agree_with_differences(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, a = state
    h = 1e-6
    ahead, behind = model.displace(q, h * v), model.displace(q, -h * v)
    poses, rates = model.poses(q), (model.poses(ahead) - model.poses(behind)) / (2 * h)
    velocities = model.velocities(q, v)
    for i in range(model.n_bodies):
        rotation = poses[i, :3, :3]
        np.testing.assert_allclose(rotation @ velocities[i, :3], rates[i, :3, 3], atol=1e-8)
        spin = rotation.T @ rates[i, :3, :3]
        np.testing.assert_allclose(velocities[i, 3:], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)
        frame = Rotation.from_rotvec((0.1, 0.2, 0.3))
        at = model.jacobian(q, model.names[i], point=(0.1, 0.2, 0.3), orientation=frame, axes="frame") @ v
        linear = velocities[i, :3] + np.cross(velocities[i, 3:], (0.1, 0.2, 0.3))
        np.testing.assert_allclose(at[:3], frame.inv().apply(linear), atol=1e-12)
        np.testing.assert_allclose(at[3:], frame.inv().apply(velocities[i, 3:]), atol=1e-12)
    centre = (model.center_of_mass(ahead) - model.center_of_mass(behind)) / (2 * h)
    np.testing.assert_allclose(model.centroidal_momentum(q, v)[:3], model.mass * centre, atol=1e-7)
    later = model.velocities(model.displace(q, h * v), v + h * a)
    sooner = model.velocities(model.displace(q, -h * v), v - h * a)
    np.testing.assert_allclose(model.accelerations(q, v, a), (later - sooner) / (2 * h), atol=1e-7)


def differences(model: Model, q: Array, function: Callable[[Array], Array]) -> Array:
    """∂f/∂q along q ⊕ ε e_k by central differences, with one column for each k."""
    h = 1e-6
    steps = h * np.eye(model.n_velocities)
    columns = [function(model.displace(q, e)) - function(model.displace(q, -e)) for e in steps]
    return np.stack(columns, axis=-1) / (2 * h)


def test_partials_are_those_of_differences(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, a = state
    wrenches = np.random.default_rng(10).normal(size=(model.n_bodies, 6))
    near = {"rtol": 1e-6, "atol": 1e-6}
    torque, torque_q, torque_v, torque_a = model.inverse_dynamics_partials(q, v, a, wrenches)
    np.testing.assert_allclose(torque, model.inverse_dynamics(q, v, a, wrenches), atol=1e-12)
    by_q = differences(model, q, lambda q: model.inverse_dynamics(q, v, a, wrenches))
    np.testing.assert_allclose(torque_q, by_q, **near)
    np.testing.assert_allclose(torque_a, model.mass_matrix(q), atol=1e-13)
    # Bias is quadratic in v, so that central differences are exact.
    shifts = np.eye(model.n_velocities)
    ahead, behind = (model.inverse_dynamics(q, v + s * shifts, a, wrenches) for s in (1, -1))
    np.testing.assert_allclose(torque_v, ((ahead - behind) / 2).T, atol=1e-11)

    found, a_q, a_v, a_torque = model.forward_dynamics_partials(q, v, torque, wrenches)
    np.testing.assert_allclose(found, a, atol=1e-10)
    np.testing.assert_allclose(a_torque @ torque_a, np.eye(len(v)), atol=1e-9)
    np.testing.assert_allclose(torque_a @ a_q, -torque_q, atol=1e-8)
    np.testing.assert_allclose(torque_a @ a_v, -torque_v, atol=1e-9)

    active = np.random.default_rng(11).random(len(v)) < 0.5
    known = np.where(active, a, torque)
    other, other_q, other_v, other_known = model.hybrid_dynamics_partials(q, v, known, active, wrenches)

    def hybrid(q: Array, v: Array, known: Array) -> Array:
        a, torque = model.hybrid_dynamics(q, v, known, known, active, wrenches)
        return np.where(active, torque, a)

    np.testing.assert_allclose(other, np.where(active, torque, a), atol=1e-10)
    np.testing.assert_allclose(other_q, differences(model, q, lambda q: hybrid(q, v, known)), **near)
    ahead, behind = (hybrid(q, v + s * shifts, known) for s in (1, -1))
    np.testing.assert_allclose(other_v, ((ahead - behind) / 2).T, atol=1e-10)
    # What is found is affine in what is known.
    step = hybrid(q, v, known + shifts) - hybrid(q, v, known)
    np.testing.assert_allclose(other_known, step.T, atol=1e-9)

    center, center_q, momentum, momentum_q, momentum_v = model.momentum_partials(q, v)
    np.testing.assert_allclose(center, model.center_of_mass(q), atol=1e-14)
    np.testing.assert_allclose(center_q, differences(model, q, model.center_of_mass), **near)
    np.testing.assert_allclose(momentum, model.centroidal_momentum(q, v), atol=1e-12)
    by_q = differences(model, q, lambda q: model.centroidal_momentum(q, v))
    np.testing.assert_allclose(momentum_q, by_q, **near)
    np.testing.assert_allclose(momentum_v, model.centroidal_matrix(q), atol=1e-13)


def test_configurations_are_a_manifold(model: Model) -> None:
    random = np.random.default_rng(8)
    start, end = model.random(random), model.random(random)
    np.testing.assert_allclose(model.displace(start, model.difference(start, end))[:3], end[:3], atol=1e-13)
    back = model.difference(start, model.displace(start, 0.1 * np.arange(model.n_velocities) / 10))
    np.testing.assert_allclose(back, 0.01 * np.arange(model.n_velocities), atol=1e-13)
    np.testing.assert_allclose(model.difference(start, start), np.zeros(model.n_velocities), atol=1e-15)
    neutral = model.neutral()
    np.testing.assert_array_equal(neutral[model.positions_of("b0")], [0, 0, 0, 0, 0, 0, 1])
    stretched = neutral.copy()
    stretched[6] = 3.0
    np.testing.assert_array_equal(model.normalize(stretched), neutral)


def test_random_configurations_keep_limits_and_seeds() -> None:
    links = [
        Link("a", "revolute", axis=(0, 0, 1), limits=(0.2, 0.3), mass=1.0, inertia=(1, 1, 1)),
        Link("b", "prismatic", parent="a", axis=(0, 0, 1), limits=(-np.inf, -0.5), mass=1.0),
        Link("c", "spherical", parent="b", mass=1.0, inertia=(1, 1, 1)),
    ]
    model = Model(links)
    q = np.array([model.random(np.random.default_rng(i)) for i in range(200)])
    assert q[:, 0].min() >= 0.2 and q[:, 0].max() <= 0.3
    assert q[:, 1].min() >= -1.0 and q[:, 1].max() <= -0.5
    np.testing.assert_allclose(np.linalg.norm(q[:, 2:], axis=1), 1.0, atol=1e-15)
    np.testing.assert_array_equal(model.random(3), model.random(3))
    assert (model.random(3) != model.random(4)).all()


def joined(results: tuple[Array, ...]) -> Array:
    """Results side by side; the first is a vector for each configuration."""
    lead = results[0].shape[:-1]
    sizes = [int(np.prod(result.shape[len(lead) :])) for result in results]
    flat = [result.reshape((*lead, n)) for result, n in zip(results, sizes, strict=True)]
    return np.concatenate(flat, axis=-1)


FUNCTIONS: list[tuple[str, Callable[[Model, Array, Array, Array], Any]]] = [
    ("inverse_dynamics", lambda m, q, v, a: m.inverse_dynamics(q, v, a)),
    ("forward_dynamics", lambda m, q, v, a: m.forward_dynamics(q, v, a)),
    ("hybrid_dynamics", lambda m, q, v, a: np.stack(m.hybrid_dynamics(q, v, a, v, ["b1"]), axis=-1)),
    ("mass_matrix", lambda m, q, v, a: m.mass_matrix(q)),
    ("bias", lambda m, q, v, a: m.bias(q, v)),
    ("gravity_forces", lambda m, q, v, a: m.gravity_forces(q)),
    ("jacobian", lambda m, q, v, a: m.jacobian(q, "b5", point=(1, 2, 3))),
    ("poses", lambda m, q, v, a: m.poses(q)),
    ("velocities", lambda m, q, v, a: m.velocities(q, v)),
    ("accelerations", lambda m, q, v, a: m.accelerations(q, v, a)),
    ("center_of_mass", lambda m, q, v, a: m.center_of_mass(q)),
    ("centroidal_momentum", lambda m, q, v, a: m.centroidal_momentum(q, v)),
    ("centroidal_matrix", lambda m, q, v, a: m.centroidal_matrix(q)),
    ("kinetic_energy", lambda m, q, v, a: m.kinetic_energy(q, v)),
    ("potential_energy", lambda m, q, v, a: m.potential_energy(q)),
    ("displace", lambda m, q, v, a: m.displace(q, v)),
    ("difference", lambda m, q, v, a: m.difference(q, m.displace(q, 0.1 * v))),
    ("normalize", lambda m, q, v, a: m.normalize(1.5 * q)),
    ("inverse_dynamics_partials", lambda m, q, v, a: joined(m.inverse_dynamics_partials(q, v, a))),
    ("forward_dynamics_partials", lambda m, q, v, a: joined(m.forward_dynamics_partials(q, v, a))),
    ("hybrid_dynamics_partials", lambda m, q, v, a: joined(m.hybrid_dynamics_partials(q, v, a, ["b1"]))),
    ("momentum_partials", lambda m, q, v, a: joined(m.momentum_partials(q, v))),
]


@pytest.mark.parametrize(("name", "function"), FUNCTIONS, ids=[name for name, _ in FUNCTIONS])
def test_batches_are_singles_to_the_last_bit(model: Model, name: str, function: Callable[..., Any]) -> None:
    q, v, a = many(model, 150)
    together = function(model, q, v, a)
    singles = np.array([function(model, *row) for row in zip(q, v, a, strict=True)])
    assert together.dtype == np.float64
    np.testing.assert_array_equal(together, singles)
    one = function(model, q, v[0], a[0])
    assert one.shape == together.shape
    np.testing.assert_array_equal(one[0], together[0])
    assert function(model, q[:0], v[:0], a[:0]).shape == (0, *together.shape[1:])


@pytest.mark.parametrize("diver", [multibody.diver_planar(), multibody.diver_spatial()])
def test_the_angular_velocity_in_flight_keeps_the_momentum(diver: multibody.Diver) -> None:
    model = diver.model
    n, planar = model.n_velocities, model.n_positions == model.n_velocities
    root = model.velocities_of(0).stop
    rng = np.random.default_rng(31)
    q = np.array([model.displace(model.neutral(), v) for v in rng.normal(0, 0.5, (70, n))])
    v, momentum = rng.normal(size=(70, n)), np.array([0.0, 40.0, 0.0] if planar else [5.0, 40.0, -9.0])
    omega, omega_q, omega_v, omega_momentum = model.flight_velocity_partials(q, v, momentum)
    v[:, root - (1 if planar else 3) : root] = omega[:, 2:] if planar else omega
    found = np.array(model.centroidal_momentum(q, v))[:, 3:]
    normal = [1] if planar else [0, 1, 2]
    np.testing.assert_allclose(found[:, normal], np.tile(momentum[normal], (70, 1)), atol=1e-11)

    def at(q: Array, v: Array, momentum: Array) -> Array:
        return model.flight_velocity_partials(q, v, momentum)[0]

    for k in (0, 69):
        by_q = differences(model, q[k], lambda q, k=k: at(q, v[k], momentum))
        np.testing.assert_allclose(omega_q[k], by_q, rtol=1e-6, atol=1e-6)
        # linear in v and in the momentum
        step = at(q[k], v[k] + np.eye(n), momentum) - omega[k]
        np.testing.assert_allclose(omega_v[k], step.T, atol=1e-10)
        step = np.array([at(q[k], v[k], momentum + e) for e in np.eye(3)]) - omega[k]
        np.testing.assert_allclose(omega_momentum[k], step.T, atol=1e-10)
        alone = model.flight_velocity_partials(q[k], v[k], momentum)
        for own, many_rows in zip(alone, (omega, omega_q, omega_v, omega_momentum), strict=True):
            np.testing.assert_array_equal(own, many_rows[k])
    # one row that stands for all, and none
    together = model.flight_velocity_partials(q, v[3], momentum)
    for own, many_rows in zip(model.flight_velocity_partials(q[5], v[3], momentum), together, strict=True):
        np.testing.assert_array_equal(own, many_rows[5])
    shapes = [found.shape for found in model.flight_velocity_partials(q[:0], v[:0], momentum)]
    assert shapes == [(0, 3), (0, 3, n), (0, 3, n), (0, 3, 3)]


def test_what_has_no_angular_velocity_in_flight_is_refused() -> None:
    pole = multibody.cart_pendulum()
    with pytest.raises(errors.InputError, match="must have a free or a planar joint to fly"):
        pole.flight_velocity_partials([0.0, 0.0], [0.0, 0.0], [0.0, 0.0, 1.0])
    rod = Model([Link("rod", "free", mass=1.0, inertia=(1.0, 1.0, 0.0))])
    q = np.tile(rod.neutral(), (3, 1))
    with pytest.raises(errors.DynamicsError, match="rod"):
        rod.flight_velocity_partials(q, np.zeros(6), [0.0, 0.0, 1.0])
    diver = multibody.diver_planar().model
    for wrong in ([0.0, 1.0], [0.0, np.nan, 0.0], "up"):
        with pytest.raises(errors.InputError, match="`angular_momentum` must"):
            diver.flight_velocity_partials(diver.neutral(), np.zeros(12), wrong)


def test_wrenches_may_be_many(model: Model) -> None:
    q, v, a = many(model, 10)
    wrenches = np.random.default_rng(9).normal(size=(10, model.n_bodies, 6))
    together = model.inverse_dynamics(q, v, a, wrenches)
    for i in range(10):
        np.testing.assert_array_equal(together[i], model.inverse_dynamics(q[i], v[i], a[i], wrenches[i]))


@pytest.mark.parametrize(
    "name",
    ["inverse_dynamics", "forward_dynamics", "inverse_dynamics_partials", "forward_dynamics_partials"],
)
def test_many_states_have_the_bits_that_each_has_alone(model: Model, name: str) -> None:
    # Groups of lanes, parts of them, one row that stands for all, and wrenches.
    def function(*arguments: Array) -> tuple[Array, ...]:
        found = getattr(model, name)(*arguments)
        return found if isinstance(found, tuple) else (found,)

    for n in (1, 2, 5, 8, 13, 67):
        q, v, a = many(model, n)
        wrenches = np.random.default_rng(n).normal(size=(n, model.n_bodies, 6))
        together = function(q, v[0], a, wrenches)
        for i in range(n):
            alone = function(q[i], v[0], a[i], wrenches[i])
            for all_rows, own in zip(together, alone, strict=True):
                np.testing.assert_array_equal(all_rows[i], own)


def test_the_first_of_many_states_without_an_acceleration_is_named() -> None:
    # At the angle 0 both sliders move along one line, and the outer one carries all mass.
    slider = Link("slider", "prismatic", axis=(1, 0, 0))
    arm = Link("arm", "revolute", parent="slider", axis=(0, 0, 1))
    bob = Link(
        "bob", "prismatic", parent="arm", axis=(1, 0, 0), mass=1.0, center=(0, 1, 0), inertia=(1, 1, 1)
    )
    model = Model([slider, arm, bob])
    q = np.array([[0.1, turn, 0.2] for turn in (0.3, 0.7, 0.1, 0.4, 0.2, 0.0, 0.5, 0.0, 0.6)])
    still = np.zeros(3)
    raises(errors.DynamicsError, "row 5", lambda: model.forward_dynamics(q, still, still))
    q[5, 1] = 0.8
    q[7, 1] = 0.9
    assert np.isfinite(model.forward_dynamics(q, still, still)).all()


def test_any_real_numbers_are_taken(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, _ = state
    expected = model.bias(q, v)
    frozen = q.copy()
    frozen.flags.writeable = False
    strided = np.repeat(v, 2)[::2]
    assert not strided.flags.c_contiguous
    for given in (frozen, q.tolist(), q.astype(">f8"), np.stack([q, q], axis=1)[:, 0]):
        np.testing.assert_array_equal(model.bias(given, strided), expected)
    whole = np.arange(model.n_velocities)
    np.testing.assert_array_equal(model.bias(q, whole), model.bias(q, whole.astype(float)))
    single = model.bias(q.astype(np.float32), v.astype(np.float32))
    np.testing.assert_allclose(single, expected, rtol=1e-4, atol=1e-4)


def test_bad_arrays_are_named(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, a = state
    n, m = model.n_positions, model.n_velocities
    shape = f"`v` must be real numbers of shape ({m},) or (n, {m}), found shape ({m - 1},)"
    raises(errors.InputError, shape, lambda: model.bias(q, v[:-1]))
    raises(errors.InputError, f"`q` must be real numbers of shape ({n},)", lambda: model.bias(q[:, None], v))
    raises(errors.InputError, "found a str of dtype", lambda: model.mass_matrix("abc"))
    raises(errors.InputError, "of dtype complex128", lambda: model.mass_matrix(1j * q))
    bad = v.copy()
    bad[3] = np.nan
    raises(errors.InputError, "`a` must be finite, found NaN", lambda: model.inverse_dynamics(q, v, bad))
    rows = np.stack([v, v, bad])
    raises(errors.InputError, "`v` must be finite, found NaN in row 2", lambda: model.bias(q, rows))
    counts = "`v` must have one row or as many as `q`, 3, found 2"
    raises(errors.InputError, counts, lambda: model.bias(np.stack([q] * 3), rows[:2]))
    long = model.neutral()
    long[3:7] *= 2.0
    raises(errors.InputError, "unit quaternion at joint 'b0', found one of norm 2", lambda: model.poses(long))
    raises(errors.InputError, "row 1: `q` must", lambda: model.poses(np.stack([q, long])))
    zero = q.copy()
    zero[3:7] = 0.0
    raises(errors.InputError, "quaternion of joint `b0` is zero", lambda: model.normalize(zero))
    raises(errors.InputError, "row 1: ", lambda: model.normalize(np.stack([q, zero])))
    wrench = np.zeros((model.n_bodies, 3))
    raises(errors.InputError, "`wrenches` must be", lambda: model.inverse_dynamics(q, v, a, wrench))


def test_bad_bodies_and_splits_are_named(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, a = state
    raises(
        errors.InputError, "no body is named `nobody`; the bodies are b0, b1, ", lambda: model.body("nobody")
    )
    close = f"{model.names[1]}s"
    raises(errors.InputError, f"; did you mean `{model.names[1]}`?", lambda: model.body(close))
    raises(errors.InputError, "body number 99 does not exist", lambda: model.jacobian(q, 99))
    raises(errors.InputError, "`axes` must be", lambda: model.jacobian(q, 0, axes="body"))  # type: ignore[arg-type]
    hybrid = model.hybrid_dynamics
    raises(errors.InputError, "`nobody`", lambda: hybrid(q, v, a, v, ["nobody"]))
    raises(errors.InputError, "`active` must hold", lambda: hybrid(q, v, a, v, [True]))
    raises(errors.InputError, "`active` must hold", lambda: hybrid(q, v, a, v, 3))  # type: ignore[arg-type]


def test_a_singular_mass_matrix_is_no_input_error() -> None:
    # Two sliders on parallel axes: the inner one carries no mass of its own once the outer is active.
    links = [
        Link("first", "prismatic", axis=(1, 0, 0), mass=1.0),
        Link("second", "revolute", parent="first", axis=(1, 0, 0), mass=1.0),
    ]
    model = Model(links)
    raises(
        errors.DynamicsError,
        "singular, or not finite, at joint `second`",
        lambda: model.forward_dynamics([0, 0], [0, 0], [0, 1]),
    )


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"joint": "hinge"}, errors.InputError, "`joint` must be 'fixed', 'revolute'"),
        ({"axis": None}, errors.InputError, "`axis` must be given for a revolute joint"),
        ({"axis": (0, 0, 0)}, errors.InputError, "the joint axis of `arm` is zero"),
        ({"axis": (0, np.nan, 0)}, errors.InputError, "`axis` of `arm` must be finite"),
        ({"joint": "free"}, errors.InputError, "`axis` is for revolute and prismatic joints"),
        ({"mass": -1.0}, errors.InputError, "`mass` of `arm` must not be negative, found -1"),
        ({"mass": np.nan}, errors.InputError, "`mass` of `arm` must be finite"),
        ({"inertia": (1, 1, 3)}, errors.InputError, "`arm` of mass 1 cannot have the principal moments"),
        ({"inertia": np.ones((2, 2))}, errors.InputError, "`inertia` must be real numbers of shape (3,)"),
        ({"inertia": np.triu(np.ones((3, 3)))}, errors.InputError, "inertia of `arm` is not symmetric"),
        ({"damping": -1.0}, errors.InputError, "`damping` of `arm` must not be negative"),
        ({"limits": (1.0, -1.0)}, errors.InputError, "limits of `arm` cross: lower 1, upper -1"),
        ({"origin": (1, 2)}, errors.InputError, "`origin` must be real numbers of shape (3,)"),
        ({"orientation": (0, 0, 0, 0)}, errors.InputError, "`orientation` must not be the quaternion zero"),
        ({"body": RigidBody.box(1.0, (1, 1, 1))}, errors.InputError, "in the place of `mass`"),
    ],
)
def test_bad_links_are_refused(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    given = {"name": "arm", "joint": "revolute", "axis": (0, 0, 1), "mass": 1.0, "inertia": (1, 1, 1)}
    raises(error, message, lambda: Link(**(given | arguments)))


def test_bad_trees_are_refused() -> None:
    root = Link("root", "free", mass=1.0, inertia=(1, 1, 1))
    arm = Link("arm", "revolute", parent="root", axis=(1, 0, 0), mass=1.0, inertia=(1, 1, 1))
    light = Link("light", "revolute", parent="root", axis=(1, 0, 0))
    for links, message in [
        ([], "the model has no body"),
        ([root, arm, arm], "a body named `arm` was added before"),
        ([arm, root], "the parent `root` of `arm` is not among the bodies added before it"),
        ([root, Link("other", "free", mass=1.0)], "`other` has no parent, but `root` is the root already"),
        ([root, light], "the joint of `light` carries no mass"),
    ]:
        raises(errors.InputError, message, lambda links=links: Model(links))  # type: ignore[misc]
    raises(errors.InputError, "`links` must be a sequence of Link", lambda: Model([root, 1]))  # type: ignore[list-item]
    raises(errors.InputError, "`gravity` must be finite", lambda: Model([root], gravity=(0, 0, np.inf)))


def test_models_survive_copies_to_the_last_bit(model: Model, state: tuple[Array, Array, Array]) -> None:
    q, v, a = state
    for again in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model), Model(model.links)):
        assert again == model
        np.testing.assert_array_equal(again.inverse_dynamics(q, v, a), model.inverse_dynamics(q, v, a))
    assert Model(model.links, gravity=(0, 0, 0)) != model
    link = model.links[1]
    assert pickle.loads(pickle.dumps(link)) == link
    assert (link.name, link.joint, link.parent) == ("b1", "revolute", "b0")
    assert link.axis is not None and np.linalg.norm(link.axis) == pytest.approx(1.0, abs=1e-15)
    assert model.links[0].axis is None and model.links[0].limits is None


def test_what_a_model_is_made_of(model: Model) -> None:
    assert model.n_bodies == len(model.names) == len(model.links) == 12
    assert model.mass == pytest.approx(sum(link.mass for link in model.links))
    assert [model.body(name) for name in model.names] == list(range(12))
    assert model.velocities_of("b0") == model.velocities_of(0) == slice(0, 6, 1)
    np.testing.assert_array_equal(model.gravity, (0, 0, -9.81))
    assert repr(model).startswith("<Model: 12 bodies from 'b0'")


def test_trees_come_from_urdf_and_go_there(tmp_path: Path) -> None:
    folder = Path(__file__).parents[1] / "urdf"
    humanoid = Model.read_urdf(folder / "humanoid.urdf", base="free")
    text = (folder / "humanoid.urdf").read_text(encoding="utf-8")
    assert Model.from_urdf(text, base="free") == humanoid
    assert Model.from_urdf(text).n_velocities == humanoid.n_velocities - 6
    still = Model.from_urdf(text, gravity=(0, 0, 0))
    np.testing.assert_array_equal(still.gravity_forces(still.neutral()), 0.0)
    path = tmp_path / "again.urdf"
    path.write_text(humanoid.to_urdf("again"), encoding="utf-8")
    again = Model.read_urdf(str(path), base="free")
    q = humanoid.random(1)
    np.testing.assert_allclose(again.mass_matrix(q), humanoid.mass_matrix(q), atol=1e-13)
    with pytest.raises(FileNotFoundError, match=r"nowhere\.urdf"):
        Model.read_urdf(tmp_path / "nowhere.urdf")
    with pytest.raises(errors.ReadError, match=r"found 'arm\.urdf'; a file is read by `read_urdf`"):
        Model.from_urdf("arm.urdf")
    path.write_bytes(b"<robot name='\xff'/>")
    with pytest.raises(errors.ReadError, match=r"again\.urdf: not UTF-8"):
        Model.read_urdf(path)
    path.write_text("<robot/>", encoding="utf-8")
    with pytest.raises(errors.ReadError, match=r"again\.urdf: the robot has no link"):
        multibody.Robot.read_urdf(path)
    for bad, message in [
        ("<robot", "not a readable XML document"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot name="r"/>', "not a readable XML document"),
        ('<robot name="r"/>', "the robot has no link"),
        ("<scene/>", "the outermost element must be <robot>, found <scene>"),
    ]:
        raises(errors.ReadError, message, lambda bad=bad: Model.from_urdf(bad))  # type: ignore[misc]
    raises(errors.InputError, "`base` must be 'fixed'", lambda: Model.from_urdf(text, base="ship"))  # type: ignore[arg-type]
    ball = Model([Link("ball", "spherical", mass=1.0, inertia=(1, 1, 1))])
    raises(errors.WriteError, "`ball` cannot be written", ball.to_urdf)


GRIPPER = """<robot name="gripper">
  <link name="palm">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="4"/></inertial>
    <visual name="skin"><origin xyz="0 0 1"/><geometry><mesh filename="palm.dae"/></geometry></visual>
    <collision><geometry><box size="1 2 3"/></geometry></collision>
  </link>
  <joint name="left" type="prismatic"><parent link="palm"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1"/></joint>
  <joint name="right" type="prismatic"><parent link="palm"/><child link="b"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="0"/><mimic joint="left" multiplier="-2" offset="0.1"/></joint>
  <link name="a"><inertial><mass value="3"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="b"><inertial><mass value="5"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
</robot>"""


def test_robots_are_read_with_their_repairs_and_geometry(tmp_path: Path) -> None:
    robot = Robot.from_urdf(GRIPPER)
    assert (robot.name, robot.model.n_velocities, repr(robot)) == (
        "gripper",
        1,
        "<Robot 'gripper': 3 bodies, 1 repair>",
    )
    assert robot.repairs[0].startswith("link `palm` (line 2) cannot have the principal moments [")
    np.testing.assert_allclose(robot.model.links[0].inertia, np.diag((1.5, 2.5, 4.0)), atol=1e-15)
    np.testing.assert_allclose(robot.model.mass_matrix([0.0]), [[3.0 + 4.0 * 5.0]])
    assert robot.model.links[2].mimic == ("a", -2.0, 0.1)
    mesh, box = robot.geometry
    assert (mesh.body, mesh.purpose, mesh.name, mesh.shape, mesh.file, mesh.size) == (
        0,
        "visual",
        "skin",
        "mesh",
        "palm.dae",
        (1.0, 1.0, 1.0),
    )
    np.testing.assert_array_equal(mesh.position, (0.0, 0.0, 1.0))
    assert mesh.orientation.magnitude() == 0.0
    assert (box.purpose, box.shape, box.size, box.file, box.name) == (
        "collision",
        "box",
        (1.0, 2.0, 3.0),
        None,
        None,
    )
    assert repr(box) == "<Geometry: collision box [1.0, 2.0, 3.0] of body 0>"
    path = tmp_path / "gripper.urdf"
    path.write_text(GRIPPER, encoding="utf-8")
    free = Robot.read_urdf(path, base="free", gravity=(0.0, 0.0, -1.6))
    again = pickle.loads(pickle.dumps(free))
    assert again.model == free.model and again.repairs == free.repairs and again.geometry == free.geometry
    assert free.model.random(1).shape == (8,)
    raises(errors.ReadError, "cannot have the principal moments", lambda: Model.from_urdf(GRIPPER))
    lost = GRIPPER.replace('mimic joint="left"', 'mimic joint="thumb"')
    raises(errors.ReadError, "mimics the joint `thumb`, which does not exist", lambda: Robot.from_urdf(lost))


LEG = """<mujoco model="leg">
  <option gravity="0 0 -9.8"/>
  <worldbody>
    <geom name="rock" type="ellipsoid" size="1 2 3"/>
    <body name="pelvis" pos="0 0 1">
      <freejoint name="root"/>
      <geom type="sphere" size="0.1" mass="2"/>
      <body name="thigh" pos="0 0.1 0">
        <joint name="hip_x" axis="1 0 0"/>
        <joint name="hip_y" axis="0 1 0" STIFF/>
        <geom type="sphere" size="0.1" mass="1" pos="0 0 -0.2"/>
        <body name="shin" pos="0 0 -0.4">
          <joint name="knee" axis="0 1 0" ref="90"/>
          <geom type="sphere" size="0.1" mass="1" pos="0 0 -0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="knee"/></actuator>
</mujoco>"""


def test_robots_are_read_from_mjcf() -> None:
    sprung = LEG.replace("STIFF", 'stiffness="2"')
    robot = Robot.from_mjcf(sprung)
    assert (robot.name, robot.model.n_velocities, robot.repairs) == ("leg", 9, ())
    assert robot.joints == {"root": "pelvis", "hip_x": "hip_x", "hip_y": "thigh", "knee": "shin"}
    assert robot.ignored == (
        "joint `hip_y` (line 10): springs of joints are not read",
        "<actuator> (line 19): actuators are not read: joint forces are an argument (1)",
    )
    np.testing.assert_array_equal(robot.model.gravity, (0.0, 0.0, -9.8))
    np.testing.assert_allclose(robot.reference, (0, 0, 1, 0, 0, 0, 1, 0, 0, np.pi / 2), atol=1e-15)
    poses = robot.model.poses(robot.reference)
    np.testing.assert_allclose(poses[robot.model.body("shin")][:3, 3], (0.0, 0.1, 0.6), atol=1e-15)
    rock = robot.geometry[0]
    assert (rock.body, rock.shape, rock.size) == (None, "ellipsoid", (1.0, 2.0, 3.0))
    assert repr(rock) == "<Geometry: collision ellipsoid [1.0, 2.0, 3.0] of the world>"
    raises(errors.ReadError, "springs of joints are not read", lambda: Model.from_mjcf(sprung))
    plain = LEG.replace("STIFF", "")
    assert Model.from_mjcf(plain) == robot.model
    still = Model.from_mjcf(plain, gravity=(0, 0, 0))
    np.testing.assert_array_equal(still.gravity_forces(still.neutral()), 0.0)


def test_files_of_mjcf_include_those_beside_them(tmp_path: Path) -> None:
    folder = Path(__file__).parents[1] / "mjcf"
    robot = Robot.read_mjcf(folder / "humanoid.xml", gravity=(0.0, 0.0, -1.6))
    assert robot.model.mass == pytest.approx(68.0)
    assert Model.read_mjcf(folder / "humanoid.xml", gravity=(0.0, 0.0, -1.6)) == robot.model
    again = pickle.loads(pickle.dumps(robot))
    assert again.model == robot.model and again.ignored == robot.ignored and again.joints == robot.joints
    text = (folder / "humanoid.xml").read_text(encoding="utf-8")
    raises(errors.ReadError, "the text of this file is not given", lambda: Robot.from_mjcf(text))
    (tmp_path / "alone.xml").write_text(text, encoding="utf-8")
    raises(errors.ReadError, "includes `parts/", lambda: Robot.read_mjcf(tmp_path / "alone.xml"))
    with pytest.raises(FileNotFoundError, match=r"nowhere\.xml"):
        Robot.read_mjcf(tmp_path / "nowhere.xml")
    with pytest.raises(errors.ReadError, match="a file is read by `read_mjcf`"):
        Model.from_mjcf("humanoid.xml")


def test_a_joint_follows_another() -> None:
    finger = Link(
        "b", "revolute", parent="palm", axis=(0, 0, 1), mass=1.0, inertia=(1, 1, 1), mimic=("a", 2.0, 0.5)
    )
    assert finger.mimic == ("a", 2.0, 0.5)
    assert pickle.loads(pickle.dumps(finger)) == finger
    links = [
        Link("palm", "free", mass=2.0, inertia=(1, 1, 1)),
        finger,
        Link("a", "revolute", parent="palm", axis=(0, 0, 1), mass=1.0, inertia=(1, 1, 1)),
    ]
    model = Model(links)
    assert (model.n_positions, model.n_velocities) == (8, 7)
    assert model.velocities_of("b") == slice(6, 6, 1) and model.velocities_of("a") == slice(6, 7, 1)
    q, v = model.random(2), np.linspace(-1, 1, 7)
    a = model.forward_dynamics(q, v, np.zeros(7))
    np.testing.assert_allclose(model.inverse_dynamics(q, v, a), 0.0, atol=1e-12)
    raises(
        errors.InputError,
        "follows that of `c`",
        lambda: Model(
            [
                *links[:1],
                Link("d", "revolute", parent="palm", axis=(0, 0, 1), mass=1.0, mimic=("c", 1.0, 0.0)),
            ]
        ),
    )


def test_divers_have_their_tables_and_postures() -> None:
    planar, spatial = multibody.diver_planar(), multibody.diver_spatial(mass=60.0, height=1.65)
    assert (planar.model.n_velocities, spatial.model.n_velocities) == (12, 27)
    assert (len(planar.dof_names), len(spatial.dof_names)) == (12, 27)
    assert planar.model.mass == pytest.approx(65.0, rel=1e-3)
    assert spatial.model.mass == pytest.approx(60.0, rel=1e-3)
    assert (spatial.mass, spatial.height) == (60.0, 1.65)
    assert planar.postures == ("A", "B", "F", "G", "H")
    assert spatial.postures == tuple("ABCDEFGHI")
    tuck = spatial.configuration("F")
    angles = spatial.angles(tuck)
    assert tuple(angles) == spatial.dof_names[6:] and angles["right_knee"].shape == ()
    np.testing.assert_array_equal(list(angles.values()), tuck[7:])
    for link, body in (("right_knee", "right_shank"), ("left_elbow", "left_forearm")):
        assert angles[link] == tuck[spatial.model.positions_of(body)]
    both = np.stack([planar.configuration("A"), planar.configuration("H")])
    np.testing.assert_array_equal(list(planar.angles(both).values()), both[:, 3:].T)
    raises(errors.InputError, "`q` must be real numbers of shape (12,)", lambda: planar.angles(tuck))
    again = pickle.loads(pickle.dumps(spatial))
    assert again.model == spatial.model
    raises(errors.InputError, "no posture is named `Z`", lambda: planar.configuration("Z"))
    raises(errors.InputError, "posture C is not planar", lambda: planar.configuration("C"))
    raises(errors.InputError, "`mass` of `diver` must be positive", lambda: multibody.diver_planar(mass=0.0))
    for posture in planar.postures:
        # The planar diver is the spatial one of the same size, seen from the side.
        flat = planar.model.center_of_mass(planar.configuration(posture))
        same = multibody.diver_spatial()
        deep = same.model.center_of_mass(same.configuration(posture))
        if posture != "G":  # arms sideways in space, forward in the plane
            np.testing.assert_allclose(flat, deep, atol=1e-12)


def test_other_threads_run_while_a_batch_is_computed(model: Model) -> None:
    q, v, a = many(model, 50)
    q, v, a = (np.tile(x, (1000, 1)) for x in (q, v, a))
    worker = threading.Thread(target=model.hybrid_dynamics, args=(q, v, a, a, ["b1"]))
    worker.start()
    turns = 0
    while worker.is_alive():
        turns += 1
        time.sleep(0.001)
    worker.join()
    # Held, the interpreter would have let this thread run once or twice.
    assert turns > 10


SCRIPT = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in background shells
import time
import numpy as np
from somersault.multibody import Link, Model
links = [Link("b0", "free", mass=1.0, inertia=(1, 1, 1))]
for i in range(1, 40):
    links.append(Link(f"b{i}", "revolute", axis=(1, 0, 0), parent=f"b{i - 1}", mass=1.0, inertia=(1, 1, 1)))
model = Model(links)
q = np.tile(model.neutral(), (6 * 10**5, 1))
print("ready", flush=True)
try:
    model.forward_dynamics(q, np.zeros(model.n_velocities), np.zeros(model.n_velocities))
except KeyboardInterrupt:
    print(time.monotonic())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
def test_a_batch_can_be_interrupted() -> None:
    process = subprocess.Popen([sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, text=True)
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=60)[0]
    assert float(output) - sent < 2.0
