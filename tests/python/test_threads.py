"""Threads that use the same objects at once, as they do without the lock of the interpreter.

What is shared here is what has anything to fill in or to lend: arrays that a solution makes when they are
first read, workspaces of a model, the threads of the library, files. On a Python with the lock the same calls
meet within Rust.
"""

import subprocess
import sys
import sysconfig
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import somersault
from somersault import batch, contact, ftla, motion, multibody, ocp

BODY = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
START = somersault.State(angular_velocity=(0.1, 5.0, 0.3))
DIVER = multibody.diver_planar()
TOP = contact.spinning_top()
FLOW = ftla.VariationalFlow(ftla.linear_regulator())
DIVE = ocp.dive_107b(n_steps=60)
POSTURES = np.array([DIVER.configuration(name) for name in DIVER.postures])

N_THREADS = 8
N_ROUNDS = 20


def at_once(work: Callable[[int], Any]) -> list[Any]:
    """What threads that begin at the same time return; an exception in one of them is raised."""
    gate = threading.Barrier(N_THREADS)
    found: list[Any] = [None] * N_THREADS
    raised: list[BaseException] = []

    def run(i: int) -> None:
        try:
            gate.wait(60)
            found[i] = work(i)
        except BaseException as error:
            raised.append(error)

    threads = [threading.Thread(target=run, args=(i,)) for i in range(N_THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if raised:
        raise raised[0]
    return found


def tumble() -> somersault.Solution:
    return somersault.integrate(BODY, START, (0.0, 0.2), dt=0.01, dense_output=True)


def made_when_first_read(solution: somersault.Solution) -> list[Any]:
    return [
        solution.position.tolist(),
        solution.quaternion.tolist(),
        solution.angular_velocity.tolist(),
        solution.angular_momentum.tolist(),
    ]


def python_force() -> Any:
    """A callable, for which every stage takes the interpreter."""
    run = somersault.integrate(
        BODY, START, (0.0, 0.1), dt=0.01, forces=lambda t, state: (-state.position, (0.0, 0.0, 0.1 * t))
    )
    return run.quaternion.tolist()


def top() -> Any:
    run = somersault.integrate(
        TOP.body, TOP.state, (0.0, 0.03), dt=1e-4, forces=TOP.forces, contacts=TOP.contacts
    )
    return [event.t for event in run.events]


def rows() -> Any:
    return DIVER.model.mass_matrix(np.tile(POSTURES, (40, 1))).tolist()


def one_row() -> Any:
    return DIVER.model.mass_matrix(POSTURES[0]).tolist()


def bodies() -> Any:
    return batch.integrate_batch(BODY, [START] * 200, (0.0, 0.1), 0.01).quaternion[-1].tolist()


def transition() -> Any:
    return FLOW.state([1.0, 0.4], [0.5, 1.0]).tolist()


def dive() -> Any:
    return DIVE.solve(max_iterations=2).z.tolist()


#: Calls on objects that all threads share.
SHARED = (python_force, top, rows, one_row, bodies, transition, dive)


def test_threads_on_the_same_objects_return_what_one_returns() -> None:
    alone = [call() for call in SHARED]

    def work(i: int) -> None:
        for turn in range(N_ROUNDS):
            # each thread in an order of its own, so that different calls meet
            for k in range(len(SHARED)):
                at = (k + i + turn) % len(SHARED)
                assert SHARED[at]() == alone[at], SHARED[at].__name__

    at_once(work)


def test_a_solution_makes_its_arrays_once_whoever_reads_first() -> None:
    expected = made_when_first_read(tumble())
    for _ in range(20):
        shared = tumble()
        assert at_once(lambda _, shared=shared: made_when_first_read(shared)) == [expected] * N_THREADS
        first, *others = at_once(lambda _, shared=shared: shared.position)
        assert all(other is first for other in others)


def test_threads_write_and_read_files_at_once(tmp_path: Path) -> None:
    marked = motion.MarkerSet.joint_centres(DIVER.model)
    seen = motion.place_markers(marked, np.linspace(0.0, 0.1, len(POSTURES)), POSTURES)
    motion.write_csv(tmp_path / "shared.csv", seen)
    expected = motion.read_file(tmp_path / "shared.csv").points

    def work(i: int) -> None:
        for turn in range(N_ROUNDS):
            own = tmp_path / f"{i}-{turn}"
            somersault.save(own, DIVER.model)
            assert somersault.load(own) == DIVER.model
            read = motion.read_file(tmp_path / "shared.csv")
            assert np.array_equal(read.points, expected)

    at_once(work)


def test_errors_of_one_thread_do_not_reach_another() -> None:
    def fails(i: int) -> None:
        for _ in range(N_ROUNDS):
            with pytest.raises(somersault.InputError, match=f"found -{i + 1}"):
                somersault.integrate(BODY, START, (0.0, 0.1), dt=-(i + 1))
            with pytest.raises(ZeroDivisionError, match=f"thread {i}"):
                somersault.integrate(BODY, START, (0.0, 0.1), dt=0.01, forces=lambda t, state: give_up(i))

    def give_up(i: int) -> Any:
        raise ZeroDivisionError(f"thread {i}")

    at_once(fails)


def test_the_first_calls_of_a_process_may_come_at_once() -> None:
    """The library's threads are started by whichever call comes first."""
    program = """
import threading
import numpy as np
from somersault import multibody
model = multibody.diver_planar().model
q = np.tile(model.neutral(), (4000, 1))
gate = threading.Barrier(8)
found = []
def work():
    gate.wait()
    found.append(model.mass_matrix(q).tobytes())
threads = [threading.Thread(target=work) for _ in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert len(found) == 8 and len(set(found)) == 1
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)


@pytest.mark.skipif(not sysconfig.get_config_var("Py_GIL_DISABLED"), reason="this Python has the lock")
def test_the_package_leaves_free_threaded_python_without_the_lock() -> None:
    program = "import sys, somersault.viewer; sys.exit(sys._is_gil_enabled())"
    subprocess.run([sys.executable, "-W", "error", "-c", program], check=True)
