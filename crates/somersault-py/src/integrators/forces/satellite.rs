//! An orbit, and the torques on a satellite.

use crate::core::convert::{
    a_type, array, components, finite, rotation, sequence, times, vector, vector_array, vector_or,
};
use crate::core::error::Error;
use crate::core::value::value;
use crate::integrators::forces::models::{ForceModel, build};
use pyo3::prelude::*;
use pyo3::types::PyList;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::orbit::{self, Elements};
use somersault::integrators::satellite::{self, Field};

/// Elliptic orbit about a centre of attraction, by Kepler's laws.
///
/// The frame of the orbit has x from the centre outwards, z normal to the orbit and y ahead, along the flight on a circle.
///
/// Parameters
/// ----------
/// semi_major_axis : float
///     Semi-major axis, the radius of a circle, m.
/// eccentricity : float, optional
///     Eccentricity, from 0 to below 1.
/// inclination : float, optional
///     Inclination to the plane z = 0, rad.
/// ascending_node : float, optional
///     Longitude of the ascending node from the x axis, rad.
/// periapsis : float, optional
///     Angle from the ascending node to the periapsis, rad.
/// mean_anomaly : float, optional
///     Mean anomaly at t = 0, rad.
/// gravitational_parameter : float, optional
///     μ of the centre, m³/s²; that of the earth unless given.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> orbit = somersault.forces.Orbit(6.778e6)
/// >>> round(orbit.period / 60, 1)
/// 92.6
/// >>> orbit.position(orbit.period / 4).round(3) + 0.0
/// array([      0., 6778000.,       0.])
#[pyclass(frozen, eq, from_py_object, module = "somersault.forces")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Orbit(orbit::Orbit);

value! {
    impl Orbit(
        semi_major_axis, eccentricity, inclination, ascending_node, periapsis, mean_anomaly, gravitational_parameter
    ) {
        /// float: Semi-major axis, m.
        semi_major_axis: f64 = |own| own.0.elements().semi_major_axis;
        /// float: Eccentricity.
        eccentricity: f64 = |own| own.0.elements().eccentricity;
        /// float: Inclination to the plane z = 0, rad.
        inclination: f64 = |own| own.0.elements().inclination;
        /// float: Longitude of the ascending node, rad.
        ascending_node: f64 = |own| own.0.elements().ascending_node;
        /// float: Angle from the ascending node to the periapsis, rad.
        periapsis: f64 = |own| own.0.elements().periapsis;
        /// float: Mean anomaly at t = 0, rad.
        mean_anomaly: f64 = |own| own.0.elements().mean_anomaly;
        /// float: μ of the centre, m³/s².
        gravitational_parameter: f64 = |own| own.0.elements().gravitational_parameter;
        /// float: Mean motion n = √(μ/a³), rad/s.
        mean_motion: f64 = |own| own.0.mean_motion();
        /// float: Time of one revolution, s.
        period: f64 = |own| std::f64::consts::TAU / own.0.mean_motion();
    }
}

impl Orbit {
    /// Vectors at one time, shape (3,), or at several, shape (n, 3).
    fn vectors<'py>(
        &self,
        t: &Bound<'py, PyAny>,
        vector: impl Fn(f64) -> Vector3<f64>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let py = t.py();
        let (scalar, times) = times("t", t)?;
        for t in &times {
            finite("t", *t)?;
        }
        if scalar {
            return Ok(vector_array(py, &vector(times[0])));
        }
        let values = times.iter().flat_map(|t| <[f64; 3]>::from(vector(*t))).collect();
        Ok(array(py, values, &[times.len(), 3])?.into_any())
    }
}

#[pymethods]
impl Orbit {
    #[new]
    #[pyo3(signature = (
        semi_major_axis, eccentricity=0.0, inclination=0.0, ascending_node=0.0, periapsis=0.0, mean_anomaly=0.0,
        gravitational_parameter=Elements::EARTH
    ))]
    fn new(
        semi_major_axis: f64,
        eccentricity: f64,
        inclination: f64,
        ascending_node: f64,
        periapsis: f64,
        mean_anomaly: f64,
        gravitational_parameter: f64,
    ) -> Result<Self, Error> {
        let elements = Elements {
            gravitational_parameter,
            semi_major_axis,
            eccentricity,
            inclination,
            ascending_node,
            periapsis,
            mean_anomaly,
        };
        Ok(Self(orbit::Orbit::try_new(elements)?))
    }

    /// Position from the centre.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (n,)
    ///     Time, s.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (3,) or (n, 3)
    ///     Position, world frame, m.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.forces.Orbit(7e6, 0.1).position([0.0]).round()
    /// array([[6300000.,       0.,       0.]])
    fn position<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.vectors(t, |t| self.0.at(t).0)
    }

    /// Velocity.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (n,)
    ///     Time, s.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (3,) or (n, 3)
    ///     Velocity, world frame, m/s.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.forces.Orbit(7e6).velocity(0.0).round(1)
    /// array([   0. , 7546.1,    0. ])
    fn velocity<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.vectors(t, |t| self.0.at(t).1)
    }

    /// Orientation of the frame of the orbit.
    ///
    /// Parameters
    /// ----------
    /// t : float
    ///     Time, s.
    ///
    /// Returns
    /// -------
    /// Rotation
    ///     Rotation from the frame of the orbit, x outwards, y ahead and z normal to the orbit, to the world.
    ///
    /// Examples
    /// --------
    /// A satellite that points to the earth, on a circle:
    ///
    /// >>> import somersault
    /// >>> orbit = somersault.forces.Orbit(7e6)
    /// >>> rate = (0.0, 0.0, orbit.mean_motion)
    /// >>> start = somersault.State(orientation=orbit.frame(0.0), angular_velocity=rate)
    fn frame<'py>(&self, py: Python<'py>, t: f64) -> Result<Bound<'py, PyAny>, Error> {
        let frame = self.0.frame(finite("t", t)?);
        let quaternion = numpy::PyArray1::from_slice(py, &components(&frame));
        Ok(rotation(quaternion.as_any())?)
    }

    fn __repr__(&self) -> String {
        let e = self.0.elements();
        format!(
            "Orbit({:?}, eccentricity={:?}, inclination={:?}, ascending_node={:?}, periapsis={:?}, mean_anomaly={:?}, \
             gravitational_parameter={:?})",
            e.semi_major_axis,
            e.eccentricity,
            e.inclination,
            e.ascending_node,
            e.periapsis,
            e.mean_anomaly,
            e.gravitational_parameter
        )
    }
}

/// Torque of the gradient of gravity on an orbit: M = 3 μ/r⁵ r × (I r).
///
/// It acts on the orientation alone; gravity, which keeps the satellite on its orbit, is not among the forces, and the position of the
/// state stays what the other forces make of it.
///
/// Parameters
/// ----------
/// orbit : Orbit
///     The orbit.
///
/// Notes
/// -----
/// On a circle ½ ω·I ω + 3/2 n² r̂·I r̂ − n L·ẑ is constant, ẑ the normal of the orbit.
///
/// Source: P. C. Hughes, Spacecraft Attitude Dynamics, Wiley 1986, chapter 8.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import forces
/// >>> orbit, satellite = forces.Orbit(7e6), somersault.RigidBody(12.0, (0.3, 0.2, 0.4))
/// >>> tilted = somersault.State(orientation=(0.0, 0.0, 0.1, 1.0))
/// >>> force, torque = forces.GravityGradient(orbit).wrench(0.0, satellite, tilted)
/// >>> float(f"{torque[2]:.3g}")
/// 6.77e-08
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct GravityGradient(satellite::GravityGradient);

value! {
    impl GravityGradient(orbit) {
        /// Orbit: The orbit.
        orbit: Orbit = |own| Orbit(own.0.orbit);
    }
}

#[pymethods]
impl GravityGradient {
    #[new]
    fn new(orbit: Orbit) -> PyClassInitializer<Self> {
        build(satellite::GravityGradient { orbit: orbit.0 }, Self)
    }

    fn __repr__(&self) -> String {
        format!("GravityGradient({})", self.orbit().__repr__())
    }
}

/// Torque on a magnetic dipole fixed in the body: M = (R m) × B.
///
/// The field is the same everywhere, or that of a dipole p at the centre of an orbit, B = (3 (p·r̂) r̂ − p)/r³.
///
/// Parameters
/// ----------
/// moment : array_like, shape (3,)
///     m, body frame, A m².
/// field : array_like, shape (3,)
///     B, world frame, T; with an orbit p, T m³, which for the earth is about 7.8e15 towards the geographic south.
/// orbit : Orbit, optional
///     The orbit on which the field of a dipole is met.
///
/// Notes
/// -----
/// In a uniform field the energy ½ ω·I ω − m·B and L·B are constant.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import forces
/// >>> magnet = forces.MagneticDipole((0.0, 0.0, 2.0), (3e-5, 0.0, 0.0))
/// >>> force, torque = magnet.wrench(0.0, somersault.RigidBody.sphere(1.0, 0.1), somersault.State())
/// >>> torque
/// array([0.e+00, 6.e-05, 0.e+00])
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct MagneticDipole(satellite::MagneticDipole);

value! {
    impl MagneticDipole(moment, field, orbit) {
        /// ndarray, shape (3,): m, body frame, A m².
        moment: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.moment);
        /// ndarray, shape (3,): B, T, or with an orbit p, T m³, world frame.
        field: Bound<'py, PyAny> = |own, py| match &own.0.field {
            Field::Uniform(field) => vector_array(py, field),
            Field::Dipole { strength, .. } => vector_array(py, strength),
        };
        /// Orbit or None: The orbit on which the field of a dipole is met.
        orbit: Option<Orbit> = |own| match own.0.field {
            Field::Uniform(_) => None,
            Field::Dipole { orbit, .. } => Some(Orbit(orbit)),
        };
    }
}

#[pymethods]
impl MagneticDipole {
    #[new]
    #[pyo3(signature = (moment, field, orbit=None))]
    fn new(
        moment: &Bound<'_, PyAny>,
        field: &Bound<'_, PyAny>,
        orbit: Option<Orbit>,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let field = vector("field", field)?;
        let field = match orbit {
            None => Field::Uniform(field),
            Some(Orbit(orbit)) => Field::Dipole { orbit, strength: field },
        };
        Ok(build(satellite::MagneticDipole { moment: vector("moment", moment)?, field }, Self))
    }

    fn __repr__(&self) -> String {
        let moment = self.0.moment.as_slice();
        match &self.0.field {
            Field::Uniform(field) => format!("MagneticDipole({moment:?}, {:?})", field.as_slice()),
            Field::Dipole { strength, .. } => {
                format!("<MagneticDipole {moment:?} on an orbit about the dipole {:?}>", strength.as_slice())
            }
        }
    }
}

/// One side of a flat part of the surface of a satellite.
///
/// Parameters
/// ----------
/// area : float
///     Area, m².
/// normal : array_like, shape (3,)
///     Outward normal, body frame, of any length.
/// centre : array_like, shape (3,), optional
///     Its centre from the centre of mass, body frame, m.
/// specular, diffuse : float, optional
///     Parts of the light that are reflected as by a mirror and diffusely, from 0 to 1 together.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> panel = somersault.forces.Plate(0.3, (0, 0, 2), centre=(0.5, 0, 0), specular=0.1)
/// >>> panel.normal
/// array([0., 0., 1.])
#[pyclass(frozen, eq, from_py_object, module = "somersault.forces")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Plate(satellite::Plate);

value! {
    impl Plate(area, normal, centre, specular, diffuse) {
        /// float: Area, m².
        area: f64 = |own| own.0.area();
        /// ndarray, shape (3,): Outward unit normal, body frame.
        normal: Bound<'py, PyAny> = |own, py| vector_array(py, own.0.normal());
        /// ndarray, shape (3,): Centre, body frame, m.
        centre: Bound<'py, PyAny> = |own, py| vector_array(py, own.0.centre());
        /// float: The part of the light that is reflected as by a mirror.
        specular: f64 = |own| own.0.specular();
        /// float: The part of the light that is reflected diffusely.
        diffuse: f64 = |own| own.0.diffuse();
    }
}

#[pymethods]
impl Plate {
    #[new]
    #[pyo3(signature = (area, normal, centre=None, specular=0.0, diffuse=0.0))]
    fn new(
        area: f64,
        normal: &Bound<'_, PyAny>,
        centre: Option<&Bound<'_, PyAny>>,
        specular: f64,
        diffuse: f64,
    ) -> Result<Self, Error> {
        let (normal, centre) = (vector("normal", normal)?, vector_or("centre", centre, Vector3::zeros())?);
        Ok(Self(satellite::Plate::try_new(area, normal, centre, specular, diffuse)?))
    }

    fn __repr__(&self) -> String {
        format!(
            "Plate({:?}, {:?}, centre={:?}, specular={:?}, diffuse={:?})",
            self.0.area(),
            self.0.normal().as_slice(),
            self.0.centre().as_slice(),
            self.0.specular(),
            self.0.diffuse()
        )
    }
}

/// One plate or several.
fn plates(value: &Bound<'_, PyAny>) -> Result<Vec<satellite::Plate>, Error> {
    let plate = |value: &Bound<'_, PyAny>| match value.extract::<Plate>() {
        Ok(plate) => Ok(plate.0),
        Err(_) => Err(Error::input(format!("`plates` must hold Plate, found {}", a_type(value)))),
    };
    match sequence(value) {
        Some(list) => list.try_iter()?.map(|entry| plate(&entry?)).collect(),
        None => Ok(vec![plate(value)?]),
    }
}

fn plate_list<'py>(py: Python<'py>, plates: &[satellite::Plate]) -> PyResult<Bound<'py, PyList>> {
    PyList::new(py, plates.iter().map(|plate| Plate(*plate)))
}

/// Drag of a thin atmosphere at rest on plates: F = −½ ρ C_d A max(n·v̂, 0) |v| v at the centre of each.
///
/// v is the velocity on the orbit; that of the body's turning does not enter, and plates do not shade one another.
///
/// Parameters
/// ----------
/// orbit : Orbit
///     The orbit.
/// plates : Plate or sequence of Plate
///     The surface.
/// density : float
///     ρ, kg/m³.
/// coefficient : float, optional
///     C_d, 2 to 2.5 for satellites.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import forces
/// >>> sail = forces.Plate(0.5, (0, 1, 0), centre=(0, 0, 0.4))
/// >>> drag = forces.AerodynamicDrag(forces.Orbit(6.7e6), sail, 3e-12)
/// >>> force, torque = drag.wrench(0.0, somersault.RigidBody.sphere(1.0, 0.1), somersault.State())
/// >>> float(f"{force[1]:.3g}"), float(f"{torque[0]:.3g}")
/// (-9.82e-05, 3.93e-05)
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct AerodynamicDrag(satellite::AerodynamicDrag);

value! {
    impl AerodynamicDrag(orbit, plates, density, coefficient) {
        /// Orbit: The orbit.
        orbit: Orbit = |own| Orbit(*own.0.orbit());
        /// list of Plate: The surface.
        plates: PyResult<Bound<'py, PyList>> = |own, py| plate_list(py, own.0.plates());
        /// float: ρ, kg/m³.
        density: f64 = |own| own.0.density();
        /// float: C_d.
        coefficient: f64 = |own| own.0.coefficient();
    }
}

#[pymethods]
impl AerodynamicDrag {
    #[new]
    #[pyo3(signature = (orbit, plates, density, coefficient=2.2))]
    fn new(
        orbit: Orbit,
        plates: &Bound<'_, PyAny>,
        density: f64,
        coefficient: f64,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let plates = self::plates(plates)?;
        Ok(build(satellite::AerodynamicDrag::try_new(orbit.0, plates, density, coefficient)?, Self))
    }

    fn __repr__(&self) -> String {
        let (plates, density) = (self.0.plates().len(), self.0.density());
        format!("<AerodynamicDrag on {plates} plates, {density} kg/m³, coefficient {}>", self.0.coefficient())
    }
}

/// Pressure of sunlight on plates: F = −P A max(n·s, 0) ((1 − s_r) s + 2 (s_r n·s + d_r/3) n) at the centre of each.
///
/// s is the direction to the sun, s_r and d_r are the parts reflected as by a mirror and diffusely. There is no shadow of the earth, nor of
/// one plate on another.
///
/// Parameters
/// ----------
/// sun : array_like, shape (3,)
///     Direction to the sun, world frame, of any length.
/// plates : Plate or sequence of Plate
///     The surface.
/// pressure : float, optional
///     P, N/m²; 4.54e-6, that of 1361 W/m² at the distance of the earth, unless given.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import forces
/// >>> mirror = forces.Plate(2.0, (1, 0, 0), centre=(0, 0.5, 0), specular=1.0)
/// >>> light = forces.SolarPressure((1, 0, 0), mirror)
/// >>> force, torque = light.wrench(0.0, somersault.RigidBody.sphere(1.0, 0.1), somersault.State())
/// >>> float(f"{force[0]:.4g}"), float(f"{torque[2]:.4g}")
/// (-1.816e-05, 9.08e-06)
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct SolarPressure(satellite::SolarPressure);

value! {
    impl SolarPressure(sun, plates, pressure) {
        /// ndarray, shape (3,): Unit vector to the sun, world frame.
        sun: Bound<'py, PyAny> = |own, py| vector_array(py, own.0.sun());
        /// list of Plate: The surface.
        plates: PyResult<Bound<'py, PyList>> = |own, py| plate_list(py, own.0.plates());
        /// float: P, N/m².
        pressure: f64 = |own| own.0.pressure();
    }
}

#[pymethods]
impl SolarPressure {
    #[new]
    #[pyo3(signature = (sun, plates, pressure=satellite::SolarPressure::EARTH))]
    fn new(
        sun: &Bound<'_, PyAny>,
        plates: &Bound<'_, PyAny>,
        pressure: f64,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let plates = self::plates(plates)?;
        Ok(build(satellite::SolarPressure::try_new(vector("sun", sun)?, plates, pressure)?, Self))
    }

    fn __repr__(&self) -> String {
        let (sun, plates) = (self.0.sun().as_slice(), self.0.plates().len());
        format!("<SolarPressure from {sun:?} on {plates} plates, {} N/m²>", self.0.pressure())
    }
}
