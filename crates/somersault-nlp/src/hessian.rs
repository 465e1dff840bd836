//! The matrix of the quadratic model: what the program offers, or a quasi-Newton approximation.
//!
//! Variables that the pattern of the Hessian does not couple, directly or through others, form blocks. One block,
//! also where the pattern has no entries and so tells nothing, is approximated by the damped BFGS update of Powell
//! (Nocedal & Wright 2006, procedure 18.2), which is positive definite after any step. Several blocks are updated
//! each by itself, by the symmetric rank-one formula (equation 6.24): the blocks of a Lagrangian are indefinite also
//! where it is convex along the constraints, and an update that stays definite would not converge to them (Janka,
//! Kirches, Sager & Wächter 2016).

use crate::nlp::{EvaluationError, Pattern};
use crate::program::Program;

/// Fraction of sᵀ B s below which sᵀ y is damped.
const DAMPING: f64 = 0.2;
/// Cosine between step and misfit below which a rank-one update is left out.
const SKIP: f64 = 1e-8;

pub(crate) struct Hessian {
    pub(crate) pattern: Pattern,
    pub(crate) values: Vec<f64>,
    diagonal_at: Vec<usize>,
    kind: Kind,
}

enum Kind {
    /// Where each entry that is offered lies, and room for them.
    Offered { at: Vec<usize>, values: Vec<f64> },
    /// Variables of each block, ascending; whether it is more than the unit matrix; room for B s.
    QuasiNewton { blocks: Vec<Vec<usize>>, scaled: Vec<bool>, product: Vec<f64> },
}

/// Entries of the diagonal.
fn diagonal(n: usize) -> Vec<(usize, usize)> {
    (0..n).map(|i| (i, i)).collect()
}

impl Hessian {
    /// For what the program offers.
    pub(crate) fn offered(offered: &Pattern) -> Self {
        let n = offered.n_rows;
        let entries = offered.entries().map(|(_, i, j)| (i, j)).collect();
        let (pattern, [at, diagonal_at]) = Pattern::with_places_of(n, n, [entries, diagonal(n)]);
        let values = vec![0.0; pattern.n_entries()];
        let kind = Kind::Offered { at, values: vec![0.0; offered.n_entries()] };
        Self { pattern, values, diagonal_at, kind }
    }

    /// For a quasi-Newton approximation, which begins as the unit matrix.
    pub(crate) fn quasi_newton(known: &Pattern) -> Self {
        let n = known.n_rows;
        let blocks = if known.n_entries() == 0 { vec![(0..n).collect()] } else { coupled(known) };
        let entries = blocks
            .iter()
            .flat_map(|b| b.iter().enumerate().flat_map(|(k, &j)| b[..=k].iter().map(move |&i| (i, j))))
            .collect();
        let (pattern, [_, diagonal_at]) = Pattern::with_places_of(n, n, [entries, diagonal(n)]);
        let scaled = vec![false; blocks.len()];
        let values = vec![0.0; pattern.n_entries()];
        let kind = Kind::QuasiNewton { blocks, scaled, product: vec![0.0; n] };
        let mut hessian = Self { pattern, values, diagonal_at, kind };
        hessian.reset();
        hessian
    }

    pub(crate) fn is_quasi_newton(&self) -> bool {
        matches!(self.kind, Kind::QuasiNewton { .. })
    }

    /// Whether it is positive definite by construction.
    pub(crate) fn is_definite(&self) -> bool {
        matches!(&self.kind, Kind::QuasiNewton { blocks, .. } if blocks.len() == 1)
    }

    /// Back to the unit matrix.
    pub(crate) fn reset(&mut self) {
        self.values.fill(0.0);
        for &k in &self.diagonal_at {
            self.values[k] = 1.0;
        }
        if let Kind::QuasiNewton { scaled, .. } = &mut self.kind {
            scaled.fill(false);
        }
    }

    /// Takes over an approximation of the same size.
    pub(crate) fn restore(&mut self, values: &[f64]) {
        self.values.copy_from_slice(values);
        if let Kind::QuasiNewton { scaled, .. } = &mut self.kind {
            scaled.fill(true);
        }
    }

    /// Asks the program, if it offers a Hessian, for that of σ f + yᵀ c. Where that has no value the last one stays.
    pub(crate) fn refresh(
        &mut self,
        program: &mut Program<'_>,
        z: &[f64],
        cost_factor: f64,
        y: &[f64],
    ) -> Result<(), EvaluationError> {
        let Kind::Offered { at, values } = &mut self.kind else { return Ok(()) };
        program.hessian(z, cost_factor, y, values)?;
        self.values.fill(0.0);
        for (&k, &value) in at.iter().zip(values.iter()) {
            self.values[k] += value;
        }
        Ok(())
    }

    /// Learns that the gradient of the Lagrangian changed by `y` along `s`. `y` is overwritten.
    pub(crate) fn update(&mut self, s: &[f64], y: &mut [f64]) {
        let Kind::QuasiNewton { blocks, scaled, product } = &mut self.kind else { return };
        let single = blocks.len() == 1;
        product.fill(0.0);
        self.pattern.add_symmetric_product(&self.values, s, product);
        for (block, scaled) in blocks.iter().zip(scaled) {
            let dot = |a: &[f64], b: &[f64]| block.iter().map(|&i| a[i] * b[i]).sum::<f64>();
            let (ss, sy) = (dot(s, s), dot(s, y));
            let mut s_b_s = dot(s, product);
            if ss == 0.0 || !s_b_s.is_finite() || (single && s_b_s <= 0.0) {
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
            let column = |j: usize| self.pattern.columns[j];
            let values = &mut self.values;
            let mut add = |a: &[f64], factor: f64| {
                for (k, &j) in block.iter().enumerate() {
                    for (value, &i) in values[column(j)..].iter_mut().zip(&block[..=k]) {
                        *value += factor * a[i] * a[j];
                    }
                }
            };
            if single {
                let mut curvature = sy;
                if sy < DAMPING * s_b_s {
                    let theta = (1.0 - DAMPING) * s_b_s / (s_b_s - sy);
                    for &i in block {
                        y[i] = theta * y[i] + (1.0 - theta) * product[i];
                    }
                    curvature = dot(s, y);
                }
                if curvature.is_finite() && curvature > f64::MIN_POSITIVE {
                    add(y, 1.0 / curvature);
                    add(product, -1.0 / s_b_s);
                }
            } else {
                for &i in block {
                    y[i] -= product[i];
                }
                let change = dot(s, y);
                if change.abs() > SKIP * (ss * dot(y, y)).sqrt() {
                    add(y, 1.0 / change);
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
