//! What can be wrong with the arguments of an algorithm.

/// Why an algorithm has no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DynamicsError {
    /// An argument has the wrong number of entries.
    #[error("`{argument}` must have {expected} entries, found {found}")]
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Entries the model asks for.
        expected: usize,
        /// Entries given.
        found: usize,
    },
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

/// Fails unless an argument has as many entries as the model asks for.
#[inline(always)]
pub(crate) fn expect_length<T>(
    argument: &'static str,
    given: &[T],
    expected: usize,
) -> Result<(), DynamicsError> {
    if given.len() == expected {
        Ok(())
    } else {
        Err(DynamicsError::Length { argument, expected, found: given.len() })
    }
}
