//! The discrete Moser–Veselov step of a free rigid body, thesis (5.18)–(5.21).
//!
//! In the principal frame, with R from body to world and body momentum L, one step is
//! ```text
//! Ωᵀ D − D Ω = h hat(L),      R₊ = R Ωᵀ,      L₊ = Ω L,
//! ```
//! Ω orthogonal with determinant 1 and D diagonal, d₁ + d₂ = I₃, d₂ + d₃ = I₁, d₁ + d₃ = I₂. Written with
//! the Gibbs vector g = tan(θ/2) n of the increment F = Ωᵀ, (j, k, l) cyclic, it becomes
//! ```text
//! I_j g_j + (I_l − I_k) g_k g_l = (1 + |g|²) m_j,    m = h L/2,                (a)
//! L₊ = L − (4/h) (I_l − I_k) g_k g_l / (1 + |g|²),                            (b)
//! ```
//! three quadratic equations without a square root. Divided by I_j their coefficients lie within ±1 for
//! every body (triangle inequality). Energy and |L|, and F L₊ = L, hold exactly where (a) does; (b) adds
//! an O(h) increment to L, so that round-off enters at h times the machine precision. (a) and (b) use the
//! same rounded moments and differences on purpose: the rounded map is then still reversible, and energy
//! and |L| have no drift from its coefficients.
//!
//! Equation (a) has several solutions for a small h and none for a large one. The one meant is that which
//! tends to 0 with h: [`MoserVeselov::increment`] returns it or fails.
//!
//! J. Moser, A. P. Veselov: Discrete versions of some classical integrable systems and factorization of
//! matrix polynomials. Commun. Math. Phys. 139 (1991) 217–243. R. I. McLachlan, A. Zanna: The discrete
//! Moser–Veselov algorithm for the free rigid body, revisited. Found. Comput. Math. 5 (2005) 87–123.
//!
//! # Deviations
//! The thesis prints R₊ = Ω R, calls Ω skew-symmetric and permutes the indices of (5.21); see above for
//! what holds. Ω is found as a Gibbs vector by Newton's method rather than from the matrix equation.

use crate::inverse3::Inverse3;
use crate::stepper::{Scheme, StepError};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// The equation of an implicit step was not solved: no solution was found that continues from a zero step.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the implicit step did not converge: residual {residual:e} after {iterations} iterations")]
pub struct NotConverged {
    /// Largest residual of the equation at the last iterate, in units of the half angle turned.
    pub residual: f64,
    /// Newton iterations spent.
    pub iterations: u32,
}

impl NotConverged {
    /// The failure of a step `h` of the method `M` from `t` by a body that turns at `speed`: the angle, where that is beyond the
    /// method's limit.
    #[cold]
    pub(crate) fn of<M: Scheme>(self, t: f64, h: f64, speed: f64) -> StepError {
        M::check_angle(t, h, speed).err().unwrap_or(StepError::NotConverged {
            method: M::INFO.name,
            t,
            iterations: self.iterations as usize,
            residual: self.residual,
        })
    }
}

/// What one step of a free body does, in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment {
    /// F with R₊ = R F.
    pub rotation: UnitQuaternion<f64>,
    /// L₊ − L, with F L₊ = L.
    pub momentum_change: Vector3<f64>,
}

/// The discrete Moser–Veselov map of one body, ready to be stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoserVeselov {
    moments: Vector3<f64>,
    half_inverse: Vector3<f64>,
    /// I_l − I_k.
    differences: Vector3<f64>,
    /// κ_j = (I_l − I_k)/I_j.
    ratios: Vector3<f64>,
    /// Largest |u|², u_j = m_j/I_j, at which the wanted solution is the only one within
    /// |g|² ≤ [`CONTRACTION_BALL`].
    contraction_limit: f64,
}

/// For |u| ≤ 0.2 and |κ| ≤ 1.5, g ↦ (1 + |g|²) u − κ g_k g_l maps |g| ≤ 0.4 into itself and contracts it (by
/// 0.86 at least), so the solution there is unique and joined to 0.
const CONTRACTION_BALL: f64 = 0.16;
const CONTRACTION_LIMIT: f64 = 0.04;
const CONTRACTION_RATIO: f64 = 1.5;

/// Iterations granted to Newton's method from one start.
const MAX_ITERATIONS: u32 = 40;
/// Residual of (a), over I_j, that rounding alone can leave.
const ROUND_OFF: f64 = 8.0 * f64::EPSILON;
/// Determinant over its value at zero that round-off (its square root) can leave at a fold.
const FOLD_ROUND_OFF: f64 = 1e-6;
/// Shortest step of the continuation in h, as a fraction of h.
const SHORTEST_CONTINUATION: f64 = 1e-5;

impl MoserVeselov {
    /// The map of a body with principal `moments`, positive and finite. They may be
    /// [modified](crate::preprocessing::ModifiedMoments) ones.
    pub fn new(moments: &Vector3<f64>) -> Self {
        let [i1, i2, i3] = (*moments).into();
        let differences = Vector3::new(i3 - i2, i1 - i3, i2 - i1);
        let ratios = differences.component_div(moments);
        Self {
            moments: *moments,
            half_inverse: moments.map(|i| 0.5 / i),
            differences,
            ratios,
            contraction_limit: if ratios.amax() <= CONTRACTION_RATIO { CONTRACTION_LIMIT } else { 0.0 },
        }
    }

    /// One step of size `h` from body momentum `momentum_body`, in the principal frame.
    ///
    /// Accurate to round-off in F and relative to h in L₊ − L. Cost: two or three Newton iterations in
    /// three unknowns for small h, one square root. For a step of more than 0.4 rad also a check of the
    /// branch, and where that leaves doubt a continuation from h = 0.
    ///
    /// Fails where the solution that tends to 0 with h has ceased to exist; for a rotation about a
    /// principal axis that is at h |ω| = 1.
    #[inline]
    pub fn increment(&self, momentum_body: &Vector3<f64>, h: f64) -> Result<Increment, NotConverged> {
        let g = self.gibbs_vector(&(0.5 * h * momentum_body))?;
        let cos2 = 1.0 / one_plus_square(&g);
        let s = cos2.sqrt();
        let rate = if h == 0.0 { 0.0 } else { cos2 * (-4.0 / h) };
        Ok(Increment {
            rotation: UnitQuaternion::new_unchecked(Quaternion::new(s, s * g.x, s * g.y, s * g.z)),
            momentum_change: rate * pair_products(&g).component_mul(&self.differences),
        })
    }

    /// The solution of (a) that is continuous with m = 0.
    #[inline]
    fn gibbs_vector(&self, impulse: &Vector3<f64>) -> Result<Vector3<f64>, NotConverged> {
        let u = 2.0 * impulse.component_mul(&self.half_inverse);
        // Two rounds of the fixed point leave an error of fourth order.
        let first = u - pair_products(&u).component_mul(&self.ratios);
        let start = one_plus_square(&first) * u - pair_products(&first).component_mul(&self.ratios);
        if u.norm_squared() <= self.contraction_limit
            && let Ok(root) = self.newton(impulse, start)
            && root.gibbs.norm_squared() <= CONTRACTION_BALL
        {
            return Ok(root.gibbs);
        }
        self.large_gibbs_vector(impulse, start)
    }

    #[cold]
    #[inline(never)]
    fn large_gibbs_vector(
        &self,
        impulse: &Vector3<f64>,
        start: Vector3<f64>,
    ) -> Result<Vector3<f64>, NotConverged> {
        let mut iterations = 0;
        if let Ok(root) = self.newton(impulse, start) {
            if self.is_principal(&root.gibbs) {
                return Ok(root.gibbs);
            }
            iterations += root.iterations;
        }
        // Follow the solution from s = 0 to 1 in (a) with s m in the place of m, predicting by its tangent.
        let (mut s, mut step, mut g) = (0.0, 0.25, Vector3::zeros());
        let fold = -FOLD_ROUND_OFF * self.moments.product();
        while s < 1.0 {
            let next = f64::min(s + step, 1.0);
            let right = one_plus_square(&g) * impulse;
            let tangent = Inverse3::of(&self.jacobian(&(s * impulse), &g)).times(&right);
            let predicted = g + (next - s) * tangent;
            let trial = self.newton(&(next * impulse), predicted);
            iterations += match &trial {
                Ok(root) => root.iterations,
                Err(failure) => failure.iterations,
            };
            match trial {
                // On the way the determinant starts positive and vanishes first where the solution ends, at
                // a fold; there the tangent predicts half the distance, elsewhere nearly all of it.
                Ok(root)
                    if self.jacobian(&(next * impulse), &root.gibbs).determinant() >= fold
                        && (root.gibbs - predicted).norm() <= 0.6 * (root.gibbs - g).norm() =>
                {
                    (s, g, step) = (next, root.gibbs, 1.5 * step);
                }
                _ => step *= 0.5,
            }
            // A NaN ends the loop as well.
            if !(step >= SHORTEST_CONTINUATION && g.norm_squared().is_finite()) {
                return Err(self.failure(impulse, &g, iterations));
            }
        }
        Ok(g)
    }

    /// Newton's method with each Jacobian used twice, of third order.
    #[inline]
    fn newton(&self, impulse: &Vector3<f64>, start: Vector3<f64>) -> Result<Root, NotConverged> {
        let mut g = start;
        for iterations in 1..=MAX_ITERATIONS {
            let inverse = Inverse3::of(&self.jacobian(impulse, &g));
            let first = inverse.times(&self.residual(impulse, &g));
            // (a) is quadratic: its residual at g − first, were first exact.
            let left =
                self.differences.component_mul(&pair_products(&first)) - first.norm_squared() * impulse;
            let second = inverse.times(&left);
            g -= first + second;
            // What is left is about the product of the two corrections.
            if first.norm_squared() * second.norm_squared() <= 1e-36 * g.norm_squared() {
                return Ok(Root { gibbs: g, iterations });
            }
        }
        // At the fold itself the root is double and convergence linear.
        let failure = self.failure(impulse, &g, MAX_ITERATIONS);
        if failure.residual <= ROUND_OFF * (1.0 + g.norm_squared()) {
            Ok(Root { gibbs: g, iterations: MAX_ITERATIONS })
        } else {
            Err(failure)
        }
    }

    fn failure(&self, impulse: &Vector3<f64>, g: &Vector3<f64>, iterations: u32) -> NotConverged {
        let half_angle = 2.0 * self.residual(impulse, g).component_mul(&self.half_inverse);
        NotConverged { residual: half_angle.amax(), iterations }
    }

    /// Left minus right side of (a).
    #[inline]
    fn residual(&self, impulse: &Vector3<f64>, g: &Vector3<f64>) -> Vector3<f64> {
        self.moments.component_mul(g) + self.differences.component_mul(&pair_products(g))
            - one_plus_square(g) * impulse
    }

    #[inline]
    fn jacobian(&self, impulse: &Vector3<f64>, g: &Vector3<f64>) -> Matrix3<f64> {
        let (i, d, m, p) = (&self.moments, &self.differences, impulse, 2.0 * g);
        Matrix3::new(
            i.x - m.x * p.x,
            d.x * g.z - m.x * p.y,
            d.x * g.y - m.x * p.z,
            d.y * g.z - m.y * p.x,
            i.y - m.y * p.y,
            d.y * g.x - m.y * p.z,
            d.z * g.y - m.z * p.x,
            d.z * g.x - m.z * p.y,
            i.z - m.z * p.z,
        )
    }

    /// Whether tr(S) − S is positive definite, S the symmetric part of F D. It is at h = 0, and while it is
    /// the derivative of the left side of the Moser–Veselov equation is invertible.
    fn is_principal(&self, g: &Vector3<f64>) -> bool {
        let d = Vector3::repeat(0.5 * self.moments.sum()) - self.moments;
        let dg = d.component_mul(g);
        let hat = g.cross_matrix();
        let dm = Matrix3::from_diagonal(&d);
        let s =
            (1.0 - g.norm_squared()) * dm + g * dg.transpose() + dg * g.transpose() + (hat * dm - dm * hat);
        let t = Matrix3::from_diagonal_element(s.trace()) - s;
        t.m11 > 0.0 && t.m11 * t.m22 > t.m12 * t.m21 && t.determinant() > 0.0
    }
}

/// One discrete Moser–Veselov step of the body with principal `moments`: F with R₊ = R F, and L₊.
///
/// As [`MoserVeselov::increment`], for a single step; prepare a [`MoserVeselov`] for many.
pub fn step(
    moments: &Vector3<f64>,
    momentum_body: &Vector3<f64>,
    h: f64,
) -> Result<(UnitQuaternion<f64>, Vector3<f64>), NotConverged> {
    let increment = MoserVeselov::new(moments).increment(momentum_body, h)?;
    Ok((increment.rotation, momentum_body + increment.momentum_change))
}

/// A vector that is advanced by small increments with compensated (Kahan) summation, so that its
/// round-off does not grow with the number of steps but with the distance travelled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompensatedVector {
    value: Vector3<f64>,
    carry: Vector3<f64>,
}

impl CompensatedVector {
    /// Starts from `value`.
    pub fn new(value: Vector3<f64>) -> Self {
        Self { value, carry: Vector3::zeros() }
    }

    /// The sum so far.
    #[inline]
    pub fn value(&self) -> &Vector3<f64> {
        &self.value
    }

    /// Adds `increment`.
    #[inline]
    pub fn add(&mut self, increment: &Vector3<f64>) {
        let y = increment - self.carry;
        let sum = self.value + y;
        self.carry = (sum - self.value) - y;
        self.value = sum;
    }
}

struct Root {
    gibbs: Vector3<f64>,
    iterations: u32,
}

/// 1 + |v|², summed in pairs: it stands on the longest chain of dependent operations.
#[inline]
fn one_plus_square(v: &Vector3<f64>) -> f64 {
    (1.0 + v.x * v.x) + (v.y * v.y + v.z * v.z)
}

/// (v_k v_l) with (j, k, l) cyclic.
#[inline]
fn pair_products(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y * v.z, v.z * v.x, v.x * v.y)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Largest entry of Ωᵀ D − D Ω − h hat(L), for F = Ωᵀ.
    fn matrix_residual(
        moments: &Vector3<f64>,
        momentum: &Vector3<f64>,
        h: f64,
        f: &UnitQuaternion<f64>,
    ) -> f64 {
        let d = Matrix3::from_diagonal(&(Vector3::repeat(0.5 * moments.sum()) - moments));
        let f = f.to_rotation_matrix().into_inner();
        (f * d - d * f.transpose() - h * momentum.cross_matrix()).amax()
    }

    /// Numbers in (−1, 1), the same in every run.
    pub(crate) fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// Moments of three point pairs on the axes with masses spread over `decades`.
    pub(crate) fn random_moments(random: &mut impl FnMut() -> f64, decades: f64) -> Vector3<f64> {
        let d = Vector3::from_fn(|_, _| 10f64.powf(decades * random()));
        Vector3::new(d.y + d.z, d.x + d.z, d.x + d.y)
    }

    #[test]
    fn the_moser_veselov_equation_holds_to_round_off() {
        let mut random = noise(1);
        for _ in 0..10_000 {
            let moments = random_moments(&mut random, 2.0);
            let rate = Vector3::from_fn(|_, _| random());
            let momentum = moments.component_mul(&rate);
            for h in [1e-8, 1e-3, 0.1, 0.3, -0.2] {
                let (f, after) = step(&moments, &momentum, h).unwrap();
                let scale = moments.max();
                assert!(matrix_residual(&moments, &momentum, h, &f) <= 1e-15 * scale);
                assert!((f * after - momentum).norm() <= 1e-15 * scale);
            }
        }
    }

    #[test]
    fn a_zero_step_changes_nothing() {
        let momentum = Vector3::new(1.0, 2.0, 3.0);
        let (f, after) = step(&Vector3::new(1.0, 2.0, 2.5), &momentum, 0.0).unwrap();
        assert_eq!((f, after), (UnitQuaternion::identity(), momentum));
        let (f, after) = step(&Vector3::new(1.0, 2.0, 2.5), &Vector3::zeros(), 0.1).unwrap();
        assert_eq!((f, after), (UnitQuaternion::identity(), Vector3::zeros()));
    }

    #[test]
    fn a_step_and_the_step_back_cancel() {
        let moments = Vector3::new(1.0, 2.0, 2.5);
        let before = Vector3::new(0.3, -0.5, 0.4);
        let (f, after) = step(&moments, &before, 0.5).unwrap();
        let (back, again) = step(&moments, &after, -0.5).unwrap();
        assert!((again - before).norm() < 1e-15);
        assert!((f * back).angle() < 1e-15);
    }

    /// The definition of the branch: small steps in h from h = 0, until the determinant vanishes.
    fn traced(map: &MoserVeselov, impulse: &Vector3<f64>) -> Option<Vector3<f64>> {
        let mut g = Vector3::zeros();
        for n in 1..=400 {
            let impulse = impulse * (f64::from(n) / 400.0);
            g = map.newton(&impulse, g).ok()?.gibbs;
            if map.jacobian(&impulse, &g).determinant() <= 1e-3 * map.moments.product() {
                return None;
            }
        }
        Some(g)
    }

    #[test]
    fn large_steps_stay_on_the_branch_of_small_ones() {
        let mut random = noise(7);
        let (mut solved, mut ended) = (0, 0);
        for n in 0..4_000 {
            let map = MoserVeselov::new(&random_moments(&mut random, if n % 2 == 0 { 0.5 } else { 3.0 }));
            let u = 0.6 * Vector3::from_fn(|_, _| random());
            let impulse = map.moments.component_mul(&u);
            let found = map.gibbs_vector(&impulse);
            match traced(&map, &impulse) {
                Some(expected) => {
                    let found = found.unwrap();
                    assert!(
                        (found - expected).norm() < 1e-9,
                        "{:?} {u:?}: {found:?} {expected:?}",
                        map.moments
                    );
                    solved += 1;
                }
                None => ended += 1,
            }
            if let Ok(g) = found {
                let residual = map.residual(&impulse, &g).component_div(&map.moments).amax();
                assert!(residual < 1e-14 * (1.0 + g.norm_squared()), "{u:?} {g:?}");
            }
        }
        assert!(solved > 1_000 && ended > 500, "{solved} solved, {ended} ended");
    }

    #[test]
    fn a_ball_turning_a_quarter_per_step_is_at_the_fold() {
        for axis in [Vector3::x(), Vector3::repeat(1.0 / 3f64.sqrt()), Vector3::new(0.6, 0.0, -0.8)] {
            let (f, after) = step(&Vector3::repeat(1.0), &axis, 1.0).unwrap();
            assert!((f.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-7);
            assert!((after - axis).norm() < 1e-15);
        }
    }

    #[test]
    fn a_step_beyond_the_fold_is_a_typed_failure() {
        // About a principal axis sin(θ) = h ω has a solution up to h ω = 1.
        let moments = Vector3::new(1.0, 2.0, 2.5);
        for axis in 0..3 {
            let mut momentum = Vector3::zeros();
            momentum[axis] = moments[axis];
            let (f, _) = step(&moments, &momentum, 0.999).unwrap();
            assert!((f.angle() - 0.999f64.asin()).abs() < 1e-12);
            let failure = step(&moments, &momentum, 1.001).unwrap_err();
            assert!(failure.residual > 1e-7 && failure.iterations > 0, "{failure:?}");
        }
        for h in [f64::NAN, f64::INFINITY, 1e300] {
            assert!(step(&moments, &Vector3::new(1.0, 2.0, 3.0), h).is_err());
        }
    }
}
