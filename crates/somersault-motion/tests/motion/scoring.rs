//! Scoring finds a judge that is there, and none that is not. **All motions and scores here are synthetic.**

use nalgebra::{DMatrix, Vector3};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use somersault_motion::analysis::AnalysisError;
use somersault_motion::recording::{MarkerRecording, RecordingError};
use somersault_motion::scoring::{
    Performance, ScoringError, ScoringModel, ScoringOptions, StorageError, ValidationOptions, VectorOptions,
    validate,
};

/// Motions of four joints that differ by two numbers each, how deep and how late the body folds, and by noise;
/// and a linear judge of these numbers with noise of his own.
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
    let validation = ValidationOptions { n_resamples: 200, ..ValidationOptions::default() };
    let found = validate(&motions, &scores, &options, &validation, &[]).unwrap();
    println!("rms {:.3}, Pearson {:?}, Spearman {:?}", found.rms_error, found.pearson, found.spearman);
    // the judge's own noise is 0.1; that of the motions and of forty of them adds to it
    assert!(found.rms_error < 0.2, "{}", found.rms_error);
    assert!(found.pearson.interval[0] > 0.85 && found.spearman.interval[0] > 0.75);
    assert!(found.pearson.p_value < 0.01 && found.spearman.p_value < 0.01);
    assert_eq!(found.baselines[0].name, "mean");
    assert!(found.baselines.iter().all(|b| b.rms_error > 2.0 * found.rms_error));
    // again to the bit
    let again = validate(&motions, &scores, &options, &validation, &[]).unwrap();
    assert_eq!(found, again);
}

#[test]
fn on_shuffled_scores_the_interval_contains_zero_at_its_level() {
    const SHUFFLES: usize = 60;
    let (motions, mut scores) = judged(24, 0.1, 3);
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let validation = ValidationOptions { n_resamples: 100, ..ValidationOptions::default() };
    // by cross-validation and with a number given
    for n_components in [None, Some(3)] {
        let options = ScoringOptions { n_components, ..ScoringOptions::thesis() };
        let (mut contained, mut small, mut negative) = ([0; 2], [0; 2], 0);
        for _ in 0..SHUFFLES {
            scores.shuffle(&mut rng);
            let found = validate(&motions, &scores, &options, &validation, &[]).unwrap();
            for (k, correlation) in [found.pearson, found.spearman].iter().enumerate() {
                let [lower, upper] = correlation.interval;
                contained[k] += usize::from(lower <= 0.0 && upper >= 0.0);
                small[k] += usize::from(correlation.p_value <= 0.05);
            }
            negative += usize::from(found.pearson.value < 0.0);
        }
        println!(
            "{n_components:?}: 0 in {contained:?} of {SHUFFLES} intervals, p ≤ 0.05 in {small:?}, {negative} negative"
        );
        for k in 0..2 {
            // 57 and 3 are expected; four deviations of a count of sixty are 7
            assert!(contained[k] >= 57 - 7, "{contained:?}");
            assert!(small[k] <= 3 + 7, "{small:?}");
        }
        // the lean that intervals and p-values have to bear
        assert!(negative > SHUFFLES / 2);
    }
}

#[test]
fn leaving_out_is_training_without() {
    let (motions, scores) = judged(16, 0.1, 8);
    let options = ScoringOptions::thesis();
    let validation = ValidationOptions { n_resamples: 2, ..ValidationOptions::default() };
    let found = validate(&motions, &scores, &options, &validation, &[]).unwrap();
    for i in 0..motions.len() {
        let (mut others, mut known) = (motions.clone(), scores.clone());
        let motion = others.remove(i);
        known.remove(i);
        let model = ScoringModel::train(&others, &known, &options).unwrap();
        assert_eq!(found.n_components[i], model.coefficients().len(), "motion {i}");
        let off = found.predictions[i] - model.score(&motion).unwrap();
        assert!(off.abs() < 1e-9, "motion {i}: {off:e}");
    }
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
    let (motions, scores) = judged(9, 0.1, 1);
    let with = |options: ScoringOptions| ScoringModel::train(&motions, &scores, &options).map(drop);
    let eigenweights =
        |n| ScoringOptions { vector: VectorOptions { n_eigenweights: n, ..options.vector }, ..options };
    let found = with(eigenweights(5));
    assert_eq!(found, Err(ScoringError::TooMany { argument: "n_eigenweights", most: 4, found: 5 }));
    let no_frames = VectorOptions { n_frames: 0, ..options.vector };
    for (options, argument) in [
        (eigenweights(0), "n_eigenweights"),
        (ScoringOptions { vector: no_frames, ..options }, "n_frames"),
        (ScoringOptions { n_components: Some(0), ..options }, "n_components"),
        (ScoringOptions { max_components: 0, ..options }, "max_components"),
    ] {
        let expected = ScoringError::Range { argument, allowed: "at least 1", found: 0.0 };
        assert_eq!(with(options), Err(expected));
    }
    let validated = |scores: &[f64], choices: ValidationOptions| {
        validate(&motions, scores, &options, &choices, &[]).map(drop)
    };
    let usual = ValidationOptions { n_resamples: 10, ..ValidationOptions::default() };
    for level in [0.0, 1.0, -1.0, f64::NAN] {
        let found = validated(&scores, ValidationOptions { level, ..usual });
        assert!(matches!(found, Err(ScoringError::Range { argument: "level", .. })), "{found:?}");
    }
    let found = validated(&scores, ValidationOptions { n_resamples: 0, ..usual });
    assert!(matches!(found, Err(ScoringError::Range { argument: "n_resamples", .. })), "{found:?}");
    assert_eq!(validated(&[7.0; 9], usual), Err(ScoringError::Constant { argument: "scores" }));

    let make = |times: &[f64], posture: f64, path: f64| {
        let rows = |x: f64, n: usize| DMatrix::from_element(times.len(), n, x);
        Performance::try_new(times.to_vec(), rows(posture, 2), rows(path, 3)).map(drop)
    };
    let found = make(&[0.0, 0.0], 1.0, 1.0);
    assert!(matches!(found, Err(ScoringError::Recording(RecordingError::TimesNotGrowing { .. }))));
    let nan = |found, name| {
        assert_eq!(found, Err(ScoringError::Analysis(AnalysisError::NonFinite { argument: name, row: 0 })));
    };
    nan(make(&[0.0, 1.0], f64::NAN, 1.0), "postures");
    nan(make(&[0.0, 1.0], 1.0, f64::INFINITY), "path");
    let p = Some(Vector3::zeros());
    let gap = MarkerRecording::try_new(vec!["a".into(), "b".into()], vec![0.0, 1.0], vec![p, p, p, None]);
    let found = Performance::from_markers(&gap.unwrap()).map(drop);
    assert_eq!(found, Err(ScoringError::Gap { marker: "b".into(), frame: 1 }));
}

#[test]
fn stored_models_that_are_none_are_refused() {
    let (motions, scores) = judged(20, 0.1, 5);
    let model = ScoringModel::train(&motions, &scores, &ScoringOptions::thesis()).unwrap();
    let stored: serde_json::Value = serde_json::from_str(&model.to_json().unwrap()).unwrap();
    let refused = |change: &dyn Fn(&mut serde_json::Value), part: &str| {
        let mut stored = stored.clone();
        change(&mut stored["eigenpostures"]);
        let found = ScoringModel::from_json(&stored.to_string());
        let argument = match &found {
            Err(StorageError::Parts(AnalysisError::Parts { argument, .. })) => *argument,
            other => panic!("{part}: {other:?}"),
        };
        assert_eq!(argument, part);
    };
    refused(&|pca| pca["components"][0][0] = 3.0.into(), "components");
    refused(&|pca| pca["components"][1] = pca["components"][0].clone(), "components");
    refused(&|pca| pca["variance"][3] = (-1.0).into(), "variance");
    refused(&|pca| pca["variance"][3] = 1e3.into(), "variance");
    refused(&|pca| pca["total_variance"] = 1e-9.into(), "total_variance");
    refused(&|pca| pca["n_samples"] = 1.into(), "n_samples");
}
