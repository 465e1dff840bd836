//! What a method is: its description, its memory and its step.

use crate::dense::{Interpolant, Segment};
use crate::scratch::Scratch;
use crate::state::{Configuration, ErrorSum, Rate, State, Tolerances};
use crate::system::{RateOf, StateOf, System};
use crate::tableau::Tableau;

/// Orders of a method, as powers of h in the global error, measured by the test `every_method_has_the_orders_of_its_info`: of
/// position and orientation in [`MethodInfo::orders`], of velocity and angular velocity in [`MethodInfo::rate_orders`].
///
/// A motion of several kinds at once, say under a spring attached off the centre of mass, has the least of their orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Orders {
    /// On ℝ³ under r̈ = f(t, r); thesis Table 7.1.
    pub translation: u8,
    /// On ℝ³ under r̈ = f(t, r, ṙ).
    pub translation_with_velocity: u8,
    /// On ℝ³ under r̈ = f(t, r, R): forces that depend on the orientation, as the thrust of an engine fixed in the body.
    pub translation_with_orientation: u8,
    /// On SO(3), of a free body; thesis Table 7.2. A method that is exact there states the order it
    /// has under torque.
    pub rotation: u8,
    /// On SO(3) under torque; `None` where the method accepts no torque.
    pub rotation_with_torque: Option<u8>,
}

impl Orders {
    /// The same order everywhere.
    pub const fn all(order: u8) -> Self {
        Self::split(order, order)
    }

    /// One order on ℝ³ and another on SO(3), with or without velocities and torques. A force that depends on the
    /// orientation sees the error of the orientation, and the order on ℝ³ is the lower of the two.
    pub const fn split(translation: u8, rotation: u8) -> Self {
        Self {
            translation,
            translation_with_velocity: translation,
            translation_with_orientation: if rotation < translation { rotation } else { translation },
            rotation,
            rotation_with_torque: Some(rotation),
        }
    }

    /// Without torque, which the method does not take.
    pub const fn without_torque(self) -> Self {
        Self { rotation_with_torque: None, ..self }
    }

    /// All of them.
    fn each(&self) -> impl Iterator<Item = u8> {
        let Self {
            translation,
            translation_with_velocity,
            translation_with_orientation,
            rotation,
            rotation_with_torque,
        } = *self;
        [translation, translation_with_velocity, translation_with_orientation, rotation]
            .into_iter()
            .chain(rotation_with_torque)
    }
}

/// What a method applies to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Any [`System`].
    AnySystem,
    /// Rigid bodies under any forces: it needs inertia and torque.
    RigidBodies,
    /// Rigid bodies without torque.
    TorqueFree,
    /// Rigid bodies under forces whose Taylor series are known: sums of [`WrenchTerm`](crate::series::WrenchTerm)s.
    ForcesWithSeries,
}

/// The variables a method integrates; see [`crate::system`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variables {
    /// Angular velocity in the world frame.
    World,
    /// Angular momentum in the world frame.
    Momentum,
    /// Angular velocity in the body frame.
    Body,
}

/// Description of a method: the row of the method table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodInfo {
    /// The name by which it is requested.
    pub name: &'static str,
    /// The name in words.
    pub title: &'static str,
    /// Where it comes from.
    pub citation: &'static str,
    /// Orders of position and orientation at the ends of steps.
    pub orders: Orders,
    /// Orders of velocity and angular velocity there.
    pub rate_orders: Orders,
    /// Power of h in the error that its [`segment`](Stepper::segment) adds: within a step the order is the lower of
    /// this and the order at the ends.
    pub dense_order: u8,
    /// Angle h‖ω‖ in rad up to which a step is made for any body, where the method has a limit; beyond it a step is refused
    /// with [`StepError::Angle`], by the discrete Moser–Veselov methods where their equation has no solution. `lgvi` counts
    /// h √(2T/I_min) in its place, T the kinetic energy of the rotation.
    pub angle_limit: Option<f64>,
    /// Evaluations of the equations of motion per step, once started; for an implicit method, per
    /// iteration.
    pub evaluations: u8,
    /// How many previous steps it remembers.
    pub history: u8,
    /// What it applies to.
    pub scope: Scope,
    /// The variables it integrates.
    pub variables: Variables,
    /// Order of the embedded error estimate, where there is one to control the step with.
    pub embedded: Option<u8>,
    /// Whether each step solves an equation.
    pub implicit: bool,
    /// Whether it is L-stable: steps may be far longer than the times of the springs and dampers of a system, whose motion it
    /// then damps.
    pub l_stable: bool,
    /// What it conserves, and how well.
    pub conserves: &'static str,
    /// What it is unsuitable for, and what it refuses.
    pub limitations: &'static str,
}

impl MethodInfo {
    /// An explicit one-step method for any system in world variables, to be refined by `..`.
    pub const fn explicit(
        name: &'static str,
        title: &'static str,
        citation: &'static str,
        order: u8,
    ) -> Self {
        Self {
            name,
            title,
            citation,
            orders: Orders::all(order),
            rate_orders: Orders::all(order),
            dense_order: Self::HERMITE,
            angle_limit: None,
            evaluations: order,
            history: 0,
            scope: Scope::AnySystem,
            variables: Variables::World,
            embedded: None,
            implicit: false,
            l_stable: false,
            conserves: "nothing exactly",
            limitations: "unsuitable for very long runs in which energy must not drift",
        }
    }

    /// The same method in the variables of another form.
    pub const fn in_variables(self, name: &'static str, title: &'static str, variables: Variables) -> Self {
        let conserves = match variables {
            Variables::Momentum => Self::MOMENTUM,
            Variables::World | Variables::Body => self.conserves,
        };
        Self { name, title, variables, scope: Scope::RigidBodies, conserves, ..self }
    }

    /// Whether it takes rigid bodies under forces of every kind.
    pub const fn takes_any_forces(&self) -> bool {
        matches!(self.scope, Scope::AnySystem | Scope::RigidBodies)
    }

    /// Whether its steps can be adapted to tolerances: by its own estimate of the error, or by [doubling](crate::doubling) where it
    /// remembers no previous steps.
    pub const fn is_adaptive(&self) -> bool {
        self.embedded.is_some() || self.history == 0
    }

    /// Evaluations of the equations of motion per step tried with adapted steps, for an implicit method, per iteration; those of three
    /// steps where it is [doubled](crate::doubling).
    pub fn adapted_evaluations(&self) -> u64 {
        u64::from(self.evaluations) * if self.embedded.is_some() { 1 } else { 3 }
    }

    /// The least of its orders.
    pub(crate) fn least_order(&self) -> u8 {
        self.orders.each().chain(self.rate_orders.each()).fold(u8::MAX, u8::min)
    }

    /// Power of h in the error that the step size control corrects: one more than the order of the estimate. Where a method has several
    /// orders it is by the greatest, with which the control answers no error too strongly.
    pub(crate) fn error_power(&self) -> u8 {
        let greatest = || self.orders.each().chain(self.rate_orders.each()).fold(0, u8::max);
        self.embedded.unwrap_or_else(greatest) + 1
    }

    /// Order of the default curve, the cubic Hermite interpolant.
    pub const HERMITE: u8 = 4;

    const MOMENTUM: &'static str = "angular momentum without torque to rounding";

    /// [`conserves`](Self::conserves) of a method that adds up torques after a first step of another.
    pub(crate) const MOMENTUM_ONCE_STARTED: &'static str =
        "angular momentum without torque, once started, to rounding that adds up";
}

/// Why a step failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// The method accepts no torque and the forces may exert one.
    #[error("method `{method}` accepts no torque, and these forces may exert one")]
    Torque {
        /// The method.
        method: &'static str,
    },
    /// The method needs the Taylor series of the forces, and there are none of these.
    #[error(
        "method `{method}` needs forces whose Taylor series are known: uniform gravity and magnetic fields, constant forces and torques, drag, springs, and points and balls on planes under a spring and a damper without friction; for others take `rkmk8_b`"
    )]
    NoSeries {
        /// The method.
        method: &'static str,
    },
    /// The equation of an implicit step was not solved.
    #[error(
        "method `{method}`: the equation of the step at t = {t} was not solved in {iterations} iterations, residual {residual:e}; the step may be too large"
    )]
    NotConverged {
        /// The method.
        method: &'static str,
        /// Time at the start of the step.
        t: f64,
        /// Iterations taken.
        iterations: usize,
        /// What was left, relative to the size of the unknown.
        residual: f64,
    },
    /// The step is beyond the series that the method rests on.
    #[error("method `{method}`: the step h = {h} at t = {t} is too large for its series in h")]
    StepTooLarge {
        /// The method.
        method: &'static str,
        /// Time at the start of the step.
        t: f64,
        /// The step.
        h: f64,
    },
    /// A body turns further in the step than the method allows.
    #[error(
        "method `{method}`: a body turns by up to {angle:.3} rad in the step h = {h} at t = {t}, more than the {limit:.3} rad a step allowed; take a smaller step"
    )]
    Angle {
        /// The method.
        method: &'static str,
        /// Time at the start of the step.
        t: f64,
        /// The step.
        h: f64,
        /// The angle h‖ω‖, or what the method counts in its place, rad.
        angle: f64,
        /// The largest angle allowed, rad.
        limit: f64,
    },
}

impl StepError {
    /// Whether the method does not take the forces, however short the step.
    pub fn is_refusal(&self) -> bool {
        match self {
            Self::Torque { .. } | Self::NoSeries { .. } => true,
            Self::NotConverged { .. } | Self::StepTooLarge { .. } | Self::Angle { .. } => false,
        }
    }

    /// With the time of the other sign.
    pub(crate) fn backwards(mut self) -> Self {
        match &mut self {
            Self::Torque { .. } | Self::NoSeries { .. } => {}
            Self::NotConverged { t, .. } | Self::StepTooLarge { t, .. } | Self::Angle { t, .. } => *t = -*t,
        }
        self
    }
}

/// The description of a method as a constant.
pub trait Scheme {
    /// The row of the method table.
    const INFO: MethodInfo;

    /// The tableau by which an explicit Runge–Kutta method advances vectors, such as tangents that are integrated with a state: one
    /// evaluation for each stage, in their order. `None`, the default, for any other method.
    fn on_vectors(&self) -> Option<Tableau> {
        None
    }

    /// Errors with [`StepError::Angle`] where a body that turns at `speed` = ‖ω‖ turns by more than
    /// [`MethodInfo::angle_limit`] in a step `h` from `t`.
    #[inline(always)]
    fn check_angle(t: f64, h: f64, speed: f64) -> Result<(), StepError> {
        match Self::INFO.angle_limit {
            // What is not finite is for the driver to see.
            Some(limit) if h.abs() * speed > limit => {
                Err(StepError::Angle { method: Self::INFO.name, t, h, angle: h.abs() * speed, limit })
            }
            Some(_) | None => Ok(()),
        }
    }
}

/// A method that moves systems of the kind `S` by one step.
///
/// All that a step leaves for the next is in the memory, a value of the caller's. The memory speaks of
/// one trajectory, that of a method that remembers previous steps of one step size: after a discontinuity, a jump of
/// the state or, of such a method, a change of h it must be restarted.
pub trait Stepper<S: System>: Scheme {
    /// What a step leaves for the next, and room to work in.
    type Memory;

    /// A memory for a trajectory through states of the size of `x`.
    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError>;

    /// Forgets the past.
    fn restart(&self, _memory: &mut Self::Memory) {}

    /// One step from `x` at `t` to `out` at `t + h`.
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError>;

    /// The curve between the step just made from `x` to `after`.
    ///
    /// By default the cubic Hermite interpolant in the Lie algebra, of order 4 in both configuration
    /// and rate, at the cost of the two accelerations at the ends.
    fn segment(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        _memory: &mut Self::Memory,
        after: &StateOf<S>,
    ) -> Box<dyn Interpolant<S::Configuration>> {
        Box::new(Segment::hermite(system, t, x, h, after))
    }
}

/// A method that estimates the error of its step.
pub trait EmbeddedStepper<S: System>: Stepper<S> {
    /// The error of the step just made from `x` to `after`, weighed by the tolerances: at most 1 where
    /// they are met.
    fn error(
        &self,
        x: &StateOf<S>,
        after: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        tolerances: &Tolerances,
    ) -> f64;

    /// The longest step from `x` that meets the tolerances, of a method that knows it before the step is made; `None`, as by default, of
    /// others, whose steps follow from the errors of those before. The step with this memory that comes next must be of the same system.
    fn longest_step(
        &self,
        _system: &S,
        _x: &StateOf<S>,
        _memory: &mut Self::Memory,
        _tolerances: &Tolerances,
    ) -> Result<Option<f64>, StepError> {
        Ok(None)
    }

    /// Takes back the step just made: the next one starts from the same state at the same time.
    ///
    /// By default the memory restarts; a method that knows the slope there keeps it.
    fn reject(&self, memory: &mut Self::Memory) {
        self.restart(memory);
    }
}

/// Root mean square of an error in configuration and rate, weighed by the tolerances.
#[inline(always)]
pub fn weighed_error<Q: Configuration>(
    x: &State<Q>,
    after: &State<Q>,
    configuration_error: &Q::Rate,
    rate_error: &Q::Rate,
    tolerances: &Tolerances,
) -> f64 {
    let mut sum = ErrorSum::default();
    x.configuration.weigh(&after.configuration, configuration_error, tolerances, &mut sum);
    x.rate.weigh(&after.rate, rate_error, tolerances, &mut sum);
    sum.root_mean_square()
}

/// Memory of a method without history: room for a stage and for `N` slopes.
pub struct Stages<S: System, const N: usize> {
    pub(crate) workspace: S::Workspace,
    pub(crate) stage: Scratch<StateOf<S>>,
    pub(crate) velocities: [Scratch<RateOf<S>>; N],
    pub(crate) accelerations: [Scratch<RateOf<S>>; N],
}

impl<S: System, const N: usize> Stages<S, N> {
    pub(crate) fn new(system: &S, x: &StateOf<S>) -> Self {
        Self {
            workspace: system.workspace(),
            stage: Scratch::like(x),
            velocities: std::array::from_fn(|_| Scratch::like(&x.rate)),
            accelerations: std::array::from_fn(|_| Scratch::like(&x.rate)),
        }
    }
}
