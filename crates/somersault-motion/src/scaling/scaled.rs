//! What a scaler found.

use crate::fit::MarkerSet;
use crate::reconstruction::BeyondLimit;
use nalgebra::Vector3;
use somersault_multibody::Model;

/// How a model was scaled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScalingStatus {
    /// The last step was small beside the standard deviations.
    Converged,
    /// The iterations allowed were not enough; the estimate is the best of them.
    IterationLimit,
    /// No step makes the squares smaller, though the last was not small; the estimate is the best there was.
    NoProgress,
    /// Coordinates are no more than the unknowns they determine, so that nothing tells the noise.
    Undetermined,
    /// The body, or the names of the markers, are others: what contradicts is in [`ScaledModel::contradictions`].
    Misfit,
}

impl ScalingStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Converged, "converged"),
        (Self::IterationLimit, "iteration_limit"),
        (Self::NoProgress, "no_progress"),
        (Self::Undetermined, "undetermined"),
        (Self::Misfit, "misfit"),
    ];
}

/// The size of a group.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupScale {
    /// Name of the group.
    pub name: String,
    /// Size over that of the model.
    pub scale: f64,
    /// Its standard deviation.
    pub deviation: f64,
    /// Whether the markers say more of its proportion to the whole than was taken for granted: they make its deviation less than 0.9 times as large.
    pub is_seen: bool,
}

/// Where a marker is on its body.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerOffset {
    /// Name of the marker.
    pub name: String,
    /// From where the scaled body has it, in the axes of the body, m.
    pub offset: Vector3<f64>,
    /// Standard deviations.
    pub deviation: Vector3<f64>,
    /// Root mean square of its residuals in fits of single frames to a model of one size, and to the scaled one, m; none for a marker that no frame has.
    pub rms: Option<[f64; 2]>,
}

/// A model of the size of a person, with markers where they are.
#[derive(Debug, Clone)]
pub struct ScaledModel {
    /// How the search ended, and what checks found.
    pub status: ScalingStatus,
    /// The scaled model.
    pub model: Model,
    /// Its markers.
    pub markers: MarkerSet,
    /// Along x, y and z of each body its size over that of the model that was scaled.
    pub scales: Vec<Vector3<f64>>,
    /// Size of the whole over that of the model, and its standard deviation: that of what is in no group.
    pub size: [f64; 2],
    /// The groups.
    pub groups: Vec<GroupScale>,
    /// Of each marker.
    pub offsets: Vec<MarkerOffset>,
    /// Standard deviation of the noise in each coordinate of a marker of weight 1, given or estimated, m.
    pub noise: f64,
    /// How many frames count as one, for their residuals are alike.
    pub repeats: f64,
    /// Root mean square of the residuals of a model of one size, and of the scaled one, m.
    pub rms: [f64; 2],
    /// Times of the frames that were taken, s.
    pub times: Vec<f64>,
    /// Configuration of the scaled model in each of them.
    pub q: Vec<Vec<f64>>,
    /// Points that the robust loss counts less than half.
    pub n_outliers: usize,
    /// Joints that are beyond their limits, which bound the search softly, by more than 0.02 rad or m.
    pub beyond_limits: Vec<BeyondLimit>,
    /// What contradicts that the scaled body is the recorded one.
    pub contradictions: Vec<String>,
    /// Iterations made.
    pub iterations: usize,
}

impl ScaledModel {
    /// Whether the search converged, the noise is known, and nothing contradicts.
    pub fn success(&self) -> bool {
        self.status == ScalingStatus::Converged
    }

    /// How it ended, what the checks found, and of what the markers say nothing.
    pub fn message(&self) -> String {
        let outcome = match self.status {
            ScalingStatus::Converged => {
                let [before, after] = self.rms.map(|rms| 1e3 * rms);
                format!("converged; markers are within {after:.1} mm, of a model of one size {before:.1} mm")
            }
            ScalingStatus::IterationLimit => "the iterations were not enough".to_owned(),
            ScalingStatus::NoProgress => "no step makes the residuals smaller".to_owned(),
            ScalingStatus::Undetermined => {
                "the markers are too few to say what their noise is: give it".to_owned()
            }
            ScalingStatus::Misfit => self.contradictions.join("; "),
        };
        let unseen: Vec<&str> =
            self.groups.iter().filter(|group| !group.is_seen).map(|group| group.name.as_str()).collect();
        let unseen = if unseen.is_empty() {
            String::new()
        } else {
            format!("; markers say next to nothing of the proportions of {}", unseen.join(", "))
        };
        outcome + &unseen + &BeyondLimit::notes(self.n_outliers, &self.beyond_limits)
    }
}
