//! Euler's method, thesis (5.1), algorithm 5.
//!
//! q₊ = exp(h vₙ) qₙ, v₊ = vₙ + h aₙ.
//!
//! Order 1 on ℝ³ and on SO(3); 1 evaluation; no start-up. Conserves nothing; the rotational energy of
//! a free body never grows (Table 6.3). Not for anything but comparison.

use crate::state::{Configuration, Rate};
use crate::stepper::{MethodInfo, Scheme, Stages, StepError, Stepper};
use crate::system::{StateOf, System};
use crate::tableau::{EULER, Tableau};

register! {
    10 thesis => Euler: Euler, any;
    220 => EulerL: Euler, momentum("euler_l", "Euler's method, angular momentum");
}

/// Euler's method.
#[derive(Debug, Clone, Copy, Default)]
pub struct Euler;

impl Scheme for Euler {
    const INFO: MethodInfo = MethodInfo {
        limitations: "unsuitable for anything but comparison",
        ..MethodInfo::explicit(
            "euler",
            "Euler's method",
            "L. Euler, Institutionum calculi integralis I (1768); Aguilar Mayans, algorithm 5",
            1,
        )
    };

    fn on_vectors(&self) -> Option<Tableau> {
        Some(Tableau::of(&EULER.on_vectors))
    }
}

impl<S: System> Stepper<S> for Euler {
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
        system.velocity(&mut m.workspace, t, x, &mut v);
        system.acceleration(&mut m.workspace, t, x, &mut a);
        out.configuration.assign(&x.configuration);
        out.drift(&v, h);
        out.rate.assign(&x.rate);
        out.kick(&a, h);
        Ok(())
    }
}
