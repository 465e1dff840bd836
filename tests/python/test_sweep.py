"""Sweeps: the same results whichever way they ran, and whatever stopped them on the way."""

import functools
import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import sweep
from somersault.errors import InputError, SweepError

#: Runs points, a hundred for each spin, on threads or on the cluster at an address.
SCRIPT = """
import contextlib, sys
import somersault
from somersault import sweep

def end(dt, spin):
    body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
    start = somersault.State(angular_velocity=(0.1, spin, 0.3))
    motion = somersault.integrate(body, start, (0.0, 8 * dt), dt=dt, every=8)
    if spin == 0.5:
        raise ValueError(f"spins with {spin}")
    return {"energy": motion.kinetic_energy[-1], "quaternion": motion.quaternion[-1]}

directory, address, spins = sys.argv[1:]
points = sweep.grid(dt=[0.001 * (i + 1) for i in range(100)], spin=[0.1 * i for i in range(int(spins))])
if address == "threads":
    found = sweep.run(end, points, directory=directory)
else:
    from distributed import Client
    with Client(address) as client:
        found = sweep.run(end, points, directory=directory, client=client)
print(found.n_done, found.n_failed)
"""


def digest(directory: Path) -> dict[str, str]:
    """The hash of every file of a directory."""
    return {
        str(path.relative_to(directory)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(directory.rglob("*"))
        if path.is_file()
    }


def script(folder: Path, name: str, address: str, spins: int) -> subprocess.Popen[str]:
    path = folder / "study.py"
    path.write_text(SCRIPT)
    command = [sys.executable, str(path), str(folder / name), address, str(spins)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def killed_and_resumed(folder: Path, address: str, spins: int) -> dict[str, str]:
    """The files of a run that is killed half-way and started again."""
    directory = folder / "killed"
    with script(folder, "killed", address, spins) as process:
        deadline = time.monotonic() + 120
        while len(list(directory.glob("records/*/[0-9]*.json"))) < 40 * spins:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL if sys.platform != "win32" else signal.SIGTERM)
    left = len(list(directory.glob("records/*/[0-9]*.json")))
    assert 40 * spins <= left < 100 * spins
    assert sweep.read(directory).missing
    with script(folder, "killed", address, spins) as process:
        assert process.communicate(timeout=120)[0] == f"{100 * (spins - 1)} 100\n"
    return digest(directory)


@pytest.fixture(scope="module", params=[8, pytest.param(100, marks=pytest.mark.study)])
def spins(request: pytest.FixtureRequest) -> int:
    """Eight hundred points in all, ten thousand in the study."""
    return int(request.param)


@pytest.fixture(scope="module")
def never_killed(tmp_path_factory: pytest.TempPathFactory, spins: int) -> dict[str, str]:
    """The files of the same run, on threads, left alone."""
    folder = tmp_path_factory.mktemp("whole")
    with script(folder, "whole", "threads", spins) as process:
        assert process.communicate(timeout=120)[0] == f"{100 * (spins - 1)} 100\n"
    return digest(folder / "whole")


def local_cluster() -> Any:
    """A Dask cluster of two processes on this machine."""
    distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra `dask`)")
    return distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    )


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with local_cluster() as found:
        yield found


@pytest.fixture
def doomed_cluster() -> Iterator[Any]:
    """One whose processes may be killed; after dozens of deaths Dask starts no others."""
    # Dask has all of its settings once this is imported. Tasks are not tried again: few processes die.
    pytest.importorskip("distributed", reason="Dask is not installed (extra `dask`)")
    import dask.config

    with dask.config.set({"distributed.scheduler.allowed-failures": 0}), local_cluster() as found:
        yield found


def test_a_sweep_killed_half_way_and_resumed_has_the_bytes_of_one_never_killed(
    tmp_path: Path, never_killed: dict[str, str], spins: int
) -> None:
    assert len(never_killed) == 100 * spins + 1
    assert killed_and_resumed(tmp_path, "threads", spins) == never_killed


@pytest.mark.filterwarnings("default")  # of Dask's own
def test_so_has_one_on_a_dask_cluster(
    tmp_path: Path, never_killed: dict[str, str], cluster: Any, spins: int
) -> None:
    assert killed_and_resumed(tmp_path, cluster.scheduler_address, spins) == never_killed


def ten_over(x: int) -> float:
    return 10 / x


@pytest.mark.filterwarnings("default")
def test_a_cluster_and_threads_return_the_same(cluster: Any) -> None:
    points = sweep.grid(x=range(-3, 4))
    with cluster.get_client() as client:
        assert sweep.run(ten_over, points, client=client) == sweep.run(ten_over, points)


@pytest.mark.filterwarnings("default")
def test_a_call_that_kills_its_process_is_a_failure_of_its_point(doomed_cluster: Any) -> None:
    def deadly(x: int) -> int:
        time.sleep(0.05)
        if x % 4 == 3:
            os._exit(1)
        return x

    with doomed_cluster.get_client() as client:
        found = sweep.run(deadly, sweep.grid(x=range(8)), client=client)
    assert found.values == [0, 1, 2, None, 4, 5, 6, None]
    killed = sweep.Failure("KilledWorker", "the process of the call was killed")
    assert found.failures == {3: killed, 7: killed}


@pytest.mark.filterwarnings("default")
def test_a_cluster_without_workers_ends_a_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra `dask`)")
    monkeypatch.setattr(sweep, "_LOOK_SECONDS", 0.05)
    monkeypatch.setattr(sweep, "_ALONE_SECONDS", 0.2)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None, silence_logs=50) as empty,
        empty.get_client() as client,
        pytest.raises(SweepError, match=r"has had no workers for 0\.2 s"),
    ):
        sweep.run(ten_over, sweep.grid(x=[1, 2]), client=client)


def test_failures_are_recorded_and_can_be_tried_again(tmp_path: Path) -> None:
    found = sweep.run(ten_over, sweep.grid(x=[2, 0, 5]), directory=tmp_path / "a")
    assert found.values == [5.0, None, 2.0]
    assert found.failures == {1: sweep.Failure("ZeroDivisionError", "division by zero")}
    assert found == sweep.read(tmp_path / "a")
    table = found.table()
    assert table["error"].tolist() == ["", "division by zero", ""]
    assert np.isnan(table["value"][1]) and table["x"].tolist() == [2, 0, 5]

    calls = []

    def mended(x: int) -> float:
        calls.append(x)
        return 0.0 if x == 0 else 10 / x

    points = sweep.grid(x=[2, 0, 5])
    manifest = tmp_path / "a" / "manifest.json"
    manifest.write_text(manifest.read_text().replace("ten_over", "mended"))
    changed = json.loads(manifest.read_text())
    changed["function"] = {"name": mended.__qualname__, "version": "2"}
    manifest.write_text(json.dumps(changed))
    again = sweep.run(mended, points, directory=tmp_path / "a", version="2", retry_failures=True)
    assert calls == [0] and again.values == [5.0, 0.0, 2.0]


def test_points_and_values_are_what_can_be_saved(tmp_path: Path) -> None:
    def echo(**point: Any) -> dict[str, Any]:
        return point

    body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
    point = {
        "body": body,
        "model": somersault.multibody.two_link_arm(),
        "array": np.arange(6.0).reshape(2, 3),
        "nothing": None,
        "pair": (1, -np.inf),
        "number": np.float64(0.1),
    }
    found = sweep.run(echo, [point], directory=tmp_path / "a", version="1")
    value = found.values[0]
    assert value["body"] == body and value["model"] == point["model"] and value["pair"] == (1, -np.inf)
    assert (value["array"] == point["array"]).all() and value["number"] == 0.1
    failed = sweep.run(lambda x: object(), [{"x": 1}])
    assert "cannot be written" in failed.failures[0].message


def test_a_directory_of_another_sweep_is_refused(tmp_path: Path) -> None:
    directory = tmp_path / "a"
    sweep.run(ten_over, sweep.grid(x=[1, 2]), directory=directory)
    with pytest.raises(InputError, match="n_points is 2 there and 3 here"):
        sweep.run(ten_over, sweep.grid(x=[1, 2, 3]), directory=directory)
    with pytest.raises(InputError, match="points_sha256 is"):
        sweep.run(ten_over, sweep.grid(x=[1, 3]), directory=directory)
    with pytest.raises(InputError, match="function is"):
        sweep.run(lambda x: x, sweep.grid(x=[1, 2]), directory=directory)
    with pytest.raises(InputError, match="function is"):
        sweep.run(functools.partial(ten_over), sweep.grid(x=[1, 2]), directory=directory)
    with pytest.raises(InputError, match="neither empty nor of a sweep"):
        sweep.run(ten_over, [], directory=tmp_path)
    manifest = directory / "manifest.json"
    manifest.write_text(manifest.read_text().replace(somersault.__version__, "0.0.1"))
    with pytest.raises(InputError, match=r"somersault is '0.0.1' there"):
        sweep.run(ten_over, sweep.grid(x=[1, 2]), directory=directory)
    manifest.write_text("{")
    with pytest.raises(InputError, match="is corrupt"):
        sweep.read(directory)
    with pytest.raises(InputError, match="is not of a sweep"):
        sweep.read(tmp_path)


def test_damaged_and_foreign_records_are_computed_again(tmp_path: Path) -> None:
    points = sweep.grid(x=[1, 2, 4])
    found = sweep.run(ten_over, points, directory=tmp_path / "a")
    whole = digest(tmp_path / "a")
    records = sorted((tmp_path / "a").glob("records/*/*.json"))
    records[0].write_bytes(records[0].read_bytes()[:-5])
    records[1].write_bytes(records[2].read_bytes())
    (records[0].parent / ".000002.json.77.tmp").write_text("half a record")
    assert sweep.read(tmp_path / "a").missing == [0, 1]
    assert sweep.run(ten_over, points, directory=tmp_path / "a") == found
    assert digest(tmp_path / "a") == whole


@pytest.mark.skipif(sys.platform == "win32", reason="directories are not locked there")
def test_a_directory_has_one_user_at_a_time(tmp_path: Path) -> None:
    inside, leave = threading.Event(), threading.Event()

    def slow(x: int) -> int:
        inside.set()
        leave.wait(60)
        return x

    arguments: dict[str, Any] = {"points": [{"x": 1}], "directory": tmp_path / "a", "version": "1"}
    first = threading.Thread(target=sweep.run, args=(slow,), kwargs=arguments)
    first.start()
    inside.wait(60)
    with pytest.raises(SweepError, match="in use by another process"):
        sweep.run(slow, **arguments)
    leave.set()
    first.join()


def test_bad_points_are_refused() -> None:
    with pytest.raises(InputError, match="point 1 must be a dictionary"):
        sweep.run(ten_over, [{"x": 1}, 2])  # type: ignore[list-item]
    with pytest.raises(somersault.errors.WriteError, match=r"point 0\['x'\] is a"):
        sweep.run(ten_over, [{"x": object()}])
    with pytest.raises(InputError, match=r"share the names \['x'\]"):
        sweep.run(lambda x: {"x": x}, [{"x": 1}]).table()
    assert len(sweep.run(ten_over, [])) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"function": 3}, "`function` must be a function, found 3"),
        ({"points": 3}, "`points` must be a list of dictionaries, found 3"),
        ({"points": "dt"}, "`points` must be a list of dictionaries, found 'dt'"),
        ({"points": {"x": 1}}, "`points` must be a list of dictionaries, found {'x': 1}"),
        ({"workers": 0}, "`workers` must be a whole number of at least 1, found 0"),
        ({"workers": -1}, "`workers` must be"),
        ({"workers": 1.5}, "`workers` must be"),
        ({"workers": True}, "`workers` must be"),
        ({"workers": "2"}, "`workers` must be"),
        ({"directory": 3}, "`directory` must be a path, found 3"),
        ({"directory": __file__}, "`directory` must be a directory, found the file"),
        ({"version": 1}, "`version` must be text, found 1"),
        ({"client": "tcp://localhost"}, "`client` must be a distributed.Client"),
    ],
)
def test_arguments_of_another_type_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        sweep.run(**{"function": ten_over, "points": [], **arguments})


def test_axes_and_directories_of_another_type_are_refused(tmp_path: Path) -> None:
    for values in (3, None, "rkmk"):
        with pytest.raises(InputError, match="`dt` must be a list of values"):
            sweep.grid(dt=values)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="`directory` must be a path"):
        sweep.read(3)  # type: ignore[arg-type]
    for count in ("-1", '"3"', "null", "1" + 18 * "0"):
        (tmp_path / "manifest.json").write_text(
            f'{{"format": "somersault sweep", "format_version": 2, "n_points": {count}}}'
        )
        with pytest.raises(InputError, match="`n_points` is no number of points"):
            sweep.read(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
def test_ctrl_c_keeps_what_is_done(tmp_path: Path) -> None:
    program = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from somersault import sweep
def wait(x):
    time.sleep(0.02)
    return x
try:
    sweep.run(wait, sweep.grid(x=range(1000)), directory=sys.argv[1], workers=2, progress=True)
except KeyboardInterrupt:
    print(len(sweep.read(sys.argv[1]).missing))
"""
    (tmp_path / "program.py").write_text(program)
    command = [sys.executable, str(tmp_path / "program.py"), str(tmp_path / "a")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        while not list(tmp_path.glob("a/records/*/*.json")):
            assert process.poll() is None
            time.sleep(0.05)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        missing = int(process.communicate(timeout=30)[0])
    assert 0 < missing < 1000
    assert time.monotonic() - sent < 5.0
    assert not list(tmp_path.rglob("*.tmp"))
