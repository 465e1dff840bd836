//! Runge–Kutta–Munthe-Kaas method of order 4, thesis (5.22)–(5.29), algorithm 16.
//!
//! The stages of the classic Runge–Kutta method, with two commutators that make up for rotations not
//! commuting: the third stage moves by h v₂/2 − h²[v₁, v₂]/8, and
//! q₊ = exp(h (v₁ + 2v₂ + 2v₃ + v₄)/6 − h²[v₁, v₄]/12) qₙ.
//!
//! Order 4 on ℝ³ and on SO(3); 4 evaluations; no start-up. Conserves nothing exactly; the energy of a
//! free body drifts as h⁴. The default for smooth motions; its body-frame twin is cheaper.
//!
//! # Deviations
//! Line 22 of algorithm 16 multiplies by Rₙ once too often; line 23 does it.

use crate::state::Rate;
use crate::stepper::{MethodInfo, Scheme, Stages, StepError, Stepper};
use crate::system::{RateOf, StateOf, System};
use crate::tableau::{ButcherTableau, RUNGE_KUTTA_4, Tableau};

register! {
    130 thesis => Rkmk: RungeKuttaMuntheKaas4, any;
    290 => RkmkL: RungeKuttaMuntheKaas4, momentum("rkmk_l", "Runge-Kutta-Munthe-Kaas, angular momentum");
    300 => RkmkB: RungeKuttaMuntheKaas4, body("rkmk_b", "Runge-Kutta-Munthe-Kaas, body frame");
}

/// Runge–Kutta–Munthe-Kaas method of order 4.
#[derive(Debug, Clone, Copy, Default)]
pub struct RungeKuttaMuntheKaas4;

impl Scheme for RungeKuttaMuntheKaas4 {
    const INFO: MethodInfo = MethodInfo::explicit(
        "rkmk",
        "Runge-Kutta-Munthe-Kaas",
        "H. Munthe-Kaas, BIT 38 (1998) 92; Aguilar Mayans, algorithm 16",
        4,
    );

    fn on_vectors(&self) -> Option<Tableau> {
        Some(Tableau::of(&RUNGE_KUTTA_4))
    }
}

impl<S: System> Stepper<S> for RungeKuttaMuntheKaas4 {
    type Memory = (Stages<S, 4>, crate::scratch::Scratch<RateOf<S>>);

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok((Stages::new(system, x), crate::scratch::Scratch::like(&x.rate)))
    }

    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        (m, displacement): &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let ([v1, v2, v3, v4], [a1, a2, a3, a4]) = (&mut m.velocities, &mut m.accelerations);
        let (mut v1, mut v2, mut v3, mut v4) = (v1.lend(), v2.lend(), v3.lend(), v4.lend());
        let (mut a1, mut a2, mut a3, mut a4) = (a1.lend(), a2.lend(), a3.lend(), a4.lend());
        let (mut stage, mut u) = (m.stage.lend(), displacement.lend());
        let ButcherTableau { nodes, rows, weights } = RUNGE_KUTTA_4;
        system.velocity(&mut m.workspace, t, x, &mut v1);
        system.acceleration(&mut m.workspace, t, x, &mut a1);
        stage.assign(x);
        stage.drift(&v1, rows[1][0] * h);
        stage.kick(&a1, rows[1][0] * h);
        system.velocity(&mut m.workspace, t + nodes[1] * h, &stage, &mut v2);
        system.acceleration(&mut m.workspace, t + nodes[1] * h, &stage, &mut a2);
        u.assign(&v2);
        u.add_bracket(-0.25 * h, &v1, &v2);
        stage.assign(x);
        stage.drift(&u, rows[2][1] * h);
        stage.kick(&a2, rows[2][1] * h);
        system.velocity(&mut m.workspace, t + nodes[2] * h, &stage, &mut v3);
        system.acceleration(&mut m.workspace, t + nodes[2] * h, &stage, &mut a3);
        stage.assign(x);
        stage.drift(&v3, rows[3][2] * h);
        stage.kick(&a3, rows[3][2] * h);
        system.velocity(&mut m.workspace, t + nodes[3] * h, &stage, &mut v4);
        system.acceleration(&mut m.workspace, t + nodes[3] * h, &stage, &mut a4);
        // The first numerator is one.
        u.assign(&v1);
        u.axpy(weights.numerators[1], &v2);
        u.axpy(weights.numerators[2], &v3);
        u.axpy(weights.numerators[3], &v4);
        u.add_bracket(-0.5 * h, &v1, &v4);
        a1.axpy(weights.numerators[1], &a2);
        a1.axpy(weights.numerators[2], &a3);
        a1.axpy(weights.numerators[3], &a4);
        out.assign(x);
        out.drift(&u, h / weights.denominator);
        out.kick(&a1, h / weights.denominator);
        Ok(())
    }
}
