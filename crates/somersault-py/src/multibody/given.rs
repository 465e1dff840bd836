//! Numbers of the degrees of freedom of a tree, as they are, at knots of time or by a callable.

use crate::core::callable::{Failure, call, callable_name, noted};
use crate::core::convert::{finite_all, with_shape};
use crate::core::error::Error;
use crate::multibody::profile::TorqueProfile;
use numpy::PyArray1;
use pyo3::prelude::*;
use somersault::multibody::motion::{self, TreeForces};
use std::sync::atomic::{AtomicU64, Ordering};

/// One number for each degree of freedom, given as such, at knots of time or by a callable ``f(t, q, v)``.
pub(crate) struct Given {
    source: Source,
    failure: Failure,
    calls: AtomicU64,
}

enum Source {
    Numbers(Vec<f64>),
    Profile(motion::TorqueProfile),
    Callable { callable: Py<PyAny>, name: String },
}

impl Given {
    pub(crate) fn extract(
        argument: &str,
        n: usize,
        value: Option<&Bound<'_, PyAny>>,
        failure: &Failure,
    ) -> Result<Self, Error> {
        let source = match value {
            None => Source::Numbers(vec![0.0; n]),
            Some(value) => match value.cast::<TorqueProfile>() {
                Ok(profile) => {
                    let profile = profile.get().profile.clone();
                    let found = profile.values().nrows();
                    if found != n {
                        return Err(Error::input(format!(
                            "`{argument}` must have {n} joint forces, found a TorqueProfile of {found}"
                        )));
                    }
                    Source::Profile(profile)
                }
                Err(_) if value.is_callable() => {
                    Source::Callable { callable: value.clone().unbind(), name: callable_name(value) }
                }
                Err(_) => Source::Numbers(finite_all(argument, with_shape(argument, &[n], value)?)?),
            },
        };
        Ok(Self { source, failure: failure.clone(), calls: AtomicU64::new(0) })
    }

    /// Accelerations of driven degrees of freedom. They have no knots: steps end at the knots of forces only.
    pub(crate) fn accelerations(
        n: usize,
        value: Option<&Bound<'_, PyAny>>,
        failure: &Failure,
    ) -> Result<Self, Error> {
        let found = Self::extract("acceleration", n, value, failure)?;
        if found.has_knots() {
            return Err(Error::input("`acceleration` must be numbers or a callable, found a TorqueProfile"));
        }
        Ok(found)
    }

    pub(crate) fn is_callable(&self) -> bool {
        matches!(self.source, Source::Callable { .. })
    }

    /// Whether they are given at knots, at which they are not smooth.
    pub(crate) fn has_knots(&self) -> bool {
        matches!(self.source, Source::Profile(_))
    }

    /// How often the numbers were asked.
    pub(crate) fn calls(&self) -> u64 {
        self.calls.load(Ordering::Relaxed)
    }

    /// Writes `write`(number given) to every entry.
    pub(crate) fn apply(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64], write: impl Fn(&mut f64, f64)) {
        self.calls.fetch_add(1, Ordering::Relaxed);
        let all = |out: &mut [f64], numbers: &[f64]| {
            out.iter_mut().zip(numbers).for_each(|(out, x)| write(out, *x));
        };
        match &self.source {
            Source::Numbers(numbers) => all(out, numbers),
            Source::Profile(profile) => {
                out.iter_mut().zip(profile.forces(t)).for_each(|(out, force)| write(out, force));
            }
            Source::Callable { callable, name } => {
                let found = call(&self.failure, vec![f64::NAN; out.len()], |py| {
                    let arguments = (t, PyArray1::from_slice(py, q), PyArray1::from_slice(py, v));
                    let what = format!("{name}(t, q, v)");
                    let returned = callable.call1(py, arguments);
                    let returned = noted(py, returned, || format!("{what} at t = {t}"))?;
                    finite_all(&what, with_shape(&what, &[v.len()], returned.bind(py))?)
                });
                all(out, &found);
            }
        }
    }
}

impl TreeForces for &Given {
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        self.apply(t, q, v, torque, |sum, x| *sum += x);
    }
    fn depends_on_state(&self) -> bool {
        self.is_callable()
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        match &self.source {
            Source::Profile(profile) => profile.next_stop(t, end),
            Source::Numbers(_) | Source::Callable { .. } => None,
        }
    }
    fn potential(&self, _: &[f64]) -> Option<f64> {
        match &self.source {
            Source::Numbers(numbers) if numbers.iter().all(|x| *x == 0.0) => Some(0.0),
            Source::Numbers(_) | Source::Profile(_) | Source::Callable { .. } => None,
        }
    }
}

/// The accelerations of driven degrees of freedom, as what drives a tree.
pub(crate) fn drive(accelerations: &Given) -> impl Fn(f64, &[f64], &[f64], &mut [f64]) {
    |t, q, v, out| accelerations.apply(t, q, v, out, |out, x| *out = x)
}
