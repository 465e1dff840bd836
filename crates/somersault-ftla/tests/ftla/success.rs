//! What success means: the same in all units, Hamiltonians that are constant, limits of a search, trials without a value.

use crate::common::{ArmProblem, FREE, arm_nodes, within};
use nalgebra::{DMatrix, DVector};
use somersault_core::Scalar;
use somersault_core::argument::ArgumentError;
use somersault_ftla::budget::{Limit, Limits};
use somersault_ftla::cold_start::{ArmTravel, cold_start};
use somersault_ftla::continuation::{Continuation, Member, Reason, Stage};
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::shooting::{End, MultipleShooting, ShootingError, ShootingStatus, graded_times};
use somersault_ftla::system::{
    ArmMinimumTorque, CubicRegulator, DifferentiatedProblem, HamiltonianSystem, PosedProblem,
    ProblemDerivatives, StateCostate, SystemError, VectorField,
};
use somersault_ocp::collocation::{Dynamics, Point, Terms};
use std::time::Duration;

fn k<T: Scalar>(x: f64) -> T {
    nalgebra::convert(x)
}

/// The cubic regulator with its state in units of 1/`length` and its cost in units of 1/`cost`.
#[derive(Clone, Copy)]
struct InUnits {
    length: f64,
    cost: f64,
}

impl Dynamics for InUnits {
    fn n_states(&self) -> usize {
        1
    }

    fn n_controls(&self) -> usize {
        1
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, f: &mut [T]) {
        let (x, u) = (at.state, at.control);
        f[0] = u[0] - x[0] * x[0] * x[0] * k(1.0 / (self.length * self.length));
    }
}

impl Terms for InUnits {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let (x, u) = (at.state, at.control);
        (x[0] * x[0] + u[0] * u[0]) * k(0.5 * self.cost / (self.length * self.length))
    }
}

#[test]
fn a_regulator_is_solved_to_the_same_digits_in_all_units() {
    let (a, b, horizon) = (1.0, 1.5, 40.0);
    let continuation = Continuation::default();
    let plain = cold_start(&CubicRegulator, &[a], &[b], horizon, &continuation).expect("well posed");
    let root = |x: f64| (1.0 + x.powi(4)).sqrt();
    let exact = [-a.powi(3) + a * root(a), -b.powi(3) - b * root(b)];
    for length in [1e-6, 1.0, 1e6] {
        for cost in [1e-6, 1.0, 1e6] {
            let system = within(InUnits { length, cost }, &FREE);
            let found = cold_start(&system, &[a * length], &[b * length], horizon, &continuation)
                .expect("well posed");
            let extremal = &found.extremal;
            assert!(found.arrived(), "{length:e} {cost:e}: {:?}", found.reason);
            assert_eq!(found.iterations, plain.iterations, "{length:e} {cost:e}");
            let last = extremal.nodes.len() - 1;
            for (node, exact) in [(0, exact[0]), (last, exact[1])] {
                let costate = extremal.nodes[node][1] * length / cost;
                assert!((costate - exact).abs() < 1e-10, "{length:e} {cost:e}: {costate} for {exact}");
            }
            let flow = VariationalFlow::try_new(&system, FlowTolerances::default()).expect("in range");
            let value = extremal.cost(&flow).expect("regular") / cost;
            assert!((value - 3.36205690494300).abs() < 1e-10, "{length:e} {cost:e}: {value}");
        }
    }
}

#[test]
fn the_arm_is_solved_whatever_its_weights() {
    // with (35, 17.5) the costates reach 38
    for factor in [1e-6, 1e-3, 35.0, 1e3, 1e6] {
        let thesis = ArmTravel::default();
        let weights = thesis.system.weights().map(|w| w * factor);
        let system = ArmMinimumTorque::try_new(*thesis.system.arm(), weights).expect("positive");
        let found = ArmTravel { system, ..thesis }.solve(&Continuation::default()).expect("well posed");
        let continued = found.continued;
        assert!(
            continued.arrived(),
            "{factor:e}: {:?} {}",
            continued.extremal.status,
            continued.extremal.residual
        );
        assert_eq!((continued.steps, continued.stage), ([1, 0], Stage::LeastEffort), "{factor:e}");
        let flow = VariationalFlow::try_new(&system, FlowTolerances::default()).expect("in range");
        let cost = continued.extremal.cost(&flow).expect("regular") / factor;
        assert!((cost - 0.321777232).abs() < 1e-9, "{factor:e}: {cost}");
        let off = (&continued.extremal.nodes[0]
            - arm_nodes()[0].1.clone().map_with_location(|i, _, x| if i < 4 { x } else { x * factor }))
        .component_div(&continued.extremal.scale());
        assert!(off.amax() < 1e-9, "{factor:e}: {off}");
    }
}

#[test]
fn a_floor_of_rounding_is_a_status() {
    let thesis = ArmTravel::default();
    let polish = MultipleShooting { tolerance: 1e-15, ..MultipleShooting::default() };
    let found = thesis.solve(&Continuation { polish, ..Continuation::default() }).expect("well posed");
    let extremal = found.continued.extremal;
    assert_eq!(extremal.status, ShootingStatus::Floor, "{:e} {:e}", extremal.residual, extremal.floor);
    assert!(extremal.residual < 1e-11 && extremal.residual > 1e-15, "{:e}", extremal.residual);
    assert_eq!(found.continued.reason, Some(Reason::Unsolved(ShootingStatus::Floor)));
    for tolerance in [1e-16, 0.0, f64::NAN, 0.2] {
        let polish = MultipleShooting { tolerance, ..MultipleShooting::default() };
        let refused = thesis.solve(&Continuation { polish, ..Continuation::default() });
        assert!(
            matches!(
                refused,
                Err(ShootingError::Argument(ArgumentError::OutOfRange { argument: "tolerance", .. }))
            ),
            "{tolerance}: {:?}",
            refused.map(|found| found.continued.extremal.status)
        );
    }
}

/// x₁' = x₂, x₂' = −sin x₁ − x₂/5 + u, ℓ = ½(x₁² + u²).
#[derive(Clone, Copy)]
struct Pendulum;

impl Dynamics for Pendulum {
    fn n_states(&self) -> usize {
        2
    }

    fn n_controls(&self) -> usize {
        1
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, f: &mut [T]) {
        let (x, u) = (at.state, at.control);
        f.copy_from_slice(&[x[1], u[0] - x[0].sin() - x[1] * k(0.2)]);
    }
}

impl Terms for Pendulum {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let (x, u) = (at.state, at.control);
        (x[0] * x[0] + u[0] * u[0]) * k(0.5)
    }
}

/// The pendulum with one entry of ∂f/∂x off by a part of itself.
struct Wrong {
    pendulum: StateCostate<PosedProblem>,
    entry: (usize, usize),
    part: f64,
    bounds: [f64; 2],
}

impl Wrong {
    fn right(&self) -> &PosedProblem {
        self.pendulum.problem()
    }
}

impl DifferentiatedProblem for Wrong {
    fn sizes(&self) -> [usize; 2] {
        self.right().sizes()
    }

    fn rate_into(&self, x: &[f64], u: &[f64], f: &mut [f64]) {
        self.right().rate_into(x, u, f);
    }

    fn cost(&self, x: &[f64], u: &[f64]) -> f64 {
        self.right().cost(x, u)
    }

    fn by_control_into(
        &self,
        x: &[f64],
        costate: &[f64],
        u: &[f64],
        gradient: &mut [f64],
        hessian: &mut DMatrix<f64>,
    ) -> f64 {
        self.right().by_control_into(x, costate, u, gradient, hessian)
    }

    fn by_state_into(&self, x: &[f64], costate: &[f64], u: &[f64], slope: &mut [f64]) {
        let (i, j) = self.entry;
        self.right().by_state_into(x, costate, u, slope);
        slope[j] += self.part * costate[i] * self.right().derivatives(x, costate, u).f_x[(i, j)];
    }

    fn derivatives(&self, x: &[f64], costate: &[f64], u: &[f64]) -> ProblemDerivatives {
        let mut d = self.right().derivatives(x, costate, u);
        d.f_x[self.entry] *= 1.0 + self.part;
        d
    }

    fn control_bounds(&self) -> [Vec<f64>; 2] {
        self.bounds.map(|bound| vec![bound])
    }
}

#[test]
fn a_wrong_derivative_is_no_success() {
    let mut random = crate::common::Random::new(8);
    let wrong = |entry, part, bounds| {
        StateCostate::try_new(Wrong { pendulum: within(Pendulum, &FREE), entry, part, bounds })
    };
    assert!(matches!(
        wrong((0, 1), 0.0, [1.0, 0.0]).err(),
        Some(SystemError::Argument(ArgumentError::OutOfRange { argument: "lower bound", .. }))
    ));
    let solve = |entry: (usize, usize), part: f64| {
        let system = wrong(entry, part, FREE[0]).expect("no bounds");
        cold_start(&system, &[1.0, 0.0], &[0.2, 0.1], 4.0, &Continuation::default()).expect("well posed")
    };
    assert!(solve((0, 1), 0.0).arrived());
    for case in 0..30 {
        let part = 10f64.powf(-2.0 + random.unit()) * if case % 2 == 0 { 1.0 } else { -1.0 };
        let entry = [(0, 1), (1, 0), (1, 1)][case % 3];
        let found = solve(entry, part);
        assert!(!found.arrived(), "{entry:?} off by {part}: drift {:?}", found.extremal.hamiltonian_drift);
        assert_eq!(
            found.reason,
            Some(Reason::Unsolved(ShootingStatus::HamiltonianDrifts)),
            "{entry:?} {part}"
        );
    }
}

#[test]
fn every_search_ends_at_its_limits_with_what_it_has() {
    let thesis = ArmTravel::default();
    let within = |limits: Limits| {
        let polish = MultipleShooting { limits, ..MultipleShooting::default() };
        Continuation { polish, ..Continuation::default() }
    };
    let free = thesis.solve(&Continuation::default()).expect("well posed").continued;
    let ends = [thesis.initial, thesis.last].map(|[one, two]| vec![one, two, 0.0, 0.0]);
    let rest = vec![0.0, thesis.fold, 0.0, 0.0];
    let fractions = graded_times(1.0, 0.01, 0.04).expect("positive");
    for (evaluations, time) in
        [(Some(free.work.evaluations / 2), None), (Some(1), None), (None, Some(Duration::ZERO))]
    {
        let limits = Limits { time, evaluations };
        let continuation = within(limits);
        let arm = thesis.solve(&continuation).expect("well posed").continued;
        let stages = [[rest.clone(), rest.clone()], ends.clone()];
        let led = continuation.through(&thesis.system, &stages, 10.0, &fractions).expect("well posed");
        let cold = cold_start(&thesis.system, &ends[0], &ends[1], 10.0, &continuation).expect("well posed");
        for found in [arm, led, cold] {
            assert!(!found.arrived());
            assert!(matches!(found.reason, Some(Reason::Limit(_))), "{limits:?}: {:?}", found.reason);
            assert!(found.extremal.nodes.iter().all(|p| p.iter().all(|x| x.is_finite())));
            // no more than what was under way when the limit was met
            let spent = found.work.evaluations;
            assert!(evaluations.is_none_or(|most| spent < most + 3000), "{limits:?}: {spent}");
        }
    }
    let limit = Limit::Time(Duration::from_millis(1500));
    assert_eq!(limit.to_string(), "the time limit of 1.5 s is reached");
}

/// The cubic regulator up to x = 1.2; beyond it has no value.
#[derive(Clone, Copy)]
struct Cliff;

impl VectorField for Cliff {
    #[inline(always)]
    fn dimension(&self) -> usize {
        2
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        if p[0] > 1.2 { h.fill(f64::NAN) } else { CubicRegulator.field_into(p, h) }
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        CubicRegulator.jacobian_into(p, d);
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        Some(CubicRegulator.hamiltonian(p))
    }
}

#[test]
fn trials_without_a_value_are_rejected_and_the_best_member_is_kept() {
    let fractions = graded_times(1.0, 0.02, 0.2).expect("positive");
    let stages = [0.0, 1.0, 1.5].map(|b| [vec![0.5 * b], vec![b]]);
    let found = Continuation::default().through(&Cliff, &stages, 10.0, &fractions).expect("well posed");
    assert!(!found.arrived() && found.extremal.status == ShootingStatus::OnTheWay);
    assert_eq!(found.stage, Stage::Leg { to: 3, of: 3 });
    assert!(matches!(found.reason, Some(Reason::Failed(_) | Reason::Unsolved(_))), "{:?}", found.reason);
    // 1.2 is two fifths of the way from 1 to 1.5
    assert!((found.s - 0.7).abs() < 1e-3, "{}", found.s);
    let last = found.extremal.nodes[found.extremal.nodes.len() - 1][0];
    assert!(last < 1.2 && last > 1.199, "{last}");

    // a family whose polish alone fails: what led there is kept
    let ends = |b: f64| [[0.5].as_slice(), &[b]].map(|x| End::try_state(x).expect("one state"));
    let family = |s: f64| Member { system: Cliff, ends: ends(1.0 + 0.3 * s), horizon: 10.0 };
    let nodes = found_at_one(&fractions);
    let followed = Continuation::default().follow(family, &fractions, &nodes).expect("well posed");
    assert!(followed.s < 1.0 && followed.reason.is_some() && followed.stage == Stage::Family);
}

fn found_at_one(fractions: &[f64]) -> Vec<DVector<f64>> {
    let stages = [[vec![0.0], vec![0.0]], [vec![0.5], vec![1.0]]];
    Continuation::default().through(&Cliff, &stages, 10.0, fractions).expect("well posed").extremal.nodes
}

#[test]
fn the_arm_by_expressions_keeps_its_hamiltonian_too() {
    let thesis = ArmTravel::default();
    let problem = ArmProblem {
        arm: *thesis.system.arm(),
        weights: thesis.system.weights(),
        limits: [f64::INFINITY; 2],
    };
    let system = problem.system();
    let nodes = arm_nodes();
    let times: Vec<f64> = nodes.iter().map(|(t, _)| *t).collect();
    let guess: Vec<_> = nodes.iter().map(|(_, p)| p.clone()).collect();
    let ends =
        [thesis.initial, thesis.last].map(|[one, two]| End::try_state(&[one, two, 0.0, 0.0]).expect("four"));
    let found = MultipleShooting::default().solve(&system, &ends, &times, &guess).expect("well posed");
    assert_eq!(found.status, ShootingStatus::Converged);
    assert!(found.hamiltonian_drift < Some(1e-11), "{:?}", found.hamiltonian_drift);
}
