//! Diagnoses of linear systems whose exponents are known, of growth like powers of time, of what is no control problem, and
//! in other units.

use crate::common::{Linear, Random, arm_nodes};
use nalgebra::{DMatrix, DVector, dvector};
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::spectrum::{
    Diagnosis, SplittingDims, TimeDirection, Unknown, Verdict, diagnose, spectra,
};
use somersault_ftla::system::ArmMinimumTorque;

const TIGHT: FlowTolerances = FlowTolerances { relative: 1e-13, absolute: 1e-15 };

fn diagnosed(a: DMatrix<f64>, times: &[f64], horizon: f64) -> Diagnosis {
    let system = Linear(a);
    let flow = VariationalFlow::try_new(&system, TIGHT).expect("in range").with_max_steps(1_000_000);
    let origin = DVector::zeros(system.0.nrows());
    let found = spectra(&flow, &origin, TimeDirection::Forward, times).expect("linear");
    diagnose(&found, horizon).expect("ascending")
}

fn evenly(last: f64) -> Vec<f64> {
    (1..=16).map(|k| last * k as f64 / 16.0).collect()
}

/// x₁' = x₂, …, x_q' = u with cost ½ w ∫ u²: the flow is a polynomial of degree 2q − 1 in time.
fn chain(dimension: usize, weight: f64) -> DMatrix<f64> {
    let n = dimension / 2;
    DMatrix::from_fn(dimension, dimension, |i, j| {
        if i + 1 < n && j == i + 1 {
            1.0
        } else if i > n && j + 1 == i {
            -1.0
        } else if i + 1 == n && j + 1 == dimension {
            -1.0 / weight
        } else {
            0.0
        }
    })
}

fn assert_chain_is_slow(dimension: usize) {
    for weight in [1e-6, 1.0, 1e6] {
        let system = Linear(chain(dimension, weight));
        let flow = VariationalFlow::try_new(&system, TIGHT).expect("in range");
        for last in [1.0, 10.0, 100.0] {
            for times in [evenly(last), (0..9).map(|k| last / 2f64.powi(8 - k)).collect()] {
                let found = spectra(&flow, &DVector::zeros(dimension), TimeDirection::Forward, &times);
                let found = found.expect("linear");
                for horizon in [last, 3.5 * last] {
                    let said = diagnose(&found, horizon).expect("ascending");
                    let what =
                        format!("{dimension}, weight {weight:e}, to {last} s, horizon {horizon}: {said}");
                    assert!(!said.is_hyper_sensitive(), "{what}");
                }
            }
        }
    }
}

#[test]
fn growth_like_a_power_of_time_is_not_hyper_sensitive() {
    assert_chain_is_slow(4);
    assert_chain_is_slow(6);
    assert_chain_is_slow(8);
    // T³/6 at a hundred seconds: 1.7e5, which no rate stands for
    let found = diagnosed(chain(4, 1.0), &evenly(100.0), 100.0);
    assert_eq!(found.verdict, Verdict::Insensitive, "{found}");
    assert_eq!(found.dims, SplittingDims { stable: 0, center: 4, unstable: 0 });
}

/// A random symplectic matrix, none of its parts larger than one or so.
fn symplectic(n: usize, random: &mut Random) -> DMatrix<f64> {
    let mut shear = |upper: bool| {
        let mut s = DMatrix::<f64>::identity(2 * n, 2 * n);
        for i in 0..n {
            for j in 0..=i {
                let x = 0.4 * random.unit();
                for (i, j) in [(i, j), (j, i)] {
                    s[if upper { (i, n + j) } else { (n + i, j) }] = x;
                }
            }
        }
        s
    };
    shear(true) * shear(false) * shear(true)
}

/// Of each pair of conjugate variables what it does: ±rate, a rotation, or nothing; then hidden by a symplectic change of
/// variables.
fn hamiltonian(rates: &[f64], turns: &[f64], random: &mut Random) -> DMatrix<f64> {
    let n = rates.len() + turns.len();
    let mut a = DMatrix::<f64>::zeros(2 * n, 2 * n);
    for (i, rate) in rates.iter().enumerate() {
        (a[(i, i)], a[(n + i, n + i)]) = (*rate, -*rate);
    }
    for (k, turn) in turns.iter().enumerate() {
        let i = rates.len() + k;
        (a[(i, n + i)], a[(n + i, i)]) = (*turn, -*turn);
    }
    let s = symplectic(n, random);
    &s * a * s.clone().try_inverse().expect("regular")
}

#[test]
fn random_linear_quadratic_problems_have_the_dimensions_of_their_rates() {
    let mut random = Random::new(19);
    for case in 0..20 {
        let mut rate = |low: f64, high: f64| low + (high - low) * (0.5 + 0.5 * random.unit());
        let (fast, slow, turn) = ([rate(2.0, 4.0), rate(2.0, 4.0)], rate(0.01, 0.1), rate(0.2, 1.0));
        let times = evenly(8.0);
        let full = diagnosed(hamiltonian(&fast, &[], &mut random), &times, 40.0);
        assert_eq!(full.verdict, Verdict::Complete, "{case}: {full}");
        assert_eq!(full.dims, SplittingDims { stable: 2, center: 0, unstable: 2 });
        // the exponents of a time T are the rates but for what the change of variables adds over T
        let least = fast[0].min(fast[1]);
        assert!(full.fast_rates.iter().all(|r| (r - least).abs() < 0.5), "{case}: {full} for {least}");
        let part = diagnosed(hamiltonian(&[fast[0], slow], &[turn], &mut random), &times, 40.0);
        assert_eq!(part.verdict, Verdict::Partial, "{case}: {part}");
        assert_eq!(part.dims, SplittingDims { stable: 1, center: 4, unstable: 1 }, "{case}");
        let none = diagnosed(hamiltonian(&[slow], &[turn, 0.0], &mut random), &times, 8.0);
        assert_eq!(none.verdict, Verdict::Insensitive, "{case}: {none}");
    }
}

#[test]
fn a_chain_beside_fast_rates_is_the_centre() {
    // the double integrator with a regulator of rates ±√2, which it does not feel
    let mut a = DMatrix::<f64>::zeros(6, 6);
    let places = [0, 1, 3, 4];
    let slow = chain(4, 1.0);
    for i in 0..4 {
        for j in 0..4 {
            a[(places[i], places[j])] = slow[(i, j)];
        }
    }
    (a[(2, 2)], a[(2, 5)], a[(5, 2)], a[(5, 5)]) = (-1.0, -1.0, -1.0, 1.0);
    let found = diagnosed(a, &evenly(20.0), 40.0);
    assert_eq!(found.verdict, Verdict::Partial, "{found}");
    assert_eq!(found.dims, SplittingDims { stable: 1, center: 4, unstable: 1 });
}

#[test]
fn what_is_no_hamiltonian_system_is_no_control_problem() {
    let mut random = Random::new(23);
    for case in 0..20 {
        let a = DMatrix::from_fn(4, 4, |_, _| 2.0 * random.unit());
        let found = diagnosed(a, &evenly(6.0), 40.0);
        assert!(matches!(found.verdict, Verdict::NotHamiltonian { .. }), "{case}: {found}");
        assert!(!found.is_hyper_sensitive());
        assert!(found.to_string().starts_with("not an optimal control problem"), "{found}");
    }
    // of three directions the one in the middle must be neutral
    let odd = DMatrix::from_diagonal(&dvector![-1.0, 0.5, 1.0]);
    assert!(matches!(diagnosed(odd, &evenly(6.0), 6.0).verdict, Verdict::NotHamiltonian { .. }));
}

#[test]
fn what_averaging_times_do_not_tell_is_undetermined() {
    let saddle = DMatrix::from_diagonal(&dvector![0.05, -0.05]);
    for (times, why) in [
        (vec![1.0], Unknown::Span),
        (vec![40.0, 80.0], Unknown::Span),
        // slow for now, fast against a horizon of hours
        (evenly(10.0), Unknown::Short),
    ] {
        let found = diagnosed(saddle.clone(), &times, 1e4);
        assert_eq!(found.verdict, Verdict::Undetermined(why), "{times:?}: {found}");
        assert!(found.to_string().starts_with("undetermined: "), "{found}");
    }
    assert_eq!(diagnosed(saddle.clone(), &evenly(200.0), 1e4).verdict, Verdict::Complete);
    assert_eq!(diagnosed(saddle.clone(), &evenly(10.0), 10.0).verdict, Verdict::Insensitive);
}

#[test]
fn the_arm_is_the_same_in_other_units_of_cost() {
    let nodes = arm_nodes();
    for factor in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        let thesis = ArmMinimumTorque::default();
        let weights = thesis.weights().map(|w| w * factor);
        let arm = ArmMinimumTorque::try_new(*thesis.arm(), weights).expect("positive");
        let flow = VariationalFlow::try_new(&arm, TIGHT).expect("in range");
        for (k, direction) in
            [(0, TimeDirection::Forward), (20, TimeDirection::Forward), (40, TimeDirection::Backward)]
        {
            let p = DVector::from_fn(8, |i, _| nodes[k].1[i] * if i < 4 { 1.0 } else { factor });
            let times: Vec<f64> = (1..=20).map(|k| 0.25 * k as f64).collect();
            let found = diagnose(&spectra(&flow, &p, direction, &times).expect("regular"), 10.0);
            let found = found.expect("ascending");
            println!("{factor:e} {k}: {found}");
            assert_eq!(found.verdict, Verdict::Partial, "{factor:e}, {k}: {found}");
            assert_eq!(found.dims, SplittingDims { stable: 2, center: 4, unstable: 2 }, "{factor:e}, {k}");
        }
    }
}
