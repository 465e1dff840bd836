//! Many states of one tree that move side by side, several in the lanes of vector instructions.

use super::{Coordinates, Failure, Rates, TreeForces, TreeState};
use crate::coordinates::Layout;
use crate::data::Data;
use crate::error::DynamicsError;
use crate::many::LaneData;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::argument::expect_length;
use somersault_core::interval::nearest;
use somersault_integrators::system::{Fault, OneForm, System};

/// Copies of one tree that do not see each other, each under forces of its own, as one system.
///
/// Its positions and rates are those of the copies, row by row, and its accelerations are
/// [`forward_dynamics_many`](Model::forward_dynamics_many). An explicit method with fixed steps moves each copy as it would
/// move it alone, to the last bit; adapted steps are common to all copies, and so are what they decide.
///
/// A run ends where a copy has no acceleration, with [`DynamicsError::InState`] as its fault.
///
/// ```
/// use somersault_integrators::{driver::TimeGrid, methods::RungeKuttaMuntheKaas4, run::Run};
/// use somersault_multibody::models::CartPendulum;
/// use somersault_multibody::motion::TreeEnsemble;
///
/// let model = CartPendulum::default().model()?;
/// // springs of four stiffnesses hold four carts
/// let spring = |k: f64| move |_: f64, q: &[f64], _: &[f64], torque: &mut [f64]| torque[0] -= k * q[0];
/// let ensemble = TreeEnsemble::new(&model, [10.0, 20.0, 30.0, 40.0].map(spring));
/// let start = ensemble.state(&[0.0, 0.1].repeat(4), &[0.0; 8])?;
/// let grid = TimeGrid::try_new(0.0, 2.0, 1e-3)?;
/// let end = Run::by_stepper(&ensemble, &RungeKuttaMuntheKaas4, grid).from(&start)?;
/// let q = end.state.configuration.as_slice();
/// assert!(q[1] > 0.1 && q[1] != q[7]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct TreeEnsemble<'m, F = ()> {
    model: &'m Model,
    forces: Vec<F>,
    failure: Failure,
}

/// Room for one evaluation.
#[derive(Debug)]
pub struct EnsembleWorkspace {
    lanes: LaneData,
    /// For the poses that wrenches depend on.
    data: Data,
    v: Vec<f64>,
    acceleration: Vec<f64>,
    torque: Vec<f64>,
    /// Of one copy, and of all; empty where the forces have none.
    own_wrenches: Vec<Force<f64>>,
    wrenches: Vec<f64>,
}

impl<'m, F: TreeForces> TreeEnsemble<'m, F> {
    /// A copy of the tree under each of these forces.
    pub fn new(model: &'m Model, forces: impl Into<Vec<F>>) -> Self {
        Self { model, forces: forces.into(), failure: Failure::default() }
    }

    /// The state with rows of positions and of joint velocities, one for each copy. Quaternions are brought to unit norm.
    pub fn state(&self, q: &[f64], v: &[f64]) -> Result<TreeState, DynamicsError> {
        let (count, n_q, n) = (self.forces.len(), self.model.n_positions(), self.model.n_velocities());
        expect_length("q", q.len(), count * n_q)?;
        expect_length("v", v.len(), count * n)?;
        let (mut q, mut rates) = (q.to_vec(), v.to_vec());
        for i in 0..count {
            let (q, rates) = (&mut q[i * n_q..(i + 1) * n_q], &mut rates[i * n..(i + 1) * n]);
            self.model.normalize(q)?;
            self.model.rates_of(q, rates);
        }
        let factors = (0..count).flat_map(|_| self.model.factors());
        let (configuration, rate) = Layout::new(factors).state(q, rates);
        Ok(TreeState { configuration, rate })
    }

    /// out ← rows of the joint velocities of a state.
    pub fn joint_velocities(&self, x: &TreeState, out: &mut [f64]) -> Result<(), DynamicsError> {
        self.joint_velocities_into((x.configuration.as_slice(), x.rate.as_slice()), out)
    }

    fn joint_velocities_into(&self, (q, p): (&[f64], &[f64]), out: &mut [f64]) -> Result<(), DynamicsError> {
        let (count, n_q, n) = (self.forces.len(), self.model.n_positions(), self.model.n_velocities());
        expect_length("positions of x", q.len(), count * n_q)?;
        expect_length("rates of x", p.len(), count * n)?;
        expect_length("out", out.len(), count * n)?;
        out.copy_from_slice(p);
        for i in 0..count {
            self.model.joint_velocities_of(&q[i * n_q..(i + 1) * n_q], &mut out[i * n..(i + 1) * n]);
        }
        Ok(())
    }

    fn dynamics(&self, w: &mut EnsembleWorkspace, t: f64, q: &[f64], p: &[f64]) -> Result<(), DynamicsError> {
        self.joint_velocities_into((q, p), &mut w.v)?;
        let (n_q, n, n_f) = (self.model.n_positions(), self.model.n_velocities(), 6 * self.model.n_bodies());
        w.torque.fill(0.0);
        for (i, forces) in self.forces.iter().enumerate() {
            let (q, v) = (&q[i * n_q..(i + 1) * n_q], &w.v[i * n..(i + 1) * n]);
            forces.add_torque(t, q, v, &mut w.torque[i * n..(i + 1) * n]);
            if w.wrenches.is_empty() {
                continue;
            }
            w.own_wrenches.fill(Force::zero());
            if let Some(wrenches) = forces.wrenches() {
                let bodies = self.model.velocities(&mut w.data, q, v)?;
                wrenches.add_wrenches(t, &bodies, &mut w.own_wrenches);
            }
            let numbers = w.wrenches[i * n_f..(i + 1) * n_f].chunks_exact_mut(6);
            for (numbers, wrench) in numbers.zip(&w.own_wrenches) {
                numbers[..3].copy_from_slice(wrench.linear.as_slice());
                numbers[3..].copy_from_slice(wrench.angular.as_slice());
            }
        }
        let EnsembleWorkspace { lanes, v, acceleration, torque, wrenches, .. } = w;
        self.model.forward_dynamics_many(lanes, q, v, torque, wrenches, acceleration)
    }
}

impl<F: TreeForces> System for TreeEnsemble<'_, F> {
    type Configuration = Coordinates;
    type Forms = OneForm;
    type Workspace = EnsembleWorkspace;

    fn workspace(&self) -> EnsembleWorkspace {
        let (count, n) = (self.forces.len(), self.model.n_velocities());
        let has_wrenches = self.forces.iter().any(|forces| forces.wrenches().is_some());
        let n_bodies = if has_wrenches { self.model.n_bodies() } else { 0 };
        let numbers = vec![0.0; count * n];
        EnsembleWorkspace {
            lanes: LaneData::new(self.model),
            data: Data::new(self.model),
            v: numbers.clone(),
            acceleration: numbers.clone(),
            torque: numbers,
            own_wrenches: vec![Force::zero(); n_bodies],
            wrenches: vec![0.0; count * 6 * n_bodies],
        }
    }

    fn acceleration(&self, w: &mut EnsembleWorkspace, t: f64, x: &TreeState, out: &mut Rates) {
        let q = x.configuration.as_slice();
        let found = self.dynamics(w, t, q, x.rate.as_slice());
        let out = out.as_mut_slice();
        // one that has no acceleration has NaN, and in the stages to come it alone has none
        let others_have = matches!(found, Ok(()) | Err(DynamicsError::InState { .. }));
        self.failure.keep(found);
        if !others_have {
            return out.fill(f64::NAN);
        }
        let (n_q, n) = (self.model.n_positions(), self.model.n_velocities());
        for i in 0..self.forces.len() {
            let of = i * n..(i + 1) * n;
            let (v, a) = (&w.v[of.clone()], &w.acceleration[of.clone()]);
            self.model.second_rates(&q[i * n_q..(i + 1) * n_q], v, a, &mut out[of]);
        }
    }

    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, self.forces.iter().map(|forces| forces.next_stop(t, end)))
    }

    fn take_fault(&self) -> Option<Fault> {
        self.failure.take()
    }
}
