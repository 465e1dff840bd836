//! Derivatives of the geometry of the contacts of a tree along the tangents of its links.
//!
//! A contact with a surface in the world is that of a body. One with a surface that a link carries is linearised in the frame
//! of that link and turned back; with s the span from the origin of the carrying link to that of the other, and R its rotation,
//! ```text
//! s' = Rᵀ s,   δs' = Rᵀ (δs − δφ × s),   δu' = Rᵀ (δu − δω × s − ω × δs − δφ × u),   u = v − v_g − ω × s.
//! ```
//! Of two spheres with the span d n between their centres, δn = (δs − n (n · δs))/d.

use super::contacts::TreeContacts;
use crate::bodies::{Hold, Part, SpherePair};
use crate::carrier::{Carrier, Frame};
use crate::laws::Encounter;
use crate::linearization::{Linearization, step_along};
use nalgebra::Vector3;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::Twist;
use somersault_integrators::variation::Tangent;
use somersault_multibody::Force;
use somersault_multibody::motion::{TreeVariation, TreeWorkspace};

/// Room for a tree linearised in a state.
#[derive(Debug)]
pub struct TreeRoom {
    pub(super) tree: TreeWorkspace,
    pub(crate) variation: TreeVariation,
    pub(crate) frames: Vec<Frame>,
    pub(crate) contacts: Vec<Option<LinkLinearization>>,
}

impl TreeRoom {
    /// Adds a change of a joint force.
    pub(crate) fn add_joint_force(&mut self, dof: usize, change: f64) {
        if let Some(force) = self.variation.torque_mut().get_mut(dof) {
            *force += change;
        }
    }
}

/// A contact of links in a state, with what its derivatives there need.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LinkLinearization {
    pub(crate) at: Encounter,
    links: (usize, Option<usize>),
    kind: Kind,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// The surface stands in the world.
    Standing(Linearization),
    /// A link carries it: the contact as seen from there.
    Carried(Linearization),
    Pair,
}

impl LinkLinearization {
    /// Of contact `i`, where the links stand so.
    pub(super) fn new(
        contacts: &TreeContacts,
        i: usize,
        part: &Part<'_>,
        frames: &[Frame],
        met: (Encounter, Hold),
    ) -> Self {
        let (at, hold) = met;
        let links = (hold.first.0, hold.second.map(|(link, _)| link));
        let kind = match part {
            Part::Surface(link, contact) => match contacts.base(i) {
                Some(base) => {
                    let seen = frames[*link].seen_from(&frames[base]);
                    Kind::Carried(Linearization::new(contact, at.mass, &seen))
                }
                None => Kind::Standing(Linearization::new(contact, at.mass, &frames[*link])),
            },
            Part::Pair(_) => Kind::Pair,
        };
        Self { at, links, kind }
    }

    /// The links that it is on.
    pub(crate) fn links(&self) -> impl Iterator<Item = usize> + use<> {
        let (first, second) = self.links;
        std::iter::once(first).chain(second)
    }

    /// The derivative along the tangents of the links.
    pub(crate) fn along(&self, part: &Part<'_>, frames: &[Frame], tangents: &[Tangent<Twist>]) -> Encounter {
        let (first, second) = self.links;
        match (part, &self.kind, second) {
            (Part::Surface(_, contact), Kind::Standing(of), _) => of.along(contact, &tangents[first]).at,
            (Part::Surface(_, contact), Kind::Carried(of), Some(base)) => {
                let (ground, turned) = (&frames[base], &tangents[base]);
                let seen = relative((&frames[first], &tangents[first]), (ground, turned));
                self.turned_back(&of.at, &of.along(contact, &seen).at, ground, turned)
            }
            (Part::Pair(pair), _, Some(other)) => {
                let ends = [first, other].map(|link| (&frames[link], &tangents[link]));
                self.between(pair, ends)
            }
            (Part::Surface(..), Kind::Carried(_) | Kind::Pair, _) | (Part::Pair(_), _, None) => {
                Encounter::ZERO
            }
        }
    }

    /// The change of an encounter on a surface, seen from the world instead of the link that carries it.
    fn turned_back(
        &self,
        inner: &Encounter,
        change: &Encounter,
        ground: &Frame,
        tangent: &Tangent<Twist>,
    ) -> Encounter {
        let turn = &tangent.displacement.angular;
        let back = |at: &Vector3<f64>, change: &Vector3<f64>| {
            ground.rotation * change + turn.cross(&(ground.rotation * at))
        };
        Encounter {
            gap: change.gap,
            rate: change.rate,
            normal: back(&inner.normal, &change.normal),
            point: tangent.displacement.linear + back(&inner.point, &change.point),
            sliding: back(&inner.sliding, &change.sliding),
            turning: back(&inner.turning, &change.turning),
            tilting: back(&inner.tilting, &change.tilting) + tangent.rate.angular,
            mass: 0.0,
        }
    }

    /// Of two spheres.
    fn between(&self, pair: &SpherePair, ends: [(&Frame, &Tangent<Twist>); 2]) -> Encounter {
        let [(on_a, to_a), (on_b, to_b)] = ends;
        if !pair.is_of_balls() {
            let step = step_along([to_a, to_b]);
            let [after, before] = [step, -step]
                .map(|way| pair.meet_on([on_a.moved(to_a, way), on_b.moved(to_b, way)], [1.0, 1.0]).0);
            return after.change_from(&before, 0.5 / step);
        }
        let [a, b] = pair.spheres();
        let [arm_a, arm_b] = [on_a.turned(a.centre()), on_b.turned(b.centre())];
        let [turn_a, turn_b] = [to_a, to_b].map(|to| to.displacement.angular);
        let [arm_change_a, arm_change_b] = [turn_a.cross(&arm_a), turn_b.cross(&arm_b)];
        let span = (on_a.origin() - on_b.origin()) + (arm_a - arm_b);
        let span_change =
            (to_a.displacement.linear - to_b.displacement.linear) + (arm_change_a - arm_change_b);
        let (distance, normal) = (span.norm(), self.at.normal);
        if distance == 0.0 {
            return Encounter::ZERO;
        }
        let gap = normal.dot(&span_change);
        let normal_change = (span_change - normal * gap) / distance;
        let total = a.radius() + b.radius();
        let (share_a, share_b) = (a.radius() / total, b.radius() / total);
        let arms = [arm_a - span * share_a, arm_b + span * share_b];
        let arm_changes = [arm_change_a - span_change * share_a, arm_change_b + span_change * share_b];
        let velocity = on_a.velocity_at(&arms[0]) - on_b.velocity_at(&arms[1]);
        let velocity_change = velocity_change((on_a, to_a), &arms[0], &arm_changes[0])
            - velocity_change((on_b, to_b), &arms[1], &arm_changes[1]);
        let rate = normal_change.dot(&velocity) + normal.dot(&velocity_change);
        Encounter {
            gap,
            rate,
            normal: normal_change,
            point: to_a.displacement.linear + arm_changes[0],
            sliding: velocity_change - normal * rate - normal_change * self.at.rate,
            turning: to_a.rate.angular - to_b.rate.angular,
            tilting: if pair.law().friction().has_stretch() {
                let moving = on_a.velocity_at(&arm_a) - on_b.velocity_at(&arm_b);
                let moving_change = self::velocity_change((on_a, to_a), &arm_a, &arm_change_a)
                    - self::velocity_change((on_b, to_b), &arm_b, &arm_change_b);
                let spins = on_a.spin() + on_b.spin();
                let spin_change =
                    normal_change.dot(&spins) + normal.dot(&(to_a.rate.angular + to_b.rate.angular));
                (normal_change.cross(&moving) + normal.cross(&moving_change)
                    - normal.cross(&moving) * (gap / distance))
                    / distance
                    + (normal_change * normal.dot(&spins) + normal * spin_change) * 0.5
            } else {
                Vector3::zeros()
            },
            mass: 0.0,
        }
    }

    /// Shows the wrench on each link by an effort on the first one, and its change, in the axes of the link about its origin.
    pub(crate) fn press(
        &self,
        (effort, effort_change): (&Wrench, &Wrench),
        change: &Encounter,
        frames: &[Frame],
        tangents: &[Tangent<Twist>],
        mut see: impl FnMut(usize, Force<f64>, Force<f64>),
    ) {
        let (first, second) = self.links;
        for (link, sign) in std::iter::once((first, 1.0)).chain(second.map(|link| (link, -1.0))) {
            let (frame, moved) = (&frames[link], &tangents[link].displacement);
            let (arm, arm_change) = (self.at.point - frame.origin, change.point - moved.linear);
            let (force, force_change) = (effort.force * sign, effort_change.force * sign);
            let torque = arm.cross(&force) + effort.torque * sign;
            let torque_change =
                arm_change.cross(&force) + arm.cross(&force_change) + effort_change.torque * sign;
            let back = |v: Vector3<f64>| frame.rotation.tr_mul(&v);
            see(
                link,
                Force::new(back(force), back(torque)),
                Force::new(
                    back(force_change - moved.angular.cross(&force)),
                    back(torque_change - moved.angular.cross(&torque)),
                ),
            );
        }
    }
}

/// The change of the velocity at the end of an arm that changes.
fn velocity_change(
    (frame, tangent): (&Frame, &Tangent<Twist>),
    arm: &Vector3<f64>,
    arm_change: &Vector3<f64>,
) -> Vector3<f64> {
    tangent.rate.linear + tangent.rate.angular.cross(arm) + frame.angular_velocity.cross(arm_change)
}

/// The tangent of a frame as seen from another that moves along its own.
fn relative(
    (frame, to): (&Frame, &Tangent<Twist>),
    (ground, with): (&Frame, &Tangent<Twist>),
) -> Tangent<Twist> {
    let turn = &with.displacement.angular;
    let span = frame.origin - ground.origin;
    let span_change = to.displacement.linear - with.displacement.linear;
    let back = |at: &Vector3<f64>, change: Vector3<f64>| ground.rotation.tr_mul(&(change - turn.cross(at)));
    let velocity = frame.velocity - ground.velocity_at(&span);
    let velocity_change = to.rate.linear - velocity_change((ground, with), &span, &span_change);
    let spin = frame.angular_velocity - ground.angular_velocity;
    Tangent {
        displacement: Twist {
            linear: back(&span, span_change),
            angular: ground.rotation.tr_mul(&(to.displacement.angular - turn)),
        },
        rate: Twist {
            linear: back(&velocity, velocity_change),
            angular: back(&spin, to.rate.angular - with.rate.angular),
        },
    }
}
