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
        geometry_contacts(&robot.model, &robot.geometry, links, None, &ground(), &law()).unwrap()
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
    let unknown = geometry_contacts(&robot.model, &robot.geometry, Some(&unknown), None, &ground(), &law());
    assert_eq!(
        unknown.unwrap_err().to_string(),
        "`links` must be the name of a body of the model, found `hand`"
    );
}

/// The binary STL of a box of 1 × 2 × 3 with its centre at the origin, each face in two triangles and a point in its middle four times.
fn stl() -> Vec<u8> {
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2].map(|bit| bit as f32 - 0.5);
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let scaled = |[x, y, z]: [f32; 3]| [x, 2.0 * y, 3.0 * z];
    let mut triangles: Vec<[[f32; 3]; 3]> = Vec::new();
    for face in faces.map(|face| face.map(|k| scaled(corner(k)))) {
        let middle = [0, 1, 2].map(|axis| face.iter().map(|place| place[axis]).sum::<f32>() / 4.0);
        triangles.extend((0..4).map(|k| [face[k], face[(k + 1) % 4], middle]));
    }
    let mut content = vec![b's'; 80];
    content.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
    for triangle in triangles {
        content.extend([0; 12]);
        content.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
        content.extend([0; 2]);
    }
    content
}

#[test]
fn a_mesh_touches_with_the_vertices_of_its_hull() {
    let folder = std::env::temp_dir().join(format!("somersault-meshes-{}", std::process::id()));
    let meshes = folder.join("meshes");
    std::fs::create_dir_all(&meshes).unwrap();
    let write = |name: &str, content: &[u8]| std::fs::write(meshes.join(name), content).unwrap();
    write("box.STL", &stl());
    // A pyramid with a dent, whose lowest place is within its hull.
    write(
        "dent.obj",
        b"# v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0.2\nv 0.5 0.5 1\nvn 0 0 1\nf 1 2 5\n",
    );
    write(
        "text.stl",
        b"solid t\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1e0\n",
    );
    write("flat.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n");
    write("word.obj", b"v 0 0\n");
    write("nan.obj", b"v 0 nan 0\n");
    write("short.stl", &stl()[..300]);
    write("box.dae", b"");
    let of = |file: &str| {
        let text = ROBOT.replace(r#"filename="shell.stl""#, &format!(r#"filename="{file}" scale="1 1 2""#));
        let robot = urdf::read(&text, &UrdfOptions::default()).unwrap();
        let links = Some(&["trunk".to_owned()][..]);
        geometry_contacts(&robot.model, &robot.geometry, links, Some(&folder), &ground(), &law()).unwrap()
    };
    let vertices = |file: &str| {
        let found = of(file);
        assert!(found.left_out.is_empty(), "{:?}", found.left_out);
        let vertices = found.contacts.iter().filter(|c| c.name().starts_with("trunk shape 2 vertex "));
        let mut places: Vec<[f64; 3]> =
            vertices.map(|vertex| (*vertex.contact().shape().centre()).into()).collect();
        places.sort_by(|a, b| a.partial_cmp(b).unwrap());
        places
    };
    let boxed = vertices("package://robot/meshes/box.STL");
    assert_eq!((boxed.len(), boxed[0], boxed[7]), (8, [-0.5, -1.0, -3.0], [0.5, 1.0, 3.0]));
    assert_eq!(vertices("meshes/dent.obj").len(), 5);
    assert_eq!(vertices("meshes/text.stl"), [[0.0; 3], [0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
    for (file, reason) in [
        ("flat.obj", "its vertices have no convex hull with a volume"),
        ("word.obj", "line 1 must have three numbers, found \"\""),
        ("nan.obj", "its vertices must be finite, found [0.0, NaN, 0.0]"),
        ("short.stl", "it is no text and its 300 bytes are not those of its triangles"),
        ("box.dae", "it must end in .stl or .obj"),
        ("none.obj", "is not in"),
    ] {
        let left_out = &of(&format!("meshes/{file}")).left_out;
        assert!(left_out.len() == 1 && left_out[0].to_string().contains(reason), "{left_out:?}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
