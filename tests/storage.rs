//! Models, solutions and fitted scorers in files: whole when they come back, and refused where they cannot be.

use nalgebra::{DMatrix, UnitQuaternion, Vector3};
use serde::Serialize;
use somersault::core::Scalar;
use somersault::dives::{Dive, DiveSearch, Range};
use somersault::ftla::cold_start::ArmTravel;
use somersault::ftla::continuation::Continuation;
use somersault::ftla::shooting::Extremal;
use somersault::integrators::methods::RungeKuttaMuntheKaas4;
use somersault::motion::fit::{FitOptions, MarkerFit, MarkerSet};
use somersault::motion::recording::MarkerRecording;
use somersault::motion::scoring::{Performance, ScoringModel, ScoringOptions};
use somersault::multibody::models::{CartPendulum, Diver, Posture};
use somersault::multibody::motion::{Coordinates, TreeSystem};
use somersault::multibody::{Data, Model};
use somersault::nlp;
use somersault::ocp::collocation::{
    Collocation, CollocationReport, Dynamics, Mesh, Phase, Point, Problem, Terms,
};
use somersault::ocp::swing_up::CartPendulumProblem;
use somersault::prelude::*;
use somersault::storage::{self, StorageError, Stored, from_bytes, to_bytes};

/// Whether a thing comes back as it was: then its document has the same bytes.
#[track_caller]
fn comes_back<T: Stored>(thing: &T) -> T {
    let bytes = to_bytes(thing).unwrap();
    let found: T = from_bytes(&bytes).unwrap();
    assert!(to_bytes(&found).unwrap() == bytes, "a {} changed", T::KIND);
    found
}

fn box_() -> RigidBody {
    // axes that are not principal ones
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.5));
    let inertia = Inertia::try_box(2.0, Vector3::new(0.2, 0.4, 0.6)).unwrap().rotated(&turn).unwrap();
    RigidBody::try_new(2.0, inertia).unwrap()
}

#[test]
fn bodies_and_their_motions_come_back_to_the_bit() {
    let body = box_();
    assert_eq!(comes_back(&body), body);
    let start = RigidBodyState::spinning(Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(comes_back(&start), start);
    let grid = TimeGrid::try_new(0.0, 0.5, 0.01).unwrap();
    let mut recorder = Recorder::new(0.0, &start, 1).with_dense_output();
    let system = RigidBodySystem::free(body);
    Run::by_stepper(&system, &RungeKuttaMuntheKaas4, grid).observed_by(&mut recorder).from(&start).unwrap();
    let motion = recorder.into_solution();
    let found = comes_back(&motion);
    assert_eq!((found.times, found.states), (motion.times, motion.states));
}

#[test]
fn trees_and_their_motions_come_back_to_the_bit() {
    let diver = Diver::spatial();
    let model = diver.model().unwrap();
    let found = comes_back(&model);
    assert_eq!((found.links(), found.gravity()), (model.links(), model.gravity()));
    let v: Vec<f64> = (0..model.n_velocities()).map(|i| 0.1 * i as f64).collect();
    let start = model.state(&diver.configuration(Posture::A).unwrap(), &v).unwrap();
    assert_eq!(comes_back(&start), start);
    let system = TreeSystem::new(&found, ());
    let mut recorder = Recorder::<Coordinates>::new(0.0, &start, 1);
    let grid = TimeGrid::try_new(0.0, 0.05, 0.01).unwrap();
    Run::by_stepper(&system, &RungeKuttaMuntheKaas4, grid).observed_by(&mut recorder).from(&start).unwrap();
    let motion = recorder.into_solution();
    assert_eq!(comes_back(&motion).states, motion.states);
}

/// ẋ = u with cost ½ ∫ x² + u² dt.
struct Regulator;

impl Dynamics for Regulator {
    fn n_states(&self) -> usize {
        1
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.control[0];
    }
}

impl Terms for Regulator {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        (at.state[0] * at.state[0] + at.control[0] * at.control[0]) * nalgebra::convert::<f64, T>(0.5)
    }
}

#[test]
fn optimal_motions_come_back_to_the_bit() {
    comes_back(&CartPendulum::default());
    comes_back(&CartPendulumProblem::with_parameters(10));
    comes_back(&Diver::planar());
    // bounds may be infinite
    let mut dive = Dive::forward_pike().unwrap();
    dive.momentum = Range::new(0.0, f64::INFINITY);
    assert_eq!(comes_back(&dive), dive);
    let program = Dive::forward_pike().unwrap().program().unwrap();
    let z = program.start(&Dive::pike_template()).unwrap();
    let report = DiveSearch::direct().solve(&program, z, &mut |_| nlp::Flow::Continue).unwrap();
    assert_eq!(comes_back(&report), report);
    let judged = program.report(&report.z).unwrap();
    assert_eq!(comes_back(&judged), judged);

    let phase = Phase::new(Regulator, Regulator).initial_state([1.0]).horizon(0.0, 2.0);
    let mut problem = Problem::try_new(phase).unwrap();
    let mesh = Mesh::try_uniform(3, 4).unwrap();
    let found = Collocation::default().solve(&mut problem, &[mesh], &mut |_| nlp::Flow::Continue).unwrap();
    let again: CollocationReport = comes_back(&found);
    // what is left out is made anew
    assert_eq!(again.phases[0].state(1.3), found.phases[0].state(1.3));
}

#[test]
fn extremals_come_back_to_the_bit() {
    let found = ArmTravel::default().solve(&Continuation::default()).unwrap().continued.extremal;
    let again: Extremal = comes_back(&found);
    assert_eq!(again, found);
    let mut torn = found;
    torn.nodes[0] = torn.nodes[0].rows(0, 4).into_owned();
    assert!(matches!(from_bytes::<Extremal>(&to_bytes(&torn).unwrap()), Err(StorageError::Damaged { .. })));
}

#[test]
fn fits_and_scorers_come_back_to_the_bit() {
    let diver = Diver::planar();
    let model = diver.model().unwrap();
    let markers = MarkerSet::joint_centres(&model).unwrap();
    let q = diver.configuration(Posture::A).unwrap();
    let mut data = Data::new(&model);
    let positions = model.positions(&mut data, &q).unwrap();
    let names = model.links().iter().map(|link| link.name().to_owned()).collect();
    // one marker is missing
    let points =
        (0..model.n_bodies()).map(|i| (i != 3).then(|| positions.pose(i).unwrap().translation)).collect();
    let recording = MarkerRecording::try_new(names, vec![0.0], points).unwrap();
    let fit = MarkerFit::try_new(&model, markers, FitOptions::default()).unwrap().fit(&recording).unwrap();
    assert_eq!(comes_back(&fit), fit);

    let performances: Vec<Performance> = (0..12).map(performance).collect();
    let scores: Vec<f64> = (0..12).map(|k| 5.0 + (f64::from(k) * 0.7).sin()).collect();
    let scorer = ScoringModel::train(&performances, &scores, &ScoringOptions::thesis()).unwrap();
    assert_eq!(comes_back(&scorer), scorer);
}

/// Of a made-up motion of four joints.
fn performance(k: i32) -> Performance {
    let times: Vec<f64> = (0..30).map(|i| 0.05 * f64::from(i)).collect();
    let phase = |j: usize| (f64::from(k) + 1.0).sqrt() * (j as f64 + 1.0);
    let postures = DMatrix::from_fn(30, 4, |i, j| (2.0 * times[i] + phase(j)).sin());
    let path = DMatrix::from_fn(30, 3, |i, j| [times[i], 0.1 * f64::from(k), -4.9 * times[i].powi(2)][j]);
    let names = ["a", "b", "c", "d"].map(String::from).to_vec();
    Performance::try_new(times, names, postures, path).unwrap()
}

/// A document with other content under the same kind.
fn forged<T: Stored>(content: impl Serialize) -> Result<T, StorageError> {
    #[derive(Serialize)]
    struct Forged<C> {
        format: &'static str,
        format_version: u32,
        version: &'static str,
        kind: &'static str,
        content: C,
    }
    let mut bytes = Vec::new();
    let forged = Forged { format: "somersault", format_version: 1, version: "0", kind: T::KIND, content };
    ciborium::into_writer(&forged, &mut bytes).unwrap();
    from_bytes(&bytes)
}

#[derive(Serialize)]
struct Body {
    mass: f64,
    inertia: [f64; 9],
}

#[derive(Serialize)]
struct RigidState {
    configuration: Place,
    rate: Rate,
}

#[derive(Serialize)]
struct Place {
    position: [f64; 3],
    orientation: [f64; 4],
}

#[derive(Serialize)]
struct Rate {
    linear: [f64; 3],
    angular: [f64; 3],
}

#[test]
fn what_has_conditions_is_checked_when_it_comes_back() {
    let body = |mass, moments: [f64; 3]| {
        let [a, b, c] = moments;
        forged::<RigidBody>(Body { mass, inertia: [a, 0.0, 0.0, 0.0, b, 0.0, 0.0, 0.0, c] })
    };
    assert!(body(1.0, [1.0, 2.0, 2.5]).is_ok());
    for (found, why) in [
        (body(-1.0, [1.0, 2.0, 2.5]), "`mass` must be positive and finite, found -1"),
        (body(f64::NAN, [1.0, 2.0, 2.5]), "`mass` must be positive and finite, found NaN"),
        (body(1.0, [1.0, 2.0, 4.0]), "triangle inequality"),
        (body(1.0, [1.0, 2.0, f64::INFINITY]), "`tensor` must be finite"),
    ] {
        let message = found.unwrap_err().to_string();
        assert!(message.contains(why), "{message}");
    }
    let state = |orientation| {
        let configuration = Place { position: [0.0; 3], orientation };
        forged::<RigidBodyState>(RigidState {
            configuration,
            rate: Rate { linear: [0.0; 3], angular: [0.0; 3] },
        })
    };
    assert!(state([0.0, 0.6, 0.0, 0.8]).is_ok());
    assert!(state([0.0, 0.6, 0.0, 0.9]).is_err() && state([f64::NAN; 4]).is_err());

    let model = CartPendulum::default().model().unwrap();
    let bytes = to_bytes(&model).unwrap();
    // the parent of the pendulum is called otherwise than the root
    let at = bytes.windows(4).rposition(|w| w == b"cart").unwrap();
    let mut orphan = bytes.clone();
    orphan[at] = b'k';
    let message = from_bytes::<Model>(&orphan).unwrap_err().to_string();
    assert!(message.contains("parent"), "{message}");
}

#[test]
fn files_that_are_none_are_refused_and_never_crash() {
    let model = CartPendulum::default().model().unwrap();
    let bytes = to_bytes(&model).unwrap();
    for n in 0..bytes.len() {
        assert!(matches!(from_bytes::<Model>(&bytes[..n]), Err(StorageError::Damaged { .. })), "{n} bytes");
    }
    // any answer will do, a panic will not
    for at in 0..bytes.len() {
        for flip in [1u8, 0x20, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flip;
            let _ = from_bytes::<Model>(&damaged);
        }
    }
    let longer = [bytes.as_slice(), &[0]].concat();
    let message = from_bytes::<Model>(&longer).unwrap_err().to_string();
    assert!(message.contains("1 bytes follow"), "{message}");
    let found = from_bytes::<RigidBody>(&bytes);
    assert!(matches!(found, Err(StorageError::Kind { expected: "rigid body", .. })));
    let at = bytes.windows(14).position(|w| w == b"format_version").unwrap() + 14;
    let mut later = bytes.clone();
    assert_eq!(later[at], 1);
    later[at] = 2;
    assert!(matches!(from_bytes::<Model>(&later), Err(StorageError::Version { found: 2, .. })));
}

#[test]
fn files_are_written_whole_and_errors_name_them() {
    let folder = std::env::temp_dir().join(format!("somersault-storage-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (path, model) = (folder.join("cart.cbor"), CartPendulum::default().model().unwrap());
    storage::save(&path, &box_()).unwrap();
    storage::save(&path, &model).unwrap();
    assert_eq!(storage::load::<Model>(&path).unwrap().links(), model.links());
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    for found in [
        storage::load::<Model>(folder.join("none")).map(drop),
        storage::save(folder.join("none").join("cart.cbor"), &model),
    ] {
        let error = found.unwrap_err();
        assert!(matches!(error, StorageError::File { .. }) && error.to_string().contains("none"), "{error}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
