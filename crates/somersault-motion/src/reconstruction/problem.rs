//! What is reconstructed, and whether the minimum is a flight.

use super::attitude::{Flown, Room};
use super::check::full_dynamics_defect;
use super::exchange::{LEFT, exchanged, intervals, put_right};
use super::flight::{AGREEMENT, BeyondLimit, FOLLOWED, Quantity, ReconstructedFlight, ReconstructionStatus};
use super::joints::JointSplines;
use super::normal::{Kinematics, Linearized, Observed};
use super::plane::depth_departure;
use super::prior::Prior;
use super::report::Report;
use super::score::Tested;
use super::search::Search;
use super::start::start_of;
use super::unknowns::Layout;
use super::{ReconstructionError, ReconstructionOptions};
use crate::fit::{BodyScale, MarkerFit, MarkerSet};
use crate::frame_fits::{
    FrameFits, FrameNoise, UNKNOWN_NOISE, carry_much, chi_squared, frames_between, points_and_weights,
};
use crate::noise::MarkerNoise;
use crate::noise::standard_deviation;
use crate::phases::{FlightPhase, PhaseStatus, find_flight};
use crate::recording::MarkerRecording;
use nalgebra::{DMatrix, Vector3};
use somersault_core::argument::expect_range;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::Model;
use somersault_multibody::flight::{Flight, TakeOff};
use std::ops::Range;

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
/// The longest flight, s.
const LONGEST: f64 = 100.0;
/// Unknowns that a search may have: a Hessian of them takes 72 MB.
const MAX_UNKNOWNS: usize = 3000;
/// Derivatives of an orientation that all frames may have together: 480 MB.
const MAX_DERIVATIVES: f64 = 2e7;
/// Where the search begins, in fractions of the duration: elsewhere where it fails from the middle.
const REFERENCES: [f64; 3] = [0.5, 0.38, 0.62];
/// Rounds in which exchanged markers are put right, and the time between frames of two exchanges, s.
const MAX_REPAIRS: usize = 6;
const GAP: f64 = 0.1;
/// Rotation of a ball joint from its reference up to which its channels are sound, rad.
const LARGEST_TURN: f64 = 5.5;

/// What was found from one of the references.
struct Begun {
    flight: ReconstructedFlight,
    /// That which fits of single frames leave.
    noise: Option<f64>,
    /// Its fraction of the duration.
    reference: f64,
}

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
    /// missing; frames without markers at both ends are left out, and without an interval those before the take-off and after the entry.
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
        if self.options.interval.is_some() {
            // before all frames are fitted
            self.n_intervals(recording.times())?;
        }
        let fits = FrameFits::try_new(&self.model, &self.markers, self.options.scale, &recording, token)?;
        let seen = self.phase(&fits, recording.times());
        // an error here, such as too few heights, is no evidence against a flight
        let doubtful = matches!(&seen, Ok(Some(FlightPhase { status: PhaseStatus::NotFound, .. })));
        let phase = if self.options.interval.is_none() { seen? } else { None };
        let frames = self.frames_of(phase.as_ref(), recording.times());
        let (recording, mut fits) = (recording.part(frames.clone())?, fits.part(frames));
        let times = recording.times().to_vec();
        let n_intervals = self.n_intervals(&times)?;
        // Each round looks at the recording as it is: exchanges that a flight with exchanged markers suggests do not add up.
        let mut repaired = recording.clone();
        let mut exchanges = Vec::new();
        let mut left = f64::INFINITY;
        let mut first: Option<ReconstructedFlight> = None;
        let mut references = REFERENCES.to_vec();
        let mut round = 0;
        loop {
            let Begun { mut flight, noise, reference } =
                self.flight_of(&fits, &repaired, n_intervals, &references, doubtful, token)?;
            flight.phase.clone_from(&phase);
            if flight.status == ReconstructionStatus::NotInFlight {
                return Ok(flight);
            }
            // what the first round learns of references holds for the others: without it what is no flight takes twice as long
            references = vec![reference];
            let sought = |left: f64| exchanged(&self.model, &self.markers, &flight, &recording, noise, left);
            let mut found = sought(left)?;
            let mut is_settled = found == exchanges;
            if is_settled && left > LEFT {
                left = LEFT;
                found = sought(left)?;
                is_settled = found == exchanges;
            }
            if is_settled && (found.is_empty() || flight.success()) {
                flight.exchanges = intervals(&self.markers, &times, found, GAP);
                return Ok(flight);
            }
            let first = first.get_or_insert(flight);
            // what was exchanged on the way to no success is not known
            if is_settled || round == MAX_REPAIRS {
                if first.status == ReconstructionStatus::Converged {
                    first.status = ReconstructionStatus::Misfit;
                }
                return Ok(first.clone());
            }
            repaired = put_right(&self.markers, &recording, &found)?;
            fits = FrameFits::try_new(&self.model, &self.markers, self.options.scale, &repaired, token)?;
            exchanges = found;
            round += 1;
        }
    }

    /// Intervals between the knots of a flight with frames at `times`; an error where it is longer, or more, than can be held.
    fn n_intervals(&self, times: &[f64]) -> Result<usize, ReconstructionError> {
        let duration = times[times.len() - 1] - times[0];
        expect_range("duration of the flight", duration, "at most 100 s", |x| x <= LONGEST)?;
        let n_intervals = (duration / self.options.knot_spacing).round().max(1.0);
        let n_channels = self.model.n_velocities() - self.model.velocities_of(0).len();
        let found = (n_intervals + 3.0) * n_channels as f64;
        if found > MAX_UNKNOWNS as f64 {
            return Err(ReconstructionError::TooManyUnknowns { found: found as usize, limit: MAX_UNKNOWNS });
        }
        let limit = (MAX_DERIVATIVES / found.max(1.0)) as usize;
        if times.len() > limit {
            return Err(ReconstructionError::TooManyFrames { found: times.len(), limit });
        }
        Ok(n_intervals as usize)
    }

    /// The flight of frames that belong to it, from the next of the references where the search fails from the one before.
    fn flight_of(
        &self,
        fits: &FrameFits,
        recording: &MarkerRecording,
        n_intervals: usize,
        references: &[f64],
        doubtful: bool,
        token: &CancellationToken,
    ) -> Result<Begun, ReconstructionError> {
        let times = recording.times();
        let fit = MarkerFit::try_new(&self.model, self.markers.clone(), crate::fit::FitOptions::default())?;
        let targets = fit.targets(recording)?;
        let (points, weights) = points_and_weights(&targets);
        let mut best: Option<Begun> = None;
        for &reference in references {
            let frame = fits.reference(times, reference);
            let (points, weights) = (points.clone(), weights.clone());
            let observed = Observed { times: times.to_vec(), reference: frame, points, weights };
            let (flight, noise) = self.beginning_at(fits, &observed, n_intervals, doubtful, token)?;
            let is_minimum = !matches!(
                flight.status,
                ReconstructionStatus::IterationLimit | ReconstructionStatus::NoProgress
            );
            let is_ended = flight.status == ReconstructionStatus::NotInFlight;
            let [lower, upper] = flight.chi_squared_range;
            let fits = flight.chi_squared.is_some_and(|x| (lower..=upper).contains(&x));
            // where residuals are those of the noise, no other start is a remedy
            if flight.status == ReconstructionStatus::Converged || is_ended || is_minimum && fits {
                return Ok(Begun { flight, noise, reference });
            }
            let misfit = |flight: &ReconstructedFlight| flight.chi_squared.unwrap_or(flight.noise.size);
            if best.as_ref().is_none_or(|best| misfit(&flight) < misfit(&best.flight)) {
                best = Some(Begun { flight, noise, reference });
            }
        }
        best.ok_or(ReconstructionError::TooFewFrames { least: LEAST_FRAMES, found: 0 })
    }

    /// Take-off and entry by the centres of mass of fits of single frames.
    pub fn find_flight(&self, recording: &MarkerRecording) -> Result<FlightPhase, ReconstructionError> {
        self.find_flight_cancellable(recording, &CancellationToken::new())
    }

    /// As [`find_flight`](Self::find_flight), and ends with [`FitError::Interrupted`](crate::fit::FitError::Interrupted) within a frame of
    /// the cancellation.
    pub fn find_flight_cancellable(
        &self,
        recording: &MarkerRecording,
        token: &CancellationToken,
    ) -> Result<FlightPhase, ReconstructionError> {
        let recording = self.part(recording)?;
        let fits = FrameFits::try_new(&self.model, &self.markers, self.options.scale, &recording, token)?;
        self.phase(&fits, recording.times())?.ok_or(ReconstructionError::NoGravity)
    }

    /// Take-off and entry; none without gravity.
    fn phase(&self, fits: &FrameFits, times: &[f64]) -> Result<Option<FlightPhase>, ReconstructionError> {
        let gravity = self.model.gravity();
        let Some(down) = gravity.try_normalize(f64::MIN_POSITIVE) else { return Ok(None) };
        Ok(Some(find_flight(times, &fits.heights(&-down), gravity.norm())?))
    }

    /// The frames from take-off to entry; all where no flight was found, or too few are in it.
    fn frames_of(&self, phase: Option<&FlightPhase>, times: &[f64]) -> Range<usize> {
        let Some((start, end)) = phase.and_then(FlightPhase::interval) else { return 0..times.len() };
        let frames = times.partition_point(|t| *t < start)..times.partition_point(|t| *t <= end);
        if frames.len() < LEAST_FRAMES { 0..times.len() } else { frames }
    }

    /// The frames of the interval, without those at its ends that have no marker of the model.
    fn part(&self, recording: &MarkerRecording) -> Result<MarkerRecording, ReconstructionError> {
        let between = self.options.interval.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let has_markers = self.markers.markers().iter().any(|marker| recording.marker(&marker.name).is_ok());
        let (range, found) = frames_between(&self.markers, recording, between);
        if found < LEAST_FRAMES && has_markers {
            return Err(ReconstructionError::TooFewFrames { least: LEAST_FRAMES, found });
        }
        // without a marker the fit says which there are
        Ok(recording.part(if has_markers { range } else { 0..recording.n_frames() })?)
    }

    /// The flight that is found from one reference, and the noise that fits of single frames leave.
    fn beginning_at(
        &self,
        fits: &FrameFits,
        observed: &Observed,
        n_intervals: usize,
        doubtful: bool,
        token: &CancellationToken,
    ) -> Result<(ReconstructedFlight, Option<f64>), ReconstructionError> {
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
        let frame_noise = fits.noise(model, markers, &layout.axes, &observed.points, &observed.weights)?;
        let seen = fits.seen(splines.n_channels());
        let estimate = start_of(fits, model, &splines, layout.is_planar, times, observed.reference)?;
        let limits = splines.limits(model);
        let prior = Prior::new(&estimate.coefficients[..splines.n_channels()], &seen, scale, limits);
        let size = options.noise.map(|noise| noise.size).or(frame_noise.map(|noise| noise.size));
        let noise = options.noise.unwrap_or(MarkerNoise::white(size.unwrap_or(UNKNOWN_NOISE)));
        let mut search = Search {
            flown: Flown { model, splines: &splines, layout: &layout },
            markers,
            observed,
            prior,
            noise,
            trust: observed.weights.clone(),
            threshold: options.threshold,
            seen,
            estimate,
            room: Room::new(model, &splines),
            kinematics: Kinematics::new(model),
            token,
            iterations: 0,
        };
        let status = if search.grow(doubtful)? {
            search.settle(options.noise.is_some(), options.max_iterations)?
        } else {
            ReconstructionStatus::NotInFlight
        };
        let noise = search.noise;
        let posterior = search.posterior(&noise)?;
        let flight = self.judge(search, status, posterior, frame_noise)?;
        Ok((flight, frame_noise.map(|noise| noise.size)))
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
        let report = Report { model: &self.model };
        let flown_frames = report.frames(&mut search, &estimate, &covariance, &at)?;
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
        let tested = search.tested()?;
        let is_determined = is_determined
            && tested.is_some()
            && splines.largest_turn(&estimate.coefficients) <= LARGEST_TURN
            && !carry_much(&self.model, &unseen);
        let Tested { departures, push_time, offsets, gravity: seen_gravity } = tested.unwrap_or(Tested {
            departures: [[f64::NAN; 2]; 7],
            push_time: f64::NAN,
            offsets: Vec::new(),
            gravity: [f64::NAN; 2],
        });
        let of_plane = if layout.is_planar {
            depth_departure(layout, search.observed, &at, estimate.scale)
        } else {
            [f64::NAN; 2]
        };
        let departures: [[f64; 2]; 8] =
            std::array::from_fn(|k| departures.get(k).copied().unwrap_or(of_plane));
        let names = self.markers.markers().iter().map(|marker| marker.name.clone());
        let marker_offsets = names.zip(offsets).collect();
        let n_linear = self.model.joint(0).map_or(0, |joint| joint.kind().n_linear);
        let beyond_limits = BeyondLimit::of(&self.model, flown_frames.len(), |i, at, rate| {
            let frame = &flown_frames[i];
            let k = rate - n_linear;
            (frame.time, frame.q[at], standard_deviation(frame.covariance[(k, k)]))
        });
        let departs = beyond_limits.iter().any(BeyondLimit::is_far)
            || departures.iter().any(|[found, limit]| found > limit);
        let within = chi_squared.is_none_or(|x| (chi_squared_range[0]..=chi_squared_range[1]).contains(&x));
        if status == ReconstructionStatus::Converged {
            if !is_determined {
                status = ReconstructionStatus::Undetermined;
            } else if !within || departs {
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
            seen_gravity,
            phase: None,
            height: 0.0,
            turns_deviation: [0.0; 2],
            covariance: DMatrix::zeros(0, 0),
            noise,
            chi_squared,
            chi_squared_range,
            departures: departures.map(|[found, _]| found),
            departure_limits: departures.map(|[_, limit]| limit),
            push_time,
            marker_offsets,
            full_dynamics_defect,
            unseen,
            exchanges: Vec::new(),
            beyond_limits,
            iterations,
        };
        report.summarize(&search, &estimate, &covariance, &at, &mut flight);
        Ok(flight)
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
        let mut prior = DMatrix::zeros(n, n);
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
        // splines may leave nothing where the joints move slowly
        let (given, times) = (self.options.noise, &search.observed.times);
        chi_squared(given, frame_noise, search.noise, times, measured.squares, n_over, FOLLOWED)
    }
}
