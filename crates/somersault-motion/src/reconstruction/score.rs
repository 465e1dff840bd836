//! Whether departures from the laws of flight would make the residuals smaller: the score test, which searches none of them.
//!
//! ```text
//! d = βᵀ S⁻¹ β / n
//! ```
//! with the gradient β by n of the departures' factors λ and γ and the Schur complement S of their Hessian. Where the laws hold, n d has the
//! χ² distribution with n degrees of freedom. A size that was given is tested likewise, and so are the drag of the air and the places of the
//! markers on their bodies, which may be off by δ = 2 mm: β is normal with the covariance S + δ² S². Of gravity and of the places the step to
//! the minimum is reported.
//!
//! Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50.

use super::ReconstructionError;
use super::attitude::Flown;
use super::departure::{FUNCTIONS, N_FUNCTIONS, PUSHES, push_time};
use super::flight::{Departure, FOLLOWED, Quantity};
use super::normal::Normal;
use super::search::Search;
use crate::cholesky::Cholesky;
use crate::noise::chi_squared_quantile;
use nalgebra::{DMatrix, DVector, Vector3};
use std::ops::Range;

/// Damping of departures that are no others than those of unknowns.
const WIDEST: f64 = 1e-8;
/// Standard deviations up to which a departure is by chance: one in 4000 is beyond; and one of eight pushes.
pub(super) const CHANCE: f64 = 3.5;
const CHANCE_OF_PUSHES: f64 = 4.0;
/// What d may differ from 1 by, whatever the noise is.
pub(super) const TOLERANCE: f64 = 0.1;
/// Standard deviation of the place of a marker before the recording is looked at, m: what is known worse is not tested.
const PLACED: f64 = 0.03;
const UNPLACED: f64 = 0.3;

/// What the score test finds.
#[derive(Debug, Clone)]
pub(super) struct Tested {
    /// Those of [`Departure`] but that from the plane, each with its limit; NaN of a size that was sought.
    pub(super) departures: [[f64; 2]; 7],
    /// When the push begins that fits best, s.
    pub(super) push_time: f64,
    /// How far each marker is from where the model has it, one step of the search from the minimum, in axes of its body.
    pub(super) offsets: Vec<Quantity>,
    /// g over that of the model, one step of the search from the minimum, and its standard deviation.
    pub(super) gravity: [f64; 2],
}

/// Gradient and Hessian by what is tested, where all unknowns of the search follow.
struct Score {
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    /// The unknowns that are tested, one for each number of the gradient.
    unknowns: Vec<usize>,
}

impl Score {
    /// None where the Hessian of all other unknowns has no inverse.
    fn of(matrix: &DMatrix<f64>, gradient: &[f64], unknowns: Vec<usize>) -> Option<Self> {
        let others: Vec<usize> = (0..gradient.len()).filter(|k| !unknowns.contains(k)).collect();
        // the lower half is the matrix
        let at = |i: usize, j: usize| matrix[(i.max(j), i.min(j))];
        let of_others = DMatrix::from_fn(others.len(), others.len(), |i, j| at(others[i], others[j]));
        let mixed = DMatrix::from_fn(others.len(), unknowns.len(), |i, j| at(others[i], unknowns[j]));
        let mut solved = mixed.clone();
        Cholesky::of(of_others)?.solve_of(&mut solved);
        let followed = mixed.transpose() * &solved;
        let n = unknowns.len();
        let hessian = DMatrix::from_fn(n, n, |i, j| at(unknowns[i], unknowns[j]) - followed[(i, j)]);
        let of_unknown = |j: usize| {
            let sum: f64 = others.iter().enumerate().map(|(i, k)| solved[(i, j)] * gradient[*k]).sum();
            gradient[unknowns[j]] - sum
        };
        let gradient = DVector::from_fn(n, |j, _| of_unknown(j));
        let is_finite = gradient.iter().chain(hessian.iter()).all(|x| x.is_finite());
        is_finite.then(|| Self { gradient, hessian: (&hessian + hessian.transpose()) * 0.5, unknowns })
    }

    /// Gradient and Hessian by the unknowns of a range alone, all others that are tested left as they are.
    fn part(&self, tested: &Range<usize>) -> (DVector<f64>, DMatrix<f64>) {
        let kept: Vec<usize> =
            (0..self.unknowns.len()).filter(|i| tested.contains(&self.unknowns[*i])).collect();
        let hessian = self.hessian.select_rows(&kept).select_columns(&kept);
        (self.gradient.select_rows(&kept), hessian)
    }

    /// βᵀ S⁻¹ β, and the first number of the step to the minimum. None where there is no inverse.
    fn fall(&self, tested: &Range<usize>) -> Option<(f64, f64)> {
        let (gradient, hessian) = self.part(tested);
        let step = -hessian.cholesky()?.solve(&gradient);
        Some((-step.dot(&gradient), *step.get(0)?))
    }

    /// d of the places of markers with its limit, and the step to the minimum with its standard deviations.
    fn of_places(&self, tested: &Range<usize>) -> Option<([f64; 2], Vec<Quantity>)> {
        let (gradient, hessian) = self.part(tested);
        let eigen = hessian.clone().symmetric_eigen();
        let along = eigen.eigenvectors.tr_mul(&gradient);
        let least = (eigen.eigenvalues.max() * WIDEST).max(UNPLACED.powi(-2));
        let known = eigen.eigenvalues.iter().zip(along.iter()).filter(|(size, _)| **size > least);
        let (sum, n) = known
            .fold((0.0, 0), |(sum, n), (size, x)| (sum + x * x / (size + (FOLLOWED * size).powi(2)), n + 1));
        let of_places =
            if n > 0 { [sum / n as f64, chi_squared_quantile(n, CHANCE) + TOLERANCE] } else { [f64::NAN; 2] };
        let prior = DMatrix::from_diagonal_element(gradient.len(), gradient.len(), PLACED.powi(-2));
        let factor = (hessian + prior).cholesky()?;
        let (step, covariance) = (-factor.solve(&gradient), factor.inverse());
        let offset = |k: usize| Quantity {
            value: Vector3::from_fn(|i, _| step[3 * k + i]),
            deviation: Vector3::from_fn(|i, _| covariance[(3 * k + i, 3 * k + i)].sqrt()),
        };
        Some((of_places, (0..gradient.len() / 3).map(offset).collect()))
    }
}

impl Search<'_> {
    /// The departures and gravity at the minimum. None where the Hessian has no inverse.
    pub(super) fn tested(&mut self) -> Result<Option<Tested>, ReconstructionError> {
        self.expect_not_cancelled()?;
        let frames = self.all();
        let knots = self.knots(&frames);
        let Flown { model, splines, layout } = self.flown;
        let Self { markers, observed, trust, noise, prior, estimate, room, kinematics, .. } = self;
        let layout = layout.with_departures(markers.markers().len());
        let flown = Flown { model, splines, layout: &layout };
        let at = flown.fly(markers, observed, estimate, &frames, Some(&knots), room, kinematics)?;
        let Normal { mut matrix, mut gradient, .. } =
            flown.normal(markers, observed, estimate, &frames, Some(&knots), &at, trust, noise);
        prior.add(&layout, splines, estimate, &knots, &mut matrix, &mut gradient);
        let all = layout.departures();
        for k in all.clone() {
            matrix[(k, k)] += WIDEST * matrix[(k, k)];
        }
        let each = all.len() / N_FUNCTIONS;
        let of_functions = |k: Range<usize>| all.start + k.start * each..all.start + k.end * each;
        let own = self.flown.layout;
        let one = |k: Option<usize>, is_sought: bool| k.filter(|_| !is_sought).map_or(0..0, |k| k..k + 1);
        let size = one(layout.scale(), own.has_scale);
        let gravity = one(layout.gravity(), own.has_gravity);
        let air = one(layout.air(), false);
        let places = layout.places();
        let tested = [&all, &size, &gravity, &air, &places].into_iter().flat_map(Clone::clone).collect();
        let Some(score) = Score::of(&matrix, &gradient, tested) else { return Ok(None) };
        let [whole, start, end] = FUNCTIONS.map(of_functions);
        let mut departures = [[f64::NAN; 2]; 7];
        let simple = [
            (Departure::Whole, whole),
            (Departure::Start, start),
            (Departure::End, end),
            (Departure::Size, size),
            (Departure::Air, air),
        ];
        for (kind, tested) in simple {
            if tested.is_empty() || kind == Departure::Air && model.gravity().norm() == 0.0 {
                continue;
            }
            let Some((fall, _)) = score.fall(&tested) else { return Ok(None) };
            // s² along gravity is gravity, where that is sought
            let n = tested.len() - usize::from(own.has_gravity && kind == Departure::Whole);
            departures[kind as usize] = [fall / n as f64, chi_squared_quantile(n, CHANCE) + TOLERANCE];
        }
        let mut push = (f64::NEG_INFINITY, 0);
        for number in 0..PUSHES.len() {
            let function = PUSHES.start + number;
            let Some((fall, _)) = score.fall(&of_functions(function..function + 1)) else { return Ok(None) };
            if fall > push.0 {
                push = (fall, number);
            }
        }
        let n = each as f64;
        departures[Departure::Push as usize] =
            [push.0 / n, chi_squared_quantile(each, CHANCE_OF_PUSHES) + TOLERANCE];
        let Some((of_places, offsets)) = score.of_places(&places) else { return Ok(None) };
        departures[Departure::Places as usize] = of_places;
        let of_gravity = if gravity.is_empty() || model.gravity().norm() == 0.0 {
            [estimate.gravity, f64::NAN]
        } else {
            // what the squares fall by is the step over its deviation, squared
            let Some((fall, step)) = score.fall(&gravity) else { return Ok(None) };
            [estimate.gravity + step, step.abs() / fall.sqrt()]
        };
        let push_time = observed.times[0] + push_time(splines, push.1);
        Ok(Some(Tested { departures, push_time, offsets, gravity: of_gravity }))
    }
}
