//! Whether markers of a planar body stay in planes: how far they leave them together.
//!
//! Across the plane of a planar body each marker stays where it is, but for a constant velocity of all. A body that tilts and twists moves
//! its markers across in proportion to their arms,
//!
//! ```text
//! y_k(t) = d_k + v s + Σ_j s^j (α_j · x_k(t) + β_j · b_k(t) + γ_j d_k) + noise,   j = 0 … 3
//! ```
//! with the arms x_k along axes of the world and b_k along those of the root, and the mean depths d_k, all of which twist. The size of the
//! noise across the plane, its correlated fraction and its time are those of the greatest restricted likelihood. F is the mean square of what these q motions
//! explain over that of the noise: about 1 where the body stays in the plane. What a tilt of 3° explains does not count.
//!
//! Source: D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320, for restricted likelihood.

use super::normal::{Linearized, Observed};
use super::score::{CHANCE, TOLERANCE};
use super::unknowns::Layout;
use crate::noise::{MarkerNoise, chi_squared_quantile, whitening};
use nalgebra::DMatrix;

/// Powers of the time that tilts and twists have.
const DEGREES: usize = 4;
/// Motions across the plane: along two axes of the world and two of the root, and of the depths but their means.
const MOTIONS: usize = 5 * DEGREES - 1;
/// The tilt that is allowed, rad.
const TILT: f64 = 0.05;
/// Correlated fractions and times of the noise, s, among which the likeliest is taken.
const FRACTIONS: [f64; 7] = [0.0, 0.4, 0.7, 0.8, 0.9, 0.95, 0.98];
const TIMES: [f64; 5] = [0.03, 0.06, 0.12, 0.25, 0.5];
/// Markers that move across the plane by less than this, m, were not measured there.
const LEAST: f64 = 1e-6;
/// What is left of a column of the Gram matrix that others make up.
const DEPENDENT: f64 = 1e-7;

/// Rows of one marker: times, and for each of its frames the common velocity, the motions and the place across the plane.
struct Depths {
    times: Vec<f64>,
    rows: Vec<[f64; COLUMNS]>,
}

/// Common velocity, motions, and what is measured.
const COLUMNS: usize = MOTIONS + 2;
const MEASURED: usize = COLUMNS - 1;

/// F of the motions across the plane, and what it must not exceed; NaN where nothing was measured across the plane.
pub(super) fn depth_departure(layout: &Layout, observed: &Observed, at: &Linearized, scale: f64) -> [f64; 2] {
    let n_markers = observed.points.first().map_or(0, Vec::len);
    let depths: Vec<Depths> =
        (0..n_markers).map(|k| depths_of(layout, observed, at, k)).filter(|d| d.rows.len() > 1).collect();
    let depths = with_means(depths);
    let n: usize = depths.iter().map(|depth| depth.rows.len()).sum();
    let over = n.saturating_sub(depths.len() + 1 + MOTIONS);
    let (plain, _) = gram(&depths, &MarkerNoise::white(1.0));
    if over < MOTIONS || plain[(MEASURED, MEASURED)] <= n as f64 * LEAST * LEAST {
        return [f64::NAN; 2];
    }
    let candidates = FRACTIONS.iter().flat_map(|fraction| {
        let times = if *fraction > 0.0 { &TIMES[..] } else { &TIMES[..1] };
        times.iter().map(|time| MarkerNoise { size: 1.0, correlated: *fraction, time: *time })
    });
    let found = candidates.map(|noise| {
        let (mut gram, log) = gram(&depths, &noise);
        let sizes = gram.diagonal();
        sweep(&mut gram, 0, sizes[0]);
        let without = gram[(MEASURED, MEASURED)];
        let pivots: Vec<f64> = (1..=MOTIONS).filter_map(|k| sweep(&mut gram, k, sizes[k])).collect();
        let rest = (gram[(MEASURED, MEASURED)] / over as f64).max(LEAST * LEAST);
        let evidence = over as f64 * rest.ln() + log + pivots.iter().map(|x| x.ln()).sum::<f64>();
        let factors = gram.view((1, MEASURED), (MOTIONS, 1)).into_owned();
        let n_motions = pivots.len();
        (evidence, noise, (without - rest * over as f64) / (n_motions as f64 * rest), n_motions, factors)
    });
    let best = found.filter(|found| found.2.is_finite()).min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, noise, ratio, n_motions, factors)) = best else { return [f64::NAN; 2] };
    // what they explain, against what a tilt would
    let of_motions = plain.view((1, 1), (MOTIONS, MOTIONS));
    let explained = factors.dot(&(of_motions * &factors));
    let arms: f64 = at.placed.iter().flat_map(|placed| &placed.arms).map(|arm| arm.norm_squared()).sum();
    let n_arms = (at.placed.len() * n_markers) as f64;
    let allowed = n as f64 * (arms / n_arms) * (TILT * scale).powi(2);
    let times = &observed.times;
    let spacing = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let repeats = 1.0 + noise.correlated.powi(2) * noise.time / spacing;
    let of_noise = 1.0 + CHANCE * (2.0 * repeats / over as f64).sqrt();
    let limit = chi_squared_quantile(n_motions.max(1), CHANCE) * of_noise + TOLERANCE;
    [ratio * (1.0 - allowed / explained).max(0.0), limit]
}

/// The rows of marker `k`; depths are their own means still.
fn depths_of(layout: &Layout, observed: &Observed, at: &Linearized, k: usize) -> Depths {
    let [normal, along] = [layout.turns[0], layout.axes[0]];
    let across = layout.axes[1];
    let times = &observed.times;
    let (first, last) = (times[0], times[times.len() - 1]);
    let mut depths = Depths { times: Vec::new(), rows: Vec::new() };
    for (i, placed) in at.placed.iter().enumerate() {
        let Some(point) = observed.points[i][k] else { continue };
        let s = 2.0 * (times[i] - first) / (last - first) - 1.0;
        let arm = &placed.arms[k];
        let of_root = placed.turn.tr_mul(arm);
        let mut row = [0.0; COLUMNS];
        (row[0], row[MEASURED]) = (s, normal.dot(&point));
        for (j, x) in [arm.dot(&along), arm.dot(&across), of_root.x, of_root.y].into_iter().enumerate() {
            for degree in 0..DEGREES {
                row[1 + DEGREES * j + degree] = x * s.powi(degree as i32);
            }
        }
        for degree in 1..DEGREES {
            row[4 * DEGREES + degree] = s.powi(degree as i32);
        }
        depths.times.push(times[i]);
        depths.rows.push(row);
    }
    depths
}

/// The same with the powers of the time multiplied by the mean depth of the marker, from that of all.
fn with_means(mut depths: Vec<Depths>) -> Vec<Depths> {
    let mean = |depth: &Depths| {
        depth.rows.iter().map(|row| row[MEASURED]).sum::<f64>() / depth.rows.len().max(1) as f64
    };
    let of_all = depths.iter().map(mean).sum::<f64>() / depths.len().max(1) as f64;
    for depth in &mut depths {
        let own = mean(depth) - of_all;
        let powers = 4 * DEGREES + 1..MEASURED;
        depth.rows.iter_mut().for_each(|row| row[powers.clone()].iter_mut().for_each(|x| *x *= own));
    }
    depths
}

/// The Gram matrix of the whitened columns without what a constant of each marker explains, and ln det of the covariance and
/// of the constants.
fn gram(depths: &[Depths], noise: &MarkerNoise) -> (DMatrix<f64>, f64) {
    let mut gram = DMatrix::zeros(COLUMNS, COLUMNS);
    let mut log = 0.0;
    for depth in depths {
        let (steps, of_steps) = whitening(noise, depth.times.iter().map(|t| (*t, 1.0)));
        let mut means = [0.0; COLUMNS + 1];
        let mut sums = [0.0; COLUMNS];
        let mut of_constant = 0.0;
        for (row, step) in depth.rows.iter().zip(&steps) {
            let mut white = [1.0; COLUMNS + 1];
            white[..COLUMNS].copy_from_slice(row);
            step.whiten(1.0, &mut means, &mut white);
            let constant = white[COLUMNS];
            of_constant += constant * constant;
            for i in 0..COLUMNS {
                sums[i] += white[i] * constant;
                for j in 0..=i {
                    gram[(i, j)] += white[i] * white[j];
                }
            }
        }
        for i in 0..COLUMNS {
            for j in 0..=i {
                gram[(i, j)] -= sums[i] * sums[j] / of_constant;
            }
        }
        log += of_steps + of_constant.ln();
    }
    gram.fill_upper_triangle_with_lower_triangle();
    (gram, log)
}

/// Sweeps column `k`: regressed on what was swept, the last column has its factors in the swept rows, and its squares in the
/// corner. The pivot; none, and the column counts no more, where the others make it up: where little is left of its `size`.
fn sweep(gram: &mut DMatrix<f64>, k: usize, size: f64) -> Option<f64> {
    let pivot = gram[(k, k)];
    if pivot <= DEPENDENT * size || pivot <= f64::MIN_POSITIVE {
        gram.row_mut(k).fill(0.0);
        gram.column_mut(k).fill(0.0);
        return None;
    }
    let row: Vec<f64> = gram.row(k).iter().map(|x| x / pivot).collect();
    let column: Vec<f64> = gram.column(k).iter().copied().collect();
    for i in 0..COLUMNS {
        for j in 0..COLUMNS {
            gram[(i, j)] -= column[i] * row[j];
        }
    }
    for i in 0..COLUMNS {
        gram[(k, i)] = row[i];
        gram[(i, k)] = -column[i] / pivot;
    }
    gram[(k, k)] = 1.0 / pivot;
    Some(pivot)
}
