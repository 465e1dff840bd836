//! Expressions as a list of instructions on registers.
//!
//! Registers are, in this order, the constants, the inputs, the outputs and those for results that are needed for a while, which
//! are used again. Constants and inputs therefore take no instruction, and an output is computed where it belongs.

use crate::dependence::arguments;
use crate::error::ExprError;
use crate::graph::{Expression, Graph, Node};
use crate::operation::Operation;
use std::collections::HashMap;

/// What an instruction does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Code {
    /// An operation.
    One(Operation),
    /// The sine, and the cosine into the register of the third argument.
    SineAndCosine,
}

/// An instruction: registers of arguments, and of the result.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Instruction {
    pub(crate) code: Code,
    pub(crate) to: u32,
    pub(crate) from: [u32; 3],
}

impl Instruction {
    /// The registers of the arguments.
    #[inline(always)]
    pub(crate) fn registers(&self) -> [usize; 3] {
        let [a, b, c] = self.from;
        [a as usize, b as usize, c as usize]
    }
}

/// What is evaluated.
#[derive(Debug)]
pub(crate) struct Tape {
    pub(crate) instructions: Vec<Instruction>,
    pub(crate) constants: Vec<f64>,
    pub(crate) n_inputs: usize,
    pub(crate) n_outputs: usize,
    /// Registers of constants, inputs, outputs and for a while.
    pub(crate) n_registers: usize,
    /// Outputs that are a constant, an input or an earlier output: from which register, and which output.
    pub(crate) copies: Vec<(u32, u32)>,
}

/// Most registers: 8 lanes of them take 1 GB.
const MOST_REGISTERS: usize = 1 << 24;
const NONE: u32 = u32::MAX;

impl Tape {
    /// Compiles the outputs of a graph with this number of inputs.
    pub(crate) fn compile(graph: &Graph, outputs: &[Expression], n_inputs: usize) -> Result<Self, ExprError> {
        graph.check(outputs)?;
        let order = in_depth(graph, outputs);
        let mut constants = Vec::new();
        let mut registers = vec![NONE; graph.len()];
        for &x in &order {
            match graph.nodes()[x.index()] {
                Node::Constant(bits) => {
                    registers[x.index()] = constants.len() as u32;
                    constants.push(f64::from_bits(bits));
                }
                Node::Input(_) | Node::Operation(..) => {}
            }
        }
        let first_output = constants.len() + n_inputs;
        let first_free = first_output + outputs.len();
        if first_free >= MOST_REGISTERS {
            return Err(too_many(first_free));
        }
        for &x in &order {
            match graph.nodes()[x.index()] {
                Node::Input(number) if (number as usize) < n_inputs => {
                    registers[x.index()] = (constants.len() + number as usize) as u32;
                }
                Node::Input(number) => {
                    return Err(ExprError::Foreign { found: number as usize, allowed: n_inputs });
                }
                Node::Constant(_) | Node::Operation(..) => {}
            }
        }
        let mut copies = Vec::new();
        // an expression lives in the place of the first output that it is
        for (k, x) in outputs.iter().enumerate() {
            if registers[x.index()] == NONE {
                registers[x.index()] = (first_output + k) as u32;
            } else {
                copies.push((registers[x.index()], k as u32));
            }
        }
        let mut compiler = Compiler {
            graph,
            free: Vec::new(),
            n_registers: first_free,
            last_use: last_uses(graph, &order),
            first_free: first_free as u32,
            registers,
            instructions: Vec::new(),
        };
        compiler.run(&order)?;
        let Compiler { n_registers, instructions, .. } = compiler;
        Ok(Self { instructions, constants, n_inputs, n_outputs: outputs.len(), n_registers, copies })
    }

    /// Where the inputs are among the registers.
    pub(crate) fn first_input(&self) -> usize {
        self.constants.len()
    }

    /// Where the outputs are among the registers.
    pub(crate) fn first_output(&self) -> usize {
        self.constants.len() + self.n_inputs
    }
}

fn too_many(found: usize) -> ExprError {
    ExprError::TooLarge { what: "registers", found, allowed: MOST_REGISTERS }
}

/// The expressions that these are made of, arguments before results, each output as soon as it can be computed.
fn in_depth(graph: &Graph, outputs: &[Expression]) -> Vec<Expression> {
    let mut order = Vec::new();
    let mut done = vec![false; graph.len()];
    let mut stack = Vec::new();
    for &output in outputs {
        stack.push((output, 0));
        while let Some((x, k)) = stack.pop() {
            if done[x.index()] {
                continue;
            }
            match arguments(graph, x.index()).get(k) {
                Some(&argument) => {
                    stack.push((x, k + 1));
                    stack.push((argument, 0));
                }
                None => {
                    done[x.index()] = true;
                    order.push(x);
                }
            }
        }
    }
    order
}

/// For each node, where in the order it is used last.
fn last_uses(graph: &Graph, order: &[Expression]) -> Vec<u32> {
    let mut last = vec![0; graph.len()];
    for (position, x) in order.iter().enumerate() {
        arguments(graph, x.index()).iter().for_each(|a| last[a.index()] = position as u32);
    }
    last
}

struct Compiler<'g> {
    graph: &'g Graph,
    /// Registers that hold nothing that is needed any more.
    free: Vec<u32>,
    first_free: u32,
    n_registers: usize,
    registers: Vec<u32>,
    last_use: Vec<u32>,
    instructions: Vec<Instruction>,
}

impl Compiler<'_> {
    fn run(&mut self, order: &[Expression]) -> Result<(), ExprError> {
        let partners = partners(self.graph, order);
        let mut computed = vec![false; self.graph.len()];
        for (position, &x) in order.iter().enumerate() {
            let Node::Operation(operation, inner) = self.graph.nodes()[x.index()] else { continue };
            if !computed[x.index()] {
                let from = inner.map(|a| self.registers.get(a.index()).copied().unwrap_or(0));
                match partners.get(&x) {
                    None => {
                        self.release(&inner[..operation.arity()], position);
                        let to = self.place(x)?;
                        self.instructions.push(Instruction { code: Code::One(operation), to, from });
                    }
                    Some(&(sine, cosine)) => {
                        // both results are placed before the argument's register is free
                        let (to, also) = (self.place(sine)?, self.place(cosine)?);
                        let from = [from[0], also, also];
                        self.instructions.push(Instruction { code: Code::SineAndCosine, to, from });
                        computed[sine.index()] = true;
                        computed[cosine.index()] = true;
                        self.release(&inner[..1], position);
                    }
                }
            } else {
                self.release(&inner[..operation.arity()], position);
            }
        }
        Ok(())
    }

    /// The register of a result: that of an output, or one for a while.
    fn place(&mut self, x: Expression) -> Result<u32, ExprError> {
        if self.registers[x.index()] == NONE {
            self.registers[x.index()] = match self.free.pop() {
                Some(register) => register,
                None if self.n_registers >= MOST_REGISTERS => return Err(too_many(self.n_registers + 1)),
                None => {
                    self.n_registers += 1;
                    (self.n_registers - 1) as u32
                }
            };
        }
        Ok(self.registers[x.index()])
    }

    /// Frees the registers of arguments that are used here for the last time.
    fn release(&mut self, inner: &[Expression], position: usize) {
        for (k, a) in inner.iter().enumerate() {
            let register = self.registers[a.index()];
            let last = self.last_use[a.index()] as usize == position;
            if last && register >= self.first_free && !inner[..k].contains(a) {
                self.free.push(register);
            }
        }
    }
}

/// Sines and cosines of the same argument, under either.
fn partners(graph: &Graph, order: &[Expression]) -> HashMap<Expression, (Expression, Expression)> {
    let mut sines = HashMap::new();
    for &x in order {
        if let Node::Operation(Operation::Sin, [argument, ..]) = graph.nodes()[x.index()] {
            sines.insert(argument, x);
        }
    }
    let mut both = HashMap::new();
    for &x in order {
        if let Node::Operation(Operation::Cos, [argument, ..]) = graph.nodes()[x.index()]
            && let Some(&sine) = sines.get(&argument)
        {
            both.insert(sine, (sine, x));
            both.insert(x, (sine, x));
        }
    }
    both
}
