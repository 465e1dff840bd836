"""A satellite: rotors, a wheel that turns it, and the gradient of gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

import somersault
from somersault import RigidBody, State, exact, forces, plotting
from somersault.plotting.palette import AXES
from tour.measurements import Measurements
from tour.page import Cell, Page, error_size, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLE = "A satellite: wheels, rotors and the pull of the Earth"

Array = NDArray[np.float64]

#: Sides of the satellite, m, and its moments of inertia, kg m².
_SIDES, _MOMENTS = (0.34, 0.25, 0.2), (0.102, 0.1556, 0.1782)
#: Inertia of the wheel, kg m², duration of the turn, s, and its angle.
_WHEEL, _DURATION, _TURN = 0.05, 20.0, 0.5 * np.pi
#: Radius of the orbit, m.
_ORBIT = 6.778e6
#: Amplitudes of the pendulum in the gradient of gravity, degrees.
_AMPLITUDES = (1.0, 20.0, 60.0)


@dataclass(frozen=True)
class _Turned:
    """The satellite that its wheel has turned."""

    wheels: forces.ReactionWheels
    motion: somersault.Solution
    #: Angle turned, rad, the momentum of the bus and that of the wheel about its axis, N m s.
    angle: Array
    bus: Array
    wheel: Array
    #: Angle of the wheel in the bus, rad.
    wheel_angle: Array

    @property
    def imbalance(self) -> float:
        """The largest total angular momentum, which was zero, relative to the largest of the wheel."""
        total = self.motion.angular_momentum + self.motion.orientation.apply(
            self.wheels.momentum(self.motion.t)
        )
        return float(np.abs(total).max() / np.abs(self.wheel).max())


def _turned() -> _Turned:
    """A turn by a quarter in which the wheel is driven up and braked again."""
    moments = np.array(_MOMENTS)
    # ∫∫ of a torque that rises to its largest and falls again in each half is (largest) T²/8
    largest = 8.0 * _TURN * moments[2] / _DURATION**2
    wheels = forces.ReactionWheels(
        axes=[(0, 0, 1)],
        inertias=_WHEEL,
        torques=[[0.0], [-largest], [0.0], [largest], [0.0]],
        times=np.linspace(0.0, _DURATION, 5),
        body=RigidBody(12.0, moments + np.array([0.0, 0.0, _WHEEL])),
    )
    carrier = wheels.carrier
    assert carrier is not None
    motion = somersault.integrate(carrier, State(), (0.0, _DURATION), dt=0.1, method="rkmk8_b", forces=wheels)
    wheel = np.asarray(wheels.momentum(motion.t))[:, 2]
    angle = np.unwrap(motion.orientation.as_rotvec()[:, 2])
    # its momentum is that of its speed relative to the world
    rate = wheel / _WHEEL - motion.angular_velocity_body[:, 2]
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(motion.t)
    spun = np.concatenate([[0.0], np.cumsum(steps)])
    return _Turned(wheels, motion, angle, motion.angular_momentum[:, 2], wheel, spun)


def _plane(angle: float) -> Array:
    """The rotation of the plane by an angle."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _turn(found: _Turned) -> Axes:
    """The satellite from above at five times, and the angular momentum that passes to its wheel and back."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import Circle, Polygon

    figure = plt.figure(figsize=(6.4, 5.2), layout="constrained")
    places: Any = figure.add_gridspec(2, 5, height_ratios=(1.0, 2.2))
    corners = 0.5 * np.array(_SIDES[:2]) * [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    for k, t in enumerate(np.linspace(0.0, _DURATION, 5)):
        scene = figure.add_subplot(places[0, k])
        at = int(np.argmin(abs(found.motion.t - t)))
        body = _plane(found.angle[at])
        mark = _plane(found.angle[at] + found.wheel_angle[at]) @ [0.095, 0.0]
        scene.add_patch(Polygon(corners @ body.T, fc="#88CCEE", ec="0.25"))
        scene.add_patch(Circle((0.0, 0.0), 0.1, fc="#DDCC77", ec="0.25"))
        scene.plot([0.0, mark[0]], [0.0, mark[1]], color="#882255", lw=2.5)
        scene.plot(*(body @ [0.155, 0.0]), "o", color="#CC6677", ms=6)
        scene.set(xlim=(-0.22, 0.22), ylim=(-0.22, 0.22))
        scene.set_aspect("equal")
        scene.set_axis_off()
        scene.set_title(f"{t:g} s: {np.degrees(found.angle[at]):.0f}°", fontsize="medium")
    ax: Axes = figure.add_subplot(places[1, :])
    for values, name, colour in (
        (found.bus, "satellite", "#4477AA"),
        (found.wheel, "wheel", "#AA8800"),
        (found.bus + found.wheel, "both", "0.3"),
    ):
        ax.plot(found.motion.t, 1e3 * values, color=colour, label=name, lw=1.8)
    ax.set(xlabel="time, s", ylabel="angular momentum\nabout the axis of the wheel, mN m s")
    ax.grid(color="0.92")
    ax.margins(x=0)
    plotting.label_ends(ax)
    return ax


def _held(body: RigidBody, rotor: float) -> somersault.Trajectory:
    """The exact motion about the middle axis, with a rotor along it, for a minute."""
    start = State(angular_velocity_body=(0.02, 1.0, 0.01))
    gyrostat = exact.Gyrostat(body, rotors=(0.0, rotor, 0.0), state=start)
    motion: somersault.Trajectory = gyrostat(np.linspace(0.0, 60.0, 1201))
    return motion


def _spins(motions: dict[str, somersault.Trajectory]) -> Axes:
    """Angular velocities in the body, without and with a rotor."""
    import matplotlib.pyplot as plt

    axes = plt.figure(figsize=(6.4, 5.0), layout="constrained").subplots(2, 1, sharex=True, sharey=True)
    names = ("long axis", "middle axis", "short axis")
    for ax, (title, motion) in zip(axes, motions.items(), strict=True):
        for k, (name, colour) in enumerate(zip(names, AXES, strict=True)):
            ax.plot(motion.t, motion.angular_velocity_body[:, k], color=colour, label=name)
        ax.set_title(title, loc="left", fontsize="medium")
        ax.set_ylabel("spin in the\nbody, rad/s")
        ax.grid(color="0.92")
        ax.margins(x=0)
        plotting.label_ends(ax)
    axes[1].set_xlabel("time, s")
    drawn: Axes = axes[0]
    return drawn


def _in_gradient(orbit: forces.Orbit, angle: float, turns: float, along: float = 0.0) -> somersault.Solution:
    """The motion from an angle off the direction to the Earth, with the long axis turned `along` the path."""

    def pitch(t: float, state: State) -> float:
        """The sine of the angle from the vertical to the long axis, about the normal of the orbit."""
        return float((orbit.frame(t).inv() * state.orientation).as_matrix()[1, 0])

    frame = orbit.frame(0.0)
    start = State(
        orientation=frame * Rotation.from_rotvec([0.0, 0.0, along + angle]),
        angular_velocity=frame.apply((0.0, 0.0, orbit.mean_motion)),
    )
    return somersault.integrate(
        RigidBody(12.0, _MOMENTS),
        start,
        (0.0, turns * orbit.period),
        rtol=1e-11,
        atol=1e-13,
        forces=forces.GravityGradient(orbit),
        events=pitch,
        dense_output=True,
    )


def _period(angle: float) -> float:
    """The period of the pendulum of that amplitude, in periods of the orbit."""
    least, middle, most = _MOMENTS
    return float(2.0 * ellipk(np.sin(angle) ** 2) / (np.pi * np.sqrt(3.0 * (middle - least) / most)))


def _around(orbit: forces.Orbit, motions: dict[str, somersault.Solution]) -> Axes:
    """The satellite on its orbit as a bar, not to scale."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import Circle

    axes = plt.figure(figsize=(6.4, 3.7), layout="constrained").subplots(1, 2)
    for ax, (title, motion) in zip(axes, motions.items(), strict=True):
        ax.add_patch(Circle((0, 0), 0.45, fc="#BBCCEE", ec="0.4"))
        ax.text(0, 0, "Earth", ha="center", va="center")
        ax.add_patch(Circle((0, 0), 1.0, fc="none", ec="0.75", ls=":"))
        frame = orbit.frame(0.0)
        assert motion.sol is not None
        for t in np.linspace(0.0, orbit.period, 25)[:-1]:
            place = frame.inv().apply(orbit.frame(float(t)).apply((1.0, 0.0, 0.0)))[:2]
            turn = frame.inv() * motion.sol(float(t)).orientation
            tip = 0.15 * turn.apply((1.0, 0.0, 0.0))[:2]
            ax.plot(*np.array([place - tip, place + tip]).T, color="#332288", lw=3.5, solid_capstyle="round")
            ax.plot(*(place + tip), "o", color="#CC6677", ms=5)
        ax.set_aspect("equal")
        ax.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25))
        ax.set_axis_off()
        ax.set_title(title, fontsize="medium")
    drawn: Axes = axes[0]
    return drawn


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    found, body = _turned(), RigidBody(12.0, _MOMENTS)
    free, held = _held(body, 0.0), _held(body, 0.15)
    page.lead(
        f"A wheel turns a satellite by {np.degrees(found.angle[-1]):.4f}° and stops it; the angular momentum"
        f" of both stays zero to {error_size(found.imbalance)} of the wheel's. A rotor makes the"
        " rotation about the middle axis stable, and the gradient of gravity keeps a long axis towards the"
        " Earth."
    )
    page.section("A wheel turns the satellite")
    page.figure(
        "satellite-turn",
        _turn(found),
        "From above. Nothing outside acts. A motor drives the wheel (yellow, with a mark) one way for ten"
        " seconds and brakes it for ten; the satellite turns the other way and rests again. The angular"
        " momentum that one gains the other loses.",
        "Five boxes with a wheel, turned by up to a quarter, and two mirrored curves over time",
    )
    page.code(
        "wheels = forces.ReactionWheels(\n"
        "    axes=[(0, 0, 1)], inertias=0.05, torques=torques, times=times, body=body)\n"
        "motion = somersault.integrate(wheels.carrier, State(), (0, 20), dt=0.1, forces=wheels)\n"
    )
    page.section("A rotor holds the middle axis")
    page.figure(
        "satellite-rotor",
        _spins({"no rotor: it flips": free, "a rotor of 0.15 N m s along the middle axis: it is held": held}),
        "The same satellite spins about its middle axis at 1 rad/s, a little off. The motions are exact: with"
        " rotors of constant speed a body is a gyrostat, whose motion is known in elliptic functions"
        " (<code>exact.Gyrostat</code>).",
        "Above, the spin about the middle axis changes its sign again and again; below, it stays near one",
    )
    _agreement(page, body)
    _gradient(page)


def _agreement(page: Page, body: RigidBody) -> None:
    """The gyrostat against an integration of its equations, which uses no elliptic functions."""
    rows: list[list[str | Cell]] = []
    start = State(angular_velocity_body=(0.02, 1.0, 0.01))
    for rotor in (0.0, 0.05, 0.15):
        gyrostat = exact.Gyrostat(body, rotors=(0.0, rotor, 0.0), state=start)

        def torque(t: float, state: State, rotor: float = rotor) -> tuple[tuple[float, ...], Array]:
            momentum = state.orientation.apply((0.0, rotor, 0.0))
            return (0.0, 0.0, 0.0), np.cross(momentum, state.angular_velocity)

        run = somersault.integrate(
            body, start, (0.0, 60.0), dt=0.1, method="rkmk8_b", forces=torque, every=200
        )
        away = (gyrostat(run.t[1:]).orientation.inv() * run.orientation[1:]).magnitude()
        least = _held(body, rotor).angular_velocity_body[:, 1].min()
        rows.append([number(rotor), number(float(least)), *(error_size(float(angle)) for angle in away)])
    page.table(
        ("rotor, N m s", "least spin, rad/s", *(f"after {t} s, rad" for t in (20, 40, 60))),
        rows,
        "The least spin about the middle axis in a minute, and the angle between the exact orientation and"
        " that of <code>rkmk8_b</code>, with steps of 0.1 s and the torque of the rotor.",
    )


def _gradient(page: Page) -> None:
    """A pendulum in the gradient of gravity."""
    orbit = forces.Orbit(_ORBIT)
    page.section("The Earth pulls at the near end more")
    page.figure(
        "satellite-gradient",
        _around(
            orbit,
            {
                "long axis to the Earth, 20° off:\nit swings and stays": _in_gradient(
                    orbit, np.radians(20), 1.0
                ),
                "long axis along the path, 20° off:\nit is turned over": _in_gradient(
                    orbit, np.radians(20), 1.0, 0.5 * np.pi
                ),
            },
        ),
        "One orbit, anticlockwise from the right; the bar is the long axis, with a red end. Neither the"
        " satellite nor the orbit is to scale.",
        "Two orbits around the Earth with bars: on the left they point to it, on the right they turn over",
    )
    rows: list[list[str | Cell]] = []
    for degrees in _AMPLITUDES:
        motion = _in_gradient(orbit, np.radians(degrees), 4.0)
        assert motion.t_events is not None
        crossings = motion.t_events[0] / orbit.period
        measured = 2.0 * float(np.mean(np.diff(crossings)))
        expected = _period(np.radians(degrees))
        rows.append(
            [
                f"{degrees:g}",
                number(measured, 9),
                number(expected, 9),
                error_size(abs(measured / expected - 1.0)),
            ]
        )
    page.table(
        ("amplitude, °", "period measured, orbits", "period of the pendulum", "relative difference"),
        rows,
        "In the plane of a circular orbit the long axis is a pendulum, θ″ = −(3/2) n² (I₂ − I₁)/I₃ sin 2θ,"
        " whose period 4 K(sin θ₀)/ω, ω = n √(3 (I₂ − I₁)/I₃), is a complete elliptic integral. The measured"
        " one is from the zeros of the angle, which <code>events=</code> locates.",
    )
