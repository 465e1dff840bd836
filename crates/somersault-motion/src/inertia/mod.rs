//! The inertia of a free rigid body, up to a factor, from the attitudes of its tumble.
//!
//! Without torque L = R I ω is constant, and attitudes R(t_k) tell I up to a factor. The second moments of mass S = exp M, with M
//! symmetric and without trace, are five numbers, any of which are a body, I = tr(S) − S; with R₀ exp(δ) and ω in the middle of the
//! record they are eleven unknowns x. They are those of
//!
//! ```text
//! min Σ |r_k|² ⁄ σ²,    r_k = log(R(t_k; x)ᵀ R_k)
//! ```
//!
//! with the exact motion R(t; x) ([`FreeRotation`](somersault_integrators::exact::FreeRotation)).
//!
//! 1. **Starts.** Cubics through windows of attitudes give angular velocities; R I ω = L and ω · I ω = 2T, linear in I, L and T, then
//!    give I as the last right singular vector. More starts are drawn at random.
//! 2. **Fits** from each start, over horizons that grow from the middle of the record, within which the inertia is tied to where it
//!    begins: a trust region of Levenberg and Marquardt, scaled as J. J. Moré's, with derivatives by central differences. Once a fit
//!    leaves independent noise alone, three more begin near it and four elsewhere, in search of another inertia that fits as well.
//! 3. **Verdict.** With the derivative J of the residuals the covariance is (JᵀJ)⁻¹ σ², from which intervals follow by linearisation; those of
//!    the ratios of moments end where the profile of the likelihood does, which is farther where the least squares lie in a valley that bends. The
//!    residuals are tested for their size, where the noise is known, and for the correlation of neighbours, at the level 10⁻⁶; the motion
//!    against steady rotation about an axis, each pair of moments against equality, and each other fit against the best, at the level
//!    10⁻³. Two moments that are taken for equal differ by at most 5 % at the level of the intervals, which include that difference.
//!    A fit whose search did not end is no success.
//!
//! What is not determined is NaN, and the [status](InertiaStatus) says why.
//!
//! Cost: some hundred evaluations of the motion for each of 8 to 19 starts, 0.2 µs for each attitude, beside the decompositions.
//!
//! Sources: L. D. Landau and E. M. Lifshitz, *Mechanics*, §37; J. J. Moré, *The Levenberg–Marquardt algorithm*, Lecture Notes in
//! Mathematics 630, Springer 1978; G. A. F. Seber and C. J. Wild, *Nonlinear Regression*, Wiley 1989, §5.

mod descent;
mod distribution;
mod problem;
mod profile;
mod search;
mod triangle;
mod verdict;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::argument::{
    ArgumentError, expect_finite, expect_least, expect_length, expect_positive, expect_range,
};
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::exact::{FreeBody, FreeBodyError};
use somersault_integrators::state::RigidBodyState;

/// The least number of attitudes.
pub const LEAST_ATTITUDES: usize = 6;
/// The turn between two attitudes beyond which the way round is doubtful, rad.
const FAR: f64 = 2.0;

/// Why an inertia cannot be estimated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InertiaEstimateError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Times are not finite, or do not increase.
    #[error("`times` must be finite and increasing")]
    NotIncreasing,
    /// The caller asked the work to end.
    #[error("the estimation was cancelled")]
    Cancelled,
}

/// What is known of the attitudes, and of what is to be said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertiaOptions {
    /// Standard deviation of an attitude about each axis, rad, independent and normal. Where it is given, residuals that it does not
    /// explain are a misfit; it is estimated from them unless given.
    pub noise: Option<f64>,
    /// Level of the intervals, between 0 and 1.
    pub level: f64,
}

impl Default for InertiaOptions {
    /// Noise that is estimated, and intervals of 95 %.
    fn default() -> Self {
        Self { noise: None, level: 0.95 }
    }
}

/// What a record determines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InertiaStatus {
    /// Inertia and axes.
    Identified,
    /// The inertia; two moments are equal within their errors and differ by at most 5 %, so that the principal axes in their plane are any.
    Symmetric,
    /// The axis of a steady rotation, which says nothing of the moments.
    Steady,
    /// Little: an interval is wide, or another inertia fits as well.
    Weak,
    /// Nothing: the attitudes are too far apart.
    Undersampled,
    /// Nothing: it is not that of a free rigid body with independent noise.
    Misfit,
}

impl InertiaStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::Identified, "identified"),
        (Self::Symmetric, "symmetric"),
        (Self::Steady, "steady"),
        (Self::Weak, "weak"),
        (Self::Undersampled, "undersampled"),
        (Self::Misfit, "misfit"),
    ];
}

/// The fitted motion, of a body whose greatest moment is 1 kg m².
#[derive(Debug, Clone, Copy)]
pub struct FittedMotion {
    /// The body, of mass 1 kg.
    pub body: RigidBody,
    /// Its state at the first time.
    pub start: RigidBodyState,
    /// The first time, s.
    pub start_time: f64,
    free: FreeBody,
}

impl FittedMotion {
    fn try_new(body: RigidBody, start: RigidBodyState, start_time: f64) -> Result<Self, FreeBodyError> {
        Ok(Self { body, start, start_time, free: FreeBody::try_new(&body, &start)? })
    }

    /// The state at time `t`, s.
    pub fn at(&self, t: f64) -> Result<RigidBodyState, FreeBodyError> {
        self.free.at(t - self.start_time)
    }
}

/// What the attitudes of a tumble tell of the body. What they do not determine is NaN, and `reason` names it.
#[derive(Debug, Clone)]
pub struct InertiaEstimate {
    /// What is determined.
    pub status: InertiaStatus,
    /// The same in a sentence.
    pub reason: String,
    /// Principal moments of inertia, ascending, as fractions of the greatest.
    pub ratios: Vector3<f64>,
    /// Lower and upper ends of their intervals of confidence.
    pub ratio_intervals: [[f64; 2]; 3],
    /// Principal axes in the body frame, unit vectors as columns, right-handed.
    pub axes: Matrix3<f64>,
    /// Standard deviations of the rotation of the axes about each of them, rad; infinite where it is any.
    pub axis_errors: Vector3<f64>,
    /// The tensor in the body frame, as a fraction of its greatest principal moment.
    pub inertia: Matrix3<f64>,
    /// Angular velocity at the first time, body frame, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Standard deviations of its components, rad/s.
    pub angular_velocity_errors: Vector3<f64>,
    /// Unit vector along the angular momentum, world frame.
    pub momentum_direction: Vector3<f64>,
    /// Standard deviation of the angle of the momentum in each of the two directions across it, rad, the greater one.
    pub momentum_error: f64,
    /// Standard deviation of an attitude about each axis, estimated from the residuals, rad.
    pub noise: f64,
    /// Rotation vectors from the fitted attitudes to those given, body frame, rad; none where nothing was fitted.
    pub residuals: Vec<Vector3<f64>>,
    /// Level of the intervals.
    pub level: f64,
    /// The fitted motion, where there is an inertia.
    pub motion: Option<FittedMotion>,
}

impl InertiaEstimate {
    /// Whether the moments are determined up to a factor.
    pub fn success(&self) -> bool {
        matches!(self.status, InertiaStatus::Identified | InertiaStatus::Symmetric)
    }

    /// With nothing that is determined.
    fn nothing(status: InertiaStatus, reason: impl Into<String>, level: f64) -> Self {
        let none = Vector3::repeat(f64::NAN);
        Self {
            status,
            reason: reason.into(),
            ratios: none,
            ratio_intervals: [[f64::NAN; 2]; 3],
            axes: Matrix3::repeat(f64::NAN),
            axis_errors: none,
            inertia: Matrix3::repeat(f64::NAN),
            angular_velocity: none,
            angular_velocity_errors: none,
            momentum_direction: none,
            momentum_error: f64::NAN,
            noise: f64::NAN,
            residuals: Vec::new(),
            level,
            motion: None,
        }
    }
}

/// Estimates the inertia of a free rigid body up to a factor, its axes, its angular velocity and its momentum.
///
/// `times` (s) are finite and increase, at least six of them; they may be irregular and have gaps. `orientations` are rotations from the
/// body frame to the world frame at these times; between most of them the body turns by less than 2 rad. The [module](self) says how, and
/// what it costs.
///
/// Errors: an argument that is not allowed.
///
/// ```
/// use somersault_motion::inertia::{InertiaOptions, InertiaStatus, estimate_inertia};
/// use somersault_integrators::body::RigidBody;
/// use somersault_integrators::exact::FreeBody;
/// use somersault_integrators::nalgebra::Vector3;
/// use somersault_integrators::state::RigidBodyState;
///
/// let body = RigidBody::try_principal(1.0, Vector3::new(1.0, 2.0, 2.5))?;
/// let tumble = FreeBody::try_new(&body, &RigidBodyState::spinning(Vector3::new(0.3, 1.0, 0.4)))?;
/// let times: Vec<f64> = (0..60).map(|k| 0.3 * f64::from(k)).collect();
/// let seen = times.iter().map(|t| Ok(*tumble.at(*t)?.orientation())).collect::<Result<Vec<_>, Box<dyn std::error::Error>>>()?;
///
/// let found = estimate_inertia(&times, &seen, &InertiaOptions::default())?;
/// assert_eq!(found.status, InertiaStatus::Identified);
/// assert!((found.ratios - Vector3::new(0.4, 0.8, 1.0)).norm() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn estimate_inertia(
    times: &[f64],
    orientations: &[UnitQuaternion<f64>],
    options: &InertiaOptions,
) -> Result<InertiaEstimate, InertiaEstimateError> {
    estimate_inertia_cancellable(times, orientations, options, &CancellationToken::new())
}

/// The same, until a token asks it to end.
pub fn estimate_inertia_cancellable(
    times: &[f64],
    orientations: &[UnitQuaternion<f64>],
    options: &InertiaOptions,
    token: &CancellationToken,
) -> Result<InertiaEstimate, InertiaEstimateError> {
    expect_least("times", times.len(), LEAST_ATTITUDES)?;
    let increase = times.windows(2).all(|pair| pair[0] < pair[1]);
    if !increase || times.iter().any(|t| !t.is_finite()) {
        return Err(InertiaEstimateError::NotIncreasing);
    }
    expect_length("orientations", orientations.len(), times.len())?;
    expect_finite("orientations", orientations.iter().flat_map(|q| q.coords.iter()))?;
    if let Some(noise) = options.noise {
        expect_positive("noise", noise)?;
    }
    let level = expect_range("level", options.level, "between 0 and 1", |x| 0.0 < x && x < 1.0)?;

    let turns: Vec<f64> =
        orientations.windows(2).map(|pair| so3::angle_between(&pair[0], &pair[1])).collect();
    let median = median(&turns);
    if median > FAR {
        let turn = significant(median, 2);
        let reason = format!(
            "the body turns by {turn} rad between attitudes, more than {FAR}: the way round is doubtful"
        );
        return Ok(InertiaEstimate::nothing(InertiaStatus::Undersampled, reason, level));
    }
    let record = problem::Record::new(times, orientations);
    let fits = search::fits(&record, &turns, options.noise, token)?;
    verdict::judge(&record, &fits, options, token)
}

/// The middle one of some numbers, or the mean of the two.
fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    0.5 * (sorted[(n - 1) / 2] + sorted[n / 2])
}

/// A number in so many significant digits.
fn significant(x: f64, digits: usize) -> String {
    let rounded: f64 = format!("{x:.*e}", digits - 1).parse().unwrap_or(x);
    if rounded != 0.0 && !(1e-4..1e6).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}
