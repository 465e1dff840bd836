//! The motion of minimum effort between two states, as a spline.
//!
//! Where every joint is driven, u = M q̈ + c(q, q̇) follows from the motion, and ½ ∫ Σ γᵢuᵢ² dt is a sum of squares over
//! splines, with no equations to satisfy. Between knots q is the quintic with q, q̇ and q̈ at both, and the integral is taken
//! by Gauss' rule of four points. Levenberg and Marquardt's method goes down from any motion; its normal equations couple
//! neighbouring knots only and are solved by Cholesky's factorisation of the band, O(K Q³) for K knots.

use nalgebra::{DMatrix, DVector};
use somersault_core::quadrature::GAUSS_4;

/// u with its derivatives by q, q̇ and q̈.
pub(crate) struct Torque {
    pub(crate) u: Vec<f64>,
    pub(crate) by: [DMatrix<f64>; 3],
}

impl Torque {
    fn new(degrees: usize) -> Self {
        Self { u: vec![0.0; degrees], by: std::array::from_fn(|_| DMatrix::zeros(degrees, degrees)) }
    }

    /// Gives every entry one value.
    pub(crate) fn fill(&mut self, value: f64) {
        self.u.fill(value);
        self.by.iter_mut().for_each(|by| by.fill(value));
    }
}

/// What gives the torques of a motion.
pub(super) trait Driven {
    /// γ of each torque.
    fn weights(&self) -> Vec<f64>;

    /// Writes the torque of `motion`, that is q, q̇ and q̈ one after the other.
    fn torque_into(&self, motion: &[f64], torque: &mut Torque);
}

/// Part of an interval over which λ̇_v is taken.
const SIDE: f64 = 1e-3;

/// A motion by its knots.
pub(super) struct Spline {
    pub(super) degrees: usize,
    pub(super) times: Vec<f64>,
    /// q, q̇ and q̈ of each knot, one after the other.
    pub(super) knots: Vec<f64>,
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

impl Spline {
    /// Writes q, q̇ and q̈ in interval `k` at s in [0, 1].
    pub(super) fn at(&self, k: usize, s: f64, motion: &mut [f64]) {
        self.shaped(k, &shapes(s, self.times[k + 1] - self.times[k]), motion);
    }

    fn shaped(&self, k: usize, shapes: &[[f64; 6]; 3], motion: &mut [f64]) {
        let q = self.degrees;
        let knots = &self.knots[3 * q * k..3 * q * (k + 2)];
        for (row, out) in shapes.iter().zip(motion.chunks_exact_mut(q)) {
            out.fill(0.0);
            for (shape, values) in row.iter().zip(knots.chunks_exact(q)) {
                out.iter_mut().zip(values).for_each(|(out, value)| *out += shape * value);
            }
        }
    }

    /// Goes down to less effort ½ ∫ Σ γᵢuᵢ² with q and q̇ held at both ends until a step wins less than a part `enough`, and
    /// returns the steps made.
    pub(super) fn descend(
        &mut self,
        driven: &impl Driven,
        enough: f64,
        max_steps: usize,
        goes_on: impl Fn() -> bool,
    ) -> usize {
        let q = self.degrees;
        let weights = driven.weights();
        let block = 3 * q;
        let size = self.knots.len();
        let held = |i: usize| i < 2 * q || (i >= size - block && i < size - q);
        let points = self.points();
        let (mut torque, mut motion) = (Torque::new(q), vec![0.0; block]);
        let mut cost_of = |spline: &Self| {
            let mut cost = 0.0;
            for Point { k, weight, shapes } in &points {
                spline.shaped(*k, shapes, &mut motion);
                driven.torque_into(&motion, &mut torque);
                cost += 0.5 * weight * weights.iter().zip(&torque.u).map(|(g, u)| g * u * u).sum::<f64>();
            }
            cost
        };
        let mut cost = cost_of(self);
        let mut damping = 1e-3;
        let mut band = Band::new(size, 2 * block);
        let (mut torque, mut motion) = (Torque::new(q), vec![0.0; block]);
        let (mut gradient, mut move_by) = (vec![0.0; size], vec![0.0; size]);
        // u by the twice three vectors of an interval, column by column, and one of the columns weighed
        let (mut slopes, mut weighed) = (vec![0.0; 2 * block * q], vec![0.0; q]);
        let mut trial = Self { degrees: q, times: self.times.clone(), knots: self.knots.clone() };
        for step in 0..max_steps {
            if !goes_on() {
                return step;
            }
            band.clear();
            gradient.fill(0.0);
            for Point { k, weight: w, shapes } in &points {
                self.shaped(*k, shapes, &mut motion);
                driven.torque_into(&motion, &mut torque);
                for (j, slope) in slopes.chunks_exact_mut(q * q).enumerate() {
                    slope.fill(0.0);
                    for (by, shapes) in torque.by.iter().zip(shapes) {
                        slope.iter_mut().zip(by.iter()).for_each(|(sum, by)| *sum += by * shapes[j]);
                    }
                }
                for (a, column) in slopes.chunks_exact(q).enumerate() {
                    for (weighed, (slope, weight)) in weighed.iter_mut().zip(column.iter().zip(&weights)) {
                        *weighed = slope * (w * weight);
                    }
                    gradient[k * block + a] += dot(&weighed, &torque.u);
                    let row = band.row_from(k * block + a, k * block);
                    for (entry, other) in row.zip(slopes.chunks_exact(q)) {
                        *entry += dot(&weighed, other);
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
                move_by.copy_from_slice(&gradient);
                if !band.solve_damped(damping, &mut move_by) {
                    damping *= 8.0;
                    continue;
                }
                for (moved, (knot, delta)) in trial.knots.iter_mut().zip(self.knots.iter().zip(&move_by)) {
                    *moved = knot - delta;
                }
                let tried = cost_of(&trial);
                if tried < cost {
                    cost = tried;
                    std::mem::swap(&mut self.knots, &mut trial.knots);
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
    pub(super) fn nodes(&self, driven: &impl Driven) -> Vec<DVector<f64>> {
        let q = self.degrees;
        let weights = DVector::from_vec(driven.weights());
        // λ_v, and C_vᵀμ
        let costates = |motion: &[f64]| {
            let mut torque = Torque::new(q);
            driven.torque_into(motion, &mut torque);
            let Torque { u, by: [_, rate, inertia] } = torque;
            let mu = -DVector::from_vec(u).component_mul(&weights);
            [inertia * &mu, rate.tr_mul(&mu)]
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
            let mut motion = vec![0.0; 3 * q];
            let [[first, _], [last, _]] = [(early, before), (late, after)].map(|(k, s)| {
                self.at(k, s, &mut motion);
                costates(&motion)
            });
            let rate = (last - first) / (time(late, after) - time(early, before));
            let knot = &self.knots[3 * q * k..3 * q * (k + 1)];
            let [of_rates, of_angles] = costates(knot);
            let costates = (of_angles - rate).into_iter().chain(&of_rates).copied().collect::<Vec<_>>();
            DVector::from_iterator(4 * q, knot[..2 * q].iter().copied().chain(costates))
        };
        (0..self.times.len()).map(node).collect()
    }

    /// The points of the rule.
    fn points(&self) -> Vec<Point> {
        let lengths = self.times.windows(2).map(|t| t[1] - t[0]).enumerate();
        let points = |(k, h)| GAUSS_4.map(|(s, w)| Point { k, weight: w * h, shapes: shapes(s, h) });
        lengths.flat_map(points).collect()
    }
}

/// A point of the rule: its interval, its weight and the quintics there.
struct Point {
    k: usize,
    weight: f64,
    shapes: [[f64; 6]; 3],
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

    /// The entries of row `i` in columns `first` to `i`.
    fn row_from(&mut self, i: usize, first: usize) -> impl Iterator<Item = &mut f64> {
        self.rows[i * self.width..][..=i - first].iter_mut().rev()
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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
