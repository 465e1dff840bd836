//! Optimal control problems of a user's own, written by dynamics and running cost.

use super::argument::whole;
use super::differences::{Differences, expect_derivative};
use super::dimension::{DIMENSIONS, no_such};
use super::error::input;
use super::run::Run;
use super::system::{Maker, Origin, System};
use super::watched::{Compiled, call, no_value};
use crate::convert::with_shape;
use crate::error::Error;
use crate::plan::check_callable;
use pyo3::prelude::*;
use somersault::ftla::nalgebra::{SMatrix, SVector};
use somersault::ftla::system::{DifferentiatedProblem, ProblemDerivatives, StateCostate};
use std::cmp::Ordering;
use std::sync::Arc;

/// The callables of a problem, and the bounds of its controls.
pub(crate) struct Problem {
    /// `dynamics`, `running_cost`, `jacobian`, `gradient` and `hessian`.
    pub(super) callables: [Py<PyAny>; 5],
    pub(super) n_states: usize,
    pub(super) n_controls: usize,
    /// Lower ones, then upper ones.
    pub(super) bounds: Vec<f64>,
}

const NAMES: [&str; 5] = ["dynamics", "running_cost", "jacobian", "gradient", "hessian"];

/// How far a Hessian may be from symmetric, as a part of its largest entry: differences of first order get there.
const UNEVEN: f64 = 1e-6;

/// A problem in one run. Controls are filled up to as many as there are states with ones that do nothing and cost ½u².
struct Posed {
    problem: Arc<Problem>,
    run: Arc<Run>,
}

impl Posed {
    /// What callable number `which` makes of vectors; NaN once anything has been raised.
    fn call(&self, which: usize, vectors: &[&[f64]], shape: &[usize]) -> Vec<f64> {
        let (name, callable) = (NAMES[which], &self.problem.callables[which]);
        // a control tried at a bound at infinity is no fault of the callable
        if vectors.iter().any(|vector| vector.iter().any(|x| !x.is_finite())) {
            return vec![f64::NAN; shape.iter().product()];
        }
        let arguments = if vectors.len() == 2 { "x, u" } else { "x, u, costate" };
        let found = call(&self.run, name, arguments, callable, vectors, shape);
        let found = found.unwrap_or_else(|| vec![f64::NAN; shape.iter().product()]);
        if let Some(value) = found.iter().find(|x| !x.is_finite()) {
            no_value(&self.run, name, *value);
        }
        found
    }

    /// Holds what the callables give as derivatives against differences, where the run wants it.
    fn check<const NX: usize>(&self, x: &SVector<f64, NX>, costate: &SVector<f64, NX>, u: &[f64]) {
        if !self.run.checks_derivatives() {
            return;
        }
        let width = NX + u.len();
        let at: Vec<f64> = x.iter().chain(u).copied().collect();
        let given = |which: usize, shape: &[usize], at: &[f64]| {
            let found = self.call(which, &[&at[..NX], &at[NX..]], shape);
            found.iter().all(|value| value.is_finite()).then_some(found)
        };
        let slopes = |at: &[f64]| {
            let slopes = self.slopes(&SVector::<f64, NX>::from_column_slice(&at[..NX]), costate, &at[NX..]);
            slopes.iter().all(|value| value.is_finite()).then_some(slopes)
        };
        let of_dynamics = Differences::of(&at, NX, |at| given(0, &[NX], at));
        let of_cost = Differences::of(&at, 1, |at| given(1, &[], at));
        let of_slopes = Differences::of(&at, width, slopes);
        let jacobian = self.call(2, &[x.as_slice(), u], &[NX, width]);
        let gradient = self.call(3, &[x.as_slice(), u], &[width]);
        let (hessian, _) = self.hessian(x, costate, u);
        let expect = |name: &str, of: &str, written: &[f64], found: &Option<Differences>| {
            expect_derivative(&self.run, name, of, written, found.as_ref());
        };
        expect("jacobian(x, u)", "dynamics", &jacobian, &of_dynamics);
        expect("gradient(x, u)", "running_cost", &gradient, &of_cost);
        expect("hessian(x, u, costate)", "costate @ jacobian + gradient", &hessian, &of_slopes);
    }

    /// The Hessian of λᵀf + ℓ by (x, u), row by row, and how long a row is.
    fn hessian<const NX: usize>(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &[f64],
    ) -> (Vec<f64>, usize) {
        let width = NX + u.len();
        let found = self.call(4, &[x.as_slice(), u, costate.as_slice()], &[width, width]);
        let largest = found.iter().fold(0.0, |m: f64, entry| m.max(entry.abs()));
        let pairs = (0..width).flat_map(|i| (0..i).map(move |j| (i, j)));
        for (below, above) in pairs.map(|(i, j)| (found[i * width + j], found[j * width + i])) {
            if (below - above).abs() > UNEVEN * largest && !self.run.is_stopped() {
                let message =
                    format!("`hessian(x, u, costate)` must be symmetric, found {above} and {below}");
                self.run.stop(input(message).into());
            }
        }
        (found, width)
    }

    /// The gradient of λᵀf + ℓ by (x, u).
    fn slopes<const NX: usize>(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &[f64],
    ) -> Vec<f64> {
        let width = NX + u.len();
        let by = self.call(2, &[x.as_slice(), u], &[NX, width]);
        let mut slopes = self.call(3, &[x.as_slice(), u], &[width]);
        for (j, slope) in slopes.iter_mut().enumerate() {
            *slope += (0..NX).map(|i| costate[i] * by[i * width + j]).sum::<f64>();
        }
        slopes
    }
}

impl<const NX: usize> DifferentiatedProblem<NX, NX> for Posed {
    fn rate(&self, x: &SVector<f64, NX>, u: &SVector<f64, NX>) -> SVector<f64, NX> {
        let u = &u.as_slice()[..self.problem.n_controls];
        SVector::from_column_slice(&self.call(0, &[x.as_slice(), u], &[NX]))
    }

    fn cost(&self, x: &SVector<f64, NX>, u: &SVector<f64, NX>) -> f64 {
        let (u, idle) = u.as_slice().split_at(self.problem.n_controls);
        self.call(1, &[x.as_slice(), u], &[])[0] + 0.5 * idle.iter().map(|u| u * u).sum::<f64>()
    }

    fn by_control(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NX>,
    ) -> (f64, SVector<f64, NX>, SMatrix<f64, NX, NX>) {
        let m = self.problem.n_controls;
        let used = &u.as_slice()[..m];
        let value = self.rate(x, u).dot(costate) + self.cost(x, u);
        let slopes = self.slopes(x, costate, used);
        let (second, width) = self.hessian(x, costate, used);
        let gradient = SVector::from_fn(|i, _| if i < m { slopes[NX + i] } else { u[i] });
        let hessian = SMatrix::from_fn(|i, j| match (i < m && j < m, i == j) {
            (true, _) => second[(NX + i) * width + NX + j],
            (false, true) => 1.0,
            (false, false) => 0.0,
        });
        (value, gradient, hessian)
    }

    fn by_state(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NX>,
    ) -> SVector<f64, NX> {
        let used = &u.as_slice()[..self.problem.n_controls];
        self.check(x, costate, used);
        SVector::from_column_slice(&self.slopes(x, costate, used)[..NX])
    }

    fn derivatives(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NX>,
    ) -> ProblemDerivatives<NX, NX> {
        let m = self.problem.n_controls;
        let used = &u.as_slice()[..m];
        self.check(x, costate, used);
        let (second, width) = self.hessian(x, costate, used);
        let by = self.call(2, &[x.as_slice(), used], &[NX, width]);
        let of_control =
            |entry: &[f64], i: usize, j: usize| if j < m { entry[i * width + NX + j] } else { 0.0 };
        ProblemDerivatives {
            f_x: SMatrix::from_fn(|i, j| by[i * width + j]),
            f_u: SMatrix::from_fn(|i, j| of_control(&by, i, j)),
            k_xx: SMatrix::from_fn(|i, j| second[i * width + j]),
            k_xu: SMatrix::from_fn(|i, j| of_control(&second, i, j)),
        }
    }

    fn n_controls(&self) -> usize {
        self.problem.n_controls
    }

    fn control_bounds(&self) -> [SVector<f64, NX>; 2] {
        let Problem { n_controls: m, bounds, .. } = &*self.problem;
        let bound =
            |from: usize, none: f64| SVector::from_fn(|i, _| if i < *m { bounds[from + i] } else { none });
        [bound(0, f64::NEG_INFINITY), bound(*m, f64::INFINITY)]
    }
}

/// The system of a problem, checked.
fn of_problem<const NX: usize, const N: usize>(problem: Arc<Problem>) -> Result<System, Error> {
    let (kept, n_controls) = (Arc::clone(&problem), problem.n_controls);
    let description = format!("problem of {NX} states and {n_controls} controls");
    let make = move |run: &Arc<Run>| -> Result<Compiled<N>, Error> {
        let posed = Posed { problem: Arc::clone(&problem), run: Arc::clone(run) };
        Ok(Arc::new(StateCostate::<_, NX, NX, N>::try_new(posed)?))
    };
    let maker: Maker<N> = Box::new(make);
    Ok(System::made(maker, description, n_controls, Origin::Problem(kept)))
}

/// The state–costate system of a user-defined optimal control problem: minimise ∫ ℓ(x, u) dt subject to dx/dt = f(x, u).
///
/// Any dynamics, any running cost such that λᵀf + ℓ is strictly convex in u, and bounds on the controls: the control that
/// minimises is found by a projected Newton's method, and where it reaches or leaves a bound is located.
///
/// Parameters
/// ----------
/// dynamics : callable
///     ``dynamics(x, u) -> f``, of shape (n_states,).
/// running_cost : callable
///     ``running_cost(x, u) -> float``, ℓ.
/// n_states : int
///     1, 2, 3, 4, 5, 6, 8, 10 or 12.
/// n_controls : int
///     From 1 to n_states.
/// jacobian : callable
///     ``jacobian(x, u)``, of shape (n_states, n_states + n_controls): ∂f/∂(x, u).
/// gradient : callable
///     ``gradient(x, u)``, of shape (n_states + n_controls,): ∂ℓ/∂(x, u).
/// hessian : callable
///     ``hessian(x, u, costate)``, of shape (n_states + n_controls, n_states + n_controls): ∂²(λᵀf + ℓ)/∂(x, u)².
/// control_bounds : array_like, shape (2, n_controls), optional
///     Lower and upper bounds of the controls; infinite ones are none.
///
/// Returns
/// -------
/// System
///
/// Raises
/// ------
/// EvaluationError
///     By whatever calls them, where a callable raises, returns what is not finite, or no control minimises. In a trial of a
///     search what is not finite, or an ``ArithmeticError``, is a step rejected.
/// InputError
///     By whatever calls them, where ``jacobian``, ``gradient`` or ``hessian`` is not the derivative that it must be. They are
///     held against differences at the first points of every calculation and, ever more seldom, at later ones; an entry that is
///     off by 0.1 % is refused.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> system = ftla.state_costate(
/// ...     lambda x, u: -x + u,
/// ...     lambda x, u: 0.5 * (x @ x + u @ u),
/// ...     1,
/// ...     1,
/// ...     jacobian=lambda x, u: [[-1.0, 1.0]],
/// ...     gradient=lambda x, u: [x[0], u[0]],
/// ...     hessian=lambda x, u, costate: np.eye(2),
/// ...     control_bounds=[[-0.2], [0.2]],
/// ... )
/// >>> system.control([[0.0, 0.1], [0.0, 0.4]])
/// array([[-0.1],
///        [-0.2]])
#[pyfunction]
#[pyo3(signature = (
    dynamics, running_cost, n_states, n_controls, *, jacobian, gradient, hessian, control_bounds=None
))]
pub(crate) fn state_costate(
    dynamics: &Bound<'_, PyAny>,
    running_cost: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole::n_states)] n_states: usize,
    #[pyo3(from_py_with = whole::n_controls)] n_controls: usize,
    jacobian: &Bound<'_, PyAny>,
    gradient: &Bound<'_, PyAny>,
    hessian: &Bound<'_, PyAny>,
    control_bounds: Option<&Bound<'_, PyAny>>,
) -> Result<System, Error> {
    if !DIMENSIONS.contains(&n_states.saturating_mul(2)) {
        let allowed = DIMENSIONS.map(|dimension| dimension / 2);
        return Err(input(format!("`n_states` must be one of {allowed:?}, found {n_states}")));
    }
    if !(1..=n_states).contains(&n_controls) {
        return Err(input(format!("`n_controls` must be from 1 to {n_states}, found {n_controls}")));
    }
    let given = [dynamics, running_cost, jacobian, gradient, hessian];
    for (name, callable) in NAMES.into_iter().zip(given) {
        check_callable(name, if name == "hessian" { "of (x, u, costate)" } else { "of (x, u)" }, callable)?;
    }
    let bounds = match control_bounds {
        Some(bounds) => with_shape("control_bounds", &[2, n_controls], bounds)?,
        None => [vec![f64::NEG_INFINITY; n_controls], vec![f64::INFINITY; n_controls]].concat(),
    };
    if let Some(i) =
        (0..n_controls).find(|&i| bounds[i].partial_cmp(&bounds[n_controls + i]) != Some(Ordering::Less))
    {
        let found = [bounds[i], bounds[n_controls + i]];
        return Err(input(format!("`control_bounds` must be a lower below an upper bound, found {found:?}")));
    }
    let callables = given.map(|callable| callable.clone().unbind());
    let problem = Arc::new(Problem { callables, n_states, n_controls, bounds });
    match n_states {
        1 => of_problem::<1, 2>(problem),
        2 => of_problem::<2, 4>(problem),
        3 => of_problem::<3, 6>(problem),
        4 => of_problem::<4, 8>(problem),
        5 => of_problem::<5, 10>(problem),
        6 => of_problem::<6, 12>(problem),
        8 => of_problem::<8, 16>(problem),
        10 => of_problem::<10, 20>(problem),
        12 => of_problem::<12, 24>(problem),
        other => Err(no_such("n_states", other)),
    }
}
