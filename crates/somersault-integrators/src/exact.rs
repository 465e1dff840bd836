//! The exact motion of a free rigid body: position, orientation and both velocities at any time.
//!
//! ```text
//! r(t) = r₀ + v₀ t,    L = R I ω = const,    I ω' = (I ω) × ω,    R' = R ω̂      (ω, I in principal axes)
//! ```
//!
//! # Angular velocity
//!
//! Let I₁ ≤ I₂ ≤ I₃. L, seen from the body, circulates about the axis c of least inertia where 2T I₂ > L², else about that of
//! greatest; b is the middle axis, a the third. With m = I ω ⁄ L, a frame (x, y, z) = (a, ±b, ±c) with m_z > 0, and s = 1 for
//! c = 3, −1 for c = 1,
//!
//! ```text
//! m = (Mₐ cn u, M_b sn u, M_c dn u),     u = u₀ + s λ t,      D = I₁ (I₂ − I₁) ω₁² − I₃ (I₃ − I₂) ω₃² = 2T I₂ − L²
//! A = I_b |I_b − Iₐ| ω_b² + I_c |I_c − Iₐ| ω_c² = |L² − 2T Iₐ|,    C = Iₐ |I_c − Iₐ| ωₐ² + I_b |I_c − I_b| ω_b² = |2T I_c − L²|
//! λ² = |I_c − I_b| A ⁄ (I₁ I₂ I₃),   k² = |I_b − Iₐ| C ⁄ (|I_c − I_b| A),   k′² = |I_c − Iₐ| |D| ⁄ (|I_c − I_b| A)
//! Mₐ² = Iₐ C ⁄ (|I_c − Iₐ| L²),      M_b² = I_b C ⁄ (|I_c − I_b| L²),       M_c² = I_c A ⁄ (|I_c − Iₐ| L²)
//! ```
//!
//! (Landau and Lifshitz, *Mechanics*, §37). All differences of moments are exact, everything else is positive but D.
//!
//! # Orientation
//!
//! With N(t) the least rotation that carries m to z, R(t) = R₀ N(0)⁻¹ exp(ψ ẑ) N(t) in that frame, and
//!
//! ```text
//! ψ' = (2T⁄L + ω_z) ⁄ (1 + m_z) = L⁄I_c + s C ⁄ (L I_c (1 + M_c dn u))
//! ```
//!
//! has no singularity since m_z > 0 (the splitting into N and exp(ψ ẑ) is that of Celledoni, Fassò, Säfström and Zanna, *The exact
//! computation of the free rigid body motion and its use in splitting methods*, SIAM J. Sci. Comput. 30, 2008). The descending
//! Landen transformation to k₁ = (1 − k′)⁄(1 + k′), v = u⁄(1 + k₁), makes the integrand rational in sn²(v | k₁²),
//!
//! ```text
//! 1 ⁄ (1 + M_c dn u) = (1 + k₁ sn²v) ⁄ ((1 + M_c)(1 + k₁ B sn²v)),        B = (1 − M_c) ⁄ (1 + M_c),
//! ```
//!
//! whose mean over a period is one complete integral of Bulirsch's with positive terms, and whose rest is the phase of a theta
//! function with half the imaginary period at most:
//!
//! ```text
//! ψ(t) = mean(ψ') t − 2 arg θ₄(x + iη, q²) |₀ᵗ,    x = πu⁄2K,    η = πy⁄2K(k₁),    sc(y | 1 − k₁²) = √(B⁄k₁)
//! ```
//!
//! so that half of ψ, as a quaternion needs it, takes no arctangent. (Jacobi's solution by theta functions, as in van Zon and
//! Schofield, *Numerical implementation of the exact dynamics of free rigid bodies*, J. Comput. Phys. 225, 2007, has θ₄ at
//! shifts up to the full imaginary period, near its zeros; Celledoni and Zanna, Algorithm 903, ACM TOMS 37, 2010, use integrals
//! of the third kind.) The series are summed in the nome q for K′⁄K > 1⁄√2, else, by Jacobi's imaginary transformation (DLMF
//! 20.7.30–33), in the complementary nome q′; with q′ = 0 they are the hyperbolic functions of the separatrix.
//!
//! # Branches
//!
//! ω is constant where L × ω = 0 in `f64` data (spheres, symmetric bodies about an axis of their plane of symmetry, principal
//! axes): then R(t) = R₀ exp(ω t). Everything else, symmetric and nearly symmetric or spherical bodies included, takes the
//! formulas above; D = 0 is the separatrix, without periods.
//!
//! # Accuracy
//!
//! As a function of the `f64` data, which are taken as exact: frequencies, mean precession and k′² are formed in double-double,
//! D by the exact sum of its partial products where it nearly vanishes, and phases reduced modulo one turn in double-double.
//! Against references of 30 digits, from needle to disc, near and on the separatrix, at times up to a million periods, the
//! orientation was within 5e-15 rad and the angular velocity within 3e-15, relative, plus 2e-18 of the angle turned where the
//! distance from the separatrix is itself a rounding of the angular velocity in the world. Closer to the unstable rotation
//! than the 1e-10 sampled there, a rounding of the phase, of the order of 1e-15 K ω⁄λ rad, shows after each half period.
//!
//! The motion itself is sensitive: near the separatrix an error of one ulp in ω changes the period in its first digits.
//! Principal moments and axes that come from an eigenvalue problem carry such errors; those of a diagonal tensor do not.
//!
//! # Cost
//!
//! About 120 ns per time; 0.6 to 1 µs for the motion once, 2 µs within 1e-13 of the separatrix. Nothing is allocated.

use crate::body::RigidBody;
use crate::state::RigidBodyState;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use somersault_core::double_double::{CubicProduct, DoubleDouble, difference_of_cubic_products};
use somersault_core::elliptic::{Parameter, QuarterPeriod, carlson_rf, complete_first};
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

/// Why the motion of a free body cannot be given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FreeBodyError {
    /// The initial state has a component that is NaN or infinite.
    #[error("the initial state is not finite")]
    NonFiniteState,
    /// The time, or the state there, is NaN or infinite.
    #[error("the state at t = {t} is not finite")]
    NonFinite {
        /// The time.
        t: f64,
    },
}

/// The motion of a free rigid body, known for all times.
///
/// ```
/// use somersault_integrators::body::RigidBody;
/// use somersault_integrators::exact::FreeBody;
/// use somersault_integrators::nalgebra::Vector3;
/// use somersault_integrators::state::RigidBodyState;
///
/// let body = RigidBody::try_principal(1.0, Vector3::new(1.0, 2.0, 2.5)).unwrap();
/// let start = RigidBodyState::spinning(Vector3::new(0.01, 2.0, 0.0));
/// let motion = FreeBody::try_new(&body, &start).unwrap();
/// let later = motion.at(1e4).unwrap();
/// let back = FreeBody::try_new(&body, &later).unwrap().at(-1e4).unwrap();
/// assert!((back.angular_velocity() - start.angular_velocity()).norm() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FreeBody {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Body frame → principal axes.
    to_principal: UnitQuaternion<f64>,
    rotation: FreeRotation,
}

impl FreeBody {
    /// The motion of `body` that passes through `state` at t = 0.
    ///
    /// The angular velocity is carried from the world to principal axes in double-double; see the [module](self).
    pub fn try_new(body: &RigidBody, state: &RigidBodyState) -> Result<Self, FreeBodyError> {
        if !state.is_finite() {
            return Err(FreeBodyError::NonFiniteState);
        }
        let inertia = body.inertia();
        let axes = inertia.principal_axes();
        let world = state.angular_velocity();
        let in_body = rotate_back(state.orientation(), [0, 1, 2].map(|i| DoubleDouble::new(world[i])));
        let in_principal = rotate_back(axes, in_body);
        Ok(Self {
            position: *state.position(),
            velocity: *state.velocity(),
            to_principal: axes.inverse(),
            rotation: FreeRotation::from_extended(
                inertia.principal_moments(),
                &(state.orientation() * axes),
                in_principal,
            ),
        })
    }

    /// The state at time `t`.
    pub fn at(&self, t: f64) -> Result<RigidBodyState, FreeBodyError> {
        let (principal, in_principal) = self.rotation.at(t);
        let state = RigidBodyState::new(
            self.position + self.velocity * t,
            principal * self.to_principal,
            self.velocity,
            principal * in_principal,
        );
        if t.is_finite() && state.is_finite() { Ok(state) } else { Err(FreeBodyError::NonFinite { t }) }
    }
}

/// R⁻¹ v for the rotation R of a quaternion of any norm but zero, to about 30 digits.
pub(crate) fn rotate_back(q: &UnitQuaternion<f64>, v: [DoubleDouble; 3]) -> [DoubleDouble; 3] {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    if x == 0.0 && y == 0.0 && z == 0.0 {
        return v;
    }
    let p = DoubleDouble::product;
    let (ww, xx, yy, zz) = (p(w, w), p(x, x), p(y, y), p(z, z));
    let off = |a: DoubleDouble, b: DoubleDouble| (a + b).scale(2.0);
    let columns = [
        [ww + xx - yy - zz, off(p(x, y), p(w, z)), off(p(x, z), -p(w, y))],
        [off(p(x, y), -p(w, z)), ww - xx + yy - zz, off(p(y, z), p(w, x))],
        [off(p(x, z), p(w, y)), off(p(y, z), -p(w, x)), ww - xx - yy + zz],
    ];
    let norm_squared = ww + xx + yy + zz;
    columns.map(|[a, b, c]| (a * v[0] + b * v[1] + c * v[2]) / norm_squared)
}

/// The rotation of a free rigid body in its principal axes, known for all times.
///
/// The [module](self) has the formulas, the accuracy and the cost.
#[derive(Clone, Copy, Debug)]
pub struct FreeRotation {
    orientation: UnitQuaternion<f64>,
    motion: Motion,
}

#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)] // a box would allocate once per step of a splitting method
enum Motion {
    Steady(Steady),
    Tumbling(Tumbling),
}

impl FreeRotation {
    /// The motion that passes through `orientation` (principal axes → world) with `angular_velocity_body` at t = 0.
    ///
    /// The moments are positive and finite, in any order, the angular velocity is finite; otherwise what [`at`](Self::at)
    /// returns is not. Components of the angular velocity below 1e-120 of the largest count as zero.
    pub fn new(
        principal_moments: &Vector3<f64>,
        orientation: &UnitQuaternion<f64>,
        angular_velocity_body: &Vector3<f64>,
    ) -> Self {
        let rates = [0, 1, 2].map(|i| DoubleDouble::new(angular_velocity_body[i]));
        Self::from_extended(principal_moments, orientation, rates)
    }

    fn from_extended(
        principal_moments: &Vector3<f64>,
        orientation: &UnitQuaternion<f64>,
        rates: [DoubleDouble; 3],
    ) -> Self {
        let rounded = Vector3::new(rates[0].hi, rates[1].hi, rates[2].hi);
        // scaled by powers of two, so that no product below overflows, nor underflows unless it is negligible
        let (inertia_unit, rate_unit) = (leading_bit(principal_moments), leading_bit(&rounded));
        let moments = principal_moments / inertia_unit;
        let rates = rates.map(|x| {
            let x = DoubleDouble { hi: x.hi / rate_unit, lo: x.lo / rate_unit };
            if x.hi.abs() < 1e-120 { DoubleDouble::default() } else { x }
        });
        let steady = (0..3).all(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            moments[j] == moments[k] || rates[j].hi == 0.0 || rates[k].hi == 0.0
        });
        let motion = if steady {
            Motion::Steady(Steady::new(&rounded, &rates, rate_unit))
        } else {
            Motion::Tumbling(Tumbling::new(&moments, &rates, rate_unit))
        };
        Self { orientation: *orientation, motion }
    }

    /// Orientation (principal axes → world) and angular velocity in principal axes at time `t`.
    ///
    /// Not finite where `t` is not, or where the angle turned exceeds about 1e290.
    pub fn at(&self, t: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let (turned, angular_velocity_body) = match &self.motion {
            Motion::Steady(steady) => steady.at(t),
            Motion::Tumbling(tumbling) => tumbling.at(t),
        };
        let orientation = self.orientation.into_inner() * turned;
        (UnitQuaternion::new_normalize(orientation), angular_velocity_body)
    }
}

/// The power of two that leads the largest component; 1 for zero.
pub(crate) fn leading_bit(v: &Vector3<f64>) -> f64 {
    let largest = v.amax();
    if largest == 0.0 {
        1.0
    } else {
        f64::from_bits(largest.max(f64::MIN_POSITIVE).to_bits() & !((1 << 52) - 1))
    }
}

/// ω is constant: spheres, symmetric bodies about an axis of their plane of symmetry, and principal axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steady {
    angular_velocity_body: Vector3<f64>,
    axis: Vector3<f64>,
    /// |ω|⁄4π.
    half_turns: DoubleDouble,
}

impl Steady {
    pub(crate) fn new(
        angular_velocity_body: &Vector3<f64>,
        rates: &[DoubleDouble; 3],
        rate_unit: f64,
    ) -> Self {
        let square = |i: usize| rates[i] * rates[i];
        let speed = (square(0) + square(1) + square(2)).sqrt();
        Self {
            angular_velocity_body: *angular_velocity_body,
            axis: if speed.hi == 0.0 {
                Vector3::zeros()
            } else {
                Vector3::from_fn(|i, _| rates[i].hi / speed.hi)
            },
            half_turns: in_turns(speed).scale(0.5 * rate_unit),
        }
    }

    pub(crate) fn at(&self, t: f64) -> (Quaternion<f64>, Vector3<f64>) {
        let (s, c) = (TAU * self.half_turns.fraction_of_turns(t)).sin_cos();
        (Quaternion::from_parts(c, self.axis * s), self.angular_velocity_body)
    }
}

/// An angular rate in turns per unit of time.
fn in_turns(rate: DoubleDouble) -> DoubleDouble {
    rate / DoubleDouble::PI.scale(2.0)
}

/// ω is not constant. Frame: x = a, y = ±b, z = ±c with m_z > 0.
#[derive(Clone, Copy, Debug)]
struct Tumbling {
    /// Index of the principal axis, and sign, of each axis of the frame.
    axes: [(usize, f64); 3],
    /// L⁄I about the axes of the frame.
    rates: Vector3<f64>,
    /// ±λ⁄4K, or ±λ itself on the separatrix.
    nutation: DoubleDouble,
    /// The mean of ψ̇⁄4π.
    half_precession: DoubleDouble,
    series: Series,
    start: Phase,
    /// N(0)⁻¹, and the periodic part of the precession at the start.
    untilt: Quaternion<f64>,
    start_factor: (f64, f64),
}

impl Tumbling {
    fn new(moments: &Vector3<f64>, rates: &[DoubleDouble; 3], rate_unit: f64) -> Self {
        let mut order = [0, 1, 2];
        order.sort_unstable_by(|i, j| moments[*i].total_cmp(&moments[*j]));
        let [low, b, high] = order;
        // 2T I₂ − L²
        let term = |i: usize, greater: usize, lesser: usize| CubicProduct {
            factor: moments[i],
            gap: [moments[greater], moments[lesser]],
            root: rates[i],
        };
        let discriminant = difference_of_cubic_products(&term(low, b, low), &term(high, high, b));
        let (a, c, direction) = if discriminant.hi > 0.0 { (high, low, -1.0) } else { (low, high, 1.0) };

        let square = |i: usize| rates[i] * rates[i];
        let gap = |i: usize, j: usize| DoubleDouble::difference(moments[i], moments[j]).abs();
        let (gap_ca, gap_cb, gap_ba) = (gap(c, a), gap(c, b), gap(b, a));
        let (ia, ib, ic) = (moments[a], moments[b], moments[c]);
        let momentum_squared = square(0) * DoubleDouble::product(moments[0], moments[0])
            + square(1) * DoubleDouble::product(moments[1], moments[1])
            + square(2) * DoubleDouble::product(moments[2], moments[2]);
        let momentum = momentum_squared.sqrt();
        // |L² − 2T Iₐ| and |2T I_c − L²|
        let from_a = square(b) * gap_ba * ib + square(c) * gap_ca * ic;
        let from_c = square(a) * gap_ca * ia + square(b) * gap_cb * ib;

        let scale = gap_cb * from_a;
        let m1 = gap_ca * discriminant.abs() / scale;
        let m = gap_ba * from_c / scale;
        let parameter = Parameter::new(m.hi, m1.hi);
        let k_prime = m1.sqrt();
        let one_plus = k_prime + 1.0;
        let k1 = m / (one_plus * one_plus);
        let full = gap_ca * momentum_squared;
        let tallest = (from_a * ic / full).sqrt();
        let tall_plus = tallest + 1.0;
        let b_ratio = from_c * ia / (full * tall_plus * tall_plus);
        let lambda = (scale / (DoubleDouble::product(ia, ib) * ic)).sqrt().scale(direction * rate_unit);

        let (quarter, nutation, average) = if m1.hi > 0.0 {
            let quarter = QuarterPeriod::new(
                k_prime.sqrt().scale(2.0) / one_plus,
                k1 * b_ratio + 1.0,
                DoubleDouble::new(1.0),
                k1 + 1.0,
            );
            let k = quarter.first * (k1 + 1.0);
            (k.hi, lambda / k.scale(4.0), quarter.average / tall_plus)
        } else {
            (f64::INFINITY, lambda, DoubleDouble::new(1.0))
        };
        let precession = (momentum_squared + (from_c * average).scale(direction)) / (momentum * ic);

        let amplitude = |i: f64, squared: DoubleDouble, gap: DoubleDouble| {
            (i * squared.hi / (gap.hi * momentum_squared.hi)).sqrt()
        };
        let amplitudes = [amplitude(ia, from_c, gap_ca), amplitude(ib, from_c, gap_cb), tallest.hi];
        let series = Series::new(&parameter, quarter, k1.hi, b_ratio.hi, &amplitudes);

        let sign_z = if rates[c].hi < 0.0 { -1.0 } else { 1.0 };
        let even = (b + 3 - a) % 3 == 1;
        let sign_y = if even { sign_z } else { -sign_z };
        let axes = [(a, 1.0), (b, sign_y), (c, sign_z)];
        let x = rates[a].hi;
        let y = sign_y * rates[b].hi * (ib * gap_cb.hi / (ia * gap_ca.hi)).sqrt();
        let start = Phase::of_amplitude(y, x, &parameter, quarter);

        let momenta = Vector3::from_fn(|i, _| axes[i].1 * rates[axes[i].0].hi * moments[axes[i].0]);
        let m = momenta.normalize();
        let untilt = Quaternion::new(1.0 + m.z, -m.y, m.x, 0.0) / (2.0 * (1.0 + m.z)).sqrt();
        let (_, re, im) = series.evaluate(&start);
        let norm = re.hypot(im);
        Self {
            axes,
            rates: Vector3::from_fn(|i, _| momentum.hi / moments[axes[i].0] * rate_unit),
            nutation,
            half_precession: in_turns(precession).scale(0.5 * rate_unit),
            series,
            start,
            untilt,
            start_factor: (re / norm, im / norm),
        }
    }

    fn at(&self, t: f64) -> (Quaternion<f64>, Vector3<f64>) {
        let phase = match self.series.quarter {
            f64::INFINITY => {
                let shift = self.nutation.hi * t + self.nutation.lo * t;
                Phase { position: self.start.position + shift, ..self.start }
            }
            _ => self.start.advanced(self.nutation.fraction_of_turns(t)),
        };
        let (m, re, im) = self.series.evaluate(&phase);
        let drift = self.series.drift * (phase.position - self.start.position);
        let (s, c) = (TAU * self.half_precession.fraction_of_turns(t) + drift).sin_cos();
        // exp(iψ⁄2), up to the norm of re + i im
        let (c, s) = (c * re + s * im, s * re - c * im);
        let (re, im) = self.start_factor;
        let (c, s) = (c * re - s * im, c * im + s * re);
        let tall = 1.0 + m.z;
        let tilted = Quaternion::new(c * tall, c * m.y + s * m.x, s * m.y - c * m.x, s * tall);
        let turned = self.untilt * tilted;

        let mut turned_axis = Vector3::zeros();
        let mut angular_velocity = Vector3::zeros();
        for (i, (axis, sign)) in self.axes.iter().enumerate() {
            turned_axis[*axis] = sign * turned.imag()[i];
            angular_velocity[*axis] = sign * self.rates[i] * m[i];
        }
        (Quaternion::from_parts(turned.scalar(), turned_axis), angular_velocity)
    }
}

/// An argument u of the elliptic functions, less a whole number of half periods 2K.
#[derive(Clone, Copy, Debug)]
struct Phase {
    /// u⁄4K in [−¼, ¼], or u itself on the separatrix.
    position: f64,
    /// −1 after an odd number of half periods, which change the signs of sn and cn.
    sign: f64,
}

impl Phase {
    /// The u with sn u : cn u = `y` : `x`.
    fn of_amplitude(y: f64, x: f64, parameter: &Parameter, quarter: f64) -> Self {
        let norm = y.hypot(x);
        let (sn, cn) = (y / norm, x / norm);
        let u = sn * carlson_rf(cn * cn, cn * cn + parameter.m1() * sn * sn, 1.0);
        let sign = if x < 0.0 { -1.0 } else { 1.0 };
        let unit = if quarter == f64::INFINITY { 1.0 } else { 4.0 * quarter };
        Self { position: sign * u / unit, sign }
    }

    fn advanced(&self, turns: f64) -> Self {
        let mut position = self.position + turns;
        let half_turns = (2.0 * position).round();
        position -= 0.5 * half_turns;
        let odd = (0.5 * half_turns).fract() != 0.0;
        Self { position, sign: if odd { -self.sign } else { self.sign } }
    }
}

/// Theta series of one motion: what does not depend on time.
#[derive(Clone, Copy, Debug)]
struct Series {
    /// K, infinite on the separatrix.
    quarter: f64,
    /// The part of ψ⁄2 − ½ mean(ψ̇) t that is linear within a half period, per unit of position.
    drift: f64,
    /// Factors of θ₂, θ₁ and θ₃ in m.
    weights: [f64; 3],
    expansion: Expansion,
}

#[derive(Clone, Copy, Debug)]
enum Expansion {
    Circular {
        /// qⁿ⁽ⁿ⁺¹⁾, n = 1, 2, 3.
        odd: [f64; 3],
        /// 2 qⁿⁿ, n = 1, …, 4.
        even: [f64; 4],
        /// 2 q²ⁿⁿ cosh 2nη and 2 q²ⁿⁿ sinh 2nη, n = 1, 2, 3.
        shifted: [(f64, f64); 3],
    },
    Hyperbolic {
        /// w = πu⁄2K′ per unit of position, and at u = K.
        rate: f64,
        corner: f64,
        /// q′, the nome of the complementary modulus, and its square root.
        nome: f64,
        root: f64,
        /// cos and sin of (2n + 1)η, n = 0, …, 4.
        shifts: [(f64, f64); 5],
    },
}

impl Series {
    fn new(parameter: &Parameter, quarter: f64, k1: f64, b_ratio: f64, amplitudes: &[f64; 3]) -> Self {
        let dual_quarter = complete_first(&parameter.complement());
        let ratio = dual_quarter / quarter;
        // the imaginary shift of the theta function, in units of the Landen-transformed argument
        let shift = (b_ratio / k1).sqrt() * carlson_rf(1.0, 1.0 + k1 * b_ratio, 1.0 + b_ratio / k1);
        if ratio < FRAC_1_SQRT_2 {
            let corner = 0.5 * PI / ratio;
            let nome = (-2.0 * corner).exp();
            let (nome2, nome4) = (nome * nome, nome.powi(4));
            let two = 1.0 + nome2 + nome2 * nome4;
            let three = 1.0 + 2.0 * (nome + nome4);
            let four = 1.0 + 2.0 * (nome4 - nome);
            let eta = 0.25 * PI * shift * (1.0 + k1) / dual_quarter;
            let (unit, drift) =
                if quarter == f64::INFINITY { (1.0, 0.0) } else { (4.0 * quarter, 4.0 * eta) };
            Self {
                quarter,
                drift,
                weights: [
                    amplitudes[0] * two / four,
                    amplitudes[1] * three / four,
                    amplitudes[2] * two / three,
                ],
                expansion: Expansion::Hyperbolic {
                    rate: 0.5 * PI / dual_quarter * unit,
                    corner,
                    nome,
                    root: (-corner).exp(),
                    shifts: std::array::from_fn(|n| {
                        let (s, c) = ((2 * n + 1) as f64 * eta).sin_cos();
                        (c, s)
                    }),
                },
            }
        } else {
            let log_nome = -PI * ratio;
            let q = log_nome.exp();
            let q2 = q * q;
            let (q4, q6) = (q2 * q2, q2 * q2 * q2);
            let (q9, q12, q16) = (q6 * q2 * q, q6 * q6, q6 * q6 * q4);
            let two = 1.0 + q2 + q6 + q12;
            let three = 1.0 + 2.0 * (q + q4 + q9 + q16);
            let four = 1.0 + 2.0 * (q4 - q - q9 + q16);
            let shifted = if k1 > 0.0 {
                let twice = PI * shift * (1.0 + k1) / quarter;
                let (up, down) = ((2.0 * log_nome + twice).exp(), (2.0 * log_nome - twice).exp());
                [(up, down, 1.0), (up * up, down * down, q4), (up * up * up, down * down * down, q12)]
                    .map(|(up, down, scale)| ((up + down) * scale, (up - down) * scale))
            } else {
                [(0.0, 0.0); 3]
            };
            Self {
                quarter,
                drift: 0.0,
                weights: [
                    amplitudes[0] * four / two,
                    amplitudes[1] * three / two,
                    amplitudes[2] * four / three,
                ],
                expansion: Expansion::Circular {
                    odd: [q2, q6, q12],
                    even: [2.0 * q, 2.0 * q4, 2.0 * q9, 2.0 * q16],
                    shifted,
                },
            }
        }
    }

    /// m, and the theta function with imaginary shift up to a positive factor.
    fn evaluate(&self, phase: &Phase) -> (Vector3<f64>, f64, f64) {
        let (cn, sn, dn, re, im) = match &self.expansion {
            Expansion::Circular { odd, even, shifted } => circular(TAU * phase.position, odd, even, shifted),
            Expansion::Hyperbolic { rate, corner, nome, root, shifts } => {
                hyperbolic(rate * phase.position, *corner, *nome, *root, shifts)
            }
        };
        let m = Vector3::new(
            phase.sign * self.weights[0] * cn,
            phase.sign * self.weights[1] * sn,
            self.weights[2] * dn,
        );
        (m / m.norm(), re, im)
    }
}

/// θ₂(x), θ₁(x), θ₃(x) up to factors, and θ₄(x + iη), for nomes up to 0.11.
fn circular(x: f64, odd: &[f64; 3], even: &[f64; 4], shifted: &[(f64, f64); 3]) -> (f64, f64, f64, f64, f64) {
    let (s1, c1) = x.sin_cos();
    let (c2, s2) = (c1 * c1 - s1 * s1, 2.0 * c1 * s1);
    let next = |(c, s): (f64, f64)| (c * c2 - s * s2, s * c2 + c * s2);
    let o3 = next((c1, s1));
    let o5 = next(o3);
    let o7 = next(o5);
    let e4 = next((c2, s2));
    let e6 = next(e4);
    let e8 = next(e6);
    let cn = c1 + (odd[0] * o3.0 + (odd[1] * o5.0 + odd[2] * o7.0));
    let sn = s1 - (odd[0] * o3.1 - (odd[1] * o5.1 - odd[2] * o7.1));
    let dn = 1.0 + (even[0] * c2 + (even[1] * e4.0 + (even[2] * e6.0 + even[3] * e8.0)));
    let re = 1.0 - (shifted[0].0 * c2 - (shifted[1].0 * e4.0 - shifted[2].0 * e6.0));
    let im = shifted[0].1 * s2 - (shifted[1].1 * e4.1 - shifted[2].1 * e6.1);
    (cn, sn, dn, re, im)
}

/// The same by Jacobi's imaginary transformation: θ₄(iw), θ₁(iw)⁄i, θ₃(iw) for the nome q′, and θ₂(iw⁄2 − η) for √q′, up to
/// factors, for |w| up to `corner` and q′ up to 0.012.
fn hyperbolic(
    w: f64,
    corner: f64,
    nome: f64,
    root: f64,
    shifts: &[(f64, f64); 5],
) -> (f64, f64, f64, f64, f64) {
    // e⁻|w| and q′¹ᐟ² e|w|, both at most 1
    let fall = (-w.abs()).exp();
    let rise = (w.abs() - corner).exp();
    let (fall2, rise2) = (fall * fall, rise * rise);
    let (nome2, nome4) = (nome * nome, nome.powi(4));
    let first = rise2 + nome * fall2;
    let second = nome2 * (rise2 * rise2 + nome2 * fall2 * fall2);
    let third = nome2 * nome4 * rise2 * rise2 * rise2;
    let cn = 2.0 * fall * (1.0 - (first - (second - third)));
    let dn = 2.0 * fall * (1.0 + (first + (second + third)));
    let sn = (1.0 - fall2) - nome * (rise2 - nome * fall2 * fall2)
        + nome4 * (rise2 * rise2 - nome2 * fall2 * fall2 * fall2);
    let (mut re, mut im) = (0.0, 0.0);
    // root^(n²) riseⁿ and root^(n² + n) fallⁿ⁺¹
    let (mut up, mut down) = (1.0, fall);
    let (mut odd_power, mut even_power) = (root, nome);
    for (c, s) in shifts {
        re += c * (up + down);
        im += s * (up - down);
        up *= odd_power * rise;
        down *= even_power * fall;
        odd_power *= nome;
        even_power *= nome;
    }
    (cn, sn.copysign(w), dn, re, im.copysign(w))
}
