"""Trees that touch: a leg that hops on compliant ground with friction."""

from __future__ import annotations

import time
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from somersault import contact, multibody, viewer
from tour.measurements import Measurements
from tour.page import Page, error_size, number, power, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLE = "Trees that touch: a leg that hops"

#: Two hops, s.
_DURATION = 0.6
#: Until the leg has left the ground again, s.
_JUMP = 0.3
_METHODS = ("rkmk", "rkmk5", "rkmk8")
_KINDS = {
    "touch_down": "touch-down",
    "release": "release",
    "re_engagement": "re-engagement",
    "stick": "sticks",
    "slip": "slips",
}


def _hop(leg: contact.TreeContactSystem, **options: Any) -> multibody.TreeSolution:
    return multibody.integrate_tree(
        leg.model, leg.q, leg.v, (0.0, _DURATION), torque=leg.torque, contacts=leg.contacts, **options
    )


def _history(hop: multibody.TreeSolution) -> Axes:
    """Height of the foot, and forces of the ground, over time."""
    import matplotlib.pyplot as plt

    axes: Any = plt.figure(figsize=(6.4, 5.0), layout="constrained").subplots(2, 1, sharex=True)
    gaps, forces = hop.gaps, hop.contact_forces
    assert gaps is not None and forces is not None
    axes[0].plot(hop.t, 1e3 * gaps[:, 0], color="#332288", lw=1.4)
    axes[0].axhline(0.0, color="0.6", lw=0.8)
    axes[0].set_ylabel("height of the foot, mm")
    axes[1].plot(hop.t, forces[:, 0, 2], color="#117733", lw=1.4)
    axes[1].plot(hop.t, forces[:, 0, 0], color="#CC6677", lw=1.4)
    axes[1].set(ylabel="force of the ground, N", xlabel="time, s")
    peak = int(np.argmax(forces[:, 0, 2]))
    axes[1].annotate("normal", (hop.t[peak], forces[peak, 0, 2]), (6, -4), textcoords="offset points")
    low = int(np.argmin(forces[:, 0, 0]))
    axes[1].annotate("friction", (hop.t[low], forces[low, 0, 0]), (6, -4), textcoords="offset points")
    for event in hop.events:
        if event.kind in ("stick", "slip"):
            axes[1].axvline(event.t, color="0.85", lw=0.8, zorder=0)
    drawn: Axes = axes[0]
    return drawn


def _errors(leg: contact.TreeContactSystem, steps: list[float]) -> tuple[dict[str, list[float]], float]:
    """Errors of the end by method and step, and the change of the reference where its step is halved."""
    ends = [_hop(leg, method="rkmk8", dt=dt) for dt in (1.25e-4, 6.25e-5)]
    end = np.concatenate([ends[1].q[-1], ends[1].v[-1]])
    shift = float(np.abs(np.concatenate([ends[0].q[-1], ends[0].v[-1]]) - end).max())

    def error(method: str, dt: float) -> float:
        found = _hop(leg, method=method, dt=dt)
        return float(np.abs(np.concatenate([found.q[-1], found.v[-1]]) - end).max())

    return {method: [error(method, dt) for dt in steps] for method in _METHODS}, shift


def _order(steps: list[float], errors: list[float], floor: float) -> float:
    """The median of the orders between steps whose errors are above the floor."""
    pairs = zip(pairwise(steps), pairwise(errors), strict=True)
    slopes = [float(np.log(e / f) / np.log(h / k)) for (h, k), (e, f) in pairs if f > floor]
    return float(np.median(slopes)) if slopes else float("nan")


def _differentiated(leg: contact.TreeContactSystem, count: int) -> tuple[list[float], Any, Any]:
    """Seconds of a run, of the adjoint and of columns; the derivatives of the height by a torque at knots."""
    times = np.linspace(0.0, _JUMP, count)
    profile = multibody.TorqueProfile(times, [leg.torque(t, leg.q, leg.v) for t in times])
    start = (leg.model, leg.q, leg.v, (0.0, _JUMP))
    given: dict[str, Any] = {"dt": 1e-3, "method": "rkmk8", "contacts": leg.contacts, "torque": profile}
    by: list[Any] = [("torque", 4, profile)]

    def height(q: Any, _: Any) -> tuple[float, Any, None]:
        # the velocity of the body is in its own axes
        return q[1], np.array([np.sin(q[2]), np.cos(q[2]), 0.0, 0.0, 0.0]), None

    clock = [time.perf_counter()]
    run = multibody.integrate_tree(*start, **given)
    clock.append(time.perf_counter())
    adjoint = contact.gradient_tree(*start, height, parameters=by, **given).by_parameters
    clock.append(time.perf_counter())
    columns = contact.differentiate_tree(*start, parameters=by, **given)
    clock.append(time.perf_counter())
    _, up, _ = height(run.q[-1], None)
    return list(np.diff(clock)), np.asarray(adjoint), up @ columns.by_parameters[:5]


def _worth(gradient: Any, stances: list[tuple[float, float]]) -> Axes:
    """What each knot of the torque does to the height at the end."""
    import matplotlib.pyplot as plt

    axes: Axes = plt.figure(figsize=(6.4, 3.2), layout="constrained").subplots()
    for begin, end in stances:
        axes.axvspan(begin, end, color="0.9", lw=0)
        axes.annotate(
            "on the ground", (begin, 0.96), (3, 0), ("data", "axes fraction"), "offset points", va="top"
        )
    axes.plot(np.linspace(0.0, _JUMP, len(gradient)), 1e3 * gradient, color="#332288", lw=1.4)
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.set(xlabel="time of the torque, s", ylabel="height of the body,\nmm for 1 N m")
    return axes


def _gradients(
    page: Page, leg: contact.TreeContactSystem, hop: multibody.TreeSolution, knots: list[int]
) -> None:
    """Derivatives through touch-downs, by columns and by the adjoint."""
    found = {count: _differentiated(leg, count) for count in knots}
    page.section("Gradients through the stances")
    page.text(
        "The height of the body after the first stance depends on the torque of the knee at every time. The"
        " adjoint passes back through steps and events once, whatever the number of parameters; columns carry"
        " one derivative for each of them. Both are the same numbers to rounding."
    )
    page.code(
        "profile = multibody.TorqueProfile(times, torques)\n"
        'contact.gradient_tree(leg.model, leg.q, leg.v, (0.0, 0.3), height, dt=1e-3, method="rkmk8",\n'
        '                      contacts=leg.contacts, torque=profile, parameters=[("torque", 4, profile)])'
    )
    page.table(
        ("knots", "adjoint, runs", "columns, runs", "largest difference"),
        [
            [
                str(count),
                number(seconds[1] / seconds[0], 1),
                number(seconds[2] / seconds[0], 1),
                error_size(float(np.abs(adjoint - columns).max() / np.abs(columns).max())),
            ]
            for count, (seconds, adjoint, columns) in found.items()
        ],
        "Time of the gradient over that of a run by <code>rkmk8</code> in steps of 1 ms, and the difference"
        " relative to the largest derivative.",
    )
    downs = [event.t for event in hop.events if event.kind == "touch_down" and event.t < _JUMP]
    ups = [event.t for event in hop.events if event.kind == "release"]
    stances = [(t, min([up for up in ups if up > t], default=_JUMP)) for t in downs]
    page.figure(
        "leg-gradient",
        _worth(found[knots[-1]][1], stances),
        f"What 1 N m at one of {knots[-1]} knots, which fades to its neighbours, adds to the height of the"
        f" body after {_JUMP:g} s.",
        "A curve over time that falls to zero at the end, with the stance shaded",
    )


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    leg = contact.hopping_leg()
    steps = [1e-3, 7e-4] if measurements.setting.repeats == 1 else [1e-3, 7e-4, 5e-4, 3.5e-4]
    errors, shift = _errors(leg, steps)
    began = time.perf_counter()
    hop = _hop(leg, method="rkmk8", rtol=1e-9, atol=1e-11)
    seconds = time.perf_counter() - began
    kinds = [event.kind for event in hop.events]
    stances, switches = kinds.count("touch_down"), kinds.count("stick") + kinds.count("slip")
    orders = {method: _order(steps, found, 3 * shift) for method, found in errors.items()}
    page.lead(
        f"A planar leg touches the ground {stances} times in {_DURATION:g} s, and its foot changes"
        f" {switches} times between sticking and sliding. Each of these events ends a step, so that"
        f" <code>rkmk</code> shows order {number(orders['rkmk'], 1)} and <code>rkmk8</code>"
        f" {number(orders['rkmk8'], 1)} through all of them."
    )
    page.text(
        "Any link of a tree may touch: with points, balls and rims on planes, spheres, cylinders and"
        " user-defined surfaces, and with balls on each other. Laws of contact, events and methods are those"
        " of single bodies; that no contact is missed follows from a bound on the speed of each point of"
        " contact, made from the rates of the joints. The leg has a body of 5 kg, a thigh and a shank of"
        " 0.3 m each, and torques at hip and knee that vary like sines."
    )
    page.code(
        "from somersault import contact, multibody\n\n"
        "leg = contact.hopping_leg()\n"
        'hop = multibody.integrate_tree(leg.model, leg.q, leg.v, (0.0, 0.6), method="rkmk8", rtol=1e-9,\n'
        "                               torque=leg.torque, contacts=leg.contacts)\n"
        "hop.events, hop.contact_forces, hop.gaps"
    )
    foot = leg.contacts[0].contact.point
    shapes = {
        "body": viewer.Ellipsoid((0.12, 0.05, 0.08)),
        "thigh": viewer.Capsule((0.0, 0.0, 0.0), foot, 0.02),
        "shank": viewer.Capsule((0.0, 0.0, 0.0), foot, 0.015),
    }
    scene = viewer.Scene("A leg that hops").camera("side").play(0.25, arrows=("contact_force",))
    scene.add(hop, shapes=shapes).write(page.folder / "leg.html")
    page.add(
        '<iframe src="leg.html" title="Animation of the hopping leg" loading="lazy" '
        'style="width:100%;height:28em;border:1px solid #ddd"></iframe>'
        '<p class="caption">Slowed down; <a href="leg.html">on a page of its own</a>.</p>'
    )
    page.section("When it touches, sticks and slides")
    page.table(
        (words("event"), "t, s", "normal force, N", "impulse, N s", "sliding, m/s"),
        [
            [
                words(_KINDS[event.kind]),
                f"{event.t:.9f}",
                f"{event.force[2]:,.1f}",
                "–" if event.impulse == 0 else number(event.impulse, 4),
                number(float(np.linalg.norm(event.sliding)), 4),
            ]
            for event in hop.events
        ],
        f"All {len(hop.events)} events, by <code>rkmk8</code> with steps adapted to a tolerance of"
        f" {power(1e-9)}: {hop.n_steps} steps, {1e3 * seconds:.0f} ms.",
    )
    page.figure(
        "leg-history",
        _history(hop),
        "Height of the foot, and the force of the ground on it. Grey lines are changes between sticking and"
        " sliding, at which friction has a kink.",
        "Two panels over time: the height of a foot that touches down three times, and pulses of force",
    )
    page.section("Orders")
    page.table(
        (words("method"), *(f"h = {1e3 * dt:g} ms" for dt in steps), words("order")),
        [
            [words(method), *(error_size(error) for error in errors[method]), number(orders[method], 1)]
            for method in _METHODS
        ],
        f"Largest error of the state after {_DURATION:g} s, m, rad and their rates, and the median of the"
        f" orders between steps. The reference changes by {error_size(shift)} where its step is halved;"
        " errors below three times that are not used.",
    )
    _gradients(page, leg, hop, [10, 40] if measurements.setting.repeats == 1 else [10, 40, 160])
