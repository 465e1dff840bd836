//! The Moser–Veselov methods and the variational Lie–Verlet method: residuals, invariants, orders, failures.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{IntegrateError, TimeGrid};
use somersault_integrators::force::{ConstantForce, Drag, Gravity};
use somersault_integrators::methods::Method;
use somersault_integrators::moser_veselov::{CompensatedVector, MoserVeselov, step};
use somersault_integrators::preprocessing::{ModifiedMoments, Preprocessing};
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_integrators::stepper::StepError;
use somersault_integrators::system::{RigidBodySystem, RigidSystem};
use somersault_testkit::problems::under;

type V = Vector3<f64>;

/// Moments of the solid box with half sizes 0.1, 0.2, 0.3 m and 1 kg.
fn box_moments() -> V {
    let [x, y, z] = [0.01, 0.04, 0.09];
    V::new(y + z, x + z, x + y) / 3.0
}

fn energy(moments: &V, momentum: &V) -> f64 {
    0.5 * momentum.dot(&momentum.component_div(moments))
}

/// Free motion by Taylor series: q' = q ω/2, L' = L × ω, ω = I⁻¹ L, all in the body frame, with 24 terms a
/// step, which leaves less than round-off for |ω| h < 0.5.
fn taylor(moments: &V, mut momentum: V, t: f64, steps: u32) -> (UnitQuaternion<f64>, V) {
    const TERMS: usize = 24;
    let h = t / f64::from(steps);
    let mut q = Quaternion::identity();
    for _ in 0..steps {
        let (mut ls, mut qs) = (vec![momentum], vec![q]);
        for n in 0..TERMS {
            let mut dl = V::zeros();
            let mut dq = Quaternion::new(0.0, 0.0, 0.0, 0.0);
            for k in 0..=n {
                let omega = ls[n - k].component_div(moments);
                dl += ls[k].cross(&omega);
                dq += qs[k] * Quaternion::from_parts(0.0, omega) * 0.5;
            }
            ls.push(dl / (n + 1) as f64);
            qs.push(dq / (n + 1) as f64);
        }
        momentum = ls.iter().rev().fold(V::zeros(), |sum, c| sum * h + c);
        q = qs.iter().rev().fold(Quaternion::new(0.0, 0.0, 0.0, 0.0), |sum, c| sum * h + c);
    }
    (UnitQuaternion::from_quaternion(q), momentum)
}

fn gap(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    2.0 * (a.inverse() * b).imag().norm()
}

fn state(q: UnitQuaternion<f64>, omega: V) -> RigidBodyState {
    RigidBodyState::new(V::new(0.1, 0.2, 0.3), q, V::new(1.0, -0.5, 2.0), omega)
}

fn run<S: RigidSystem<Configuration = Pose>>(
    method: &str,
    system: &S,
    x: &RigidBodyState,
    t: f64,
    steps: u64,
) -> Result<RigidBodyState, IntegrateError> {
    let method: Method = method.parse().unwrap();
    let grid = TimeGrid::try_with_steps(0.0, t, steps).unwrap();
    Ok(Run::new(system, method, grid).from(x)?.state)
}

/// World angular momentum.
fn momentum(body: &RigidBody, x: &RigidBodyState) -> V {
    x.orientation() * body.inertia().momentum(&x.orientation().inverse_transform_vector(x.angular_velocity()))
}

#[test]
fn the_taylor_reference_agrees_with_itself_and_keeps_the_invariants() {
    let (moments, start) = (V::new(1.0, 2.0, 2.5), V::new(0.4, -0.5, 1.9));
    let (q, l) = taylor(&moments, start, 5.0, 40);
    let (p, m) = taylor(&moments, start, 5.0, 57);
    assert!(gap(&q, &p) < 2e-14 && (l - m).norm() < 2e-14);
    assert!((energy(&moments, &l) / energy(&moments, &start) - 1.0).abs() < 1e-14);
    assert!((q * l - start).norm() < 2e-14);
}

#[test]
fn the_moser_veselov_equation_holds_to_round_off_along_a_motion() {
    let moments = box_moments();
    let d = Matrix3::from_diagonal(&(V::repeat(0.5 * moments.sum()) - moments));
    let mut l = moments.component_mul(&V::new(1.0, 2.0, 3.0));
    for _ in 0..10_000 {
        let (f, after) = step(&moments, &l, 0.05).unwrap();
        let f = f.to_rotation_matrix().into_inner();
        let residual = f * d - d * f.transpose() - 0.05 * l.cross_matrix();
        assert!(residual.amax() <= 1e-15 * d.trace());
        assert!((f * after - l).norm() <= 1e-15 * l.norm());
        l = after;
    }
}

#[test]
fn energy_and_momentum_are_kept_at_1e_13_over_a_million_steps() {
    let moments = box_moments();
    let start = moments.component_mul(&V::new(1.0, 2.0, 3.0));
    let modified = |order| *ModifiedMoments::try_new(&moments, &start, 0.01, order).unwrap().moments();
    for used in [moments, modified(Preprocessing::Four), modified(Preprocessing::Ten)] {
        let map = MoserVeselov::new(&used);
        let mut l = CompensatedVector::new(start);
        for _ in 0..1_000_000 {
            let change = map.increment(l.value(), 0.01).unwrap().momentum_change;
            l.add(&change);
        }
        let energy_error = energy(&moments, l.value()) / energy(&moments, &start) - 1.0;
        let norm_error = l.value().norm() / start.norm() - 1.0;
        assert!(energy_error.abs() < 1e-13 && norm_error.abs() < 1e-13, "{energy_error:e} {norm_error:e}");
    }
}

#[test]
fn the_methods_keep_energy_and_world_momentum_at_1e_13_over_a_million_steps() {
    let body = RigidBody::try_principal(1.0, box_moments()).unwrap();
    let system = RigidBodySystem::free(body);
    let x = state(UnitQuaternion::from_euler_angles(0.3, -0.4, 1.2), V::new(1.0, 2.0, 3.0));
    let start = momentum(&body, &x);
    let kinetic = 0.5 * start.dot(x.angular_velocity());
    for (method, keeps_energy) in
        [("dmv2", true), ("pmv6", true), ("pmv10", true), ("dmv2s", true), ("lgvi", false)]
    {
        let y = run(method, &system, &x, 10_000.0, 1_000_000).unwrap();
        let end = momentum(&body, &y);
        assert!((end - start).norm() < 1e-14 * start.norm(), "{method} {:e}", (end - start).norm());
        let energy_error = 0.5 * end.dot(y.angular_velocity()) / kinetic - 1.0;
        let bound = if !keeps_energy {
            1e-3
        } else if method == "dmv2s" {
            1e-12
        } else {
            1e-13
        };
        assert!(energy_error.abs() < bound, "{method} {energy_error:e}");
    }
}

/// Both orders at once: errors of orientation and angular velocity at the end for three step sizes.
fn slopes(method: &str, body: &RigidBody, steps: [u64; 3]) -> Vec<[f64; 2]> {
    let system = RigidBodySystem::free(*body);
    let axes = body.inertia().principal_axes();
    let q0 = UnitQuaternion::from_euler_angles(0.3, -0.4, 1.2);
    let start = V::new(0.4, -0.5, 1.9);
    let moments = *body.inertia().principal_moments();
    let omega = q0 * (axes * start.component_div(&moments));
    let (turn, end) = taylor(&moments, start, 5.0, 40);
    let q = q0 * axes * turn * axes.inverse();
    let omega_end = q * (axes * end.component_div(&moments));
    let errors = steps.map(|n| {
        let y = run(method, &system, &state(q0, omega), 5.0, n).unwrap();
        [gap(y.orientation(), &q), (y.angular_velocity() - omega_end).norm()]
    });
    let floor = 2e-14;
    assert!(errors.as_flattened().iter().all(|e| *e > 5.0 * floor), "{method} {errors:?}");
    (0..2)
        .map(|i| {
            let ratio = |k: usize| {
                (errors[i][k] / errors[i + 1][k]).ln() / (steps[i + 1] as f64 / steps[i] as f64).ln()
            };
            [ratio(0), ratio(1)]
        })
        .collect()
}

#[test]
fn orders_of_orientation_and_angular_velocity_of_a_free_body() {
    let body = RigidBody::try_principal(1.0, V::new(1.0, 2.0, 2.5)).unwrap();
    let tilted = RigidBody::try_new(
        1.0,
        body.inertia().rotated(&UnitQuaternion::from_euler_angles(0.5, 0.2, -0.9)).unwrap(),
    )
    .unwrap();
    for body in [body, tilted] {
        for (method, order, steps) in [
            ("dmv2", 2.0, [100, 200, 400]),
            ("dmv2s", 2.0, [100, 200, 400]),
            ("lgvi", 2.0, [100, 200, 400]),
            ("pmv4", 4.0, [50, 100, 200]),
            ("pmv6", 6.0, [20, 40, 80]),
            ("pmv8", 8.0, [16, 24, 36]),
            ("pmv10", 10.0, [8, 11, 15]),
        ] {
            for [orientation, velocity] in slopes(method, &body, steps) {
                assert!((orientation - order).abs() < 0.25, "{method} orientation {orientation}");
                assert!((velocity - order).abs() < 0.25, "{method} angular velocity {velocity}");
            }
        }
    }
}

#[test]
fn energy_ratio_is_one_in_every_cell_of_table_6_2() {
    for (y, z) in (1..=100).flat_map(|y| (1..=100).map(move |z| (f64::from(y) / 100.0, f64::from(z) / 100.0)))
    {
        // (6.2) as inverse inertia; h = 1 and |ω| = 1, which for the cube is the largest step there is.
        let moments = V::new(y * y + z * z, 1.0 + z * z, 1.0 + y * y) / 2.0;
        let map = MoserVeselov::new(&moments);
        let start = moments / 3f64.sqrt();
        let mut l = start;
        for n in 0..100 {
            let increment = map.increment(&l, 1.0).unwrap_or_else(|e| panic!("{y} {z} step {n}: {e}"));
            l += increment.momentum_change;
            let ratio = energy(&moments, &l) / energy(&moments, &start);
            assert!((ratio - 1.0).abs() < 2e-14, "{y} {z} step {n}: {ratio}");
        }
    }
}

#[test]
fn a_changed_coefficient_lowers_the_observed_order() {
    // A relative 1e-4 h⁸ in one modified moment, as from a wrong digit in s₉, shows in the order.
    let (moments, start) = (V::new(1.0, 2.0, 2.5), V::new(0.4, -0.5, 1.9));
    let (q, _) = taylor(&moments, start, 5.0, 40);
    let error = |n: u32, fault: f64| {
        let h = 5.0 / f64::from(n);
        let mut modified =
            *ModifiedMoments::try_new(&moments, &start, h, Preprocessing::Ten).unwrap().moments();
        modified[1] *= 1.0 + fault * h.powi(8);
        let map = MoserVeselov::new(&modified);
        let (mut l, mut r) = (CompensatedVector::new(start), UnitQuaternion::identity());
        for _ in 0..n {
            let increment = map.increment(l.value(), h).unwrap();
            l.add(&increment.momentum_change);
            r *= increment.rotation;
        }
        gap(&r, &q)
    };
    let slope = |fault| (error(8, fault) / error(15, fault)).ln() / (15f64 / 8.0).ln();
    assert!(slope(0.0) > 9.75, "{}", slope(0.0));
    assert!(slope(1e-4) < 9.75, "{}", slope(1e-4));
}

#[test]
fn failures_of_the_step_are_typed() {
    let body = RigidBody::try_principal(1.0, V::new(1.0, 2.0, 2.5)).unwrap();
    let free = RigidBodySystem::free(body);
    let x = RigidBodyState::spinning(V::new(0.3, 0.2, 2.0));
    for (method, allowed) in [
        ("dmv2", 1.0),
        ("dmv2s", 1.0),
        ("lgvi", 0.7698),
        ("pmv4", 1.0),
        ("pmv6", 1.0),
        ("pmv8", 1.0),
        ("pmv10", 1.0),
    ] {
        match run(method, &free, &x, 10.0, 10) {
            Err(IntegrateError::Step(StepError::Angle { method: found, angle, limit, .. })) => {
                assert!(found == method && angle > 2.0 && (limit - allowed).abs() < 1e-4);
            }
            other => panic!("{method}: {:?}", other.map(|_| ())),
        }
    }
    let top = under(body, ConstantForce { force: V::new(0.0, 0.0, -9.81), point: V::z() });
    for method in ["dmv2", "pmv4", "pmv6", "pmv8", "pmv10"] {
        let refused = run(method, &top, &x, 0.1, 10);
        assert!(matches!(refused, Err(IntegrateError::Step(StepError::Torque { .. }))), "{method}");
    }
}

#[test]
fn the_variational_method_is_another_map_than_moser_veselov() {
    let body = RigidBody::try_principal(1.0, V::new(1.0, 2.0, 2.5)).unwrap();
    let (free, x) = (RigidBodySystem::free(body), RigidBodyState::spinning(V::new(0.3, 0.2, 2.0)));
    let one = |method| *run(method, &free, &x, 0.1, 1).unwrap().orientation();
    assert!(gap(&one("dmv2"), &one("dmv2s")) < 1e-15);
    assert!(gap(&one("dmv2"), &one("lgvi")) > 1e-5);
}

#[test]
fn uniform_gravity_is_exact_and_drag_is_of_second_order() {
    let body = RigidBody::try_principal(2.0, V::new(1.0, 2.0, 2.5)).unwrap();
    let x = state(UnitQuaternion::identity(), V::new(0.3, -0.2, 0.5));
    let falling = under(body, Gravity::earth());
    let drag = under(body, (Gravity::earth(), Drag { linear: 1.0, quadratic: 0.5, angular: 0.0 }));
    let reference = run("rkmk", &drag, &x, 2.0, 4000).unwrap();
    for method in ["dmv2", "dmv2s", "pmv10", "lgvi"] {
        let y = run(method, &falling, &x, 2.0, 40).unwrap();
        let expected = x.position() + x.velocity() * 2.0 + V::new(0.0, 0.0, -9.81) * 2.0;
        assert!((y.position() - expected).norm() < 1e-13, "{method}");
        let error = |n| {
            let y = run(method, &drag, &x, 2.0, n).unwrap();
            [(y.position() - reference.position()).norm(), (y.velocity() - reference.velocity()).norm()]
        };
        let errors = [200, 400, 800].map(error);
        for k in 0..2 {
            for i in 0..2 {
                let slope = (errors[i][k] / errors[i + 1][k]).log2();
                assert!((slope - 2.0).abs() < 0.15, "{method} {k} {slope}");
            }
        }
    }
}

#[test]
fn split_and_variational_methods_are_of_second_order_under_torque() {
    let body = RigidBody::try_principal(1.0, V::new(1.0, 2.0, 2.5)).unwrap();
    let turn = UnitQuaternion::from_euler_angles(0.5, 0.2, -0.9);
    let tilted = RigidBody::try_new(1.0, body.inertia().rotated(&turn).unwrap()).unwrap();
    let weight = ConstantForce { force: V::new(0.0, 0.0, -2.0), point: V::new(0.3, 0.1, 0.6) };
    let drag = Drag { linear: 0.2, quadratic: 0.1, angular: 0.4 };
    let x = state(UnitQuaternion::from_euler_angles(0.3, -0.4, 1.2), V::new(0.4, -0.2, 0.8));
    for body in [body, tilted] {
        let check = |system: &dyn Fn(&str, u64) -> RigidBodyState| {
            let reference = system("rkmk", 4000);
            for method in ["dmv2s", "lgvi"] {
                let errors = [100, 200, 400].map(|n| {
                    let y = system(method, n);
                    [
                        gap(y.orientation(), reference.orientation()),
                        (y.angular_velocity() - reference.angular_velocity()).norm(),
                    ]
                });
                for k in 0..2 {
                    for i in 0..2 {
                        let slope = (errors[i][k] / errors[i + 1][k]).log2();
                        assert!((slope - 2.0).abs() < 0.2, "{method} {k} {slope}");
                    }
                }
            }
        };
        check(&|method, n| run(method, &under(body, weight), &x, 3.0, n).unwrap());
        check(&|method, n| run(method, &under(body, (weight, drag)), &x, 3.0, n).unwrap());
    }
}

#[test]
fn a_heavy_top_keeps_vertical_momentum_and_its_energy_error_bounded() {
    let body = RigidBody::try_principal(1.0, V::new(1.0, 2.0, 2.5)).unwrap();
    let weight = ConstantForce { force: V::new(0.0, 0.0, -2.0), point: V::new(0.3, 0.1, 0.6) };
    let top = under(body, weight);
    let x = RigidBodyState::spinning(V::new(0.4, -0.2, 0.8));
    let total = |x: &RigidBodyState| {
        0.5 * momentum(&body, x).dot(x.angular_velocity())
            - weight.force.dot(&(x.orientation() * weight.point))
    };
    for method in ["dmv2s", "lgvi"] {
        // The energy error after 200 s is no larger than its swing over the first 20 s.
        let early = (1..=20).map(|t| run(method, &top, &x, f64::from(t), 50 * t as u64).unwrap());
        let swing = early.map(|y| (total(&y) - total(&x)).abs()).fold(0.0, f64::max);
        assert!(swing < 1e-2, "{method} {swing:e}");
        for t in [196, 197, 198, 199, 200, 2000] {
            let y = run(method, &top, &x, f64::from(t), 50 * t as u64).unwrap();
            let error = (total(&y) - total(&x)).abs();
            assert!(error < 2.0 * swing, "{method} {error:e} {swing:e}");
            assert!((momentum(&body, &y).z - momentum(&body, &x).z).abs() < 1e-12, "{method}");
        }
    }
}
