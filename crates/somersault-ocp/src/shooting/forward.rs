//! Tangents of a rollout along all variables on which a segment depends.

use super::curvature::Sum;
use super::table::push_forward;
use super::trajectory::moves_per_step;
use super::{Drive, Segment, Shooting};
use crate::dynamics::{GroupTransport, HybridDynamics};
use crate::transcription::{NodeSizes, NodeTangent, Visit};
use nalgebra::DMatrix;
use somersault_nlp::EvaluationError;

/// Tangents of a segment: one row for each of its variables, one column for each degree of freedom.
#[derive(Debug)]
pub(super) struct Work {
    /// Positions and velocities at the start of a step.
    state: [DMatrix<f64>; 2],
    stages: Vec<Stage>,
    moving: DMatrix<f64>,
    along: DMatrix<f64>,
    node: NodeTangent,
    /// Of the gap at the start of the segment, by the displacement there.
    gap: DMatrix<f64>,
}

#[derive(Debug)]
struct Stage {
    position: DMatrix<f64>,
    velocity: DMatrix<f64>,
    known: DMatrix<f64>,
    found: DMatrix<f64>,
}

impl Stage {
    /// Of what the dynamics take.
    fn inputs(&self) -> [&DMatrix<f64>; 3] {
        [&self.position, &self.velocity, &self.known]
    }
}

impl Work {
    pub(super) fn new(sizes: &NodeSizes, variables: &[usize]) -> Self {
        let room = || DMatrix::zeros(variables.len(), sizes.n_velocities);
        let stage = || Stage { position: room(), velocity: room(), known: room(), found: room() };
        Self {
            state: [room(), room()],
            stages: (0..4).map(|_| stage()).collect(),
            moving: room(),
            along: room(),
            node: NodeTangent::new(sizes, variables.to_vec()),
            gap: room(),
        }
    }
}

/// Which of the moves of a step, with its factors and length.
struct Move<'a> {
    transport: &'a GroupTransport,
    factors: &'a [f64],
    h: f64,
    /// Row of the duration, if it is free, and ∂h by it.
    duration: Option<(usize, f64)>,
}

impl Move<'_> {
    /// out ← A from + J ∂δ, δ = h Σ f_i v_i.
    fn push(
        &self,
        from: &DMatrix<f64>,
        stages: &[Stage],
        velocities: [&[f64]; 4],
        passive: &[usize],
        moving: &mut DMatrix<f64>,
        out: &mut DMatrix<f64>,
    ) {
        moving.fill(0.0);
        for (i, factor) in self.factors.iter().enumerate().filter(|(_, f)| **f != 0.0) {
            for dof in passive {
                moving.column_mut(*dof).axpy(self.h * factor, &stages[i].velocity.column(*dof), 1.0);
                if let Some((row, by_duration)) = self.duration {
                    moving[(row, *dof)] += by_duration * factor * velocities[i][*dof];
                }
            }
        }
        self.transport.each_row(moving, GroupTransport::jacobian);
        out.copy_from(from);
        self.transport.each_row(out, GroupTransport::along);
        *out += &*moving;
    }
}

impl GroupTransport {
    fn each_row(&self, tangents: &mut DMatrix<f64>, apply: impl Fn(&Self, &mut [f64])) {
        if self.is_trivial() {
            return;
        }
        let mut row = [0.0; 64];
        for r in 0..tangents.nrows() {
            // groups come from joints of a tree; trees of more than 64 degrees of freedom take the slow way
            let n = tangents.ncols();
            if n <= row.len() {
                (0..n).for_each(|j| row[j] = tangents[(r, j)]);
                apply(self, &mut row[..n]);
                (0..n).for_each(|j| tangents[(r, j)] = row[j]);
            } else {
                let mut row: Vec<f64> = tangents.row(r).iter().copied().collect();
                apply(self, &mut row);
                row.iter().enumerate().for_each(|(j, x)| tangents[(r, j)] = *x);
            }
        }
    }
}

impl<D: HybridDynamics> Shooting<D> {
    pub(super) fn sweep_forward(
        &mut self,
        defects: &mut [f64],
        visit: &mut Visit<'_>,
    ) -> Result<(), EvaluationError> {
        self.linearise()?;
        let mut defects = defects;
        let mut works = std::mem::take(&mut self.forward);
        let mut done = Ok(());
        for number in 0..works.len() {
            let (before, work) = works.split_at_mut(number);
            let work = &mut work[0];
            self.push_start(number, work);
            if let Some(before) = before.last_mut() {
                defects = self.push_gap(number, before, work, defects);
            }
            done = self.push_segment(number, work, visit);
            if done.is_err() {
                break;
            }
        }
        self.forward = works;
        done
    }

    /// Row of the own duration of a phase, if it is free, and the change of h with it.
    fn duration_row(&self, segment: &Segment) -> Option<(usize, f64)> {
        let variable = self.layout.durations[segment.phase]?;
        let row = segment.variables.binary_search(&variable).ok()?;
        Some((row, 1.0 / self.phases[segment.phase].n_steps as f64))
    }

    fn push_start(&self, number: usize, work: &mut Work) {
        let segment = &self.segments[number];
        let row = |variable: &usize| segment.variables.binary_search(variable).unwrap_or(0);
        work.state.iter_mut().for_each(|part| part.fill(0.0));
        for (dof, variable) in &segment.position_variables {
            work.state[0][(row(variable), *dof)] = 1.0;
        }
        segment.transport.each_row(&mut work.state[0], GroupTransport::jacobian);
        for (dof, variable) in &segment.velocity_variables {
            work.state[1][(row(variable), *dof)] = 1.0;
        }
    }

    fn push_segment(
        &self,
        number: usize,
        work: &mut Work,
        visit: &mut Visit<'_>,
    ) -> Result<(), EvaluationError> {
        let segment = &self.segments[number];
        let prepared = &self.phases[segment.phase];
        for step in segment.steps.clone() {
            let node = prepared.first_node + step;
            self.push_node(segment, step, work);
            visit(node, &self.nodes.node(node, &self.stages), self.nodes.weight(node), &work.node)?;
            self.push_step(segment, step, work);
        }
        if segment.steps.end == prepared.n_steps {
            let node = prepared.first_node + prepared.n_steps;
            self.push_node(segment, prepared.n_steps, work);
            visit(node, &self.nodes.node(node, &self.stages), self.nodes.weight(node), &work.node)?;
        }
        Ok(())
    }

    /// Adds the second derivatives of all stages of a segment.
    pub(super) fn bend_segment(&self, number: usize, work: &mut Work, sum: &mut Sum<'_>) {
        let segment = &self.segments[number];
        let prepared = &self.phases[segment.phase];
        self.push_start(number, work);
        for step in segment.steps.clone() {
            self.push_node(segment, step, work);
            self.push_step(segment, step, work);
            let first = self.stages.number(prepared.first_node + step, 0);
            work.stages
                .iter()
                .take(self.n_stages())
                .enumerate()
                .for_each(|(s, stage)| sum.add(first + s, stage.inputs()));
        }
        if segment.steps.end == prepared.n_steps {
            self.push_node(segment, prepared.n_steps, work);
            sum.add(self.stages.number(prepared.first_node + prepared.n_steps, 0), work.stages[0].inputs());
        }
    }

    /// The first stage of a step, and with it the node.
    fn push_node(&self, segment: &Segment, step: usize, work: &mut Work) {
        let prepared = &self.phases[segment.phase];
        let node = prepared.first_node + step;
        let [position, velocity] = &work.state;
        work.stages[0].position.copy_from(position);
        work.stages[0].velocity.copy_from(velocity);
        self.push_stage(segment, step, 0, &mut work.stages[0], true);
        let Work { stages, node: tangent, .. } = work;
        let stage = &stages[0];
        tangent.position.copy_from(&stage.position);
        tangent.velocity.copy_from(&stage.velocity);
        for (dof, active) in self.dynamics.dofs().active.iter().enumerate() {
            let (a, tau) = if *active { (&stage.known, &stage.found) } else { (&stage.found, &stage.known) };
            tangent.acceleration.column_mut(dof).copy_from(&a.column(dof));
            tangent.torque.column_mut(dof).copy_from(&tau.column(dof));
        }
        let point = self.point(step, 0);
        let duration = prepared.duration;
        let scale = [1.0, 1.0 / duration, 1.0 / (duration * duration)];
        let by_duration = self.duration_row(segment);
        let values = self.stages.channels(self.stages.number(node, 0));
        let NodeTangent { channel, channel_rate, channel_second_rate, .. } = tangent;
        for (d, part) in [channel, channel_rate, channel_second_rate].into_iter().enumerate() {
            part.fill(0.0);
            for c in 0..prepared.table.n_channels() {
                for entry in prepared.table.entries(point, c) {
                    if let Some(row) = segment.rows[entry.parameter] {
                        part[(row, c)] = entry.values[d] * scale[d];
                    }
                }
                if let Some((row, _)) = by_duration {
                    part[(row, c)] = -(d as f64) * values[d][c] / duration;
                }
            }
        }
        tangent.time.fill(0.0);
        tangent.weight.fill(0.0);
        for variable in self.layout.durations[..segment.phase].iter().flatten() {
            if let Ok(row) = segment.variables.binary_search(variable) {
                tangent.time[row] = 1.0;
            }
        }
        if let Some((row, _)) = by_duration {
            tangent.time[row] = step as f64 / prepared.n_steps as f64;
            tangent.weight[row] = prepared.quadrature[step];
        }
    }

    /// What drives a stage and what is found there, from its passive state.
    fn push_stage(&self, segment: &Segment, step: usize, s: usize, stage: &mut Stage, torques: bool) {
        let prepared = &self.phases[segment.phase];
        let i = self.stages.number(prepared.first_node + step, s);
        let Stage { position, velocity, known, found } = stage;
        known.fill(0.0);
        let moves = matches!(self.drive, Drive::Motion);
        if moves {
            for (dof, _) in &self.driven {
                position.column_mut(*dof).fill(0.0);
                velocity.column_mut(*dof).fill(0.0);
            }
        }
        let point = self.point(step, s);
        let base = &prepared.base;
        push_forward(&prepared.table, base, point, prepared.duration, &segment.rows, |row, joint, values| {
            let dof = self.driven[joint].0;
            if moves {
                position[(row, dof)] += values[0];
                velocity[(row, dof)] += values[1];
                known[(row, dof)] += values[2];
            } else {
                known[(row, dof)] += values[0];
            }
        });
        if let (true, Some((row, _))) = (moves, self.duration_row(segment)) {
            for (dof, _) in &self.driven {
                velocity[(row, *dof)] -= self.stages.velocity(i)[*dof] / prepared.duration;
                known[(row, *dof)] -= 2.0 * self.stages.known(i)[*dof] / prepared.duration;
            }
        }
        found.fill(0.0);
        let active = &self.dynamics.dofs().active;
        let n = active.len();
        for (matrix, tangents) in self.stages.partials(i).into_iter().zip([position, velocity, known]) {
            for (k, column) in tangents.column_iter().enumerate() {
                for (row, factor) in matrix[k * n..(k + 1) * n].iter().enumerate() {
                    if *factor != 0.0 && (torques || !active[row]) {
                        found.column_mut(row).axpy(*factor, &column, 1.0);
                    }
                }
            }
        }
    }

    /// From the first stage, which is there, to the end of a step.
    fn push_step(&self, segment: &Segment, step: usize, work: &mut Work) {
        let tableau = self.scheme.tableau();
        let prepared = &self.phases[segment.phase];
        let node = prepared.first_node + step;
        let (first, h) = (self.stages.number(node, 0), prepared.step());
        let first_move = node * moves_per_step(self.scheme);
        let n_stages = self.scheme.n_stages();
        let velocities = std::array::from_fn(|i| self.stages.velocity(first + i.min(n_stages - 1)));
        let duration = self.duration_row(segment);
        let Work { state, stages, moving, along, .. } = work;
        for (s, inner) in (1..self.n_stages()).zip(tableau.stages) {
            let transport = &self.stages.transports[first_move + s - 1];
            let step_to = Move { transport, factors: inner.factors, h, duration };
            step_to.push(&stages[inner.from].position, stages, velocities, &self.passive, moving, along);
            stages[s].position.copy_from(along);
            self.push_sum(first, tableau.on_vectors.rows[s], h, duration, stages, along);
            stages[s].velocity.copy_from(along);
            self.push_stage(segment, step, s, &mut stages[s], false);
        }
        for (m, exponential) in tableau.end.iter().enumerate() {
            let transport = &self.stages.transports[first_move + n_stages - 1 + m];
            let step_to = Move { transport, factors: exponential.factors, h, duration };
            step_to.push(&state[0], stages, velocities, &self.passive, moving, along);
            state[0].copy_from(along);
        }
        self.push_sum(first, tableau.on_vectors.weights.factors, h, duration, stages, along);
        state[1].copy_from(along);
    }

    /// out ← ∂(v₀ + h Σ f_i a_i).
    fn push_sum(
        &self,
        first: usize,
        factors: &[f64],
        h: f64,
        duration: Option<(usize, f64)>,
        stages: &[Stage],
        out: &mut DMatrix<f64>,
    ) {
        out.copy_from(&stages[0].velocity);
        for (i, factor) in factors.iter().enumerate().filter(|(_, f)| **f != 0.0) {
            for dof in &self.passive {
                out.column_mut(*dof).axpy(h * factor, &stages[i].found.column(*dof), 1.0);
                if let Some((row, by_duration)) = duration {
                    out[(row, *dof)] += by_duration * factor * self.stages.found(first + i)[*dof];
                }
            }
        }
    }

    /// The gradients of the defects at the start of a segment, from the end of the one before it; returns the rest.
    fn push_gap<'a>(
        &self,
        number: usize,
        before: &mut Work,
        work: &mut Work,
        defects: &'a mut [f64],
    ) -> &'a mut [f64] {
        let (from, to) = (&self.segments[number - 1], &self.segments[number]);
        let n_defects = self.defects_end(number) - to.first_defect;
        let n_passive = self.passive.len();
        let all = &to.gap_variables;
        let (rows, rest) = defects.split_at_mut(n_defects * all.len());
        rows.fill(0.0);
        let mut add = |defect: usize, variable: usize, value: f64| {
            if let Ok(at) = all.binary_search(&variable) {
                rows[defect * all.len() + at] += value;
            }
        };
        // the end is not needed for anything else
        let ends = &mut before.state;
        to.gap.each_row(&mut ends[0], GroupTransport::jacobian);
        work.gap.copy_from(&work.state[0]);
        to.gap.each_row(&mut work.gap, GroupTransport::along);
        to.gap.each_row(&mut work.gap, GroupTransport::jacobian);
        for (part, (end, start)) in ends.iter().zip([&work.gap, &work.state[1]]).enumerate() {
            for (i, dof) in self.passive.iter().enumerate() {
                let defect = part * n_passive + i;
                for (r, variable) in from.variables.iter().enumerate() {
                    add(defect, *variable, end[(r, *dof)]);
                }
                for (r, variable) in to.variables.iter().enumerate() {
                    add(defect, *variable, -start[(r, *dof)]);
                }
            }
        }
        self.push_links(number, 2 * n_passive, n_defects, &mut add);
        rest
    }

    /// What is continuous where a phase starts.
    fn push_links(
        &self,
        number: usize,
        first: usize,
        n_defects: usize,
        add: &mut impl FnMut(usize, usize, f64),
    ) {
        let n = (n_defects - first) / 2;
        if n == 0 {
            return;
        }
        let before = self.segments[number].phase - 1;
        let same_base = self.phases[before].base == self.phases[before + 1].base;
        for (side, sign) in [(before, 1.0), (before + 1, -1.0)] {
            let prepared = &self.phases[side];
            let step = if side == before { prepared.n_steps } else { 0 };
            let (point, duration) = (step * self.scheme.points_per_step(), prepared.duration);
            let node = self.stages.number(prepared.first_node + step, 0);
            let rates = self.stages.channels(node)[1];
            let directions = prepared.base.directions();
            for c in 0..prepared.table.n_channels() {
                for row in 0..n {
                    let direction = match same_base {
                        true => f64::from(u8::from(row == c)),
                        false => directions[(row, c)],
                    };
                    if direction == 0.0 {
                        continue;
                    }
                    let factor = sign * direction;
                    for entry in prepared.table.entries(point, c) {
                        let variable = self.layout.parameters[side].start + entry.parameter;
                        add(first + row, variable, factor * entry.values[0]);
                        add(first + n + row, variable, factor * entry.values[1] / duration);
                    }
                    if let Some(variable) = self.layout.durations[side] {
                        add(first + n + row, variable, -factor * rates[c] / duration);
                    }
                }
            }
        }
    }
}
