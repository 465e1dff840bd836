//! A tree with contacts, what drives its joints, and where it starts.

use super::ModelError;
use crate::tree::{LinkContact, TreeInContact};
use somersault_multibody::Model;
use somersault_multibody::motion::{TreeForces, TreeState, TreeSystem};

/// A joint force, the sum of a sine of time, a spring and a damper: τ = τ₀ + τ₁ sin(ω t + φ) − k q − c q̇.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointActuator {
    /// Number of q.
    pub position: usize,
    /// Number of q̇, and of the force.
    pub velocity: usize,
    /// τ₀, N m or N.
    pub mean: f64,
    /// τ₁, N m or N.
    pub amplitude: f64,
    /// ω, rad/s.
    pub rate: f64,
    /// φ, rad.
    pub phase: f64,
    /// k, N m/rad or N/m.
    pub stiffness: f64,
    /// c, N m s/rad or N s/m.
    pub damping: f64,
}

impl JointActuator {
    /// An actuator without force at the joint of a body, which must have a single degree of freedom.
    pub fn at_joint_of(model: &Model, body: &str) -> Result<Self, ModelError> {
        let i = model.body(body)?;
        let found = model.velocities_of(i).len();
        if found != 1 {
            return Err(ModelError::Joint { body: body.to_owned(), found });
        }
        let (position, velocity) = (model.positions_of(i).start, model.velocities_of(i).start);
        Ok(Self { position, velocity, ..Self::default() })
    }

    /// The same with a spring and a damper that hold the joint at θ + Δ sin(ω t + φ).
    #[must_use]
    pub fn holding(self, [stiffness, damping]: [f64; 2], angle: f64, swing: [f64; 3]) -> Self {
        let [amplitude, rate, phase] = swing;
        let (mean, amplitude) = (stiffness * angle, stiffness * amplitude);
        Self { mean, amplitude, rate, phase, stiffness, damping, ..self }
    }

    /// Its force at a time, for q and q̇ of the joint.
    pub fn force(&self, t: f64, q: f64, rate: f64) -> f64 {
        self.mean + self.amplitude * (self.rate * t + self.phase).sin()
            - self.stiffness * q
            - self.damping * rate
    }
}

/// The actuators of a tree: forces of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointActuators(pub Vec<JointActuator>);

impl TreeForces for JointActuators {
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        for actuator in &self.0 {
            let (position, rate) = (q.get(actuator.position), v.get(actuator.velocity));
            if let (Some(&q), Some(&rate), Some(force)) = (position, rate, torque.get_mut(actuator.velocity))
            {
                *force += actuator.force(t, q, rate);
            }
        }
    }
    fn potential(&self, _: &[f64]) -> Option<f64> {
        self.0.is_empty().then_some(0.0)
    }
}

/// A tree with contacts, what drives its joints, and where it starts.
#[derive(Debug, Clone)]
pub struct TreeContactSystem {
    /// The tree.
    pub model: Model,
    /// Its contacts.
    pub contacts: Vec<LinkContact>,
    /// What drives its joints.
    pub actuators: JointActuators,
    /// q at the start.
    pub q: Vec<f64>,
    /// v at the start.
    pub v: Vec<f64>,
}

impl TreeContactSystem {
    /// The state of the tree at the start.
    pub fn start(&self) -> Result<TreeState, ModelError> {
        Ok(self.model.state(&self.q, &self.v)?)
    }

    /// The tree as a system that runs.
    pub fn in_contact(&self) -> Result<TreeInContact<'_, JointActuators>, ModelError> {
        let tree = TreeSystem::new(&self.model, self.actuators.clone());
        Ok(TreeInContact::try_new(tree, self.contacts.clone(), vec![])?)
    }
}
