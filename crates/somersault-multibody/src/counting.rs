//! Somersaults and twists.
//!
//! With the body's axes B = R_y(ψ) R_x(τ) R_z(φ), x forward, y to the left and z along the body, ψ counts
//! somersaults (forward positive), τ is the tilt out of the plane of the somersault and φ counts twists (to the left
//! positive). With z_y = −sin τ the y component of the body's long axis,
//!
//! ```text
//! ψ̇ = (ω_y − z_y ω_zb)/(1 − z_y²),   φ̇ = (ω_zb − z_y ω_y)/(1 − z_y²)
//! ```
//! where ω_y is taken along the world's lateral axis and ω_zb along the body's long axis. The projections ω_y and
//! ω_zb themselves, which thesis 3.2 integrates, count both angles wrong as soon as the body is tilted. At a tilt of
//! ±90° neither is defined.
//!
//! Source: M. R. Yeadon, J. Biomech. 23 (1990) 59–66, whose angles these are.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use somersault_core::lie::so3::hat;
use std::f64::consts::TAU;

/// ψ, τ and φ, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BodyAngles {
    /// ψ, about the world's lateral axis y.
    pub somersault: f64,
    /// τ, about the axis that is neither.
    pub tilt: f64,
    /// φ, about the body's long axis.
    pub twist: f64,
}

/// The angles about z of rotations about it, the first between −π and π, whole turns counted: less than half a turn from one to the next.
pub fn turns_about_z(orientations: impl IntoIterator<Item = UnitQuaternion<f64>>) -> Vec<f64> {
    let mut last = 0.0;
    let count = |orientation: UnitQuaternion<f64>| {
        let angle = 2.0 * orientation.k.atan2(orientation.w);
        last = angle + TAU * ((last - angle) / TAU).round();
        last
    };
    orientations.into_iter().map(count).collect()
}

/// How angles are read from the orientation of a root.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counting {
    /// The body's axes in those of the root.
    pub axes: UnitQuaternion<f64>,
}

impl Default for Counting {
    /// The axes of the root.
    fn default() -> Self {
        Self { axes: UnitQuaternion::identity() }
    }
}

impl Counting {
    /// ψ and φ in (−π, π], τ in [−π/2, π/2].
    pub fn angles(&self, orientation: &UnitQuaternion<f64>) -> BodyAngles {
        let b = self.body(orientation);
        let (x, y, z) = (b.matrix().column(0), b.matrix().column(1), b.matrix().column(2));
        BodyAngles { somersault: z.x.atan2(z.z), tilt: (-z.y).atan2(x.y.hypot(y.y)), twist: x.y.atan2(y.y) }
    }

    /// The same with the whole turns that come nearest to `before`.
    pub fn unwrapped(&self, orientation: &UnitQuaternion<f64>, before: &BodyAngles) -> BodyAngles {
        let found = self.angles(orientation);
        let near = |angle: f64, before: f64| angle + TAU * ((before - angle) / TAU).round();
        BodyAngles {
            somersault: near(found.somersault, before.somersault),
            tilt: found.tilt,
            twist: near(found.twist, before.twist),
        }
    }

    /// The angles along a motion, the first as it is, whole turns counted: less than half a turn from one to the next.
    pub fn along<'o>(
        &self,
        orientations: impl IntoIterator<Item = &'o UnitQuaternion<f64>>,
    ) -> Vec<BodyAngles> {
        let mut last = BodyAngles::default();
        let count = |orientation| {
            last = self.unwrapped(orientation, &last);
            last
        };
        orientations.into_iter().map(count).collect()
    }

    /// ψ̇, τ̇ and φ̇ for an angular velocity in axes of the root.
    pub fn rates(&self, orientation: &UnitQuaternion<f64>, angular_velocity: &Vector3<f64>) -> BodyAngles {
        let [somersault, tilt, twist] = self.gradients(orientation);
        BodyAngles {
            somersault: somersault.dot(angular_velocity),
            tilt: tilt.dot(angular_velocity),
            twist: twist.dot(angular_velocity),
        }
    }

    /// ∂ψ, ∂τ and ∂φ by a displacement of the orientation, in axes of the root.
    pub fn gradients(&self, orientation: &UnitQuaternion<f64>) -> [Vector3<f64>; 3] {
        let b = self.body(orientation);
        let long = self.axes * Vector3::z();
        let lateral = orientation.inverse_transform_vector(&Vector3::y());
        let z_y = b.matrix()[(1, 2)];
        let cosine = 1.0 - z_y * z_y;
        let somersault = (lateral - long * z_y) / cosine;
        let twist = (long - lateral * z_y) / cosine;
        // the axis of the tilt, R_y(ψ) e_x, is normal to the two others
        let tilt = lateral.cross(&long) / cosine.sqrt();
        [somersault, tilt, twist]
    }

    /// The second derivatives of Σ wᵢ angleᵢ by a displacement log(R₀ᵀ R) of the orientation, for weights of ψ, τ and φ.
    pub fn curvature(&self, orientation: &UnitQuaternion<f64>, weights: [f64; 3]) -> Matrix3<f64> {
        let long = self.axes * Vector3::z();
        let lateral = orientation.inverse_transform_vector(&Vector3::y());
        // what a displacement makes of the gradients; its antisymmetric part is that of the group
        let (z_y, by_lateral) = (lateral.dot(&long), hat(&lateral));
        let cosine = 1.0 - z_y * z_y;
        let by_z = by_lateral.tr_mul(&long).transpose();
        let of_cosine = by_z * (2.0 * z_y / cosine);
        let somersault = (by_lateral - long * by_z) / cosine + (lateral - long * z_y) * of_cosine / cosine;
        let twist =
            (by_lateral * -z_y - lateral * by_z) / cosine + (long - lateral * z_y) * of_cosine / cosine;
        let tilt = (lateral.cross(&long) * of_cosine * 0.5 - hat(&long) * by_lateral) / cosine.sqrt();
        let sum = somersault * weights[0] + tilt * weights[1] + twist * weights[2];
        (sum + sum.transpose()) * 0.5
    }

    /// The orientation with the same somersault, without tilt, and with the given twist, rad.
    pub fn straightened(&self, orientation: &UnitQuaternion<f64>, twist: f64) -> UnitQuaternion<f64> {
        let somersault = self.angles(orientation).somersault;
        let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), somersault);
        turned * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), twist) * self.axes.inverse()
    }

    /// The world's lateral axis in axes of the root, where there is no tilt and the given twist, rad.
    pub fn lateral(&self, twist: f64) -> Vector3<f64> {
        self.axes * (UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -twist) * Vector3::y())
    }

    fn body(&self, orientation: &UnitQuaternion<f64>) -> Rotation3<f64> {
        (orientation * self.axes).to_rotation_matrix()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(somersault: f64, tilt: f64, twist: f64) -> UnitQuaternion<f64> {
        let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
        about(Vector3::y_axis(), somersault)
            * about(Vector3::x_axis(), tilt)
            * about(Vector3::z_axis(), twist)
    }

    #[test]
    fn angles_are_those_of_the_factors() {
        let counting = Counting { axes: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2) };
        for (somersault, tilt, twist) in [(0.3, 0.2, -0.4), (-2.9, -1.2, 3.0), (1.6, 0.0, 2.0)] {
            let found = counting.angles(&(turned(somersault, tilt, twist) * counting.axes.inverse()));
            assert!((found.somersault - somersault).abs() < 1e-14);
            assert!((found.tilt - tilt).abs() < 1e-14 && (found.twist - twist).abs() < 1e-14);
        }
    }

    #[test]
    fn what_is_straight_stays_as_it_is() {
        use std::f64::consts::PI;
        let counting = Counting { axes: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2) };
        for half_twists in -5..=5 {
            let twist = PI * f64::from(half_twists);
            for somersault in [0.4, -2.0, 3.0, 9.0] {
                let straight = turned(somersault, 0.0, twist) * counting.axes.inverse();
                assert!(straight.angle_to(&counting.straightened(&straight, twist)) < 1e-14);
                // a small somersault more turns it about the lateral axis of the world
                let h = 1e-6;
                let more = turned(somersault + h, 0.0, twist) * counting.axes.inverse();
                let by = (straight.inverse() * more).scaled_axis() / h;
                assert!((by - counting.lateral(twist)).norm() < 1e-9, "{half_twists} {somersault}");
                // and what is left of tilt and twist goes
                let bent = turned(somersault, 0.2, twist - 0.3) * counting.axes.inverse();
                assert!(straight.angle_to(&counting.straightened(&bent, twist)) < 1e-14);
            }
        }
    }

    #[test]
    fn gradients_are_differences_of_the_angles() {
        let counting = Counting { axes: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2) };
        let orientation = turned(0.7, -0.5, 1.9);
        let gradients = counting.gradients(&orientation);
        let h = 1e-5;
        for axis in 0..3 {
            let mut u = Vector3::zeros();
            u[axis] = h;
            let at = |u| counting.angles(&(orientation * UnitQuaternion::from_scaled_axis(u)));
            let (plus, minus) = (at(u), at(-u));
            let differences =
                [plus.somersault - minus.somersault, plus.tilt - minus.tilt, plus.twist - minus.twist];
            for (gradient, difference) in gradients.iter().zip(differences) {
                assert!((gradient[axis] - difference / (2.0 * h)).abs() < 1e-9);
            }
        }
    }
}
