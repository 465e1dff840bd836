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
//! missing in that frame.
//!
//! What [`read_repaired`] takes besides, as OpenSim, Cortex, Pose2Sim, OpenCap, MOTEK, BTK and spreadsheets write it: numbers of
//! frames and markers that are not those of what follows; cells separated by runs of tabs, commas, semicolons or blanks; a row of
//! coordinates or of a blank line that is not there; columns and cells that are empty; rows that end early; columns of
//! coordinates without a name; NaN; decimal commas; frames without a number or a time; repeated names.

use super::{
    Choices, Format, MarkerOptions, Parsed, Place, ReadError, Repairs, decoded, distinct, number,
    number_of_cell, point, times_at_rate, unexpected,
};
use crate::recording::{Axis, LengthUnit, MarkerRecording};

/// Where a marker was, if it was seen.
type Point = Option<nalgebra::Vector3<f64>>;

/// What stands between cells.
#[derive(Clone, Copy, PartialEq)]
enum Separator {
    Character(char),
    Blanks,
}

impl Separator {
    /// That of a line: a tab, or the first of the others that is in it.
    fn of(line: &str) -> Self {
        let found = ['\t', ';', ','].into_iter().find(|c| line.contains(*c));
        found.map_or(Self::Blanks, Self::Character)
    }

    /// Cells of a line without what surrounds them.
    fn cells(self, line: &str) -> Vec<&str> {
        let bare = |cell| str::trim_matches(str::trim(cell), '"').trim();
        match self {
            Self::Character(c) => line.split(c).map(bare).collect(),
            Self::Blanks => line.split_whitespace().map(bare).collect(),
        }
    }
}

/// Values under names: the two lines after the first.
struct Header<'a> {
    names: Vec<&'a str>,
    values: Vec<&'a str>,
}

impl<'a> Header<'a> {
    const PLACE: Place = Place::Line(3);

    /// Values stand under their names, or at least in their order, without empty cells.
    fn new(names: &'a str, values: &'a str) -> Self {
        let cells = |line: &'a str| Separator::of(line).cells(line);
        let (names, values) = (cells(names), cells(values));
        let full = |cells: &[&str]| cells.iter().filter(|cell| !cell.is_empty()).count();
        let in_columns =
            names.iter().zip(&values).filter(|(name, value)| !name.is_empty() && !value.is_empty());
        if full(&names) == full(&values) && in_columns.count() < full(&names) {
            let filled = |cells: Vec<&'a str>| cells.into_iter().filter(|cell| !cell.is_empty()).collect();
            return Self { names: filled(names), values: filled(values) };
        }
        Self { names, values }
    }

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

    /// Compares a number that is declared with what there is.
    fn compare(
        &self,
        name: &str,
        quantity: &'static str,
        found: usize,
        repairs: &mut Repairs,
    ) -> Result<(), ReadError> {
        let found = found as u64;
        match self.count(name) {
            Ok(declared) if declared == found => Ok(()),
            Ok(declared) => repairs.instead_of(
                ReadError::Misdeclared { place: Self::PLACE, quantity, declared, found },
                format!("{declared} {quantity} are declared, {found} are there"),
            ),
            Err(error) => {
                repairs.instead_of(error, format!("{name} is not declared, {quantity} are counted"))
            }
        }
    }
}

/// This format.
pub const FORMAT: Format = Format {
    name: "TRC",
    endings: &["trc"],
    unit: Some(LengthUnit::Metre),
    up: Axis::PlusY,
    forward: Axis::PlusX,
    knows: |_, text| text.starts_with("PathFileType") || text.starts_with("\"PathFileType"),
    parse: |bytes, &Choices { convention, given }, repairs| {
        let text = decoded(bytes, repairs)?;
        let options = MarkerOptions { convention, nan_is_gap: given.nan_is_gap };
        let (recording, convention) = parse(&text, &options, given.rate, repairs)?;
        Ok(Parsed::markers(recording, convention))
    },
};

/// The recording in the `text` of a TRC file that has no need of repairs; the unit of `options` is not used.
pub fn read(text: &str, options: &MarkerOptions) -> Result<MarkerRecording, ReadError> {
    read_repaired(text, options, &mut Repairs::refused())
}

/// The same with repairs; the unit of `options` is that of files without one.
pub fn read_repaired(
    text: &str,
    options: &MarkerOptions,
    repairs: &mut Repairs,
) -> Result<MarkerRecording, ReadError> {
    parse(text, options, None, repairs).map(|(recording, _)| recording)
}

fn parse(
    text: &str,
    options: &MarkerOptions,
    rate: Option<f64>,
    repairs: &mut Repairs,
) -> Result<(MarkerRecording, crate::recording::Convention), ReadError> {
    let lines: Vec<&str> = text.lines().collect();
    let end = Place::Line(lines.len().max(1));
    let need = |i: usize, allowed: &str| {
        let line = lines.get(i).copied();
        line.ok_or_else(|| ReadError::Truncated { place: end, allowed: allowed.to_owned() })
    };
    let first = need(0, "PathFileType")?;
    if !first.trim_start_matches(['"', ' ', '\t']).starts_with("PathFileType") {
        return Err(unexpected(Place::Line(1), first, "PathFileType"));
    }
    let header = Header::new(need(1, "the row of names")?, need(2, "the row of values")?);
    let unit = match header.value("Units") {
        Ok(unit) => {
            LengthUnit::from_name(unit).ok_or_else(|| unexpected(Header::PLACE, unit, LengthUnit::NAMES))?
        }
        Err(error) => {
            let unit = options.convention.unit();
            repairs.instead_of(error, format!("no unit is declared, {} is taken", unit.symbol()))?;
            unit
        }
    };
    let options = MarkerOptions { convention: options.convention.with_unit(unit), ..*options };
    let rate = rate.or_else(|| header.value("DataRate").ok()?.parse().ok());

    let line = need(3, "the row of markers")?;
    let place = Place::Line(4);
    let separator = Separator::of(line);
    if separator != Separator::Character('\t') {
        repairs.instead_of(
            unexpected(place, line, "cells that are apart by tabs"),
            "cells are not apart by tabs",
        )?;
    }
    // coordinates have names, unless the row is left out
    let coordinates = need(4, "the row of coordinates")?;
    let axes: Vec<&str> = separator.cells(coordinates);
    let is_data = axes.first().is_some_and(|cell| cell.parse::<f64>().is_ok());
    let mut rows = 5;
    if is_data {
        let allowed = "the row of coordinates";
        repairs
            .instead_of(unexpected(Place::Line(5), coordinates, allowed), "there is no row of coordinates")?;
        rows = 4;
    }
    let data: Vec<(usize, &str)> = lines
        .iter()
        .enumerate()
        .skip(rows)
        .filter(|(_, line)| line.contains(|c: char| !c.is_whitespace() && c != ',' && c != ';' && c != '"'))
        .map(|(i, line)| (i + 1, *line))
        .collect();
    if data.is_empty() {
        return Err(ReadError::NoFrames { place: end });
    }
    let columns = Columns::new(place, line, separator, &axes, &data, &header, repairs)?;
    let n = columns.names.len();
    // rows that end early are filled: without a bound a long one would make all others long
    if n.saturating_mul(data.len()) > text.len() {
        let (quantity, found) = ("cells", text.len() as u64);
        return Err(ReadError::Misdeclared {
            place: Header::PLACE,
            quantity,
            declared: (n as u64).saturating_mul(data.len() as u64),
            found,
        });
    }
    let (mut places, mut times) = (Vec::with_capacity(data.len()), Vec::with_capacity(data.len()));
    let mut points = Vec::with_capacity(n * data.len());
    for (i, &(row, line)) in data.iter().enumerate() {
        let place = Place::Line(row);
        let cells = separator.cells(line);
        let last = i + 1 == data.len() && !text.ends_with(['\n', '\r']);
        let is_short = cells.len() < columns.first + 3 * n;
        if last && i > 0 && is_short && !repairs.are_refused() {
            repairs.make(place, "the last row is incomplete and left out")?;
            break;
        }
        let (time, found) = columns.frame(place, &cells, &options, repairs)?;
        places.push(place);
        times.push(time);
        points.extend(found);
    }
    header.compare("NumFrames", "frames", times.len(), repairs)?;
    let times = times_at_rate(times, &places, rate, repairs)?;
    let (names, points) = columns.without_empty(points, repairs)?;
    let recording = MarkerRecording::try_new(names, times, points)
        .map_err(|error| ReadError::recording(error, place, |frame| places.get(frame).copied()))?;
    Ok((recording, options.convention))
}

/// Which cells of a row are whose.
struct Columns {
    /// One for each three coordinates.
    names: Vec<String>,
    /// Whether the file names it.
    named: Vec<bool>,
    /// The column of the first X.
    first: usize,
    place: Place,
}

impl Columns {
    fn new(
        place: Place,
        line: &str,
        separator: Separator,
        axes: &[&str],
        data: &[(usize, &str)],
        header: &Header,
        repairs: &mut Repairs,
    ) -> Result<Self, ReadError> {
        let labels = separator.cells(line);
        if labels.len() < 3 {
            return Err(unexpected(place, line, "Frame#, Time and the names of markers"));
        }
        let found: Vec<(usize, &str)> =
            labels.iter().copied().enumerate().skip(2).filter(|(_, name)| !name.is_empty()).collect();
        header.compare("NumMarkers", "markers", found.len(), repairs)?;
        // the first coordinate stands where the row of coordinates has it, if all that is before it is empty
        let width = |line: &str| {
            let cells = separator.cells(line);
            cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1)
        };
        let first_row = separator.cells(data[0].1);
        let above = axes.iter().position(|axis| axis.starts_with(['X', 'x'])).unwrap_or(2);
        let blank = first_row.get(2..above).is_some_and(|cells| cells.iter().all(|cell| cell.is_empty()));
        let first = if above > 2 && blank { above } else { 2 };
        if first > 2 {
            let allowed = "coordinates from column 3 on";
            repairs.instead_of(
                unexpected(place, line, allowed),
                "empty columns stand before the first marker",
            )?;
        }
        let start = found.first().map_or(first, |(column, _)| (*column).max(first));
        let stands = |(k, (column, _)): (usize, &(usize, &str))| {
            if repairs.are_refused() { *column == first + 3 * k } else { column % 3 == start % 3 }
        };
        let all_stand = found.iter().enumerate().all(stands);
        let offset = (start - first) / 3;
        let slot =
            |k: usize, column: usize| if all_stand { offset + (column.max(start) - start) / 3 } else { k };
        if let (false, Some((k, (_, name)))) =
            (all_stand, found.iter().enumerate().find(|(k, (column, _))| *column != first + 3 * k))
        {
            let allowed = format!("`{name}` in column {}, above its X", 1 + first + 3 * k);
            repairs.instead_of(
                unexpected(place, line, allowed),
                "names do not stand above their X and are taken in their order",
            )?;
        }
        let n_named =
            found.iter().enumerate().map(|(k, (column, _))| slot(k, *column) + 1).max().unwrap_or(0);
        let widest = data.iter().map(|(_, line)| width(line)).max().unwrap_or(0);
        // in runs of tabs empty cells mean nothing, and all rows have the same number of others
        let n_data = widest.saturating_sub(first).div_ceil(3);
        let full = |line: &str| separator.cells(line).iter().filter(|cell| !cell.is_empty()).count();
        let in_runs = n_data > n_named && data.iter().all(|(_, line)| full(line) == 2 + 3 * n_named);
        // rows may lack markers at their ends; but where none is whole and all end within a point, cells are something else
        let per_marker = |line: &str| full(line) == 2 + n_named && n_named > 1;
        let within = |line: &str| width(line).saturating_sub(first) % 3 != 0;
        let is_cut = data.iter().all(|(_, line)| width(line) < first + 3 * n_named);
        let all = |holds: &dyn Fn(&str) -> bool| data.iter().all(|(_, line)| holds(line));
        if is_cut && (all(&per_marker) || all(&within)) {
            let allowed = format!("{} cells for {n_named} markers", first + 3 * n_named);
            return Err(unexpected(Place::Line(data[0].0), &format!("{} cells", width(data[0].1)), allowed));
        }
        let n = if in_runs || repairs.are_refused() { n_named } else { n_named.max(n_data) };
        let mut names = vec![String::new(); n];
        for (k, (column, name)) in found.iter().enumerate() {
            names[slot(k, *column)] = (*name).to_owned();
        }
        let named = names.iter().map(|name| !name.is_empty()).collect();
        Ok(Self { names, named, first, place })
    }

    /// The time and the points of one row.
    fn frame(
        &self,
        place: Place,
        cells: &[&str],
        options: &MarkerOptions,
        repairs: &mut Repairs,
    ) -> Result<(Option<f64>, Vec<Point>), ReadError> {
        let expected = self.first + 3 * self.names.len();
        let full: Vec<&str> = cells.iter().copied().filter(|cell| !cell.is_empty()).collect();
        let beyond = cells.get(expected..).unwrap_or_default();
        let allowed = || format!("{expected} cells for {} markers", self.names.len());
        let wrong = || unexpected(place, &format!("{} cells", cells.len()), allowed());
        let mut compact;
        let mut cells = cells;
        if beyond.iter().any(|cell| !cell.is_empty()) {
            if full.len() != 2 + 3 * self.names.len() {
                return Err(wrong());
            }
            repairs.instead_of(wrong(), "cells are apart by runs of tabs")?;
            compact = full;
            compact.splice(2..2, std::iter::repeat_n("", self.first - 2));
            cells = &compact;
        } else if cells.len() < expected {
            repairs.instead_of(wrong(), "a row ends early, the markers that it lacks are missing")?;
        }
        let cell = |k: usize| cells.get(k).copied().unwrap_or_default();
        if let Err(error) = number(place, cell(0), "the number of a frame") {
            repairs.instead_of(error, "a frame has no number")?;
        }
        let time = match cell(1) {
            "" if !repairs.are_refused() => None,
            time => Some(number_of_cell(place, time, "a time", repairs)?),
        };
        let mut points = Vec::with_capacity(self.names.len());
        for k in 0..self.names.len() {
            let at = self.first + 3 * k;
            points.push(point(place, [cell(at), cell(at + 1), cell(at + 2)], options, repairs)?);
        }
        Ok((time, points))
    }

    /// The names, and the points without columns that have neither a name nor a coordinate.
    fn without_empty(
        self,
        points: Vec<Point>,
        repairs: &mut Repairs,
    ) -> Result<(Vec<String>, Vec<Point>), ReadError> {
        let n = self.names.len();
        let mut keep = self.named;
        for frame in points.chunks_exact(n.max(1)) {
            keep.iter_mut().zip(frame).for_each(|(keep, point)| *keep |= point.is_some());
        }
        let place = self.place;
        if keep.iter().all(|keep| *keep) {
            return Ok((distinct(self.names, "marker", place, repairs)?, points));
        }
        repairs.make(place, "columns without a name and without coordinates are left out")?;
        let names =
            self.names.into_iter().zip(&keep).filter(|(_, keep)| **keep).map(|(name, _)| name).collect();
        let kept = points.iter().enumerate().filter(|(k, _)| keep[k % n]).map(|(_, point)| *point).collect();
        Ok((distinct(names, "marker", place, repairs)?, kept))
    }
}
