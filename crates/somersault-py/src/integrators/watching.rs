//! Events of users: Python functions of time and state that a run watches.

use crate::core::callable::{Failure, call, callable_name, check_callable, noted};
use crate::core::convert::{a_type, sequence};
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyTuple};
use somersault::integrators::events::{
    Certificate, Direction, Watch, WatchError, WatchProgress, WatchRule, Watched,
};
use somersault::integrators::state::{Configuration, State};

/// Writes the values of all functions at a time and a state.
type Values<Q> = Box<dyn FnMut(f64, &State<Q>, &mut [f64]) + Send>;

/// A watch of Python functions.
pub(crate) type EventWatch<Q> = Watch<Q, Values<Q>>;

/// The events of each function.
pub(crate) struct EventsByFunction<Q: Configuration> {
    /// Times and states.
    pub(crate) each: Vec<(Vec<f64>, Vec<State<Q>>)>,
    /// Whether any may have been missed.
    pub(crate) certificates: Vec<Certificate>,
}

/// For each function, whether no event can have been missed.
pub(crate) fn certified<'py>(py: Python<'py>, certificates: &[Certificate]) -> PyResult<Bound<'py, PyTuple>> {
    PyTuple::new(py, certificates.iter().map(|certificate| *certificate == Certificate::Certified))
}

/// For each function, the first step in which its bound did not suffice, or None.
pub(crate) fn unproved<'py>(py: Python<'py>, certificates: &[Certificate]) -> PyResult<Bound<'py, PyTuple>> {
    PyTuple::new(py, certificates.iter().map(|certificate| pickled(*certificate).1))
}

/// What is written of a certificate: whether there is a bound, and the step in which it did not suffice.
pub(crate) type PickledCertificate = (bool, Option<(f64, f64)>);

pub(crate) fn pickled(certificate: Certificate) -> PickledCertificate {
    match certificate {
        Certificate::Unbounded => (false, None),
        Certificate::Certified => (true, None),
        Certificate::Unproved { from, to } => (true, Some((from, to))),
    }
}

pub(crate) fn unpickled(written: PickledCertificate) -> Certificate {
    match written {
        (false, _) => Certificate::Unbounded,
        (true, None) => Certificate::Certified,
        (true, Some((from, to))) => Certificate::Unproved { from, to },
    }
}

/// What a function of a user is called with, at a time and a state.
pub(crate) type Arguments<Q> = Box<dyn Fn(Python<'_>, f64, &State<Q>) -> PyResult<Py<PyTuple>> + Send>;

/// The functions that `events` names, each with its attributes `terminal`, `direction` and `lipschitz`.
#[derive(Default)]
pub(crate) struct EventFunctions {
    callables: Vec<Py<PyAny>>,
    names: Vec<String>,
    rules: Vec<WatchRule>,
}

impl EventFunctions {
    /// Of one function or a sequence of them, each a callable of that signature.
    pub(crate) fn extract(signature: &str, value: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let mut functions = Self::default();
        match sequence(value).filter(|_| !value.is_callable()) {
            Some(list) => list.try_iter()?.try_for_each(|entry| functions.push(signature, &entry?))?,
            None => functions.push(signature, value)?,
        }
        Ok(functions)
    }

    fn push(&mut self, signature: &str, function: &Bound<'_, PyAny>) -> Result<(), Error> {
        check_callable("events", signature, function)?;
        let name = callable_name(function);
        let rule = WatchRule {
            direction: direction(&name, function.getattr_opt("direction")?)?,
            terminal: terminal(&name, function.getattr_opt("terminal")?)?,
            lipschitz: lipschitz(&name, function.getattr_opt("lipschitz")?)?,
        };
        self.callables.push(function.clone().unbind());
        self.names.push(name);
        self.rules.push(rule);
        Ok(())
    }

    /// The same functions.
    pub(crate) fn clone_ref(&self, py: Python<'_>) -> Self {
        Self {
            callables: self.callables.iter().map(|callable| callable.clone_ref(py)).collect(),
            names: self.names.clone(),
            rules: self.rules.clone(),
        }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.rules.len()
    }

    /// How a message calls the function of that number.
    pub(crate) fn name(&self, function: usize) -> String {
        format!("`events[{function}]` ({})", self.names.get(function).map_or("", String::as_str))
    }

    /// Whether events may have been missed so far; none before the first step.
    pub(crate) fn certificates(&self, progress: Option<&WatchProgress>) -> Vec<Certificate> {
        let at_start = |rule: &WatchRule| Certificate::at_start(rule);
        progress.map_or_else(
            || self.rules.iter().map(at_start).collect(),
            |progress| progress.certificates().to_vec(),
        )
    }

    /// A watch of them; what they raise is kept in `failure`.
    pub(crate) fn watch<Q: Configuration>(
        &self,
        py: Python<'_>,
        arguments: Arguments<Q>,
        failure: &Failure,
    ) -> EventWatch<Q> {
        let callables: Vec<_> = self.callables.iter().map(|callable| callable.clone_ref(py)).collect();
        let names: Vec<_> = (0..self.len()).map(|i| self.name(i)).collect();
        let failure = failure.clone();
        let values = move |t: f64, x: &State<Q>, out: &mut [f64]| {
            let found = call(&failure, Vec::new(), |py| {
                let arguments = arguments(py, t, x)?;
                let each = callables.iter().zip(&names);
                each.map(|(callable, name)| {
                    let returned = callable.bind(py).call1(arguments.bind(py));
                    let returned = noted(py, returned, || format!("{name} at t = {t}"))?;
                    returned.extract::<f64>().map_err(|_| {
                        let found = a_type(&returned);
                        Error::input(format!("{name} must return a real number, found {found} at t = {t}"))
                    })
                })
                .collect()
            });
            out.fill(f64::NAN);
            out.iter_mut().zip(found).for_each(|(out, value)| *out = value);
        };
        Watch::new(self.rules.clone(), Box::new(values))
    }

    /// The error of a watch that ended a run.
    pub(crate) fn error(&self, reason: &WatchError) -> Error {
        match reason {
            WatchError::NonFinite { function, t, found } => {
                let name = self.name(*function);
                Error::input(format!("{name} must return a finite number, found {found} at t = {t}"))
            }
            WatchError::Violated { function, lipschitz, times, values } => {
                let name = self.name(*function);
                Error::input(format!(
                    "`lipschitz` = {lipschitz} of {name} is too small: it changes from {} to {} between t = {} and {}",
                    values.0, values.1, times.0, times.1
                ))
            }
            WatchError::Integrate(_) | WatchError::Lipschitz { .. } | WatchError::Unproved { .. } => {
                reason.clone().into()
            }
        }
    }

    /// The events by function.
    pub(crate) fn sorted<Q: Configuration>(&self, found: Watched<Q>) -> EventsByFunction<Q> {
        let mut each: Vec<_> = (0..self.len()).map(|_| (Vec::new(), Vec::new())).collect();
        for event in found.occurrences {
            let (times, states) = &mut each[event.function];
            times.push(event.t);
            states.push(event.state);
        }
        EventsByFunction { each, certificates: found.certificates }
    }
}

/// The sign of an attribute `direction`.
fn direction(name: &str, value: Option<Bound<'_, PyAny>>) -> Result<Direction, Error> {
    let Some(value) = value else { return Ok(Direction::Both) };
    match value.extract::<f64>() {
        Ok(sign) if sign > 0.0 => Ok(Direction::Rising),
        Ok(sign) if sign < 0.0 => Ok(Direction::Falling),
        Ok(0.0) => Ok(Direction::Both),
        Ok(_) | Err(_) => Err(Error::input(format!(
            "`direction` of the event function {name} must be 1, -1 or 0, found {}",
            value.repr()?
        ))),
    }
}

/// After how many events an attribute `terminal` ends the run.
fn terminal(name: &str, value: Option<Bound<'_, PyAny>>) -> Result<Option<u64>, Error> {
    let Some(value) = value.filter(|value| !value.is_none()) else { return Ok(None) };
    if let Ok(ends) = value.extract::<bool>() {
        return Ok(ends.then_some(1));
    }
    match value.extract::<i64>() {
        Ok(count) if count >= 0 => Ok(u64::try_from(count).ok().filter(|count| *count > 0)),
        Ok(_) | Err(_) => Err(Error::input(format!(
            "`terminal` of the event function {name} must be a bool or a number of events, found {}",
            value.repr()?
        ))),
    }
}

/// The bound of an attribute `lipschitz`.
fn lipschitz(name: &str, value: Option<Bound<'_, PyAny>>) -> Result<Option<f64>, Error> {
    let Some(value) = value.filter(|value| !value.is_none()) else { return Ok(None) };
    match value.extract::<f64>() {
        Ok(bound) if bound >= 0.0 && bound.is_finite() && !value.is_instance_of::<PyBool>() => {
            Ok(Some(bound))
        }
        Ok(_) | Err(_) => Err(Error::input(format!(
            "`lipschitz` of the event function {name} must be a finite number that is not negative, found {}",
            value.repr()?
        ))),
    }
}
