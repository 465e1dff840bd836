"""The table of methods."""

from __future__ import annotations

from somersault import MethodInfo
from somersault.plotting import abbreviation
from tour import thesis
from tour.measurements import Measurements
from tour.page import Cell, Page, words

TITLE = "All methods"

_HEADER = (
    words("name"),
    words("method"),
    "order on ℝ³",
    "order on SO(3)",
    "within steps",
    "evaluations",
    "previous steps",
    words("step"),
    words("applies to"),
    words("source"),
)


def _order(info: MethodInfo, benign: str, *general: str) -> str:
    def of(orders: dict[str, int | None]) -> str:
        first, others = orders[benign], [orders[name] for name in general]
        special = None if None in others else min(order for order in others if order is not None)
        return str(first) if special in (None, first) else f"{first} ({special})"

    configuration, rate = of(info.orders), of(info.rate_orders)
    return configuration if configuration == rate else f"{configuration}; {rate}"


def _steps(info: MethodInfo) -> str:
    """How the steps of a method are chosen."""
    adapted = "adapted" if info.embedded_order is not None else "doubled"
    return f"fixed or {adapted}" if info.adaptive else "fixed"


def _row(info: MethodInfo) -> list[Cell]:
    return [
        words(info.name),
        words(info.title),
        Cell(_order(info, "translation", "translation_with_velocity", "translation_with_orientation")),
        Cell(_order(info, "rotation", "rotation_with_torque")),
        Cell(str(info.dense_order)),
        Cell(str(info.evaluations)),
        Cell(str(info.history)),
        words(_steps(info)),
        words(info.scope),
        words(info.citation),
    ]


def write(page: Page, measurements: Measurements) -> None:
    """Writes the chapter."""
    infos = measurements.methods
    adaptive = sum(info.adaptive for info in infos)
    estimating = sum(info.embedded_order is not None for info in infos)
    page.lead(
        f"{len(infos)} methods, {len(thesis.METHODS)} of them those of the thesis; {adaptive} of them can"
        f" adapt their step, {estimating} by an estimate of their own and the others by step doubling."
        " Orders differ between ℝ³ and SO(3): that is the point of the study."
    )
    page.text(
        "An order in brackets is a lower one: on ℝ³ where forces depend on the velocity or the orientation,"
        " on SO(3) where a torque acts; after a semicolon stand the orders of the velocities, where they"
        " differ. Within a step, by dense output, the order is the lower of that at its ends and of the"
        " column."
        " Evaluations are those of the equations of motion in each step, once started; a method"
        " that solves an equation in each step may need them for every iteration. Previous steps are those a"
        " method remembers, and must be made by another method first."
    )
    page.section("The thesis' methods")
    page.table(
        _HEADER,
        [_row(info) for info in infos if info.name in thesis.METHODS],
        "In the order of Table 7.3, whose abbreviations are the names in lower case: "
        + ", ".join(abbreviation(name) for name in thesis.METHODS)
        + ".",
    )
    page.section("Variants and later methods")
    page.table(
        _HEADER,
        [_row(info) for info in infos if info.name not in thesis.METHODS],
        "A suffix names the variables: <code>_l</code> angular momentum in the world frame (thesis 6.2.1), "
        "<code>_b</code> angular velocity in the body frame.",
    )
    page.section("In a program")
    page.code(
        "import somersault\n\n"
        "body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))\n"
        "start = somersault.State(angular_velocity=(1.0, 2.0, 3.0))\n"
        'motion = somersault.integrate(body, start, (0.0, 10.0), dt=0.01, method="rkmk")\n'
        "print(motion.t, motion.quaternion, motion.kinetic_energy)\n"
    )
