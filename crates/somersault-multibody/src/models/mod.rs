//! Trees with a name in the literature.

mod ball_jointed;
mod cart_pendulum;
mod diver;
mod posture;
mod two_link_arm;

pub use ball_jointed::BallJointedDiver;
pub use cart_pendulum::CartPendulum;
pub use diver::{Dimension, Diver, SegmentScales};
pub use posture::{Posture, PostureError};
pub use two_link_arm::TwoLinkArm;
