//! Extremals to rounding from their boundary states: the thesis' arm from rest, and the regulators in closed form.

use crate::common::{arm_motion, arm_nodes};
use nalgebra::{DVector, dvector};
use somersault_core::argument::ArgumentError;
use somersault_ftla::cold_start::{ArmTravel, TreeTravel};
use somersault_ftla::continuation::{Continuation, Stage};
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::shooting::{
    End, Extremal, MultipleShooting, ShootingError, ShootingStatus, graded_times,
};
use somersault_ftla::system::{
    ArmMinimumTorque, CubicRegulator, HamiltonianSystem, LinearRegulator, OptimalControlSystem,
    TreeMinimumTorque,
};
use somersault_multibody::{Data, models::CartPendulum};
use somersault_testkit::travels::{Travel, random_travels};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

fn cost(extremal: &Extremal) -> f64 {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, FlowTolerances::default()).expect("in range");
    extremal.cost(&flow).expect("regular")
}

#[test]
fn the_thesis_motion_is_found_from_boundary_states_and_fold_alone() {
    let arm = ArmMinimumTorque::default();
    let found = arm_motion(PI, 0.05);
    let extremal = &found.extremal;
    assert_eq!((found.s, extremal.status), (1.0, ShootingStatus::Converged));
    assert!(extremal.residual <= 1e-10, "{:e}", extremal.residual);
    let [low, high] = extremal.range_of(|p| arm.hamiltonian(p));
    assert!(high - low < 1e-10, "{:e}", high - low);
    // Table 10.1, its mismatch being 6e-4
    let middle = extremal
        .at(&VariationalFlow::try_new(&arm, FlowTolerances::default()).expect("in range"), 5.0)
        .expect("regular");
    let table = [-0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651];
    assert!((&middle - DVector::from_row_slice(&table)).amax() < 6e-4, "{middle}");
    // the nodes that other tests start from
    let (start, recorded) = (&extremal.nodes[0], &arm_nodes()[0].1);
    assert!((start - recorded).amax() < 1e-9, "{}", start - recorded);
    println!("{:?} {} iterations, {:?}, cost {}", found.steps, found.iterations, found.work, cost(extremal));
}

#[test]
fn the_thesis_motion_is_not_the_cheapest_extremal() {
    // link 2 the other way round costs more, and the same arm reached with θ₂ less by 2π less
    let costs: Vec<f64> = [(PI, 0.05), (-PI, 0.05), (-PI, 0.05 - 2.0 * PI)]
        .into_iter()
        .map(|(fold, unfolded)| {
            let found = arm_motion(fold, unfolded);
            assert_eq!(found.extremal.status, ShootingStatus::Converged, "{fold} {unfolded}");
            cost(&found.extremal)
        })
        .collect();
    println!("{costs:?}");
    assert!(costs[0] < costs[1] && costs[2] < costs[0], "{costs:?}");
}

/// x from `ends[0]` to `ends[1]` over `horizon`, from rest at the origin.
fn regulator<S: OptimalControlSystem + Sync + Clone>(
    system: &S,
    ends: [f64; 2],
    horizon: f64,
) -> (Extremal, f64) {
    let times = graded_times(horizon, 0.2, 12.0).expect("positive");
    let fractions: Vec<f64> = times.iter().map(|t| t / horizon).collect();
    let stages = [[vec![0.0], vec![0.0]], [vec![ends[0]], vec![ends[1]]]];
    let found = Continuation::default().through(system, &stages, horizon, &fractions).expect("well posed");
    assert_eq!((found.s, found.extremal.status), (1.0, ShootingStatus::Converged), "{ends:?} {horizon}");
    let flow = VariationalFlow::try_new(system, FlowTolerances::default()).expect("in range");
    let cost = found.extremal.cost(&flow).expect("regular");
    (found.extremal, cost)
}

const CASES: [[f64; 2]; 2] = [[1.0, 1.5], [1.5, 1.0]];

fn assert_solution(found: &(Extremal, f64), expected: [f64; 3], what: &str) {
    let (extremal, cost) = found;
    let costates = [extremal.nodes[0][1], extremal.nodes[extremal.nodes.len() - 1][1]];
    for (found, expected) in [*cost, costates[0], costates[1]].into_iter().zip(expected) {
        assert!(
            (found - expected).abs() < 1e-10,
            "{what}: {found} is not {expected}, off by {:e}",
            found - expected
        );
    }
}

#[test]
fn the_linear_regulator_is_its_closed_form_at_any_horizon() {
    for [a, b] in CASES {
        for horizon in [1.0, 10.0, 40.0, 1e4] {
            // x = (a sinh r(T − t) + b sinh rt)/sinh rT, λ = −x − ẋ, J = ½(x₀λ₀ − x_fλ_f)
            let r = SQRT_2;
            let (coth, csch) = (1.0 / (r * horizon).tanh(), 1.0 / (r * horizon).sinh());
            let costates = [-a + r * (a * coth - b * csch), -b - r * (b * coth - a * csch)];
            let cost = 0.5 * (a * costates[0] - b * costates[1]);
            let found = regulator(&LinearRegulator, [a, b], horizon);
            assert_solution(&found, [cost, costates[0], costates[1]], &format!("{a} to {b} in {horizon}"));
        }
    }
}

#[test]
fn the_cubic_regulator_is_on_its_closed_manifolds_at_long_horizons() {
    let root = |x: f64| (1.0 + x.powi(4)).sqrt();
    let value = |x: f64| 0.25 * (x * x * root(x) + (x * x).asinh());
    for [a, b] in CASES {
        let costates = [-a.powi(3) + a * root(a), -b.powi(3) - b * root(b)];
        let cost = value(a) - 0.25 * a.powi(4) + value(b) + 0.25 * b.powi(4);
        for horizon in [40.0, 1e4] {
            let found = regulator(&CubicRegulator, [a, b], horizon);
            assert_solution(&found, [cost, costates[0], costates[1]], &format!("{a} to {b} in {horizon}"));
        }
    }
}

/// ∫₀^end f by Simpson's rule on 4000 intervals: the integrands are smooth over ranges of about ten.
fn simpson(end: f64, f: impl Fn(f64) -> f64) -> f64 {
    let n = 4000;
    let h = end / n as f64;
    let weight = |k: usize| {
        if k == 0 || k == n {
            1.0
        } else if k % 2 == 1 {
            4.0
        } else {
            2.0
        }
    };
    (0..=n).map(|k| weight(k) * f(k as f64 * h)).sum::<f64>() * h / 3.0
}

/// Cost and end costates of the cubic regulator by quadrature on the conserved Hamiltonian.
///
/// With y = x² and m its least value, 2H = m + m³ and ẋ² = (y − m)(1 + y² + ym + m²); y = m cosh² v makes it smooth:
/// dt = dv/√(1 + y² + ym + m²).
fn by_quadrature([a, b]: [f64; 2], horizon: f64) -> [f64; 3] {
    let rate = |m: f64, v: f64| {
        let y = m * v.cosh().powi(2);
        (1.0 + y * y + y * m + m * m).sqrt()
    };
    let last = |m: f64, x: f64| (x / m.sqrt()).acosh();
    let time = |m: f64| [a, b].map(|x| simpson(last(m, x), |v| 1.0 / rate(m, v))).iter().sum::<f64>();
    let (mut low, mut high) = ((1e-12f64).ln(), (0.999f64).ln());
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if time(middle.exp()) > horizon { low = middle } else { high = middle }
    }
    let m = (0.5 * (low + high)).exp();
    // λ = −x³ − ẋ, with ẋ < 0 before the turn
    let speed = |v: f64| m.sqrt() * v.sinh() * rate(m, v);
    let part = |x: f64, sign: f64| {
        simpson(last(m, x), |v| {
            let x = m.sqrt() * v.cosh();
            let costate = -x.powi(3) + sign * speed(v);
            0.5 * (x * x + costate * costate) / rate(m, v)
        })
    };
    let costate = |x: f64, sign: f64| -x.powi(3) + sign * speed(last(m, x));
    [part(a, 1.0) + part(b, -1.0), costate(a, 1.0), costate(b, -1.0)]
}

#[test]
fn the_cubic_regulator_at_horizon_ten_is_a_quadrature() {
    for ends in CASES {
        let expected = by_quadrature(ends, 10.0);
        let found = regulator(&CubicRegulator, ends, 10.0);
        assert_solution(&found, expected, &format!("{ends:?}"));
    }
}

#[test]
fn a_free_end_has_a_zero_costate() {
    // x free at the end: λ(T) = 0, so that x₀λ₀/2 is the cost
    let times = graded_times(3.0, 0.2, 1.0).expect("positive");
    let ends = [End::try_state(&[1.0]), End::try_state(&[0.0]).and_then(|end| end.with_free(0))];
    let ends = ends.map(|end| end.expect("one state"));
    let nodes = vec![DVector::zeros(2); times.len()];
    let extremal =
        MultipleShooting::default().solve(&LinearRegulator, &ends, &times, &nodes).expect("well posed");
    assert_eq!(extremal.status, ShootingStatus::Converged);
    // λ = (r coth rT + 1)⁻¹ x at the start, the Riccati solution
    let expected = 1.0 / (SQRT_2 / (3.0 * SQRT_2).tanh() + 1.0);
    assert!((extremal.nodes[0][1] - expected).abs() < 1e-11, "{}", extremal.nodes[0][1]);
    assert!(extremal.nodes[times.len() - 1][1].abs() < 1e-11);
}

#[test]
fn what_does_not_converge_has_a_status_and_what_is_malformed_an_error() {
    let arm = ArmMinimumTorque::default();
    let times = graded_times(10.0, 0.1, 0.4).expect("positive");
    let ends = [-1.0, 1.0].map(|s| End::try_state(&[s * FRAC_PI_2, 0.05, 0.0, 0.0]).expect("four states"));
    let nodes = vec![DVector::<f64>::zeros(8); times.len()];
    let few = MultipleShooting { max_iterations: 2, ..MultipleShooting::default() };
    let extremal = few.solve(&arm, &ends, &times, &nodes).expect("well posed");
    assert!(matches!(extremal.status, ShootingStatus::MaxIterations | ShootingStatus::Stalled));
    assert!(extremal.residual > 1e-3 && extremal.nodes.len() == times.len());

    let solve = |times: &[f64], nodes: &[DVector<f64>]| {
        MultipleShooting::default().solve(&arm, &ends, times, nodes).err()
    };
    assert!(matches!(
        solve(&times[..4], &nodes),
        Some(ShootingError::Argument(ArgumentError::Length { argument: "nodes", .. }))
    ));
    assert!(matches!(
        solve(&[0.0], &nodes[..1]),
        Some(ShootingError::Argument(ArgumentError::Length { argument: "times", .. }))
    ));
    assert!(matches!(
        solve(&[0.0, 0.0], &nodes[..2]),
        Some(ShootingError::Argument(ArgumentError::OutOfRange { argument: "times", .. }))
    ));
    let nan = vec![DVector::repeat(8, f64::NAN); 2];
    assert!(matches!(
        solve(&[0.0, 1.0], &nan),
        Some(ShootingError::Argument(ArgumentError::OutOfRange { argument: "nodes", .. }))
    ));
    let short = [0.0; 2].map(|x| End::try_state(&[x; 3]).expect("three states"));
    let length = MultipleShooting::default().solve(&arm, &short, &times, &nodes).expect_err("three states");
    assert_eq!(length.to_string(), "`x` must have 4 entries, found 3");
    assert!(End::try_state(&[f64::NAN; 4]).is_err());
    assert!(End::try_state(&[0.0; 4]).and_then(|e| e.with_free(4)).is_err());
    assert!(graded_times(0.0, 1.0, 1.0).is_err() && graded_times(1.0, 1.0, f64::NAN).is_err());
    assert!(Continuation::default().through(&arm, &[], 10.0, &times).is_err());
}

#[test]
fn continuation_from_a_rest_leads_to_the_same_extremal() {
    let arm = ArmMinimumTorque::default();
    let end = |angle: f64, second: f64| vec![angle, second, 0.0, 0.0];
    let folded = [end(-FRAC_PI_2, PI), end(FRAC_PI_2, PI)];
    let stages = [[end(0.0, PI), end(0.0, PI)], folded, [end(-FRAC_PI_2, 0.05), end(FRAC_PI_2, 0.05)]];
    let fractions = graded_times(1.0, 0.01, 0.04).expect("positive");
    let found = Continuation::default().through(&arm, &stages, 10.0, &fractions).expect("well posed");
    assert_eq!((found.s, found.extremal.status), (1.0, ShootingStatus::Converged));
    assert!(found.steps[0] > 10);
    let direct = arm_motion(PI, 0.05);
    assert_eq!(direct.steps, [1, 0]);
    assert!((&found.extremal.nodes[0] - &direct.extremal.nodes[0]).amax() < 1e-9);
}

/// Solved, and confirmed by segments re-integrated a hundred times as accurately.
fn assert_solved(travel: &ArmTravel) -> Extremal {
    let found = travel.solve(&Continuation::default()).expect("well posed").continued;
    assert_eq!((found.s, found.extremal.status), (1.0, ShootingStatus::Converged), "{travel:?}");
    let extremal = found.extremal;
    let tight = FlowTolerances { relative: 1e-15, absolute: 1e-17 };
    let flow = VariationalFlow::try_new(&travel.system, tight).expect("in range");
    for (pair, times) in extremal.nodes.windows(2).zip(extremal.times.windows(2)) {
        let end = flow.state(&pair[0], times[1] - times[0]).expect("regular");
        assert!((end - &pair[1]).amax() < 1e-9, "{travel:?} at {}", times[0]);
    }
    let [low, high] = extremal.range_of(|p| travel.system.hamiltonian(p));
    assert!(extremal.residual <= 1e-10 && high - low < 1e-10 * low.abs().max(1.0), "{:e}", high - low);
    for (node, [one, two]) in
        [(&extremal.nodes[0], travel.initial), (&extremal.nodes[extremal.nodes.len() - 1], travel.last)]
    {
        assert!((node.rows(0, 4) - dvector![one, two, 0.0, 0.0]).amax() < 1e-10);
    }
    extremal
}

#[test]
fn one_and_two_turns_in_twenty_and_forty_seconds_are_found_too() {
    for (turns, horizon) in [(1.0, 20.0), (2.0, 40.0)] {
        let (initial, last) = ([-turns * PI, 0.05], [turns * PI, 0.05]);
        assert_solved(&ArmTravel { initial, last, horizon, ..ArmTravel::default() });
    }
}

#[test]
fn arms_at_random_are_found_from_boundary_states_and_fold_alone() {
    expect_random_travels(5);
}

/// Of the fifty of examples/random_arms.rs the first, among them one that takes the way from the thesis' problem.
#[test]
#[ignore = "long form of `arms_at_random_are_found_from_boundary_states_and_fold_alone`, 17 s: `make studies` runs it"]
fn more_arms_at_random_are_found_from_boundary_states_and_fold_alone() {
    expect_random_travels(14);
}

fn expect_random_travels(count: usize) {
    for Travel { arm, travel, horizon, fold } in random_travels(2017, count) {
        let system = ArmMinimumTorque::try_new(arm, [1.0, 0.5]).expect("in range");
        let [initial, last] = [-0.5, 0.5].map(|s| [s * travel, 0.05]);
        let extremal = assert_solved(&ArmTravel { system, initial, last, fold, horizon });
        // folded in the middle, to the side requested
        let middle = extremal.nodes[extremal.nodes.len() / 2][1];
        assert!((middle / fold - 1.0).abs() < 0.5, "{middle} for {fold}");
    }
}

#[test]
fn limits_lead_on_from_the_motion_without_them() {
    let system = ArmMinimumTorque::default().try_with_torque_limits([0.36, 0.2]).expect("positive");
    let limited = assert_solved(&ArmTravel { system, ..ArmTravel::default() });
    assert!(limited.work.switches > 0);
    let mut u = [0.0; 2];
    system.control_into(limited.nodes[0].as_slice(), &mut u).expect("two controls");
    assert_eq!(u[0], 0.36);
}

#[test]
fn travels_without_sense_are_errors_and_impossible_ones_have_a_status() {
    let thesis = ArmTravel::default();
    let solve = |travel: ArmTravel| travel.solve(&Continuation::default());
    for horizon in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        assert!(matches!(
            solve(ArmTravel { horizon, ..thesis }),
            Err(ShootingError::Argument(ArgumentError::OutOfRange { .. }))
        ));
    }
    let nan = ArmTravel { initial: [f64::NAN, 0.0], ..thesis };
    assert!(matches!(
        solve(nan),
        Err(ShootingError::Argument(ArgumentError::OutOfRange { argument: "initial", .. }))
    ));
    assert!(solve(ArmTravel { fold: f64::NAN, ..thesis }).is_err());
    // a hundredth of the torque that the travel takes
    let system = thesis.system.try_with_torque_limits([0.003, 0.002]).expect("positive");
    let found = solve(ArmTravel { system, ..thesis }).expect("well posed");
    assert!(
        found.continued.s < 1.0
            && found.continued.extremal.nodes.iter().all(|p| p.iter().all(|x| x.is_finite()))
    );
}

#[test]
fn a_cart_pendulum_whose_pole_is_passive_swings_up() {
    let model = CartPendulum::default().model().expect("a model");
    let tree = TreeMinimumTorque::try_new(&model, &[1.0; 2]).expect("fits");
    let tree = tree.try_with_passive(1).expect("the cart is driven");
    // the angle counts from the upright
    let (hanging, upright) = ([0.0, PI, 0.0, 0.0], [0.0; 4]);
    let mut data = Data::new(&model);
    let mut potential =
        |x: &[f64]| model.positions(&mut data, &x[..2]).expect("lengths fit").potential_energy();
    assert!(potential(&upright) > potential(&hanging) + 1.0);
    let travel = TreeTravel { system: &tree, initial: &hanging, last: &upright, horizon: 2.0 };
    let found = travel.solve(&Continuation::default()).expect("well posed");
    assert!(found.arrived(), "{} {:?} at {}", found.stage, found.reason, found.s);
    assert_eq!(found.stage, Stage::Release);
    let mut u = [0.0; 2];
    for p in &found.extremal.nodes {
        tree.control_into(p.as_slice(), &mut u).expect("two controls");
        assert_eq!(u[1], 0.0);
    }
    // down it needs less than up
    let fall = TreeTravel { initial: &upright, last: &hanging, ..travel };
    let fall = fall.solve(&Continuation::default()).expect("well posed");
    let flow = VariationalFlow::try_new(&tree, FlowTolerances::default()).expect("in range");
    let [up, down] = [found, fall].map(|each| each.extremal.cost(&flow).expect("regular"));
    println!("up {up}, down {down}");
}
