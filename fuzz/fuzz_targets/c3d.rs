//! Whatever the file, the reader returns; and what it accepts is a recording.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_motion::readers::c3d;

fuzz_target!(|file: &[u8]| {
    for nan_is_gap in [false, true] {
        let options = c3d::C3dOptions { nan_is_gap, ..c3d::C3dOptions::default() };
        let Ok(recording) = c3d::read(file, &options) else { continue };
        assert_eq!(recording.frames().len(), recording.times().len());
        let _ = recording.fill_gaps(0.1);
    }
});
