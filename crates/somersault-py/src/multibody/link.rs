//! Bodies of a tree with the joints that carry them.

use crate::core::convert::{
    MomentsOrTensor, any_vector, components, matrix_array, moments_or_tensor, orientation, rotation,
    vector_array,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore, value};
use crate::integrators::bodies::RigidBody;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::integrators::nalgebra::{Matrix3, Vector3};
use somersault::multibody::{self, Joint, MassProperties, ModelBuilder};

/// The kinds of joints, as Python names them.
const KINDS: &str = "'fixed', 'revolute', 'prismatic', 'spherical', 'planar' or 'free'";

/// A body of a tree, and the joint that carries it.
///
/// The frame of the body is that of the joint at q = 0. Numbers are in the frame of the body but for
/// `origin` and `orientation`, which place the joint in the parent, or in the world for the root.
///
/// ============== ================================== ================================ ==============
/// joint          q                                  v, in the axes of the body       q ⊕ v
/// ============== ================================== ================================ ==============
/// ``fixed``      –                                  –                                –
/// ``revolute``   angle about `axis`                 its rate                         sum
/// ``prismatic``  displacement along `axis`          its rate                         sum
/// ``spherical``  quaternion (x, y, z, w)            ω                                on SO(3)
/// ``planar``     x, y, angle                        (v_x, v_y, ω_z)                  on SE(2)
/// ``free``       position, quaternion (x, y, z, w)  (v, ω)                           on SE(3)
/// ============== ================================== ================================ ==============
///
/// Parameters
/// ----------
/// name : str
///     Name of the body, and of its joint.
/// joint : {'fixed', 'revolute', 'prismatic', 'spherical', 'planar', 'free'}
///     How it may move against its parent.
/// parent : str, optional
///     Name of the body that carries it; without one it is the root.
/// axis : array_like, shape (3,), optional
///     Axis of a revolute or prismatic joint, of any length but zero; only these have one.
/// mass : float, optional
///     Mass, kg; none unless given.
/// center : array_like, shape (3,), optional
///     Centre of mass, m; the origin unless given.
/// inertia : array_like, shape (3,) or (3, 3), optional
///     Principal moments along the axes, or the tensor, about the centre of mass, kg m²; zero unless given,
///     which makes a point.
/// body : RigidBody, optional
///     Mass and inertia, in the place of `mass` and `inertia`.
/// origin : array_like, shape (3,), optional
///     Where the joint is in the parent, m.
/// orientation : Rotation or array_like, shape (4,) or (3, 3), optional
///     Rotation from the joint frame to the parent.
/// damping : float, optional
///     Viscous friction in each degree of freedom, N s/m or N m s.
/// limits : tuple of float, optional
///     Range of a revolute or prismatic joint, rad or m; recorded, not enforced.
/// mimic : tuple of (str, float, float), optional
///     Lets a revolute or prismatic joint follow that of the body of this name: its coordinate is the first number times that of
///     the leader, plus the second. It has no numbers in q and v.
///
/// Raises
/// ------
/// InputError
///     If the body cannot be part of a tree: an inertia that no body has, an axis of zero, limits that
///     cross.
///
/// Examples
/// --------
/// >>> from somersault.multibody import Link
/// >>> Link("pole", "revolute", parent="cart", axis=(0, -1, 0), mass=1.0, center=(0, 0, 1))
/// Link('pole', 'revolute', parent='cart', axis=[0.0, -1.0, 0.0], mass=1.0)
#[pyclass(frozen, eq, from_py_object, module = "somersault.multibody")]
#[derive(Clone, PartialEq)]
pub(crate) struct Link(pub(crate) multibody::Link);

value! {
    impl Link {
        /// str: Name of the body.
        name: &str = |own| own.0.name();
        /// str: Kind of the joint.
        joint: &'static str = |own| own.0.joint().kind().name;
        /// str or None: Name of the body that carries it; None for the root.
        parent: Option<&str> = |own| own.0.parent();
        /// ndarray, shape (3,), or None: Axis of a revolute or prismatic joint.
        axis: Option<Bound<'py, PyAny>> = |own, py| own.0.joint().axis().map(|axis| vector_array(py, axis));
        /// float: Mass, kg.
        mass: f64 = |own| own.0.mass_properties().mass;
        /// ndarray, shape (3,): Centre of mass, m.
        center: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.mass_properties().center);
        /// ndarray, shape (3, 3): Inertia tensor about the centre of mass, kg m².
        inertia: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &own.0.mass_properties().inertia);
        /// ndarray, shape (3,): Where the joint is in the parent, m.
        origin: Bound<'py, PyAny> = |own, py| vector_array(py, own.0.origin());
        /// float: Viscous friction in each degree of freedom, N s/m or N m s.
        damping: f64 = |own| own.0.damping();
        /// tuple of float or None: Range of a revolute or prismatic joint, rad or m.
        limits: Option<(f64, f64)> = |own| own.0.limits().map(|[lower, upper]| (lower, upper));
        /// tuple of (str, float, float) or None: The body whose joint this one follows, multiplier and offset.
        mimic: Option<PickledMimic> = |own| {
            own.0.mimic().map(|m| (m.leader.clone(), m.multiplier, m.offset))
        };
    }
}

#[pymethods]
impl Link {
    #[new]
    #[pyo3(signature = (
        name, joint, *, parent=None, axis=None, mass=None, center=None, inertia=None, body=None, origin=None,
        orientation=None, damping=0.0, limits=None, mimic=None
    ))]
    fn new(
        name: &str,
        joint: &str,
        parent: Option<&str>,
        axis: Option<&Bound<'_, PyAny>>,
        mass: Option<f64>,
        center: Option<&Bound<'_, PyAny>>,
        inertia: Option<&Bound<'_, PyAny>>,
        body: Option<RigidBody>,
        origin: Option<&Bound<'_, PyAny>>,
        orientation: Option<&Bound<'_, PyAny>>,
        damping: f64,
        limits: Option<[f64; 2]>,
        mimic: Option<PickledMimic>,
    ) -> Result<Self, Error> {
        let vector = |argument, value: Option<&Bound<'_, PyAny>>| {
            value.map_or(Ok(Vector3::zeros()), |value| any_vector(argument, value))
        };
        let center = vector("center", center)?;
        let properties = match body {
            None => MassProperties {
                mass: mass.unwrap_or(0.0),
                center,
                inertia: match inertia.map(|value| moments_or_tensor("inertia", value)).transpose()? {
                    None => Matrix3::zeros(),
                    Some(MomentsOrTensor::Moments(moments)) => Matrix3::from_diagonal(&moments),
                    Some(MomentsOrTensor::Tensor(tensor)) => tensor,
                },
            },
            Some(_) if mass.is_some() || inertia.is_some() => {
                return Err(Error::input("`body` stands in the place of `mass` and `inertia`"));
            }
            Some(RigidBody(body)) => MassProperties::new(body.mass(), center, body.inertia()),
        };
        let joint = joint_of(joint, axis)?;
        let root = multibody::Link::root(name, joint, properties);
        let mut link = root.at(vector("origin", origin)?);
        if let Some(value) = orientation {
            link = link.turned(self::orientation("orientation", value)?);
        }
        link = link.with_damping(damping);
        if let Some([lower, upper]) = limits {
            link = link.with_limits(lower, upper);
        }
        if let Some((leader, multiplier, offset)) = mimic {
            link = link.following(leader, multiplier, offset);
        }
        // All that can be said of a body without its parent.
        ModelBuilder::new().add(link.clone())?;
        Ok(Self(match parent {
            Some(parent) => link.carried_by(parent),
            None => link,
        }))
    }

    /// scipy.spatial.transform.Rotation: Rotation from the joint frame to the parent.
    #[getter(orientation)]
    fn turn<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rotation(numpy::PyArray1::from_slice(py, &components(self.0.orientation())).as_any())
    }

    fn __repr__(&self) -> String {
        let mut text = format!("Link('{}', '{}'", brief(self.name(), 40), self.joint());
        if let Some(parent) = self.parent() {
            text += &format!(", parent='{}'", brief(parent, 40));
        }
        if let Some(axis) = self.0.joint().axis() {
            text += &format!(", axis={:?}", axis.as_slice());
        }
        text + &format!(", mass={:?})", self.mass())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, link) = (slf.py(), slf.get());
        let quaternion = numpy::PyArray1::from_slice(py, &components(link.0.orientation()));
        let arguments = (
            (link.name(), link.joint(), link.parent(), link.axis(py), link.mass(), link.center(py)),
            (link.inertia(py)?, link.origin(py), quaternion, link.damping(), link.limits(), link.mimic()),
        );
        by_restore(slf, arguments)
    }

    /// A pickled link.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        body: PickledBody<'_>,
        joint: PickledJoint<'_>,
    ) -> Result<Self, Error> {
        let (name, kind, parent, axis, mass, center) = &body;
        let (inertia, origin, quaternion, damping, limits, mimic) = &joint;
        Self::new(
            name,
            kind,
            parent.as_deref(),
            axis.as_ref(),
            Some(*mass),
            Some(center),
            Some(inertia),
            None,
            Some(origin),
            Some(quaternion),
            *damping,
            *limits,
            mimic.clone(),
        )
    }
}

/// Name, joint, parent, axis, mass and centre of mass.
type PickledBody<'py> = (String, String, Option<String>, Option<Bound<'py, PyAny>>, f64, Bound<'py, PyAny>);

/// Inertia, origin, quaternion, damping, limits and what it follows.
type PickledJoint<'py> =
    (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, f64, Option<[f64; 2]>, Option<PickledMimic>);

/// Leader, multiplier and offset.
type PickledMimic = (String, f64, f64);

fn joint_of(kind: &str, axis: Option<&Bound<'_, PyAny>>) -> Result<Joint, Error> {
    let given = axis.is_some();
    let along = || match axis {
        Some(value) => any_vector("axis", value),
        None => Err(Error::input(format!("`axis` must be given for a {kind} joint"))),
    };
    let joint = match kind {
        "revolute" => return Ok(Joint::Revolute { axis: along()? }),
        "prismatic" => return Ok(Joint::Prismatic { axis: along()? }),
        "fixed" => Joint::Fixed,
        "spherical" => Joint::Spherical,
        "planar" => Joint::Planar,
        "free" => Joint::Free,
        _ => return Err(Error::input(format!("`joint` must be {KINDS}, found '{kind}'"))),
    };
    if given {
        return Err(Error::input(format!("`axis` is for revolute and prismatic joints, found '{kind}'")));
    }
    Ok(joint)
}
