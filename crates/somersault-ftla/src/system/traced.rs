//! The field of a traced function: values and exact derivatives from one tape.

use super::rooms::Rooms;
use super::{Piece, SystemError, VectorField};
use nalgebra::DMatrix;
use somersault_core::argument::expect_length;
use somersault_expr::{Evaluator, ExprFunction, Expression, Graph};
use std::collections::HashSet;

/// ẋ = f(t, x) as an [`ExprFunction`] of the blocks `x` and `t`.
///
/// f and ∂f/∂x share what they have in common. The tangent is formed from the entries of ∂f/∂x that are not zero everywhere.
#[derive(Debug)]
pub struct TracedField {
    dimension: usize,
    /// Place of the first state and of the time among the inputs.
    first: [usize; 2],
    is_autonomous: bool,
    /// Row and column of each entry of ∂f/∂x.
    places: Vec<(usize, usize)>,
    rooms: Rooms<Room>,
}

/// What evaluates, with its memory.
struct Room {
    field: Evaluator,
    /// f, then the entries of ∂f/∂x.
    both: Evaluator,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

impl Room {
    /// f of the inputs.
    fn field(&mut self, f: &mut [f64]) {
        if self.field.evaluate(&self.inputs, f).is_err() {
            f.fill(f64::NAN);
        }
    }

    /// f of the inputs and the entries of ∂f/∂x.
    fn both(&mut self, f: &mut [f64]) -> &[f64] {
        if self.both.evaluate(&self.inputs, &mut self.outputs).is_err() {
            self.outputs.fill(f64::NAN);
        }
        let (values, entries) = self.outputs.split_at(f.len());
        f.copy_from_slice(values);
        entries
    }
}

impl TracedField {
    /// The field of a function whose blocks are `x`, of as many numbers as it has outputs, and `t`, a single number.
    pub fn try_new(function: &ExprFunction) -> Result<Self, SystemError> {
        let dimension = function.n_outputs();
        let (states, time) = (function.range("x")?, function.range("t")?);
        expect_length("x", states.len(), dimension)?;
        expect_length("t", time.len(), 1)?;
        expect_length("inputs", function.n_inputs(), dimension + 1)?;
        let mut graph = function.graph().clone();
        let inputs = graph.inputs()[states.clone()].to_vec();
        let (sparsity, entries) = graph.jacobian(function.outputs(), &inputs)?;
        let outputs = function.outputs().iter().chain(&entries).copied().collect();
        let both = ExprFunction::new(graph, function.blocks().to_vec(), outputs)?;
        let rooms = Rooms::new(|| Room {
            field: function.evaluator(),
            both: both.evaluator(),
            inputs: vec![0.0; dimension + 1],
            outputs: vec![0.0; both.n_outputs()],
        });
        let first = [states.start, time.start];
        let is_autonomous =
            !depends(function.graph(), function.outputs(), function.graph().inputs()[time.start]);
        Ok(Self { dimension, first, is_autonomous, places: sparsity.entries().collect(), rooms })
    }

    /// Whether the field does not depend on time.
    pub fn is_autonomous(&self) -> bool {
        self.is_autonomous
    }

    /// Works in the room of this thread, with the inputs set.
    fn at<T>(&self, t: f64, x: &[f64], work: impl FnOnce(&mut Room) -> T) -> T {
        let [state, time] = self.first;
        self.rooms.at(|room| {
            room.inputs[state..state + x.len()].copy_from_slice(x);
            room.inputs[time] = t;
            work(room)
        })
    }
}

/// Whether expressions contain an input.
fn depends(graph: &Graph, of: &[Expression], input: Expression) -> bool {
    let (mut seen, mut waiting) = (HashSet::new(), of.to_vec());
    while let Some(next) = waiting.pop() {
        if next == input {
            return true;
        }
        if seen.insert(next)
            && let Some((_, arguments)) = graph.as_operation(next)
        {
            waiting.extend_from_slice(arguments);
        }
    }
    false
}

impl VectorField for TracedField {
    #[inline]
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        self.at(0.0, p, |room| room.field(h));
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        let mut h = vec![0.0; self.dimension];
        self.linearize_into(p, &mut h, d);
    }

    fn linearize_into(&self, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.linearize_at(0.0, &Piece::FREE, p, h, d);
    }

    fn field_at(&self, t: f64, _piece: &Piece, p: &[f64], h: &mut [f64]) {
        self.at(t, p, |room| room.field(h));
    }

    fn linearize_at(&self, t: f64, _piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        d.fill(0.0);
        self.at(t, p, |room| {
            let entries = room.both(h);
            self.places.iter().zip(entries).for_each(|(&place, &entry)| d[place] = entry);
        });
    }

    #[inline(always)]
    fn variation_at(
        &self,
        t: f64,
        _piece: &Piece,
        p: &[f64],
        h: &mut [f64],
        _d: &mut DMatrix<f64>,
        (phi, out): (&[f64], &mut [f64]),
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) {
        let n = p.len();
        out.fill(0.0);
        self.at(t, p, |room| {
            let entries = room.both(h);
            for (&(row, column), &entry) in self.places.iter().zip(entries) {
                let (out, phi) = (&mut out[row * n..(row + 1) * n], &phi[column * n..(column + 1) * n]);
                for c in 0..n {
                    out[c] = multiply_add(entry, phi[c], out[c]);
                }
            }
        });
    }

    fn conserved(&self, _p: &[f64]) -> Option<f64> {
        None
    }
}
