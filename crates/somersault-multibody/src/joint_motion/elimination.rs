//! Linear conditions on coefficients, imposed by solving for some of them.

use nalgebra::DMatrix;

/// An end of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum End {
    /// Its start.
    Start,
    /// Its finish.
    Finish,
}

impl End {
    /// 0 or 1.
    pub fn fraction(self) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Finish => 1.0,
        }
    }
}

/// A channel, or one of its rates, has a value at an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// Where.
    pub end: End,
    /// 0 for the channel itself, r for its r-th derivative by the fraction of the duration.
    pub derivative: usize,
    /// The value.
    pub value: f64,
}

/// The solutions of A c = b: each solved-for entry of c by the free ones.
pub(super) struct Solved {
    /// For each entry of c, the row that gives it; none where it is free.
    pub(super) row_of: Vec<Option<usize>>,
    /// Reduced A: the identity in the columns solved for.
    pub(super) matrix: DMatrix<f64>,
    /// Reduced b.
    pub(super) constant: Vec<f64>,
}

/// Relative to the largest entry of a row.
const DEPENDENCE: f64 = 1e-10;

/// Gauss–Jordan elimination that solves each row for its entry of largest factor; the index of a row that depends on
/// those before it is an error.
///
/// Solving for the entry with the largest factor keeps the others small: the ends of a quintic spline would
/// otherwise have factors of 66.
pub(super) fn solve(mut matrix: DMatrix<f64>, mut constant: Vec<f64>) -> Result<Solved, usize> {
    let mut row_of = vec![None; matrix.ncols()];
    for row in 0..matrix.nrows() {
        let scale = matrix.row(row).amax();
        let free = (0..matrix.ncols()).filter(|j| row_of[*j].is_none());
        let pivot =
            free.max_by(|i, j| matrix[(row, *i)].abs().total_cmp(&matrix[(row, *j)].abs())).ok_or(row)?;
        let factor = matrix[(row, pivot)];
        if factor.abs() <= DEPENDENCE * scale || factor.abs() < DEPENDENCE {
            return Err(row);
        }
        for j in 0..matrix.ncols() {
            matrix[(row, j)] /= factor;
        }
        constant[row] /= factor;
        for other in (0..matrix.nrows()).filter(|other| *other != row) {
            let factor = matrix[(other, pivot)];
            for j in 0..matrix.ncols() {
                matrix[(other, j)] -= factor * matrix[(row, j)];
            }
            matrix[(other, pivot)] = 0.0;
            constant[other] -= factor * constant[row];
        }
        row_of[pivot] = Some(row);
    }
    Ok(Solved { row_of, matrix, constant })
}
