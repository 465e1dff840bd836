//! All laws of a contact together, its modes, and their derivatives.

use super::compliant::CompliantLaw;
use super::encounter::Encounter;
use super::friction::Friction;
use super::friction_law::{FrictionChange, FrictionDerivative, FrictionInput, FrictionLaw};
use super::normal_law::{NormalChange, NormalDerivative, NormalLaw};
use super::rate::{ContactRate, Mobility};
use super::resistance::Resistance;
use nalgebra::Vector3;
use somersault_integrators::events::Guard;
use somersault_integrators::force::Wrench;
use std::fmt;
use std::sync::Arc;

/// What a contact does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactMode {
    /// Exerts no force.
    Open,
    /// Pushes; friction, where it has modes, sticks.
    Closed,
    /// Pushes and slips.
    Slip,
}

impl ContactMode {
    /// Whether it exerts no force.
    pub(crate) fn is_open(self) -> bool {
        matches!(self, Self::Open)
    }
}

/// A parameter of one of the laws of a contact, by its place among those that the law names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LawParameter {
    /// Of the normal law.
    Normal(usize),
    /// Of the friction law.
    Friction(usize),
}

/// A direction in which the laws of a contact are differentiated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ContactChange<'a> {
    /// Of the encounter.
    pub(crate) at: &'a Encounter,
    /// Of the stretch.
    pub(crate) stretch: &'a Vector3<f64>,
    /// The parameter that grows at the rate 1.
    pub(crate) parameter: Option<LawParameter>,
}

/// Laws of a contact: along the normal, against sliding, against rolling and spinning.
///
/// Every [`NormalLaw`] makes one, without friction; [`with_friction`](Self::with_friction) adds any [`FrictionLaw`].
/// Clones share the laws. Two are equal if their laws are of the same types with the same constants.
#[derive(Clone)]
pub struct ContactLaw {
    normal: Arc<dyn NormalLaw>,
    /// The normal law itself where it is a spring with a damper, the most common one: asked without a call through the
    /// object.
    compliant: Option<CompliantLaw>,
    friction: Friction,
    resistance: Resistance,
}

impl fmt::Debug for ContactLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { normal, compliant: _, friction, resistance } = self;
        f.debug_struct("ContactLaw")
            .field("normal", normal)
            .field("friction", friction)
            .field("resistance", resistance)
            .finish()
    }
}

impl PartialEq for ContactLaw {
    fn eq(&self, other: &Self) -> bool {
        *self.normal == *other.normal
            && self.friction == other.friction
            && self.resistance == other.resistance
    }
}

impl<L: NormalLaw> From<L> for ContactLaw {
    /// A law without friction.
    fn from(normal: L) -> Self {
        Self::from(Arc::new(normal) as Arc<dyn NormalLaw>)
    }
}

impl From<Arc<dyn NormalLaw>> for ContactLaw {
    /// A law without friction.
    fn from(normal: Arc<dyn NormalLaw>) -> Self {
        let compliant = normal.downcast_ref::<CompliantLaw>().copied();
        Self { normal, compliant, friction: Friction::NONE, resistance: Resistance::default() }
    }
}

impl ContactLaw {
    /// The same with another friction.
    #[must_use]
    pub fn with_friction(self, friction: impl Into<Friction>) -> Self {
        Self { friction: friction.into(), ..self }
    }

    /// The same with another resistance to rolling and spinning.
    #[must_use]
    pub fn with_resistance(self, resistance: Resistance) -> Self {
        Self { resistance, ..self }
    }

    /// The law along the normal.
    pub fn normal(&self) -> &dyn NormalLaw {
        &*self.normal
    }

    /// The law against sliding, or none.
    #[inline(always)]
    pub fn friction(&self) -> &Friction {
        &self.friction
    }

    /// Resistance to rolling and spinning.
    pub fn resistance(&self) -> &Resistance {
        &self.resistance
    }

    /// Whether force or couple depend on velocities.
    pub fn depends_on_velocity(&self) -> bool {
        self.normal.is_damped() || !self.is_only_normal()
    }

    /// Whether there is neither friction nor resistance.
    #[inline(always)]
    pub(crate) fn is_only_normal(&self) -> bool {
        self.friction.law().is_none() && self.resistance.is_none()
    }

    /// The normal law where it is a spring with a damper, and nothing else acts.
    pub(crate) fn only_compliant(&self) -> Option<&CompliantLaw> {
        self.compliant.as_ref().filter(|_| self.is_only_normal())
    }

    /// The normal force frozen in contact, N.
    #[inline(always)]
    pub fn push(&self, gap: f64, rate: f64) -> f64 {
        match &self.compliant {
            Some(law) => law.force_in_contact(gap, rate),
            None => self.normal.force_in_contact(gap, rate),
        }
    }

    /// The guard of the contact itself: inside where it pushes.
    #[inline(always)]
    pub fn guard(&self, at: &Encounter) -> Guard {
        // A number that is returned stays in a register: a guard would go through memory.
        let lag = match &self.compliant {
            Some(law) => law.lag(at.gap, at.rate),
            None => self.normal.lag(at.gap, at.rate),
        };
        Guard { gap: at.gap, rate: at.rate, lag }
    }

    /// Energy of the spring of the normal law, J.
    #[inline]
    pub fn normal_energy(&self, gap: f64) -> f64 {
        match &self.compliant {
            Some(law) => law.energy(gap),
            None => self.normal.energy(gap),
        }
    }

    /// The guard of friction: inside where it slips. Its rate is not known.
    #[inline]
    pub fn friction_guard(&self, mode: &ContactMode, at: &Encounter, stretch: &Vector3<f64>) -> Guard {
        let gap = self.input_in(mode, at, stretch).map_or(1.0, |input| self.friction.margin(&input));
        Guard { gap, ..Guard::default() }
    }

    /// The mode of an encounter without history.
    pub fn mode(&self, at: &Encounter, stretch: &Vector3<f64>) -> ContactMode {
        self.next_mode(&ContactMode::Closed, at, stretch)
    }

    /// The mode after an event.
    pub fn next_mode(&self, before: &ContactMode, at: &Encounter, stretch: &Vector3<f64>) -> ContactMode {
        let (last, stretch) = match before {
            // A contact begins without stretch.
            ContactMode::Open => (ContactMode::Closed, &Vector3::zeros()),
            ContactMode::Closed | ContactMode::Slip => (*before, stretch),
        };
        if !self.guard(at).is_inside() {
            ContactMode::Open
        } else if self.friction_guard(&last, at, stretch).is_inside() {
            ContactMode::Slip
        } else {
            ContactMode::Closed
        }
    }

    /// Force and couple on the first at the point of contact, frozen in a mode.
    #[inline(always)]
    pub fn effort_in(&self, mode: &ContactMode, at: &Encounter, stretch: &Vector3<f64>) -> Wrench {
        self.response_in(mode, at, stretch).0
    }

    /// ξ̇, m/s, frozen in a mode: zero where the contact is open or has no stretch.
    #[inline]
    pub fn stretch_rate_in(
        &self,
        mode: &ContactMode,
        at: &Encounter,
        stretch: &Vector3<f64>,
    ) -> Vector3<f64> {
        self.response_in(mode, at, stretch).1
    }

    /// Effort and ξ̇, frozen in a mode.
    #[inline(always)]
    pub(crate) fn response_in(
        &self,
        mode: &ContactMode,
        at: &Encounter,
        stretch: &Vector3<f64>,
    ) -> (Wrench, Vector3<f64>) {
        let Some(input) = self.input_in(mode, at, stretch) else {
            return (Wrench::default(), Vector3::zeros());
        };
        let push = input.normal_force;
        let torque = if self.resistance.is_none() {
            Vector3::zeros()
        } else {
            self.resistance.couple(push, &at.normal, &at.turning)
        };
        let friction = self.friction.response(&input);
        let wrench = Wrench { force: at.normal * push + friction.force, torque };
        (wrench, friction.stretch_rate + at.tilting.cross(stretch))
    }

    /// Stiffness and damping over the masses that they move, while the contact is closed.
    pub fn rate(&self, at: &Encounter, mobility: &Mobility) -> ContactRate {
        let normal = self.normal.stiffest(at.gap, at.rate, 1.0 / mobility.normal);
        let friction = self.friction.law().map(|law| law.stiffest(&normal)).unwrap_or_default();
        let couple = if self.resistance.is_none() { 0.0 } else { self.resistance.damping(normal.force) };
        ContactRate {
            stiffness: normal.stiffness * mobility.normal + friction.stiffness * mobility.tangential,
            damping: normal.damping * mobility.normal
                + friction.damping * mobility.tangential
                + couple * mobility.turning,
            relaxation: friction.relaxation,
        }
    }

    /// Energy of the springs, J: that of the normal law and that of the stretch.
    pub fn energy(&self, gap: f64, stretch: &Vector3<f64>) -> f64 {
        self.normal_energy(gap) + self.friction.law().map_or(0.0, |law| law.energy(stretch))
    }

    /// What friction depends on in a mode, unless the contact is open.
    #[inline(always)]
    fn input_in<'a>(
        &self,
        mode: &ContactMode,
        at: &'a Encounter,
        stretch: &'a Vector3<f64>,
    ) -> Option<FrictionInput<'a>> {
        let slips = match mode {
            ContactMode::Open => return None,
            ContactMode::Closed => false,
            ContactMode::Slip => true,
        };
        Some(FrictionInput { slips, normal_force: self.push(at.gap, at.rate), at, stretch })
    }
}

/// Derivatives; NaN where a law has none.
impl ContactLaw {
    /// Derivatives of effort and of ξ̇ in a mode.
    #[inline]
    pub(crate) fn derivative_in(
        &self,
        mode: &ContactMode,
        at: &Encounter,
        stretch: &Vector3<f64>,
        along: &ContactChange<'_>,
    ) -> (Wrench, Vector3<f64>) {
        let Some(of) = self.input_in(mode, at, stretch) else {
            return (Wrench::default(), Vector3::zeros());
        };
        let push_change = self.normal_derivative(at, along).force;
        let friction = self.friction_derivative(&of, push_change, along);
        let torque = if self.resistance.is_none() {
            Vector3::zeros()
        } else {
            self.resistance.couple_derivative((of.normal_force, push_change), at, along.at)
        };
        let force = at.normal * push_change + along.at.normal * of.normal_force + friction.force;
        let stretch_rate =
            friction.stretch_rate + along.at.tilting.cross(stretch) + at.tilting.cross(along.stretch);
        (Wrench { force, torque }, stretch_rate)
    }

    /// Derivative of the margin that ends a mode for another: that of the contact itself where it begins or
    /// ends, else that of friction.
    pub(crate) fn margin_derivative(
        &self,
        (before, after): (&ContactMode, &ContactMode),
        at: &Encounter,
        stretch: &Vector3<f64>,
        along: &ContactChange<'_>,
    ) -> f64 {
        match self.input_in(before, at, stretch) {
            Some(of) if !after.is_open() => {
                let push_change = self.normal_derivative(at, along).force;
                self.friction_derivative(&of, push_change, along).margin
            }
            // Of Δx + τ max(Δẋ, 0).
            Some(_) | None if at.rate <= 0.0 => along.at.gap,
            Some(_) | None => {
                let lag_change = self.normal_derivative(at, along).lag;
                along.at.gap + self.normal.lag(at.gap, at.rate) * along.at.rate + lag_change * at.rate
            }
        }
    }

    /// The jumps of effort and of ξ̇ from one mode to the next, each by its limit at the event; before a contact
    /// begins and after it has ended ξ̇ is zero.
    pub(crate) fn jump(
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
            (ContactMode::Closed, ContactMode::Slip)
                if self.friction.law().is_some_and(FrictionLaw::breaks_away) => (
                self.effort_in(after, at, stretch) - self.effort_in(before, at, stretch),
                self.stretch_rate_in(after, at, stretch) - self.stretch_rate_in(before, at, stretch),
            ),
            (ContactMode::Closed, ContactMode::Slip) => none,
        }
    }

    /// The type of the first law that has no derivative at an encounter, if there is one.
    pub(crate) fn without_derivative(&self, at: &Encounter) -> Option<&'static str> {
        let still = NormalChange::default();
        if self.normal.derivative(at.gap, at.rate, &still).is_none() {
            return Some(self.normal().type_name());
        }
        let (law, stretch) = (self.friction.law()?, &Vector3::zeros());
        let input = FrictionInput { slips: false, normal_force: 0.0, at, stretch };
        let along = FrictionChange { normal_force: 0.0, at, stretch, parameter: None };
        law.derivative(&input, &along).is_none().then(|| law.type_name())
    }

    #[inline]
    fn normal_derivative(&self, at: &Encounter, along: &ContactChange<'_>) -> NormalDerivative {
        let parameter = match along.parameter {
            Some(LawParameter::Normal(place)) => Some(place),
            Some(LawParameter::Friction(_)) | None => None,
        };
        let change = NormalChange { gap: along.at.gap, rate: along.at.rate, parameter };
        let found = match &self.compliant {
            Some(law) => law.derivative(at.gap, at.rate, &change),
            None => self.normal.derivative(at.gap, at.rate, &change),
        };
        found.unwrap_or(NormalDerivative { force: f64::NAN, lag: f64::NAN })
    }

    #[inline]
    fn friction_derivative(
        &self,
        of: &FrictionInput<'_>,
        normal_force: f64,
        along: &ContactChange<'_>,
    ) -> FrictionDerivative {
        let Some(law) = self.friction.law() else { return FrictionDerivative::default() };
        let parameter = match along.parameter {
            Some(LawParameter::Friction(place)) => Some(place),
            Some(LawParameter::Normal(_)) | None => None,
        };
        let change = FrictionChange { normal_force, at: along.at, stretch: along.stretch, parameter };
        let none = Vector3::repeat(f64::NAN);
        let unknown = FrictionDerivative { force: none, stretch_rate: none, margin: f64::NAN };
        law.derivative(of, &change).unwrap_or(unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::checks::{CHANGE, PUSHED, STRETCH, STRETCH_CHANGE, moved};
    use crate::laws::coulomb::CoulombFriction;
    use crate::laws::hunt_crossley::HuntCrossley;
    use crate::laws::regularised::RegularisedFriction;

    /// A change of one parameter, of which laws take what is theirs.
    const CONSTANTS: [Option<LawParameter>; 5] = [
        None,
        Some(LawParameter::Normal(0)),
        Some(LawParameter::Normal(1)),
        Some(LawParameter::Friction(0)),
        Some(LawParameter::Friction(1)),
    ];

    /// Each law with a mode it may be in and another that may follow, all with ε in one parameter.
    fn cases(parameter: Option<LawParameter>, epsilon: f64) -> Vec<(ContactLaw, ContactMode, ContactMode)> {
        use ContactMode::{Closed, Open, Slip};
        let of = |place| if parameter == Some(place) { epsilon } else { 0.0 };
        let (k, c) = (of(LawParameter::Normal(0)), of(LawParameter::Normal(1)));
        let (coefficient, second) = (0.3 + of(LawParameter::Friction(0)), of(LawParameter::Friction(1)));
        let compliant = ContactLaw::from(CompliantLaw::try_new(200.0 + k, 3.0 + c).unwrap());
        let hertz = ContactLaw::from(HuntCrossley::try_new(200.0 + k, 0.3 + c).unwrap());
        let coulomb = CoulombFriction::try_new(coefficient, 50.0, 2.0 + second).unwrap();
        let rough = coulomb.with_static(1.5 * coefficient).unwrap();
        let creep = CoulombFriction::try_new(coefficient, 0.0, 4.0 + second).unwrap();
        let regularised = RegularisedFriction::try_new(coefficient, 0.1 + second).unwrap();
        let resistance = Resistance::try_new(0.02, 0.03, 0.5).unwrap();
        let with = |law: &ContactLaw, friction: CoulombFriction| law.clone().with_friction(friction);
        vec![
            (compliant.clone(), Closed, Open),
            (compliant.clone().with_friction(regularised).with_resistance(resistance), Closed, Open),
            (with(&compliant, coulomb), Closed, Slip),
            (with(&compliant, coulomb), Slip, Closed),
            (with(&compliant, rough), Closed, Slip),
            (with(&compliant, rough), Slip, Closed),
            (with(&compliant, creep), Closed, Slip),
            (with(&hertz, creep), Slip, Closed),
            (with(&hertz, coulomb), Slip, Open),
        ]
    }

    #[test]
    fn derivatives_of_efforts_rates_of_stretch_and_margins_are_their_differences() {
        for parameter in CONSTANTS {
            let by = ContactChange { at: &CHANGE, stretch: &STRETCH_CHANGE, parameter };
            for (i, (law, before, after)) in cases(parameter, 0.0).iter().enumerate() {
                let step = 1e-5;
                let ends = [step, -step]
                    .map(|e| (cases(parameter, e).remove(i), moved(e), STRETCH + e * STRETCH_CHANGE));
                let [a, b] =
                    ends.each_ref().map(|((law, mode, _), at, stretch)| law.effort_in(mode, at, stretch));
                let (effort, stretch_rate) = law.derivative_in(before, &PUSHED, &STRETCH, &by);
                let error = effort - (a - b) * (0.5 / step);
                assert!(error.force.norm() + error.torque.norm() < 1e-7, "{i} {parameter:?}: {error:?}");
                assert!(effort.force.norm() > 1.0, "{i}");
                let [a, b] = ends
                    .each_ref()
                    .map(|((law, mode, _), at, stretch)| law.stretch_rate_in(mode, at, stretch));
                let error = (a - b) * (0.5 / step) - stretch_rate;
                assert!(error.norm() < 1e-7, "{i} {parameter:?}: {stretch_rate:?}");
                let [a, b] = ends.map(|((law, mode, _), at, stretch)| match after {
                    ContactMode::Open => law.guard(&at).margin(),
                    ContactMode::Closed | ContactMode::Slip => law.friction_guard(&mode, &at, &stretch).gap,
                });
                let (difference, found) =
                    ((a - b) * (0.5 / step), law.margin_derivative((before, after), &PUSHED, &STRETCH, &by));
                assert!((found - difference).abs() < 1e-7 * (1.0 + found.abs()), "{i}: {found} {difference}");
            }
        }
    }

    #[test]
    fn laws_are_equal_by_type_and_constants() {
        let compliant = |k| ContactLaw::from(CompliantLaw::try_new(k, 1.0).unwrap());
        let hertz = ContactLaw::from(HuntCrossley::try_new(10.0, 1.0).unwrap());
        let smooth = RegularisedFriction::try_new(0.3, 0.1).unwrap();
        let shared: Arc<dyn NormalLaw> = Arc::new(CompliantLaw::try_new(10.0, 1.0).unwrap());
        assert_eq!(compliant(10.0), ContactLaw::from(shared));
        assert_ne!(compliant(10.0), compliant(11.0));
        assert_ne!(compliant(10.0), hertz);
        assert_ne!(compliant(10.0), compliant(10.0).with_friction(smooth));
        assert_eq!(hertz.clone().with_friction(smooth), hertz.clone().with_friction(smooth));
        assert_eq!(hertz.clone().with_friction(smooth).with_friction(Friction::NONE), hertz);
    }
}
