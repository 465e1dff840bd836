//! Derivatives of the orientation along a flight: the variational equation, beside that of R.
//!
//! A displacement R exp(δθ) of the orientation, in axes of the root, obeys
//!
//! ```text
//! δθ̇ = (∂ω/∂θ − ω̂) δθ + ∂ω/∂L δL + ∂ω/∂s δs + ∂ω/∂ṡ δṡ
//! ```
//! which is integrated for a displacement at the start, for L and for every parameter of the joint motion.

use super::{Flight, FlightWorkspace, ShapeMotion};
use crate::coordinates::{Coordinates, Factor, Layout, Rates};
use crate::error::DynamicsError;
use crate::motion::{Failure, TreeState};
use nalgebra::{DMatrix, DMatrixView, Vector3};
use somersault_core::argument::expect_length;
use somersault_integrators::state::State;
use somersault_integrators::system::{Fault, OneForm, System};

/// A joint motion with parameters.
pub trait ShapeParameters: ShapeMotion {
    /// Number of parameters.
    fn n_parameters(&self) -> usize;

    /// Writes ∂s/∂p and ∂ṡ/∂p at time `t`, a row for each degree of freedom after the root's and a column
    /// for each parameter. Displacements of s are in axes of each joint's child.
    fn differentiate(&self, t: f64, by_position: &mut DMatrix<f64>, by_velocity: &mut DMatrix<f64>);
}

/// The orientation of a tree in flight together with its derivatives.
///
/// Columns: displacement at the start (three, or one in the plane), L in world axes (three), parameters.
#[derive(Debug)]
pub struct FlightSensitivities<'f, S: ?Sized> {
    flight: Flight<'f>,
    shape: &'f S,
    failure: Failure,
}

/// Room for one evaluation.
#[derive(Debug, Clone)]
pub struct SensitivityWorkspace {
    posed: FlightWorkspace,
    by_position: DMatrix<f64>,
    by_velocity: DMatrix<f64>,
}

impl<'f, S: ShapeParameters + ?Sized> FlightSensitivities<'f, S> {
    /// The flight with its joint motion.
    pub fn new(flight: Flight<'f>, shape: &'f S) -> Self {
        Self { flight, shape, failure: Failure::default() }
    }

    /// The flight.
    pub fn flight(&self) -> &Flight<'f> {
        &self.flight
    }

    /// Columns: all there is to differentiate by.
    pub fn n_columns(&self) -> usize {
        self.dimension() + 3 + self.shape.n_parameters()
    }

    /// The state at take-off: an `orientation` as in [`FlightSystem::state`](super::FlightSystem::state),
    /// which is differentiated by itself.
    pub fn state(&self, orientation: &[f64]) -> Result<TreeState, DynamicsError> {
        let (factor, mut numbers, n) = self.flight.first_factor(orientation)?;
        let columns = self.n_columns();
        let mut displacements = DMatrix::zeros(n, columns);
        displacements.fill_diagonal(1.0);
        numbers.extend_from_slice(displacements.as_slice());
        let factors = std::iter::once(factor).chain(std::iter::repeat_n(Factor::Linear(n), columns));
        let (configuration, rate) = Layout::new(factors).state(numbers, vec![0.0; n * (1 + columns)]);
        Ok(State { configuration, rate })
    }

    /// ∂θ of a state, a column for each of [`n_columns`](Self::n_columns): by what the orientation turns
    /// further, in axes of the root.
    ///
    /// Fails for a state that is not of this system.
    pub fn columns<'x>(&self, x: &'x TreeState) -> Result<DMatrixView<'x, f64>, DynamicsError> {
        let (_, displacements) = self.parts(x)?;
        Ok(DMatrixView::from_slice(displacements, self.dimension(), self.n_columns()))
    }

    fn dimension(&self) -> usize {
        if self.flight.is_planar { 1 } else { 3 }
    }

    /// Orientation and displacements.
    fn parts<'x>(&self, x: &'x TreeState) -> Result<(&'x [f64], &'x [f64]), DynamicsError> {
        let numbers = x.configuration.as_slice();
        let n = self.flight.orientation().len();
        expect_length("x", numbers.len(), n + self.dimension() * self.n_columns())?;
        Ok(numbers.split_at(n))
    }

    fn rates(
        &self,
        w: &mut SensitivityWorkspace,
        t: f64,
        x: &TreeState,
        out: &mut Rates,
    ) -> Result<(), DynamicsError> {
        let (orientation, displacements) = self.parts(x)?;
        let SensitivityWorkspace { posed, by_position, by_velocity } = w;
        posed.pose(&self.flight, self.shape, t, orientation)?;
        self.shape.differentiate(t, by_position, by_velocity);
        let found = self.flight.derivatives(&mut posed.data, &posed.q, &posed.v)?;
        let omega = found.angular_velocity;
        let n = self.dimension();
        let (first, rest) = out.as_mut_slice().split_at_mut(n);
        first.copy_from_slice(self.flight.components(&omega));
        for (column, (displacement, rate)) in
            displacements.chunks_exact(n).zip(rest.chunks_exact_mut(n)).enumerate()
        {
            let mut sum = if self.flight.is_planar {
                // a turn about the normal of the plane changes nothing
                Vector3::zeros()
            } else {
                let theta = Vector3::from_column_slice(displacement);
                found.by_orientation * theta - omega.cross(&theta)
            };
            if (n..n + 3).contains(&column) {
                sum += found.by_angular_momentum.column(column - n);
            } else if column >= n + 3 {
                let p = column - n - 3;
                for k in 0..found.by_shape.len() {
                    sum += found.by_shape[k] * by_position[(k, p)];
                    sum += found.by_shape_velocity[k] * by_velocity[(k, p)];
                }
            }
            rate.copy_from_slice(self.flight.components(&sum));
        }
        Ok(())
    }
}

impl<S: ShapeParameters + ?Sized> System for FlightSensitivities<'_, S> {
    type Configuration = Coordinates;
    type Forms = OneForm;
    type Workspace = SensitivityWorkspace;

    fn workspace(&self) -> SensitivityWorkspace {
        let shape = self.flight.model().n_velocities() - self.flight.n_root();
        let partials = DMatrix::zeros(shape, self.shape.n_parameters());
        let posed = FlightWorkspace::new(&self.flight);
        SensitivityWorkspace { posed, by_position: partials.clone(), by_velocity: partials }
    }

    fn velocity(&self, w: &mut SensitivityWorkspace, t: f64, x: &TreeState, out: &mut Rates) {
        let found = self.rates(w, t, x, out);
        if self.failure.keep(found).is_none() {
            out.as_mut_slice().fill(f64::NAN);
        }
    }

    fn acceleration(&self, _: &mut SensitivityWorkspace, _: f64, _: &TreeState, out: &mut Rates) {
        out.as_mut_slice().fill(0.0);
    }

    fn take_fault(&self) -> Option<Fault> {
        self.failure.take()
    }
}
