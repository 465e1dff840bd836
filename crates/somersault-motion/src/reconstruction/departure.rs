//! Departures from the laws of flight, of which a search has none: an angular momentum that varies, and a centre of mass that leaves its
//! parabola.
//!
//! ```text
//! L(t) = L + Σ λ_k a_k(t),   c(t) = c₀ + v₀ t + ½ g t² + Σ γ_k b_k(t)
//! ```
//! over the whole flight with a = s, s², s³ and b = s², s³, s⁴ of the time s from −1 at the first frame to 1 at the last; at its start, and
//! likewise at its end, with a = u, b = u² where u falls from 1 to 0 within 0.08 s.

use super::joints::JointSplines;
use std::ops::Range;

/// Functions of time by which momentum and centre of mass may depart: those of the whole flight, of its start and of its end.
pub(super) const FUNCTIONS: [Range<usize>; 3] = [0..START, START..END, END..N_FUNCTIONS];
const START: usize = 3;
const END: usize = 4;
pub(super) const N_FUNCTIONS: usize = 5;
/// How long start and end last, s, and at most in fractions of the duration.
const ENDS: [f64; 2] = [0.08, 0.25];

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
