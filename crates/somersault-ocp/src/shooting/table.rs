//! The splines of a joint motion at fixed fractions of its duration, by their parameters.

use somersault_core::spline::MAX_DEGREE;
use somersault_multibody::joint_motion::{EigenpostureBase, SplineMotion};
use std::ops::RangeInclusive;

/// For each fraction and channel the parameters that act there, with the basis functions and their first two derivatives by
/// the fraction; conditions at the ends are part of them.
#[derive(Debug, Clone)]
pub(super) struct Table {
    n_channels: usize,
    starts: Vec<usize>,
    entries: Vec<Entry>,
    /// What the channels are where all parameters vanish.
    offsets: Vec<[f64; 3]>,
}

/// A parameter with what a unit of it adds to a channel and to its first two derivatives.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    pub(super) parameter: usize,
    pub(super) values: [f64; 3],
}

impl Table {
    pub(super) fn new(motion: &SplineMotion, fractions: impl Iterator<Item = f64>) -> Self {
        let basis = motion.basis();
        let n = basis.n_coefficients();
        let mut of_coefficient = vec![Vec::new(); motion.n_coefficients()];
        for (coefficient, parameter, factor) in motion.dependences() {
            of_coefficient[coefficient].push((parameter, factor));
        }
        let mut table = Self {
            n_channels: motion.n_channels(),
            starts: vec![0],
            entries: Vec::new(),
            offsets: Vec::new(),
        };
        let mut room = [[0.0; MAX_DEGREE + 1]; 3];
        for fraction in fractions {
            let mut first = 0;
            for (derivative, values) in room.iter_mut().enumerate() {
                first = basis.evaluate(fraction, derivative, values);
            }
            for channel in 0..motion.n_channels() {
                let mut offset = [0.0; 3];
                let mut factors = vec![[0.0; 3]; motion.n_parameters()];
                for i in 0..basis.n_active() {
                    let coefficient = channel * n + first + i;
                    for (d, values) in room.iter().enumerate() {
                        offset[d] += values[i] * motion.offset()[coefficient];
                        for (parameter, factor) in &of_coefficient[coefficient] {
                            factors[*parameter][d] += values[i] * factor;
                        }
                    }
                }
                let acting = factors.into_iter().enumerate().filter(|(_, values)| *values != [0.0; 3]);
                table.entries.extend(acting.map(|(parameter, values)| Entry { parameter, values }));
                table.starts.push(table.entries.len());
                table.offsets.push(offset);
            }
        }
        table
    }

    /// Which of `n` parameters act at any of the points.
    pub(super) fn acting(&self, points: RangeInclusive<usize>, n: usize) -> Vec<bool> {
        let mut acting = vec![false; n];
        for point in points {
            for channel in 0..self.n_channels {
                self.entries(point, channel).iter().for_each(|entry| acting[entry.parameter] = true);
            }
        }
        acting
    }

    pub(super) fn n_channels(&self) -> usize {
        self.n_channels
    }

    pub(super) fn entries(&self, point: usize, channel: usize) -> &[Entry] {
        let at = point * self.n_channels + channel;
        &self.entries[self.starts[at]..self.starts[at + 1]]
    }

    /// Writes the channels and their first two rates for a motion of the given duration.
    pub(super) fn channels(&self, point: usize, p: &[f64], duration: f64, out: [&mut [f64]; 3]) {
        let [c, rate, second] = out;
        for channel in 0..self.n_channels {
            let mut values = self.offsets[point * self.n_channels + channel];
            for entry in self.entries(point, channel) {
                for (value, b) in values.iter_mut().zip(entry.values) {
                    *value += b * p[entry.parameter];
                }
            }
            c[channel] = values[0];
            rate[channel] = values[1] / duration;
            second[channel] = values[2] / (duration * duration);
        }
    }

    /// Adds to `p` what gradients by the channels and their rates are for the parameters.
    pub(super) fn pull_back(&self, point: usize, duration: f64, by: [&[f64]; 3], p: &mut [f64]) {
        let (first, second) = (1.0 / duration, 1.0 / (duration * duration));
        for channel in 0..self.n_channels {
            let by = [by[0][channel], by[1][channel] * first, by[2][channel] * second];
            for entry in self.entries(point, channel) {
                let [b, b1, b2] = entry.values;
                p[entry.parameter] += b * by[0] + b1 * by[1] + b2 * by[2];
            }
        }
    }
}

/// Adds to column `joint` of each of three sets of tangents what the parameters do to the joints: positions, velocities
/// and accelerations, or forces alone. `rows` are those of the parameters.
pub(super) fn push_forward(
    table: &Table,
    base: &EigenpostureBase,
    point: usize,
    duration: f64,
    rows: &[Option<usize>],
    mut add: impl FnMut(usize, usize, [f64; 3]),
) {
    let directions = base.directions();
    let scale = [1.0, 1.0 / duration, 1.0 / (duration * duration)];
    for channel in 0..table.n_channels() {
        for entry in table.entries(point, channel) {
            let Some(row) = rows[entry.parameter] else { continue };
            let values: [f64; 3] = std::array::from_fn(|d| entry.values[d] * scale[d]);
            for joint in 0..base.n_joints() {
                let direction = directions[(joint, channel)];
                if direction != 0.0 {
                    add(row, joint, values.map(|x| x * direction));
                }
            }
        }
    }
}
