//! Whatever the file, the reader returns; and what it accepts is a recording.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_motion::readers::bvh;
use somersault_motion::recording::{Convention, LengthUnit};

fuzz_target!(|text: &str| {
    let Ok(recording) = bvh::read(text, &Convention::y_up_z_forward(LengthUnit::Centimetre)) else { return };
    // every joint in every frame is asked for here, not by the reader
    if recording.n_frames() * recording.skeleton().joints().len() < 100_000 {
        let _ = recording.joint_centres();
        let _ = recording.skeleton().model(1.0).map(|model| {
            assert_eq!(recording.configuration(0).len(), model.n_positions());
        });
    }
});
