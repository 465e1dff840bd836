//! Motions of several phases by direct collocation.

use super::arguments::{ends, pairs};
use super::search::SearchOptions;
use super::{CollocationProblem, MultiphaseResult};
use crate::core::convert::{a_type, integer, integer_or_none};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_class};
use pyo3::prelude::*;
use pyo3::types::PyString;
use somersault::ocp::collocation::{End, Guess, Interval, Linkage, Place, Problem, Quantity};

/// A motion of several phases by direct collocation, one after the other in time.
///
/// The cost is the sum of those of the phases. Phase 0 begins at t = 0, each other one where the one before it ends, and lasts
/// as long as its `duration` says. Between phases k and k + 1 the state may jump:
/// ``lower ≤ x_{k+1}(start) − x_k(end) ≤ upper``, by nothing unless `links` says otherwise.
///
/// Parameters
/// ----------
/// phases : sequence of CollocationProblem
///     Each with its own tree, controls, bounds, costs and ends, with as many states as its neighbours.
/// links : sequence, length n_phases − 1, optional
///     For each pair of neighbours ``'continuous'``, or for each entry of the state a number, a pair of bounds, or None where
///     it may jump as it likes: what the state is at the start of the later phase less what it is at the end of the earlier
///     one. All continuous unless given.
///
/// Raises
/// ------
/// InputError
///     If there is no phase, neighbours have different numbers of states, or a link contradicts the ends that it joins.
///
/// Examples
/// --------
/// From rest to rest over one metre in one second, and 0.3 m from the start after half of it: ½ ∫ u² dt = 9.84.
///
/// >>> import somersault
/// >>> from somersault import multibody, ocp
/// >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
/// >>> model = somersault.Model([block], gravity=(0, 0, 0))
/// >>> first = ocp.CollocationProblem(model, [0, 0], [0.3, None], 0.5)
/// >>> second = ocp.CollocationProblem(model, [None, None], [1, 0], 0.5)
/// >>> found = ocp.MultiphaseProblem([first, second]).solve()
/// >>> found.status, round(found.cost, 6), [round(float(phase.x[-1, 0]), 6) for phase in found.phases]
/// ('converged', 9.84, [0.3, 1.0])
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct MultiphaseProblem {
    phases: Vec<Py<CollocationProblem>>,
    /// For each pair of neighbours what each state may jump by.
    links: Vec<Vec<Interval>>,
}

/// What the states of two neighbours may differ by.
fn link(k: usize, n: usize, value: Option<&Bound<'_, PyAny>>) -> Result<Vec<Interval>, Error> {
    let Some(value) = value else { return Ok(vec![Interval::fixed(0.0); n]) };
    let argument = format!("links[{k}]");
    if let Ok(name) = value.cast::<PyString>() {
        return match name.to_str()? {
            "continuous" => link(k, n, None),
            other => Err(Error::input(format!(
                "`{argument}` must be 'continuous' or have {n} entries, found '{other}'"
            ))),
        };
    }
    let jumps = ends(&argument, n, value)?;
    match jumps.iter().position(|jump| !jump.is_possible()) {
        Some(entry) => Err(Error::input(format!(
            "`{argument}` must have bounds that do not cross and are no NaN, found {} in entry {entry}",
            jumps[entry]
        ))),
        None => Ok(jumps),
    }
}

/// First and last time that a phase may begin and end at.
struct Horizon {
    start: Interval,
    end: Interval,
}

impl MultiphaseProblem {
    fn of(phases: Vec<Py<CollocationProblem>>, links: Vec<Vec<Interval>>) -> Result<Self, Error> {
        let own = Self { phases, links };
        own.check_links()?;
        own.problem(Vec::new())?;
        Ok(own)
    }

    fn check_links(&self) -> Result<(), Error> {
        for (k, jumps) in self.links.iter().enumerate() {
            let (left, right) = (self.phases[k].get(), self.phases[k + 1].get());
            let names = left.subject()?.states;
            for (entry, jump) in jumps.iter().enumerate() {
                let (end, start) = (left.final_state[entry], right.initial_state[entry]);
                let reach = Interval::new(start.lower - end.upper, start.upper - end.lower);
                // what is infinite on both sides has no difference
                if reach.lower > jump.upper || reach.upper < jump.lower {
                    return Err(Error::input(format!(
                        "`phases` must end and begin as `links[{k}]` says: `final_state` of phase {k} and `initial_state` of phase {} \
                         are {end} and {start}, with a difference of {jump} in entry {entry} ({})",
                        k + 1,
                        names[entry]
                    )));
                }
            }
        }
        Ok(())
    }

    fn horizons(&self) -> Vec<Horizon> {
        let mut start = Interval::fixed(0.0);
        let next = |phase: &Py<CollocationProblem>| {
            let duration = phase.get().duration;
            let end = Interval::new(start.lower + duration.lower, start.upper + duration.upper);
            Horizon { start: std::mem::replace(&mut start, end), end }
        };
        self.phases.iter().map(next).collect()
    }

    fn problem(&self, guesses: Vec<Guess>) -> Result<Problem, Error> {
        let horizons = self.horizons();
        let (mut phases, mut linkages) = (Vec::new(), Vec::new());
        let mut guesses = guesses.into_iter();
        let time = |phase, end| Place { phase, end, quantity: Quantity::Time };
        for (k, (phase, Horizon { start, end })) in self.phases.iter().zip(&horizons).enumerate() {
            let own = phase.get();
            phases.push(own.phase(guesses.next())?.horizon(*start, *end));
            if !start.is_fixed() {
                let (left, right) = (time(k, End::Start), time(k, End::Finish));
                linkages.push(Linkage { left, right, difference: own.duration });
                let (left, right) = (time(k - 1, End::Finish), time(k, End::Start));
                linkages.push(Linkage { left, right, difference: Interval::fixed(0.0) });
            }
        }
        for (k, jumps) in self.links.iter().enumerate() {
            let place = |phase, end, i| Place { phase, end, quantity: Quantity::State(i) };
            for (i, jump) in jumps.iter().enumerate().filter(|(_, jump)| **jump != Interval::FREE) {
                let (left, right) = (place(k, End::Finish, i), place(k + 1, End::Start, i));
                linkages.push(Linkage { left, right, difference: *jump });
            }
        }
        Ok(Problem::try_of_phases(phases, linkages)?)
    }

    /// One guess for each phase, each moved to where the one before it ends.
    fn guesses(&self, value: &Bound<'_, PyAny>) -> Result<Vec<Guess>, Error> {
        if let Ok(result) = value.cast::<MultiphaseResult>() {
            let report = &result.as_super().get().report;
            if report.phases.len() != self.phases.len() {
                let (n, found) = (self.phases.len(), report.phases.len());
                return Err(Error::input(format!("`guess` must have {n} phases, found {found}")));
            }
            return Ok(report.phases.iter().map(|phase| phase.to_guess()).collect());
        }
        let refused = |_| {
            let found = a_type(value);
            Error::input(format!("`guess` must be one for each phase or an earlier result, found {found}"))
        };
        let given: Vec<Bound<'_, PyAny>> = value.try_iter().map_err(refused)?.collect::<PyResult<_>>()?;
        if given.len() != self.phases.len() {
            let (n, found) = (self.phases.len(), given.len());
            return Err(Error::input(format!("`guess` must have one for each of {n} phases, found {found}")));
        }
        let mut began = 0.0;
        let mut guesses = Vec::with_capacity(given.len());
        for (k, (phase, value)) in self.phases.iter().zip(&given).enumerate() {
            let argument = format!("guess[{k}]");
            let mut guess =
                phase.get().guess(value).map_err(|error| error.with_names(&[("guess", &argument)]))?;
            let shift = began - guess.times.first().copied().unwrap_or(began);
            guess.times.iter_mut().for_each(|t| *t += shift);
            began = guess.times.last().copied().unwrap_or(began);
            guesses.push(guess);
        }
        Ok(guesses)
    }
}

#[pymethods]
impl MultiphaseProblem {
    #[new]
    #[pyo3(signature = (phases, links=None))]
    fn new(phases: Vec<Py<CollocationProblem>>, links: Option<Vec<Bound<'_, PyAny>>>) -> Result<Self, Error> {
        if phases.is_empty() {
            return Err(Error::input("`phases` must have at least one phase, found none".to_owned()));
        }
        let n_links = phases.len() - 1;
        if let Some(found) = links.as_ref().map(Vec::len).filter(|found| *found != n_links) {
            return Err(Error::input(format!(
                "`links` must have one entry for each of {n_links} pairs of neighbours, found {found}"
            )));
        }
        let sizes: Vec<usize> = phases.iter().map(|phase| phase.get().states.len()).collect();
        if let Some(k) = (0..n_links).find(|k| sizes[*k] != sizes[k + 1]) {
            return Err(Error::input(format!(
                "`phases` must have as many states as their neighbours, found {} and {} in phases {k} and {}",
                sizes[k],
                sizes[k + 1],
                k + 1
            )));
        }
        let joined = |k: usize| link(k, sizes[k], links.as_ref().map(|links| &links[k]));
        let links = (0..n_links).map(joined).collect::<Result<_, Error>>()?;
        Self::of(phases, links)
    }

    /// list of CollocationProblem: The phases.
    #[getter]
    fn phases(&self, py: Python<'_>) -> Vec<Py<CollocationProblem>> {
        self.phases.iter().map(|phase| phase.clone_ref(py)).collect()
    }

    /// Solves, refines the meshes to the tolerance, and integrates what was found again.
    ///
    /// Parameters
    /// ----------
    /// guess : sequence, or MultiphaseResult, optional
    ///     For each phase what `CollocationProblem.solve` takes, of which only differences of times count; or an earlier
    ///     result.
    /// tol, n_intervals, n_points, max_meshes, max_iterations, max_time, callback
    ///     As of `CollocationProblem.solve`; intervals and points are those of each phase.
    /// on_interrupt : {'raise', 'return'}, optional
    ///     What Ctrl-C does: raise with the best iterate as the attribute ``solution``, or return it.
    ///     An iteration that takes longer than 0.4 s is not waited for: KeyboardInterrupt is raised without it.
    ///
    /// Returns
    /// -------
    /// MultiphaseResult
    ///     With the best motion found, whatever the status.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody, ocp
    /// >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
    /// >>> model = multibody.Model([block], gravity=(0, 0, 0))
    /// >>> away = ocp.CollocationProblem(model, [0, 0], [1, None], 1.0)
    /// >>> back = ocp.CollocationProblem(model, [None, None], [0, 0], 1.0)
    /// >>> found = ocp.MultiphaseProblem([away, back]).solve(tol=1e-6)
    /// >>> found.status, round(found.cost, 4)
    /// ('converged', 12.0)
    #[pyo3(signature = (
        guess=None, *, tol=1e-6, n_intervals=40, n_points=4, max_meshes=20, max_iterations=None, max_time=None,
        callback=None, on_interrupt="raise"
    ))]
    fn solve(
        &self,
        py: Python<'_>,
        guess: Option<&Bound<'_, PyAny>>,
        tol: f64,
        #[pyo3(from_py_with = integer)] n_intervals: i64,
        #[pyo3(from_py_with = integer)] n_points: i64,
        #[pyo3(from_py_with = integer)] max_meshes: i64,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<Py<MultiphaseResult>, Error> {
        let sizes = (n_intervals, n_points);
        let options =
            SearchOptions { tol, sizes, max_meshes, max_iterations, max_time, callback, on_interrupt };
        let problem = || {
            let guesses = guess.map(|guess| self.guesses(guess)).transpose()?;
            self.problem(guesses.unwrap_or_default())
        };
        let found = |report| MultiphaseResult::of(py, &self.phases, report, tol);
        options.run(py, self.phases.len(), problem, found)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let links: Vec<_> = own.links.iter().map(|jumps| pairs(jumps)).collect();
        by_class(slf, (own.phases(py), links))
    }

    fn __repr__(&self) -> String {
        let n = self.phases.first().map_or(0, |phase| phase.get().states.len());
        format!("<MultiphaseProblem: {} phases of {n} states>", self.phases.len())
    }
}
