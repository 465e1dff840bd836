//! Radau IIA method of order 5 in the algebra, for stiff springs and dampers: contacts of light feet, stiff joints.
//!
//! ```text
//! u_i = h Σ_j a_ij K_j,   q_i = exp(u_i) qₙ,   p_i = pₙ + h Σ_j a_ij A_j,   c = (4 − √6)/10, (4 + √6)/10, 1,
//! K_i = dexp⁻¹_{u_i}(velocity(tₙ + c_i h, q_i, p_i)),   A_i = acceleration(tₙ + c_i h, q_i, p_i),
//! q₊ = q₃,   p₊ = p₃
//! ```
//! Order 5 on ℝ³ and on SO(3), and L-stable: a step may be far longer than the times of springs and dampers, whose motion dies
//! away in it, and the slow motion is followed with order 5. Curve: the collocation polynomial, of order 4 within a step.
//! No start-up. A step of a free body that turns by θ is off by 0.002 θ⁶ rad at most.
//!
//! The stages are solved for by Newton's iteration with the derivatives of the acceleration at the start of the step
//! ([`System::partials`]), transformed so that one real and one complex matrix of the size of a rate is factored: the
//! displacements are eliminated by u̇ = δp. What velocities do besides, as the brackets of rotations, is left to the iteration.
//! It starts from the polynomial of the step before, and ends where the next change would be below a rounding, or moves nothing by
//! a rounding of the configuration, as those of a body at rest. Where it does not, an adapted step is made shorter, and a fixed
//! one is divided where events are located and refused otherwise.
//!
//! The error is estimated as in RADAU5, with order 3, and filtered by the real matrix. Conserves nothing exactly. Explicit
//! methods are quicker wherever the springs are resolved anyway.
//!
//! E. Hairer and G. Wanner, *Solving Ordinary Differential Equations II* (1996), IV.5 and IV.8; on groups as
//! [`RungeKuttaMuntheKaas`](super::RungeKuttaMuntheKaas).
//!
//! # Deviations
//! In the algebra, with dexp⁻¹ in closed form. The derivatives are those at the start of each step, and the iteration ends at
//! round-off, so that events can be located on the steps. Its rest is that of Z = h A F(Z), which is exact to a rounding at the
//! solution, and not that of the transformed equations. The second form of RADAU5's estimate after a rejected step is left out.

use crate::dense::{Interpolant, Segment};
use crate::iteration::is_rounding;
use crate::lu::Factors;
use crate::partials::Partials;
use crate::state::{Configuration, ErrorSum, Rate, Tolerances};
use crate::stepper::{EmbeddedStepper, MethodInfo, Scheme, StepError, Stepper, weighed_error};
use crate::system::{RateOf, StateOf, System};
use nalgebra::{Complex, DMatrix, DVectorView, DVectorViewMut};
use std::sync::LazyLock;

register! {
    430 => Radau5: RadauIia, any, embedded;
}

/// Radau IIA method of order 5.
#[derive(Debug, Clone, Copy, Default)]
pub struct RadauIia;

impl Scheme for RadauIia {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 3,
        embedded: Some(3),
        dense_order: 4,
        implicit: true,
        l_stable: true,
        limitations: "unsuitable where springs and dampers are resolved anyway, and for energy that must not drift: it damps what its steps do \
                      not resolve; a turn of 2π or more in a step",
        ..MethodInfo::explicit(
            "radau5",
            "Radau IIA, order 5",
            "E. Hairer and G. Wanner, Solving Ordinary Differential Equations II (1996), IV.8",
            5,
        )
    };
}

/// Iterations after which a step counts as too large.
const MAX_ITERATIONS: usize = 40;
/// Iterations whose changes do not halve after which what moves nothing by a rounding is taken for round-off, and what grows for
/// divergence.
const PATIENCE: usize = 2;
/// Changes no longer falling are taken for round-off below this, relative to the unknowns.
const ROUND_OFF: f64 = 1e-11;

/// The numbers of the method.
struct Scales {
    nodes: [f64; 3],
    matrix: [[f64; 3]; 3],
    /// The eigenvalues of the inverse of the matrix of the method.
    real: f64,
    complex: Complex<f64>,
    /// Stages from transformed ones, and back.
    transform: [[f64; 3]; 3],
    inverse: [[f64; 3]; 3],
    /// Weights of the stages in the estimate of the error.
    error: [f64; 3],
    /// Coefficients of θ, θ², θ³ from the stages.
    powers: [[f64; 3]; 3],
}

static SCALES: LazyLock<Scales> = LazyLock::new(|| {
    let root = 6f64.sqrt();
    let (cube, square) = (81f64.cbrt(), 9f64.cbrt());
    let gamma = 30.0 / (6.0 + cube - square);
    let (alpha, beta) = ((12.0 - cube + square) / 60.0, (cube + square) * 3f64.sqrt() / 60.0);
    let size = alpha * alpha + beta * beta;
    let nodes = [(4.0 - root) / 10.0, (4.0 + root) / 10.0, 1.0];
    let matrix = [
        [(88.0 - 7.0 * root) / 360.0, (296.0 - 169.0 * root) / 1800.0, (-2.0 + 3.0 * root) / 225.0],
        [(296.0 + 169.0 * root) / 1800.0, (88.0 + 7.0 * root) / 360.0, (-2.0 - 3.0 * root) / 225.0],
        [(16.0 - root) / 36.0, (16.0 + root) / 36.0, 1.0 / 9.0],
    ];
    // Lagrange's polynomials through 0 and the nodes.
    let mut powers = [[0.0; 3]; 3];
    for (j, c) in nodes.iter().enumerate() {
        let (a, b) = (nodes[(j + 1) % 3], nodes[(j + 2) % 3]);
        let scale = 1.0 / (c * (c - a) * (c - b));
        for (row, coefficient) in powers.iter_mut().zip([a * b, -(a + b), 1.0]) {
            row[j] = coefficient * scale;
        }
    }
    Scales {
        nodes,
        matrix,
        real: gamma,
        complex: Complex::new(alpha / size, beta / size),
        transform: [
            [9.123_239_487_089_294e-2, -0.141_255_295_020_954_2, -3.002_919_410_514_742_4e-2],
            [0.241_717_932_707_107, 0.204_129_352_293_8, 0.382_942_112_757_261_9],
            [0.966_048_182_615_093, 1.0, 0.0],
        ],
        inverse: [
            [4.325_579_890_063_155, 0.339_199_251_815_809_87, 0.541_770_539_935_874_9],
            [-4.178_718_591_551_905, -0.327_682_820_761_062_4, 0.476_623_554_500_550_45],
            [-0.502_872_634_945_786_9, 2.571_926_949_855_605, -0.596_039_204_828_224_9],
        ],
        error: [-(13.0 + 7.0 * root) / 3.0, (-13.0 + 7.0 * root) / 3.0, -1.0 / 3.0],
        powers,
    }
});

/// Displacements and changes of the rate, or the slopes of both: numbers of rates with their tangents.
#[derive(Debug, Clone)]
struct Part {
    displacement: Vec<f64>,
    change: Vec<f64>,
}

impl Part {
    fn zeros(length: usize) -> Self {
        Self { displacement: vec![0.0; length], change: vec![0.0; length] }
    }

    fn both(&self) -> [&[f64]; 2] {
        [&self.displacement, &self.change]
    }

    fn both_mut(&mut self) -> [&mut [f64]; 2] {
        [&mut self.displacement, &mut self.change]
    }

    /// self ← Σ a x.
    fn set_sum(&mut self, terms: &[(f64, &Self)]) {
        for (which, out) in self.both_mut().into_iter().enumerate() {
            out.fill(0.0);
            for (a, x) in terms {
                out.iter_mut().zip(x.both()[which]).for_each(|(out, x)| *out += a * x);
            }
        }
    }
}

/// out ← out + a A x.
fn add_product(a: f64, matrix: &DMatrix<f64>, x: &[f64], out: &mut [f64]) {
    let n = x.len();
    DVectorViewMut::from_slice(out, n).gemv(a, matrix, &DVectorView::from_slice(x, n), 1.0);
}

/// What the stages are guessed from.
#[derive(Debug, Clone, Copy)]
enum Past {
    /// Nothing.
    None,
    /// A step of this length that led to the state.
    Before(f64),
    /// A step of this length from the state, which was taken back.
    Same(f64),
}

/// The equations of the stages, and their solution.
#[derive(Debug, Clone)]
struct Stages {
    real: Factors<f64>,
    complex: Factors<Complex<f64>>,
    /// Of which step.
    factored: Option<f64>,
    stages: [Part; 3],
    slopes: [Part; 3],
    /// The last changes of the stages.
    changes: [Part; 3],
    /// Velocity and acceleration at the start of the step.
    start: Part,
    complex_right: Vec<Complex<f64>>,
    past: Past,
}

impl Stages {
    /// Room for rates of n numbers and as many for each tangent.
    fn new(n: usize, tangents: usize) -> Self {
        let length = n * (1 + tangents);
        let parts = || std::array::from_fn(|_| Part::zeros(length));
        Self {
            real: Factors::new(n),
            complex: Factors::new(n),
            factored: None,
            stages: parts(),
            slopes: parts(),
            changes: parts(),
            start: Part::zeros(length),
            complex_right: vec![Complex::new(0.0, 0.0); n],
            past: Past::None,
        }
    }

    /// Factors the matrices s − ∂ṗ/∂p − (∂ṗ/∂q)/s of a step of h, and says whether they are regular.
    fn factor<Q: Configuration>(&mut self, partials: &Partials<Q>, h: f64) -> bool {
        if self.factored == Some(h) {
            return true;
        }
        let (by_displacement, by_rate) = (partials.by_displacement(), partials.by_rate());
        let (s, z) = (SCALES.real / h, SCALES.complex / h);
        let is_regular = self
            .real
            .factor(|i, k| f64::from(u8::from(i == k)) * s - by_rate[(i, k)] - by_displacement[(i, k)] / s)
            && self.complex.factor(|i, k| {
                z * f64::from(u8::from(i == k)) - by_rate[(i, k)] - Complex::from(by_displacement[(i, k)]) / z
            });
        self.factored = is_regular.then_some(h);
        is_regular
    }

    /// The first stages of a step of h.
    fn guess(&mut self, h: f64) {
        let Self { stages, start, past, changes, .. } = self;
        let Scales { nodes, powers, .. } = &*SCALES;
        match *past {
            Past::None => {
                for (stage, node) in stages.iter_mut().zip(nodes) {
                    let moved = stage.displacement.iter_mut().zip(&start.displacement);
                    moved.for_each(|(u, v)| *u = node * h * v);
                    stage.change.fill(0.0);
                }
            }
            Past::Before(last) | Past::Same(last) => {
                let origin = if matches!(past, Past::Before(_)) { 1.0 } else { 0.0 };
                for (new, node) in changes.iter_mut().zip(nodes) {
                    let theta = origin + node * h / last;
                    let weight = |j: usize| {
                        (0..3).map(|k| powers[k][j] * (theta.powi(k as i32 + 1) - origin)).sum::<f64>()
                    };
                    new.set_sum(&[(weight(0), &stages[0]), (weight(1), &stages[1]), (weight(2), &stages[2])]);
                }
                std::mem::swap(stages, changes);
            }
        }
    }

    /// One iteration, from the slopes at the stages: changes them, and leaves their changes.
    ///
    /// With the rest r = h A F − Z of the equations, (A⁻¹/h − J) ΔZ = A⁻¹ r/h; divided by T it is real and complex.
    fn correct<Q: Configuration>(&mut self, partials: &Partials<Q>, h: f64) {
        let Self { real, complex, stages, slopes, changes, complex_right, .. } = self;
        let Scales { matrix, real: gamma, complex: root, transform, inverse, .. } = &*SCALES;
        let (s, z) = (gamma / h, root / h);
        let n = complex_right.len();
        let by_displacement = partials.by_displacement();
        for ((row, stage), out) in matrix.iter().zip(&*stages).zip(&mut *changes) {
            let [a, b, c] = row.map(|a| h * a);
            out.set_sum(&[(a, &slopes[0]), (b, &slopes[1]), (c, &slopes[2]), (-1.0, stage)]);
        }
        // The slopes are spent, and make room.
        for (row, out) in inverse.iter().zip(&mut *slopes) {
            out.set_sum(&[(row[0], &changes[0]), (row[1], &changes[1]), (row[2], &changes[2])]);
        }
        let [first, second, third] = &mut *slopes;
        for at in (0..first.change.len()).step_by(n).map(|at| at..at + n) {
            // s δu − δp = s r, s δp − (∂ṗ/∂q) δu − (∂ṗ/∂p) δp = s r', whose δu = r + δp/s.
            let (u, p) = (&mut first.displacement[at.clone()], &mut first.change[at.clone()]);
            p.iter_mut().for_each(|p| *p *= s);
            add_product(1.0, by_displacement, u, p);
            real.solve(p);
            u.iter_mut().zip(&*p).for_each(|(u, p)| *u += p / s);
            // Likewise with the complex z.
            let (u, p) = (&mut second.displacement[at.clone()], &mut second.change[at.clone()]);
            let (v, q) = (&mut third.displacement[at.clone()], &mut third.change[at]);
            for (p, q) in p.iter_mut().zip(&mut *q) {
                let product = z * Complex::new(*p, *q);
                (*p, *q) = (product.re, product.im);
            }
            add_product(1.0, by_displacement, u, p);
            add_product(1.0, by_displacement, v, q);
            complex_right.iter_mut().zip(p.iter().zip(&*q)).for_each(|(x, (p, q))| *x = Complex::new(*p, *q));
            complex.solve(complex_right);
            for (i, change) in complex_right.iter().enumerate() {
                let moved = change / z;
                (p[i], q[i]) = (change.re, change.im);
                (u[i], v[i]) = (u[i] + moved.re, v[i] + moved.im);
            }
        }
        for (row, out) in transform.iter().zip(&mut *changes) {
            out.set_sum(&[(row[0], &slopes[0]), (row[1], &slopes[1]), (row[2], &slopes[2])]);
        }
        for (stage, change) in stages.iter_mut().zip(&*changes) {
            for (stage, change) in stage.both_mut().into_iter().zip(change.both()) {
                stage.iter_mut().zip(change).for_each(|(stage, change)| *stage += change);
            }
        }
    }

    /// The estimate of the error of a step of h, in the numbers of a rate and its tangents, which have none.
    fn estimate<Q: Configuration>(&mut self, partials: &Partials<Q>, h: f64) -> &Part {
        let Self { real, stages, start, changes, complex_right, .. } = self;
        let Scales { real: gamma, error, .. } = &*SCALES;
        let (s, n) = (gamma / h, complex_right.len());
        let estimate = &mut changes[0];
        let terms = [0, 1, 2].map(|i| (error[i] / h, &stages[i]));
        estimate.set_sum(&[(1.0, start), terms[0], terms[1], terms[2]]);
        estimate.both_mut().into_iter().for_each(|numbers| numbers[n..].fill(0.0));
        let (u, p) = (&mut estimate.displacement[..n], &mut estimate.change[..n]);
        add_product(1.0 / s, partials.by_displacement(), u, p);
        real.solve(p);
        u.iter_mut().zip(&*p).for_each(|(u, p)| *u = (*u + p) / s);
        estimate
    }
}

/// The equations of the stages, and room to evaluate them.
pub struct RadauMemory<S: System> {
    workspace: S::Workspace,
    partials: Partials<S::Configuration>,
    /// Whether the start of the step is that of the derivatives.
    is_known: bool,
    equations: Stages,
    stage: StateOf<S>,
    displacement: RateOf<S>,
    slope: RateOf<S>,
}

impl<S: System> RadauMemory<S> {
    /// The slopes at the stages of a step of h from `x`.
    fn evaluate(&mut self, system: &S, t: f64, x: &StateOf<S>, h: f64) {
        let Self { workspace, equations, stage, displacement, slope, .. } = self;
        let Stages { stages, slopes, .. } = equations;
        for ((node, of), out) in SCALES.nodes.iter().zip(stages).zip(slopes) {
            let t = t + node * h;
            displacement.read(&of.displacement);
            slope.read(&of.change);
            stage.assign(x);
            stage.kick(slope, 1.0);
            stage.drift(displacement, 1.0);
            system.velocity(workspace, t, stage, slope);
            slope.dexp_inv(displacement);
            slope.write(&mut out.displacement);
            system.acceleration(workspace, t, stage, slope);
            slope.write(&mut out.change);
        }
    }

    /// The last changes of the stages, relative to the unknowns: each vector is measured by itself.
    fn size_of_changes(&mut self, x: &StateOf<S>) -> f64 {
        const BY_SIZE: Tolerances = Tolerances { relative: 1.0, absolute: 1e-140 };
        let Self { equations, stage, displacement, slope, .. } = self;
        let mut sum = ErrorSum::default();
        for (i, change) in equations.changes.iter().enumerate().rev() {
            displacement.read(&change.displacement);
            slope.read(&change.change);
            if i == 2 {
                // The last stage, as it is now: what starts from zero has the size that it came to.
                stage.kick(slope, 1.0);
                stage.drift(displacement, 1.0);
            }
            x.configuration.weigh_all(&stage.configuration, displacement, &BY_SIZE, &mut sum);
            x.rate.weigh_all(&stage.rate, slope, &BY_SIZE, &mut sum);
        }
        sum.root_mean_square()
    }

    /// Whether the last changes move nothing by a rounding in a step of h.
    fn moves_nothing(&mut self, x: &StateOf<S>, h: f64) -> bool {
        let Self { equations, stage, displacement, slope, .. } = self;
        equations.changes.iter().all(|change| {
            displacement.read(&change.displacement);
            slope.read(&change.change);
            slope.scale(h);
            is_rounding(&x.configuration, &stage.configuration, [&*displacement, &*slope])
        })
    }
}

impl<S: System> Stepper<S> for RadauIia {
    type Memory = RadauMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok(RadauMemory {
            workspace: system.workspace(),
            partials: Partials::new(x),
            is_known: false,
            equations: Stages::new(x.rate.dimension(), x.rate.tangents()),
            stage: x.clone(),
            displacement: x.rate.clone(),
            slope: x.rate.clone(),
        })
    }

    fn restart(&self, m: &mut Self::Memory) {
        (m.is_known, m.equations.past) = (false, Past::None);
    }

    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        if !m.is_known {
            let RadauMemory { workspace, partials, equations, slope, .. } = m;
            system.velocity(workspace, t, x, slope);
            slope.write(&mut equations.start.displacement);
            system.acceleration(workspace, t, x, slope);
            slope.write(&mut equations.start.change);
            system.partials(workspace, t, x, partials);
            equations.factored = None;
        }
        let unsolved = |iterations, residual| StepError::NotConverged {
            method: Self::INFO.name,
            t,
            iterations,
            residual,
        };
        // What a failure leaves is no guess.
        let past = std::mem::replace(&mut m.equations.past, Past::None);
        m.is_known = false;
        if !m.equations.factor(&m.partials, h) {
            return Err(unsolved(0, f64::NAN));
        }
        m.equations.past = past;
        m.equations.guess(h);
        m.equations.past = Past::None;
        let (mut iterations, mut stalled, mut last) = (0, 0, f64::NAN);
        loop {
            iterations += 1;
            m.evaluate(system, t, x, h);
            m.equations.correct(&m.partials, h);
            let change = m.size_of_changes(x);
            // Of the first change, that of what starts from zero is nearly all, and says little of the others.
            let contraction = if iterations > 2 { change / last } else { f64::NAN };
            let is_last = contraction * change < 0.1 * f64::EPSILON * (1.0 - contraction);
            if change <= f64::EPSILON || is_last {
                break;
            }
            stalled += usize::from(contraction > 0.5);
            let is_stalled = stalled >= PATIENCE;
            if (is_stalled || contraction > 0.5) && change <= ROUND_OFF || is_stalled && m.moves_nothing(x, h)
            {
                break;
            }
            let diverges = stalled > PATIENCE && contraction > 1.0;
            if change.is_nan() || diverges || iterations == MAX_ITERATIONS {
                return Err(unsolved(iterations, change));
            }
            last = change;
        }
        m.equations.past = Past::Before(h);
        let RadauMemory { equations, displacement, slope, .. } = m;
        let [_, _, end] = &equations.stages;
        displacement.read(&end.displacement);
        slope.read(&end.change);
        out.assign(x);
        out.drift(displacement, 1.0);
        out.kick(slope, 1.0);
        Ok(())
    }

    fn segment(
        &self,
        _: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        _: &StateOf<S>,
    ) -> Box<dyn Interpolant<S::Configuration>> {
        let curve = |numbers: fn(&Part) -> &[f64]| {
            let coefficient = |row: &[f64; 3]| {
                let mut sum = x.rate.clone();
                sum.set_zero();
                for (weight, stage) in row.iter().zip(&m.equations.stages) {
                    let mut part = x.rate.clone();
                    part.read(numbers(stage));
                    sum.axpy(*weight, &part);
                }
                sum
            };
            SCALES.powers.iter().map(coefficient).collect()
        };
        let [displacement, change] = [curve(|part| &part.displacement), curve(|part| &part.change)];
        Box::new(Segment { t, h, start: x.clone(), displacement, change })
    }
}

impl<S: System> EmbeddedStepper<S> for RadauIia {
    fn error(
        &self,
        x: &StateOf<S>,
        after: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        tolerances: &Tolerances,
    ) -> f64 {
        let RadauMemory { partials, equations, displacement, slope, .. } = m;
        let estimate = equations.estimate(partials, h);
        displacement.read(&estimate.displacement);
        slope.read(&estimate.change);
        weighed_error(x, after, displacement, slope, tolerances)
    }

    fn reject(&self, m: &mut Self::Memory) {
        m.is_known = true;
        if let Past::Before(h) = m.equations.past {
            m.equations.past = Past::Same(h);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    /// The collocation matrix has the eigenvalues and the transformation that are written here.
    #[test]
    fn the_transformation_divides_the_inverse_of_the_matrix() {
        let Scales { nodes, matrix: coefficients, real, complex, transform, inverse, .. } = &*SCALES;
        let matrix = |rows: &[[f64; 3]; 3]| Matrix3::from_fn(|i, j| rows[i][j]);
        // A by its collocation conditions: Σ_j a_ij c_j^k = c_i^(k+1)/(k+1).
        let powers = Matrix3::from_fn(|j, k| nodes[j].powi(k as i32));
        let sums = Matrix3::from_fn(|i, k| nodes[i].powi(k as i32 + 1) / (k as f64 + 1.0));
        let a = matrix(coefficients);
        assert!((a * powers - sums).amax() < 1e-15, "{a}");
        let divided = matrix(inverse) * a.try_inverse().unwrap() * matrix(transform);
        let expected =
            Matrix3::new(*real, 0.0, 0.0, 0.0, complex.re, -complex.im, 0.0, complex.im, complex.re);
        assert!((divided - expected).amax() < 1e-13, "{divided}");
        assert!((matrix(inverse) * matrix(transform) - Matrix3::identity()).amax() < 1e-14);
    }
}
