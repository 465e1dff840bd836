//! Control of the step size.
//!
//! The step follows the proportional–integral control of Gustafsson (ACM TOMS 17 (1991) 533) in the
//! exponents 0.85/k and 0.2/k, k the order of the error, with safety factor 0.9 and changes between 0.2
//! and 5; see Hairer and Wanner, *Solving Ordinary Differential Equations II*, section IV.2, whose
//! DOPRI5 has the same weights. A method that knows beforehand how long a step may be chooses it itself. A step whose error is not a number is rejected like one too large.

use crate::error::IntegrateError;
use crate::state::{Configuration, ErrorSum, Rate, Tolerances};
use crate::stepper::MethodInfo;
use crate::system::{RateOf, StateOf, System};
use somersault_core::argument::{ArgumentError, expect_positive};

const SAFETY: f64 = 0.9;
/// Errors below 1e-4 are remembered as that; this is its logarithm.
const LEAST_REMEMBERED: f64 = -9.210_340_371_976_182;

/// Settings of the step size control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptive {
    /// Error allowed per step.
    pub tolerances: Tolerances,
    /// First step; chosen from the initial accelerations if not given.
    pub first_step: Option<f64>,
    /// Largest step.
    pub max_step: f64,
    /// Largest number of steps, accepted and rejected.
    pub max_steps: usize,
}

impl Default for Adaptive {
    fn default() -> Self {
        Self {
            tolerances: Tolerances::default(),
            first_step: None,
            max_step: f64::INFINITY,
            max_steps: 10_000_000,
        }
    }
}

impl Adaptive {
    /// Control with the given tolerances and otherwise the defaults.
    pub fn with_tolerances(relative: f64, absolute: f64) -> Self {
        Self { tolerances: Tolerances { relative, absolute }, ..Self::default() }
    }

    fn check(&self) -> Result<(), IntegrateError> {
        expect_positive("relative", self.tolerances.relative)?;
        expect_positive("absolute", self.tolerances.absolute)?;
        if let Some(h) = self.first_step {
            expect_positive("first_step", h)?;
        }
        if self.max_step > 0.0 {
            Ok(())
        } else {
            Err(IntegrateError::Argument(ArgumentError::NotPositive {
                argument: "max_step",
                found: self.max_step,
            }))
        }
    }

    /// Refuses a first or largest step that is too small to change the time `t`, at which a run begins.
    fn check_at(&self, t: f64) -> Result<(), IntegrateError> {
        for (argument, h) in [("first_step", self.first_step), ("max_step", Some(self.max_step))] {
            if let Some(found) = h.filter(|h| t + h == t && t - h == t) {
                let allowed = "large enough to change the time at which the run begins";
                return Err(ArgumentError::OutOfRange { argument, allowed, found }.into());
            }
        }
        Ok(())
    }
}

/// The control at work: proposes steps and judges them by their errors.
#[derive(Debug, Clone)]
pub struct StepSizeControl {
    settings: Adaptive,
    order: f64,
    h: f64,
    last_log_error: f64,
    just_rejected: bool,
    /// Whether the size of the next step stands, and is not for the method to choose.
    is_fixed: bool,
    /// Whether the method chose a step, and will choose the next.
    is_chosen: bool,
    accepted: u64,
    rejected: u64,
}

impl StepSizeControl {
    /// The control of a run by a method from a state.
    ///
    /// Errors: settings that are not positive, and steps that do not change the time `t`.
    pub fn try_new<S: System>(
        settings: &Adaptive,
        method: &MethodInfo,
        system: &S,
        t: f64,
        x: &StateOf<S>,
    ) -> Result<Self, IntegrateError> {
        settings.check()?;
        settings.check_at(t)?;
        let mut control = Self {
            settings: *settings,
            order: f64::from(method.error_power()),
            h: 0.0,
            last_log_error: LEAST_REMEMBERED,
            just_rejected: false,
            is_fixed: false,
            is_chosen: false,
            accepted: 0,
            rejected: 0,
        };
        control.restart(system, t, x);
        if let Some(h) = settings.first_step {
            control.h = h.min(settings.max_step);
            control.is_fixed = true;
        }
        Ok(control)
    }

    /// Forgets the past and chooses the size afresh, as where the equations change.
    pub fn restart<S: System>(&mut self, system: &S, t: f64, x: &StateOf<S>) {
        self.h = first_step(system, t, x, self.order, &self.settings.tolerances).min(self.settings.max_step);
        self.last_log_error = LEAST_REMEMBERED;
        (self.just_rejected, self.is_fixed) = (false, false);
    }

    /// Whether the method may choose the next step: unless one was rejected, shortened or given by the settings.
    pub fn is_free(&self) -> bool {
        !self.is_fixed
    }

    /// Takes the next step from a method that knows how long it may be.
    pub fn choose(&mut self, longest: f64) {
        self.h = longest.min(self.settings.max_step);
        self.is_chosen = true;
    }

    /// The next step from `t` towards `end`, and the time after it.
    ///
    /// Errors: a step below what the time can resolve; the budget of steps is spent.
    pub fn propose(&self, t: f64, end: f64) -> Result<(f64, f64), IntegrateError> {
        let max_steps = self.settings.max_steps;
        if self.accepted + self.rejected >= max_steps as u64 {
            return Err(IntegrateError::Budget { max_steps, t });
        }
        // A last step a little longer beats a step of rounding size.
        let reaches_end = t + 1.01 * self.h >= end;
        let step = if reaches_end { end - t } else { self.h };
        if t + step <= t {
            return Err(IntegrateError::StepSize { t, h: step });
        }
        Ok((step, if reaches_end { end } else { t + step }))
    }

    /// Sets the next step, where one just made was too long for another reason than its error.
    ///
    /// Errors: a step that is not positive.
    pub fn shorten(&mut self, step: f64) -> Result<(), IntegrateError> {
        expect_positive("step", step)?;
        self.rejected += 1;
        self.h = step;
        self.is_fixed = true;
        Ok(())
    }

    /// Whether a step from `t` with an error weighed by the tolerances is accepted; sets the size of the
    /// next.
    ///
    /// Errors: a rejected step that cannot be made smaller.
    pub fn accepts(&mut self, t: f64, step: f64, error: f64) -> Result<bool, IntegrateError> {
        if error <= 1.0 {
            self.accepted += 1;
            if self.is_chosen {
                (self.just_rejected, self.is_fixed) = (false, false);
                return Ok(true);
            }
            let log_error = error.max(1e-10).ln();
            let (integral, proportional) = (0.85 / self.order, 0.2 / self.order);
            let growth = SAFETY * (proportional * self.last_log_error - integral * log_error).exp();
            let most = if self.just_rejected { 1.0 } else { 5.0 };
            // one that was cut short by the end says nothing against the size that was planned
            let planned = if step < self.h { self.h } else { 0.0 };
            self.h = (step * growth.min(most).clamp(0.2, 5.0)).max(planned).min(self.settings.max_step);
            self.last_log_error = log_error.max(LEAST_REMEMBERED);
            (self.just_rejected, self.is_fixed) = (false, false);
            return Ok(true);
        }
        self.rejected += 1;
        (self.just_rejected, self.is_fixed) = (true, true);
        let shrink = if error.is_finite() { SAFETY * error.powf(-1.0 / self.order) } else { 0.2 };
        self.h = step * shrink.clamp(0.2, 1.0);
        if t + self.h > t {
            Ok(false)
        } else if error.is_finite() {
            Err(IntegrateError::StepSize { t, h: self.h })
        } else {
            Err(IntegrateError::NonFinite { t: t + step })
        }
    }

    /// Steps accepted.
    pub fn accepted(&self) -> u64 {
        self.accepted
    }

    /// Steps rejected.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }
}

/// A first step from the size of the motion and of its first two derivatives (Hairer, Nørsett and
/// Wanner, *Solving Ordinary Differential Equations I*, section II.4).
fn first_step<S: System>(system: &S, t: f64, x: &StateOf<S>, order: f64, tolerances: &Tolerances) -> f64 {
    let mut w = system.workspace();
    let size = |v: &RateOf<S>, a: &RateOf<S>| {
        let mut sum = ErrorSum::default();
        x.configuration.weigh(&x.configuration, v, tolerances, &mut sum);
        x.rate.weigh(&x.rate, a, tolerances, &mut sum);
        sum.root_mean_square()
    };
    let (mut velocity, mut acceleration) = (x.rate.clone(), x.rate.clone());
    system.velocity(&mut w, t, x, &mut velocity);
    system.acceleration(&mut w, t, x, &mut acceleration);
    let first = size(&velocity, &acceleration);
    // The weighed size of a unit: one radian, one metre, one metre per second.
    let unit = 1.0 / (tolerances.absolute + tolerances.relative);
    let trial = if first > 1e-10 * unit { 0.01 * unit / first } else { 1e-6 };
    let mut ahead = x.clone();
    ahead.drift(&velocity, trial);
    ahead.kick(&acceleration, trial);
    let (mut velocity_ahead, mut acceleration_ahead) = (x.rate.clone(), x.rate.clone());
    system.velocity(&mut w, t + trial, &ahead, &mut velocity_ahead);
    system.acceleration(&mut w, t + trial, &ahead, &mut acceleration_ahead);
    velocity_ahead.axpy(-1.0, &velocity);
    acceleration_ahead.axpy(-1.0, &acceleration);
    let second = size(&velocity_ahead, &acceleration_ahead) / trial;
    let largest = first.max(second);
    let h = if largest > 1e-15 { (0.01 / largest).powf(1.0 / order) } else { (1e-3 * trial).max(1e-6) };
    if h.is_finite() { h.min(100.0 * trial).max(f64::MIN_POSITIVE) } else { trial }
}
