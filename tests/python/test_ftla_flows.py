"""Flows of any field: spectra over long times, fields of exponents, ridges, convergence."""

import pickle
import signal
import threading
import time
from typing import Any

import numpy as np
import pytest

from somersault import errors, ftla


def lorenz(x: Any, t: Any, p: Any) -> Any:
    return p.sigma * (x.y - x.x), x.x * (p.rho - x.z) - x.y, x.x * x.y - p.beta * x.z


def gyre(x: Any, t: Any) -> Any:
    a = 0.25 * np.sin(0.2 * np.pi * t)
    f, slope = a * x.x**2 + (1 - 2 * a) * x.x, 2 * a * x.x + 1 - 2 * a
    u = -0.1 * np.pi * np.sin(np.pi * f) * np.cos(np.pi * x.y)
    return u, 0.1 * np.pi * np.cos(np.pi * f) * np.sin(np.pi * x.y) * slope


def square(x: Any) -> Any:
    return (x.x**2,)


PARAMETERS = {"sigma": 10.0, "rho": 28.0, "beta": 8 / 3}
LORENZ = ftla.vector_field(lorenz, ("x", "y", "z"), PARAMETERS)
GYRE = ftla.vector_field(gyre, ("x", "y"))
START = [1.0, 1.0, 20.0]


def flow(system: ftla.System, **options: Any) -> ftla.VariationalFlow:
    return ftla.VariationalFlow(system, **{"rtol": 1e-8, "atol": 1e-10, **options})


def grid(x: Any, y: Any) -> Any:
    return np.stack(np.meshgrid(x, y), axis=-1)


class TestVectorField:
    def test_values_and_jacobians_are_those_of_the_function(self) -> None:
        assert LORENZ.dimension == 3 and LORENZ.n_controls == 0 and LORENZ.model is None
        np.testing.assert_allclose(LORENZ.field([1.0, 2.0, 3.0]), [10.0, 23.0, 2.0 - 8.0])
        np.testing.assert_allclose(LORENZ.field([[1.0, 2.0, 3.0]] * 2), [[10.0, 23.0, -6.0]] * 2)
        np.testing.assert_allclose(
            LORENZ.jacobian([1.0, 2.0, 3.0]), [[-10, 10, 0], [25, -1, -1], [2, 1, -8 / 3]]
        )

    def test_time_is_an_argument(self) -> None:
        field = ftla.vector_field(lambda x, t: (np.cos(t) * x.a,), ("a",))
        assert field.field([2.0], 1.0)[0] == 2.0 * np.cos(1.0)
        assert field.field([2.0])[0] == 2.0
        assert field.jacobian([2.0], t=1.0)[0, 0] == np.cos(1.0)
        found = flow(field, start=1.0).transition([2.0], 2.0)
        assert found.matrix[0, 0] == pytest.approx(np.exp(np.sin(3.0) - np.sin(1.0)), rel=1e-7)
        assert flow(field, start=1.0).start == 1.0

    def test_the_fields_of_time_are_refused_where_time_is_none_of_the_problem(self) -> None:
        with pytest.raises(errors.InputError, match="must not depend on time"):
            ftla.cold_start(GYRE, [0.0], [1.0], 1.0)
        with pytest.raises(errors.InputError, match="must not depend on time"):
            ftla.Placement((1, 0, 1), held=[], times=[1.0, 2.0]).place(flow(GYRE), [0.1, 0.2])

    def test_states_may_be_a_number_and_parameters_may_be_left_out(self) -> None:
        field = ftla.vector_field(lambda x: -x, 40)
        assert repr(field).startswith("<System: vector field of x0, x1")
        np.testing.assert_array_equal(field.jacobian(np.ones(40)), -np.eye(40))
        spectrum = flow(field).spectrum(np.ones(40), 2.0)
        np.testing.assert_allclose(spectrum.exponents, -1.0, rtol=1e-9)

    def test_it_is_pickled_by_its_function(self) -> None:
        again = pickle.loads(pickle.dumps(flow(LORENZ, start=2.0)))
        assert again.start == 2.0 and repr(again.system) == repr(LORENZ)
        np.testing.assert_array_equal(again.system.field([1.0, 2.0, 3.0]), LORENZ.field([1.0, 2.0, 3.0]))

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ((lorenz, ("x", "y", "z"), {"sigma": 1.0}), "no attribute 'rho'"),
            ((square, ("x", "y")), "must give 2 rates, found 1"),
            ((square, ()), "from 1 to 256, found 0"),
            ((square, 257), "from 1 to 256, found 257"),
            ((square, ("x", "x")), "names of their own"),
            ((square, ("x", 3)), "names as those of variables"),
            ((3, ("x",)), "must be a function of"),
            ((square, ("x",), [1.0]), "must be values by name"),
            ((square, ("x",), {"a": "b"}), "must be real numbers"),
            ((square, ("x",), {"a b": 1.0}), "names as those of variables"),
            ((square, ("x",), {"a": np.nan}), "must be finite"),
            ((lambda x: (np.nan,), ("x",)), "finite values, found nan"),
            ((lambda x: (1.0 if x.x > 0 else 0.0,), ("x",)), "neither true nor false"),
            ((lambda a, b, c, d: a, ("x",)), "or fewer of them, found 4"),
            ((lambda x: None, ("x",)), "found None"),
        ],
    )
    def test_what_is_no_field_is_refused(self, arguments: Any, message: str) -> None:
        with pytest.raises((errors.InputError, errors.TraceError), match=message):
            ftla.vector_field(*arguments)

    def test_traced_and_callable_fields_agree(self) -> None:
        def jacobian(p: Any) -> Any:
            x, y, z = p
            return [[-10.0, 10.0, 0.0], [28.0 - z, -1.0, -x], [y, x, -8 / 3]]

        own = ftla.System(lambda p: LORENZ.field(p), jacobian, 3)
        found = [flow(each).transition(START, 0.5).matrix for each in (own, LORENZ)]
        np.testing.assert_allclose(*found, rtol=1e-9)


class TestLyapunovSpectrum:
    def test_lorenz_is_that_of_the_literature(self) -> None:
        """Sprott, Chaos and Time-Series Analysis (2003); the divergence is −(σ + 1 + β)."""
        found = ftla.lyapunov_spectrum(flow(LORENZ), START, 1000.0)
        gaps = abs(found.exponents - [0.9056, 0.0, -14.5723])
        assert found.success and found.status == "converged", found.message
        assert (gaps < 4 * found.errors + 1e-3).all() and (found.errors < 0.03).all()
        assert found.exponents.sum() == pytest.approx(-41 / 3, abs=1e-6)
        assert found.kaplan_yorke_dimension == pytest.approx(2.062, abs=4e-3)
        assert found.growth == ("exponential", "neutral", "exponential")
        assert found.history.shape == (512, 3) and found.times[-1] == 1000.0
        np.testing.assert_array_equal(found.history[-1], found.exponents)
        assert np.isnan(found.history[:51]).all() and np.isfinite(found.history[51:]).all()
        assert pickle.loads(pickle.dumps(found)).status == "converged"

    def test_a_shear_does_not_converge(self) -> None:
        shear = ftla.vector_field(lambda x: (x.y, 0.0), ("x", "y"))
        for duration in (50.0, 1e3, 1e5):
            found = ftla.lyapunov_spectrum(flow(shear), [0.0, 1.0], duration)
            assert found.status == "not_converged" and found.growth == ("power", "power")
            assert "no exponent is a rate" in found.message and "ln T/T" in found.message
            assert found.powers == pytest.approx([1.0, -1.0], abs=0.1)

    def test_hamiltonian_exponents_pair(self) -> None:
        """Hénon and Heiles; Skokos (2010): the largest exponent at H = 1/8 is near 0.047 in the chaos."""
        system = ftla.vector_field(
            lambda x: (x.u, x.v, -x.x - 2 * x.x * x.y, -x.y - x.x**2 + x.y**2), ("x", "y", "u", "v")
        )
        found = ftla.lyapunov_spectrum(flow(system), [0.0, -0.25, 0.42, 0.0], 5000.0)
        np.testing.assert_allclose(found.exponents + found.exponents[::-1], 0.0, atol=2e-3)
        assert 0.02 < found.exponents[0] < 0.07
        assert found.growth[0] == "exponential" or not found.success

    def test_it_goes_backward(self) -> None:
        system = ftla.vector_field(lambda x: (0.5 * x.a, -2.0 * x.b), ("a", "b"))
        found = ftla.lyapunov_spectrum(flow(system), [0.0, 0.0], -50.0)
        np.testing.assert_allclose(found.exponents, [2.0, -0.5], rtol=1e-6)
        assert found.success and found.kaplan_yorke_dimension == 2.0

    def test_motions_that_end_early_say_how(self) -> None:
        blow_up = ftla.vector_field(square, ("x",))
        found = ftla.lyapunov_spectrum(flow(blow_up), [1.0], 2.0)
        assert found.status in ("step_underflow", "no_value") and not found.success
        assert found.times[-1] <= 1.0 and len(found.times) > 200 and np.isfinite(found.exponents).all()
        found = ftla.lyapunov_spectrum(flow(LORENZ), START, 1e6, max_evaluations=20_000)
        assert found.status == "limit_reached" and 20_000 <= found.n_evaluations < 21_000
        began = time.perf_counter()
        found = ftla.lyapunov_spectrum(flow(LORENZ, max_steps=10_000_000), START, 1e6, max_time=0.2)
        assert found.status == "limit_reached" and time.perf_counter() - began < 1.0
        nowhere = ftla.vector_field(lambda x: (np.log(x.x),), ("x",))
        found = ftla.lyapunov_spectrum(flow(nowhere), [-1.0], 1.0)
        assert found.status == "no_value" and np.isnan(found.exponents).all()
        assert "not finite" in found.message
        stiff = ftla.vector_field(lambda x: (-1e9 * (x.x - 1.0),), ("x",))
        found = ftla.lyapunov_spectrum(flow(stiff, max_steps=1000), [2.0], 1e3)
        assert found.status == "too_many_steps"

    def test_a_field_that_jumps_does_not_crash(self) -> None:
        system = ftla.vector_field(lambda x: (np.where(x.x > 0, -1.0, 2.0),), ("x",))
        found = ftla.lyapunov_spectrum(flow(system), [1.0], 3.0)
        assert not found.success
        bouncing = ftla.vector_field(lambda x: (x.v, -np.sign(x.x)), ("x", "v"))
        assert ftla.lyapunov_spectrum(flow(bouncing), [1.0, 0.0], 40.0, max_time=2.0).n_evaluations > 0

    def test_ctrl_c_leaves_what_there_is(self) -> None:
        timer = threading.Timer(0.3, signal.raise_signal, (signal.SIGINT,))
        timer.start()
        began = time.perf_counter()
        with pytest.raises(KeyboardInterrupt) as caught:
            ftla.lyapunov_spectrum(flow(LORENZ), START, 1e6, samples=100_000)
        assert time.perf_counter() - began < 1.5
        solution = caught.value.solution  # type: ignore[attr-defined]
        assert solution.status == "interrupted" and not solution.success
        assert 0 < len(solution.times) < 100_000

    @pytest.mark.parametrize(
        ("changed", "message"),
        [
            ({"duration": 0.0}, "`duration`"),
            ({"duration": np.nan}, "`duration`"),
            ({"transient": 0.95}, "`transient`"),
            ({"samples": 3}, "`samples`"),
            ({"samples": 10**9}, "`samples`"),
            ({"samples": -1}, "`samples`"),
            ({"tolerance": 0.0}, "`tolerance`"),
            ({"p": [1.0]}, "`p`"),
            ({"p": [1.0, np.inf, 0.0]}, "`p`"),
            ({"flow": LORENZ}, "`flow` must be a VariationalFlow, found a System"),
            ({"max_time": -1.0}, "`max_time`"),
        ],
    )
    def test_misuse_is_an_input_error(self, changed: dict[str, Any], message: str) -> None:
        given = {"flow": flow(LORENZ), "p": START, "duration": 10.0, **changed}
        with pytest.raises(errors.InputError, match=message):
            ftla.lyapunov_spectrum(**given)


class TestFtleField:
    def test_it_has_the_exponents_of_single_points(self) -> None:
        points = grid(np.linspace(0, 2, 9), np.linspace(0, 1, 5))
        of = flow(GYRE, start=2.0)
        for duration in (15.0, -15.0):
            found = ftla.ftle_field(of, points, duration)
            assert found.success and found.exponents.shape == (5, 9) and found.ends.shape == (5, 9, 2)
            for row, column in ((0, 0), (2, 3), (4, 8)):
                matrix = of.transition(points[row, column], duration).matrix
                largest = np.linalg.svd(matrix)[1][0]
                assert found.exponents[row, column] == pytest.approx(np.log(largest) / 15.0, abs=1e-6)
                stretched = matrix @ found.directions[row, column]
                assert np.linalg.norm(stretched) == pytest.approx(largest, rel=1e-5)

    def test_exponents_are_those_of_differences(self) -> None:
        """Of four neighbours by another integrator, SciPy's."""
        from scipy.integrate import solve_ivp

        def rates(t: float, x: Any) -> Any:
            return GYRE.field(x, t)

        point, beside = np.array([1.1, 0.4]), 1e-5
        found = ftla.ftle_field(flow(GYRE), point, 15.0)
        assert found.exponents.shape == () and found.status == "arrived"
        columns = []
        for unit in np.eye(2):
            ends = [
                solve_ivp(rates, (0.0, 15.0), point + side * beside * unit, rtol=1e-11, atol=1e-12).y[:, -1]
                for side in (1, -1)
            ]
            columns.append((ends[0] - ends[1]) / (2 * beside))
        largest = np.linalg.svd(np.transpose(columns))[1][0]
        assert found.exponents == pytest.approx(np.log(largest) / 15.0, abs=1e-6)

    def test_points_that_leave_or_have_no_value_are_nan(self) -> None:
        saddle = ftla.vector_field(lambda x: (x.a, -x.b), ("a", "b"))
        points = grid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 3))
        found = ftla.ftle_field(flow(saddle), points, 2.0, domain=[(-1.0, 1.0), None])
        left = found.status == "left_domain"
        np.testing.assert_array_equal(left, abs(points[..., 0]) > 0.1)
        assert np.isnan(found.exponents[left]).all() and np.isnan(found.ends[left]).all()
        np.testing.assert_allclose(found.exponents[~left], 1.0, rtol=1e-7)
        assert not found.success
        root = ftla.vector_field(lambda x: (np.sqrt(x.x),), ("x",))
        found = ftla.ftle_field(flow(root), [[-1.0], [1.0]], 1.0)
        assert found.status.tolist() == ["no_value", "arrived"]
        blow_up = ftla.ftle_field(flow(ftla.vector_field(square, ("x",))), [[1.0], [-1.0]], 3.0)
        assert blow_up.status[0] in ("step_underflow", "no_value") and blow_up.status[1] == "arrived"

    def test_no_points_are_a_field_of_none(self) -> None:
        found = ftla.ftle_field(flow(GYRE), np.empty((0, 3, 2)), 1.0)
        assert found.exponents.shape == (0, 3) and found.success
        with pytest.raises(errors.InputError, match="grid"):
            found.ridges()

    def test_limits_end_it_with_what_there_is(self) -> None:
        points = grid(np.linspace(0, 2, 40), np.linspace(0, 1, 40))
        found = ftla.ftle_field(flow(GYRE), points, 15.0, max_evaluations=50_000)
        assert set(found.status.ravel()) == {"arrived", "limit_reached"}
        assert found.n_evaluations < 60_000

    def test_ctrl_c_leaves_what_there_is(self) -> None:
        points = grid(np.linspace(0, 2, 300), np.linspace(0, 1, 300))
        timer = threading.Timer(0.3, signal.raise_signal, (signal.SIGINT,))
        timer.start()
        began = time.perf_counter()
        with pytest.raises(KeyboardInterrupt) as caught:
            ftla.ftle_field(flow(GYRE, rtol=1e-12), points, 60.0)
        assert time.perf_counter() - began < 1.5
        solution = caught.value.solution  # type: ignore[attr-defined]
        assert set(solution.status.ravel()) == {"arrived", "interrupted"} and not solution.success

    @pytest.mark.parametrize(
        ("changed", "message"),
        [
            ({"points": [[1.0, 2.0, 3.0]]}, "`points`"),
            ({"points": 1.0}, "`points`"),
            ({"points": "no"}, "`points`"),
            ({"points": [[1.0, np.nan]]}, "`points` must be finite"),
            ({"duration": 0.0}, "`duration`"),
            ({"duration": "long"}, "`duration`"),
            ({"domain": [(0.0, 1.0)]}, "`domain`"),
            ({"domain": [(0.0, 1.0), (1.0, 0.0)]}, r"`domain\[1\]`"),
            ({"domain": [(0.0, 1.0), 3.0]}, r"`domain\[1\]`"),
            ({"domain": "ab"}, "`domain`"),
            ({"max_evaluations": 0}, "`max_evaluations`"),
        ],
    )
    def test_misuse_is_an_input_error(self, changed: dict[str, Any], message: str) -> None:
        given = {"flow": flow(GYRE), "points": [[1.0, 0.5]], "duration": 1.0, **changed}
        with pytest.raises(errors.InputError, match=message):
            ftla.ftle_field(**given)


class TestRidges:
    def test_that_of_a_pendulum_is_its_separatrix(self) -> None:
        """The stable manifold of the upright rest: rate = 2 cos(angle/2)."""
        pendulum = ftla.vector_field(lambda x: (x.rate, -np.sin(x.angle)), ("angle", "rate"))
        spacing = 0.05
        points = grid(np.arange(-2.0, 2.01, spacing), np.arange(0.4, 2.61, spacing))
        field = ftla.ftle_field(flow(pendulum), points, 6.0)

        def gaps(ridges: list[ftla.Ridge]) -> Any:
            angle, rate = np.concatenate([ridge.points for ridge in ridges]).T
            return abs(rate - 2 * np.cos(angle / 2)) / np.hypot(1.0, np.sin(angle / 2)) / spacing

        # in pieces to a fifth of the spacing, smoothed in one, of the length of the separatrix, to a half
        high = 0.5 * (np.median(field.exponents) + field.exponents.max())
        sharp, smooth = field.ridges(smoothing=0.0, min_height=high), field.ridges()[:1]
        assert gaps(sharp).max() < 0.2 and gaps(sharp).mean() < 0.06
        assert gaps(smooth).max() < 0.5 and gaps(smooth).mean() < 0.1
        assert smooth[0].length > 4.3 > 3.0 < sum(ridge.length for ridge in sharp)
        ridge = smooth[0]
        assert (ridge.heights > 0.5 * field.exponents.max()).all() and (ridge.curvatures > 0).all()
        assert (ridge.heights > np.median(field.exponents)).all()

    def test_axes_may_be_either_way_and_others_constant(self) -> None:
        pendulum = ftla.vector_field(lambda x: (x.rate, -np.sin(x.angle), 0.0), ("angle", "rate", "idle"))
        angle, rate = np.linspace(-1, 1, 31), np.linspace(1.2, 2.4, 25)
        points = [
            np.stack([*np.meshgrid(angle, rate, indexing=order), np.full(shape, 0.5)], axis=-1)
            for order, shape in (("xy", (25, 31)), ("ij", (31, 25)))
        ]
        found = [ftla.ftle_field(flow(pendulum), each, 6.0).ridges()[0] for each in points]
        middles = [ridge.points[np.argmin(abs(ridge.points[:, 0]))] for ridge in found]
        np.testing.assert_allclose([middle[1] for middle in middles], 2.0, atol=0.02)

    @pytest.mark.parametrize(
        "points",
        [
            np.zeros((4, 2)),
            np.zeros((4, 4, 2)),
            grid([0.0, 1.0, 3.0], [0.0, 1.0, 2.0]),
            grid([1.0, 0.5, 0.0], [0.0, 0.5, 1.0]),
            grid([0.0, 1.0], [0.0, 0.5, 1.0]),
            np.random.default_rng(1).uniform(0.1, 0.9, (5, 5, 2)),
        ],
    )
    def test_what_is_no_grid_has_none(self, points: Any) -> None:
        field = ftla.ftle_field(flow(GYRE), points, 1.0)
        with pytest.raises(errors.InputError, match="must be a grid"):
            field.ridges()

    def test_criteria_are_numbers(self) -> None:
        field = ftla.ftle_field(flow(GYRE), grid([0.0, 1.0, 2.0], [0.0, 0.5, 1.0]), 1.0)
        with pytest.raises(errors.InputError, match="min_height"):
            field.ridges(min_height=np.nan)
        with pytest.raises(errors.InputError, match="smoothing"):
            field.ridges(smoothing=-1.0)
        assert field.ridges(min_height=1e9) == []


class TestConvergence:
    def test_rates_converge_and_directions_settle_at_their_gap(self) -> None:
        system = ftla.vector_field(lambda x: (x.a + 0.9 * x.b, -2.0 * x.b), ("a", "b"))
        found = ftla.exponent_convergence(flow(system).spectra([0.0, 0.0], np.arange(0.25, 10.1, 0.25)))
        assert found.success and found.growth == ("exponential", "exponential")
        np.testing.assert_allclose(found.rates, [-2.0, 1.0], atol=1e-2)
        np.testing.assert_allclose(found.gaps, 3.0, atol=1e-2)
        np.testing.assert_allclose(found.subspace_rates, 3.0, atol=0.1)
        assert found.subspace_changes[0] < 1e-6

    def test_few_times_are_not_enough(self) -> None:
        found = ftla.exponent_convergence(flow(LORENZ).spectra(START, [1.0, 2.0, 4.0]))
        assert not found.success and set(found.growth) == {"unknown"} and "fewer than 16" in found.message

    def test_misuse_is_an_input_error(self) -> None:
        spectra = flow(LORENZ).spectra(START, [1.0, 2.0])
        for given in ([], spectra[::-1], [*spectra, *flow(GYRE).spectra([0.1, 0.1], [3.0])]):
            with pytest.raises(errors.InputError):
                ftla.exponent_convergence(given)
        with pytest.raises((errors.InputError, TypeError)):
            ftla.exponent_convergence([1.0])  # type: ignore[list-item]
        with pytest.raises(errors.InputError, match="`tolerance`"):
            ftla.exponent_convergence(spectra, tolerance=-1.0)
