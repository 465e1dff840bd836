//! What each method conserves: the group for all of them, momentum and energy for those that say so.

use rayon::prelude::*;
use somersault::integrators::stepper::Scope;
use somersault::prelude::*;
use somersault_testkit::problems::under;

/// Box with half sides 0.1, 0.2, 0.3 m and 1 kg.
fn scene() -> (RigidBodySystem, RigidBodyState) {
    let body = RigidBody::try_box(1.0, Vector3::new(0.2, 0.4, 0.6)).unwrap();
    (RigidBodySystem::free(body), RigidBodyState::spinning(Vector3::new(1.0, 2.0, 3.0)))
}

fn energy(body: &RigidBody, x: &RigidBodyState) -> f64 {
    let omega = x.orientation().inverse_transform_vector(x.angular_velocity());
    0.5 * omega.dot(&body.inertia().momentum(&omega))
}

fn momentum(body: &RigidBody, x: &RigidBodyState) -> Vector3<f64> {
    let omega = x.orientation().inverse_transform_vector(x.angular_velocity());
    x.orientation() * body.inertia().momentum(&omega)
}

/// Relative change of energy and of the angular momentum vector over a run.
fn drift(method: Method, h: f64, steps: u64) -> (f64, f64) {
    drift_after(method, 0, h, steps)
}

/// The same from the state after a number of steps on.
fn drift_after(method: Method, first: u64, h: f64, steps: u64) -> (f64, f64) {
    let (system, start) = scene();
    let after = |steps: u64| {
        let grid = TimeGrid::try_with_steps(0.0, h * steps as f64, steps).unwrap();
        Run::new(&system, method, grid).from(&start).unwrap().state
    };
    let (start, end) = (if first == 0 { start } else { after(first) }, after(steps));
    let (e, l) = (energy(&system.body, &start), momentum(&system.body, &start));
    ((energy(&system.body, &end) / e - 1.0).abs(), (momentum(&system.body, &end) - l).norm() / l.norm())
}

/// The orientations of every method are orthogonal after a number of steps of 0.1 ms.
fn stays_on_the_group(steps: u64) {
    let (system, start) = scene();
    let grid = TimeGrid::try_with_steps(0.0, 1e-4 * steps as f64, steps).unwrap();
    Method::ALL.into_par_iter().for_each(|method| {
        let end = Run::new(&system, method, grid).from(&start).unwrap().state;
        let r = end.orientation().as_ref();
        // The matrix of the quaternion as it stands, without another normalisation.
        let r = nalgebra::UnitQuaternion::new_unchecked(*r).to_rotation_matrix().into_inner();
        let defect = (r.transpose() * r - nalgebra::Matrix3::identity()).norm();
        assert!(defect < 4e-15, "{method}: {defect:e}");
    });
}

/// A rounding that was not removed would add up to 1e-11.
#[test]
fn every_method_stays_on_the_group_for_a_hundred_thousand_steps() {
    stays_on_the_group(100_000);
}

#[test]
#[ignore = "long form of `every_method_stays_on_the_group_for_a_hundred_thousand_steps`, minutes: `make studies` runs it"]
fn every_method_stays_on_the_group_for_ten_million_steps() {
    stays_on_the_group(10_000_000);
}

/// What a row of the table says, without a list of methods here: one that is added is measured too.
#[test]
fn methods_keep_what_they_say() {
    for method in Method::ALL {
        let conserves = method.info().conserves;
        let (energy, momentum) = drift(method, 0.01, 10_000);
        let says = |what| conserves.starts_with(what);
        if says("energy and angular momentum of a free body to rounding") || says("a free body exactly") {
            assert!(energy < 1e-13 && momentum < 1e-13, "{method}: {energy:e} {momentum:e}");
        } else if says("angular momentum without torque, once started, to rounding that adds up") {
            let (_, momentum) = drift_after(method, method.info().history.into(), 0.01, 10_000);
            // A bit or two in each step.
            assert!(momentum < 10_000.0 * 2.0 * f64::EPSILON, "{method}: {momentum:e}");
        } else if says("angular momentum without torque to rounding") {
            assert!(momentum < 1e-13, "{method}: {momentum:e}");
        }
        if method.info().variables == somersault::integrators::stepper::Variables::Momentum {
            assert!(momentum < 2e-15, "{method}: {momentum:e}");
        }
    }
    // One that keeps nothing is seen to.
    assert!(drift(Method::Heun, 0.01, 10_000).1 > 1e-9);
}

#[test]
fn torque_free_methods_refuse_torque() {
    let (free, start) = scene();
    let torque = ConstantTorque::World(Vector3::new(0.0, 0.0, 1.0));
    let system = under(free.body, torque);
    let grid = TimeGrid::try_new(0.0, 1.0, 0.1).unwrap();
    for method in Method::ALL.into_iter().filter(|m| m.info().scope == Scope::TorqueFree) {
        let error = Run::new(&system, method, grid).from(&start).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("method `{method}` accepts no torque, and these forces may exert one")
        );
    }
}

/// Of fine steps, every method keeps energy and momentum to its order; a bound that first-order
/// methods meet is met by all.
#[test]
fn drift_shrinks_with_the_step_for_every_method() {
    for method in Method::ALL {
        let (coarse, fine) = (drift(method, 2e-3, 1000), drift(method, 1e-3, 2000));
        for (name, coarse, fine) in [("energy", coarse.0, fine.0), ("momentum", coarse.1, fine.1)] {
            assert!(fine < 0.65 * coarse || fine < 1e-12, "{method} {name}: {coarse:e} {fine:e}");
        }
    }
}

/// Largest error of ½ ω·Iω − F·Rp, constant under a force F fixed in the world at a point p of the body,
/// in the first and in the last tenth of a run.
fn energy_errors(method: Method, force: ConstantForce, h: f64, steps: u64) -> (f64, f64) {
    struct Watch<'a>(&'a dyn Fn(&RigidBodyState) -> f64, Vec<f64>);
    impl Observer<somersault::integrators::state::Pose> for Watch<'_> {
        fn observe(&mut self, step: &mut Step<'_, somersault::integrators::state::Pose>) -> Flow {
            self.1.push((self.0)(step.after).abs());
            Flow::Continue
        }
    }
    let (free, start) = scene();
    let total =
        |x: &RigidBodyState| energy(&free.body, x) - force.force.dot(&(x.orientation() * force.point));
    let first = total(&start);
    let error = |x: &RigidBodyState| total(x) / first - 1.0;
    let system = under(free.body, force);
    let grid = TimeGrid::try_with_steps(0.0, h * steps as f64, steps).unwrap();
    let mut watch = Watch(&error, Vec::new());
    Run::new(&system, method, grid).observed_by(&mut watch).from(&start).unwrap();
    let tenth = watch.1.len() / 10;
    let largest = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
    (largest(&watch.1[..tenth]), largest(&watch.1[9 * tenth..]))
}

#[test]
fn energy_does_not_drift_in_splittings_with_exact_free_motion_and_implicit_midpoint() {
    let none = ConstantForce { force: Vector3::zeros(), point: Vector3::zeros() };
    let weight = ConstantForce { force: Vector3::new(0.0, 0.0, -2.0), point: Vector3::new(0.01, 0.0, 0.05) };
    for (method, force, bound) in
        [(Method::Imid, none, 1e-4), (Method::Split2, weight, 1e-2), (Method::Split4, weight, 1e-5)]
    {
        let (early, late) = energy_errors(method, force, 0.02, 50_000);
        assert!(early < bound && late < 1.5 * early + 1e-12, "{method}: {early:e} {late:e}");
    }
    // A method that drifts is seen to.
    let (early, late) = energy_errors(Method::Rkmk, weight, 0.02, 50_000);
    assert!(late > 5.0 * early, "{early:e} {late:e}");
}
