//! What of a body touches a surface: a point, a ball, or the rim of a disk.

use crate::carrier::Carrier;
use crate::surface::SignedDistance;
use nalgebra::{Unit, Vector3};

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
}

/// Gap, lever arm of the contact from the origin of its carrier and normal, world frame.
pub(crate) struct Place {
    pub(crate) gap: f64,
    pub(crate) arm: Vector3<f64>,
    pub(crate) normal: Vector3<f64>,
}

impl Shape {
    /// The point, or the centre.
    pub fn centre(&self) -> &Vector3<f64> {
        match self {
            Self::Point(centre) | Self::Ball { centre, .. } | Self::Rim { centre, .. } => centre,
        }
    }

    /// How far from the origin of its frame the point is that its gap follows, at most, m: the centre of a ball.
    #[inline]
    pub(crate) fn reach(&self) -> f64 {
        match self {
            Self::Point(centre) | Self::Ball { centre, .. } => centre.norm(),
            Self::Rim { centre, radius, .. } => centre.norm() + radius,
        }
    }

    #[inline(always)]
    pub(crate) fn place(
        &self,
        distance: impl Fn(&Vector3<f64>) -> SignedDistance,
        x: &impl Carrier,
    ) -> Place {
        let arm = x.turned(self.centre());
        let at = distance(&(x.origin() + arm));
        let normal = at.gradient;
        match self {
            Self::Point(_) => Place { gap: at.distance, arm, normal },
            Self::Ball { radius, .. } => {
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
