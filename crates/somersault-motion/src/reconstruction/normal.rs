//! Residuals, and the normal equations of their squares.

use super::ReconstructionError;
use super::attitude::{Attitude, Flown, Room, turn_of};
use super::departure;
use super::joints::ACTIVE;
use super::unknowns::{Estimate, Layout};
use crate::cholesky::add_square;
use crate::fit::MarkerSet;
use crate::noise::{MarkerNoise, Whitening, whitening};
use nalgebra::{DMatrix, Matrix3, MatrixXx3, Vector3};
use rayon::prelude::*;
use somersault_core::lie::so3::hat;
use somersault_multibody::{Axes, Data, Model, Transform};
use std::ops::Range;

/// Markers over the frames of a flight.
#[derive(Debug, Clone)]
pub(super) struct Observed {
    pub(super) times: Vec<f64>,
    /// Number of the frame that the unknowns belong to.
    pub(super) reference: usize,
    /// For each frame, each marker of the set.
    pub(super) points: Vec<Vec<Option<Vector3<f64>>>>,
    /// The weights of the points in the recording.
    pub(super) weights: Trust,
}

/// Where the body and its markers are in a frame.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    /// Rotation of the root, its axes → world.
    pub(super) turn: Matrix3<f64>,
    /// Centre of mass from the origin of the root, world axes, at scale 1.
    pub(super) center: Vector3<f64>,
    /// The markers from the centre of mass, world axes, at scale 1.
    pub(super) arms: Vec<Vector3<f64>>,
    /// The axes of each marker's body in the world; none if derivatives were not requested.
    axes: Vec<Matrix3<f64>>,
    /// Derivatives of the arms by the channels, marker by marker; empty if they were not requested.
    by_channel: Vec<Vector3<f64>>,
    /// The displacement of the root by the unknowns, component by component, if it was requested.
    by_unknowns: Option<MatrixXx3<f64>>,
}

/// The flight at an estimate over a window.
pub(super) struct Linearized {
    pub(super) attitudes: Vec<Attitude>,
    pub(super) placed: Vec<Placed>,
}

/// ½ of the squares as a quadratic function of the unknowns.
pub(super) struct Normal {
    /// Jᵀ C⁻¹ J, its lower half.
    pub(super) matrix: DMatrix<f64>,
    /// Jᵀ C⁻¹ r.
    pub(super) gradient: Vec<f64>,
    /// rᵀ C⁻¹ r.
    pub(super) squares: f64,
    /// ln det of the covariance of all coordinates at size 1.
    pub(super) log_determinant: f64,
    /// Coordinates that were measured.
    pub(super) n_measured: usize,
}

/// Markers that are added up by one thread.
const GROUP: usize = 6;
/// Frames whose rows are multiplied together.
const CHUNK: usize = 24;
/// What a filter has of a frame before that is no longer counted.
const FORGOTTEN: f64 = 1e-9;

/// For each frame and marker the weight of the point, 1 at most.
pub(super) type Trust = Vec<Vec<f64>>;

/// Room for kinematics.
pub(super) struct Kinematics {
    data: Data,
    of_marker: DMatrix<f64>,
}

impl Kinematics {
    pub(super) fn new(model: &Model) -> Self {
        Self { data: Data::new(model), of_marker: DMatrix::zeros(6, model.n_velocities()) }
    }
}

impl Flown<'_> {
    /// The flight over `frames` at `estimate`, with derivatives where there are `knots`.
    pub(super) fn fly(
        &self,
        markers: &MarkerSet,
        observed: &Observed,
        estimate: &Estimate,
        frames: &Range<usize>,
        knots: Option<&Range<usize>>,
        room: &mut Room,
        kinematics: &mut Kinematics,
    ) -> Result<Linearized, ReconstructionError> {
        let times = &observed.times[frames.clone()];
        let attitudes = self.attitudes(estimate, times, observed.reference - frames.start, knots, room)?;
        let mut placed = Vec::with_capacity(times.len());
        for (t, attitude) in times.iter().zip(&attitudes) {
            placed.push(self.place(markers, estimate, *t, attitude, knots.is_some(), room, kinematics)?);
        }
        Ok(Linearized { attitudes, placed })
    }

    /// Body and markers at `t`.
    fn place(
        &self,
        markers: &MarkerSet,
        estimate: &Estimate,
        t: f64,
        attitude: &Attitude,
        with_derivatives: bool,
        room: &mut Room,
        kinematics: &mut Kinematics,
    ) -> Result<Placed, ReconstructionError> {
        self.pose(estimate, t, &attitude.orientation, room);
        let Kinematics { data, of_marker } = kinematics;
        let n_root = self.model.velocities_of(0).len();
        let n = self.layout.n_channels;
        let mut of_center = Vec::new();
        if with_derivatives {
            let matrix = self.model.centroidal(data, &room.q)?.matrix;
            of_center.extend((0..n).map(|c| matrix.fixed_view::<3, 1>(0, n_root + c) / self.model.mass()));
        }
        let positions = self.model.positions(data, &room.q)?;
        let root = positions.pose(0)?.translation;
        let center = positions.center_of_mass() - root;
        let mut arms = Vec::with_capacity(markers.markers().len());
        let (mut axes, mut by_channel) = (Vec::new(), Vec::new());
        for marker in markers.markers() {
            let pose = positions.pose(marker.body)?;
            arms.push(pose.point(&marker.point) - root - center);
            if with_derivatives {
                axes.push(pose.rotation);
                let frame = Transform::translation(marker.point);
                positions.jacobian_into(marker.body, &frame, Axes::World, of_marker)?;
                let first = by_channel.len();
                by_channel.extend((0..n).map(|c| of_marker.fixed_view::<3, 1>(0, n_root + c) - of_center[c]));
                self.splines.by_displacements(&room.channels, &mut by_channel[first..]);
            }
        }
        let by_unknowns = attitude.by_unknowns.as_ref().map(|by| by.transpose());
        let turn = turn_of(self.model, &attitude.orientation);
        Ok(Placed { turn, center, arms, axes, by_channel, by_unknowns })
    }

    /// The centre of mass at `t`, where `reference` is the time that the unknowns belong to.
    pub(super) fn center_of_mass(&self, estimate: &Estimate, reference: f64, t: f64) -> Vector3<f64> {
        let t = t - reference;
        let gravity = self.model.gravity() * estimate.gravity;
        estimate.center + estimate.velocity * t + gravity * (0.5 * t * t)
    }

    /// Coordinates that count of each marker's residual in each of `frames`; none where it is missing.
    pub(super) fn residuals(
        &self,
        observed: &Observed,
        estimate: &Estimate,
        frames: Range<usize>,
        placed: &[Placed],
    ) -> Vec<Vec<Option<Vector3<f64>>>> {
        let reference = observed.times[observed.reference];
        let of_frame = |(i, placed): (usize, &Placed)| {
            let center = self.center_of_mass(estimate, reference, observed.times[i]);
            let residual = |(arm, point): (&Vector3<f64>, &Option<Vector3<f64>>)| {
                point.map(|point| self.layout.within(&(center + arm * estimate.scale - point)))
            };
            placed.arms.iter().zip(&observed.points[i]).map(residual).collect()
        };
        frames.zip(placed).map(of_frame).collect()
    }

    /// Squares of the residuals of `frames` under `noise`, and their derivatives by the unknowns with the coefficients of `knots` where
    /// the flight has its own.
    pub(super) fn normal(
        &self,
        markers: &MarkerSet,
        observed: &Observed,
        estimate: &Estimate,
        frames: &Range<usize>,
        knots: Option<&Range<usize>>,
        Linearized { placed, .. }: &Linearized,
        trust: &Trust,
        noise: &MarkerNoise,
    ) -> Normal {
        let residuals = self.residuals(observed, estimate, frames.clone(), placed);
        let n = knots.map_or(0, |knots| self.layout.n(knots.len()));
        let reach = knots.map(|knots| self.reach(observed, frames, knots));
        let add_marker = |sum: &mut Normal, k: usize| {
            let weight = markers.markers()[k].weight.sqrt() / noise.size;
            let seen: Vec<usize> = (0..frames.len()).filter(|i| residuals[*i][k].is_some()).collect();
            let at = |i: &usize| (observed.times[frames.start + i], trust[frames.start + i][k]);
            let (steps, log) = whitening(noise, seen.iter().map(at));
            let d = self.layout.dimension();
            sum.n_measured += d * seen.len();
            sum.log_determinant += (log - seen.len() as f64 * markers.markers()[k].weight.ln()) * d as f64;
            let mut white = vec![0.0; d * seen.len()];
            for axis in 0..d {
                let mut mean = 0.0;
                for (j, (i, step)) in seen.iter().zip(&steps).enumerate() {
                    let residual = residuals[*i][k].map_or(0.0, |r| r[axis]);
                    mean *= step.decay;
                    white[j * d + axis] = (residual - mean) * step.factor * weight;
                    mean += step.gain * (residual - mean);
                }
            }
            sum.squares += white.iter().map(|x| x * x).sum::<f64>();
            if let (Some(knots), Some(reach)) = (knots, &reach) {
                let ranges = remembered(&seen, &steps, reach);
                let mut means = vec![vec![0.0; n]; d];
                for first in (0..seen.len()).step_by(CHUNK) {
                    let chunk = first..(first + CHUNK).min(seen.len());
                    let range = chunk.clone().fold(ranges[first].clone(), |all, j| {
                        all.start.min(ranges[j].start)..all.end.max(ranges[j].end)
                    });
                    let head = self.layout.coefficients();
                    let columns = head + range.start * self.layout.n_channels
                        ..head + range.end * self.layout.n_channels;
                    let mut rows = DMatrix::zeros(head + columns.len(), chunk.len() * d);
                    for j in chunk.clone() {
                        let (i, step) = (seen[j], &steps[j]);
                        for (axis, mean) in means.iter_mut().enumerate() {
                            let mut out = rows.column_mut((j - first) * d + axis);
                            let out = out.as_mut_slice();
                            self.row(
                                observed,
                                estimate,
                                frames.start + i,
                                k,
                                axis,
                                &placed[i],
                                knots,
                                &range,
                                out,
                            );
                            step.whiten(weight, &mut mean[..head], &mut out[..head]);
                            step.whiten(weight, &mut mean[columns.clone()], &mut out[head..]);
                        }
                    }
                    means.iter_mut().for_each(|mean| mean[head..columns.start].fill(0.0));
                    sum.add(&rows, head, &columns, &white[chunk.start * d..chunk.end * d]);
                }
            }
        };
        let numbers: Vec<usize> = (0..markers.markers().len()).collect();
        let of_group = |group: &[usize]| {
            let mut sum = Normal::zero(n);
            group.iter().for_each(|k| add_marker(&mut sum, *k));
            sum
        };
        let parts: Vec<Normal> = numbers.par_chunks(GROUP).map(of_group).collect();
        // in the order of the markers, whatever the threads did
        parts.into_iter().fold(Normal::zero(n), |mut sum, part| {
            sum.matrix += part.matrix;
            sum.gradient.iter_mut().zip(&part.gradient).for_each(|(sum, x)| *sum += x);
            sum.squares += part.squares;
            sum.log_determinant += part.log_determinant;
            sum.n_measured += part.n_measured;
            sum
        })
    }

    /// For each frame the knots, counted from the first of `knots`, on which its markers depend: those between it and the reference.
    fn reach(&self, observed: &Observed, frames: &Range<usize>, knots: &Range<usize>) -> Vec<Range<usize>> {
        let first = |i: usize| self.splines.acting(observed.times[i], 0).first;
        let reference = first(observed.reference);
        let of = |i: usize| {
            let (low, high) = (first(i).min(reference), first(i).max(reference) + ACTIVE);
            low.saturating_sub(knots.start)..high.min(knots.end) - knots.start
        };
        frames.clone().map(of).collect()
    }

    /// The derivatives of one coordinate of a marker in frame `i`: by the unknowns before the coefficients, and by those of the knots
    /// `range`, counted from the first of `knots`.
    fn row(
        &self,
        observed: &Observed,
        estimate: &Estimate,
        i: usize,
        marker: usize,
        axis: usize,
        placed: &Placed,
        knots: &Range<usize>,
        range: &Range<usize>,
        out: &mut [f64],
    ) {
        let layout = self.layout;
        let time = observed.times[i];
        let t = time - observed.times[observed.reference];
        let (along, arm) = (layout.axes[axis], placed.arms[marker]);
        let (head, n) = (layout.coefficients(), layout.n_channels);
        // −s hat(arm) R by displacements in axes of the root
        let by_turn = placed.turn.tr_mul(&(hat(&arm) * along)) * estimate.scale;
        if let Some(by) = &placed.by_unknowns {
            let (of_head, of_knots) = out.split_at_mut(head);
            for (out, first) in [(of_head, 0), (of_knots, head + range.start * n)] {
                let [x, y, z] = [0, 1, 2].map(|c| &by.as_slice()[c * by.nrows() + first..][..out.len()]);
                for (out, ((x, y), z)) in out.iter_mut().zip(x.iter().zip(y).zip(z)) {
                    *out = by_turn.x * x + by_turn.y * y + by_turn.z * z;
                }
            }
        }
        out[layout.center().start + axis] += 1.0;
        out[layout.velocity().start + axis] += t;
        if let Some(k) = layout.scale() {
            out[k] += along.dot(&arm);
        }
        if let Some(k) = layout.gravity() {
            out[k] += along.dot(self.model.gravity()) * (0.5 * t * t);
        }
        for (number, _, center) in layout.departing() {
            let [_, factor] = departure::function(self.splines, number, time);
            out[center.start + axis] += factor;
        }
        if let Some(k) = layout.air() {
            let gravity = self.model.gravity() * estimate.gravity;
            out[k] += along.dot(&departure::air(&estimate.velocity, &gravity, t));
        }
        let place = layout.places().skip(3 * marker).take(3);
        for (k, column) in place.zip(placed.axes[marker].column_iter()) {
            out[k] += along.dot(&column) * estimate.scale;
        }
        let acting = self.splines.acting(time, 0);
        let of_marker = &placed.by_channel[marker * n..(marker + 1) * n];
        for k in 0..ACTIVE {
            let knot = (acting.first + k).checked_sub(knots.start + range.start);
            let Some(knot) = knot.filter(|k| *k < range.len()) else { continue };
            let factor = acting.factors[k] * estimate.scale;
            let first = head + knot * n;
            for (x, by) in out[first..first + n].iter_mut().zip(of_marker) {
                *x += along.dot(by) * factor;
            }
        }
    }
}

impl Normal {
    fn zero(n: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(n, n),
            gradient: vec![0.0; n],
            squares: 0.0,
            log_determinant: 0.0,
            n_measured: 0,
        }
    }

    /// Adds the products of `rows`, a column for each residual, with themselves and with the residuals `white`: of the first `head`
    /// unknowns and of those in `columns`.
    fn add(&mut self, rows: &DMatrix<f64>, head: usize, columns: &Range<usize>, white: &[f64]) {
        let width = columns.len();
        let of_head = rows.rows(0, head).into_owned();
        let of_knots = rows.rows(head, width).into_owned();
        add_square(self.matrix.view_range_mut(..head, ..head), 1.0, &of_head);
        self.matrix.view_range_mut(columns.clone(), ..head).gemm(1.0, &of_knots, &of_head.transpose(), 1.0);
        add_square(self.matrix.view_range_mut(columns.clone(), columns.clone()), 1.0, &of_knots);
        for (column, x) in rows.column_iter().zip(white) {
            for i in 0..head {
                self.gradient[i] += column[i] * x;
            }
            for i in 0..width {
                self.gradient[columns.start + i] += column[head + i] * x;
            }
        }
    }
}

/// For each frame that has a marker the knots on which what the filter makes of it depends: those of the frame, and of frames before
/// that it remembers.
fn remembered(seen: &[usize], steps: &[Whitening], reach: &[Range<usize>]) -> Vec<Range<usize>> {
    let mut earliest = 0;
    // what is left at each frame of those before: products of decay and of what is not corrected
    let mut left: Vec<f64> = vec![0.0; seen.len()];
    let mut found: Vec<Range<usize>> = Vec::with_capacity(seen.len());
    for (j, step) in steps.iter().enumerate() {
        left[earliest..j].iter_mut().for_each(|x| *x *= step.decay);
        while earliest < j && left[earliest] < FORGOTTEN {
            earliest += 1;
        }
        let own = &reach[seen[j]];
        let all = seen[earliest..j]
            .iter()
            .fold(own.clone(), |all, i| all.start.min(reach[*i].start)..all.end.max(reach[*i].end));
        found.push(all);
        left[earliest..j].iter_mut().for_each(|x| *x *= 1.0 - step.gain);
        left[j] = step.gain;
    }
    found
}

impl Layout {
    /// A vector by its coordinates that count.
    pub(super) fn within(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        let mut found = Vector3::zeros();
        for (k, axis) in self.axes.iter().enumerate() {
            found[k] = axis.dot(vector);
        }
        found
    }
}
