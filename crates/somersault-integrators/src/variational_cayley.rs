//! The increment of the variational (Hamilton–Pontryagin) Lie–Verlet step with the Cayley map.
//!
//! The discrete action Σ h (½ ξ·I ξ − V(R)) with R₊ = R cay(h ξ) has the stationarity conditions
//! ```text
//! L + (h/2) M = I ξ + (h/2) ξ × I ξ + (h²/4)(ξ·I ξ) ξ,
//! L₊ − (h/2) M₊ = I ξ − (h/2) ξ × I ξ + (h²/4)(ξ·I ξ) ξ,
//! ```
//! L and the torque M in the body frame. With the Gibbs vector g = h ξ/2 of F = cay(h ξ) they are
//! ```text
//! I g + g × I g + (g·I g) g = m,    m = h L/2,                                  (a)
//! L₊ = L − (4/h) g × I g,                                                      (b)
//! ```
//! between the two half kicks; F L₊ = L holds exactly where (a) does, so world angular momentum is
//! conserved without torque, and |L| with it. The map is symplectic and of order 2. Energy is not an
//! invariant of it (the [discrete Moser–Veselov](crate::moser_veselov) step has (1 + |g|²) m on the right and
//! no cubic term, and conserves it): it stays within a band of width O(h²).
//!
//! N. Bou-Rabee, J. E. Marsden: Hamilton–Pontryagin integrators on Lie groups, part I. Found. Comput.
//! Math. 9 (2009) 197–219, the variational Lie–Verlet method.

use crate::inverse3::Inverse3;
use crate::moser_veselov::{Increment, NotConverged};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Newton iterations granted.
const MAX_ITERATIONS: u32 = 60;
/// Shortest fraction of a Newton correction tried.
const SHORTEST_FRACTION: f64 = 1e-4;

/// Solves (a) for the Gibbs vector g, given the inertia tensor, its inverse and m = h L/2.
///
/// Newton's method with the analytic Jacobian, each used twice, and corrections shortened until the next
/// one is shorter than they were. Accurate to round-off. Cost: one or two Jacobians for a step that turns
/// the body by less than half a radian. About a principal axis (a) is g (1 + g²) = m/I: unlike the discrete
/// Moser–Veselov equation it can be solved for large steps.
#[inline]
pub fn solve(
    inertia: &Matrix3<f64>,
    inverse: &Matrix3<f64>,
    impulse: &Vector3<f64>,
) -> Result<Vector3<f64>, NotConverged> {
    let u = inverse * impulse;
    // First and second order of the solution in h, bounded for large steps.
    let shortened = u * (1.0 / (1.0 + u.norm_squared()));
    let mut g = shortened - inverse * shortened.cross(&(inertia * shortened));
    for iterations in 1..=MAX_ITERATIONS {
        let jacobian = Inverse3::of(&jacobian(inertia, &g));
        let first = jacobian.times(&residual(inertia, impulse, &g));
        let (mut fraction, mut next) = (1.0, g - first);
        let mut second = jacobian.times(&residual(inertia, impulse, &next));
        // A NaN is not less either.
        while !(second.norm_squared() < (1.0 - 0.5 * fraction) * first.norm_squared()
            || first.norm_squared() <= 1e-24 * g.norm_squared())
        {
            fraction *= 0.5;
            if fraction < SHORTEST_FRACTION {
                return Err(failure(inertia, inverse, impulse, &g, iterations));
            }
            next = g - fraction * first;
            second = jacobian.times(&residual(inertia, impulse, &next));
        }
        g = if fraction == 1.0 { next - second } else { next };
        if first.norm_squared() * second.norm_squared() <= 1e-36 * g.norm_squared() {
            return Ok(g);
        }
    }
    Err(failure(inertia, inverse, impulse, &g, MAX_ITERATIONS))
}

/// The increment of a step of size `h` from body momentum `momentum_body`, which includes the first half
/// kick, in any body frame.
#[inline]
pub fn increment(
    inertia: &Matrix3<f64>,
    inverse: &Matrix3<f64>,
    momentum_body: &Vector3<f64>,
    h: f64,
) -> Result<Increment, NotConverged> {
    let g = solve(inertia, inverse, &(0.5 * h * momentum_body))?;
    let s = (1.0 / (1.0 + g.norm_squared())).sqrt();
    let rate = if h == 0.0 { 0.0 } else { -4.0 / h };
    Ok(Increment {
        rotation: UnitQuaternion::new_unchecked(Quaternion::new(s, s * g.x, s * g.y, s * g.z)),
        momentum_change: rate * g.cross(&(inertia * g)),
    })
}

/// Left minus right side of (a).
#[inline]
fn residual(inertia: &Matrix3<f64>, impulse: &Vector3<f64>, g: &Vector3<f64>) -> Vector3<f64> {
    let ig = inertia * g;
    ig + g.cross(&ig) + g.dot(&ig) * g - impulse
}

/// I + hat(g) I − hat(I g) + (g·I g) + 2 g (I g)ᵀ.
#[inline]
fn jacobian(inertia: &Matrix3<f64>, g: &Vector3<f64>) -> Matrix3<f64> {
    let ig = inertia * g;
    inertia + g.cross_matrix() * inertia - ig.cross_matrix()
        + Matrix3::from_diagonal_element(g.dot(&ig))
        + (2.0 * g) * ig.transpose()
}

#[cold]
fn failure(
    inertia: &Matrix3<f64>,
    inverse: &Matrix3<f64>,
    impulse: &Vector3<f64>,
    g: &Vector3<f64>,
    iterations: u32,
) -> NotConverged {
    NotConverged { residual: (2.0 * inverse * residual(inertia, impulse, g)).amax(), iterations }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moser_veselov::tests::{noise, random_moments};

    #[test]
    fn the_jacobian_is_the_derivative_of_the_residual() {
        let inertia = Matrix3::new(2.0, 0.1, -0.2, 0.1, 1.5, 0.3, -0.2, 0.3, 1.1);
        let g = Vector3::new(0.3, -0.5, 0.7);
        let analytic = jacobian(&inertia, &g);
        for k in 0..3 {
            let mut step = Vector3::zeros();
            step[k] = 1e-6;
            let at = |g| residual(&inertia, &Vector3::zeros(), &g);
            let difference = (at(g + step) - at(g - step)) / 2e-6;
            assert!((difference - analytic.column(k)).amax() < 1e-9);
        }
    }

    #[test]
    fn world_momentum_is_kept_to_round_off() {
        let mut random = noise(3);
        for _ in 0..10_000 {
            let moments = random_moments(&mut random, 2.0);
            let (inertia, inverse) =
                (Matrix3::from_diagonal(&moments), Matrix3::from_diagonal(&moments.map(f64::recip)));
            let momentum = moments.component_mul(&Vector3::from_fn(|_, _| random()));
            for h in [1e-8, 1e-3, 0.1, 1.0, -0.2] {
                let step = increment(&inertia, &inverse, &momentum, h).unwrap();
                let after = momentum + step.momentum_change;
                assert!(
                    (step.rotation * after - momentum).norm() <= 2e-15 * moments.max(),
                    "{h} {moments:?}"
                );
            }
        }
    }

    #[test]
    fn a_large_step_is_solved_and_joined_to_small_ones() {
        let mut random = noise(5);
        for _ in 0..2_000 {
            let moments = random_moments(&mut random, 1.0);
            let (inertia, inverse) =
                (Matrix3::from_diagonal(&moments), Matrix3::from_diagonal(&moments.map(f64::recip)));
            let impulse = 10.0 * moments.component_mul(&Vector3::from_fn(|_, _| random()));
            let found = solve(&inertia, &inverse, &impulse).unwrap();
            // Small steps in h from h = 0, by the tangent and plain Newton.
            let mut g = Vector3::zeros();
            for n in 1..=1000 {
                let target = impulse * (f64::from(n) / 1000.0);
                for _ in 0..8 {
                    g -= Inverse3::of(&jacobian(&inertia, &g)).times(&residual(&inertia, &target, &g));
                    assert!(jacobian(&inertia, &g).determinant() > 0.0);
                }
            }
            assert!((found - g).norm() < 1e-10 * (1.0 + g.norm()), "{moments:?} {impulse:?} {found:?} {g:?}");
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_a_typed_failure() {
        let one = Matrix3::identity();
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(solve(&one, &one, &Vector3::new(bad, 0.0, 0.0)).is_err());
        }
        assert_eq!(solve(&one, &one, &Vector3::zeros()).unwrap(), Vector3::zeros());
    }
}
