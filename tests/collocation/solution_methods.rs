//! Splines, collocation, and what starts where.

use nalgebra::Vector3;
use somersault_core::Scalar;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::models::TwoLinkArm;
use somersault_multibody::{Joint, Link, MassProperties, Model, ModelBuilder};
use somersault_nlp::Flow;
use somersault_ocp::NoSplines;
use somersault_ocp::collocation::{
    CollocationError, CollocationStatus, Dynamics, Interval, Phase, Point, Problem, SearchError, Terms,
    TreeDynamics,
};
use somersault_ocp::solver::{SolutionMethod, Solver, SolverResult, StartFrom};

struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let squares = at.control.iter().fold(T::zero(), |sum, u| sum + *u * *u);
        squares * nalgebra::convert::<f64, T>(0.5)
    }
}

/// ẋ = u.
struct Pull;

impl Dynamics for Pull {
    fn n_states(&self) -> usize {
        1
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.control[0];
    }
}

/// Hinges about z with links of 1 kg and 0.5 m along −y, the weight's direction.
pub(crate) fn chain(n: usize, gravity: f64) -> Model {
    let mut builder = ModelBuilder::new().with_gravity(-gravity * Vector3::y());
    let joint = Joint::Revolute { axis: Vector3::z() };
    let rod = || MassProperties::rod(1.0, Vector3::zeros(), -0.5 * Vector3::y());
    builder.add(Link::root("0", joint, rod())).unwrap();
    for k in 1..n {
        let link = Link::child(k.to_string(), (k - 1).to_string(), joint, rod());
        builder.add(link.at(-0.5 * Vector3::y())).unwrap();
    }
    builder.build().unwrap()
}

fn turned(n: usize) -> Problem {
    let dynamics = TreeDynamics::try_fully_actuated(&chain(n, 0.0)).unwrap();
    let last: Vec<f64> = (0..2 * n).map(|k| if k < n { 0.5 } else { 0.0 }).collect();
    Problem::try_new(Phase::of_tree(dynamics, Effort).initial_state(vec![0.0; 2 * n]).final_state(last))
        .unwrap()
}

fn solve(problem: &mut Problem, method: SolutionMethod) -> Result<SolverResult, SearchError> {
    let mut solver = Solver { method, ..Solver::default() };
    solver.collocation.tolerance = 1e-5;
    solver.solve(problem, StartFrom::Guess, &mut |_| Flow::Continue, &CancellationToken::new())
}

#[test]
fn collocation_of_four_driven_hinges_starts_from_splines() {
    let report = solve(&mut turned(4), SolutionMethod::Auto).unwrap().report;
    assert_eq!(report.status, CollocationStatus::Converged, "{:?}", report.history);
    assert!(report.confirmation.max_defect() < 1e-6 && report.history[0].is_start);
    assert!(report.origin.contains("4 driven joints"), "{}", report.origin);
}

#[test]
fn two_driven_hinges_start_from_a_straight_line() {
    let report = solve(&mut turned(2), SolutionMethod::Auto).unwrap().report;
    assert_eq!(report.status, CollocationStatus::Converged);
    assert!(report.origin.is_empty() && !report.history[0].is_start);
}

#[test]
fn splines_of_joints_have_the_cost_of_collocation() {
    let posed = || {
        let dynamics = TreeDynamics::try_fully_actuated(&TwoLinkArm::default().model().unwrap()).unwrap();
        let phase = Phase::of_tree(dynamics, Effort).initial_state([0.0, 0.3, 0.0, 0.0]);
        Problem::try_new(phase.final_state([1.0, -0.3, 0.0, 0.0]).horizon(0.0, 1.0)).unwrap()
    };
    let [splines, collocation] = [SolutionMethod::Shooting, SolutionMethod::Collocation]
        .map(|method| solve(&mut posed(), method).unwrap().report);
    assert_eq!(splines.status, CollocationStatus::Converged, "{:?}", splines.history);
    assert!((splines.cost - collocation.cost).abs() < 1e-5 * collocation.cost);
}

#[test]
fn what_splines_cannot_take_is_named() {
    let reason = |mut problem: Problem| match solve(&mut problem, SolutionMethod::Shooting) {
        Err(SearchError::Collocation(CollocationError::NoSplines(reason))) => reason,
        other => panic!("{other:?}"),
    };
    let phase = || Phase::new(Pull, Effort).initial_state([0.0]).final_state([1.0]);
    let two = Problem::try_of_phases(vec![phase(), phase()], Vec::new()).unwrap();
    assert_eq!(reason(two), NoSplines::SeveralPhases { found: 2 });
    let late = phase().horizon(Interval::new(0.0, 0.5), 1.0);
    assert_eq!(reason(Problem::try_new(late).unwrap()), NoSplines::StartTime);
    let endless = phase().horizon(0.0, Interval::at_least(1.0));
    let found = reason(Problem::try_new(endless).unwrap());
    assert_eq!(found, NoSplines::EndlessDuration { lower: 1.0, upper: f64::INFINITY });
}

/// Φ of a start that is free.
struct FromBoth;

impl Terms for FromBoth {
    fn end_cost<T: Scalar>(&self, ends: &somersault_ocp::collocation::Ends<'_, T>) -> T {
        let apart = ends.final_state[0] - ends.initial_state[0];
        apart * apart
    }
}

#[test]
fn costs_of_a_free_start_are_refused_by_splines_and_taken_by_collocation() {
    let posed = || Problem::try_new(Phase::new(Pull, FromBoth).final_state([1.0])).unwrap();
    let refused = solve(&mut posed(), SolutionMethod::Shooting);
    let is_named =
        matches!(refused, Err(SearchError::Collocation(CollocationError::NoSplines(NoSplines::FreeStart))));
    assert!(is_named);
    assert_eq!(
        solve(&mut posed(), SolutionMethod::Auto).unwrap().report.status,
        CollocationStatus::Converged
    );
}
