"""Figures: what is drawn, not how it looks."""

import itertools
import subprocess
import sys
from collections.abc import Iterator
from typing import Any, cast

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes

import somersault
from somersault import multibody, ocp, plotting, studies

mpl.use("Agg")


@pytest.fixture(autouse=True)
def _closed_figures() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture
def motion(body: somersault.RigidBody, state: somersault.State) -> somersault.Solution:
    return somersault.integrate(body, state, (0.0, 2.0), dt=0.01)


def test_arcs_of_an_optimal_motion_are_shaded_and_its_junctions_marked() -> None:
    # there and back below a ceiling: onto it at 0.3 s and off at 0.7 s
    problem = ocp.ControlProblem(
        lambda x, u: [x.v, u.force],
        states=("x", "v"),
        controls=("force",),
        initial=[0, 1],
        final=[0, -1],
        bounds={"x": (None, 0.1)},
        running_cost=lambda x, u: 0.5 * u.force**2,
    )
    found = problem.solve(tol=1e-4)
    plain = plotting.control_history(found)
    assert [ax.get_ylabel() for ax in plain] == ["states", "controls", "costates"]
    np.testing.assert_allclose(np.interp(0.5, *plain[0].lines[0].get_data()), 0.1, atol=1e-4)
    axes = plotting.control_history(problem.polish(found))
    assert [ax.get_ylabel() for ax in axes][-1] == "switching functions"
    for ax in axes:
        (shade,) = ax.patches
        assert (shade.get_x(), shade.get_width()) == pytest.approx((0.3, 0.4), abs=1e-9)
    marked = [line.get_xdata()[0] for line in axes[0].lines if line.get_linestyle() == ":"]
    assert marked == pytest.approx([0.3, 0.7], abs=1e-9)
    assert [text.get_text() for text in axes[0].get_legend().get_texts()] == ["state at its bound"]
    with pytest.raises(somersault.errors.InputError, match="`axes` must be 4 for this result, found 3"):
        plotting.control_history(problem.polish(found), plain)
    with pytest.raises(TypeError, match="`result` must be a CollocationResult or a PolishResult, found int"):
        plotting.control_history(cast("Any", 3))


@pytest.mark.parametrize("bounded", [False, True])
def test_a_switching_function_fills_its_panel_unless_it_is_rounding(bounded: bool) -> None:
    problem = ocp.ControlProblem(
        lambda x, u: [x.v, u.force],
        states=("x", "v"),
        controls=("force",),
        initial=[0, 0],
        final=[1, 0],
        bounds={"force": (-5, 5)} if bounded else {},
        running_cost=lambda x, u: 0.5 * u.force**2,
    )
    *_, costates, switching = plotting.control_history(problem.polish(problem.solve()))

    def range_of(ax: Axes, names: tuple[str, ...]) -> tuple[float, float]:
        values = np.concatenate([line.get_ydata() for line in ax.lines if line.get_label() in names])
        return float(np.nanmin(values)), float(np.nanmax(values))

    least, most = range_of(switching, ("force",))
    low, high = switching.get_ylim()
    if bounded:
        assert low < least < 0.0 < most < high
        assert most - least > 0.8 * (high - low)
    else:
        # ∂H/∂u is zero where no bound acts
        largest = max(map(abs, range_of(costates, ("x", "v"))))
        assert max(-least, most) < 1e-9 * largest
        assert (low, high) == pytest.approx((-largest, largest), rel=1e-9)


def test_no_two_methods_look_alike() -> None:
    looks = [plotting.style(name) for name in somersault.methods().names]
    assert len({(str(s["color"]), s["marker"], str(s["linestyle"])) for s in looks}) == len(looks)


def test_abbreviations_are_those_of_the_thesis() -> None:
    found = [plotting.abbreviation(name) for name in ("euler", "sie", "heun", "siabm4", "rkmk", "rkmk_b")]
    assert found == ["Euler", "SIE", "Heun", "SIABM4", "RKMK", "RKMK_B"]


def test_stability_regions_are_closed_curves_and_shared_ones_are_drawn_once() -> None:
    regions = {name: studies.stability_region(name) for name in ("euler", "mp", "heun")}
    ax = plotting.stability_regions(regions)
    assert len(ax.collections) == 2
    for curves in ax.collections:
        points = np.concatenate([path.vertices for path in curves.get_paths()])
        # Both half planes.
        assert points[:, 1].min() == pytest.approx(-points[:, 1].max())
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["Euler  (3.14)", "MP, Heun  (5.87)"]
    assert "lambda_R" in ax.get_xlabel()


def test_labels_stand_at_the_ends_of_their_lines_and_apart() -> None:
    ax = plt.figure(figsize=(5.0, 4.0), layout="constrained").add_subplot()
    for end, label in ((1.0, "high"), (0.02, "low"), (0.01, "lower"), (0.0, "_unnamed"), (np.nan, "gone")):
        ax.semilogy([0.0, 1.0, 2.0], [0.5, 0.5, end], label=label)
    plotting.label_ends(ax)
    labels = {text.get_text(): text for text in ax.texts}
    assert set(labels) == {"high", "low", "lower", "gone"}
    ax.figure.draw_without_rendering()
    boxes = [labels[name].get_window_extent() for name in ("lower", "low", "gone", "high")]
    assert all(above.y0 >= below.y1 for below, above in itertools.pairwise(boxes))
    for name, end in (("high", 1.0), ("gone", 0.5), ("lower", 0.01)):
        line = next(line for line in ax.lines if line.get_label() == name)
        assert labels[name].get_color() == line.get_color()
        place = ax.transAxes.inverted().transform(ax.transData.transform((0.0, end)))[1]
        assert labels[name].get_position()[1] == pytest.approx(place, abs=0.03)


def test_energy_ratios_point_to_what_is_beyond() -> None:
    ratios = {name: studies.energy(name, studies.prisms(3), steps=[1, 10]) for name in ("sie", "dmv2")}
    ax = plotting.energy_ratios(ratios, limits=(0.9, 1.1))
    arrows = [line for line in ax.lines if line.get_marker() == "^"]
    beyond = sum(int((study.max > 1.1).sum()) for study in ratios.values())
    assert len(arrows) == beyond > 0
    assert ax.get_yscale() == "log"


def test_observed_orders_stand_beside_the_stated() -> None:
    ax = plotting.observed_orders({"euler": 1.01, "rk4": 2.02}, {"euler": 1, "rk4": 2})
    stated, observed = ax.lines
    np.testing.assert_allclose(stated.get_ydata(), [1, 2])
    np.testing.assert_allclose(observed.get_ydata(), [1.01, 2.02])
    assert [label.get_text() for label in ax.get_xticklabels()] == ["Euler", "RK4"]


@pytest.mark.parametrize("error", ["orientation", "angular_velocity"])
@pytest.mark.parametrize("against", ["seconds", "evaluations", "steps"])
def test_work_precision_draws_what_was_measured(error: str, against: str) -> None:
    problem = studies.Problem.case(1)
    runs = {name: studies.work_precision(problem, name, [0.05, 0.02]) for name in ("mp", "rkmk")}
    ax = plotting.work_precision_diagram(runs, error, against)
    for line, run in zip(ax.lines, runs.values(), strict=True):
        np.testing.assert_allclose(line.get_ydata(), run.errors[error])
        np.testing.assert_allclose(line.get_xdata(), getattr(run, against))
    assert ("rad/s" in ax.get_ylabel()) == (error == "angular_velocity")


def test_work_precision_leaves_out_failed_runs() -> None:
    problem = studies.Problem.case(2)
    run = studies.work_precision(problem, "pmv8", [1.0, 0.01])
    assert np.isinf(run.errors["orientation"][0])
    (line,) = plotting.work_precision_diagram({"pmv8": run}).lines
    assert len(line.get_xdata()) == 1


def test_a_motion_has_four_panels(motion: somersault.Solution) -> None:
    axes = plotting.body_motion(motion)
    assert [len(ax.lines) for ax in axes] == [3, 3, 3, 1]
    np.testing.assert_allclose(axes[3].lines[0].get_ydata(), motion.kinetic_energy)
    assert axes[-1].get_xlabel() == "time, s"


def test_joints_of_a_tree_are_drawn_over_time() -> None:
    cart = multibody.cart_pendulum()
    swing = multibody.integrate_tree(cart, [0.0, 0.1], [0.0, 0.0], (0.0, 1.0), dt=0.1)
    ax = plotting.tree_motion(swing)
    assert ax.get_ylabel() == "travel, m; angle, rad"
    np.testing.assert_array_equal([np.ravel(line.get_ydata()) for line in ax.lines], swing.q.T)
    (line,) = plotting.tree_motion(swing, ["pendulum"]).lines
    assert line.get_label() == "pendulum"
    diver = multibody.diver_planar()
    markers = somersault.motion.MarkerSet.joint_centres(diver.model)
    seen = somersault.motion.place_markers(markers, [0.0], [diver.configuration("A")])
    fit = somersault.motion.MarkerFit(markers).fit(seen)
    assert len(plotting.tree_motion(fit).lines) == 9
    with pytest.raises(somersault.InputError, match="cart, pendulum, found 'pole'"):
        plotting.tree_motion(swing, ["pole"])


def test_what_is_drawn_otherwise_is_refused(
    motion: somersault.Solution, body: somersault.RigidBody, state: somersault.State
) -> None:
    cart = multibody.cart_pendulum()
    swing = multibody.integrate_tree(cart, [0.0, 0.1], [0.0, 0.0], (0.0, 1.0), dt=0.1)
    with pytest.raises(somersault.InputError, match="found a TreeSolution; `tree_motion` draws trees"):
        plotting.body_motion(swing)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="must hold the motion of a tree, found a Solution"):
        plotting.tree_motion(motion)
    with pytest.raises(somersault.InputError, match="`contacts` must be given"):
        plotting.gaps(somersault.exact.FreeBody(body, state)([0.0, 1.0]))


def test_a_polhode_lies_on_the_sphere(motion: somersault.Solution) -> None:
    ax = plotting.polhode([motion, motion])
    assert len(ax.lines) > 4
    x, y, z = (np.asarray(values, dtype=float) for values in ax.lines[0].get_data_3d())
    radius = np.sqrt(x * x + y * y + z * z)
    np.testing.assert_allclose(radius[np.isfinite(radius)], 1.0)


def test_figures_are_drawn_into_the_axes_given(motion: somersault.Solution) -> None:
    figure = plt.figure()
    ax = figure.add_subplot(projection="3d")
    assert plotting.polhode(motion, ax) is ax
    assert plt.get_fignums() == [figure.number]


def test_without_matplotlib_the_extra_is_named() -> None:
    program = "import sys; sys.modules['matplotlib'] = None; import somersault.plotting"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert "pip install 'somersault[plot]'" in run.stderr


def test_gaps_show_the_events() -> None:
    ball = somersault.contact.bouncing_ball(1.0, 0.1, somersault.contact.CompliantLaw(1e4), height=0.1)
    run = somersault.integrate(
        ball.body, ball.state, (0.0, 0.5), dt=1e-3, forces=ball.forces, contacts=ball.contacts
    )
    gap, force = plotting.gaps(run)
    labels = [text.get_text() for text in gap.get_legend().get_texts()]  # type: ignore[union-attr]
    assert labels == ["contact 0", "touch-down", "release"]
    touching = [event for event in run.events if event.kind == "touch_down"]
    drawn = {line.get_label(): line for line in gap.get_lines()}
    np.testing.assert_array_equal(drawn["touch-down"].get_xdata(), [event.t for event in touching])
    heights = np.asarray(drawn["contact 0"].get_ydata())
    np.testing.assert_allclose(heights, 1e3 * (run.position[:, 2] - 0.1), atol=1e-9)
    assert np.asarray(force.get_lines()[0].get_ydata()).max() > 100.0


def test_a_tree_is_drawn_as_ellipsoids_of_its_inertia() -> None:
    box = somersault.RigidBody.ellipsoid(2.0, (0.3, 0.2, 0.1))
    link = somersault.multibody.Link("body", "free", body=box, center=(0.0, 0.0, 0.5))
    model = somersault.Model([link])
    ax = plotting.tree_configuration(model, model.neutral())
    (ellipse,) = ax.patches
    # Full axes of the ellipsoid, as x and z see it.
    assert sorted((ellipse.width, ellipse.height)) == pytest.approx([0.2, 0.6])
    assert tuple(ellipse.center) == pytest.approx((0.0, 0.5))
    diver = somersault.multibody.diver_spatial()
    ax = plotting.tree_configuration(diver.model, diver.configuration("F"), "yz")
    assert len(ax.patches) == sum(body.mass > 0 for body in diver.model.links)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("y, m", "z, m")
