//! Smooth surfaces as signed distances.

use crate::error::{ContactError, direction, finite};
use nalgebra::{Matrix3, Unit, Vector3};
use somersault_core::argument::expect_positive;

/// Distance of a point from a surface, negative inside, and its gradient there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedDistance {
    /// Distance, m.
    pub distance: f64,
    /// Gradient of the distance, of length 1: the outward normal, along which the surface pushes.
    pub gradient: Vector3<f64>,
}

/// Why a surface cannot be touched where it is.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceFault {
    /// No direction to push along.
    #[error("the gradient of the distance is zero at {point:?}")]
    ZeroGradient {
        /// Where, m.
        point: [f64; 3],
    },
    /// A gradient that is no normal.
    #[error(
        "the gradient of the distance must have the length 1 where the surface is touched, found {length} at {point:?}"
    )]
    NotUnit {
        /// Its length.
        length: f64,
        /// Where, m.
        point: [f64; 3],
    },
    /// A gradient that points into the surface.
    #[error(
        "the gradient of the distance has the wrong sign at {point:?}: it is {gradient:?}, and differences of the distance give {differences:?}"
    )]
    WrongSign {
        /// As it is given.
        gradient: [f64; 3],
        /// As the distance has it.
        differences: [f64; 3],
        /// Where, m.
        point: [f64; 3],
    },
    /// A gradient that is not that of the distance.
    #[error(
        "the gradient of the distance is wrong at {point:?}: it is {gradient:?}, and differences of the distance give {differences:?}"
    )]
    WrongGradient {
        /// As it is given.
        gradient: [f64; 3],
        /// As the distance has it.
        differences: [f64; 3],
        /// Where, m.
        point: [f64; 3],
    },
    /// A distance that changes faster than its surface says.
    #[error(
        "the distance changes faster than the Lipschitz constant {lipschitz} of the surface allows: its gradient has the length {length} at {point:?}"
    )]
    Steep {
        /// Length of the gradient.
        length: f64,
        /// Constant of the surface.
        lipschitz: f64,
        /// Where, m.
        point: [f64; 3],
    },
    /// Two spheres that have no normal.
    #[error("the two spheres have the same centre, {point:?}, and so no normal")]
    Concentric {
        /// Their centre, m.
        point: [f64; 3],
    },
}

/// How far a gradient may be from unit length, or from differences of the distance, where a surface is touched.
const GRADIENT_TOLERANCE: f64 = 1e-3;

/// Whether a surface is fit to be touched at a point: its gradient is that of its distance and has length 1.
///
/// Both are looked at to 10⁻³, by central differences over 6e-6 of the larger of 1 m and the size of the point:
/// six evaluations.
pub fn examine(surface: &dyn Surface, point: &Vector3<f64>) -> Result<(), SurfaceFault> {
    let gradient = surface.signed_distance(point).gradient;
    check_slope(surface, point, &gradient)?;
    let (length, at) = (gradient.norm(), (*point).into());
    if length == 0.0 {
        return Err(SurfaceFault::ZeroGradient { point: at });
    }
    if surface.as_half_space().is_some() {
        return Ok(());
    }
    let step = f64::EPSILON.cbrt() * point.amax().max(1.0);
    let differences = Vector3::from_fn(|axis, _| {
        let mut shift = Vector3::zeros();
        shift[axis] = step;
        let [above, below] = [point + shift, point - shift].map(|p| surface.signed_distance(&p).distance);
        (above - below) * (0.5 / step)
    });
    if (differences + gradient).norm() <= 0.5 * length.max(differences.norm()) {
        let (gradient, differences) = (gradient.into(), differences.into());
        return Err(SurfaceFault::WrongSign { gradient, differences, point: at });
    }
    if (length - 1.0).abs() > GRADIENT_TOLERANCE {
        return Err(SurfaceFault::NotUnit { length, point: at });
    }
    if (differences - gradient).norm() > GRADIENT_TOLERANCE {
        let (gradient, differences) = (gradient.into(), differences.into());
        return Err(SurfaceFault::WrongGradient { gradient, differences, point: at });
    }
    Ok(())
}

/// Whether a gradient is as long as the surface's Lipschitz constant allows.
pub(crate) fn check_slope(
    surface: &dyn Surface,
    point: &Vector3<f64>,
    gradient: &Vector3<f64>,
) -> Result<(), SurfaceFault> {
    let (length, lipschitz) = (gradient.norm(), surface.lipschitz());
    if length > lipschitz * (1.0 + 1e-6) {
        return Err(SurfaceFault::Steep { length, lipschitz, point: (*point).into() });
    }
    Ok(())
}

/// A surface fixed in the world.
///
/// The contact keeps an integrator's order p where the distance has p + 1 continuous derivatives near the
/// point of contact. A distance or gradient that is not finite ends a run with an error and the solution
/// so far.
pub trait Surface: std::fmt::Debug + Send + Sync {
    /// Signed distance and gradient at a point of the world, m.
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance;

    /// A constant K with |φ(p) − φ(q)| ≤ K ‖p − q‖ for the distance φ of all points: 1 where it is a distance.
    ///
    /// Steps in flight are proved clear of the surface with it. A function that is a distance near the surface
    /// only, say one divided by the length of its gradient, has to say what its slope may come to elsewhere; a
    /// gradient found to be longer than K ends a run with an error.
    fn lipschitz(&self) -> f64;

    /// A bound κ ≥ 0, 1/m, of how the distance bends down: its second derivative in every direction is at least
    /// −κ at all points within `reach` (m) of `point`. Zero for a convex obstacle seen from outside; infinite,
    /// as by default, where no bound is known.
    ///
    /// With it steps along a surface are proved clear whatever the speed; without it the gap must exceed what
    /// speed allows, and steps near the surface are divided more often.
    fn concavity(&self, _point: &Vector3<f64>, _reach: f64) -> f64 {
        f64::INFINITY
    }

    /// The point or line at a constant distance from the surface, if the solid is on its side: the centre of a sphere, the axis of a
    /// cylinder. `None`, the default, for other surfaces. A capsule or a box touches at its point nearest to the core.
    fn core(&self) -> Option<SurfaceCore> {
        None
    }

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

/// The centre of a sphere or the axis of a cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SurfaceCore {
    /// A point, m.
    Point(Vector3<f64>),
    /// A point of a line, m, and its direction.
    Line(Vector3<f64>, Unit<Vector3<f64>>),
}

impl SurfaceCore {
    /// The way from the core to a point, across a line.
    #[inline]
    pub(crate) fn way_to(&self, point: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Point(at) | Self::Line(at, _) => self.across(&(point - at)),
        }
    }

    /// The part of a vector across a line; all of it for a point.
    #[inline]
    pub(crate) fn across(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Point(_) => *vector,
            Self::Line(_, along) => vector - along.into_inner() * along.dot(vector),
        }
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
    fn lipschitz(&self) -> f64 {
        1.0
    }
    fn concavity(&self, _: &Vector3<f64>, _: f64) -> f64 {
        0.0
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

    fn seen_from_outside(self, core: SurfaceCore) -> Option<SurfaceCore> {
        match self {
            Self::Inside => Some(core),
            Self::Outside => None,
        }
    }
}

/// A sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphericalSurface {
    centre: Vector3<f64>,
    radius: f64,
    solid: Solid,
}

impl SphericalSurface {
    /// Centre and radius, m.
    pub fn try_new(centre: Vector3<f64>, radius: f64, solid: Solid) -> Result<Self, ContactError> {
        Ok(Self { centre: finite("centre", centre)?, radius: expect_positive("radius", radius)?, solid })
    }
}

impl Surface for SphericalSurface {
    #[inline]
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        radial(point - self.centre, self.radius, self.solid)
    }
    fn lipschitz(&self) -> f64 {
        1.0
    }
    fn concavity(&self, point: &Vector3<f64>, reach: f64) -> f64 {
        radial_concavity(point - self.centre, reach, self.solid)
    }
    fn core(&self) -> Option<SurfaceCore> {
        self.solid.seen_from_outside(SurfaceCore::Point(self.centre))
    }
    fn hessian(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        radial_hessian(point - self.centre, Matrix3::identity(), self.solid)
    }
}

/// An infinite circular cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CylindricalSurface {
    centre: Vector3<f64>,
    axis: Unit<Vector3<f64>>,
    radius: f64,
    solid: Solid,
}

impl CylindricalSurface {
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
            radius: expect_positive("radius", radius)?,
            solid,
        })
    }
}

impl Surface for CylindricalSurface {
    #[inline]
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        let span = point - self.centre;
        radial(span - self.axis.into_inner() * self.axis.dot(&span), self.radius, self.solid)
    }
    fn lipschitz(&self) -> f64 {
        1.0
    }
    fn concavity(&self, point: &Vector3<f64>, reach: f64) -> f64 {
        let span = point - self.centre;
        radial_concavity(span - self.axis.into_inner() * self.axis.dot(&span), reach, self.solid)
    }
    fn core(&self) -> Option<SurfaceCore> {
        self.solid.seen_from_outside(SurfaceCore::Line(self.centre, self.axis))
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

/// Seen from outside spheres and cylinders are convex; seen from inside they bend by one over the distance from
/// the centre.
fn radial_concavity(span: Vector3<f64>, reach: f64, solid: Solid) -> f64 {
    match solid {
        Solid::Inside => 0.0,
        Solid::Outside => {
            let least = span.norm() - reach;
            if least > 0.0 { 1.0 / least } else { f64::INFINITY }
        }
    }
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
        fn lipschitz(&self) -> f64 {
            self.0.lipschitz()
        }
    }

    #[test]
    fn gradients_are_those_of_the_distances() {
        let surfaces: [Box<dyn Surface>; 5] = [
            Box::new(
                HalfSpace::try_new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(1.0, -2.0, 2e200)).unwrap(),
            ),
            Box::new(HalfSpace::try_new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(1.0, -2.0, 2.0)).unwrap()),
            Box::new(SphericalSurface::try_new(Vector3::new(1.0, 0.0, 0.0), 0.5, Solid::Inside).unwrap()),
            Box::new(SphericalSurface::try_new(Vector3::new(1.0, 0.0, 0.0), 3.0, Solid::Outside).unwrap()),
            Box::new(
                CylindricalSurface::try_new(
                    Vector3::zeros(),
                    Vector3::new(1.0, 1.0, 3.0),
                    0.2,
                    Solid::Inside,
                )
                .unwrap(),
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
