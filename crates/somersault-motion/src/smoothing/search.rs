//! The search: damped Gauss–Newton steps over all frames, with the sizes of noise and roughness estimated in between.

use super::SmoothingError;
use super::chain::{Block, COMMON, Factor};
use super::channels::{Channels, State};
use super::motion::{Deviations, SmoothingStatus};
use super::rows::{Kind, Placed, Terms};
use crate::fit::{FitError, MarkerSet};
use crate::noise::{MarkerNoise, most_likely, most_likely_size};
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::{Axes, Data, Model, Transform};
use std::ops::Range;

/// What is searched, with what is estimated beside the unknowns.
pub(super) struct Search<'a> {
    pub(super) model: &'a Model,
    pub(super) markers: &'a MarkerSet,
    pub(super) channels: &'a Channels,
    pub(super) times: &'a [f64],
    /// For each frame, each marker.
    pub(super) points: &'a [Vec<Option<Vector3<f64>>>],
    /// Weights of the points in the recording, and with the robust loss.
    pub(super) recorded: &'a [Vec<f64>],
    pub(super) trust: Vec<Vec<f64>>,
    /// Along which coordinates count.
    pub(super) axes: &'a [Vector3<f64>],
    /// Mean and standard deviation of the scale, where it is sought.
    pub(super) scale_prior: Option<(f64, f64)>,
    pub(super) threshold: Option<f64>,
    /// Degrees of freedom of third derivatives.
    pub(super) freedom: Option<f64>,
    pub(super) start: Vec<f64>,
    pub(super) states: Vec<State>,
    pub(super) scale: f64,
    pub(super) noise: MarkerNoise,
    pub(super) roughness: Vec<f64>,
    /// Of each step and number.
    pub(super) activity: Vec<Vec<f64>>,
    pub(super) damping: f64,
    pub(super) token: &'a CancellationToken,
    pub(super) iterations: usize,
}

/// What is known at the minimum beside the estimate.
pub(super) struct Posterior {
    pub(super) deviations: Vec<Deviations>,
    pub(super) scale_deviation: f64,
    /// For each frame the squares of its markers' residuals, whitened, and the coordinates beyond what the unknowns follow.
    pub(super) squares: Vec<f64>,
    pub(super) n_over: Vec<f64>,
    /// Points that count as outliers, and do not count in squares and coordinates.
    pub(super) n_outliers: usize,
    /// The largest smoothed disturbance of a number over its standard deviation, and the step from whose frame it is.
    pub(super) disturbance: (f64, usize),
    /// For each number the squares of its roughness, and how many of them the markers determine.
    roughness: Vec<[f64; 2]>,
    /// For each step and number the mean of these squares, for roughness without activity.
    active: Vec<Vec<f64>>,
}

/// What normal equations are for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Purpose {
    /// A step that is damped.
    Step { damping: f64 },
    /// Their determinant, and what the squares fall by.
    Evidence,
    /// The inverse.
    Covariance,
}

/// Room for the kinematics of a frame.
struct Room {
    data: Data,
    of_root: DMatrix<f64>,
    of_point: DMatrix<f64>,
    /// Derivatives of a point by the numbers.
    by: Vec<Vector3<f64>>,
}

impl Posterior {
    /// Nothing is known.
    pub(super) fn unknown(n_frames: usize, n_velocities: usize) -> Self {
        let unknown = || vec![f64::NAN; n_velocities];
        let deviations = Deviations { positions: unknown(), velocities: unknown(), accelerations: unknown() };
        Self {
            deviations: vec![deviations; n_frames],
            scale_deviation: f64::NAN,
            squares: vec![f64::NAN; n_frames],
            n_over: vec![f64::NAN; n_frames],
            n_outliers: 0,
            disturbance: (f64::NAN, 0),
            roughness: Vec::new(),
            active: Vec::new(),
        }
    }
}

/// Noise of the first search over that of the end.
const WIDE: f64 = 3.0;
/// Iterations of a first search, and where its steps are small enough: half a standard deviation, squared.
const SHORT: usize = 12;
const COARSE: f64 = 0.25;
/// Steps of less than a twentieth of a standard deviation end the search: of all unknowns together in fifty frames.
const FINE: f64 = 2.5e-3;
const FRAMES: f64 = 50.0;
/// Damping at the start, that which hides no fall of the squares, and that at the end of all hope.
pub(super) const DAMPING: f64 = 1e-4;
const SMALL_DAMPING: f64 = 1e-2;
const LAST_DAMPING: f64 = 1e10;
/// Rounds in which noise and roughness are estimated; more follow for roughness while it grows in some step by a factor, as it does where a blow is.
const ROUNDS: usize = 5;
const MOST_ROUNDS: usize = 20;
const SETTLED: f64 = 1.25;
/// Frames by which the noise is estimated, at most.
const NOISE_FRAMES: usize = 160;
/// Roughness to begin with, 1/s⁵, its bounds, and by how much it changes at a time at most.
pub(super) const ROUGHNESS: f64 = 1e5;
const MOST_ROUGHNESS: f64 = 1e12;
const CHANGE: f64 = 30.0;
/// Fraction of a disturbance that markers must tell for it to count.
const LEAST_TOLD: f64 = 1e-3;
/// Weight by the robust loss below which a point is an outlier.
const OUTLIER: f64 = 0.5;
/// Steps of a number that markers must determine to tell its roughness.
const LEAST_DETERMINED: f64 = 1.0;
/// Roughness below which rounding hides what markers tell, over the fifth power of the time between frames.
const ROUNDING: f64 = 1.5e-12;

impl Search<'_> {
    pub(super) fn terms(&self, noise: MarkerNoise) -> Terms<'_> {
        Terms {
            channels: self.channels,
            times: self.times,
            dimension: self.axes.len(),
            weights: self.markers.markers().iter().map(|marker| marker.weight).collect(),
            roughness: &self.roughness,
            activity: &self.activity,
            noise,
            start: &self.start,
        }
    }

    pub(super) fn expect_not_cancelled(&self) -> Result<(), SmoothingError> {
        if self.token.is_cancelled() { Err(FitError::Interrupted.into()) } else { Ok(()) }
    }

    /// The markers of all frames, with derivatives if they are requested.
    pub(super) fn place(
        &self,
        states: &[State],
        scale: f64,
        with_derivatives: bool,
    ) -> Result<Vec<Placed>, SmoothingError> {
        let room = || {
            let jacobian = || DMatrix::zeros(6, self.model.n_velocities());
            let by = vec![Vector3::zeros(); self.channels.n()];
            Room { data: Data::new(self.model), of_root: jacobian(), of_point: jacobian(), by }
        };
        let of_frame = |room: &mut Room, (state, points): (&State, &Vec<Option<Vector3<f64>>>)| {
            self.place_frame(room, state, points, scale, with_derivatives)
        };
        states.par_iter().zip(self.points).map_init(room, of_frame).collect()
    }

    /// The markers of a frame.
    fn place_frame(
        &self,
        Room { data, of_root, of_point, by }: &mut Room,
        state: &State,
        points: &[Option<Vector3<f64>>],
        scale: f64,
        with_derivatives: bool,
    ) -> Result<Placed, SmoothingError> {
        let (n, dimension) = (self.channels.n(), self.axes.len());
        let positions = self.model.positions(data, &state.q)?;
        let root = positions.pose(0)?.translation;
        let n_derived = if with_derivatives { points.len() } else { 0 };
        let mut found = Placed {
            residuals: Vec::with_capacity(points.len()),
            derivatives: DMatrix::zeros(n + 1, dimension * n_derived),
        };
        if with_derivatives {
            positions.jacobian_into(0, &Transform::identity(), Axes::World, of_root)?;
        }
        for (k, (marker, point)) in self.markers.markers().iter().zip(points).enumerate() {
            let Some(point) = point else {
                found.residuals.push(None);
                continue;
            };
            let arm = positions.pose(marker.body)?.point(&marker.point) - root;
            let error = root + arm * scale - point;
            let mut counted = Vector3::zeros();
            self.axes.iter().enumerate().for_each(|(k, axis)| counted[k] = axis.dot(&error));
            found.residuals.push(Some(counted));
            if with_derivatives {
                let frame = Transform::translation(marker.point);
                positions.jacobian_into(marker.body, &frame, Axes::World, of_point)?;
                for (mut of_point, of_root) in of_point.column_iter_mut().zip(of_root.column_iter()) {
                    let places = of_point.iter_mut().zip(&of_root);
                    places.for_each(|(x, root)| *x = root + scale * (*x - root));
                }
                self.channels.derivatives(&state.q, of_point, by);
                for (axis, direction) in self.axes.iter().enumerate() {
                    let column = k * dimension + axis;
                    for (c, by) in by.iter().enumerate() {
                        found.derivatives[(c, column)] = direction.dot(by);
                    }
                    found.derivatives[(n, column)] = direction.dot(&arm);
                }
            }
        }
        Ok(found)
    }

    /// Twice the cost of `frames`.
    fn squares(
        &self,
        terms: &Terms<'_>,
        frames: &Range<usize>,
        states: &[State],
        scale: f64,
        placed: &[Placed],
    ) -> f64 {
        let mut sum = self.of_scale(scale).map_or(0.0, |[residual, _]| residual * residual);
        let mut add = |_: Kind, value: f64, _: &[(usize, f64)]| sum += value * value;
        for i in frames.clone() {
            terms.of_frame(i, i == frames.start, &states[i], &placed[i], &self.trust[i], &mut add);
            if i + 1 < frames.end {
                terms.of_step(i, &states[i], &states[i + 1], &mut add);
            }
        }
        sum
    }

    /// The residual of the scale over its standard deviation, and its derivative, where it is sought.
    fn of_scale(&self, scale: f64) -> Option<[f64; 2]> {
        self.scale_prior.map(|(mean, deviation)| [(scale - mean) / deviation, deviation.recip()])
    }

    /// The normal equations of `frames` at an estimate, factored. Those of a step have `damping` of what the markers of a frame
    /// tell of each number in the mean, for derivatives hold for small steps alone.
    fn factor(
        &self,
        terms: &Terms<'_>,
        frames: &Range<usize>,
        states: &[State],
        placed: &[Placed],
        purpose: Purpose,
    ) -> Option<Factor> {
        let n = terms.n();
        let damping = if let Purpose::Step { damping } = purpose { damping } else { 0.0 };
        // a limit bounds on one side: it says nothing of how far within a joint may be
        let counts = |kind: Kind| kind != Kind::Limit || purpose != Purpose::Covariance;
        let of_scale = self.of_scale(self.scale);
        let is_sought = of_scale.is_some();
        let mut corner = of_scale.map(|[residual, by]| [by * by, residual * by]);
        let mut told = vec![0.0; 3 * self.channels.n()];
        let mut add = |kind: Kind, value: f64, row: &[(usize, f64)]| {
            for (k, x) in row.iter().filter(|_| matches!(kind, Kind::Marker(_))) {
                if let (COMMON, Some([size, gradient])) = (*k, &mut corner) {
                    *size += x * x;
                    *gradient += x * value;
                } else if *k < told.len() {
                    told[*k] += x * x / frames.len() as f64;
                }
            }
        };
        for i in frames.clone() {
            terms.of_frame(i, i == frames.start, &states[i], &placed[i], &self.trust[i], &mut add);
        }
        if let Some([size, _]) = &mut corner {
            *size *= 1.0 + damping;
        }
        // what the step to a frame adds to it
        let mut carried: Vec<(usize, usize, f64)> = Vec::new();
        let mut carried_gradient: Vec<(usize, f64)> = Vec::new();
        let mut assemble = |j: usize, block: &mut Block| {
            let i = frames.start + j;
            carried.drain(..).for_each(|(a, b, x)| block.matrix[(a, b)] += x);
            carried_gradient.drain(..).for_each(|(a, x)| block.gradient[a] += x);
            if let Purpose::Step { damping } = purpose {
                told.iter().enumerate().for_each(|(c, told)| block.matrix[(c, c)] += damping * told);
            }
            let mut add = |kind: Kind, value: f64, row: &[(usize, f64)]| {
                if !counts(kind) {
                    return;
                }
                let common = row.iter().find(|(k, _)| *k == COMMON).map_or(0.0, |(_, x)| *x);
                for (b, y) in row.iter().filter(|(k, _)| *k != COMMON) {
                    block.gradient[*b] += y * value;
                    if is_sought {
                        block.border[*b] += y * common;
                    }
                    let column = &mut block.matrix.as_mut_slice()[b * n..(b + 1) * n];
                    for (a, x) in row.iter().filter(|(k, _)| k >= b && *k != COMMON) {
                        column[*a] += x * y;
                    }
                }
            };
            terms.of_frame(i, j == 0, &states[i], &placed[i], &self.trust[i], &mut add);
            if i + 1 < frames.end {
                let mut add = |_: Kind, value: f64, row: &[(usize, f64)]| {
                    for (a, x) in row {
                        if *a < n {
                            block.gradient[*a] += x * value;
                        } else {
                            carried_gradient.push((a - n, x * value));
                        }
                        for (b, y) in row.iter().filter(|(k, _)| k <= a) {
                            if *a < n {
                                block.matrix[(*a, *b)] += x * y;
                            } else if *b < n {
                                block.coupling.push((a - n, *b, x * y));
                            } else {
                                carried.push((a - n, b - n, x * y));
                            }
                        }
                    }
                };
                terms.of_step(i, &states[i], &states[i + 1], &mut add);
            }
            !self.token.is_cancelled()
        };
        Factor::of(frames.len(), n, corner, purpose != Purpose::Evidence, &mut assemble)
    }

    /// The estimate moved by a step.
    fn advanced(&self, steps: &[Vec<f64>], by_scale: f64) -> (Vec<State>, f64) {
        let states = self.states.iter().zip(steps).map(|(state, step)| self.channels.advance(state, step));
        (states.collect(), self.scale + by_scale)
    }

    /// Minimises until the squares fall by less than `tolerance` in fifty frames.
    fn minimize(
        &mut self,
        noise: MarkerNoise,
        tolerance: f64,
        max_iterations: usize,
    ) -> Result<SmoothingStatus, SmoothingError> {
        let n_errors = self.terms(noise).n_errors();
        self.states.iter_mut().for_each(|state| state.errors.resize(n_errors, 0.0));
        let frames = 0..self.times.len();
        let tolerance = tolerance * (frames.len() as f64 / FRAMES).max(1.0);
        let mut damping = self.damping;
        for _ in 0..max_iterations {
            self.expect_not_cancelled()?;
            self.iterations += 1;
            let placed = self.place(&self.states, self.scale, true)?;
            self.weigh(noise, &placed);
            let terms = self.terms(noise);
            let cost = self.squares(&terms, &frames, &self.states, self.scale, &placed);
            let found = loop {
                self.expect_not_cancelled()?;
                let factor = self.factor(&terms, &frames, &self.states, &placed, Purpose::Step { damping });
                if let Some(factor) = factor {
                    let step = factor.solve();
                    let (states, scale) = self.advanced(&step.frames, step.common);
                    let small = factor.fall < tolerance && damping <= SMALL_DAMPING;
                    let found = match self.place(&states, scale, false) {
                        Ok(placed) => self.squares(&terms, &frames, &states, scale, &placed),
                        Err(_) => f64::INFINITY,
                    };
                    // what a small step changes is lost in the rounding of the cost
                    if found < cost || (small && found <= cost * (1.0 + 1e-9)) {
                        let gain = (cost - found) / factor.fall;
                        damping = if gain > 0.75 { (damping * 0.1).max(1e-9) } else { damping };
                        damping = if gain < 0.25 { damping * 4.0 } else { damping };
                        break Some((states, scale, small));
                    }
                }
                damping *= 10.0;
                if damping > LAST_DAMPING {
                    break None;
                }
            };
            let Some((states, scale, small)) = found else { return Ok(SmoothingStatus::NoProgress) };
            (self.states, self.scale, self.damping) = (states, scale, damping);
            if small {
                return Ok(SmoothingStatus::Converged);
            }
        }
        Ok(SmoothingStatus::IterationLimit)
    }

    /// Weights by the recording and the robust loss.
    fn weigh(&mut self, noise: MarkerNoise, placed: &[Placed]) {
        let Some(threshold) = self.threshold else { return };
        for (i, placed) in placed.iter().enumerate() {
            for (k, residual) in placed.residuals.iter().enumerate() {
                let (weight, recorded) = (self.markers.markers()[k].weight, self.recorded[i][k]);
                let distance = residual.map_or(0.0, |r| r.norm());
                self.trust[i][k] = noise.trust(weight, recorded, distance, threshold);
            }
        }
    }

    /// Over all frames, with roughness and noise estimated unless the noise is `given`.
    pub(super) fn settle(
        &mut self,
        given: bool,
        max_iterations: usize,
    ) -> Result<SmoothingStatus, SmoothingError> {
        let wide = MarkerNoise::white(self.noise.size * WIDE);
        self.minimize(wide, COARSE, SHORT)?;
        let mut noise = if given { self.noise } else { MarkerNoise::white(self.noise.size) };
        for round in 0..MOST_ROUNDS {
            self.minimize(noise, COARSE, max_iterations)?;
            let Some(posterior) = self.posterior(noise)? else { break };
            self.estimate_roughness(&posterior);
            let rougher = self.estimate_activity(&posterior);
            if !given && (1..ROUNDS).contains(&round) {
                noise = self.estimate_noise(noise)?;
            }
            if round + 1 >= ROUNDS && rougher < SETTLED {
                break;
            }
        }
        let status = self.minimize(noise, FINE, max_iterations)?;
        self.noise = noise;
        Ok(status)
    }

    /// Variances of all frames; none where the Hessian has no inverse.
    pub(super) fn posterior(&self, noise: MarkerNoise) -> Result<Option<Posterior>, SmoothingError> {
        self.expect_not_cancelled()?;
        let frames = 0..self.times.len();
        let placed = self.place(&self.states, self.scale, true)?;
        let terms = self.terms(noise);
        let factor = self.factor(&terms, &frames, &self.states, &placed, Purpose::Covariance);
        let Some(factor) = factor else { return Ok(None) };
        let mut found = Posterior {
            deviations: vec![Deviations::default(); frames.len()],
            scale_deviation: factor.common_variance().sqrt(),
            squares: vec![0.0; frames.len()],
            n_over: placed.iter().map(|placed| terms.n_rows(placed) as f64).collect(),
            n_outliers: self.count_outliers(&placed),
            disturbance: (0.0, 0),
            roughness: vec![[0.0; 2]; self.channels.n()],
            active: vec![vec![0.0; self.channels.n()]; frames.len() - 1],
        };
        factor.covariances(&mut |i, covariance| {
            self.expect_not_cancelled()?;
            let state = &self.states[i];
            found.deviations[i] = self.channels.deviations(state, covariance);
            // rows of the step to the next frame belong to that
            let mut add = |at: usize, kind: Kind, value: f64, row: &[(usize, f64)]| match kind {
                Kind::Marker(marker) if self.is_outlier(at, marker) => found.n_over[at] -= 1.0,
                Kind::Marker(_) | Kind::Error => {
                    found.squares[at] += value * value;
                    found.n_over[at] -= covariance.variance(row);
                }
                Kind::Motion(number) => {
                    let left = covariance.variance(row);
                    let [squares, determined] = &mut found.roughness[number];
                    *squares += value * value;
                    *determined += 1.0 - left;
                    found.active[i][number] += (value * value + left) * self.activity[i][number];
                    if 1.0 - left > LEAST_TOLD {
                        let size = value.abs() * (self.activity[i][number] / (1.0 - left)).sqrt();
                        found.disturbance =
                            if size > found.disturbance.0 { (size, i) } else { found.disturbance };
                    }
                }
                Kind::Prior | Kind::Limit => {}
            };
            terms.of_frame(i, i == 0, state, &placed[i], &self.trust[i], &mut |kind, value, row| {
                add(i, kind, value, row);
            });
            if let Some(next) = self.states.get(i + 1) {
                terms.of_step(i, state, next, &mut |kind, value, row| add(i + 1, kind, value, row));
            }
            Ok::<_, SmoothingError>(())
        })?;
        let is_sound = found.n_over.iter().all(|n| n.is_finite());
        Ok(is_sound.then_some(found))
    }

    /// Whether the robust loss counts a point less than half.
    fn is_outlier(&self, frame: usize, marker: usize) -> bool {
        self.trust[frame][marker] < OUTLIER * self.recorded[frame][marker]
    }

    fn count_outliers(&self, placed: &[Placed]) -> usize {
        let of_frame = |(i, placed): (usize, &Placed)| {
            let residuals = placed.residuals.iter().enumerate();
            residuals.filter(|(k, residual)| residual.is_some() && self.is_outlier(i, *k)).count()
        };
        placed.iter().enumerate().map(of_frame).sum()
    }

    /// What each step is rougher than the others: its third derivatives have the distribution of Student with few degrees of freedom, so that a
    /// blow is followed where it is, and does not make all else rough. Returns how many times rougher a step became at most.
    fn estimate_activity(&mut self, posterior: &Posterior) -> f64 {
        let Some(freedom) = self.freedom else { return 1.0 };
        let mut greatest: f64 = 1.0;
        for (activity, squares) in self.activity.iter_mut().zip(&posterior.active) {
            for (k, activity) in activity.iter_mut().enumerate() {
                let alike = self.channels.alike(k);
                let sum: f64 = squares[alike.clone()].iter().sum();
                let found = (freedom + sum) / (freedom + 3.0 * alike.len() as f64);
                greatest = greatest.max(found / *activity);
                *activity = found;
            }
        }
        greatest
    }

    /// D. J. C. MacKay's estimate, common to the axes of a rotation and to those of a place: the squares over how many of them the markers determine.
    fn estimate_roughness(&mut self, posterior: &Posterior) {
        let shortest = self.times.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        let least = ROUNDING / shortest.powi(5);
        for k in 0..self.roughness.len() {
            let alike = self.channels.alike(k);
            if alike.start < k {
                self.roughness[k] = self.roughness[alike.start];
                continue;
            }
            let sum = |which: usize| posterior.roughness[alike.clone()].iter().map(|x| x[which]).sum::<f64>();
            let (squares, determined) = (sum(0), sum(1));
            if determined > LEAST_DETERMINED {
                let change = (squares / determined).clamp(CHANGE.recip(), CHANGE);
                let bounds = [least.min(MOST_ROUGHNESS), MOST_ROUGHNESS];
                self.roughness[k] = (self.roughness[k] * change).clamp(bounds[0], bounds[1]);
            }
        }
    }

    /// Restricted maximum likelihood for the noise, by frames of the middle.
    fn estimate_noise(&mut self, from: MarkerNoise) -> Result<MarkerNoise, SmoothingError> {
        let n_frames = self.times.len();
        let n = n_frames.min(NOISE_FRAMES);
        let first = (n_frames - n) / 2;
        let frames = first..first + n;
        let placed = self.place(&self.states, self.scale, true)?;
        let mut states = self.states.clone();
        let dimension = self.axes.len();
        let n_errors = dimension * self.markers.markers().len();
        most_likely(from, &self.times[frames.clone()], &mut |noise| {
            self.expect_not_cancelled()?;
            states.iter_mut().for_each(|state| {
                state.errors.clear();
                state.errors.resize(if noise.correlated > 0.0 { n_errors } else { 0 }, 0.0);
            });
            let of_size = |log: f64| {
                let terms = self.terms(MarkerNoise { size: log.exp(), ..noise });
                let squares = self.squares(&terms, &frames, &states, self.scale, &placed);
                let Some(factor) = self.factor(&terms, &frames, &states, &placed, Purpose::Evidence) else {
                    return f64::INFINITY;
                };
                let of_data: f64 = frames
                    .clone()
                    .map(|i| {
                        let (is_last, is_first) = (i + 1 == frames.end, i == frames.start);
                        terms.log_determinant(i, &placed[i], &self.trust[i], is_last, is_first)
                    })
                    .sum();
                of_data + squares - factor.fall + factor.log_determinant
            };
            Ok(most_likely_size(noise.size, of_size))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::MarkerSet;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use somersault_multibody::{Joint, Link, MassProperties, ModelBuilder};

    /// A body with an arm on a ball joint and a leg on a hinge.
    fn tree(root: Joint) -> Model {
        let part = MassProperties::point(1.0, Vector3::new(0.02, 0.0, -0.2));
        let mut builder = ModelBuilder::new();
        builder.add(Link::root("torso", root, part).at(Vector3::new(0.1, 0.0, 0.3))).unwrap();
        let arm = Link::child("arm", "torso", Joint::Spherical, part);
        builder.add(arm.at(Vector3::new(0.0, 0.2, 0.1))).unwrap();
        let leg = Link::child("leg", "torso", Joint::Revolute { axis: Vector3::y() }, part);
        builder.add(leg.at(Vector3::new(0.0, 0.0, -0.5)).with_limits(-0.5, 0.2)).unwrap();
        builder.build().unwrap()
    }

    #[test]
    fn derivatives_of_all_rows_are_their_differences() {
        for root in [Joint::Free, Joint::Planar] {
            let model = tree(root);
            let places = [("torso", [0.1, 0.0, 0.2]), ("arm", [0.0, 0.05, -0.4]), ("leg", [0.05, 0.0, -0.6])];
            let markers =
                MarkerSet::on_bodies(&model, places.map(|(body, place)| (body, body, place))).unwrap();
            let axes = crate::frame_fits::axes_of(&model);
            // the arm's second axis is one that no marker sees
            let mut seen = vec![true; model.n_velocities()];
            seen[model.velocities_of(1).start + 1] = false;
            let channels = Channels::new(&model, &seen);
            let (n, n_errors) = (channels.n(), axes.len() * 3);
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let mut numbers =
                |n: usize, size: f64| -> Vec<f64> { (0..n).map(|_| rng.random_range(-size..size)).collect() };
            let times = [0.0, 0.03, 0.05];
            let state = |numbers: &mut dyn FnMut(usize, f64) -> Vec<f64>| {
                let mut q = vec![0.0; model.n_positions()];
                model.displace(&model.neutral(), &numbers(model.n_velocities(), 0.6), &mut q).unwrap();
                State {
                    q,
                    rates: numbers(n, 3.0),
                    accelerations: numbers(n, 20.0),
                    errors: numbers(n_errors, 1.0),
                }
            };
            let states: Vec<State> = times.iter().map(|_| state(&mut numbers)).collect();
            let point = |x: Vec<f64>| Some(Vector3::new(x[0], x[1], x[2]));
            let mut points: Vec<Vec<_>> =
                times.iter().map(|_| (0..3).map(|_| point(numbers(3, 0.5))).collect()).collect();
            points[1][2] = None;
            let weights = vec![vec![1.0, 0.7, 1.0]; 3];
            let token = CancellationToken::new();
            let search = Search {
                model: &model,
                markers: &markers,
                channels: &channels,
                times: &times,
                points: &points,
                recorded: &weights,
                trust: weights.clone(),
                axes: &axes,
                scale_prior: Some((1.0, 0.1)),
                threshold: None,
                freedom: None,
                start: states[1].q.clone(),
                states,
                scale: 1.1,
                noise: MarkerNoise { size: 0.1, correlated: 0.6, time: 0.1 },
                roughness: vec![1e6; n],
                activity: vec![(0..n).map(|k| 1.0 + k as f64).collect(); 2],
                damping: DAMPING,
                token: &token,
                iterations: 0,
            };
            let terms = search.terms(search.noise);
            let placed = search.place(&search.states, search.scale, true).unwrap();
            let all = 0..3;
            // the gradient of half the squares by all unknowns, the scale last
            let width = terms.n();
            let mut gradient = vec![0.0; 3 * width + 1];
            for i in all.clone() {
                let mut add = |_: Kind, value: f64, row: &[(usize, f64)]| {
                    for (k, x) in row {
                        gradient[if *k == COMMON { 3 * width } else { i * width + k }] += value * x;
                    }
                };
                terms.of_frame(i, i == 0, &search.states[i], &placed[i], &search.trust[i], &mut add);
                if i < 2 {
                    terms.of_step(i, &search.states[i], &search.states[i + 1], &mut add);
                }
            }
            let [residual, by] = search.of_scale(search.scale).unwrap();
            gradient[3 * width] += residual * by;
            let size = gradient.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            for (k, derivative) in gradient.iter().enumerate() {
                let h = 1e-6;
                let cost = |h: f64| {
                    let mut steps = vec![vec![0.0; width]; 3];
                    let mut by_scale = 0.0;
                    if k == 3 * width {
                        by_scale = h;
                    } else {
                        steps[k / width][k % width] = h;
                    }
                    let (states, scale) = search.advanced(&steps, by_scale);
                    let placed = search.place(&states, scale, false).unwrap();
                    0.5 * search.squares(&terms, &all, &states, scale, &placed)
                };
                let difference = (cost(h) - cost(-h)) / (2.0 * h);
                assert!(
                    (difference - derivative).abs() < 1e-7 * size,
                    "{root:?} {k}: {derivative} {difference}"
                );
            }
        }
    }
}
