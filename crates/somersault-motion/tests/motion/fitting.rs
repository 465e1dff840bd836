//! Fits recover what made the markers, and err as much as linearisation says.

use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use somersault_core::argument::ArgumentError;
use somersault_motion::fit::{
    FitError, FitOptions, FitStatus, FrameFit, Loss, Marker, MarkerFit, MarkerSet, MotionFit, Scale, Shape,
    UnknownStatus,
};
use somersault_motion::recording::MarkerRecording;
use somersault_multibody::joint_motion::EigenpostureBase;
use somersault_multibody::models::{Diver, Posture};
use somersault_multibody::{Data, Joint, Link, MassProperties, Model, ModelBuilder};

/// Two markers on each body with an extent, off the axis so that every joint is seen.
fn markers(model: &Model) -> MarkerSet {
    let on =
        |name: &str| !["waist", "shoulder_flexion", "shoulder_abduction"].iter().any(|n| name.ends_with(n));
    let bodies: Vec<String> = model.links().iter().map(|l| l.name().to_owned()).filter(|n| on(n)).collect();
    let points = [[0.03, 0.05, -0.02], [0.06, -0.03, -0.11]];
    let all = bodies.iter().flat_map(|b| [0, 1].map(|k| (format!("{b} {k}"), b.clone(), points[k])));
    MarkerSet::on_bodies(model, all).unwrap()
}

/// A somersault with a twist from one posture to another and back.
fn motion(diver: &Diver, n_frames: usize) -> Vec<Vec<f64>> {
    let model = diver.model().unwrap();
    let [a, c] = [Posture::A, Posture::H].map(|p| diver.configuration(p).unwrap());
    let planar = model.n_positions() == 12;
    let root = if planar { 3 } else { 7 };
    let frame = |i: usize| {
        let t = i as f64 / n_frames as f64;
        let mix = 0.1 + 0.7 * (std::f64::consts::PI * t).sin().powi(2);
        let mut q: Vec<f64> = a.iter().zip(&c).map(|(a, c)| a + mix * (c - a)).collect();
        // off the ends of ranges, where bounds would help
        for (k, x) in q[root..].iter_mut().enumerate() {
            *x += 0.08 + 0.02 * (k as f64 + 4.0 * t).sin();
        }
        let turn = -5.0 * t;
        if planar {
            (q[0], q[1], q[2]) = (1.5 * t, 1.0 + 3.0 * t - 5.0 * t * t, turn);
        } else {
            let r = nalgebra::UnitQuaternion::from_euler_angles(0.1, -turn, 2.0 * t);
            q[..3].copy_from_slice(&[1.5 * t, 0.1 * t, 1.0 + 3.0 * t - 5.0 * t * t]);
            q[3..7].copy_from_slice(r.coords.as_slice());
        }
        q
    };
    (0..n_frames).map(frame).collect()
}

/// The markers of a model of size `scale` along a motion, with noise.
fn record(
    model: &Model,
    set: &MarkerSet,
    motion: &[Vec<f64>],
    scale: f64,
    noise: f64,
    seed: u64,
) -> MarkerRecording {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut data = Data::new(model);
    let mut points = Vec::new();
    for q in motion {
        let positions = model.positions(&mut data, q).unwrap();
        let root = positions.pose(0).unwrap().translation;
        for marker in set.markers() {
            let arm = positions.pose(marker.body).unwrap().point(&marker.point) - root;
            points.push(Some(root + arm * scale + Vector3::from_fn(|_, _| noise * normal(&mut rng))));
        }
    }
    let names = set.markers().iter().map(|m| m.name.clone()).collect();
    let times = (0..motion.len()).map(|i| i as f64 / 60.0).collect();
    MarkerRecording::try_new(names, times, points).unwrap()
}

/// Box and Muller.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Each marker is missing in a frame with the given chance.
fn with_gaps(recording: &MarkerRecording, chance: f64, seed: u64) -> MarkerRecording {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let points = recording.frames().flatten().map(|p| p.filter(|_| rng.random_range(0.0..1.0) >= chance));
    MarkerRecording::try_new(recording.names().to_vec(), recording.times().to_vec(), points.collect())
        .unwrap()
}

/// The largest |from the true configuration, along v|.
fn largest_error(model: &Model, fit: &MotionFit, motion: &[Vec<f64>]) -> f64 {
    let mut v = vec![0.0; model.n_velocities()];
    let mut largest = 0.0_f64;
    for (frame, q) in fit.frames.iter().zip(motion) {
        model.difference(q, &frame.estimate.q, &mut v).unwrap();
        largest = v.iter().fold(largest, |a, x| a.max(x.abs()));
    }
    largest
}

/// The first frame is begun from standing and from a tuck.
fn begun(diver: &Diver) -> FitOptions {
    let root = if *diver == Diver::planar() { 3 } else { 7 };
    let starts = [Posture::A, Posture::H].map(|p| diver.configuration(p).unwrap()[root..].to_vec());
    FitOptions { starts: starts.to_vec(), ..FitOptions::default() }
}

fn divers() -> [Diver; 2] {
    [Diver::planar(), Diver::spatial()]
}

#[test]
fn known_angles_are_recovered_to_1e_6() {
    for diver in divers() {
        let (model, motion) = (diver.model().unwrap(), motion(&diver, 60));
        let set = markers(&model);
        let recording = record(&model, &set, &motion, 1.08, 0.0, 1);
        let start = std::time::Instant::now();
        let fit = MarkerFit::try_new(&model, set, begun(&diver)).unwrap().fit(&recording).unwrap();
        println!("{:?}: {} markers in {:?}", diver.dimension, recording.n_markers(), start.elapsed());
        assert!(fit.converged() && fit.success());
        let error = largest_error(&model, &fit, &motion);
        assert!(error < 1e-6, "{:?}: {error:e}", diver.dimension);
        assert!(fit.frames.iter().all(|f| (f.estimate.scale - 1.08).abs() < 1e-8));
        println!("{:?}: largest error {error:.1e}, rms {:.1e} m", diver.dimension, fit.rms().unwrap());
    }
}

#[test]
fn a_fifth_of_the_markers_may_be_missing() {
    for diver in divers() {
        let (model, motion) = (diver.model().unwrap(), motion(&diver, 60));
        let set = markers(&model);
        let whole = record(&model, &set, &motion, 1.0, 0.0, 1);
        let recording = with_gaps(&whole, 0.2, 7);
        let fit = MarkerFit::try_new(&model, set, begun(&diver)).unwrap().fit(&recording).unwrap();
        assert!(fit.converged());
        // a frame without the markers of a hand cannot know its angle, and knows all others
        let (mut n_whole, mut v) = (0, vec![0.0; model.n_velocities()]);
        for (frame, q) in fit.frames.iter().zip(&motion) {
            assert!(frame.rms.unwrap() < 1e-8);
            n_whole += usize::from(frame.success());
            let covariance = frame.covariance.as_ref().unwrap();
            model.difference(q, &frame.estimate.q, &mut v).unwrap();
            for (k, x) in v.iter().enumerate() {
                match frame.unknowns[k + 1] {
                    UnknownStatus::Undetermined => assert_eq!(covariance[(k + 1, k + 1)], f64::INFINITY),
                    status => {
                        assert!(x.abs() < 1e-6 && covariance[(k + 1, k + 1)].is_finite(), "{status:?}: {x}")
                    }
                }
            }
        }
        assert!(n_whole > 10, "{:?}: {n_whole} frames are determined", diver.dimension);
        assert!(n_whole < 60 && !fit.success());
    }
}

/// Twenty markers: one on each body with an extent, which hardly see hands and toes, and three more.
fn few_markers(model: &Model) -> MarkerSet {
    let all = markers(model).markers().to_vec();
    let [first, second] = [0, 1].map(|k| all.iter().skip(k).step_by(2).cloned());
    MarkerSet::try_new(model, first.chain(second).take(20).collect()).unwrap()
}

#[test]
fn frames_are_not_left_in_wrong_minima() {
    let diver = Diver::spatial();
    let (model, motion) = (diver.model().unwrap(), motion(&diver, 60));
    let set = few_markers(&model);
    for (noise, seed) in [(0.002, 1), (0.005, 2), (0.01, 3)] {
        let recording = record(&model, &set, &motion, 1.0, noise, seed);
        let with = |starts| FitOptions { scale: Scale::Fixed(1.0), starts, ..FitOptions::default() };
        let fit = MarkerFit::try_new(&model, set.clone(), with(Vec::new())).unwrap().fit(&recording).unwrap();
        let ratio = |(i, q): (usize, &Vec<f64>)| {
            let points = recording.frames().nth(i).unwrap().to_vec();
            let alone = MarkerRecording::try_new(recording.names().to_vec(), vec![0.0], points).unwrap();
            let from_truth = MarkerFit::try_new(&model, set.clone(), with(vec![q[7..].to_vec()])).unwrap();
            fit.frames[i].rms.unwrap() / from_truth.fit(&alone).unwrap().frames[0].rms.unwrap()
        };
        let ratios: Vec<f64> = motion.iter().enumerate().map(ratio).collect();
        let largest = ratios.iter().fold(0.0_f64, |a, r| a.max(*r));
        println!("{noise} m: largest residual {largest:.3} of that from the truth");
        assert!(largest < 1.03, "{noise} m, seed {seed}: residuals up to {largest} of those from the truth");
    }
}

#[test]
fn with_noise_estimates_are_unbiased_and_within_the_linearised_covariance() {
    const NOISE: f64 = 0.01;
    for diver in divers() {
        let model = diver.model().unwrap();
        // one pose repeatedly, each time with other noise
        let mut q = motion(&diver, 60).swap_remove(20);
        for (k, limits, at) in
            (1..model.n_bodies()).filter_map(|i| Some((i, model.limits(i)?, model.positions_of(i))))
        {
            // noise must not reach a bound, which would cut the estimates off
            if near_bound(&model, &q, model.velocities_of(k).start, 0.45) {
                q[at.start] = 0.5 * (limits[0] + limits[1]);
            }
        }
        let repeats = vec![q; 400];
        let set = markers(&model);
        let recording = record(&model, &set, &repeats, 1.0, NOISE, 5);
        let options = FitOptions { noise: Some(NOISE), ..begun(&diver) };
        let fit = MarkerFit::try_new(&model, set, options).unwrap().fit(&recording).unwrap();
        assert!(fit.converged());
        let n = fit.frames.len() as f64;
        let mut v = vec![0.0; model.n_velocities()];
        let (mut sum, mut squares) = (v.clone(), v.clone());
        let mut predicted = v.clone();
        for frame in &fit.frames {
            model.difference(&repeats[0], &frame.estimate.q, &mut v).unwrap();
            let covariance = frame.covariance.as_ref().unwrap();
            for k in 0..v.len() {
                sum[k] += v[k] / n;
                squares[k] += v[k] * v[k] / n;
                predicted[k] += covariance[(k + 1, k + 1)] / n;
            }
        }
        for k in 0..v.len() {
            let deviation = predicted[k].sqrt();
            let name = diver.dof_names()[k];
            assert!(!near_bound(&model, &repeats[0], k, 4.0 * deviation), "{name} may reach a bound");
            let ratio = (squares[k] / predicted[k]).sqrt();
            // 400 repeats: the mean errs by 0.05, a deviation by 0.035 of itself; each is allowed five of those
            assert!(sum[k].abs() < 0.25 * deviation, "{name}: mean {} of {deviation}", sum[k]);
            assert!((ratio - 1.0).abs() < 0.18, "{name}: {ratio} of the predicted {deviation}");
        }
    }
}

/// Whether the coordinate of degree of freedom `k` is that near to one of its limits.
fn near_bound(model: &Model, q: &[f64], k: usize, distance: f64) -> bool {
    (1..model.n_bodies()).any(|i| {
        let here = model.velocities_of(i).start == k && model.positions_of(i).len() == 1;
        here && model.limits(i).is_some_and(|[lower, upper]| {
            let x = q[model.positions_of(i).start];
            x - lower < distance || upper - x < distance
        })
    })
}

#[test]
fn eigenweights_are_recovered_within_their_simplex() {
    let diver = Diver::planar();
    let model = diver.model().unwrap();
    let postures = [Posture::PLANAR[0], Posture::PLANAR[1], Posture::PLANAR[2]]
        .map(|p| diver.configuration(p).unwrap()[3..].to_vec());
    let base = EigenpostureBase::try_new(&postures).unwrap();
    let weights: Vec<[f64; 2]> = (0..30).map(|i| f64::from(i) / 30.0).map(|t| [(1.0 - t) * 0.9, t]).collect();
    let motion: Vec<Vec<f64>> = weights
        .iter()
        .map(|w| {
            let mut q = vec![0.3, 1.0, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            base.positions_into(w, &mut q[3..]);
            q
        })
        .collect();
    let set = markers(&model);
    let recording = record(&model, &set, &motion, 0.95, 0.0, 1);
    let options = FitOptions { shape: Shape::Eigenpostures(base), ..FitOptions::default() };
    let fit = MarkerFit::try_new(&model, set.clone(), options.clone()).unwrap().fit(&recording).unwrap();
    for (frame, expected) in fit.frames.iter().zip(&weights) {
        assert_eq!(frame.status, FitStatus::Converged);
        for (found, expected) in frame.estimate.weights.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
    }
    let noisy = record(&model, &set, &motion, 0.95, 0.03, 1);
    let fit = MarkerFit::try_new(&model, set, options).unwrap().fit(&noisy).unwrap();
    for frame in &fit.frames {
        let weights = &frame.estimate.weights;
        assert!(weights.iter().all(|w| *w >= 0.0) && weights.iter().sum::<f64>() <= 1.0 + 1e-12);
    }
}

#[test]
fn a_scale_common_to_all_frames_is_found() {
    let diver = Diver::spatial();
    let (model, motion) = (diver.model().unwrap(), motion(&diver, 20));
    let set = markers(&model);
    let recording = record(&model, &set, &motion, 1.13, 0.005, 3);
    let options = FitOptions { scale: Scale::Common { lower: 0.7, upper: 1.5 }, ..begun(&diver) };
    let fit = MarkerFit::try_new(&model, set.clone(), options).unwrap().fit(&recording).unwrap();
    assert!(fit.scale_converged);
    let scale = fit.frames[0].estimate.scale;
    assert!(fit.frames.iter().all(|f| f.estimate.scale == scale));
    assert!((scale - 1.13).abs() < 0.005, "{scale}");
    // no other scale has a smaller sum
    let cost = |scale: f64| -> f64 {
        let options = FitOptions { scale: Scale::Fixed(scale), ..begun(&diver) };
        let fit = MarkerFit::try_new(&model, set.clone(), options).unwrap().fit(&recording).unwrap();
        fit.frames.iter().map(|f| f.cost).sum()
    };
    let least: f64 = fit.frames.iter().map(|f| f.cost).sum();
    assert!(least <= cost(scale + 1e-4) && least <= cost(scale - 1e-4));
}

#[test]
fn robust_losses_survive_swapped_markers() {
    let diver = Diver::planar();
    let (model, motion) = (diver.model().unwrap(), motion(&diver, 30));
    let set = markers(&model);
    let whole = record(&model, &set, &motion, 1.0, 0.001, 1);
    // one marker is a metre off in every frame
    let n = whole.n_markers();
    let points = whole
        .frames()
        .flatten()
        .enumerate()
        .map(|(i, p)| p.map(|p| if i % n == 5 { p + Vector3::new(0.6, 0.0, 0.8) } else { p }));
    let recording =
        MarkerRecording::try_new(whole.names().to_vec(), whole.times().to_vec(), points.collect()).unwrap();
    let error = |loss| {
        let options = FitOptions { loss, scale: Scale::Fixed(1.0), ..begun(&diver) };
        let fit = MarkerFit::try_new(&model, set.clone(), options).unwrap().fit(&recording).unwrap();
        largest_error(&model, &fit, &motion)
    };
    let (squares, huber, cauchy) =
        (error(Loss::Squares), error(Loss::Huber(0.01)), error(Loss::Cauchy(0.01)));
    println!("largest errors: squares {squares:.3}, Huber {huber:.3}, Cauchy {cauchy:.3}");
    assert!(squares > 0.3 && huber < 0.5 * squares && cauchy < 0.1);
}

#[test]
fn frames_without_markers_keep_the_last_estimate() {
    let diver = Diver::planar();
    let (model, motion) = (diver.model().unwrap(), motion(&diver, 10));
    let set = markers(&model);
    let whole = record(&model, &set, &motion, 1.0, 0.0, 1);
    let n = whole.n_markers();
    let points = whole.frames().flatten().enumerate().map(|(i, p)| p.filter(|_| i / n != 4));
    let recording =
        MarkerRecording::try_new(whole.names().to_vec(), whole.times().to_vec(), points.collect()).unwrap();
    let fit = MarkerFit::try_new(&model, set, begun(&diver)).unwrap().fit(&recording).unwrap();
    assert_eq!(fit.frames[4].status, FitStatus::NoMarkers);
    assert_eq!((fit.frames[4].rms, &fit.frames[4].covariance), (None, &None));
    assert_eq!(fit.frames[4].estimate, fit.frames[3].estimate);
    assert!(fit.frames[5].rms.unwrap() < 1e-8);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let model = Diver::planar().model().unwrap();
    let set = markers(&model);
    let with = |options| MarkerFit::try_new(&model, set.clone(), options).map(drop);
    let options = FitOptions::default;
    let scale = Scale::PerFrame { lower: 2.0, upper: 1.0 };
    let found = with(FitOptions { scale, ..options() });
    assert_eq!(found, Err(FitError::ScaleBounds { lower: 2.0, upper: 1.0 }));
    let found = with(FitOptions { loss: Loss::Huber(-1.0), ..options() });
    assert_eq!(
        found,
        Err(FitError::Argument(ArgumentError::NotPositive { argument: "threshold", found: -1.0 }))
    );
    let found = with(FitOptions { starts: vec![vec![0.0; 3]], ..options() });
    assert_eq!(
        found,
        Err(FitError::Argument(ArgumentError::Length { argument: "starts", expected: 9, found: 3 }))
    );
    let base = EigenpostureBase::try_new(&[[0.0, 0.0], [1.0, 0.0]]).unwrap();
    let found = with(FitOptions { shape: Shape::Eigenpostures(base), ..options() });
    assert_eq!(
        found,
        Err(FitError::Argument(ArgumentError::Length {
            argument: "postures of the base",
            expected: 9,
            found: 2
        }))
    );
    let other = MarkerRecording::try_new(vec!["nose".into()], vec![0.0], vec![None]).unwrap();
    let found = MarkerFit::try_new(&model, set.clone(), options()).unwrap().fit(&other);
    assert!(matches!(found, Err(FitError::NoCommonMarker { .. })));
    assert_eq!(MarkerSet::try_new(&model, vec![]), Err(FitError::NoMarkers));
    let mut chin = Marker { name: "chin".to_owned(), body: 0, point: Vector3::zeros(), weight: -1.0 };
    let found = MarkerSet::try_new(&model, vec![chin.clone()]).unwrap_err();
    assert_eq!(found.to_string(), "marker `chin`: `weight` must be positive and finite, found -1");
    chin.body = 99;
    let found = MarkerSet::try_new(&model, vec![chin]).unwrap_err();
    assert!(found.to_string().starts_with("marker `chin`: "), "{found}");
    let unknown = MarkerSet::on_bodies(&model, [("a", "wing", [0.0; 3])]);
    assert!(matches!(unknown, Err(FitError::Model(_))));
}

/// The frame of a recording alone, begun as `options` say.
fn alone(model: &Model, set: &MarkerSet, recording: &MarkerRecording, i: usize, options: FitOptions) -> f64 {
    let (names, points) = (recording.names().to_vec(), recording.frame(i).unwrap().to_vec());
    let one = MarkerRecording::try_new(names, vec![0.0], points).unwrap();
    MarkerFit::try_new(model, set.clone(), options).unwrap().fit(&one).unwrap().rms().unwrap()
}

#[test]
fn postures_of_the_tables_are_found_without_starts() {
    for (diver, postures) in [(Diver::planar(), &Posture::PLANAR[..]), (Diver::spatial(), &Posture::ALL[..])]
    {
        let model = diver.model().unwrap();
        for set in [markers(&model), MarkerSet::joint_centres(&model).unwrap()] {
            for posture in postures {
                let q = diver.configuration(*posture).unwrap();
                let recording = record(&model, &set, &[q], 1.0, 0.0, 1);
                let rms = alone(&model, &set, &recording, 0, FitOptions::default());
                let n = set.markers().len();
                assert!(rms < 1e-8, "{:?}, {posture:?}, {n} markers: {rms:e} m", diver.dimension);
            }
        }
    }
}

#[test]
fn noise_of_1_cm_leads_no_frame_into_a_wrong_minimum() {
    for diver in divers() {
        let (model, motion) = (diver.model().unwrap(), motion(&diver, 60));
        let (set, root) = (markers(&model), model.positions_of(0).len());
        for seed in 1..=6 {
            let recording = record(&model, &set, &motion, 1.0, 0.01, seed);
            let from_truth = |(i, q): (usize, &Vec<f64>)| {
                let starts = vec![q[root..].to_vec()];
                alone(&model, &set, &recording, i, FitOptions { starts, ..FitOptions::default() })
            };
            let from_truth: Vec<f64> = motion.iter().enumerate().map(from_truth).collect();
            for options in [begun(&diver), FitOptions::default()] {
                let fit = MarkerFit::try_new(&model, set.clone(), options).unwrap().fit(&recording).unwrap();
                for (i, (frame, truth)) in fit.frames.iter().zip(&from_truth).enumerate() {
                    let rms = frame.rms.unwrap();
                    assert!(
                        rms < 1.02 * truth,
                        "{:?}, seed {seed}, frame {i}: {rms}, {truth} m",
                        diver.dimension
                    );
                }
            }
        }
    }
}

/// Poses that have nothing to do with each other: all joints anywhere in the middle nine tenths of their ranges.
fn unrelated(model: &Model, n: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let pose = |_| {
        let mut q = model.neutral();
        q[..3].copy_from_slice(&[
            rng.random_range(-1.0..1.0),
            rng.random_range(-1.0..1.0),
            rng.random_range(0.0..3.0),
        ]);
        let axis = Vector3::from_fn(|_, _| normal(&mut rng));
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(axis.normalize() * rng.random_range(0.0..3.1));
        q[3..7].copy_from_slice(turn.coords.as_slice());
        for i in 1..model.n_bodies() {
            let (at, limits) = (model.positions_of(i), model.limits(i));
            let [lower, upper] = limits.unwrap_or([-3.0, 3.0]);
            for x in &mut q[at] {
                *x = lower + (upper - lower) * rng.random_range(0.05..0.95);
            }
        }
        q
    };
    (0..n).map(pose).collect()
}

#[test]
fn unrelated_frames_are_fitted_no_worse_as_one_recording_than_one_by_one() {
    let diver = Diver::spatial();
    let model = diver.model().unwrap();
    let n = std::env::var("SOMERSAULT_FRAMES").map_or(24, |n| n.parse().expect("a number of frames"));
    for (set, noise, seed) in [(few_markers(&model), 0.005, 1), (markers(&model), 0.01, 2)] {
        let poses = unrelated(&model, n, seed);
        let recording = record(&model, &set, &poses, 1.0, noise, seed);
        let options = FitOptions { scale: Scale::Fixed(1.0), ..FitOptions::default() };
        let start = std::time::Instant::now();
        let fit = MarkerFit::try_new(&model, set.clone(), options.clone()).unwrap().fit(&recording).unwrap();
        let took = start.elapsed();
        assert!(fit.converged());
        let (mut worse, mut above, mut alone_above) = (0, 0, 0);
        for (i, q) in poses.iter().enumerate() {
            let by_itself = alone(&model, &set, &recording, i, options.clone());
            let starts = vec![q[7..].to_vec()];
            let truth = alone(&model, &set, &recording, i, FitOptions { starts, ..options.clone() });
            let rms = fit.frames[i].rms.unwrap();
            worse += usize::from(rms > 1.016 * by_itself);
            above += usize::from(rms > 1.02 * truth);
            alone_above += usize::from(by_itself > 1.02 * truth);
        }
        println!(
            "{} markers, {n} frames in {took:?}: {worse} worse than alone, {above} above the truth's residual, alone {alone_above}",
            set.markers().len()
        );
        // minima count as lower from 1.5 % of the residuals on
        assert_eq!(worse, 0);
        assert!(above <= alone_above);
    }
}

#[test]
fn an_unseen_toe_costs_only_its_own_covariance() {
    let diver = Diver::spatial();
    let (model, motion) = (diver.model().unwrap(), motion(&diver, 6));
    let whole_set = markers(&model);
    let toe = model.body("left_toes").unwrap();
    let seen: Vec<Marker> = whole_set.markers().iter().filter(|m| m.body != toe).cloned().collect();
    let set = MarkerSet::try_new(&model, seen).unwrap();
    let options = FitOptions { noise: Some(0.005), ..begun(&diver) };
    let recording = record(&model, &whole_set, &motion, 1.0, 0.005, 4);
    let fitted = |set: &MarkerSet| {
        MarkerFit::try_new(&model, set.clone(), options.clone()).unwrap().fit(&recording).unwrap()
    };
    let (fit, whole) = (fitted(&set), fitted(&whole_set));
    assert!(whole.success() && fit.converged() && !fit.success());
    let of_toe = 1 + model.velocities_of(toe).start;
    for (frame, other) in fit.frames.iter().zip(&whole.frames) {
        let (found, known) = (frame.covariance.as_ref().unwrap(), other.covariance.as_ref().unwrap());
        for k in 0..frame.unknowns.len() {
            if k == of_toe {
                assert_eq!((frame.unknowns[k], found[(k, k)]), (UnknownStatus::Undetermined, f64::INFINITY));
                continue;
            }
            assert_eq!(frame.unknowns[k], UnknownStatus::Determined, "unknown {k}");
            // two markers fewer say less, but not much less
            let ratio = found[(k, k)] / known[(k, k)];
            assert!((0.95..2.0).contains(&ratio), "unknown {k}: {ratio}");
            assert_eq!(found[(k, of_toe)], 0.0);
        }
    }
}

#[test]
fn what_is_no_success_is_told_apart() {
    for diver in divers() {
        let (model, motion) = (diver.model().unwrap(), motion(&diver, 12));
        let set = markers(&model);
        let whole = record(&model, &set, &motion, 1.0, 0.002, 1);
        let with = |change: &dyn Fn(usize, usize, Vector3<f64>) -> Option<Vector3<f64>>,
                    options: FitOptions| {
            let n = whole.n_markers();
            let points = whole.frames().flatten().enumerate().map(|(k, p)| change(k / n, k % n, p.unwrap()));
            let recording =
                MarkerRecording::try_new(whole.names().to_vec(), whole.times().to_vec(), points.collect())
                    .unwrap();
            MarkerFit::try_new(&model, set.clone(), options).unwrap().fit(&recording).unwrap()
        };
        let known = FitOptions { noise: Some(0.002), ..begun(&diver) };
        let fit = with(&|_, _, p| Some(p), known.clone());
        assert!(fit.success() && fit.frames.iter().all(FrameFit::success), "{:?}", diver.dimension);
        // a frame without markers
        let fit = with(&|i, _, p| (i != 3).then_some(p), known.clone());
        assert_eq!(fit.frames[3].status, FitStatus::NoMarkers);
        assert!(fit.converged() && !fit.success() && fit.frames[2].success());
        assert!(fit.frames[3].unknowns.iter().all(|u| *u == UnknownStatus::Undetermined));
        // a mirrored axis: of the plane the diver moves in, in space any
        for axis in if diver == Diver::planar() { vec![0, 2] } else { vec![0, 1, 2] } {
            let mirrored = |_, _, mut p: Vector3<f64>| {
                p[axis] = -p[axis];
                Some(p)
            };
            for options in [known.clone(), begun(&diver)] {
                let fit = with(&mirrored, options);
                let status: Vec<FitStatus> = fit.frames.iter().map(|f| f.status).collect();
                assert!(
                    status.iter().all(|s| *s == FitStatus::Mirrored),
                    "{:?}, axis {axis}: {status:?}",
                    diver.dimension
                );
                assert!(!fit.success() && fit.rms().unwrap() > 0.02);
            }
        }
        // more noise than was said
        let fit = with(&|_, _, p| Some(p), FitOptions { noise: Some(0.0005), ..begun(&diver) });
        assert!(!fit.success() && fit.frames.iter().all(|f| f.status == FitStatus::Misfit));
        // too few iterations
        let fit = with(&|_, _, p| Some(p), FitOptions { max_iterations: 2, ..begun(&diver) });
        assert!(!fit.converged() && !fit.success());
    }
}

#[test]
fn limits_that_the_markers_contradict_are_told_from_those_they_confirm() {
    let diver = Diver::planar();
    let model = diver.model().unwrap();
    let knee = model.body("shank").unwrap();
    let [lower, _] = model.limits(knee).unwrap();
    let set = markers(&model);
    let options = FitOptions { noise: Some(0.002), scale: Scale::Fixed(1.0), ..begun(&diver) };
    // the markers of a free knee, which the limits of the diver do not hold
    let mut builder = ModelBuilder::new();
    for link in model.links() {
        let free = link.limits().map(|_| link.clone().with_limits(f64::NEG_INFINITY, f64::INFINITY));
        builder.add(free.unwrap_or_else(|| link.clone())).unwrap();
    }
    let free = builder.build().unwrap();
    for (beyond, expected) in [(0.0, UnknownStatus::AtLimit), (0.3, UnknownStatus::BeyondLimit)] {
        let mut q = motion(&diver, 12).swap_remove(5);
        q[model.positions_of(knee).start] = lower - beyond;
        let recording = record(&free, &set, &vec![q; 40], 1.0, 0.002, 3);
        let fit = MarkerFit::try_new(&model, set.clone(), options.clone()).unwrap().fit(&recording).unwrap();
        let of_knee = |f: &FrameFit| f.unknowns[1 + model.velocities_of(knee).start];
        let n = fit.frames.iter().filter(|f| of_knee(f) == expected).count();
        // of knees that are straight noise bends half
        assert!(if beyond > 0.0 { n == 40 } else { (8..=32).contains(&n) }, "{n} of 40 {expected:?}");
        assert!(fit.frames.iter().all(|f| f.unknowns[0] == UnknownStatus::Given));
        // of straight knees one in 740 is beyond three deviations
        let n_beyond = fit.frames.iter().filter(|f| of_knee(f) == UnknownStatus::BeyondLimit).count();
        assert!(if beyond > 0.0 { n_beyond == 40 } else { n_beyond <= 1 }, "{n_beyond} of 40 beyond");
    }
}

/// Of two hinges on one axis, which move the markers alike, a limit holds neither back and no marker determines either.
#[test]
fn limits_of_joints_that_others_stand_in_for_are_not_contradicted() {
    let part = || MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
    let hinge = || Joint::Revolute { axis: Vector3::z() };
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("trunk", Joint::Free, part())).unwrap();
    builder.add(Link::child("first", "trunk", hinge(), part()).at(Vector3::x() * 0.3)).unwrap();
    builder.add(Link::child("second", "first", hinge(), part()).with_limits(0.0, 1.0)).unwrap();
    let model = builder.build().unwrap();
    let points = [[0.0, 0.0, 0.1], [0.2, 0.1, 0.0], [-0.2, 0.1, 0.0]];
    let on_trunk = points.iter().enumerate().map(|(k, p)| (format!("trunk {k}"), "trunk".to_owned(), *p));
    let on_limb = [("elbow", [0.2, 0.03, 0.0]), ("hand", [0.4, 0.0, 0.0])];
    let on_limb = on_limb.map(|(name, p)| (name.to_owned(), "second".to_owned(), p));
    let set = MarkerSet::on_bodies(&model, on_trunk.chain(on_limb)).unwrap();
    let mut q = model.neutral();
    q[model.positions_of(1).start] = -0.3;
    for (noise, seed) in [(0.0, 1), (0.002, 2), (0.02, 3)] {
        let recording = record(&model, &set, &vec![q.clone(); 40], 1.0, noise, seed);
        let options = FitOptions { scale: Scale::Fixed(1.0), ..FitOptions::default() };
        let fit = MarkerFit::try_new(&model, set.clone(), options).unwrap().fit(&recording).unwrap();
        // of the numbers, the scale first, those of the hinges are the last two
        let (trunk, hinges) = fit.frames[0].unknowns.split_at(7);
        assert!(trunk[1..].iter().all(|status| *status == UnknownStatus::Determined), "noise {noise}");
        assert_eq!(hinges, [UnknownStatus::Undetermined; 2]);
        for frame in &fit.frames {
            assert_eq!(frame.unknowns, fit.frames[0].unknowns, "noise {noise}");
            let covariance = frame.covariance.as_ref().unwrap();
            assert!((1..7).all(|k| covariance[(k, k)].is_finite()) && covariance[(7, 7)] == f64::INFINITY);
            assert!(!frame.success());
        }
    }
}

/// The same numbers as of markers with these weights in every frame.
#[test]
fn weights_of_a_recording_count_as_those_of_markers() {
    let diver = Diver::planar();
    let model = diver.model().unwrap();
    let set = markers(&model);
    let seen = record(&model, &set, &motion(&diver, 5), 1.0, 0.02, 3);
    let weights: Vec<f64> = (0..set.markers().len()).map(|k| 1.0 / (1 + k % 4) as f64).collect();
    let mut weighted = set.markers().to_vec();
    weighted.iter_mut().zip(&weights).for_each(|(marker, weight)| marker.weight = *weight);
    let by_markers = MarkerSet::try_new(&model, weighted).unwrap();
    let by_recording = seen.clone().with_weights(weights.repeat(5)).unwrap();
    let fit = |set: &MarkerSet, seen: &MarkerRecording| {
        MarkerFit::try_new(&model, set.clone(), begun(&diver)).unwrap().fit(seen).unwrap()
    };
    let (one, other) = (fit(&by_markers, &seen), fit(&set, &by_recording));
    assert_ne!(one.frames[2].estimate, fit(&set, &seen).frames[2].estimate);
    for (a, b) in one.frames.iter().zip(&other.frames) {
        assert_eq!((&a.estimate, a.cost, &a.covariance), (&b.estimate, b.cost, &b.covariance));
    }
}

#[test]
fn points_of_little_weight_hardly_count() {
    let diver = Diver::planar();
    let model = diver.model().unwrap();
    let set = markers(&model);
    let truth = motion(&diver, 6);
    let seen = record(&model, &set, &truth, 1.0, 0.0, 3);
    // in each frame another marker is half a metre off
    let n = set.markers().len();
    let mut points: Vec<Option<Vector3<f64>>> = seen.frames().flatten().copied().collect();
    let mut weights = vec![1.0; points.len()];
    for i in 0..truth.len() {
        let at = i * n + (5 * i) % n;
        points[at] = points[at].map(|point| point + Vector3::new(0.0, 0.3, 0.4));
        weights[at] = 1e-9;
    }
    let wrong = MarkerRecording::try_new(seen.names().to_vec(), seen.times().to_vec(), points).unwrap();
    let fit = MarkerFit::try_new(&model, set, begun(&diver)).unwrap();
    assert!(largest_error(&model, &fit.fit(&wrong).unwrap(), &truth) > 0.01);
    let known = wrong.with_weights(weights).unwrap();
    assert!(largest_error(&model, &fit.fit(&known).unwrap(), &truth) < 1e-6);
}
