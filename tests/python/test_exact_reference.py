"""The exact motion against Taylor series of more than 30 digits, see exact_reference.py."""

import numpy as np
import pytest
from exact_reference import COUNTS, cases

from somersault import RigidBody, State
from somersault.exact import FreeBody

ROUNDING = 2.2e-16


def test_fifty_motions_within_four_roundings_of_the_angle_turned() -> None:
    assert _motions_within_the_bound({name: -(-count // 20) for name, count in COUNTS.items()}) >= 50


@pytest.mark.study
def test_a_thousand_motions_within_four_roundings_of_the_angle_turned() -> None:
    assert _motions_within_the_bound(COUNTS) >= 1000


def _motions_within_the_bound(counts: dict[str, int]) -> int:
    worst: dict[str, float] = {}
    count = 0
    for name, moments, orientation, velocity, t, turned, end, end_velocity in cases("world", counts=counts):
        w, *vector = orientation
        start = State(orientation=[*vector, w], angular_velocity=velocity)
        got = FreeBody(RigidBody(1.0, moments), start)(t)
        q = got.quaternion
        reference = np.array([*end[1:], end[0]])
        # The sine of half the angle between the two, without an arccosine.
        half = min(np.linalg.norm(q - reference), np.linalg.norm(q + reference))
        bound = max(1e-13, 4 * ROUNDING * turned)
        share = 2 * half / bound
        speed = np.linalg.norm(end_velocity)
        if speed > 0:
            share = max(share, np.linalg.norm(got.angular_velocity - end_velocity) / speed / bound)
        assert share <= 1, (name, moments, orientation, velocity, t, share)
        worst[name] = max(worst.get(name, 0.0), share)
        count += 1
    print("largest error as a share of the bound:", {k: f"{v:.3f}" for k, v in worst.items()})
    return count
