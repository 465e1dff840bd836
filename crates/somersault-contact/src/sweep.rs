//! How far what a guard watches may move during a step.
//!
//! A body with |a| ≤ A and a torque of at most M about its centre of mass moves during a step of h between two
//! states with speeds v₀, v₁ and angular speeds ω₀, ω₁ no faster than
//! ```text
//! V = max(v₀, v₁) + A h/2,   Ω = max(ω₀, ω₁) + (Ω²/√3 + M/I₁) h/2,   α = Ω²/√3 + M/I₁,
//! ```
//! I₁ the least principal moment: every instant is within h/2 of an end, and Euler's equations without torque
//! allow |ω̇| ≤ |ω|²/√3, since |I_j − I_k| ≤ I_i. A point at l from the centre of mass then has the speed
//! V + Ω l and the acceleration A + (α + Ω²) l at most.
//!
//! A and M come from [`ForceModel::bound`] where it knows them: then what follows is proved for the motion.
//! Where a force is a closure, or a contact is closed, they are estimated: twice the largest acceleration of
//! the cubic through the states at both ends, and twice the mean angular acceleration. That is no proof; it
//! fails where a step is too long for the force itself.
//!
//! A gap over a surface with the Lipschitz constant K then has a rate of at most K (V + Ω l), and where the surface is
//! a convex obstacle, or a concave one at some distance from its centre, a bound of φ̈ from below: a [`Sweep`].

use crate::carrier::Frame;
use crate::shape::Shape;
use crate::surface::Surface;
use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::events::Sweep;
use somersault_integrators::force::{ForceModel, Reach, WrenchBound};
use somersault_integrators::state::RigidBodyState;
use somersault_multibody::motion::LinkBound;

/// Bounds of the motion of a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodySweep {
    /// Where it starts, m.
    position: Vector3<f64>,
    time: f64,
    speed: f64,
    acceleration: f64,
    spin: f64,
    /// Angular acceleration, rad/s².
    turn: f64,
}

impl BodySweep {
    /// Nothing is known.
    pub(crate) const UNKNOWN: Self = Self {
        position: Vector3::new(0.0, 0.0, 0.0),
        time: f64::INFINITY,
        speed: f64::INFINITY,
        acceleration: f64::INFINITY,
        spin: f64::INFINITY,
        turn: f64::INFINITY,
    };
}

/// Bounds of the motion of the part of a shape that touches.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointSweep {
    /// Where the centre of the shape starts, m.
    pub(crate) centre: Vector3<f64>,
    pub(crate) time: f64,
    pub(crate) speed: f64,
    pub(crate) acceleration: f64,
    /// The size of the numbers that its position is computed from, m.
    pub(crate) size: f64,
}

impl PointSweep {
    /// The same in the axes of a frame that moves within a bound: no farther from its origin than at the start and by what
    /// both travel.
    pub(crate) fn seen_from(&self, frame: &Frame, bound: &LinkBound) -> Self {
        let Self { centre, time, speed, acceleration, size } = *self;
        let span = centre - frame.origin;
        let reach = span.norm() + (speed + bound.speed) * time;
        let relative = speed + bound.speed_at(reach);
        Self {
            centre: frame.rotation.tr_mul(&span),
            time,
            speed: relative,
            acceleration: acceleration + bound.acceleration_at(reach) + 2.0 * bound.spin * relative,
            size: size + frame.origin.amax(),
        }
    }

    /// The sweep of its gap over a surface.
    #[inline]
    pub(crate) fn against<S: Surface + ?Sized>(&self, shape: &Shape, surface: &S) -> Sweep {
        let Self { centre, time, speed, acceleration, size } = *self;
        let constant = surface.lipschitz();
        // The lowest point of a rim changes at once where it lies flat, as that of a capsule does along an axis.
        let fall = if shape.is_extended() {
            f64::INFINITY
        } else {
            let bend = surface.concavity(&centre, speed * time);
            let turning = if bend > 0.0 { bend * speed * speed } else { 0.0 };
            constant * acceleration + turning
        };
        Sweep { speed: constant * speed, fall, size }
    }
}

const ROOT_3: f64 = 1.732_050_807_568_877_2;

impl BodySweep {
    /// Between two states h apart, under forces that have bounds.
    fn try_proved<F: ForceModel>(
        body: &RigidBody,
        forces: &F,
        (before, after): (&RigidBodyState, &RigidBodyState),
        h: f64,
    ) -> Option<Self> {
        let speeds = before.velocity().norm_squared().max(after.velocity().norm_squared()).sqrt();
        let spins = before.angular_velocity().norm_squared().max(after.angular_velocity().norm_squared());
        // Whatever is within h of the start is within h/2 of an end.
        Self::proved(body, forces, before, (speeds, spins.sqrt()), h, 0.5 * h)
    }

    /// From a state on for a time h, under forces that have bounds.
    pub(crate) fn ahead<F: ForceModel>(
        body: &RigidBody,
        forces: &F,
        x: &RigidBodyState,
        h: f64,
    ) -> Option<Self> {
        Self::proved(body, forces, x, (x.velocity().norm(), x.angular_velocity().norm()), h, h)
    }

    /// For a time h from x on, each instant at most `lag` from one at which speed and spin are at most those given.
    fn proved<F: ForceModel>(
        body: &RigidBody,
        forces: &F,
        x: &RigidBodyState,
        (speed, spin): (f64, f64),
        h: f64,
        lag: f64,
    ) -> Option<Self> {
        let least = body.inertia().principal_moments().min();
        let under = |bound: &WrenchBound| {
            let (a, turn) = (bound.force / body.mass(), bound.torque / least);
            let (start, q) = (spin + turn * lag, lag / ROOT_3);
            let square = 1.0 - 4.0 * start * q;
            let spin = if square >= 0.0 {
                2.0 * start / (1.0 + square.sqrt())
            } else {
                // Angular momentum changes with the torque alone.
                (body.angular_momentum(x).norm() + bound.torque * h) / least
            };
            let speed = speed + a * lag;
            Self {
                position: *x.position(),
                time: h,
                speed,
                acceleration: a,
                spin,
                turn: turn + spin * spin / ROOT_3,
            }
        };
        let reach = |s: &Self| Reach {
            position: s.position,
            displacement: s.speed * h,
            speed: s.speed,
            spin: s.spin,
        };
        let mut sweep = under(&WrenchBound::default());
        let mut bound = forces.bound(body, &reach(&sweep))?;
        // A bound within which the body stays by that very bound holds.
        for _ in 0..4 {
            sweep = under(&bound);
            let next = forces.bound(body, &reach(&sweep))?;
            if next.force <= bound.force && next.torque <= bound.torque {
                return Some(sweep);
            }
            bound = WrenchBound { force: 1.1 * next.force, torque: 1.1 * next.torque };
        }
        None
    }

    /// Between two states h apart: estimated from them alone.
    fn estimated((before, after): (&RigidBodyState, &RigidBodyState), h: f64) -> Self {
        let (v0, v1) = (before.velocity(), after.velocity());
        // Accelerations at the ends of the cubic through both states.
        let secant = (after.position() - before.position()) * (6.0 / h);
        let ends = [(secant - v0 * 4.0 - v1 * 2.0) / h, (v0 * 2.0 + v1 * 4.0 - secant) / h];
        let acceleration = 2.0 * ends[0].norm().max(ends[1].norm());
        let (w0, w1) = (before.angular_velocity(), after.angular_velocity());
        let turn = 2.0 * (w1 - w0).norm() / h;
        Self {
            position: *before.position(),
            time: h,
            speed: v0.norm().max(v1.norm()) + 0.5 * h * acceleration,
            acceleration,
            spin: w0.norm().max(w1.norm()) + 0.5 * h * turn,
            turn,
        }
    }

    /// Between two states h apart; `is_free` says that only the forces act.
    pub(crate) fn between<F: ForceModel>(
        body: &RigidBody,
        forces: &F,
        ends: (&RigidBodyState, &RigidBodyState),
        h: f64,
        is_free: bool,
    ) -> Self {
        let proved = if is_free { Self::try_proved(body, forces, ends, h) } else { None };
        proved.unwrap_or_else(|| Self::estimated(ends, h))
    }

    /// Speed of a point at some distance from the centre of mass.
    pub(crate) fn point_speed(&self, lever: f64) -> f64 {
        self.speed + self.spin * lever
    }

    /// Acceleration of a point at some distance from the centre of mass.
    pub(crate) fn point_acceleration(&self, lever: f64) -> f64 {
        self.acceleration + (self.turn + self.spin * self.spin) * lever
    }

    /// The sweep of the gap between a part of the body and a surface.
    #[inline]
    pub(crate) fn against<S: Surface + ?Sized>(
        &self,
        shape: &Shape,
        surface: &S,
        x: &RigidBodyState,
    ) -> Sweep {
        let lever = shape.reach();
        let point = PointSweep {
            centre: x.position() + x.orientation() * shape.centre(),
            time: self.time,
            speed: self.point_speed(lever),
            acceleration: self.point_acceleration(lever),
            size: self.position.amax() + lever,
        };
        point.against(shape, surface)
    }

    /// The sweep of the gap between two shapes on two bodies.
    pub(crate) fn of_pair(sweeps: [&Self; 2], shapes: [&Shape; 2]) -> Sweep {
        let ([a, b], levers) = (sweeps, shapes.map(Shape::reach));
        let is_extended = shapes.iter().any(|shape| shape.is_extended());
        Sweep {
            speed: a.point_speed(levers[0]) + b.point_speed(levers[1]),
            fall: if is_extended {
                f64::INFINITY
            } else {
                a.point_acceleration(levers[0]) + b.point_acceleration(levers[1])
            },
            size: a.position.amax() + b.position.amax() + levers[0] + levers[1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use somersault_integrators::force::{Drag, Gravity, Spring, Wrench};
    use somersault_integrators::system::euler;

    fn some(k: i32, axis: usize) -> f64 {
        f64::sin(f64::from(37 * k) + 5.0 * axis as f64)
    }

    #[test]
    fn a_free_body_turns_no_faster_than_the_bound() {
        for k in 0..2000 {
            let raw = Vector3::from_fn(|axis, _| 0.02 + some(k, axis).abs());
            let lengths = raw.component_mul(&Vector3::new(1.0, 0.3, 0.05));
            let body = RigidBody::try_box(1.0, lengths).unwrap();
            let omega = Vector3::from_fn(|axis, _| 20.0 * some(k + 7, axis));
            let change = euler(&body, &omega, &Vector3::zeros()).norm();
            assert!(change <= omega.norm_squared() / ROOT_3 * (1.0 + 1e-12), "{k}: {change}");
        }
    }

    #[test]
    fn bounds_of_forces_hold_within_reach() {
        let body = RigidBody::try_box(1.3, Vector3::new(0.2, 0.3, 0.1)).unwrap();
        let spring = Spring {
            anchor: Vector3::new(0.3, 0.1, 0.0),
            attachment: Vector3::new(0.1, 0.0, 0.05),
            stiffness: 40.0,
            damping: 3.0,
            rest_length: 0.2,
        };
        let forces = (Gravity::earth(), (spring, Drag { linear: 0.3, quadratic: 0.2, angular: 0.1 }));
        for k in 0..500 {
            let vector = |j: i32| Vector3::from_fn(|axis, _| some(10 * k + j, axis));
            let x =
                RigidBodyState::new(vector(0), UnitQuaternion::new(vector(1)), vector(2), vector(3) * 4.0);
            let reach = Reach {
                position: x.position() + vector(4).normalize() * 0.5,
                displacement: 0.5,
                speed: x.velocity().norm(),
                spin: x.angular_velocity().norm(),
            };
            let (bound, found) = (forces.bound(&body, &reach).unwrap(), forces.wrench(0.0, &body, &x));
            assert!(found.force.norm() <= bound.force && found.torque.norm() <= bound.torque, "{k}");
        }
    }

    #[test]
    fn a_force_without_a_bound_is_estimated() {
        let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
        let pull = |_: f64, _: &RigidBody, _: &RigidBodyState| Wrench::default();
        let (x, mut y) = (RigidBodyState::default(), RigidBodyState::default());
        (y.rate.linear.z, y.configuration.position.z) = (-1.0, -0.05);
        let found = BodySweep::between(&body, &pull, (&x, &y), 0.1, true);
        assert!((found.acceleration - 20.0).abs() < 1e-12, "{found:?}");
        let found = BodySweep::between(&body, &Gravity::earth(), (&x, &y), 0.1, true);
        assert!((found.acceleration - 9.81).abs() < 1e-12, "{found:?}");
    }
}
