//! A **synthetic** set of judged dives.

use super::{Perturbation, SyntheticDive, SyntheticError, SyntheticFlight, SyntheticJudge};
use crate::analysis::DiveFaults;
use crate::fit::MarkerSet;
use crate::judged::{JudgedList, JudgedMotion, JudgedSet};
use crate::recording::MarkerRecording;
use crate::scoring::Performance;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use somersault_core::argument::{expect_least, expect_not_negative};
use somersault_core::cancel::CancellationToken;
use std::f64::consts::TAU;

/// How a set is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SyntheticOptions {
    /// Number of dives.
    pub n_dives: usize,
    /// Of all that is drawn.
    pub seed: u64,
    /// Least and greatest perturbation: each number is drawn uniformly in between, the phase of the wobble from
    /// a turn.
    pub perturbations: [Perturbation; 2],
    /// Standard deviation of the noise of markers, m.
    pub marker_noise: f64,
}

impl SyntheticOptions {
    /// Exits up to 60 ms late, pikes up to 12 % loose, up to 0.25 rad over, wobbles of up to 4 %, 2 % shorter
    /// to 2 % longer, on the right up to 5 % more than on the left; 5 mm of marker noise; seed 0.
    ///
    /// Faults are on one side, since a linear model of scores cannot see that both too far and too short are
    /// bad.
    pub fn of(n_dives: usize) -> Self {
        let least = Perturbation { duration: -0.02, ..Perturbation::none() };
        let greatest = Perturbation {
            exit_delay: 0.06,
            looseness: 0.12,
            over_rotation: 0.25,
            wobble: 0.04,
            asymmetry: 0.05,
            duration: 0.02,
            ..Perturbation::none()
        };
        Self { n_dives, seed: 0, perturbations: [least, greatest], marker_noise: 0.005 }
    }

    fn draw(&self, rng: &mut impl Rng) -> Perturbation {
        let [least, greatest] = &self.perturbations;
        let mut between = |of: fn(&Perturbation) -> f64| {
            let fraction: f64 = rng.random_range(0.0..1.0);
            of(least) + fraction * (of(greatest) - of(least))
        };
        Perturbation {
            exit_delay: between(|p| p.exit_delay),
            looseness: between(|p| p.looseness),
            over_rotation: between(|p| p.over_rotation),
            wobble: between(|p| p.wobble),
            wobble_frequency: between(|p| p.wobble_frequency),
            asymmetry: between(|p| p.asymmetry),
            duration: between(|p| p.duration),
            wobble_phase: rng.random_range(0.0..TAU),
        }
    }
}

/// **Synthetic** dives with the scores of a **synthetic** judge.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticSet {
    /// The dives.
    pub dives: Vec<SyntheticDive>,
    /// The faults of each.
    pub faults: Vec<DiveFaults>,
    /// The markers of each, with noise.
    pub markers: Vec<MarkerRecording>,
    /// What the judge means to give, without noise.
    pub intended: Vec<f64>,
    /// What he gives.
    pub scores: Vec<f64>,
}

impl SyntheticSet {
    /// Dives drawn, flown in parallel, marked and judged. The same for the same seed, whatever the threads do.
    pub fn generate(
        flight: &SyntheticFlight,
        markers: &MarkerSet,
        judge: &SyntheticJudge,
        options: &SyntheticOptions,
    ) -> Result<Self, SyntheticError> {
        Self::generate_cancellable(flight, markers, judge, options, &CancellationToken::new())
    }

    /// As [`generate`](Self::generate), and ends with [`SyntheticError::Interrupted`] within a dive of the
    /// cancellation.
    pub fn generate_cancellable(
        flight: &SyntheticFlight,
        markers: &MarkerSet,
        judge: &SyntheticJudge,
        options: &SyntheticOptions,
        token: &CancellationToken,
    ) -> Result<Self, SyntheticError> {
        judge.validate()?;
        expect_not_negative("marker_noise", options.marker_noise)?;
        expect_least("n_dives", options.n_dives, 1)?;
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let drawn: Vec<(Perturbation, u64)> =
            (0..options.n_dives).map(|_| (options.draw(&mut rng), rng.random())).collect();
        let make = |(perturbation, seed): &(Perturbation, u64)| {
            if token.is_cancelled() {
                return Err(SyntheticError::Interrupted);
            }
            let dive = flight.perturb(perturbation)?;
            let faults = dive.faults(flight.model())?;
            let recorded = dive.markers(flight.model(), markers, options.marker_noise, *seed)?;
            Ok::<_, SyntheticError>((dive, faults, recorded))
        };
        let made: Vec<_> = drawn.par_iter().map(make).collect::<Result<_, _>>()?;
        let mut set =
            Self { dives: vec![], faults: vec![], markers: vec![], intended: vec![], scores: vec![] };
        for (dive, faults, recorded) in made {
            set.dives.push(dive);
            set.intended.push(judge.intended(&faults)?);
            set.scores.push(judge.score(&faults, &mut rng)?);
            set.faults.push(faults);
            set.markers.push(recorded);
        }
        Ok(set)
    }

    /// The set as one of files and scores, to be saved and read again: every line, every file and every name
    /// says SYNTHETIC.
    pub fn judged_set(&self) -> JudgedSet {
        let line = |(k, score): (usize, &f64)| JudgedMotion {
            file: format!("SYNTHETIC_{:04}.csv", k + 1),
            score: *score,
            athlete: None,
            synthetic: true,
            features: Vec::new(),
            line: k + 3,
        };
        let motions = self.scores.iter().enumerate().map(line).collect();
        JudgedSet {
            list: JudgedList { feature_names: Vec::new(), motions },
            recordings: self.markers.clone(),
            repairs: Vec::new(),
        }
    }

    /// The dives as motions to be scored, by their markers, labelled synthetic.
    pub fn performances(&self) -> Result<Vec<Performance>, SyntheticError> {
        let performance = |m: &MarkerRecording| Ok(Performance::from_markers(m)?.labelled_synthetic());
        self.markers.iter().map(performance).collect()
    }
}
