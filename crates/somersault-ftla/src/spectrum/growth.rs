//! The law by which perturbations grow: like an exponential, like a power of time, or not.
//!
//! With ℓ(t) the logarithm of a stretch, growth by a rate has ℓ = λt + O(1), and growth by a power ℓ = m ln t + O(1), whose exponents
//! ℓ/t fall like ln t/t to zero without ever settling. In a chaotic motion both have fluctuations. The last three quarters of
//! the time, [T/4, T], are looked at:
//!
//! 1. The rates over sixteen parts of it have a mean, the rate, a straight line through them, the trend, and what is left. The
//!    standard error of the rate is that of what is left, enlarged where neighbours are alike.
//! 2. A power fits where m ln t leaves less than a quarter of the variance that λt leaves and than a fiftieth of that of ℓ.
//! 3. Growth by a rate has no trend beyond its errors, and acts for three time constants at least.

/// Parts of the time whose rates are compared.
const PARTS: usize = 16;

/// Errors beyond which a number is not zero: for a trend, of 14 degrees of freedom, once in a thousand times by chance.
const SIGNIFICANT: f64 = 4.0;

/// The part of the rate that a trend may change it by.
const STEADY: f64 = 0.02;

/// Time constants that a rate must act for.
const ENOUGH: f64 = 3.0;

/// A growth of a tenth is none.
const NOTHING: f64 = 0.1;

/// The least power of time that counts as one.
const LEAST_POWER: f64 = 0.2;

/// How perturbations in a direction grow or decay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// By a rate that has settled.
    Exponential,
    /// Like a power of time: the exponent falls like ln T/T, its limit is zero.
    Power,
    /// Neither: the exponent is zero within its error.
    Neutral,
    /// The time does not tell.
    Unknown(Unsettled),
}

/// Why a time does not tell by which law perturbations grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unsettled {
    /// There are fewer than sixteen times in its last three quarters.
    FewTimes,
    /// The rate changes from the beginning to the end.
    Trend,
    /// The rate has acted for less than three time constants.
    Slow,
    /// A stretch is zero or infinite.
    NoValue,
}

/// How a stretch grows with time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    /// The law.
    pub law: Law,
    /// Mean rate over the last three quarters of the time, 1/s.
    pub rate: f64,
    /// Standard error of the rate, 1/s; where the law is not exponential, how far the rate may be from its limit as well.
    pub error: f64,
    /// m of the power tᵐ that fits best there.
    pub power: f64,
}

impl Growth {
    /// From ℓ at ascending times since the start of the growth.
    pub fn of(times: &[f64], logs: &[f64]) -> Self {
        let unknown =
            |why| Self { law: Law::Unknown(why), rate: f64::NAN, error: f64::INFINITY, power: f64::NAN };
        let Some((&end, &last)) = times.last().zip(logs.last()) else { return unknown(Unsettled::FewTimes) };
        let window = 0.25 * end..=end * (1.0 + 1e-12);
        if times.iter().filter(|t| window.contains(t)).count() < PARTS {
            let rate = if end > 0.0 { last / end } else { f64::NAN };
            return Self { rate, ..unknown(Unsettled::FewTimes) };
        }
        if logs.iter().any(|log| !log.is_finite()) {
            return unknown(Unsettled::NoValue);
        }
        let start = 0.25 * end;
        let part = (end - start) / PARTS as f64;
        let at: Vec<f64> = (0..=PARTS).map(|k| start + part * k as f64).collect();
        let values: Vec<f64> = at.iter().map(|&t| interpolated(times, logs, t)).collect();
        let rates: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]) / part).collect();
        let middles: Vec<f64> = at.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        let of_rates = Line::through(&middles, &rates);
        let of_time = Line::through(&at, &values);
        let of_log = Line::through(&at.iter().map(|t| t.ln()).collect::<Vec<_>>(), &values);
        let rate = of_rates.mean;
        let standard = of_rates.standard_error();
        let gain = rate * (end - start);
        // over the whole time that is looked at
        let trend = of_rates.slope * (end - start);
        let trend_error = standard * 12f64.sqrt();
        let power = of_log.slope;
        let is_power = power.abs() >= LEAST_POWER
            && of_log.left < 0.25 * of_time.left
            && of_log.left < 0.02 * of_log.variance;
        let trends = trend.abs() > SIGNIFICANT * trend_error && trend.abs() > STEADY * rate.abs();
        let floor = NOTHING / (end - start);
        let (law, error) = if is_power {
            (Law::Power, standard.max(rate.abs()))
        } else if gain.abs() <= NOTHING && trend.abs() * (end - start) <= NOTHING {
            (Law::Neutral, standard.max(rate.abs()).max(floor))
        } else if trends {
            (Law::Unknown(Unsettled::Trend), standard.max(trend.abs()))
        } else if rate.abs() <= SIGNIFICANT * standard {
            (Law::Neutral, standard.max(rate.abs()))
        } else if gain.abs() < ENOUGH {
            (Law::Unknown(Unsettled::Slow), standard.max(rate.abs()))
        } else {
            (Law::Exponential, standard)
        };
        Self { law, rate, error, power }
    }
}

/// ℓ between times, the ends included.
fn interpolated(times: &[f64], logs: &[f64], t: f64) -> f64 {
    let after = times.partition_point(|time| *time < t).clamp(1, times.len() - 1);
    let (left, right) = (times[after - 1], times[after]);
    logs[after - 1] + (logs[after] - logs[after - 1]) * (t - left) / (right - left)
}

/// The straight line that fits best.
struct Line {
    mean: f64,
    slope: f64,
    /// Mean square of the values about their mean, and about the line.
    variance: f64,
    left: f64,
    /// Correlation of neighbours in what is left.
    alike: f64,
    count: f64,
}

impl Line {
    fn through(x: &[f64], y: &[f64]) -> Self {
        let count = x.len() as f64;
        let [x_mean, mean] = [x, y].map(|values| values.iter().sum::<f64>() / count);
        let pairs = || x.iter().zip(y).map(|(x, y)| (x - x_mean, y - mean));
        let square: f64 = pairs().map(|(x, _)| x * x).sum();
        let slope = pairs().map(|(x, y)| x * y).sum::<f64>() / square;
        let rest: Vec<f64> = pairs().map(|(x, y)| y - slope * x).collect();
        let variance = pairs().map(|(_, y)| y * y).sum::<f64>() / count;
        let sum: f64 = rest.iter().map(|r| r * r).sum();
        let neighbours: f64 = rest.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let alike = if sum > 0.0 { (neighbours / sum).clamp(0.0, 0.9) } else { 0.0 };
        Self { mean, slope, variance, left: sum / count, alike, count }
    }

    /// Of the mean.
    fn standard_error(&self) -> f64 {
        let enlarged = (1.0 + self.alike) / (1.0 - self.alike);
        (self.left / (self.count - 2.0) * enlarged).sqrt()
    }
}
