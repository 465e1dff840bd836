//! Motions seen in a base of eigenpostures.

use super::AnalysisError;
use crate::fit::quadratic::BoundedQuadratic;
use nalgebra::{DMatrix, DVector};
use somersault_core::argument::expect_length;
use somersault_multibody::joint_motion::EigenpostureBase;

/// What weights may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WeightBounds {
    /// Anything: the postures of the whole affine space.
    None,
    /// w ≥ 0 and Σ w ≤ 1: postures between those of the base.
    Simplex,
}

/// A motion in a base.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// A row for each frame, a column for each weight.
    pub weights: DMatrix<f64>,
    /// Distance of each frame to the nearest posture of the base, in the norm of its coordinates (rad, m).
    pub distances: Vec<f64>,
}

/// The weights that bring `base` nearest to each row of `postures`, by least squares: exact without bounds, and with
/// them by a quadratic program for each frame. Cost O(weights² × joints) and O(weights³) a frame.
pub fn project(
    base: &EigenpostureBase,
    postures: &DMatrix<f64>,
    bounds: WeightBounds,
) -> Result<Projection, AnalysisError> {
    expect_length("columns of postures", postures.ncols(), base.n_joints())?;
    super::expect_finite("postures", postures)?;
    let n = base.n_weights();
    let directions = base.directions();
    let fundamental = DVector::from_column_slice(base.fundamental());
    let mut weights = DMatrix::zeros(postures.nrows(), n);
    let mut distances = Vec::with_capacity(postures.nrows());
    let mut program = BoundedQuadratic::new(n);
    program.hessian = directions.tr_mul(&directions);
    if bounds == WeightBounds::Simplex {
        program.lower.fill(0.0);
        program.summed.fill(true);
        program.sum_bound = 1.0;
    }
    for (i, posture) in postures.row_iter().enumerate() {
        let difference = posture.transpose() - &fundamental;
        let found = match bounds {
            // by orthogonal factors, which do not square the condition of the base
            WeightBounds::None => {
                base.project(posture.transpose().as_slice())
                    .map_err(|_| AnalysisError::NonFinite { argument: "postures", row: i })?
                    .0
            }
            WeightBounds::Simplex => {
                program.gradient.copy_from(&(-directions.tr_mul(&difference)));
                program.solve().map_err(|_| AnalysisError::NoConvergence)?;
                program.solution.clone()
            }
        };
        distances.push((difference - directions * &found).norm());
        weights.row_mut(i).copy_from(&found.transpose());
    }
    Ok(Projection { weights, distances })
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_core::argument::ArgumentError;

    #[test]
    fn projection_finds_weights_and_keeps_them_in_the_simplex() {
        let base = EigenpostureBase::try_new(&[[0.1, 0.2, 0.3], [1.0, 0.0, 0.5], [0.0, 2.0, 0.3]]).unwrap();
        let mut q = [0.0; 3];
        let mut rows = Vec::new();
        for weights in [[0.3, 0.4], [0.0, 0.0], [-0.5, 0.2], [0.9, 0.8]] {
            base.positions_into(&weights, &mut q);
            rows.extend(q);
        }
        let postures = DMatrix::from_row_slice(4, 3, &rows);
        let free = project(&base, &postures, WeightBounds::None).unwrap();
        let expected = DMatrix::from_row_slice(4, 2, &[0.3, 0.4, 0.0, 0.0, -0.5, 0.2, 0.9, 0.8]);
        assert!((&free.weights - expected).amax() < 1e-14);
        assert!(free.distances.iter().all(|d| *d < 1e-14));

        let bounded = project(&base, &postures, WeightBounds::Simplex).unwrap();
        assert!((bounded.weights.rows(0, 2) - free.weights.rows(0, 2)).amax() < 1e-14);
        for (i, row) in bounded.weights.row_iter().enumerate() {
            assert!(row.iter().all(|w| *w >= 0.0) && row.sum() <= 1.0 + 1e-14);
            // no point of the simplex is nearer
            for k in 0..=50 {
                for l in 0..=50 - k {
                    let other = DVector::from_row_slice(&[f64::from(k) / 50.0, f64::from(l) / 50.0]);
                    base.positions_into(other.as_slice(), &mut q);
                    let distance = (postures.row(i).transpose() - DVector::from_row_slice(&q)).norm();
                    assert!(distance >= bounded.distances[i] - 1e-12, "frame {i}: {other}");
                }
            }
        }
        let wrong = project(&base, &DMatrix::zeros(2, 4), WeightBounds::None);
        assert!(matches!(
            wrong,
            Err(AnalysisError::Argument(ArgumentError::Length { expected: 3, found: 4, .. }))
        ));
    }
}
