//! What is reconstructed, and what follows from the minimum.

use super::attitude::{Flown, flight_of};
use super::check::full_dynamics_defect;
use super::flight::{AGREEMENT, FlightFrame, Quantity, ReconstructedFlight, ReconstructionStatus};
use super::joints::JointSplines;
use super::noise::MarkerNoise;
use super::normal::Observed;
use super::prior::Prior;
use super::search::{Linearized, Search, rooms};
use super::start::{FrameFits, FrameNoise};
use super::unknowns::{Estimate, Layout};
use super::{BodyScale, ReconstructionError, ReconstructionOptions};
use crate::fit::{MarkerFit, MarkerSet};
use crate::recording::MarkerRecording;
use faer::Mat;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, RowDVector, UnitQuaternion, Vector3};
use somersault_core::cancel::CancellationToken;
use somersault_multibody::counting::{BodyAngles, Counting};
use somersault_multibody::flight::{Flight, FlightData, TakeOff};
use somersault_multibody::{Data, Model};
use std::f64::consts::TAU;

/// A model with markers, whose flight is to be found.
///
/// ```
/// use somersault_motion::fit::MarkerSet;
/// use somersault_motion::reconstruction::{FlightReconstruction, ReconstructionOptions};
/// use somersault_motion::synthetic::synthetic_markers;
/// use somersault_multibody::models::{Diver, Posture};
///
/// // a rigid somersault in the plane, markers with noise of 10 mm
/// let diver = Diver::planar();
/// let model = diver.model()?;
/// let markers = MarkerSet::joint_centres(&model)?;
/// let times: Vec<f64> = (0..41).map(|i| 0.02 * f64::from(i)).collect();
/// let posture = diver.configuration(Posture::A)?;
/// let mut data = somersault_multibody::Data::new(&model);
/// let center = model.positions(&mut data, &posture)?.center_of_mass();
/// let mut positions = Vec::new();
/// for t in &times {
///     let (mut q, turn) = (posture.clone(), nalgebra::Rotation2::new(-5.0 * t));
///     let place = nalgebra::Vector2::new(t + 0.0, 4.0 * t - 4.905 * t * t) - turn * nalgebra::Vector2::new(center.x, center.z);
///     (q[0], q[1], q[2]) = (place.x, place.y, -5.0 * t);
///     positions.extend(q);
/// }
/// let seen = synthetic_markers(&model, &markers, &times, &positions, 0.01, 1)?;
/// let problem = FlightReconstruction::try_new(&model, markers, ReconstructionOptions::default())?;
/// let flight = problem.reconstruct(&seen)?;
/// assert!(flight.success() && (flight.velocity.value.z - 4.0).abs() < 0.02);
/// assert!((flight.somersaults() - 4.0 / std::f64::consts::TAU).abs() < 0.02);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct FlightReconstruction {
    model: Model,
    markers: MarkerSet,
    options: ReconstructionOptions,
}

/// Frames that a flight has, at least.
const LEAST_FRAMES: usize = 10;
/// Unknowns that a search may have: a Hessian of them takes 72 MB.
const MAX_UNKNOWNS: usize = 3000;
/// Where the search begins, in fractions of the duration: elsewhere where it fails from the middle.
const REFERENCES: [f64; 3] = [0.5, 0.38, 0.62];
/// Noise where nothing is known of it, m.
const NOISE: f64 = 0.03;
/// Standard deviations by which χ² is a misfit.
const MISFIT: f64 = 5.0;
/// What χ² may differ from 1 by, whatever the noise is: angles at limits, robust losses.
const TOLERANCE: f64 = 0.1;
/// What splines with knots of 0.07 s leave of the motion of human joints, m.
const FOLLOWED: f64 = 0.002;
/// Rotation of a ball joint from its reference up to which its channels are sound, rad.
const LARGEST_TURN: f64 = 5.5;
/// Mass that joints may carry which no marker sees, in fractions of the whole.
const UNSEEN: f64 = 0.1;
/// Displacement for the derivative of the moment of inertia, rad or m.
const DISPLACEMENT: f64 = 1e-5;
/// Part of the momentum that must be horizontal for its direction to be that of the somersault.
const HORIZONTAL: f64 = 0.3;

impl FlightReconstruction {
    /// The flight of `model`, whose root has a free or a planar joint, with `markers`.
    pub fn try_new(
        model: &Model,
        markers: MarkerSet,
        options: ReconstructionOptions,
    ) -> Result<Self, ReconstructionError> {
        options.validate()?;
        // refuses what cannot fly, and joints that have no splines
        let at_rest = TakeOff {
            time: 0.0,
            center_of_mass: Vector3::zeros(),
            velocity: Vector3::zeros(),
            angular_momentum: Vector3::zeros(),
        };
        Flight::try_new(model, at_rest)?;
        JointSplines::try_new(model, &model.neutral(), (0.0, 1.0), 1)?;
        if options.seek_gravity && model.gravity().norm() == 0.0 {
            return Err(ReconstructionError::NoGravity);
        }
        Ok(Self { model: model.clone(), markers, options })
    }

    /// Its choices.
    pub fn options(&self) -> &ReconstructionOptions {
        &self.options
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Its markers.
    pub fn markers(&self) -> &MarkerSet {
        &self.markers
    }

    /// The flight of a recording. Markers of the recording that the model has not are ignored, those that the recording has not are
    /// missing; frames without markers at both ends are left out.
    pub fn reconstruct(
        &self,
        recording: &MarkerRecording,
    ) -> Result<ReconstructedFlight, ReconstructionError> {
        self.reconstruct_cancellable(recording, &CancellationToken::new())
    }

    /// As [`reconstruct`](Self::reconstruct), and ends with [`FitError::Interrupted`](crate::fit::FitError::Interrupted) within an iteration
    /// of the cancellation.
    pub fn reconstruct_cancellable(
        &self,
        recording: &MarkerRecording,
        token: &CancellationToken,
    ) -> Result<ReconstructedFlight, ReconstructionError> {
        let recording = self.part(recording)?;
        let times = recording.times().to_vec();
        let duration = times[times.len() - 1] - times[0];
        let n_intervals = (duration / self.options.knot_spacing).round().max(1.0);
        let n_channels = self.model.n_velocities() - self.model.velocities_of(0).len();
        let found = (n_intervals + 3.0) * n_channels as f64;
        if found > MAX_UNKNOWNS as f64 {
            return Err(ReconstructionError::TooManyUnknowns { found: found as usize, limit: MAX_UNKNOWNS });
        }
        let fits = FrameFits::try_new(&self.model, &self.markers, &self.options, &recording, token)?;
        let fit = MarkerFit::try_new(&self.model, self.markers.clone(), crate::fit::FitOptions::default())?;
        let points = fit.targets(&recording)?;
        let mut best: Option<ReconstructedFlight> = None;
        for fraction in REFERENCES {
            let reference = fits.reference(&times, fraction);
            let observed = Observed { times: times.clone(), reference, points: points.clone() };
            let flight = self.beginning_at(&fits, &observed, n_intervals as usize, token)?;
            let misfit = |flight: &ReconstructedFlight| flight.chi_squared.unwrap_or(flight.noise.size);
            if best.as_ref().is_none_or(|best| misfit(&flight) < misfit(best)) {
                best = Some(flight);
            }
            if best.as_ref().is_some_and(|best| best.status == ReconstructionStatus::Converged) {
                break;
            }
        }
        best.ok_or(ReconstructionError::TooFewFrames { least: LEAST_FRAMES, found: 0 })
    }

    /// The frames of the interval, without those at its ends that have no marker of the model.
    fn part(&self, recording: &MarkerRecording) -> Result<MarkerRecording, ReconstructionError> {
        let (start, end) = self.options.interval.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let known: Vec<usize> =
            self.markers.markers().iter().filter_map(|marker| recording.marker(&marker.name).ok()).collect();
        let times = recording.times();
        let shows = |i: &usize| {
            let frame = recording.frame(*i).unwrap_or_default();
            (start..=end).contains(&times[*i]) && known.iter().any(|k| frame[*k].is_some())
        };
        let frames: Vec<usize> = (0..times.len()).filter(shows).collect();
        if frames.len() < LEAST_FRAMES && !known.is_empty() {
            return Err(ReconstructionError::TooFewFrames { least: LEAST_FRAMES, found: frames.len() });
        }
        let range = frames.first().copied().unwrap_or(0)..frames.last().map_or(times.len(), |last| last + 1);
        Ok(recording.part(range)?)
    }

    /// The flight that is found from one reference.
    fn beginning_at(
        &self,
        fits: &FrameFits,
        observed: &Observed,
        n_intervals: usize,
        token: &CancellationToken,
    ) -> Result<ReconstructedFlight, ReconstructionError> {
        let Self { model, markers, options } = self;
        let times = &observed.times;
        let span = (times[0], times[times.len() - 1] - times[0]);
        let posture = fits.configuration(observed.reference);
        let splines = JointSplines::try_new(model, posture, span, n_intervals)?;
        let (has_scale, scale) = match options.scale {
            BodyScale::Known(size) => (false, (size, 1.0)),
            BodyScale::Sought { mean, deviation } => (true, (mean, deviation)),
        };
        let layout = Layout::new(model, &splines, has_scale, options.seek_gravity);
        let frame_noise = fits.noise(model, markers, &layout, observed)?;
        let seen = fits.seen(splines.n_channels());
        let estimate = fits.estimate(model, &splines, times, observed.reference)?;
        let prior = Prior::new(&estimate.coefficients[..splines.n_channels()], &seen, scale);
        let size = options.noise.map(|noise| noise.size).or(frame_noise.map(|noise| noise.size));
        let noise = options.noise.unwrap_or(MarkerNoise::white(size.unwrap_or(NOISE)));
        let (room, kinematics) = rooms(model, &splines);
        let mut search = Search {
            flown: Flown { model, splines: &splines, layout: &layout },
            markers,
            observed,
            prior,
            noise,
            trust: vec![vec![1.0; markers.markers().len()]; times.len()],
            threshold: options.threshold,
            seen,
            estimate,
            room,
            kinematics,
            token,
            iterations: 0,
        };
        search.grow()?;
        let status = search.settle(options.noise.is_some(), options.max_iterations)?;
        let noise = search.noise;
        let posterior = search.posterior(&noise)?;
        self.judge(search, status, posterior, frame_noise)
    }

    /// The flight at the minimum, and what is wrong with it.
    fn judge(
        &self,
        mut search: Search<'_>,
        mut status: ReconstructionStatus,
        posterior: Option<(DMatrix<f64>, Linearized)>,
        frame_noise: Option<FrameNoise>,
    ) -> Result<ReconstructedFlight, ReconstructionError> {
        let frames = 0..search.observed.times.len();
        let estimate = search.estimate.clone();
        let Flown { layout, splines, .. } = search.flown;
        let n = layout.n(splines.n_knots());
        let is_determined = posterior.is_some();
        let (covariance, at) = match posterior {
            Some(found) => found,
            None => {
                let knots = 0..splines.n_knots();
                let at = search.fly(&estimate, &frames, Some(&knots))?;
                (DMatrix::from_diagonal_element(n, n, f64::NAN), at)
            }
        };
        let (chi_squared, chi_squared_range) = self.chi_squared(&mut search, &covariance, &at, frame_noise);
        let flown_frames = self.frames(&mut search, &estimate, &covariance, &at)?;
        let configurations: Vec<f64> =
            flown_frames.iter().flat_map(|frame| frame.q.iter().copied()).collect();
        let full_dynamics_defect = full_dynamics_defect(
            &self.model,
            splines,
            &estimate.coefficients,
            &search.observed.times,
            &configurations,
            &flown_frames[0].v,
            search.token,
        )?;
        let n_root = self.model.velocities_of(0).len();
        let all = search.seen.iter().enumerate();
        let unseen: Vec<usize> = all.filter(|(_, seen)| !**seen).map(|(c, _)| n_root + c).collect();
        let is_determined = is_determined
            && splines.largest_turn(&estimate.coefficients) <= LARGEST_TURN
            && self.carried(&unseen) <= UNSEEN * self.model.mass();
        let within = chi_squared.is_none_or(|x| (chi_squared_range[0]..=chi_squared_range[1]).contains(&x));
        if status == ReconstructionStatus::Converged {
            if !is_determined {
                status = ReconstructionStatus::Undetermined;
            } else if !within {
                status = ReconstructionStatus::Misfit;
            } else if full_dynamics_defect.is_nan() || full_dynamics_defect > AGREEMENT {
                status = ReconstructionStatus::NotConfirmed;
            }
        }
        let (iterations, noise) = (search.iterations, search.noise);
        let mut flight = ReconstructedFlight {
            status,
            frames: flown_frames,
            scale: [estimate.scale, 0.0],
            angular_momentum: Quantity { value: Vector3::zeros(), deviation: Vector3::zeros() },
            center_of_mass: Quantity { value: Vector3::zeros(), deviation: Vector3::zeros() },
            velocity: Quantity { value: Vector3::zeros(), deviation: Vector3::zeros() },
            gravity: [estimate.gravity, 0.0],
            height: 0.0,
            turns_deviation: [0.0; 2],
            covariance: DMatrix::zeros(0, 0),
            noise,
            chi_squared,
            chi_squared_range,
            full_dynamics_defect,
            unseen,
            iterations,
        };
        self.summarize(&search, &estimate, &covariance, &at, &mut flight);
        Ok(flight)
    }

    /// The mass further out than any of these degrees of freedom, kg.
    fn carried(&self, unseen: &[usize]) -> f64 {
        let model = &self.model;
        let moves = |i: usize| unseen.iter().any(|k| model.velocities_of(i).contains(k));
        let mut is_carried = vec![false; model.n_bodies()];
        for i in 1..model.n_bodies() {
            is_carried[i] = moves(i) || model.parent(i).is_some_and(|parent| is_carried[parent]);
        }
        let links = model.links().iter().zip(is_carried).filter(|(_, is_carried)| *is_carried);
        links.map(|(link, _)| link.mass_properties().mass).sum()
    }

    /// χ² per degree of freedom, and where it must lie.
    fn chi_squared(
        &self,
        search: &mut Search<'_>,
        covariance: &DMatrix<f64>,
        at: &Linearized,
        frame_noise: Option<FrameNoise>,
    ) -> (Option<f64>, [f64; 2]) {
        let frames = 0..search.observed.times.len();
        let knots = 0..search.flown.splines.n_knots();
        let Flown { layout, splines, .. } = search.flown;
        let measured = search.normal(&search.estimate, &frames, None, &search.noise, at);
        // unknowns that the data determine: n − tr(P Σ)
        let n = covariance.nrows();
        let mut prior = Mat::zeros(n, n);
        let mut gradient = vec![0.0; n];
        search.prior.add(layout, splines, &search.estimate, &knots, &mut prior, &mut gradient);
        let mut trace = 0.0;
        for j in 0..n {
            trace += prior[(j, j)] * covariance[(j, j)];
            for i in j + 1..n {
                trace += 2.0 * prior[(i, j)] * covariance[(i, j)];
            }
        }
        let n_over = measured.n_measured as f64 - (n as f64 - trace);
        let noise = search.noise;
        // how many times fewer frames are independent
        let times = &search.observed.times;
        let spacing = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
        let repeats = 1.0 + noise.correlated.powi(2) * noise.time / spacing;
        let variance = 2.0 / n_over.max(1.0);
        let (reference, variance) = match (self.options.noise, frame_noise) {
            (Some(given), _) => (Some(given.size), variance),
            (None, Some(found)) => {
                (Some(found.size.hypot(FOLLOWED)), variance + 2.0 * repeats / found.n_over)
            }
            (None, None) => (None, variance),
        };
        let width = TOLERANCE + MISFIT * variance.sqrt();
        let found = reference.map(|size| measured.squares / n_over.max(1.0) * (noise.size / size).powi(2));
        (found, [(1.0 - width).max(0.0), 1.0 + width])
    }

    /// All frames.
    fn frames(
        &self,
        search: &mut Search<'_>,
        estimate: &Estimate,
        covariance: &DMatrix<f64>,
        at: &Linearized,
    ) -> Result<Vec<FlightFrame>, ReconstructionError> {
        let model = &self.model;
        let all = 0..search.observed.times.len();
        let knots = 0..search.flown.splines.n_knots();
        let residuals = search.flown.residuals(search.observed, estimate, all.clone(), &at.placed);
        let reference = search.observed.times[search.observed.reference];
        let flight = flight_of(model, reference, estimate)?;
        let angles = self.angles(estimate, at);
        let (mut data, mut flight_data) = (Data::new(model), FlightData::new(model));
        let n_linear = model.joint(0).map_or(0, |joint| joint.kind().n_linear);
        let mut found = Vec::with_capacity(all.len());
        for i in all {
            let (attitude, placed, t) = (&at.attitudes[i], &at.placed[i], search.observed.times[i]);
            let Search { flown, room, .. } = search;
            let layout = flown.layout;
            let n = covariance.nrows();
            let by_attitude = attitude.by_unknowns.as_ref().map_or_else(|| Matrix3xX::zeros(n), Clone::clone);
            // angular velocity, in axes of the root and then of the world
            let rate = flown.rate(&flight, estimate, t, &attitude.orientation, room, 0)?.clone();
            let mut by_rate = rate.by_orientation * &by_attitude;
            for (k, turn) in layout.momentum().zip(&layout.turns) {
                let mut column = by_rate.column_mut(k);
                column += rate.by_momentum * turn;
            }
            flown.add_channels(&mut by_rate, &Matrix3::identity(), &rate, t, &knots);
            let by_rate = placed.turn
                * (by_rate - somersault_core::lie::so3::hat(&rate.angular_velocity) * &by_attitude);
            let of_rate = &by_rate * covariance * by_rate.transpose();
            // configuration and velocity: those at scale 1 with the centre of mass at rest in the origin, moved and stretched
            flown.pose(estimate, t, &attitude.orientation, room);
            let (mut q, mut v) = (room.q.clone(), room.v.clone());
            let still = TakeOff {
                time: t,
                center_of_mass: Vector3::zeros(),
                velocity: Vector3::zeros(),
                angular_momentum: estimate.momentum,
            };
            Flight::try_new(model, still)?.complete(&mut flight_data, t, &mut q, &mut v)?;
            let center = flown.center_of_mass(estimate, reference, t);
            let velocity = self.velocity_at(estimate, t - reference);
            let placement = model.placement(0);
            let (axes, origin) =
                placement.map_or((Matrix3::identity(), Vector3::zeros()), |p| (p.rotation, p.translation));
            let place = axes.tr_mul(&(center - placed.center * estimate.scale - origin));
            let carried = placed.turn.tr_mul(&velocity);
            for k in 0..n_linear {
                q[k] = place[k];
                v[k] = v[k] * estimate.scale + carried[k];
            }
            // the joints' covariance, along v
            let of_channels = self.channel_covariance(flown, covariance, t);
            let mut of_joints = of_channels;
            flown.splines.of_displacements(&room.channels, &mut of_joints);
            let of_attitude = &by_attitude * covariance * by_attitude.transpose();
            let turning = if layout.is_planar { vec![2] } else { vec![0, 1, 2] };
            let deviations = turning
                .iter()
                .map(|k| of_attitude[(*k, *k)])
                .chain(of_joints.diagonal().iter().copied())
                .map(f64::sqrt)
                .collect();
            let direction = estimate.momentum.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::y);
            let inertia = inertia_of(model, &mut data, &q, &placed.turn)? * estimate.scale.powi(2);
            let moment = direction.dot(&(inertia * direction));
            let by_moment =
                self.moment_gradient(search, estimate, &q, t, &direction, attitude, placed, &mut data)?;
            let moment_of_inertia_deviation =
                (&by_moment * covariance * by_moment.transpose())[(0, 0)].sqrt();
            found.push(FlightFrame {
                time: t,
                q,
                v,
                deviations,
                center_of_mass: center,
                angular_velocity: Quantity {
                    value: placed.turn * rate.angular_velocity,
                    deviation: of_rate.diagonal().map(|x| x.max(0.0).sqrt()).fixed_rows::<3>(0).into_owned(),
                },
                moment_of_inertia: moment,
                moment_of_inertia_deviation,
                inertia,
                somersaults: (angles[i].somersault - angles[0].somersault) / TAU,
                twists: (angles[i].twist - angles[0].twist) / TAU,
                tilt: angles[i].tilt,
                residuals: residuals[i].iter().map(|r| r.map(|r| r.norm())).collect(),
            });
        }
        if search.flown.layout.is_planar {
            count_turns(&mut found);
        }
        Ok(found)
    }

    fn velocity_at(&self, estimate: &Estimate, t: f64) -> Vector3<f64> {
        estimate.velocity + self.model.gravity() * (estimate.gravity * t)
    }

    /// Of the channels at `t`.
    fn channel_covariance(&self, flown: &Flown<'_>, covariance: &DMatrix<f64>, t: f64) -> DMatrix<f64> {
        let n = flown.layout.n_channels;
        let acting = flown.splines.acting(t, 0);
        let at = |k: usize, c: usize| flown.layout.coefficients() + (acting.first + k) * n + c;
        DMatrix::from_fn(n, n, |a, b| {
            let mut sum = 0.0;
            for (i, x) in acting.factors.iter().enumerate() {
                for (j, y) in acting.factors.iter().enumerate() {
                    sum += x * y * covariance[(at(i, a), at(j, b))];
                }
            }
            sum
        })
    }

    /// The derivatives of the moment of inertia about the axis of the momentum by the unknowns.
    fn moment_gradient(
        &self,
        search: &Search<'_>,
        estimate: &Estimate,
        q: &[f64],
        t: f64,
        direction: &Vector3<f64>,
        attitude: &super::attitude::Attitude,
        placed: &super::normal::Placed,
        data: &mut Data,
    ) -> Result<RowDVector<f64>, ReconstructionError> {
        let Search { flown, room, .. } = search;
        let (model, layout, splines) = (&self.model, flown.layout, flown.splines);
        let squared = estimate.scale.powi(2);
        let n_linear = model.joint(0).map_or(0, |joint| joint.kind().n_linear);
        let mut moved = q.to_vec();
        let mut step = vec![0.0; model.n_velocities()];
        let mut by_v = Vec::with_capacity(step.len() - n_linear);
        for k in n_linear..step.len() {
            let mut at = |h: f64| -> Result<f64, ReconstructionError> {
                step[k] = h;
                model.displace(q, &step, &mut moved)?;
                step[k] = 0.0;
                let orientation = orientation_of(layout.is_planar, &moved);
                let turn = super::attitude::turn_of(model, &orientation);
                let inertia = inertia_of(model, data, &moved, &turn)?;
                Ok(direction.dot(&(inertia * direction)) * squared)
            };
            by_v.push((at(DISPLACEMENT)? - at(-DISPLACEMENT)?) / (2.0 * DISPLACEMENT));
        }
        let n_turns = layout.turns.len();
        let mut gradient = RowDVector::zeros(layout.n(splines.n_knots()));
        if let Some(by) = &attitude.by_unknowns {
            let mut of_turn = Vector3::zeros();
            for k in 0..n_turns {
                of_turn += layout.displacement(k) * by_v[k];
            }
            gradient += of_turn.transpose() * by;
        }
        let mut by_channel: Vec<Vector3<f64>> = by_v[n_turns..].iter().map(|x| Vector3::x() * *x).collect();
        splines.by_displacements(&room.channels, &mut by_channel);
        let acting = splines.acting(t, 0);
        for (k, factor) in acting.factors.iter().enumerate() {
            for (c, by) in by_channel.iter().enumerate() {
                gradient[layout.coefficients() + (acting.first + k) * layout.n_channels + c] += factor * by.x;
            }
        }
        let inertia = inertia_of(model, data, q, &placed.turn)? * squared;
        let turned = inertia * direction;
        let across = (turned - direction * direction.dot(&turned)) * (2.0 / estimate.momentum.norm());
        for (k, turn) in layout.momentum().zip(&layout.turns) {
            gradient[k] += across.dot(turn);
        }
        if let Some(k) = layout.scale() {
            gradient[k] += 2.0 * direction.dot(&turned) / estimate.scale;
        }
        Ok(gradient)
    }

    /// The world turned about the vertical, so that the axis of the somersault is lateral to the body in its first frame.
    fn travel(&self, estimate: &Estimate, at: &Linearized) -> UnitQuaternion<f64> {
        let body = at.attitudes[0].orientation * self.counting().axes;
        let placement = self.model.placement(0).map_or(Matrix3::identity(), |p| p.rotation);
        let left = placement * (body * Vector3::y());
        let momentum = estimate.momentum;
        let level = Vector3::new(momentum.x, momentum.y, 0.0);
        let axis = if level.norm() > HORIZONTAL * momentum.norm() {
            level * level.dot(&left).signum()
        } else {
            Vector3::new(left.x, left.y, 0.0)
        };
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -(-axis.x).atan2(axis.y))
    }

    /// The body's axes, x forward and z along it, in those of the root: those of the world at the neutral configuration.
    fn counting(&self) -> Counting {
        let placement = self.model.placement(0).map_or(Matrix3::identity(), |p| p.rotation);
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(placement.transpose());
        Counting { axes: UnitQuaternion::from_rotation_matrix(&rotation) }
    }

    /// The root in the frame of travel, in each frame.
    fn travelling(&self, estimate: &Estimate, at: &Linearized) -> Vec<UnitQuaternion<f64>> {
        let travel = self.travel(estimate, at);
        let placement = self.counting().axes.inverse();
        at.attitudes.iter().map(|attitude| travel * placement * attitude.orientation).collect()
    }

    fn angles(&self, estimate: &Estimate, at: &Linearized) -> Vec<BodyAngles> {
        self.counting().along(&self.travelling(estimate, at))
    }

    /// Momentum, take-off, scale and gravity with their covariance.
    fn summarize(
        &self,
        search: &Search<'_>,
        estimate: &Estimate,
        covariance: &DMatrix<f64>,
        at: &Linearized,
        flight: &mut ReconstructedFlight,
    ) {
        let layout = search.flown.layout;
        let times = &search.observed.times;
        let t = times[0] - times[search.observed.reference];
        let gravity = self.model.gravity();
        let squared = estimate.scale.powi(2);
        let mut rows = DMatrix::zeros(11, covariance.nrows());
        let mut add = |first: usize, k: usize, column: Vector3<f64>| {
            let mut view = rows.fixed_view_mut::<3, 1>(first, k);
            view += column;
        };
        for (k, turn) in layout.momentum().zip(&layout.turns) {
            add(0, k, turn * squared);
        }
        for (k, axis) in layout.center().zip(&layout.axes) {
            add(3, k, *axis);
        }
        for (k, axis) in layout.velocity().zip(&layout.axes) {
            add(3, k, axis * t);
            add(6, k, *axis);
        }
        if let Some(k) = layout.gravity() {
            add(3, k, gravity * (0.5 * t * t));
            add(6, k, gravity * t);
            rows[(10, k)] = 1.0;
        }
        if let Some(k) = layout.scale() {
            let mut view = rows.fixed_view_mut::<3, 1>(0, k);
            view += estimate.momentum * (2.0 * estimate.scale);
            rows[(9, k)] = 1.0;
        }
        flight.covariance = &rows * covariance * rows.transpose();
        let deviation = |k: usize| flight.covariance[(k, k)].max(0.0).sqrt();
        let three = |first: usize| Vector3::from_fn(|k, _| deviation(first + k));
        let center = search.flown.center_of_mass(estimate, times[search.observed.reference], times[0]);
        let velocity = self.velocity_at(estimate, t);
        flight.angular_momentum = Quantity { value: estimate.momentum * squared, deviation: three(0) };
        flight.center_of_mass = Quantity { value: center, deviation: three(3) };
        flight.velocity = Quantity { value: velocity, deviation: three(6) };
        flight.scale[1] = deviation(9);
        flight.gravity[1] = deviation(10);
        // along the gravity of the estimate
        let down = gravity * estimate.gravity;
        let up = -velocity.dot(&down);
        flight.height = if up > 0.0 { 0.5 * up * up / down.norm().powi(3) } else { 0.0 };
        let orientations = self.travelling(estimate, at);
        let counting = self.counting();
        let last = orientations.len() - 1;
        let [start, end] = [0, last].map(|i| counting.gradients(&orientations[i]));
        for (k, angle) in [0, 2].into_iter().enumerate() {
            let mut row = DVector::zeros(covariance.nrows());
            for (i, sign, gradient) in [(last, 1.0, end[angle]), (0, -1.0, start[angle])] {
                if let Some(by) = &at.attitudes[i].by_unknowns {
                    row += by.tr_mul(&(gradient * sign));
                }
            }
            flight.turns_deviation[k] = row.dot(&(covariance * &row)).max(0.0).sqrt() / TAU;
        }
    }
}

/// The inertia about the centre of mass of the model with its joints locked, in axes of the world.
fn inertia_of(
    model: &Model,
    data: &mut Data,
    q: &[f64],
    turn: &Matrix3<f64>,
) -> Result<Matrix3<f64>, ReconstructionError> {
    let rates = model.velocities_of(0);
    let matrix = model.centroidal(data, q)?.matrix;
    let mut inertia = Matrix3::zeros();
    if rates.len() == 3 {
        // about the normal alone
        let normal = turn.column(2);
        let momentum = matrix.fixed_view::<3, 1>(3, rates.end - 1).into_owned();
        inertia = momentum * normal.transpose();
    } else {
        for (k, axis) in turn.column_iter().enumerate() {
            inertia += matrix.fixed_view::<3, 1>(3, rates.end - 3 + k) * axis.transpose();
        }
    }
    Ok(inertia)
}

fn orientation_of(is_planar: bool, q: &[f64]) -> UnitQuaternion<f64> {
    if is_planar {
        somersault_core::lie::so3::exp(&(Vector3::z() * q[2]))
    } else {
        somersault_core::lie::so3::normalized_xyzw(&q[3..7])
    }
}

/// The angle of a planar root counts whole turns: less than half of one from frame to frame.
fn count_turns(frames: &mut [FlightFrame]) {
    for i in 1..frames.len() {
        let before = frames[i - 1].q[2];
        let angle = &mut frames[i].q[2];
        *angle += TAU * ((before - *angle) / TAU).round();
    }
}
