//! Reduced flight as a [`Transcription`]: whole states at nodes, momentum exact at each.
//!
//! Position and velocity of the root follow from orientation, shape, centre of mass and momentum, and so do their
//! derivatives: with J the Jacobian of the centre of mass, A the centroidal momentum matrix and h its momentum,
//!
//! ```text
//! J δq = δc,   A δv = δ(m ċ, L) − (∂h/∂q) δq
//! ```
//! are solved for the root's part of δq and δv.

use super::forces::Forces;
use super::response::{INPUTS, respond};
use super::{NodeDerivatives, OrientationPath, PathGradient};
use crate::error::{OcpError, expect_bounds, expect_room};
use crate::term::{Node, NodeGradient};
use crate::transcription::{
    NodeSizes, NodeTangent, Outline, RolloutGradient, RolloutSecondDerivatives, Transcription, Visit,
};
use nalgebra::{DMatrix, Matrix3, Vector3};
use somersault_core::argument::{expect_finite, expect_length, expect_positive};
use somersault_core::lie::so3;
use somersault_core::quadrature::simpson;
use somersault_core::spline::MAX_DEGREE;
use somersault_multibody::flight::{Flight, FlightData, TakeOff};
use somersault_multibody::joint_motion::SplineMotion;
use somersault_multibody::{DerivativeData, Model};
use somersault_nlp::{Bounds, EvaluationError};

/// Where a flight begins; what its [`FlightVariables`] free is displaced from here.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightStart {
    /// Orientation of the root as in q: a quaternion x, y, z, w, or an angle.
    pub orientation: Vec<f64>,
    /// Centre of mass, its velocity and the angular momentum; the time is that of the first node.
    pub take_off: TakeOff,
    /// T, s.
    pub duration: f64,
}

/// What of a flight is free beside the parameters of its joint motion; in z in this order.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FlightVariables {
    /// Three numbers, a rotation vector in axes of the root, or one in the plane, added to the start's.
    pub orientation: bool,
    /// Three numbers, world axes, kg m²/s, in place of those of the start.
    pub angular_momentum: bool,
    /// Three numbers, world axes, m, in place of those of the start.
    pub center_of_mass: bool,
    /// Three numbers, world axes, m/s, in place of those of the start.
    pub velocity: bool,
    /// One number between two bounds, s, in place of that of the start.
    pub duration: Option<[f64; 2]>,
}

/// A motion in flight.
///
/// Nodes are those of an [`OrientationPath`]; accelerations and joint forces they have
/// [if asked for](Self::with_joint_forces). Weights in integrals are those
/// of Simpson, the last three steps by his three-eighths rule where the number of steps is odd: order 4.
#[derive(Debug, Clone)]
pub struct FlightShooting {
    path: OrientationPath,
    start: FlightStart,
    outline: Outline,
    /// First variable of orientation, momentum, centre of mass, velocity and duration.
    at: [Option<usize>; 5],
    quadrature: Vec<f64>,
    z: Vec<f64>,
    coefficients: Vec<f64>,
    now: FlightStart,
    times: Vec<f64>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    /// Channels and their rates by time, for each node.
    channels: [Vec<f64>; 3],
    flight_data: FlightData,
    is_linearised: bool,
    partials: DerivativeData,
    /// ∂(q, v) of a node by its inputs.
    response: DMatrix<f64>,
    inputs: Vec<f64>,
    path_gradient: PathGradient,
    by_nodes: Vec<Vector3<f64>>,
    by_coefficient: Vec<f64>,
    by_parameter: Vec<f64>,
    by_node: NodeGradient,
    forces: Option<Forces>,
    /// Lent to a forward sweep.
    forward: Option<Forward>,
}

/// Room for a forward sweep.
#[derive(Debug, Clone)]
struct Forward {
    carried: NodeDerivatives,
    tangent: NodeTangent,
    /// Of the inputs of a node, a row for each variable.
    inputs: DMatrix<f64>,
}

impl FlightShooting {
    /// The flight of `model` from `start` with `n_steps` steps, at least two, rounded up to a multiple of the intervals of
    /// the splines, its joints moved by `motion`.
    pub fn try_new(
        model: Model,
        motion: SplineMotion,
        start: FlightStart,
        variables: FlightVariables,
        n_steps: usize,
    ) -> Result<Self, OcpError> {
        // stages of the path, and what each node has
        let numbers = 128 + 32 * motion.n_channels() + 8 * model.n_velocities();
        expect_room("n_steps", n_steps, 8 * numbers)?;
        let path = OrientationPath::try_new(model, motion, n_steps.max(2))?;
        let is_planar = path.is_planar();
        expect_length("start.orientation", start.orientation.len(), if is_planar { 1 } else { 4 })?;
        expect_finite("start.orientation", &start.orientation)?;
        if !is_planar {
            expect_positive("norm of start.orientation", start.orientation.iter().map(|x| x * x).sum())?;
        }
        expect_positive("start.duration", start.duration)?;
        Flight::try_new(path.model(), start.take_off)?;
        let mut bounds = Bounds::free(path.motion().n_parameters());
        let mut take = |is_free: bool, n: usize| {
            let first = bounds.len();
            let n = if is_free { n } else { 0 };
            (0..n).for_each(|_| bounds.push(f64::NEG_INFINITY, f64::INFINITY));
            is_free.then_some(first)
        };
        let mut at = [
            take(variables.orientation, if is_planar { 1 } else { 3 }),
            take(variables.angular_momentum, 3),
            take(variables.center_of_mass, 3),
            take(variables.velocity, 3),
            None,
        ];
        if let Some([lower, upper]) = variables.duration {
            expect_positive("duration.lower", lower)?;
            expect_finite("duration.upper", &[upper])?;
            expect_bounds("duration", &Bounds { lower: vec![lower], upper: vec![upper] })?;
            at[4] = Some(bounds.len());
            bounds.push(lower, upper);
        }
        Ok(Self::with_room(path, start, bounds, at))
    }

    fn with_room(
        path: OrientationPath,
        start: FlightStart,
        variables: Bounds,
        at: [Option<usize>; 5],
    ) -> Self {
        let (model, motion) = (path.model(), path.motion());
        let (n_q, n_v, n_channels) = (model.n_positions(), model.n_velocities(), motion.n_channels());
        let (n_nodes, n_z) = (path.n_steps() + 1, variables.len());
        let n_coefficients = motion.n_coefficients();
        let sizes = NodeSizes { n_positions: n_q, n_velocities: n_v, n_channels, ..NodeSizes::default() };
        Self {
            outline: Outline {
                sizes,
                variables,
                defects: Bounds::default(),
                phases: std::iter::once(0..n_nodes).collect(),
            },
            at,
            quadrature: simpson(path.n_steps()),
            z: Vec::with_capacity(n_z),
            coefficients: vec![0.0; n_coefficients],
            now: start.clone(),
            start,
            times: vec![0.0; n_nodes],
            positions: vec![0.0; n_nodes * n_q],
            velocities: vec![0.0; n_nodes * n_v],
            channels: [0; 3].map(|_| vec![0.0; n_nodes * n_channels]),
            flight_data: FlightData::new(model),
            is_linearised: false,
            partials: DerivativeData::new(model),
            response: DMatrix::zeros(2 * n_v, INPUTS + 2 * n_channels),
            inputs: vec![0.0; INPUTS + 2 * n_channels],
            path_gradient: PathGradient::new(n_coefficients),
            by_nodes: vec![Vector3::zeros(); n_nodes],
            by_coefficient: vec![0.0; n_coefficients],
            by_parameter: vec![0.0; motion.n_parameters()],
            by_node: sizes.gradient(),
            forces: None,
            forward: Some(Forward {
                carried: NodeDerivatives::new(n_coefficients),
                tangent: NodeTangent::new(&sizes, (0..n_z).collect()),
                inputs: DMatrix::zeros(n_z, INPUTS + 2 * n_channels),
            }),
            path,
        }
    }

    /// The same with accelerations and joint forces at its nodes, of the whole tree: (a_root, τ) by hybrid dynamics from
    /// the accelerations of the joints. For costs and constraints on them, at the price of one more evaluation of the
    /// dynamics at each node, and of its partial derivatives.
    pub fn with_joint_forces(mut self) -> Self {
        let (n_nodes, n_z) = (self.outline.n_nodes(), self.outline.n_variables());
        let sizes = &mut self.outline.sizes;
        (sizes.n_accelerations, sizes.n_torques) = (sizes.n_velocities, sizes.n_velocities);
        self.by_node = sizes.gradient();
        if let Some(room) = &mut self.forward {
            room.tangent = NodeTangent::new(sizes, (0..n_z).collect());
        }
        self.forces = Some(Forces::new(self.path.model(), self.path.motion().base(), n_nodes, n_z));
        self
    }

    /// The path of the orientation.
    pub fn path(&self) -> &OrientationPath {
        &self.path
    }

    /// First variable of orientation, angular momentum, centre of mass, velocity and duration, where they are free.
    pub fn first_variables(&self) -> [Option<usize>; 5] {
        self.at
    }

    /// Start and duration at the last z.
    pub fn now(&self) -> &FlightStart {
        &self.now
    }

    fn read(&mut self, z: &[f64]) {
        let Self { path, start, at, now, .. } = self;
        let three = |first: usize| Vector3::new(z[first], z[first + 1], z[first + 2]);
        now.orientation.copy_from_slice(&start.orientation);
        if let Some(first) = at[0] {
            if path.is_planar() {
                now.orientation[0] += z[first];
            } else {
                let turned = so3::normalized_xyzw(&start.orientation) * so3::exp(&three(first));
                now.orientation.copy_from_slice(turned.coords.as_slice());
            }
        }
        let TakeOff { angular_momentum, center_of_mass, velocity, .. } = &mut now.take_off;
        for (slot, value) in [(1, angular_momentum), (2, center_of_mass), (3, velocity)] {
            if let Some(first) = at[slot] {
                *value = three(first);
            }
        }
        if let Some(first) = at[4] {
            now.duration = z[first];
        }
    }

    fn integrate(&mut self, with_derivatives: bool) -> Result<(), EvaluationError> {
        let FlightStart { orientation, take_off, duration } = &self.now;
        let momentum = take_off.angular_momentum * *duration;
        let run = self.path.integrate(&self.coefficients, orientation, momentum, with_derivatives);
        run.map_err(undefined)
    }

    /// The path with derivatives, once for each z.
    fn linearise(&mut self) -> Result<(), EvaluationError> {
        if !self.is_linearised {
            self.integrate(true)?;
            self.is_linearised = true;
        }
        Ok(())
    }

    fn respond(&mut self, k: usize) -> Result<(), EvaluationError> {
        let NodeSizes { n_positions: n_q, n_velocities: n_v, .. } = self.outline.sizes;
        let (q, v) = (&self.positions[k * n_q..(k + 1) * n_q], &self.velocities[k * n_v..(k + 1) * n_v]);
        respond(&self.path, &mut self.partials, q, v, &mut self.response)
    }

    /// ∂(displacement of the start) by its variables.
    fn start_jacobian(&self) -> Matrix3<f64> {
        match self.at[0] {
            Some(first) if !self.path.is_planar() => {
                so3::right_jacobian(&Vector3::from_column_slice(&self.z[first..first + 3]))
            }
            _ => Matrix3::identity(),
        }
    }

    fn share(&self, k: usize) -> f64 {
        k as f64 / self.path.n_steps() as f64
    }

    /// The tangents of the inputs of node k, and those of its channels, time and weight.
    fn write_inputs(
        &self,
        k: usize,
        carried: &NodeDerivatives,
        inputs: &mut DMatrix<f64>,
        tangent: &mut NodeTangent,
    ) {
        let motion = self.path.motion();
        let (n, n_channels) = (motion.basis().n_coefficients(), motion.n_channels());
        let (duration, share, take_off) = (self.now.duration, self.share(k), &self.now.take_off);
        inputs.fill(0.0);
        for (coefficient, parameter, factor) in motion.dependences() {
            let turn = carried.by_coefficients[coefficient] * factor;
            (0..3).for_each(|i| inputs[(parameter, i)] += turn[i]);
        }
        let mut values = [0.0; MAX_DEGREE + 1];
        let parts = [&mut tangent.channel, &mut tangent.channel_rate, &mut tangent.channel_second_rate];
        for (derivative, part) in parts.into_iter().enumerate() {
            part.fill(0.0);
            let first = motion.basis().evaluate(share, derivative, &mut values);
            let scale = duration.powi(-(derivative as i32));
            for (coefficient, parameter, factor) in motion.dependences() {
                let (channel, j) = (coefficient / n, coefficient % n);
                if (first..first + motion.basis().n_active()).contains(&j) {
                    part[(parameter, channel)] += factor * scale * values[j - first];
                }
            }
            for channel in 0..n_channels {
                if let Some(row) = self.at[4] {
                    let value = self.channels[derivative][k * n_channels + channel];
                    part[(row, channel)] = -(derivative as f64) * value / duration;
                }
                if derivative < 2 {
                    let input = INPUTS + derivative * n_channels + channel;
                    inputs.column_mut(input).copy_from(&part.column(channel));
                }
            }
        }
        if let Some(first) = self.at[0] {
            let turned = carried.by_start * self.start_jacobian();
            if self.path.is_planar() {
                inputs[(first, 2)] = turned.m33;
            } else {
                (0..3).for_each(|row| (0..3).for_each(|i| inputs[(first + row, i)] = turned[(i, row)]));
            }
        }
        for row in 0..3 {
            if let Some(first) = self.at[1] {
                (0..3).for_each(|i| inputs[(first + row, i)] = carried.by_momentum[(i, row)] * duration);
                inputs[(first + row, 9 + row)] = 1.0;
            }
            if let Some(first) = self.at[2] {
                inputs[(first + row, 3 + row)] = 1.0;
            }
            if let Some(first) = self.at[3] {
                inputs[(first + row, 3 + row)] = share * duration;
                inputs[(first + row, 6 + row)] = 1.0;
            }
        }
        if let Some(row) = self.at[4] {
            let gravity = self.path.model().gravity();
            let turned = carried.by_momentum * take_off.angular_momentum;
            let speed = take_off.velocity + gravity * (share * duration);
            for i in 0..3 {
                inputs[(row, i)] = turned[i];
                inputs[(row, 3 + i)] = share * speed[i];
                inputs[(row, 6 + i)] = share * gravity[i];
            }
            tangent.time[row] = share;
            tangent.weight[row] = self.quadrature[k];
        }
    }
}

impl Transcription for FlightShooting {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn rollout(&mut self, z: &[f64]) -> Result<(), EvaluationError> {
        self.z.clear();
        self.z.extend_from_slice(z);
        self.is_linearised = false;
        self.read(z);
        let n_p = self.path.motion().n_parameters();
        self.path.motion().coefficients_into(&z[..n_p], &mut self.coefficients);
        self.integrate(false)?;
        let (model, motion) = (self.path.model(), self.path.motion());
        let FlightStart { take_off, duration, .. } = &self.now;
        let flight = Flight::try_new(model, *take_off).map_err(undefined)?;
        let NodeSizes { n_positions: n_q, n_velocities: n_v, n_channels, .. } = self.outline.sizes;
        let (q_root, v_root) = (model.positions_of(0).len(), model.velocities_of(0).len());
        for k in 0..=self.path.n_steps() {
            let share = k as f64 / self.path.n_steps() as f64;
            let own = k * n_channels..(k + 1) * n_channels;
            for (derivative, channels) in self.channels.iter_mut().enumerate() {
                let channels = &mut channels[own.clone()];
                motion.channels_into(&self.coefficients, share, derivative, channels);
                channels.iter_mut().for_each(|c| *c /= duration.powi(derivative as i32));
            }
            let [channel, rate, _] = &self.channels;
            let q = &mut self.positions[k * n_q..(k + 1) * n_q];
            let v = &mut self.velocities[k * n_v..(k + 1) * n_v];
            motion.base().positions_into(&channel[own.clone()], &mut q[q_root..]);
            motion.base().rates_into(&rate[own], &mut v[v_root..]);
            if self.path.is_planar() {
                q[2] = self.path.angles()[k];
            } else {
                q[3..7].copy_from_slice(self.path.orientations()[k].coords.as_slice());
            }
            self.times[k] = take_off.time + share * duration;
            flight.complete(&mut self.flight_data, self.times[k], q, v).map_err(undefined)?;
            if let Some(forces) = &mut self.forces {
                let second = &self.channels[2][k * n_channels..(k + 1) * n_channels];
                forces.evaluate(model, motion.base(), k, [q, v, second]).map_err(undefined)?;
            }
        }
        if self.positions.iter().chain(&self.velocities).all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(EvaluationError::Undefined { what: "the flight".into() })
    }

    fn node(&self, k: usize) -> Node<'_> {
        let NodeSizes { n_positions, n_velocities, n_channels, .. } = self.outline.sizes;
        let channels = |derivative: usize| &self.channels[derivative][k * n_channels..(k + 1) * n_channels];
        Node {
            time: self.times[k],
            position: &self.positions[k * n_positions..(k + 1) * n_positions],
            velocity: &self.velocities[k * n_velocities..(k + 1) * n_velocities],
            acceleration: self.forces.as_ref().map_or(&[], |forces| forces.acceleration(k)),
            torque: self.forces.as_ref().map_or(&[], |forces| forces.torque(k)),
            channel: channels(0),
            channel_rate: channels(1),
            channel_second_rate: channels(2),
        }
    }

    fn weight(&self, k: usize) -> f64 {
        self.quadrature[k] * self.now.duration
    }

    fn defects(&self) -> &[f64] {
        &[]
    }

    fn variables_of_node(&self, _k: usize) -> Vec<usize> {
        (0..self.outline.n_variables()).collect()
    }

    fn variables_of_defect(&self, _i: usize) -> Vec<usize> {
        Vec::new()
    }

    fn pull_back(&mut self, by: &RolloutGradient, gradient: &mut [f64]) -> Result<(), EvaluationError> {
        self.linearise()?;
        let n_channels = self.outline.sizes.n_channels;
        let basis = *self.path.motion().basis();
        let (n, n_active) = (basis.n_coefficients(), basis.n_active());
        let gravity = *self.path.model().gravity();
        self.path_gradient.clear();
        self.by_coefficient.fill(0.0);
        let duration = self.now.duration;
        let (mut by_duration, mut by_momentum) = (0.0, Vector3::zeros());
        let (mut by_center, mut by_velocity) = (Vector3::zeros(), Vector3::zeros());
        let mut values = [0.0; MAX_DEGREE + 1];
        let mut own = std::mem::take(&mut self.by_node);
        for (k, node) in by.nodes.iter().enumerate() {
            let share = self.share(k);
            self.respond(k)?;
            let node = match &mut self.forces {
                Some(forces) => {
                    own.clone_from(node);
                    let NodeSizes { n_positions: n_q, n_velocities: n_v, .. } = self.outline.sizes;
                    let state =
                        [&self.positions[k * n_q..(k + 1) * n_q], &self.velocities[k * n_v..(k + 1) * n_v]];
                    let base = self.path.motion().base();
                    forces.pull_back(self.path.model(), base, k, state, &mut own)?;
                    &own
                }
                None => node,
            };
            for (input, column) in self.inputs.iter_mut().zip(self.response.column_iter()) {
                let parts = node.position.iter().chain(&node.velocity);
                *input = column.iter().zip(parts).map(|(r, g)| r * g).sum();
            }
            let three = |first: usize| Vector3::from_column_slice(&self.inputs[first..first + 3]);
            self.by_nodes[k] = three(0);
            let (center, velocity) = (three(3), three(6));
            by_center += center;
            by_velocity += center * (share * duration) + velocity;
            by_momentum += three(9);
            let speed = self.now.take_off.velocity + gravity * (share * duration);
            by_duration += share * (center.dot(&speed) + velocity.dot(&gravity) + node.time);
            by_duration += self.quadrature[k] * by.weights[k];
            let of_node = [&node.channel, &node.channel_rate, &node.channel_second_rate];
            for (derivative, of_node) in of_node.into_iter().enumerate() {
                let first = basis.evaluate(share, derivative, &mut values);
                let scale = duration.powi(-(derivative as i32));
                for channel in 0..n_channels {
                    let mut g = of_node[channel];
                    if derivative < 2 {
                        g += self.inputs[INPUTS + derivative * n_channels + channel];
                    }
                    let value = self.channels[derivative][k * n_channels + channel];
                    by_duration -= derivative as f64 * value / duration * g;
                    let row = &mut self.by_coefficient[channel * n + first..][..n_active];
                    row.iter_mut().zip(&values).for_each(|(out, b)| *out += g * scale * b);
                }
            }
        }
        self.by_node = own;
        self.path.pull_back(&self.by_nodes, &mut self.path_gradient);
        let turn_momentum = self.path_gradient.by_momentum;
        by_momentum += turn_momentum * duration;
        by_duration += turn_momentum.dot(&self.now.take_off.angular_momentum);
        let of_path = &self.path_gradient.by_coefficients;
        self.by_coefficient.iter_mut().zip(of_path).for_each(|(sum, by)| *sum += by);
        self.by_parameter.fill(0.0);
        self.path.motion().pull_back(&self.by_coefficient, &mut self.by_parameter);
        gradient.iter_mut().zip(&self.by_parameter).for_each(|(g, p)| *g += p);
        if let Some(first) = self.at[0] {
            let start = self.start_jacobian().tr_mul(&self.path_gradient.by_start);
            if self.path.is_planar() {
                gradient[first] += start.z;
            } else {
                (0..3).for_each(|i| gradient[first + i] += start[i]);
            }
        }
        for (slot, part) in [(1, by_momentum), (2, by_center), (3, by_velocity)] {
            if let Some(first) = self.at[slot] {
                (0..3).for_each(|i| gradient[first + i] += part[i]);
            }
        }
        if let Some(first) = self.at[4] {
            gradient[first] += by_duration;
        }
        Ok(())
    }

    fn second_derivatives(&mut self) -> Option<&mut dyn RolloutSecondDerivatives> {
        None
    }

    fn push_forward(&mut self, _defects: &mut [f64], visit: &mut Visit<'_>) -> Result<(), EvaluationError> {
        self.linearise()?;
        let Some(mut room) = self.forward.take() else { return Ok(()) };
        let swept = self.sweep(&mut room, visit);
        self.forward = Some(room);
        swept
    }
}

impl FlightShooting {
    fn sweep(&mut self, room: &mut Forward, visit: &mut Visit<'_>) -> Result<(), EvaluationError> {
        let Forward { carried, tangent, inputs } = room;
        let n_v = self.outline.sizes.n_velocities;
        carried.begin();
        for k in 0..=self.path.n_steps() {
            if k > 0 {
                self.path.transport(k - 1, carried);
            }
            self.respond(k)?;
            self.write_inputs(k, carried, inputs, tangent);
            tangent.position.fill(0.0);
            tangent.velocity.fill(0.0);
            for (input, answer) in inputs.column_iter().zip(self.response.column_iter()) {
                tangent.position.ger(1.0, &input, &answer.rows(0, n_v), 1.0);
                tangent.velocity.ger(1.0, &input, &answer.rows(n_v, n_v), 1.0);
            }
            if let Some(forces) = &mut self.forces {
                let n_q = self.outline.sizes.n_positions;
                let state =
                    [&self.positions[k * n_q..(k + 1) * n_q], &self.velocities[k * n_v..(k + 1) * n_v]];
                forces.push_forward(self.path.model(), k, state, tangent)?;
            }
            visit(k, &self.node(k), self.weight(k), tangent)?;
        }
        Ok(())
    }
}

fn undefined(error: impl std::error::Error) -> EvaluationError {
    EvaluationError::Undefined { what: error.to_string() }
}
