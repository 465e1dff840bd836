"""The exact motion of a free rigid body."""

from somersault._somersault import FreeBody

__all__ = ["FreeBody"]
