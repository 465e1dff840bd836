//! The orientation of a tree in flight as a system for the integrators.

use super::{Flight, FlightData};
use crate::coordinates::{Coordinates, Factor, Layout, Rates};
use crate::error::DynamicsError;
use crate::motion::{Failure, TreeState};
use nalgebra::Vector3;
use somersault_core::argument::expect_length;
use somersault_integrators::state::State;
use somersault_integrators::system::{Fault, OneForm, System};

/// The joint motion of a flight: all joints but the root's.
///
/// A closure `Fn(f64, &mut [f64], &mut [f64])` is one.
pub trait ShapeMotion {
    /// Writes positions s and velocities ṡ at time `t`: the numbers of q and v after those of the root.
    fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64]);
}

impl<F: Fn(f64, &mut [f64], &mut [f64])> ShapeMotion for F {
    #[inline]
    fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64]) {
        self(t, q, v);
    }
}

/// Ṙ = R ω̂(t, R), or θ̇ = ω(t) in the plane.
///
/// A state's configuration is the orientation alone, its rate is not used and stays zero; the control of
/// steps counts it as free of error. Methods have the order they have on SO(3) under torque; `sie`,
/// `siabm2` and `siabm4`, which advance the rate first, fall back to order 1.
#[derive(Debug)]
pub struct FlightSystem<'f, S: ?Sized> {
    flight: Flight<'f>,
    shape: &'f S,
    failure: Failure,
}

/// Room for one evaluation.
#[derive(Debug, Clone)]
pub struct FlightWorkspace {
    pub(super) data: FlightData,
    pub(super) q: Vec<f64>,
    pub(super) v: Vec<f64>,
}

impl FlightWorkspace {
    pub(super) fn new(flight: &Flight<'_>) -> Self {
        let model = flight.model();
        Self { data: FlightData::new(model), q: model.neutral(), v: vec![0.0; model.n_velocities()] }
    }

    /// Sets the orientation of the root and the shape at time `t`.
    pub(super) fn pose(
        &mut self,
        flight: &Flight<'_>,
        shape: &(impl ShapeMotion + ?Sized),
        t: f64,
        orientation: &[f64],
    ) -> Result<(), DynamicsError> {
        let at = flight.orientation();
        expect_length("orientation", orientation.len(), at.len())?;
        let (end, n_root) = (at.end, flight.n_root());
        self.q[at].copy_from_slice(orientation);
        shape.evaluate(t, &mut self.q[end..], &mut self.v[n_root..]);
        Ok(())
    }
}

impl Flight<'_> {
    /// The factor of the orientation, its numbers brought to unit norm, and the dimension of its rate.
    pub(super) fn first_factor(
        &self,
        orientation: &[f64],
    ) -> Result<(Factor, Vec<f64>, usize), DynamicsError> {
        let at = self.orientation();
        expect_length("orientation", orientation.len(), at.len())?;
        let mut q = self.model().neutral();
        q[at.clone()].copy_from_slice(orientation);
        self.model().normalize(&mut q)?;
        let orientation = q[at].to_vec();
        Ok(if self.is_planar { (Factor::Angle, orientation, 1) } else { (Factor::Rotation, orientation, 3) })
    }

    /// The components of an angular velocity that count.
    pub(super) fn components<'v>(&self, angular: &'v Vector3<f64>) -> &'v [f64] {
        if self.is_planar { &angular.as_slice()[2..] } else { angular.as_slice() }
    }
}

impl<'f, S: ShapeMotion + ?Sized> FlightSystem<'f, S> {
    /// The flight with its joint motion.
    pub fn new(flight: Flight<'f>, shape: &'f S) -> Self {
        Self { flight, shape, failure: Failure::default() }
    }

    /// The flight.
    pub fn flight(&self) -> &Flight<'f> {
        &self.flight
    }

    /// The state with the root at an `orientation`: a quaternion x, y, z, w as in q, or an angle.
    pub fn state(&self, orientation: &[f64]) -> Result<TreeState, DynamicsError> {
        let (factor, numbers, n) = self.flight.first_factor(orientation)?;
        let (configuration, rate) = Layout::new([factor]).state(numbers, vec![0.0; n]);
        Ok(State { configuration, rate })
    }

    /// Positions q and velocities v of the whole tree at time `t`.
    pub fn complete<'w>(
        &self,
        w: &'w mut FlightWorkspace,
        t: f64,
        x: &TreeState,
    ) -> Result<(&'w [f64], &'w [f64]), DynamicsError> {
        w.pose(&self.flight, self.shape, t, x.configuration.as_slice())?;
        self.flight.complete(&mut w.data, t, &mut w.q, &mut w.v)?;
        Ok((&w.q, &w.v))
    }
}

impl<S: ShapeMotion + ?Sized> System for FlightSystem<'_, S> {
    type Configuration = Coordinates;
    type Forms = OneForm;
    type Workspace = FlightWorkspace;

    fn workspace(&self) -> FlightWorkspace {
        FlightWorkspace::new(&self.flight)
    }

    fn velocity(&self, w: &mut FlightWorkspace, t: f64, x: &TreeState, out: &mut Rates) {
        let posed = w.pose(&self.flight, self.shape, t, x.configuration.as_slice());
        let found = posed.and_then(|()| self.flight.angular_velocity(&mut w.data, &w.q, &w.v));
        match self.failure.keep(found) {
            Some(angular) => out.as_mut_slice().copy_from_slice(self.flight.components(&angular)),
            None => out.as_mut_slice().fill(f64::NAN),
        }
    }

    fn acceleration(&self, _: &mut FlightWorkspace, _: f64, _: &TreeState, out: &mut Rates) {
        out.as_mut_slice().fill(0.0);
    }

    fn take_fault(&self) -> Option<Fault> {
        self.failure.take()
    }
}
