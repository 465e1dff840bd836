//! One phase of a problem of optimal control whose functions were traced.

use super::NAMES;
use super::arguments::intervals_of;
use super::external::{GivenFunction, Recorded};
use super::result::Subject;
use crate::core::error::Error;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use somersault::core::cancel::CancellationToken;
use somersault::ocp::collocation::{CollocationError, Guess, Interval, Phase, Problem, TreeDynamics};
use std::sync::Arc;

/// What `ControlProblem` is made of, once its functions are traced.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct TracedPhase {
    dynamics: Dynamics,
    /// L with path constraints.
    path: Recorded,
    /// Φ with end constraints.
    ends: Recorded,
    pub(super) subject: Subject,
    bounds: Bounds,
    scales: Option<(Vec<f64>, Vec<f64>)>,
}

enum Dynamics {
    Function(Recorded),
    /// Forces at the degrees of freedom, and what else has a rate.
    Tree {
        dynamics: Box<TreeDynamics>,
        further: Recorded,
    },
}

struct Bounds {
    states: Vec<Interval>,
    controls: Vec<Interval>,
    parameters: Vec<Interval>,
    initial: Vec<Interval>,
    last: Vec<Interval>,
    path: Vec<Interval>,
    ends: Vec<Interval>,
}

type Pairs = Vec<(f64, f64)>;
/// Degrees of freedom with a force, names of states and of controls, the first states of quaternions.
type NamedTree = (Vec<usize>, Vec<String>, Vec<String>, Vec<usize>);

/// An error in the words of Python, which name an entry of the path by its number.
pub(super) fn named(error: Error) -> Error {
    error.with_names(&NAMES)
}

impl TracedPhase {
    /// The phase on a horizon. Functions that are not traced look at the token.
    pub(super) fn phase(
        &self,
        [start, end]: [Interval; 2],
        guess: Option<Guess>,
        token: &Arc<CancellationToken>,
    ) -> Result<Phase, Error> {
        let (bounds, subject) = (&self.bounds, &self.subject);
        let [m, n_parameters] = [subject.controls.len(), subject.parameters.len()];
        let mut phase = match &self.dynamics {
            Dynamics::Function(dynamics) if self.untraced().next().is_none() => {
                let functions = [&dynamics.function, &self.path.function, &self.ends.function];
                Phase::try_traced(functions, m, n_parameters)?
            }
            Dynamics::Function(dynamics) => {
                Phase::with_derivatives(dynamics.built(token)?, m, n_parameters, ())
                    .terms_with_derivatives(self.path.built(token)?, self.ends.built(token)?)
            }
            Dynamics::Tree { dynamics, further } => {
                let tree = TreeDynamics::clone(dynamics);
                Phase::of_tree_with(tree, further.built(token)?, n_parameters, ())
                    .terms_with_derivatives(self.path.built(token)?, self.ends.built(token)?)
                    .beginning_with(dynamics)
            }
        };
        phase = phase
            .names(subject.states.clone(), subject.controls.clone())
            .state_bounds(bounds.states.clone())
            .control_bounds(bounds.controls.clone())
            .parameter_bounds(bounds.parameters.clone())
            .initial_state(bounds.initial.clone())
            .final_state(bounds.last.clone())
            .horizon(start, end)
            .path_bounds(bounds.path.clone())
            .end_bounds(bounds.ends.clone());
        if let Some((states, controls)) = &self.scales {
            phase = phase.scales(states.clone(), controls.clone());
        }
        Ok(match guess {
            Some(guess) => phase.guess(guess),
            None => phase,
        })
    }

    /// Names of the functions that are not traced.
    pub(super) fn untraced(&self) -> impl Iterator<Item = &str> {
        let (Dynamics::Function(dynamics) | Dynamics::Tree { further: dynamics, .. }) = &self.dynamics;
        dynamics.names().chain(self.path.names()).chain(self.ends.names())
    }

    /// A path constraint that an end cannot meet: nothing is collocated at the very end, so that a program would leap there. What
    /// is checked are constraints of what is fixed at that end.
    fn check_path(&self, horizon: [Interval; 2]) -> Result<(), Error> {
        let bounds = &self.bounds;
        let jacobian = self.path.function.jacobian()?;
        let mut values = vec![0.0; self.path.function.n_outputs()];
        let n_controls = bounds.controls.len();
        for (argument, end, time) in
            [("initial", &bounds.initial, horizon[0]), ("final", &bounds.last, horizon[1])]
        {
            let free = std::iter::repeat_n(&Interval::FREE, n_controls);
            // what is not traced is not known here
            let returned = std::iter::repeat_n(&Interval::FREE, self.path.n_returned());
            let all: Vec<&Interval> =
                end.iter().chain(free).chain(&bounds.parameters).chain([&time]).chain(returned).collect();
            let mut at: Vec<f64> =
                all.iter().map(|interval| if interval.is_fixed() { interval.lower } else { 0.0 }).collect();
            if let Dynamics::Tree { dynamics, .. } = &self.dynamics {
                dynamics.normalize_given(&mut at, |i| all[i].is_fixed());
            }
            self.path.function.evaluator().evaluate(&at, &mut values).map_err(CollocationError::from)?;
            for (k, (value, allowed)) in values[1..].iter().zip(&bounds.path).enumerate() {
                let mut depends = jacobian.sparsity().entries().filter(|(row, _)| *row == k + 1);
                let rounding = 1e-9 * value.abs().max(1.0);
                if depends.all(|(_, column)| all[column].is_fixed()) && allowed.distance(*value) > rounding {
                    return Err(Error::input(format!(
                        "`path`, value {k}, must be possible at `{argument}`: there it is {value}, and its bounds \
                         are {allowed}"
                    )));
                }
            }
        }
        Ok(())
    }
}

#[pymethods]
impl TracedPhase {
    /// Functions, each with calls of others that are not traced: f, or what has a rate beside the tree; L with path constraints; Φ with
    /// end constraints. A tree with the degrees
    /// of freedom that have a force. Names of states, controls and parameters; bounds of these, of both ends, of path and end
    /// constraints; scales of states and controls. A horizon to check all of that with.
    #[new]
    fn new(
        functions: [GivenFunction; 3],
        tree: Option<(Py<Model>, Vec<usize>)>,
        names: [Vec<String>; 3],
        bounds: [Pairs; 7],
        scales: Option<(Vec<f64>, Vec<f64>)>,
        horizon: [(f64, f64); 2],
    ) -> Result<Self, Error> {
        let [states, controls, parameters] = names;
        let [x, u, p, initial, last, path_bounds, end_bounds] = bounds.map(intervals_of);
        let [dynamics, path, ends] = functions.map(Recorded::try_new);
        let (dynamics, path, ends) = (dynamics?, path?, ends?);
        let model = tree.as_ref().map(|(model, _)| model.get().model.clone());
        let dynamics = match tree {
            None => Dynamics::Function(dynamics),
            Some((model, actuated)) => {
                let tree = TreeDynamics::try_new(&model.get().model, &actuated)?;
                Dynamics::Tree { dynamics: Box::new(tree), further: dynamics }
            }
        };
        let posed = Self {
            dynamics,
            path,
            ends,
            subject: Subject { model, states, controls, parameters },
            bounds: Bounds {
                states: x,
                controls: u,
                parameters: p,
                initial,
                last,
                path: path_bounds,
                ends: end_bounds,
            },
            scales,
        };
        let horizon = horizon.map(|(lower, upper)| Interval::new(lower, upper));
        Problem::try_new(posed.phase(horizon, None, &Arc::default())?)
            .map_err(|error| named(error.into()))?;
        posed.check_path(horizon)?;
        Ok(posed)
    }

    /// The degrees of freedom of a tree that have a force, all of them unless they are given, the names of states and controls, and
    /// which states quaternions begin at.
    #[staticmethod]
    #[pyo3(signature = (model, actuated))]
    fn of_tree(model: &Bound<'_, Model>, actuated: Option<&Bound<'_, PyAny>>) -> Result<NamedTree, Error> {
        let all = 0..model.get().model.n_velocities();
        let chosen: Vec<usize> = match actuated {
            Some(value) => {
                let split = model.get().split(value);
                let named = |error: Error| error.with_names(&[("active", "actuated")]).within("actuated");
                let split = split.map_err(named)?;
                all.filter(|k| split.active()[*k]).collect()
            }
            None => all.collect(),
        };
        let dynamics = TreeDynamics::try_new(&model.get().model, &chosen)?;
        Ok((chosen, dynamics.state_names(), dynamics.control_names(), dynamics.quaternions()))
    }
}
