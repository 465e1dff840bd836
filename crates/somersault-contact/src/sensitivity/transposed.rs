//! A tree in contact, linearised in a state and transposed: it pulls a covector on the accelerations and rates of stretches, or on the time
//! of an event, back to the state and the parameters.
//!
//! A contact is transposed by the derivatives of its effort along the twelve tangents of each link that it is on.

use super::parameter::{FoundParameter, Parameter};
use super::system::{Margin, Passing};
use crate::bodies::Part;
use crate::carrier::Frame;
use crate::laws::{ContactChange, ContactLaw, ContactMode, Encounter, LawParameter};
use crate::linearized::{At, Linearized, LinearizedRoom};
use crate::tree::{LinkLinearization, TreeInContact, TreeRoom};
use nalgebra::Vector3;
use somersault_integrators::augmented::AugmentedRate;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::{Rate, Twist};
use somersault_integrators::variation::Tangent;
use somersault_multibody::motion::{Coordinates, JointDrive, Rates, TreeAdjoint, TreeForces};

/// A covector on a tangent to a state with stretches.
#[derive(Debug, Clone)]
pub(super) struct Costate {
    pub(super) displacement: Rates,
    pub(super) rate: AugmentedRate<Rates>,
}

impl Costate {
    /// Zero, of the size of a rate.
    pub(super) fn zero(like: &AugmentedRate<Rates>) -> Self {
        let mut zero = Self { displacement: like.base.clone(), rate: like.clone() };
        zero.set_zero();
        zero
    }

    pub(super) fn set_zero(&mut self) {
        self.displacement.set_zero();
        self.rate.set_zero();
    }

    pub(super) fn axpy(&mut self, a: f64, other: &Self) {
        self.displacement.axpy(a, &other.displacement);
        self.rate.axpy(a, &other.rate);
    }
}

/// Room for a tree linearised and transposed.
pub(super) struct Transposed {
    room: LinearizedRoom<TreeRoom>,
    adjoint: TreeAdjoint,
    slope: AugmentedRate<Rates>,
    response: Rates,
    /// Tangents of the links, zero but for one number.
    units: Vec<Tangent<Twist>>,
}

/// A contact in a state, with the covector on its rate of stretch.
struct Weighed<'a> {
    of: &'a LinkLinearization,
    law: &'a ContactLaw,
    mode: &'a ContactMode,
    effort: Wrench,
    stretch: Vector3<f64>,
    stretching: Vector3<f64>,
}

impl Transposed {
    pub(super) fn new<F: TreeForces, D: JointDrive>(
        system: &TreeInContact<'_, F, D>,
        like: &AugmentedRate<Rates>,
    ) -> Self {
        Self {
            room: LinearizedRoom::new(system.room()),
            adjoint: TreeAdjoint::new(system.model()),
            slope: like.clone(),
            response: like.base.clone(),
            units: vec![Tangent::default(); system.model().n_bodies()],
        }
    }

    /// Pulls a covector on the slope of the state, q̇ and the accelerations with the rates of stretches, back to the state, as `out`, and to
    /// the parameters, added to `by`.
    pub(super) fn pull<F: TreeForces, D: JointDrive>(
        &mut self,
        system: &TreeInContact<'_, F, D>,
        parameters: &[FoundParameter<'_>],
        mode: &[ContactMode],
        t: f64,
        (q, p): At<'_, TreeInContact<'_, F, D>>,
        covector: &Costate,
        (out, by): (&mut Costate, &mut [f64]),
    ) {
        let Self { room, adjoint, slope, units, .. } = self;
        room.linearize(system, mode, t, (q, p), slope);
        // Of δq' = δp + [p, δq], whose bracket is skew.
        out.set_zero();
        out.rate.base.assign(&covector.displacement);
        out.displacement.add_bracket(-1.0, &p.base, &covector.displacement);
        let LinearizedRoom { system: w, efforts } = room;
        let TreeRoom { variation, frames, contacts, .. } = w;
        adjoint.begin(system.tree(), variation, &q.0, &covector.rate.base);
        for (i, (part, mode)) in system.contacts().parts().zip(mode).enumerate() {
            let Some(Some(of)) = contacts.get(i) else { continue };
            let weighed = Weighed {
                of,
                law: part.law(),
                mode,
                effort: efforts[i],
                stretch: p.variables[i],
                stretching: covector.rate.variables[i],
            };
            add_links(adjoint, units, (of, &part, &*frames), |adjoint, tangents, moved| {
                let change = ContactChange { at: moved, stretch: &Vector3::zeros(), parameter: None };
                weighed.product(adjoint, frames, tangents, &change)
            });
            for axis in 0..3 {
                let stretch = Vector3::ith(axis, 1.0);
                let change = ContactChange { at: &Encounter::ZERO, stretch: &stretch, parameter: None };
                out.rate.variables[i][axis] = weighed.product(adjoint, frames, units, &change);
            }
            for (by, found) in by.iter_mut().zip(parameters) {
                if let Some(parameter) = found.of_contact(i) {
                    *by += weighed.by_law(adjoint, frames, units, parameter);
                }
            }
        }
        for (by, found) in by.iter_mut().zip(parameters) {
            *by += match found.parameter {
                Parameter::JointForce(dof) => adjoint.torque()[*dof],
                Parameter::JointForceAt(dof, knots, knot) => adjoint.torque()[*dof] * knots.weight(*knot, t),
                Parameter::Tree(parameter) => adjoint.along(system.tree(), variation, parameter),
                Parameter::Normal(..)
                | Parameter::Friction(..)
                | Parameter::Mass
                | Parameter::InertiaScale
                | Parameter::Force(_) => 0.0,
            };
        }
        adjoint.finish(system.tree(), variation, t, &q.0, (&mut out.displacement, &mut out.rate.base));
    }

    /// Pulls a covector after an event back to the state before it and to the parameters, added to `by`. `weight` is the derivative of
    /// the cost by the time at which a guard changes sign.
    pub(super) fn pass<F: TreeForces, D: JointDrive>(
        &mut self,
        system: &TreeInContact<'_, F, D>,
        parameters: &[FoundParameter<'_>],
        (before, after): (&[ContactMode], &[ContactMode]),
        t: f64,
        x: At<'_, TreeInContact<'_, F, D>>,
        weight: impl Fn(usize) -> f64,
        (costate, by): (&mut Costate, &mut [f64]),
    ) {
        let Self { room: LinearizedRoom { system: w, .. }, adjoint, slope, response, units } = self;
        system.linearize(w, (before, true), t, x, slope);
        for contact in (0..before.len()).rev() {
            let modes = (&before[contact], &after[contact]);
            let Ok(part) = system.contacts().part(contact) else { continue };
            if modes.0 == modes.1 {
                continue;
            }
            let passing = Passing { contact, law: part.law(), modes };
            let Some(Margin { at, stretch, rate, .. }) = passing.margin(system, w, t, x, &slope.base) else {
                continue;
            };
            let (jump, stretching_jump) = part.law().jump(modes, &at, &stretch);
            let mut of_time = weight(passing.guard(before.len()));
            if jump != Wrench::default() {
                system.response(w, contact, x, &jump, response);
                of_time -= dot(&costate.rate.base, response);
            }
            of_time -= costate.rate.variables[contact].dot(&stretching_jump);
            if passing.resets() {
                costate.rate.variables[contact] = Vector3::zeros();
            }
            if of_time == 0.0 {
                continue;
            }
            let per_margin = -of_time / rate;
            let margin = |change: &Encounter, stretch_change: &Vector3<f64>, parameter| {
                let along = ContactChange { at: change, stretch: stretch_change, parameter };
                per_margin * part.law().margin_derivative(modes, &at, &stretch, &along)
            };
            let (still, zero) = (&Encounter::ZERO, &Vector3::zeros());
            adjoint.begin_with_links();
            let TreeRoom { variation, frames, contacts, .. } = w;
            let Some(Some(of)) = contacts.get(contact) else { continue };
            add_links(adjoint, units, (of, &part, &*frames), |_, _, moved| margin(moved, zero, None));
            for axis in 0..3 {
                costate.rate.variables[contact][axis] += margin(still, &Vector3::ith(axis, 1.0), None);
            }
            for (by, found) in by.iter_mut().zip(parameters) {
                if let Some(parameter) = found.of_contact(contact) {
                    *by += margin(still, zero, Some(parameter));
                }
                if let Parameter::Tree(parameter) = found.parameter {
                    *by += adjoint.along(system.tree(), variation, parameter);
                }
            }
            let out = (&mut costate.displacement, &mut costate.rate.base);
            adjoint.finish(system.tree(), variation, t, &x.0.0, out);
        }
    }

    /// Adds covectors on the motion of the joints and on the change of their velocities, pulled back to a tangent to a state.
    pub(super) fn add_joints<F: TreeForces, D: JointDrive>(
        &mut self,
        system: &TreeInContact<'_, F, D>,
        (q, v): (&Coordinates, &[f64]),
        covectors: (&[f64], &[f64]),
        out: &mut Costate,
    ) {
        let into = (&mut out.displacement, &mut out.rate.base);
        self.adjoint.add_joints(system.model(), (q, v), covectors, into);
    }
}

impl Weighed<'_> {
    /// The product of the covectors and the change of the efforts on the links and of the rate of stretch.
    fn product(
        &self,
        adjoint: &TreeAdjoint,
        frames: &[Frame],
        tangents: &[Tangent<Twist>],
        along: &ContactChange<'_>,
    ) -> f64 {
        let Self { of, law, mode, effort, stretch, stretching } = self;
        let (effort_change, stretch_rate) = law.derivative_in(mode, &of.at, stretch, along);
        let mut sum = stretch_rate.dot(stretching);
        of.press((effort, &effort_change), along.at, frames, tangents, |link, _, change| {
            sum += adjoint.motions()[link].dot(&change);
        });
        sum
    }

    /// The same by a parameter of the laws; `tangents` are zero.
    fn by_law(
        &self,
        adjoint: &TreeAdjoint,
        frames: &[Frame],
        tangents: &[Tangent<Twist>],
        parameter: LawParameter,
    ) -> f64 {
        let (at, stretch) = (&Encounter::ZERO, &Vector3::zeros());
        self.product(adjoint, frames, tangents, &ContactChange { at, stretch, parameter: Some(parameter) })
    }
}

/// Adds the covectors on the links of a contact: for each unit tangent of each, the derivative `by` of the change of its encounter.
fn add_links(
    adjoint: &mut TreeAdjoint,
    units: &mut [Tangent<Twist>],
    (of, part, frames): (&LinkLinearization, &Part<'_>, &[Frame]),
    by: impl Fn(&TreeAdjoint, &[Tangent<Twist>], &Encounter) -> f64,
) {
    for link in of.links() {
        for k in 0..12 {
            units[link] = Tangent::unit(k);
            let moved = of.along(part, frames, units);
            let weight = by(adjoint, units, &moved);
            adjoint.add_link(link, weight, &Tangent::unit(k));
        }
        units[link] = Tangent::default();
    }
}

/// The product of a covector and a rate.
pub(super) fn dot(covector: &Rates, rate: &Rates) -> f64 {
    covector.as_slice().iter().zip(rate.as_slice()).map(|(covector, rate)| covector * rate).sum()
}
