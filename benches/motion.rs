//! Recorded motions: models fitted to markers, principal components, a synthetic dive.
//!
//! `cargo bench --bench motion`. Fits: 60 frames of the planar and of the spatial diver, who fold with a
//! somersault, seen by 20 markers with 5 mm of noise; with postures to start from and without;
//! with a robust loss; with one marker in five missing. Validations: scores of 40 and 80 motions of four joints, each left out, with 100
//! resamples and shuffles, by each regression. Inertia: 200 attitudes of a tumble with 0.01 rad of noise. Smooth motions: the frames and
//! markers of the fits, with the noise estimated or given.
//!
//! `make bench-peers` puts the components beside NumPy's singular values of the same matrix.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{DMatrix, Vector3};
use somersault::core::lie::so3;
use somersault::core::random::SplitMix64;
use somersault::integrators::body::RigidBody;
use somersault::integrators::exact::FreeBody;
use somersault::integrators::state::RigidBodyState;
use somersault::motion::analysis::Pca;
use somersault::motion::fit::{FitOptions, Loss, MarkerFit, MarkerProtocol, MarkerSet};
use somersault::motion::inertia::{InertiaOptions, estimate_inertia};
use somersault::motion::recording::MarkerRecording;
use somersault::motion::scaling::{ModelScaler, ScalingOptions};
use somersault::motion::scoring::{
    Performance, RegressionMethod, ScoringOptions, ValidationOptions, validate,
};
use somersault::motion::smoothing::{MarkerNoise, MotionSmoother, SmoothingOptions};
use somersault::motion::synthetic::{Perturbation, SyntheticFlight, synthetic_markers};
use somersault::multibody::Model;
use somersault::multibody::models::{Diver, Posture, SegmentScales};
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Duration;

const FRAMES: usize = 60;
const MARKERS: usize = 20;

/// Times and configurations of a somersault from posture A over H to A.
fn motion(diver: &Diver) -> (Vec<f64>, Vec<f64>) {
    let [a, h] = [Posture::A, Posture::H].map(|p| diver.configuration(p).expect("planar postures"));
    let times: Vec<f64> = (0..FRAMES).map(|i| i as f64 / FRAMES as f64).collect();
    let frame = |t: &f64| {
        let mix = 0.1 + 0.7 * (PI * t).sin().powi(2);
        let mut q: Vec<f64> = a.iter().zip(&h).map(|(a, h)| a + mix * (h - a)).collect();
        if *diver == Diver::planar() {
            q[..3].copy_from_slice(&[0.5 * t, 1.0 + 4.0 * t * (1.0 - t), -2.0 * PI * t]);
        } else {
            let root = [0.5 * t, 0.0, 1.0 + 4.0 * t * (1.0 - t), 0.0, (PI * t).sin(), 0.0, (PI * t).cos()];
            q[..7].copy_from_slice(&root);
        }
        q
    };
    let positions = times.iter().flat_map(frame).collect();
    (times, positions)
}

/// Twenty markers over the bodies that have an extent, off their axes.
fn markers(model: &Model) -> MarkerSet {
    let names = model.links().iter().map(|link| link.name().to_owned());
    let bodies: Vec<String> = names.filter(|n| !n.contains("shoulder_") && !n.contains("waist")).collect();
    let points = [[0.03, 0.05, -0.02], [0.06, -0.03, -0.11], [-0.04, 0.02, -0.07]];
    let marker = |k: usize| {
        let body = bodies[k % bodies.len()].clone();
        (format!("{body} {k}"), body, points[k / bodies.len()])
    };
    MarkerSet::on_bodies(model, (0..MARKERS).map(marker)).expect("bodies of the model")
}

fn fits(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit 60 frames x 20 markers");
    group.sample_size(20).measurement_time(Duration::from_secs(4));
    for (name, diver) in [("planar", Diver::planar()), ("spatial", Diver::spatial())] {
        let model = diver.model().expect("valid");
        let (set, (times, positions)) = (markers(&model), motion(&diver));
        let whole = synthetic_markers(&model, &set, &times, &positions, 0.005, 1).expect("of the model");
        let points = whole.frames().flatten().enumerate().map(|(k, p)| p.filter(|_| k % 5 != 3)).collect();
        let gapped = MarkerRecording::try_new(whole.names().to_vec(), times, points).expect("as before");
        let root = model.positions_of(0).len();
        let given =
            [Posture::A, Posture::H].map(|p| diver.configuration(p).expect("planar")[root..].to_vec());
        for (variant, recording, loss, starts) in [
            ("squares", &whole, Loss::Squares, &given[..]),
            ("squares, no starts", &whole, Loss::Squares, &[]),
            ("Huber", &whole, Loss::Huber(0.01), &given),
            ("20 % missing", &gapped, Loss::Squares, &given),
        ] {
            let options = FitOptions { loss, starts: starts.to_vec(), ..FitOptions::default() };
            let fit = MarkerFit::try_new(&model, set.clone(), options).expect("valid");
            group.bench_function(format!("{name}, {variant}"), |b| {
                b.iter(|| fit.fit(black_box(recording)).expect("common markers").rms())
            });
        }
    }
    group.finish();
}

fn components(c: &mut Criterion) {
    let mut group = c.benchmark_group("principal components");
    group.sample_size(10);
    let samples =
        DMatrix::from_fn(16, 100_000, |i, j| ((i * 31 + j * 17) as f64 * 0.37).sin() + (j % (i + 2)) as f64);
    group.bench_function("16 x 100 000", |b| {
        b.iter(|| Pca::fit(black_box(&samples), 15).expect("finite").total_variance())
    });
    group.finish();
}

fn synthetic(c: &mut Criterion) {
    let diver = Diver::planar();
    let (times, positions) = motion(&diver);
    let model = diver.model().expect("valid");
    let flight = SyntheticFlight::try_new(&model, &times, &positions).expect("it folds");
    let perturbation = Perturbation { looseness: 0.1, over_rotation: 0.2, ..Perturbation::none() };
    c.bench_function("SYNTHETIC planar dive, 60 frames", |b| {
        b.iter(|| flight.perturb(black_box(&perturbation)).expect("aimed").angular_momentum)
    });
}

/// A motion of four joints that fold so deep, with something that looks like noise.
fn performance(k: usize, depth: f64) -> Performance {
    let times: Vec<f64> = (0..FRAMES).map(|i| i as f64 / FRAMES as f64).collect();
    let postures = DMatrix::from_fn(FRAMES, 4, |i, j| {
        let noise = ((i * 31 + j * 17 + k * 101) as f64 * 0.37).sin();
        depth * (PI * times[i]).sin() * (1.0 + j as f64) + 0.02 * noise
    });
    let names = ["hip", "knee", "shoulder", "neck"].map(String::from).to_vec();
    Performance::try_new(times, names, postures, DMatrix::zeros(FRAMES, 3)).expect("finite")
}

fn validations(c: &mut Criterion) {
    let mut group = c.benchmark_group("validation, 100 resamples");
    group.sample_size(10);
    for n in [40, 80] {
        let depths: Vec<f64> = (0..n).map(|k| 1.0 + 0.3 * (k as f64 * 2.3).sin()).collect();
        let motions: Vec<Performance> = depths.iter().enumerate().map(|(k, d)| performance(k, *d)).collect();
        let scores: Vec<f64> =
            depths.iter().enumerate().map(|(k, d)| 4.0 + 2.0 * d + 0.2 * (k as f64 * 7.7).sin()).collect();
        let few = ValidationOptions { n_resamples: 100, ..ValidationOptions::default() };
        for method in [
            RegressionMethod::PrincipalComponents,
            RegressionMethod::PartialLeastSquares,
            RegressionMethod::Ridge,
        ] {
            let options = ScoringOptions { method, ..ScoringOptions::thesis() };
            group.bench_function(format!("{method}, {n} motions"), |b| {
                b.iter(|| {
                    validate(black_box(&motions), &scores, &options, &few, &[])
                        .expect("scores vary")
                        .rms_error
                })
            });
        }
    }
    group.finish();
}

fn inertia(c: &mut Criterion) {
    let body = RigidBody::try_principal(1.0, Vector3::new(1.0, 2.0, 2.5)).expect("a body");
    let start = RigidBodyState::spinning(Vector3::new(0.3, 1.0, 0.4));
    let tumble = FreeBody::try_new(&body, &start).expect("finite");
    let times: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k)).collect();
    let mut random = SplitMix64::new(1);
    let mut off = || 12f64.sqrt() * 0.01 * (random.unit() - 0.5);
    let attitude = |t: &f64| {
        let shaken = so3::exp(&Vector3::new(off(), off(), off()));
        tumble.at(*t).expect("finite").orientation() * shaken
    };
    let seen: Vec<_> = times.iter().map(attitude).collect();
    c.bench_function("inertia, 200 attitudes", |b| {
        b.iter(|| {
            estimate_inertia(&times, black_box(&seen), &InertiaOptions::default()).expect("valid").ratios
        })
    });
}

/// With the noise and its correlation estimated, and with white noise that is given.
fn smoothed(c: &mut Criterion) {
    let mut group = c.benchmark_group("smooth motion of 60 frames x 20 markers");
    group.sample_size(10);
    for (name, diver) in [("planar", Diver::planar()), ("spatial", Diver::spatial())] {
        let model = diver.model().expect("valid");
        let (set, (times, positions)) = (markers(&model), motion(&diver));
        let seen = synthetic_markers(&model, &set, &times, &positions, 0.005, 1).expect("of the model");
        for (variant, noise) in [("noise estimated", None), ("noise given", Some(MarkerNoise::white(0.005)))]
        {
            let options = SmoothingOptions { noise, ..SmoothingOptions::default() };
            let smoother = MotionSmoother::try_new(&model, set.clone(), options).expect("valid");
            group.bench_function(format!("{name}, {variant}"), |b| {
                b.iter(|| smoother.smooth(black_box(&seen)).expect("common markers").iterations)
            });
        }
    }
    group.finish();
}

/// Sizes of segments and offsets of markers, from frames that fold.
fn scaled(c: &mut Criterion) {
    let mut group = c.benchmark_group("model scaled by 50 frames");
    group.sample_size(10);
    for (name, diver) in [("planar", Diver::planar()), ("spatial", Diver::spatial())] {
        let segments = SegmentScales::default().with("thigh", [1.05; 3]).expect("a segment");
        let person = Diver { segments, ..diver };
        let on = |diver: &Diver| MarkerSet::on_diver(diver, MarkerProtocol::PlugInGait).expect("a diver");
        let (times, positions) = motion(&diver);
        let model = person.model().expect("valid");
        let seen =
            synthetic_markers(&model, &on(&person), &times, &positions, 0.005, 1).expect("of the model");
        let usual = diver.model().expect("valid");
        let scaler = ModelScaler::try_new(&usual, on(&diver), ScalingOptions::default()).expect("valid");
        group.bench_function(name, |b| {
            b.iter(|| scaler.scale(black_box(&seen)).expect("common markers").iterations)
        });
    }
    group.finish();
}

criterion_group!(benches, fits, components, synthetic, validations, inertia, smoothed, scaled);
criterion_main!(benches);
