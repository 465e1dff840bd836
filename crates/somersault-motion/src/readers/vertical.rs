//! Which axis of a file points up, as its markers show it.
//!
//! By their names: a head is above feet. The mean over all frames of the vector from markers of legs to those of head and
//! shoulders counts where it lies along one axis and keeps its length, which it does not for a person who turns over in the
//! air. By gravity then: over half a second of flight the mean of the markers is accelerated downwards by 9.8 m/s², as it is in no
//! walk.

use crate::recording::{Axis, Convention, MarkerRecording};
use nalgebra::Vector3;

const HIGH: [&str; 11] =
    ["head", "hd", "nose", "neck", "acrom", "shoulder", "sho", "c7", "clav", "tete", "stern"];
const LOW: [&str; 9] = ["toe", "heel", "ankle", "foot", "calc", "mt1", "mt5", "mall", "mtp"];
/// The least mean length of these vectors, m: who sits or leans has the head in front of the feet.
const TALL: f64 = 0.8;
/// The part of the mean length that must be left, along the axis, in the mean of the vectors.
const CLEAR: f64 = 0.85;
/// The greatest height of the feet in the frame in which they are lowest, m.
const FLOOR: f64 = 0.35;
/// Seconds of flight that show where down is.
const FLIGHT: f64 = 0.5;
/// Accelerations of a flight along its axis, and the greatest across it, m/s².
const FALL: std::ops::RangeInclusive<f64> = 8.5..=11.0;
const ACROSS: f64 = 1.5;
/// The greatest root mean square of what is left of the mean of the markers without a parabola, m.
const LEFT: f64 = 0.05;

/// The axis of the file that points up, and what shows it, where markers do; they are given in the world of this convention.
pub(super) fn upright(recording: &MarkerRecording, convention: &Convention) -> Option<(Axis, &'static str)> {
    let file = |axis| convention.file_axis(axis);
    // no system has a floor above it: who seems to stand there stands on the hands
    let named = by_names(recording).map(file).filter(|axis| [Axis::PlusY, Axis::PlusZ].contains(axis));
    match named {
        Some(axis) => Some((axis, "heads are above feet")),
        None => by_gravity(recording).map(|axis| (file(axis), "markers fall along it")),
    }
}

fn axis(number: usize, positive: bool) -> Axis {
    match (number, positive) {
        (0, true) => Axis::PlusX,
        (0, false) => Axis::MinusX,
        (1, true) => Axis::PlusY,
        (1, false) => Axis::MinusY,
        (_, true) => Axis::PlusZ,
        (_, false) => Axis::MinusZ,
    }
}

fn by_names(recording: &MarkerRecording) -> Option<Axis> {
    let of = |words: &[&str]| -> Vec<usize> {
        let named = |name: &String| words.iter().any(|word| name.to_ascii_lowercase().contains(word));
        (0..recording.n_markers()).filter(|&k| named(&recording.names()[k])).collect()
    };
    let (low, high) = (of(&LOW), of(&HIGH));
    let high: Vec<usize> = high.into_iter().filter(|k| !low.contains(k)).collect();
    let mean = |frame: &[Option<Vector3<f64>>], which: &[usize]| {
        let present: Vec<Vector3<f64>> = which.iter().filter_map(|&k| frame[k]).collect();
        (present.len() >= 2).then(|| present.iter().sum::<Vector3<f64>>() / present.len() as f64)
    };
    let ends: Vec<(Vector3<f64>, Vector3<f64>)> =
        recording.frames().filter_map(|frame| Some((mean(frame, &low)?, mean(frame, &high)?))).collect();
    let ways: Vec<Vector3<f64>> = ends.iter().map(|(low, high)| high - low).collect();
    let lengths: f64 = ways.iter().map(Vector3::norm).sum();
    let whole: Vector3<f64> = ways.iter().sum();
    let number = whole.iamax();
    let clear =
        lengths.is_finite() && lengths > TALL * ways.len() as f64 && whole[number].abs() > CLEAR * lengths;
    // who lies has feet anywhere along the body, and who stands has them near the floor
    let lowest = ends.iter().map(|(low, _)| low[number].abs()).fold(f64::INFINITY, f64::min);
    // forward is x by most conventions, and up then is not
    (clear && number != 0 && lowest < FLOOR).then(|| axis(number, whole[number] > 0.0))
}

/// The opposite of the acceleration in the first half second that looks like a flight, if no other does in another direction.
fn by_gravity(recording: &MarkerRecording) -> Option<Axis> {
    let times = recording.times();
    let mut found = None;
    let mut start = 0;
    while start < times.len() {
        let end = start + times[start..].partition_point(|t| *t < times[start] + FLIGHT);
        if end == times.len() && times[end - 1] - times[start] < 0.9 * FLIGHT {
            break;
        }
        if let Some(a) = acceleration(recording, start..end) {
            let number = a.iamax();
            let across = (0..3).filter(|&k| k != number).all(|k| a[k].abs() < ACROSS);
            if FALL.contains(&a[number].abs()) && across {
                let up = axis(number, a[number] < 0.0);
                if found.is_some_and(|before| before != up) {
                    return None;
                }
                found = Some(up);
            }
        }
        // windows overlap by three quarters
        start += (times[start..].partition_point(|t| *t < times[start] + FLIGHT / 4.0)).max(1);
    }
    found
}

/// The second derivative of the parabola that is nearest to the mean of the markers that are present in all these frames.
fn acceleration(recording: &MarkerRecording, frames: std::ops::Range<usize>) -> Option<Vector3<f64>> {
    let n = frames.len() as f64;
    if frames.len() < 8 {
        return None;
    }
    let rows: Vec<_> = frames.clone().filter_map(|i| recording.frame(i)).collect();
    let present: Vec<usize> =
        (0..recording.n_markers()).filter(|&k| rows.iter().all(|row| row[k].is_some())).collect();
    if present.is_empty() {
        return None;
    }
    let times = &recording.times()[frames];
    let middle = times.iter().sum::<f64>() / n;
    let moment = |power: i32| times.iter().map(|t| (t - middle).powi(power)).sum::<f64>() / n;
    let (second, third) = (moment(2), moment(3));
    // the polynomial of second degree that is orthogonal to those below it
    let weight = |t: f64| (t - middle).powi(2) - second - third / second * (t - middle);
    let size: f64 = times.iter().map(|t| weight(*t).powi(2)).sum();
    let means: Vec<Vector3<f64>> = rows
        .iter()
        .map(|row| present.iter().filter_map(|&k| row[k]).sum::<Vector3<f64>>() / present.len() as f64)
        .collect();
    let along = |part: &dyn Fn(f64) -> f64| -> Vector3<f64> {
        means.iter().zip(times).map(|(mean, t)| mean * part(*t)).sum()
    };
    let (centre, curve) = (along(&|_| 1.0 / n), along(&weight) / size);
    let slope = along(&|t| (t - middle) / (n * second));
    let rest = means
        .iter()
        .zip(times)
        .map(|(mean, t)| (mean - centre - slope * (t - middle) - curve * weight(*t)).norm_squared());
    let left = (rest.sum::<f64>() / n).sqrt();
    (left < LEFT).then_some(2.0 * curve)
}
