//! Markers as C3D: the format of [`readers::c3d`](crate::readers::c3d).
//!
//! Point data as floats for processors of Intel, without analog channels. Coordinates and the rate have single
//! precision. The first frame has the number n = 1 + t₀ · rate, rounded, and where (n − 1)/rate is not its time t₀ to
//! the last digit, or t₀ is negative, the parameter SOMERSAULT:FIRST_TIME has it as text. Gaps have a residual of −1, other points
//! of 0.

use super::{WriteError, expect_name, time_step};
use crate::readers::c3d::FIRST_TIME;
use crate::recording::{Convention, MarkerRecording};
use nalgebra::Vector3;

/// Bytes in a block.
const BLOCK: usize = 512;
/// The greatest number of 16 bits.
const WORD: usize = 0xffff;
/// Labels in an array.
const LABELS: usize = 255;

/// `recording` as the bytes of a file.
pub fn write(recording: &MarkerRecording, convention: &Convention) -> Result<Vec<u8>, WriteError> {
    let (n_points, n_frames) = (recording.n_markers(), recording.n_frames());
    // four words each, and that many fit into a block's count of words
    let most = WORD / 4;
    if n_points > most {
        return Err(WriteError::TooMany { quantity: "points", found: n_points, most });
    }
    if n_frames > u32::MAX as usize {
        return Err(WriteError::TooMany { quantity: "frames", found: n_frames, most: u32::MAX as usize });
    }
    let step = time_step(recording.times())?;
    let rate = (1.0 / step) as f32;
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(WriteError::OutOfRange { quantity: "the time between frames", found: step, frame: 1 });
    }
    let first = first_frame(recording, rate);
    let mut section = parameters(recording, convention, rate, first)?;
    let n_blocks = section.len() / BLOCK;
    let Ok(counted) = u8::try_from(n_blocks) else {
        return Err(WriteError::TooMany { quantity: "blocks of names", found: n_blocks, most: 255 });
    };
    section[2] = counted;

    let mut file = vec![2, 0x50];
    let data = (2 + n_blocks) as u16;
    let last = first as usize - 1 + n_frames;
    for word in [n_points as u16, 0, (first as usize).min(WORD) as u16, last.min(WORD) as u16, 0] {
        file.extend(word.to_le_bytes());
    }
    file.extend((-1.0_f32).to_le_bytes());
    file.extend(data.to_le_bytes());
    file.extend(0_u16.to_le_bytes());
    file.extend(rate.to_le_bytes());
    file.resize(BLOCK, 0);
    file.append(&mut section);
    for (frame, points) in recording.frames().enumerate() {
        for point in points {
            let [x, y, z, residual] = match point {
                Some(p) => single(convention, p, frame)?,
                None => [0.0, 0.0, 0.0, -1.0],
            };
            for number in [x, y, z, residual] {
                file.extend(number.to_le_bytes());
            }
        }
    }
    file.resize(file.len().next_multiple_of(BLOCK), 0);
    Ok(file)
}

/// The number of the first frame: 1 at t = 0, and where numbers of 32 bits do not reach to the last.
fn first_frame(recording: &MarkerRecording, rate: f32) -> u32 {
    let number = 1.0 + (recording.times()[0] * f64::from(rate)).round();
    let most = f64::from(u32::MAX) - recording.n_frames() as f64;
    if (1.0..most).contains(&number) { number as u32 } else { 1 }
}

/// A point that is not missing, in single precision.
fn single(convention: &Convention, x: &Vector3<f64>, frame: usize) -> Result<[f32; 4], WriteError> {
    let inside = convention.file_position(x).map(|x| x as f32);
    match inside.iter().all(|x| x.is_finite()) {
        true => Ok([inside.x, inside.y, inside.z, 0.0]),
        false => Err(WriteError::OutOfRange { quantity: "a coordinate", found: x.amax(), frame }),
    }
}

/// The parameter section, whole blocks; how many is left to the caller.
fn parameters(
    recording: &MarkerRecording,
    convention: &Convention,
    rate: f32,
    first: u32,
) -> Result<Vec<u8>, WriteError> {
    let (n_points, n_frames) = (recording.n_markers(), recording.n_frames());
    let mut section = vec![1, 0x50, 0, 84];
    group(&mut section, 1, "POINT");
    word(&mut section, 1, "USED", &[n_points as u16]);
    word(&mut section, 1, "FRAMES", &[n_frames.min(WORD) as u16]);
    float(&mut section, 1, "SCALE", -1.0);
    float(&mut section, 1, "RATE", rate);
    let unit = convention.unit().symbol();
    array(&mut section, 1, "UNITS", -1, &[unit.len() as u8], unit.as_bytes());
    for (k, names) in recording.names().chunks(LABELS).enumerate() {
        let width = names.iter().map(String::len).max().unwrap_or(0);
        let mut labels = Vec::with_capacity(width * names.len());
        for name in names {
            const ALLOWED: &str = "names of up to 255 ASCII characters without blanks around them";
            expect_name(name, &[], ALLOWED)?;
            if !name.is_ascii() || width > 255 {
                return Err(WriteError::Name { name: name.clone(), allowed: ALLOWED });
            }
            labels.extend(name.bytes());
            labels.resize(labels.len().next_multiple_of(width.max(1)), b' ');
        }
        let array_name = if k == 0 { "LABELS".to_owned() } else { format!("LABELS{}", k + 1) };
        array(&mut section, 1, &array_name, -1, &[width as u8, names.len() as u8], &labels);
    }
    let last = first as usize - 1 + n_frames;
    if last > WORD {
        let halves = |n: usize| [n as u16, (n >> 16) as u16];
        group(&mut section, 2, "TRIAL");
        word(&mut section, 2, "ACTUAL_START_FIELD", &halves(first as usize));
        word(&mut section, 2, "ACTUAL_END_FIELD", &halves(last));
    }
    let time = recording.times()[0];
    if f64::from(first - 1) / f64::from(rate) != time {
        let [name, parameter] = FIRST_TIME;
        let text = format!("{time:e}");
        group(&mut section, 3, name);
        array(&mut section, 3, parameter, -1, &[text.len() as u8], text.as_bytes());
    }
    section.extend([0, 0]);
    section.resize(section.len().next_multiple_of(BLOCK), 0);
    Ok(section)
}

fn group(section: &mut Vec<u8>, number: i8, name: &str) {
    section.extend([name.len() as u8, -number as u8]);
    section.extend(name.bytes());
    // to the next parameter, past an empty description
    section.extend([3, 0, 0]);
}

fn word(section: &mut Vec<u8>, group: i8, name: &str, words: &[u16]) {
    let data: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
    let dimensions: &[u8] = if words.len() > 1 { &[words.len() as u8] } else { &[] };
    array(section, group, name, 2, dimensions, &data);
}

fn float(section: &mut Vec<u8>, group: i8, name: &str, x: f32) {
    array(section, group, name, 4, &[], &x.to_le_bytes());
}

fn array(section: &mut Vec<u8>, group: i8, name: &str, kind: i8, dimensions: &[u8], data: &[u8]) {
    section.extend([name.len() as u8, group as u8]);
    section.extend(name.bytes());
    section.extend(((2 + 2 + dimensions.len() + data.len() + 1) as u16).to_le_bytes());
    section.extend([kind as u8, dimensions.len() as u8]);
    section.extend(dimensions);
    section.extend(data);
    section.push(0);
}
