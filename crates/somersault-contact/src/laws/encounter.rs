//! What the laws of a contact see.

use nalgebra::Vector3;

/// What the laws see of two things that may touch: the first against the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Encounter {
    /// Gap, negative inside, m.
    pub gap: f64,
    /// Its rate, m/s.
    pub rate: f64,
    /// Unit normal, along which the first is pushed.
    pub normal: Vector3<f64>,
    /// The point of contact, world frame, m.
    pub point: Vector3<f64>,
    /// Velocity of the first relative to the second at the point, without its part along the normal, m/s.
    pub sliding: Vector3<f64>,
    /// Relative angular velocity, rad/s.
    pub turning: Vector3<f64>,
    /// Angular velocity of the plane of contact, with which a stretch turns, rad/s; zero on planes, and where no
    /// friction has a stretch.
    pub tilting: Vector3<f64>,
    /// Mass that a force between the two moves, kg: m, or m₁m₂/(m₁ + m₂).
    pub mass: f64,
}

impl Encounter {
    /// Zero in all: the change of one that does not change.
    pub(crate) const ZERO: Self = Self {
        gap: 0.0,
        rate: 0.0,
        normal: Vector3::new(0.0, 0.0, 0.0),
        point: Vector3::new(0.0, 0.0, 0.0),
        sliding: Vector3::new(0.0, 0.0, 0.0),
        turning: Vector3::new(0.0, 0.0, 0.0),
        tilting: Vector3::new(0.0, 0.0, 0.0),
        mass: 0.0,
    };

    /// How much it changes from another one, times a factor.
    pub(crate) fn change_from(&self, before: &Self, factor: f64) -> Self {
        Self {
            gap: (self.gap - before.gap) * factor,
            rate: (self.rate - before.rate) * factor,
            normal: (self.normal - before.normal) * factor,
            point: (self.point - before.point) * factor,
            sliding: (self.sliding - before.sliding) * factor,
            turning: (self.turning - before.turning) * factor,
            tilting: (self.tilting - before.tilting) * factor,
            mass: 0.0,
        }
    }
}
