//! Problems with known ends, for the studies of accuracy: the thesis' cases of 7.2.1 and some for the
//! translation, and a way to make your own.

use super::StudyError;
use crate::body::RigidBody;
use crate::driver::TimeGrid;
use crate::exact::FreeBody;
use crate::force::{Drag, Gravity, Spring};
use crate::methods::{Method, RungeKuttaMuntheKaas4};
use crate::run::Run;
use crate::state::{Pose, Poses, RigidBodyState, State, Twist};
use crate::system::{RigidBodySystem, RigidSystem, StateOf};
use nalgebra::Vector3;
use somersault_core::argument::{ArgumentError, expect_positive};
use somersault_core::lie::so3;
use std::f64::consts::{PI, SQRT_2};

/// A motion from t = 0 whose state at the end is known.
#[derive(Debug, Clone)]
pub struct Problem<S: RigidSystem> {
    system: S,
    initial: StateOf<S>,
    t_end: f64,
    reference: StateOf<S>,
}

/// Distances between two states: the largest of any body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Distance of the positions, m.
    pub position: f64,
    /// Least angle between the orientations, rad.
    pub orientation: f64,
    /// Length of the difference of the velocities, m/s.
    pub velocity: f64,
    /// Length of the difference of the angular velocities, rad/s.
    pub angular_velocity: f64,
}

impl Errors {
    /// The errors of a run that failed.
    pub const INFINITE: Self = Self {
        position: f64::INFINITY,
        orientation: f64::INFINITY,
        velocity: f64::INFINITY,
        angular_velocity: f64::INFINITY,
    };

    /// Distances between two states of the same bodies.
    pub fn between<Q: Poses>(a: &State<Q>, b: &State<Q>) -> Self {
        let mut errors = Self { position: 0.0, orientation: 0.0, velocity: 0.0, angular_velocity: 0.0 };
        for i in 0..a.configuration.count() {
            let (pose, other) = (a.configuration.pose(i), b.configuration.pose(i));
            let (rate, other_rate) = (Q::twist(&a.rate, i), Q::twist(&b.rate, i));
            let raise = |error: &mut f64, found: f64| *error = error.max(found);
            raise(&mut errors.position, (pose.position - other.position).norm());
            raise(&mut errors.orientation, so3::angle_between(&pose.orientation, &other.orientation));
            raise(&mut errors.velocity, (rate.linear - other_rate.linear).norm());
            raise(&mut errors.angular_velocity, (rate.angular - other_rate.angular).norm());
        }
        errors
    }
}

impl<S: RigidSystem> Problem<S> {
    /// A motion of `system` from `initial` at t = 0 that is at `reference` at `t_end`.
    ///
    /// Errors: a `t_end` that is not positive, states that are not finite.
    pub fn try_new(
        system: S,
        initial: StateOf<S>,
        t_end: f64,
        reference: StateOf<S>,
    ) -> Result<Self, StudyError> {
        expect_positive("t_end", t_end)?;
        for (argument, state) in [("initial", &initial), ("reference", &reference)] {
            if !state.is_finite() {
                return Err(ArgumentError::NonFinite { argument, found: f64::NAN }.into());
            }
        }
        Ok(Self { system, initial, t_end, reference })
    }

    /// A motion whose end is computed by `method` in steps of `dt`: as good as that run is.
    ///
    /// Errors: as [`try_new`](Self::try_new), and those of the run.
    pub fn with_fine_run(
        system: S,
        initial: StateOf<S>,
        t_end: f64,
        method: Method,
        dt: f64,
    ) -> Result<Self, StudyError> {
        expect_positive("t_end", t_end)?;
        let grid = TimeGrid::try_new(0.0, t_end, dt)?;
        let reference = Run::new(&system, method, grid).from(&initial)?.state;
        Self::try_new(system, initial, t_end, reference)
    }

    /// The equations of motion.
    pub fn system(&self) -> &S {
        &self.system
    }

    /// The state at t = 0.
    pub fn initial(&self) -> &StateOf<S> {
        &self.initial
    }

    /// The end of the motion, s.
    pub fn t_end(&self) -> f64 {
        self.t_end
    }

    /// The state at the end.
    pub fn reference(&self) -> &StateOf<S> {
        &self.reference
    }

    /// How far a state is from that at the end.
    pub fn errors(&self, state: &StateOf<S>) -> Errors {
        Errors::between(state, &self.reference)
    }
}

/// The freely rotating bodies of thesis 7.2.1, 10 s long.
///
/// Prisms of 1 kg and 1 m³ with the inertia (7.1), to full precision, the axes along those of the world at
/// the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Case {
    /// Proportions 1:1:5 (7.2), ω₀ = (0, √2 π, √2 π) rad/s (7.8): a symmetric rod.
    One,
    /// Proportions 1:2:5 (7.4), ω₀ = (0, 2π, 2π·10⁻⁴) rad/s (7.9): about the middle axis, the Dzhanibekov
    /// effect.
    Two,
    /// Proportions 5:5:1 (7.6), ω₀ as in case 1: a symmetric plate.
    Three,
}

impl Case {
    /// All cases.
    pub const ALL: [Self; 3] = [Self::One, Self::Two, Self::Three];

    /// Side lengths, m.
    pub fn lengths(self) -> Vector3<f64> {
        let proportions: Vector3<f64> = match self {
            Self::One => Vector3::new(1.0, 1.0, 5.0),
            Self::Two => Vector3::new(1.0, 2.0, 5.0),
            Self::Three => Vector3::new(5.0, 5.0, 1.0),
        };
        proportions / proportions.product().cbrt()
    }

    /// ω₀, rad/s.
    pub fn angular_velocity(self) -> Vector3<f64> {
        match self {
            Self::One | Self::Three => Vector3::new(0.0, SQRT_2 * PI, SQRT_2 * PI),
            Self::Two => Vector3::new(0.0, 2.0 * PI, 2e-4 * PI),
        }
    }

    /// The problem, its end by the exact solution.
    pub fn problem(self) -> Result<Problem<RigidBodySystem>, StudyError> {
        let body = RigidBody::try_box(1.0, self.lengths())?;
        free_rotation(body, RigidBodyState::spinning(self.angular_velocity()), 10.0)
    }
}

/// A free body, its end by the exact solution.
pub fn free_rotation(
    body: RigidBody,
    initial: RigidBodyState,
    t_end: f64,
) -> Result<Problem<RigidBodySystem>, StudyError> {
    let reference = FreeBody::try_new(&body, &initial)?.at(t_end)?;
    Problem::try_new(RigidBodySystem::free(body), initial, t_end, reference)
}

/// An asymmetric free body far from the separatrix: I = diag(1, 2, 2.5) kg m², ω₀ = (2, 0.6, 0.4) rad/s, 5 s.
pub fn asymmetric_body() -> Result<Problem<RigidBodySystem>, StudyError> {
    let body = RigidBody::try_principal(1.0, Vector3::new(1.0, 2.0, 2.5))?;
    free_rotation(body, RigidBodyState::spinning(Vector3::new(2.0, 0.6, 0.4)), 5.0)
}

/// The system of [`spring_pendulum`], whose drag is zero, and of [`damped_spring_pendulum`].
pub type SpringPendulum = RigidBodySystem<(Gravity, (Spring, Drag))>;

/// r̈ = f(r), nonlinear: a unit mass on a spring of 1 m and 20 N/m in gravity, swinging in space for 2 s.
pub fn spring_pendulum() -> Result<Problem<SpringPendulum>, StudyError> {
    swinging(0.0, Drag::default())
}

/// r̈ = f(r, ṙ), nonlinear: as [`spring_pendulum`], the spring damped by 0.5 N s/m, in a quadratic drag of
/// 0.2 N s²/m².
pub fn damped_spring_pendulum() -> Result<Problem<SpringPendulum>, StudyError> {
    swinging(0.5, Drag { quadratic: 0.2, ..Drag::default() })
}

fn swinging(damping: f64, drag: Drag) -> Result<Problem<SpringPendulum>, StudyError> {
    let spring = Spring {
        anchor: Vector3::zeros(),
        attachment: Vector3::zeros(),
        stiffness: 20.0,
        damping,
        rest_length: 1.0,
    };
    let body = RigidBody::try_principal(1.0, Vector3::repeat(0.4))?;
    let initial = RigidBodyState {
        configuration: Pose { position: Vector3::new(1.2, 0.0, -0.3), ..Default::default() },
        rate: Twist { linear: Vector3::new(0.2, 1.5, 0.4), ..Default::default() },
    };
    // The error of the reference is below 1e-13: halving the step moves it by less.
    let grid = TimeGrid::try_new(0.0, 2.0, 2.5e-4)?;
    let system = RigidBodySystem::new(body, (Gravity::earth(), (spring, drag)));
    let reference = Run::by_stepper(&system, &RungeKuttaMuntheKaas4, grid).from(&initial)?.state;
    Problem::try_new(system, initial, 2.0, reference)
}
