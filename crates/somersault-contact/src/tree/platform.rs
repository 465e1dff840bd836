//! Surfaces that move as given functions of time: bodies beside the tree that are driven.
//!
//! A surface with a pose that is a function of time would make gaps, guards and bounds functions of time besides. A driven body
//! has its pose and velocity in the state, so that all of them stay functions of the state: touch-downs are located, and steps
//! proved clear, as on any body that carries a surface.

use crate::error::ContactError;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::argument::expect_length;
use somersault_multibody::motion::{Driven, TreeForces, TreeSystem};
use somersault_multibody::{Joint, Link, MassProperties, Model, Split};

/// How a platform stands and moves at a time, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlatformMotion {
    /// Its origin, m.
    pub position: Vector3<f64>,
    /// From its axes to those of the world.
    pub orientation: UnitQuaternion<f64>,
    /// Velocity of its origin, m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Acceleration of its origin, m/s².
    pub acceleration: Vector3<f64>,
    /// Angular acceleration, rad/s².
    pub angular_acceleration: Vector3<f64>,
}

/// At rest in the axes of the world.
impl Default for PlatformMotion {
    fn default() -> Self {
        let none = Vector3::zeros();
        Self {
            position: none,
            orientation: UnitQuaternion::identity(),
            velocity: none,
            angular_velocity: none,
            acceleration: none,
            angular_acceleration: none,
        }
    }
}

/// The largest difference between a derivative and a difference quotient, relative to its largest value.
const TOLERANCE: f64 = 1e-3;
/// How many roundings of a motion and its time a difference quotient may have.
const ROUNDINGS: f64 = 4.0;
/// The number of times at which derivatives are compared with difference quotients.
const TIMES: usize = 9;

impl PlatformMotion {
    /// Whether velocities and accelerations are the derivatives of a motion: to 10⁻³ of their largest values, or 10⁻⁶, or the
    /// rounding of the motion, by central differences of the fourth order at nine times of an interval.
    pub fn check<E: From<ContactError>>(
        motion: impl Fn(f64) -> Result<Self, E>,
        (start, end): (f64, f64),
    ) -> Result<(), E> {
        if !(start.is_finite() && end.is_finite() && start < end) {
            return Err(ContactError::Interval { found: [start, end] }.into());
        }
        let step = 1e-5 * (end - start);
        let time = |k: usize| start + (end - start) * (k as f64 + 0.5) / TIMES as f64;
        let mut seen = Vec::with_capacity(TIMES);
        for k in 0..TIMES {
            let t = time(k);
            let around = |step: f64| Ok::<_, E>([motion(t - step)?, motion(t + step)?]);
            seen.push((t, motion(t)?, around(step)?, around(2.0 * step)?));
        }
        type Of = fn(&PlatformMotion) -> Vector3<f64>;
        type Size = fn(&PlatformMotion) -> f64;
        type Between<'a> = &'a dyn Fn(&[PlatformMotion; 2]) -> Vector3<f64>;
        let rate = |of: Of| move |[a, b]: &[Self; 2]| of(b) - of(a);
        let turn = |[a, b]: &[Self; 2]| (b.orientation * a.orientation.inverse()).scaled_axis();
        let (of_place, of_velocity, of_spin) =
            (rate(|m| m.position), rate(|m| m.velocity), rate(|m| m.angular_velocity));
        let rows: [(&'static str, Of, Size, Between<'_>); 4] = [
            ("velocity", |m| m.velocity, |m| m.position.norm(), &of_place),
            ("acceleration", |m| m.acceleration, |m| m.velocity.norm(), &of_velocity),
            ("angular_velocity", |m| m.angular_velocity, |_| 1.0, &turn),
            ("angular_acceleration", |m| m.angular_acceleration, |m| m.angular_velocity.norm(), &of_spin),
        ];
        for (argument, of, size, difference) in rows {
            let largest = seen.iter().fold(0.0_f64, |largest, (_, at, ..)| largest.max(of(at).norm()));
            for (t, at, near, far) in &seen {
                let (found, differences) =
                    (of(at), (difference(near) * 8.0 - difference(far)) / (12.0 * step));
                let rounding = ROUNDINGS * f64::EPSILON * (size(at) + t.abs() * largest) / step;
                let off = (found - differences).norm();
                if off.is_nan() || off > TOLERANCE * largest + 1e-6 + rounding {
                    let (found, differences) = (found.into(), differences.into());
                    return Err(ContactError::NoDerivative { argument, t: *t, found, differences }.into());
                }
            }
        }
        Ok(())
    }

    /// q of a free joint: its origin, and the quaternion x, y, z, w.
    fn positions(&self) -> [f64; 7] {
        let ([x, y, z], [i, j, k, w]) = (self.position.into(), self.orientation.coords.into());
        [x, y, z, i, j, k, w]
    }

    /// v of a free joint, in its own axes.
    fn velocities(&self) -> [f64; 6] {
        let back = |v: &Vector3<f64>| self.orientation.inverse_transform_vector(v);
        joined(back(&self.velocity), back(&self.angular_velocity))
    }

    /// v̇ of a free joint: of v = Rᵀ ṙ it is Rᵀ (r̈ − ω × ṙ).
    fn accelerations(&self) -> [f64; 6] {
        let back = |v: &Vector3<f64>| self.orientation.inverse_transform_vector(v);
        let linear = self.acceleration - self.angular_velocity.cross(&self.velocity);
        joined(back(&linear), back(&self.angular_acceleration))
    }
}

fn joined(linear: Vector3<f64>, angular: Vector3<f64>) -> [f64; 6] {
    let ([a, b, c], [d, e, f]) = (linear.into(), angular.into());
    [a, b, c, d, e, f]
}

/// A tree, and platforms beside it that move as given functions of time.
///
/// Each platform is a body of the model on a free joint. The tree's positions and velocities come first, then those of
/// the platforms; [`LinkContact::on`](super::LinkContact::on) fixes a surface in one. The platforms are integrated with the tree, so
/// that they follow their motions to the accuracy of the method. Each has the mass of the tree, which has no effect on the motion,
/// and the root of the tree is a child of a fixed body, `STAND`.
///
/// ```
/// use nalgebra::{Matrix3, Vector3};
/// use somersault_contact::contacts::Contact;
/// use somersault_contact::laws::compliant::CompliantLaw;
/// use somersault_contact::surface::HalfSpace;
/// use somersault_contact::tree::{LinkContact, PlatformMotion, TreeInContact, TreeOnPlatforms};
/// use somersault_integrators::driver::{Adaptive, Steps};
/// use somersault_integrators::{events::Location, methods::Method, run::Run};
/// use somersault_multibody::{Joint, Link, MassProperties, Model};
/// use std::sync::Arc;
///
/// // A mass on a spring law, on a table that moves up and down.
/// let mut builder = Model::builder();
/// let mass = MassProperties { mass: 2.0, center: Vector3::zeros(), inertia: Matrix3::identity() * 0.01 };
/// builder.add(Link::root("mass", Joint::Prismatic { axis: Vector3::z() }, mass))?;
/// let scene = TreeOnPlatforms::try_new(&builder.build()?, &["table"])?;
/// let motion = |t: f64, _: usize| PlatformMotion {
///     position: Vector3::z() * 1e-3 * (20.0 * t).sin(),
///     velocity: Vector3::z() * 20e-3 * (20.0 * t).cos(),
///     acceleration: Vector3::z() * -0.4 * (20.0 * t).sin(),
///     ..PlatformMotion::default()
/// };
/// let (q, v) = scene.start(&[-2.0 * 9.81 / 2e3], &[0.0], |k| motion(0.0, k))?;
/// let touch = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), CompliantLaw::try_new(2e3, 0.0)?)?;
/// let touches = vec![LinkContact::new("foot", "mass", touch).on("table")];
/// let system = TreeInContact::try_new(scene.system((), motion)?, touches, vec![])?;
/// let start = system.unstretched(scene.model().state(&q, &v)?);
/// let steps = Steps::adapted((0.0, 0.5), Adaptive::with_tolerances(1e-11, 1e-11));
/// let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start)?;
/// // z + m g/k of z̈ = −k/m (z − a sin ωt) − g from rest.
/// let (rate, w) = (1e3_f64.sqrt(), 20.0);
/// let swing = 1e-3 * rate / (rate * rate - w * w) * (rate * (w * 0.5).sin() - w * (rate * 0.5).sin());
/// assert!((run.state.configuration.0.as_slice()[0] + 2.0 * 9.81 / 2e3 - swing).abs() < 1e-10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct TreeOnPlatforms {
    model: Model,
    /// Numbers of q and v of the tree.
    of_tree: [usize; 2],
    platforms: usize,
}

impl TreeOnPlatforms {
    /// Name of the fixed body that carries the tree and the platforms.
    pub const STAND: &'static str = "stand of platforms";

    /// A tree beside platforms of these names.
    pub fn try_new(model: &Model, names: &[&str]) -> Result<Self, ContactError> {
        let mass = model.mass();
        let solid =
            MassProperties { mass, center: Vector3::zeros(), inertia: Matrix3::from_diagonal_element(mass) };
        let mut builder = Model::builder().with_gravity(*model.gravity());
        builder.add(Link::root(Self::STAND, Joint::Fixed, MassProperties::massless()))?;
        for link in model.links() {
            builder.add(if link.parent().is_none() {
                link.clone().carried_by(Self::STAND)
            } else {
                link.clone()
            })?;
        }
        for name in names {
            builder.add(Link::child(*name, Self::STAND, Joint::Free, solid))?;
        }
        let of_tree = [model.n_positions(), model.n_velocities()];
        Ok(Self { model: builder.build()?, of_tree, platforms: names.len() })
    }

    /// The tree with its platforms.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Number of platforms.
    pub fn platforms(&self) -> usize {
        self.platforms
    }

    /// q and v of all, by those of the tree and by how each platform moves.
    pub fn start(
        &self,
        q: &[f64],
        v: &[f64],
        motion: impl Fn(usize) -> PlatformMotion,
    ) -> Result<(Vec<f64>, Vec<f64>), ContactError> {
        let [positions, velocities] = self.of_tree;
        expect_length("q", q.len(), positions)?;
        expect_length("v", v.len(), velocities)?;
        let (mut q, mut v) = (q.to_vec(), v.to_vec());
        for k in 0..self.platforms {
            let motion = motion(k);
            q.extend(motion.positions());
            v.extend(motion.velocities());
        }
        Ok((q, v))
    }

    /// Which degrees of freedom follow a motion: those of the platforms.
    pub fn split(&self) -> Split {
        Split::new((0..self.model.n_velocities()).map(|i| i >= self.of_tree[1]).collect())
    }

    /// Writes the accelerations of the platforms among those of all; the others are unchanged.
    pub fn write_accelerations(&self, motion: impl Fn(usize) -> PlatformMotion, out: &mut [f64]) {
        let of_platforms = out.get_mut(self.of_tree[1]..).unwrap_or_default();
        for (k, out) in of_platforms.chunks_exact_mut(6).enumerate() {
            out.copy_from_slice(&motion(k).accelerations());
        }
    }

    /// The tree under forces beside its platforms, of which `motion` says by time and number how they move.
    #[expect(clippy::type_complexity, reason = "the function that drives the platforms has no name")]
    pub fn system<F: TreeForces>(
        &self,
        forces: F,
        motion: impl Fn(f64, usize) -> PlatformMotion,
    ) -> Result<TreeSystem<'_, F, Driven<impl Fn(f64, &[f64], &[f64], &mut [f64])>>, ContactError> {
        let accelerate = move |t: f64, _: &[f64], _: &[f64], out: &mut [f64]| {
            self.write_accelerations(|k| motion(t, k), out);
        };
        Ok(TreeSystem::new(&self.model, forces).driven(self.split(), accelerate)?)
    }
}
