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
use somersault_multibody::flight::step::{SIMPSON, STAGES, StageRate, StepDerivative, turn};
use somersault_multibody::flight::{Flight, FlightData, FlightError, TakeOff};
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
    /// First active coefficient of each step.
    first: Vec<usize>,
    /// Basis functions and their derivatives at start, middle and end of each step.
    basis: Vec<[[f64; MAX_DEGREE + 1]; 2]>,
    /// In space.
    orientations: Vec<UnitQuaternion<f64>>,
    /// In the plane, counting whole turns.
    angles: Vec<f64>,
    coefficients: Vec<f64>,
    turn_momentum: Vector3<f64>,
    is_derived: bool,
    restart: Option<Restart>,
    derivatives: Vec<StepDerivative>,
    /// ∂ω by channels, by their rates and by T L in each stage of each step.
    by_channel: Vec<Vector3<f64>>,
    by_rate: Vec<Vector3<f64>>,
    by_momentum: Vec<Matrix3<f64>>,
    room: Room,
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

/// Room for one evaluation.
#[derive(Debug, Clone)]
struct Room {
    data: FlightData,
    q: Vec<f64>,
    v: Vec<f64>,
    channels: [Vec<f64>; 2],
}

/// Samples of the basis in a step.
const SAMPLES: usize = 3;
/// The sample that each stage is at.
const SAMPLE_OF: [usize; STAGES] = [0, 1, 1, 2];

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
        let (first, basis) = sample_basis(&motion, per_interval);
        let n_channels = motion.n_channels();
        let by_channel = vec![Vector3::zeros(); n_steps * STAGES * n_channels];
        let q = model.neutral();
        let room = Room {
            data: FlightData::new(&model),
            v: vec![0.0; model.n_velocities()],
            channels: [vec![0.0; n_channels], vec![0.0; n_channels]],
            q,
        };
        Ok(Self {
            is_planar,
            n_steps,
            first,
            basis,
            orientations: vec![UnitQuaternion::identity(); n_steps + 1],
            angles: vec![0.0; n_steps + 1],
            coefficients: vec![0.0; motion.n_coefficients()],
            turn_momentum: Vector3::zeros(),
            is_derived: false,
            restart: None,
            derivatives: vec![StepDerivative::zero(); n_steps],
            by_rate: by_channel.clone(),
            by_channel,
            by_momentum: vec![Matrix3::zeros(); n_steps * STAGES],
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

    /// Channels in a step, or their rates, for basis functions or their slopes.
    fn combine(&self, step: usize, values: &[f64], out: &mut [f64]) {
        let basis = self.motion.basis();
        let values = &values[..basis.n_active()];
        combine(&self.coefficients, basis.n_coefficients(), self.first[step], values, out);
    }

    fn run(&mut self, take_off: TakeOff, with_derivatives: bool) -> Result<(), FlightError> {
        let flight = Flight::try_new(&self.model, take_off)?;
        let (n, n_active) = (self.motion.basis().n_coefficients(), self.motion.basis().n_active());
        let n_channels = self.motion.n_channels();
        let base = self.motion.base();
        let n_root = self.model.velocities_of(0).len();
        let Room { data, q, v, channels: [channel, rate] } = &mut self.room;
        let q_root = q.len() - base.n_joints();
        let (by_channel, by_rate) = (&mut self.by_channel, &mut self.by_rate);
        let (by_momentum, coefficients) = (&mut self.by_momentum, &self.coefficients);
        let h = 1.0 / self.n_steps as f64;
        // The shape of the two stages in the middle is one, and that at the end of a step mostly that at the start of the next.
        let mut shape = None;
        for step in 0..self.n_steps {
            let (first, samples) = (self.first[step], &self.basis[step * SAMPLES..][..SAMPLES]);
            let mut evaluate =
                |stage: usize, q: &mut [f64], v: &mut [f64]| -> Result<StageRate, DynamicsError> {
                    let sample @ [values, slopes] = &samples[SAMPLE_OF[stage]];
                    if shape != Some((first, *sample)) {
                        combine(coefficients, n, first, &values[..n_active], channel);
                        combine(coefficients, n, first, &slopes[..n_active], rate);
                        base.positions_into(channel, &mut q[q_root..]);
                        base.rates_into(rate, &mut v[n_root..]);
                        flight.set_shape(data, q, v)?;
                        if with_derivatives {
                            flight.set_directions(data);
                        }
                        shape = Some((first, *sample));
                    }
                    if !with_derivatives {
                        let angular_velocity = flight.angular_velocity_of_shape(data, q);
                        return Ok(StageRate { angular_velocity, by_orientation: Matrix3::zeros() });
                    }
                    let found = flight.derivatives_of_shape(data, q);
                    let at = step * STAGES + stage;
                    by_momentum[at] = found.by_angular_momentum;
                    for (k, direction) in base.directions().column_iter().enumerate() {
                        let along = |columns: &[Vector3<f64>]| {
                            columns.iter().zip(direction.iter()).map(|(c, d)| c * *d).sum::<Vector3<f64>>()
                        };
                        by_channel[at * n_channels + k] = along(found.by_shape);
                        by_rate[at * n_channels + k] = along(found.by_shape_velocity);
                    }
                    Ok(StageRate {
                        angular_velocity: found.angular_velocity,
                        by_orientation: found.by_orientation,
                    })
                };
            let derivative = &mut self.derivatives[step];
            if self.is_planar {
                let mut turned = 0.0;
                for stage in (0..STAGES).filter(|stage| SIMPSON[*stage] > 0.0) {
                    q[2] = self.angles[step];
                    turned += SIMPSON[stage] * evaluate(stage, q, v)?.angular_velocity.z;
                }
                self.angles[step + 1] = self.angles[step] + h * turned;
                *derivative = StepDerivative::simpson(h);
            } else {
                let evaluate = |stage: usize, r: &UnitQuaternion<f64>| {
                    q[3..7].copy_from_slice(r.coords.as_slice());
                    evaluate(stage, q, v)
                };
                let derivative = with_derivatives.then_some(derivative);
                self.orientations[step + 1] = turn(&self.orientations[step], h, evaluate, derivative)?;
                if let Some(restart) = self.restart.as_mut().filter(|r| r.node == step + 1) {
                    restart.pass(&mut self.orientations[step + 1]);
                }
            }
        }
        Ok(())
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

/// Splines of `n` coefficients where their basis functions from `first` on are `values`.
fn combine(coefficients: &[f64], n: usize, first: usize, values: &[f64], out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(coefficients.chunks_exact(n)) {
        *out = row[first..].iter().zip(values).map(|(c, b)| c * b).sum();
    }
}

/// Basis functions and slopes at the samples of each step, by the coefficients of the step's interval.
fn sample_basis(motion: &SplineMotion, per_interval: usize) -> (Vec<usize>, Vec<[[f64; MAX_DEGREE + 1]; 2]>) {
    let basis = motion.basis();
    let n_steps = per_interval * basis.n_intervals();
    let mut first = Vec::with_capacity(n_steps);
    let mut samples = Vec::with_capacity(n_steps * SAMPLES);
    for step in 0..n_steps {
        let interval = step / per_interval;
        first.push(interval);
        for sample in 0..SAMPLES {
            let fraction = (2 * step + sample) as f64 / (2 * n_steps) as f64;
            samples.push([0, 1].map(|derivative| {
                let mut values = [0.0; MAX_DEGREE + 1];
                let found = basis.evaluate(fraction, derivative, &mut values);
                // the end of a step on a knot belongs to the next interval, whose last function is zero there
                values.rotate_right(found - interval);
                values
            }));
        }
    }
    (first, samples)
}
