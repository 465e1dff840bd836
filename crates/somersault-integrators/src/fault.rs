//! Why equations of motion have no value.

use std::error::Error;
use std::fmt;
use std::sync::Arc;

/// The reason why equations of motion returned NaN: an error of the system's own type.
///
/// ```
/// use somersault_integrators::system::Fault;
///
/// let fault = Fault::new("x".parse::<f64>().unwrap_err());
/// assert!(fault.downcast_ref::<std::num::ParseFloatError>().is_some());
/// ```
#[derive(Debug, Clone)]
pub struct Fault(Arc<dyn Error + Send + Sync>);

impl Fault {
    /// The reason that an error tells.
    pub fn new(error: impl Error + Send + Sync + 'static) -> Self {
        Self(Arc::new(error))
    }

    /// The error, if it is of this type.
    pub fn downcast_ref<E: Error + 'static>(&self) -> Option<&E> {
        self.0.downcast_ref()
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Error for Fault {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.0.source()
    }
}

/// Faults are equal that say the same.
impl PartialEq for Fault {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}
