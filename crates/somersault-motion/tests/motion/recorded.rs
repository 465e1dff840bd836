//! Recorded human motions, where there are any: the folder is named by `SOMERSAULT_MOTIONS`.

use somersault_motion::fit::{FitOptions, MarkerFit, MarkerSet, Scale};
use somersault_motion::readers::{joint_motion, load, text};
use somersault_motion::recording::SkeletonRecording;
use somersault_multibody::models::Diver;

/// A motion of DeepMimic by its name, unless the folder is not there: then that is said.
pub(crate) fn motion(name: &str) -> Option<SkeletonRecording> {
    let Some(folder) = std::env::var_os("SOMERSAULT_MOTIONS") else {
        println!("SOMERSAULT_MOTIONS names no folder: the recorded motion `{name}` is absent and not tested");
        return None;
    };
    let path = std::path::Path::new(&folder).join(format!("humanoid3d_{name}.txt"));
    let found = load(path, |bytes| joint_motion::read(text(bytes)?, &Diver::spatial()));
    Some(found.unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn recorded_motions_are_of_human_size() {
    // numbers of frames as a JSON parser of another language counts them
    for (name, n_frames) in
        [("backflip", 29), ("sideflip", 40), ("cartwheel", 164), ("roll", 121), ("walk", 39)]
    {
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
fn recorded_motions_are_fitted_by_the_spatial_diver() {
    let model = Diver::spatial().model().unwrap();
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
    let markers = trunk.into_iter().chain(on("right")).chain(on("left"));
    let set = MarkerSet::on_bodies(&model, markers).unwrap();
    for name in ["backflip", "sideflip", "cartwheel", "roll", "jump", "spinkick", "walk", "run"] {
        let Some(recording) = motion(name) else { continue };
        let options = FitOptions { scale: Scale::Fixed(1.0), ..FitOptions::default() };
        let fit = MarkerFit::try_new(&model, set.clone(), options).unwrap();
        let fit = fit.fit(&recording.joint_centres().unwrap()).unwrap();
        let of_markers: Vec<String> = (set.markers().iter().zip(fit.rms_of_markers()))
            .map(|(m, rms)| format!("{} {:.0}", m.name, 1000.0 * rms.unwrap()))
            .collect();
        println!(
            "{name}: rms {:.0} mm, converged {}; {}",
            1000.0 * fit.rms().unwrap(),
            fit.converged(),
            of_markers.join(", ")
        );
        // lengths are the diver's own; what is left is what its hinges cannot do, such as legs apart
        assert!(fit.rms().unwrap() < 0.15, "{name}");
    }
}
