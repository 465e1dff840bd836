"""The viewer: what its pages hold, what its figures look like, and what it refuses."""

import base64
import json
import re
from collections.abc import Callable, Sequence
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import somersault
from somersault import RigidBody, multibody, viewer
from somersault.errors import InputError
from somersault.viewer import figures

Array = NDArray[np.float64]

BODY = RigidBody.box(1.0, (0.2, 0.4, 0.6))
DIVER = multibody.diver_spatial()
STILL = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (3, 1))
TIMES = (0.0, 0.5, 1.0)


def data(scene: viewer.Scene) -> dict[str, Any]:
    """What the page has of the scene."""
    found = re.search(r"const SCENE = (\{.*\});\n", scene.html())
    assert found is not None
    return json.loads(found[1])  # type: ignore[no-any-return]


def unpacked(text: str, *shape: int) -> NDArray[np.float32]:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(-1, *shape)


def dive_scene(dive: multibody.TreeSolution) -> viewer.Scene:
    return viewer.Scene("Dive").add(dive, label="a pike").water().platform(10.0).caption(0.4, "folding")


# Pages


def test_a_dive_is_one_small_page_that_loads_nothing(dive: multibody.TreeSolution, tmp_path: Path) -> None:
    text = dive_scene(dive).write(tmp_path / "dive.html").read_text(encoding="utf-8")
    assert len(text.encode()) < 250_000
    assert not re.search(r"\b(src|href)=|@import|url\(|fetch\(|import\(|XMLHttpRequest|WebSocket", text)
    assert "{{" not in text


def test_poses_go_to_the_page_as_they_are(dive: multibody.TreeSolution) -> None:
    (motion,) = data(viewer.Scene().add(dive))["motions"]
    t = unpacked(motion["times"])
    poses = unpacked(motion["poses"], motion["bodies"], 7)
    assert len(t) == len(poses) >= 115
    drawn = [name for name in DIVER.model.names if name in viewer.figure(DIVER.model)]
    assert motion["bodies"] == len(drawn) == 17
    for k in (0, len(dive) // 2, len(dive) - 1):
        sent = poses[np.argmin(np.abs(t - dive.t[k]))]
        assert np.abs(t - dive.t[k]).min() < 1e-6
        for name, pose in zip(drawn, sent, strict=True):
            expected = DIVER.model.poses(dive.q[k])[DIVER.model.body(name)]
            np.testing.assert_allclose(pose[:3], expected[:3, 3], atol=2e-6)
            np.testing.assert_allclose(Rotation.from_quat(pose[3:]).as_matrix(), expected[:3, :3], atol=1e-6)


def test_momentum_and_rate_are_those_of_the_solution(
    dive: multibody.TreeSolution, tumble: somersault.Solution
) -> None:
    (motion,) = data(viewer.Scene().add(dive))["motions"]
    # It is conserved in flight.
    expected = DIVER.model.centroidal_momentum(dive.q[0], dive.v[0])[3:]
    momenta = unpacked(motion["momentum"], 3)
    np.testing.assert_allclose(momenta, np.tile(expected, (len(momenta), 1)), atol=2e-3)
    (motion,) = data(viewer.Scene().add(tumble))["motions"]
    np.testing.assert_allclose(unpacked(motion["rate"], 3)[-1], tumble.angular_velocity[-1], rtol=1e-6)
    np.testing.assert_allclose(unpacked(motion["momentum"], 3)[-1], tumble.angular_momentum[-1], rtol=1e-6)


def test_arrays_of_a_body_give_what_its_solution_gives(tumble: somersault.Solution) -> None:
    q = np.column_stack([tumble.position, tumble.quaternion])
    v = np.column_stack([tumble.velocity, tumble.angular_velocity])
    (given,) = data(viewer.Scene().add(BODY, tumble.t, q, v))["motions"]
    (solved,) = data(viewer.Scene().add(tumble))["motions"]
    for name in ("times", "poses", "center", "momentum", "rate"):
        np.testing.assert_allclose(unpacked(given[name]), unpacked(solved[name]), rtol=1e-6, atol=1e-6)


def test_the_rate_of_a_tree_of_one_body_is_its_angular_velocity() -> None:
    tree = multibody.Model([multibody.Link("it", "free", body=BODY, center=(0.3, 0.0, 0.1))])
    q, v = np.array([0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.9]), np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    q[3:] /= np.linalg.norm(q[3:])
    (motion,) = data(viewer.Scene().add(tree, [0.0], [q], [v]))["motions"]
    expected = tree.velocities(q, v)[0]
    assert any(
        np.allclose(unpacked(motion["rate"], 3)[0], part, rtol=1e-5) for part in (expected[:3], expected[3:])
    )


def test_momentum_of_several_bodies_is_about_their_common_centre() -> None:
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (2, 2, 1))
    position = np.array([[[1.0, 0, 0], [-1.0, 0, 0]]] * 2)
    velocity = np.array([[[5.0, 2.0, 0], [5.0, -2.0, 0]]] * 2)
    pair = somersault.Trajectory([BODY, BODY], [0.0, 1.0], position, turn, velocity, np.zeros((2, 2, 3)))
    (motion,) = data(viewer.Scene().add(pair))["motions"]
    np.testing.assert_allclose(unpacked(motion["momentum"], 3), [[0, 0, 4.0]] * 2)
    assert "rate" not in motion and motion["bodies"] == 2


def test_sparse_samples_of_a_tree_are_joined_without_tearing_it() -> None:
    q = [DIVER.configuration("A"), DIVER.configuration("F")]
    (motion,) = data(viewer.Scene().add(DIVER.model, (0.0, 1.0), q))["motions"]
    poses = unpacked(motion["poses"], motion["bodies"], 7).astype(float)
    assert len(poses) >= 60
    drawn = [name for name in DIVER.model.names if name in viewer.figure(DIVER.model)]
    thigh, shank = drawn.index("right_thigh"), drawn.index("right_shank")
    knee = poses[:, thigh, :3] + Rotation.from_quat(poses[:, thigh, 3:]).apply(
        DIVER.model.links[DIVER.model.body("right_shank")].origin
    )
    np.testing.assert_allclose(poses[:, shank, :3], knee, atol=1e-6)


def test_dense_samples_are_thinned_by_time_and_turn() -> None:
    def samples(rate: float) -> int:
        t = np.linspace(0.0, 2.0, 50_001)
        angle = 0.5 * rate * t
        q = np.column_stack([np.zeros((len(t), 5)), np.sin(angle), np.cos(angle)])
        (motion,) = data(viewer.Scene().add(BODY, t, q))["motions"]
        turned = np.diff(
            np.unwrap(2 * np.arctan2(*unpacked(motion["poses"], 7).astype(float)[:, 5:].T), period=4 * np.pi)
        )
        assert np.abs(turned).max() < 0.32
        return len(turned)

    assert samples(0.0) <= 202
    assert 2 * samples(10.0) < samples(500.0) < 6000


def test_a_motion_that_would_fill_a_page_is_refused() -> None:
    angle = np.arange(200_000) * 0.1
    q = np.column_stack([np.zeros((len(angle), 5)), np.sin(angle / 2), np.cos(angle / 2)])
    with pytest.raises(InputError, match=r"would need 7.* samples of it and has at most 50000"):
        viewer.Scene().add(BODY, angle, q)


def test_text_cannot_leave_its_place() -> None:
    evil = "</script><script>alert(1)</script>{{script}}"
    scene = viewer.Scene(evil).add(BODY, TIMES, STILL, label=evil).caption(0.0, evil)
    text = scene.html()
    assert text.count("<script") == text.count("</script") == 1
    assert data(scene)["motions"][0]["label"] == evil


def test_a_notebook_shows_the_page_in_a_frame() -> None:
    scene = viewer.Scene().add(BODY, TIMES, STILL)
    found = re.fullmatch(r'<iframe srcdoc="([^"]*)"[^>]*></iframe>', scene._repr_html_())
    assert found is not None and unescape(found[1]) == scene.html()


def test_animate_writes_a_page_in_one_line(tmp_path: Path, tumble: somersault.Solution) -> None:
    assert viewer.animate(tumble, path=tmp_path / "box.html", label="a box").stat().st_size < 100_000
    with pytest.raises(somersault.InputError, match="a path is given by its name, `path=`"):
        viewer.animate(tumble, tmp_path / "box.html")  # type: ignore[arg-type]
    with pytest.raises(somersault.InputError, match=r"in \.html, found 'box\.gif'; `export` writes films"):
        viewer.Scene().add(tumble).write(tmp_path / "box.gif")


@pytest.mark.parametrize(
    ("model", "view"),
    [
        (multibody.cart_pendulum(), "side"),
        (multibody.two_link_arm(), "top"),
        (multibody.diver_planar().model, "side"),
        (DIVER.model, "corner"),
    ],
)
def test_a_plane_motion_is_seen_from_across(model: multibody.Model, view: str) -> None:
    q = np.array([model.neutral(), model.neutral() + 0.1])
    assert data(viewer.Scene().add(model, (0.0, 1.0), model.normalize(q)))["camera"]["view"] == view


def test_the_camera_follows_what_goes_far(dive: multibody.TreeSolution) -> None:
    assert data(viewer.Scene().add(dive))["camera"]["follow"]
    assert not data(viewer.Scene().add(BODY, TIMES, STILL))["camera"]["follow"]
    assert not data(viewer.Scene().add(dive).camera(follow=False))["camera"]["follow"]


# Contacts


LEG = multibody.Model(
    [
        multibody.Link("thigh", "planar", body=BODY),
        multibody.Link(
            "shank", "revolute", parent="thigh", axis=(0, 1, 0), origin=(0.0, 0.0, -0.4), body=BODY
        ),
    ]
)


def contacts_sent(forces: Array, t: Array) -> list[dict[str, Any]]:
    q = np.zeros((len(t), LEG.n_positions))
    shapes = {"thigh": viewer.Sphere(0.1)}
    scene = viewer.Scene().add(LEG, t, q, shapes=shapes, contacts=[("shank", (0.0, 0.1, -0.4), forces)])
    (motion,) = data(scene)["motions"]
    # The body that touches goes with those that are drawn.
    assert motion["bodies"] == 2
    np.testing.assert_allclose(unpacked(motion["poses"], 2, 7)[0, :, 2], [0.0, -0.4], atol=1e-6)
    sent: list[dict[str, Any]] = motion["force"]
    return sent


def test_contacts_go_to_the_page_with_times_of_their_own() -> None:
    t = np.linspace(2.0, 4.0, 20_001)
    # A touch that begins and ends slowly, a blow of 2 ms, and a push that sways.
    touch, blow = (np.sin(np.pi * np.clip((t - at) / span, 0, 1)) for at, span in ((2.2, 0.2), (2.5, 2e-3)))
    push = np.where(t > 3.0, 50.0 + 20.0 * np.sin(9.0 * t), 0.0)
    up = 60.0 * touch**2 + 900.0 * blow + push
    up[up < 1e-9] = 0.0
    forces = np.column_stack([0.3 * push, np.zeros_like(t), up])
    (sent,) = contacts_sent(forces, t)
    assert sent["body"] == 1 and sent["point"] == [0.0, 0.1, -0.4]
    found, drawn = unpacked(sent["times"]).astype(float) + 2.0, unpacked(sent["forces"], 3).astype(float)
    assert len(found) < 150
    back = np.column_stack([np.interp(t, found, axis) for axis in drawn.T])
    assert np.linalg.norm(back - forces, axis=1).max() < 0.01 * np.linalg.norm(forces, axis=1).max()
    # It touches when it does, to a sample of the motion.
    touching = forces.any(axis=1)
    assert not back[~(touching | np.roll(touching, 1) | np.roll(touching, -1))].any()
    assert back[touching].any(axis=1).all()


def test_a_contact_that_never_touches_is_two_samples() -> None:
    (sent,) = contacts_sent(np.zeros((500, 3)), np.linspace(0.0, 1.0, 500))
    assert len(unpacked(sent["times"])) == 2 and not unpacked(sent["forces"]).any()
    (motion,) = data(viewer.Scene().add(BODY, TIMES, STILL))["motions"]
    assert "force" not in motion


def test_forces_on_a_body_are_at_the_times_of_its_solution() -> None:
    law = somersault.contact.CompliantLaw.from_restitution(1.0, 1e4, 0.5)
    ball = somersault.contact.bouncing_ball(1.0, 0.1, law, height=1.0)
    motion = somersault.integrate(
        ball.body, ball.state, (0.0, 0.6), dt=1e-3, forces=ball.forces, contacts=ball.contacts
    )
    (touch,) = ball.contacts
    size = np.array([law.force(*touch.gap(motion[n])) for n in range(len(motion))])
    forces = size[:, None] * [0.0, 0.0, 1.0]
    (page,) = data(viewer.Scene().add(motion, contacts=[("body", touch.point, forces)]))["motions"]
    (sent,) = page["force"]
    t, found = unpacked(sent["times"]), unpacked(sent["forces"], 3)
    down, up = (event.t for event in motion.events)
    touching = t[found.any(axis=1)]
    assert len(touching) > 5 and down - 1e-3 <= touching[0] <= touching[-1] <= up + 1e-3
    assert found.max() == pytest.approx(size.max())


def test_a_contact_that_would_fill_a_page_is_refused() -> None:
    t = np.arange(60_000) * 1e-4
    noise = np.random.default_rng(3).normal(size=(len(t), 3))
    with pytest.raises(InputError, match="would need 60000 samples of a force and has at most 50000"):
        contacts_sent(noise, t)


# Figures


def between(rows: Sequence[Sequence[float]], low: float, high: float) -> float:
    """The volume of a loft between two heights, by sums over 2000 slices."""
    z, _, _, a, b = viewer.Loft(rows).rings[1:-1].T
    at = np.linspace(max(low, z[0]), min(high, z[-1]), 2001)
    sections = np.pi * np.interp(at, z, a) * np.interp(at, z, b)
    return float(np.sum(0.5 * (sections[1:] + sections[:-1]) * np.diff(at)))


# Densities, kg/l: Dempster (1955) in Winter (2009), Table 4.1. Ends without a joint are those of the form.
@pytest.mark.parametrize(
    ("name", "rows", "low", "high", "density"),
    [
        ("torso", figures._TORSO, 0.0, 0.44682, 1.03),
        ("pelvis", figures._PELVIS, -0.14227, 0.0, 1.03),
        ("right_thigh", figures._THIGH, -0.41226, 1.0, 1.05),
        ("right_shank", figures._SHANK, -0.42993, 0.0, 1.09),
        ("right_foot", figures._FOOT, -1.0, 0.12287, 1.10),
        ("right_upper_arm", figures._UPPER_ARM, -0.27507, 1.0, 1.07),
        ("right_forearm", figures._FOREARM, -0.26257, 0.0, 1.13),
        ("right_hand", figures._HAND, -1.0, 1.0, 1.16),
    ],
)
def test_segments_drawn_have_the_mass_of_the_model(
    name: str, rows: Sequence[Sequence[float]], low: float, high: float, density: float
) -> None:
    mass = DIVER.model.links[DIVER.model.body(name)].mass
    assert 1000.0 * density * between(rows, low, high) == pytest.approx(mass, rel=0.15)


def placed(model: multibody.Model, q: Array) -> list[tuple[float, ...]]:
    """Where the shapes of a figure are in the world, in order."""
    found = []
    for name, shapes in viewer.figure(model).items():
        pose = model.poses(q)[model.body(name)]
        for shape in shapes:
            rings = shape.rings
            points = shape.rotation.apply(rings[:, [1, 2, 0]]) + shape.position
            found += [tuple(np.round(pose[:3, :3] @ p + pose[:3, 3], 6) + 0.0) for p in points]
    return sorted(found)


@pytest.mark.parametrize("posture", ["A", "B", "F", "H"])
def test_the_planar_diver_looks_like_the_spatial_one(posture: str) -> None:
    planar = multibody.diver_planar()
    flat = placed(planar.model, planar.configuration(posture))
    np.testing.assert_allclose(flat, placed(DIVER.model, DIVER.configuration(posture)), atol=2e-6)


def test_a_larger_diver_is_longer_and_a_heavier_one_wider() -> None:
    tall = viewer.figure(multibody.diver_spatial(mass=65.0, height=1.87).model)["right_thigh"][0].rings
    heavy = viewer.figure(multibody.diver_spatial(mass=78.65, height=1.7).model)["right_thigh"][0].rings
    plain = viewer.figure(DIVER.model)["right_thigh"][0].rings
    np.testing.assert_allclose(tall[:, 0], 1.1 * plain[:, 0], rtol=1e-9)
    np.testing.assert_allclose(tall[:, 3:], plain[:, 3:] / np.sqrt(1.1), rtol=1e-3)
    np.testing.assert_allclose(heavy[:, 3:], 1.1 * plain[:, 3:], rtol=1e-3)


def test_the_equivalent_ellipsoid_of_an_ellipsoid_is_itself() -> None:
    body = RigidBody.ellipsoid(3.0, (0.1, 0.3, 0.2))
    radii, axes = viewer.equivalent_ellipsoid(body.mass, body.inertia)
    order = np.abs(axes.as_matrix()).argmax(axis=0)
    np.testing.assert_allclose(radii, np.array([0.1, 0.3, 0.2])[order])
    assert np.linalg.det(axes.as_matrix()) == pytest.approx(1.0)


def test_any_tree_has_a_figure() -> None:
    model = multibody.Model(
        [
            multibody.Link("base", "free", body=BODY),
            multibody.Link("bare", "revolute", parent="base", axis=(0, 1, 0), origin=(0.0, 0.0, 0.5)),
            multibody.Link(
                "bob", "spherical", parent="bare", origin=(0.0, 0.0, 0.4), mass=1.0, center=(0, 0, 0.3)
            ),
        ]
    )
    shapes = viewer.figure(model)
    assert set(shapes) == {"base", "bare", "bob"}
    assert data(viewer.Scene().add(model, [0.0], [model.neutral()]))["motions"][0]["bodies"] == 3


def test_rings_of_capsules_are_tangent_to_both_balls() -> None:
    z, _, _, a, _ = viewer.Capsule((0, 0, 0), (0, 0, 0.5), 0.1, 0.05).rings.T
    on_first = np.isclose(np.hypot(z, a), 0.1)
    on_last = np.isclose(np.hypot(z - 0.5, a), 0.05)
    assert (on_first | on_last).all() and on_first.sum() == on_last.sum() == len(z) // 2
    # The slope of the cone is that of both circles where it meets them.
    k = len(z) // 2
    slope = (a[k] - a[k - 1]) / (z[k] - z[k - 1])
    assert slope == pytest.approx(-z[k - 1] / a[k - 1]) == pytest.approx(-(z[k] - 0.5) / a[k])


# Errors


def add(**arguments: Any) -> Callable[[], object]:
    given: dict[str, Any] = {"moving": BODY, "t": TIMES, "q": STILL} | arguments
    return lambda: viewer.Scene().add(**given)


PAIR = {"torso": viewer.Sphere(0.1), "limb": viewer.Sphere(0.1)}
PUSH = np.tile([0.0, 0.0, 10.0], (3, 1))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (add(t=None), "`t` and `q` must be given"),
        (add(t=()), "`t` must have a time at least"),
        (add(t=(0.0, 0.5, 0.5)), "`t` must rise from one to the next, found 0.5 and then 0.5"),
        (add(t=(0.0, np.nan, 1.0)), "`t` must be finite, found nan"),
        (add(t=(0.0, 1.0)), "`q` must have a row for each of the 2 times, found 3"),
        (add(t="now"), "`t` must be real numbers, found 'now'"),
        (add(q=STILL[:, :6]), "`q` must be of shape (n, 7), found (3, 6)"),
        (add(q=np.full((3, 7), np.inf)), "`q` must be finite, found inf"),
        (add(q=np.zeros((3, 7))), "`q` must have quaternions in its columns 4 to 7"),
        (add(v=np.zeros((2, 6))), "`v` must have a row for each of the 3 times, found 2"),
        (add(moving=DIVER.model), "`q` must be of shape (n, 28), found (3, 7)"),
        (add(shapes={"bodies": viewer.Sphere(0.1)}), "`shapes` names no body 'bodies'; there are body"),
        (add(shapes={"body": [0.1]}), "`shapes` must be shapes, found a float for 'body'"),
        (add(shapes={}), "`shapes` must have a shape for a body at least"),
        (add(color="red"), "`color` must be a color like '#cc6677', found 'red'"),
        (add(panel=1), "`panel` must be that of another motion or the next one, found 1"),
        (add(trails=("foot",)), "`trails` names no body 'foot'; there are body"),
        (
            add(trails=((1.0, 2.0, 3.0),)),
            "`trails` must be names, or names and points, found (1.0, 2.0, 3.0)",
        ),
        (add(trails=(("body", (1.0, 2.0)),)), "`trails` must be of shape (3,), found (2,)"),
        (
            add(contacts=("body", (0.0, 0.0, 0.0), PUSH)),
            "`contacts` must be names, points and forces, found 'body'",
        ),
        (
            add(contacts=(("body", PUSH),)),
            "`contacts` must be names, points and forces, found ('body', array(",
        ),
        (
            add(contacts=(("foot", (0.0, 0.0, 0.0), PUSH),)),
            "`contacts` names no body 'foot'; there are body",
        ),
        (add(contacts=(("body", 0.0, PUSH),)), "`contacts` must be of shape (3,), found ()"),
        (
            add(contacts=(("body", (0.0, 0.0, 0.0), PUSH[:2]),)),
            "`contacts` must have a row for each of the 3 times, found 2",
        ),
        (
            add(contacts=(("body", (0.0, 0.0, 0.0), PUSH[:, 2]),)),
            "`contacts` must be of shape (n, 3), found (3,)",
        ),
        (
            add(contacts=(("body", (0.0, 0.0, 0.0), np.nan * PUSH),)),
            "`contacts` must be finite, found nan",
        ),
        (lambda: viewer.Scene().html(), "the scene must have a motion"),
        (lambda: viewer.Scene().ground(np.nan), "`height` must be finite, found nan"),
        (lambda: viewer.Scene().water("deep"), "`height` must be real numbers, found 'deep'"),  # type: ignore[arg-type]
        (lambda: viewer.Scene().box((0, 0, 0), (1, -1, 1)), "`lengths` must be positive, found -1"),
        (lambda: viewer.Scene().platform(width=0.0), "`width` must be positive, found 0"),
        (lambda: viewer.Scene().fixed("box"), "`shape` must be a shape, found a str"),  # type: ignore[arg-type]
        (lambda: viewer.Scene().camera("back"), "`view` must be one of 'corner', 'side'"),  # type: ignore[arg-type]
        (lambda: viewer.Scene().play(3.0), "`speed` must be one of 0.01, "),
        (lambda: viewer.Scene().play(arrows=("force",)), "`arrows` must be one of "),  # type: ignore[arg-type]
        (lambda: viewer.Scene().caption(np.inf, "end"), "`t` must be finite, found inf"),
        (lambda: viewer.Sphere(0.0), "`radius` must be positive, found 0"),
        (lambda: viewer.Box((1, 2)), "`lengths` must be of shape (3,), found (2,)"),
        (lambda: viewer.Capsule((0, 0, 0), (0, 0, 0), 0.1), "`start` and `end` must be apart"),
        (lambda: viewer.Capsule((0, 0, 0), (0, 0, 1), 2.0, 0.5), "must differ by less than the length"),
        (lambda: viewer.Cylinder((0, 0, 0), (0, 0, 1), -1.0), "`radius` must not be negative, found -1"),
        (lambda: viewer.Ellipsoid((1, 1, 1), orientation=(0, 0, 0, 0)), "`orientation` must be a rotation"),
        (lambda: viewer.Loft([(0, 0, 0, 1, 1)]), "`stations` must be two rows or more with z rising"),
        (lambda: viewer.Loft([(0, 0, 0, 1, 1), (1, 0, 0, -1, 1)]), "`stations` must have half widths"),
    ],
)
def test_what_does_not_fit_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    assert message in str(caught.value)
    assert isinstance(caught.value, InputError) and isinstance(caught.value, ValueError)


def test_times_beside_a_solution_and_nameless_shapes_of_several_are_refused(
    tumble: somersault.Solution,
) -> None:
    with pytest.raises(InputError, match="must not be given beside a Solution, which has them"):
        viewer.Scene().add(tumble, TIMES)
    with pytest.raises(InputError, match="must be a mapping from the names of bodies"):
        viewer.Scene().add(DIVER.model, [0.0], [DIVER.configuration("A")], shapes=viewer.Sphere(0.1))


def test_a_centre_of_mass_in_flight_does_not_waver_between_samples(dive: multibody.TreeSolution) -> None:
    rare = slice(None, None, 5)
    step = dive.t[5] - dive.t[0]
    page = data(viewer.Scene("Rare").add(dive.model, dive.t[rare], dive.q[rare]))["motions"][0]
    t, center = unpacked(page["times"]).astype(float), unpacked(page["center"], 3)
    assert len(t) > len(dive.t[rare])
    whole = np.asarray(dive.model.center_of_mass(dive.q))
    path = np.column_stack([np.interp(t, dive.t, axis) for axis in whole.T])
    # A chord of the parabola is nowhere farther from it than g h²/8; single precision rounds at 10 m.
    assert np.abs(center - path).max() < 9.81 * step**2 / 8 + 2e-6
