//! Forces and torques on bodies.

pub(crate) mod models;
mod rotors;
mod satellite;
mod scheduled;
mod traced;

/// What acts on bodies.
#[pyo3::pymodule(name = "forces", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::integrators::forces::models::{
        CentralGravity, Drag, Force, ForceModel, Gravitation, Gravity, Spring, Torque,
    };
    #[pymodule_export]
    use crate::integrators::forces::rotors::{ControlMomentGyros, ReactionWheels};
    #[pymodule_export]
    use crate::integrators::forces::satellite::{
        AerodynamicDrag, GravityGradient, MagneticDipole, Orbit, Plate, SolarPressure,
    };
    #[pymodule_export]
    use crate::integrators::forces::scheduled::ScheduledTorque;
    #[pymodule_export]
    use crate::integrators::forces::traced::TracedForce;
}
