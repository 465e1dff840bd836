//! The order of a method from its errors at several step sizes.

/// Errors at step sizes, and the slope through those that count.
#[derive(Debug, Clone, PartialEq)]
pub struct OrderEstimate {
    /// Step size and error of each run, from coarse to fine.
    pub points: Vec<(f64, f64)>,
    /// The points the slope is taken through.
    pub used: Vec<(f64, f64)>,
    /// Slope of log error over log step size by least squares; `None` where fewer than three points
    /// stand above round-off.
    pub slope: Option<f64>,
}

/// Which runs to make and which to count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// Steps of the coarsest run.
    pub first: u64,
    /// Largest number of steps.
    pub last: u64,
    /// Ratio of the numbers of steps of one run and the next, above 1.
    pub ratio: f64,
    /// Errors below this may be round-off: they end the refinement and do not count.
    pub floor: f64,
    /// Errors above this are too large for the leading term to tell; they do not count.
    pub ceiling: f64,
    /// How many of the finest points that count the slope is taken through.
    pub points: usize,
}

impl Default for Sampling {
    /// For errors in metres or radians over some seconds.
    fn default() -> Self {
        Self {
            first: 8,
            last: 12_000,
            ratio: std::f64::consts::SQRT_2,
            floor: 4e-12,
            ceiling: 0.03,
            points: 4,
        }
    }
}

/// Runs `error_of(steps)`, the error at the end of an interval of length `duration` divided into that
/// many steps, at finer and finer steps, and takes the slope through the finest points that count
/// (three at least). A run that fails counts as one with an infinite error.
pub fn estimate(
    duration: f64,
    sampling: &Sampling,
    mut error_of: impl FnMut(u64) -> Option<f64>,
) -> OrderEstimate {
    let [estimate] = estimate_all(duration, sampling, |n| error_of(n).map(|e| [e]));
    estimate
}

/// As [`estimate`], of several errors of the same runs, which are refined until all are below the floor.
pub fn estimate_all<const N: usize>(
    duration: f64,
    sampling: &Sampling,
    mut errors_of: impl FnMut(u64) -> Option<[f64; N]>,
) -> [OrderEstimate; N] {
    let mut runs: Vec<(f64, [f64; N])> = Vec::new();
    let mut exact_steps = sampling.first as f64;
    loop {
        let steps = exact_steps.round() as u64;
        if steps > sampling.last {
            break;
        }
        let failed = [f64::INFINITY; N];
        let errors =
            errors_of(steps).unwrap_or(failed).map(|e| if e.is_finite() { e } else { f64::INFINITY });
        runs.push((duration / steps as f64, errors));
        if errors.iter().all(|e| *e < sampling.floor) {
            break;
        }
        exact_steps *= sampling.ratio;
    }
    std::array::from_fn(|i| {
        let all: Vec<_> = runs.iter().map(|(h, errors)| (*h, errors[i])).collect();
        // What follows the first error below the floor is round-off.
        let end = all.iter().position(|(_, e)| *e < sampling.floor).map_or(all.len(), |k| k + 1);
        let points = all[..end].to_vec();
        let counting: Vec<_> =
            points.iter().copied().filter(|(_, e)| (sampling.floor..sampling.ceiling).contains(e)).collect();
        let used = counting[counting.len().saturating_sub(sampling.points)..].to_vec();
        let slope = (used.len() >= 3).then(|| slope(&used));
        OrderEstimate { points, used, slope }
    })
}

/// Slope of log y over log x by least squares.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let (sx, sy) = logs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let (mx, my) = (sx / n, sy / n);
    let (num, den) =
        logs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    num / den
}
