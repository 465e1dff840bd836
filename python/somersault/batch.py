"""Many rigid bodies at once, vectorised over bodies and parallel over cores."""

from somersault._somersault.batch import integrate_arrays, integrate_batch

__all__ = ["integrate_arrays", "integrate_batch"]
