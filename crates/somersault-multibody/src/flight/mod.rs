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
pub mod step;
mod system;

pub use changed::{ChangedFlight, FlightChange, HeldPosture, JointCurves, KnownFlight, N_CHANGES};
pub use derivatives::FlightDerivatives;
pub use system::{FlightSystem, FlightWorkspace, ShapeMotion};

use crate::data::{Data, Room};
use crate::error::DynamicsError;
use crate::inertia::SpatialInertia;
use crate::joint::{Group, Joint};
use crate::model::Model;
use crate::spatial::{Force, Motion, Transform};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::lie::so3::from_xyzw;
use somersault_core::scalar::{Scalar, constant};

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
pub struct FlightData<T: Scalar = f64> {
    nodes: Vec<Node<T>>,
    /// Of the shape set last.
    shape: Shape<T>,
    /// The axis of each degree of freedom after the root's, in axes of the root.
    columns: Vec<Motion<T>>,
    /// In tree coordinates.
    by_shape: Vec<Vector3<T>>,
    by_shape_velocity: Vec<Vector3<T>>,
    /// In independent ones, where joints follow others.
    gathered: [Vec<Vector3<T>>; 2],
    room: Room<T>,
}

/// One body, in the axes of the root about its origin, the root at rest.
#[derive(Debug, Clone, Copy)]
struct Node<T> {
    pose: Transform<T>,
    velocity: Motion<T>,
    /// Of the body and all further out.
    inertia: SpatialInertia<T>,
    /// Of the body and all further out.
    momentum: Force<T>,
}

/// What a shape and its velocities are without the orientation of the root, in its axes.
#[derive(Debug, Clone, Copy)]
struct Shape<T> {
    /// Centre of mass from the origin of the root.
    center: Vector3<T>,
    /// I⁻¹; of the normal component alone where the root is planar.
    inverse_inertia: Matrix3<T>,
    /// A ṡ, about the centre of mass.
    angular: Vector3<T>,
    /// The velocity that the joints give the centre of mass, the root at rest.
    linear: Vector3<T>,
}

/// The motion of the root that the momentum leaves, seen from the centre of mass, in axes of the root.
struct Reduced<T> {
    /// Orientation of the root, its axes → world.
    turn: Matrix3<T>,
    /// Rᵀ L.
    momentum: Vector3<T>,
    /// Of the root.
    velocity: Motion<T>,
}

impl<T: Scalar> FlightData<T> {
    /// A workspace for `model`.
    pub fn new(model: &Model<T>) -> Self {
        let node = Node {
            pose: Transform::identity(),
            velocity: Motion::zero(),
            inertia: SpatialInertia::zero(),
            momentum: Force::zero(),
        };
        let n_root = model.velocities_of(0).len();
        let n_shape = model.directions.len() - n_root;
        let (zero, none) = (Vector3::zeros(), vec![Vector3::zeros(); n_shape]);
        let n_gathered = model.coupling.as_ref().map_or(0, |_| model.n_velocities() - n_root);
        let gathered = vec![Vector3::zeros(); n_gathered];
        Self {
            nodes: vec![node; model.n_bodies()],
            shape: Shape { center: zero, inverse_inertia: Matrix3::zeros(), angular: zero, linear: zero },
            columns: vec![Motion::zero(); n_shape],
            by_shape: none.clone(),
            by_shape_velocity: none,
            gathered: [gathered.clone(), gathered],
            room: Room::new(model),
        }
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
        Ok(self.angular_velocity_of_shape(data, q))
    }

    /// The same for the shape that was [set](Self::set_shape) last: of `q` only the orientation of the root is read.
    pub fn angular_velocity_of_shape(&self, data: &FlightData<T>, q: &[T]) -> Vector3<T> {
        self.reduce(&data.shape, q).velocity.angular
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
        let Reduced { turn, velocity, .. } = self.reduce(&data.shape, q);
        let center = data.shape.center;
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

    /// Evaluates all that does not depend on the orientation of the root, for any number of orientations: O(n), and most of the
    /// work of an evaluation.
    ///
    /// Fails where the tree has no inertia about some axis.
    pub fn set_shape(&self, data: &mut FlightData<T>, q: &[T], v: &[T]) -> Result<(), DynamicsError> {
        let model = self.model;
        expect_length("q", q.len(), model.n_positions())?;
        expect_length("v", v.len(), model.n_velocities())?;
        if data.nodes.len() != model.n_bodies()
            || data.by_shape.len() + self.n_root() != model.directions.len()
        {
            return Err(DynamicsError::ForeignData);
        }
        let Room { q: q_room, v: v_room, .. } = &mut data.room;
        let (tree_q, tree_v) = (model.spread_positions(q, q_room), model.spread(v, v_room));
        self.gather(&mut data.nodes, tree_q, tree_v);
        let Node { inertia, momentum: of_shape, .. } = &data.nodes[0];
        let center = inertia.first_moment / inertia.mass;
        let about_center = inertia.rotational.full()
            - (Matrix3::from_diagonal_element(center.norm_squared()) - center * center.transpose())
                * inertia.mass;
        data.shape = Shape {
            center,
            inverse_inertia: self.invert(&about_center)?,
            angular: of_shape.about(&center).angular,
            linear: of_shape.linear / inertia.mass,
        };
        Ok(())
    }

    fn reduce(&self, shape: &Shape<T>, q: &[T]) -> Reduced<T> {
        let turn = self.placement.rotation * self.turn(q);
        let momentum = turn.tr_mul(&self.take_off.angular_momentum);
        let angular = shape.inverse_inertia * (momentum - shape.angular);
        let linear = shape.center.cross(&angular) - shape.linear;
        Reduced { turn, momentum, velocity: Motion::new(linear, angular) }
    }

    /// Writes an orientation of the root in its joint frame into a configuration; of a planar one the angle within a turn.
    fn write_orientation(&self, orientation: &UnitQuaternion<T>, q: &mut [T]) {
        if self.is_planar {
            q[2] = orientation.k.atan2(orientation.w) * constant(2.0);
        } else {
            q[3..7].copy_from_slice(orientation.coords.as_slice());
        }
    }

    /// Rotation of the root in its joint frame.
    fn turn(&self, q: &[T]) -> Matrix3<T> {
        let rotation = if self.is_planar {
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q[2])
        } else {
            from_xyzw(&q[3..7])
        };
        rotation.to_rotation_matrix().into_inner()
    }

    fn invert(&self, inertia: &Matrix3<T>) -> Result<Matrix3<T>, DynamicsError> {
        let inverse = if self.is_planar {
            let (o, normal) = (T::zero(), inertia.m33);
            (normal > o).then(|| Matrix3::from_diagonal(&Vector3::new(o, o, T::one() / normal)))
        } else {
            inertia.cholesky().map(|factor| factor.inverse())
        };
        let singular = || DynamicsError::Singular { joint: self.model.links()[0].name.clone() };
        // beyond a condition of 1/ε the inverse is rounding, or not finite
        let is_sound = |m: &Matrix3<T>| m.norm() * inertia.norm() * constant(f64::EPSILON) < T::one();
        inverse.filter(is_sound).ok_or_else(singular)
    }

    /// Poses, velocities and, gathered inwards, inertias and momenta.
    fn gather(&self, nodes: &mut [Node<T>], q: &[T], v: &[T]) {
        let bodies = &self.model.bodies;
        nodes[0] = Node {
            pose: Transform::identity(),
            velocity: Motion::zero(),
            inertia: bodies[0].inertia,
            momentum: Force::zero(),
        };
        for (i, body) in bodies.iter().enumerate() {
            let Some(parent) = body.parent else { continue };
            let pose = nodes[parent].pose.compose(&body.mechanism.transform(&q[body.q..]));
            let velocity = nodes[parent].velocity + pose.motion(&self.model.relative(body, v));
            let inertia = body.inertia.seen_from(&pose);
            nodes[i] = Node { pose, velocity, inertia, momentum: inertia.times(&velocity) };
        }
        for (i, body) in bodies.iter().enumerate().rev() {
            if let Some(parent) = body.parent {
                let Node { inertia, momentum, .. } = nodes[i];
                nodes[parent].inertia += inertia;
                nodes[parent].momentum += momentum;
            }
        }
    }
}
