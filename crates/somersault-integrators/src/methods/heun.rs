//! Heun's method, thesis 5.2.3, algorithm 9.
//!
//! An Euler step of h gives (v₂, a₂); then q₊ = exp(h (v₁ + v₂)/2) qₙ, v₊ = vₙ + h (a₁ + a₂)/2.
//!
//! Order 2 on ℝ³ and on SO(3); 2 evaluations; no start-up. Conserves nothing exactly; the energy of a
//! free body grows at large steps.

use crate::state::Rate;
use crate::stepper::{MethodInfo, Scheme, Stages, StepError, Stepper};
use crate::system::{StateOf, System};
use crate::tableau::{HEUN, Tableau};

register! {
    50 thesis => Heun: Heun, any;
    250 => HeunL: Heun, momentum("heun_l", "Heun's method, angular momentum");
}

/// Heun's method.
#[derive(Debug, Clone, Copy, Default)]
pub struct Heun;

impl Scheme for Heun {
    const INFO: MethodInfo = MethodInfo::explicit(
        "heun",
        "Heun's method",
        "K. Heun, Z. Math. Phys. 45 (1900) 23; Aguilar Mayans, algorithm 9",
        2,
    );

    fn on_vectors(&self) -> Option<Tableau> {
        Some(Tableau::of(&HEUN))
    }
}

impl<S: System> Stepper<S> for Heun {
    type Memory = Stages<S, 2>;

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
        let ([v1, v2], [a1, a2]) = (&mut m.velocities, &mut m.accelerations);
        let (mut v1, mut v2, mut a1, mut a2) = (v1.lend(), v2.lend(), a1.lend(), a2.lend());
        let mut ahead = m.stage.lend();
        system.velocity(&mut m.workspace, t, x, &mut v1);
        system.acceleration(&mut m.workspace, t, x, &mut a1);
        ahead.assign(x);
        ahead.drift(&v1, h);
        ahead.kick(&a1, h);
        system.velocity(&mut m.workspace, t + h, &ahead, &mut v2);
        system.acceleration(&mut m.workspace, t + h, &ahead, &mut a2);
        v1.axpy(1.0, &v2);
        a1.axpy(1.0, &a2);
        out.assign(x);
        out.drift(&v1, 0.5 * h);
        out.kick(&a1, 0.5 * h);
        Ok(())
    }
}
