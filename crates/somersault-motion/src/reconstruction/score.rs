//! Whether departures from the laws of flight would make the residuals smaller: the score test, which searches none of them.
//!
//! ```text
//! d = βᵀ S⁻¹ β / n
//! ```
//! with the gradient β by n of the departures' factors λ and γ and the Schur complement S of their Hessian. Where the laws hold, n d has the
//! χ² distribution with n degrees of freedom. A size that was given is tested likewise; of gravity the step to the minimum is reported.
//!
//! Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50.

use super::ReconstructionError;
use super::attitude::Flown;
use super::departure::{FUNCTIONS, N_FUNCTIONS};
use super::normal::Normal;
use super::search::{Search, damped_step};
use crate::noise::chi_squared_quantile;
use faer::Mat;
use std::ops::Range;

/// Damping of departures that are no others than those of unknowns.
const WIDEST: f64 = 1e-8;
/// Standard deviations up to which a departure is by chance: one in 4000 is beyond.
const CHANCE: f64 = 3.5;
/// What d may differ from 1 by, whatever the noise is.
const TOLERANCE: f64 = 0.1;

/// What the score test finds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tested {
    /// d of the whole flight, of its start, of its end and of the size, each with its limit; NaN of a size that was sought.
    pub(super) departures: [[f64; 2]; 4],
    /// g over that of the model, one step of the search from the minimum, and its standard deviation.
    pub(super) gravity: [f64; 2],
}

impl Search<'_> {
    /// The departures and gravity at the minimum. None where the Hessian has no inverse.
    pub(super) fn tested(&mut self) -> Result<Option<Tested>, ReconstructionError> {
        self.expect_not_cancelled()?;
        let frames = self.all();
        let knots = self.knots(&frames);
        let Flown { model, splines, layout } = self.flown;
        let Self { markers, observed, trust, noise, prior, estimate, room, kinematics, .. } = self;
        let layout = layout.with_departures();
        let flown = Flown { model, splines, layout: &layout };
        let at = flown.fly(markers, observed, estimate, &frames, Some(&knots), room, kinematics)?;
        let Normal { mut matrix, mut gradient, .. } =
            flown.normal(markers, observed, estimate, &frames, Some(&knots), &at, trust, noise);
        prior.add(&layout, splines, estimate, &knots, &mut matrix, &mut gradient);
        for k in layout.departures() {
            matrix[(k, k)] += WIDEST * matrix[(k, k)];
        }
        let all = layout.departures();
        let each = all.len() / N_FUNCTIONS;
        let of_functions = |k: Range<usize>| all.start + k.start * each..all.start + k.end * each;
        let own = self.flown.layout;
        let one = |k: Option<usize>, is_sought: bool| k.filter(|_| !is_sought).map_or(0..0, |k| k..k + 1);
        let size = one(layout.scale(), own.has_scale);
        let gravity = one(layout.gravity(), own.has_gravity);
        let [whole, start, end] = FUNCTIONS.map(of_functions);
        let step_of = |tested: &Range<usize>| {
            let is_extra = |k: &usize| all.contains(k) || size.contains(k) || gravity.contains(k);
            let kept: Vec<usize> =
                (0..gradient.len()).filter(|k| tested.contains(k) || !is_extra(k)).collect();
            // the lower half stays the lower half
            let part = Mat::from_fn(kept.len(), kept.len(), |i, j| matrix[(kept[i], kept[j])]);
            let of_part: Vec<f64> = kept.iter().map(|k| gradient[*k]).collect();
            let (step, fall) = damped_step(&part, &of_part, 0.0)?;
            let first = kept.iter().position(|k| tested.contains(k))?;
            Some((step[first], fall))
        };
        let mut departures = [[f64::NAN; 2]; 4];
        for (found, tested) in departures.iter_mut().zip([whole, start, end, size.clone()]) {
            if tested.is_empty() {
                continue;
            }
            let Some((_, fall)) = step_of(&tested) else { return Ok(None) };
            // s² along gravity is gravity, where that is sought
            let n = tested.len() - usize::from(own.has_gravity && tested.len() > each);
            *found = [fall / n as f64, chi_squared_quantile(n, CHANCE) + TOLERANCE];
        }
        let of_gravity = if gravity.is_empty() || model.gravity().norm() == 0.0 {
            [estimate.gravity, f64::NAN]
        } else {
            // what the squares fall by is the step over its deviation, squared
            let Some((step, fall)) = step_of(&gravity) else { return Ok(None) };
            [estimate.gravity + step, step.abs() / fall.sqrt()]
        };
        Ok(Some(Tested { departures, gravity: of_gravity }))
    }
}
