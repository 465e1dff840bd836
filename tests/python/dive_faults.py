"""Dives with a known fault: when they fold and open, and what is to be done about each fault."""

DURATION, OPENS, OPENED_IN = 1.4, 1.06, 0.25
#: What is wrong with a dive, by how much, and what is to be done about it.
FAULTS = {
    "opened early": (0.08, "open_later"),
    "opened late": (0.06, "open_earlier"),
    "loose": (20.0, "tighter"),
    "too little momentum": (0.06, "more_momentum"),
}


def smooth(x: float) -> tuple[float, float]:
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10 - 15 * x + 6 * x * x), 30 * (x * (1 - x)) ** 2
