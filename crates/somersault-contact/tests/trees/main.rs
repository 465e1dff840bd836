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

use somersault_contact::tree::PlatformMotion;
use somersault_multibody::motion::TreeForces;
use somersault_testkit::allocations::Counting;

/// Any forces of joints, as one type: all methods are compiled for each type of forces.
type Torques = Box<dyn TreeForces + Send + Sync>;
/// Any motions of platforms, likewise.
type Motions<'a> = &'a dyn Fn(f64, usize) -> PlatformMotion;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
