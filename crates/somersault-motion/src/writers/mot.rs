//! Channels as MOT or STO: the format of [`readers::mot`](crate::readers::mot), as OpenSim reads it.

use super::{WriteError, expect_name};
use crate::readers::mot::is_angle;
use crate::recording::ChannelRecording;

/// `recording` as text, with all digits. With `in_degrees` columns that are angles by their names
/// ([`is_angle`]) are written in degrees; OpenSim decides by its model which it converts. NaN is written as such. `name` is the
/// first line.
pub fn write(recording: &ChannelRecording, name: &str, in_degrees: bool) -> Result<String, WriteError> {
    const ALLOWED: &str = "names without tab, line break or blanks around them";
    expect_name(name, &['\t', '='], ALLOWED)?;
    let (rows, columns) = (recording.n_frames(), recording.n_channels() + 1);
    let degrees = if in_degrees { "yes" } else { "no" };
    let mut text =
        format!("{name}\nversion=1\nnRows={rows}\nnColumns={columns}\ninDegrees={degrees}\nendheader\ntime");
    let mut angles = Vec::with_capacity(recording.n_channels());
    for name in recording.names() {
        expect_name(name, &['\t'], ALLOWED)?;
        text.push_str(&format!("\t{name}"));
        angles.push(in_degrees && is_angle(name));
    }
    text.push('\n');
    for (frame, (time, values)) in recording.times().iter().zip(recording.frames()).enumerate() {
        text.push_str(&time.to_string());
        for (value, angle) in values.iter().zip(&angles) {
            let written = if *angle { value.to_degrees() } else { *value };
            if written.is_infinite() {
                return Err(WriteError::OutOfRange { quantity: "an angle", found: *value, frame });
            }
            text.push_str(&format!("\t{written}"));
        }
        text.push('\n');
    }
    Ok(text)
}
