//! Derivatives of the laws of a contact: of force and couple in a mode, of the margins that end it, and of
//! what it remembers.

use crate::friction::{Friction, Resistance};
use crate::interface::{ContactLaw, ContactMode, Encounter};
use crate::normal::NormalLaw;
use nalgebra::Vector3;
use somersault_integrators::force::Wrench;

/// Change of the constants of a law.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LawChange {
    /// Of the stiffness along the normal.
    pub(super) stiffness: f64,
    /// Of the damping along the normal.
    pub(super) damping: f64,
    /// Of the coefficient of friction.
    pub(super) friction: f64,
}

/// Change of everything a law looks at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Changes<'a> {
    /// Of the encounter.
    pub(super) at: &'a Encounter,
    /// Of the constants.
    pub(super) law: LawChange,
    /// Of what the mode remembers: the anchor of sticking, the direction of sliding.
    pub(super) memory: Vector3<f64>,
    /// Time before a stop, times the acceleration that a unit of force at the contact may give, s/kg: nearer
    /// to the stop the direction of sliding changes no faster.
    pub(super) settling: f64,
}

impl NormalLaw {
    /// Derivative of the force in contact.
    #[inline]
    fn force_change(&self, at: &Encounter, by: &Changes<'_>) -> f64 {
        let (gap, rate) = (by.at.gap, by.at.rate);
        match self {
            Self::Compliant(law) => {
                -law.stiffness() * gap
                    - law.damping() * rate
                    - by.law.stiffness * at.gap
                    - by.law.damping * at.rate
            }
            Self::HuntCrossley(law) => {
                let x = (-at.gap).max(0.0);
                let (root, hertz) = (x.sqrt(), x * x.sqrt());
                let damper = 1.0 - 1.5 * law.damping() * at.rate;
                (by.law.stiffness * hertz - 1.5 * law.stiffness() * root * gap) * damper
                    - 1.5 * law.stiffness() * hertz * (by.law.damping * at.rate + law.damping() * rate)
            }
        }
    }

    /// Derivative of the margin of the guard, Δx + τ max(Δẋ, 0).
    fn margin_change(&self, at: &Encounter, by: &Changes<'_>) -> f64 {
        if at.rate <= 0.0 {
            return by.at.gap;
        }
        let (lag, lag_change) = match self {
            Self::Compliant(law) => {
                let lag = law.damping() / law.stiffness();
                (lag, (by.law.damping - lag * by.law.stiffness) / law.stiffness())
            }
            // τ = −3/2 α Δx inside.
            Self::HuntCrossley(law) => {
                (-1.5 * law.damping() * at.gap, -1.5 * (by.law.damping * at.gap + law.damping() * by.at.gap))
            }
        };
        by.at.gap + lag * by.at.rate + lag_change * at.rate
    }

    /// Whether the force jumps where the gap closes.
    pub(super) fn jumps(&self) -> bool {
        matches!(self, Self::Compliant(law) if law.damping() != 0.0)
    }
}

/// Derivative of v/‖v‖, of a speed no lower than `slowest`; zero at rest.
#[inline]
fn direction_change(v: &Vector3<f64>, change: &Vector3<f64>, slowest: f64) -> Vector3<f64> {
    let speed = v.norm();
    if speed > 0.0 {
        let along = v / speed;
        (change - along * along.dot(change)) / speed.max(slowest)
    } else {
        Vector3::zeros()
    }
}

/// v/√(v² + w²) and its derivative.
#[inline]
fn saturated(v: &Vector3<f64>, change: &Vector3<f64>, w: f64) -> (Vector3<f64>, Vector3<f64>) {
    let scale = (v.norm_squared() + w * w).sqrt();
    let value = v / scale;
    (value, (change - value * value.dot(change)) / scale)
}

/// The way from the anchor to the point of contact within the surface, and its derivative.
#[inline]
fn stretch(at: &Encounter, anchor: &Vector3<f64>, by: &Changes<'_>) -> (Vector3<f64>, Vector3<f64>) {
    let (way, change) = (at.point - anchor, by.at.point - by.memory);
    let (normal, normal_change) = (&at.normal, &by.at.normal);
    let off = normal.dot(&way);
    let off_change = normal_change.dot(&way) + normal.dot(&change);
    (way - normal * off, change - normal_change * off - normal * off_change)
}

/// The force of friction under the normal force `push`, and its derivative.
#[inline]
fn friction(
    law: &Friction,
    mode: &ContactMode,
    at: &Encounter,
    by: &Changes<'_>,
    (push, push_change): (f64, f64),
) -> (Vector3<f64>, Vector3<f64>) {
    let (sliding, change) = (&at.sliding, &by.at.sliding);
    let bound = |coefficient: f64| (coefficient * push, by.law.friction * push + coefficient * push_change);
    match (law, mode) {
        (Friction::Regularised(law), _) => {
            let (bound, bound_change) = bound(law.coefficient());
            let (along, along_change) = saturated(sliding, change, law.speed());
            (along * -bound, along * -bound_change - along_change * bound)
        }
        (Friction::Coulomb(law), ContactMode::Stick { anchor }) => {
            let (way, way_change) = stretch(at, anchor, by);
            let change = way_change * -law.stiffness() - change * law.damping();
            (law.sticking(&way, sliding), change)
        }
        (Friction::Coulomb(law), ContactMode::Slip { direction }) => {
            let (bound, bound_change) = bound(law.coefficient());
            let sign = 1f64.copysign(sliding.dot(direction));
            let along = sliding.try_normalize(0.0).map_or(*direction, |along| along * sign);
            let turn = direction_change(sliding, change, bound * by.settling);
            (along * -bound, along * -bound_change - turn * (sign * bound))
        }
        (Friction::Creep(law), ContactMode::Creep) => (law.creeping(sliding), law.creeping(change)),
        (Friction::Creep(law), ContactMode::Slide) => {
            let (bound, bound_change) = bound(law.coefficient());
            let along = sliding.try_normalize(0.0).unwrap_or_default();
            (along * -bound, along * -bound_change - direction_change(sliding, change, 0.0) * bound)
        }
        _ => Default::default(),
    }
}

impl Resistance {
    /// Derivative of the couple under the normal force `push`.
    #[inline]
    fn couple_change(
        &self,
        at: &Encounter,
        by: &Changes<'_>,
        (push, push_change): (f64, f64),
    ) -> Vector3<f64> {
        let (normal, normal_change) = (&at.normal, &by.at.normal);
        let about = normal.dot(&at.turning);
        let about_change = normal_change.dot(&at.turning) + normal.dot(&by.at.turning);
        let (spin, spin_change) = (normal * about, normal_change * about + normal * about_change);
        let (rolling, rolling_change) =
            saturated(&(at.turning - spin), &(by.at.turning - spin_change), self.speed());
        let (spinning, spinning_change) = saturated(&spin, &spin_change, self.speed());
        (rolling * self.rolling() + spinning * self.spinning()) * -push_change
            - (rolling_change * self.rolling() + spinning_change * self.spinning()) * push
    }
}

impl ContactLaw {
    /// Derivative of force and couple in a mode.
    #[inline]
    pub(super) fn effort_change(&self, mode: &ContactMode, at: &Encounter, by: &Changes<'_>) -> Wrench {
        let push = self.push(at, by);
        let (_, friction_change) = friction(&self.friction, mode, at, by, push);
        let torque = if self.resistance.is_none() {
            Vector3::zeros()
        } else {
            self.resistance.couple_change(at, by, push)
        };
        Wrench { force: at.normal * push.1 + by.at.normal * push.0 + friction_change, torque }
    }

    /// Derivative of the margin that ends a mode for another: that of the contact itself where it begins or
    /// ends, else that of friction.
    pub(super) fn margin_change(
        &self,
        modes: (&ContactMode, &ContactMode),
        at: &Encounter,
        by: &Changes<'_>,
    ) -> f64 {
        let (before, after) = modes;
        if is_open(before) || is_open(after) {
            return self.normal.margin_change(at, by);
        }
        let push = self.push(at, by);
        let cone =
            |coefficient: f64| 2.0 * coefficient * push.0 * (by.law.friction * push.0 + coefficient * push.1);
        match (&self.friction, before) {
            (Friction::Coulomb(_), ContactMode::Slip { direction }) if at.sliding == Vector3::zeros() => {
                by.at.sliding.dot(direction)
            }
            (Friction::Coulomb(_), ContactMode::Slip { direction }) => {
                let along = at.sliding.normalize();
                by.at.sliding.dot(&(direction - 0.5 * along)) + at.sliding.dot(&by.memory)
            }
            (Friction::Coulomb(law), _) => {
                let (force, change) = friction(&self.friction, before, at, by, push);
                cone(law.coefficient()) - 2.0 * force.dot(&change)
            }
            (Friction::Creep(law), _) => {
                cone(law.coefficient()) - 2.0 * law.damping().powi(2) * at.sliding.dot(&by.at.sliding)
            }
            _ => 0.0,
        }
    }

    /// Derivative of what a mode remembers of the encounter it begins with.
    pub(super) fn memory_change(mode: &ContactMode, at: &Encounter, change: &Encounter) -> Vector3<f64> {
        match mode {
            ContactMode::Stick { .. } => change.point,
            ContactMode::Slip { .. } => direction_change(&at.sliding, &change.sliding, 0.0),
            _ => Vector3::zeros(),
        }
    }

    /// The jump of force and couple from one mode to the next, each by its limit at the event.
    pub(super) fn jump(&self, (before, after): (&ContactMode, &ContactMode), at: &Encounter) -> Wrench {
        match (before, after) {
            // Without push there is no friction either.
            (_, ContactMode::Open) => Wrench::default(),
            (ContactMode::Open, _) if at.rate > 0.0 => Wrench::default(),
            (ContactMode::Open, _) => self.effort_in(after, &Encounter { gap: 0.0, ..*at }),
            (ContactMode::Slip { .. }, ContactMode::Slip { .. }) => Wrench::default(),
            _ => self.effort_in(after, at) - self.effort_in(before, at),
        }
    }

    /// Whether an event is a stop: what is left of the velocity of sliding is then rounding, a millionth of
    /// what is lost over the settling time or against the direction of sliding.
    pub(super) fn stops(&self, modes: (&ContactMode, &ContactMode), at: &Encounter, settling: f64) -> bool {
        let (Friction::Coulomb(law), (ContactMode::Slip { direction }, ContactMode::Stick { .. })) =
            (&self.friction, modes)
        else {
            return false;
        };
        let lost = law.coefficient() * self.normal.force_in_contact(at.gap, at.rate) * settling;
        at.sliding.dot(direction) <= 0.0 || at.sliding.norm() <= 1e-6 * lost
    }

    /// The normal force and its derivative.
    #[inline]
    fn push(&self, at: &Encounter, by: &Changes<'_>) -> (f64, f64) {
        (self.normal.force_in_contact(at.gap, at.rate), self.normal.force_change(at, by))
    }
}

pub(super) fn is_open(mode: &ContactMode) -> bool {
    matches!(mode, ContactMode::Open)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::{CoulombFriction, CreepFriction, RegularisedFriction};
    use crate::hunt_crossley::HuntCrossley;
    use crate::law::CompliantLaw;

    const PUSHED: Encounter = Encounter {
        gap: -0.02,
        rate: 0.3,
        normal: Vector3::new(0.6, 0.0, 0.8),
        point: Vector3::new(0.4, -0.1, 0.2),
        sliding: Vector3::new(0.4, -0.5, -0.3),
        turning: Vector3::new(-0.7, 1.1, 0.4),
        mass: 1.0,
    };
    const CHANGE: Encounter = Encounter {
        gap: 0.3,
        rate: -0.8,
        normal: Vector3::new(0.4, 0.5, -0.3),
        point: Vector3::new(0.2, 0.7, -0.6),
        sliding: Vector3::new(-0.3, 0.2, 0.9),
        turning: Vector3::new(0.5, -0.4, 0.3),
        mass: 0.0,
    };
    const CONSTANTS: LawChange = LawChange { stiffness: 30.0, damping: 0.4, friction: 0.2 };
    const ANCHOR: Vector3<f64> = Vector3::new(0.3, 0.05, 0.25);
    const MEMORY: Vector3<f64> = Vector3::new(-0.3, 0.6, 0.2);

    fn encounter(epsilon: f64) -> Encounter {
        Encounter {
            gap: PUSHED.gap + epsilon * CHANGE.gap,
            rate: PUSHED.rate + epsilon * CHANGE.rate,
            normal: PUSHED.normal + epsilon * CHANGE.normal,
            point: PUSHED.point + epsilon * CHANGE.point,
            sliding: PUSHED.sliding + epsilon * CHANGE.sliding,
            turning: PUSHED.turning + epsilon * CHANGE.turning,
            mass: 1.0,
        }
    }

    /// Each law with a mode it may be in and another that may follow, all with ε in their constants.
    fn cases(epsilon: f64) -> Vec<(ContactLaw, ContactMode, ContactMode)> {
        use ContactMode::{Closed, Creep, Open, Slide, Slip, Stick};
        let (stiffness, damping) = (200.0 + epsilon * CONSTANTS.stiffness, 3.0 + epsilon * CONSTANTS.damping);
        let coefficient = 0.3 + epsilon * CONSTANTS.friction;
        let compliant = ContactLaw::from(CompliantLaw::try_new(stiffness, damping).unwrap());
        let hertz = ContactLaw::from(HuntCrossley::try_new(stiffness, damping - 2.7).unwrap());
        let coulomb = CoulombFriction::try_new(coefficient, 50.0, 2.0).unwrap();
        let creep = CreepFriction::try_new(coefficient, 4.0).unwrap();
        let regularised = RegularisedFriction::try_new(coefficient, 0.1).unwrap();
        let resistance = Resistance::try_new(0.02, 0.03, 0.5).unwrap();
        let stick = Stick { anchor: ANCHOR + epsilon * MEMORY };
        let slip = Slip { direction: ANCHOR + epsilon * MEMORY };
        vec![
            (compliant, Closed, Open),
            (compliant.with_friction(regularised).with_resistance(resistance), Closed, Open),
            (compliant.with_friction(coulomb), stick, slip),
            (compliant.with_friction(coulomb), slip, stick),
            (compliant.with_friction(creep), Creep, Slide),
            (hertz.with_friction(creep), Slide, Creep),
            (hertz.with_friction(coulomb), slip, Open),
        ]
    }

    #[test]
    fn derivatives_of_efforts_and_margins_are_their_differences() {
        let by = Changes { at: &CHANGE, law: CONSTANTS, memory: MEMORY, settling: 0.0 };
        for (i, (law, before, after)) in cases(0.0).iter().enumerate() {
            let step = 1e-5;
            let ends = [step, -step].map(|epsilon| (cases(epsilon).remove(i), encounter(epsilon)));
            let [a, b] = ends.each_ref().map(|((law, mode, _), at)| law.effort_in(mode, at));
            let (difference, found) = ((a - b) * (0.5 / step), law.effort_change(before, &PUSHED, &by));
            let error = found - difference;
            assert!(error.force.norm() + error.torque.norm() < 1e-7, "{i}: {found:?} {difference:?}");
            assert!(found.force.norm() > 1.0, "{i}");
            let [a, b] = ends.map(|((law, mode, _), at)| match after {
                ContactMode::Open => law.guard(&at).margin(),
                _ => law.friction_guard(&mode, &at).gap,
            });
            let (difference, found) =
                ((a - b) * (0.5 / step), law.margin_change((before, after), &PUSHED, &by));
            assert!((found - difference).abs() < 1e-7 * (1.0 + found.abs()), "{i}: {found} {difference}");
        }
    }
}
