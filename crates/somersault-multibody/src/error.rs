//! What can be wrong with the arguments of an algorithm.

use somersault_core::argument::ArgumentError;
/// Why an algorithm has no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DynamicsError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The workspace was made for a model of another size.
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
}
