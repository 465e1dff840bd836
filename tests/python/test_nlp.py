"""Nonlinear programs in SciPy's habits: dense and sparse, with derivatives and without, right and wrong."""

from __future__ import annotations

import pickle
import signal
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from somersault import nlp
from somersault.errors import EvaluationError, InputError

METHODS = ("ipm", "sqp")


def rosen(x: np.ndarray) -> float:
    return float(100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2)


def rosen_slope(x: np.ndarray) -> np.ndarray:
    bend = 200 * (x[1] - x[0] ** 2)
    return np.array([-2 * x[0] * bend - 2 * (1 - x[0]), bend])


def rosen_hess(x: np.ndarray) -> np.ndarray:
    return np.array([[1200 * x[0] ** 2 - 400 * x[1] + 2, -400 * x[0]], [-400 * x[0], 200.0]])


def hs71(**options: Any) -> nlp.MinimizeResult:
    rows = [
        {"type": "ineq", "fun": lambda x: np.prod(x) - 25, "name": "volume"},
        {"type": "eq", "fun": lambda x: x @ x - 40, "jac": lambda x: 2 * x},
    ]
    return nlp.minimize(
        lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        [1.0, 5.0, 5.0, 1.0],
        bounds=[(1, 5)] * 4,
        constraints=rows,
        **options,
    )


@pytest.mark.parametrize("method", METHODS)
def test_dictionaries_of_scipy_are_taken(method: str) -> None:
    found = hs71(method=method)
    assert found.success and found.status == "converged"
    # Hock & Schittkowski, problem 71
    assert found.fun == pytest.approx(17.0140173, abs=1e-6)
    assert set(found.multipliers) == {"bounds", "volume", "constraint[1]"}
    assert found.multipliers["volume"][0] < 0 < found.constraint_violation + 1
    assert max(found.residuals.values()) <= 1e-8 and found.constraint_violation < 1e-6
    assert found.nit > 0 and found.nfev > 0 and found.njev > 0


@pytest.mark.parametrize("method", [*METHODS, "lbfgs"])
@pytest.mark.parametrize("given", ["nothing", "gradient", "both at once", "hessian"])
def test_derivatives_may_be_given_or_not(method: str, given: str) -> None:
    options: dict[str, Any] = {"gradient": {"jac": rosen_slope}, "both at once": {"jac": True}}.get(given, {})
    if given == "hessian":
        options = {"jac": rosen_slope, "hess": rosen_hess}
    fun = (lambda x: (rosen(x), rosen_slope(x))) if given == "both at once" else rosen
    found = nlp.minimize(fun, [-1.2, 1.0], method=method, tol=1e-7, **options)
    assert found.success, found
    assert_allclose(found.x, 1.0, atol=1e-5)
    assert (found.nhev > 0) == (given == "hessian" and method != "lbfgs")


@pytest.mark.parametrize("method", METHODS)
def test_sparse_constraints_and_hessians(method: str) -> None:
    sparse = pytest.importorskip("scipy.sparse")
    n = 200
    links = sparse.diags_array(
        [np.full(n - 1, -1.0), np.full(n - 1, 1.0)], offsets=[0, 1], shape=(n - 1, n)
    ).tocsr()
    # a chain: links of x² steps, the ends held by bounds
    curved = SimpleNamespace(
        fun=lambda x: (x[1:] - x[:-1]) + 0.1 * x[1:] ** 2,
        jac=lambda x: links + 0.2 * sparse.diags_array([x[1:]], offsets=[1], shape=(n - 1, n)),
        hess=lambda x, v: sparse.diags_array(np.concatenate([[0.0], 0.2 * v])),
        lb=-0.1,
        ub=0.05,
        name="links",
    )
    target = np.linspace(0.0, 3.0, n)
    found = nlp.minimize(
        lambda x: float((x - target) @ (x - target)),
        np.zeros(n),
        method=method,
        jac=lambda x: 2 * (x - target),
        hess=lambda x: sparse.diags_array(np.full(n, 2.0)),
        bounds=SimpleNamespace(lb=np.full(n, -1.0), ub=2.0),
        constraints=[curved, SimpleNamespace(A=links, lb=-0.2, ub=0.2, name="flat")],
    )
    assert found.success and found.nhev > 0
    assert found.multipliers["links"].shape == (n - 1,)
    slope = 2 * (found.x - target) + curved.jac(found.x).T @ found.multipliers["links"]
    assert_allclose(slope + links.T @ found.multipliers["flat"] + found.multipliers["bounds"], 0.0, atol=1e-6)


def test_differences_are_grouped_by_sparsity() -> None:
    sparse = pytest.importorskip("scipy.sparse")
    n = 60
    calls = []

    def rows(x: np.ndarray) -> np.ndarray:
        calls.append(1)
        return x[1:] - x[:-1] ** 2

    pattern = sparse.diags_array([np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))
    constraint = SimpleNamespace(
        fun=rows, jac="2-point", hess=None, lb=0.0, ub=0.0, finite_diff_jac_sparsity=pattern
    )
    found = nlp.minimize(
        lambda x: float(x @ x), np.full(n, 0.4), jac=lambda x: 2 * x, constraints=constraint, method="sqp"
    )
    assert found.success
    # two groups of columns, two evaluations each
    assert len(calls) < 10 * (found.njev + found.nfev)


def test_ends_are_named() -> None:
    nowhere = {"type": "eq", "fun": lambda x: x[0] ** 2 + 1}
    found = nlp.minimize(lambda x: x @ x, [2.0, 1.0], constraints=nowhere)
    assert (
        not found.success
        and found.status == "infeasible"
        and found.constraint_violation == pytest.approx(1.0)
    )
    found = nlp.minimize(lambda x: -x[0], [2.0], jac=lambda x: [-1.0], hess=lambda x: [[0.0]])
    assert not found.success and found.status == "unbounded"
    found = nlp.minimize(rosen, [-1.2, 1.0], options={"maxiter": 2})
    assert (found.status, found.nit) == ("iteration_limit", 2)
    assert nlp.minimize(rosen, [-1.2, 1.0], options={"maxfev": 2}).status == "evaluation_limit"
    seen: list[np.ndarray] = []
    found = nlp.minimize(rosen, [-1.2, 1.0], callback=lambda x: seen.append(x) or len(seen) == 3)
    assert (found.status, found.nit) == ("stopped", 3)


def test_a_result_begins_a_warm_start() -> None:
    cold = hs71()
    warm = nlp.minimize(
        lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        cold,
        bounds=[(1, 5)] * 4,
        constraints=[
            {"type": "ineq", "fun": lambda x: np.prod(x) - 25},
            {"type": "eq", "fun": lambda x: x @ x - 40},
        ],
    )
    assert warm.success and warm.nit < cold.nit


def test_wrong_derivatives_are_named() -> None:
    def wrong(x: np.ndarray) -> np.ndarray:
        return rosen_slope(x) * [1.0, 1.5]

    with pytest.raises(InputError, match=r"derivative of fun has -132 at \[1\] and differences -88"):
        nlp.minimize(rosen, [-1.2, 1.0], jac=wrong, options={"check_derivatives": True})
    row = {"type": "ineq", "fun": lambda x: [x[0], x @ x], "jac": lambda x: [[1.0, 0.0], [2 * x[0], x[1]]]}
    with pytest.raises(
        InputError, match=r"derivative of constraint\[0\] has 1 at \[1, 1\] and differences 2"
    ):
        nlp.minimize(rosen, [-1.2, 1.0], constraints=row, options={"check_derivatives": True})
    found = nlp.minimize(rosen, [-1.2, 1.0], jac=lambda x: -rosen_slope(x))
    assert not found.success and "derivative of fun" in found.message


def test_what_functions_raise_comes_out_with_what_was_found() -> None:
    calls = []

    def fragile(x: np.ndarray) -> float:
        calls.append(1)
        if len(calls) > 30:
            raise ZeroDivisionError("thirty are enough")
        return rosen(x)

    with pytest.raises(ZeroDivisionError, match="thirty") as caught:
        nlp.minimize(fragile, [-1.2, 1.0])
    assert isinstance(caught.value.solution, nlp.MinimizeResult)  # type: ignore[attr-defined]


def test_missing_values_are_stepped_back_from_and_named_at_the_start() -> None:
    with np.errstate(invalid="ignore"):
        found = nlp.minimize(lambda x: x[0] - np.log(x[0]), [5.0], jac=lambda x: 1 - 1 / x)
        assert found.success and found.x[0] == pytest.approx(1.0)
        with pytest.raises(EvaluationError, match="x0"):
            nlp.minimize(lambda x: np.log(x[0]), [-1.0], jac=lambda x: 1 / x)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"method": "SLSQP"}, "`method` must be 'ipm', 'sqp' or 'lbfgs', found 'SLSQP'"),
        ({"x0": [[1.0, 2.0]]}, r"`x0` must be a vector of finite numbers, found shape \(1, 2\)"),
        ({"x0": [0.0, np.inf]}, "`x0` must be a vector of finite numbers, found inf"),
        ({"x0": "abc"}, "`x0` must be real numbers, found 'abc'"),
        ({"x0": [1.0, [2.0, 3.0]]}, r"`x0` must be real numbers, found \[1.0, \[2.0, 3.0\]\]"),
        ({"x0": [1.0, 2j]}, "`x0` must be real numbers"),
        ({"x0": None}, "`x0` must be a vector of finite numbers, found nan"),
        ({"fun": 3.0}, "`fun` must be callable, found 3.0"),
        ({"bounds": [(0, 1)]}, "`bounds` must have 2 pairs, found 1"),
        ({"bounds": 3}, "`bounds` must be pairs of numbers or None, found 3"),
        ({"bounds": [(0, 1), (0, "a")]}, r"`bounds\[1\]` must be real numbers, found 'a'"),
        (
            {"bounds": SimpleNamespace(lb=[0.0, 0.0, 0.0], ub=1.0)},
            r"`bounds.lb` must be a number or 2 of them, found shape",
        ),
        ({"constraints": 3}, "`constraints` must be one or several constraints, found 3"),
        (
            {"constraints": SimpleNamespace(lb=[0.0, 0.0], ub=1.0, fun=rosen)},
            r"`constraint\[0\].lb` must be a number or 1 of them, found shape \(2,\)",
        ),
        ({"options": 5}, "`options` must be values by name, found 5"),
        ({"tol": "small"}, "`tol` must be real numbers, found 'small'"),
        ({"options": {"ftol": 1}}, "`options` may have .*, found 'ftol'"),
        ({"constraints": {"type": "le", "fun": rosen}}, r"constraint\[0\] must have a `type` 'eq' or 'ineq'"),
        ({"constraints": {"type": "eq", "fun": rosen}, "method": "lbfgs"}, "takes no constraints but bounds"),
        ({"jac": lambda x: [1.0]}, r"a derivative must have the shape \(1, 2\)"),
        ({"fun": lambda x: x}, "`fun` must give a number, found 2"),
        ({"tol": -1.0}, "`tol` must be positive and finite, found -1.0"),
    ],
)
def test_bad_input_is_named(arguments: dict[str, Any], message: str) -> None:
    fun, x0 = arguments.pop("fun", rosen), arguments.pop("x0", [0.0, 1.0])
    with pytest.raises(InputError, match=message):
        nlp.minimize(fun, x0, **arguments)


@pytest.mark.parametrize("method", ["ipm", "sqp", "lbfgs"])
def test_no_variables_have_one_value(method: Any) -> None:
    found = nlp.minimize(lambda x: 3.0 + x @ x, [], method=method)
    assert found.success and found.fun == 3.0 and found.x.shape == (0,)


def test_functions_may_bring_their_own_derivatives() -> None:
    class Bowl:
        calls = 0

        def __call__(self, x: np.ndarray) -> float:
            return float(x @ x)

        def jac(self, x: np.ndarray) -> np.ndarray:
            return 2 * x

        def hess(self, x: np.ndarray) -> np.ndarray:
            return 2 * np.eye(x.size)

    found = nlp.minimize(Bowl(), [3.0, 4.0])
    assert found.success and found.nhev > 0 and found.nfev <= found.nit + 3


def test_signals_end_a_solve_with_what_was_found() -> None:
    def slow(x: np.ndarray) -> float:
        return rosen(x) + 0.0 * sum(range(20000))

    timer = threading.Timer(0.3, signal.raise_signal, (signal.SIGINT,))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt) as caught:
            for _ in range(100000):
                nlp.minimize(slow, [-1.2, 1.0])
    finally:
        timer.cancel()
    assert caught.type is KeyboardInterrupt


def test_results_are_pickled() -> None:
    found = hs71()
    again = pickle.loads(pickle.dumps(found))
    assert repr(again) == repr(found)
    assert_allclose(again.x, found.x)
