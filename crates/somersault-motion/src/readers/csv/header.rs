//! What the columns of a table are, by the rows above its numbers.

use super::Rows;
use crate::readers::{Place, ReadError, Repairs, number_of_cell, shorten, unexpected};
use crate::recording::{Axis, LengthUnit};
use ::csv::StringRecord;

/// The first lines of sections that Vicon Nexus exports, that of markers first.
const SECTIONS: [&str; 5] = ["trajectories", "model outputs", "devices", "joints", "segments"];
/// Rows that a header may have.
const MOST: usize = 40;

/// What a header says by a key and the value after it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Key {
    Rate,
    CaptureRate,
    Unit,
    /// That of Motive, whose y is up.
    Version,
    Space,
}

/// Keys of Motive that do not change what a table means: of the take, and of rotations, which markers have not.
const WITHOUT_EFFECT: [&str; 7] = [
    "take name",
    "take notes",
    "capture start time",
    "capture start frame",
    "total frames in take",
    "total exported frames",
    "rotation type",
];

impl Key {
    fn of(cell: &str) -> Option<Self> {
        const KEYS: [(&str, Key); 6] = [
            ("export frame rate", Key::Rate),
            ("frequency", Key::Rate),
            ("capture frame rate", Key::CaptureRate),
            ("length units", Key::Unit),
            ("format version", Key::Version),
            ("coordinate space", Key::Space),
        ];
        KEYS.iter().find(|(name, _)| cell.eq_ignore_ascii_case(name)).map(|(_, key)| *key)
    }
}

/// What is in a table.
pub(super) enum What {
    /// The name of each marker, and the column of its first coordinate.
    Markers(Vec<(String, usize)>),
    /// The name of each column, its number, and what its numbers are multiplied by.
    Channels(Vec<(String, usize, f64)>),
}

/// A header and what follows from it.
pub(super) struct Header {
    /// The row of names.
    pub(super) place: Place,
    /// The first row of numbers.
    pub(super) first: Place,
    pub(super) what: What,
    /// Cells that rows have.
    pub(super) width: usize,
    /// The unit that the file declares, and that of the program where neither the file nor the caller says one.
    pub(super) unit: Option<LengthUnit>,
    pub(super) usual_unit: LengthUnit,
    pub(super) up: Axis,
    /// Frames a second.
    pub(super) rate: Option<f64>,
    /// Whether markers that are missing stand at the origin.
    pub(super) zero_is_gap: bool,
    /// The column of times, and the seconds of its unit.
    time: Option<(usize, f64)>,
    /// The columns of the number of the frame and, of what is sampled more often, of the number within it.
    frame: Option<usize>,
    sub_frame: Option<usize>,
    names: Vec<String>,
}

/// Whether a line is the first of a section.
pub(super) fn is_section(line: &str) -> bool {
    let bare = line.trim_matches([',', ';', '\t', ' ', '"', '\r']);
    SECTIONS.iter().any(|section| bare.eq_ignore_ascii_case(section))
}

/// The part of a text from its section of trajectories on, or all of it; and whether something stands before that.
pub(super) fn section(text: &str) -> (&str, bool) {
    if !is_section(text.lines().next().unwrap_or_default()) {
        return (text, false);
    }
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        if line.len() < 64 + line.matches([',', ';', '\t']).count()
            && line.trim_matches([',', ';', '\t', ' ', '"', '\r', '\n']).eq_ignore_ascii_case(SECTIONS[0])
        {
            return (&text[at..], at > 0);
        }
        at += line.len();
    }
    (text, false)
}

/// What stands between cells: a tab or a semicolon where most lines have one, and else a comma, which may be decimal.
pub(in crate::readers) fn separator(text: &str) -> u8 {
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).take(30).collect();
    let usual = |c: char| 2 * lines.iter().filter(|line| line.contains(c)).count() >= lines.len().max(1);
    if usual('\t') {
        b'\t'
    } else if usual(';') {
        b';'
    } else {
        b','
    }
}

/// The axis, from 0, that a cell of a row of coordinates names.
fn axis_of(cell: &str) -> Option<usize> {
    let bare = cell.trim_end_matches(|c: char| c.is_ascii_digit());
    ["x", "y", "z"].iter().position(|axis| bare.eq_ignore_ascii_case(axis))
}

/// The name of a column without its coordinate, and which that is: `hip_x`, `hip:X`, `hip.x`, `hip X`, `hip[0]`.
fn coordinate(name: &str) -> Option<(&str, usize)> {
    if let Some((stem, index)) = name.strip_suffix(']').and_then(|name| name.rsplit_once('[')) {
        let axis = ["0", "1", "2"].iter().position(|i| *i == index)?;
        return Some((stem.trim(), axis)).filter(|(stem, _)| !stem.is_empty());
    }
    let last = name.chars().next_back()?;
    let axis = ['x', 'y', 'z'].iter().position(|axis| last.eq_ignore_ascii_case(axis))?;
    let stem = name[..name.len() - 1].trim_end();
    let stem = match stem.strip_suffix(['_', ':', '.', '-', '/']) {
        Some(stem) => stem,
        None if stem.len() + 1 < name.len() => stem,
        None => return None,
    };
    Some((stem.trim(), axis)).filter(|(stem, _)| !stem.is_empty())
}

/// A name without the unit in brackets behind it, and that unit.
fn without_unit(name: &str) -> (&str, Option<&str>) {
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((stem, unit)) = name.strip_suffix(close).and_then(|name| name.rsplit_once(open))
            && unit.parse::<usize>().is_err()
        {
            return (stem.trim_end(), Some(unit.trim()));
        }
    }
    (name, None)
}

/// The seconds of the unit of a column of times.
fn time_column(name: &str) -> Option<f64> {
    let (stem, unit) = without_unit(name);
    let stem = stem.to_ascii_lowercase();
    let (stem, unit) = match (stem.as_str(), unit) {
        ("time_ms" | "timestamp_ms" | "t_ms", None) => ("time", Some("ms")),
        ("time_s" | "time_sec" | "timestamp_s" | "seconds" | "secs", None) => ("time", Some("s")),
        (stem, unit) => (stem, unit),
    };
    if !["time", "t", "timestamp", "times"].contains(&stem) {
        return None;
    }
    match unit.map(str::to_ascii_lowercase).as_deref() {
        None | Some("s" | "sec" | "secs" | "second" | "seconds") => Some(1.0),
        Some("ms" | "millisecond" | "milliseconds") => Some(1e-3),
        Some("us" | "µs" | "microseconds") => Some(1e-6),
        Some(_) => None,
    }
}

fn is_frame(name: &str) -> bool {
    let known = [
        "frame",
        "frame#",
        "frames",
        "frame number",
        "frame_number",
        "field",
        "field#",
        "sample",
        "index",
        "item",
        "#",
    ];
    known.iter().any(|known| name.eq_ignore_ascii_case(known))
}

fn is_sub_frame(name: &str) -> bool {
    ["sub frame", "subframe", "sub_frame"].iter().any(|known| name.eq_ignore_ascii_case(known))
}

/// A cell that holds a number or nothing.
fn is_number(cell: &str) -> bool {
    cell.parse::<f64>().is_ok() || cell.replacen(',', ".", 1).parse::<f64>().is_ok()
}

/// Whether a row is one of numbers: its first cell is one, and it is not alone, unless cells of names are above it.
fn is_data(record: &StringRecord, above: Option<&[String]>) -> bool {
    let mut full = record.iter().filter(|cell| !cell.is_empty());
    let named =
        |row: &[String]| row.len() == record.len() && row.iter().filter(|cell| !cell.is_empty()).count() > 1;
    (full.clone().count() > 1 || above.is_some_and(named)) && full.next().is_some_and(is_number)
}

impl Header {
    /// Reads rows up to the first of numbers, which is left in `record`.
    pub(super) fn read(
        rows: &mut Rows,
        record: &mut StringRecord,
        repairs: &mut Repairs,
    ) -> Result<Self, ReadError> {
        let mut above: Vec<(Place, Vec<String>)> = Vec::new();
        let first = loop {
            let Some(place) = rows.next(record) else {
                let Some((place, _)) = above.last() else {
                    let (place, allowed) = (Place::Line(1), "the names of columns".to_owned());
                    return Err(ReadError::Truncated { place, allowed });
                };
                record.clear();
                break *place;
            };
            if is_data(record, above.last().map(|(_, row)| row.as_slice())) {
                break place;
            }
            if above.len() == MOST {
                let found = record.iter().next().unwrap_or_default();
                return Err(unexpected(
                    place,
                    found,
                    format!("numbers, after at most {MOST} lines of a header"),
                ));
            }
            above.push((place, record.iter().map(str::to_owned).collect()));
        };
        let Some((place, names)) = above.last() else {
            return Err(unexpected(
                first,
                &record.iter().collect::<Vec<_>>().join(","),
                "the names of columns",
            ));
        };
        let mut header = Self {
            place: *place,
            first,
            what: What::Channels(Vec::new()),
            width: names.len(),
            unit: None,
            usual_unit: LengthUnit::Metre,
            up: Axis::PlusZ,
            rate: None,
            zero_is_gap: false,
            time: None,
            frame: None,
            sub_frame: None,
            names: names.clone(),
        };
        header.declared(&above, repairs)?;
        let is_axes =
            |(_, row): &&(Place, Vec<String>)| row.iter().filter(|cell| axis_of(cell).is_some()).count() >= 3;
        if let Some(axes) = above.iter().rposition(|row| is_axes(&row)) {
            header.stacked(&above, axes, repairs)?;
        } else if let Some((place, row)) =
            above.iter().find(|(_, row)| row[0].eq_ignore_ascii_case("MARKER_NAMES"))
        {
            header.qualisys(*place, &row[1..], record)?;
        } else {
            header.plain(repairs)?;
        }
        Ok(header)
    }

    /// Whether the header is the one row of names that this library writes.
    pub(super) fn is_plain(&self) -> bool {
        self.names.first().is_some_and(|name| name.eq_ignore_ascii_case("time")) && self.rate.is_none()
    }

    /// What rows of keys and values declare.
    fn declared(&mut self, above: &[(Place, Vec<String>)], repairs: &mut Repairs) -> Result<(), ReadError> {
        for (k, (place, row)) in above.iter().enumerate() {
            for pair in row.windows(2) {
                // cells that are no keys are values, or names of columns
                let Some(key) = Key::of(&pair[0]) else { continue };
                match key {
                    Key::Rate => {
                        self.rate = Some(number_of_cell(*place, &pair[1], "frames a second", repairs)?);
                    }
                    Key::CaptureRate => {
                        let rate = number_of_cell(*place, &pair[1], "frames a second", repairs)?;
                        self.rate = self.rate.or(Some(rate));
                    }
                    Key::Unit => {
                        let unit = LengthUnit::from_name(&pair[1]);
                        self.unit =
                            Some(unit.ok_or_else(|| unexpected(*place, &pair[1], LengthUnit::NAMES))?);
                    }
                    Key::Version => self.up = Axis::PlusY,
                    Key::Space => {
                        if !pair[1].eq_ignore_ascii_case("global") {
                            return Err(unexpected(*place, &pair[1], "Global, coordinates in the world"));
                        }
                    }
                }
            }
            // Motive: keys and values take turns
            if row.first().is_some_and(|cell| Key::of(cell) == Some(Key::Version)) {
                let keys = row.iter().step_by(2).filter(|key| !key.is_empty());
                let is_known = |key: &str| {
                    Key::of(key).is_some()
                        || WITHOUT_EFFECT.iter().any(|known| key.eq_ignore_ascii_case(known))
                };
                for key in keys.filter(|key| !is_known(key)) {
                    let key = shorten(key, 60);
                    repairs.decide(*place, format!("`{key}` of the header is not known and is not used"));
                }
            }
            // Nexus: the rate stands alone below the name of the section
            let cell = row.first().map(String::as_str).unwrap_or_default();
            if k == 1 && is_section(&above[0].1[0]) && row.iter().skip(1).all(String::is_empty) {
                self.rate = Some(number_of_cell(*place, cell, "frames a second", repairs)?);
            }
        }
        self.rate = self.rate.filter(|rate| *rate > 0.0 && rate.is_finite());
        Ok(())
    }

    /// Finds the columns of frames and times.
    fn find_times(&mut self, row: &[String]) {
        for (column, name) in row.iter().enumerate() {
            if self.time.is_none() && column < 3 {
                self.time = time_column(name).map(|unit| (column, unit));
            }
            if self.frame.is_none() && column < 2 && is_frame(name) {
                self.frame = Some(column);
            }
            if self.sub_frame.is_none() && column < 3 && is_sub_frame(name) {
                self.sub_frame = Some(column);
            }
        }
    }

    /// Columns under names in several rows, the last of which has X, Y and Z.
    fn stacked(
        &mut self,
        above: &[(Place, Vec<String>)],
        axes: usize,
        repairs: &mut Repairs,
    ) -> Result<(), ReadError> {
        let (place, row) = &above[axes];
        self.place = *place;
        self.width = row.len();
        self.find_times(row);
        let cell = |row: &[String], column: usize| row.get(column).cloned().unwrap_or_default();
        let labelled = |label: &str| {
            let found = above[..axes]
                .iter()
                .find(|(_, row)| row.iter().take(2).any(|cell| cell.eq_ignore_ascii_case(label)));
            found.map(|(_, row)| row.as_slice())
        };
        let is_kind = |row: &[String]| row.iter().any(|cell| cell.eq_ignore_ascii_case("Position"));
        let kinds = above[..axes].iter().rev().map(|(_, row)| row.as_slice()).find(|row| is_kind(row));
        let nearest = above[..axes].iter().rev().map(|(_, row)| row.as_slice()).find(|row| !is_kind(row));
        let Some(names) = labelled("Name").or(nearest) else {
            return Err(unexpected(*place, &row.join(","), "a row of names above that of X, Y and Z"));
        };
        let units = above.get(axes + 1).map(|(_, row)| row.as_slice()).unwrap_or_default();
        let mut found = Vec::new();
        let mut column = 0;
        while column + 2 < row.len() {
            let is_triple = (0..3).all(|i| axis_of(&row[column + i]) == Some(i));
            if !is_triple {
                column += 1;
                continue;
            }
            // quaternions and other rotations have axes too
            let is_position = kinds.is_none_or(|kinds| cell(kinds, column).eq_ignore_ascii_case("Position"));
            if is_position {
                found.push((cell(names, column), column));
            }
            column += 3;
        }
        if found.is_empty() {
            return Err(unexpected(*place, &row.join(","), "X, Y and Z of at least one marker"));
        }
        // of a take of Motive markers as they were measured come first, then what was solved of them
        if let Some(types) = labelled("Type") {
            for kind in ["Marker", "Rigid Body Marker", "Bone Marker", "Bone", "Rigid Body"] {
                let of_kind = |(_, column): &(String, usize)| cell(types, *column).eq_ignore_ascii_case(kind);
                let n = found.iter().filter(|entry| of_kind(entry)).count();
                if n > 0 {
                    if n < found.len() {
                        repairs.decide(*place, format!("columns of other types than {kind} are left out"));
                    }
                    found.retain(of_kind);
                    break;
                }
            }
        }
        let unit = found.first().map(|(_, column)| cell(units, *column)).unwrap_or_default();
        if self.unit.is_none() && !unit.is_empty() {
            self.unit = LengthUnit::from_name(&unit);
            if self.unit.is_none() {
                // angles, forces and other outputs of a model
                let factor = |column: usize| {
                    if cell(units, column).eq_ignore_ascii_case("deg") { 1f64.to_radians() } else { 1.0 }
                };
                if factor(found[0].1) != 1.0 {
                    repairs.decide(*place, "angles are converted from degrees to radians");
                }
                let columns = found.iter().flat_map(|(name, column)| {
                    [0, 1, 2]
                        .map(|i| (format!("{name}_{}", ["x", "y", "z"][i]), column + i, factor(column + i)))
                });
                self.what = What::Channels(columns.collect());
                return Ok(());
            }
        }
        let prefix = found.first().and_then(|(name, _)| Some(name.split_once(':')?.0.to_owned() + ":"));
        if let Some(prefix) =
            prefix.filter(|p| found.iter().all(|(name, _)| name.len() > p.len() && name.starts_with(p)))
        {
            found.iter_mut().for_each(|(name, _)| drop(name.drain(..prefix.len())));
            repairs.decide(*place, "the name of the subject before those of markers is left out");
        }
        self.what = What::Markers(found);
        Ok(())
    }

    /// Names of markers in a row of their own, of QTM.
    fn qualisys(&mut self, place: Place, names: &[String], first: &StringRecord) -> Result<(), ReadError> {
        let names: Vec<&String> = names.iter().filter(|name| !name.is_empty()).collect();
        let last = self.names.clone();
        self.find_times(&last);
        let columns = [self.time.map(|(column, _)| column), self.frame].into_iter().flatten().max();
        let row_of_names = columns.is_some();
        let full = first
            .iter()
            .enumerate()
            .filter(|(_, cell)| !cell.is_empty())
            .last()
            .map_or(0, |(last, _)| last + 1);
        let expected = 3 * names.len();
        // without a row of names, what is more than coordinates is the number of the frame and its time
        let lead = match columns {
            Some(last) => last + 1,
            None => full.saturating_sub(expected),
        };
        if lead > 2 {
            let found = format!("{} cells", first.len());
            return Err(unexpected(
                self.first,
                &found,
                format!("{expected} cells, and up to two before them"),
            ));
        }
        if !row_of_names && lead > 0 {
            (self.frame, self.time) = (Some(0), (lead == 2).then_some((1, 1.0)));
        }
        self.place = place;
        self.width = lead + expected;
        self.usual_unit = LengthUnit::Millimetre;
        self.zero_is_gap = true;
        self.what = What::Markers(
            names.into_iter().enumerate().map(|(k, name)| (name.clone(), lead + 3 * k)).collect(),
        );
        Ok(())
    }

    /// One row of names.
    fn plain(&mut self, repairs: &mut Repairs) -> Result<(), ReadError> {
        let row = self.names.clone();
        self.find_times(&row);
        let own = |column: usize| {
            self.time.is_some_and(|(time, _)| time == column)
                || self.frame == Some(column)
                || self.sub_frame == Some(column)
        };
        let names: Vec<(usize, &str, Option<&str>)> = row
            .iter()
            .enumerate()
            .filter(|(column, name)| {
                !own(*column) && !(name.is_empty() && (*column == 0 || column + 1 == row.len()))
            })
            .map(|(column, name)| {
                let (stem, unit) = without_unit(name);
                (column, stem, unit)
            })
            .collect();
        let mut markers = Vec::new();
        let mut unit = None;
        let mut k = 0;
        while k < names.len() {
            let stem = coordinate(names[k].1).filter(|(_, axis)| *axis == 0).map(|(stem, _)| stem);
            let follows = |stem: &str, i: usize| {
                let next = names.get(k + i).filter(|(column, ..)| *column == names[k].0 + i);
                next.and_then(|(_, name, _)| coordinate(name)) == Some((stem, i))
            };
            match stem.filter(|stem| follows(stem, 1) && follows(stem, 2)) {
                Some(stem) => {
                    markers.push((stem.to_owned(), names[k].0));
                    unit = unit.or(names[k].2);
                    k += 3;
                }
                None => k += 1,
            }
        }
        if names.is_empty() {
            return Err(unexpected(self.place, &row.join(","), "time and at least one other column"));
        }
        if 6 * markers.len() >= names.len() {
            if 3 * markers.len() < names.len() {
                repairs.make(self.place, "columns that are no coordinates are left out")?;
            }
            if let Some(unit) = unit {
                let known = LengthUnit::from_name(unit);
                self.unit = Some(known.ok_or_else(|| unexpected(self.place, unit, LengthUnit::NAMES))?);
            }
            self.what = What::Markers(markers);
        } else {
            let columns = names.iter().map(|(column, ..)| (row[*column].clone(), *column, 1.0));
            self.what = What::Channels(columns.collect());
        }
        Ok(())
    }

    /// The time of a row, s, where a column or the number of the frame says it.
    pub(super) fn time<'c>(
        &self,
        place: Place,
        cell: &impl Fn(usize) -> &'c str,
        rate: Option<f64>,
        repairs: &mut Repairs,
    ) -> Result<Option<f64>, ReadError> {
        if let Some((column, unit)) = self.time {
            return match cell(column) {
                "" => Ok(None),
                found => Ok(Some(unit * number_of_cell(place, found, "a time", repairs)?)),
            };
        }
        let (Some(column), Some(rate)) = (self.frame, rate) else { return Ok(None) };
        if self.sub_frame.is_some_and(|column| cell(column).parse() != Ok(0.0)) {
            return Ok(None);
        }
        let frame = number_of_cell(place, cell(column), "the number of a frame", repairs)?;
        Ok(Some((frame - 1.0) / rate))
    }
}
