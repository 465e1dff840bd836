"""Ctrl-C stops a run within a second, and on request what was recorded comes back."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from somersault import RigidBody, State, batch, exact, integrate

SCRIPT = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in background shells
import sys, time
import somersault
body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
start = somersault.State(angular_velocity=(1.0, 2.0, 3.0))
def force(t, state):
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
def at(t, state):
    return state.angular_velocity[0]
ground = somersault.contact.Contact(
    (0.0, 0.0, 0.0), somersault.contact.HalfSpace((0.0, 0.0, -1.0)), somersault.contact.CompliantLaw(1.0)
)
print("ready", flush=True)
try:
    motion = somersault.integrate(body, start, (0.0, 1e6), dt=1e-3, every=1000, {options})
    print("returned", time.monotonic(), motion.status, len(motion), motion.t[-1], motion.message, sep="|")
except KeyboardInterrupt:
    print("raised", time.monotonic(), sep="|")
"""


def interrupted(options: str) -> tuple[list[str], float]:
    """What the script prints, and how long it took to stop."""
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT.format(options=options)], stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=60)[0]
    fields = output.strip().split("|")
    return fields, float(fields[1]) - sent


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
@pytest.mark.parametrize(
    "more", ["", "forces=force", "observer=lambda t, state: None", "events=at", "contacts=ground"]
)
class TestInterrupts:
    """With and without Python code in play, and with contacts."""

    def test_raise_keyboard_interrupt(self, more: str) -> None:
        fields, seconds = interrupted(more)
        assert fields[0] == "raised"
        assert seconds < 1.0

    def test_return_what_was_recorded(self, more: str) -> None:
        fields, seconds = interrupted(f'on_interrupt="return", {more}')
        assert fields[0] == "returned"
        assert fields[2] == "-1"
        assert int(fields[3]) > 1
        assert float(fields[4]) > 0.0
        assert fields[5].startswith("interrupted at t = ")
        assert seconds < 1.0


def _many_times(name: str) -> Callable[[], object]:
    """A call of some tenths of a second, of many parts that take microseconds each."""
    body, start = RigidBody.box(1.0, (0.2, 0.4, 0.6)), State(angular_velocity=(1.0, 2.0, 3.0))
    times = np.linspace(0.0, 10.0, 400_000)
    if name == "dense output":
        motion = integrate(body, start, (0.0, 10.0), dt=0.01, method="rkmk5", dense_output=True)
        return lambda: motion.sol(times)
    if name == "exact.FreeBody":
        free = exact.FreeBody(body, start)
        return lambda: free(times)
    if name == "exact.Gyrostat":
        gyrostat = exact.Gyrostat(body, (0.1, 0.2, 0.3), start)
        return lambda: gyrostat(times)
    bodies = 64
    moments, still = np.tile([1.0, 2.0, 2.5], (bodies, 1)), np.tile([0.0, 0.0, 0.0, 1.0], (bodies, 1))
    rates = np.random.default_rng(1).normal(size=(bodies, 3))
    return lambda: batch.integrate_arrays(
        moments, still, rates, (0.0, 400.0), 2e-3, t_eval=np.linspace(0.0, 400.0, 4000)
    )


@pytest.mark.skipif(sys.platform == "win32", reason="there are no timers of this kind")
@pytest.mark.parametrize(
    "name", ["dense output", "exact.FreeBody", "exact.Gyrostat", "batch.integrate_arrays"]
)
def test_many_short_parts_are_interrupted(name: str) -> None:
    call = _many_times(name)
    began = time.monotonic()
    call()
    whole = time.monotonic() - began

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    try:
        began = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, 0.1 * whole)
            call()
        assert time.monotonic() - began < 0.7 * whole + 0.05
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_other_threads_run_meanwhile() -> None:
    body, start = RigidBody.box(1.0, (0.2, 0.4, 0.6)), State(angular_velocity=(1.0, 2.0, 3.0))
    worker = threading.Thread(
        target=integrate, args=(body, start, (0.0, 2e4)), kwargs={"dt": 0.01, "every": 10**6}
    )
    worker.start()
    turns = 0
    while worker.is_alive():
        turns += 1
        time.sleep(0.001)
    worker.join()
    # Held, the interpreter would have let this thread run once or twice.
    assert turns > 10
