//! Tails of distributions, and the quantile that intervals take.

use somersault_core::roots::bracket;
use special::{Beta, Gamma};
use std::convert::Infallible;
use std::f64::consts::FRAC_1_SQRT_2;

/// The probability that χ² with `n` degrees of freedom exceeds `x`.
pub(super) fn chi_squared_tail(x: f64, n: f64) -> f64 {
    1.0 - (0.5 * x.max(0.0)).inc_gamma(0.5 * n)
}

/// The probability that the ratio of mean squares of `m` and `n` normal numbers exceeds `x`.
pub(super) fn f_tail(x: f64, m: f64, n: f64) -> f64 {
    beta_tail(m * x.max(0.0), m, n)
}

/// The probability that a normal number exceeds `z` standard deviations.
pub(super) fn normal_tail(z: f64) -> f64 {
    0.5 * libm::erfc(z * FRAC_1_SQRT_2)
}

/// The probability that a number of Student's distribution exceeds `t` on either side.
fn student_tails(t: f64, n: f64) -> f64 {
    beta_tail(t * t, 1.0, n)
}

/// I_y(n/2, m/2) at y = n/(n + x).
fn beta_tail(x: f64, m: f64, n: f64) -> f64 {
    let [p, q] = [0.5 * n, 0.5 * m];
    (n / (n + x)).inc_beta(p, q, p.ln_beta(q))
}

/// The number of standard deviations within which an error is with the probability `level`, between 0 and 1: by Student's distribution
/// with `n` degrees of freedom where the standard deviation was estimated, else by the normal one.
pub(super) fn two_sided_quantile(level: f64, n: Option<f64>) -> f64 {
    let beyond = |t: f64| n.map_or_else(|| 2.0 * normal_tail(t), |n| student_tails(t, n)) - (1.0 - level);
    let mut far = 1.0;
    while beyond(far) > 0.0 && far < 1e150 {
        far *= 2.0;
    }
    let value = |t: f64| Ok::<_, Infallible>(beyond(t));
    let Ok((low, high)) = bracket(value, (0.0, level), (far, beyond(far)), 0.5 * far, 1e-14 * far);
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_and_quantiles_are_those_of_scipy() {
        // scipy.stats 1.16: chi2.sf, f.sf, norm.sf, and ppf(0.5 + level/2) of t and norm
        let close = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-8, "{found} instead of {expected}");
        };
        close(chi_squared_tail(30.0, 5.0), 1.474_858_103_844_307_3e-5);
        close(chi_squared_tail(697.535_708_409_721_1, 589.0), 0.001_324_796_777_452_821_1);
        close(f_tail(4.0, 5.0, 589.0), 0.001_411_600_920_316_439_6);
        close(f_tail(8.0, 5.0, 7.0), 0.008_228_919_451_292_05);
        close(normal_tail(4.753_424_308_822_899), 1e-6);
        close(two_sided_quantile(0.95, Some(7.0)), 2.364_624_251_592_784);
        close(two_sided_quantile(0.95, Some(30000.0)), 1.960_043_063_383_934_7);
        close(two_sided_quantile(0.5, Some(589.0)), 0.674_906_507_188_372_8);
        close(two_sided_quantile(0.95, None), 1.959_963_984_540_054);
    }
}
