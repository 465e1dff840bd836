"""Finite-time Lyapunov exponents of the two-link arm in 60 digits: the literals of tests/ftla/spectrum.rs.

    pip install mpmath gmpy2
    python exponents.py 1 2 3.5 5        forward from START
    python exponents.py nodes FILE       forward along the nodes in FILE, one "t p1 ... p8" a line

State and transition matrix are one dual number with eight tangents, so that no Jacobian is written down. They are
integrated by Gragg's midpoint rule with polynomial extrapolation; the singular values are those of mpmath's SVD.
"""

import sys

import gmpy2
import mpmath
from gmpy2 import mpfr

gmpy2.get_context().precision = 200
mpmath.mp.dps = 60
N = 8
START = [
    -1.5707963267948966,
    0.05,
    0.0,
    0.0,
    -0.20342284657942628,
    -0.013000184725439342,
    -1.3301476310359088,
    -0.12234910357574813,
]


class Dual:
    """A value with its derivatives along the columns of Φ."""

    __slots__ = ("v", "d")

    def __init__(self, v, d):
        self.v, self.d = v, d

    def __add__(self, o):
        if isinstance(o, Dual):
            return Dual(self.v + o.v, [a + b for a, b in zip(self.d, o.d)])
        return Dual(self.v + o, self.d)

    def __mul__(self, o):
        if isinstance(o, Dual):
            return Dual(self.v * o.v, [a * o.v + self.v * b for a, b in zip(self.d, o.d)])
        return Dual(self.v * o, [a * o for a in self.d])

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self):
        return self * -1

    def __sub__(self, o):
        return self + (-o)

    def __rsub__(self, o):
        return -self + o

    def inverse(self):
        r = 1 / self.v
        return Dual(r, [-a * r * r for a in self.d])

    def sincos(self):
        s, c = gmpy2.sin(self.v), gmpy2.cos(self.v)
        return Dual(s, [a * c for a in self.d]), Dual(c, [-a * s for a in self.d])


M1 = M2 = mpfr("0.5")
L1, L2 = mpfr(2), mpfr("0.5")
C1 = mpfr(0.2)  # the double next to 0.2, as the library has it
D = M2 * L2 * L2 / 3
A = (M1 / 3 + M2) * L1 * L1 + D
B = M2 * L1 * L2 / 2
G1, G2 = mpfr(1), mpfr("0.5")


def field(p):
    """The state-costate field for c2 = 0."""
    _, th, w1, w2, l1, l2, l3, l4 = p
    s, c = th.sincos()
    m11, m12 = 2 * B * c + A, B * c + D
    det = (m11 * D - m12 * m12).inverse()
    mu1, mu2 = (D * l3 - m12 * l4) * det, (m11 * l4 - m12 * l3) * det
    swing, square = w2 * (2 * w1 + w2), w1 * w1
    r1 = mu1 * (-1 / G1) + B * s * swing - C1 * w1
    r2 = mu2 * (-1 / G2) - B * s * square
    a1, a2 = (D * r1 - m12 * r2) * det, (m11 * r2 - m12 * r1) * det
    turn = mu1 * (-B * s * (2 * a1 + a2) - B * c * swing) + mu2 * (-B * s * a1 + B * c * square)
    rate1 = mu1 * (C1 - 2 * B * s * w2) + mu2 * (2 * B * s * w1) - l1
    rate2 = mu1 * (-2 * B * s * (w1 + w2)) - l2
    return [w1, w2, a1, a2, l1 * 0, turn, rate1, rate2]


def axpy(p, h, f):
    return [x + h * y for x, y in zip(p, f)]


def step(p, h, columns=14):
    """Gragg's rule with 2, 4, 6, ... substeps, extrapolated in h²."""
    start, table = field(p), []
    for k in range(1, columns + 1):
        n = 2 * k
        dt = h / n
        old, new = p, axpy(p, dt, start)
        for _ in range(n - 1):
            old, new = new, axpy(old, 2 * dt, field(new))
        table.append(new)
        for j in range(k - 2, -1, -1):
            r = mpfr(k) / (j + 1)
            w = 1 / (r * r - 1)
            table[j] = [a + w * (a - b) for a, b in zip(table[j + 1], table[j])]
    return table[0]


def seed(state):
    return [Dual(mpfr(x), [mpfr(int(i == j)) for j in range(N)]) for i, x in enumerate(state)]


def run(state, duration, h):
    p = seed(state)
    steps = max(1, int(gmpy2.ceil(duration / h)))
    for _ in range(steps):
        p = step(p, mpfr(duration) / steps)
    return p


def matrix(p):
    return mpmath.matrix([[mpmath.mpf(str(x)) for x in row.d] for row in p])


def exponents(phi, duration):
    s = mpmath.svd_r(phi, compute_uv=False)
    return sorted(mpmath.log(x) / duration for x in s)


def show(title, values):
    print(title, "[" + ", ".join(mpmath.nstr(x, 15) for x in values) + "],", flush=True)


if __name__ == "__main__":
    h = mpfr("0.05")
    if sys.argv[1] == "nodes":
        rows = [[float(x) for x in line.split()] for line in open(sys.argv[2])]
        phi = mpmath.eye(N)
        for row, after in zip(rows, rows[1:]):
            phi = matrix(run(row[1:], mpfr(after[0]) - mpfr(row[0]), h)) * phi
        show("nodes", exponents(phi, mpmath.mpf(rows[-1][0]) - mpmath.mpf(rows[0][0])))
    else:
        p, t = seed(START), mpfr(0)
        for duration in map(mpfr, sys.argv[1:]):
            steps = int(gmpy2.ceil((duration - t) / h))
            for _ in range(steps):
                p = step(p, (duration - t) / steps)
            t = duration
            show(f"T = {float(t)}", exponents(matrix(p), mpmath.mpf(str(t))))
