"""Many rigid bodies at once, vectorised over bodies and parallel over cores."""

from somersault._somersault import integrate_batch as integrate

__all__ = ["integrate"]
