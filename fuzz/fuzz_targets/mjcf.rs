//! Whatever the document, the reader returns; and a tree that it accepts can be computed with.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_multibody::Data;
use somersault_multibody::mjcf::{self, MjcfOptions};

fuzz_target!(|text: &str| {
    for strict in [false, true] {
        let Ok(robot) = mjcf::read(text, &MjcfOptions { strict, ..MjcfOptions::default() }) else { continue };
        let model = robot.model;
        assert_eq!(robot.reference.len(), model.n_positions());
        if model.n_bodies() > 200 {
            continue;
        }
        let mut data = Data::new(&model);
        let still = vec![0.0; model.n_velocities()];
        // extreme numbers may overflow to an error, but not to a panic
        let _ = model.mass_matrix(&mut data, &robot.reference);
        let _ = model.forward_dynamics(&mut data, &robot.reference, &still, &still, &[]);
    }
});
