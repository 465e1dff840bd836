//! Room for the equations of motion of a tree.

use super::TreeVariation;
use crate::data::Data;
use crate::model::Model;
use crate::spatial::Force;

/// Room for one evaluation, and its results.
#[derive(Debug, Clone)]
pub struct TreeWorkspace {
    pub(crate) data: Data,
    pub(crate) v: Vec<f64>,
    pub(crate) acceleration: Vec<f64>,
    pub(crate) torque: Vec<f64>,
    /// Empty where the forces have none.
    pub(crate) wrenches: Vec<Force<f64>>,
    /// For derivatives, made where they are first wanted.
    pub(super) variation: Option<Box<TreeVariation>>,
}

impl TreeWorkspace {
    pub(crate) fn new(model: &Model, has_wrenches: bool) -> Self {
        let n = model.n_velocities();
        let n_wrenches = if has_wrenches { model.n_bodies() } else { 0 };
        Self {
            data: Data::new(model),
            v: vec![0.0; n],
            acceleration: vec![0.0; n],
            torque: vec![0.0; n],
            wrenches: vec![Force::zero(); n_wrenches],
            variation: None,
        }
    }
}
