//! Kicks and exact free motions composed to order 4 by Blanes and Moan's S₆.
//!
//! Seven kicks a₁ h, a₂ h, a₃ h, a₄ h, a₃ h, a₂ h, a₁ h with six free motions b₁ h, b₂ h, b₃ h, b₃ h, b₂ h,
//! b₁ h between them; kick and motion as in `split2`.
//!
//! Order 4 on ℝ³ and on SO(3) under wrenches; a free body is exact to round-off whatever the step. 6
//! evaluations where wrenches do not depend on the rates (the last kick's serves the next step), 28
//! where they do; no start-up. Symplectic and symmetric where wrenches come from a potential. World
//! angular momentum is conserved exactly without torque. For long runs of bodies that spin fast under
//! slow forces; six free motions a step cost elliptic functions.
//!
//! Why S₆: it holds for any two flows, also where the kick is not the gradient of a potential in the
//! configuration, as under drag (the cheaper Runge–Kutta–Nyström splittings need that), and no part of
//! the step is longer than the step, as in Yoshida's three Strang steps.
//!
//! S. Blanes and P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313, table 2.
//!
//! # Deviations
//! A kick by a wrench that depends on the rates is solved by the classic Runge–Kutta method, which
//! keeps the order but not the symmetry.

use crate::splitting::{Kick, Splitting, SplittingMemory};
use crate::stepper::{MethodInfo, Scheme, Scope, StepError, Stepper};
use crate::system::{RigidSystem, StateOf};

register! {
    410 => Split4: ExactSplitting4, world;
}

/// Splitting of order 4 with exact free motion.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExactSplitting4;

impl Scheme for ExactSplitting4 {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 6,
        scope: Scope::RigidBodies,
        conserves: "a free body exactly; symplectic under a potential",
        limitations: "unsuitable for cheap forces and slow spins: elliptic functions in each step; output between nodes of a free body, of order 4",
        ..MethodInfo::explicit(
            "split4",
            "Splitting with exact free motion, order 4",
            "S. Blanes and P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313; E. Celledoni, F. Fassò, \
             N. Säfström and A. Zanna, SIAM J. Sci. Comput. 30 (2008) 2084",
            4,
        )
    };
}

const A: [f64; 3] = [0.0792036964311957, 0.353172906049774, -0.0420650803577195];
const B: [f64; 2] = [0.209515106613362, -0.143851773179818];
const A_MIDDLE: f64 = 1.0 - 2.0 * (A[0] + A[1] + A[2]);
const B_MIDDLE: f64 = 0.5 - (B[0] + B[1]);

const S6: Splitting<'static> = Splitting {
    kicks: &[A[0], A[1], A[2], A_MIDDLE, A[2], A[1], A[0]],
    drifts: &[B[0], B[1], B_MIDDLE, B_MIDDLE, B[1], B[0]],
    kick: Kick::FourthOrder,
};

impl<S: RigidSystem> Stepper<S> for ExactSplitting4 {
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
        memory.step(system, &S6, t, x, h, out);
        Ok(())
    }
}
