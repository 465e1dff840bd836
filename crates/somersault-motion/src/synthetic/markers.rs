//! Markers that nobody measured.

use super::SyntheticError;
use crate::fit::MarkerSet;
use crate::noise::standard_normal;
use crate::recording::MarkerRecording;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use somersault_core::argument::{expect_length, expect_not_negative};
use somersault_multibody::{Data, Model};

/// **Synthetic** measurements: where `markers` of `model` are at its configurations, one after the other, each
/// coordinate with normal noise of standard deviation `noise`, m. The same for the same seed.
pub fn synthetic_markers(
    model: &Model,
    markers: &MarkerSet,
    times: &[f64],
    positions: &[f64],
    noise: f64,
    seed: u64,
) -> Result<MarkerRecording, SyntheticError> {
    expect_not_negative("noise", noise)?;
    expect_length("positions", positions.len(), times.len().saturating_mul(model.n_positions()))?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut data = Data::new(model);
    let mut points = Vec::with_capacity(times.len() * markers.markers().len());
    for q in positions.chunks_exact(model.n_positions()) {
        let placed = model.positions(&mut data, q)?;
        for marker in markers.markers() {
            let off = Vector3::from_fn(|_, _| standard_normal(&mut rng));
            points.push(Some(placed.pose(marker.body)?.point(&marker.point) + off * noise));
        }
    }
    let names = markers.markers().iter().map(|m| m.name.clone()).collect();
    Ok(MarkerRecording::try_new(names, times.to_vec(), points)?)
}
