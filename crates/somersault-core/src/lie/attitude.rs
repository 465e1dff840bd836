//! Other coordinates of orientations: modified Rodrigues parameters, Rodrigues parameters and Euler angles.
//!
//! | Coordinates | of a turn by θ about the axis e | where they end |
//! |---|---|---|
//! | modified Rodrigues parameters | p = e tan(θ⁄4) | never, with the shadow set −p⁄p² of the same orientation |
//! | Rodrigues parameters | g = e tan(θ⁄2) | at half turns |
//! | Euler angles | three angles about axes of a [`Sequence`] | where the first and the third axis are parallel |
//!
//! Quaternions are [`UnitQuaternion`]s; [`so3::from_xyzw`](super::so3::from_xyzw) reads those with the scalar last. Sequences and angles are those of
//! SciPy's `Rotation`, of which the names are known: letters in lower case for turns about the axes of the world one after the other
//! (extrinsic), in upper case about those of the body (intrinsic), so that `"zyx"` with angles a, b, c is `"XYZ"` with c, b, a.
//!
//! Sources: M. D. Shuster, *A survey of attitude representations*, J. Astronaut. Sci. 41 (1993) 439; H. Schaub and J. L. Junkins,
//! *Stereographic orientation parameters for attitude dynamics*, J. Astronaut. Sci. 44 (1996) 1; E. Bernardes and S. Viollet, *Quaternion to
//! Euler angles conversion: a direct, general and computationally efficient method*, PLoS ONE 17 (2022) e0276302.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::str::FromStr;

/// Coordinates that an orientation does not have, or a name that is not of a sequence.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AttitudeError {
    /// A half turn has no Rodrigues parameters.
    #[error("a half turn has no Rodrigues parameters: the scalar of its quaternion is {scalar:e}")]
    HalfTurn {
        /// The scalar of the quaternion.
        scalar: f64,
    },
    /// The first and the third axis are parallel within 1e-7 rad, so that only the sum or the difference of their angles is known.
    #[error(
        "the Euler angles of `{sequence}` are not determined: the second is {second} rad, where the first and the third axis are parallel"
    )]
    GimbalLock {
        /// The sequence.
        sequence: String,
        /// The second angle, rad.
        second: f64,
    },
    /// Not the name of a sequence.
    #[error(
        "`sequence` must be three of the letters xyz, or of XYZ, of which none follows itself, found `{found}`"
    )]
    Sequence {
        /// What was given.
        found: String,
    },
}

/// Modified Rodrigues parameters p = e tan(θ⁄4) of the turn by at most half a turn, |p| ≤ 1.
pub fn modified_rodrigues(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    q.imag() * (sign / (1.0 + q.w.abs()))
}

/// The other parameters of the same orientation, −p⁄p², which stand for the turn the other way round; infinite for p = 0.
pub fn shadow(p: &Vector3<f64>) -> Vector3<f64> {
    -p / p.norm_squared()
}

/// The orientation with modified Rodrigues parameters of any size.
pub fn from_modified_rodrigues(p: &Vector3<f64>) -> UnitQuaternion<f64> {
    // beyond 1 by the shadow set, so that no square overflows
    let size = p.norm();
    if size > 1.0 {
        let shadow = -(p / size) / size;
        let square = shadow.norm_squared();
        return UnitQuaternion::new_normalize(Quaternion::from_parts(1.0 - square, shadow * 2.0));
    }
    UnitQuaternion::new_normalize(Quaternion::from_parts(1.0 - size * size, p * 2.0))
}

/// Rodrigues parameters g = e tan(θ⁄2), the Gibbs vector.
///
/// Errors within 1e-15 of a half turn, where they are infinite.
pub fn rodrigues(q: &UnitQuaternion<f64>) -> Result<Vector3<f64>, AttitudeError> {
    if q.w.abs() < 1e-15 { Err(AttitudeError::HalfTurn { scalar: q.w }) } else { Ok(q.imag() / q.w) }
}

/// The orientation with Rodrigues parameters.
pub fn from_rodrigues(g: &Vector3<f64>) -> UnitQuaternion<f64> {
    let scale = g.amax().max(1.0);
    UnitQuaternion::new_normalize(Quaternion::from_parts(1.0 / scale, g / scale))
}

/// Three axes to turn about one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sequence {
    axes: [usize; 3],
    is_intrinsic: bool,
}

impl FromStr for Sequence {
    type Err = AttitudeError;

    fn from_str(name: &str) -> Result<Self, AttitudeError> {
        let wrong = || AttitudeError::Sequence { found: name.to_owned() };
        let is_intrinsic = name.starts_with(|letter: char| letter.is_ascii_uppercase());
        let letters = if is_intrinsic { "XYZ" } else { "xyz" };
        let axes: Option<Vec<usize>> = name.chars().map(|letter| letters.find(letter)).collect();
        let axes: [usize; 3] = axes.and_then(|axes| axes.try_into().ok()).ok_or_else(wrong)?;
        if axes[0] == axes[1] || axes[1] == axes[2] {
            return Err(wrong());
        }
        Ok(Self { axes, is_intrinsic })
    }
}

impl std::fmt::Display for Sequence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let letters = if self.is_intrinsic { ["X", "Y", "Z"] } else { ["x", "y", "z"] };
        self.axes.iter().try_for_each(|axis| f.write_str(letters[*axis]))
    }
}

impl Sequence {
    /// The orientation with these angles, rad.
    pub fn orientation(&self, angles: &[f64; 3]) -> UnitQuaternion<f64> {
        let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
        let turns = [0, 1, 2].map(|i| UnitQuaternion::from_axis_angle(&axes[self.axes[i]], angles[i]));
        let [first, second, third] = turns;
        if self.is_intrinsic { first * second * third } else { third * second * first }
    }

    /// The angles of an orientation, rad: the first and the third from −π to π, the second from 0 to π where the first and the third axis
    /// are the same and from −π⁄2 to π⁄2 otherwise.
    ///
    /// Errors where the first and the third axis are parallel within 1e-7 rad.
    pub fn angles(&self, q: &UnitQuaternion<f64>) -> Result<[f64; 3], AttitudeError> {
        let [i, j, last] =
            if self.is_intrinsic { [self.axes[2], self.axes[1], self.axes[0]] } else { self.axes };
        let is_proper = i == last;
        let k = 3 - i - j;
        let sign = if (i + 1) % 3 == j { 1.0 } else { -1.0 };
        let v = q.imag();
        let (a, b, c, d) = if is_proper {
            (q.w, v[i], v[j], v[k] * sign)
        } else {
            (q.w - v[j], v[i] + v[k] * sign, v[j] + q.w, v[k] * sign - v[i])
        };
        let second = 2.0 * c.hypot(d).atan2(a.hypot(b));
        let shift = if is_proper { 0.0 } else { FRAC_PI_2 };
        if second.abs() < 1e-7 || (second - PI).abs() < 1e-7 {
            let second = second - shift;
            return Err(AttitudeError::GimbalLock { sequence: self.to_string(), second });
        }
        let (half_sum, half_difference) = (b.atan2(a), d.atan2(c));
        let wrapped = |angle: f64| angle - TAU * (angle / TAU).round();
        let outer = wrapped(half_sum - half_difference);
        let inner = wrapped((half_sum + half_difference) * if is_proper { 1.0 } else { sign });
        let second = second - shift;
        Ok(if self.is_intrinsic { [inner, second, outer] } else { [outer, second, inner] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angle(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
        super::super::so3::angle_between(a, b)
    }

    fn quaternions() -> impl Iterator<Item = UnitQuaternion<f64>> {
        let mut random = crate::random::SplitMix64::new(5);
        std::iter::repeat_with(move || {
            let [w, x, y, z] = [(); 4].map(|()| random.unit() - 0.5);
            UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
        })
        .take(200)
    }

    const SEQUENCES: [&str; 12] =
        ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz"];

    // of scipy.spatial.transform.Rotation.from_quat([0.3, -0.5, 0.2, 0.7]), SciPy 1.17.1
    #[rustfmt::skip]
    #[allow(clippy::approx_constant)]
    const EULER: [(&str, [f64; 3]); 24] = [
        ("xyz", [0.8584387287005677, -1.2301194970719886, -0.06885648930104454]),
        ("XYZ", [1.2734311815709731, -0.7297276562269663, 1.1071487177940906]),
        ("xzy", [0.7935280655773924, -0.02299053102342108, -1.2308659573252763]),
        ("XZY", [0.34613596356936066, 0.7297276562269666, -1.1071487177940906]),
        ("yxz", [-1.3431070070262408, 0.25564920079827735, 0.7601934180705067]),
        ("YXZ", [-1.2542270731824932, 0.7932594993063655, -0.032775144404075696]),
        ("yzx", [-1.1071487177940906, 0.7297276562269666, 0.34613596356936066]),
        ("YZX", [-1.2308659573252763, -0.02299053102342108, 0.7935280655773924]),
        ("zxy", [-0.032775144404075696, 0.7932594993063655, -1.2542270731824932]),
        ("ZXY", [0.7601934180705067, 0.25564920079827735, -1.3431070070262408]),
        ("zyx", [1.1071487177940906, -0.7297276562269663, 1.2734311815709731]),
        ("ZYX", [-0.06885648930104454, -1.2301194970719886, 0.8584387287005677]),
        ("xyx", [-2.356194490192345, 1.2309594173407747, -3.1172072444170746]),
        ("XYX", [-3.1172072444170746, 1.2309594173407747, -2.356194490192345]),
        ("xzx", [-0.7853981633974483, 1.2309594173407747, 1.595181735967615]),
        ("XZX", [1.595181735967615, 1.2309594173407747, -0.7853981633974483]),
        ("yxy", [-0.032246882435253865, 0.7937880405202961, -1.2082520895303892]),
        ("YXY", [-1.2082520895303892, 0.7937880405202961, -0.032246882435253865]),
        ("yzy", [-1.6030432092301505, 0.7937880405202961, 0.3625442372645076]),
        ("YZY", [0.3625442372645076, 0.7937880405202961, -1.6030432092301505]),
        ("zxz", [1.308676485529424, 1.3506311613932607, -0.7520771675192011]),
        ("ZXZ", [-0.7520771675192011, 1.3506311613932607, 1.308676485529424]),
        ("zyz", [2.8794728123243205, 1.3506311613932607, -2.3228734943140976]),
        ("ZYZ", [-2.3228734943140976, 1.3506311613932607, 2.8794728123243205]),
    ];

    #[test]
    fn coordinates_are_those_of_scipy() {
        let q = super::super::so3::normalized_xyzw(&[0.3, -0.5, 0.2, 0.7]);
        let mrp = Vector3::new(0.18374045155964328, -0.3062340859327388, 0.12249363437309553);
        assert!((modified_rodrigues(&q) - mrp).norm() < 1e-15);
        for (name, expected) in EULER {
            let found = name.parse::<Sequence>().unwrap().angles(&q).unwrap();
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-14, "{name}: {found} {expected}");
            }
        }
    }

    #[test]
    fn every_orientation_comes_back_from_its_coordinates() {
        for q in quaternions() {
            let p = modified_rodrigues(&q);
            assert!(p.norm() <= 1.0);
            assert!(angle(&from_modified_rodrigues(&p), &q) < 1e-15);
            assert!(angle(&from_modified_rodrigues(&shadow(&p)), &q) < 1e-14);
            assert!((shadow(&shadow(&p)) - p).norm() < 1e-15);
            assert!(angle(&from_rodrigues(&rodrigues(&q).unwrap()), &q) < 1e-15);
            for name in SEQUENCES {
                for name in [name.to_owned(), name.to_uppercase()] {
                    let sequence: Sequence = name.parse().unwrap();
                    assert_eq!(sequence.to_string(), name);
                    let angles = sequence.angles(&q).unwrap();
                    assert!(angle(&sequence.orientation(&angles), &q) < 1e-14, "{name}");
                    let mut reversed = angles;
                    reversed.reverse();
                    let swapped: String =
                        name.chars()
                            .rev()
                            .map(|c| {
                                if c.is_uppercase() { c.to_ascii_lowercase() } else { c.to_ascii_uppercase() }
                            })
                            .collect();
                    let other: Sequence = swapped.parse().unwrap();
                    assert!(angle(&other.orientation(&reversed), &q) < 1e-14, "{name} {swapped}");
                }
            }
        }
    }

    #[test]
    fn singular_orientations_and_wrong_names_are_refused() {
        let half = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI);
        assert!(matches!(
            rodrigues(&UnitQuaternion::new_unchecked(Quaternion::new(0.0, 0.0, 1.0, 0.0))),
            Err(AttitudeError::HalfTurn { .. })
        ));
        assert!((modified_rodrigues(&half).norm() - 1.0).abs() < 1e-15);
        for name in SEQUENCES {
            let sequence: Sequence = name.parse().unwrap();
            let second = if name.chars().next() == name.chars().last() { 0.0 } else { FRAC_PI_2 };
            let locked = sequence.orientation(&[0.3, second, -0.8]);
            assert!(matches!(sequence.angles(&locked), Err(AttitudeError::GimbalLock { .. })), "{name}");
        }
        for name in ["", "xy", "xxz", "xyZ", "Xyz", "abc", "xyzx", "zyy"] {
            let said = name.parse::<Sequence>().unwrap_err().to_string();
            assert!(said.starts_with("`sequence` must be three of the letters xyz"), "{said}");
        }
        assert!(
            angle(&from_modified_rodrigues(&Vector3::new(1e200, 0.0, 0.0)), &UnitQuaternion::identity())
                < 1e-15
        );
        assert!(from_rodrigues(&Vector3::new(1e300, 0.0, 0.0)).i == 1.0);
    }
}
