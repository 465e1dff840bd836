//! ẋ = f(t, x) on ℝⁿ as a system for the integrators.

use super::function::VectorFunction;
use super::problem::Phase;
use super::solution::{PhaseSolution, combine};
use somersault_integrators::nalgebra::Vector3;
use somersault_integrators::scratch::{OnHeap, Storage};
use somersault_integrators::state::{Configuration, ErrorSum, Rate, State, Tolerances};
use somersault_integrators::system::{OneForm, System};
use somersault_nlp::EvaluationError;
use std::cell::RefCell;

/// A point of ℝⁿ, or its rate. Each number is weighed by itself.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Vector(pub(crate) Vec<f64>);

impl Storage for Vector {
    type Allocation = OnHeap;
}

impl Vector {
    fn axpy(&mut self, a: f64, x: &Self) {
        self.0.iter_mut().zip(&x.0).for_each(|(s, x)| *s += a * x);
    }

    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        for ((a, b), e) in self.0.iter().zip(&other.0).zip(&error.0) {
            sum.add(&Vector3::new(*e, 0.0, 0.0), a.abs().max(b.abs()), tolerances);
        }
    }
}

impl Rate for Vector {
    fn dimension(&self) -> usize {
        self.0.len()
    }
    fn write(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.0);
    }
    fn read(&mut self, numbers: &[f64]) {
        self.0.copy_from_slice(numbers);
    }
    fn assign(&mut self, other: &Self) {
        self.0.copy_from_slice(&other.0);
    }
    fn set_zero(&mut self) {
        self.0.fill(0.0);
    }
    fn scale(&mut self, a: f64) {
        self.0.iter_mut().for_each(|x| *x *= a);
    }
    fn axpy(&mut self, a: f64, x: &Self) {
        Vector::axpy(self, a, x);
    }
    fn add_bracket(&mut self, _: f64, _: &Self, _: &Self) {}
    fn dexp_inv(&mut self, _: &Self) {}
    fn angle(&self) -> f64 {
        0.0
    }
    fn is_finite(&self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        Vector::weigh(self, other, error, tolerances, sum);
    }
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        Vector::weigh(self, other, error, tolerances, sum);
    }
}

impl Configuration for Vector {
    type Rate = Self;
    fn assign(&mut self, other: &Self) {
        self.0.copy_from_slice(&other.0);
    }
    fn drift(&mut self, rate: &Self, h: f64) {
        Vector::axpy(self, h, rate);
    }
    fn difference(&self, from: &Self, out: &mut Self) {
        for (o, (a, b)) in out.0.iter_mut().zip(self.0.iter().zip(&from.0)) {
            *o = a - b;
        }
    }
    fn renormalize(&mut self) {}
    fn is_finite(&self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        Vector::weigh(self, other, error, tolerances, sum);
    }
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        Vector::weigh(self, other, error, tolerances, sum);
    }
}

/// A phase driven by the controls of a solution in one of its intervals: x, and with it ∫ L dt. Where it has no
/// value it gives NaN and keeps the reason.
pub(super) struct DrivenPhase<'a> {
    solution: &'a PhaseSolution,
    interval: usize,
    inner: RefCell<Inner<'a>>,
}

struct Inner<'a> {
    phase: &'a mut Phase,
    arguments: Vec<f64>,
    basis: Vec<f64>,
    path: Vec<f64>,
    failure: Option<EvaluationError>,
}

impl<'a> DrivenPhase<'a> {
    pub(super) fn new(phase: &'a mut Phase, solution: &'a PhaseSolution, interval: usize) -> Self {
        let inner = Inner {
            arguments: vec![0.0; phase.sizes.point()],
            basis: vec![0.0; solution.grid.intervals[interval].radau.len()],
            path: vec![0.0; phase.path.n_outputs()],
            failure: None,
            phase,
        };
        Self { solution, interval, inner: RefCell::new(inner) }
    }

    /// Why there was no value, if there was none.
    pub(super) fn into_failure(self) -> Option<EvaluationError> {
        self.inner.into_inner().failure
    }
}

impl System for DrivenPhase<'_> {
    type Configuration = Vector;
    type Forms = OneForm;
    type Workspace = ();
    fn workspace(&self) {}

    fn velocity(&self, (): &mut (), t: f64, x: &State<Vector>, out: &mut Vector) {
        let Self { solution, interval, inner } = self;
        let Inner { phase, arguments, basis, path, failure } = &mut *inner.borrow_mut();
        let interval = &solution.grid.intervals[*interval];
        interval.radau.control_basis(interval.local(solution.horizon.fraction(t)), basis);
        let sizes = phase.sizes;
        let (state, rest) = arguments.split_at_mut(sizes.states);
        let (control, rest) = rest.split_at_mut(sizes.controls);
        let (parameters, time) = rest.split_at_mut(sizes.parameters);
        state.copy_from_slice(&x.configuration.0[..sizes.states]);
        combine(&solution.controls[interval.first..], basis, control);
        parameters.copy_from_slice(&solution.parameters);
        time[0] = t;
        let done = phase
            .dynamics
            .evaluate(arguments, &mut out.0[..sizes.states])
            .and_then(|()| phase.path.evaluate(arguments, path));
        out.0[sizes.states] = path[0];
        if let Err(error) = done {
            out.0.fill(f64::NAN);
            *failure = Some(error);
        }
    }

    fn acceleration(&self, (): &mut (), _: f64, _: &State<Vector>, out: &mut Vector) {
        out.set_zero();
    }
}
