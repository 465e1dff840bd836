//! Kinds of arcs.

/// What a control does on an arc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlKind {
    /// It is at its lower bound.
    Lower,
    /// It is at its upper bound.
    Upper,
    /// H_u = 0 determines it, or the bound of a state that holds on the arc does.
    Interior,
    /// H_u = 0 on the arc though H is affine in the control: d²H_u/dt² = 0 determines it.
    Singular,
}

impl ControlKind {
    /// Whether the control is at one of its bounds.
    pub fn is_at_bound(self) -> bool {
        match self {
            Self::Lower | Self::Upper => true,
            Self::Interior | Self::Singular => false,
        }
    }
}

/// What controls and bounds of the state do on an arc.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArcKind {
    /// One for each control.
    pub controls: Vec<ControlKind>,
    /// The bound of the state that holds on the arc, if one does: its number among the finite ones.
    pub contact: Option<usize>,
}
