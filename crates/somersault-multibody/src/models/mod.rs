//! Trees with a name in the literature.

mod cart_pendulum;
mod diver;
mod posture;
mod two_link_arm;

pub use cart_pendulum::CartPendulum;
pub use diver::{Dimension, Diver};
pub use posture::{Posture, PostureError};
pub use two_link_arm::TwoLinkArm;
