//! Linear regression of scores on motions' vectors, of motions that may count more than once.
//!
//! In the principal axes of the vectors, where their scatter is Λ, motions have weights w_i = Vᵀ(x_i − x̄), counts c_i and scores y_i, with
//! g = Σ c_i w_i (y_i − ȳ). All three methods give a score ȳ + bᵀ w:
//!
//! ```text
//! principal components  b_k = g_k / λ_k for the first K axes, else 0
//! ridge                 b = (Λ + γ tr Λ)⁻¹ g
//! partial least squares b = argmin ½ bᵀΛb − gᵀb over span{g, Λg, …, Λ^{K−1} g}, by conjugate gradients
//! ```
//! K or γ is chosen by leaving each motion out in turn: for ridge and components by its leverage h, e/(1 − c h), which is exact for a γ
//! and holds for the components of all; partial least squares are fitted again without it.
//!
//! Without a motion that has weights z and counts c of N, the scatter is a dyad less, and so are the other moments:
//!
//! ```text
//! Λ − ρ z zᵀ,   g − ρ z (y − ȳ),   x̄ − z c/(N − c),   ρ = c N/(N − c)
//! ```
//! A model without the motion then costs O(n r) in r axes, in place of O(n³).
//!
//! Sources: A. E. Hoerl and R. W. Kennard, *Ridge regression*, Technometrics 12 (1970), 55–67; I. S. Helland, *On the structure of partial
//! least squares regression*, Commun. Stat. Simul. Comput. 17 (1988), 581–607, for the Krylov space; R. D. Cook, *Detection of influential
//! observation in linear regression*, Technometrics 19 (1977), 15–18, for leverages.

use super::downdate;
use super::options::{RegressionMethod, ScoringOptions, Tuning};
use crate::analysis::{AnalysisError, Pca};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::borrow::Cow;

/// Fraction of the variance below which an axis says nothing: what rounding leaves of it.
const NOTHING: f64 = 1e-13;
/// Fraction of g below which partial least squares have explained what the vectors can.
const EXPLAINED: f64 = 1e-10;
/// Penalties among which cross-validation chooses: from 10⁻⁴ to 10 in half decades.
const PENALTIES: std::ops::RangeInclusive<i32> = -8..=2;

/// Motions in the principal axes of their vectors.
#[derive(Clone)]
pub(super) struct Sample {
    /// Which they are.
    members: Vec<usize>,
    /// Λ, falling and positive.
    squares: Vec<f64>,
    /// A column for each motion, a row for each axis.
    weights: DMatrix<f64>,
    counts: Vec<f64>,
    /// The trace of the scatter in all axes, those that are left out too.
    trace: f64,
}

impl Sample {
    /// Of motions' vectors in their components, each counted once.
    fn of(eigenmotions: &Pca, vectors: &DMatrix<f64>) -> Result<Self, AnalysisError> {
        let n = vectors.nrows();
        let trace = eigenmotions.total_variance() * (n - 1) as f64;
        let weights = eigenmotions.scores(vectors)?.transpose();
        let squares: Vec<f64> = weights.row_iter().map(|row| row.norm_squared()).collect();
        let kept = squares.iter().take_while(|square| **square > NOTHING * trace).count();
        Ok(Self {
            members: (0..n).collect(),
            squares: squares[..kept].to_vec(),
            weights: weights.rows(0, kept).into_owned(),
            counts: vec![1.0; n],
            trace,
        })
    }

    /// Of the motions that count, from the products of all motions' vectors with each other, in the first `most` axes; and the weights of
    /// the motions `others`, a column each.
    pub(super) fn of_gram(
        gram: &DMatrix<f64>,
        counts: &[f64],
        most: usize,
        others: &[usize],
    ) -> (Self, DMatrix<f64>) {
        let members: Vec<usize> = (0..counts.len()).filter(|&i| counts[i] > 0.0).collect();
        let counts: Vec<f64> = members.iter().map(|&i| counts[i]).collect();
        let n: f64 = counts.iter().sum();
        let mean_of = |i: usize| members.iter().zip(&counts).map(|(&j, c)| c * gram[(i, j)]).sum::<f64>() / n;
        let means: Vec<f64> = members.iter().map(|&i| mean_of(i)).collect();
        let mean = means.iter().zip(&counts).map(|(m, c)| c * m).sum::<f64>() / n;
        let roots: Vec<f64> = counts.iter().map(|c| c.sqrt()).collect();
        let centred = DMatrix::from_fn(members.len(), members.len(), |a, b| {
            (gram[(members[a], members[b])] - means[a] - means[b] + mean) * roots[a] * roots[b]
        });
        let trace = centred.trace();
        let eigen = SymmetricEigen::new(centred);
        let mut order = downdate::falling(&eigen.eigenvalues, most);
        order.retain(|&l| eigen.eigenvalues[l] > NOTHING * trace);
        let squares: Vec<f64> = order.iter().map(|&l| eigen.eigenvalues[l]).collect();
        let weights = DMatrix::from_fn(order.len(), members.len(), |l, a| {
            eigen.eigenvectors[(a, order[l])] * squares[l].sqrt() / roots[a]
        });
        let mut own = DMatrix::zeros(order.len(), others.len());
        for (&other, mut own) in others.iter().zip(own.column_iter_mut()) {
            let mean_own = mean_of(other);
            for (a, &member) in members.iter().enumerate() {
                let product = counts[a] * (gram[(other, member)] - means[a] - mean_own + mean);
                own.axpy(product, &weights.column(a), 1.0);
            }
            own.iter_mut().zip(&squares).for_each(|(own, square)| *own /= square);
        }
        (Self { members, squares, weights, counts, trace }, own)
    }

    /// Which motions count.
    pub(super) fn members(&self) -> &[usize] {
        &self.members
    }
}

/// A motion that was left out: the scatter of the others is Λ − ρ z zᵀ, and the mean of their weights −shift z.
struct LeftOut {
    place: usize,
    rho: f64,
    z: DVector<f64>,
    shift: f64,
}

/// The motions of a sample, or all but one of them, and what they say of others.
pub(super) struct Fold<'a> {
    sample: Cow<'a, Sample>,
    left_out: Option<LeftOut>,
    /// Counts of those that are left.
    n: f64,
    /// Weights of the motions that are predicted, about the mean of those that are left, a column each.
    own: DMatrix<f64>,
}

/// What a fold says of the motions that are not in it.
pub(super) struct Predicted {
    /// The mean of the scores in the fold.
    pub(super) mean: f64,
    /// What each prediction differs by from that.
    pub(super) differences: Vec<f64>,
    pub(super) tuning: Tuning,
}

/// A regression in the axes of a sample.
struct Fit {
    mean: f64,
    coefficients: DVector<f64>,
    tuning: Tuning,
}

impl<'a> Fold<'a> {
    /// Of a sample, to predict the motions of these weights.
    pub(super) fn new(sample: Sample, own: DMatrix<f64>) -> Fold<'static> {
        let n = sample.counts.iter().sum();
        Fold { sample: Cow::Owned(sample), left_out: None, n, own }
    }

    /// Of all motions of a sample but that at `place`, which is predicted.
    pub(super) fn without(sample: &'a Sample, place: usize, options: &ScoringOptions) -> Self {
        let (all, count) = (sample.counts.iter().sum::<f64>(), sample.counts[place]);
        let n = all - count;
        let z = sample.weights.column(place).into_owned();
        let (rho, shift) = (count * all / n, count / n);
        let own = DMatrix::from_column_slice(z.len(), 1, (&z * (1.0 + shift)).as_slice());
        let left_out = LeftOut { place, rho, z, shift };
        if options.method != RegressionMethod::PrincipalComponents {
            return Self { sample: Cow::Borrowed(sample), left_out: Some(left_out), n, own };
        }
        let most = options.most().min(sample.members.len() - 3).min(sample.squares.len());
        let LeftOut { z, .. } = left_out;
        let (mut squares, axes) = downdate::leading(&sample.squares, rho, &z, most);
        let trace = sample.trace - rho * z.norm_squared();
        squares.retain(|square| *square > NOTHING * trace);
        let axes = axes.columns(0, squares.len());
        let mut weights = axes.tr_mul(&sample.weights).remove_column(place);
        let centre = axes.tr_mul(&z) * shift;
        weights.column_iter_mut().for_each(|mut column| column += &centre);
        let (mut members, mut counts) = (sample.members.clone(), sample.counts.clone());
        members.remove(place);
        counts.remove(place);
        let own = axes.tr_mul(&own);
        let sample = Cow::Owned(Sample { members, squares, weights, counts, trace });
        Self { sample, left_out: None, n, own }
    }

    /// The scores of the motions that are not in it, from those of all.
    pub(super) fn predict(&self, scores: &[f64], options: &ScoringOptions) -> Predicted {
        let y: Vec<f64> = self.sample.members.iter().map(|&i| scores[i]).collect();
        let Fit { mean, coefficients, tuning } = self.fit(&y, options, options.tuning());
        let differences = self.own.column_iter().map(|own| own.dot(&coefficients)).collect();
        Predicted { mean, differences, tuning }
    }

    /// Motions that are left, with their counts.
    fn left(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let out = self.left_out.as_ref().map(|motion| motion.place);
        self.sample.counts.iter().copied().enumerate().filter(move |(i, _)| Some(*i) != out)
    }

    /// ȳ and g.
    fn moments(&self, y: &[f64]) -> (f64, DVector<f64>) {
        let mean = self.left().map(|(i, count)| count * y[i]).sum::<f64>() / self.n;
        let mut products = DVector::zeros(self.sample.squares.len());
        for (i, count) in self.left() {
            products.axpy(count * (y[i] - mean), &self.sample.weights.column(i), 1.0);
        }
        (mean, products)
    }

    /// The regression of `tuning`, or of that which cross-validation chooses.
    fn fit(&self, y: &[f64], options: &ScoringOptions, tuning: Option<Tuning>) -> Fit {
        let (mean, products) = self.moments(y);
        match (options.method, tuning) {
            (RegressionMethod::Ridge, Some(Tuning::Penalty(penalty))) => {
                let coefficients = self.penalised(penalty).coefficients(&products);
                Fit { mean, coefficients, tuning: Tuning::Penalty(penalty) }
            }
            (RegressionMethod::Ridge, _) => self.choose_penalty(y, mean, &products),
            (RegressionMethod::PartialLeastSquares, _) => {
                let n = match tuning {
                    Some(Tuning::Components(n)) => n,
                    _ => self.choose_partial(y, mean, &products, options.most()),
                };
                let mut found = (0, DVector::zeros(products.len()));
                let mut search = Krylov::new(products.len(), n);
                search.run(&products, n, |v| self.scatter(v), |k, b| found = (k, b.clone()));
                Fit { mean, coefficients: found.1, tuning: Tuning::Components(found.0.max(1)) }
            }
            (RegressionMethod::PrincipalComponents, _) => {
                let axes = self.sample.squares.len();
                let mut coefficients = products;
                coefficients.iter_mut().zip(&self.sample.squares).for_each(|(b, square)| *b /= square);
                let n = match tuning {
                    Some(Tuning::Components(n)) => n,
                    _ => self.choose_components(y, mean, &coefficients),
                };
                let n = n.min(axes);
                coefficients.rows_mut(n, axes - n).fill(0.0);
                Fit { mean, coefficients, tuning: Tuning::Components(n) }
            }
        }
    }

    /// The number of components with the least squared error of leaving one motion out. The components themselves stay: they do not
    /// depend on y.
    fn choose_components(&self, y: &[f64], mean: f64, coefficients: &DVector<f64>) -> usize {
        let Sample { squares, weights, counts, .. } = &*self.sample;
        let mut errors: Vec<f64> = y.iter().map(|y| y - mean).collect();
        let mut leverages = vec![1.0 / self.n; y.len()];
        let mut best = (f64::INFINITY, 1);
        for (k, square) in squares.iter().enumerate() {
            let mut press = 0.0;
            for (i, weight) in weights.row(k).iter().enumerate() {
                errors[i] -= coefficients[k] * weight;
                leverages[i] += weight * weight / square;
                press += squared_without(errors[i], leverages[i], counts[i]);
            }
            if press < best.0 {
                best = (press, k + 1);
            }
        }
        best.1
    }

    /// (Λ + γ tr Λ)⁻¹ of the motions that are left.
    fn penalised(&self, penalty: f64) -> Penalised {
        let out = self.left_out.as_ref();
        let trace = self.sample.trace - out.map_or(0.0, |motion| motion.rho * motion.z.norm_squared());
        let inverse = DVector::from_iterator(
            self.sample.squares.len(),
            self.sample.squares.iter().map(|s| 1.0 / (s + penalty * trace)),
        );
        let (dyad, factor) = match out {
            Some(LeftOut { rho, z, .. }) => {
                let dyad = inverse.component_mul(z);
                let factor = rho / (1.0 - rho * z.dot(&dyad));
                (dyad, factor)
            }
            None => (DVector::zeros(inverse.len()), 0.0),
        };
        Penalised { inverse, dyad, factor }
    }

    fn choose_penalty(&self, y: &[f64], mean: f64, products: &DVector<f64>) -> Fit {
        // weights about the mean of those that are left
        let mut weights = self.sample.weights.clone();
        if let Some(LeftOut { z, shift, .. }) = &self.left_out {
            weights.column_iter_mut().for_each(|mut column| column.axpy(*shift, z, 1.0));
        }
        let squares = weights.map(|w| w * w);
        let mut best = (f64::INFINITY, 0.0, DVector::zeros(products.len()));
        for penalty in PENALTIES.map(|k| 10f64.powf(0.5 * f64::from(k))) {
            let penalised = self.penalised(penalty);
            let coefficients = penalised.coefficients(products);
            let mut press = 0.0;
            for (i, count) in self.left() {
                let error = y[i] - mean - weights.column(i).dot(&coefficients);
                let along = weights.column(i).dot(&penalised.dyad);
                let leverage = 1.0 / self.n
                    + squares.column(i).dot(&penalised.inverse)
                    + penalised.factor * along * along;
                press += squared_without(error, leverage, count);
            }
            // of equal ones the stronger
            if press <= best.0 {
                best = (press, penalty, coefficients);
            }
        }
        Fit { mean, coefficients: best.2, tuning: Tuning::Penalty(best.1) }
    }

    /// The scatter of those that are left, times a vector.
    fn scatter(&self, v: &DVector<f64>) -> DVector<f64> {
        let mut image = v.clone();
        image.iter_mut().zip(&self.sample.squares).for_each(|(x, square)| *x *= square);
        if let Some(LeftOut { rho, z, .. }) = &self.left_out {
            image.axpy(-rho * z.dot(v), z, 1.0);
        }
        image
    }

    /// The number of components of partial least squares with the least squared error of motions that are left out of the fit.
    fn choose_partial(&self, y: &[f64], mean: f64, products: &DVector<f64>, most: usize) -> usize {
        let mut search = Krylov::new(products.len(), most);
        let (mut press, mut errors) = (vec![0.0; most], vec![0.0; most]);
        for (i, count) in self.left() {
            let mut z = self.sample.weights.column(i).into_owned();
            if let Some(motion) = &self.left_out {
                z.axpy(motion.shift, &motion.z, 1.0);
            }
            let rest = self.n - count;
            let (rho, shift, error) = (count * self.n / rest, count / rest, y[i] - mean);
            let mut target = products.clone();
            target.axpy(-rho * error, &z, 1.0);
            errors.fill((1.0 + shift) * error);
            let without = |v: &DVector<f64>| {
                let mut image = self.scatter(v);
                image.axpy(-rho * z.dot(v), &z, 1.0);
                image
            };
            search.run(&target, most, without, |k, b| {
                // where the search ends, later components say what this one does
                errors[k - 1..].fill((1.0 + shift) * (error - z.dot(b)));
            });
            press.iter_mut().zip(&errors).for_each(|(press, error)| *press += count * error * error);
        }
        1 + (0..most).fold(0, |best, k| if press[k] < press[best] { k } else { best })
    }
}

/// What a motion of so many counts adds to the squared errors of leaving each out, by its error with it and its leverage.
fn squared_without(error: f64, leverage: f64, count: f64) -> f64 {
    // a motion that alone decides a coefficient cannot be predicted without it
    let rest = (1.0 - count * leverage).max(f64::EPSILON);
    count * (error / rest).powi(2)
}

/// The matrix diag(inverse) + factor · dyad dyadᵀ.
struct Penalised {
    inverse: DVector<f64>,
    dyad: DVector<f64>,
    factor: f64,
}

impl Penalised {
    fn coefficients(&self, products: &DVector<f64>) -> DVector<f64> {
        let mut b = self.inverse.component_mul(products);
        b.axpy(self.factor * self.dyad.dot(products), &self.dyad, 1.0);
        b
    }
}

/// Conjugate gradients, whose residuals are kept orthogonal.
struct Krylov {
    /// Residuals of unit length, a column each.
    basis: DMatrix<f64>,
}

impl Krylov {
    fn new(n: usize, most: usize) -> Self {
        Self { basis: DMatrix::zeros(n, most) }
    }

    /// Minimises ½ bᵀSb − gᵀb over Krylov spaces that grow, and passes the number of directions and b of each.
    fn run(
        &mut self,
        g: &DVector<f64>,
        most: usize,
        scatter: impl Fn(&DVector<f64>) -> DVector<f64>,
        mut found: impl FnMut(usize, &DVector<f64>),
    ) {
        let (mut b, mut residual, mut direction) = (DVector::zeros(g.len()), g.clone(), g.clone());
        let size = g.norm();
        let mut square = size * size;
        for k in 0..most {
            let image = scatter(&direction);
            let curvature = direction.dot(&image);
            if !(square.sqrt() > EXPLAINED * size && curvature > 0.0) {
                break;
            }
            self.basis.set_column(k, &(&residual / square.sqrt()));
            b.axpy(square / curvature, &direction, 1.0);
            found(k + 1, &b);
            residual.axpy(-square / curvature, &image, 1.0);
            for column in self.basis.columns(0, k + 1).column_iter() {
                residual.axpy(-column.dot(&residual), &column, 1.0);
            }
            let next = residual.norm_squared();
            direction *= next / square;
            direction += &residual;
            square = next;
        }
    }
}

/// Scores over the principal components of motions' vectors, each counted once.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Regression {
    /// The components: those that are used, or all where the method uses all.
    pub(super) eigenmotions: Pca,
    /// The mean of the scores.
    pub(super) intercept: f64,
    /// b.
    pub(super) coefficients: Vec<f64>,
    pub(super) method: RegressionMethod,
    pub(super) tuning: Tuning,
}

impl Regression {
    /// Of the tuning requested, or of that which cross-validation chooses; of principal components two less than motions at most.
    pub(super) fn of(
        vectors: &DMatrix<f64>,
        scores: &[f64],
        options: &ScoringOptions,
    ) -> Result<Self, AnalysisError> {
        let (n, numbers) = vectors.shape();
        let axes = match options.method {
            RegressionMethod::PrincipalComponents => options.most().min(n.saturating_sub(2)).max(1),
            RegressionMethod::PartialLeastSquares | RegressionMethod::Ridge => {
                n.saturating_sub(1).min(numbers).max(1)
            }
        };
        let eigenmotions = Pca::fit(vectors, axes)?;
        let found = Self::fit(&eigenmotions, vectors, scores, options, options.tuning())?;
        let used = match (options.method, found.tuning) {
            (RegressionMethod::PrincipalComponents, Tuning::Components(n)) => n,
            _ => axes,
        };
        let mut coefficients = found.coefficients.as_slice().to_vec();
        coefficients.resize(used, 0.0);
        Ok(Self {
            eigenmotions: eigenmotions.truncated(used),
            intercept: found.mean,
            coefficients,
            method: options.method,
            tuning: found.tuning,
        })
    }

    /// In given components; those that a method needs must be among them.
    fn fit(
        eigenmotions: &Pca,
        vectors: &DMatrix<f64>,
        scores: &[f64],
        options: &ScoringOptions,
        tuning: Option<Tuning>,
    ) -> Result<Fit, AnalysisError> {
        let sample = Sample::of(eigenmotions, vectors)?;
        let own = DMatrix::zeros(sample.squares.len(), 0);
        Ok(Fold::new(sample, own).fit(scores, options, tuning))
    }

    /// The intercept and the coefficients that follow from the components, the method and the tuning.
    pub(super) fn expected(
        &self,
        vectors: &DMatrix<f64>,
        scores: &[f64],
    ) -> Result<(f64, Vec<f64>), AnalysisError> {
        let options = ScoringOptions { method: self.method, ..ScoringOptions::thesis() };
        let found = Self::fit(&self.eigenmotions, vectors, scores, &options, Some(self.tuning))?;
        let mut coefficients = found.coefficients.as_slice().to_vec();
        coefficients.resize(self.eigenmotions.n_components(), 0.0);
        Ok((found.mean, coefficients))
    }

    /// The score of each row of `vectors`.
    pub(super) fn predict(&self, vectors: &DMatrix<f64>) -> Result<Vec<f64>, AnalysisError> {
        let weights = self.eigenmotions.scores(vectors)?;
        let score = |weights: nalgebra::RowDVector<f64>| {
            self.intercept + weights.iter().zip(&self.coefficients).map(|(s, b)| s * b).sum::<f64>()
        };
        Ok(weights.row_iter().map(|row| score(row.into_owned())).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_core::random::SplitMix64;

    fn with(method: RegressionMethod, tuning: Option<Tuning>) -> ScoringOptions {
        let mut options = ScoringOptions { method, ..ScoringOptions::thesis() };
        match tuning {
            Some(Tuning::Components(n)) => options.n_components = Some(n),
            Some(Tuning::Penalty(penalty)) => options.penalty = Some(penalty),
            None => (),
        }
        options
    }

    #[test]
    fn ridge_and_partial_least_squares_are_scikit_learns() {
        // scikit-learn 1.9.1: Ridge(alpha = γ Σ‖x − x̄‖²), PLSRegression(scale=False), and the least squared error of LeaveOneOut
        let vectors = DMatrix::from_row_slice(
            7,
            4,
            &[
                1.0, 0.5, -0.3, 2.0, 0.2, 1.5, 0.7, -1.0, -1.1, 0.4, 1.9, 0.6, 2.3, -0.7, 0.1, 1.2, 0.9, 0.8,
                -1.4, -0.2, -0.6, -1.3, 0.5, 0.3, 1.7, 1.1, 0.8, -0.9,
            ],
        );
        let scores = [7.0, 5.5, 4.0, 8.5, 6.5, 3.0, 7.5];
        let new = DMatrix::from_row_slice(1, 4, &[0.5, -0.5, 1.0, 0.25]);
        use RegressionMethod::{PartialLeastSquares, Ridge};
        let repeated: Vec<usize> = [0, 1, 2, 3, 4, 5, 6, 2, 2].to_vec();
        let of = |rows: &[usize], method, tuning| {
            let scores: Vec<f64> = rows.iter().map(|&i| scores[i]).collect();
            let found = Regression::of(&vectors.select_rows(rows), &scores, &with(method, tuning)).unwrap();
            (found.predict(&new).unwrap()[0], found.tuning)
        };
        for (rows, method, tuning, expected) in [
            (&repeated[..7], Ridge, Tuning::Penalty(0.01), 5.404922455779079),
            (&repeated[..7], Ridge, Tuning::Penalty(0.3), 5.618094251777954),
            (&repeated[..7], PartialLeastSquares, Tuning::Components(1), 5.28065466839259),
            (&repeated[..7], PartialLeastSquares, Tuning::Components(2), 5.358272548818803),
            (&repeated[..7], PartialLeastSquares, Tuning::Components(3), 5.423913045274196),
            (&repeated[..], Ridge, Tuning::Penalty(0.01), 5.447677335048094),
            (&repeated[..], PartialLeastSquares, Tuning::Components(2), 5.434564233370588),
        ] {
            let (found, used) = of(rows, method, Some(tuning));
            assert!((found - expected).abs() < 1e-12, "{method} {tuning:?}: {found}");
            assert_eq!(used, tuning);
        }
        assert_eq!(of(&repeated[..7], Ridge, None).1, Tuning::Penalty(0.01));
        assert_eq!(of(&repeated[..7], PartialLeastSquares, None).1, Tuning::Components(4));
    }

    #[test]
    fn a_fold_is_a_fit_without_the_motion() {
        let mut random = SplitMix64::new(9);
        for (n, numbers) in [(14, 40), (16, 5)] {
            let vectors = DMatrix::from_fn(n, numbers, |_, j| (2.0 * random.unit() - 1.0) / (1.0 + j as f64));
            let scores: Vec<f64> = (0..n).map(|i| 5.0 + 2.0 * vectors[(i, 0)] + random.unit()).collect();
            let counts: Vec<f64> = (0..n).map(|i| [1.0, 2.0, 1.0, 0.0, 3.0][i % 5]).collect();
            let gram = &vectors * vectors.transpose();
            let (sample, _) = Sample::of_gram(&gram, &counts, usize::MAX, &[]);
            use RegressionMethod::{PartialLeastSquares, PrincipalComponents, Ridge};
            for options in [
                with(PrincipalComponents, None),
                with(PrincipalComponents, Some(Tuning::Components(3))),
                with(PartialLeastSquares, None),
                with(PartialLeastSquares, Some(Tuning::Components(3))),
                with(Ridge, None),
                with(Ridge, Some(Tuning::Penalty(0.02))),
            ] {
                for (place, &i) in sample.members().iter().enumerate() {
                    let found = Fold::without(&sample, place, &options).predict(&scores, &options);
                    let mut others = counts.clone();
                    others[i] = 0.0;
                    let most = options.most().min(sample.members().len() - 3);
                    let most = if options.method == PrincipalComponents { most } else { n };
                    let (rest, own) = Sample::of_gram(&gram, &others, most, &[i]);
                    let expected = Fold::new(rest, own).predict(&scores, &options);
                    let of = format!("{n} motions, {:?}, without {i}", options.tuning());
                    assert!((found.mean - expected.mean).abs() < 1e-13, "{of}");
                    let off = found.differences[0] - expected.differences[0];
                    assert!(off.abs() < 1e-10, "{of}: {off:e}");
                    assert_eq!(found.tuning, expected.tuning, "{of}");
                    // a copy of a motion is a motion where nothing is chosen
                    if options.tuning().is_some() {
                        let rows: Vec<usize> = (0..n).flat_map(|k| vec![k; others[k] as usize]).collect();
                        let y: Vec<f64> = rows.iter().map(|&k| scores[k]).collect();
                        let again = Regression::of(&vectors.select_rows(&rows), &y, &options).unwrap();
                        let expected = again.predict(&vectors.select_rows(&[i])).unwrap()[0];
                        let off = found.mean + found.differences[0] - expected;
                        assert!(off.abs() < 1e-10, "{of}: {off:e} from copies");
                    }
                }
            }
        }
    }

    #[test]
    fn choices_are_those_of_fits_without_each_motion() {
        // the penalty and the number of partial components, by fits of Regression without each motion
        let mut random = SplitMix64::new(5);
        let n = 13;
        let vectors = DMatrix::from_fn(n, 30, |_, j| (2.0 * random.unit() - 1.0) / (1.0 + j as f64));
        let scores: Vec<f64> = (0..n).map(|i| 5.0 + 2.0 * vectors[(i, 0)] + 2.0 * random.unit()).collect();
        let total: f64 = Pca::fit(&vectors, 1).unwrap().total_variance() * (n - 1) as f64;
        let press = |options: &dyn Fn(f64) -> ScoringOptions| -> f64 {
            let left_out = |i: usize| {
                let others: Vec<usize> = (0..n).filter(|k| *k != i).collect();
                let rest = vectors.select_rows(&others);
                let y: Vec<f64> = others.iter().map(|&k| scores[k]).collect();
                let total_rest = Pca::fit(&rest, 1).unwrap().total_variance() * (n - 2) as f64;
                let model = Regression::of(&rest, &y, &options(total / total_rest)).unwrap();
                scores[i] - model.predict(&vectors.select_rows(&[i])).unwrap()[0]
            };
            (0..n).map(|i| left_out(i).powi(2)).sum()
        };
        let least = |presses: Vec<f64>| {
            (0..presses.len()).min_by(|&a, &b| presses[a].total_cmp(&presses[b])).unwrap()
        };
        let chosen = |method| Regression::of(&vectors, &scores, &with(method, None)).unwrap().tuning;
        let of_components =
            |k: usize| press(&|_| with(RegressionMethod::PartialLeastSquares, Some(Tuning::Components(k))));
        let expected = 1 + least((1..=5).map(of_components).collect());
        assert_eq!(chosen(RegressionMethod::PartialLeastSquares), Tuning::Components(expected));
        let penalties: Vec<f64> = PENALTIES.map(|k| 10f64.powf(0.5 * f64::from(k))).collect();
        let of_penalty = |penalty: &f64| {
            press(&|times| with(RegressionMethod::Ridge, Some(Tuning::Penalty(penalty * times))))
        };
        let expected = penalties[least(penalties.iter().map(of_penalty).collect())];
        assert_eq!(chosen(RegressionMethod::Ridge), Tuning::Penalty(expected));
    }
}
