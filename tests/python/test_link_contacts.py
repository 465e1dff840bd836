"""Contacts from shapes and from the collision elements of robots, and a robot that stands on them."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import somersault
from somersault import contact, errors, multibody

Array = NDArray[np.float64]
FLOOR = contact.HalfSpace()
LAW = contact.CompliantLaw(2e4, 150.0)
GRIP = contact.CoulombFriction(0.6, 1.5e4, 100.0)

INERTIAL = """<inertial><mass value="{}"/>
  <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>"""


def link(name: str, mass: float, *shapes: str) -> str:
    collisions = "".join(f"<collision>{shape}</collision>" for shape in shapes)
    return f'<link name="{name}">{INERTIAL.format(mass)}{collisions}</link>'


def hinge(parent: str, child: str, place: str) -> str:
    return f"""<joint name="{child}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
      <origin xyz="{place}"/><axis xyz="0 1 0"/><dynamics damping="2"/></joint>"""


def quadruped(gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> multibody.Robot:
    box, mesh = (
        "<geometry><box size='0.5 0.3 0.1'/></geometry>",
        "<geometry><mesh filename='a.stl'/></geometry>",
    )
    foot = "<origin xyz='0 0 -0.22'/><geometry><sphere radius='0.02'/></geometry>"
    text = link("trunk", 8.0, box, mesh)
    for leg, place in [
        ("lf", "0.2 0.15 0"),
        ("rf", "0.2 -0.15 0"),
        ("lh", "-0.2 0.15 0"),
        ("rh", "-0.2 -0.15 0"),
    ]:
        text += link(f"{leg} thigh", 1.0) + link(f"{leg} shank", 0.4, foot)
        text += hinge("trunk", f"{leg} thigh", place) + hinge(f"{leg} thigh", f"{leg} shank", "0 0 -0.22")
    return multibody.Robot.from_urdf(f"<robot name='dog'>{text}</robot>", base="free", gravity=gravity)


def test_shapes_touch_where_they_end() -> None:
    turn = Rotation.from_euler("xyz", [0.3, -0.4, 0.7])
    size, center = np.array([0.2, 0.1, 0.04]), np.array([0.5, -0.2, 0.1])

    def made(shape: str, size: object, **options: object) -> list[contact.LinkContact]:
        return contact.shape_contacts("foot", shape, size, FLOOR, LAW, **options)  # type: ignore[arg-type]

    placed = {"position": center, "orientation": turn, "name": "sole", "on": "board"}
    corners = made("box", size, **placed)
    signs = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    assert np.array([touch.contact.point for touch in corners]) == pytest.approx(
        center + turn.apply(signs * size), abs=1e-15
    )
    assert [touch.name for touch in corners] == [f"sole corner {k}" for k in range(1, 9)]
    assert {(touch.link, touch.on) for touch in corners} == {("foot", "board")}
    ends = made("capsule", (0.05, 0.3), **placed)
    axis = turn.apply([0, 0, 1.0])
    assert ends[1].contact.point == pytest.approx(center + 0.15 * axis) and ends[1].contact.radius == 0.05
    rims = made("cylinder", (0.05, 0.3), orientation=turn)
    assert rims[0].name == "foot rim 1" and rims[0].contact.axis == pytest.approx(axis)
    (ball,) = made("sphere", [0.05])
    assert ball.name == "foot" and ball.contact.radius == 0.05 and ball.contact.friction is None
    again = pickle.loads(pickle.dumps(rims))
    assert again[0].contact.axis == pytest.approx(axis) and again[0].name == "foot rim 1"


def test_laws_and_surfaces_are_those_given() -> None:
    def hill(point: Array) -> tuple[float, Array]:
        return float(point[2]), np.array([0.0, 0.0, 1.0])

    resistance = contact.Resistance(0.01, 0.02, 0.1)
    (ball,) = contact.shape_contacts("a", "sphere", [0.1], hill, LAW, friction=GRIP, resistance=resistance)
    assert ball.surface is hill and ball.contact.law == LAW
    assert ball.contact.friction == GRIP and ball.contact.resistance == resistance
    with pytest.raises(errors.InputError, match="rims of a cylinder touch half-spaces only"):
        contact.shape_contacts("a", "cylinder", (0.1, 1.0), hill, LAW)


def test_a_robot_touches_with_its_collision_elements() -> None:
    dog = quadruped()
    touches, left_out = contact.link_contacts(dog, FLOOR, LAW, friction=GRIP)
    assert [touch.name for touch in touches[7:10]] == ["trunk shape 1 corner 8", "lf shank", "rf shank"]
    assert len(touches) == 12 and len(left_out) == 1
    assert left_out[0].startswith(
        "link `trunk`: a mesh has no contacts, since its file `a.stl` is not opened"
    )
    feet, left_out = contact.link_contacts(dog, FLOOR, LAW, links=["lf shank", "lf thigh"])
    assert [touch.name for touch in feet] == ["lf shank"] and feet[0].contact.point[2] == -0.22
    assert left_out == ["link `lf thigh`: it has no shape to collide with"]
    carried, _ = contact.link_contacts(dog, FLOOR, LAW, on="trunk")
    assert {touch.link for touch in carried} == {f"{leg} shank" for leg in ("lf", "rf", "lh", "rh")}


def test_a_mesh_touches_with_the_vertices_of_its_hull(tmp_path: Path) -> None:
    corners = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)]
    lines = [f"v {x} {y} {z}" for x, y, z in [*corners, (0.5, 1, 1), (0, 1, 1), (0, 0, 1)]]
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "a.obj").write_text("\n".join(lines))

    def touches(file: str) -> tuple[list[contact.LinkContact], list[str]]:
        mesh = f"<origin xyz='0 0 5'/><geometry><mesh filename='{file}' scale='2 1 1'/></geometry>"
        text = f"<robot name='r'>{link('brick', 1.0, mesh)}</robot>"
        robot = multibody.Robot.from_urdf(text, base="free")
        return contact.link_contacts(robot, FLOOR, LAW, meshes=tmp_path)

    made, left_out = touches("package://r/meshes/a.obj")
    assert left_out == [] and [touch.name for touch in made] == [f"brick vertex {k}" for k in range(1, 9)]
    places = sorted(tuple(touch.contact.point) for touch in made)
    assert places == sorted((2.0 * x, float(y), 5.0 + z) for x, y, z in corners)
    assert touches("b.obj")[1][0].endswith(f"its file `b.obj` is not in `{tmp_path}`")
    (tmp_path / "flat.obj").write_text("\n".join(lines[:3]))
    assert "no convex hull with a volume" in touches("flat.obj")[1][0]


def test_capsules_and_boxes_touch_round_surfaces() -> None:
    log, dome = (
        contact.CylindricalSurface((0, 0, 0), (0, 1, 0), 0.3),
        contact.SphericalSurface((0, 0, 0), 0.3),
    )
    turn = Rotation.from_euler("xyz", [0.3, -0.4, 0.7])
    placed = {"position": (0.1, 0.2, 0.3), "orientation": turn}
    (pole,) = contact.shape_contacts("pole", "capsule", (0.05, 1.0), log, LAW, **placed)
    assert pole.contact.ends == pytest.approx(
        np.array([0.1, 0.2, 0.3]) + np.outer([-0.5, 0.5], turn.apply([0, 0, 1.0]))
    )
    assert len(contact.shape_contacts("slab", "box", (1.0, 0.5, 0.1), log, LAW)) == 12
    (slab,) = contact.shape_contacts("slab", "box", (1.0, 0.5, 0.1), dome, LAW, **placed)
    assert slab.contact.size == pytest.approx([1.0, 0.5, 0.1])
    assert slab.contact.orientation == pytest.approx(turn.as_matrix())
    state = somersault.State((0.2, -0.1, 0.6), orientation=(0.1, 0.2, 0.3, 0.9))
    for touch in (pole, slab):
        assert pickle.loads(pickle.dumps(touch)).contact.gap(state) == pytest.approx(touch.contact.gap(state))
    with pytest.raises(errors.InputError, match="a capsule touches spheres and cylinders from outside"):
        contact.Contact.capsule([(0, 0, 0), (1, 0, 0)], 0.1, FLOOR, LAW)  # type: ignore[arg-type]
    with pytest.raises(errors.InputError, match="a box touches spheres from outside"):
        contact.Contact.box((1, 1, 1), log, LAW)  # type: ignore[arg-type]


def test_pairs_of_capsules_and_boxes() -> None:
    tree = multibody.Model(
        [
            multibody.Link("stand", "fixed", mass=1.0, inertia=(1, 1, 1)),
            multibody.Link("a", "free", parent="stand", mass=1.0, inertia=(0.1, 0.1, 0.1)),
            multibody.Link("b", "free", parent="stand", mass=1.0, inertia=(0.1, 0.1, 0.1)),
        ]
    )
    # Along x and along y, 0.3 above each other.
    across = (Rotation.from_euler("y", 90, degrees=True), Rotation.from_euler("x", 90, degrees=True))
    rods = (("capsule", (0.05, 1.0)), ("capsule", (0.04, 1.0)))
    pair = contact.LinkPair.of_shapes("rods", ("a", "b"), rods, LAW, orientations=across)
    q = np.array([0.1, 0.2, 0.3, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1.0])
    for one in (pair, pickle.loads(pickle.dumps(pair))):
        assert contact.TreeContacts(tree, one).gaps(q, np.zeros(12))[0] == pytest.approx([0.3 - 0.09])
    ball = (("sphere", [0.1]), ("box", (2.0, 2.0, 0.2)))
    assert contact.LinkPair.of_shapes("ball", ("a", "b"), ball, LAW).radii == (0.1, 0.0)
    with pytest.raises(errors.InputError, match="a pair must be of a ball with"):
        contact.LinkPair.of_shapes("boxes", ("a", "b"), (ball[1], rods[0]), LAW)
    with pytest.raises(errors.InputError, match="`shape` must be 'box'"):
        contact.LinkPair.of_shapes("cone", ("a", "b"), (("cone", [1.0]), ball[0]), LAW)  # type: ignore[arg-type]


@pytest.mark.parametrize("slope", [0.0, 0.15])
def test_a_quadruped_stands_at_rest(slope: float) -> None:
    dog = quadruped((-9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)))
    touches, _ = contact.link_contacts(dog, FLOOR, LAW, friction=GRIP)
    legs = np.tile([0.5, -1.0], 4)

    def held(t: float, q: Array, v: Array) -> Array:
        return np.concatenate([np.zeros(6), 400.0 * (legs - q[7:]) - 4.0 * v[6:]])

    guess = np.concatenate([[0, 0, 0.405, 0, 0, 0, 1], legs])
    ground = contact.TreeContacts(dog.model, touches)
    pose, stretches, success = ground.equilibrium(guess, held)
    assert success
    forces = ground.forces(pose, np.zeros(14), stretches).sum(axis=0)
    assert forces == pytest.approx(-dog.model.mass * dog.model.gravity, abs=1e-8)
    still = multibody.integrate_tree(
        dog.model,
        pose,
        np.zeros(14),
        (0.0, 0.1),
        dt=5e-3,
        method="rkmk8",
        torque=held,
        contacts=touches,
        stretches=stretches,
    )
    assert still.n_events == 0 and np.abs(still.q[-1] - pose).max() < 1e-12


def test_what_the_torque_of_a_pose_raises_comes_out() -> None:
    leg = contact.hopping_leg()
    feet = contact.TreeContacts(leg.model, leg.contacts)

    def broken(t: float, q: Array, v: Array) -> Array:
        raise RuntimeError("no torque here")

    with pytest.raises(RuntimeError, match="no torque here"):
        feet.equilibrium((0.0, 0.649, 0.0, 0.0, 0.0), broken)


@pytest.mark.parametrize(
    ("call", "part"),
    [
        (
            lambda: contact.shape_contacts("a", "cone", [1.0], FLOOR, LAW),  # type: ignore[arg-type]
            "`shape` must be 'box', 'capsule', 'cylinder' or 'sphere', found 'cone'",
        ),
        (
            lambda: contact.shape_contacts("a", "box", [1.0], FLOOR, LAW),
            "`size` must be real numbers of shape (3,)",
        ),
        (
            lambda: contact.shape_contacts("a", "box", (1.0, 0.0, 1.0), FLOOR, LAW),
            "`size` must be positive and finite, found 0",
        ),
        (lambda: contact.shape_contacts("a", "sphere", [-1.0], FLOOR, LAW), "`radius` must be positive"),
        (
            lambda: contact.link_contacts(quadruped(), FLOOR, LAW, links=["hand"]),
            "`links` must be the name of a body of the model, found `hand`",
        ),
        (lambda: contact.link_contacts(quadruped(), 3, LAW), "`surface` must be a Surface or a callable"),  # type: ignore[arg-type]
    ],
)
def test_what_is_not_allowed_is_named(call: Callable[[], object], part: str) -> None:
    with pytest.raises(errors.InputError) as caught:
        call()
    assert part in str(caught.value)
