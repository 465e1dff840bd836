//! Stability regions of the translation, thesis 6.1: Table 6.1 and Figure 6.1.
//!
//! A method makes steps h = 1 of the equation with the roots λ and λ̄, λ = λ_R + iλ_I,
//!
//! ```text
//! ÿ = 2 λ_R ẏ − (λ_R² + λ_I²) y                                           (6.1)
//! ```
//!
//! and is stable where no root z of its characteristic equation lies outside the unit circle. The
//! equation is posed to the method as a unit mass on the x axis under [`TestForce`], so that any
//! [`Stepper`] can be studied, and the region can be scaled: a step h at the root λ is at hλ.
//!
//! # How the roots are found
//! The memory of a stepper is opaque, so the characteristic equation is not written down but observed. A
//! method that remembers K steps makes sequences (yₙ, ẏₙ) that obey a linear recurrence over K + 1 steps:
//! with zₙ = (yₙ, ẏₙ, …, yₙ₊K, ẏₙ₊K) there is a matrix A with zₙ₊₁ = A zₙ. Several trajectories give columns
//! Z₀, Z₁ with Z₁ = A Z₀. Gram–Schmidt on the columns of Z₀, longest first and until 1e-10 of the longest,
//! makes of them an orthonormal Q, and the same operations make of Z₁ the images A Q; the roots are the
//! eigenvalues of QᵀAQ. What is cut are modes that have decayed, which do not decide stability. During the
//! first 2(K + 1) steps, the start-up among them, a pulse of force that differs from trajectory to
//! trajectory excites all modes that forces can excite; from then on the equation is (6.1). Two columns more
//! than unknowns show whether the recurrence holds: where it does not, within 1e-6 of the largest number,
//! that is [`StudyError::NotLinear`]. Without history A is read off two trajectories.
//!
//! # Roots on the unit circle
//! A simple root on the unit circle neither grows nor decays: λ is counted in where the spectral radius is
//! at most 1 + 1e-9. So semi-implicit Euler keeps its interval of the imaginary axis; and Störmer–Verlet,
//! whose velocity line (algorithm 7) adds the root z = 1 everywhere (the velocity may be off by a constant
//! that the position does not see), keeps the region of its position, which is what the thesis counts. On
//! λ_I = 0 roots are double, so that the spectral radius has about eight digits there.
//!
//! # Implicit methods
//! A step whose equation is not solved counts as outside, as does a λ at which an iteration stopped so
//! early that the recurrence does not hold; [`StabilityRegion::failed`] counts both. The region is then that
//! of the method with its solver. A region that reaches 20π in either coordinate is reported as unbounded.
//!
//! # Cost
//! A spectral radius takes three steps, and under a microsecond, without history, and some 10² steps, tens of
//! microseconds, with three remembered steps. A region takes some 10⁴ of them, on all cores.

use super::{Progress, StudyError, report};
use crate::body::RigidBody;
use crate::force::{ForceModel, Wrench};
use crate::methods::{Method, Options, Visitor};
use crate::series::WrenchTerm;
use crate::state::{Pose, RigidBodyState};
use crate::stepper::{StepError, Stepper};
use crate::system::{Decoder, Form, RigidBodySystem, StateOf, System, Unchanged};
use nalgebra::{DMatrix, Matrix3, Schur, Vector3};
use rayon::prelude::*;
use somersault_core::argument::ArgumentError;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A root λ of the test equation, in units of 1/h.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lambda {
    /// λ_R.
    pub re: f64,
    /// λ_I.
    pub im: f64,
}

/// The force of (6.1) on a unit mass along x, and the pulse that excites the modes of a method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestForce {
    lambda: Lambda,
    /// The pulse acts before this time.
    pulse_end: f64,
    phase: f64,
}

impl TestForce {
    /// The force of (6.1) alone.
    pub fn new(lambda: Lambda) -> Self {
        Self { lambda, pulse_end: 0.0, phase: 0.0 }
    }
}

impl ForceModel for TestForce {
    #[inline]
    fn wrench(&self, t: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        let Lambda { re, im } = self.lambda;
        let mut force = 2.0 * re * x.velocity().x - (re * re + im * im) * x.position().x;
        if t < self.pulse_end {
            force += (1.0 + self.phase * (1.0 + t * (2.3 + self.phase))).sin();
        }
        Wrench { force: Vector3::new(force, 0.0, 0.0), torque: Vector3::zeros() }
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        self.lambda.re != 0.0
    }
    /// Without the pulse.
    fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        let Lambda { re, im } = self.lambda;
        let along = Matrix3::from_diagonal(&Vector3::x());
        terms.push(WrenchTerm::LinearForce {
            position: along * -(re * re + im * im),
            velocity: along * (2.0 * re),
        });
        self.pulse_end <= 0.0
    }
}

/// The system a user-defined stepper must take to be studied here.
pub type TestSystem = RigidBodySystem<TestForce>;

/// Stability of a method as a subset of the plane of λ.
#[derive(Debug, Clone, PartialEq)]
pub struct StabilityRegion {
    /// Area of the whole region, of both half planes; infinite where the region is unbounded.
    pub area: f64,
    /// Area divided by the square of the evaluations per step: the region in units of one evaluation, the
    /// column *Corrected* of Table 6.1.
    pub corrected: f64,
    /// Stability limit on the imaginary axis: the method is stable for λ = iy with 0 < y ≤ b. 0 if for no y.
    pub imaginary_limit: f64,
    /// Stability limit on the negative real axis: the method is stable for λ = −x with 0 < x ≤ a. 0 if for no x.
    pub real_limit: f64,
    /// The boundary in the upper half plane as line segments, unordered; the lower half is its mirror image.
    pub boundary: Vec<[Lambda; 2]>,
    /// Points at which a step failed, counted as outside.
    pub failed: usize,
}

/// How far above 1 the spectral radius may be.
const TOLERANCE: f64 = 1e-9;
/// Largest |λ_R|, |λ_I| looked at. Not a round number: the radius of a splitting can be exactly 1 along a line
/// without area, like λ_R = −2, which a grid of round numbers would take for a part of the region.
const WIDEST: f64 = 20.0 * std::f64::consts::PI;

/// Spectral radius of a method of the table at h = 1.
///
/// Infinite where the numbers overflow. Errors: λ not finite, a method that does not apply, a failed step,
/// and [`StudyError::NotLinear`].
pub fn spectral_radius(method: Method, options: Options, lambda: Lambda) -> Result<f64, StudyError> {
    radius(method.info().history, lambda, &MethodSequence { method, options })
}

/// As [`spectral_radius`], for a stepper.
pub fn spectral_radius_of<M: Stepper<TestSystem>>(stepper: &M, lambda: Lambda) -> Result<f64, StudyError> {
    radius(M::INFO.history, lambda, &StepperSequence(stepper))
}

/// Stability region of a method of the table.
///
/// The plane is searched for the region by grids of halving size, so that components smaller than a
/// thirty-second of their distance from the origin may be missed. Cells on the boundary are halved to a
/// 1024th of the extent of the region, and there the boundary is a chord between crossings of the edges,
/// for about four correct digits of the area.
///
/// Errors as for [`spectral_radius`], which is first asked near the origin; elsewhere a failure counts as
/// outside. `progress` may stop the study.
pub fn stability_region(
    method: Method,
    options: Options,
    progress: &mut Progress<'_>,
) -> Result<StabilityRegion, StudyError> {
    let info = method.info();
    let sequence = MethodSequence { method, options };
    region(info.evaluations, progress, &|lambda| radius(info.history, lambda, &sequence))
}

/// As [`stability_region`], for a stepper.
pub fn stability_region_of<M: Stepper<TestSystem> + Sync>(
    stepper: &M,
    progress: &mut Progress<'_>,
) -> Result<StabilityRegion, StudyError> {
    let sequence = StepperSequence(stepper);
    region(M::INFO.evaluations, progress, &|lambda| radius(M::INFO.history, lambda, &sequence))
}

/// Spectral radii on the grid of all `re` and `im`, row by row with `im` fixed within a row, for plotting.
///
/// NaN where a step failed. Errors as for [`spectral_radius`], and empty lists.
pub fn raster(
    method: Method,
    options: Options,
    re: &[f64],
    im: &[f64],
    progress: &mut Progress<'_>,
) -> Result<Vec<f64>, StudyError> {
    let sequence = MethodSequence { method, options };
    rows(re, im, progress, &|lambda| radius(method.info().history, lambda, &sequence))
}

/// As [`raster`], for a stepper.
pub fn raster_of<M: Stepper<TestSystem> + Sync>(
    stepper: &M,
    re: &[f64],
    im: &[f64],
    progress: &mut Progress<'_>,
) -> Result<Vec<f64>, StudyError> {
    let sequence = StepperSequence(stepper);
    rows(re, im, progress, &|lambda| radius(M::INFO.history, lambda, &sequence))
}

type Radius<'a> = dyn Fn(Lambda) -> Result<f64, StudyError> + Sync + 'a;

fn rows(
    re: &[f64],
    im: &[f64],
    progress: &mut Progress<'_>,
    radius: &Radius<'_>,
) -> Result<Vec<f64>, StudyError> {
    super::check_not_empty("re", re)?;
    super::check_not_empty("im", im)?;
    let mut result = Vec::with_capacity(re.len() * im.len());
    let rows = im.len();
    for (done, &im) in im.iter().enumerate() {
        let row: Vec<_> = re.par_iter().map(|&re| radius(Lambda { re, im })).collect();
        for value in row {
            result.push(match value {
                Err(StudyError::Step(error)) if error.is_refusal() => return Err(error.into()),
                Err(error @ StudyError::Argument(ArgumentError::NonFinite { .. })) => return Err(error),
                other => other.unwrap_or(f64::NAN),
            });
        }
        report(progress, done + 1, rows)?;
    }
    Ok(result)
}

/// The states (yₙ, ẏₙ) that a method makes.
trait Sequence {
    /// Makes `skip` steps from `initial` and then fills `out`, one step between its entries.
    fn run(
        &self,
        system: &TestSystem,
        initial: &RigidBodyState,
        skip: usize,
        out: &mut [[f64; 2]],
    ) -> Result<(), StepError>;
}

struct StepperSequence<'a, M>(&'a M);

impl<M: Stepper<TestSystem>> Sequence for StepperSequence<'_, M> {
    fn run(
        &self,
        system: &TestSystem,
        initial: &RigidBodyState,
        skip: usize,
        out: &mut [[f64; 2]],
    ) -> Result<(), StepError> {
        fill(system, self.0, &Unchanged, initial, skip, out)
    }
}

struct MethodSequence {
    method: Method,
    options: Options,
}

impl Sequence for MethodSequence {
    fn run(
        &self,
        system: &TestSystem,
        initial: &RigidBodyState,
        skip: usize,
        out: &mut [[f64; 2]],
    ) -> Result<(), StepError> {
        self.method.visit(self.options, system, Fill { initial, skip, out })
    }
}

struct Fill<'a> {
    initial: &'a RigidBodyState,
    skip: usize,
    out: &'a mut [[f64; 2]],
}

impl Visitor<Pose> for Fill<'_> {
    type Output = Result<(), StepError>;

    fn visit<B: Form<Pose>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let initial = form.encode(self.initial);
        fill(&form, &stepper, &form.decoder(), &initial, self.skip, self.out)
    }
}

fn fill<B: System, M: Stepper<B>>(
    system: &B,
    stepper: &M,
    decoder: &impl Decoder<B::Configuration, Pose>,
    initial: &StateOf<B>,
    skip: usize,
    out: &mut [[f64; 2]],
) -> Result<(), StepError> {
    let mut memory = stepper.start(system, initial)?;
    let (mut before, mut after) = (initial.clone(), initial.clone());
    let mut seen = RigidBodyState::default();
    for n in 0..skip + out.len() {
        if n >= skip {
            decoder.decode(&before, &mut seen);
            out[n - skip] = [seen.position().x, seen.velocity().x];
            if n + 1 == skip + out.len() {
                break;
            }
        }
        stepper.step(system, n as f64, &before, 1.0, &mut memory, &mut after)?;
        std::mem::swap(&mut before, &mut after);
    }
    Ok(())
}

fn moving(y: f64, dy: f64) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    (state.configuration.position.x, state.rate.linear.x) = (y, dy);
    state
}

fn radius(history: u8, lambda: Lambda, sequence: &dyn Sequence) -> Result<f64, StudyError> {
    /// What the recurrence may leave, relative to the data.
    const DEFECT: f64 = 1e-6;
    for (argument, found) in [("re", lambda.re), ("im", lambda.im)] {
        if !found.is_finite() {
            return Err(ArgumentError::NonFinite { argument, found }.into());
        }
    }
    // The moments take no part.
    let body = RigidBody::try_principal(1.0, Vector3::repeat(0.4))?;
    let (radius, defect) = if history == 0 {
        one_step_radius(body, lambda, sequence)?
    } else {
        multistep_radius(usize::from(history) + 1, body, lambda, sequence)?
    };
    if radius.is_finite() && defect > DEFECT {
        return Err(StudyError::NotLinear { history, re: lambda.re, im: lambda.im, defect });
    }
    Ok(radius)
}

/// Spectral radius and relative defect of a method without history: A is the image of a basis.
fn one_step_radius(
    body: RigidBody,
    lambda: Lambda,
    sequence: &dyn Sequence,
) -> Result<(f64, f64), StudyError> {
    let system = RigidBodySystem::new(body, TestForce::new(lambda));
    let image = |y: f64, dy: f64| -> Result<[f64; 2], StudyError> {
        let mut pair = [[0.0; 2]; 2];
        sequence.run(&system, &moving(y, dy), 0, &mut pair)?;
        Ok(pair[1])
    };
    let ([a, c], [b, d]) = (image(1.0, 0.0)?, image(0.0, 1.0)?);
    // One more step of the trajectory, where a hidden memory would show.
    let mut three = [[0.0; 2]; 3];
    sequence.run(&system, &moving(0.6, -0.8), 0, &mut three)?;
    let [_, [y, dy], [y_next, dy_next]] = three;
    // The roots may all be zero, and then rounding is measured against 1.
    let size = 1.0 + (a.abs() + b.abs() + c.abs() + d.abs()) * (y.abs() + dy.abs());
    let defect = ((a * y + b * dy - y_next).abs() + (c * y + d * dy - dy_next).abs()) / size;
    if !defect.is_finite() {
        return Ok((f64::INFINITY, 0.0));
    }
    let (mean, half_gap) = (0.5 * (a + d), 0.5 * (a - d));
    let discriminant = half_gap * half_gap + b * c;
    let radius = if discriminant < 0.0 {
        (mean * mean - discriminant).sqrt()
    } else {
        mean.abs() + discriminant.sqrt()
    };
    Ok((radius, defect))
}

/// Spectral radius and relative defect of a method whose recurrence spans `span` steps.
fn multistep_radius(
    span: usize,
    body: RigidBody,
    lambda: Lambda,
    sequence: &dyn Sequence,
) -> Result<(f64, f64), StudyError> {
    let unknowns = 2 * span;
    let columns = unknowns + 2;
    let mut z0 = DMatrix::zeros(unknowns, columns);
    let mut z1 = DMatrix::zeros(unknowns, columns);
    let mut states = vec![[0.0; 2]; span + 1];
    for column in 0..columns {
        let phase = 1.0 + column as f64;
        let force = TestForce { lambda, pulse_end: unknowns as f64, phase };
        let initial = moving(phase.cos(), phase.sin());
        sequence.run(&RigidBodySystem::new(body, force), &initial, unknowns, &mut states)?;
        for k in 0..span {
            for i in 0..2 {
                z0[(2 * k + i, column)] = states[k][i];
                z1[(2 * k + i, column)] = states[k + 1][i];
            }
        }
    }
    let size = z0.amax().max(z1.amax());
    if !size.is_finite() {
        return Ok((f64::INFINITY, 0.0));
    }
    if size == 0.0 {
        return Ok((0.0, 0.0));
    }
    z0 /= size;
    z1 /= size;
    // Z₀ → Q R and Z₁ → W with W = A Q, on the columns that the pivoting chooses.
    let rank = orthogonalise(&mut z0, &mut z1);
    let (q, w) = (z0.columns(0, rank), z1.columns(0, rank));
    // What is left of the other columns after their component along Q was taken out.
    let defect = z1.columns(rank, columns - rank).amax();
    // The decomposition converges but for numbers near overflow.
    let Some(schur) = Schur::try_new(q.tr_mul(&w), f64::EPSILON, 1000) else {
        return Ok((f64::INFINITY, 0.0));
    };
    let radius = schur.complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max);
    Ok((radius, defect))
}

/// Makes the leading columns of `z0` orthonormal, the longest remaining column first, until what remains is
/// below the cut, and does the same operations to `z1`. Returns the number of columns made.
fn orthogonalise(z0: &mut DMatrix<f64>, z1: &mut DMatrix<f64>) -> usize {
    const CUT: f64 = 1e-10;
    let (rows, columns) = z0.shape();
    let mut cut = 0.0;
    for k in 0..rows {
        let length = |z: &DMatrix<f64>, j: usize| z.column(j).norm();
        let Some(pivot) = (k..columns).max_by(|&i, &j| length(z0, i).total_cmp(&length(z0, j))) else {
            return k;
        };
        let norm = length(z0, pivot);
        if k == 0 {
            cut = CUT * norm;
        }
        if norm <= cut {
            return k;
        }
        for z in [&mut *z0, &mut *z1] {
            z.swap_columns(k, pivot);
            z.column_mut(k).scale_mut(1.0 / norm);
        }
        // Twice, since a long column may leave only its rounding.
        for _ in 0..2 {
            for j in k + 1..columns {
                let share = z0.column(k).dot(&z0.column(j));
                for z in [&mut *z0, &mut *z1] {
                    let (unit, mut other) = z.columns_range_pair_mut(k, j);
                    other.axpy(-share, &unit, 1.0);
                }
            }
        }
    }
    rows
}

/// Distance of the spectral radius from the unit circle, as the region counts it.
struct Probe<'a> {
    radius: &'a Radius<'a>,
    failed: AtomicUsize,
}

impl Probe<'_> {
    fn excess(&self, lambda: Lambda) -> f64 {
        match (self.radius)(lambda) {
            Ok(radius) => radius - 1.0 - TOLERANCE,
            Err(_) => {
                self.failed.fetch_add(1, Ordering::Relaxed);
                f64::INFINITY
            }
        }
    }

    fn is_stable(&self, lambda: Lambda) -> bool {
        self.excess(lambda) <= 0.0
    }

    /// The largest |λ_R| or λ_I of a stable point, from grids of all sizes; `None` if it is [`WIDEST`].
    fn extent(&self, mut part: impl FnMut() -> Result<(), StudyError>) -> Result<Option<f64>, StudyError> {
        const CELLS: i32 = 16;
        let mut extent: f64 = 0.0;
        for window in windows() {
            let cell = window / f64::from(CELLS);
            let farthest = (0..=CELLS)
                .into_par_iter()
                .map(|j| {
                    let stable = |i: &i32| {
                        self.is_stable(Lambda { re: f64::from(*i) * cell, im: f64::from(j) * cell })
                    };
                    (-CELLS..=CELLS).filter(stable).map(|i| i.abs().max(j)).max().unwrap_or(0)
                })
                .max()
                .unwrap_or(0);
            if farthest == CELLS && window == WIDEST {
                return Ok(None);
            }
            // The region may reach into the next cell.
            extent = extent.max(f64::from(farthest + 1) * cell * f64::from(i32::from(farthest > 0)));
            part()?;
        }
        Ok(Some(extent))
    }

    /// The end of the stable interval from 0 along a direction; infinite if it is beyond [`WIDEST`].
    fn limit(&self, step: f64, along: impl Fn(f64) -> Lambda) -> f64 {
        let mut stable = 0.0;
        loop {
            if stable >= WIDEST {
                return f64::INFINITY;
            }
            if !self.is_stable(along(stable + step)) {
                break;
            }
            stable += step;
        }
        let mut unstable = stable + step;
        while unstable - stable > 1e-14 * unstable {
            let middle = 0.5 * (stable + unstable);
            if middle <= stable || middle >= unstable {
                break;
            }
            if self.is_stable(along(middle)) { stable = middle } else { unstable = middle }
        }
        // Growth that sets in slowly, like y⁴/8, hides in the tolerance up to some distance from 0.
        let grows = |share: f64| self.excess(along(share * stable)) + TOLERANCE > 0.1 * TOLERANCE;
        if [0.6, 0.7, 0.8, 0.9].into_iter().any(grows) { 0.0 } else { stable }
    }

    /// The crossing between a stable and an unstable point, to a 512th of their distance.
    fn crossing(&self, mut stable: Lambda, mut unstable: Lambda) -> Lambda {
        let middle = |a: Lambda, b: Lambda| Lambda { re: 0.5 * (a.re + b.re), im: 0.5 * (a.im + b.im) };
        for _ in 0..8 {
            let between = middle(stable, unstable);
            if self.is_stable(between) { stable = between } else { unstable = between }
        }
        middle(stable, unstable)
    }

    /// Adds the area of the region in a square, and its boundary there, halving `depth` times.
    fn square(&self, square: &Square, depth: u32, found: &mut Found) {
        let Square { corners, stable } = square;
        if stable.iter().all(|s| *s) {
            let side = corners[1].re - corners[0].re;
            found.area += side * side;
        } else if stable.iter().any(|s| *s) {
            if depth == 0 { self.chord(square, found) } else { self.halve(square, depth, found) }
        }
    }

    fn halve(&self, Square { corners, stable }: &Square, depth: u32, found: &mut Found) {
        let (re, im) = (corners[0].re, corners[0].im);
        let half = 0.5 * (corners[1].re - re);
        let at = |i: usize, j: usize| Lambda { re: re + i as f64 * half, im: im + j as f64 * half };
        let mut points = [[true; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                points[i][j] = match (i, j) {
                    (0, 0) => stable[0],
                    (2, 0) => stable[1],
                    (2, 2) => stable[2],
                    (0, 2) => stable[3],
                    _ => self.is_stable(at(i, j)),
                };
            }
        }
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let quarter = Square {
                corners: [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                stable: [points[i][j], points[i + 1][j], points[i + 1][j + 1], points[i][j + 1]],
            };
            self.square(&quarter, depth - 1, found);
        }
    }

    /// The polygon of the stable corners and of the crossings of the edges.
    fn chord(&self, Square { corners, stable }: &Square, found: &mut Found) {
        let mut polygon = Vec::with_capacity(6);
        let mut crossings = Vec::with_capacity(4);
        for k in 0..4 {
            let next = (k + 1) % 4;
            if stable[k] {
                polygon.push(corners[k]);
            }
            if stable[k] != stable[next] {
                let (from, to) = if stable[k] { (k, next) } else { (next, k) };
                let crossing = self.crossing(corners[from], corners[to]);
                polygon.push(crossing);
                crossings.push(crossing);
            }
        }
        let next = polygon.iter().cycle().skip(1);
        found.area += 0.5 * polygon.iter().zip(next).map(|(a, b)| a.re * b.im - b.re * a.im).sum::<f64>();
        found.boundary.extend(crossings.chunks_exact(2).map(|pair| [pair[0], pair[1]]));
    }
}

/// Corners, counterclockwise from the lower left, and whether they are stable.
struct Square {
    corners: [Lambda; 4],
    stable: [bool; 4],
}

#[derive(Default)]
struct Found {
    area: f64,
    boundary: Vec<[Lambda; 2]>,
}

/// Sizes of the grids in which the region is looked for.
fn windows() -> impl Iterator<Item = f64> {
    (0..11).map(|k| WIDEST / f64::from(1 << (10 - k)))
}

fn region(
    evaluations: u8,
    progress: &mut Progress<'_>,
    radius: &Radius<'_>,
) -> Result<StabilityRegion, StudyError> {
    /// Squares from 0 to the extent.
    const SQUARES: i32 = 64;
    const DEPTH: u32 = 4;
    // A method that does not apply says so here.
    radius(Lambda { re: -0.02, im: 0.01 })?;
    let probe = Probe { radius, failed: AtomicUsize::new(0) };
    let total = windows().count() + SQUARES as usize;
    let mut done = 0;
    let mut part = || {
        done += 1;
        report(progress, done, total)
    };
    let Some(extent) = probe.extent(&mut part)? else {
        return Ok(StabilityRegion {
            area: f64::INFINITY,
            corrected: f64::INFINITY,
            imaginary_limit: probe.limit(0.125, |y| Lambda { re: 0.0, im: y }),
            real_limit: probe.limit(0.125, |x| Lambda { re: -x, im: 0.0 }),
            boundary: Vec::new(),
            failed: probe.failed.into_inner(),
        });
    };
    let side = extent / f64::from(SQUARES);
    let at = |i: i32, j: i32| Lambda { re: f64::from(i) * side, im: f64::from(j) * side };
    let row = |j: i32| -> Vec<bool> {
        (-SQUARES..=SQUARES).into_par_iter().map(|i| probe.is_stable(at(i, j))).collect()
    };
    let mut whole = Found::default();
    let mut below = row(0);
    for j in 0..SQUARES {
        let above = row(j + 1);
        let squares: Vec<Found> = (-SQUARES..SQUARES)
            .into_par_iter()
            .map(|i| {
                let k = (i + SQUARES) as usize;
                let square = Square {
                    corners: [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                    stable: [below[k], below[k + 1], above[k + 1], above[k]],
                };
                let mut found = Found::default();
                probe.square(&square, DEPTH, &mut found);
                found
            })
            .collect();
        for mut found in squares {
            whole.area += found.area;
            whole.boundary.append(&mut found.boundary);
        }
        below = above;
        part()?;
    }
    let area = 2.0 * whole.area;
    let step = 0.25 * side;
    Ok(StabilityRegion {
        area,
        corrected: area / f64::from(evaluations).powi(2),
        imaginary_limit: probe.limit(step, |y| Lambda { re: 0.0, im: y }),
        real_limit: probe.limit(step, |x| Lambda { re: -x, im: 0.0 }),
        boundary: whole.boundary,
        failed: probe.failed.into_inner(),
    })
}
