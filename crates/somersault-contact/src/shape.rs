//! What of a body touches a surface: a point, a ball, the rim of a disk, a capsule or a box.

use crate::carrier::Carrier;
use crate::error::{ContactError, finite};
use crate::surface::{SignedDistance, SurfaceCore};
use nalgebra::{Matrix3, Unit, UnitQuaternion, Vector3};
use somersault_core::argument::{expect_not_negative, expect_positive, expect_range};

/// Distance from an end of a segment, over half its length, that is rounding.
const ROUNDING: f64 = 1e-12;

/// The part of a body or a link that touches; in its frame, from the centre of mass or the origin of the link, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A point.
    Point(Vector3<f64>),
    /// A ball. Its gap is the distance of its centre less its radius.
    Ball {
        /// Centre.
        centre: Vector3<f64>,
        /// Radius.
        radius: f64,
    },
    /// A circle, against a plane. It touches with its lowest point, which is not defined where it lies flat.
    Rim {
        /// Centre.
        centre: Vector3<f64>,
        /// Axis.
        axis: Unit<Vector3<f64>>,
        /// Radius.
        radius: f64,
    },
    /// All points within a radius of a segment, against a sphere or a cylinder seen from outside. It touches at the point of the
    /// segment nearest to the centre or axis of the surface, which is not unique where the segment is parallel to that axis. The second
    /// derivative of the gap jumps where that point reaches an end of the segment.
    Capsule {
        /// Centre.
        centre: Vector3<f64>,
        /// From the centre to an end of the segment.
        half: Vector3<f64>,
        /// Radius; zero of an edge.
        radius: f64,
    },
    /// A box, against a sphere seen from outside. It touches at its point nearest to the centre of the sphere, which must not be inside.
    /// The second derivative of the gap jumps where that point passes from a face to an edge or a corner.
    Box {
        /// Centre.
        centre: Vector3<f64>,
        /// Its axes, as columns.
        axes: Matrix3<f64>,
        /// Half the lengths of its edges.
        half: Vector3<f64>,
    },
}

/// A part of a capsule or a box, or of two capsules, by where its coordinates along the segments or axes end: −1 at one end, 1 at the
/// other, 0 in between. Zero of other shapes.
///
/// The rate of a nearest point jumps where it passes from one part to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Feature([i8; 3]);

impl Feature {
    /// By the coordinates, each of which is limited to [-1, 1].
    fn of_coordinates(free: [f64; 3]) -> Self {
        Self(free.map(|x| i8::from(x > 1.0) - i8::from(x < -1.0)))
    }
}

/// Gap, lever arm of the contact from the origin of its carrier and normal, world frame.
pub(crate) struct Place {
    pub(crate) gap: f64,
    pub(crate) arm: Vector3<f64>,
    pub(crate) normal: Vector3<f64>,
}

impl Shape {
    /// A ball.
    pub(crate) fn try_ball(centre: Vector3<f64>, radius: f64) -> Result<Self, ContactError> {
        Ok(Self::Ball { centre: finite("centre", centre)?, radius: expect_positive("radius", radius)? })
    }

    /// A capsule, by the ends of its segment; without a radius an edge.
    pub(crate) fn try_capsule(ends: [Vector3<f64>; 2], radius: f64) -> Result<Self, ContactError> {
        let [a, b] = [finite("ends", ends[0])?, finite("ends", ends[1])?];
        let half = (b - a) * 0.5;
        let allowed = "two points with a finite distance other than zero";
        expect_range("ends", 2.0 * half.norm(), allowed, |length| length > 0.0 && length.is_finite())?;
        Ok(Self::Capsule { centre: a + half, half, radius: expect_not_negative("radius", radius)? })
    }

    /// A box, by the lengths of its edges and its place.
    pub(crate) fn try_box(
        size: Vector3<f64>,
        (centre, orientation): (Vector3<f64>, UnitQuaternion<f64>),
    ) -> Result<Self, ContactError> {
        for edge in &size {
            expect_positive("size", *edge)?;
        }
        let axes = orientation.to_rotation_matrix().into_inner();
        Ok(Self::Box { centre: finite("centre", centre)?, axes, half: size * 0.5 })
    }

    /// The point, or the centre.
    pub fn centre(&self) -> &Vector3<f64> {
        match self {
            Self::Point(centre)
            | Self::Ball { centre, .. }
            | Self::Rim { centre, .. }
            | Self::Capsule { centre, .. }
            | Self::Box { centre, .. } => centre,
        }
    }

    /// The radius of a ball, a rim or a capsule; zero of a point and a box.
    pub fn radius(&self) -> f64 {
        match self {
            Self::Ball { radius, .. } | Self::Rim { radius, .. } | Self::Capsule { radius, .. } => *radius,
            Self::Point(_) | Self::Box { .. } => 0.0,
        }
    }

    /// How far from the origin of its frame the point is that its gap follows, at most, m: the centre of a ball.
    #[inline]
    pub(crate) fn reach(&self) -> f64 {
        match self {
            Self::Point(centre) | Self::Ball { centre, .. } => centre.norm(),
            Self::Rim { centre, radius, .. } => centre.norm() + radius,
            Self::Capsule { centre, half, .. } | Self::Box { centre, half, .. } => {
                centre.norm() + half.norm()
            }
        }
    }

    /// Whether the point that touches moves in the shape.
    #[inline]
    pub(crate) fn is_extended(&self) -> bool {
        match self {
            Self::Point(_) | Self::Ball { .. } => false,
            Self::Rim { .. } | Self::Capsule { .. } | Self::Box { .. } => true,
        }
    }

    /// The arm of the point of a capsule or a box nearest to a core; of another shape that of its centre.
    #[inline]
    pub(crate) fn nearest(&self, core: &SurfaceCore, x: &impl Carrier) -> Vector3<f64> {
        self.nearest_moving((core, &Vector3::zeros()), x).0
    }

    /// The same with the velocity of that point, for a core that moves; NaN for a box and a line.
    pub(crate) fn nearest_moving(
        &self,
        (core, core_velocity): (&SurfaceCore, &Vector3<f64>),
        x: &impl Carrier,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let centre = x.turned(self.centre());
        match (self, core) {
            (Self::Point(_) | Self::Ball { .. } | Self::Rim { .. }, _) => (centre, x.velocity_at(&centre)),
            (Self::Capsule { half, .. }, _) => {
                let half = x.turned(half);
                let (way, across) = (core.way_to(&(x.origin() + centre)), core.across(&half));
                let square = across.norm_squared();
                let free = place_along(&way, &across);
                let place = free.clamp(-1.0, 1.0);
                let arm = centre + half * place;
                let velocity = x.velocity_at(&arm);
                if free != place || square == 0.0 {
                    return (arm, velocity);
                }
                // From way · across = 0 at the point.
                let way = way + across * place;
                let change =
                    across.dot(&(velocity - core_velocity)) + way.dot(&core.across(&x.spin().cross(&half)));
                (arm, velocity - half * (change / square))
            }
            (Self::Box { axes, half, .. }, SurfaceCore::Point(at)) => {
                let span = at - x.origin() - centre;
                let away = core_velocity - x.velocity_at(&centre);
                let (mut arm, mut slip) = (centre, Vector3::zeros());
                for (axis, half) in axes.column_iter().zip(half) {
                    let axis = x.turned(&axis.into_owned());
                    let (free, rate) = (axis.dot(&span), axis.dot(&away) + x.spin().cross(&axis).dot(&span));
                    let place = free.clamp(-half, *half);
                    arm += axis * place;
                    if free == place {
                        slip += axis * rate;
                    }
                }
                (arm, x.velocity_at(&arm) + slip)
            }
            (Self::Box { .. }, SurfaceCore::Line(..)) => {
                (Vector3::repeat(f64::NAN), Vector3::repeat(f64::NAN))
            }
        }
    }

    /// The part that is nearest to a core.
    pub(crate) fn feature(&self, core: &SurfaceCore, x: &impl Carrier) -> Feature {
        let centre = x.turned(self.centre());
        match (self, core) {
            (Self::Point(_) | Self::Ball { .. } | Self::Rim { .. }, _)
            | (Self::Box { .. }, SurfaceCore::Line(..)) => Feature::default(),
            (Self::Capsule { half, .. }, _) => {
                let (way, across) = (core.way_to(&(x.origin() + centre)), core.across(&x.turned(half)));
                Feature::of_coordinates([place_along(&way, &across), 0.0, 0.0])
            }
            (Self::Box { axes, half, .. }, SurfaceCore::Point(at)) => {
                let span = at - x.origin() - centre;
                let along = |k: usize| x.turned(&axes.column(k).into_owned()).dot(&span) / half[k];
                Feature::of_coordinates([0, 1, 2].map(along))
            }
        }
    }

    #[inline(always)]
    pub(crate) fn place(
        &self,
        core: Option<&SurfaceCore>,
        distance: impl Fn(&Vector3<f64>) -> SignedDistance,
        x: &impl Carrier,
    ) -> Place {
        let arm = match self {
            Self::Point(centre) | Self::Ball { centre, .. } | Self::Rim { centre, .. } => x.turned(centre),
            Self::Capsule { .. } | Self::Box { .. } => {
                core.map_or_else(|| Vector3::repeat(f64::NAN), |core| self.nearest(core, x))
            }
        };
        let at = distance(&(x.origin() + arm));
        let normal = at.gradient;
        match self {
            Self::Point(_) | Self::Box { .. } => Place { gap: at.distance, arm, normal },
            Self::Ball { radius, .. } | Self::Capsule { radius, .. } => {
                Place { gap: at.distance - radius, arm: arm - normal * *radius, normal }
            }
            Self::Rim { axis, radius, .. } => {
                let axis = x.turned(axis.as_ref());
                let down = axis * axis.dot(&normal) - normal;
                let slope = down.norm();
                // A rim that lies flat has no lowest point; no direction is better than another.
                let reach = if slope > 0.0 { down * (radius / slope) } else { Vector3::zeros() };
                Place { gap: at.distance - radius * slope, arm: arm + reach, normal }
            }
        }
    }
}

/// The coordinate, in half lengths from the centre of a segment, of the point of its line nearest to a core, by the way from the core to the
/// centre and the part of the half length across the core.
#[inline(always)]
fn place_along(way: &Vector3<f64>, across: &Vector3<f64>) -> f64 {
    let square = across.norm_squared();
    if square > 0.0 { -across.dot(way) / square } else { 0.0 }
}

/// The parts of two capsules that are nearest to each other.
pub(crate) fn feature_of_segments<C: Carrier>(
    halves: [(&Vector3<f64>, &Vector3<f64>); 2],
    carriers: [&C; 2],
) -> Feature {
    let ends = nearest_of_segments(halves, carriers).map(|(arm, _)| arm);
    let side = |i: usize| {
        let [centre, half] = [halves[i].0, halves[i].1].map(|v| carriers[i].turned(v));
        let place = (ends[i] - centre).dot(&half) / half.norm_squared();
        i8::from(place > 1.0 - ROUNDING) - i8::from(place < ROUNDING - 1.0)
    };
    Feature([side(0), side(1), 0])
}

/// The arms of the nearest points of two capsules, and their velocities.
pub(crate) fn nearest_of_segments<C: Carrier>(
    halves: [(&Vector3<f64>, &Vector3<f64>); 2],
    carriers: [&C; 2],
) -> [(Vector3<f64>, Vector3<f64>); 2] {
    let [(centre_a, a), (centre_b, b)] =
        [0, 1].map(|i| (carriers[i].turned(halves[i].0), carriers[i].turned(halves[i].1)));
    let [x, y] = carriers;
    let span = (x.origin() - y.origin()) + (centre_a - centre_b);
    let (aa, ab, bb) = (a.norm_squared(), a.dot(&b), b.norm_squared());
    let (of_a, of_b) = (a.dot(&span), b.dot(&span));
    let determinant = aa * bb - ab * ab;
    // The nearest points of parallel segments are not unique; the middle of the first is taken.
    let first =
        if determinant > f64::EPSILON * aa * bb { (ab * of_b - of_a * bb) / determinant } else { 0.0 };
    let mut s = first.clamp(-1.0, 1.0);
    let second = (ab * s + of_b) / bb;
    let t = second.clamp(-1.0, 1.0);
    if t != second {
        s = ((ab * t - of_a) / aa).clamp(-1.0, 1.0);
    }
    let (arm_a, arm_b) = (centre_a + a * s, centre_b + b * t);
    let (velocity_a, velocity_b) = (x.velocity_at(&arm_a), y.velocity_at(&arm_b));
    let (between, relative) = (span + a * s - b * t, velocity_a - velocity_b);
    let change_a = relative.dot(&a) + between.dot(&x.spin().cross(&a));
    let change_b = relative.dot(&b) + between.dot(&y.spin().cross(&b));
    let (rate_a, rate_b) = match (s.abs() < 1.0, t.abs() < 1.0) {
        (true, true) if determinant > f64::EPSILON * aa * bb => {
            ((ab * change_b - bb * change_a) / determinant, (aa * change_b - ab * change_a) / determinant)
        }
        (true, _) => (-change_a / aa, 0.0),
        (false, true) => (0.0, change_b / bb),
        (false, false) => (0.0, 0.0),
    };
    [(arm_a, velocity_a + a * rate_a), (arm_b, velocity_b + b * rate_b)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carrier::Frame;
    use nalgebra::Rotation3;
    use somersault_core::random::SplitMix64;
    use somersault_integrators::state::Twist;
    use somersault_integrators::variation::Tangent;

    fn vector(random: &mut SplitMix64, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| size * (2.0 * random.unit() - 1.0))
    }

    fn frame(random: &mut SplitMix64, origin: Vector3<f64>) -> Frame {
        let rotation = Rotation3::new(vector(random, 2.0)).into_inner();
        Frame { origin, rotation, velocity: vector(random, 1.0), angular_velocity: vector(random, 1.0) }
    }

    /// A frame after a time at its velocities.
    fn later(x: &Frame, time: f64) -> Frame {
        let displacement = Twist { linear: x.velocity, angular: x.angular_velocity };
        x.moved(&Tangent { displacement, rate: Twist::default() }, time)
    }

    /// The largest difference of a velocity from that of a point that moves.
    fn error(velocity: Vector3<f64>, place: impl Fn(f64) -> Vector3<f64>) -> f64 {
        ((place(1e-6) - place(-1e-6)) / 2e-6 - velocity).norm()
    }

    #[test]
    fn nearest_points_move_at_their_velocities() {
        let random = &mut SplitMix64::new(3);
        let turn = UnitQuaternion::new(Vector3::new(0.2, 0.5, -0.3));
        let boxed = Shape::try_box(Vector3::new(0.4, 0.6, 0.2), (Vector3::y() * 0.1, turn)).unwrap();
        let capsule = Shape::try_capsule([Vector3::x() * 0.4, Vector3::z()], 0.1).unwrap();
        let line = SurfaceCore::Line(Vector3::zeros(), Unit::new_normalize(Vector3::new(1.0, 0.3, -0.2)));
        let point = SurfaceCore::Point(Vector3::zeros());
        for (shape, core) in [(&boxed, point), (&capsule, point), (&capsule, line)] {
            for _ in 0..12 {
                let origin = vector(random, 0.8);
                let (x, drift) = (frame(random, origin), vector(random, 1.0));
                let (_, velocity) = shape.nearest_moving((&core, &drift), &x);
                // In axes that move with the core.
                let mut seen = x;
                seen.velocity -= drift;
                let place = |time: f64| {
                    let x = later(&seen, time);
                    x.origin + shape.nearest(&core, &x)
                };
                let off = error(velocity - drift, place);
                assert!(off < 1e-8, "{shape:?} {core:?}: {off:e}");
            }
        }
        for _ in 0..30 {
            let halves =
                [(vector(random, 0.1), vector(random, 0.5)), (vector(random, 0.1), vector(random, 0.5))];
            let halves = [(&halves[0].0, &halves[0].1), (&halves[1].0, &halves[1].1)];
            let apart = vector(random, 0.8);
            let (x, y) = (frame(random, Vector3::zeros()), frame(random, apart));
            let found = nearest_of_segments(halves, [&x, &y]);
            for (side, carrier) in [x, y].iter().enumerate() {
                let place = |time: f64| {
                    let arms = nearest_of_segments(halves, [&later(&x, time), &later(&y, time)]);
                    later(carrier, time).origin + arms[side].0
                };
                let off = error(found[side].1, place);
                assert!(off < 1e-7, "{side} of {halves:?}: {off:e}");
            }
        }
    }
}
