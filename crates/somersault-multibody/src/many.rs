//! Dynamics of many states of one tree, several at a time in the lanes of vector instructions.
//!
//! The recursions are those of one state, over [`Packed`] numbers: a lane goes through the rounded operations that its state
//! goes through alone, so that every result is **the same to the last bit**, whichever instructions the processor has and
//! whichever states are computed together. Constants of the model are kept once and broadcast.
//!
//! States are computed one by one where there is one lane only, where joints follow others, and where the
//! mass matrix of a state beside them is singular or not finite.

use crate::articulated::AllPassive;
use crate::data::{Data, Node, Pivot};
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use nalgebra::Vector3;
use somersault_core::argument::expect_length;
use somersault_core::lanes::{InstructionSet, Kernel, Lanes, Packed, WIDEST};
use somersault_core::scalar::Lift;
use std::any::Any;
use std::marker::PhantomData;
use std::ops::Range;

/// Workspace for many states of one model, made once and used repeatedly; with it nothing allocates.
///
/// On several threads each has its own.
#[derive(Debug)]
pub struct LaneData {
    instructions: InstructionSet,
    alone: Alone,
    /// The [`Room`] of the lanes of these instructions; none where states are computed one by one.
    room: Option<Box<dyn Any + Send + Sync>>,
}

impl LaneData {
    /// The most states that are computed at a time: of as many, or a multiple of it, no lane is idle.
    pub const MOST: usize = WIDEST;

    /// A workspace for `model`, with the widest vector instructions of this processor.
    pub fn new(model: &Model) -> Self {
        Self::with_instructions(model, InstructionSet::detect())
    }

    /// The same with chosen vector instructions, which change the duration and not the results.
    pub fn with_instructions(model: &Model, instructions: InstructionSet) -> Self {
        let alone = Alone { data: Data::new(model), wrenches: Vec::with_capacity(model.n_bodies()) };
        let room = model.coupling.is_none().then(|| instructions.run(Make { model })).flatten();
        Self { instructions, alone, room }
    }
}

/// What one state is computed with.
#[derive(Debug)]
struct Alone {
    data: Data,
    wrenches: Vec<Force<f64>>,
}

/// What the states in all lanes are computed with.
#[derive(Debug)]
struct Room<L: Lanes> {
    nodes: Vec<Node<Packed<L>>>,
    momenta: Vec<Force<Packed<L>>>,
    pivots: Vec<Pivot<Packed<L>>>,
    q: Vec<Packed<L>>,
    v: Vec<Packed<L>>,
    input: Vec<Packed<L>>,
    output: Vec<Packed<L>>,
    wrenches: Vec<Force<Packed<L>>>,
    /// Numbers of one argument, those of the lanes side by side.
    numbers: Vec<f64>,
}

struct Make<'a> {
    model: &'a Model,
}

impl Kernel for Make<'_> {
    type Output = Option<Box<dyn Any + Send + Sync>>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Output {
        if L::WIDTH == 1 {
            return None;
        }
        let (n_q, n, n_bodies) = (self.model.n_positions(), self.model.n_velocities(), self.model.n_bodies());
        let zero = Packed::lift(lanes, 0.0);
        let force = Force::zero().lift(lanes);
        Some(Box::new(Room::<L> {
            nodes: vec![Node::at_rest::<f64>(lanes); n_bodies],
            momenta: vec![force; n],
            pivots: vec![Pivot { inverse: zero, residual: zero }; n],
            q: vec![zero; n_q],
            v: vec![zero; n],
            input: vec![zero; n],
            output: vec![zero; n],
            wrenches: vec![force; n_bodies],
            numbers: vec![0.0; n_q.max(6 * n_bodies) * L::WIDTH],
        }))
    }
}

/// A recursion over the tree, for one state and for several.
trait Recursion {
    /// Name of the third argument: accelerations or joint forces.
    const INPUT: &'static str;

    fn alone<'d>(
        model: &Model,
        data: &'d mut Data,
        q: &[f64],
        v: &[f64],
        input: &[f64],
        wrenches: &[Force<f64>],
    ) -> Result<&'d [f64], DynamicsError>;

    /// Whether all lanes have a result.
    fn in_lanes<L: Lanes>(model: &Model, lanes: L, room: &mut Room<L>, has_wrenches: bool) -> bool;
}

struct Inverse;

impl Recursion for Inverse {
    const INPUT: &'static str = "a";

    fn alone<'d>(
        model: &Model,
        data: &'d mut Data,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        wrenches: &[Force<f64>],
    ) -> Result<&'d [f64], DynamicsError> {
        model.inverse_dynamics(data, q, v, a, wrenches)
    }

    #[inline(always)]
    fn in_lanes<L: Lanes>(model: &Model, lanes: L, room: &mut Room<L>, has_wrenches: bool) -> bool {
        let Room { nodes, q, v, input, output, wrenches, .. } = room;
        let wrenches = if has_wrenches { &wrenches[..] } else { &[] };
        model.newton_euler::<true, _>(lanes, nodes, output, q, v, input, wrenches);
        true
    }
}

struct Forward;

impl Recursion for Forward {
    const INPUT: &'static str = "torque";

    fn alone<'d>(
        model: &Model,
        data: &'d mut Data,
        q: &[f64],
        v: &[f64],
        torque: &[f64],
        wrenches: &[Force<f64>],
    ) -> Result<&'d [f64], DynamicsError> {
        model.forward_dynamics(data, q, v, torque, wrenches)
    }

    #[inline(always)]
    fn in_lanes<L: Lanes>(model: &Model, lanes: L, room: &mut Room<L>, has_wrenches: bool) -> bool {
        let Room { nodes, momenta, pivots, q, v, input, output, wrenches, .. } = room;
        let wrenches = if has_wrenches { &wrenches[..] } else { &[] };
        let found = model.articulate(lanes, &AllPassive, nodes, momenta, pivots, q, v, &[], input, wrenches);
        if found.is_err() {
            return false;
        }
        model.release(lanes, &AllPassive, nodes, momenta, pivots, output, &mut []);
        true
    }
}

/// Rows of numbers, one for each state or one that stands for all.
#[derive(Clone, Copy)]
struct Rows<'a> {
    numbers: &'a [f64],
    length: usize,
    many: bool,
}

impl<'a> Rows<'a> {
    fn new(
        argument: &'static str,
        numbers: &'a [f64],
        length: usize,
        count: usize,
    ) -> Result<Self, DynamicsError> {
        let many = numbers.len() != length;
        if many {
            expect_length(argument, numbers.len(), length.saturating_mul(count))?;
        }
        Ok(Self { numbers, length, many })
    }

    #[inline(always)]
    fn row(&self, i: usize) -> &'a [f64] {
        let start = if self.many { i * self.length } else { 0 };
        &self.numbers[start..start + self.length]
    }

    /// The rows of these states side by side; lanes without a state have the last one.
    #[inline(always)]
    fn interleave<L: Lanes>(&self, states: Range<usize>, numbers: &mut [f64]) {
        for lane in 0..L::WIDTH {
            let row = self.row((states.start + lane).min(states.end - 1));
            for (x, to) in row.iter().zip(numbers.chunks_exact_mut(L::WIDTH)) {
                to[lane] = *x;
            }
        }
    }
}

/// Many states and where their results go.
struct Many<'a, R> {
    model: &'a Model,
    q: Rows<'a>,
    v: Rows<'a>,
    input: Rows<'a>,
    wrenches: Rows<'a>,
    recursion: PhantomData<R>,
    /// As many rows as there are states.
    output: &'a mut [f64],
    failure: Option<(usize, DynamicsError)>,
}

impl<R: Recursion> Many<'_, R> {
    fn count(&self) -> usize {
        self.output.len() / self.input.length
    }

    /// These states one by one. What has no result becomes NaN, and the first failure is kept.
    fn one_by_one(&mut self, states: Range<usize>, Alone { data, wrenches }: &mut Alone) {
        let n = self.input.length;
        for i in states {
            let force =
                |f: &[f64]| Force::new(Vector3::new(f[0], f[1], f[2]), Vector3::new(f[3], f[4], f[5]));
            wrenches.clear();
            wrenches.extend(self.wrenches.row(i).chunks_exact(6).map(force));
            let [q, v, input] = [self.q, self.v, self.input].map(|rows| rows.row(i));
            let out = &mut self.output[i * n..(i + 1) * n];
            match R::alone(self.model, data, q, v, input, wrenches) {
                Ok(found) => out.copy_from_slice(found),
                Err(error) => {
                    out.fill(f64::NAN);
                    self.failure.get_or_insert((i, error));
                }
            }
        }
    }

    /// As many states as there are lanes, or fewer; whether they have results.
    #[inline(always)]
    fn together<L: Lanes>(&mut self, states: Range<usize>, lanes: L, room: &mut Room<L>) -> bool {
        let Room { q, v, input, wrenches, numbers, .. } = room;
        let packed = |numbers: &[f64], k: usize| Packed::load(lanes, &numbers[k * L::WIDTH..]);
        for (rows, to) in [(self.q, q), (self.v, v), (self.input, input)] {
            rows.interleave::<L>(states.clone(), numbers);
            for (k, to) in to.iter_mut().enumerate() {
                *to = packed(numbers, k);
            }
        }
        let has_wrenches = self.wrenches.length > 0;
        if has_wrenches {
            self.wrenches.interleave::<L>(states.clone(), numbers);
            for (i, to) in wrenches.iter_mut().enumerate() {
                let at = |k| packed(numbers, 6 * i + k);
                *to = Force::new(Vector3::new(at(0), at(1), at(2)), Vector3::new(at(3), at(4), at(5)));
            }
        }
        if !R::in_lanes(self.model, lanes, room, has_wrenches) {
            return false;
        }
        let Room { output, numbers, .. } = room;
        let n = self.input.length;
        for (found, to) in output.iter().zip(numbers.chunks_exact_mut(L::WIDTH)) {
            found.store(to);
        }
        for (lane, i) in states.enumerate() {
            let row = &mut self.output[i * n..(i + 1) * n];
            for (to, found) in row.iter_mut().zip(numbers.chunks_exact(L::WIDTH)) {
                *to = found[lane];
            }
        }
        true
    }
}

/// All states, group by group.
struct Groups<'a, 'b, R> {
    many: &'a mut Many<'b, R>,
    room: &'a mut (dyn Any + Send + Sync),
    alone: &'a mut Alone,
}

impl<R: Recursion> Kernel for Groups<'_, '_, R> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { many, room, alone } = self;
        let count = many.count();
        if L::WIDTH == 1 {
            many.one_by_one(0..count, alone);
        } else if let Some(room) = room.downcast_mut::<Room<L>>() {
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
        self.evaluate_many::<Forward>(data, q, v, torque, wrenches, ("acceleration", acceleration))
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
        self.evaluate_many::<Inverse>(data, q, v, a, wrenches, ("torque", torque))
    }

    fn evaluate_many<R: Recursion>(
        &self,
        data: &mut LaneData,
        q: &[f64],
        v: &[f64],
        input: &[f64],
        wrenches: &[f64],
        (name, output): (&'static str, &mut [f64]),
    ) -> Result<(), DynamicsError> {
        let LaneData { instructions, alone, room } = data;
        alone.data.expect_for(self)?;
        let n = self.n_velocities();
        let count = output.len().checked_div(n).unwrap_or(0);
        expect_length(name, output.len(), count * n)?;
        let length = if wrenches.is_empty() { 0 } else { 6 * self.n_bodies() };
        let mut many = Many::<R> {
            model: self,
            q: Rows::new("q", q, self.n_positions(), count)?,
            v: Rows::new("v", v, n, count)?,
            input: Rows::new(R::INPUT, input, n, count)?,
            wrenches: Rows::new("wrenches", wrenches, length, count)?,
            recursion: PhantomData,
            output,
            failure: None,
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
