//! Steps that end where a field goes from one smooth piece to the next.
//!
//! A step stays in the piece that it began in. If a margin is negative at its end, the step is made again to where the margin
//! changes sign, by steps of the method itself, so that a crossing has the accuracy of any other point. If a margin has a
//! minimum inside the step near zero, the step is made to that minimum: what is left has margins that rise or fall, whose
//! signs at the ends tell all.

use super::rows::{ANY, combine};
use super::{Kernel, STAGES};
use crate::system::{Piece, VectorField};
use somersault_core::roots;

/// Margins of a piece at a point of the motion, and their rates along it.
#[derive(Debug, Clone)]
struct Margins {
    values: Vec<f64>,
    rates: Vec<f64>,
}

/// Margins where the motion is and at the end of the step that is looked at, with room for what they are made of.
#[derive(Debug)]
pub(super) struct Watch {
    here: Margins,
    then: Margins,
    ahead: Vec<f64>,
    point: Vec<f64>,
    slope: Vec<f64>,
    slopes: Vec<f64>,
}

impl Watch {
    /// For a number of switches; where there are none, without any room.
    pub(super) fn new(switches: usize, dimension: usize) -> Self {
        let n = if switches > 0 { dimension } else { 0 };
        let none = Margins { values: vec![f64::INFINITY; switches], rates: vec![0.0; switches] };
        Self {
            here: none.clone(),
            then: none,
            ahead: vec![f64::INFINITY; switches],
            point: vec![0.0; n],
            slope: vec![0.0; n],
            slopes: vec![0.0; STAGES * n],
        }
    }

    /// The step that was looked at last is made.
    pub(super) fn arrive(&mut self) {
        std::mem::swap(&mut self.here, &mut self.then);
    }
}

/// What lies within a step.
pub(super) enum Ahead {
    /// No end of the piece.
    Smooth,
    /// A minimum of a margin that may be below zero.
    Minimum(f64),
    /// The end of the piece; a step of this size ends just beyond it.
    End(f64),
}

/// Part of a step within which a minimum is the same as an end of the step.
const BESIDE: f64 = 1e-4;

/// The margins of `piece` at `p` with slope `slope`, their rates by central differences over 1e-5 of `h`; `ahead` and `point`
/// are scratch.
fn look<S: VectorField>(
    system: &S,
    piece: &Piece,
    [p, slope]: [&[f64]; 2],
    h: f64,
    margins: &mut Margins,
    [ahead, point]: [&mut [f64]; 2],
) {
    let Margins { values, rates } = margins;
    let reach = 1e-5 * h;
    let mut beside = |s: f64, out: &mut [f64]| {
        point.iter_mut().zip(p.iter().zip(slope)).for_each(|(q, (p, slope))| *q = p + slope * s);
        system.margins_into(piece, point, out);
    };
    system.margins_into(piece, p, values);
    beside(reach, ahead);
    beside(-reach, rates);
    for ((rate, ahead), value) in rates.iter_mut().zip(ahead.iter()).zip(values) {
        // an infinite margin has no rate
        *rate = if value.is_finite() { (*ahead - *rate) / (2.0 * reach) } else { 0.0 };
    }
}

impl<S: VectorField, const MATRIX: bool> Kernel<'_, S, MATRIX> {
    /// Looks at the margins where the motion is.
    pub(super) fn watch_here(&mut self) {
        let Watch { here, ahead, point, .. } = &mut self.watch;
        let at: [&[f64]; 2] = [&self.state, &self.slopes[..self.n]];
        look(self.system, &self.piece, at, self.h, here, [ahead, point]);
    }

    /// What a step of `h` to `next` contains.
    pub(super) fn ahead(&mut self, h: f64) -> Ahead {
        let value = self.least(None);
        if value < 0.0 {
            let near = self.inside(h, value);
            let tolerance = 2.0 * f64::EPSILON * self.t.abs().max(h.abs());
            let guess = near.0 + (h - near.0) * near.1 / (near.1 - value);
            let infallible = |size| Ok::<_, std::convert::Infallible>(self.least(Some(size)));
            let Ok((_, beyond)) = roots::bracket(infallible, near, (h, value), guess, tolerance);
            return Ahead::End(beyond);
        }
        let Watch { here, then, ahead, point, slope, .. } = &mut self.watch;
        self.system.field_in(&self.piece, &self.next, slope);
        look(self.system, &self.piece, [&self.next, slope], h, then, [ahead, point]);
        let minimum = (0..then.values.len())
            .filter_map(|i| lowest([here.values[i], then.values[i]], [h * here.rates[i], h * then.rates[i]]))
            .fold(f64::INFINITY, f64::min);
        if minimum < 1.0 - BESIDE { Ahead::Minimum(h * minimum) } else { Ahead::Smooth }
    }

    /// The least margin at the end of the step that was tried, or after a step of another size.
    fn least(&mut self, size: Option<f64>) -> f64 {
        if let Some(size) = size {
            self.state_after(size);
        }
        let Watch { ahead, point, .. } = &mut self.watch;
        let p: &[f64] = if size.is_some() { point } else { &self.next };
        self.system.margins_into(&self.piece, p, ahead);
        ahead.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Where in a step of `h`, at whose end the least margin is `value`, the piece surely holds, with the margin there.
    ///
    /// A margin that has only just changed its sign is zero to rounding at the start, and rises: it is looked at near the
    /// top of the parabola through what is known.
    fn inside(&mut self, h: f64, value: f64) -> (f64, f64) {
        let Margins { values, rates } = &self.watch.here;
        let lowest = (0..values.len()).min_by(|&i, &j| values[i].total_cmp(&values[j]));
        // without switches no margin is below zero
        let Some(lowest) = lowest else { return (0.0, 0.0) };
        let (start, rise) = (values[lowest], h * rates[lowest]);
        if start < 1e-3 * rise {
            let mut size = h * 0.5 * rise / (rise - value);
            for _ in 0..8 {
                let margin = self.least(Some(size));
                if margin > 0.0 {
                    return (size, margin);
                }
                size *= 0.25;
            }
        }
        (0.0, start.max(0.0))
    }

    /// The state alone after a step of `h`, to the scratch of the watch.
    fn state_after(&mut self, h: f64) {
        let n = self.n;
        let Watch { point, slopes, .. } = &mut self.watch;
        slopes[..n].copy_from_slice(&self.slopes[..n]);
        for i in 1..STAGES {
            combine::<pulp::Scalar, ANY>(Some(&self.state), slopes, self.tableau.row(i), h, point);
            self.system.field_in(&self.piece, point, &mut slopes[i * n..(i + 1) * n]);
        }
        combine::<pulp::Scalar, ANY>(Some(&self.state), slopes, self.tableau.weights(), h, point);
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
