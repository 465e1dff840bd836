//! Trees with a name in the literature.

mod cart_pendulum;
mod two_link_arm;

pub use cart_pendulum::CartPendulum;
pub use two_link_arm::TwoLinkArm;
