//! Runge–Kutta–Munthe-Kaas methods from a Butcher tableau: `rkmk3`, `rkmk5`, `rkmk8`, and your own.
//!
//! ```text
//! u_i = h Σ_{j<i} a_ij K_j,   q_i = exp(u_i) qₙ,   p_i = pₙ + h Σ_{j<i} a_ij A_j,
//! K_i = dexp⁻¹_{u_i}(velocity(tₙ + c_i h, q_i, p_i)), A_i = acceleration(tₙ + c_i h, q_i, p_i),
//! q₊ = exp(h Σ b_i K_i) qₙ,                        p₊ = pₙ + h Σ b_i A_i
//! ```
//! The order of the tableau, on ℝ³ and on SO(3): in the algebra it is an ordinary Runge–Kutta method,
//! and dexp⁻¹ is taken in closed form. No start-up. Conserves nothing exactly, beyond what is linear in
//! the variables (angular momentum in [`crate::system::MomentumForm`]).
//!
//! | Name | Tableau | Evaluations | Estimate | Dense output |
//! |---|---|---|---|---|
//! | `rkmk3` | Bogacki–Shampine | 3 (the last of 4 is the next step's first) | order 2 | order 3 |
//! | `rkmk5` | Dormand–Prince | 6 (the last of 7 is the next step's first) | order 4 | order 4 |
//! | `rkmk8` | DOP853 | 12 | orders 5 and 3 combined, as 7 | order 7, 4 evaluations more |
//!
//! All three estimate their error and can adapt the step. `rkmk8` is the method for small tolerances,
//! `rkmk5` for 1e-3 to 1e-7. Not for a step in which the body turns by 2π or more, where dexp⁻¹ is
//! singular, nor for very long runs in which energy must not drift. The body-frame twins (`rkmk3_b`,
//! `rkmk5_b`, `rkmk8_b`) are cheaper and, about an unstable axis, more accurate.
//!
//! H. Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; sources of the tableaux at [`crate::tableau`].
//!
//! # Deviations
//! None in the formulas. dexp⁻¹ is exact where the source truncates its series at the order.

use crate::dense::{Interpolant, Segment};
use crate::scratch::Scratch;
use crate::state::{Configuration, Rate, State, Tolerances};
use crate::stepper::{EmbeddedStepper, MethodInfo, Scheme, StepError, Stepper, weighed_error};
use crate::system::{RateOf, StateOf, System};
use crate::tableau::{self, DenseWeights, ErrorWeights, Tableau};

register! {
    310 => Rkmk3: RungeKuttaMuntheKaas<BogackiShampine>, any, embedded;
    320 => Rkmk5: RungeKuttaMuntheKaas<DormandPrince>, any, embedded;
    330 => Rkmk8: RungeKuttaMuntheKaas<Dop853>, any, embedded;
    340 => Rkmk3B: RungeKuttaMuntheKaas<BogackiShampine>,
        body("rkmk3_b", "Runge-Kutta-Munthe-Kaas 3(2), body frame"), embedded;
    350 => Rkmk5B: RungeKuttaMuntheKaas<DormandPrince>,
        body("rkmk5_b", "Runge-Kutta-Munthe-Kaas 5(4), body frame"), embedded;
    360 => Rkmk8B: RungeKuttaMuntheKaas<Dop853>,
        body("rkmk8_b", "Runge-Kutta-Munthe-Kaas 8(5,3), body frame"), embedded;
}

/// The coefficients of a Runge–Kutta–Munthe-Kaas method and what is known of it.
///
/// Implement it for a user-defined type to make a method of a user-defined tableau.
pub trait Coefficients {
    /// The description of the method.
    const INFO: MethodInfo;
    /// Stages, nodes and weights.
    fn tableau(&self) -> &Tableau;
    /// The curve between the ends of a step; without one it is the cubic Hermite interpolant.
    fn dense(&self) -> Option<&DenseWeights> {
        None
    }
}

/// Coefficients with an error estimate, whose order `INFO.embedded` says.
pub trait EmbeddedCoefficients: Coefficients {
    /// The estimate.
    fn error(&self) -> &ErrorWeights;
}

/// Runge–Kutta–Munthe-Kaas method with the coefficients `T`.
#[derive(Debug, Clone, Copy, Default)]
pub struct RungeKuttaMuntheKaas<T>(pub T);

macro_rules! built_in {
    ($(#[$doc:meta])* $name:ident, $pair:ident, $info:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, Default)]
        pub struct $name;

        impl Coefficients for $name {
            const INFO: MethodInfo = MethodInfo {
                limitations: "unsuitable for very long runs in which energy must not drift; a turn of 2π or more in a step",
                ..$info
            };
            #[inline]
            fn tableau(&self) -> &Tableau {
                &tableau::$pair.tableau
            }
            fn dense(&self) -> Option<&DenseWeights> {
                Some(&tableau::$pair.dense)
            }
        }

        impl EmbeddedCoefficients for $name {
            fn error(&self) -> &ErrorWeights {
                &tableau::$pair.error
            }
        }
    };
}

built_in! {
    /// The pair of orders 3 and 2 of Bogacki and Shampine.
    BogackiShampine, BOGACKI_SHAMPINE,
    MethodInfo {
        embedded: Some(2),
        ..MethodInfo::explicit(
            "rkmk3",
            "Runge-Kutta-Munthe-Kaas 3(2), Bogacki-Shampine",
            "H. Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; P. Bogacki and L. F. Shampine, Appl. Math. Lett. 2 (1989) 321",
            3,
        )
    }
}

built_in! {
    /// The pair of orders 5 and 4 of Dormand and Prince.
    DormandPrince, DORMAND_PRINCE,
    MethodInfo {
        evaluations: 6,
        embedded: Some(4),
        dense_order: 5,
        ..MethodInfo::explicit(
            "rkmk5",
            "Runge-Kutta-Munthe-Kaas 5(4), Dormand-Prince",
            "H. Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; J. R. Dormand and P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19",
            5,
        )
    }
}

built_in! {
    /// The method of order 8 of Dormand and Prince with Hairer's estimates.
    Dop853, DOP853,
    MethodInfo {
        evaluations: 12,
        embedded: Some(7),
        dense_order: 8,
        ..MethodInfo::explicit(
            "rkmk8",
            "Runge-Kutta-Munthe-Kaas 8(5,3), DOP853",
            "H. Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; E. Hairer, S. P. Nørsett and G. Wanner, \
             Solving Ordinary Differential Equations I (1993), II.5",
            8,
        )
    }
}

/// Velocity, carried to the algebra at the start of the step, and acceleration at one stage.
#[derive(Debug, Clone)]
struct Slope<V> {
    velocity: V,
    acceleration: V,
}

/// Where the acceleration at the start of the next step is, if it is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Known {
    /// Nowhere: it must be evaluated.
    Nowhere,
    /// In the first slope: the step before was rejected.
    AtStart,
    /// In the slope at the end of the step before.
    AtEnd,
}

/// Slopes of the step just made, and room to work in.
pub struct TableauMemory<S: System> {
    workspace: S::Workspace,
    stage: Scratch<StateOf<S>>,
    displacement: Scratch<RateOf<S>>,
    sum: Scratch<RateOf<S>>,
    slopes: Vec<Slope<RateOf<S>>>,
    first: Known,
}

impl<T: Coefficients> Scheme for RungeKuttaMuntheKaas<T> {
    const INFO: MethodInfo = T::INFO;

    fn on_vectors(&self) -> Option<Tableau> {
        Some(self.0.tableau().clone())
    }
}

/// Index of the slope at the end of the step.
fn end_of(tableau: &Tableau) -> usize {
    tableau.stages() - usize::from(tableau.first_same_as_last())
}

/// Adds h Σ a_j K_j to the first of a pair and h Σ a_j A_j to the second, for the slopes of a row.
#[inline(always)]
fn add_slopes<V: Rate>(sums: [&mut V; 2], row: &[(usize, f64)], slopes: &[Slope<V>], h: f64) {
    let [velocities, accelerations] = sums;
    velocities.add_sum(row.iter().map(|&(j, a)| (h * a, &slopes[j].velocity)));
    accelerations.add_sum(row.iter().map(|&(j, a)| (h * a, &slopes[j].acceleration)));
}

/// Moves the rate of `stage` from that of `x` by the slopes of a row, p = pₙ + h Σ a_j A_j, and finds the displacement that leads to
/// its configuration, u = h Σ a_j K_j.
#[inline(always)]
fn displace<Q: Configuration>(
    row: &[(usize, f64)],
    slopes: &[Slope<Q::Rate>],
    x: &State<Q>,
    h: f64,
    u: &mut Q::Rate,
    stage: &mut State<Q>,
) {
    u.set_zero();
    stage.rate.assign(&x.rate);
    add_slopes([u, &mut stage.rate], row, slopes, h);
}

/// Moves `stage`, which starts at `x`, by the slopes of a row: u = h Σ a_j K_j, p = pₙ + h Σ a_j A_j.
#[inline(always)]
fn advance<Q: Configuration>(
    row: &[(usize, f64)],
    slopes: &[Slope<Q::Rate>],
    x: &State<Q>,
    h: f64,
    u: &mut Q::Rate,
    stage: &mut State<Q>,
) {
    displace(row, slopes, x, h, u, stage);
    stage.configuration.assign(&x.configuration);
    stage.configuration.drift(u, 1.0);
}

/// The slope at a stage displaced by u.
#[inline(always)]
fn evaluate<S: System>(
    system: &S,
    workspace: &mut S::Workspace,
    t: f64,
    stage: &StateOf<S>,
    u: &RateOf<S>,
    slope: &mut Slope<RateOf<S>>,
) {
    system.velocity(workspace, t, stage, &mut slope.velocity);
    slope.velocity.dexp_inv(u);
    system.acceleration(workspace, t, stage, &mut slope.acceleration);
}

impl<S: System, T: Coefficients> Stepper<S> for RungeKuttaMuntheKaas<T> {
    type Memory = TableauMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        let extra = self.0.dense().map_or(0, |dense| dense.extra.len());
        let slope = Slope { velocity: x.rate.clone(), acceleration: x.rate.clone() };
        Ok(TableauMemory {
            workspace: system.workspace(),
            stage: Scratch::like(x),
            displacement: Scratch::like(&x.rate),
            sum: Scratch::like(&x.rate),
            slopes: vec![slope; end_of(self.0.tableau()) + 1 + extra],
            first: Known::Nowhere,
        })
    }

    fn restart(&self, memory: &mut Self::Memory) {
        memory.first = Known::Nowhere;
    }

    #[inline]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let tableau = self.0.tableau();
        let TableauMemory { workspace, stage, displacement, slopes, first, .. } = m;
        let (mut stage, mut u) = (stage.lend(), displacement.lend());
        match *first {
            Known::Nowhere => system.acceleration(workspace, t, x, &mut slopes[0].acceleration),
            Known::AtStart => {}
            Known::AtEnd => slopes.swap(0, end_of(tableau)),
        }
        system.velocity(workspace, t, x, &mut slopes[0].velocity);
        let end = end_of(tableau);
        let is_configuration_read = system.depends_on_configuration();
        for i in 1..end {
            let (known, rest) = slopes.split_at_mut(i);
            displace(tableau.row(i), known, x, h, &mut u, &mut stage);
            if is_configuration_read {
                stage.configuration.assign(&x.configuration);
                stage.configuration.drift(&u, 1.0);
            }
            evaluate(system, workspace, t + tableau.node(i) * h, &stage, &u, &mut rest[0]);
        }
        // the stage of a slope at the end of the step is the end of the step itself
        let (known, rest) = slopes.split_at_mut(end);
        advance(tableau.weights(), known, x, h, &mut u, out);
        *first = if tableau.first_same_as_last() {
            evaluate(system, workspace, t + tableau.node(end) * h, out, &u, &mut rest[0]);
            Known::AtEnd
        } else {
            Known::Nowhere
        };
        Ok(())
    }

    fn segment(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        after: &StateOf<S>,
    ) -> Box<dyn Interpolant<S::Configuration>> {
        let tableau = self.0.tableau();
        let Some(dense) = self.0.dense() else {
            return Box::new(Segment::hermite(system, t, x, h, after));
        };
        let TableauMemory { workspace, stage, displacement, slopes, first, .. } = m;
        let (mut stage, mut u) = (stage.lend(), displacement.lend());
        let end = end_of(tableau);
        let mut total = x.rate.clone();
        advance(tableau.weights(), slopes, x, h, &mut total, &mut stage);
        if !dense.extra.is_empty() {
            evaluate(system, workspace, t + h, after, &total, &mut slopes[end]);
            *first = Known::AtEnd;
            for (i, (node, row)) in dense.extra.iter().enumerate() {
                let (known, rest) = slopes.split_at_mut(end + 1 + i);
                advance(row, known, x, h, &mut u, &mut stage);
                evaluate(system, workspace, t + node * h, &stage, &u, &mut rest[0]);
            }
        }
        let curve = |part: fn(&Slope<RateOf<S>>) -> &RateOf<S>, total: &RateOf<S>| {
            let mut powers: Vec<RateOf<S>> = dense
                .powers
                .iter()
                .map(|row| {
                    let mut sum = total.clone();
                    sum.set_zero();
                    row.iter().for_each(|&(j, p)| sum.axpy(h * p, part(&slopes[j])));
                    sum
                })
                .collect();
            // The coefficients of the slopes are large and cancel; what that leaves at the end is removed.
            let mut rest = total.clone();
            powers.iter().for_each(|p| rest.axpy(-1.0, p));
            if let Some(first) = powers.first_mut() {
                first.axpy(1.0, &rest);
            }
            powers
        };
        let displacement = curve(|slope| &slope.velocity, &total);
        let mut jump = after.rate.clone();
        jump.axpy(-1.0, &x.rate);
        let change = curve(|slope| &slope.acceleration, &jump);
        Box::new(Segment { t, h, start: x.clone(), displacement, change })
    }
}

/// The error that the weights of a row estimate, weighed by the tolerances; inlined twice, for sizes that are computed once.
#[inline(always)]
fn weighed<Q: Configuration>(
    row: &[(usize, f64)],
    slopes: &[Slope<Q::Rate>],
    x: &State<Q>,
    after: &State<Q>,
    h: f64,
    [of_configuration, of_rate]: &mut [&mut Q::Rate; 2],
    tolerances: &Tolerances,
) -> f64 {
    of_configuration.set_zero();
    of_rate.set_zero();
    add_slopes([&mut **of_configuration, &mut **of_rate], row, slopes, h);
    weighed_error(x, after, of_configuration, of_rate, tolerances)
}

impl<S: System, T: EmbeddedCoefficients> EmbeddedStepper<S> for RungeKuttaMuntheKaas<T> {
    #[inline]
    fn error(
        &self,
        x: &StateOf<S>,
        after: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        tolerances: &Tolerances,
    ) -> f64 {
        let TableauMemory { displacement, sum, slopes, .. } = m;
        let (mut of_configuration, mut of_rate) = (displacement.lend(), sum.lend());
        let mut errors = [&mut *of_configuration, &mut *of_rate];
        let weights = self.0.error();
        let main = weighed(&weights.main, slopes, x, after, h, &mut errors, tolerances);
        match &weights.correction {
            // Hairer's combination, of order 7 where the two are of orders 5 and 3.
            Some(correction) if main > 0.0 => {
                let correction = weighed(correction, slopes, x, after, h, &mut errors, tolerances);
                let ratio = 0.1 * correction / main;
                main / (1.0 + ratio * ratio).sqrt()
            }
            _ => main,
        }
    }

    fn reject(&self, memory: &mut Self::Memory) {
        memory.first = Known::AtStart;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::RigidBody;
    use crate::driver::{Adaptive, Steps};
    use crate::force::{BoxedForce, ConstantTorque};
    use crate::run::Run;
    use crate::state::RigidBodyState;
    use crate::system::{BodyForm, Form, RigidBodySystem};
    use nalgebra::Vector3;

    /// The stages of a free body in body axes have no orientation; a torque of zero makes them have it.
    #[test]
    fn a_free_body_moves_as_under_a_torque_of_zero_bit_for_bit() {
        let body = RigidBody::try_box(1.0, Vector3::new(0.2, 0.4, 0.6)).unwrap();
        let start = RigidBodyState::spinning(Vector3::new(1.0, 2.0, 3.0));
        let end = |forces: Vec<BoxedForce>| {
            let system = RigidBodySystem::new(body, forces);
            let form = BodyForm(&system);
            let steps = Steps::adapted((0.0, 5.0), Adaptive::with_tolerances(1e-8, 1e-8));
            let run = Run::by_embedded_stepper(&form, &RungeKuttaMuntheKaas(Dop853), steps);
            (form.depends_on_configuration(), run.from(&form.encode(&start)).unwrap().state)
        };
        let (read, free) = end(vec![]);
        let (read_under_torque, pushed) = end(vec![Box::new(ConstantTorque::Body(Vector3::zeros()))]);
        assert!(!read && read_under_torque);
        assert_eq!(free, pushed);
    }
}
