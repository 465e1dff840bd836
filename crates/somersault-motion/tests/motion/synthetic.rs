//! **SYNTHETIC** dives and scores, from the flight to the judge that is found again.

use nalgebra::Vector3;
use somersault_core::argument::ArgumentError;
use somersault_dives::{Dive, DiveMotion, DiveReport, DiveSearch};
use somersault_motion::analysis::DiveFaults;
use somersault_motion::fit::MarkerSet;
use somersault_motion::scoring::{ScoringModel, ScoringOptions, Validation, ValidationOptions, validate};
use somersault_motion::synthetic::{
    Perturbation, SyntheticError, SyntheticFlight, SyntheticJudge, SyntheticOptions, SyntheticSet,
    synthetic_markers,
};
use somersault_multibody::models::Diver;
use somersault_multibody::{Data, Model};
use somersault_nlp::Flow;
use std::sync::LazyLock;

/// The optimal 107B of thesis 3.1, found once.
pub(crate) static FORWARD_PIKE: LazyLock<(DiveMotion, DiveReport)> = LazyLock::new(|| {
    let program = Dive::forward_pike().unwrap().program().unwrap();
    let start = program.start(&Dive::pike_template()).unwrap();
    let found = DiveSearch::direct().solve(&program, start, &mut |_| Flow::Continue).unwrap();
    assert!(found.status.is_converged());
    (program.motion(&found.z).unwrap(), program.report(&found.z).unwrap())
});

pub(crate) fn planar() -> Model {
    Diver::planar().model().unwrap()
}

pub(crate) fn flight() -> SyntheticFlight {
    let (motion, _) = &*FORWARD_PIKE;
    SyntheticFlight::try_new(&planar(), &motion.times, &motion.positions).unwrap()
}

/// A set with the judge whose reference is the optimal dive.
pub(crate) fn judged(options: &SyntheticOptions) -> (SyntheticSet, SyntheticJudge) {
    let (model, flight) = (planar(), flight());
    let optimal = flight.perturb(&Perturbation::none()).unwrap();
    let judge = SyntheticJudge::with_reference(optimal.faults(&model).unwrap());
    let markers = MarkerSet::joint_centres(&model).unwrap();
    (SyntheticSet::generate(&flight, &markers, &judge, options).unwrap(), judge)
}

#[test]
fn an_unperturbed_flight_is_the_optimal_dive() {
    let (motion, report) = &*FORWARD_PIKE;
    let dive = flight().perturb(&Perturbation::none()).unwrap();
    assert!((dive.angular_momentum.y - report.momentum).abs() < 1e-5 * report.momentum);
    assert_eq!(dive.times.len(), motion.times.len());
    // joints between the frames are a cubic spline's here, a quintic one's there
    let off = dive.positions.iter().zip(&motion.positions).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-4, "{off}");
    let faults = dive.faults(&planar()).unwrap();
    println!("{faults:?}");
    assert!((faults.entry_angle - report.entry_angle).abs() < 1e-6, "{faults:?}");
}

#[test]
fn perturbed_flights_keep_their_momentum_and_have_their_faults() {
    let (model, flight) = (planar(), flight());
    let plain = flight.perturb(&Perturbation::none()).unwrap();
    let perturbation = Perturbation {
        exit_delay: 0.05,
        looseness: 0.1,
        over_rotation: 0.2,
        wobble: 0.03,
        duration: 0.02,
        ..Perturbation::none()
    };
    let dive = flight.perturb(&perturbation).unwrap();
    // rotation to the entry as requested, the centre of mass on the parabola between the same ends
    let n_q = model.n_positions();
    let turn = |positions: &[f64]| positions[positions.len() - n_q + 2] - positions[2];
    assert!((turn(&dive.positions).abs() - turn(&plain.positions).abs() - 0.2).abs() < 1e-8);
    let mut data = Data::new(&model);
    let mut center = |i: usize| {
        model.positions(&mut data, &dive.positions[i * n_q..(i + 1) * n_q]).unwrap().center_of_mass()
    };
    let (n, duration) = (dive.times.len(), dive.times[dive.times.len() - 1]);
    let (first, middle, last) = (center(0), center((n - 1) / 2), center(n - 1));
    assert!((duration - 1.02 * 1.7).abs() < 1e-12);
    let sag = 0.5 * (first + last) - middle + Vector3::new(0.0, 0.0, 9.81 * duration * duration / 8.0);
    assert!(sag.norm() < 1e-12, "{sag}");
    // momentum of the frames by central differences, against the one it was flown with
    let mut v = vec![0.0; model.n_velocities()];
    for i in (1..n - 1).step_by(7) {
        let [before, here, after] = [i - 1, i, i + 1].map(|k| &dive.positions[k * n_q..(k + 1) * n_q]);
        model.difference(before, after, &mut v).unwrap();
        v.iter_mut().for_each(|x| *x /= dive.times[i + 1] - dive.times[i - 1]);
        let found = model.centroidal(&mut Data::new(&model), here).unwrap().momentum(&v).unwrap().angular;
        let off = (found - dive.angular_momentum).norm() / dive.angular_momentum.norm();
        assert!(off < 0.05, "{off} in frame {i}");
    }
    let [plain, faults] = [&plain, &dive].map(|d| d.faults(&model).unwrap());
    assert!((faults.entry_angle - plain.entry_angle - 0.2).abs() < 1e-6, "{faults:?}");
    assert!(
        faults.hip_opening > plain.hip_opening + 0.05 && faults.exit_fraction > plain.exit_fraction + 0.01
    );
    assert!(faults.roughness > plain.roughness);
}

#[test]
fn spatial_flights_are_aimed_too() {
    let diver = Diver::spatial();
    let model = diver.model().unwrap();
    // one somersault from posture A over H to A about the lateral axis, flown by itself
    let [a, h] = [somersault_multibody::models::Posture::A, somersault_multibody::models::Posture::H]
        .map(|p| diver.configuration(p).unwrap());
    let times: Vec<f64> = (0..=40).map(|i| f64::from(i) / 40.0).collect();
    let frame = |t: &f64| {
        let w = (std::f64::consts::PI * t).sin().powi(2);
        let mut q: Vec<f64> = a.iter().zip(&h).map(|(a, h)| a + w * (h - a)).collect();
        let half = std::f64::consts::PI * (t - (std::f64::consts::TAU * t).sin() / 12.0);
        q[..7].copy_from_slice(&[0.5 * t, 0.0, 1.0 + 4.0 * t * (1.0 - t), 0.0, half.sin(), 0.0, half.cos()]);
        q
    };
    let positions: Vec<f64> = times.iter().flat_map(frame).collect();
    let flight = SyntheticFlight::try_new(&model, &times, &positions).unwrap();
    for asymmetry in [0.0, 0.05] {
        let perturbation = Perturbation { over_rotation: -0.15, asymmetry, ..Perturbation::none() };
        let dive = flight.perturb(&perturbation).unwrap();
        let faults = DiveFaults::of(&model, &dive.times, &dive.positions).unwrap();
        println!("{faults:?}");
        assert_eq!(faults.asymmetry > 0.0, asymmetry > 0.0);
        assert!(dive.angular_momentum.y > 0.0 && faults.entry_angle > 0.05);
    }
}

/// Leave-one-out with as many components as sixty dives can bear.
fn validated(set: &SyntheticSet) -> Validation {
    let options = ScoringOptions { max_components: 12, ..ScoringOptions::thesis() };
    let resamples = ValidationOptions { n_resamples: 100, ..ValidationOptions::default() };
    validate(&set.performances().unwrap(), &set.scores, &options, &resamples, &[]).unwrap()
}

#[test]
fn scoring_recovers_the_synthetic_judge_within_his_noise() {
    let (set, judge) = judged(&SyntheticOptions::of(60));
    let rms = |a: &[f64], b: &[f64]| {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    };
    let found = validated(&set);
    let mean = set.intended.iter().sum::<f64>() / 60.0;
    println!(
        "scores {mean:.2} ± {:.2}, noise {}, error against the scores {:.3}, against what was meant {:.3}; {:?}; {:?}",
        rms(&set.intended, &[mean; 60]),
        judge.noise,
        found.rms_error,
        rms(&found.predictions, &set.intended),
        found.pearson,
        found.tunings,
    );
    // nearer to what the judge means than he is himself
    assert!(rms(&found.predictions, &set.intended) < judge.noise);
    assert!(found.rms_error < 1.5 * judge.noise && found.pearson.interval[0] > 0.5);
    assert!(found.pearson.p_value < 0.02 && found.spearman.p_value < 0.02);
    assert!(found.baselines.iter().all(|b| b.rms_error > 1.5 * found.rms_error));
}

#[test]
fn sets_come_again_to_the_bit_and_are_labelled() {
    let options = SyntheticOptions::of(14);
    let (set, _) = judged(&options);
    assert_eq!(set, judged(&options).0);
    assert_ne!(set.scores, judged(&SyntheticOptions { seed: 1, ..options }).0.scores);
    let performances = set.performances().unwrap();
    assert!(performances.iter().all(|p| p.is_synthetic()));
    let model = ScoringModel::train(&performances, &set.scores, &ScoringOptions::thesis()).unwrap();
    let stored = model.to_json().unwrap();
    assert!(model.is_synthetic() && stored.contains("\"synthetic\": true"));
    assert!(ScoringModel::from_json(&stored).unwrap().is_synthetic());
}

#[test]
fn what_cannot_be_perturbed_is_refused() {
    let (motion, _) = &*FORWARD_PIKE;
    let (model, flight) = (planar(), flight());
    let perturb = |p: Perturbation| flight.perturb(&p).map(drop).unwrap_err();
    let none = Perturbation::none();
    let late = perturb(Perturbation { exit_delay: 1.0, ..none });
    assert!(matches!(late, SyntheticError::ExitDelay { found: 1.0, .. }), "{late}");
    let loose = perturb(Perturbation { looseness: f64::NAN, ..none });
    assert!(
        matches!(loose, SyntheticError::Argument(ArgumentError::OutOfRange { argument: "looseness", .. })),
        "{loose}"
    );
    let over = perturb(Perturbation { over_rotation: f64::INFINITY, ..none });
    assert!(matches!(
        over,
        SyntheticError::Argument(ArgumentError::NonFinite { argument: "over_rotation", .. })
    ));
    let new = |times: &[f64], positions: &[f64]| SyntheticFlight::try_new(&model, times, positions).map(drop);
    let short = new(&motion.times, &motion.positions[1..]).unwrap_err();
    assert!(matches!(short, SyntheticError::Argument(ArgumentError::Length { argument: "positions", .. })));
    assert!(matches!(
        new(&[0.0; 3], &[]),
        Err(SyntheticError::Argument(ArgumentError::TooFew { least: 5, .. }))
    ));
    assert!(matches!(new(&[0.0; 5], &[0.0; 60]), Err(SyntheticError::Recording(_))));
    let times: Vec<f64> = (0..5).map(f64::from).collect();
    assert!(matches!(new(&times, &[0.0; 60]), Err(SyntheticError::NoFold)));
    let markers = MarkerSet::joint_centres(&model).unwrap();
    let noise = synthetic_markers(&model, &markers, &motion.times, &motion.positions, -1.0, 0);
    assert!(matches!(
        noise,
        Err(SyntheticError::Argument(ArgumentError::Negative { argument: "noise", .. }))
    ));
    let (judge, options) = (judged(&SyntheticOptions::of(1)).1, SyntheticOptions::of(0));
    let none = SyntheticSet::generate(&flight, &markers, &judge, &options);
    assert!(matches!(none, Err(SyntheticError::Argument(ArgumentError::TooFew { argument: "n_dives", .. }))));
}
