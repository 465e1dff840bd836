"""Studies of stability and accuracy, from Python."""

import numpy as np
import pytest

import somersault
from somersault import RigidBody, State, forces, studies


def test_the_region_of_euler_is_the_unit_circle() -> None:
    region = studies.stability_region("euler")
    assert region.area == pytest.approx(np.pi, rel=1e-3)
    assert region.corrected == region.area
    assert region.real_limit == pytest.approx(2.0, rel=1e-6)
    assert region.imaginary_limit == 0.0
    assert region.boundary.shape[1:] == (2, 2)
    distance = np.hypot(region.boundary[..., 0] + 1.0, region.boundary[..., 1])
    np.testing.assert_allclose(distance, 1.0, atol=2e-3)


def test_spectral_radii_of_euler() -> None:
    re, im = np.linspace(-2.0, 1.0, 7), np.linspace(0.25, 2.0, 4)
    radii = studies.spectral_radii("euler", re, im)
    assert radii.shape == (4, 7)
    np.testing.assert_allclose(radii, np.abs(1.0 + re + 1j * im[:, None]), rtol=1e-6)
    with pytest.raises(somersault.errors.InputError, match="must be finite"):
        studies.spectral_radii("euler", [np.nan], [0.0])


def test_energy_is_bounded_where_angular_momentum_is_kept() -> None:
    bodies = studies.prisms(5)
    assert len(bodies) == 25
    loses, gains = (studies.energy(method, bodies, steps=[1, 10]) for method in ("euler", "euler_l"))
    np.testing.assert_array_equal(gains.steps, [1, 10])
    assert (gains.max > 1.5).all() and (loses.min < 0.7).all()
    assert (gains.behaviour, loses.behaviour) == ("unconditionally unstable", "unconditionally stable")
    assert gains.fraction_of_bound <= 1.0 + 1e-12
    # All but the cube.
    assert gains.gained[-1] == loses.lost[-1] == 24
    assert gains.lost[-1] == loses.gained[-1] == gains.failed == 0
    with pytest.raises(somersault.errors.InputError, match="`steps` must increase"):
        studies.energy("euler", bodies, steps=[10, 1])
    for steps in ([-10, 20], [2**64]):
        with pytest.raises(ValueError):
            studies.energy("euler", bodies, steps=steps)


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("mp", 2), ("rkmk", 4)])
def test_orders(method: str, order: int) -> None:
    dts = 0.02 * 0.5 ** np.arange(5)
    study = studies.convergence(studies.Problem.asymmetric_body(), method, dts)
    assert study.dt.shape == study.errors["orientation"].shape == (5,)
    assert study.orders["orientation"] == pytest.approx(order, abs=0.2)
    pendulum = studies.convergence(
        studies.Problem.damped_spring_pendulum(), method, 0.02 * 0.5 ** np.arange(5)
    )
    assert pendulum.orders["position"] == pytest.approx(order, abs=0.2)


def test_work_and_precision() -> None:
    study = studies.work_precision(studies.Problem.case(1), "rkmk", [0.02, 0.01], repeats=1)
    np.testing.assert_array_equal(study.steps, [500, 1000])
    np.testing.assert_array_equal(study.evaluations, [2000, 4000])
    np.testing.assert_array_equal(study.rejected, [0, 0])
    assert study.errors["orientation"][1] < study.errors["orientation"][0]
    assert (study.seconds > 0.0).all()
    assert len(study) == 2
    with pytest.raises(somersault.InputError, match="one of `dts` and `tolerances` must be given"):
        studies.work_precision(studies.Problem.case(1), "rkmk")


def test_a_problem_of_your_own(body: RigidBody, state: State) -> None:
    free = studies.Problem(body, state, 2.0)
    assert (free.body, free.state, free.t_end) == (body, state, 2.0)
    assert free.reference == somersault.exact.FreeBody(body, state)(2.0)
    acting = [forces.Gravity(), forces.Drag(0.3)]
    fine = somersault.integrate(body, state, (0.0, 1.0), dt=1e-3, forces=acting)[-1]
    problem = studies.Problem(body, state, 1.0, reference=fine, forces=acting)
    assert studies.convergence(problem, "heun", [0.02, 0.01, 0.005, 0.0025]).orders[
        "position"
    ] == pytest.approx(2, abs=0.2)
    with pytest.raises(somersault.InputError, match="`reference` must be given where there are `forces`"):
        studies.Problem(body, state, 1.0, forces=acting)
    with pytest.raises(somersault.InputError, match="`forces` must hold force models, found a function"):
        studies.Problem(body, state, 1.0, reference=fine, forces=lambda t, x: None)  # type: ignore[arg-type]
    with pytest.raises(somersault.InputError, match="`number` must be 1, 2 or 3, found 4"):
        studies.Problem.case(4)
    with pytest.raises(somersault.errors.InputError):
        torque = studies.Problem(body, state, 1.0, reference=fine, forces=forces.Torque((1, 0, 0)))
        studies.convergence(torque, "dmv2", [0.1])


@pytest.mark.parametrize("found", [0, -3, 2**70, 1001])
def test_counts_are_refused_by_their_names(found: int) -> None:
    with pytest.raises(ValueError, match="`repeats` must be from 1 to 1000"):
        studies.work_precision(studies.Problem.case(1), "rk4", [0.1], repeats=found)
    with pytest.raises(ValueError, match="`n` must be from 1 to 1000"):
        studies.prisms(found)
    with pytest.raises(ValueError, match="`number` must be 1, 2 or 3"):
        studies.Problem.case(found)
