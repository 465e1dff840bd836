//! How the whole state of a node answers to what determines it.

use super::OrientationPath;
use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector6};
use somersault_multibody::DerivativeData;
use somersault_nlp::EvaluationError;

/// Inputs of a node before its channels and their rates: displacement of the orientation, centre of mass, its velocity,
/// angular momentum.
pub(super) const INPUTS: usize = 12;

/// Writes ∂(q, v) of the state by its inputs, a column for each.
pub(super) fn respond(
    path: &OrientationPath,
    partials: &mut DerivativeData,
    q: &[f64],
    v: &[f64],
    response: &mut DMatrix<f64>,
) -> Result<(), EvaluationError> {
    let (model, base) = (path.model(), path.motion().base());
    let found = model
        .momentum_partials(partials, q, v)
        .map_err(|error| EvaluationError::Undefined { what: error.to_string() })?;
    let (n_v, n_root) = (v.len(), model.velocities_of(0).len());
    let (n_linear, n_channels) = (if path.is_planar() { 2 } else { 3 }, base.n_weights());
    // the root's columns, by least squares: in the plane three of six rows are empty
    let (mut columns, mut centers) = (Matrix6::zeros(), Matrix3::zeros());
    columns.view_mut((0, 0), (6, n_root)).copy_from(&found.v.columns(0, n_root));
    centers.view_mut((0, 0), (3, n_linear)).copy_from(&found.center_of_mass_q.columns(0, n_linear));
    let (mut normal, mut center_normal) = (columns.tr_mul(&columns), centers.tr_mul(&centers));
    (n_root..6).for_each(|i| normal[(i, i)] = 1.0);
    (n_linear..3).for_each(|i| center_normal[(i, i)] = 1.0);
    let singular = || EvaluationError::Undefined { what: "the inertia of the tree".into() };
    let normal = normal.cholesky().ok_or_else(singular)?;
    let center_normal = center_normal.cholesky().ok_or_else(singular)?;
    response.fill(0.0);
    for (input, mut out) in response.column_iter_mut().enumerate() {
        let (mut center, mut momentum) = (Vector3::zeros(), Vector6::zeros());
        match input {
            0..3 if path.is_planar() => out[2] = f64::from(u8::from(input == 2)),
            0..3 => out[3 + input] = 1.0,
            3..6 => center[input - 3] = 1.0,
            6..9 => momentum[input - 6] = model.mass(),
            9..INPUTS => momentum[input - 6] = 1.0,
            _ => {
                let channel = (input - INPUTS) % n_channels;
                let first = if input - INPUTS < n_channels { n_root } else { n_v + n_root };
                out.rows_mut(first, n_v - n_root).copy_from(&base.directions().column(channel));
            }
        }
        for dof in n_linear..n_v {
            center -= found.center_of_mass_q.column(dof) * out[dof];
        }
        let linear = center_normal.solve(&centers.tr_mul(&center));
        (0..n_linear).for_each(|i| out[i] = linear[i]);
        for dof in 0..n_v {
            momentum -= found.q.column(dof) * out[dof];
            if dof >= n_root {
                momentum -= found.v.column(dof) * out[n_v + dof];
            }
        }
        let rates = normal.solve(&columns.tr_mul(&momentum));
        (0..n_root).for_each(|i| out[n_v + i] = rates[i]);
    }
    Ok(())
}
