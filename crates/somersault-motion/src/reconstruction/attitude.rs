//! The orientation of the root at all frames, from that at one of them, and its derivatives by all unknowns.
//!
//! Ṙ = R ω̂ with ω = I(q)⁻¹ (Rᵀ L − A(q) q̇) is integrated from the reference frame outwards, forwards and backwards, in the steps
//! of [`somersault_multibody::flight::step`], whose derivatives are exact.

use super::ReconstructionError;
use super::departure;
use super::joints::{ACTIVE, Channels, JointSplines};
use super::unknowns::{Estimate, Layout};
use nalgebra::{Matrix3, Matrix3xX, UnitQuaternion, Vector3};
use somersault_core::lie::so3;
use somersault_multibody::flight::step::{NODES, STAGES, StageRate, StepDerivative, turn};
use somersault_multibody::flight::{Flight, FlightData, TakeOff};
use somersault_multibody::{DynamicsError, Model};

/// The longest step, s: 0.08 rad at 15 rad/s.
const LONGEST_STEP: f64 = 0.0051;

/// The orientation of the root at a frame.
#[derive(Debug, Clone)]
pub(super) struct Attitude {
    /// In the joint frame of the root.
    pub(super) orientation: UnitQuaternion<f64>,
    /// Displacement in axes of the root by the unknowns, 3 × n, if it was requested.
    pub(super) by_unknowns: Option<Matrix3xX<f64>>,
}

/// ω at one time and its derivatives.
#[derive(Debug, Clone)]
pub(super) struct Rate {
    pub(super) angular_velocity: Vector3<f64>,
    pub(super) by_orientation: Matrix3<f64>,
    pub(super) by_momentum: Matrix3<f64>,
    pub(super) by_channel: Vec<Vector3<f64>>,
    pub(super) by_channel_rate: Vec<Vector3<f64>>,
}

/// Room for the evaluations of a model.
pub(super) struct Room {
    data: FlightData,
    pub(super) q: Vec<f64>,
    pub(super) v: Vec<f64>,
    pub(super) channels: Channels,
    rates: Vec<Rate>,
}

impl Room {
    pub(super) fn new(model: &Model, splines: &JointSplines) -> Self {
        let none = vec![Vector3::zeros(); splines.n_channels()];
        let rate = Rate {
            angular_velocity: Vector3::zeros(),
            by_orientation: Matrix3::zeros(),
            by_momentum: Matrix3::zeros(),
            by_channel: none.clone(),
            by_channel_rate: none,
        };
        Self {
            data: FlightData::new(model),
            q: model.neutral(),
            v: vec![0.0; model.n_velocities()],
            channels: splines.channels(),
            rates: vec![rate; STAGES],
        }
    }
}

/// A flight whose joints follow splines.
pub(super) struct Flown<'a> {
    pub(super) model: &'a Model,
    pub(super) splines: &'a JointSplines,
    pub(super) layout: &'a Layout,
}

/// The flight at scale 1 that turns as `estimate` does.
pub(super) fn flight_of<'m>(
    model: &'m Model,
    time: f64,
    estimate: &Estimate,
) -> Result<Flight<'m>, ReconstructionError> {
    let Estimate { center, velocity, momentum, .. } = estimate;
    let take_off =
        TakeOff { time, center_of_mass: *center, velocity: *velocity, angular_momentum: *momentum };
    Ok(Flight::try_new(model, take_off)?)
}

/// Writes an orientation of the root into a configuration.
pub(super) fn write_orientation(is_planar: bool, orientation: &UnitQuaternion<f64>, q: &mut [f64]) {
    if is_planar {
        q[2] = 2.0 * orientation.k.atan2(orientation.w);
    } else {
        q[3..7].copy_from_slice(orientation.coords.as_slice());
    }
}

/// The orientation of the root of a configuration.
pub(super) fn read_orientation(is_planar: bool, q: &[f64]) -> UnitQuaternion<f64> {
    if is_planar { so3::exp(&(Vector3::z() * q[2])) } else { so3::normalized_xyzw(&q[3..7]) }
}

impl Flown<'_> {
    /// Configuration and velocity of joints and orientation of the root at `t` into `room`.
    pub(super) fn pose(
        &self,
        estimate: &Estimate,
        t: f64,
        orientation: &UnitQuaternion<f64>,
        room: &mut Room,
    ) {
        let root = (self.model.positions_of(0).len(), self.model.velocities_of(0).len());
        let Room { q, v, channels, .. } = room;
        self.splines.evaluate(&estimate.coefficients, t, channels, &mut q[root.0..], &mut v[root.1..]);
        write_orientation(self.layout.is_planar, orientation, q);
    }

    /// ω with its derivatives at `t`, kept as stage `i`.
    pub(super) fn rate<'r>(
        &self,
        flight: &Flight<'_>,
        estimate: &Estimate,
        t: f64,
        orientation: &UnitQuaternion<f64>,
        room: &'r mut Room,
        i: usize,
    ) -> Result<&'r Rate, DynamicsError> {
        self.pose(estimate, t, orientation, room);
        let Room { data, q, v, .. } = &mut *room;
        flight.set_shape(data, q, v)?;
        flight.set_directions(data);
        Ok(self.rate_of_shape(flight, room, i))
    }

    /// The same of the shape that was set last, in the orientation that the configuration has.
    fn rate_of_shape<'r>(&self, flight: &Flight<'_>, room: &'r mut Room, i: usize) -> &'r Rate {
        let Room { data, q, channels, rates, .. } = room;
        let found = flight.derivatives_of_shape(data, q);
        let rate = &mut rates[i];
        rate.angular_velocity = found.angular_velocity;
        rate.by_orientation = found.by_orientation;
        rate.by_momentum = found.by_angular_momentum;
        rate.by_channel.copy_from_slice(found.by_shape);
        rate.by_channel_rate.copy_from_slice(found.by_shape_velocity);
        self.splines.by_channels(channels, &mut rate.by_channel, &mut rate.by_channel_rate);
        rate
    }

    /// The orientations at `times`, of which number `reference` has that of the estimate, and their derivatives where they are wanted, by the
    /// coefficients of `knots` beside all other unknowns.
    pub(super) fn attitudes(
        &self,
        estimate: &Estimate,
        times: &[f64],
        reference: usize,
        knots: Option<&std::ops::Range<usize>>,
        room: &mut Room,
    ) -> Result<Vec<Attitude>, ReconstructionError> {
        let flight = flight_of(self.model, times[reference], estimate)?;
        let mut first = Attitude { orientation: estimate.orientation, by_unknowns: None };
        if let Some(knots) = knots {
            let mut by = Matrix3xX::zeros(self.layout.n(knots.len()));
            for k in self.layout.orientation() {
                by.set_column(k, &self.layout.displacement(k));
            }
            first.by_unknowns = Some(by);
        }
        let mut attitudes = vec![first.clone(); times.len()];
        for outwards in [1_i64, -1] {
            let mut current = first.clone();
            let mut i = reference;
            while let Some(next) = i.checked_add_signed(outwards as isize).filter(|next| *next < times.len())
            {
                let (from, to) = (times[i], times[next]);
                let n_steps = ((to - from).abs() / LONGEST_STEP).ceil().max(1.0) as usize;
                let h = (to - from) / n_steps as f64;
                for step in 0..n_steps {
                    self.step(&flight, estimate, from + h * step as f64, h, &mut current, knots, room)?;
                }
                attitudes[next] = current.clone();
                i = next;
            }
        }
        Ok(attitudes)
    }

    /// One step from `t`.
    fn step(
        &self,
        flight: &Flight<'_>,
        estimate: &Estimate,
        t: f64,
        h: f64,
        current: &mut Attitude,
        knots: Option<&std::ops::Range<usize>>,
        room: &mut Room,
    ) -> Result<(), ReconstructionError> {
        let mut derivative = StepDerivative::zero();
        let stage = |i: usize, orientation: &UnitQuaternion<f64>| {
            // The two stages in the middle have one shape.
            if i > 0 && NODES[i] == NODES[i - 1] {
                write_orientation(self.layout.is_planar, orientation, &mut room.q);
            } else {
                self.pose(estimate, t + h * NODES[i], orientation, room);
                flight.set_shape(&mut room.data, &room.q, &room.v)?;
                if knots.is_some() {
                    flight.set_directions(&mut room.data);
                }
            }
            if knots.is_none() {
                let angular_velocity = flight.angular_velocity_of_shape(&room.data, &room.q);
                return Ok::<_, DynamicsError>(StageRate {
                    angular_velocity,
                    by_orientation: Matrix3::zeros(),
                });
            }
            let Rate { angular_velocity, by_orientation, .. } = *self.rate_of_shape(flight, room, i);
            Ok(StageRate { angular_velocity, by_orientation })
        };
        current.orientation =
            turn(&current.orientation, h, stage, knots.is_some().then_some(&mut derivative))?;
        let (Some(knots), Some(by)) = (knots, &mut current.by_unknowns) else { return Ok(()) };
        for mut column in by.column_iter_mut() {
            let moved = derivative.by_start * &column;
            column.copy_from(&moved);
        }
        for (i, (by_stage, rate)) in derivative.by_stage.iter().zip(&room.rates).enumerate() {
            let at = t + h * NODES[i];
            for (k, turn) in self.layout.momentum().zip(&self.layout.turns) {
                let mut column = by.column_mut(k);
                column += by_stage * (rate.by_momentum * turn);
            }
            for (number, momentum, _) in self.layout.departing() {
                let [factor, _] = departure::function(self.splines, number, at);
                for (k, turn) in momentum.zip(&self.layout.turns) {
                    let mut column = by.column_mut(k);
                    column += by_stage * (rate.by_momentum * turn) * factor;
                }
            }
            self.add_channels(by, by_stage, rate, at, knots);
        }
        Ok(())
    }

    /// Adds `factor` times the derivatives of ω at `t` by the coefficients to those of `by`.
    pub(super) fn add_channels(
        &self,
        by: &mut Matrix3xX<f64>,
        factor: &Matrix3<f64>,
        rate: &Rate,
        t: f64,
        knots: &std::ops::Range<usize>,
    ) {
        let (value, slope) = (self.splines.acting(t, 0), self.splines.acting(t, 1));
        let n = self.layout.n_channels;
        for c in 0..n {
            let (of_value, of_rate) = (factor * rate.by_channel[c], factor * rate.by_channel_rate[c]);
            for k in 0..ACTIVE {
                let Some(knot) = (value.first + k).checked_sub(knots.start).filter(|k| *k < knots.len())
                else {
                    continue;
                };
                let mut column = by.column_mut(self.layout.coefficients() + knot * n + c);
                column += of_value * value.factors[k] + of_rate * slope.factors[k];
            }
        }
    }
}

/// The rotation of the root, its axes → world, of an orientation in its joint frame.
pub(super) fn turn_of(model: &Model, orientation: &UnitQuaternion<f64>) -> Matrix3<f64> {
    let placement = model.placement(0).map_or(Matrix3::identity(), |placement| placement.rotation);
    placement * so3::renormalize(orientation).to_rotation_matrix().into_inner()
}
