"""Dynamics of URDF models against Pinocchio (`pip install pin`), as a table in Markdown.

    cargo build --release -p somersault-testkit --example dump_robot
    python tests/python/compare_urdf_with_pinocchio.py target/release/examples/dump_robot free tests/urdf

The last argument is a document or a folder of them, say a clone of
https://github.com/Gepetto/example-robot-data. Pinocchio reads the same document, with mimic joints; where
ours is repaired, it reads the repaired inertias and fixed joints. It orders joints by name within each
branch, stores continuous joints and the angle of planar ones as cosine and sine, and has no root on a fixed
base; velocities agree. Damping, which Pinocchio reads but does not apply, is taken out of the documents for
both. A row has the largest deviation of inverse dynamics, of weights and of the mass matrix in random
states, each relative to the norm of its own matrix; fails above 1e-9. Where Pinocchio cannot have a follower
before its leader, its tree without mimic joints is projected: τ = Gᵀ τ_t, M = Gᵀ M_t G (marked G).
"""

import json
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin

TOLERANCE = 1e-9
N_STATES = "20"
ROOTS = {"planar": pin.JointModelPlanar, "free": pin.JointModelFreeFlyer}


def numbers(element, attribute, default):
    text = None if element is None else element.get(attribute)
    return np.array([float(x) for x in text.split()]) if text else np.array(default, dtype=float)


def words(values):
    return " ".join(repr(float(x)) for x in values)


def repaired(robot, found):
    """The document with what stands in the place of its bodies and joints."""
    bodies = {body["name"]: body for body in found["bodies"]}
    for repair in found["repairs"]:
        tag, name = repair["element"].split(" ", 1)
        name = name.strip("`")
        element = next(e for e in robot.findall(tag) if e.get("name") == name)
        if tag == "link":
            body, inertial = bodies[name], element.find("inertial")
            inertial.clear()
            ElementTree.SubElement(inertial, "origin", xyz=words(body["center"]))
            ElementTree.SubElement(inertial, "mass", value=repr(body["mass"]))
            tensor = np.reshape(body["inertia"], (3, 3))
            entries = {
                f"i{'xyz'[i]}{'xyz'[k]}": repr(float(tensor[i, k])) for i in range(3) for k in range(i, 3)
            }
            ElementTree.SubElement(inertial, "inertia", entries)
        else:
            if repair["at"] is not None:
                fix(element, repair["at"])
            for mimic in element.findall("mimic"):
                element.remove(mimic)


def fix(joint, at):
    origin, axis = joint.find("origin"), numbers(joint.find("axis"), "xyz", (1, 0, 0))
    place, turn = numbers(origin, "xyz", (0, 0, 0)), pin.rpy.rpyToMatrix(numbers(origin, "rpy", (0, 0, 0)))
    axis /= np.linalg.norm(axis)
    if joint.get("type") == "prismatic":
        place = place + turn @ axis * at
    else:
        turn = turn @ pin.exp3(axis * at)
    joint.set("type", "fixed")
    if origin is not None:
        joint.remove(origin)
    ElementTree.SubElement(joint, "origin", xyz=words(place), rpy=words(pin.rpy.matrixToRpy(turn)))


def leaders(robot):
    """For each joint that mimics the joint that leads in the end, multiplier and offset."""
    mimics = {j.get("name"): j.find("mimic") for j in robot.findall("joint")}
    found = {}
    for name in (name for name, mimic in mimics.items() if mimic is not None):
        end, multiplier, offset = name, 1.0, 0.0
        while (mimic := mimics[end]) is not None:
            offset += multiplier * float(mimic.get("offset", 0))
            multiplier *= float(mimic.get("multiplier", 1))
            end = mimic.get("joint")
        found[name] = end, multiplier, offset
    return found


def compare(document, base, found):
    """The largest deviation, and whether Pinocchio's tree had to be projected."""
    root = [] if base == "fixed" else [ROOTS[base]()]
    robot = ElementTree.parse(document).getroot()
    joint_of = {joint.find("child").get("link"): joint.get("name") for joint in robot.findall("joint")}
    followers = leaders(robot)
    try:
        model, projected = pin.buildModelFromUrdf(str(document), *root, mimic=True), False
    except ValueError:
        model, projected = pin.buildModelFromUrdf(str(document), *root), True
    data = model.createData()
    n = sum(body["nv"] for body in found["bodies"])
    # of each joint the numbers in our v, and the map from our v to that of Pinocchio
    g, at, dofs_of = np.zeros((model.nv, n)), 0, {}
    for body in found["bodies"]:
        name = joint_of.get(body["name"], "root_joint")
        if body["nv"] > 0:
            joint = model.joints[model.getJointId(name)]
            dofs_of[name] = range(at, at + body["nv"])
            g[range(joint.idx_v, joint.idx_v + joint.nv), dofs_of[name]] = 1
            at += body["nv"]
    if projected:
        for name, (leader, multiplier, _) in followers.items():
            g[model.joints[model.getJointId(name)].idx_v, dofs_of[leader]] = multiplier
    else:
        assert n == model.nv, (n, model.nv)
    worst = 0.0
    for state in found["states"]:
        parts, at = {}, 0
        for body in found["bodies"]:
            name = joint_of.get(body["name"], "root_joint")
            parts[name] = state["q"][at : at + body["nq"]]
            at += body["nq"]
        if projected:
            for name, (leader, multiplier, offset) in followers.items():
                parts[name] = [multiplier * parts[leader][0] + offset]
        q = np.zeros(model.nq)
        for name in model.names:
            joint = model.joints[model.getJointId(name)]
            part = parts.get(name, [])
            if joint.nq == 4:
                part = [*part[:2], np.cos(part[2]), np.sin(part[2])]
            elif joint.nq == 2:
                part = [np.cos(part[0]), np.sin(part[0])]
            if len(part) == joint.nq and name != "universe":
                q[joint.idx_q : joint.idx_q + joint.nq] = part
        v, a = g @ np.array(state["v"]), g @ np.array(state["a"])
        crba = pin.crba(model, data, q)
        mass_matrix = np.triu(crba) + np.triu(crba, 1).T
        for mine, expected in [
            (state["rnea"], g.T @ pin.rnea(model, data, q, v, a)),
            (state["gravity_forces"], g.T @ pin.rnea(model, data, q, 0 * v, 0 * v)),
            (np.reshape(state["crba"], (n, n)), g.T @ mass_matrix @ g),
        ]:
            off = np.linalg.norm(mine - expected) / max(np.linalg.norm(expected), np.finfo(float).tiny)
            worst = max(worst, off)
    return worst, projected


def row(program, base, path):
    """The cells of the table for a document, and its largest deviation."""
    tree = ElementTree.parse(path)
    robot = tree.getroot()
    for joint in robot.findall("joint"):
        for dynamics in joint.findall("dynamics"):
            joint.remove(dynamics)
    with tempfile.TemporaryDirectory() as scratch:
        document = Path(scratch) / "robot.urdf"
        tree.write(document)
        ran = subprocess.run([program, N_STATES, base, document], capture_output=True, text=True, check=True)
        found = json.loads(ran.stdout)
        if "refused" in found:
            return [found["refused"], "", "", "", "–"], 0.0
        repaired(robot, found)
        tree.write(document)
        off, projected = compare(document, base, found)
    of = {"inertias": 0, "joints fixed": 0, "fixed joints that mimic": 0}
    for repair in found["repairs"]:
        tag = repair["element"].split(" ", 1)[0]
        kind = (
            "inertias"
            if tag == "link"
            else "fixed joints that mimic"
            if repair["at"] is None
            else "joints fixed"
        )
        of[kind] += 1
    cells = [
        "read"
        if not found["repairs"]
        else "repaired: " + ", ".join(f"{n} {what}" for what, n in of.items() if n),
        str(sum(body["nv"] for body in found["bodies"])),
        str(sum(body["follows"] is not None for body in found["bodies"])),
        str(found["n_shapes"]),
        f"{off:.0e}{' G' if projected else ''}",
    ]
    return cells, off


def main():
    program, base, where = sys.argv[1], sys.argv[2], Path(sys.argv[3])
    folder = where if where.is_dir() else where.parent
    paths = sorted(where.rglob("*.urdf")) if where.is_dir() else [where]
    columns = ["Outcome", "Degrees of freedom", "Followers", "Shapes", f"Off Pinocchio {pin.__version__}"]
    print("|", " | ".join([f"Document ({base} base)", *columns]), "|")
    print("|---|---|---|---|---|---|")
    worst = 0.0
    for path in paths:
        cells, off = row(program, base, path)
        worst = max(worst, off)
        print("|", " | ".join([f"`{path.relative_to(folder)}`", *cells]), "|", flush=True)
    return 0 if worst <= TOLERANCE else 1


if __name__ == "__main__":
    sys.exit(main())
