//! Midpoint method, thesis 5.2.3, algorithm 8.
//!
//! An Euler step of h/2 gives (v₂, a₂); then q₊ = exp(h v₂) qₙ, v₊ = vₙ + h a₂.
//!
//! Order 2 on ℝ³ and on SO(3); 2 evaluations; no start-up. Conserves nothing exactly.

use crate::stepper::{MethodInfo, Scheme, Stages, StepError, Stepper};
use crate::system::{StateOf, System};
use crate::tableau::{MIDPOINT, Tableau};

register! {
    40 thesis => Mp: Midpoint, any;
    240 => MpL: Midpoint, momentum("mp_l", "Midpoint method, angular momentum");
}

/// Explicit midpoint method.
#[derive(Debug, Clone, Copy, Default)]
pub struct Midpoint;

impl Scheme for Midpoint {
    const INFO: MethodInfo = MethodInfo::explicit(
        "mp",
        "Midpoint method",
        "C. Runge, Math. Ann. 46 (1895) 167; Aguilar Mayans, algorithm 8",
        2,
    );

    fn on_vectors(&self) -> Option<Tableau> {
        Some(Tableau::of(&MIDPOINT))
    }
}

impl<S: System> Stepper<S> for Midpoint {
    type Memory = Stages<S, 1>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok(Stages::new(system, x))
    }

    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let ([v], [a]) = (&mut m.velocities, &mut m.accelerations);
        let (mut v, mut a, mut middle) = (v.lend(), a.lend(), m.stage.lend());
        system.velocity(&mut m.workspace, t, x, &mut v);
        system.acceleration(&mut m.workspace, t, x, &mut a);
        middle.assign(x);
        middle.drift(&v, 0.5 * h);
        middle.kick(&a, 0.5 * h);
        system.velocity(&mut m.workspace, t + 0.5 * h, &middle, &mut v);
        system.acceleration(&mut m.workspace, t + 0.5 * h, &middle, &mut a);
        out.assign(x);
        out.drift(&v, h);
        out.kick(&a, h);
        Ok(())
    }
}
