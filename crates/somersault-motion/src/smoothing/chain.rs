//! Normal equations of a chain: frames, of which each is joined to the next alone, and one unknown that is joined to all.
//!
//! ```text
//! A = [ A₁  B₁ᵀ       ]   [x]     [g]
//!     [ B₁  A₂  B₂ᵀ   ],  [A  h] [x] = −[g]
//!     [     B₂  A₃  … ]   [hᵀ c] [s]    [γ]
//! ```
//! Method: block Cholesky D₁ = A₁, Dᵢ₊₁ = Aᵢ₊₁ − Bᵢ Dᵢ⁻¹ Bᵢᵀ, whose steps back give the solution and the blocks of the inverse on and
//! beside the diagonal: Σᵢ = Dᵢ⁻¹ + K Σᵢ₊₁ Kᵀ and Σᵢ,ᵢ₊₁ = −K Σᵢ₊₁ with K = Dᵢ⁻¹ Bᵢᵀ. This is the smoother of Rauch, Tung and
//! Striebel in terms of the inverse covariance. Cost for N frames of n unknowns: 7/6 N n³ multiplications forward, N n³/2 where a step
//! joins unknowns to near ones alone, and 7/3 N n³ back; memory N n².
//!
//! Sources: H. E. Rauch, F. Tung and C. T. Striebel, AIAA J. 3 (1965) 1445; G. A. Einicke, *Smoothing, Filtering and Prediction*, 2012,
//! chapter 6.

use crate::cholesky::{Cholesky, add_square, blocks};
use nalgebra::{DMatrix, DVector};

/// What a frame adds to the equations.
pub(super) struct Block {
    /// Aᵢ, its lower half.
    pub(super) matrix: DMatrix<f64>,
    pub(super) gradient: Vec<f64>,
    /// h.
    pub(super) border: Vec<f64>,
    /// Entries of Bᵢ, which add up: row in the next frame, column in this one, value.
    pub(super) coupling: Vec<(usize, usize, f64)>,
}

impl Block {
    fn new(n: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(n, n),
            gradient: vec![0.0; n],
            border: vec![0.0; n],
            coupling: Vec::new(),
        }
    }

    fn clear(&mut self) {
        self.matrix.fill(0.0);
        self.gradient.fill(0.0);
        self.border.fill(0.0);
        self.coupling.clear();
    }
}

/// A factorisation of the equations.
pub(super) struct Factor {
    n: usize,
    /// Dᵢ = L Lᵀ of each frame; the last alone if no solution was requested.
    lower: Vec<Cholesky>,
    couplings: Vec<Vec<(usize, usize, f64)>>,
    /// L⁻¹ g and L⁻¹ h.
    gradients: Vec<Vec<f64>>,
    borders: Vec<Vec<f64>>,
    /// c − hᵀ A⁻¹ h, and γ − hᵀ A⁻¹ g.
    corner: Option<[f64; 2]>,
    /// ln det of the whole matrix.
    pub(super) log_determinant: f64,
    /// What the quadratic function falls by from where it is to its minimum, twice.
    pub(super) fall: f64,
}

/// The covariance of the unknowns of a frame, of those of the next if it is not the last, and of the one that all frames share, which has
/// the variance 0 where it is known.
pub(super) struct Covariance {
    matrix: DMatrix<f64>,
}

/// The place in a row of the unknown that all frames share.
pub(super) const COMMON: usize = usize::MAX;

impl Covariance {
    /// That of two unknowns.
    pub(super) fn entry(&self, a: usize, b: usize) -> f64 {
        let place = |k: usize| if k == COMMON { self.matrix.nrows() - 1 } else { k };
        self.matrix[(place(a), place(b))]
    }

    /// The variance of a linear function of these unknowns; those of the next frame count on.
    pub(super) fn variance(&self, row: &[(usize, f64)]) -> f64 {
        let of = |(k, (a, x)): (usize, &(usize, f64))| {
            let twice: f64 = row[k + 1..].iter().map(|(b, y)| 2.0 * y * self.entry(*a, *b)).sum();
            x * (x * self.entry(*a, *a) + twice)
        };
        row.iter().enumerate().map(of).sum()
    }
}

/// A solution: the unknowns of each frame, and that of all frames.
pub(super) struct Solution {
    pub(super) frames: Vec<Vec<f64>>,
    pub(super) common: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// For each row of Bᵀ the columns, from the first on, of which one has an entry in it or above: the others of L⁻¹ Bᵀ are zero there.
fn reach(coupling: &[(usize, usize, f64)], reached: &mut [usize]) {
    reached.fill(0);
    coupling.iter().for_each(|(row, column, _)| reached[*column] = reached[*column].max(row + 1));
    (1..reached.len()).for_each(|k| reached[k] = reached[k].max(reached[k - 1]));
}

/// Subtracts XᵀX from the lower half of a matrix; the columns of X beyond those `reached` in a row are zero there.
fn subtract_square(matrix: &mut DMatrix<f64>, x: &DMatrix<f64>, reached: &[usize]) {
    for rows in blocks(x.nrows()) {
        let width = reached[rows.end - 1];
        let part = x.view_range(rows, ..width).transpose();
        add_square(matrix.view_range_mut(..width, ..width), -1.0, &part);
    }
}

/// out ← Bᵀ x.
fn couple(coupling: &[(usize, usize, f64)], x: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    coupling.iter().for_each(|(row, column, value)| out[*column] += value * x[*row]);
}

impl Factor {
    /// Factors the equations of `n_frames` frames of `n` unknowns, each written by `assemble`, which may end it by false, with `corner` c and γ
    /// where there is an unknown of all frames. Without `kept` nothing can be solved with it. None where the matrix is not positive definite.
    pub(super) fn of(
        n_frames: usize,
        n: usize,
        corner: Option<[f64; 2]>,
        kept: bool,
        assemble: &mut dyn FnMut(usize, &mut Block) -> bool,
    ) -> Option<Self> {
        let mut found = Self {
            n,
            lower: Vec::with_capacity(if kept { n_frames } else { 1 }),
            couplings: Vec::with_capacity(n_frames),
            gradients: Vec::with_capacity(n_frames),
            borders: Vec::with_capacity(n_frames),
            corner: None,
            log_determinant: 0.0,
            fall: 0.0,
        };
        let mut block = Block::new(n);
        // L⁻¹ Bᵀ of the frame before
        let mut joined = DMatrix::zeros(n, n);
        let mut reached = vec![0; n];
        for i in 0..n_frames {
            block.clear();
            if !assemble(i, &mut block) {
                return None;
            }
            if let (Some(gradient), Some(border)) = (found.gradients.last(), found.borders.last()) {
                subtract_square(&mut block.matrix, &joined, &reached);
                for (k, column) in joined.column_iter().enumerate() {
                    for (j, x) in column.iter().enumerate() {
                        block.gradient[k] -= x * gradient[j];
                        block.border[k] -= x * border[j];
                    }
                }
            }
            let factor = Cholesky::of(block.matrix.clone())?;
            let mut gradient = block.gradient.clone();
            let mut border = block.border.clone();
            factor.solve_lower(&mut gradient);
            factor.solve_lower(&mut border);
            found.log_determinant += factor.log_determinant();
            found.fall += dot(&gradient, &gradient);
            if i + 1 < n_frames {
                joined.fill(0.0);
                block.coupling.iter().for_each(|(row, column, value)| joined[(*column, *row)] += value);
                reach(&block.coupling, &mut reached);
                factor.solve_lower_of(&mut joined, &|rows| reached[rows.end - 1]);
            }
            if !kept {
                found.lower.clear();
            }
            found.lower.push(factor);
            found.couplings.push(if kept { block.coupling.clone() } else { Vec::new() });
            found.gradients.push(gradient);
            found.borders.push(border);
        }
        if let Some([size, gradient]) = corner {
            let product =
                |a: &[Vec<f64>], b: &[Vec<f64>]| a.iter().zip(b).map(|(a, b)| dot(a, b)).sum::<f64>();
            let size = size - product(&found.borders, &found.borders);
            let gradient = gradient - product(&found.borders, &found.gradients);
            if size <= 0.0 {
                return None;
            }
            found.corner = Some([size, gradient]);
            found.log_determinant += size.ln();
            found.fall += gradient * gradient / size;
        }
        (found.log_determinant.is_finite() && found.fall.is_finite()).then_some(found)
    }

    /// The step to the minimum.
    pub(super) fn solve(&self) -> Solution {
        let common = self.corner.map_or(0.0, |[size, gradient]| -gradient / size);
        let right = |i: usize| {
            let of = self.gradients[i].iter().zip(&self.borders[i]);
            of.map(|(gradient, border)| -gradient - border * common).collect()
        };
        Solution { frames: self.steps_back(&right), common }
    }

    /// A⁻¹ of what L⁻¹ has made of `right`.
    fn steps_back(&self, right: &dyn Fn(usize) -> Vec<f64>) -> Vec<Vec<f64>> {
        let n_frames = self.lower.len();
        let mut found: Vec<Vec<f64>> = vec![Vec::new(); n_frames];
        let mut joined = vec![0.0; self.n];
        for i in (0..n_frames).rev() {
            let mut x = right(i);
            if let Some(next) = found.get(i + 1) {
                couple(&self.couplings[i], next, &mut joined);
                self.lower[i].solve_lower(&mut joined);
                x.iter_mut().zip(&joined).for_each(|(x, joined)| *x -= joined);
            }
            self.lower[i].solve_upper(&mut x);
            found[i] = x;
        }
        found
    }

    /// Variance of the unknown that all frames share; 0 if it is known.
    pub(super) fn common_variance(&self) -> f64 {
        self.corner.map_or(0.0, |[size, _]| size.recip())
    }

    /// Visits the covariances from the last frame to the first.
    pub(super) fn covariances<E>(
        &self,
        visit: &mut dyn FnMut(usize, &Covariance) -> Result<(), E>,
    ) -> Result<(), E> {
        let (n, n_frames) = (self.n, self.lower.len());
        // A⁻¹ h over the root of the corner: what not knowing the shared unknown adds
        let root = self.corner.map_or(f64::INFINITY, |[size, _]| size.sqrt());
        let along = self.steps_back(&|i| self.borders[i].iter().map(|x| x / root).collect());
        let deviation = root.recip();
        let mut next: Option<DMatrix<f64>> = None;
        for i in (0..n_frames).rev() {
            let mut own = self.lower[i].inverse();
            let cross = next.as_ref().map(|after| {
                let mut gain = DMatrix::zeros(n, n);
                for (row, column, value) in &self.couplings[i] {
                    gain.column_mut(*row).axpy(*value, &own.column(*column), 1.0);
                }
                let cross = -&gain * after;
                own.gemm(-1.0, &cross, &gain.transpose(), 1.0);
                cross
            });
            // along all unknowns of the two frames and the shared one
            let frames = i..(i + 2).min(n_frames);
            let mut common: Vec<f64> = along[frames].iter().flatten().copied().collect();
            common.push(-deviation);
            let common = DVector::from_vec(common);
            let mut matrix = &common * common.transpose();
            let mut add = |row: usize, column: usize, block: &DMatrix<f64>| {
                let mut part = matrix.view_mut((row, column), (n, n));
                part += block;
            };
            add(0, 0, &own);
            if let (Some(cross), Some(after)) = (&cross, &next) {
                add(0, n, cross);
                add(n, 0, &cross.transpose());
                add(n, n, after);
            }
            visit(i, &Covariance { matrix })?;
            next = Some(own);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Four frames of three unknowns, and three of forty of which a step joins those that are near: with and without one of all frames,
    /// beside the dense matrix.
    #[test]
    fn solution_determinant_and_inverse_are_those_of_the_whole_matrix() {
        for (frames, n, has_common) in [(4, 3, false), (4, 3, true), (3, 40, false), (3, 40, true)] {
            let size = frames * n + usize::from(has_common);
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            // rows that join a frame to the next, and the unknown of all frames to each
            let mut whole: DMatrix<f64> = DMatrix::identity(size, size);
            for i in 0..frames {
                for first in 0..2 * n {
                    // by turns of a frame alone, and of a few of its unknowns with those of the next
                    let k = first / 2;
                    let far = if k % 7 == 0 { 5 * k % n } else { (k + 1) % n };
                    let own: Vec<usize> = if first % 2 == 0 { (0..n).collect() } else { vec![k, far] };
                    let next = own.iter().filter(|_| first % 2 == 1 && i + 1 < frames).map(|k| n + k);
                    let unknowns = own.iter().copied().chain(next);
                    let mut row: Vec<(usize, f64)> =
                        unknowns.map(|k| (i * n + k, rng.random_range(-1.0..1.0))).collect();
                    if has_common {
                        row.push((size - 1, rng.random_range(-1.0..1.0)));
                    }
                    for (a, x) in &row {
                        for (b, y) in &row {
                            whole[(*a, *b)] += x * y;
                        }
                    }
                }
            }
            let right: Vec<f64> = (0..size).map(|_| rng.random_range(-1.0..1.0)).collect();
            let mut assemble = |i: usize, block: &mut Block| {
                for a in 0..n {
                    block.gradient[a] = right[i * n + a];
                    if has_common {
                        block.border[a] = whole[(i * n + a, size - 1)];
                    }
                    for b in 0..n {
                        block.matrix[(a, b)] = whole[(i * n + a, i * n + b)];
                        if i + 1 < frames && whole[((i + 1) * n + a, i * n + b)] != 0.0 {
                            block.coupling.push((a, b, whole[((i + 1) * n + a, i * n + b)]));
                        }
                    }
                }
                true
            };
            let corner = has_common.then(|| [whole[(size - 1, size - 1)], right[size - 1]]);
            let factor = Factor::of(frames, n, corner, true, &mut assemble).unwrap();
            let inverse = whole.clone().try_inverse().unwrap();
            let step = -&inverse * DVector::from_vec(right.clone());
            let found = factor.solve();
            for (k, x) in found.frames.iter().flatten().enumerate() {
                assert!((x - step[k]).abs() < 1e-12, "{k}: {x} {}", step[k]);
            }
            if has_common {
                assert!((found.common - step[size - 1]).abs() < 1e-12);
                assert!((factor.common_variance() - inverse[(size - 1, size - 1)]).abs() < 1e-12);
            }
            assert!((factor.log_determinant - whole.determinant().ln()).abs() < 1e-10);
            let fall = -step.dot(&DVector::from_vec(right.clone()));
            assert!((factor.fall - fall).abs() < 1e-11);
            // a function of two frames and the unknown that all share
            let mut visited = 0;
            let mut visit = |i: usize, found: &Covariance| {
                let width = if i + 1 < frames { 2 * n } else { n };
                let mut row: Vec<(usize, f64)> = (0..width).map(|k| (k, 1.0 / (k + 1) as f64)).collect();
                let mut all = DVector::zeros(size);
                row.iter().for_each(|(k, x)| all[i * n + k] = *x);
                if has_common {
                    row.push((COMMON, 0.7));
                    all[size - 1] = 0.7;
                }
                let expected = all.dot(&(&inverse * &all));
                assert!((found.variance(&row) - expected).abs() < 1e-12, "frame {i}");
                for k in 0..n {
                    let expected = inverse[(i * n + k, i * n + k)];
                    assert!((found.variance(&[(k, 1.0)]) - expected).abs() < 1e-12, "frame {i}, {k}");
                }
                visited += 1;
                Ok::<_, ()>(())
            };
            factor.covariances(&mut visit).unwrap();
            assert_eq!(visited, frames);
        }
    }
}
