//! Scoring finds a judge that is there, and none that is not. **All motions and scores here are synthetic.**

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use somersault_motion::scoring::{
    Performance, ScoringError, ScoringModel, ScoringOptions, StorageError, ValidationOptions, validate,
};

/// Motions of four joints that differ by two numbers each, how deep and how late the body folds, and by noise; and
/// a linear judge of these numbers with noise of his own.
fn judged(n: usize, judge_noise: f64, seed: u64) -> (Vec<Performance>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut scores = Vec::new();
    let motions = (0..n).map(|_| {
        let (depth, delay) = (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
        scores.push(7.0 + 0.8 * depth - 0.5 * delay + judge_noise * rng.random_range(-1.7..1.7));
        let frames = 50 + rng.random_range(0..20);
        let times: Vec<f64> = (0..frames).map(|i| 1.4 * f64::from(i) / f64::from(frames - 1)).collect();
        let fold = |t: f64| (-((t - 0.7 - 0.08 * delay) / 0.3).powi(2)).exp() * (1.5 + 0.3 * depth);
        let mut noise = || 0.02 * rng.random_range(-1.0..1.0);
        let postures = DMatrix::from_fn(times.len(), 4, |i, j| {
            let t = times[i];
            [fold(t), 0.3 * fold(t) + 0.2 * (4.0 * t).sin(), (3.0 * t).cos(), 0.4 * t * t][j] + noise()
        });
        let path = DMatrix::from_fn(times.len(), 3, |i, j| [times[i], 0.0, 3.0 - 4.9 * times[i].powi(2)][j]);
        Performance::try_new(times, postures, path).unwrap()
    });
    (motions.collect(), scores)
}

#[test]
fn a_linear_judge_is_recovered_within_his_noise() {
    let (motions, scores) = judged(40, 0.1, 3);
    let options = ScoringOptions::thesis();
    let found = validate(&motions, &scores, &options, &ValidationOptions::default(), &[]).unwrap();
    println!("rms {:.3}, Pearson {:?}, Spearman {:?}", found.rms_error, found.pearson, found.spearman);
    // the judge's own noise is 0.1; that of the motions and of forty of them adds to it
    assert!(found.rms_error < 0.2, "{}", found.rms_error);
    assert!(found.pearson.interval[0] > 0.85 && found.spearman.interval[0] > 0.75);
    assert_eq!(found.baselines[0].name, "mean");
    assert!(found.baselines.iter().all(|b| b.rms_error > 2.0 * found.rms_error));
    // again to the bit
    let again = validate(&motions, &scores, &options, &ValidationOptions::default(), &[]).unwrap();
    assert_eq!(found, again);
}

#[test]
fn shuffled_scores_are_not_predicted() {
    let (motions, scores) = judged(24, 0.1, 3);
    let options = ScoringOptions::thesis();
    let validation = ValidationOptions { n_resamples: 2000, ..ValidationOptions::default() };
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let mut contained = 0;
    for _ in 0..5 {
        let mut shuffled = scores.clone();
        shuffled.shuffle(&mut rng);
        let found = validate(&motions, &shuffled, &options, &validation, &[]).unwrap();
        println!("shuffled: Pearson {:?}", found.pearson);
        // correlations of leave-one-out predictions lean to the negative: only a positive one would be a finding
        let [lower, upper] = found.pearson.interval;
        assert!(lower < 0.0, "{:?}", found.pearson);
        assert!(found.rms_error > 0.9 * found.baselines[0].rms_error, "no better than the mean");
        contained += usize::from(upper > 0.0);
    }
    println!("the interval contains 0 for {contained} of 5 shuffles, and is below it for the others");
}

#[test]
fn single_features_are_baselines() {
    let (motions, scores) = judged(20, 0.1, 4);
    let features = [("the score itself", &scores[..])];
    let found =
        validate(&motions, &scores, &ScoringOptions::thesis(), &ValidationOptions::default(), &features)
            .unwrap();
    let names: Vec<&str> = found.baselines.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["mean", "duration", "the score itself"]);
    assert!(found.baselines[2].rms_error < 1e-12);
}

#[test]
fn models_come_back_to_the_bit() {
    let (motions, scores) = judged(20, 0.1, 5);
    let model = ScoringModel::train(&motions, &scores, &ScoringOptions::thesis()).unwrap();
    let text = model.to_json().unwrap();
    let again = ScoringModel::from_json(&text).unwrap();
    assert_eq!(again, model);
    assert_eq!(again.score(&motions[0]), model.score(&motions[0]));

    let found = ScoringModel::from_json(&text.replace("\"version\": 1", "\"version\": 2"));
    assert!(matches!(found, Err(StorageError::Version { version: 2, .. })));
    let found = ScoringModel::from_json(&text.replace("\"n_frames\": 60", "\"n_frames\": 61"));
    assert!(matches!(found, Err(StorageError::Parts(_))), "{found:?}");
    let found = ScoringModel::from_json(&text[..text.len() / 2]);
    assert!(matches!(found, Err(StorageError::Json { .. })));
}

#[test]
fn what_cannot_be_scored_is_refused() {
    let (motions, scores) = judged(6, 0.1, 6);
    let options = ScoringOptions::thesis();
    let few = ScoringModel::train(&motions, &scores, &options).map(drop);
    assert_eq!(few, Err(ScoringError::TooFew { argument: "motions", least: 7, found: 6 }));
    let short = ScoringModel::train(&motions, &scores[..5], &ScoringOptions { max_components: 2, ..options });
    assert!(matches!(short, Err(ScoringError::Length { argument: "scores", expected: 6, found: 5 })));
    let mut bad = scores.clone();
    bad[2] = f64::NAN;
    let bad = ScoringModel::train(&motions, &bad, &ScoringOptions { max_components: 2, ..options });
    assert!(matches!(bad, Err(ScoringError::NonFinite { argument: "scores" })));
    let many = ScoringOptions {
        vector: somersault_motion::scoring::VectorOptions { n_eigenweights: 5, ..options.vector },
        ..options
    };
    let many = ScoringModel::train(&judged(9, 0.1, 1).0, &[7.0; 9], &many);
    assert!(matches!(many, Err(ScoringError::Analysis(_))));
}
