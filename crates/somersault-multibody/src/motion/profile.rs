//! Joint forces given at knots of time, as a discretised control is.

use super::TreeForces;
use crate::error::DynamicsError;
use nalgebra::DMatrix;
use somersault_core::argument::{expect_finite, expect_least, expect_length, expect_range};
use somersault_core::interval::{first_between, fraction_between};
use std::sync::Arc;

/// The interpolation between knots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// The line through the values at both.
    Line,
    /// The value at the knot before.
    Hold,
}

/// Knots of time, and the interpolation between them; before the first and after the last knot the value is constant.
#[derive(Debug, Clone, PartialEq)]
pub struct Knots {
    times: Arc<[f64]>,
    between: Between,
}

impl Knots {
    /// Knots at increasing times, s.
    pub fn try_new(times: &[f64], between: Between) -> Result<Self, DynamicsError> {
        expect_least("times", times.len(), 1)?;
        expect_finite("times", times)?;
        for pair in times.windows(2) {
            expect_range("times", pair[1], "increasing", |time| time > pair[0])?;
        }
        Ok(Self { times: times.into(), between })
    }

    /// The times, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The interpolation between them.
    pub fn between(&self) -> Between {
        self.between
    }

    /// The interval that a time lies in, by its first knot, and where in it, as a fraction of its length; the first or the last interval for
    /// times outside.
    fn place(&self, t: f64) -> (usize, f64) {
        let last = self.times.len().saturating_sub(1);
        let knot =
            self.times.partition_point(|time| *time <= t).saturating_sub(1).min(last.saturating_sub(1));
        let Some(next) = self.times.get(knot + 1) else { return (0, 0.0) };
        let part = fraction_between(t, self.times[knot], *next).clamp(0.0, 1.0);
        let part = match self.between {
            Between::Line => part,
            Between::Hold => part.floor(),
        };
        (knot, part)
    }

    /// The derivative of the value at a time by that at a knot.
    pub fn weight(&self, knot: usize, t: f64) -> f64 {
        let (before, part) = self.place(t);
        if knot == before {
            1.0 - part
        } else if knot == before + 1 {
            part
        } else {
            0.0
        }
    }
}

/// Joint forces of a tree given at knots of time, N or N m: they depend on time alone and are not smooth at the knots.
/// Adapted steps end at each knot, and so do all steps of runs that locate events, so that methods keep their order; of other fixed steps
/// the knots must be points of the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueProfile {
    knots: Knots,
    /// One column for each knot.
    values: DMatrix<f64>,
}

impl TorqueProfile {
    /// Of values for each degree of freedom, one column for each knot.
    pub fn try_new(knots: Knots, values: DMatrix<f64>) -> Result<Self, DynamicsError> {
        expect_length("values", values.ncols(), knots.times().len())?;
        expect_finite("values", &values)?;
        Ok(Self { knots, values })
    }

    /// The knots.
    pub fn knots(&self) -> &Knots {
        &self.knots
    }

    /// The values, one column for each knot.
    pub fn values(&self) -> &DMatrix<f64> {
        &self.values
    }

    /// The forces at a time, one for each degree of freedom.
    pub fn forces(&self, t: f64) -> impl Iterator<Item = f64> {
        let (knot, part) = self.knots.place(t);
        let next = (knot + 1).min(self.values.ncols().saturating_sub(1));
        let n = self.values.nrows();
        let [before, after] = [knot, next].map(|k| &self.values.as_slice()[k * n..][..n]);
        before.iter().zip(after).map(move |(before, after)| (1.0 - part) * before + part * after)
    }
}

impl TreeForces for TorqueProfile {
    fn add_torque(&self, t: f64, _: &[f64], _: &[f64], torque: &mut [f64]) {
        torque.iter_mut().zip(self.forces(t)).for_each(|(sum, force)| *sum += force);
    }

    fn depends_on_state(&self) -> bool {
        false
    }

    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        first_between(&self.knots.times, t, end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_pass_through_their_knots_and_stay_at_the_ends() {
        let times = [0.0, 0.1, 0.4];
        let values = DMatrix::from_row_slice(1, 3, &[1.0, 3.0, -2.0]);
        let at = |between, t: f64| {
            let knots = Knots::try_new(&times, between).unwrap();
            let by_weights: f64 = (0..3).map(|knot| knots.weight(knot, t) * values[knot]).sum();
            let mut torque = [0.5];
            TorqueProfile::try_new(knots, values.clone()).unwrap().add_torque(t, &[], &[], &mut torque);
            assert!((torque[0] - 0.5 - by_weights).abs() < 1e-15);
            by_weights
        };
        for (t, on_line, held) in [
            (-1.0, 1.0, 1.0),
            (0.0, 1.0, 1.0),
            (0.05, 2.0, 1.0),
            (0.1_f64.next_down(), 3.0, 1.0),
            (0.1, 3.0, 3.0),
            (0.3, -1.0 / 3.0, 3.0),
            (0.4, -2.0, -2.0),
            (9.0, -2.0, -2.0),
        ] {
            assert!((at(Between::Line, t) - on_line).abs() < 1e-14, "{t}");
            assert_eq!(at(Between::Hold, t), held, "{t}");
        }
        let far = Knots::try_new(&[-1.5e308, 1.5e308], Between::Line).unwrap();
        assert_eq!([-1.6e308, 0.0, 0.75e308, 1.6e308].map(|t| far.weight(1, t)), [0.0, 0.5, 0.75, 1.0]);
        let single = Knots::try_new(&[0.3], Between::Line).unwrap();
        assert!([0.0, 0.3, 1.0].iter().all(|t| single.weight(0, *t) == 1.0));
    }

    #[test]
    fn knots_that_are_none_are_refused() {
        for times in [&[][..], &[0.0, 0.0], &[1.0, 0.5], &[0.0, f64::NAN]] {
            assert!(Knots::try_new(times, Between::Line).is_err(), "{times:?}");
        }
        let knots = Knots::try_new(&[0.0, 1.0], Between::Line).unwrap();
        assert!(TorqueProfile::try_new(knots, DMatrix::zeros(2, 3)).is_err());
    }
}
