"""Costs of tests/python/control_problems.py that have no closed form, and closed forms that take some lines.

Three ways, none of which is the library's: closed forms; arcs of known kind, integrated by SciPy's DOP853 with their
durations solved for; and, for motions without arcs, collocation in CasADi at 6 Radau points an interval, whose states
and multipliers start the multiple shooting of states and costates by DOP853.

Motions that its own starts do not lead to are those of the library: states and costates at ten nodes a second, rounded
to three decimals, start the same shooting.

    python optimal_control.py                                closed forms and arcs
    python optimal_control.py "double pendulum" 2 6          shooting from a straight line and six random starts
    PYTHONPATH=../../python python optimal_control.py acrobot   shooting from what the library finds

CasADi 3.8.2, SciPy 1.17.1.
"""

import sys
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

DEGREE = 6
G = 9.81


# ------------------------------------------------------------------------------------------------- closed forms


def turnpike(horizon=30.0, start=0.0, end=3.0):
    """x' = -x + u, 1/2 int (x - 2)^2 + u^2: rest at x = u = 1 costs one a second; y = x - 1 is a regulator."""
    a, b, r = start - 1, end - 1, np.sqrt(2.0)
    coth, csch = 1 / np.tanh(r * horizon), 1 / np.sinh(r * horizon)
    first, last = r * (a * coth - b * csch) - a, r * (b * coth - a * csch) + b
    return horizon + b - a + 0.5 * (a * first + b * last)


def harvest(horizon=10.0, start=0.2):
    """x' = x (1 - x) - u x, 0 <= u <= 1, most of int u x: none until x = 1/2, half of it, all of it for the last 2 s."""
    wait = np.log(0.5 / 0.5 * (1 - start) / start)
    return -((horizon - 2 - wait) / 4 + np.log(2))


def dubins(start, end):
    """Lengths of the six words between (x, y, heading) with turns of radius 1, the final heading without whole turns
    added: the least length of the word whose turns end at this very heading."""
    words = {}
    centre = lambda p, side: np.array([p[0] - side * np.sin(p[2]), p[1] + side * np.cos(p[2])])
    turn = lambda side, a, b: (side * (b - a)) % (2 * np.pi)
    for s in (1, -1):
        for e in (1, -1):
            a, b = centre(start, s), centre(end, e)
            d = np.hypot(*(b - a))
            along = np.arctan2(*(b - a)[::-1])
            if s == e:
                heading, straight = along, d
            elif d >= 2:
                straight = np.sqrt(d * d - 4)
                heading = along + s * np.arctan2(2, straight)
            else:
                continue
            first, last = turn(s, start[2], heading), turn(e, heading, end[2])
            name = "LR"[s < 0] + "S" + "LR"[e < 0]
            words[name] = first + straight + last, start[2] + s * first + e * last
        a, b = centre(start, s), centre(end, s)
        d = np.hypot(*(b - a))
        if d < 4:
            along = np.arctan2(*(b - a)[::-1])
            for side in (1, -1):
                # the middle circle touches both, left or right of the line between them
                m = a + 2 * np.array(
                    [np.cos(along + side * np.arccos(d / 4)), np.sin(along + side * np.arccos(d / 4))]
                )
                h1 = np.arctan2(*(m - a)[::-1]) + s * np.pi / 2
                h2 = np.arctan2(*(m - b)[::-1]) + s * np.pi / 2
                first, middle, last = turn(s, start[2], h1), turn(-s, h1, h2), turn(s, h2, end[2])
                name = "LR"[s < 0] + "LR"[s > 0] + "LR"[s < 0]
                length = first + middle + last
                if name not in words or length < words[name][0]:
                    words[name] = length, start[2] + s * (first - middle + last)
    fits = {k: v for k, (v, heading) in words.items() if abs(heading - end[2]) < 1e-9}
    return min(fits.items(), key=lambda item: item[1])


def disk(height=0.1):
    """Two tangents and an arc below the disk, in a second: the square of the length."""
    d = np.hypot(2, height)
    return (2 * np.sqrt(d * d - 1) + np.pi - 2 * np.arctan(height / 2) - 2 * np.arccos(1 / d)) ** 2


# --------------------------------------------------------------------------------------------------------- arcs


def flow(rates, x, duration, events=None):
    return solve_ivp(
        lambda _, x: rates(x), (0, duration), x, method="DOP853", rtol=1e-13, atol=1e-15, events=events
    )


def goddard(fastest=np.inf):
    """Full thrust until D (1 + v/c) = m g, that surface (and then the greatest speed) until the fuel is spent, coasting."""
    drag = lambda r, v: 310 * v * v * np.exp(-500 * (r - 1))

    def rates(u):
        def of(x):
            r, v, m = x
            thrust = u(x) if callable(u) else u
            return [v, (3.5 * thrust - drag(r, v)) / m - 1 / r**2, -7 * thrust]

        return of

    surface = lambda _, x: drag(x[0], x[1]) * (1 + x[1] / 0.5) - x[2] / x[0] ** 2

    def singular(x):
        r, v, m = x
        by = np.array(
            [
                -500 * drag(r, v) * (1 + 2 * v) + 2 * m / r**3,
                2 * drag(r, v) / v * (1 + 2 * v) + 2 * drag(r, v),
                -1 / r**2,
            ]
        )
        idle, full = by @ np.array(rates(0.0)(x)), by @ np.array(rates(1.0)(x))
        return -idle / (full - idle)

    hold = lambda x: (drag(x[0], x[1]) + x[2] / x[0] ** 2) / 3.5
    spent = lambda _, x: x[2] - 0.6
    fast = lambda _, x: x[1] - fastest
    top = lambda _, x: x[1]
    for event in (surface, spent, fast, top):
        event.terminal = True
    x, times = np.array([1.0, 0.0, 1.0]), []
    arcs = [(1.0, [surface]), (singular, [spent, fast] if np.isfinite(fastest) else [spent])]
    arcs += [(hold, [spent])] if np.isfinite(fastest) else []
    for u, events in [*arcs, (0.0, [top])]:
        # off the surface at which the arc begins
        found = flow(rates(u), x, 1.0, events)
        x = found.y[:, -1]
        times.append(found.t[-1])
    return -x[0], np.cumsum(times)


def reorientation():
    """Six arcs between five switches; what they leave of attitude and spin are as many equations."""
    arcs = [(-1, 1, 1), (-1, -1, 1), (1, -1, 1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)]

    def rates(u):
        def of(x):
            q, w = x[:4], x[4:]
            return [
                -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]),
                0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
                0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]),
                0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]),
                *u,
            ]

        return of

    def left(durations):
        x = np.array([1.0, 0, 0, 0, 0, 0, 0])
        for u, duration in zip(arcs, durations):
            x = flow(rates(u), x, duration).y[:, -1]
        return [*x[:3], *x[4:]]

    durations, info, *_ = fsolve(left, [0.3, 0.3, 1.0, 0.3, 1.0, 0.3], xtol=1e-14, full_output=True)
    assert max(map(abs, info["fvec"])) < 1e-12, info
    return sum(durations), durations


def hyper_sensitive(start=1.0, end=1.5):
    """From a to rest and from rest to b, lambda = -x^3 +- x sqrt(1 + x^4) on the way, whatever the long horizon."""
    part = sum(0.25 * (x**2 * np.sqrt(1 + x**4) + np.arcsinh(x**2)) for x in (start, end))
    return part + 0.25 * (end**4 - start**4)


# -------------------------------------------------------------------------------------------------- collocation


def rods(x, torques):
    """A chain of rods of 1 kg and 1 m, angles from hanging down: accelerations."""
    n = x.shape[0] // 2
    a, w = x[:n], x[n:]
    mass, force = ca.SX.zeros(n, n), ca.SX.zeros(n)
    for i in range(n):
        force[i] = torques[i] - (torques[i + 1] if i + 1 < n else 0) - G * (0.5 + n - 1 - i) * ca.sin(a[i])
        for j in range(n):
            both = (1 / 3 if i == j else 0.5) + n - 1 - max(i, j)
            mass[i, j] = both * ca.cos(a[i] - a[j])
            force[i] -= both * ca.sin(a[i] - a[j]) * w[j] ** 2
    return ca.vertcat(w, ca.solve(mass, force))


def cart(x, u):
    s, c = ca.sin(x[1]), ca.cos(x[1])
    below, push = 1 + 0.3 * s**2, 0.15 * s * x[3] ** 2 + u[0]
    return ca.vertcat(x[2], x[3], (push + 0.3 * G * c * s) / below, -(push * c + 1.3 * G * s) / (0.5 * below))


def collocated(rates, n, m, final, duration, K, seed):
    """int u^2/2 from rest at zero to `final`, with IPOPT; from a straight line, or with sines of random size on it."""
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
    f = ca.Function("f", [x, u], [rates(x, u), 0.5 * ca.sumsqr(u)])
    nodes = np.append(0, ca.collocation_points(DEGREE, "radau"))
    C, B = np.zeros((DEGREE + 1, DEGREE + 1)), np.zeros(DEGREE + 1)
    for j in range(DEGREE + 1):
        p = np.poly1d([1.0])
        for r in range(DEGREE + 1):
            if r != j:
                p *= np.poly1d([1, -nodes[r]]) / (nodes[j] - nodes[r])
        C[j], B[j] = [np.polyval(np.polyder(p), t) for t in nodes], np.polyval(np.polyint(p), 1.0)
    h, final = duration / K, np.array(final)
    X, U = ca.MX.sym("X", n, K * DEGREE + 1), ca.MX.sym("U", m, K * DEGREE)
    F, L = f.map(K * DEGREE)(X[:, 1:], U)
    g, cost = [X[:, 0], X[:, -1] - final], 0
    for k in range(K):
        rows = slice(k * DEGREE, (k + 1) * DEGREE)
        g.append(ca.vec(h * F[:, rows] - X[:, k * DEGREE : (k + 1) * DEGREE + 1] @ C[:, 1:]))
        cost += h * L[0, rows] @ B[1:]
    t = np.concatenate([[0], ((np.arange(K)[:, None] + nodes[1:]) / K).ravel()])
    guess = np.outer(final, t)
    if seed is not None:
        sines = np.random.default_rng(seed).normal(size=(n, 3)) * np.array([2, 1, 0.6])
        guess += sines @ np.sin(np.pi * np.outer([1, 2, 3], t))
    solver = ca.nlpsol(
        "s",
        "ipopt",
        {"x": ca.vertcat(ca.vec(X), ca.vec(U)), "f": cost, "g": ca.vertcat(*g)},
        {"print_time": 0, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 1000, "tol": 1e-9}},
    )
    found = solver(x0=np.append(guess.T.ravel(), np.zeros(U.numel())), lbg=0, ubg=0)
    states = found["x"].full().ravel()[: X.numel()].reshape(-1, n)[::DEGREE]
    multipliers = found["lam_g"].full().ravel()[2 * n :].reshape(K, DEGREE, n) / B[1:, None]
    costates = np.vstack([2 * multipliers[0, 0] - multipliers[0, 1], multipliers[:, -1]])
    return float(found["f"]), solver.stats()["success"], np.hstack([states, costates])


def shot(rates, n, m, final, duration, nodes):
    """Newton's method on states and costates at `nodes`, H = u^2/2 + lambda f: cost and residual."""
    z, u, N = ca.SX.sym("z", 2 * n), ca.SX.sym("u", m), len(nodes) - 1
    H = 0.5 * ca.sumsqr(u) + ca.dot(z[n:], rates(z[:n], u))
    law = -ca.substitute(ca.gradient(H, u), u, ca.SX.zeros(m))
    slope = ca.gradient(H, z)
    field = ca.substitute(ca.vertcat(slope[n:], -slope[:n], 0.5 * ca.sumsqr(u)), u, law)
    by = ca.SX.sym("by", 2 * n, 2 * n)
    rate = ca.Function("rate", [z, by], [ca.vertcat(field, ca.vec(ca.jacobian(field[:-1], z) @ by))])

    def whole(_, y):
        return rate(y[: 2 * n], y[2 * n + 1 :].reshape(2 * n, 2 * n).T).full().ravel()

    nodes = np.array(nodes[:-1])
    for _ in range(30):
        residual, jacobian, cost = np.zeros((N + 1, 2 * n)), np.zeros((2 * n * N, 2 * n * N)), 0.0
        residual[N, :n] = nodes[0, :n]
        jacobian[-n:, :n] = np.eye(n)
        for k in range(N):
            y = np.concatenate([nodes[k], [0.0], np.eye(2 * n).ravel()])
            y = solve_ivp(whole, (0, duration / N), y, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
            rows, count = slice(2 * n * k, 2 * n * (k + 1)), 2 * n if k + 1 < N else n
            residual[k, :count] = y[:count] - (nodes[k + 1] if k + 1 < N else final)
            jacobian[2 * n * k : 2 * n * k + count, rows] = y[2 * n + 1 :].reshape(2 * n, 2 * n).T[:count]
            if k + 1 < N:
                jacobian[rows, 2 * n * (k + 1) : 2 * n * (k + 2)] = -np.eye(2 * n)
            cost += y[2 * n]
        flat = np.concatenate([residual[: N - 1].ravel(), residual[N - 1, :n], residual[N, :n]])
        if np.abs(flat).max() < 1e-11 or not np.isfinite(flat).all() or np.abs(flat).max() > 1e3:
            break
        nodes = nodes - np.linalg.solve(jacobian, flat).reshape(N, 2 * n)
    return cost, np.abs(flat).max()


def smooth(name, rates, n, m, final, duration, starts):
    """The extremals that some starts lead to, the cheapest first."""
    minima, K = [], round(20 * duration)
    for seed in [None, *range(starts)]:
        cost, is_solved, nodes = collocated(rates, n, m, final, duration, K, seed)
        if is_solved and all(abs(cost - other) > 1e-5 * cost for other, *_ in minima):
            minima.append((cost, seed, nodes))
    for coarse, seed, nodes in sorted(minima, key=lambda item: item[0])[:5]:
        cost, residual = shot(rates, n, m, final, duration, nodes[::2])
        print(
            f"{name} in {duration} s, start {seed}: {cost:.14g}, residual {residual:.1e}, {coarse:.6g} by collocation",
            flush=True,
        )


def again(name, rates, n, m, final):
    """The extremal next to the library's solution of a problem of the test."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
    from control_problems import KNOWN

    known = KNOWN[name]
    found = known.pose().solve(known.guess, **known.options)
    t = np.linspace(found.t[0], found.t[-1], round(10 * found.t[-1]) + 1)
    nodes = np.hstack([found.state(t), found.costate(t)]).round(3)
    nodes[0, :n] = 0.0
    cost, residual = shot(rates, n, m, final, found.t[-1], nodes)
    print(f"{name}: {cost:.14g}, residual {residual:.1e}, {found.cost:.9g} by the library", flush=True)


UP = np.pi
SMOOTH = {
    "double pendulum": (rods, 4, 2, [UP, UP, 0, 0]),
    "triple pendulum": (rods, 6, 3, [UP] * 3 + [0] * 3),
    "acrobot": (lambda x, u: rods(x, ca.vertcat(0, u)), 4, 1, [UP, UP, 0, 0]),
    "cart-pendulum": (cart, 4, 1, [1, UP, 0, 0]),
}

if __name__ == "__main__":
    if not sys.argv[1:]:
        print(f"turnpike {turnpike():.15g}, harvest {harvest():.15g}, disk {disk():.15g}")
        print(f"hyper-sensitive {hyper_sensitive():.15g}")
        for end in ((4, 4, np.pi / 2), (4, -1, np.pi / 3), (0.5, 0.5, np.pi)):
            print("Dubins", end, *dubins((0, 0, 0), end))
        for fastest in (np.inf, 0.1):
            print("Goddard", fastest, *goddard(fastest))
        print("reorientation", *reorientation())
    elif sys.argv[2:]:
        smooth(sys.argv[1], *SMOOTH[sys.argv[1]], float(sys.argv[2]), int(sys.argv[3]))
    else:
        again(sys.argv[1], *SMOOTH[sys.argv[1].partition(" in ")[0]])
