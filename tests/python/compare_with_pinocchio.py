"""Dynamics of random trees against Pinocchio (`pip install pin`).

    cargo run --release -p somersault-testkit --example dump_trees -- 1000 > trees.json
    python tests/python/compare_with_pinocchio.py trees.json

Both take body-frame velocities with the linear part first, so q, v and a differ only in the order of the
joints, which Pinocchio wants depth first, and for planar joints, whose angle it stores as cosine and sine.
Partials with respect to q are along q + v of the joints' groups at fixed components of v in both, the twist
of a free root in its own axes among them, so they too differ only in order. Bodies on fixed joints are merged
into the body that carries them. Prints the largest deviation of each quantity relative to the norm of its own
matrix and fails above 1e-10; forward dynamics and its partials may deviate by 100 eps cond(M) more.
Partials of forward dynamics are compared with -M^-1 times Pinocchio's partials of inverse dynamics; how far
its own computeABADerivatives is from that is printed beside them and not judged.
`benches/peers/multibody.py` compares times.
"""

import json
import sys

import numpy as np
import pinocchio as pin

TOLERANCE = 1e-10


def square(numbers):
    return np.reshape(numbers, (3, 3), order="F")


SIZES = {  # of q and v
    "fixed": (0, 0),
    "revolute": (1, 1),
    "prismatic": (1, 1),
    "spherical": (4, 3),
    "planar": (3, 3),
    "free": (7, 6),
}


ROWS = {
    "momentum_matrix": 6,
    "jacobian_frame": 6,
    "jacobian_world": 6,
    "center_q": 3,
    "momentum_q": 6,
}

PARTIALS = [f"{dynamics}_{by}" for dynamics in ("rnea", "aba") for by in ("q", "v", "input")]


def depth_first(bodies):
    """The numbers of the bodies, each subtree in one piece."""
    order, stack = [], [i for i, body in enumerate(bodies) if body["parent"] < 0]
    while stack:
        i = stack.pop()
        order.append(i)
        stack += [j for j, body in enumerate(bodies) if body["parent"] == i]
    return order


def build(case):
    """The model, and for each body its joint and its pose on it."""
    model = pin.Model()
    model.gravity.linear = np.array(case["gravity"])
    places = [None] * len(case["bodies"])
    for i in depth_first(case["bodies"]):
        body = case["bodies"][i]
        placement = pin.SE3(square(body["rotation"]), np.array(body["origin"]))
        joint, on_joint = (0, pin.SE3.Identity()) if body["parent"] < 0 else places[body["parent"]]
        placement = on_joint * placement
        axis = np.array(body["axis"])
        kinds = {
            "revolute": lambda axis=axis: pin.JointModelRevoluteUnaligned(axis),
            "prismatic": lambda axis=axis: pin.JointModelPrismaticUnaligned(axis),
            "spherical": pin.JointModelSpherical,
            "planar": pin.JointModelPlanar,
            "free": pin.JointModelFreeFlyer,
        }
        if body["kind"] != "fixed":
            joint = model.addJoint(joint, kinds[body["kind"]](), placement, f"b{i}")
            placement = pin.SE3.Identity()
        mass = body["mass"]
        if mass > 0:
            center = np.array(body["first_moment"]) / mass
            shift = mass * (center @ center * np.eye(3) - np.outer(center, center))
            inertia = pin.Inertia(mass, center, square(body["inertia"]) - shift)
            model.appendBodyToJoint(joint, inertia, placement)
        places[i] = (joint, placement)
    return model, places


def positions(case):
    """q in Pinocchio's order and coordinates, and the order of the degrees of freedom."""
    starts = np.cumsum([(0, 0)] + [SIZES[body["kind"]] for body in case["bodies"]], axis=0)
    q, dofs = [], []
    for i in depth_first(case["bodies"]):
        (at, dof), (end, last) = starts[i], starts[i + 1]
        part = case["q"][at:end]
        planar = case["bodies"][i]["kind"] == "planar"
        q += [part[0], part[1], np.cos(part[2]), np.sin(part[2])] if planar else part
        dofs += range(dof, last)
    return np.array(q), np.array(dofs, dtype=int)


def rest(case):
    """Bodies merged into the world have energy there; Pinocchio leaves them out."""
    total = 0.0
    for (joint, place), body in zip(build(case)[1], case["bodies"], strict=True):
        if joint == 0 and body["mass"] > 0:
            center = place.act(np.array(body["first_moment"]) / body["mass"])
            total -= body["mass"] * np.dot(case["gravity"], center)
    return total


def mirrored(matrix, n):
    """The symmetric matrix whose upper triangle is given."""
    upper = np.triu(np.reshape(matrix, (n, n)))
    return upper + np.triu(upper, 1).T


def deviations(case):
    model, places = build(case)
    data = model.createData()
    q, dofs = positions(case)
    v, a, torque = (np.array(case[k], dtype=float)[dofs] for k in ("v", "a", "torque"))
    n = model.nv
    wrenches = [pin.Force.Zero() for _ in range(model.njoints)]
    for (joint, place), wrench in zip(places, np.reshape(case["wrenches"], (-1, 6)), strict=True):
        wrenches[joint] = wrenches[joint] + place.act(pin.Force(wrench))

    def off(name, expected, scale=1e-300):
        """Relative deviation; matrices and vectors over the degrees of freedom are reordered.

        What is zero but for rounding is taken relative to `scale`, the size of its terms.
        """
        # a matrix with one column comes as a vector
        rows = ROWS.get(name, n if name == "crba" or name in PARTIALS else None)
        expected = np.asarray(expected) if rows is None else np.reshape(expected, (rows, n))
        found = np.reshape(case[name], expected.shape, order="F")
        if name in ("rnea", "aba", "bias", "gravity_forces"):
            found = found[dofs]
        elif name == "crba" or name in PARTIALS:
            found = found[np.ix_(dofs, dofs)]
        elif rows is not None:
            found = found[:, dofs]
        norm = np.linalg.norm(expected)
        return np.linalg.norm(found - expected) / (norm if norm > 1e-12 * scale else scale)

    out = {}
    if n > 0:
        out["rnea"] = off("rnea", pin.rnea(model, data, q, v, a, wrenches))
        mass_matrix = mirrored(pin.crba(model, data, q), n)
        out["crba"] = off("crba", mass_matrix)
        aba = off("aba", pin.aba(model, data, q, v, torque, wrenches))
        slack = 100 * np.finfo(float).eps * np.linalg.cond(mass_matrix)
        out["aba (excess)"] = aba if aba > slack else 0.0
        by_q, by_v, by_a = pin.computeRNEADerivatives(model, data, q, v, a, wrenches)
        speed = np.linalg.norm(mass_matrix) * (1 + np.linalg.norm(v))
        out["rnea_q"] = off("rnea_q", by_q, speed)
        out["rnea_v"] = off("rnea_v", by_v, speed)
        out["rnea_input"] = off("rnea_input", mirrored(by_a, n))
        acceleration = pin.aba(model, data, q, v, torque, wrenches).copy()
        by_q, by_v, _ = pin.computeRNEADerivatives(model, data, q, v, acceleration, wrenches)
        implicit = {
            "q": -np.linalg.solve(mass_matrix, np.reshape(by_q, (n, n))),
            "v": -np.linalg.solve(mass_matrix, np.reshape(by_v, (n, n))),
            "input": np.linalg.inv(mass_matrix),
        }
        pin.computeABADerivatives(model, data, q, v, torque, wrenches)
        direct = {"q": data.ddq_dq, "v": data.ddq_dv, "input": mirrored(data.Minv, n)}
        for by in implicit:
            deviation = off(f"aba_{by}", implicit[by], speed)
            out[f"aba_{by} (excess)"] = deviation if deviation > slack else 0.0
            own = np.linalg.norm(np.reshape(direct[by], (n, n)) - implicit[by])
            own /= max(np.linalg.norm(implicit[by]), 1e-12 * speed)
            out[f"Pinocchio's own aba_{by}"] = own if own > slack else 0.0
        out["bias"] = off("bias", pin.nonLinearEffects(model, data, q, v))
        out["gravity_forces"] = off("gravity_forces", pin.computeGeneralizedGravity(model, data, q))
        joint, place = places[-1]
        frame = place * pin.SE3(square(case["frame_rotation"]), np.array(case["frame_origin"]))
        number = model.addFrame(pin.Frame("tip", joint, 0, frame, pin.FrameType.OP_FRAME))
        framed = model.createData()
        for name, reference in [("jacobian_frame", pin.LOCAL), ("jacobian_world", pin.LOCAL_WORLD_ALIGNED)]:
            expected = pin.computeFrameJacobian(model, framed, q, number, reference)
            if np.linalg.norm(expected) > 0:
                out[name] = off(name, expected)
        out["kinetic_energy"] = off("kinetic_energy", [pin.computeKineticEnergy(model, data, q, v)])
        potential = pin.computePotentialEnergy(model, data, q) + rest(case)
        out["potential_energy"] = off("potential_energy", [potential])
        # a root fixed to the world belongs to Pinocchio's universe, which its centroid leaves out
        if all(joint > 0 for joint, _ in places):
            out["momentum_matrix"] = off("momentum_matrix", pin.computeCentroidalMap(model, data, q))
            out["momentum"] = off("momentum", pin.computeCentroidalMomentum(model, data, q, v).vector)
            out["center_q"] = off("center_q", pin.jacobianCenterOfMass(model, data, q))
            by_q = pin.computeCentroidalDynamicsDerivatives(model, data, q, v, a)[0]
            out["momentum_q"] = off("momentum_q", by_q, speed)
            out["center_of_mass"] = off("center_of_mass", pin.centerOfMass(model, data, q))
    return out


def main():
    with open(sys.argv[1]) as file:
        cases = json.load(file)
    worst, exceeding = {}, {}
    for number, case in enumerate(cases):
        for name, value in deviations(case).items():
            if value >= worst.get(name, (-1.0, 0))[0] or np.isnan(value):
                worst[name] = (value, number)
            exceeding[name] = exceeding.get(name, 0) + (value > TOLERANCE)
    print(
        f"pinocchio {pin.__version__}, {len(cases)} trees; largest relative deviation, its case, number above"
    )
    for name, (value, number) in worst.items():
        print(f"{name:26} {value:8.1e} {number:5} {exceeding[name]:5}")
    judged = (value for name, (value, _) in worst.items() if not name.startswith("Pinocchio"))
    return 0 if all(value <= TOLERANCE for value in judged) else 1


if __name__ == "__main__":
    sys.exit(main())
