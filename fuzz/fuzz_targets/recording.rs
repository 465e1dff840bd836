//! Whatever the file, the reader of each format returns; and what it accepts is a recording.
#![no_main]

use libfuzzer_sys::fuzz_target;
use somersault_motion::readers::{FORMATS, ReadOptions, Recording};
use somersault_motion::recording::LengthUnit;

fuzz_target!(|file: &[u8]| {
    for (format, nan_is_gap) in FORMATS.into_iter().flat_map(|format| [(format, false), (format, true)]) {
        let options = ReadOptions {
            unit: Some(LengthUnit::Centimetre),
            nan_is_gap,
            rate: Some(100.0),
            ..ReadOptions::default()
        };
        match format.read(file, &options).map(|found| found.recording) {
            Ok(Recording::Markers(recording)) => {
                assert_eq!(recording.frames().len(), recording.times().len());
                let _ = recording.fill_gaps(0.1);
            }
            // every joint in every frame is asked for here, not by the reader
            Ok(Recording::Skeleton(recording))
                if recording.n_frames() * recording.skeleton().joints().len() < 100_000 =>
            {
                let _ = recording.joint_centres();
                let _ = recording.skeleton().model(1.0).map(|model| {
                    assert!(recording.configurations().all(|q| q.len() == model.n_positions()));
                });
            }
            Ok(Recording::Keypoints(recording)) => {
                assert_eq!(recording.weights().len(), recording.n_frames() * recording.n_keypoints());
            }
            Ok(Recording::Channels(recording)) => {
                assert_eq!(recording.frames().len(), recording.times().len());
            }
            Ok(Recording::Skeleton(_)) | Err(_) => {}
        }
    }
});
