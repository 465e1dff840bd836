"""Traced functions: what is traced against NumPy on numbers; derivatives, shapes, errors, threads."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from somersault import expr
from somersault.errors import InputError, TraceError

RANDOM = np.random.default_rng(22)
A = RANDOM.normal(size=(3, 3)) + 4 * np.eye(3)

# functions of a vector of three numbers above zero and of one number, and what they are called
TRACED: dict[str, Callable[[Any, Any], Any]] = {
    "arithmetic": lambda x, u: (x + 2) * (3 - x) / (x + u) - -x + +x,
    "reversed": lambda x, u: 2 + x - (1 / (3 * x)) + (4 - u) * np.ones(3),
    "powers": lambda x, u: x**2 + x**-1 + x**0.5 + x**2.7 + 2**x + x**x + x**7,
    "roots": lambda x, u: np.sqrt(x) + np.cbrt(x) + np.square(x) + np.reciprocal(x),
    "exponentials": lambda x, u: np.exp(x) + np.expm1(x) + np.exp2(x),
    "logarithms": lambda x, u: np.log(x) + np.log1p(x) + np.log2(x) + np.log10(x),
    "circle": lambda x, u: np.sin(x) * np.cos(x) + np.tan(0.3 * x),
    "inverse circle": lambda x, u: np.arcsin(0.2 * x) + np.arccos(0.2 * x) + np.arctan(x),
    "arctan2": lambda x, u: np.arctan2(x, u) + np.arctan2(u, x),
    "hyperbolic": lambda x, u: np.sinh(x) + np.cosh(x) + np.tanh(x),
    "inverse hyperbolic": lambda x, u: np.arcsinh(x) + np.arccosh(x + 1) + np.arctanh(0.2 * x),
    "hypot": lambda x, u: np.hypot(x, u),
    "signs": lambda x, u: np.abs(x - 1) + np.sign(x - 1) + abs(u - x) + np.fabs(x),
    "steps": lambda x, u: np.floor(3 * x) + np.ceil(2 * x) + x // 0.7 + x % 0.7,
    "extremes": lambda x, u: np.maximum(x, u) + np.minimum(x, 1.0) + np.clip(x, 0.5, u),
    "method clip": lambda x, u: x.clip(0.5, 1.5),
    "where": lambda x, u: np.where(x > u, x, np.where(x <= 1.0, u, -x)),
    "conditions": lambda x, u: np.where((x > 0.5) & (x < u) | ~(x >= 0.2), x, 2 * x),
    "logical": lambda x, u: np.where(np.logical_and(x > 0.5, np.logical_not(x == u)), x, 0.0),
    "angles": lambda x, u: np.deg2rad(x) + np.degrees(x) + np.radians(u),
    "sums": lambda x, u: np.sum(x) + x.sum() + np.mean(x) + np.prod(x) + np.cumsum(x)[-1] + sum(x),
    "extreme of all": lambda x, u: np.max(x) - np.min(x) + x.max() * u,
    "dot": lambda x, u: np.dot(x, x) + x @ x + np.inner(x, x) + np.vdot(x, x),
    "matrix": lambda x, u: A @ x + x @ A + np.dot(A, x) + np.matmul(A, x),
    "outer": lambda x, u: np.outer(x, x) + np.multiply.outer(x, x),
    "einsum": lambda x, u: np.einsum("i,ij->j", x, A),
    "cross": lambda x, u: np.cross(x, A[0]) + np.cross(A[1], x) + np.cross(x, x[::-1]),
    "norm": lambda x, u: np.linalg.norm(x) + np.linalg.norm(np.outer(x, x)) + np.linalg.norm(x, 1),
    "norms": lambda x, u: np.linalg.norm(np.outer(x, x), axis=1) + np.linalg.norm(x, np.inf),
    "solve": lambda x, u: np.linalg.solve(A + np.diag(x), np.ones(3)) @ np.linalg.inv(A * u)[0],
    "stack": lambda x, u: np.stack([x[0], np.sin(u), 1.0]),
    "array": lambda x, u: np.array([x[0], np.sin(u), 1.0]),
    "array and functions": lambda x, u: np.sin(np.array([x[0], u])) * np.array([x[1], 2.0]) + 1,
    "nested array": lambda x, u: np.array([[np.cos(u), -np.sin(u)], [np.sin(u), np.cos(u)]]) @ x[:2],
    "concatenate": lambda x, u: np.concatenate([x, [u], x[:1] * 2]),
    "hstack": lambda x, u: np.hstack([x, u]) @ np.vstack([np.ones((3, 1)), [[2.0]]]),
    "slices": lambda x, u: x[1:] * x[:-1] + x[[0, 2]] - x[-1],
    "shapes": lambda x, u: x.reshape(3, 1) * x[None, :] + np.ones((3, 3)).T * u,
    "transpose": lambda x, u: np.outer(x, x).T @ x + np.trace(np.outer(x, A[0])),
    "diff": lambda x, u: np.diff(x) + np.flip(x)[1:] + np.roll(x, 1)[:2],
    "iteration": lambda x, u: [entry * u for entry in x],
    "tuple": lambda x, u: (x[0] * u, x[1], 3.0),
    "in place": lambda x, u: _in_place(x, u),
    "loop": lambda x, u: _loop(x, u),
    "polynomial": lambda x, u: np.polyval([1.0, -2.0, 3.0], x),
    "zeros_like": lambda x, u: np.zeros_like(x) + x + np.ones_like(x),
    "constant": lambda x, u: 2.0,
    "sinc by hand": lambda x, u: np.where(x == 0, 1.0, np.sin(x) / np.where(x == 0, 1.0, x)),
    "select": lambda x, u: np.select([x > u, x > 0.5], [x, 2 * x], default=-1.0),
    "determinant": lambda x, u: np.linalg.det(np.outer(x, x) + A) + np.linalg.det(A[:2, :2] * u),
    "rare": lambda x, u: np.heaviside(x - u, 0.5) + np.trunc(2 * x - 3) + np.logaddexp(x, u) + np.sinc(x),
    "truth": lambda x, u: np.where(np.logical_xor(x > u, x > 0.5), x, np.where(np.isnan(x), 0.0, 2 * x)),
    "spread": lambda x, u: np.var(x) + np.std(x) + np.ptp(x) + np.average(x, weights=[1, 2, 3]),
    "vectorized": lambda x, u: np.vectorize(lambda t: t * np.sin(t))(x),
    "blocks": lambda x, u: np.block([[np.outer(x, x)], [x]]) + np.tile(x, (4, 1)) * np.triu(np.ones((4, 3))),
    "products of matrices": lambda x, u: (
        np.linalg.matrix_power(A * u, 2) @ np.kron(x, [1.0]) + np.tensordot(A, x, 1)
    ),
    "numpy numbers": lambda x, u: np.float64(2.0) * x + np.float64(1.0) / u - np.pi,
}


def _in_place(x: Any, u: Any) -> Any:
    y = x * 1.0
    y += u
    y[1] = y[0] * 2
    return y


def _loop(x: Any, u: Any) -> Any:
    for _ in range(5):
        x = x + 0.1 * np.stack([x[1], -np.sin(x[0]), u])
    return x


def _point() -> tuple[Any, float]:
    return RANDOM.uniform(0.3, 2.0, 3), float(RANDOM.uniform(0.6, 1.9))


@pytest.mark.parametrize("name", TRACED)
def test_a_traced_function_has_the_values_of_numpy(name: str) -> None:
    formula = TRACED[name]
    f = expr.Function(formula, x=3, u=())
    points = [_point() for _ in range(11)]
    expected = np.array([formula(x, u) for x, u in points], dtype=float)
    assert f.shape == expected.shape[1:]
    singles = np.array([f(x, u) for x, u in points])
    batch = f(np.array([x for x, _ in points]), np.array([u for _, u in points]))
    np.testing.assert_allclose(singles, expected, rtol=2e-14, atol=1e-14)
    np.testing.assert_allclose(batch, singles, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("name", TRACED)
def test_derivatives_are_those_of_differences(name: str) -> None:
    f = expr.Function(TRACED[name], x=3, u=())
    x, u = _point()
    h = 1e-6
    by_x = f.derivative("x")(x, u)
    columns = [(f(x + h * e, u) - f(x - h * e, u)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(by_x, np.stack(columns, axis=-1), rtol=1e-6, atol=1e-6)
    by_u = (f(x, u + h) - f(x, u - h)) / (2 * h)
    np.testing.assert_allclose(f.derivative("u")(x, u), by_u, rtol=1e-6, atol=1e-6)
    jacobian = f.jacobian(x, u)
    size = math.prod(f.shape)
    np.testing.assert_array_equal(jacobian[:, :3], np.reshape(by_x, (size, 3)))
    multipliers = RANDOM.normal(size=f.shape)
    hessian = f.hessian(multipliers, x, u)
    weighted = multipliers.reshape(-1)
    for k, e in enumerate(np.eye(3)):
        change = (f.jacobian(x + h * e, u) - f.jacobian(x - h * e, u)) / (2 * h)
        np.testing.assert_allclose(hessian[k], weighted @ change, rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(hessian, hessian.T)


def test_inputs_have_names_shapes_and_attributes() -> None:
    def formula(x: Any, u: Any, t: Any) -> Any:
        return x.speed * np.cos(u.angle) * t, x.x

    f = expr.Function(formula, t=(), x=("x", "speed"), u=("angle",))
    assert f.inputs == {"t": (), "x": (2,), "u": (1,)}
    np.testing.assert_allclose(f(2.0, [5.0, 3.0], [0.0]), [6.0, 5.0])
    np.testing.assert_allclose(f(u=[0.0], x=[5.0, 3.0], t=2.0), [6.0, 5.0])
    matrix = expr.Function(lambda m: m @ m.T, m=(2, 3))
    m = RANDOM.normal(size=(2, 3))
    np.testing.assert_allclose(matrix(m), m @ m.T)
    assert matrix.derivative("m").shape == (2, 2, 2, 3)


def test_batches_are_broadcast() -> None:
    f = expr.Function(lambda x, m: m * x, x=2, m=())
    assert f(np.ones((4, 1, 2)), np.arange(3.0)).shape == (4, 3, 2)
    assert f.jacobian(np.ones((4, 1, 2)), np.arange(3.0)).shape == (4, 3, 2, 3)
    assert f.hessian(np.ones(2), np.ones((7, 2)), 1.0).shape == (7, 3, 3)
    assert f(np.ones((0, 2)), 1.0).shape == (0, 2)
    with pytest.raises(InputError, match="must broadcast against each other"):
        f(np.ones((4, 2)), np.ones(3))


def test_patterns_are_those_of_scipy() -> None:
    sparse = pytest.importorskip("scipy.sparse")
    f = expr.Function(lambda x: x[1:] * x[:-1], x=5)
    x = RANDOM.normal(size=5)
    indptr, indices = f.jacobian_pattern()
    matrix = sparse.csc_array((f.jacobian(x, sparse=True), indices, indptr), shape=(4, 5))
    np.testing.assert_array_equal(matrix.toarray(), f.jacobian(x))
    assert matrix.nnz == 8
    indptr, indices = f.hessian_pattern()
    lower = sparse.csc_array((f.hessian(np.ones(4), x, sparse=True), indices, indptr), shape=(5, 5))
    np.testing.assert_array_equal(np.tril(f.hessian(np.ones(4), x)), lower.toarray())
    assert lower.nnz == 4


def test_functions_are_composed_and_lie_derivatives_are_compositions() -> None:
    field = expr.Function(lambda x: (x[1], -np.sin(x[0])), x=2)
    energy = expr.Function(lambda x: 0.5 * x[1] ** 2 - np.cos(x[0]), x=2)
    change = expr.Function(lambda x: energy.derivative("x")(x) @ field(x), x=2)
    np.testing.assert_allclose(change(RANDOM.normal(size=(9, 2))), 0.0, atol=1e-15)
    third = expr.Function(lambda x: np.sin(x) * np.exp(x), x=())
    for _ in range(3):
        third = third.derivative("x")
    x = 0.7
    assert third(x) == pytest.approx(2 * np.exp(x) * (np.cos(x) - np.sin(x)), rel=1e-14)


def test_results_are_composed_of_symbols_and_numbers() -> None:
    inner = expr.Function(lambda x, u: x * u, x=2, u=())
    outer = expr.Function(lambda y: inner([y, 1.0], 2.0) + inner(np.array([y, y]), y), y=())
    np.testing.assert_allclose(outer(3.0), [15.0, 11.0])


# what is refused, and words of the message
REFUSED: dict[str, tuple[Callable[[Any], Any], str]] = {
    "branch": (lambda x: x[0] if x[0] > 0 else -x[0], r"np\.where"),
    "array branch": (lambda x: 1.0 if (x > 0).all() else 0.0, r"np\.where"),
    "max": (lambda x: max(x[0], 1.0), r"np\.maximum"),
    "sort": (lambda x: np.sort(x), r"np\.sort cannot be traced: .*np\.where"),
    "math": (lambda x: math.sin(x[0]), r"np\.sin"),
    "float": (lambda x: float(x[0]), r"np\.sin"),
    "assignment": (lambda x: np.zeros(2).__setitem__(0, x[0]), r"np\.array"),
    "in place": (lambda x: np.zeros(2).__iadd__(x), "write a = a"),
    "table": (lambda x: np.interp(x, [0.0, 1.0], [0.0, 2.0]), r"np\.interp cannot be traced"),
    "norm of a matrix": (
        lambda x: np.linalg.norm(np.outer(x, x), 1, axis=(0, 1)),
        r"np\.linalg\.norm of symbols is that of vectors, or the Frobenius norm",
    ),
    "spacing": (lambda x: np.spacing(x), r"np\.spacing cannot be traced"),
    "eigenvalues": (lambda x: np.linalg.eigvals(np.outer(x, x)), r"np\.linalg\.eigvals cannot be traced"),
    "complex": (lambda x: x * 1j, "real number"),
    "index": (lambda x: [1.0, 2.0][x[0]], r"np\.sin"),
    "mask": (lambda x: x[x > 0], "symbols cannot be indices"),
    "attribute": (lambda x: x.velocity, "no attribute 'velocity'"),
    "index beyond": (lambda x: x[2], "IndexError: .*out of bounds"),
    "round": (lambda x: round(x[0]), "rounding has no derivative"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_traced_is_refused_with_the_line_and_what_to_write(name: str) -> None:
    formula, words = REFUSED[name]
    with pytest.raises(TraceError, match=words) as caught:
        expr.Function(formula, x=2)
    assert caught.value.place.startswith(f"{__file__}, line {formula.__code__.co_firstlineno}, `")
    assert str(caught.value) == f"{caught.value.place}: {caught.value.reason}"


def test_symbols_do_not_leave_their_function() -> None:
    kept = []
    expr.Function(lambda x: kept.append(x) or x, x=())
    with pytest.raises(TraceError, match="pass what is needed as an input"):
        expr.Function(lambda y: y + kept[0], y=())


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: expr.Function(2), "`f` must be a function, found int"),  # type: ignore[arg-type]
        (lambda: expr.Function(lambda x: x, x=-1), "`x` must be a length, a shape or names"),
        (lambda: expr.Function(lambda x: x, x=2.0), "`x` must be a length, a shape or names"),  # type: ignore[arg-type]
        (lambda: expr.Function(lambda x: x, x=("a", "a")), "different identifiers, found 'a'"),
        (lambda: expr.Function(lambda x: x, x=("T",)), "'T', which is an attribute of arrays"),
        (lambda: expr.Function(lambda x: x, y=2), "`f` takes .*x.*, the inputs are y"),
        (lambda: expr.Function(lambda x: None, x=2), "must return numbers"),
        (lambda: expr.Function(lambda x: (x, x[0]), x=2), "of equal shapes"),
        (lambda: expr.Function(lambda x: x, x=(1 << 20, 1 << 20)), "at most 4194304 numbers"),
        (lambda: expr.Function(lambda x: x, x=2)([1.0]), r"`x` must have shape \(\.\.\., 2\), found \(1,\)"),
        (lambda: expr.Function(lambda x: x, x=2)(), "the inputs are x, found no `x`"),
        (lambda: expr.Function(lambda x: x, x=2)(1, 2), "the inputs are x, found 2 values"),
        (lambda: expr.Function(lambda x: x, x=2)([0, 0], x=1), "found two of `x`"),
        (lambda: expr.Function(lambda x: x, x=())("a"), "`x` must be real numbers, found str"),
        (lambda: expr.Function(lambda x: x, x=()).derivative("y"), "`by` must be one of x, found 'y'"),
    ],
)
def test_wrong_arguments_are_named(make: Callable[[], Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


def test_numbers_beyond_the_formulas_are_those_of_numpy() -> None:
    f = expr.Function(lambda x: (np.sqrt(x), np.log(x), 1 / x, np.maximum(x, 0.0), np.exp(x)), x=())
    with np.errstate(all="ignore"):
        for x in (0.0, -1.0, np.inf, -np.inf, np.nan):
            expected = np.array([np.sqrt(x), np.log(x), np.divide(1, x), np.maximum(x, 0.0), np.exp(x)])
            np.testing.assert_array_equal(f(x), expected)
            np.testing.assert_array_equal(f(np.full(9, x)), np.tile(expected, (9, 1)))


def test_a_function_is_evaluated_by_several_threads() -> None:
    f = expr.Function(lambda x: np.sin(x) * np.roll(x, 1), x=4)
    points = RANDOM.normal(size=(16, 5000, 4))
    expected = [f(batch) for batch in points]
    with ThreadPoolExecutor(4) as pool:
        for found, alone in zip(pool.map(f, points), expected, strict=True):
            np.testing.assert_array_equal(found, alone)


def _long() -> tuple[expr.Function, Any]:
    """A batch that takes a second or more."""

    def chaos(x: Any) -> Any:
        for _ in range(300):
            x = np.sin(3.0 * x) + np.arctan(x[::-1])
        return x

    return expr.Function(chaos, x=4), RANDOM.normal(size=(100_000, 4))


def test_other_threads_run_during_a_batch() -> None:
    f, points = _long()
    counted, done = [0], threading.Event()

    def count() -> None:
        while not done.is_set():
            counted[0] += 1
            time.sleep(1e-3)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    f(points[:20_000])
    seconds = time.perf_counter() - start
    done.set()
    thread.join()
    assert counted[0] > 20 * seconds


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs a timer that signals")
def test_a_signal_ends_a_batch() -> None:
    f, points = _long()

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        start = time.perf_counter()
        with pytest.raises(KeyboardInterrupt):
            f(np.tile(points, (20, 1)))
        assert time.perf_counter() - start < 2.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
