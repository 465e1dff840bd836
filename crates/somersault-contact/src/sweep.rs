//! How far what a guard watches may move during a step, and what that proves.
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
//! With φ the gap of a surface with the Lipschitz constant K, two criteria say that it stays positive:
//!
//! - by speed: φ₀ + φ₁ > K (V + Ω l) h, whatever the surface;
//! - by acceleration, where φ̈ ≥ −a is known (a convex obstacle; or a concave one at some distance from its
//!   centre): φ + a s²/2 is convex and so above its tangents at both ends, which meet at s*; clear where
//!   φ₀ + φ̇₀ s* − a s*²/2 > 0, whatever the speed.

use crate::hybrid::Guard;
use crate::shape::Shape;
use crate::step_curve::{StepCurve, is_clear};
use crate::surface::Surface;
use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::{ForceModel, Reach, WrenchBound};
use somersault_integrators::state::RigidBodyState;

/// Bounds of the motion of a guard's gap during a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// |φ̇| is at most this, m/s.
    pub speed: f64,
    /// φ̈ is at least minus this, m/s²; infinite where no such bound is known.
    pub fall: f64,
    /// The size of the numbers that the gap is computed from, m: it is known to a few roundings of this.
    pub size: f64,
}

impl Sweep {
    /// Nothing is known: the inside of a step is judged by the cubic through its ends.
    pub const UNKNOWN: Self = Self { speed: f64::INFINITY, fall: f64::INFINITY, size: 0.0 };
}

/// What the two ends of a step tell about a guard between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Verdict {
    /// It keeps its sign up to the end.
    Clear,
    /// It is not known to: to be looked at after this part of the step.
    Split(f64),
    /// The cubic through the ends has it otherwise: to be looked at after this part of the step.
    Suspect(f64),
}

impl Verdict {
    /// Whether a guard keeps its sign over a step of h, or changes it at the very end of the step.
    ///
    /// `graze` is the depth (m) below which the criterion by speed lets a hit pass.
    pub(crate) fn of(before: &Guard, after: &Guard, h: f64, sweep: &Sweep, graze: f64) -> Self {
        if before.is_inside() || sweep.speed.is_infinite() {
            by_cubic(before, after, h)
        } else if before.gap < 0.0 {
            below_surface(before, after, h, sweep)
        } else {
            outside(before, after, h, sweep, graze)
        }
    }
}

/// By the cubic through gap and rate at both ends.
fn by_cubic(before: &Guard, after: &Guard, h: f64) -> Verdict {
    if is_clear(before, after, h) {
        return Verdict::Clear;
    }
    let side = if before.is_inside() { -1.0 } else { 1.0 };
    let Some((theta, least)) = StepCurve::new(before, after, h).least(side) else {
        return Verdict::Clear;
    };
    // How much nearer to zero than both ends; a dip shallower than what is left of it is believed.
    let depth = (side * before.margin()).min(side * after.margin()) - least;
    if least >= 0.0 && least >= depth { Verdict::Clear } else { Verdict::Suspect(theta.clamp(0.1, 0.9)) }
}

/// Of a gap that is not negative before the step, and at its end not or only just.
fn outside(before: &Guard, after: &Guard, h: f64, sweep: &Sweep, graze: f64) -> Verdict {
    if after.gap < 0.0 && !after.is_inside() {
        // It went in and is on its way out.
        return Verdict::Split(0.5);
    }
    let (first, last) = (before.gap, after.gap.max(0.0));
    if first + last > sweep.speed * h {
        return Verdict::Clear;
    }
    if sweep.fall.is_finite() {
        let (s, least) = Tangents::new(before, after, h, sweep.fall).meet(0.0);
        if least >= -rounding(before, after, h, sweep) {
            return Verdict::Clear;
        }
        return Verdict::Split((s / h).clamp(0.02, 0.98));
    }
    if first + last >= sweep.speed * h - 2.0 * graze {
        return Verdict::Clear;
    }
    // Between what is clear from either end.
    let reached = 0.5 * (h + (first - last) / sweep.speed);
    Verdict::Split((reached / h).clamp(0.02, 0.98))
}

/// Of a point that was released below the surface and is on its way out: its margin φ + τ φ̇ is positive until
/// its gap is.
fn below_surface(before: &Guard, after: &Guard, h: f64, sweep: &Sweep) -> Verdict {
    let a = sweep.fall;
    let square = before.rate * before.rate + 2.0 * a * before.gap;
    if a.is_finite() && square >= 0.0 {
        // When φ₀ + φ̇₀ s − a s²/2 is zero; its margin is concave in s and positive at both ends of that time.
        let up = -2.0 * before.gap / (before.rate + square.sqrt());
        if up < h && after.gap >= 0.0 {
            let (_, least) = Tangents::new(before, after, h, a).meet(up);
            if least >= -rounding(before, after, h, sweep) {
                return Verdict::Clear;
            }
        } else if up >= h && before.margin() + h * (before.rate - a * (before.lag + 0.5 * h)) >= 0.0 {
            return Verdict::Clear;
        }
    }
    // The force may come back. The lag is the time in which it does: within that the cubic is good.
    if h <= before.lag { by_cubic(before, after, h) } else { Verdict::Split(0.5) }
}

/// A few roundings of the gap, m.
fn rounding(before: &Guard, after: &Guard, h: f64, sweep: &Sweep) -> f64 {
    let size = sweep.size + before.gap.abs() + after.gap.abs() + h * (before.rate.abs() + after.rate.abs());
    16.0 * f64::EPSILON * size
}

/// Tangents of the convex φ + a s²/2 at both ends of a step.
struct Tangents {
    a: f64,
    h: f64,
    first: f64,
    slopes: [f64; 2],
    /// Value at the start of the one at the end.
    last: f64,
}

impl Tangents {
    fn new(before: &Guard, after: &Guard, h: f64, a: f64) -> Self {
        let (first, end) = (before.gap, after.gap.max(0.0) + 0.5 * a * h * h);
        let chord = (end - first) / h;
        // A method that is off by more than the step allows has tangents above the chord: then the chord counts.
        let slopes = [before.rate.min(chord), (after.rate + a * h).max(chord)];
        Self { a, h, first, slopes, last: end - slopes[1] * h }
    }

    /// Where they meet, no earlier than `from`, and the bound of φ there.
    fn meet(&self, from: f64) -> (f64, f64) {
        let [m0, m1] = self.slopes;
        let crossing = (self.first - self.last) / (m1 - m0);
        let s = if crossing.is_finite() { crossing } else { 0.5 * self.h }.clamp(from, self.h);
        let tangent = (self.first + m0 * s).max(self.last + m1 * s);
        (s, tangent - 0.5 * self.a * s * s)
    }
}

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

    /// Between two states h apart; `is_free` says that nothing but the forces acts.
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
        let (lever, is_rim) = match shape {
            Shape::Point(point) => (point.norm(), false),
            Shape::Ball { centre, .. } => (centre.norm(), false),
            Shape::Rim { centre, radius, .. } => (centre.norm() + radius, true),
        };
        let speed = self.point_speed(lever);
        let constant = surface.lipschitz();
        // The lowest point of a rim changes at once where it lies flat.
        let fall = if is_rim {
            f64::INFINITY
        } else {
            let centre = x.position() + x.orientation() * shape.centre();
            let bend = surface.concavity(&centre, speed * self.time);
            let turning = if bend > 0.0 { bend * speed * speed } else { 0.0 };
            constant * self.point_acceleration(lever) + turning
        };
        Sweep { speed: constant * speed, fall, size: self.position.amax() + lever }
    }

    /// The sweep of the gap between two spheres on two bodies, their centres at some distances from those of mass.
    pub(crate) fn between_spheres(sweeps: [&Self; 2], levers: [f64; 2]) -> Sweep {
        let [a, b] = sweeps;
        Sweep {
            speed: a.point_speed(levers[0]) + b.point_speed(levers[1]),
            fall: a.point_acceleration(levers[0]) + b.point_acceleration(levers[1]),
            size: a.position.amax() + b.position.amax() + levers[0] + levers[1],
        }
    }
}

impl Sweep {
    /// The time for which a gap stays positive under this bound, from a state in which |φ̇| ≤ `speed` already
    /// bounds it for all of that time.
    pub(crate) fn clear_time(&self, gap: f64) -> f64 {
        if gap > 0.0 { gap / self.speed } else { 0.0 }
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
    fn what_is_said_to_be_clear_is() {
        // Gaps whose second derivative lies between −a and some other bound, by cubics with random ends.
        let (h, a) = (0.3, 4.0);
        let mut clear = [0; 2];
        for k in 0..200_000 {
            let (g, r, bend, jerk) =
                (some(k, 0).abs(), 3.0 * some(k, 1), 20.0 * some(k, 2), 100.0 * some(k, 3));
            let at = |s: f64| {
                let gap = g + s * (r + s * (0.5 * bend + s / 6.0 * jerk));
                Guard { gap, rate: r + s * (bend + 0.5 * s * jerk), lag: 0.0 }
            };
            if bend.min(bend + h * jerk) < -a || at(h).gap < 0.0 {
                continue;
            }
            let slopes = [0.0, h, (-bend / jerk).clamp(0.0, h)].map(|s| at(s).rate.abs());
            let speed = slopes.into_iter().fold(0.0, f64::max);
            let least = (0..=300).map(|i| at(h * f64::from(i) / 300.0).gap).fold(f64::INFINITY, f64::min);
            for (i, fall) in [a, f64::INFINITY].into_iter().enumerate() {
                let sweep = Sweep { speed, fall, size: 1.0 };
                if Verdict::of(&at(0.0), &at(h), h, &sweep, 0.0) == Verdict::Clear {
                    clear[i] += 1;
                    assert!(least >= -1e-14, "{k} {i}: {least}");
                }
            }
        }
        assert!(clear[0] > 5_000 && clear[1] > 2_000, "{clear:?}");
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
