//! The reduced motion of a tree in flight in many shapes, several at a time in the lanes of vector instructions.
//!
//! What depends on the shape alone is most of the work of an evaluation, and shapes that are given in time do not wait for
//! orientations: they are set together, the orientation is integrated with what is left of each, and the derivatives
//! at the orientations that were found are again evaluated together.

use super::tree::{FlightTree, Shape};
use super::{Flight, FlightDerivatives};
use crate::error::DynamicsError;
use crate::flight::step::{SHAPE_OF, STAGES, StageRate, StepDerivative, turn};
use crate::lane_room::{Kept, LaneRoom, Room};
use crate::many::Rows;
use crate::model::Model;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::argument::{expect_length, expect_range};
use somersault_core::lanes::{InstructionSet, Kernel, Lanes, Packed};
use somersault_core::scalar::Lift;

/// Shapes of one tree and the workspace to evaluate them, made when it is first used and used repeatedly. A clone has no shapes.
///
/// ```
/// use nalgebra::Vector3;
/// use somersault_multibody::flight::{Flight, FlightShapes, TakeOff};
/// use somersault_multibody::models::Diver;
/// let model = Diver::planar().model()?;
/// let zero = Vector3::zeros();
/// let take_off =
///     TakeOff { time: 0.0, center_of_mass: zero, velocity: zero, angular_momentum: Vector3::new(0.0, 60.0, 0.0) };
/// let flight = Flight::try_new(&model, take_off)?;
/// let mut shapes = FlightShapes::default();
/// let (q, v) = (vec![0.1; 2 * 9], vec![0.0; 2 * 9]);       // two shapes of nine joints
/// flight.set_shapes(&mut shapes, 2, &q, &v, true)?;
/// let rate = flight.rate_of_shape(&shapes, 1, &[0.5])?;    // the second, with the root at 0.5 rad
/// flight.derivatives_of_shapes(&mut shapes, &[0.5, 0.5], &mut |_, derivatives| {
///     assert_eq!(derivatives.angular_velocity, rate.angular_velocity);
/// })?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Default)]
pub struct FlightShapes {
    /// Of [`Groups`].
    room: LaneRoom,
    shapes: Vec<Shape<f64>>,
    has_directions: bool,
    /// Numbers of the orientations that steps through the shapes had, at the two stages of each shape.
    orientations: [Vec<f64>; 2],
}

/// The most shapes, each of which has some hundred bytes for each body.
const MOST: usize = 1 << 16;
/// States that are evaluated together where there are many.
const BLOCK: usize = 64;

/// Which of the two stages of a shape a stage of a step is: that at the end of a step comes before that at the start of the next.
const TURN_OF: [usize; STAGES] = [1, 0, 1, 0];

/// The step and the stage that have a shape, at the first or second of its stages; nothing where that would be before the first step or after
/// the last.
fn stage_of(shape: usize, turn: usize, n_steps: usize) -> Option<[usize; 2]> {
    let stage = (0..STAGES).find(|stage| TURN_OF[*stage] == turn && SHAPE_OF[*stage] % 2 == shape % 2)?;
    let step = shape.checked_sub(SHAPE_OF[stage])? / 2;
    (step < n_steps).then_some([step, stage])
}

impl Clone for FlightShapes {
    fn clone(&self) -> Self {
        Self::with_instructions(self.room.instructions)
    }
}

impl FlightShapes {
    /// With chosen vector instructions in the place of the widest of this processor: they change the duration and not the results.
    pub fn with_instructions(instructions: InstructionSet) -> Self {
        Self { room: LaneRoom::with_instructions(instructions), ..Self::default() }
    }
}

/// What the shapes in all lanes are evaluated with.
#[derive(Debug)]
struct Groups<L: Lanes> {
    /// As many shapes each as there are lanes.
    groups: Vec<FlightTree<Packed<L>>>,
    q: Vec<Packed<L>>,
    v: Vec<Packed<L>>,
    /// Numbers on their way into lanes or out of them, those of the lanes side by side.
    numbers: Vec<f64>,
    /// Derivatives of one shape.
    alone: [Vec<Vector3<f64>>; 2],
}

impl<L: Lanes> Room<L> for Groups<L> {
    fn new(lanes: L, model: &Model) -> Self {
        let (n_q, n) = (model.n_positions(), model.n_velocities());
        let n_shape = n - model.velocities_of(0).len();
        let zero = Packed::lift(lanes, 0.0);
        let vectors = vec![Vector3::zeros(); n_shape];
        Self {
            groups: Vec::new(),
            q: vec![zero; n_q],
            v: vec![zero; n],
            // as many as these lanes need and no more, so that too few are too few on every processor
            numbers: vec![0.0; (FRONT + 6 * n_shape).max(n_q).max(n) * L::WIDTH],
            alone: [vectors.clone(), vectors],
        }
    }

    fn is_for(&self, model: &Model) -> bool {
        self.q.len() == model.n_positions()
            && self.v.len() == model.n_velocities()
            && self.groups.first().is_none_or(|group| group.is_for(model))
    }
}

/// Numbers of a state beside the derivatives by its shape: angular velocity, its derivatives by orientation and by angular momentum.
const FRONT: usize = 3 + 9 + 9;

/// Numbers of lanes in memory, those of the lanes side by side.
#[inline(always)]
fn store<'x, L: Lanes>(from: impl Iterator<Item = &'x Packed<L>>, numbers: &mut [f64]) {
    for (x, to) in from.zip(numbers.chunks_exact_mut(L::WIDTH)) {
        x.store(to);
    }
}

/// The vector of one lane, number `k` of those in memory.
#[inline(always)]
fn vector<L: Lanes>(numbers: &[f64], k: usize, lane: usize) -> Vector3<f64> {
    let at = |c: usize| numbers[(3 * k + c) * L::WIDTH + lane];
    Vector3::new(at(0), at(1), at(2))
}

/// The matrix of one lane whose columns begin with vector `k`.
#[inline(always)]
fn matrix<L: Lanes>(numbers: &[f64], k: usize, lane: usize) -> Matrix3<f64> {
    Matrix3::from_columns(&[0, 1, 2].map(|c| vector::<L>(numbers, k + c, lane)))
}

struct SetShapes<'a, 'm> {
    flight: &'a Flight<'m>,
    room: &'a mut Kept,
    count: usize,
    q: Rows<'a>,
    v: Rows<'a>,
    with_directions: bool,
    shapes: &'a mut Vec<Shape<f64>>,
}

impl Kernel for SetShapes<'_, '_> {
    /// Whether all trees have inertia about all axes.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let Self { flight, room, count, q, v, with_directions, shapes } = self;
        let model = flight.model;
        let Some(room) = room.fitting::<L, Groups<L>>(lanes, model) else { return false };
        while room.groups.len() * L::WIDTH < count {
            room.groups.push(FlightTree::new(lanes, model));
        }
        let (root_q, root_v) = (flight.orientation().end, flight.n_root());
        shapes.clear();
        for (group, first) in room.groups.iter_mut().zip((0..count).step_by(L::WIDTH)) {
            let states = first..count.min(first + L::WIDTH);
            for (rows, to) in [(q, &mut room.q[root_q..]), (v, &mut room.v[root_v..])] {
                rows.interleave::<L>(states.clone(), &mut room.numbers);
                for (to, numbers) in to.iter_mut().zip(room.numbers.chunks_exact(L::WIDTH)) {
                    *to = Packed::load(lanes, numbers);
                }
            }
            if flight.set_shape_in(lanes, group, &room.q, &room.v).is_none() {
                return false;
            }
            if with_directions {
                flight.set_directions_in(lanes, group);
            }
            let Shape { center, inverse_inertia, angular, linear } = &group.shape;
            let numbers =
                center.iter().chain(inverse_inertia.iter()).chain(angular.iter()).chain(linear.iter());
            store(numbers, &mut room.numbers);
            for lane in 0..states.len() {
                let numbers = &room.numbers;
                shapes.push(Shape {
                    center: vector::<L>(numbers, 0, lane),
                    inverse_inertia: matrix::<L>(numbers, 1, lane),
                    angular: vector::<L>(numbers, 4, lane),
                    linear: vector::<L>(numbers, 5, lane),
                });
            }
        }
        true
    }
}

struct Derive<'a, 'm> {
    flight: &'a Flight<'m>,
    room: &'a mut Kept,
    count: usize,
    orientations: Rows<'a>,
    read: &'a mut dyn FnMut(usize, FlightDerivatives<'_>),
}

impl Kernel for Derive<'_, '_> {
    /// Whether the shapes were set for this tree.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let Self { flight, room, count, orientations, read } = self;
        let Some(Groups { groups, numbers, alone, .. }) = room.existing::<L, _>(flight.model) else {
            return false;
        };
        let mut orientation = [Packed::lift(lanes, 0.0); 4];
        let [by_shape, by_shape_velocity] = alone;
        let n = by_shape.len();
        for (group, first) in groups.iter_mut().zip((0..count).step_by(L::WIDTH)) {
            let states = first..count.min(first + L::WIDTH);
            orientations.interleave::<L>(states.clone(), numbers);
            for (to, numbers) in
                orientation.iter_mut().zip(numbers.chunks_exact(L::WIDTH)).take(flight.orientation().len())
            {
                *to = Packed::load(lanes, numbers);
            }
            let reduced = flight.reduce_in(lanes, &group.shape, &orientation);
            let (of_orientation, of_momentum) =
                (group.shape.by_orientation(&reduced), group.shape.by_angular_momentum(&reduced));
            let omega = &reduced.velocity.angular;
            store(omega.iter().chain(of_orientation.iter()).chain(of_momentum.iter()), numbers);
            let [of_shape, of_velocity] = flight.derive_in(lanes, group, &reduced);
            let (front, rest) = numbers.split_at_mut(FRONT * L::WIDTH);
            store(of_shape.iter().flat_map(|vector| vector.iter()), rest);
            store(of_velocity.iter().flat_map(|vector| vector.iter()), &mut rest[3 * n * L::WIDTH..]);
            for lane in 0..states.len() {
                for (k, (a, b)) in by_shape.iter_mut().zip(by_shape_velocity.iter_mut()).enumerate() {
                    *a = vector::<L>(rest, k, lane);
                    *b = vector::<L>(rest, n + k, lane);
                }
                let found = FlightDerivatives {
                    angular_velocity: vector::<L>(front, 0, lane),
                    by_shape,
                    by_shape_velocity,
                    by_orientation: matrix::<L>(front, 1, lane),
                    by_angular_momentum: matrix::<L>(front, 4, lane),
                };
                read(first + lane, found);
            }
        }
        true
    }
}

impl Flight<'_> {
    /// Sets `count` shapes: rows of positions and of velocities of all joints but the root's, as they are in q and v. Cost O(n) for
    /// each, in vector instructions for as many at a time as they have lanes; with `with_directions` also what derivatives have in common.
    ///
    /// All results are those of single shapes to the last bit, whichever instructions the processor has.
    ///
    /// Errors: more than 65,536 shapes; lengths that do not fit; a tree without inertia about some axis in a shape, the first one by
    /// its number ([`DynamicsError::InState`]). Then no shape is set.
    pub fn set_shapes(
        &self,
        shapes: &mut FlightShapes,
        count: usize,
        q: &[f64],
        v: &[f64],
        with_directions: bool,
    ) -> Result<(), DynamicsError> {
        let (n_q, n) =
            (self.model.n_positions() - self.orientation().end, self.model.n_velocities() - self.n_root());
        let FlightShapes { room, shapes, has_directions, orientations } = shapes;
        shapes.clear();
        expect_range("count", count as f64, "at most 65536", |_| count <= MOST)?;
        let (q, v) = (Rows::of_each("q", q, n_q, count)?, Rows::of_each("v", v, n, count)?);
        let still: &[f64] = if self.is_planar { &[0.0] } else { &[0.0, 0.0, 0.0, 1.0] };
        for orientations in orientations {
            orientations.clear();
            orientations.extend(still.iter().cycle().take(still.len() * count));
        }
        *has_directions = with_directions;
        let LaneRoom { instructions, kept } = room;
        let set = SetShapes { flight: self, room: kept, count, q, v, with_directions, shapes };
        if instructions.run(set) {
            return Ok(());
        }
        shapes.clear();
        let index = (0..count).find(|k| !self.has_inertia(q.row(*k), v.row(*k))).unwrap_or(0);
        Err(DynamicsError::InState { index, source: Box::new(self.singular()) })
    }

    /// Whether the tree has inertia about all axes in a shape.
    fn has_inertia(&self, joints: &[f64], rates: &[f64]) -> bool {
        let (mut q, mut v) = (self.model.neutral(), vec![0.0; self.model.n_velocities()]);
        q[self.orientation().end..].copy_from_slice(joints);
        v[self.n_root()..].copy_from_slice(rates);
        self.set_shape_in((), &mut FlightTree::new((), self.model), &q, &v).is_some()
    }

    /// ω and ∂ω/∂θ in shape `k` of those that were [set](Self::set_shapes) last, with the root at an `orientation`: a quaternion x, y, z, w
    /// or an angle, as in q.
    pub fn rate_of_shape(
        &self,
        shapes: &FlightShapes,
        k: usize,
        orientation: &[f64],
    ) -> Result<StageRate, DynamicsError> {
        expect_length("orientation", orientation.len(), self.orientation().len())?;
        let shape = shapes.shapes.get(k).ok_or(DynamicsError::ForeignData)?;
        Ok(self.rate(shape, orientation))
    }

    /// The orientation after step number `step` of length `h`, from `start`, where the shapes that were [set](Self::set_shapes) last are those at
    /// starts, middles and ends of steps one after the other: 2 n + 1 for n steps. Derivatives are made where there is room for them, and those of
    /// ω are then handed out by [`derivatives_of_steps`](Self::derivatives_of_steps).
    ///
    /// Errors: a step beyond the shapes.
    pub fn turn_step(
        &self,
        shapes: &mut FlightShapes,
        step: usize,
        start: &UnitQuaternion<f64>,
        h: f64,
        derivative: Option<&mut StepDerivative>,
    ) -> Result<UnitQuaternion<f64>, DynamicsError> {
        let FlightShapes { shapes, orientations, .. } = shapes;
        let at = step.saturating_mul(2);
        let shapes = shapes.get(at..at.saturating_add(3)).ok_or(DynamicsError::ForeignData)?;
        let n = self.orientation().len();
        let stage = |stage: usize, orientation: &UnitQuaternion<f64>| {
            let first = (at + SHAPE_OF[stage]) * n;
            let numbers =
                orientations[TURN_OF[stage]].get_mut(first..first + n).ok_or(DynamicsError::ForeignData)?;
            self.write_orientation(orientation, numbers);
            Ok(self.rate(&shapes[SHAPE_OF[stage]], numbers))
        };
        turn(start, h, stage, derivative)
    }

    fn rate(&self, shape: &Shape<f64>, orientation: &[f64]) -> StageRate {
        let reduced = self.reduce_in((), shape, orientation);
        StageRate {
            angular_velocity: reduced.velocity.angular,
            by_orientation: shape.by_orientation(&reduced),
        }
    }

    /// Hands out the derivatives of ω in each stage, by the numbers of its step and in it, of the steps [turned](Self::turn_step) through the
    /// shapes that were [set](Self::set_shapes) last with directions. The root of a step that was not is at the neutral orientation; in the
    /// plane they do not depend on it.
    ///
    /// Errors: shapes that were set without directions.
    pub fn derivatives_of_steps(
        &self,
        shapes: &mut FlightShapes,
        mut read: impl FnMut([usize; 2], FlightDerivatives<'_>),
    ) -> Result<(), DynamicsError> {
        let n_steps = shapes.shapes.len() / 2;
        for turn in 0..2 {
            let orientations = std::mem::take(&mut shapes.orientations[turn]);
            let found = self.derivatives_of_shapes(shapes, &orientations, &mut |shape, found| {
                if let Some(at) = stage_of(shape, turn, n_steps) {
                    read(at, found);
                }
            });
            shapes.orientations[turn] = orientations;
            found?;
        }
        Ok(())
    }

    /// Hands out the derivatives in each shape of those that were [set](Self::set_shapes) last with directions, at orientations of the root
    /// of which there is a row for each.
    ///
    /// Errors: lengths that do not fit; shapes that were set without directions.
    pub fn derivatives_of_shapes(
        &self,
        shapes: &mut FlightShapes,
        orientations: &[f64],
        read: &mut dyn FnMut(usize, FlightDerivatives<'_>),
    ) -> Result<(), DynamicsError> {
        let FlightShapes { room: LaneRoom { instructions, kept }, shapes, has_directions, .. } = shapes;
        if !*has_directions {
            return Err(DynamicsError::ForeignData);
        }
        let count = shapes.len();
        let orientations = Rows::of_each("orientations", orientations, self.orientation().len(), count)?;
        let derive = Derive { flight: self, room: kept, count, orientations, read };
        if instructions.run(derive) { Ok(()) } else { Err(DynamicsError::ForeignData) }
    }

    /// ω of many states with its derivatives. `q` and `v` have a row for each state, or one that stands for all; what is read of them is as in
    /// [`angular_velocity`](Self::angular_velocity). `rows` has room for 3 + 6 n + 9 numbers for each state: ω, then ∂ω/∂q along q ⊕ ε e_k, ∂ω/∂v and
    /// ∂ω/∂L, each matrix row by row; what ω does not depend on, the position and the velocity of the root, has zeros. Each row has the bits that
    /// it has alone. Cost O(n) for each state.
    ///
    /// Errors as of [`set_shapes`](Self::set_shapes).
    pub fn derivatives_many(
        &self,
        shapes: &mut FlightShapes,
        q: &[f64],
        v: &[f64],
        rows: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n = self.model.n_velocities();
        let length = 6 * n + 12;
        let count = rows.len() / length;
        expect_length("rows", rows.len(), count * length)?;
        let q = Rows::new("q", q, self.model.n_positions(), count)?;
        let v = Rows::new("v", v, n, count)?;
        let (root_q, root_v, at) = (self.orientation().end, self.n_root(), self.orientation());
        let first_angle = root_v - if self.is_planar { 1 } else { 3 };
        let mut parts = [Vec::new(), Vec::new(), Vec::new()];
        for (block, rows) in rows.chunks_mut(BLOCK * length).enumerate() {
            let (first, count) = (block * BLOCK, rows.len() / length);
            parts.iter_mut().for_each(Vec::clear);
            let [joints, rates, orientations] = &mut parts;
            for k in first..first + count {
                joints.extend_from_slice(&q.row(k)[root_q..]);
                rates.extend_from_slice(&v.row(k)[root_v..]);
                orientations.extend_from_slice(&q.row(k)[at.clone()]);
            }
            self.set_shapes(shapes, count, joints, rates, true).map_err(|error| match error {
                DynamicsError::InState { index, source } => {
                    DynamicsError::InState { index: first + index, source }
                }
                error => error,
            })?;
            self.derivatives_of_shapes(shapes, orientations, &mut |k, found| {
                let (omega, matrices) = rows[k * length..][..length].split_at_mut(3);
                omega.copy_from_slice(found.angular_velocity.as_slice());
                let (by_q, rest) = matrices.split_at_mut(3 * n);
                let (by_v, by_momentum) = rest.split_at_mut(3 * n);
                for i in 0..3 {
                    let (by_q, by_v) = (&mut by_q[i * n..][..n], &mut by_v[i * n..][..n]);
                    by_q[..first_angle].fill(0.0);
                    by_v[..root_v].fill(0.0);
                    let turned = &mut by_q[first_angle..root_v];
                    for (c, out) in (3 - turned.len()..3).zip(turned) {
                        *out = found.by_orientation[(i, c)];
                    }
                    for (out, column) in by_q[root_v..].iter_mut().zip(found.by_shape) {
                        *out = column[i];
                    }
                    for (out, column) in by_v[root_v..].iter_mut().zip(found.by_shape_velocity) {
                        *out = column[i];
                    }
                    for (c, out) in by_momentum[3 * i..][..3].iter_mut().enumerate() {
                        *out = found.by_angular_momentum[(i, c)];
                    }
                }
            })?;
        }
        Ok(())
    }
}
