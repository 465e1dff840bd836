//! Markers as comma-separated values: the format of [`readers::csv`](crate::readers::csv).

use super::{WriteError, expect_name, file_position};
use crate::recording::{Convention, MarkerRecording};
use std::fmt::Write;

/// `recording` as text; times keep all their digits, and so do positions in m with z up.
pub fn write(recording: &MarkerRecording, convention: &Convention) -> Result<String, WriteError> {
    let mut text = "time".to_owned();
    for name in recording.names() {
        expect_name(name, &[',', '"'], "names without comma, quote, line break or blanks around them")?;
        text.push_str(&format!(",{name}_x,{name}_y,{name}_z"));
    }
    text.push('\n');
    rows(&mut text, recording, convention, ",", |_, time| time.to_string())?;
    Ok(text)
}

/// A row for each frame: its head, then three cells for each marker, empty in a gap.
pub(super) fn rows(
    text: &mut String,
    recording: &MarkerRecording,
    convention: &Convention,
    separator: &str,
    head: impl Fn(usize, f64) -> String,
) -> Result<(), WriteError> {
    for (i, (time, frame)) in recording.times().iter().zip(recording.frames()).enumerate() {
        text.push_str(&head(i, *time));
        for point in frame {
            let cells = point.map(|p| file_position(convention, "a coordinate", &p, i)).transpose()?;
            for axis in 0..3 {
                text.push_str(separator);
                if let Some(cells) = cells {
                    // a String takes whatever is written
                    let _ = write!(text, "{}", cells[axis]);
                }
            }
        }
        text.push('\n');
    }
    Ok(())
}
