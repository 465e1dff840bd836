//! Whatever the document, the reader returns; and a tree that it accepts can be computed with.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_multibody::Data;
use somersault_multibody::urdf::{self, Base, UrdfOptions};

fuzz_target!(|text: &str| {
    for base in [Base::Fixed, Base::Planar, Base::Free] {
        let Ok(robot) = urdf::read(text, &UrdfOptions { base, ..UrdfOptions::default() }) else { continue };
        let model = robot.model;
        if model.n_bodies() > 200 {
            continue;
        }
        let mut data = Data::new(&model);
        let still = vec![0.0; model.n_velocities()];
        // extreme numbers may overflow to an error, but not to a panic
        let _ = model.mass_matrix(&mut data, &model.neutral());
        let _ = model.forward_dynamics(&mut data, &model.neutral(), &still, &still, &[]);
        let written = urdf::write(&model, "fuzzed").expect("all joints of a document can be written");
        let again = urdf::read(&written, &UrdfOptions { base, ..UrdfOptions::default() });
        assert_eq!(again.expect("what was written").model.n_velocities(), model.n_velocities());
    }
});
