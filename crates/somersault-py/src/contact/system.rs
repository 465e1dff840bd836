//! Model bodies with contacts.

use crate::contact::contacts::Contact;
use crate::contact::laws::{CompliantLaw, CoulombFriction, laws};
use crate::core::convert::{finite, vector};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::forces::Gravity;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::contacts::BodyInContact;
use somersault::contact::models::{
    BouncingBall, FallingBox, RollingDisk, SlidingBlock, SpinningTop, TippeTop,
};
use somersault::integrators::force;
use somersault::integrators::state::RigidBodyState;

/// A body, its state at the start, and what acts on it: arguments of `somersault.integrate`.
#[pyclass(frozen, get_all, module = "somersault.contact")]
pub(crate) struct ContactSystem {
    /// RigidBody: The body.
    body: RigidBody,
    /// State: Its state at the start.
    state: State,
    /// Gravity: Its weight.
    forces: Py<Gravity>,
    /// list of Contact: Its contacts.
    contacts: Vec<Py<Contact>>,
}

impl ContactSystem {
    fn of(
        py: Python<'_>,
        system: &BodyInContact<force::Gravity>,
        state: RigidBodyState,
    ) -> Result<Self, Error> {
        let (gravity, contacts) = &system.forces;
        let contacts = contacts.iter().map(|contact| Py::new(py, Contact::of(py, contact)?));
        Ok(Self {
            body: RigidBody(system.body),
            state: State(state),
            forces: Gravity::of(py, *gravity)?,
            contacts: contacts.collect::<PyResult<_>>()?,
        })
    }
}

#[pymethods]
impl ContactSystem {
    fn __repr__(&self) -> String {
        format!("<ContactSystem: a body of {} kg, {} contacts>", self.body.0.mass(), self.contacts.len())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        by_restore(slf, (own.body, own.state, &own.forces, &own.contacts))
    }

    /// A pickled scene.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        body: RigidBody,
        state: State,
        forces: Py<Gravity>,
        contacts: Vec<Py<Contact>>,
    ) -> Self {
        Self { body, state, forces, contacts }
    }
}

/// A ball above the ground z = 0, under weight; frictionless.
///
/// Parameters
/// ----------
/// mass, radius : float
///     Mass, kg, and radius, m.
/// law : CompliantLaw
///     Law of its contact.
/// height : float
///     Height of its lowest point at the start, m.
/// velocity : float, optional
///     Velocity at the start, upwards, m/s.
///
/// Returns
/// -------
/// ContactSystem
#[pyfunction]
#[pyo3(signature = (mass, radius, law, height, velocity=0.0))]
pub(crate) fn bouncing_ball(
    py: Python<'_>,
    mass: f64,
    radius: f64,
    law: CompliantLaw,
    height: f64,
    velocity: f64,
) -> Result<ContactSystem, Error> {
    let ball = BouncingBall::try_new(mass, radius, law.0)?;
    ContactSystem::of(py, &ball.system, ball.at(finite("height", height)?, finite("velocity", velocity)?))
}

/// The spinning top of thesis 7.3.2: a disk with a tip, on frictionless ground.
///
/// Returns
/// -------
/// ContactSystem
#[pyfunction]
pub(crate) fn spinning_top(py: Python<'_>) -> Result<ContactSystem, Error> {
    let top = SpinningTop::thesis()?;
    ContactSystem::of(py, &top.system, top.start)
}

/// A box above the ground z = 0 at rest, a diagonal upright; its corners touch.
///
/// Parameters
/// ----------
/// mass : float
///     Mass, kg.
/// lengths : array_like, shape (3,)
///     Side lengths, m.
/// law : CompliantLaw or HuntCrossley
///     Law of every corner.
/// height : float
///     Height of the lowest corner, m.
/// heading : float, optional
///     Turn about the vertical, rad.
/// friction : CoulombFriction or RegularisedFriction, optional
///     Friction of every corner; none unless given.
///
/// Returns
/// -------
/// ContactSystem
#[pyfunction]
#[pyo3(signature = (mass, lengths, law, height, heading=0.0, *, friction=None))]
pub(crate) fn falling_box(
    py: Python<'_>,
    mass: f64,
    lengths: &Bound<'_, PyAny>,
    law: &Bound<'_, PyAny>,
    height: f64,
    heading: f64,
    friction: Option<&Bound<'_, PyAny>>,
) -> Result<ContactSystem, Error> {
    let falling = FallingBox::try_new(mass, vector("lengths", lengths)?, laws(law, friction, None)?)?;
    let start = falling.on_corner(finite("height", height)?, finite("heading", heading)?);
    ContactSystem::of(py, &falling.system, start)
}

/// A block on the ground z = 0 that slides along x until friction stops it; it does not tip.
///
/// Parameters
/// ----------
/// mass : float
///     Mass, kg.
/// lengths : array_like, shape (3,)
///     Side lengths, m, the last upright.
/// law : CompliantLaw
///     Law of the ground.
/// friction : CoulombFriction
///     Friction.
/// velocity : float
///     Velocity at the start, m/s.
/// slope : float, optional
///     Angle by which the ground falls along x, rad: the weight turns, the ground stays.
///
/// Returns
/// -------
/// ContactSystem
#[pyfunction]
#[pyo3(signature = (mass, lengths, law, friction, velocity, slope=0.0))]
pub(crate) fn sliding_block(
    py: Python<'_>,
    mass: f64,
    lengths: &Bound<'_, PyAny>,
    law: CompliantLaw,
    friction: CoulombFriction,
    velocity: f64,
    slope: f64,
) -> Result<ContactSystem, Error> {
    let block = SlidingBlock::try_new(mass, vector("lengths", lengths)?, law.0, friction.0)?
        .on_slope(finite("slope", slope)?);
    ContactSystem::of(py, &block.system, block.sliding(finite("velocity", velocity)?))
}

/// A disk that rolls on its rim on the ground z = 0, in a steady motion.
///
/// Parameters
/// ----------
/// mass, radius : float
///     Mass, kg, and radius, m.
/// law : CompliantLaw
///     Law of the ground.
/// friction : CoulombFriction
///     Friction.
/// tilt : float
///     Angle of the axis from the vertical, between 0 and π/2, rad.
/// turning : float
///     Rate at which the disk goes round, rad/s; not zero.
///
/// Returns
/// -------
/// ContactSystem
#[pyfunction]
pub(crate) fn rolling_disk(
    py: Python<'_>,
    mass: f64,
    radius: f64,
    law: CompliantLaw,
    friction: CoulombFriction,
    tilt: f64,
    turning: f64,
) -> Result<ContactSystem, Error> {
    let disk = RollingDisk::try_new(mass, radius, law.0, friction.0)?;
    ContactSystem::of(py, &disk.system, disk.steady(tilt, turning)?)
}

/// A tippe top on the ground z = 0: an eccentric sphere that friction turns upside down.
///
/// Parameters
/// ----------
/// mass, radius : float
///     Mass, kg, and radius R of the sphere, m.
/// eccentricity : float
///     0 < α < 1; the centre of mass is αR below the centre of the sphere.
/// moments : tuple of float
///     Moments of inertia across the axis and about it, kg m².
/// law : CompliantLaw or HuntCrossley
///     Law of the ground.
/// tilt : float
///     Angle of the axis from the vertical at the start, rad.
/// spin : float
///     Spin about the axis at the start, rad/s.
/// sag : float, optional
///     How deep the sphere is in the ground at the start, m.
/// friction : CoulombFriction or RegularisedFriction, optional
///     Friction; none unless given.
///
/// Returns
/// -------
/// ContactSystem
#[pyfunction]
#[pyo3(signature = (mass, radius, eccentricity, moments, law, tilt, spin, sag=0.0, *, friction=None))]
pub(crate) fn tippe_top(
    py: Python<'_>,
    mass: f64,
    radius: f64,
    eccentricity: f64,
    moments: (f64, f64),
    law: &Bound<'_, PyAny>,
    tilt: f64,
    spin: f64,
    sag: f64,
    friction: Option<&Bound<'_, PyAny>>,
) -> Result<ContactSystem, Error> {
    let top = TippeTop::try_new(mass, radius, eccentricity, moments, laws(law, friction, None)?)?;
    let start = top.spinning(finite("tilt", tilt)?, finite("spin", spin)?, finite("sag", sag)?);
    ContactSystem::of(py, &top.system, start)
}
