//! How stiff a normal law is.

/// The force of a normal law at its greatest in a contact, and its derivatives there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stiffest {
    /// Force, N.
    pub force: f64,
    /// Its derivative by the penetration, N/m.
    pub stiffness: f64,
    /// Its derivative by the rate of penetration, N s/m.
    pub damping: f64,
}
