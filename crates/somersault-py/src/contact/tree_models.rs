//! Model trees with contacts.

use crate::contact::surface::Surface;
use crate::contact::tree::LinkContact;
use crate::core::convert::{finite, finite_all, row, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, counted, value};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::models;
use somersault::contact::tree;
use somersault::multibody::motion::TreeForces;

/// A tree with contacts, what drives its joints, and where it starts: arguments of `multibody.integrate_tree`.
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> leg = contact.hopping_leg()
/// >>> leg.model.names
/// ['body', 'thigh', 'shank']
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct TreeContactSystem {
    name: String,
    system: models::TreeContactSystem,
    model: Py<Model>,
    contacts: Vec<Py<LinkContact>>,
}

value! {
    impl TreeContactSystem {
        /// Model: The tree.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// list of LinkContact: Its contacts.
        contacts: Vec<Py<LinkContact>> =
            |own, py| own.contacts.iter().map(|contact| contact.clone_ref(py)).collect();
        /// ndarray, shape (n_positions,): Configuration at the start.
        q: PyResult<Bound<'py, PyAny>> = |own, py| numbers(py, &own.system.q);
        /// ndarray, shape (n_velocities,): Velocity at the start.
        v: PyResult<Bound<'py, PyAny>> = |own, py| numbers(py, &own.system.v);
    }
}

fn numbers<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    Ok(row(py, values.to_vec())?.into_any())
}

impl TreeContactSystem {
    fn of(py: Python<'_>, name: &str) -> Result<Self, Error> {
        let system = match name {
            "hopping_leg" => models::HoppingLeg::example()?.system()?,
            "planar_biped" => models::PlanarBiped::example()?.system()?,
            "quadruped" => models::Quadruped::example()?.system()?,
            "ragdoll" => models::Ragdoll::example()?.system()?,
            "springboard" => models::Springboard::example()?.system()?,
            _ => return Err(Error::input(format!("`name` is of no model: '{name}'"))),
        };
        let contact = |own: &tree::LinkContact| -> Result<_, Error> {
            let surface = Surface::of(py, own.contact().surface())?;
            Ok(Py::new(py, LinkContact::of(py, own, surface.bind(py), own.base())?)?)
        };
        let contacts = system.contacts.iter().map(contact).collect::<Result<_, _>>()?;
        let model = Py::new(py, Model::of(system.model.clone()))?;
        Ok(Self { name: name.to_owned(), system, model, contacts })
    }
}

#[pymethods]
impl TreeContactSystem {
    /// Forces of the joints' actuators; `multibody.integrate_tree` takes this method as its `torque`.
    ///
    /// Each is τ₀ + τ₁ sin(ω t + φ) − k q − c q̇.
    ///
    /// Parameters
    /// ----------
    /// t : float
    ///     Time, s.
    /// q : array_like, shape (n_positions,)
    ///     Configuration.
    /// v : array_like, shape (n_velocities,)
    ///     Velocity.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_velocities,)
    ///     N and N m.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> leg.torque(0.0, leg.q, leg.v).round(3)
    /// array([ 0.   ,  0.   ,  0.   ,  4.368, -0.995])
    fn torque<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (t, model) = (finite("t", t)?, &self.system.model);
        let q = finite_all("q", with_shape("q", &[model.n_positions()], q)?)?;
        let v = finite_all("v", with_shape("v", &[model.n_velocities()], v)?)?;
        let mut torque = vec![0.0; v.len()];
        self.system.actuators.add_torque(t, &q, &v, &mut torque);
        Ok(numbers(py, &torque)?)
    }

    fn __repr__(&self) -> String {
        let links = counted(self.system.model.n_bodies(), "link", "links");
        let contacts = counted(self.contacts.len(), "contact", "contacts");
        format!("<TreeContactSystem: {} of {links}, {contacts}>", self.name.replace('_', " "))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (&slf.get().name,))
    }

    /// A pickled model.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, py: Python<'_>, name: &str) -> Result<Self, Error> {
        Self::of(py, name)
    }
}

/// A leg that hops on the ground z = 0: a body of 5 kg on thigh and shank, driven by sines at hip and knee.
///
/// The links are ``body``, ``thigh`` and ``shank``, in the plane of x and z. The configuration is (x, z, a, hip, knee): where the
/// centre of mass of the body is, its lean, and the angles of the joints, positive forward. The foot sticks and slips. In 0.6 s it
/// makes three hops.
///
/// Returns
/// -------
/// TreeContactSystem
///
/// Examples
/// --------
/// >>> from somersault import contact, multibody
/// >>> leg = contact.hopping_leg()
/// >>> motion = multibody.integrate_tree(
/// ...     leg.model, leg.q, leg.v, (0.0, 0.6), torque=leg.torque, contacts=leg.contacts)
/// >>> [event.kind for event in motion.events].count("touch_down")
/// 3
#[pyfunction]
pub(crate) fn hopping_leg(py: Python<'_>) -> Result<TreeContactSystem, Error> {
    TreeContactSystem::of(py, "hopping_leg")
}

/// A biped of 60 kg in the plane of x and z that steps from its left foot to its right one.
///
/// The links are ``trunk``, ``left thigh``, ``left shank``, ``right thigh`` and ``right shank``, the contacts ``left foot`` and
/// ``right foot``, points on the ground z = 0. Springs and dampers hold hips and knees at angles that swing once in a second. The
/// configuration is (x, z, lean, left hip, left knee, right hip, right knee), positive forward.
///
/// Returns
/// -------
/// TreeContactSystem
///
/// Examples
/// --------
/// >>> from somersault import contact, multibody
/// >>> biped = contact.planar_biped()
/// >>> motion = multibody.integrate_tree(
/// ...     biped.model, biped.q, biped.v, (0.0, 0.8), torque=biped.torque, contacts=biped.contacts)
/// >>> [(event.contact, event.kind) for event in motion.events]
/// [('left foot', 'touch_down'), ('left foot', 'stick'), ('right foot', 'touch_down')]
#[pyfunction]
pub(crate) fn planar_biped(py: Python<'_>) -> Result<TreeContactSystem, Error> {
    TreeContactSystem::of(py, "planar_biped")
}

/// A quadruped of 13.6 kg, read from a URDF document, that falls by 0.1 m and comes to rest on its feet.
///
/// The links are ``trunk``, and ``lf_thigh`` and ``lf_shank`` and so on for the legs ``lf``, ``rf``, ``lh`` and ``rh``. The contacts are
/// those of its ``<collision>`` elements with the ground z = 0: the corners of the trunk, and balls as feet. Springs and dampers
/// hold the hinges.
///
/// Returns
/// -------
/// TreeContactSystem
///
/// Examples
/// --------
/// >>> from somersault import contact, multibody
/// >>> dog = contact.quadruped()
/// >>> motion = multibody.integrate_tree(
/// ...     dog.model, dog.q, dog.v, (0.0, 0.2), torque=dog.torque, contacts=dog.contacts)
/// >>> sorted({event.contact for event in motion.events})
/// ['lf_shank', 'lh_shank', 'rf_shank', 'rh_shank']
#[pyfunction]
pub(crate) fn quadruped(py: Python<'_>) -> Result<TreeContactSystem, Error> {
    TreeContactSystem::of(py, "quadruped")
}

/// A limp figure of 65 kg and 1.70 m that falls, tumbling, onto the ground z = 0.
///
/// It has the segments of `multibody.diver_spatial`. Pelvis, head, upper arms and thighs are on ball joints with damping, the other
/// segments on hinges whose springs are weak. Balls at head, chest, pelvis, elbows, hands, knees, heels and toes touch the ground.
///
/// Returns
/// -------
/// TreeContactSystem
///
/// Examples
/// --------
/// >>> from somersault import contact, multibody
/// >>> doll = contact.ragdoll()
/// >>> motion = multibody.integrate_tree(
/// ...     doll.model, doll.q, doll.v, (0.0, 0.4), torque=doll.torque, contacts=doll.contacts)
/// >>> motion.events[0].kind
/// 'touch_down'
#[pyfunction]
pub(crate) fn ragdoll(py: Python<'_>) -> Result<TreeContactSystem, Error> {
    TreeContactSystem::of(py, "ragdoll")
}

/// A diver of three links who falls by 0.3 m onto a springboard, which throws them up with a forward somersault.
///
/// The board, ``board``, is rigid on a hinge with a spring: 5.5 kN/m and 7 kg at its tip, 2.4 m from the hinge at the origin. It carries
/// the surface that the contact ``foot`` of ``shank`` touches. The configuration is (board, x, z, trunk, hip, knee).
///
/// Returns
/// -------
/// TreeContactSystem
///
/// Examples
/// --------
/// >>> from somersault import contact, multibody
/// >>> board = contact.springboard()
/// >>> board.contacts[0].on
/// 'board'
/// >>> motion = multibody.integrate_tree(
/// ...     board.model, board.q, board.v, (0.0, 1.0), torque=board.torque, contacts=board.contacts)
/// >>> motion.events[-1].kind, bool(motion.v[-1, 3] < -1.0)
/// ('release', True)
#[pyfunction]
pub(crate) fn springboard(py: Python<'_>) -> Result<TreeContactSystem, Error> {
    TreeContactSystem::of(py, "springboard")
}
