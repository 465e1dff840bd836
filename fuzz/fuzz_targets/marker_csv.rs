//! Whatever the file, the reader returns; and what it accepts is a recording.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_motion::readers::{MarkerOptions, csv};

fuzz_target!(|text: &str| {
    for nan_is_gap in [false, true] {
        let options = MarkerOptions { nan_is_gap, ..MarkerOptions::default() };
        let Ok(recording) = csv::read(text, &options) else { continue };
        assert_eq!(recording.frames().len(), recording.times().len());
        let _ = recording.fill_gaps(0.1);
    }
});
