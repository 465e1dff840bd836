//! The exact motion of a free gyrostat: a rigid body that carries rotors of constant relative angular momentum.
//!
//! ```text
//! L = I ω + h,    L' = L × ω,    R' = R ω̂,    r(t) = r₀ + v₀ t      (body frame; R L = const in the world)
//! ```
//!
//! h (N m s) is constant in the body: that of symmetric rotors which motors keep at constant speed relative to the body, I being
//! the inertia of the body with the rotors in it; or that of rotors without friction about their axes, I then being without
//! their moments about these, I − Σ J a aᵀ. With h = 0 the motion is that of [`FreeBody`].
//!
//! # Angular momentum
//!
//! On |L| = G let l = L⁄G, A = I⁻¹ = diag(a_i), p_i = G a_i and b_i = a_i h_i in principal axes. Then l' = l × (p l − b), and the
//! energy is a quadric in X = (l, 1), Q(X) = Σ p_i l_i² − 2 Σ b_i l_i + q₀ = 0, which meets the sphere X·X = |l|² − 1 = 0. A Lorentz
//! transformation of X maps the sphere to itself, and the flow to that of the transformed quadric, at the same time. The
//! eigenvalues μ of the quadric are the zeros of Σ (ω_i − μ l_i)² ⁄ (p_i − μ), ω the angular velocity, a polynomial
//! of degree four, with the eigenvectors (b_i ⁄ (p_i − μ), 1). Between two p_i there is one; the other two decide:
//!
//! *Four real ones*, one of time, with the differences d_i = μ_i − μ_time: Σ d_i y_i² = 0 is a **free body**. Let d_b be in the middle and
//! d_c alone with its sign:
//!
//! ```text
//! y = (√(−d_c⁄(d_a − d_c)) cn u, √(−d_c⁄(d_b − d_c)) sn u, ±√(d_a⁄(d_a − d_c)) dn u),
//! u' = ±√(d_a (d_b − d_c)),       k² = d_c (d_b − d_a) ⁄ (d_a (d_b − d_c)),       k′² = d_b (d_a − d_c) ⁄ (d_a (d_b − d_c))
//! ```
//!
//! *A complex pair* m ± iρ, ρ > 0: with α, β ≤ α the two others less m, (α x² + β y²)⁄2 + ρ z = 0 is a **pendulum in libration**. With
//! R_α = √(α² + ρ²), φ_α = atan2(ρ, α) and z = −tan(π⁄4 − δ), the angle ϑ = 4δ − φ_α − φ_β obeys ϑ'' = −4 R_α R_β sin ϑ and has the
//! amplitude φ_β − φ_α:
//!
//! ```text
//! (x, y) ∝ (√(ρ⁄R_α) sn u dn u, √(ρ⁄R_β) cn u) ⁄ √(dn⁴u + k² k′² sn⁴u),
//! 2δ = φ_α + atan2(k k′ (1 + cn 2u), k′² − k² cn 2u) = φ_β − atan2(k k′ (1 − cn 2u), k′² + k² cn 2u),
//! u' = ±√(R_α R_β),       k² = (R_α R_β − αβ − ρ²) ⁄ (2 R_α R_β)
//! ```
//!
//! Back in the body X = A x + B y + C cos δ + D sin δ, or X = A cn + B sn + D dn + C. Near separatrices, and where another curve of the
//! same energy shrinks to a point, the transformation is a large boost and these sums cancel; they are taken from where they
//! do not, about the point of the sphere that the boost leads to. All that does not depend on time is formed in double-double.
//!
//! # Orientation
//!
//! With N(t) the least rotation that carries l to a fixed pole p of the body, R(t) = R₀ N(0)⁻¹ exp(ψ p̂) N(t) and
//!
//! ```text
//! ψ' = ω·(l + p) ⁄ (1 + l·p)
//! ```
//!
//! p is chosen so that l stays away from −p. ψ' is analytic in time and has the period of l: its mean and its Fourier series, from
//! as many values as it takes for the series to end below rounding, give ψ.
//!
//! # Accuracy
//!
//! A few roundings, and those of the data times what the motion is sensitive to them: at times up to 7.5 s of bodies that turn at some rad/s within 1e-13
//! of the condition against series of 30 digits (`tests/python/test_gyrostat.py`). [`Gyrostat::residual`] is by how much the solution
//! found violates its own equations, checked as the motion is made; where that exceeds 1e-9, or where the series takes more
//! than 4096 values, there is an error in the place of a motion: within some 1e-11 of a separatrix.
//!
//! # Cost
//!
//! About 0.5 ms for the motion once, with the number of values squared, and 3 µs per time.
//!
//! Sources: N. E. Zhukovskii, *On the motion of a rigid body having cavities filled with a homogeneous liquid*, 1885, and V. Volterra,
//! *Sur la théorie des variations des latitudes*, Acta Math. 22 (1899) 201, who solved it by elliptic functions; J. Wittenburg,
//! *Dynamics of Systems of Rigid Bodies*, Teubner 1977, §4.6.

mod conic;

use crate::body::RigidBody;
use crate::exact::{FreeBody, FreeBodyError, Steady, leading_bit, rotate_back};
use crate::state::RigidBodyState;
use conic::Path;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use somersault_core::argument::{ArgumentError, expect_finite};
use somersault_core::double_double::DoubleDouble;
use std::f64::consts::{PI, TAU};

/// Why the motion of a gyrostat cannot be given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GyrostatError {
    /// The angular momentum of the rotors is not finite, or the total one is too small or too large for numbers.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The initial state, the time or the state there is not finite.
    #[error(transparent)]
    State(#[from] FreeBodyError),
    /// The state is so close to a separatrix that the closed form does not reach 1e-9.
    #[error(
        "the motion is too close to a separatrix for the closed form: its equations hold to {residual:e} only, allowed is {allowed:e}; integrate it instead"
    )]
    Separatrix {
        /// By how much the equations are violated, relative; infinite where there is no solution at all.
        residual: f64,
        /// The most that is allowed.
        allowed: f64,
    },
}

/// Sizes of the angular momentum, N m s.
const LEAST: f64 = 1e-60;
const MOST: f64 = 1e60;

/// The largest residual of a motion.
const ALLOWED: f64 = 1e-9;

/// Values per period at first and at most.
const VALUES: (usize, usize) = (64, 4096);

/// The motion of a free gyrostat, known for all times.
///
/// ```
/// use somersault_integrators::body::RigidBody;
/// use somersault_integrators::gyrostat::Gyrostat;
/// use somersault_integrators::nalgebra::Vector3;
/// use somersault_integrators::state::RigidBodyState;
///
/// let body = RigidBody::try_principal(1.0, Vector3::new(1.0, 2.0, 2.5)).unwrap();
/// let start = RigidBodyState::spinning(Vector3::new(0.1, 0.4, 0.2));
/// let motion = Gyrostat::try_new(&body, &Vector3::new(0.0, 0.0, 1.5), &start).unwrap();
/// let later = motion.at(1e3).unwrap();
/// let momentum = later.orientation() * (Vector3::new(0.0, 0.0, 1.5)) + body.angular_momentum(&later);
/// assert!((momentum - motion.angular_momentum()).norm() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct Gyrostat {
    angular_momentum: Vector3<f64>,
    motion: Motion,
}

#[derive(Clone, Debug)]
enum Motion {
    Free(FreeBody),
    Carrying(Carrying),
}

/// With rotors.
#[derive(Clone, Debug)]
struct Carrying {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Principal axes → world at the start.
    orientation: UnitQuaternion<f64>,
    /// Body frame → principal axes.
    to_principal: UnitQuaternion<f64>,
    rotation: Rotation,
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one motion is kept and asked many times")]
enum Rotation {
    Steady(Steady),
    Turning(Turning),
}

impl Gyrostat {
    /// The motion of `body` with rotors of the angular momentum `rotors` relative to it, body frame, N m s, that passes through `state` at
    /// t = 0.
    pub fn try_new(
        body: &RigidBody,
        rotors: &Vector3<f64>,
        state: &RigidBodyState,
    ) -> Result<Self, GyrostatError> {
        expect_finite("rotors", rotors.iter())?;
        let angular_momentum = body.angular_momentum(state) + state.orientation() * rotors;
        if *rotors == Vector3::zeros() {
            let motion = Motion::Free(FreeBody::try_new(body, state)?);
            return Ok(Self { angular_momentum, motion });
        }
        if !state.is_finite() {
            return Err(FreeBodyError::NonFiniteState.into());
        }
        // its fourth powers and their inverses are numbers
        let size = angular_momentum.norm();
        if !(LEAST..=MOST).contains(&size) && size != 0.0 {
            let allowed = "of a total angular momentum from 1e-60 to 1e60 N m s, or of none";
            return Err(ArgumentError::OutOfRange { argument: "rotors", allowed, found: size }.into());
        }
        let inertia = body.inertia();
        let axes = inertia.principal_axes();
        let extended = |v: &Vector3<f64>| [0, 1, 2].map(|i| DoubleDouble::new(v[i]));
        let in_body = rotate_back(state.orientation(), extended(state.angular_velocity()));
        let rates = rotate_back(axes, in_body);
        let rotors = rotate_back(axes, extended(rotors));
        let motion = Motion::Carrying(Carrying {
            position: *state.position(),
            velocity: *state.velocity(),
            orientation: state.orientation() * axes,
            to_principal: axes.inverse(),
            rotation: Rotation::new(inertia.principal_moments(), rates, rotors)?,
        });
        Ok(Self { angular_momentum, motion })
    }

    /// The angular momentum of body and rotors about the centre of mass, R (I ω + h), world frame, N m s: constant.
    pub fn angular_momentum(&self) -> &Vector3<f64> {
        &self.angular_momentum
    }

    /// By how much the solution violates its equations, |l' − l × ω| ⁄ |ω| and |l| − 1, at most, relative: a few roundings but near
    /// separatrices, and at most 1e-9. Zero for a body without rotors and for a steady rotation.
    pub fn residual(&self) -> f64 {
        match &self.motion {
            Motion::Carrying(Carrying { rotation: Rotation::Turning(turning), .. }) => turning.residual,
            Motion::Carrying(_) | Motion::Free(_) => 0.0,
        }
    }

    /// The state at time `t`.
    pub fn at(&self, t: f64) -> Result<RigidBodyState, GyrostatError> {
        let carrying = match &self.motion {
            Motion::Free(motion) => return Ok(motion.at(t)?),
            Motion::Carrying(carrying) => carrying,
        };
        let (turned, in_principal) = match &carrying.rotation {
            Rotation::Steady(steady) => steady.at(t),
            Rotation::Turning(turning) => turning.at(t),
        };
        let principal = UnitQuaternion::new_normalize(carrying.orientation.into_inner() * turned);
        let state = RigidBodyState::new(
            carrying.position + carrying.velocity * t,
            principal * carrying.to_principal,
            carrying.velocity,
            principal * in_principal,
        );
        if t.is_finite() && state.is_finite() {
            Ok(state)
        } else {
            Err(FreeBodyError::NonFinite { t }.into())
        }
    }
}

impl Rotation {
    /// In principal axes, with the angular velocity and the angular momentum of the rotors.
    fn new(
        moments: &Vector3<f64>,
        rates: [DoubleDouble; 3],
        rotors: [DoubleDouble; 3],
    ) -> Result<Self, GyrostatError> {
        // scaled by powers of two, as the free body is
        let rounded = |v: &[DoubleDouble; 3]| Vector3::new(v[0].hi, v[1].hi, v[2].hi);
        let inertia_unit = leading_bit(moments);
        let largest = rounded(&rates).amax().max(rounded(&rotors).amax() / inertia_unit);
        let rate_unit = leading_bit(&Vector3::repeat(largest));
        let divided = |x: DoubleDouble, unit: f64| DoubleDouble { hi: x.hi / unit, lo: x.lo / unit };
        let moments = moments / inertia_unit;
        let rates = rates.map(|x| divided(x, rate_unit));
        let rotors = rotors.map(|x| divided(divided(x, inertia_unit), rate_unit));

        let momentum: [DoubleDouble; 3] = std::array::from_fn(|i| rates[i] * moments[i] + rotors[i]);
        let square = momentum[0] * momentum[0] + momentum[1] * momentum[1] + momentum[2] * momentum[2];
        let size = square.sqrt();
        let (l, omega) = (rounded(&momentum), rounded(&rates));
        if l.cross(&omega).norm() <= f64::EPSILON * l.norm() * omega.norm() {
            return Ok(Self::Steady(Steady::new(&(omega * rate_unit), &rates, rate_unit)));
        }
        let one = DoubleDouble::new(1.0);
        let inverse: [DoubleDouble; 3] = std::array::from_fn(|i| one / DoubleDouble::new(moments[i]));
        let nowhere = GyrostatError::Separatrix { residual: f64::INFINITY, allowed: ALLOWED };
        let path = Path::new(
            inverse.map(|a| size * a),
            std::array::from_fn(|i| inverse[i] * rotors[i]),
            momentum.map(|x| x / size),
        )
        .ok_or(nowhere)?;
        let spin = Spin { size: size.hi, moments, rotors: rounded(&rotors) };
        Turning::new(path, spin, &(l / size.hi), rate_unit).map(Self::Turning)
    }
}

/// ω as a function of l, in principal axes.
#[derive(Clone, Copy, Debug)]
struct Spin {
    size: f64,
    moments: Vector3<f64>,
    rotors: Vector3<f64>,
}

impl Spin {
    fn rate(&self, l: &Vector3<f64>) -> Vector3<f64> {
        (l * self.size - self.rotors).component_div(&self.moments)
    }
}

/// ω is not constant.
#[derive(Clone, Debug)]
struct Turning {
    path: Path,
    spin: Spin,
    rate_unit: f64,
    pole: Vector3<f64>,
    /// N(0)⁻¹.
    untilt: Quaternion<f64>,
    /// The mean of ψ̇⁄4π.
    half_mean: DoubleDouble,
    /// The periodic part of ψ⁄2: factors of cos 2πns and sin 2πns, n = 1, 2, …, s being turns.
    series: Vec<(f64, f64)>,
    start: f64,
    residual: f64,
}

impl Turning {
    fn new(path: Path, spin: Spin, l: &Vector3<f64>, rate_unit: f64) -> Result<Self, GyrostatError> {
        let (mut values, most) = VALUES;
        let mut before = f64::INFINITY;
        loop {
            let samples: Vec<_> = (0..values).map(|j| path.at(j as f64 / values as f64)).collect();
            let pole = pole(&samples);
            let rates: Vec<_> = samples.iter().map(|(l, _)| precession(&spin.rate(l), l, &pole)).collect();
            let (mean, series) = fourier(&rates);
            let largest = rates.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let tail = &series[series.len() * 3 / 4..];
            let rest = tail.iter().fold(0.0, |most: f64, (a, b)| most.max(a.abs().max(b.abs())));
            let mut residual = residual(&path, &spin, &samples);
            residual = residual.max((path.at(path.turns(0.0)).0 - l).norm());
            let is_resolved = rest <= 4e-16 * largest;
            // l may need more values than ψ'; where they do not help, what is left is rounding
            let improves = residual > 1e-12 && residual < 0.25 * before;
            if values < most && (!is_resolved || improves) {
                (values, before) = (2 * values, residual);
                continue;
            }
            residual = if is_resolved { residual } else { residual.max(rest / largest) };
            if residual.is_nan() || residual > ALLOWED {
                return Err(GyrostatError::Separatrix { residual, allowed: ALLOWED });
            }
            let needed = series.iter().rposition(|(a, b)| a.abs().max(b.abs()) > 1e-17 * largest);
            // of the integral over time of half the rate
            let factor = |n: usize| 0.5 / (TAU * (n + 1) as f64 * path.frequency.hi);
            let series: Vec<_> = series[..needed.map_or(0, |n| n + 1)]
                .iter()
                .enumerate()
                .map(|(n, (a, b))| (-b * factor(n), a * factor(n)))
                .collect();
            let half_mean = (mean / DoubleDouble::PI).scale(0.25 * rate_unit);
            let start = evaluate(&series, path.turns(0.0));
            let untilt = tilt(&path.at(path.turns(0.0)).0, &pole).conjugate();
            return Ok(Self { path, spin, rate_unit, pole, untilt, half_mean, series, start, residual });
        }
    }

    fn at(&self, t: f64) -> (Quaternion<f64>, Vector3<f64>) {
        let turns = self.path.turns(t * self.rate_unit);
        let (l, _) = self.path.at(turns);
        let half = TAU * self.half_mean.fraction_of_turns(t) + (evaluate(&self.series, turns) - self.start);
        let (s, c) = half.sin_cos();
        let turned = self.untilt * Quaternion::from_parts(c, self.pole * s) * tilt(&l, &self.pole);
        (turned, self.spin.rate(&l) * self.rate_unit)
    }
}

/// The least rotation that carries l to the pole.
fn tilt(l: &Vector3<f64>, pole: &Vector3<f64>) -> Quaternion<f64> {
    let tall = 1.0 + l.dot(pole);
    Quaternion::from_parts(tall, l.cross(pole)) / (2.0 * tall).sqrt()
}

/// ψ'.
fn precession(omega: &Vector3<f64>, l: &Vector3<f64>, pole: &Vector3<f64>) -> f64 {
    omega.dot(&(l + pole)) / (1.0 + l.dot(pole))
}

/// The pole, among the axes and the mean of l, from whose opposite l stays away the farthest.
fn pole(samples: &[(Vector3<f64>, f64)]) -> Vector3<f64> {
    let mean: Vector3<f64> = samples.iter().map(|(l, _)| l).sum();
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let candidates = axes.into_iter().flat_map(|axis| [axis, -axis]).chain(mean.try_normalize(0.0));
    let nearest =
        |pole: &Vector3<f64>| samples.iter().fold(2.0, |least: f64, (l, _)| least.min(1.0 + l.dot(pole)));
    candidates
        .map(|pole| (nearest(&pole), pole))
        .fold((f64::NEG_INFINITY, Vector3::x()), |best, next| if next.0 > best.0 { next } else { best })
        .1
}

/// The mean of values at equal distances over a period, and the factors of cos 2πns and sin 2πns, n = 1, 2, … below the half of
/// their number.
fn fourier(values: &[f64]) -> (DoubleDouble, Vec<(f64, f64)>) {
    let count = values.len();
    let mean =
        values.iter().fold(DoubleDouble::default(), |sum, x| sum + *x) / DoubleDouble::new(count as f64);
    let circle: Vec<_> = (0..count).map(|j| (TAU * j as f64 / count as f64).sin_cos()).collect();
    let factors = (1..count / 2).map(|n| {
        let (mut a, mut b) = (0.0, 0.0);
        for (j, value) in values.iter().enumerate() {
            let (s, c) = circle[j * n % count];
            let value = value - mean.hi;
            a += value * c;
            b += value * s;
        }
        (2.0 * a / count as f64, 2.0 * b / count as f64)
    });
    (mean, factors.collect())
}

/// Σ aₙ cos 2πns + bₙ sin 2πns, by Clenshaw's recurrence.
fn evaluate(series: &[(f64, f64)], turns: f64) -> f64 {
    let (s, c) = (TAU * turns).sin_cos();
    let (mut a, mut b) = ((0.0, 0.0), (0.0, 0.0));
    for (cosine, sine) in series.iter().rev() {
        a = (cosine + 2.0 * c * a.0 - a.1, a.0);
        b = (sine + 2.0 * c * b.0 - b.1, b.0);
    }
    a.0 * c - a.1 + b.0 * s
}

/// By how much l' = l × ω and |l| = 1 are violated at most, relative: l' is that of the trigonometric polynomial through the
/// samples, at eight of them.
fn residual(path: &Path, spin: &Spin, samples: &[(Vector3<f64>, f64)]) -> f64 {
    let count = samples.len();
    let fastest = samples.iter().fold(0.0, |most: f64, (l, _)| most.max(spin.rate(l).norm()));
    let off_sphere =
        samples.iter().fold(0.0, |most: f64, (_, off)| if off.is_nan() { *off } else { most.max(*off) });
    (0..8).map(|n| n * count / 8).fold(off_sphere, |most, j| {
        let l = samples[j].0;
        let slope: Vector3<f64> = (1..count)
            .map(|k| {
                let other = samples[(j + k) % count].0;
                let weight = PI / (PI * k as f64 / count as f64).tan();
                (other - l) * if k % 2 == 0 { -weight } else { weight }
            })
            .sum();
        let off = (slope * path.frequency.hi - l.cross(&spin.rate(&l))).norm() / fastest;
        if off.is_nan() { off } else { most.max(off) }
    })
}
