//! What an accurate integration makes of a swing-up.

use super::{CartPendulumProblem, SwingUp};
use crate::verification::{Holds, Verification, VerificationError, VerifiedReport, verify_cancellable};
use somersault_core::cancel::CancellationToken;
use somersault_nlp::{Flow, Iteration, Nlp, NlpSolver, SolverError, Start};

/// Steps of the integration of the cost: no fewer than ten for each of the thesis'.
const STEPS: usize = 2000;

/// A swing-up re-integrated, with the same motion of the cart.
#[derive(Debug, Clone, PartialEq)]
pub struct SwingUpVerification {
    /// Of the motion.
    pub motion: Verification,
    /// Cost of the motion integrated accurately from start to end.
    pub cost: f64,
    /// Relative change of that cost when its step was last halved.
    pub cost_error: f64,
}

impl Holds for SwingUpVerification {
    /// Its motion holds.
    fn holds(&self) -> bool {
        self.motion.holds()
    }
}

impl CartPendulumProblem {
    /// Integrates the motion of the cart's parameters `z` again.
    pub fn verify(&self, z: &[f64]) -> Result<SwingUpVerification, VerificationError> {
        self.verify_cancellable(z, &CancellationToken::new())
    }

    /// The same until it is cancelled; then [`VerificationError::Interrupted`].
    pub fn verify_cancellable(
        &self,
        z: &[f64],
        token: &CancellationToken,
    ) -> Result<SwingUpVerification, VerificationError> {
        let model = self.system.model().map_err(crate::error::OcpError::from)?;
        let motion = verify_cancellable(&mut self.shooting()?, &model, z, token)?;
        let factor = STEPS.div_ceil(self.n_steps);
        let refined = |factor| -> Result<f64, VerificationError> {
            Ok(self.refined(factor).single_shooting()?.evaluate(z, &mut [])?)
        };
        let (coarse, cost) = (refined(factor)?, refined(2 * factor)?);
        Ok(SwingUpVerification { motion, cost, cost_error: (cost - coarse).abs() / cost.abs() })
    }

    /// Solves `program`, the lifted form of this problem, and integrates the motion of the best iterate again.
    pub fn solve_verified(
        &self,
        program: &mut SwingUp,
        solver: &dyn NlpSolver,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<VerifiedReport<SwingUpVerification>, SolverError> {
        let report = solver.solve(program, start, on_iteration)?;
        let verification = self.verify(&report.z[..program.n_parameters()]);
        Ok(VerifiedReport { report, verification })
    }
}
