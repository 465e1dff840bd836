//! Templates: rough courses of a dive to start a search from.

use crate::{Channels, Dive, DiveError, DiveProgram};
use somersault_core::random::SplitMix64;

/// The dive is in a posture at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyFrame {
    /// Fraction of the duration.
    pub fraction: f64,
    /// Number of the posture.
    pub posture: usize,
}

impl KeyFrame {
    /// `count` templates: the given one, then others whose inner key frames are moved by up to 0.4 of the way to
    /// their neighbours. The same for the same seed.
    pub fn variations(template: &[Self], count: usize, seed: u64) -> Vec<Vec<Self>> {
        let mut random = SplitMix64::new(seed);
        let mut moved = |k: usize| {
            let frame = template[k];
            if k == 0 || k + 1 == template.len() {
                return frame;
            }
            let reach = 0.4 * (2.0 * random.unit() - 1.0);
            let neighbour = template[if reach < 0.0 { k - 1 } else { k + 1 }].fraction;
            Self { fraction: frame.fraction + reach.abs() * (neighbour - frame.fraction), ..frame }
        };
        let vary = |n: usize| match n {
            0 => template.to_vec(),
            _ => (0..template.len()).map(&mut moved).collect(),
        };
        (0..count).map(vary).collect()
    }
}

/// Samples of a template to which splines are fitted.
const SAMPLES: usize = 120;

impl DiveProgram {
    /// A start: splines that come nearest to the course from key frame to key frame, and the momentum that turns the
    /// somersaults with them, found by secants; the rest in the middle of its range.
    pub fn start(&self, key_frames: &[KeyFrame]) -> Result<Vec<f64>, DiveError> {
        let dive = self.dive();
        check(dive, key_frames)?;
        let fractions: Vec<f64> = (0..=SAMPLES).map(|k| k as f64 / SAMPLES as f64).collect();
        let samples: Vec<Vec<f64>> =
            fractions.iter().map(|fraction| sample(dive, key_frames, *fraction)).collect();
        // the course as a whole is fitted, then windows cut it
        let whole = dive.motion(self.path().model())?;
        let mut coefficients = vec![0.0; whole.n_coefficients()];
        whole.coefficients_into(&whole.fit(&fractions, &samples)?, &mut coefficients);
        let mut z = self.middle();
        let p = self.path().motion().parameters_of(&coefficients);
        z[..p.len()].copy_from_slice(&p);
        self.clone().aim(&mut z)?;
        Ok(z)
    }
}

fn check(dive: &Dive, key_frames: &[KeyFrame]) -> Result<(), DiveError> {
    let last = key_frames.len().saturating_sub(1);
    for (index, frame) in key_frames.iter().enumerate() {
        let rises = index == 0 || frame.fraction > key_frames[index - 1].fraction;
        let ends = (index > 0 || frame.fraction == 0.0) && (index < last || frame.fraction == 1.0);
        if !(rises && ends) {
            return Err(DiveError::KeyFrames { index, found: frame.fraction });
        }
        if frame.posture >= dive.postures.len() {
            let (n_postures, found) = (dive.postures.len(), frame.posture);
            return Err(DiveError::NoSuchPosture { argument: "key_frames", n_postures, found });
        }
    }
    if key_frames.len() < 2 { Err(DiveError::KeyFrames { index: 0, found: f64::NAN }) } else { Ok(()) }
}

/// Channels between two key frames, at rest in both.
fn sample(dive: &Dive, key_frames: &[KeyFrame], fraction: f64) -> Vec<f64> {
    let at = key_frames.partition_point(|f| f.fraction <= fraction).clamp(1, key_frames.len() - 1);
    let (before, after) = (&key_frames[at - 1], &key_frames[at]);
    let x = (fraction - before.fraction) / (after.fraction - before.fraction);
    let smooth = x * x * (3.0 - 2.0 * x);
    let channels = |posture: usize| match dive.channels {
        Channels::Weights => (1..dive.postures.len()).map(|i| f64::from(u8::from(i == posture))).collect(),
        Channels::Joints => dive.postures[posture].clone(),
    };
    let (a, b): (Vec<f64>, Vec<f64>) = (channels(before.posture), channels(after.posture));
    a.iter().zip(&b).map(|(a, b)| a + (b - a) * smooth).collect()
}
