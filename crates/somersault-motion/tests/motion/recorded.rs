//! Recorded human motions, where there are any: the folder is named by `SOMERSAULT_MOTIONS`.

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
