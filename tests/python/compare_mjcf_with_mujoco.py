"""Dynamics of MJCF models against MuJoCo (`pip install mujoco`), as a table in Markdown.

    python tests/python/compare_mjcf_with_mujoco.py tests/mjcf

The argument is a document or a folder of them. MuJoCo reads the same document; what `Robot.ignored` lists is
switched off in its compiled model: springs, fluids, compensated gravity, tendons. With qvel = T v, where T turns the linear
velocity of free joints into the world's axes and lets followers follow, M = Tᵀ M' T and
h = Tᵀ (M' dT/dt v + bias - passive). A row has the largest deviation of the mass matrix, of the bias, of the
accelerations of forward dynamics and of the positions of named bodies in random states, each relative to its own
largest number; fails above 1e-9.
"""

import sys
from pathlib import Path

import mujoco
import numpy as np

from somersault import errors, multibody

TOLERANCE = 1e-9
N_STATES = 20


def moving(robot):
    """The links that have a joint, in the order of MuJoCo's joints."""
    return [link for link in robot.model.links if link.joint != "fixed"]


def sources(robot):
    """For each moving link the one that leads it in the end, multiplier and offset."""
    links = {link.name: link for link in robot.model.links}
    found = {}
    for link in moving(robot):
        end, multiplier, offset = link, 1.0, 0.0
        while end.mimic is not None:
            name, m, o = end.mimic
            offset, multiplier, end = offset + multiplier * o, multiplier * m, links[name]
        found[link.name] = end.name, multiplier, offset
    return found


def spread(robot, model, q, v):
    """qpos, T and dT/dt v."""
    tree, found = robot.model, sources(robot)
    qpos, spin = np.zeros(model.nq), np.zeros(model.nv)
    into = np.zeros((model.nv, tree.n_velocities))
    for joint, link in enumerate(moving(robot)):
        leader, multiplier, offset = found[link.name]
        part = q[tree.positions_of(leader)]
        dofs = np.arange(tree.n_velocities)[tree.velocities_of(leader)]
        at, row = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        if link.joint == "free":
            x, y, z, w = part[3:]
            turn = np.zeros(9)
            qpos[at : at + 7] = [*part[:3], w, x, y, z]
            mujoco.mju_quat2Mat(turn, np.array([w, x, y, z]))
            turn = turn.reshape(3, 3)
            into[row : row + 3, dofs[:3]] = turn
            into[row + 3 : row + 6, dofs[3:]] = np.eye(3)
            spin[row : row + 3] = turn @ np.cross(v[dofs[3:]], v[dofs[:3]])
        elif link.joint == "spherical":
            qpos[at : at + 4] = np.roll(part, 1)
            into[row : row + 3, dofs] = np.eye(3)
        else:
            qpos[at] = multiplier * part[0] + offset
            into[row, dofs] = multiplier
    return qpos, into, spin


def compiled(document):
    """MuJoCo's model, without what a tree has not."""
    model = mujoco.MjModel.from_xml_path(str(document))
    model.opt.density = model.opt.viscosity = 0.0
    for name in ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_damping", "body_gravcomp", "tendon_armature"):
        if hasattr(model, name):
            getattr(model, name)[:] = 0.0
    model.ngravcomp = 0
    return model


def off(found, expected):
    return float(np.max(np.abs(found - expected), initial=0.0) / max(1e-300, np.max(np.abs(expected), initial=0.0)))


def compare(robot, document):
    """The largest deviations of the mass matrix, the bias, accelerations and positions."""
    model, tree = compiled(document), robot.model
    data, random = mujoco.MjData(model), np.random.default_rng(1)
    worst = np.zeros(4)
    for _ in range(N_STATES):
        q, v, tau = tree.random(random.integers(1 << 30)), *random.normal(size=(2, tree.n_velocities))
        qpos, into, spin = spread(robot, model, q, v)
        data.qpos, data.qvel = qpos, into @ v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, full, data.qM) if hasattr(data, "qM") else mujoco.mj_fullM(model, data, full)
        mass = into.T @ full @ into
        bias = into.T @ (full @ spin + data.qfrc_bias - data.qfrc_passive)
        poses = tree.poses(q)
        names = [(tree.body(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, i)), i) for i in range(1, model.nbody) if model.body(i).name]
        found = np.array([poses[ours][:3, 3] for ours, _ in names])
        worst = np.maximum(
            worst,
            [
                off(tree.mass_matrix(q), mass),
                off(tree.bias(q, v), bias),
                off(tree.forward_dynamics(q, v, tau), np.linalg.solve(mass, tau - bias)),
                off(found, np.array([data.xpos[theirs] for _, theirs in names])),
            ],
        )
    return worst


def main():
    given = Path(sys.argv[1])
    documents = sorted(given.glob("*.xml")) if given.is_dir() else [given]
    print("| Document | Degrees of freedom | Bodies | Repaired | Ignored | Mass matrix | Bias | Accelerations | Positions |")
    print("|---|---|---|---|---|---|---|---|---|")
    failed = False
    for document in documents:
        try:
            robot = multibody.Robot.read_mjcf(document)
        except errors.ReadError as reason:
            print(f"| `{document.name}` | {reason} | | | | | | | |")
            continue
        worst = compare(robot, document)
        failed |= not (worst < TOLERANCE).all()
        numbers = " | ".join(f"{x:.0e}" for x in worst)
        tree = robot.model
        print(
            f"| `{document.name}` | {tree.n_velocities} | {tree.n_bodies} | {len(robot.repairs)} | {len(robot.ignored)} | {numbers} |"
        )
    if failed:
        raise SystemExit("more than 1e-9 off")


if __name__ == "__main__":
    main()
