//! Half kick, exact free motion, half kick.
//!
//! v½ = vₙ + h F/2m, L½ = Lₙ + h M/2; r and R move as a free body over h, L½ at rest in the world;
//! v₊ = v½ + h F₊/2m, L₊ = L½ + h M₊/2, ω₊ = I₊⁻¹ L₊.
//!
//! Order 2 on ℝ³ and on SO(3) under wrenches; a free body is exact to round-off whatever the step, so
//! that the error is one of the wrench alone: the method for fast spin under slow forces. 1 evaluation
//! where wrenches do not depend on the rates (the last kick's serves the next step), 4 where they do;
//! no start-up. Symplectic and symmetric where wrenches come from a potential. World angular momentum is
//! conserved exactly without torque. Not where evaluations are cheap and the body turns slowly: the free
//! motion costs elliptic functions.
//!
//! G. Strang, SIAM J. Numer. Anal. 5 (1968) 506; E. Celledoni, F. Fassò, N. Säfström and A. Zanna,
//! SIAM J. Sci. Comput. 30 (2008) 2084.
//!
//! # Deviations
//! A kick by a wrench that depends on the rates is solved by the explicit midpoint method, which keeps
//! the order but not the symmetry.

use crate::splitting::{Kick, Splitting, SplittingMemory};
use crate::stepper::{MethodInfo, Scheme, Scope, StepError, Stepper};
use crate::system::{RigidSystem, StateOf};

register! {
    400 => Split2: ExactSplitting2, world;
}

/// Splitting of order 2 with exact free motion.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExactSplitting2;

impl Scheme for ExactSplitting2 {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 1,
        scope: Scope::RigidBodies,
        conserves: "a free body exactly; symplectic under a potential",
        limitations: "unsuitable for cheap forces and slow spins: elliptic functions in each step; output between nodes of a free body, of order 4",
        ..MethodInfo::explicit(
            "split2",
            "Splitting with exact free motion, order 2",
            "G. Strang, SIAM J. Numer. Anal. 5 (1968) 506; E. Celledoni, F. Fassò, N. Säfström and A. Zanna, \
             SIAM J. Sci. Comput. 30 (2008) 2084",
            2,
        )
    };
}

const STRANG: Splitting<'static> = Splitting { kicks: &[0.5, 0.5], drifts: &[1.0], kick: Kick::SecondOrder };

impl<S: RigidSystem> Stepper<S> for ExactSplitting2 {
    type Memory = SplittingMemory<S>;

    fn start(&self, _: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok(SplittingMemory::new(x))
    }

    fn restart(&self, memory: &mut Self::Memory) {
        memory.restart();
    }

    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        memory.step(system, &STRANG, t, x, h, out);
        Ok(())
    }
}
