//! Adapted steps of bodies under forces that are sums of terms, for a tile of bodies at once: each body has steps of its own size.
//!
//! A step is that of `rkmk8_b`, [`RungeKuttaMuntheKaas`](crate::methods::RungeKuttaMuntheKaas) with the tableau of DOP853 in the body frame,
//! whose brackets are −a × b:
//!
//! ```text
//! u_i = h Σ_{j<i} a_ij K_j,   K_i = ω_i + ½ u_i × ω_i + c(|u_i|) u_i × (u_i × ω_i),   c(θ) = (1 − θ/2 cot θ/2)/θ²
//! ```
//!
//! # Cost
//!
//! 12 evaluations, exponentials and products of quaternions, and 900 multiplications with additions for the sums of slopes.

use super::forced::{Moving, Stage, States};
use super::rows::{
    Row, TILE, cos_sinc, cross, dot, moved, one, polynomial, product, renormalise, scaled, sum,
};
use crate::state::Tolerances;
use crate::tableau::Tableau;
use somersault_core::lanes::{Kernel, Lanes, WIDEST};

/// Stages of DOP853.
const STAGES: usize = 12;

/// c(θ) of θ² below 1: |B₂ₖ|/(2k)! with Bernoulli's numbers.
const SERIES: [f64; 11] = [
    1.0 / 12.0,
    1.0 / 720.0,
    1.0 / 30_240.0,
    1.0 / 1_209_600.0,
    1.0 / 47_900_160.0,
    691.0 / 1_307_674_368_000.0,
    1.0 / 74_724_249_600.0,
    3617.0 / 10_670_622_842_880_000.0,
    43_867.0 / 5_109_094_217_170_944_000.0,
    174_611.0 / 802_857_662_698_291_200_000.0,
    77_683.0 / 14_101_100_039_391_805_440_000.0,
];

/// One number of each of the bodies of a vector.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Entries([f64; WIDEST]);

/// K, the velocity, the acceleration and the angular acceleration at a stage.
type Slope = [[Entries; 3]; 4];

/// Bodies of a tile, and what their adapted steps need.
pub(super) struct AdaptedTile<'a> {
    pub(super) bodies: Moving<'a>,
    /// When each body is where it is.
    pub(super) t: Row,
    /// The step of each body that is tried next, and where it led.
    pub(super) h: Row,
    next: States,
    /// The estimates e₁ and e₂ of its error, weighed by the tolerances.
    errors: [Row; 2],
    tolerances: Tolerances,
    slopes: [Slope; STAGES],
}

impl<'a> AdaptedTile<'a> {
    /// A tile of bodies whose steps are of no size.
    pub(super) fn new(bodies: Moving<'a>, tolerances: Tolerances) -> Self {
        let row = Row([0.0; TILE]);
        Self {
            bodies,
            t: row,
            h: row,
            next: States::new(),
            errors: [row; 2],
            tolerances,
            slopes: [[[Entries([0.0; WIDEST]); 3]; 4]; STAGES],
        }
    }

    /// The error of the step of the body in entry `at` that was tried, weighed by the tolerances: Hairer's combination, of order 7 where the
    /// two estimates are of orders 5 and 3.
    pub(super) fn error(&self, at: usize) -> f64 {
        let [main, correction] = self.errors.each_ref().map(|row| row.0[at]);
        let ratio = if main > 0.0 { 0.1 * correction / main } else { 0.0 };
        main / (1.0 + ratio * ratio).sqrt()
    }

    /// Moves the body in entry `at` by the step that was tried.
    pub(super) fn accept(&mut self, at: usize) {
        self.bodies.states.take(at, &self.next);
    }
}

/// A step of each body of a tile, tried.
impl Kernel for &mut AdaptedTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let AdaptedTile { bodies, t, h, next, errors, tolerances, slopes } = self;
        let (tableau, weights) = Tableau::dop853();
        let unit = l.splat(1.0);
        for at in (0..TILE).step_by(L::WIDTH) {
            let (x, t, h) = (bodies.states.load(l, at), one(l, t, at), one(l, h, at));
            for i in 0..STAGES {
                let moves = sums(l, tableau.row(i), slopes, h);
                let (stage, [c, s]) = displaced(l, &x, moves);
                let u = moves[0];
                let now = l.mul_add(h, l.splat(tableau.node(i)), t);
                let [acceleration, spin_up] = bodies.accelerations(l, at, now, &stage);
                // θ/2 cot θ/2 = c/s
                let square = dot(l, u, u);
                let closed = l.div(l.sub(unit, l.div(c, s)), square);
                let factor = l.select(l.less(square, unit), polynomial(l, square, SERIES), closed);
                let bracket = cross(l, u, stage.omega);
                let k = moved(l, l.splat(0.5), bracket, stage.omega);
                let k = moved(l, factor, cross(l, u, bracket), k);
                for (entries, x) in slopes[i].iter_mut().zip([k, stage.v, acceleration, spin_up]) {
                    for (entries, x) in entries.iter_mut().zip(x) {
                        l.store(x, &mut entries.0[..L::WIDTH]);
                    }
                }
            }
            let (mut after, _) = displaced(l, &x, sums(l, tableau.weights(), slopes, h));
            after.q = renormalise(l, after.q);
            next.store(l, at, &after);
            let estimates = [Some(weights.main()), weights.correction()];
            for (row, estimate) in errors.iter_mut().zip(estimates.into_iter().flatten()) {
                let [turn, way, gain, spin_gain] = sums(l, estimate, slopes, h);
                let size = |x, after| l.sqrt(l.max(dot(l, x, x), dot(l, after, after)));
                let mut squares = l.splat(0.0);
                for (error, size) in [
                    (way, size(x.r, after.r)),
                    (turn, unit),
                    (gain, size(x.v, after.v)),
                    (spin_gain, size(x.omega, after.omega)),
                ] {
                    let scale = l.mul_add(l.splat(tolerances.relative), size, l.splat(tolerances.absolute));
                    squares = l.add(squares, l.div(dot(l, error, error), l.mul(scale, scale)));
                }
                l.store(l.sqrt(l.mul(squares, l.splat(0.25))), &mut row.0[at..at + L::WIDTH]);
            }
        }
    }
}

/// The stage to which a turn and the changes of position, velocity and angular velocity lead from x, with ±cos and ±sin(y)/y of half the
/// turn.
#[inline(always)]
fn displaced<L: Lanes>(
    l: L,
    x: &Stage<L>,
    [turn, way, gain, spin_gain]: [[L::Vector; 3]; 4],
) -> (Stage<L>, [L::Vector; 2]) {
    let half = scaled(l, l.splat(0.5), turn);
    let [c, s] = cos_sinc(l, dot(l, half, half));
    let [a, b, d] = scaled(l, s, half);
    let stage = Stage {
        r: sum(l, x.r, way),
        v: sum(l, x.v, gain),
        q: product(l, x.q, [c, a, b, d]),
        omega: sum(l, x.omega, spin_gain),
    };
    (stage, [c, s])
}

/// h Σ aⱼ slopeⱼ
#[inline(always)]
fn sums<L: Lanes>(l: L, row: &[(usize, f64)], slopes: &[Slope; STAGES], h: L::Vector) -> [[L::Vector; 3]; 4] {
    let mut sums = [[l.splat(0.0); 3]; 4];
    for &(j, a) in row {
        let a = l.splat(a);
        for (sums, slope) in sums.iter_mut().zip(&slopes[j]) {
            for (sum, entries) in sums.iter_mut().zip(slope) {
                *sum = l.mul_add(a, l.load(&entries.0[..L::WIDTH]), *sum);
            }
        }
    }
    for sums in &mut sums {
        *sums = scaled(l, h, *sums);
    }
    sums
}
