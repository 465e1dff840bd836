//! What a fit seeks: scale, configuration, and the weights behind it.

use super::{FitOptions, Shape};
use serde::{Deserialize, Serialize};
use somersault_multibody::joint_motion::EigenpostureBase;
use somersault_multibody::{DynamicsError, Model};

/// Scale, pose and shape of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Size over that of the model.
    pub scale: f64,
    /// Configuration of the model; places of the root are in m and not scaled.
    pub q: Vec<f64>,
    /// Weights of the eigenpostures; empty where joints are fitted.
    pub weights: Vec<f64>,
}

/// The unknowns of a frame as one run of numbers: scale, rates of the root, then rates of the joints or weights.
#[derive(Debug, Clone)]
pub(super) struct Unknowns {
    /// Numbers of the root in q and in v.
    pub(super) root: (usize, usize),
    base: Option<EigenpostureBase>,
    /// Bounds of the unknowns that have a value of their own; the others are not bounded.
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    /// For each unknown its place in q, if it is a single coordinate there.
    coordinate: Vec<Option<usize>>,
    /// Room for rates of all joints.
    rates: Vec<f64>,
    moved: Vec<f64>,
}

impl Unknowns {
    pub(super) fn new(model: &Model, options: &FitOptions) -> Self {
        let root = (model.positions_of(0).len(), model.velocities_of(0).len());
        let base = match &options.shape {
            Shape::Joints => None,
            Shape::Eigenpostures(base) => Some(base.clone()),
        };
        let n_shape = base.as_ref().map_or(model.n_velocities() - root.1, EigenpostureBase::n_weights);
        let n = 1 + root.1 + n_shape;
        let [smallest, largest] = options.scale.bounds();
        let mut lower = vec![f64::NEG_INFINITY; n];
        let mut upper = vec![f64::INFINITY; n];
        let mut coordinate = vec![None; n];
        (lower[0], upper[0]) = (smallest, largest);
        if base.is_some() {
            // the sum bounds them from above
            lower[1 + root.1..].fill(0.0);
        } else {
            for i in 1..model.n_bodies() {
                let (at, rate) = (model.positions_of(i), model.velocities_of(i));
                if at.len() == 1 {
                    coordinate[1 + rate.start] = Some(at.start);
                    if let Some(limits) = model.limits(i) {
                        [lower[1 + rate.start], upper[1 + rate.start]] = limits;
                    }
                }
            }
        }
        let (rates, moved) = (vec![0.0; model.n_velocities()], vec![0.0; model.n_positions()]);
        Self { root, base, lower, upper, coordinate, rates, moved }
    }

    /// Number of unknowns.
    pub(super) fn n(&self) -> usize {
        self.lower.len()
    }

    /// First of the weights among the unknowns, if there are weights.
    pub(super) fn weights_at(&self) -> Option<usize> {
        self.base.as_ref().map(|_| 1 + self.root.1)
    }

    pub(super) fn base(&self) -> Option<&EigenpostureBase> {
        self.base.as_ref()
    }

    /// The value of an unknown that has one.
    pub(super) fn value(&self, estimate: &Estimate, i: usize) -> Option<f64> {
        match (i, self.weights_at()) {
            (0, _) => Some(estimate.scale),
            (_, Some(first)) => i.checked_sub(first).map(|k| estimate.weights[k]),
            (_, None) => self.coordinate[i].map(|at| estimate.q[at]),
        }
    }

    /// Place in q and range of an unknown that is a joint's angle or way.
    pub(super) fn range(&self, i: usize) -> Option<(usize, [f64; 2])> {
        let at = self.coordinate[i].filter(|_| self.base.is_none())?;
        let range = [self.lower[i], self.upper[i]];
        range.iter().all(|x| x.is_finite()).then_some((at, range))
    }

    /// An estimate at neutral pose with a start for the shape, brought within the bounds.
    pub(super) fn start(&self, model: &Model, shape: Option<&[f64]>) -> Estimate {
        let mut q = model.neutral();
        let mut weights = vec![0.0; self.base.as_ref().map_or(0, EigenpostureBase::n_weights)];
        if let Some(shape) = shape {
            let target = if self.base.is_some() { &mut weights[..] } else { &mut q[self.root.0..] };
            target.copy_from_slice(shape);
        }
        weights.iter_mut().for_each(|w| *w = w.max(0.0));
        let sum: f64 = weights.iter().sum();
        if sum > 1.0 {
            weights.iter_mut().for_each(|w| *w /= sum);
        }
        let mut estimate = Estimate { scale: 1.0_f64.clamp(self.lower[0], self.upper[0]), q, weights };
        self.clamp(&mut estimate);
        self.assume_weights(&mut estimate);
        estimate
    }

    fn clamp(&self, estimate: &mut Estimate) {
        estimate.scale = estimate.scale.clamp(self.lower[0], self.upper[0]);
        for (i, at) in self.coordinate.iter().enumerate() {
            if let Some(at) = *at {
                estimate.q[at] = estimate.q[at].max(self.lower[i]).min(self.upper[i]);
            }
        }
        estimate.weights.iter_mut().for_each(|w| *w = w.max(0.0));
    }

    /// The joints follow the weights.
    fn assume_weights(&self, estimate: &mut Estimate) {
        if let Some(base) = &self.base {
            base.positions_into(&estimate.weights, &mut estimate.q[self.root.0..]);
        }
    }

    /// out ← estimate ⊕ step. Both have been made for this model.
    pub(super) fn advance(
        &mut self,
        model: &Model,
        estimate: &Estimate,
        step: &[f64],
        out: &mut Estimate,
    ) -> Result<(), DynamicsError> {
        out.scale = estimate.scale + step[0];
        match self.weights_at() {
            Some(first) => {
                self.rates[..self.root.1].copy_from_slice(&step[1..first]);
                for (k, weight) in out.weights.iter_mut().enumerate() {
                    *weight = estimate.weights[k] + step[first + k];
                }
            }
            None => self.rates.copy_from_slice(&step[1..]),
        }
        model.displace(&estimate.q, &self.rates, &mut self.moved)?;
        out.q.copy_from_slice(&self.moved);
        model.normalize(&mut out.q)?;
        self.clamp(out);
        self.assume_weights(out);
        Ok(())
    }
}
