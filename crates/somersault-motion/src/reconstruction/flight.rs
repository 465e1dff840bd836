//! What a reconstruction found.

use super::MarkerNoise;
use crate::phases::FlightPhase;
use nalgebra::{DMatrix, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

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
    /// Residuals are not those that the noise, or the fits of single frames, allow, or departures from the laws of flight fit clearly
    /// better: the laws do not hold for the recording with this model, rate, unit and interval.
    Misfit,
    /// The full equations of motion lead elsewhere.
    NotConfirmed,
}

impl ReconstructionStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::Converged, "converged"),
        (Self::IterationLimit, "iteration_limit"),
        (Self::NoProgress, "no_progress"),
        (Self::Undetermined, "undetermined"),
        (Self::Misfit, "misfit"),
        (Self::NotConfirmed, "not_confirmed"),
    ];
}

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
    /// Standard deviations of orientation (three numbers, one in the plane) and joints, along v.
    pub deviations: Vec<f64>,
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
    /// χ² per degree of freedom of departures from the laws of flight over the whole flight, in its first 0.08 s and in its last: about 1
    /// where these hold, more where an angular momentum that varies, or a centre of mass that leaves its parabola, fits better: over the whole
    /// by polynomials of time of degrees 3 and 4. The last number is that of the size, where it was given. NaN where the markers do not
    /// determine them, and for a size that was sought.
    pub departures: [f64; 4],
    /// What each must not exceed.
    pub departure_limits: [f64; 4],
    /// Largest angle to the orientations that the full equations of motion lead to, rad.
    pub full_dynamics_defect: f64,
    /// Numbers in v of the joints that no marker sees. They are taken to be near the posture of the start,
    /// ± 0.5 rad, which the deviations of all else contain; what they carry must not weigh a tenth of the body.
    pub unseen: Vec<usize>,
    /// Iterations made.
    pub iterations: usize,
}

/// Angle to the full equations of motion that counts as agreement, rad.
pub(super) const AGREEMENT: f64 = 1e-3;

impl ReconstructedFlight {
    /// Whether the search converged, the covariance is finite, χ² per degree of freedom is known and within its range, departures are
    /// within their limits, and the full equations of motion confirm the flight.
    pub fn success(&self) -> bool {
        self.status == ReconstructionStatus::Converged && self.chi_squared.is_some()
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
        let n = self.frames.first().map_or(0, |frame| frame.residuals.len());
        let of = |k: usize| {
            let found: Vec<f64> = self.frames.iter().filter_map(|frame| frame.residuals[k]).collect();
            let squares: f64 = found.iter().map(|r| r * r).sum();
            (!found.is_empty()).then(|| (squares / found.len() as f64).sqrt())
        };
        (0..n).map(of).collect()
    }
}
