//! Inertia of a rigid body about its centre of mass.

use nalgebra::{Matrix3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};
use std::f64::consts::PI;

/// Why a tensor or a shape is not the inertia of a rigid body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InertiaError {
    /// An argument is NaN or infinite.
    #[error("`{argument}` must be finite, found {found:?}")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
        /// Its components.
        found: Vec<f64>,
    },
    /// A mass or a length is not positive.
    #[error("`{argument}` must be positive, found {found}")]
    NonPositive {
        /// Name of the argument.
        argument: &'static str,
        /// Its value.
        found: f64,
    },
    /// The tensor is not symmetric.
    #[error(
        "`tensor` must be symmetric, found entries ({row},{column}) = {upper} and ({column},{row}) = {lower}"
    )]
    NotSymmetric {
        /// Row of the entry above the diagonal.
        row: usize,
        /// Column of the entry above the diagonal.
        column: usize,
        /// Entry above the diagonal.
        upper: f64,
        /// Entry below the diagonal.
        lower: f64,
    },
    /// A principal moment is not positive.
    #[error("principal moments must all be positive, found {moments:?}")]
    NotPositiveDefinite {
        /// The principal moments.
        moments: [f64; 3],
    },
    /// One principal moment exceeds the sum of the other two, which no distribution of mass has.
    #[error(
        "the largest principal moment must not exceed the sum of the other two (triangle inequality), found {moments:?}"
    )]
    TriangleInequality {
        /// The principal moments.
        moments: [f64; 3],
    },
}

/// Inertia tensor I about the centre of mass in the body frame, with its inverse and its principal
/// axes. Units kg m².
///
/// Symmetric, positive definite, and no principal moment exceeds the sum of the other two (a lamina
/// attains it; the comparison allows a relative rounding of 1e-12).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Matrix3<f64>", into = "Matrix3<f64>")
)]
pub struct Inertia {
    tensor: Matrix3<f64>,
    inverse: Matrix3<f64>,
    principal_moments: Vector3<f64>,
    principal_axes: UnitQuaternion<f64>,
    is_diagonal: bool,
}

impl TryFrom<Matrix3<f64>> for Inertia {
    type Error = InertiaError;

    fn try_from(tensor: Matrix3<f64>) -> Result<Self, InertiaError> {
        Self::try_tensor(tensor)
    }
}

impl From<Inertia> for Matrix3<f64> {
    fn from(inertia: Inertia) -> Self {
        inertia.tensor
    }
}

/// Relative rounding granted to symmetry and to the triangle inequality.
const ROUNDING: f64 = 1e-12;

/// Principal moments that a rigid body can have, kg m²: positive, and none exceeds the sum of the other two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalMoments(Vector3<f64>);

impl PrincipalMoments {
    /// These moments, where a body can have them.
    #[inline]
    pub fn try_new(moments: Vector3<f64>) -> Result<Self, InertiaError> {
        finite("moments", moments.as_slice())?;
        check_moments(&moments)?;
        Ok(Self(moments))
    }

    /// The moments.
    #[inline]
    pub fn as_vector(&self) -> &Vector3<f64> {
        &self.0
    }
}

/// The body axes are the principal ones.
impl From<PrincipalMoments> for Inertia {
    #[inline]
    fn from(PrincipalMoments(moments): PrincipalMoments) -> Self {
        Self {
            tensor: Matrix3::from_diagonal(&moments),
            inverse: Matrix3::from_diagonal(&moments.map(f64::recip)),
            principal_moments: moments,
            principal_axes: UnitQuaternion::identity(),
            is_diagonal: true,
        }
    }
}

impl Inertia {
    /// Inertia with the body axes as principal axes and `moments` along them.
    #[inline]
    pub fn try_principal(moments: Vector3<f64>) -> Result<Self, InertiaError> {
        PrincipalMoments::try_new(moments).map(Self::from)
    }

    /// Inertia from its full tensor in the body frame.
    ///
    /// A diagonal tensor keeps the order of its axes; otherwise the principal moments are ascending.
    pub fn try_tensor(tensor: Matrix3<f64>) -> Result<Self, InertiaError> {
        finite("tensor", tensor.as_slice())?;
        let scale = tensor.amax();
        for (row, column) in [(0, 1), (0, 2), (1, 2)] {
            let (upper, lower) = (tensor[(row, column)], tensor[(column, row)]);
            if (upper - lower).abs() > ROUNDING * scale {
                return Err(InertiaError::NotSymmetric { row, column, upper, lower });
            }
        }
        let symmetric = 0.5 * (tensor + tensor.transpose());
        if symmetric == Matrix3::from_diagonal(&symmetric.diagonal()) {
            return Self::try_principal(symmetric.diagonal());
        }
        let eigen = SymmetricEigen::new(symmetric);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let moments = Vector3::from(order.map(|k| eigen.eigenvalues[k]));
        check_moments(&moments)?;
        let [first, second] = [order[0], order[1]].map(|k| eigen.eigenvectors.column(k).into_owned());
        let axes = Matrix3::from_columns(&[first, second, first.cross(&second)]);
        let inverse = axes * Matrix3::from_diagonal(&moments.map(f64::recip)) * axes.transpose();
        Ok(Self {
            tensor: symmetric,
            inverse: 0.5 * (inverse + inverse.transpose()),
            principal_moments: moments,
            principal_axes: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
            is_diagonal: false,
        })
    }

    /// Solid box with full side lengths `lengths` (m) along the body axes, thesis (7.1).
    pub fn try_box(mass: f64, lengths: Vector3<f64>) -> Result<Self, InertiaError> {
        positive("mass", mass)?;
        for length in lengths.iter() {
            positive("lengths", *length)?;
        }
        let [x, y, z] = lengths.map(|l| l * l).into();
        Self::try_principal(Vector3::new(y + z, x + z, x + y) * (mass / 12.0))
    }

    /// Solid ellipsoid with semi-axes `radii` (m) along the body axes; equal radii make a sphere.
    pub fn try_ellipsoid(mass: f64, radii: Vector3<f64>) -> Result<Self, InertiaError> {
        positive("mass", mass)?;
        for radius in radii.iter() {
            positive("radii", *radius)?;
        }
        let [x, y, z] = radii.map(|r| r * r).into();
        Self::try_principal(Vector3::new(y + z, x + z, x + y) * (mass / 5.0))
    }

    /// Solid sphere.
    pub fn try_sphere(mass: f64, radius: f64) -> Result<Self, InertiaError> {
        positive("radius", radius)?;
        Self::try_ellipsoid(mass, Vector3::repeat(radius))
    }

    /// Thin-walled hollow sphere.
    pub fn try_shell(mass: f64, radius: f64) -> Result<Self, InertiaError> {
        positive("mass", mass)?;
        positive("radius", radius)?;
        Self::try_principal(Vector3::repeat(2.0 / 3.0 * mass * radius * radius))
    }

    /// Solid cylinder with its axis along body z; a small `height` makes a disc.
    pub fn try_cylinder(mass: f64, radius: f64, height: f64) -> Result<Self, InertiaError> {
        positive("mass", mass)?;
        positive("radius", radius)?;
        positive("height", height)?;
        let across = mass * (3.0 * radius * radius + height * height) / 12.0;
        Self::try_principal(Vector3::new(across, across, 0.5 * mass * radius * radius))
    }

    /// Solid capsule with its axis along body z: a cylinder of `height` between two half balls.
    pub fn try_capsule(mass: f64, radius: f64, height: f64) -> Result<Self, InertiaError> {
        positive("mass", mass)?;
        positive("radius", radius)?;
        positive("height", height)?;
        let cylinder_volume = PI * radius * radius * height;
        let ball_volume = 4.0 / 3.0 * PI * radius.powi(3);
        let density = mass / (cylinder_volume + ball_volume);
        let (cylinder, ball) = (density * cylinder_volume, density * ball_volume);
        let along = 0.5 * cylinder * radius * radius + 0.4 * ball * radius * radius;
        let across = cylinder * (3.0 * radius * radius + height * height) / 12.0
            + ball * (0.4 * radius * radius + 0.25 * height * height + 0.375 * height * radius);
        Self::try_principal(Vector3::new(across, across, along))
    }

    /// The same body seen from a body frame turned so that `rotation` maps the old axes to the new
    /// frame: R I Rᵀ.
    pub fn rotated(&self, rotation: &UnitQuaternion<f64>) -> Result<Self, InertiaError> {
        let r = rotation.to_rotation_matrix().into_inner();
        let turned = r * self.tensor * r.transpose();
        Self::try_tensor(0.5 * (turned + turned.transpose()))
    }

    /// The inertia of the same body, so many times as dense.
    ///
    /// Errors: moments that are then not those of a body.
    pub fn scaled(&self, factor: f64) -> Result<Self, InertiaError> {
        let Self { principal_moments, .. } = Self::try_principal(self.principal_moments * factor)?;
        let (tensor, inverse) = (self.tensor * factor, self.inverse / factor);
        Ok(Self { tensor, inverse, principal_moments, ..*self })
    }

    /// Tensor in the body frame.
    #[inline]
    pub fn tensor(&self) -> &Matrix3<f64> {
        &self.tensor
    }

    /// Inverse of the tensor in the body frame.
    #[inline]
    pub fn inverse(&self) -> &Matrix3<f64> {
        &self.inverse
    }

    /// Principal moments, along the axes of [`principal_axes`](Self::principal_axes).
    #[inline]
    pub fn principal_moments(&self) -> &Vector3<f64> {
        &self.principal_moments
    }

    /// Rotation from the principal frame to the body frame: I = P diag(moments) Pᵀ.
    #[inline]
    pub fn principal_axes(&self) -> &UnitQuaternion<f64> {
        &self.principal_axes
    }

    /// Whether the body axes are principal axes.
    #[inline]
    pub fn is_diagonal(&self) -> bool {
        self.is_diagonal
    }

    /// I ω, both in the body frame.
    #[inline(always)]
    pub fn momentum(&self, angular_velocity_body: &Vector3<f64>) -> Vector3<f64> {
        if self.is_diagonal {
            self.principal_moments.component_mul(angular_velocity_body)
        } else {
            self.tensor * angular_velocity_body
        }
    }

    /// I⁻¹ L, both in the body frame.
    #[inline(always)]
    pub fn velocity(&self, angular_momentum_body: &Vector3<f64>) -> Vector3<f64> {
        if self.is_diagonal {
            self.inverse.diagonal().component_mul(angular_momentum_body)
        } else {
            self.inverse * angular_momentum_body
        }
    }
}

#[inline]
fn finite(argument: &'static str, values: &[f64]) -> Result<(), InertiaError> {
    if values.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(InertiaError::NonFinite { argument, found: values.to_vec() })
    }
}

fn positive(argument: &'static str, value: f64) -> Result<(), InertiaError> {
    finite(argument, &[value])?;
    if value > 0.0 { Ok(()) } else { Err(InertiaError::NonPositive { argument, found: value }) }
}

#[inline]
fn check_moments(moments: &Vector3<f64>) -> Result<(), InertiaError> {
    let found = (*moments).into();
    // Subnormal moments are refused with the non-positive ones: their inverse overflows.
    if moments.min() < f64::MIN_POSITIVE {
        return Err(InertiaError::NotPositiveDefinite { moments: found });
    }
    let largest = moments.max();
    let others = moments.sum() - largest;
    if largest > others * (1.0 + ROUNDING) {
        return Err(InertiaError::TriangleInequality { moments: found });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lie::so3;

    #[test]
    fn refuses_what_no_body_has() {
        let at = |x, y, z| Inertia::try_principal(Vector3::new(x, y, z)).unwrap_err();
        assert!(matches!(at(f64::NAN, 1.0, 1.0), InertiaError::NonFinite { argument: "moments", .. }));
        assert!(matches!(at(0.0, 1.0, 1.0), InertiaError::NotPositiveDefinite { .. }));
        assert!(matches!(at(-1.0, 1.0, 1.0), InertiaError::NotPositiveDefinite { .. }));
        assert!(matches!(at(1.0, 1.0, 2.1), InertiaError::TriangleInequality { .. }));
        let skew = Matrix3::new(1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        assert!(matches!(
            Inertia::try_tensor(skew).unwrap_err(),
            InertiaError::NotSymmetric { row: 0, column: 1, .. }
        ));
        assert!(matches!(
            Inertia::try_cylinder(1.0, -1.0, 1.0).unwrap_err(),
            InertiaError::NonPositive { argument: "radius", .. }
        ));
    }

    #[test]
    fn a_lamina_attains_the_triangle_inequality() {
        assert!(Inertia::try_principal(Vector3::new(1.0, 2.0, 3.0)).is_ok());
    }

    #[test]
    fn the_tensor_is_rebuilt_from_its_principal_axes() {
        let turn = so3::exp(&Vector3::new(0.3, -1.1, 2.0));
        let inertia = Inertia::try_principal(Vector3::new(3.0, 2.0, 4.0)).unwrap().rotated(&turn).unwrap();
        let axes = inertia.principal_axes().to_rotation_matrix().into_inner();
        let rebuilt = axes * Matrix3::from_diagonal(inertia.principal_moments()) * axes.transpose();
        assert!((rebuilt - inertia.tensor()).amax() < 1e-14);
        assert!((inertia.tensor() * inertia.inverse() - Matrix3::identity()).amax() < 1e-14);
        assert!((inertia.principal_moments() - Vector3::new(2.0, 3.0, 4.0)).amax() < 1e-14);
        assert!((axes.determinant() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn shapes_have_their_textbook_moments() {
        let half = |i: &Inertia, k: usize| i.principal_moments()[k];
        // A long thin cylinder is a rod, m l²/12; a capsule without cylinder is a ball, 2/5 m r².
        let rod = Inertia::try_cylinder(2.0, 1e-6, 3.0).unwrap();
        assert!((half(&rod, 0) - 1.5).abs() < 1e-11);
        let ball = Inertia::try_capsule(2.0, 0.5, 1e-12).unwrap();
        let sphere = Inertia::try_sphere(2.0, 0.5).unwrap();
        for k in 0..3 {
            assert!((half(&ball, k) - half(&sphere, k)).abs() < 1e-12);
        }
        let cube = Inertia::try_box(6.0, Vector3::repeat(1.0)).unwrap();
        assert!((half(&cube, 0) - 1.0).abs() < 1e-15);
        let shell = Inertia::try_shell(3.0, 1.0).unwrap();
        assert!((half(&shell, 2) - 2.0).abs() < 1e-15);
    }
}
