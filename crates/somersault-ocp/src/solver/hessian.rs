//! The matrix of the quadratic model: what the program offers, or a quasi-Newton approximation.
//!
//! The approximation is the damped BFGS update of Powell (Nocedal & Wright 2006, procedure 18.2), positive
//! definite for any step. Variables that the pattern of the Hessian does not couple, directly or through
//! others, form blocks that are updated by themselves (Bock & Plitt 1984); a pattern without entries tells
//! nothing and makes one dense block.

use super::program::Program;
use crate::nlp::{EvaluationError, Pattern};

/// Share of sᵀ B s below which sᵀ y is damped.
const DAMPING: f64 = 0.2;

pub(super) struct Hessian {
    pub(super) pattern: Pattern,
    pub(super) values: Vec<f64>,
    diagonal_at: Vec<usize>,
    kind: Kind,
}

enum Kind {
    /// Where each entry that is offered lies, and room for them.
    Offered { at: Vec<usize>, values: Vec<f64> },
    /// Variables of each block, ascending; whether it is more than the unit matrix; room for B s.
    QuasiNewton { blocks: Vec<Vec<usize>>, scaled: Vec<bool>, product: Vec<f64> },
}

impl Hessian {
    /// For what the program offers.
    pub(super) fn offered(offered: &Pattern) -> Self {
        let n = offered.n_rows;
        let entries = offered.entries().map(|(_, i, j)| (i, j)).chain((0..n).map(|i| (i, i)));
        let pattern = Pattern::from_entries(n, n, entries);
        let at = offered.entries().map(|(_, i, j)| pattern.position(i, j).unwrap_or_default()).collect();
        Self::new(pattern, Kind::Offered { at, values: vec![0.0; offered.n_entries()] })
    }

    /// For a quasi-Newton approximation, which begins as the unit matrix.
    pub(super) fn quasi_newton(known: &Pattern) -> Self {
        let n = known.n_rows;
        let blocks = if known.n_entries() == 0 { vec![(0..n).collect()] } else { coupled(known) };
        let entries = blocks
            .iter()
            .flat_map(|b| b.iter().enumerate().flat_map(|(k, &j)| b[..=k].iter().map(move |&i| (i, j))));
        let pattern = Pattern::from_entries(n, n, entries);
        let scaled = vec![false; blocks.len()];
        let mut hessian = Self::new(pattern, Kind::QuasiNewton { blocks, scaled, product: vec![0.0; n] });
        hessian.reset();
        hessian
    }

    fn new(pattern: Pattern, kind: Kind) -> Self {
        let diagonal_at = (0..pattern.n_rows).map(|i| pattern.position(i, i).unwrap_or_default()).collect();
        Self { values: vec![0.0; pattern.n_entries()], pattern, diagonal_at, kind }
    }

    pub(super) fn is_quasi_newton(&self) -> bool {
        matches!(self.kind, Kind::QuasiNewton { .. })
    }

    /// Back to the unit matrix.
    pub(super) fn reset(&mut self) {
        self.values.fill(0.0);
        for &k in &self.diagonal_at {
            self.values[k] = 1.0;
        }
        if let Kind::QuasiNewton { scaled, .. } = &mut self.kind {
            scaled.fill(false);
        }
    }

    /// Takes over an approximation of the same size.
    pub(super) fn restore(&mut self, values: &[f64]) {
        self.values.copy_from_slice(values);
        if let Kind::QuasiNewton { scaled, .. } = &mut self.kind {
            scaled.fill(true);
        }
    }

    /// Asks the program, if it offers a Hessian. Where that has no value the last one stays.
    pub(super) fn refresh(
        &mut self,
        program: &mut Program<'_>,
        z: &[f64],
        y: &[f64],
    ) -> Result<(), EvaluationError> {
        let Kind::Offered { at, values } = &mut self.kind else { return Ok(()) };
        program.hessian(z, y, values)?;
        self.values.fill(0.0);
        for (&k, &value) in at.iter().zip(values.iter()) {
            self.values[k] += value;
        }
        Ok(())
    }

    /// Learns that the gradient of the Lagrangian changed by `y` along `s`. `y` is overwritten.
    pub(super) fn update(&mut self, s: &[f64], y: &mut [f64]) {
        let Kind::QuasiNewton { blocks, scaled, product } = &mut self.kind else { return };
        product.fill(0.0);
        self.pattern.add_symmetric_product(&self.values, s, product);
        for (block, scaled) in blocks.iter().zip(scaled) {
            let dot = |a: &[f64], b: &[f64]| block.iter().map(|&i| a[i] * b[i]).sum::<f64>();
            let (ss, sy) = (dot(s, s), dot(s, y));
            let mut s_b_s = dot(s, product);
            if ss == 0.0 || !(s_b_s > 0.0) {
                continue;
            }
            if !std::mem::replace(scaled, true) && sy > 0.0 {
                // Nocedal & Wright (6.20): the unit matrix gets the size of the curvature seen first.
                let size = (dot(y, y) / sy).clamp(1e-8, 1e8);
                for &i in block {
                    self.values[self.diagonal_at[i]] = size;
                    product[i] = size * s[i];
                }
                s_b_s = size * ss;
            }
            let mut curvature = sy;
            if sy < DAMPING * s_b_s {
                let theta = (1.0 - DAMPING) * s_b_s / (s_b_s - sy);
                for &i in block {
                    y[i] = theta * y[i] + (1.0 - theta) * product[i];
                }
                curvature = dot(s, y);
            }
            if !(curvature > f64::MIN_POSITIVE) || !curvature.is_finite() {
                continue;
            }
            for (k, &j) in block.iter().enumerate() {
                let column = self.pattern.columns[j];
                for (l, &i) in block[..=k].iter().enumerate() {
                    self.values[column + l] += y[i] * y[j] / curvature - product[i] * product[j] / s_b_s;
                }
            }
        }
    }
}

/// Connected components of a symmetric pattern.
fn coupled(pattern: &Pattern) -> Vec<Vec<usize>> {
    let n = pattern.n_rows;
    let mut root: Vec<usize> = (0..n).collect();
    fn find(root: &mut [usize], mut i: usize) -> usize {
        while root[i] != i {
            root[i] = root[root[i]];
            i = root[i];
        }
        i
    }
    for (_, i, j) in pattern.entries() {
        let (a, b) = (find(&mut root, i), find(&mut root, j));
        root[a.max(b)] = a.min(b);
    }
    let mut blocks = vec![Vec::new(); n];
    for i in 0..n {
        let block = find(&mut root, i);
        blocks[block].push(i);
    }
    blocks.retain(|block| !block.is_empty());
    blocks
}
