//! Markers as TRC: the format of [`readers::trc`](crate::readers::trc), as OpenSim reads it.

use super::csv::rows;
use super::{WriteError, expect_name};
use crate::recording::{Convention, MarkerRecording};

/// `recording` as text. OpenSim wants y up and x forward. Times stand in every row and may be uneven; the rate
/// in the head is their mean. `file` is the name that the head repeats.
pub fn write(recording: &MarkerRecording, file: &str, convention: &Convention) -> Result<String, WriteError> {
    expect_name(file, &['\t'], "names without tab, line break or blanks around them")?;
    let (n_frames, n_markers) = (recording.n_frames(), recording.n_markers());
    let times = recording.times();
    let whole = times[n_frames - 1] - times[0];
    let rate = if n_frames > 1 { (n_frames - 1) as f64 / whole } else { 100.0 };
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(WriteError::OutOfRange {
            quantity: "a time",
            found: times[n_frames - 1],
            frame: n_frames - 1,
        });
    }
    let unit = convention.unit().symbol();
    let mut text = format!(
        "PathFileType\t4\t(X/Y/Z)\t{file}\n\
         DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n\
         {rate}\t{rate}\t{n_frames}\t{n_markers}\t{unit}\t{rate}\t1\t{n_frames}\nFrame#\tTime"
    );
    for name in recording.names() {
        expect_name(name, &['\t'], "names without tab, line break or blanks around them")?;
        text.push_str(&format!("\t{name}\t\t"));
    }
    text.push_str("\n\t");
    (1..=n_markers).for_each(|k| text.push_str(&format!("\tX{k}\tY{k}\tZ{k}")));
    text.push_str("\n\n");
    rows(&mut text, recording, convention, "\t", |i, time| format!("{}\t{time}", i + 1))?;
    Ok(text)
}
