"""The viewer in a browser without a window, and the films that come out of it."""

import base64
import io
import json
import re
import sys
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

import somersault
from somersault import RigidBody, multibody, viewer
from somersault.errors import ExportError, InputError
from somersault.viewer import film

BODY = RigidBody.box(1.0, (0.2, 0.4, 0.6))
DIVER = multibody.diver_spatial()
STILL = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (3, 1))
TIMES = (0.0, 0.5, 1.0)

in_browser = pytest.mark.skipif(
    film.browser() is None, reason=f"no browser: none of {', '.join(film.BROWSERS)} is installed"
)


def dive_scene(dive: multibody.TreeSolution) -> viewer.Scene:
    return viewer.Scene("Dive").add(dive, label="a pike").water().platform(10.0).caption(0.4, "folding")


def run(scene: viewer.Scene, folder: Path, script: str) -> dict[str, Any]:
    """What a script in the page returns while it loads; the page must not have complained."""
    page = folder / "page.html"
    wrapped = f"""<script>
    const found = (() => {{ {script} }})();
    const said = document.createElement("pre");
    said.id = "found";
    said.textContent = JSON.stringify(found);
    document.body.append(said);
    </script>"""
    page.write_text(scene.html().replace("</body>", wrapped + "</body>"), encoding="utf-8")
    ran = film.headless(page.as_uri(), "--dump-dom", "--window-size=640,480")
    assert "CONSOLE" not in ran.stderr, ran.stderr
    found = re.search(r'<pre id="found">(.*?)</pre>', ran.stdout, re.DOTALL)
    assert found is not None, ran.stderr
    return json.loads(unescape(found[1]))  # type: ignore[no-any-return]


def seen(picture: bytes) -> NDArray[np.int16]:
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(io.BytesIO(picture)).convert("RGB"), dtype=np.int16)


@in_browser
def test_a_complaint_of_a_page_would_be_heard(tmp_path: Path) -> None:
    page = tmp_path / "bad.html"
    page.write_text("<script>missing.function();</script>", encoding="utf-8")
    assert "CONSOLE" in film.headless(page.as_uri(), "--dump-dom").stderr


@in_browser
@pytest.mark.parametrize("window", [(1000, 700), (400, 720)])
def test_a_screenshot_shows_the_diver_between_sky_and_water(
    dive: multibody.TreeSolution, tmp_path: Path, window: tuple[int, int]
) -> None:
    page = dive_scene(dive).write(tmp_path / "dive.html").as_uri() + "#t=1.7&view=side"
    target = tmp_path / "shot.png"
    size = f"--window-size={window[0]},{window[1]}"
    ran = film.headless(page, f"--screenshot={target}", size, "--virtual-time-budget=500")
    assert "CONSOLE" not in ran.stderr, ran.stderr
    picture = seen(target.read_bytes())
    assert picture.shape[:2] == window[::-1]
    stage = picture[: window[1] * 2 // 3]
    red, green, blue = np.moveaxis(stage, -1, 0)
    skin = (red > green + 15) & (green > blue + 10)
    assert 0.003 < skin.mean() < 0.3
    water = (blue > red + 60) & (green > red + 30)
    assert water[-1].mean() > 0.5
    # The controls are in sight, in the colour of the button.
    controls = picture[window[1] * 2 // 3 :]
    assert (np.abs(controls - (0x33, 0x22, 0x88)).max(axis=-1) < 3).sum() > 500


@in_browser
def test_slider_buttons_and_gestures_change_the_picture(dive: multibody.TreeSolution, tmp_path: Path) -> None:
    script = """
    const canvas = document.getElementById("stage"), form = document.getElementById("controls").elements;
    const picture = () => { player.render(); return canvas.toDataURL(); };
    const time = t => { form.time.value = t; form.time.dispatchEvent(new Event("input")); };
    const pointer = (kind, x, id = 1) => canvas.dispatchEvent(
      new PointerEvent(kind, { pointerId: id, clientX: x, clientY: 100, bubbles: true }));
    const press = key => document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    canvas.setPointerCapture = () => {};
    const views = [...document.querySelectorAll("#views button")].map(button => button.textContent);
    time(0.2);
    const found = { views, paused: !player.playing, shown: form.shown.value, pictures: [picture()] };
    found.shown = form.shown.value;
    time(1.3); found.pictures.push(picture());
    found.caption = document.getElementById("caption").textContent;
    document.querySelectorAll("#views button")[2].click(); found.pictures.push(picture());
    form.momentum.click(); found.pictures.push(picture());
    form.trails.click(); found.pictures.push(picture());
    form.follow.click(); found.pictures.push(picture());
    pointer("pointerdown", 100); pointer("pointermove", 160); pointer("pointerup", 160);
    found.pictures.push(picture());
    canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -300 })); found.pictures.push(picture());
    pointer("pointerdown", 100); pointer("pointerdown", 200, 2); pointer("pointermove", 300, 2);
    found.pictures.push(picture());
    press("ArrowRight");
    found.stepped = player.t;
    press(" ");
    found.playing = player.playing;
    found.pictures = found.pictures.map((url, k, all) => all.indexOf(url) === k);
    return found;
    """
    found = run(dive_scene(dive), tmp_path, script)
    assert found["views"] == ["Corner", "Side", "Front", "Top"]
    assert found["paused"] and found["playing"]
    assert found["shown"] == "0.200 s"
    assert found["caption"] == "folding"
    assert found["stepped"] == pytest.approx(1.3 + 1 / 60)
    # Each differs from all before it.
    assert found["pictures"] == [True] * 9


@in_browser
def test_between_samples_bodies_turn_on_the_group(tmp_path: Path) -> None:
    turns = Rotation.random(4, rng=np.random.default_rng(7))
    t = np.array([0.0, 0.4, 0.5, 1.5])
    position = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 3.0]])
    scene = viewer.Scene().add(BODY, t, np.column_stack([position, turns.as_quat()]))
    at = np.linspace(-0.1, 1.6, 35)
    script = f"const m = player.scene.motions[0]; return {at.tolist()}.map(t => m.pose(0, m.locate(t)));"
    found = run(scene, tmp_path, script)
    inside = np.clip(at, 0.0, 1.5)
    expected = Slerp(t, turns)(inside)
    for k, (place, quaternion) in enumerate(found):
        np.testing.assert_allclose(place, [np.interp(inside[k], t, x) for x in position.T], atol=1e-6)
        assert (Rotation.from_quat(quaternion) * expected[k].inv()).magnitude() < 1e-6


@in_browser
def test_two_motions_stand_side_by_side(tmp_path: Path) -> None:
    scene = viewer.Scene().camera("side")
    for panel, posture in enumerate("AF"):
        q = DIVER.configuration(posture)
        scene.add(DIVER.model, [0.0], [q], panel=panel, label=posture, color=("#0000ff", "#00ff00")[panel])
    (picture,) = film.pictures(scene, [0.0], (800, 400))
    red, green, blue = np.moveaxis(seen(picture), -1, 0)
    columns = np.arange(800)
    blues = columns[((blue > 1.6 * red) & (blue > 1.6 * green)).any(axis=0)]
    greens = columns[((green > 1.6 * red) & (green > 1.6 * blue)).any(axis=0)]
    assert len(blues) > 10 and len(greens) > 10
    assert blues.max() < 400 <= greens.min()


@in_browser
def test_a_shadow_falls_on_the_ground() -> None:
    def dark(ground: float) -> float:
        """The fraction of what is grey, as the ground is, and darker than it is in the light."""
        ball = viewer.Sphere(0.1, color="#0000ff")
        scene = viewer.Scene().add(BODY, [0.0], STILL[:1], shapes=ball, trails=()).camera("corner")
        picture = seen(film.pictures(scene.ground(ground), [0.0], (400, 300))[0])
        return float(((np.ptp(picture, axis=-1) < 12) & (picture.max(axis=-1) < 160)).mean())

    assert dark(-0.12) > 0.01
    assert dark(-40.0) == 0.0


@in_browser
def test_a_tree_is_seen_to_touch_and_how_hard(tmp_path: Path) -> None:
    thigh, shank = (RigidBody.box(1.0, (0.1, 0.1, 0.4)) for _ in range(2))
    leg = multibody.Model(
        [
            multibody.Link("thigh", "planar", body=thigh, center=(0.0, 0.0, -0.2)),
            multibody.Link(
                "shank",
                "revolute",
                parent="thigh",
                axis=(0, 1, 0),
                origin=(0.0, 0.0, -0.4),
                body=shank,
                center=(0.0, 0.0, -0.2),
            ),
        ]
    )
    t = np.linspace(0.0, 1.0, 1001)
    q = np.column_stack([0.1 * t, 0.8 - 0.3 * t**2, 0.8 * t, -1.6 * t])
    sole = np.array([0.0, 0.0, -0.4])
    forces = np.zeros((len(t), 3))
    forces[t >= 0.5] = 5.0, 0.0, 40.0
    # The knee is hit for 2 ms.
    hit = np.zeros((len(t), 3))
    hit[900:903] = 0.0, 0.0, 80.0
    scene = viewer.Scene().ground().camera("side").play(arrows=("contact_force",))
    scene.add(leg, t, q, trails=(), contacts=[("shank", sole, forces), ("shank", np.zeros(3), hit)])

    at = (0.25, 0.4985, 0.75, 0.901)
    script = f"""
    const [motion] = player.scene.motions, form = document.getElementById("controls").elements;
    const touching = {list(at)}.map(t => motion.touching(t)), pictures = [];
    pictures.push(player.picture(0.75, 640, 480));
    form.force.click(); pictures.push(player.picture(0.75, 640, 480));
    const hidden = [form.force, form.momentum].map(control => control.parentElement.hidden);
    const scale = player.stage.arrowScale.force, {{ radius }} = player.scene;
    return {{ touching, hidden, pictures, scale, radius }};
    """
    found = run(scene, tmp_path, script)
    assert [len(touching) for touching in found["touching"]] == [0, 0, 1, 2]
    assert found["hidden"] == [False, True]
    for moment, touching in zip(at, found["touching"], strict=True):
        k = round(1000 * moment)
        pose = leg.poses(q[k])[leg.body("shank")]
        points, sizes = (pose[:3, :3] @ sole + pose[:3, 3], pose[:3, 3]), (forces[k], hit[k])
        for (place, force), point, size in zip(touching, points, sizes, strict=False):
            np.testing.assert_allclose(place, point, atol=1e-3)
            np.testing.assert_allclose(force, size, rtol=1e-6)
    # The largest force of all is 1.4 radii of the figure long.
    assert found["scale"] * 80.0 == pytest.approx(1.4 * found["radius"])

    def painted(picture: str) -> tuple[int, int]:
        """Pixels in the colours of marks and of arrows, in the address of an image."""
        red, green, blue = np.moveaxis(seen(base64.b64decode(picture.partition(",")[2])), -1, 0)
        mark = (red > 150) & (green > 100) & (blue < 60)
        return int(mark.sum()), int(((green > red + 50) & (green > blue + 30)).sum())

    (mark, arrow), (alone, none) = (painted(picture) for picture in found["pictures"])
    assert mark > 20 and alone > 20 and arrow > 100 and none == 0
    (before,) = film.pictures(scene, [0.25], (640, 480))
    assert painted("," + base64.b64encode(before).decode()) == (0, 0)


@in_browser
def test_without_webgl_the_page_says_so(tmp_path: Path) -> None:
    page = viewer.Scene().add(BODY, TIMES, STILL).write(tmp_path / "page.html")
    ran = film.headless(page.as_uri(), "--dump-dom", "--disable-3d-apis")
    assert "The motion cannot be shown: WebGL 2 is not available." in ran.stdout


# Films


@in_browser
def test_a_gif_has_the_pictures_of_the_motion(tmp_path: Path, tumble: somersault.Solution) -> None:
    image = pytest.importorskip("PIL.Image")
    scene = viewer.Scene().add(tumble).ground()
    path = scene.export(tmp_path / "box.gif", size=(160, 120), frame_rate=10.0, speed=0.5)
    with image.open(path) as gif:
        assert gif.size == (160, 120)
        assert gif.n_frames == 21
        assert gif.info["duration"] == 100
        frames = []
        for k in (0, 10, 20):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB"), dtype=np.int16))
    assert np.abs(frames[1] - frames[0]).max() > 50
    assert np.abs(frames[2] - frames[1]).max() > 50


@in_browser
def test_an_mp4_is_one(tmp_path: Path, tumble: somersault.Solution) -> None:
    try:
        film._ffmpeg()
    except ExportError as error:
        pytest.skip(str(error))
    path = viewer.Scene().add(tumble).export(tmp_path / "box.mp4", size=(160, 120), frame_rate=10.0)
    content = path.read_bytes()
    assert content[4:8] == b"ftyp" and b"avc1" in content and len(content) > 2000


def test_what_a_film_needs_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = viewer.Scene().add(BODY, TIMES, STILL)
    with monkeypatch.context() as without:
        without.setattr(film.shutil, "which", lambda name: None)
        with pytest.raises(ExportError, match="needs Chromium or Chrome"):
            scene.export(tmp_path / "box.gif")
        without.setitem(sys.modules, "imageio_ffmpeg", None)
        with pytest.raises(ExportError, match="needs FFmpeg: install it"):
            scene.export(tmp_path / "box.mp4")
        without.setitem(sys.modules, "PIL", None)
        with pytest.raises(ExportError, match=r"needs Pillow: pip install 'somersault\[film\]'"):
            scene.export(tmp_path / "box.gif")
    assert not list(tmp_path.iterdir())


def test_a_browser_that_draws_nothing_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    idle = tmp_path / "browser"
    idle.write_text("#!/bin/sh\necho out of order >&2\n")
    idle.chmod(0o755)
    monkeypatch.setattr(film, "browser", lambda: str(idle))
    with pytest.raises(ExportError, match=r"drew 0 of 26 pictures; it said: out of order"):
        viewer.Scene().add(BODY, TIMES, STILL).export(tmp_path / "box.gif")


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("box.avi", {}, "`path` must end in .gif or .mp4, found 'box.avi'"),
        ("box.gif", {"size": (640, 8)}, "`size` must be two whole numbers from 16 to 4096"),
        ("box.mp4", {"size": (641, 480)}, "`size` must be even numbers for MP4"),
        ("box.gif", {"frame_rate": 0.0}, "`frame_rate` must be positive, found 0"),
        ("box.gif", {"speed": -1.0}, "`speed` must be positive, found -1"),
    ],
)
def test_films_of_another_kind_are_refused(
    tmp_path: Path, name: str, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        viewer.Scene().add(BODY, TIMES, STILL).export(tmp_path / name, **options)
    assert message in str(caught.value)
