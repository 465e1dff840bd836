//! Markers that were exchanged in some frames, as left and right are: found where a flight predicts one at the place of the other.
//!
//! ```text
//! w_a |y_a − x_a|² + w_b |y_b − x_b|² − w_a |y_b − x_a|² − w_b |y_a − x_b|²  >  (6 σ)²
//! ```
//! of what is measured, y, and predicted, x, with the weights w. The difference of two normal errors along the line between the markers must be
//! six standard deviations for that by chance, whatever the distance; markers that are exchanged are found from a distance of 4.3 σ on. The
//! squares on the right must also be less than a quarter of those on the left, as a marker that is somewhere else may gain by any exchange. Where one of the two is
//! missing, its squares are left out.

use super::flight::{Exchange, FOLLOWED, ReconstructedFlight};
use crate::fit::MarkerSet;
use crate::recording::{MarkerRecording, RecordingError};
use nalgebra::Vector3;
use somersault_multibody::{Data, DynamicsError, Model};
use std::collections::BTreeSet;

/// Standard deviations that errors are not beyond by chance.
const CHANCE: f64 = 6.0;
/// What exchanged markers may be away from each other's predicted places at the end, as a fraction of the squares of their distances from
/// their own. Until exchanges settle any that gains is made: a flight between the two is nearer to neither.
pub(super) const LEFT: f64 = 0.25;

/// A frame, and two markers of the set in their order.
type Swap = (usize, usize, usize);

/// The markers that a flight predicts at each other's places in `recording`, whose frames are its own, in order; a marker once in a frame. `noise` is
/// that of fits of single frames: exchanged markers enlarge the flight's. What they are away from each other's places is less than `left` of the
/// squares of their distances from their own.
pub(super) fn exchanged(
    model: &Model,
    markers: &MarkerSet,
    flight: &ReconstructedFlight,
    recording: &MarkerRecording,
    noise: Option<f64>,
    left: f64,
) -> Result<Vec<Swap>, DynamicsError> {
    let size = noise.map_or(flight.noise.size, |size| flight.noise.size.min(size.hypot(FOLLOWED)));
    let least = (CHANCE * size).powi(2);
    let numbers = numbers(markers, recording);
    let mut data = Data::new(model);
    let mut found = Vec::new();
    for (i, (frame, measured)) in flight.frames.iter().zip(recording.frames()).enumerate() {
        let positions = model.positions(&mut data, &frame.q)?;
        let root = positions.pose(0)?.translation;
        let weights: Vec<f64> = recording.weights(i).collect();
        let mut places = Vec::new();
        for (k, marker) in markers.markers().iter().enumerate() {
            let Some(number) = numbers[k] else { continue };
            let arm = positions.pose(marker.body)?.point(&marker.point) - root;
            let weight = marker.weight * weights[number];
            places.push((k, measured[number], root + arm * flight.scale[0], weight));
        }
        let mut gains = Vec::new();
        for (first, (a, y_a, x_a, w_a)) in places.iter().enumerate() {
            for (b, y_b, x_b, w_b) in &places[first + 1..] {
                // of a marker that is missing there is nothing to compare
                let square =
                    |y: &Option<Vector3<f64>>, x: &Vector3<f64>| y.map_or(0.0, |y| (y - x).norm_squared());
                let own = w_a * square(y_a, x_a) + w_b * square(y_b, x_b);
                let other = w_a * square(y_b, x_a) + w_b * square(y_a, x_b);
                if own - other > least && other < left * own {
                    gains.push((own - other, *a, *b));
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
    found.sort_unstable();
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
    let mut weights: Vec<f64> = (0..recording.n_frames()).flat_map(|i| recording.weights(i)).collect();
    for (i, a, b) in swaps {
        if let (Some(a), Some(b)) = (numbers[*a], numbers[*b]) {
            points.swap(i * n + a, i * n + b);
            weights.swap(i * n + a, i * n + b);
        }
    }
    MarkerRecording::try_new(recording.names().to_vec(), recording.times().to_vec(), points)?
        .with_weights(weights)
}

/// What was exchanged pair by pair, from one gap of more than `gap` s without it to the next.
pub(super) fn intervals(markers: &MarkerSet, times: &[f64], mut swaps: Vec<Swap>, gap: f64) -> Vec<Exchange> {
    swaps.sort_by_key(|(i, a, b)| (*a, *b, *i));
    let mut found: Vec<Exchange> = Vec::new();
    for (i, a, b) in swaps {
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
