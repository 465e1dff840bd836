//! Where a frame begins that has no neighbour to begin from.
//!
//! With the starts of the options; where there are none, with each posture of the base, or with the neutral posture and points
//! that fill the ranges of the joints evenly: start k has joint j of d at the fraction
//!
//! ```text
//! frac(½ + k φ^{−j}),  j = 1 … d,  φ^{d+1} = φ + 1
//! ```
//! of its range, the middle first. Joints that turn without limits have the range −π to π, what else has none stays neutral.
//!
//! Source: the sequence of Kronecker with the base of M. Roberts, *The unreasonable effectiveness of quasirandom sequences*,
//! 2018.

use super::estimate::{Estimate, Unknowns};
use super::frame::{FrameFitter, Until};
use super::problem::Target;
use super::{FitError, FitOptions, Shape};
use somersault_multibody::{Model, Turning};
use std::f64::consts::PI;

/// Points in the ranges of the joints.
const N_POINTS: usize = 15;
/// Iterations from every start, and how many of the best then continue.
const SHORT: usize = 8;
const BEST: usize = 3;

/// A lower minimum is worth leaving another for if it is lower by this fraction, 1.5 % of the residuals. What differs by less are mostly
/// branches of one shoulder, and jumps between them would be what principal components describe.
const LOWER: f64 = 0.03;
/// Costs below it are rounding, m².
const ROUNDING: f64 = 1e-18;

/// Whether `cost` is that of a lower minimum.
pub(super) fn is_better(cost: f64, than: f64) -> bool {
    cost < (1.0 - LOWER) * than - ROUNDING
}

/// The starts of a model.
pub(super) struct Starts(Vec<Estimate>);

impl Starts {
    pub(super) fn new(model: &Model, options: &FitOptions, unknowns: &Unknowns) -> Self {
        let given = options.starts.iter().map(|shape| unknowns.start(model, Some(shape)));
        if !options.starts.is_empty() {
            return Self(given.collect());
        }
        let mut starts = vec![unknowns.start(model, None)];
        match &options.shape {
            Shape::Eigenpostures(base) => {
                for k in 0..base.n_weights() {
                    let mut weights = vec![0.0; base.n_weights()];
                    weights[k] = 1.0;
                    starts.push(unknowns.start(model, Some(&weights)));
                }
            }
            Shape::Joints => {
                let points = joint_points(model);
                starts.extend(points.iter().map(|shape| unknowns.start(model, Some(shape))));
            }
        }
        Self(starts)
    }

    /// The best minimum of a frame from all the starts, each laid over the markers. Searches that will not come below `below` are
    /// given up. Of minima that are equally low that of the first start is taken: angles that no marker sees then stay neutral.
    pub(super) fn best(
        &self,
        fitter: &mut FrameFitter,
        frame: &[Option<Target>],
        below: f64,
    ) -> Result<Option<Estimate>, FitError> {
        let short = Until { iterations: SHORT, below, ..Until::CONVERGED };
        let mut found = Vec::with_capacity(self.0.len());
        for (k, start) in self.0.iter().enumerate() {
            let mut estimate = start.clone();
            fitter.align(frame, &mut estimate)?;
            let (_, _, cost) = fitter.minimize(frame, &mut estimate, short)?;
            found.push((k, cost, estimate));
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        found.truncate(BEST);
        found.sort_by_key(|(k, ..)| *k);
        let mut best: Option<(f64, Estimate)> = None;
        for (_, _, mut estimate) in found {
            let cost = fitter.minimize(frame, &mut estimate, Until { below, ..Until::CONVERGED })?.2;
            if best.as_ref().is_none_or(|(least, _)| is_better(cost, *least)) {
                best = Some((cost, estimate));
            }
        }
        Ok(best.map(|(_, estimate)| estimate))
    }
}

/// Coordinates of the joints beside the root's.
fn joint_points(model: &Model) -> Vec<Vec<f64>> {
    let root = model.positions_of(0).len();
    let range = |i: usize| {
        let limits = model.limits(i).filter(|limits| limits.iter().all(|x| x.is_finite()));
        limits.or_else(|| match model.joint(i)?.kind().turning {
            Turning::Angle => Some([-PI, PI]),
            Turning::None | Turning::Rotation => None,
        })
    };
    let ranges: Vec<(usize, [f64; 2])> = (1..model.n_bodies())
        .filter(|&i| model.positions_of(i).len() == 1)
        .filter_map(|i| Some((model.positions_of(i).start - root, range(i)?)))
        .collect();
    if ranges.is_empty() {
        return Vec::new();
    }
    let d = ranges.len() as f64;
    // a contraction to the root
    let base = (0..60).fold(1.5_f64, |x, _| (1.0 + x).powf(1.0 / (d + 1.0)));
    let point = |k: usize| {
        let mut shape = model.neutral()[root..].to_vec();
        for (j, (at, [lower, upper])) in ranges.iter().enumerate() {
            let share = (0.5 + k as f64 * base.powi(-(j as i32 + 1))).fract();
            shape[*at] = lower + share * (upper - lower);
        }
        shape
    };
    (0..N_POINTS).map(point).collect()
}
