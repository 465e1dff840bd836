//! What a shooting is made of.

use crate::error::OcpError;
use somersault_core::argument::{expect_finite, expect_length, expect_positive};
use somersault_core::quadrature::{gregory, left_rectangles};
use somersault_integrators::tableau::{COMMUTATOR_FREE_4, CommutatorFreeTableau, EULER, RUNGE_KUTTA_4};
use somersault_multibody::joint_motion::SplineMotion;
use somersault_nlp::Bounds;

/// How a step in time is made, and integrals with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Scheme {
    /// Explicit Euler with rectangles on the left (thesis 2.6, 2.8): order 1.
    ExplicitEuler,
    /// The classical Runge–Kutta method on vectors, the commutator-free one of E. Celledoni, A. Marthinsen and
    /// B. Owren (Future Generation Computer Systems 19, 2003) on rotations, both of order 4, with Gregory's
    /// end corrections of the trapezoidal rule, likewise of order 4.
    RungeKutta4,
}

/// Which numbers the channels drive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Drive {
    /// The active joints, in their order, by their motion (thesis 2.4).
    Motion,
    /// The given degrees of freedom by joint forces (thesis 2.3); none is active then.
    Torque {
        /// Degrees of freedom, one for each joint of the base.
        dofs: Vec<usize>,
    },
}

/// How long a phase takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Duration {
    /// s.
    Fixed(f64),
    /// A variable between two bounds, s.
    Free {
        /// Above zero.
        lower: f64,
        /// Finite.
        upper: f64,
    },
}

/// One phase of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Phase {
    /// Of the channels.
    pub motion: SplineMotion,
    /// Steps of equal length.
    pub n_steps: usize,
    /// How long it takes.
    pub duration: Duration,
    /// One for single shooting; more for multiple shooting, their starts lifted into the decision vector.
    pub n_segments: usize,
}

impl Phase {
    /// Single shooting over a fixed duration.
    pub fn new(motion: SplineMotion, n_steps: usize, duration: f64) -> Self {
        Self { motion, n_steps, duration: Duration::Fixed(duration), n_segments: 1 }
    }

    pub(super) fn expect_valid(&self) -> Result<(), OcpError> {
        match self.duration {
            Duration::Fixed(duration) => {
                expect_positive("duration", duration)?;
            }
            Duration::Free { lower, upper } => {
                expect_positive("duration.lower", lower)?;
                expect_finite("duration.upper", &[upper])?;
                let mut bounds = Bounds::default();
                bounds.push(lower, upper);
                crate::error::expect_bounds("duration", &bounds)?;
            }
        }
        expect_positive("n_steps", self.n_steps as f64)?;
        expect_positive("n_segments", self.n_segments as f64)?;
        crate::error::expect_below("n_segments", self.n_segments, self.n_steps + 1)
    }
}

/// The passive state at the start of a motion, and what of it is free.
///
/// All vectors are those of the whole system; what they hold for active degrees of freedom is not read.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// q, from which free positions are displaced.
    pub position: Vec<f64>,
    /// v, to which free velocities are added.
    pub velocity: Vec<f64>,
    /// For each degree of freedom, whether its position is a variable.
    pub free_positions: Vec<bool>,
    /// For each degree of freedom, whether its velocity is a variable.
    pub free_velocities: Vec<bool>,
}

impl Start {
    /// A given state.
    pub fn fixed(position: &[f64], velocity: &[f64]) -> Self {
        let n = velocity.len();
        Self {
            position: position.to_vec(),
            velocity: velocity.to_vec(),
            free_positions: vec![false; n],
            free_velocities: vec![false; n],
        }
    }

    /// Any state, described from a given one.
    pub fn free(position: &[f64], velocity: &[f64]) -> Self {
        let n = velocity.len();
        Self {
            free_positions: vec![true; n],
            free_velocities: vec![true; n],
            ..Self::fixed(position, velocity)
        }
    }

    pub(super) fn expect_for(&self, n_positions: usize, n_velocities: usize) -> Result<(), OcpError> {
        expect_length("start.position", self.position.len(), n_positions)?;
        expect_length("start.velocity", self.velocity.len(), n_velocities)?;
        expect_length("start.free_positions", self.free_positions.len(), n_velocities)?;
        expect_length("start.free_velocities", self.free_velocities.len(), n_velocities)?;
        expect_finite("start.position", &self.position)?;
        Ok(expect_finite("start.velocity", &self.velocity)?)
    }
}

/// Half steps to each stage of the classical Runge–Kutta method.
const HALF_STEPS: [usize; 4] = [half_steps(0), half_steps(1), half_steps(2), half_steps(3)];

const fn half_steps(stage: usize) -> usize {
    (2.0 * RUNGE_KUTTA_4.nodes[stage]) as usize
}

impl Scheme {
    /// The numbers of a step.
    pub(crate) fn tableau(self) -> &'static CommutatorFreeTableau {
        match self {
            Self::ExplicitEuler => &EULER,
            Self::RungeKutta4 => &COMMUTATOR_FREE_4,
        }
    }

    pub(crate) fn n_stages(self) -> usize {
        self.tableau().on_vectors.nodes.len()
    }

    /// Places in a step at which the channels are needed.
    pub(crate) fn points_per_step(self) -> usize {
        match self {
            Self::ExplicitEuler => 1,
            Self::RungeKutta4 => 2,
        }
    }

    /// The point of a stage after the start of a step.
    pub(crate) fn point(self, stage: usize) -> usize {
        match self {
            Self::ExplicitEuler => 0,
            Self::RungeKutta4 => HALF_STEPS[stage],
        }
    }

    /// Weights of n + 1 nodes in integrals over [0, 1].
    pub(crate) fn quadrature(self, n: usize) -> Vec<f64> {
        match self {
            Self::ExplicitEuler => left_rectangles(n),
            Self::RungeKutta4 => gregory(n),
        }
    }
}
