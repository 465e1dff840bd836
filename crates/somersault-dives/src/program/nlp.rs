//! Cost, constraints and their derivatives.

use super::DiveProgram;
use super::channels::LinearRow;
use crate::DiveError;
use somersault_nlp::{Curvature, EvaluationError, Nlp, Structure};

impl DiveProgram {
    fn cost(&self, z: &[f64], mut gradient: Option<&mut [f64]>) -> f64 {
        let (p, duration) = (&z[..self.path.motion().n_parameters()], self.duration(z));
        let penalties = &self.dive.penalties;
        let momentum = self.momentum(z) / self.momentum_unit;
        let mut cost = 0.5 * penalties.momentum * momentum * momentum;
        if let (Some(gradient), Some(k)) = (&mut gradient, self.extra.momentum) {
            gradient[k] += penalties.momentum * momentum;
        }
        for (quadratic, penalty, power) in
            [(&self.rates[0], penalties.rate, 1), (&self.rates[1], penalties.acceleration, 3)]
        {
            // by the fraction of the duration: dt = T dx, d/dt = (1/T) d/dx
            let factor = penalty * self.rate_unit * duration.powi(-power);
            let value = factor * quadratic.evaluate(p, factor, gradient.as_deref_mut());
            cost += value;
            if let (Some(gradient), Some(k)) = (&mut gradient, self.extra.duration) {
                gradient[k] -= f64::from(power) * value / duration;
            }
        }
        cost
    }
}

impl Nlp for DiveProgram {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        self.fly(z, false).map_err(undefined)?;
        for (value, LinearRow { factors }) in constraints.iter_mut().zip(&self.linear) {
            *value = factors.iter().map(|(k, factor)| z[*k] * factor).sum();
        }
        let angles = self.entry_angles();
        let rest = &mut constraints[self.linear.len()..];
        let n_angles = self.n_angles();
        rest[..n_angles].copy_from_slice(&angles[..n_angles]);
        if let Some(clearance) = &mut self.clearance {
            let found = clearance.evaluate(
                self.path.model(),
                self.path.motion(),
                &self.coefficients,
                &mut rest[n_angles..],
            );
            found.map_err(|error| undefined(error.into()))?;
        }
        let mut cost = self.cost(z, None);
        if let Some(soft) = &mut self.soft {
            cost += soft.evaluate(constraints, self.linear.len());
        }
        if cost.is_finite() && constraints.iter().all(|c| c.is_finite()) {
            return Ok(cost);
        }
        Err(EvaluationError::Undefined { what: "the dive".into() })
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.fly(z, true).map_err(undefined)?;
        gradient.fill(0.0);
        self.cost(z, Some(gradient));
        jacobian.copy_from_slice(&self.jacobian);
        let n_angles = self.n_angles();
        for k in 0..n_angles {
            let factors = [0, 1, 2].map(|i| f64::from(u8::from(i == k)));
            self.pull_back_angles(z, &factors).map_err(undefined)?;
            let places = &self.angle_places[k * self.angle_row.len()..];
            places.iter().zip(&self.angle_row).for_each(|(place, value)| jacobian[*place] = *value);
        }
        if let Some(clearance) = &mut self.clearance {
            let (model, motion) = (self.path.model(), self.path.motion());
            let found = clearance.differentiate(model, motion, &self.coefficients, jacobian);
            found.map_err(|error| undefined(error.into()))?;
        }
        let pattern = &self.structure.jacobian;
        self.last.copy_from_slice(jacobian);
        if let Some(soft) = &self.soft {
            for (column, out) in gradient.iter_mut().enumerate() {
                for k in pattern.columns[column]..pattern.columns[column + 1] {
                    *out += soft.weight * soft.violations[pattern.rows[k]] * jacobian[k];
                }
            }
        }
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::GaussNewton
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.convex_curvature(z, cost_factor, multipliers, hessian).map_err(undefined)
    }
}

fn undefined(error: DiveError) -> EvaluationError {
    EvaluationError::Undefined { what: error.to_string() }
}
