//! Linear subspaces by orthonormal bases.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use std::ops::Range;

/// A subspace of ℝᴺ. It holds an orthonormal basis of the whole space, whose first columns span it and whose others span
/// its complement; nothing else computes a complement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subspace<const N: usize> {
    basis: SMatrix<f64, N, N>,
    dim: usize,
}

/// Columns shorter than this after the removal of those before them count as dependent.
const DEPENDENT: f64 = 1e-10;

/// With its largest entry one, so that no square over- or underflows; zero and what is not finite stay.
fn scaled<const N: usize>(v: &SVector<f64, N>) -> SVector<f64, N> {
    let largest = v.amax();
    // the quotient, since the inverse of a subnormal number is infinite
    if largest > 0.0 && largest.is_finite() { v / largest } else { *v }
}

impl<const N: usize> Subspace<N> {
    /// Spanned by some columns of an orthogonal matrix.
    pub(super) fn of_columns(orthogonal: &SMatrix<f64, N, N>, columns: Range<usize>) -> Self {
        let mut basis = *orthogonal;
        let others = (0..N).filter(|j| !columns.contains(j));
        for (to, from) in columns.clone().chain(others).enumerate() {
            basis.set_column(to, &orthogonal.column(from));
        }
        Self { basis, dim: columns.len() }
    }

    /// Spanned by any vectors; those that depend on others to ten digits add nothing.
    pub fn spanned_by(vectors: &[SVector<f64, N>]) -> Self {
        let mut basis = SMatrix::<f64, N, N>::zeros();
        let mut found = 0;
        let units = (0..N).map(|i| SVector::<f64, N>::from_fn(|j, _| if i == j { 1.0 } else { 0.0 }));
        let mut dim = 0;
        for (k, vector) in vectors.iter().copied().chain(units).enumerate() {
            if found == N {
                break;
            }
            let vector = scaled(&vector);
            let size = vector.norm();
            let mut rest = vector;
            for _ in 0..2 {
                for j in 0..found {
                    let column = basis.column(j).into_owned();
                    rest -= column * column.dot(&rest);
                }
            }
            // the unit vectors fill up with what is furthest from dependent: any that keeps a digit
            let limit = if k < vectors.len() { DEPENDENT } else { 0.5 / (N as f64).sqrt() };
            let left = rest.norm();
            if left > limit * size && size > 0.0 {
                basis.set_column(found, &(rest / left));
                found += 1;
                dim += usize::from(k < vectors.len());
            }
        }
        Self { basis, dim }
    }

    /// Its dimension.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Orthonormal vectors that span it.
    pub fn basis(&self) -> impl Iterator<Item = SVector<f64, N>> + '_ {
        (0..self.dim).map(|j| self.basis.column(j).into_owned())
    }

    /// The orthogonal complement.
    pub fn complement(&self) -> Self {
        let basis = SMatrix::from_fn(|i, j| self.basis[(i, (j + self.dim) % N)]);
        Self { basis, dim: N - self.dim }
    }

    /// What is common to both: the complement of what either complement spans.
    pub fn intersection(&self, other: &Self) -> Self {
        let vectors: Vec<_> = self.complement().basis().chain(other.complement().basis()).collect();
        Self::spanned_by(&vectors).complement()
    }

    /// Coordinates of the projection of `v`, in the first [`dim`](Self::dim) entries.
    pub fn project(&self, v: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|j, _| if j < self.dim { self.basis.column(j).dot(v) } else { 0.0 })
    }

    /// The angle between `v` and the subspace, rad: asin(‖Wᵀv‖/‖v‖) with W a basis of the complement.
    pub fn angle_to(&self, v: &SVector<f64, N>) -> f64 {
        let v = scaled(v);
        self.complement().project(&v).norm().atan2(self.project(&v).norm())
    }

    /// The principal angles with `other`, rad, ascending, as many as the smaller dimension. Small ones keep their digits.
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
