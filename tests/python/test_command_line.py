"""The command line: what it reads, writes and refuses."""

import csv
import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import somersault
from somersault.cli import main, positions
from somersault.cli.documents import DocumentError, read, schema

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def table(text: str) -> dict[str, list[str]]:
    """The columns of CSV."""
    rows = list(csv.reader(io.StringIO(text)))
    return dict(zip(rows[0], map(list, zip(*rows[1:], strict=True)), strict=True))


def test_the_examples_pass_their_schemas_and_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("satellite.toml", "ball.toml", "arm.json"):
        assert main(["integrate", str(EXAMPLES / name)]) == 0
        out, err = capsys.readouterr()
        columns = table(out)
        assert len(columns["t"]) > 10 and "steps" in err
    assert list(columns) == ["t", "q0", "q1", "v0", "v1"]


def test_a_page_plays_the_motion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("ball.toml", "arm.json"):
        page = tmp_path / f"{name}.html"
        out = ("--out", str(tmp_path / "curves.csv"))
        assert main(["integrate", str(EXAMPLES / name), *out, "--html", str(page)]) == 0
        assert "<html" in page.read_text("utf-8")
    assert main(["integrate", str(EXAMPLES / "ball.toml"), "--html", str(tmp_path / "a.gif")]) == 2
    assert "the name of a page must end in .html" in capsys.readouterr().err


def test_outputs_hold_the_same_numbers(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (extra `parquet`)")
    paths = [tmp_path / f"ball.{kind}" for kind in ("csv", "json", "parquet")]
    events, saved = tmp_path / "events.csv", tmp_path / "ball.som"
    for path in paths:
        arguments = ["--out", str(path), "--events", str(events), "--save", str(saved)]
        assert main(["integrate", str(EXAMPLES / "ball.toml"), *arguments]) == 0
    motion = somersault.load(saved)
    as_csv, as_json = table(paths[0].read_text()), json.loads(paths[1].read_text())
    as_parquet = pyarrow.read_table(paths[2]).to_pydict()
    assert list(as_csv) == list(as_json) == list(as_parquet)
    assert as_json == as_parquet
    assert [float(x) for x in as_csv["z"]] == as_json["z"] == motion.position[:, 2].tolist()
    kinds = [event.kind for event in motion.events]
    assert table(events.read_text())["kind"] == kinds and kinds[0] == "touch_down"


def test_a_dive_is_found_and_verified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, page = tmp_path / "dive.json", tmp_path / "dive.html"
    assert main(["dive", str(EXAMPLES / "dive.toml"), "--out", str(out), "--html", str(page)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["success"] and abs(summary["somersaults"] - 3.5) < 1e-6
    assert abs(summary["verified"]["somersaults"] - 3.5) < 1e-4
    curves = json.loads(out.read_text())
    assert curves["somersaults"][-1] == summary["somersaults"]
    assert "<html" in page.read_text("utf-8")


def test_motions_are_scored_with_their_cross_validation_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("somersault.motion", reason="recorded motions are not there")
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 1.4, 50)
    lines = ['motions = ["9.csv"]', "[read]", 'unit = "m"']
    for k in range(10):
        depth = rng.uniform(-1.0, 1.0)
        fold = np.exp(-(((t - 0.7) / 0.3) ** 2)) * (1.5 + 0.3 * depth)
        hip = np.stack([t, 0 * t, 3.0 - 4.9 * t**2], axis=1)
        knee = hip + 0.4 * np.stack([np.sin(fold), 0 * t, -np.cos(fold)], axis=1)
        head = hip + 0.6 * np.stack([np.sin(0.4 * fold), 0 * t, np.cos(0.4 * fold)], axis=1)
        names = ",".join(f"{marker}_{axis}" for marker in ("hip", "knee", "head") for axis in "xyz")
        rows = np.column_stack([t, hip, knee, head])
        np.savetxt(tmp_path / f"{k}.csv", rows, delimiter=",", header=f"time,{names}", comments="")
        if k < 9:
            lines += ["[[judged]]", f'file = "{k}.csv"', f"score = {7.0 + depth}"]
    document, scores, summary = (tmp_path / name for name in ("judged.toml", "scores.json", "summary.json"))
    document.write_text("\n".join(lines))
    arguments = ["--out", str(scores), "--summary", str(summary), "--save", str(tmp_path / "scorer.json")]
    assert main(["score", str(document), *arguments]) == 0
    worth, found = json.loads(summary.read_text()), json.loads(scores.read_text())
    assert worth["rms_error"] < 0.1 < min(worth["baselines"].values())
    assert abs(found["predicted"][-1] - (7.0 + depth)) < 0.2 and found["score"][-1] is None
    again = tmp_path / "again.toml"
    again.write_text('scorer = "scorer.json"\nmotions = ["9.csv"]\n[read]\nunit = "m"\n')
    assert main(["score", str(again), "--out", str(scores)]) == 0
    again_found = json.loads(scores.read_text())
    assert again_found["predicted"] == found["predicted"][-1:]
    assert again_found["distance"] == found["distance"][-1:] and found["distance"][-1] <= 1.0
    assert worth["learnt"]["names"] == ["hip", "knee", "head"] and worth["learnt"]["scale"] == [0.0, 10.0]

    # what a scorer, a list or a motion lacks or has twice is named with its line
    def refused(text: str, message: str) -> None:
        again.write_text(text)
        assert main(["score", str(again)]) == 2
        assert message in capsys.readouterr().err

    capsys.readouterr()
    refused('scorer = "scorer.json"\n', "needs exactly one of judged, scorer and motions; found scorer")
    refused('scorer = "scorer.json"\nmotions = []\n', "motions: must have at least 1 entries, found 0")
    twice = document.read_text().replace('file = "3.csv"', 'file = "./1.csv"')
    refused(twice, "judged.3.file: is the file of entry 1 too")
    refused(document.read_text() + "\n[options]\nscale = [7.0, 7.1]\n", "within the scale 7 to 7.1")
    once = document.read_text().replace('file = "3.csv"', 'file = "3.csv"\nathlete = "Ann"')
    refused(once, "judged.0: must have an `athlete`, as others have; give all or none")
    # three athletes, by ridge regression
    athletes = document.read_text()
    for k in range(9):
        athletes = athletes.replace(f'file = "{k}.csv"', f'file = "{k}.csv"\nathlete = "{k % 3}"')
    again.write_text(athletes + '\n[options]\nmethod = "ridge"\n')
    assert main(["score", str(again), "--out", str(scores), "--summary", str(summary)]) == 0
    worth = json.loads(summary.read_text())
    assert len(worth["penalties"]) == 9 and worth["n_components"] == [] and worth["r_squared"] > 0.5
    # in mm, lying on its side, and without a marker
    head, _, rows = (tmp_path / "9.csv").read_text().partition("\n")
    values = np.loadtxt(rows.splitlines(), delimiter=",")
    names = head.split(",")

    def scored(changed: Any, header: list[str] = names) -> tuple[int, str]:
        np.savetxt(tmp_path / "x.csv", changed, delimiter=",", header=",".join(header), comments="")
        again.write_text('scorer = "scorer.json"\nmotions = ["x.csv"]\n')
        return main(["score", str(again), "--out", str(scores)]), capsys.readouterr().err

    millimetres = values * np.array([1.0] + [1000.0] * 9)
    status, said = scored(millimetres)
    assert status == 2 and "is the unit right?" in said
    fallen = values.copy()
    fallen[:, [1, 3, 4, 6, 7, 9]] = values[:, [3, 1, 6, 4, 9, 7]]
    status, said = scored(fallen)
    assert status == 1 and "its score says nothing" in said
    status, said = scored(values, [name.replace("knee", "nose") for name in names])
    assert status == 2 and "must have knee" in said


def test_the_bench_times_methods(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "bench.csv"
    assert main(["bench", "rkmk_b", "rkmk8_b", "--repeats", "1", "--target", "1e-4", "--out", str(out)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert sorted(line.split()[0] for line in shown[1:]) == ["rkmk8_b", "rkmk_b"]
    runs = table(out.read_text())
    assert set(runs["method"]) == {"rkmk_b", "rkmk8_b"} and all(float(s) > 0 for s in runs["seconds"])


def test_methods_and_schemas_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["methods", "--json"]) == 0
    assert [row["name"] for row in json.loads(capsys.readouterr().out)] == somersault.methods().names
    for name in ("integrate", "dive", "score"):
        assert main(["schema", name]) == 0
        printed = json.loads(capsys.readouterr().out)
        assert printed == schema(name)
        Draft202012Validator.check_schema(printed)


BODY = "[body]\nmass = 1.0\nbox = [1, 1, 1]\n\n[run]\ninterval = [0, 1]\ndt = 0.1\n"


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("[body\n", 1, "expected ']'"),
        ('a = 1\nb = "\n', 2, "illegal character"),
        (BODY.replace("mass = 1.0", "mass = -1.0"), 2, "body.mass: -1.0 is less than or equal to"),
        (BODY.replace("mass = 1.0", 'mass = "1"'), 2, "body.mass: must be a number, found '1'"),
        (BODY.replace("box", "cube"), 3, "body.cube: is not known here; allowed are box, "),
        (BODY.replace("box", "#"), 1, "body: needs exactly one of box, .*; found none"),
        (BODY.replace("box = [1, 1, 1]", "box = [1, 1]"), 3, "body.box: must have 3 entries, found 2"),
        (BODY.replace("box = [1, 1, 1]", "box = [\n 1,\n 1,\n 'c']"), 6, "body.box.2: must be a number"),
        (BODY.replace("box = [1, 1, 1]", "inertia = [1, 1, 5]"), 3, "body.inertia: the largest"),
        (BODY.replace("dt = 0.1", ""), 5, "run: needs one of dt, rtol, atol; found none"),
        (BODY + 'method = "rk5"\n', 8, "run.method: no method is named `rk5`"),
        (BODY.replace("[0, 1]", "[0, nan]"), 6, "run.interval.1: must be a number, found nan"),
        (BODY.replace("[0, 1]", "[1, 1]"), 6, "run.interval: `interval` must lead from one finite time"),
        (BODY.replace("[0, 1]", f"[0, 1{'0' * 30}]"), 6, "run.interval.1: must be a number below 2.63"),
        (BODY.replace("[0, 1]", f"[0, 1{'0' * 5000}]"), 6, "a number of 5001 digits is too long"),
        (BODY.replace("dt = 0.1", "dt = 1e-30"), 7, "run.dt: "),
        (BODY + "rtol = inf\n", 8, "run.rtol: "),
        (BODY + "[tree]\nname = 'two_link_arm'\n", 1, "needs exactly one of body, tree; found body, tree"),
        (
            BODY + "[[forces]]\nkind = 'gravity'\n[[forces]]\nkind = 'wind'\n",
            11,
            "forces.1.kind: must be one of",
        ),
        (BODY + "[[forces]]\nkind = 'spring'\n", 8, "forces.0: 'stiffness' is a required property"),
        (BODY + "[[forces]]\nkind = 'gravity'\nstiffness = 1\n", 10, "forces.0.stiffness: is not known here"),
        (BODY + "[[forces]]\nkind = 'spring'\nstiffness = nan\n", 10, "forces.0.stiffness: must be a number"),
        (BODY + "[[forces]]\nkind = 'spring'\nstiffness = inf\n", 10, "forces.0.stiffness: "),
        (BODY + "[state]\nq = [1]\n", 9, "state.q: belongs to a tree"),
        (BODY + "[state]\nquaternion = [0, 0, 0, 0]\n", 9, "state.quaternion: "),
        (
            BODY + "[[contacts]]\npoint = [0, 0, 0]\nlaw = { stiffness = 1 }\n"
            "[contacts.surface]\nkind = 'sphere'\n",
            11,
            "contacts.0.surface: a sphere takes other values",
        ),
    ],
)
def test_errors_name_the_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, line: int, message: str
) -> None:
    path = tmp_path / "input.toml"
    path.write_text(text)
    assert main(["integrate", str(path)]) == 2
    shown = capsys.readouterr().err
    assert shown.startswith(f"somersault: {path}:{line}: "), shown
    with pytest.raises(somersault.InputError, match=message):
        raise somersault.InputError(shown)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('{"dive": "107b",\n"options":\n {"n_par": 2.5}}', 3),
        ('{"dive": "107b",\n}', 1),
        ('{\n"dive": 7}', 2),
        ('{"dive": "107b",\n"options":\n {\n"n_par": NaN}}', 4),
        ('{"dive": "107b",\n"options":\n {\n"n_par": -Infinity}}', 4),
        ('{"dive": "107b",\n"options":\n {\n"n_par": 1e999}}', 4),
        ('{"dive": "107b",\n"options":\n {"n_par": 8,\n"n_par": 9}}', 4),
        (f'{{"dive": "107b",\n"options":\n {{\n"n_par": {"9" * 5000}}}}}', 4),
    ],
)
def test_errors_in_json_name_the_line(tmp_path: Path, text: str, line: int) -> None:
    path = tmp_path / "input.json"
    path.write_text(text)
    with pytest.raises(DocumentError) as fault:
        read(path, "dive")
    found = int(str(fault.value).removeprefix(f"{path}:").split(":")[0])
    assert found in (line, line + 1)  # a comma before a brace is told on either line, by version of Python


def test_lines_are_found_whatever_a_document_is_written_like() -> None:
    text = '''# a comment with [brackets] and = signs
title = "a = [1, # no comment"
"quoted key".inner = 1.5e3
[a.b]
many = [
  1979-05-27T07:32:00Z, # with a comment ]
  { x = 1, "y" = [2,
    3] },
  """two
lines""", 'it''s' ]
[[a.c]]
z = 1
[[a.c]]
z = 2
[a.c.deep]
w = true
'''.replace("'it''s'", "'its'")
    found = positions.lines(text, toml=True)
    expected: dict[tuple[Any, ...], int] = {
        ("title",): 2,
        ("quoted key", "inner"): 3,
        ("a",): 4,
        ("a", "b", "many"): 5,
        ("a", "b", "many", 0): 6,
        ("a", "b", "many", 1, "x"): 7,
        ("a", "b", "many", 1, "y", 1): 8,
        ("a", "b", "many", 2): 9,
        ("a", "b", "many", 3): 10,
        ("a", "c", 0, "z"): 12,
        ("a", "c", 1, "z"): 14,
        ("a", "c", 1, "deep"): 15,
        ("a", "c", 1, "deep", "w"): 16,
    }
    assert {place: found.get(place) for place in expected} == expected
    as_json = '{"a":\n [1.5e-3,\n  {"b \\u00e9": {}, "c": "x, ]"}],\n "d": -1}'
    found = positions.lines(as_json, toml=False)
    assert found == {
        (): 1,
        ("a",): 1,
        ("a", 0): 2,
        ("a", 1): 3,
        ("a", 1, "b é"): 3,
        ("a", 1, "c"): 3,
        ("d",): 4,
    }


def test_what_a_failed_run_recorded_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "stiff.toml"
    path.write_text(
        BODY.replace("[0, 1]", "[0, 1e4]").replace("dt = 0.1", "dt = 1.0\nmethod = 'euler'")
        + "[[forces]]\nkind = 'spring'\nstiffness = 100.0\n[state]\nposition = [1, 0, 0]\n"
    )
    assert main(["integrate", str(path)]) == 1
    out, err = capsys.readouterr()
    assert "stopped being finite" in err
    assert 10 < len(table(out)["t"]) < 10_001


def test_exit_codes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ball = str(EXAMPLES / "ball.toml")
    assert main(["integrate", str(tmp_path / "none.toml")]) == 2
    assert main(["integrate", ball, "--out", str(tmp_path / "a.xlsx")]) == 2
    (tmp_path / "file").write_text("")
    assert main(["integrate", ball, "--out", str(tmp_path / "file" / "a.csv")]) == 2
    assert main(["bench", "rk5"]) == 2
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["integrate", ball, "--out", str(tmp_path / "a.parquet")]) == 3
    assert "pip install 'somersault[parquet]'" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        main(["integrate"])
    assert ended.value.code == 2


def test_outputs_are_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def worked(*_: object, **__: object) -> None:
        raise AssertionError("the dive was sought")

    monkeypatch.setattr("somersault.cli.dive._posed", worked)
    example = str(EXAMPLES / "dive.toml")
    assert main(["dive", example, "--out", str(tmp_path / "a.xyz")]) == 2
    assert "must end in .parquet, .csv, .json" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    for option in ("--out", "--html"):
        assert main(["dive", example, option, str(tmp_path / "file" / "a.csv")]) == 2
        assert "cannot be made" in capsys.readouterr().err


def test_the_folder_of_an_output_is_made(tmp_path: Path) -> None:
    ball, out = str(EXAMPLES / "ball.toml"), tmp_path / "a" / "b"
    outputs = ("--out", str(out / "ball.csv"), "--events", str(out / "c" / "events.csv"))
    assert main(["integrate", ball, *outputs, "--save", str(out / "d" / "ball.som")]) == 0
    assert sorted(path.name for path in out.rglob("*.*")) == ["ball.csv", "ball.som", "events.csv"]
    assert main(["bench", "rkmk", "--repeats", "1", "--out", str(tmp_path / "e" / "runs.csv")]) == 0


def test_a_name_that_occurs_twice_in_json_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "twice.json"
    path.write_text('{"run": {"dt": 0.1, "dt": 0.2}}')
    assert main(["integrate", str(path)]) == 2
    assert "`dt` occurs twice" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options",
    [
        ("--out", "a.csv", "--save", "a.csv"),
        ("--out", "a.csv", "--events", "./a.csv"),
        ("--events", "b.csv", "--save", "link.csv"),
        ("--save", "ball.toml"),
    ],
)
def test_two_outputs_in_one_file_are_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (EXAMPLES / "ball.toml").read_text()
    (tmp_path / "ball.toml").write_text(text)
    (tmp_path / "link.csv").symlink_to(tmp_path / "b.csv")
    assert main(["integrate", "ball.toml", *options]) == 2
    assert "are one file" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ball.toml", "link.csv"]
    assert (tmp_path / "ball.toml").read_text() == text


@pytest.mark.parametrize(
    ("old", "new", "meant"),
    [
        ("[run]", "[rum]", "did you mean run?"),
        ("interval", "intervals", "did you mean interval?"),
        ('method = "rkmk"', 'method = "rkmkk"', "did you mean `rkmk`?"),
    ],
)
def test_what_was_perhaps_meant_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, meant: str
) -> None:
    text = (
        '[body]\nmass = 1.0\nbox = [0.2, 0.4, 0.6]\n[run]\ninterval = [0.0, 1.0]\ndt = 0.1\nmethod = "rkmk"\n'
    )
    (tmp_path / "a.toml").write_text(text.replace(old, new))
    assert main(["integrate", str(tmp_path / "a.toml")]) == 2
    assert meant in capsys.readouterr().err
    tree = '[tree]\nname = "two_link_arn"\n[run]\ninterval = [0.0, 1.0]\ndt = 0.1\n'
    (tmp_path / "a.toml").write_text(tree)
    assert main(["integrate", str(tmp_path / "a.toml")]) == 2
    assert "did you mean two_link_arm?" in capsys.readouterr().err


def test_a_tree_is_read_from_mjcf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rod = "<body><joint axis='0 1 0' STIFF/><geom size='0.1' pos='0 0 -1'/></body>"
    document = f"<mujoco><worldbody>{rod}</worldbody></mujoco>"
    (tmp_path / "rod.xml").write_text(document.replace("STIFF", ""))
    motion = '[tree]\nmjcf = "rod.xml"\n[state]\nq = [0.3]\n[run]\ninterval = [0.0, 1.0]\ndt = 0.1\n'
    (tmp_path / "a.toml").write_text(motion)
    assert main(["integrate", str(tmp_path / "a.toml"), "--out", str(tmp_path / "a.csv")]) == 0
    assert (tmp_path / "a.csv").read_text().startswith("t,q0,v0")
    (tmp_path / "rod.xml").write_text(document.replace("STIFF", "stiffness='1'"))
    assert main(["integrate", str(tmp_path / "a.toml")]) == 2
    assert "springs of joints are not read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("laws", "is_valid"),
    [
        ({"law": {"stiffness": 1e3}}, True),
        ({"law": {"kind": "hunt_crossley", "stiffness": 1e3, "damping": 0.1}}, True),
        ({"law": {"kind": "compliant"}}, False),
        ({"law": {"kind": "plastic", "stiffness": 1e3}}, False),
        ({"friction": {"kind": "coulomb", "coefficient": 0.3, "stiffness": 0.0, "damping": 1.0}}, True),
        ({"friction": {"kind": "regularised", "coefficient": 0.3, "speed": 0.1}}, True),
        ({"friction": {"kind": "regularised", "coefficient": 0.3, "speed": 0.1, "damping": 1.0}}, False),
        ({"friction": {"coefficient": 0.3, "speed": 0.1}}, False),
    ],
)
def test_a_law_of_a_document_has_the_constants_of_its_class(laws: dict[str, Any], is_valid: bool) -> None:
    contact = {"point": [0, 0, 0], "surface": {"kind": "half_space"}, "law": {"stiffness": 1.0}} | laws
    run = {"interval": [0, 1], "dt": 0.1}
    document = {"body": {"mass": 1, "sphere": 0.1}, "contacts": [contact], "run": run}
    assert Draft202012Validator(schema("integrate")).is_valid(document) == is_valid


def test_a_reader_may_stop_reading() -> None:
    command = [sys.executable, "-m", "somersault", "integrate", str(EXAMPLES / "ball.toml")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline().startswith(b"t,x,y,z")
        process.stdout.close()
        assert b"Traceback" not in process.stderr.read()
        assert process.wait() == 0


def test_a_bar_is_shown_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "rkmk_b", "--repeats", "1", "--progress"]) == 0
    assert "1/1" in capsys.readouterr().err


def test_a_mark_of_the_byte_order_is_no_part_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "marked.toml"
    path.write_text(BODY, "utf-8-sig")
    assert path.read_bytes().startswith(b"\xef\xbb\xbf")
    assert main(["integrate", str(path)]) == 0
    capsys.readouterr()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--repeats", "-3"], "--repeats: must be between 1 and 1000, found -3"),
        (["--repeats", "0"], "--repeats: must be between 1 and 1000, found 0"),
        (["--repeats", "x"], "--repeats: must be a whole number, found 'x'"),
        (["--target", "x"], "--target: must be a number, found 'x'"),
        (["--target", "nan"], "--target: must be positive and finite, found nan"),
        (["--target", "0"], "--target: must be positive and finite, found 0"),
    ],
)
def test_the_bench_refuses_numbers_that_mean_nothing(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["bench", "rkmk", *arguments])
    assert stopped.value.code == 2
    assert message in capsys.readouterr().err
