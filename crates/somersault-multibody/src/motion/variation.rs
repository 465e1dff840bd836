//! First variations of the motion of a tree: what its accelerations do along a tangent to its state.

use super::{Coordinates, Rates, TreeForces, TreeSystem, TreeWorkspace};
use crate::data::Data;
use crate::derivatives::{DerivativeData, Varying};
use crate::model::Model;
use crate::spatial::{Force, Motion};
use somersault_integrators::state::{Configuration, Twist};
use somersault_integrators::variation::Tangent;

/// Room for the derivative of the accelerations of a tree in one state, by the analytic partials of its dynamics; forces
/// other than the weight and the damping of joints are differentiated by central differences.
///
/// It is used in the order [`linearize`](TreeSystem::linearize), then for each tangent [`vary`](TreeSystem::vary), what acts
/// besides ([`push`](Self::push), [`torque_mut`](Self::torque_mut)), and
/// [`acceleration_change`](TreeSystem::acceleration_change).
#[derive(Debug, Clone)]
pub struct TreeVariation {
    work: DerivativeData,
    v: Vec<f64>,
    acceleration: Vec<f64>,
    /// The motion of the joints along the tangent, the change of their velocities, that of their forces, and of accelerations.
    way: Vec<f64>,
    rate: Vec<f64>,
    torque: Vec<f64>,
    change: Vec<f64>,
    /// Changes of wrenches on the bodies, body axes.
    wrenches: Vec<Force<f64>>,
    room: Vec<Varying>,
    links: Vec<Tangent<Twist>>,
    ends: Ends,
}

/// Room for differences.
#[derive(Debug, Clone)]
struct Ends {
    data: Data,
    moved: Option<Coordinates>,
    v: Vec<f64>,
    torque: Vec<f64>,
    wrenches: Vec<Force<f64>>,
}

impl TreeVariation {
    fn new(model: &Model) -> Self {
        let (n, bodies) = (model.n_velocities(), model.n_bodies());
        let none = vec![0.0; n];
        let wrenches = vec![Force::zero(); bodies];
        Self {
            work: DerivativeData::new(model),
            v: none.clone(),
            acceleration: none.clone(),
            way: none.clone(),
            rate: none.clone(),
            torque: none.clone(),
            change: none.clone(),
            room: vec![[Motion::zero(); 2]; bodies],
            links: vec![Tangent::default(); bodies],
            ends: Ends {
                data: Data::new(model),
                moved: None,
                v: none.clone(),
                torque: none,
                wrenches: wrenches.clone(),
            },
            wrenches,
        }
    }

    /// The tangents of the frames of the links, world axes.
    pub fn links(&self) -> &[Tangent<Twist>] {
        &self.links
    }

    /// Adds a change of the wrench on body `link`, in body axes about its origin.
    pub fn push(&mut self, link: usize, change: &Force<f64>) {
        if let Some(wrench) = self.wrenches.get_mut(link) {
            *wrench += *change;
        }
    }

    /// The changes of the joint forces.
    pub fn torque_mut(&mut self) -> &mut [f64] {
        &mut self.torque
    }

    /// Along no tangent, so that only what acts besides changes accelerations.
    pub fn rest(&mut self) {
        self.way.fill(0.0);
        self.rate.fill(0.0);
        self.torque.fill(0.0);
        self.wrenches.fill(Force::zero());
    }
}

impl<F: TreeForces> TreeSystem<'_, F> {
    /// Room for the derivative of accelerations.
    pub fn variation(&self) -> TreeVariation {
        TreeVariation::new(self.model())
    }

    /// Linearises the accelerations in the state, and under the wrenches, whose accelerations were the last to be computed in
    /// the workspace `w`; false where there are none.
    pub fn linearize(&self, w: &TreeWorkspace, d: &mut TreeVariation, q: &Coordinates) -> bool {
        d.v.copy_from_slice(&w.v);
        d.acceleration.copy_from_slice(&w.acceleration);
        let model = self.model();
        let found = model.forward_dynamics_partials(&mut d.work, q.as_slice(), &w.v, &w.torque, &w.wrenches);
        self.keep(found.map(|_| ())).is_some()
    }

    /// Goes along a tangent (δq, δp) to the state (q, p): moves the links, and changes the forces of the system.
    pub fn vary(
        &self,
        d: &mut TreeVariation,
        t: f64,
        q: &Coordinates,
        (displacement, change): (&Rates, &Rates),
    ) {
        let model = self.model();
        d.rest();
        let TreeVariation { work, v, way, rate, room, links, .. } = d;
        model.joint_tangent_into((q.as_slice(), v), (displacement, change), (way, rate));
        model.vary_links(work, (way, rate), room, links);
        self.vary_forces(d, t, q, displacement);
    }

    /// The changes of joint forces and wrenches, by central differences.
    fn vary_forces(&self, d: &mut TreeVariation, t: f64, q: &Coordinates, displacement: &Rates) {
        let TreeVariation { v, way, rate, torque, wrenches, ends, .. } = d;
        let norm = |numbers: &[f64]| numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
        let reach = |size: f64, change: f64| f64::EPSILON.cbrt() * size.max(1.0) / change;
        let step = reach(norm(q.as_slice()), norm(way)).min(reach(norm(v), norm(rate)));
        if !step.is_finite() {
            return;
        }
        let moved = ends.moved.get_or_insert_with(|| q.clone());
        for step in [step, -step] {
            let weight = 0.5 / step;
            moved.assign(q);
            moved.drift(displacement, step);
            for ((end, v), rate) in ends.v.iter_mut().zip(&*v).zip(&*rate) {
                *end = v + step * rate;
            }
            ends.torque.fill(0.0);
            self.forces().add_torque(t, moved.as_slice(), &ends.v, &mut ends.torque);
            torque.iter_mut().zip(&ends.torque).for_each(|(torque, end)| *torque += weight * end);
            let Some(forces) = self.forces().wrenches() else { continue };
            let bodies = self.model().velocities(&mut ends.data, moved.as_slice(), &ends.v);
            let Some(bodies) = self.keep(bodies) else { continue };
            ends.wrenches.fill(Force::zero());
            forces.add_wrenches(t, &bodies, &mut ends.wrenches);
            wrenches.iter_mut().zip(&ends.wrenches).for_each(|(wrench, end)| *wrench += *end * weight);
        }
    }

    /// The change of the acceleration of [`System`](somersault_integrators::system::System) along the tangent, with what was
    /// added.
    pub fn acceleration_change(&self, d: &mut TreeVariation, q: &Coordinates, out: &mut Rates) {
        let TreeVariation { work, v, acceleration, way, rate, torque, change, wrenches, .. } = d;
        self.model().add_joint_forces(work, wrenches, torque);
        Model::acceleration_change(work, [way, rate, torque], change);
        let along = (&way[..], &rate[..], &change[..]);
        self.model().second_rates_change(q.as_slice(), (v, acceleration), along, out.as_mut_slice());
    }
}
