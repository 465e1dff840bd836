//! The Hessian of the Lagrangian.
//!
//! Of the cost and of the angles it is exact, and of what the clearances do to the channels, too, but for central differences
//! in as many directions as there are channels.

use super::DiveProgram;
use crate::DiveError;
use nalgebra::{DMatrix, SymmetricEigen};

/// Multipliers of inequalities below this fraction of the largest are rounding of a quadratic program.
const ACTIVE: f64 = 1e-6;
/// Singular values of normalised gradients that count as independent.
const RANK: f64 = 1e-6;

impl DiveProgram {
    /// Writes the upper triangle of a matrix for quadratic models of `cost_factor` f + yᵀ c, positive semi-definite. With
    /// soft constraints it is that of Gauss and Newton.
    pub(super) fn convex_curvature(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), DiveError> {
        hessian.fill(0.0);
        if let Some(soft) = &self.soft {
            soft.add_hessian(&self.structure.jacobian, &self.last, self.linear.len(), cost_factor, hessian);
            self.add_cost_curvature(z, cost_factor, hessian);
            return Ok(());
        }
        self.add_curvature(z, cost_factor, multipliers, hessian)?;
        self.make_convex(multipliers, hessian);
        Ok(())
    }

    /// Makes a Jacobian that of the last point.
    pub(crate) fn take_jacobian(&mut self, jacobian: &[f64]) {
        self.last.copy_from_slice(jacobian);
    }

    /// Adds the Hessian of `cost_factor` f + yᵀ c.
    fn add_curvature(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), DiveError> {
        self.add_cost_curvature(z, cost_factor, hessian);
        let (of_angles, of_clearances) = multipliers[self.linear.len()..].split_at(self.n_angles());
        self.add_angle_curvature(z, of_angles, hessian)?;
        if let Some(clearance) = &mut self.clearance {
            let (model, motion) = (self.path.model(), self.path.motion());
            let coefficients = &self.coefficients;
            clearance.add_curvature(model, motion, coefficients, of_clearances, hessian)?;
        }
        Ok(())
    }

    /// Makes the matrix positive semi-definite.
    ///
    /// Along the gradients of constraints that hold with equality the Hessian of a Lagrangian is what it likes, and here
    /// by far the largest and most negative. Their linearisation leaves a step nothing to choose there, so with Q an
    /// orthonormal base of them H is replaced by P H P + κ Q Qᵀ, P = 1 − Q Qᵀ: for a step that keeps to them the same.
    /// Negative eigenvalues that are left, in directions that other constraints block or no minimum has, change sign.
    fn make_convex(&self, multipliers: &[f64], hessian: &mut [f64]) {
        let n = self.structure.variables.len();
        let largest = multipliers[..self.linear.len()].iter().fold(0.0f64, |most, y| most.max(y.abs()));
        let angles = self.linear.len()..self.linear.len() + self.n_angles();
        let holds = |row: &usize| {
            angles.contains(row) || multipliers[*row].abs() > ACTIVE * largest.max(f64::MIN_POSITIVE)
        };
        let rows: Vec<usize> = (0..multipliers.len()).filter(holds).collect();
        let mut normals = DMatrix::zeros(n, rows.len());
        for (row, mut normal) in rows.iter().zip(normals.column_iter_mut()) {
            for (column, entry) in normal.iter_mut().enumerate() {
                *entry = self.structure.jacobian.value(&self.last, *row, column);
            }
            let length = normal.norm().max(f64::MIN_POSITIVE);
            normal /= length;
        }
        let full = DMatrix::from_fn(n, n, |i, j| hessian[entry(i.min(j), i.max(j))]);
        let decomposed = normals.svd(true, false);
        let Some(base) = decomposed.u else { return };
        let rank = decomposed.singular_values.iter().filter(|s| **s > RANK).count();
        let base = base.columns(0, rank);
        let normal_part = base * base.transpose();
        let tangent = DMatrix::identity(n, n) - &normal_part;
        let reduced = &tangent * full * &tangent;
        let size = reduced.amax();
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(reduced);
        let mut scaled = eigenvectors.clone();
        for (mut column, value) in scaled.column_iter_mut().zip(eigenvalues.iter()) {
            column *= value.abs().max(f64::EPSILON * size);
        }
        let convex = scaled * eigenvectors.transpose() + normal_part * size;
        for j in 0..n {
            (0..=j).for_each(|i| hessian[entry(i, j)] = convex[(i, j)]);
        }
    }

    fn add_cost_curvature(&self, z: &[f64], cost_factor: f64, hessian: &mut [f64]) {
        let n_p = self.path().motion().n_parameters();
        let duration = self.duration(z);
        let penalties = &self.dive.penalties;
        let mut slope = vec![0.0; n_p];
        for (quadratic, penalty, power) in
            [(&self.rates[0], penalties.rate, 1), (&self.rates[1], penalties.acceleration, 3)]
        {
            let factor = cost_factor * penalty * self.rate_unit * duration.powi(-power);
            for j in 0..n_p {
                for i in 0..=j {
                    hessian[entry(i, j)] += factor * quadratic.matrix[(i, j)];
                }
            }
            if let Some(k) = self.extra.duration {
                slope.fill(0.0);
                let value = factor * quadratic.evaluate(&z[..n_p], factor, Some(&mut slope));
                let power = f64::from(power);
                for (i, slope) in slope.iter().enumerate() {
                    hessian[entry(i, k)] -= power * slope / duration;
                }
                hessian[entry(k, k)] += power * (power + 1.0) * value / (duration * duration);
            }
        }
        if let Some(k) = self.extra.momentum {
            hessian[entry(k, k)] += cost_factor * penalties.momentum;
        }
    }
}

/// Where the upper triangle has row `i` and column `j`.
pub(crate) fn entry(i: usize, j: usize) -> usize {
    j * (j + 1) / 2 + i
}

#[cfg(test)]
mod tests {
    use crate::{Dive, DiveProgram, Penalties, Range};
    use somersault_nlp::Nlp;

    fn gradient(program: &mut DiveProgram, z: &[f64], y: &[f64]) -> Vec<f64> {
        let structure = program.structure().clone();
        let (mut c, mut gradient) = (vec![0.0; y.len()], vec![0.0; z.len()]);
        let mut jacobian = vec![0.0; structure.jacobian.n_entries()];
        program.evaluate(z, &mut c).unwrap();
        program.differentiate(z, &mut gradient, &mut jacobian).unwrap();
        structure.jacobian.add_transposed_product(&jacobian, y, &mut gradient);
        gradient
    }

    #[test]
    fn the_curvature_is_that_of_differences_of_the_lagrangian() {
        let planar = Dive { n_steps: 10, ..Dive::forward_pike().unwrap() };
        let spatial = Dive { n_steps: 25, ..Dive::twisting(3.5, 1.5).unwrap() };
        let templates = [Dive::pike_template(), Dive::twisting_template(1.5)];
        for (dive, template) in [planar, spatial].into_iter().zip(templates) {
            let dive = Dive {
                lean: Range::new(0.0, 0.3),
                duration: Range::new(1.5, 2.0),
                penalties: Penalties { momentum: 1.0, rate: 1e-3, acceleration: 1e-5 },
                ..dive
            };
            let mut program = dive.program().unwrap();
            let z = program.start(&template).unwrap();
            let n = z.len();
            let y: Vec<f64> =
                (0..program.structure().constraints.len()).map(|k| (k as f64 * 1.3).sin()).collect();
            let mut found = vec![0.0; n * (n + 1) / 2];
            gradient(&mut program, &z, &y);
            program.add_curvature(&z, 0.7, &y, &mut found).unwrap();
            // of fourth order, and of gradients that momenta of 100 kg m²/s scale
            let (h, none) = (1e-4, vec![0.0; y.len()]);
            for k in (0..n).step_by(5).chain(n - 3..n) {
                let mut change = vec![0.0; n];
                for (moves, weight) in [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)] {
                    let mut moved = z.clone();
                    moved[k] += moves * h;
                    let whole = gradient(&mut program, &moved, &y);
                    let of_cost = gradient(&mut program, &moved, &none);
                    for (sum, (whole, of_cost)) in change.iter_mut().zip(whole.iter().zip(&of_cost)) {
                        *sum += weight * (whole - 0.3 * of_cost) / (12.0 * h);
                    }
                }
                for (i, expected) in change.iter().enumerate() {
                    let found = found[super::entry(i.min(k), i.max(k))];
                    assert!(
                        (found - expected).abs() < 1e-6 * (1.0 + expected.abs()),
                        "{i} {k} {found} {expected}"
                    );
                }
            }
        }
    }
}
