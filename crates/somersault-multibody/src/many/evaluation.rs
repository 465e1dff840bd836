//! What is evaluated of one state and of several in lanes, and in what workspace.

use super::rows::{Found, Inputs};
use crate::articulated::AllPassive;
use crate::data::{Data, TreeData};
use crate::derivatives::{DerivativeData, DerivativeTables, Partials, Tables};
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::lanes::{Lanes, Packed};
use somersault_core::scalar::Lift;
use std::fmt::Debug;

/// What evaluations compute in.
pub(super) trait Workspace: Debug {
    /// For one state.
    type Alone: Debug + Send + Sync;
    /// For the states in all lanes.
    type Room<L: Lanes>: Debug + Send + Sync + 'static;

    fn alone(model: &Model) -> Self::Alone;

    fn room<L: Lanes>(lanes: L, model: &Model) -> Self::Room<L>;

    fn expect_for(alone: &Self::Alone, model: &Model) -> Result<(), DynamicsError>;
}

/// A function of states that is computed for one and for several.
pub(super) trait Evaluation {
    type Workspace: Workspace;

    /// Whether it takes v and a third argument, and the name of that: accelerations or joint forces.
    const MOTION: Option<&'static str>;

    /// Numbers of a row of results.
    fn length(model: &Model) -> usize;

    fn alone<'d>(
        model: &Model,
        work: &'d mut <Self::Workspace as Workspace>::Alone,
        arguments: [&[f64]; 3],
        wrenches: &[Force<f64>],
    ) -> Result<Found<'d, f64>, DynamicsError>;

    /// What is found for all lanes; nothing where one of them has no result.
    fn in_lanes<'d, L: Lanes>(
        model: &Model,
        lanes: L,
        inputs: &Inputs<L>,
        room: &'d mut <Self::Workspace as Workspace>::Room<L>,
    ) -> Option<Found<'d, Packed<L>>>;
}

/// A vector, without matrices.
#[inline(always)]
fn vector<X>(found: &[X]) -> Found<'_, X> {
    (found, [&[]; 3])
}

/// The workspace of dynamics.
#[derive(Debug)]
pub(super) struct Dynamics;

impl Workspace for Dynamics {
    type Alone = Data;
    type Room<L: Lanes> = TreeData<Packed<L>>;

    fn alone(model: &Model) -> Data {
        Data::new(model)
    }

    fn room<L: Lanes>(lanes: L, model: &Model) -> TreeData<Packed<L>> {
        TreeData::new(lanes, model)
    }

    fn expect_for(alone: &Data, model: &Model) -> Result<(), DynamicsError> {
        alone.expect_for(model)
    }
}

/// The workspace of partials of dynamics.
#[derive(Debug)]
pub(super) struct Derivatives;

#[derive(Debug)]
pub(super) struct DerivativeRoom<L: Lanes> {
    tree: TreeData<Packed<L>>,
    tables: DerivativeTables<Packed<L>>,
    acceleration: Vec<Packed<L>>,
}

impl Workspace for Derivatives {
    type Alone = DerivativeData;
    type Room<L: Lanes> = DerivativeRoom<L>;

    fn alone(model: &Model) -> DerivativeData {
        DerivativeData::new(model)
    }

    fn room<L: Lanes>(lanes: L, model: &Model) -> DerivativeRoom<L> {
        DerivativeRoom {
            tree: TreeData::new(lanes, model),
            tables: DerivativeTables::new(lanes, model),
            acceleration: vec![Packed::lift(lanes, 0.0); model.n_velocities()],
        }
    }

    fn expect_for(alone: &DerivativeData, model: &Model) -> Result<(), DynamicsError> {
        alone.expect_for(model)
    }
}

pub(super) struct Inverse;

impl Evaluation for Inverse {
    type Workspace = Dynamics;
    const MOTION: Option<&'static str> = Some("a");

    fn length(model: &Model) -> usize {
        model.n_velocities()
    }

    fn alone<'d>(
        model: &Model,
        data: &'d mut Data,
        [q, v, a]: [&[f64]; 3],
        wrenches: &[Force<f64>],
    ) -> Result<Found<'d, f64>, DynamicsError> {
        model.inverse_dynamics(data, q, v, a, wrenches).map(vector)
    }

    #[inline(always)]
    fn in_lanes<'d, L: Lanes>(
        model: &Model,
        lanes: L,
        inputs: &Inputs<L>,
        tree: &'d mut TreeData<Packed<L>>,
    ) -> Option<Found<'d, Packed<L>>> {
        let TreeData { nodes, torque, .. } = tree;
        let Inputs { q, v, given, .. } = inputs;
        model.newton_euler::<true, _>(lanes, nodes, torque, q, v, given, inputs.wrenches());
        Some(vector(torque))
    }
}

pub(super) struct Forward;

/// Accelerations for all lanes, in their place in the workspace, or for none.
#[inline(always)]
fn accelerate<L: Lanes>(
    model: &Model,
    lanes: L,
    inputs: &Inputs<L>,
    tree: &mut TreeData<Packed<L>>,
) -> Option<()> {
    let TreeData { nodes, momenta, pivots, acceleration, .. } = tree;
    let Inputs { q, v, given, .. } = inputs;
    let wrenches = inputs.wrenches();
    model.articulate(lanes, &AllPassive, nodes, momenta, pivots, q, v, &[], given, wrenches).ok()?;
    model.release(lanes, &AllPassive, nodes, momenta, pivots, acceleration, &mut []);
    Some(())
}

impl Evaluation for Forward {
    type Workspace = Dynamics;
    const MOTION: Option<&'static str> = Some("torque");

    fn length(model: &Model) -> usize {
        model.n_velocities()
    }

    fn alone<'d>(
        model: &Model,
        data: &'d mut Data,
        [q, v, torque]: [&[f64]; 3],
        wrenches: &[Force<f64>],
    ) -> Result<Found<'d, f64>, DynamicsError> {
        model.forward_dynamics(data, q, v, torque, wrenches).map(vector)
    }

    #[inline(always)]
    fn in_lanes<'d, L: Lanes>(
        model: &Model,
        lanes: L,
        inputs: &Inputs<L>,
        tree: &'d mut TreeData<Packed<L>>,
    ) -> Option<Found<'d, Packed<L>>> {
        accelerate(model, lanes, inputs, tree)?;
        Some(vector(&tree.acceleration))
    }
}

pub(super) struct MassMatrix;

impl Evaluation for MassMatrix {
    type Workspace = Dynamics;
    const MOTION: Option<&'static str> = None;

    fn length(model: &Model) -> usize {
        model.n_velocities().pow(2)
    }

    /// Symmetric, so that the order does not matter.
    fn alone<'d>(
        model: &Model,
        data: &'d mut Data,
        [q, ..]: [&[f64]; 3],
        _: &[Force<f64>],
    ) -> Result<Found<'d, f64>, DynamicsError> {
        Ok(vector(model.mass_matrix(data, q)?.as_slice()))
    }

    #[inline(always)]
    fn in_lanes<'d, L: Lanes>(
        model: &Model,
        lanes: L,
        inputs: &Inputs<L>,
        tree: &'d mut TreeData<Packed<L>>,
    ) -> Option<Found<'d, Packed<L>>> {
        model.compose_mass_matrix(lanes, tree, &inputs.q);
        Some(vector(tree.mass_matrix.as_slice()))
    }
}

/// Numbers of a vector and three matrices.
fn length_of_partials(model: &Model) -> usize {
    let n = model.n_velocities();
    n + 3 * n * n
}

fn of_partials<'d>(found: Partials<'d>) -> Found<'d, f64> {
    (found.value, [found.q, found.v, found.input].map(|matrix| matrix.as_slice()))
}

pub(super) struct InversePartials;

impl Evaluation for InversePartials {
    type Workspace = Derivatives;
    const MOTION: Option<&'static str> = Some("a");

    fn length(model: &Model) -> usize {
        length_of_partials(model)
    }

    fn alone<'d>(
        model: &Model,
        work: &'d mut DerivativeData,
        [q, v, a]: [&[f64]; 3],
        wrenches: &[Force<f64>],
    ) -> Result<Found<'d, f64>, DynamicsError> {
        model.inverse_dynamics_partials(work, q, v, a, wrenches).map(of_partials)
    }

    #[inline(always)]
    fn in_lanes<'d, L: Lanes>(
        model: &Model,
        lanes: L,
        inputs: &Inputs<L>,
        room: &'d mut DerivativeRoom<L>,
    ) -> Option<Found<'d, Packed<L>>> {
        let DerivativeRoom { tree, tables, .. } = room;
        let Inputs { q, v, given, .. } = inputs;
        model.place_in(lanes, tree, q);
        model.differentiate_in(lanes, tree, tables, v, given, inputs.wrenches());
        let Tables { value, q, v } = &tables.inverse;
        Some((value, [q.as_slice(), v.as_slice(), tree.mass_matrix.as_slice()]))
    }
}

pub(super) struct ForwardPartials;

impl Evaluation for ForwardPartials {
    type Workspace = Derivatives;
    const MOTION: Option<&'static str> = Some("torque");

    fn length(model: &Model) -> usize {
        length_of_partials(model)
    }

    fn alone<'d>(
        model: &Model,
        work: &'d mut DerivativeData,
        [q, v, torque]: [&[f64]; 3],
        wrenches: &[Force<f64>],
    ) -> Result<Found<'d, f64>, DynamicsError> {
        model.forward_dynamics_partials(work, q, v, torque, wrenches).map(of_partials)
    }

    #[inline(always)]
    fn in_lanes<'d, L: Lanes>(
        model: &Model,
        lanes: L,
        inputs: &Inputs<L>,
        room: &'d mut DerivativeRoom<L>,
    ) -> Option<Found<'d, Packed<L>>> {
        let DerivativeRoom { tree, tables, acceleration } = room;
        accelerate(model, lanes, inputs, tree)?;
        acceleration.copy_from_slice(&tree.acceleration);
        model.place_in(lanes, tree, &inputs.q);
        let wrenches = inputs.wrenches();
        model.forward_partials_in(lanes, tree, tables, &inputs.v, acceleration, wrenches).ok()?;
        let DerivativeTables { forward: Tables { q, v, .. }, response, .. } = tables;
        Some((acceleration, [q.as_slice(), v.as_slice(), response.as_slice()]))
    }
}
