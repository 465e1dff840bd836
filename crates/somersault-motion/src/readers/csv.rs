//! Markers, or any named numbers, as comma-separated values, and what programs of motion capture export.
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
//!
//! The format of files of this ending reads more ([`readers::read_file`](super::read_file)):
//!
//! | Program | Known by | Unit, vertical | Times |
//! |---|---|---|---|
//! | any | a row of names: coordinates end in `_x`, `:X`, `.x`, ` X`, `[0]`, … | m or that in brackets, z | a column `time`, or `rate` |
//! | OptiTrack Motive | `Format Version` | as declared, y | a column |
//! | Vicon Nexus | `Trajectories`, `Model Outputs`, `Devices`, `Joints` | the row of units, z | number of the frame and rate |
//! | Qualisys QTM (TSV) | `MARKER_NAMES` | mm, z | a column, or the frequency |
//!
//! Cells are separated by commas, semicolons or tabs, with decimal points or commas. Columns that are no coordinates are channels
//! where they are more than the coordinates.

mod header;

use super::{
    Choices, Format, MarkerOptions, Parsed, Place, ReadError, Recording, Repairs, decoded, distinct, is_nan,
    number, number_of_cell, point, times_at_rate, unexpected,
};
use crate::recording::{Axis, ChannelRecording, LengthUnit, MarkerRecording};
use ::csv::{Reader, ReaderBuilder, StringRecord, Trim};
pub(super) use header::separator;
use header::{Header, What};

/// This format.
pub const FORMAT: Format = Format {
    name: "CSV or TSV",
    endings: &["csv", "tsv"],
    unit: Some(LengthUnit::Metre),
    up: Axis::PlusZ,
    forward: Axis::PlusX,
    knows: |_, text| {
        let mut lines = text.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty());
        let apart = |line: &str| line.contains([',', ';', '\t']);
        header::is_section(lines.clone().next().unwrap_or_default()) || lines.next().is_some_and(apart)
    },
    parse: |bytes, choices, repairs| parse(&decoded(bytes, repairs)?, choices, repairs),
};

/// The markers in `text`, whose columns are named as described above.
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
    let repairs = &mut Repairs::refused();
    while let Some(place) = rows.next(&mut record) {
        if record.len() != expected {
            let found = format!("{} cells", record.len());
            return Err(unexpected(place, &found, format!("{expected} cells, as many as names")));
        }
        places.push(place);
        times.push(number(place, &record[0], "a time")?);
        for k in 0..names.len() {
            let cells = [1, 2, 3].map(|i| &record[3 * k + i]);
            points.push(point(place, cells, options, repairs)?);
        }
    }
    if times.is_empty() {
        return Err(ReadError::NoFrames { place: head });
    }
    MarkerRecording::try_new(names, times, points)
        .map_err(|error| ReadError::recording(error, head, |frame| places.get(frame).copied()))
}

/// What is in `text`, by its header.
fn parse(text: &str, choices: &Choices, repairs: &mut Repairs) -> Result<Parsed, ReadError> {
    let (section, skipped) = header::section(text);
    if skipped {
        repairs.decide(Place::Line(1), "sections besides the trajectories are left out");
    }
    let mut rows = Rows::within(text, section, separator(section));
    let mut record = StringRecord::new();
    let header = Header::read(&mut rows, &mut record, repairs)?;
    let Header { place: head, what, .. } = &header;
    if repairs.are_refused() && header.is_plain() && matches!(what, What::Markers(_)) {
        let options = MarkerOptions { convention: choices.convention, nan_is_gap: choices.given.nan_is_gap };
        return Ok(Recording::Markers(read(text, &options)?).into());
    }
    let unit = header.unit.or(choices.given.unit).unwrap_or(header.usual_unit);
    let convention = choices.convention_with(header.up)?.with_unit(unit);
    let options = MarkerOptions { convention, nan_is_gap: choices.given.nan_is_gap };
    let rate = choices.given.rate.or(header.rate);
    let (mut places, mut times, mut points, mut values) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut begun = !record.is_empty();
    loop {
        let place = match std::mem::take(&mut begun) {
            true => header.first,
            false => match rows.next(&mut record) {
                Some(place) => place,
                None => break,
            },
        };
        if record.iter().all(str::is_empty) {
            continue;
        }
        if header::is_section(record.iter().next().unwrap_or_default()) {
            repairs.decide(place, "sections that follow are left out");
            break;
        }
        if record.len() < header.width {
            let found = format!("{} cells", record.len());
            let error = unexpected(place, &found, format!("{} cells, as many as names", header.width));
            repairs.instead_of(error, "a row ends early, what it lacks is missing")?;
        }
        if record.iter().skip(header.width).any(|cell| !cell.is_empty()) {
            let found = format!("{} cells", record.len());
            return Err(unexpected(place, &found, format!("{} cells, as many as names", header.width)));
        }
        let cell = |column: usize| record.get(column).unwrap_or_default();
        places.push(place);
        times.push(header.time(place, &cell, rate, repairs)?);
        match what {
            What::Markers(columns) => {
                for (_, column) in columns {
                    let mut cells = [0, 1, 2].map(|i| cell(column + i));
                    if header.zero_is_gap && cells.iter().all(|cell| cell.parse() == Ok(0.0)) {
                        repairs.decide(place, "a marker at 0, 0, 0 is missing");
                        cells = [""; 3];
                    }
                    points.push(point(place, cells, &options, repairs)?);
                }
            }
            What::Channels(columns) => {
                for (_, column, factor) in columns {
                    values.push(match cell(*column) {
                        missing if missing.is_empty() || is_nan(missing) => f64::NAN,
                        found => factor * number_of_cell(place, found, "a value of a column", repairs)?,
                    });
                }
            }
        }
        // rows that end early are filled: without a bound a long header would make all others long
        if points.len() + values.len() > text.len() {
            let allowed = format!("{} cells, as many as names", header.width);
            return Err(unexpected(place, &format!("{} cells", record.len()), allowed));
        }
    }
    if times.is_empty() {
        return Err(ReadError::NoFrames { place: *head });
    }
    if times.iter().all(Option::is_none) && rate.is_none() && times.len() > 1 {
        return Err(ReadError::NoRate { format: "a table without a column `time`" });
    }
    let times = match rate {
        // without a column of times the rate gives all of them
        Some(rate) if times.iter().all(Option::is_none) => {
            (0..times.len()).map(|i| i as f64 / rate).collect()
        }
        None if times == [None] => vec![0.0],
        _ => times_at_rate(times, &places, rate, repairs)?,
    };
    let fault = |error| ReadError::recording(error, *head, |frame| places.get(frame).copied());
    match what {
        What::Markers(columns) => {
            let names = columns.iter().map(|(name, _)| name.clone()).collect();
            let names = distinct(names, "marker", *head, repairs)?;
            let recording = MarkerRecording::try_new(names, times, points).map_err(fault)?;
            Ok(Recording::Markers(recording).into())
        }
        What::Channels(columns) => {
            let names = columns.iter().map(|(name, ..)| name.clone()).collect();
            let names = distinct(names, "column", *head, repairs)?;
            let recording = ChannelRecording::try_new(names, times, values).map_err(fault)?;
            Ok(Recording::Channels(recording).into())
        }
    }
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
        Self::within(text, text, b',')
    }

    /// The rows of the end `part` of a text, with this character between cells.
    pub(super) fn within(text: &'t str, part: &'t str, separator: u8) -> Self {
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).comment(Some(b'#')).trim(Trim::All).delimiter(separator);
        let before = text.len() - part.len();
        let line = 1 + text[..before].matches('\n').count();
        Self { reader: builder.from_reader(part.as_bytes()), text: part, line, counted: 0 }
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
