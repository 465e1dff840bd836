//! Stability and accuracy studies of thesis chapters 6 and 7, for the methods of the table and for any
//! [`Stepper`](crate::stepper::Stepper) that users define.
//!
//! | Study | Thesis | Result |
//! |---|---|---|
//! | [`stability`] | 6.1, Table 6.1, Figure 6.1 | stability region of the translation: membership, area, boundary |
//! | [`energy`] | 6.2, Tables 6.2 and 6.3, (6.4) | extremes of the rotational energy of free bodies at large steps |
//! | [`order`] | Tables 7.1, 7.2 | observed orders in position, orientation and both velocities |
//! | [`work_precision`] | 7.2.1, Figures 7.1, 7.2 | errors against evaluations and time |
//!
//! [`problem`] holds the motions that the last two run.
//!
//! A function that takes a [`Method`](crate::methods::Method) looks it up in the table; its twin that ends
//! in `_of` takes a stepper. Long studies report to a [`Progress`] and stop when it says so.

#[cfg(feature = "rayon")]
pub mod energy;
pub mod order;
pub mod problem;
#[cfg(feature = "rayon")]
pub mod stability;
pub mod work_precision;

use crate::body::BodyError;
use crate::driver::{Flow, IntegrateError};
use crate::exact::FreeBodyError;
use crate::stepper::StepError;
use somersault_core::argument::ArgumentError;

/// Called with the parts done and the parts in all; [`Flow::Stop`] ends the study with
/// [`StudyError::Stopped`].
pub type Progress<'a> = dyn FnMut(usize, usize) -> Flow + 'a;

/// A progress that looks at nothing and never stops.
pub fn silent(_: usize, _: usize) -> Flow {
    Flow::Continue
}

/// Why a study could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A list without entries.
    #[error("`{argument}` must have at least one entry")]
    Empty {
        /// Name of the argument.
        argument: &'static str,
    },
    /// A list that does not increase.
    #[error("`{argument}` must increase from a positive first entry")]
    NotIncreasing {
        /// Name of the argument.
        argument: &'static str,
    },
    /// The states that a method makes of a linear equation do not obey a linear recurrence of the length
    /// that its history allows.
    #[error(
        "the method does not obey a linear recurrence over its {history} remembered steps at lambda = {re} + {im}i: relative defect {defect:e}; is `history` in its INFO complete?"
    )]
    NotLinear {
        /// Remembered steps, as its INFO has them.
        history: u8,
        /// Real part of λ.
        re: f64,
        /// Imaginary part of λ.
        im: f64,
        /// What the recurrence leaves, relative to the data.
        defect: f64,
    },
    /// The method does not apply, or its step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A body cannot be made.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The exact motion cannot be given.
    #[error(transparent)]
    FreeBody(#[from] FreeBodyError),
    /// A run failed.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// The progress said to stop.
    #[error("stopped after {done} of {total} parts")]
    Stopped {
        /// Parts done.
        done: usize,
        /// Parts in all.
        total: usize,
    },
}

fn check_not_empty<T>(argument: &'static str, list: &[T]) -> Result<(), StudyError> {
    if list.is_empty() { Err(StudyError::Empty { argument }) } else { Ok(()) }
}

fn report(progress: &mut Progress<'_>, done: usize, total: usize) -> Result<(), StudyError> {
    match progress(done, total) {
        Flow::Stop if done < total => Err(StudyError::Stopped { done, total }),
        _ => Ok(()),
    }
}
