//! Markers as comma-separated values.
//!
//! The first line names the columns: `time`, then `_x`, `_y` and `_z` of each marker. Every other line is a
//! frame. Times are in s and grow; lengths and axes are the caller's to say. A marker with three empty cells is
//! missing. Lines that begin with `#` are comments. Cells may be quoted as in RFC 4180.
//!
//! ```
//! use somersault_motion::readers::{MarkerOptions, csv};
//!
//! let text = "time,hip_x,hip_y,hip_z,knee_x,knee_y,knee_z\n\
//!             0.00,0,0,0.9,0,0,0.5\n\
//!             0.01,0,0,0.9,,,\n";
//! let recording = csv::read(text, &MarkerOptions::default())?;
//! assert_eq!(recording.names(), ["hip", "knee"]);
//! assert_eq!(recording.frame(1).map(|markers| markers[1]), Some(None));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::{Choices, Format, MarkerOptions, Place, ReadError, number, point, text, unexpected};
use crate::recording::{Axis, LengthUnit, MarkerRecording};
use ::csv::{Reader, ReaderBuilder, StringRecord, Trim};

pub(super) const FORMAT: Format = Format {
    name: "CSV",
    endings: &["csv"],
    unit: Some(LengthUnit::Metre),
    up: Axis::PlusZ,
    forward: Axis::PlusX,
    parse: |bytes, &Choices { convention, nan_is_gap, .. }| {
        Ok(read(text(bytes)?, &MarkerOptions { convention, nan_is_gap })?.into())
    },
};

/// The recording in `text`.
pub fn read(text: &str, options: &MarkerOptions) -> Result<MarkerRecording, ReadError> {
    let mut rows = Rows::new(text);
    let mut record = StringRecord::new();
    let Some(head) = rows.next(&mut record) else {
        return Err(ReadError::Truncated {
            place: Place::Line(1),
            allowed: "the names of columns".to_owned(),
        });
    };
    let names = names(head, &record)?;
    let (mut places, mut times, mut points) = (Vec::new(), Vec::new(), Vec::new());
    let expected = 1 + 3 * names.len();
    while let Some(place) = rows.next(&mut record) {
        if record.len() != expected {
            let found = format!("{} cells", record.len());
            return Err(unexpected(place, &found, format!("{expected} cells, as many as names")));
        }
        places.push(place);
        times.push(number(place, &record[0], "a time")?);
        for k in 0..names.len() {
            let cells = [1, 2, 3].map(|i| &record[3 * k + i]);
            points.push(point(place, cells, options)?);
        }
    }
    if times.is_empty() {
        return Err(ReadError::NoFrames { place: head });
    }
    MarkerRecording::try_new(names, times, points)
        .map_err(|error| ReadError::recording(error, head, |frame| places.get(frame).copied()))
}

/// Rows of cells without what surrounds them, and the lines they begin on. Blank lines and comments are left
/// out.
pub(crate) struct Rows<'t> {
    reader: Reader<&'t [u8]>,
    text: &'t str,
    line: usize,
    counted: usize,
}

impl<'t> Rows<'t> {
    pub(crate) fn new(text: &'t str) -> Self {
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).comment(Some(b'#')).trim(Trim::All);
        Self { reader: builder.from_reader(text.as_bytes()), text, line: 1, counted: 0 }
    }

    /// Reads the next row; none at the end.
    pub(crate) fn next(&mut self, record: &mut StringRecord) -> Option<Place> {
        // text is UTF-8, it is in memory and rows may have any length: no row can fail
        if !self.reader.read_record(record).unwrap_or(false) {
            return None;
        }
        // a record begins after the one before; blank lines and comments in between count too
        let mut start = record.position().map_or(0, |p| p.byte() as usize);
        while let Some(skipped) = skipped(&self.text[start..]) {
            start += skipped;
        }
        self.line += self.text[self.counted..start].matches('\n').count();
        self.counted = start;
        Some(Place::Line(self.line))
    }
}

/// Bytes of the line at the start of `text`, if that is blank or a comment.
fn skipped(text: &str) -> Option<usize> {
    let line = text.split_inclusive('\n').next()?;
    (line.starts_with('#') || matches!(line, "\n" | "\r\n" | "\r")).then_some(line.len())
}

/// The markers that the first line names.
fn names(place: Place, header: &StringRecord) -> Result<Vec<String>, ReadError> {
    const ALLOWED: &str = "time, then _x, _y and _z of each marker";
    let wrong = |found: &str| unexpected(place, found, ALLOWED);
    let mut columns = header.iter();
    match columns.next() {
        Some(time) if time.eq_ignore_ascii_case("time") => {}
        found => return Err(wrong(found.unwrap_or_default())),
    }
    let mut names = Vec::new();
    while let Some(column) = columns.next() {
        let name = column.strip_suffix("_x").filter(|n| !n.is_empty()).ok_or_else(|| wrong(column))?;
        for suffix in ["_y", "_z"] {
            let found = columns.next().unwrap_or_default();
            if found.strip_suffix(suffix) != Some(name) {
                return Err(wrong(found));
            }
        }
        names.push(name.to_owned());
    }
    Ok(names)
}
