//! Semi-implicit Euler with the gyroscopic term taken implicitly, thesis 6.2 after LaCoursière.
//!
//! (I − h (Iωₙ)^) ω₊ = I ωₙ + h Mₙ in the frame of the body at the start of the step, then
//! q₊ = exp(h v₊) qₙ. The bracket is the linear part of I(ω₊ − ωₙ) = h (M − ω₊ × Iωₙ).
//!
//! Order 1 on ℝ³ and on SO(3); 1 evaluation and a 3 × 3 solve; no start-up. Without torque the energy
//! never grows: taking the product with ω₊ removes the bracket, and ω₊ᵀIω₊ = ω₊ᵀIωₙ bounds the one by
//! the other (Cauchy–Schwarz). It is damped instead, which is why physics engines use it. A step of a free body is
//! off by 0.19 θ² rad at most, θ = h √(2T/I_min) the angle at the fastest it can turn with its kinetic energy T;
//! its equation has a solution however large that is.

use crate::augmented::advance;
use crate::state::{Configuration, Poses, Twist};
use crate::stepper::{MethodInfo, Scheme, Scope, StepError, Stepper};
use crate::system::{RateOf, RigidSystem, StateOf};
use somersault_core::lie::so3;

register! {
    210 => Sieg: SemiImplicitEulerGyroscopic, world;
}

/// Semi-implicit Euler with implicit gyroscopic term.
#[derive(Debug, Clone, Copy, Default)]
pub struct SemiImplicitEulerGyroscopic;

impl Scheme for SemiImplicitEulerGyroscopic {
    const INFO: MethodInfo = MethodInfo {
        scope: Scope::RigidBodies,
        conserves: "the energy of a free body never grows",
        limitations: "unsuitable for accuracy: it damps",
        ..MethodInfo::explicit(
            "sieg",
            "Semi-implicit Euler, implicit gyroscopic term",
            "C. Lacoursière, Stabilizing gyroscopic forces in rigid multibody simulations, UMINF 06.05 (2006)",
            1,
        )
    };
}

impl<S: RigidSystem> Stepper<S> for SemiImplicitEulerGyroscopic {
    type Memory = RateOf<S>;

    fn start(&self, _: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok(x.rate.clone())
    }

    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        wrenches: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        system.wrenches(t, x, wrenches);
        for i in 0..x.configuration.count() {
            let body = system.body(i);
            let (pose, twist) = (x.configuration.pose(i), S::Configuration::twist(&x.rate, i));
            let wrench = S::Configuration::twist(wrenches, i);
            let r = pose.orientation.to_rotation_matrix().into_inner();
            let momentum = body.inertia().momentum(&r.tr_mul(&twist.angular));
            // I − h L̂ has a positive definite symmetric part, so that the solution exists.
            let matrix = body.inertia().tensor() - so3::hat(&momentum) * h;
            let omega = solve(&matrix, &(momentum + r.tr_mul(&wrench.angular) * h));
            let rate = Twist { linear: twist.linear + wrench.linear * (h / body.mass()), angular: r * omega };
            let mut next = pose;
            next.drift(&rate, h);
            out.configuration.set_pose(i, next);
            S::Configuration::set_twist(&mut out.rate, i, rate);
        }
        advance::<S::Configuration>(&x.rate, &[(h, wrenches)], &mut out.rate);
        Ok(())
    }
}

/// Solves a 3 × 3 system by Cramer's rule, for matrices known to be regular.
fn solve(m: &nalgebra::Matrix3<f64>, b: &nalgebra::Vector3<f64>) -> nalgebra::Vector3<f64> {
    let [x, y, z] = [m.column(0), m.column(1), m.column(2)];
    let yz = y.cross(&z);
    nalgebra::Vector3::new(b.dot(&yz), x.dot(&b.cross(&z)), x.dot(&y.cross(b))) / x.dot(&yz)
}
