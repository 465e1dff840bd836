"""Trees that touch: references, the same motions as of bodies, energies, dense output, bad input."""

import pickle
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

import somersault
from somersault import contact, errors, multibody, viewer

Array = NDArray[np.float64]
FLOOR = contact.HalfSpace()
LAW = contact.CompliantLaw(5e3, 20.0)
GRIP = contact.CoulombFriction(0.4, 4e3, 30.0)


@cache
def hop(**options: Any) -> multibody.TreeSolution:
    leg = contact.hopping_leg()
    steps = {"rtol": 1e-11, "atol": 1e-13} | options
    return multibody.integrate_tree(
        leg.model, leg.q, leg.v, (0.0, 0.6), torque=leg.torque, contacts=leg.contacts, **steps
    )


def test_a_leg_hops_as_the_reference_does() -> None:
    # in minimal coordinates, by another program, with DOP853 and located events at 1e-13
    motion = hop()
    assert motion.success and motion.n_events == len(motion.events) == 16
    stances = [event.kind for event in motion.events if event.kind in ("touch_down", "release")]
    assert stances == ["touch_down", "release"] * 3
    angles = np.cumsum(motion.q[-1, 2:])
    assert motion.q[-1, :2] == pytest.approx([0.4375132884, 0.4852733922], abs=1e-8)
    assert angles == pytest.approx([-1.4596027138, 0.5776539853, -0.7019944517], abs=1e-8)


def test_derivatives_of_a_hop_are_differences_of_hops() -> None:
    leg = contact.hopping_leg()
    given: dict[str, Any] = {"dt": 5e-4, "method": "rkmk8", "contacts": leg.contacts}
    by = [("friction.coefficient", "foot"), ("torque", 4)]
    found = contact.differentiate_tree(
        leg.model, leg.q, leg.v, (0.0, 0.2), torque=leg.torque, parameters=by, **given
    )
    assert [event.kind for event in found.events] == ["touch_down", "stick", "slip", "release"]
    assert found.event_times.shape == (4, 12) and found.by_parameters.shape == (10, 2)

    def end(k: int, by: float) -> Array:
        q, v, knee = np.array(leg.q), np.array(leg.v), np.zeros(5)
        if k < 5:
            q = leg.model.displace(q, by * np.eye(5)[k])
        elif k < 10:
            v[k - 5] += by
        else:
            knee[4] = by
        motion = multibody.integrate_tree(
            leg.model, q, v, (0.0, 0.2), torque=lambda t, q, v: leg.torque(t, q, v) + knee, **given
        )
        return np.concatenate([motion.q[-1], motion.v[-1]])

    def motions(change: Array) -> Array:
        # Velocities along the axes of the body, as `displace` has them, from places in the world.
        s, c = np.sin(found.q[2]), np.cos(found.q[2])
        return np.concatenate([np.array([[c, s], [-s, c]]) @ change[:2], change[2:]])

    for k, column in ((1, found.by_state[:, 1]), (7, found.by_state[:, 7]), (10, found.by_parameters[:, 1])):
        difference = motions(end(k, 1e-6) - end(k, -1e-6)) / 2e-6
        assert column == pytest.approx(difference, rel=1e-5, abs=1e-5)
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.by_state, found.by_state)
    with pytest.raises(somersault.InputError, match="`parameters` must hold"):
        contact.differentiate_tree(leg.model, leg.q, leg.v, (0.0, 0.1), parameters=["mass"], **given)  # type: ignore[list-item]
    with pytest.raises(somersault.InputError, match="a degree of freedom below 5, found the force of 5"):
        contact.differentiate_tree(leg.model, leg.q, leg.v, (0.0, 0.1), parameters=[("torque", 5)], **given)


def test_trees_by_name_come_with_what_drives_them() -> None:
    for make in (
        contact.hopping_leg,
        contact.planar_biped,
        contact.quadruped,
        contact.ragdoll,
        contact.springboard,
    ):
        scene = make()
        again = pickle.loads(pickle.dumps(scene))
        assert repr(again) == repr(scene) and len(scene.q) == scene.model.n_positions
        np.testing.assert_array_equal(
            again.torque(0.2, again.q, again.v), scene.torque(0.2, scene.q, scene.v)
        )
    with pytest.raises(somersault.InputError, match="`t` must be finite, found NaN"):
        scene.torque(np.nan, scene.q, scene.v)
    with pytest.raises(
        somersault.InputError, match=r"`q` must be real numbers of shape \(6,\), found shape \(1,\)"
    ):
        scene.torque(0.0, [0.0], scene.v)


def test_what_contacts_do_is_consistent() -> None:
    motion, leg = hop(), contact.hopping_leg()
    forces, gaps = motion.contact_forces, motion.gaps
    assert forces is not None and gaps is not None and motion.stretches is not None
    assert forces.shape == motion.stretches.shape == (len(motion), 1, 3) and gaps.shape == (len(motion), 1)
    assert np.all(forces[gaps > 0.0] == 0.0) and forces[..., 2].min() >= 0.0
    assert np.all(np.abs(forces[..., 0]) <= 0.5 * forces[..., 2] * (1 + 1e-12))
    feet = contact.TreeContacts(leg.model, leg.contacts)
    for k in range(0, len(motion), 40):
        q, v, stretches = motion.q[k], motion.v[k], motion.stretches[k]
        assert feet.forces(q, v, stretches) == pytest.approx(forces[k], abs=1e-9)
        velocity = feet.jacobian(q, "foot") @ v
        assert velocity[2] == pytest.approx(feet.gaps(q, v)[1][0], abs=1e-12)
    # the impulse of a stance is the integral of the force, by dense output of the same motion
    curves = hop(dense_output=True).sol
    down, up = (event for event in motion.events if event.kind in ("touch_down", "release") if event.t < 0.2)
    assert curves is not None

    def push(t: float) -> float:
        gap, rate = feet.gaps(*curves(t))
        return max(0.0, -2e4 * gap[0] - 150.0 * rate[0])

    assert quad(push, down.t, up.t, limit=200)[0] == pytest.approx(up.impulse, rel=1e-5)


def test_fixed_steps_of_order_4_and_8_agree() -> None:
    ends = [hop(rtol=None, atol=None, dt=1e-4, method=method).q[-1] for method in ("rkmk", "rkmk8")]
    assert np.abs(ends[0] - ends[1]).max() < 1e-5
    assert ends[1] == pytest.approx(hop().q[-1], abs=1e-9)


def test_light_feet_take_steps_of_the_motion() -> None:
    sliding: dict[str, Any] = {"joint": "prismatic"}
    foot = {"parent": "body", "axis": (0, 0, -1), "mass": 1e-3, "origin": (0, 0, -0.5), "damping": 100.0}
    links = [
        multibody.Link("body", axis=(0, 0, 1), mass=60.0, **sliding),
        multibody.Link("foot", **foot, **sliding),
    ]
    model = multibody.Model(links)
    law = contact.CompliantLaw(1e5, 60.0)
    sole = contact.LinkContact("sole", "foot", contact.Contact((0, 0, 0), FLOOR, law))
    pressed = ([0.499, 0.0], [0.0, 0.0])
    feet = contact.TreeContacts(model, sole)
    # c/m of a foot that moves alone, and nothing in the air
    assert feet.stiffest_rate(*pressed) == pytest.approx(60.0 / 1e-3, rel=1e-9)
    assert feet.stiffest_rate([0.501, 0.0], [0.0, 0.0]) == 0.0
    with pytest.raises(errors.InputError, match="`v` must be real numbers of shape"):
        feet.stiffest_rate([0.499, 0.0], [0.0])

    def jump(**steps: Any) -> multibody.TreeSolution:
        return multibody.integrate_tree(
            model,
            [0.55, 0.0],
            [0.3, 0.0],
            (0.0, 0.4),
            method="radau5",
            torque=lambda t, q, v: [0.0, -2e4 * q[1]],
            contacts=sole,
            dense_output=True,
            **steps,
        )

    adapted, fixed = jump(rtol=1e-8, atol=1e-8), jump(dt=4e-3)
    assert [event.kind for event in adapted.events] == ["touch_down", "release"]
    assert adapted.n_steps < 600 and 0 < fixed.n_substeps < 40 < fixed.n_steps < 150
    np.testing.assert_allclose(adapted.q[-1], fixed.q[-1], atol=1e-7)
    np.testing.assert_allclose([e.t for e in adapted.events], [e.t for e in fixed.events], atol=1e-8)
    # between steps: the polynomial of the step, which meets its ends
    middle = 0.5 * (fixed.t[1:] + fixed.t[:-1])
    curves = [motion.sol for motion in (adapted, fixed)]
    assert curves[0] is not None and curves[1] is not None
    assert np.abs(curves[0](middle)[0] - curves[1](middle)[0]).max() < 1e-5


def test_a_tree_of_one_body_is_that_body() -> None:
    box = somersault.RigidBody.box(1.0, (0.2, 0.3, 0.1))
    corners = [(x, y, -0.05) for x in (-0.1, 0.1) for y in (-0.15, 0.15)]
    touches = [contact.Contact(corner, FLOOR, LAW, friction=GRIP) for corner in corners]
    start = somersault.State((0, 0, 0.3), velocity=(0.7, 0, -1), angular_velocity=(1.0, 2.0, 0.5))
    body = somersault.integrate(
        box,
        start,
        (0.0, 0.5),
        dt=1e-3,
        method="rkmk8_b",
        forces=somersault.forces.Gravity(),
        contacts=touches,
        max_substeps=None,
    )
    tree = multibody.Model([multibody.Link("box", "free", body=box)])
    named = [contact.LinkContact(f"corner {k}", "box", touch) for k, touch in enumerate(touches)]
    rates = np.concatenate([start.velocity, start.angular_velocity])
    found = multibody.integrate_tree(
        tree,
        np.array([0, 0, 0.3, 0, 0, 0, 1.0]),
        rates,
        (0.0, 0.5),
        dt=1e-3,
        method="rkmk8",
        contacts=named,
        max_substeps=None,
    )
    assert [(e.kind, named[e.contact].name) for e in body.events] == [
        (e.kind, e.contact) for e in found.events
    ]
    assert found.n_events > 5
    assert found.q[-1, :3] == pytest.approx(body.position[-1], abs=1e-10)
    at = ~np.isin(body.t, [event.t for event in body.events])
    assert body.t == pytest.approx(found.t, abs=1e-12)
    for name in ("stretches", "contact_points", "gaps", "contact_forces", "elastic_energy"):
        ours, theirs = getattr(body, name), getattr(found, name)
        assert ours.shape == theirs.shape
        assert np.abs(theirs[at] - ours[at]).max() < (1e-10 if name in ("stretches", "gaps") else 1e-5), name
    assert body.contact_forces is not None and body.contact_forces[at].max() > 1.0


def test_energy_is_dissipated_and_never_created() -> None:
    rod = somersault.RigidBody.box(0.5, (0.05, 0.05, 0.4))
    down = np.array([0.0, 0.0, -0.4])
    chain = multibody.Model(
        [
            multibody.Link("upper", "free", body=rod, center=down / 2),
            multibody.Link("lower", "spherical", parent="upper", origin=down, body=rod, center=down / 2),
        ]
    )
    ball = contact.Contact.ball(down, 0.02, FLOOR, LAW, friction=GRIP)
    touches = [contact.LinkContact(link, link, ball) for link in chain.names]
    touches.append(contact.LinkContact("top", "upper", contact.Contact((0, 0, 0), FLOOR, LAW)))
    clap = contact.LinkPair("clap", ("upper", "lower"), (0.03, 0.03), LAW, centers=((0, 0, 0), down))
    q = chain.neutral()
    q[2:6] = 0.7, 0.3, 0.2, 0.1
    v = np.array([0.3, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, -3.0, 0.0])
    motion = multibody.integrate_tree(chain, chain.normalize(q), v, (0.0, 1.0), contacts=[*touches, clap])
    elastic = motion.elastic_energy
    assert elastic is not None and motion.n_events > 4
    energy = chain.kinetic_energy(motion.q, motion.v) + chain.potential_energy(motion.q) + elastic
    assert np.diff(energy).max() < 1e-7 * energy[0]
    assert energy[-1] < 0.9 * energy[0]
    assert [c.name for c in motion.contacts] == ["upper", "lower", "top", "clap"]


def test_a_pose_at_rest_stays() -> None:
    leg = contact.hopping_leg()
    feet = contact.TreeContacts(leg.model, leg.contacts)
    q, stretches, success = feet.equilibrium((0.0, 0.649, 0.0, 0.0, 0.0))
    assert success
    assert feet.forces(q, np.zeros(5), stretches)[0] == pytest.approx([0.0, 0.0, 6.5 * 9.81], abs=1e-8)
    still = multibody.integrate_tree(
        leg.model, q, np.zeros(5), (0.0, 0.01), dt=1e-3, contacts=leg.contacts, stretches=stretches
    )
    assert still.n_events == 0 and np.abs(still.q[-1] - q).max() < 1e-12
    _, _, success = feet.equilibrium((0.0, 1.0, 0.0, 0.0, 0.0))
    assert not success


def test_equilibria_are_found_and_hold_where_friction_can() -> None:
    random = np.random.default_rng(3)
    for _ in range(16):
        tilt, coefficient = random.uniform(0, 0.5), random.uniform(0.2, 0.8)
        slope = contact.HalfSpace((0, 0, 0), (np.sin(tilt), 0, np.cos(tilt)))
        law, grip = contact.CompliantLaw(2e4, 60.0), contact.CoulombFriction(coefficient, 1.5e4, 60.0)
        links = [multibody.Link("seat", "free", mass=3, center=(0, 0, 0.1), inertia=[0.1] * 3)]
        feet = []
        for i, place in enumerate([(0.2, 0.1, 0), (0.2, -0.1, 0), (-0.2, 0, 0)]):
            hinge: Any = {"parent": "seat", "axis": (0, 1, 0), "origin": place, "damping": 0.5}
            links.append(
                multibody.Link(
                    f"leg {i}", "revolute", mass=0.3, center=(0, 0, -0.1), inertia=[2e-3] * 3, **hinge
                )
            )
            foot = contact.Contact.ball((0, 0, -0.2), 0.02, slope, law, friction=grip)
            feet.append(contact.LinkContact(f"foot {i}", f"leg {i}", foot))
        stool, angles = multibody.Model(links), random.uniform(-0.3, 0.3, 3)

        def springs(t: float, q: Array, v: Array, angles: Array = angles) -> Array:
            return np.concatenate([np.zeros(6), 300 * (angles - q[7:])])

        guess = np.concatenate([[0, 0, 0.22, 0, np.sin(tilt / 2), 0, np.cos(tilt / 2)], angles])
        q, stretches, success = contact.TreeContacts(stool, feet).equilibrium(guess, springs)
        load = np.tan(tilt) / coefficient
        assert success or load > 0.75, load
        assert not success or load < 1.0
        if success:
            options: Any = {
                "torque": springs,
                "contacts": feet,
                "stretches": stretches,
                "rtol": 1e-9,
                "atol": 1e-12,
            }
            still = multibody.integrate_tree(stool, q, np.zeros(9), (0, 0.2), **options)
            assert np.abs(still.q - q).max() < 1e-9


def test_a_surface_may_be_a_function_and_what_it_raises_comes_out() -> None:
    leg = contact.hopping_leg()
    arm = leg.contacts[0].contact

    def level(point: Array) -> tuple[float, Array]:
        return float(point[2]), np.array([0.0, 0.0, 1.0])

    def broken(point: Array) -> tuple[float, Array]:
        raise RuntimeError("no ground here")

    def foot(surface: Any) -> contact.LinkContact:
        friction = arm.friction
        return contact.LinkContact(
            "foot", "shank", contact.Contact(arm.point, surface, arm.law, friction=friction)
        )

    def run(surface: Any) -> multibody.TreeSolution:
        start = (leg.model, leg.q, leg.v, (0.0, 0.1))
        return multibody.integrate_tree(*start, torque=leg.torque, contacts=foot(surface), dt=1e-3)

    assert [event.kind for event in run(level).events] == [event.kind for event in run(FLOOR).events]
    with pytest.raises(RuntimeError, match="no ground here"):
        run(broken)


def test_solutions_are_pickled_and_drawn() -> None:
    motion = hop()
    again = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(again.contact_forces, motion.contact_forces)
    assert [event.kind for event in again.events] == [event.kind for event in motion.events]
    assert again.n_trials == motion.n_trials and again.contacts[0].name == "foot"
    plain = multibody.integrate_tree(multibody.cart_pendulum(), [0, 0.1], [0, 0], (0.0, 0.1), dt=0.01)
    assert plain.contact_forces is None and plain.events == [] and plain.contacts == []
    scene = viewer.Scene("A leg").add(motion).play(0.1, arrows=("contact_force",))
    assert '"ground": 0' in scene.html() or re.search(r'"ground":\s*0', scene.html())


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"contacts": 3}, "`contacts` must hold objects of LinkContact and LinkPair, found an int"),
        ({"stretches": "loaded"}, "`stretches` are those of contacts, and there are none"),
        (
            {"contacts": "leg", "stretches": np.zeros((2, 3))},
            "`stretches` must be real numbers of shape (1, 3)",
        ),
        ({"contacts": "leg", "max_substeps": 0}, "`max_substeps` must be positive or None, found 0"),
        ({"contacts": "leg", "graze": -1.0}, "`graze` must be positive"),
        ({"contacts": "twice"}, "contacts must have different names, found `foot` twice"),
        ({"contacts": "nobody"}, "`link` must be the name of a body of the model, found `nobody`"),
    ],
)
def test_what_is_not_allowed_is_named(options: dict[str, Any], part: str) -> None:
    leg = contact.hopping_leg()
    foot = leg.contacts[0]
    of = {
        "leg": leg.contacts,
        "twice": [foot, foot],
        "nobody": contact.LinkContact("foot", "nobody", foot.contact),
    }
    given = {key: of.get(value, value) if isinstance(value, str) else value for key, value in options.items()}
    with pytest.raises(errors.InputError) as caught:
        multibody.integrate_tree(leg.model, leg.q, leg.v, (0.0, 0.1), dt=1e-3, **given)
    assert part in str(caught.value)


def test_names_of_contacts_are_checked() -> None:
    leg = contact.hopping_leg()
    feet = contact.TreeContacts(leg.model, leg.contacts)
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: feet.jacobian(leg.q, "toe"), "`contact` must name one of the contacts foot, found 'toe'"),
        (lambda: feet.forces(leg.q[:4], leg.v), "`q` must be real numbers of shape (5,)"),
        (
            lambda: contact.LinkPair("pair", ("body", "body"), (0.1, 0.1), LAW),
            "a contact between links must be of two of them, found `body` twice",
        ),
        (lambda: contact.LinkPair("pair", ("a", "b"), (0.1, -0.1), LAW), "`radius` must be positive"),
    ]
    for call, part in wrong:
        with pytest.raises(errors.InputError) as caught:
            call()
        assert part in str(caught.value)


def test_a_run_that_fails_keeps_what_it_has() -> None:
    leg = contact.hopping_leg()
    with pytest.raises(errors.IntegrationError, match="too long") as caught:
        multibody.integrate_tree(
            leg.model, leg.q, leg.v, (0.0, 0.6), dt=0.02, contacts=leg.contacts, max_substeps=1
        )
    solution = caught.value.solution
    assert solution.events[0].kind == "touch_down" and solution.status == -2


def test_a_box_on_a_platform_rides_with_it() -> None:
    box = somersault.RigidBody.box(1.0, (0.2, 0.2, 0.1))
    stand = multibody.Link("stand", "fixed", mass=1.0, inertia=(1, 1, 1))
    platform = multibody.Link(
        "platform", "prismatic", parent="stand", axis=(0, 0, 1), mass=1.0, inertia=(1, 1, 1)
    )
    tree = multibody.Model([stand, platform, multibody.Link("box", "free", parent="stand", body=box)])
    law = contact.CompliantLaw(2e4, 200.0)
    corners = [(x, y, -0.05) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    touches = [
        contact.LinkContact(f"corner {k}", "box", contact.Contact(corner, FLOOR, law), on="platform")
        for k, corner in enumerate(corners)
    ]
    sag = 9.81 / (4 * 2e4)
    q, v = np.array([0, 0, 0, 0.05 - sag, 0, 0, 0, 1.0]), np.zeros(7)
    # the platform goes up and down by 2 cm, and the box with it but for what its weight and inertia press
    rate, height = 6.0, 0.02

    def acceleration(t: float, q: Array, v: Array) -> Array:
        return height * rate**2 * np.cos(rate * t) * np.eye(7)[0]

    motion = multibody.integrate_tree(
        tree, q, v, (0.0, 1.0), active=["platform"], acceleration=acceleration, contacts=touches, rtol=1e-9
    )
    assert motion.n_events == 0
    assert motion.q[:, 0] == pytest.approx(height * (1 - np.cos(rate * motion.t)), abs=1e-7)
    assert np.ptp(motion.q[:, 3] - motion.q[:, 0]) < 2 * height * rate**2 / (4 * 2e4) * 1.5
    assert [c.on for c in pickle.loads(pickle.dumps(motion)).contacts] == ["platform"] * 4


def test_a_mass_on_a_table_follows_the_closed_form() -> None:
    mass, stiffness, height, rate = 2.0, 2e3, 1e-3, 20.0
    up = np.array([0.0, 0.0, height])

    def shake(t: float) -> tuple[Array, Array, Array]:
        s, c = np.sin(rate * t), np.cos(rate * t)
        return up * s, up * rate * c, -up * rate**2 * s

    table = contact.Platform("table", shake)
    tree = multibody.Model([multibody.Link("mass", "prismatic", axis=(0, 0, 1), mass=mass)])
    scene = contact.TreeOnPlatforms(tree, [table])
    assert scene.model.names == ["stand of platforms", "mass", "table"] and sum(scene.active) == 6
    sag = mass * 9.81 / stiffness
    q, v = scene.start([-sag], [0.0])
    touch = contact.Contact((0, 0, 0), FLOOR, contact.CompliantLaw(stiffness))
    motion = multibody.integrate_tree(
        scene.model, q, v, (0.0, 1.0), active=scene.active, acceleration=scene.acceleration,
        contacts=contact.LinkContact("foot", "mass", touch, on="table"), rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    own = np.sqrt(stiffness / mass)
    swing = (
        height * own / (own**2 - rate**2) * (own * np.sin(rate * motion.t) - rate * np.sin(own * motion.t))
    )
    assert motion.n_events == 0 and motion.q[:, 0] + sag == pytest.approx(swing, abs=1e-9)
    assert motion.q[:, 3] == pytest.approx(height * np.sin(rate * motion.t), abs=1e-10)


def test_platforms_that_are_wrong_are_refused() -> None:
    zero = np.zeros(3)
    tree = multibody.cart_pendulum()

    def refused(motion: Any, message: str, **options: Any) -> None:
        with pytest.raises(errors.InputError, match=message):
            contact.Platform("table", motion, **options)

    refused(3, "`motion` must be a callable")
    refused(lambda t: zero, "`motion` must be a number|`motion` must")
    refused(
        lambda t: (zero, zero), "`motion` must return position, velocity and acceleration.*found 2 values"
    )
    refused(lambda t: ((t, 0, 0), zero, zero), "`velocity` must be the derivative of the motion")
    refused(lambda t: (zero, zero, zero), "`interval` must run forward", interval=(1.0, 0.0))
    table = contact.Platform("table", lambda t: (zero, zero, zero))
    with pytest.raises(errors.InputError, match="a body named `table` was added before"):
        contact.TreeOnPlatforms(tree, [table, table])
    scene = contact.TreeOnPlatforms(tree, [table])
    with pytest.raises(errors.InputError, match="`q`"):
        scene.start([0.0], [0.0, 0.0])

    def broken(t: float) -> Any:
        raise RuntimeError("no motion")

    with pytest.raises(RuntimeError, match="no motion"):
        contact.Platform("table", broken)
