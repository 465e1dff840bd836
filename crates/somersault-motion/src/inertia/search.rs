//! Fits of the motion of a free body from several starts.

use super::descent::{Until, descend};
use super::distribution::{chi_squared_tail, normal_tail};
use super::problem::{Motion, OF_INERTIA, Record, Squares, UNKNOWNS, Unknowns, numbers_of};
use super::triangle::{Triangle, singular};
use super::{InertiaEstimateError, significant};
use crate::noise::standard_normal;
use nalgebra::{DVector, Matrix3, SymmetricEigen, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3;

/// Half widths of the windows, in attitudes, by whose local rates fits begin; the turn that a window may reach, rad; the attitudes that it
/// needs; and the number of windows, at most.
const WINDOWS: [usize; 5] = [2, 4, 8, 16, 32];
const REACH: f64 = 2.0;
const LEAST_IN_WINDOW: usize = 5;
const MOST_WINDOWS: usize = 200;
/// Coefficients of a cubic.
const CUBIC: usize = 4;
/// The turn of the first horizon of a fit, rad, and the factor by which horizons grow.
const FIRST: f64 = 3.0;
const GROWTH: f64 = 1.8;
/// Starts of the inertia at random and the size of its numbers, after those by local rates; and once a fit leaves independent noise alone, starts
/// in search of another inertia that fits as well: so far from it, and as many of the size of those at random.
const RANDOM: (usize, f64) = (6, 0.6);
const RIVALS: (usize, f64) = (3, 0.2);
const ELSEWHERE: usize = 4;
/// Noise below this is that of rounding, rad.
pub(super) const ROUNDING: f64 = 1e-9;
/// What ties the logarithms of second moments to zero, in standard deviations of an attitude: those of rods and plates would grow without
/// end.
pub(super) const PRIOR: f64 = 0.3;
/// Level of the tests of what does not fit.
const MISFIT: f64 = 1e-6;
/// Size of residuals that are as large as if the attitudes were any, rad.
const ANY: f64 = 0.5;
/// Least second moment of mass to start from, as a fraction of their sum.
const LEAST_SECOND: f64 = 0.02;
/// When the search within a horizon ends, and that over the whole record.
const COARSE: Until = Until { fraction: 1e-6, evaluations: 12 };
pub(super) const PRECISE: Until = Until { fraction: 1e-12, evaluations: 50 };

/// A minimum over the whole record.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) x: Unknowns,
    pub(super) base: UnitQuaternion<f64>,
    pub(super) residuals: Vec<Vector3<f64>>,
    /// The sum of their squares.
    pub(super) square: f64,
    /// Whether the search came to its end, or only rounding is left.
    pub(super) is_minimum: bool,
}

impl Fit {
    /// Root mean square of the components of the residuals.
    fn size(&self) -> f64 {
        (self.square / (3 * self.residuals.len()) as f64).sqrt()
    }

    /// Components beyond unknowns.
    pub(super) fn freedom(&self) -> f64 {
        (3 * self.residuals.len()).saturating_sub(UNKNOWNS).max(1) as f64
    }

    /// Why the residuals are not independent noise, if they are not.
    pub(super) fn misfit(&self, noise: Option<f64>) -> Option<String> {
        let (size, freedom) = (self.size(), self.freedom());
        if size < ROUNDING {
            return None;
        }
        if let Some(noise) = noise
            && chi_squared_tail(self.square / (noise * noise), freedom) < MISFIT
        {
            let found = significant((self.square / freedom).sqrt(), 2);
            return Some(format!("residuals of {found} rad are not noise of {noise} rad"));
        }
        let products: f64 = self.residuals.windows(2).map(|pair| pair[0].dot(&pair[1])).sum();
        let correlation = products / self.square;
        if normal_tail(correlation * ((3 * self.residuals.len() - 3) as f64).sqrt()) < MISFIT {
            return Some(format!(
                "neighbouring residuals are correlated by {correlation:.2}: they are not independent noise"
            ));
        }
        (size > ANY).then(|| {
            format!("residuals of {} rad are as large as if the attitudes were any", significant(size, 2))
        })
    }
}

/// Angular velocities by local cubics.
#[derive(Default)]
struct Rates {
    /// Attitudes by number, and the angular velocities there, body frame.
    rates: Vec<(usize, Vector3<f64>)>,
    /// The noise that the cubics leave, rad.
    noise: f64,
}

/// The rates of windows of attitudes, `width` on either side.
fn local_rates(record: &Record<'_>, width: usize) -> Rates {
    let (n, mut found) = (record.times.len(), Rates::default());
    let (mut square, mut free) = (0.0, 0);
    let count = n.min(MOST_WINDOWS);
    let mut window = Vec::with_capacity(2 * width + 1);
    for i in 0..count {
        let k = ((i * (n - 1)) as f64 / (count - 1) as f64).round() as usize;
        let from_centre = |j: usize| {
            let turn = so3::log(&(record.seen[k].inverse() * record.seen[j]));
            (record.times[j] - record.times[k], turn)
        };
        window.clear();
        let around = k.saturating_sub(width)..n.min(k + width + 1);
        window.extend(around.map(from_centre).filter(|(_, turn)| turn.norm() < REACH));
        if window.len() < LEAST_IN_WINDOW {
            continue;
        }
        let longest = window.iter().map(|(s, _)| s.abs()).fold(0.0, f64::max);
        let mut triangle = Triangle::new(CUBIC + 3, window.len());
        for (s, turn) in &window {
            let s = s / longest;
            triangle.push([1.0, s, s * s, s * s * s].into_iter().chain(turn.iter().copied()));
        }
        let r = triangle.finish();
        let powers = r.view((0, 0), (CUBIC, CUBIC));
        let Some(terms) = powers.solve_upper_triangular(&r.view((0, CUBIC), (CUBIC, 3))) else { continue };
        let rate = terms.row(1).transpose() / longest;
        if !rate.iter().all(|x| x.is_finite()) {
            continue;
        }
        found.rates.push((k, Vector3::new(rate[0], rate[1], rate[2])));
        square += r.view((CUBIC, CUBIC), (3, 3)).norm_squared();
        free += 3 * (window.len() - CUBIC);
    }
    found.noise = if free > 0 { (square / free as f64).sqrt() } else { f64::NAN };
    found
}

/// Second moments of mass by R I ω = L and ω · I ω = 2T, homogeneous in I, L and T.
fn linear_inertia(record: &Record<'_>, rates: &[(usize, Vector3<f64>)]) -> Option<Matrix3<f64>> {
    /// Six of the inertia, three of the momentum, one of the energy.
    const COLUMNS: usize = 10;
    if rates.len() < 4 {
        return None;
    }
    let mean: f64 = rates.iter().map(|(_, rate)| rate.norm_squared()).sum::<f64>() / rates.len() as f64;
    let size = mean.sqrt();
    if size == 0.0 {
        return None;
    }
    let mut triangle = Triangle::new(COLUMNS, 4 * rates.len());
    for (k, rate) in rates {
        let [p, q, r] = (rate / size).into();
        // I ω of the inertias 11, 22, 33, 12, 13 and 23
        let in_body = [[p, 0.0, 0.0], [0.0, q, 0.0], [0.0, 0.0, r], [q, p, 0.0], [r, 0.0, p], [0.0, r, q]];
        let in_world = in_body.map(|vector| record.seen[*k] * Vector3::from(vector));
        for i in 0..3 {
            let momentum = (0..3).map(|j| if i == j { -1.0 } else { 0.0 });
            triangle.push(in_world.iter().map(|vector| vector[i]).chain(momentum).chain([0.0]));
        }
        let energy = [p * p, q * q, r * r, 2.0 * p * q, 2.0 * p * r, 2.0 * q * r];
        triangle.push(energy.into_iter().chain([0.0, 0.0, 0.0, -1.0]));
    }
    let (_, vectors, _) = singular(triangle.finish(), &DVector::zeros(COLUMNS))?;
    let v = vectors.row(COLUMNS - 1);
    let tensor = Matrix3::new(v[0], v[3], v[4], v[3], v[1], v[5], v[4], v[5], v[2]);
    let trace = tensor.trace();
    if trace.abs() < 1e-9 {
        return None;
    }
    let eigen = SymmetricEigen::new(Matrix3::from_diagonal_element(0.5) - tensor / trace);
    let second = eigen.eigenvalues.map(|value| value.max(LEAST_SECOND));
    let axes = eigen.eigenvectors;
    Some(axes * Matrix3::from_diagonal(&(second / second.sum())) * axes.transpose())
}

/// Fits from several starts, the best first; few more once one leaves noise alone. `turns` are those between attitudes.
pub(super) fn fits(
    record: &Record<'_>,
    turns: &[f64],
    noise: Option<f64>,
    token: &CancellationToken,
) -> Result<Vec<Fit>, InertiaEstimateError> {
    let mut starts: Vec<([f64; OF_INERTIA], Vector3<f64>)> = Vec::new();
    let (mut rough, mut spin) = (f64::NAN, None);
    for width in WINDOWS {
        let Rates { rates, noise: local } = local_rates(record, width);
        let nearest = rates.iter().min_by_key(|(k, _)| k.abs_diff(record.middle));
        let Some((_, rate)) = nearest else { continue };
        if spin.is_none() {
            rough = local;
        }
        spin = Some(*rate);
        if let Some(second) = linear_inertia(record, &rates) {
            starts.push((numbers_of(&second), *rate));
        }
        if width >= record.times.len() {
            break;
        }
    }
    let spin = spin.unwrap_or_else(|| {
        let [here, next] = [record.middle, record.middle + 1].map(|k| record.seen[k]);
        so3::log(&(here.inverse() * next)) / (record.times[record.middle + 1] - record.times[record.middle])
    });
    let sigma = noise.unwrap_or_else(|| rough.max(ROUNDING));
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut draw = |size: f64| std::array::from_fn(|_| size * standard_normal(&mut random));
    starts.push(([0.0; OF_INERTIA], spin));
    let (count, size) = RANDOM;
    starts.extend((0..count).map(|_| (draw(size), spin)));
    let search = Search { record, turned: turned(turns, record.middle), sigma, token };
    let mut found: Vec<Fit> = Vec::new();
    for (inertia, rate) in starts {
        let Some(fit) = search.grown(inertia, rate)? else { continue };
        let explained = fit.misfit(noise).is_none();
        let x = fit.x;
        found.push(fit);
        if explained {
            // where several inertias fit, a start elsewhere ends elsewhere
            for k in 0..RIVALS.0 + ELSEWHERE {
                let near = k < RIVALS.0;
                let off: [f64; OF_INERTIA] = draw(if near { RIVALS.1 } else { RANDOM.1 });
                let start = std::array::from_fn(|i| if near { x[i] + off[i] } else { off[i] });
                found.extend(search.grown(start, Vector3::new(x[8], x[9], x[10]))?);
            }
            break;
        }
    }
    found.sort_by(|a, b| a.square.total_cmp(&b.square));
    Ok(found)
}

/// The turns from the attitude in the middle, along the record.
fn turned(turns: &[f64], middle: usize) -> Vec<f64> {
    let mut sum = 0.0;
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(turns.iter().map(|turn| {
            sum += turn;
            sum
        }))
        .collect();
    sums.iter().map(|x| (x - sums[middle]).abs()).collect()
}

/// What fits have in common.
struct Search<'a> {
    record: &'a Record<'a>,
    turned: Vec<f64>,
    /// Standard deviation of an attitude that is expected, rad.
    sigma: f64,
    token: &'a CancellationToken,
}

impl Search<'_> {
    /// A fit over horizons that grow from the middle; the inertia is tied to its start until the last.
    fn grown(
        &self,
        start: [f64; OF_INERTIA],
        rate: Vector3<f64>,
    ) -> Result<Option<Fit>, InertiaEstimateError> {
        let (record, n) = (self.record, self.record.times.len());
        let (mut base, mut sigma, mut reach) = (record.seen[record.middle], self.sigma, FIRST);
        let mut x = Unknowns::zeros();
        x.iter_mut().zip(start).for_each(|(x, start)| *x = start);
        x.fixed_rows_mut::<3>(8).copy_from(&rate);
        loop {
            let within = |turned: &&f64| **turned <= reach;
            // turns grow to both sides of the attitude in the middle
            let (before, from_middle) = self.turned.split_at(record.middle);
            let first = record.middle - before.iter().rev().take_while(within).count();
            let part = first..record.middle + from_middle.iter().take_while(within).count();
            if part.len() < super::LEAST_ATTITUDES {
                reach *= GROWTH;
                continue;
            }
            let whole = part.len() == n;
            let (ties, until) =
                if whole { ((PRIOR * sigma, [0.0; OF_INERTIA]), PRECISE) } else { ((sigma, start), COARSE) };
            let motion = |x: &[f64]| Motion::tumbling(x, &base);
            let squares =
                Squares { record, part, motion: &motion, ties: Some(ties), held: None, token: self.token };
            let found = descend(&squares, DVector::from_column_slice(x.as_slice()), until)?;
            let Some(found) = found else { return Ok(None) };
            let residuals = whole.then(|| squares.residuals(&found.x)).transpose()?;
            x.copy_from_slice(found.x.as_slice());
            // keep the rotation vector small, where it is a chart
            base *= so3::exp(&x.fixed_rows::<3>(5).into_owned());
            x.fixed_rows_mut::<3>(5).fill(0.0);
            let Some(residuals) = residuals else {
                reach *= GROWTH;
                continue;
            };
            let square = residuals.iter().map(Vector3::norm_squared).sum();
            let mut fit = Fit { x, base, residuals, square, is_minimum: found.is_minimum };
            let size = fit.size();
            fit.is_minimum |= size < ROUNDING;
            if size > 0.5 * sigma || size < ROUNDING {
                return Ok(Some(fit));
            }
            // ties are those of the noise that there is; once more with less
            sigma = (0.5 * size).max(0.1 * ROUNDING);
        }
    }
}
