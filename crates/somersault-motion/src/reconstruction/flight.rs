//! What a reconstruction found.

use super::MarkerNoise;
use crate::fit::rms_of_markers;
use crate::noise::standard_deviation;
use crate::phases::FlightPhase;
use nalgebra::{DMatrix, Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use somersault_multibody::{DynamicsError, Model};

/// How a reconstruction ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReconstructionStatus {
    /// The last step was shorter than a twentieth of a standard deviation.
    Converged,
    /// The iterations allowed were not enough; the estimate is the best of them.
    IterationLimit,
    /// No step makes the squares smaller, though the last was not small; the estimate is the best there was.
    NoProgress,
    /// The Hessian of data and prior has no inverse, or joints that no marker sees carry more than a tenth of the mass: markers determine
    /// too little.
    Undetermined,
    /// Residuals are not those that the noise, or the fits of single frames, allow, departures from the laws of flight or from the body fit
    /// clearly better, joints are far beyond their limits, or markers that are exchanged cannot be put right: the laws do not hold for the
    /// recording with this model, rate, unit and interval.
    Misfit,
    /// The full equations of motion lead elsewhere.
    NotConfirmed,
    /// No stretch of the recording falls with gravity, and the laws of flight lead far from the markers: the search was ended early, and its numbers mean nothing.
    NotInFlight,
}

impl ReconstructionStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Converged, "converged"),
        (Self::IterationLimit, "iteration_limit"),
        (Self::NoProgress, "no_progress"),
        (Self::Undetermined, "undetermined"),
        (Self::Misfit, "misfit"),
        (Self::NotConfirmed, "not_confirmed"),
        (Self::NotInFlight, "not_in_flight"),
    ];
}

/// In what a recording may depart from the laws of flight, and from the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Departure {
    /// Momentum and centre of mass vary over the whole flight, by polynomials of time of degrees 3 and 4.
    Whole,
    /// They do in its first 0.08 s.
    Start,
    /// And in its last 0.08 s.
    End,
    /// A size that was given is another.
    Size,
    /// The air slows the body.
    Air,
    /// Something pushes it for a tenth of its duration: the best of eight such tenths.
    Push,
    /// Markers are elsewhere on their bodies than the model has them, by more than 2 mm.
    Places,
    /// A planar body leaves its plane, by more than a tilt of 3°.
    Plane,
}

impl Departure {
    /// All there are, in the order of [`ReconstructedFlight::departures`], and their names.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::Whole, "whole"),
        (Self::Start, "start"),
        (Self::End, "end"),
        (Self::Size, "size"),
        (Self::Air, "air"),
        (Self::Push, "push"),
        (Self::Places, "places"),
        (Self::Plane, "plane"),
    ];
}

/// Two markers that were exchanged in some frames, and were put right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Exchange {
    /// Their names.
    pub markers: [String; 2],
    /// The first of these frames, s.
    pub start: f64,
    /// The last, s.
    pub end: f64,
    /// How many they are.
    pub n_frames: usize,
}

/// A joint that is beyond a limit that the model states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BeyondLimit {
    /// The body that it carries.
    pub body: String,
    /// How far it is beyond, at most, rad or m.
    pub by: f64,
    /// Its standard deviation there.
    pub deviation: f64,
    /// When, s.
    pub time: f64,
}

/// What splines with knots of 0.07 s leave of the motion of human joints, m; places of markers may be as far off.
pub(super) const FOLLOWED: f64 = 0.002;

/// Three numbers with their standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// The numbers.
    pub value: Vector3<f64>,
    /// Their standard deviations.
    pub deviation: Vector3<f64>,
}

/// One frame of a reconstructed flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightFrame {
    /// s.
    pub time: f64,
    /// Configuration of the model; the place of the root is in m and not scaled.
    pub q: Vec<f64>,
    /// Its velocity: that of the root in m/s, in its axes.
    pub v: Vec<f64>,
    /// Covariance of orientation (three numbers, one in the plane) and joints, along v.
    pub covariance: DMatrix<f64>,
    /// Centre of mass in the world, m.
    pub center_of_mass: Vector3<f64>,
    /// Of the root in the world's axes, rad/s.
    pub angular_velocity: Quantity,
    /// About the centre of mass and the axis of the angular momentum, of the body with its joints locked, kg m².
    pub moment_of_inertia: f64,
    /// Its standard deviation.
    pub moment_of_inertia_deviation: f64,
    /// Inertia about the centre of mass in axes of the world, of the body with its joints locked, kg m².
    pub inertia: Matrix3<f64>,
    /// Angle of the body's long axis from the vertical about the axis of the somersault, forwards positive, whole turns counted, rad:
    /// between −π and π in the first frame.
    pub inclination: f64,
    /// Its standard deviation.
    pub inclination_deviation: f64,
    /// Somersaults since the first frame, forwards positive.
    pub somersaults: f64,
    /// Twists since the first frame, to the left positive.
    pub twists: f64,
    /// Tilt out of the plane of the somersault, rad.
    pub tilt: f64,
    /// Distance of each marker to the recorded one, m; none where it is missing. In the plane of a planar model.
    pub residuals: Vec<Option<f64>>,
}

/// A flight that obeys the laws of flight exactly and comes nearest to a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReconstructedFlight {
    /// How the search ended, and what a check found.
    pub status: ReconstructionStatus,
    /// The frames of the flight.
    pub frames: Vec<FlightFrame>,
    /// Size over that of the model, and its standard deviation, 0 if it was known.
    pub scale: [f64; 2],
    /// About the centre of mass, world axes, kg m²/s.
    pub angular_momentum: Quantity,
    /// Centre of mass in the first frame, m.
    pub center_of_mass: Quantity,
    /// Velocity of the centre of mass in the first frame, m/s.
    pub velocity: Quantity,
    /// g over that of the model, and its standard deviation, 0 if it was not sought.
    pub gravity: [f64; 2],
    /// g over that of the model as the recording has it, and its standard deviation: where it was not sought, one step of the search
    /// from the minimum; the deviation is NaN where it is not known.
    pub seen_gravity: [f64; 2],
    /// Take-off and entry, where they were sought.
    pub phase: Option<FlightPhase>,
    /// How far the centre of mass rises above its place in the first frame, m.
    pub height: f64,
    /// Standard deviation of the somersaults and of the twists of the whole flight.
    pub turns_deviation: [f64; 2],
    /// Covariance of angular momentum, centre of mass and velocity in the first frame, scale and g over the model's: 11 × 11.
    pub covariance: DMatrix<f64>,
    /// The noise, given or estimated.
    pub noise: MarkerNoise,
    /// χ² per degree of freedom: against the noise that was given, or that fits of single frames leave; none where these have no
    /// coordinates beyond their unknowns.
    pub chi_squared: Option<f64>,
    /// Where it must lie.
    pub chi_squared_range: [f64; 2],
    /// χ² per degree of freedom of each [`Departure`]: about 1 where the laws of flight hold and the body is that of the model, more where
    /// something else fits better. NaN where the markers do not determine it, of a size that was sought, of the air without gravity, and of the
    /// plane where the body is not planar or nothing was measured across it.
    pub departures: [f64; 8],
    /// What each must not exceed.
    pub departure_limits: [f64; 8],
    /// When the push begins that fits best, s; it counts where that departure is beyond its limit.
    pub push_time: f64,
    /// For each marker how far it is from where the model has it, one step of the search from the minimum, at scale 1 in axes of its body, m,
    /// normal with a standard deviation of 30 mm before the recording is looked at. None where the Hessian has no inverse.
    pub marker_offsets: Vec<(String, Quantity)>,
    /// Largest angle to the orientations that the full equations of motion lead to, rad.
    pub full_dynamics_defect: f64,
    /// Numbers in v of the joints that no marker sees. They are taken to be near the posture of the start,
    /// ± 0.5 rad, which the deviations of all else contain; what they carry must not weigh a tenth of the body.
    pub unseen: Vec<usize>,
    /// Markers that were exchanged and put right before the last search.
    pub exchanges: Vec<Exchange>,
    /// Joints that are beyond their limits, which bound the search softly, by more than 0.02 rad or m.
    pub beyond_limits: Vec<BeyondLimit>,
    /// Iterations made.
    pub iterations: usize,
}

impl BeyondLimit {
    /// Those of all joints of a motion of `n_frames`, whose time, value and standard deviation `of` tells, of a frame and of the places of
    /// a joint in q and v.
    pub(crate) fn of(
        model: &Model,
        n_frames: usize,
        of: impl Fn(usize, usize, usize) -> (f64, f64, f64),
    ) -> Vec<Self> {
        let of_body = |i: usize| {
            let [lower, upper] = model.limits(i)?;
            let (at, rate) = (model.positions_of(i).start, model.velocities_of(i).start);
            let beyond = |frame: usize| {
                let (time, value, deviation) = of(frame, at, rate);
                let body = model.name(i).unwrap_or_default().to_owned();
                Self { body, by: (value - upper).max(lower - value), deviation, time }
            };
            let farthest = (0..n_frames).map(beyond).max_by(|a, b| a.by.total_cmp(&b.by));
            farthest.filter(|beyond| beyond.by > LISTED)
        };
        (1..model.n_bodies()).filter_map(of_body).collect()
    }

    /// What a message says of it, after what it says before.
    pub(crate) fn note(&self) -> String {
        let Self { body, by, deviation, time } = self;
        format!("; the joint of `{body}` is {by:.2} ± {deviation:.2} beyond its limit at {time:.2} s")
    }

    /// What follows a message: how many points count less, and the joints that are beyond their limits.
    pub(crate) fn notes(n_outliers: usize, limits: &[Self]) -> String {
        let outliers = (n_outliers > 0).then(|| format!("; {n_outliers} points count less as outliers"));
        outliers.into_iter().chain(limits.iter().map(Self::note)).collect()
    }

    /// Whether no limit of a living joint, nor the noise, is so vague.
    pub(crate) fn is_far(&self) -> bool {
        self.by > FAR && self.by > FAR_DEVIATIONS * self.deviation
    }
}

/// Distance from a limit, rad or m, and in standard deviations, at which the body is another.
const FAR: f64 = 0.3;
const FAR_DEVIATIONS: f64 = 4.0;
/// Distance from a limit, rad or m, from which on it is listed.
const LISTED: f64 = 0.02;

/// Angle to the full equations of motion that counts as agreement, rad.
pub(super) const AGREEMENT: f64 = 1e-3;

impl FlightFrame {
    /// Standard deviations of orientation and joints, along v.
    pub fn deviations(&self) -> Vec<f64> {
        self.covariance.diagonal().iter().map(|x| standard_deviation(*x)).collect()
    }

    /// Displacements of the joints after the root's `n_root` degrees of freedom by a standard deviation along each principal axis of their covariance.
    pub(crate) fn joint_displacements(&self, n_root: usize) -> Vec<Vec<f64>> {
        let n = self.v.len() - n_root;
        let first = self.covariance.nrows() - n;
        along_axes(self.covariance.view((first, first), (n, n)).into_owned())
    }

    /// The standard deviation of what is a function of the configuration: of its changes with displacements to either side the larger ones. NaN where the
    /// covariance is not finite.
    pub(crate) fn deviation_of(
        &self,
        model: &Model,
        mut of: impl FnMut(&[f64]) -> Result<f64, DynamicsError>,
    ) -> Result<f64, DynamicsError> {
        if !self.covariance.iter().all(|x| x.is_finite()) {
            return Ok(f64::NAN);
        }
        let (value, mut moved) = (of(&self.q)?, self.q.clone());
        let n_linear = self.v.len() - self.covariance.nrows();
        let mut variance = 0.0;
        for along in along_axes(self.covariance.clone()) {
            let mut step = [vec![0.0; n_linear], along].concat();
            let mut largest = 0.0_f64;
            for _ in 0..2 {
                model.displace(&self.q, &step, &mut moved)?;
                largest = largest.max((of(&moved)? - value).abs());
                step.iter_mut().for_each(|x| *x = -*x);
            }
            variance += largest * largest;
        }
        Ok(variance.sqrt())
    }
}

/// A vector of the length of one standard deviation along each principal axis of a covariance; one of NaN where this is not finite.
fn along_axes(covariance: DMatrix<f64>) -> Vec<Vec<f64>> {
    if !covariance.iter().all(|x| x.is_finite()) {
        return vec![vec![f64::NAN; covariance.nrows()]];
    }
    let parts = covariance.symmetric_eigen();
    let axes = parts.eigenvalues.iter().zip(parts.eigenvectors.column_iter());
    axes.map(|(value, axis)| axis.iter().map(|x| x * standard_deviation(*value)).collect()).collect()
}

impl ReconstructedFlight {
    /// Whether the search converged, the covariance is finite, χ² per degree of freedom is known and within its range, departures are
    /// within their limits, and the full equations of motion confirm the flight.
    pub fn success(&self) -> bool {
        self.status == ReconstructionStatus::Converged && self.chi_squared.is_some()
    }

    /// How it ended and what the checks found, with what may be done.
    pub fn message(&self) -> String {
        let exchanges = self.exchanges.iter().map(|Exchange { markers: [a, b], start, end, n_frames }| {
            format!("; `{a}` and `{b}` were exchanged in {n_frames} frames from {start:.2} to {end:.2} s and put right")
        });
        // what was not fitted to the end has no limits
        let limits = self.beyond_limits.iter().filter(|_| self.status != ReconstructionStatus::NotInFlight);
        let limits = limits.map(BeyondLimit::note);
        let notes: String = exchanges.chain(limits).collect();
        self.outcome() + &notes
    }

    /// How it ended and what the checks found.
    fn outcome(&self) -> String {
        let [lower, upper] = self.chi_squared_range;
        match (self.status, self.chi_squared) {
            (ReconstructionStatus::Converged, Some(x)) => {
                format!(
                    "converged; χ² per degree of freedom is {x:.2}, and the full equations of motion agree"
                )
            }
            (ReconstructionStatus::Converged, None) => {
                "converged, but the markers are too few to say whether the laws of flight hold".to_owned()
            }
            (ReconstructionStatus::IterationLimit, _) => "the iterations were not enough".to_owned(),
            (ReconstructionStatus::NoProgress, _) => "no step makes the residuals smaller".to_owned(),
            (ReconstructionStatus::Undetermined, _) => "the markers do not determine the flight".to_owned(),
            (ReconstructionStatus::Misfit, found) => {
                let beyond = found.filter(|x| !(lower..=upper).contains(x)).map(|x| {
                    format!(
                        "χ² per degree of freedom is {x:.2}, but must be from {lower:.2} to {upper:.2}: the interval is not all flight, the rate or the unit is wrong, markers are exchanged, or the body is another"
                    )
                });
                let departing =
                    Departure::ALL.iter().map(|(kind, _)| *kind).filter(|kind| self.departs(*kind));
                let mut reasons: Vec<String> =
                    beyond.into_iter().chain(departing.map(|kind| self.reason(kind))).collect();
                if reasons.is_empty() {
                    reasons.push("joints are far beyond their limits, or markers are exchanged and could not be put right: the body or the names of the markers are others".to_owned());
                }
                reasons.join("; ")
            }
            (ReconstructionStatus::NotInFlight, _) => {
                "no stretch of the recording falls with gravity, and the laws of flight lead far from the markers: the body is on the ground, or noise, rate or unit are other than they seem".to_owned()
            }
            (ReconstructionStatus::NotConfirmed, _) => format!(
                "the full equations of motion lead to orientations that are up to {:.1e} rad away",
                self.full_dynamics_defect
            ),
        }
    }

    /// Whether a departure is beyond its limit.
    pub fn departs(&self, kind: Departure) -> bool {
        self.departures[kind as usize] > self.departure_limits[kind as usize]
    }

    /// What a departure says, and what may be done.
    fn reason(&self, kind: Departure) -> String {
        let (found, limit) = (self.departures[kind as usize], self.departure_limits[kind as usize]);
        let (what, why) = match kind {
            Departure::Whole => (
                "from the laws of flight over the whole flight",
                "the rate or the unit is wrong, something pushes the body, or its mass is distributed otherwise"
                    .to_owned(),
            ),
            Departure::Start => {
                ("from the laws of flight at the start", "its first frames are no flight".to_owned())
            }
            Departure::End => {
                ("from the laws of flight at the end", "its last frames are no flight".to_owned())
            }
            Departure::Size => {
                ("from the size", "the body is larger or smaller than `scale` says".to_owned())
            }
            Departure::Air => {
                ("by a drag", "the air slows the body, or the rate or the unit is wrong".to_owned())
            }
            Departure::Push => {
                ("by a push", format!("something pushes the body from about {:.2} s on", self.push_time))
            }
            Departure::Places => {
                let size = |offset: &Quantity| offset.value.norm();
                let farthest = self.marker_offsets.iter().max_by(|a, b| size(&a.1).total_cmp(&size(&b.1)));
                let farthest = farthest.map_or_else(String::new, |(name, offset)| {
                    let [x, y, z] = <[f64; 3]>::from(offset.value).map(|x| 1e3 * x);
                    format!(", `{name}` by ({x:.0}, {y:.0}, {z:.0}) mm in axes of its body")
                });
                (
                    "from the places of the markers",
                    format!("they are elsewhere on their bodies than the model has them{farthest}"),
                )
            }
            Departure::Plane => (
                "from the plane of the body",
                "markers leave it together, and a body that moves in space is needed".to_owned(),
            ),
        };
        format!(
            "χ² per degree of freedom of departures {what} is {found:.1}, but must be at most {limit:.1}: {why}"
        )
    }

    /// Somersaults from the first to the last frame.
    pub fn somersaults(&self) -> f64 {
        self.frames.last().map_or(0.0, |frame| frame.somersaults)
    }

    /// Twists from the first to the last frame.
    pub fn twists(&self) -> f64 {
        self.frames.last().map_or(0.0, |frame| frame.twists)
    }

    /// Root mean square of the residuals of each marker over the frames that have it, m.
    pub fn rms_of_markers(&self) -> Vec<Option<f64>> {
        rms_of_markers(self.frames.iter().map(|frame| frame.residuals.as_slice()))
    }
}
