//! The orientation of the root along a flight, and its derivatives.

mod curvature;
mod derivatives;

pub(crate) use curvature::{COEFFICIENTS, MOMENTUM, NodeExpansion, START};
pub use derivatives::{NodeDerivatives, PathGradient};

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::lie::so3::normalized_xyzw;
use somersault_core::spline::MAX_DEGREE;
use somersault_multibody::counting::Counting;
use somersault_multibody::flight::step::{SHAPE_OF, SIMPSON, STAGES, StageRate, StepDerivative};
use somersault_multibody::flight::{Flight, FlightDerivatives, FlightError, FlightShapes, TakeOff};
use somersault_multibody::joint_motion::SplineMotion;
use somersault_multibody::{DynamicsError, Group, Joint, Model};

/// Orientations of the root at the nodes of a flight whose joints follow a [`SplineMotion`].
///
/// By the fraction x of the duration T the equation of motion is dR/dx = R (T ω)^ with
/// T ω = I(s)⁻¹ (Rᵀ T L − A(s) s′): duration and angular momentum matter by their product alone, the *turn momentum*
/// T L, and the rates are those by the fraction. In the plane all vectors count by their component along the normal, z
/// of the root's joint frame.
///
/// Steps do not cross knots, so each depends on the coefficients of one interval. Order 4 in the length of the steps.
#[derive(Debug, Clone)]
pub struct OrientationPath {
    model: Model,
    motion: SplineMotion,
    is_planar: bool,
    n_steps: usize,
    /// Steps between two knots.
    per_interval: usize,
    /// Basis functions and their derivatives at the samples: start, middle and end of each step, the end of a step being the start of the
    /// next where there is no knot.
    basis: Vec<Sample>,
    /// Joints that each channel moves, and how.
    moved: Vec<Vec<(usize, f64)>>,
    /// In space.
    orientations: Vec<UnitQuaternion<f64>>,
    /// In the plane, counting whole turns.
    angles: Vec<f64>,
    coefficients: Vec<f64>,
    turn_momentum: Vector3<f64>,
    is_derived: bool,
    restart: Option<Restart>,
    derivatives: Vec<StepDerivative>,
    stages: Stages,
    room: Room,
}

/// What is known of each stage of each step after a run with derivatives.
#[derive(Debug, Clone)]
struct Stages {
    rates: Vec<StageRate>,
    /// ∂ω by channels, by their rates and by T L.
    by_channel: Vec<Vector3<f64>>,
    by_rate: Vec<Vector3<f64>>,
    by_momentum: Vec<Matrix3<f64>>,
}

/// Where the orientation is straightened.
#[derive(Debug, Clone)]
struct Restart {
    node: usize,
    counting: Counting,
    /// Twist past it, rad.
    twist: f64,
    before: UnitQuaternion<f64>,
    /// Displacement after by displacement before.
    derivative: Matrix3<f64>,
}

/// Steps between two knots whose shapes are set together, at most.
const TOGETHER: usize = 32;

/// Room for some steps between two knots.
#[derive(Debug, Clone)]
struct Room {
    shapes: FlightShapes,
    /// Positions and velocities of the joints at the samples.
    q: Vec<f64>,
    v: Vec<f64>,
    channels: Vec<f64>,
}

/// Basis functions and their derivatives.
type Sample = [[f64; MAX_DEGREE + 1]; 2];

impl OrientationPath {
    /// The path of `model` with `n_steps` steps, at least one, rounded up to a multiple of the intervals of the spline.
    ///
    /// The channels of `motion` are all joints but the root's: none but hinges and slides, whose positions are
    /// numbers like their velocities.
    pub fn try_new(model: Model, motion: SplineMotion, n_steps: usize) -> Result<Self, FlightError> {
        Flight::try_new(&model, AT_REST)?;
        let is_planar = model.joint(0).map(Joint::group) == Some(Group::PlanarMotions);
        let n_joints = model.n_velocities() - model.velocities_of(0).len();
        expect_length("joints of motion", motion.base().n_joints(), n_joints).map_err(DynamicsError::from)?;
        let n_positions = model.n_positions() - model.positions_of(0).len();
        expect_length("positions of the joints", n_positions, n_joints).map_err(DynamicsError::from)?;
        let n_intervals = motion.basis().n_intervals();
        let per_interval = n_steps.div_ceil(n_intervals).max(1);
        let n_steps = per_interval * n_intervals;
        let n_channels = motion.n_channels();
        let zero = Vector3::zeros();
        let by_channel = vec![zero; n_steps * STAGES * n_channels];
        let joints = vec![0.0; samples_of(per_interval.min(TOGETHER)) * n_joints];
        let room = Room {
            shapes: FlightShapes::default(),
            q: joints.clone(),
            v: joints,
            channels: vec![0.0; n_channels],
        };
        let moves = |column: nalgebra::DVectorView<f64>| {
            column.iter().copied().enumerate().filter(|(_, along)| *along != 0.0).collect()
        };
        Ok(Self {
            is_planar,
            n_steps,
            per_interval,
            basis: sample_basis(&motion, per_interval),
            moved: motion.base().directions().column_iter().map(moves).collect(),
            orientations: vec![UnitQuaternion::identity(); n_steps + 1],
            angles: vec![0.0; n_steps + 1],
            coefficients: vec![0.0; motion.n_coefficients()],
            turn_momentum: zero,
            is_derived: false,
            restart: None,
            derivatives: vec![StepDerivative::zero(); n_steps],
            stages: Stages {
                rates: vec![
                    StageRate { angular_velocity: zero, by_orientation: Matrix3::zeros() };
                    n_steps * STAGES
                ],
                by_rate: by_channel.clone(),
                by_channel,
                by_momentum: vec![Matrix3::zeros(); n_steps * STAGES],
            },
            room,
            model,
            motion,
        })
    }

    /// Continues from `node`, in space, with the orientation [straightened](Counting::straightened) to this twist, rad:
    /// multiple shooting in which the defects there are the tilt, and the difference of the twist from this one. A program
    /// that constrains them to vanish has a continuous path, and meanwhile what is left of them is not amplified by the rest of
    /// the flight.
    pub fn with_restart(mut self, node: usize, counting: Counting, twist: f64) -> Self {
        let before = UnitQuaternion::identity();
        self.restart = Some(Restart { node, counting, twist, before, derivative: Matrix3::identity() });
        self.is_derived = false;
        self
    }

    /// Refuses a number of coefficients that is not that of the splines.
    fn expect_coefficients(&self, argument: &'static str, found: usize) -> Result<(), FlightError> {
        Ok(expect_length(argument, found, self.coefficients.len()).map_err(DynamicsError::from)?)
    }

    /// The orientation with which the path arrives at a node, before a restart.
    pub(crate) fn arrival(&self, node: usize) -> &UnitQuaternion<f64> {
        match &self.restart {
            Some(restart) if restart.node == node => &restart.before,
            _ => &self.orientations[node],
        }
    }

    /// The tree.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The motion of its joints.
    pub fn motion(&self) -> &SplineMotion {
        &self.motion
    }

    /// Whether it moves in a plane.
    pub fn is_planar(&self) -> bool {
        self.is_planar
    }

    /// Number of steps; nodes are one more.
    pub fn n_steps(&self) -> usize {
        self.n_steps
    }

    /// Orientations at the nodes, root axes → its joint frame, in space.
    pub fn orientations(&self) -> &[UnitQuaternion<f64>] {
        &self.orientations
    }

    /// Angles at the nodes, rad, in the plane.
    pub fn angles(&self) -> &[f64] {
        &self.angles
    }

    /// Integrates from `orientation`, a quaternion x, y, z, w or an angle as in q, with the `turn_momentum` T L in
    /// world axes (kg m²) and the given coefficients of the splines. Allocates nothing.
    ///
    /// With derivatives, [`pull_back`](Self::pull_back) and [`node_derivatives`](Self::node_derivatives) are those of
    /// this run. What the last run had with derivatives is not integrated again.
    pub fn integrate(
        &mut self,
        coefficients: &[f64],
        orientation: &[f64],
        turn_momentum: Vector3<f64>,
        with_derivatives: bool,
    ) -> Result<(), FlightError> {
        let at = if self.is_planar { 2..3 } else { 3..7 };
        expect_length("orientation", orientation.len(), at.len()).map_err(DynamicsError::from)?;
        if !orientation.iter().chain(coefficients).all(|x| x.is_finite()) {
            return Err(FlightError::NonFinite { argument: "orientation and coefficients" });
        }
        let start = if self.is_planar { UnitQuaternion::identity() } else { normalized_xyzw(orientation) };
        let angle = if self.is_planar { orientation[0] } else { 0.0 };
        let is_known = self.is_derived
            && self.coefficients == coefficients
            && self.turn_momentum == turn_momentum
            && (self.orientations[0], self.angles[0]) == (start, angle);
        if is_known {
            return Ok(());
        }
        self.expect_coefficients("coefficients", coefficients.len())?;
        self.coefficients.copy_from_slice(coefficients);
        self.turn_momentum = turn_momentum;
        (self.orientations[0], self.angles[0]) = (start, angle);
        let take_off = TakeOff { angular_momentum: turn_momentum, ..AT_REST };
        self.is_derived = false;
        self.run(take_off, with_derivatives)?;
        self.is_derived = with_derivatives;
        Ok(())
    }

    /// Number of the sample at a stage.
    fn sample(&self, step: usize, stage: usize) -> usize {
        let interval = step / self.per_interval;
        interval * samples_of(self.per_interval) + 2 * (step % self.per_interval) + SHAPE_OF[stage]
    }

    /// First coefficient that acts at a step: the number of its interval between knots.
    fn first(&self, step: usize) -> usize {
        step / self.per_interval
    }

    fn run(&mut self, take_off: TakeOff, with_derivatives: bool) -> Result<(), FlightError> {
        let flight = Flight::try_new(&self.model, take_off)?;
        let Room { shapes, q, v, channels } = &mut self.room;
        let n_joints = self.motion.base().n_joints();
        let h = 1.0 / self.n_steps as f64;
        let n_samples = samples_of(self.per_interval);
        let starts = (0..self.n_steps).step_by(self.per_interval);
        for (interval, (start, samples)) in starts.zip(self.basis.chunks_exact(n_samples)).enumerate() {
            for before in (0..self.per_interval).step_by(TOGETHER) {
                let n_steps = TOGETHER.min(self.per_interval - before);
                let (first, samples) = (start + before, &samples[2 * before..][..samples_of(n_steps)]);
                for (k, sample) in samples.iter().enumerate() {
                    let (q, v) = (&mut q[k * n_joints..][..n_joints], &mut v[k * n_joints..][..n_joints]);
                    write_joints(&self.motion, &self.coefficients, interval, sample, channels, q, v);
                }
                let n = samples.len() * n_joints;
                flight.set_shapes(shapes, samples.len(), &q[..n], &v[..n], with_derivatives)?;
                for step in 0..n_steps {
                    let node = first + step;
                    let derivative = &mut self.derivatives[node];
                    if self.is_planar {
                        let turned = turned_in_plane(&flight, shapes, step)?;
                        self.angles[node + 1] = self.angles[node] + h * turned;
                        *derivative = StepDerivative::simpson(h);
                    } else {
                        let derivative = with_derivatives.then_some(derivative);
                        let from = &self.orientations[node];
                        self.orientations[node + 1] = flight.turn_step(shapes, step, from, h, derivative)?;
                        if let Some(restart) = self.restart.as_mut().filter(|r| r.node == node + 1) {
                            restart.pass(&mut self.orientations[node + 1]);
                        }
                    }
                }
                if with_derivatives {
                    flight.derivatives_of_steps(shapes, |[step, stage], found| {
                        self.stages.set((first + step) * STAGES + stage, &found, &self.moved);
                    })?;
                }
            }
        }
        Ok(())
    }
}

/// By how much a step turns a root in the plane, where ω does not depend on its angle, by the length of the step.
fn turned_in_plane(flight: &Flight<'_>, shapes: &FlightShapes, step: usize) -> Result<f64, DynamicsError> {
    let mut turned = 0.0;
    for (weight, shape) in SIMPSON.iter().zip(SHAPE_OF).filter(|(weight, _)| **weight > 0.0) {
        turned += weight * flight.rate_of_shape(shapes, 2 * step + shape, &[0.0])?.angular_velocity.z;
    }
    Ok(turned)
}

impl Stages {
    fn set(&mut self, at: usize, found: &FlightDerivatives<'_>, moved: &[Vec<(usize, f64)>]) {
        let FlightDerivatives { angular_velocity, by_orientation, .. } = *found;
        self.rates[at] = StageRate { angular_velocity, by_orientation };
        self.by_momentum[at] = found.by_angular_momentum;
        for (k, joints) in moved.iter().enumerate() {
            let along = |columns: &[Vector3<f64>]| {
                joints.iter().map(|(joint, d)| columns[*joint] * *d).sum::<Vector3<f64>>()
            };
            self.by_channel[at * moved.len() + k] = along(found.by_shape);
            self.by_rate[at * moved.len() + k] = along(found.by_shape_velocity);
        }
    }
}

impl Restart {
    fn pass(&mut self, orientation: &mut UnitQuaternion<f64>) {
        self.before = *orientation;
        *orientation = self.counting.straightened(&self.before, self.twist);
        let [somersault, ..] = self.counting.gradients(&self.before);
        self.derivative = self.lateral() * somersault.transpose();
    }

    /// The world's lateral axis past it, in axes of the root.
    fn lateral(&self) -> Vector3<f64> {
        self.counting.lateral(self.twist)
    }
}

const AT_REST: TakeOff = TakeOff {
    time: 0.0,
    center_of_mass: Vector3::new(0.0, 0.0, 0.0),
    velocity: Vector3::new(0.0, 0.0, 0.0),
    angular_momentum: Vector3::new(0.0, 0.0, 0.0),
};

/// Samples of steps one after the other.
fn samples_of(n_steps: usize) -> usize {
    2 * n_steps + 1
}

/// Positions and velocities of the joints at a sample of an interval between knots.
fn write_joints(
    motion: &SplineMotion,
    coefficients: &[f64],
    interval: usize,
    [values, slopes]: &Sample,
    channels: &mut [f64],
    q: &mut [f64],
    v: &mut [f64],
) {
    let (n, n_active) = (motion.basis().n_coefficients(), motion.basis().n_active());
    combine(coefficients, n, interval, &values[..n_active], channels);
    motion.base().positions_into(channels, q);
    combine(coefficients, n, interval, &slopes[..n_active], channels);
    motion.base().rates_into(channels, v);
}

/// Splines of `n` coefficients where their basis functions from `first` on are `values`.
fn combine(coefficients: &[f64], n: usize, first: usize, values: &[f64], out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(coefficients.chunks_exact(n)) {
        *out = row[first..].iter().zip(values).map(|(c, b)| c * b).sum();
    }
}

/// Basis functions and slopes at the samples of each interval, by its coefficients.
fn sample_basis(motion: &SplineMotion, per_interval: usize) -> Vec<Sample> {
    let basis = motion.basis();
    let n_halves = 2 * per_interval * basis.n_intervals();
    let mut samples = Vec::with_capacity(samples_of(per_interval) * basis.n_intervals());
    for interval in 0..basis.n_intervals() {
        for sample in 0..samples_of(per_interval) {
            let fraction = (2 * per_interval * interval + sample) as f64 / n_halves as f64;
            samples.push([0, 1].map(|derivative| {
                let mut values = [0.0; MAX_DEGREE + 1];
                let found = basis.evaluate(fraction, derivative, &mut values);
                // the last sample is on a knot and belongs to the next interval, whose last function is zero there
                values.rotate_right(found - interval);
                values
            }));
        }
    }
    samples
}
