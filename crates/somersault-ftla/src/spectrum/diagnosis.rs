//! Whether a problem is hyper-sensitive, in words and numbers.

use super::{Spectrum, SpectrumError, SplittingDims};
use std::fmt;

/// Time constants that the gap must have had for a splitting to count as found.
const ENOUGH: f64 = 3.0;

/// What the exponents at a point say about a problem with a given horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diagnosis {
    /// (n^s, n^c, n^u); all in the centre where no gap is wide enough.
    pub dims: SplittingDims,
    /// The averaging time that shows the splitting best.
    pub time: f64,
    /// Slowest of the fast contracting and of the fast expanding rates there, 1/s; zero where there are none.
    pub fast_rates: [f64; 2],
    /// Largest |μ| of the centre, 1/s.
    pub center_rate: f64,
    /// Width of the gaps between stable and centre and between centre and unstable exponents, 1/s.
    pub gaps: [f64; 2],
    /// The smaller gap times the averaging time: how far the subspaces have converged, in time constants.
    pub time_constants: f64,
    /// The longest range of averaging times over which the splitting has these dimensions.
    pub window: [f64; 2],
    /// The horizon.
    pub horizon: f64,
}

impl Diagnosis {
    /// Fast rates in both directions that act for many time constants on the horizon: shooting from one end loses
    /// e^(rate · horizon).
    pub fn is_hyper_sensitive(&self) -> bool {
        self.fast_rates[0].min(self.fast_rates[1]) * self.horizon > 2.0 * ENOUGH
    }

    /// Hyper-sensitive in some directions only.
    pub fn is_partially_hyper_sensitive(&self) -> bool {
        self.is_hyper_sensitive() && self.dims.center > 0
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { dims, time, fast_rates, center_rate, gaps, time_constants, horizon, .. } = self;
        let kind = if self.is_partially_hyper_sensitive() {
            "partially hyper-sensitive"
        } else if self.is_hyper_sensitive() {
            "completely hyper-sensitive"
        } else {
            return write!(
                f,
                "not hyper-sensitive: no rates that are fast against the horizon of {horizon} s stand apart (largest gap \
                 {} 1/s at T = {time} s)",
                Digits(gaps[0].min(gaps[1]))
            );
        };
        write!(
            f,
            "{kind}: {} stable, {} centre and {} unstable directions; fast rates from {} and {} 1/s against {} \
             1/s in the centre, gaps {} and {} 1/s, {:.1} time constants at T = {time} s; over the horizon of \
             {horizon} s single shooting amplifies errors by 1e{:.0}",
            dims.stable,
            dims.center,
            dims.unstable,
            Digits(fast_rates[0]),
            Digits(fast_rates[1]),
            Digits(*center_rate),
            Digits(gaps[0]),
            Digits(gaps[1]),
            time_constants,
            fast_rates[1] * horizon / std::f64::consts::LN_10
        )
    }
}

/// A rate in a sentence: four digits, however small it is.
struct Digits(f64);

impl fmt::Display for Digits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(x) = *self;
        if x == 0.0 || (0.1..1e4).contains(&x.abs()) { write!(f, "{x:.3}") } else { write!(f, "{x:.3e}") }
    }
}

/// Chooses (n^s, n^c, n^u) from spectra at one point: the widest gap above and the widest below zero at the averaging time
/// where the smaller of the two times T is largest. A gap of less than three time constants is none. Averaging times ascend.
pub fn diagnose<const N: usize>(spectra: &[Spectrum<N>], horizon: f64) -> Result<Diagnosis, SpectrumError> {
    if !horizon.is_finite() || horizon <= 0.0 {
        return Err(SpectrumError::Horizon { found: horizon });
    }
    for pair in spectra.windows(2) {
        let (before, after) = (pair[0].time, pair[1].time);
        if pair[0].direction != pair[1].direction || before.is_nan() || after.is_nan() || before >= after {
            return Err(SpectrumError::Order { before, after });
        }
    }
    let views: Vec<Diagnosis> = spectra.iter().map(|s| view(s, horizon)).collect();
    let best = views.iter().copied().reduce(|a, b| if b.time_constants > a.time_constants { b } else { a });
    let mut best = best.ok_or(SpectrumError::Empty)?;
    let mut start = None;
    for view in &views {
        if view.dims == best.dims {
            let from = *start.get_or_insert(view.time);
            if view.time - from >= best.window[1] - best.window[0] {
                best.window = [from, view.time];
            }
        } else {
            start = None;
        }
    }
    Ok(best)
}

fn view<const N: usize>(spectrum: &Spectrum<N>, horizon: f64) -> Diagnosis {
    let mut rates = spectrum.rates();
    rates.as_mut_slice().sort_by(f64::total_cmp);
    let time = spectrum.time;
    let gap = |k: usize| rates[k] - rates[k - 1];
    let widest = |range: &mut dyn Iterator<Item = usize>| range.max_by(|&a, &b| gap(a).total_cmp(&gap(b)));
    // the first unstable and the first exponent that is not stable
    let upper = widest(&mut (1..N).filter(|&k| rates[k] > 0.0));
    let lower = widest(&mut (1..N).filter(|&k| rates[k - 1] < 0.0));
    let all_center = Diagnosis {
        dims: SplittingDims { stable: 0, center: N, unstable: 0 },
        time,
        fast_rates: [0.0; 2],
        center_rate: rates.amax(),
        gaps: [lower.map_or(0.0, gap), upper.map_or(0.0, gap)],
        time_constants: 0.0,
        window: [time; 2],
        horizon,
    };
    let (Some(lower), Some(upper)) = (lower, upper) else { return all_center };
    let gaps = [gap(lower), gap(upper)];
    let time_constants = gaps[0].min(gaps[1]) * time;
    if lower > upper || time_constants < ENOUGH {
        return all_center;
    }
    Diagnosis {
        dims: SplittingDims { stable: lower, center: upper - lower, unstable: N - upper },
        fast_rates: [-rates[lower - 1], rates[upper]],
        center_rate: (lower..upper).fold(0.0, |m: f64, k| m.max(rates[k].abs())),
        gaps,
        time_constants,
        ..all_center
    }
}
