//! Lower minima of frames that were led into wrong ones.
//!
//! Three things leave a wrong minimum. Every frame of number [`STRIDE`], 2 [`STRIDE`], … and the last are begun from the starts
//! too. In each frame every joint is turned through its range with all else fixed, and where the cost is least on the way,
//! elsewhere than now, the frame is begun anew; so it is from the other end of a range if the joint is at one. And what one frame has found its neighbours are begun from, on both sides,
//! as long as any gets lower. What is lower by rounding only is left.

use super::frame::{FrameFit, FrameFitter, Until};
use super::motion::{Targets, expect};
use super::starts::{Starts, is_better};
use super::{Estimate, FitError, MarkerFit};
use crate::GoOn;
use rayon::prelude::*;
use std::collections::VecDeque;

/// Frames between those that are begun anew.
const STRIDE: usize = 8;
/// Parts of a joint's range between the places where the cost is looked at.
const PARTS: usize = 8;
/// A search that may be given up ends where the cost falls by a smaller share.
const COARSE: f64 = 1e-3;

/// Lowers what can be lowered in the frames of a motion.
pub(super) fn lower(
    fit: &MarkerFit,
    starts: &Starts,
    targets: &[Targets],
    frames: &mut [FrameFit],
    go_on: GoOn,
) -> Result<(), FitError> {
    let last = frames.len() - 1;
    let far = (last % STRIDE > STRIDE / 2).then_some(last);
    let leave = |fitter: &mut FrameFitter, (i, found): (usize, &mut FrameFit)| {
        expect(go_on)?;
        let begun = found.cost;
        // nothing is lower than no residual, or no marker
        if !is_better(0.0, begun) {
            return Ok(false);
        }
        if (i > 0 && i % STRIDE == 0) || Some(i) == far {
            let start = starts.best(fitter, &targets[i], found.cost)?;
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
    spread(fit, targets, frames, &lowered, go_on)
}

/// Begins the frame anew with one joint turned, as long as that is lower.
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
    go_on: GoOn,
) -> Result<(), FitError> {
    let mut fitter = FrameFitter::new(fit.model(), fit.markers(), fit.options());
    let seen: Vec<usize> = (0..frames.len()).filter(|&i| targets[i].iter().any(Option::is_some)).collect();
    let after = (1..seen.len()).rev().map(|k| (k, k - 1));
    let before = (1..seen.len()).filter(|&k| lowered[seen[k - 1]]).map(|k| (k - 1, k));
    let mut led: VecDeque<(usize, usize)> = after.chain(before).collect();
    while let Some((leader, k)) = led.pop_front() {
        expect(go_on)?;
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
