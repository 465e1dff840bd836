//! What a file has besides points: analog channels, events and force plates.

use super::layout::Layout;
use super::parameters::Processor;
use super::{bytes, opened};
use crate::readers::{Place, ReadError, Repairs, distinct, unexpected};
use crate::recording::ChannelRecording;

/// Something that somebody marked in a recording: a foot strike, a toe off.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// What it is.
    pub label: String,
    /// Of which side, `Left`, `Right` or `General`; empty where the file does not say.
    pub context: String,
    /// When, s; frame number n is at (n − 1)/rate.
    pub time: f64,
}

/// A force plate: what the group FORCE_PLATFORM says of it, in the unit and axes of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ForcePlate {
    /// Its type, of the user guide: what its channels are.
    pub kind: usize,
    /// Its corners, in the axes of the file.
    pub corners: [[f64; 3]; 4],
    /// The origin of its moments in its own axes; NaN if the file does not declare it.
    pub origin: [f64; 3],
    /// Numbers of its analog channels, from 0.
    pub channels: Vec<usize>,
    /// The matrix from channels to forces and moments, column by column; empty if the file declares no such matrix.
    pub calibration: Vec<f64>,
}

/// The analog channels in the bytes of a C3D `file`, scaled: (number − OFFSET) · SCALE · GEN_SCALE, with their units; nothing where it
/// has none. Frames of a channel are its samples.
pub fn channels(file: &[u8]) -> Result<Option<ChannelRecording>, ReadError> {
    let (parameters, layout, _) = opened(file)?;
    let used = parameters.number("ANALOG", "USED").map_or(0.0, |(_, n)| n) as usize;
    if used == 0 || layout.n_analog == 0 {
        return Ok(None);
    }
    let n_samples = layout.n_analog / used;
    if n_samples == 0 {
        let place = parameters.number("ANALOG", "USED").map_or(Place::Byte(0), |(place, _)| place);
        let (declared, found) = (used as u64, layout.n_analog as u64);
        return Err(ReadError::Misdeclared { place, quantity: "analog channels", declared, found });
    }
    let general = parameters.number("ANALOG", "GEN_SCALE").map_or(1.0, |(_, x)| x);
    let is_unsigned =
        parameters.text("ANALOG", "FORMAT").is_some_and(|(_, f)| f.eq_ignore_ascii_case("UNSIGNED"));
    let scales = parameters.numbers("ANALOG", "SCALE", is_unsigned);
    let offsets = parameters.numbers("ANALOG", "OFFSET", is_unsigned);
    for (quantity, found) in [("scales of channels", scales.len()), ("offsets of channels", offsets.len())] {
        // without any, numbers are what they are
        if found > 0 && found < used {
            let place = parameters.number("ANALOG", "USED").map_or(Place::Byte(0), |(place, _)| place);
            let (declared, found) = (used as u64, found as u64);
            return Err(ReadError::Misdeclared { place, quantity, declared, found });
        }
    }
    let mut values = Vec::new();
    for i in 0..layout.n_frames {
        let start = layout.start + i * layout.stride + layout.points_width();
        for k in 0..n_samples * used {
            let channel = k % used;
            let raw = sample(file, start, k, &layout, parameters.processor, is_unsigned)?;
            // 32768, the middle of numbers without sign, does not fit into a word with one
            let offset = offsets.get(channel).map_or(0.0, |x| if *x == -32768.0 { 32768.0 } else { *x });
            let scaled = (raw - offset) * scales.get(channel).copied().unwrap_or(1.0) * general;
            values.push(if scaled.is_finite() { scaled } else { f64::NAN });
        }
    }
    let mut labels = parameters.many_texts("ANALOG", "LABELS", used);
    labels.resize(used, String::new());
    let names = distinct(labels, "channel", Place::Byte(0), &mut Repairs::allowed())?;
    let rate = layout.rate * n_samples as f64;
    let times = (0..layout.n_frames * n_samples).map(|i| layout.first_time + i as f64 / rate).collect();
    let mut units = parameters.many_texts("ANALOG", "UNITS", used);
    units.resize(used, String::new());
    ChannelRecording::try_new(names, times, values)
        .and_then(|recording| recording.with_units(units))
        .map(Some)
        .map_err(|error| ReadError::recording(error, Place::Byte(0), |_| None))
}

/// Number k of the analog data of a frame; NaN where a cut last frame lacks it.
fn sample(
    file: &[u8],
    start: usize,
    k: usize,
    layout: &Layout,
    processor: Processor,
    is_unsigned: bool,
) -> Result<f64, ReadError> {
    let width = if layout.scale > 0.0 { 2 } else { 4 };
    let at = start + k * width;
    if at + width > file.len() {
        return Ok(f64::NAN);
    }
    let word = bytes(file, at, width, "a sample")?;
    Ok(match *word {
        [a, b] if is_unsigned => f64::from(processor.u16([a, b])),
        [a, b] => f64::from(processor.i16([a, b])),
        [a, b, c, d] => f64::from(processor.f32([a, b, c, d])),
        _ => f64::NAN,
    })
}

/// The events in the bytes of a C3D `file`, in the order of their times: those of the group EVENT, or those of the header.
pub fn events(file: &[u8]) -> Result<Vec<Event>, ReadError> {
    let (parameters, ..) = opened(file)?;
    let used = parameters.number("EVENT", "USED").map_or(0.0, |(_, n)| n) as usize;
    let mut events = Vec::new();
    if used > 0 {
        let labels = parameters.many_texts("EVENT", "LABELS", used);
        let contexts = parameters.many_texts("EVENT", "CONTEXTS", used);
        // minutes and seconds
        let times = parameters.numbers("EVENT", "TIMES", false);
        for (k, pair) in times.chunks_exact(2).take(used).enumerate() {
            let text = |all: &[String]| all.get(k).cloned().unwrap_or_default();
            events.push(Event {
                label: text(&labels),
                context: text(&contexts),
                time: 60.0 * pair[0] + pair[1],
            });
        }
    } else {
        let word = |k: usize| parameters.processor.u16([file[2 * k - 2], file[2 * k - 1]]);
        // with this key labels have four letters
        if word(150) == 12345 {
            for k in 0..usize::from(word(151)).min(18) {
                let at = 304 + 4 * k;
                let time = parameters.processor.f32([file[at], file[at + 1], file[at + 2], file[at + 3]]);
                let label: String = file[396 + 4 * k..400 + 4 * k].iter().map(|&b| char::from(b)).collect();
                let label = label.trim_matches([' ', '\0']).to_owned();
                events.push(Event { label, context: String::new(), time: f64::from(time) });
            }
        }
    }
    events.retain(|event| event.time.is_finite());
    events.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(events)
}

/// The force plates in the bytes of a C3D `file`. Fails if types or corners of some are missing.
pub fn force_plates(file: &[u8]) -> Result<Vec<ForcePlate>, ReadError> {
    let (parameters, ..) = opened(file)?;
    let group = "FORCE_PLATFORM";
    let used = parameters.number(group, "USED").map_or(0.0, |(_, n)| n) as usize;
    let kinds = parameters.numbers(group, "TYPE", false);
    let corners = parameters.numbers(group, "CORNERS", false);
    let origins = parameters.numbers(group, "ORIGIN", false);
    let channels = parameters.numbers(group, "CHANNEL", false);
    let calibration = parameters.numbers(group, "CAL_MATRIX", false);
    let shape = |name: &str| parameters.dimensions(group, name);
    let per_plate = shape("CHANNEL").first().copied().unwrap_or(6).max(1);
    let matrix = shape("CAL_MATRIX").iter().take(2).product::<usize>();
    let mut plates = Vec::new();
    for (argument, found, each) in [("TYPE", kinds.len(), 1), ("CORNERS", corners.len(), 12)] {
        if found < each * used {
            let place = parameters.number(group, "USED").map_or(Place::Byte(0), |(place, _)| place);
            let allowed = format!("{each} in {group}:{argument} for each of {used} plates");
            return Err(unexpected(place, &format!("{found} numbers"), allowed));
        }
    }
    for k in 0..used {
        let at = |i: usize, j: usize| corners[12 * k + 3 * i + j];
        let own = channels.get(per_plate * k..per_plate * (k + 1)).unwrap_or_default();
        let matrix = calibration.get(matrix * k..matrix * (k + 1)).unwrap_or_default();
        plates.push(ForcePlate {
            kind: kinds[k] as usize,
            corners: [0, 1, 2, 3].map(|i| [at(i, 0), at(i, 1), at(i, 2)]),
            origin: [0, 1, 2].map(|j| origins.get(3 * k + j).copied().unwrap_or(f64::NAN)),
            // 0 stands for no channel
            channels: own.iter().filter(|n| **n >= 1.0).map(|n| *n as usize - 1).collect(),
            calibration: matrix.to_vec(),
        });
    }
    Ok(plates)
}
