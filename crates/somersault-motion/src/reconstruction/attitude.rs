//! The orientation of the root at all frames, from that at one of them, and its derivatives by all unknowns.
//!
//! Ṙ = R ω̂ with ω = I(q)⁻¹ (Rᵀ L − A(q) q̇) is integrated from the reference frame outwards, forwards and backwards, in the steps
//! of [`somersault_multibody::flight::step`], whose derivatives are exact. The shapes between two frames are set together.

use super::ReconstructionError;
use super::departure;
use super::joints::{ACTIVE, Channels, JointSplines};
use super::unknowns::{Estimate, Layout};
use nalgebra::{Matrix3, Matrix3xX, UnitQuaternion, Vector3};
use somersault_core::lie::so3;
use somersault_multibody::flight::step::{NODES, SHAPE_OF, STAGES, StepDerivative};
use somersault_multibody::flight::{Flight, FlightData, FlightDerivatives, FlightShapes, TakeOff};
use somersault_multibody::{DynamicsError, Model};

/// The longest step, s: 0.08 rad at 15 rad/s.
const LONGEST_STEP: f64 = 0.0051;
/// Steps whose shapes are set together.
const TOGETHER: usize = 16;

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

impl Rate {
    fn new(n_channels: usize) -> Self {
        let none = vec![Vector3::zeros(); n_channels];
        Self {
            angular_velocity: Vector3::zeros(),
            by_orientation: Matrix3::zeros(),
            by_momentum: Matrix3::zeros(),
            by_channel: none.clone(),
            by_channel_rate: none,
        }
    }

    /// Takes what was found with the channels as `at`.
    fn set(&mut self, splines: &JointSplines, at: &Channels, found: &FlightDerivatives<'_>) {
        self.angular_velocity = found.angular_velocity;
        self.by_orientation = found.by_orientation;
        self.by_momentum = found.by_angular_momentum;
        self.by_channel.copy_from_slice(found.by_shape);
        self.by_channel_rate.copy_from_slice(found.by_shape_velocity);
        splines.by_channels(at, &mut self.by_channel, &mut self.by_channel_rate);
    }
}

/// Room for the evaluations of a model.
pub(super) struct Room {
    data: FlightData,
    pub(super) q: Vec<f64>,
    pub(super) v: Vec<f64>,
    pub(super) channels: Channels,
    /// Between two frames: shapes, their channels, positions and velocities of the joints.
    shapes: FlightShapes,
    of_shapes: Vec<Channels>,
    joints: [Vec<f64>; 2],
    derivatives: Vec<StepDerivative>,
    /// Of each stage.
    rates: Vec<Rate>,
}

impl Room {
    pub(super) fn new(model: &Model, splines: &JointSplines) -> Self {
        Self {
            data: FlightData::new(model),
            q: model.neutral(),
            v: vec![0.0; model.n_velocities()],
            channels: splines.channels(),
            shapes: FlightShapes::default(),
            of_shapes: Vec::new(),
            joints: [Vec::new(), Vec::new()],
            derivatives: Vec::new(),
            rates: Vec::new(),
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
pub(crate) fn read_orientation(is_planar: bool, q: &[f64]) -> UnitQuaternion<f64> {
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

    /// ω with its derivatives at `t`.
    pub(super) fn rate(
        &self,
        flight: &Flight<'_>,
        estimate: &Estimate,
        t: f64,
        orientation: &UnitQuaternion<f64>,
        room: &mut Room,
    ) -> Result<Rate, DynamicsError> {
        self.pose(estimate, t, orientation, room);
        let Room { data, q, v, channels, .. } = room;
        let mut rate = Rate::new(self.splines.n_channels());
        rate.set(self.splines, channels, &flight.derivatives(data, q, v)?);
        Ok(rate)
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
                for first in (0..n_steps).step_by(TOGETHER) {
                    let steps = TOGETHER.min(n_steps - first);
                    let start = from + h * first as f64;
                    self.turn(&flight, estimate, start, h, steps, &mut current, knots, room)?;
                }
                attitudes[next] = current.clone();
                i = next;
            }
        }
        Ok(attitudes)
    }

    /// Some steps from `from`.
    fn turn(
        &self,
        flight: &Flight<'_>,
        estimate: &Estimate,
        from: f64,
        h: f64,
        n_steps: usize,
        current: &mut Attitude,
        knots: Option<&std::ops::Range<usize>>,
        room: &mut Room,
    ) -> Result<(), ReconstructionError> {
        let n_shapes = 2 * n_steps + 1;
        let Room { shapes, of_shapes, joints: [q, v], derivatives, rates, .. } = room;
        let n_q = self.model.n_positions() - self.model.positions_of(0).len();
        let n_v = self.model.n_velocities() - self.model.velocities_of(0).len();
        of_shapes.resize_with(n_shapes.max(of_shapes.len()), || self.splines.channels());
        q.resize(n_shapes * n_q, 0.0);
        v.resize(n_shapes * n_v, 0.0);
        let at = |shape: usize| from + h * (0.5 * shape as f64);
        for (shape, channels) in of_shapes[..n_shapes].iter_mut().enumerate() {
            let (q, v) = (&mut q[shape * n_q..][..n_q], &mut v[shape * n_v..][..n_v]);
            self.splines.evaluate(&estimate.coefficients, at(shape), channels, q, v);
        }
        flight.set_shapes(shapes, n_shapes, q, v, knots.is_some())?;
        derivatives.resize(n_steps, StepDerivative::zero());
        for (step, derivative) in derivatives.iter_mut().enumerate() {
            let derivative = knots.is_some().then_some(derivative);
            current.orientation = flight.turn_step(shapes, step, &current.orientation, h, derivative)?;
        }
        let (Some(knots), Some(by)) = (knots, &mut current.by_unknowns) else { return Ok(()) };
        rates.resize_with((n_steps * STAGES).max(rates.len()), || Rate::new(self.splines.n_channels()));
        flight.derivatives_of_steps(shapes, |[step, stage], found| {
            let channels = &of_shapes[2 * step + SHAPE_OF[stage]];
            rates[step * STAGES + stage].set(self.splines, channels, &found);
        })?;
        for (step, (derivative, rates)) in derivatives.iter().zip(rates.chunks_exact(STAGES)).enumerate() {
            self.carry(from + h * step as f64, h, derivative, rates, knots, by);
        }
        Ok(())
    }

    /// Derivatives by the unknowns over one step from `t`.
    fn carry(
        &self,
        t: f64,
        h: f64,
        derivative: &StepDerivative,
        rates: &[Rate],
        knots: &std::ops::Range<usize>,
        by: &mut Matrix3xX<f64>,
    ) {
        for mut column in by.column_iter_mut() {
            let moved = derivative.by_start * &column;
            column.copy_from(&moved);
        }
        for (i, (by_stage, rate)) in derivative.by_stage.iter().zip(rates).enumerate() {
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
