//! Files of models, solutions and fitted scorers: versioned, and checked when they come back.
//!
//! A file is one document of CBOR (RFC 8949) that says which format, version and kind of thing it holds. Numbers keep all
//! their bits, infinite ones too. What has conditions is rebuilt from its parts, so that no file brings a body of negative
//! mass, a tree without a root, or a quaternion that is no rotation.
//!
//! ```
//! use somersault::multibody::models::CartPendulum;
//! use somersault::storage;
//!
//! let model = CartPendulum::default().model()?;
//! let path = std::env::temp_dir().join(format!("pendulum-{}.cbor", std::process::id()));
//! storage::save(&path, &model)?;
//! let found: somersault::multibody::Model = storage::load(&path)?;
//! assert_eq!(found.links(), model.links());
//! # std::fs::remove_file(&path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// Version of the format; files of later ones are refused.
pub const FORMAT_VERSION: u32 = 1;

const FORMAT: &str = "somersault";

/// What files can hold. Implement it for a user-defined type to have its files versioned and checked too.
pub trait Stored: Serialize + DeserializeOwned {
    /// What it is, in words; a file of another kind is refused.
    const KIND: &'static str;
}

macro_rules! kinds {
    ($($feature:literal: $($thing:ty: $kind:literal,)*)*) => {
        $($(
            #[cfg(feature = $feature)]
            impl Stored for $thing {
                const KIND: &'static str = $kind;
            }
        )*)*
    };
}

kinds! {
    "storage":
    somersault_integrators::body::RigidBody: "rigid body",
    somersault_integrators::state::RigidBodyState: "state of a rigid body",
    somersault_integrators::solution::Solution<somersault_integrators::state::Pose>: "motion of a rigid body",
    "multibody":
    somersault_multibody::Model: "tree of bodies",
    somersault_integrators::state::State<somersault_multibody::motion::Coordinates>: "state of a tree",
    somersault_integrators::solution::Solution<somersault_multibody::motion::Coordinates>: "motion of a tree",
    somersault_multibody::models::CartPendulum: "cart-pendulum",
    somersault_multibody::models::Diver: "diver",
    "nlp":
    somersault_nlp::Report: "solver's report",
    "ocp":
    somersault_ocp::swing_up::CartPendulumProblem: "swing-up",
    somersault_ocp::collocation::CollocationReport: "collocation",
    "dives":
    somersault_dives::Dive: "dive",
    somersault_dives::DiveReport: "judgement of a dive",
    "motion":
    somersault_motion::fit::MotionFit: "fitted motion",
    somersault_motion::scoring::ScoringModel: "scoring model",
    "ftla":
    somersault_ftla::shooting::Extremal: "extremal",
}

/// Why a thing could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StorageError {
    /// The file system.
    #[error("{}: {source}", path.display())]
    File {
        /// Of the file.
        path: PathBuf,
        /// What it says.
        source: io::Error,
    },
    /// The thing has no form in CBOR.
    #[error("a {kind} could not be written: {reason}")]
    Unwritable {
        /// Of the thing.
        kind: &'static str,
        /// Why.
        reason: String,
    },
    /// No file of this library, a damaged one, or parts that do not fit together.
    #[error("not a somersault {kind} file, or the file is corrupt: {reason}")]
    Damaged {
        /// Of the thing requested.
        kind: &'static str,
        /// What does not fit.
        reason: String,
    },
    /// Written by a later version.
    #[error("written in format {found} by somersault {version}, allowed is up to {FORMAT_VERSION}")]
    Version {
        /// Format of the file.
        found: u32,
        /// Version of the library that wrote it.
        version: String,
    },
    /// Another thing.
    #[error("the file holds a {found}, expected a {expected}")]
    Kind {
        /// Of the thing requested.
        expected: &'static str,
        /// Of the thing in the file.
        found: String,
    },
}

/// What a file holds. `C` is the thing, or nothing of interest.
#[derive(Serialize, Deserialize)]
struct Document<C> {
    format: String,
    format_version: u32,
    version: String,
    kind: String,
    content: C,
}

/// The document of a thing.
pub fn to_bytes<T: Stored>(thing: &T) -> Result<Vec<u8>, StorageError> {
    let document = Document {
        format: FORMAT.to_owned(),
        format_version: FORMAT_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        kind: T::KIND.to_owned(),
        content: thing,
    };
    let mut bytes = Vec::new();
    ciborium::into_writer(&document, &mut bytes)
        .map_err(|error| StorageError::Unwritable { kind: T::KIND, reason: error.to_string() })?;
    Ok(bytes)
}

/// The thing that [`to_bytes`] wrote.
pub fn from_bytes<T: Stored>(bytes: &[u8]) -> Result<T, StorageError> {
    let damaged = |reason: String| StorageError::Damaged { kind: T::KIND, reason };
    let Document::<IgnoredAny> { format, format_version, version, kind, .. } =
        ciborium::from_reader(bytes).map_err(|error| damaged(error.to_string()))?;
    if format != FORMAT {
        return Err(damaged(format!("the format is `{format}`")));
    }
    if !(1..=FORMAT_VERSION).contains(&format_version) {
        return Err(StorageError::Version { found: format_version, version });
    }
    if kind != T::KIND {
        return Err(StorageError::Kind { expected: T::KIND, found: kind });
    }
    let mut rest = bytes;
    let document: Document<T> =
        ciborium::from_reader(&mut rest).map_err(|error| damaged(error.to_string()))?;
    if !rest.is_empty() {
        return Err(damaged(format!("{} bytes follow its end", rest.len())));
    }
    Ok(document.content)
}

/// Writes a file that [`load`] reads; one that is there is replaced once the new one is whole.
pub fn save<T: Stored>(path: impl AsRef<Path>, thing: &T) -> Result<(), StorageError> {
    let path = path.as_ref();
    let bytes = to_bytes(thing)?;
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let whole = path.with_file_name(name);
    let written = std::fs::write(&whole, bytes).and_then(|()| std::fs::rename(&whole, path));
    written.map_err(|source| {
        // what is left of a failed write is of no use, and may not be there at all
        let _ = std::fs::remove_file(&whole);
        StorageError::File { path: path.to_owned(), source }
    })
}

/// Reads a file that [`save`] wrote.
pub fn load<T: Stored>(path: impl AsRef<Path>) -> Result<T, StorageError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| StorageError::File { path: path.to_owned(), source })?;
    from_bytes(&bytes)
}
