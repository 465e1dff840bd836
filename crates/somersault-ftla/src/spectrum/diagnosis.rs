//! Whether a problem is hyper-sensitive, in words and numbers.
//!
//! With ℓᵢ(T) = μᵢT the logarithms of the singular values of Φ(T) in forward order and g(T) = ℓ_{k+1} − ℓ_k a gap between
//! them, a splitting of rates has g = γT + O(1), and growth like a power of time has g = m ln T + O(1), whose exponents m ln T/T
//! fall indefinitely. At one averaging time the two look alike. What tells them apart are the gains of g in doublings of time:
//!
//! ```text
//! G = g(T) − g(T/2),   H = g(T/2) − g(T/4):   γT/2 and γT/4 by rates,   m ln 2 and m ln 2 by a power.
//! ```
//! A gap counts as one of rates where g and G are three time constants at least, G is above H by a twentieth, and the exponents
//! have settled: the rate over the second half of the time, 2G/T, is at most three tenths above that over the whole, g/T. Chains of
//! integrators gain at most 2 ln 2 = 1.4 in units in which their rates are near one. Exponents are the
//! [balanced](Spectrum::balanced) ones, so that the unit of the cost says nothing.

use super::{Spectrum, SpectrumError, SplittingDims};
use nalgebra::DVector;
use std::fmt;

/// Time constants that the gap must have, and gain in a doubling of the averaging time, for a splitting to count as found.
const ENOUGH: f64 = 3.0;

/// How much larger than the gain of one doubling that of the next must be; by rates it is twice as large, by a power the same.
const FASTER_THAN_A_POWER: f64 = 1.05;

/// How far the rate over the second half of the averaging time may be above that over the whole of it.
const SETTLED: f64 = 1.3;

/// What the averaging times allow to be said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Fast rates in all directions, that act for many time constants on the horizon.
    Complete,
    /// Fast rates in some directions, beside slow ones.
    Partial,
    /// No rates that are fast against the horizon.
    Insensitive,
    /// The averaging times do not tell.
    Undetermined(Unknown),
    /// The flow is not that of a Hamiltonian system, so that there is no optimal control problem: paired exponents do not add
    /// up to zero.
    NotHamiltonian {
        /// The largest |μᵢ + μ_{2n+1−i}|, 1/s.
        defect: f64,
    },
}

/// Why averaging times do not tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unknown {
    /// They do not span a factor of four.
    Span,
    /// There are gaps that grow, but not as by rates that have settled.
    Unsettled,
    /// They end before half of the horizon, over which slower rates than they show may be fast.
    Short,
}

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Span => "averaging times must span a factor of four",
            Self::Unsettled => "the exponents have not settled at the longest averaging time",
            Self::Short => "the averaging times end before half of the horizon",
        })
    }
}

/// What the exponents at a point say about a problem with a given horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diagnosis {
    /// What can be said.
    pub verdict: Verdict,
    /// (n^s, n^c, n^u); all in the centre where no gap is one of rates.
    pub dims: SplittingDims,
    /// The averaging time that shows the splitting best; the last where there is none.
    pub time: f64,
    /// Slowest of the fast contracting and of the fast expanding rates there, 1/s; zero where there are none. As the widths of
    /// the gaps they are those of the exponents in the units of p.
    pub fast_rates: [f64; 2],
    /// The same of the balanced exponents, which the verdict is about.
    pub balanced_rates: [f64; 2],
    /// Largest |μ| of the centre, 1/s.
    pub center_rate: f64,
    /// Width of the gaps between stable and centre and between centre and unstable exponents, 1/s.
    pub gaps: [f64; 2],
    /// The smaller gap times the averaging time: how far the subspaces have converged, in time constants.
    pub time_constants: f64,
    /// The longest range of averaging times over which the widest gaps give these dimensions.
    pub window: [f64; 2],
    /// The horizon.
    pub horizon: f64,
}

impl Diagnosis {
    /// Fast rates in both directions that act for many time constants on the horizon: shooting from one end loses
    /// e^(rate · horizon).
    pub fn is_hyper_sensitive(&self) -> bool {
        matches!(self.verdict, Verdict::Complete | Verdict::Partial)
    }

    /// Hyper-sensitive in some directions only.
    pub fn is_partially_hyper_sensitive(&self) -> bool {
        self.verdict == Verdict::Partial
    }

    /// Time constants of the slower fast rate on the horizon.
    fn on_horizon(&self) -> f64 {
        self.balanced_rates[0].min(self.balanced_rates[1]) * self.horizon
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { verdict, dims, time, fast_rates, center_rate, gaps, time_constants, horizon, .. } = self;
        let balanced_rates = self.balanced_rates;
        let kind = match verdict {
            Verdict::Partial => "partially hyper-sensitive",
            Verdict::Complete => "completely hyper-sensitive",
            Verdict::Insensitive => {
                return write!(
                    f,
                    "not hyper-sensitive: no rates that are fast against the horizon of {horizon} s stand apart (largest \
                     gap {} 1/s at T = {time} s)",
                    Digits(gaps[0].min(gaps[1]))
                );
            }
            Verdict::Undetermined(why) => {
                return write!(
                    f,
                    "undetermined: {why} (largest exponent {} 1/s at T = {time} s, horizon {horizon} s)",
                    Digits(*center_rate)
                );
            }
            Verdict::NotHamiltonian { defect } => {
                return write!(
                    f,
                    "not an optimal control problem: the flow is not Hamiltonian, paired exponents add up to {} 1/s at T = \
                     {time} s",
                    Digits(*defect)
                );
            }
        };
        write!(
            f,
            "{kind}: {} stable, {} centre and {} unstable directions; fast rates from {} and {} 1/s against {} \
             1/s in the centre, gaps {} and {} 1/s, {:.1} time constants at T = {time} s; at the rates of balanced units single \
             shooting amplifies errors by 1e{:.0} and more over the horizon of {horizon} s",
            dims.stable,
            dims.center,
            dims.unstable,
            Digits(fast_rates[0]),
            Digits(fast_rates[1]),
            Digits(*center_rate),
            Digits(gaps[0]),
            Digits(gaps[1]),
            time_constants,
            balanced_rates[1] * horizon / std::f64::consts::LN_10
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

/// Chooses (n^s, n^c, n^u) from spectra at one point, and says what they tell about a problem with this horizon.
///
/// At each averaging time T from four times the shortest on, the gap above and the gap below zero that grow most between T/2
/// and T are taken; both must be of rates, as the head of this module says, at the longest time. Of the times at which the
/// same gaps are, the one at which the smaller is widest is reported. Averaging times ascend.
///
/// That a problem is not hyper-sensitive is said only if the averaging times reach half of the horizon, or the largest rate
/// acts for few time constants on it.
pub fn diagnose(spectra: &[Spectrum], horizon: f64) -> Result<Diagnosis, SpectrumError> {
    if !horizon.is_finite() || horizon <= 0.0 {
        return Err(SpectrumError::Horizon { found: horizon });
    }
    Spectrum::expect_family(spectra)?;
    let last = spectra.last().ok_or(SpectrumError::Empty)?;
    let growths: Vec<Stretches> = spectra.iter().map(Stretches::of).collect();
    let views: Vec<View> = (0..growths.len()).filter_map(|i| view(&growths, i)).collect();
    let settled = views.last().filter(|view| view.settled);
    let best = settled.and_then(|last| {
        let alike = views.iter().copied().filter(|view| view.settled && view.first == last.first);
        alike.reduce(|a, b| if b.constants() > a.constants() { b } else { a })
    });
    let longest = &growths[growths.len() - 1];
    let mut found = match &best {
        Some(view) => of_view(&spectra[view.at], &growths[view.at], view, horizon),
        None => of_nothing(longest, horizon),
    };
    let mut start = None;
    for growth in &growths {
        if growth.widest() == Some(found.dims) {
            let from = *start.get_or_insert(growth.time);
            if growth.time - from >= found.window[1] - found.window[0] {
                found.window = [from, growth.time];
            }
        } else {
            start = None;
        }
    }
    let defect = last.pairing_defect();
    let largest = longest.logs.amax();
    found.verdict = if defect * last.time > PAIRED * (1.0 + largest) {
        Verdict::NotHamiltonian { defect }
    } else if best.is_some() {
        match (found.on_horizon() > 2.0 * ENOUGH, found.dims.center) {
            (false, _) => Verdict::Insensitive,
            (true, 0) => Verdict::Complete,
            (true, 1..) => Verdict::Partial,
        }
    } else if largest / last.time * horizon <= 2.0 * ENOUGH {
        Verdict::Insensitive
    } else {
        match views.last() {
            Some(view) if view.grows => Verdict::Undetermined(Unknown::Unsettled),
            Some(_) if last.time < 0.5 * horizon => Verdict::Undetermined(Unknown::Short),
            Some(_) => Verdict::Insensitive,
            None => Verdict::Undetermined(Unknown::Span),
        }
    };
    Ok(found)
}

/// What products σᵢσ_{2n+1−i} may differ from one by, and more with the length of the run: loose tolerances leave 1e-5.
const PAIRED: f64 = 1e-3;

/// ℓ at one averaging time, ascending.
#[derive(Debug, Clone)]
struct Stretches {
    time: f64,
    logs: DVector<f64>,
}

impl Stretches {
    fn of(spectrum: &Spectrum) -> Self {
        let mut logs = &spectrum.balanced * (spectrum.direction.sign() * spectrum.time);
        logs.as_mut_slice().sort_by(f64::total_cmp);
        Self { time: spectrum.time, logs }
    }

    /// ℓ_k − ℓ_{k−1}.
    fn gap(&self, k: usize) -> f64 {
        self.logs[k] - self.logs[k - 1]
    }

    /// The dimensions of the widest gaps above and below zero, if they have enough time constants.
    fn widest(&self) -> Option<SplittingDims> {
        let [lower, upper] = widest(&self.logs, |k| self.gap(k))?;
        (self.gap(lower).min(self.gap(upper)) >= ENOUGH).then(|| dims_of(self.logs.len(), [lower, upper]))
    }
}

/// The largest gaps below and above zero, as the numbers of the first direction that is not stable and of the first unstable
/// one; none where they are not in that order. A gap counts for no more than what is beyond it grows or shrinks.
fn widest(logs: &DVector<f64>, gap: impl Fn(usize) -> f64) -> Option<[usize; 2]> {
    let largest = |strength: &dyn Fn(usize) -> f64| {
        (1..logs.len()).filter(|&k| strength(k) > 0.0).max_by(|&a, &b| strength(a).total_cmp(&strength(b)))
    };
    let upper = largest(&|k| gap(k).min(logs[k]))?;
    let lower = largest(&|k| gap(k).min(-logs[k - 1]))?;
    (lower <= upper).then_some([lower, upper])
}

fn dims_of(n: usize, [lower, upper]: [usize; 2]) -> SplittingDims {
    SplittingDims { stable: lower, center: upper - lower, unstable: n - upper }
}

/// The gaps that grow most at one averaging time.
#[derive(Debug, Clone, Copy)]
struct View {
    /// Number of the spectrum.
    at: usize,
    /// Number of the first direction that is not stable, and of the first unstable one.
    first: [usize; 2],
    gaps: [f64; 2],
    /// Whether both gaps gain enough.
    grows: bool,
    /// Whether both are of rates.
    settled: bool,
}

impl View {
    fn constants(&self) -> f64 {
        self.gaps[0].min(self.gaps[1])
    }
}

/// None where the averaging times do not go down to a quarter of that of number `at`.
fn view(growths: &[Stretches], at: usize) -> Option<View> {
    let now = &growths[at];
    let half = interpolated(growths, 0.5 * now.time)?;
    let quarter = interpolated(growths, 0.25 * now.time)?;
    let gained = &now.logs - &half.logs;
    let Some(first) = widest(&gained, |k| now.gap(k) - half.gap(k)) else {
        return Some(View { at, first: [0, gained.len()], gaps: [0.0; 2], grows: false, settled: false });
    };
    let gaps = first.map(|k| now.gap(k));
    let gains = first.map(|k| now.gap(k) - half.gap(k));
    let before = first.map(|k| half.gap(k) - quarter.gap(k));
    let grows = gains.iter().all(|gain| *gain >= ENOUGH);
    let settled = grows
        && (0..2).all(|i| {
            gaps[i] >= ENOUGH
                && gains[i] >= FASTER_THAN_A_POWER * before[i]
                && 2.0 * gains[i] <= SETTLED * gaps[i]
        });
    Some(View { at, first, gaps, grows, settled })
}

/// ℓ between averaging times.
fn interpolated(growths: &[Stretches], time: f64) -> Option<Stretches> {
    // a time that differs by rounding is the same
    let after = growths.iter().position(|growth| growth.time >= time * (1.0 - 1e-12))?;
    let right = &growths[after];
    if right.time <= time * (1.0 + 1e-12) {
        return Some(right.clone());
    }
    let left = &growths[after.checked_sub(1)?];
    let part = (time - left.time) / (right.time - left.time);
    Some(Stretches { time, logs: &left.logs + (&right.logs - &left.logs) * part })
}

fn of_view(spectrum: &Spectrum, growth: &Stretches, view: &View, horizon: f64) -> Diagnosis {
    let [lower, upper] = view.first;
    let mut rates = spectrum.rates();
    rates.as_mut_slice().sort_by(f64::total_cmp);
    let gaps = view.first.map(|k| rates[k] - rates[k - 1]);
    Diagnosis {
        dims: dims_of(growth.logs.len(), view.first),
        fast_rates: [-rates[lower - 1], rates[upper]],
        balanced_rates: [-growth.logs[lower - 1], growth.logs[upper]].map(|log| log / growth.time),
        center_rate: (lower..upper).fold(0.0, |m: f64, k| m.max(rates[k].abs())),
        gaps,
        time_constants: gaps[0].min(gaps[1]) * spectrum.time,
        ..of_nothing(growth, horizon)
    }
}

/// Without a splitting, at the longest averaging time.
fn of_nothing(growth: &Stretches, horizon: f64) -> Diagnosis {
    let Stretches { time, logs } = growth;
    let gaps = match widest(logs, |k| growth.gap(k)) {
        Some(first) => first.map(|k| growth.gap(k) / time),
        None => [0.0; 2],
    };
    Diagnosis {
        verdict: Verdict::Insensitive,
        dims: SplittingDims { stable: 0, center: logs.len(), unstable: 0 },
        time: *time,
        fast_rates: [0.0; 2],
        balanced_rates: [0.0; 2],
        center_rate: logs.amax() / time,
        gaps,
        time_constants: 0.0,
        window: [*time; 2],
        horizon,
    }
}
