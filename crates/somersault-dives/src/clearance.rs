//! Distances of limbs along a dive, as constraints.
//!
//! Rows are at single times and of the smooth distances D of [`nearest_points`](crate::nearest_points), which exceed the
//! true ones d of the axes: D² ≤ d² + ε²/2. With radii r and r′ and the requested clearance c a row is therefore
//!
//! ```text
//! D − r − r′ ≥ √((r + r′ + c + m)² + ε²/2) − r − r′   ⇒   d − r − r′ ≥ c + m
//! ```
//! The margin m is what limbs may approach between two times without a breach of c. Where they approach more the
//! [search](crate::DiveSearch) adds a time.

use crate::capsule::PREFERENCE;
use crate::program::entry;
use crate::{Body, Clearance, Dive};
use somersault_multibody::joint_motion::SplineMotion;
use somersault_multibody::{Data, DynamicsError, Model};
use std::f64::consts::SQRT_2;

/// The rows of a program for the distances of all pairs of capsules at all clearance times.
#[derive(Debug, Clone)]
pub(crate) struct ClearanceRows {
    body: Body,
    /// With the pairs that need no rows, too.
    whole: Body,
    /// Of the program.
    first_row: usize,
    /// Least value of the rows of each pair, m.
    bounds: Vec<f64>,
    /// Fractions of the duration.
    fractions: Vec<f64>,
    /// Parameters on which the posture at each time depends.
    parameters: Vec<Vec<usize>>,
    /// Where the Jacobian has the entries, row by row.
    places: Vec<usize>,
    data: Data,
    q: Vec<f64>,
    channels: Vec<f64>,
    distances: Vec<f64>,
    gradients: Vec<f64>,
    by_channel: Vec<f64>,
    by_coefficient: Vec<f64>,
    by_parameter: Vec<f64>,
    basis: Vec<f64>,
}

/// m of the constraints, m.
const MARGIN: f64 = 5e-5;
/// Pairs that stay farther apart than this in all postures between those of a dive are left out, m.
const FAR: f64 = 0.02;
/// Step of the differences of gradients.
const STEP: f64 = 1e-6;
/// Steps of the grid of weights on which they are looked at.
const GRID: usize = 4;

impl ClearanceRows {
    pub(crate) fn try_new(
        dive: &Dive,
        model: &Model,
        motion: &SplineMotion,
        clearance: Clearance,
        added: &[f64],
        first_row: usize,
    ) -> Result<Self, DynamicsError> {
        let whole = Body::try_new(model)?;
        let mut body = whole.clone();
        let mut data = Data::new(model);
        let mut q = model.neutral();
        let near = least_distances(dive, model, &body, &mut data, &mut q)?;
        body.retain_pairs(|k| near[k] < clearance.distance + FAR);
        let n_times = clearance.n_times;
        let equidistant = (1..=n_times).map(|k| k as f64 / (n_times + 1) as f64);
        let fractions: Vec<f64> = equidistant.chain(added.iter().copied()).collect();
        let n = motion.basis().n_coefficients();
        let mut basis = vec![0.0; motion.basis().n_active()];
        let parameters = fractions
            .iter()
            .map(|fraction| {
                let first = motion.basis().evaluate(*fraction, 0, &mut basis);
                let is_active = |c: usize| (first..first + basis.len()).contains(&(c % n));
                let active = motion.dependences().filter(|(c, ..)| is_active(*c));
                let mut found: Vec<usize> = active.map(|(_, parameter, _)| parameter).collect();
                found.sort_unstable();
                found.dedup();
                found
            })
            .collect();
        let bound = |radii: f64| (radii + clearance.distance + MARGIN).hypot(PREFERENCE / SQRT_2) - radii;
        let n_pairs = body.pairs().len();
        Ok(Self {
            distances: vec![0.0; n_pairs],
            gradients: vec![0.0; n_pairs * motion.base().n_joints()],
            by_channel: vec![0.0; motion.n_channels()],
            by_coefficient: vec![0.0; motion.n_coefficients()],
            by_parameter: vec![0.0; motion.n_parameters()],
            channels: vec![0.0; motion.n_channels()],
            bounds: body.radii().map(bound).collect(),
            body,
            whole,
            first_row,
            fractions,
            parameters,
            places: Vec::new(),
            data,
            q,
            basis,
        })
    }

    /// With all pairs, near and far.
    pub(crate) fn whole_body(&self) -> &Body {
        &self.whole
    }

    /// Fractions of the duration at which the clearance is a constraint.
    pub(crate) fn fractions(&self) -> &[f64] {
        &self.fractions
    }

    /// Least value of each row.
    pub(crate) fn bounds(&self) -> impl Iterator<Item = f64> {
        self.fractions.iter().flat_map(|_| self.bounds.iter().copied())
    }

    /// Row and column of what may be other than zero in the Jacobian, row by row.
    pub(crate) fn entries(&self) -> impl Iterator<Item = (usize, usize)> {
        let n_pairs = self.distances.len();
        self.parameters.iter().enumerate().flat_map(move |(time, parameters)| {
            let rows = (0..n_pairs).map(move |pair| self.first_row + time * n_pairs + pair);
            rows.flat_map(move |row| parameters.iter().map(move |parameter| (row, *parameter)))
        })
    }

    /// Where the Jacobian has these entries.
    pub(crate) fn set_places(&mut self, places: Vec<usize>) {
        self.places = places;
    }

    pub(crate) fn evaluate(
        &mut self,
        model: &Model,
        motion: &SplineMotion,
        coefficients: &[f64],
        out: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n_pairs = self.distances.len();
        for time in 0..self.fractions.len() {
            self.pose(motion, coefficients, time);
            let positions = model.positions(&mut self.data, &self.q)?;
            self.body.distances(
                &positions,
                PREFERENCE,
                &mut out[time * n_pairs..(time + 1) * n_pairs],
                None,
            )?;
        }
        Ok(())
    }

    pub(crate) fn differentiate(
        &mut self,
        model: &Model,
        motion: &SplineMotion,
        coefficients: &[f64],
        jacobian: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n_joints = motion.base().n_joints();
        let n_pairs = self.distances.len();
        let mut first = 0;
        for time in 0..self.fractions.len() {
            self.pose(motion, coefficients, time);
            let positions = model.positions(&mut self.data, &self.q)?;
            self.body.distances(&positions, PREFERENCE, &mut self.distances, Some(&mut self.gradients))?;
            for pair in 0..n_pairs {
                self.by_channel.fill(0.0);
                let by_joint = &self.gradients[pair * n_joints..(pair + 1) * n_joints];
                motion.base().pull_back(by_joint, &mut self.by_channel);
                self.pull_back(motion, time);
                let parameters = &self.parameters[time];
                for (place, parameter) in self.places[first..].iter().zip(parameters) {
                    jacobian[*place] = self.by_parameter[*parameter];
                }
                first += parameters.len();
            }
        }
        Ok(())
    }

    /// Adds to the upper triangle `hessian` that of Σ y_k d_k: central differences of gradients by the channels at each
    /// time.
    pub(crate) fn add_curvature(
        &mut self,
        model: &Model,
        motion: &SplineMotion,
        coefficients: &[f64],
        y: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n_channels = motion.n_channels();
        let n_pairs = self.distances.len();
        for (time, y) in y.chunks_exact(n_pairs).enumerate() {
            if y.iter().all(|y| *y == 0.0) {
                continue;
            }
            // by each channel: what it changes of the gradient, and by what parameters it changes itself
            let mut columns = Vec::with_capacity(n_channels);
            for channel in 0..n_channels {
                let mut moved = |by: f64| {
                    self.pose(motion, coefficients, time);
                    self.channels[channel] += by;
                    self.place(motion);
                    self.weighted_gradient(model, motion, y)
                };
                let (plus, minus) = (moved(STEP)?, moved(-STEP)?);
                let change: Vec<f64> = plus.iter().zip(&minus).map(|(a, b)| (a - b) / (2.0 * STEP)).collect();
                self.by_channel.fill(0.0);
                self.by_channel[channel] = 1.0;
                self.pull_back(motion, time);
                let factors: Vec<_> = self.parameters[time]
                    .iter()
                    .map(|parameter| (*parameter, self.by_parameter[*parameter]))
                    .filter(|(_, factor)| *factor != 0.0)
                    .collect();
                columns.push((change, factors));
            }
            for (a, (change, factors)) in columns.iter().enumerate() {
                for (b, (other, others)) in columns.iter().enumerate() {
                    let second = 0.5 * (change[b] + other[a]);
                    for (i, factor) in factors {
                        for (j, other) in others.iter().filter(|(j, _)| i <= j) {
                            hessian[entry(*i, *j)] += second * factor * other;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// ∂(Σ y_k d_k) by the channels, in the present posture.
    fn weighted_gradient(
        &mut self,
        model: &Model,
        motion: &SplineMotion,
        y: &[f64],
    ) -> Result<Vec<f64>, DynamicsError> {
        let positions = model.positions(&mut self.data, &self.q)?;
        self.body.distances(&positions, PREFERENCE, &mut self.distances, Some(&mut self.gradients))?;
        let mut by_channel = vec![0.0; motion.n_channels()];
        for (by_joint, y) in self.gradients.chunks_exact(motion.base().n_joints()).zip(y) {
            self.by_channel.fill(0.0);
            motion.base().pull_back(by_joint, &mut self.by_channel);
            by_channel.iter_mut().zip(&self.by_channel).for_each(|(sum, by)| *sum += y * by);
        }
        Ok(by_channel)
    }

    /// Leaves what a gradient by the channels at a time is for the parameters.
    fn pull_back(&mut self, motion: &SplineMotion, time: usize) {
        let n = motion.basis().n_coefficients();
        let first = motion.basis().evaluate(self.fractions[time], 0, &mut self.basis);
        self.by_coefficient.fill(0.0);
        for (channel, by_channel) in self.by_channel.iter().enumerate() {
            let row = &mut self.by_coefficient[channel * n + first..];
            row.iter_mut().zip(&self.basis).for_each(|(out, b)| *out = by_channel * b);
        }
        self.by_parameter.fill(0.0);
        motion.pull_back(&self.by_coefficient, &mut self.by_parameter);
    }

    fn pose(&mut self, motion: &SplineMotion, coefficients: &[f64], time: usize) {
        motion.channels_into(coefficients, self.fractions[time], 0, &mut self.channels);
        self.place(motion);
    }

    /// Leaves the posture of the present channels.
    fn place(&mut self, motion: &SplineMotion) {
        let n_root = self.q.len() - motion.base().n_joints();
        motion.base().positions_into(&self.channels, &mut self.q[n_root..]);
    }
}

/// For each pair the minimum distance over a grid of postures between those of the dive.
fn least_distances(
    dive: &Dive,
    model: &Model,
    body: &Body,
    data: &mut Data,
    q: &mut [f64],
) -> Result<Vec<f64>, DynamicsError> {
    let n_root = q.len() - dive.postures[0].len();
    let mut least = vec![f64::INFINITY; body.pairs().len()];
    let mut distances = least.clone();
    let mut counts = vec![0; dive.postures.len()];
    counts[0] = GRID;
    loop {
        let angles = &mut q[n_root..];
        angles.fill(0.0);
        for (count, posture) in counts.iter().zip(&dive.postures) {
            let weight = *count as f64 / GRID as f64;
            angles.iter_mut().zip(posture).for_each(|(angle, p)| *angle += weight * p);
        }
        body.distances(&model.positions(data, q)?, 0.0, &mut distances, None)?;
        least.iter_mut().zip(&distances).for_each(|(least, d)| *least = least.min(*d));
        if !advance(&mut counts) {
            return Ok(least);
        }
    }
}

/// The next way to write the same sum, in lexical order; false after the last.
fn advance(counts: &mut [usize]) -> bool {
    let Some((last, head)) = counts.split_last_mut() else { return false };
    let Some(k) = head.iter().rposition(|c| *c > 0) else { return false };
    head[k] -= 1;
    let carried = std::mem::take(last) + 1;
    counts[k + 1] += carried;
    true
}
