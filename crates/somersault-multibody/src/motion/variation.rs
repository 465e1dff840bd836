//! Room for first variations of the motion of a tree.

use super::Coordinates;
use crate::data::Data;
use crate::derivatives::{DerivativeData, Varying};
use crate::model::Model;
use crate::spatial::{Force, Motion};
use somersault_integrators::state::Twist;
use somersault_integrators::variation::Tangent;

/// Room for the derivative of the accelerations of a tree in one state, by the analytic partials of its dynamics; forces
/// other than the weight and the damping of joints are differentiated by central differences.
///
/// It is used in the order [`linearize`](super::TreeSystem::linearize), then for each tangent
/// [`vary`](super::TreeSystem::vary), what acts besides ([`push`](Self::push), [`torque_mut`](Self::torque_mut)), and
/// [`acceleration_change`](super::TreeSystem::acceleration_change).
#[derive(Debug, Clone)]
pub struct TreeVariation {
    pub(super) work: DerivativeData,
    pub(super) v: Vec<f64>,
    pub(super) acceleration: Vec<f64>,
    /// The motion of the joints along the tangent, the change of their velocities, that of their forces, and of accelerations.
    pub(super) way: Vec<f64>,
    pub(super) rate: Vec<f64>,
    pub(super) torque: Vec<f64>,
    pub(super) change: Vec<f64>,
    /// What hybrid dynamics knows of each degree of freedom of a tree with driven joints: force or acceleration.
    pub(super) known: Vec<f64>,
    /// The changes of the accelerations of driven joints.
    pub(super) given: Vec<f64>,
    /// Changes of wrenches on the bodies, body axes.
    pub(super) wrenches: Vec<Force<f64>>,
    pub(super) room: Vec<Varying>,
    pub(super) links: Vec<Tangent<Twist>>,
    pub(super) ends: Ends,
}

/// Room for differences.
#[derive(Debug, Clone)]
pub(super) struct Ends {
    pub(super) data: Data,
    pub(super) moved: Option<Coordinates>,
    pub(super) v: Vec<f64>,
    pub(super) torque: Vec<f64>,
    pub(super) given: Vec<f64>,
    pub(super) wrenches: Vec<Force<f64>>,
}

impl TreeVariation {
    pub(super) fn new(model: &Model) -> Self {
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
            known: none.clone(),
            given: none.clone(),
            room: vec![[Motion::zero(); 2]; bodies],
            links: vec![Tangent::default(); bodies],
            ends: Ends {
                data: Data::new(model),
                moved: None,
                v: none.clone(),
                torque: none.clone(),
                given: none,
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
        self.given.fill(0.0);
        self.wrenches.fill(Force::zero());
    }
}
