//! Prints dynamics of robots in random states as JSON, for comparison with another package:
//! `cargo run --release -p somersault-testkit --example dump_robot -- 100 fixed tests/urdf/arm.urdf`, read
//! by `tests/python/compare_urdf_with_pinocchio.py` and `compare_mjcf_with_mujoco.py`, with what was repaired of the document and
//! the bodies that stand for what it has. Accelerations are null where the mass matrix is singular. The base of URDF is `fixed`, `planar` or `free`; `mjcf` in its place is the format. A
//! document that is refused is the reason.

use somersault_multibody::mjcf::{MjcfFiles, MjcfOptions};
use somersault_multibody::robot::{Change, Repair, Robot};
use somersault_multibody::urdf::{self, Base, UrdfOptions};
use somersault_multibody::{Data, DynamicsError, MassProperties, Model};
use somersault_testkit::trees::{Random, random_configuration};
use std::error::Error;
use std::path::Path;

fn state(model: &Model, random: &mut Random) -> Result<String, Box<dyn Error>> {
    let n = model.n_velocities();
    let mut data = Data::new(model);
    let q = random_configuration(random, model)?;
    let (v, a, torque) = (random.numbers(n, 2.0), random.numbers(n, 5.0), random.numbers(n, 5.0));
    let accelerations = match model.forward_dynamics(&mut data, &q, &v, &torque, &[]) {
        Err(DynamicsError::Singular { .. }) => "null".to_owned(),
        found => format!("{:?}", found?),
    };
    let mut fields = vec![format!(r#""q":{q:?},"v":{v:?},"a":{a:?},"aba":{accelerations}"#)];
    let mut put = |name: &str, numbers: &[f64]| fields.push(format!(r#""{name}":{numbers:?}"#));
    put("tau", &torque);
    put("bias", model.bias(&mut data, &q, &v)?);
    put("rnea", model.inverse_dynamics(&mut data, &q, &v, &a, &[])?);
    put("gravity_forces", model.gravity_forces(&mut data, &q)?);
    put("crba", model.mass_matrix(&mut data, &q)?.as_slice());
    let poses = model.positions(&mut data, &q)?;
    let places = (0..model.n_bodies()).map(|i| Ok(poses.pose(i)?.translation.as_slice().to_vec()));
    put("positions", &places.collect::<Result<Vec<_>, Box<dyn Error>>>()?.concat());
    Ok(format!("{{{}}}", fields.join(",")))
}

fn repaired(repair: &Repair) -> String {
    let at = match &repair.change {
        Change::Locked { at } => format!("{at:?}"),
        _ => "null".to_owned(),
    };
    format!(r#"{{"element":{:?},"text":{:?},"at":{at}}}"#, repair.element, repair.to_string())
}

/// The robot, or why it is refused.
fn read(format: &str, path: &str) -> Result<Result<Robot, String>, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let base = match format {
        "fixed" => Base::Fixed,
        "planar" => Base::Planar,
        "free" => Base::Free,
        "mjcf" => {
            let files = MjcfFiles::beside(text, Path::new(path).parent().unwrap_or(Path::new("")));
            let robot = files.and_then(|files| files.read(&MjcfOptions::default()));
            return Ok(robot.map_err(|reason| reason.to_string()));
        }
        _ => return Err("the base is fixed, planar or free".into()),
    };
    let robot = urdf::read(&text, &UrdfOptions { base, ..UrdfOptions::default() });
    Ok(robot.map_err(|reason| reason.to_string()))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [count, format, path] = arguments.as_slice() else {
        return Err("usage: dump_robot COUNT fixed|planar|free|mjcf FILE".into());
    };
    let Robot { model, repairs, ignored, geometry, .. } = match read(format, path)? {
        Ok(robot) => robot,
        Err(reason) => {
            println!(r#"{{"refused":{reason:?}}}"#);
            return Ok(());
        }
    };
    let repairs: Vec<String> = repairs.iter().map(repaired).collect();
    let mut bodies = Vec::new();
    for (i, link) in model.links().iter().enumerate() {
        let (nq, nv) = (model.positions_of(i).len(), model.velocities_of(i).len());
        let MassProperties { mass, center, inertia } = link.mass_properties();
        bodies.push(format!(
            r#"{{"name":{:?},"joint":{:?},"nq":{nq},"nv":{nv},"follows":{},"mass":{mass:?},"center":{:?},"inertia":{:?}}}"#,
            link.name(),
            link.joint().kind().name,
            link.mimic().map_or("null".to_owned(), |m| format!("[{:?},{:?},{:?}]", m.leader, m.multiplier, m.offset)),
            center.as_slice(),
            inertia.as_slice()
        ));
    }
    let mut random = Random::new(1);
    let states = (0..count.parse()?).map(|_| state(&model, &mut random)).collect::<Result<Vec<_>, _>>()?;
    println!(
        r#"{{"repairs":[{}],"n_ignored":{},"n_shapes":{},"bodies":[{}],"states":[{}]}}"#,
        repairs.join(","),
        ignored.len(),
        geometry.len(),
        bodies.join(","),
        states.join(",\n")
    );
    Ok(())
}
