"""Coefficients of the preprocessed discrete Moser-Veselov algorithm, orders 4 to 10.

With principal moments I_j, body momentum L, Gibbs vector g = tan(angle/2) axis of the body-frame increment F (R+ = R F) the
discrete Moser-Veselov equation reads, for (j, k, l) cyclic,

    I_j g_j + (I_l - I_k) g_k g_l = (1 + |g|^2) h L_j / 2.

It is linear in the moments. So insert the g(h) of the exact free motion as a power series, solve for modified moments J_j(h), and
1/J_j = (1/I_j)(1 + sum_m h^2m s_m) + sum_m h^2m d_m comes out: two unknown series and three equations, the third being the check
that preprocessing works at all. Each s_m, d_m is a polynomial in H = sum L_j^2 / (2 I_j), C = |L|^2 / 2 and the elementary
symmetric functions E1, E2, E3 of the inverse moments, of known weight. Its coefficients follow from linear algebra over the
rationals on random samples and are checked on others.

Run: python preprocessed_moser_veselov.py    (standard library only, some ten seconds)
"""

from fractions import Fraction as Q
from math import lcm
from random import Random

ORDER = 10  # highest order of the method
N = ORDER + 1  # powers of h kept
CYCLIC = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


def mul(a, b):
    return [sum((a[i] * b[n - i] for i in range(n + 1)), Q(0)) for n in range(N)]


def div(a, b):
    q = []
    for n in range(N):
        q.append((a[n] - sum((q[i] * b[n - i] for i in range(n)), Q(0))) / b[0])
    return q


def exact_increment(moments, momentum):
    """g(h) of the exact motion: L' = L x w, g' = (w + g x w + (g.w) g) / 2, w = L / I, as series in h."""
    L = [[Q(x)] + [Q(0)] * (N - 1) for x in momentum]
    g = [[Q(0)] * N for _ in range(3)]
    for n in range(N - 1):
        w = [[c / i for c in s] for s, i in zip(L, moments)]
        gw = [sum(c) for c in zip(*(mul(a, b) for a, b in zip(g, w)))]
        new_L, new_g = [], []
        for j, k, l in CYCLIC:
            new_L.append((mul(L[k], w[l])[n] - mul(L[l], w[k])[n]) / (n + 1))
            turn = mul(g[k], w[l])[n] - mul(g[l], w[k])[n] + mul(gw, g[j])[n]
            new_g.append((w[j][n] + turn) / (2 * (n + 1)))
        for j in range(3):
            L[j][n + 1], g[j][n + 1] = new_L[j], new_g[j]
    return g


def scale_and_shift(moments, momentum):
    """The series 1 + sum s_m h^2m and sum d_m h^2m; raises if the three components of the equation disagree."""
    g = [s[1:] + [Q(0)] for s in exact_increment(moments, momentum)]  # divided by h; last entry unknown
    h2 = lambda s: [Q(0), Q(0)] + s[:-2]
    h1 = lambda s: [Q(0)] + s[:-1]
    norm = h2([sum(c) for c in zip(*(mul(a, a) for a in g))])
    norm[0] += 1
    right = [[c * x / 2 for c in norm] for x in momentum]
    # rows: I_j g_j + (I_l - I_k) g_k g_l = right, by Cramer's rule on series
    a = [[None] * 3 for _ in range(3)]
    for j, k, l in CYCLIC:
        gg = h1(mul(g[k], g[l]))
        a[j][j], a[j][l], a[j][k] = g[j], gg, [-c for c in gg]
    det = lambda m: [
        sum(c)
        for c in zip(
            *(
                mul(m[0][j], [x - y for x, y in zip(mul(m[1][k], m[2][l]), mul(m[1][l], m[2][k]))])
                for j, k, l in CYCLIC
            )
        )
    ]
    whole = det(a)
    inverse = []
    for j in range(3):
        inverse.append(
            div(whole, det([[right[i] if c == j else a[i][c] for c in range(3)] for i in range(3)]))
        )
    x = [1 / Q(i) for i in moments]
    slope = lambda i, j: [(p - q) / (x[i] - x[j]) for p, q in zip(inverse[i], inverse[j])]
    s, check = slope(0, 1), slope(1, 2)
    assert s[:ORDER] == check[:ORDER], "no scale and shift reproduce the exact motion"
    d = [p - x[0] * c for p, c in zip(inverse[0], s)]
    assert s[0] == 1 and d[0] == 0 and not any(s[1:ORDER:2]) and not any(d[1:ORDER:2])
    return s, d


def monomials(weight):
    return [
        (a, b, c)
        for c in range(weight // 3 + 1)
        for b in range((weight - 3 * c) // 2 + 1)
        for a in [weight - 3 * c - 2 * b]
    ]


def solve(rows, right):
    m = [r + [v] for r, v in zip(rows, right)]
    n = len(rows[0])
    for c in range(n):
        p = next(i for i in range(c, len(m)) if m[i][c] != 0)
        m[c], m[p] = m[p], m[c]
        m[c] = [v / m[c][c] for v in m[c]]
        for i in range(len(m)):
            if i != c and m[i][c] != 0:
                f = m[i][c]
                m[i] = [u - f * v for u, v in zip(m[i], m[c])]
    return [m[i][n] for i in range(n)]


def sample(random):
    moments = random.sample(range(1, 30), 3)
    momentum = [random.randint(-9, 9) for _ in range(3)]
    if 0 in momentum:
        return sample(random)
    moments = [Q(i, random.randint(1, 4)) for i in moments]
    if len(set(moments)) < 3:
        return sample(random)
    s, d = scale_and_shift(moments, momentum)
    x, y, z = (1 / i for i in moments)
    C = sum(Q(v * v) for v in momentum) / 2
    H = sum(Q(v * v) / i for v, i in zip(momentum, moments)) / 2
    return (x + y + z, x * y + y * z + z * x, x * y * z), H, C, s, d


def basis(m, extra):
    return [(m - j, j, e) for j in range(m + 1) for e in monomials(m + j + extra)]


def values(terms, E, H, C):
    return [H**i * C**j * E[0] ** a * E[1] ** b * E[2] ** c for i, j, (a, b, c) in terms]


def main():
    random = Random(1)
    unknowns = len(basis(ORDER // 2 - 1, 1))
    samples = [sample(random) for _ in range(unknowns)]
    checks = [sample(random) for _ in range(6)]
    for m in range(1, ORDER // 2):
        for name, which, extra in (("s", 3, 0), ("d", 4, 1)):
            terms = basis(m, extra)
            used = samples[: len(terms)]
            c = solve([values(terms, *r[:3]) for r in used], [r[which][2 * m] for r in used])
            for r in checks:
                assert sum(p * v for p, v in zip(c, values(terms, *r[:3]))) == r[which][2 * m]
            common = lcm(*(q.denominator for q in c))
            print(f"{name}{2 * m + 1} = 1/{common} * sum of:")
            for j in range(m + 1):
                line = [
                    " ".join([f"{int(q * common):+d}"] + [f"E{i + 1}^{p}" for i, p in enumerate(e) if p])
                    for q, (_, jj, e) in zip(c, terms)
                    if jj == j and q != 0
                ]
                print(f"    H^{m - j} C^{j} ({', '.join(line)})")
    print("values straight from the series, for the unit test of the polynomials:")
    for moments, momentum in ((2, 3, 4), (1, -2, 3)), ((5, 3, 7), (4, 1, 2)):
        s, d = scale_and_shift([Q(i) for i in moments], momentum)
        print(
            f"    I = {moments}, L = {momentum}: "
            + ", ".join(f"({s[2 * m]}, {d[2 * m]})" for m in range(1, ORDER // 2))
        )
    print("checked on", len(checks), "independent random bodies")


if __name__ == "__main__":
    main()
