//! The adjoint of a rollout: segments, steps and stages in reverse.

use super::trajectory::moves_per_step;
use super::{Drive, Shooting};
use crate::dynamics::{GroupTransport, HybridDynamics};
use crate::term::NodeGradient;
use crate::transcription::{NodeSizes, RolloutGradient};
use somersault_nlp::EvaluationError;

/// Room for one step in either direction. Vectors are those of the whole system.
#[derive(Debug, Default)]
pub(super) struct Work {
    pub(super) delta: Vec<f64>,
    pub(super) position: Vec<f64>,
    pub(super) moved: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    /// Positions, velocities and accelerations, or forces, of the driven joints.
    pub(super) joints: [Vec<f64>; 3],
    channels: [Vec<f64>; 3],
    /// By the state at the end of the step, then at its start.
    state: [Vec<f64>; 2],
    /// By position and velocity at each stage.
    stages: [[Vec<f64>; 2]; 4],
    /// By what moves the positions, the velocity at each stage, and by the accelerations there.
    slopes: [[Vec<f64>; 2]; 4],
    known: Vec<f64>,
    found: Vec<f64>,
    moving: Vec<f64>,
    along: Vec<f64>,
}

impl Work {
    pub(super) fn new(sizes: &NodeSizes, n_driven: usize) -> Self {
        let n = sizes.n_velocities;
        let room = || vec![0.0; n];
        let pair = || [room(), room()];
        let channels = || vec![0.0; sizes.n_channels];
        Self {
            delta: room(),
            position: vec![0.0; sizes.n_positions],
            moved: vec![0.0; sizes.n_positions],
            velocity: room(),
            joints: [vec![0.0; n_driven], vec![0.0; n_driven], vec![0.0; n_driven]],
            channels: [channels(), channels(), channels()],
            state: pair(),
            stages: [pair(), pair(), pair(), pair()],
            slopes: [pair(), pair(), pair(), pair()],
            known: room(),
            found: room(),
            moving: room(),
            along: room(),
        }
    }
}

/// q ⊕ δ with δ = h Σ f_i v_i: from the gradient `by` the moved position to those by q (left in `along`), by the v_i and,
/// returned, by h.
fn pull_move(
    transport: &GroupTransport,
    by: &[f64],
    factors: &[f64],
    h: f64,
    velocities: [&[f64]; 4],
    slopes: &mut [[Vec<f64>; 2]; 4],
    moving: &mut [f64],
    along: &mut [f64],
    passive: &[usize],
) -> f64 {
    moving.copy_from_slice(by);
    along.copy_from_slice(by);
    transport.jacobian_transposed(moving);
    transport.along_transposed(along);
    let mut by_step = 0.0;
    for (i, factor) in factors.iter().enumerate().filter(|(_, f)| **f != 0.0) {
        for dof in passive {
            slopes[i][0][*dof] += h * factor * moving[*dof];
            by_step += factor * moving[*dof] * velocities[i][*dof];
        }
    }
    by_step
}

impl<D: HybridDynamics> Shooting<D> {
    pub(super) fn sweep_backward(
        &mut self,
        by: &RolloutGradient,
        gradient: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.linearise()?;
        for number in (0..self.segments.len()).rev() {
            self.pull_segment(number, by, gradient);
        }
        self.pull_times(by, gradient);
        Ok(())
    }

    /// Times and weights of the nodes by the durations.
    fn pull_times(&self, by: &RolloutGradient, gradient: &mut [f64]) {
        let mut later = 0.0;
        for (phase, variable) in self.phases.iter().zip(&self.layout.durations).rev() {
            let (mut by_duration, mut by_start) = (later, 0.0);
            for (k, weight) in phase.quadrature.iter().enumerate() {
                let node = phase.first_node + k;
                let fraction = k as f64 / phase.n_steps as f64;
                by_duration += weight * by.weights[node] + fraction * by.nodes[node].time;
                by_start += by.nodes[node].time;
            }
            if let Some(variable) = variable {
                gradient[*variable] += by_duration;
            }
            later += by_start;
        }
    }

    fn pull_segment(&mut self, number: usize, by: &RolloutGradient, gradient: &mut [f64]) {
        let (phase, steps) = (self.segments[number].phase, self.segments[number].steps.clone());
        let n_steps = self.phases[phase].n_steps;
        self.backward.state.iter_mut().for_each(|part| part.fill(0.0));
        if number + 1 < self.segments.len() {
            self.pull_gap_end(number + 1, by);
            self.pull_links(number + 1, by, gradient);
        }
        if steps.end == n_steps {
            let node = self.phases[phase].first_node + n_steps;
            let Work { state, stages, slopes, .. } = &mut self.backward;
            for (stage, state) in stages[0].iter_mut().zip(&*state) {
                stage.copy_from_slice(state);
            }
            slopes[0].iter_mut().for_each(|part| part.fill(0.0));
            self.pull_stage(node, 0, phase, n_steps, Some(&by.nodes[node]), gradient);
            let Work { state, stages, .. } = &mut self.backward;
            for (stage, state) in stages[0].iter().zip(state) {
                state.copy_from_slice(stage);
            }
        }
        for step in steps.rev() {
            self.pull_step(phase, step, by, gradient);
        }
        self.pull_start(number, by, gradient);
    }

    /// The gap at the start of segment `after`, by the state at the end of the one before it.
    fn pull_gap_end(&mut self, after: usize, by: &RolloutGradient) {
        let Self { segments, backward, passive, .. } = self;
        let Work { state, moving, .. } = backward;
        let defects = &by.defects[segments[after].first_defect..];
        moving.fill(0.0);
        passive.iter().zip(defects).for_each(|(dof, d)| moving[*dof] = *d);
        // J⁻¹ in the place of J
        segments[after].gap.jacobian_transposed(moving);
        for (i, dof) in passive.iter().enumerate() {
            state[0][*dof] += moving[*dof];
            state[1][*dof] += defects[passive.len() + i];
        }
    }

    /// What is continuous where a phase starts, by the channels on both sides.
    fn pull_links(&mut self, after: usize, by: &RolloutGradient, gradient: &mut [f64]) {
        let first = self.segments[after].first_defect + 2 * self.passive.len();
        let defects = &by.defects[first..self.defects_end(after)];
        if defects.is_empty() {
            return;
        }
        let Self { segments, phases, layout, backward, stages, scheme, .. } = self;
        let before = segments[after].phase - 1;
        let same_base = phases[before].base == phases[before + 1].base;
        let (by_value, by_rate) = defects.split_at(defects.len() / 2);
        for (side, sign) in [(before, 1.0), (before + 1, -1.0)] {
            let prepared = &phases[side];
            let channels = &mut backward.channels;
            channels.iter_mut().for_each(|part| part.fill(0.0));
            for (part, by) in channels.iter_mut().zip([by_value, by_rate]) {
                if same_base {
                    part.copy_from_slice(by);
                } else {
                    prepared.base.pull_back(by, part);
                }
                part.iter_mut().for_each(|x| *x *= sign);
            }
            let step = if side == before { prepared.n_steps } else { 0 };
            let node = stages.number(prepared.first_node + step, 0);
            let rates = stages.channels(node)[1];
            if let Some(variable) = layout.durations[side] {
                let by_duration: f64 = channels[1].iter().zip(rates).map(|(by, rate)| by * rate).sum();
                gradient[variable] -= by_duration / prepared.duration;
            }
            let point = step * scheme.points_per_step();
            let [c, rate, second] = &*channels;
            let p = &mut gradient[layout.parameters[side].clone()];
            prepared.table.pull_back(point, prepared.duration, [c, rate, second], p);
        }
    }

    fn pull_start(&mut self, number: usize, by: &RolloutGradient, gradient: &mut [f64]) {
        let Self { segments, backward, passive, .. } = self;
        let Work { state, moving, .. } = backward;
        let segment = &segments[number];
        if number > 0 {
            let defects = &by.defects[segment.first_defect..];
            moving.fill(0.0);
            passive.iter().zip(defects).for_each(|(dof, d)| moving[*dof] = *d);
            segment.gap.jacobian_transposed(moving);
            segment.gap.along_transposed(moving);
            for (i, dof) in passive.iter().enumerate() {
                state[0][*dof] -= moving[*dof];
                state[1][*dof] -= defects[passive.len() + i];
            }
        }
        segment.transport.jacobian_transposed(&mut state[0]);
        for (dof, variable) in &segment.position_variables {
            gradient[*variable] += state[0][*dof];
        }
        for (dof, variable) in &segment.velocity_variables {
            gradient[*variable] += state[1][*dof];
        }
    }

    fn pull_step(&mut self, phase: usize, step: usize, by: &RolloutGradient, gradient: &mut [f64]) {
        let tableau = self.scheme.tableau();
        let prepared = &self.phases[phase];
        let (h, node) = (prepared.step(), prepared.first_node + step);
        let first = self.stages.number(node, 0);
        let n_stages = self.scheme.n_stages();
        let first_move = node * moves_per_step(self.scheme);
        let mut by_step = 0.0;
        {
            let Self { stages: motion, backward, passive, .. } = self;
            let velocities = std::array::from_fn(|i| motion.velocity(first + i.min(n_stages - 1)));
            let Work { state, stages, slopes, moving, along, .. } = backward;
            stages.iter_mut().chain(slopes.iter_mut()).flatten().for_each(|part| part.fill(0.0));
            for dof in &*passive {
                stages[0][1][*dof] = state[1][*dof];
            }
            let weights = tableau.on_vectors.weights.factors;
            by_step += pull_sum(weights, h, &state[1], slopes, passive, |i| motion.found(first + i));
            for (m, exponential) in tableau.end.iter().enumerate().rev() {
                let factors = exponential.factors;
                let transport = &motion.transports[first_move + n_stages - 1 + m];
                by_step +=
                    pull_move(transport, &state[0], factors, h, velocities, slopes, moving, along, passive);
                state[0].copy_from_slice(along);
            }
            for dof in &*passive {
                stages[0][0][*dof] = state[0][*dof];
            }
        }
        for s in (0..self.n_stages()).rev() {
            let of_node = (s == 0).then_some(&by.nodes[node]);
            self.pull_stage(node, s, phase, step, of_node, gradient);
            let Self { stages: motion, backward, passive, .. } = self;
            let Work { state, stages, slopes, moving, along, .. } = backward;
            if s == 0 {
                for (state, stage) in state.iter_mut().zip(&stages[0]) {
                    passive.iter().for_each(|dof| state[*dof] = stage[*dof]);
                }
                continue;
            }
            let inner = &tableau.stages[s - 1];
            let velocities = std::array::from_fn(|i| motion.velocity(first + i));
            let (earlier, current) = stages.split_at_mut(s);
            let [by_position, by_velocity] = &current[0];
            let transport = &motion.transports[first_move + s - 1];
            by_step += pull_move(
                transport,
                by_position,
                inner.factors,
                h,
                velocities,
                slopes,
                moving,
                along,
                passive,
            );
            for dof in &*passive {
                earlier[inner.from][0][*dof] += along[*dof];
                earlier[0][1][*dof] += by_velocity[*dof];
            }
            let row = tableau.on_vectors.rows[s];
            by_step += pull_sum(row, h, by_velocity, slopes, passive, |i| motion.found(first + i));
        }
        if let Some(variable) = self.layout.durations[phase] {
            gradient[variable] += by_step / self.phases[phase].n_steps as f64;
        }
    }

    /// From gradients by the state, the accelerations and the node of a stage to those by its passive state, which stay
    /// in the workspace, and by the variables that drive it.
    fn pull_stage(
        &mut self,
        node: usize,
        s: usize,
        phase: usize,
        step: usize,
        of_node: Option<&NodeGradient>,
        gradient: &mut [f64],
    ) {
        let point = self.point(step, s);
        let Self { dynamics, stages: motion, phases, layout, drive, driven, backward, curvature, .. } = self;
        let (active, prepared) = (&dynamics.dofs().active, &phases[phase]);
        let Work { stages, slopes, known, found, joints, channels, .. } = backward;
        let i = motion.number(node, s);
        let [by_position, by_velocity] = &mut stages[s];
        for (dof, active) in active.iter().enumerate() {
            let (acceleration, torque) = of_node.map_or((0.0, 0.0), |g| (g.acceleration[dof], g.torque[dof]));
            if let Some(g) = of_node {
                by_position[dof] += g.position[dof];
                by_velocity[dof] += g.velocity[dof];
            }
            by_velocity[dof] += slopes[s][0][dof];
            (known[dof], found[dof]) =
                if *active { (acceleration, torque) } else { (torque, acceleration + slopes[s][1][dof]) };
        }
        let n = active.len();
        if let Some(weights) = curvature.weights.get_mut(i * n..(i + 1) * n) {
            weights.copy_from_slice(found);
        }
        for (matrix, out) in motion.partials(i).into_iter().zip([by_position, by_velocity, &mut *known]) {
            for (column, out) in matrix.chunks_exact(n).zip(out.iter_mut()) {
                *out += column.iter().zip(&*found).map(|(a, b)| a * b).sum::<f64>();
            }
        }
        let [by_position, by_velocity] = &stages[s];
        for (j, (dof, _)) in driven.iter().enumerate() {
            match drive {
                Drive::Motion => {
                    joints[0][j] = by_position[*dof];
                    joints[1][j] = by_velocity[*dof];
                    joints[2][j] = known[*dof];
                }
                Drive::Torque { .. } => joints[0][j] = known[*dof],
            }
        }
        channels.iter_mut().for_each(|part| part.fill(0.0));
        let n_rates = if matches!(drive, Drive::Motion) { 3 } else { 1 };
        for (channels, joints) in channels.iter_mut().zip(&*joints).take(n_rates) {
            prepared.base.pull_back(joints, channels);
        }
        if let Some(g) = of_node {
            for (part, by) in channels.iter_mut().zip([&g.channel, &g.channel_rate, &g.channel_second_rate]) {
                part.iter_mut().zip(by).for_each(|(x, by)| *x += by);
            }
        }
        let [c, rate, second] = &*channels;
        if let Some(variable) = layout.durations[phase] {
            let [_, rates, second_rates] = motion.channels(i);
            let first: f64 = rate.iter().zip(rates).map(|(by, x)| by * x).sum();
            let twice: f64 = second.iter().zip(second_rates).map(|(by, x)| by * x).sum();
            gradient[variable] -= (first + 2.0 * twice) / prepared.duration;
        }
        let p = &mut gradient[layout.parameters[phase].clone()];
        prepared.table.pull_back(point, prepared.duration, [c, rate, second], p);
    }
}

/// v₀ + h Σ f_i a_i: from the gradient `by` the sum to those by the a_i and, returned, by h.
fn pull_sum<'a>(
    factors: &[f64],
    h: f64,
    by: &[f64],
    slopes: &mut [[Vec<f64>; 2]; 4],
    passive: &[usize],
    accelerations: impl Fn(usize) -> &'a [f64],
) -> f64 {
    let mut by_step = 0.0;
    for (i, factor) in factors.iter().enumerate().filter(|(_, f)| **f != 0.0) {
        let found = accelerations(i);
        for dof in passive {
            slopes[i][1][*dof] += h * factor * by[*dof];
            by_step += factor * by[*dof] * found[*dof];
        }
    }
    by_step
}
