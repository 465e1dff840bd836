//! The search: damped Gauss–Newton steps over a window of frames that grows from the reference, then over all frames, with the
//! sizes of noise and second derivatives estimated in between.

use super::attitude::{Flown, Room};
use super::normal::{Kinematics, Linearized, Normal, Observed, Placed, Trust};
use super::prior::Prior;
use super::unknowns::Estimate;
use super::{ReconstructionError, ReconstructionStatus};
use crate::cholesky::Cholesky;
use crate::fit::{FitError, MarkerSet};
use crate::noise::{MarkerNoise, most_likely, most_likely_size};
use nalgebra::DMatrix;
use somersault_core::cancel::CancellationToken;
use std::ops::Range;

/// What is searched, with what is estimated beside the unknowns.
pub(super) struct Search<'a> {
    pub(super) flown: Flown<'a>,
    pub(super) markers: &'a MarkerSet,
    pub(super) observed: &'a Observed,
    pub(super) prior: Prior,
    pub(super) noise: MarkerNoise,
    pub(super) trust: Trust,
    /// Distance from which on a point counts less, in standard deviations.
    pub(super) threshold: Option<f64>,
    /// Channels that some marker sees.
    pub(super) seen: Vec<bool>,
    pub(super) estimate: Estimate,
    pub(super) room: Room,
    pub(super) kinematics: Kinematics,
    pub(super) token: &'a CancellationToken,
    pub(super) iterations: usize,
}

/// How far the window grows at a time, s.
const GROWTH: f64 = 0.1;
/// Iterations in a window that still grows, and where its steps are small enough: half a standard deviation.
const SHORT: usize = 8;
const COARSE: f64 = 0.25;
/// Steps of less than a twentieth of a standard deviation, of all unknowns together, end the search.
const FINE: f64 = 2.5e-3;
/// Noise of the windows that grow, over that of the end.
const WIDE: f64 = 3.0;
/// Squares of a residual over its variance from which on a window is far from the markers: a flight has 1/9 with the noise of the windows.
const FAR: f64 = 4.0;
/// Damping at the start and at the end of all hope.
const DAMPING: [f64; 2] = [1e-3, 1e10];
/// Rounds in which the sizes of noise and second derivatives are estimated.
const ROUNDS: usize = 3;

impl<'a> Search<'a> {
    /// Knots whose basis functions act within `frames`.
    pub(super) fn knots(&self, frames: &Range<usize>) -> Range<usize> {
        let at = |i: usize| self.flown.splines.acting(self.observed.times[i], 0).first;
        at(frames.start)..(at(frames.end - 1) + super::joints::ACTIVE).min(self.flown.splines.n_knots())
    }

    pub(super) fn all(&self) -> Range<usize> {
        0..self.observed.times.len()
    }

    /// The flight over `frames` at `estimate`, with derivatives where there are `knots`.
    pub(super) fn fly(
        &mut self,
        estimate: &Estimate,
        frames: &Range<usize>,
        knots: Option<&Range<usize>>,
    ) -> Result<Linearized, ReconstructionError> {
        let Self { flown, observed, room, kinematics, markers, .. } = self;
        flown.fly(markers, observed, estimate, frames, knots, room, kinematics)
    }

    pub(super) fn normal(
        &self,
        estimate: &Estimate,
        frames: &Range<usize>,
        knots: Option<&Range<usize>>,
        noise: &MarkerNoise,
        at: &Linearized,
    ) -> Normal {
        let Self { flown, markers, observed, trust, .. } = self;
        flown.normal(markers, observed, estimate, frames, knots, at, trust, noise)
    }

    /// Squares of residuals and of the prior.
    fn cost(
        &mut self,
        estimate: &Estimate,
        frames: &Range<usize>,
        knots: &Range<usize>,
        noise: &MarkerNoise,
    ) -> Result<f64, ReconstructionError> {
        let at = self.fly(estimate, frames, None)?;
        let measured = self.normal(estimate, frames, None, noise, &at).squares;
        Ok(measured + self.prior.squares(self.flown.layout, self.flown.splines, estimate, knots))
    }

    pub(super) fn expect_not_cancelled(&self) -> Result<(), ReconstructionError> {
        if self.token.is_cancelled() { Err(FitError::Interrupted.into()) } else { Ok(()) }
    }

    /// Minimises over `frames` until a step is shorter than `tolerance`, squared, in standard deviations.
    fn minimize(
        &mut self,
        frames: &Range<usize>,
        noise: &MarkerNoise,
        tolerance: f64,
        max_iterations: usize,
    ) -> Result<ReconstructionStatus, ReconstructionError> {
        let knots = self.knots(frames);
        let mut damping = DAMPING[0];
        for _ in 0..max_iterations {
            self.expect_not_cancelled()?;
            self.iterations += 1;
            let estimate = self.estimate.clone();
            let at = self.fly(&estimate, frames, Some(&knots))?;
            self.weigh(&estimate, frames, noise, &at.placed);
            let Normal { mut matrix, mut gradient, squares, .. } =
                self.normal(&estimate, frames, Some(&knots), noise, &at);
            let cost = squares
                + self.prior.add(
                    self.flown.layout,
                    self.flown.splines,
                    &estimate,
                    &knots,
                    &mut matrix,
                    &mut gradient,
                );
            loop {
                let step = damped_step(&matrix, &gradient, damping);
                if let Some((step, decrement)) = step {
                    let trial = self.flown.layout.advance(&estimate, &step, knots.start);
                    let found = match self.cost(&trial, frames, &knots, noise) {
                        Ok(cost) => cost,
                        Err(error @ ReconstructionError::Fit(FitError::Interrupted)) => return Err(error),
                        Err(_) => f64::INFINITY,
                    };
                    let small = decrement < tolerance;
                    // what a small step changes is lost in the rounding of the cost
                    if found < cost || (small && found <= cost * (1.0 + 1e-9)) {
                        let gain = (cost - found) / decrement;
                        self.estimate = trial;
                        if small {
                            return Ok(ReconstructionStatus::Converged);
                        }
                        damping = if gain > 0.75 { (damping * 0.1).max(1e-9) } else { damping };
                        damping = if gain < 0.25 { damping * 4.0 } else { damping };
                        break;
                    }
                }
                damping *= 10.0;
                if damping > DAMPING[1] {
                    return Ok(ReconstructionStatus::NoProgress);
                }
            }
        }
        Ok(ReconstructionStatus::IterationLimit)
    }

    /// Weights by the recording and the robust loss.
    fn weigh(&mut self, estimate: &Estimate, frames: &Range<usize>, noise: &MarkerNoise, placed: &[Placed]) {
        let Some(threshold) = self.threshold else { return };
        let residuals = self.flown.residuals(self.observed, estimate, frames.clone(), placed);
        for (i, of_frame) in frames.clone().zip(residuals) {
            for (k, residual) in of_frame.iter().enumerate() {
                let (weight, recorded) = (self.markers.markers()[k].weight, self.observed.weights[i][k]);
                let distance = residual.map_or(0.0, |r| r.norm());
                self.trust[i][k] = noise.trust(weight, recorded, distance, threshold);
            }
        }
    }

    /// From a window about the reference to all frames; whether it got there. Where flight is `doubtful`, it ends at a window that is far from the markers.
    pub(super) fn grow(&mut self, doubtful: bool) -> Result<bool, ReconstructionError> {
        let times = &self.observed.times;
        let middle = times[self.observed.reference];
        let (first, last) = (times[0], times[times.len() - 1]);
        let wide = MarkerNoise::white(self.noise.size * WIDE);
        let mut half = GROWTH;
        let mut known: Option<Range<usize>> = None;
        loop {
            let times = &self.observed.times;
            let frames =
                times.partition_point(|t| *t < middle - half)..times.partition_point(|t| *t <= middle + half);
            let knots = self.knots(&frames);
            if let Some(known) = &known {
                self.continue_joints(known, &knots);
            }
            self.minimize(&frames, &wide, COARSE, SHORT)?;
            known = Some(knots);
            if doubtful && self.is_far(&frames, &wide)? {
                return Ok(false);
            }
            if middle - half <= first && middle + half >= last {
                return Ok(true);
            }
            half += GROWTH;
        }
    }

    /// Whether the squares of a window are far from what the noise leaves.
    fn is_far(&mut self, frames: &Range<usize>, noise: &MarkerNoise) -> Result<bool, ReconstructionError> {
        let estimate = self.estimate.clone();
        let at = self.fly(&estimate, frames, None)?;
        let found = self.normal(&estimate, frames, None, noise, &at);
        Ok(found.squares > FAR * found.n_measured as f64)
    }

    /// Joints beyond the knots of a window continue as they are at its ends.
    fn continue_joints(&mut self, known: &Range<usize>, knots: &Range<usize>) {
        let n = self.flown.layout.n_channels;
        let coefficients = &mut self.estimate.coefficients;
        for knot in (knots.start..known.start).rev() {
            coefficients.copy_within((knot + 1) * n..(knot + 2) * n, knot * n);
        }
        for knot in known.end..knots.end {
            coefficients.copy_within((knot - 1) * n..knot * n, knot * n);
        }
    }

    /// Over all frames, with the sizes of noise and second derivatives estimated unless the noise is `given`.
    pub(super) fn settle(
        &mut self,
        given: bool,
        max_iterations: usize,
    ) -> Result<ReconstructionStatus, ReconstructionError> {
        let frames = self.all();
        let mut noise = MarkerNoise::white(self.noise.size * 2.0);
        self.minimize(&frames, &noise, COARSE, SHORT)?;
        noise = if given { self.noise } else { MarkerNoise::white(self.noise.size) };
        let mut status = ReconstructionStatus::IterationLimit;
        for round in 0..=ROUNDS {
            let tolerance = if round == ROUNDS { FINE } else { COARSE };
            status = self.minimize(&frames, &noise, tolerance, max_iterations)?;
            if round == ROUNDS {
                break;
            }
            let Some((covariance, at)) = self.posterior(&noise)? else { break };
            let estimate = self.estimate.clone();
            self.prior.maximize(self.flown.layout, self.flown.splines, &estimate, &covariance);
            if !given && round > 0 {
                noise = self.estimate_noise(noise, &at)?;
            }
        }
        self.noise = noise;
        Ok(status)
    }

    /// The covariance of the unknowns, the inverse of the Hessian of data and prior, and the flight there; none where it
    /// has no inverse.
    pub(super) fn posterior(
        &mut self,
        noise: &MarkerNoise,
    ) -> Result<Option<(DMatrix<f64>, Linearized)>, ReconstructionError> {
        self.expect_not_cancelled()?;
        let frames = self.all();
        let knots = self.knots(&frames);
        let estimate = self.estimate.clone();
        let at = self.fly(&estimate, &frames, Some(&knots))?;
        let Normal { mut matrix, mut gradient, .. } =
            self.normal(&estimate, &frames, Some(&knots), noise, &at);
        let Flown { layout, splines, .. } = self.flown;
        self.prior.add(layout, splines, &estimate, &knots, &mut matrix, &mut gradient);
        let Some(factor) = Cholesky::of(matrix) else { return Ok(None) };
        let covariance = factor.inverse();
        let is_sound = covariance.diagonal().iter().all(|x| x.is_finite() && *x > 0.0);
        Ok(is_sound.then_some((covariance, at)))
    }

    /// Restricted maximum likelihood for the noise: the evidence of the linearised problem, in which the residuals have lost
    /// what the unknowns could follow.
    fn estimate_noise(
        &mut self,
        from: MarkerNoise,
        at: &Linearized,
    ) -> Result<MarkerNoise, ReconstructionError> {
        let observed = self.observed;
        most_likely(from, &observed.times, &mut |noise| self.evidence(noise, at))
    }

    /// −2 ln of the evidence, least over the size of the noise, and that size.
    fn evidence(&mut self, noise: MarkerNoise, at: &Linearized) -> Result<(f64, f64), ReconstructionError> {
        self.expect_not_cancelled()?;
        let frames = self.all();
        let knots = self.knots(&frames);
        let estimate = self.estimate.clone();
        let unit = MarkerNoise { size: 1.0, ..noise };
        let measured = self.normal(&estimate, &frames, Some(&knots), &unit, at);
        let n = measured.gradient.len();
        let mut matrix = DMatrix::zeros(n, n);
        let mut gradient = vec![0.0; n];
        let Flown { layout, splines, .. } = self.flown;
        let squares = self.prior.add(layout, splines, &estimate, &knots, &mut matrix, &mut gradient);
        let value = |log: f64| {
            let precision = (-2.0 * log).exp();
            let mut hessian = matrix.clone();
            for j in 0..n {
                for i in j..n {
                    hessian[(i, j)] += measured.matrix[(i, j)] * precision;
                }
            }
            let Some(factor) = Cholesky::of(hessian) else { return f64::INFINITY };
            let mut solved: Vec<f64> =
                measured.gradient.iter().zip(&gradient).map(|(a, b)| a * precision + b).collect();
            // gᵀ A⁻¹ g
            factor.solve_lower(&mut solved);
            let gain: f64 = solved.iter().map(|x| x * x).sum();
            measured.n_measured as f64 * 2.0 * log
                + measured.log_determinant
                + measured.squares * precision
                + squares
                - gain
                + factor.log_determinant()
        };
        Ok(most_likely_size(noise.size, value))
    }
}

/// The step that the damped quadratic model ends at, and twice by how much the model falls.
pub(super) fn damped_step(matrix: &DMatrix<f64>, gradient: &[f64], damping: f64) -> Option<(Vec<f64>, f64)> {
    let n = gradient.len();
    let mut damped = matrix.clone();
    for i in 0..n {
        damped[(i, i)] += damping * matrix[(i, i)].max(f64::MIN_POSITIVE);
    }
    let mut step: Vec<f64> = gradient.iter().map(|g| -g).collect();
    Cholesky::of(damped)?.solve(&mut step);
    let decrement = -step.iter().zip(gradient).map(|(x, g)| x * g).sum::<f64>();
    step.iter().all(|x| x.is_finite()).then_some((step, decrement))
}

#[cfg(test)]
mod tests {
    use super::super::departure::{air, function};
    use super::super::joints::JointSplines;
    use super::super::unknowns::Layout;
    use super::*;
    use nalgebra::{Matrix3, UnitQuaternion, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use somersault_core::lie::so3;
    use somersault_multibody::{Joint, Link, MassProperties, Model, ModelBuilder};

    /// A body with an arm on a ball joint and a leg on a hinge.
    fn tree() -> Model {
        let part = |mass: f64| {
            let moments = Vector3::new(0.03, 0.05, 0.04) * mass;
            let inertia = Matrix3::from_diagonal(&moments);
            MassProperties { mass, center: Vector3::new(0.02, 0.0, -0.2), inertia }
        };
        let mut builder = ModelBuilder::new();
        builder.add(Link::root("torso", Joint::Free, part(30.0))).unwrap();
        let arm = Link::child("arm", "torso", Joint::Spherical, part(5.0));
        builder.add(arm.at(Vector3::new(0.0, 0.2, 0.1))).unwrap();
        let leg = Link::child("leg", "torso", Joint::Revolute { axis: Vector3::y() }, part(20.0));
        builder.add(leg.at(Vector3::new(0.0, 0.0, -0.5))).unwrap();
        builder.build().unwrap()
    }

    /// One on each of three bodies.
    fn markers(model: &Model) -> MarkerSet {
        let places = [("torso", [0.1, 0.0, 0.2]), ("arm", [0.0, 0.05, -0.4]), ("leg", [0.05, 0.0, -0.6])];
        MarkerSet::on_bodies(model, places.map(|(body, place)| (body, body, place))).unwrap()
    }

    fn estimate(coefficients: Vec<f64>) -> Estimate {
        Estimate {
            orientation: UnitQuaternion::from_euler_angles(0.3, -0.5, 0.9),
            momentum: Vector3::new(3.0, 25.0, -2.0),
            center: Vector3::new(0.1, 0.2, 0.3),
            velocity: Vector3::new(1.0, 0.0, 2.0),
            scale: 1.1,
            gravity: 0.9,
            coefficients,
        }
    }

    #[test]
    fn derivatives_of_the_squares_are_their_differences() {
        let model = tree();
        let markers = markers(&model);
        let splines = JointSplines::try_new(&model, &model.neutral(), (0.0, 0.4), 4).unwrap();
        let layout = Layout::new(&model, &splines, true, true);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut random = |size: f64| rng.random_range(-size..size);
        let times: Vec<f64> = (0..21).map(|i| 0.02 * f64::from(i)).collect();
        let mut point = || Some(Vector3::new(random(0.5), random(0.5), random(0.5)));
        // a gap of one marker
        let mut points: Vec<Vec<_>> = times.iter().map(|_| (0..3).map(|_| point()).collect()).collect();
        (5..9).for_each(|i| points[i][1] = None);
        let weights = vec![vec![1.0; 3]; points.len()];
        let observed = Observed { times, reference: 9, points, weights };
        let estimate = estimate((0..7 * 4).map(|_| random(0.6)).collect());
        let token = CancellationToken::new();
        // the leg is beyond them at some knots
        let limits = vec![None, None, None, Some([-0.05, 0.1])];
        let mut search = Search {
            flown: Flown { model: &model, splines: &splines, layout: &layout },
            markers: &markers,
            observed: &observed,
            prior: Prior::new(&[0.1; 4], &[true, true, false, true], (1.0, 0.1), limits),
            noise: MarkerNoise { size: 0.1, correlated: 0.7, time: 0.1 },
            trust: vec![vec![1.0, 0.5, 1.0]; 21],
            threshold: None,
            seen: vec![true; 4],
            estimate: estimate.clone(),
            room: Room::new(&model, &splines),
            kinematics: Kinematics::new(&model),
            token: &token,
            iterations: 0,
        };
        let (frames, noise) = (0..21, search.noise);
        let knots = search.knots(&frames);
        let at = search.fly(&estimate, &frames, Some(&knots)).unwrap();
        let Normal { mut matrix, mut gradient, .. } =
            search.normal(&estimate, &frames, Some(&knots), &noise, &at);
        search.prior.add(&layout, &splines, &estimate, &knots, &mut matrix, &mut gradient);
        let h = 1e-5;
        for k in 0..gradient.len() {
            let mut at = |h: f64| {
                let mut step = vec![0.0; gradient.len()];
                step[k] = h;
                search.cost(&layout.advance(&estimate, &step, 0), &frames, &knots, &noise).unwrap()
            };
            let difference = (at(h) - at(-h)) / (4.0 * h);
            let scale = gradient[k].abs() + 1e-2 * matrix[(k, k)].sqrt();
            assert!((gradient[k] - difference).abs() < 1e-5 * scale, "{k}: {} {difference}", gradient[k]);
        }
    }

    #[test]
    fn derivatives_by_places_and_by_the_air_are_differences() {
        let model = tree();
        let markers = markers(&model);
        let splines = JointSplines::try_new(&model, &model.neutral(), (0.0, 0.2), 4).unwrap();
        let layout = Layout::new(&model, &splines, true, true).with_departures(3);
        let flown = Flown { model: &model, splines: &splines, layout: &layout };
        let estimate = estimate((0..7 * 4).map(|k| 0.5 * f64::from(k).sin()).collect());
        let times: Vec<f64> = (0..11).map(|i| 0.02 * f64::from(i)).collect();
        let points: Vec<_> = times.iter().map(|t| vec![Some(Vector3::new(*t, 0.3, 0.1)); 3]).collect();
        let weights = vec![vec![1.0; 3]; points.len()];
        let observed = Observed { times, reference: 4, points, weights };
        let noise = MarkerNoise { size: 0.1, correlated: 0.7, time: 0.1 };
        let (frames, knots) = (0..11, 0..splines.n_knots());
        let (mut room, mut kinematics) = (Room::new(&model, &splines), Kinematics::new(&model));
        let mut normal = |markers: &MarkerSet, observed: &Observed| {
            let trust = vec![vec![1.0; 3]; 11];
            let knots = Some(&knots);
            let at =
                flown.fly(markers, observed, &estimate, &frames, knots, &mut room, &mut kinematics).unwrap();
            flown.normal(markers, observed, &estimate, &frames, knots, &at, &trust, &noise)
        };
        let gradient = normal(&markers, &observed).gradient;
        let h = 1e-5;
        for (number, k) in layout.places().enumerate() {
            let mut squares = |h: f64| {
                let mut moved = markers.markers().to_vec();
                moved[number / 3].point[number % 3] += h;
                normal(&MarkerSet::try_new(&model, moved).unwrap(), &observed).squares
            };
            let difference = (squares(h) - squares(-h)) / (4.0 * h);
            let apart = (gradient[k] - difference).abs();
            assert!(apart < 1e-5 * (gradient[k].abs() + 1.0), "{number}: {} {difference}", gradient[k]);
        }
        // a drag moves the flight as if what was measured were moved back
        let gravity = model.gravity() * 0.9;
        let mut squares = |h: f64| {
            let mut moved = observed.clone();
            for (t, frame) in observed.times.iter().zip(&mut moved.points) {
                let by = air(&estimate.velocity, &gravity, t - observed.times[4]) * h;
                frame.iter_mut().for_each(|point| *point = point.map(|point| point - by));
            }
            normal(&markers, &moved).squares
        };
        let k = layout.air().unwrap();
        let difference = (squares(1e-3) - squares(-1e-3)) / 4e-3;
        assert!((gradient[k] - difference).abs() < 1e-6 * gradient[k].abs(), "{} {difference}", gradient[k]);
        // whose acceleration is that of the drag
        let (t, h) = (0.1, 1e-3);
        let at = |t: f64| air(&estimate.velocity, &gravity, t);
        let acceleration = (at(t + h) - at(t) * 2.0 + at(t - h)) / (h * h);
        let velocity = estimate.velocity + model.gravity() * (0.9 * t);
        let drag = -velocity * velocity.norm();
        assert!((acceleration - drag).norm() < 1e-4 * drag.norm(), "{acceleration} {drag}");
    }

    #[test]
    fn departures_of_the_momentum_are_those_of_a_momentum_that_varies() {
        let model = tree();
        let splines = JointSplines::try_new(&model, &model.neutral(), (0.0, 0.2), 4).unwrap();
        let layout = Layout::new(&model, &splines, false, false).with_departures(0);
        let flown = Flown { model: &model, splines: &splines, layout: &layout };
        let mut room = Room::new(&model, &splines);
        let estimate = Estimate {
            orientation: UnitQuaternion::from_euler_angles(0.3, -0.5, 0.9),
            momentum: Vector3::new(3.0, 25.0, -2.0),
            center: Vector3::zeros(),
            velocity: Vector3::zeros(),
            scale: 1.0,
            gravity: 1.0,
            coefficients: (0..7 * 4).map(|k| 0.5 * f64::from(k).sin()).collect(),
        };
        let times: Vec<f64> = (0..=80).map(|i| 0.0025 * f64::from(i)).collect();
        let knots = 0..splines.n_knots();
        let at = flown.attitudes(&estimate, &times, 0, Some(&knots), &mut room).unwrap();
        let by = at[80].by_unknowns.as_ref().unwrap();
        // interval by interval, each with the momentum of its middle
        let mut end = |departure: Vector3<f64>, k: usize| {
            let mut current = estimate.clone();
            for pair in times.windows(2) {
                let [factor, _] = function(&splines, k, 0.5 * (pair[0] + pair[1]));
                current.momentum = estimate.momentum + departure * factor;
                current.orientation =
                    flown.attitudes(&current, pair, 0, None, &mut room).unwrap()[1].orientation;
            }
            current.orientation
        };
        let h = 1e-3;
        for (number, momentum, _) in layout.departing() {
            for (k, turn) in momentum.zip(&layout.turns) {
                let [more, less] = [h, -h].map(|h| end(turn * h, number));
                let difference = so3::log(&(less.inverse() * more)) / (2.0 * h);
                let apart = (by.column(k) - difference).norm();
                assert!(apart < 1e-3 * difference.norm(), "{number} {k}: {} {difference}", by.column(k));
            }
        }
    }
}
