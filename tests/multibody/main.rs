//! Articulated bodies. One program, so that the kernels are compiled for each scalar once.

mod allocation;
mod derivatives;
mod dynamics;
mod flight;
mod flight_shapes;
mod many;
mod mimic;
mod mjcf;
mod models;
mod motion;
mod urdf;

use somersault::multibody::motion::TreeForces;
use somersault_testkit::allocations::Counting;

/// Any forces of joints, and any accelerations of driven ones, as one type: all methods are compiled for each type of them.
type Torques = Box<dyn TreeForces + Send + Sync>;
type Drive<'a> = Box<dyn Fn(f64, &[f64], &[f64], &mut [f64]) + 'a>;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
