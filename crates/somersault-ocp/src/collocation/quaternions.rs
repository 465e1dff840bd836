//! Orientations among the states, as quaternions (x, y, z, w).
//!
//! A quaternion stays in ℝ⁴ and its direction is the orientation. Equations of motion keep its norm, all other functions are
//! evaluated where it is one, and an end that is given leaves its length free:
//!
//! ```text
//! q̇ = ½ q ω,    L(q/|q|),    2 Im(q̄_f q(t_f)) = 0
//! ```
//! So nothing in the program depends on the norm, which the first point fixes, and no two rows say the same: an orientation at
//! the end is three rows, and q and −q are the same one. The costate of q is orthogonal to it; ½ Im(q̄ λ) is the covector of
//! rotations about body axes. The norm at other points is one to the tolerance of the equations.

use super::bounds::PhaseBounds;
use super::error::{CollocationError, Untraced};
use super::function::{RelativeErrors, VectorFunction, arguments};
use super::guess::{Guess, middle};
use super::interval::Interval;
use super::wrong_derivative::Labels;
use crate::WrongDerivative;
use nalgebra::{DMatrix, Matrix4x3, Quaternion, UnitQuaternion, Vector3};
use somersault_core::lie::so3;
use somersault_expr::{ExprFunction, Expression, Graph};
use somersault_nlp::EvaluationError;
use std::f64::consts::TAU;

/// Entries of a quaternion.
pub(crate) const WIDTH: usize = 4;
/// How far from one the norm of a quaternion may be that is given, to be brought to one: four digits of each entry.
const ROUNDED: f64 = 1e-3;
/// Cosine of half an angle below which a rotation is a half turn, both ways as long.
const HALF_TURN: f64 = 1e-9;
/// Largest angle between rows of a guess, which are joined by straight lines.
const STEP: f64 = 0.1;

fn quaternion(numbers: &[f64]) -> Quaternion<f64> {
    so3::from_xyzw(numbers).into_inner()
}

fn block(first: usize, row: &[f64]) -> &[f64] {
    &row[first..first + WIDTH]
}

/// The direction of a quaternion, if it has one.
fn direction(numbers: &[f64]) -> Option<UnitQuaternion<f64>> {
    UnitQuaternion::try_new(quaternion(numbers), f64::MIN_POSITIVE)
}

/// The sign with which `to` is reached from `from` by the shorter turn; of both half turns the same whatever the sign of `to`.
fn sign(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> f64 {
    let relative = from.inverse() * to;
    let largest = relative.imag()[relative.imag().iamax()];
    if relative.w.abs() > HALF_TURN { relative.w.signum() } else { largest.signum() }
}

/// Whether the shorter way between two quaternions in ℝ⁴ is to the opposite of one.
pub(super) fn are_opposite(a: &[f64], b: &[f64]) -> bool {
    quaternion(a).coords.dot(&quaternion(b).coords) < 0.0
}

/// Whether two that are given are the same orientation.
pub(super) fn are_alike(a: &[Interval], b: &[Interval]) -> bool {
    let found = [a, b].map(|own| direction(&own.iter().map(|interval| interval.lower).collect::<Vec<_>>()));
    matches!(found, [Some(a), Some(b)] if so3::angle_between(&a, &b) < ROUNDED)
}

/// Brings the quaternions of a row to unit norm.
pub(super) fn normalize(quaternions: &[usize], row: &mut [f64]) {
    for &first in quaternions {
        if let Some(found) = direction(block(first, row)) {
            row[first..first + WIDTH].copy_from_slice(found.coords.as_slice());
        }
    }
}

/// Turns the quaternion of a row by a fraction of a whole turn about an axis of its body. The whole of it leads to −q.
pub(super) fn wind(first: usize, row: &mut [f64], axis: Option<&Vector3<f64>>, fraction: f64) {
    if let Some(axis) = axis {
        let turned = so3::from_xyzw(block(first, row)) * so3::exp(&(axis * (TAU * fraction)));
        row[first..first + WIDTH].copy_from_slice(turned.coords.as_slice());
    }
}

/// By what the numbers of a unit quaternion change in rotations about its three body axes: the columns q e_k, orthonormal, of δq =
/// ½ Σ θ_k q e_k.
pub(crate) fn body_axes(numbers: &[f64]) -> Matrix4x3<f64> {
    let q = quaternion(numbers);
    let q = q / q.norm();
    let axis = |k: usize| (q * Quaternion::from_imag(Vector3::ith(k, 1.0))).coords;
    Matrix4x3::from_columns(&[axis(0), axis(1), axis(2)])
}

/// Small differences of states at `at`: those of quaternions become rotation vectors in body axes, rad, with the change of the
/// norm as a fourth number.
pub(super) fn in_body_axes(quaternions: &[usize], at: &[f64], differences: &mut [f64]) {
    for &first in quaternions {
        let at = quaternion(block(first, at));
        let seen = at.conjugate() * quaternion(block(first, differences)) * (2.0 / at.norm_squared());
        differences[first..first + WIDTH].copy_from_slice(seen.coords.as_slice());
    }
}

/// Sizes to which errors of states are relative: one for angles.
pub(super) fn set_sizes(quaternions: &[usize], sizes: &mut [f64]) {
    quaternions.iter().for_each(|&first| sizes[first..first + WIDTH].fill(1.0));
}

/// A row that the ends of a phase get.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum EndRow {
    /// A product with the quaternion at an argument.
    Product { first: usize, by: [f64; WIDTH] },
    /// The square of its norm.
    Norm { first: usize },
}

impl EndRow {
    pub(super) fn bound(&self) -> Interval {
        match self {
            Self::Product { .. } => Interval::fixed(0.0),
            Self::Norm { .. } => Interval::fixed(1.0),
        }
    }
}

/// What bounds say of both ends of a quaternion: its directions there where they are given, of unit norm from now on, and the
/// rows that stand for them. `is_linked` says that an earlier phase leads to the start.
pub(super) fn pose(
    bounds: &mut PhaseBounds,
    first: usize,
    guess: Option<&Guess>,
    is_linked: bool,
    not_unit: impl Fn(&'static str, f64) -> CollocationError,
) -> Result<Vec<EndRow>, CollocationError> {
    let n_states = bounds.state.len();
    let given = |argument, intervals: &[Interval]| {
        let own = &intervals[first..first + WIDTH];
        if !own.iter().all(Interval::is_fixed) {
            return Ok(None);
        }
        let numbers: Vec<f64> = own.iter().map(|interval| interval.lower).collect();
        let norm = quaternion(&numbers).norm();
        let is_near = (norm - 1.0).abs() <= ROUNDED;
        direction(&numbers).filter(|_| is_near).map(Some).ok_or_else(|| not_unit(argument, norm))
    };
    let (start, last) =
        (given("initial_state", &bounds.initial_state)?, given("final_state", &bounds.final_state)?);
    // a guess says which of both signs it is about
    let here = guess.and_then(|guess| direction(block(first, &guess.states[0])));
    let flipped = |found: UnitQuaternion<f64>, near: Option<UnitQuaternion<f64>>| {
        let sign = near.map_or(1.0, |near| sign(&near, &found));
        found.coords * sign
    };
    let mut rows = Vec::new();
    match start {
        Some(start) => {
            let numbers = flipped(start, here);
            let own = bounds.initial_state[first..].iter_mut();
            own.zip(numbers.as_slice()).for_each(|(to, x)| *to = Interval::fixed(*x));
        }
        None if is_linked => {}
        None => rows.push(EndRow::Norm { first }),
    }
    if let Some(last) = last {
        let near = direction(
            &bounds.initial_state[first..first + WIDTH].iter().map(|i| i.lower).collect::<Vec<_>>(),
        );
        let last = flipped(last, near.filter(|_| start.is_some()));
        let own = bounds.final_state[first..].iter_mut();
        own.zip(last.as_slice()).for_each(|(to, x)| *to = Interval::fixed(*x));
        let q = Quaternion::from_vector(last);
        // of 2 q̄ x entry k is the product with 2 q e_k
        rows.extend((0..WIDTH - 1).map(|k| {
            let mut axis = nalgebra::Vector4::zeros();
            axis[k] = 2.0;
            let by = (q * Quaternion::from_vector(axis)).coords.into();
            EndRow::Product { first: n_states + first, by }
        }));
    }
    Ok(rows)
}

/// Frees the length of a quaternion that is given at the end, within the bounds of the states.
pub(super) fn free_length(bounds: &mut PhaseBounds, first: usize) {
    let own = first..first + WIDTH;
    if bounds.final_state[own.clone()].iter().all(Interval::is_fixed) {
        bounds.final_state[own.clone()].copy_from_slice(&bounds.state[own]);
    }
}

/// The direction that bounds allow: the one given, else the middle.
fn allowed(intervals: &[Interval]) -> Option<UnitQuaternion<f64>> {
    direction(&intervals.iter().map(middle).collect::<Vec<_>>())
}

/// Makes quaternions of a guess unit ones that turn little from row to row. Zeros stand for the shortest turn between the ends.
pub(super) fn complete(quaternions: &[usize], guess: &mut Guess, bounds: &PhaseBounds) {
    for &first in quaternions {
        let own = first..first + WIDTH;
        let ends = [&bounds.initial_state, &bounds.final_state].map(|ends| allowed(&ends[own.clone()]));
        let start = ends[0].or(ends[1]).unwrap_or_else(UnitQuaternion::identity);
        let last = ends[1].unwrap_or(start);
        let is_open = guess.states.iter().all(|row| row[own.clone()].iter().all(|x| *x == 0.0));
        let (begin, end) = guess.interval();
        let is_given = bounds.initial_state[own.clone()].iter().all(Interval::is_fixed);
        let mut before = is_given.then_some(start);
        for (row, time) in guess.states.iter_mut().zip(&guess.times) {
            let found = if is_open {
                Some(between(&start, &last, (time - begin) / (end - begin)))
            } else {
                direction(block(first, row)).or(before)
            };
            let found = found.unwrap_or(start);
            let sign = before.map_or(1.0, |before| before.coords.dot(&found.coords).signum());
            let found = UnitQuaternion::new_unchecked(found.into_inner() * sign);
            row[own.clone()].copy_from_slice(found.coords.as_slice());
            before = Some(found);
        }
    }
    let mut all = Guess { parameters: guess.parameters.clone(), ..Guess::default() };
    for i in 0..guess.times.len() {
        if i > 0 {
            for s in fractions(quaternions, &guess.states[i - 1], &guess.states[i]) {
                let line = |a: &[f64], b: &[f64]| -> Vec<f64> {
                    a.iter().zip(b).map(|(a, b)| a + s * (b - a)).collect()
                };
                let (before, after) = (&guess.states[i - 1], &guess.states[i]);
                let mut row = line(before, after);
                for &first in quaternions {
                    let ends = [before, after].map(|row| so3::from_xyzw(block(first, row)));
                    let found = between(&ends[0], &ends[1], s);
                    row[first..first + WIDTH].copy_from_slice(found.coords.as_slice());
                }
                all.times.push(guess.times[i - 1] + s * (guess.times[i] - guess.times[i - 1]));
                all.states.push(row);
                all.controls.push(line(&guess.controls[i - 1], &guess.controls[i]));
            }
        }
        all.times.push(guess.times[i]);
        all.states.push(guess.states[i].clone());
        all.controls.push(guess.controls[i].clone());
    }
    *guess = all;
}

/// The orientation at a fraction of the shorter turn.
fn between(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>, fraction: f64) -> UnitQuaternion<f64> {
    let turn = from.inverse() * UnitQuaternion::new_unchecked(to.into_inner() * sign(from, to));
    from * so3::exp(&(so3::log(&turn) * fraction))
}

/// Where rows between two others are needed.
fn fractions(quaternions: &[usize], before: &[f64], after: &[f64]) -> impl Iterator<Item = f64> {
    let angle = |&first: &usize| {
        so3::angle_between(&so3::from_xyzw(block(first, before)), &so3::from_xyzw(block(first, after)))
    };
    let parts = (quaternions.iter().map(angle).fold(0.0, f64::max) / STEP).ceil().max(1.0) as usize;
    (1..parts).map(move |i| i as f64 / parts as f64)
}

/// A function of states some of which are quaternions, evaluated where those have unit norm: f(x/|x|).
pub struct AtUnitQuaternions {
    function: Box<dyn VectorFunction>,
    /// First argument of each.
    quaternions: Vec<usize>,
    norms: Vec<f64>,
    unit: Vec<f64>,
    jacobian: DMatrix<f64>,
    curvature: DMatrix<f64>,
    gradient: Vec<f64>,
}

impl AtUnitQuaternions {
    /// A function of `n_arguments`, with the first of each quaternion among them.
    pub fn new(function: Box<dyn VectorFunction>, n_arguments: usize, quaternions: Vec<usize>) -> Self {
        Self {
            norms: vec![1.0; quaternions.len()],
            quaternions,
            unit: vec![0.0; n_arguments],
            jacobian: DMatrix::zeros(function.n_outputs(), n_arguments),
            curvature: DMatrix::zeros(n_arguments, n_arguments),
            gradient: vec![0.0; n_arguments],
            function,
        }
    }

    fn place(&mut self, arguments: &[f64]) {
        self.unit.copy_from_slice(arguments);
        for (&first, norm) in self.quaternions.iter().zip(&mut self.norms) {
            let own = &mut self.unit[first..first + WIDTH];
            *norm = quaternion(own).norm();
            own.iter_mut().for_each(|x| *x /= *norm);
        }
    }
}

/// Numbers of a quaternion by those of its direction: x ← (x − (x·q) q)/|q|, given four numbers and how to move them.
fn across(q: &[f64], norm: f64, numbers: [f64; WIDTH]) -> [f64; WIDTH] {
    let along: f64 = q.iter().zip(&numbers).map(|(q, x)| q * x).sum();
    let mut out = numbers;
    out.iter_mut().zip(q).for_each(|(x, q)| *x = (*x - along * q) / norm);
    out
}

#[deny(clippy::missing_trait_methods)]
impl VectorFunction for AtUnitQuaternions {
    fn n_outputs(&self) -> usize {
        self.function.n_outputs()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.place(arguments);
        self.function.evaluate(&self.unit, values)
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        self.place(arguments);
        self.function.jacobian(&self.unit, jacobian)?;
        for (&first, norm) in self.quaternions.iter().zip(&self.norms) {
            let q = block(first, &self.unit);
            for mut row in jacobian.row_iter_mut() {
                let moved = across(q, *norm, [0, 1, 2, 3].map(|k| row[first + k]));
                (0..WIDTH).for_each(|k| row[first + k] = moved[k]);
            }
        }
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        self.place(arguments);
        let Self { function, quaternions, norms, unit, jacobian, curvature, gradient } = self;
        function.jacobian(unit, jacobian)?;
        curvature.fill(0.0);
        function.add_hessian(unit, weights, curvature)?;
        curvature.fill_lower_triangle_with_upper_triangle();
        for (gradient, by) in gradient.iter_mut().zip(jacobian.column_iter()) {
            *gradient = by.iter().zip(weights).map(|(by, w)| by * w).sum();
        }
        for (&first, &norm) in quaternions.iter().zip(&*norms) {
            let q = block(first, unit);
            for mut row in curvature.row_iter_mut() {
                let moved = across(q, norm, [0, 1, 2, 3].map(|k| row[first + k]));
                (0..WIDTH).for_each(|k| row[first + k] = moved[k]);
            }
            for mut column in curvature.column_iter_mut() {
                let moved = across(q, norm, [0, 1, 2, 3].map(|k| column[first + k]));
                (0..WIDTH).for_each(|k| column[first + k] = moved[k]);
            }
            // ∇²(gᵀq/|q|)
            let g = block(first, gradient);
            let along: f64 = q.iter().zip(g).map(|(q, g)| q * g).sum();
            for i in 0..WIDTH {
                for j in 0..WIDTH {
                    let bend = 3.0 * along * q[i] * q[j] - g[i] * q[j] - q[i] * g[j];
                    let diagonal = if i == j { along } else { 0.0 };
                    curvature[(first + i, first + j)] += (bend - diagonal) / (norm * norm);
                }
            }
        }
        *hessian += &*curvature;
        Ok(())
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        let mut unit = at.to_vec();
        normalize(&self.quaternions, &mut unit);
        let function = self.function.expressions(&unit)?;
        let mut graph = Graph::new();
        let mut inputs: Vec<Expression> = at.iter().map(|_| graph.input()).collect();
        for &first in &self.quaternions {
            let mut square = graph.constant(0.0);
            for &x in &inputs[first..first + WIDTH] {
                let product = graph.multiply(x, x);
                square = graph.add(square, product);
            }
            let norm = graph.sqrt(square);
            inputs[first..first + WIDTH].iter_mut().for_each(|x| *x = graph.divide(*x, norm));
        }
        let outputs = graph.insert(function.graph(), function.outputs(), &inputs)?;
        Ok(ExprFunction::new(graph, arguments(at.len()), outputs)?)
    }

    fn set_sizes(&mut self, arguments: &[f64], sizes: &[f64]) -> Result<(), EvaluationError> {
        self.place(arguments);
        self.function.set_sizes(&self.unit, sizes)
    }

    fn relative_errors(&self) -> RelativeErrors {
        self.function.relative_errors()
    }

    fn brings_derivatives(&self) -> bool {
        self.function.brings_derivatives()
    }

    fn wrong_derivative(
        &mut self,
        arguments: &[f64],
        sizes: &[f64],
        labels: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        self.place(arguments);
        self.function.wrong_derivative(&self.unit, sizes, labels)
    }
}

/// Rows of quaternions over the arguments of end constraints.
pub(super) struct EndRows(pub(super) Vec<EndRow>);

impl VectorFunction for EndRows {
    fn n_outputs(&self) -> usize {
        self.0.len()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        for (value, row) in values.iter_mut().zip(&self.0) {
            *value = match row {
                EndRow::Product { first, by } => {
                    by.iter().zip(block(*first, arguments)).map(|(by, x)| by * x).sum()
                }
                EndRow::Norm { first } => quaternion(block(*first, arguments)).norm_squared(),
            };
        }
        Ok(())
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        jacobian.fill(0.0);
        for (i, row) in self.0.iter().enumerate() {
            for k in 0..WIDTH {
                match row {
                    EndRow::Product { first, by } => jacobian[(i, first + k)] = by[k],
                    EndRow::Norm { first } => jacobian[(i, first + k)] = 2.0 * arguments[first + k],
                }
            }
        }
        Ok(())
    }

    fn add_hessian(
        &mut self,
        _arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        for (row, weight) in self.0.iter().zip(weights) {
            match row {
                EndRow::Product { .. } => {}
                EndRow::Norm { first } => {
                    (*first..first + WIDTH).for_each(|k| hessian[(k, k)] += 2.0 * weight)
                }
            }
        }
        Ok(())
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        let mut graph = Graph::new();
        let inputs: Vec<Expression> = at.iter().map(|_| graph.input()).collect();
        let mut outputs = Vec::with_capacity(self.0.len());
        for row in &self.0 {
            let mut sum = graph.constant(0.0);
            for k in 0..WIDTH {
                let (factor, x) = match row {
                    EndRow::Product { first, by } => (graph.constant(by[k]), inputs[first + k]),
                    EndRow::Norm { first } => (inputs[first + k], inputs[first + k]),
                };
                let product = graph.multiply(factor, x);
                sum = graph.add(sum, product);
            }
            outputs.push(sum);
        }
        Ok(ExprFunction::new(graph, arguments(at.len()), outputs)?)
    }
}
