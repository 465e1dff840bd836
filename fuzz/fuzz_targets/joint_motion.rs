//! Whatever the file, the reader returns; and what it accepts is a recording.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_motion::readers::joint_motion;
use somersault_multibody::models::Diver;

fuzz_target!(|text: &str| {
    let Ok(recording) = joint_motion::read(text, &Diver::spatial()) else { return };
    // every joint in every frame is asked for here, not by the reader
    if recording.n_frames() * recording.skeleton().joints().len() < 100_000 {
        let _ = recording.joint_centres();
        let _ = recording.skeleton().model(1.0).map(|model| {
            assert_eq!(recording.configuration(0).len(), model.n_positions());
        });
    }
});
