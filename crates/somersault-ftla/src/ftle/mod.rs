//! Finite-time Lyapunov exponents over a field of initial points, and its ridges.
//!
//! ```math
//! \sigma(x_0) = \frac{1}{|T|} \ln \left\| \frac{\partial x(t_0 + T)}{\partial x_0} \right\|
//! ```
//! from the exact variational equations. The ridges of σ forward in time repel, those backward in time attract: Lagrangian coherent
//! structures of the flow (S. C. Shadden, F. Lekien and J. E. Marsden, Physica D 212 (2005) 271).

mod ridges;

pub use ridges::{Grid, Ridge, RidgeCriteria};

use crate::budget::Limit;
use crate::flow::{Factor, FlowError, VariationalFlow, Work};
use crate::spectrum::Spectrum;
use crate::system::VectorField;
use nalgebra::DVector;
use rayon::prelude::*;
use somersault_core::argument::ArgumentError;

/// Stretch at which a factor ends: the largest singular value keeps half of its digits and more.
const GROWTH: f64 = 1e6;

/// How the motion from a point ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointStatus {
    /// At its time.
    Arrived,
    /// Outside of the domain.
    LeftDomain,
    /// Where the field or its Jacobian has no value.
    NoValue,
    /// At steps below rounding, as where it runs off to infinity.
    StepUnderflow,
    /// After as many steps as are allowed.
    TooManySteps,
    /// At a limit of time or evaluations, or before it began.
    LimitReached,
    /// As all motions were stopped, or before it began.
    Interrupted,
}

impl PointStatus {
    /// That of a motion that ended with an error.
    pub fn of(error: &FlowError) -> Self {
        match error {
            FlowError::LeftDomain { .. } => Self::LeftDomain,
            // arguments are checked before points are
            FlowError::NonFinite { .. } | FlowError::Argument(_) => Self::NoValue,
            FlowError::StepUnderflow { .. } => Self::StepUnderflow,
            FlowError::TooManySteps { .. } => Self::TooManySteps,
            FlowError::LimitReached { limit: Limit::Stopped, .. } => Self::Interrupted,
            FlowError::LimitReached { .. } => Self::LimitReached,
        }
    }
}

/// The exponents of many initial points, in the order of the points. NaN stands for what a point has no value of.
#[derive(Debug, Clone, PartialEq)]
pub struct FtleField {
    /// σ, 1/s.
    pub exponents: Vec<f64>,
    /// The direction that is stretched most, a unit vector for each point.
    pub directions: Vec<f64>,
    /// Where the motions arrived.
    pub ends: Vec<f64>,
    /// How each of them ended.
    pub statuses: Vec<PointStatus>,
    /// What they cost together.
    pub work: Work,
}

/// One point.
struct Found {
    exponent: f64,
    direction: Vec<f64>,
    end: Vec<f64>,
    status: PointStatus,
    work: Work,
}

/// The field over `points`, which follow one another, for motions of this duration, negative backward in time. On the threads of the
/// current pool; the values do not depend on their number.
pub fn ftle_field<S: VectorField + Sync>(
    flow: &VariationalFlow<'_, S>,
    points: &[f64],
    duration: f64,
) -> Result<FtleField, FlowError> {
    let n = flow.system().dimension();
    if !duration.is_finite() || duration == 0.0 {
        let (argument, allowed) = ("duration", "finite and not zero");
        return Err(ArgumentError::OutOfRange { argument, allowed, found: duration }.into());
    }
    if n == 0 || !points.len().is_multiple_of(n) {
        let expected = points.len() - points.len() % n.max(1);
        return Err(ArgumentError::Length { argument: "points", expected, found: points.len() }.into());
    }
    let found: Vec<Found> = points.par_chunks_exact(n).map(|p| of_point(flow, p, duration)).collect();
    let mut field = FtleField {
        exponents: found.iter().map(|point| point.exponent).collect(),
        directions: Vec::with_capacity(points.len()),
        ends: Vec::with_capacity(points.len()),
        statuses: found.iter().map(|point| point.status).collect(),
        work: Work::default(),
    };
    for point in found {
        field.directions.extend(point.direction);
        field.ends.extend(point.end);
        field.work += point.work;
    }
    Ok(field)
}

fn of_point<S: VectorField>(flow: &VariationalFlow<'_, S>, p: &[f64], duration: f64) -> Found {
    let mut links = Vec::new();
    let (work, ended) =
        flow.factors(&DVector::from_column_slice(p), &[duration], GROWTH, |factor| match factor {
            Factor::Link(link) => links.push(link),
            Factor::Mark(_) => {}
        });
    let nowhere = |status| {
        let nothing = vec![f64::NAN; p.len()];
        Found { exponent: f64::NAN, direction: nothing.clone(), end: nothing, status, work }
    };
    match (ended, links.last()) {
        // a system that is stopped has no values
        (Err(FlowError::NonFinite { .. }), _) if flow.ended() == Some(Limit::Stopped) => {
            nowhere(PointStatus::Interrupted)
        }
        (Err(error), _) => nowhere(PointStatus::of(&error)),
        (Ok(()), None) => nowhere(PointStatus::NoValue),
        (Ok(()), Some(last)) => {
            let end = last.end.iter().copied().collect();
            let (exponent, direction) = Spectrum::of_factors(&links).largest();
            Found { exponent, direction, end, status: PointStatus::Arrived, work }
        }
    }
}
