//! A pendulum on a cart is brought from one state to another (thesis appendix A), open in all its numbers.
//!
//! ```text
//! minimise  ½ (x(T) − x_f)ᵀ Q (x(T) − x_f) + ½ ∫ ρ F² + (x − x_f)ᵀ W (x − x_f) dt,    x = (θ, r, θ̇, ṙ)
//! ```
//! The cart moves along a spline that starts at r(0), ṙ(0); its other parameters p are the variables. The pendulum is
//! passive. With the defaults this is thesis A.2, read so that Table A.1 reproduces: ½ in both costs, R = Δt once,
//! g = 9.81, explicit Euler, N = 200, and n_par = p + 2 splines, since two of them go to r(0) and ṙ(0).
//!
//! It is the case study of shooting, and stands here for that reason: its motion problem and its verification are
//! those of this crate, and a program that is written out for it shows how much faster the same problem can be. Nothing in the
//! crate depends on it.
//!
//! The same problem comes in three forms.
//!
//! - [`CartPendulumProblem::swing_up`] is the one to solve. It is lifted (multiple shooting; Albersmeyer & Diehl, SIAM J.
//!   Optim. 20 (2010) 1655–1684): nodes cut the motion into segments [t_k, t_k+1], on which the pendulum starts at a state
//!   s_k of its own and arrives at g_k(p, s_k), and the terminal error e is a variable,
//!
//!   ```text
//!   minimise    ½ eᵀ Q e + Σ_k c_k(p, s_k)
//!   subject to  g_k(p, s_k) = s_k+1,   x(T; p, s_K) − x_f = e
//!   ```
//!   The Lagrangian's Hessian is Σ_k ∇²(c_k + λ_kᵀ g_k) + Q, exact; each term is by the five to twenty parameters that move
//!   the cart during a segment, and by s_k. Multipliers λ_k are costates of the pendulum at the nodes. From straight lines
//!   SQP takes six to eight steps for each case of Table A.1, where it takes hundreds by single shooting.
//! - [`CartPendulumProblem::single_shooting`] has the parameters alone for variables, and the same minima: what a motion of
//!   the cart costs, by one pass forwards and one backwards.
//! - [`CartPendulumProblem::motion_problem`] composes it of terms, as any problem.

mod curvature;
mod euler;
mod lifted;
mod passes;
mod sine;
mod single;
mod starts;
mod tables;
mod verification;

pub use lifted::SwingUp;
pub use single::SingleShooting;
pub use verification::SwingUpVerification;

use crate::dynamics::CartPendulumDynamics;
use crate::error::{OcpError, expect_none_negative, expect_room};
use crate::problem::{At, Loss, MotionProblem};
use crate::shooting::{Drive, Phase, Scheme, Shooting, ShootingOptions, Start};
use crate::term::{Displacement, Entries, Part};
use crate::transcription::Transcription;
use somersault_core::argument::{expect_finite, expect_length, expect_not_negative, expect_positive};
use somersault_core::spline::UniformBasis;
use somersault_multibody::joint_motion::{Condition, EigenpostureBase, End, JointMotionError, SplineMotion};
use somersault_multibody::models::CartPendulum;

/// Segments of a [`SwingUp`], where it has as many steps.
const LEAST_SEGMENTS: usize = 4;

/// The problem in numbers. States are (θ, r, θ̇, ṙ), θ from the upright.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CartPendulumProblem {
    /// Masses, length and gravity.
    pub system: CartPendulum,
    /// x(0).
    pub start: [f64; 4],
    /// x_f, met by a penalty.
    pub target: [f64; 4],
    /// T, s.
    pub duration: f64,
    /// N, at most 2²¹.
    pub n_steps: usize,
    /// n_par ≥ 6: splines of the cart, two more than there are variables.
    pub n_coefficients: usize,
    /// How the pendulum is integrated, and the costs.
    pub scheme: Scheme,
    /// Diagonal of Q, on the final state.
    pub terminal_weights: [f64; 4],
    /// ρ, on the square of the force.
    pub force_weight: f64,
    /// Diagonal of W, on the state on its way.
    pub running_weights: [f64; 4],
}

/// Of tables, stages and tangents, with Runge–Kutta steps.
const BYTES_A_STEP: usize = 2048;

impl Default for CartPendulumProblem {
    /// Thesis A.2, case A.
    fn default() -> Self {
        Self {
            system: CartPendulum::default(),
            start: [std::f64::consts::PI, -1.0, 0.0, 0.0],
            target: [0.0; 4],
            duration: 2.0,
            n_steps: 200,
            n_coefficients: 7,
            scheme: Scheme::ExplicitEuler,
            terminal_weights: [1e5; 4],
            force_weight: 1.0,
            running_weights: [0.0; 4],
        }
    }
}

impl CartPendulumProblem {
    /// Thesis A.2 with p free parameters, as Table A.1 counts them.
    pub fn with_parameters(p: usize) -> Self {
        Self { n_coefficients: p + 2, ..Self::default() }
    }

    /// The motion of the cart.
    pub fn motion(&self) -> Result<SplineMotion, OcpError> {
        let basis = UniformBasis::try_new(5, self.n_coefficients).map_err(JointMotionError::from)?;
        let [_, r, _, rate] = self.start;
        let conditions = [
            Condition { end: End::Start, derivative: 0, value: r },
            Condition { end: End::Start, derivative: 1, value: rate * self.duration },
        ];
        Ok(SplineMotion::try_new(basis, EigenpostureBase::joints(1), &conditions)?)
    }

    /// The same problem integrated `factor` times as finely by Runge–Kutta steps: its cost at parameters found with
    /// this one is their cost after accurate integration.
    pub fn refined(&self, factor: usize) -> Self {
        Self { scheme: Scheme::RungeKutta4, n_steps: self.n_steps * factor, ..self.clone() }
    }

    fn expect_valid(&self) -> Result<(), OcpError> {
        expect_finite("start", &self.start)?;
        expect_finite("target", &self.target)?;
        expect_positive("duration", self.duration)?;
        expect_positive("n_steps", self.n_steps as f64)?;
        expect_room("n_steps", self.n_steps, BYTES_A_STEP)?;
        expect_none_negative("terminal_weights", &self.terminal_weights)?;
        expect_not_negative("force_weight", self.force_weight)?;
        Ok(expect_none_negative("running_weights", &self.running_weights)?)
    }

    /// The problem for a solver.
    pub fn swing_up(&self) -> Result<SwingUp, OcpError> {
        SwingUp::try_new(self)
    }

    /// The cost as a function of the cart's parameters alone.
    pub fn single_shooting(&self) -> Result<SingleShooting, OcpError> {
        SingleShooting::try_new(self)
    }

    /// Segments of about √(ℓ/|g|), in which a pendulum that falls moves away from the upright e-fold; four at least.
    fn n_segments(&self) -> usize {
        let rate = (self.system.gravity.abs() / self.system.length).sqrt();
        // a product beyond all integers becomes the largest
        ((self.duration * rate).round() as usize).max(LEAST_SEGMENTS).min(self.n_steps)
    }

    /// The transcription, with the tree's order q = (r, θ).
    pub fn shooting(&self) -> Result<Shooting<CartPendulumDynamics>, OcpError> {
        self.expect_valid()?;
        let [angle, r, angle_rate, rate] = self.start;
        let start = Start::fixed(&[r, angle], &[rate, angle_rate]);
        let phase = Phase::new(self.motion()?, self.n_steps, self.duration);
        let options = ShootingOptions { scheme: self.scheme, drive: Drive::Motion };
        Shooting::try_new(CartPendulumDynamics::try_new(self.system)?, start, vec![phase], options)
    }

    /// The problem composed of terms.
    pub fn motion_problem(&self) -> Result<MotionProblem<Shooting<CartPendulumDynamics>>, OcpError> {
        let shooting = self.shooting()?;
        let (sizes, dynamics) = (shooting.outline().sizes, shooting.dynamics().clone());
        // (r, θ) from (θ, r, θ̇, ṙ)
        let half = |weights: &[f64; 4], first: usize, target: [f64; 2]| Loss::HalfSquares {
            weights: vec![weights[first + 1], weights[first]],
            target: target.to_vec(),
        };
        let [angle, r, angle_rate, rate] = self.target;
        let position = Displacement::try_new(dynamics, &[r, angle], &[0, 1])?;
        let velocity = Entries::all(&sizes, Part::Velocity);
        let force = Entries::try_new(&sizes, Part::Torque, &[0])?;
        let mut problem = MotionProblem::builder(shooting)
            .mayer(At::End, position.clone(), half(&self.terminal_weights, 0, [0.0; 2]))?
            .mayer(At::End, velocity.clone(), half(&self.terminal_weights, 2, [rate, angle_rate]))?
            .lagrange(force, Loss::HalfSquares { weights: vec![self.force_weight], target: vec![0.0] })?;
        if self.running_weights != [0.0; 4] {
            problem = problem
                .lagrange(position, half(&self.running_weights, 0, [0.0; 2]))?
                .lagrange(velocity, half(&self.running_weights, 2, [rate, angle_rate]))?;
        }
        problem.build()
    }

    /// The parameters for which the cart moves most nearly as it does in `other` with `z`: a start on more splines from an
    /// optimum on fewer.
    pub fn carry_over(&self, other: &Self, z: &[f64]) -> Result<Vec<f64>, OcpError> {
        let (from, to) = (other.motion()?, self.motion()?);
        expect_length("z", z.len(), from.n_parameters())?;
        let mut coefficients = vec![0.0; from.n_coefficients()];
        from.coefficients_into(z, &mut coefficients);
        let fractions: Vec<f64> = (0..=400).map(|k| f64::from(k) / 400.0).collect();
        let sample = |fraction: &f64| {
            let mut r = [0.0];
            from.channels_into(&coefficients, *fraction, 0, &mut r);
            r
        };
        let samples: Vec<[f64; 1]> = fractions.iter().map(sample).collect();
        Ok(to.fit(&fractions, &samples)?)
    }
}
