"""Continuous-time optimum of the swing-up of thesis A.2: Radau collocation in CasADi, solved by IPOPT, from random starts.

The literal in optimal_motions/table_a_1.rs: 380.256269 (CasADi 3.8.2). It prints the best of twelve starts on 30
intervals of degree 4, and that start again on 40 and 60 intervals of degree 5.
"""

import casadi as ca
import numpy as np

CART, BOB, LENGTH, GRAVITY, DURATION = 2.0, 1.0, 1.0, 9.81, 2.0
#: Angle of the pendulum, place of the cart, and their rates.
START = np.array([np.pi, -1.0, 0.0, 0.0])
#: Weight of the squared state at the end, halved.
END_WEIGHT = 1e5


def slope(state, control):
    """Rates of the state, whose control is the acceleration of the cart, and half the squared force on it."""
    angle, _, spin, speed = state[0], state[1], state[2], state[3]
    turning = (control * ca.cos(angle) + GRAVITY * ca.sin(angle)) / LENGTH
    pull = BOB * LENGTH * (turning * ca.cos(angle) - spin**2 * ca.sin(angle))
    force = (CART + BOB) * control - pull
    return ca.vertcat(spin, speed, turning, control), 0.5 * force**2


def radau(degree):
    """Points of an interval, the derivatives of their Lagrange polynomials there, and the weights of a quadrature."""
    points = np.append(0.0, ca.collocation_points(degree, "radau"))
    derivatives, weights = np.zeros((degree + 1, degree + 1)), np.zeros(degree + 1)
    for j in range(degree + 1):
        lagrange = np.poly1d([1.0])
        for r in range(degree + 1):
            if r != j:
                lagrange *= np.poly1d([1.0, -points[r]]) / (points[j] - points[r])
        derivatives[j] = [np.polyval(np.polyder(lagrange), t) for t in points]
        weights[j] = np.polyval(np.polyint(lagrange), 1.0)
    return points, derivatives, weights


def optimum(intervals, degree, seed):
    """Cost from a start of that seed, and whether IPOPT has converged."""
    points, derivatives, weights = radau(degree)
    step = DURATION / intervals
    random = np.random.default_rng(seed)
    amplitudes, phases = random.normal(size=3) * 8.0, random.uniform(0.0, 6.0, 3)

    first = ca.MX.sym("first", 4)
    unknowns, guess, equations, cost = [first], list(START), [first - START], 0.0
    for k in range(intervals):
        states, controls = [first], []
        for j in range(degree):
            states.append(ca.MX.sym("state", 4))
            controls.append(ca.MX.sym("control", 1))
            unknowns += [states[-1], controls[-1]]
            t = (k + points[j + 1]) / intervals
            waves = amplitudes * np.sin(phases + np.arange(1, 4) * 2.0 * np.pi * t)
            guess += [np.pi * (1.0 - t), t - 1.0, 0.0, 0.0, waves.sum()]
        for j in range(1, degree + 1):
            rates, running = slope(states[j], controls[j - 1])
            moved = sum(derivatives[r][j] * states[r] for r in range(degree + 1))
            equations.append(step * rates - moved)
            cost += weights[j] * step * running
        first = states[-1]
    cost += 0.5 * END_WEIGHT * ca.dot(first, first)

    program = {"x": ca.vertcat(*unknowns), "f": cost, "g": ca.vertcat(*equations)}
    options = {"print_time": 0, "ipopt": {"print_level": 0, "max_iter": 500, "tol": 1e-10}}
    solver = ca.nlpsol("solver", "ipopt", program, options)
    found = solver(x0=guess, lbg=0.0, ubg=0.0)
    return float(found["f"]), solver.stats()["success"]


if __name__ == "__main__":
    best, best_seed = np.inf, 0
    for seed in range(12):
        cost, converged = optimum(30, 4, seed)
        if converged and cost < best - 1e-7:
            best, best_seed = cost, seed
    print("30 intervals:", best, "from seed", best_seed, flush=True)
    for intervals in (40, 60):
        print(intervals, "intervals:", *optimum(intervals, 5, best_seed), flush=True)
