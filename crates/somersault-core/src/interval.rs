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

/// The one nearest to `t` of the times that there are.
///
/// ```
/// use somersault_core::interval::nearest;
///
/// assert_eq!(nearest(2.0, [Some(0.0), None, Some(1.0)]), Some(1.0));
/// assert_eq!(nearest(2.0, [None]), None);
/// ```
pub fn nearest(t: f64, times: impl IntoIterator<Item = Option<f64>>) -> Option<f64> {
    times.into_iter().flatten().min_by(|a, b| (a - t).abs().total_cmp(&(b - t).abs()))
}

/// The first of increasing times on the way from `t` to `end`, which may be the earlier one; neither counts itself.
///
/// ```
/// use somersault_core::interval::first_between;
///
/// assert_eq!(first_between(&[0.0, 1.0, 2.0], 0.0, 9.0), Some(1.0));
/// assert_eq!(first_between(&[0.0, 1.0, 2.0], 2.0, -9.0), Some(1.0));
/// assert_eq!(first_between(&[0.0, 1.0, 2.0], 0.0, 1.0), None);
/// ```
pub fn first_between(times: &[f64], t: f64, end: f64) -> Option<f64> {
    if t <= end {
        let after = times.partition_point(|time| *time <= t);
        times.get(after).copied().filter(|time| *time < end)
    } else {
        let before = times.partition_point(|time| *time < t);
        times[..before].last().copied().filter(|time| *time > end)
    }
}
