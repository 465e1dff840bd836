//! Steps of the flow allocate nothing: a long run takes as many pieces of memory as a short one.

use nalgebra::dvector;
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::system::ArmMinimumTorque;
use somersault_testkit::allocations::allocations;
use std::f64::consts::FRAC_PI_2;

#[test]
fn steps_allocate_nothing() {
    let free = ArmMinimumTorque::default();
    let limited = free.try_with_torque_limits([0.38, 0.05]).expect("positive");
    let p = dvector![-FRAC_PI_2, 0.05, 0.0, 0.0, -0.2, -0.013, -1.33, -0.12];
    for arm in [free, limited] {
        let tolerances = FlowTolerances { relative: 1e-9, absolute: 1e-11 };
        let flow = VariationalFlow::try_new(&arm, tolerances).expect("in range");
        let runs: [&dyn Fn(f64) -> usize; 3] = [
            &|t| flow.transition_counted(&p, t).expect("regular").1.steps,
            &|t| usize::from(flow.state(&p, t).is_ok()),
            &|t| usize::from(flow.cost(&p, t).is_ok()),
        ];
        // within one piece of the field: another one is a few numbers more
        assert_eq!(flow.switches(&p, 0.05).expect("regular").len(), 0);
        assert!(runs[0](0.05) > runs[0](1e-3), "the longer run has more steps");
        for run in runs {
            let [short, long] = [1e-3, 0.05].map(|t| allocations(|| _ = run(t)));
            assert_eq!(short, long);
        }
    }
}
