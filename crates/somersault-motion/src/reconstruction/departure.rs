//! Departures from the laws of flight, of which a search has none: an angular momentum that varies, and a centre of mass that leaves its
//! parabola.
//!
//! ```text
//! L(t) = L + Σ λ_k a_k(t),   c(t) = c₀ + v₀ t + ½ g t² + Σ γ_k b_k(t)
//! ```
//! over the whole flight with a = s, s², s³ and b = s², s³, s⁴ of the time s from −1 at the first frame to 1 at the last; at its start, and
//! likewise at its end, with a = u, b = u² where u falls from 1 to 0 within 0.08 s; by a constant push in each of eight tenths of the
//! duration, with a = x from 0 to 1 in that tenth, and b its integral. The air moves the centre of mass by k times
//!
//! ```text
//! d(t) = −∫ (t − u) |v(u)| v(u) du,   v(t) = v₀ + g t
//! ```

use super::joints::JointSplines;
use nalgebra::Vector3;
use somersault_core::quadrature::GAUSS_5;
use std::ops::Range;

/// Functions of time by which momentum and centre of mass may depart: those of the whole flight, of its start and of its end.
pub(super) const FUNCTIONS: [Range<usize>; 3] = [0..START, START..END, END..PUSHES.start];
const START: usize = 3;
const END: usize = 4;
/// Pushes, one function each.
pub(super) const PUSHES: Range<usize> = 5..N_FUNCTIONS;
pub(super) const N_FUNCTIONS: usize = 13;
/// How long start and end last, s, and at most in fractions of the duration.
const ENDS: [f64; 2] = [0.08, 0.25];
/// How long pushes last, in fractions of the duration; the first begins as much after the start.
const PUSH: f64 = 0.1;

/// Function `k` at `t`: of the momentum, and of the centre of mass.
pub(super) fn function(splines: &JointSplines, k: usize, t: f64) -> [f64; 2] {
    let [passed, left] = splines.apart_from_ends(t);
    let duration = passed + left;
    if let Some(number) = k.checked_sub(PUSHES.start) {
        let x = ((passed - push_time(splines, number)) / (PUSH * duration)).max(0.0);
        let within = x.min(1.0);
        return [within, 0.5 * within * within + (x - within)];
    }
    let fallen = |time: f64| (1.0 - time / ENDS[0].min(ENDS[1] * duration)).max(0.0);
    // what is constant or grows linearly is an unknown itself
    let (base, degree) = match k {
        START => (fallen(passed), 1),
        END => (fallen(left), 1),
        _ => ((passed - left) / duration, k as i32 + 1),
    };
    [base.powi(degree), base.powi(degree + 1)]
}

/// When push `number` begins, s after the start.
pub(super) fn push_time(splines: &JointSplines, number: usize) -> f64 {
    splines.duration() * PUSH * (number + 1) as f64
}

/// Where the air moves a centre of mass with this velocity at the reference, `t` after it, for a drag of 1/m.
pub(super) fn air(velocity: &Vector3<f64>, gravity: &Vector3<f64>, t: f64) -> Vector3<f64> {
    let of_node = |(node, weight): &(f64, f64)| {
        let velocity = velocity + gravity * (t * node);
        velocity * (-velocity.norm() * weight * (1.0 - node) * t * t)
    };
    GAUSS_5.iter().map(of_node).sum()
}
