"""Dives: what is asked of them, what they keep to, and what ends a search."""

import itertools
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import somersault
from somersault import errors, multibody, ocp

Array = NDArray[np.float64]

COURSE = ((0.0, "A"), (0.25, "H"), (0.75, "H"), (1.0, "A"))


@pytest.fixture(scope="module")
def pike() -> ocp.DiveSolution:
    return ocp.dive_107b().solve()


@pytest.fixture(scope="module")
def twisting() -> ocp.DiveSolution:
    return ocp.dive_5174d().solve()


class TestForwardPike:
    """107B in the plane (thesis 3.1)."""

    def test_turns_three_and_a_half_somersaults_into_an_upright_entry(self, pike: ocp.DiveSolution) -> None:
        assert pike.success and pike.status == "converged"
        assert pike.somersaults[0] == pytest.approx(np.radians(10.0) / (2.0 * np.pi), abs=1e-12)
        assert pike.somersaults[-1] == pytest.approx(3.5, abs=1e-6)
        assert np.degrees(pike.entry_angle) < 1.0
        assert not pike.twists.any() and not pike.tilt.any()
        report = pike.report
        assert report.stationarity < 1e-5 and report.feasibility < 1e-7
        assert report.z.shape == pike.z.shape == (pike.dive.n_variables,)
        assert pike.duration == 1.7 and pike.lean == pytest.approx(np.radians(10.0))

    def test_sixteen_parameters_or_fewer(self, pike: ocp.DiveSolution) -> None:
        assert pike.dive.n_variables <= 16

    def test_the_weight_stays_between_the_postures(self, pike: ocp.DiveSolution) -> None:
        assert pike.channels.shape == (len(pike), 1)
        assert pike.channels.min() > -1e-8 and pike.channels.max() < 1.0 + 1e-8
        assert pike.channels[[0, -1]] == pytest.approx(0.0, abs=1e-12)
        assert pike.channel_rates[[0, -1]] == pytest.approx(0.0, abs=1e-10)
        middle = (pike.t > 0.45 * pike.duration) & (pike.t < 0.6 * pike.duration)
        assert pike.channels[middle].min() > 0.95

    def test_joints_are_those_of_the_weights(self, pike: ocp.DiveSolution) -> None:
        diver = multibody.diver_planar()
        a, h = (diver.configuration(p)[3:] for p in "AH")
        np.testing.assert_allclose(pike.q[:, 3:], a + pike.channels * (h - a), atol=1e-14)
        np.testing.assert_allclose(pike.v[:, 3:], pike.channel_rates * (h - a), atol=1e-12)

    def test_angular_momentum_is_constant_to_rounding(self, pike: ocp.DiveSolution) -> None:
        # of the states themselves, by the model
        model = pike.dive.diver.model
        own = np.array([(model.centroidal_matrix(q) @ v)[4] for q, v in zip(pike.q, pike.v, strict=True)])
        np.testing.assert_allclose(pike.angular_momentum[:, 1], own, rtol=1e-12)
        np.testing.assert_allclose(own, pike.momentum, rtol=1e-12)

    def test_the_centre_of_mass_falls_freely(self, pike: ocp.DiveSolution) -> None:
        model = pike.dive.diver.model
        height = np.array([model.center_of_mass(q)[2] for q in pike.q])
        start = pike.verify()
        expected = start.take_off[2] + start.take_off_velocity[2] * pike.t - 0.5 * 9.81 * pike.t**2
        np.testing.assert_allclose(height, expected, atol=1e-9)

    def test_feet_leave_the_platform_and_hands_enter_ahead(self, pike: ocp.DiveSolution) -> None:
        model = pike.dive.diver.model
        toes, hand = model.body("toes"), model.body("hand")
        np.testing.assert_allclose(model.poses(pike.q[0])[toes][[0, 2], 3], (0.0, 10.0), atol=1e-9)
        np.testing.assert_allclose(model.poses(pike.q[-1])[hand][[0, 2], 3], (2.0, 0.0), atol=1e-9)

    def test_holds_when_integrated_anew(self, pike: ocp.DiveSolution) -> None:
        verified = pike.verify()
        assert verified.somersaults == pytest.approx(3.5, abs=1e-4)
        assert np.degrees(verified.entry_angle) < 1.0
        assert verified.defect < 1e-3
        assert verified.momentum_drift < 1e-12
        assert verified.full_dynamics_defect < 1e-8
        assert verified.least_channel > -1e-8 and verified.greatest_sum < 1.0 + 1e-8
        assert verified.least_distance is None and verified.nearest_limbs is None
        assert verified.nearest_time is None
        assert verified.entry_defect == pytest.approx(
            2.0 * np.pi * abs(verified.somersaults - 3.5), abs=1e-12
        )

    def test_holds_in_a_flight_of_the_library(self, pike: ocp.DiveSolution) -> None:
        """`multibody.fly` with the joints as splines of the solution, made by SciPy."""
        from scipy.interpolate import make_interp_spline

        spline = make_interp_spline(pike.t, pike.q[:, 3:], k=5)
        rate = spline.derivative()
        flown = multibody.fly(
            pike.dive.diver.model,
            pike.q[0],
            pike.v[0],
            lambda t: (spline(t), rate(t)),
            (0.0, pike.duration),
            rtol=1e-9,
            atol=1e-9,
        )
        assert flown.q[-1, 2] == pytest.approx(pike.q[-1, 2], abs=2e-3)

    def test_phases_are_layout_pike_layout(self, pike: ocp.DiveSolution) -> None:
        assert [name for name, _, _ in pike.phases] == ["A", "H", "A"]
        starts, ends = zip(*((start, end) for _, start, end in pike.phases), strict=True)
        assert starts[0] == 0.0 and ends[-1] == pike.duration
        assert starts[1:] == ends[:-1]
        # a late exit, as in 4.2.1
        assert starts[-1] > 0.7 * pike.duration

    def test_joint_forces_do_the_work_and_nothing_pushes_the_root(self, pike: ocp.DiveSolution) -> None:
        model = pike.dive.diver.model
        own = np.array(
            [model.inverse_dynamics(q, v, a) for q, v, a in zip(pike.q, pike.v, pike.a, strict=True)]
        )
        size = np.abs(pike.torques).max()
        np.testing.assert_allclose(own, pike.torques, atol=1e-9 * size)
        assert not pike.torques[:, :3].any()
        assert len(pike.peak_torques) == 9
        largest, when = max(pike.peak_torques.values(), key=lambda peak: abs(peak[0]))
        assert abs(largest) == size and 0.0 <= when <= pike.duration
        assert pike.verify().peak_torques == pike.peak_torques

    def test_the_literal_dive_drifts(self, pike: ocp.DiveSolution) -> None:
        drifts = []
        for n in (200, 400):
            literal = pike.literal(n)
            assert len(literal) == n + 1 and literal.report is None
            assert literal.angular_momentum[0] == pytest.approx(pike.momentum, rel=1e-12)
            model = pike.dive.diver.model
            own = [(model.centroidal_matrix(literal.q[k]) @ literal.v[k])[4] for k in (0, n // 2, n)]
            np.testing.assert_allclose(literal.angular_momentum[[0, n // 2, n]], own, rtol=1e-12)
            drifts.append(literal.momentum_change)
        # order one
        assert abs(drifts[0]) > 0.01 and drifts[0] / drifts[1] == pytest.approx(2.0, abs=0.2)
        along = pike.literal_momentum(200)
        assert along.shape == (201,) and abs(along[-1] / along[0] - 1.0) > 0.01

    def test_momentum_is_lost_relative_to_what_there_was(self, pike: ocp.DiveSolution) -> None:
        back = ocp.dive_107b(somersaults=-2.5, lean=-0.1, momentum=(-500.0, 0.0)).solve()
        assert back.success and back.momentum < 0.0
        for found in (pike, back):
            literal = found.literal()
            first, last = np.abs(literal.angular_momentum[[0, -1]])
            assert literal.momentum_change == pytest.approx(last / first - 1.0, rel=1e-12)
            assert f"momentum {100.0 * literal.momentum_change:+.1f} %" in repr(literal)
        # a fall without rotation has none that anything could be relative to
        falling = ocp.dive_107b(somersaults=0.0, lean=0.0, momentum=(-500.0, 500.0))
        z = falling.start()
        z[-1] = 0.0
        literal = falling.solve(z, max_iterations=0).literal()
        change = literal.angular_momentum[-1] - literal.angular_momentum[0]
        unit = falling.diver.mass * falling.diver.height**2
        assert abs(change) > 1e-3 and literal.momentum_change == pytest.approx(1e3 * change / unit, rel=1e-9)

    def test_many_coefficients_take_no_more_steps(self) -> None:
        for n_par in (31, 54):
            found = ocp.dive_107b(n_par=n_par).solve(max_iterations=12)
            assert found.success and found.confirmed, (n_par, found.status)

    def test_the_literal_dive_is_solved(self, pike: ocp.DiveSolution) -> None:
        literal = pike.literal(optimise=True)
        assert literal.report is not None and literal.report.success
        assert abs(literal.momentum_change) > 0.001
        assert literal.somersaults[0] == pytest.approx(pike.somersaults[0], abs=1e-12)
        assert literal.somersaults[-1] == pytest.approx(pike.somersaults[-1], abs=1e-6)

    def test_a_literal_dive_is_of_one_kind(self) -> None:
        found = ocp.dive_107b(duration=(1.6, 1.7)).solve(max_iterations=1)
        with pytest.raises(errors.InputError, match="literal"):
            found.literal()
        with pytest.raises(errors.InputError, match="n_steps"):
            ocp.dive_107b().solve(max_iterations=1).literal(0)

    def test_a_warm_start_is_there_at_once(self, pike: ocp.DiveSolution) -> None:
        again = pike.dive.solve(pike)
        assert again.success
        assert again.report.nit < pike.report.nit
        assert again.report.cost == pytest.approx(pike.report.cost, rel=1e-6)

    def test_starts_find_what_the_template_finds(self, pike: ocp.DiveSolution) -> None:
        found = pike.dive.search(3, seed=7)
        assert len(found) == 3
        assert found[0].report.cost == pytest.approx(pike.report.cost, rel=1e-4)
        assert all(a.report.cost <= b.report.cost for a, b in itertools.pairwise(found) if b.success)


class TestOptions:
    """Every argument is open."""

    def test_another_diver_and_another_flight(self) -> None:
        small = multibody.diver_planar(mass=50.0, height=1.55)
        dive = ocp.dive_107b(diver=small, duration=1.6, lean=0.1, entry_distance=1.5, n_par=12)
        found = dive.solve()
        assert found.success
        assert found.duration == 1.6 and found.lean == 0.1
        assert found.somersaults[-1] == pytest.approx(3.5, abs=1e-6)
        assert dive.diver.mass == 50.0
        assert dive.options["n_par"] == 12 and dive.options["duration"] == (1.6, 1.6)

    def test_a_free_duration_stays_in_its_range(self) -> None:
        found = ocp.dive_107b(duration=(1.5, 1.75)).solve()
        assert found.success
        assert 1.5 <= found.duration <= 1.75
        # longer flight, less momentum
        assert found.momentum < ocp.dive_107b(duration=1.5).solve().momentum

    def test_a_third_posture_changes_little(self, pike: ocp.DiveSolution) -> None:
        third = ocp.dive_107b(postures="AHG", template=COURSE).solve()
        assert third.success and third.channels.shape[1] == 2
        assert third.report.cost <= pike.report.cost * (1.0 + 1e-6)
        assert third.momentum == pytest.approx(pike.momentum, rel=0.05)

    def test_joints_without_eigenpostures(self, pike: ocp.DiveSolution) -> None:
        free_joints = ocp.dive_107b(channels="joints").solve(max_iterations=300)
        assert free_joints.channels.shape[1] == 9
        assert free_joints.phases == []
        assert free_joints.report.cost < pike.report.cost

    def test_replace_keeps_the_rest(self) -> None:
        dive = ocp.dive_107b(n_par=12, rate_penalty=5e-3)
        other = dive.replace(somersaults=2.5)
        assert other.options | {"somersaults": 3.5} == dive.options
        assert other.template == dive.template == [(s, p) for s, p in COURSE]

    def test_postures_as_angles(self, pike: ocp.DiveSolution) -> None:
        diver = multibody.diver_planar()
        angles = [diver.configuration(p)[3:] for p in "AH"]
        dive = ocp.Dive(diver, angles, template=[(s, "AH".index(p)) for s, p in COURSE])
        assert dive.postures == ("0", "1")
        assert dive.solve().report.cost == pytest.approx(pike.report.cost, rel=1e-9)

    def test_a_start_is_near_its_course(self) -> None:
        dive = ocp.dive_107b()
        np.testing.assert_array_equal(dive.start(), dive.start(COURSE))
        assert dive.start([(0.0, "A"), (0.5, "H"), (1.0, "A")]).shape == (dive.n_variables,)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n_par": 5}, "`n_par`"),
        ({"duration": -1.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"duration": (1.8, 1.2)}, "duration"),
        ({"lean": (0.2, 0.1)}, "lean"),
        ({"momentum": (0.0, np.inf)}, "momentum"),
        ({"momentum_penalty": -1.0}, "`momentum_penalty`"),
        ({"rate_penalty": np.nan}, "`rate_penalty`"),
        ({"somersaults": np.inf}, "somersaults"),
        ({"platform": np.nan}, "platform"),
        ({"square_out": 0.0}, "square_out"),
        ({"n_steps": 0}, "n_steps"),
        ({"n_pieces": 0}, "n_pieces"),
        ({"postures": ["A", "A"]}, "posture"),
        ({"postures": ["A", "X"]}, "X"),
        ({"postures": ["A", "C"]}, "planar"),
        ({"postures": [[0.0] * 8, [0.1] * 8]}, "postures"),
        ({"postures": [[0.0] * 9, [9.0] * 9]}, "range"),
        ({"first": "G"}, "first"),
        ({"last": 5}, "last"),
        ({"channels": "wings"}, "channels"),
        ({"template": [(0.0, "F"), (1.0, "A")]}, "template"),
    ],
)
def test_bad_arguments_are_named(changes: dict[str, object], message: str) -> None:
    with pytest.raises(errors.InputError, match=message):
        ocp.dive_107b(**changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "template",
    [
        [],
        [(0.0, "A")],
        [(0.1, "A"), (1.0, "A")],
        [(0.0, "A"), (0.9, "A")],
        [(0.0, "A"), (0.0, "H"), (1.0, "A")],
    ],
)
def test_a_template_runs_from_start_to_end(template: list[tuple[float, str]]) -> None:
    with pytest.raises(errors.InputError, match="`template`"):
        ocp.dive_107b().start(template)


def test_an_unknown_argument_is_named() -> None:
    with pytest.raises(TypeError, match="somersalts"):
        ocp.dive_107b(somersalts=3.5)  # type: ignore[call-arg]


def test_a_dive_without_a_template_asks_for_a_start() -> None:
    dive = ocp.Dive(multibody.diver_planar(), "AH")
    with pytest.raises(errors.InputError, match="template"):
        dive.solve()
    with pytest.raises(errors.InputError, match="`z`"):
        dive.solve(np.zeros(3))
    with pytest.raises(errors.InputError, match="`z`"):
        dive.solve(np.full(dive.n_variables, np.nan))
    with pytest.raises(errors.InputError, match="on_interrupt"):
        dive.solve(np.zeros(dive.n_variables), on_interrupt="ignore")  # type: ignore[arg-type]


class TestEndings:
    """What ends a search keeps its best iterate."""

    def test_a_callback_stops(self) -> None:
        seen = []

        def callback(iteration: int, z: Array, cost: float, residual: float) -> bool:
            seen.append(iteration)
            return iteration >= 2

        found = ocp.dive_107b().solve(callback=callback)
        assert found.status == "stopped" and not found.success
        assert seen[-1] == 2 and np.isfinite(found.report.cost)

    def test_an_error_in_a_callback_keeps_the_solution(self) -> None:
        def callback(*_: object) -> bool:
            raise KeyError("mine")

        with pytest.raises(KeyError, match="mine") as caught:
            ocp.dive_107b().solve(callback=callback)
        assert caught.value.solution.q.shape[1] == 12  # type: ignore[attr-defined]

    def test_limits_end_in_a_status(self) -> None:
        assert ocp.dive_107b().solve(max_iterations=1).status == "iteration_limit"
        found = ocp.dive_5174d().solve(max_time=0.2)
        assert found.status == "time_limit" and np.isfinite(found.q).all()

    @pytest.mark.skipif(sys.platform == "win32", reason="signals to a child need a console there")
    @pytest.mark.parametrize("call", ["solve(tol=1e-15, max_iterations=10**6)", "search(8)"])
    def test_ctrl_c_gives_the_best_iterate(self, call: str) -> None:
        script = f"""
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in background shells
import time
import numpy as np
from somersault import ocp
dive = ocp.dive_5174d()
print("ready", flush=True)
try:
    dive.{call}
except KeyboardInterrupt as error:
    now, found = time.monotonic(), error.solution
found = found[0] if isinstance(found, list) else found
print(now, found.status, np.isfinite(found.q).all(), sep="|")
"""
        process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        with process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            time.sleep(0.5)
            sent = time.monotonic()
            process.send_signal(signal.SIGINT)
            fields = process.communicate(timeout=60)[0].strip().split("|")
        assert float(fields[0]) - sent < 5.0
        assert fields[1:] == ["interrupted", "True"]


class TestForwardTwisting:
    """5174D in space (thesis 3.2), found once."""

    def test_turns_and_twists_into_an_upright_entry(self, twisting: ocp.DiveSolution) -> None:
        assert twisting.dive.n_variables <= 92
        assert twisting.success, twisting.report
        assert twisting.report.stationarity < 1e-6 and twisting.report.feasibility < 1e-8
        assert twisting.somersaults[-1] == pytest.approx(3.5, abs=2e-3)
        assert twisting.twists[-1] == pytest.approx(2.0, abs=2e-3)
        assert np.degrees(twisting.entry_angle) < 1.0

    def test_keeps_momentum_bounds_and_distances(self, twisting: ocp.DiveSolution) -> None:
        np.testing.assert_allclose(
            twisting.angular_momentum, np.tile((0.0, twisting.momentum, 0.0), (len(twisting), 1)), atol=1e-9
        )
        verified = twisting.verify()
        assert verified.least_channel > -1e-6 and verified.greatest_sum < 1.0 + 1e-6
        assert verified.momentum_drift < 1e-11
        assert np.degrees(verified.entry_angle) < 1.0
        assert verified.somersaults == pytest.approx(3.5, abs=2e-3)
        assert verified.twists == pytest.approx(2.0, abs=2e-3)
        assert verified.least_distance is not None and verified.least_distance >= 0.005
        assert verified.nearest_limbs is not None and verified.nearest_time is not None
        assert verified.entry_defect <= verified.allowed and twisting.confirmed

    def test_its_mirror_image_has_the_same_variables(self, twisting: ocp.DiveSolution) -> None:
        other = ocp.dive_5174d(twists=-2)
        assert other.postures == twisting.dive.mirrored().postures == ("C", "A", "E", "D", "mirrored I", "H")
        assert other.options == twisting.dive.mirrored().options
        image = other.solve(twisting.z, soft_weights=[], max_iterations=0)
        assert image.confirmed, image.message
        np.testing.assert_allclose(image.z, twisting.z, atol=1e-12)
        np.testing.assert_allclose(image.twists, -twisting.twists, atol=1e-9)
        np.testing.assert_allclose(image.tilt, -twisting.tilt, atol=1e-9)
        np.testing.assert_allclose(image.somersaults, twisting.somersaults, atol=1e-9)
        solved = other.solve(twisting.z, soft_weights=[])
        assert solved.success and solved.momentum == pytest.approx(twisting.momentum, rel=1e-6)
        back = other.replace(twists=2)
        assert back.postures == twisting.dive.postures and back.template == twisting.dive.template

    def test_the_stored_dive_of_the_notebook_is_this_one(self, twisting: ocp.DiveSolution) -> None:
        path = Path(__file__).parents[2] / "python" / "notebooks" / "dive_5174d.som"
        stored = somersault.load(path)
        np.testing.assert_allclose(
            stored.z, twisting.z, atol=1e-4, err_msg="`make notebooks` stores it again"
        )
        assert stored.dive.options == twisting.dive.options
        assert stored.momentum == pytest.approx(twisting.momentum, rel=1e-8) and stored.confirmed

    def test_rates_are_those_of_the_angles(self, twisting: ocp.DiveSolution) -> None:
        for angle, rate in (
            (2.0 * np.pi * twisting.somersaults, twisting.somersault_rate),
            (2.0 * np.pi * twisting.twists, twisting.twist_rate),
            (twisting.tilt, twisting.tilt_rate),
        ):
            found = np.gradient(angle, twisting.t, edge_order=2)
            assert np.abs(found - rate).max() < 0.05 * np.abs(rate).max()

    def test_the_order_is_that_of_a_competition(self, twisting: ocp.DiveSolution) -> None:
        names = [name for name, _, _ in twisting.phases]
        assert names == ["C", "E", "A", "E", "C", "H", "A"]
        # somersault, throw, twists, square-out, pike, entry
        tilted = int(np.argmax(np.abs(twisting.tilt) > np.radians(1.0)))
        assert twisting.somersaults[tilted] > 0.85 and twisting.twists[tilted] < 0.05
        squared = twisting.t > 0.7 * twisting.duration
        assert np.abs(twisting.twists[squared] - 2.0).max() < 1e-6
        assert np.abs(twisting.tilt[squared]).max() < 1e-6


class TestHalfTwists:
    """Dives that end facing the other way."""

    def test_the_state_is_continuous_and_the_count_the_one_requested(self) -> None:
        # was solved with a half turn between two nodes: one twist for a half, 26° off the vertical in flight
        found = ocp.dive_5174d(somersaults=2.5, twists=0.5, duration=1.8).solve()
        assert found.success, found.message
        assert np.abs(np.diff(found.twists)).max() < 0.05 and np.abs(np.diff(found.somersaults)).max() < 0.05
        assert found.twists[-1] == pytest.approx(0.5, abs=1e-6)
        judged = found.verification
        assert judged.twists == pytest.approx(0.5, abs=1e-4)
        assert judged.somersaults == pytest.approx(2.5, abs=1e-4)
        assert np.degrees(judged.entry_angle) < 0.1 and judged.defects.max() < 1e-3
        # flown by the library with the joints as they were found
        from scipy.interpolate import make_interp_spline

        spline = make_interp_spline(found.t, found.q[:, 7:], k=5)
        rate = spline.derivative()
        flown = multibody.fly(
            found.dive.diver.model,
            found.q[0],
            found.v[0],
            lambda t: (spline(t), rate(t)),
            (0.0, found.duration),
            rtol=1e-9,
            atol=1e-9,
        )
        turn = abs(float(flown.q[-1, 3:7] @ found.q[-1, 3:7]))
        assert 2.0 * np.arccos(min(turn, 1.0)) < 2e-3

    def test_the_arms_undo_the_tilt_as_the_mirror_image_of_the_throw(self) -> None:
        def arms(twists: float) -> list[str]:
            template = ocp.dive_5174d(twists=twists).template
            assert template is not None
            return [name for _, name in template if name in "DE"]

        assert arms(2) == ["E", "E"] and arms(0.5) == arms(1.5) == ["E", "D"] and arms(0) == []
        assert arms(-2) == ["D", "D"] and arms(-1.5) == ["D", "E"]
        back = ocp.dive_5174d(somersaults=-2.5, twists=1, momentum=(-500.0, 0.0))
        assert back.postures == ocp.dive_5174d(twists=-1).postures

    def test_a_quarter_twist_is_refused_where_the_body_would_leave_its_plane(self) -> None:
        with pytest.raises(errors.InputError, match=r"`twists` must be a multiple of ½.*0\.25"):
            ocp.dive_5174d(twists=0.25)
        assert ocp.dive_5174d(twists=0.25, square_out=1.0).options["twists"] == 0.25

    def test_a_named_dive_stays_one_in_files(self) -> None:
        dive = pickle.loads(pickle.dumps(ocp.dive_5174d(twists=0.5)))
        assert dive.replace(twists=-1).postures == ocp.dive_5174d(twists=-1).postures
        own = ocp.dive_5174d(postures=["C", "A", "D", "E", "I", "H"], twists=-1)
        assert own.postures == ("C", "A", "D", "E", "I", "H")
        assert own.replace(postures=own.mirrored().postures).postures[4] == "mirrored I"
        planar = ocp.dive_107b().mirrored()
        assert planar.postures == ("A", "H")
