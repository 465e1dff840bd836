"""A leg that hops and a quadruped that falls on its feet, with friction, to 1e-3, 1e-6 and 1e-9.

Both are named models of this library. SciPy with Pinocchio's dynamics integrates the same law of contact,
with the stretch of its friction as part of the state, and is the reference. MuJoCo and Drake have contacts
of their own kind: each is measured against its own answer with the finest step or tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio
from compiled import Array
from drake_trees import Ground, PlanarLink, of_urdf, planar
from drake_trees import Scene as DrakeScene
from located import Ball, Law, Tree
from measure import Contender, geometric, race

from somersault import contact, multibody

GRAVITY = 9.81
TARGETS = (1e-3, 1e-6, 1e-9)
FINEST = 256_000
"""Steps of the answers that MuJoCo and Drake's discrete contact are measured against."""
DISSIPATION = 1.0
"""Of Drake's contact, s/m."""
DURATIONS = {"leg": 0.6, "quadruped": 0.4}
TITLES = {
    "leg": "A leg that hops for 0.6 s: five degrees of freedom, one point of contact, three stances",
    "quadruped": "A quadruped that falls on its feet, 0.4 s: fourteen degrees of freedom, twelve contacts",
}

# ------------------------------------------------------------------------------------------------ the leg

LEG_LAW = Law(2e4, 150.0, 0.5, 1.5e4, 60.0)
LEG = [  # mass, moment, centre of mass, where it hangs on the one before
    PlanarLink(5.0, 0.08, 0.0, 0.0),
    PlanarLink(1.0, 0.009, 0.13, 0.05),
    PlanarLink(0.5, 0.005, 0.12, 0.3),
]
SHANK = 0.3
DRIVES = ((0.88, 4.72, 28.309, 2.31), (6.485, 10.486, 28.609, 5.489))


def _motors(t: float) -> list[float]:
    return [mean + amplitude * np.sin(rate * t + phase) for mean, amplitude, rate, phase in DRIVES]


def _planar_rate(q: Array, v: Array) -> Array:
    _, _, c, s = q[:4]
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], -s * v[2], c * v[2], *v[3:]])


@cache
def _leg_of_pinocchio() -> Tree:
    model = pinocchio.Model()
    model.gravity.linear = np.array([0.0, -GRAVITY, 0.0])
    parent = 0
    for i, (mass, moment, center, hangs_at) in enumerate(LEG):
        joint = pinocchio.JointModelPlanar() if i == 0 else pinocchio.JointModelRZ()
        place = pinocchio.SE3(np.eye(3), np.array([0.0, -hangs_at, 0.0]))
        parent = model.addJoint(parent, joint, place, f"link {i}")
        inertia = pinocchio.Inertia(mass, np.array([0.0, -center, 0.0]), np.eye(3) * moment)
        model.appendBodyToJoint(parent, inertia, pinocchio.SE3.Identity())
    foot = Ball(parent, np.array([0.0, -SHANK, 0.0]), 0.0)

    def torque(t: float, q: Array, v: Array) -> Array:
        return np.array([0.0, 0.0, 0.0, *_motors(t)])

    return Tree(model, [foot], LEG_LAW, np.array([0.0, 1.0, 0.0]), torque, _planar_rate)


def _leg_by_pinocchio(tolerance: float) -> Array:
    start = _system("leg")
    x, z, a, *hinges = start.q
    q = np.array([x, z, np.cos(a), np.sin(a), *hinges])
    q, v = _leg_of_pinocchio().run(q, start.v, DURATIONS["leg"], tolerance)
    angle = np.arctan2(q[3], q[2])
    angle += 2.0 * np.pi * np.round((LEG_TURNS - angle) / (2.0 * np.pi))
    return np.array([*q[:2], angle, *q[4:], *v])


LEG_TURNS = -1.4596
"""The angle of the body at the end, rad, of which Pinocchio keeps sine and cosine."""


@cache
def _leg_of_mujoco(integrator: str, steps: int) -> mujoco.MjModel:
    law = (
        f'condim="3" friction="{LEG_LAW.coefficient} 0 0" solref="{-LEG_LAW.stiffness} {-LEG_LAW.damping}" '
        'solimp="0.9999 0.9999 0.001"'
    )
    text = f'<geom type="sphere" size="1e-6" pos="0 0 {-SHANK}" mass="0" {law}/>'
    for i in range(2, -1, -1):
        mass, moment, center, hangs_at = LEG[i]
        joint = f'<joint name="j{i}" type="hinge" axis="0 -1 0"/>'
        if i == 0:
            joint = f'<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>{joint}'
        about = " ".join([str(moment)] * 3)
        inertia = f'<inertial pos="0 0 {-center}" mass="{mass}" diaginertia="{about}"/>'
        text = f'<body pos="0 0 {-hangs_at}">{joint}{inertia}{text}</body>'
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{DURATIONS["leg"] / steps!r}" integrator="{integrator}" gravity="0 0 {-GRAVITY}"
                  iterations="100" tolerance="1e-14" cone="elliptic"/>
          <default><geom contype="1" conaffinity="2"/></default>
          <worldbody><geom type="plane" size="9 9 1" contype="2" conaffinity="1" {law}/>{text}</worldbody>
          <actuator><motor joint="j1"/><motor joint="j2"/></actuator>
        </mujoco>
        """)


def _leg_by_mujoco(integrator: str, steps: int) -> Array:
    model = _leg_of_mujoco(integrator, steps)
    data = mujoco.MjData(model)
    start = _system("leg")
    s, c = np.sin(start.q[2]), np.cos(start.q[2])
    data.qpos[:] = start.q
    data.qvel[:] = [c * start.v[0] - s * start.v[1], s * start.v[0] + c * start.v[1], *start.v[2:]]

    def drive(_: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.ctrl[:] = _motors(data.time)

    mujoco.set_mjcb_control(drive)
    try:
        mujoco.mj_step(model, data, nstep=steps)
    finally:
        mujoco.set_mjcb_control(None)
    return np.concatenate([data.qpos, data.qvel])


@cache
def _leg_of_drake(step: float) -> DrakeScene:
    start = _system("leg")
    s, c = np.sin(start.q[2]), np.cos(start.q[2])
    v = [c * start.v[0] - s * start.v[1], s * start.v[0] + c * start.v[1], *start.v[2:]]
    ground = Ground(LEG_LAW.stiffness, DISSIPATION, LEG_LAW.coefficient)
    start = np.concatenate([start.q, v])
    return planar(LEG, [(2, SHANK)], ground, DRIVES, start, DURATIONS["leg"], step)


# ------------------------------------------------------------------------------------------ the quadruped

QUADRUPED_LAW = Law(2e4, 150.0, 0.6, 1.5e4, 100.0)
STIFFNESS, DAMPING, ANGLES = 400.0, 4.0, {"hip": 0.5, "knee": -1.0}
IN_FILE = 2.0
"""Damping of the hinges in the file, N m s/rad, beside that of the actuators."""
TRUNK, FOOT, SHIN = (0.5, 0.3, 0.1), 0.02, 0.22
FILE = Path(__file__).resolve().parents[2] / "crates/somersault-contact/src/models/quadruped.urdf"


def _free_rate(q: Array, v: Array) -> Array:
    x, y, z, w = q[3:7]
    a, b, c = v[3:6]
    turn = pinocchio.Quaternion(w, x, y, z).toRotationMatrix()
    quaternion = 0.5 * np.array(
        [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
    )
    return np.concatenate([turn @ v[:3], quaternion, v[6:]])


def _angle(joint: str) -> float:
    return ANGLES[joint.split("_")[1]]


@cache
def _quadruped_of_pinocchio() -> Tree:
    # Pinocchio keeps the angle of a continuous joint as cosine and sine.
    text = FILE.read_text().replace('type="continuous"', 'type="revolute"')
    limit = '<limit lower="-9" upper="9" effort="1e9" velocity="1e9"/>'
    text = text.replace('<dynamics damping="2"/>', limit)
    model = pinocchio.buildModelFromXML(text, pinocchio.JointModelFreeFlyer())
    hinges = list(model.names)[2:]
    hold = np.array([_angle(joint) for joint in hinges])

    def torque(t: float, q: Array, v: Array) -> Array:
        of_hinges = STIFFNESS * (hold - q[7:]) - (DAMPING + IN_FILE) * v[6:]
        return np.concatenate([np.zeros(6), of_hinges])

    corners = np.array(np.meshgrid(*[(-0.5 * edge, 0.5 * edge) for edge in TRUNK])).reshape(3, -1).T
    knees = [i + 2 for i, joint in enumerate(hinges) if joint.endswith("knee")]
    balls = [Ball(1, corner, 0.0) for corner in corners]
    balls += [Ball(knee, np.array([0.0, 0.0, -SHIN]), FOOT) for knee in knees]
    return Tree(model, balls, QUADRUPED_LAW, np.array([0.0, 0.0, 1.0]), torque, _free_rate)


def _quadruped_by_pinocchio(tolerance: float) -> Array:
    tree, start = _quadruped_of_pinocchio(), _system("quadruped")
    order = _order(tree)
    q = np.concatenate([start.q[:7], start.q[7:][order]])
    q, v = tree.run(q, start.v, DURATIONS["quadruped"], tolerance)
    q[3:7] /= np.linalg.norm(q[3:7])
    back = np.argsort(order)
    return np.concatenate([q[:7], q[7:][back], v[:6], v[6:][back]])


def _order(tree: Tree) -> Array:
    """Numbers of this library's hinges in the order of Pinocchio's joints."""
    model = _system("quadruped").model
    ours = [name.replace("thigh", "hip").replace("shank", "knee") for name in model.names[1:]]
    return np.array([ours.index(joint) for joint in list(tree.model.names)[2:]])


@cache
def _quadruped_of_mujoco(integrator: str, steps: int) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(FILE.read_text())
    spec.option.timestep = DURATIONS["quadruped"] / steps
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.iterations, spec.option.tolerance = 100, 1e-14
    spec.body("trunk").add_freejoint()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9.0, 9.0, 1.0], contype=2, conaffinity=1)
    for geom in spec.geoms:
        if geom.type != mujoco.mjtGeom.mjGEOM_PLANE:
            geom.contype, geom.conaffinity = 1, 2
        geom.condim, geom.friction = 3, [QUADRUPED_LAW.coefficient, 0.0, 0.0]
        geom.solref = [-QUADRUPED_LAW.stiffness, -QUADRUPED_LAW.damping]
        geom.solimp = [0.9999, 0.9999, 0.001, 0.5, 2.0]
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            joint.stiffness, joint.damping = [STIFFNESS, 0.0, 0.0], [DAMPING + IN_FILE, 0.0, 0.0]
            joint.springref = _angle(joint.name)
    return spec.compile()


def _quadruped_by_mujoco(integrator: str, steps: int) -> Array:
    model = _quadruped_of_mujoco(integrator, steps)
    data = mujoco.MjData(model)
    data.qpos[2] = _system("quadruped").q[2]
    for i in range(model.njnt):
        if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE:
            data.qpos[model.jnt_qposadr[i]] = _angle(model.joint(i).name)
    mujoco.mj_step(model, data, nstep=steps)
    return np.concatenate([data.qpos, data.qvel])


@cache
def _quadruped_of_drake(step: float) -> DrakeScene:
    damped = FILE.read_text().replace('damping="2"', f'damping="{DAMPING + IN_FILE}"')
    ground = Ground(QUADRUPED_LAW.stiffness, DISSIPATION, QUADRUPED_LAW.coefficient)
    legs = ("lf", "rf", "lh", "rh")
    holds = [(f"{leg}_{joint}", STIFFNESS, angle) for leg in legs for joint, angle in ANGLES.items()]
    height = float(_system("quadruped").q[2])
    return of_urdf(damped, "trunk", ground, holds, height, DURATIONS["quadruped"], step)


# ------------------------------------------------------------------------------------------ the comparison


def _ours(scene: str, method: str, tolerance: float) -> Array:
    start = _system(scene)
    found = multibody.integrate_tree(
        start.model, start.q, start.v, (0.0, DURATIONS[scene]), method=method, rtol=tolerance, atol=tolerance,
        torque=start.torque, contacts=start.contacts, every=1_000_000, keep_events=False,
    )  # fmt: skip
    return np.concatenate([found.q[-1], found.v[-1]])


@cache
def _system(scene: str) -> contact.TreeContactSystem:
    return contact.hopping_leg() if scene == "leg" else contact.quadruped()


def _by_pinocchio(scene: str, tolerance: float) -> Array:
    return _leg_by_pinocchio(tolerance) if scene == "leg" else _quadruped_by_pinocchio(tolerance)


def _by_mujoco(scene: str, integrator: str, steps: float) -> Array:
    run = _leg_by_mujoco if scene == "leg" else _quadruped_by_mujoco
    return run(integrator, round(steps))


def _drake(scene: str, step: float) -> DrakeScene:
    return _leg_of_drake(step) if scene == "leg" else _quadruped_of_drake(step)


def _by_drake(scene: str, accuracy: float) -> Array:
    return _drake(scene, 0.0).end("cenic", accuracy)


def _by_drake_steps(scene: str, steps: float) -> Array:
    return _drake(scene, DURATIONS[scene] / round(steps)).end()


@cache
def _reference(scene: str) -> Array:
    """By Pinocchio and SciPy, which share nothing with this library, at a tolerance of 1e-13."""
    return _by_pinocchio(scene, 1e-13)


def _against_own(run: Callable[[float], Array], finest: float) -> Callable[[float], float]:
    """The distance of a program with another law of contact from its own finest answer."""
    answer = cache(run)
    return lambda setting: float(np.abs(run(setting) - answer(finest)).max())


def contenders(scene: str) -> list[Contender]:
    """The programs that integrate the scene; those with another law of contact return their error."""
    ours, steps = geometric(1e-2, 1e-14, 4), geometric(500, 32_000, 2)
    pinocchio_and_scipy = partial(_by_pinocchio, scene)
    return [
        *(
            Contender(f"somersault {method}", "tolerance", ours, partial(_ours, scene, method))
            for method in ("rkmk8", "rkmk5")
        ),
        Contender(
            "SciPy DOP853, events, Pinocchio", "tolerance", geometric(1e-2, 1e-13, 2), pinocchio_and_scipy
        ),
        *(
            Contender(f"MuJoCo {integrator}", "steps", steps, _against_own(run, FINEST))
            for integrator in ("Euler", "RK4", "implicitfast")
            for run in [partial(_by_mujoco, scene, integrator)]
        ),
        Contender(
            "Drake CENIC",
            "accuracy",
            geometric(1e-2, 1e-9, 1),
            _against_own(partial(_by_drake, scene), 1e-10),
        ),
        Contender("Drake SAP", "steps", steps, _against_own(partial(_by_drake_steps, scene), FINEST)),
    ]


def compare(repetitions: int) -> tuple[list[dict[str, object]], str]:
    """Time to each target, and how close those come that do not reach it."""
    all_rows: list[dict[str, object]] = []
    parts = [
        "## Legs with friction\n\n"
        "Largest error of q and v at the end, SI units, against SciPy's DOP853 with Pinocchio at 1e-13; each "
        "at the coarsest setting from which on it meets the target; processor time, called from Python. "
        f"MuJoCo and Drake are measured against their own answers with {FINEST} steps, and at an accuracy "
        "of 1e-10. Drake's CENIC adapts its steps, SAP is its discrete contact."
    ]
    for scene, title in TITLES.items():
        reference = _reference(scene)

        def error(found: Any, reference: Array = reference) -> float:
            return found if isinstance(found, float) else float(np.abs(found - reference).max())

        parts.append(f"### {title}")
        for target, rows, text in race(contenders(scene), error, TARGETS, repetitions, "error"):
            all_rows += [{"scene": scene, "target": target, **row} for row in rows]
            parts.append(f"To {target:g}:\n\n{text}")
    return all_rows, "\n\n".join(parts)
