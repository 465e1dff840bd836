//! Model bodies with contacts.

use crate::contact::contacts::Contact;
use crate::contact::laws::{CompliantLaw, CoulombFriction, laws};
use crate::core::convert::{finite, vector};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, counted, digits};
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::forces::models::Gravity;
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
        let contacts = counted(self.contacts.len(), "contact", "contacts");
        format!("<ContactSystem: a body of {} kg, {contacts}>", digits(self.body.0.mass()))
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
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> law = contact.CompliantLaw.from_restitution(1.0, 1e5, 0.8)
/// >>> ball = contact.bouncing_ball(1.0, 0.1, law, height=1.0)
/// >>> motion = somersault.integrate(
/// ...     ball.body, ball.state, (0.0, 0.6), dt=0.01, forces=ball.forces, contacts=ball.contacts)
/// >>> [(event.kind, round(event.t, 3)) for event in motion.events]
/// [('touch_down', 0.452), ('release', 0.461)]
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
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> top = contact.spinning_top()
/// >>> motion = somersault.integrate(
/// ...     top.body, top.state, (0.0, 0.1), dt=1e-3, forces=top.forces, contacts=top.contacts)
/// >>> motion.success
/// True
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
///
/// Examples
/// --------
/// A corner touches after √(2 h/g):
///
/// >>> import somersault
/// >>> from somersault import contact
/// >>> box = contact.falling_box(1.0, (0.1, 0.2, 0.3), contact.CompliantLaw(1e5, 100.0), height=0.5)
/// >>> motion = somersault.integrate(
/// ...     box.body, box.state, (0.0, 0.4), dt=0.01, forces=box.forces, contacts=box.contacts)
/// >>> round(motion.events[0].t, 4), round((2 * 0.5 / 9.81) ** 0.5, 4)
/// (0.3193, 0.3193)
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
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> friction = contact.CoulombFriction(0.3, 1e5, 100.0)
/// >>> block = contact.sliding_block(1.0, (0.2, 0.2, 0.1), contact.CompliantLaw(1e5, 100.0), friction, 0.5)
/// >>> motion = somersault.integrate(
/// ...     block.body, block.state, (0.0, 0.3), dt=1e-3, forces=block.forces, contacts=block.contacts)
/// >>> abs(float(motion.velocity[-1, 0])) < 1e-3
/// True
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
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> friction = contact.CoulombFriction(0.5, 1e5, 200.0)
/// >>> disk = contact.rolling_disk(1.0, 0.2, contact.CompliantLaw(1e5, 200.0), friction, tilt=1.2, turning=2.0)
/// >>> motion = somersault.integrate(
/// ...     disk.body, disk.state, (0.0, 0.2), dt=1e-3, forces=disk.forces, contacts=disk.contacts)
/// >>> rise = float(motion.position[-1, 2] - motion.position[0, 2])
/// >>> abs(rise) < 1e-4
/// True
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
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> top = contact.tippe_top(
/// ...     0.015, 0.015, 0.2, (1.3e-6, 1.3e-6), contact.CompliantLaw(1e3, 0.2), tilt=0.1, spin=150.0,
/// ...     friction=contact.RegularisedFriction(0.3, 0.01))
/// >>> motion = somersault.integrate(
/// ...     top.body, top.state, (0.0, 0.05), dt=1e-4, forces=top.forces, contacts=top.contacts)
/// >>> motion.success
/// True
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
