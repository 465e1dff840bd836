//! Shooting: passive degrees of freedom are integrated along joints that move by splines.
//!
//! ```text
//! q_a = φ₀ + D c(t; p), v_a, a_a likewise;   q̇_p = v_p,  v̇_p = a_p(q, v, a_a)      (thesis 2.10–2.22, C.25, C.26)
//! ```
//! Of the active joints positions, velocities and accelerations come from the splines themselves: only the passive state
//! obeys the recursion of the [`Scheme`]. With [`Drive::Torque`] all degrees of freedom are passive and the splines are
//! joint forces. Variables are what is free of the passive start, ψ, the parameters p of each phase, free durations,
//! and lifted states, whose defects are the gaps to the segments before them.
//!
//! Derivatives are those of the discrete motion (thesis appendix D, corrected: the parameters are one for each channel
//! and spline, D.30; ∂τ_a has M_ap in front, D.41–43), taken along the displacements of the groups.
//!
//! Cost: one evaluation of the hybrid dynamics for each stage, its partials once for all sweeps at the same z.

mod backward;
mod curvature;
mod forward;
mod layout;
mod phase;
mod step;
mod table;
mod trajectory;

pub use layout::Layout;
pub use phase::{Drive, Duration, Phase, Scheme, Start};

use crate::dynamics::{GroupTransport, HybridDynamics};
use crate::error::{OcpError, expect_below, expect_room};
use crate::term::Node;
use crate::transcription::{NodeSizes, Outline, RolloutGradient, RolloutSecondDerivatives, Transcription};
use somersault_core::argument::{ArgumentError, expect_length};
use somersault_multibody::joint_motion::{EigenpostureBase, SplineMotion};
use somersault_nlp::{Bounds, EvaluationError, Pattern};
use table::Table;
use trajectory::Stages;

/// A motion by shooting; see the [module](self).
pub struct Shooting<D> {
    dynamics: D,
    scheme: Scheme,
    drive: Drive,
    start: Start,
    layout: Layout,
    outline: Outline,
    phases: Vec<Prepared>,
    segments: Vec<Segment>,
    /// Degrees of freedom of the passive state.
    passive: Vec<usize>,
    /// Degrees of freedom that the channels drive, and their places in q.
    driven: Vec<(usize, usize)>,
    stages: Stages,
    nodes: trajectory::Nodes,
    defects: Vec<f64>,
    z: Vec<f64>,
    linearised: bool,
    backward: backward::Work,
    forward: Vec<forward::Work>,
    curvature: curvature::Work,
}

/// A phase with its tables.
struct Prepared {
    motion: SplineMotion,
    base: EigenpostureBase,
    table: Table,
    n_steps: usize,
    first_node: usize,
    fixed_duration: f64,
    quadrature: Vec<f64>,
    /// Of the current z.
    duration: f64,
    start_time: f64,
}

/// A run of steps from a state that is given or a variable.
struct Segment {
    phase: usize,
    /// Steps of the phase.
    steps: std::ops::Range<usize>,
    /// Passive positions from which the variables displace; velocities to which they add.
    position: Vec<f64>,
    velocity: Vec<f64>,
    /// Variable that displaces each degree of freedom, and variable that adds to its velocity.
    position_variables: Vec<(usize, usize)>,
    velocity_variables: Vec<(usize, usize)>,
    /// Of the displacement at the start.
    transport: GroupTransport,
    /// State at the end.
    end_position: Vec<f64>,
    end_velocity: Vec<f64>,
    /// Of the logarithm of the gap at the start; none for the first segment.
    gap: GroupTransport,
    /// First defect of the gap at the start.
    first_defect: usize,
    /// Variables on which the nodes depend: of the parameters those whose splines act there, where nothing is integrated.
    variables: Vec<usize>,
    /// Which of these each parameter of the phase is.
    rows: Vec<Option<usize>>,
    /// Variables on which the gap at the start depends.
    gap_variables: Vec<usize>,
}

/// What a shooting is to be.
#[derive(Debug, Clone, PartialEq)]
pub struct ShootingOptions {
    /// How steps are made.
    pub scheme: Scheme,
    /// What the channels drive.
    pub drive: Drive,
}

impl Default for ShootingOptions {
    /// Runge–Kutta steps, channels that are joint motions.
    fn default() -> Self {
        Self { scheme: Scheme::RungeKutta4, drive: Drive::Motion }
    }
}

impl<D: HybridDynamics> Shooting<D> {
    /// Shooting from `start` through `phases`, one after the other.
    ///
    /// At the link between two phases the passive state is continuous, and so are driven joints and their
    /// velocities: by their channels where both phases have the same base, by joints otherwise. Torques may jump.
    pub fn try_new(
        dynamics: D,
        start: Start,
        phases: Vec<Phase>,
        options: ShootingOptions,
    ) -> Result<Self, OcpError> {
        let ShootingOptions { scheme, drive } = options;
        let dofs = dynamics.dofs().clone();
        let (n_q, n) = (dofs.n_positions, dofs.n_velocities());
        start.expect_for(n_q, n)?;
        if phases.is_empty() {
            return Err(ArgumentError::TooFew { argument: "phases", least: 1, found: 0 }.into());
        }
        let active = dofs.active_dofs();
        let driven_dofs = match &drive {
            Drive::Motion => active.clone(),
            Drive::Torque { dofs } => {
                expect_length("active dofs of the dynamics", active.len(), 0)?;
                dofs.clone()
            }
        };
        for dof in &driven_dofs {
            expect_below("drive.dofs", *dof, n)?;
        }
        for phase in &phases {
            phase.expect_valid()?;
            expect_length("motion.base", phase.motion.base().n_joints(), driven_dofs.len())?;
            // stages with their partials, nodes and tangents of all variables
            let stages = scheme.n_stages() * (3 * n * n + 8 * n + 3 * phase.motion.n_channels());
            let tangents = 4 * n * phase.motion.n_channels() * phase.motion.basis().n_active();
            expect_room("n_steps", phase.n_steps, 8 * (stages + tangents))?;
            expect_room("n_segments", phase.n_segments, 8 * (2 * n * phase.motion.n_parameters()).max(1))?;
        }
        // what has several positions is never active
        let driven = driven_dofs.iter().map(|k| (*k, dofs.positions[*k].unwrap_or(0))).collect();
        let passive = dofs.passive_dofs();
        let n_free = passive.iter().filter(|k| start.free_positions[**k]).count()
            + passive.iter().filter(|k| start.free_velocities[**k]).count();
        let n_segments: usize = phases.iter().map(|p| p.n_segments).sum();
        let sizes =
            phases.iter().map(|p| (p.motion.n_parameters(), matches!(p.duration, Duration::Free { .. })));
        let layout = Layout::new(n_free, sizes, n_segments - 1, 2 * passive.len());
        let mut variables = Bounds::free(layout.n_variables);
        for (phase, variable) in phases.iter().zip(&layout.durations) {
            if let (Duration::Free { lower, upper }, Some(variable)) = (phase.duration, variable) {
                (variables.lower[*variable], variables.upper[*variable]) = (lower, upper);
            }
        }
        let mut outline = Outline { variables, ..Outline::default() };
        outline.sizes = NodeSizes {
            n_positions: n_q,
            n_velocities: n,
            n_accelerations: n,
            n_torques: n,
            n_channels: phases.iter().map(|p| p.motion.n_channels()).max().unwrap_or(0),
        };
        for phase in &phases {
            expect_length("motion.n_channels", phase.motion.n_channels(), outline.sizes.n_channels)?;
        }
        let mut shooting = Self {
            stages: Stages::default(),
            nodes: trajectory::Nodes::default(),
            backward: backward::Work::default(),
            forward: Vec::new(),
            curvature: curvature::Work::default(),
            defects: Vec::new(),
            z: vec![0.0; layout.n_variables],
            linearised: false,
            phases: Vec::new(),
            segments: Vec::new(),
            dynamics,
            scheme,
            drive,
            start,
            layout,
            outline,
            passive,
            driven,
        };
        shooting.prepare(&phases);
        Ok(shooting)
    }

    fn prepare(&mut self, phases: &[Phase]) {
        let mut n_nodes = 0;
        for (i, phase) in phases.iter().enumerate() {
            let n_points = self.scheme.points_per_step() * phase.n_steps;
            let fractions = (0..=n_points).map(|k| k as f64 / n_points as f64);
            let table = Table::new(&phase.motion, fractions);
            let fixed_duration = match phase.duration {
                Duration::Fixed(duration) => duration,
                Duration::Free { .. } => f64::NAN,
            };
            self.outline.phases.push(n_nodes..n_nodes + phase.n_steps + 1);
            self.phases.push(Prepared {
                motion: phase.motion.clone(),
                base: phase.motion.base().clone(),
                table,
                n_steps: phase.n_steps,
                first_node: n_nodes,
                fixed_duration,
                quadrature: self.scheme.quadrature(phase.n_steps),
                duration: fixed_duration,
                start_time: 0.0,
            });
            n_nodes += phase.n_steps + 1;
            for s in 0..phase.n_segments {
                let boundary = |s: usize| s * phase.n_steps / phase.n_segments;
                self.add_segment(i, boundary(s)..boundary(s + 1));
            }
        }
        let sizes = self.outline.sizes;
        self.defects = vec![0.0; self.outline.n_defects()];
        self.stages = Stages::new(&sizes, self.scheme, n_nodes, self.dynamics.dofs());
        self.nodes = trajectory::Nodes::new(&sizes, n_nodes);
        self.backward = backward::Work::new(&sizes, self.driven.len());
        self.forward =
            self.segments.iter().map(|segment| forward::Work::new(&sizes, &segment.variables)).collect();
    }

    fn add_segment(&mut self, phase: usize, steps: std::ops::Range<usize>) {
        let Self { layout, start, passive, outline, dynamics, .. } = self;
        let number = self.segments.len();
        let (mut position_variables, mut velocity_variables) = (Vec::new(), Vec::new());
        let mut first_defect = outline.n_defects();
        let state = if number == 0 {
            let free = |flags: &[bool]| passive.iter().copied().filter(|k| flags[*k]).collect::<Vec<_>>();
            let (positions, velocities) = (free(&start.free_positions), free(&start.free_velocities));
            let mut at = layout.start.clone();
            position_variables.extend(positions.into_iter().zip(&mut at));
            velocity_variables.extend(velocities.into_iter().zip(&mut at));
            layout.start.clone()
        } else {
            let at = layout.lifted[number - 1].clone();
            position_variables.extend(passive.iter().copied().zip(at.clone()));
            velocity_variables.extend(passive.iter().copied().zip(at.clone().skip(passive.len())));
            first_defect = outline.n_defects();
            let n_links = match self.drive {
                Drive::Motion if steps.start == 0 => link_rows(&self.phases, phase),
                Drive::Motion | Drive::Torque { .. } => 0,
            };
            for _ in 0..2 * passive.len() + 2 * n_links {
                outline.defects.push(0.0, 0.0);
            }
            at
        };
        let durations = layout.durations[..=phase].iter().flatten().copied();
        let per_step = self.scheme.points_per_step();
        let points = steps.start * per_step..=steps.end * per_step;
        let n_parameters = layout.parameters[phase].len();
        // segments with a state are few, and their variables are those of the whole phase
        let acting = if passive.is_empty() {
            self.phases[phase].table.acting(points, n_parameters)
        } else {
            vec![true; n_parameters]
        };
        let parameters =
            layout.parameters[phase].clone().filter(|k| acting[k - layout.parameters[phase].start]);
        let mut variables: Vec<usize> = state.chain(parameters).chain(durations).collect();
        variables.sort_unstable();
        let rows = layout.parameters[phase].clone().map(|k| variables.binary_search(&k).ok()).collect();
        let before = self.segments.last().map_or(&[][..], |segment| &segment.variables);
        let mut gap_variables = [before, &variables].concat();
        gap_variables.sort_unstable();
        gap_variables.dedup();
        let dofs = dynamics.dofs();
        self.segments.push(Segment {
            phase,
            steps,
            position: start.position.clone(),
            velocity: if number == 0 { start.velocity.clone() } else { vec![0.0; start.velocity.len()] },
            position_variables,
            velocity_variables,
            transport: GroupTransport::new(dofs),
            end_position: start.position.clone(),
            end_velocity: start.velocity.clone(),
            gap: GroupTransport::new(dofs),
            first_defect,
            variables,
            rows,
            gap_variables,
        });
    }

    /// Where z has its parts.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The system.
    pub fn dynamics(&self) -> &D {
        &self.dynamics
    }

    /// The positions at the start from which free ones, and those at lifted nodes, are displaced.
    pub(crate) fn reference(&self) -> &[f64] {
        &self.start.position
    }

    /// What the channels drive.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The degrees of freedom that the channels drive, in the order of the joints of the base.
    pub fn driven_dofs(&self) -> impl Iterator<Item = usize> + '_ {
        self.driven.iter().map(|(dof, _)| *dof)
    }

    /// The channels of each phase.
    pub fn motions(&self) -> impl ExactSizeIterator<Item = &SplineMotion> {
        self.phases.iter().map(|phase| &phase.motion)
    }

    /// The channels of a phase that there is.
    pub(crate) fn motion(&self, phase: usize) -> &SplineMotion {
        &self.phases[phase].motion
    }

    /// How steps are made.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// Duration of each phase of the last rollout, s.
    pub fn durations(&self) -> Vec<f64> {
        self.phases.iter().map(|p| p.duration).collect()
    }

    /// Closes all gaps between segments: lifted states become the ends of the segments before them. Positions are
    /// described from there on, so that their displacements are zero. What the channels do at links stays.
    pub fn close_gaps(&mut self, z: &mut [f64]) -> Result<(), EvaluationError> {
        for number in 1..self.segments.len() {
            self.rollout(z)?;
            let (before, rest) = self.segments.split_at_mut(number);
            let (from, to) = (&before[number - 1], &mut rest[0]);
            to.position.copy_from_slice(&from.end_position);
            for (_, variable) in &to.position_variables {
                z[*variable] = 0.0;
            }
            for (dof, variable) in &to.velocity_variables {
                z[*variable] = from.end_velocity[*dof];
            }
        }
        self.rollout(z)
    }

    /// The node at the start of a step of a phase, or at its end.
    pub fn node_of(&self, phase: usize, step: usize) -> Option<usize> {
        let phase = self.phases.get(phase)?;
        (step <= phase.n_steps).then_some(phase.first_node + step)
    }
}

/// Channels, or joints, that are continuous where a phase starts.
fn link_rows(phases: &[Prepared], phase: usize) -> usize {
    let (before, after) = (&phases[phase - 1].base, &phases[phase].base);
    if before == after { after.n_weights() } else { after.n_joints() }
}

impl<D: HybridDynamics> Transcription for Shooting<D> {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn rollout(&mut self, z: &[f64]) -> Result<(), EvaluationError> {
        self.roll_out(z)
    }

    fn node(&self, k: usize) -> Node<'_> {
        self.nodes.node(k, &self.stages)
    }

    fn weight(&self, k: usize) -> f64 {
        self.nodes.weight(k)
    }

    fn defects(&self) -> &[f64] {
        &self.defects
    }

    fn variables_of_node(&self, k: usize) -> Vec<usize> {
        self.segments[self.segment_of(k)].variables.clone()
    }

    fn variables_of_defect(&self, i: usize) -> Vec<usize> {
        let after = self.segments.partition_point(|segment| segment.first_defect <= i) - 1;
        self.segments[after].gap_variables.clone()
    }

    fn pull_back(&mut self, by: &RolloutGradient, gradient: &mut [f64]) -> Result<(), EvaluationError> {
        self.sweep_backward(by, gradient)
    }

    fn second_derivatives(&mut self) -> Option<&mut dyn RolloutSecondDerivatives> {
        let has_fixed_durations = self.layout.durations.iter().all(Option::is_none);
        let is_curved = has_fixed_durations && self.dynamics.second_derivatives().is_some();
        if is_curved { Some(self) } else { None }
    }

    fn push_forward(
        &mut self,
        defects: &mut [f64],
        visit: &mut crate::transcription::Visit<'_>,
    ) -> Result<(), EvaluationError> {
        self.sweep_forward(defects, visit)
    }
}

impl<D: HybridDynamics> RolloutSecondDerivatives for Shooting<D> {
    fn add_second_derivatives(
        &mut self,
        by: &RolloutGradient,
        pattern: &Pattern,
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.sweep_curvature(by, pattern, hessian)
    }
}
