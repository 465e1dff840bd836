//! Contacts of links from shapes, and from what a robot's file collides with.

use crate::contact::contacts::Contact;
use crate::contact::laws::laws;
use crate::contact::shapes::shape_of;
use crate::contact::tree::LinkContact;
use crate::core::convert::{orientation, vector_or};
use crate::core::error::Error;
use crate::multibody::robot::Robot;
use pyo3::prelude::*;
use somersault::contact::tree::{self, GeometryContacts};
use somersault::integrators::nalgebra::{UnitQuaternion, Vector3};
use std::path::PathBuf;

/// The contacts of a box, a capsule, a cylinder or a sphere that is fixed in a link.
///
/// A box touches with its 8 corners, ``name corner 1`` to ``name corner 8``, of which x changes first and z last; a capsule with the
/// balls at its ends, ``name end 1`` (at −z) and ``name end 2``; a cylinder with its rims, ``name rim 1`` and ``name rim 2``, against a
/// `HalfSpace`; a sphere with a ball, ``name``. Against a `SphericalSurface` from outside a box or a capsule touches with its
/// nearest point, ``name``, and so does a capsule against a `CylindricalSurface`; a box touches that with its edges, ``name edge 1`` to
/// ``name edge 12``, those along x first. Each has its own laws: a box on a face has four springs. Against planes, spheres and cylinders
/// nothing else can touch; against a user-defined surface edges, faces and middles do not touch. The point of contact of a cylinder that
/// stands flat, and of a capsule along a cylinder, is not unique: use a box for a flat foot.
///
/// Parameters
/// ----------
/// link : str
///     The body of the model.
/// shape : {'box', 'capsule', 'cylinder', 'sphere'}
///     The shape; axes of symmetry are along z.
/// size : array_like, shape (3,), (2,) or (1,)
///     Edges of a box; radius and length of a cylinder or a capsule, whose length is without its ends; radius of a sphere, m.
/// surface : Surface or callable
///     What it touches, as of a `Contact`.
/// law : CompliantLaw or HuntCrossley
///     Law of the normal force.
/// friction : CoulombFriction or RegularisedFriction, optional
///     Law of friction; none unless given.
/// resistance : Resistance, optional
///     Resistance to rolling and spinning; none unless given.
/// position : array_like, shape (3,), optional
///     Its centre in the frame of the link, m; the origin unless given.
/// orientation : Rotation or array_like, shape (4,), optional
///     Rotation from its axes to those of the link, as a quaternion (x, y, z, w); none unless given.
/// name : str, optional
///     Name of the contacts; that of the link unless given.
/// on : str, optional
///     The body of the model that carries the surface, as of a `LinkContact`.
///
/// Returns
/// -------
/// list of LinkContact
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> law = contact.CompliantLaw(1e4, 20.0)
/// >>> sole = contact.shape_contacts("foot", "box", (0.2, 0.1, 0.04), contact.HalfSpace(), law, position=(0.05, 0, -0.02))
/// >>> len(sole), sole[2].name, sole[2].contact.point.round(3)
/// (8, 'foot corner 3', array([-0.05,  0.05, -0.04]))
#[pyfunction]
#[pyo3(signature = (link, shape, size, surface, law, *, friction=None, resistance=None, position=None, orientation=None, name=None, on=None))]
pub(crate) fn shape_contacts(
    py: Python<'_>,
    link: &str,
    shape: &str,
    size: &Bound<'_, PyAny>,
    surface: &Bound<'_, PyAny>,
    law: &Bound<'_, PyAny>,
    friction: Option<&Bound<'_, PyAny>>,
    resistance: Option<&Bound<'_, PyAny>>,
    position: Option<&Bound<'_, PyAny>>,
    orientation: Option<&Bound<'_, PyAny>>,
    name: Option<&str>,
    on: Option<&str>,
) -> Result<Vec<LinkContact>, Error> {
    let shape = shape_of(shape, size)?;
    let laws = laws(law, friction, resistance)?;
    let turn =
        orientation.map_or(Ok(UnitQuaternion::identity()), |turn| self::orientation("orientation", turn))?;
    let place = (vector_or("position", position, Vector3::zeros())?, turn);
    let against = Contact::surface_given(surface)?;
    let found = tree::shape_contacts(name.unwrap_or(link), link, &shape, place, &against, &laws)?;
    found.iter().map(|own| LinkContact::of(py, own, surface, on)).collect()
}

/// The contacts of what a robot collides with: the collision elements of its file.
///
/// Boxes, capsules, cylinders and spheres touch as in `shape_contacts`. The contacts of a link with one shape are called by its name,
/// as in ``foot corner 3``; those of one with more ``link shape 1``, ``link shape 2`` and so on. Of a mesh the vertices of its convex hull
/// touch, as points, ``name vertex 1`` and so on, if `meshes` says where its file is: STL or OBJ, of up to 50 000 different vertices and 512
/// vertices of the hull; a mesh that is not convex touches as its hull does. Other meshes and ellipsoids are left out, and so are
/// rims against anything but a plane.
///
/// Parameters
/// ----------
/// robot : Robot
///     The robot.
/// surface : Surface or callable
///     What it touches, as of a `Contact`.
/// law : CompliantLaw or HuntCrossley
///     Law of the normal force.
/// friction : CoulombFriction or RegularisedFriction, optional
///     Law of friction; none unless given.
/// resistance : Resistance, optional
///     Resistance to rolling and spinning; none unless given.
/// links : sequence of str, optional
///     The links that touch; all unless given.
/// meshes : str or os.PathLike, optional
///     The folder of the files of meshes, by the path that the robot's file has, after ``package://``, or that without its first part.
///     Meshes are not opened unless given.
/// on : str, optional
///     The body of the model that carries the surface, as of a `LinkContact`. It does not touch its own surface.
///
/// Returns
/// -------
/// contacts : list of LinkContact
///     The contacts, in the order of the bodies.
/// left_out : list of str
///     The shapes that have none, each with the reason.
///
/// Examples
/// --------
/// >>> from somersault import contact, multibody
/// >>> stilt = multibody.Robot.from_urdf('''<robot name="stilt"><link name="shaft">
/// ...   <inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
/// ...   <collision><origin xyz="0 0 -0.5"/><geometry><sphere radius="0.02"/></geometry></collision>
/// ...   <collision name="grip"><geometry><mesh filename="grip.stl"/></geometry></collision>
/// ... </link></robot>''', base="free")
/// >>> contacts, left_out = contact.link_contacts(stilt, contact.HalfSpace(), contact.CompliantLaw(1e4, 20.0))
/// >>> [touch.name for touch in contacts]
/// ['shaft shape 1']
/// >>> left_out[0][:43]
/// '`grip` of link `shaft`: a mesh has no conta'
/// >>> motion = multibody.integrate_tree(stilt.model, [0, 0, 0.6, 0, 0, 0, 1], [0] * 6, (0.0, 0.2), contacts=contacts)
/// >>> motion.events[0].contact
/// 'shaft shape 1'
#[pyfunction]
#[pyo3(signature = (robot, surface, law, *, friction=None, resistance=None, links=None, meshes=None, on=None))]
pub(crate) fn link_contacts(
    py: Python<'_>,
    robot: &Robot,
    surface: &Bound<'_, PyAny>,
    law: &Bound<'_, PyAny>,
    friction: Option<&Bound<'_, PyAny>>,
    resistance: Option<&Bound<'_, PyAny>>,
    links: Option<Vec<String>>,
    meshes: Option<PathBuf>,
    on: Option<&str>,
) -> Result<(Vec<LinkContact>, Vec<String>), Error> {
    let laws = laws(law, friction, resistance)?;
    let against = Contact::surface_given(surface)?;
    let (model, geometry) = robot.touched();
    let model = &model.get().model;
    let found =
        tree::geometry_contacts(model, geometry, links.as_deref(), meshes.as_deref(), &against, &laws)?;
    let GeometryContacts { contacts, left_out } = found;
    let other = contacts.iter().filter(|own| Some(own.link()) != on);
    let contacts = other.map(|own| LinkContact::of(py, own, surface, on)).collect::<Result<_, _>>()?;
    Ok((contacts, left_out.iter().map(ToString::to_string).collect()))
}
