"""The exact motion of a free rigid body."""

from somersault._somersault.exact import FreeBody

__all__ = ["FreeBody"]
