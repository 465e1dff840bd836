//! Places along an extremal where it is looked at.

use super::flow::follow;
use super::shooting::{Iterate, Shooting};
use nalgebra::DMatrix;

/// Samples of a segment.
const SAMPLES: usize = 8;
/// What signs and bounds may miss, relative to the sizes of what has them.
pub(super) const SLACK: f64 = 1e-7;

/// A place on an arc.
pub(super) struct Sample {
    /// From the start of the motion.
    pub(super) time: f64,
    pub(super) point: Vec<f64>,
    pub(super) observed: Vec<f64>,
    /// ẋ, λ̇, L.
    pub(super) rates: Vec<f64>,
    /// From the sample before it on the same arc; the identity at the first.
    pub(super) transition: DMatrix<f64>,
}

/// Samples of each arc, both ends among them.
pub(super) fn samples(shooting: &mut Shooting<'_>, at: &Iterate) -> Option<Vec<Vec<Sample>>> {
    let mut all = Vec::new();
    let mut time = 0.0;
    let width = shooting.sizes.len();
    for (a, flow) in shooting.flows.iter_mut().enumerate() {
        let segments = at.nodes[a].len() - 1;
        let step = at.durations[a] / (segments * SAMPLES) as f64;
        let mut arc: Vec<Sample> = Vec::new();
        for s in 0..segments {
            let mut point = at.nodes[a][s].clone();
            flow.set_guess(&at.guesses[a][s]);
            for k in 0..=SAMPLES {
                let mut transition = DMatrix::identity(width, width);
                if k > 0 {
                    let arrival = follow(flow, shooting.sizes, &point, step, true, shooting.token)?;
                    point = arrival.point;
                    transition = arrival.transition?;
                } else if s > 0 {
                    continue;
                }
                let observed = flow.observed(&point)?;
                let rates = flow.rates_at(&point);
                let time = time + step * (s * SAMPLES + k) as f64;
                arc.push(Sample { time, point: point.clone(), observed, rates, transition });
            }
        }
        time += at.durations[a];
        all.push(arc);
    }
    Some(all)
}
