//! The motion of least effort between two states, as a spline.
//!
//! Where every joint is driven, u = M q̈ + c(q, q̇) follows from the motion, and ½ ∫ Σ γᵢuᵢ² dt is a sum of squares over
//! splines, with no equations to satisfy. Between knots q is the quintic with q, q̇ and q̈ at both, and the integral is taken
//! by Gauss' rule of four points. Levenberg and Marquardt's method goes down from any motion; its normal equations couple
//! neighbouring knots only and are solved by Cholesky's factorisation of the band, O(K Q³) for K knots.

use nalgebra::{SMatrix, SVector};
use somersault_core::quadrature::GAUSS_4;

/// q, q̇ and q̈ at one time.
pub(crate) type Motion<const Q: usize> = [SVector<f64, Q>; 3];

/// u with its derivatives by q, q̇ and q̈.
pub(crate) struct Torque<const Q: usize> {
    pub(crate) u: SVector<f64, Q>,
    pub(crate) by: [SMatrix<f64, Q, Q>; 3],
}

/// What gives the torques of a motion.
pub(super) trait Driven<const Q: usize> {
    /// γ of each torque.
    fn weights(&self) -> [f64; Q];

    fn torque(&self, motion: &Motion<Q>) -> Torque<Q>;
}

/// Part of an interval over which λ̇_v is taken.
const SIDE: f64 = 1e-3;

/// A motion by its knots.
pub(super) struct Spline<const Q: usize> {
    pub(super) times: Vec<f64>,
    pub(super) knots: Vec<Motion<Q>>,
}

/// Powers of s of the quintics that have one of q, q̇, q̈ at 0 or at 1 equal to one and the others zero.
const QUINTICS: [[f64; 6]; 6] = [
    [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
    [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
    [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
    [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
    [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
];

/// Of each quintic, the derivatives of order 0 to 2 by time at s in an interval of length h.
fn shapes(s: f64, h: f64) -> [[f64; 6]; 3] {
    let mut shapes = [[0.0; 6]; 3];
    for (order, row) in shapes.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            let power = |k: usize| {
                let falling: f64 = (0..order).map(|i| (k - i) as f64).product();
                QUINTICS[j][k] * falling * s.powi((k - order) as i32)
            };
            *value = (order..6).map(power).sum::<f64>() * h.powi((j % 3) as i32 - order as i32);
        }
    }
    shapes
}

impl<const Q: usize> Spline<Q> {
    /// q, q̇ and q̈ in interval `k` at s in [0, 1].
    pub(super) fn at(&self, k: usize, s: f64) -> Motion<Q> {
        let shapes = shapes(s, self.times[k + 1] - self.times[k]);
        let values = |j: usize| self.knots[k + j / 3][j % 3];
        shapes.map(|row| (0..6).fold(SVector::zeros(), |sum, j| sum + values(j) * row[j]))
    }

    /// Goes down to less effort ½ ∫ Σ γᵢuᵢ² with q and q̇ held at both ends until a step wins less than a part `enough`, and
    /// returns the steps made.
    pub(super) fn descend(
        &mut self,
        driven: &impl Driven<Q>,
        enough: f64,
        max_steps: usize,
        goes_on: impl Fn() -> bool,
    ) -> usize {
        let weights = driven.weights();
        let block = 3 * Q;
        let size = self.knots.len() * block;
        let held = |i: usize| i < 2 * Q || (i >= size - block && i < size - Q);
        let cost_of = |spline: &Self| {
            let mut cost = 0.0;
            for (k, s, w) in spline.points() {
                let u = driven.torque(&spline.at(k, s)).u;
                cost += 0.5 * w * (0..Q).map(|i| weights[i] * u[i] * u[i]).sum::<f64>();
            }
            cost
        };
        let mut cost = cost_of(self);
        let mut damping = 1e-3;
        let mut band = Band::new(size, 2 * block);
        for step in 0..max_steps {
            if !goes_on() {
                return step;
            }
            band.clear();
            let mut gradient = vec![0.0; size];
            for (k, s, w) in self.points() {
                let shapes = shapes(s, self.times[k + 1] - self.times[k]);
                let Torque { u, by } = driven.torque(&self.at(k, s));
                // u by the twice three vectors of the interval
                let slope = |j: usize| (0..3).fold(SMatrix::zeros(), |sum, d| sum + by[d] * shapes[d][j]);
                let slopes: [SMatrix<f64, Q, Q>; 6] = std::array::from_fn(slope);
                let scaled = SVector::<f64, Q>::from_fn(|i, _| w * weights[i]);
                for (j, slope) in slopes.iter().enumerate() {
                    let weighed = slope.transpose() * SMatrix::from_diagonal(&scaled);
                    let part = weighed * u;
                    (0..Q).for_each(|i| gradient[k * block + j * Q + i] += part[i]);
                    for (l, other) in slopes.iter().enumerate().take(j + 1) {
                        let product = weighed * other;
                        for r in 0..Q {
                            for c in 0..Q {
                                band.add(k * block + j * Q + r, k * block + l * Q + c, product[(r, c)]);
                            }
                        }
                    }
                }
            }
            for i in (0..size).filter(|&i| held(i)) {
                gradient[i] = 0.0;
                band.isolate(i);
            }
            let before = cost;
            for _ in 0..12 {
                if !goes_on() {
                    return step;
                }
                let mut move_by = gradient.clone();
                if !band.solve_damped(damping, &mut move_by) {
                    damping *= 8.0;
                    continue;
                }
                let mut trial = Self { times: self.times.clone(), knots: self.knots.clone() };
                for (i, delta) in move_by.iter().enumerate() {
                    trial.knots[i / block][i % block / Q][i % Q] -= delta;
                }
                let tried = cost_of(&trial);
                if tried < cost {
                    (cost, self.knots) = (tried, trial.knots);
                    damping = (0.2 * damping).max(1e-12);
                    break;
                }
                damping *= 8.0;
            }
            if cost > (1.0 - enough) * before {
                return step + 1;
            }
        }
        max_steps
    }

    /// p at the knots, with the costates for which the torques are optimal: λ_v = −MΓu and λ_q = C_vᵀμ − λ̇_v, μ = −Γu.
    pub(super) fn nodes<const N: usize>(&self, driven: &impl Driven<Q>) -> Vec<SVector<f64, N>> {
        const { assert!(N == 4 * Q) };
        let weights = SVector::<f64, Q>::from(driven.weights());
        // λ_v, and C_vᵀμ
        let costates = |motion: &Motion<Q>| {
            let Torque { u, by: [_, rate, inertia] } = driven.torque(motion);
            let mu = -u.component_mul(&weights);
            [inertia * mu, rate.tr_mul(&mu)]
        };
        let intervals = self.times.len() - 1;
        let node = |k: usize| {
            // λ̇_v to both sides of a knot, where q̈ has a kink
            let (early, late) = (k.saturating_sub(1), k.min(intervals - 1));
            let (before, after) = if k == 0 {
                (0.0, SIDE)
            } else if k == intervals {
                (1.0 - SIDE, 1.0)
            } else {
                (1.0 - SIDE, SIDE)
            };
            let time = |k: usize, s: f64| self.times[k] + s * (self.times[k + 1] - self.times[k]);
            let [[first, _], [last, _]] =
                [self.at(early, before), self.at(late, after)].map(|motion| costates(&motion));
            let rate = (last - first) / (time(late, after) - time(early, before));
            let knot = &self.knots[k];
            let [of_rates, of_angles] = costates(knot);
            let parts = [knot[0], knot[1], of_angles - rate, of_rates];
            SVector::from_fn(|i, _| parts[i / Q][i % Q])
        };
        (0..self.times.len()).map(node).collect()
    }

    /// Interval, place in it and weight of every point of the rule.
    fn points(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let lengths = self.times.windows(2).map(|t| t[1] - t[0]).collect::<Vec<_>>().into_iter().enumerate();
        lengths.flat_map(|(k, h)| GAUSS_4.map(|(s, w)| (k, s, w * h)))
    }
}

/// The lower half of a symmetric matrix whose entries vanish `width` and more below the diagonal, row by row.
struct Band {
    width: usize,
    rows: Vec<f64>,
    factor: Vec<f64>,
}

impl Band {
    fn new(size: usize, width: usize) -> Self {
        Self { width, rows: vec![0.0; size * width], factor: vec![0.0; size * width] }
    }

    fn clear(&mut self) {
        self.rows.fill(0.0);
    }

    /// Adds to entry (i, j) if it is in the lower half.
    fn add(&mut self, i: usize, j: usize, value: f64) {
        if j <= i {
            self.rows[i * self.width + (i - j)] += value;
        }
    }

    /// Row and column `i` become those of the identity.
    fn isolate(&mut self, i: usize) {
        let size = self.rows.len() / self.width;
        for d in 0..self.width {
            self.rows[i * self.width + d] = 0.0;
            if i + d < size {
                self.rows[(i + d) * self.width + d] = 0.0;
            }
        }
        self.rows[i * self.width] = 1.0;
    }

    /// Solves (A + damping · diag A) x = b in place; false if that is not positive definite.
    fn solve_damped(&mut self, damping: f64, b: &mut [f64]) -> bool {
        let width = self.width;
        self.factor.copy_from_slice(&self.rows);
        for i in 0..b.len() {
            self.factor[i * width] *= 1.0 + damping;
            let first = (i + 1).saturating_sub(width);
            for j in first..=i {
                let shared = first.max((j + 1).saturating_sub(width));
                let mut sum = self.factor[i * width + (i - j)];
                for k in shared..j {
                    sum -= self.factor[i * width + (i - k)] * self.factor[j * width + (j - k)];
                }
                if i > j {
                    self.factor[i * width + (i - j)] = sum / self.factor[j * width];
                } else if sum > 0.0 {
                    self.factor[i * width] = sum.sqrt();
                } else {
                    return false;
                }
            }
            let known: f64 = (first..i).map(|k| self.factor[i * width + (i - k)] * b[k]).sum();
            b[i] = (b[i] - known) / self.factor[i * width];
        }
        for i in (0..b.len()).rev() {
            let last = (i + width).min(b.len());
            let known: f64 = (i + 1..last).map(|k| self.factor[k * width + (k - i)] * b[k]).sum();
            b[i] = (b[i] - known) / self.factor[i * width];
        }
        true
    }
}
