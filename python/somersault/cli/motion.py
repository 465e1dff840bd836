"""`somersault integrate`: the motion that a document describes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

import somersault
from somersault import contact, forces, multibody
from somersault.cli import kinds, tables
from somersault.cli.documents import Document, read
from somersault.errors import SomersaultError

_FORCES = {
    "gravity": forces.Gravity,
    "spring": forces.Spring,
    "drag": forces.Drag,
    "force": forces.Force,
    "torque": forces.Torque,
}
_SURFACES = {
    "half_space": contact.HalfSpace,
    "sphere": contact.SphericalSurface,
    "cylinder": contact.CylindricalSurface,
}


def integrate(arguments: argparse.Namespace) -> int:
    """Integrates and writes the curves; what a run that failed had recorded is written too."""
    document = read(arguments.file, "integrate")
    tables.check(arguments.out, arguments.format)
    if arguments.events:
        tables.check(arguments.events)
    if arguments.save:
        tables.check(arguments.save, "csv")
    tables.check_page(arguments.html)
    outputs = {name: getattr(arguments, name) for name in ("out", "events", "save", "html")}
    tables.check_distinct(arguments.file, **outputs)
    run = _body_motion if "body" in document.values else _tree_motion
    status = 0
    motion: Any
    try:
        motion = run(document, arguments.progress)
    except SomersaultError as fault:
        motion = getattr(fault, "solution", None)
        if motion is None:
            raise
        print(f"somersault: {fault}", file=sys.stderr)
        status = 1
    tables.write(_columns(motion), arguments.out, arguments.format)
    if arguments.save:
        somersault.save(arguments.save, motion)
    if arguments.html:
        from somersault import viewer

        viewer.Scene(arguments.file.stem).add(motion).write(arguments.html)
    events = getattr(motion, "events", ())
    if arguments.events:
        names = ("t", "contact", "kind")
        rows = {name: np.array([getattr(event, name) for event in events]) for name in names}
        tables.write(rows, arguments.events)
    print(
        f"{motion.n_steps} steps, {motion.nfev} evaluations"
        + (f", {len(events)} events" if "contacts" in document.values else ""),
        file=sys.stderr,
    )
    return status


def _columns(motion: Any) -> dict[str, Any]:
    if isinstance(motion, multibody.TreeSolution):
        return tables.curves(t=motion.t, q=motion.q, v=motion.v)
    return tables.curves(
        t=motion.t,
        position=motion.position,
        quaternion=motion.quaternion,
        velocity=motion.velocity,
        angular_velocity=motion.angular_velocity,
    )


def _made(kinds: dict[str, Any], values: dict[str, Any], default: str | None = None) -> Any:
    arguments = dict(values)
    kind = arguments.pop("kind", default)
    try:
        return kinds[kind](**arguments)
    except TypeError as fault:
        # Arguments that the schema allows for another kind.
        raise somersault.InputError(f"a {kind} takes other values: {fault}") from fault


def _body(mass: float, shape: str, given: Any) -> somersault.RigidBody:
    if shape == "inertia":
        return somersault.RigidBody(mass, np.diag(given) if np.ndim(given) == 1 else given)
    make = getattr(somersault.RigidBody, shape)
    made: somersault.RigidBody = make(mass, *given) if shape in ("cylinder", "capsule") else make(mass, given)
    return made


def _state(document: Document) -> somersault.State:
    values = dict(document.values.get("state", {}))
    for name in ("q", "v"):
        if name in values:
            raise document.fault(("state", name), "belongs to a tree; a body has a position and so on")
    if "quaternion" in values:
        values["orientation"] = values.pop("quaternion")
    with document.at("state"):
        return somersault.State(**values)


def _contact(document: Document, index: int, values: dict[str, Any]) -> contact.Contact:
    place = "contacts", index
    with document.at(*place, "surface"):
        surface = _made(_SURFACES, values["surface"])
    with document.at(*place, "law"):
        law = _made(kinds.NORMAL_LAWS, values["law"], kinds.DEFAULT_LAW)
    friction = None
    if "friction" in values:
        with document.at(*place, "friction"):
            friction = _made(kinds.FRICTION_LAWS, values["friction"])
    with document.at(*place):
        return contact.Contact(values["point"], surface, law, friction=friction)


def _body_motion(document: Document, progress: bool) -> somersault.Solution:
    values = document.values
    (shape,) = values["body"].keys() - {"mass"}
    with document.at("body", shape):
        body = _body(values["body"]["mass"], shape, values["body"][shape])
    state = _state(document)
    acting = []
    for i, force in enumerate(values.get("forces", [])):
        with document.at("forces", i):
            acting.append(_made(_FORCES, force))
    touching = [_contact(document, i, item) for i, item in enumerate(values.get("contacts", []))]
    options = dict(values["run"])
    with _run(document):
        return somersault.integrate(
            body,
            state,
            options.pop("interval"),
            forces=acting or None,
            contacts=touching or None,
            progress=progress,
            **options,
        )


def _model(document: Document) -> somersault.Model:
    values = document.values["tree"]
    if "urdf" in values:
        with document.at("tree", "urdf"):
            path = document.path.parent / values["urdf"]
            return somersault.Model.read_urdf(path, base=values.get("base", "fixed"))
    if "base" in values:
        raise document.fault(("tree", "base"), "belongs to a file of URDF")
    if "mjcf" in values:
        with document.at("tree", "mjcf"):
            return somersault.Model.read_mjcf(document.path.parent / values["mjcf"])
    made = getattr(multibody, values["name"])()
    model: somersault.Model = getattr(made, "model", made)
    return model


def _tree_motion(document: Document, progress: bool) -> multibody.TreeSolution:
    values = document.values
    for name in ("forces", "contacts"):
        if name in values:
            raise document.fault((name,), "belongs to a body; a tree takes `tree.torque`")
    model = _model(document)
    state = values.get("state", {})
    for name in state.keys() - {"q", "v"}:
        raise document.fault(("state", name), "belongs to a body; a tree has q and v")
    options = dict(values["run"])
    with document.at("state"):
        # Evaluated for its checks: what is wrong with q or v is then told with their line.
        model.kinetic_energy(state.get("q", model.neutral()), state.get("v", np.zeros(model.n_velocities)))
    with _run(document):
        return multibody.integrate_tree(
            model,
            state.get("q", model.neutral()),
            state.get("v", np.zeros(model.n_velocities)),
            options.pop("interval"),
            torque=values["tree"].get("torque"),
            progress=progress,
            **options,
        )


class _run:
    """Puts the line of the run, or of the value named, before what the library refuses at its start."""

    def __init__(self, document: Document) -> None:
        self.document = document

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: Any, fault: BaseException | None, trace: Any) -> None:
        refused = isinstance(fault, somersault.InputError) and getattr(fault, "solution", None) is None
        if not refused:
            return
        tables = [(name,) for name in ("run", "tree") if name in self.document.values]
        found = [self.document.named(table, str(fault)) for table in tables]
        where = next((place for place in found if len(place) > 1), ("run",))
        raise self.document.fault(where, str(fault)) from fault


def add(commands: Any) -> None:
    """Adds the command to the parser."""
    parser = commands.add_parser(
        "integrate",
        help="integrate the motion that a file describes",
        description="Integrates the motion of a rigid body or of a tree that a TOML or JSON file describes.",
    )
    parser.add_argument(
        "file", type=Path, help="read this input, TOML or JSON; see `somersault schema integrate`"
    )
    parser.add_argument(
        "--out", type=Path, help="write the curves here, .parquet, .csv or .json (default: print CSV)"
    )
    parser.add_argument("--format", choices=tables.FORMATS, help="write the curves in this format")
    parser.add_argument("--events", type=Path, metavar="FILE", help="write the events in contacts here")
    parser.add_argument(
        "--save", type=Path, metavar="FILE", help="write the solution here, for somersault.load"
    )
    parser.add_argument("--html", type=Path, metavar="FILE", help="write a page that plays the motion")
    parser.set_defaults(command=integrate)
