//! The **synthetic** judge.

use super::SyntheticError;
use crate::analysis::DiveFaults;
use crate::noise::standard_normal;
use rand::Rng;
use somersault_core::argument::expect_not_negative;

/// A **synthetic** judge. He gives to a dive with faults f
///
/// ```text
/// 10 − Σ_k p_k max(0, f_k − r_k) + σ ε,    ε standard normal,
/// ```
/// within 0 and 10, rounded to half points if he does. r are the faults he takes for none, as those of a
/// reference dive.
///
/// **No judge was asked.** Faults are of the kinds that the rules of diving name, deductions for them are
/// invented.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SyntheticJudge {
    /// r, faults that are too small to count.
    pub reference: DiveFaults,
    /// p of the entry angle, points/rad.
    pub entry_angle: f64,
    /// p of the opening of the hip, points/rad.
    pub hip_opening: f64,
    /// p of the exit, points for the whole duration.
    pub exit_fraction: f64,
    /// p of the asymmetry, points/rad.
    pub asymmetry: f64,
    /// p of the roughness, points for a factor of e in the squared jerk.
    pub roughness: f64,
    /// σ, points.
    pub noise: f64,
    /// Whether he gives half points only, as judges do.
    pub half_points: bool,
}

impl SyntheticJudge {
    /// 5 points/rad of entry angle and of the hip's opening, 25 for the exit, 10 points/rad of asymmetry, 0.3
    /// for roughness; noise of 0.25 points, not rounded.
    pub fn with_reference(reference: DiveFaults) -> Self {
        Self {
            reference,
            entry_angle: 5.0,
            hip_opening: 5.0,
            exit_fraction: 25.0,
            asymmetry: 10.0,
            roughness: 0.3,
            noise: 0.25,
            half_points: false,
        }
    }

    fn deductions(&self) -> [(&'static str, f64); 5] {
        [
            ("entry_angle", self.entry_angle),
            ("hip_opening", self.hip_opening),
            ("exit_fraction", self.exit_fraction),
            ("asymmetry", self.asymmetry),
            ("roughness", self.roughness),
        ]
    }

    /// Fails where a deduction or the noise is negative, or a fault of the reference is not finite.
    pub fn validate(&self) -> Result<(), SyntheticError> {
        for (argument, found) in self.deductions() {
            expect_not_negative(argument, found)?;
        }
        self.reference.validate()?;
        expect_not_negative("noise", self.noise)?;
        Ok(())
    }

    /// The score without noise and rounding; fails where a fault is not finite.
    pub fn intended(&self, faults: &DiveFaults) -> Result<f64, SyntheticError> {
        faults.validate()?;
        let excess = faults.named().into_iter().zip(self.reference.named());
        let excess = excess.map(|((_, f), (_, r))| (f - r).max(0.0));
        let lost: f64 = self.deductions().iter().zip(excess).map(|((_, p), excess)| p * excess).sum();
        Ok((10.0 - lost).clamp(0.0, 10.0))
    }

    /// The score given, with noise from `rng`.
    pub fn score(&self, faults: &DiveFaults, rng: &mut impl Rng) -> Result<f64, SyntheticError> {
        let score = self.intended(faults)? + self.noise * standard_normal(rng);
        let score = if self.half_points { (2.0 * score).round() / 2.0 } else { score };
        Ok(score.clamp(0.0, 10.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use somersault_core::argument::ArgumentError;

    fn faults() -> DiveFaults {
        DiveFaults {
            entry_angle: 0.1,
            hip_opening: 0.4,
            exit_fraction: 0.8,
            asymmetry: 0.02,
            roughness: 12.0,
        }
    }

    #[test]
    fn deductions_are_those_of_the_formula() {
        let judge =
            SyntheticJudge::with_reference(DiveFaults { entry_angle: 0.0, asymmetry: 0.0, ..faults() });
        assert!((judge.intended(&faults()).unwrap() - (10.0 - 0.5 - 0.2)).abs() < 1e-12);
        let better = DiveFaults { hip_opening: 0.1, roughness: 3.0, ..faults() };
        assert_eq!(judge.intended(&better).unwrap(), judge.intended(&faults()).unwrap());
        let worst = DiveFaults { hip_opening: 3.0, ..faults() };
        assert_eq!(judge.intended(&worst).unwrap(), 0.0);
        for (k, (name, _)) in faults().named().into_iter().enumerate() {
            let mut unknown = faults();
            let all = [
                &mut unknown.entry_angle,
                &mut unknown.hip_opening,
                &mut unknown.exit_fraction,
                &mut unknown.asymmetry,
                &mut unknown.roughness,
            ];
            *all.into_iter().nth(k).unwrap() = f64::NAN;
            let found = judge.intended(&unknown).unwrap_err().to_string();
            assert_eq!(found, format!("`{name}` must be finite, found NaN"));
        }
        let negative = SyntheticJudge { noise: -1.0, ..judge };
        assert!(matches!(
            negative.validate(),
            Err(SyntheticError::Argument(ArgumentError::Negative { argument: "noise", .. }))
        ));
    }

    #[test]
    fn the_noise_has_its_deviation_and_halves_are_halves() {
        let judge = SyntheticJudge {
            entry_angle: 20.0,
            ..SyntheticJudge::with_reference(DiveFaults { entry_angle: 0.0, ..faults() })
        };
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let off: Vec<f64> = (0..4000)
            .map(|_| judge.score(&faults(), &mut rng).unwrap() - judge.intended(&faults()).unwrap())
            .collect();
        let mean = off.iter().sum::<f64>() / 4000.0;
        let deviation = (off.iter().map(|x| x * x).sum::<f64>() / 4000.0).sqrt();
        // the mean errs by σ/63, the deviation by σ/89; five of those
        assert!(mean.abs() < 0.02 && (deviation - 0.25).abs() < 0.015, "{mean}, {deviation}");
        let halves = SyntheticJudge { half_points: true, ..judge };
        assert!((0..100).all(|_| (2.0 * halves.score(&faults(), &mut rng).unwrap()).fract() == 0.0));
    }
}
