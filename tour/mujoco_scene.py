"""A free box in MuJoCo, moved by each of the integrators it offers.

MuJoCo is an optional peer: `available()` says whether it can be imported, and nothing else here may be
called where it cannot.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def available() -> bool:
    """Whether MuJoCo can be imported."""
    return find_spec("mujoco") is not None


def version() -> str:
    """MuJoCo's version."""
    import mujoco

    return str(mujoco.__version__)


def integrators() -> list[str]:
    """The names of MuJoCo's integrators, as its model files have them."""
    import mujoco

    return [name.removeprefix("mjINT_").lower() for name in mujoco.mjtIntegrator.__members__]


@dataclass(frozen=True)
class Scene:
    """One free body, without gravity, contacts, constraints or damping, and its MuJoCo model and data."""

    model: Any
    data: Any
    angular_velocity: ArrayLike

    @classmethod
    def free_body(
        cls,
        integrator: str,
        mass: float,
        moments: ArrayLike,
        angular_velocity: ArrayLike,
        dt: float,
    ) -> Scene:
        """A body with these principal moments along its axes, which start along those of the world."""
        import mujoco

        name = {"euler": "Euler", "rk4": "RK4"}.get(integrator, integrator)
        inertia = " ".join(repr(float(moment)) for moment in np.asarray(moments, dtype=float))
        model = mujoco.MjModel.from_xml_string(f"""
            <mujoco>
              <option timestep="{dt!r}" integrator="{name}" gravity="0 0 0">
                <flag contact="disable" constraint="disable"/>
              </option>
              <worldbody>
                <body>
                  <freejoint/>
                  <inertial pos="0 0 0" mass="{mass!r}" diaginertia="{inertia}"/>
                </body>
              </worldbody>
            </mujoco>
            """)
        return cls(model, mujoco.MjData(model), angular_velocity)

    def reset(self) -> None:
        """Back to the start."""
        import mujoco

        mujoco.mj_resetData(self.model, self.data)
        self.data.qvel[3:] = self.angular_velocity

    def advance(self, steps: int) -> None:
        """Makes steps, in one call of MuJoCo."""
        import mujoco

        mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self) -> Array:
        """The quaternion (w, x, y, z) and the angular velocity in the body frame, rad/s."""
        return np.concatenate([self.data.qpos[3:], self.data.qvel[3:]])

    def trajectory(self, steps: int) -> Array:
        """The states from the start on, one after each step."""
        self.reset()
        states = [self.state()]
        for _ in range(steps):
            self.advance(1)
            states.append(self.state())
        return np.array(states)
