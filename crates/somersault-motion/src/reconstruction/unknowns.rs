//! What a reconstruction seeks, and where each unknown stands.

use super::departure::N_FUNCTIONS;
use super::joints::JointSplines;
use crate::frame_fits::axes_of;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::lie::so3;
use somersault_multibody::{Group, Joint, Model};
use std::ops::Range;

/// A flight: what determines all of it.
#[derive(Debug, Clone)]
pub(super) struct Estimate {
    /// Orientation of the root in its joint frame at the reference frame.
    pub(super) orientation: UnitQuaternion<f64>,
    /// L/s², world axes: the momentum of the body at scale 1 that turns alike.
    pub(super) momentum: Vector3<f64>,
    /// Centre of mass at the reference frame, and its velocity.
    pub(super) center: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
    /// s.
    pub(super) scale: f64,
    /// g over that of the model.
    pub(super) gravity: f64,
    pub(super) coefficients: Vec<f64>,
}

/// The places of the unknowns: displacement of the orientation in axes of the root, momentum, centre of mass and
/// velocity along `axes`, scale, gravity, departures from the laws of flight, drag of the air, places of markers on their bodies,
/// coefficients of the joints.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub(super) is_planar: bool,
    /// Columns in the world along which points count: all, or the two of the plane.
    pub(super) axes: Vec<Vector3<f64>>,
    /// Columns in the world along which the body turns: all, or the normal.
    pub(super) turns: Vec<Vector3<f64>>,
    pub(super) has_scale: bool,
    pub(super) has_gravity: bool,
    /// Functions of time by which momentum and centre of mass depart from the laws of flight: none in a search.
    n_departures: usize,
    /// Markers whose places are unknown, with the drag of the air: none in a search.
    n_markers: usize,
    pub(super) n_channels: usize,
}

impl Layout {
    pub(super) fn new(model: &Model, splines: &JointSplines, has_scale: bool, has_gravity: bool) -> Self {
        let is_planar = model.joint(0).map(Joint::group) == Some(Group::PlanarMotions);
        let axes = axes_of(model);
        let turns = if is_planar { vec![axes[0].cross(&axes[1])] } else { axes.clone() };
        let n_channels = splines.n_channels();
        Self { is_planar, axes, turns, has_scale, has_gravity, n_departures: 0, n_markers: 0, n_channels }
    }

    /// The same with departures by all functions of time, with a scale and gravity, with the drag of the air and the places of
    /// `n_markers` markers.
    pub(super) fn with_departures(&self, n_markers: usize) -> Self {
        Self { has_scale: true, has_gravity: true, n_departures: N_FUNCTIONS, n_markers, ..self.clone() }
    }

    /// Coordinates of a point that count.
    pub(super) fn dimension(&self) -> usize {
        self.axes.len()
    }

    /// In axes of the root, along which its orientation is displaced.
    pub(super) fn displacement(&self, k: usize) -> Vector3<f64> {
        if self.is_planar { Vector3::z() } else { Vector3::ith(k, 1.0) }
    }

    pub(super) fn orientation(&self) -> Range<usize> {
        0..self.turns.len()
    }

    pub(super) fn momentum(&self) -> Range<usize> {
        let n = self.turns.len();
        n..2 * n
    }

    pub(super) fn center(&self) -> Range<usize> {
        let first = self.momentum().end;
        first..first + self.axes.len()
    }

    pub(super) fn velocity(&self) -> Range<usize> {
        let first = self.center().end;
        first..first + self.axes.len()
    }

    pub(super) fn scale(&self) -> Option<usize> {
        self.has_scale.then(|| self.velocity().end)
    }

    pub(super) fn gravity(&self) -> Option<usize> {
        self.has_gravity.then(|| self.velocity().end + usize::from(self.has_scale))
    }

    /// The places of all departures.
    pub(super) fn departures(&self) -> Range<usize> {
        let first = self.velocity().end + usize::from(self.has_scale) + usize::from(self.has_gravity);
        first..first + self.n_departures * (self.turns.len() + self.axes.len())
    }

    /// The place of the drag of the air, where markers are displaced too.
    pub(super) fn air(&self) -> Option<usize> {
        (self.n_markers > 0).then(|| self.departures().end)
    }

    /// The places of the displacements of all markers, three for each, along the axes of their bodies.
    pub(super) fn places(&self) -> Range<usize> {
        let first = self.departures().end + usize::from(self.n_markers > 0);
        first..first + 3 * self.n_markers
    }

    /// For each function of time its number, and the places of the departures of momentum and centre of mass by it.
    pub(super) fn departing(&self) -> impl Iterator<Item = (usize, Range<usize>, Range<usize>)> + '_ {
        let (first, n, d) = (self.departures().start, self.turns.len(), self.axes.len());
        (0..self.n_departures).map(move |k| {
            let at = first + k * (n + d);
            (k, at..at + n, at + n..at + n + d)
        })
    }

    /// Where the coefficients begin.
    pub(super) fn coefficients(&self) -> usize {
        self.places().end
    }

    /// Number of unknowns with `n_knots` coefficients of each channel.
    pub(super) fn n(&self, n_knots: usize) -> usize {
        self.coefficients() + n_knots * self.n_channels
    }

    /// The estimate displaced by `step`, whose coefficients are those from the knot `first` on.
    pub(super) fn advance(&self, estimate: &Estimate, step: &[f64], first: usize) -> Estimate {
        let mut moved = estimate.clone();
        let sum = |range: Range<usize>, columns: &[Vector3<f64>]| {
            columns.iter().zip(&step[range]).fold(Vector3::zeros(), |sum, (column, x)| sum + column * *x)
        };
        let turn = self.orientation().fold(Vector3::zeros(), |sum, k| sum + self.displacement(k) * step[k]);
        moved.orientation = so3::renormalize(&(estimate.orientation * so3::exp(&turn)));
        moved.momentum += sum(self.momentum(), &self.turns);
        moved.center += sum(self.center(), &self.axes);
        moved.velocity += sum(self.velocity(), &self.axes);
        moved.scale += self.scale().map_or(0.0, |k| step[k]);
        moved.gravity += self.gravity().map_or(0.0, |k| step[k]);
        let coefficients = &step[self.coefficients()..];
        let at = first * self.n_channels;
        moved.coefficients[at..at + coefficients.len()]
            .iter_mut()
            .zip(coefficients)
            .for_each(|(c, x)| *c += x);
        moved
    }
}
