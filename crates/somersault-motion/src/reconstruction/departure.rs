//! Departures from the laws of flight: by how much the squares would fall if the angular momentum varied and the centre of mass
//! left its parabola.
//!
//! ```text
//! L(t) = L + Σ λ_k a_k(t),   c(t) = c₀ + v₀ t + ½ g t² + Σ γ_k b_k(t)
//! ```
//! over the whole flight with a = s, s², s³ and b = s², s³, s⁴ of the time s from −1 at the first frame to 1 at the last; at its start, and
//! likewise at its end, with a = u, b = u² where u falls from 1 to 0 within 0.08 s. No λ or γ is searched: by the score test
//!
//! ```text
//! d = βᵀ S⁻¹ β / n
//! ```
//! with the gradient β by n of them and the Schur complement S of their Hessian. Where the laws hold, n d has the χ² distribution with n
//! degrees of freedom. A size that was given is tested likewise.
//!
//! Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50.

use super::ReconstructionError;
use super::attitude::Flown;
use super::joints::JointSplines;
use super::noise::chi_squared_quantile;
use super::normal::Normal;
use super::search::{Search, damped_step};
use faer::Mat;
use std::ops::Range;

/// Functions of time by which momentum and centre of mass may depart: those of the whole flight, of its start and of its end.
const FUNCTIONS: [Range<usize>; 3] = [0..START, START..END, END..N_FUNCTIONS];
const START: usize = 3;
const END: usize = 4;
pub(super) const N_FUNCTIONS: usize = 5;
/// How long start and end last, s, and at most in fractions of the duration.
const ENDS: [f64; 2] = [0.08, 0.25];
/// Damping of departures that are no others than those of unknowns.
const WIDEST: f64 = 1e-8;
/// Standard deviations up to which a departure is by chance: one in 4000 is beyond.
const CHANCE: f64 = 3.5;
/// What d may differ from 1 by, whatever the noise is.
const TOLERANCE: f64 = 0.1;

/// Function `k` at `t`: of the momentum, and of the centre of mass.
pub(super) fn function(splines: &JointSplines, k: usize, t: f64) -> [f64; 2] {
    let [passed, left] = splines.apart_from_ends(t);
    let duration = passed + left;
    let fallen = |time: f64| (1.0 - time / ENDS[0].min(ENDS[1] * duration)).max(0.0);
    // what is constant or grows linearly is an unknown itself
    let (base, degree) = match k {
        START => (fallen(passed), 1),
        END => (fallen(left), 1),
        _ => ((passed - left) / duration, k as i32 + 1),
    };
    [base.powi(degree), base.powi(degree + 1)]
}

impl Search<'_> {
    /// d of the whole flight, of its start, of its end and of the size, each with its limit; NaN of a size that was sought. None where the
    /// Hessian has no inverse.
    pub(super) fn departures(&mut self) -> Result<Option<[[f64; 2]; 4]>, ReconstructionError> {
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
        let size = layout.scale().filter(|_| !self.flown.layout.has_scale).map_or(0..0, |k| k..k + 1);
        let [whole, start, end] = FUNCTIONS.map(of_functions);
        let mut found = [[f64::NAN; 2]; 4];
        for (found, tested) in found.iter_mut().zip([whole, start, end, size.clone()]) {
            if tested.is_empty() {
                continue;
            }
            let is_kept = |k: &usize| tested.contains(k) || !(all.contains(k) || size.contains(k));
            let kept: Vec<usize> = (0..gradient.len()).filter(is_kept).collect();
            // the lower half stays the lower half
            let part = Mat::from_fn(kept.len(), kept.len(), |i, j| matrix[(kept[i], kept[j])]);
            let of_part: Vec<f64> = kept.iter().map(|k| gradient[*k]).collect();
            let Some((_, fall)) = damped_step(&part, &of_part, 0.0) else { return Ok(None) };
            // s² along gravity is gravity, where that is sought
            let n = tested.len() - usize::from(layout.has_gravity && tested.len() > each);
            *found = [fall / n as f64, chi_squared_quantile(n, CHANCE) + TOLERANCE];
        }
        Ok(Some(found))
    }
}
