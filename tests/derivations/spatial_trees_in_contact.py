"""Spatial trees in contact with friction: dynamics by Pinocchio, DOP853 in pieces between events.

The literals in crates/somersault-contact/tests/trees/spatial_references.rs. Contacts are balls on a sphere seen from
inside, pairs of balls, and rims of a cylinder on a table that moves. All have the law

    N = -k gap - c rate                    while closed; guard gap + (c/k) max(rate, 0)
    p = kt s + ct v,  T = -p, s' = v + W x s                            stick, |p| <= mu N
    T = -mu N p/|p|,  s' = (mu N p/|p| - kt s)/ct + W x s               slip

with stretches s that begin at zero and turn with the plane of contact: W = n x n', and of a pair besides at the mean of
the spins of both about n. Each event is found by integrating again from the start of the step that holds it. It prints
the ends, by how much two tolerances differ, and the conditioning: how far an end moves where a height or a rate of the
start is moved by 1e-8, over 1e-8. It takes a minute. `pip install pin`
"""

import numpy as np
import pinocchio as pin
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

OPEN, STICK, SLIP = range(3)
PLANE = np.array([0.0, 0.0, 1.0])


def moving(data, joint, place):
    """Place, arm from the origin of the joint and velocity of a point of a link, world axes, and the spin of the link."""
    pose, motion = data.oMi[joint], data.v[joint]
    arm = pose.rotation @ place
    spin = pose.rotation @ motion.angular
    return pose.translation + arm, arm, pose.rotation @ motion.linear + np.cross(spin, arm), spin


def ball_in_bowl(joint, place, radius, centre, bowl):
    def meet(data, t):
        at, arm, velocity, spin = moving(data, joint, place)
        span = centre - at
        distance = np.linalg.norm(span)
        normal = span / distance
        turn = np.cross(normal, -(velocity - normal * (normal @ velocity)) / distance)
        down = -radius * normal
        return bowl - distance - radius, normal, velocity + np.cross(spin, down), turn, [(joint, arm + down)]

    return meet


def pair(first, second):
    (a, at_a, radius_a), (b, at_b, radius_b) = first, second

    def meet(data, t):
        place_a, arm_a, velocity_a, spin_a = moving(data, a, at_a)
        place_b, arm_b, velocity_b, spin_b = moving(data, b, at_b)
        span = place_a - place_b
        distance, total = np.linalg.norm(span), radius_a + radius_b
        normal = span / distance
        down, up = -span * radius_a / total, span * radius_b / total
        velocity = velocity_a + np.cross(spin_a, down) - velocity_b - np.cross(spin_b, up)
        turn = (
            np.cross(normal, velocity_a - velocity_b) / distance + normal * (normal @ (spin_a + spin_b)) / 2
        )
        return distance - total, normal, velocity, turn, [(a, arm_a + down), (b, arm_b + up)]

    return meet


def rim(joint, centre, axis, radius, table):
    def meet(data, t):
        at, arm, velocity, spin = moving(data, joint, centre)
        along = data.oMi[joint].rotation @ axis
        down = along * (along @ PLANE) - PLANE
        slope = np.linalg.norm(down)
        reach = down * radius / slope
        velocity = velocity + np.cross(spin, reach) - np.array([table(t), 0.0, 0.0])
        return PLANE @ at - radius * slope, PLANE, velocity, np.zeros(3), [(joint, arm + reach)]

    return meet


def quaternion_rate(quaternion, rate):
    """Of x, y, z, w by an angular velocity in the axes of the body."""
    vector, w = quaternion[:3], quaternion[3]
    return 0.5 * np.append(w * rate + np.cross(vector, rate), -vector @ rate)


def simulate(scene, q, v, tolerance):
    model, contacts = scene["model"], scene["contacts"]
    k, c, mu, kt, ct = scene["law"]
    data, m, nq, nv = model.createData(), len(contacts), model.nq, model.nv

    def configuration_rate(q, v):
        turn = pin.Quaternion(q[6], *q[3:6]).normalized().toRotationMatrix()
        rest = quaternion_rate(q[7:], v[6:]) if nq == 11 else v[6:]
        return np.concatenate([turn @ v[:3], quaternion_rate(q[3:7], v[3:6]), rest])

    def seen(t, y):
        q = y[:nq].copy()
        for i in (3, 7) if nq == 11 else (3,):
            q[i : i + 4] /= np.linalg.norm(q[i : i + 4])
        pin.forwardKinematics(model, data, q, y[nq : nq + nv])
        for i, meet in enumerate(contacts):
            gap, normal, velocity, turn, arms = meet(data, t)
            rate = normal @ velocity
            s = y[nq + nv + 3 * i :][:3]
            yield i, gap, rate, normal, kt * s + ct * (velocity - rate * normal), s, turn, arms

    def rhs(t, y, mode):
        q, v = y[:nq].copy(), y[nq : nq + nv]
        forces = [np.zeros(6) for _ in range(model.njoints)]
        stretching = np.zeros((m, 3))
        for i, gap, rate, normal, p, s, turn, arms in seen(t, y):
            if mode[i] == OPEN:
                continue
            push = -k * gap - c * rate
            if mode[i] == STICK:
                stretching[i] = (p - kt * s) / ct + np.cross(turn, s)
            else:
                p = mu * push * p / np.linalg.norm(p)
                stretching[i] = (p - kt * s) / ct + np.cross(turn, s)
            force = push * normal - p
            for sign, (joint, arm) in zip((1.0, -1.0), arms):
                back = data.oMi[joint].rotation.T
                forces[joint] += sign * np.concatenate([back @ force, back @ np.cross(arm, force)])
        for i in (3, 7) if nq == 11 else (3,):
            q[i : i + 4] /= np.linalg.norm(q[i : i + 4])
        change = pin.aba(model, data, q, v, np.zeros(nv), [pin.Force(force) for force in forces])
        return np.concatenate([configuration_rate(y[:nq], v), change, stretching.ravel()])

    def margins(t, y, mode):
        """Positive inside the mode: of each contact, then of its friction."""
        out = np.ones((2, m))
        for i, gap, rate, _, p, *_ in seen(t, y):
            guard = gap + c / k * max(rate, 0.0)
            out[0, i] = guard if mode[i] == OPEN else -guard
            if mode[i] != OPEN:
                hold = mu * (-k * gap - c * rate) - np.linalg.norm(p)
                out[1, i] = hold if mode[i] == STICK else -hold
        return out.ravel()

    options = {"rtol": max(tolerance, 3e-14), "atol": tolerance * 1e-2}
    t, y = 0.0, np.concatenate([q, v, np.zeros(3 * m)])
    mode, events = [OPEN] * m, []
    while True:
        solver = DOP853(lambda t, y: rhs(t, y, mode), t, y, scene["end"], max_step=2e-3, **options)
        crossed = []
        while solver.status == "running" and not crossed:
            solver.step()
            inside, t0 = solver.dense_output(), solver.t_old
            times = np.linspace(t0, solver.t, 9)
            of_times = [margins(s, inside(s), mode) for s in times]
            crossed = [j for j in range(1, 9) if np.any(of_times[j] < 0.0)]
        if not crossed:
            y = solver.y
            for i in (3, 7) if nq == 11 else (3,):
                y[i : i + 4] /= np.linalg.norm(y[i : i + 4])
            return y[: nq + nv], events
        y0, j, roots = inside(t0), crossed[0], []

        def again(s):
            run = lambda: solve_ivp(rhs, (t0, s), y0, method="DOP853", args=(mode,), **options).y[:, -1]
            return run() if s > t0 else y0

        for guard in np.flatnonzero(of_times[j] < 0.0):
            low, high = times[j - 1], times[j]
            f = lambda s: margins(s, again(s), mode)[guard]
            assert f(low) > 0.0 > f(high), (t, mode, guard, f(low), f(high))
            roots.append((brentq(f, low, high, xtol=1e-16, rtol=1e-15), int(guard)))
        t, guard = min(roots)
        y, i = again(t).copy(), guard % m
        if guard >= m:
            mode[i] = SLIP if mode[i] == STICK else STICK
        else:
            y[nq + nv + 3 * i :][:3] = 0.0
            _, gap, rate, _, p, *_ = list(seen(t, y))[i]
            holds = mu * max(-k * gap - c * rate, 0.0) >= np.linalg.norm(p)
            mode[i] = OPEN if mode[i] != OPEN else STICK if holds else SLIP
        events.append((t, i, ("open", "stick", "slip")[mode[i]]))


def tree(links, joint, place):
    """A free link and another one on a joint: mass, centre of mass, moments of inertia about it."""
    model = pin.Model()
    parent = 0
    for (mass, centre, moments), kind, at in zip(
        links, (pin.JointModelFreeFlyer(), joint), (np.zeros(3), place)
    ):
        parent = model.addJoint(parent, kind, pin.SE3(np.eye(3), np.array(at)), str(parent))
        model.appendBodyToJoint(
            parent, pin.Inertia(mass, np.array(centre), np.diag(moments)), pin.SE3.Identity()
        )
    return model


def start(height, turn):
    axis = np.array(turn, dtype=float)
    angle = np.linalg.norm(axis)
    return [0.0, 0.0, height, *(np.sin(angle / 2) * axis / angle), np.cos(angle / 2)]


hinged = [(1.0, [0.0, 0.0, -0.12], [0.010, 0.012, 0.004]), (0.7, [0.0, 0.0, -0.1], [0.006, 0.005, 0.002])]
wheel = [(1.2, [0.0, 0.0, 0.0], [0.013, 0.025, 0.013]), (0.5, [0.0, 0.0, -0.12], [0.003, 0.003, 0.001])]
bowl = np.array([0.0, 0.0, 1.0])
scenes = {
    "two links on a ball joint in a bowl": dict(
        model=tree(hinged, pin.JointModelSpherical(), [0.0, 0.0, -0.25]),
        contacts=[
            ball_in_bowl(1, np.zeros(3), 0.05, bowl, 1.0),
            ball_in_bowl(2, np.array([0.0, 0.0, -0.22]), 0.04, bowl, 1.0),
            pair((1, np.array([0.1, 0.0, -0.05]), 0.06), (2, np.array([0.1, 0.0, -0.12]), 0.05)),
        ],
        law=(2e4, 40.0, 0.4, 1.5e4, 50.0),
        end=0.4,
        start=(
            [*start(0.62, [0.3, 0.5, 0.2]), *start(0.0, [0.2, -0.4, 0.1])[3:]],
            [0.4, 0.2, 0.0, 1.0, 0.5, -0.8, 0.5, -7.0, 0.6],
        ),
    ),
    "a wheel with a pendulum on a shaking table": dict(
        model=tree(wheel, pin.JointModelRY(), [0.0, 0.0, 0.0]),
        contacts=[
            rim(
                1,
                np.array([0.0, side, 0.0]),
                np.array([0.0, 1.0, 0.0]),
                0.2,
                lambda t: 1.35 * np.cos(9.0 * t),
            )
            for side in (-0.03, 0.03)
        ],
        law=(2e4, 60.0, 0.4, 1.5e4, 60.0),
        end=0.7,
        start=([*start(0.24, [0.25, 0.0, 0.1]), 0.8], [0.8, 0.1, 0.0, 0.3, 2.0, 0.1, 1.5]),
    ),
}
if __name__ == "__main__":
    for name, scene in scenes.items():
        q, v = (np.array(part) for part in scene["start"])
        fine, events = simulate(scene, q, v, 1e-13)
        coarse, _ = simulate(scene, q, v, 1e-11)
        moved = [
            simulate(scene, q + 1e-8 * np.eye(len(q))[2], v, 1e-13)[0],
            simulate(scene, q, v + 1e-8 * np.eye(len(v))[4], 1e-13)[0],
        ]
        print(name, len(events), "events", " ".join(f"{i}:{mode}" for _, i, mode in events))
        print("  first and last", events[0][0], events[-1][0])
        print("  q", [float(f"{value:.13g}") for value in fine[: len(q)]])
        print("  v", [float(f"{value:.13g}") for value in fine[len(q) :]])
        print(
            "  tolerances differ by",
            abs(fine - coarse).max(),
            "conditioning",
            max(abs(end - fine).max() for end in moved) / 1e-8,
            flush=True,
        )
