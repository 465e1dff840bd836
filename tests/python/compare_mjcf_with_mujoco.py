"""Dynamics of MJCF models against MuJoCo (`pip install mujoco`), as a table in Markdown.

    cargo build --release -p somersault-testkit --example dump_robot
    python tests/python/compare_mjcf_with_mujoco.py target/release/examples/dump_robot tests/mjcf

The last argument is a document or a folder of them. MuJoCo reads the same document; what `Robot.ignored`
lists is switched off in its compiled model: springs, rotors, fluids, compensated gravity, tendons. With
qvel = T v, where T turns the linear velocity of free joints into the axes of the world and lets followers
follow, M = Tᵀ M' T and h = Tᵀ (M' dT/dt v + bias - passive). A row has the largest deviation of the mass
matrix, of the bias, of the accelerations of forward dynamics and of the positions of named bodies in random
states, each relative to its own largest number, and the residual that our accelerations leave in MuJoCo's
equations, |M a + h - τ| / (|M| |a| + |h| + |τ|); fails above 1e-9. Where the mass matrix is nearly singular,
its rounding changes accelerations: they may deviate by 100 ε times the largest condition number, if that is
more. States where that is above 1e14 count as singular: there accelerations are not compared and may be
refused. `random_mjcf.py` writes documents that have such.
"""

import json
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np

TOLERANCE = 1e-9
EPSILON = np.finfo(float).eps
SINGULAR = 1e14
N_STATES = "20"
# what a tree has not
OFF = (
    "jnt_stiffness",
    "jnt_stiffnesspoly",
    "dof_armature",
    "dof_dampingpoly",
    "tendon_stiffness",
    "tendon_stiffnesspoly",
    "tendon_damping",
    "tendon_dampingpoly",
    "tendon_armature",
    "body_gravcomp",
)


def followed(bodies):
    """For each body with a joint where that has its numbers in q and v, multiplier and offset."""
    named, q, v = {}, 0, 0
    for body in bodies:
        named[body["name"]] = body, slice(q, q + body["nq"]), slice(v, v + body["nv"])
        q, v = q + body["nq"], v + body["nv"]
    for body in bodies:
        leader, multiplier, offset = body, 1.0, 0.0
        while leader["follows"] is not None:
            name, m, o = leader["follows"]
            leader, multiplier, offset = named[name][0], multiplier * m, offset + multiplier * o
        _, q, v = named[leader["name"]]
        if body["joint"] != "fixed":
            yield body["joint"], q, v, multiplier, offset


def spread(bodies, model, q, v):
    """qpos, T and dT/dt v."""
    qpos, spin = np.zeros(model.nq), np.zeros(model.nv)
    into = np.zeros((model.nv, len(v)))
    for number, (joint, q_of, v_of, multiplier, offset) in enumerate(followed(bodies)):
        part, dofs = q[q_of], np.arange(len(v))[v_of]
        at, row = model.jnt_qposadr[number], model.jnt_dofadr[number]
        if joint == "free":
            quaternion, turn = np.roll(part[3:], 1), np.zeros(9)
            qpos[at : at + 7] = [*part[:3], *quaternion]
            mujoco.mju_quat2Mat(turn, quaternion)
            turn = turn.reshape(3, 3)
            into[row : row + 3, dofs[:3]] = turn
            into[row + 3 : row + 6, dofs[3:]] = np.eye(3)
            spin[row : row + 3] = turn @ np.cross(v[dofs[3:]], v[dofs[:3]])
        elif joint == "spherical":
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
    for name in OFF:
        getattr(model, name)[:] = 0.0
    # what it derived from these
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def off(found, expected):
    return np.max(np.abs(found - expected)) / np.max(np.abs(expected))


def compare(document, model, found):
    """The largest deviations of the mass matrix, the bias, accelerations and positions, the largest residual
    and condition number."""
    bodies, data, worst = found["bodies"], mujoco.MjData(model), np.zeros(6)
    names = {model.body(i).name: i for i in range(1, model.nbody)}
    shared = [(i, names[body["name"]]) for i, body in enumerate(bodies) if body["name"] in names]
    for state in found["states"]:
        q, v, tau = (np.array(state[name]) for name in ("q", "v", "tau"))
        qpos, into, spin = spread(bodies, model, q, v)
        data.qpos, data.qvel = qpos, into @ v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        mass = into.T @ full @ into
        bias = into.T @ (full @ spin + data.qfrc_bias - data.qfrc_passive)
        positions, condition = np.reshape(state["positions"], (-1, 3)), np.linalg.cond(mass)
        ours, accelerations, residual = state["aba"], 0.0, 0.0
        if condition < SINGULAR:
            if ours is None:
                raise SystemExit(f"{document}: accelerations refused at condition {condition:.0e}")
            accelerations = off(ours, np.linalg.solve(mass, tau - bias))
            summands = np.abs(mass) @ np.abs(ours) + np.abs(bias) + np.abs(tau)
            residual = np.max(np.abs(mass @ ours + bias - tau) / summands)
        deviations = (
            off(np.reshape(state["crba"], mass.shape), mass),
            off(state["bias"], bias),
            accelerations,
            off(positions[[i for i, _ in shared]], data.xpos[[i for _, i in shared]]),
            residual,
            condition,
        )
        worst = np.maximum(worst, deviations)
    return worst


def main():
    dump, given = sys.argv[1], Path(sys.argv[2])
    documents = sorted(given.glob("*.xml")) if given.is_dir() else [given]
    head = [
        *("Document", "Degrees of freedom", "Repaired", "Ignored"),
        *("Mass matrix", "Bias", "Accelerations", "Positions", "Residual", "Condition"),
    ]
    print("|", " | ".join(head), "|\n|" + "---|" * len(head))
    failed = False
    for document in documents:
        command = [dump, N_STATES, "mjcf", document]
        found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
        try:
            model, reason = compiled(document), found.get("refused")
        except ValueError as error:
            model, reason = None, f"MuJoCo: {error}"
        if reason is None and model.nv == 0:
            reason = "nothing moves"
        if reason is not None:
            print(f"| `{document.name}` |", " ".join(reason.split()), "| " * 8 + "|")
            continue
        worst = compare(document, model, found)
        allowed = np.full(5, TOLERANCE)
        allowed[2] = max(TOLERANCE, 100 * EPSILON * min(worst[5], SINGULAR))
        failed |= not (worst[:5] < allowed).all()
        n_velocities = sum(body["nv"] for body in found["bodies"])
        row = (n_velocities, len(found["repairs"]), found["n_ignored"], *(f"{x:.0e}" for x in worst))
        print(f"| `{document.name}` |", " | ".join(str(x) for x in row), "|")
    if failed:
        raise SystemExit(f"more than {TOLERANCE} off")


if __name__ == "__main__":
    main()
