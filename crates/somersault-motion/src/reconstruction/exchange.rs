//! Markers that were exchanged in some frames, as left and right are: found where a flight predicts one at the place of the other.
//!
//! ```text
//! w_a |y_a − x_a|² + w_b |y_b − x_b|² − w_a |y_b − x_a|² − w_b |y_a − x_b|²  >  (6 σ)²
//! ```
//! of what is measured, y, and predicted, x, with the weights w. The difference of two normal errors along the line between the markers must be
//! six standard deviations for that by chance, whatever the distance; markers that are exchanged are found from a distance of 4.3 σ on.

use super::flight::{Exchange, FOLLOWED, ReconstructedFlight};
use crate::fit::MarkerSet;
use crate::recording::{MarkerRecording, RecordingError};
use nalgebra::Vector3;
use somersault_multibody::{Data, DynamicsError, Model};
use std::collections::BTreeSet;

/// Standard deviations that errors are not beyond by chance.
const CHANCE: f64 = 6.0;

/// A frame, and two markers of the set in their order.
type Swap = (usize, usize, usize);

/// The markers that a flight predicts at each other's places in `recording`, whose frames are its own; a marker once in a frame. `noise` is
/// that of fits of single frames: exchanged markers enlarge the flight's.
pub(super) fn exchanged(
    model: &Model,
    markers: &MarkerSet,
    flight: &ReconstructedFlight,
    recording: &MarkerRecording,
    noise: Option<f64>,
) -> Result<Vec<Swap>, DynamicsError> {
    let size = noise.map_or(flight.noise.size, |size| flight.noise.size.min(size.hypot(FOLLOWED)));
    let least = (CHANCE * size).powi(2);
    let numbers = numbers(markers, recording);
    let mut data = Data::new(model);
    let mut found = Vec::new();
    for (i, (frame, measured)) in flight.frames.iter().zip(recording.frames()).enumerate() {
        let positions = model.positions(&mut data, &frame.q)?;
        let root = positions.pose(0)?.translation;
        let mut seen: Vec<(usize, Vector3<f64>, Vector3<f64>, f64)> = Vec::new();
        for (k, marker) in markers.markers().iter().enumerate() {
            let Some(point) = numbers[k].and_then(|number| measured[number]) else { continue };
            let arm = positions.pose(marker.body)?.point(&marker.point) - root;
            seen.push((k, point, root + arm * flight.scale[0], marker.weight));
        }
        let mut gains = Vec::new();
        for (first, (a, y_a, x_a, w_a)) in seen.iter().enumerate() {
            for (b, y_b, x_b, w_b) in &seen[first + 1..] {
                let square = |y: &Vector3<f64>, x: &Vector3<f64>| (y - x).norm_squared();
                let own = w_a * square(y_a, x_a) + w_b * square(y_b, x_b);
                let gain = own - w_a * square(y_b, x_a) - w_b * square(y_a, x_b);
                if gain > least {
                    gains.push((gain, *a, *b));
                }
            }
        }
        gains.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut taken = BTreeSet::new();
        for (_, a, b) in gains {
            if !taken.contains(&a) && !taken.contains(&b) {
                taken.extend([a, b]);
                found.push((i, a, b));
            }
        }
    }
    Ok(found)
}

/// The number of each marker in a recording.
fn numbers(markers: &MarkerSet, recording: &MarkerRecording) -> Vec<Option<usize>> {
    markers.markers().iter().map(|marker| recording.marker(&marker.name).ok()).collect()
}

/// The recording with markers exchanged.
pub(super) fn put_right(
    markers: &MarkerSet,
    recording: &MarkerRecording,
    swaps: &[Swap],
) -> Result<MarkerRecording, RecordingError> {
    let numbers = numbers(markers, recording);
    let n = recording.n_markers();
    let mut points: Vec<Option<Vector3<f64>>> = recording.frames().flatten().copied().collect();
    for (i, a, b) in swaps {
        if let (Some(a), Some(b)) = (numbers[*a], numbers[*b]) {
            points.swap(i * n + a, i * n + b);
        }
    }
    MarkerRecording::try_new(recording.names().to_vec(), recording.times().to_vec(), points)
}

/// What was exchanged pair by pair, from one gap of more than `gap` s without it to the next, where each frame's markers are `recorded` as
/// others.
pub(super) fn intervals(
    markers: &MarkerSet,
    times: &[f64],
    recorded: &[Vec<usize>],
    gap: f64,
) -> Vec<Exchange> {
    let pairs_of = |(i, recorded): (usize, &Vec<usize>)| -> Vec<Swap> {
        let moved = recorded.iter().enumerate().filter(|(own, other)| own != *other);
        moved.map(|(own, other)| (i, own.min(*other), own.max(*other))).collect()
    };
    let swaps: BTreeSet<Swap> = recorded.iter().enumerate().flat_map(pairs_of).collect();
    let mut all: Vec<Swap> = swaps.into_iter().collect();
    all.sort_by_key(|(i, a, b)| (*a, *b, *i));
    let mut found: Vec<Exchange> = Vec::new();
    for (i, a, b) in all {
        let names = [a, b].map(|k| markers.markers()[k].name.clone());
        let t = times[i];
        match found.last_mut().filter(|last| last.markers == names && t - last.end <= gap) {
            Some(last) => {
                last.end = t;
                last.n_frames += 1;
            }
            None => found.push(Exchange { markers: names, start: t, end: t, n_frames: 1 }),
        }
    }
    found
}
