//! How far the links of a tree move during a step, for whatever watches points of them between its ends: along the chain of
//! joints, from the states at both ends ([`LinkBounds`]), and by the energy ([`mobility_bound`]).

use crate::coordinates::{Coordinates, Rates};
use crate::data::Data;
use crate::error::DynamicsError;
use crate::joint::{Joint, Turning};
use crate::kinematics::Velocities;
use crate::model::Model;
use nalgebra::Vector3;
use somersault_integrators::state::Configuration;

/// Bounds of the motion of a link during a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkBound {
    /// Speed of its origin, m/s.
    pub speed: f64,
    /// Acceleration of its origin, m/s².
    pub acceleration: f64,
    /// Angular speed, rad/s.
    pub spin: f64,
    /// Angular acceleration, rad/s².
    pub turn: f64,
}

impl LinkBound {
    /// Speed of a point at some distance (m) from the origin.
    pub fn speed_at(&self, lever: f64) -> f64 {
        self.speed + self.spin * lever
    }

    /// Acceleration of a point at some distance (m) from the origin.
    pub fn acceleration_at(&self, lever: f64) -> f64 {
        self.acceleration + (self.turn + self.spin * self.spin) * lever
    }
}

/// A link at one end of a step.
#[derive(Debug, Clone, Copy, Default)]
struct End {
    /// Distance of its origin from that of the parent.
    reach: f64,
    speed: f64,
    spin: f64,
}

/// Rates and accelerations of a joint at most: along and about its axes.
#[derive(Debug, Clone, Copy, Default)]
struct JointBound {
    speed: f64,
    acceleration: f64,
    spin: f64,
    turn: f64,
}

/// Bounds of the motion of all links during a step, along the chain of joints from the states at both ends, with the room to
/// compute them.
///
/// With the rates of the joints, u along and ω about their axes, and the distance ρ from the origin of a link to that of its
/// parent λ,
/// ```text
/// V = V_λ + Ω_λ ρ + u,    A = A_λ + (α_λ + Ω_λ²) ρ + 2 Ω_λ u + u̇,
/// Ω = Ω_λ + ω,            α = α_λ + ω̇ + Ω_λ ω
/// ```
/// are no less than speed and acceleration of the origin, angular speed and angular acceleration. Rates of joints are at most
/// the larger of those at the ends and half a step of their acceleration. That one is *estimated*: twice the largest of the
/// cubic through both ends, and of rotations twice the mean. It is no proof: it fails where a step is too long for the
/// accelerations of the joints. [`mobility_bound`] is one that always holds.
#[derive(Debug, Clone)]
pub struct LinkBounds {
    v: Vec<f64>,
    way: Option<Rates>,
    ends: [Vec<End>; 2],
    joints: Vec<JointBound>,
    links: Vec<LinkBound>,
}

impl LinkBounds {
    /// Room for a model.
    pub fn new(model: &Model) -> Self {
        let n = model.n_bodies();
        Self {
            v: vec![0.0; model.n_velocities()],
            way: None,
            ends: [vec![End::default(); n], vec![End::default(); n]],
            joints: vec![JointBound::default(); n],
            links: vec![LinkBound::default(); n],
        }
    }

    /// The bounds of each link between two states h apart, estimated along the chain. Cost: that of the velocities of all
    /// links, twice.
    ///
    /// Returned with the poses and velocities of the links at the start.
    pub fn between<'a>(
        &'a mut self,
        model: &'a Model,
        data: &'a mut Data,
        ends: [(&Coordinates, &Rates); 2],
        h: f64,
    ) -> Result<(Velocities<'a>, &'a [LinkBound]), DynamicsError> {
        // The start last, so that it is what the workspace is left with.
        for (found, (q, p)) in self.ends.iter_mut().zip(ends).rev() {
            model.joint_velocities_at((q, p), &mut self.v)?;
            model.velocities(data, q.as_slice(), &self.v)?;
            for (end, node) in found.iter_mut().zip(&data.tree.nodes) {
                let [speed, spin] = [&node.velocity.linear, &node.velocity.angular].map(Vector3::norm);
                *end = End { reach: node.local.translation.norm(), speed, spin };
            }
        }
        let [(q0, p0), (q1, p1)] = ends;
        let way = self.way.get_or_insert_with(|| p0.clone());
        q1.difference(q0, way);
        let rates = [p0.as_slice(), p1.as_slice(), way.as_slice()];
        for (i, source) in model.sources().iter().enumerate() {
            let Some(joint) = model.joint(source.body) else { continue };
            let place = model.velocities_of(source.body);
            let bound = JointBound::between(joint, rates.map(|numbers| &numbers[place.clone()]), h);
            self.joints[i] = bound.scaled(source.multiplier.abs());
        }
        for (i, joint) in self.joints.iter().enumerate() {
            let [a, b] = self.ends.each_ref().map(|end| end[i]);
            let parent = model.parent(i);
            let outer = parent.map_or(LinkBound::default(), |p| self.links[p]);
            let reach = parent.map_or(0.0, |_| a.reach.max(b.reach) + 0.5 * h * joint.speed);
            let acceleration =
                outer.acceleration_at(reach) + 2.0 * outer.spin * joint.speed + joint.acceleration;
            let turn = outer.turn + joint.turn + outer.spin * joint.spin;
            self.links[i] = LinkBound {
                speed: (outer.speed_at(reach) + joint.speed)
                    .min(a.speed.max(b.speed) + 0.5 * h * acceleration),
                acceleration,
                spin: (outer.spin + joint.spin).min(a.spin.max(b.spin) + 0.5 * h * turn),
                turn,
            };
        }
        Ok((Velocities::of(model, &data.tree), &self.links))
    }
}

impl JointBound {
    /// From the rates of a joint at both ends and the way between them.
    fn between(joint: &Joint, [p0, p1, way]: [&[f64]; 3], h: f64) -> Self {
        let kind = joint.kind();
        let (linear, angular) = (0..kind.n_linear, kind.n_linear..p0.len());
        let of = |part: &std::ops::Range<usize>, number: &dyn Fn(usize) -> f64| {
            part.clone().map(|k| number(k) * number(k)).sum::<f64>().sqrt()
        };
        // The cubic with the rates at the ends has these accelerations there.
        let cubic = |part: &std::ops::Range<usize>| {
            let secant = |k: usize| way[k] * (6.0 / h);
            let first = of(part, &|k| secant(k) - 4.0 * p0[k] - 2.0 * p1[k]);
            let last = of(part, &|k| 2.0 * p0[k] + 4.0 * p1[k] - secant(k));
            2.0 * first.max(last) / h
        };
        let acceleration = cubic(&linear);
        let turn = match kind.turning {
            Turning::None => 0.0,
            Turning::Angle => cubic(&angular),
            // The way between two orientations does not tell whole turns.
            Turning::Rotation => 2.0 * of(&angular, &|k| p1[k] - p0[k]) / h,
        };
        let rate = |part: &std::ops::Range<usize>| of(part, &|k| p0[k]).max(of(part, &|k| p1[k]));
        Self {
            speed: rate(&linear) + 0.5 * h * acceleration,
            acceleration,
            spin: rate(&angular) + 0.5 * h * turn,
            turn,
        }
    }

    fn scaled(&self, factor: f64) -> Self {
        let Self { speed, acceleration, spin, turn } = self;
        Self {
            speed: speed * factor,
            acceleration: acceleration * factor,
            spin: spin * factor,
            turn: turn * factor,
        }
    }
}

/// A bound of |v|²/(2 T), 1/kg, of all points within `radius` (m) of `point`, which is in the frame of body `i`, m, under a kinetic
/// energy T of the tree: 1/m + l²/I with the mass m and the least principal moment I of the link and the distance l from its
/// centre of mass, since no link has more energy than the tree, whatever its joints do. Infinite where the link, and all that is fixed to it on the way to the root, has no mass or no moment
/// about some axis.
pub fn mobility_bound(
    model: &Model,
    i: usize,
    point: &Vector3<f64>,
    radius: f64,
) -> Result<f64, DynamicsError> {
    model.expect_body(i)?;
    let (mut link, mut point, mut least) = (i, *point, f64::INFINITY);
    loop {
        let of_link = &model.links()[link];
        let mass = of_link.mass_properties();
        let moment = mass.principal_moments().into_iter().fold(f64::INFINITY, f64::min);
        let lever = (point - mass.center).norm() + radius;
        let bound = 1.0 / mass.mass + if lever > 0.0 { lever * lever / moment } else { 0.0 };
        if bound >= 0.0 {
            least = least.min(bound);
        }
        let parent = model.parent(link).filter(|_| *of_link.joint() == Joint::Fixed);
        let Some(parent) = parent else { return Ok(least) };
        point = of_link.placement().point(&point);
        link = parent;
    }
}
