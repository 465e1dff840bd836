//! From a phase to a program of splines.
//!
//! | Dynamics | Splines | x of a node | u of a node |
//! |---|---|---|---|
//! | a tree whose forced joints are all its states have | motions of the actuated joints; the others move by hybrid dynamics | q, v | joint forces |
//! | any other ẋ = f(x, u, p, t) | controls | velocities of [`FirstOrder`] | forces of it |

use super::first_order::FirstOrder;
use super::point::{NodeNumbers, PointTerm, Source};
use crate::NoSplines;
use crate::collocation::{Guess, Interval, Phase, Problem, Shared, VectorFunction};
use crate::dynamics::{HybridDynamics, Tree};
use crate::error::OcpError;
use crate::problem::{At, Loss, MotionProblem};
use crate::shooting::{self, Drive, Duration, Shooting, ShootingOptions, Start};
use crate::term::{NodeNumber, Part};
use crate::transcription::Transcription;
use somersault_core::spline::UniformBasis;
use somersault_multibody::Split;
use somersault_multibody::joint_motion::{Condition, EigenpostureBase, End, JointMotionError, SplineMotion};
use somersault_nlp::Bounds;

/// Degree of the splines: accelerations are twice differentiable.
pub(super) const DEGREE: usize = 5;
/// Steps of the integration in each interval of the splines.
pub(super) const STEPS: usize = 6;
/// Places of a guess that splines are fitted to, for each of their coefficients.
const SAMPLES: usize = 3;

/// Where derivatives are looked at beside the guess, relative to the size of arguments.
const SHIFT: f64 = 0.01;

/// Where a node has the variables of the phase.
pub(super) struct Mapping {
    pub(super) states: Vec<NodeNumber>,
    pub(super) controls: Vec<NodeNumber>,
    pub(super) parameters: Vec<Source>,
    pub(super) start: f64,
}

impl Mapping {
    fn time(&self) -> Source {
        Source { number: Some(NodeNumber::Of(Part::Time, 0)), offset: self.start }
    }

    /// (x, u, p, t).
    fn point(&self) -> Vec<Source> {
        let numbers = self.states.iter().chain(&self.controls).map(|number| Source::of(*number));
        numbers.chain(self.parameters.iter().copied()).chain([self.time()]).collect()
    }
}

/// What the splines are of.
pub(super) enum SplineProgram {
    /// Joints of a tree.
    Joints(Box<Program<Tree>>),
    /// Controls.
    Controls(Box<Program<FirstOrder>>),
}

/// A program of splines.
pub(super) struct Program<D> {
    pub(super) program: MotionProblem<Shooting<D>>,
    pub(super) mapping: Mapping,
}

/// The one phase of a problem.
fn only_phase(problem: &Problem) -> Result<&Phase, NoSplines> {
    match &problem.phases[..] {
        [phase] => Ok(phase),
        phases => Err(NoSplines::SeveralPhases { found: phases.len() }),
    }
}

/// The tree of a phase, if its joints can move by splines: its states are those of the phase, and parameters are given.
pub(super) fn tree_of(phase: &Phase) -> Option<(Tree, Vec<usize>)> {
    let dynamics = phase.tree()?;
    let given = phase.bounds.parameters.iter().all(Interval::is_fixed);
    let (model, actuated) = (dynamics.model(), dynamics.actuated());
    if !given || actuated.is_empty() || phase.n_states() != 2 * model.n_velocities() {
        return None;
    }
    let mut active = vec![false; model.n_velocities()];
    actuated.iter().for_each(|dof| active[*dof] = true);
    let tree = Tree::try_new(model.clone(), Split::new(active)).ok()?;
    // forces in the order of the controls
    tree.dofs().groups.is_empty().then(|| (tree, actuated.to_vec()))
}

/// Whether x₀ is one of the arguments that decide Φ and b.
fn depends_on_the_start(ends: &mut Shared, phase: &Phase, guess: &Guess) -> Result<bool, NoSplines> {
    let n = phase.n_states();
    let mut arguments =
        [&guess.states[0][..], &guess.states[guess.states.len() - 1], &guess.parameters].concat();
    arguments.extend([guess.times[0], guess.times[guess.times.len() - 1]]);
    let mut jacobian = nalgebra::DMatrix::zeros(ends.n_outputs(), arguments.len());
    let is_free = |k: &usize| !phase.bounds.initial_state[*k].is_fixed();
    // at the guess a derivative may vanish by chance
    for shift in [0.0, SHIFT] {
        let shifted: Vec<f64> = arguments
            .iter()
            .enumerate()
            .map(|(k, x)| x + shift * (1.0 + x.abs()) * ((k + 1) as f64).sqrt())
            .collect();
        ends.jacobian(&shifted, &mut jacobian)
            .map_err(|error| NoSplines::Undefined { what: error.to_string() })?;
        let names = |k: usize| jacobian.column(k).iter().any(|x| x.is_finite() && *x != 0.0);
        if (0..n).filter(is_free).any(names) {
            return Ok(true);
        }
    }
    Ok(false)
}

impl SplineProgram {
    /// The program of a problem, with splines of so many intervals.
    pub(super) fn try_new(problem: &Problem, n_intervals: usize, exact: bool) -> Result<Self, NoSplines> {
        let phase = only_phase(problem)?;
        if phase.n_controls() == 0 {
            return Err(NoSplines::NoControls);
        }
        if !phase.bounds.initial_time.is_fixed() {
            return Err(NoSplines::StartTime);
        }
        Ok(match tree_of(phase) {
            Some((tree, actuated)) => {
                Self::Joints(Box::new(Program::of_joints(phase, tree, &actuated, n_intervals, exact)?))
            }
            None => Self::Controls(Box::new(Program::of_controls(phase, n_intervals)?)),
        })
    }
}

/// What a value may be at a start, as a given number and whether it is free.
fn start_of(intervals: &[Interval], guess: &[f64]) -> (Vec<f64>, Vec<bool>) {
    let value =
        |(interval, guess): (&Interval, &f64)| if interval.is_fixed() { interval.lower } else { *guess };
    let free = intervals.iter().map(|interval| !interval.is_fixed()).collect();
    (intervals.iter().zip(guess).map(value).collect(), free)
}

fn duration(phase: &Phase) -> Result<Duration, NoSplines> {
    let start = phase.bounds.initial_time.lower;
    let Interval { lower, upper } = phase.bounds.final_time;
    let (lower, upper) = (lower - start, upper - start);
    if lower == upper {
        return Ok(Duration::Fixed(lower));
    }
    if lower > 0.0 && upper.is_finite() {
        Ok(Duration::Free { lower, upper })
    } else {
        Err(NoSplines::EndlessDuration { lower, upper })
    }
}

impl Program<Tree> {
    fn of_joints(
        phase: &Phase,
        tree: Tree,
        actuated: &[usize],
        n_intervals: usize,
        exact: bool,
    ) -> Result<Self, NoSplines> {
        let n = tree.dofs().n_velocities();
        let place = |dof: usize| tree.dofs().positions[dof].unwrap_or(dof);
        let position = |dof: usize| NodeNumber::Position { place: place(dof), dof };
        let mapping = Mapping {
            states: (0..n).map(position).chain((0..n).map(|k| NodeNumber::Of(Part::Velocity, k))).collect(),
            controls: actuated.iter().map(|k| NodeNumber::Of(Part::Torque, *k)).collect(),
            parameters: phase.bounds.parameters.iter().map(|p| Source::constant(p.lower)).collect(),
            start: phase.bounds.initial_time.lower,
        };
        let guess = expect_guess(phase)?;
        let bounds = &phase.bounds;
        let duration = duration(phase)?;
        let (position, free_positions) = start_of(&bounds.initial_state[..n], &guess.states[0][..n]);
        let (velocity, free_velocities) = start_of(&bounds.initial_state[n..], &guess.states[0][n..]);
        let start = Start { position, velocity, free_positions, free_velocities };
        let active = tree.dofs().active_dofs();
        let ends = [(End::Start, &bounds.initial_state), (End::Finish, &bounds.final_state)];
        let (mut conditions, mut left) = (vec![Vec::new(); active.len()], [Vec::new(), Vec::new()]);
        for (side, (end, intervals)) in ends.into_iter().enumerate() {
            for k in 0..2 * n {
                let (derivative, interval) = (k / n, intervals[k]);
                let channel = active.iter().position(|dof| *dof == k % n);
                // by the fraction of the duration
                let scale = match duration {
                    Duration::Fixed(duration) => Some(if derivative == 1 { duration } else { 1.0 }),
                    Duration::Free { .. } => (derivative == 0 || interval.lower == 0.0).then_some(1.0),
                };
                match (channel, scale) {
                    (Some(channel), Some(scale)) if interval.is_fixed() => {
                        let value = scale * interval.lower;
                        conditions[channel].push(Condition { end, derivative, value });
                    }
                    // the start of what is passive is a variable or given
                    (None, _) if side == 0 && interval.is_fixed() => {}
                    _ => left[side].push((mapping.states[k], interval)),
                }
            }
        }
        let has_passive = active.len() < n;
        let leg = shooting::Phase {
            motion: splines(n_intervals, &conditions)?,
            n_steps: STEPS * n_intervals,
            duration,
            // without a state to lift, segments only say which parameters act where
            n_segments: if has_passive { n_segments(n_intervals) } else { n_intervals },
        };
        let shooting = Shooting::try_new(tree, start, vec![leg], ShootingOptions::default())?;
        // Without defects, the model that leaves the curvature of the motion out is convex if costs are.
        Self::assemble(phase, guess, shooting, mapping, exact || has_passive, None, left)
    }
}

/// Segments of multiple shooting.
fn n_segments(n_intervals: usize) -> usize {
    (n_intervals / 2).max(1)
}

/// Splines of so many intervals under conditions at their ends, which each channel has its own of.
fn splines(n_intervals: usize, conditions: &[Vec<Condition>]) -> Result<SplineMotion, OcpError> {
    let basis = UniformBasis::try_new(DEGREE, n_intervals + DEGREE).map_err(JointMotionError::from)?;
    let base = EigenpostureBase::joints(conditions.len());
    Ok(SplineMotion::with_conditions(basis, base, conditions)?)
}

fn expect_guess(phase: &Phase) -> Result<&Guess, NoSplines> {
    phase.start().ok_or_else(|| NoSplines::Undefined { what: "the guess".to_owned() })
}

impl Program<FirstOrder> {
    fn of_controls(phase: &Phase, n_intervals: usize) -> Result<Self, NoSplines> {
        let (n, n_parameters, m) = (phase.n_states(), phase.n_parameters(), phase.n_controls());
        let [function, path, _] = phase.functions();
        let dynamics = FirstOrder::new([function, path], n, n_parameters, m);
        let cost = NodeNumber::Of(Part::Velocity, dynamics.cost());
        let velocity = |k: usize| NodeNumber::Of(Part::Velocity, k);
        let controls: Vec<usize> = dynamics.controls().collect();
        let mapping = Mapping {
            states: (0..n).map(velocity).collect(),
            controls: controls.iter().map(|k| NodeNumber::Of(Part::Torque, *k)).collect(),
            parameters: (n..n + n_parameters).map(|k| Source::of(velocity(k))).collect(),
            start: phase.bounds.initial_time.lower,
        };
        let guess = expect_guess(phase)?;
        let bounds = &phase.bounds;
        let all = dynamics.dofs().n_velocities();
        let mut intervals = bounds.initial_state.clone();
        intervals.extend(&bounds.parameters);
        let (mut velocity, mut free_velocities) =
            start_of(&intervals, &[&guess.states[0][..], &guess.parameters].concat());
        velocity.push(mapping.start);
        velocity.resize(all, 0.0);
        free_velocities.resize(all, false);
        let start =
            Start { position: vec![0.0; all], velocity, free_positions: vec![false; all], free_velocities };
        let at_start = |k: &usize| !intervals[*k].is_fixed();
        let left = [
            (0..n + n_parameters)
                .filter(at_start)
                .map(|k| (NodeNumber::Of(Part::Velocity, k), intervals[k]))
                .collect(),
            mapping.states.iter().copied().zip(bounds.final_state.iter().copied()).collect(),
        ];
        let leg = shooting::Phase {
            motion: splines(n_intervals, &vec![Vec::new(); m])?,
            n_steps: STEPS * n_intervals,
            duration: duration(phase)?,
            n_segments: n_segments(n_intervals),
        };
        let options =
            ShootingOptions { drive: Drive::Torque { dofs: controls }, ..ShootingOptions::default() };
        let shooting = Shooting::try_new(dynamics, start, vec![leg], options)?;
        // multipliers of defects bend the Lagrangian as much as costs do
        Self::assemble(phase, guess, shooting, mapping, true, Some(cost), left)
    }
}

impl<D: HybridDynamics> Program<D> {
    /// Costs and constraints of the phase over the motion; `integrated` is the integral of
    /// the running cost where there is one, and `left` are bounds of the two ends that hold by themselves nowhere.
    fn assemble(
        phase: &Phase,
        guess: &Guess,
        mut shooting: Shooting<D>,
        mapping: Mapping,
        exact: bool,
        integrated: Option<NodeNumber>,
        left: [Vec<(NodeNumber, Interval)>; 2],
    ) -> Result<Self, NoSplines> {
        let bounds = &phase.bounds;
        let [_, path, mut ends] = phase.functions();
        let has_curvature = exact && shooting.second_derivatives().is_some();
        let mut problem = MotionProblem::builder(shooting);
        problem = match integrated {
            _ if has_curvature => problem.with_exact_hessian(),
            // the solver builds its own
            Some(_) => problem,
            None => problem.with_curved_terms(),
        };
        let first_of =
            |n: usize| Loss::Linear { weights: (0..n).map(|k| f64::from(u8::from(k == 0))).collect() };
        problem = match integrated {
            Some(cost) => problem.mayer(At::End, NodeNumbers(vec![cost]), first_of(1))?,
            None => {
                let cost = PointTerm::new("running cost", path.clone(), mapping.point(), 0..1);
                problem.lagrange(cost, first_of(1))?
            }
        };
        let constrained = |bounds: &[Interval]| bounds.iter().any(is_bound);
        if constrained(&bounds.path) {
            let rows = 1..1 + bounds.path.len();
            let term = PointTerm::new("path constraint", path, mapping.point(), rows);
            problem = problem.constrain(At::EveryNode, term, limits(&bounds.path))?;
        }
        if depends_on_the_start(&mut ends, phase, guess)? {
            return Err(NoSplines::FreeStart);
        }
        let initial = bounds.initial_state.iter().zip(&guess.states[0]);
        let mut sources: Vec<Source> = initial
            .map(|(interval, guess)| {
                Source::constant(if interval.is_fixed() { interval.lower } else { *guess })
            })
            .collect();
        sources.extend(mapping.states.iter().map(|number| Source::of(*number)));
        sources.extend(mapping.parameters.iter().copied());
        sources.extend([Source::constant(mapping.start), mapping.time()]);
        let cost = PointTerm::new("end cost", ends.clone(), sources.clone(), 0..1);
        problem = problem.mayer(At::End, cost, first_of(1))?;
        if constrained(&bounds.end) {
            let term = PointTerm::new("end constraint", ends, sources, 1..1 + bounds.end.len());
            problem = problem.constrain(At::End, term, limits(&bounds.end))?;
        }
        let numbers = mapping.states.iter().zip(&bounds.state);
        let numbers = numbers.chain(mapping.controls.iter().zip(&bounds.control));
        let always = numbers.map(|(number, interval)| (*number, *interval)).collect();
        let [first, last] = left;
        for (at, rows) in [(At::EveryNode, always), (At::Start, first), (At::End, last)] {
            let rows: Vec<(NodeNumber, Interval)> =
                rows.into_iter().filter(|(_, interval): &(_, Interval)| is_bound(interval)).collect();
            let (numbers, intervals): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
            if !numbers.is_empty() {
                problem = problem.constrain(at, NodeNumbers(numbers), limits(&intervals))?;
            }
        }
        Ok(Self { program: problem.build()?, mapping })
    }

    /// The decision vector nearest to a guess.
    pub(super) fn start(&self, guess: &Guess, phase: &Phase) -> Result<Vec<f64>, NoSplines> {
        let shooting = self.program.transcription();
        let layout = shooting.layout();
        let mut z = vec![0.0; layout.n_variables];
        let (mut x, mut u) = (vec![0.0; phase.n_states()], vec![0.0; phase.n_controls()]);
        let driven: Vec<usize> = shooting.driven_dofs().collect();
        let (mut fractions, mut samples) = (Vec::new(), Vec::new());
        let n_samples = SAMPLES * shooting.motion(0).basis().n_coefficients();
        for k in 0..=n_samples {
            let fraction = k as f64 / n_samples as f64;
            guess.at_fraction(fraction, &mut x, &mut u);
            fractions.push(fraction);
            samples.push(match shooting.drive() {
                Drive::Motion => driven.iter().map(|dof| x[*dof]).collect(),
                Drive::Torque { .. } => u.clone(),
            });
        }
        let motion = shooting.motion(0);
        let fitted = motion.fit(&fractions, &samples).map_err(OcpError::from)?;
        z[layout.parameters[0].clone()].copy_from_slice(&fitted);
        let (first, last) = guess.interval();
        if let Some(variable) = layout.durations[0] {
            let Bounds { lower, upper } = &shooting.outline().variables;
            z[variable] = (last - first).clamp(lower[variable], upper[variable]);
        }
        let n_segments = layout.lifted.len() + 1;
        let n_steps = shooting.outline().n_nodes() - 1;
        let is_tree = matches!(shooting.drive(), Drive::Motion);
        for (number, variables) in layout.lifted.iter().enumerate() {
            // where the segment starts
            let step = (number + 1) * n_steps / n_segments;
            guess.at_fraction(step as f64 / n_steps as f64, &mut x, &mut u);
            let mut lifted = self.lifted(
                &x,
                &guess.parameters,
                first + (last - first) * step as f64 / n_steps as f64,
                is_tree,
            );
            z[variables.clone()].iter_mut().zip(&mut lifted).for_each(|(z, x)| *z = *x);
        }
        Ok(z)
    }

    /// The passive state at a lifted node: displacements of positions, then velocities.
    fn lifted(&self, x: &[f64], parameters: &[f64], t: f64, is_tree: bool) -> Vec<f64> {
        let shooting = self.program.transcription();
        let passive = shooting.dynamics().dofs().passive_dofs();
        let n = shooting.dynamics().dofs().n_velocities();
        if is_tree {
            let position = shooting.reference();
            let displaced = passive.iter().map(|dof| x[*dof] - position[*dof]);
            return displaced.chain(passive.iter().map(|dof| x[n + dof])).collect();
        }
        let mut all = vec![0.0; n];
        all.extend(x);
        all.extend(parameters);
        all.push(t);
        all.resize(2 * n, 0.0);
        all
    }
}

fn is_bound(interval: &Interval) -> bool {
    interval.lower.is_finite() || interval.upper.is_finite()
}

fn limits(intervals: &[Interval]) -> Bounds {
    let mut bounds = Bounds::default();
    intervals.iter().for_each(|interval| bounds.push(interval.lower, interval.upper));
    bounds
}
