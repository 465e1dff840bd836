//! What a dive is marked down for, as numbers.
//!
//! | Fault | Is |
//! |---|---|
//! | entry angle | of the line from the feet's centre of mass to the hands' against the vertical in the last frame, rad, 0 to π/2 |
//! | hip opening | least angle between trunk and thigh, rad: what a tight pike makes small |
//! | exit fraction | fraction of the duration after which the hip stays more than half open |
//! | asymmetry | root mean square of left against right joint angles, rad; 0 in the plane |
//! | roughness | log dimensionless jerk of the hip's angle θ, ln(T³ ∫ v″² dt / max v²) with v = θ′ |
//!
//! The hip's angle is that between the directions from thigh to head and from thigh to shank, at the origins of
//! these bodies; it is half open in the middle between its least value and π. Derivatives are central
//! differences of equal frames.
//!
//! Source of the last: S. Balasubramanian, A. Melendez-Calderon, A. Roby-Brami and E. Burdet, *On the analysis
//! of movement smoothness*, J. NeuroEng. Rehabil. 12 (2015), 112.

use super::landmarks::Landmarks;
use super::{AnalysisError, normalize_frames};
use somersault_core::argument::{expect_least, expect_length};
use somersault_multibody::{Data, Model};
use std::f64::consts::PI;

/// The faults of a dive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiveFaults {
    /// Angle of the long axis to the vertical at the entry, rad.
    pub entry_angle: f64,
    /// Least angle between trunk and thigh, rad.
    pub hip_opening: f64,
    /// Fraction of the duration after which the hip stays more than half open.
    pub exit_fraction: f64,
    /// Root mean square difference between left and right joints, rad.
    pub asymmetry: f64,
    /// Log dimensionless jerk of the hip.
    pub roughness: f64,
}

/// Frames that third differences need, and one more.
const LEAST_FRAMES: usize = 5;

impl DiveFaults {
    /// Each by its name, in the order of the table.
    pub fn named(&self) -> [(&'static str, f64); 5] {
        [
            ("entry_angle", self.entry_angle),
            ("hip_opening", self.hip_opening),
            ("exit_fraction", self.exit_fraction),
            ("asymmetry", self.asymmetry),
            ("roughness", self.roughness),
        ]
    }

    /// Fails where a fault is NaN or infinite.
    pub fn validate(&self) -> Result<(), AnalysisError> {
        match self.named().into_iter().find(|(_, found)| !found.is_finite()) {
            Some((fault, found)) => Err(AnalysisError::Fault { fault, found }),
            None => Ok(()),
        }
    }

    /// Of a motion of a diver, planar or spatial: a model whose bodies have the names of
    /// [`Diver`](somersault_multibody::models::Diver). `positions` has a configuration for each time, one after
    /// the other.
    pub fn of(model: &Model, times: &[f64], positions: &[f64]) -> Result<Self, AnalysisError> {
        expect_least("times", times.len(), LEAST_FRAMES)?;
        let n_q = model.n_positions();
        expect_length("positions", positions.len(), times.len().saturating_mul(n_q))?;
        if let Some(k) = positions.iter().position(|x| !x.is_finite()) {
            return Err(AnalysisError::NonFinite { argument: "positions", row: k / n_q });
        }
        let landmarks = Landmarks::of(model)?;
        let mut data = Data::new(model);
        let mut hip = Vec::with_capacity(times.len());
        for q in positions.chunks_exact(n_q) {
            hip.push(landmarks.hip_angle(model, &mut data, q)?);
        }
        let last = &positions[positions.len() - n_q..];
        let axis = landmarks.long_axis(model, &mut data, last)?;
        let entry_angle = axis.xy().norm().atan2(axis.z.abs());
        let even = normalize_frames(times, &hip, times.len())?;
        let duration = times[times.len() - 1] - times[0];
        Ok(Self {
            entry_angle,
            hip_opening: hip.iter().copied().fold(f64::INFINITY, f64::min),
            exit_fraction: exit_fraction(times, &hip),
            asymmetry: asymmetry(model, positions),
            roughness: log_dimensionless_jerk(&even, duration).ok_or(AnalysisError::NoVariance)?,
        })
    }
}

/// The fraction at which the angle last rises through the middle between its least value and π; 1 where it does
/// not.
fn exit_fraction(times: &[f64], hip: &[f64]) -> f64 {
    let half = 0.5 * (hip.iter().copied().fold(f64::INFINITY, f64::min) + PI);
    let Some(i) = hip.iter().rposition(|angle| *angle < half).filter(|i| i + 1 < hip.len()) else {
        return 1.0;
    };
    let part = (half - hip[i]) / (hip[i + 1] - hip[i]);
    let (first, last) = (times[0], times[times.len() - 1]);
    (times[i] + part * (times[i + 1] - times[i]) - first) / (last - first)
}

fn asymmetry(model: &Model, positions: &[f64]) -> f64 {
    let single = |body: usize| Some(model.positions_of(body)).filter(|at| at.len() == 1).map(|at| at.start);
    let mirrored = |name: &str| {
        let right = single(model.body(name).ok()?)?;
        let left = single(model.body(&format!("left_{}", name.strip_prefix("right_")?)).ok()?)?;
        Some((right, left))
    };
    let pairs: Vec<(usize, usize)> = model.links().iter().filter_map(|link| mirrored(link.name())).collect();
    let frames = positions.chunks_exact(model.n_positions());
    let n = (pairs.len() * frames.len()).max(1);
    let squares = frames.flat_map(|q| pairs.iter().map(move |&(right, left)| (q[right] - q[left]).powi(2)));
    (squares.fold(0.0, |sum, x| sum + x) / n as f64).sqrt()
}

/// None of an angle that does not change.
fn log_dimensionless_jerk(angle: &[f64], duration: f64) -> Option<f64> {
    let h = duration / (angle.len() - 1) as f64;
    let rate = |w: &[f64]| (w[2] - w[0]) / (2.0 * h);
    let jerk = |w: &[f64]| (w[4] - 2.0 * w[3] + 2.0 * w[1] - w[0]) / (2.0 * h * h * h);
    let greatest = angle.windows(3).map(|w| rate(w).abs()).fold(0.0, f64::max);
    let squared: f64 = angle.windows(LEAST_FRAMES).map(|w| jerk(w).powi(2) * h).sum();
    (greatest > 0.0).then(|| (duration.powi(3) * squared / (greatest * greatest)).ln())
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_core::argument::ArgumentError;
    use somersault_multibody::DynamicsError;
    use somersault_multibody::models::{Diver, Posture};

    /// Frames from posture A to `posture` and back, w = sin² of π times the fraction.
    fn folded(diver: &Diver, posture: Posture, n: usize) -> (Vec<f64>, Vec<f64>) {
        let [a, b] = [Posture::A, posture].map(|p| diver.configuration(p).unwrap());
        let share = |i: usize| i as f64 / (n - 1) as f64;
        let frame = |i: usize| {
            let w = (PI * share(i)).sin().powi(2);
            a.iter().zip(&b).map(move |(a, b)| a + w * (b - a)).collect::<Vec<_>>()
        };
        ((0..n).map(|i| 1.5 * share(i)).collect(), (0..n).flat_map(frame).collect())
    }

    #[test]
    fn a_straight_fold_has_the_faults_of_its_angles() {
        for diver in [Diver::planar(), Diver::spatial()] {
            let model = diver.model().unwrap();
            let (times, mut positions) = folded(&diver, Posture::H, 61);
            let faults = DiveFaults::of(&model, &times, &positions).unwrap();
            assert!(faults.entry_angle < 0.1, "arms are not quite overhead: {faults:?}");
            assert!(faults.hip_opening < 0.6 && faults.asymmetry == 0.0, "{faults:?}");
            assert!((0.7..0.8).contains(&faults.exit_fraction), "{faults:?}");

            // the whole body turned by 0.3 in the last frame
            let before = faults.entry_angle;
            let last = positions.len() - model.n_positions();
            match positions[last..].len() {
                12 => positions[last + 2] += 0.3,
                _ => positions[last + 3..last + 7].copy_from_slice(&[
                    0.0,
                    -(0.15_f64).sin(),
                    0.0,
                    0.15_f64.cos(),
                ]),
            }
            let turned = DiveFaults::of(&model, &times, &positions).unwrap().entry_angle;
            assert!(((turned - before).abs() - 0.3).abs() < 1e-12 || (turned + before - 0.3).abs() < 1e-12);
        }
    }

    #[test]
    fn asymmetry_is_the_difference_of_the_sides() {
        let diver = Diver::spatial();
        let model = diver.model().unwrap();
        let (times, mut positions) = folded(&diver, Posture::H, 11);
        let knee = model.positions_of(model.body("left_shank").unwrap()).start;
        for q in positions.chunks_exact_mut(model.n_positions()) {
            q[knee] += 0.2;
        }
        // one of ten pairs differs, by 0.2
        let found = DiveFaults::of(&model, &times, &positions).unwrap().asymmetry;
        let n_pairs = model.links().iter().filter(|l| l.name().starts_with("right_")).count() as f64;
        assert!((found - 0.2 / n_pairs.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn the_jerk_of_a_sine_is_in_closed_form() {
        // θ = sin(2π k t/T): v″ has the amplitude (2πk/T)³, v that of 2πk/T
        for k in [1.0, 3.0] {
            let angle: Vec<f64> = (0..=4000).map(|i| (2.0 * PI * k * f64::from(i) / 4000.0).sin()).collect();
            let expected = ((2.0 * PI * k).powi(4) / 2.0).ln();
            assert!((log_dimensionless_jerk(&angle, 1.7).unwrap() - expected).abs() < 2e-3, "{k} periods");
        }
    }

    #[test]
    fn what_is_no_dive_is_refused() {
        let diver = Diver::planar();
        let model = diver.model().unwrap();
        let (times, positions) = folded(&diver, Posture::H, 11);
        let found = DiveFaults::of(&model, &times[..4], &positions);
        assert_eq!(
            found,
            Err(AnalysisError::Argument(ArgumentError::TooFew { argument: "times", least: 5, found: 4 }))
        );
        let found = DiveFaults::of(&model, &times[..10], &positions);
        assert_eq!(
            found,
            Err(AnalysisError::Argument(ArgumentError::Length {
                argument: "positions",
                expected: 120,
                found: 132
            }))
        );
        let still = diver.configuration(Posture::A).unwrap().repeat(11);
        assert_eq!(DiveFaults::of(&model, &times, &still), Err(AnalysisError::NoVariance));
        let arm = somersault_multibody::models::TwoLinkArm::default().model().unwrap();
        let found = DiveFaults::of(&arm, &times, &vec![0.0; times.len() * arm.n_positions()]);
        assert!(matches!(found, Err(AnalysisError::Model(DynamicsError::UnknownBody { .. }))));
    }
}
