//! Linear subspaces by orthonormal bases.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// A subspace of ℝⁿ. It holds an orthonormal basis of the whole space, whose first columns span it and whose others span
/// its complement; nothing else computes a complement.
#[derive(Debug, Clone, PartialEq)]
pub struct Subspace {
    basis: DMatrix<f64>,
    dim: usize,
}

/// Columns shorter than this after the removal of those before them count as dependent.
const DEPENDENT: f64 = 1e-10;

/// With its largest entry one, so that no square over- or underflows; zero and what is not finite stay.
fn scaled(v: &DVector<f64>) -> DVector<f64> {
    let largest = v.amax();
    // the quotient, since the inverse of a subnormal number is infinite
    if largest > 0.0 && largest.is_finite() { v / largest } else { v.clone() }
}

impl Subspace {
    /// Spanned by some columns of an orthogonal matrix.
    pub(super) fn of_columns(orthogonal: &DMatrix<f64>, columns: Range<usize>) -> Self {
        let mut basis = orthogonal.clone();
        let others = (0..basis.ncols()).filter(|j| !columns.contains(j));
        for (to, from) in columns.clone().chain(others).enumerate() {
            basis.set_column(to, &orthogonal.column(from));
        }
        Self { basis, dim: columns.len() }
    }

    /// Spanned by any vectors of `dimension` entries; those that depend on others to ten digits add nothing.
    pub fn spanned_by(dimension: usize, vectors: &[DVector<f64>]) -> Self {
        let n = dimension;
        let mut basis = DMatrix::<f64>::zeros(n, n);
        let mut found = 0;
        let units = (0..n).map(|i| DVector::from_fn(n, |j, _| if i == j { 1.0 } else { 0.0 }));
        let mut dim = 0;
        let rounding = 4.0 * f64::EPSILON * n as f64;
        for (k, vector) in vectors.iter().cloned().chain(units).enumerate() {
            if found == n {
                break;
            }
            let is_unit = (vector.norm_squared() - 1.0).abs() <= rounding;
            if k < vectors.len()
                && is_unit
                && (0..found).all(|j| basis.column(j).dot(&vector).abs() <= rounding)
            {
                // what is orthonormal keeps its bits
                basis.set_column(found, &vector);
                found += 1;
                dim += 1;
                continue;
            }
            let mut rest = scaled(&vector);
            let size = rest.norm();
            for _ in 0..2 {
                for j in 0..found {
                    let column = basis.column(j);
                    let part = column.dot(&rest);
                    rest.axpy(-part, &column, 1.0);
                }
            }
            // the unit vectors fill up with what is furthest from dependent: any that keeps a digit
            let limit = if k < vectors.len() { DEPENDENT } else { 0.5 / (n as f64).sqrt() };
            let left = rest.norm();
            if left > limit * size && size > 0.0 {
                basis.set_column(found, &(rest / left));
                found += 1;
                dim += usize::from(k < vectors.len());
            }
        }
        Self { basis, dim }
    }

    /// The dimension of the space that it lies in.
    pub fn dimension(&self) -> usize {
        self.basis.nrows()
    }

    /// Its dimension.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Orthonormal vectors that span it.
    pub fn basis(&self) -> impl Iterator<Item = DVector<f64>> + '_ {
        (0..self.dim).map(|j| self.basis.column(j).into_owned())
    }

    /// The orthogonal complement.
    pub fn complement(&self) -> Self {
        let n = self.dimension();
        let basis = DMatrix::from_fn(n, n, |i, j| self.basis[(i, (j + self.dim) % n)]);
        Self { basis, dim: n - self.dim }
    }

    /// What is common to both, which must lie in one space: the complement of what either complement spans.
    pub fn intersection(&self, other: &Self) -> Self {
        let vectors: Vec<_> = self.complement().basis().chain(other.complement().basis()).collect();
        Self::spanned_by(self.dimension(), &vectors).complement()
    }

    /// Coordinates of the projection of `v`.
    pub fn project(&self, v: &DVector<f64>) -> DVector<f64> {
        self.basis.columns(0, self.dim).tr_mul(v)
    }

    /// The angle between `v` and the subspace, rad: asin(‖Wᵀv‖/‖v‖) with W a basis of the complement.
    pub fn angle_to(&self, v: &DVector<f64>) -> f64 {
        let v = scaled(v);
        let beyond = self.basis.columns_range(self.dim..).tr_mul(&v);
        beyond.norm().atan2(self.project(&v).norm())
    }

    /// The principal angles with `other` in the same space, rad, ascending, as many as the smaller dimension. Small ones keep their digits.
    pub fn angles(&self, other: &Self) -> Vec<f64> {
        let (small, large) = if self.dim <= other.dim { (self, other) } else { (other, self) };
        if small.dim == 0 {
            return Vec::new();
        }
        let part = |of: &Self| {
            DMatrix::from_fn(of.dim, small.dim, |i, j| of.basis.column(i).dot(&small.basis.column(j)))
        };
        let values = |m: DMatrix<f64>| -> DVector<f64> { m.singular_values() };
        let mut cosines: Vec<f64> = values(part(large)).iter().copied().collect();
        cosines.sort_by(|a, b| b.total_cmp(a));
        let rest = large.complement();
        let mut sines: Vec<f64> =
            if rest.dim == 0 { Vec::new() } else { values(part(&rest)).iter().copied().collect() };
        // fewer sines than angles: the others are zero
        sines.resize(sines.len().max(small.dim), 0.0);
        sines.sort_by(f64::total_cmp);
        let sines = &sines[sines.len() - small.dim..];
        cosines.iter().zip(sines).map(|(c, s)| s.atan2(*c)).collect()
    }
}
