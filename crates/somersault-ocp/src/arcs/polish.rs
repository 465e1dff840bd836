//! From a collocation solution to an extremal.

use super::certificate;
use super::ends::{EndTerms, Ends};
use super::flow::{ArcFlow, follow};
use super::hamiltonian::{Hamiltonian, Observables, mixed_constraint};
use super::kind::ArcKind;
use super::shooting::{Budget, End, Iterate, Plan, Shooting};
use super::structure::{Impulses, Obstacle, Structure};
use super::verdict::Verdict;
use crate::collocation::{
    CollocationError, CollocationReport, CollocationStatus, Phase, PhaseSolution, Problem, Transcription,
    Untraced, WIDTH,
};
use somersault_core::cancel::CancellationToken;
use somersault_expr::ExprFunction;

/// Arcs that may be given up, one after the other.
const MOST_RETRIES: usize = 6;

/// Infeasibility of a program from which on its point is no start.
const NO_MOTION: f64 = 1e-2;

/// Polishes collocation solutions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Polish {
    /// The most evaluations of the equations of all arcs, over all tries.
    pub max_evaluations: Option<usize>,
}

/// An arc of an extremal.
#[derive(Debug, Clone, PartialEq)]
pub struct Arc {
    /// What controls and bounds of the state do.
    pub kind: ArcKind,
    /// When it begins.
    pub start: f64,
    /// When it ends.
    pub end: f64,
    /// The name of the bound of the state that holds on it.
    pub contact: Option<String>,
    /// Jumps of the costates at its start, by the derivatives of the bound that begins to hold, or is touched, there.
    pub jumps: Vec<f64>,
}

/// An extremal at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Instant {
    /// x.
    pub state: Vec<f64>,
    /// λ.
    pub costate: Vec<f64>,
    /// u.
    pub control: Vec<f64>,
    /// H.
    pub hamiltonian: f64,
    /// H_u: the switching functions of controls that H is affine in.
    pub slopes: Vec<f64>,
}

/// What polishing left. Where the [`Verdict`] is a refusal, arcs and cost are those of the last try, if there are any.
#[derive(Debug)]
pub struct Polished {
    /// What it is.
    pub verdict: Verdict,
    /// The arcs in the order of time.
    pub arcs: Vec<Arc>,
    /// The cost; that of collocation where there are no arcs.
    pub cost: f64,
    /// t₀ and t_f.
    pub horizon: (f64, f64),
    /// p.
    pub parameters: Vec<f64>,
    /// The largest residual of the equations, relative to what the sizes of the unknowns make of each.
    pub residual: f64,
    /// Newton's steps of the last try.
    pub steps: usize,
    /// Arcs that vanished and were given up.
    pub given_up: usize,
    /// Whether it is refused for a reason that lies in the problem, so that no finer solution helps.
    pub(crate) is_lasting: bool,
    motion: Option<Motion>,
}

/// What evaluates an extremal.
#[derive(Debug)]
struct Motion {
    iterate: Iterate,
    flows: Vec<ArcFlow>,
    sizes: Vec<f64>,
    n: usize,
    n_original: usize,
    m: usize,
}

impl Polished {
    /// No extremal, for a reason: the motion is that of the report.
    pub fn refused(report: &CollocationReport, reason: impl Into<String>) -> Self {
        let phase = report.phases.first();
        Self {
            verdict: Verdict::Refused { reason: reason.into() },
            arcs: Vec::new(),
            cost: report.cost,
            horizon: phase.map_or((f64::NAN, f64::NAN), PhaseSolution::horizon),
            parameters: phase.map_or(Vec::new(), |phase| phase.parameters.clone()),
            residual: f64::INFINITY,
            steps: 0,
            given_up: 0,
            is_lasting: false,
            motion: None,
        }
    }

    /// The same for a reason that may lie in the problem.
    fn hindered(report: &CollocationReport, Obstacle { reason, is_lasting }: Obstacle) -> Self {
        Self { is_lasting, ..Self::refused(report, reason) }
    }

    /// State, costate and control at a time, integrated from the node before it; at a junction those after it. Nothing where no
    /// extremal was found. Times outside of the horizon count as its ends.
    pub fn at(&self, t: f64) -> Option<Instant> {
        let motion = self.motion.as_ref()?;
        let Motion { iterate, flows, sizes, n, n_original, m } = motion;
        let mut left = (t - iterate.start).max(0.0);
        let mut arc = 0;
        while arc + 1 < iterate.durations.len() && left >= iterate.durations[arc] {
            left -= iterate.durations[arc];
            arc += 1;
        }
        let left = left.min(iterate.durations[arc]);
        let segments = iterate.nodes[arc].len() - 1;
        let length = iterate.durations[arc] / segments as f64;
        let segment = ((left / length) as usize).min(segments - 1);
        let mut flow = flows[arc].clone();
        flow.set_guess(&iterate.guesses[arc][segment]);
        let duration = (left - length * segment as f64).max(0.0);
        let token = CancellationToken::new();
        let point = follow(&mut flow, sizes, &iterate.nodes[arc][segment], duration, false, &token)?.point;
        let observed = flow.observed(&point)?;
        Some(Instant {
            hamiltonian: observed[Observables::HAMILTONIAN],
            slopes: observed[Observables::HAMILTONIAN + 1..][..*m].to_vec(),
            state: point[..*n_original].to_vec(),
            costate: point[*n..n + n_original].to_vec(),
            control: flow.guess()[..*m].to_vec(),
        })
    }
}

impl Polish {
    /// Finds the arcs of a collocation solution, makes them exact and certifies them.
    ///
    /// Errors where the report does not belong to the problem, or its functions have no derivatives; all else is a [`Verdict`].
    pub fn polish(
        &self,
        problem: &mut Problem,
        report: &CollocationReport,
    ) -> Result<Polished, CollocationError> {
        self.polish_cancellable(problem, report, &CancellationToken::new())
    }

    /// The same until it is cancelled, which is looked for at each evaluation of the equations of motion. Before the first of them their
    /// expressions are made and differentiated, which is not interrupted.
    pub fn polish_cancellable(
        &self,
        problem: &mut Problem,
        report: &CollocationReport,
        token: &CancellationToken,
    ) -> Result<Polished, CollocationError> {
        let ([phase], [solution]) = (&problem.phases[..], &report.phases[..]) else {
            return Ok(Polished::refused(report, "arcs are found in problems of one phase"));
        };
        if token.is_cancelled() {
            return Ok(Polished::refused(report, why_cancelled(token)));
        }
        if let CollocationStatus::NotSolved(status) = report.status
            && report.program.residuals.feasibility.is_nan()
                | (report.program.residuals.feasibility > NO_MOTION)
        {
            return Ok(Polished::refused(
                report,
                format!("collocation has found no motion to start from: {status:?}"),
            ));
        }
        if solution.costates.iter().flatten().any(|l| l.is_nan()) {
            return Ok(Polished::refused(
                report,
                "arcs are found by costates, and splines have none: solve by collocation",
            ));
        }
        let points = solution.places().len();
        let (point, both) = (point_arguments(solution, points / 2), end_arguments(solution));
        let functions = match expressible(phase, phase.expressions(&point, &both))? {
            Ok(functions) => functions,
            Err(reason) => {
                return Ok(Polished::hindered(report, Obstacle { reason, is_lasting: true }));
            }
        };
        let samples: Vec<_> = (0..8).map(|k| solution.at_fraction((f64::from(k) + 0.5) / 8.0)).collect();
        let mut hamiltonian =
            Hamiltonian::try_new(phase, &functions, &samples, &solution.parameters, solution.horizon().0)?;
        let path_values = path_values(&functions[1], solution)?;
        let end_values = end_values(&functions[2], solution)?;
        let parts = [&solution.states[0][..], &solution.states[points][..], &solution.parameters[..]];
        let ends = Ends::of(phase, parts, solution.horizon(), &end_values);
        let mut terms = EndTerms::try_new(&functions[2])?;
        let measures = solution.measures();
        let path = solution.path_multipliers.iter().zip(&measures);
        let path = path.map(|(row, measure)| row.iter().map(|y| y * measure).collect()).collect();
        let mut transcription = Transcription::try_new(problem, &[solution.mesh().clone()])?;
        let bound_multipliers = transcription.bound_multipliers(&report.phases, &report.program)?;
        let mut states = transcription.state_multipliers(0, &bound_multipliers);
        states.truncate(points);
        let multipliers = transcription.rest(&report.program.constraint_multipliers).ends.swap_remove(0);
        drop(transcription);
        let impulses = Impulses { states, path, path_values };
        let structure = match Structure::try_new(&hamiltonian, solution, &impulses) {
            Ok(structure) => structure,
            Err(obstacle) => return Ok(Polished::hindered(report, obstacle)),
        };
        let mut sketch = structure.sketch(&hamiltonian);
        let mut budget = Budget { token, evaluations: self.max_evaluations };
        for given_up in 0..=MOST_RETRIES {
            let mut found = match structure.found(&mut hamiltonian, &sketch) {
                Ok(found) => found,
                Err(obstacle) => return Ok(Polished { given_up, ..Polished::hindered(report, obstacle) }),
            };
            found.iterate.multipliers.clone_from(&multipliers);
            let sizes = sizes(&found.iterate, &hamiltonian.quaternions);
            let made = Shooting::try_new(&mut hamiltonian, &found.plan, &ends, &mut terms, &sizes, token)?;
            let Some(mut shooting) = made else {
                return Ok(Polished::refused(report, why_cancelled(token)));
            };
            let solved = shooting.solve(found.iterate, &mut budget);
            let verdict = match &solved.end {
                End::Converged => {
                    let phase = &problem.phases[0];
                    let verdict =
                        certificate::verdict(&mut shooting, &solved.iterate, solved.residual, phase);
                    // what could not be followed then says nothing about the motion
                    if token.is_cancelled() {
                        Verdict::Refused { reason: why_cancelled(token).to_owned() }
                    } else {
                        verdict
                    }
                }
                End::Vanished(arc) => {
                    let durations = &solved.iterate.durations;
                    if let Some(less) = sketch.without(*arc, durations, shooting.hamiltonian) {
                        sketch = less;
                        continue;
                    }
                    Verdict::Refused { reason: format!("{}, and arc {arc} vanishes", described(&found.plan)) }
                }
                End::Failed(reason) => Verdict::Refused {
                    reason: format!("{} were found, but {reason}", described(&found.plan)),
                },
                End::Cancelled => Verdict::Refused { reason: why_cancelled(token).to_owned() },
                End::Spent => Verdict::Refused { reason: "the limit of evaluations was reached".to_owned() },
            };
            let cost = shooting.cost(&solved.iterate).unwrap_or(report.cost);
            let flows = shooting.flows;
            return Ok(Polished {
                arcs: arcs(&hamiltonian, &found.plan, &solved.iterate),
                cost,
                horizon: (solved.iterate.start, solved.iterate.start + solved.iterate.duration()),
                parameters: solved.iterate.first()[hamiltonian.n_original..][..solution.parameters.len()]
                    .to_vec(),
                residual: solved.residual,
                steps: solved.steps,
                given_up,
                is_lasting: false,
                motion: Some(Motion {
                    iterate: solved.iterate,
                    flows,
                    sizes,
                    n: hamiltonian.n,
                    n_original: hamiltonian.n_original,
                    m: hamiltonian.m,
                }),
                verdict,
            });
        }
        let reason = format!("{MOST_RETRIES} arcs vanished one after the other");
        Ok(Polished { given_up: MOST_RETRIES, ..Polished::refused(report, reason) })
    }
}

fn why_cancelled(token: &CancellationToken) -> &'static str {
    if token.has_expired() { "the limit of time was reached" } else { "it was cancelled" }
}

/// The functions of a phase as expressions; a sentence where no arcs can be made of them.
fn expressible(
    phase: &Phase,
    functions: Result<[ExprFunction; 3], Untraced>,
) -> Result<Result<[ExprFunction; 3], String>, CollocationError> {
    let functions = match functions {
        Ok(functions) => functions,
        Err(reason) => return Ok(Err(format!("arcs need expressions of all functions: {reason}"))),
    };
    Ok(match mixed_constraint(phase, &functions[1])? {
        Some(reason) => Err(reason),
        None => Ok(functions),
    })
}

/// Whether no solution of a problem can be polished, which is known before there is one.
pub(crate) fn is_hopeless(problem: &Problem) -> Result<bool, CollocationError> {
    let [phase] = &problem.phases[..] else { return Ok(true) };
    let Some(functions) = phase.expressions_of_guess() else { return Ok(false) };
    Ok(expressible(phase, functions)?.is_err())
}

/// What the arcs of a plan are, for messages.
fn described(plan: &Plan) -> String {
    let arcs = plan.arcs.iter().map(|(kind, ..)| {
        let controls = kind.controls.iter().map(|control| format!("{control:?}").to_lowercase());
        let controls = controls.collect::<Vec<_>>().join(" and ");
        if kind.contact.is_some() { format!("{controls} at a bound of the state") } else { controls }
    });
    format!("the arcs {}", arcs.collect::<Vec<_>>().join(", "))
}

fn arcs(hamiltonian: &Hamiltonian, plan: &Plan, iterate: &Iterate) -> Vec<Arc> {
    let mut start = iterate.start;
    let mut all = Vec::new();
    for (k, (kind, ..)) in plan.arcs.iter().enumerate() {
        let end = start + iterate.durations[k];
        let contact = kind.contact.map(|bound| hamiltonian.bounds[bound].name.clone());
        let jumps = k.checked_sub(1).map_or(Vec::new(), |before| iterate.jumps[before].clone());
        all.push(Arc { kind: kind.clone(), start, end, contact, jumps });
        start = end;
    }
    all
}

/// The largest size of each state and costate, one where it is zero. Those of a quaternion are one, and those of its costate are alike.
fn sizes(iterate: &Iterate, quaternions: &[usize]) -> Vec<f64> {
    let mut sizes = vec![0.0f64; iterate.first().len()];
    for node in iterate.nodes.iter().flatten() {
        sizes.iter_mut().zip(node).for_each(|(size, x)| *size = size.max(x.abs()));
    }
    let n = sizes.len() / 2;
    for &first in quaternions {
        sizes[first..first + WIDTH].fill(1.0);
        let costate = &mut sizes[n + first..n + first + WIDTH];
        let largest = costate.iter().fold(0.0, |a: f64, b| a.max(*b));
        costate.fill(largest);
    }
    // a costate that is zero is so beside the others
    let costate = sizes[n..].iter().fold(0.0, |a: f64, b| a.max(*b));
    let costate = if costate > 0.0 { costate } else { 1.0 };
    sizes[..n].iter_mut().filter(|size| **size == 0.0).for_each(|size| *size = 1.0);
    sizes[n..].iter_mut().for_each(|size| *size = size.max(1e-3 * costate));
    sizes
}

/// (x, u, p, t) at a point.
fn point_arguments(solution: &PhaseSolution, i: usize) -> Vec<f64> {
    [&solution.states[i][..], &solution.controls[i], &solution.parameters, &solution.times[i..=i]].concat()
}

/// (x(t₀), x(t_f), p, t₀, t_f).
fn end_arguments(solution: &PhaseSolution) -> Vec<f64> {
    let (first, last) = (&solution.states[0], &solution.states[solution.states.len() - 1]);
    let (start, end) = solution.horizon();
    [&first[..], last, &solution.parameters, &[start, end]].concat()
}

/// The values of the path constraints at the points.
fn path_values(path: &ExprFunction, solution: &PhaseSolution) -> Result<Vec<Vec<f64>>, CollocationError> {
    let mut evaluator = path.evaluator();
    let mut all = Vec::new();
    for i in 0..solution.controls.len() {
        let mut values = vec![0.0; evaluator.n_outputs()];
        evaluator.evaluate(&point_arguments(solution, i), &mut values)?;
        all.push(values.split_off(1));
    }
    Ok(all)
}

/// The values of the end constraints.
fn end_values(ends: &ExprFunction, solution: &PhaseSolution) -> Result<Vec<f64>, CollocationError> {
    let mut evaluator = ends.evaluator();
    let mut values = vec![0.0; evaluator.n_outputs()];
    evaluator.evaluate(&end_arguments(solution), &mut values)?;
    Ok(values.split_off(1))
}
