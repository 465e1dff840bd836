"""Engines that can be examined: this library, and other packages where they are installed."""

from __future__ import annotations

import importlib
import importlib.metadata
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from somersault import contact, forces, multibody
from somersault._somersault.integrators import RigidBody, State, integrate, method
from somersault.errors import InputError
from somersault.exam.catalogue import ExamScene, SceneContact

__all__ = ["engine", "engines"]

Array = NDArray[np.float64]
#: The state at the end and the times of events.
Ended = tuple[Any, "Sequence[float] | None"]

#: Why an engine that makes contacts of bodies is not asked.
_BY_MODES = "its constraint is stated by equations alone"
_BY_HINGES = "hinges are not stated by this adapter"
_UNUSUAL = "points off the centre of mass and viscous friction are not stated by this adapter"
#: Stiffness of the contacts that stand for rigid ones, N/m.
_STIFF = 1e6


def engines() -> tuple[str, ...]:
    """The names of the engines that `engine` makes; after a colon stands a method, one of several.

    Examples
    --------
    >>> from somersault import exam
    >>> exam.engines()[:2]
    ('somersault', 'scipy')
    """
    return tuple(_MAKERS)


def engine(name: str) -> Any:
    """An engine that `audit` examines.

    ``'somersault'`` is this library with `rkmk8`, ``'somersault:rkmk'`` the same with another method of the
    table; ``'scipy:DOP853'`` is `scipy.integrate.solve_ivp` with a method of it, which gets the equations and
    locates their events; ``'heyoka'`` has Taylor series of the same equations; ``'mujoco:RK4'`` MuJoCo with
    one of its integrators; ``'pinocchio:DOP853'`` Pinocchio's dynamics integrated by SciPy;
    ``'drake:runge_kutta3'`` Drake with one of its integrators, or ``'drake:discrete'``.

    Parameters
    ----------
    name : str
        A name of `engines`, and a method after a colon where it has some.

    Returns
    -------
    object
        What `audit` takes: it has `name`, `versions`, `can` and `run`.

    Raises
    ------
    InputError
        If there is no such engine or method.
    ModuleNotFoundError
        If the package is not installed; the message says how to install it.

    Examples
    --------
    >>> from somersault import exam
    >>> exam.engine("somersault:rkmk5")
    <exam.engine somersault:rkmk5>
    """
    if not isinstance(name, str):
        raise InputError(f"`name` must be text, found a {type(name).__name__}")
    kind, _, variant = name.partition(":")
    if kind not in _MAKERS:
        raise InputError(f"`name` must begin with one of {', '.join(_MAKERS)}; found {name!r:.60}")
    return _MAKERS[kind](variant)


class _Engine:
    """What all have: a name, and the versions of their packages."""

    def __init__(self, name: str, *packages: str) -> None:
        self.name = name
        self.versions = {package: importlib.metadata.version(package) for package in packages}

    def can(self, scene: ExamScene) -> bool | str:
        return True

    def __repr__(self) -> str:
        return f"<exam.engine {self.name}>"


def _package(module: str, install: str) -> Any:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as fault:
        raise ModuleNotFoundError(
            f"this engine needs {install}: pip install {install}", name=module
        ) from fault


def _one_of(kind: str, variant: str, allowed: Sequence[str]) -> str:
    """The method after the colon; the first one unless given."""
    variant = variant or allowed[0]
    known = {each.lower(): each for each in allowed}
    if variant.lower() not in known:
        raise InputError(f"`name` must be {kind}: and one of {', '.join(allowed)}; found {variant!r:.60}")
    return known[variant.lower()]


# ------------------------------------------------------------------------------------------ this library


class _Somersault(_Engine):
    def __init__(self, variant: str) -> None:
        self.info = method(variant or "rkmk8")
        super().__init__(f"somersault:{self.info.name}" if variant else "somersault")

    def can(self, scene: ExamScene) -> bool | str:
        if scene.by_modes_only:
            return _BY_MODES
        if self.info.scope == "torque-free" and (
            scene.contacts or scene.pivot or any(scene.torque) or any(scene.rotors)
        ):
            return "the method is for bodies without torque"
        if self.info.scope == "forces with series" and (
            any(scene.rotors) or any(self._has_no_series(touch) for touch in scene.contacts)
        ):
            return "the method is for forces whose Taylor series are known"
        if scene.hinges and self.info.scope != "any system":
            return "the method is for rigid bodies, and not for trees"
        if any(touch.law == "hunt_crossley" for touch in scene.contacts):
            return "its law of Hunt and Crossley is another one, with the power 3/2 of Hertz"
        return True

    def _has_no_series(self, touch: SceneContact) -> bool:
        """Whether a contact is rough, curved or of two bodies."""
        return bool(touch.friction or touch.viscosity) or touch.surface in ("sphere", "body")

    def law(self, scene: ExamScene) -> str | None:
        if any(touch.law == "rigid" for touch in scene.contacts):
            return f"springs of {_STIFF:g} N/m in contacts"
        return None

    def run(self, scene: ExamScene, dt: float) -> Ended:
        if scene.hinges:
            return self._run_tree(scene, dt), None
        states, acting, touches, pairs = self._posed(scene)
        several = len(states) > 1
        found = integrate(
            list(scene.bodies) if several else scene.bodies[0],
            states if several else states[0],
            (0.0, scene.duration),
            dt=dt,
            method=self.info,
            forces=acting or None,
            contacts=touches or None,
            pairs=pairs or None,
            every=10**9,
        )
        if not found.success:
            raise ArithmeticError(found.message)
        end = found[len(found) - 1]
        return end, None if self.law(scene) else [event.t for event in found.events]

    def _run_tree(self, scene: ExamScene, dt: float) -> Array:
        """Bodies on hinges are a tree."""
        links = [
            multibody.Link(
                f"body {hinge.body}",
                "revolute",
                parent=None if hinge.parent is None else f"body {hinge.parent}",
                axis=hinge.axis,
                body=scene.bodies[hinge.body],
                center=hinge.arm,
                origin=origin,
            )
            for hinge, origin in zip(scene.hinges, _origins(scene), strict=True)
        ]
        tree = multibody.Model(links, gravity=scene.gravity)
        angles, rates = _on_hinges(scene)
        found = multibody.integrate_tree(
            tree, angles, rates, (0.0, scene.duration), dt=dt, method=self.info, every=10**9
        )
        if not found.success:
            raise ArithmeticError(found.message)
        return _off_hinges(scene, found.q[-1], found.v[-1])

    def gradient(self, scene: ExamScene, dt: float) -> Array | None:
        """By the variational equations, with jumps at events, where the method has them."""
        if self.info.scope != "any system" or len(scene.bodies) > 1:
            return None
        (state,), acting, touches, _ = self._posed(scene)
        found = contact.differentiate(
            scene.bodies[0],
            state,
            (0.0, scene.duration),
            dt=dt,
            method=self.info,
            forces=acting or None,
            contacts=touches,
        )
        start = _in_world(state, scene.direction[0])
        return _in_body(found.state, found.by_state @ start)[None, :]

    def _posed(self, scene: ExamScene) -> tuple[list[State], list[Any], list[Any], list[Any]]:
        """States at the start, forces, contacts and pairs."""
        states = list(scene.start)
        acting: list[Any] = []
        mass = scene.bodies[0].mass
        weight = mass * np.array(scene.gravity)
        if any(scene.torque):
            acting.append(forces.Torque(scene.torque, frame="body"))
        if any(scene.rotors):
            acting.append(forces.ReactionWheels([scene.rotors], 0.0, float(np.linalg.norm(scene.rotors))))
        if scene.pivot is not None:
            # the weight at the centre of mass, and its opposite at the fixed point
            acting += [forces.Force(weight, point=scene.pivot), forces.Force(-weight)]
        elif any(scene.gravity):
            acting.append(forces.Gravity(scene.gravity))
        touches, pairs = [], []
        for touch in scene.contacts:
            if touch.surface == "body":
                law, _ = self._laws(touch, mass / 2)
                others = (touch.body, int(touch.place))
                pairs.append(contact.SpherePair(others, (touch.radius, touch.radius), law))
                continue
            law, friction = self._laws(touch, mass)
            if touch.law == "rigid" and touch.restitution == 0.0 and touch.surface == "floor":
                # at the height at which the spring carries the weight
                states[touch.body] = _raised(states[touch.body], weight[2] / _STIFF)
            touches.append(
                contact.Contact.ball(touch.point, touch.radius, _surface(touch), law, friction=friction)
                if touch.radius
                else contact.Contact(touch.point, _surface(touch), law, friction=friction)
            )
        if scene.spring:
            anchor = (0.0, 0.0, float(states[0].position[2]))
            acting.append(forces.Spring(scene.spring, anchor))
        return states, acting, touches, pairs

    def _laws(self, touch: SceneContact, mass: float) -> tuple[Any, Any]:
        if touch.law == "spring":
            return contact.CompliantLaw(touch.stiffness, touch.damping), None
        critical = 2 * math.sqrt(_STIFF * mass)
        law = (
            contact.CompliantLaw.from_restitution(mass, _STIFF, touch.restitution)
            if touch.restitution
            else contact.CompliantLaw(_STIFF, critical)
        )
        # an impact ends before a spring along the surface has swung back; a damper alone lets nothing swing
        stiffness = 0.0 if touch.restitution else _STIFF
        if touch.viscosity:
            # a cone so wide that the damper alone acts
            return law, contact.CoulombFriction(1e6, 0.0, touch.viscosity)
        friction = contact.CoulombFriction(touch.friction, stiffness, critical) if touch.friction else None
        return law, friction


def _is_unusual(touch: SceneContact) -> bool:
    return bool(touch.viscosity) or any(touch.point)


def _origins(scene: ExamScene) -> list[Array]:
    """Where each hinge is, from that of the parent in axes of the parent, or in the world."""
    arms = {hinge.body: np.array(hinge.arm) for hinge in scene.hinges}
    return [
        np.array(hinge.place) + (0.0 if hinge.parent is None else arms[hinge.parent])
        for hinge in scene.hinges
    ]


def _on_hinges(scene: ExamScene) -> tuple[list[float], list[float]]:
    """The angle and the rate of each hinge at the start."""
    angles, rates = [], []
    for hinge in scene.hinges:
        q, spin, axis = scene.y0[hinge.body, 3:7], scene.y0[hinge.body, 10:], np.array(hinge.axis)
        if hinge.parent is not None:
            q = _product(scene.y0[hinge.parent, 3:7] * (-1, -1, -1, 1), q)
            spin = spin - scene.y0[hinge.parent, 10:]
        angles.append(2 * math.atan2(axis @ q[:3], q[3]))
        rates.append(float(axis @ spin))
    return angles, rates


def _off_hinges(scene: ExamScene, angles: Array, rates: Array) -> Array:
    """The state of the bodies, from the angles and rates of their hinges."""
    found = np.zeros_like(scene.y0)
    for hinge, angle, rate in zip(scene.hinges, angles, rates, strict=True):
        axis = np.array(hinge.axis)
        q = np.array([*(math.sin(angle / 2) * axis), math.cos(angle / 2)])
        place, velocity, spin = np.array(hinge.place), np.zeros(3), rate * axis
        if hinge.parent is not None:
            own = found[hinge.parent]
            turn = _matrix(own[3:7])
            velocity = own[7:10] + turn @ np.cross(own[10:], place)
            place = own[:3] + turn @ place
            q, spin = _product(own[3:7], q), spin + _matrix(q).T @ own[10:]
        turn, arm = _matrix(q), np.array(hinge.arm)
        found[hinge.body] = [*(place + turn @ arm), *q, *(velocity + turn @ np.cross(spin, arm)), *spin]
    return found


def _product(p: Array, q: Array) -> Array:
    """The product of two quaternions (x, y, z, w)."""
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.array([*vector, p[3] * q[3] - p[:3] @ q[:3]])


def _surface(touch: SceneContact) -> Any:
    if touch.surface == "sphere":
        return contact.SphericalSurface((0.0, 0.0, 0.0), touch.place)
    up = -1.0 if touch.surface == "ceiling" else 1.0
    return contact.HalfSpace((0.0, 0.0, touch.place), (0.0, 0.0, up))


def _in_world(state: State, change: Array) -> Array:
    """The change of a state in world axes, of one as scenes have it."""
    turn = _matrix(state.quaternion)
    rotation = turn @ change[3:6]
    spin = np.cross(rotation, state.angular_velocity) + turn @ change[9:]
    return np.concatenate([change[:3], rotation, change[6:9], spin])


def _in_body(state: State, change: Array) -> Array:
    """The change of a state as scenes have it, of one in world axes."""
    back = _matrix(state.quaternion).T
    spin = change[9:] - np.cross(change[3:6], state.angular_velocity)
    return np.concatenate([change[:3], back @ change[3:6], change[6:9], back @ spin])


def _raised(state: State, by: float) -> State:
    return State(
        state.position + np.array([0.0, 0.0, by]),
        state.quaternion,
        state.velocity,
        angular_velocity_body=state.angular_velocity_body,
    )


# ------------------------------------------------------------------------- equations with their events


class _ByModes(_Engine, ABC):
    """Integrates the equations of a scene from event to event."""

    setting = "tolerance"
    #: More events than any scene has.
    _MOST = 100

    def default(self, scene: ExamScene) -> float:
        return 0.0

    def run(self, scene: ExamScene, tolerance: float) -> Ended:
        t, y, mode = 0.0, scene.y0.ravel(), scene.first
        times: list[float] = []
        while True:
            t, y, met = self.until(scene, mode, t, y, tolerance)
            if met is None:
                return y.reshape(scene.y0.shape), times
            if len(times) == self._MOST:
                raise ArithmeticError(f"more than {self._MOST} events")
            guard = scene.modes[mode].guards[met]
            times.append(t)
            mode = guard.next
            if guard.reset is not None:
                y = np.asarray(guard.reset(y), dtype=np.float64)

    @abstractmethod
    def until(
        self, scene: ExamScene, mode: str, t: float, y: Array, tolerance: float
    ) -> tuple[float, Array, int | None]:
        """Time and state at the next event or at the end, and the number of the guard that fell."""


class _Scipy(_ByModes):
    def __init__(self, variant: str) -> None:
        self.integrate = _package("scipy.integrate", "scipy")
        self.method = _one_of("scipy", variant, ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA"))
        super().__init__(f"scipy:{self.method}", "scipy")

    def until(
        self, scene: ExamScene, mode: str, t: float, y: Array, tolerance: float
    ) -> tuple[float, Array, int | None]:
        events = [_terminal(guard.value) for guard in scene.modes[mode].guards]
        # 0 stands for SciPy's own tolerances
        options = {"rtol": max(tolerance, 2.3e-14), "atol": tolerance} if tolerance else {}
        found = self.integrate.solve_ivp(
            lambda t, y: scene.rate(mode, t, y),
            (t, scene.duration),
            y,
            method=self.method,
            events=events or None,
            **options,
        )
        if not found.success:
            raise ArithmeticError(found.message)
        met = [k for k in range(len(events)) if found.status == 1 and len(found.t_events[k])]
        return float(found.t[-1]), found.y[:, -1], met[0] if met else None


def _terminal(guard: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def event(t: Any, y: Any) -> Any:
        return guard(t, y)

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


class _Heyoka(_ByModes):
    def __init__(self, variant: str) -> None:
        self.heyoka = _package("heyoka", "heyoka")
        _one_of("heyoka", variant, ("taylor",))
        super().__init__("heyoka", "heyoka")
        self._made: dict[tuple[str, str, float], Any] = {}

    def until(
        self, scene: ExamScene, mode: str, t: float, y: Array, tolerance: float
    ) -> tuple[float, Array, int | None]:
        key = (scene.name, mode, tolerance)
        if key not in self._made:
            self._made[key] = self._integrator(scene, mode, tolerance)
        integrator = self._made[key]
        integrator.time = t
        integrator.state[:] = y
        if integrator.with_events:
            integrator.reset_cooldowns()
        outcome = integrator.propagate_until(scene.duration)[0]
        reached = self.heyoka.taylor_outcome
        if outcome == reached.time_limit:
            return scene.duration, integrator.state.copy(), None
        number = -int(outcome) - 1
        if number not in range(len(scene.modes[mode].guards)):
            raise ArithmeticError(f"it ended with {outcome}")
        return float(integrator.time), integrator.state.copy(), number

    def _integrator(self, scene: ExamScene, mode: str, tolerance: float) -> Any:
        hy = self.heyoka
        names = hy.make_vars(*(f"y{k}" for k in range(scene.y0.size)))
        slopes = [each + hy.expression(0.0) for each in scene.rate(mode, 0.0, names)]
        falls = [
            hy.t_event(hy.expression(0.0) + guard.value(0.0, names), direction=hy.event_direction.negative)
            for guard in scene.modes[mode].guards
        ]
        options = {"tol": tolerance} if tolerance else {}
        pairs = list(zip(names, slopes, strict=True))
        return hy.taylor_adaptive(pairs, scene.y0.ravel().tolist(), t_events=falls, **options)


# ------------------------------------------------------------------------------------------------ MuJoCo


class _MuJoCo(_Engine):
    def __init__(self, variant: str) -> None:
        self.mujoco = _package("mujoco", "mujoco")
        self.integrator = _one_of("mujoco", variant, ("Euler", "implicitfast", "implicit", "RK4"))
        super().__init__(f"mujoco:{self.integrator}", "mujoco")

    def can(self, scene: ExamScene) -> bool | str:
        if any(scene.rotors):
            return "rotors are not stated by this adapter"
        if any(map(_is_unusual, scene.contacts)):
            return _UNUSUAL
        return _BY_MODES if scene.by_modes_only else True

    def default(self, scene: ExamScene) -> float:
        return 0.002

    def law(self, scene: ExamScene) -> str | None:
        return "MuJoCo's soft contact" if scene.contacts else None

    def run(self, scene: ExamScene, dt: float) -> Ended:
        mujoco = self.mujoco
        model = mujoco.MjModel.from_xml_string(self._xml(scene, dt))
        data = mujoco.MjData(model)
        if scene.hinges:
            data.qpos[:], data.qvel[:] = _on_hinges(scene)
            mujoco.mj_step(model, data, nstep=round(scene.duration / dt))
            return _off_hinges(scene, data.qpos, data.qvel), None
        sliding = [_slides(scene, k) for k in range(len(scene.bodies))]
        q, v = 0, 0
        for k, y in enumerate(scene.y0):
            x, turn = y[:3], np.roll(y[3:7], 1)
            if scene.pivot is not None:
                data.qpos[q : q + 4], data.qvel[v : v + 3] = turn, y[10:]
                q, v = q + 4, v + 3
            elif sliding[k]:
                data.qpos[q : q + 3], data.qvel[v : v + 3] = x, y[7:10]
                q, v = q + 3, v + 3
            else:
                data.qpos[q : q + 7] = [*x, *turn]
                data.qvel[v : v + 6] = y[7:]
                data.qfrc_applied[v + 3 : v + 6] = scene.torque
                q, v = q + 7, v + 6
        # the last step ends at the end
        mujoco.mj_step(model, data, nstep=round(scene.duration / dt))
        end, q, v = np.array(scene.y0), 0, 0
        for k in range(len(end)):
            if scene.pivot is not None:
                end[k, 3:7], end[k, 10:] = np.roll(data.qpos[q : q + 4], -1), data.qvel[v : v + 3]
                q, v = q + 4, v + 3
            elif sliding[k]:
                end[k, :3], end[k, 7:10] = data.qpos[q : q + 3], data.qvel[v : v + 3]
                q, v = q + 3, v + 3
            else:
                end[k, :3], end[k, 3:7] = data.qpos[q : q + 3], np.roll(data.qpos[q + 3 : q + 7], -1)
                end[k, 7:] = data.qvel[v : v + 6]
                q, v = q + 7, v + 6
        return end, None

    def _xml(self, scene: ExamScene, dt: float) -> str:
        steps = round(scene.duration / dt)
        floors, worn = [], {}
        for touch in scene.contacts:
            law = _direct(touch, scene.bodies[touch.body].mass)
            rubs = f'friction="{touch.friction!r} 0 0" condim="{3 if touch.friction else 1}" {law}'
            # a point is a small ball, and its surface further away by its radius
            radius = touch.radius or 0.05
            off = radius - touch.radius
            worn[touch.body] = f'<geom type="sphere" size="{radius!r}" {rubs}/>'
            if touch.surface == "body":
                worn[int(touch.place)] = worn[touch.body]
            elif touch.surface == "sphere":
                floors.append(f'<geom type="sphere" size="{touch.place - off!r}" {rubs}/>')
            elif touch.surface == "floor":
                floors.append(f'<geom type="plane" size="0 0 1" pos="0 0 {touch.place - off!r}" {rubs}/>')
            else:
                floors.append(
                    f'<geom type="plane" size="0 0 1" pos="0 0 {touch.place + off!r}" zaxis="0 0 -1" {rubs}/>'
                )
        bodies = (
            self._chain(scene, None)
            if scene.hinges
            else "".join(self._body(scene, k, worn.get(k, "")) for k in range(len(scene.bodies)))
        )
        gravity = " ".join(map(repr, map(float, scene.gravity)))
        return f"""
            <mujoco>
              <option timestep="{scene.duration / max(steps, 1)!r}" integrator="{self.integrator}"
                gravity="{gravity}" cone="elliptic"/>
              <worldbody>{"".join(floors)}{bodies}</worldbody>
            </mujoco>"""

    def _chain(self, scene: ExamScene, parent: int | None) -> str:
        """The bodies on the hinges of one."""
        found = ""
        for hinge, origin in zip(scene.hinges, _origins(scene), strict=True):
            if hinge.parent == parent:
                inertial = _inertial(scene.bodies[hinge.body], hinge.arm)
                found += (
                    f'<body pos="{_numbers(origin)}"><joint type="hinge" axis="{_numbers(hinge.axis)}"/>'
                    f"{inertial}{self._chain(scene, hinge.body)}</body>"
                )
        return found

    def _body(self, scene: ExamScene, k: int, worn: str) -> str:
        body, center = scene.bodies[k], np.zeros(3)
        joints = "<freejoint/>"
        if scene.pivot is not None:
            center = np.array(scene.pivot)
            moved = center @ center * np.eye(3) - np.outer(center, center)
            body = RigidBody(body.mass, body.inertia - body.mass * moved)
            joints = '<joint type="ball"/>'
        elif _slides(scene, k):
            along = f'stiffness="{scene.spring!r}"'
            joints = (
                f'<joint type="slide" axis="1 0 0" {along}/><joint type="slide" axis="0 1 0"/>'
                '<joint type="slide" axis="0 0 1"/>'
            )
        return f"<body>{joints}{_inertial(body, center)}{worn}</body>"


def _inertial(body: RigidBody, center: Sequence[float] | Array) -> str:
    moments = _numbers(np.diag(body.inertia))
    return f'<inertial pos="{_numbers(center)}" mass="{body.mass!r}" diaginertia="{moments}"/>'


def _numbers(values: Sequence[float] | Array) -> str:
    return " ".join(repr(float(x)) for x in values)


def _slides(scene: ExamScene, k: int) -> bool:
    """Whether a body is a point, which does not turn."""
    return any(touch.body == k and touch.radius == 0.0 for touch in scene.contacts)


def _direct(touch: SceneContact, mass: float) -> str:
    """Stiffness and damping by their numbers where the scene has some; MuJoCo's own contact elsewhere."""
    if touch.law == "spring":
        return f'solref="{-touch.stiffness / mass!r} {-touch.damping / mass!r}"'
    if touch.restitution:
        # a damper that is zero is refused
        damping = contact.CompliantLaw.from_restitution(1.0, 1e4, touch.restitution).damping
        return f'solref="-10000 {-max(damping, 1e-9)!r}"'
    return ""


# ------------------------------------------------------------------------- Pinocchio, and Drake


class _Pinocchio(_Engine):
    """Accelerations by the algorithm of articulated bodies, integrated by SciPy."""

    setting = "tolerance"

    def __init__(self, variant: str) -> None:
        self.pin = _package("pinocchio", "pin")
        self.integrate = _package("scipy.integrate", "scipy")
        self.method = _one_of("pinocchio", variant, ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA"))
        super().__init__(f"pinocchio:{self.method}", "pin", "scipy")

    def can(self, scene: ExamScene) -> bool | str:
        return "contact is left to its user" if scene.contacts or scene.by_modes_only else True

    def default(self, scene: ExamScene) -> float:
        return 0.0

    def run(self, scene: ExamScene, tolerance: float) -> Ended:
        if scene.hinges:
            return self._run_chain(scene, tolerance), None
        pin, body = self.pin, scene.bodies[0]
        model = pin.Model()
        model.gravity.linear = np.array(scene.gravity)
        center = np.array(scene.pivot or (0.0, 0.0, 0.0))
        inertia = np.array(body.inertia) - body.mass * (
            center @ center * np.eye(3) - np.outer(center, center)
        )
        joint = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "turns")
        model.appendBodyToJoint(joint, pin.Inertia(body.mass, center, inertia), pin.SE3.Identity())
        data, torque = model.createData(), np.array(scene.torque)

        def slope(t: float, y: Array) -> list[float]:
            q, spin = y[3:7], y[10:]
            acting = torque + np.cross(scene.rotors, spin)
            turning = pin.aba(model, data, q / np.linalg.norm(q), spin, acting)
            # the kinematics are those of the scene
            rest: list[float] = scene.rate(scene.first, t, y)
            return [*rest[:10], *turning]

        return self._solved(slope, scene, scene.y0[0], tolerance), None

    def _run_chain(self, scene: ExamScene, tolerance: float) -> Array:
        """Of bodies on hinges, by their angles and rates."""
        pin = self.pin
        model = pin.Model()
        model.gravity.linear = np.array(scene.gravity)
        joints: dict[int | None, int] = {None: 0}
        for hinge, origin in zip(scene.hinges, _origins(scene), strict=True):
            body = scene.bodies[hinge.body]
            axis = pin.JointModelRevoluteUnaligned(np.array(hinge.axis))
            place = pin.SE3(np.eye(3), origin)
            joint = model.addJoint(joints[hinge.parent], axis, place, f"hinge {hinge.body}")
            inertia = pin.Inertia(body.mass, np.array(hinge.arm), np.array(body.inertia))
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
            joints[hinge.body] = joint
        data, none, n = model.createData(), np.zeros(model.nv), model.nq

        def slope(t: float, y: Array) -> Array:
            return np.concatenate([y[n:], pin.aba(model, data, y[:n], y[n:], none)])

        end = self._solved(slope, scene, np.concatenate(_on_hinges(scene)), tolerance)
        return _off_hinges(scene, end[:n], end[n:])

    def _solved(
        self, slope: Callable[[float, Array], Any], scene: ExamScene, start: Array, tolerance: float
    ) -> Array:
        options = {"rtol": max(tolerance, 2.3e-14), "atol": tolerance} if tolerance else {}
        found = self.integrate.solve_ivp(slope, (0.0, scene.duration), start, method=self.method, **options)
        if not found.success:
            raise ArithmeticError(found.message)
        end: Array = found.y[:, -1]
        return end


class _Drake(_Engine):
    """Free bodies, with Drake's point contact: a stiffness and a dissipation after Hunt and Crossley."""

    #: Stiffness of the contacts that stand for rigid ones, N/m: steps of a scene resolve it.
    _STIFF = 1e4

    def __init__(self, variant: str) -> None:
        _package("pydrake", "drake")
        self.drake = importlib.import_module("pydrake.all")
        schemes = ("runge_kutta3", "runge_kutta5", "runge_kutta2", "explicit_euler", "radau3", "discrete")
        self.scheme = _one_of("drake", variant, schemes)
        super().__init__(f"drake:{self.scheme}", "drake")

    def can(self, scene: ExamScene) -> bool | str:
        if scene.by_modes_only:
            return _BY_MODES
        if scene.hinges:
            return _BY_HINGES
        if any(map(_is_unusual, scene.contacts)):
            return _UNUSUAL
        if scene.pivot is not None or any(scene.torque) or any(scene.rotors) or scene.spring:
            return "fixed points, torques in body axes, rotors and springs are not stated by this adapter"
        if any(touch.radius == 0.0 and touch.friction for touch in scene.contacts):
            return "a point that slides without turning is not stated by this adapter"
        return True

    def law(self, scene: ExamScene) -> str | None:
        # the law of its point contact is that of Hunt and Crossley
        return (
            "Drake's point contact" if any(touch.law != "hunt_crossley" for touch in scene.contacts) else None
        )

    def run(self, scene: ExamScene, dt: float) -> Ended:
        drake, discrete = self.drake, self.scheme == "discrete"
        h = scene.duration / max(round(scene.duration / dt), 1)
        builder = drake.DiagramBuilder()
        plant, _ = drake.AddMultibodyPlantSceneGraph(builder, h if discrete else 0.0)
        plant.mutable_gravity_field().set_gravity_vector(np.array(scene.gravity))
        bodies = []
        for k, body in enumerate(scene.bodies):
            moments = (float(body.inertia[n, n]) / body.mass for n in range(3))
            inertia = drake.SpatialInertia(body.mass, np.zeros(3), drake.UnitInertia(*moments))
            bodies.append(plant.AddRigidBody(f"body {k}", inertia))
        self._touch(scene, plant, bodies)
        plant.Finalize()
        simulator = drake.Simulator(builder.Build())
        if not discrete:
            drake.ResetIntegratorFromFlags(simulator, self.scheme, h)
            simulator.get_mutable_integrator().set_fixed_step_mode(True)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        for body, y in zip(bodies, scene.y0, strict=True):
            turn = drake.RotationMatrix(_matrix(y[3:7]))
            plant.SetFreeBodyPose(context, body, drake.RigidTransform(turn, y[:3]))
            motion = drake.SpatialVelocity(turn.matrix() @ y[10:], y[7:10])
            plant.SetFreeBodySpatialVelocity(context, body, motion)
        simulator.Initialize()
        simulator.AdvanceTo(scene.duration)
        return [self._state(plant, context, body) for body in bodies], None

    def _touch(self, scene: ExamScene, plant: Any, bodies: list[Any]) -> None:
        drake, worn = self.drake, set()

        def register(body: Any, place: Any, shape: Any, name: str, touch: SceneContact) -> None:
            stiffness = self._STIFF if touch.law == "rigid" else touch.stiffness
            dissipation = {
                "rigid": 1.0 - touch.restitution,
                "spring": touch.damping / stiffness,
                "hunt_crossley": touch.damping,
            }[touch.law]
            # of the two that touch, each has the double stiffness, and they are in series
            properties = drake.ProximityProperties()
            drake.AddContactMaterial(
                dissipation=dissipation,
                point_stiffness=2 * stiffness,
                friction=drake.CoulombFriction(touch.friction, touch.friction),
                properties=properties,
            )
            plant.RegisterCollisionGeometry(body, place, shape, name, properties)

        for n, touch in enumerate(scene.contacts):
            # a point is a small ball, and its surface further away by its radius
            radius = touch.radius or 0.05
            off = radius - touch.radius
            others = [touch.body] + ([int(touch.place)] if touch.surface == "body" else [])
            for k in others:
                if k not in worn:
                    register(bodies[k], drake.RigidTransform(), drake.Sphere(radius), f"ball {k}", touch)
                    worn.add(k)
            if touch.surface == "sphere":
                shape, place = drake.Sphere(touch.place - off), drake.RigidTransform()
            elif touch.surface != "body":
                up = -1.0 if touch.surface == "ceiling" else 1.0
                shape = drake.HalfSpace()
                place = drake.HalfSpace.MakePose([0.0, 0.0, up], [0.0, 0.0, touch.place - up * off])
            else:
                continue
            register(plant.world_body(), place, shape, f"surface {n}", touch)

    def _state(self, plant: Any, context: Any, body: Any) -> list[float]:
        pose = plant.EvalBodyPoseInWorld(context, body)
        motion = plant.EvalBodySpatialVelocityInWorld(context, body)
        turn = pose.rotation()
        q = np.roll(turn.ToQuaternion().wxyz(), -1)
        return [*pose.translation(), *q, *motion.translational(), *(turn.matrix().T @ motion.rotational())]


def _matrix(q: Array) -> Array:
    """The rotation matrix of a quaternion (x, y, z, w)."""
    x, y, z, w = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


_MAKERS: dict[str, Callable[[str], Any]] = {
    "somersault": _Somersault,
    "scipy": _Scipy,
    "heyoka": _Heyoka,
    "mujoco": _MuJoCo,
    "pinocchio": _Pinocchio,
    "drake": _Drake,
}
