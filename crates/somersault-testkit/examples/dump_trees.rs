//! Prints the diver and random trees, their states and their dynamics as JSON, for comparison with another package:
//! `cargo run --release -p somersault-testkit --example dump_trees -- 1000`, read by
//! `tests/python/compare_with_pinocchio.py`.

use nalgebra::DMatrix;
use somersault_multibody::{Axes, Data, DerivativeData, Force, Model, Partials, Transform};
use somersault_testkit::trees::{Random, State, diver, random_configuration, random_tree, random_wrenches};
use std::error::Error;

/// The tree, one object per body; the numbers of vectors and matrices by columns.
fn tree(model: &Model) -> String {
    let mut bodies = Vec::new();
    for i in 0..model.n_bodies() {
        let (Some(inertia), Some(placement), Some(joint)) =
            (model.inertia(i), model.placement(i), model.joint(i))
        else {
            continue;
        };
        let (kind, axis) = (joint.kind().name, joint.axis().map_or([0.0; 3], |axis| (*axis).into()));
        bodies.push(format!(
            r#"{{"parent":{},"kind":"{kind}","axis":{axis:?},"rotation":{:?},"origin":{:?},"mass":{:?},"first_moment":{:?},"inertia":{:?}}}"#,
            model.parent(i).map_or(-1, |p| p as i64),
            placement.rotation.as_slice(),
            placement.translation.as_slice(),
            inertia.mass(),
            inertia.first_moment().as_slice(),
            inertia.rotational().as_slice(),
        ));
    }
    format!(r#""gravity":{:?},"bodies":[{}]"#, model.gravity().as_slice(), bodies.join(","))
}

fn state(model: Model, random: &mut Random) -> Result<State, Box<dyn Error>> {
    let n = model.n_velocities();
    let q = random_configuration(random, &model)?;
    let (v, a, torque) = (random.numbers(n, 2.0), random.numbers(n, 5.0), random.numbers(n, 5.0));
    Ok(State { model, q, v, a, torque })
}

fn case(state: &State, random: &mut Random) -> Result<String, Box<dyn Error>> {
    let State { model, q, v, a, torque } = state;
    let n = model.n_velocities();
    let mut data = Data::new(model);
    let wrenches = random_wrenches(random, model);
    let mut fields = vec![tree(model)];
    let mut put = |name: &str, numbers: &[f64]| fields.push(format!(r#""{name}":{numbers:?}"#));
    put("q", q);
    put("v", v);
    put("a", a);
    put("torque", torque);
    let flat = |f: &Force<f64>| f.linear.iter().chain(&f.angular).copied().collect::<Vec<f64>>();
    put("wrenches", &wrenches.iter().flat_map(flat).collect::<Vec<f64>>());
    put("rnea", model.inverse_dynamics(&mut data, q, v, a, &wrenches)?);
    put("crba", model.mass_matrix(&mut data, q)?.as_slice());
    put("aba", model.forward_dynamics(&mut data, q, v, torque, &wrenches)?);
    put("bias", model.bias(&mut data, q, v)?);
    put("gravity_forces", model.gravity_forces(&mut data, q)?);
    let centroidal = model.centroidal(&mut data, q)?;
    put("momentum_matrix", centroidal.matrix.as_slice());
    put("momentum", &flat(&centroidal.momentum(v)?));
    put("center_of_mass", centroidal.center_of_mass.as_slice());
    let frame = Transform::from_parts(&random.rotation(), random.vector(0.5));
    put("frame_rotation", frame.rotation.as_slice());
    put("frame_origin", frame.translation.as_slice());
    let last = model.n_bodies() - 1;
    let mut jacobian = DMatrix::zeros(6, n);
    let state = model.velocities(&mut data, q, v)?;
    put("kinetic_energy", &[state.kinetic_energy()]);
    put("potential_energy", &[state.positions().potential_energy()]);
    for (name, axes) in [("jacobian_frame", Axes::Frame), ("jacobian_world", Axes::World)] {
        state.positions().jacobian_into(last, &frame, axes, &mut jacobian)?;
        put(name, jacobian.as_slice());
    }
    let mut work = DerivativeData::new(model);
    let mut partials = |name: &str, p: Partials<'_>| {
        for (by, matrix) in [("q", p.q), ("v", p.v), ("input", p.input)] {
            fields.push(format!(r#""{name}_{by}":{:?}"#, matrix.as_slice()));
        }
    };
    partials("rnea", model.inverse_dynamics_partials(&mut work, q, v, a, &wrenches)?);
    partials("aba", model.forward_dynamics_partials(&mut work, q, v, torque, &wrenches)?);
    let p = model.momentum_partials(&mut work, q, v)?;
    for (name, matrix) in [("center_q", p.center_of_mass_q), ("momentum_q", p.q)] {
        fields.push(format!(r#""{name}":{:?}"#, matrix.as_slice()));
    }
    Ok(format!("{{{}}}", fields.join(",")))
}

fn main() -> Result<(), Box<dyn Error>> {
    let count = std::env::args().nth(1).map_or(Ok(100), |n| n.parse())?;
    println!("[{}", case(&diver(), &mut Random::new(27))?);
    for seed in 0..count {
        let mut random = Random::new(seed);
        let n = 1 + random.below(40);
        let state = state(random_tree(&mut random, n, 0.0)?, &mut random)?;
        println!(",{}", case(&state, &mut random)?);
    }
    println!("]");
    Ok(())
}
