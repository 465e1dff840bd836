//! Platforms: bodies beside a tree that move as functions of time.

use crate::core::callable::{callable_name, check_callable, noted};
use crate::core::convert::{a_type, finite, finite_all, interval_of, orientation, row, vector, with_shape};
use crate::core::error::Error;
use crate::core::value::{brief, counted, value};
use crate::multibody::model::Model;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use somersault::contact::tree::{self, PlatformMotion};
use somersault::integrators::nalgebra::{UnitQuaternion, Vector3};

/// A body that moves as a function of time, and carries surfaces: a table that shakes, a lift, a conveyor, a tilting board.
///
/// Velocities and accelerations are compared with difference quotients of the motion at nine times of an interval, to 10⁻³ of their largest
/// values.
///
/// Parameters
/// ----------
/// name : str
///     Its name, for `LinkContact.on`.
/// motion : callable
///     ``f(t) -> (position, velocity, acceleration)`` of its origin, m, m/s and m/s², world frame; or six values, with the
///     orientation as a Rotation or quaternion (x, y, z, w) from its axes to those of the world, and the angular velocity, rad/s, and
///     acceleration, rad/s², world frame.
/// interval : tuple of float, optional
///     Times between which the motion is checked, s; (0, 1) unless given.
///
/// Raises
/// ------
/// InputError
///     If a velocity or an acceleration is not the derivative of the motion.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import contact
/// >>> up = np.array([0, 0, 1e-3])
/// >>> table = contact.Platform("table", lambda t: (up * np.sin(20 * t), 20 * up * np.cos(20 * t), -400 * up * np.sin(20 * t)))
/// >>> table.name, table.interval
/// ('table', (0.0, 1.0))
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct Platform {
    name: String,
    motion: Py<PyAny>,
    interval: [f64; 2],
}

value! {
    impl Platform(name, motion, interval) {
        /// str: Its name.
        name: &str = |own| &own.name;
        /// callable: Its motion.
        motion: Py<PyAny> = |own, py| own.motion.clone_ref(py);
        /// tuple of float: Times between which the motion was checked, s.
        interval: (f64, f64) = |own| own.interval.into();
    }
}

/// An array of numbers.
type Numbers<'py> = Bound<'py, PyArrayDyn<f64>>;

/// A motion at a time.
fn motion_at(motion: &Bound<'_, PyAny>, t: f64) -> Result<PlatformMotion, Error> {
    let found =
        noted(motion.py(), motion.call1((t,)), || format!("{}(t) at t = {t}", callable_name(motion)))?;
    let wrong = |found: String| {
        Error::input(format!(
            "`motion` must return position, velocity and acceleration, or those and orientation, angular velocity and angular \
             acceleration, found {found}"
        ))
    };
    let entries = found.try_iter().map_err(|_| wrong(a_type(&found)))?.take(7);
    let entries: Vec<Bound<'_, PyAny>> = entries.collect::<PyResult<_>>()?;
    let of = |k: usize| vector("motion", &entries[k]);
    let none = Vector3::zeros();
    let (turn, spin, turning) = match entries.len() {
        3 => (UnitQuaternion::identity(), none, none),
        6 => (orientation("motion", &entries[3])?, of(4)?, of(5)?),
        7.. => return Err(wrong("more than 6 values".to_owned())),
        n => return Err(wrong(counted(n, "value", "values"))),
    };
    Ok(PlatformMotion {
        position: of(0)?,
        velocity: of(1)?,
        acceleration: of(2)?,
        orientation: turn,
        angular_velocity: spin,
        angular_acceleration: turning,
    })
}

#[pymethods]
impl Platform {
    #[new]
    #[pyo3(signature = (name, motion, interval=None))]
    fn new(
        name: String,
        motion: &Bound<'_, PyAny>,
        interval: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        check_callable("motion", "f(t)", motion)?;
        let interval = interval.map_or(Ok([0.0, 1.0]), interval_of)?;
        PlatformMotion::check(|t| motion_at(motion, t), interval.into())?;
        Ok(Self { name, motion: motion.clone().unbind(), interval })
    }

    fn __repr__(&self) -> String {
        let [start, end] = self.interval;
        format!("<Platform: {:?}, checked from {start} s to {end} s>", brief(&self.name, 30))
    }
}

/// A tree and platforms beside it: arguments of `multibody.integrate_tree`.
///
/// Each platform is a body of `model` on a free joint, whose surfaces a `LinkContact` names by ``on``. The positions and velocities
/// of the tree come first, then those of the platforms. The platforms are integrated with the tree, from their accelerations,
/// so that they follow their motions to the accuracy of the method. Their surfaces are surfaces carried by bodies:
/// events are located, and `differentiate_tree` accepts ``active`` and ``acceleration`` as well. Each platform has the mass of the
/// tree, which has no effect on the motion; `Model.mass` includes it.
///
/// Parameters
/// ----------
/// model : Model
///     The tree. A single body is a tree of one link on a free joint.
/// platforms : sequence of Platform
///     The platforms.
///
/// Examples
/// --------
/// A mass that rests on a spring law, on a table that moves up and down:
///
/// >>> import numpy as np
/// >>> from somersault import contact, multibody
/// >>> up = np.array([0, 0, 1e-3])
/// >>> table = contact.Platform("table", lambda t: (up * np.sin(20 * t), 20 * up * np.cos(20 * t), -400 * up * np.sin(20 * t)))
/// >>> mass = multibody.Model([multibody.Link("mass", "prismatic", axis=(0, 0, 1), mass=2.0)])
/// >>> scene = contact.TreeOnPlatforms(mass, [table])
/// >>> q, v = scene.start([-2 * 9.81 / 2e3], [0.0])
/// >>> touch = contact.Contact((0, 0, 0), contact.HalfSpace(), contact.CompliantLaw(2e3))
/// >>> motion = multibody.integrate_tree(
/// ...     scene.model, q, v, (0.0, 0.5), active=scene.active, acceleration=scene.acceleration,
/// ...     contacts=contact.LinkContact("foot", "mass", touch, on="table"))
/// >>> round(float(motion.q[-1, 0]), 6)
/// -0.010608
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct TreeOnPlatforms {
    scene: tree::TreeOnPlatforms,
    tree: Py<Model>,
    model: Py<Model>,
    platforms: Vec<Py<Platform>>,
}

value! {
    impl TreeOnPlatforms(tree, platforms) {
        /// Model: The tree alone.
        tree: Py<Model> = |own, py| own.tree.clone_ref(py);
        /// list of Platform: The platforms.
        platforms: Vec<Py<Platform>> = |own, py| own.platforms.iter().map(|one| one.clone_ref(py)).collect();
        /// Model: The tree with its platforms.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// list of bool: Which degrees of freedom of `model` follow a motion: those of the platforms.
        active: Vec<bool> = |own| own.scene.split().active().to_vec();
    }
}

impl TreeOnPlatforms {
    /// The motions of the platforms at a time.
    fn motions(&self, py: Python<'_>, t: f64) -> Result<Vec<PlatformMotion>, Error> {
        self.platforms.iter().map(|one| motion_at(one.get().motion.bind(py), t)).collect()
    }
}

#[pymethods]
impl TreeOnPlatforms {
    #[new]
    fn new(py: Python<'_>, model: Py<Model>, platforms: Vec<Py<Platform>>) -> Result<Self, Error> {
        let names: Vec<&str> = platforms.iter().map(|one| one.get().name.as_str()).collect();
        let scene = tree::TreeOnPlatforms::try_new(&model.get().model, &names)?;
        let whole = Py::new(py, Model::of(scene.model().clone()))?;
        Ok(Self { scene, tree: model, model: whole, platforms })
    }

    /// Configuration and velocity of all, by those of the tree and the motions of the platforms.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (tree.n_positions,) and (tree.n_velocities,)
    ///     Configuration and velocity of the tree.
    /// t : float, optional
    ///     When, s; 0 unless given.
    ///
    /// Returns
    /// -------
    /// q, v : ndarray, shape (model.n_positions,) and (model.n_velocities,)
    ///     Configuration and velocity.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import contact, multibody
    /// >>> belt = contact.Platform("belt", lambda t: ((0.5 * t, 0, 0), (0.5, 0, 0), (0, 0, 0)))
    /// >>> scene = contact.TreeOnPlatforms(multibody.cart_pendulum(), [belt])
    /// >>> q, v = scene.start([0.0, 0.1], [0.0, 0.0], t=2.0)
    /// >>> float(q[2]), float(v[2])
    /// (1.0, 0.5)
    #[pyo3(signature = (q, v, t=0.0))]
    fn start<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        t: f64,
    ) -> Result<(Numbers<'py>, Numbers<'py>), Error> {
        let tree = &self.tree.get().model;
        let q = finite_all("q", with_shape("q", &[tree.n_positions()], q)?)?;
        let v = finite_all("v", with_shape("v", &[tree.n_velocities()], v)?)?;
        let motions = self.motions(py, finite("t", t)?)?;
        let (q, v) = self.scene.start(&q, &v, |k| motions[k])?;
        Ok((row(py, q)?, row(py, v)?))
    }

    /// Accelerations of the platforms, and zeros for the tree; `multibody.integrate_tree` accepts this method as its `acceleration`.
    ///
    /// Parameters
    /// ----------
    /// t : float
    ///     Time, s.
    /// q, v : array_like
    ///     Not used.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (model.n_velocities,)
    ///     m/s² and rad/s².
    ///
    /// Examples
    /// --------
    /// >>> from somersault import contact, multibody
    /// >>> lift = contact.Platform("lift", lambda t: ((0, 0, t**2), (0, 0, 2 * t), (0, 0, 2)))
    /// >>> scene = contact.TreeOnPlatforms(multibody.cart_pendulum(), [lift])
    /// >>> scene.acceleration(0.0)
    /// array([0., 0., 0., 0., 2., 0., 0., 0.])
    #[pyo3(signature = (t, q=None, v=None))]
    fn acceleration<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: Option<&Bound<'py, PyAny>>,
        v: Option<&Bound<'py, PyAny>>,
    ) -> Result<Numbers<'py>, Error> {
        let _ = (q, v);
        let motions = self.motions(py, finite("t", t)?)?;
        let mut out = vec![0.0; self.scene.model().n_velocities()];
        self.scene.write_accelerations(|k| motions[k], &mut out);
        Ok(row(py, out)?)
    }

    fn __repr__(&self) -> String {
        let links = counted(self.tree.get().model.n_bodies(), "link", "links");
        let platforms = counted(self.platforms.len(), "platform", "platforms");
        format!("<TreeOnPlatforms: {links} beside {platforms}>")
    }
}
