//! Eigenpostures: a few postures that span the motion of many joints.

use super::JointMotionError;
use nalgebra::{DMatrix, DMatrixView, DVector};
use somersault_core::argument::{expect_finite, expect_least, expect_length};

/// A fundamental posture φ₀ and the directions φ_i − φ₀ to others (thesis 2.11).
///
/// Velocities and accelerations of the joints are the directions times those of the weights (2.12, 2.13). Weights that
/// are not negative and add up to at most one give postures between the given ones.
#[derive(Debug, Clone, PartialEq)]
pub struct EigenpostureBase {
    fundamental: DVector<f64>,
    directions: DMatrix<f64>,
}

/// Relative to the largest singular value.
const RANK_TOLERANCE: f64 = 1e-10;

impl EigenpostureBase {
    /// The base of `postures`, the first of them fundamental, in rad (or m) for each joint.
    ///
    /// Refuses postures whose differences to the first are linearly dependent, to 1e-10 of the largest: weights would not
    /// be unique.
    pub fn try_new<P: AsRef<[f64]>>(postures: &[P]) -> Result<Self, JointMotionError> {
        expect_least("postures", postures.len(), 2)?;
        let (fundamental, others) = (DVector::from_column_slice(postures[0].as_ref()), &postures[1..]);
        for posture in postures {
            expect_length("postures", posture.as_ref().len(), fundamental.len())?;
            expect_finite("postures", posture.as_ref())?;
        }
        let columns: Vec<_> =
            others.iter().map(|p| DVector::from_column_slice(p.as_ref()) - &fundamental).collect();
        Self::of_columns(fundamental, &columns)
    }

    /// The base of a fundamental posture and of `directions` to others, under the same conditions.
    pub fn of_directions<P: AsRef<[f64]>>(
        fundamental: Vec<f64>,
        directions: &[P],
    ) -> Result<Self, JointMotionError> {
        expect_least("directions", directions.len(), 1)?;
        expect_finite("fundamental", &fundamental)?;
        for direction in directions {
            expect_length("directions", direction.as_ref().len(), fundamental.len())?;
            expect_finite("directions", direction.as_ref())?;
        }
        let columns: Vec<_> = directions.iter().map(|d| DVector::from_column_slice(d.as_ref())).collect();
        Self::of_columns(DVector::from_vec(fundamental), &columns)
    }

    fn of_columns(fundamental: DVector<f64>, columns: &[DVector<f64>]) -> Result<Self, JointMotionError> {
        let directions = DMatrix::from_columns(columns);
        if directions.is_empty() {
            return Err(JointMotionError::DependentPostures { rank: 0, expected: columns.len() });
        }
        let singular = directions.singular_values();
        let largest = singular.max();
        let rank = singular.iter().filter(|s| **s > RANK_TOLERANCE * largest).count();
        if rank < columns.len() {
            return Err(JointMotionError::DependentPostures { rank, expected: columns.len() });
        }
        Ok(Self { fundamental, directions })
    }

    /// A weight for each of `n` joints: what the joints do without eigenpostures.
    pub fn joints(n: usize) -> Self {
        Self { fundamental: DVector::zeros(n), directions: DMatrix::identity(n, n) }
    }

    /// Number of joints.
    pub fn n_joints(&self) -> usize {
        self.fundamental.len()
    }

    /// Number of weights: postures beside the fundamental one.
    pub fn n_weights(&self) -> usize {
        self.directions.ncols()
    }

    /// φ₀.
    pub fn fundamental(&self) -> &[f64] {
        self.fundamental.as_slice()
    }

    /// φ_i − φ₀, a column for each weight.
    pub fn directions(&self) -> DMatrixView<'_, f64> {
        self.directions.as_view()
    }

    /// Joint positions for `weights`; NaN where a length is wrong, as from the two that follow.
    #[inline]
    pub fn positions_into(&self, weights: &[f64], out: &mut [f64]) {
        if self.fits(weights, out) {
            out.copy_from_slice(self.fundamental.as_slice());
            self.add(weights, out);
        } else {
            out.fill(f64::NAN);
        }
    }

    /// Joint velocities for rates of the weights, or accelerations for their second rates.
    #[inline]
    pub fn rates_into(&self, weight_rates: &[f64], out: &mut [f64]) {
        if self.fits(weight_rates, out) {
            out.fill(0.0);
            self.add(weight_rates, out);
        } else {
            out.fill(f64::NAN);
        }
    }

    /// Adds to `weights` what a gradient by the joints is for them.
    #[inline]
    pub fn pull_back(&self, joints: &[f64], weights: &mut [f64]) {
        if !self.fits(weights, joints) {
            return weights.fill(f64::NAN);
        }
        let columns = self.directions.as_slice().chunks_exact(self.n_joints());
        for (weight, column) in weights.iter_mut().zip(columns) {
            *weight += column.iter().zip(joints).map(|(a, b)| a * b).sum::<f64>();
        }
    }

    /// The weights whose posture is nearest to joint `positions`, in the sense of least squares, and the
    /// distance that remains.
    pub fn project(&self, positions: &[f64]) -> Result<(DVector<f64>, f64), JointMotionError> {
        expect_length("positions", positions.len(), self.n_joints())?;
        expect_finite("positions", positions)?;
        let difference = DVector::from_column_slice(positions) - &self.fundamental;
        let decomposed = self.directions.clone().col_piv_qr();
        let mut rotated = difference.clone();
        decomposed.q_tr_mul(&mut rotated);
        let mut weights = rotated.rows(0, self.n_weights()).into_owned();
        // of full rank by construction
        decomposed.r().solve_upper_triangular_mut(&mut weights);
        decomposed.p().inv_permute_rows(&mut weights);
        let rest = (difference - &self.directions * &weights).norm();
        Ok((weights, rest))
    }

    #[inline]
    fn fits(&self, weights: &[f64], joints: &[f64]) -> bool {
        weights.len() == self.n_weights() && joints.len() == self.n_joints()
    }

    #[inline]
    fn add(&self, weights: &[f64], out: &mut [f64]) {
        let columns = self.directions.as_slice().chunks_exact(self.n_joints());
        for (weight, column) in weights.iter().zip(columns) {
            for (value, direction) in out.iter_mut().zip(column) {
                *value += weight * direction;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_core::argument::ArgumentError;

    fn base() -> EigenpostureBase {
        EigenpostureBase::try_new(&[[0.1, 0.2, 0.3], [1.0, 0.0, 0.5], [0.0, 2.0, 0.3]]).unwrap()
    }

    #[test]
    fn weights_of_zero_and_one_give_the_postures() {
        let mut q = [0.0; 3];
        base().positions_into(&[0.0, 0.0], &mut q);
        assert_eq!(q, [0.1, 0.2, 0.3]);
        base().positions_into(&[0.0, 1.0], &mut q);
        assert_eq!(q, [0.0, 2.0, 0.3]);
    }

    #[test]
    fn lengths_that_are_wrong_give_nan() {
        let (mut q, mut weights) = ([0.0; 3], [0.0; 2]);
        base().positions_into(&[0.0], &mut q);
        assert!(q.iter().all(|q| q.is_nan()));
        base().rates_into(&[0.0, 1.0], &mut q[..2]);
        base().pull_back(&[1.0; 4], &mut weights);
        assert!(q.iter().chain(&weights).all(|x| x.is_nan()));
    }

    #[test]
    fn projection_gives_back_the_weights() {
        let mut q = [0.0; 3];
        base().positions_into(&[0.3, -0.7], &mut q);
        let (weights, rest) = base().project(&q).unwrap();
        assert!((weights[0] - 0.3).abs() < 1e-14 && (weights[1] + 0.7).abs() < 1e-14 && rest < 1e-14);
    }

    #[test]
    fn dependent_postures_are_refused() {
        let found = EigenpostureBase::try_new(&[[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]]);
        assert_eq!(found, Err(JointMotionError::DependentPostures { rank: 1, expected: 2 }));
        let same = EigenpostureBase::try_new(&[[1.0, 2.0], [1.0, 2.0]]);
        assert_eq!(same, Err(JointMotionError::DependentPostures { rank: 0, expected: 1 }));
        let few = ArgumentError::TooFew { argument: "postures", least: 2, found: 1 };
        assert_eq!(EigenpostureBase::try_new(&[[1.0]]), Err(few.into()));
    }
}
