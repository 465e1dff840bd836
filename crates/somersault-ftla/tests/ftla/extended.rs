//! The exponents of the thesis' arm in 32 digits, by nothing that the library computes them with: as
//! `tests/reference/exponents.py`, state and transition matrix are dual numbers, integrated by Gragg's rule with
//! extrapolation; a plain decomposition then keeps all singular values. sin θ₂ and cos θ₂ are states of their own.

use nalgebra::DVector;
use somersault_core::double_double::DoubleDouble as Wide;
use std::ops::{Add, Mul, Sub};

const N: usize = 8;

/// A value, and its derivatives along the columns of Φ.
#[derive(Clone, Copy)]
struct Dual([Wide; N + 1]);

impl Dual {
    fn constant(x: f64) -> Self {
        let mut dual = Self([Wide::default(); N + 1]);
        dual.0[0] = Wide::from(x);
        dual
    }

    fn scaled(self, by: Wide) -> Self {
        Self(self.0.map(|x| x * by))
    }

    fn inverse(self) -> Self {
        let value = Wide::from(1.0) / self.0[0];
        let mut inverse = self.scaled(-(value * value));
        inverse.0[0] = value;
        inverse
    }
}

impl Add for Dual {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl Sub for Dual {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Mul for Dual {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.0[0], other.0[0]);
        Self(std::array::from_fn(|i| if i == 0 { a * b } else { self.0[i] * b + a * other.0[i] }))
    }
}

/// p, sin θ₂ and cos θ₂.
type State = [Dual; N + 2];

/// The field at Table 8.1, c₂ = 0, γ = (1, ½).
fn field(p: &State) -> State {
    let k = |x: f64, dual: Dual| dual.scaled(Wide::from(x));
    let [_, _, w1, w2, l1, l2, l3, l4, sin, cos] = *p;
    let none = Dual::constant(0.0);
    // d = m₂l₂²/3, b = m₂l₁l₂/2 = ¼
    let small = Wide::from(0.125) / Wide::from(3.0);
    let (mut d, mut m11) = (none, k(0.5, cos));
    d.0[0] = small;
    m11.0[0] = m11.0[0] + Wide::from(8.0) / Wide::from(3.0) + small;
    let (b_sin, b_cos) = (k(0.25, sin), k(0.25, cos));
    let m12 = b_cos + d;
    let inverse = (m11 * d - m12 * m12).inverse();
    let mu1 = (d * l3 - m12 * l4) * inverse;
    let mu2 = (m11 * l4 - m12 * l3) * inverse;
    let (swing, square) = (w2 * (k(2.0, w1) + w2), w1 * w1);
    let r1 = b_sin * swing - mu1 - k(0.2, w1);
    let r2 = none - k(2.0, mu2) - b_sin * square;
    let a1 = (d * r1 - m12 * r2) * inverse;
    let a2 = (m11 * r2 - m12 * r1) * inverse;
    let turn = mu2 * (b_cos * square - b_sin * a1) - mu1 * (b_sin * (k(2.0, a1) + a2) + b_cos * swing);
    let twice = k(2.0, b_sin);
    let rate1 = mu1 * (Dual::constant(0.2) - twice * w2) + mu2 * (twice * w1) - l1;
    let rate2 = none - mu1 * (twice * (w1 + w2)) - l2;
    [w1, w2, a1, a2, none, turn, rate1, rate2, cos * w2, none - sin * w2]
}

fn along(p: &State, h: Wide, rate: &State) -> State {
    std::array::from_fn(|i| p[i] + rate[i].scaled(h))
}

/// Gragg's rule with 2, 4, … 28 substeps, extrapolated in h².
fn step(p: &State, h: Wide) -> State {
    let start = field(p);
    let mut table: Vec<State> = Vec::new();
    for k in 1..=14 {
        let part = h / Wide::from(2.0 * k as f64);
        let (mut old, mut new) = (*p, along(p, part, &start));
        for _ in 1..2 * k {
            let next = along(&old, part + part, &field(&new));
            (old, new) = (new, next);
        }
        table.push(new);
        for j in (0..k - 1).rev() {
            let ratio = Wide::from(k as f64) / Wide::from((j + 1) as f64);
            let weight = Wide::from(1.0) / (ratio * ratio - Wide::from(1.0));
            let finer = table[j + 1];
            table[j] = std::array::from_fn(|i| finer[i] + (finer[i] - table[j][i]).scaled(weight));
        }
    }
    table[0]
}

/// sin and cos by their series.
fn sin_cos(x: f64) -> [Wide; 2] {
    let (mut sums, mut term) = ([Wide::default(), Wide::from(1.0)], Wide::from(1.0));
    for k in 1..60 {
        term = term * Wide::from(x) / Wide::from(k as f64);
        let sum = &mut sums[(k + 1) % 2];
        *sum = if k % 4 < 2 { *sum + term } else { *sum - term };
    }
    sums
}

/// Exponents over `duration`, which may be negative, in ascending order of their singular values.
pub(crate) fn exponents(p: &DVector<f64>, duration: f64) -> [f64; N] {
    let mut state: State = std::array::from_fn(|i| Dual::constant(if i < N { p[i] } else { 0.0 }));
    (0..N).for_each(|i| state[i].0[i + 1] = Wide::from(1.0));
    let [sin, cos] = sin_cos(p[1]);
    (state[8].0[0], state[8].0[2]) = (sin, cos);
    (state[9].0[0], state[9].0[2]) = (cos, -sin);
    let steps = (duration.abs() / 0.1).ceil();
    let h = Wide::from(duration) / Wide::from(steps);
    (0..steps as usize).for_each(|_| state = step(&state, h));
    let mut columns: [[Wide; N]; N] = std::array::from_fn(|j| std::array::from_fn(|i| state[i].0[j + 1]));
    orthogonalise(&mut columns);
    let mut found = columns.map(|c| dot(&c, &c).sqrt().hi.ln() / duration.abs());
    found.sort_by(f64::total_cmp);
    found
}

fn dot(a: &[Wide; N], b: &[Wide; N]) -> Wide {
    a.iter().zip(b).fold(Wide::default(), |sum, (a, b)| sum + *a * *b)
}

/// Rotates columns until they are orthogonal (Jacobi): their lengths are the singular values.
fn orthogonalise(columns: &mut [[Wide; N]; N]) {
    let one = Wide::from(1.0);
    for _ in 0..30 {
        for (i, j) in (0..N).flat_map(|j| (0..j).map(move |i| (i, j))) {
            let (a, b) = (columns[i], columns[j]);
            let (squares, product) = ([dot(&a, &a), dot(&b, &b)], dot(&a, &b));
            if product.abs().hi <= 1e-31 * (squares[0].hi * squares[1].hi).sqrt() {
                continue;
            }
            let zeta = (squares[1] - squares[0]) / (product + product);
            let size = one / (zeta.abs() + (one + zeta * zeta).sqrt());
            let t = if zeta.hi < 0.0 { -size } else { size };
            let c = one / (one + t * t).sqrt();
            for k in 0..N {
                columns[i][k] = c * (a[k] - t * b[k]);
                columns[j][k] = c * (t * a[k] + b[k]);
            }
        }
    }
}
