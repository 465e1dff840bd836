//! Evaluation of a tape: one point, or eight at a time.

use crate::error::ExprError;
use crate::lanes::{self, LANES, Lanes};
use crate::tape::{Code, Instruction, Tape};
use rayon::prelude::*;
use somersault_core::argument::{ArgumentError, expect_length};
use somersault_core::cancel::CancellationToken;
use std::sync::Arc;

/// What evaluates a function or its derivatives, with the memory for it. It allocates nothing once it is made, except in
/// [`Evaluator::evaluate_on_threads`]; a clone has memory of its own.
#[derive(Debug, Clone)]
pub struct Evaluator {
    tape: Arc<Tape>,
    registers: Vec<f64>,
    /// Made with the first evaluation of several points.
    lanes: Vec<Lanes>,
}

/// Groups of eight points that a thread takes at a time, at least this much work in instructions.
const WORK_OF_A_THREAD: usize = 20_000;

impl Evaluator {
    pub(crate) fn new(tape: Arc<Tape>) -> Self {
        let mut registers = vec![0.0; tape.n_registers];
        registers[..tape.constants.len()].copy_from_slice(&tape.constants);
        Self { tape, registers, lanes: Vec::new() }
    }

    /// Numbers that it takes, block by block.
    pub fn n_inputs(&self) -> usize {
        self.tape.n_inputs
    }

    /// Numbers that it gives.
    pub fn n_outputs(&self) -> usize {
        self.tape.n_outputs
    }

    /// Instructions for one point.
    pub fn n_instructions(&self) -> usize {
        self.tape.instructions.len()
    }

    /// Numbers that are held during an evaluation.
    pub fn n_registers(&self) -> usize {
        self.tape.n_registers
    }

    /// The outputs at one point.
    pub fn evaluate(&mut self, inputs: &[f64], outputs: &mut [f64]) -> Result<(), ArgumentError> {
        let tape = &*self.tape;
        expect_length("inputs", inputs.len(), tape.n_inputs)?;
        expect_length("outputs", outputs.len(), tape.n_outputs)?;
        let (registers, first) = (&mut self.registers[..], tape.first_input());
        registers[first..first + tape.n_inputs].copy_from_slice(inputs);
        one_point(tape, registers);
        let first = tape.first_output();
        outputs.copy_from_slice(&registers[first..first + tape.n_outputs]);
        for &(from, output) in &tape.copies {
            outputs[output as usize] = registers[from as usize];
        }
        Ok(())
    }

    /// The outputs at several points, whose inputs follow one another, eight at a time.
    ///
    /// Results do not depend on the other points. They are those of one point bit for bit, except for sines, cosines, exponentials
    /// and logarithms, which may differ in the last bit.
    pub fn evaluate_many(&mut self, inputs: &[f64], outputs: &mut [f64]) -> Result<(), ArgumentError> {
        let points = self.points(inputs, outputs)?;
        self.prepare();
        let (n, m) = (self.tape.n_inputs, self.tape.n_outputs);
        for start in (0..points).step_by(LANES) {
            let end = points.min(start + LANES);
            self.group(&inputs[start * n..end * n], &mut outputs[start * m..end * m], end - start);
        }
        Ok(())
    }

    /// The outputs at [`LANES`] points, each number of all of them side by side: those of [`Evaluator::evaluate_many`].
    pub fn evaluate_lanes(
        &mut self,
        inputs: &[[f64; LANES]],
        outputs: &mut [[f64; LANES]],
    ) -> Result<(), ArgumentError> {
        expect_length("inputs", inputs.len(), self.tape.n_inputs)?;
        expect_length("outputs", outputs.len(), self.tape.n_outputs)?;
        self.prepare();
        let (tape, registers) = (&*self.tape, &mut self.lanes[..]);
        let first = tape.first_input();
        registers[first..first + tape.n_inputs].copy_from_slice(inputs);
        pulp::Arch::new().dispatch(Group { tape, registers });
        let first = tape.first_output();
        outputs.copy_from_slice(&registers[first..first + tape.n_outputs]);
        for &(from, output) in &tape.copies {
            outputs[output as usize] = registers[from as usize];
        }
        Ok(())
    }

    /// Whether an input is read at all.
    pub fn reads(&self, input: usize) -> bool {
        let register = self.tape.first_input() + input;
        let is_read = |instruction: &Instruction| instruction.registers().contains(&register);
        let is_copied = |(from, _): &(u32, u32)| *from as usize == register;
        self.tape.instructions.iter().any(is_read) || self.tape.copies.iter().any(is_copied)
    }

    /// The same on the threads of the current pool, where there is enough to do: each has memory of its own, which is allocated
    /// here. `cancel` is looked at before each piece of work.
    pub fn evaluate_on_threads(
        &self,
        inputs: &[f64],
        outputs: &mut [f64],
        cancel: &CancellationToken,
    ) -> Result<(), ExprError> {
        self.points(inputs, outputs)?;
        let (n, m) = (self.tape.n_inputs, self.tape.n_outputs);
        let groups = (WORK_OF_A_THREAD / self.tape.instructions.len().max(1)).clamp(1, 1 << 16);
        let points = groups * LANES;
        if m == 0 {
            return Ok(());
        }
        outputs.par_chunks_mut(points * m).enumerate().try_for_each_init(
            || self.clone(),
            |evaluator, (piece, outputs)| {
                if cancel.is_cancelled() {
                    return Err(ExprError::Cancelled);
                }
                let first = piece * points * n;
                let inputs = &inputs[first..first + outputs.len() / m * n];
                evaluator.evaluate_many(inputs, outputs).map_err(ExprError::from)
            },
        )
    }

    /// Number of points, where inputs and outputs are of the same number.
    fn points(&self, inputs: &[f64], outputs: &[f64]) -> Result<usize, ArgumentError> {
        let (n, m) = (self.tape.n_inputs, self.tape.n_outputs);
        let points = inputs.len().checked_div(n).or(outputs.len().checked_div(m)).unwrap_or(0);
        expect_length("inputs", inputs.len(), points * n)?;
        expect_length("outputs", outputs.len(), points.saturating_mul(m))?;
        Ok(points)
    }

    /// Makes the registers of lanes, once.
    fn prepare(&mut self) {
        if self.lanes.is_empty() {
            self.lanes = vec![[0.0; LANES]; self.tape.n_registers];
            for (register, &constant) in self.lanes.iter_mut().zip(&self.tape.constants) {
                *register = [constant; LANES];
            }
        }
    }

    /// Up to eight points; lanes without a point have the last one.
    fn group(&mut self, inputs: &[f64], outputs: &mut [f64], points: usize) {
        let (tape, registers) = (&*self.tape, &mut self.lanes[..]);
        let (n, m) = (tape.n_inputs, tape.n_outputs);
        let first = tape.first_input();
        for (k, register) in registers[first..first + n].iter_mut().enumerate() {
            for (lane, value) in register.iter_mut().enumerate() {
                *value = inputs[lane.min(points - 1) * n + k];
            }
        }
        pulp::Arch::new().dispatch(Group { tape, registers });
        let first = tape.first_output();
        for (k, register) in registers[first..first + m].iter().enumerate() {
            for lane in 0..points {
                outputs[lane * m + k] = register[lane];
            }
        }
        for &(from, output) in &tape.copies {
            for lane in 0..points {
                outputs[lane * m + output as usize] = registers[from as usize][lane];
            }
        }
    }
}

fn one_point(tape: &Tape, registers: &mut [f64]) {
    for instruction in &tape.instructions {
        let [a, b, c] = instruction.registers();
        let value = match instruction.code {
            Code::One(operation) => operation.value(|| registers[a], || registers[b], || registers[c]),
            Code::SineAndCosine => {
                let (sine, cosine) = registers[a].sin_cos();
                registers[b] = cosine;
                sine
            }
        };
        registers[instruction.to as usize] = value;
    }
}

/// Eight points, compiled for the widest vectors of the machine.
struct Group<'a> {
    tape: &'a Tape,
    registers: &'a mut [Lanes],
}

impl pulp::WithSimd for Group<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) {
        let Self { tape, registers } = self;
        for instruction in &tape.instructions {
            let [a, b, c] = instruction.registers();
            let values = match instruction.code {
                Code::One(operation) => {
                    operation.values::<V>(|| registers[a], || registers[b], || registers[c])
                }
                Code::SineAndCosine => {
                    let (sines, cosines) = lanes::sin_cos::<V>(registers[a]);
                    registers[b] = cosines;
                    sines
                }
            };
            registers[instruction.to as usize] = values;
        }
    }
}
