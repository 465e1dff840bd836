//! Derivatives of the equations of motion in one state: what implicit methods iterate with.

use crate::state::{Configuration, Rate, State};
use nalgebra::DMatrix;

/// ∂ṗ/∂q and ∂ṗ/∂p in one state, the displacements of q being those of exp(u) q at u = 0.
///
/// Rows and columns are the numbers of a rate ([`Rate::write`]) without those of tangents that it carries: along each of these
/// the derivatives are the same.
#[derive(Debug, Clone)]
pub struct Partials<Q: Configuration> {
    by_displacement: DMatrix<f64>,
    by_rate: DMatrix<f64>,
    moved: State<Q>,
    unit: Q::Rate,
    ends: [Q::Rate; 2],
    numbers: Vec<f64>,
}

/// How far a state is moved for a difference, m, rad, or in units of its rate where that is less than 1.
const MOVE: f64 = 1.5e-8;

impl<Q: Configuration> Partials<Q> {
    /// Zeros, for states of the size of `x`.
    pub fn new(x: &State<Q>) -> Self {
        let n = x.rate.dimension();
        Self {
            by_displacement: DMatrix::zeros(n, n),
            by_rate: DMatrix::zeros(n, n),
            moved: x.clone(),
            unit: x.rate.clone(),
            ends: [x.rate.clone(), x.rate.clone()],
            numbers: vec![0.0; n * (1 + x.rate.tangents())],
        }
    }

    /// ∂ṗ/∂q.
    pub fn by_displacement(&self) -> &DMatrix<f64> {
        &self.by_displacement
    }

    /// ∂ṗ/∂p.
    pub fn by_rate(&self) -> &DMatrix<f64> {
        &self.by_rate
    }

    /// Both, to be written.
    pub fn matrices_mut(&mut self) -> [&mut DMatrix<f64>; 2] {
        [&mut self.by_displacement, &mut self.by_rate]
    }

    /// Whether both are finite.
    pub fn is_finite(&self) -> bool {
        [&self.by_displacement, &self.by_rate].into_iter().flatten().all(|entry| entry.is_finite())
    }

    /// A rate to be overwritten.
    pub fn room_mut(&mut self) -> &mut Q::Rate {
        &mut self.unit
    }

    /// Sets both to the changes of the acceleration along tangents (δq, δp), the unit displacements and unit changes of the rate.
    pub fn by_columns(&mut self, mut along: impl FnMut((&Q::Rate, &Q::Rate), &mut Q::Rate)) {
        let Self { by_displacement, by_rate, unit, ends: [zero, change], numbers, .. } = self;
        let n = by_rate.nrows();
        zero.set_zero();
        for k in 0..n {
            numbers.fill(0.0);
            numbers[k] = 1.0;
            unit.read(numbers);
            along((unit, zero), change);
            change.write(numbers);
            by_displacement.column_mut(k).copy_from_slice(&numbers[..n]);
            along((zero, unit), change);
            change.write(numbers);
            by_rate.column_mut(k).copy_from_slice(&numbers[..n]);
        }
    }

    /// Sets both to the differences of an acceleration next to a state.
    pub fn by_differences(&mut self, x: &State<Q>, mut acceleration: impl FnMut(&State<Q>, &mut Q::Rate)) {
        let Self { by_displacement, by_rate, moved, unit, ends: [here, there], numbers } = self;
        let n = by_rate.nrows();
        acceleration(x, here);
        for k in 0..n {
            x.rate.write(numbers);
            let steps = [MOVE, MOVE * numbers[k].abs().max(1.0)];
            numbers.fill(0.0);
            numbers[k] = 1.0;
            unit.read(numbers);
            for (by, step, matrix) in
                [(true, steps[0], &mut *by_displacement), (false, steps[1], &mut *by_rate)]
            {
                moved.assign(x);
                if by {
                    moved.drift(unit, step)
                } else {
                    moved.kick(unit, step)
                }
                acceleration(moved, there);
                there.axpy(-1.0, here);
                there.scale(1.0 / step);
                there.write(numbers);
                matrix.column_mut(k).copy_from_slice(&numbers[..n]);
            }
        }
    }
}
