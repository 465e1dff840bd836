//! The position of the body, from hip and knee.

use super::count::below;
use crate::analysis::Landmarks;
use crate::reconstruction::ReconstructedFlight;
use serde::{Deserialize, Serialize};
use somersault_multibody::{Data, DynamicsError, Model};
use std::f64::consts::TAU;

/// The position of a dive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Position {
    /// A.
    Straight,
    /// B: hips closed, knees straight.
    Pike,
    /// C: hips and knees closed.
    Tuck,
    /// D: any, with twists.
    Free,
}

impl Position {
    /// All there are, and their names, in the order of their letters.
    pub const ALL: [(Self, &'static str); 4] =
        [(Self::Straight, "straight"), (Self::Pike, "pike"), (Self::Tuck, "tuck"), (Self::Free, "free")];

    /// A, B, C or D.
    pub fn letter(self) -> char {
        match self {
            Self::Straight => 'A',
            Self::Pike => 'B',
            Self::Tuck => 'C',
            Self::Free => 'D',
        }
    }
}

/// Angles of the hip between straight and folded, and of the knee between pike and tuck, and how sharp these are, rad.
pub(crate) const HIP: f64 = 2.27;
const KNEE: f64 = 2.18;
const SHARP: f64 = 0.15;
/// How far the hip may be open beyond its least angle where the knee is looked at, rad.
const CLOSED: f64 = 0.35;
/// Standard deviations beyond the least angle of the hip within which it is closed as much.
const NEAR: f64 = 3.0;
/// Somersaults that are turned both straight and folded in a free position, and how sharp that is; those at either end, where every
/// dive is straight, do not count.
const TURNED: (f64, f64) = (0.4, 0.1);
const ENDS: f64 = 0.25;
/// Twist for each turn of the somersault from which on the body twists.
const TWISTING: f64 = 0.25;
/// Somersaults that a flying dive turns before it is folded, and how sharp that is.
const FLYING: (f64, f64) = (0.46, 0.03);

/// Angles of a flight.
pub(crate) struct Angles {
    pub(crate) hip: Vec<f64>,
    pub(crate) knee: Vec<f64>,
    /// Of both in the frame in which the hip is closed most.
    pub(crate) deviations: [f64; 2],
}

impl Angles {
    pub(crate) fn of(
        model: &Model,
        landmarks: &Landmarks,
        flight: &ReconstructedFlight,
    ) -> Result<Self, DynamicsError> {
        let mut data = Data::new(model);
        let (mut hip, mut knee) = (Vec::new(), Vec::new());
        for frame in &flight.frames {
            hip.push(landmarks.hip_angle(model, &mut data, &frame.q)?);
            knee.push(landmarks.knee_angle(model, &mut data, &frame.q)?);
        }
        let mut found = Self { hip, knee, deviations: [f64::NAN; 2] };
        if let Some(frame) = flight.frames.get(found.closest()) {
            found.deviations = [
                frame.deviation_of(model, |q| landmarks.hip_angle(model, &mut data, q))?,
                frame.deviation_of(model, |q| landmarks.knee_angle(model, &mut data, q))?,
            ];
        }
        Ok(found)
    }

    /// The frame in which the hip is closed most.
    pub(crate) fn closest(&self) -> usize {
        (0..self.hip.len()).min_by(|i, j| self.hip[*i].total_cmp(&self.hip[*j])).unwrap_or(0)
    }

    /// The angle of the hip where it is closed most, and the mean of the knee's where the hip is nearly as closed, rad. The hip's is the mean over frames
    /// that are as closed within three standard deviations: the least of many angles with errors is too small.
    pub(crate) fn least(&self) -> [f64; 2] {
        let least = self.hip[self.closest()];
        let mean = |angles: &[f64], beyond: f64| {
            let near = self.hip.iter().zip(angles).filter(|(hip, _)| **hip <= least + beyond);
            let (sum, n) = near.fold((0.0, 0.0), |(sum, n), (_, angle)| (sum + angle, n + 1.0));
            sum / n
        };
        let [of_hip, _] = self.deviations;
        let hip = if of_hip.is_finite() { mean(&self.hip, NEAR * of_hip) } else { least };
        [hip, mean(&self.knee, CLOSED)]
    }

    fn is_folded(&self, i: usize) -> bool {
        self.hip[i] < HIP
    }

    /// The positions with their probabilities.
    pub(super) fn positions(&self, flight: &ReconstructedFlight, is_twisting: bool) -> Vec<(Position, f64)> {
        let [hip, knee] = self.least();
        let [of_hip, of_knee] = self.deviations.map(|deviation| SHARP.hypot(deviation));
        let straight = below((hip - HIP) / of_hip);
        let pike = below((knee - KNEE) / of_knee);
        let free = if is_twisting {
            let [open, folded] = self.turned(flight);
            let is_turned = |turns: f64| below((turns - TURNED.0) / TURNED.1);
            is_turned(open) * is_turned(folded)
        } else {
            0.0
        };
        let mut all = vec![
            (Position::Straight, (1.0 - free) * straight),
            (Position::Pike, (1.0 - free) * (1.0 - straight) * pike),
            (Position::Tuck, (1.0 - free) * (1.0 - straight) * (1.0 - pike)),
            (Position::Free, free),
        ];
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all
    }

    /// Somersaults turned straight without twist, and folded.
    fn turned(&self, flight: &ReconstructedFlight) -> [f64; 2] {
        let frames = &flight.frames;
        let whole = frames.last().map_or(0.0, |frame| frame.somersaults.abs());
        let mut found = [0.0; 2];
        for (i, pair) in frames.windows(2).enumerate() {
            let turned = (pair[1].somersaults - pair[0].somersaults).abs();
            let twisted = (pair[1].twists - pair[0].twists).abs();
            let passed = pair[0].somersaults.abs();
            if self.is_folded(i) {
                found[1] += turned;
            } else if twisted < TWISTING * turned && passed > ENDS && passed < whole - ENDS {
                found[0] += turned;
            }
        }
        found
    }

    /// The probability that the body is straight for the first half somersault, and folded later.
    pub(super) fn flying(&self, flight: &ReconstructedFlight) -> f64 {
        let Some(first) = (0..self.hip.len()).find(|i| self.is_folded(*i)) else { return 0.0 };
        let frames = &flight.frames;
        let turned = (frames[first].inclination / TAU).abs();
        below((turned - FLYING.0) / FLYING.1)
    }
}
