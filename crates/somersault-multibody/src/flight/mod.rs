//! Momentum-reduced flight: a tree in the air whose joints move as prescribed.
//!
//! Uniform gravity leaves the centre of mass c on its parabola and the angular momentum L about it
//! constant. With the shape s (all joints but the root's) given in time, only the orientation R of the
//! root is left to find, and for that the momentum suffices:
//!
//! ```text
//! c(t) = c₀ + ċ₀ (t − t₀) + ½ g (t − t₀)²,
//! ω = I(s)⁻¹ (Rᵀ L − A(s) ṡ),   Ṙ = R ω̂
//! ```
//! I is the inertia of the tree with its joints locked, about c, and A ṡ the angular momentum of the
//! joint motion, both in the axes of the root. Position and velocity of the root follow from c. No
//! momentum is integrated, so none drifts: what a method gets wrong is the orientation alone.
//!
//! The root has a free joint, or a planar one for motion in a plane: then L counts along the normal of
//! the plane only, c and g in the plane, and the angle of the root is a mere quadrature.
//!
//! One evaluation costs O(n), its derivatives by all of the shape as well. [`FlightSystem`] is the
//! equation for R as the integrators take it; a [`KnownFlight`] is flown again with a [`FlightChange`].
//!
//! Sources: T. R. Kane and M. P. Scher, Int. J. Solids Structures 5 (1969) 663; R. Montgomery, *Gauge
//! theory of the falling cat*, Fields Institute Communications 1 (1993) 193.

mod changed;
mod derivatives;
mod second;
mod shapes;
pub mod step;
mod system;
mod tree;

pub use changed::{ChangedFlight, FlightChange, HeldPosture, JointCurves, KnownFlight, N_CHANGES};
pub use derivatives::FlightDerivatives;
pub use second::FlightSecondDerivatives;
pub use shapes::FlightShapes;
pub use system::{FlightSystem, FlightWorkspace, ShapeMotion};

use crate::data::Data;
use crate::error::DynamicsError;
use crate::joint::{Group, Joint};
use crate::model::Model;
use crate::spatial::Transform;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::scalar::{Scalar, constant};
use tree::{FlightTree, Reduced};

/// Why a tree cannot be reduced by its momentum.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// The root is held.
    #[error("the root `{root}` must have a free or a planar joint to fly, found {found:?}")]
    Held {
        /// Name of the root.
        root: String,
        /// Its joint.
        found: Joint,
    },
    /// Friction on the joint of the root would change the momentum.
    #[error("the joint of the root `{root}` must have no damping to fly")]
    Damped {
        /// Name of the root.
        root: String,
    },
    /// Joints that curves do not have.
    #[error(
        "the joints of a flight that is flown again are revolute, prismatic or spherical, but that of `{body}` is {joint}"
    )]
    Joint {
        /// The body it carries.
        body: String,
        /// Its kind.
        joint: &'static str,
    },
    /// An argument is NaN or infinite.
    #[error("`{argument}` must be finite")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
    },
    /// The last run of a path was made without the derivatives that something reads.
    #[error("`{reader}` reads the derivatives of the last run, which was made without them")]
    NoDerivatives {
        /// What reads them.
        reader: &'static str,
    },
    /// An argument does not fit the tree.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
}

/// Where a flight comes from: what it keeps, and its start on the parabola.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TakeOff<T = f64> {
    /// t₀, s.
    pub time: T,
    /// c₀, centre of mass in the world, m.
    pub center_of_mass: Vector3<T>,
    /// ċ₀, its velocity, m/s.
    pub velocity: Vector3<T>,
    /// L, angular momentum about the centre of mass, world axes, kg m²/s.
    pub angular_momentum: Vector3<T>,
}

/// A tree in flight.
#[derive(Debug, Clone, Copy)]
pub struct Flight<'m, T: Scalar = f64> {
    model: &'m Model<T>,
    take_off: TakeOff<T>,
    is_planar: bool,
    /// Of the joint frame of the root in the world.
    placement: Transform<T>,
}

/// Room for the evaluations of a flight, made once for a model and used repeatedly.
#[derive(Debug, Clone)]
pub struct FlightData<T: Scalar = f64>(FlightTree<T>);

impl<T: Scalar> FlightData<T> {
    /// A workspace for `model`.
    pub fn new(model: &Model<T>) -> Self {
        Self(FlightTree::new((), model))
    }
}

impl<'m, T: Scalar> Flight<'m, T> {
    /// The flight of `model` from its take-off.
    pub fn try_new(model: &'m Model<T>, take_off: TakeOff<T>) -> Result<Self, FlightError> {
        let link = &model.links()[0];
        let root = || link.name.clone();
        let is_planar = match link.joint.group() {
            Group::Motions => false,
            Group::PlanarMotions => true,
            Group::Vector | Group::Rotations => {
                return Err(FlightError::Held { root: root(), found: link.joint });
            }
        };
        if model.damping[model.velocities_of(0)].iter().any(|d| *d != T::zero()) {
            return Err(FlightError::Damped { root: root() });
        }
        let TakeOff { time, center_of_mass, velocity, angular_momentum } = &take_off;
        for (argument, numbers) in [
            ("time", std::slice::from_ref(time)),
            ("center_of_mass", center_of_mass.as_slice()),
            ("velocity", velocity.as_slice()),
            ("angular_momentum", angular_momentum.as_slice()),
        ] {
            if !numbers.iter().all(|x| x.is_finite()) {
                return Err(FlightError::NonFinite { argument });
            }
        }
        let placement = link.placement();
        let placement =
            Transform::new(nalgebra::convert(placement.rotation), nalgebra::convert(placement.translation));
        Ok(Self { model, take_off, is_planar, placement })
    }

    /// The flight that passes through the positions `q` and velocities `v` at time `t`.
    pub fn from_state(model: &'m Model<T>, t: T, q: &[T], v: &[T]) -> Result<Self, FlightError> {
        let mut data = Data::new(model);
        expect_length("v", v.len(), model.n_velocities()).map_err(DynamicsError::from)?;
        let centroidal = model.centroidal(&mut data, q)?;
        let momentum = centroidal.momentum(v)?;
        let take_off = TakeOff {
            time: t,
            center_of_mass: centroidal.center_of_mass,
            velocity: momentum.linear / model.mass(),
            angular_momentum: momentum.angular,
        };
        Self::try_new(model, take_off)
    }

    /// The tree.
    pub fn model(&self) -> &'m Model<T> {
        self.model
    }

    /// Where it comes from.
    pub fn take_off(&self) -> &TakeOff<T> {
        &self.take_off
    }

    /// c(t), m, in the world.
    pub fn center_of_mass(&self, t: T) -> Vector3<T> {
        let TakeOff { time, center_of_mass, velocity, .. } = &self.take_off;
        let t = t - *time;
        center_of_mass + (velocity + self.model.gravity * (t * constant(0.5))) * t
    }

    /// ċ(t), m/s, in the world.
    pub fn center_of_mass_velocity(&self, t: T) -> Vector3<T> {
        self.take_off.velocity + self.model.gravity * (t - self.take_off.time)
    }

    /// ω, the angular velocity of the root in its axes, rad/s.
    ///
    /// Of `q` the orientation of the root and the shape are read, of `v` the velocities of the shape.
    /// Fails where the tree has no inertia about some axis.
    pub fn angular_velocity(
        &self,
        data: &mut FlightData<T>,
        q: &[T],
        v: &[T],
    ) -> Result<Vector3<T>, DynamicsError> {
        self.set_shape(data, q, v)?;
        Ok(self.reduce(data, q).velocity.angular)
    }

    /// Writes the position of the root to `q` and its velocity to `v`, at time `t`.
    ///
    /// What is read is as in [`angular_velocity`](Self::angular_velocity). After it `q` and `v` are the
    /// whole state of the tree, with its centre of mass on the parabola and its momentum as at take-off.
    /// Accelerations and joint forces are those of
    /// [`hybrid_dynamics`](Model::hybrid_dynamics) with the root passive and all else active.
    pub fn complete(
        &self,
        data: &mut FlightData<T>,
        t: T,
        q: &mut [T],
        v: &mut [T],
    ) -> Result<(), DynamicsError> {
        self.set_shape(data, q, v)?;
        let Reduced { turn, velocity, .. } = self.reduce(data, q);
        let center = data.0.shape.center;
        let origin = self.center_of_mass(t) - turn * center - self.placement.translation;
        let position = self.placement.rotation.tr_mul(&origin);
        let linear = turn.tr_mul(&self.center_of_mass_velocity(t)) + velocity.linear;
        let n = if self.is_planar { 2 } else { 3 };
        q[..n].copy_from_slice(&position.as_slice()[..n]);
        v[..n].copy_from_slice(&linear.as_slice()[..n]);
        let angular = velocity.angular.as_slice();
        v[n..self.n_root()].copy_from_slice(if self.is_planar { &angular[2..] } else { angular });
        Ok(())
    }

    /// Degrees of freedom of the root.
    fn n_root(&self) -> usize {
        self.model.bodies[0].dofs.end
    }

    /// Where q has the orientation of the root: an angle, or a quaternion.
    fn orientation(&self) -> std::ops::Range<usize> {
        if self.is_planar { 2..3 } else { 3..7 }
    }

    /// Evaluates all that does not depend on the orientation of the root.
    fn set_shape(&self, data: &mut FlightData<T>, q: &[T], v: &[T]) -> Result<(), DynamicsError> {
        let model = self.model;
        expect_length("q", q.len(), model.n_positions())?;
        expect_length("v", v.len(), model.n_velocities())?;
        if !data.0.is_for(model) {
            return Err(DynamicsError::ForeignData);
        }
        self.set_shape_in((), &mut data.0, q, v).ok_or_else(|| self.singular())
    }

    /// The tree has no inertia about some axis.
    fn singular(&self) -> DynamicsError {
        DynamicsError::Singular { joint: self.model.links()[0].name.clone() }
    }

    fn reduce(&self, data: &FlightData<T>, q: &[T]) -> Reduced<T> {
        self.reduce_in((), &data.0.shape, &q[self.orientation()])
    }

    /// Writes the numbers of an orientation of the root in its joint frame; of a planar one the angle within a turn.
    fn write_orientation(&self, orientation: &UnitQuaternion<T>, numbers: &mut [T]) {
        if self.is_planar {
            numbers[0] = orientation.k.atan2(orientation.w) * constant(2.0);
        } else {
            numbers.copy_from_slice(orientation.coords.as_slice());
        }
    }
}
