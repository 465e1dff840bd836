"""Colours that figures share: Paul Tol's *muted* scheme, distinct for colour-blind readers."""

__all__ = ["AXES", "MUTED"]

MUTED = (
    "#332288",
    "#CC6677",
    "#117733",
    "#88CCEE",
    "#882255",
    "#DDCC77",
    "#44AA99",
    "#AA4499",
    "#999933",
    "#555555",
)

#: Of x, y and z.
AXES = (MUTED[1], MUTED[2], MUTED[0])
