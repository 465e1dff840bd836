//! One step after another, and what all sweeps need of them.

use super::trajectory::moves_per_step;
use super::{Drive, Prepared, Shooting};
use crate::dynamics::HybridDynamics;
use somersault_nlp::EvaluationError;

/// The stages that a sum takes, with their factors. The others may hold what an earlier motion without a value left there.
fn summed(factors: &[f64]) -> impl Iterator<Item = (usize, f64)> + '_ {
    factors.iter().copied().enumerate().filter(|(_, factor)| *factor != 0.0)
}

impl Prepared {
    /// Length of a step, s.
    pub(super) fn step(&self) -> f64 {
        self.duration / self.n_steps as f64
    }
}

impl<D: HybridDynamics> Shooting<D> {
    /// Stages of a step that are evaluated. Where all joints move by splines nothing is integrated, and its node is enough.
    pub(super) fn n_stages(&self) -> usize {
        if self.passive.is_empty() { 1 } else { self.scheme.n_stages() }
    }

    /// The segment to which a node belongs.
    pub(super) fn segment_of(&self, node: usize) -> usize {
        let first = |s: &super::Segment| self.phases[s.phase].first_node + s.steps.start;
        self.segments.partition_point(|s| first(s) <= node) - 1
    }

    pub(super) fn roll_out(&mut self, z: &[f64]) -> Result<(), EvaluationError> {
        self.z.copy_from_slice(z);
        self.linearised = false;
        self.set_times();
        for number in 0..self.segments.len() {
            self.start_segment(number)?;
            let (phase, steps) = (self.segments[number].phase, self.segments[number].steps.clone());
            for step in steps.clone() {
                let ends = step + 1 == steps.end;
                self.step(phase, step, ends.then_some(number))?;
            }
            if steps.end == self.phases[phase].n_steps {
                let node = self.phases[phase].first_node + steps.end;
                let i = self.stages.number(node, 0);
                let stage = self.stages.stage_mut(i);
                stage.position.copy_from_slice(&self.segments[number].end_position);
                stage.velocity.copy_from_slice(&self.segments[number].end_velocity);
                self.evaluate(node, 0, phase, steps.end)?;
            }
        }
        self.gaps()
    }

    fn set_times(&mut self) {
        let Self { phases, layout, nodes, z, .. } = self;
        let mut start = 0.0;
        for (phase, variable) in phases.iter_mut().zip(&layout.durations) {
            phase.duration = variable.map_or(phase.fixed_duration, |k| z[k]);
            phase.start_time = start;
            for (k, weight) in phase.quadrature.iter().enumerate() {
                nodes.time[phase.first_node + k] = start + phase.duration * k as f64 / phase.n_steps as f64;
                nodes.weight[phase.first_node + k] = phase.duration * weight;
            }
            start += phase.duration;
        }
    }

    /// Writes the passive state at the start of a segment to its first node.
    fn start_segment(&mut self, number: usize) -> Result<(), EvaluationError> {
        let segment = &self.segments[number];
        let delta = &mut self.backward.delta;
        delta.fill(0.0);
        for (dof, variable) in &segment.position_variables {
            delta[*dof] = self.z[*variable];
        }
        let node = self.phases[segment.phase].first_node + segment.steps.start;
        let stage = self.stages.stage_mut(node * self.scheme.n_stages());
        self.dynamics.displace(&segment.position, delta, stage.position)?;
        stage.velocity.copy_from_slice(&segment.velocity);
        for (dof, variable) in &segment.velocity_variables {
            stage.velocity[*dof] += self.z[*variable];
        }
        Ok(())
    }

    /// Integrates a step; its end goes to the next node, or is the end of a segment.
    fn step(&mut self, phase: usize, step: usize, ends: Option<usize>) -> Result<(), EvaluationError> {
        let tableau = self.scheme.tableau();
        let node = self.phases[phase].first_node + step;
        let h = self.phases[phase].step();
        let first = self.stages.number(node, 0);
        self.evaluate(node, 0, phase, step)?;
        for (s, inner) in (1..self.n_stages()).zip(tableau.stages) {
            self.displacement(first, inner.factors, h);
            let Self { dynamics, stages, backward, .. } = self;
            let (from, to) = stages.positions_apart(first + inner.from, first + s);
            dynamics.displace(from, &backward.delta, to)?;
            self.accelerate(first, tableau.on_vectors.rows[s], h);
            let stage = self.stages.stage_mut(first + s);
            stage.velocity.copy_from_slice(&self.backward.velocity);
            self.evaluate(node, s, phase, step)?;
        }
        self.backward.position.copy_from_slice(self.stages.position(first));
        for exponential in tableau.end {
            self.displacement(first, exponential.factors, h);
            let super::backward::Work { delta, position, moved, .. } = &mut self.backward;
            self.dynamics.displace(position, delta, moved)?;
            std::mem::swap(position, moved);
        }
        self.accelerate(first, tableau.on_vectors.weights.factors, h);
        let super::backward::Work { position, velocity, .. } = &self.backward;
        let (end_position, end_velocity) = match ends {
            Some(number) => {
                let segment = &mut self.segments[number];
                (&mut segment.end_position[..], &mut segment.end_velocity[..])
            }
            None => {
                let next = self.stages.number(node + 1, 0);
                let stage = self.stages.stage_mut(next);
                (stage.position, stage.velocity)
            }
        };
        end_position.copy_from_slice(position);
        end_velocity.copy_from_slice(velocity);
        Ok(())
    }

    /// delta ← h Σ f_i v_i for the passive degrees of freedom.
    pub(super) fn displacement(&mut self, first: usize, factors: &[f64], h: f64) {
        let Self { stages, backward, passive, .. } = self;
        for dof in &*passive {
            let velocities = summed(factors).map(|(i, factor)| factor * stages.velocity(first + i)[*dof]);
            backward.delta[*dof] = h * velocities.sum::<f64>();
        }
    }

    /// velocity ← v₀ + h Σ f_i a_i for the passive degrees of freedom.
    fn accelerate(&mut self, first: usize, factors: &[f64], h: f64) {
        let Self { stages, backward, passive, .. } = self;
        backward.velocity.copy_from_slice(stages.velocity(first));
        for dof in &*passive {
            let accelerations = summed(factors).map(|(i, factor)| factor * stages.found(first + i)[*dof]);
            backward.velocity[*dof] += h * accelerations.sum::<f64>();
        }
    }

    /// The point of the tables at which a stage is.
    pub(super) fn point(&self, step: usize, stage: usize) -> usize {
        step * self.scheme.points_per_step() + self.scheme.point(stage)
    }

    /// Completes a stage, whose passive state is there, by what drives it and by the dynamics.
    fn evaluate(&mut self, node: usize, s: usize, phase: usize, step: usize) -> Result<(), EvaluationError> {
        let point = self.point(step, s);
        let Self { dynamics, stages, nodes, phases, layout, z, drive, driven, backward, .. } = self;
        let prepared = &phases[phase];
        let i = stages.number(node, s);
        let stage = stages.stage_mut(i);
        let [c, rate, second] = stage.channels;
        let p = &z[layout.parameters[phase].clone()];
        prepared.table.channels(point, p, prepared.duration, [&mut *c, &mut *rate, &mut *second]);
        stage.known.fill(0.0);
        let joints = &mut backward.joints[0][..];
        match drive {
            Drive::Motion => {
                prepared.base.positions_into(c, joints);
                driven.iter().zip(&*joints).for_each(|((_, at), x)| stage.position[*at] = *x);
                prepared.base.rates_into(rate, joints);
                driven.iter().zip(&*joints).for_each(|((dof, _), x)| stage.velocity[*dof] = *x);
                prepared.base.rates_into(second, joints);
            }
            Drive::Torque { .. } => prepared.base.positions_into(c, joints),
        }
        driven.iter().zip(&*joints).for_each(|((dof, _), x)| stage.known[*dof] = *x);
        dynamics.calc(stage.position, stage.velocity, stage.known, stage.found)?;
        if !stage.found.iter().chain(&*stage.position).all(|x| x.is_finite()) {
            let what = format!("the motion at t = {}", nodes.time[node]);
            return Err(EvaluationError::Undefined { what });
        }
        if s == 0 {
            nodes.sort(node, stages, &dynamics.dofs().active);
        }
        Ok(())
    }

    /// Defects at the start of each segment but the first.
    fn gaps(&mut self) -> Result<(), EvaluationError> {
        for number in 1..self.segments.len() {
            self.gap_displacement(number)?;
            let (before, after) = (&self.segments[number - 1], &self.segments[number]);
            let start = self.stages.number(self.phases[after.phase].first_node + after.steps.start, 0);
            let (mut at, velocity) = (after.first_defect, self.stages.velocity(start));
            for dof in &self.passive {
                self.defects[at] = self.backward.delta[*dof];
                self.defects[at + self.passive.len()] = before.end_velocity[*dof] - velocity[*dof];
                at += 1;
            }
            at += self.passive.len();
            if at == self.defects_end(number) {
                continue;
            }
            let before_node = self.stages.number(self.phases[after.phase].first_node - 1, 0);
            if self.phases[before.phase].base == self.phases[after.phase].base {
                let (ends, starts) = (self.stages.channels(before_node), self.stages.channels(start));
                let n = ends[0].len();
                for i in 0..n {
                    self.defects[at + i] = ends[0][i] - starts[0][i];
                    self.defects[at + n + i] = ends[1][i] - starts[1][i];
                }
            } else {
                let n = self.driven.len();
                for (i, (dof, place)) in self.driven.iter().enumerate() {
                    let positions = [before_node, start].map(|k| self.stages.position(k)[*place]);
                    let velocities = [before_node, start].map(|k| self.stages.velocity(k)[*dof]);
                    self.defects[at + i] = positions[0] - positions[1];
                    self.defects[at + n + i] = velocities[0] - velocities[1];
                }
            }
        }
        Ok(())
    }

    /// The number after the last defect of the gap at the start of a segment.
    pub(super) fn defects_end(&self, number: usize) -> usize {
        self.segments.get(number + 1).map_or(self.defects.len(), |next| next.first_defect)
    }

    /// delta ← the displacement from the start of a segment to the end of the one before it.
    fn gap_displacement(&mut self, number: usize) -> Result<(), EvaluationError> {
        let after = &self.segments[number];
        let start = self.stages.number(self.phases[after.phase].first_node + after.steps.start, 0);
        let end = &self.segments[number - 1].end_position;
        self.dynamics.difference(self.stages.position(start), end, &mut self.backward.delta)?;
        for (dof, active) in self.dynamics.dofs().active.iter().enumerate() {
            if *active {
                self.backward.delta[dof] = 0.0;
            }
        }
        Ok(())
    }

    /// The partials of all stages and the derivatives of all moves, once for a rollout.
    pub(super) fn linearise(&mut self) -> Result<(), EvaluationError> {
        if self.linearised {
            return Ok(());
        }
        let tableau = self.scheme.tableau();
        for phase in 0..self.phases.len() {
            let (h, n_steps) = (self.phases[phase].step(), self.phases[phase].n_steps);
            let first_node = self.phases[phase].first_node;
            for node in first_node..=first_node + n_steps {
                let last = node == first_node + n_steps;
                let first = self.stages.number(node, 0);
                for s in 0..if last { 1 } else { self.n_stages() } {
                    let stage = self.stages.stage_mut(first + s);
                    self.dynamics.calc_diff(stage.position, stage.velocity, stage.known, stage.partials)?;
                }
                if last {
                    continue;
                }
                let to_end = tableau.end.iter().map(|exponential| exponential.factors);
                let moves = tableau.stages.iter().map(|inner| inner.factors).chain(to_end);
                for (m, factors) in moves.enumerate() {
                    self.displacement(first, factors, h);
                    let transport = &mut self.stages.transports[node * moves_per_step(self.scheme) + m];
                    transport.set(&self.dynamics, &self.backward.delta);
                }
            }
        }
        for number in 0..self.segments.len() {
            let Self { segments, backward, z, dynamics, .. } = self;
            let segment = &mut segments[number];
            backward.delta.fill(0.0);
            for (dof, variable) in &segment.position_variables {
                backward.delta[*dof] = z[*variable];
            }
            segment.transport.set(dynamics, &backward.delta);
            if number > 0 {
                self.gap_displacement(number)?;
                let gap = &mut self.segments[number].gap;
                gap.set(&self.dynamics, &self.backward.delta);
                if !gap.invert_jacobian() {
                    let what = "the gap between segments, which differ by a whole turn,".to_owned();
                    return Err(EvaluationError::Undefined { what });
                }
            }
        }
        self.linearised = true;
        Ok(())
    }
}
