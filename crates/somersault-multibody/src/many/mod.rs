//! Dynamics of many states of one tree and their partials, several at a time in the lanes of vector instructions.
//!
//! The recursions are those of one state, over [`Packed`](somersault_core::lanes::Packed) numbers: a lane goes through the rounded operations that its state
//! goes through alone, so that every result is **the same to the last bit**, whichever instructions the processor has and
//! whichever states are computed together. Constants of the model are kept once and broadcast.
//!
//! States are computed one by one where there is one lane only, where joints follow others, and where the
//! mass matrix of a state beside them is singular or not finite.

mod evaluation;
mod rows;

use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use evaluation::{
    Derivatives, Dynamics, Evaluation, Forward, ForwardPartials, Inverse, InversePartials, MassMatrix,
    Workspace,
};
pub(crate) use rows::Rows;
use rows::{Inputs, wrench, write_row, write_rows};
use somersault_core::argument::expect_length;
use somersault_core::lanes::{InstructionSet, Kernel, Lanes, WIDEST};
use std::any::Any;
use std::marker::PhantomData;
use std::ops::Range;

/// Workspace for the dynamics of many states of one model, made once and used repeatedly; with it nothing allocates.
///
/// On several threads each has its own.
#[derive(Debug)]
pub struct LaneData(Shared<Dynamics>);

/// Workspace for partials of the dynamics of many states, apart from [`LaneData`] because few need it and it is larger: seven
/// n × n matrices for each lane.
#[derive(Debug)]
pub struct LaneDerivativeData(Shared<Derivatives>);

impl LaneData {
    /// The most states that are computed at a time: of as many, or a multiple of it, no lane is idle.
    pub const MOST: usize = WIDEST;

    /// A workspace for `model`, with the widest vector instructions of this processor.
    pub fn new(model: &Model) -> Self {
        Self::with_instructions(model, InstructionSet::detect())
    }

    /// The same with chosen vector instructions, which change the duration and not the results.
    pub fn with_instructions(model: &Model, instructions: InstructionSet) -> Self {
        Self(Shared::new(model, instructions))
    }
}

impl LaneDerivativeData {
    /// A workspace for `model`, with the widest vector instructions of this processor.
    pub fn new(model: &Model) -> Self {
        Self::with_instructions(model, InstructionSet::detect())
    }

    /// The same with chosen vector instructions, which change the duration and not the results.
    pub fn with_instructions(model: &Model, instructions: InstructionSet) -> Self {
        Self(Shared::new(model, instructions))
    }
}

/// A workspace for one state and for those in lanes.
#[derive(Debug)]
struct Shared<W: Workspace> {
    instructions: InstructionSet,
    alone: Alone<W>,
    /// The [`Room`] of the lanes of these instructions; none where states are computed one by one.
    room: Option<Box<dyn Any + Send + Sync>>,
}

/// What one state is computed with.
#[derive(Debug)]
struct Alone<W: Workspace> {
    work: W::Alone,
    wrenches: Vec<Force<f64>>,
}

/// What the states in all lanes are computed with.
#[derive(Debug)]
struct Room<W: Workspace, L: Lanes> {
    inputs: Inputs<L>,
    own: W::Room<L>,
}

struct Make<'a, W> {
    model: &'a Model,
    workspace: PhantomData<W>,
}

impl<W: Workspace + 'static> Kernel for Make<'_, W> {
    type Output = Option<Box<dyn Any + Send + Sync>>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Output {
        if L::WIDTH == 1 {
            return None;
        }
        let (inputs, own) = (Inputs::new(lanes, self.model), W::room(lanes, self.model));
        Some(Box::new(Room::<W, L> { inputs, own }))
    }
}

impl<W: Workspace + 'static> Shared<W> {
    fn new(model: &Model, instructions: InstructionSet) -> Self {
        let alone = Alone { work: W::alone(model), wrenches: Vec::with_capacity(model.n_bodies()) };
        let make = Make { model, workspace: PhantomData::<W> };
        let room = model.coupling.is_none().then(|| instructions.run(make)).flatten();
        Self { instructions, alone, room }
    }

    fn evaluate<E: Evaluation<Workspace = W>>(
        &mut self,
        model: &Model,
        [q, v, given]: [&[f64]; 3],
        wrenches: &[f64],
        (name, output): (&'static str, &mut [f64]),
    ) -> Result<(), DynamicsError> {
        let Self { instructions, alone, room } = self;
        W::expect_for(&alone.work, model)?;
        let length = E::length(model);
        let count = output.len().checked_div(length).unwrap_or(0);
        expect_length(name, output.len(), count * length)?;
        let n_v = E::MOTION.map_or(0, |_| model.n_velocities());
        let n_f = if wrenches.is_empty() { 0 } else { 6 * model.n_bodies() };
        let mut many = Many::<E> {
            model,
            arguments: [
                Rows::new("q", q, model.n_positions(), count)?,
                Rows::new("v", v, n_v, count)?,
                Rows::new(E::MOTION.unwrap_or_default(), given, n_v, count)?,
            ],
            wrenches: Rows::new("wrenches", wrenches, n_f, count)?,
            output,
            length,
            count,
            failure: None,
            evaluation: PhantomData,
        };
        match room {
            Some(room) if count > 1 => {
                instructions.run(Groups { many: &mut many, room: room.as_mut(), alone });
            }
            _ => many.one_by_one(0..count, alone),
        }
        match many.failure {
            None => Ok(()),
            Some((index, source)) => Err(DynamicsError::InState { index, source: Box::new(source) }),
        }
    }
}

/// Many states and where their results go.
struct Many<'a, E> {
    model: &'a Model,
    /// q, v, and accelerations or joint forces.
    arguments: [Rows<'a>; 3],
    wrenches: Rows<'a>,
    /// As many rows of this length as there are states.
    output: &'a mut [f64],
    length: usize,
    count: usize,
    failure: Option<(usize, DynamicsError)>,
    evaluation: PhantomData<E>,
}

impl<E: Evaluation> Many<'_, E> {
    /// These states one by one. What has no result becomes NaN, and the first failure is kept.
    fn one_by_one(&mut self, states: Range<usize>, Alone { work, wrenches }: &mut Alone<E::Workspace>) {
        for i in states {
            wrenches.clear();
            wrenches.extend(self.wrenches.row(i).chunks_exact(6).map(wrench));
            let arguments = self.arguments.map(|rows| rows.row(i));
            let out = &mut self.output[i * self.length..(i + 1) * self.length];
            match E::alone(self.model, work, arguments, wrenches) {
                Ok(found) => write_row(found, self.model.n_velocities(), out),
                Err(error) => {
                    out.fill(f64::NAN);
                    self.failure.get_or_insert((i, error));
                }
            }
        }
    }

    /// As many states as there are lanes, or fewer; whether they have results.
    #[inline(always)]
    fn together<L: Lanes>(
        &mut self,
        states: Range<usize>,
        lanes: L,
        Room { inputs, own }: &mut Room<E::Workspace, L>,
    ) -> bool {
        inputs.load(lanes, states.clone(), self.arguments, self.wrenches);
        let Some(found) = E::in_lanes(self.model, lanes, inputs, own) else {
            return false;
        };
        let out = &mut self.output[states.start * self.length..states.end * self.length];
        write_rows(found, self.model.n_velocities(), &mut inputs.numbers, states.len(), out);
        true
    }
}

/// All states, group by group.
struct Groups<'a, 'b, E: Evaluation> {
    many: &'a mut Many<'b, E>,
    room: &'a mut (dyn Any + Send + Sync),
    alone: &'a mut Alone<E::Workspace>,
}

impl<E: Evaluation<Workspace: 'static>> Kernel for Groups<'_, '_, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { many, room, alone } = self;
        let count = many.count;
        if L::WIDTH == 1 {
            many.one_by_one(0..count, alone);
        } else if let Some(room) = room.downcast_mut::<Room<E::Workspace, L>>() {
            for first in (0..count).step_by(L::WIDTH) {
                let states = first..count.min(first + L::WIDTH);
                if !many.together(states.clone(), lanes, room) {
                    many.one_by_one(states, alone);
                }
            }
        }
    }
}

impl Model {
    /// [`forward_dynamics`](Self::forward_dynamics) of many states: `acceleration` has room for as many rows of n numbers as
    /// there are states, and the arguments have a row for each, or one that stands for all.
    ///
    /// `wrenches` has six numbers for each body, force before moment, or nothing. Each row has the bits that it has alone. Cost
    /// O(n) for each state, in vector instructions for as many states at a time as they have lanes.
    ///
    /// Errors: lengths that do not fit; a state whose mass matrix is singular or not finite, the first one by its number
    /// ([`DynamicsError::InState`]). Then its row is NaN, and the rows of all other states are complete.
    ///
    /// ```
    /// use somersault_multibody::{LaneData, models::TwoLinkArm};
    /// let arm = TwoLinkArm::default().model()?;
    /// let mut data = LaneData::new(&arm);
    /// let q = [0.0, 0.0, 0.1, 0.2, 0.3, 0.4];       // three configurations
    /// let mut acceleration = [0.0; 6];
    /// arm.forward_dynamics_many(&mut data, &q, &[1.0, -0.5], &[0.0, 0.0], &[], &mut acceleration)?;
    /// assert!(acceleration.iter().all(|a| a.is_finite()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn forward_dynamics_many(
        &self,
        data: &mut LaneData,
        q: &[f64],
        v: &[f64],
        torque: &[f64],
        wrenches: &[f64],
        acceleration: &mut [f64],
    ) -> Result<(), DynamicsError> {
        data.0.evaluate::<Forward>(self, [q, v, torque], wrenches, ("acceleration", acceleration))
    }

    /// [`inverse_dynamics`](Self::inverse_dynamics) of many states, with rows as
    /// [`forward_dynamics_many`](Self::forward_dynamics_many) has them.
    pub fn inverse_dynamics_many(
        &self,
        data: &mut LaneData,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        wrenches: &[f64],
        torque: &mut [f64],
    ) -> Result<(), DynamicsError> {
        data.0.evaluate::<Inverse>(self, [q, v, a], wrenches, ("torque", torque))
    }

    /// [`mass_matrix`](Self::mass_matrix) of many configurations: `matrices` has room for as many rows of n² numbers. Each row has the
    /// bits that it has alone. Cost O(n × depth) for each configuration.
    ///
    /// Errors: lengths that do not fit.
    pub fn mass_matrix_many(
        &self,
        data: &mut LaneData,
        q: &[f64],
        matrices: &mut [f64],
    ) -> Result<(), DynamicsError> {
        data.0.evaluate::<MassMatrix>(self, [q, &[], &[]], &[], ("matrices", matrices))
    }

    /// [`inverse_dynamics_partials`](Self::inverse_dynamics_partials) of many states, with arguments as
    /// [`forward_dynamics_many`](Self::forward_dynamics_many) has them.
    ///
    /// `rows` has room for n + 3 n² numbers for each state: the joint forces, then ∂τ/∂q, ∂τ/∂v and ∂τ/∂a = M, each matrix row by row.
    /// Each row has the bits that it has alone. Cost O(n × depth) for each state.
    ///
    /// Errors: lengths that do not fit.
    pub fn inverse_dynamics_partials_many(
        &self,
        data: &mut LaneDerivativeData,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        wrenches: &[f64],
        rows: &mut [f64],
    ) -> Result<(), DynamicsError> {
        data.0.evaluate::<InversePartials>(self, [q, v, a], wrenches, ("rows", rows))
    }

    /// [`forward_dynamics_partials`](Self::forward_dynamics_partials) of many states, with arguments as
    /// [`forward_dynamics_many`](Self::forward_dynamics_many) has them.
    ///
    /// `rows` has room for n + 3 n² numbers for each state: the accelerations, then ∂a/∂q, ∂a/∂v and ∂a/∂τ = M⁻¹, each matrix row by
    /// row. Each row has the bits that it has alone. Cost O(n² × depth) for each state.
    ///
    /// Errors as of [`forward_dynamics_many`](Self::forward_dynamics_many), with NaN in the whole row.
    ///
    /// ```
    /// use somersault_multibody::{LaneDerivativeData, models::TwoLinkArm};
    /// let arm = TwoLinkArm::default().model()?;
    /// let mut data = LaneDerivativeData::new(&arm);
    /// let q = [0.0, 0.0, 0.1, 0.2, 0.3, 0.4];       // three configurations
    /// let mut rows = [0.0; 3 * 14];
    /// arm.forward_dynamics_partials_many(&mut data, &q, &[1.0, -0.5], &[0.0, 0.0], &[], &mut rows)?;
    /// let inverse_of_mass = &rows[14 + 10..28];     // of the second one
    /// assert!(inverse_of_mass[0] > 0.0 && (inverse_of_mass[1] - inverse_of_mass[2]).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn forward_dynamics_partials_many(
        &self,
        data: &mut LaneDerivativeData,
        q: &[f64],
        v: &[f64],
        torque: &[f64],
        wrenches: &[f64],
        rows: &mut [f64],
    ) -> Result<(), DynamicsError> {
        data.0.evaluate::<ForwardPartials>(self, [q, v, torque], wrenches, ("rows", rows))
    }
}
