//! The rows of the least-squares problem: residuals over their standard deviations, with their derivatives.
//!
//! ```text
//! markers        (√c (x(q) − y)/σ − e)/√ω,        ω = 1 − κ + (1/trust − 1)
//! their errors   (e′ − e^{−Δ/τ} e)/√(κ (1 − e^{−2Δ/τ}))
//! motion         U (q′ ⊖ q − Δ q̇ − ½Δ² q̈,  q̇′ − q̇ − Δ q̈,  q̈′ − q̈)/√S,   UᵀU = Q(Δ)⁻¹
//! ```
//! S is the density of a number times the activity of the step. Q(Δ) is the covariance of what white noise of q⃛ with the density 1 makes of the three over the time Δ. Beside them are numbers that hold
//! what nothing else does: the first frame, joints beyond their limits, rotations about axes that no marker sees.

use super::chain::COMMON;
use super::channels::{Channels, Part, State};
use crate::noise::{LEAST_WHITE, MarkerNoise};
use nalgebra::{DMatrix, Matrix3, Vector3};
use somersault_core::lie::so3;

/// What a row is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A coordinate of this marker.
    Marker(usize),
    /// The correlated error of one.
    Error,
    /// The roughness of this number.
    Motion(usize),
    /// What was taken for granted before.
    Prior,
    /// A joint beyond its limit.
    Limit,
}

/// Takes a residual and its derivatives by unknowns: those of a frame, and after them those of the next.
pub(super) type Visit<'a> = dyn FnMut(Kind, f64, &[(usize, f64)]) + 'a;

/// The markers of a frame at an estimate.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    /// For each marker its residual in the coordinates that count; none where it is missing.
    pub(super) residuals: Vec<Option<Vector3<f64>>>,
    /// A column for each coordinate: derivatives by the numbers, and by the scale last. Without columns if they were not requested.
    pub(super) derivatives: DMatrix<f64>,
}

/// What the rows depend on beside the frames.
pub(super) struct Terms<'a> {
    pub(super) channels: &'a Channels,
    pub(super) times: &'a [f64],
    /// Coordinates of a point that count.
    pub(super) dimension: usize,
    /// Of the markers.
    pub(super) weights: Vec<f64>,
    /// Density of the third derivative of each number, 1/s⁵.
    pub(super) roughness: &'a [f64],
    /// For each step and number what its roughness is over that density.
    pub(super) activity: &'a [Vec<f64>],
    pub(super) noise: MarkerNoise,
    /// Where the first frame is taken to be, and how ball joints turn that no marker sees.
    pub(super) start: &'a [f64],
}

/// Standard deviations of the first frame about the start: rad or m, and by s and s².
const START: [f64; 3] = [10.0, 100.0, 3000.0];
/// Of rotations about axes that no marker sees, rad, each second.
const VAGUE: f64 = 0.5;
/// Of joints beyond their limits, rad or m, each 0.07 s.
const LIMIT: f64 = 0.1;
const LIMIT_TIME: f64 = 0.07;

impl Terms<'_> {
    /// Whether errors are correlated, and are unknowns.
    pub(super) fn has_errors(&self) -> bool {
        self.noise.correlated > 0.0
    }

    /// Number of errors in a frame.
    pub(super) fn n_errors(&self) -> usize {
        if self.has_errors() { self.dimension * self.weights.len() } else { 0 }
    }

    /// Number of unknowns in a frame: the numbers with two derivatives, in their [places](Channels::place), and the errors.
    pub(super) fn n(&self) -> usize {
        3 * self.channels.n() + self.n_errors()
    }

    fn correlated(&self) -> f64 {
        self.noise.correlated.min(1.0 - LEAST_WHITE)
    }

    /// ω.
    fn white(&self, trust: f64) -> f64 {
        1.0 - self.correlated() + (1.0 / trust - 1.0)
    }

    /// What of an error is left after a time, and the variance that is added.
    fn carried(&self, i: usize) -> [f64; 2] {
        let decay = (-(self.times[i + 1] - self.times[i]) / self.noise.time).exp();
        [decay, self.correlated() * (1.0 - decay * decay)]
    }

    /// Coordinates that were measured in a frame.
    fn n_measured(&self, placed: &Placed) -> usize {
        self.dimension * placed.residuals.iter().flatten().count()
    }

    /// ln det of the covariance of coordinates and errors of a frame and of the step from it, and how many coordinates it has.
    pub(super) fn log_determinant(
        &self,
        i: usize,
        placed: &Placed,
        trust: &[f64],
        is_last: bool,
        is_first: bool,
    ) -> f64 {
        let size = 2.0 * self.noise.size.ln();
        let of_marker = |(k, residual): (usize, &Option<_>)| {
            residual.map_or(0.0, |_: Vector3<f64>| size + self.white(trust[k]).ln() - self.weights[k].ln())
        };
        let markers: f64 = placed.residuals.iter().enumerate().map(of_marker).sum();
        let n = self.n_errors() as f64;
        let started = if self.has_errors() && is_first { n * self.correlated().ln() } else { 0.0 };
        let carried = if self.has_errors() && !is_last { n * self.carried(i)[1].ln() } else { 0.0 };
        markers * self.dimension as f64 + started + carried
    }

    /// Visits the rows of a frame, of which `is_first` is the first.
    pub(super) fn of_frame(
        &self,
        i: usize,
        is_first: bool,
        state: &State,
        placed: &Placed,
        trust: &[f64],
        visit: &mut Visit<'_>,
    ) {
        let n = self.channels.n();
        let mut row: Vec<(usize, f64)> = Vec::with_capacity(n + 2);
        let with_derivatives = placed.derivatives.ncols() > 0;
        for (k, residual) in placed.residuals.iter().enumerate() {
            let Some(residual) = residual else { continue };
            let size = self.weights[k].sqrt() / self.noise.size;
            let factor = self.white(trust[k]).sqrt().recip();
            for axis in 0..self.dimension {
                let at = k * self.dimension + axis;
                row.clear();
                if with_derivatives {
                    let column = placed.derivatives.column(at);
                    row.extend((0..n).map(|c| (Channels::place(0, c), column[c] * size * factor)));
                    row.push((COMMON, column[n] * size * factor));
                }
                let mut value = residual[axis] * size;
                if self.has_errors() {
                    value -= state.errors[at];
                    row.push((3 * n + at, -factor));
                }
                visit(Kind::Marker(k), value * factor, &row);
            }
        }
        let last = self.times.len() - 1;
        let time = 0.5 * (self.times[(i + 1).min(last)] - self.times[i.saturating_sub(1)]);
        for part in &self.channels.parts {
            self.held(part, is_first, time, state, visit);
        }
        if is_first && self.has_errors() {
            let factor = self.correlated().sqrt().recip();
            for (k, error) in state.errors.iter().enumerate() {
                visit(Kind::Error, error * factor, &[(3 * n + k, factor)]);
            }
        }
    }

    /// The rows that hold a part where the markers may not.
    fn held(&self, part: &Part, is_first: bool, time: f64, state: &State, visit: &mut Visit<'_>) {
        let first = part.first;
        let width = if part.is_rotation { 3 } else { 1 };
        let is_vague = (0..width).any(|k| self.channels.is_vague[first + k]);
        if is_first || is_vague {
            let displacement = Channels::difference(part, self.start, &state.q);
            let by = displacement_derivative(part, &displacement);
            for k in 0..width {
                let row = [0, 1, 2].map(|j| (Channels::place(0, first + j), by[(k, j)]));
                let mut visit_over = |deviation: f64| {
                    let row = row.map(|(j, x)| (j, x / deviation));
                    visit(Kind::Prior, displacement[k] / deviation, &row[..width]);
                };
                if is_first {
                    visit_over(START[0]);
                }
                if self.channels.is_vague[first + k] {
                    visit_over(VAGUE / time.sqrt());
                }
            }
        }
        if is_first {
            for (order, numbers) in [(1, &state.rates), (2, &state.accelerations)] {
                let turned = if part.is_rotation { hat_of(numbers, first) } else { Matrix3::zeros() };
                let factor = START[order].recip();
                for k in 0..width {
                    let by = |j: usize| {
                        let part = if j < width { turned[(k, j)] * factor } else { 0.0 };
                        (Channels::place(0, first + j.min(width - 1)), part)
                    };
                    let row = [by(0), by(1), by(2), (Channels::place(order, first + k), factor)];
                    visit(Kind::Prior, numbers[first + k] * factor, &row);
                }
            }
        }
        if let Some([lower, upper]) = self.channels.limits[first] {
            let value = state.q[part.position];
            let beyond = value - value.max(lower).min(upper);
            if beyond != 0.0 {
                let factor = (time / LIMIT_TIME).sqrt() / LIMIT;
                visit(Kind::Limit, beyond * factor, &[(Channels::place(0, first), factor)]);
            }
        }
    }

    /// Visits the rows that join frame `i` to the next; unknowns of the next count from the number of those of a frame.
    pub(super) fn of_step(&self, i: usize, from: &State, to: &State, visit: &mut Visit<'_>) {
        let (n, next) = (self.channels.n(), self.n());
        let place = Channels::place;
        let step = self.times[i + 1] - self.times[i];
        let root = root_of_information(step);
        let mut row: Vec<(usize, f64)> = Vec::with_capacity(18);
        for part in &self.channels.parts {
            let first = part.first;
            let width = if part.is_rotation { 3 } else { 1 };
            let displacement = Channels::difference(part, &from.q, &to.q);
            let after = displacement_derivative(part, &displacement);
            let before = displacement_derivative(part, &-displacement);
            for k in 0..width {
                let c = first + k;
                let factor = (self.roughness[c] * self.activity[i][c]).sqrt().recip();
                let (rate, acceleration) = (from.rates[c], from.accelerations[c]);
                let values = [
                    displacement[k] - step * rate - 0.5 * step * step * acceleration,
                    to.rates[c] - rate - step * acceleration,
                    to.accelerations[c] - acceleration,
                ];
                // the axes of a rotation carry its rates along
                let carried = |state: &State| {
                    let of = |numbers: &[f64]| {
                        if part.is_rotation { hat_of(numbers, first) } else { Matrix3::zeros() }
                    };
                    [of(&state.rates), of(&state.accelerations)]
                };
                let [turned, pushed] = carried(from);
                let [turned_after, pushed_after] = carried(to);
                for order in 0..3 {
                    row.clear();
                    let [a, b, d] = [0, 1, 2].map(|j| root[(order, j)] * factor);
                    let by_rate = -a * step - b;
                    let by_acceleration = -a * 0.5 * step * step - b * step - d;
                    row.extend((0..width).map(|j| {
                        let by = by_rate * turned[(k, j)] + by_acceleration * pushed[(k, j)];
                        (place(0, first + j), by - a * before[(k, j)])
                    }));
                    row.extend((0..width).map(|j| {
                        let by = b * turned_after[(k, j)] + d * pushed_after[(k, j)];
                        (next + place(0, first + j), by + a * after[(k, j)])
                    }));
                    row.push((place(1, c), by_rate));
                    row.push((place(2, c), by_acceleration));
                    row.push((next + place(1, c), b));
                    row.push((next + place(2, c), d));
                    visit(Kind::Motion(c), a * values[0] + b * values[1] + d * values[2], &row);
                }
            }
        }
        if self.has_errors() {
            let [decay, variance] = self.carried(i);
            let factor = variance.sqrt().recip();
            for (k, (from, to)) in from.errors.iter().zip(&to.errors).enumerate() {
                let row = [(3 * n + k, -decay * factor), (next + 3 * n + k, factor)];
                visit(Kind::Error, (to - decay * from) * factor, &row);
            }
        }
    }

    /// Rows of markers and errors that a frame has, with those of the step that leads to it.
    pub(super) fn n_rows(&self, placed: &Placed) -> usize {
        self.n_measured(placed) + self.n_errors()
    }
}

/// The derivative of a displacement by one of the end, along which it is moved; by one of the start it is that of the displacement back,
/// with the other sign.
fn displacement_derivative(part: &Part, displacement: &Vector3<f64>) -> Matrix3<f64> {
    if part.is_rotation { so3::right_jacobian_inverse(displacement) } else { Matrix3::identity() }
}

/// The matrix of a cross product with three numbers.
fn hat_of(numbers: &[f64], first: usize) -> Matrix3<f64> {
    so3::hat(&Vector3::from_column_slice(&numbers[first..first + 3]))
}

/// U with UᵀU = Q(Δ)⁻¹, an upper triangle.
fn root_of_information(step: f64) -> Matrix3<f64> {
    // of Δ = 1: UᵀU = [[720, −360, 60], [−360, 192, −36], [60, −36, 9]]
    let unit = Matrix3::new(720.0, -360.0, 60.0, -360.0, 192.0, -36.0, 60.0, -36.0, 9.0);
    let lower = unit.cholesky().map_or_else(Matrix3::zeros, |factor| factor.l());
    let scale = [step.powf(-2.5), step.powf(-1.5), step.powf(-0.5)];
    Matrix3::from_fn(|i, j| lower[(j, i)] * scale[j])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The covariance by its integrals: ∫ (Δ−s)ᵃ (Δ−s)ᵇ/(a! b!) ds with a, b = 2, 1, 0.
    #[test]
    fn information_of_a_step_is_the_inverse_of_its_covariance() {
        for step in [0.004_f64, 0.01, 1.0 / 30.0] {
            let factorial = [2.0, 1.0, 1.0];
            let covariance = Matrix3::from_fn(|i, j| {
                let power = 5 - i - j;
                step.powi(power as i32) / (power as f64 * factorial[i] * factorial[j])
            });
            let root = root_of_information(step);
            let product = root * covariance * root.transpose();
            assert!((product - Matrix3::identity()).amax() < 1e-9, "{step}: {product}");
        }
    }
}
