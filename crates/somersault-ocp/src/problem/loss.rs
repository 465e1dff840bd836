//! What a cost makes of the rows of a term, and where it looks at them.

use crate::error::{OcpError, expect_below, expect_bounds, expect_none_negative};
use crate::transcription::Outline;
use somersault_core::argument::{expect_finite, expect_length};
use somersault_nlp::Bounds;

/// The nodes at which a term is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum At {
    /// The first node of the motion.
    Start,
    /// The last one.
    End,
    /// Node k.
    Node(usize),
    /// The first node of a phase.
    StartOf(usize),
    /// The last node of a phase.
    EndOf(usize),
    /// All nodes.
    EveryNode,
    /// All nodes of a phase.
    EveryNodeOf(usize),
}

impl At {
    pub(super) fn nodes(self, outline: &Outline) -> Result<Vec<usize>, OcpError> {
        let phase = |i: usize| {
            expect_below("phase", i, outline.phases.len())?;
            Ok::<_, OcpError>(outline.phases[i].clone())
        };
        let n = outline.n_nodes();
        expect_below("node", 0, n)?;
        Ok(match self {
            Self::Start => vec![0],
            Self::End => vec![n - 1],
            Self::Node(k) => {
                expect_below("node", k, n)?;
                vec![k]
            }
            Self::StartOf(i) => vec![phase(i)?.start],
            Self::EndOf(i) => vec![phase(i)?.end - 1],
            Self::EveryNode => (0..n).collect(),
            Self::EveryNodeOf(i) => phase(i)?.collect(),
        })
    }
}

/// A number made of the rows r of a term.
#[derive(Debug, Clone, PartialEq)]
pub enum Loss {
    /// Σ w_i r_i.
    Linear {
        /// w, of any sign.
        weights: Vec<f64>,
    },
    /// ½ Σ w_i (r_i − t_i)².
    HalfSquares {
        /// w ≥ 0.
        weights: Vec<f64>,
        /// t.
        target: Vec<f64>,
    },
    /// ½ Σ w_i e_i², e_i the distance of r_i from its bounds: a soft constraint.
    Outside {
        /// w ≥ 0.
        weights: Vec<f64>,
        /// On r.
        bounds: Bounds,
    },
}

impl Loss {
    /// ½ ‖r‖² for `n` rows.
    pub fn half_squares(n: usize) -> Self {
        Self::HalfSquares { weights: vec![1.0; n], target: vec![0.0; n] }
    }

    /// Fails unless it fits `n` rows and is a loss.
    pub(super) fn expect_for(&self, n: usize) -> Result<(), OcpError> {
        let weights = match self {
            Self::Linear { weights } => {
                expect_finite("weights", weights)?;
                weights
            }
            Self::HalfSquares { weights, target } => {
                expect_length("target", target.len(), n)?;
                expect_finite("target", target)?;
                expect_none_negative("weights", weights)?;
                weights
            }
            Self::Outside { weights, bounds } => {
                expect_length("bounds", bounds.len(), n)?;
                expect_bounds("bounds", bounds)?;
                expect_none_negative("weights", weights)?;
                weights
            }
        };
        Ok(expect_length("weights", weights.len(), n)?)
    }

    /// The value at `rows`.
    pub(super) fn value(&self, rows: &[f64]) -> f64 {
        match self {
            Self::Linear { weights } => weights.iter().zip(rows).map(|(w, r)| w * r).sum(),
            Self::HalfSquares { weights, target } => {
                let squares = weights.iter().zip(target).zip(rows);
                0.5 * squares.map(|((w, t), r)| w * (r - t) * (r - t)).sum::<f64>()
            }
            Self::Outside { weights, bounds } => {
                let squares = weights.iter().enumerate().zip(rows);
                0.5 * squares.map(|((i, w), r)| w * outside(bounds, i, *r).powi(2)).sum::<f64>()
            }
        }
    }

    /// Writes the gradient by the rows, times `factor`.
    pub(super) fn gradient_into(&self, rows: &[f64], factor: f64, out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = factor
                * match self {
                    Self::Linear { weights } => weights[i],
                    Self::HalfSquares { weights, target } => weights[i] * (rows[i] - target[i]),
                    Self::Outside { weights, bounds } => weights[i] * outside(bounds, i, rows[i]),
                };
        }
    }

    /// Second derivative by row `i`.
    pub(super) fn curvature(&self, rows: &[f64], i: usize) -> f64 {
        match self {
            Self::Linear { .. } => 0.0,
            Self::HalfSquares { weights, .. } => weights[i],
            Self::Outside { weights, bounds } if outside(bounds, i, rows[i]) != 0.0 => weights[i],
            Self::Outside { .. } => 0.0,
        }
    }

    /// Whether it has second derivatives at all.
    pub(super) fn is_curved(&self) -> bool {
        !matches!(self, Self::Linear { .. })
    }
}

fn outside(bounds: &Bounds, i: usize, r: f64) -> f64 {
    r - r.clamp(bounds.lower[i], bounds.upper[i])
}
