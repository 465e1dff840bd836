//! State–costate systems of problems that collocation solves, and their cold starts.

use crate::common::{ArmProblem, Random, arm_problem, matrix_gap};
use somersault_core::Scalar;
use somersault_ftla::cold_start::ProblemTravel;
use somersault_ftla::continuation::{Continuation, Stage};
use somersault_ftla::flow::VariationalFlow;
use somersault_ftla::system::{
    CubicRegulator, HamiltonianSystem, OptimalControlSystem, PosedProblem, StateCostate, SystemError,
    VectorField,
};
use somersault_multibody::models::TwoLinkArm;
use somersault_ocp::collocation::{Dynamics, Ends, Interval, Phase, Point, Problem, Terms, TreeDynamics};
use std::f64::consts::SQRT_2;

fn k<T: Scalar>(x: f64) -> T {
    nalgebra::convert(x)
}

/// ẋ = a x³ + b x + u, ½ ∫ x² + u² dt, and terms that a state–costate system does not have.
#[derive(Clone, Copy, Default)]
struct Scalars {
    cubic: f64,
    linear: f64,
    by_time: f64,
    end: f64,
}

impl Dynamics for Scalars {
    fn n_states(&self) -> usize {
        1
    }

    fn n_controls(&self) -> usize {
        1
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let x = at.state[0];
        rates[0] = x * x * x * k(self.cubic) + x * k(self.linear) + at.control[0];
        if self.by_time != 0.0 {
            rates[0] += at.time * k(self.by_time);
        }
    }
}

impl Terms for Scalars {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        (at.state[0] * at.state[0] + at.control[0] * at.control[0]) * k(0.5)
    }

    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        if self.end == 0.0 { T::zero() } else { ends.final_state[0] * ends.final_state[0] * k(self.end) }
    }
}

fn cubic() -> Scalars {
    Scalars { cubic: -1.0, ..Scalars::default() }
}

fn phase(of: Scalars, last: Interval, horizon: f64) -> Phase {
    Phase::new(of, of).initial_state([1.0]).final_state([last]).horizon(0.0, horizon)
}

fn posed(phase: Phase) -> Result<StateCostate<PosedProblem>, SystemError> {
    StateCostate::of_problem(&Problem::try_new(phase).expect("a problem"))
}

/// The extremal of a problem between its own ends.
fn solved(system: &StateCostate<PosedProblem>) -> (f64, f64) {
    let problem = system.problem();
    let [initial, last] = [problem.initial_state(), problem.final_state()].map(|end| end.expect("no bounds"));
    let horizon = problem.horizon().expect("given");
    let travel = ProblemTravel { system, initial: &initial, last: &last, horizon };
    let continuation = Continuation::default();
    let found = travel.solve(&continuation).expect("well posed");
    assert!(found.arrived() && found.stage == Stage::Collocation, "{:?}", found.reason);
    let flow = VariationalFlow::try_new(system, continuation.polish.flow).expect("in range");
    (found.extremal.cost(&flow).expect("regular"), found.extremal.nodes[0][1])
}

#[test]
fn the_field_of_a_problem_is_that_of_the_closed_form() {
    let (system, mut random) = (posed(phase(cubic(), 1.5.into(), 40.0)).expect("posed"), Random::new(1));
    for _ in 0..100 {
        let p = [2.0 * random.unit(), 2.0 * random.unit()];
        assert!((system.field(&p) - CubicRegulator.field(&p)).amax() < 1e-14);
        assert!(matrix_gap(&system.jacobian(&p), &CubicRegulator.jacobian(&p)) < 1e-13);
        assert!((system.hamiltonian(&p) - CubicRegulator.hamiltonian(&p)).abs() < 1e-14);
        assert!((system.running_cost(&p) - CubicRegulator.running_cost(&p)).abs() < 1e-14);
    }
}

/// The effort of the arm with bounds, as collocation poses it: a tree and a cost.
struct Effort([f64; 2]);

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let each = at.control.iter().zip(&self.0).map(|(u, weight)| *u * *u * k(0.5 * weight));
        each.fold(T::zero(), |sum, term| sum + term)
    }
}

#[test]
fn the_arm_as_a_tree_and_the_arm_by_its_formula_are_one_system() {
    let (arm, weights, limits) = (TwoLinkArm::default(), [1.0, 1.4], [0.3, 0.2]);
    let tree = TreeDynamics::try_fully_actuated(&arm.model().expect("a tree")).expect("hinges");
    let phase = Phase::of_tree(tree, Effort(weights))
        .initial_state([0.0; 4])
        .final_state([0.5, 0.4, 0.0, 0.0])
        .control_bounds(limits.map(|limit| Interval::new(-limit, limit)));
    let posed = posed(phase).expect("posed");
    let formula = ArmProblem { arm, weights, limits }.system();
    let free = arm_problem(arm, weights);
    let (mut random, mut saturated) = (Random::new(2), 0);
    for _ in 0..200 {
        let p: Vec<f64> = (0..8).map(|_| random.unit()).collect();
        let (d, expected) = (posed.jacobian(&p), formula.jacobian(&p));
        assert!((posed.field(&p) - formula.field(&p)).amax() < 1e-11 * (1.0 + formula.field(&p).amax()));
        assert!(matrix_gap(&d, &expected) < 1e-11 * (1.0 + expected.amax()), "{p:?}");
        saturated += usize::from(free.control(&p).expect("convex") != formula.control(&p).expect("convex"));
    }
    assert!((50..200).contains(&saturated), "{saturated} of 200 at a bound");
}

#[test]
fn extremals_of_a_problem_have_the_cost_of_the_closed_form_to_a_horizon_of_10_000_s() {
    // ∫ over both ends of ∓x³ + √(x⁶ + x²), by SymPy in 30 digits
    for horizon in [40.0, 10_000.0] {
        let (cost, _) = solved(&posed(phase(cubic(), 1.5.into(), horizon)).expect("posed"));
        assert!((cost - 3.36205690494300).abs() < 1e-10, "{cost}");
    }
}

#[test]
fn an_end_that_is_free_has_a_costate_of_zero() {
    // λ = S x with Ṡ = 2 S + S² − 1, S(T) = 0: S(0) = tanh(√2 T) / (√2 + tanh(√2 T))
    let horizon: f64 = 3.0;
    let of = Scalars { linear: -1.0, ..Scalars::default() };
    let (cost, costate) = solved(&posed(phase(of, Interval::FREE, horizon)).expect("posed"));
    let tanh = (SQRT_2 * horizon).tanh();
    let riccati = tanh / (SQRT_2 + tanh);
    assert!((costate - riccati).abs() < 1e-10 && (cost - 0.5 * riccati).abs() < 1e-10, "{cost} {costate}");
}

#[test]
fn a_bound_that_acts_is_located() {
    // ẋ = u, |u| ≤ 0.6, ½ ∫ x² + u² from 1 to a free end: u = −0.6 to where λ = 0.6, from where λ = x tanh(T − t)
    let horizon: f64 = 3.0;
    let (cost, costate) = solved(
        &posed(phase(Scalars::default(), Interval::FREE, horizon).control_bounds([Interval::new(-0.6, 0.6)]))
            .expect("posed"),
    );
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let t = 0.5 * (low + high);
        if (1.0 - 0.6 * t) * (horizon - t).tanh() > 0.6 { low = t } else { high = t }
    }
    let left = 1.0 - 0.6 * low;
    let before = 0.5 * ((1.0 - left.powi(3)) / 1.8 + 0.36 * low);
    let expected = [before + 0.3 * left, 0.6 + low - 0.3 * low * low];
    assert!((cost - expected[0]).abs() < 1e-10 && (costate - expected[1]).abs() < 1e-9, "{cost} {costate}");
}

#[test]
fn what_a_state_costate_system_does_not_have_is_refused_by_name() {
    let plain = || phase(cubic(), 1.5.into(), 4.0);
    let of = |terms: Scalars| phase(terms, 1.5.into(), 4.0);
    let cases = [
        (plain().state_bounds([Interval::at_most(2.0)]), "`state 0` has bounds"),
        (of(Scalars { by_time: 1.0, ..cubic() }), "its dynamics depends on time"),
        (of(Scalars { end: 1.0, ..cubic() }), "it has an end cost"),
    ];
    for (phase, reason) in cases {
        match posed(phase) {
            Err(SystemError::NoStateCostate { reason: found }) => assert_eq!(found, reason),
            other => panic!("{reason}: {other:?}"),
        }
    }
    let between = posed(phase(cubic(), Interval::new(1.0, 2.0), 4.0)).expect("posed");
    assert!(between.problem().final_state().is_err() && between.problem().initial_state().is_ok());
    let open = posed(plain().horizon(0.0, Interval::new(1.0, 2.0))).expect("posed");
    assert!(open.problem().final_state().is_ok() && open.problem().horizon().is_err());
    let travel = |initial: &[Option<f64>], horizon: f64| {
        ProblemTravel { system: &open, initial, last: &[None], horizon }
            .solve(&Continuation::default())
            .is_err()
    };
    assert!(travel(&[], 1.0) && travel(&[Some(f64::NAN)], 1.0) && travel(&[Some(1.0)], -1.0));
}
