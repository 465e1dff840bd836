//! Minimum-torque motions of the two-link arm (thesis 8.2, 8.3), field and Jacobian in closed form.
//!
//! x = (θ₁, θ₂, θ̇₁, θ̇₂) and M(θ₂) q̈ + C(θ₂, q̇) = u as in [`somersault_multibody::models::TwoLinkArm`], that is (8.2) with
//! M₁₂ corrected; ℓ = ½ (γ₁u₁² + γ₂u₂²). With μ = M⁻¹λ_v, W = M⁻¹ and α = W(u − C):
//!
//! ```text
//! u* = −μ/γ, cut off at the limits,   q̈ = α,
//! λ̇_θ₁ = 0,   λ̇_θ₂ = μᵀ(M'α + C_θ),   λ̇_v = −λ_q + C_vᵀμ.
//! ```
//! The Jacobian follows from μ_θ = −WM'μ, α_θ = W(u_θ − C_θ − M'α), α_v = −WC_v, α_λ = W u_μ W; where a limit acts u does
//! not vary, so that the field has a kink there and the Jacobian a jump: each limit is a switch of the field's pieces.

use super::piece::{Bounds, expect_limit};
use super::{
    HamiltonianSystem, OptimalControlSystem, Piece, Side, SystemError, VectorField, expect_controls,
};
use crate::cold_start::Torque;
use nalgebra::{DMatrix, Matrix2, Vector2};
use somersault_core::argument::{ArgumentError, expect_positive};
use somersault_multibody::models::TwoLinkArm;

/// The state–costate system of the arm, p = (θ₁, θ₂, θ̇₁, θ̇₂, λ₁, …, λ₄).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmMinimumTorque {
    arm: TwoLinkArm,
    weights: [f64; 2],
    limits: [f64; 2],
    /// M = (a + 2b cos θ₂, d + b cos θ₂; ·, d).
    inertia: [f64; 3],
}

/// The columns of a Jacobian.
type Columns = [[f64; 8]; 8];

/// What field and Jacobian share.
struct Pose {
    b_cos: f64,
    b_sin: f64,
    /// M⁻¹.
    inverse: Matrix2<f64>,
    /// M'(θ₂) α.
    turned: Vector2<f64>,
    c_angle: Vector2<f64>,
    c_rate: Matrix2<f64>,
    mu: Vector2<f64>,
    torque: Vector2<f64>,
    /// −∂u/∂μ.
    compliance: Vector2<f64>,
    acceleration: Vector2<f64>,
}

impl Default for ArmMinimumTorque {
    /// The arm of Table 8.1 with γ = (1, 0.5), without limits.
    fn default() -> Self {
        Self::new_unchecked(TwoLinkArm::default(), [1.0, 0.5])
    }
}

impl ArmMinimumTorque {
    /// `weights` are γ₁ and γ₂. Masses, lengths and weights must be positive, friction not negative.
    pub fn try_new(arm: TwoLinkArm, weights: [f64; 2]) -> Result<Self, SystemError> {
        for i in 0..2 {
            expect_positive("masses", arm.masses[i])?;
            expect_positive("lengths", arm.lengths[i])?;
            expect_positive("weights", weights[i])?;
            if !(arm.damping[i] >= 0.0 && arm.damping[i].is_finite()) {
                let found = arm.damping[i];
                return Err(ArgumentError::OutOfRange {
                    argument: "damping",
                    allowed: "finite and not negative",
                    found,
                }
                .into());
            }
        }
        Ok(Self::new_unchecked(arm, weights))
    }

    /// Bounds |uᵢ| by `limits`, N m; infinite for none.
    pub fn try_with_torque_limits(self, limits: [f64; 2]) -> Result<Self, SystemError> {
        limits.iter().try_for_each(|&limit| expect_limit(limit).map(|_| ()))?;
        Ok(Self { limits, ..self })
    }

    fn new_unchecked(arm: TwoLinkArm, weights: [f64; 2]) -> Self {
        let TwoLinkArm { masses: [m1, m2], lengths: [l1, l2], .. } = arm;
        let d = m2 * l2 * l2 / 3.0;
        let inertia = [(m1 / 3.0 + m2) * l1 * l1 + d, 0.5 * m2 * l1 * l2, d];
        Self { arm, weights, limits: [f64::INFINITY; 2], inertia }
    }

    /// The arm.
    pub fn arm(&self) -> &TwoLinkArm {
        &self.arm
    }

    /// γ₁ and γ₂.
    pub fn weights(&self) -> [f64; 2] {
        self.weights
    }

    /// The bounds of |u₁| and |u₂|.
    pub fn torque_limits(&self) -> [f64; 2] {
        self.limits
    }

    #[inline(always)]
    fn bounds(&self, i: usize) -> Bounds {
        Bounds { lower: -self.limits[i], upper: self.limits[i] }
    }

    #[inline(always)]
    fn pose(&self, p: &[f64]) -> Pose {
        self.pose_on(|i, free| self.bounds(i).side(free), p)
    }

    #[inline(always)]
    fn pose_in(&self, piece: &Piece, p: &[f64]) -> Pose {
        self.pose_on(|i, _| piece.side(i), p)
    }

    /// With each control on the side that `side` gives for it and its value without limits.
    #[inline(always)]
    fn pose_on(&self, side: impl Fn(usize, f64) -> Side, p: &[f64]) -> Pose {
        let [a, b, d] = self.inertia;
        let (sin, cos) = p[1].sin_cos();
        let (b_sin, b_cos) = (b * sin, b * cos);
        let (w1, w2) = (p[2], p[3]);
        let (m11, m12) = (a + 2.0 * b_cos, d + b_cos);
        let inverse = Matrix2::new(d, -m12, -m12, m11) * (m11 * d - m12 * m12).recip();
        let mu = inverse * Vector2::new(p[6], p[7]);
        let (mut torque, mut compliance) = (Vector2::zeros(), Vector2::zeros());
        for i in 0..2 {
            let inverse = self.weights[i].recip();
            let free = -mu[i] * inverse;
            let side = side(i, free);
            torque[i] = self.bounds(i).control(side, free);
            compliance[i] = if side == Side::Free { inverse } else { 0.0 };
        }
        let [c1, c2] = self.arm.damping;
        let (swing, square) = (w2 * (2.0 * w1 + w2), w1 * w1);
        let c = Vector2::new(-b_sin * swing + c1 * w1, b_sin * square + c2 * w2);
        let acceleration = inverse * (torque - c);
        Pose {
            b_cos,
            b_sin,
            inverse,
            turned: Vector2::new(2.0 * acceleration.x + acceleration.y, acceleration.x) * -b_sin,
            c_angle: Vector2::new(-swing, square) * b_cos,
            c_rate: Matrix2::new(c1 - 2.0 * b_sin * w2, -2.0 * b_sin * (w1 + w2), 2.0 * b_sin * w1, c2),
            mu,
            torque,
            compliance,
            acceleration,
        }
    }

    /// Without limits.
    pub(crate) fn without_torque_limits(&self) -> Self {
        Self { limits: [f64::INFINITY; 2], ..*self }
    }

    /// Limits on the way from `peaks` to `limits`, where these are lower.
    pub(crate) fn limited_towards(&self, limits: [f64; 2], peaks: [f64; 2], s: f64) -> Self {
        let between = |i: usize| {
            if limits[i] < peaks[i] { peaks[i] + s * (limits[i] - peaks[i]) } else { limits[i] }
        };
        Self { limits: std::array::from_fn(between), ..*self }
    }

    /// With parameters on the way to those of `other`, without limits. Between two arms all are in range.
    pub(crate) fn towards(&self, other: &Self, s: f64) -> Self {
        let pair = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|i| a[i] + s * (b[i] - a[i]));
        let arm = TwoLinkArm {
            masses: pair(self.arm.masses, other.arm.masses),
            lengths: pair(self.arm.lengths, other.arm.lengths),
            damping: pair(self.arm.damping, other.arm.damping),
        };
        Self::new_unchecked(arm, pair(self.weights, other.weights))
    }

    /// u = M q̈ + C with its derivatives by q, q̇ and q̈, at the six numbers of a motion.
    pub(crate) fn inverse_dynamics(&self, motion: &[f64], torque: &mut Torque) {
        let (q, v, a) = (&motion[..2], &motion[2..4], Vector2::new(motion[4], motion[5]));
        let pose = self.pose(&[q[0], q[1], v[0], v[1], 0.0, 0.0, 0.0, 0.0]);
        let [base, _, d] = self.inertia;
        let inertia = Matrix2::new(base + 2.0 * pose.b_cos, d + pose.b_cos, d + pose.b_cos, d);
        let turned = Vector2::new(2.0 * a.x + a.y, a.x) * -pose.b_sin;
        // without costates the acceleration is −M⁻¹C
        let u = inertia * (a - pose.acceleration);
        let by_angle = Matrix2::from_columns(&[Vector2::zeros(), turned + pose.c_angle]);
        torque.u.copy_from_slice(u.as_slice());
        for (by, part) in torque.by.iter_mut().zip([by_angle, pose.c_rate, inertia]) {
            by.copy_from_slice(part.as_slice());
        }
    }

    #[inline(always)]
    fn effort(&self, Pose { torque, .. }: &Pose) -> f64 {
        0.5 * (self.weights[0] * torque.x * torque.x + self.weights[1] * torque.y * torque.y)
    }

    #[inline(always)]
    fn field_at(pose: &Pose, p: &[f64], h: &mut [f64]) {
        let rate = pose.c_rate.tr_mul(&pose.mu);
        let turn = pose.mu.dot(&(pose.turned + pose.c_angle));
        let a = &pose.acceleration;
        h.copy_from_slice(&[p[2], p[3], a.x, a.y, 0.0, turn, rate.x - p[4], rate.y - p[5]]);
    }

    #[inline(always)]
    fn jacobian_at(pose: &Pose, p: &[f64]) -> Columns {
        let Pose {
            b_cos, b_sin, inverse, turned, c_angle, c_rate, mu, compliance, acceleration: acc, ..
        } = pose;
        let (w1, w2) = (p[2], p[3]);
        let slope = |x: &Vector2<f64>| Vector2::new(2.0 * x.x + x.y, x.x) * -b_sin;
        let mu_angle = -(inverse * slope(mu));
        let acc_angle = inverse * (-compliance.component_mul(&mu_angle) - c_angle - turned);
        let acc_rate = -(inverse * c_rate);
        let acc_costate = -(inverse * Matrix2::from_diagonal(compliance) * inverse);
        // second derivatives of −H by (θ₂, q̇)
        let swing = w2 * (2.0 * w1 + w2);
        let bent = Vector2::new(2.0 * acc.x + acc.y, acc.x) * -b_cos;
        let c_bent = Vector2::new(swing, -w1 * w1) * *b_sin;
        let turn_angle = mu_angle.dot(&(turned + c_angle)) + mu.dot(&(bent + slope(&acc_angle) + c_bent));
        let c_rate_angle = Matrix2::new(-2.0 * w2, -2.0 * (w1 + w2), 2.0 * w1, 0.0) * *b_cos;
        let rate_angle = c_rate_angle.tr_mul(mu) + c_rate.tr_mul(&mu_angle);
        let mixed = -2.0 * b_sin * mu.x;

        let mut d = [[0.0; 8]; 8];
        d[2][0] = 1.0;
        d[3][1] = 1.0;
        d[4][6] = -1.0;
        d[5][7] = -1.0;
        d[1][5] = turn_angle;
        d[2][6] = 2.0 * b_sin * mu.y;
        d[3][6] = mixed;
        d[2][7] = mixed;
        d[3][7] = mixed;
        for i in 0..2 {
            d[1][2 + i] = acc_angle[i];
            d[6 + i][5] = -acc_angle[i];
            d[2 + i][5] = rate_angle[i];
            d[1][6 + i] = rate_angle[i];
            for j in 0..2 {
                d[2 + j][2 + i] = acc_rate[(i, j)];
                d[6 + i][6 + j] = -acc_rate[(i, j)];
                d[6 + j][2 + i] = acc_costate[(i, j)];
            }
        }
        d
    }

    #[inline(always)]
    fn write_jacobian(pose: &Pose, p: &[f64], d: &mut DMatrix<f64>) {
        d.as_mut_slice().copy_from_slice(Self::jacobian_at(pose, p).as_flattened());
    }

    /// D Φ. Rows 1, 2 and 5 of D are those of θ̇ and λ̇₁ = 0; columns 1, 5 and 6 hold only ∂λ̇_v/∂λ_q = −1.
    #[inline(always)]
    fn tangent_by(d: &Columns, phi: &[f64], out: &mut [f64], multiply_add: impl Fn(f64, f64, f64) -> f64) {
        let (phi, out) = (phi.as_chunks::<8>().0, out.as_chunks_mut::<8>().0);
        let (Some(phi), Some(out)) = (phi.first_chunk::<8>(), out.first_chunk_mut::<8>()) else { return };
        (out[0], out[1], out[4]) = (phi[2], phi[3], [0.0; 8]);
        for (i, start) in [(2, None), (3, None), (5, None), (6, Some(4)), (7, Some(5))] {
            let mut sum = start.map_or([0.0; 8], |k: usize| phi[k].map(|x| -x));
            for k in [1, 2, 3, 6, 7] {
                for c in 0..8 {
                    sum[c] = multiply_add(d[k][i], phi[k][c], sum[c]);
                }
            }
            out[i] = sum;
        }
    }
}

impl VectorField for ArmMinimumTorque {
    #[inline(always)]
    fn dimension(&self) -> usize {
        8
    }

    #[inline]
    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        Self::field_at(&self.pose(p), p, h);
    }

    #[inline]
    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        Self::write_jacobian(&self.pose(p), p, d);
    }

    #[inline(always)]
    fn linearize_into(&self, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        let pose = self.pose(p);
        Self::field_at(&pose, p, h);
        Self::write_jacobian(&pose, p, d);
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        Some(self.hamiltonian(p))
    }

    #[inline]
    fn n_switches(&self) -> usize {
        if self.limits.iter().any(|limit| limit.is_finite()) { 2 } else { 0 }
    }

    fn piece(&self, p: &[f64]) -> Piece {
        let mu = self.pose(p).mu;
        (0..2).map(|i| self.bounds(i).side(-mu[i] / self.weights[i])).collect()
    }

    #[inline(always)]
    fn field_in(&self, piece: &Piece, p: &[f64], h: &mut [f64]) {
        Self::field_at(&self.pose_in(piece, p), p, h);
    }

    #[inline(always)]
    fn linearize_in(&self, piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        let pose = self.pose_in(piece, p);
        Self::field_at(&pose, p, h);
        Self::write_jacobian(&pose, p, d);
    }

    fn margins_into(&self, piece: &Piece, p: &[f64], margins: &mut [f64]) {
        let Pose { mu, torque, .. } = self.pose_in(piece, p);
        for (i, margin) in margins.iter_mut().enumerate() {
            let slope = self.weights[i] * torque[i] + mu[i];
            *margin = self.bounds(i).margin(piece.side(i), torque[i], slope);
        }
    }

    #[inline(always)]
    fn tangent(
        &self,
        _: usize,
        d: &[f64],
        phi: &[f64],
        out: &mut [f64],
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) {
        let Some(d) = d.as_chunks::<8>().0.first_chunk::<8>() else { return };
        Self::tangent_by(d, phi, out, multiply_add);
    }

    #[inline(always)]
    fn variation_in(
        &self,
        piece: &Piece,
        p: &[f64],
        h: &mut [f64],
        _: &mut DMatrix<f64>,
        (phi, out): (&[f64], &mut [f64]),
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) {
        let pose = self.pose_in(piece, p);
        Self::field_at(&pose, p, h);
        Self::tangent_by(&Self::jacobian_at(&pose, p), phi, out, multiply_add);
    }
}

impl HamiltonianSystem for ArmMinimumTorque {
    fn hamiltonian(&self, p: &[f64]) -> f64 {
        let pose = self.pose(p);
        p[4] * p[2]
            + p[5] * p[3]
            + p[6] * pose.acceleration.x
            + p[7] * pose.acceleration.y
            + self.running_cost(p)
    }
}

impl OptimalControlSystem for ArmMinimumTorque {
    fn n_controls(&self) -> usize {
        2
    }

    fn control_into(&self, p: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        expect_controls(u, 2)?;
        u.copy_from_slice(self.pose(p).torque.as_slice());
        Ok(())
    }

    fn running_cost(&self, p: &[f64]) -> f64 {
        self.effort(&self.pose(p))
    }

    #[inline]
    fn running_cost_in(&self, piece: &Piece, p: &[f64]) -> f64 {
        self.effort(&self.pose_in(piece, p))
    }
}
