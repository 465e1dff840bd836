//! Trees that touch. One program, so that methods are compiled for a tree in contact once.

mod adjoint;
mod allocation;
mod bodies;
mod bounds;
mod carried;
mod drops;
mod energy;
mod geometry;
mod gradients;
mod light_feet;
mod models;
mod orders;
mod parameters;
mod platforms;
mod references;
mod report;
mod round_shapes;
mod scenes;
mod shots;
mod slider;
mod spatial_references;
mod standing;

use somersault_contact::models::TreeContactSystem;
use somersault_contact::tree::{PlatformMotion, TreeInContact};
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_multibody::motion::{TreeForces, TreeSystem};
use somersault_testkit::allocations::Counting;

/// Any forces of joints, as one type: all methods are compiled for each type of forces.
type Torques = Box<dyn TreeForces + Send + Sync>;

/// No forces of joints, as that type.
fn passive() -> Torques {
    Box::new(())
}

/// A named model with its actuators as that type.
fn in_contact(scene: &TreeContactSystem) -> TreeInContact<'_, Torques> {
    let tree = TreeSystem::new(&scene.model, Box::new(scene.actuators.clone()) as Torques);
    TreeInContact::try_new(tree, scene.contacts.clone(), vec![]).unwrap()
}

/// Any motions of platforms, as one type.
type Motions<'a> = &'a dyn Fn(f64, usize) -> PlatformMotion;

/// The method of a run in a type of system of its own: any [`Method`](somersault_integrators::methods::Method) would have all
/// methods compiled for it.
const RKMK8: RungeKuttaMuntheKaas<Dop853> = RungeKuttaMuntheKaas(Dop853);

#[global_allocator]
static ALLOCATOR: Counting = Counting;
