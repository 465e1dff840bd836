//! Curves through rotations.
//!
//! Between two frames R(θ) = R_i exp(σ(θ)), θ from 0 to 1, where σ is the cubic in the Lie algebra with
//!
//! ```text
//! σ(0) = 0,  σ(1) = u_i = log(R_iᵀ R_{i+1}),  σ′(0) = h_i ω_i,  σ′(1) = h_i dexp⁻¹_{−u_i}(ω_{i+1}),
//! ω_i = (h_i u_{i−1}/h_{i−1} + h_{i−1} u_i/h_i) / (h_{i−1} + h_i)
//! ```
//! and ω in body axes, at the ends that of the parabola through three frames. The curve is once continuously
//! differentiable, its error O(h³); turning at a constant rate about a fixed axis is reproduced exactly. It is the same curve
//! in any axes of the world and of the body.

use super::{RecordingError, expect_times};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::lie::so3;

/// The curve through rotations at growing times.
#[derive(Debug, Clone, PartialEq)]
pub struct RotationCurve {
    times: Vec<f64>,
    rotations: Vec<UnitQuaternion<f64>>,
    /// Body axes, rad/s.
    rates: Vec<Vector3<f64>>,
}

impl RotationCurve {
    /// Through `rotations` at `times`; neighbours must differ by less than a half turn. Cost O(n).
    pub fn try_new(times: Vec<f64>, rotations: Vec<UnitQuaternion<f64>>) -> Result<Self, RecordingError> {
        expect_times(&times)?;
        expect_length("rotations", rotations.len(), times.len())?;
        expect_rotations(&rotations, 1)?;
        let n = times.len();
        let h: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
        let mean: Vec<_> =
            (0..n - 1).map(|i| so3::log(&(rotations[i].inverse() * rotations[i + 1])) / h[i]).collect();
        let mut rates = vec![mean.first().copied().unwrap_or_default(); n];
        for i in 1..n.saturating_sub(1) {
            rates[i] = (mean[i - 1] * h[i] + mean[i] * h[i - 1]) / (h[i - 1] + h[i]);
        }
        if n > 2 {
            rates[0] = mean[0] * 2.0 - rates[1];
            rates[n - 1] = mean[n - 2] * 2.0 - rates[n - 2];
        }
        Ok(Self { times, rotations, rates })
    }

    /// The rotation at `t`; outside of the times the outermost curves continue.
    pub fn evaluate(&self, t: f64) -> UnitQuaternion<f64> {
        let n = self.times.len();
        if n == 1 {
            return self.rotations[0];
        }
        let i = self.times.partition_point(|x| *x <= t).clamp(1, n - 1) - 1;
        let h = self.times[i + 1] - self.times[i];
        let x = (t - self.times[i]) / h;
        if x == 1.0 {
            return self.rotations[i + 1];
        }
        let whole = so3::log(&(self.rotations[i].inverse() * self.rotations[i + 1]));
        let (start, end) = (self.rates[i] * h, so3::dexp_inv(&-whole, &self.rates[i + 1]) * h);
        let bend = (start - whole) * (1.0 - x) + (whole - end) * x;
        so3::renormalize(&(self.rotations[i] * so3::exp(&(whole * x + bend * (x * (1.0 - x))))))
    }
}

/// Fails unless all are of unit norm to 1e-9; `per_frame` of them make a frame.
pub(crate) fn expect_rotations(
    rotations: &[UnitQuaternion<f64>],
    per_frame: usize,
) -> Result<(), RecordingError> {
    let unit = |r: &UnitQuaternion<f64>| (r.coords.norm() - 1.0).abs() <= 1e-9;
    match rotations.iter().position(|r| !unit(r)) {
        Some(i) => {
            Err(RecordingError::NotARotation { frame: i / per_frame, found: rotations[i].coords.norm() })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tumbling(t: f64) -> UnitQuaternion<f64> {
        so3::exp(&(Vector3::new(1.0, 0.3, -0.2) * (2.0 * t)))
            * so3::exp(&(Vector3::new(0.0, 1.0, 0.4) * (1.1 * t).sin()))
    }

    fn largest_error(n: u32) -> f64 {
        let times: Vec<f64> = (0..=n).map(|i| f64::from(i) / f64::from(n)).collect();
        let curve = RotationCurve::try_new(times.clone(), times.iter().map(|&t| tumbling(t)).collect());
        let curve = curve.unwrap();
        let at = |i: u32| f64::from(i) / 997.0;
        (0..997).map(|i| so3::angle_between(&curve.evaluate(at(i)), &tumbling(at(i)))).fold(0.0, f64::max)
    }

    #[test]
    fn the_error_is_of_order_three() {
        let errors = [20, 40, 80, 160].map(largest_error);
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((2.8..3.3).contains(&order), "{errors:?}");
        }
    }

    #[test]
    fn a_constant_rate_is_reproduced() {
        let turn = |t: f64| so3::exp(&(Vector3::new(0.5, -1.0, 2.0) * t));
        let times = vec![0.0, 0.3, 0.4, 1.1];
        let curve = RotationCurve::try_new(times.clone(), times.iter().map(|&t| turn(t)).collect()).unwrap();
        for t in [-0.1, 0.0, 0.17, 0.4, 0.9, 1.1] {
            assert!(so3::angle_between(&curve.evaluate(t), &turn(t)) < 1e-15);
        }
    }

    #[test]
    fn axes_of_world_and_body_do_not_matter() {
        let times: Vec<f64> = (0..8).map(|i| 0.1 * f64::from(i)).collect();
        let (left, right) = (tumbling(0.7), tumbling(-2.0));
        let plain = RotationCurve::try_new(times.clone(), times.iter().map(|&t| tumbling(t)).collect());
        let turned = times.iter().map(|&t| left * tumbling(t) * right).collect();
        let (plain, turned) = (plain.unwrap(), RotationCurve::try_new(times, turned).unwrap());
        let expected = left * plain.evaluate(0.33) * right;
        assert!(so3::angle_between(&turned.evaluate(0.33), &expected) < 1e-14);
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let bad = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(1.0, 0.1, 0.0, 0.0));
        let found = RotationCurve::try_new(vec![0.0, 1.0], vec![UnitQuaternion::identity(), bad]);
        assert!(matches!(found, Err(RecordingError::NotARotation { frame: 1, .. })));
    }
}
