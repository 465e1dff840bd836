"""Motions of a free gyrostat to more than 30 digits, for the tests of the closed form.

Nothing here uses elliptic functions: the equations

    L' = L x w,     w = A (L - h),     q' = q w / 2     (principal axes, quaternions with the scalar first)

are integrated by Taylor series of order 36 in fixed-point integers of 192 bits. Data are exact: floats stand
for the binary numbers they are.
"""

import math
import random
from fractions import Fraction
from operator import mul

BITS = 192
ONE = 1 << BITS
ORDER = 36
TOLERANCE_BITS = BITS - 116  # last Taylor terms, 1e-35


def fixed(x):
    x = Fraction(x)
    return (x.numerator << BITS) // x.denominator


def product(a, b):
    """The next coefficient of a product of series."""
    return sum(map(mul, a, reversed(b))) >> BITS


def step(inverse, h, momentum, q, dt):
    """Series of L and q over one step, in units of the step."""
    l1, l2, l3 = ([x] for x in momentum)
    q0, q1, q2, q3 = ([x] for x in q)
    w1, w2, w3 = [], [], []
    scaled = [a * dt >> BITS for a in inverse]
    for n in range(ORDER):
        for w, a, line, rotor in zip((w1, w2, w3), scaled, (l1, l2, l3), h, strict=True):
            w.append(a * (line[n] - (rotor if n == 0 else 0)) >> BITS)
        d = n + 1
        l1.append((product(l2, w3) - product(l3, w2)) // d)
        l2.append((product(l3, w1) - product(l1, w3)) // d)
        l3.append((product(l1, w2) - product(l2, w1)) // d)
        d *= 2
        new = (
            -product(q1, w1) - product(q2, w2) - product(q3, w3),
            product(q0, w1) + product(q2, w3) - product(q3, w2),
            product(q0, w2) + product(q3, w1) - product(q1, w3),
            product(q0, w3) + product(q1, w2) - product(q2, w1),
        )
        for line, x in zip((q0, q1, q2, q3), new, strict=True):
            line.append(x // d)
    return [l1, l2, l3, q0, q1, q2, q3]


def motion(moments, rotors, velocity, t):
    """Quaternion (scalar first) from the axes at the start, and angular velocity in these axes, at time t."""
    inverse = [fixed(1 / Fraction(i)) for i in moments]
    h = [fixed(x) for x in rotors]
    momentum = [
        fixed(Fraction(i) * Fraction(w) + Fraction(x))
        for i, w, x in zip(moments, velocity, rotors, strict=True)
    ]
    q = [ONE, 0, 0, 0]
    left = fixed(t)
    dt = min(left, ONE // 8)
    while left > 0:
        series = step(inverse, h, momentum, q, min(dt, left))
        last = max(abs(line[n]) for line in series for n in (-1, -2)).bit_length()
        growth = 2.0 ** ((TOLERANCE_BITS - last) / ORDER)
        if growth < 0.9:
            dt = int(min(dt, left) * max(growth, 0.01))
            continue
        left -= min(dt, left)
        *momentum, q0, q1, q2, q3 = (sum(line) for line in series)
        q = [q0, q1, q2, q3]
        dt = int(dt * min(growth, 4.0) * 0.95)
    omega = [a * (line - x) / ONE / ONE for a, line, x in zip(inverse, momentum, h, strict=True)]
    quaternion = [x / ONE for x in q]
    norm = math.sqrt(sum(x * x for x in quaternion))
    return [x / norm for x in quaternion], omega


def direction(rng):
    v = [rng.gauss(0, 1) for _ in range(3)]
    n = math.sqrt(sum(x * x for x in v))
    return [x / n for x in v]


def symmetric(rng):
    """Moments of a solid body of revolution about the third axis."""
    across = rng.uniform(0.5, 1.5)
    return [across, across, across * rng.uniform(0.05, 1.9)]


def draw(name, rng):
    """Moments, angular momentum of the rotors, and angular velocity of one class."""
    x = [rng.uniform(0.05, 1.0) for _ in range(3)]
    moments = [x[1] + x[2], x[2] + x[0], x[0] + x[1]]
    velocity = [v * rng.uniform(0.5, 2.0) for v in direction(rng)]
    rotors = [v * 10 ** rng.uniform(-1, 0.7) for v in direction(rng)]
    if name == "weak rotor":
        rotors = [v * 10 ** rng.uniform(-15, -3) for v in direction(rng)]
    elif name == "strong rotor":
        rotors = [v * 10 ** rng.uniform(1, 2) for v in direction(rng)]
    elif name == "symmetric, axial":
        moments = symmetric(rng)
        rotors[:2] = 0.0, 0.0
    elif name == "symmetric":
        moments = symmetric(rng)
    elif name == "spherical":
        moments = [moments[0]] * 3
    elif name == "one axis":
        rotors = [0.0, 0.0, 0.0]
        rotors[rng.randrange(3)] = rng.uniform(-2, 2)
    elif name == "nearly steady":
        small = 10 ** rng.uniform(-9, -2)
        rotors = [0.0, 0.0, rng.uniform(0.5, 2)]
        velocity = [small * rng.gauss(0, 1), small * rng.gauss(0, 1), rng.uniform(-2, 2)]
    elif name == "nearly symmetric":
        moments = symmetric(rng)
        moments[1] *= 1 + 10 ** rng.uniform(-15, -3)
    elif name == "planar rotor":
        rotors[rng.randrange(3)] = 0.0
    order = [0, 1, 2]
    rng.shuffle(order)
    return tuple([v[k] for k in order] for v in (moments, rotors, velocity))


COUNTS = {
    "general": 300,
    "weak rotor": 120,
    "strong rotor": 60,
    "symmetric, axial": 80,
    "symmetric": 80,
    "spherical": 40,
    "one axis": 100,
    "nearly steady": 100,
    "nearly symmetric": 60,
    "planar rotor": 60,
}


def cases(counts, seed=1885):
    """Class, moments, rotors, velocity, time, quaternion and angular velocity then."""
    rng = random.Random(seed)
    for name, count in counts.items():
        for _ in range(count):
            moments, rotors, velocity = draw(name, rng)
            t = rng.choice([0.7, 5.0]) * rng.uniform(0.5, 1.5)
            yield name, moments, rotors, velocity, t, *motion(moments, rotors, velocity, t)
