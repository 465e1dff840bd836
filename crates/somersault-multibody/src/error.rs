//! What can be wrong with a model, and with the arguments of an algorithm.

use somersault_core::argument::ArgumentError;

/// Why a body cannot be part of a model. Every variant names the body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A model needs a body.
    #[error("the model has no body")]
    Empty,
    /// Two bodies of one name.
    #[error("a body named `{name}` was added before")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// The parent is not among the bodies added before.
    #[error("the parent `{parent}` of `{name}` is not among the bodies added before it")]
    UnknownParent {
        /// The body.
        name: String,
        /// The parent requested.
        parent: String,
    },
    /// A tree has one root.
    #[error("`{name}` has no parent, but `{root}` is the root already")]
    SecondRoot {
        /// The body.
        name: String,
        /// The root.
        root: String,
    },
    /// A number is NaN or infinite.
    #[error("`{argument}` of `{name}` must be finite")]
    NonFinite {
        /// The body.
        name: String,
        /// Name of the quantity.
        argument: &'static str,
    },
    /// A mass or a damping coefficient is negative.
    #[error("`{argument}` of `{name}` must not be negative, found {found}")]
    Negative {
        /// The body.
        name: String,
        /// Name of the quantity.
        argument: &'static str,
        /// Its value.
        found: f64,
    },
    /// The size of a named model is zero or negative.
    #[error("`{argument}` of `{name}` must be positive and finite, found {found}")]
    NotPositive {
        /// The model.
        name: String,
        /// Name of the quantity.
        argument: &'static str,
        /// Its value.
        found: f64,
    },
    /// The inertia tensor is not symmetric.
    #[error("the inertia of `{name}` is not symmetric")]
    AsymmetricInertia {
        /// The body.
        name: String,
    },
    /// No distribution of mass has these principal moments: one is negative, or exceeds the sum of the
    /// other two, or the body has no mass.
    #[error("`{name}` of mass {mass} cannot have the principal moments {moments:?}")]
    NonPhysicalInertia {
        /// The body.
        name: String,
        /// Its mass.
        mass: f64,
        /// Its principal moments.
        moments: [f64; 3],
    },
    /// The joint of the body moves no mass at all, neither its own nor further out.
    #[error("the joint of `{name}` carries no mass")]
    CarriesNoMass {
        /// The body.
        name: String,
    },
    /// The axis of a joint is zero.
    #[error("the joint axis of `{name}` is zero")]
    ZeroAxis {
        /// The body.
        name: String,
    },
    /// The rotation of a placement is not of unit norm.
    #[error("the placement of `{name}` is not a unit quaternion, its norm is {found}")]
    NotARotation {
        /// The body.
        name: String,
        /// Norm of the quaternion.
        found: f64,
    },
    /// The lower limit exceeds the upper one.
    #[error("the limits of `{name}` cross: lower {lower}, upper {upper}")]
    LimitsCrossed {
        /// The body.
        name: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The joint that another one follows carries none of the bodies.
    #[error("the joint of `{name}` follows that of `{leader}`, which is not among the bodies")]
    UnknownLeader {
        /// The body whose joint follows.
        name: String,
        /// The body whose joint was to lead.
        leader: String,
    },
    /// Only revolute and prismatic joints lead and follow.
    #[error("the joint of `{name}` has no single coordinate to lead or to follow")]
    NoSingleCoordinate {
        /// The body.
        name: String,
    },
    /// A joint follows itself.
    #[error("the joint of `{name}` follows one that follows it")]
    MimicCycle {
        /// The body.
        name: String,
    },
    /// A diver has no such segment.
    #[error("a segment of a diver must be one of {known}, found `{name}`")]
    UnknownSegment {
        /// The name.
        name: String,
        /// Those there are.
        known: String,
    },
    /// Only revolute and prismatic joints have limits.
    #[error("the joint of `{name}` has no single coordinate to limit")]
    LimitsNotApplicable {
        /// The body.
        name: String,
    },
}

/// Why an algorithm has no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DynamicsError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The workspace was made for a model of another size, or with other parents.
    #[error("`data` was made for another model; make it with `Data::new` from this one")]
    ForeignData,
    /// The body is not one of this model.
    #[error("body number {found} does not exist, the model has {n_bodies}")]
    NoSuchBody {
        /// Number given.
        found: usize,
        /// Bodies of the model.
        n_bodies: usize,
    },
    /// There is no body of this name.
    #[error("no body is named `{name}`")]
    UnknownBody {
        /// Name given.
        name: String,
    },
    /// A derivative by the placement of a joint, where wrenches are functions of the poses of bodies.
    #[error(
        "no derivative by the placement of a joint: the forces exert wrenches on bodies, which depend on it"
    )]
    PlacementUnderWrenches,
    /// A quaternion is zero or not finite.
    #[error("the quaternion of joint `{joint}` is zero or not finite")]
    NoRotation {
        /// Name of the body that the joint carries.
        joint: String,
    },
    /// At this configuration some motion of the joint moves no mass, or a number is not finite.
    #[error("the mass matrix is singular, or not finite, at joint `{joint}`")]
    Singular {
        /// Name of the body that the joint carries.
        joint: String,
    },
    /// One of many states has no result: the first one that has none.
    #[error("state {index}: {source}")]
    InState {
        /// Number of the state, from 0.
        index: usize,
        /// Why.
        source: Box<DynamicsError>,
    },
}
