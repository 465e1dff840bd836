//! Inverse of a 3 × 3 matrix for Newton's method, without branches.

use nalgebra::{Matrix3, Vector3};

/// Inverse by the adjugate, its division kept apart so that it overlaps with what follows. Not finite where
/// the matrix is singular.
pub(crate) struct Inverse3 {
    rows: [Vector3<f64>; 3],
    scale: f64,
}

impl Inverse3 {
    #[inline]
    pub(crate) fn of(m: &Matrix3<f64>) -> Self {
        let (a, b, c) = (m.column(0).into_owned(), m.column(1).into_owned(), m.column(2).into_owned());
        let rows = [b.cross(&c), c.cross(&a), a.cross(&b)];
        Self { rows, scale: 1.0 / a.dot(&rows[0]) }
    }

    #[inline]
    pub(crate) fn times(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.scale * Vector3::new(self.rows[0].dot(v), self.rows[1].dot(v), self.rows[2].dot(v))
    }
}
