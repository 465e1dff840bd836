//! Recorded human motions, where there are any: the folder is named by `SOMERSAULT_MOTIONS`.

use nalgebra::DMatrix;
use somersault_motion::analysis::{WeightBounds, eigenpostures, project};
use somersault_motion::fit::{FitOptions, MarkerFit, MarkerSet, MotionFit, Scale, Shape};
use somersault_motion::identification::identify_flight;
use somersault_motion::readers::{ReadOptions, joint_motion, load, read_file, text};
use somersault_motion::reconstruction::{FlightReconstruction, ReconstructionOptions};
use somersault_motion::recording::{MarkerRecording, SkeletonRecording};
use somersault_motion::scaling::{ModelScaler, ScalingOptions};
use somersault_multibody::joint_motion::EigenpostureBase;
use somersault_multibody::models::{BallJointedDiver, Diver, Posture};
use somersault_multibody::{Data, Model};

/// A motion of DeepMimic by its name, unless the folder is not there: then that is said.
pub(crate) fn motion(name: &str) -> Option<SkeletonRecording> {
    let Some(folder) = std::env::var_os("SOMERSAULT_MOTIONS") else {
        println!("SOMERSAULT_MOTIONS names no folder: the recorded motion `{name}` is absent and not tested");
        return None;
    };
    let path = std::path::Path::new(&folder).join(format!("humanoid3d_{name}.txt"));
    let found = load(path, |bytes| joint_motion::read(text(bytes)?, &Diver::spatial()));
    Some(found.unwrap_or_else(|error| panic!("SOMERSAULT_MOTIONS must name a folder of motions: {error}")))
}

#[test]
fn recorded_motions_are_of_human_size() {
    // numbers of frames as a JSON parser of another language counts them
    for (name, n_frames) in [
        ("backflip", 29),
        ("sideflip", 40),
        ("cartwheel", 164),
        ("roll", 121),
        ("jump", 107),
        ("spinkick", 78),
        ("walk", 39),
        ("run", 25),
    ] {
        let Some(recording) = motion(name) else { continue };
        assert_eq!(recording.n_frames(), n_frames, "{name}");
        let centres = recording.joint_centres().unwrap();
        let height = centres.frames().flatten().map(|p| p.unwrap().z);
        let (lowest, highest) = height.fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(z), b.max(z)));
        println!("{name}: {:.3} s, from {lowest:.2} to {highest:.2} m", recording.times().last().unwrap());
        assert!(lowest > -0.3 && highest < 3.0, "{name}: from {lowest} to {highest} m");
    }
}

#[test]
fn a_dive_that_leaves_the_plane_is_refused_for_a_planar_body() {
    let Some(folder) = std::env::var_os("SOMERSAULT_MOTIONS") else {
        println!("SOMERSAULT_MOTIONS names no folder: the recorded flight is absent and not tested");
        return;
    };
    let path = std::path::Path::new(&folder).join("../flights/e2.trc");
    let seen = read_file(path, &ReadOptions::default()).unwrap().recording.into_markers().unwrap();
    let model = Diver::planar().model().unwrap();
    let on = [
        ("hip", "thigh"),
        ("knee", "shank"),
        ("ank", "foot"),
        ("ball", "toes"),
        ("sho", "upper_arm"),
        ("elb", "forearm"),
        ("wri", "hand"),
    ];
    for sides in [&["_r", "_l"][..], &["_r"], &["_l"]] {
        let sided = sides.iter().flat_map(|side| on.map(|(joint, body)| (format!("{joint}{side}"), body)));
        let places = sided.chain([("neck".to_owned(), "head")]).map(|(name, body)| (name, body, [0.0; 3]));
        let set = MarkerSet::on_bodies(&model, places).unwrap();
        for interval in [None, Some((0.3934, 1.7434))] {
            let options = ReconstructionOptions { interval, ..ReconstructionOptions::default() };
            let flight = FlightReconstruction::try_new(&model, set.clone(), options)
                .unwrap()
                .reconstruct(&seen)
                .unwrap();
            assert!(!flight.success(), "{sides:?} {interval:?}: {:?}", flight.departures);
            let report = identify_flight(&model, &flight, None).unwrap();
            assert!(report.number.is_none() && report.reason == flight.message());
        }
    }
}

/// The joint centres of recordings that the spatial diver has too, by body.
fn markers(model: &Model) -> MarkerSet {
    let on = |side: &str| {
        [
            ("hip", "thigh"),
            ("knee", "shank"),
            ("ankle", "foot"),
            ("toes", "toes"),
            ("shoulder", "shoulder_flexion"),
        ]
        .into_iter()
        .chain([("elbow", "forearm"), ("wrist", "hand")])
        .map(|(joint, body)| (format!("{side}_{joint}"), format!("{side}_{body}"), [0.0; 3]))
        .collect::<Vec<_>>()
    };
    let trunk = [("chest", "torso"), ("neck", "head")].map(|(j, b)| (j.to_owned(), b.to_owned(), [0.0; 3]));
    MarkerSet::on_bodies(model, trunk.into_iter().chain(on("right")).chain(on("left"))).unwrap()
}

/// Lengths are the diver's own, so its scale is one.
fn fitted(model: &Model, recording: &SkeletonRecording, shape: Shape) -> MotionFit {
    let options = FitOptions { scale: Scale::Fixed(1.0), shape, ..FitOptions::default() };
    let fit = MarkerFit::try_new(model, markers(model), options).unwrap();
    fit.fit(&recording.joint_centres().unwrap()).unwrap()
}

#[test]
fn recorded_motions_are_fitted_by_the_spatial_diver() {
    let model = Diver::spatial().model().unwrap();
    for name in ["backflip", "sideflip", "cartwheel", "roll", "jump", "spinkick", "walk", "run"] {
        let Some(recording) = motion(name) else { continue };
        let fit = fitted(&model, &recording, Shape::Joints);
        let of_markers: Vec<String> = (markers(&model).markers().iter().zip(fit.rms_of_markers()))
            .map(|(m, rms)| format!("{} {:.0}", m.name, 1000.0 * rms.unwrap()))
            .collect();
        println!(
            "{name}: rms {:.0} mm, converged {}; {}",
            1000.0 * fit.rms().unwrap(),
            fit.converged(),
            of_markers.join(", ")
        );
        assert!(fit.converged(), "{name}");
        // what is left is what the diver's hinges cannot do, such as legs apart
        assert!(fit.rms().unwrap() < 0.15, "{name}");
        // no frame stays in a minimum that is worse than what it finds alone
        let centres = recording.joint_centres().unwrap();
        for i in (0..centres.n_frames()).step_by(5) {
            let (names, points) = (centres.names().to_vec(), centres.frame(i).unwrap().to_vec());
            let options = FitOptions { scale: Scale::Fixed(1.0), ..FitOptions::default() };
            let one = MarkerRecording::try_new(names, vec![0.0], points).unwrap();
            let alone = MarkerFit::try_new(&model, markers(&model), options).unwrap().fit(&one).unwrap();
            let (tracked, alone) = (fit.frames[i].rms.unwrap(), alone.rms().unwrap());
            assert!(tracked < 1.2 * alone, "{name}: {tracked} m in frame {i}, {alone} m alone");
        }
    }
}

#[test]
fn flips_are_described_in_posture_space() {
    let diver = Diver::spatial();
    let model = diver.model().unwrap();
    // arms at the sides, overhead and sideways, tuck and pikes
    let postures = [Posture::B, Posture::A, Posture::C, Posture::F, Posture::G, Posture::H];
    let base = EigenpostureBase::try_new(&postures.map(|p| p.spatial().to_vec())).unwrap();
    let mut joints = Vec::new();
    for name in ["backflip", "sideflip"] {
        let Some(recording) = motion(name) else { continue };
        let free = fitted(&model, &recording, Shape::Joints);
        let mapped = fitted(&model, &recording, Shape::Eigenpostures(base.clone()));
        for frame in &mapped.frames {
            let weights = &frame.estimate.weights;
            assert!(weights.iter().all(|w| *w >= 0.0) && weights.iter().sum::<f64>() <= 1.0 + 1e-12);
        }
        // a convex hull of six postures is less than all joints
        let (rms, least) = (mapped.rms().unwrap(), free.rms().unwrap());
        assert!(rms > least && rms < 0.3, "{name}: {rms} m in the postures, {least} m with all joints");
        // the same from the joint angles: no nearer than without the bounds
        let n_root = model.positions_of(0).len();
        let rows: Vec<f64> = free.frames.iter().flat_map(|f| f.estimate.q[n_root..].to_vec()).collect();
        let rows = DMatrix::from_row_slice(free.frames.len(), base.n_joints(), &rows);
        let [bounded, unbounded] =
            [WeightBounds::Simplex, WeightBounds::None].map(|b| project(&base, &rows, b).unwrap());
        assert!(bounded.distances.iter().zip(&unbounded.distances).all(|(b, u)| *b >= u - 1e-12));
        // a flip is tucked in between, not at its ends
        let tuck = |i: usize| mapped.frames[i].estimate.weights[2..].iter().sum::<f64>();
        let n = mapped.frames.len();
        let deepest = (0..n).max_by(|a, b| tuck(*a).total_cmp(&tuck(*b))).unwrap();
        println!(
            "{name}: rms {:.0} mm in six postures, {:.0} mm with all joints; \
             tuck and pikes weigh {:.2} at first, {:.2} in frame {deepest} of {n}, {:.2} at last",
            1000.0 * rms,
            1000.0 * least,
            tuck(0),
            tuck(deepest),
            tuck(n - 1)
        );
        assert!(tuck(deepest) > 0.4 && tuck(0) < 0.5 * tuck(deepest), "{name}");
        joints.push(rows);
    }
    if joints.is_empty() {
        return;
    }
    let common = eigenpostures::common(&joints, 4).unwrap();
    let shares: Vec<String> = common.explained_variance_ratio().iter().map(|r| format!("{r:.3}")).collect();
    println!("four eigenpostures common to both explain {} of the variance", shares.join(" + "));
    assert!(common.explained_variance_ratio().iter().sum::<f64>() > 0.75);
}

/// The joints of DeepMimic's figures on a spatial diver, with hinges or with balls.
fn joints_of_figures(model: &Model) -> MarkerSet {
    let shoulder = if model.body("waist").is_ok() { "shoulder_flexion" } else { "upper_arm" };
    let limbs = [
        ("hip", "thigh"),
        ("knee", "shank"),
        ("ankle", "foot"),
        ("toes", "toes"),
        ("shoulder", shoulder),
        ("elbow", "forearm"),
        ("wrist", "hand"),
    ];
    let sided = ["right", "left"]
        .into_iter()
        .flat_map(|side| limbs.map(|(joint, body)| (format!("{side}_{joint}"), format!("{side}_{body}"))));
    let trunk = [("chest", "torso"), ("neck", "head")].map(|(a, b)| (a.to_owned(), b.to_owned()));
    let places = trunk.into_iter().chain(sided).map(|(name, body)| (name, body, [0.0; 3]));
    MarkerSet::on_bodies(model, places).unwrap()
}

/// Legs of people spread and their trunks lean, which hinges at hips and waist do not: with balls the markers of the recorded flips are within 6 mm instead of
/// within 80, a joint that was left out is predicted within 5 mm, and sizes, which the reader took from the diver, are found to be
/// those of the diver.
#[test]
fn people_are_followed_by_balls() {
    let (hinged, balls) =
        (Diver::spatial().model().unwrap(), BallJointedDiver::new(Diver::spatial()).model().unwrap());
    for (name, by_hinges) in [("backflip", 0.03), ("sideflip", 0.07)] {
        let Some(recording) = motion(name) else { return };
        let seen = recording.joint_centres().unwrap();
        let options = ScalingOptions { offset_deviation: 0.0, ..ScalingOptions::default() };
        let scaled = |model: &Model, seen: &MarkerRecording| {
            let scaler = ModelScaler::try_new(model, joints_of_figures(model), options.clone()).unwrap();
            scaler.scale(seen).unwrap()
        };
        let (before, after) = (scaled(&hinged, &seen), scaled(&balls, &seen));
        assert!(
            before.rms[0] > by_hinges && after.rms[0] < 0.006,
            "{name}: {:?} {:?}",
            before.rms,
            after.rms
        );
        assert!(after.success(), "{name}: {}", after.message());
        // legs that spread make the pelvis wide where hips are hinges
        let width = before.groups.iter().find(|group| group.name == "pelvis width").unwrap();
        assert_eq!((1.15..1.2).contains(&width.scale), name == "backflip", "{width:?}");
        for group in &after.groups {
            assert!((group.scale - 1.0).abs() < 3.0 * group.deviation, "{name}: {group:?}");
        }
        let names: Vec<&String> = seen.names().iter().filter(|marker| *marker != "chest").collect();
        let part = seen.select(&names).unwrap();
        for (model, within) in [(&hinged, 0.2), (&balls, 0.005)] {
            let found = scaled(model, &part);
            let fit = FitOptions { scale: Scale::Fixed(1.0), ..FitOptions::default() };
            let fit =
                MarkerFit::try_new(&found.model, found.markers.clone(), fit).unwrap().fit(&part).unwrap();
            let mut data = Data::new(&found.model);
            let mut squares = 0.0;
            for (frame, chest) in fit.frames.iter().zip(seen.track("chest").unwrap()) {
                let place = found.model.positions(&mut data, &frame.estimate.q).unwrap();
                squares += (place.pose(0).unwrap().translation - chest.unwrap()).norm_squared();
            }
            let rms = (squares / fit.frames.len() as f64).sqrt();
            println!("{name}: chest predicted within {:.1} mm", 1e3 * rms);
            assert!(rms < within, "{name}: {rms}");
        }
    }
}
