//! Runs of the flow allocate nothing.

use nalgebra::SVector;
use somersault_ftla::flow::{Chain, Tolerances, VariationalFlow};
use somersault_ftla::system::ArmMinimumTorque;
use somersault_testkit::allocations::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn runs_allocate_nothing() {
    let arm = ArmMinimumTorque::default();
    let flow =
        VariationalFlow::try_new(&arm, Tolerances { relative: 1e-9, absolute: 1e-11 }).expect("in range");
    let p = SVector::from([-0.5 * std::f64::consts::PI, 0.05, 0.0, 0.0, -0.2, 0.0, -1.3, -0.1]);
    let mut chain = Chain::new();
    let times = [1.0, 2.0, 3.0];
    // the first call reads the tableau and makes room in the chain
    flow.chain_into(&p, &times, 100.0, &mut chain).expect("regular");
    let found = allocations(|| {
        flow.transition(&p, 2.0).expect("regular");
        flow.state(&p, -0.5).expect("regular");
        flow.cost(&p, 1.0).expect("regular");
        flow.chain_into(&p, &times, 100.0, &mut chain).expect("regular");
    });
    assert_eq!(found, 0);
}
