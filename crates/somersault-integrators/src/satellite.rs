//! Torques and forces on a satellite: gradient of gravity, magnetic dipole, drag of a thin atmosphere, and pressure of light.
//!
//! The satellite flies on an [`Orbit`] that its attitude does not change. The position of its state, which starts at zero, is then the
//! displacement from the orbit by the forces of drag and light alone: gravity, which keeps it on the orbit, is not among them.
//!
//! ```text
//! gradient of gravity:   M = 3 μ⁄r⁵ r × (I_w r)                  (r from the centre, I_w = R I Rᵀ)
//! dipole m in a field B: M = R m × B
//! drag on a plate:       F = −½ ρ C_d A max(n·v̂, 0) |v| v,       M = R c × F
//! light on a plate:      F = −P A max(n·s, 0) ((1 − s_r) s + 2 (s_r n·s + d_r⁄3) n)
//! ```
//!
//! with n the outward normal of a plate, c its centre from the centre of mass, s the direction to the sun, s_r and d_r the parts of the light
//! that are reflected as by a mirror and diffusely. Plates do not shade one another, and no speed of the body's turning enters v.
//!
//! Sources: P. C. Hughes, *Spacecraft Attitude Dynamics*, Wiley 1986, chapter 8; F. L. Markley and J. L. Crassidis, *Fundamentals of
//! Spacecraft Attitude Determination and Control*, Springer 2014, §3.3.

use crate::body::RigidBody;
use crate::force::{ForceModel, Reach, StatesInLanes, Wrench, WrenchBound, WrenchesInLanes, add_by_times};
use crate::orbit::Orbit;
use crate::series::WrenchTerm;
use crate::state::{RigidBodyState, Twist};
use crate::variation::Tangent;
use nalgebra::Vector3;
use somersault_core::argument::{
    ArgumentError, expect_direction, expect_finite, expect_not_negative, expect_positive,
};

/// The torque of the gradient of gravity on an orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GravityGradient {
    /// The orbit.
    pub orbit: Orbit,
}

impl GravityGradient {
    /// r, and 3 μ⁄r⁵.
    fn pull(&self, t: f64) -> (Vector3<f64>, f64) {
        let (position, _) = self.orbit.at(t);
        let distance = position.norm();
        (position / distance, 3.0 * self.orbit.elements().gravitational_parameter / distance.powi(3))
    }
}

/// The torque of such a pull.
fn gradient((r, factor): &(Vector3<f64>, f64), body: &RigidBody, x: &RigidBodyState) -> Wrench {
    Wrench { force: Vector3::zeros(), torque: r.cross(&in_world(body, x, r)) * *factor }
}

/// I_w r for a direction in the world.
fn in_world(body: &RigidBody, x: &RigidBodyState, direction: &Vector3<f64>) -> Vector3<f64> {
    let turned = x.orientation().inverse_transform_vector(direction);
    x.orientation() * body.inertia().momentum(&turned)
}

impl ForceModel for GravityGradient {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        gradient(&self.pull(t), body, x)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        add_by_times(on, sums, |t| self.pull(t), gradient);
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn bound(&self, body: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        let moments = body.inertia().principal_moments();
        let factor =
            3.0 * self.orbit.elements().gravitational_parameter / self.orbit.periapsis_distance().powi(3);
        Some(WrenchBound { force: 0.0, torque: 0.5 * factor * (moments.max() - moments.min()) })
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        let (r, factor) = self.pull(t);
        let turn = &along.displacement.angular;
        let change = turn.cross(&in_world(body, x, &r)) - in_world(body, x, &turn.cross(&r));
        Wrench { force: Vector3::zeros(), torque: r.cross(&change) * factor }
    }
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

/// A magnetic field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Field {
    /// The same everywhere, world frame, T.
    Uniform(Vector3<f64>),
    /// That of a dipole at the centre of an orbit, B = (3 (p·r̂) r̂ − p)⁄r³.
    Dipole {
        /// The orbit on which it is met.
        orbit: Orbit,
        /// p, world frame, T m³: μ₀⁄4π times the dipole moment; about 7.8e15 towards the geographic south for the earth.
        strength: Vector3<f64>,
    },
}

impl Field {
    /// B at time `t`, world frame, T.
    pub fn at(&self, t: f64) -> Vector3<f64> {
        match self {
            Self::Uniform(field) => *field,
            Self::Dipole { orbit, strength } => {
                let (position, _) = orbit.at(t);
                let distance = position.norm();
                let r = position / distance;
                (r * (3.0 * strength.dot(&r)) - strength) / distance.powi(3)
            }
        }
    }
}

/// The torque on a magnetic dipole fixed in the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MagneticDipole {
    /// m, body frame, A m².
    pub moment: Vector3<f64>,
    /// B.
    pub field: Field,
}

impl MagneticDipole {
    fn torque(&self, field: &Vector3<f64>, x: &RigidBodyState) -> Wrench {
        Wrench { force: Vector3::zeros(), torque: (x.orientation() * self.moment).cross(field) }
    }
}

impl ForceModel for MagneticDipole {
    fn wrench(&self, t: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.torque(&self.field.at(t), x)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        add_by_times(on, sums, |t| self.field.at(t), |field, _, x| self.torque(field, x));
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn bound(&self, _: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        let field = match &self.field {
            Field::Uniform(field) => field.norm(),
            Field::Dipole { orbit, strength } => 2.0 * strength.norm() / orbit.periapsis_distance().powi(3),
        };
        Some(WrenchBound { force: 0.0, torque: self.moment.norm() * field })
    }
    fn potential(&self, _: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        match &self.field {
            Field::Uniform(field) => Some(-(x.orientation() * self.moment).dot(field)),
            Field::Dipole { .. } => None,
        }
    }
    fn wrench_variation(&self, t: f64, _: &RigidBody, x: &RigidBodyState, along: &Tangent<Twist>) -> Wrench {
        let change = along.displacement.angular.cross(&(x.orientation() * self.moment));
        Wrench { force: Vector3::zeros(), torque: change.cross(&self.field.at(t)) }
    }
    /// In a uniform field, m × B: the torque of a force B at the point m.
    fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        match &self.field {
            Field::Uniform(field) => {
                terms.push(WrenchTerm::ForceAtPoint { force: *field, point: self.moment });
                terms.push(WrenchTerm::Force(-field));
                true
            }
            Field::Dipole { .. } => false,
        }
    }
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

/// One side of a flat part of the surface of a satellite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plate {
    area: f64,
    normal: Vector3<f64>,
    centre: Vector3<f64>,
    specular: f64,
    diffuse: f64,
}

impl Plate {
    /// A plate of some area (m²) with its outward normal, of any length, and its centre (m) in the body frame, and the parts of the
    /// light that it reflects as a mirror and diffusely, from 0 to 1 together.
    pub fn try_new(
        area: f64,
        normal: Vector3<f64>,
        centre: Vector3<f64>,
        specular: f64,
        diffuse: f64,
    ) -> Result<Self, ArgumentError> {
        expect_positive("area", area)?;
        let normal = expect_direction("normal", normal)?;
        expect_finite("centre", centre.iter())?;
        expect_not_negative("specular", specular)?;
        expect_not_negative("diffuse", diffuse)?;
        if specular + diffuse > 1.0 {
            let allowed = "at most 1 with `specular`";
            return Err(ArgumentError::OutOfRange { argument: "diffuse", allowed, found: diffuse });
        }
        Ok(Self { area, normal, centre, specular, diffuse })
    }

    /// Area, m².
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Outward unit normal, body frame.
    pub fn normal(&self) -> &Vector3<f64> {
        &self.normal
    }

    /// Centre, body frame, m.
    pub fn centre(&self) -> &Vector3<f64> {
        &self.centre
    }

    /// The part of the light that is reflected as by a mirror.
    pub fn specular(&self) -> f64 {
        self.specular
    }

    /// The part of the light that is reflected diffusely.
    pub fn diffuse(&self) -> f64 {
        self.diffuse
    }
}

/// The sum of forces on plates, given by the plate and its normal in the world.
fn on_plates(
    plates: &[Plate],
    x: &RigidBodyState,
    force: impl Fn(&Plate, &Vector3<f64>) -> Vector3<f64>,
) -> Wrench {
    plates.iter().fold(Wrench::default(), |sum, plate| {
        let force = force(plate, &(x.orientation() * plate.normal));
        sum + Wrench { force, torque: (x.orientation() * plate.centre).cross(&force) }
    })
}

/// The bound where the force on each plate is at most its area times a pressure.
fn plates_bound(plates: &[Plate], pressure: f64) -> WrenchBound {
    plates.iter().fold(WrenchBound::default(), |sum, plate| {
        let force = plate.area * pressure;
        sum + WrenchBound { force, torque: force * plate.centre.norm() }
    })
}

/// Drag of a thin atmosphere at rest in the world on plates.
#[derive(Debug, Clone, PartialEq)]
pub struct AerodynamicDrag {
    orbit: Orbit,
    plates: Vec<Plate>,
    density: f64,
    coefficient: f64,
}

impl AerodynamicDrag {
    /// On plates, by the density of the atmosphere (kg/m³) and the drag coefficient C_d, 2 to 2.5 for satellites.
    pub fn try_new(
        orbit: Orbit,
        plates: Vec<Plate>,
        density: f64,
        coefficient: f64,
    ) -> Result<Self, ArgumentError> {
        expect_not_negative("density", density)?;
        expect_not_negative("coefficient", coefficient)?;
        Ok(Self { orbit, plates, density, coefficient })
    }

    /// The orbit.
    pub fn orbit(&self) -> &Orbit {
        &self.orbit
    }

    /// The plates.
    pub fn plates(&self) -> &[Plate] {
        &self.plates
    }

    /// Density of the atmosphere, kg/m³.
    pub fn density(&self) -> f64 {
        self.density
    }

    /// C_d.
    pub fn coefficient(&self) -> f64 {
        self.coefficient
    }

    /// The drag at a velocity of the satellite.
    fn at_velocity(&self, velocity: &Vector3<f64>, x: &RigidBodyState) -> Wrench {
        let speed = velocity.norm();
        let pressure = 0.5 * self.density * self.coefficient * speed;
        on_plates(&self.plates, x, |plate, normal| {
            velocity * (-pressure * plate.area * (normal.dot(velocity) / speed).max(0.0))
        })
    }
}

impl ForceModel for AerodynamicDrag {
    fn wrench(&self, t: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.at_velocity(&self.orbit.at(t).1, x)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        add_by_times(on, sums, |t| self.orbit.at(t).1, |velocity, _, x| self.at_velocity(velocity, x));
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn bound(&self, _: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        // the greatest speed, at the periapsis
        let (e, n) = (self.orbit.elements().eccentricity, self.orbit.mean_motion());
        let speed_squared = (n * self.orbit.elements().semi_major_axis).powi(2) * (1.0 + e) / (1.0 - e);
        Some(plates_bound(&self.plates, 0.5 * self.density * self.coefficient * speed_squared))
    }
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

/// Pressure of sunlight on plates, without the shadow of the earth.
#[derive(Debug, Clone, PartialEq)]
pub struct SolarPressure {
    sun: Vector3<f64>,
    plates: Vec<Plate>,
    pressure: f64,
}

impl SolarPressure {
    /// The pressure at the distance of the earth from the sun, N/m²: 1361 W/m² by the speed of light.
    pub const EARTH: f64 = 4.54e-6;

    /// On plates, with the direction to the sun, world frame and of any length, and the pressure P, N/m².
    pub fn try_new(sun: Vector3<f64>, plates: Vec<Plate>, pressure: f64) -> Result<Self, ArgumentError> {
        let sun = expect_direction("sun", sun)?;
        expect_not_negative("pressure", pressure)?;
        Ok(Self { sun, plates, pressure })
    }

    /// Unit vector to the sun, world frame.
    pub fn sun(&self) -> &Vector3<f64> {
        &self.sun
    }

    /// The plates.
    pub fn plates(&self) -> &[Plate] {
        &self.plates
    }

    /// P, N/m².
    pub fn pressure(&self) -> f64 {
        self.pressure
    }
}

impl ForceModel for SolarPressure {
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        on_plates(&self.plates, x, |plate, normal| {
            let lit = normal.dot(&self.sun).max(0.0);
            let along_sun = self.sun * (1.0 - plate.specular);
            let along_normal = normal * (2.0 * (plate.specular * lit + plate.diffuse / 3.0));
            (along_sun + along_normal) * (-self.pressure * plate.area * lit)
        })
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn bound(&self, _: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        // at most twice the pressure, of a mirror that faces the sun
        Some(plates_bound(&self.plates, 2.0 * self.pressure))
    }
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}
