//! One phase of a transcription: what its functions gave last, and the loops that make derivatives of it.

use super::entries::Sink;
use super::function::{Sizes, VectorFunction};
use super::layout::PhaseLayout;
use super::mesh::Grid;
use super::problem::Phase;
use nalgebra::DMatrix;

/// What the functions of a phase have given last.
pub(super) struct PhaseWork {
    pub(super) arguments: Vec<f64>,
    pub(super) end_arguments: Vec<f64>,
    /// f, then L and g, at each point.
    pub(super) rates: Vec<f64>,
    pub(super) path: Vec<f64>,
    pub(super) ends: Vec<f64>,
    pub(super) rates_by: Vec<DMatrix<f64>>,
    pub(super) path_by: Vec<DMatrix<f64>>,
    pub(super) ends_by: DMatrix<f64>,
    /// Of σ w L − yᵀ f, and of the path constraints.
    pub(super) curvature: DMatrix<f64>,
    pub(super) path_curvature: DMatrix<f64>,
    pub(super) end_curvature: DMatrix<f64>,
    pub(super) slope: Vec<f64>,
    pub(super) end_weights: Vec<f64>,
    pub(super) weights: Vec<f64>,
    pub(super) path_weights: Vec<f64>,
}

impl PhaseWork {
    pub(super) fn new(phase: &Phase, n_points: usize) -> Self {
        let Sizes { states, .. } = phase.sizes;
        let (point, ends) = (phase.sizes.point(), phase.sizes.ends());
        let (n_path, n_ends) = (phase.path.n_outputs(), phase.ends.n_outputs());
        Self {
            arguments: vec![0.0; point],
            end_arguments: vec![0.0; ends],
            rates: vec![0.0; n_points * states],
            path: vec![0.0; n_points * n_path],
            ends: vec![0.0; n_ends],
            rates_by: vec![DMatrix::zeros(states, point); n_points],
            path_by: vec![DMatrix::zeros(n_path, point); n_points],
            ends_by: DMatrix::zeros(n_ends, ends),
            curvature: DMatrix::zeros(point, point),
            path_curvature: DMatrix::zeros(point, point),
            end_curvature: DMatrix::zeros(ends, ends),
            slope: vec![0.0; point],
            end_weights: vec![0.0; n_ends],
            weights: vec![0.0; states],
            path_weights: vec![0.0; n_path],
        }
    }
}

/// One phase as the loops see it.
pub(super) struct View<'a> {
    pub(super) sizes: Sizes,
    pub(super) grid: &'a Grid,
    pub(super) layout: &'a PhaseLayout,
    pub(super) work: &'a PhaseWork,
    pub(super) duration: f64,
    /// First row of the defects in c; those of the path constraints and of the ends follow.
    pub(super) row: usize,
}

impl View<'_> {
    pub(super) fn n_path(&self) -> usize {
        self.work.path_weights.len() - 1
    }

    pub(super) fn path_row(&self) -> usize {
        self.row + self.grid.n_points() * self.sizes.states
    }

    pub(super) fn end_row(&self) -> usize {
        self.path_row() + self.grid.n_points() * self.n_path()
    }

    pub(super) fn n_rows(&self) -> usize {
        self.end_row() + self.work.ends.len() - 1 - self.row
    }

    /// Defects, path and end constraints by all variables.
    pub(super) fn jacobian(&self, sink: &mut impl Sink) {
        let Sizes { states, controls, parameters } = self.sizes;
        let (times, time_column) = (self.layout.times(), states + controls + parameters);
        for interval in &self.grid.intervals {
            let half = 0.5 * self.duration * interval.length;
            let d = interval.radau.differentiation();
            for (local, i) in interval.points().enumerate() {
                let (by, fraction) = (&self.work.rates_by[i], self.grid.fractions[i]);
                for s in 0..states {
                    let row = self.row + i * states + s;
                    for l in 0..d.ncols() {
                        sink.add(row, self.layout.state(interval.first + l) + s, d[(local, l)]);
                    }
                    for a in 0..time_column {
                        sink.add(row, self.layout.argument(i, a), -half * by[(s, a)]);
                    }
                    let (stretch, drift) = (
                        0.5 * interval.length * self.work.rates[i * states + s],
                        half * by[(s, time_column)],
                    );
                    sink.add(row, times, stretch - drift * (1.0 - fraction));
                    sink.add(row, times + 1, -stretch - drift * fraction);
                }
                let path_by = &self.work.path_by[i];
                for c in 0..self.n_path() {
                    let row = self.path_row() + i * self.n_path() + c;
                    for a in 0..time_column {
                        sink.add(row, self.layout.argument(i, a), path_by[(1 + c, a)]);
                    }
                    sink.add(row, times, path_by[(1 + c, time_column)] * (1.0 - fraction));
                    sink.add(row, times + 1, path_by[(1 + c, time_column)] * fraction);
                }
            }
        }
        for c in 0..self.work.ends.len() - 1 {
            for a in 0..self.sizes.ends() {
                sink.add(self.end_row() + c, self.layout.end_argument(a), self.work.ends_by[(1 + c, a)]);
            }
        }
    }

    /// The gradient of the cost, by all variables.
    pub(super) fn gradient(&self, gradient: &mut [f64]) {
        let Sizes { states, controls, parameters } = self.sizes;
        let (times, time_column) = (self.layout.times(), states + controls + parameters);
        let n_outputs = self.n_path() + 1;
        for interval in &self.grid.intervals {
            for (i, w) in interval.points().zip(interval.radau.weights()) {
                let (by, fraction) = (&self.work.path_by[i], self.grid.fractions[i]);
                let half = 0.5 * self.duration * interval.length * w;
                for a in 0..time_column {
                    gradient[self.layout.argument(i, a)] += half * by[(0, a)];
                }
                let stretch = 0.5 * interval.length * w * self.work.path[i * n_outputs];
                gradient[times] += half * by[(0, time_column)] * (1.0 - fraction) - stretch;
                gradient[times + 1] += half * by[(0, time_column)] * fraction + stretch;
            }
        }
        for a in 0..self.sizes.ends() {
            gradient[self.layout.end_argument(a)] += self.work.ends_by[(0, a)];
        }
    }

    /// The part of the Lagrangian's Hessian that a point has, from the curvatures and the slope in `work`.
    pub(super) fn point_hessian(&self, i: usize, length: f64, sink: &mut impl Sink) {
        let n = self.sizes.point() - 1;
        let (times, s, half) = (self.layout.times(), self.grid.fractions[i], 0.5 * self.duration * length);
        let entry =
            |a: usize, b: usize| half * self.work.curvature[(a, b)] + self.work.path_curvature[(a, b)];
        let stretch = |a: usize| 0.5 * length * self.work.slope[a];
        for b in 0..n {
            let column = self.layout.argument(i, b);
            for a in 0..=b {
                sink.add(self.layout.argument(i, a), column, entry(a, b));
            }
            sink.add(column, times, entry(b, n) * (1.0 - s) - stretch(b));
            sink.add(column, times + 1, entry(b, n) * s + stretch(b));
        }
        let (bend, push) = (entry(n, n), stretch(n));
        sink.add(times, times, bend * (1.0 - s) * (1.0 - s) - 2.0 * push * (1.0 - s));
        sink.add(times, times + 1, bend * s * (1.0 - s) + push * (1.0 - 2.0 * s));
        sink.add(times + 1, times + 1, bend * s * s + 2.0 * push * s);
    }

    pub(super) fn end_hessian(&self, sink: &mut impl Sink) {
        for b in 0..self.sizes.ends() {
            for a in 0..=b {
                let entry = self.work.end_curvature[(a, b)];
                sink.add(self.layout.end_argument(a), self.layout.end_argument(b), entry);
            }
        }
    }
}
