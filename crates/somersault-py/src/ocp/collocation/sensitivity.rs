//! How a solution moves with what is given.

use super::result::Subject;
use crate::core::convert::{array, finite};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, counted, few, value};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use somersault::ocp::collocation::{
    End, Guess, PhaseDerivative, Place, Problem, Quantity, SolutionDerivative, SolutionSensitivity as Kernel,
};

/// Derivatives of a solution with respect to what its problem gives: the last axis of each array belongs to `names`.
///
/// A solution moves with its mesh: rows keep their fractions of the duration. Derivatives are exact for the program on that
/// mesh; where a control jumps within an interval, the time of the jump cannot move, and they are coarse. Beyond a change of
/// the active bounds they do not hold.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct SolutionSensitivity {
    names: Vec<String>,
    n_weakly_active: usize,
    derivatives: Vec<(f64, PhaseDerivative)>,
    guess: Guess,
    subject: Subject,
}

/// What is given, by a name of its own, and how the ends of the phase move with it.
fn directions(given: &[Place], subject: &Subject) -> Vec<(String, Vec<(Place, f64)>)> {
    let named = |place: &Place| match (place.quantity, place.end) {
        (Quantity::State(i), End::Start) => {
            (!subject.is_integral(i)).then(|| format!("initial.{}", subject.states[i]))
        }
        (Quantity::State(i), End::Finish) => Some(format!("final.{}", subject.states[i])),
        (Quantity::Time, End::Start) => Some("start_time".to_owned()),
        (Quantity::Time, End::Finish) => Some("duration".to_owned()),
        (Quantity::Parameter(i), _) => Some(subject.parameters[i].clone()),
    };
    let last = given.iter().find(|place| place.quantity == Quantity::Time && place.end == End::Finish);
    let direction = |place: &Place| {
        // the whole phase moves with its start
        let along = last.filter(|_| place.quantity == Quantity::Time && place.end == End::Start);
        [place].into_iter().chain(along).map(|place| (*place, 1.0)).collect()
    };
    given.iter().filter_map(|place| Some((named(place)?, direction(place)))).collect()
}

impl SolutionSensitivity {
    pub(super) fn of(
        report: &somersault::ocp::collocation::CollocationReport,
        problem: &mut Problem,
        subject: Subject,
    ) -> Result<Self, Error> {
        let mut kernel: Kernel<'_> = report.sensitivity(problem)?;
        let (mut names, mut derivatives) = (Vec::new(), Vec::new());
        for (name, direction) in directions(&kernel.given(), &subject) {
            let SolutionDerivative { cost, mut phases } = kernel.derivative(&direction)?;
            names.push(name);
            derivatives.push((cost, phases.swap_remove(0)));
        }
        let guess = report.phases[0].to_guess();
        Ok(Self { names, n_weakly_active: kernel.n_weakly_active(), derivatives, guess, subject })
    }

    /// Tables of all derivatives, interleaved.
    fn tables<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&PhaseDerivative) -> &Vec<Vec<f64>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let k = self.derivatives.len();
        let Some((_, first)) = self.derivatives.first() else {
            return Ok(array(py, Vec::new(), &[0, 0, 0])?.into_any());
        };
        let shape = [of(first).len(), of(first).first().map_or(0, Vec::len), k];
        let mut all = Vec::with_capacity(shape.iter().product());
        for i in 0..shape[0] {
            for j in 0..shape[1] {
                all.extend(self.derivatives.iter().map(|(_, each)| of(each)[i][j]));
            }
        }
        Ok(array(py, all, &shape)?.into_any())
    }

    fn rows<'py>(
        &self,
        py: Python<'py>,
        n: usize,
        of: impl Fn(&PhaseDerivative, usize) -> f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let all = (0..n).flat_map(|i| self.derivatives.iter().map(move |(_, each)| (each, i)));
        let values = all.map(|(each, i)| of(each, i)).collect();
        Ok(array(py, values, &[n, self.derivatives.len()])?.into_any())
    }
}

value! {
    impl SolutionSensitivity {
        /// list of str: What moves: ``'initial.x'`` and ``'final.x'`` for a state x that is given at an end, ``'start_time'``,
        /// ``'duration'``, and parameters that are given.
        names: Vec<String> = |own| own.names.clone();
        /// int: Bounds and constraints that hold by a multiplier near zero, or nearly hold. Where there are any, derivatives are
        /// those of one side.
        n_weakly_active: usize = |own| own.n_weakly_active;
        /// ndarray, shape (n_names,): Derivatives of the cost.
        cost: Bound<'py, PyAny> = |own, py| {
            let values: Vec<f64> = own.derivatives.iter().map(|(cost, _)| *cost).collect();
            numpy::PyArray1::from_vec(py, values).into_any()
        };
        /// ndarray, shape (n + 1, n_states, n_names): Derivatives of the states at the times of the result.
        x: PyResult<Bound<'py, PyAny>> = |own, py| own.tables(py, |each| &each.states);
        /// ndarray, shape (n, n_controls, n_names): Derivatives of the controls.
        u: PyResult<Bound<'py, PyAny>> = |own, py| own.tables(py, |each| &each.controls);
        /// ndarray, shape (n + 1, n_states, n_names): Derivatives of the costates.
        costates: PyResult<Bound<'py, PyAny>> = |own, py| own.tables(py, |each| &each.costates);
        /// ndarray, shape (n_parameters, n_names): Derivatives of the parameters.
        parameters: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, own.guess.parameters.len(), |each, i| each.parameters[i]);
        /// ndarray, shape (2, n_names): Derivatives of the first and the last time.
        horizon: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, 2, |each, i| if i == 0 { each.horizon.0 } else { each.horizon.1 });
    }
}

/// Cost, horizon, states, controls, costates, parameters.
type Derivative = (f64, (f64, f64), Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>);
/// Times, states, controls, parameters.
type Rows = (Vec<f64>, Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>);

#[pymethods]
impl SolutionSensitivity {
    /// The motion where what is given has changed, to first order.
    ///
    /// Parameters
    /// ----------
    /// changes : dict
    ///     How much each of `names` changes; others stay.
    ///
    /// Returns
    /// -------
    /// dict
    ///     A guess for `ControlProblem.solve`: ``"t"``, ``"x"``, ``"u"`` and parameters by name.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> problem = ocp.ControlProblem(
    /// ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",),
    /// ...     initial=[0, 0], final=[1, 0], running_cost=lambda x, u: 0.5 * u.force**2)
    /// >>> moved = problem.sensitivity(problem.solve()).predict({"initial.x": 0.5})
    /// >>> moved["x"][0].round(6) + 0.0
    /// array([0.5, 0. ])
    fn predict<'py>(
        &self,
        py: Python<'py>,
        changes: &Bound<'py, PyDict>,
    ) -> Result<Bound<'py, PyDict>, Error> {
        let mut guess = self.guess.clone();
        for (name, change) in changes {
            let name: String = name.extract()?;
            let Some(k) = self.names.iter().position(|own| *own == name) else {
                let names = self.names.join(", ");
                return Err(Error::input(format!("`changes` must have names among {names}, found '{name}'")));
            };
            let change = finite(&format!("changes['{name}']"), change.extract()?)?;
            guess = self.derivatives[k].1.moved(&guess, change);
        }
        if guess.times.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(Error::input("`changes` must leave a duration above zero"));
        }
        let table = |rows: &[Vec<f64>], n: usize| {
            let all = rows.iter().flat_map(|row| row[..n].to_vec()).collect();
            array(py, all, &[rows.len(), n])
        };
        let found = PyDict::new(py);
        found.set_item("t", numpy::PyArray1::from_slice(py, &guess.times))?;
        found.set_item("x", table(&guess.states, self.subject.n_own_states())?)?;
        found.set_item("u", table(&guess.controls, self.subject.controls.len())?)?;
        for (name, value) in self.subject.parameters.iter().zip(&guess.parameters) {
            found.set_item(name, value)?;
        }
        Ok(found)
    }

    fn __repr__(&self) -> String {
        let weak = match self.n_weakly_active {
            0 => String::new(),
            n => format!(", {} weakly active", counted(n, "bound", "bounds")),
        };
        format!("<SolutionSensitivity: by {}{weak}>", few(&self.names))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let derivatives: Vec<Derivative> = own
            .derivatives
            .iter()
            .map(|(cost, each)| {
                let PhaseDerivative { horizon, states, controls, costates, parameters } = each.clone();
                (*cost, horizon, states, controls, costates, parameters)
            })
            .collect();
        let Guess { times, states, controls, parameters } = own.guess.clone();
        let rows: Rows = (times, states, controls, parameters);
        let subject = &own.subject;
        let of = (subject.states.clone(), subject.controls.clone(), subject.parameters.clone());
        by_restore(slf, (own.names.clone(), own.n_weakly_active, derivatives, rows, of))
    }

    /// Pickled derivatives.
    #[classmethod]
    fn _restore(
        _cls: &Bound<'_, PyType>,
        names: Vec<String>,
        n_weakly_active: usize,
        derivatives: Vec<Derivative>,
        rows: Rows,
        subject: (Vec<String>, Vec<String>, Vec<String>),
    ) -> Result<Self, Error> {
        let (times, states, controls, parameters) = rows;
        let (state_names, control_names, parameter_names) = subject;
        let [n_states, n_controls, n_parameters] =
            [state_names.len(), control_names.len(), parameter_names.len()];
        let fits = |table: &[Vec<f64>], n: usize, width: usize| {
            table.len() == n && table.iter().all(|row| row.len() == width)
        };
        let n = times.len();
        let is_whole = n >= 2
            && names.len() == derivatives.len()
            && fits(&states, n, n_states)
            && fits(&controls, n, n_controls)
            && parameters.len() == n_parameters
            && derivatives.iter().all(|(_, _, x, u, costates, p)| {
                fits(x, n, n_states)
                    && fits(u, n - 1, n_controls)
                    && fits(costates, n, n_states)
                    && p.len() == n_parameters
            });
        if !is_whole {
            return Err(Error::input("`derivatives` must have as many rows and columns as the motion"));
        }
        let derivatives = derivatives
            .into_iter()
            .map(|(cost, horizon, states, controls, costates, parameters)| {
                (cost, PhaseDerivative { horizon, states, controls, costates, parameters })
            })
            .collect();
        let subject = Subject {
            model: None,
            states: state_names,
            controls: control_names,
            parameters: parameter_names,
        };
        let guess = Guess { times, states, controls, parameters };
        Ok(Self { names, n_weakly_active, derivatives, guess, subject })
    }
}
