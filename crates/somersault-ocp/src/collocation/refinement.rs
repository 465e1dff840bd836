//! From a solution to a finer mesh.
//!
//! In an interval with N points the solution is compared with the integral of f along itself, by N + 1 points:
//!
//! ```text
//! X̂(τ_i) = X(−1) + (h/2) Σ_j A_ij f(X(τ_j), U(τ_j)),   e = max over i, states of |X̂ − X|/(1 + max |X|)
//! ```
//! Differences of quaternions are rotation vectors, rad. Where e exceeds the tolerance ε, the interval gets P = ⌈log_N(e/ε)⌉ more points (Patterson, Hager & Rao 2015),
//! or, where these are too many or the solution is not smooth, is divided. Not smooth is a state whose Legendre
//! coefficients fall by less than a factor 10^0.5 with each degree (Liu, Hager & Rao 2018).
//!
//! An interval whose [cost, costates, Hamiltonian or bounds](super::optimality) are not accurate enough is divided by four
//! where a bound begins or ceases to act in it, which grades the mesh towards that place, and gets two more points elsewhere.

use super::error::CollocationError;
use super::function::VectorFunction;
use super::mesh::Mesh;
use super::optimality::{Accuracy, IntervalOptimality};
use super::problem::Phase;
use super::quaternions::{in_body_axes, set_sizes};
use super::radau::Radau;
use super::solution::{PhaseSolution, combine};
use nalgebra::DMatrix;

/// Decades per degree that Legendre coefficients of a smooth solution lose at least.
const SMOOTH_DECAY: f64 = 0.5;
/// Fewest coefficients to tell a decay from.
const TELLING: usize = 5;

/// What there is to know of an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct IntervalError {
    /// e.
    pub(super) relative: f64,
    pub(super) is_smooth: bool,
}

/// The errors of all intervals.
pub(super) fn errors(
    phase: &mut Phase,
    solution: &PhaseSolution,
) -> Result<Vec<IntervalError>, CollocationError> {
    let duration = solution.horizon.duration();
    let n_states = phase.sizes.states;
    let mut arguments = vec![0.0; phase.sizes.point()];
    let (mut at, mut differences) = (vec![0.0; n_states], vec![0.0; n_states]);
    let mut errors = Vec::new();
    for interval in &solution.grid.intervals {
        let n = interval.radau.len();
        let finer = Radau::try_new(n + 1)?;
        let half = 0.5 * duration * interval.length;
        let (mut state_basis, mut control_basis) = (vec![0.0; n + 1], vec![0.0; n]);
        // x at the finer nodes, f at the finer points
        let mut states = DMatrix::zeros(n + 2, n_states);
        let mut rates = DMatrix::zeros(n + 1, n_states);
        let mut rate = vec![0.0; n_states];
        for (j, &tau) in finer.state_nodes().iter().enumerate() {
            interval.radau.state_basis(tau, &mut state_basis);
            let (state, rest) = arguments.split_at_mut(n_states);
            combine(&solution.states[interval.first..], &state_basis, state);
            states.row_mut(j).iter_mut().zip(&*state).for_each(|(to, x)| *to = *x);
            if j > n {
                break;
            }
            interval.radau.control_basis(tau, &mut control_basis);
            let (control, rest) = rest.split_at_mut(phase.sizes.controls);
            combine(&solution.controls[interval.first..], &control_basis, control);
            let (parameters, time) = rest.split_at_mut(phase.sizes.parameters);
            parameters.copy_from_slice(&solution.parameters);
            time[0] = solution.horizon.time(interval.start + 0.5 * (tau + 1.0) * interval.length);
            phase.dynamics.evaluate(&arguments, &mut rate)?;
            rates.row_mut(j).iter_mut().zip(&rate).for_each(|(to, x)| *to = half * x);
        }
        let integrals = finer.integration() * rates;
        let mut relative: f64 = 0.0;
        let mut sizes: Vec<f64> = states.column_iter().map(|state| 1.0 + state.amax()).collect();
        set_sizes(&phase.quaternions, &mut sizes);
        for i in 0..=n {
            for (s, difference) in differences.iter_mut().enumerate() {
                *difference = states[(0, s)] + integrals[(i, s)] - states[(i + 1, s)];
                at[s] = states[(i + 1, s)];
            }
            in_body_axes(&phase.quaternions, &at, &mut differences);
            for (difference, size) in differences.iter().zip(&sizes) {
                let error = difference.abs() / size;
                relative = if error.is_finite() { relative.max(error) } else { f64::INFINITY };
            }
        }
        errors.push(IntervalError { relative, is_smooth: is_smooth(&finer, &states, n) });
    }
    Ok(errors)
}

/// Whether the Legendre coefficients of all states, of degree `n`, fall fast enough.
fn is_smooth(finer: &Radau, states: &DMatrix<f64>, n: usize) -> bool {
    if n < TELLING {
        return true;
    }
    states.column_iter().all(|state| {
        let mut coefficients = vec![0.0; n + 1];
        for (j, (&x, w)) in finer.points().iter().zip(finer.weights()).enumerate() {
            let (mut before, mut last) = (0.0, 1.0);
            for (k, c) in coefficients.iter_mut().enumerate() {
                let degree = k as f64;
                *c += (degree + 0.5) * w * state[j] * last;
                (before, last) = (last, ((2.0 * degree + 1.0) * x * last - degree * before) / (degree + 1.0));
            }
        }
        let size = coefficients.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        // what is rounding says nothing about smoothness
        let told: Vec<(f64, f64)> = (1..=n)
            .map(|k| (k as f64, coefficients[k].abs()))
            .filter(|&(_, c)| c > 1e-12 * size)
            .map(|(k, c)| (k, c.log10()))
            .collect();
        told.len() < TELLING || slope(&told) < -SMOOTH_DECAY
    })
}

/// Of the straight line nearest to points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (mixed, square) =
        points.iter().fold((0.0, 0.0), |(m, s), p| (m + (p.0 - x) * (p.1 - y), s + (p.0 - x) * (p.0 - x)));
    mixed / square
}

/// What becomes of an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Wish {
    /// It stays.
    Keep,
    /// Its error of the states falls by this factor: more points, or parts where it is not smooth.
    Reduce {
        /// Error in tolerances.
        excess: f64,
        /// Whether more points help.
        is_smooth: bool,
    },
    /// More points, or parts where it has as many as it may.
    Enrich,
    /// Parts, as many times as it takes until a place where it is not smooth lies in a short one.
    Divide,
}

/// Parts of an interval where a bound begins or ceases to act.
const PARTS: usize = 4;
/// Points that an interval gets where something else than its equations is not accurate.
const MORE_POINTS: usize = 2;
/// Length in parts of the phase below which an interval is not divided.
const SHORTEST: f64 = 1e-9;

/// What errors ask of the intervals of all phases. `cost` is the size of the cost that its error is relative to.
pub(super) fn wishes(
    errors: &[Vec<IntervalError>],
    optimality: &[Vec<IntervalOptimality>],
    cost: f64,
    tolerance: f64,
) -> Vec<Vec<Wish>> {
    // The largest errors of the cost, until half the tolerance is left for all others.
    let mut costs: Vec<f64> = optimality.iter().flatten().map(|found| found.accuracy.cost).collect();
    costs.sort_by(f64::total_cmp);
    let mut rest = 0.5 * tolerance * cost;
    let mut least = f64::INFINITY;
    for found in costs {
        if found > rest {
            least = found;
            break;
        }
        rest -= found;
    }
    let wish = |(error, found): (&IntervalError, &IntervalOptimality)| {
        let excess = error.relative / tolerance;
        let is_costly = found.accuracy.cost >= least || found.accuracy.cost.is_nan();
        let is_far = is_costly || !Accuracy { cost: 0.0, ..found.accuracy }.meets(tolerance);
        match (excess > 1.0 || excess.is_nan(), is_far, found.switches) {
            (false, false, _) => Wish::Keep,
            (_, true, true) => Wish::Divide,
            (false, true, false) => Wish::Enrich,
            (true, _, _) => Wish::Reduce { excess, is_smooth: error.is_smooth },
        }
    };
    errors.iter().zip(optimality).map(|(e, o)| e.iter().zip(o).map(wish).collect()).collect()
}

/// The next mesh: each interval as it is, with more points, or divided.
pub(super) fn refined(
    mesh: &Mesh,
    wishes: &[Wish],
    min_points: usize,
    max_points: usize,
) -> Result<Mesh, CollocationError> {
    let (mut bounds, mut points) = (vec![0.0], Vec::new());
    for (k, wish) in wishes.iter().enumerate() {
        let (start, end, n) = (mesh.bounds()[k], mesh.bounds()[k + 1], mesh.points()[k]);
        let (parts, each) = match *wish {
            Wish::Keep => (1, n),
            Wish::Divide if end - start < SHORTEST => (1, n),
            Wish::Divide => (PARTS, min_points),
            Wish::Enrich if n + MORE_POINTS <= max_points => (1, (n + MORE_POINTS).max(min_points)),
            Wish::Enrich => (2, min_points.max(max_points / 2)),
            Wish::Reduce { excess, is_smooth } => {
                let more = excess.max(1.0).ln() / (n.max(2) as f64).ln();
                // an error without a number asks for as much as one can get
                let wanted = n + if more.is_finite() { more.ceil() as usize } else { max_points };
                if wanted <= max_points && is_smooth {
                    (1, wanted.max(min_points))
                } else {
                    ((wanted.min(2 * max_points).div_ceil(min_points)).max(2), min_points)
                }
            }
        };
        for part in 1..=parts {
            let fraction = part as f64 / parts as f64;
            bounds.push(if part == parts { end } else { start + fraction * (end - start) });
            points.push(each);
        }
    }
    Mesh::try_new(bounds, points)
}
