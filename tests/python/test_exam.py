"""The exam of engines: its answers by two independent means, and what an audit finds."""

from __future__ import annotations

import copy
import json
import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import exam_answers
import numpy as np
import pytest
from mpmath import mp, mpf

import somersault
from somersault import exam
from somersault.cli import main
from somersault.errors import InputError

NAMES = [scene.name for scene in exam.scenes()]
G = mpf(9.81)
#: Of the series that the tests sum: bits, terms, and the change by which a derivative is taken.
BITS, TERMS, CHANGE = 90, 30, 36
#: Closed forms are compared to this, times the scene's condition: starts are rounded to doubles.
CLOSE = 4e-16

Matrix = Any


@pytest.fixture(autouse=True)
def _digits() -> Any:
    with mp.workdps(32):
        yield


# ------------------------------------------------------------------------------- answers, by series


@pytest.mark.parametrize("name", NAMES)
def test_answers_held_are_those_of_taylor_series(name: str) -> None:
    scene = exam.scene(name)
    end, events = exam_answers.run(scene, bits=BITS, terms=TERMS)
    assert np.allclose(np.array(end, dtype=float), scene.answer.ravel(), rtol=1e-15, atol=1e-15)
    assert np.allclose(np.array(events, dtype=float), scene.events, rtol=1e-15, atol=0.0)
    slopes = np.array(exam_answers.gradient(scene, BITS, TERMS, CHANGE), dtype=float)
    # the change of a parameter is cubed in the error, and divided by the square of what the scene calls small
    assert np.allclose(slopes, scene.gradient, rtol=1e-5 if name == "graze" else 1e-9, atol=1e-9)


# ---------------------------------------------------------------------------- answers, in closed form


def rotation(axis: Any, angle: Any) -> Matrix:
    """About a unit vector."""
    x, y, z = axis
    cross = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mp.eye(3) + mp.sin(angle) * cross + (1 - mp.cos(angle)) * cross * cross


def rotation_of(q: Any) -> Matrix:
    x, y, z, w = (mpf(float(c)) for c in q)
    v = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mp.eye(3) + 2 * w * v + 2 * v * v


def start_of(name: str) -> tuple[Any, list[Any], Any]:
    scene = exam.scene(name)
    moments = [mpf(float(scene.bodies[0].inertia[k, k])) for k in range(3)]
    return scene, moments, [mpf(float(w)) for w in scene.y0[0, 10:]]


def off(name: str, spin: Any = None, turned: Matrix | None = None) -> float:
    """How far the held end is from another one, as a fraction of what is allowed."""
    scene = exam.scene(name)
    end = scene.answer[0]
    allowed = CLOSE * max(1.0, scene.condition)
    worst = 0.0
    if spin is not None:
        worst = max(abs(float(a - mpf(float(b)))) for a, b in zip(spin, end[10:], strict=True))
        worst /= max(1.0, float(mp.norm(spin)))
    if turned is not None:
        worst = max(worst, float(mp.norm(turned - rotation_of(end[3:7]))))
    return worst / allowed


def symmetric(name: str) -> float:
    """A free symmetric body: a turn about L at |L|/I₁, and one about the axis."""
    scene, moments, w = start_of(name)
    t = mpf(scene.duration)
    momentum = [i * x for i, x in zip(moments, w, strict=True)]
    size = mp.norm(momentum)
    about_axis = (moments[0] - moments[2]) / moments[0] * w[2] * t
    turned = rotation([x / size for x in momentum], size / moments[0] * t) * rotation([0, 0, 1], about_axis)
    spin = rotation([0, 0, 1], -about_axis) * mp.matrix(w)
    return off(name, spin, turned)


def middle_axis() -> float:
    scene = exam.scene("middle_axis")
    end = somersault.exact.FreeBody(scene.bodies[0], scene.start[0])(scene.duration)
    turn = min(np.linalg.norm(end.quaternion - sign * scene.answer[0, 3:7]) for sign in (-1, 1))
    spin = np.linalg.norm(end.angular_velocity_body - scene.answer[0, 10:])
    # the exact motion is within four roundings of the angle turned
    return float(max(turn, spin / 5) / (4 * 2.2e-16 * 20 * 2))


def gyrostat() -> float:
    scene = exam.scene("gyrostat")
    end = somersault.exact.Gyrostat(scene.bodies[0], scene.rotors, scene.start[0])(scene.duration)
    turn = min(np.linalg.norm(end.quaternion - sign * scene.answer[0, 3:7]) for sign in (-1, 1))
    spin = np.linalg.norm(end.angular_velocity_body - scene.answer[0, 10:])
    # both are within a few roundings of what the start is sensitive to
    return float(max(turn, spin) / (10 * 2.2e-16 * scene.condition))


def separatrix() -> float:
    scene, (i, j, k), (a, _, c) = start_of("separatrix")
    t = mpf(scene.duration)
    energy2, momentum = i * a * a + k * c * c, mp.sqrt((i * a) ** 2 + (k * c) ** 2)
    b = momentum / j
    assert abs(energy2 - momentum**2 / j) < mpf(10) ** -20
    rate = mp.sqrt((j - i) * (k - j) / (i * k)) * b
    sign = 1 if (k - i) * a * c > 0 else -1

    def spin(t: Any) -> list[Any]:
        return [a * mp.sech(rate * t), sign * b * mp.tanh(rate * t), c * mp.sech(rate * t)]

    def frame(t: Any) -> Matrix:
        """Columns l, f, l × f in the body; f, normal to l, is the same for both unstable rotations."""
        w = spin(t)
        l = [i * w[0] / momentum, j * w[1] / momentum, k * w[2] / momentum]  # noqa: E741
        f = [k * c, 0, -i * a]
        f = [x / mp.norm(f) for x in f]
        m = [l[1] * f[2] - l[2] * f[1], l[2] * f[0] - l[0] * f[2], l[0] * f[1] - l[1] * f[0]]
        return mp.matrix([[l[n], f[n], m[n]] for n in range(3)])

    # the frame turns about L in the world at |L|/I₂
    world = frame(0) * rotation([1, 0, 0], momentum / j * t)
    return off("separatrix", spin(t), world * frame(t).T)


def weber(a: Any, s: Any, slope: Any, t: Any) -> Matrix:
    """The turn of a frame with angular velocity (a, 0, s + slope t) in itself, by ₁F₁."""
    scale = mp.sqrt(1j / slope)
    order = (1j * slope / 2 - a * a / 4) / (1j * slope)

    def even(x: Any) -> Any:
        z = scale * x
        return mp.exp(-z * z / 4) * mp.hyp1f1(order / 2 + mpf(1) / 4, mpf(1) / 2, z * z / 2)

    def odd(x: Any) -> Any:
        z = scale * x
        return z * mp.exp(-z * z / 4) * mp.hyp1f1(order / 2 + mpf(3) / 4, mpf(3) / 2, z * z / 2)

    def rates(x: Any) -> tuple[Any, Any]:
        with mp.workdps(50):
            return slope * mp.diff(even, x), slope * mp.diff(odd, x)

    # u = w + i z = 1 and v = x + i y = 0 at the start, u′ = (i s u − a v)/2
    first, last = s, s + slope * t
    de, do = rates(first)
    weights = mp.lu_solve(mp.matrix([[even(first), odd(first)], [de, do]]), mp.matrix([1, 0.5j * first]))
    u = weights[0] * even(last) + weights[1] * odd(last)
    de, do = rates(last)
    v = (1j * last * u - 2 * (weights[0] * de + weights[1] * do)) / a
    q = [v.real, v.imag, u.imag, u.real]
    x, y, z, w = q
    cross = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mp.eye(3) + 2 * w * cross + 2 * cross * cross


def ball_torque() -> float:
    scene, (moment, _, _), w = start_of("ball_torque")
    t, slope = mpf(scene.duration), mpf(scene.torque[2]) / moment
    return off("ball_torque", [w[0], 0, w[2] + slope * t], weber(w[0], w[2], slope, t))


def axial_torque() -> float:
    """In a frame that turns about the axis with the phase, the transverse rate is constant."""
    scene, (i, _, k), w = start_of("axial_torque")
    t, slope = mpf(scene.duration), mpf(scene.torque[2]) / k
    part = (i - k) / i
    phase = part * (w[2] * t + slope * t * t / 2)
    turned = weber(w[0], w[2] * (1 - part), slope * (1 - part), t) * rotation([0, 0, 1], phase)
    spin = [w[0] * mp.cos(phase), -w[0] * mp.sin(phase), w[2] + slope * t]
    return off("axial_torque", spin, turned)


def skew_torque() -> float:
    """Rates by Fresnel's integrals; the quaternion by collocation at Chebyshev's points."""
    scene, (i, _, k), w = start_of("skew_torque")
    across = mp.mpc(*map(float, scene.torque[:2])) / i
    slope, part = mpf(scene.torque[2]) / k, (i - k) / i
    # ω⊥ = e^(−iΦ) (ω⊥₀ + M⊥/I₁ ∫ e^(iΦ)) with Φ = a x² − a x₀², x = t + x₀
    a, x0 = part * slope / 2, w[2] / slope
    scale = mp.sqrt(2 * a / mp.pi)

    def rates(t: Any) -> tuple[Any, Any, Any]:
        driven = [mp.mpc(mp.fresnelc(scale * x), mp.fresnels(scale * x)) for x in (x0, t + x0)]
        whole = (driven[1] - driven[0]) / scale * mp.expj(-a * x0**2)
        turned = mp.expj(-a * ((t + x0) ** 2 - x0**2)) * (mp.mpc(w[0], w[1]) + across * whole)
        return turned.real, turned.imag, w[2] + slope * t

    n, end = 40, scene.duration
    points = np.cos(np.pi * np.arange(n, -1, -1) / n)
    ends = np.ones(n + 1)
    ends[[0, -1]] = 2.0
    ends *= (-1.0) ** np.arange(n + 1)
    apart = points[:, None] - points + np.eye(n + 1)
    slopes = np.outer(ends, 1 / ends) / apart
    slopes -= np.diag(slopes.sum(axis=1))
    system = np.kron(slopes * (2 / end), np.eye(4))
    for row, x in enumerate(points):
        p, q, r = (float(rate) for rate in rates(mpf(end) * (1 + mpf(float(x))) / 2))
        half = 0.5 * np.array([[0, r, -q, p], [-r, 0, p, q], [q, -p, 0, r], [-p, -q, -r, 0]])
        system[4 * row : 4 * row + 4, 4 * row : 4 * row + 4] -= half
    start = np.array([0.0, 0.0, 0.0, 1.0])
    found = np.linalg.solve(system[4:, 4:], -system[4:, :4] @ start)[-4:]
    turn = min(np.abs(found - sign * scene.answer[0, 3:7]).max() for sign in (-1, 1))
    return max(off("skew_torque", rates(mpf(end))), float(turn) / 3e-14)


def lagrange_top() -> float:
    """The cosine of the tilt by sn²; the rest of the held end by what is conserved."""
    scene, (i, _, k), w = start_of("lagrange_top")
    u0 = rotation_of(scene.y0[0, 3:7])[2, 2]
    mgl = mpf(scene.bodies[0].mass) * G * mpf(scene.pivot[2])
    axial = k * w[2]
    vertical = axial * u0
    # u′² = 2 m g l/I₁ (u₀ − u)(1 − u²) − ((p_ψ/I₁)(u₀ − u))², with u = u₀ at the start a simple root
    a, b = axial / i, 2 * mgl / i
    # (u₀ − u) (b (1 − u²) − a² (u₀ − u)): roots of the second factor
    root = mp.sqrt(a**4 - 4 * b * (a * a * u0 - b))
    low, high = (a * a - root) / (2 * b), (a * a + root) / (2 * b)
    if low > u0:
        low, high = u0, low
    modulus = (u0 - low) / (high - low)
    rate = mp.sqrt(b * (high - low)) / 2
    # it begins at the upper turning point u₀
    at = low + (u0 - low) * mp.ellipfun("sn", mp.ellipk(modulus) - rate * mpf(scene.duration), m=modulus) ** 2
    end = scene.answer[0]
    tilt = rotation_of(end[3:7])[2, 2]
    spin = [mpf(float(x)) for x in end[10:]]
    up = [rotation_of(end[3:7])[2, n] for n in range(3)]
    found = i * (spin[0] * up[0] + spin[1] * up[1]) + k * spin[2] * up[2]
    energy = i * (spin[0] ** 2 + spin[1] ** 2) / 2 + mgl * up[2]
    errors = [at - tilt, found - vertical, spin[2] - w[2], (energy - mgl * u0) / mgl]
    return float(max(map(abs, errors))) / (CLOSE * 5)


def steady_top() -> float:
    scene, _, w = start_of("steady_top")
    q = rotation_of(scene.y0[0, 3:7])
    u = [q[2, n] for n in range(3)]
    rate = w[1] / u[1]
    t = mpf(scene.duration)
    about = w[2] - rate * u[2]
    turned = rotation([0, 0, 1], rate * t) * q * rotation([0, 0, 1], about * t)
    spin = rotation([0, 0, 1], -about * t) * mp.matrix(w)
    # the start is rounded, so that the tilt swings by roundings
    return off("steady_top", spin, turned) / 3


def sleeping_top() -> float:
    """A turn about the vertical, and the linearised tilt: I₁ a″ − i (I₃ − 2 I₁) s a′ … in the body."""
    scene, (i, _, k), w = start_of("sleeping_top")
    t, s = mpf(scene.duration), w[2]
    mgl = mpf(scene.bodies[0].mass) * G * mpf(scene.pivot[2])
    # the axis in the world, z = x + i y: I₁ z″ − i I₃ s z′ − m g l z = 0; at the start turned about x, so z =
    # −i
    root = mp.sqrt((k * s) ** 2 - 4 * i * mgl)
    p, q = (1j * (k * s + root) / (2 * i), 1j * (k * s - root) / (2 * i))
    # the angular velocity of the body is (0, 0, s) in its own tilted axes: z′ = 0 at the start
    z0 = -1j
    a, b = -q * z0 / (p - q), p * z0 / (p - q)
    z = a * mp.exp(p * t) + b * mp.exp(q * t)
    # in body axes at the end, of the axis of the body tilted by the rotation vector d: e₃ × … = (d_y, −d_x)
    in_body = z * mp.exp(-1j * s * t)
    slope = scene.gradient[0]
    errors = [in_body.real - mpf(slope[4]), in_body.imag + mpf(slope[3])]
    return max(float(max(map(abs, errors))) / 1e-14, off("sleeping_top", w, rotation([0, 0, 1], s * t)))


def kovalevskaya() -> float:
    """No elementary solution: SciPy's integrator, and the four integrals in many digits."""
    from scipy.integrate import solve_ivp

    scene = exam.scene("kovalevskaya")
    found = solve_ivp(
        lambda t, y: scene.rate("heavy", t, y),
        (0, scene.duration),
        scene.y0[0],
        "DOP853",
        rtol=3e-14,
        atol=1e-15,
    ).y[:, -1]
    worst = np.abs(found - scene.answer[0]).max() / 1e-12
    for function in scene.invariants.values():
        worst = max(worst, abs(function(scene.answer) / function(scene.y0) - 1) / 1e-14)
    return float(worst)


def pendulum() -> float:
    scene, (i, _, _), _ = start_of("pendulum")
    rate = mp.sqrt(mpf(scene.bodies[0].mass) * G * mpf("0.5") / i)
    t = mpf(scene.duration)

    def angle(start: Any) -> Any:
        k = mp.sin(start / 2)
        cd = mp.ellipfun("cd", rate * t, m=k * k)
        return 2 * mp.asin(k * cd)

    start = 2 * mp.atan2(mpf(scene.y0[0, 3]), mpf(scene.y0[0, 6]))
    tilt = angle(start)
    found = rotation_of(scene.answer[0, 3:7])
    slope = mp.diff(angle, start)
    sign = mp.sign(slope) * mp.sign(mpf(scene.gradient[0, 3]))
    assert sign in (1, -1)
    errors = [
        float(mp.sin(tilt) - found[2, 1]) / (CLOSE * scene.condition),
        float(mp.cos(tilt) - found[2, 2]) / (CLOSE * scene.condition),
        float(slope / mpf(scene.gradient[0, 3]) - 1) / 1e-11,
    ]
    return max(map(abs, errors))


def double_pendulum() -> float:
    """Hamilton's equations for the sines, cosines and momenta of both angles, by series too; energy."""
    scene = exam.scene("double_pendulum")
    (m, n), (long, half, short) = (2.0, 1.0), (1.0, 0.5, 0.4)
    i, j = (float(body.inertia[0, 0]) for body in scene.bodies)
    one, two, g = i + m * half**2 + n * long**2, j + n * short**2, 9.81

    def rates(y: Any) -> tuple[Any, Any, Any]:
        s, c, p, d, a, b = y
        both = n * long * short * (c * d + s * p)
        whole = one * two - both * both
        v, w = (two * a - both * b) / whole, (one * b - both * a) / whole
        return v, w, n * long * short * ((s * d - c * p) * v * w)

    def slope(t: Any, y: Any) -> list[Any]:
        s, c, p, d, _, _ = y
        v, w, common = rates(y)
        pull, drop = (m * half + n * long) * g * s, n * short * g * p
        return [c * v, -(s * v), d * w, -(p * w), -common - pull, common - drop]

    turned = [[Fraction(q) for q in y[[3, 6]].tolist()] for y in scene.y0]
    angles = [x for q, w in turned for x in (2 * q * w, w * w - q * q)]
    series = exam_answers.Arithmetic(BITS, TERMS)
    record = exam_answers.Record(6, slope)
    y, t, end = [series.fixed(x) for x in (*angles, 0, 0)], 0, series.fixed(scene.duration)
    while t < end:
        curve = series.series(record, y)
        h = min(end - t, exam_answers.step_within(series, curve))
        y, t = [series.at(each, h) for each in curve], t + h
    s, c, p, d, *_ = found = [float(series.number(x)) for x in y]
    v, w, _ = rates(found)
    ends = [[half * s, -half * c, v], [long * s + short * p, -long * c - short * d, w]]
    worst = np.abs(np.array(ends) - scene.answer[:, [1, 2, 10]]).max() / (CLOSE * scene.condition)
    energy = scene.invariants["energy"]
    return float(max(worst, abs(energy(scene.answer) / energy(scene.y0) - 1) / 1e-14))


def contact_off(name: str, end: Any, events: Any = (), slopes: Any = ()) -> float:
    """From pairs (number of the state, value), times, and pairs of the derivative, all of the first body."""
    scene = exam.scene(name)
    allowed = CLOSE * max(1.0, scene.condition)
    states, gradient = scene.answer.ravel(), scene.gradient.ravel()
    errors = [abs(float(value) - states[number]) / max(1.0, abs(states[number])) for number, value in end]
    assert len(events) == len(scene.events)
    errors += [abs(float(t) - found) for t, found in zip(events, scene.events, strict=True)]
    worst = max(errors) / allowed
    for number, value in slopes:
        worst = max(worst, abs(float(value) - gradient[number]) / 1e-11 / max(1.0, abs(gradient[number])))
    return worst


def spring_bounce() -> float:
    k, c, g = mpf(1000), mpf(10), G
    decay, rate = c / 2, mp.sqrt(k - c * c / 4)

    def bounced(v: Any) -> tuple[Any, Any, Any]:
        """Time, place and speed of the release after a touch-down at v: an oscillation about −m g/k."""
        rest = -g / k
        b = (v - decay * rest) / rate

        def at(t: Any) -> tuple[Any, Any]:
            e, cos, sin = mp.exp(-decay * t), mp.cos(rate * t), mp.sin(rate * t)
            x = e * (-rest * cos + b * sin)
            return rest + x, -decay * x + e * rate * (rest * sin + b * cos)

        # the force falls to zero once, near the end of half a period
        bracket = (mp.pi / rate * mpf("0.5"), mp.pi / rate * mpf("1.3"))
        t = mp.findroot(lambda t: k * at(t)[0] + c * at(t)[1], bracket, solver="anderson", tol=1e-55)
        return t, *at(t)

    def flown(z: Any, v: Any) -> Any:
        return (v + mp.sqrt(v * v + 2 * g * z)) / g

    t, z, v, events = mpf(0), mpf("0.5"), mpf(0), []
    for _ in range(2):
        flight = flown(z, v)
        t, v = t + flight, v - g * flight
        events.append(t)
        stay, z, v = bounced(v)
        t += stay
        events.append(t)
    flight = flown(z, v)
    t, v = t + flight, v - g * flight
    events.append(t)
    left, rest = mpf(1.2) - t, -g / k
    b = (v - decay * rest) / rate
    e, cos, sin = mp.exp(-decay * left), mp.cos(rate * left), mp.sin(rate * left)
    x = e * (-rest * cos + b * sin)
    return contact_off("spring_bounce", [(2, rest + x)], events)


def hunt_crossley() -> float:
    """w of the penetration obeys w dw/dx = −(k/m) x (1 + d w), so that E(w) + k x²/(2 m) is constant."""
    k, d, v = mpf(2000), mpf(0.3), mpf(2)

    def leaves(v: Any) -> Any:
        """E(−w₁) = E(v): d w₁ + 1 = −W(−e^{−(1 + g)}) with E = −g/d²."""
        g = mp.log(1 + d * v) - d * v
        return -(mp.lambertw(-mp.exp(g - 1), 0).real + 1) / d

    out = leaves(v)  # negative, upwards

    def work(w: Any) -> Any:
        return w / d - mp.log(1 + d * w) / d**2

    # dt = dw/w′ with w′ = −k x (1 + d w), and x from the energy; w = v − s² and w = out + s² remove the ends
    def slope(w: Any, of: Any) -> Any:
        x = mp.sqrt(2 / k * of)
        return 1 / (k * x * (1 + d * w))

    whole = work(v)

    def first(s: Any) -> Any:
        w = v - s * s
        return 2 * s * slope(w, whole - work(w)) if s else mpf(0)

    def last(s: Any) -> Any:
        w = out + s * s
        return 2 * s * slope(w, whole - work(w)) if s else mpf(0)

    with mp.workdps(60):
        stay = mp.quad(first, [mpf(10) ** -25, mp.sqrt(v)]) + mp.quad(last, [mpf(10) ** -25, mp.sqrt(-out)])
    touch = mpf(0.5) / v
    end = [(2, -out * (mpf(0.6) - touch - stay)), (9, -out)]
    return contact_off("hunt_crossley", end, [touch, touch + stay], [(8, mp.diff(leaves, v))])


def hard_bounce() -> float:
    e = mpf(0.8)

    def at(h: Any) -> tuple[Any, Any, list[Any]]:
        first = mp.sqrt(2 * h / G)
        times = [first * (1 + 2 * sum(e**k for k in range(1, n + 1))) for n in range(3)]
        v = e**3 * G * first
        left = 2 - times[-1]
        return v * left - G * left**2 / 2, v - G * left, times

    z, v, times = at(mpf(1))
    slopes = [(2, mp.diff(lambda h: at(h)[0], 1)), (8, mp.diff(lambda h: at(h)[1], 1))]
    return contact_off("hard_bounce", [(2, z), (9, v)], times, slopes)


def zeno_rest() -> float:
    """The impulse of the floor is that of the weight, and its moment in time is the height."""
    scene, e, mu, h, t = exam.scene("zeno_rest"), mpf(0.5), mpf(0.15), mpf(1), mpf(2)
    first = mp.sqrt(2 * h / G)
    times = [first * (1 + 2 * sum(e**k for k in range(1, n + 1))) for n in range(len(scene.events))]
    rest = first * (1 + e) / (1 - e)
    # the last impact is the first after which it would leave at less than 1e-6 m/s
    leaves = [mp.sqrt(2 * G * h) * e ** (n + 1) for n in range(len(times))]
    assert leaves[-1] < 1e-6 < leaves[-2] and 0 < rest - times[-1] < 3e-7
    end = [(0, 4 * t - mu * (G * t**2 / 2 - h)), (2, 0), (7, 4 - mu * G * t), (9, 0)]
    return contact_off("zeno_rest", end, times, [(0, mu), (2, 0), (6, 0), (8, 0)])


def graze() -> float:
    scene = exam.scene("graze")
    omega = mpf(100)

    def at(v0: Any) -> tuple[Any, Any, list[Any]]:
        up = (v0 - mp.sqrt(v0 * v0 - 2 * G)) / G
        v = v0 - G * up
        # x = (v/ω) sin ωt − (g/ω²)(1 − cos ωt) is zero again where tan(ωt/2) = v ω/g
        stay = 2 * mp.atan(v * omega / G) / omega
        left = mpf(scene.duration) - up - stay
        return 1 - v * left - G * left**2 / 2, -v - G * left, [up, up + stay]

    v0 = mpf(scene.y0[0, 9])
    z, v, times = at(v0)
    step = mpf(10) ** -14
    slopes = [(n, (at(v0 + step)[k] - at(v0 - step)[k]) / (2 * step)) for n, k in ((2, 0), (8, 1))]
    missed = v0 * mpf(scene.duration) - G * mpf(scene.duration) ** 2 / 2
    assert 2e-9 < abs(missed - z) < 4e-9 and 0.17 < abs(slopes[0][1] - mpf(scene.duration)) < 0.19
    return contact_off("graze", [(2, z), (9, v)], times, slopes)


def incline_slip() -> float:
    a = G * (mp.sin(mpf(0.5)) - mpf(0.3) * mp.cos(mpf(0.5)))
    return contact_off("incline_slip", [(0, mpf(0.5) + a / 2), (7, mpf(0.5) + a)], (), [(0, 1), (6, 1)])


def incline_stop() -> float:
    a = G * (mpf(0.5) * mp.cos(mpf(0.2)) - mp.sin(mpf(0.2)))
    return contact_off("incline_stop", [(0, 1 / (2 * a)), (7, 0)], [1 / a], [(0, 1 / a), (6, 0)])


def slide_to_roll() -> float:
    drag, r = mpf(0.2) * G, mpf(0.1)
    t = 2 * mpf(2) / (7 * drag)
    slid, turned = 2 * t - drag * t * t / 2, 5 * drag / (4 * r) * t * t
    left = mpf(0.5) - t
    angle = turned + mpf(10) / 7 / r * left
    end = [(0, slid + mpf(10) / 7 * left), (7, mpf(10) / 7), (11, mpf(10) / 7 / r), (4, mp.sin(angle / 2))]
    return contact_off("slide_to_roll", [*end, (6, mp.cos(angle / 2))], [t]) / 2


def rolling_incline() -> float:
    a = mpf(5) / 7 * G * mp.sin(mpf(0.3))
    return contact_off("rolling_incline", [(0, a / 2), (7, a), (11, a / mpf(0.1))], (), [(0, 1), (10, 10)])


def spin_impact() -> float:
    t = mp.sqrt(2 * (mpf(0.6) - mpf(0.1)) / G)
    slip = 1 + mpf(0.1) * 5
    v, w = 1 - 2 * slip / 7, -5 + mpf(5) / 7 * slip / mpf(0.1)
    # it ends in rolling, within the cone of friction
    assert abs(v - mpf(0.1) * w) < 1e-15 and 2 * slip / 7 < 0.5 * 1.7 * G * t
    left = mpf(0.7) - t
    rise = mpf(0.7) * G * t
    end = [(0, t + v * left), (2, mpf(0.1) + rise * left - G * left**2 / 2), (9, rise - G * left), (11, w)]
    return contact_off("spin_impact", end, [t], [(10, mpf(2) / 7), (6, mpf(2) / 70)])


def slid(tilt: Any, low: Any, factor: Any) -> Any:
    """The time from rest at an angle to a lower one where θ′² = factor (cos θ₀ − cos θ); θ = θ₀ + x²."""

    def slope(x: Any) -> Any:
        half = x * x / 2
        falls = 2 * mp.sin(tilt + half) * mp.sincpi(half / mp.pi) / 2
        return 2 / mp.sqrt(factor * falls)

    return mp.quad(slope, [0, mp.sqrt(low - tilt)])


def leaving_sphere() -> float:
    tilt = mpf(0.2)
    low = mp.acos(2 * mp.cos(tilt) / 3)
    t = slid(tilt, low, 2 * G)
    v = mp.sqrt(2 * G * (mp.cos(tilt) - mp.cos(low)))
    left = 1 - t
    x = mp.sin(low) + v * mp.cos(low) * left
    z = mp.cos(low) - v * mp.sin(low) * left - G * left**2 / 2
    return contact_off("leaving_sphere", [(0, x), (2, z), (9, -v * mp.sin(low) - G * left)], [t])


def ladder() -> float:
    """At the wall by a quadrature; after it by its energy and the speed that it keeps along the floor."""
    tilt, h = mpf(0.4), mpf(1)
    low = mp.acos(2 * mp.cos(tilt) / 3)
    t = slid(tilt, low, 3 * G / (2 * h))
    along = h * mp.cos(low) * mp.sqrt(3 * G / (2 * h) * (mp.cos(tilt) - mp.cos(low)))
    scene = exam.scene("ladder")
    kept = G * h * mp.cos(tilt) - along**2 / 2

    def later(a: Any) -> Any:
        return mp.sqrt(2 * (kept - G * h * mp.cos(a)) / (h * h / 3 + (h * mp.sin(a)) ** 2))

    left = mpf(scene.duration) - t
    end = mp.acos(mpf(scene.answer[0, 2]) / h)
    # the time from leaving to the held angle is what is left
    assert abs(mp.quad(lambda a: 1 / later(a), [low, end]) - left) < 1e-14
    return contact_off("ladder", [(0, mp.sin(low) + along * left), (7, along), (11, -later(end))], [t]) / 4


def tipping_block() -> float:
    """A pendulum about its edge, from rest; the force of the edge is within the cone of friction."""
    scene = exam.scene("tipping_block")
    x, _, z = (mpf(g) for g in scene.gravity)
    g, slope = mp.hypot(x, z), mp.atan2(x, -z)
    half, tall = mpf(0.1), mpf(0.25)
    arm = mp.hypot(half, tall)
    tilt = slope - mp.atan(half / tall)
    moment = mpf(float(scene.bodies[0].inertia[1, 1])) + arm**2
    factor = 2 * g * arm / moment
    low = tilt + 2 * mp.atan2(mpf(scene.answer[0, 4]), mpf(scene.answer[0, 6]))
    assert abs(slid(tilt, low, factor) - mpf(scene.duration)) < 1e-14
    # it tips and does not slide: tan α is between b/h and μ
    assert half / tall < mp.tan(slope) < mpf(scene.contacts[0].friction)
    for step in range(33):
        lean = tilt + (low - tilt) * step / 32
        turn, square = factor / 2 * mp.sin(lean), factor * (mp.cos(tilt) - mp.cos(lean))
        side, up = mp.sin(lean - slope) * arm, mp.cos(lean - slope) * arm
        along, normal = turn * up - square * side - x, -turn * side - square * up - z
        assert normal > 0 and abs(along) < scene.contacts[0].friction * normal
    angle = low - slope
    rate = mp.sqrt(factor * (mp.cos(tilt) - mp.cos(low)))
    end = [(0, arm * mp.sin(angle)), (2, arm * mp.cos(angle)), (11, rate), (7, rate * arm * mp.cos(angle))]
    return contact_off("tipping_block", end)


def tippe_top() -> float:
    """SciPy's integrator, with multipliers in world axes; Jellett's integral; the floor always pushes."""
    from scipy.integrate import solve_ivp

    scene = exam.scene("tippe_top")
    (touch,), mass, inertia = scene.contacts, scene.bodies[0].mass, np.array(scene.bodies[0].inertia)
    up, pushes = np.array([0.0, 0.0, 1.0]), []

    def skew(v: Any) -> Any:
        return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])

    def slope(t: float, y: Any) -> Any:
        v = skew(y[3:6])
        turn = np.eye(3) + 2 * y[6] * v + 2 * v @ v
        spin, centre = turn @ y[10:], turn @ np.array(touch.point)
        arm = centre - touch.radius * up
        drag = -touch.viscosity * (y[7:10] + np.cross(spin, arm))
        heavy = turn @ inertia @ turn.T
        # unknown: acceleration, angular acceleration and force of the floor; the height of the centre stays
        system = np.zeros((7, 7))
        system[:3, :3], system[:3, 6] = mass * np.eye(3), -up
        system[3:6, 3:6], system[3:6, 6] = heavy, -np.cross(arm, up)
        system[6, :3], system[6, 3:6] = up, -(up @ skew(centre))
        about = np.cross(arm, drag) - np.cross(spin, heavy @ spin)
        turns = -up @ np.cross(spin, np.cross(spin, centre))
        found = np.linalg.solve(system, [*(drag - mass * 9.81 * up), *about, turns])
        pushes.append(found[6])
        p, q, r = y[10:]
        rate = 0.5 * np.array([[0, r, -q, p], [-r, 0, p, q], [q, -p, 0, r], [-p, -q, -r, 0]]) @ y[3:7]
        return [*y[7:10], *rate, *found[:3], *(turn.T @ found[3:6])]

    options = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-14}
    end = solve_ivp(slope, (0.0, scene.duration), scene.y0[0], **options).y[:, -1]
    assert min(pushes) > 0.0 and scene.answer[0, 2] > scene.y0[0, 2]
    worst = (np.abs(end - scene.answer[0]) / np.maximum(1.0, np.abs(scene.answer[0]))).max() / 1e-11
    jellett = scene.invariants["Jellett's integral"]
    return float(max(worst, abs(jellett(scene.answer) / jellett(scene.y0) - 1) / 1e-14))


def dry_oscillator() -> float:
    band, half = mpf(0.1) * G / 20, mp.pi / mp.sqrt(20)
    end = -(mpf(0.28) - 6 * band)
    return contact_off("dry_oscillator", [(0, end), (7, 0)], [half, 2 * half, 3 * half], [(0, -1)])


def two_balls() -> float:
    t = mpf(0.32)
    end = [(0, t), (7, 0), (13, mpf(0.52) + 1 - t), (20, 1)]
    return contact_off("two_balls", end, [t], [(0, 0), (12, 1), (6, 0), (18, 0)])


def cradle() -> float:
    gap = mpf(0.1)
    end = [(0, gap), (13, 4 * gap), (26, mpf(0.9)), (7, 0), (20, 0), (33, 1)]
    return contact_off("cradle", end, [gap, 2 * gap], [(0, 0), (12, 0), (24, 1)])


def rolling_disk() -> float:
    """A turn about the vertical and one about the axis; the centre goes round in a circle."""
    scene, _, w = start_of("rolling_disk")
    q = rotation_of(scene.y0[0, 3:7])
    turn = w[1] / q[2, 1]
    t = mpf(scene.duration)
    about = w[2] - turn * q[2, 2]
    turned = rotation([0, 0, 1], turn * t) * q * rotation([0, 0, 1], about * t)
    v = [mpf(x) for x in scene.y0[0, 7:10]]
    x = v[0] / turn * mp.sin(turn * t)
    y = v[0] / turn * (1 - mp.cos(turn * t))
    end = scene.answer[0]
    place = max(abs(float(x) - end[0]), abs(float(y) - end[1])) / (CLOSE * scene.condition)
    return max(off("rolling_disk", None, turned), place) / 3


CLOSED: dict[str, Callable[[], float]] = {
    "middle_axis": middle_axis,
    "rod": lambda: symmetric("rod"),
    "plate": lambda: symmetric("plate"),
    "separatrix": separatrix,
    "gyrostat": gyrostat,
    "ball_torque": ball_torque,
    "axial_torque": axial_torque,
    "skew_torque": skew_torque,
    "lagrange_top": lagrange_top,
    "steady_top": steady_top,
    "sleeping_top": sleeping_top,
    "kovalevskaya": kovalevskaya,
    "pendulum": pendulum,
    "double_pendulum": double_pendulum,
    "spring_bounce": spring_bounce,
    "hunt_crossley": hunt_crossley,
    "hard_bounce": hard_bounce,
    "zeno_rest": zeno_rest,
    "graze": graze,
    "incline_slip": incline_slip,
    "incline_stop": incline_stop,
    "slide_to_roll": slide_to_roll,
    "rolling_incline": rolling_incline,
    "spin_impact": spin_impact,
    "leaving_sphere": leaving_sphere,
    "ladder": ladder,
    "tipping_block": tipping_block,
    "dry_oscillator": dry_oscillator,
    "two_balls": two_balls,
    "cradle": cradle,
    "rolling_disk": rolling_disk,
    "tippe_top": tippe_top,
}


@pytest.mark.parametrize("name", NAMES)
def test_answers_held_are_those_of_closed_forms(name: str) -> None:
    assert CLOSED[name]() <= 1.0


# ------------------------------------------------------------------------------------------ audits


def step_by_step(scene: exam.ExamScene, dt: float, *, order: int = 4, sign: float = 1.0) -> Any:
    """Runge and Kutta's method, or Euler's; a mode ends with the step in which a guard falls."""
    y, mode, times = scene.y0.ravel(), scene.first, []
    count = round(scene.duration / dt)
    dt = scene.duration / count

    def rate(y: Any) -> Any:
        return sign * np.array(scene.rate(mode, 0.0, y), dtype=float)

    for n in range(count):
        before = [guard.value(0.0, y) for guard in scene.modes[mode].guards]
        if order == 1:
            y = y + dt * rate(y)
        else:
            k1 = rate(y)
            k2 = rate(y + dt / 2 * k1)
            k3 = rate(y + dt / 2 * k2)
            k4 = rate(y + dt * k3)
            y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        for was, guard in zip(before, scene.modes[mode].guards, strict=True):
            if was > 0 >= guard.value(0.0, y):
                times.append((n + 1) * dt)
                y = np.array(guard.reset(y), dtype=float) if guard.reset else y
                mode = guard.next
                break
    return y.reshape(scene.y0.shape), times


def euler(scene: exam.ExamScene, dt: float) -> Any:
    return step_by_step(scene, dt, order=1)[0]


def test_a_method_of_order_4_is_seen_as_one() -> None:
    scenes, steps = ["kovalevskaya", "pendulum", "hard_bounce"], [0.025, 0.0125, 0.00625]
    report = exam.audit(step_by_step, scenes, steps, name="rk4")
    assert report.engine == "rk4" and not report.success
    for name in ("kovalevskaya", "pendulum"):
        assert report[name].status == "agrees" and abs(report[name].orders["SO3"] - 4.0) < 0.3
        assert report[name].gradient_error < 1e-6 and "R3" not in report[name].orders
    # the same method through impacts
    bounce = report["hard_bounce"]
    assert bounce.status == "converges" and bounce.events == (3, 3) and bounce.event_error > 1e-4
    assert "contact is not located" in bounce.verdict


def test_what_is_wrong_with_an_engine_is_found() -> None:
    found = exam.audit(euler, ["middle_axis"])["middle_axis"]
    assert found.status == "converges" and round(found.orders["SO3"]) == 1
    assert found.drift["energy"] > 1e-4 and "energy grows by" in found.verdict

    def backward(scene: exam.ExamScene, dt: float) -> Any:
        return step_by_step(scene, dt, sign=-1.0)

    found = exam.audit(backward, ["rod"])["rod"]
    assert found.status == "differs" and "stays" in found.verdict and "rad from the answer" in found.verdict

    def through_the_floor(scene: exam.ExamScene, dt: float) -> Any:
        return exam.engine("scipy").until(scene, scene.first, 0.0, scene.y0.ravel(), 1e-10)[1], []

    found = exam.audit(through_the_floor, ["slide_to_roll"])["slide_to_roll"]
    assert found.status == "differs" and "0 of 1 events were located" in found.verdict

    def free_fall(scene: exam.ExamScene, dt: float) -> Any:
        y = scene.y0.copy()
        y[0, 2] += scene.duration * y[0, 9] - 9.81 * scene.duration**2 / 2
        y[0, 9] -= 9.81 * scene.duration
        return y

    # right to 3e-9 m, and wrong by 0.18 in the derivative
    found = exam.audit(free_fall, ["graze"])["graze"]
    assert found.status == "differs" and found.distance["position"] < 4e-9
    assert "the derivative by the start is off by 0." in found.verdict
    assert exam.audit(free_fall, ["graze"], gradients=False)["graze"].status == "agrees"


class Compliant:
    """An engine that moves by a law of its own, and cannot state everything."""

    name, versions = "compliant", {"compliant": "1.0"}

    def can(self, scene: exam.ExamScene) -> bool | str:
        return "it knows no friction" if any(touch.friction for touch in scene.contacts) else True

    def law(self, scene: exam.ExamScene) -> str | None:
        return "springs" if scene.contacts else None

    def default(self, scene: exam.ExamScene) -> float:
        return 0.1

    def run(self, scene: exam.ExamScene, dt: float) -> Any:
        known = exam.scene(scene.name)
        return somersault.State((0.2 + dt**2, 0.0, 0.0)) if scene.contacts else known.answer


def test_a_law_of_its_own_is_measured_by_its_own_limit() -> None:
    report = exam.audit(Compliant(), ["leaving_sphere", "incline_slip", "rod"])
    own, unasked, right = report.results
    assert own.status == "own law" and round(own.orders["R3"]) == 2 and own.distance["position"] > 1.0
    assert own.errors["position"][-1] < 1e-6 and math.isnan(own.gradient_error)
    assert own.default["position"] > own.distance["position"] - 0.2
    assert (unasked.status, unasked.verdict) == ("not asked", "it knows no friction")
    # it ignores the start
    assert right.status == "differs" and "the derivative by the start is off by 1 of itself" in right.verdict
    assert report.versions == {"somersault": somersault.__version__, "compliant": "1.0"}


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda scene: 1 / 0, "it raised ZeroDivisionError: division by zero"),
        (lambda scene: np.full(scene.y0.shape, np.nan), "it returned a state that is not finite"),
        (lambda scene: np.zeros((2, 7)), "it returned an array of shape (2, 7), and a state has (1, 13)"),
        (lambda scene: np.zeros(scene.y0.shape), "it returned a quaternion of length 0"),
        (lambda scene: "ready", "it returned a str, which is no state"),
        (lambda scene: None, "it returned an array of shape (), and a state has (1, 13)"),
        (
            lambda scene: (scene.answer, [math.nan]),
            "it returned times of events that are not finite",
        ),
    ],
)
def test_an_engine_that_fails_says_how(returned: Callable[[Any], Any], message: str) -> None:
    found = exam.audit(lambda scene, dt: returned(scene), ["rod"])["rod"]
    assert (found.status, found.verdict) == ("failed", message)


def test_states_and_events_are_taken_as_engines_have_them() -> None:
    rod, balls = exam.scene("rod"), exam.scene("two_balls")
    assert somersault.State(balls.answer[1, :3]).position[0] > 1.0
    for returned in (rod.answer, rod.answer[0], rod.answer.tolist(), (rod.answer, None), _states(rod)[0]):
        report = exam.audit(lambda scene, dt, end=returned: end, ["rod"], gradients=False)
        assert report.success, report
    report = exam.audit(lambda scene, dt: (_states(balls), [0.32]), ["two_balls"], gradients=False)
    assert report.success and report["two_balls"].events == (1, 1)
    assert report["two_balls"].event_error < 1e-15


def _states(scene: exam.ExamScene) -> list[somersault.State]:
    return [somersault.State(y[:3], y[3:7], y[7:10], angular_velocity_body=y[10:]) for y in scene.answer]


def test_a_derivative_that_fails_leaves_the_rest() -> None:
    found = exam.audit(lambda scene, dt: scene.answer, ["rod"])["rod"]
    assert found.status == "agrees" and "without a derivative: it raised InputError" in found.verdict

    class Sloped:
        def run(self, scene: exam.ExamScene, dt: float) -> Any:
            return scene.answer

        def gradient(self, scene: exam.ExamScene, dt: float) -> Any:
            return scene.gradient if scene.name == "rod" else np.zeros(3)

    report = exam.audit(Sloped(), ["rod", "plate"])
    assert report.engine == "Sloped" and report["rod"].gradient_error == 0.0
    assert "its gradient has shape (3,), and that of the scene (1, 12)" in report["plate"].verdict


def test_what_is_right_at_the_end_alone_does_not_agree() -> None:
    class Engine:
        """Right but for a factor of its derivatives and a delay of its events, in steps."""

        def __init__(self, factor: float, delay: float) -> None:
            self.factor, self.delay = factor, delay

        def run(self, scene: exam.ExamScene, dt: float) -> Any:
            return scene.answer, [t + self.delay * dt for t in scene.events]

        def gradient(self, scene: exam.ExamScene, dt: float) -> Any:
            return self.factor * scene.gradient

    def found(factor: float, delay: float) -> exam.SceneResult:
        return exam.audit(Engine(factor, delay), ["hard_bounce"])["hard_bounce"]

    # a time that is that of the end of its step is as right as such times are
    assert found(1.0, 0.0).status == found(1.0, 0.9).status == "agrees"
    assert found(1.0, 2.0).status == "differs" and "an event is off by" in found(1.0, 2.0).verdict
    wrong = found(math.nan, 0.0)
    assert wrong.status == "differs" and wrong.gradient_error == math.inf
    assert "the derivative by the start is not finite" in wrong.verdict
    assert wrong.to_dict()["gradient_error"] is None


def test_an_interrupted_audit_keeps_what_it_has() -> None:
    def engine(scene: exam.ExamScene, dt: float) -> Any:
        if scene.name == "plate":
            raise KeyboardInterrupt
        return scene.answer

    with pytest.raises(KeyboardInterrupt) as stopped:
        exam.audit(engine, ["rod", "plate", "separatrix"])
    assert [result.scene for result in stopped.value.solution.results] == ["rod"]  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", NAMES)
def test_this_library_agrees_with_the_answers(name: str) -> None:
    """Ends and events, and derivatives by the variational equations with jumps at events."""
    scene = exam.scene(name)
    steps = [scene.default_step / 2, scene.default_step / 4]
    found = exam.audit(exam.engine("somersault"), [name], steps)[name]
    if scene.by_modes_only or any(touch.law == "hunt_crossley" for touch in scene.contacts):
        assert found.status == "not asked"
    elif any(touch.law == "rigid" for touch in scene.contacts):
        # rigid contacts are stiff springs
        assert found.status == "own law" and max(found.distance.values()) < 0.1
    else:
        assert found.status == "agrees" and max(found.distance.values()) < 3e-12 * max(1.0, scene.condition)
        assert found.events in (None, (len(scene.events),) * 2)
        # a speed of 4e-4 m/s after one of 4 m/s is known to 1e-12 of itself, and divides; of trees there are
        # differences
        known = {"graze": 2e-6, "double_pendulum": 1e-8}
        assert found.gradient_error < known.get(name, 3e-11)


@pytest.mark.parametrize(
    ("name", "module"),
    [
        ("heyoka", "heyoka"),
        ("mujoco:RK4", "mujoco"),
        ("pinocchio", "pinocchio"),
        ("drake:runge_kutta5", "pydrake"),
    ],
)
def test_adapters_state_the_scenes(name: str, module: str) -> None:
    pytest.importorskip(module, reason=f"{module} is not installed (extra `bench`)")
    scenes = ["plate"] if name.startswith("drake") else ["ball_torque", "pendulum"]
    report = exam.audit(exam.engine(name), scenes, gradients=False)
    assert report.success and len(report.versions) > 1, report.table()
    if exam.engine(name).can(exam.scene("slide_to_roll")) is True and "heyoka" not in name:
        soft = exam.audit(exam.engine(name), ["slide_to_roll", "two_balls"], [0.002, 0.001])
        assert {result.status for result in soft.results} == {"own law"}
        assert max(result.distance["position"] for result in soft.results) < 0.05
    if name.startswith("drake"):
        # its point contact has the law of this scene
        found = exam.audit(exam.engine(name), ["hunt_crossley"], [2e-3, 1e-3, 5e-4])["hunt_crossley"]
        assert found.status == "agrees" and found.distance["position"] < 1e-5


def test_scipy_is_given_the_equations_and_their_events() -> None:
    report = exam.audit(exam.engine("scipy:DOP853"), "contact", [1e-9, 1e-12])
    missed = {result.scene: result.verdict for result in report.results if result.status != "agrees"}
    # a second means for the derivatives
    assert all(result.gradient_error < 1e-7 for result in report.results if result.scene not in missed)
    # it steps over both events of one, and over a short flight of the other
    assert list(missed) == ["zeno_rest", "graze"] and "0 of 2 events were located" in missed["graze"]
    assert "of 23 events were located" in missed["zeno_rest"]


# ------------------------------------------------------------------------------- scenes and reports


def test_scenes_are_immutable_and_pickled_by_their_names() -> None:
    scene = exam.scene("pendulum")
    with pytest.raises(AttributeError):
        scene.duration = 1.0  # type: ignore[misc]
    with pytest.raises(TypeError):
        scene.modes["heavy"] = scene.modes["heavy"]  # type: ignore[index]
    for values in (scene.y0, scene.answer, scene.gradient, scene.direction):
        with pytest.raises(ValueError, match="read-only"):
            values[0, 0] = 1.0
    assert pickle.loads(pickle.dumps(scene)) is scene and copy.deepcopy(scene) is scene
    varied = pickle.loads(pickle.dumps(scene.varied(1e-3)))
    assert np.array_equal(varied.y0, scene.varied(1e-3).y0) and varied.varied_by == 1e-3
    turned = 2 * math.atan2(varied.y0[0, 3], varied.y0[0, 6])
    assert abs(turned - 3.001) < 1e-14


def test_each_scene_says_what_it_is() -> None:
    for scene in exam.scenes():
        assert all((scene.asks, scene.equations, scene.source, scene.parameter, scene.title)), scene
        assert scene.condition > 0 and len(scene.start) == len(scene.bodies) == len(scene.answer)
        assert np.allclose(np.linalg.norm(scene.answer[:, 3:7], axis=1), 1.0, rtol=0, atol=1e-15)
        for what, function in scene.invariants.items():
            before, after = function(scene.y0), function(scene.answer)
            assert np.allclose(before, after, rtol=2e-14, atol=1e-15), (scene, what)


def test_a_report_is_read_by_people_and_programs(tmp_path: Path) -> None:
    report = exam.audit(step_by_step, ["rod", "two_balls"], [0.05, 0.02, 0.01], name="a <name> | of one")
    text = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert text["results"][0]["steps"] == [0.05, 0.02, 0.01] and text["results"][1]["scene"] == "two_balls"
    assert len({line.count("|") for line in report.table().splitlines()}) == 1
    page = report.to_html(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text("utf-8") == page
    assert "a &lt;name&gt;" in page and page.count("<svg") == 2 and "<script" not in page and "//" not in page
    assert repr(report) == "<ExamReport a <name> | of one: 1 converges, 1 agrees>"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: exam.scene("nothing"), "`name` must be one of middle_axis, rod"),
        (lambda: exam.scenes("rotations"), "`group` must be 'rotation' or 'contact', found 'rotations'"),
        (lambda: exam.scene("rod").varied(math.inf), "`by` must be a finite number, found inf"),
        (lambda: exam.scene("rod").varied(0.1).answer, "the scene `rod` is varied by 0.1, and has no answer"),
        (
            lambda: exam.scene("rod").rate("heavy", 0.0, [0.0] * 13),
            "`mode` must be one of free, found 'heavy'",
        ),
        (lambda: exam.scene("rod").rate("free", 0.0, [0.0] * 7), "`y` must have 13 numbers, found 7 of them"),
        (lambda: exam.scene("rod").rate("free", 0.0, 1.0), "`y` must have 13 numbers, found a float"),
        (lambda: exam.audit(euler, ["top"]), "`scenes` must be among middle_axis"),
        (
            lambda: exam.audit(euler, "rods"),
            "`scenes` must be 'rotation', 'contact' or a sequence of scenes, found 'rods'",
        ),
        (lambda: exam.audit(euler, np.array(1.0)), "`scenes` must be names, scenes or the name of a group"),
        (lambda: exam.audit(euler, ["rod"], name=np.zeros(2)), "`name` must be a text, found a ndarray"),
        (lambda: exam.audit(euler, 3), "`scenes` must be names, scenes or the name of a group, found a int"),
        (
            lambda: exam.audit(euler, [exam.scene("rod").varied(0.1)]),
            "`scenes` must have answers, and rod is varied",
        ),
        (lambda: exam.audit(euler, ["rod"], [0.1]), "`steps` must be two or more positive numbers"),
        (lambda: exam.audit(euler, ["rod"], [0.1, 0.2]), "`steps` must decrease"),
        (lambda: exam.audit(euler, ["rod"], "fine"), "`steps` must be numbers"),
        (lambda: exam.audit(euler, ["rod"], tol=0.0), "`tol` must be positive and finite, found 0.0"),
        (
            lambda: exam.audit(euler, ["rod"], [0.1, 0.05])["top"],
            "`name` must be one of the scenes of this report",
        ),
        (lambda: exam.audit(euler, [], [0.1, 0.05]).to_html("page.txt"), "`path` must end in .html or .htm"),
        (lambda: exam.engine("bullet"), "`name` must begin with one of somersault, scipy"),
        (lambda: exam.engine("scipy:RK5"), "`name` must be scipy: and one of DOP853"),
        (lambda: exam.engine("somersault:rk5"), "rk5"),
    ],
)
def test_what_is_not_allowed_is_named(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    assert message in str(caught.value)


def test_what_is_no_engine_is_refused() -> None:
    with pytest.raises(TypeError, match="`engine` must be callable or have a method `run`, found a int"):
        exam.audit(3)


def test_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ModuleNotFoundError, match="this engine needs mujoco: pip install mujoco"):
        exam.engine("mujoco")
    assert main(["exam", "--engine", "mujoco", "--scene", "rod"]) == 3


def test_the_package_is_imported_without_others() -> None:
    program = "import somersault, sys; somersault.exam.scenes(); print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"scipy", "mpmath", "matplotlib"} & set(found.stdout.split())


def test_the_command_prints_tables_and_writes_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "made" / "exam.html"
    arguments = ["exam", "--scene", "rod", "--no-gradients"]
    assert main([*arguments, "--engine", "somersault:rkmk", "--engine", "scipy", "--out", str(page)]) == 0
    printed = capsys.readouterr().out
    assert "## somersault:rkmk" in printed and "## scipy:DOP853" in printed and "| rod | agrees |" in printed
    assert page.read_text("utf-8").count("<h2>") == 2
    assert main([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["results"][0]["status"] == "agrees"
    assert main(["exam", "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == NAMES
    for wrong in (["--scene", "top"], ["--engine", "bullet"], ["--out", str(tmp_path / "page.txt")]):
        assert main(["exam", *wrong]) == 2
