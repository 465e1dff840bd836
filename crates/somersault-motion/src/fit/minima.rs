//! Lower minima of frames that were led into wrong ones.
//!
//! Three things leave a wrong minimum. Every frame of number [`STRIDE`], 2 [`STRIDE`], … and the last are begun from the starts
//! too, and so are those that the frame before says little about: joints turned by more than [`UNRELATED`], or the cost is
//! more than [`COSTLY`] times the median. In each frame every joint is turned through its range with all else fixed, and where the cost is least on the way,
//! elsewhere than now, the frame is restarted; so it is from the other end of a range if the joint is at one. And what one frame has found its neighbours are begun from, on both sides,
//! as long as any gets lower. What is lower by rounding only is left.

use super::frame::{FitStatus, FrameFit, FrameFitter, Until};
use super::problem::{Target, Targets, expect_not_cancelled};
use super::starts::{Starts, is_better};
use super::{Estimate, FitError, MarkerFit};
use rayon::prelude::*;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::{Group, Joint};
use std::collections::VecDeque;

/// Frames between those that are restarted.
const STRIDE: usize = 8;
/// Parts of a joint's range between the places where the cost is looked at.
const PARTS: usize = 8;
/// Change of a joint from frame to frame, rad or m, by which the frame before is no neighbour.
const UNRELATED: f64 = 1.0;
/// Cost over the median of the frames from which on a frame may be in a wrong minimum.
const COSTLY: f64 = 4.0;
/// Residual from which on a frame may be mirrored, in fractions of the spread of its markers, and the fraction of the cost that the mirror
/// image must have.
const SUSPICIOUS: f64 = 0.04;
const MIRRORED: f64 = 0.25;
/// A search that may be given up ends where the cost falls by a smaller fraction.
const COARSE: f64 = 1e-3;

/// Lowers what can be lowered in the frames of a motion.
pub(super) fn lower(
    fit: &MarkerFit,
    starts: &Starts,
    targets: &[Targets],
    frames: &mut [FrameFit],
    token: &CancellationToken,
) -> Result<(), FitError> {
    let last = frames.len() - 1;
    let far = (last % STRIDE > STRIDE / 2).then_some(last);
    let alone = unrelated(fit, frames)?;
    let leave = |fitter: &mut FrameFitter, (i, found): (usize, &mut FrameFit)| {
        expect_not_cancelled(token)?;
        let begun = found.cost;
        // nothing is lower than no residual, or no marker
        if !is_better(0.0, begun) {
            return Ok(false);
        }
        if alone[i] || (i > 0 && i % STRIDE == 0) || Some(i) == far {
            // as the first frame of a recording is begun, where the one before says nothing
            let below = if alone[i] { f64::INFINITY } else { found.cost };
            let start = starts.best(fitter, &targets[i], below)?;
            lower_from(fitter, &targets[i], start, found)?;
        }
        turn_joints(fitter, &targets[i], found)?;
        Ok::<_, FitError>(found.cost < begun)
    };
    let lowered: Vec<bool> = frames
        .par_iter_mut()
        .enumerate()
        .map_init(|| FrameFitter::new(fit.model(), fit.markers(), fit.options()), leave)
        .collect::<Result<_, _>>()?;
    spread(fit, targets, frames, &lowered, token)
}

/// Which frames must be begun by themselves.
fn unrelated(fit: &MarkerFit, frames: &[FrameFit]) -> Result<Vec<bool>, FitError> {
    let model = fit.model();
    let n_root = model.velocities_of(0).len();
    let mut costs: Vec<f64> = frames.iter().filter(|f| f.rms.is_some()).map(|f| f.cost).collect();
    costs.sort_by(f64::total_cmp);
    let median = costs.get(costs.len() / 2).copied().unwrap_or(f64::INFINITY);
    let mut rates = vec![0.0; model.n_velocities()];
    let mut found = vec![false; frames.len()];
    for i in 1..frames.len() {
        model.difference(&frames[i - 1].estimate.q, &frames[i].estimate.q, &mut rates)?;
        let turned = rates[n_root..].iter().any(|rate| rate.abs() > UNRELATED);
        found[i] = turned || frames[i].cost > COSTLY * median;
    }
    Ok(found)
}

/// Says of frames whose residuals are large whether the model fits their mirror image much better.
pub(super) fn find_mirrored(
    fit: &MarkerFit,
    starts: &Starts,
    targets: &[Targets],
    frames: &mut [FrameFit],
    token: &CancellationToken,
) -> Result<(), FitError> {
    let root = fit.model().joint(0).map(Joint::group);
    let (Some(Group::Motions | Group::PlanarMotions), Some(placement)) = (root, fit.model().placement(0))
    else {
        return Ok(());
    };
    // in the plane of a planar root; in space all mirror images differ by a rotation
    let across = placement.rotation.column(0).into_owned();
    let examine = |fitter: &mut FrameFitter, (i, found): (usize, &mut FrameFit)| {
        expect_not_cancelled(token)?;
        let is_minimum = matches!(found.status, FitStatus::Converged | FitStatus::Misfit);
        if !is_minimum || found.cost <= fitter.cost_of_share(&targets[i], SUSPICIOUS) {
            return Ok(());
        }
        let mirror = |y: Target| Target { point: y.point - across * (2.0 * across.dot(&y.point)), ..y };
        let mirrored: Targets = targets[i].iter().map(|y| y.map(mirror)).collect();
        let below = MIRRORED * found.cost;
        if let Some(start) = starts.best(fitter, &mirrored, below)?
            && fitter.cost(&mirrored, &start)? < below
        {
            found.status = FitStatus::Mirrored;
        }
        Ok::<_, FitError>(())
    };
    frames
        .par_iter_mut()
        .enumerate()
        .map_init(|| FrameFitter::new(fit.model(), fit.markers(), fit.options()), examine)
        .collect()
}

/// Begins the frame again with one joint turned, as long as that is lower.
pub(super) fn turn_joints(
    fitter: &mut FrameFitter,
    targets: &Targets,
    found: &mut FrameFit,
) -> Result<(), FitError> {
    loop {
        let turned = fitter.turned(targets, &found.estimate)?;
        if !lower_from(fitter, targets, turned, found)? {
            return Ok(());
        }
    }
}

/// Begins each frame from the one after it, and neighbours of what was lowered from that, as long as any is lowered.
fn spread(
    fit: &MarkerFit,
    targets: &[Targets],
    frames: &mut [FrameFit],
    lowered: &[bool],
    token: &CancellationToken,
) -> Result<(), FitError> {
    let mut fitter = FrameFitter::new(fit.model(), fit.markers(), fit.options());
    let seen: Vec<usize> = (0..frames.len()).filter(|&i| targets[i].iter().any(Option::is_some)).collect();
    let after = (1..seen.len()).rev().map(|k| (k, k - 1));
    let before = (1..seen.len()).filter(|&k| lowered[seen[k - 1]]).map(|k| (k - 1, k));
    let mut led: VecDeque<(usize, usize)> = after.chain(before).collect();
    while let Some((leader, k)) = led.pop_front() {
        expect_not_cancelled(token)?;
        let start = frames[seen[leader]].estimate.clone();
        if lower_from(&mut fitter, &targets[seen[k]], [start], &mut frames[seen[k]])? {
            led.extend([k.wrapping_sub(1), k + 1].into_iter().filter(|&j| j < seen.len()).map(|j| (k, j)));
        }
    }
    Ok(())
}

/// Replaces `found` by what the searches from `starts` find lower, and says whether any did.
fn lower_from(
    fitter: &mut FrameFitter,
    targets: &Targets,
    starts: impl IntoIterator<Item = Estimate>,
    found: &mut FrameFit,
) -> Result<bool, FitError> {
    let begun = found.cost;
    if !is_better(0.0, begun) {
        return Ok(false);
    }
    for mut start in starts {
        let until = Until { share: COARSE, below: found.cost, ..Until::CONVERGED };
        let cost = fitter.minimize(targets, &mut start, until)?.2;
        if is_better(cost, found.cost * (1.0 + COARSE)) {
            let lower = fitter.fit(targets, &start)?;
            if is_better(lower.cost, found.cost) {
                *found = lower;
            }
        }
    }
    Ok(found.cost < begun)
}

impl FrameFitter<'_> {
    /// Estimates with one joint turned to where the cost is least on its way, and from one end of its range to the other.
    fn turned(&mut self, targets: &Targets, estimate: &Estimate) -> Result<Vec<Estimate>, FitError> {
        let mut found = Vec::new();
        let mut trial = estimate.clone();
        let mut costs = [0.0; PARTS + 1];
        for i in 1..self.unknowns.n() {
            let Some((at, [lower, upper])) = self.unknowns.range(i) else { continue };
            let now = estimate.q[at];
            let value = |k: usize| lower + (upper - lower) * k as f64 / PARTS as f64;
            for (k, cost) in costs.iter_mut().enumerate() {
                trial.q[at] = value(k);
                *cost = self.cost(targets, &trial)?;
            }
            let away = |k: usize| (value(k) - now).abs() * PARTS as f64 > 1.5 * (upper - lower);
            let least =
                |k: usize| (k == 0 || costs[k] < costs[k - 1]) && (k == PARTS || costs[k] < costs[k + 1]);
            let across = (now <= lower || now >= upper).then_some(lower + upper - now);
            for start in (0..=PARTS).filter(|&k| away(k) && least(k)).map(value).chain(across) {
                trial.q[at] = start;
                found.push(trial.clone());
            }
            trial.q[at] = now;
        }
        Ok(found)
    }
}
