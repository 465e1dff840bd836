"""Motions of the free rigid body to more than 30 digits, for the tests of the exact solution.

Nothing here uses elliptic functions. Euler's equations and the motion of a fixed direction seen from the body,

    I_i w_i' = (I_j - I_k) w_j w_k,        e' = e x (w - W m/|m|),     m_i = I_i w_i,     W = |m| / I_mid,

are integrated by Taylor series of order 40 in fixed-point integers of 224 bits; W takes the fast part of the rotation out, so
that steps are as long as the change of w allows. Long times use the symmetry of the equations: with D the half turn about one
principal axis, (D w, R D) is a motion whenever (w, R) is. The first time tau at which w = D w(0) is found by Newton's method,
R(tau) D R(0)^-1 is a rotation about the angular momentum by some angle p, and

    R(n tau + s) = Rot(L, n p) R(s) D^n.

Data are exact: floats stand for the binary numbers they are, an orientation for the rotation its quaternion has after exact
normalisation, and an angular velocity given in the world is carried to the body without rounding. Run as

    python exact_reference.py body|world FILE

it writes the cases of `cases`, one per line:

    class I1 I2 I3 q0 q1 q2 q3 w1 w2 w3 t angle Q0 Q1 Q2 Q3 W1 W2 W3

with principal moments, quaternions (scalar first) from principal axes to the world, angular velocities in principal axes or in
the world, and `angle` the angle turned, the integral of |w|.
"""

import math
import random
import sys
from fractions import Fraction
from operator import mul

import mpmath

BITS = 224
ONE = 1 << BITS
ORDER = 40
DIGITS = 60
TOLERANCE = ONE >> 122  # last Taylor terms, 2e-37


def fixed(x):
    x = Fraction(x)
    return (x.numerator << BITS) // x.denominator


def real(x):
    return mpmath.ldexp(mpmath.mpf(x), -BITS)


def rounded(x):
    """A step size of 30 bits, which keeps the fractions short."""
    return (
        Fraction(float(x)).limit_denominator(1 << 30)
        if x < 1
        else Fraction(math.floor(float(x) * 1024), 1024)
    )


class Series:
    """Taylor series of w and e over one step."""

    def __init__(self, inertia, w, e, h):
        i1, i2, i3 = inertia
        mid = sorted(inertia)[1]
        k = [fixed((i2 - i3) / i1 * h), fixed((i3 - i1) / i2 * h), fixed((i1 - i2) / i3 * h)]
        r = [fixed((1 - i / mid) * h) for i in inertia]
        w1, w2, w3 = ([x] for x in w)
        e1, e2, e3 = ([x] for x in e)
        k1, k2, k3 = k
        r1, r2, r3 = r
        for n in range(ORDER):
            b1, b2, b3 = w1[::-1], w2[::-1], w3[::-1]
            s = BITS
            p1, p2, p3 = sum(map(mul, w2, b3)) >> s, sum(map(mul, w3, b1)) >> s, sum(map(mul, w1, b2)) >> s
            f1 = r3 * (sum(map(mul, e2, b3)) >> s) - r2 * (sum(map(mul, e3, b2)) >> s)
            f2 = r1 * (sum(map(mul, e3, b1)) >> s) - r3 * (sum(map(mul, e1, b3)) >> s)
            f3 = r2 * (sum(map(mul, e1, b2)) >> s) - r1 * (sum(map(mul, e2, b1)) >> s)
            d = n + 1
            w1.append((k1 * p1 >> s) // d)
            w2.append((k2 * p2 >> s) // d)
            w3.append((k3 * p3 >> s) // d)
            e1.append((f1 >> s) // d)
            e2.append((f2 >> s) // d)
            e3.append((f3 >> s) // d)
        self.c = [w1, w2, w3, e1, e2, e3]
        self.h = h
        last = max(max(abs(c[-1]), abs(c[-2])) for c in self.c)
        self.growth = (
            64.0 if last == 0 else min(64.0, 2.0 ** ((TOLERANCE.bit_length() - last.bit_length()) / ORDER))
        )

    def at(self, x):
        """State at the fraction x (fixed point) of the step."""
        out = []
        for c in self.c:
            v = 0
            for a in reversed(c):
                v = (v * x >> BITS) + a
            out.append(v)
        return out[:3], out[3:]


class Motion:
    """One motion of a free body; `orientation` (scalar first) need not have norm 1."""

    def __init__(self, moments, orientation, velocity):
        mpmath.mp.dps = DIGITS
        self.inertia = [Fraction(x) for x in moments]
        self.w = [Fraction(x) for x in velocity]
        self.orientation = [mpmath.mpf(x) for x in orientation]
        i, w = self.inertia, self.w
        self.steady = all(
            i[(k + 1) % 3] == i[(k + 2) % 3] or w[(k + 1) % 3] == 0 or w[(k + 2) % 3] == 0 for k in range(3)
        )
        self.momentum = [a * b for a, b in zip(i, w)]
        self.size = mpmath.sqrt(rational(sum(x * x for x in self.momentum)))
        lo, mid, hi = sorted(range(3), key=lambda k: i[k])
        # 2 T I_mid - L^2
        self.discriminant = i[lo] * (i[mid] - i[lo]) * w[lo] ** 2 - i[hi] * (i[hi] - i[mid]) * w[hi] ** 2
        self.axis = lo if self.discriminant > 0 else hi
        self.mid = mid
        e = [mpmath.mpf(0)] * 3
        m = [rational(x) for x in self.momentum]
        if self.size:
            e[min(range(3), key=lambda k: abs(m[k]))] = mpmath.mpf(1)
            e = unit(cross(e, m))
        self.direction = e
        self.start_triad = triad(m, e) if self.size else None
        self.half = None
        self.speed = 0.0

    def integrate(self, t, stop=None):
        """w, e and the angle turned at t >= 0; or at the first zero of stop(w) on the way down, with the time."""
        w = [fixed(x) for x in self.w]
        e = [int(mpmath.nint(mpmath.ldexp(x, BITS))) for x in self.direction]
        done = Fraction(0)
        turned = 0.0
        fastest = max(abs(x) for x in self.w)
        h = rounded(Fraction(1, 16) / fastest)
        armed = False
        while True:
            if stop is None and done + h > t:
                h = t - done
            series = Series(self.inertia, w, e, h)
            if series.growth < 0.9:
                h = rounded(h * Fraction(max(series.growth, 0.01)))
                continue
            before = math.sqrt(sum(float(Fraction(x, ONE)) ** 2 for x in w))
            new_w, new_e = series.at(ONE)
            if stop is not None:
                value = stop(new_w)
                if armed and value <= 0:
                    x = self.zero(series, stop)
                    w, e = series.at(x)
                    fraction = Fraction(x, ONE)
                    return w, e, turned + before * float(h * fraction), done + h * fraction
                armed = armed or value > 0
            w, e = new_w, new_e
            after = math.sqrt(sum(float(Fraction(x, ONE)) ** 2 for x in w))
            turned += 0.5 * (before + after) * float(h)
            done += h
            if stop is None and done == t:
                return w, e, turned, t
            h = rounded(h * Fraction(series.growth * 0.95))

    @staticmethod
    def zero(series, stop):
        low, high = 0, ONE
        for _ in range(20):
            middle = (low + high) >> 1
            low, high = (middle, high) if stop(series.at(middle)[0]) > 0 else (low, middle)
        x0, x1 = low, high
        f0, f1 = stop(series.at(x0)[0]), stop(series.at(x1)[0])
        for _ in range(12):
            if f1 == f0 or x1 == x0:
                break
            x2 = x1 - f1 * (x1 - x0) // (f1 - f0)
            x0, f0, x1, f1 = x1, f1, x2, stop(series.at(x2)[0])
        return x1

    def half_period(self):
        if self.half is None:
            a, b = [k for k in range(3) if k != self.axis]
            wa, wb = fixed(self.w[a]), fixed(self.w[b])
            direct = Series(self.inertia, [fixed(x) for x in self.w], [0, 0, 0], Fraction(1, 64))
            rising = wa * direct.c[b][1] - wb * direct.c[a][1]
            sign = 1 if rising > 0 else -1
            w, e, turned, tau = self.integrate(None, lambda v: sign * (wa * v[b] - wb * v[a]))
            turn = self.slow_turn(w, e)
            d = [mpmath.mpf(1 if k == self.axis else -1) for k in range(3)]
            m, v, u = self.start_triad
            image = [sum(turn[r][c] * d[c] * v[c] for c in range(3)) for r in range(3)]
            angle = mpmath.atan2(dot(u, image), dot(v, image))
            self.half = (tau, angle + self.size / rational(self.inertia[self.mid]) * rational(tau), turned)
        return self.half

    def slow_turn(self, w, e):
        """The rotation that carries body directions at the time of (w, e) into those at the start, less the fast part."""
        now = triad([rational(i) * real(x) for i, x in zip(self.inertia, w)], [real(x) for x in e])
        return [[sum(p[r] * q[c] for p, q in zip(self.start_triad, now)) for c in range(3)] for r in range(3)]

    def at(self, t):
        """Orientation, body angular velocity (mpmath) and the angle turned at time t (a float)."""
        mpmath.mp.dps = DIGITS
        t = Fraction(t)
        norm = mpmath.sqrt(sum(x * x for x in self.orientation))
        start = [x / norm for x in self.orientation]
        if self.steady:
            w = [rational(x) for x in self.w]
            speed = mpmath.sqrt(dot(w, w))
            turn = about(w, speed * rational(t)) if speed else [1, 0, 0, 0]
            return times(start, turn), w, float(abs(speed * rational(t)))
        n, s, per_half, turned_half = 0, t, mpmath.mpf(0), 0.0
        fast = self.size / rational(self.inertia[self.mid])
        if self.discriminant != 0:
            tau, per_half, turned_half = self.half_period()
            n = math.floor(t / tau)
            s = t - n * tau
        w, e, turned, _ = self.integrate(s) if s else ([fixed(x) for x in self.w], None, 0.0, 0)
        if e is None:
            e = [int(mpmath.nint(mpmath.ldexp(x, BITS))) for x in self.direction]
        m = [rational(x) for x in self.momentum]
        q = times(about(m, fast * rational(s) + n * per_half), quaternion(self.slow_turn(w, e)))
        w = [real(x) for x in w]
        if n % 2:
            flip = [0, 0, 0, 0]
            flip[1 + self.axis] = 1
            q = times(q, flip)
            w = [x if k == self.axis else -x for k, x in enumerate(w)]
        return times(start, q), w, abs(turned + n * turned_half)


def rational(x):
    x = Fraction(x)
    return mpmath.mpf(x.numerator) / x.denominator


def in_body(orientation, velocity):
    """The angular velocity in the body, as exact fractions, from one in the world."""
    w, x, y, z = (Fraction(c) for c in orientation)
    v = [Fraction(c) for c in velocity]
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z],
    ]
    return [dot(row, v) / (w * w + x * x + y * y + z * z) for row in rows]


def in_world(orientation, velocity):
    """The angular velocity in the world from one in the body."""
    conjugate = [orientation[0]] + [-c for c in orientation[1:]]
    return times(times(orientation, [0] + list(velocity)), conjugate)[1:]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    n = mpmath.sqrt(dot(a, a))
    return [x / n for x in a]


def triad(m, e):
    m, e = unit(m), unit(e)
    return [m, e, cross(m, e)]


def about(axis, angle):
    s = mpmath.sin(angle / 2)
    return [mpmath.cos(angle / 2)] + [s * x for x in unit(axis)]


def times(p, q):
    c = cross(p[1:], q[1:])
    return [p[0] * q[0] - dot(p[1:], q[1:])] + [p[0] * q[k] + q[0] * p[k] + c[k - 1] for k in (1, 2, 3)]


def quaternion(r):
    """Of a rotation matrix, by its largest component."""
    squares = [1 + r[0][0] + r[1][1] + r[2][2]]
    squares += [1 + 2 * r[k][k] - (r[0][0] + r[1][1] + r[2][2]) for k in range(3)]
    k = max(range(4), key=lambda j: squares[j])
    x, y, z = r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]
    a, b, c = r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]
    rows = [[squares[0], x, y, z], [x, squares[1], a, b], [y, a, squares[2], c], [z, b, c, squares[3]]]
    n = mpmath.sqrt(dot(rows[k], rows[k]))
    return [v / n for v in rows[k]]


# --- cases ---------------------------------------------------------------------------------------------------------------


def random_rotation(rng):
    q = [rng.gauss(0, 1) for _ in range(4)]
    n = math.sqrt(sum(x * x for x in q))
    return [x / n for x in q]


def random_velocity(rng):
    v = [rng.gauss(0, 1) for _ in range(3)]
    n = math.sqrt(sum(x * x for x in v))
    return [x / n for x in v]


def shuffled(rng, moments, velocity):
    order = [0, 1, 2]
    rng.shuffle(order)
    return [moments[k] for k in order], [velocity[k] for k in order]


def random_moments(rng):
    """Moments of a solid body: a + b >= c."""
    x = [rng.uniform(0.02, 1.0) for _ in range(3)]
    return [x[1] + x[2], x[2] + x[0], x[0] + x[1]]


def on_separatrix(moments, wl):
    """The w_high for which the discriminant vanishes within rounding, w_low being wl."""
    lo, mid, hi = moments
    return abs(wl) * math.sqrt(lo * (mid - lo) / (hi * (hi - mid)))


def log_uniform(rng, a, b):
    return 10.0 ** rng.uniform(math.log10(a), math.log10(b))


def draw(name, rng):
    """Moments and angular velocity of one class, of order 1."""
    if name == "generic":
        return random_moments(rng), random_velocity(rng)
    if name == "needle":
        thin = log_uniform(rng, 1e-6, 1e-1)
        other = 1 + thin * rng.uniform(-1, 1)
        return shuffled(rng, [thin, 1.0, other], random_velocity(rng))
    if name == "disc":
        flat = log_uniform(rng, 1e-6, 1e-1)
        a = rng.uniform(0.3, 1.0)
        return shuffled(rng, [a, 1.0, (a + 1) * (1 - flat * rng.random() * 0.5)], random_velocity(rng))
    if name == "near-symmetric":
        a = rng.uniform(0.5, 1.9)
        v = random_velocity(rng)
        return shuffled(rng, [1.0, 1.0 + log_uniform(rng, 3e-16, 1e-2), a], v)
    if name == "near-spherical":
        d = log_uniform(rng, 3e-16, 1e-2)
        return shuffled(rng, [1.0, 1.0 + d * rng.random(), 1.0 + d], random_velocity(rng))
    if name == "symmetric":
        return shuffled(rng, [1.0, 1.0, rng.uniform(0.05, 1.95)], random_velocity(rng))
    if name == "spherical":
        a = rng.uniform(0.5, 2)
        return [a, a, a], random_velocity(rng)
    if name == "principal":
        v = [0.0, 0.0, 0.0]
        v[rng.randrange(3)] = rng.uniform(0.5, 2)
        return random_moments(rng), v
    if name == "near-principal":
        v = [log_uniform(rng, 1e-18, 1e-3) * rng.choice([-1, 1]) for _ in range(3)]
        moments = random_moments(rng)
        v[rng.randrange(3)] = rng.uniform(0.5, 2)
        return moments, v
    if name in ("near-separatrix", "saddle"):
        moments = sorted(random_moments(rng))
        wl = rng.uniform(0.3, 1.0) * rng.choice([-1, 1])
        middle = rng.uniform(-1.2, 1.2)
        if name == "saddle":
            wl, middle = wl * log_uniform(rng, 1e-10, 1e-1), rng.choice([-1.0, 1.0])
        wh = on_separatrix(moments, wl) * (1 + rng.choice([-1, 1]) * log_uniform(rng, 1e-16, 1))
        w = [wl, middle, wh * rng.choice([-1, 1])]
        return shuffled(rng, moments, w)
    if name == "separatrix":
        # 1 (2 - 1) (3/4)^2 = 9/4 (9/4 - 2) 1^2, exactly
        r, s = 1 + rng.getrandbits(20) / 2**20, 1 + rng.getrandbits(20) / 2**20
        w = [0.75 * s * rng.choice([-1, 1]), rng.uniform(-1.5, 1.5), s * rng.choice([-1, 1])]
        return shuffled(rng, [r, 2 * r, 2.25 * r], w)
    raise ValueError(name)


COUNTS = {
    "generic": 200,
    "needle": 100,
    "disc": 100,
    "near-symmetric": 120,
    "near-spherical": 120,
    "symmetric": 50,
    "spherical": 20,
    "principal": 30,
    "near-principal": 80,
    "near-separatrix": 110,
    "saddle": 50,
    "separatrix": 40,
}


def cases(frame="body", seed=20240, counts=None):
    """Yields name, moments, orientation, velocity, time, angle turned, orientation and angular velocity there (floats).

    Orientations belong to principal axes; angular velocities are given in the body or in the world, as `frame` says.
    """
    for name, count in (counts or COUNTS).items():
        rng = random.Random(f"{seed} {name}")
        for k in range(count):
            moments, velocity = draw(name, rng)
            if name != "separatrix":
                scale = 2.0 ** rng.randint(-3, 3) * rng.uniform(1, 2)
                moments = [x * scale for x in moments]
            rate = 2.0 ** rng.randint(-3, 3)
            velocity = [x * rate for x in velocity]
            orientation = random_rotation(rng)
            exact = velocity
            if frame == "world":
                if name in ("separatrix", "principal"):
                    # these stay what they are only where the rotation does not round
                    orientation = rng.choice(
                        [[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, -0.5, 0.5], [0.0, 0.0, 1.0, 0.0]]
                    )
                velocity = [float(x) for x in in_world(unit(orientation), velocity)]
                exact = in_body(orientation, velocity)
            motion = Motion(moments, orientation, exact)
            fastest = math.sqrt(sum(x * x for x in velocity))
            if motion.steady:
                t = log_uniform(rng, 1e-3, 6e6) / fastest
            elif motion.discriminant == 0:
                t = log_uniform(rng, 1e-2, 100) / fastest
            elif k % 3 == 0:
                t = log_uniform(rng, 1e-3, 10) / fastest
            else:
                periods = log_uniform(rng, 0.1, 1e6) if k % 3 == 1 else rng.uniform(9e5, 1e6)
                t = 2 * float(motion.half_period()[0]) * periods
            if rng.random() < 0.3 and (motion.steady or motion.discriminant != 0):
                t = -t
            q, w, turned = motion.at(t)
            if frame == "world":
                w = in_world(q, w)
            yield (
                name,
                moments,
                orientation,
                velocity,
                t,
                turned,
                [float(x) for x in q],
                [float(x) for x in w],
            )


def main():
    frame, path = sys.argv[1:]
    with open(path, "w") as out:
        for name, *rest in cases(frame):
            numbers = []
            for item in rest:
                numbers += item if isinstance(item, list) else [item]
            out.write(" ".join([name] + [repr(float(x)) for x in numbers]) + "\n")


if __name__ == "__main__":
    main()
