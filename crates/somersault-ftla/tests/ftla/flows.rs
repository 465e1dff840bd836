//! Flows of any field: long runs, fields of exponents, ridges, and laws of growth.

use nalgebra::{DMatrix, DVector, dvector};
use somersault_core::random::SplitMix64;
use somersault_expr::{Block, ExprFunction, Symbol};
use somersault_ftla::budget::{Limit, Limits};
use somersault_ftla::flow::{FlowError, FlowTolerances, VariationalFlow};
use somersault_ftla::ftle::{Grid, PointStatus, Ridge, RidgeCriteria, ftle_field};
use somersault_ftla::spectrum::{
    ExponentConvergence, Growth, Law, LongRun, SpectraConvergence, TimeDirection, Unsettled, spectra,
    spectrum,
};
use somersault_ftla::system::{TracedField, VectorField};
use std::f64::consts::PI;

const LOOSE: FlowTolerances = FlowTolerances { relative: 1e-9, absolute: 1e-11 };

/// The field that a formula of states and time writes.
fn traced<F>(n: usize, formula: F) -> TracedField
where
    F: for<'g> Fn(&[Symbol<'g>], Symbol<'g>) -> Vec<Symbol<'g>>,
{
    let blocks = vec![Block::new("x", vec![n]), Block::new("t", vec![])];
    let function = ExprFunction::trace(blocks, |inputs| formula(&inputs[0], inputs[1][0])).expect("small");
    TracedField::try_new(&function).expect("a field")
}

fn lorenz() -> TracedField {
    traced(3, |x, _| {
        let [x, y, z] = [x[0], x[1], x[2]];
        vec![(y - x) * 10.0, x * (-z + 28.0) - y, x * y - z * (8.0 / 3.0)]
    })
}

/// Shadden, Lekien and Marsden (2005): A = 0.1, ω = 2π/10, ε = 0.25.
fn double_gyre() -> TracedField {
    traced(2, |p, t| {
        let [x, y] = [p[0], p[1]];
        let a = (t * (0.2 * PI)).sin() * 0.25;
        let f = a * x * x + (-(a * 2.0) + 1.0) * x;
        let slope = a * x * 2.0 - a * 2.0 + 1.0;
        let (angle, height) = (f * PI, y * PI);
        vec![-(angle.sin() * height.cos()) * (0.1 * PI), angle.cos() * height.sin() * slope * (0.1 * PI)]
    })
}

fn pendulum() -> TracedField {
    traced(2, |p, _| vec![p[1], -p[0].sin()])
}

fn shear() -> TracedField {
    traced(2, |p, _| vec![p[1], p[0] * 0.0])
}

fn flow<S: VectorField>(system: &S) -> VariationalFlow<'_, S> {
    VariationalFlow::try_new(system, LOOSE).expect("in range")
}

#[test]
fn lorenz_exponents_over_long_times_are_those_of_the_literature() {
    // J. C. Sprott, Chaos and Time-Series Analysis (2003): 0.9056, 0, −14.5723 and a dimension of 2.062
    let system = lorenz();
    let found = LongRun::new(3000.0).spectrum(&flow(&system), &dvector![1.0, 1.0, 20.0]).expect("bounded");
    let golden = [0.9056, 0.0, -14.5723];
    for i in 0..3 {
        let gap = (found.exponents[i] - golden[i]).abs();
        assert!(gap < 4.0 * found.errors[i] + 1e-4 && found.errors[i] < 0.02, "{found:?}");
    }
    let laws: Vec<_> = found.growths.iter().map(|growth| growth.law).collect();
    assert_eq!(laws, [Law::Exponential, Law::Neutral, Law::Exponential]);
    assert!(found.is_converged() && (found.kaplan_yorke_dimension() - 2.062).abs() < 2e-3);
    // the divergence is −(σ + 1 + β)
    assert!((found.exponents.sum() + 10.0 + 1.0 + 8.0 / 3.0).abs() < 1e-8, "{}", found.exponents.sum());
}

#[test]
fn roessler_exponents_are_those_of_the_literature() {
    // Sprott (2003): 0.0714, 0, −5.3943 at a = b = 0.2, c = 5.7
    let system = traced(3, |x, _| vec![-x[1] - x[2], x[0] + x[1] * 0.2, x[2] * (x[0] - 5.7) + 0.2]);
    let found = LongRun::new(5000.0).spectrum(&flow(&system), &dvector![1.0, 1.0, 1.0]).expect("bounded");
    for (i, golden) in [0.0714, 0.0, -5.3943].into_iter().enumerate() {
        assert!((found.exponents[i] - golden).abs() < 4.0 * found.errors[i] + 5e-4, "{found:?}");
    }
    assert!(found.is_converged(), "{}", found.convergence);
}

#[test]
fn exponents_of_linear_fields_are_real_parts_of_eigenvalues() {
    // a random matrix similar to diag(1.5, 0.3 ± 2i, −0.7)
    let blocks = nalgebra::dmatrix![1.5, 0., 0., 0.; 0., 0.3, 2.0, 0.; 0., -2.0, 0.3, 0.; 0., 0., 0., -0.7];
    let mut random = SplitMix64::new(7);
    let mixing = DMatrix::from_fn(4, 4, |i, j| f64::from(u8::from(i == j)) + 0.4 * (random.unit() - 0.5));
    let a = &mixing * blocks * mixing.clone().try_inverse().expect("near one");
    let system = traced(4, |x, _| {
        let row = |i: usize| (1..4).fold(x[0] * a[(i, 0)], |sum, j| sum + x[j] * a[(i, j)]);
        (0..4).map(row).collect()
    });
    let run = LongRun { tolerance: 1e-3, ..LongRun::new(200.0) };
    let found = run.spectrum(&flow(&system), &DVector::zeros(4)).expect("linear");
    for (i, rate) in [1.5, 0.3, 0.3, -0.7].into_iter().enumerate() {
        assert!((found.exponents[i] - rate).abs() < 2e-3, "{}", found.exponents);
    }
    assert!(found.is_converged(), "{}", found.convergence);
    let back =
        LongRun { duration: -200.0, ..run }.spectrum(&flow(&system), &DVector::zeros(4)).expect("linear");
    for (i, rate) in [0.7, -0.3, -0.3, -1.5].into_iter().enumerate() {
        assert!((back.exponents[i] - rate).abs() < 2e-3, "{}", back.exponents);
    }
}

#[test]
fn growth_like_a_power_is_never_called_a_rate() {
    let run = LongRun::new(2000.0);
    let system = shear();
    let found = run.spectrum(&flow(&system), &dvector![0.0, 1.0]).expect("linear");
    let laws: Vec<_> = found.growths.iter().map(|growth| growth.law).collect();
    assert_eq!(laws, [Law::Power; 2]);
    assert!((found.growths[0].power - 1.0).abs() < 1e-2 && (found.growths[1].power + 1.0).abs() < 1e-2);
    assert!(
        matches!(found.convergence, ExponentConvergence::Power { number: 1, .. }),
        "{}",
        found.convergence
    );
    assert!(found.convergence.to_string().contains("T to the power 1.00"), "{}", found.convergence);
    // so does the phase of a pendulum, with oscillations on top
    let system = pendulum();
    for duration in [500.0, 2000.0, 5000.0] {
        let found = LongRun::new(duration).spectrum(&flow(&system), &dvector![2.0, 0.0]).expect("bounded");
        assert!(!found.is_converged() && found.exponents[0] <= found.errors[0] * 1.5, "{duration} {found:?}");
    }
    // x = (2t + 1)^(−1/2): δx falls like t^(−3/2)
    let system = traced(1, |x, _| vec![-(x[0] * x[0] * x[0])]);
    let found = run.spectrum(&flow(&system), &dvector![1.0]).expect("bounded");
    assert!((found.growths[0].power + 1.5).abs() < 1e-2 && !found.is_converged(), "{found:?}");
    // δx = e^(√(1 + t) − 1)
    let system = traced(1, |x, t| vec![x[0] * 0.5 / (t + 1.0).sqrt()]);
    let found = run.spectrum(&flow(&system), &dvector![1.0]).expect("bounded");
    assert_eq!(found.growths[0].law, Law::Unknown(Unsettled::Trend), "{found:?}");
    assert!(!found.is_converged());
    // δx = 1 + t³
    let system = traced(1, |x, t| vec![x[0] * t * t * 3.0 / (t * t * t + 1.0)]);
    let found = run.spectrum(&flow(&system), &dvector![1.0]).expect("bounded");
    assert!(found.growths[0].law == Law::Power && (found.growths[0].power - 3.0).abs() < 1e-2, "{found:?}");
}

#[test]
fn a_rate_too_slow_for_the_run_is_not_called_zero() {
    // 1e-3 over 100 s is a tenth of a time constant
    let system = traced(1, |x, _| vec![x[0] * 1e-3]);
    for duration in [10.0, 100.0, 1000.0] {
        let found = LongRun::new(duration).spectrum(&flow(&system), &dvector![0.0]).expect("linear");
        assert!(!found.is_converged(), "{duration} {found:?}");
    }
    let found = LongRun::new(1e4).spectrum(&flow(&system), &dvector![0.0]).expect("linear");
    assert!(found.is_converged() && (found.exponents[0] - 1e-3).abs() < 1e-9, "{found:?}");
}

#[test]
fn neutral_exponents_converge_once_the_time_is_long_against_the_field() {
    let system = traced(2, |x, _| vec![x[1] * 3.0, -x[0] / 3.0]);
    let short = LongRun::new(1.0).spectrum(&flow(&system), &dvector![1.0, 0.0]).expect("bounded");
    assert!(!short.is_converged(), "{short:?}");
    let long = LongRun::new(2000.0).spectrum(&flow(&system), &dvector![1.0, 0.0]).expect("bounded");
    assert!(long.is_converged() && long.exponents.amax() < 2e-3, "{long:?}");
}

#[test]
fn laws_of_growth_are_told_apart_under_noise() {
    let mut random = SplitMix64::new(3);
    let times: Vec<f64> = (1..=400).map(|k| 2.5 * f64::from(k)).collect();
    let (mut wrong, mut unsettled) = (0, 0);
    for case in 0..300 {
        // a random walk of the logarithm, as in chaotic motion
        let rate = [0.0, 0.02, 0.5][case % 3];
        let mut walk = 0.0;
        let logs: Vec<f64> = times
            .iter()
            .map(|t| {
                walk += 0.4 * (random.unit() - 0.5);
                rate * t + walk
            })
            .collect();
        let law = Growth::of(&times, &logs).law;
        let expected = if rate == 0.0 { Law::Neutral } else { Law::Exponential };
        wrong += usize::from(law != expected && !matches!(law, Law::Unknown(_)));
        unsettled += usize::from(matches!(law, Law::Unknown(_)));
    }
    // a random walk without drift looks like a power of time a few times in a hundred
    assert!(wrong <= 9 && unsettled <= 15, "{wrong} {unsettled}");
    let power: Vec<f64> = times.iter().map(|t| 2.0 * t.ln() + 0.05 * (random.unit() - 0.5)).collect();
    assert_eq!(Growth::of(&times, &power).law, Law::Power);
    assert_eq!(Growth::of(&times[..10], &power[..10]).law, Law::Unknown(Unsettled::FewTimes));
    assert_eq!(Growth::of(&[], &[]).law, Law::Unknown(Unsettled::FewTimes));
    assert_eq!(Growth::of(&times, &vec![f64::NEG_INFINITY; 400]).law, Law::Unknown(Unsettled::NoValue));
}

#[test]
fn directions_settle_at_the_gap_of_the_rates_and_in_a_shear_do_not() {
    // rates 1 and −2 along directions at an angle
    let system = traced(2, |x, _| vec![x[0] + x[1] * 0.9, -x[1] * 2.0]);
    let times: Vec<f64> = (1..=40).map(|k| 0.25 * f64::from(k)).collect();
    let found = spectra(&flow(&system), &DVector::zeros(2), TimeDirection::Forward, &times).expect("linear");
    let told = SpectraConvergence::of(&found, 1e-2).expect("one family");
    assert_eq!(told.convergence, ExponentConvergence::Converged);
    let settling = told.subspaces[0];
    // the angle falls as the ratio of stretches does
    assert!((settling.rate - 3.0).abs() < 0.1, "{settling:?}");
    assert!(settling.change < 1e-6 && (settling.gap.rate - 3.0).abs() < 1e-2, "{settling:?}");
    let (system, long) = (shear(), times.iter().map(|t| 10.0 * t).collect::<Vec<_>>());
    let found = spectra(&flow(&system), &DVector::zeros(2), TimeDirection::Forward, &long).expect("linear");
    let told = SpectraConvergence::of(&found, 1e-2).expect("one family");
    assert!(matches!(told.convergence, ExponentConvergence::Power { .. }), "{}", told.convergence);
    assert_eq!(told.subspaces[0].gap.law, Law::Power);
}

#[test]
fn a_field_of_time_starts_at_its_time_and_returns() {
    // ẋ = cos(t) x: x(t₀ + T)/x(t₀) = e^(sin(t₀ + T) − sin t₀)
    let system = traced(1, |x, t| vec![t.cos() * x[0]]);
    assert!(!system.is_autonomous() && lorenz().is_autonomous());
    for (start, duration) in [(0.0, 2.0), (1.7, 3.0), (1e4, 5.0), (0.3, -4.0)] {
        let found = flow(&system).starting_at(start).transition(&dvector![2.0], duration).expect("bounded");
        let stretch = f64::exp((start + duration).sin() - start.sin());
        assert!((found.matrix[(0, 0)] - stretch).abs() < 1e-8 * stretch, "{start} {duration}");
        assert!((found.end[0] - 2.0 * stretch).abs() < 2e-8 * stretch);
    }
    let system = double_gyre();
    let there = flow(&system).transition(&dvector![0.6, 0.3], 15.0).expect("bounded");
    let back = flow(&system).starting_at(15.0).transition(&there.end, -15.0).expect("bounded");
    assert!((&back.end - dvector![0.6, 0.3]).amax() < 1e-6, "{}", back.end);
    assert!((back.matrix * there.matrix - DMatrix::identity(2, 2)).amax() < 1e-4);
}

#[test]
fn traced_jacobians_are_those_of_differences() {
    let system = double_gyre();
    let (t, p, h) = (3.1, [0.7, 0.4], 1e-6);
    let (mut f, mut d) = (vec![0.0; 2], DMatrix::zeros(2, 2));
    system.linearize_at(t, &Default::default(), &p, &mut f, &mut d);
    for k in 0..2 {
        let (mut ahead, mut behind) = (p, p);
        ahead[k] += h;
        behind[k] -= h;
        let (mut a, mut b) = (vec![0.0; 2], vec![0.0; 2]);
        system.field_at(t, &Default::default(), &ahead, &mut a);
        system.field_at(t, &Default::default(), &behind, &mut b);
        for i in 0..2 {
            assert!((d[(i, k)] - (a[i] - b[i]) / (2.0 * h)).abs() < 1e-8);
        }
    }
}

#[test]
fn fields_of_exponents_are_those_of_single_points_and_say_how_each_ended() {
    let system = double_gyre();
    let (nx, ny) = (13, 7);
    let points: Vec<f64> =
        (0..nx * ny).flat_map(|k| [2.0 * (k % nx) as f64 / 12.0, (k / nx) as f64 / 6.0]).collect();
    let domain = [[0.0, 2.0], [0.0, 1.0]];
    let flow = flow(&system).starting_at(0.5);
    let inside = flow.clone().inside(&domain);
    for duration in [15.0, -15.0] {
        let found = ftle_field(&inside, &points, duration).expect("bounded");
        // the boundary is invariant
        assert!(found.statuses.iter().all(|status| *status == PointStatus::Arrived));
        for k in [0, 17, 44, 90] {
            let p = DVector::from_column_slice(&points[2 * k..2 * k + 2]);
            let matrix = flow.transition(&p, duration).expect("bounded").matrix;
            let largest = matrix.singular_values()[0];
            assert!((found.exponents[k] - largest.ln() / 15.0).abs() < 1e-6, "{k}");
            let direction = DVector::from_column_slice(&found.directions[2 * k..2 * k + 2]);
            assert!(((&matrix * direction).norm() - largest).abs() < 1e-5 * largest, "{k}");
        }
    }
    let small = [[0.0, 0.7], [0.0, 1.0]];
    let found = ftle_field(&flow.inside(&small), &points, 15.0).expect("bounded");
    let left = found.statuses.iter().filter(|status| **status == PointStatus::LeftDomain).count();
    assert!(left > 40, "{left}");
    for (k, status) in found.statuses.iter().enumerate() {
        assert_eq!(found.exponents[k].is_nan(), *status != PointStatus::Arrived);
        assert_eq!(found.ends[2 * k].is_nan(), *status != PointStatus::Arrived);
    }
}

#[test]
fn the_exponent_of_a_saddle_is_its_rate_everywhere() {
    let system = traced(2, |x, _| vec![x[0] * 0.8, -x[1] * 0.8]);
    let points = [0.0, 0.0, 3.0, -1.0, 1e-3, 1e3];
    let found = ftle_field(&flow(&system), &points, 20.0).expect("linear");
    for k in 0..3 {
        assert!((found.exponents[k] - 0.8).abs() < 1e-9 && found.directions[2 * k + 1].abs() < 1e-7);
    }
}

/// A field of closed form on a grid.
fn sampled(grid: Grid, f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let [nx, ny] = grid.count;
    let at = |k: usize, i: usize| grid.origin[k] + i as f64 * grid.spacing[k];
    (0..nx * ny).map(|k| f(at(0, k % nx), at(1, k / nx))).collect()
}

const EVERYTHING: RidgeCriteria = RidgeCriteria { height: f64::NEG_INFINITY, curvature: 0.0, length: 0.0 };

fn square(n: usize) -> Grid {
    // no node on the ridges below
    Grid { origin: [-1.5, -1.5], spacing: [3.0 / (n - 1) as f64; 2], count: [n, n] }
}

#[test]
fn a_circular_ridge_is_found_to_fourth_order_and_closed() {
    // σ = exp(−(r − 1)²/0.18): its ridge is r = 1
    let field = |x: f64, y: f64| (-(x.hypot(y) - 1.0).powi(2) / 0.18).exp();
    let criteria = RidgeCriteria { height: 0.5, curvature: 5.0, length: 0.1 };
    let error = |n: usize| {
        let grid = square(n);
        let ridges = grid.ridges(&sampled(grid, field), criteria).expect("a grid");
        assert_eq!(ridges.len(), 1, "{n}");
        let ridge = &ridges[0];
        assert_eq!(ridge.points.first(), ridge.points.last());
        assert!((ridge.length() - 2.0 * PI).abs() < 0.03, "{}", ridge.length());
        // σ'' = −1/0.09 across
        assert!(ridge.curvatures.iter().all(|c| (c * 0.09 - 1.0).abs() < 0.15), "{:?}", ridge.curvatures);
        ridge.points.iter().map(|p| (p[0].hypot(p[1]) - 1.0).abs()).fold(0.0, f64::max)
    };
    let errors = [error(42), error(84), error(168)];
    println!("{errors:?}");
    // 0.07 of the spacing, then by 2⁴ with each halving
    assert!(errors[0] < 0.07 * 3.0 / 41.0, "{errors:?}");
    assert!(errors[0] / errors[1] > 10.0 && errors[1] / errors[2] > 10.0, "{errors:?}");
}

#[test]
fn straight_ridges_are_found_where_they_are_and_valleys_are_not() {
    let along = |x: f64, y: f64| 0.3 * x - y;
    for sign in [1.0, -1.0] {
        let grid = square(50);
        let values = sampled(grid, |x, y| sign * (-along(x, y).powi(2) / 0.08).exp());
        let criteria = RidgeCriteria { height: if sign > 0.0 { 0.5 } else { -2.0 }, ..EVERYTHING };
        let ridges = grid.ridges(&values, criteria).expect("a grid");
        let on = |p: &[f64; 2]| along(p[0], p[1]).abs() < 1e-3;
        let found = ridges.iter().filter(|ridge| ridge.points.iter().all(on)).count();
        assert_eq!(found, usize::from(sign > 0.0));
    }
    // a hole in the field cuts the ridge in two, each nodes away from it
    let grid = square(50);
    let mut values = sampled(grid, |x, y| (-along(x, y).powi(2) / 0.08).exp());
    values[25 * 50 + 25] = f64::NAN;
    let criteria = RidgeCriteria { height: 0.5, length: 0.5, ..EVERYTHING };
    assert_eq!(grid.ridges(&values, criteria).expect("a grid").len(), 2);
    // on nodes exactly; those of the border have no derivatives
    let grid = Grid { origin: [-1.0, -1.0], spacing: [0.1, 0.1], count: [21, 21] };
    let ridges = grid.ridges(&sampled(grid, |_, y| -y * y), EVERYTHING).expect("a grid");
    assert!(ridges.len() == 1 && (ridges[0].length() - 1.8).abs() < 1e-9, "{ridges:?}");
}

#[test]
fn ridges_need_a_grid() {
    let grid = Grid { origin: [0.0; 2], spacing: [1.0; 2], count: [3, 4] };
    assert!(grid.ridges(&[0.0; 11], EVERYTHING).is_err());
    assert!(Grid { spacing: [0.0, 1.0], ..grid }.ridges(&[0.0; 12], EVERYTHING).is_err());
    assert!(Grid { origin: [f64::NAN, 1.0], ..grid }.ridges(&[0.0; 12], EVERYTHING).is_err());
    assert!(grid.ridges(&[0.0; 12], RidgeCriteria { height: f64::NAN, ..EVERYTHING }).is_err());
    assert!(grid.smoothed(&[0.0; 12], -1.0).is_err() && grid.smoothed(&[0.0; 11], 1.0).is_err());
    assert_eq!(
        grid.smoothed(&[2.0; 12], 1.0).map(|values| values.iter().all(|x| (x - 2.0).abs() < 1e-14)),
        Ok(true)
    );
    for count in [[0, 0], [1, 1], [0, 5], [2, 2], [3, 4]] {
        let grid = Grid { count, ..grid };
        assert_eq!(grid.ridges(&vec![1.0; count[0] * count[1]], EVERYTHING), Ok(Vec::new()));
        assert_eq!(grid.ridges(&vec![f64::NAN; count[0] * count[1]], EVERYTHING), Ok(Vec::new()));
    }
}

#[test]
fn the_ridge_of_a_pendulum_is_its_separatrix() {
    // the stable manifold of the upright rest is where the energy is that of the rest: ω = 2 cos(θ/2)
    let (system, h) = (pendulum(), 0.025);
    let grid = Grid { origin: [-2.0, 0.4], spacing: [h, h], count: [161, 89] };
    let points: Vec<f64> =
        (0..161 * 89).flat_map(|k| [-2.0 + h * (k % 161) as f64, 0.4 + h * (k / 161) as f64]).collect();
    let found = ftle_field(&flow(&system), &points, 8.0).expect("bounded");
    let of = |smoothing: f64| {
        let values = grid.smoothed(&found.exponents, smoothing).expect("a grid");
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        let height = 0.5 * (sorted[sorted.len() / 2] + sorted[sorted.len() - 1]);
        let criteria = RidgeCriteria { height, curvature: 0.0, length: 7.0 * h };
        let ridges = grid.ridges(&values, criteria).expect("a grid");
        let gap = |p: &[f64; 2]| (p[1] - 2.0 * (0.5 * p[0]).cos()).abs() / (0.5 * p[0]).sin().hypot(1.0) / h;
        let gaps: Vec<f64> = ridges.iter().flat_map(|ridge| ridge.points.iter().map(gap)).collect();
        let largest = gaps.iter().copied().fold(0.0, f64::max);
        let length: f64 = ridges.iter().map(Ridge::length).sum();
        println!("{smoothing}: {} ridges of {length}", ridges.len());
        (ridges.len(), length, gaps.iter().sum::<f64>() / gaps.len() as f64, largest)
    };
    // in spacings: a hundredth in the mean where nothing is smoothed, and then in pieces; its length here is 4.6
    let (_, length, mean, largest) = of(0.0);
    assert!(length > 2.5 && mean < 0.02 && largest < 0.05, "{length} {mean} {largest}");
    let (count, length, mean, largest) = of(1.0);
    assert!(count == 1 && length > 4.3 && mean < 0.03 && largest < 0.2, "{count} {length} {mean} {largest}");
}

#[test]
fn motions_that_end_early_say_so_and_keep_what_they_have() {
    // ẋ = x² from 1 is infinite at t = 1
    let system = traced(1, |x, _| vec![x[0] * x[0]]);
    let found = LongRun::new(2.0).spectrum(&flow(&system), &dvector![1.0]).expect("begins");
    assert!(
        matches!(found.ended, Some(FlowError::StepUnderflow { .. } | FlowError::NonFinite { .. })),
        "{found:?}"
    );
    assert!(
        !found.is_converged() && found.times.len() > 200 && found.times.len() < 260,
        "{}",
        found.times.len()
    );
    let field = ftle_field(&flow(&system), &[1.0, -1.0, 0.2], 2.0).expect("begins");
    assert_ne!(field.statuses[0], PointStatus::Arrived);
    assert_eq!(field.statuses[1..], [PointStatus::Arrived; 2]);
    // δx = 1/(1 − x t)²
    assert!((field.exponents[1] - (1.0f64 / 9.0).ln() / 2.0).abs() < 1e-8, "{}", field.exponents[1]);
    // the logarithm of what is negative
    let system = traced(1, |x, _| vec![x[0].ln() - 1.0]);
    let found = LongRun::new(20.0).spectrum(&flow(&system), &dvector![1.0]).expect("begins");
    assert!(found.ended.is_some() && !found.is_converged());
    let field = ftle_field(&flow(&system), &[-1.0], 1.0).expect("begins");
    assert_eq!(field.statuses, [PointStatus::NoValue]);
    // limits
    let system = lorenz();
    let budget = Limits { evaluations: Some(50_000), time: None }.start();
    let limited = flow(&system).within(&budget);
    let found = LongRun::new(1e5).spectrum(&limited, &dvector![1.0, 1.0, 20.0]).expect("begins");
    assert!(
        matches!(found.ended, Some(FlowError::LimitReached { limit: Limit::Evaluations(50_000), .. })),
        "{:?}",
        found.ended
    );
    assert!(found.work.evaluations < 51_000);
    // a stiff field needs more steps than are allowed
    let system = traced(2, |x, _| vec![x[1], (-(x[0] * x[0]) + 1.0) * x[1] * 1e6 - x[0]]);
    let field = ftle_field(&flow(&system).with_max_steps(1000), &[2.0, 0.0], 10.0).expect("begins");
    assert_eq!(field.statuses, [PointStatus::TooManySteps]);
}

#[test]
fn misuse_of_flows_is_a_typed_error() {
    let system = lorenz();
    let (flow, p) = (flow(&system), dvector![1.0, 1.0, 1.0]);
    let good = LongRun::new(10.0);
    for wrong in [
        LongRun { duration: 0.0, ..good },
        LongRun { duration: f64::NAN, ..good },
        LongRun { transient: 1.0, ..good },
        LongRun { transient: -0.1, ..good },
        LongRun { samples: 3, ..good },
        LongRun { samples: 1 << 40, ..good },
        LongRun { tolerance: 0.0, ..good },
    ] {
        assert!(matches!(wrong.spectrum(&flow, &p), Err(FlowError::Argument(_))), "{wrong:?}");
    }
    assert!(good.spectrum(&flow, &dvector![1.0]).is_err());
    assert!(good.spectrum(&flow, &dvector![1.0, f64::NAN, 0.0]).is_err());
    assert!(ftle_field(&flow, &[1.0, 2.0], 1.0).is_err());
    assert!(ftle_field(&flow, &[1.0, 2.0, 3.0], 0.0).is_err());
    assert!(ftle_field(&flow, &[], 1.0).expect("nothing to do").exponents.is_empty());
    // a function of other inputs, or of another number of outputs
    for (blocks, outputs) in [
        (vec![Block::new("x", vec![2])], 2),
        (vec![Block::new("x", vec![2]), Block::new("t", vec![])], 1),
        (vec![Block::new("x", vec![2]), Block::new("t", vec![2])], 2),
        (vec![Block::new("x", vec![2]), Block::new("t", vec![]), Block::new("u", vec![1])], 2),
    ] {
        let function = ExprFunction::trace(blocks, |inputs| inputs[0][..outputs].to_vec()).expect("small");
        assert!(TracedField::try_new(&function).is_err());
    }
}

#[test]
fn forty_states_have_exponents_that_add_up_to_the_divergence() {
    // Lorenz' 1996 model is of 40 states; its divergence is −40
    let system = traced(40, |x, _| {
        (0..40).map(|i| (x[(i + 1) % 40] - x[(i + 38) % 40]) * x[(i + 39) % 40] - x[i] + 8.0).collect()
    });
    let mut p = DVector::repeat(40, 8.0);
    p[19] += 0.01;
    let found = LongRun::new(60.0).spectrum(&flow(&system), &p).expect("bounded");
    assert!((found.exponents.sum() + 40.0).abs() < 1e-6, "{}", found.exponents.sum());
    // E. N. Lorenz and K. A. Emanuel, J. Atmos. Sci. 55 (1998) 399: errors double in 2.1 days of 0.2 units
    assert!((1.2..2.2).contains(&found.exponents[0]), "{}", found.exponents[0]);
    let single = spectrum(&flow(&system), &p, TimeDirection::Forward, 2.0).expect("bounded");
    assert!((single.exponents.sum() + 40.0).abs() < 1e-6);
}
