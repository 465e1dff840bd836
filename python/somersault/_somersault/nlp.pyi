from collections.abc import Callable
from typing import Any

__all__ = [
    "solve_program",
]

def solve_program(
    method: str,
    start: tuple[Any, Any, Any],
    bounds: tuple[Any, Any],
    rows: tuple[Any, Any],
    jacobian: tuple[list[int], list[int]],
    hessian: tuple[list[int], list[int]],
    functions: tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any] | None],
    *,
    tol: float | None = None,
    max_iterations: int | None = None,
    max_evaluations: int | None = None,
    max_time: float | None = None,
    callback: Callable[..., Any] | None = None,
) -> tuple[
    str,
    list[float],
    list[float],
    list[float],
    float,
    tuple[float, float, float],
    int,
    tuple[int, int, int],
]: ...
