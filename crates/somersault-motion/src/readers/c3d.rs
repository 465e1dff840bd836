//! C3D: the point data of the binary format of biomechanics.
//!
//! Positions as integers with a scale or as floats, by processors of Intel, DEC and MIPS. A point with a negative
//! residual is missing. Read from the parameters of the group POINT: USED, FRAMES, SCALE, RATE, DATA_START, LABELS with
//! its continuations (LABELS2, …), UNITS; from TRIAL: ACTUAL_START_FIELD and ACTUAL_END_FIELD, where there are more
//! frames than 16 bits count; where one is missing, the header. Analog channels, force plates and events are
//! skipped. The first frame is at t = 0, points that have no label are named `point 1`, `point 2`, ….
//!
//! Written here rather than taken: `c3dio` 0.8.0 (2024) slices bytes without a look at the length, so that a
//! truncated file is a panic.
//!
//! Source: *The C3D file format user guide*, Motion Lab Systems, 2021.

mod parameters;

use super::{Place, ReadError, unexpected};
use crate::recording::{Convention, LengthUnit, MarkerRecording};
use nalgebra::Vector3;
use parameters::{Parameters, Processor};

/// Bytes in a block.
const BLOCK: usize = 512;

/// What a file does not say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Axes; the unit is used where POINT:UNITS is missing.
    pub convention: Convention,
    /// Whether a point with all three coordinates NaN is missing rather than an error. Those with a negative
    /// residual always are.
    pub nan_is_gap: bool,
}

impl Default for Options {
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

/// Where points are in the file and how they are stored.
struct Layout {
    n_points: usize,
    n_frames: usize,
    /// First byte of the first frame.
    start: usize,
    /// Bytes of a frame, with its analog data.
    stride: usize,
    /// Floats for 0 or less, else what integers are multiplied by.
    scale: f64,
    rate: f64,
}

/// The recording in the bytes of a C3D `file`.
pub fn read(file: &[u8], options: &Options) -> Result<MarkerRecording, ReadError> {
    let header = bytes(file, 0, BLOCK, "the header")?;
    if header[1] != 0x50 {
        return Err(unexpected(Place::Byte(1), &format!("{:#04x}", header[1]), "0x50, the mark of C3D"));
    }
    let parameters = Parameters::read(file, header[0])?;
    let processor = parameters.processor;
    let unit = match parameters.text("POINT", "UNITS") {
        Some((_, name)) if name.is_empty() => options.convention.unit(),
        Some((place, name)) => {
            LengthUnit::from_name(&name).ok_or_else(|| unexpected(place, &name, LengthUnit::NAMES))?
        }
        None => options.convention.unit(),
    };
    let convention = options.convention.with_unit(unit);
    let layout = layout(file, header, &parameters)?;
    let names = names(&parameters, layout.n_points);
    let mut points = Vec::with_capacity(layout.n_points * layout.n_frames);
    let width = if layout.scale > 0.0 { 8 } else { 16 };
    for i in 0..layout.n_frames {
        for k in 0..layout.n_points {
            let at = layout.start + i * layout.stride + k * width;
            points.push(
                point(file, at, &layout, processor, options.nan_is_gap)?.map(|x| convention.position(&x)),
            );
        }
    }
    let times = (0..layout.n_frames).map(|i| i as f64 / layout.rate).collect();
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
        Some(k) => Err(ReadError::NonFinite {
            place: Place::Byte(at + 4 * k),
            quantity: "a coordinate of a point with a residual that is not negative",
            found: x[k].to_string(),
        }),
        None => Ok(Some(x)),
    }
}

/// From header and parameters, held against the length of the file.
fn layout(file: &[u8], header: &[u8], parameters: &Parameters) -> Result<Layout, ReadError> {
    let processor = parameters.processor;
    let word = |k: usize| usize::from(processor.u16([header[2 * k - 2], header[2 * k - 1]]));
    let float =
        |k: usize| processor.f32([header[2 * k - 2], header[2 * k - 1], header[2 * k], header[2 * k + 1]]);
    let number = |name: &str| parameters.number("POINT", name);
    let place_of = |name: &str, word: usize| {
        parameters.number("POINT", name).map_or(Place::Byte(2 * word - 2), |(place, _)| place)
    };

    let n_points = number("USED").map_or(word(2), |(_, x)| x as usize);
    if n_points == 0 {
        return Err(unexpected(place_of("USED", 2), "0 points", "at least one point"));
    }
    let rate = number("RATE").map_or(f64::from(float(11)), |(_, x)| x);
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(unexpected(
            place_of("RATE", 11),
            &rate.to_string(),
            "a positive number of frames a second",
        ));
    }
    let scale = number("SCALE").map_or(f64::from(float(7)), |(_, x)| x);
    if !scale.is_finite() || scale == 0.0 {
        return Err(unexpected(place_of("SCALE", 7), &scale.to_string(), "a scale other than 0"));
    }
    let block = number("DATA_START").map_or(word(9), |(_, x)| x as usize);
    if block == 0 {
        return Err(unexpected(place_of("DATA_START", 9), "0", "the number of a block, from 1"));
    }
    let start = (block - 1).saturating_mul(BLOCK);
    let width = if scale > 0.0 { 2 } else { 4 };
    let stride = n_points.saturating_mul(4).saturating_add(word(3)).saturating_mul(width);

    let (place, declared) = declared_frames(parameters, word(4), word(5));
    if declared == 0 {
        return Err(ReadError::NoFrames { place });
    }
    // the last frame may lack its analog data, but no point
    let points = n_points.saturating_mul(4 * width);
    let room = file.len().saturating_sub(start);
    let found = if room < points { 0 } else { (room - points) / stride + 1 };
    if found < declared {
        let (declared, found) = (declared as u64, found as u64);
        return Err(ReadError::Misdeclared { place, quantity: "frames", declared, found });
    }
    Ok(Layout { n_points, n_frames: declared, start, stride, scale, rate })
}

/// The number of frames and where it is declared. The header and POINT:FRAMES have 16 bits, two words of TRIAL 32.
fn declared_frames(parameters: &Parameters, first: usize, last: usize) -> (Place, usize) {
    let field = |name: &str| {
        let (place, words) = parameters.words("TRIAL", name)?;
        let [low, high] = words[..] else { return None };
        Some((place, usize::from(low) | usize::from(high) << 16))
    };
    if let (Some((place, first)), Some((_, last))) = (field("ACTUAL_START_FIELD"), field("ACTUAL_END_FIELD"))
    {
        return (place, (last + 1).saturating_sub(first));
    }
    // 65 535 stands for "more than can be said"; then the header, which wraps, is no better
    match parameters.number("POINT", "FRAMES") {
        Some((place, n)) if n > 0.0 => (place, n as usize),
        _ => (Place::Byte(6), (last + 1).saturating_sub(first)),
    }
}

/// A name for each point: labels that are blank or repeat others are replaced by numbers, with primes where a
/// label looks like one.
fn names(parameters: &Parameters, n_points: usize) -> Vec<String> {
    let mut labels = parameters.texts("POINT", "LABELS", n_points);
    for k in 2.. {
        let more = parameters.texts("POINT", &format!("LABELS{k}"), n_points - labels.len());
        if more.is_empty() {
            break;
        }
        labels.extend(more);
    }
    let mut seen = std::collections::HashSet::new();
    (0..n_points)
        .map(|k| match labels.get(k) {
            Some(label) if !label.is_empty() && seen.insert(label.clone()) => label.clone(),
            _ => {
                let mut name = format!("point {}", k + 1);
                while !seen.insert(name.clone()) {
                    name.push('\'');
                }
                name
            }
        })
        .collect()
}
