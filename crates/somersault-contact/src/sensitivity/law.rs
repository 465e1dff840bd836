//! Derivatives of the laws of a contact: of force, couple and rate of stretch in a mode, and of the margins that
//! end it.

use crate::friction::{CoulombFriction, Friction, Resistance, Rubbing};
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
    /// Of the coefficient of friction, in whose proportion the static one changes.
    pub(super) friction: f64,
}

/// Change of everything a law looks at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Changes<'a> {
    /// Of the encounter.
    pub(super) at: &'a Encounter,
    /// Of the constants.
    pub(super) law: LawChange,
    /// Of the stretch.
    pub(super) stretch: &'a Vector3<f64>,
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

/// Derivative of v/‖v‖; zero at zero.
#[inline]
fn direction_change(v: &Vector3<f64>, change: &Vector3<f64>) -> Vector3<f64> {
    let length = v.norm();
    if length > 0.0 {
        let along = v / length;
        (change - along * along.dot(change)) / length
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

impl CoulombFriction {
    /// Derivative of p in stick and of μ N p/‖p‖ in slip.
    fn held_change(&self, of: Rubbing<'_>, push_change: f64, by: &Changes<'_>) -> Vector3<f64> {
        let change = self.hold(by.stretch, &by.at.sliding);
        if !of.slips {
            return change;
        }
        let hold = self.hold(of.stretch, &of.at.sliding);
        let bound_change = by.law.friction * of.push + self.coefficient() * push_change;
        hold.try_normalize(0.0).unwrap_or_default() * bound_change
            + direction_change(&hold, &change) * (self.coefficient() * of.push)
    }

    /// Derivative of the coefficient at which stick, or slip, ends.
    fn bound_change(&self, slips: bool, change: f64) -> f64 {
        if slips || self.static_coefficient() == self.coefficient() {
            change
        } else {
            change * self.static_coefficient() / self.coefficient()
        }
    }
}

impl Friction {
    /// Derivative of the force, under a normal force that changes by `push_change`.
    #[inline]
    fn force_change(&self, of: Rubbing<'_>, push_change: f64, by: &Changes<'_>) -> Vector3<f64> {
        match self {
            Self::None => Vector3::zeros(),
            Self::Regularised(law) => {
                let (along, along_change) = saturated(&of.at.sliding, &by.at.sliding, law.speed());
                let bound_change = by.law.friction * of.push + law.coefficient() * push_change;
                along * -bound_change - along_change * (law.coefficient() * of.push)
            }
            Self::Coulomb(law) => -law.held_change(of, push_change, by),
        }
    }

    /// Derivative of ξ̇ without the turning of the plane of contact.
    #[inline]
    fn stretch_rate_change(&self, of: Rubbing<'_>, push_change: f64, by: &Changes<'_>) -> Vector3<f64> {
        match self {
            Self::Coulomb(law) if law.stiffness() > 0.0 => {
                if of.slips {
                    (law.held_change(of, push_change, by) - by.stretch * law.stiffness()) / law.damping()
                } else {
                    by.at.sliding
                }
            }
            Self::None | Self::Regularised(_) | Self::Coulomb(_) => Vector3::zeros(),
        }
    }

    /// Derivative of the margin.
    fn margin_change(&self, of: Rubbing<'_>, push_change: f64, by: &Changes<'_>) -> f64 {
        match self {
            Self::None | Self::Regularised(_) => 0.0,
            Self::Coulomb(law) => {
                let coefficient = law.bound(of.slips);
                let bound_change =
                    law.bound_change(of.slips, by.law.friction) * of.push + coefficient * push_change;
                let (hold, change) =
                    (law.hold(of.stretch, &of.at.sliding), law.hold(by.stretch, &by.at.sliding));
                2.0 * (coefficient * of.push).abs() * bound_change - 2.0 * hold.dot(&change)
            }
        }
    }

    /// Whether the force jumps as stick ends.
    fn breaks_away(&self) -> bool {
        match self {
            Self::None | Self::Regularised(_) => false,
            Self::Coulomb(law) => law.static_coefficient() > law.coefficient(),
        }
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
    pub(super) fn effort_change(
        &self,
        mode: &ContactMode,
        at: &Encounter,
        stretch: &Vector3<f64>,
        by: &Changes<'_>,
    ) -> Wrench {
        let Some(of) = self.rubbing_in(mode, at, stretch) else { return Wrench::default() };
        let push_change = self.normal.force_change(at, by);
        let friction_change = self.friction.force_change(of, push_change, by);
        let torque = if self.resistance.is_none() {
            Vector3::zeros()
        } else {
            self.resistance.couple_change(at, by, (of.push, push_change))
        };
        Wrench { force: at.normal * push_change + by.at.normal * of.push + friction_change, torque }
    }

    /// Derivative of ξ̇ in a mode.
    #[inline]
    pub(super) fn stretch_rate_change(
        &self,
        mode: &ContactMode,
        at: &Encounter,
        stretch: &Vector3<f64>,
        by: &Changes<'_>,
    ) -> Vector3<f64> {
        let Some(of) = self.rubbing_in(mode, at, stretch) else { return Vector3::zeros() };
        let push_change = self.normal.force_change(at, by);
        self.friction.stretch_rate_change(of, push_change, by)
            + by.at.tilting.cross(stretch)
            + at.tilting.cross(by.stretch)
    }

    /// Derivative of the margin that ends a mode for another: that of the contact itself where it begins or
    /// ends, else that of friction.
    pub(super) fn margin_change(
        &self,
        (before, after): (&ContactMode, &ContactMode),
        at: &Encounter,
        stretch: &Vector3<f64>,
        by: &Changes<'_>,
    ) -> f64 {
        match self.rubbing_in(before, at, stretch) {
            Some(of) if !is_open(after) => {
                self.friction.margin_change(of, self.normal.force_change(at, by), by)
            }
            Some(_) | None => self.normal.margin_change(at, by),
        }
    }

    /// The jumps of effort and of ξ̇ from one mode to the next, each by its limit at the event; before a contact
    /// begins and after it has ended ξ̇ is zero.
    pub(super) fn jump(
        &self,
        (before, after): (&ContactMode, &ContactMode),
        at: &Encounter,
        stretch: &Vector3<f64>,
    ) -> (Wrench, Vector3<f64>) {
        let none = (Wrench::default(), Vector3::zeros());
        match (before, after) {
            (ContactMode::Open, ContactMode::Open)
            | (ContactMode::Closed, ContactMode::Closed)
            | (ContactMode::Slip, ContactMode::Slip | ContactMode::Closed)
            // Without push there is no friction either.
            | (ContactMode::Closed | ContactMode::Slip, ContactMode::Open) => none,
            (ContactMode::Open, ContactMode::Closed | ContactMode::Slip) => {
                // At the surface itself, or where the push returns from zero.
                let begins = Encounter { gap: if at.rate > 0.0 { at.gap } else { 0.0 }, ..*at };
                let zero = Vector3::zeros();
                let effort =
                    if at.rate > 0.0 { Wrench::default() } else { self.effort_in(after, &begins, &zero) };
                (effort, self.stretch_rate_in(after, &begins, &zero))
            }
            (ContactMode::Closed, ContactMode::Slip) if self.friction.breaks_away() => (
                self.effort_in(after, at, stretch) - self.effort_in(before, at, stretch),
                self.stretch_rate_in(after, at, stretch) - self.stretch_rate_in(before, at, stretch),
            ),
            (ContactMode::Closed, ContactMode::Slip) => none,
        }
    }

    /// What friction depends on in a mode, unless the contact is open.
    #[inline]
    fn rubbing_in<'a>(
        &self,
        mode: &ContactMode,
        at: &'a Encounter,
        stretch: &'a Vector3<f64>,
    ) -> Option<Rubbing<'a>> {
        match mode {
            ContactMode::Open => None,
            ContactMode::Closed => Some(self.rubbing(false, at, stretch)),
            ContactMode::Slip => Some(self.rubbing(true, at, stretch)),
        }
    }
}

pub(super) fn is_open(mode: &ContactMode) -> bool {
    matches!(mode, ContactMode::Open)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::RegularisedFriction;
    use crate::hunt_crossley::HuntCrossley;
    use crate::law::CompliantLaw;

    const PUSHED: Encounter = Encounter {
        gap: -0.02,
        rate: 0.3,
        normal: Vector3::new(0.6, 0.0, 0.8),
        point: Vector3::new(0.4, -0.1, 0.2),
        sliding: Vector3::new(0.4, -0.5, -0.3),
        turning: Vector3::new(-0.7, 1.1, 0.4),
        tilting: Vector3::new(0.3, -0.6, 0.8),
        mass: 1.0,
    };
    const CHANGE: Encounter = Encounter {
        gap: 0.3,
        rate: -0.8,
        normal: Vector3::new(0.4, 0.5, -0.3),
        point: Vector3::new(0.2, 0.7, -0.6),
        sliding: Vector3::new(-0.3, 0.2, 0.9),
        turning: Vector3::new(0.5, -0.4, 0.3),
        tilting: Vector3::new(0.2, 0.9, -0.5),
        mass: 0.0,
    };
    const CONSTANTS: LawChange = LawChange { stiffness: 30.0, damping: 0.4, friction: 0.2 };
    const STRETCH: Vector3<f64> = Vector3::new(0.03, 0.05, 0.025);
    const STRETCH_CHANGE: Vector3<f64> = Vector3::new(-0.03, 0.06, 0.02);

    fn encounter(epsilon: f64) -> Encounter {
        Encounter {
            gap: PUSHED.gap + epsilon * CHANGE.gap,
            rate: PUSHED.rate + epsilon * CHANGE.rate,
            normal: PUSHED.normal + epsilon * CHANGE.normal,
            point: PUSHED.point + epsilon * CHANGE.point,
            sliding: PUSHED.sliding + epsilon * CHANGE.sliding,
            turning: PUSHED.turning + epsilon * CHANGE.turning,
            tilting: PUSHED.tilting + epsilon * CHANGE.tilting,
            mass: 1.0,
        }
    }

    /// Each law with a mode it may be in and another that may follow, all with ε in their constants.
    fn cases(epsilon: f64) -> Vec<(ContactLaw, ContactMode, ContactMode)> {
        use ContactMode::{Closed, Open, Slip};
        let (stiffness, damping) = (200.0 + epsilon * CONSTANTS.stiffness, 3.0 + epsilon * CONSTANTS.damping);
        let coefficient = 0.3 + epsilon * CONSTANTS.friction;
        let compliant = ContactLaw::from(CompliantLaw::try_new(stiffness, damping).unwrap());
        let hertz = ContactLaw::from(HuntCrossley::try_new(stiffness, damping - 2.7).unwrap());
        let coulomb = CoulombFriction::try_new(coefficient, 50.0, 2.0).unwrap();
        let rough = coulomb.with_static(1.5 * coefficient).unwrap();
        let creep = CoulombFriction::try_new(coefficient, 0.0, 4.0).unwrap();
        let regularised = RegularisedFriction::try_new(coefficient, 0.1).unwrap();
        let resistance = Resistance::try_new(0.02, 0.03, 0.5).unwrap();
        vec![
            (compliant, Closed, Open),
            (compliant.with_friction(regularised).with_resistance(resistance), Closed, Open),
            (compliant.with_friction(coulomb), Closed, Slip),
            (compliant.with_friction(coulomb), Slip, Closed),
            (compliant.with_friction(rough), Closed, Slip),
            (compliant.with_friction(rough), Slip, Closed),
            (compliant.with_friction(creep), Closed, Slip),
            (hertz.with_friction(creep), Slip, Closed),
            (hertz.with_friction(coulomb), Slip, Open),
        ]
    }

    #[test]
    fn derivatives_of_efforts_rates_of_stretch_and_margins_are_their_differences() {
        let by = Changes { at: &CHANGE, law: CONSTANTS, stretch: &STRETCH_CHANGE };
        for (i, (law, before, after)) in cases(0.0).iter().enumerate() {
            let step = 1e-5;
            let ends =
                [step, -step].map(|e| (cases(e).remove(i), encounter(e), STRETCH + e * STRETCH_CHANGE));
            let [a, b] =
                ends.each_ref().map(|((law, mode, _), at, stretch)| law.effort_in(mode, at, stretch));
            let (difference, found) =
                ((a - b) * (0.5 / step), law.effort_change(before, &PUSHED, &STRETCH, &by));
            let error = found - difference;
            assert!(error.force.norm() + error.torque.norm() < 1e-7, "{i}: {found:?} {difference:?}");
            assert!(found.force.norm() > 1.0, "{i}");
            let [a, b] =
                ends.each_ref().map(|((law, mode, _), at, stretch)| law.stretch_rate_in(mode, at, stretch));
            let found = law.stretch_rate_change(before, &PUSHED, &STRETCH, &by);
            assert!(((a - b) * (0.5 / step) - found).norm() < 1e-7, "{i}: {found:?}");
            let [a, b] = ends.map(|((law, mode, _), at, stretch)| match after {
                ContactMode::Open => law.guard(&at).margin(),
                ContactMode::Closed | ContactMode::Slip => law.friction_guard(&mode, &at, &stretch).gap,
            });
            let (difference, found) =
                ((a - b) * (0.5 / step), law.margin_change((before, after), &PUSHED, &STRETCH, &by));
            assert!((found - difference).abs() < 1e-7 * (1.0 + found.abs()), "{i}: {found} {difference}");
        }
    }
}
