//! Classic fourth-order Runge–Kutta method, thesis 5.2.3, algorithm 10.
//!
//! Four stages (v_i, a_i) at 0, h/2, h/2, h; q₊ = exp(h (v₁ + 2v₂ + 2v₃ + v₄)/6) qₙ, likewise v₊.
//!
//! Order 4 on ℝ³ but only 2 on SO(3): the stages are added as if rotations commuted (Buss 2000). With
//! the commutators it is `rkmk`, at the same number of evaluations; there is no reason to rotate with
//! this one. 4 evaluations; no start-up.

use crate::state::Rate;
use crate::stepper::{MethodInfo, Orders, Scheme, Stages, StepError, Stepper};
use crate::system::{StateOf, System};
use crate::tableau::{ButcherTableau, RUNGE_KUTTA_4, Tableau};

register! {
    60 thesis => Rk4: RungeKutta4, any;
    260 => Rk4L: RungeKutta4, momentum("rk4_l", "Classic fourth order Runge-Kutta, angular momentum");
}

/// Classic fourth-order Runge–Kutta method.
#[derive(Debug, Clone, Copy, Default)]
pub struct RungeKutta4;

impl Scheme for RungeKutta4 {
    const INFO: MethodInfo = MethodInfo {
        orders: Orders::split(4, 2),
        rate_orders: Orders::split(4, 2),
        limitations: "unsuitable for rotations to an accuracy: order 2 on SO(3), and on ℝ³ where forces depend on the orientation",
        ..MethodInfo::explicit(
            "rk4",
            "Classic fourth order Runge-Kutta",
            "W. Kutta, Z. Math. Phys. 46 (1901) 435; S. R. Buss, J. Comput. Phys. 164 (2000) 377; \
             Aguilar Mayans, algorithm 10",
            4,
        )
    };

    fn on_vectors(&self) -> Option<Tableau> {
        Some(Tableau::of(&RUNGE_KUTTA_4))
    }
}

impl<S: System> Stepper<S> for RungeKutta4 {
    type Memory = Stages<S, 4>;

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
        let ([v1, v2, v3, v4], [a1, a2, a3, a4]) = (&mut m.velocities, &mut m.accelerations);
        let (mut v1, mut v2, mut v3, mut v4) = (v1.lend(), v2.lend(), v3.lend(), v4.lend());
        let (mut a1, mut a2, mut a3, mut a4) = (a1.lend(), a2.lend(), a3.lend(), a4.lend());
        let mut stage = m.stage.lend();
        let ButcherTableau { nodes, rows, weights } = RUNGE_KUTTA_4;
        system.velocity(&mut m.workspace, t, x, &mut v1);
        system.acceleration(&mut m.workspace, t, x, &mut a1);
        stage.assign(x);
        stage.drift(&v1, rows[1][0] * h);
        stage.kick(&a1, rows[1][0] * h);
        system.velocity(&mut m.workspace, t + nodes[1] * h, &stage, &mut v2);
        system.acceleration(&mut m.workspace, t + nodes[1] * h, &stage, &mut a2);
        stage.assign(x);
        stage.drift(&v2, rows[2][1] * h);
        stage.kick(&a2, rows[2][1] * h);
        system.velocity(&mut m.workspace, t + nodes[2] * h, &stage, &mut v3);
        system.acceleration(&mut m.workspace, t + nodes[2] * h, &stage, &mut a3);
        stage.assign(x);
        stage.drift(&v3, rows[3][2] * h);
        stage.kick(&a3, rows[3][2] * h);
        system.velocity(&mut m.workspace, t + nodes[3] * h, &stage, &mut v4);
        system.acceleration(&mut m.workspace, t + nodes[3] * h, &stage, &mut a4);
        // The first numerator is one.
        v1.axpy(weights.numerators[1], &v2);
        v1.axpy(weights.numerators[2], &v3);
        v1.axpy(weights.numerators[3], &v4);
        a1.axpy(weights.numerators[1], &a2);
        a1.axpy(weights.numerators[2], &a3);
        a1.axpy(weights.numerators[3], &a4);
        out.assign(x);
        out.drift(&v1, h / weights.denominator);
        out.kick(&a1, h / weights.denominator);
        Ok(())
    }
}
