"""The viewer takes every result of the library with one call and no further argument, or says what to add."""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from public_names import things

import somersault
from somersault import batch, contact, exact, forces, ftla, motion, multibody, ocp, viewer
from somersault.errors import InputError
from somersault.viewer import film
from somersault.viewer.results import INSTEAD, MOTIONS

HERE = Path(__file__).parent
BODY = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
START = somersault.State(position=(0.0, 0.0, 2.0), angular_velocity=(0.0, 5.0, 0.1))
DIVER = multibody.diver_planar()
MARKERS = motion.MarkerSet.joint_centres(DIVER.model)
TIMES = np.linspace(0.0, 1.0, 12)
FOLD = DIVER.configuration("A") + np.sin(np.pi * TIMES[:, None]) ** 2 * (
    DIVER.configuration("H") - DIVER.configuration("A")
)
FALL = FOLD - 5.0 * TIMES[:, None] * np.eye(FOLD.shape[1])[2]
LAW = contact.CompliantLaw.from_restitution(1.0, 1e4, 0.5)
FRICTION = contact.CoulombFriction(0.4, 1e4, 50.0)
BOX = (0.2, 0.3, 0.4)


def seen() -> motion.MarkerRecording:
    """Markers of a diver, of which one hides for a while."""
    whole = motion.place_markers(MARKERS, TIMES, FOLD)
    present = np.ones(whole.present.shape, dtype=bool)
    present[4:8, 0] = False
    return motion.MarkerRecording(whole.names, TIMES, whole.points, present)


def pictured(n_dims: int) -> motion.KeypointRecording:
    """Key points of the same diver, of whom one was not found for a while."""
    whole = seen()
    points = np.nan_to_num(whole.points)
    points = points if n_dims == 3 else 400.0 - 100.0 * points[:, :, [0, 2]]
    return motion.KeypointRecording(whole.names, TIMES, points, whole.present.astype(float))


def reread(ending: str, write: Callable[..., None], folder: Path) -> Any:
    write(folder / f"markers.{ending}", seen())
    return motion.read_file(folder / f"markers.{ending}")


def run(system: contact.ContactSystem, end: float, **options: Any) -> somersault.Solution:
    return somersault.integrate(
        system.body,
        system.state,
        (0.0, end),
        dt=1e-3,
        forces=system.forces,
        contacts=system.contacts,
        **options,
    )


def on(surface: Any, **options: Any) -> somersault.Solution:
    """A ball of 10 cm that falls to a surface."""
    ball = somersault.RigidBody.sphere(1.0, 0.1)
    touching = contact.Contact.ball((0.0, 0.0, 0.0), 0.1, surface, LAW)
    start = somersault.State(position=(0.05, 0.0, 0.4))
    return somersault.integrate(
        ball, start, (0.0, 0.4), dt=1e-3, forces=forces.Gravity(), contacts=touching, **options
    )


def hill(point: np.ndarray) -> tuple[float, np.ndarray]:
    span = point - np.array([0.0, 0.0, -2.0])
    size = float(np.linalg.norm(span))
    return size - 2.0, span / size


def two() -> somersault.Solution:
    """Two balls, one of which falls on the other."""
    ball = somersault.RigidBody.sphere(1.0, 0.1)
    starts = [somersault.State(position=(0.0, 0.0, z)) for z in (0.1, 0.5)]
    floor = contact.Contact.ball((0.0, 0.0, 0.0), 0.1, contact.HalfSpace(), LAW)
    return somersault.integrate(
        [ball, ball],
        starts,
        (0.0, 0.3),
        dt=1e-3,
        forces=[forces.Gravity(), forces.Gravity()],
        contacts=[[floor], []],
        pairs=contact.SpherePair((0, 1), (0.1, 0.1), LAW),
    )


def swing() -> ocp.MotionProblem:
    rest: Any = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
    phase = ocp.Phase(ocp.SplineMotion(1, 8, rest), 1.0, 40)
    up = ocp.Cost(ocp.displacement([0.0, 2.0], [1]), 1e4, at="finish")
    effort = ocp.Cost(ocp.entries("torque", [0]))
    return ocp.MotionProblem(
        multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], costs=[effort, up]
    )


def block(start: float = 0.0, name: str = "block") -> ocp.ControlProblem:
    link = multibody.Link(name, joint="prismatic", axis=(1, 0, 0), body=BODY)
    model = somersault.Model([link], gravity=(0, 0, 0))
    ends = {"initial": [start, 0], "final": [start + 1.0, 0]}
    return ocp.ControlProblem(model, **ends, running_cost=lambda x, u: 0.5 * u[0] ** 2)


def flung() -> multibody.TreeSolution:
    arm = multibody.two_link_arm()
    return multibody.integrate_tree(arm, (0.0, 0.5), (1.0, -2.0), (0.0, 1.0), dt=0.01)


def flight() -> multibody.TreeSolution:
    fold = FOLD[6, 3:] - FOLD[0, 3:]
    return multibody.fly(
        DIVER.model,
        FOLD[0],
        np.eye(12)[2] * 4.0,
        lambda t: (FOLD[0, 3:] + t * fold, fold),
        (0.0, 0.5),
        dt=0.01,
    )


@pytest.fixture(scope="module")
def dive() -> ocp.DiveSolution:
    return ocp.dive_107b().solve()


@pytest.fixture(scope="module")
def arm() -> ftla.ContinuationResult:
    return ftla.solve_arm([-np.pi / 2, 0.05, 0.0, 0.0], [np.pi / 2, 0.05, 0.0, 0.0], 10.0)


#: Of each public class that holds a motion, or of each way to make one, what is added.
SHOWN: dict[str, Callable[[pytest.FixtureRequest, Path], Any]] = {
    "Solution": lambda _, __: somersault.integrate(BODY, START, (0.0, 1.0), dt=0.05),
    "Solution, not located": lambda _, __: run(contact.bouncing_ball(1.0, 0.1, LAW, 0.3), 0.4, locate=False),
    "Solution of a ball": lambda _, __: run(contact.bouncing_ball(1.0, 0.1, LAW, 0.3), 0.4),
    "Solution of a top": lambda _, __: run(contact.spinning_top(), 0.1),
    "Solution of a box": lambda _, __: run(contact.falling_box(1.0, BOX, LAW, 0.5, friction=FRICTION), 0.4),
    "Solution of a block on a slope": lambda _, __: run(
        contact.sliding_block(1.0, BOX, LAW, FRICTION, 0.5, 0.3), 0.2
    ),
    "Solution of a disk": lambda _, __: run(contact.rolling_disk(1.0, 0.2, LAW, FRICTION, 0.4, 2.0), 0.3),
    "Solution of two balls": lambda _, __: two(),
    "Solution on a ball": lambda _, __: on(contact.SphericalSurface((0.0, 0.0, -1.0), 1.0)),
    "Solution in a bowl": lambda _, __: on(contact.SphericalSurface((0.0, 0.0, 1.0), 1.0, "outside")),
    "Solution on a log": lambda _, __: on(contact.CylindricalSurface((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 1.0)),
    "Solution on a function": lambda _, __: on(hill),
    "Trajectory": lambda _, __: exact.FreeBody(BODY, START)(TIMES),
    "Trajectory of a batch": lambda _, __: batch.integrate_batch(BODY, [START] * 3, (0.0, 0.1), 0.01),
    "DenseOutput": lambda _, __: somersault.integrate(BODY, START, (0.0, 1.0), dense_output=True).sol,
    "ContactSystem": lambda _, __: contact.rolling_disk(1.0, 0.2, LAW, FRICTION, 0.4, 2.0),
    "TreeSolution": lambda _, __: flung(),
    "TreeSolution of a flight": lambda _, __: flight(),
    "Motion": lambda _, __: swing().motion(np.full(4, 0.3)),
    "Motion of a swing-up": lambda _, __: ocp.CartPendulumProblem().motion(np.full(5, 10.0)),
    "Report": lambda _, __: swing().solve(np.full(4, 0.3)),
    "Report of a swing-up": lambda _, __: ocp.CartPendulumProblem().solve(),
    "SearchResult": lambda _, __: swing().search(2, z=np.full(4, 0.3), reach=0.1),
    "SearchResult of a block": lambda _, __: block().search(2),
    "DiveSolution": lambda request, _: request.getfixturevalue("dive"),
    "LiteralDive": lambda request, _: request.getfixturevalue("dive").literal(100),
    "CollocationResult": lambda _, __: block().solve(),
    "MultiphaseResult": lambda _, __: ocp.MultiphaseProblem([block(0.0), block(1.0)]).solve(),
    "Extremal": lambda request, _: request.getfixturevalue("arm").extremal,
    "ContinuationResult": lambda request, _: request.getfixturevalue("arm"),
    "ArmExtremal": lambda request, _: ftla.ArmExtremal(
        np.pi, 0, 0.3, request.getfixturevalue("arm").extremal
    ),
    "KeypointRecording of a picture": lambda _, __: pictured(2),
    "KeypointRecording in space": lambda _, __: pictured(3),
    "MarkerRecording": lambda _, __: seen(),
    "MarkerRecording of a C3D": lambda _, folder: reread("c3d", motion.write_c3d, folder),
    "MarkerRecording of a TRC": lambda _, folder: reread("trc", motion.write_trc, folder),
    "MarkerRecording of a CSV": lambda _, folder: reread("csv", motion.write_csv, folder),
    "SkeletonRecording": lambda _, __: motion.read_bvh(HERE / "motions" / "bvhio.bvh", unit="cm"),
    "MotionFit": lambda _, __: motion.MarkerFit(MARKERS).fit(seen()),
    "ScaledModel": lambda _, __: motion.scale_model(MARKERS, seen(), noise=0.01, max_frames=5),
    "SmoothedMotion": lambda _, __: motion.smooth_motion(MARKERS, seen(), noise=0.01),
    "ReconstructedFlight": lambda _, __: motion.reconstruct_flight(MARKERS, seen(), noise=0.01),
    "WhatIf": lambda _, __: motion.what_if(
        motion.reconstruct_flight(MARKERS, seen(), noise=0.01), momentum=0.1
    ),
    "FlightAnalysis": lambda _, __: motion.analyse(seen(), MARKERS, noise=0.01, optimum=False),
    "SyntheticDive": lambda _, __: motion.SyntheticFlight(DIVER.model, TIMES, FALL).perturb(
        motion.Perturbation(looseness=0.1)
    ),
}

#: With `t`, or with `t` and `q`.
ARGUMENTS = {"Model", "Robot", "RigidBody", "FreeBody", "Gyrostat"}

#: Classes that are no results, or hold no motion of bodies.
WITHOUT = {
    "Advice",
    "AerodynamicDrag",
    "AwardTable",
    "Band",
    "Baseline",
    "Box",
    "Capsule",
    "CentralGravity",
    "Chain",
    "CompliantLaw",
    "Constraint",
    "Contact",
    "ControlMomentGyros",
    "ControlProblem",
    "Convergence",
    "Correlation",
    "Cost",
    "CoulombFriction",
    "Cylinder",
    "CylindricalSurface",
    "Diagnosis",
    "DiveFaults",
    "Drag",
    "EigenpostureBase",
    "Ellipsoid",
    "EnergyStudy",
    "ExamReport",
    "ExamScene",
    "ExponentConvergence",
    "ExternalFunction",
    "Failure",
    "FlightAdvice",
    "FlightPhase",
    "FlightReport",
    "Following",
    "Force",
    "ForceModel",
    "FtleField",
    "Function",
    "Geometry",
    "Gravitation",
    "Gravity",
    "GravityGradient",
    "GroupComparison",
    "HalfSpace",
    "HuntCrossley",
    "InertiaEstimate",
    "Link",
    "LinkContact",
    "LinkPair",
    "Loft",
    "LyapunovSpectrum",
    "MagneticDipole",
    "MarkerSet",
    "Matching",
    "Mesh",
    "MethodInfo",
    "MethodTable",
    "MinimizeResult",
    "MultiphaseProblem",
    "Orbit",
    "Pca",
    "Perturbation",
    "Phase",
    "Placement",
    "Plate",
    "Platform",
    "PolishResult",
    "Problem",
    "Projection",
    "ReactionWheels",
    "RegularisedFriction",
    "Repair",
    "Resistance",
    "Ridge",
    "Scene",
    "SceneContact",
    "SceneGuard",
    "SceneHinge",
    "SceneMode",
    "SceneResult",
    "ScheduledTorque",
    "Score",
    "ScoringModel",
    "ScoringOptions",
    "Shape",
    "Skeleton",
    "SkeletonJoint",
    "SolarPressure",
    "SolutionSensitivity",
    "Spectrum",
    "Sphere",
    "SpherePair",
    "SphericalSurface",
    "SplineMotion",
    "Splitting",
    "Spring",
    "StabilityRegion",
    "Stepper",
    "Subspace",
    "Surface",
    "SurfaceFunction",
    "Sweep",
    "SyntheticJudge",
    "System",
    "Term",
    "Torque",
    "TorqueProfile",
    "TracedForce",
    "Transition",
    "TreeOnPlatforms",
    "Validation",
    "VariationalFlow",
    "WorkPrecision",
}

in_browser = pytest.mark.skipif(
    film.browser() is None, reason=f"no browser: none of {', '.join(film.BROWSERS)} is installed"
)


def test_every_public_class_is_drawn_or_known_to_hold_no_motion() -> None:
    classes = {
        thing.__name__
        for thing in things().values()
        if isinstance(thing, type) and not issubclass(thing, BaseException)
    }
    shown = {name.replace(",", "").split()[0] for name in SHOWN}
    refused = {kind.__name__ for kind in INSTEAD} - {"list"}
    for one, other in ((shown, refused), (shown, WITHOUT), (refused, WITHOUT), (ARGUMENTS, shown)):
        assert not one & other
    known = shown | refused | ARGUMENTS | WITHOUT
    assert classes - known == set(), "say in somersault.viewer.results how they are drawn, and show them here"
    assert {kind.__name__ for kind in MOTIONS} <= shown
    assert shown | refused <= classes


@pytest.mark.parametrize(
    ("moving", "instead"),
    [
        (ocp.dive_107b(), "a Dive does not: add what its `solve` returns"),
        (
            ocp.dive_107b().solve(max_iterations=1).report,
            "this Report does not: add the result that it is of",
        ),
        (START, "a State does not: add a Trajectory of it and its body"),
        ([], "a list does not: add each of its entries"),
        (
            "diver",
            "must be a Model, a Robot, a RigidBody, a recording or a result that holds a motion, found a str",
        ),
    ],
)
def test_what_holds_no_motion_says_what_to_add(moving: Any, instead: str) -> None:
    with pytest.raises(TypeError, match="`moving` must") as caught:
        viewer.Scene().add(moving)
    assert instead in str(caught.value)


def data(scene: viewer.Scene) -> dict[str, Any]:
    found = re.search(r"const SCENE = (\{.*\});\n", scene.html())
    assert found is not None
    return json.loads(found[1])  # type: ignore[no-any-return]


def unpacked(text: str, *shape: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(-1, *shape)


def test_a_contact_run_brings_its_ground_and_its_forces() -> None:
    ball = run(contact.bouncing_ball(1.0, 0.1, LAW, 0.3), 0.4)
    page = data(viewer.Scene().add(ball))
    assert page["ground"] == 0.0 and page["force"] == "normal force"
    (sent,) = page["motions"][0]["force"]
    t, force = unpacked(sent["times"]), unpacked(sent["forces"], 3)
    touching = t[force[:, 2] > 0.0]
    (down, up) = (event.t for event in ball.events[:2])
    assert touching[0] == pytest.approx(down, abs=1e-6) and touching[-1] <= up + 1e-6
    # Its lowest point touches, and not its centre.
    np.testing.assert_allclose(unpacked(sent["offsets"], 3), [[0.0, 0.0, -0.1]] * len(t), atol=1e-7)
    given = data(viewer.Scene().ground(-1.0).add(ball, contacts=()))
    assert given["ground"] == -1.0 and "force" not in given["motions"][0]


@pytest.mark.parametrize("name", ["ball", "bowl", "function", "log"])
def test_surfaces_that_are_not_level_stand_in_the_scene(
    name: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    key = next(key for key in SHOWN if re.fullmatch(rf"Solution (on|in) an? {name}", key))
    page = data(viewer.Scene().add(SHOWN[key](request, tmp_path)))
    assert page["ground"] is None
    (shape,) = page["fixed"]
    if "vertices" in shape:
        corners = unpacked(shape["vertices"], 3)
        lowest = np.abs(corners[:, :2]).sum(axis=1).argmin()
        assert corners[lowest, 2] == pytest.approx(0.0, abs=0.02)


def test_contacts_come_back_from_a_file(tmp_path: Path) -> None:
    top = run(contact.spinning_top(), 0.05)
    somersault.save(tmp_path / "top.som", top)
    again = somersault.load(tmp_path / "top.som")
    assert repr(again.contacts) == repr(top.contacts) and again.pairs == ()
    assert data(viewer.Scene().add(again)) == data(viewer.Scene().add(top))
    somersault.save(tmp_path / "hill.som", on(hill))
    assert somersault.load(tmp_path / "hill.som").contacts is None
    assert len(two().contacts) == 2 and len(two().pairs) == 1


def test_a_report_has_its_motion_and_keeps_it_in_a_file(tmp_path: Path) -> None:
    problem = swing()
    report = problem.solve(np.full(problem.n_variables, 0.3))
    np.testing.assert_array_equal(report.motion.q, problem.motion(report.z).q)
    somersault.save(tmp_path / "report.som", report)
    again = somersault.load(tmp_path / "report.som")
    np.testing.assert_array_equal(again.motion.q, report.motion.q)
    assert again.confirmed == report.confirmed


def test_two_balls_push_each_other_apart() -> None:
    balls = two()
    sent = data(viewer.Scene().add(balls))["motions"][0]
    floor, lower, upper = ([unpacked(at["times"]), unpacked(at["forces"], 3)] for at in sent["force"])
    np.testing.assert_array_equal(lower[0], upper[0])
    np.testing.assert_allclose(lower[1], -upper[1])
    pressed = upper[0][upper[1][:, 2] > 0.0]
    assert pressed[0] == pytest.approx(balls.events[1].t, abs=1e-6) and floor[1].any()
    # Both are drawn as the balls that touch, and the force acts half way between them.
    assert [shape["position"] for shape in sent["shapes"]] == [[0.0, 0.0, 0.0]] * 2
    below, above = (unpacked(at["offsets"], 3)[upper[1][:, 2] > 0.0] for at in sent["force"][1:])
    np.testing.assert_array_equal(below, -above)
    np.testing.assert_allclose(above[0], [0.0, 0.0, -0.1], atol=1e-6)


def test_a_robot_is_drawn_by_the_solids_of_its_file() -> None:
    robot = multibody.Robot.from_urdf(
        """<robot name="arm">
          <link name="base"><visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
          <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/></joint>
          <link name="rod">
            <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
            <visual><origin xyz="0 0 0.5" rpy="0 1.5707963 0"/>
              <geometry><cylinder radius="0.05" length="1"/></geometry></visual>
            <visual><geometry><mesh filename="rod.stl"/></geometry></visual>
            <collision><geometry><sphere radius="9"/></geometry></collision>
          </link>
        </robot>"""
    )
    page = data(viewer.Scene().add(robot, [0.0, 1.0], [[0.0], [1.0]]))
    shapes = page["motions"][0]["shapes"] + page["fixed"]
    assert len(shapes) == 2 and {"lengths", "rings"} <= {key for shape in shapes for key in shape}
    rod = next(shape for shape in shapes if "rings" in shape)
    np.testing.assert_allclose(rod["position"], [-0.5, 0.0, 0.5], atol=1e-6)
    with pytest.raises(InputError, match="`t` and `q` must be given beside"):
        viewer.Scene().add(robot)


def test_a_fit_is_drawn_in_the_size_that_was_found() -> None:
    large = motion.place_markers(MARKERS, TIMES, FOLD, scale=1.2)
    found = motion.MarkerFit(MARKERS).fit(large)
    drawn, plain = (
        data(viewer.Scene().add(*what))["radius"] for what in ((found,), (DIVER.model, TIMES, FOLD))
    )
    assert drawn == pytest.approx(1.2 * plain, rel=0.03)


def test_phases_of_several_trees_are_added_one_by_one() -> None:
    found = ocp.MultiphaseProblem([block(), block(1.0, "it")]).solve()
    with pytest.raises(TypeError, match="add one of its `phases`"):
        viewer.Scene().add(found)
    scene = viewer.Scene()
    for phase in found.phases:
        scene.add(phase)
    assert scene.interval == pytest.approx((0.0, 2.0))


def test_systems_that_are_no_trees_cannot_be_drawn() -> None:
    regulator = ftla.linear_regulator()
    assert regulator.model is None and ftla.arm().model == multibody.two_link_arm()


#: Shows each page in turn, draws it at its start and its middle, and keeps what it found.
_GALLERY = """<!doctype html><meta charset="utf-8"><body><pre id="found"></pre><script>
const PAGES = %s, found = [];
function next() {
  if (found.length === PAGES.length) {
    document.getElementById("found").textContent = JSON.stringify(found);
    return;
  }
  const frame = document.createElement("iframe");
  frame.style = "width: %dpx; height: 720px; border: 0";
  frame.srcdoc = PAGES[found.length];
  frame.onload = () => {
    const inside = frame.contentWindow, root = inside.document.documentElement, { player } = inside;
    const all = [...root.querySelectorAll("button, select, input[type=range]")];
    const controls = all.filter(control => control.offsetParent);
    found.push(player ? {
      wide: root.scrollWidth, high: Math.min(...controls.map(control => control.offsetHeight)),
      stage: root.querySelector("#stage").clientHeight,
      pictures: [0, 0.5].map(part => player.picture(part * player.scene.end, 160, 120)),
    } : { failed: root.textContent });
    frame.remove();
    next();
  };
  document.body.append(frame);
}
next();
</script></body>"""


@pytest.fixture(scope="module")
def drawn(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a telephone shows of each result, all in one run of the browser."""
    folder = tmp_path_factory.mktemp("gallery")
    pages = [viewer.Scene(name).add(make(request, folder)).html() for name, make in SHOWN.items()]
    page = folder / "gallery.html"
    listed = json.dumps(pages).replace("<", "\\u003c")
    page.write_text(_GALLERY % (listed, 390), encoding="utf-8")
    ran = film.headless(page.as_uri(), "--dump-dom", "--window-size=400,800", "--virtual-time-budget=60000")
    assert "CONSOLE" not in ran.stderr, ran.stderr
    found = re.search(r'<pre id="found">(.+?)</pre>', ran.stdout, re.DOTALL)
    assert found is not None, ran.stderr
    return dict(zip(SHOWN, json.loads(unescape(found[1])), strict=True))


@in_browser
@pytest.mark.parametrize("name", SHOWN)
def test_every_result_is_a_page_without_a_script_error(name: str, drawn: dict[str, Any]) -> None:
    image = pytest.importorskip("PIL.Image")
    found = drawn[name]
    assert "failed" not in found, found
    # Nothing is cut off on a telephone, and what is pressed is large enough.
    assert found["wide"] <= 390 and found["high"] >= 30 and found["stage"] >= 420
    for picture in found["pictures"]:
        pixels = np.asarray(
            image.open(io.BytesIO(base64.b64decode(picture.partition(",")[2]))).convert("RGB")
        )
        # The sky has one color along a row, and what stands before it another.
        away = np.abs(pixels.astype(int) - np.median(pixels, axis=1, keepdims=True)).max(axis=2)
        assert np.count_nonzero(away > 40) >= 10, "nothing but sky"
    if name != "ContactSystem":
        assert found["pictures"][0] != found["pictures"][1]
