//! MOT and STO, the motion and storage files of OpenSim: named columns over time.
//!
//! ```text
//! Coordinates
//! version=1
//! nRows=2
//! nColumns=3
//! inDegrees=yes
//! endheader
//! time  hip_flexion_r  pelvis_ty
//! 0.00  12.5           0.93
//! 0.01  12.6           0.93
//! ```
//! Cells are separated by tabs, or by blanks where there is no tab. `nRows` and `nColumns`, or `datarows` and `datacolumns` of SIMM,
//! must be those of what follows, where they are declared. Keys that no program is known to write are listed as decisions. Of the other
//! lines of the header one counts, `inDegrees`: with `yes`, columns that are angles are converted to radians, and
//! [`in_degrees`](Columns::in_degrees) names them. OpenSim decides by its model which these are; here they are all columns but those whose names say something else: translations (`_tx`, `_ty`, `_tz`, also before a side, `tib_tx_r`), forces, points, torques, activations, lengths
//! and the like. Columns that end in `_x`, `_y` or `_z` are positions, but those of rotations (`thorax_rot_x`, SIMM's `r1_z`). Columns that are left as they are are listed too. Vectors of a column (`DataType=Vec3`, `Quaternion`, …) become columns with the endings `_1`, `_2`, ….
//!
//! Source: *OpenSim documentation*, Storage (.sto) and Motion (.mot) files, and `FileAdapter`s of opensim-core 4.5.

use super::{
    Format, Place, ReadError, Repairs, decoded, distinct, is_nan, number_of_cell, times_at_rate, unexpected,
};
use crate::recording::{Axis, ChannelRecording, LengthUnit};

/// This format.
pub const FORMAT: Format = Format {
    name: "MOT or STO",
    endings: &["mot", "sto"],
    unit: Some(LengthUnit::Metre),
    up: Axis::PlusY,
    forward: Axis::PlusX,
    knows: |_, text| text.lines().any(is_end),
    parse: |bytes, _, repairs| {
        let text = decoded(bytes, repairs)?;
        let found = read_repaired(&text, repairs)?;
        let names = |names: &[String]| super::shorten(&names.join(", "), LISTED);
        if !found.in_degrees.is_empty() {
            let (n, names) = (found.in_degrees.len(), names(&found.in_degrees));
            repairs
                .decide(found.place, format!("{n} columns are converted from degrees to radians: {names}"));
        }
        if !found.not_in_degrees.is_empty() {
            let (n, names) = (found.not_in_degrees.len(), names(&found.not_in_degrees));
            repairs.decide(found.place, format!("{n} columns are no angles by their names: {names}"));
        }
        Ok(super::Recording::Channels(found.recording).into())
    },
};

/// The columns of a file, and which of them were angles in degrees.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// The columns, angles in rad.
    pub recording: ChannelRecording,
    /// Names of those that were in degrees.
    pub in_degrees: Vec<String>,
    /// Names of the others, in a file whose angles are in degrees.
    pub not_in_degrees: Vec<String>,
    /// Where the file says that they are.
    place: Place,
}

/// Most characters of names in a decision.
const LISTED: usize = 1000;

/// Whether a line ends the header.
fn is_end(line: &str) -> bool {
    line.trim_matches([' ', '\t', '"', ',', ';', '\r']).eq_ignore_ascii_case("endheader")
}

/// Whether a column is an angle or its rate in files with `inDegrees=yes`, by its name.
pub fn is_angle(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    // of paths of states the last part says what it is
    let (owner, quantity) = match name.rsplit_once('/') {
        Some((owner, quantity @ ("value" | "speed"))) => (owner, quantity),
        Some(_) => return false,
        None => (name.as_str(), ""),
    };
    let stem = owner.strip_suffix("_u").or_else(|| owner.strip_suffix("_speed")).unwrap_or(owner);
    let mut words: Vec<&str> = stem.split(['_', '.', ' ']).collect();
    while words.len() > 1 && words.last().is_some_and(|word| ["r", "l", "right", "left"].contains(word)) {
        words.pop();
    }
    let last = words.pop().unwrap_or_default();
    let axis = last.strip_suffix(['x', 'y', 'z']);
    const OTHERS: [&str; 15] = [
        "force",
        "torque",
        "moment",
        "power",
        "activation",
        "excitation",
        "fiber",
        "length",
        "reserve",
        "residual",
        "metabolic",
        "grf",
        "energy",
        "pressure",
        "trans",
    ];
    let translates = axis.is_some_and(|kind| ["t", "v", "p", "d"].contains(&kind));
    // positions of bodies and of centres of mass, with their angles `_Ox`, `_Oy` and `_Oz`; but SIMM's rotations are r1, r2, …
    let numbered = |word: &str| word.strip_prefix('r').is_some_and(|n| n.parse::<u32>().is_ok());
    let turns = words.last().is_some_and(|word| word.starts_with("rot") || numbered(word));
    let position = axis == Some("") && !turns;
    let other = |word: &&str| owner.contains(*word) && (quantity.is_empty() || *word == "trans");
    !(translates || position || OTHERS.iter().any(other))
}

/// The columns in the `text` of a file that has no need of repairs.
pub fn read(text: &str) -> Result<Columns, ReadError> {
    read_repaired(text, &mut Repairs::refused())
}

fn whole(place: Place, value: &str) -> Result<u64, ReadError> {
    value.parse().map_err(|_| unexpected(place, value, "a whole number"))
}

/// What the header declares, with the place of each.
#[derive(Default)]
struct Header {
    rows: Option<(Place, u64)>,
    columns: Option<(Place, u64)>,
    degrees: Option<Place>,
    /// Numbers in a cell.
    width: usize,
}

/// What a line of the header says.
enum Line<'a> {
    Rows(&'a str),
    Columns(&'a str),
    Degrees(&'a str),
    DataType(&'a str),
    /// A title, a remark, or what programs say of themselves: the table does not depend on it.
    Remark,
    /// A key that no program is known to write.
    Unknown(&'a str),
}

impl<'a> Line<'a> {
    /// Keys that do not change what a table means.
    const WITHOUT_EFFECT: [&'static str; 6] =
        ["version", "opensimversion", "name", "range", "units", "description"];

    fn of(line: &'a str) -> Self {
        let line = line.trim_matches([' ', '\t', '"', ',', ';', '\r']);
        let declared = line.split_once('=');
        let Some((key, value)) = declared.or_else(|| line.split_once(char::is_whitespace)) else {
            return Self::Remark;
        };
        let (key, value) = (key.trim(), value.trim().trim_matches('"'));
        match key.to_ascii_lowercase().as_str() {
            "nrows" | "datarows" => Self::Rows(value),
            "ncolumns" | "datacolumns" => Self::Columns(value),
            "indegrees" => Self::Degrees(value),
            "datatype" => Self::DataType(value),
            known if declared.is_none() || Self::WITHOUT_EFFECT.contains(&known) => Self::Remark,
            _ => Self::Unknown(key),
        }
    }
}

impl Header {
    fn line(&mut self, place: Place, line: &str, repairs: &mut Repairs) -> Result<(), ReadError> {
        match Line::of(line) {
            Line::Rows(value) => self.rows = Some((place, whole(place, value)?)),
            Line::Columns(value) => self.columns = Some((place, whole(place, value)?)),
            Line::Degrees(value) => {
                self.degrees = match value.to_ascii_lowercase().as_str() {
                    "yes" | "y" | "true" | "1" => Some(place),
                    "no" | "n" | "false" | "0" => None,
                    _ => return Err(unexpected(place, value, "yes or no")),
                }
            }
            Line::DataType(value) => {
                self.width = match value.to_ascii_lowercase().as_str() {
                    "double" => 1,
                    "vec2" => 2,
                    "vec3" | "unitvec3" => 3,
                    "quaternion" | "vec4" => 4,
                    "vec5" => 5,
                    "spatialvec" | "vec6" => 6,
                    "vec7" => 7,
                    "vec8" => 8,
                    "vec9" => 9,
                    _ => {
                        return Err(unexpected(place, value, "double, Vec3, Quaternion, SpatialVec or VecN"));
                    }
                }
            }
            Line::Remark => {}
            Line::Unknown(key) => {
                let key = super::shorten(key, 60);
                repairs.decide(place, format!("`{key}` of the header is not known and is not used"));
            }
        }
        Ok(())
    }
}

/// The same with repairs: numbers of rows and columns that are not those of what follows, cells separated by runs of tabs or by
/// commas, rows that end early or late, names that are repeated or missing, times that do not rise.
pub fn read_repaired(text: &str, repairs: &mut Repairs) -> Result<Columns, ReadError> {
    let mut header = Header { width: 1, ..Header::default() };
    let mut lines = text.lines().enumerate().map(|(i, line)| (Place::Line(i + 1), line));
    let end = Place::Line(text.lines().count().max(1));
    let truncated = |allowed: &str| ReadError::Truncated { place: end, allowed: allowed.to_owned() };
    loop {
        let (place, line) = lines.next().ok_or_else(|| truncated("endheader"))?;
        if is_end(line) {
            break;
        }
        header.line(place, line, repairs)?;
    }
    let full =
        |(_, line): &(Place, &str)| line.contains(|c: char| !c.is_whitespace() && c != ',' && c != '"');
    let mut lines = lines.filter(full);
    let (head, line) = lines.next().ok_or_else(|| truncated("the names of columns"))?;
    // OpenSim takes blanks for tabs
    let blanks = line.split_whitespace().count();
    let by_blanks =
        header.columns.is_some_and(|(_, n)| n == blanks as u64) && line.split('\t').count() < blanks;
    let separator = if line.contains('\t') && !by_blanks {
        Some('\t')
    } else {
        Some(',').filter(|_| line.contains(',') && header.width == 1)
    };
    let split = |line| cells(separator, line);
    let mut names = split(line);
    while names.last().is_some_and(|name| name.is_empty()) {
        names.pop();
    }
    if !names.first().is_some_and(|name| name.eq_ignore_ascii_case("time")) {
        return Err(unexpected(head, names.first().copied().unwrap_or_default(), "time, the first column"));
    }
    if separator == Some(',') {
        repairs.make(head, "cells are apart by commas")?;
    }
    let runs = names.iter().any(|name| name.is_empty());
    let labels: Vec<&str> = names.into_iter().skip(1).filter(|name| !runs || !name.is_empty()).collect();
    let n = labels.len();
    let width = header.width;
    let (mut places, mut times, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let mut lines = lines.peekable();
    while let Some((place, line)) = lines.next() {
        let last = lines.peek().is_none() && !text.ends_with(['\n', '\r']);
        let mut row = split(line);
        while row.len() > n + 1 && row.last().is_some_and(|cell| cell.is_empty()) {
            row.pop();
        }
        if row.len() > n + 1 {
            row.retain(|cell| !cell.is_empty());
        }
        if row.len() != n + 1 {
            let found = format!("{} cells", row.len());
            let wrong = unexpected(place, &found, format!("{} cells, as many as names", n + 1));
            if row.len() < n + 1 && last && !times.is_empty() {
                repairs.instead_of(wrong, "the last row is incomplete and left out")?;
                break;
            }
            return Err(wrong);
        }
        places.push(place);
        times.push(match row[0] {
            "" => None,
            time => Some(number_of_cell(place, time, "a time", repairs)?),
        });
        for cell in &row[1..] {
            components(place, cell, width, &mut values, repairs)?;
        }
    }
    if times.is_empty() {
        return Err(ReadError::NoFrames { place: head });
    }
    let compare = |declared: Option<(Place, u64)>, quantity, found: usize, repairs: &mut Repairs| {
        let found = found as u64;
        match declared {
            Some((place, declared)) if declared != found => repairs.instead_of(
                ReadError::Misdeclared { place, quantity, declared, found },
                format!("{declared} {quantity} are declared, {found} are there"),
            ),
            _ => Ok(()),
        }
    };
    compare(header.rows, "rows", times.len(), repairs)?;
    compare(header.columns, "columns", n + 1, repairs)?;
    let times = rising(times, &places, &mut values, n * width, repairs)?;
    let labels = distinct(labels.iter().map(|name| (*name).to_owned()).collect(), "column", head, repairs)?;
    let angles: Vec<bool> =
        labels.iter().map(|name| header.degrees.is_some() && width == 1 && is_angle(name)).collect();
    for row in values.chunks_exact_mut((n * width).max(1)) {
        row.iter_mut().zip(&angles).filter(|(_, angle)| **angle).for_each(|(x, _)| *x = x.to_radians());
    }
    let named = |is_angle: bool| -> Vec<String> {
        let of = labels.iter().zip(&angles).filter(|(_, angle)| **angle == is_angle && width == 1);
        of.map(|(name, _)| name.clone()).collect()
    };
    let in_degrees = named(true);
    let not_in_degrees = if header.degrees.is_some() { named(false) } else { Vec::new() };
    let names: Vec<String> = match width {
        1 => labels,
        _ => labels.iter().flat_map(|name| (1..=width).map(move |k| format!("{name}_{k}"))).collect(),
    };
    let units = match width {
        1 => angles.iter().map(|angle| if *angle { "rad".to_owned() } else { String::new() }).collect(),
        _ => vec![String::new(); names.len()],
    };
    let recording = ChannelRecording::try_new(names, times, values)
        .and_then(|recording| recording.with_units(units))
        .map_err(|error| ReadError::recording(error, head, |frame| places.get(frame).copied()))?;
    Ok(Columns { recording, in_degrees, not_in_degrees, place: header.degrees.unwrap_or(head) })
}

/// Cells of a line, at a character or at blanks.
fn cells(separator: Option<char>, line: &str) -> Vec<&str> {
    let bare = |cell| str::trim_matches(str::trim(cell), '"').trim();
    match separator {
        Some(c) => line.split(c).map(bare).collect(),
        None => line.split_whitespace().map(bare).collect(),
    }
}

/// The numbers of a cell; NaN or nothing is NaN.
fn components(
    place: Place,
    cell: &str,
    width: usize,
    values: &mut Vec<f64>,
    repairs: &mut Repairs,
) -> Result<(), ReadError> {
    const VALUE: &str = "a value of a column";
    if cell.is_empty() || is_nan(cell) {
        values.extend(std::iter::repeat_n(f64::NAN, width));
        return Ok(());
    }
    if width == 1 {
        values.push(number_of_cell(place, cell, VALUE, repairs)?);
        return Ok(());
    }
    let parts: Vec<&str> = cell.trim_matches(['~', '[', ']', '(', ')']).split(',').map(str::trim).collect();
    if parts.len() != width {
        return Err(unexpected(place, cell, format!("{width} numbers with commas between them")));
    }
    for part in parts {
        let value = if is_nan(part) { f64::NAN } else { super::number(place, part, VALUE)? };
        values.push(value);
    }
    Ok(())
}

/// Times that rise: of rows at the same time, which integrators write at events, the last is kept.
fn rising(
    times: Vec<Option<f64>>,
    places: &[Place],
    values: &mut Vec<f64>,
    n: usize,
    repairs: &mut Repairs,
) -> Result<Vec<f64>, ReadError> {
    let times = times_at_rate(times, places, None, repairs)?;
    let twice = |i: usize| i + 1 < times.len() && times[i + 1] == times[i];
    let Some(first) = (0..times.len()).find(|&i| twice(i)) else { return Ok(times) };
    if repairs.are_refused() {
        // the recording refuses them
        return Ok(times);
    }
    repairs.make(places[first + 1], "of rows at the same time the last is kept")?;
    let keep: Vec<usize> = (0..times.len()).filter(|&i| !twice(i)).collect();
    *values = keep.iter().flat_map(|&i| values[i * n..(i + 1) * n].iter().copied()).collect();
    Ok(keep.into_iter().map(|i| times[i]).collect())
}
