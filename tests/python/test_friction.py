"""Friction, Hertzian contact, several bodies in contact, adapted steps: closed forms and bad input."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from somersault import RigidBody, Solution, State, contact, errors, forces, integrate
from somersault.contact import (
    CompliantLaw,
    Contact,
    ContactSystem,
    CoulombFriction,
    HalfSpace,
    HuntCrossley,
    RegularisedFriction,
    Resistance,
    SpherePair,
)

G = 9.81
LAW = CompliantLaw(1e5, 1e3)


def run(scene: ContactSystem, end: float, **options: Any) -> Solution:
    given = {"forces": scene.forces, "contacts": scene.contacts, "dt": 1e-3} | options
    return integrate(scene.body, scene.state, (0.0, end), **given)


def raises(error: type[Exception], part: str, call: Callable[[], object]) -> None:
    with pytest.raises(error) as caught:
        call()
    assert part in str(caught.value)
    assert type(caught.value) is error


@pytest.mark.parametrize("options", [{}, {"dt": None, "rtol": 1e-10, "atol": 1e-12}])
def test_a_block_stops_at_the_right_place_and_time_and_stays(options: dict[str, Any]) -> None:
    mu, speed = 0.4, 2.0
    block = contact.sliding_block(1.5, (0.4, 0.3, 0.2), LAW, CoulombFriction(mu, 1e4, 200.0), speed)
    motion = run(block, 1.0, **options)
    stop = next(event for event in motion.events if event.kind == "stick")
    assert stop.contact == 0
    # The friction settles, and the block swings back, over a time c/k.
    assert stop.t == pytest.approx(speed / (mu * G), abs=0.02)
    assert stop.state.position[0] == pytest.approx(speed**2 / (2 * mu * G), abs=0.05)
    assert np.linalg.norm(motion[-1].velocity) < 1e-9
    assert motion.stretches is not None and np.linalg.norm(motion.stretches[-1]) < 1e-12
    assert pickle.loads(pickle.dumps(stop)).kind == "stick"
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(motion)).stretches, motion.stretches)


def test_a_slope_holds_a_block_up_to_the_angle_of_friction() -> None:
    friction = CoulombFriction(0.3, 1e4, 20.0)
    for tangent, speed in ((0.4, 0.1), (0.29, 0.0), (0.1, -0.2), (0.1, 0.2)):
        slope = np.arctan(tangent)
        block = contact.sliding_block(1.0, (0.4, 0.3, 0.2), LAW, friction, speed, slope)
        motion = run(block, 3.0)
        along = G * (np.sin(slope) - 0.3 * np.cos(slope))
        if along > 0:
            assert motion.velocity[-1, 0] == pytest.approx(speed + 3.0 * along, rel=1e-2)
        else:
            assert np.ptp(motion.position[-500:, 0]) < 1e-9


def test_a_block_that_starts_loaded_stays_and_a_run_goes_on_with_its_stretches() -> None:
    friction = CoulombFriction(0.3, 1e4, 20.0)
    slope = np.arctan(0.2)
    block = contact.sliding_block(1.0, (0.4, 0.3, 0.2), LAW, friction, 0.0, slope)
    motion = run(block, 1.0, stretches="loaded")
    assert motion.events == ()
    assert np.ptp(motion.position[:, 0]) < 1e-12
    assert motion.stretches is not None
    np.testing.assert_allclose(
        motion.stretches, [[[G * np.sin(slope) / 1e4, 0.0, 0.0]]] * len(motion), atol=1e-12
    )
    assert motion.contact_forces is not None and motion.elastic_energy is not None
    held = motion.contact_forces.sum(axis=1)
    load = G * np.array([-np.sin(slope), 0.0, np.cos(slope)])
    np.testing.assert_allclose(held, [load] * len(motion), atol=1e-9)
    assert pickle.loads(pickle.dumps(motion)).elastic_energy == pytest.approx(motion.elastic_energy)
    again = run(block, 1.0, stretches=motion.stretches[-1])
    np.testing.assert_allclose(again.position[-1], motion.position[-1], atol=1e-12)
    raises(errors.InputError, "`stretches`", lambda: run(block, 1.0, stretches=[0.0]))
    raises(
        errors.InputError,
        "`stretches` are those of contacts",
        lambda: run(block, 1.0, stretches="loaded", contacts=None),
    )
    raises(errors.InputError, "`locate` must be true", lambda: run(block, 1.0, locate=False))


@pytest.mark.parametrize("friction", [CoulombFriction(0.3, 0.0, 1e4), RegularisedFriction(0.3, 1e-4)])
def test_a_ball_that_slides_comes_to_roll_with_five_sevenths_of_its_speed(friction: Any) -> None:
    ball = RigidBody.sphere(0.7, 0.1)
    sag = 0.7 * G / 1e5
    start = State((0, 0, 0.1 - sag), velocity=(1.0, 0, 0))
    touching = Contact.ball((0, 0, 0), 0.1, HalfSpace(), LAW, friction=friction)
    motion = integrate(ball, start, (0, 1.0), dt=1e-4, every=100, forces=forces.Gravity(), contacts=touching)
    assert motion[-1].velocity[0] == pytest.approx(5 / 7, abs=2e-4)
    # It rolls on the radius less the sag.
    assert motion[-1].angular_velocity[1] == pytest.approx(5 / 7 / 0.1, abs=3e-3)
    assert touching.gap(start)[0] == pytest.approx(-sag)
    kinds = {event.kind for event in motion.events}
    assert ("stick" in kinds) == isinstance(friction, CoulombFriction)


def test_rolling_resistance_slows_a_rolling_ball() -> None:
    ball = RigidBody.sphere(0.7, 0.1)
    start = State((0, 0, 0.1 - 0.7 * G / 1e5), velocity=(1.0, 0, 0), angular_velocity=(0, 10.0, 0))
    rough, b = CoulombFriction(0.5, 0.0, 1e4), 1e-3
    plain = Contact.ball((0, 0, 0), 0.1, HalfSpace(), LAW, friction=rough)
    slowed = Contact.ball(
        (0, 0, 0), 0.1, HalfSpace(), LAW, friction=rough, resistance=Resistance(b, 0.0, 1e-3)
    )
    ends = [
        integrate(ball, start, (0, 1.0), dt=1e-4, every=10**6, forces=forces.Gravity(), contacts=c)[-1]
        for c in (plain, slowed)
    ]
    # m v' = −F, ⅖ m r² ω' = F r − b m g.
    assert ends[0].velocity[0] - ends[1].velocity[0] == pytest.approx(5 / 7 * b / 0.1 * G, rel=5e-3)


def test_a_steady_disk_goes_round() -> None:
    tilt, turning = 1.2, 2.5
    disk = contact.rolling_disk(
        1.0, 0.2, CompliantLaw(1e5, 300.0), CoulombFriction(0.8, 0.0, 2000.0), tilt, turning
    )
    motion = run(disk, 0.5, dt=1e-4, every=100)
    axis = motion.orientation.apply((0, 0, 1))
    np.testing.assert_allclose(np.arccos(axis[:, 2]), tilt, atol=0.02)
    angle = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    assert angle[-1] - angle[0] == pytest.approx(turning * 0.5, abs=0.03)
    assert disk.contacts[0].law == CompliantLaw(1e5, 300.0)


def test_a_tippe_top_turns_over() -> None:
    # With 1 − α < A/C < 1 + α and Jellett's quantity above the threshold of Cohen (1977).
    mass, radius, alpha = 0.02, 0.02, 0.3
    inertia = mass * radius**2
    law = CompliantLaw.from_frequency(mass, 1500.0, 0.5)
    friction = RegularisedFriction(0.3, 0.02)
    moments = (131 / 350 * inertia, 0.4 * inertia)
    top = contact.tippe_top(mass, radius, alpha, moments, law, 0.1, 180.0, G / 1500.0**2, friction=friction)
    motion = run(top, 6.0, dt=2e-4, every=1000)
    upright = motion.orientation.apply((0, 0, 1))[:, 2]
    assert upright[0] > 0.99
    assert upright[-1] < -0.99
    # The centre of mass has risen.
    assert motion.position[-1, 2] > motion.position[0, 2] + 1.9 * alpha * radius


def test_the_impact_of_hunt_and_crossley_restores_what_was_asked() -> None:
    for asked in (1.0, 0.8, 0.3):
        law = HuntCrossley.from_restitution(1e6, asked, 2.0)
        assert law.restitution(2.0) == pytest.approx(asked, rel=1e-12)
        ball = RigidBody.sphere(0.3, 0.05)
        start = State((0, 0, 0.01), velocity=(0, 0, -2.0))
        touching = Contact((0, 0, 0), HalfSpace(), law)
        end = integrate(ball, start, (0, 0.05), dt=1e-5, every=10**6, contacts=touching)[-1]
        assert end.velocity[2] / 2.0 == pytest.approx(asked, rel=1e-6)
    steel = HuntCrossley.from_materials((2.1e11, 2.1e11), (0.3, 0.3), 0.01)
    # k = ⁴⁄₃ E* √R with 1/E* = 2 (1 − ν²)/E.
    assert steel.stiffness == pytest.approx(4 / 3 * 2.1e11 / (2 * 0.91) * 0.1)
    assert steel.force(-1e-4, 0.0) == pytest.approx(steel.stiffness * 1e-6)
    assert steel.energy(-1e-4) == pytest.approx(0.4 * steel.stiffness * 1e-10)
    assert pickle.loads(pickle.dumps(steel)) == steel


def test_two_spheres_of_equal_mass_exchange_their_velocities() -> None:
    balls = [RigidBody.sphere(0.2, 0.03)] * 2
    starts = [State((0, 0, 0), velocity=(1.0, 0, 0)), State((0.1, 0, 0))]
    pair = SpherePair((0, 1), (0.03, 0.03), CompliantLaw(1e5))
    motion = integrate(balls, starts, (0, 0.2), dt=2e-4, method="rkmk8", pairs=pair, dense_output=True)
    np.testing.assert_allclose(motion.velocity[-1], [(0, 0, 0), (1, 0, 0)], atol=1e-9)
    energy = motion.kinetic_energy.sum(axis=1) + motion.elastic_energy
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    assert motion.elastic_energy is not None and motion.elastic_energy.max() > 0.2 * energy[0]
    assert [(event.contact, event.kind) for event in motion.events] == [(0, "touch_down"), (0, "release")]
    # Central impact: half a period of the reduced mass on the spring.
    first, last = motion.events
    assert first.t == pytest.approx(0.04, abs=1e-12)
    assert last.t - first.t == pytest.approx(np.pi * np.sqrt(0.1 / 1e5), rel=1e-9)
    assert last.impulse == pytest.approx(0.2, rel=1e-4)
    assert [type(state) for state in first.state] == [State, State]
    again = pickle.loads(pickle.dumps(motion))
    assert again.events[1].state == last.state
    assert motion.nfev > 0 and motion.sol is not None


def test_several_bodies_touch_surfaces_and_each_other() -> None:
    balls = [RigidBody.sphere(0.2, 0.05), RigidBody.sphere(0.1, 0.05)]
    starts = [State((0, 0, 0.05)), State((0, 0, 0.2))]
    law = CompliantLaw(1e4, 5.0)
    ground = Contact.ball((0, 0, 0), 0.05, HalfSpace(), law)
    weight = forces.Gravity()
    stacked = {
        "contacts": [ground, [ground]],
        "pairs": [SpherePair((1, 0), (0.05, 0.05), law, friction=CoulombFriction(0.3, 0.0, 10.0))],
        "forces": weight,
    }
    motion = integrate(balls, starts, (0, 3.0), dt=1e-3, every=100, **stacked)  # type: ignore[arg-type]
    lower, upper = motion[-1]
    assert lower.position[2] == pytest.approx(0.05 - 0.3 * G / 1e4, abs=1e-6)
    assert upper.position[2] - lower.position[2] == pytest.approx(0.1 - 0.1 * G / 1e4, abs=1e-6)
    # Contacts with surfaces are counted first: 0 and 1, then the pair, on whose first body the force is.
    assert motion.contact_forces is not None
    np.testing.assert_allclose(motion.contact_forces[-1, :, 2], [0.3 * G, 0.0, 0.1 * G], atol=1e-6)
    assert {event.contact for event in motion.events} <= {0, 2}
    unlocated = integrate(balls, starts, (0, 3.0), dt=1e-4, every=10**6, locate=False, **stacked)  # type: ignore[arg-type]
    np.testing.assert_allclose(unlocated.position[-1], motion.position[-1], atol=1e-6)
    assert unlocated.events == ()
    assert unlocated.contact_forces is None


def test_a_corner_dropped_box_comes_to_rest() -> None:
    law = CompliantLaw(2e4, 40.0)
    box = contact.falling_box(1.0, (0.1, 0.15, 0.2), law, 0.05, 0.4, friction=CoulombFriction(0.5, 1e4, 40.0))
    assert len(box.contacts) == 8
    # Dropped upright on its corner it would balance there.
    tilted = State(box.state.position, Rotation.from_rotvec((0.1, 0.05, 0.0)) * box.state.orientation)
    motion = integrate(
        box.body, tilted, (0, 4.0), dt=2e-4, every=1000, forces=box.forces, contacts=box.contacts
    )
    assert {"touch_down", "release", "stick", "slip"} <= {event.kind for event in motion.events}
    assert motion.kinetic_energy[-1] < 1e-6
    assert motion[-1].position[2] < 0.11


def test_adapted_steps_locate_events_too() -> None:
    top = contact.spinning_top()
    fine = run(top, 0.5, dt=2e-5, method="rkmk8", every=10**9)
    adapted = run(top, 0.5, dt=None, rtol=1e-10, atol=1e-12)
    angle = (adapted[-1].orientation.inv() * fine[-1].orientation).magnitude()
    assert angle < 1e-6
    assert [event.kind for event in adapted.events] == [event.kind for event in fine.events]
    np.testing.assert_allclose(
        [event.t for event in adapted.events], [event.t for event in fine.events], atol=1e-8
    )
    assert adapted.n_rejected > 0
    raises(errors.InputError, "`ab4` has no error estimate", lambda: run(top, 0.5, dt=None, method="ab4"))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: HuntCrossley(-1.0), errors.InputError, "`stiffness` must be positive"),
        (lambda: HuntCrossley.from_materials((1, 1), (0.3, 0.7), 1), errors.InputError, "`poisson_ratio`"),
        (
            lambda: CoulombFriction(-0.1, 1.0, 1.0),
            errors.InputError,
            "`coefficient` must be finite and not",
        ),
        (lambda: CoulombFriction(0.1, -1.0, 1.0), errors.InputError, "`stiffness` must be finite and not"),
        (lambda: CoulombFriction(0.3, 1.0, 1.0, 0.2), errors.InputError, "`static_coefficient` must be"),
        (lambda: CoulombFriction(0.1, 0.0, 0.0), errors.InputError, "`damping` must be positive"),
        (lambda: RegularisedFriction(0.1, 0.0), errors.InputError, "`speed` must be positive"),
        (
            lambda: Resistance(-1.0, 0.0, 1.0),
            errors.InputError,
            "`rolling` must be finite and not negative",
        ),
        (
            lambda: Contact((0, 0, 0), HalfSpace(), LAW, friction=LAW),  # type: ignore[arg-type]
            errors.InputError,
            "`friction` must be a CoulombFriction or a RegularisedFriction, found a CompliantLaw",
        ),
        (
            lambda: Contact((0, 0, 0), HalfSpace(), LAW, resistance=3),  # type: ignore[arg-type]
            errors.InputError,
            "`resistance` must be a Resistance, found an int",
        ),
        (
            lambda: Contact.rim((0, 0, 0), (0, 0, 1), 1.0, lambda p: (0, p), LAW),  # type: ignore[arg-type]
            errors.InputError,
            "`plane` must be a HalfSpace",
        ),
        (lambda: SpherePair((1, 1), (1, 1), LAW), errors.InputError, "found body 1 twice"),
        (lambda: SpherePair((0, 1), (1, -1), LAW), errors.InputError, "`radius` must be positive"),
        (
            lambda: contact.tippe_top(1, 1, 1.5, (1, 1), LAW, 0, 1),
            errors.InputError,
            "`eccentricity` must lie between 0 and 1",
        ),
    ],
)
def test_bad_laws_and_contacts_are_refused(
    call: Callable[[], object], error: type[Exception], message: str
) -> None:
    raises(error, message, call)


def test_a_pair_has_the_parts_that_it_is_made_of() -> None:
    friction = CoulombFriction(0.3, 0.0, 10.0)
    pair = SpherePair((2, 0), (0.1, 0.2), LAW, centers=[(0, 0, 1), (0, 1, 0)], friction=friction)
    assert (pair.bodies, pair.radii) == ((2, 0), (0.1, 0.2))
    np.testing.assert_array_equal(pair.centers, [(0, 0, 1), (0, 1, 0)])
    assert (pair.law, pair.friction, pair.resistance) == (LAW, friction, None)


def test_bad_arguments_of_a_run_are_refused(body: RigidBody, state: State) -> None:
    touching = Contact((0, 0, 0), HalfSpace(), LAW)
    pair = SpherePair((0, 2), (1, 1), LAW)

    def both(**options: Any) -> None:
        integrate([body, body], [state, state], (0, 1), dt=0.1, **options)

    raises(
        errors.InputError, "an entry for each of 2 bodies, found 1 entries", lambda: both(contacts=[touching])
    )
    raises(
        errors.InputError, "an entry for each of 2 bodies, found a Contact", lambda: both(contacts=touching)
    )
    raises(errors.InputError, "`pairs` must hold sphere pairs, found an int", lambda: both(pairs=[1]))
    raises(
        errors.InputError,
        "`pairs` must be below the number of bodies, 2, found 2",
        lambda: both(pairs=pair),
    )
    raises(
        errors.InputError,
        "`interaction` cannot be given together",
        lambda: both(pairs=SpherePair((0, 1), (1, 1), LAW), interaction=forces.Gravitation()),
    )
    raises(
        errors.InputError,
        "`pairs` touch between several bodies",
        lambda: integrate(body, state, (0, 1), dt=0.1, pairs=pair),
    )
