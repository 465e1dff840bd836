//! Configurations as Python sees them: states as objects, and curves between them.

use crate::integrators::bodies::State;
use crate::integrators::forces::models::states_list;
use pyo3::prelude::*;
use somersault::integrators::augmented::Augmented;
use somersault::integrators::dense::Interpolant;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::solution;
use somersault::integrators::state::{Configuration, Pose, Poses, RigidBodyState, State as StateOf};

/// A configuration of one body or of several, as Python sees it.
pub(crate) trait Seen: Poses {
    /// The state as an object: a `State`, or a list of them.
    fn to_python<'py>(py: Python<'py>, x: &StateOf<Self>) -> PyResult<Bound<'py, PyAny>>
    where
        Self: Configuration;
    /// The states of the bodies.
    fn split(x: &StateOf<Self>) -> Vec<RigidBodyState>
    where
        Self: Configuration;
    /// Curves for dense output.
    fn curves(recorded: solution::Solution<Self>) -> Curves;
    /// The stretches of contacts in a state, where it has any.
    fn stretches(_: &StateOf<Self>) -> &[Vector3<f64>]
    where
        Self: Configuration,
    {
        &[]
    }
}

/// Recorded curves of one body or of several.
pub(crate) enum Curves {
    One(solution::Solution<Pose>),
    Several(solution::Solution<Vec<Pose>>),
}

impl Seen for Pose {
    fn to_python<'py>(py: Python<'py>, x: &RigidBodyState) -> PyResult<Bound<'py, PyAny>> {
        Ok(Bound::new(py, State(*x))?.into_any())
    }
    fn split(x: &RigidBodyState) -> Vec<RigidBodyState> {
        vec![*x]
    }
    fn curves(recorded: solution::Solution<Self>) -> Curves {
        Curves::One(recorded)
    }
}

impl Seen for Vec<Pose> {
    fn to_python<'py>(py: Python<'py>, x: &StateOf<Self>) -> PyResult<Bound<'py, PyAny>> {
        Ok(states_list(py, x)?.into_any())
    }
    fn split(x: &StateOf<Self>) -> Vec<RigidBodyState> {
        (0..x.configuration.len()).filter_map(|i| x.body(i)).collect()
    }
    fn curves(recorded: solution::Solution<Self>) -> Curves {
        Curves::Several(recorded)
    }
}

/// Curves of states with variables beside them, read without these.
struct WithoutVariables<Q: Configuration> {
    curve: Box<dyn Interpolant<Augmented<Q>>>,
    /// How many variables there are.
    count: usize,
}

impl<Q: Configuration> Interpolant<Q> for WithoutVariables<Q> {
    fn evaluate(&self, t: f64, out: &mut StateOf<Q>) {
        let mut whole = StateOf::augmented(out.clone(), vec![Vector3::zeros(); self.count]);
        self.curve.evaluate(t, &mut whole);
        *out = whole.base();
    }
}

impl<Q: Seen> Seen for Augmented<Q> {
    fn to_python<'py>(py: Python<'py>, x: &StateOf<Self>) -> PyResult<Bound<'py, PyAny>> {
        Q::to_python(py, &x.base())
    }
    fn split(x: &StateOf<Self>) -> Vec<RigidBodyState> {
        Q::split(&x.base())
    }
    fn stretches(x: &StateOf<Self>) -> &[Vector3<f64>] {
        x.variables()
    }
    fn curves(recorded: solution::Solution<Self>) -> Curves {
        let solution::Solution { times, states, segments } = recorded;
        let count = states.first().map_or(0, |state| state.variables().len());
        let bare = |(end, curve)| {
            let curve: Box<dyn Interpolant<Q>> = Box::new(WithoutVariables { curve, count });
            (end, curve)
        };
        Q::curves(solution::Solution {
            times,
            states: states.iter().map(|state| state.base()).collect(),
            segments: segments.into_iter().map(bare).collect(),
        })
    }
}
