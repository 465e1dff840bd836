//! What it is for a joint to follow another.

/// A joint that follows another one: its coordinate is `multiplier` · q + `offset`, with q that of the leader.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Mimic {
    /// Name of the body that the leading joint carries.
    pub leader: String,
    /// Rate of the follower for a unit rate of the leader; rad and m as the two joints have them.
    pub multiplier: f64,
    /// Coordinate of the follower where that of the leader is zero, rad or m.
    pub offset: f64,
}
