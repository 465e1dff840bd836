//! What motions have in common: one heading, one basis of postures; and how far a motion is from them.
//!
//! **Heading.** Where a diver faces in the laboratory says nothing about the dive. Every motion is turned about the vertical
//! by the angle that brings it nearest to a reference, the mean of the training motions: with x + iy for the horizontal parts
//! of postures and path, frame by frame,
//!
//! ```text
//! ψ = −arg Σ conj(r) z
//! ```
//! A motion turned in the laboratory gets another ψ and the same vector. The reference begins as the first motion and is found by turning
//! all to it and taking their mean, in turn (generalised Procrustes analysis).
//!
//! **Distance.** To the nearest of the training motions, in vectors, with what the basis leaves of the postures:
//!
//! ```text
//! d² = min_j ‖v − v_j‖² + Σ_frames ‖rest‖²
//! ```
//! over the greatest distance that a motion learnt has from the others when it is left out of the basis. By exchange of the
//! motions, one like the training motions is beyond 1 with a chance of about 1/(n + 1).
//!
//! **Errors.** Each motion is predicted by a model of nine tenths of the motions, or of their groups, without it. A score's interval is as wide as these
//! errors: it holds for motions like the training motions, by the same judge, on average over them.
//!
//! Sources: J. C. Gower, *Generalized Procrustes analysis*, Psychometrika 40 (1975), 33–51; R. Laxhammar and G. Falkman,
//! *Sequential conformal anomaly detection in trajectories based on Hausdorff distance*, FUSION 2011, for the nearest neighbour
//! as a measure of what is not like the rest; R. F. Barber, E. J. Candès, A. Ramdas and R. J. Tibshirani, *Predictive inference with the
//! jackknife+*, Ann. Stat. 49 (2021), 486–507, for intervals by errors of cross-validation.

use super::options::ScoringOptions;
use super::regression::Regression;
use super::vector::Normalized;
use super::{FeatureKind, Groups, ScoringError, VectorOptions};
use crate::analysis::{AnalysisError, Pca, eigenpostures};
use nalgebra::{DMatrix, RowDVector};
use rayon::prelude::*;
use somersault_core::argument::expect_least;

/// Rounds of the search for a reference, at most. It converges in some; what is learnt depends on its end, but not on how
/// motions were turned before.
const ROUNDS: usize = 100;
/// Relative change of the reference at which its search ends.
const AT_REST: f64 = 1e-13;
/// Parts in which the motions, or their groups, are left out of a basis.
const PARTS: usize = 10;

/// Postures and path to which motions are turned.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Heading {
    pub(super) kind: FeatureKind,
    pub(super) postures: DMatrix<f64>,
    pub(super) path: DMatrix<f64>,
}

/// Horizontal parts of rows whose columns are x, y, z in turn.
fn horizontal(rows: &DMatrix<f64>) -> impl Iterator<Item = [f64; 2]> {
    let n = rows.ncols() / 3;
    (0..n).flat_map(move |k| {
        rows.column(3 * k)
            .iter()
            .zip(rows.column(3 * k + 1).iter())
            .map(|(x, y)| [*x, *y])
            .collect::<Vec<_>>()
    })
}

/// Rows turned about the vertical.
fn turn(rows: &mut DMatrix<f64>, angle: f64) {
    let (sine, cosine) = angle.sin_cos();
    for i in 0..rows.nrows() {
        for k in (0..rows.ncols()).step_by(3) {
            let (x, y) = (rows[(i, k)], rows[(i, k + 1)]);
            (rows[(i, k)], rows[(i, k + 1)]) = (cosine * x - sine * y, sine * x + cosine * y);
        }
    }
}

impl Heading {
    /// That of motions; there is at least one.
    fn of(kind: FeatureKind, motions: &[&Normalized]) -> Self {
        let mut found = Self { kind, postures: motions[0].postures.clone(), path: motions[0].path.clone() };
        for _ in 0..ROUNDS {
            let turned: Vec<Normalized> = motions.iter().map(|motion| found.turned(motion)).collect();
            let mean = |of: fn(&Normalized) -> &DMatrix<f64>| {
                let sum = turned.iter().skip(1).fold(of(&turned[0]).clone(), |sum, motion| sum + of(motion));
                sum / turned.len() as f64
            };
            let (postures, path) = (mean(|m| &m.postures), mean(|m| &m.path));
            let change = (&postures - &found.postures).amax().max((&path - &found.path).amax());
            let size = postures.amax().max(path.amax());
            (found.postures, found.path) = (postures, path);
            if change <= AT_REST * size {
                break;
            }
        }
        found
    }

    /// The motion in this heading.
    pub(super) fn turned(&self, motion: &Normalized) -> Normalized {
        let places = match self.kind {
            FeatureKind::Markers => Some((&self.postures, &motion.postures)),
            FeatureKind::Coordinates => None,
        };
        let (mut sums, mut squares) = ([0.0; 2], [0.0; 2]);
        for (reference, own) in places.into_iter().chain([(&self.path, &motion.path)]) {
            for ([a, b], [x, y]) in horizontal(reference).zip(horizontal(own)) {
                sums = [sums[0] + a * x + b * y, sums[1] + a * y - b * x];
                squares = [squares[0] + a * a + b * b, squares[1] + x * x + y * y];
            }
        }
        let mut turned = motion.clone();
        // what has no horizontal part has no heading
        if sums[0].hypot(sums[1]) > f64::EPSILON * (squares[0] * squares[1]).sqrt() {
            let angle = -sums[1].atan2(sums[0]);
            turn(&mut turned.path, angle);
            if self.kind == FeatureKind::Markers {
                turn(&mut turned.postures, angle);
            }
        }
        turned
    }
}

/// What describes a motion by a vector.
pub(super) struct Basis {
    pub(super) heading: Heading,
    pub(super) eigenpostures: Pca,
}

/// Vectors of motions, a row each, and the squares of what the basis leaves of their postures.
pub(super) struct Described {
    pub(super) vectors: DMatrix<f64>,
    pub(super) rests: Vec<f64>,
}

impl Basis {
    /// Of the motions that are not `left_out`.
    pub(super) fn of(
        kind: FeatureKind,
        motions: &[Normalized],
        options: &VectorOptions,
        left_out: impl Fn(usize) -> bool,
    ) -> Result<Self, ScoringError> {
        let learnt: Vec<&Normalized> =
            motions.iter().enumerate().filter(|(i, _)| !left_out(*i)).map(|(_, motion)| motion).collect();
        expect_least("motions", learnt.len(), 1)?;
        let heading = Heading::of(kind, &learnt);
        let postures: Vec<DMatrix<f64>> =
            learnt.iter().map(|motion| heading.turned(motion).postures).collect();
        let rows: usize = postures.iter().map(DMatrix::nrows).sum();
        let most = postures[0].ncols().min(rows.saturating_sub(1));
        if options.n_eigenweights > most {
            let (argument, found) = ("n_eigenweights", options.n_eigenweights);
            return Err(ScoringError::TooMany { argument, most, found });
        }
        let eigenpostures = eigenpostures::common(&postures, options.n_eigenweights)?;
        Ok(Self { heading, eigenpostures })
    }

    pub(super) fn describe(
        &self,
        options: &VectorOptions,
        motions: &[Normalized],
    ) -> Result<Described, ScoringError> {
        let (mut rows, mut rests) = (Vec::with_capacity(motions.len()), Vec::with_capacity(motions.len()));
        for motion in motions {
            let (vector, rest) = options.vector(&self.eigenpostures, &self.heading.turned(motion))?;
            rows.push(vector);
            rests.push(rest);
        }
        Ok(Described { vectors: DMatrix::from_rows(&rows), rests })
    }
}

/// Distance of a motion to the nearest of `vectors` that counts.
pub(super) fn distance(
    vector: &RowDVector<f64>,
    rest: f64,
    vectors: &DMatrix<f64>,
    counts: impl Fn(usize) -> bool,
) -> f64 {
    let squares = vectors
        .row_iter()
        .enumerate()
        .filter(|(j, _)| counts(*j))
        .map(|(_, row)| (vector - row).norm_squared());
    (squares.fold(f64::INFINITY, f64::min) + rest).sqrt()
}

impl Described {
    /// Distance of one of the motions to the others.
    pub(super) fn distance_of(&self, i: usize, counts: impl Fn(usize) -> bool) -> f64 {
        distance(&self.vectors.row(i).into_owned(), self.rests[i], &self.vectors, |j| j != i && counts(j))
    }
}

/// How far each motion is from models that have not seen it, nor a tenth of the motions.
pub(super) struct Unseen {
    /// The distance of each motion to the others, in bases without it.
    pub(super) distances: Vec<f64>,
    /// The score of each motion less its prediction.
    pub(super) errors: Vec<f64>,
}

impl Unseen {
    pub(super) fn of(
        kind: FeatureKind,
        motions: &[Normalized],
        scores: &[f64],
        groups: &Groups,
        options: &ScoringOptions,
    ) -> Result<Self, ScoringError> {
        let parts = groups.n_groups().min(PARTS);
        let of_part = |part: usize| -> Result<Vec<(usize, [f64; 2])>, ScoringError> {
            let left_out = |i: usize| groups.of(i) % parts == part;
            let basis = Basis::of(kind, motions, &options.vector, left_out)?;
            let described = basis.describe(&options.vector, motions)?;
            let (own, others): (Vec<usize>, Vec<usize>) = (0..motions.len()).partition(|i| left_out(*i));
            let of_others: Vec<f64> = others.iter().map(|i| scores[*i]).collect();
            let vectors = &described.vectors;
            let predictions = match Regression::of(&vectors.select_rows(&others), &of_others, options) {
                Ok(regression) => regression.predict(&vectors.select_rows(&own))?,
                // where the others are all alike
                Err(AnalysisError::NoVariance) => {
                    vec![of_others.iter().sum::<f64>() / of_others.len() as f64; own.len()]
                }
                Err(error) => return Err(error.into()),
            };
            let of = |(i, prediction): (usize, f64)| {
                (i, [described.distance_of(i, |j| !left_out(j)), scores[i] - prediction])
            };
            Ok(own.into_iter().zip(predictions).map(of).collect())
        };
        let found: Vec<Vec<_>> = (0..parts).into_par_iter().map(of_part).collect::<Result<_, _>>()?;
        let (mut distances, mut errors) = (vec![0.0; motions.len()], vec![0.0; motions.len()]);
        for (i, [distance, error]) in found.into_iter().flatten() {
            (distances[i], errors[i]) = (distance, error);
        }
        Ok(Self { distances, errors })
    }
}

/// The least width w for which a motion like the training motions has its score within prediction ± w with a probability of `level`: the
/// ⌈level (n + 1)⌉-th smallest of n errors of motions that models had not seen; infinite where n is too small for the level.
pub(super) fn half_width(errors: &[f64], level: f64) -> f64 {
    let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let rank = (level * (sizes.len() + 1) as f64).ceil() as usize;
    sizes.get(rank.saturating_sub(1)).copied().unwrap_or(f64::INFINITY)
}

/// What distances are checked against: the greatest of them, where they are not all zero.
pub(super) fn greatest(distances: &[f64]) -> f64 {
    distances.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
}

/// Sizes by which motions may differ from the training motions; the next unit is farther.
const SIZES: f64 = 2.0;

/// Root mean square distance of markers from their centre, m; none of coordinates.
pub(super) fn size(kind: FeatureKind, motion: &Normalized) -> Option<f64> {
    let n = motion.postures.len() as f64 / 3.0;
    (kind == FeatureKind::Markers).then(|| (motion.postures.norm_squared() / n).sqrt())
}

/// Fails where the markers of a motion are much farther from or nearer to each other than in the training motions.
pub(super) fn expect_size(
    kind: FeatureKind,
    motion: &Normalized,
    number: Option<usize>,
    [least, greatest]: [f64; 2],
) -> Result<(), ScoringError> {
    match size(kind, motion) {
        Some(found) if !(found >= least / SIZES && found <= greatest * SIZES) => {
            Err(ScoringError::Size { motion: number, found, least, greatest })
        }
        _ => Ok(()),
    }
}

/// The least and the greatest size of motions, all of which are near the median.
pub(super) fn sizes(kind: FeatureKind, motions: &[Normalized]) -> Result<[f64; 2], ScoringError> {
    let mut sizes: Vec<f64> = motions.iter().filter_map(|motion| size(kind, motion)).collect();
    if sizes.is_empty() {
        return Ok([0.0; 2]);
    }
    sizes.sort_by(f64::total_cmp);
    let median = sizes[sizes.len() / 2];
    for (i, motion) in motions.iter().enumerate() {
        expect_size(kind, motion, Some(i), [median, median])?;
    }
    Ok([sizes[0], sizes[sizes.len() - 1]])
}
