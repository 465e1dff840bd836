//! Semi-implicit (symplectic) Euler, thesis (5.2), (5.3), algorithm 6.
//!
//! v₊ = vₙ + h aₙ, q₊ = exp(h v₊) qₙ.
//!
//! Order 1 on ℝ³ and on SO(3); 1 evaluation; no start-up. Symplectic on ℝ³ under r̈ = f(r), stable for
//! undamped oscillations with h ω < 2. On SO(3) in velocity form the energy of a free body grows
//! without bound: use `sieg` or the momentum form for large steps.

use crate::stepper::{MethodInfo, Scheme, Stages, StepError, Stepper};
use crate::system::{StateOf, System};

register! {
    20 thesis => Sie: SemiImplicitEuler, any;
    230 => SieL: SemiImplicitEuler, momentum("sie_l", "Semi-implicit Euler, angular momentum");
}

/// Semi-implicit Euler.
#[derive(Debug, Clone, Copy, Default)]
pub struct SemiImplicitEuler;

impl Scheme for SemiImplicitEuler {
    const INFO: MethodInfo = MethodInfo {
        conserves: "nothing exactly; symplectic on ℝ³ where forces depend on the position only",
        limitations: "unsuitable for bodies that turn far in a step, whose energy grows: `sieg`",
        ..MethodInfo::explicit(
            "sie",
            "Semi-implicit Euler",
            "J. Niiranen, Proc. 6th Electromechanics Int. Conf. (1999) 71; Aguilar Mayans, algorithm 6",
            1,
        )
    };
}

impl<S: System> Stepper<S> for SemiImplicitEuler {
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
        let (mut v, mut a) = (v.lend(), a.lend());
        system.acceleration(&mut m.workspace, t, x, &mut a);
        out.assign(x);
        out.kick(&a, h);
        system.velocity(&mut m.workspace, t + h, out, &mut v);
        out.drift(&v, h);
        Ok(())
    }
}
