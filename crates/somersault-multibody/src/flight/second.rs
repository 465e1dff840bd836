//! Second derivatives of the angular velocity of the root, along several directions of the shape at a time.

use super::Flight;
use super::tree::FlightTree;
use crate::error::DynamicsError;
use crate::lane_room::{Kept, LaneRoom, Room};
use crate::model::Model;
use nalgebra::Vector3;
use somersault_core::argument::expect_length;
use somersault_core::lane_dual::LaneDual;
use somersault_core::lanes::{InstructionSet, Kernel, Lanes, WIDEST};
use somersault_core::scalar::Lift;

/// One shape, moved along directions, and the workspace to evaluate it, made when it is first used and used repeatedly. A clone has no
/// shape.
#[derive(Debug, Default)]
pub struct FlightSecondDerivatives {
    /// Of [`Groups`].
    room: LaneRoom,
    /// Numbers of the directions that were set last, those of a direction side by side.
    directions: Vec<f64>,
    count: usize,
}

impl Clone for FlightSecondDerivatives {
    fn clone(&self) -> Self {
        Self::with_instructions(self.room.instructions)
    }
}

impl FlightSecondDerivatives {
    /// With chosen vector instructions in the place of the widest of this processor: they change the duration and not the results.
    pub fn with_instructions(instructions: InstructionSet) -> Self {
        Self { room: LaneRoom::with_instructions(instructions), ..Self::default() }
    }
}

/// What the directions in all lanes are evaluated with.
#[derive(Debug)]
struct Groups<L: Lanes> {
    /// As many directions each as there are lanes.
    groups: Vec<FlightTree<LaneDual<L>>>,
    q: Vec<LaneDual<L>>,
    v: Vec<LaneDual<L>>,
    /// a · ∂ω of each degree of freedom, by the shape and by its velocity.
    weighted: [Vec<LaneDual<L>>; 2],
}

impl<L: Lanes> Room<L> for Groups<L> {
    fn new(lanes: L, model: &Model) -> Self {
        let zero = LaneDual::lift(lanes, 0.0);
        let n = model.n_velocities();
        let weighted = vec![zero; n - model.velocities_of(0).len()];
        Self {
            groups: Vec::new(),
            q: vec![zero; model.n_positions()],
            v: vec![zero; n],
            weighted: [weighted.clone(), weighted],
        }
    }

    fn is_for(&self, model: &Model) -> bool {
        self.q.len() == model.n_positions()
            && self.v.len() == model.n_velocities()
            && self.groups.first().is_none_or(|group| group.is_for(model))
    }
}

struct SetAlong<'a, 'm> {
    flight: &'a Flight<'m>,
    room: &'a mut Kept,
    q: &'a [f64],
    v: &'a [f64],
    directions: &'a [f64],
    count: usize,
}

impl Kernel for SetAlong<'_, '_> {
    /// Whether the tree has inertia about all axes.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let Self { flight, room, q, v, directions, count } = self;
        let model = flight.model;
        let Some(room) = room.fitting::<L, Groups<L>>(lanes, model) else { return false };
        while room.groups.len() * L::WIDTH < count {
            room.groups.push(FlightTree::new(lanes, model));
        }
        for (to, &value) in room.v[flight.n_root()..].iter_mut().zip(v) {
            *to = LaneDual::lift(lanes, value);
        }
        let rows = directions.chunks(q.len().max(1) * L::WIDTH).take(count.div_ceil(L::WIDTH));
        for (group, rows) in room.groups.iter_mut().zip(rows) {
            for (k, (to, &value)) in room.q[flight.orientation().end..].iter_mut().zip(q).enumerate() {
                let mut slopes = [0.0; WIDEST];
                for (slope, direction) in slopes.iter_mut().zip(rows.chunks_exact(q.len())) {
                    *slope = direction[k];
                }
                *to = LaneDual::new(lanes, value, &slopes);
            }
            if flight.set_shape_in(lanes, group, &room.q, &room.v).is_none() {
                return false;
            }
            flight.set_directions_in(lanes, group);
        }
        true
    }
}

struct Second<'a, 'm> {
    flight: &'a Flight<'m>,
    room: &'a mut Kept,
    orientation: &'a [f64],
    a: &'a Vector3<f64>,
    directions: &'a [f64],
    rows: &'a mut [f64],
}

impl Kernel for Second<'_, '_> {
    /// Whether the shape was set for this tree.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let Self { flight, room, orientation, a, directions, rows } = self;
        let Some(Groups { groups, weighted, .. }) = room.existing::<L, _>(flight.model) else { return false };
        let mut lifted = [LaneDual::lift(lanes, 0.0); 4];
        for (to, &x) in lifted.iter_mut().zip(orientation) {
            *to = LaneDual::lift(lanes, x);
        }
        let n = weighted[0].len();
        let count = directions.len() / n;
        let length = 2 * count + 6;
        for (group, rows) in groups.iter_mut().zip(rows.chunks_mut(length * L::WIDTH)) {
            let reduced = flight.reduce_in(lanes, &group.shape, &lifted);
            let matrices = [group.shape.by_orientation(&reduced), group.shape.by_angular_momentum(&reduced)];
            let found = flight.derive_in(lanes, group, &reduced);
            for (weighted, found) in weighted.iter_mut().zip(found) {
                for (to, by) in weighted.iter_mut().zip(found) {
                    *to = by.x.scaled(a.x) + by.y.scaled(a.y) + by.z.scaled(a.z);
                }
            }
            for (part, weighted) in weighted.iter().enumerate() {
                for (l, direction) in directions.chunks_exact(n).enumerate() {
                    let mut sum = LaneDual::lift(lanes, 0.0);
                    for (&x, &along) in weighted.iter().zip(direction) {
                        if along != 0.0 {
                            sum += x.scaled(along);
                        }
                    }
                    write_slopes(sum, part * count + l, length, rows);
                }
            }
            for (part, m) in matrices.iter().enumerate() {
                for c in 0..3 {
                    let sum = m[(0, c)].scaled(a.x) + m[(1, c)].scaled(a.y) + m[(2, c)].scaled(a.z);
                    write_slopes(sum, 2 * count + 3 * part + c, length, rows);
                }
            }
        }
        true
    }
}

/// The derivative along each direction to entry `k` of its row.
#[inline(always)]
fn write_slopes<L: Lanes>(x: LaneDual<L>, k: usize, length: usize, rows: &mut [f64]) {
    let mut slopes = [0.0; WIDEST];
    x.store_slopes(&mut slopes);
    for (row, slope) in rows.chunks_exact_mut(length).zip(slopes) {
        row[k] = slope;
    }
}

impl Flight<'_> {
    /// Sets a shape, positions and velocities of all joints but the root's as in q and v, and `directions` d_i of it: a row for each of
    /// changes of the velocities' numbers, which are those of the positions where all joints are hinges and slides. Cost O(n) for each, in
    /// vector instructions for as many at a time as they have lanes.
    ///
    /// Errors: lengths that do not fit, as with joints that are neither hinges nor slides; a tree without inertia about some axis.
    pub fn set_shape_along(
        &self,
        data: &mut FlightSecondDerivatives,
        q: &[f64],
        v: &[f64],
        directions: &[f64],
    ) -> Result<(), DynamicsError> {
        let n = self.model.n_velocities() - self.n_root();
        let n_q = self.model.n_positions() - self.orientation().end;
        expect_length("positions of the joints", n_q, n)?;
        expect_length("q", q.len(), n)?;
        expect_length("v", v.len(), n)?;
        let count = directions.len().checked_div(n).unwrap_or(0);
        expect_length("directions", directions.len(), count * n)?;
        data.directions.clear();
        data.directions.extend_from_slice(directions);
        data.count = count;
        let FlightSecondDerivatives { room: LaneRoom { instructions, kept }, directions, .. } = data;
        if instructions.run(SetAlong { flight: self, room: kept, q, v, directions, count }) {
            return Ok(());
        }
        data.count = 0;
        Err(self.singular())
    }

    /// Second derivatives of a · ω along the m directions that were [set](Self::set_shape_along) last, with the root at an `orientation`, a
    /// quaternion x, y, z, w or an angle. `rows` has room for a row for each of 2 m + 6 numbers:
    ///
    /// ```text
    /// d_iᵀ ∂²(a·ω)/∂s² d_l for all l,   d_iᵀ ∂²(a·ω)/∂s∂ṡ d_l for all l,   d_iᵀ ∂²(a·ω)/∂s∂θ,   d_iᵀ ∂²(a·ω)/∂s∂L
    /// ```
    /// Exact to rounding: the recursions run over numbers that carry derivatives along as many directions as there are lanes. Cost O(n) for each
    /// direction.
    ///
    /// Errors: lengths that do not fit; no shape that was set.
    pub fn second_derivatives_of_shape(
        &self,
        data: &mut FlightSecondDerivatives,
        orientation: &[f64],
        a: &Vector3<f64>,
        rows: &mut [f64],
    ) -> Result<(), DynamicsError> {
        expect_length("orientation", orientation.len(), self.orientation().len())?;
        let FlightSecondDerivatives { room: LaneRoom { instructions, kept }, directions, count } = data;
        expect_length("rows", rows.len(), *count * (2 * *count + 6))?;
        if *count == 0 {
            return Ok(());
        }
        let second = Second { flight: self, room: kept, orientation, a, directions, rows };
        if instructions.run(second) { Ok(()) } else { Err(DynamicsError::ForeignData) }
    }
}
