//! Intervals of numbers.

/// Where `x` is between `start` and a greater `end`, as a fraction of their distance; outside it is below 0 or above 1.
///
/// The result is finite also where `end - start` overflows, as it does for −1.5·10³⁰⁸ and 1.5·10³⁰⁸.
///
/// ```
/// use somersault_core::interval::fraction_between;
///
/// assert_eq!(fraction_between(3.0, 2.0, 6.0), 0.25);
/// assert_eq!(fraction_between(0.0, -1.5e308, 1.5e308), 0.5);
/// ```
pub fn fraction_between(x: f64, start: f64, end: f64) -> f64 {
    let distance = end - start;
    if distance.is_finite() {
        (x - start) / distance
    } else {
        (0.5 * x - 0.5 * start) / (0.5 * end - 0.5 * start)
    }
}
