"""The exact motion of a free rigid body, and of one that carries rotors."""

from somersault._somersault.exact import FreeBody, Gyrostat

__all__ = ["FreeBody", "Gyrostat"]
