//! Kepler's orbit about a centre of attraction, on which a satellite is taken to fly whatever its attitude.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use somersault_core::argument::{ArgumentError, expect_finite, expect_positive};
use somersault_core::roots::bracket;
use std::convert::Infallible;

/// The elements of an elliptic orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elements {
    /// Gravitational parameter μ of the centre, m³/s².
    pub gravitational_parameter: f64,
    /// Semi-major axis, m; the radius of a circle.
    pub semi_major_axis: f64,
    /// Eccentricity, from 0 to below 1.
    pub eccentricity: f64,
    /// Inclination to the plane z = 0, rad.
    pub inclination: f64,
    /// Longitude of the ascending node from x, rad.
    pub ascending_node: f64,
    /// Angle from the node to the periapsis, rad.
    pub periapsis: f64,
    /// Mean anomaly at t = 0, rad.
    pub mean_anomaly: f64,
}

impl Elements {
    /// μ of the earth, m³/s² (IERS Conventions 2010, TCG-compatible).
    pub const EARTH: f64 = 3.986_004_418e14;

    /// A circle in the plane z = 0, on the x axis at t = 0.
    pub fn circle(gravitational_parameter: f64, radius: f64) -> Self {
        Self {
            gravitational_parameter,
            semi_major_axis: radius,
            eccentricity: 0.0,
            inclination: 0.0,
            ascending_node: 0.0,
            periapsis: 0.0,
            mean_anomaly: 0.0,
        }
    }
}

/// An elliptic orbit, known for all times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orbit {
    elements: Elements,
    mean_motion: f64,
    /// Towards the periapsis, 90° ahead of it, and normal to the orbit.
    perifocal: Matrix3<f64>,
}

impl Orbit {
    /// The orbit with these elements.
    pub fn try_new(elements: Elements) -> Result<Self, ArgumentError> {
        let Elements { gravitational_parameter, semi_major_axis, eccentricity, .. } = elements;
        expect_positive("gravitational_parameter", gravitational_parameter)?;
        expect_positive("semi_major_axis", semi_major_axis)?;
        if !(0.0..1.0).contains(&eccentricity) {
            return Err(ArgumentError::OutOfRange {
                argument: "eccentricity",
                allowed: "from 0 to below 1",
                found: eccentricity,
            });
        }
        let angles = [
            ("inclination", elements.inclination),
            ("ascending_node", elements.ascending_node),
            ("periapsis", elements.periapsis),
            ("mean_anomaly", elements.mean_anomaly),
        ];
        for (argument, angle) in angles {
            expect_finite(argument, &[angle])?;
        }
        let mean_motion = (gravitational_parameter / semi_major_axis).sqrt() / semi_major_axis;
        expect_positive("semi_major_axis", mean_motion)?;
        let turn = |axis: &nalgebra::Unit<Vector3<f64>>, angle| Rotation3::from_axis_angle(axis, angle);
        let (x, z) = (Vector3::x_axis(), Vector3::z_axis());
        let perifocal =
            turn(&z, elements.ascending_node) * turn(&x, elements.inclination) * turn(&z, elements.periapsis);
        Ok(Self { elements, mean_motion, perifocal: perifocal.into_inner() })
    }

    /// The elements.
    pub fn elements(&self) -> &Elements {
        &self.elements
    }

    /// Mean motion n = √(μ⁄a³), rad/s.
    pub fn mean_motion(&self) -> f64 {
        self.mean_motion
    }

    /// Distance of the periapsis from the centre, m.
    pub fn periapsis_distance(&self) -> f64 {
        self.elements.semi_major_axis * (1.0 - self.elements.eccentricity)
    }

    /// Position (m) and velocity (m/s) from the centre at time `t`, world frame, by Kepler's equation to rounding.
    pub fn at(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        let Elements { semi_major_axis: a, eccentricity: e, mean_anomaly, .. } = self.elements;
        let (s, c) = eccentric_anomaly(mean_anomaly + self.mean_motion * t, e).sin_cos();
        let flat = ((1.0 - e) * (1.0 + e)).sqrt();
        let speed = a * self.mean_motion / (1.0 - e * c);
        let position = Vector3::new(a * (c - e), a * flat * s, 0.0);
        let velocity = Vector3::new(-speed * s, speed * flat * c, 0.0);
        (self.perifocal * position, self.perifocal * velocity)
    }

    /// The rotation from the orbital frame at time `t` to the world: x from the centre outwards, z normal to the orbit, y ahead.
    pub fn frame(&self, t: f64) -> UnitQuaternion<f64> {
        let (position, _) = self.at(t);
        let (x, z) = (position.normalize(), self.perifocal.column(2).into_owned());
        let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))
    }
}

/// E with E − e sin E = M.
fn eccentric_anomaly(mean: f64, e: f64) -> f64 {
    if e == 0.0 {
        return mean;
    }
    let turns = (mean / std::f64::consts::TAU).round();
    let rest = mean - std::f64::consts::TAU * turns;
    let off = |x: f64| x - e * x.sin() - rest;
    let (low, high) = (rest - e, rest + e);
    let Ok((near, far)) =
        bracket(|x| Ok::<_, Infallible>(off(x)), (low, off(low)), (high, off(high)), rest, 1e-9);
    let mut x = 0.5 * (near + far);
    // from 1e-9 on, two steps of Newton's end at rounding
    for _ in 0..2 {
        x -= off(x) / (1.0 - e * x.cos());
    }
    std::f64::consts::TAU * turns + x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_momentum_and_the_area_law_hold_on_any_ellipse() {
        for e in [0.0, 0.1, 0.7, 0.97] {
            let elements = Elements {
                eccentricity: e,
                inclination: 0.9,
                ascending_node: 2.0,
                periapsis: -0.7,
                mean_anomaly: 0.3,
                ..Elements::circle(2.0, 1.5)
            };
            let orbit = Orbit::try_new(elements).unwrap();
            let momentum = (2.0f64 * 1.5 * (1.0 - e * e)).sqrt();
            for k in -5..20 {
                let t = 0.77 * f64::from(k);
                let (r, v) = orbit.at(t);
                assert!((0.5 * v.norm_squared() - 2.0 / r.norm() + 2.0 / 3.0).abs() < 1e-12 / (1.0 - e));
                assert!((r.cross(&v).norm() - momentum).abs() < 1e-13);
                let h = 1e-5;
                let slope = (orbit.at(t + h).0 - orbit.at(t - h).0) / (2.0 * h);
                assert!((slope - v).norm() < 1e-8 / (1.0 - e).powi(4), "{e} {t} {slope} {v}");
                let axes = orbit.frame(t) * Vector3::x();
                assert!((axes - r.normalize()).norm() < 1e-14);
            }
        }
    }

    #[test]
    fn elements_that_are_no_ellipse_are_refused() {
        let parabola = Elements { eccentricity: 1.0, ..Elements::circle(1.0, 1.0) };
        let said = Orbit::try_new(parabola).unwrap_err().to_string();
        assert_eq!(said, "`eccentricity` must be from 0 to below 1, found 1");
        assert!(Orbit::try_new(Elements::circle(1.0, -1.0)).is_err());
        assert!(Orbit::try_new(Elements { periapsis: f64::NAN, ..Elements::circle(1.0, 1.0) }).is_err());
    }
}
