//! Steps that end where a field goes from one smooth piece to the next.
//!
//! A step stays in the piece that it began in. If a margin is negative at its end, the step is made again to where the margin
//! changes sign, by steps of the method itself, so that a crossing has the accuracy of any other point. If a margin has a
//! minimum inside the step near zero, the step is made to that minimum: what is left has margins that rise or fall, whose
//! signs at the ends tell all.

use super::Kernel;
use crate::system::{Piece, VectorField};
use nalgebra::SVector;
use somersault_core::roots;

/// Margins of a piece at a point of the motion, and their rates along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Watch<const N: usize> {
    margins: SVector<f64, N>,
    rates: SVector<f64, N>,
}

impl<const N: usize> Default for Watch<N> {
    fn default() -> Self {
        Self { margins: SVector::repeat(f64::INFINITY), rates: SVector::zeros() }
    }
}

/// What lies within a step.
pub(super) enum Ahead<const N: usize> {
    /// No end of the piece.
    Smooth(Watch<N>),
    /// A minimum of a margin that may be below zero.
    Minimum(f64),
    /// The end of the piece; a step of this size ends just beyond it.
    End(f64),
}

/// Part of a step within which a minimum is the same as an end of the step.
const BESIDE: f64 = 1e-4;

impl<S: VectorField<N>, const N: usize, const MATRIX: bool> Kernel<'_, S, N, MATRIX> {
    /// The margins of `piece` at a point with slope `slope`, their rates by central differences over 1e-5 of `h`.
    pub(super) fn watch(
        &self,
        piece: &Piece<N>,
        p: &SVector<f64, N>,
        slope: &SVector<f64, N>,
        h: f64,
    ) -> Watch<N> {
        let margins = self.system.margins(piece, p);
        let reach = 1e-5 * h;
        let [ahead, behind] = [reach, -reach].map(|s| self.system.margins(piece, &(p + slope * s)));
        // an infinite margin has no rate
        let rates = SVector::from_fn(|i, _| {
            if margins[i].is_finite() { (ahead[i] - behind[i]) / (2.0 * reach) } else { 0.0 }
        });
        Watch { margins, rates }
    }

    /// What a step of `h` to `end` contains.
    pub(super) fn ahead(&self, h: f64, end: &SVector<f64, N>) -> Ahead<N> {
        let switches = self.system.n_switches();
        let least = |p: &SVector<f64, N>| {
            let margins = self.system.margins(&self.piece, p);
            (0..switches).fold(f64::INFINITY, |m, i| m.min(margins[i]))
        };
        let value = least(end);
        if value < 0.0 {
            let value_at = |size: f64| least(&self.state_after(size));
            let near = self.inside(h, value, switches, &value_at);
            let tolerance = 2.0 * f64::EPSILON * self.t.abs().max(h.abs());
            let guess = near.0 + (h - near.0) * near.1 / (near.1 - value);
            let infallible = |size| Ok::<_, std::convert::Infallible>(value_at(size));
            let Ok((_, beyond)) = roots::bracket(infallible, near, (h, value), guess, tolerance);
            return Ahead::End(beyond);
        }
        let then = self.watch(&self.piece, end, &self.system.field_in(&self.piece, end), h);
        let minimum = (0..switches)
            .filter_map(|i| {
                let ends = [self.watch.margins[i], then.margins[i]];
                lowest(ends, [h * self.watch.rates[i], h * then.rates[i]])
            })
            .fold(f64::INFINITY, f64::min);
        if minimum < 1.0 - BESIDE { Ahead::Minimum(h * minimum) } else { Ahead::Smooth(then) }
    }

    /// Where in a step of `h`, at whose end the least margin is `value`, the piece surely holds, with the margin there.
    ///
    /// A margin that has only just changed its sign is zero to rounding at the start, and rises: it is looked at near the
    /// top of the parabola through what is known.
    fn inside(&self, h: f64, value: f64, switches: usize, value_at: &impl Fn(f64) -> f64) -> (f64, f64) {
        let Watch { margins, rates } = &self.watch;
        let lowest = (0..switches).min_by(|&i, &j| margins[i].total_cmp(&margins[j]));
        // without switches no margin is below zero
        let Some(lowest) = lowest else { return (0.0, 0.0) };
        let (start, rise) = (margins[lowest], h * rates[lowest]);
        if start < 1e-3 * rise {
            let mut size = h * 0.5 * rise / (rise - value);
            for _ in 0..8 {
                let margin = value_at(size);
                if margin > 0.0 {
                    return (size, margin);
                }
                size *= 0.25;
            }
        }
        (0.0, start.max(0.0))
    }

    /// The state alone after a step of `h`, with scratch of its own.
    fn state_after(&self, h: f64) -> SVector<f64, N> {
        let mut slopes = [SVector::<f64, N>::zeros(); super::STAGES];
        slopes[0] = self.states[0];
        let sum = |row: &[(usize, f64)], slopes: &[SVector<f64, N>]| {
            self.state + row.iter().fold(SVector::<f64, N>::zeros(), |s, &(j, a)| s + slopes[j] * a) * h
        };
        for i in 1..super::STAGES {
            slopes[i] = self.system.field_in(&self.piece, &sum(self.tableau.row(i), &slopes));
        }
        sum(self.tableau.weights(), &slopes)
    }
}

/// Where in (0, 1) the cubic with these values and slopes at 0 and 1 has a minimum that may be below zero.
fn lowest([m0, m1]: [f64; 2], [r0, r1]: [f64; 2]) -> Option<f64> {
    let control = (m0 + r0 / 3.0).min(m1 - r1 / 3.0);
    if !(r0 < 0.0 && r1 > 0.0) || control > 0.5 * m0.min(m1) {
        return None;
    }
    // m' = r0 + 2 b s + 3 a s², from negative to positive
    let a = 2.0 * (m0 - m1) + r0 + r1;
    let b = 3.0 * (m1 - m0) - 2.0 * r0 - r1;
    let root = -r0 / (b + (b * b - 3.0 * a * r0).max(0.0).sqrt());
    (root > BESIDE).then_some(root)
}
