//! Models from URDF: what is read, what another package makes of it, and what is refused.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault::multibody::models::{CartPendulum, Diver, TwoLinkArm};
use somersault::multibody::robot::{DocumentError, GeometryPurpose, GeometryShape};
use somersault::multibody::urdf::{self, Base, UrdfError, UrdfOptions};
use somersault::multibody::{Data, Joint, Link, MassProperties, Model, ModelBuilder, ModelError};
use somersault_testkit::trees::{Random, random_configuration};

const ARM: &str = include_str!("../urdf/arm.urdf");
const HUMANOID: &str = include_str!("../urdf/humanoid.urdf");

fn read_as(text: &str, options: &UrdfOptions) -> Result<Model, UrdfError> {
    urdf::read(text, options).map(|robot| robot.model)
}

fn read(text: &str) -> Result<Model, UrdfError> {
    read_as(text, &UrdfOptions { strict: true, ..UrdfOptions::default() })
}

pub(crate) fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    for (x, y) in found.iter().zip(expected) {
        assert!((x - y).abs() <= tolerance * scale, "{found:?} is not {expected:?}");
    }
}

/// Numbers by Pinocchio 4.1.0, which reads the same document; more states in
/// `tests/python/compare_urdf_with_pinocchio.py`.
#[test]
fn the_arm_has_the_dynamics_that_pinocchio_gives_it() {
    let model = read(ARM).unwrap();
    let mut data = Data::new(&model);
    let numbers = |start: f64, step: f64| (1..=7).map(|k| start + step * f64::from(k)).collect::<Vec<f64>>();
    let (q, v, a) = (numbers(0.0, 0.1), numbers(-0.5, 0.2), numbers(1.0, -0.3));
    let rnea = [
        0.4851005990390943,
        -14.481780701087029,
        0.18249133212432575,
        -1.919314193214646,
        18.532369463908232,
        -0.7628414240658141,
        0.1961312823345745,
    ];
    let crba_diagonal = [
        0.5962795234097216,
        4.125012573846855,
        0.12067918173258518,
        0.17886081089612701,
        2.25,
        0.009443524823461785,
        0.00981914271318067,
    ];
    close(model.inverse_dynamics(&mut data, &q, &v, &a, &[]).unwrap(), &rnea, 1e-13);
    let m = model.mass_matrix(&mut data, &q).unwrap();
    close(m.diagonal().as_slice(), &crba_diagonal, 1e-13);
}

/// As above.
#[test]
fn the_humanoid_has_the_mass_and_center_that_pinocchio_gives_it() {
    let free = UrdfOptions { base: Base::Free, ..UrdfOptions::default() };
    let model = read_as(HUMANOID, &free).unwrap();
    assert_eq!(model.n_velocities(), 35);
    let (mut data, q) = (Data::new(&model), model.neutral());
    assert!((model.mass() - 69.3).abs() < 1e-12);
    let center = model.positions(&mut data, &q).unwrap().center_of_mass();
    close(center.as_slice(), &[0.010939917819149957, 0.00025974025974026316, -0.011566700667231169], 1e-13);
    let weight = model.gravity_forces(&mut data, &q).unwrap();
    close(&weight[..6], &[0.0, 0.0, 679.833, 0.17657999999999952, -7.437317150746173, 0.0], 1e-13);
    assert!((model.mass_matrix(&mut data, &q).unwrap().trace() - 253.66078243417212).abs() < 1e-11);
}

#[test]
fn bodies_follow_depth_first_in_the_order_of_the_document() {
    let model = read(HUMANOID).unwrap();
    let names: Vec<&str> = (0..model.n_bodies()).filter_map(|i| model.name(i)).collect();
    assert_eq!(
        names[..9],
        [
            "pelvis",
            "right_hip_1",
            "right_hip_2",
            "right_thigh",
            "right_shank",
            "right_ankle",
            "right_foot",
            "left_hip_1",
            "left_hip_2"
        ]
    );
    assert_eq!(model.limits(model.body("right_shank").unwrap()), Some([0.0, 2.4]));
    assert_eq!(model.limits(model.body("left_upper_arm").unwrap()), None);
    assert_eq!(model.joint(model.body("head").unwrap()), Some(&Joint::Fixed));
}

/// A document of two links and the given joint between them.
fn joined(joint: &str) -> String {
    format!(
        r#"<robot name="r"><link name="a"/>{joint}
        <link name="b"><inertial><mass value="2"/>
          <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>"#
    )
}

const ENDS: &str = r#"<parent link="a"/><child link="b"/>"#;

#[test]
fn joints_of_all_types_are_read() {
    let of = |kind: &str, inner: &str| {
        let model =
            read(&joined(&format!(r#"<joint name="j" type="{kind}">{ENDS}{inner}</joint>"#))).unwrap();
        let b = model.body("b").unwrap();
        (*model.joint(b).unwrap(), model.limits(b), model)
    };
    let limit = r#"<limit lower="-1" upper="2" effort="1" velocity="1"/>"#;
    let axis = r#"<axis xyz="0 3 4"/>"#;
    let unit = Vector3::new(0.0, 0.6, 0.8);
    assert_eq!(of("fixed", "").0, Joint::Fixed);
    assert_eq!(of("floating", "").0, Joint::Free);
    assert_eq!(of("continuous", "").0, Joint::Revolute { axis: Vector3::x() });
    assert_eq!(of("continuous", axis).0, Joint::Revolute { axis: unit });
    let (joint, limits, _) = of("revolute", &format!("{axis}{limit}"));
    assert_eq!((joint, limits), (Joint::Revolute { axis: unit }, Some([-1.0, 2.0])));
    let (joint, limits, _) = of("prismatic", r#"<limit effort="1" velocity="1"/>"#);
    assert_eq!((joint, limits), (Joint::Prismatic { axis: Vector3::x() }, Some([0.0, 0.0])));
    assert_eq!(of("planar", r#"<axis xyz="0 0 2"/>"#).0, Joint::Planar);
    let damped = of("continuous", r#"<dynamics damping="0.25" friction="3"/>"#).2;
    assert_eq!(damped.bias(&mut Data::new(&damped), &[0.0], &[2.0]).unwrap(), [0.5]);
}

#[test]
fn a_planar_joint_moves_across_its_axis() {
    for axis in ["1 0 0", "0 0 -1", "1 2 -2"] {
        let joint = format!(
            r#"<joint name="j" type="planar"><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>{ENDS}<axis xyz="{axis}"/></joint>"#
        );
        let model = read(&joined(&joint)).unwrap();
        assert_eq!(model.n_velocities(), 3);
        let turn = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
        let normal =
            turn * Vector3::from_iterator(axis.split(' ').map(|x| x.parse::<f64>().unwrap())).normalize();
        let mut data = Data::new(&model);
        let b = model.body("b").unwrap();
        let home = model.positions(&mut data, &[0.0; 3]).unwrap().pose(b).unwrap();
        assert!((home.translation - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-15);
        assert!((home.rotation - turn.to_rotation_matrix().into_inner()).amax() < 1e-15);
        let away = model.positions(&mut data, &[0.4, -0.7, 0.9]).unwrap().pose(b).unwrap();
        assert!((away.translation - home.translation).dot(&normal).abs() < 1e-15);
        let spin = away.rotation * home.rotation.transpose();
        assert!((spin * normal - normal).norm() < 1e-15);
        assert!(((spin.trace() - 1.0) / 2.0 - 0.9_f64.cos()).abs() < 1e-15);
    }
}

#[test]
fn inertial_frames_may_be_turned_and_origins_be_quaternions() {
    let link = |origin: &str| {
        let text = format!(
            r#"<robot><link name="a"><inertial>{origin}<mass value="2"/>
            <inertia ixx="0.3" ixy="0.02" ixz="-0.01" iyy="0.4" iyz="0.03" izz="0.5"/></inertial></link></robot>"#
        );
        read(&text).map(|model| *model.inertia(0).unwrap())
    };
    let (r, p) = (UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0), Vector3::new(0.1, 0.2, -0.3));
    let tensor = Matrix3::new(0.3, 0.02, -0.01, 0.02, 0.4, 0.03, -0.01, 0.03, 0.5);
    let r = r.to_rotation_matrix().into_inner();
    let shift = Matrix3::from_diagonal_element(p.norm_squared()) - p * p.transpose();
    let expected = r * tensor * r.transpose() + shift * 2.0;
    let found = link(r#"<origin xyz="0.1 0.2 -0.3" rpy="0.3 -0.8 2.0"/>"#).unwrap();
    assert!((found.rotational() - expected).amax() < 1e-15);
    assert!((found.first_moment() - p * 2.0).norm() < 1e-15);
    let q = UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0).coords * 7.0;
    let text = format!(r#"<origin xyz="0.1 0.2 -0.3" quat_xyzw="{} {} {} {}"/>"#, q[0], q[1], q[2], q[3]);
    assert!((link(&text).unwrap().rotational() - expected).amax() < 1e-14);
    let twice = link(r#"<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>"#);
    assert_eq!(twice, Err(UrdfError::TwoRotations { element: "link `a`".into(), line: 1 }));
    let none = link(r#"<origin quat_xyzw="0 0 0 0"/>"#);
    assert!(matches!(
        none,
        Err(UrdfError::Document(DocumentError::BadNumber { attribute: "quat_xyzw", .. }))
    ));
}

#[test]
fn the_root_floats_if_it_is_asked_to() {
    for (base, dofs) in [(Base::Fixed, 7), (Base::Planar, 10), (Base::Free, 13)] {
        let options = UrdfOptions { base, gravity: Vector3::new(0.0, -1.62, 0.0), strict: true };
        let model = read_as(ARM, &options).unwrap();
        assert_eq!(model.n_velocities(), dofs);
        assert_eq!(*model.gravity(), options.gravity);
    }
}

fn same_dynamics(model: &Model, again: &Model, random: &mut Random, tolerance: f64) {
    assert_eq!(again.n_positions(), model.n_positions());
    let q = random_configuration(random, model).unwrap();
    let n = model.n_velocities();
    let (v, a) = (random.numbers(n, 1.0), random.numbers(n, 1.0));
    let (mut data, mut data_) = (Data::new(model), Data::new(again));
    let expected = model.inverse_dynamics(&mut data, &q, &v, &a, &[]).unwrap();
    close(again.inverse_dynamics(&mut data_, &q, &v, &a, &[]).unwrap(), expected, tolerance);
}

#[test]
fn what_is_written_is_read_again() {
    let mut random = Random::new(4);
    let mut compared = 0;
    for _ in 0..100 {
        let mut builder = ModelBuilder::new().with_gravity(random.vector(9.0));
        // depth first may be another order than that of the builder, unless the tree is a chain
        let chain = random.below(2) == 0;
        let count = 1 + random.below(20);
        for i in 0..count {
            let joint = loop {
                match random.joint() {
                    Joint::Spherical => {}
                    joint => break joint,
                }
            };
            // names that XML must escape
            let name = format!("<b & \"{i}'\t\n>");
            let link = match i {
                0 => Link::root(name, joint, random.body()),
                _ => {
                    let parent = if chain { i - 1 } else { random.below(i) };
                    Link::child(name, format!("<b & \"{parent}'\t\n>"), joint, random.body())
                }
            };
            // some turned by exactly 90 degrees about y, where roll and yaw are not unique
            let orientation = match random.below(3) {
                0 => UnitQuaternion::from_euler_angles(
                    0.0,
                    std::f64::consts::FRAC_PI_2,
                    random.within(-3.0, 3.0),
                ),
                _ => random.rotation(),
            };
            let link = link.at(random.vector(1.0)).turned(orientation).with_damping(random.within(0.0, 1.0));
            let link = match joint {
                Joint::Revolute { .. } | Joint::Prismatic { .. } if i % 2 == 0 => link.with_limits(-1.5, 2.5),
                _ => link,
            };
            builder.add(link).unwrap();
        }
        let model = builder.build().unwrap();
        let text = urdf::write(&model, "random").unwrap();
        let again = read_as(&text, &UrdfOptions { gravity: *model.gravity(), ..Default::default() }).unwrap();
        let names = |m: &Model| (0..m.n_bodies()).map(|i| m.name(i).unwrap().to_owned()).collect::<Vec<_>>();
        assert_eq!(names(&again)[0], "world");
        if names(&again)[1..] == names(&model)[..] {
            compared += 1;
            same_dynamics(&model, &again, &mut random, 1e-12);
            for i in 0..count {
                let expected = match model.joint(i) {
                    Some(Joint::Prismatic { .. }) => model.limits(i).or(Some([-f64::MAX, f64::MAX])),
                    _ => model.limits(i),
                };
                assert_eq!(again.limits(i + 1), expected);
            }
        }
        assert!((again.mass() - model.mass()).abs() < 1e-12 * model.mass());
        assert_eq!(again.n_velocities(), model.n_velocities());
    }
    assert!(compared > 40, "{compared}");
}

#[test]
fn named_models_can_be_written() {
    let mut random = Random::new(5);
    for (model, base) in [
        (CartPendulum::default().model().unwrap(), Base::Fixed),
        (TwoLinkArm::default().model().unwrap(), Base::Fixed),
        (Diver::planar().model().unwrap(), Base::Fixed),
        (Diver::spatial().model().unwrap(), Base::Free),
        (read(ARM).unwrap(), Base::Fixed),
        (read_as(HUMANOID, &UrdfOptions { base: Base::Planar, ..Default::default() }).unwrap(), Base::Planar),
    ] {
        let text = urdf::write(&model, "model").unwrap();
        let again = read_as(&text, &UrdfOptions { base, gravity: *model.gravity(), strict: true }).unwrap();
        same_dynamics(&model, &again, &mut random, 1e-13);
    }
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("ball", Joint::Spherical, random.body())).unwrap();
    let found = urdf::write(&builder.build().unwrap(), "ball").unwrap_err();
    assert_eq!(found.to_string(), "link `ball` cannot be written: URDF has no spherical joint");
    let found = urdf::write(&TwoLinkArm::default().model().unwrap(), "\0").unwrap_err();
    assert!(matches!(found, UrdfError::NotRepresentable { .. }));
}

/// The message of the error for a document with the given joint.
fn refusal(joint: &str) -> String {
    read(&joined(joint)).unwrap_err().to_string()
}

#[test]
fn bad_joints_are_refused_with_their_names() {
    let with =
        |kind: &str, inner: &str| refusal(&format!(r#"<joint name="j" type="{kind}">{inner}</joint>"#));
    let ends = |kind: &str, inner: &str| with(kind, &format!("{ENDS}{inner}"));
    let start = "joint `j` (line 1)";
    assert_eq!(
        refusal(&format!(r#"<joint type="fixed">{ENDS}</joint>"#)),
        "joint `` (line 1) has no attribute `name`"
    );
    assert_eq!(
        refusal(&format!(r#"<joint name="j">{ENDS}</joint>"#)),
        format!("{start} has no attribute `type`")
    );
    assert_eq!(ends("hinge", ""), format!("{start} has the unknown type `hinge`"));
    assert_eq!(with("fixed", r#"<child link="b"/>"#), format!("{start} has no <parent>"));
    assert_eq!(with("fixed", r#"<parent link="a"/><child/>"#), format!("{start} has no attribute `link`"));
    assert_eq!(
        with("fixed", r#"<parent link="a"/><child link="c"/>"#),
        format!("{start} names the link `c`, which does not exist")
    );
    assert_eq!(
        ends("continuous", r#"<mimic joint="k"/>"#),
        format!("{start} mimics the joint `k`, which does not exist")
    );
    assert_eq!(ends("revolute", ""), format!("{start} has no <limit>"));
    let numbers = |attribute, expected, found| {
        format!("`{attribute}` of {start} must be {expected} finite number(s), found `{found}`")
    };
    assert_eq!(ends("continuous", r#"<axis xyz="0 1"/>"#), numbers("xyz", 3, "0 1"));
    assert_eq!(ends("continuous", r#"<axis xyz="0 1 0 0"/>"#), numbers("xyz", 3, "0 1 0 0"));
    assert_eq!(ends("continuous", r#"<axis xyz="0 1 one"/>"#), numbers("xyz", 3, "0 1 one"));
    assert_eq!(ends("continuous", r#"<axis xyz="0 nan 0"/>"#), numbers("xyz", 3, "0 nan 0"));
    assert_eq!(ends("continuous", r#"<axis xyz="0 1e999 0"/>"#), numbers("xyz", 3, "0 1e999 0"));
    assert_eq!(ends("continuous", r#"<dynamics damping=""/>"#), numbers("damping", 1, ""));
    assert_eq!(ends("fixed", r#"<origin/><origin/>"#), format!("{start} has more than one <origin>"));
    for kind in ["continuous", "planar"] {
        let found = ends(kind, r#"<axis xyz="0 -0 0"/>"#);
        assert_eq!(found, format!("{start}: the joint axis of `b` is zero"));
    }
    assert_eq!(
        ends("prismatic", r#"<limit lower="1" upper="-1"/>"#),
        format!("{start}: the limits of `b` cross: lower 1, upper -1")
    );
    assert_eq!(ends("revolute", r#"<limit lower="nan"/>"#), numbers("lower", 1, "nan"));
    assert_eq!(
        ends("continuous", r#"<dynamics damping="-1"/>"#),
        format!("{start}: `damping` of `b` must not be negative, found -1")
    );
}

#[test]
fn bad_links_are_refused_with_their_names() {
    let with = |inertial: &str| {
        let text =
            format!("<robot name=\"r\">\n<link name=\"a\"><inertial>{inertial}</inertial></link></robot>");
        read(&text).unwrap_err()
    };
    let moments = |x: f64, y: f64, z: f64| {
        format!(r#"<inertia ixx="{x}" ixy="0" ixz="0" iyy="{y}" iyz="0" izz="{z}"/>"#)
    };
    let element = || "link `a`".to_owned();
    let child = |child| UrdfError::from(DocumentError::MissingElement { element: element(), line: 2, child });
    assert_eq!(with(&moments(1.0, 1.0, 1.0)), child("mass"));
    assert_eq!(with(r#"<mass value="1"/>"#), child("inertia"));
    let attribute = DocumentError::MissingAttribute { element: element(), line: 2, attribute: "ixy" }.into();
    assert_eq!(with(r#"<mass value="1"/><inertia ixx="1"/>"#), attribute);
    for (mass, [x, y, z]) in [("1", [1.0, 1.0, 2.1]), ("1", [1.0, 1.0, -0.1]), ("0", [1.0, 1.0, 1.0])] {
        let found = with(&format!(r#"<mass value="{mass}"/>{}"#, moments(x, y, z)));
        let UrdfError::Document(DocumentError::Rejected {
            element: e,
            line: 2,
            source: ModelError::NonPhysicalInertia { .. },
        }) = &found
        else {
            panic!("{found}")
        };
        assert_eq!(*e, element());
    }
    let found = with(&format!(r#"<mass value="-2"/>{}"#, moments(1.0, 1.0, 1.0)));
    assert_eq!(found.to_string(), "link `a` (line 2): `mass` of `a` must not be negative, found -2");
    let found = with(&format!(r#"<mass value="NaN"/>{}"#, moments(1.0, 1.0, 1.0)));
    assert!(matches!(found, UrdfError::Document(DocumentError::BadNumber { attribute: "value", .. })));
    // not of the joint that carries it
    let joint = format!(r#"<joint name="j" type="floating">{ENDS}</joint>"#);
    let found = read(&joined(&joint).replace(r#"izz="1""#, r#"izz="3""#)).unwrap_err().to_string();
    assert!(
        found.starts_with("link `b` (line 2): `b` of mass 2 cannot have the principal moments"),
        "{found}"
    );
}

#[test]
fn documents_that_are_no_tree_are_refused() {
    let document = |links: &[&str], joints: &[(&str, &str, &str)]| {
        let mut text = "<robot name='r'>\n".to_owned();
        links.iter().for_each(|l| text += &format!("<link name='{l}'/>\n"));
        for (name, parent, child) in joints {
            text += &format!(
                "<joint name='{name}' type='fixed'><parent link='{parent}'/><child link='{child}'/></joint>\n"
            );
        }
        read(&(text + "</robot>"))
    };
    let cycle = |link: &str| UrdfError::Cycle { link: link.into() };
    assert_eq!(document(&[], &[]).unwrap_err(), UrdfError::NoLink);
    assert_eq!(document(&["a"], &[("j", "a", "a")]).unwrap_err(), cycle("a"));
    let around = [("j", "a", "b"), ("k", "b", "c"), ("l", "c", "a")];
    assert_eq!(document(&["a", "b", "c"], &around).unwrap_err(), cycle("a"));
    assert_eq!(document(&["r", "a", "b"], &[("j", "a", "b"), ("k", "b", "a")]).unwrap_err(), cycle("a"));
    assert_eq!(
        document(&["a", "b"], &[]).unwrap_err(),
        UrdfError::SeveralRoots { first: "a".into(), second: "b".into() }
    );
    assert_eq!(
        document(&["a", "b"], &[("j", "a", "b"), ("k", "a", "b")]).unwrap_err().to_string(),
        "joint `k` (line 5) has the child `b`, which is that of joint `j` already"
    );
    assert_eq!(
        document(&["a", "a"], &[]).unwrap_err(),
        DocumentError::DuplicateName { element: "link `a`".into(), line: 3 }.into()
    );
    assert_eq!(
        document(&["a", "b", "c"], &[("j", "a", "b"), ("j", "b", "c")]).unwrap_err(),
        DocumentError::DuplicateName { element: "joint `j`".into(), line: 6 }.into()
    );
    let other = DocumentError::OtherFormat { expected: "robot", found: "sdf".into() };
    assert_eq!(read("<sdf/>").unwrap_err(), other.into());
    let slack = joined(&format!(r#"<joint name="j" type="floating">{ENDS}</joint>"#));
    let light = slack.replace(r#"mass value="2""#, r#"mass value="0""#).replace("=\"1\"", "=\"0\"");
    let found = read(&light).unwrap_err().to_string();
    assert_eq!(found, "robot `r` (line 1): the joint of `b` carries no mass");
}

#[test]
fn truncated_documents_are_refused_wherever_they_end() {
    let end = ARM.trim_end().len();
    for length in (0..end).filter(|&n| ARM.is_char_boundary(n)) {
        assert!(
            matches!(read(&ARM[..length]), Err(UrdfError::Document(DocumentError::Xml { .. }))),
            "{length}"
        );
    }
    assert!(read(&ARM[..end]).is_ok());
}

#[test]
fn entities_are_refused_before_they_are_expanded() {
    let mut bomb = "<!DOCTYPE robot [<!ENTITY e0 \"0\">".to_owned();
    for k in 1..30 {
        bomb += &format!("<!ENTITY e{k} \"&e{};&e{};\">", k - 1, k - 1);
    }
    bomb += "]><robot name=\"&e29;\"><link name=\"a\"/></robot>";
    let outside = r#"<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="&x;"/>"#;
    for text in [bomb.as_str(), outside, "<robot name='&undefined;'/>"] {
        assert!(matches!(read(text), Err(UrdfError::Document(DocumentError::Xml { .. }))), "{text}");
    }
}

#[test]
fn hostile_documents_cost_neither_stack_nor_time() {
    let nested = |deep: usize| {
        read(&format!("<robot><link name='a'/>{}{}</robot>", "<a>".repeat(deep), "</a>".repeat(deep)))
    };
    // legal, and beside the point
    assert_eq!(nested(150_000).unwrap().n_bodies(), 1);
    assert!(matches!(nested(2_000_000), Err(UrdfError::Document(DocumentError::Xml { .. }))));
    assert!(matches!(read(&"<robot>".repeat(150_000)), Err(UrdfError::Document(DocumentError::Xml { .. }))));
    // a tag of many attributes
    let many: String = (0..200_000).map(|k| format!("a{k} = ''\n")).collect();
    let found = read(&format!("<robot {many}/>")).unwrap_err();
    assert_eq!(found, DocumentError::TooManyAttributes { line: 257, allowed: 256 }.into());
    // a chain of many links: deep for us, not for XML
    let mut chain = "<robot><link name='0'/>".to_owned();
    for k in 1..20_000 {
        chain += &format!(
            "<link name='{k}'/><joint name='{k}' type='fixed'><parent link='{}'/><child link='{k}'/></joint>",
            k - 1
        );
    }
    assert_eq!(read(&(chain + "</robot>")).unwrap().n_bodies(), 20_000);
    // a name that is a book
    let name = "x".repeat(1_000_000);
    let found = read(&format!("<robot><link name='{name}'><inertial/></link></robot>")).unwrap_err();
    assert!(found.to_string().len() < 200);
}

/// What may be put anywhere in any document.
const OF_ANY: [&str; 12] =
    ["nan", "-inf", "1e308", "-1", "0", "\"", "<", "/>", "&#0;", "<!--", "<![CDATA[", "\u{1F938}"];

/// What may be put anywhere in a document of this format.
const OF_URDF: [&str; 12] = [
    "'",
    "</link>",
    "<link name=\"a\"/>",
    "&amp;",
    "-->",
    "planar",
    "floating",
    "mimic",
    "<inertial/>",
    "quat_xyzw=\"0 0 0 0\"",
    "xmlns:a=\"b\"",
    "type=\"fixed\"",
];

/// A text with one or two changes, of which some put in a word of any document or of this format.
pub(crate) fn mutated(random: &mut Random, text: &str, of_format: &[&str]) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..=random.below(2) {
        let at = random.below(bytes.len());
        let to = (at + 1 + random.below(40)).min(bytes.len());
        match random.below(8) {
            0 => bytes[at] = random.below(128) as u8,
            1 => drop(bytes.drain(at..to)),
            2 => {
                let piece = bytes[at..to].to_vec();
                let there = random.below(bytes.len());
                bytes.splice(there..there, piece);
            }
            3 => bytes.truncate(at),
            4 => bytes[at] ^= 1 << random.below(8),
            5 | 6 => {
                if let Some(digit) = bytes[at..].iter_mut().find(|b| b.is_ascii_digit()) {
                    *digit = b'0' + random.below(10) as u8;
                }
            }
            _ => {
                let words = if random.below(2) == 0 { &OF_ANY } else { of_format };
                let word = words[random.below(words.len())];
                bytes.splice(at..at, word.bytes());
            }
        }
        if bytes.is_empty() {
            break;
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn a_hundred_thousand_mutated_documents_are_read_or_refused() {
    let seeds = [
        joined(&format!(
            r#"<joint name="j" type="revolute"><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>{ENDS}<axis xyz="0 1 0"/>
            <limit lower="-1" upper="1"/><dynamics damping="0.1"/></joint>"#
        )),
        joined(&format!(r#"<joint name="j" type="planar">{ENDS}<axis xyz="0 1 0"/></joint>"#)),
        ARM.to_owned(),
    ];
    let (mut accepted, mut refused) = (0, 0);
    for seed in 0..100_000_u64 {
        let mut random = Random::new(seed);
        let text = mutated(&mut random, &seeds[(seed % 3) as usize], &OF_URDF);
        let base = [Base::Fixed, Base::Planar, Base::Free][random.below(3)];
        let strict = random.below(2) == 0;
        let outcome = std::panic::catch_unwind(|| {
            let model = read_as(&text, &UrdfOptions { base, strict, ..UrdfOptions::default() })?;
            assert!(model.mass().is_finite());
            let mut data = Data::new(&model);
            let rest = vec![0.0; model.n_velocities()];
            let _ = model.forward_dynamics(&mut data, &model.neutral(), &rest, &rest, &[]);
            Ok::<(), UrdfError>(())
        });
        match outcome {
            Ok(Ok(())) => accepted += 1,
            Ok(Err(error)) => {
                assert!(!error.to_string().is_empty());
                refused += 1;
            }
            Err(_) => panic!("seed {seed} panics:\n{text}"),
        }
    }
    // both happen often, so that neither side goes untested
    assert!(accepted > 10_000 && refused > 10_000, "{accepted} {refused}");
}

/// A hand as files have them: a base of no possible inertia, a finger that drives two others, a tool without mass on a
/// joint, and a fixed joint that mimics.
const HAND: &str = r#"<robot name="hand">
  <link name="palm">
    <inertial><mass value="1e-6"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="3e-6"/></inertial>
    <visual name="skin"><origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry></visual>
    <visual><geometry><mesh filename="package://hand/palm.dae" scale="1 1 2"/></geometry></visual>
    <collision><geometry><cylinder radius="0.1" length="0.4"/></geometry></collision>
  </link>
  <joint name="middle" type="revolute"><parent link="palm"/><child link="b"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1"/><mimic joint="index" multiplier="-2" offset="0.1"/></joint>
  <joint name="index" type="revolute"><parent link="palm"/><child link="a"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1"/></joint>
  <joint name="tip" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1"/><mimic joint="middle"/></joint>
  <joint name="lever" type="prismatic"><origin xyz="1 0 0"/><parent link="a"/><child link="tool"/><axis xyz="0 2 0"/>
    <limit lower="0.25" upper="1"/></joint>
  <joint name="knob" type="revolute"><parent link="tool"/><child link="nothing"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1"/><mimic joint="lever" multiplier="2" offset="-0.1"/></joint>
  <joint name="mount" type="fixed"><parent link="a"/><child link="d"/><mimic joint="index"/></joint>
  <link name="a"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="2.5"/></inertial></link>
  <link name="b"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="c"><inertial><mass value="3"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><origin rpy="0 0 1"/><geometry><sphere radius="0.5"/></geometry></collision></link>
  <link name="d"><inertial><mass value="0"/>
    <inertia ixx="1e-9" ixy="0" ixz="0" iyy="1e-9" iyz="0" izz="1e-9"/></inertial></link>
  <link name="tool"/><link name="nothing"/>
</robot>"#;

#[test]
fn robots_as_they_exist_are_repaired_and_the_repairs_are_listed() {
    let robot = urdf::read(HAND, &UrdfOptions::default()).unwrap();
    let listed: Vec<String> = robot.repairs.iter().map(ToString::to_string).collect();
    assert_eq!(listed.len(), 6, "{listed:#?}");
    assert_eq!(listed[0], "joint `mount` (line 18) is fixed and does not follow another joint");
    assert!(
        listed[1].starts_with("link `palm` (line 2) cannot have the principal moments ["),
        "{}",
        listed[1]
    );
    assert!(listed[2].starts_with("link `a` (line 19) cannot have"), "{}", listed[2]);
    assert!(listed[3].starts_with("link `d` (line 26) cannot have"), "{}", listed[3]);
    assert_eq!(listed[4], "joint `lever` (line 14) moves no mass and is fixed at 0.25");
    assert_eq!(listed[5], "joint `knob` (line 16) moves no mass and is fixed at 0.4");
    let model = &robot.model;
    // one coordinate leads three joints
    assert_eq!((model.n_positions(), model.n_velocities()), (1, 1));
    let mut data = Data::new(model);
    let bodies = model.positions(&mut data, &[0.3]).unwrap();
    let pose = |name: &str| bodies.pose(model.body(name).unwrap()).unwrap();
    let middle = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.1 - 0.6).to_rotation_matrix();
    assert!((pose("b").rotation - middle.into_inner()).amax() < 1e-15);
    assert!((pose("c").translation - middle * Vector3::new(0.0, 0.0, -0.5)).norm() < 1e-15);
    let index = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.3).to_rotation_matrix();
    assert!((pose("tool").translation - index * Vector3::new(1.0, 0.25, 0.0)).norm() < 1e-15);
    let knob = index.into_inner()
        * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.4).to_rotation_matrix().into_inner();
    assert!((pose("nothing").rotation - knob).amax() < 1e-15);
    // strict: refused by the first of these
    let strict = UrdfOptions { strict: true, ..UrdfOptions::default() };
    let found = urdf::read(HAND, &strict).unwrap_err();
    assert!(
        matches!(
            &found,
            UrdfError::Document(DocumentError::Rejected {
                source: ModelError::NonPhysicalInertia { .. },
                ..
            })
        ),
        "{found}"
    );
    // what is written of it needs no repair
    let written = urdf::write(model, "hand").unwrap();
    let again = urdf::read(&written, &strict).unwrap();
    same_dynamics(model, &again.model, &mut Random::new(3), 1e-12);
}

#[test]
fn what_is_seen_and_touched_is_kept() {
    let robot = urdf::read(HAND, &UrdfOptions::default()).unwrap();
    assert_eq!(robot.name, "hand");
    let of = |k: usize| &robot.geometry[k];
    assert_eq!(robot.geometry.len(), 4);
    assert_eq!(
        (of(0).body, of(0).purpose, of(0).name.as_deref()),
        (Some(0), GeometryPurpose::Visual, Some("skin"))
    );
    assert_eq!(
        (of(0).position, &of(0).shape),
        (Vector3::z(), &GeometryShape::Box { size: Vector3::new(1.0, 2.0, 3.0) })
    );
    let mesh =
        GeometryShape::Mesh { file: "package://hand/palm.dae".into(), scale: Vector3::new(1.0, 1.0, 2.0) };
    assert_eq!(of(1).shape, mesh);
    assert_eq!(
        (of(2).purpose, &of(2).shape),
        (GeometryPurpose::Collision, &GeometryShape::Cylinder { radius: 0.1, length: 0.4 })
    );
    assert_eq!(
        (of(3).body, &of(3).shape),
        (robot.model.body("c").ok(), &GeometryShape::Sphere { radius: 0.5 })
    );
    assert!((of(3).orientation.angle() - 1.0).abs() < 1e-15);
    let bad = HAND.replace("radius=\"0.5\"", "radius=\"wide\"");
    let found = urdf::read(&bad, &UrdfOptions::default()).unwrap_err().to_string();
    assert_eq!(found, "`radius` of link `c` (line 25) must be 1 finite number(s), found `wide`");
}

#[test]
fn the_nearest_possible_inertia_is_nearest_in_second_moments() {
    let mut random = Random::new(8);
    for _ in 0..200 {
        let r = random.rotation().to_rotation_matrix().into_inner();
        let wanted = Vector3::from_fn(|_, _| random.within(-0.5, 2.0));
        let inertia = r * Matrix3::from_diagonal(&wanted) * r.transpose();
        let inertia = (inertia + inertia.transpose()) * 0.5;
        let found = MassProperties { mass: 1.5, center: random.vector(1.0), inertia };
        let nearest = found.nearest_possible();
        assert_eq!((nearest.mass, nearest.center), (found.mass, found.center));
        ModelBuilder::new().add(Link::root("b", Joint::Free, nearest)).unwrap();
        assert_eq!(nearest.nearest_possible(), nearest);
        let second = |i: &Matrix3<f64>| Matrix3::from_diagonal_element(i.trace() / 2.0) - i;
        let distance = |i: &Matrix3<f64>| (second(i) - second(&inertia)).norm();
        // no possible inertia is nearer
        for _ in 0..50 {
            let step = Matrix3::from_fn(|_, _| random.within(-0.05, 0.05));
            let root = nalgebra::SymmetricEigen::new(second(&nearest.inertia));
            let factor =
                root.eigenvectors * Matrix3::from_diagonal(&root.eigenvalues.map(|x| x.max(0.0).sqrt()));
            let moved = (factor + step) * (factor + step).transpose();
            let other = Matrix3::from_diagonal_element(moved.trace()) - moved;
            assert!(distance(&other) >= distance(&nearest.inertia) - 1e-12);
        }
    }
    // the excess of one moment goes to the two others, half and half
    let flat = MassProperties {
        inertia: Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 4.0)),
        ..MassProperties::point(1.0, Vector3::zeros())
    };
    let expected = Matrix3::from_diagonal(&Vector3::new(1.5, 2.5, 4.0));
    assert!((flat.nearest_possible().inertia - expected).amax() < 1e-15);
}

/// A thousand documents of a robot with everything in it, damaged by a generator of fixed seed.
#[test]
fn a_thousand_damaged_robots_end_no_process() {
    let (mut accepted, mut refused) = (0, 0);
    for seed in 0..1000 {
        let mut random = Random::new(1_000_000 + seed);
        let text = mutated(&mut random, HAND, &OF_URDF);
        for strict in [false, true] {
            match read_as(&text, &UrdfOptions { strict, base: Base::Free, ..UrdfOptions::default() }) {
                Err(error) => {
                    assert!(!error.to_string().is_empty());
                    refused += 1;
                }
                Ok(model) => {
                    let rest = vec![0.0; model.n_velocities()];
                    let mut data = Data::new(&model);
                    let _ = model.forward_dynamics(&mut data, &model.neutral(), &rest, &rest, &[]);
                    accepted += 1;
                }
            }
        }
    }
    assert!(accepted > 100 && refused > 100, "{accepted} {refused}");
}
