//! Second derivatives of inverse dynamics, several directions at a time.

use super::DerivativeTables;
use crate::data::TreeData;
use crate::error::DynamicsError;
use crate::lane_room::{Kept, LaneRoom, Room};
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::argument::expect_length;
use somersault_core::lane_dual::LaneDual;
use somersault_core::lanes::{InstructionSet, Kernel, Lanes, WIDEST};
use somersault_core::scalar::Lift;

/// Workspace of second derivatives, made for a model when it is first used and used repeatedly; with it nothing allocates. A clone
/// makes its own.
#[derive(Debug, Default, Clone)]
pub struct SecondDerivativeData(LaneRoom);

impl SecondDerivativeData {
    /// With chosen vector instructions in the place of the widest of this processor: they change the duration and not the results.
    pub fn with_instructions(instructions: InstructionSet) -> Self {
        Self(LaneRoom::with_instructions(instructions))
    }
}

/// What the directions in all lanes are computed with.
#[derive(Debug)]
struct Moved<L: Lanes> {
    tree: TreeData<LaneDual<L>>,
    tables: DerivativeTables<LaneDual<L>>,
    /// Of the degrees of freedom: partials of those that are not on one way to the root stay zero.
    parents: Vec<Option<usize>>,
    /// Those of the tree, and before them those that are independent.
    q: [Vec<LaneDual<L>>; 2],
    v: [Vec<LaneDual<L>>; 2],
    a: [Vec<LaneDual<L>>; 2],
    wrenches: Vec<Force<LaneDual<L>>>,
    /// Of the tree.
    weights: Vec<f64>,
    /// What is contracted, of each independent degree of freedom.
    contracted: Vec<LaneDual<L>>,
}

impl<L: Lanes> Room<L> for Moved<L> {
    fn new(lanes: L, model: &Model) -> Self {
        let zero = LaneDual::lift(lanes, 0.0);
        let n = model.n_velocities();
        let (n_q_tree, n_tree) = model
            .coupling
            .as_ref()
            .map_or((0, 0), |coupling| (coupling.positions.len(), coupling.velocities.len()));
        let of_velocities = || [vec![zero; n], vec![zero; n_tree]];
        Self {
            tree: TreeData::new(lanes, model),
            tables: DerivativeTables::new(lanes, model),
            parents: model.dof_parent.clone(),
            q: [vec![zero; model.n_positions()], vec![zero; n_q_tree]],
            v: of_velocities(),
            a: of_velocities(),
            wrenches: vec![Force::zero().lift(lanes); model.n_bodies()],
            weights: vec![0.0; model.directions.len()],
            contracted: vec![zero; n],
        }
    }

    fn is_for(&self, model: &Model) -> bool {
        self.q[0].len() == model.n_positions()
            && self.contracted.len() == model.n_velocities()
            && self.parents == model.dof_parent
            && self.wrenches.len() == model.n_bodies()
    }
}

impl<L: Lanes> Moved<L> {
    /// A state moved along the directions of the lanes, rows of (dq, dv, da); lanes without a direction move along none.
    #[inline(always)]
    fn move_along(&mut self, lanes: L, model: &Model, state: [&[f64]; 3], directions: &[f64]) {
        let length: usize = state.iter().map(|part| part.len()).sum();
        let mut first = 0;
        for (numbers, part) in [&mut self.q, &mut self.v, &mut self.a].into_iter().zip(state) {
            for (k, (to, &value)) in numbers[0].iter_mut().zip(part).enumerate() {
                let mut slopes = [0.0; WIDEST];
                for (slope, direction) in slopes.iter_mut().zip(directions.chunks_exact(length)) {
                    *slope = direction[first + k];
                }
                *to = LaneDual::new(lanes, value, &slopes);
            }
            first += part.len();
        }
        let [own, spread] = &mut self.q;
        model.spread_positions_in(lanes, own, spread);
        for [own, spread] in [&mut self.v, &mut self.a] {
            model.spread_in(lanes, own, spread);
        }
    }

    /// wᵀ times each column of one of the tables of partials, which are those of the tree.
    #[inline(always)]
    fn contract(
        lanes: L,
        model: &Model,
        weights: &[f64],
        table: &[LaneDual<L>],
        contracted: &mut [LaneDual<L>],
    ) {
        for to in contracted.iter_mut() {
            *to = LaneDual::lift(lanes, 0.0);
        }
        for (j, column) in table.chunks_exact(weights.len()).enumerate() {
            let mut sum = LaneDual::lift(lanes, 0.0);
            for (&x, &weight) in column.iter().zip(weights) {
                sum += x.scaled(weight);
            }
            match &model.coupling {
                None => contracted[j] = sum,
                Some(coupling) => {
                    let row = &coupling.velocities[j];
                    contracted[row.at] += sum.scaled(row.factor);
                }
            }
        }
    }
}

/// All directions, as many at a time as there are lanes.
struct Along<'a> {
    model: &'a Model,
    room: &'a mut Kept,
    state: [&'a [f64]; 3],
    wrenches: &'a [Force<f64>],
    weights: &'a [f64],
    directions: &'a [f64],
    rows: &'a mut [f64],
}

impl Kernel for Along<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { model, room, state, wrenches, weights, directions, rows } = self;
        let Some(room) = room.fitting::<L, Moved<L>>(lanes, model) else { return };
        for (to, wrench) in room.wrenches.iter_mut().zip(wrenches) {
            *to = wrench.lift(lanes);
        }
        match &model.coupling {
            None => room.weights.copy_from_slice(weights),
            Some(coupling) => {
                for (to, row) in room.weights.iter_mut().zip(&coupling.velocities) {
                    *to = weights[row.at] * row.factor;
                }
            }
        }
        let n = weights.len();
        let length = state[0].len() + 2 * n;
        let (of_state, rows) = rows.split_at_mut(3 * n);
        let count = directions.len() / length;
        // without a direction there is still the state
        for first in (0..count.max(1)).step_by(L::WIDTH) {
            let group = first..count.min(first + L::WIDTH);
            let rows = &mut rows[3 * n * group.start..3 * n * group.end];
            let group = &directions[length * group.start..length * group.end];
            room.move_along(lanes, model, state, group);
            let Moved { tree, tables, q, v, a, wrenches: lifted, weights, contracted, .. } = &mut *room;
            let coupled = usize::from(model.coupling.is_some());
            let (q, v, a) = (&q[coupled][..], &v[coupled][..], &a[coupled][..]);
            model.place_in(lanes, tree, q);
            model.differentiate_in(lanes, tree, tables, v, a, &lifted[..wrenches.len()]);
            let tables = [&tables.inverse.q, &tables.inverse.v, &tree.mass_matrix];
            for (part, table) in tables.into_iter().enumerate() {
                Moved::contract(lanes, model, weights, table.as_slice(), contracted);
                for (k, found) in contracted.iter().enumerate() {
                    of_state[part * n + k] = found.value();
                    let mut slopes = [0.0; WIDEST];
                    found.store_slopes(&mut slopes);
                    for (row, slope) in rows.chunks_exact_mut(3 * n).zip(slopes) {
                        row[part * n + k] = slope;
                    }
                }
            }
        }
    }
}

impl Model {
    /// The derivatives of wᵀ ∂τ/∂(q, v, a) along directions of (q, v, a), where τ are the joint forces of
    /// [`inverse_dynamics`](Self::inverse_dynamics), w are `weights` and ∂/∂q is along q ⊕ ε e_k.
    ///
    /// `directions` has a row for each: changes of the numbers of q, which keep quaternions at unit norm, then of v and of a. `rows`
    /// has room for as many rows of 3 n numbers and one more: first wᵀ ∂τ/∂q, wᵀ ∂τ/∂v and wᵀ ∂τ/∂a = wᵀ M themselves, then
    /// their derivatives along each direction. Wrenches are held fixed in their bodies. Exact to rounding: the recursions run over numbers
    /// that carry derivatives along as many directions as vector instructions have lanes, 4 or 8. Cost O(n × depth) for each direction.
    ///
    /// Errors: lengths that do not fit.
    ///
    /// ```
    /// use somersault_multibody::{SecondDerivativeData, models::TwoLinkArm};
    /// let arm = TwoLinkArm::default().model()?;
    /// let mut data = SecondDerivativeData::default();
    /// let (q, v, a) = ([0.1, 0.4], [1.0, -0.5], [0.0, 2.0]);
    /// let elbow = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0];   // moves the second joint
    /// let mut rows = [0.0; 2 * 6];
    /// arm.inverse_dynamics_second_derivatives(&mut data, &q, &v, &a, &[], &[1.0, 0.0], &elbow, &mut rows)?;
    /// assert!(rows[4] > 0.0);                       // M₁₁
    /// assert!(rows[6 + 4] < 0.0);                   // falls as the elbow bends
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn inverse_dynamics_second_derivatives(
        &self,
        data: &mut SecondDerivativeData,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        wrenches: &[Force<f64>],
        weights: &[f64],
        directions: &[f64],
        rows: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n = self.n_velocities();
        expect_length("q", q.len(), self.n_positions())?;
        for (argument, found) in [("v", v.len()), ("a", a.len()), ("weights", weights.len())] {
            expect_length(argument, found, n)?;
        }
        self.expect_wrenches(wrenches)?;
        let length = self.n_positions() + 2 * n;
        let count = directions.len().checked_div(length).unwrap_or(0);
        expect_length("directions", directions.len(), count * length)?;
        expect_length("rows", rows.len(), (count + 1) * 3 * n)?;
        if n == 0 {
            return Ok(());
        }
        let SecondDerivativeData(LaneRoom { instructions, kept }) = data;
        let state = [q, v, a];
        instructions.run(Along { model: self, room: kept, state, wrenches, weights, directions, rows });
        Ok(())
    }
}
