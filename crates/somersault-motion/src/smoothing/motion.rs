//! What a smoother found.

use super::MarkerNoise;
use crate::reconstruction::BeyondLimit;
use serde::{Deserialize, Serialize};

/// How a motion was smoothed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SmoothingStatus {
    /// The last step was small beside the standard deviations.
    Converged,
    /// The iterations allowed were not enough; the estimate is the best of them.
    IterationLimit,
    /// No step makes the squares smaller, though the last was not small; the estimate is the best there was.
    NoProgress,
    /// The Hessian of data and prior has no inverse, or joints that no marker sees carry more than a tenth of the mass: markers determine
    /// too little.
    Undetermined,
    /// Residuals are not those that the noise, or the fits of single frames, allow, over all frames or over a fifth of a second, or joints are
    /// far beyond their limits: the motion is not smooth where a body strikes another, or the body is another.
    Misfit,
}

impl SmoothingStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Converged, "converged"),
        (Self::IterationLimit, "iteration_limit"),
        (Self::NoProgress, "no_progress"),
        (Self::Undetermined, "undetermined"),
        (Self::Misfit, "misfit"),
    ];
}

/// Standard deviations along v; infinite where no marker sees.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviations {
    /// Of the configuration.
    pub positions: Vec<f64>,
    /// Of the velocity.
    pub velocities: Vec<f64>,
    /// Of the acceleration.
    pub accelerations: Vec<f64>,
}

/// One frame of a smoothed motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SmoothedFrame {
    /// s.
    pub time: f64,
    /// Configuration of the model; the place of the root is in m and not scaled.
    pub q: Vec<f64>,
    /// Its velocity: that of the root in m/s, in its axes.
    pub v: Vec<f64>,
    /// Its acceleration, v̇.
    pub a: Vec<f64>,
    /// Standard deviations of the three.
    pub deviations: Deviations,
    /// Distance of each marker to the recorded one, m; none where it is missing. In the plane of a planar model.
    pub residuals: Vec<Option<f64>>,
}

/// A smooth motion nearest to a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SmoothedMotion {
    /// How the search ended, and what a check found.
    pub status: SmoothingStatus,
    /// The frames.
    pub frames: Vec<SmoothedFrame>,
    /// Size over that of the model, and its standard deviation, 0 if it was known.
    pub scale: [f64; 2],
    /// The noise, given or estimated.
    pub noise: MarkerNoise,
    /// χ² per degree of freedom: against the noise that was given, or that fits of single frames leave; none where these have no
    /// coordinates beyond their unknowns.
    pub chi_squared: Option<f64>,
    /// Where it must lie.
    pub chi_squared_range: [f64; 2],
    /// χ² per degree of freedom of the fifth of a second where it is largest against its limit; none as above.
    pub worst: Option<f64>,
    /// The limit there.
    pub worst_limit: f64,
    /// Where that fifth of a second begins, s.
    pub worst_time: f64,
    /// The largest smoothed disturbance of a number in a step between frames over its standard deviation: where it is beyond its limit, velocities
    /// jump as no smooth motion's do.
    pub disturbance: f64,
    /// What it must not exceed.
    pub disturbance_limit: f64,
    /// The frame from which that step is, s.
    pub disturbance_time: f64,
    /// Points that the robust loss counts less than half, which χ² leaves out: a twentieth of all at most.
    pub n_outliers: usize,
    /// Numbers in v of what no marker sees, which rests in the posture of the start.
    pub unseen: Vec<usize>,
    /// Joints that are beyond their limits, which bound the search softly, by more than 0.02 rad or m.
    pub beyond_limits: Vec<BeyondLimit>,
    /// Iterations made.
    pub iterations: usize,
}

impl SmoothedMotion {
    /// Whether the search converged, all variances are finite but those of what no marker sees, χ² is known and within its range over all
    /// frames and everywhere, and no joint is far beyond its limits.
    pub fn success(&self) -> bool {
        self.status == SmoothingStatus::Converged && self.chi_squared.is_some()
    }

    /// How it ended and what the checks found, with what may be done.
    pub fn message(&self) -> String {
        self.outcome() + &BeyondLimit::notes(self.n_outliers, &self.beyond_limits)
    }

    fn outcome(&self) -> String {
        let [lower, upper] = self.chi_squared_range;
        match (self.status, self.chi_squared) {
            (SmoothingStatus::Converged, Some(x)) => {
                format!("converged; χ² per degree of freedom is {x:.2}")
            }
            (SmoothingStatus::Converged, None) => {
                "converged, but the markers are too few to say what their noise is".to_owned()
            }
            (SmoothingStatus::IterationLimit, _) => "the iterations were not enough".to_owned(),
            (SmoothingStatus::NoProgress, _) => "no step makes the residuals smaller".to_owned(),
            (SmoothingStatus::Undetermined, _) => "the markers do not determine the motion".to_owned(),
            (SmoothingStatus::Misfit, found) => {
                let whole = found.filter(|x| !(lower..=upper).contains(x)).map(|x| {
                    format!(
                        "χ² per degree of freedom is {x:.2}, but must be from {lower:.2} to {upper:.2}: markers are exchanged, the motion is not smooth, or the body is another"
                    )
                });
                let part = self.worst.filter(|x| *x > self.worst_limit).map(|x| {
                    format!(
                        "χ² per degree of freedom is {x:.2} from {:.2} s on, but must be at most {:.2} there: something strikes the body, or markers are exchanged",
                        self.worst_time, self.worst_limit
                    )
                });
                let jump = (self.disturbance > self.disturbance_limit).then(|| {
                    format!(
                        "velocities jump by {:.1} standard deviations at {:.2} s, but may by {:.0}: something strikes the body, or markers are exchanged",
                        self.disturbance, self.disturbance_time, self.disturbance_limit
                    )
                });
                let reasons: Vec<String> = whole.into_iter().chain(part).chain(jump).collect();
                if reasons.is_empty() && self.beyond_limits.iter().all(|beyond| !beyond.is_far()) {
                    format!(
                        "{} points are far from where the motion has them: markers are exchanged, or the body is another",
                        self.n_outliers
                    )
                } else if reasons.is_empty() {
                    "joints are far beyond their limits: the body or the names of the markers are others"
                        .to_owned()
                } else {
                    reasons.join("; ")
                }
            }
        }
    }

    /// Root mean square of the residuals of each marker over the frames that have it, m.
    pub fn rms_of_markers(&self) -> Vec<Option<f64>> {
        crate::fit::rms_of_markers(self.frames.iter().map(|frame| frame.residuals.as_slice()))
    }
}
