"""Models and solutions in files."""

import json
import os
import pickle
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import somersault
from somersault import contact, exact, forces, multibody, studies
from somersault.errors import InputError, ReadError, WriteError


def same(one: Any, other: Any) -> bool:
    """Whether two things have the same parts, by what pickles of them are made of."""
    return pickle.dumps(one) == pickle.dumps(other)


def test_everything_that_can_be_pickled_can_be_saved(
    tmp_path: Path,
    body: somersault.RigidBody,
    state: somersault.State,
    tumble: somersault.Solution,
    dive: multibody.TreeSolution,
) -> None:
    top = contact.spinning_top()
    run = somersault.integrate(
        top.body, top.state, (0.0, 0.02), dt=1e-3, forces=top.forces, contacts=top.contacts
    )
    assert run.events
    things = [
        body,
        state,
        tumble,
        dive,
        run,
        run.events[0],
        multibody.two_link_arm(),
        multibody.diver_spatial(),
        multibody.diver_spatial().model.links[3],
        contact.CompliantLaw(1e4, 3.0),
        contact.CoulombFriction(0.3, 1e4, 2.0),
        exact.FreeBody(body, state),
        exact.Gyrostat(body, (0.1, 0.2, 0.3), state),
        somersault.methods()["rkmk"],
        somersault.batch.integrate_batch([body, body], [state, state], (0.0, 0.1), 0.01),
    ]
    for thing in things:
        somersault.save(tmp_path / "thing", thing)
        assert same(thing, somersault.load(tmp_path / "thing")), thing


def test_what_acts_on_bodies_can_be_saved(tmp_path: Path) -> None:
    law, slides, rolls = (
        contact.CompliantLaw(1e4, 3.0),
        contact.CoulombFriction(0.3, 1e4, 2.0),
        contact.CoulombFriction(0.3, 0.0, 50.0),
    )
    resistance = contact.Resistance(1e-3, 2e-3, 0.1)
    # Directions that are not of length 1, so that the digits of what was given are seen to survive.
    surfaces = [
        contact.HalfSpace((0.1, 0.2, 0.3), (1.0, 2.0, 3.0)),
        contact.SphericalSurface((0.1, 0.2, 0.3), 2.0, "outside"),
        contact.CylindricalSurface((0.1, 0.2, 0.3), (1.0, 2.0, 3.0), 0.5),
    ]
    orbit, plate = (
        forces.Orbit(7e6, 0.1, 0.2, 0.3, 0.4, 0.5),
        forces.Plate(2.0, (0, 0, 1), (0.1, 0.2, 0.3), 0.2, 0.3),
    )
    bus = somersault.RigidBody(12.0, (0.3, 0.2, 0.4))
    things = [
        forces.Gravity((0.0, -9.0, 0.1)),
        forces.Spring(3.0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), damping=0.2, rest_length=0.7),
        forces.Drag(0.1, 0.2, 0.3),
        forces.Torque((1.0, 2.0, 3.0), "body"),
        forces.ScheduledTorque([0.0, 1.5], [(1.0, 2.0, 3.0), (0.0, 0.1, 0.2)], "body"),
        forces.CentralGravity(2.0, (1.0, 2.0, 3.0)),
        forces.Force((1.0, 2.0, 3.0), (0.1, 0.2, 0.3)),
        forces.Gravitation(2.0),
        orbit,
        forces.GravityGradient(orbit),
        forces.MagneticDipole((1.0, 2.0, 3.0), (0.1, 0.2, 0.3)),
        forces.MagneticDipole((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), orbit),
        plate,
        forces.AerodynamicDrag(orbit, [plate, plate], 1e-12),
        forces.SolarPressure((0.0, 0.0, 1.0), plate),
        forces.ReactionWheels(np.eye(3), 0.01, 0.3, [[0.1, 0.2, 0.3], [0.0, 0.1, 0.0]], [0.5, 2.0], body=bus),
        forces.ControlMomentGyros([(0, 0, 1)], [(1, 0, 0)], 0.5, 0.1, 0.2),
        *surfaces,
        *(contact.Contact((0.0, 0.1, 0.2), surface, law, friction=slides) for surface in surfaces),
        contact.Contact.ball((0.0, 0.1, 0.2), 0.3, surfaces[1], law, friction=rolls, resistance=resistance),
        contact.Contact.rim((0.0, 0.1, 0.2), (1.0, 1.0, 3.0), 0.3, surfaces[0], law, friction=rolls),
        contact.SpherePair((0, 2), (0.1, 0.2), law, centers=[(0, 0, 1), (0, 1, 0)], resistance=resistance),
        contact.SpherePair((0, 1), (0.1, 0.2), contact.HuntCrossley(1e4, 0.1)),
        contact.spinning_top(),
        contact.bouncing_ball(1.0, 0.2, law, 0.5),
        contact.rolling_disk(1.0, 0.2, law, rolls, 0.4, 2.0),
    ]
    for thing in things:
        somersault.save(tmp_path / "thing", thing)
        found = somersault.load(tmp_path / "thing")
        assert type(found) is type(thing) and same(thing, found), thing
        assert repr(found) == repr(thing)


def test_studies_can_be_saved(tmp_path: Path) -> None:
    problem = studies.Problem.case(2)
    found = [
        studies.stability_region("mp"),
        studies.energy("euler", studies.prisms(2)),
        studies.convergence(problem, "heun", [0.1, 0.05, 0.02]),
        studies.work_precision(problem, "rkmk", [0.1], repeats=1),
        studies.work_precision(problem, "rkmk5", tolerances=[1e-4], repeats=1),
    ]
    somersault.save(tmp_path / "studies", found)
    assert same(found, somersault.load(tmp_path / "studies"))


def test_a_saved_problem_is_the_problem(
    tmp_path: Path, body: somersault.RigidBody, state: somersault.State
) -> None:
    acting = [forces.Gravity(), forces.Torque((1.0, 2.0, 3.0), "body")]
    fine = somersault.integrate(body, state, (0.0, 0.3), dt=0.01, forces=acting)[-1]
    problems = [
        *(studies.Problem.case(number) for number in (1, 2, 3)),
        studies.Problem.asymmetric_body(),
        studies.Problem.spring_pendulum(),
        studies.Problem.damped_spring_pendulum(),
        studies.Problem(body, state, 0.3, reference=state),
        studies.Problem(body, state, 0.3, reference=fine, forces=acting),
    ]
    for problem in problems:
        somersault.save(tmp_path / "problem", problem)
        found = somersault.load(tmp_path / "problem")
        assert (found.body, found.state, found.t_end) == (problem.body, problem.state, problem.t_end)
        assert found.reference == problem.reference
        assert [repr(model) for model in found.forces] == [repr(model) for model in problem.forces]
        assert repr(found) == repr(problem) and same(found, problem)
        steps = [0.03, 0.015]
        assert same(*(studies.convergence(p, "rkmk", steps) for p in (problem, found)))


def test_sensitivities_can_be_saved(tmp_path: Path) -> None:
    top = contact.spinning_top()
    for parameters in ([], ["mass", ("law.stiffness", 0)]):
        run = contact.differentiate(
            top.body,
            top.state,
            (0.0, 0.05),
            dt=1e-4,
            forces=top.forces,
            contacts=top.contacts,
            parameters=parameters,
        )
        somersault.save(tmp_path / "run", run)
        found = somersault.load(tmp_path / "run")
        assert found.events and same(run, found) and repr(found) == repr(run)
        assert (found.t, found.state) == (run.t, run.state)
        for name in ("by_state", "by_parameters", "event_times", "stretches"):
            np.testing.assert_array_equal(getattr(found, name), getattr(run, name))
            assert getattr(found, name).shape == getattr(run, name).shape


def test_parts_that_do_not_fit_are_refused(tmp_path: Path, state: somersault.State) -> None:
    restore: Any = contact.Sensitivities._restore  # type: ignore[attr-defined]
    whole = (np.eye(12), np.zeros((12, 1)), np.zeros((0, 13)), np.zeros((1, 3)))
    assert restore(0.0, state, [], whole).by_parameters.shape == (12, 1)
    for i, name, wrong in (
        (0, "by_state", np.eye(11)),
        (1, "by_parameters", np.zeros((12, 2))),
        (2, "event_times", np.zeros((1, 13))),
        (3, "stretches", np.zeros((1, 2))),
    ):
        with pytest.raises(somersault.InputError, match=f"`{name}` must be real numbers of shape"):
            restore(0.0, state, [], (*whole[:i], wrong, *whole[i + 1 :]))
    # A file is checked as an argument is.
    somersault.save(tmp_path / "a", studies.Problem.case(1))
    with zipfile.ZipFile(tmp_path / "a") as file:
        content = json.loads(file.read("header.json"))["content"]
    content["arguments"][2] = -1.0
    rewritten(tmp_path / "a", content=content)
    with pytest.raises(ReadError, match="the Problem in it is not allowed: `t_end` must be"):
        somersault.load(tmp_path / "a")


def test_curves_are_refused_and_what_to_save_is_said(
    tmp_path: Path, body: somersault.RigidBody, state: somersault.State
) -> None:
    run = somersault.integrate(body, state, (0.0, 0.1), dt=0.01, dense_output=True)
    arm = multibody.two_link_arm()
    swing = multibody.integrate_tree(arm, [0.0, 0.3], [0.0, 0.0], (0.0, 0.1), dt=0.01, dense_output=True)
    for kind, curves, instead in (
        ("DenseOutput", run.sol, "take the Trajectory that it gives"),
        ("TreeDenseOutput", swing.sol, "take the arrays that it gives"),
    ):
        with pytest.raises(WriteError, match=rf"the value\['sol'\] is a .*{kind}.*: {instead}"):
            somersault.save(tmp_path / "a", {"sol": curves})
        with pytest.raises(TypeError, match=instead):
            pickle.dumps(curves)
    assert run.sol is not None and swing.sol is not None
    times = [0.0, 0.05, 0.1]
    somersault.save(tmp_path / "a", [run, run.sol(times), swing, swing.sol(times)])
    found = somersault.load(tmp_path / "a")
    assert found[0].sol is None and found[2].sol is None
    assert same(found[1], run.sol(times)) and same(found[3], swing.sol(times))


def test_a_run_of_what_was_saved_is_the_run(tmp_path: Path) -> None:
    for scene in (
        contact.spinning_top(),
        contact.rolling_disk(
            1.0, 0.2, contact.CompliantLaw(1e4, 3.0), contact.CoulombFriction(0.3, 0.0, 50.0), 0.4, 2.0
        ),
    ):
        somersault.save(tmp_path / "scene", scene)
        runs = [
            somersault.integrate(
                found.body, found.state, (0.0, 0.05), dt=1e-3, forces=found.forces, contacts=found.contacts
            )
            for found in (scene, somersault.load(tmp_path / "scene"))
        ]
        assert same(*runs)


def test_a_contact_with_a_surface_of_ones_own_is_pickled_by_its_name_and_not_written(tmp_path: Path) -> None:
    touching = contact.Contact((0.0, 0.0, 0.0), np.linalg.norm, contact.CompliantLaw(1e4))
    assert pickle.loads(pickle.dumps(touching)).surface is np.linalg.norm
    with pytest.raises(WriteError, match="cannot be written"):
        somersault.save(tmp_path / "a", touching)


def test_plain_values_come_back_as_they_were(tmp_path: Path) -> None:
    things = {
        "numbers": [1, 2.5, -0.0, float("inf"), True, None],
        "tuple": (1, ("a", "β")),
        "array": np.arange(4, dtype=np.int32).reshape(2, 2),
        "names": np.array(["a", "βγ"]),
        "by number": {1: "one", (2, 3): "two, three"},
        "$dollar": {"$array": 0},
        "rotation": Rotation.from_quat([0.0, 0.6, 0.0, 0.8]),
        "empty": np.zeros((0, 3)),
    }
    somersault.save(tmp_path / "a", things)
    found = somersault.load(tmp_path / "a")
    assert list(found) == list(things)
    for name in ("numbers", "tuple", "by number", "$dollar"):
        assert found[name] == things[name]
    assert str(found["numbers"][2]) == "-0.0"
    for name in ("array", "names", "empty"):
        assert found[name].dtype == things[name].dtype and (found[name] == things[name]).all()
    np.testing.assert_allclose(found["rotation"].as_quat(), things["rotation"].as_quat(), rtol=1e-15)


def test_equal_contents_are_equal_files_that_numpy_opens(tmp_path: Path, tumble: somersault.Solution) -> None:
    for name in "ab":
        somersault.save(tmp_path / name, tumble)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    with np.load(tmp_path / "a") as arrays:
        assert any(np.array_equal(arrays[key], tumble.quaternion) for key in arrays if key != "header.json")


def rewritten(path: Path, **changes: Any) -> None:
    """The same file with another header."""
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    members["header.json"] = json.dumps({**json.loads(members["header.json"]), **changes}).encode()
    with zipfile.ZipFile(path, "w") as file:
        for name, content in members.items():
            file.writestr(name, content)


def test_other_files_are_refused(tmp_path: Path, tumble: somersault.Solution) -> None:
    path = tmp_path / "a"
    with pytest.raises(FileNotFoundError):
        somersault.load(path)
    with pytest.raises(FileNotFoundError) as caught:
        somersault.save(tmp_path / "nowhere" / "a.som", tumble)
    assert str(caught.value).endswith(f"{str(tmp_path / 'nowhere' / 'a.som')!r}")
    path.write_text("t,x\n")
    with pytest.raises(ReadError, match="is not a somersault file"):
        somersault.load(path)
    somersault.save(path, tumble)
    whole = path.read_bytes()
    for cut in (len(whole) // 2, len(whole) - 10):
        path.write_bytes(whole[:cut])
        with pytest.raises(ReadError, match="corrupt"):
            somersault.load(path)
    flipped = bytearray(whole)
    flipped[whole.index(b"NUMPY") + 200] ^= 1
    path.write_bytes(flipped)
    with pytest.raises(ReadError, match="corrupt"):
        somersault.load(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "the header is not one of somersault"),
        ({"format_version": 2}, "written in format 2"),
        ({"content": {"$object": "os.system", "arguments": ["true"]}}, "'os.system' are not known"),
        ({"content": {"$object": "Model.from_urdf", "arguments": [""]}}, "are not known"),
        (
            {"content": {"$object": "RigidBody", "arguments": [-1.0, [1, 1, 1]]}},
            "RigidBody in it is not allowed",
        ),
        ({"content": {"$later": 1}}, r"\$later is not known to this version"),
        ({"content": {"$array": 99}}, "corrupt"),
    ],
)
def test_contents_that_are_not_allowed_are_refused(tmp_path: Path, changes: Any, message: str) -> None:
    somersault.save(tmp_path / "a", [1.0])
    rewritten(tmp_path / "a", **changes)
    with pytest.raises(ReadError, match=message):
        somersault.load(tmp_path / "a")


@pytest.mark.parametrize("path", [5, None, b"a", 1.5, {"a": 1}])
def test_paths_of_another_type_are_refused(path: Any) -> None:
    with pytest.raises(InputError, match="`path` must be a path, found"):
        somersault.load(path)
    with pytest.raises(InputError, match="`path` must be a path, found"):
        somersault.save(path, 1.0)


def test_damaged_files_are_refused_whatever_is_wrong_with_them(
    tmp_path: Path, tumble: somersault.Solution
) -> None:
    """300 files with bits turned, bytes overwritten, parts cut out or doubled: nothing but `ReadError`."""
    path = tmp_path / "a"
    somersault.save(path, {"run": tumble, "model": multibody.two_link_arm(), "text": "β", "table": np.eye(3)})
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(300):
        content = bytearray(whole)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(content)))
            match rng.integers(5):
                case 0:
                    content[at] ^= 1 << int(rng.integers(8))
                case 1:
                    content[at : at + 4] = rng.bytes(4)
                case 2:
                    del content[at : at + int(rng.integers(1, 200))]
                case 3:
                    content[at:at] = content[at : at + 50]
                case _:
                    # where archives keep their sizes and methods
                    at = max(0, len(content) - int(rng.integers(1, 400)))
                    content[at] = int(rng.integers(256))
        path.write_bytes(content)
        try:
            somersault.load(path)
        except ReadError as fault:
            assert str(path) in str(fault)
            refused += 1
    assert refused > 250


@pytest.mark.parametrize(
    "content",
    ["[" * 100_000 + "]" * 100_000, '{"$tuple": ' * 20_000 + "1" + "}" * 20_000, "1" * 10_000],
    ids=["lists", "tuples", "digits"],
)
def test_contents_too_deep_or_too_long_are_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a"
    text = f'{{"format": "somersault", "format_version": 1, "content": {content}}}'
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("header.json", text)
    with pytest.raises(ReadError, match="corrupt"):
        somersault.load(path)


def test_arrays_that_are_not_there_take_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "a"
    header = {"format": "somersault", "format_version": 1, "content": {"$array": 0}}
    array = (
        b"\x93NUMPY\x01\x00\x76\x00"
        + b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }".ljust(117)
    )
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        with zipfile.ZipFile(path, "w", method) as file:
            file.writestr("header.json", json.dumps(header))
            file.writestr("0.npy", array + b"\n")
        with pytest.raises(ReadError, match=r"has 0 bytes|is compressed"):
            somersault.load(path)


@pytest.mark.skipif(sys.platform == "win32", reason="links need a privilege there")
def test_links_keep_leading_to_the_file_that_is_replaced(tmp_path: Path) -> None:
    target, link, dangling = tmp_path / "folder" / "target", tmp_path / "link", tmp_path / "dangling"
    target.parent.mkdir()
    target.write_text("before")
    target.chmod(0o640)
    link.symlink_to(target)
    dangling.symlink_to(tmp_path / "folder" / "new")
    for path in (link, dangling):
        somersault.save(path, 1.0)
        assert path.is_symlink() and somersault.load(path) == 1.0
    assert target.is_file() and not target.is_symlink() and target.stat().st_mode & 0o777 == 0o640
    assert sorted(path.name for path in target.parent.iterdir()) == ["new", "target"]


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such files there")
def test_devices_and_folders_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/null")
    for path in (tmp_path / "pipe", tmp_path / "link", tmp_path, Path("/dev/null")):
        with pytest.raises(WriteError, match="is not a file that can be replaced"):
            somersault.save(path, 1.0)
    assert Path("/dev/null").is_char_device()


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(WriteError, match=r"the value\['a'\]\[1\] is a builtins.object"):
        somersault.save(tmp_path / "a", {"a": [1, object()]})
    with pytest.raises(WriteError, match="array of object"):
        somersault.save(tmp_path / "a", np.array([None]))
    assert not list(tmp_path.iterdir())


def test_fitted_scorers_and_recordings_come_back_as_they_were(tmp_path: Path) -> None:
    motion = pytest.importorskip("somersault.motion")
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 1.0, 30)
    path = np.stack([t, 0 * t, 3.0 - 4.9 * t**2], axis=1)
    motions = [motion.Performance(t, list("abcd"), rng.normal(size=(30, 4)), path) for _ in range(8)]
    scorer = motion.ScoringModel(motions, 5.0 + rng.normal(size=8))
    recording = motion.MarkerRecording(["a"], t, rng.normal(size=(30, 1, 3)))
    somersault.save(tmp_path / "both", [scorer, recording])
    learnt, recorded = somersault.load(tmp_path / "both")
    assert [learnt.score(m) for m in motions] == [scorer.score(m) for m in motions]
    assert (recorded.points == recording.points).all()


def test_a_file_is_written_from_bytes_alone(tmp_path: Path) -> None:
    for content in ("text", np.zeros(4)[::2], None):
        with pytest.raises(TypeError, match="`content` must be bytes, found"):
            somersault.storage.write_bytes(tmp_path / "a", content)  # type: ignore[arg-type]
    assert not (tmp_path / "a").exists()
