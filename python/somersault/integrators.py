"""The methods of integration and the driver that runs them."""

from somersault._somersault.integrators import MethodInfo, MethodTable, integrate, method, methods

__all__ = ["MethodInfo", "MethodTable", "integrate", "method", "methods"]
