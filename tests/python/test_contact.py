"""Contacts of a body: closed forms, orders, user-defined surfaces, what is left of a run that fails."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import somersault
from somersault import RigidBody, Solution, State, contact, errors, forces, integrate
from somersault.contact import (
    CompliantLaw,
    Contact,
    ContactSystem,
    CylindricalSurface,
    HalfSpace,
    SphericalSurface,
)

Array = NDArray[np.float64]
G = 9.81


def run(scene: ContactSystem, end: float, **options: Any) -> Solution:
    given = {"forces": scene.forces, "contacts": scene.contacts, "dt": 1e-3} | options
    return integrate(scene.body, scene.state, (0.0, end), **given)


def raises(error: type[Exception], part: str, call: Callable[[], object]) -> Exception:
    with pytest.raises(error) as caught:
        call()
    assert part in str(caught.value)
    assert type(caught.value) is error
    return caught.value


def ground(point: Array) -> tuple[float, tuple[float, float, float]]:
    """The half-space z < 0, spelled out."""
    return float(point[2]), (0.0, 0.0, 1.0)


def test_a_ball_touches_and_leaves_when_the_closed_form_says() -> None:
    mass, stiffness, damping, height = 0.7, 3e3, 4.0, 0.4
    ball = contact.bouncing_ball(mass, 0.1, CompliantLaw(stiffness, damping), height)
    fall = np.sqrt(2 * height / G)
    # m x'' = −m g − k x − c x' from x = 0, x' = −v: a damped oscillation about −m g/k.
    decay, rest, speed = damping / (2 * mass), -mass * G / stiffness, G * fall
    omega = np.sqrt(stiffness / mass - decay**2)
    sine = (-speed - decay * rest) / omega

    def motion(t: float) -> tuple[float, float]:
        c, s, e = np.cos(omega * t), np.sin(omega * t), np.exp(-decay * t)
        x = rest + e * (-rest * c + sine * s)
        return x, -decay * (x - rest) + omega * e * (rest * s + sine * c)

    def force(t: float) -> float:
        x, rate = motion(t)
        return float(-stiffness * x - damping * rate)

    # The force is positive at touch-down and, weight or not, negative well after half a period.
    held = brentq(force, 1e-6, 1.3 * np.pi / omega, xtol=1e-15)
    found = run(ball, 1.0, dt=1e-3, method="rkmk8")
    first, second = found.events[:2]
    assert (first.kind, first.contact, first.impulse) == ("touch_down", 0, 0.0)
    assert (second.kind, second.contact) == ("release", 0)
    assert first.t == pytest.approx(fall, abs=1e-13)
    assert second.t == pytest.approx(fall + held, abs=1e-12)
    assert second.state.velocity[2] == pytest.approx(motion(held)[1], abs=1e-11)
    impulse = mass * (motion(held)[1] + speed) + mass * G * held
    # Of order 4 in the step: (ω dt)⁴/720 of it.
    assert second.impulse == pytest.approx(impulse, rel=5 * (omega * 1e-3) ** 4 / 720)
    assert found.n_events == len(found.events)
    assert found.n_trials > 0
    assert np.isin([event.t for event in found.events], found.t).all()


@pytest.mark.parametrize("asked", [1.0, 0.9, 0.5, np.exp(-2.0), 0.05])
def test_restitution_measured_is_restitution_asked(asked: float) -> None:
    law = CompliantLaw.from_restitution(0.7, 1e4, asked)
    assert law.restitution(0.7) == pytest.approx(asked, rel=1e-12)
    assert contact.restitution(contact.damping_ratio(asked)) == pytest.approx(asked, rel=1e-12)
    ball = contact.bouncing_ball(0.7, 0.1, law, height=1e-2, velocity=-1.0)
    motion = run(ball, 0.2, dt=1e-4, method="rkmk8", forces=None)
    assert -motion[-1].velocity[2] / motion[0].velocity[2] == pytest.approx(asked, rel=1e-9)


def test_a_law_from_its_frequency() -> None:
    law = CompliantLaw.from_frequency(0.2, 100 * np.pi, 0.1)
    assert law.stiffness == pytest.approx(0.2 * (100 * np.pi) ** 2)
    assert law.damping == pytest.approx(2 * 0.2 * 100 * np.pi * 0.1)
    assert law.force(-1e-3, -0.1) == pytest.approx(law.stiffness * 1e-3 + law.damping * 0.1)
    assert law.force(1e-3, -0.1) == law.force(-1e-6, 1.0) == 0.0
    assert law.energy(-1e-3) == pytest.approx(0.5 * law.stiffness * 1e-6)
    assert pickle.loads(pickle.dumps(law)) == law


def top_by_dop853(scene: ContactSystem, end: float) -> tuple[Array, list[float]]:
    """The top by DOP853 with events, none of which is ours: the end and the times of the events."""
    body, law, arm = scene.body, scene.contacts[0].law, scene.contacts[0].point
    inertia = body.inertia

    def tip(y: Array) -> tuple[float, float, Array]:
        r = Rotation.from_quat(y[3:7]).apply(arm)
        return y[2] + r[2], y[9] + np.cross(y[10:], r)[2], r

    def slope(y: Array, held: bool) -> Array:
        q, omega = y[3:7], y[10:]
        gap, rate, r = tip(y)
        force = np.array([0.0, 0.0, -law.stiffness * gap - law.damping * rate if held else 0.0])
        matrix = Rotation.from_quat(q).as_matrix()
        world = matrix @ inertia @ matrix.T
        alpha = np.linalg.solve(world, np.cross(r, force) - np.cross(omega, world @ omega))
        q_dot = 0.5 * np.append(q[3] * omega + np.cross(omega, q[:3]), -omega @ q[:3])
        return np.concatenate([y[7:10], q_dot, force / body.mass - [0, 0, G], alpha])

    s = scene.state
    y = np.concatenate([s.position, s.quaternion, s.velocity, s.angular_velocity])
    t, held, times = 0.0, False, []
    while t < end:

        def switch(t: float, y: Array, held: bool = held) -> float:
            gap, rate, _ = tip(y)
            return float(law.stiffness * gap + law.damping * rate) if held else float(gap)

        switch.terminal = True  # type: ignore[attr-defined]
        switch.direction = 1.0 if held else -1.0  # type: ignore[attr-defined]
        solved = solve_ivp(
            lambda t, y, held=held: slope(y, held),
            (t, end),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            events=switch,
        )
        t, y = float(solved.t[-1]), solved.y[:, -1]
        if t < end:
            times.append(t)
            held = not held
    return y, times


def test_the_top_agrees_with_dop853() -> None:
    top = contact.spinning_top()
    end = 0.1
    y, times = top_by_dop853(top, end)
    motion = run(top, end, dt=1e-4, method="rkmk8")
    np.testing.assert_allclose([event.t for event in motion.events], times, atol=1e-10)
    angle = (motion[-1].orientation.inv() * Rotation.from_quat(y[3:7])).magnitude()
    assert angle < 1e-8
    np.testing.assert_allclose(motion[-1].position, y[:3], atol=1e-10)
    np.testing.assert_allclose(motion[-1].angular_velocity, y[10:], atol=1e-6)


def test_location_keeps_the_order_of_the_top() -> None:
    top, end = contact.spinning_top(), 0.1
    fine = run(top, end, dt=2e-5, method="rkmk8")[-1]

    def error(dt: float, **options: Any) -> float:
        found = run(top, end, dt=dt, **options)[-1]
        return float(np.linalg.norm(found.angular_velocity - fine.angular_velocity))

    coarse, half = error(1e-3), error(5e-4)
    assert np.log2(coarse / half) > 3.6
    assert error(5e-4, locate=False) > 100 * half


def test_a_surface_of_your_own_is_the_one_it_spells_out() -> None:
    top = contact.spinning_top()
    tip = top.contacts[0]
    ours = run(top, 0.05)
    theirs = run(top, 0.05, contacts=Contact(tip.point, ground, tip.law))
    # a half space of the library takes a shorter way to the same numbers: equal to rounding, not to the bit
    np.testing.assert_allclose(theirs.quaternion, ours.quaternion, rtol=0.0, atol=1e-13)
    assert [e.kind for e in theirs.events] == [e.kind for e in ours.events]
    for of in ("t", "impulse"):
        found, known = ([getattr(e, of) for e in motion.events] for motion in (theirs, ours))
        np.testing.assert_allclose(found, known, rtol=1e-11)


def test_evaluations_are_counted() -> None:
    top, calls = contact.spinning_top(), 0

    def weight(t: float, state: State) -> tuple[Any, Any]:
        nonlocal calls
        calls += 1
        return (0.0, 0.0, -G * top.body.mass), (0.0, 0.0, 0.0)

    motion = run(top, 0.05, forces=weight)
    assert motion.nfev == calls > 0


def test_surfaces_and_their_gradients() -> None:
    at = np.array([0.3, -0.4, 1.2])
    distance, gradient = HalfSpace((0, 0, 1), (0, 0, 2)).signed_distance(at)
    assert distance == pytest.approx(0.2)
    np.testing.assert_array_equal(gradient, (0, 0, 1))
    distance, gradient = SphericalSurface((0, 0, 0), 1.0).signed_distance(at)
    assert distance == pytest.approx(0.3)
    np.testing.assert_allclose(gradient, at / 1.3)
    distance, gradient = SphericalSurface((0, 0, 0), 2.0, "outside").signed_distance(at)
    assert distance == pytest.approx(0.7)
    np.testing.assert_allclose(gradient, -at / 1.3)
    distance, gradient = CylindricalSurface((0, 0, 5), (0, 0, -1), 0.2).signed_distance(at)
    assert distance == pytest.approx(0.3)
    np.testing.assert_allclose(gradient, (0.6, -0.8, 0.0))


def test_a_gap_is_that_of_the_point() -> None:
    law = CompliantLaw(100.0)
    state = State((0, 0, 1), velocity=(0, 0, 2), angular_velocity=(0, 3, 0))
    for surface in (HalfSpace(), ground):
        gap, rate = Contact((0.1, 0, -0.2), surface, law).gap(state)
        assert (gap, rate) == (pytest.approx(0.8), pytest.approx(2 - 0.3))

    def broken(point: Array) -> tuple[float, Array]:
        raise KeyError("lost")

    raises(KeyError, "lost", lambda: Contact((0, 0, 0), broken, law).gap(state))


def fault(what: str) -> Callable[[Array], Any]:
    """The ground, until it fails at 3 mm below."""

    def surface(point: Array) -> Any:
        if point[2] > -3e-3:
            return ground(point)
        if what == "raise":
            raise RuntimeError("the ground gave way")
        return {
            "nan": (np.nan, (0.0, 0.0, 1.0)),
            "nan gradient": (0.0, (0.0, np.nan, 1.0)),
            "text": "down there",
            "short": (0.0, (0.0, 1.0)),
        }[what]

    return surface


@pytest.mark.parametrize("locate", [True, False])
@pytest.mark.parametrize(
    ("what", "error", "message"),
    [
        ("raise", RuntimeError, "the ground gave way"),
        ("nan", errors.InputError, "surface` returned a distance or gradient that is NaN or infinite at ["),
        ("nan gradient", errors.InputError, "returned a distance or gradient that is NaN or infinite"),
        ("text", errors.InputError, "surface` must return a pair (distance, gradient)"),
        ("short", errors.InputError, "surface(point)[1]` must be real numbers of shape (3,)"),
    ],
)
def test_a_surface_that_fails_leaves_what_was_before(
    what: str, error: type[Exception], message: str, locate: bool
) -> None:
    ball = contact.bouncing_ball(1.0, 0.1, CompliantLaw(1e3), height=0.1)
    broken = Contact((0, 0, -0.1), fault(what), CompliantLaw(1e3))
    caught = raises(error, message, lambda: run(ball, 1.0, contacts=[broken], locate=locate))
    motion = caught.solution  # type: ignore[attr-defined]
    assert isinstance(motion, Solution)
    assert (motion.status, motion.success) == (-2, False)
    assert "failed after t = 0.14" in motion.message
    assert 0.1427 < motion.t[-1] < 0.1455
    # The fall up to the fault, and the contact that had begun.
    early = motion.t < 0.142
    np.testing.assert_allclose(motion.position[early, 2], 0.2 - 0.5 * G * motion.t[early] ** 2, atol=1e-12)
    assert [event.kind for event in motion.events] == ["touch_down"] * locate
    assert pickle.loads(pickle.dumps(motion)).message == motion.message


def test_other_failures_leave_what_was_before_too(body: RigidBody, state: State) -> None:
    def late(t: float, x: State) -> tuple[Any, Any]:
        if t > 0.5:
            raise LookupError("no force there")
        return (0, 0, 0), (0, 0, 0)

    caught = raises(LookupError, "no force", lambda: integrate(body, state, (0, 1), dt=0.1, forces=late))
    assert len(caught.solution) == 6  # type: ignore[attr-defined]
    wild = forces.Spring(1e6, damping=-1e6)
    caught = raises(
        errors.IntegrationError, "", lambda: integrate(body, state, (0, 1e3), dt=1.0, forces=wild)
    )
    assert isinstance(caught, errors.IntegrationError)
    assert isinstance(caught.solution, Solution)
    assert errors.IntegrationError().solution is None


def test_events_that_follow_too_fast_end_a_run() -> None:
    ball = contact.bouncing_ball(1.0, 0.1, CompliantLaw(1e6), height=1e-3)
    caught = raises(
        errors.ChatteringError,
        "`max_event_rate` = 10 events per unit of time",
        lambda: run(ball, 10.0, max_event_rate=10.0),
    )
    assert isinstance(caught, errors.ChatteringError) and caught.solution is not None
    assert caught.solution.n_events >= 64
    assert len(caught.solution.events) == caught.solution.n_events


def test_events_are_counted_when_they_are_not_kept() -> None:
    ball = contact.bouncing_ball(1.0, 0.1, CompliantLaw(1e4), height=0.1)
    kept, counted = (run(ball, 2.0, keep_events=keep) for keep in (True, False))
    assert counted.events == ()
    assert counted.n_events == kept.n_events == len(kept.events) > 4
    np.testing.assert_array_equal(counted.position, kept.position)
    again = pickle.loads(pickle.dumps(kept))
    assert [(e.t, e.kind, e.state) for e in again.events] == [(e.t, e.kind, e.state) for e in kept.events]
    assert (again.n_events, again.n_trials) == (kept.n_events, kept.n_trials)
    assert repr(kept.events[0]).startswith("<Event: touch_down of contact 0 at t = 0.14")


def test_dense_output_passes_through_the_events() -> None:
    top = contact.spinning_top()
    motion = run(top, 0.1, dt=1e-3, dense_output=True, every=1000)
    fine = run(top, 0.1, dt=1e-3)
    assert motion.sol is not None
    for event in motion.events:
        there = motion.sol(event.t)
        np.testing.assert_allclose(there.position, event.state.position, atol=1e-14)
        np.testing.assert_allclose(there.angular_velocity, event.state.angular_velocity, atol=1e-9)
    np.testing.assert_allclose(motion.sol(fine.t).position, fine.position, atol=1e-13)


def test_an_observer_sees_contacts_and_can_stop() -> None:
    ball = contact.bouncing_ball(1.0, 0.1, CompliantLaw(1e4), height=0.1)
    tip = ball.contacts[0]
    motion = run(ball, 1.0, observer=lambda t, state: tip.gap(state)[0] <= 0.0)
    assert motion.status == 1
    assert [event.kind for event in motion.events] == ["touch_down"]
    assert motion.t[-1] == motion.events[0].t


def test_a_body_may_touch_at_several_points() -> None:
    box = RigidBody.box(1.0, (0.2, 0.3, 0.4))
    law = CompliantLaw(1e4, 20.0)
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.15, 0.15) for z in (-0.2, 0.2)])
    contacts = [Contact(corner, HalfSpace(), law) for corner in corners]
    level = State((0, 0, 0.3))
    motion = integrate(box, level, (0, 2.0), dt=1e-3, forces=forces.Gravity(), contacts=contacts)
    # It falls flat: four corners together, and comes to rest on four springs.
    assert [event.contact for event in motion.events[:4]] == [0, 2, 4, 6]
    assert len({event.t for event in motion.events[:4]}) == 1
    np.testing.assert_allclose(motion[-1].position[2], 0.2 - G / 4e4, atol=1e-5)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda: CompliantLaw(-1.0),
            errors.InputError,
            "`stiffness` must be positive and finite, found -1",
        ),
        (lambda: CompliantLaw(1.0, -1.0), errors.InputError, "`damping` must be finite and not negative"),
        (
            lambda: CompliantLaw(np.nan),
            errors.InputError,
            "`stiffness` must be positive and finite, found NaN",
        ),
        (lambda: contact.damping_ratio(0.0), errors.InputError, "`restitution` must be above 0"),
        (
            lambda: CompliantLaw.from_restitution(1, 1, 0),
            errors.InputError,
            "`restitution` must be above 0",
        ),
        (lambda: CompliantLaw(1.0).force(np.nan, 0), errors.InputError, "`gap` must be finite, found NaN"),
        (lambda: HalfSpace(normal=(0, 0, 0)), errors.InputError, "`normal` must be a finite vector other"),
        (lambda: HalfSpace(point=(0, np.inf, 0)), errors.InputError, "`point` must be finite, found inf"),
        (lambda: SphericalSurface((0, 0, 0), -1.0), errors.InputError, "`radius` must be positive"),
        (
            lambda: SphericalSurface((0, 0, 0), 1.0, "both"),
            errors.InputError,
            "`solid` must be 'inside' or 'outside'",
        ),  # type: ignore[arg-type]
        (
            lambda: CylindricalSurface((0, 0, 0), (0, 0, 0), 1.0),
            errors.InputError,
            "`axis` must be a finite vector",
        ),
        (
            lambda: Contact((0, 0), ground, CompliantLaw(1.0)),
            errors.InputError,
            "`point` must be real numbers",
        ),
        (
            lambda: Contact((0, 0, 0), 3, CompliantLaw(1.0)),
            errors.InputError,
            "`surface` must be a Surface or",
        ),  # type: ignore[arg-type]
        (
            lambda: Contact((0, 0, 0), ground, 3),
            errors.InputError,
            "`law` must be a CompliantLaw or a HuntCrossley, found",
        ),  # type: ignore[arg-type]
    ],
)
def test_bad_laws_surfaces_and_contacts_are_refused(
    call: Callable[[], object], error: type[Exception], message: str
) -> None:
    raises(error, message, call)


def test_bad_arguments_of_a_run_are_refused(body: RigidBody, state: State) -> None:
    top = contact.spinning_top()
    raises(
        errors.InputError, "`contacts` must hold contacts, found an int", lambda: run(top, 1.0, contacts=[1])
    )
    raises(
        errors.InputError,
        "an entry for each of 2 bodies",
        lambda: integrate([body, body], [state, state], (0, 1), dt=0.1, contacts=top.contacts),
    )
    raises(
        errors.InputError,
        "`max_event_rate` must be positive",
        lambda: run(top, 1.0, max_event_rate=0.0),
    )
    raises(errors.InputError, "accepts no torque", lambda: run(top, 0.1, method="dmv2"))
    none = integrate(top.body, top.state, (0, 0.1), dt=0.01, contacts=[])
    assert none.events == () and somersault.__version__
