//! Prints dynamics of URDF models in random states as JSON, for comparison with another package:
//! `cargo run --release -p somersault-testkit --example dump_urdf -- 100 fixed tests/urdf/arm.urdf`, read
//! by `tests/python/compare_urdf_with_pinocchio.py`, with what was repaired of the document and the bodies that stand for
//! what it has. The base is `fixed`, `planar` or `free`. A document that is refused is the reason.

use somersault_multibody::robot::{Change, Repair, Robot};
use somersault_multibody::urdf::{self, Base, UrdfOptions};
use somersault_multibody::{Data, MassProperties, Model};
use somersault_testkit::trees::{Random, random_configuration};
use std::error::Error;

fn state(model: &Model, random: &mut Random) -> Result<String, Box<dyn Error>> {
    let n = model.n_velocities();
    let mut data = Data::new(model);
    let q = random_configuration(random, model)?;
    let (v, a) = (random.numbers(n, 2.0), random.numbers(n, 5.0));
    let mut fields = vec![format!(r#""q":{q:?},"v":{v:?},"a":{a:?}"#)];
    let mut put = |name: &str, numbers: &[f64]| fields.push(format!(r#""{name}":{numbers:?}"#));
    put("rnea", model.inverse_dynamics(&mut data, &q, &v, &a, &[])?);
    put("gravity_forces", model.gravity_forces(&mut data, &q)?);
    put("crba", model.mass_matrix(&mut data, &q)?.as_slice());
    Ok(format!("{{{}}}", fields.join(",")))
}

fn repaired(repair: &Repair) -> String {
    let at = match &repair.change {
        Change::Locked { at } => format!("{at:?}"),
        _ => "null".to_owned(),
    };
    format!(r#"{{"element":{:?},"text":{:?},"at":{at}}}"#, repair.element, repair.to_string())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [count, base, path] = arguments.as_slice() else {
        return Err("usage: dump_urdf COUNT fixed|planar|free FILE".into());
    };
    let base = match base.as_str() {
        "fixed" => Base::Fixed,
        "planar" => Base::Planar,
        "free" => Base::Free,
        _ => return Err("the base is fixed, planar or free".into()),
    };
    let options = UrdfOptions { base, ..UrdfOptions::default() };
    let Robot { model, repairs, geometry, .. } = match urdf::read(&std::fs::read_to_string(path)?, &options) {
        Ok(robot) => robot,
        Err(reason) => {
            println!(r#"{{"refused":{:?}}}"#, reason.to_string());
            return Ok(());
        }
    };
    let repairs: Vec<String> = repairs.iter().map(repaired).collect();
    let mut bodies = Vec::new();
    for (i, link) in model.links().iter().enumerate() {
        let (nq, nv) = (model.positions_of(i).len(), model.velocities_of(i).len());
        let MassProperties { mass, center, inertia } = link.mass_properties();
        bodies.push(format!(
            r#"{{"name":{:?},"nq":{nq},"nv":{nv},"follows":{},"mass":{mass:?},"center":{:?},"inertia":{:?}}}"#,
            link.name(),
            link.mimic().is_some(),
            center.as_slice(),
            inertia.as_slice()
        ));
    }
    let mut random = Random::new(1);
    let states = (0..count.parse()?).map(|_| state(&model, &mut random)).collect::<Result<Vec<_>, _>>()?;
    println!(
        r#"{{"repairs":[{}],"n_shapes":{},"bodies":[{}],"states":[{}]}}"#,
        repairs.join(","),
        geometry.len(),
        bodies.join(","),
        states.join(",\n")
    );
    Ok(())
}
