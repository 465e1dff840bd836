//! How long a motion follows an optimum that it starts beside (thesis 10.2, Figure 10.2).
//!
//! An error ε of the costates at the start has grown to a bound b of the states after about ln(b/ε)/μ seconds, μ the largest
//! exponent. Placement removes the part along the fast directions, down to the error of its averaging time.

use super::{Placement, PlacementStatus};
use crate::flow::{FlowError, VariationalFlow};
use crate::shooting::Extremal;
use crate::system::VectorField;
use nalgebra::DVector;
use rayon::prelude::*;
use somersault_core::argument::ArgumentError;

/// Growth of one initial error.
#[derive(Debug, Clone, PartialEq)]
pub struct Following {
    /// The size of the error.
    pub size: f64,
    /// For how long the motion follows the optimum, s.
    pub without_placement: f64,
    /// For how long it does when its start has been placed, s.
    pub with_placement: f64,
    /// How the placement ended.
    pub status: PlacementStatus,
    /// The largest entry of what placement leaves of the error.
    pub left: f64,
}

/// Times between looks at the motion, over the horizon.
const LOOKS: usize = 400;

impl Placement {
    /// For each of `sizes`, how long the motion from the start of `optimum` plus size times `error`, and from where placement
    /// takes that point, stay within `bound` of the optimum in every state. In parallel over the sizes.
    pub fn following<S: VectorField + Sync>(
        &self,
        flow: &VariationalFlow<'_, S>,
        optimum: &Extremal,
        error: &DVector<f64>,
        sizes: &[f64],
        bound: f64,
    ) -> Result<Vec<Following>, FlowError> {
        if bound.is_nan() || bound <= 0.0 {
            return Err(
                ArgumentError::OutOfRange { argument: "bound", allowed: "positive", found: bound }.into()
            );
        }
        if let Some(&found) = sizes.iter().find(|size| !size.is_finite()) {
            return Err(ArgumentError::OutOfRange { argument: "sizes", allowed: "finite", found }.into());
        }
        let expected = flow.system().dimension();
        if error.len() != expected {
            return Err(ArgumentError::Length { argument: "error", expected, found: error.len() }.into());
        }
        let (first, last) = (optimum.times[0], optimum.times[optimum.times.len() - 1]);
        let step = (last - first) / LOOKS as f64;
        let looks = (0..=LOOKS).into_par_iter().map(|k| optimum.at(flow, first + step * k as f64));
        let course = looks.collect::<Result<Vec<_>, FlowError>>()?;
        let followed = |start: &DVector<f64>| {
            let mut p = start.clone();
            for (k, there) in course.iter().enumerate().skip(1) {
                match flow.state(&p, step) {
                    Ok(next) if (&next - there).rows(0, next.len() / 2).amax() <= bound => p = next,
                    Ok(_) | Err(_) => return step * (k - 1) as f64,
                }
            }
            last - first
        };
        let of = |&size: &f64| {
            let start = &course[0] + error * size;
            let placed = self.place(flow, &start);
            Following {
                size,
                without_placement: followed(&start),
                with_placement: followed(&placed.p),
                status: placed.status,
                left: (&placed.p - &course[0]).amax(),
            }
        };
        Ok(sizes.par_iter().map(of).collect())
    }
}
