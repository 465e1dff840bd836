//! TRC, the track row column format of Motion Analysis and OpenSim: markers, separated by tabs.
//!
//! ```text
//! PathFileType  4  (X/Y/Z)  jump.trc
//! DataRate  CameraRate  NumFrames  NumMarkers  Units  OrigDataRate  OrigDataStartFrame  OrigNumFrames
//! 100  100  2  1  mm  100  1  2
//! Frame#  Time  hip
//!               X1  Y1  Z1
//!
//! 1  0.00  10.5  900  3
//! 2  0.01  10.6  901  3
//! ```
//! The unit is the file's, the axes are the caller's: OpenSim has y up and x forward. A marker with empty cells is
//! missing in that frame. NumFrames and NumMarkers must be those of what follows.

use super::{Choices, Format, MarkerOptions, Place, ReadError, number, point, text, unexpected};
use crate::recording::{Axis, LengthUnit, MarkerRecording};

/// Cells of a line without what surrounds them.
fn cells(line: &str) -> Vec<&str> {
    line.split('\t').map(str::trim).collect()
}

/// Values under names: the two lines after the first.
struct Header<'a> {
    names: Vec<&'a str>,
    values: Vec<&'a str>,
}

impl<'a> Header<'a> {
    const PLACE: Place = Place::Line(3);

    fn value(&self, name: &str) -> Result<&'a str, ReadError> {
        let Some(column) = self.names.iter().position(|n| n.eq_ignore_ascii_case(name)) else {
            let found = self.names.join(" ");
            return Err(unexpected(Place::Line(2), &found, format!("a row of names with {name}")));
        };
        let value = self.values.get(column).copied().filter(|v| !v.is_empty());
        value.ok_or_else(|| unexpected(Self::PLACE, "", format!("a value of {name}")))
    }

    fn count(&self, name: &str) -> Result<u64, ReadError> {
        let value = self.value(name)?;
        value.parse().map_err(|_| unexpected(Self::PLACE, value, format!("{name}, a whole number")))
    }
}

pub(super) const FORMAT: Format = Format {
    name: "TRC",
    endings: &["trc"],
    unit: Some(LengthUnit::Metre),
    up: Axis::PlusY,
    forward: Axis::PlusX,
    parse: |bytes, &Choices { convention, nan_is_gap, .. }| {
        Ok(read(text(bytes)?, &MarkerOptions { convention, nan_is_gap })?.into())
    },
};

/// The recording in the `text` of a TRC file; the unit of `options` is not used.
pub fn read(text: &str, options: &MarkerOptions) -> Result<MarkerRecording, ReadError> {
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line));
    let end = Place::Line(text.lines().count());
    let mut need = |allowed: &str| {
        lines.next().ok_or_else(|| ReadError::Truncated { place: end, allowed: allowed.to_owned() })
    };
    let (_, first) = need("PathFileType")?;
    if !first.trim_start().starts_with("PathFileType") {
        return Err(unexpected(Place::Line(1), first, "PathFileType"));
    }
    let names = cells(need("the row of names")?.1);
    let header = Header { names, values: cells(need("the row of values")?.1) };
    let unit = header.value("Units")?;
    let unit =
        LengthUnit::from_name(unit).ok_or_else(|| unexpected(Header::PLACE, unit, LengthUnit::NAMES))?;
    let options = MarkerOptions { convention: options.convention.with_unit(unit), ..*options };
    let (n_frames, n_markers) = (header.count("NumFrames")?, header.count("NumMarkers")?);

    let (row, line) = need("the row of markers")?;
    let place = Place::Line(row);
    let columns = cells(line);
    if columns.len() < 3 {
        return Err(unexpected(place, line, "Frame#, Time and the names of markers"));
    }
    let names: Vec<String> =
        columns[2..].iter().filter(|name| !name.is_empty()).map(|name| (*name).to_owned()).collect();
    if names.len() as u64 != n_markers {
        let (quantity, found) = ("markers", names.len() as u64);
        return Err(ReadError::Misdeclared { place: Header::PLACE, quantity, declared: n_markers, found });
    }
    for (k, name) in names.iter().enumerate() {
        if columns.get(2 + 3 * k) != Some(&name.as_str()) {
            return Err(unexpected(place, line, format!("`{name}` in column {}, above its X", 3 + 3 * k)));
        }
    }
    need("the row of coordinates")?;

    let (mut places, mut times, mut points) = (Vec::new(), Vec::new(), Vec::new());
    for (row, line) in lines {
        if line.trim().is_empty() {
            continue;
        }
        places.push(Place::Line(row));
        frame(Place::Line(row), line, names.len(), &options, &mut times, &mut points)?;
    }
    if times.is_empty() {
        return Err(ReadError::NoFrames { place: end });
    }
    if times.len() as u64 != n_frames {
        let (quantity, found) = ("frames", times.len() as u64);
        return Err(ReadError::Misdeclared { place: Header::PLACE, quantity, declared: n_frames, found });
    }
    MarkerRecording::try_new(names, times, points)
        .map_err(|error| ReadError::recording(error, place, |frame| places.get(frame).copied()))
}

/// One row of coordinates.
fn frame(
    place: Place,
    line: &str,
    n_markers: usize,
    options: &MarkerOptions,
    times: &mut Vec<f64>,
    points: &mut Vec<Option<nalgebra::Vector3<f64>>>,
) -> Result<(), ReadError> {
    let cells = cells(line);
    let expected = 2 + 3 * n_markers;
    let beyond = cells.get(expected..).unwrap_or_default();
    if cells.len() < expected || beyond.iter().any(|cell| !cell.is_empty()) {
        let found = format!("{} cells", cells.len());
        return Err(unexpected(place, &found, format!("{expected} cells for {n_markers} markers")));
    }
    number(place, cells[0], "the number of a frame")?;
    times.push(number(place, cells[1], "a time")?);
    for cells in cells[2..expected].chunks_exact(3) {
        points.push(point(place, [cells[0], cells[1], cells[2]], options)?);
    }
    Ok(())
}
