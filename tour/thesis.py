"""What the thesis prints, for comparison: the only numbers of the tour that are not computed.

Methods go by their names in the method table.
"""

from __future__ import annotations

from math import inf

CITATION = (
    "J. Aguilar Mayans, Numerical Integration and Optimization of Motions for Multibody Dynamic Systems, "
    "dissertation, University of California, Irvine (2017)"
)
URL = "https://escholarship.org/uc/item/28b7x3fs"

#: Table 7.3, in its order.
METHODS = (
    "euler", "sie", "sv", "mp", "heun", "rk4", "ab2", "siabm2", "aso", "dmv2", "ab4", "siabm4", "rkmk",
)  # fmt: skip

#: Table 6.1: area of the stability region, and the area corrected for the evaluations of a step.
STABILITY_AREAS = {
    "euler": (3.14, 3.14),
    "sie": (2.28, 2.28),
    "sv": (2.28, 2.28),
    "mp": (5.87, 1.47),
    "heun": (5.87, 1.47),
    "ab2": (1.31, 1.31),
    "siabm2": (1.27, 1.27),
    "rk4": (12.70, 0.79),
}

#: Table 6.2: the numbers of steps, and for each method the largest and the smallest energy ratios.
ENERGY_STEPS = (1, 2, 5, 10, 20, 50, 100)
ENERGY_RATIOS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "euler": (
        (1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00),
        (0.61, 0.05, 0.00, 0.00, 0.00, 0.00, 0.00),
    ),
    "sie": (
        (1.33, 2.39, 7.57, 3.06e3, inf, inf, inf),
        (1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00),
    ),
    "sv": (
        (1.08, 1.89, 2.75, 2.48, 105.78, inf, inf),
        (1.00, 1.00, 1.00, 1.00, 0.91, 1.00, 1.00),
    ),
    "mp": (
        (1.01, 1.00, 1.00, 1.01, 1.01, 1.03, 1.06),
        (0.94, 0.88, 0.70, 0.30, 0.07, 0.00, 0.00),
    ),
    "heun": (
        (1.32, 1.52, 2.12, 56.39, inf, inf, inf),
        (0.93, 0.92, 0.92, 0.92, 0.98, 1.00, 1.00),
    ),
    "rk4": (
        (1.05, 1.03, 1.05, 1.07, 1.12, 1.21, 1.23),
        (0.98, 0.97, 0.97, 0.97, 0.97, 0.89, 0.66),
    ),
    "ab2": (
        (1.00, 1.00, 33.99, 3.91e31, inf, inf, inf),
        (0.61, 0.43, 0.05, 0.02, 0.02, 0.12, 0.27),
    ),
    "siabm2": (
        (1.33, 1.72, 556.92, 6.19e81, inf, inf, inf),
        (1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00),
    ),
    "ab4": (
        (1.00, 1.00, 982.41, 4.62e93, inf, inf, inf),
        (0.61, 0.43, 0.08, 0.02, 0.06, 0.06, 0.06),
    ),
    "siabm4": (
        (1.33, 1.72, 2.48e3, 2.57e116, inf, inf, inf),
        (1.00, 1.00, 0.02, 0.01, 0.02, 0.05, 0.04),
    ),
    "dmv2": (
        (1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00),
        (1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00),
    ),
    "rkmk": (
        (1.00, 1.03, 1.02, 1.05, 1.11, 1.19, 1.20),
        (1.00, 0.99, 1.00, 0.99, 0.99, 0.99, 0.99),
    ),
}

#: Table 6.3, in the words of `somersault.studies`.
BEHAVIOUR = {
    "euler": "unconditionally stable",
    "sie": "unconditionally unstable",
    "sv": "unconditionally unstable",
    "mp": "unconditionally stable",
    "heun": "unconditionally unstable",
    "rk4": "conditionally stable",
    "ab2": "conditionally stable",
    "siabm2": "unconditionally unstable",
    "ab4": "conditionally stable",
    "siabm4": "conditionally stable",
    "dmv2": "unconditionally stable",
    "rkmk": "unconditionally unstable",
}

#: Table 7.1: orders in translation.
TRANSLATION_ORDERS = {
    "euler": 1, "sie": 1, "sv": 2, "mp": 2, "heun": 2, "ab2": 2, "siabm2": 2, "rk4": 4, "ab4": 4, "siabm4": 4,
}  # fmt: skip

#: Table 7.2: orders in rotation.
ROTATION_ORDERS = {
    "euler": 1, "sie": 1, "sv": 2, "mp": 2, "heun": 2, "rk4": 2, "ab2": 2, "aso": 2, "dmv2": 2, "siabm2": 2,
    "ab4": 2, "siabm4": 2, "rkmk": 4,
}  # fmt: skip

#: Section 7.2.1: the sides of the box before scaling to 1 m³, and ω₀ in rad/s; 1 kg and 10 s throughout.
CASES = {
    1: ((1.0, 1.0, 5.0), (0.0, 4.442882938158366, 4.442882938158366)),
    2: ((1.0, 2.0, 5.0), (0.0, 6.283185307179586, 6.283185307179586e-4)),
    3: ((5.0, 5.0, 1.0), (0.0, 4.442882938158366, 4.442882938158366)),
}
CASE_SECONDS = 10.0

#: Section 7.3.2: radius and thickness of the disk of the top, m.
TOP_DISK = (0.04, 0.01)

#: Table A.1: free parameters p and final cost.
SWING_UP = {
    "A": (5, 478.39),
    "B": (10, 392.94),
    "C": (15, 362.30),
    "D": (20, 358.14),
    "E": (30, 355.00),
    "F": (40, 351.17),
    "G": (50, 345.02),
}

#: Table 10.1, column p⁺: states and costates of the arm at t = 5 s.
ARM_MIDDLE = (-0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651)

#: Table 10.1, column p⁻ at t = 5 s; and the mismatch that the text prints. The columns differ by 6.03e-4.
ARM_MIDDLE_BACKWARD = (
    -0.027650, 3.068761, 0.477344, 0.009229, -0.203476, 0.019080, -0.209649, 0.019660
)  # fmt: skip
ARM_MISMATCH = 2.243e-3

#: Section 8.4: states at both ends of the arm's motion, and its horizon, s.
ARM_INITIAL = (-1.5707963267948966, 0.05, 0.0, 0.0)
ARM_FINAL = (1.5707963267948966, 0.05, 0.0, 0.0)
ARM_HORIZON = 10.0

#: Equation (10.1).
ARM_DIMS = (2, 4, 2)
