//! The planar dive as thesis 3.1 poses it: the full hybrid dynamics stepped by explicit Euler.
//!
//! Nothing there conserves the angular momentum: each step adds what the curvature of the motion leaves out of it, and the
//! optimiser pays only for the momentum at take-off. It rises while the diver folds, by 11 % to 15 %, and falls by more
//! when he opens.

use crate::dive::MOST_STEPS;
use crate::{Channels, DiveError, DiveProgram, DiveSearchError};
use nalgebra::{Rotation2, Vector2, Vector3};
use somersault_core::argument::ArgumentError;
use somersault_multibody::flight::{Flight, FlightData, TakeOff};
use somersault_multibody::{Data, Model, Split};
use somersault_nlp::{Bounds, Flow, HessianSource, Iteration, NlpSolver, Report, Sqp};
use somersault_ocp::OcpError;
use somersault_ocp::dynamics::Tree;
use somersault_ocp::problem::{At, Loss, MotionProblem};
use somersault_ocp::shooting::{Phase, Scheme, Shooting, ShootingOptions, Start};
use somersault_ocp::term::{Displacement, Entries, Momentum, MomentumPart, Part};
use somersault_ocp::transcription::Transcription;

/// A planar dive stepped by explicit Euler: states at its nodes, rows one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct LiteralDive {
    /// s.
    pub times: Vec<f64>,
    /// Configurations q, the centre of mass at the origin at take-off.
    pub positions: Vec<f64>,
    /// Velocities v.
    pub velocities: Vec<f64>,
    /// About the centre of mass along the lateral axis, kg m²/s.
    pub angular_momentum: Vec<f64>,
    /// L₀ = m h²/(1 s), kg m²/s.
    pub momentum_unit: f64,
    /// Somersault angle, rad, counted from the upright as that of [`DiveMotion`](crate::DiveMotion): the first is the lean.
    pub somersault: Vec<f64>,
    /// Of the solver; none where a motion was only rolled out.
    pub report: Option<Report>,
}

impl LiteralDive {
    /// (L(T) − L(0))/L(0): positive where the momentum grows, forward or backward. An L(0) of less than L₀/1000 says nothing
    /// of its own size and counts as that, forward.
    pub fn momentum_change(&self) -> f64 {
        let (Some(first), Some(last)) = (self.angular_momentum.first(), self.angular_momentum.last()) else {
            return f64::NAN;
        };
        let least = 1e-3 * self.momentum_unit;
        (last - first) / if first.abs() < least { least } else { *first }
    }
}

impl DiveProgram {
    /// The motion of `z` rolled out as the thesis would.
    pub fn literal_motion(&self, z: &[f64], n_steps: usize) -> Result<LiteralDive, DiveError> {
        let (problem, start) = self.literal(z, n_steps)?;
        self.read_literal(problem, &start, None)
    }

    /// The dive as the thesis poses it, solved from `z`.
    pub fn solve_literal(
        &self,
        z: &[f64],
        n_steps: usize,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<LiteralDive, DiveSearchError> {
        let (mut problem, start) = self.literal(z, n_steps)?;
        let solver = Sqp { hessian: HessianSource::QuasiNewton, stationarity_tol: 1e-6, ..Sqp::default() };
        let report = solver.solve(&mut problem, &start.into(), on_iteration)?;
        let found = report.z.clone();
        Ok(self.read_literal(problem, &found, Some(report))?)
    }

    fn read_literal(
        &self,
        mut problem: MotionProblem<Shooting<Tree>>,
        z: &[f64],
        report: Option<Report>,
    ) -> Result<LiteralDive, DiveError> {
        problem.transcription_mut().rollout(z)?;
        let motion = problem.transcription();
        let mut found = LiteralDive {
            times: Vec::new(),
            positions: Vec::new(),
            velocities: Vec::new(),
            angular_momentum: momentum_along(self.path().model(), motion)?,
            momentum_unit: self.momentum_unit(),
            somersault: Vec::new(),
            report,
        };
        let upright = self.counting().axes.euler_angles().1;
        for k in 0..motion.outline().n_nodes() {
            let node = motion.node(k);
            found.times.push(node.time);
            found.positions.extend_from_slice(node.position);
            found.velocities.extend_from_slice(node.velocity);
            // forward turns are negative about the normal of the plane
            found.somersault.push(upright - node.position[2]);
        }
        Ok(found)
    }

    /// The same planar dive, of fixed lean and duration, by `n_steps` steps of explicit Euler, and the start that `z` is
    /// for it: the angular velocity at take-off, against that of `z`, then the spline parameters.
    ///
    /// # Errors
    /// Where the dive is not planar, has joints for channels or a free duration or lean.
    pub fn literal(
        &self,
        z: &[f64],
        n_steps: usize,
    ) -> Result<(MotionProblem<Shooting<Tree>>, Vec<f64>), DiveError> {
        let dive = self.dive();
        let fixed = dive.duration.is_fixed() && dive.lean.is_fixed();
        if !(self.path().is_planar() && fixed && dive.channels == Channels::Weights) {
            return Err(DiveError::NotLiteral);
        }
        let (model, motion) = (self.path().model(), self.path().motion().clone());
        let (position, velocity) = self.state_at_take_off(z)?;
        let split = Split::all_but_root(model);
        let mut start = Start::fixed(&position, &velocity);
        start.free_velocities[2] = true;
        let phase = Phase::new(motion.clone(), n_steps, self.duration(z));
        let options = ShootingOptions { scheme: Scheme::ExplicitEuler, ..ShootingOptions::default() };
        let tree = Tree::try_new(model.clone(), split)?;
        let shooting = Shooting::try_new(tree.clone(), start, vec![phase], options)?;
        let sizes = shooting.outline().sizes;
        let first = shooting.layout().parameters[0].start;
        let penalties = &dive.penalties;
        let momentum = Momentum::new(model.clone(), MomentumPart::Angular);
        let weights = vec![0.0, penalties.momentum / self.momentum_unit().powi(2), 0.0];
        let mut entry = Bounds::default();
        entry.push(0.0, 0.0);
        let mut reference = position.clone();
        reference[2] = self.entry_rotation();
        let rates = Loss::HalfSquares {
            weights: vec![penalties.rate; motion.n_channels()],
            target: vec![0.0; motion.n_channels()],
        };
        let mut problem = MotionProblem::builder(shooting)
            .mayer(At::Start, momentum, Loss::HalfSquares { weights, target: vec![0.0; 3] })?
            .lagrange(Entries::all(&sizes, Part::ChannelRate), rates)?
            .constrain(At::End, Displacement::try_new(tree, &reference, &[2])?, entry)?;
        for (factors, lower, upper) in self.channel_bounds() {
            let factors: Vec<_> = factors.iter().map(|(k, factor)| (first + k, *factor)).collect();
            problem = problem.constrain_variables("weights", &factors, lower, upper)?;
        }
        let parameters = &z[..motion.n_parameters()];
        Ok((problem.build()?, std::iter::once(0.0).chain(parameters.iter().copied()).collect()))
    }

    /// Angular momentum about the centre of mass at each of `n_steps` + 1 nodes of the planar dive `z`, by explicit Euler in
    /// the coordinates x, z, θ of the torso and their rates, as (2.8) has it; [`literal`](Self::literal) steps velocities
    /// in axes of the torso.
    pub fn momentum_in_coordinates(&self, z: &[f64], n_steps: usize) -> Result<Vec<f64>, DiveError> {
        if !self.path().is_planar() {
            return Err(DiveError::NotLiteral);
        }
        if !(1..=MOST_STEPS).contains(&n_steps) {
            let (argument, allowed) = ("n_steps", "from 1 to 100000");
            return Err(ArgumentError::OutOfRange { argument, allowed, found: n_steps as f64 }.into());
        }
        let (model, motion) = (self.path().model(), self.path().motion());
        let (mut q, mut v) = self.state_at_take_off(z)?;
        let (coefficients, duration) = (self.coefficients(z), self.duration(z));
        let split = Split::all_but_root(model);
        let mut data = Data::new(model);
        let (mut a, mut torque) = (vec![0.0; v.len()], vec![0.0; v.len()]);
        let mut channels = vec![0.0; motion.n_channels()];
        let mut rate = Rotation2::new(q[2]) * Vector2::new(v[0], v[1]);
        let h = duration / n_steps as f64;
        let mut along = Vec::with_capacity(n_steps + 1);
        for step in 0..=n_steps {
            let fraction = step as f64 / n_steps as f64;
            motion.channels_into(&coefficients, fraction, 0, &mut channels);
            motion.base().positions_into(&channels, &mut q[3..]);
            for (derivative, out) in [(1, &mut v), (2, &mut a)] {
                motion.channels_into(&coefficients, fraction, derivative, &mut channels);
                channels.iter_mut().for_each(|c| *c /= duration.powi(derivative as i32));
                motion.base().rates_into(&channels, &mut out[3..]);
            }
            let turn = Rotation2::new(q[2]);
            let linear = turn.inverse() * rate;
            (v[0], v[1]) = (linear.x, linear.y);
            along.push(model.centroidal(&mut data, &q)?.momentum(&v)?.angular.y);
            torque.fill(0.0);
            model.hybrid_dynamics(&mut data, &split, &q, &v, &mut a, &mut torque, &[])?;
            let acceleration = turn * Vector2::new(a[0] - v[2] * v[1], a[1] + v[2] * v[0]);
            q[0] += h * rate.x;
            q[1] += h * rate.y;
            q[2] += h * v[2];
            rate += acceleration * h;
            v[2] += h * a[2];
        }
        Ok(along)
    }

    /// q and v of the whole tree at take-off, centre of mass at the origin and at rest.
    fn state_at_take_off(&self, z: &[f64]) -> Result<(Vec<f64>, Vec<f64>), DiveError> {
        let mut program = self.clone();
        program.fly(z, false)?;
        let (model, motion) = (self.path().model(), self.path().motion());
        let angular_momentum = Vector3::new(0.0, self.momentum(z), 0.0);
        let origin = Vector3::zeros();
        let take_off = TakeOff { time: 0.0, center_of_mass: origin, velocity: origin, angular_momentum };
        let flight = Flight::try_new(model, take_off)?;
        let (mut q, mut v) = (model.neutral(), vec![0.0; model.n_velocities()]);
        let mut channels = vec![0.0; motion.n_channels()];
        motion.channels_into(&self.coefficients(z), 0.0, 0, &mut channels);
        motion.base().positions_into(&channels, &mut q[3..]);
        q[2] = program.path().angles()[0];
        flight.complete(&mut FlightData::new(model), 0.0, &mut q, &mut v)?;
        Ok((q, v))
    }
}

/// Angular momentum about the centre of mass along the lateral axis at each node of a transcription whose nodes are states
/// of `model`, kg m²/s.
pub fn momentum_along(model: &Model, motion: &impl Transcription) -> Result<Vec<f64>, DiveError> {
    let mut data = Data::new(model);
    (0..motion.outline().n_nodes())
        .map(|k| {
            let node = motion.node(k);
            Ok(model.centroidal(&mut data, node.position)?.momentum(node.velocity)?.angular.y)
        })
        .collect()
}

impl From<OcpError> for DiveError {
    fn from(error: OcpError) -> Self {
        Self::Problem(error)
    }
}
