//! Trees of bodies: identities on seeded random trees, closed forms, derivatives, bad input.

use nalgebra::{DMatrix, DVector, Matrix3, Quaternion, UnitQuaternion, Vector3};
use num_dual::Dual64;
use somersault::multibody::models::{CartPendulum, TwoLinkArm};
use somersault::multibody::{
    Axes, Data, DynamicsError, Force, Joint, Link, MassProperties, Model, ModelBuilder, ModelError, Split,
    Transform,
};
use somersault_core::argument::ArgumentError;
use somersault_testkit::trees::{Case, Random, cases, humanoid, random_configuration};

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

fn largest_difference(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len());
    x.iter().zip(y).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}

/// Condition number of a mass matrix.
fn condition(m: &DMatrix<f64>) -> f64 {
    if m.is_empty() {
        return 1.0;
    }
    let eigenvalues = m.symmetric_eigenvalues();
    eigenvalues.max() / eigenvalues.min()
}

fn duals(x: &[f64]) -> Vec<Dual64> {
    x.iter().map(|&x| Dual64::from_re(x)).collect()
}

/// (x, dx) as dual numbers.
fn along(x: &[f64], dx: &[f64]) -> Vec<Dual64> {
    x.iter().zip(dx).map(|(&x, &dx)| Dual64::new(x, dx)).collect()
}

/// q ⊕ ε v.
fn moved(model: &Model<Dual64>, q: &[f64], v: &[f64]) -> Vec<Dual64> {
    let mut out = duals(q);
    model.displace(&duals(q), &along(&vec![0.0; v.len()], v), &mut out).expect("lengths fit");
    out
}

#[test]
fn forward_dynamics_inverts_inverse_dynamics() {
    for (seed, case) in cases(300).enumerate() {
        let Case { model, q, v, a, wrenches, .. } = case;
        let mut data = Data::new(&model);
        let torque = model.inverse_dynamics(&mut data, &q, &v, &a, &wrenches).unwrap().to_vec();
        let back = model.forward_dynamics(&mut data, &q, &v, &torque, &wrenches).unwrap().to_vec();
        let m = model.mass_matrix(&mut data, &q).unwrap();
        let scale = largest(&a) + 1.0;
        let condition = condition(m);
        let bound = scale * f64::max(1e-10, 100.0 * f64::EPSILON * condition);
        assert!(largest_difference(&back, &a) <= bound, "seed {seed}: {}", largest_difference(&back, &a));
    }
}

#[test]
fn columns_of_the_mass_matrix_are_inverse_dynamics() {
    for (seed, case) in cases(100).enumerate() {
        let Case { model, q, .. } = case;
        let (mut data, n) = (Data::new(&model), model.n_velocities());
        let m = model.mass_matrix(&mut data, &q).unwrap().clone();
        let weight = model.gravity_forces(&mut data, &q).unwrap().to_vec();
        let rest = vec![0.0; n];
        for k in 0..n {
            let mut unit = rest.clone();
            unit[k] = 1.0;
            let force = model.inverse_dynamics(&mut data, &q, &rest, &unit, &[]).unwrap();
            for j in 0..n {
                let off = (force[j] - weight[j] - m[(j, k)]).abs();
                assert!(off < 1e-12 * (m.amax() + largest(&weight)), "seed {seed}: {off:e}");
                assert_eq!(m[(j, k)], m[(k, j)]);
            }
        }
    }
}

#[test]
fn kinetic_energy_is_half_v_m_v() {
    for case in cases(200) {
        let Case { model, q, v, .. } = case;
        let mut data = Data::new(&model);
        let m = model.mass_matrix(&mut data, &q).unwrap().clone();
        let v_ = DVector::from_column_slice(&v);
        let energy = model.velocities(&mut data, &q, &v).unwrap().kinetic_energy();
        assert!((0.5 * v_.dot(&(&m * &v_)) - energy).abs() <= 1e-13 * (1.0 + energy));
    }
}

#[test]
fn bias_is_inverse_dynamics_without_acceleration_and_gravity_forces_are_the_slope_of_the_potential() {
    for case in cases(60) {
        let Case { model, q, v, mut random, .. } = case;
        let (mut data, n) = (Data::new(&model), model.n_velocities());
        let zero = vec![0.0; n];
        let bias = model.bias(&mut data, &q, &v).unwrap().to_vec();
        assert_eq!(bias, model.inverse_dynamics(&mut data, &q, &v, &zero, &[]).unwrap());
        let weight = model.gravity_forces(&mut data, &q).unwrap().to_vec();
        assert_eq!(weight, model.bias(&mut data, &q, &zero).unwrap());
        // exact derivative of the potential along a direction
        let direction = random.numbers(n, 1.0);
        let dual = model.cast::<Dual64>();
        let slope = dual
            .positions(&mut Data::new(&dual), &moved(&dual, &q, &direction))
            .unwrap()
            .potential_energy()
            .eps;
        let expected: f64 = weight.iter().zip(&direction).map(|(g, d)| g * d).sum();
        assert!((slope - expected).abs() < 1e-12 * (1.0 + largest(&weight)) * n as f64);
    }
}

#[test]
fn power_of_the_joint_forces_and_wrenches_is_the_rate_of_energy() {
    for (seed, case) in cases(100).enumerate() {
        let Case { model, q, v, a, wrenches, .. } = case;
        let mut data = Data::new(&model);
        let torque = model.inverse_dynamics(&mut data, &q, &v, &a, &wrenches).unwrap().to_vec();
        let mut power: f64 = torque.iter().zip(&v).map(|(t, v)| t * v).sum();
        let velocities = model.velocities(&mut data, &q, &v).unwrap();
        for (i, wrench) in wrenches.iter().enumerate() {
            power += velocities.velocity(i).unwrap().dot(wrench);
        }
        // damping is the same joint force with its sign turned
        let undamped = model.bias(&mut data, &q, &v).unwrap().to_vec();
        let reversed: Vec<f64> = v.iter().map(|v| -v).collect();
        let returned = model.bias(&mut data, &q, &reversed).unwrap();
        for k in 0..v.len() {
            power -= 0.5 * (undamped[k] - returned[k]) * v[k];
        }
        let dual = model.cast::<Dual64>();
        let mut data = Data::new(&dual);
        let state = dual.velocities(&mut data, &moved(&dual, &q, &v), &along(&v, &a)).unwrap();
        let rate = (state.kinetic_energy() + state.positions().potential_energy()).eps;
        let scale = 1.0 + largest(&torque) * largest(&v) * v.len() as f64;
        assert!((rate - power).abs() < 1e-12 * scale, "seed {seed}: {rate} {power}");
    }
}

#[test]
fn momentum_matrix_times_v_is_the_sum_of_the_bodies_momenta() {
    for case in cases(100) {
        let Case { model, q, v, .. } = case;
        let mut data = Data::new(&model);
        let (momentum, center) = {
            let c = model.centroidal(&mut data, &q).unwrap();
            (c.momentum(&v).unwrap(), c.center_of_mass)
        };
        let mut other = Data::new(&model);
        let state = model.velocities(&mut other, &q, &v).unwrap();
        assert!((state.positions().center_of_mass() - center).norm() < 1e-13 * (1.0 + center.norm()));
        let mut sum = Force::zero();
        for i in 0..model.n_bodies() {
            let inertia = *model.inertia(i).unwrap();
            let carried = inertia.times(&state.velocity(i).unwrap());
            sum += state.positions().pose(i).unwrap().force(&carried);
        }
        let sum = sum.about(&center);
        let scale = 1.0 + sum.linear.norm() * (1.0 + center.norm()) + sum.angular.norm();
        assert!((sum.linear - momentum.linear).norm() < 1e-12 * scale);
        assert!((sum.angular - momentum.angular).norm() < 1e-12 * scale);
        // linear momentum is mass times the velocity of the centre of mass
        let dual = model.cast::<Dual64>();
        let rate = dual
            .positions(&mut Data::new(&dual), &moved(&dual, &q, &v))
            .unwrap()
            .center_of_mass()
            .map(|x| x.eps);
        assert!((rate * model.mass() - momentum.linear).norm() < 1e-11 * scale);
    }
}

#[test]
fn without_outer_forces_the_momentum_changes_as_gravity_says() {
    for case in cases(60) {
        let Case { model, q, v, random: mut r, .. } = case;
        if model.joint(0) != Some(&Joint::Free) {
            continue;
        }
        let model = undamped(&model, &mut r);
        let mut torque = r.numbers(model.n_velocities(), 3.0);
        torque[..6].fill(0.0);
        let mut data = Data::new(&model);
        let a = model.forward_dynamics(&mut data, &q, &v, &torque, &[]).unwrap().to_vec();
        let dual = model.cast::<Dual64>();
        let mut data = Data::new(&dual);
        let rate =
            dual.centroidal(&mut data, &moved(&dual, &q, &v)).unwrap().momentum(&along(&v, &a)).unwrap();
        let weight = model.gravity() * model.mass();
        let scale = 1e-10 * (1.0 + largest(&a)) * model.mass();
        assert!((rate.linear.map(|x| x.eps) - weight).norm() < scale);
        assert!(rate.angular.map(|x| x.eps).norm() < scale);
    }
}

/// Another tree of the same joints, without damping: the generator draws it when asked for none.
fn undamped(model: &Model, random: &mut Random) -> Model {
    let mut builder = ModelBuilder::new().with_gravity(*model.gravity());
    for i in 0..model.n_bodies() {
        let (joint, body) = (*model.joint(i).unwrap(), random.body());
        let name = format!("b{i}");
        let link = match model.parent(i) {
            None => Link::root(name, joint, body),
            Some(p) => Link::child(name, format!("b{p}"), joint, body),
        };
        builder.add(link.at(random.vector(0.5)).turned(random.rotation())).unwrap();
    }
    builder.build().unwrap()
}

#[test]
fn jacobians_are_the_derivatives_of_poses() {
    for case in cases(60) {
        let Case { model, q, v, mut random, .. } = case;
        let body = random.below(model.n_bodies());
        let frame = Transform::from_parts(&random.rotation(), random.vector(1.0));
        let mut data = Data::new(&model);
        let positions = model.positions(&mut data, &q).unwrap();
        let n = model.n_velocities();
        let (mut world, mut own) = (DMatrix::zeros(6, n), DMatrix::zeros(6, n));
        positions.jacobian_into(body, &frame, Axes::World, &mut world).unwrap();
        positions.jacobian_into(body, &frame, Axes::Frame, &mut own).unwrap();
        let turn = positions.pose(body).unwrap().compose(&frame).rotation;
        let v_ = DVector::from_column_slice(&v);
        let (world, own) = (world * &v_, own * &v_);
        assert!((world.fixed_rows::<3>(0) - turn * own.fixed_rows::<3>(0)).norm() < 1e-12);
        assert!((world.fixed_rows::<3>(3) - turn * own.fixed_rows::<3>(3)).norm() < 1e-12);
        // dual numbers
        let dual = model.cast::<Dual64>();
        let mut dual_data = Data::new(&dual);
        let frame_ = Transform::new(nalgebra::convert(frame.rotation), nalgebra::convert(frame.translation));
        let pose = dual
            .positions(&mut dual_data, &moved(&dual, &q, &v))
            .unwrap()
            .pose(body)
            .unwrap()
            .compose(&frame_);
        let rate = pose.translation.map(|x| x.eps);
        let spin = pose.rotation.map(|x| x.eps) * turn.transpose();
        assert!((rate - world.fixed_rows::<3>(0)).norm() < 1e-12 * (1.0 + rate.norm()));
        let spin = Vector3::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]);
        assert!((spin - world.fixed_rows::<3>(3)).norm() < 1e-12 * (1.0 + spin.norm()));
        // central differences
        let h = 1e-5;
        let mut at = |h: f64| {
            let mut moved = q.clone();
            let step: Vec<f64> = v.iter().map(|v| v * h).collect();
            model.displace(&q, &step, &mut moved).unwrap();
            model.positions(&mut data, &moved).unwrap().pose(body).unwrap().compose(&frame).translation
        };
        let difference = (at(h) - at(-h)) / (2.0 * h);
        assert!((difference - rate).norm() < 1e-6 * (1.0 + rate.norm()));
    }
}

#[test]
fn velocities_and_accelerations_are_rates_of_poses_and_velocities() {
    for case in cases(40) {
        let Case { model, q, v, a, mut random, .. } = case;
        let body = random.below(model.n_bodies());
        let mut data = Data::new(&model);
        let state = model.accelerations(&mut data, &q, &v, &a).unwrap();
        let (velocity, acceleration) =
            (state.velocities().velocity(body).unwrap(), state.acceleration(body).unwrap());
        let dual = model.cast::<Dual64>();
        let mut data = Data::new(&dual);
        let state = dual.velocities(&mut data, &moved(&dual, &q, &v), &along(&v, &a)).unwrap();
        let pose = state.positions().pose(body).unwrap();
        let turn = pose.rotation.map(|x| x.re);
        let rate = turn.tr_mul(&pose.translation.map(|x| x.eps));
        assert!((rate - velocity.linear).norm() < 1e-11 * (1.0 + rate.norm()));
        // d/dt in body axes equals the spatial acceleration, since v × v = 0
        let rate = state.velocity(body).unwrap();
        assert!(
            (rate.linear.map(|x| x.eps) - acceleration.linear).norm()
                < 1e-10 * (1.0 + acceleration.linear.norm())
        );
        assert!(
            (rate.angular.map(|x| x.eps) - acceleration.angular).norm()
                < 1e-10 * (1.0 + acceleration.angular.norm())
        );
    }
}

#[test]
fn hybrid_dynamics_agrees_with_full_dynamics_for_any_split() {
    for (seed, case) in cases(200).enumerate() {
        let Case { model, q, v, a, wrenches, mut random } = case;
        let mut data = Data::new(&model);
        let torque = model.inverse_dynamics(&mut data, &q, &v, &a, &wrenches).unwrap().to_vec();
        let condition = condition(model.mass_matrix(&mut data, &q).unwrap());
        let all = [vec![true; v.len()], vec![false; v.len()]];
        let some = (0..3).map(|_| (0..v.len()).map(|_| random.below(2) == 0).collect());
        for active in all.into_iter().chain(some) {
            let split = Split::new(active);
            // what is not known is filled with nonsense
            let hide = |known: &[f64], is_known: bool| -> Vec<f64> {
                let flags = split.active().iter();
                known.iter().zip(flags).map(|(&x, &f)| if f == is_known { x } else { f64::NAN }).collect()
            };
            let (mut found_a, mut found_torque) = (hide(&a, true), hide(&torque, false));
            model
                .hybrid_dynamics(&mut data, &split, &q, &v, &mut found_a, &mut found_torque, &wrenches)
                .unwrap();
            let scale =
                (1.0 + largest(&a) + largest(&torque)) * f64::max(1e-11, 100.0 * f64::EPSILON * condition);
            assert!(largest_difference(&found_a, &a) < scale, "seed {seed}");
            assert!(largest_difference(&found_torque, &torque) < scale, "seed {seed}");
        }
    }
}

#[test]
fn hybrid_dynamics_is_the_corrected_appendix_c() {
    // q̈_p = M_pp⁻¹(u_p − M_pa q̈_a − h_p), u_a = (C.26) + M_ap M_pp⁻¹ u_p, with two of each
    let model = humanoid().unwrap();
    let mut random = Random::new(7);
    let q = random_configuration(&mut random, &model).unwrap();
    let n = model.n_velocities();
    let (v, mut a, mut u) = (random.numbers(n, 2.0), random.numbers(n, 5.0), random.numbers(n, 5.0));
    let passive = 9;
    let split = Split::new((0..n).map(|k| k >= passive).collect());
    let mut data = Data::new(&model);
    let m = model.mass_matrix(&mut data, &q).unwrap().clone();
    let h = DVector::from_column_slice(model.bias(&mut data, &q, &v).unwrap());
    let (mpp, mpa) = (m.view((0, 0), (passive, passive)), m.view((0, passive), (passive, n - passive)));
    let (map, maa) = (mpa.transpose(), m.view((passive, passive), (n - passive, n - passive)));
    let inverse = mpp.clone_owned().try_inverse().unwrap();
    let a_active = DVector::from_column_slice(&a[passive..]);
    let u_passive = DVector::from_column_slice(&u[..passive]);
    let (h_passive, h_active) = (h.rows(0, passive), h.rows(passive, n - passive));
    let a_passive = &inverse * (&u_passive - mpa * &a_active - h_passive);
    let u_active =
        (maa - &map * &inverse * mpa) * &a_active + &map * &inverse * (u_passive - h_passive) + h_active;
    model.hybrid_dynamics(&mut data, &split, &q, &v, &mut a, &mut u, &[]).unwrap();
    assert!(largest_difference(&a[..passive], a_passive.as_slice()) < 1e-10 * (1.0 + a_passive.amax()));
    assert!(largest_difference(&u[passive..], u_active.as_slice()) < 1e-10 * (1.0 + u_active.amax()));
}

#[test]
fn a_split_by_names_takes_whole_joints() {
    let model = humanoid().unwrap();
    let split = Split::try_active(&model, &["left upper arm", "head"]).unwrap();
    assert_eq!(split.active().iter().filter(|&&a| a).count(), 4);
    let unknown = Split::try_active(&model, &["tail"]);
    assert_eq!(unknown, Err(DynamicsError::UnknownBody { name: "tail".into() }));
}

#[test]
fn repeated_calls_on_one_workspace_agree_to_the_bit() {
    for case in cases(40) {
        let Case { model, q, v, a, wrenches, .. } = case;
        let fresh = || Data::new(&model);
        let mut used = Data::new(&model);
        for _ in 0..2 {
            let expected = model.inverse_dynamics(&mut fresh(), &q, &v, &a, &wrenches).unwrap().to_vec();
            assert_eq!(model.inverse_dynamics(&mut used, &q, &v, &a, &wrenches).unwrap(), expected);
            let expected = model.forward_dynamics(&mut fresh(), &q, &v, &a, &wrenches).unwrap().to_vec();
            assert_eq!(model.forward_dynamics(&mut used, &q, &v, &a, &wrenches).unwrap(), expected);
            let expected = model.mass_matrix(&mut fresh(), &q).unwrap().clone();
            assert_eq!(*model.mass_matrix(&mut used, &q).unwrap(), expected);
            let expected = model.gravity_forces(&mut fresh(), &q).unwrap().to_vec();
            assert_eq!(model.gravity_forces(&mut used, &q).unwrap(), expected);
            let expected = model.centroidal(&mut fresh(), &q).unwrap().matrix.clone();
            assert_eq!(*model.centroidal(&mut used, &q).unwrap().matrix, expected);
            let expected = model.velocities(&mut fresh(), &q, &v).unwrap().kinetic_energy();
            assert_eq!(model.velocities(&mut used, &q, &v).unwrap().kinetic_energy(), expected);
        }
    }
}

#[test]
fn difference_inverts_integrate_and_keeps_quaternions_of_unit_norm() {
    for case in cases(100) {
        let Case { model, q, mut random, .. } = case;
        let v = random.numbers(model.n_velocities(), 1.7);
        let (mut moved, mut back) = (q.clone(), v.clone());
        model.displace(&q, &v, &mut moved).unwrap();
        model.difference(&q, &moved, &mut back).unwrap();
        assert!(largest_difference(&back, &v) < 1e-12);
        let mut scaled: Vec<f64> = moved.clone();
        for i in 0..model.n_bodies() {
            if let Some(Joint::Spherical | Joint::Free) = model.joint(i) {
                let end = model.positions_of(i).end;
                scaled[end - 4..end].iter_mut().for_each(|x| *x *= 3.0);
            }
        }
        model.normalize(&mut scaled).unwrap();
        assert!(largest_difference(&scaled, &moved) < 1e-15 * (1.0 + largest(&moved)));
    }
}

#[test]
fn a_world_far_away_changes_nothing() {
    let model = humanoid().unwrap();
    let mut random = Random::new(3);
    let mut q = random_configuration(&mut random, &model).unwrap();
    let mut data = Data::new(&model);
    let near = model.mass_matrix(&mut data, &q).unwrap().clone();
    q[0] += 1e6;
    assert_eq!(*model.mass_matrix(&mut data, &q).unwrap(), near);
}

#[test]
fn the_cart_pendulum_obeys_the_corrected_equations_of_appendix_a() {
    let mut random = Random::new(1);
    for _ in 0..1000 {
        let p = CartPendulum {
            cart_mass: random.within(0.5, 3.0),
            mass: random.within(0.5, 3.0),
            length: random.within(0.3, 2.0),
            gravity: 9.81,
        };
        let model = p.model().unwrap();
        let mut data = Data::new(&model);
        let (q, v, a) = (random.numbers(2, 4.0), random.numbers(2, 4.0), random.numbers(2, 4.0));
        let (sin, cos) = q[1].sin_cos();
        let (mc, m, l) = (p.cart_mass, p.mass, p.length);
        let force = (mc + m) * a[0] - m * l * a[1] * cos + m * l * v[1] * v[1] * sin;
        let torque = m * l * l * a[1] - m * l * a[0] * cos - m * p.gravity * l * sin;
        let found = model.inverse_dynamics(&mut data, &q, &v, &a, &[]).unwrap();
        let scale = 1e-13 * (1.0 + (mc + m) * 4.0 + m * l * (16.0 + 4.0 * l + p.gravity));
        assert!(largest_difference(found, &[force, torque]) < scale);
        let split = Split::try_active(&model, &["cart"]).unwrap();
        let (mut found_a, mut found_u) = ([a[0], f64::NAN], [f64::NAN, torque]);
        model.hybrid_dynamics(&mut data, &split, &q, &v, &mut found_a, &mut found_u, &[]).unwrap();
        assert!((found_a[1] - a[1]).abs() < scale / (m * l * l));
        assert!((found_u[0] - force).abs() < scale * (1.0 + 1.0 / l));
    }
}

#[test]
fn the_two_link_arm_obeys_the_corrected_equations_of_section_8_2() {
    let mut random = Random::new(2);
    let thesis = TwoLinkArm::default();
    for k in 0..1000 {
        let mut pair = |low, high| [random.within(low, high), random.within(low, high)];
        let p = if k == 0 {
            thesis
        } else {
            TwoLinkArm { masses: pair(0.3, 2.0), lengths: pair(0.3, 2.0), damping: pair(0.0, 1.0) }
        };
        let model = p.model().unwrap();
        let ([m1, m2], [l1, l2], [c1, c2]) = (p.masses, p.lengths, p.damping);
        let (i1, i2) = (m1 * l1 * l1 / 12.0, m2 * l2 * l2 / 12.0);
        let (q, v) = (random.numbers(2, 4.0), random.numbers(2, 4.0));
        let (sin, cos) = q[1].sin_cos();
        let m11 = m1 / 4.0 * l1 * l1 + m2 * (l1 * l1 + l1 * l2 * cos + l2 * l2 / 4.0) + i1 + i2;
        let m12 = m2 * (l2 * l2 / 4.0 + 0.5 * l1 * l2 * cos) + i2;
        let m22 = m2 / 4.0 * l2 * l2 + i2;
        let c = [
            -0.5 * l1 * l2 * m2 * v[1] * sin * (2.0 * v[0] + v[1]) + c1 * v[0],
            0.5 * l1 * l2 * m2 * v[0] * v[0] * sin + c2 * v[1],
        ];
        let mut data = Data::new(&model);
        let scale = 1e-13 * (1.0 + largest(&c) + m11);
        assert!(largest_difference(model.bias(&mut data, &q, &v).unwrap(), &c) < scale);
        let m = model.mass_matrix(&mut data, &q).unwrap();
        assert!(largest_difference(m.as_slice(), &[m11, m12, m12, m22]) < scale);
    }
}

fn solid() -> MassProperties {
    MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() }
}

fn hinge(name: &str, parent: &str) -> Link {
    Link::child(name, parent, Joint::Revolute { axis: Vector3::z() }, solid())
}

/// The error of adding `link` to a tree of one free body named `base`.
fn refusal(link: Link) -> ModelError {
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("base", Joint::Free, solid())).unwrap();
    builder.add(link).unwrap_err()
}

#[test]
fn bad_trees_are_refused_with_the_name_of_the_body() {
    let name = || "arm".to_owned();
    assert_eq!(ModelBuilder::new().build().unwrap_err(), ModelError::Empty);
    assert_eq!(
        refusal(hinge("arm", "trunk")),
        ModelError::UnknownParent { name: name(), parent: "trunk".into() }
    );
    // a cycle would need a parent that comes later
    assert_eq!(refusal(hinge("arm", "arm")), ModelError::UnknownParent { name: name(), parent: name() });
    assert_eq!(refusal(hinge("base", "base")), ModelError::DuplicateName { name: "base".into() });
    assert_eq!(
        refusal(Link::root("arm", Joint::Free, solid())),
        ModelError::SecondRoot { name: name(), root: "base".into() }
    );
    for axis in [Joint::Revolute { axis: Vector3::zeros() }, Joint::Prismatic { axis: Vector3::zeros() }] {
        assert_eq!(refusal(Link::child("arm", "base", axis, solid())), ModelError::ZeroAxis { name: name() });
    }
    assert_eq!(
        refusal(hinge("arm", "base").with_limits(1.0, -1.0)),
        ModelError::LimitsCrossed { name: name(), lower: 1.0, upper: -1.0 }
    );
    assert_eq!(
        refusal(hinge("arm", "base").with_limits(f64::NAN, 1.0)),
        ModelError::NonFinite { name: name(), argument: "limits" }
    );
    let ball = Link::child("arm", "base", Joint::Spherical, solid()).with_limits(0.0, 1.0);
    assert_eq!(refusal(ball), ModelError::LimitsNotApplicable { name: name() });
    let stretched = UnitQuaternion::new_unchecked(Quaternion::new(2.0, 0.0, 0.0, 0.0));
    assert_eq!(
        refusal(hinge("arm", "base").turned(stretched)),
        ModelError::NotARotation { name: name(), found: 2.0 }
    );
    assert_eq!(
        refusal(hinge("arm", "base").with_damping(-1.0)),
        ModelError::Negative { name: name(), argument: "damping", found: -1.0 }
    );
    let non_finite = |argument| ModelError::NonFinite { name: name(), argument };
    assert_eq!(refusal(hinge("arm", "base").at(Vector3::repeat(f64::INFINITY))), non_finite("origin"));
    let axis = Joint::Revolute { axis: Vector3::repeat(f64::NAN) };
    assert_eq!(refusal(Link::child("arm", "base", axis, solid())), non_finite("axis"));
    let mut builder = ModelBuilder::new().with_gravity(Vector3::repeat(f64::NAN));
    builder.add(Link::root("base", Joint::Free, solid())).unwrap();
    assert!(matches!(builder.build(), Err(ModelError::NonFinite { argument: "gravity", .. })));
}

#[test]
fn bodies_that_cannot_exist_are_refused_with_their_name() {
    let with = |mass: MassProperties| refusal(Link::child("arm", "base", Joint::Spherical, mass));
    let name = || "arm".to_owned();
    assert_eq!(
        with(MassProperties { mass: -1.0, ..solid() }),
        ModelError::Negative { name: name(), argument: "mass", found: -1.0 }
    );
    assert!(matches!(with(MassProperties { mass: f64::NAN, ..solid() }), ModelError::NonFinite { .. }));
    assert!(matches!(with(MassProperties { mass: 0.0, ..solid() }), ModelError::NonPhysicalInertia { .. }));
    let diagonal =
        |x, y, z| MassProperties { inertia: Matrix3::from_diagonal(&Vector3::new(x, y, z)), ..solid() };
    assert!(matches!(with(diagonal(1.0, 1.0, 2.1)), ModelError::NonPhysicalInertia { .. }));
    assert!(matches!(with(diagonal(1.0, 1.0, -0.1)), ModelError::NonPhysicalInertia { .. }));
    let mut skew = solid();
    skew.inertia[(0, 1)] = 0.1;
    assert_eq!(with(skew), ModelError::AsymmetricInertia { name: name() });
}

#[test]
fn mass_may_be_missing_only_where_more_follows() {
    let joint = Joint::Revolute { axis: Vector3::z() };
    let bare = |name: &str, parent: &str, joint| Link::child(name, parent, joint, MassProperties::massless());
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("base", Joint::Fixed, MassProperties::massless())).unwrap();
    builder.add(bare("yoke", "base", joint)).unwrap();
    builder.add(bare("marker", "yoke", Joint::Fixed)).unwrap();
    let without = builder.clone().build();
    assert_eq!(without.unwrap_err(), ModelError::CarriesNoMass { name: "yoke".into() });
    builder.add(Link::child("ring", "yoke", Joint::Revolute { axis: Vector3::x() }, solid())).unwrap();
    let model = builder.build().unwrap();
    let a = model
        .forward_dynamics(&mut Data::new(&model), &[0.3, 0.2], &[0.0; 2], &[2.0, 3.0], &[])
        .unwrap()
        .to_vec();
    assert!(largest_difference(&a, &[2.0, 3.0]) < 1e-14);
}

#[test]
fn a_motion_without_inertia_is_an_error_that_names_the_joint() {
    let mut builder = ModelBuilder::new();
    let on_axis = MassProperties::point(1.0, Vector3::z());
    builder.add(Link::root("top", Joint::Revolute { axis: Vector3::z() }, on_axis)).unwrap();
    let model = builder.build().unwrap();
    let found =
        model.forward_dynamics(&mut Data::new(&model), &[0.0], &[0.0], &[1.0], &[]).map(<[f64]>::to_vec);
    assert_eq!(found, Err(DynamicsError::Singular { joint: "top".into() }));
    let model = CartPendulum::default().model().unwrap();
    let mut data = Data::new(&model);
    let found = model.forward_dynamics(&mut data, &[0.0, f64::NAN], &[0.0; 2], &[0.0; 2], &[]);
    assert!(matches!(found, Err(DynamicsError::Singular { .. })));
}

#[test]
fn arguments_of_the_wrong_length_are_named() {
    let model = CartPendulum::default().model().unwrap();
    let mut data = Data::new(&model);
    let wrong =
        |argument, found| DynamicsError::Argument(ArgumentError::Length { argument, expected: 2, found });
    let found = model.inverse_dynamics(&mut data, &[0.0], &[0.0; 2], &[0.0; 2], &[]);
    assert_eq!(found.unwrap_err(), wrong("q", 1));
    let found = model.forward_dynamics(&mut data, &[0.0; 2], &[0.0; 3], &[0.0; 2], &[]);
    assert_eq!(found.unwrap_err(), wrong("v", 3));
    let found = model.inverse_dynamics(&mut data, &[0.0; 2], &[0.0; 2], &[0.0; 2], &[Force::zero()]);
    assert_eq!(found.unwrap_err(), wrong("wrenches", 1));
    let other = humanoid().unwrap();
    assert_eq!(other.mass_matrix(&mut data, &other.neutral()).unwrap_err(), DynamicsError::ForeignData);
    let positions = model.positions(&mut data, &[0.0; 2]).unwrap();
    assert_eq!(positions.pose(2).unwrap_err(), DynamicsError::NoSuchBody { found: 2, n_bodies: 2 });
    let mut small = DMatrix::zeros(6, 1);
    assert!(positions.jacobian_into(0, &Transform::identity(), Axes::World, &mut small).is_err());
    let mut q = vec![0.0; other.n_positions()];
    assert_eq!(other.normalize(&mut q), Err(DynamicsError::NoRotation { joint: "torso".into() }));
}
