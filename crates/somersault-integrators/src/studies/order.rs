//! Observed orders of accuracy, thesis 7.1 and 7.2: Tables 7.1 and 7.2.
//!
//! A method of order p has an error e(h) = C hᵖ + O(hᵖ⁺¹) at a fixed time, a line of slope p over log h.
//! The study runs a [`Problem`] with several steps and fits that slope, each for position, orientation,
//! velocity and angular velocity. Sources: any text; the rule for rounding is ours.
//!
//! Problems: [`Case`](super::problem::Case) for the thesis' free bodies and
//! [`asymmetric_body`](super::problem::asymmetric_body) for the rotation, where case 2 is no measure: its
//! body ends near the unstable axis it started from, so that methods of order 2 show 3 unless the step is
//! very small; [`spring_pendulum`](super::problem::spring_pendulum) and its damped twin for the
//! translation.

use super::problem::{Errors, Problem};
use super::{Progress, StudyError, check_not_empty, report};
use crate::driver::{IntegrateError, Outcome, TimeGrid};
use crate::methods::{Method, Options};
use crate::run::Run;
use crate::stepper::Stepper;
use crate::system::{RigidSystem, System};
use somersault_core::argument::expect_positive;

/// Errors with one step size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Step, s.
    pub dt: f64,
    /// Errors at the end; infinite where the state overflowed or a step failed.
    pub errors: Errors,
}

/// Slopes over log h; `None` where fewer than three points are left above rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedOrders {
    /// Of the position.
    pub position: Option<f64>,
    /// Of the orientation.
    pub orientation: Option<f64>,
    /// Of the velocity.
    pub velocity: Option<f64>,
    /// Of the angular velocity.
    pub angular_velocity: Option<f64>,
}

impl ObservedOrders {
    /// The slopes of errors with several step sizes, by `fit`: [`observed_order`] or [`mean_order`].
    pub fn of(measured: &[Measured], fit: fn(&[(f64, f64)]) -> Option<f64>) -> Self {
        let slope = |of: fn(&Errors) -> f64| {
            let points: Vec<_> = measured.iter().map(|m| (m.dt, of(&m.errors))).collect();
            fit(&points)
        };
        Self {
            position: slope(|e| e.position),
            orientation: slope(|e| e.orientation),
            velocity: slope(|e| e.velocity),
            angular_velocity: slope(|e| e.angular_velocity),
        }
    }
}

/// Result of the study for one method.
#[derive(Debug, Clone, PartialEq)]
pub struct Convergence {
    /// The errors, in the order of the steps given.
    pub measured: Vec<Measured>,
    /// Their slopes.
    pub orders: ObservedOrders,
}

/// Runs a problem by a method of the table with each of the steps `dts`.
///
/// Errors: an empty list, a step that is not positive or too small to advance the time, a method that does
/// not apply, and a stop by `progress`, which is called after each run. A run that overflows is no error,
/// its errors are infinite.
pub fn convergence<S: RigidSystem>(
    problem: &Problem<S>,
    method: Method,
    options: Options,
    dts: &[f64],
    progress: &mut Progress<'_>,
) -> Result<Convergence, StudyError> {
    study(problem, dts, progress, &|grid| {
        Run::new(problem.system(), method, grid).with_options(options).from(problem.initial())
    })
}

/// As [`convergence`], by a stepper.
pub fn convergence_of<S: RigidSystem, M: Stepper<S>>(
    problem: &Problem<S>,
    stepper: &M,
    dts: &[f64],
    progress: &mut Progress<'_>,
) -> Result<Convergence, StudyError> {
    study(problem, dts, progress, &|grid| {
        Run::by_stepper(problem.system(), stepper, grid).from(problem.initial())
    })
}

fn study<S: RigidSystem>(
    problem: &Problem<S>,
    dts: &[f64],
    progress: &mut Progress<'_>,
    run: &dyn Fn(TimeGrid) -> Integrated<S>,
) -> Result<Convergence, StudyError> {
    check_not_empty("dts", dts)?;
    dts.iter().try_for_each(|dt| expect_positive("dts", *dt).map(|_| ()))?;
    let mut measured = Vec::with_capacity(dts.len());
    for &dt in dts {
        let outcome = run(TimeGrid::try_new(0.0, problem.t_end(), dt)?);
        let errors = forgive(outcome)?.map_or(Errors::INFINITE, |outcome| problem.errors(&outcome.state));
        measured.push(Measured { dt, errors });
        report(progress, measured.len(), dts.len())?;
    }
    let orders = ObservedOrders::of(&measured, observed_order);
    Ok(Convergence { measured, orders })
}

/// What an integration returns.
pub(super) type Integrated<S> = Result<Outcome<<S as System>::Configuration>, IntegrateError>;

/// `None` for a run that failed because the step or the tolerance was too large for it; other failures stay
/// errors.
pub fn forgive<T>(run: Result<T, IntegrateError>) -> Result<Option<T>, IntegrateError> {
    match run {
        Ok(outcome) => Ok(Some(outcome)),
        Err(IntegrateError::Step(error)) if error.is_refusal() => Err(error.into()),
        Err(
            IntegrateError::NonFinite { .. }
            | IntegrateError::Step(_)
            | IntegrateError::StepSize { .. }
            | IntegrateError::Budget { .. },
        ) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Slope of log e over log h for points (h, e), by least squares over the four finest steps that are not
/// spoilt by rounding; `None` if fewer than three are left.
///
/// Rounding shows where the error stops falling with the step. Left out are errors that are zero or not
/// finite; where between two steps of the finer half the slope is below ½, those below twenty times the least
/// error; then those below 1e-13, and, from the finest, steps to which the slope is less than 0.6 or more than
/// 1.5 of the larger of the two slopes before.
pub fn observed_order(points: &[(f64, f64)]) -> Option<f64> {
    const FLOOR: f64 = 1e-13;
    const FITTED: usize = 4;
    let mut points: Vec<(f64, f64)> = points
        .iter()
        .filter(|(h, e)| *h > 0.0 && h.is_finite() && *e > 0.0 && e.is_finite())
        .map(|(h, e)| (h.ln(), e.ln()))
        .collect();
    points.sort_by(|a, b| b.0.total_cmp(&a.0));
    let slopes = |points: &[(f64, f64)]| -> Vec<f64> {
        points.windows(2).map(|p| (p[1].1 - p[0].1) / (p[1].0 - p[0].0)).collect()
    };
    let all = slopes(&points);
    if all.iter().skip(all.len() / 2).any(|slope| *slope < 0.5) {
        let least = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        points.retain(|p| p.1 > least + 20f64.ln());
    }
    points.retain(|p| p.1 > FLOOR.ln());
    while let [.., a, b, last] = slopes(&points)[..] {
        if (0.6..=1.5).contains(&(last / a.max(b))) {
            break;
        }
        points.pop();
    }
    if points.len() < 3 {
        return None;
    }
    slope(&points[points.len().saturating_sub(FITTED)..])
}

/// Slope of a straight line through points by least squares; `None` where they do not span one.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let n = points.len() as f64;
    let mean = points.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
    let (covariance, variance) = points.iter().fold((0.0, 0.0), |s, p| {
        let dx = p.0 - mean.0;
        (s.0 + dx * (p.1 - mean.1), s.1 + dx * dx)
    });
    (variance > 0.0).then(|| covariance / variance)
}

/// Slope of log e over log h through all points (h, e), for errors known to be above rounding; `None` where
/// one is not positive and finite, or where there are fewer than three.
pub fn mean_order(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(h, e)| (h.ln(), e.ln())).collect();
    (logs.len() >= 3 && logs.iter().all(|(h, e)| h.is_finite() && e.is_finite()))
        .then(|| slope(&logs))
        .flatten()
}

#[cfg(test)]
mod tests {
    use super::{mean_order, observed_order};

    #[test]
    fn a_power_law_gives_its_power() {
        for order in [1, 2, 4, 8] {
            let points: Vec<_> = (0..5).map(|k| 0.5f64.powi(k)).map(|h| (h, 1e-3 * h.powi(order))).collect();
            let found = observed_order(&points);
            assert!(found.is_some_and(|p| (p - f64::from(order)).abs() < 1e-12), "{found:?}");
            assert!((mean_order(&points).unwrap() - f64::from(order)).abs() < 1e-12);
        }
    }

    #[test]
    fn rounding_is_left_out() {
        // Fourth order with a rounding error that grows as 1/h, of either sign.
        let points: Vec<_> = (0..12)
            .map(|k| (0.5f64.powi(k), if k % 3 == 0 { -1.0 } else { 1.0 }))
            .map(|(h, sign)| (h, (h.powi(4) + sign * 1e-12 / h).abs()))
            .collect();
        let found = observed_order(&points);
        assert!(found.is_some_and(|p| (p - 4.0).abs() < 0.05), "{found:?}");
    }

    #[test]
    fn two_points_or_nothing_but_rounding_give_none() {
        assert_eq!(observed_order(&[(0.1, 1e-2), (0.05, 1e-3)]), None);
        assert_eq!(observed_order(&[(0.1, 1e-15), (0.05, 2e-15), (0.01, 0.0), (0.02, f64::NAN)]), None);
        assert_eq!(observed_order(&[(0.1, 1.0), (0.1, 1.0), (0.1, 1.0)]), None);
    }
}
