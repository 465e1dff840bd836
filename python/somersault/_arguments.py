"""Arguments that must be numbers, for the parts of the package that do not hand them to the extension."""

from __future__ import annotations

import reprlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from somersault.errors import InputError


def _real_numbers(argument: str, given: Any) -> NDArray[np.float64]:
    """A new array of real numbers of any shape; NaN and infinity are allowed, and text is refused."""
    try:
        numbers = np.asarray(given)
        if numbers.dtype.kind in "biufO":
            return numbers.astype(float)
    except (TypeError, ValueError):
        # ragged sequences, and objects that cannot be converted to numbers
        pass
    raise InputError(f"`{argument}` must be real numbers, found {reprlib.repr(given)}")
