//! When an iteration for the unknowns of an implicit step has come to an end.

use crate::state::{Configuration, ErrorSum, Tolerances};

/// A rounding of the configuration: of its size, now or at the start, but of a metre and of a radian at least.
///
/// A body at rest has a velocity of rounding only, and forces in balance leave what rounding they have. A rounding of q moves a
/// velocity by a few roundings over h.
const ROUNDING: Tolerances = Tolerances { relative: 16.0 * f64::EPSILON, absolute: 16.0 * f64::EPSILON };

/// Whether two displacements together move nothing by a rounding of a configuration, or of what it was at the start.
pub(crate) fn is_rounding<Q: Configuration>(now: &Q, began: &Q, displacements: [&Q::Rate; 2]) -> bool {
    let mut sum = ErrorSum::default();
    for displacement in displacements {
        now.weigh_all(began, displacement, &ROUNDING, &mut sum);
    }
    sum.root_mean_square() <= 1.0
}
