//! The discrete Moser–Veselov step of a free rigid body, thesis (5.18)–(5.21).
//!
//! In the principal frame, with R from body to world and body momentum L, one step is
//! ```text
//! Ωᵀ D − D Ω = h hat(L),      R₊ = R Ωᵀ,      L₊ = Ω L,
//! ```
//! Ω orthogonal with determinant 1 and D diagonal, d₁ + d₂ = I₃, d₂ + d₃ = I₁, d₁ + d₃ = I₂. Written with
//! the Gibbs vector g = tan(θ/2) n of the increment F = Ωᵀ, (j, k, l) cyclic, it becomes
//! ```text
//! g_j + κ_j g_k g_l = (1 + |g|²) u_j,    κ_j = (I_l − I_k)/I_j,    u_j = h L_j/(2 I_j)          (a)
//! L₊ = L − (4/h) (I_l − I_k) g_k g_l / (1 + |g|²),                                              (b)
//! ```
//! three quadratic equations without a square root. By the triangle inequality |κ_j| ≤ 1, so (a) is well
//! scaled for every body. Energy and |L|, and F L₊ = L, hold exactly where (a) does; form (b) adds an
//! O(h) increment to L, so that round-off enters at h times the machine precision.
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
    /// κ.
    ratios: Vector3<f64>,
    /// Largest |u|² at which the wanted solution is the only one within |g|² ≤ [`CONTRACTION_BALL`].
    contraction_limit: f64,
}

/// For |u| ≤ 0.2 and |κ| ≤ 1.5, g ↦ (1 + |g|²) u − κ g_k g_l maps |g| ≤ 0.4 into itself and contracts it (by
/// 0.86 at least), so the solution there is unique and joined to 0.
const CONTRACTION_BALL: f64 = 0.16;
const CONTRACTION_LIMIT: f64 = 0.04;
const CONTRACTION_RATIO: f64 = 1.5;

/// Iterations granted to Newton's method from one start.
const MAX_ITERATIONS: u32 = 12;
/// Shortest step of the continuation in h, as a fraction of h.
const SHORTEST_CONTINUATION: f64 = 1e-5;

impl MoserVeselov {
    /// The map of a body with principal `moments`, positive and finite. They may be
    /// [modified](crate::ModifiedMoments) ones.
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
        let g = self.gibbs_vector(&(h * momentum_body.component_mul(&self.half_inverse)))?;
        let norm = 1.0 + g.norm_squared();
        let s = 1.0 / norm.sqrt();
        let rate = if h == 0.0 { 0.0 } else { -4.0 / (h * norm) };
        Ok(Increment {
            rotation: UnitQuaternion::new_unchecked(Quaternion::new(s, s * g.x, s * g.y, s * g.z)),
            momentum_change: rate * pair_products(&g).component_mul(&self.differences),
        })
    }

    /// The solution of (a) that is continuous with u = 0.
    #[inline]
    fn gibbs_vector(&self, u: &Vector3<f64>) -> Result<Vector3<f64>, NotConverged> {
        let size = u.norm_squared();
        // Two rounds of the fixed point leave an error of fourth order.
        let first = u - pair_products(u).component_mul(&self.ratios);
        let start = (1.0 + first.norm_squared()) * u - pair_products(&first).component_mul(&self.ratios);
        if size <= self.contraction_limit
            && let Ok(root) = self.newton(u, start, MAX_ITERATIONS)
            && root.gibbs.norm_squared() <= CONTRACTION_BALL
        {
            return Ok(root.gibbs);
        }
        self.large_gibbs_vector(u, start)
    }

    #[cold]
    #[inline(never)]
    fn large_gibbs_vector(
        &self,
        u: &Vector3<f64>,
        start: Vector3<f64>,
    ) -> Result<Vector3<f64>, NotConverged> {
        let mut iterations = 0;
        if let Ok(root) = self.newton(u, start, MAX_ITERATIONS) {
            if self.is_principal(&root.gibbs) {
                return Ok(root.gibbs);
            }
            iterations += root.iterations;
        }
        // Follow the solution from s = 0 to 1 in (a) with s u in the place of u, predicting by its tangent.
        let (mut s, mut step, mut g) = (0.0, 0.25, Vector3::zeros());
        while s < 1.0 {
            let next = f64::min(s + step, 1.0);
            let jacobian = self.jacobian(&(s * u), &g);
            let tangent = solve3(&jacobian, &((1.0 + g.norm_squared()) * u)).1;
            let predicted = g + (next - s) * tangent;
            let trial = self.newton(&(next * u), predicted, MAX_ITERATIONS);
            iterations += match &trial {
                Ok(root) => root.iterations,
                Err(failure) => failure.iterations,
            };
            match trial {
                // On the way the determinant starts at 1 and vanishes first where the solution ends. A
                // correction that is short beside the distance predicted keeps to the branch.
                Ok(root)
                    if solve3(&self.jacobian(&(next * u), &root.gibbs), u).0 > 0.0
                        && (root.gibbs - predicted).norm() <= 0.2 * (root.gibbs - g).norm() =>
                {
                    (s, g, step) = (next, root.gibbs, 1.5 * step);
                }
                _ => step *= 0.5,
            }
            // A NaN ends the loop as well.
            if !(step >= SHORTEST_CONTINUATION && g.norm_squared().is_finite()) {
                let residual = self.residual(u, &g).amax();
                return Err(NotConverged { residual, iterations });
            }
        }
        Ok(g)
    }

    #[inline]
    fn newton(
        &self,
        u: &Vector3<f64>,
        start: Vector3<f64>,
        max_iterations: u32,
    ) -> Result<Root, NotConverged> {
        let mut g = start;
        for iterations in 1..=max_iterations {
            let correction = solve3(&self.jacobian(u, &g), &self.residual(u, &g)).1;
            g -= correction;
            // Convergence is quadratic: what is left after a correction is about its square.
            if correction.norm_squared() <= 1e-20 * g.norm() {
                return Ok(Root { gibbs: g, iterations });
            }
        }
        Err(NotConverged { residual: self.residual(u, &g).amax(), iterations: max_iterations })
    }

    /// Left minus right side of (a).
    #[inline]
    fn residual(&self, u: &Vector3<f64>, g: &Vector3<f64>) -> Vector3<f64> {
        g + self.ratios.component_mul(&pair_products(g)) - (1.0 + g.norm_squared()) * u
    }

    #[inline]
    fn jacobian(&self, u: &Vector3<f64>, g: &Vector3<f64>) -> Matrix3<f64> {
        let k = &self.ratios;
        let p = 2.0 * g;
        Matrix3::new(
            1.0 - u.x * p.x,
            k.x * g.z - u.x * p.y,
            k.x * g.y - u.x * p.z,
            k.y * g.z - u.y * p.x,
            1.0 - u.y * p.y,
            k.y * g.x - u.y * p.z,
            k.z * g.y - u.z * p.x,
            k.z * g.x - u.z * p.y,
            1.0 - u.z * p.z,
        )
    }

    /// Whether tr(S) − S is positive definite, S the symmetric part of F D. It is at h = 0, and while it is
    /// the derivative of the left side of the Moser–Veselov equation is invertible.
    fn is_principal(&self, g: &Vector3<f64>) -> bool {
        let d = Vector3::repeat(0.5 * self.moments.sum()) - self.moments;
        let dg = d.component_mul(g);
        let hat = g.cross_matrix();
        let dm = Matrix3::from_diagonal(&d);
        let s = (1.0 - g.norm_squared()) * dm + g * dg.transpose() + dg * g.transpose() + (hat * dm - dm * hat);
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

/// (v_k v_l) with (j, k, l) cyclic.
#[inline]
fn pair_products(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y * v.z, v.z * v.x, v.x * v.y)
}

/// Determinant of m and the solution of m x = right by Cramer's rule, not finite where m is singular.
#[inline]
pub(crate) fn solve3(m: &Matrix3<f64>, right: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let (a, b, c) = (m.column(0).into_owned(), m.column(1).into_owned(), m.column(2).into_owned());
    let bc = b.cross(&c);
    let determinant = a.dot(&bc);
    let x = Vector3::new(bc.dot(right), c.cross(&a).dot(right), a.cross(&b).dot(right));
    (determinant, x * (1.0 / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest entry of Ωᵀ D − D Ω − h hat(L), for F = Ωᵀ.
    fn matrix_residual(moments: &Vector3<f64>, momentum: &Vector3<f64>, h: f64, f: &UnitQuaternion<f64>) -> f64 {
        let d = Matrix3::from_diagonal(&(Vector3::repeat(0.5 * moments.sum()) - moments));
        let f = f.to_rotation_matrix().into_inner();
        (f * d - d * f.transpose() - h * momentum.cross_matrix()).amax()
    }

    /// Numbers in (−1, 1), the same in every run.
    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// Moments of three point pairs on the axes with masses spread over `decades`.
    fn random_moments(random: &mut impl FnMut() -> f64, decades: f64) -> Vector3<f64> {
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
    fn traced(map: &MoserVeselov, u: &Vector3<f64>) -> Option<Vector3<f64>> {
        let mut g = Vector3::zeros();
        for n in 1..=400 {
            let u = u * (f64::from(n) / 400.0);
            g = map.newton(&u, g, 40).ok()?.gibbs;
            if map.jacobian(&u, &g).determinant() <= 1e-3 {
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
            let found = map.gibbs_vector(&u);
            match traced(&map, &u) {
                Some(expected) => {
                    let found = found.unwrap();
                    assert!((found - expected).norm() < 1e-9, "{:?} {u:?}: {found:?} {expected:?}", map.moments);
                    solved += 1;
                }
                None => ended += 1,
            }
            if let Ok(g) = found {
                assert!(map.residual(&u, &g).amax() < 1e-14 * (1.0 + g.norm_squared()), "{u:?} {g:?}");
            }
        }
        assert!(solved > 1_000 && ended > 500, "{solved} solved, {ended} ended");
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
