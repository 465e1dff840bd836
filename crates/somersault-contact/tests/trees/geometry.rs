//! Contacts from shapes, and from the collision elements of a robot's file.

use nalgebra::{UnitQuaternion, Vector3};
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::shape::Shape;
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface, Surface};
use somersault_contact::tree::{LinkContact, geometry_contacts, shape_contacts};
use somersault_contact::{ContactError, UntouchableShape};
use somersault_multibody::geometry::GeometryShape;
use somersault_multibody::urdf::{self, UrdfOptions};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

fn ground() -> Arc<dyn Surface> {
    Arc::new(HalfSpace::ground())
}

fn law() -> ContactLaw {
    CompliantLaw::try_new(1e4, 10.0).unwrap().into()
}

fn made(shape: &GeometryShape, surface: &Arc<dyn Surface>) -> Result<Vec<LinkContact>, ContactError> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    shape_contacts("part", "link", shape, (Vector3::new(1.0, 2.0, 3.0), turn), surface, &law())
}

/// A turn by 90° about x takes y to z and z to −y.
#[test]
fn shapes_touch_where_they_end() {
    let names = |contacts: &[LinkContact]| contacts.iter().map(|c| c.name().to_owned()).collect::<Vec<_>>();
    let close = |a: &Vector3<f64>, b: [f64; 3]| (a - Vector3::from(b)).amax() < 1e-15;
    let corners = made(&GeometryShape::Box { size: Vector3::new(0.2, 0.4, 0.8) }, &ground()).unwrap();
    assert_eq!(names(&corners)[..3], ["part corner 1", "part corner 2", "part corner 3"]);
    let point = |k: usize| corners[k].contact().shape().centre();
    assert!(close(point(0), [0.9, 2.4, 2.8]) && close(point(1), [1.1, 2.4, 2.8]), "{:?}", point(0));
    assert!(close(point(2), [0.9, 2.4, 3.2]) && close(point(7), [1.1, 1.6, 3.2]), "{:?}", point(7));
    let balls = made(&GeometryShape::Capsule { radius: 0.1, length: 0.6 }, &ground()).unwrap();
    assert_eq!(names(&balls), ["part end 1", "part end 2"]);
    let ends = balls.iter().map(|ball| match ball.contact().shape() {
        Shape::Ball { centre, radius } => (centre.y, *radius),
        other => panic!("{other:?}"),
    });
    assert!(ends.zip([(2.3, 0.1), (1.7, 0.1)]).all(|(a, b)| (a.0 - b.0).abs() < 1e-15 && a.1 == b.1));
    let rims = made(&GeometryShape::Cylinder { radius: 0.1, length: 0.6 }, &ground()).unwrap();
    assert_eq!(names(&rims), ["part rim 1", "part rim 2"]);
    for (rim, y) in rims.iter().zip([2.3, 1.7]) {
        match rim.contact().shape() {
            Shape::Rim { centre, axis, radius } => {
                assert!(close(centre, [1.0, y, 3.0]) && close(axis, [0.0, -1.0, 0.0]) && *radius == 0.1);
            }
            other => panic!("{other:?}"),
        }
    }
    let ball = made(&GeometryShape::Sphere { radius: 0.1 }, &ground()).unwrap();
    assert_eq!((names(&ball), ball[0].link()), (vec!["part".to_owned()], "link"));
}

#[test]
fn shapes_without_contacts_say_why() {
    let ball: Arc<dyn Surface> =
        Arc::new(SphericalSurface::try_new(Vector3::zeros(), 1.0, Solid::Inside).unwrap());
    let refused = |shape, surface| made(&shape, surface).unwrap_err();
    let cylinder = GeometryShape::Cylinder { radius: 0.1, length: 0.6 };
    assert_eq!(refused(cylinder, &ball), ContactError::Shape(UntouchableShape::Curved));
    let ellipsoid = GeometryShape::Ellipsoid { radii: Vector3::repeat(0.1) };
    assert_eq!(refused(ellipsoid, &ball), ContactError::Shape(UntouchableShape::Ellipsoid));
    let flat = GeometryShape::Box { size: Vector3::new(0.1, 0.0, 0.1) };
    assert_eq!(refused(flat, &ball).to_string(), "`size` must be positive and finite, found 0");
    let short = GeometryShape::Capsule { radius: 0.1, length: -1.0 };
    assert_eq!(refused(short, &ball).to_string(), "`length` must be positive and finite, found -1");
}

const ROBOT: &str = r#"<robot name="robot">
  <link name="trunk">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><sphere radius="1"/></geometry></visual>
    <collision><geometry><box size="1 1 1"/></geometry></collision>
    <collision name="shell"><geometry><mesh filename="shell.stl"/></geometry></collision>
    <collision><geometry><cylinder radius="0.1" length="1"/></geometry></collision>
  </link>
  <joint name="hip" type="continuous"><parent link="trunk"/><child link="foot"/></joint>
  <link name="foot">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><origin xyz="0 0 -1"/><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <joint name="tail" type="continuous"><parent link="trunk"/><child link="tail"/></joint>
  <link name="tail">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
</robot>"#;

#[test]
fn a_robot_touches_with_its_collision_elements() {
    let robot = urdf::read(ROBOT, &UrdfOptions::default()).unwrap();
    let of = |links: Option<&[String]>| {
        geometry_contacts(&robot.model, &robot.geometry, links, &ground(), &law()).unwrap()
    };
    let all = of(None);
    assert_eq!(all.contacts.len(), 8 + 2 + 1);
    let names = [0, 8, 10].map(|i: usize| all.contacts[i].name());
    assert_eq!(names, ["trunk shape 1 corner 1", "trunk shape 3 rim 1", "foot"]);
    let left_out: Vec<String> = all.left_out.iter().map(ToString::to_string).collect();
    let mesh = "`shell` of link `trunk`: a mesh has no contacts, since its file `shell.stl` is not opened; \
                a box, capsule, cylinder or sphere has";
    assert_eq!(left_out, [mesh]);
    let some = of(Some(&["foot".to_owned(), "tail".to_owned()]));
    assert_eq!(some.contacts.len(), 1);
    assert_eq!(some.left_out[0].to_string(), "link `tail`: it has no shape to collide with");
    let unknown = ["hand".to_owned()];
    let unknown = geometry_contacts(&robot.model, &robot.geometry, Some(&unknown), &ground(), &law());
    assert_eq!(
        unknown.unwrap_err().to_string(),
        "`links` must be the name of a body of the model, found `hand`"
    );
}
