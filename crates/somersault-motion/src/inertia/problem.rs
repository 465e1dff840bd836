//! The motion of a free body as a function of eleven unknowns, and how far it is from the attitudes.

use super::InertiaEstimateError;
use super::triangle::Triangle;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, SVector, SymmetricEigen, UnitQuaternion, Vector3};
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3;
use somersault_integrators::exact::FreeRotation;
use std::ops::Range;

/// Unknowns: five of the inertia, three of the orientation and three of the angular velocity in the body, at the reference time.
pub(super) const UNKNOWNS: usize = 11;
/// Those of the inertia.
pub(super) const OF_INERTIA: usize = 5;
/// Their values.
pub(super) type Unknowns = SVector<f64, UNKNOWNS>;

/// Step of derivatives, relative to the size of the unknown: attitudes far from the reference time turn much with it, so that it is
/// shorter than that of general differences.
const STEP: f64 = 1e-7;
/// Bound of the logarithms of second moments, beyond which bodies are rods and plates to rounding.
const ELONGATED: f64 = 12.0;
/// Attitudes whose derivatives are decomposed together.
const BLOCK: usize = 1024;
/// Attitudes between looks at the token.
const LOOK: usize = 256;

/// Attitudes at times that are counted from the one in the middle.
pub(super) struct Record<'a> {
    pub(super) times: Vec<f64>,
    pub(super) seen: &'a [UnitQuaternion<f64>],
    pub(super) middle: usize,
    /// The first time as it was given.
    pub(super) first: f64,
}

impl<'a> Record<'a> {
    pub(super) fn new(times: &[f64], seen: &'a [UnitQuaternion<f64>]) -> Self {
        let middle = times.len() / 2;
        let times_from_middle = times.iter().map(|t| t - times[middle]).collect();
        Self { times: times_from_middle, seen, middle, first: times[0] }
    }
}

/// The step of a derivative by an unknown.
pub(super) fn step(x: f64) -> f64 {
    STEP * x.abs().max(1.0)
}

/// The derivative of a function of the unknowns by central differences.
pub(super) fn slopes<const M: usize>(
    function: impl Fn(&Unknowns) -> SVector<f64, M>,
    x: &Unknowns,
) -> nalgebra::SMatrix<f64, M, UNKNOWNS> {
    nalgebra::SMatrix::from_columns(&std::array::from_fn::<_, UNKNOWNS, _>(|k| {
        let h = step(x[k]);
        let moved = |h: f64| {
            let mut moved = *x;
            moved[k] += h;
            function(&moved)
        };
        (moved(h) - moved(-h)) / (2.0 * h)
    }))
}

/// Principal moments and axes of a body.
pub(super) struct Principal {
    pub(super) moments: Vector3<f64>,
    /// As columns, in the body frame, right-handed.
    pub(super) axes: Matrix3<f64>,
}

impl Principal {
    /// Those of tr(S) − S, S = exp M, with the trace 2, for the numbers M₁₁, M₂₂, M₁₂, M₁₃, M₂₃ of M without trace.
    pub(super) fn of_numbers(numbers: &[f64]) -> Self {
        let m = |k: usize| numbers[k].clamp(-ELONGATED, ELONGATED);
        let (a, b, c, d, e) = (m(0), m(1), m(2), m(3), m(4));
        let eigen = SymmetricEigen::new(Matrix3::new(a, c, d, c, b, e, d, e, -a - b));
        let greatest = eigen.eigenvalues.max();
        let second = eigen.eigenvalues.map(|x| (x - greatest).exp());
        let [x, y, z] = second.into();
        let [first, other] = [0, 1].map(|k| eigen.eigenvectors.column(k).into_owned());
        Self {
            moments: Vector3::new(y + z, z + x, x + y) / second.sum(),
            axes: Matrix3::from_columns(&[first, other, first.cross(&other)]),
        }
    }

    /// The tensor in the body frame.
    pub(super) fn tensor(&self) -> Matrix3<f64> {
        let tensor = self.axes * Matrix3::from_diagonal(&self.moments) * self.axes.transpose();
        0.5 * (tensor + tensor.transpose())
    }
}

/// The five numbers of a symmetric positive definite tensor of second moments of mass.
pub(super) fn numbers_of(second: &Matrix3<f64>) -> [f64; OF_INERTIA] {
    let eigen = SymmetricEigen::new(*second);
    let logs = Matrix3::from_diagonal(&eigen.eigenvalues.map(f64::ln));
    let mut log = eigen.eigenvectors * logs * eigen.eigenvectors.transpose();
    log -= Matrix3::from_diagonal_element(log.trace() / 3.0);
    [log[(0, 0)], log[(1, 1)], log[(0, 1)], log[(0, 2)], log[(1, 2)]]
}

/// The rotation of a body, known for all times.
pub(super) struct Motion {
    rotation: FreeRotation,
    /// Principal axes → body frame.
    axes: UnitQuaternion<f64>,
}

impl Motion {
    /// That of eleven unknowns, which are finite; the orientation is R₀ exp(δ) with R₀ = `base`.
    pub(super) fn tumbling(x: &[f64], base: &UnitQuaternion<f64>) -> Self {
        let body = Principal::of_numbers(&x[..OF_INERTIA]);
        let axes = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(body.axes));
        let start = base * so3::exp(&Vector3::from_column_slice(&x[5..8]));
        let rate = body.axes.tr_mul(&Vector3::from_column_slice(&x[8..]));
        Self { rotation: FreeRotation::new(&body.moments, &(start * axes), &rate), axes }
    }

    /// Steady rotation, R₀ exp(δ) exp(ω t) of the six numbers δ and ω.
    pub(super) fn steady(x: &[f64], base: &UnitQuaternion<f64>) -> Self {
        let start = base * so3::exp(&Vector3::from_column_slice(&x[..3]));
        let rate = Vector3::from_column_slice(&x[3..]);
        Self {
            rotation: FreeRotation::new(&Vector3::repeat(1.0), &start, &rate),
            axes: UnitQuaternion::identity(),
        }
    }

    /// Orientation, body frame → world frame, and angular velocity in the body at a time.
    pub(super) fn at(&self, t: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let (orientation, rate) = self.rotation.at(t);
        (orientation * self.axes.inverse(), self.axes * rate)
    }
}

/// A function of the eleven unknowns that is held at a value: a residual of its own.
pub(super) struct Held<'a> {
    pub(super) factor: f64,
    pub(super) target: f64,
    pub(super) function: &'a dyn Fn(&Unknowns) -> f64,
}

impl Held<'_> {
    fn residual(&self, x: &[f64]) -> f64 {
        self.factor * ((self.function)(&Unknowns::from_column_slice(x)) - self.target)
    }

    fn derivative(&self, x: &[f64], j: usize) -> f64 {
        let h = step(x[j]);
        let moved = |h: f64| {
            let mut moved = Unknowns::from_column_slice(x);
            moved[j] += h;
            self.residual(moved.as_slice())
        };
        (moved(h) - moved(-h)) / (2.0 * h)
    }
}

/// The residuals of a part of a record.
pub(super) struct Squares<'a> {
    pub(super) record: &'a Record<'a>,
    pub(super) part: Range<usize>,
    /// The motion of the unknowns.
    pub(super) motion: &'a dyn Fn(&[f64]) -> Motion,
    /// By what the unknowns of the inertia are tied to some values.
    pub(super) ties: Option<(f64, [f64; OF_INERTIA])>,
    /// What else is a residual.
    pub(super) held: Option<Held<'a>>,
    pub(super) token: &'a CancellationToken,
}

/// Residuals near a point: with the orthogonal Q of the QR decomposition of their derivative.
pub(super) struct Linear {
    /// R.
    pub(super) triangle: DMatrix<f64>,
    /// Qᵀ f.
    pub(super) image: DVector<f64>,
    /// Rows of the derivative.
    pub(super) rows: usize,
}

impl Squares<'_> {
    fn residual(&self, motion: &Motion, k: usize) -> Vector3<f64> {
        let fitted = motion.at(self.record.times[k]).0;
        so3::log(&(fitted.inverse() * self.record.seen[k]))
    }

    /// Fails once the work is to end, looked at now and then.
    fn expect_not_cancelled(&self, k: usize) -> Result<(), InertiaEstimateError> {
        let ends = k.is_multiple_of(LOOK) && self.token.is_cancelled();
        if ends { Err(InertiaEstimateError::Cancelled) } else { Ok(()) }
    }

    /// Half the sum of squares; `None` where it is not finite.
    pub(super) fn half_sum(&self, x: &DVector<f64>) -> Result<Option<f64>, InertiaEstimateError> {
        if x.iter().any(|x| !x.is_finite()) {
            return Ok(None);
        }
        let motion = (self.motion)(x.as_slice());
        let mut sum = 0.0;
        for k in self.part.clone() {
            self.expect_not_cancelled(k)?;
            sum += self.residual(&motion, k).norm_squared();
        }
        if let Some((factor, centre)) = self.ties {
            sum += x.iter().zip(centre).map(|(x, centre)| (factor * (x - centre)).powi(2)).sum::<f64>();
        }
        if let Some(held) = &self.held {
            sum += held.residual(x.as_slice()).powi(2);
        }
        Ok(sum.is_finite().then_some(0.5 * sum))
    }

    /// The residuals of the part.
    pub(super) fn residuals(&self, x: &DVector<f64>) -> Result<Vec<Vector3<f64>>, InertiaEstimateError> {
        let motion = (self.motion)(x.as_slice());
        let residual = |k| {
            self.expect_not_cancelled(k)?;
            Ok(self.residual(&motion, k))
        };
        self.part.clone().map(residual).collect()
    }

    /// Their derivative, decomposed; `None` where it is not finite.
    pub(super) fn linearized(&self, x: &DVector<f64>) -> Result<Option<Linear>, InertiaEstimateError> {
        let n = x.len();
        let here = (self.motion)(x.as_slice());
        let pairs: Vec<(f64, [Motion; 2])> = (0..n)
            .map(|j| {
                let h = step(x[j]);
                let moved = |h: f64| {
                    let mut moved = x.clone();
                    moved[j] += h;
                    (self.motion)(moved.as_slice())
                };
                (h, [moved(h), moved(-h)])
            })
            .collect();
        let mut triangle = Triangle::new(n + 1, 3 * self.part.len().min(BLOCK) + OF_INERTIA + 1);
        let mut columns = vec![Vector3::zeros(); n + 1];
        for k in self.part.clone() {
            self.expect_not_cancelled(k)?;
            for (column, (h, [right, left])) in columns.iter_mut().zip(&pairs) {
                *column = (self.residual(right, k) - self.residual(left, k)) / (2.0 * h);
            }
            columns[n] = self.residual(&here, k);
            (0..3).for_each(|i| triangle.push(columns.iter().map(|column| column[i])));
        }
        let mut rows = 3 * self.part.len();
        if let Some((factor, centre)) = self.ties {
            rows += OF_INERTIA;
            for (i, centre) in centre.into_iter().enumerate() {
                let tied = |j: usize| if j == i { factor } else { 0.0 };
                triangle.push((0..n).map(tied).chain([factor * (x[i] - centre)]));
            }
        }
        if let Some(held) = &self.held {
            rows += 1;
            let x = x.as_slice();
            triangle.push((0..n).map(|j| held.derivative(x, j)).chain([held.residual(x)]));
        }
        let found = triangle.finish();
        if found.iter().any(|x| !x.is_finite()) {
            return Ok(None);
        }
        Ok(Some(Linear {
            triangle: found.view((0, 0), (n, n)).into_owned(),
            image: found.view((0, n), (n, 1)).column(0).into_owned(),
            rows,
        }))
    }
}
