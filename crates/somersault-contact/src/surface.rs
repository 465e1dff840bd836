//! Smooth surfaces as signed distances.

use crate::error::{ContactError, direction, finite, positive};
use nalgebra::{Matrix3, Unit, Vector3};

/// Distance of a point from a surface, negative inside, and its gradient there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedDistance {
    /// Distance, m.
    pub distance: f64,
    /// Gradient of the distance, of length 1: the outward normal, along which the surface pushes.
    pub gradient: Vector3<f64>,
}

/// A surface fixed in the world.
///
/// The contact keeps an integrator's order p where the distance has p + 1 continuous derivatives near the
/// point of contact. A distance or gradient that is not finite ends a run with an error and the solution
/// so far.
pub trait Surface: std::fmt::Debug + Send + Sync {
    /// Signed distance and gradient at a point of the world, m.
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance;

    /// The half-space, where the surface is one; contacts ask it without a call through the object.
    fn as_half_space(&self) -> Option<&HalfSpace> {
        None
    }

    /// Second derivative of the distance, 1/m, symmetric; sensitivities ask for it.
    ///
    /// By default central differences of the gradient over 6e-6 of the larger of 1 m and the size of the
    /// point, good to about 1e-10 where the surface is smooth on the scale of a metre.
    fn hessian(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let step = f64::EPSILON.cbrt() * point.amax().max(1.0);
        let columns = [0, 1, 2].map(|axis| {
            let mut shift = Vector3::zeros();
            shift[axis] = step;
            let ends = [point + shift, point - shift].map(|p| self.signed_distance(&p).gradient);
            (ends[0] - ends[1]) * (0.5 / step)
        });
        let matrix = Matrix3::from_columns(&columns);
        (matrix + matrix.transpose()) * 0.5
    }
}

/// The solid n·x < offset, bounded by a plane with outward normal n.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    normal: Unit<Vector3<f64>>,
    offset: f64,
}

impl HalfSpace {
    /// The half-space below the plane through `point` (m) with the outward `normal`, of any length but zero.
    pub fn try_new(point: Vector3<f64>, normal: Vector3<f64>) -> Result<Self, ContactError> {
        let normal = direction("normal", normal)?;
        Ok(Self { normal, offset: normal.dot(&finite("point", point)?) })
    }

    /// The ground z < 0.
    pub fn ground() -> Self {
        Self { normal: Vector3::z_axis(), offset: 0.0 }
    }
}

impl HalfSpace {
    /// The outward normal n, of length 1.
    #[inline]
    pub fn normal(&self) -> &Vector3<f64> {
        &self.normal
    }

    /// The distance of the plane from the origin along n, m.
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Distance of a point, negative inside, m.
    #[inline]
    pub(crate) fn distance(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

impl Surface for HalfSpace {
    #[inline]
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        SignedDistance { distance: self.distance(point), gradient: self.normal.into_inner() }
    }
    fn as_half_space(&self) -> Option<&HalfSpace> {
        Some(self)
    }
    fn hessian(&self, _: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::zeros()
    }
}

/// Which side of a closed surface is solid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Solid {
    /// The inside: bodies touch it from outside.
    Inside,
    /// The outside: bodies move within it.
    Outside,
}

impl Solid {
    fn orient(self, distance: f64, gradient: Vector3<f64>) -> SignedDistance {
        match self {
            Self::Inside => SignedDistance { distance, gradient },
            Self::Outside => SignedDistance { distance: -distance, gradient: -gradient },
        }
    }
}

/// A sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    centre: Vector3<f64>,
    radius: f64,
    solid: Solid,
}

impl Sphere {
    /// Centre and radius, m.
    pub fn try_new(centre: Vector3<f64>, radius: f64, solid: Solid) -> Result<Self, ContactError> {
        Ok(Self { centre: finite("centre", centre)?, radius: positive("radius", radius)?, solid })
    }
}

impl Surface for Sphere {
    #[inline]
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        radial(point - self.centre, self.radius, self.solid)
    }
    fn hessian(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        radial_hessian(point - self.centre, Matrix3::identity(), self.solid)
    }
}

/// An infinite circular cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    centre: Vector3<f64>,
    axis: Unit<Vector3<f64>>,
    radius: f64,
    solid: Solid,
}

impl Cylinder {
    /// A point of the axis, its direction of any length but zero, and the radius, m.
    pub fn try_new(
        centre: Vector3<f64>,
        axis: Vector3<f64>,
        radius: f64,
        solid: Solid,
    ) -> Result<Self, ContactError> {
        Ok(Self {
            centre: finite("centre", centre)?,
            axis: direction("axis", axis)?,
            radius: positive("radius", radius)?,
            solid,
        })
    }
}

impl Surface for Cylinder {
    #[inline]
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        let span = point - self.centre;
        radial(span - self.axis.into_inner() * self.axis.dot(&span), self.radius, self.solid)
    }
    fn hessian(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let across = Matrix3::identity() - self.axis.into_inner() * self.axis.transpose();
        radial_hessian(across * (point - self.centre), across, self.solid)
    }
}

/// Distance from a sphere, or from a cylinder within its cross section.
#[inline]
fn radial(span: Vector3<f64>, radius: f64, solid: Solid) -> SignedDistance {
    let length = span.norm();
    // The normal at the centre is undefined; no direction is better than another, and zero is harmless.
    let gradient = if length > 0.0 { span / length } else { Vector3::zeros() };
    solid.orient(length - radius, gradient)
}

/// Second derivative of the distance from a sphere or cylinder: (A − n nᵀ)/‖s‖ with the projection A onto
/// the span's space.
fn radial_hessian(span: Vector3<f64>, across: Matrix3<f64>, solid: Solid) -> Matrix3<f64> {
    let at = radial(span, 0.0, solid);
    let curvature = if at.distance != 0.0 { 1.0 / at.distance } else { 0.0 };
    (across - at.gradient * at.gradient.transpose()) * curvature
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A surface that leaves its second derivative to the default.
    #[derive(Debug)]
    struct WithoutHessian<'a>(&'a dyn Surface);

    impl Surface for WithoutHessian<'_> {
        fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
            self.0.signed_distance(point)
        }
    }

    #[test]
    fn gradients_are_those_of_the_distances() {
        let surfaces: [Box<dyn Surface>; 5] = [
            Box::new(
                HalfSpace::try_new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(1.0, -2.0, 2e200)).unwrap(),
            ),
            Box::new(HalfSpace::try_new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(1.0, -2.0, 2.0)).unwrap()),
            Box::new(Sphere::try_new(Vector3::new(1.0, 0.0, 0.0), 0.5, Solid::Inside).unwrap()),
            Box::new(Sphere::try_new(Vector3::new(1.0, 0.0, 0.0), 3.0, Solid::Outside).unwrap()),
            Box::new(
                Cylinder::try_new(Vector3::zeros(), Vector3::new(1.0, 1.0, 3.0), 0.2, Solid::Inside).unwrap(),
            ),
        ];
        let p = Vector3::new(0.3, 0.7, -0.4);
        for s in &surfaces {
            let at = s.signed_distance(&p);
            assert!((at.gradient.norm() - 1.0).abs() < 1e-15, "{s:?}");
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = 1e-5;
                let slope = (s.signed_distance(&(p + step)).distance
                    - s.signed_distance(&(p - step)).distance)
                    / 2e-5;
                assert!((slope - at.gradient[axis]).abs() < 1e-9, "{s:?}");
                let bend = (s.signed_distance(&(p + step)).gradient
                    - s.signed_distance(&(p - step)).gradient)
                    / 2e-5;
                assert!((bend - s.hessian(&p).column(axis)).norm() < 1e-8, "{s:?}");
            }
            let hidden = WithoutHessian(s.as_ref());
            assert!((hidden.hessian(&p) - s.hessian(&p)).norm() < 1e-9, "{s:?}");
        }
        assert_eq!(HalfSpace::ground().signed_distance(&p).distance, -0.4);
    }
}
