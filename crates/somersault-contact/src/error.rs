//! Errors of what users give.

use somersault_core::argument::ArgumentError;
use somersault_multibody::DynamicsError;

/// Why a law, a surface, a contact or a model body cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A coefficient of restitution that this law cannot have.
    #[error("`restitution` must be above 0 and at most 1, found {found}")]
    Restitution {
        /// The value given.
        found: f64,
    },
    /// A Poisson's ratio that no stable material has.
    #[error("`poisson_ratio` must be above -1 and at most 0.5, found {found}")]
    PoissonRatio {
        /// The value given.
        found: f64,
    },
    /// A static coefficient of friction below the kinetic one.
    #[error(
        "`static_coefficient` must be finite and at least the kinetic coefficient, {kinetic}, found {found}"
    )]
    StaticCoefficient {
        /// The value given.
        found: f64,
        /// μ.
        kinetic: f64,
    },
    /// Stretches that do not fit the contacts.
    #[error("`stretches` must have a finite vector for each of the {contacts} contacts, found {found}")]
    Stretches {
        /// What was found.
        found: String,
        /// Number of contacts.
        contacts: usize,
    },
    /// Measured forces that do not fit the contacts.
    #[error("`measured` must have a finite force for each of the {contacts} contacts, found {found}")]
    MeasuredForces {
        /// What was found.
        found: String,
        /// Number of contacts.
        contacts: usize,
    },
    /// An index of a body that is not there.
    #[error("`{argument}` must be below the number of bodies, {bodies}, found {found}")]
    NoBody {
        /// Name of the argument.
        argument: &'static str,
        /// The index given.
        found: usize,
        /// Number of bodies.
        bodies: usize,
    },
    /// A pair of spheres on one body.
    #[error("a pair of spheres must be on two bodies, found body {body} twice")]
    SameBody {
        /// The body.
        body: usize,
    },
    /// Two shapes whose distance is not smooth.
    #[error(
        "a pair must be of a ball with a ball, capsule or box, or of two capsules, one of them with a radius"
    )]
    Pair,
    /// The name of a link that is not there.
    #[error("`{argument}` must be the name of a body of the model, found `{found}`")]
    NoLink {
        /// Name of the argument.
        argument: &'static str,
        /// The name given.
        found: String,
    },
    /// A link that touches itself.
    #[error("a contact between links must be of two of them, found `{link}` twice")]
    SameLink {
        /// Name of the link.
        link: String,
    },
    /// Two contacts of one name.
    #[error("contacts must have different names, found `{name}` twice")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// The number of a contact that is not there.
    #[error("`contact` must be below the number of contacts, {contacts}, found {found}")]
    NoContact {
        /// The number given.
        found: usize,
        /// Number of contacts.
        contacts: usize,
    },
    /// A shape of which nothing touches the surface.
    #[error("`shape`: {0}")]
    Shape(#[from] UntouchableShape),
    /// The tree has no dynamics there.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// The tree cannot be joined with its platforms.
    #[error(transparent)]
    Model(#[from] somersault_multibody::ModelError),
    /// An interval without length.
    #[error("`interval` must run forward between finite times, found {found:?}")]
    Interval {
        /// The times given.
        found: [f64; 2],
    },
    /// A velocity or acceleration that is not that of its motion.
    #[error(
        "`{argument}` must be the derivative of the motion, found {found:?} at t = {t}, where differences give {differences:?}"
    )]
    NoDerivative {
        /// Name of the argument.
        argument: &'static str,
        /// When, s.
        t: f64,
        /// As it is given.
        found: [f64; 3],
        /// As the motion has it.
        differences: [f64; 3],
    },
    /// A vector that is not finite.
    #[error("`{argument}` must be finite, found {found:?}")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
        /// The value given.
        found: [f64; 3],
    },
    /// A direction without length.
    #[error("`{argument}` must be a finite vector other than zero, found {found:?}")]
    Direction {
        /// Name of the argument.
        argument: &'static str,
        /// The value given.
        found: [f64; 3],
    },
}

/// Why nothing of a shape touches a surface.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UntouchableShape {
    /// The file of a mesh is not opened.
    #[error(
        "a mesh has no contacts, since its file `{file}` is not opened; a box, capsule, cylinder or sphere has"
    )]
    Mesh {
        /// The file.
        file: String,
    },
    /// The file of a mesh is not where it was sought.
    #[error("a mesh has no contacts, since its file `{file}` is not in `{folder}`")]
    NoFile {
        /// The file.
        file: String,
        /// Where it was sought.
        folder: String,
    },
    /// The file of a mesh cannot be read, or has no convex hull of the allowed size.
    #[error("the mesh `{file}` has no contacts: {reason}")]
    Unreadable {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// No shape of contact is an ellipsoid.
    #[error("an ellipsoid has no contacts; a box, capsule, cylinder or sphere has")]
    Ellipsoid,
    /// The rims of a cylinder touch planes.
    #[error("the rims of a cylinder touch half-spaces only; a box, capsule or sphere touches any surface")]
    Curved,
    /// The middle of a capsule or an edge touches spheres and cylinders from outside only.
    #[error(
        "a capsule touches spheres and cylinders from outside, with its middle; against another surface take the balls at its ends"
    )]
    CapsuleWithoutCore,
    /// The faces of a box touch spheres.
    #[error("a box touches spheres from outside; against another surface take its corners or edges")]
    BoxWithoutCentre,
    /// A shape that is fixed in the world.
    #[error("it is fixed in the world, which does not move against the surface")]
    World,
    /// A link without a shape for collisions.
    #[error("it has no shape to collide with")]
    NoShape,
}

pub(crate) fn finite(
    argument: &'static str,
    found: nalgebra::Vector3<f64>,
) -> Result<nalgebra::Vector3<f64>, ContactError> {
    if found.iter().all(|x| x.is_finite()) {
        Ok(found)
    } else {
        Err(ContactError::NonFinite { argument, found: found.into() })
    }
}

pub(crate) fn direction(
    argument: &'static str,
    found: nalgebra::Vector3<f64>,
) -> Result<nalgebra::Unit<nalgebra::Vector3<f64>>, ContactError> {
    // Scaling by the largest component first keeps the square of a tiny or huge vector in range.
    let largest = found.amax();
    if largest.is_finite() && largest > 0.0 && found.iter().all(|x| x.is_finite()) {
        Ok(nalgebra::Unit::new_normalize(found / largest))
    } else {
        Err(ContactError::Direction { argument, found: found.into() })
    }
}
