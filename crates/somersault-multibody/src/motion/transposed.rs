//! The transpose of the first variations of a tree: it pulls a covector on the accelerations back to one on the state.

use super::{Coordinates, JointDrive, Rates, TreeForces, TreeSystem, TreeVariation};
use crate::derivatives::{Pulled, TreeParameter};
use crate::model::Model;
use crate::spatial::{Force, Motion};
use somersault_integrators::state::{Rate, Twist};
use somersault_integrators::variation::Tangent;

/// Room for covectors on the accelerations of a tree, in a state in which a [`TreeVariation`] has linearised them.
///
/// The order of calls is [`begin`](Self::begin); [`motions`](Self::motions) and [`add_link`](Self::add_link) for wrenches that act
/// besides; [`along`](Self::along) for each parameter; and [`finish`](Self::finish), which adds the covector on the state. The cost is that
/// of one column of a [`TreeVariation`], and for forces that depend on the state two differences for each degree of freedom besides.
#[derive(Debug, Clone)]
pub struct TreeAdjoint {
    way: Vec<f64>,
    rate: Vec<f64>,
    change: Vec<f64>,
    /// Covectors on joint forces, and on the accelerations of driven joints.
    torque: Vec<f64>,
    given: Vec<f64>,
    /// Motions of the links by the covector on joint forces, body axes: covectors on wrenches.
    motions: Vec<Motion<f64>>,
    /// Covectors on the tangents of the frames of the links, world axes.
    links: Vec<Tangent<Twist>>,
    pulled: Vec<Pulled>,
    /// For differences: a unit motion of the joints and its displacement.
    unit: Vec<f64>,
    still: Vec<f64>,
    displacement: Option<Rates>,
    changes: [Vec<f64>; 2],
    wrenches: Vec<Force<f64>>,
}

impl TreeAdjoint {
    /// Room for a model.
    pub fn new(model: &Model) -> Self {
        let (none, bodies) = (vec![0.0; model.n_velocities()], model.n_bodies());
        Self {
            way: none.clone(),
            rate: none.clone(),
            change: none.clone(),
            torque: none.clone(),
            given: none.clone(),
            motions: vec![Motion::zero(); bodies],
            links: vec![Tangent::default(); bodies],
            pulled: vec![[Force::zero(); 2]; bodies],
            unit: none.clone(),
            still: none.clone(),
            displacement: None,
            changes: [none.clone(), none],
            wrenches: vec![Force::zero(); bodies],
        }
    }

    /// Begins with a covector on the accelerations of [`System`](somersault_integrators::system::System).
    pub fn begin<F: TreeForces, D: JointDrive>(
        &mut self,
        system: &TreeSystem<'_, F, D>,
        d: &mut TreeVariation,
        q: &Coordinates,
        covector: &Rates,
    ) {
        let Self { way, rate, change, torque, given, motions, links, .. } = self;
        let model = system.model();
        let state = (&d.v[..], &d.acceleration[..]);
        model.pull_second_rates_change(q.as_slice(), state, covector.as_slice(), [way, rate, change]);
        let split = system.drive().split();
        Model::pull_acceleration_change(&d.work, split, change, [way, rate], [torque, given]);
        model.link_motions(&mut d.work, torque, motions);
        links.fill(Tangent::default());
    }

    /// The motions of the links by which wrenches on them are weighed, body axes: a wrench that changes by δf changes the sum of the
    /// covector and the accelerations by motion · δf.
    pub fn motions(&self) -> &[Motion<f64>] {
        &self.motions
    }

    /// The same of joint forces.
    pub fn torque(&self) -> &[f64] {
        &self.torque
    }

    /// The sum of the covectors on accelerations and links and of their changes along a parameter of the tree.
    pub fn along<F: TreeForces, D: JointDrive>(
        &mut self,
        system: &TreeSystem<'_, F, D>,
        d: &mut TreeVariation,
        parameter: &TreeParameter,
    ) -> f64 {
        d.rest();
        d.links.fill(Tangent::default());
        system.vary_parameter(d, parameter);
        let by_torque = dot(&d.torque, &self.torque);
        let by_links: f64 = self.links.iter().zip(&d.links).map(|(weight, link)| product(weight, link)).sum();
        let weights = self.motions.iter().zip(&d.wrenches);
        let by_wrench = weights.map(|(motion, wrench)| motion.dot(wrench)).nth(parameter.body());
        by_torque + by_links + by_wrench.unwrap_or(0.0)
    }

    /// Adds a covector on the tangent of the frame of body `link`, world axes.
    pub fn add_link(&mut self, link: usize, weight: f64, covector: &Tangent<Twist>) {
        if let Some(of_link) = self.links.get_mut(link) {
            of_link.displacement.axpy(weight, &covector.displacement);
            of_link.rate.axpy(weight, &covector.rate);
        }
    }

    /// Begins without a covector on the accelerations, for some on the links alone.
    pub fn begin_with_links(&mut self) {
        for numbers in [&mut self.way, &mut self.rate, &mut self.torque, &mut self.given] {
            numbers.fill(0.0);
        }
        self.motions.fill(Motion::zero());
        self.links.fill(Tangent::default());
    }

    /// Adds the covectors on accelerations and on links, pulled back to the displacement and the change of the rate.
    pub fn finish<F: TreeForces, D: JointDrive>(
        &mut self,
        system: &TreeSystem<'_, F, D>,
        d: &mut TreeVariation,
        t: f64,
        q: &Coordinates,
        (displacement, rate): (&mut Rates, &mut Rates),
    ) {
        let model = system.model();
        model.pull_links(&mut d.work, &self.links, &mut self.pulled, (&mut self.way, &mut self.rate));
        self.add_forces(system, d, t, q);
        self.pull(model, (q, &d.v), (displacement, rate));
    }

    /// Adds covectors on the motion of the joints and on the change of their velocities `v`, pulled back to the displacement and the change
    /// of the rate.
    pub fn add_joints(
        &mut self,
        model: &Model,
        (q, v): (&Coordinates, &[f64]),
        (way, change): (&[f64], &[f64]),
        out: (&mut Rates, &mut Rates),
    ) {
        self.way.copy_from_slice(way);
        self.rate.copy_from_slice(change);
        self.pull(model, (q, v), out);
    }

    fn pull(&mut self, model: &Model, (q, v): (&Coordinates, &[f64]), out: (&mut Rates, &mut Rates)) {
        model.pull_joint_tangent((q.as_slice(), v), (&mut self.way, &mut self.rate), out);
    }

    /// The forces that depend on the state, by central differences along each motion of a joint and each velocity.
    fn add_forces<F: TreeForces, D: JointDrive>(
        &mut self,
        system: &TreeSystem<'_, F, D>,
        d: &mut TreeVariation,
        t: f64,
        q: &Coordinates,
    ) {
        let acts = |weights: &[f64]| weights.iter().any(|weight| *weight != 0.0);
        let by_drive = system.is_driven() && acts(&self.given);
        let by_forces = system.forces().depends_on_state() && acts(&self.torque);
        if !(by_drive || by_forces) {
            return;
        }
        let Self { way, rate, torque, given, motions, unit, still, displacement, changes, wrenches, .. } =
            self;
        let displacement = displacement.get_or_insert_with(|| q.still());
        let model = system.model();
        for k in 0..unit.len() {
            unit[k] = 1.0;
            for (moves, out) in [(true, &mut way[k]), (false, &mut rate[k])] {
                let (along, change) = if moves { (&*unit, &*still) } else { (&*still, &*unit) };
                model.displacement_into(q.as_slice(), along, displacement);
                let [of_torque, of_given] = &mut *changes;
                of_torque.fill(0.0);
                of_given.fill(0.0);
                wrenches.fill(Force::zero());
                let into = (&mut of_torque[..], &mut of_given[..], &mut wrenches[..]);
                system.difference(&mut d.ends, t, (q, &d.v), (displacement, along, change), into);
                *out += dot(of_torque, torque) + dot(of_given, given);
                if system.forces().wrenches().is_some() {
                    *out += motions
                        .iter()
                        .zip(&*wrenches)
                        .map(|(motion, change)| motion.dot(change))
                        .sum::<f64>();
                }
            }
            unit[k] = 0.0;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The product of a covector and a tangent.
fn product(covector: &Tangent<Twist>, tangent: &Tangent<Twist>) -> f64 {
    let parts = |of: &Tangent<Twist>| {
        let Tangent { displacement, rate } = *of;
        [displacement.linear, displacement.angular, rate.linear, rate.angular]
    };
    parts(covector).iter().zip(parts(tangent)).map(|(covector, part)| covector.dot(&part)).sum()
}
