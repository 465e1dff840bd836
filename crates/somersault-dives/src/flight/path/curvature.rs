//! Second derivatives of a number by all that a path depends on.
//!
//! With displacements of nodes, δ = log(R₀ᵀ R), as coordinates a path is a composition of steps, and the Hessian of a
//! number of it is a sum over the steps,
//!
//! ```text
//! ∂² = Σ_k X_kᵀ ∂²(λ_{k+1} · δ_{k+1}) X_k
//! ```
//! with λ the adjoint and X the tangents of all that a step depends on: one sweep backward and one forward. Within a
//! step the sum continues over its stages. ω is linear in momentum and rates of the channels, so that its second
//! derivatives are those of its first by the channels: several channels at a time in the lanes of vector instructions.

use super::{AT_REST, NodeDerivatives, OrientationPath, write_joints};
use nalgebra::{DMatrix, Matrix3, Matrix3xX, UnitQuaternion, Vector3};
use rayon::prelude::*;
use somersault_core::lie::short::{omega_by_rate, rate, rate_partials, rate_second_partials};
use somersault_core::lie::so3::{self, hat, right_jacobian};
use somersault_multibody::DynamicsError;
use somersault_multibody::flight::step::{NODES, STAGES, StageRate, WEIGHTS, displacement_curvature};
use somersault_multibody::flight::{Flight, FlightError, FlightSecondDerivatives, TakeOff};

/// First and second derivatives of a number by the displacement of a node.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct NodeExpansion {
    pub(crate) gradient: Vector3<f64>,
    pub(crate) hessian: Matrix3<f64>,
}

/// Where a step, and a path, has displacement of its start and turn momentum among what it depends on.
pub(crate) const START: usize = 0;
pub(crate) const MOMENTUM: usize = 3;
/// Coefficients follow.
pub(crate) const COEFFICIENTS: usize = 6;
/// Steps of which second derivatives are kept at a time.
const CHUNK: usize = 512;

/// Where a stage has displacement of the start, u, ω, its own displacement and the turn momentum.
const TURN: usize = 3;
const RATE: usize = 6;
const PLACE: usize = 9;
const OF_STAGE: usize = 12;
/// Channels and their rates follow.
const CHANNELS: usize = 15;

impl OrientationPath {
    /// Second derivatives of a number with the given derivatives at the last node and at the arrival at a restart, by
    /// variables in which all that the path depends on is linear: `inputs` has rows for the displacement of the start, the
    /// turn momentum and the coefficients, in this order.
    pub(crate) fn curvature(
        &self,
        last: &NodeExpansion,
        arrival: &NodeExpansion,
        inputs: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, FlightError> {
        let mut by_nodes = vec![Vector3::zeros(); self.n_steps + 1];
        by_nodes[self.n_steps] = last.gradient;
        let mut adjoints = by_nodes.clone();
        let mut at_arrival = arrival.hessian;
        self.sweep_back(&by_nodes, &arrival.gradient, |step, past, adjoint| {
            adjoints[step] = *adjoint;
            if let Some(restart) = self.restart.as_ref().filter(|restart| restart.node == step + 1) {
                // past a restart nothing is left but the somersault, about the lateral axis
                let weight = past.dot(&restart.lateral());
                at_arrival += restart.counting.curvature(&restart.before, [weight, 0.0, 0.0]);
            }
        })?;
        let take_off = TakeOff { angular_momentum: self.turn_momentum, ..AT_REST };
        let flight = Flight::try_new(&self.model, take_off)?;
        let acting: Vec<usize> =
            (0..inputs.nrows()).filter(|row| inputs.row(*row).iter().any(|by| *by != 0.0)).collect();
        let active = self.active_channels(&acting);
        let bend = |room: &mut Room, step: usize| {
            room.make(self, &active[self.first(step)]);
            room.bend_step(self, &flight, step, &adjoints[step])
        };
        let mut derivatives = NodeDerivatives::new(self.motion.n_coefficients());
        derivatives.begin();
        let mut bent: Vec<DMatrix<f64>> = Vec::new();
        let mut total = Total::new(&acting, inputs.nrows());
        for step in 0..self.n_steps {
            if step % CHUNK == 0 {
                bent = (step..self.n_steps.min(step + CHUNK))
                    .into_par_iter()
                    .map_init(|| Room::new(self), bend)
                    .collect::<Result<_, _>>()?;
            }
            total.read(&derivatives);
            total.add_step(&bent[step % CHUNK], self.columns(step, &active[self.first(step)]));
            self.carry_to_arrival(step, &mut derivatives);
            if self.restart.as_ref().is_some_and(|restart| restart.node == step + 1) {
                total.read(&derivatives);
                total.add_node(&at_arrival);
            }
            self.pass(step + 1, &mut derivatives);
        }
        total.read(&derivatives);
        total.add_node(&last.hessian);
        let inputs = inputs.select_rows(&acting);
        Ok(inputs.tr_mul(&(total.sum * &inputs)))
    }

    /// For each interval of the splines the channels that variables move there.
    fn active_channels(&self, acting: &[usize]) -> Vec<Vec<usize>> {
        let basis = self.motion.basis();
        let of_interval = |interval: usize| {
            let moves = |channel: &usize| {
                let first = COEFFICIENTS + channel * basis.n_coefficients() + interval;
                acting.iter().any(|row| (first..first + basis.n_active()).contains(row))
            };
            (0..self.motion.n_channels()).filter(moves).collect()
        };
        (0..basis.n_intervals()).map(of_interval).collect()
    }

    /// All but the displacement that a step depends on, by the rows of the inputs.
    fn columns<'a>(&'a self, step: usize, active: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
        let basis = self.motion.basis();
        let coefficients = active.iter().flat_map(move |channel| {
            let first = COEFFICIENTS + channel * basis.n_coefficients() + self.first(step);
            first..first + basis.n_active()
        });
        (MOMENTUM..COEFFICIENTS).chain(coefficients)
    }
}

/// The sum over the steps, by the inputs that act.
struct Total<'a> {
    acting: &'a [usize],
    /// Where each input stands among them.
    place: Vec<Option<usize>>,
    sum: DMatrix<f64>,
    /// Of the displacement of a node.
    tangents: DMatrix<f64>,
    /// What a step depends on: its number in the step, and among the acting.
    columns: Vec<(usize, usize)>,
}

impl<'a> Total<'a> {
    fn new(acting: &'a [usize], n_inputs: usize) -> Self {
        let mut place = vec![None; n_inputs];
        acting.iter().enumerate().for_each(|(k, row)| place[*row] = Some(k));
        let n = acting.len();
        let (sum, tangents) = (DMatrix::zeros(n, n), DMatrix::zeros(3, n));
        Self { acting, place, sum, tangents, columns: Vec::new() }
    }

    fn read(&mut self, derivatives: &NodeDerivatives) {
        let NodeDerivatives { by_start, by_momentum, by_coefficients } = derivatives;
        for (row, mut column) in self.acting.iter().zip(self.tangents.column_iter_mut()) {
            match *row {
                MOMENTUM..COEFFICIENTS => column.copy_from(&by_momentum.column(row - MOMENTUM)),
                COEFFICIENTS.. => column.copy_from(&by_coefficients[row - COEFFICIENTS]),
                _ => column.copy_from(&by_start.column(row - START)),
            }
        }
    }

    fn add_node(&mut self, hessian: &Matrix3<f64>) {
        let bent = hessian * &self.tangents;
        self.sum.gemm_tr(1.0, &self.tangents, &bent, 1.0);
    }

    fn add_step(&mut self, bent: &DMatrix<f64>, columns: impl Iterator<Item = usize>) {
        self.add_node(&bent.fixed_view::<3, 3>(START, START).into_owned());
        self.columns.clear();
        let acting = columns.zip(MOMENTUM..).filter_map(|(row, k)| Some((k, self.place[row]?)));
        self.columns.extend(acting);
        let mixed = self.tangents.tr_mul(&bent.rows(START, 3));
        for (k, column) in &self.columns {
            let mixed = mixed.column(*k);
            self.sum.column_mut(*column).axpy(1.0, &mixed, 1.0);
            let mut row = self.sum.row_mut(*column);
            row += mixed.transpose();
            for (l, row) in &self.columns {
                self.sum[(*row, *column)] += bent[(*l, *k)];
            }
        }
    }
}

/// Room for one step.
struct Room {
    data: FlightSecondDerivatives,
    /// The sample whose shape was set last.
    sample: Option<usize>,
    q: Vec<f64>,
    v: Vec<f64>,
    channels: Vec<f64>,
    /// Channels that variables move in the step; the only ones in what follows.
    active: Vec<usize>,
    /// What each of them does to the joints.
    directions: Vec<f64>,
    /// Second derivatives of a · ω along them.
    rows: Vec<f64>,
    /// Of a stage, by what the step depends on.
    tangents: DMatrix<f64>,
    /// Weighted second derivatives in a stage.
    weights: DMatrix<f64>,
    product: DMatrix<f64>,
}

impl Room {
    fn new(path: &OrientationPath) -> Self {
        let n = path.motion.base().n_joints();
        let mut room = Self {
            data: FlightSecondDerivatives::default(),
            sample: None,
            q: vec![0.0; n],
            v: vec![0.0; n],
            channels: vec![0.0; path.motion.n_channels()],
            active: Vec::new(),
            directions: Vec::new(),
            rows: Vec::new(),
            tangents: DMatrix::zeros(0, 0),
            weights: DMatrix::zeros(0, 0),
            product: DMatrix::zeros(0, 0),
        };
        room.resize(path, 0);
        room
    }

    fn resize(&mut self, path: &OrientationPath, n_active: usize) {
        let n_stage = CHANNELS + 2 * n_active;
        let n_step = COEFFICIENTS + n_active * path.motion.basis().n_active();
        self.tangents = DMatrix::zeros(n_stage, n_step);
        self.weights = DMatrix::zeros(n_stage, n_stage);
        self.product = DMatrix::zeros(n_stage, n_step);
        self.rows.resize(n_active * (2 * n_active + 6), 0.0);
    }

    /// Makes room for a step with these channels.
    fn make(&mut self, path: &OrientationPath, active: &[usize]) {
        if self.active.len() != active.len() {
            self.resize(path, active.len());
        }
        if self.active != active {
            self.active.clear();
            self.active.extend_from_slice(active);
            self.directions.clear();
            let columns = path.motion.base().directions();
            self.directions.extend(active.iter().flat_map(|channel| columns.column(*channel)));
        }
    }

    /// Second derivatives of λ · δ at the end of a step by what the step depends on.
    fn bend_step(
        &mut self,
        path: &OrientationPath,
        flight: &Flight<'_>,
        step: usize,
        adjoint: &Vector3<f64>,
    ) -> Result<DMatrix<f64>, DynamicsError> {
        let n = self.tangents.ncols();
        let (mut total, mut sum_tangents) = (DMatrix::zeros(n, n), Matrix3xX::zeros(n));
        let h = 1.0 / path.n_steps as f64;
        let (mut k, mut sum) = (Vector3::zeros(), Vector3::zeros());
        self.tangents.fill(0.0);
        self.tangents.fixed_view_mut::<3, 3>(START, START).fill_with_identity();
        self.tangents.fixed_view_mut::<3, 3>(OF_STAGE, MOMENTUM).fill_with_identity();
        for stage in (0..STAGES).filter(|stage| !path.is_idle(*stage)) {
            let u = k * (h * NODES[stage]);
            // what the end of the step answers to ω here is known from the integration
            let by_omega = path.derivatives[step].by_stage[stage].tr_mul(adjoint);
            self.bend_rate(path, flight, [step, stage], &u, &by_omega)?;
            let StageRate { angular_velocity: omega, by_orientation } =
                path.stages.rates[step * STAGES + stage];
            let mut omega_tangents = self.read_inputs(path, step, stage);
            if path.is_planar {
                self.add_to(&mut total);
                continue;
            }
            let turn_tangents = self.tangents.fixed_rows::<3>(TURN).into_owned();
            let place_tangents = so3::exp(&-u).to_rotation_matrix().matrix()
                * self.tangents.fixed_rows::<3>(START)
                + right_jacobian(&u) * &turn_tangents;
            omega_tangents += by_orientation * &place_tangents;
            let [k_by_omega, k_by_u] = rate_partials(&u, &omega);
            k = rate(&u, &omega);
            let by_k = omega_by_rate(&u).tr_mul(&by_omega);
            let [of_turn, of_both] = rate_second_partials(&u, &omega, &by_k);
            let [of_start, of_place] = displacement_curvature(&u, &by_orientation.tr_mul(&by_omega));
            self.set_weights(TURN, TURN, &(of_turn + of_place));
            self.set_weights(RATE, TURN, &of_both);
            self.set_weights(START, TURN, &of_start);
            let k_tangents = k_by_omega * &omega_tangents + k_by_u * turn_tangents;
            self.tangents.fixed_rows_mut::<3>(PLACE).copy_from(&place_tangents);
            self.tangents.fixed_rows_mut::<3>(RATE).copy_from(&omega_tangents);
            self.add_to(&mut total);
            sum += k * (h * WEIGHTS[stage]);
            sum_tangents += &k_tangents * (h * WEIGHTS[stage]);
            let reach = NODES.get(stage + 1).map_or(0.0, |node| h * node);
            self.tangents.fixed_rows_mut::<3>(TURN).copy_from(&(k_tangents * reach));
        }
        if !path.is_planar {
            let [of_start, of_turn] = displacement_curvature(&sum, adjoint);
            self.weights.fill(0.0);
            self.set_weights(TURN, TURN, &of_turn);
            self.set_weights(START, TURN, &of_start);
            self.tangents.fixed_rows_mut::<3>(TURN).copy_from(&sum_tangents);
            self.add_to(&mut total);
        }
        Ok(total)
    }

    /// Leaves as weights the second derivatives of a · ω in a stage that is turned by exp(u) from the start of its step.
    fn bend_rate(
        &mut self,
        path: &OrientationPath,
        flight: &Flight<'_>,
        [step, stage]: [usize; 2],
        u: &Vector3<f64>,
        a: &Vector3<f64>,
    ) -> Result<(), DynamicsError> {
        let sample = path.sample(step, stage);
        if self.sample != Some(sample) {
            let Self { q, v, channels, .. } = &mut *self;
            let values = &path.basis[sample];
            write_joints(&path.motion, &path.coefficients, path.first(step), values, channels, q, v);
            flight.set_shape_along(&mut self.data, &self.q, &self.v, &self.directions)?;
            self.sample = Some(sample);
        }
        self.weights.fill(0.0);
        if path.is_planar {
            flight.second_derivatives_of_shape(&mut self.data, &[path.angles[step]], a, &mut self.rows)?;
        } else {
            let turn: UnitQuaternion<f64> = path.orientations[step] * so3::exp(u);
            flight.second_derivatives_of_shape(&mut self.data, turn.coords.as_slice(), a, &mut self.rows)?;
            // ω = I⁻¹ m, m = Rᵀ T L
            let placement = path.model.placement(0).map_or_else(Matrix3::identity, |p| p.rotation);
            let turn = placement * turn.to_rotation_matrix().into_inner();
            let by_momentum = &path.stages.by_momentum[step * STAGES + stage];
            let p = turn.tr_mul(&by_momentum.tr_mul(a));
            let m = turn.tr_mul(&path.turn_momentum);
            let outer = p * m.transpose();
            let twice = (outer + outer.transpose()) * 0.5 - Matrix3::from_diagonal_element(p.dot(&m));
            self.set_weights(PLACE, PLACE, &twice);
            self.set_weights(PLACE, OF_STAGE, &(hat(&p) * turn.transpose()));
        }
        let n = self.active.len();
        let columns = (CHANNELS..CHANNELS + 2 * n).chain(PLACE..PLACE + 3).chain(OF_STAGE..OF_STAGE + 3);
        for (k, row) in self.rows.chunks_exact(2 * n + 6).enumerate() {
            for (column, bent) in columns.clone().zip(row) {
                self.weights[(CHANNELS + k, column)] = *bent;
                self.weights[(column, CHANNELS + k)] = *bent;
            }
        }
        Ok(())
    }

    /// Leaves the tangents of channels and rates, and returns what they and the momentum are for ω.
    fn read_inputs(&mut self, path: &OrientationPath, step: usize, stage: usize) -> Matrix3xX<f64> {
        let (n_channels, n_values) = (path.motion.n_channels(), path.motion.basis().n_active());
        let [values, slopes] = &path.basis[path.sample(step, stage)];
        let (at, stages) = (step * STAGES + stage, &path.stages);
        let mut omega = Matrix3xX::zeros(self.tangents.ncols());
        omega.fixed_columns_mut::<3>(MOMENTUM).copy_from(&stages.by_momentum[at]);
        let n_active = self.active.len();
        for (k, channel) in self.active.iter().enumerate() {
            let (by_channel, by_rate) =
                (stages.by_channel[at * n_channels + channel], stages.by_rate[at * n_channels + channel]);
            for j in 0..n_values {
                let column = COEFFICIENTS + k * n_values + j;
                self.tangents[(CHANNELS + k, column)] = values[j];
                self.tangents[(CHANNELS + n_active + k, column)] = slopes[j];
                omega.set_column(column, &(by_channel * values[j] + by_rate * slopes[j]));
            }
        }
        omega
    }

    /// Sets one block, and the one across the diagonal.
    fn set_weights(&mut self, row: usize, column: usize, block: &Matrix3<f64>) {
        self.weights.fixed_view_mut::<3, 3>(row, column).copy_from(block);
        self.weights.fixed_view_mut::<3, 3>(column, row).tr_copy_from(block);
    }

    /// Adds Xᵀ W X.
    fn add_to(&mut self, total: &mut DMatrix<f64>) {
        self.weights.mul_to(&self.tangents, &mut self.product);
        total.gemm_tr(1.0, &self.tangents, &self.product, 1.0);
    }
}
