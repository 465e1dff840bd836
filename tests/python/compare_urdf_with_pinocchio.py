"""Dynamics of a URDF model against Pinocchio (`pip install pin`), which reads the same document.

    cargo run --release -p somersault-testkit --example dump_urdf -- \\
        100 free tests/urdf/humanoid.urdf > states.json
    python tests/python/compare_urdf_with_pinocchio.py states.json free tests/urdf/humanoid.urdf

Pinocchio orders joints by name within each branch, stores continuous joints and the angle of planar ones
as cosine and sine, and has no root on a fixed base. Velocities agree. Documents must be without damping,
which Pinocchio reads but does not apply. Prints the largest deviation of each quantity relative to the
norm of its own matrix and fails above 1e-10.
"""

import json
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin

TOLERANCE = 1e-10


def main():
    path, base, document = sys.argv[1:]
    with open(path) as file:
        found = json.load(file)
    roots = {"planar": pin.JointModelPlanar, "free": pin.JointModelFreeFlyer}
    if base == "fixed":
        model = pin.buildModelFromUrdf(document)
    else:
        model = pin.buildModelFromUrdf(document, roots[base]())
    data = model.createData()
    joint_of = {
        joint.find("child").get("link"): joint.get("name")
        for joint in ElementTree.parse(document).getroot().findall("joint")
    }
    worst = {}
    for state in found["states"]:
        q, at, dof = np.zeros(model.nq), 0, 0
        dofs = np.zeros(model.nv, dtype=int)
        for body in found["bodies"]:
            part = state["q"][at : at + body["nq"]]
            if body["nv"] > 0:
                joint = model.joints[model.getJointId(joint_of.get(body["name"], "root_joint"))]
                dofs[joint.idx_v : joint.idx_v + joint.nv] = range(dof, dof + joint.nv)
                if joint.nq == 4:
                    part = [*part[:2], np.cos(part[2]), np.sin(part[2])]
                elif joint.nq == 2:
                    part = [np.cos(part[0]), np.sin(part[0])]
                q[joint.idx_q : joint.idx_q + joint.nq] = part
            at, dof = at + body["nq"], dof + body["nv"]
        assert dof == model.nv, (dof, model.nv)
        v, a = (np.array(state[k])[dofs] for k in ("v", "a"))
        crba = pin.crba(model, data, q)
        mass_matrix = np.triu(crba) + np.triu(crba, 1).T
        for name, mine, expected in [
            ("rnea", np.array(state["rnea"])[dofs], pin.rnea(model, data, q, v, a)),
            (
                "gravity_forces",
                np.array(state["gravity_forces"])[dofs],
                pin.computeGeneralizedGravity(model, data, q),
            ),
            ("crba", np.reshape(state["crba"], (model.nv, model.nv))[np.ix_(dofs, dofs)], mass_matrix),
        ]:
            off = np.linalg.norm(mine - expected) / np.linalg.norm(expected)
            worst[name] = max(worst.get(name, 0.0), off)
    print(f"pinocchio {pin.__version__}, {document}, {base} base, {model.nv} degrees of freedom")
    for name, value in worst.items():
        print(f"{name:20} {value:8.1e}")
    return 0 if all(value <= TOLERANCE for value in worst.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
