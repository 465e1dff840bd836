"""Films of scenes: pictures by a browser without a window, made a GIF by Pillow or an MP4 by FFmpeg."""

from __future__ import annotations

import base64
import io
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from somersault.errors import ExportError, InputError
from somersault.viewer.shapes import positive

if TYPE_CHECKING:
    from somersault.viewer.scene import Scene

__all__ = ["BROWSERS", "browser", "export", "headless", "pictures"]

#: Names that Chromium and its relatives go by.
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
_ELSEWHERE = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)
#: Pictures that a run of the browser draws; they leave it as text.
_BATCH = 120
_SECONDS = 600

# Runs after the page: pictures as addresses of images, one a line.
_RECORD = """<script>
const lines = TIMES.map(t => player.picture(t, WIDTH, HEIGHT));
document.body.innerHTML = "<pre>" + lines.join("\\n") + "</pre>";
</script>"""


def browser() -> str | None:
    """The path of a browser, or None where there is none."""
    found = (shutil.which(name) for name in BROWSERS)
    return next((path for path in (*found, *filter(shutil.which, _ELSEWHERE)) if path), None)


def headless(page: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Runs the browser on the page at an address, without a window, drawing in software."""
    path = browser()
    if path is None:
        raise ExportError(f"a film needs Chromium or Chrome, found none of {', '.join(BROWSERS)}")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            path,
            "--headless=new",
            "--use-gl=angle",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--hide-scrollbars",
            "--no-first-run",
            "--enable-logging=stderr",
            f"--user-data-dir={profile}",
            *options,
            page,
        ]
        if sys.platform == "linux" and os.geteuid() == 0:
            # Chromium has no sandbox for root.
            command.insert(1, "--no-sandbox")
        try:
            return subprocess.run(
                command,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise ExportError(f"the browser {path} did not finish within {_SECONDS} s") from error
        except OSError as error:
            raise ExportError(f"the browser {path} could not be started: {error}") from error


def pictures(scene: Scene, times: list[float], size: tuple[int, int]) -> list[bytes]:
    """PNG files of the scene at times since its start."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "film.html"
        html = scene.html()
        for k in range(0, len(times), _BATCH):
            record = _RECORD.replace("TIMES", json.dumps(times[k : k + _BATCH]))
            record = record.replace("WIDTH", str(size[0])).replace("HEIGHT", str(size[1]))
            page.write_text(html.replace("</body>", f"{record}</body>"), encoding="utf-8")
            ran = headless(page.as_uri(), "--dump-dom", "--window-size=800,600")
            drawn = re.findall(r"data:image/png;base64,([A-Za-z0-9+/=]+)", ran.stdout)
            found += [base64.b64decode(picture) for picture in drawn]
            if len(found) != min(k + _BATCH, len(times)):
                said = "\n".join(re.findall(r"CONSOLE.*", ran.stderr) or ran.stderr.splitlines()[-3:])
                raise ExportError(f"the browser drew {len(found)} of {len(times)} pictures; it said: {said}")
    return found


def export(scene: Scene, path: Path, size: tuple[int, int], frame_rate: float, speed: float) -> Path:
    """The film of a scene. See `Scene.export`."""
    positive("frame_rate", frame_rate)
    positive("speed", speed)
    if len(size) != 2 or not all(isinstance(n, int) and 16 <= n <= 4096 for n in size):
        raise InputError(f"`size` must be two whole numbers from 16 to 4096, found {size!r}")
    writers: dict[str, Callable[[], Callable[[list[bytes], Path, float], None]]]
    writers = {".gif": _gif_writer, ".mp4": _mp4_writer}
    if path.suffix.lower() not in writers:
        raise InputError(f"`path` must end in .gif or .mp4, found '{path.name}'")
    if path.suffix.lower() == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise InputError(f"`size` must be even numbers for MP4, found {size!r}")
    # What is missing is said before the pictures are drawn.
    write = writers[path.suffix.lower()]()
    start, end = scene.interval
    if path.suffix.lower() == ".gif":
        frame_rate = 100.0 / max(2, round(100.0 / frame_rate))
    n = max(1, math.floor((end - start) / speed * frame_rate + 1e-9) + 1)
    times = [k * speed / frame_rate for k in range(n)]
    write(pictures(scene, times, size), path, frame_rate)
    return path


def _gif_writer() -> Callable[[list[bytes], Path, float], None]:
    try:
        from PIL import Image
    except ImportError as error:
        raise ExportError("a GIF needs Pillow: pip install 'somersault[film]'") from error

    def write(frames: list[bytes], path: Path, frame_rate: float) -> None:
        opened = [Image.open(io.BytesIO(frame)).convert("RGB") for frame in frames]
        # One palette for all, so that still parts do not flicker.
        some = opened[:: max(1, len(opened) // 8)]
        width, height = opened[0].size
        mosaic = Image.new("RGB", (width, height * len(some)))
        for k, image in enumerate(some):
            mosaic.paste(image, (0, k * height))
        palette = mosaic.quantize(255)
        reduced = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in opened]
        options: dict[str, Any] = {"duration": round(1000 / frame_rate), "loop": 0, "optimize": True}
        reduced[0].save(path, "GIF", save_all=True, append_images=reduced[1:], **options)

    return write


def _ffmpeg() -> str:
    path = shutil.which("ffmpeg")
    if path is not None:
        return path
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        raise ExportError("an MP4 needs FFmpeg: install it, or pip install 'somersault[film]'") from error


def _mp4_writer() -> Callable[[list[bytes], Path, float], None]:
    ffmpeg = _ffmpeg()

    def write(frames: list[bytes], path: Path, frame_rate: float) -> None:
        command = [
            *(ffmpeg, "-y", "-loglevel", "error", "-f", "image2pipe", "-c:v", "png"),
            *("-framerate", f"{frame_rate:g}", "-i", "-"),
            *("-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
            str(path),
        ]
        ran = subprocess.run(command, input=b"".join(frames), capture_output=True, check=False)
        if ran.returncode != 0:
            said = ran.stderr.decode("utf-8", "replace").strip()
            raise ExportError(f"FFmpeg could not make the film: {said}")

    return write
