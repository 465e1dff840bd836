//! The triangle of a QR decomposition of rows that come one after the other.
//!
//! C. L. Lawson and R. J. Hanson, *Solving Least Squares Problems*, Prentice-Hall 1974, chapter 27: memory does not grow with the rows.

use crate::singular::SingularValues;
use nalgebra::{DMatrix, DVector};

/// R with RᵀR = Σ a aᵀ over the rows a.
pub(super) struct Triangle {
    /// R, and rows that are not in it yet.
    rows: DMatrix<f64>,
    filled: usize,
}

impl Triangle {
    /// Of no row; `block` rows are gathered before they are decomposed.
    pub(super) fn new(columns: usize, block: usize) -> Self {
        Self { rows: DMatrix::zeros(columns + block.max(1), columns), filled: columns }
    }

    /// Adds a row.
    pub(super) fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        if self.filled == self.rows.nrows() {
            self.decompose();
        }
        self.rows.row_mut(self.filled).iter_mut().zip(row).for_each(|(place, x)| *place = x);
        self.filled += 1;
    }

    fn decompose(&mut self) {
        let triangle = self.rows.rows(0, self.filled).into_owned().qr().unpack_r();
        let columns = triangle.ncols();
        self.rows.rows_mut(0, columns).copy_from(&triangle);
        self.filled = columns;
    }

    /// R, square.
    pub(super) fn finish(mut self) -> DMatrix<f64> {
        self.decompose();
        self.rows.rows(0, self.filled).into_owned()
    }
}

/// The singular values, descending, and right singular vectors, as rows, of a square matrix; and UᵀB for a vector B, 0 along those of no
/// image. `None` where a number is not finite or the iteration does not end.
pub(super) fn singular(
    matrix: DMatrix<f64>,
    image: &DVector<f64>,
) -> Option<(DVector<f64>, DMatrix<f64>, DVector<f64>)> {
    let SingularValues { values, vectors, images } = SingularValues::of(matrix)?;
    let along = |(image_of, value): (f64, &f64)| if *value > 0.0 { image_of / value } else { 0.0 };
    let images = images.tr_mul(image);
    let image = DVector::from_iterator(values.len(), images.iter().copied().zip(&values).map(along));
    Some((DVector::from_vec(values), vectors.transpose(), image))
}
