//! Implicit midpoint method on the group.
//!
//! ```text
//! q_m = exp(h v_m/2) qₙ,   p_m = pₙ + h a_m/2,   v_m = velocity(t + h/2, q_m, p_m),   a_m = acceleration(t + h/2, q_m, p_m),
//! q₊ = exp(h v_m) qₙ,      p₊ = pₙ + h a_m
//! ```
//! by fixed-point iteration to round-off, from an explicit half step. Round-off is where changes stop falling and are
//! small against the unknowns, or move nothing by a rounding of the configuration, as those of a body at rest.
//!
//! Order 2 on ℝ³ and on SO(3), symmetric: a step of −h takes a step of h back. No start-up; one
//! evaluation per iteration, a dozen or so of them at usual steps. A step of a free body that turns by θ in it is off by
//! 0.12 θ³ rad at most; a turn of more than 1.5 rad is a typed error. On ℝ³ it is symplectic and keeps
//! quadratic invariants; the energy of a free body does not drift. Not where an explicit
//! method will do, nor for stiff forces: the iteration contracts only for steps below 2/L, with L the
//! Lipschitz constant of the equations.
//!
//! E. Hairer, C. Lubich and G. Wanner, *Geometric Numerical Integration* (2006), II.1.3, IV.8 and VIII.6.
//!
//! # Deviations
//! None.

use crate::iteration::is_rounding;
use crate::scratch::Scratch;
use crate::state::{Configuration, ErrorSum, Rate, Tolerances};
use crate::stepper::{MethodInfo, Scheme, Stages, StepError, Stepper};
use crate::system::{RateOf, StateOf, System};

register! {
    390 => Imid: ImplicitMidpoint, any;
}

/// Implicit midpoint method.
#[derive(Debug, Clone, Copy, Default)]
pub struct ImplicitMidpoint;

impl Scheme for ImplicitMidpoint {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 1,
        implicit: true,
        angle_limit: Some(1.5),
        conserves: "symmetry; quadratic invariants on ℝ³",
        limitations: "unsuitable for stiff forces, for which its iteration does not converge, and steps in which a body turns by more than 1.5 rad: \
                  both are refused",
        ..MethodInfo::explicit(
            "imid",
            "Implicit midpoint method",
            "E. Hairer, C. Lubich and G. Wanner, Geometric Numerical Integration (2006), IV.8",
            2,
        )
    };
}

/// Iterations after which the step counts as too large.
const MAX_ITERATIONS: usize = 100;
/// Changes no longer falling are taken for round-off below this, relative to the unknowns.
const ROUND_OFF: f64 = 1e-11;
/// A change below this cannot matter.
const NEGLIGIBLE: f64 = 1e-17;
/// Iterations without a smaller change after which what moves no body by a rounding is taken for round-off. A mode that
/// contracts at all alternates between velocities and accelerations, so that a pair of iterations may gain nothing.
const PATIENCE: usize = 6;

/// Room for the iteration, and the configuration at the start, whose size counts for what is a rounding.
pub struct ImplicitMemory<S: System> {
    stages: Stages<S, 2>,
    changes: [Scratch<RateOf<S>>; 2],
    began: S::Configuration,
}

impl<S: System> Stepper<S> for ImplicitMidpoint {
    type Memory = ImplicitMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok(ImplicitMemory {
            stages: Stages::new(system, x),
            changes: std::array::from_fn(|_| Scratch::like(&x.rate)),
            began: x.configuration.clone(),
        })
    }

    // as a call a step takes 6 % longer: its states go through memory
    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        // Each vector is measured by itself; the first change of one that starts from zero is infinite.
        const BY_SIZE: Tolerances = Tolerances { relative: 1.0, absolute: 1e-140 };
        let ImplicitMemory { stages: m, changes: [first, second], began } = memory;
        let ([v, v_next], [a, a_next]) = (&mut m.velocities, &mut m.accelerations);
        let (mut v, mut v_next, mut a, mut a_next) = (v.lend(), v_next.lend(), a.lend(), a_next.lend());
        let (mut middle, mut move_by, mut change_by) = (m.stage.lend(), first.lend(), second.lend());
        system.velocity(&mut m.workspace, t, x, &mut v);
        system.acceleration(&mut m.workspace, t, x, &mut a);
        let (mut iterations, mut last) = (0, f64::INFINITY);
        let (mut least, mut since_least) = (f64::INFINITY, 0);
        loop {
            iterations += 1;
            middle.assign(x);
            middle.drift(&v, 0.5 * h);
            middle.kick(&a, 0.5 * h);
            system.velocity(&mut m.workspace, t + 0.5 * h, &middle, &mut v_next);
            system.acceleration(&mut m.workspace, t + 0.5 * h, &middle, &mut a_next);
            move_by.assign(&v_next);
            move_by.axpy(-1.0, &v);
            move_by.scale(0.5 * h);
            change_by.assign(&a_next);
            change_by.axpy(-1.0, &a);
            change_by.scale(0.5 * h);
            v.assign(&v_next);
            a.assign(&a_next);
            let mut sum = ErrorSum::default();
            x.configuration.weigh_all(&middle.configuration, &move_by, &BY_SIZE, &mut sum);
            x.rate.weigh_all(&middle.rate, &change_by, &BY_SIZE, &mut sum);
            let change = sum.root_mean_square();
            // Round-off is reached when the changes stop falling.
            if change <= NEGLIGIBLE || (change >= last && change <= ROUND_OFF) {
                break;
            }
            since_least = if change < least { 0 } else { since_least + 1 };
            least = least.min(change);
            if since_least >= PATIENCE {
                change_by.scale(h);
                // It contracts for h² ‖∂a/∂q‖ < 4, so that a rounding of q moves a velocity by 4 roundings over h at most.
                if is_rounding(&middle.configuration, began, [&*move_by, &*change_by]) {
                    break;
                }
            }
            if iterations == MAX_ITERATIONS && change <= ROUND_OFF {
                // Still falling.
                break;
            }
            if change.is_nan() || iterations == MAX_ITERATIONS {
                return Err(StepError::NotConverged {
                    method: Self::INFO.name,
                    t,
                    iterations,
                    residual: change,
                });
            }
            last = change;
        }
        Self::check_angle(t, h, v.angle())?;
        out.assign(x);
        out.drift(&v, h);
        out.kick(&a, h);
        Ok(())
    }
}
