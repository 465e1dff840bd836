//! Optima with closed forms: states, controls, costates, free horizons, bounds that act, several phases.

use crate::known;
use somersault_core::Scalar;
use somersault_multibody::models::CartPendulum;
use somersault_nlp::{Flow, Sqp, Status};
use somersault_ocp::collocation::{
    Collocation, CollocationReport, CollocationStatus, Dynamics, Ends, Guess, Interval, Linkage, Mesh, Phase,
    Point, Problem, Terms, TreeDynamics,
};

fn solve(phase: Phase, mesh: Mesh, tolerance: f64) -> CollocationReport {
    solve_phases(Problem::try_new(phase).unwrap(), &[mesh], tolerance)
}

fn solve_phases(mut problem: Problem, meshes: &[Mesh], tolerance: f64) -> CollocationReport {
    let collocation = Collocation { tolerance, ..Collocation::default() };
    let report = collocation.solve(&mut problem, meshes, &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::Converged, "{:?}", report.history);
    report
}

fn uniform(intervals: usize, points: usize) -> Mesh {
    Mesh::try_uniform(intervals, points).unwrap()
}

fn half<T: Scalar>() -> T {
    nalgebra::convert(0.5)
}

/// Success means that the cost is right to ten times the tolerance. The example `collocation_optima` solves all of them to
/// 10⁻⁸ as well.
#[test]
fn known_costs_are_met_where_a_search_says_so() {
    // what takes seconds, or is said not to be solved
    let slow = |name: &str, tolerance: f64| {
        let to_any = name.starts_with("Goddard");
        to_any
            || (tolerance < 1e-7
                && (name.contains("Denham")
                    || name.contains("fuel")
                    || name.contains("oscillator")
                    || name.ends_with("pendulum")))
    };
    for tolerance in [1e-6, 1e-8] {
        for known in known::ALL.iter().filter(|known| !slow(known.name, tolerance)) {
            let report = solve_phases(known.problem(), &[known.mesh()], tolerance);
            let error = (report.cost - known.cost).abs() / known.cost.abs().max(1.0);
            assert!(
                error <= 10.0 * tolerance,
                "{}, {tolerance}: {} is off by {error}",
                known.name,
                report.cost
            );
            assert!(report.accuracy().cost <= tolerance && report.accuracy().shortfall(tolerance).is_none());
        }
    }
}

/// From a straight line the program of least time has no motion; one of least effort on a longer horizon leads to it.
#[test]
fn the_least_time_of_a_pendulum_is_found_from_a_straight_line_through_least_effort() {
    let known = known::ALL.iter().find(|known| known.name == "least time, pendulum").unwrap();
    let solver = Sqp { crossover: false, ..Collocation::default().solver };
    let collocation = Collocation { solver, ..Collocation::default() };
    let report = collocation.solve(&mut known.problem(), &[known.mesh()], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::Converged, "{:?}", report.history);
    let starts: Vec<_> = report.history.iter().map(|mesh| mesh.is_start).collect();
    assert!(!starts[0] && starts[1] && !starts[starts.len() - 1], "{starts:?}");
    assert!(!report.history[0].status.is_converged());
    let effort = report.history.iter().rfind(|mesh| mesh.is_start).unwrap();
    assert!(effort.status.is_converged() && effort.accuracy.equations.is_infinite(), "{effort:?}");
    assert!((report.cost - known.cost).abs() < 1e-6, "{}", report.cost);
}

/// Any of u + 2πk solves the program at a point. From a straight line Newton's steps leave a k of its own at each, which is no motion
/// between the points.
#[test]
fn angles_that_a_program_winds_up_are_unwound() {
    let known = known::ALL.iter().find(|known| known.name == "brachistochrone").unwrap();
    for mesh in [uniform(20, 3), uniform(10, 4), uniform(25, 4)] {
        let report = solve_phases(known.problem(), &[mesh], 1e-6);
        assert!((report.cost - known.cost).abs() < 1e-6, "{}", report.cost);
        let angles: Vec<f64> = report.phases[0].controls.iter().map(|u| u[0]).collect();
        assert!(angles.windows(2).all(|pair| pair[1] < pair[0] && pair[0] < 2.0), "{angles:?}");
    }
}

/// Where no horizon within the bounds has a motion, that is what is said, with all that was tried.
#[test]
fn a_block_that_cannot_arrive_in_time_is_infeasible_after_all_horizons() {
    let phase = Phase::new(DoubleIntegrator, Timed(1.0))
        .initial_state([0.0, 0.0])
        .final_state([1.0, 0.0])
        .control_bounds([Interval::new(-1.0, 1.0)])
        .horizon(0.0, Interval::new(0.5, 1.8));
    let mut problem = Problem::try_new(phase).unwrap();
    let report =
        Collocation::default().solve(&mut problem, &[uniform(10, 3)], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::NotSolved(Status::Infeasible));
    // the last mesh is that of the solution
    let (last, starts) = report.history.split_last().unwrap();
    assert!(!last.is_start && starts.len() > 1 && starts.iter().all(|mesh| mesh.is_start));
    assert!(report.history.iter().all(|mesh| mesh.status == Status::Infeasible), "{:?}", report.history);
}

/// What a mesh does not reach is said, with what is not.
#[test]
fn a_mesh_that_is_too_coarse_for_the_cost_is_no_success() {
    let known = known::ALL.iter().find(|known| known.name == "Bryson and Denham, 0.02").unwrap();
    let collocation = Collocation { max_meshes: 2, ..Collocation::default() };
    let report = collocation.solve(&mut known.problem(), &[known.mesh()], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::MeshLimit);
    let error = (report.cost - known.cost).abs() / known.cost;
    let estimate = report.accuracy().cost;
    assert!(error > 1e-4 && estimate > 0.3 * error && estimate < 100.0 * error, "{error} {estimate}");
    let said = report.accuracy().shortfall(1e-6).unwrap();
    assert!(said.contains("error of the cost"), "{said}");
}

/// From rest to rest with least effort the cost is 6/T³: the longer the better. A bound beyond which nothing is gained, or a
/// cost of the time, makes a minimum: 6/T³ + T is least, 4/3 · 18^(1/4), at T = 18^(1/4).
#[test]
fn effort_alone_over_a_free_time_has_no_minimum() {
    let phase = |terms: Timed, end: Interval| {
        Phase::new(DoubleIntegrator, terms)
            .initial_state([0.0, 0.0])
            .final_state([1.0, 0.0])
            .horizon(0.0, end)
    };
    let solved = |phase: Phase| {
        let mut problem = Problem::try_new(phase).unwrap();
        Collocation::default().solve(&mut problem, &[uniform(10, 4)], &mut |_| Flow::Continue).unwrap()
    };
    for end in [Interval::at_least(0.1), Interval::new(0.1, 1e6)] {
        let report = solved(phase(Timed(0.0), end));
        assert_eq!(report.status, CollocationStatus::NoMinimum, "T = {:?}", report.phases[0].horizon());
    }
    let report = solved(phase(Timed(0.0), Interval::new(0.1, 4.0)));
    assert_eq!(report.status, CollocationStatus::Converged);
    assert!((report.cost - 6.0 / 64.0).abs() < 1e-8, "{}", report.cost);
    let report = solved(phase(Timed(1.0), Interval::at_least(0.1)));
    assert_eq!(report.status, CollocationStatus::Converged);
    assert!((report.cost - 4.0 / 3.0 * 18f64.powf(0.25)).abs() < 1e-7, "{}", report.cost);
}

/// ½ ∫ u² dt and a cost of each second.
struct Timed(f64);

impl Terms for Timed {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        at.control[0] * at.control[0] * half()
    }
    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        ends.final_time * nalgebra::convert(self.0)
    }
}

/// ẋ = −x + u with cost ½ ∫ x² + u² dt, hyper-sensitive over a long time.
struct Decay;

impl Dynamics for Decay {
    fn n_states(&self) -> usize {
        1
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.control[0] - at.state[0];
    }
}

impl Terms for Decay {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        (at.state[0] * at.state[0] + at.control[0] * at.control[0]) * half()
    }
}

/// x and λ of [`Decay`] from 1 to 1.5 over T: x = a e^{−√2 t} + b e^{√2 (t − T)}, λ = −u = −ẋ − x.
fn decay(t: f64, end: f64) -> (f64, f64) {
    let root = 2f64.sqrt();
    let whole = (-root * end).exp();
    let b = (1.5 - whole) / (1.0 - whole * whole);
    let a = 1.0 - b * whole;
    let (falling, rising) = (a * (-root * t).exp(), b * (root * (t - end)).exp());
    (falling + rising, (root - 1.0) * falling - (root + 1.0) * rising)
}

#[test]
fn the_hypersensitive_linear_problem_has_its_closed_form_states_controls_and_costates() {
    for end in [10.0, 40.0] {
        let phase = Phase::new(Decay, Decay).initial_state([1.0]).final_state([1.5]).horizon(0.0, end);
        let report = solve(phase, uniform(10, 4), 1e-8);
        let phase = &report.phases[0];
        for i in 0..=200 {
            let t = end * i as f64 / 200.0;
            let (x, costate) = decay(t, end);
            assert!((phase.state(t)[0] - x).abs() < 1e-7, "x({t}) = {}, not {x}", phase.state(t)[0]);
            assert!(
                (phase.control(t)[0] + costate).abs() < 3e-6,
                "u({t}) = {}, not {}",
                phase.control(t)[0],
                -costate
            );
            assert!(
                (phase.costate(t)[0] - costate).abs() < 3e-6,
                "λ({t}) = {}, not {costate}",
                phase.costate(t)[0]
            );
        }
        assert!(report.confirmation.max_defect() < 1e-8);
        assert!(phase.hamiltonian_spread() < 1e-6, "spread {}", phase.hamiltonian_spread());
    }
}

/// The end of a phase decides where the next one begins, and what it costs is what one phase costs.
#[test]
fn two_linked_phases_are_one() {
    let first = Phase::new(Decay, Decay).initial_state([1.0]).horizon(0.0, 3.0).final_state([Interval::FREE]);
    let second = Phase::new(Decay, Decay)
        .initial_state([Interval::FREE])
        .final_state([1.5])
        .horizon(Interval::new(0.0, 9.0), 10.0);
    let problem = Problem::try_of_phases(vec![first, second], Linkage::continuous(0, 1, 1)).unwrap();
    let report = solve_phases(problem, &[uniform(6, 4), uniform(6, 4)], 1e-8);
    for (phase, times) in report.phases.iter().zip([[0.0, 1.1, 2.9], [3.1, 7.0, 9.9]]) {
        for t in times {
            let (x, costate) = decay(t, 10.0);
            assert!((phase.state(t)[0] - x).abs() < 1e-7);
            assert!((phase.costate(t)[0] - costate).abs() < 3e-6, "λ({t})");
        }
    }
    let [end, start] = [report.phases[0].costate(3.0)[0], report.phases[1].costate(3.0)[0]];
    assert!((end - start).abs() < 1e-6, "the costate jumps from {end} to {start}");
}

/// ẋ = v, v̇ = u.
struct DoubleIntegrator;

impl Dynamics for DoubleIntegrator {
    fn n_states(&self) -> usize {
        2
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.state[1];
        rates[1] = at.control[0];
    }
}

struct LeastTime;

impl Terms for LeastTime {
    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        ends.final_time - ends.initial_time
    }
}

/// From rest at 0 to rest at 1 with |u| ≤ 1: T = 2, u switches from 1 to −1 at t = 1, λ = (−1, t − 1), H = −1 on top of
/// which ∂Φ/∂T = 1. No bound of the first mesh is at the switch.
#[test]
fn the_double_integrator_goes_from_rest_to_rest_in_least_time() {
    let phase = Phase::new(DoubleIntegrator, LeastTime)
        .initial_state([0.0, 0.0])
        .final_state([1.0, 0.0])
        .control_bounds([Interval::new(-1.0, 1.0)])
        .horizon(0.0, Interval::new(-5.0, 10.0))
        .guess(Guess {
            times: vec![0.0, 3.0],
            states: vec![vec![0.0, 0.0], vec![1.0, 0.0]],
            controls: vec![vec![0.0]; 2],
            parameters: Vec::new(),
        });
    let report = solve(phase, uniform(7, 3), 1e-6);
    let phase = &report.phases[0];
    assert!((report.cost - 2.0).abs() < 1e-4, "T = {}", report.cost);
    assert!((phase.horizon().1 - report.cost).abs() < 1e-12);
    // The multipliers know the switch as well as the mesh does: to the width of the interval that holds it.
    let bounds = phase.mesh().bounds().iter().map(|fraction| fraction * report.cost);
    let widths =
        bounds.clone().zip(bounds.skip(1)).filter(|(a, b)| *a <= 1.0 && 1.0 <= *b).map(|(a, b)| b - a);
    let width = widths.fold(0.0, f64::max);
    assert!(width < 0.1, "the switch lies in an interval of {width} s");
    for (t, control) in [(0.3, 1.0), (0.7, 1.0), (1.4, -1.0), (1.8, -1.0)] {
        assert!((phase.control(t)[0] - control).abs() < 1e-6, "u({t}) = {}", phase.control(t)[0]);
        let costate = phase.costate(t);
        assert!((costate[0] + 1.0).abs() < 1e-6, "λ({t}) = {costate:?}");
        assert!((costate[1] - (t - 1.0)).abs() < width, "λ({t}) = {costate:?}, width {width}");
    }
    for (h, t) in phase.hamiltonian.iter().zip(&phase.times) {
        if (t - 1.0).abs() > width {
            assert!((h + 1.0).abs() < width, "H = {h} at {t}, width {width}");
        }
    }
}

/// Least ½ ∫ u² dt below a ceiling.
struct Ceiling;

impl Terms for Ceiling {
    fn n_path_constraints(&self) -> usize {
        1
    }
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        at.control[0] * at.control[0] * half()
    }
    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        values[0] = at.state[0];
    }
}

/// Bryson and Denham's problem (Bryson & Ho 1975, section 3.11): x ≤ ℓ = 1/9 costs 4/(9ℓ) = 4, and
/// u = −(2/(3ℓ)) (1 − t/(3ℓ)) until t = 3ℓ, where x reaches ℓ and stays.
#[test]
fn bryson_and_denhams_problem_costs_4_below_a_ceiling_of_a_ninth() {
    let phase = Phase::new(DoubleIntegrator, Ceiling)
        .initial_state([0.0, 1.0])
        .final_state([0.0, -1.0])
        .path_bounds([Interval::at_most(1.0 / 9.0)]);
    let report = solve(phase, uniform(10, 3), 1e-7);
    assert!((report.cost - 4.0).abs() < 1e-4, "cost {}", report.cost);
    let phase = &report.phases[0];
    for t in [0.05, 0.2, 0.28] {
        let control = -6.0 * (1.0 - 3.0 * t);
        assert!(
            (phase.control(t)[0] - control).abs() < 1e-2,
            "u({t}) = {}, not {control}",
            phase.control(t)[0]
        );
    }
    // along the ceiling the cost hardly tells heights apart: they are known to about the error of the cost
    let height = phase.state(0.5)[0];
    assert!((height - 1.0 / 9.0).abs() < 1e-4, "x(0.5) = {height}");
    assert!(phase.path_multipliers.iter().all(|m| m[0] >= -1e-9), "an upper bound pushes upwards");
    assert!(report.confirmation.max_violation() < 1e-4, "violation {}", report.confirmation.max_violation());
}

/// Where the ceiling begins to act the polynomial through its multipliers changes its sign between the points; a floor far below, which
/// the motion never reaches, is not what it is of.
#[test]
fn a_floor_that_is_never_reached_changes_nothing() {
    let solved = |heights: Interval| {
        let phase = Phase::new(DoubleIntegrator, Timed(0.0))
            .initial_state([0.0, 1.0])
            .final_state([0.0, -1.0])
            .state_bounds([heights, Interval::FREE]);
        solve(phase, uniform(20, 3), 1e-6)
    };
    let [alone, with_floor] = [Interval::at_most(1.0 / 9.0), Interval::new(-1.0, 1.0 / 9.0)].map(solved);
    assert!((alone.cost - 4.0).abs() < 1e-6 && alone.history.len() == with_floor.history.len());
    assert!((with_floor.cost - alone.cost).abs() < 1e-9, "{} {}", alone.cost, with_floor.cost);
}

/// Constant speed in the plane, the direction is the control.
struct Walk;

impl Dynamics for Walk {
    fn n_states(&self) -> usize {
        2
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.control[0].cos();
        rates[1] = at.control[0].sin();
    }
}

/// Least time, outside of the unit circle.
struct AroundCircle;

impl Terms for AroundCircle {
    fn n_path_constraints(&self) -> usize {
        1
    }
    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        values[0] = at.state[0] * at.state[0] + at.state[1] * at.state[1];
    }
    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        ends.final_time
    }
}

/// From (−2, 0) to (2, 0): two tangents of √3 and a sixth of the circle.
#[test]
fn the_shortest_way_around_a_disk_is_two_tangents_and_an_arc() {
    let phase = Phase::new(Walk, AroundCircle)
        .initial_state([-2.0, 0.0])
        .final_state([2.0, 0.0])
        .path_bounds([Interval::at_least(1.0)])
        .horizon(0.0, Interval::new(1.0, 20.0))
        .guess(Guess {
            times: vec![0.0, 2.5, 5.0],
            states: vec![vec![-2.0, 0.0], vec![0.0, 1.5], vec![2.0, 0.0]],
            controls: vec![vec![0.6], vec![0.0], vec![-0.6]],
            parameters: Vec::new(),
        });
    let report = solve(phase, uniform(12, 3), 1e-6);
    let length = 2.0 * 3f64.sqrt() + std::f64::consts::FRAC_PI_3;
    assert!((report.cost - length).abs() < 1e-4, "{} instead of {length}", report.cost);
    let top = report.phases[0].state(0.5 * report.cost);
    assert!(top[0].abs() < 1e-3 && (top[1] - 1.0).abs() < 1e-3, "half way at {top:?}");
}

/// ẋ = p: a parameter that the ends decide, and a start that the cost decides.
struct Drift;

impl Dynamics for Drift {
    fn n_states(&self) -> usize {
        1
    }
    fn n_controls(&self) -> usize {
        0
    }
    fn n_parameters(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.parameters[0];
    }
}

/// ½ x(t₀)² + ½ p².
struct SmallStart;

impl Terms for SmallStart {
    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        (ends.initial_state[0] * ends.initial_state[0] + ends.parameters[0] * ends.parameters[0]) * half()
    }
}

/// x(0) + p = 2 at least cost: 1 each, and λ = −1 throughout, since a larger x(0) would cost 1 more.
#[test]
fn parameters_and_free_starts_are_optimised() {
    let phase = Phase::new(Drift, SmallStart).initial_state([Interval::FREE]).final_state([2.0]);
    let report = solve(phase, uniform(2, 2), 1e-8);
    let phase = &report.phases[0];
    assert!((phase.parameters[0] - 1.0).abs() < 1e-8 && (phase.states[0][0] - 1.0).abs() < 1e-8);
    assert!(phase.costates.iter().all(|l| (l[0] + 1.0).abs() < 1e-8), "{:?}", phase.costates);
}

/// ½ ∫ F² dt.
struct Push;

impl Terms for Push {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        at.control[0] * at.control[0] * half()
    }
}

/// Only the cart of thesis appendix A is driven, and the pole hangs at first.
#[test]
fn a_cart_swings_its_pole_up_and_the_motion_holds_when_integrated_anew() {
    let cart = TreeDynamics::try_new(&CartPendulum::default().model().unwrap(), &[0]).unwrap();
    let phase = Phase::of_tree(cart, Push)
        .initial_state([0.0, std::f64::consts::PI, 0.0, 0.0])
        .final_state([0.0; 4])
        .control_bounds([Interval::new(-30.0, 30.0)])
        .horizon(0.0, 2.0);
    let report = solve(phase, uniform(20, 5), 1e-7);
    let confirmation = &report.confirmation;
    assert!(confirmation.max_defect() < 1e-7, "{}", confirmation.max_defect());
    assert!((confirmation.cost - report.cost).abs() < 1e-6 * report.cost);
    assert!(confirmation.end_to_end_error() < 1e-5, "{}", confirmation.end_to_end_error());
    // 30 N are asked for in full at some time, and not exceeded by more than polynomials overshoot
    let strongest = report.phases[0].controls.iter().fold(0.0, |m: f64, u| m.max(u[0].abs()));
    assert!((strongest - 30.0).abs() < 1e-6 && confirmation.max_violation() < 0.1, "{strongest} N");
    assert!(report.phases[0].hamiltonian_spread() < 1e-3 * report.cost);
}

/// Few polynomials make poor programs; all of them lead to the same motion, which a fine mesh has too.
#[test]
fn swing_ups_within_bounds_are_found_from_coarse_and_fine_meshes() {
    for limit in [25.0, 30.0] {
        let costs = [(10, 5), (8, 4), (10, 8), (40, 4)].map(|(intervals, points)| {
            let cart = TreeDynamics::try_new(&CartPendulum::default().model().unwrap(), &[0]).unwrap();
            let phase = Phase::of_tree(cart, Push)
                .initial_state([0.0, std::f64::consts::PI, 0.0, 0.0])
                .final_state([0.0; 4])
                .control_bounds([Interval::new(-limit, limit)])
                .horizon(0.0, 2.0);
            solve(phase, uniform(intervals, points), 1e-6).cost
        });
        let spread = costs.iter().map(|c| (c - costs[3]).abs()).fold(0.0, f64::max);
        assert!(spread < 1e-4 * costs[3], "{limit} N: {costs:?}");
    }
}

/// ẋ = ω × x: what stays on a sphere, pulled to the x axis. From there to the y axis the motion is in their plane and ½ ∫ θ̇² + sin²θ.
struct Sphere {
    pull: f64,
}

impl Dynamics for Sphere {
    fn n_states(&self) -> usize {
        3
    }
    fn n_controls(&self) -> usize {
        3
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let (x, w) = (at.state, at.control);
        rates[0] = w[1] * x[2] - w[2] * x[1];
        rates[1] = w[2] * x[0] - w[0] * x[2];
        rates[2] = w[0] * x[1] - w[1] * x[0];
    }
}

impl Terms for Sphere {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let pulled = at.state[1] * at.state[1] + at.state[2] * at.state[2];
        let effort = at.control.iter().fold(T::zero(), |sum, w| sum + *w * *w);
        half::<T>() * (effort + pulled * nalgebra::convert::<f64, T>(self.pull))
    }
}

/// The norm stays, so that of the six numbers at the ends one follows from the others, and discrete motions cannot meet it exactly.
/// θ̇² = E + sin²θ with ∫ dθ/θ̇ = 1, by quadrature of SciPy, has the cost 1.47738010342561.
#[test]
fn ends_that_an_invariant_of_the_equations_joins_are_met_in_few_steps() {
    let bounds = [Interval::FREE, Interval::new(-2.0, 2.0)];
    for (pull, bound, exact) in [
        (0.0, bounds[0], std::f64::consts::PI.powi(2) / 8.0),
        (1.0, bounds[0], 1.47738010342561),
        (1.0, bounds[1], 1.47738010342561),
    ] {
        let phase = Phase::new(Sphere { pull }, Sphere { pull })
            .initial_state([1.0, 0.0, 0.0])
            .final_state([0.0, 1.0, 0.0])
            .control_bounds([bound; 3]);
        let report = solve(phase, uniform(20, 3), 1e-6);
        assert!((report.cost - exact).abs() < 1e-7, "{pull}, {bound:?}: {}", report.cost - exact);
        let steps: usize = report.history.iter().map(|mesh| mesh.iterations).sum();
        assert!(steps < 60, "{pull}, {bound:?}: {:?}", report.history);
    }
}
