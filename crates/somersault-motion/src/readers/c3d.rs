//! C3D: the point data of the binary format of biomechanics.
//!
//! Positions as integers with a scale or as floats, by processors of Intel, DEC and MIPS. A point with a negative
//! residual is missing. Read from the parameters of the group POINT: USED, FRAMES, SCALE, RATE, DATA_START, LABELS with
//! its continuations (LABELS2, …), UNITS; from TRIAL: ACTUAL_START_FIELD and ACTUAL_END_FIELD, where there are more
//! frames than 16 bits count; from ANALOG: USED and RATE, for the size of a frame; and from the header. Where header and
//! parameters declare different things, the length of the file decides which it was written with; of what it does not
//! depend on, rates and the factor of integers, the parameters' are used. [`contradictions`] names them.
//!
//! Analog channels, force plates and events are read by [`channels`], [`force_plates`] and [`events`]. Frame number n is at t = (n − 1)/rate, as the first is numbered,
//! unless the file has SOMERSAULT:FIRST_TIME, text that [`writers::c3d`](crate::writers::c3d) writes where that would not
//! be the time of the first frame. Points that have no label are named `point 1`, `point 2`, ….
//!
//! Written here rather than taken: `c3dio` 0.8.0 (2024) slices bytes without a look at the length, so that a
//! truncated file is a panic.
//!
//! Source: *The C3D file format user guide*, Motion Lab Systems, 2021.

mod contradiction;
mod extras;
mod layout;
mod parameters;

use super::{Choices, Format, Parsed, Place, ReadError, Recording, Repairs, distinct, unexpected};
use crate::recording::{Axis, Convention, LengthUnit, MarkerRecording};
pub use contradiction::{Contradiction, Decision};
pub use extras::{Event, ForcePlate, channels, events, force_plates};
pub(crate) use layout::FIRST_TIME;
use layout::{Layout, layout};
use nalgebra::Vector3;
use parameters::{Parameters, Processor};

/// Bytes in a block.
const BLOCK: usize = 512;

/// What a file does not say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct C3dOptions {
    /// Axes; the unit is used where POINT:UNITS is missing.
    pub convention: Convention,
    /// Whether a point with all three coordinates NaN is missing rather than an error. Those with a negative
    /// residual always are.
    pub nan_is_gap: bool,
}

impl Default for C3dOptions {
    /// z up and x forward; mm where the file has no unit; NaN is an error.
    fn default() -> Self {
        Self { convention: Convention::z_up(LengthUnit::Millimetre), nan_is_gap: false }
    }
}

/// Bytes `from..from + n` of the file.
fn bytes<'a>(file: &'a [u8], from: usize, n: usize, allowed: &str) -> Result<&'a [u8], ReadError> {
    let end = from.checked_add(n);
    end.and_then(|end| file.get(from..end)).ok_or_else(|| ReadError::Truncated {
        place: Place::Byte(file.len()),
        allowed: format!("{allowed}, {n} bytes from byte {from}"),
    })
}

/// This format.
pub const FORMAT: Format = Format {
    name: "C3D",
    endings: &["c3d"],
    unit: Some(LengthUnit::Millimetre),
    up: Axis::PlusZ,
    forward: Axis::PlusX,
    knows: |bytes, _| bytes.len() >= BLOCK && bytes[1] == 0x50 && bytes[0] > 0,
    parse: |bytes, &Choices { convention, given }, repairs| {
        let options = C3dOptions { convention, nan_is_gap: given.nan_is_gap };
        if opened(bytes)?.1.n_points == 0
            && let Some(channels) = channels(bytes)?
        {
            repairs.decide(Place::Byte(2), "there are no points, the analog channels are read");
            return Ok(Recording::Channels(channels).into());
        }
        Ok(Parsed::markers(read_repaired(bytes, &options, repairs)?, convention))
    },
};

/// What header and parameters of a C3D `file` declare differently, and what [`read`] takes for it.
pub fn contradictions(file: &[u8]) -> Result<Vec<Contradiction>, ReadError> {
    Ok(opened(file)?.2)
}

/// The parts of a file that say how to read its points.
fn opened(file: &[u8]) -> Result<(Parameters<'_>, Layout, Vec<Contradiction>), ReadError> {
    let header = bytes(file, 0, BLOCK, "the header")?;
    if header[1] != 0x50 {
        return Err(unexpected(Place::Byte(1), &format!("{:#04x}", header[1]), "0x50, as in every C3D file"));
    }
    let parameters = Parameters::read(file, header[0])?;
    let (layout, contradictions) = layout(file, header, &parameters)?;
    Ok((parameters, layout, contradictions))
}

/// The points in the bytes of a C3D `file`, of which [`contradictions`] are no errors.
pub fn read(file: &[u8], options: &C3dOptions) -> Result<MarkerRecording, ReadError> {
    points(file, options, &opened(file)?, &mut Repairs::refused())
}

/// The same with repairs, among which are the [`contradictions`].
pub fn read_repaired(
    file: &[u8],
    options: &C3dOptions,
    repairs: &mut Repairs,
) -> Result<MarkerRecording, ReadError> {
    let opened = opened(file)?;
    for contradiction in &opened.2 {
        repairs.make(contradiction.place, contradiction.to_string())?;
    }
    points(file, options, &opened, repairs)
}

fn points(
    file: &[u8],
    options: &C3dOptions,
    (parameters, layout, _): &(Parameters, Layout, Vec<Contradiction>),
    repairs: &mut Repairs,
) -> Result<MarkerRecording, ReadError> {
    if let Some(place) = layout.undeclared_start {
        let error = unexpected(place, "0", "the number of a block, from 1");
        repairs.instead_of(error, "no first block of data is declared: it is that behind the parameters")?;
    }
    if let Some((place, declared)) = layout.missing {
        let (quantity, found) = ("frames", layout.n_frames);
        let error =
            ReadError::Misdeclared { place, quantity, declared: declared as u64, found: found as u64 };
        repairs.instead_of(error, format!("{declared} frames are declared, {found} are there"))?;
    }
    let processor = parameters.processor;
    let unit = match parameters.text("POINT", "UNITS") {
        Some((place, name)) if !name.is_empty() => {
            let known = LengthUnit::from_name(&name).or_else(|| LengthUnit::from_cut_name(&name));
            known.ok_or_else(|| unexpected(place, &name, LengthUnit::NAMES))?
        }
        _ => {
            let unit = options.convention.unit();
            repairs.decide(Place::Byte(0), format!("no unit is declared, {} is taken", unit.symbol()));
            unit
        }
    };
    let convention = options.convention.with_unit(unit);
    let names = names(parameters, layout.n_points, repairs)?;
    let mut points = Vec::with_capacity(layout.n_points * layout.n_frames);
    let width = if layout.scale > 0.0 { 8 } else { 16 };
    for i in 0..layout.n_frames {
        for k in 0..layout.n_points {
            let at = layout.start + i * layout.stride + k * width;
            points.push(
                point(file, at, layout, processor, options.nan_is_gap, repairs)?
                    .map(|x| convention.position(&x)),
            );
        }
    }
    let times = (0..layout.n_frames).map(|i| layout.first_time + i as f64 / layout.rate).collect();
    let frame_at = |frame: usize| Some(Place::Byte(layout.start + frame * layout.stride));
    MarkerRecording::try_new(names, times, points)
        .map_err(|error| ReadError::recording(error, Place::Byte(0), frame_at))
}

/// A point in the unit of the file.
fn point(
    file: &[u8],
    at: usize,
    layout: &Layout,
    processor: Processor,
    nan_is_gap: bool,
    repairs: &mut Repairs,
) -> Result<Option<Vector3<f64>>, ReadError> {
    let allowed = "a point";
    if layout.scale > 0.0 {
        let word = bytes(file, at, 8, allowed)?;
        let value = |k: usize| processor.i16([word[2 * k], word[2 * k + 1]]);
        // the residual is the lower half of a signed word
        let missing = value(3) < 0;
        return Ok((!missing).then(|| Vector3::from_fn(|k, _| f64::from(value(k)) * layout.scale)));
    }
    let word = bytes(file, at, 16, allowed)?;
    let value = |k: usize| processor.f32([word[4 * k], word[4 * k + 1], word[4 * k + 2], word[4 * k + 3]]);
    let residual = value(3);
    if residual < 0.0 {
        return Ok(None);
    }
    let x = Vector3::from_fn(|k, _| f64::from(value(k)));
    if nan_is_gap && x.iter().all(|x| x.is_nan()) {
        return Ok(None);
    }
    match (0..3).find(|&k| !x[k].is_finite()) {
        Some(k) => {
            let error = ReadError::NonFinite {
                place: Place::Byte(at + 4 * k),
                quantity: "a coordinate of a point with a residual that is not negative",
                found: x[k].to_string(),
            };
            repairs.instead_of(
                error,
                "a point at NaN or infinity is taken to be missing, as `nan_is_gap` says of NaN",
            )?;
            Ok(None)
        }
        None => Ok(Some(x)),
    }
}

/// A name for each point. Of points without a label nothing is wrong: they are numbered.
fn names(parameters: &Parameters, n_points: usize, repairs: &mut Repairs) -> Result<Vec<String>, ReadError> {
    let mut labels = parameters.many_texts("POINT", "LABELS", n_points);
    labels.resize(n_points, String::new());
    let used: std::collections::HashSet<String> = labels.iter().cloned().collect();
    let unnamed = labels.iter().filter(|label| label.is_empty()).count();
    if unnamed > 0 {
        repairs.decide(Place::Byte(0), format!("points without a label are numbered: {unnamed}"));
    }
    for (k, label) in labels.iter_mut().enumerate().filter(|(_, label)| label.is_empty()) {
        *label = format!("point {}", k + 1);
        while used.contains(label) {
            label.push('\'');
        }
    }
    distinct(labels, "point", Place::Byte(0), repairs)
}
