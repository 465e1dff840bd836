//! Groups of motions side by side, and the generated dive among them: Figure 4.1 and thesis 4.2.1.

use crate::synthetic::{FORWARD_PIKE, flight, judged, planar};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::ArgumentError;
use somersault_motion::analysis::{AnalysisError, GroupComparison, Panel, somersaults};
use somersault_motion::fit::{FitOptions, FitStatus, FrameFit, MarkerFit, MarkerSet, MotionFit, Shape};
use somersault_motion::recording::MarkerRecording;
use somersault_motion::scoring::{Performance, ScoringModel, ScoringOptions};
use somersault_motion::synthetic::{Perturbation, SyntheticOptions, synthetic_markers};
use somersault_multibody::joint_motion::EigenpostureBase;
use somersault_multibody::models::{Diver, Posture};
use std::f64::consts::{PI, TAU};

#[test]
fn somersaults_are_counted_whatever_heading_and_twist() {
    let model = Diver::spatial().model().unwrap();
    let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    let share = |i: i32| f64::from(i) / 60.0;
    let configurations: Vec<Vec<f64>> = (0..=60)
        .map(|i| {
            let t = share(i);
            // three and a half somersaults with two twists and a tilt in between, heading to the left
            let r = about(Vector3::z_axis(), 0.8)
                * about(Vector3::y_axis(), 7.0 * PI * t)
                * about(Vector3::x_axis(), 0.3 * (PI * t).sin())
                * about(Vector3::z_axis(), 2.0 * TAU * t);
            let mut q = model.neutral();
            q[3..7].copy_from_slice(r.coords.as_slice());
            q
        })
        .collect();
    let slices: Vec<&[f64]> = configurations.iter().map(Vec::as_slice).collect();
    let turns = somersaults(&model, &slices).unwrap().unwrap();
    for (i, found) in turns.iter().enumerate() {
        assert!((found - 3.5 * share(i as i32)).abs() < 1e-12, "frame {i}: {found}");
    }
    let mut q = model.neutral();
    q[3..7].fill(0.0);
    let found = somersaults(&model, &[&model.neutral(), &q]);
    assert_eq!(found, Err(AnalysisError::NotARotation { row: 1, found: 0.0 }));
    assert!(matches!(
        somersaults(&model, &[&q[1..]]),
        Err(AnalysisError::Argument(ArgumentError::Length { .. }))
    ));

    let model = planar();
    let mut configurations = [model.neutral(), model.neutral(), model.neutral()];
    (configurations[0][2], configurations[1][2], configurations[2][2]) = (0.5, 0.5 - TAU, 0.5 + 1.5 * TAU);
    let slices: Vec<&[f64]> = configurations.iter().map(Vec::as_slice).collect();
    let turns = somersaults(&model, &slices).unwrap().unwrap();
    assert!((turns[1] - 1.0).abs() < 1e-15 && (turns[2] + 1.5).abs() < 1e-15 && turns[0] == 0.0);
    let held = somersault_multibody::models::TwoLinkArm::default().model().unwrap();
    assert_eq!(somersaults(&held, &[&held.neutral()]), Ok(None));
}

/// A motion of 31 frames whose panels are polynomials of the fraction u: the weight a u², the error 0.01 u, the
/// scale 1 + a u³, and 2 a u turns.
fn made(a: f64, duration: f64) -> MotionFit {
    let times: Vec<f64> = (0..=30).map(|i| duration * f64::from(i) / 30.0).collect();
    let frame = |t: &f64| {
        let u = t / duration;
        let mut q = planar().neutral();
        q[2] = -TAU * 2.0 * a * u;
        let estimate =
            somersault_motion::fit::Estimate { scale: 1.0 + a * u.powi(3), q, weights: vec![a * u * u] };
        FrameFit {
            status: FitStatus::Converged,
            estimate,
            residuals: vec![Some(0.01 * u)],
            rms: Some(0.01 * u),
            cost: 0.0,
            iterations: 1,
            unknowns: Vec::new(),
            covariance: None,
        }
    };
    MotionFit { frames: times.iter().map(frame).collect(), times, scale_converged: true }
}

#[test]
fn the_four_panels_are_mean_and_spread_in_closed_form() {
    let model = planar();
    // two groups of other durations: of a = 0.2, 0.3 and 0.7, and of a = 0.5 alone
    let (first, second) = ([made(0.2, 1.0), made(0.3, 1.5), made(0.7, 1.7)], [made(0.5, 2.0)]);
    let first: Vec<&MotionFit> = first.iter().collect();
    let second: Vec<&MotionFit> = second.iter().collect();
    let (mean, deviation) = (0.4, 0.07_f64.sqrt());
    type Expected = fn(f64, f64) -> f64;
    let panels: [(Panel, Expected, Expected); 4] = [
        (Panel::Eigenweight(0), |a, u| a * u * u, |d, u| d * u * u),
        (Panel::MarkerError, |_, u| 0.01 * u, |_, _| 0.0),
        (Panel::Scale, |a, u| 1.0 + a * u.powi(3), |d, u| d * u.powi(3)),
        (Panel::Rotation, |a, u| 2.0 * a * u, |d, u| 2.0 * d * u),
    ];
    for (panel, value, spread) in panels {
        let found = GroupComparison::try_new(&model, &[&first, &second], panel, 60).unwrap();
        assert_eq!(found.panel(), panel);
        assert_eq!(found.series().next().unwrap().shape(), (3, 60));
        let bands = found.bands().unwrap();
        for i in 0..60 {
            let u = i as f64 / 59.0;
            for (band, (a, d)) in bands.iter().zip([(mean, deviation), (0.5, 0.0)]) {
                assert!((band.mean[i] - value(a, u)).abs() < 1e-12, "{panel:?} in frame {i}");
                assert!((band.deviation[i] - spread(d, u)).abs() < 1e-12, "{panel:?} in frame {i}");
            }
        }
    }
    let none = GroupComparison::try_new(&model, &[&first], Panel::Eigenweight(1), 60);
    assert!(matches!(
        none,
        Err(AnalysisError::Argument(ArgumentError::TooFew { argument: "weights", least: 2, found: 1 }))
    ));
    let held = somersault_multibody::models::TwoLinkArm::default().model().unwrap();
    let none = GroupComparison::try_new(&held, &[&first], Panel::Rotation, 60);
    assert!(matches!(none, Err(AnalysisError::Held)));
    let empty = GroupComparison::try_new(&model, &[&first, &[]], Panel::Scale, 60).unwrap().bands();
    assert!(matches!(empty, Err(AnalysisError::Argument(ArgumentError::TooFew { argument: "series", .. }))));
}

#[test]
fn frames_without_markers_are_left_out_of_the_panels() {
    let (whole, mut gapped) = (made(0.4, 1.2), made(0.4, 1.2));
    gapped.frames[11].rms = None;
    gapped.frames[11].estimate.scale = 77.0;
    let [a, b] = [whole, gapped].map(|motion| {
        GroupComparison::try_new(&planar(), &[&[&motion]], Panel::Scale, 60).unwrap().series().next().unwrap()
    });
    assert!((a - b).amax() < 1e-12);
}

/// Thesis 4.2: the planar diver within postures A and H laid over the markers of a motion.
fn mapped(recording: &MarkerRecording) -> MotionFit {
    let (model, diver) = (planar(), Diver::planar());
    let postures = [Posture::A, Posture::H].map(|p| diver.configuration(p).unwrap()[3..].to_vec());
    let shape = Shape::Eigenpostures(EigenpostureBase::try_new(&postures).unwrap());
    let options = FitOptions { shape, ..FitOptions::default() };
    let markers = MarkerSet::joint_centres(&model).unwrap();
    MarkerFit::try_new(&model, markers, options).unwrap().fit(recording).unwrap()
}

#[test]
fn the_generated_dive_is_scored_and_compared_with_synthetic_groups() {
    let (motion, report) = &*FORWARD_PIKE;
    let model = planar();
    let (set, judge) = judged(&SyntheticOptions::of(24));
    let markers = MarkerSet::joint_centres(&model).unwrap();
    let generated = synthetic_markers(&model, &markers, &motion.times, &motion.positions, 0.0, 0).unwrap();

    // scored by a model of the synthetic set: without faults, it comes out at the top
    let scoring =
        ScoringModel::train(&set.performances().unwrap(), &set.scores, &ScoringOptions::thesis()).unwrap();
    let score = scoring.score(&Performance::from_markers(&generated).unwrap()).unwrap().value;
    let best = set.intended.iter().copied().fold(f64::MIN, f64::max);
    println!(
        "SYNTHETIC score of the generated dive {score:.2}; the best of the set was meant to have {best:.2}"
    );
    assert!(score > best - 2.0 * judge.noise, "{score} against {best}");

    // best and worst of the set against the generated dive, mapped onto the postures it was made of
    let mut order: Vec<usize> = (0..24).collect();
    order.sort_by(|&a, &b| set.scores[b].total_cmp(&set.scores[a]));
    let fits: Vec<MotionFit> = order.iter().map(|&i| mapped(&set.markers[i])).collect();
    let (best, worst): (Vec<_>, Vec<_>) = (fits[..4].iter().collect(), fits[20..].iter().collect());
    let generated = mapped(&generated);
    assert!(generated.rms().unwrap() < 1e-6, "its postures are those of the base: {:?}", generated.rms());
    let compare = |panel| {
        let groups: [&[&MotionFit]; 3] = [&best, &worst, &[&generated]];
        let bands = GroupComparison::try_new(&model, &groups, panel, 60).unwrap().bands().unwrap();
        bands.into_iter().map(|band| band.mean).collect::<Vec<_>>()
    };
    let weights = compare(Panel::Eigenweight(0));
    let n = motion.times.len();
    for (i, weight) in weights[2].iter().enumerate() {
        // the weights that the dive was made of
        let at = i as f64 / 59.0 * (n - 1) as f64;
        let (k, part) = (at.floor().min((n - 2) as f64) as usize, at - at.floor().min((n - 2) as f64));
        let expected = motion.channels[k] + part * (motion.channels[k + 1] - motion.channels[k]);
        assert!((weight - expected).abs() < 0.01, "frame {i}: {weight} for {expected}");
    }
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    // 4.2.1: the tighter pike has the larger weight, and the worst group is the loosest
    assert!(mean(&weights[2]) > mean(&weights[1]) && mean(&weights[0]) > mean(&weights[1]));
    let turns = compare(Panel::Rotation);
    // counted from the first frame, which leans forward by 10° already
    assert!((turns[2][59] - (report.somersaults - 10.0 / 360.0)).abs() < 1e-6, "{}", turns[2][59]);
    let (scale, error) = (compare(Panel::Scale), compare(Panel::MarkerError));
    assert!(scale[2].iter().all(|s| (s - 1.0).abs() < 1e-6) && error[2].iter().all(|e| *e < 1e-6));
    assert!(error[0].iter().all(|e| *e > 0.0 && *e < 0.05));
}

#[test]
fn groups_differ_where_their_flights_do() {
    // exits 40 ms late against exits in time, without other differences: the weights of the late ones are larger at the exit
    let (model, flight) = (planar(), flight());
    let markers = MarkerSet::joint_centres(&model).unwrap();
    let fit = |exit_delay: f64, seed: u64| {
        let dive = flight.perturb(&Perturbation { exit_delay, ..Perturbation::none() }).unwrap();
        mapped(&dive.markers(&model, &markers, 0.005, seed).unwrap())
    };
    let (early, late) = ([fit(0.0, 1), fit(0.0, 2)], [fit(0.04, 3), fit(0.04, 4)]);
    let groups: [Vec<&MotionFit>; 2] = [early.iter().collect(), late.iter().collect()];
    let groups: [&[&MotionFit]; 2] = [&groups[0], &groups[1]];
    let found = GroupComparison::try_new(&model, &groups, Panel::Eigenweight(0), 60).unwrap();
    let bands = found.bands().unwrap();
    let difference = |i: &usize| bands[1].mean[*i] - bands[0].mean[*i];
    let widest = (0..60).max_by(|a, b| difference(a).total_cmp(&difference(b))).unwrap();
    println!("the weights differ most in frame {widest} of 60, by {:.3}", difference(&widest));
    assert!(difference(&widest) > 0.1 && widest > 40, "at the exit, not in frame {widest}");
    assert!((0..30).all(|i| difference(&i).abs() < 0.05), "the first half is the same");
}
