//! A force and a torque on a rigid body.

use nalgebra::Vector3;
use std::ops::{Add, Mul, Sub};

/// Force F (N) and torque M about the centre of mass (N m), world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wrench {
    /// Force, N.
    pub force: Vector3<f64>,
    /// Torque about the centre of mass, N m.
    pub torque: Vector3<f64>,
}

impl Wrench {
    /// A force that acts at `point` (world frame) on a body with its centre of mass at `position`.
    pub fn at_point(force: Vector3<f64>, point: &Vector3<f64>, position: &Vector3<f64>) -> Self {
        Self { force, torque: (point - position).cross(&force) }
    }
}

impl Add for Wrench {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { force: self.force + other.force, torque: self.torque + other.torque }
    }
}

impl Sub for Wrench {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { force: self.force - other.force, torque: self.torque - other.torque }
    }
}

impl Mul<f64> for Wrench {
    type Output = Self;
    #[inline]
    fn mul(self, a: f64) -> Self {
        Self { force: self.force * a, torque: self.torque * a }
    }
}
