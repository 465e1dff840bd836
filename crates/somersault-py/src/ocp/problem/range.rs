//! Where a search has its starts.

use super::MotionProblem;
use crate::core::convert::numbers_or_one;
use crate::core::error::Error;
use pyo3::prelude::*;
use somersault::nlp::{Bounds, Nlp};

impl MotionProblem {
    /// The middle of a search and the range about it.
    pub(super) fn range(
        &self,
        py: Python<'_>,
        z: Option<&Bound<'_, PyAny>>,
        reach: Option<&Bound<'_, PyAny>>,
    ) -> Result<(Vec<f64>, Bounds), Error> {
        let z = z.map(|z| Ok::<_, Error>(self.room(z)?.0)).transpose()?;
        let n = self.n_variables;
        let given = reach.map(|reach| numbers_or_one("reach", n, reach)).transpose()?;
        if let Some(found) = given.iter().flatten().find(|reach| !(**reach >= 0.0 && reach.is_finite())) {
            return Err(Error::input(format!("`reach` must be finite and not negative, found {found}")));
        }
        let problem = self.shared.acquire(py)?;
        let Bounds { lower, upper } = &problem.structure().variables;
        let lifted = &problem.transcription().layout().lifted;
        let (mut centre, mut range) = (Vec::with_capacity(n), Bounds::default());
        for k in 0..n {
            let (lower, upper) = (lower[k], upper[k]);
            let bounded = lower.is_finite() && upper.is_finite();
            let middle = match &z {
                Some(z) => z[k].clamp(lower, upper),
                None if bounded => 0.5 * (lower + upper),
                None => 0.0_f64.clamp(lower, upper),
            };
            let reach = match &given {
                _ if lifted.iter().any(|range| range.contains(&k)) => 0.0,
                Some(reach) => reach[k],
                None if z.is_none() && bounded => 0.5 * (upper - lower),
                None => 1.0,
            };
            range.push((middle - reach).max(lower), (middle + reach).min(upper));
            centre.push(middle);
        }
        Ok((centre, range))
    }
}
