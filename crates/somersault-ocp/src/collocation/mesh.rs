//! A mesh: a division of a phase into intervals, each with a number of collocation points of its own.

use super::error::CollocationError;
use super::radau::{MAX_POINTS, Radau};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Intervals of a phase, as fractions of its duration.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Parts"))]
pub struct Mesh {
    /// From 0 to 1, increasing: one more than intervals.
    bounds: Vec<f64>,
    /// Collocation points of each interval.
    points: Vec<usize>,
}

/// A mesh as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Parts {
    bounds: Vec<f64>,
    points: Vec<usize>,
}

#[cfg(feature = "serde")]
impl TryFrom<Parts> for Mesh {
    type Error = CollocationError;

    fn try_from(Parts { bounds, points }: Parts) -> Result<Self, CollocationError> {
        Self::try_new(bounds, points)
    }
}

/// Collocation points of a phase: some gigabytes of derivatives for a tree of twenty joints.
const MOST_POINTS: usize = 100_000;
const TOO_MANY: &str = "it may have at most 100000 points";

impl Mesh {
    /// Intervals between `bounds`, which increase from 0 to 1, with `points` collocation points each, 100 000 in
    /// all at most.
    pub fn try_new(bounds: Vec<f64>, points: Vec<usize>) -> Result<Self, CollocationError> {
        let fail = |reason| Err(CollocationError::Mesh { phase: None, reason });
        if points.is_empty() || bounds.len() != points.len() + 1 {
            return fail("it needs an interval, and a bound more than intervals");
        }
        if bounds[0] != 0.0 || bounds[points.len()] != 1.0 || !bounds.windows(2).all(|w| w[0] < w[1]) {
            return fail("its bounds must increase from 0 to 1");
        }
        if points.iter().fold(0usize, |sum, n| sum.saturating_add(*n)) > MOST_POINTS {
            return fail(TOO_MANY);
        }
        if points.iter().any(|n| !(1..=MAX_POINTS).contains(n)) {
            return fail("an interval needs 1 to 500 points");
        }
        Ok(Self { bounds, points })
    }

    /// `intervals` of equal length with `points` each.
    pub fn try_uniform(intervals: usize, points: usize) -> Result<Self, CollocationError> {
        if intervals > MOST_POINTS {
            return Err(CollocationError::Mesh { phase: None, reason: TOO_MANY });
        }
        let bounds = (0..=intervals).map(|k| k as f64 / intervals as f64).collect();
        Self::try_new(bounds, vec![points; intervals])
    }

    /// Number of intervals.
    pub fn n_intervals(&self) -> usize {
        self.points.len()
    }

    /// Number of collocation points of all intervals.
    pub fn n_points(&self) -> usize {
        self.points.iter().sum()
    }

    /// From 0 to 1: one more than intervals.
    pub fn bounds(&self) -> &[f64] {
        &self.bounds
    }

    /// Collocation points of each interval.
    pub fn points(&self) -> &[usize] {
        &self.points
    }
}

/// A mesh with the points and matrices of its intervals.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) mesh: Mesh,
    pub(super) intervals: Vec<GridInterval>,
    /// Fraction of the phase at each collocation point.
    pub(super) fractions: Vec<f64>,
}

#[derive(Debug, Clone)]
pub(super) struct GridInterval {
    pub(super) radau: Arc<Radau>,
    /// Number of its first collocation point.
    pub(super) first: usize,
    /// Its part of the phase.
    pub(super) length: f64,
    pub(super) start: f64,
}

impl Grid {
    pub(super) fn try_new(mesh: Mesh) -> Result<Self, CollocationError> {
        let mut made: BTreeMap<usize, Arc<Radau>> = BTreeMap::new();
        let (mut intervals, mut fractions) = (Vec::new(), Vec::with_capacity(mesh.n_points()));
        for (k, &n) in mesh.points.iter().enumerate() {
            let radau = match made.get(&n) {
                Some(radau) => radau.clone(),
                None => made.entry(n).or_insert(Arc::new(Radau::try_new(n)?)).clone(),
            };
            let (start, length) = (mesh.bounds[k], mesh.bounds[k + 1] - mesh.bounds[k]);
            let first = fractions.len();
            fractions.extend(radau.points().iter().map(|tau| start + 0.5 * (tau + 1.0) * length));
            intervals.push(GridInterval { radau, first, length, start });
        }
        Ok(Self { mesh, intervals, fractions })
    }

    pub(super) fn n_points(&self) -> usize {
        self.fractions.len()
    }

    /// The interval that holds a fraction of the phase, and where in [−1, 1].
    pub(super) fn locate(&self, fraction: f64) -> (usize, f64) {
        let k = self.mesh.bounds.partition_point(|&b| b <= fraction).clamp(1, self.intervals.len()) - 1;
        (k, self.intervals[k].local(fraction))
    }
}

impl GridInterval {
    /// Where in [−1, 1] a fraction of the phase is.
    pub(super) fn local(&self, fraction: f64) -> f64 {
        (2.0 * (fraction - self.start) / self.length - 1.0).clamp(-1.0, 1.0)
    }

    /// Weight of quadrature over [−1, 1] of point number `i` of the phase.
    pub(super) fn weight(&self, i: usize) -> f64 {
        self.radau.weights()[i - self.first]
    }

    /// Numbers of its points.
    pub(super) fn points(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.radau.len()
    }
}
