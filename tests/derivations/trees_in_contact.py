"""Planar chains in contact with friction: equations by SymPy in minimal coordinates, DOP853 in pieces between events.

The literals in crates/somersault-contact/tests/trees/references.rs. A chain is a hinge at (x, z), free or fixed, and
links with absolute angles a, which point along (sin a, -cos a). Its contacts are points on links with the law

    F = -k gap - c rate                     while closed; guard gap + (c/k) max(rate, 0)
    p = kt s + ct v,  T = -p, s' = v        stick, |p| <= mu F
    T = -mu F sign p, s' = (mu F sign p - kt s)/ct        slip

with stretches s that begin at zero. Each event is found by integrating again from the start of the step that holds it.
It prints the ends, by how much two tolerances differ, and the conditioning: how far an end moves where a coordinate of
the start is moved by 1e-8, over 1e-8. It takes 10 s.
"""

import numpy as np
import sympy as sp
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq


def chain(masses, moments, lengths, centers, free):
    """Mass matrix, forces without contacts, and points with their derivatives, as functions of coordinates and rates."""
    n = len(masses)
    a, da = sp.symbols(f"a:{n}"), sp.symbols(f"b:{n}")
    x, z, dx, dz = sp.symbols("x z dx dz")
    q, v = ((x, z, *a), (dx, dz, *da)) if free else (a, da)
    hinge, g = (sp.Matrix([x, z]) if free else sp.zeros(2, 1)), sp.Symbol("g")
    along = [sp.Matrix([sp.sin(t), -sp.cos(t)]) for t in a]
    joints = [hinge]
    for i in range(n):
        joints.append(joints[-1] + lengths[i] * along[i])
    places = [joints[i] + centers[i] * along[i] for i in range(n)]
    speed = lambda p: p.jacobian(q) * sp.Matrix(v)
    kinetic = sum(
        sp.Rational(1, 2) * masses[i] * speed(places[i]).dot(speed(places[i]))
        + sp.Rational(1, 2) * moments[i] * da[i] ** 2
        for i in range(n)
    )
    potential = sum(masses[i] * g * places[i][1] for i in range(n))
    momenta = sp.Matrix([sp.diff(kinetic, r) for r in v])
    mass = momenta.jacobian(v)
    force = sp.Matrix([sp.diff(kinetic - potential, s) for s in q]) - momenta.jacobian(q) * sp.Matrix(v)
    points = sp.Matrix.hstack(*joints).T
    jacobians = [p.jacobian(q) for p in joints]
    make = lambda e: sp.lambdify((q, v, g), e, "numpy", cse=True)
    return make(mass), make(force), make(points), make(sp.Matrix.vstack(*jacobians))


class Plane:
    def __init__(self, slope):
        self.normal = np.array([-np.sin(slope), np.cos(slope)])

    def at(self, p):
        return self.normal @ p, self.normal


class Ball:
    def __init__(self, center, radius):
        self.center, self.radius = np.array(center), radius

    def at(self, p):
        arm = p - self.center
        return np.hypot(*arm) - self.radius, arm / np.hypot(*arm)


def simulate(scene, start, tolerance):
    mass, force, points, jacobians = scene["chain"]
    where, surface = scene["contacts"], scene["surface"]
    k, c, mu, kt, ct = scene["law"]
    n, m, g = len(start) // 2, len(where), 9.81

    def seen(y):
        q, v = y[:n], y[n : 2 * n]
        p, j = points(q, v, g), np.asarray(jacobians(q, v, g)).reshape(-1, 2, n)
        for i, joint in enumerate(where):
            gap, normal = surface.at(p[joint])
            tangent = np.array([normal[1], -normal[0]])
            velocity = j[joint] @ v
            yield i, j[joint], normal, tangent, gap, normal @ velocity, tangent @ velocity

    def rhs(t, y, mode):
        q, v = y[:n], y[n : 2 * n]
        f = np.asarray(force(q, v, g)).ravel()
        ds = np.zeros(m)
        for i, j, normal, tangent, gap, rate, sliding in seen(y):
            if mode[i] == "open":
                continue
            push, s = -k * gap - c * rate, y[2 * n + i]
            p = kt * s + ct * sliding
            if mode[i] == "stick":
                ds[i] = sliding
            else:
                p = mu * push * np.sign(p)
                ds[i] = (p - kt * s) / ct
            f = f + j.T @ (push * normal - p * tangent)
        return np.concatenate([v, np.linalg.solve(mass(q, v, g), f), ds])

    def margins(y, mode):
        """Positive inside the mode: of each contact, then of its friction."""
        out = np.ones((2, m))
        for i, _, _, _, gap, rate, sliding in seen(y):
            guard = gap + c / k * max(rate, 0.0)
            out[0, i] = guard if mode[i] == "open" else -guard
            if mode[i] != "open" and mu > 0.0:
                hold = mu * (-k * gap - c * rate) - abs(kt * y[2 * n + i] + ct * sliding)
                out[1, i] = hold if mode[i] == "stick" else -hold
        return out.ravel()

    options = {"rtol": max(tolerance, 3e-14), "atol": tolerance * 1e-2}
    t, y = 0.0, np.concatenate([start, np.zeros(m)])
    mode, events = ["open"] * m, []
    while t < scene["end"]:
        solver = DOP853(lambda t, y: rhs(t, y, mode), t, y, scene["end"], max_step=2e-3, **options)
        while solver.status == "running":
            solver.step()
            inside, t0, y0 = solver.dense_output(), solver.t_old, None
            times = np.linspace(t0, solver.t, 9)
            seen_margins = [margins(inside(s), mode) for s in times]
            crossed = [j for j in range(1, 9) if np.any(seen_margins[j] < 0.0)]
            if crossed:
                break
        if not crossed:
            y = solver.y
            break
        y0 = inside(t0)

        def again(s):
            return (
                solve_ivp(rhs, (t0, s), y0, method="DOP853", args=(mode,), **options).y[:, -1]
                if s > t0
                else y0
            )

        j = crossed[0]
        roots = []
        for guard in np.flatnonzero(seen_margins[j] < 0.0):
            low, high = times[j - 1], times[j]
            f = lambda s: margins(again(s), mode)[guard]
            assert f(low) > 0.0 > f(high), (t, mode, guard, f(low), f(high))
            roots.append((brentq(f, low, high, xtol=1e-16, rtol=1e-15), guard))
        t, guard = min(roots)
        y, i = again(t), guard % m
        mode = list(mode)
        if guard >= m:
            mode[i] = "slip" if mode[i] == "stick" else "stick"
        elif mode[i] == "open":
            y[2 * n + i] = 0.0
            _, _, _, _, gap, rate, sliding = list(seen(y))[i]
            held = mu * max(-k * gap - c * rate, 0.0) >= abs(ct * sliding)
            mode[i] = "stick" if held or mu == 0.0 else "slip"
        else:
            y[2 * n + i], mode[i] = 0.0, "open"
        events.append((t, i, mode[i]))
    return y, events


rod = chain([0.8], [0.8 * 0.6**2 / 12], [0.6], [0.3], True)
arm = chain([1.0, 0.7], [0.02, 0.01], [0.5, 0.4], [0.22, 0.18], False)
three = chain([0.9, 0.6, 0.5], [0.02, 0.01, 0.008], [0.4, 0.35, 0.3], [0.2, 0.16, 0.14], True)
scenes = {
    "a rod that falls": dict(
        chain=rod,
        contacts=[0, 1],
        surface=Plane(0.0),
        law=(2e4, 40.0, 0.3, 1.5e4, 50.0),
        end=0.6,
        start=[0.0, 0.7, 0.5, 0.4, 0.0, 0.3],
    ),
    "a double pendulum and a ball": dict(
        chain=arm,
        contacts=[1, 2],
        surface=Ball((0.2, -0.9), 0.35),
        law=(3e4, 30.0, 0.4, 2e4, 40.0),
        end=1.6,
        start=[-1.2, -0.7, 0.0, 0.5],
    ),
    "a chain on a slope": dict(
        chain=three,
        contacts=[0, 1, 2, 3],
        surface=Plane(0.35),
        law=(2e4, 40.0, 0.5, 1.5e4, 50.0),
        end=0.7,
        start=[0.0, 0.65, 1.3, 1.6, 1.1, 0.2, 0.0, 0.0, 0.5, -0.5],
    ),
}
if __name__ == "__main__":
    for name, scene in scenes.items():
        start = np.array(scene["start"])
        n = len(start)
        fine, events = simulate(scene, start, 1e-13)
        coarse, _ = simulate(scene, start, 1e-11)
        moved, _ = simulate(scene, start + 1e-8 * np.eye(n)[n // 2 - 1], 1e-13)
        print(name, len(events), "events", " ".join(f"{i}:{mode}" for _, i, mode in events))
        print("  first and last", events[0][0], events[-1][0])
        print("  end", [float(f"{value:.13g}") for value in fine[:n]])
        print(
            "  tolerances differ by",
            abs(fine - coarse)[:n].max(),
            "conditioning",
            abs(moved - fine)[:n].max() / 1e-8,
            flush=True,
        )
