"""The process survives: parallel calls after a fork, sizes that memory has no room for, and signals."""

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import batch, contact, ftla, motion, multibody, ocp, studies

BODY = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
START = somersault.State(angular_velocity=(0.1, 5.0, 0.3))
GRADIENT = somersault.forces.GravityGradient(somersault.forces.Orbit(7e6))


def _rows() -> Any:
    diver = multibody.diver_planar()
    q = np.tile(diver.configuration("A"), (2000, 1))
    return multibody.Model.mass_matrix(diver.model, q)[-1].tolist()


def _batch() -> Any:
    return batch.integrate_batch(BODY, [START] * 300, (0.0, 0.1), 0.01).quaternion[-1].tolist()


def _study() -> Any:
    return studies.spectral_radii("heun", np.linspace(-1.0, 0.0, 20), np.linspace(0.0, 1.0, 20)).tolist()


def _energy() -> Any:
    return studies.energy("euler", studies.prisms(8), steps=[10, 20]).max.tolist()


def _search() -> Any:
    return ocp.CartPendulumProblem().search(4, seed=1).best.z.tolist()


def _motion_search() -> Any:
    spline = ocp.SplineMotion(2, 6, [("start", 0, 0.0), ("finish", 0, 1.0)])
    problem = ocp.MotionProblem(
        multibody.two_link_arm(),
        [0.0, 0.0],
        [0.0, 0.0],
        [ocp.Phase(spline, 1.0, 10)],
        active=[True, True],
        costs=[ocp.Cost(ocp.entries("torque", [0, 1]))],
    )
    return problem.search(3, z=np.zeros(problem.n_variables), max_iterations=5).status


def _dive() -> Any:
    return ocp.dive_107b(n_steps=60).solve(max_iterations=3).z.tolist()


def _dives() -> Any:
    return [found.z.tolist() for found in ocp.dive_107b(n_steps=60).search(2, max_iterations=2)]


def _collocation() -> Any:
    return ocp.arm_motion(np.pi, tol=1e-2, max_iterations=5).status


def _flow() -> Any:
    flow = ftla.VariationalFlow(ftla.linear_regulator())
    return flow.state([1.0, 0.4], [0.5, 1.0]).tolist()


def _shooting() -> Any:
    times = np.linspace(0.0, 3.0, 9)
    found = ftla.shoot(ftla.linear_regulator(), [1.0], [1.0], times, np.tile([0.5, 0.1], (9, 1)))
    return found.nodes.tolist()


def _fit() -> Any:
    diver = multibody.diver_planar()
    markers = motion.MarkerSet.joint_centres(diver.model)
    still = np.tile(diver.configuration("A"), (5, 1))
    seen = motion.place_markers(markers, np.linspace(0.0, 0.4, 5), still)
    return motion.MarkerFit(markers, max_iterations=5).fit(seen).q.tolist()


def _validation() -> Any:
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 1.0, 20)
    seen = [
        motion.Performance(t, list("abcd"), rng.normal(size=(20, 4)), rng.normal(size=(20, 3)))
        for _ in range(8)
    ]
    return motion.validate(seen, np.arange(8.0), n_resamples=20).predictions.tolist()


#: Every way into parallel work.
PARALLEL: list[Callable[[], Any]] = [
    *(_rows, _batch, _study, _energy, _search, _motion_search, _dive, _dives, _collocation, _flow, _shooting),
    *(_fit, _validation),
]


def _all_of_them() -> list[Any]:
    return [call() for call in PARALLEL]


@pytest.fixture(scope="module")
def here() -> list[Any]:
    """What the calls return in this process, which has threads from then on."""
    return _all_of_them()


@pytest.mark.skipif(sys.platform == "win32", reason="processes are only spawned there")
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("start_method", ["fork", "spawn", "forkserver"])
def test_children_of_every_kind_return_the_same(here: list[Any], start_method: str) -> None:
    with multiprocessing.get_context(start_method).Pool(1) as pool:
        assert pool.apply_async(_all_of_them).get(timeout=240) == here


def _of_a_child(call: Callable[[], Any], send: Any) -> None:
    """In a child of this process, itself forked after parallel work."""
    multiprocessing.get_context("fork")
    call()
    read, write = os.pipe()
    if (child := os.fork()) == 0:
        os.write(write, repr(call()).encode())
        os._exit(0)
    os.waitpid(child, 0)
    send.send(os.read(read, 1 << 16).decode())


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork there")
@pytest.mark.filterwarnings("default")
def test_so_do_children_of_children_and_children_of_threads(here: list[Any]) -> None:
    receive, send = multiprocessing.Pipe()
    context = multiprocessing.get_context("fork")
    stop = threading.Event()

    def busy() -> None:
        while not stop.is_set():
            _rows()

    threads = [threading.Thread(target=busy) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(5):
            child = context.Process(target=_of_a_child, args=(_study, send))
            child.start()
            assert receive.poll(60), "the child hangs"
            assert receive.recv() == repr(here[PARALLEL.index(_study)])
            child.join()
    finally:
        stop.set()
        for thread in threads:
            thread.join()


def test_threads_return_the_same(here: list[Any]) -> None:
    found: list[Any] = [None] * 4

    def work(i: int) -> None:
        found[i] = _all_of_them()

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(found))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [here] * len(found)


def run_limited(program: str, bytes: int = 2 << 30) -> subprocess.CompletedProcess[str]:
    """Runs a program that may take so much memory more than Python and somersault do."""
    limited = f"""
        import resource
        import numpy as np
        import somersault
        from somersault import contact, ftla, motion, multibody, ocp, studies
        used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + {bytes}, used + {bytes}))
        body, start = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6)), somersault.State()
        arm = multibody.two_link_arm()
    """
    text = textwrap.dedent(limited) + textwrap.dedent(program)
    return subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, check=False, timeout=120
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited otherwise there")
@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("ocp.SplineMotion(100000, 14)", "coefficients"),
        ("ocp.SplineMotion(10000, 1, degree=0).fit", ""),
        ("somersault.integrate(body, start, (0.0, 1.0), dt=1e-15)", "records of 1000000000000000 steps"),
        ("somersault.integrate(body, start, (0.0, 1.0), dt=1e-8, dense_output=True)", "records"),
        ("multibody.integrate_tree(arm, [0, 0], [0, 0], (0.0, 1.0), dt=1e-9)", "give a larger `every`"),
        ("arm.mass_matrix(np.broadcast_to(0.0, (10**9, 2)))", "`q` need more memory than there is"),
        ("somersault.exact.FreeBody(body, start)(np.broadcast_to(0.0, 10**9))", "`t` need more memory"),
        ("arm.mass_matrix(np.zeros((6 * 10**7, 2)))", "need 1.920 GB"),
        (
            "somersault.batch.integrate_batch("
            "body, [start] * 1000, (0.0, 1.0), 0.5, method='rk4', t_eval=np.linspace(0, 1, 9000))",
            "the states at `t_eval` need 2.808 GB",
        ),
        (
            "somersault.batch.integrate_batch(body, [start] * 10**7, (0.0, 1.0), 0.1)",
            "the states at `t_eval` need",
        ),
    ],
)
def test_sizes_are_refused_before_memory_is_asked_for(call: str, message: str) -> None:
    done = run_limited(f"""
        try:
            {call}
        except somersault.InputError as fault:
            print("refused:", fault)
    """)
    assert done.returncode == 0, done.stderr[-2000:]
    assert message in done.stdout


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited otherwise there")
def test_a_run_that_fills_the_memory_ends_with_what_it_recorded() -> None:
    program = """
        try:
            somersault.integrate(body, start, (0.0, 1e9), rtol=1e-6, max_step=1.0, max_steps=10**12)
        except somersault.InputError as fault:
            print(len(fault.solution), fault)
    """
    done = run_limited(program, 300 << 20)
    assert done.returncode == 0, done.stderr[-2000:]
    count, _, message = done.stdout.partition(" ")
    assert int(count) > 100_000 and "give a larger `every`" in message


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited otherwise there")
def test_so_are_those_of_the_command_line(tmp_path: Any) -> None:
    (tmp_path / "a.toml").write_text(
        "[body]\nmass = 1.0\nbox = [0.2, 0.4, 0.6]\n[run]\ninterval = [0.0, 1.0]\ndt = 1e-15\n"
    )
    done = run_limited(f"""
        from somersault.cli import main
        raise SystemExit(main(["integrate", {str(tmp_path / "a.toml")!r}]))
    """)
    assert done.returncode == 2 and "give a larger `every`" in done.stderr


#: Calls that take long, and end on Ctrl-C.
POSTURE = multibody.diver_spatial().configuration("A")
CENTRES = motion.MarkerSet.joint_centres(multibody.diver_spatial().model)
LONG = {
    "search of the pendulum": "ocp.CartPendulumProblem().search(20000)",
    "search of a dive": "ocp.dive_107b().search(20000)",
    "dive": "ocp.dive_5174d().solve()",
    "collocation": "ocp.arm_motion(tol=1e-13)",
    "energy": "studies.energy('euler', studies.prisms(100), steps=[10**7])",
    "radii": "studies.spectral_radii('ab4', np.linspace(-1, 0, 3000), np.linspace(0, 1, 3000))",
    "work": "studies.work_precision(studies.Problem.case(1), 'rkmk', [1e-8])",
    "derivatives": "contact.differentiate(top.body, top.state, (0, 1e3), dt=1e-5, contacts=top.contacts)",
    "spectrum": "ftla.VariationalFlow(ftla.arm()).spectrum([-1.5, 0.05, 0, 0, -0.2, -0.01, -1.3, -0.1], 1e6)",
    "smoothing": "motion.smooth_motion(CENTRES, STILL)",
    "scaling": "motion.scale_model(CENTRES, STILL, max_frames=900)",
    "components": "motion.Pca(np.random.default_rng(0).normal(size=(3000, 3000)))",
    "rows": "diver.mass_matrix(np.zeros((10**5, diver.n_positions)) + diver.neutral())",
    "batch": "somersault.batch.integrate_batch(BODY, [START] * 2000, (0.0, 100.0), 1e-4)",
    "rollouts": "multibody.rollout(diver, [diver.neutral()] * 999, [0] * 27, (0, 1e3), 1e-3, every=10**6)",
    "few bodies": "somersault.batch.integrate_batch(BODY, [START] * 2, (0.0, 1e4), 1e-5)",
    "adapted batch": "somersault.batch.integrate_batch(BODY, [START] * 2000, (0.0, 1e4))",
    "satellites": "somersault.batch.integrate_batch(BODY, [START] * 200, (0, 1e5), 1e-3, forces=GRADIENT)",
}
#: Those of them that always have found something.
SEARCHES = ("search of the pendulum", "search of a dive", "dive")


def _clocks() -> tuple[float, float]:
    return time.monotonic(), time.process_time()


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind are not sent there")
@pytest.mark.parametrize("what", LONG)
def test_ctrl_c_ends_every_long_call_within_half_a_second(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    names = {
        **{"np": np, "somersault": somersault, "ocp": ocp, "studies": studies, "contact": contact},
        **{"ftla": ftla, "motion": motion, "multibody": multibody, "BODY": BODY, "START": START},
        "GRADIENT": GRADIENT,
        **{"top": contact.spinning_top(), "diver": multibody.diver_spatial().model},
        **{"CENTRES": CENTRES, "STILL": motion.place_markers(CENTRES, np.arange(600) / 100, [POSTURE] * 600)},
    }
    sent: list[float] = []

    def interrupt(*_: Any) -> None:
        if not sent:
            sent.extend(_clocks())
            raise KeyboardInterrupt

    def send_again(lost: Any) -> None:
        assert isinstance(lost.exc_value, KeyboardInterrupt), lost
        sent.clear()
        signal.setitimer(signal.ITIMER_REAL, 0.1)

    # what a handler raises is lost where it comes in a finaliser or a callback of a weak reference
    monkeypatch.setattr(sys, "unraisablehook", send_again)
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        try:
            eval(LONG[what], names)
            assert not sent
        except KeyboardInterrupt as error:
            assert hasattr(error, "solution") or what not in SEARCHES
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    if sent:
        wall, processor = (now - then for now, then in zip(_clocks(), sent, strict=True))
        # where others have the processors too, half a second of them counts
        assert wall < 0.5 or processor < 0.5
