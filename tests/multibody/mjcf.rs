//! Models from MJCF: what is read, what MuJoCo makes of it, and what is refused.

use crate::urdf::{close, mutated};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault::multibody::mjcf::{self, MjcfError, MjcfFiles, MjcfOptions};
use somersault::multibody::robot::{DocumentError, GeometryPurpose, GeometryShape, Robot};
use somersault::multibody::{Data, Joint, MassProperties, Model};
use somersault_testkit::trees::Random;
use std::collections::BTreeMap;
use std::path::Path;

const ARM: &str = include_str!("../mjcf/arm.xml");
const GEOMS: &str = include_str!("../mjcf/geoms.xml");
const HUMANOID: &str = include_str!("../mjcf/humanoid.xml");
const STRICT: MjcfOptions = MjcfOptions { gravity: None, strict: true };

fn read(text: &str) -> Result<Robot, MjcfError> {
    mjcf::read(text, &MjcfOptions::default())
}

/// A document with the given content of the world.
fn world(inner: &str) -> String {
    format!("<mujoco model=\"m\">\n<worldbody>\n{inner}\n</worldbody></mujoco>")
}

fn refusal(inner: &str) -> String {
    read(&world(inner)).unwrap_err().to_string()
}

fn mass_of(robot: &Robot, body: &str) -> MassProperties {
    *robot.model.links()[robot.model.body(body).unwrap()].mass_properties()
}

fn humanoid() -> MjcfFiles {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/mjcf"));
    MjcfFiles::beside(HUMANOID.to_owned(), folder).unwrap()
}

/// Numbers by MuJoCo 4.0.0, which reads the same document; more states and documents in
/// `tests/python/compare_mjcf_with_mujoco.py`.
#[test]
fn the_arm_has_the_dynamics_that_mujoco_gives_it() {
    let robot = mjcf::read(ARM, &STRICT).unwrap();
    let (model, mut data) = (&robot.model, Data::new(&robot.model));
    let numbers = |start: f64, step: f64| (1..=7).map(|k| start + step * f64::from(k)).collect::<Vec<f64>>();
    let (q, v) = (numbers(0.0, 0.1), numbers(-0.5, 0.2));
    let diagonal = [
        0.12379393611623626,
        1.6261350405966235,
        2.299999999999999,
        0.06801586880926269,
        0.0038256958745461946,
        0.0005360741134808273,
        0.0012299999999999776,
    ];
    let bias = [
        1.4165964829769095,
        8.87831220613556,
        20.92039122179445,
        0.8617337147949224,
        0.06637532005992786,
        -0.06292230646088903,
        -0.04882131896911701,
    ];
    let hand = [0.027377061385355998, -0.21344450020511163, 1.6526092080889239];
    close(model.mass_matrix(&mut data, &q).unwrap().diagonal().as_slice(), &diagonal, 1e-13);
    close(model.bias(&mut data, &q, &v).unwrap(), &bias, 1e-13);
    let pose = model.positions(&mut data, &q).unwrap().pose(model.body("hand").unwrap()).unwrap();
    close(pose.translation.as_slice(), &hand, 1e-14);
}

#[test]
fn solids_have_their_mass_and_inertia() {
    use std::f64::consts::PI;
    let of = |geom: &str| {
        let text = world(&format!("<body name='b'><joint/><geom {geom}/></body>"));
        let found = mass_of(&mjcf::read(&text, &STRICT).unwrap(), "b");
        assert_eq!(found.center, Vector3::zeros());
        (found.mass, found.inertia.diagonal())
    };
    let close = |(mass, moments): (f64, Vector3<f64>), m: f64, expected: [f64; 3]| {
        assert!((mass - m).abs() < 1e-13 * m, "{mass} {m}");
        assert!(
            (moments - Vector3::from(expected)).amax() < 1e-13 * moments.amax(),
            "{moments} {expected:?}"
        );
    };
    let m = 1000.0 * 4.0 / 3.0 * PI * 0.008;
    close(of("size='0.2'"), m, [0.4 * m * 0.04; 3]);
    close(of("type='box' size='0.1 0.2 0.3' mass='3'"), 3.0, [0.13, 0.1, 0.05]);
    let m = 500.0 * PI * 0.01 * 0.6;
    let across = m * (3.0 * 0.01 + 0.36) / 12.0;
    close(of("type='cylinder' size='0.1 0.3' density='500'"), m, [across, across, m * 0.005]);
    let m = 1000.0 * 4.0 / 3.0 * PI * 0.006;
    close(of("type='ellipsoid' size='0.1 0.2 0.3'"), m, [m * 0.13 / 5.0, m * 0.1 / 5.0, m * 0.05 / 5.0]);
    // two halves of a ball at the ends of a cylinder, their centres of mass 3r/8 away
    let (r, l): (f64, f64) = (0.1, 0.6);
    let (ends, tube) = (1000.0 * 4.0 / 3.0 * PI * r.powi(3), 1000.0 * PI * r * r * l);
    let along = 0.4 * ends * r * r + 0.5 * tube * r * r;
    let half = 0.4 * r * r - (3.0 * r / 8.0_f64).powi(2) + (l / 2.0 + 3.0 * r / 8.0_f64).powi(2);
    let across = tube * (3.0 * r * r + l * l) / 12.0 + ends * half;
    close(of("type='capsule' size='0.1 0.3'"), ends + tube, [across, across, along]);
}

#[test]
fn several_shapes_are_one_body() {
    let text = world(
        "<body name='b'><joint/>
        <geom size='0.1' mass='1' pos='1 0 0'/><geom size='0.1' mass='3' pos='-1 0 0'/></body>",
    );
    let found = mass_of(&read(&text).unwrap(), "b");
    assert_eq!((found.mass, found.center), (4.0, Vector3::new(-0.5, 0.0, 0.0)));
    let own = 0.4 * 4.0 * 0.01;
    let expected = Matrix3::from_diagonal(&Vector3::new(own, own + 3.0, own + 3.0));
    assert!((found.inertia - expected).amax() < 1e-15);
}

#[test]
fn rotations_are_read_in_all_notations() {
    let turn = |compiler: &str, attribute: &str| {
        let text = format!(
            "<mujoco><compiler {compiler}/><worldbody><body name='a' {attribute}><joint/><geom size='1'/></body></worldbody></mujoco>"
        );
        let robot = mjcf::read(&text, &STRICT).unwrap();
        robot.model.links()[0].orientation().to_rotation_matrix().into_inner()
    };
    let about = |axis: Vector3<f64>, angle: f64| {
        UnitQuaternion::from_scaled_axis(axis * angle).to_rotation_matrix().into_inner()
    };
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let close = |a: Matrix3<f64>, b: Matrix3<f64>| assert!((a - b).amax() < 1e-15, "{a} {b}");
    close(turn("", "quat='2 0 0 0'"), Matrix3::identity());
    close(turn("", "quat='1 1 0 0'"), about(x, 90_f64.to_radians()));
    close(turn("", "axisangle='0 2 0 30'"), about(y, 30_f64.to_radians()));
    close(turn("angle='radian'", "axisangle='0 2 0 0.5'"), about(y, 0.5));
    let [a, b, c] = [10_f64, 20.0, 30.0].map(f64::to_radians);
    close(turn("", "euler='10 20 30'"), about(x, a) * about(y, b) * about(z, c));
    close(turn("eulerseq='XYZ'", "euler='10 20 30'"), about(z, c) * about(y, b) * about(x, a));
    close(turn("eulerseq='zYx'", "euler='10 20 30'"), about(y, b) * about(z, a) * about(x, c));
    close(turn("", "xyaxes='0 2 0 -1 5 0'"), about(z, 90_f64.to_radians()));
    close(turn("", "zaxis='3 0 0'"), about(y, 90_f64.to_radians()));
    close(turn("", "zaxis='0 0 -1'"), about(x, std::f64::consts::PI));
}

#[test]
fn the_innermost_rotation_counts_and_frames_move_what_they_hold() {
    let text = "<mujoco><default><geom type='box' size='1 2 3' euler='90 0 0'/></default>
      <worldbody><body name='b'><joint/>
        <frame pos='1 0 0' euler='0 0 90'>
          <inertial pos='0 2 0' mass='1' diaginertia='1 2 2.5'/>
          <geom quat='1 0 0 0'/><geom/>
        </frame></body></worldbody></mujoco>";
    let robot = mjcf::read(text, &STRICT).unwrap();
    let found = mass_of(&robot, "b");
    assert!((found.center - Vector3::new(-1.0, 0.0, 0.0)).norm() < 1e-15);
    assert!((found.inertia - Matrix3::from_diagonal(&Vector3::new(2.0, 1.0, 2.5))).amax() < 1e-15);
    let angles: Vec<f64> = robot.geometry.iter().map(|geometry| geometry.orientation.angle()).collect();
    assert!((angles[0] - 90_f64.to_radians()).abs() < 1e-15);
    assert!((angles[1] - 120_f64.to_radians()).abs() < 1e-15);
}

#[test]
fn joints_of_a_body_follow_one_another() {
    let text = world(
        "<body name='b' pos='1 2 3'>
          <joint name='along' type='slide' axis='2 0 0' ref='0.5' range='-1 2'/>
          <joint name='turn' axis='0 0 1' pos='0 1 0' ref='90' range='-10 100'/>
          <joint name='nod' axis='1 0 0' pos='0 0 1'/>
          <geom size='0.1' mass='1'/>
        </body>",
    );
    let robot = mjcf::read(&text, &STRICT).unwrap();
    let model = &robot.model;
    let names: Vec<&str> = (0..model.n_bodies()).filter_map(|i| model.name(i)).collect();
    assert_eq!(names, ["along", "turn", "nod", "b"]);
    let expected = [("along", 0), ("turn", 1), ("nod", 2)];
    assert_eq!(robot.joints, expected.map(|(name, body)| (name.to_owned(), body)));
    let right = 90_f64.to_radians();
    assert_eq!(robot.reference, [0.5, right, 0.0]);
    assert_eq!(model.limits(0), Some([-1.0, 2.0]));
    assert_eq!(model.limits(1), Some([-10_f64.to_radians(), 100_f64.to_radians()]));
    // the body is where the document shows it
    let pose = |q: &[f64]| {
        let mut data = Data::new(model);
        model.positions(&mut data, q).unwrap().pose(3).unwrap()
    };
    let shown = pose(&robot.reference);
    assert!((shown.translation - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-15);
    assert!((shown.rotation - Matrix3::identity()).amax() < 1e-15);
    // 0.2 m along x, a right angle about the axis through (0, 1, 0), then one about that through (0, 0, 1)
    let moved = pose(&[0.7, 2.0 * right, right]);
    assert!(
        (moved.translation - Vector3::new(1.2 + 1.0 - 1.0, 3.0, 4.0)).norm() < 1e-14,
        "{}",
        moved.translation
    );
}

#[test]
fn a_free_body_starts_where_the_document_shows_it() {
    let text = world("<body name='b' pos='1 2 3' quat='1 0 0 1'><freejoint/><geom size='1'/></body>");
    let robot = mjcf::read(&text, &STRICT).unwrap();
    assert_eq!(robot.model.joint(0), Some(&Joint::Free));
    let half = 0.5_f64.sqrt();
    let expected = [1.0, 2.0, 3.0, 0.0, 0.0, half, half];
    assert!(
        robot.reference.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15),
        "{:?}",
        robot.reference
    );
    assert_eq!(robot.model.placement(0).unwrap().translation, Vector3::zeros());
    // several bodies of the world hang on it
    let text =
        world("<body><freejoint/><geom size='1'/></body><body name='c'><joint/><geom size='1'/></body>");
    let robot = mjcf::read(&text, &STRICT).unwrap();
    let names: Vec<&str> = robot.model.links().iter().map(|link| link.name()).collect();
    assert_eq!(names, ["world", "body 1", "c"]);
}

#[test]
fn classes_of_defaults_are_nested() {
    let text = "<mujoco>
      <default>
        <joint damping='1' axis='1 0 0'/><geom size='0.1 0.2' density='100'/>
        <default class='leg'><joint damping='2'/><geom type='capsule'/>
          <default class='foot'><joint damping='3'/></default>
        </default>
      </default>
      <worldbody>
        <body name='a' childclass='leg'><joint/><geom size='0.3'/>
          <body name='b'><joint class='main'/><geom/>
            <body name='c' childclass='foot'><joint axis='0 1 0'/><geom class='main'/></body>
          </body>
        </body>
      </worldbody></mujoco>";
    let robot = mjcf::read(text, &STRICT).unwrap();
    let of = |k: usize| (robot.model.links()[k].damping(), *robot.model.joint(k).unwrap());
    let about = |axis: Vector3<f64>| Joint::Revolute { axis };
    assert_eq!(of(0), (2.0, about(Vector3::x())));
    assert_eq!(of(1), (1.0, about(Vector3::x())));
    assert_eq!(of(2), (3.0, about(Vector3::y())));
    let shapes: Vec<&GeometryShape> = robot.geometry.iter().map(|geometry| &geometry.shape).collect();
    // of a size that gives one number the default gives the rest
    assert_eq!(shapes[0], &GeometryShape::Capsule { radius: 0.3, length: 0.4 });
    assert_eq!(shapes[1], &GeometryShape::Capsule { radius: 0.1, length: 0.4 });
    assert_eq!(shapes[2], &GeometryShape::Sphere { radius: 0.1 });
}

#[test]
fn defaults_are_given_for_elements_that_exist() {
    let of = |elements: &str| {
        mjcf::read(
            &format!(
                "<mujoco><default>{elements}</default><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
            ),
            &STRICT,
        )
    };
    // what MuJoCo 4.0.0 takes there
    let known = "<mesh/><material/><joint/><geom/><site/><camera/><light/><pair/><equality/><tendon/><general/><motor/>\
                 <position/><velocity/><intvelocity/><damper/><cylinder/><muscle/><adhesion/><dcmotor/><texture/>";
    assert!(of(known).is_ok(), "{:?}", of(known).err());
    // and what it refuses
    for unknown in
        ["jiont", "geoms", "body", "inertial", "freejoint", "weld", "connect", "fixed", "spatial", "frame"]
    {
        let found = of(&format!("<{unknown} damping='1'/>")).unwrap_err().to_string();
        assert!(found.contains(&format!("<{unknown}>")) && found.contains("<default>"), "{found}");
    }
}

#[test]
fn equal_joints_follow_and_others_are_listed() {
    let text = |equality: &str| {
        format!(
            "<mujoco><compiler angle='radian'/><worldbody><body name='palm'><geom size='1'/>
            <body name='a'><joint name='one' ref='0.25'/><geom size='1'/></body>
            <body name='b'><joint name='two' ref='0.5'/><geom size='1'/></body>
            </body></worldbody><equality>{equality}</equality></mujoco>"
        )
    };
    let linear = text("<joint joint1='two' joint2='one' polycoef='0.125 -2'/>");
    let robot = mjcf::read(&linear, &STRICT).unwrap();
    let mimic = robot.model.mimic(robot.model.body("b").unwrap()).unwrap().clone();
    assert_eq!((mimic.leader.as_str(), mimic.multiplier, mimic.offset), ("a", -2.0, 0.625 + 0.5));
    assert_eq!(robot.reference, [0.25]);
    // what a polynomial leaves out is 0 1 0 0 0
    let robot = mjcf::read(&text("<joint joint1='two' joint2='one' polycoef='0.5'/>"), &STRICT).unwrap();
    assert_eq!(robot.model.links()[2].mimic().map(|m| (m.multiplier, m.offset)), Some((1.0, 0.75)));
    let robot = mjcf::read(&text("<joint joint1='two' polycoef='0.125'/>"), &STRICT).unwrap();
    assert_eq!(robot.model.n_velocities(), 1);
    assert!((robot.model.links()[2].orientation().angle() - 0.125).abs() < 1e-15);
    let robot = mjcf::read(&text("<joint joint1='two' joint2='one' active='false'/>"), &STRICT).unwrap();
    assert_eq!(robot.model.n_velocities(), 2);
    for (constraint, reason) in [
        ("<weld body1='a' body2='b'/>", "<weld> (line 4): constraints other than of two joints are not read"),
        (
            "<joint name='j' joint1='two' joint2='one' polycoef='0 1 2'/>",
            "joint `j` (line 4): a polynomial that is not linear is not read",
        ),
    ] {
        let robot = read(&text(constraint)).unwrap();
        assert_eq!(robot.ignored.iter().map(ToString::to_string).collect::<Vec<_>>(), [reason]);
        assert!(matches!(mjcf::read(&text(constraint), &STRICT), Err(MjcfError::Refused { .. })));
    }
    let lost = read(&text("<joint joint1='two' joint2='three'/>")).unwrap_err();
    assert_eq!(lost.to_string(), "<joint> (line 4) names the joint `three`, which does not exist");
}

#[test]
fn what_is_ignored_is_listed_and_refused_where_nothing_may_be() {
    let text = "<mujoco>
      <option density='1.2'/>
      <worldbody><body name='b' gravcomp='1'>
        <joint name='j' stiffness='3' frictionloss='0.1' novelty='1'/><geom size='1'/></body></worldbody>
      <contact><exclude body1='b' body2='b'/></contact>
      <actuator><motor joint='j'/><motor joint='j'/></actuator>
      <tendon><fixed name='t' stiffness='2'><joint joint='j' coef='1'/></fixed></tendon>
      <sensor><jointpos joint='j'/></sensor>
      <keyframe/>
    </mujoco>";
    let listed: Vec<String> = read(text).unwrap().ignored.iter().map(ToString::to_string).collect();
    let expected = [
        "<option> (line 2): forces of the medium around the bodies are not read",
        "body `b` (line 3): compensation of gravity is not read",
        "joint `j` (line 4): the attribute `novelty` is not known",
        "joint `j` (line 4): springs of joints are not read",
        "joint `j` (line 4): dry friction of joints is not read",
        "<contact> (line 5): contacts are no part of a tree (1)",
        "<actuator> (line 6): actuators are not read: joint forces are an argument (2)",
        "fixed `t` (line 7): tendons are not read",
        "<sensor> (line 8): sensors are not read (1)",
    ];
    assert_eq!(listed, expected);
    let found = mjcf::read(text, &STRICT).unwrap_err();
    assert_eq!(
        found.to_string(),
        "<option> (line 2) cannot be read: forces of the medium around the bodies are not read"
    );
    // what is done to a tree is no part of it
    let outside = text
        .replace("density='1.2'", "")
        .replace("gravcomp='1'", "")
        .replace("stiffness='3' frictionloss='0.1' novelty='1'", "")
        .replace("stiffness='2'", "");
    assert_eq!(mjcf::read(&outside, &STRICT).unwrap().ignored.len(), 4);
}

#[test]
fn gravity_is_that_of_the_document_unless_it_is_given() {
    let text = |option: &str| {
        format!("<mujoco>{option}<worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>")
    };
    let gravity = |option: &str| *read(&text(option)).unwrap().model.gravity();
    assert_eq!(gravity(""), Vector3::new(0.0, 0.0, -9.81));
    assert_eq!(gravity("<option gravity='1 2 3'/>"), Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(gravity("<option><flag gravity='disable'/></option>"), Vector3::zeros());
    let given = MjcfOptions { gravity: Some(Vector3::x()), strict: true };
    assert_eq!(
        *mjcf::read(&text("<option gravity='1 2 3'/>"), &given).unwrap().model.gravity(),
        Vector3::x()
    );
}

#[test]
fn impossible_bodies_are_repaired_and_massless_joints_fixed() {
    let text = world(
        "<body name='b'><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 3'/>
        <body name='c'><joint name='loose' type='slide' range='0.5 1'/></body></body>",
    );
    let listed: Vec<String> = read(&text).unwrap().repairs.iter().map(ToString::to_string).collect();
    assert_eq!(listed.len(), 2);
    assert!(listed[0].starts_with("body `b` (line 3) cannot have the principal moments"), "{}", listed[0]);
    assert_eq!(listed[1], "joint `loose` (line 4) moves no mass and is fixed at 0.5");
    assert!(matches!(mjcf::read(&text, &STRICT), Err(MjcfError::Document(DocumentError::Rejected { .. }))));
}

#[test]
fn what_is_seen_and_touched_is_kept() {
    let text = "<mujoco><compiler meshdir='meshes/'/>
      <asset><mesh name='skin' file='a/skin.stl' scale='1 1 2'/><mesh file='shell.obj'/></asset>
      <worldbody><geom name='rock' type='box' size='1 1 1'/><geom type='plane' size='1 1 1'/>
      <body name='b'><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>
        <geom name='face' type='mesh' mesh='skin' contype='0' conaffinity='0' pos='0 0 1'/>
        <geom type='mesh' mesh='shell'/>
      </body></worldbody></mujoco>";
    let robot = mjcf::read(text, &STRICT).unwrap();
    let of = |k: usize| &robot.geometry[k];
    assert_eq!(robot.geometry.len(), 3);
    assert_eq!((of(0).body, of(0).purpose), (None, GeometryPurpose::Collision));
    assert_eq!(of(0).shape, GeometryShape::Box { size: Vector3::repeat(2.0) });
    let face = (of(1).body, of(1).purpose, of(1).name.as_deref(), of(1).position);
    assert_eq!(face, (Some(0), GeometryPurpose::Visual, Some("face"), Vector3::z()));
    let mesh =
        |file: &str, z: f64| GeometryShape::Mesh { file: file.to_owned(), scale: Vector3::new(1.0, 1.0, z) };
    assert_eq!(of(1).shape, mesh("meshes/a/skin.stl", 2.0));
    assert_eq!((of(2).purpose, &of(2).shape), (GeometryPurpose::Collision, &mesh("meshes/shell.obj", 1.0)));
    // without an inertial the mass would follow from the mesh
    let light = text.replace("<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>", "");
    let found = read(&light).unwrap_err().to_string();
    assert_eq!(
        found,
        "geom `face` (line 5) cannot be read: its mass is that of a mesh, which is not opened: give the body an <inertial>"
    );
}

#[test]
fn files_beside_the_document_are_included_once() {
    let robot = humanoid().read(&STRICT).unwrap();
    assert_eq!(robot.name, "humanoid");
    assert_eq!(robot.model.n_velocities(), 6 + 3 + 8 + 3 + 4);
    assert!((robot.model.mass() - 68.0).abs() < 1e-12);
    assert_eq!(robot.model.name(0), Some("world"));
    assert!(robot.model.body("left_shin").is_ok());
    let found = read(HUMANOID).unwrap_err();
    assert_eq!(
        found.to_string(),
        "<include> (line 5) includes `parts/defaults.xml`: the text of this file is not given"
    );
    let including = |file: &str| {
        let text = world(&format!("<include file='{file}'/>"));
        MjcfFiles::beside(text, Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/mjcf"))).unwrap_err()
    };
    for file in ["../python/conftest.py", "/etc/hostname", "parts/../../lib.rs", "."] {
        assert!(matches!(including(file), MjcfError::FileElsewhere { .. }), "{file}");
    }
    assert!(matches!(including("nowhere.xml"), MjcfError::Unreadable { .. }));
    let twice = "<mujoco><include file='a.xml'/><include file='./a.xml'/></mujoco>".to_owned();
    let itself = "<mujocoinclude><include file='a.xml'/></mujocoinclude>".to_owned();
    for (text, included) in
        [(twice, "<a/>".to_owned()), ("<mujoco><include file='a.xml'/></mujoco>".into(), itself)]
    {
        let files = MjcfFiles { text, included: BTreeMap::from([("a.xml".to_owned(), included)]) };
        let found = files.read(&STRICT).unwrap_err();
        assert!(matches!(found, MjcfError::IncludedTwice { .. }), "{found}");
    }
    // an error in a file names it
    let mut files = humanoid();
    let legs = files.included.get_mut("parts/legs.xml").unwrap();
    *legs = legs.replace("size=\"0.049\"", "size=\"wide\"");
    let found = files.read(&STRICT).unwrap_err().to_string();
    assert_eq!(
        found,
        "`size` of <geom> of `parts/legs.xml` (line 9) must be 3 finite number(s), found `wide`"
    );
    files.included.insert("parts/legs.xml".to_owned(), "<a".to_owned());
    let found = files.read(&STRICT).unwrap_err().to_string();
    assert!(found.starts_with("the included file `parts/legs.xml`: not a readable XML document"), "{found}");
}

#[test]
fn bad_elements_are_refused_with_their_names() {
    let body = |inner: &str| refusal(&format!("<body name='b'>{inner}</body>"));
    assert_eq!(
        read("<robot/>").unwrap_err().to_string(),
        "the outermost element must be <mujoco>, found <robot>"
    );
    assert_eq!(read("<mujoco/>").unwrap_err(), MjcfError::NoBody);
    assert_eq!(
        body("<joint name='j' type='screw'/>"),
        "`type` of joint `j` (line 3) must be hinge, slide, ball, free, found `screw`"
    );
    assert_eq!(
        body("<joint name='j' axis='0 1'/>"),
        "`axis` of joint `j` (line 3) must be 3 finite number(s), found `0 1`"
    );
    assert_eq!(
        body("<joint name='j' axis='0 0 0'/><geom size='1'/>"),
        "joint `j` (line 3): the joint axis of `b` is zero"
    );
    assert_eq!(
        body("<geom name='g'/>"),
        "`size` of geom `g` (line 3) must be 1 positive number(s), found ``"
    );
    assert_eq!(
        body("<geom name='g' type='box' size='1 2'/>"),
        "`size` of geom `g` (line 3) must be 3 positive number(s), found `1 2`"
    );
    assert_eq!(
        body("<geom name='g' size='1' class='lost'/>"),
        "geom `g` (line 3) names the class `lost`, which does not exist"
    );
    assert_eq!(
        refusal("<body name='b' quat='1 0 0 0' euler='0 0 0'/>"),
        "body `b` (line 3) is turned by both `quat` and `euler`"
    );
    assert_eq!(
        refusal("<body name='b'/><body name='b'/>"),
        "body `b` (line 3) has the name of an earlier one"
    );
    assert_eq!(
        body("<body name='c'><freejoint/></body>"),
        "<freejoint> (line 3) cannot be read: free joints are for bodies of the world"
    );
    assert_eq!(body("<wheel/>"), "<wheel> (line 3) does not belong in <body>");
    assert_eq!(refusal("<joint/>"), "<joint> (line 3) cannot be read: the world has no joints");
    assert_eq!(
        body("<inertial pos='0 0 0' mass='1'/>"),
        "<inertial> (line 3) has no attribute `diaginertia`"
    );
    let global = "<mujoco><compiler coordinate='global'/></mujoco>";
    assert!(read(global).unwrap_err().to_string().contains("global coordinates"));
    let replicated = refusal("<replicate count='3'><body/></replicate>");
    assert!(replicated.starts_with("<replicate> (line 3) cannot be read: what is generated"), "{replicated}");
}

#[test]
fn hostile_documents_cost_neither_stack_nor_time() {
    let entities = r#"<!DOCTYPE mujoco [<!ENTITY x SYSTEM "file:///etc/hostname">]><mujoco model="&x;"/>"#;
    assert!(matches!(read(entities), Err(MjcfError::Document(DocumentError::Xml { .. }))));
    let deep = 30_000;
    let nested = |open: &str, close: &str| {
        let inner = "<joint/><geom size='1'/>";
        world(&format!("{}{inner}{}", open.repeat(deep), close.repeat(deep)))
    };
    assert_eq!(read(&nested("<body>", "</body>")).unwrap().model.n_bodies(), deep);
    let frames = read(&world(&format!(
        "<body>{}<geom size='1'/>{}</body>",
        "<frame>".repeat(deep),
        "</frame>".repeat(deep)
    )));
    assert_eq!(frames.unwrap().model.n_bodies(), 1);
    let classes: String = (0..deep).map(|k| format!("<default class='{k}'>")).collect();
    let text = format!("<mujoco><default>{classes}{}</default></mujoco>", "</default>".repeat(deep));
    assert!(read(&text).unwrap_err().to_string().contains("classes are nested too deeply"));
    let joints = "<joint/>".repeat(1000);
    let text = format!("<mujoco><default>{joints}</default></mujoco>");
    assert!(read(&text).unwrap_err().to_string().contains("its class has too many elements"));
}

/// What may be put anywhere in a document of this format.
const OF_MJCF: [&str; 12] = [
    "</body>",
    "<body name=\"a\">",
    "<freejoint/>",
    "<joint type=\"ball\"/>",
    "<geom size=\"0.1\"/>",
    "<frame pos=\"1 0 0\">",
    "<include file=\"parts/legs.xml\"/>",
    "mesh=\"x\"",
    "class=\"stiff\"",
    "fromto=\"0 0 0 1 1 1\"",
    "zaxis=\"0 0 0\"",
    "range=\"1 -1\"",
];

/// A thousand documents with everything in them, damaged by a generator of fixed seed.
#[test]
fn a_thousand_damaged_robots_end_no_process() {
    let whole = humanoid();
    let files = |text: &str| MjcfFiles { text: text.to_owned(), ..whole.clone() };
    let seeds = [files(ARM), files(GEOMS), whole.clone()];
    let seeds: Vec<MjcfFiles> = seeds
        .into_iter()
        .enumerate()
        .map(|(k, files)| if k < 2 { MjcfFiles { included: BTreeMap::new(), ..files } } else { files })
        .collect();
    let (mut accepted, mut refused) = (0, 0);
    for seed in 0..1000 {
        let mut random = Random::new(2_000_000 + seed);
        let mut files = seeds[seed as usize % 3].clone();
        match (seed % 3, random.below(3)) {
            (2, 1) => {
                let legs = files.included.get_mut("parts/legs.xml").unwrap();
                *legs = mutated(&mut random, legs, &OF_MJCF);
            }
            (2, 2) => {
                let defaults = files.included.get_mut("parts/defaults.xml").unwrap();
                *defaults = mutated(&mut random, defaults, &OF_MJCF);
            }
            _ => files.text = mutated(&mut random, &files.text, &OF_MJCF),
        }
        for strict in [false, true] {
            match files.read(&MjcfOptions { strict, gravity: None }) {
                Err(error) => {
                    assert!(!error.to_string().is_empty());
                    refused += 1;
                }
                Ok(Robot { model, reference, .. }) => {
                    assert_eq!(reference.len(), model.n_positions());
                    computed(&model, &reference);
                    accepted += 1;
                }
            }
        }
    }
    assert!(accepted > 100 && refused > 100, "{accepted} {refused}");
}

fn computed(model: &Model, q: &[f64]) {
    let rest = vec![0.0; model.n_velocities()];
    let mut data = Data::new(model);
    let _ = model.forward_dynamics(&mut data, q, &rest, &rest, &[]);
}
