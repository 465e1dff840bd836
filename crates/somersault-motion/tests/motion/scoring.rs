//! Scoring finds a judge that is there, and none that is not. **All motions and scores here are synthetic.**

use nalgebra::{DMatrix, Vector3};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use somersault_core::argument::ArgumentError;
use somersault_core::cancel::CancellationToken;
use somersault_motion::analysis::AnalysisError;
use somersault_motion::recording::{MarkerRecording, RecordingError};
use somersault_motion::scoring::{
    Groups, Performance, RegressionMethod, ScoringError, ScoringModel, ScoringOptions, StorageError, Tuning,
    ValidationOptions, VectorOptions, panel_score, validate, validate_cancellable,
};

const METHODS: [RegressionMethod; 3] =
    [RegressionMethod::PrincipalComponents, RegressionMethod::PartialLeastSquares, RegressionMethod::Ridge];

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
        Performance::try_new(times, names(4), postures, path).unwrap()
    });
    (motions.collect(), scores)
}

fn names(n: usize) -> Vec<String> {
    (0..n).map(|k| format!("joint {k}")).collect()
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
    // again bit for bit
    let again = validate(&motions, &scores, &options, &validation, &[]).unwrap();
    assert_eq!(found, again);
}

/// By errors of cross-validation; the width hardly exceeds what the judge's noise alone needs.
#[test]
fn intervals_of_scores_hold_unseen_scores_at_their_level() {
    let (mut held, mut count, mut width) = (0, 0, 0.0);
    for seed in 0..12 {
        let (motions, scores) = judged(60, 0.2, 100 + seed);
        let model = ScoringModel::train(&motions[..30], &scores[..30], &ScoringOptions::thesis()).unwrap();
        for (motion, score) in motions.iter().zip(&scores).skip(30) {
            let found = model.score_at_level(motion, 0.9).unwrap();
            let [lower, upper] = found.interval;
            assert!((found.value - 0.5 * (lower + upper)).abs() < 1e-12);
            held += usize::from((lower..=upper).contains(score));
            count += 1;
            width += upper - lower;
        }
    }
    let coverage = f64::from(held as u32) / f64::from(count as u32);
    println!("{coverage}, width {}", width / f64::from(count as u32));
    // 90 %, with a standard deviation of 2.5 % from few motions
    assert!((0.85..=0.97).contains(&coverage), "{coverage}");
    // noise is uniform within ±0.34
    assert!(width / f64::from(count as u32) < 1.0, "{width}");
    // 95 % needs nineteen motions
    let (motions, scores) = judged(19, 0.1, 7);
    let of = |n: usize, level| {
        let options = ScoringOptions { max_components: 3, ..ScoringOptions::thesis() };
        let model = ScoringModel::train(&motions[..n], &scores[..n], &options).unwrap();
        model.score_at_level(&motions[0], level).map(|score| score.interval[1])
    };
    assert!(of(18, 0.95).unwrap().is_infinite() && of(19, 0.95).unwrap().is_finite());
    for level in [0.0, 1.0, f64::NAN] {
        assert!(matches!(of(19, level), Err(ScoringError::Argument(_))), "{level}");
    }
}

/// As the thesis, with vectors of a third of the length.
fn short() -> ScoringOptions {
    let thesis = ScoringOptions::thesis();
    ScoringOptions { vector: VectorOptions { n_frames: 20, ..thesis.vector }, ..thesis }
}

/// Coverage and mean width of 95 % intervals for motions that models have not seen, of scores that follow from motions or not, and the
/// width that the scores by themselves need.
fn intervals(method: RegressionMethod, sets: u64, of_motions: bool) -> [f64; 3] {
    let (mut held, mut widths, mut needed) = (0, 0.0, 0.0);
    for seed in 0..sets {
        let (motions, mut scores) = judged(60, 0.2, 300 + seed);
        if !of_motions {
            scores = judged(60, 0.2, 700 + seed).1;
        }
        let options = ScoringOptions { method, ..short() };
        let model = ScoringModel::train(&motions[..40], &scores[..40], &options).unwrap();
        for (motion, score) in motions.iter().zip(&scores).skip(40) {
            let [lower, upper] = model.score(motion).unwrap().interval;
            held += usize::from((lower..=upper).contains(score));
            widths += upper - lower;
        }
        let mut errors: Vec<f64> = scores.iter().map(|score| (score - 7.0).abs()).collect();
        errors.sort_by(f64::total_cmp);
        needed += 2.0 * errors[56] * 20.0;
    }
    let count = (20 * sets) as f64;
    [held as f64 / count, widths / count, needed / count]
}

#[test]
fn intervals_hold_their_level_and_are_not_too_wide_where_scores_mean_nothing() {
    for method in METHODS {
        for of_motions in [true, false] {
            let [coverage, width, needed] = intervals(method, 8, of_motions);
            println!(
                "{method}, scores of the motions: {of_motions}: {coverage:.3} within {width:.2} of {needed:.2}"
            );
            assert!((0.88..=0.99).contains(&coverage), "{method}: {coverage}");
            let most = if of_motions { 0.7 } else { 1.25 };
            assert!(width < most * needed, "{method}: {width} of {needed}");
        }
    }
}

#[test]
fn the_extreme_awards_of_a_panel_do_not_count() {
    let found = panel_score(&[7.0, 8.5, 6.5, 7.5, 8.0, 7.0, 7.5], 3.6).unwrap();
    // 6.5 and 7, 8.5 and 8 are cancelled
    assert_eq!(found.points, (7.5 + 7.0 + 7.5) * 3.6);
    assert_eq!(found.counts, [false, false, false, true, false, true, true]);
    assert_eq!(panel_score(&[7.0, 8.0, 7.5, 6.0, 7.0], 2.0).unwrap().points, 43.0);
    assert_eq!(panel_score(&[7.0, 8.0, 7.5], 2.0).unwrap().points, 45.0);
    for (awards, difficulty) in [
        (&[7.0; 4][..], 3.0),
        (&[7.0, 7.2, 7.0], 3.0),
        (&[7.0, 10.5, 7.0], 3.0),
        (&[7.0; 5], 0.0),
        (&[f64::NAN; 3], 1.0),
    ] {
        assert!(matches!(panel_score(awards, difficulty), Err(ScoringError::Argument(_))), "{awards:?}");
    }
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

/// Fractions of p-values up to 0.05, of scores that differ between athletes, and motions that do, but do not follow from each other.
fn small_p_values(sets: u64, grouped: bool) -> f64 {
    let few = ValidationOptions { n_resamples: 59, ..ValidationOptions::default() };
    let small = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (athletes, each) = (8, 3);
        let mut scores = Vec::new();
        let motions = (0..athletes * each).map(|i| {
            if i % each == 0 {
                scores.extend(vec![rng.random_range(4.0..9.0); each]);
            }
            scores[i] += rng.random_range(-0.3..0.3);
            let own: Vec<f64> =
                (0..4).map(|k| ((7 * (i / each) + k) as f64 * 1.7 + seed as f64).sin()).collect();
            let times: Vec<f64> = (0..20).map(|k| f64::from(k) / 19.0).collect();
            let postures = DMatrix::from_fn(20, 4, |t, k| {
                own[k] * (2.0 * times[t]).cos() + 0.1 * rng.random_range(-1.0..1.0)
            });
            Performance::try_new(times, names(4), postures, DMatrix::zeros(20, 3)).unwrap()
        });
        let motions: Vec<Performance> = motions.collect();
        let labels: Vec<usize> = (0..athletes * each).map(|i| if grouped { i / each } else { i }).collect();
        let (groups, token) = (Groups::try_new(&labels).unwrap(), CancellationToken::new());
        let options = ScoringOptions { max_components: 3, ..short() };
        let found = validate_cancellable(&motions, &scores, &groups, &options, &few, &[], &token).unwrap();
        found.pearson.p_value <= 0.05
    };
    (0..sets).filter(|seed| small(*seed)).count() as f64 / sets as f64
}

#[test]
fn scores_that_only_tell_athletes_apart_are_a_finding_without_groups_alone() {
    let [single, grouped] = [false, true].map(|grouped| small_p_values(24, grouped));
    println!("p ≤ 0.05 in {single} of sets without groups, {grouped} with them");
    // four deviations above 5 % are 23 %
    assert!(single > 0.5 && grouped < 0.23, "{single}, {grouped}");
}

#[test]
fn leaving_out_is_training_without() {
    let (motions, scores) = judged(14, 0.1, 8);
    let validation = ValidationOptions { n_resamples: 2, ..ValidationOptions::default() };
    let single: Vec<usize> = (0..14).collect();
    let athletes: Vec<usize> = (0..14).map(|i| i % 4).collect();
    for method in METHODS {
        let options = ScoringOptions { method, ..ScoringOptions::thesis() };
        for labels in [&single, &athletes] {
            let (groups, token) = (Groups::try_new(labels).unwrap(), CancellationToken::new());
            let found =
                validate_cancellable(&motions, &scores, &groups, &options, &validation, &[], &token).unwrap();
            for i in 0..4 {
                let others = (0..14).filter(|k| labels[*k] != labels[i]);
                let (others, known): (Vec<_>, Vec<_>) =
                    others.map(|k| (motions[k].clone(), scores[k])).unzip();
                let model = ScoringModel::train(&others, &known, &options).unwrap();
                assert_eq!(found.tunings[i], model.tuning(), "{method}, motion {i}");
                let off = found.predictions[i] - model.score(&motions[i]).unwrap().value;
                assert!(off.abs() < 1e-10, "{method}, motion {i}: {off:e}");
                let mean = known.iter().sum::<f64>() / known.len() as f64;
                assert!((found.baselines[0].predictions[i] - mean).abs() < 1e-13);
            }
        }
    }
}

#[test]
fn scores_that_mean_nothing_are_not_explained() {
    // R² without a motion that chooses its own tuning: on average not above zero
    const SHUFFLES: usize = 20;
    let (motions, mut scores) = judged(24, 0.1, 3);
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    let few = ValidationOptions { n_resamples: 2, ..ValidationOptions::default() };
    let mut found = vec![Vec::new(); 3];
    for _ in 0..SHUFFLES {
        scores.shuffle(&mut rng);
        for (method, found) in METHODS.into_iter().zip(&mut found) {
            let options = ScoringOptions { method, ..short() };
            let found: &mut Vec<f64> = found;
            found.push(validate(&motions, &scores, &options, &few, &[]).unwrap().r_squared());
        }
    }
    for (method, found) in METHODS.into_iter().zip(found) {
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        println!("{method}: R² {mean:.3} on average, from {found:.2?}");
        assert!(mean < 0.0, "{method}: {mean}");
    }
}

#[test]
fn groups_that_cannot_be_left_out_are_refused() {
    let (motions, scores) = judged(9, 0.1, 1);
    let options = ScoringOptions::thesis();
    let two = Groups::try_new(&[0, 0, 1, 1]);
    assert!(
        matches!(
            two,
            Err(ScoringError::Argument(ArgumentError::OutOfRange { argument: "groups", found: 2.0, .. }))
        ),
        "{two:?}"
    );
    let train = |labels: &[usize]| {
        let groups = Groups::try_new(labels).unwrap();
        ScoringModel::train_in_groups(&motions, &scores, &groups, &options).map(drop)
    };
    let short = ArgumentError::Length { argument: "groups", expected: 9, found: 8 };
    assert_eq!(train(&[0, 1, 2, 3, 4, 5, 6, 7]), Err(ScoringError::Argument(short)));
    let large = ScoringError::Group { motion: 1, least: 6, found: 5 };
    assert_eq!(train(&[0, 1, 2, 1, 3, 1, 4, 1, 5]), Err(large));
    assert_eq!(train(&[0, 1, 2, 1, 3, 1, 4, 6, 5]), Ok(()));
}

#[test]
fn what_is_not_of_the_method_is_refused() {
    let (motions, scores) = judged(9, 0.1, 1);
    let train = |method, n_components, penalty| {
        let options = ScoringOptions { method, n_components, penalty, ..ScoringOptions::thesis() };
        ScoringModel::train(&motions, &scores, &options).map(|model| model.tuning())
    };
    let not_of = |argument, method, instead| Err(ScoringError::NotOfMethod { argument, method, instead });
    let [components, partial, ridge] = METHODS;
    assert_eq!(train(components, None, Some(0.1)), not_of("penalty", components, "n_components"));
    assert_eq!(train(partial, Some(2), Some(0.1)), not_of("penalty", partial, "n_components"));
    assert_eq!(train(ridge, Some(2), None), not_of("n_components", ridge, "penalty"));
    for penalty in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let found = train(ridge, None, Some(penalty));
        assert!(matches!(found, Err(ScoringError::Argument(ArgumentError::NotPositive { .. }))), "{found:?}");
    }
    assert_eq!(train(partial, Some(2), None), Ok(Tuning::Components(2)));
    assert_eq!(train(ridge, None, Some(0.1)), Ok(Tuning::Penalty(0.1)));
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
    let mut text = String::new();
    for method in METHODS {
        let options = ScoringOptions { method, ..ScoringOptions::thesis() };
        let model = ScoringModel::train(&motions, &scores, &options).unwrap();
        text = model.to_json().unwrap();
        let again = ScoringModel::from_json(&text).unwrap();
        assert_eq!(again, model);
        assert_eq!(again.score(&motions[0]), model.score(&motions[0]));
    }
    // a tuning of another method, or one that gives other coefficients
    let stored: serde_json::Value = serde_json::from_str(&text).unwrap();
    for tuning in [serde_json::json!({"components": 2}), serde_json::json!({"penalty": 1e3})] {
        let mut stored = stored.clone();
        stored["tuning"] = tuning;
        let found = ScoringModel::from_json(&stored.to_string());
        assert!(matches!(found, Err(StorageError::Sense { .. })), "{found:?}");
    }

    let found = ScoringModel::from_json(&text.replace("\"version\": 4", "\"version\": 1"));
    assert!(matches!(found, Err(StorageError::Version { version: 1, .. })));
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
    assert_eq!(
        few,
        Err(ScoringError::Argument(ArgumentError::TooFew { argument: "motions", least: 7, found: 6 }))
    );
    let short = ScoringModel::train(&motions, &scores[..5], &ScoringOptions { max_components: 2, ..options });
    assert!(matches!(
        short,
        Err(ScoringError::Argument(ArgumentError::Length { argument: "scores", expected: 6, found: 5 }))
    ));
    let mut bad = scores.clone();
    bad[2] = f64::NAN;
    let bad = ScoringModel::train(&motions, &bad, &ScoringOptions { max_components: 2, ..options });
    assert!(matches!(bad, Err(ScoringError::Argument(ArgumentError::NonFinite { argument: "scores", .. }))));
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
        let expected =
            ScoringError::Argument(ArgumentError::OutOfRange { argument, allowed: "at least 1", found: 0.0 });
        assert_eq!(with(options), Err(expected));
    }
    let validated = |scores: &[f64], choices: ValidationOptions| {
        validate(&motions, scores, &options, &choices, &[]).map(drop)
    };
    let usual = ValidationOptions { n_resamples: 10, ..ValidationOptions::default() };
    for level in [0.0, 1.0, -1.0, f64::NAN] {
        let found = validated(&scores, ValidationOptions { level, ..usual });
        assert!(
            matches!(found, Err(ScoringError::Argument(ArgumentError::OutOfRange { argument: "level", .. }))),
            "{found:?}"
        );
    }
    let found = validated(&scores, ValidationOptions { n_resamples: 0, ..usual });
    assert!(
        matches!(
            found,
            Err(ScoringError::Argument(ArgumentError::OutOfRange { argument: "n_resamples", .. }))
        ),
        "{found:?}"
    );
    assert_eq!(validated(&[7.0; 9], usual), Err(ScoringError::Constant { argument: "scores" }));

    let make = |times: &[f64], posture: f64, path: f64| {
        let rows = |x: f64, n: usize| DMatrix::from_element(times.len(), n, x);
        Performance::try_new(times.to_vec(), names(2), rows(posture, 2), rows(path, 3)).map(drop)
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

/// Divers of five markers that fold, facing somewhere, and a linear judge of how deep.
fn marked(n: usize, seed: u64) -> (Vec<MarkerRecording>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut scores = Vec::new();
    let names = || ["head", "hand", "hip", "knee", "foot"].map(String::from).to_vec();
    let motions = (0..n).map(|_| {
        let depth = rng.random_range(-1.0..1.0);
        scores.push(6.0 + 2.0 * depth);
        let times: Vec<f64> = (0..50).map(|i| 1.4 * f64::from(i) / 49.0).collect();
        let mut points = Vec::new();
        for &t in &times {
            let fold = (-((t - 0.7) / 0.25_f64).powi(2)).exp() * (1.6 + 0.4 * depth);
            let hip = Vector3::new(0.8 * t, 0.1 * t, 3.0 + 3.0 * t - 4.9 * t * t);
            // in the body, which somersaults about y
            let (legs, arms) = (fold.sin_cos(), (2.9 - fold).sin_cos());
            let body = [
                Vector3::new(0.02, 0.0, 0.7),
                Vector3::new(0.6 * arms.0, 0.2, 0.45 - 0.6 * arms.1),
                Vector3::zeros(),
                Vector3::new(0.4 * legs.0, 0.05, -0.4 * legs.1),
                Vector3::new(0.8 * legs.0, 0.05, -0.8 * legs.1),
            ];
            let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), 4.0 * t);
            for point in body {
                let noise = Vector3::from_fn(|_, _| 0.005 * rng.random_range(-1.0..1.0));
                points.push(Some(hip + turn * point + noise));
            }
        }
        MarkerRecording::try_new(names(), times, points).unwrap()
    });
    (motions.collect(), scores)
}

/// The recording with its points changed.
fn moved(recording: &MarkerRecording, change: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> MarkerRecording {
    let points = recording.frames().flatten().map(|p| p.as_ref().map(&change)).collect();
    MarkerRecording::try_new(recording.names().to_vec(), recording.times().to_vec(), points).unwrap()
}

fn turned(recording: &MarkerRecording, axis: Vector3<f64>, angle: f64) -> MarkerRecording {
    let turn = nalgebra::Rotation3::new(axis * angle);
    moved(recording, |p| turn * p + Vector3::new(3.0, -2.0, 0.0))
}

fn renamed(recording: &MarkerRecording, names: &[&str]) -> MarkerRecording {
    let names = names.iter().map(|n| (*n).to_owned()).collect();
    let points = recording.frames().flatten().copied().collect();
    MarkerRecording::try_new(names, recording.times().to_vec(), points).unwrap()
}

fn performance(recording: &MarkerRecording) -> Performance {
    Performance::from_markers(recording).unwrap()
}

#[test]
fn permuted_renamed_rescaled_and_turned_recordings_score_the_same_or_are_refused() {
    let (recordings, scores) = marked(24, 21);
    let learnt: Vec<Performance> = recordings.iter().map(performance).collect();
    let model = ScoringModel::train(&learnt, &scores, &ScoringOptions::thesis()).unwrap();
    let (new, truth) = marked(20, 22);
    let (mut outside, mut largest) = (0, 0.0_f64);
    for (recording, truth) in new.iter().zip(truth) {
        let score = model.score(&performance(recording)).unwrap();
        assert!((score.value - truth).abs() < 0.3, "{score:?} for {truth}");
        outside += usize::from(!score.is_inside());
        largest = largest.max(score.distance);
        // in another order, with a marker more, and facing elsewhere
        let permuted = recording.select(&["foot", "hip", "head", "knee", "hand"]).unwrap();
        assert_eq!(model.score(&performance(&permuted)).unwrap(), score);
        let more = recording.frames().flat_map(|f| f.iter().copied().chain([Some(Vector3::x())])).collect();
        let names = ["head", "hand", "hip", "knee", "foot", "board"].map(String::from).to_vec();
        let more = MarkerRecording::try_new(names, recording.times().to_vec(), more).unwrap();
        let found = model.score(&performance(&more)).unwrap();
        assert!((found.value - score.value).abs() < 1e-12);
        for angle in [0.3, 1.6, 3.1, -2.0] {
            let found = model.score(&performance(&turned(recording, Vector3::z(), angle))).unwrap();
            assert!(
                (found.value - score.value).abs() < 1e-9 && (found.distance - score.distance).abs() < 1e-9
            );
        }
        // foreign names
        let found = model.score(&performance(&renamed(recording, &["a", "hand", "hip", "knee", "b"])));
        let (missing, found_names) = ("head, foot".to_owned(), "a, hand, hip, knee, b".to_owned());
        assert_eq!(found, Err(ScoringError::Names { missing, found: found_names }));
        // other units: cm, mm, in, ft, and m taken for mm
        for factor in [100.0, 1000.0, 1.0 / 0.0254, 1.0 / 0.3048, 0.0254, 0.3048, 0.001] {
            let found = model.score(&performance(&moved(recording, |p| p * factor)));
            assert!(matches!(found, Err(ScoringError::Size { motion: None, .. })), "{factor}: {found:?}");
        }
        // what is of human size, but mistaken: names exchanged, axes, mirrored, upside down
        let exchanged = renamed(recording, &["foot", "hand", "hip", "knee", "head"]);
        let sideways = moved(recording, |p| Vector3::new(p.x, -p.z, p.y));
        let fallen = moved(recording, |p| Vector3::new(p.z, p.y, -p.x));
        let over = moved(recording, |p| Vector3::new(p.x, -p.y, -p.z));
        for (what, mistaken) in
            [("exchanged", exchanged), ("sideways", sideways), ("fallen", fallen), ("over", over)]
        {
            let found = model.score(&performance(&mistaken)).unwrap();
            assert!(!found.is_inside() && found.distance > 2.0, "{what}: {found:?}");
        }
    }
    // by exchange one of 25 is beyond the training motions
    println!("{outside} of 20 new ones outside, the farthest at {largest:.2}");
    assert!(outside <= 5, "{outside} of 20 outside");
}

#[test]
fn what_is_learnt_does_not_depend_on_how_recordings_face_or_are_ordered() {
    let (recordings, scores) = marked(12, 23);
    let train = |recordings: &[MarkerRecording]| {
        let learnt: Vec<Performance> = recordings.iter().map(performance).collect();
        ScoringModel::train(&learnt, &scores, &ScoringOptions::thesis()).unwrap()
    };
    let model = train(&recordings);
    let mixed: Vec<MarkerRecording> = recordings
        .iter()
        .enumerate()
        .map(|(i, recording)| {
            let turned = turned(recording, Vector3::z(), 2.4 * i as f64);
            let names = ["foot", "hip", "head", "knee", "hand"];
            if i % 2 == 1 { turned.select(&names).unwrap() } else { turned }
        })
        .collect();
    let other = train(&mixed);
    for recording in marked(6, 24).0 {
        let [a, b] = [&model, &other].map(|m| m.score(&performance(&recording)).unwrap());
        assert!((a.value - b.value).abs() < 1e-8 && (a.distance - b.distance).abs() < 1e-8, "{a:?}, {b:?}");
    }
    // one of the training motions that is in mm, or lacks a marker, is named
    let with = |k: usize, recording: MarkerRecording| {
        let mut learnt: Vec<Performance> = recordings.iter().map(performance).collect();
        learnt[k] = performance(&recording);
        ScoringModel::train(&learnt, &scores, &ScoringOptions::thesis()).map(drop)
    };
    let found = with(7, moved(&recordings[7], |p| p * 1000.0));
    assert!(matches!(found, Err(ScoringError::Size { motion: Some(7), .. })), "{found:?}");
    let found = with(4, recordings[4].select(&["head", "hip", "knee", "foot"]).unwrap()).unwrap_err();
    assert_eq!(found.to_string(), "motion 4: the motion must have hand; it has head, hip, knee, foot");
    // one that lies on its side is seen in the validation
    let mut learnt: Vec<Performance> = recordings.iter().map(performance).collect();
    learnt[9] = performance(&moved(&recordings[9], |p| Vector3::new(p.x, -p.z, p.y)));
    let few = ValidationOptions { n_resamples: 2, ..ValidationOptions::default() };
    let found = validate(&learnt, &scores, &ScoringOptions::thesis(), &few, &[]).unwrap();
    assert!(found.distances[9] > 2.0, "{:?}", found.distances);
    assert!(found.distances.iter().enumerate().all(|(i, d)| i == 9 || *d < 1.0), "{:?}", found.distances);
}

#[test]
fn scores_outside_of_their_scale_are_refused() {
    let (motions, mut scores) = judged(12, 0.1, 3);
    scores[4] = 76.0;
    let options = ScoringOptions::thesis();
    let found = ScoringModel::train(&motions, &scores, &options).map(drop);
    let outside = ScoringError::OutsideScale { motion: 4, found: 76.0, least: 0.0, greatest: 10.0 };
    assert_eq!(found, Err(outside.clone()));
    let few = ValidationOptions { n_resamples: 2, ..ValidationOptions::default() };
    assert_eq!(validate(&motions, &scores, &options, &few, &[]).map(drop), Err(outside));
    let wide = ScoringOptions { scale: [0.0, 100.0], ..options };
    let model = ScoringModel::train(&motions, &scores, &wide).unwrap();
    assert_eq!((model.scale(), model.scores()[4], model.n_motions()), ([0.0, 100.0], 76.0, 12));
    for scale in [[1.0, 1.0], [f64::NAN, 1.0], [0.0, f64::INFINITY]] {
        let found = ScoringModel::train(&motions, &scores, &ScoringOptions { scale, ..options });
        assert!(matches!(found, Err(ScoringError::Scale { .. })), "{scale:?}");
    }
}

#[test]
fn stored_models_that_make_no_sense_are_refused() {
    let (motions, scores) = judged(20, 0.1, 5);
    let model = ScoringModel::train(&motions, &scores, &ScoringOptions::thesis()).unwrap();
    let stored: serde_json::Value = serde_json::from_str(&model.to_json().unwrap()).unwrap();
    type Change = fn(&mut serde_json::Value);
    let changes: [(&str, Change); 13] = [
        ("unit", |m| m["unit"] = "mm".into()),
        ("up", |m| m["up"] = "y".into()),
        ("names", |m| m["features"]["names"][1] = m["features"]["names"][0].clone()),
        ("fewer names", |m| drop(m["features"]["names"].as_array_mut().unwrap().pop())),
        ("kind", |m| m["features"]["kind"] = "markers".into()),
        ("intercept", |m| m["intercept"] = 70.0.into()),
        ("coefficients", |m| m["coefficients"][0] = 1e3.into()),
        ("sign", |m| m["coefficients"][0] = (-m["coefficients"][0].as_f64().unwrap()).into()),
        ("scores", |m| m["learnt"]["scores"][3] = 76.0.into()),
        ("vectors", |m| m["learnt"]["vectors"][3][5] = 40.0.into()),
        ("distances", |m| m["learnt"]["distances"][3] = (-1.0).into()),
        ("errors", |m| drop(m["learnt"]["errors"].as_array_mut().unwrap().pop())),
        ("samples", |m| m["eigenmotions"]["n_samples"] = 21.into()),
    ];
    assert!(ScoringModel::from_json(&stored.to_string()).is_ok());
    for (what, change) in changes {
        let mut stored = stored.clone();
        change(&mut stored);
        let found = ScoringModel::from_json(&stored.to_string());
        assert!(
            matches!(found, Err(StorageError::Sense { .. } | StorageError::Parts(_))),
            "{what}: {found:?}"
        );
    }
}
