"""What the tests share."""

import signal

import hypothesis
import numpy as np
import pytest
from numpy.typing import NDArray

import somersault
from somersault import multibody

# a shell that starts the tests in the background has SIGINT ignored, and what Ctrl-C does is tested
signal.signal(signal.SIGINT, signal.default_int_handler)

hypothesis.settings.register_profile("somersault", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("somersault")


#: Files whose tests take longest, so that no worker is left with them alone at the end.
LONG = (
    "test_viewer_results.py",
    "test_tour.py",
    "test_exact_reference.py",
    "test_viewer_browser.py",
    "test_book.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Takes long files first."""
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))


@pytest.fixture
def body() -> somersault.RigidBody:
    """A body with three different moments that are not along its axes."""
    turn = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])
    return somersault.RigidBody(2.0, turn @ np.diag([0.5, 0.9, 1.2]) @ turn.T)


@pytest.fixture
def state() -> somersault.State:
    """A state in which nothing is zero."""
    return somersault.State(
        position=(0.3, -0.2, 0.5),
        orientation=(0.1, -0.3, 0.5, 0.8),
        velocity=(0.4, 0.1, -0.7),
        angular_velocity=(1.1, -0.6, 0.9),
    )


@pytest.fixture(scope="session")
def dive() -> multibody.TreeSolution:
    """Two seconds of the spatial diver, who folds into a pike and opens."""
    diver = multibody.diver_spatial()
    fold, open_ = diver.configuration("H")[7:], diver.configuration("A")[7:]

    def shape(t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return (
            open_ + (fold - open_) * np.sin(0.5 * np.pi * t) ** 2,
            (fold - open_) * 0.5 * np.pi * np.sin(np.pi * t),
        )

    v = np.zeros(27)
    v[[0, 2, 4]] = 1.0, 4.0, 4.0
    q = diver.configuration("A")
    q[2] = 11.0
    return multibody.fly(diver.model, q, v, shape, (0.0, 2.0), dt=0.01)


@pytest.fixture(scope="session")
def tumble() -> somersault.Solution:
    """A box that turns about all its axes and falls."""
    box = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
    start = somersault.State(
        position=(0.1, 0.2, 0.3), velocity=(0.5, 0.0, 1.0), angular_velocity=(3.0, 5.0, 1.0)
    )
    return somersault.integrate(box, start, (0.0, 1.0), dt=0.05)
